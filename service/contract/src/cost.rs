//! What a message takes in memory once it is decoded, told from its bytes and the descriptors of the contract: an empty message in
//! a list has two bytes as it is sent, and hundreds as a value.

use std::collections::{HashMap, HashSet};
use std::sync::LazyLock;

use prost_reflect::{Cardinality, FieldDescriptor, Kind, MessageDescriptor};

use crate::proto::DESCRIPTORS;

/// Depth at which decoding refuses a message.
const MAX_DEPTH: usize = 100;
/// What the allocator keeps beside a piece of memory, at most.
const PIECE_BYTES: u64 = 16;
/// Elements of no more bytes than these have space for four of them made at once, larger ones for one.
const SMALL_ELEMENT_BYTES: u64 = 1_024;

/// The kinds of messages that the contract knows.
static SHAPES: LazyLock<Shapes> = LazyLock::new(Shapes::new);

/// A kind of message whose costs can be told.
#[derive(Clone, Copy, Debug)]
pub struct Shape(usize);

impl Shape {
    /// The kind of this full name; `None` where no descriptor has it.
    #[must_use]
    pub fn named(full_name: &str) -> Option<Self> {
        SHAPES.by_name.get(full_name).copied().map(Self)
    }

    /// The most memory that a message takes besides the value itself and its bytes as they came, bytes. What decoding refuses costs what
    /// it takes until then.
    #[must_use]
    pub fn decoded_bytes(self, wire: &[u8]) -> u64 {
        let mut bytes = 0;
        // Where the walk breaks off decoding does as well.
        let _ = SHAPES.walk(self.0, wire, 0, &mut bytes);
        bytes
    }

    /// The most that a value has without what it points to, bytes.
    #[must_use]
    pub fn value_bytes(self) -> u64 {
        SHAPES.messages[self.0].value_bytes
    }
}

/// What a field of a message costs.
#[derive(Clone, Copy, Debug)]
struct Field {
    content: Content,
    /// Size of one of its values, where it is not within that of the message.
    element: u64,
    is_list: bool,
}

#[derive(Clone, Copy, Debug)]
enum Content {
    Varint,
    Fixed32,
    Fixed64,
    Text,
    /// They share the memory of the message as it came.
    Bytes,
    Message(usize),
}

#[derive(Debug, Default)]
struct Message {
    value_bytes: u64,
    /// Ascending by number.
    fields: Vec<(u32, Field)>,
}

impl Message {
    fn field(&self, number: u32) -> Option<&Field> {
        self.fields.binary_search_by_key(&number, |(number, _)| *number).ok().map(|at| &self.fields[at].1)
    }
}

#[derive(Debug)]
struct Shapes {
    messages: Vec<Message>,
    by_name: HashMap<String, usize>,
}

impl Shapes {
    fn new() -> Self {
        let known: Vec<_> = DESCRIPTORS.all_messages().collect();
        let by_name: HashMap<_, _> = known.iter().enumerate().map(|(at, m)| (m.full_name().to_owned(), at)).collect();
        let messages = known.iter().map(|message| Message {
            value_bytes: value_bytes(message),
            // They come ascending by number.
            fields: message.fields().map(|field| (field.number(), Field::of(&field, &by_name))).collect(),
        });
        Self { messages: messages.collect(), by_name }
    }

    /// Adds what decoding a message takes; `None` where decoding refuses it.
    fn walk(&self, message: usize, wire: &[u8], depth: usize, bytes: &mut u64) -> Option<()> {
        if depth > MAX_DEPTH {
            return None;
        }
        let (mut rest, mut groups, mut last) = (wire, 0_u32, 0);
        while !rest.is_empty() {
            let key = varint(&mut rest)?;
            let number = u32::try_from(key >> 3).ok()?;
            // Whatever a group holds is unknown.
            let field = if groups == 0 { self.messages[message].field(number) } else { None };
            let is_first = number != last;
            last = number;
            let part = match key & 7 {
                0 => {
                    varint(&mut rest)?;
                    None
                }
                1 => take(&mut rest, 8).map(|_| None)?,
                5 => take(&mut rest, 4).map(|_| None)?,
                2 => {
                    let length = varint(&mut rest)?;
                    Some(take(&mut rest, length)?)
                }
                3 => {
                    groups += 1;
                    continue;
                }
                4 => {
                    groups = groups.checked_sub(1)?;
                    continue;
                }
                _ => return None,
            };
            let Some(field) = field else { continue };
            *bytes += field.own_bytes(part, is_first);
            if let (Content::Message(inner), Some(part)) = (field.content, part) {
                self.walk(inner, part, depth + 1, bytes)?;
            }
        }
        Some(())
    }
}

impl Field {
    fn of(field: &FieldDescriptor, by_name: &HashMap<String, usize>) -> Self {
        let is_list = field.cardinality() == Cardinality::Repeated;
        let content = match field.kind() {
            Kind::Message(message) => Content::Message(by_name[message.full_name()]),
            Kind::String => Content::Text,
            Kind::Bytes => Content::Bytes,
            Kind::Double | Kind::Fixed64 | Kind::Sfixed64 => Content::Fixed64,
            Kind::Float | Kind::Fixed32 | Kind::Sfixed32 => Content::Fixed32,
            _ => Content::Varint,
        };
        let element = match field.kind() {
            Kind::Message(message) if is_list || is_boxed(field, &message) => value_bytes(&message),
            kind if is_list => plain_bytes(&kind),
            _ => 0,
        };
        Self { content, element, is_list }
    }

    /// What one occurrence takes without the fields of a message: `part` is what has a length, and `is_first` says that another field
    /// was before it.
    fn own_bytes(&self, part: Option<&[u8]>, is_first: bool) -> u64 {
        let values = match (self.content, part) {
            (Content::Varint, Some(packed)) => packed.iter().filter(|byte| **byte < 0x80).count() as u64,
            (Content::Fixed32, Some(packed)) => packed.len() as u64 / 4,
            (Content::Fixed64, Some(packed)) => packed.len() as u64 / 8,
            _ => 1,
        };
        let text = match (self.content, part) {
            (Content::Text, Some(text)) if !text.is_empty() => text.len() as u64 + PIECE_BYTES,
            _ => 0,
        };
        let list = match (self.is_list, self.element) {
            _ if values == 0 || self.element == 0 => 0,
            (false, element) => element + PIECE_BYTES,
            // A list has at most twice the space that it needs, and at least that of the first elements.
            (true, element) if is_first && element <= SMALL_ELEMENT_BYTES => element * (2 * values + 2) + PIECE_BYTES,
            (true, element) if is_first => element * 2 * values + PIECE_BYTES,
            (true, element) => element * 2 * values,
        };
        text + list
    }
}

/// The most that a value of a message has in Rust.
fn value_bytes(message: &MessageDescriptor) -> u64 {
    let of_unions = message.oneofs().filter(|union| !union.is_synthetic()).map(|union| {
        let largest = union.fields().map(|field| single_bytes(&field)).max();
        8 + largest.unwrap_or(0)
    });
    let is_in_union = |field: &FieldDescriptor| field.containing_oneof().is_some_and(|union| !union.is_synthetic());
    let of_fields = message.fields().filter(|field| !is_in_union(field)).map(|field| {
        match field.cardinality() {
            _ if field.is_map() => size_of::<HashMap<u64, u64>>() as u64,
            Cardinality::Repeated => size_of::<Vec<u64>>() as u64,
            // Whether it is there takes as much as its alignment.
            _ => 8 + single_bytes(&field),
        }
    });
    of_unions.sum::<u64>() + of_fields.sum::<u64>()
}

/// One value of a field, within the value of its message.
fn single_bytes(field: &FieldDescriptor) -> u64 {
    match field.kind() {
        Kind::Message(message) if is_boxed(field, &message) => 8,
        Kind::Message(message) => value_bytes(&message),
        kind => plain_bytes(&kind),
    }
}

fn plain_bytes(kind: &Kind) -> u64 {
    let bytes = match kind {
        Kind::String => size_of::<String>(),
        Kind::Bytes => size_of::<bytes::Bytes>(),
        Kind::Bool => 1,
        Kind::Enum(_) | Kind::Int32 | Kind::Uint32 | Kind::Sint32 | Kind::Float | Kind::Fixed32 | Kind::Sfixed32 => 4,
        _ => 8,
    };
    bytes as u64
}

/// Whether the message of a field could hold the field's own message again: then it is a pointer.
fn is_boxed(field: &FieldDescriptor, message: &MessageDescriptor) -> bool {
    let (mut open, mut seen) = (vec![message.clone()], HashSet::new());
    while let Some(next) = open.pop() {
        if next == *field.parent_message() {
            return field.cardinality() != Cardinality::Repeated;
        }
        if seen.insert(next.full_name().to_owned()) {
            let single = next.fields().filter(|field| field.cardinality() != Cardinality::Repeated);
            open.extend(single.filter_map(|field| field.kind().as_message().cloned()));
        }
    }
    false
}

fn take<'a>(rest: &mut &'a [u8], length: u64) -> Option<&'a [u8]> {
    let (part, after) = rest.split_at_checked(usize::try_from(length).ok()?)?;
    *rest = after;
    Some(part)
}

fn varint(rest: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..70).step_by(7) {
        let (byte, after) = rest.split_first()?;
        *rest = after;
        value |= u64::from(byte & 0x7f) << shift;
        if *byte < 0x80 {
            return Some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests;
