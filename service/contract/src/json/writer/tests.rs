use proptest::prelude::*;
use prost::{Message, Name};
use prost_reflect::{SerializeOptions, Value};
use serde_json::ser::{CompactFormatter, PrettyFormatter};

use super::*;
use crate::{json, proto};

/// Numbers from a seed.
struct Dice(u64);

impl Dice {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 ^ self.0 >> 29
    }

    fn below(&mut self, count: u64) -> u64 {
        (self.bits() >> 16) % count
    }

    /// A number of as many bits as one likes, and the ends of its range.
    fn wide(&mut self) -> u64 {
        match self.below(4) {
            0 => self.below(3),
            1 => u64::MAX - self.below(2),
            _ => self.bits() >> self.below(64),
        }
    }

    fn double(&mut self) -> f64 {
        const SPECIAL: [f64; 8] = [0.0, -0.0, 1.0, -0.5, 1e300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        match self.below(4) {
            0 => SPECIAL[self.below(8) as usize],
            1 => f64::from_bits(self.bits()),
            2 => self.below(100_000) as f64 / 1_000.0,
            _ => (self.bits() >> 11) as f64 / 1e9,
        }
    }

    fn text(&mut self) -> String {
        const PIECES: [&str; 9] = ["a", "Z9", " ", "\"", "\\", "\n", "\u{1}", "é", "🛠"];
        (0..self.below(6)).map(|_| PIECES[self.below(9) as usize]).collect()
    }
}

/// A message with fields as the dice fall, messages within each other this deep.
fn message(descriptor: &MessageDescriptor, dice: &mut Dice, depth: u32) -> DynamicMessage {
    let mut message = DynamicMessage::new(descriptor.clone());
    if descriptor.full_name() == "google.protobuf.Timestamp" {
        message.set_field_by_name("seconds", Value::I64(dice.below(4_000_000_000) as i64));
        message.set_field_by_name("nanos", Value::I32([0, 500_000_000, 1_000, 7][dice.below(4) as usize]));
        return message;
    }
    if descriptor.full_name() == "google.protobuf.FieldMask" {
        message.set_field_by_name("paths", Value::List(vec![Value::String("axes.max_velocity".into())]));
        return message;
    }
    for field in descriptor.fields() {
        if dice.below(3) == 0 || matches!(field.kind(), Kind::Message(_)) && depth == 0 {
            continue;
        }
        let value = if field.is_list() {
            Value::List((0..dice.below(4)).map(|_| value(&field.kind(), dice, depth)).collect())
        } else {
            value(&field.kind(), dice, depth)
        };
        message.set_field(&field, value);
    }
    message
}

fn value(kind: &Kind, dice: &mut Dice, depth: u32) -> Value {
    match kind {
        Kind::Bool => Value::Bool(dice.below(2) == 1),
        Kind::Int32 | Kind::Sint32 | Kind::Sfixed32 => Value::I32(dice.wide() as i32),
        Kind::Uint32 | Kind::Fixed32 => Value::U32(dice.wide() as u32),
        Kind::Int64 | Kind::Sint64 | Kind::Sfixed64 => Value::I64(dice.wide() as i64),
        Kind::Uint64 | Kind::Fixed64 => Value::U64(dice.wide()),
        Kind::Float => Value::F32(dice.double() as f32),
        Kind::Double => Value::F64(dice.double()),
        Kind::String => Value::String(dice.text()),
        Kind::Bytes => Value::Bytes((0..dice.below(9)).map(|_| dice.bits() as u8).collect()),
        Kind::Enum(names) => Value::EnumNumber(dice.below(names.values().len() as u64 + 2) as i32),
        Kind::Message(descriptor) => Value::Message(message(descriptor, dice, depth - 1)),
    }
}

/// What the mapping writes that this one stands for.
fn mapped<F: Formatter>(dynamic: &DynamicMessage, format: F) -> String {
    let mut json = serde_json::Serializer::with_formatter(Vec::new(), format);
    let options = SerializeOptions::new().skip_default_fields(false);
    dynamic.serialize_with_options(&mut json, &options).unwrap();
    String::from_utf8(json.into_inner()).unwrap()
}

fn written<F: Formatter>(descriptor: &MessageDescriptor, bytes: &[u8], mut format: F) -> String {
    let mut json = Vec::new();
    write(descriptor.full_name(), bytes, &mut format, &mut json);
    String::from_utf8(json).unwrap()
}

/// The same of a generated type, whose encoding has the members of a union where its first one is.
fn check_generated<M: Message + Name + Default>(dice: &mut Dice) {
    let dynamic = message(&json::descriptor::<M>(), dice, 3);
    let generated: M = dynamic.transcode_to().unwrap();
    // Its numbers are those of the type, such as 0 for -0.
    let dynamic = json::to_dynamic(&generated);
    assert_eq!(json::to_string(&generated), mapped(&dynamic, CompactFormatter));
    assert_eq!(json::to_string_pretty(&generated), mapped(&dynamic, PrettyFormatter::new()));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn every_message_is_written_as_the_mapping_does(seed: u64) {
        let mut dice = Dice(seed);
        let messages = DESCRIPTORS.all_messages();
        for descriptor in messages.filter(|message| message.package_name() == "feedwave.v1") {
            let bytes = message(&descriptor, &mut dice, 2).encode_to_vec();
            let dynamic = DynamicMessage::decode(descriptor.clone(), &bytes[..]).unwrap();
            let compact = written(&descriptor, &bytes, CompactFormatter);
            prop_assert_eq!(compact, mapped(&dynamic, CompactFormatter), "{}", descriptor.full_name());
            let pretty = written(&descriptor, &bytes, PrettyFormatter::new());
            prop_assert_eq!(pretty, mapped(&dynamic, PrettyFormatter::new()), "{}", descriptor.full_name());
        }
    }

    #[test]
    fn actions_are_written_as_the_mapping_does(seed: u64) {
        let mut dice = Dice(seed);
        let mut actions = json::Actions::default();
        let mut action = proto::Action::default();
        for _ in 0..40 {
            let other: proto::Action = message(&json::descriptor::<proto::Action>(), &mut dice, 3).transcode_to().unwrap();
            // Some of it as before, some of it at another place, some of it new.
            match dice.below(4) {
                0 => action.start = action.end.take(),
                1 => action = proto::Action { start: other.end, end: action.end, ..other },
                2 => (action.offset, action.line) = (other.offset, other.line),
                _ => {}
            }
            let mut json = Vec::new();
            actions.append(action.clone(), &mut json);
            prop_assert_eq!(String::from_utf8(json).unwrap(), json::to_string(&action));
        }
    }

    #[test]
    fn generated_types_are_written_as_the_mapping_does(seed: u64) {
        let mut dice = Dice(seed);
        check_generated::<proto::Action>(&mut dice);
        check_generated::<proto::CreateJobRequest>(&mut dice);
        check_generated::<proto::Decision>(&mut dice);
        check_generated::<proto::InterpretRequest>(&mut dice);
        check_generated::<proto::Job>(&mut dice);
        check_generated::<proto::Machine>(&mut dice);
        check_generated::<proto::Tool>(&mut dice);
        check_generated::<proto::ValidationReport>(&mut dice);
    }
}

#[test]
fn fields_that_are_encoded_in_another_order_are_written_by_number() {
    let descriptor = json::descriptor::<proto::InterpretRequest>();
    let source = Some(proto::interpret_request::Source::Program("programs/1".into()));
    let of_union = proto::InterpretRequest { source, ..Default::default() }.encode_to_vec();
    let behind = proto::InterpretRequest { tools: vec!["tools/1".into(), "tools/2".into()], ..Default::default() };
    let bytes = [behind.encode_to_vec(), of_union].concat();
    let json = written(&descriptor, &bytes, CompactFormatter);
    assert_eq!(json, r#"{"program":"programs/1","tools":["tools/1","tools/2"],"programs":[]}"#);
}

#[test]
fn what_is_absent_has_its_default_value() {
    assert_eq!(json::to_string(&proto::Vector::default()), r#"{"x":0.0,"y":0.0,"z":0.0}"#);
    let spline = proto::ActionSpline { first: vec![1.0, -2.5], ..Default::default() };
    assert_eq!(json::to_string(&spline), r#"{"order":0,"first":[1.0,-2.5],"second":[],"weights":[]}"#);
}
