//! Messages by the million, each a line of JSON: straight from their fields, by functions that the build generates from the
//! descriptors (`build/lines.rs`). It is the same mapping, byte for byte, in a fraction of the time; what a message has in common
//! with the one before is copied.

mod text;

mod generated {
    #![allow(
        clippy::wildcard_imports,
        clippy::deref_addrof,
        clippy::suspicious_else_formatting,
        reason = "generated; the types are those of the contract"
    )]

    use super::{Line, Same, Text, Written, text};
    use crate::proto::*;

    include!(concat!(env!("OUT_DIR"), "/lines.rs"));
}

/// A value whose JSON may be the same as another's.
trait Same {
    /// Whether it is.
    fn is_same(&self, other: &Self) -> bool;
}

/// A message that is written as JSON.
trait Written {
    /// Appends it.
    fn write(&self, json: &mut Vec<u8>);
}

/// A message of which each is a line.
pub(super) trait Line: Default {
    /// How many fields it has.
    const FIELDS: usize;

    /// The first of the fields, ascending by number, that are all the same as those of `last`.
    fn same_from(&self, last: &Self) -> usize;

    /// Appends the fields before this one.
    fn write_fields(&self, before: usize, last: &Self, last_text: &Text, text: &mut Text);
}

/// A line, and where its fields begin; the last place is where they end.
#[derive(Clone, Debug, Default)]
pub(super) struct Text {
    json: Vec<u8>,
    starts: Vec<usize>,
}

impl Text {
    /// The text of a field's value, behind a key of this length.
    #[inline]
    fn value(&self, field: usize, key: usize) -> &[u8] {
        &self.json[self.starts[field] + key..self.starts[field + 1]]
    }
}

/// A message and its line.
#[derive(Clone, Debug, Default)]
struct Row<M> {
    message: M,
    text: Text,
}

/// Writes messages of one kind.
#[derive(Clone, Debug, Default)]
pub(super) struct LineWriter<M> {
    last: Row<M>,
    next: Text,
}

impl<M: Line> LineWriter<M> {
    /// Appends the next message.
    pub(super) fn append(&mut self, message: M, json: &mut Vec<u8>) {
        let Self { last, next } = self;
        next.starts.resize(M::FIELDS + 1, 0);
        next.json.clear();
        next.json.push(b'{');
        let is_first = last.text.json.is_empty();
        let same = if is_first { M::FIELDS } else { message.same_from(&last.message) };
        message.write_fields(same, &last.message, &last.text, next);
        if is_first || same == M::FIELDS {
            next.json.push(b'}');
        } else {
            let (from, to) = (last.text.starts[same], next.json.len());
            next.json.extend_from_slice(&last.text.json[from..]);
            for (start, of_last) in next.starts.iter_mut().zip(&last.text.starts).skip(same) {
                *start = of_last - from + to;
            }
        }
        json.extend_from_slice(&next.json);
        core::mem::swap(next, &mut last.text);
        last.message = message;
    }
}
