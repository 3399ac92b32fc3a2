//! The protobuf JSON mapping of the contract's messages: what the HTTP port shows and what the store keeps.

mod lines;
#[cfg(feature = "services")]
mod status;
mod wire;
mod writer;

pub use prost::Name;
use prost_reflect::{DeserializeOptions, DynamicMessage, MessageDescriptor};
use serde_json::ser::{CompactFormatter, PrettyFormatter};

use crate::proto::{Action, DESCRIPTORS};
#[cfg(feature = "services")]
pub use status::status_to_string;
use writer::special;

/// The descriptor of a message of the contract.
#[must_use]
pub fn descriptor<M: Name>() -> MessageDescriptor {
    DESCRIPTORS.get_message_by_name(&M::full_name()).expect("every generated message is in the descriptor set")
}

/// A message as a dynamic one.
#[must_use]
pub fn to_dynamic<M: Name>(message: &M) -> DynamicMessage {
    let mut dynamic = DynamicMessage::new(descriptor::<M>());
    dynamic.transcode_from(message).expect("the descriptors are those the type was generated from");
    dynamic
}

/// A message as JSON. Fields at their default value are written too, so that readers see every name; absent
/// messages and optional fields are not.
#[must_use]
pub fn to_string<M: Name>(message: &M) -> String {
    let mut json = Vec::new();
    writer::write(&M::full_name(), &message.encode_to_vec(), &mut CompactFormatter, &mut json);
    String::from_utf8(json).expect("JSON is UTF-8")
}

/// Writes actions as [`to_string`] does, in a fraction of the time.
#[derive(Clone, Debug, Default)]
pub struct Actions(lines::LineWriter<Action>);

impl Actions {
    /// Appends the JSON of the next action.
    #[inline]
    pub fn append(&mut self, action: Action, json: &mut Vec<u8>) {
        self.0.append(action, json);
    }
}

/// The same with one field a line, for people and for files.
#[must_use]
pub fn to_string_pretty<M: Name>(message: &M) -> String {
    let mut json = Vec::new();
    writer::write(&M::full_name(), &message.encode_to_vec(), &mut PrettyFormatter::new(), &mut json);
    String::from_utf8(json).expect("JSON is UTF-8")
}

/// A message from its JSON; unknown fields are passed over, since a later version of the contract may have more.
///
/// # Errors
/// Where and why the text is not the JSON of such a message.
pub fn from_str<M: Name + Default>(text: &str) -> Result<M, serde_json::Error> {
    let mut json = serde_json::Deserializer::from_str(text);
    let options = DeserializeOptions::new().deny_unknown_fields(false);
    let dynamic = DynamicMessage::deserialize_with_options(descriptor::<M>(), &mut json, &options)?;
    Ok(dynamic.transcode_to().expect("the type was generated from these descriptors"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::proto;

    #[test]
    fn numbers_keep_every_bit() {
        let mut state = 7_u64;
        let random = core::iter::repeat_with(|| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            [f64::from_bits(state), (state >> 11) as f64 / (1_u64 << 53) as f64]
        });
        let known = [970.000_000_000_000_1, 0.857_374_999_999_999_9, f64::MAX, f64::from_bits(1), -0.1];
        for duration_s in known.into_iter().chain(random.take(1_000).flatten()).filter(|value| value.is_finite()) {
            let summary = proto::ProgramSummary { duration_s, ..Default::default() };
            for json in [to_string(&summary), to_string_pretty(&summary)] {
                let read: proto::ProgramSummary = from_str(&json).unwrap();
                assert_eq!(read.duration_s.to_bits(), duration_s.to_bits(), "{json}");
            }
        }
    }

    #[test]
    fn wide_integers_are_strings_and_enums_are_names() {
        let summary = proto::ProgramSummary { setpoint_count: u64::MAX, ..Default::default() };
        let job = proto::Job { state: proto::JobState::Ready.into(), summary: Some(summary), ..Default::default() };
        let json: serde_json::Value = serde_json::from_str(&to_string(&job)).unwrap();
        assert_eq!(json["state"], "JOB_STATE_READY");
        assert_eq!(json["summary"]["setpointCount"], "18446744073709551615");
        assert_eq!(json["displayName"], "");
        assert!(json.get("settings").is_none());
    }
}
