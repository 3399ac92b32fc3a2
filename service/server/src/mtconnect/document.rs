//! The documents of the agent, before they are written as XML or as JSON.

use super::buffer::{Observation, Observed};
use super::model::{Category, Component, Device, Item};
use super::values::Value;

/// Version of the schemas.
pub(super) const SCHEMA: &str = "2.5";
/// Version of the agent, of which the first two numbers are those of the schemas.
pub(super) const AGENT: &str = "2.5.0.1";

/// The value of an attribute.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Attribute {
    Text(String),
    Number(u64),
    Decimal(f64),
}

/// Attributes, in their order.
pub(super) type Attributes = Vec<(&'static str, Attribute)>;

/// What an observation says.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Content {
    None,
    Text(String),
    Whole(u64),
    Number(f64),
    Vector([f64; 3]),
}

/// An observation as an element.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Entry {
    pub(super) element: String,
    pub(super) attributes: Attributes,
    pub(super) content: Content,
}

/// The observations of a component.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ComponentStream<'a> {
    pub(super) component: &'a Component,
    pub(super) samples: Vec<Entry>,
    pub(super) events: Vec<Entry>,
    pub(super) conditions: Vec<Entry>,
}

/// The observations of a device.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DeviceStream<'a> {
    pub(super) device: &'a Device,
    pub(super) components: Vec<ComponentStream<'a>>,
}

/// A document.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Document<'a> {
    Devices { header: Attributes, devices: Vec<&'a Device> },
    Streams { header: Attributes, streams: Vec<DeviceStream<'a>> },
    Error { header: Attributes, code: &'static str, message: String },
}

impl Document<'_> {
    /// The second half of its name: `MTConnectDevices` is `Devices`.
    pub(super) const fn kind(&self) -> &'static str {
        match self {
            Self::Devices { .. } => "Devices",
            Self::Streams { .. } => "Streams",
            Self::Error { .. } => "Error",
        }
    }

    pub(super) const fn header(&self) -> &Attributes {
        match self {
            Self::Devices { header, .. } | Self::Streams { header, .. } | Self::Error { header, .. } => header,
        }
    }
}

/// Puts observations, of one device in their order, into the streams of its components.
pub(super) fn device_stream<'a>(
    device: &'a Device,
    observations: impl IntoIterator<Item = (&'a Item, &'a Observation)>,
) -> DeviceStream<'a> {
    let empty =
        |component| ComponentStream { component, samples: Vec::new(), events: Vec::new(), conditions: Vec::new() };
    let mut components: Vec<_> = device.components.iter().map(empty).collect();
    for (item, observation) in observations {
        let stream = &mut components[item.component];
        let entry = entry(item, observation);
        match item.category {
            Category::Sample => stream.samples.push(entry),
            Category::Event => stream.events.push(entry),
            Category::Condition => stream.conditions.push(entry),
        }
    }
    components.retain(|stream| {
        let counts = [&stream.samples, &stream.events, &stream.conditions].map(Vec::len);
        counts.iter().any(|count| *count > 0)
    });
    DeviceStream { device, components }
}

/// A time as documents have it: UTC, with microseconds.
pub(super) fn time(us: i64) -> String {
    let time = jiff::Timestamp::from_microsecond(us).unwrap_or(jiff::Timestamp::UNIX_EPOCH);
    format!("{time:.6}")
}

fn text(value: impl Into<String>) -> Attribute {
    Attribute::Text(value.into())
}

fn entry(item: &Item, observation: &Observation) -> Entry {
    let mut attributes: Attributes = vec![
        ("dataItemId", text(&item.id)),
        ("sequence", Attribute::Number(observation.sequence)),
        ("timestamp", text(time(observation.time_us))),
    ];
    attributes.extend(item.repeated().map(|(name, value)| (name, text(value))));
    if item.category == Category::Condition {
        attributes.push(("type", text(item.kind)));
        return condition(attributes, &observation.what);
    }
    let content = match &observation.what {
        Observed::Value(value) => match value {
            Value::Text(value) => Content::Text(value.clone()),
            Value::Whole(value) => Content::Whole(*value),
            Value::Number(value) => Content::Number(*value),
            Value::OfWindow(value, window_s) => {
                attributes.push(("duration", Attribute::Decimal(*window_s)));
                Content::Number(*value)
            }
            Value::Vector(value) => Content::Vector(*value),
            Value::Unavailable | Value::Condition(_) => Content::Text("UNAVAILABLE".to_owned()),
        },
        Observed::Active(_) | Observed::Over(_) | Observed::Normal => Content::None,
    };
    Entry { element: item.element(), attributes, content }
}

fn condition(mut attributes: Attributes, what: &Observed) -> Entry {
    let (element, content) = match what {
        Observed::Active(active) => {
            attributes.push(("nativeCode", text(&active.code)));
            attributes.push(("conditionId", text(&active.code)));
            attributes.extend(active.qualifier.map(|qualifier| ("qualifier", text(qualifier))));
            let level = if active.is_fault { "Fault" } else { "Warning" };
            (level, Content::Text(active.text.clone()))
        }
        Observed::Over(code) => {
            attributes.push(("nativeCode", text(code)));
            ("Normal", Content::None)
        }
        Observed::Normal => ("Normal", Content::None),
        Observed::Value(_) => ("Unavailable", Content::None),
    };
    Entry { element: element.to_owned(), attributes, content }
}
