//! Documents as JSON, in version 2 of the mapping: arrays under the names of elements, attributes as members.

use serde_json::{Map, Value, json};

use super::document::{Attribute, Attributes, ComponentStream, Content, Document, Entry, SCHEMA};
use super::model::Device;

/// Writes a document.
pub(super) fn write(document: &Document<'_>) -> String {
    let mut inside = Map::new();
    inside.insert("jsonVersion".to_owned(), json!(2));
    inside.insert("schemaVersion".to_owned(), json!(SCHEMA));
    inside.insert("Header".to_owned(), Value::Object(members(document.header())));
    let (name, content) = match document {
        Document::Devices { devices, .. } => {
            ("Devices", one("Device", devices.iter().map(|device| Value::Object(component(device, 0))).collect()))
        }
        Document::Streams { streams, .. } => {
            let stream = |stream: &super::document::DeviceStream<'_>| {
                json!({
                    "name": stream.device.id,
                    "uuid": stream.device.uuid(),
                    "ComponentStream": stream.components.iter().map(component_stream).collect::<Vec<_>>(),
                })
            };
            ("Streams", one("DeviceStream", streams.iter().map(stream).collect()))
        }
        Document::Error { code, message, .. } => {
            ("Errors", one("Error", vec![json!({ "errorCode": code, "value": message })]))
        }
    };
    inside.insert(name.to_owned(), content);
    json!({ format!("MTConnect{}", document.kind()): inside }).to_string()
}

/// `{name: list}`; nothing where the list is empty.
fn one(name: &str, list: Vec<Value>) -> Value {
    if list.is_empty() { json!({}) } else { json!({ name: list }) }
}

/// Appends to the list with this name.
fn append(lists: &mut Map<String, Value>, name: &str, value: Value) {
    if let Some(list) = lists.entry(name).or_insert_with(|| json!([])).as_array_mut() {
        list.push(value);
    }
}

fn members(attributes: &Attributes) -> Map<String, Value> {
    let value = |value: &Attribute| match value {
        Attribute::Text(text) => json!(text),
        Attribute::Number(number) => json!(number),
        Attribute::Decimal(number) => json!(number),
    };
    attributes.iter().map(|(name, attribute)| ((*name).to_owned(), value(attribute))).collect()
}

fn component(device: &Device, index: usize) -> Map<String, Value> {
    let own = &device.components[index];
    let mut members = Map::new();
    members.insert("id".to_owned(), json!(own.id));
    if let Some(name) = &own.name {
        members.insert("name".to_owned(), json!(name));
    }
    if index == 0 {
        members.insert("uuid".to_owned(), json!(device.uuid()));
    }
    let mut specifications = Map::new();
    for (item, limits) in device.limits_of(index) {
        let (name, around) = limits.elements();
        let numbers: Map<_, _> = limits.numbers().map(|(name, number)| (name.to_owned(), json!(number))).collect();
        let numbers = match around {
            Some(around) => Map::from_iter([(around.to_owned(), Value::Object(numbers))]),
            None => numbers,
        };
        let own = limits.attributes(item).into_iter().map(|(name, value)| (name.to_owned(), json!(value)));
        append(&mut specifications, name, Value::Object(own.chain(numbers).collect()));
    }
    if !specifications.is_empty() {
        members.insert("Configuration".to_owned(), json!({ "Specifications": specifications }));
    }
    let items = device.items.iter().filter(|item| item.component == index);
    let items: Vec<Value> = items
        .map(|item| {
            let mut members = Map::new();
            members.insert("id".to_owned(), json!(item.id));
            members.extend(item.attributes().into_iter().map(|(name, value)| (name.to_owned(), json!(value))));
            if let Some(constant) = item.constant {
                members.insert("Constraints".to_owned(), json!({ "Value": [{ "value": constant }] }));
            }
            Value::Object(members)
        })
        .collect();
    if !items.is_empty() {
        members.insert("DataItems".to_owned(), one("DataItem", items));
    }
    let mut parts = Map::new();
    for (part, below) in device.components.iter().enumerate().filter(|(_, part)| part.parent == Some(index)) {
        append(&mut parts, below.kind, Value::Object(component(device, part)));
    }
    if !parts.is_empty() {
        members.insert("Components".to_owned(), Value::Object(parts));
    }
    members
}

fn component_stream(stream: &ComponentStream<'_>) -> Value {
    let component = stream.component;
    let mut members = Map::new();
    members.insert("component".to_owned(), json!(component.kind));
    members.insert("componentId".to_owned(), json!(component.id));
    if let Some(name) = &component.name {
        members.insert("name".to_owned(), json!(name));
    }
    for (name, entries) in [("Samples", &stream.samples), ("Events", &stream.events), ("Condition", &stream.conditions)]
    {
        if !entries.is_empty() {
            members.insert(name.to_owned(), Value::Object(by_element(entries)));
        }
    }
    Value::Object(members)
}

fn by_element(entries: &[Entry]) -> Map<String, Value> {
    let mut lists = Map::new();
    for entry in entries {
        let mut own = members(&entry.attributes);
        let value = match &entry.content {
            Content::None => None,
            Content::Text(text) => Some(json!(text)),
            Content::Whole(number) => Some(json!(number)),
            Content::Number(number) => Some(json!(number)),
            Content::Vector(values) => Some(json!(values)),
        };
        own.extend(value.map(|value| ("value".to_owned(), value)));
        append(&mut lists, &entry.element, Value::Object(own));
    }
    lists
}
