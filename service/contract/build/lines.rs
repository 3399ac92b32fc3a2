//! Generates how messages that commands write by the million become lines of JSON, from the descriptors of the contract: one function
//! for each message, straight from its fields. What the lines are is held against the mapping by the tests of `json`.

use std::fmt::{self, Write as _};

use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorSet};

/// The package of the contract, with the points that names of types have.
const PACKAGE: &str = ".feedwave.v1.";

/// Messages of which each is a line.
const LINES: [&str; 1] = ["Action"];

/// The implementations of `Written` for the lines and all messages within them, and of `Line` for the lines.
pub fn generate(descriptors: &FileDescriptorSet) -> Result<String, fmt::Error> {
    let mut code = String::new();
    let mut names: Vec<String> = LINES.map(str::to_owned).to_vec();
    let mut done = 0;
    while let Some(name) = names.get(done).cloned() {
        let message = message(descriptors, &name);
        let fields = fields(message);
        for field in &fields {
            if let Value::Message(inner) = &field.value
                && !names.contains(inner)
            {
                names.push(inner.clone());
            }
        }
        write_message(&mut code, &name, &fields)?;
        if done < LINES.len() {
            write_line(&mut code, &name, &fields)?;
        }
        done += 1;
    }
    Ok(code)
}

/// A field, as far as writing it goes.
struct Field {
    /// Its name in Rust.
    name: String,
    /// Comma, name and colon.
    key: String,
    is_list: bool,
    /// It may be absent: it is then not written.
    is_optional: bool,
    value: Value,
}

enum Value {
    /// A function of `text` writes it.
    Scalar(&'static str),
    Enum(String),
    Message(String),
}

fn message<'a>(descriptors: &'a FileDescriptorSet, name: &str) -> &'a DescriptorProto {
    let messages = descriptors.file.iter().filter(|file| format!(".{}.", file.package()) == PACKAGE);
    let found = messages.flat_map(|file| &file.message_type).find(|message| message.name() == name);
    found.unwrap_or_else(|| panic!("{name} is no message of the contract"))
}

/// The fields of a message, ascending by number, as they are written.
fn fields(message: &DescriptorProto) -> Vec<Field> {
    let mut fields: Vec<_> = message.field.iter().collect();
    fields.sort_by_key(|field| field.number());
    fields.into_iter().map(|field| Field::of(field, message.name())).collect()
}

impl Field {
    fn of(field: &FieldDescriptorProto, message: &str) -> Self {
        let is_in_union = field.oneof_index.is_some() && !field.proto3_optional();
        assert!(!is_in_union, "{message}.{}: lines have no unions", field.name());
        let type_name = || {
            let name = field.type_name().strip_prefix(PACKAGE);
            name.unwrap_or_else(|| panic!("{message}.{}: lines have types of the contract only", field.name()))
                .to_owned()
        };
        let value = match field.r#type() {
            Type::Bool => Value::Scalar("bool"),
            Type::Uint32 => Value::Scalar("u32"),
            Type::Double => Value::Scalar("f64"),
            Type::String => Value::Scalar("string"),
            Type::Enum => Value::Enum(type_name()),
            Type::Message => Value::Message(type_name()),
            other => panic!("{message}.{}: lines have no {other:?}", field.name()),
        };
        let is_list = field.label() == Label::Repeated;
        let is_optional = field.proto3_optional() || matches!(value, Value::Message(_)) && !is_list;
        let key = format!(",\"{}\":", field.json_name());
        Self { name: field.name().to_owned(), key, is_list, is_optional, value }
    }

    /// The call that writes one value of it.
    fn write_value(&self, of: &str) -> String {
        match &self.value {
            Value::Scalar("string") => format!("text::string({of}, json);"),
            Value::Scalar(kind) => format!("text::{kind}(*{of}, json);"),
            Value::Enum(name) => {
                format!("text::name({name}::try_from(*{of}).map(|value| value.as_str_name()), *{of}, json);")
            }
            Value::Message(_) => format!("{of}.write(json);"),
        }
    }

    /// Statements that write it, if it is there; its key without the comma where it is the first.
    fn write(&self, is_first: bool) -> String {
        let Self { name, .. } = self;
        let key = format!("json.extend_from_slice(b{:?});", &self.key[usize::from(is_first)..]);
        if self.is_list {
            format!("{key} text::list(&self.{name}, json, |value, json| {{ {} }});", self.write_value("value"))
        } else if self.is_optional {
            assert!(!is_first, "{name}: the first field of a message in a line is always there");
            format!("if let Some(value) = &self.{name} {{ {key} {} }}", self.write_value("value"))
        } else if matches!(self.value, Value::Scalar("f64")) {
            // The encoding knows no negative zero where a value may not be absent.
            format!("{key} text::f64(self.{name} + 0.0, json);")
        } else {
            format!("{key} {}", self.write_value(&format!("&self.{name}")))
        }
    }

    /// The message that is its only value.
    fn single_message(&self) -> Option<&str> {
        match &self.value {
            Value::Message(name) if !self.is_list => Some(name),
            _ => None,
        }
    }
}

fn write_message(code: &mut String, name: &str, fields: &[Field]) -> fmt::Result {
    writeln!(code, "impl Written for {name} {{\n#[inline]\nfn write(&self, json: &mut Vec<u8>) {{\njson.push(b'{{');")?;
    let zeros = fields.len() - zeros(fields).len();
    for (place, field) in fields.iter().enumerate() {
        if place == zeros {
            write_zeros(code, &fields[zeros..])?;
        }
        writeln!(code, "{}", field.write(place == 0))?;
    }
    writeln!(code, "json.push(b'}}');\n}}\n}}")?;
    let same: Vec<_> = fields.iter().map(|field| format!("self.{0}.is_same(&other.{0})", field.name)).collect();
    let same = same.join("\n&& ");
    writeln!(code, "impl Same for {name} {{\n#[inline]\nfn is_same(&self, other: &Self) -> bool {{\n{same}\n}}\n}}")
}

/// The numbers at the end of a message that are often all zero: those behind the first three of a row of them, such as the axes
/// behind X, Y and Z.
fn zeros(fields: &[Field]) -> &[Field] {
    let is_number =
        |field: &&Field| matches!(field.value, Value::Scalar("f64")) && !field.is_list && !field.is_optional;
    let row = fields.iter().rev().take_while(is_number).count();
    if row > 4 { &fields[fields.len() - row + 3..] } else { &[] }
}

/// Writes them at once where all are zero.
fn write_zeros(code: &mut String, fields: &[Field]) -> fmt::Result {
    let bits: Vec<_> = fields.iter().map(|field| format!("self.{}.to_bits()", field.name)).collect();
    let text: String = fields.iter().map(|field| format!("{}0.0", field.key)).collect();
    let text = format!("{text}}}");
    writeln!(code, "if ({}) << 1 == 0 {{ return json.extend_from_slice(b{text:?}); }}", bits.join(" | "))
}

fn write_line(code: &mut String, name: &str, fields: &[Field]) -> fmt::Result {
    let count = fields.len();
    writeln!(code, "impl Line for {name} {{\nconst FIELDS: usize = {count};")?;
    writeln!(code, "#[inline]\nfn same_from(&self, last: &Self) -> usize {{")?;
    for (place, field) in fields.iter().enumerate().rev() {
        writeln!(code, "if !self.{0}.is_same(&last.{0}) {{ return {1}; }}", field.name, place + 1)?;
    }
    writeln!(code, "0\n}}")?;
    writeln!(
        code,
        "#[inline]\nfn write_fields(&self, before: usize, last: &Self, last_text: &Text, text: &mut Text) {{"
    )?;
    writeln!(code, "let Text {{ json, starts }} = text;")?;
    for (place, field) in fields.iter().enumerate() {
        writeln!(code, "if before == {place} {{ return; }}\nstarts[{place}] = json.len();")?;
        match field.single_message() {
            Some(message) => write_copied(code, fields, place, message)?,
            None => writeln!(code, "{}", field.write(place == 0))?,
        }
    }
    writeln!(code, "starts[{count}] = json.len();\n}}\n}}")
}

/// A message that is as one of the same kind that was written is copied.
fn write_copied(code: &mut String, fields: &[Field], place: usize, message: &str) -> fmt::Result {
    let Field { name, key, .. } = &fields[place];
    let is_alike = |field: &Field| field.single_message() == Some(message);
    let is_same = |of: &str| format!("if {of}.as_ref().is_some_and(|other| value.is_same(other))");
    writeln!(code, "if let Some(value) = &self.{name} {{\njson.extend_from_slice(b{key:?});")?;
    for (other, field) in fields.iter().enumerate().take(place).filter(|(_, field)| is_alike(field)) {
        let (condition, key, end) = (is_same(&format!("self.{}", field.name)), field.key.len(), other + 1);
        writeln!(code, "{condition} {{ json.extend_from_within(starts[{other}] + {key}..starts[{end}]); }} else")?;
    }
    for (other, field) in fields.iter().enumerate().filter(|(_, field)| is_alike(field)) {
        let (condition, key) = (is_same(&format!("last.{}", field.name)), field.key.len());
        writeln!(code, "{condition} {{ json.extend_from_slice(last_text.value({other}, {key})); }} else")?;
    }
    writeln!(code, "{{ value.write(json); }}\n}}")
}
