//! Messages of the contract as files that people write, TOML or JSON: the protobuf JSON mapping, with field names as in
//! the proto or in JSON. Everything that a file says is taken or refused: unknown fields, values of the wrong type and
//! fields given twice are violations with their path.

use std::fmt;

use prost::Name;
use prost_reflect::{DeserializeOptions, DynamicMessage, FieldDescriptor, Kind, MessageDescriptor};
use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};

use crate::json::descriptor;
use crate::violations::Violations;

/// Key under which the TOML reader hands over a date.
const TOML_DATE: &str = "$__toml_private_datetime";

/// How a file is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Syntax {
    /// TOML.
    Toml,
    /// JSON.
    Json,
}

/// A field of a former form of these files.
#[derive(Clone, Copy, Debug)]
pub struct FormerField {
    /// Message that had it, such as `Waveform`.
    pub message: &'static str,
    /// Its name.
    pub field: &'static str,
    /// What to write now.
    pub now: &'static str,
    /// Whether its own fields are now next to it.
    pub flattened: bool,
}

/// What a file says, before it is known as which message it is meant.
#[derive(Clone, Debug, PartialEq)]
pub struct Document(Value);

impl Document {
    /// Reads a file.
    ///
    /// # Errors
    /// Where the text is not of this syntax or gives a key twice, and why.
    pub fn parse(text: &str, syntax: Syntax) -> Result<Self, String> {
        let tree: Tree = match syntax {
            Syntax::Json => serde_json::from_str(text).map_err(|error| error.to_string())?,
            Syntax::Toml => toml::from_str(text).map_err(|error| {
                let place = error.span().map(|span| place(text, span.start)).unwrap_or_default();
                format!("{}{place}", error.message())
            })?,
        };
        Ok(Self(tree.0))
    }

    /// Whether it states the field at the end of these names, each as in the proto.
    #[must_use]
    pub fn states(&self, path: &[&str]) -> bool {
        let mut value = Some(&self.0);
        for name in path {
            value = value.and_then(|value| value.get(name).or_else(|| value.get(json_name(name))));
        }
        value.is_some_and(|value| !value.is_null())
    }

    /// The document as a message.
    ///
    /// # Errors
    /// Everything in it that such a message does not have, each with its path. `former` says what to write in the stead
    /// of fields that files had once.
    pub fn message<M: Name + Default>(&self, former: &[FormerField]) -> Result<M, Violations> {
        let mut check = Check { former, violations: Violations::default() };
        check.message("", &self.0, &descriptor::<M>());
        if !check.violations.is_empty() {
            return Err(check.violations);
        }
        let failed = |error: &dyn fmt::Display| {
            let mut violations = Violations::default();
            violations.add("", error.to_string());
            violations
        };
        let dynamic = read(descriptor::<M>(), &self.0).map_err(|error| failed(&error))?;
        dynamic.transcode_to().map_err(|error| failed(&error))
    }
}

fn read(descriptor: MessageDescriptor, value: &Value) -> Result<DynamicMessage, serde_json::Error> {
    DynamicMessage::deserialize_with_options(descriptor, value, &DeserializeOptions::new())
}

/// Line and column of a byte, counted from 1.
fn place(text: &str, offset: usize) -> String {
    let before = text.get(..offset).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |end| end + 1);
    let (line, column) = (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1);
    format!(" at line {line} column {column}")
}

/// Finds everything in a document that a message does not have.
struct Check<'a> {
    former: &'a [FormerField],
    violations: Violations,
}

impl Check<'_> {
    fn message(&mut self, path: &str, value: &Value, descriptor: &MessageDescriptor) {
        let Value::Object(entries) = value else {
            self.violations.add(path, not_a_table(value, descriptor));
            return;
        };
        let mut given: Vec<(FieldDescriptor, &str)> = Vec::new();
        for (key, value) in entries {
            let Some(field) = field(descriptor, key) else {
                self.unknown(&joined(path, key), key, value, descriptor);
                continue;
            };
            let path = joined(path, field.name());
            if let Some((_, other)) = given.iter().find(|(earlier, _)| *earlier == field) {
                self.violations.add(&path, format!("is given twice, as {other} and as {key}"));
            }
            let choice = |earlier: &FieldDescriptor| {
                let oneof = earlier.containing_oneof().filter(|oneof| !oneof.is_synthetic());
                oneof.is_some() && oneof == field.containing_oneof() && *earlier != field
            };
            if let Some((other, _)) = given.iter().find(|(earlier, _)| choice(earlier)) {
                self.violations.add(&path, format!("excludes {}: state one of them", other.name()));
            }
            self.field(&path, key, value, &field);
            given.push((field, key));
        }
    }

    fn field(&mut self, path: &str, key: &str, value: &Value, field: &FieldDescriptor) {
        let kind = field.kind();
        let message = kind.as_message().filter(|message| message.package_name() != "google.protobuf");
        match value {
            // As the JSON mapping has it: not given.
            Value::Null => {}
            Value::Array(items) if field.is_list() => {
                for (index, item) in items.iter().enumerate() {
                    let path = format!("{path}[{index}]");
                    match message {
                        Some(message) => self.message(&path, item, message),
                        None => self.leaf(&path, key, &Value::Array(vec![item.clone()]), item, field),
                    }
                }
            }
            value if field.is_list() => {
                self.violations.add(path, format!("must be a list, is {}", quoted(value)));
            }
            value => match message {
                Some(message) => self.message(path, value, message),
                None => self.leaf(path, key, value, value, field),
            },
        }
    }

    /// A value without fields of its own, as the JSON mapping reads it; `shown` is what people see of it.
    fn leaf(&mut self, path: &str, key: &str, value: &Value, shown: &Value, field: &FieldDescriptor) {
        let alone = Value::Object(Map::from_iter([(key.to_owned(), value.clone())]));
        if shown.is_null() || read(field.parent_message().clone(), &alone).is_err() {
            self.violations.add(path, format!("must be {}, is {}", expected(&field.kind(), shown), quoted(shown)));
        }
    }

    /// A key that is no field, and which one may be meant.
    fn unknown(&mut self, path: &str, key: &str, value: &Value, descriptor: &MessageDescriptor) {
        let message = descriptor.name();
        if let Some(former) = self.former.iter().find(|former| former.message == message && former.field == key) {
            self.violations.add(path, format!("is of a former form of these files: write {}", former.now));
            if former.flattened {
                self.message(path, value, descriptor);
            }
            return;
        }
        let names: Vec<String> = descriptor.fields().map(|field| field.name().to_owned()).collect();
        let reason = match nearest(key, names.iter().map(String::as_str)) {
            Some(name) => format!("is not a field of {message}, is {name} meant?"),
            None => format!("is not a field of {message}, which are {}", names.join(", ")),
        };
        self.violations.add(path, reason);
    }
}

/// The field with this name, as in the proto or in JSON.
fn field(descriptor: &MessageDescriptor, key: &str) -> Option<FieldDescriptor> {
    descriptor.get_field_by_name(key).or_else(|| descriptor.get_field_by_json_name(key))
}

/// The path of a field as JSON writes it: `profile.machine.axes[0].maxVelocity`.
#[must_use]
pub fn json_path(path: &str) -> String {
    path.split('.').map(json_name).collect::<Vec<_>>().join(".")
}

/// The JSON name of a field.
fn json_name(name: &str) -> String {
    let mut words = name.split('_');
    let first = words.next().unwrap_or_default().to_owned();
    words.fold(first, |name, word| {
        let (initial, rest) = word.split_at(word.len().min(1));
        name + &initial.to_ascii_uppercase() + rest
    })
}

fn joined(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}

/// What is written where a message is meant, and how it is written.
fn not_a_table(value: &Value, descriptor: &MessageDescriptor) -> String {
    let fields: Vec<_> = descriptor.fields().collect();
    if let Value::Array(items) = value
        && items.len() <= fields.len()
        && items.iter().all(Value::is_number)
    {
        let pairs: Vec<_> =
            fields.iter().zip(items).map(|(field, item)| format!("{} = {item}", field.name())).collect();
        return format!("is a list, write {{ {} }}", pairs.join(", "));
    }
    let names: Vec<_> = fields.iter().map(FieldDescriptor::name).collect();
    format!("must be a table of {}, is {}", names.join(", "), quoted(value))
}

/// What a field of this kind takes.
fn expected(kind: &Kind, given: &Value) -> String {
    match kind {
        Kind::Double | Kind::Float => "a number".to_owned(),
        Kind::Int32 | Kind::Sint32 | Kind::Sfixed32 => format!("a whole number from {} to {}", i32::MIN, i32::MAX),
        Kind::Uint32 | Kind::Fixed32 => format!("a whole number from 0 to {}", u32::MAX),
        Kind::Int64 | Kind::Sint64 | Kind::Sfixed64 => format!("a whole number from {} to {}", i64::MIN, i64::MAX),
        Kind::Uint64 | Kind::Fixed64 => format!("a whole number from 0 to {}", u64::MAX),
        Kind::Bool => "true or false".to_owned(),
        Kind::String => "a text".to_owned(),
        Kind::Bytes => "bytes in base64".to_owned(),
        Kind::Message(message) => format!("a {} as the JSON mapping of protobuf writes it", message.name()),
        Kind::Enum(values) => {
            let names: Vec<String> = values.values().map(|value| value.name().to_owned()).collect();
            // The names begin with that of the enumeration, which people leave out.
            let last_words = |text: &str| {
                given.as_str().is_some_and(|given| {
                    text.to_ascii_lowercase().ends_with(&format!("_{}", given.to_ascii_lowercase()))
                })
            };
            match names.iter().find(|name| last_words(name)) {
                Some(name) => format!("{name:?}"),
                None => format!("one of {}", names[1..].join(", ")),
            }
        }
    }
}

fn quoted(value: &Value) -> String {
    match value {
        Value::Object(_) => "a table".to_owned(),
        Value::Array(_) => "a list".to_owned(),
        value => value.to_string(),
    }
}

/// The name that a text is most like, if it is like one.
fn nearest<'a>(text: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    const ALIKE: f64 = 0.85;
    let text = text.to_ascii_lowercase();
    let measured =
        names.map(|name| (strsim::jaro_winkler(&text, name), name)).filter(|(likeness, _)| *likeness > ALIKE);
    measured.max_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, name)| name)
}

/// A document as it is read: keys that are given twice are refused, numbers that JSON does not have become the texts that
/// the JSON mapping has for them, dates texts.
struct Tree(Value);

impl<'de> Deserialize<'de> for Tree {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(TreeVisitor).map(Self)
    }
}

struct TreeVisitor;

impl<'de> Visitor<'de> for TreeVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(match Number::from_f64(value) {
            Some(number) => number.into(),
            None if value.is_nan() => "NaN".into(),
            None if value > 0.0 => "Infinity".into(),
            None => "-Infinity".into(),
        })
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut list = Vec::new();
        while let Some(Tree(item)) = items.next_element()? {
            list.push(item);
        }
        Ok(list.into())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut table = Map::new();
        while let Some((key, Tree(value))) = entries.next_entry::<String, Tree>()? {
            if key == TOML_DATE {
                return Ok(value);
            }
            if table.insert(key.clone(), value).is_some() {
                return Err(A::Error::custom(format!("{key:?} is given twice")));
            }
        }
        Ok(table.into())
    }
}

#[cfg(test)]
mod tests;
