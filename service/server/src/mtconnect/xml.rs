//! Documents as XML.

use std::fmt::Write as _;

use super::document::{Attribute, Attributes, Content, Document, Entry, SCHEMA};
use super::model::Device;

/// Writes a document.
pub(super) fn write(document: &Document<'_>) -> String {
    let kind = document.kind();
    let mut out = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let urn = format!("urn:mtconnect.org:MTConnect{kind}:{SCHEMA}");
    let _ = writeln!(
        out,
        "<MTConnect{kind} xmlns=\"{urn}\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
         xsi:schemaLocation=\"{urn} http://schemas.mtconnect.org/schemas/MTConnect{kind}_{SCHEMA}.xsd\">"
    );
    open(&mut out, 1, "Header", document.header(), true);
    match document {
        Document::Devices { devices, .. } => {
            container(&mut out, 1, "Devices", devices.is_empty(), |out| {
                devices.iter().for_each(|device| component(out, device, 0, 2));
            });
        }
        Document::Streams { streams, .. } => {
            container(&mut out, 1, "Streams", streams.is_empty(), |out| {
                for stream in streams {
                    let device = stream.device;
                    let attributes = vec![("name", named(&device.id)), ("uuid", Attribute::Text(device.uuid()))];
                    open(out, 2, "DeviceStream", &attributes, false);
                    stream.components.iter().for_each(|stream| component_stream(out, stream));
                    close(out, 2, "DeviceStream");
                }
            });
        }
        Document::Error { code, message, .. } => {
            container(&mut out, 1, "Errors", false, |out| {
                let attributes = vec![("errorCode", named(code))];
                element(out, 2, "Error", &attributes, &Content::Text(message.clone()));
            });
        }
    }
    let _ = writeln!(out, "</MTConnect{kind}>");
    out
}

fn named(text: &str) -> Attribute {
    Attribute::Text(text.to_owned())
}

fn indent(out: &mut String, depth: usize) {
    out.extend(std::iter::repeat_n("  ", depth));
}

/// An element with what `inside` writes, or an empty one.
fn container(out: &mut String, depth: usize, name: &str, is_empty: bool, inside: impl FnOnce(&mut String)) {
    open(out, depth, name, &Vec::new(), is_empty);
    if !is_empty {
        inside(out);
        close(out, depth, name);
    }
}

fn open(out: &mut String, depth: usize, name: &str, attributes: &Attributes, is_empty: bool) {
    indent(out, depth);
    let _ = write!(out, "<{name}");
    write_attributes(out, attributes);
    out.push_str(if is_empty { "/>\n" } else { ">\n" });
}

fn close(out: &mut String, depth: usize, name: &str) {
    indent(out, depth);
    let _ = writeln!(out, "</{name}>");
}

fn write_attributes(out: &mut String, attributes: &Attributes) {
    for (name, value) in attributes {
        let _ = write!(out, " {name}=\"");
        match value {
            Attribute::Text(text) => escape(out, text),
            Attribute::Number(number) => {
                let _ = write!(out, "{number}");
            }
            Attribute::Decimal(number) => {
                let _ = write!(out, "{number}");
            }
        }
        out.push('"');
    }
}

/// An element with a text.
fn element(out: &mut String, depth: usize, name: &str, attributes: &Attributes, content: &Content) {
    indent(out, depth);
    let _ = write!(out, "<{name}");
    write_attributes(out, attributes);
    match content {
        Content::None => {
            out.push_str("/>\n");
            return;
        }
        Content::Text(text) => {
            out.push('>');
            escape(out, text);
        }
        Content::Whole(number) => {
            let _ = write!(out, ">{number}");
        }
        Content::Number(number) => {
            let _ = write!(out, ">{number}");
        }
        Content::Vector([x, y, z]) => {
            let _ = write!(out, ">{x} {y} {z}");
        }
    }
    let _ = writeln!(out, "</{name}>");
}

/// Characters that XML has another meaning for are written otherwise; those that it cannot have are replaced.
fn escape(out: &mut String, text: &str) {
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' | '\n' | '\r' => out.push(' '),
            '\0'..='\u{1f}' | '\u{7f}'..='\u{9f}' | '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
}

fn component(out: &mut String, device: &Device, index: usize, depth: usize) {
    let component = &device.components[index];
    let mut attributes: Attributes = vec![("id", named(&component.id))];
    attributes.extend(component.name.as_deref().map(|name| ("name", named(name))));
    if index == 0 {
        attributes.push(("uuid", Attribute::Text(device.uuid())));
    }
    open(out, depth, component.kind, &attributes, false);
    configuration(out, device, index, depth + 1);
    let items: Vec<_> = device.items.iter().filter(|item| item.component == index).collect();
    if !items.is_empty() {
        open(out, depth + 1, "DataItems", &Vec::new(), false);
        for item in items {
            let mut attributes: Attributes = vec![("id", named(&item.id))];
            attributes.extend(item.attributes().into_iter().map(|(name, value)| (name, Attribute::Text(value))));
            open(out, depth + 2, "DataItem", &attributes, item.constant.is_none());
            if let Some(constant) = item.constant {
                open(out, depth + 3, "Constraints", &Vec::new(), false);
                element(out, depth + 4, "Value", &Vec::new(), &Content::Text(constant.to_owned()));
                close(out, depth + 3, "Constraints");
                close(out, depth + 2, "DataItem");
            }
        }
        close(out, depth + 1, "DataItems");
    }
    let parts = device.components.iter().enumerate().filter(|(_, part)| part.parent == Some(index));
    let parts: Vec<usize> = parts.map(|(part, _)| part).collect();
    if !parts.is_empty() {
        open(out, depth + 1, "Components", &Vec::new(), false);
        parts.into_iter().for_each(|part| self::component(out, device, part, depth + 2));
        close(out, depth + 1, "Components");
    }
    close(out, depth, component.kind);
}

/// The limits of a component's data items.
fn configuration(out: &mut String, device: &Device, index: usize, depth: usize) {
    let limits: Vec<_> = device.limits_of(index).collect();
    if limits.is_empty() {
        return;
    }
    open(out, depth, "Configuration", &Vec::new(), false);
    open(out, depth + 1, "Specifications", &Vec::new(), false);
    for (item, limits) in limits {
        let (name, around) = limits.elements();
        let attributes = limits.attributes(item).into_iter().map(|(name, value)| (name, Attribute::Text(value)));
        open(out, depth + 2, name, &attributes.collect(), false);
        if let Some(around) = around {
            open(out, depth + 3, around, &Vec::new(), false);
        }
        for (name, number) in limits.numbers() {
            element(out, depth + 4, name, &Vec::new(), &Content::Number(number));
        }
        if let Some(around) = around {
            close(out, depth + 3, around);
        }
        close(out, depth + 2, name);
    }
    close(out, depth + 1, "Specifications");
    close(out, depth, "Configuration");
}

fn component_stream(out: &mut String, stream: &super::document::ComponentStream<'_>) {
    let component = stream.component;
    let mut attributes: Attributes = vec![("component", named(component.kind))];
    attributes.extend(component.name.as_deref().map(|name| ("name", named(name))));
    attributes.push(("componentId", named(&component.id)));
    open(out, 3, "ComponentStream", &attributes, false);
    for (name, entries) in [("Samples", &stream.samples), ("Events", &stream.events), ("Condition", &stream.conditions)]
    {
        if !entries.is_empty() {
            open(out, 4, name, &Vec::new(), false);
            let write = |entry: &Entry| element(out, 5, &entry.element, &entry.attributes, &entry.content);
            entries.iter().for_each(write);
            close(out, 4, name);
        }
    }
    close(out, 3, "ComponentStream");
}
