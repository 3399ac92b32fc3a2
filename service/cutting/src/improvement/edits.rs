//! Changes of words, by the places of the words in the program as it was given.

use std::collections::BTreeMap;

use super::WordChange;
use super::words::{Lines, Word};

/// Words with what takes their place.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Edits {
    by_place: BTreeMap<(u32, u32), WordChange>,
}

impl Edits {
    /// Puts something in the place of a word; what it was before, where that is something else.
    pub(super) fn set(&mut self, word: &Word, new: String) -> Option<WordChange> {
        let (place, new) = ((word.span.line, word.span.column), word.in_its_case(new));
        let known = self.by_place.remove(&place);
        let old = known.map_or_else(|| word.text.clone(), |change| change.new);
        if new != word.text {
            self.by_place.insert(place, WordChange { span: word.span, old: word.text.clone(), new: new.clone() });
        }
        (old != new).then_some(WordChange { span: word.span, old, new })
    }

    /// The program with the changes.
    pub(super) fn apply(&self, program: &[u8], lines: &Lines) -> Vec<u8> {
        let mut improved = Vec::with_capacity(program.len() + 16 * self.by_place.len());
        let mut copied = 0;
        for change in self.by_place.values() {
            let Some(start) = lines.offset(change.span) else { continue };
            improved.extend_from_slice(&program[copied..start]);
            improved.extend_from_slice(change.new.as_bytes());
            copied = start + change.span.length as usize;
        }
        improved.extend_from_slice(&program[copied..]);
        improved
    }

    /// The changes, in the order of the program.
    pub(super) fn into_changes(self) -> Vec<WordChange> {
        self.by_place.into_values().collect()
    }
}
