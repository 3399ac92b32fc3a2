//! Writes messages as JSON straight from their bytes, by a table that the contract's descriptors give once.
//!
//! It writes what the mapping of `prost_reflect` writes, byte for byte; that one first makes a map of every message with a value for
//! every field, which costs several times as much. A test holds both against each other for every message of the contract.

#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::io;
use std::sync::LazyLock;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use prost_reflect::{DescriptorPool, DynamicMessage, FieldDescriptor, Kind, MessageDescriptor};
use serde_json::ser::Formatter;

use super::wire::{self, Raw, Record};
use crate::proto::DESCRIPTORS;

/// Every message of the contract.
static MESSAGES: LazyLock<Messages> = LazyLock::new(|| Messages::of(&DESCRIPTORS));

/// How messages are written, by their full names.
struct Messages {
    places: HashMap<String, usize>,
    rows: Vec<MessageRow>,
}

/// How a message is written.
#[derive(Debug)]
struct MessageRow {
    /// Ascending by number, as they are written.
    fields: Vec<FieldRow>,
    /// Its encoding may have fields in another order, as that of the members of a union is the place of the first.
    has_union: bool,
}

/// How a field is written.
#[derive(Debug)]
struct FieldRow {
    number: u32,
    /// Its name with quotation marks.
    key: String,
    shape: Shape,
    value: ValueKind,
    /// What is written where a single value is absent: most fields of most messages are.
    absent: String,
}

/// When a field is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    /// Always: where it is absent, with its default value.
    Single,
    /// Where it is present.
    Optional,
    /// Always, with any number of values.
    List,
}

/// How a value is encoded, and what it is as JSON.
#[derive(Debug)]
enum ValueKind {
    Bool,
    /// `int32`
    Int32,
    /// `uint32`
    Uint32,
    /// `sint32`
    Sint32,
    /// `fixed32`
    Fixed32,
    /// `sfixed32`
    Sfixed32,
    /// `int64`; numbers of 64 bits are strings.
    Int64,
    /// `uint64`
    Uint64,
    /// `sint64`
    Sint64,
    /// `fixed64`
    Fixed64,
    /// `sfixed64`
    Sfixed64,
    Float,
    Double,
    String,
    /// As base64.
    Bytes,
    /// Numbers and their names with quotation marks, ascending.
    Enum(Vec<(i32, String)>),
    /// The place of its row.
    Message(usize),
    /// A message of `google.protobuf` that is one value, such as a time.
    WellKnown(MessageDescriptor),
}

/// Appends a message as JSON; `bytes` is its encoding by its generated type.
pub(super) fn write<F: Formatter>(full_name: &str, bytes: &[u8], format: &mut F, json: &mut Vec<u8>) {
    let mut writer = Writer { messages: &MESSAGES, format, json };
    writer.message(MESSAGES.row(full_name), bytes).expect("writing into memory does not fail");
}

impl Messages {
    fn of(pool: &DescriptorPool) -> Self {
        let messages: Vec<_> = pool.all_messages().collect();
        let names = messages.iter().enumerate();
        let places: HashMap<_, _> = names.map(|(place, message)| (message.full_name().to_owned(), place)).collect();
        let rows = messages.iter().map(|message| MessageRow::of(message, &places)).collect();
        Self { places, rows }
    }

    fn row(&self, full_name: &str) -> &MessageRow {
        let place = self.places.get(full_name).expect("every generated message is in the descriptor set");
        &self.rows[*place]
    }
}

impl MessageRow {
    fn of(message: &MessageDescriptor, places: &HashMap<String, usize>) -> Self {
        let fields = message.fields().map(|field| FieldRow::of(&field, places)).collect();
        Self { fields, has_union: message.oneofs().any(|union| union.fields().len() > 1) }
    }
}

impl FieldRow {
    fn of(field: &FieldDescriptor, places: &HashMap<String, usize>) -> Self {
        let shape = match (field.is_list(), field.supports_presence()) {
            (true, _) => Shape::List,
            (false, true) => Shape::Optional,
            (false, false) => Shape::Single,
        };
        let value = ValueKind::of(&field.kind(), places);
        let absent = if shape == Shape::Single { value.absent().to_owned() } else { String::new() };
        let key = quoted(field.json_name());
        Self { number: field.number(), key, shape, value, absent }
    }
}

impl ValueKind {
    fn of(kind: &Kind, places: &HashMap<String, usize>) -> Self {
        match kind {
            Kind::Bool => Self::Bool,
            Kind::Int32 => Self::Int32,
            Kind::Uint32 => Self::Uint32,
            Kind::Sint32 => Self::Sint32,
            Kind::Fixed32 => Self::Fixed32,
            Kind::Sfixed32 => Self::Sfixed32,
            Kind::Int64 => Self::Int64,
            Kind::Uint64 => Self::Uint64,
            Kind::Sint64 => Self::Sint64,
            Kind::Fixed64 => Self::Fixed64,
            Kind::Sfixed64 => Self::Sfixed64,
            Kind::Float => Self::Float,
            Kind::Double => Self::Double,
            Kind::String => Self::String,
            Kind::Bytes => Self::Bytes,
            Kind::Enum(names) => {
                let mut rows: Vec<_> = names.values().map(|value| (value.number(), quoted(value.name()))).collect();
                rows.sort_by_key(|(number, _)| *number);
                Self::Enum(rows)
            }
            Kind::Message(message) if message.full_name().starts_with("google.protobuf.") => {
                Self::WellKnown(message.clone())
            }
            Kind::Message(message) => Self::Message(places[message.full_name()]),
        }
    }

    /// How one value of a packed list is encoded.
    const fn wire(&self) -> wire::Type {
        match self {
            Self::Double | Self::Fixed64 | Self::Sfixed64 => wire::Type::Fixed64,
            Self::Float | Self::Fixed32 | Self::Sfixed32 => wire::Type::Fixed32,
            Self::String | Self::Bytes | Self::Message(_) | Self::WellKnown(_) => wire::Type::Bytes,
            _ => wire::Type::Varint,
        }
    }

    /// The default value, which is absent in the encoding.
    fn absent(&self) -> &str {
        match self {
            Self::Bool => "false",
            Self::Int32 | Self::Uint32 | Self::Sint32 | Self::Fixed32 | Self::Sfixed32 => "0",
            Self::Int64 | Self::Uint64 | Self::Sint64 | Self::Fixed64 | Self::Sfixed64 => "\"0\"",
            Self::Float | Self::Double => "0.0",
            Self::String | Self::Bytes => "\"\"",
            Self::Enum(names) => names.iter().find(|(number, _)| *number == 0).map_or("0", |(_, name)| name),
            // Absent messages are not written.
            Self::Message(_) | Self::WellKnown(_) => "null",
        }
    }
}

/// A text as a JSON string.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// The records of a message, with the next one in sight.
struct Ahead<'b, I> {
    next: Option<Record<'b>>,
    rest: I,
}

impl<'b, I: Iterator<Item = Record<'b>>> Ahead<'b, I> {
    fn new(mut rest: I) -> Self {
        Self { next: rest.next(), rest }
    }

    /// The next record, if it is of this field.
    #[inline]
    fn of(&mut self, number: u32) -> Option<Record<'b>> {
        let found = self.next.filter(|record| record.number == number)?;
        self.next = self.rest.next();
        Some(found)
    }
}

/// Where the JSON goes, and in which format.
struct Writer<'a, F> {
    messages: &'a Messages,
    format: &'a mut F,
    json: &'a mut Vec<u8>,
}

impl<F: Formatter> Writer<'_, F> {
    fn message(&mut self, row: &MessageRow, bytes: &[u8]) -> io::Result<()> {
        if !row.has_union {
            return self.fields(row, Ahead::new(wire::records(bytes)));
        }
        let mut records: Vec<_> = wire::records(bytes).collect();
        records.sort_by_key(|record| record.number);
        self.fields(row, Ahead::new(records.into_iter()))
    }

    /// Writes the fields of a message; its records are ascending by number.
    fn fields<'b>(
        &mut self,
        row: &MessageRow,
        mut records: Ahead<'b, impl Iterator<Item = Record<'b>>>,
    ) -> io::Result<()> {
        let mut is_first = true;
        self.format.begin_object(self.json)?;
        for field in &row.fields {
            let present = records.of(field.number);
            if present.is_none() && field.shape == Shape::Optional {
                continue;
            }
            let is_absent = present.is_none() && field.shape == Shape::Single;
            self.key(field, is_first)?;
            if is_absent {
                self.format.write_raw_fragment(self.json, &field.absent)?;
            }
            is_first = false;
            match present {
                first if field.shape == Shape::List => self.list(field, first, &mut records)?,
                Some(record) => self.value(&field.value, record.value)?,
                None => {}
            }
            self.format.end_object_value(self.json)?;
        }
        self.format.end_object(self.json)
    }

    /// Writes the name of a field, up to its value.
    fn key(&mut self, field: &FieldRow, is_first: bool) -> io::Result<()> {
        self.format.begin_object_key(self.json, is_first)?;
        self.format.write_raw_fragment(self.json, &field.key)?;
        self.format.end_object_key(self.json)?;
        self.format.begin_object_value(self.json)
    }

    /// Writes every value of a list: each in a record of its own, or all in one.
    fn list<'b>(
        &mut self,
        field: &FieldRow,
        first: Option<Record<'b>>,
        records: &mut Ahead<'b, impl Iterator<Item = Record<'b>>>,
    ) -> io::Result<()> {
        let mut is_first = true;
        self.format.begin_array(self.json)?;
        let mut next = first;
        while let Some(record) = next {
            match record.value {
                Raw::Bytes(packed) if field.value.wire() != wire::Type::Bytes => {
                    for value in wire::packed(packed, field.value.wire()) {
                        self.element(&field.value, value, &mut is_first)?;
                    }
                }
                value => self.element(&field.value, value, &mut is_first)?,
            }
            next = records.of(field.number);
        }
        self.format.end_array(self.json)
    }

    fn element(&mut self, kind: &ValueKind, value: Raw<'_>, is_first: &mut bool) -> io::Result<()> {
        self.format.begin_array_value(self.json, *is_first)?;
        *is_first = false;
        self.value(kind, value)?;
        self.format.end_array_value(self.json)
    }

    fn value(&mut self, kind: &ValueKind, value: Raw<'_>) -> io::Result<()> {
        let number = value.number();
        match kind {
            ValueKind::Bool => self.format.write_bool(self.json, number != 0),
            ValueKind::Int32 | ValueKind::Sfixed32 => self.format.write_i32(self.json, number as i32),
            ValueKind::Uint32 | ValueKind::Fixed32 => self.format.write_u32(self.json, number as u32),
            ValueKind::Sint32 => self.format.write_i32(self.json, wire::unfold(number) as i32),
            ValueKind::Int64 | ValueKind::Sfixed64 => self.wide(number as i64),
            ValueKind::Sint64 => self.wide(wire::unfold(number)),
            ValueKind::Uint64 | ValueKind::Fixed64 => {
                self.format.begin_string(self.json)?;
                self.format.write_u64(self.json, number)?;
                self.format.end_string(self.json)
            }
            ValueKind::Float => {
                let value = f32::from_bits(number as u32);
                match special(f64::from(value)) {
                    Some(name) => self.format.write_raw_fragment(self.json, name),
                    None => self.format.write_f32(self.json, value),
                }
            }
            ValueKind::Double => {
                let value = f64::from_bits(number);
                match special(value) {
                    Some(name) => self.format.write_raw_fragment(self.json, name),
                    None => self.format.write_f64(self.json, value),
                }
            }
            ValueKind::String => self.text(&String::from_utf8_lossy(value.bytes())),
            ValueKind::Bytes => self.text(&BASE64_STANDARD.encode(value.bytes())),
            ValueKind::Enum(names) => {
                let number = number as i32;
                match names.binary_search_by_key(&number, |(number, _)| *number) {
                    Ok(place) => self.format.write_raw_fragment(self.json, &names[place].1),
                    Err(_) => self.format.write_i32(self.json, number),
                }
            }
            ValueKind::Message(place) => self.message(&self.messages.rows[*place], value.bytes()),
            ValueKind::WellKnown(descriptor) => {
                let message = DynamicMessage::decode(descriptor.clone(), value.bytes()).map_err(io::Error::other)?;
                Ok(serde_json::to_writer(&mut *self.json, &message)?)
            }
        }
    }

    /// A number of 64 bits, which not every reader of JSON keeps.
    fn wide(&mut self, number: i64) -> io::Result<()> {
        self.format.begin_string(self.json)?;
        self.format.write_i64(self.json, number)?;
        self.format.end_string(self.json)
    }

    fn text(&mut self, text: &str) -> io::Result<()> {
        Ok(serde_json::to_writer(&mut *self.json, text)?)
    }
}

/// The name of what is no number in JSON.
pub(super) fn special(value: f64) -> Option<&'static str> {
    match value {
        _ if value.is_finite() => None,
        f64::INFINITY => Some("\"Infinity\""),
        f64::NEG_INFINITY => Some("\"-Infinity\""),
        _ => Some("\"NaN\""),
    }
}
