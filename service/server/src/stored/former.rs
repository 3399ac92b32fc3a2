//! What an earlier version of the contract named otherwise, or gave in another unit: its documents and decisions stay in the
//! store as they were written, and are read with the names and units of today.

use std::any::Any;
use std::f64::consts::PI;

use bytes::Bytes;
use feedwave_contract::{json, proto};
use prost::{DecodeError, Message, Name};
use prost_reflect::{Kind, MessageDescriptor};
use serde_json::Value;

/// Degrees per radian.
const DEGREES: f64 = 180.0 / PI;

/// A field of the JSON mapping as it was.
struct Former {
    message: &'static str,
    /// Name that it had.
    was: &'static str,
    /// Name that it has.
    is: &'static str,
    /// What a number is multiplied by.
    factor: f64,
}

const fn renamed(message: &'static str, was: &'static str, is: &'static str) -> Former {
    scaled(message, was, is, 1.0)
}

const fn scaled(message: &'static str, was: &'static str, is: &'static str, factor: f64) -> Former {
    Former { message, was, is, factor }
}

const FORMER: [Former; 21] = [
    renamed("IdleRunUp", "speedsRpm", "spindleRevPerMin"),
    renamed("SpindleBand", "aboveRpm", "aboveRevPerMin"),
    renamed("SpindleBand", "upToRpm", "upToRevPerMin"),
    renamed("SpindleBand", "speedRpm", "spindleRevPerMin"),
    renamed("PocketSearch", "lowestRpm", "lowestRevPerMin"),
    renamed("PocketSearch", "highestRpm", "highestRevPerMin"),
    renamed("Tool", "maxRevPerMin", "maxSpindleRevPerMin"),
    renamed("SpectrumSettings", "edges", "edgeCount"),
    renamed("MillingCut", "edges", "edgeCount"),
    renamed("WindowLength", "seconds", "durationS"),
    scaled("TurningRule", "lowerRad", "lowerDeg", DEGREES),
    scaled("TurningRule", "upperRad", "upperDeg", DEGREES),
    scaled("FollowingReport", "phaseLagRad", "phaseLagDeg", DEGREES),
    renamed("ChipReport", "feedPerRevMm", "feedMmPerRev"),
    renamed("ChipSpan", "feedPerRevMm", "feedMmPerRev"),
    renamed("OverrideReport", "largestBreakingFeedPerRevMm", "largestBreakingFeedMmPerRev"),
    renamed("OscillationSectionReport", "feedPerPeriodMm", "feedMmPerPeriod"),
    renamed("ThreadSectionReport", "ratio", "amplitudeRatio"),
    renamed("ThreadReport", "leastRatio", "leastAmplitudeRatio"),
    renamed("ThreadReport", "leastSectionRatio", "leastSectionAmplitudeRatio"),
    renamed("ProgramSummary", "bytes", "programBytes"),
];

/// A stored document.
///
/// # Errors
/// Where and why the text is not the JSON of such a message.
pub(super) fn document<M: Name + Default + 'static>(text: &str) -> Result<M, serde_json::Error> {
    // Most documents are of this version, and have no need to be taken apart.
    let mut message = if FORMER.iter().any(|former| text.contains(former.was)) {
        let mut value: Value = serde_json::from_str(text)?;
        rename(&json::descriptor::<M>(), &mut value);
        json::from_str(&value.to_string())?
    } else {
        json::from_str(text)?
    };
    let any: &mut dyn Any = &mut message;
    if let Some(report) = any.downcast_mut::<proto::ValidationReport>() {
        complete_report(report);
    } else if let Some(summary) = any.downcast_mut::<proto::ProgramSummary>() {
        complete_summary(summary);
    }
    Ok(message)
}

/// Fills fields that repeat a deprecated one where a document of before has only that.
#[expect(deprecated, reason = "what documents of before have")]
fn complete_report(report: &mut proto::ValidationReport) {
    report.summary.iter_mut().for_each(complete_summary);
    for section in &mut report.sections {
        section.axes.iter_mut().for_each(|axis| complete(&mut axis.axis, &axis.name));
        let exceeded = section.published_ends.as_mut().and_then(|ends| ends.exceeded.as_mut());
        exceeded.into_iter().for_each(|axis| complete(&mut axis.axis, &axis.name));
        if let Some(chip) = &mut section.chip {
            chip.spindle_speed_margin = chip.spindle_speed_margin.or(chip.speed_tolerance);
        }
    }
    if let Some(thinning) = &mut report.thinning {
        let compared = thinning.methods.iter_mut().flat_map(|method| &mut method.rotary_axes);
        thinning.rotary_axes.iter_mut().chain(compared).for_each(|axis| complete(&mut axis.axis, &axis.letter));
    }
}

#[expect(deprecated, reason = "what documents of before have")]
fn complete_summary(summary: &mut proto::ProgramSummary) {
    summary.axes.iter_mut().for_each(|axis| complete(&mut axis.axis, &axis.name));
}

fn complete(field: &mut String, former: &str) {
    if field.is_empty() {
        former.clone_into(field);
    }
}

/// Gives the fields of a message, and of those inside it, the names of today.
fn rename(descriptor: &MessageDescriptor, value: &mut Value) {
    let Value::Object(fields) = value else { return };
    for former in FORMER.iter().filter(|former| former.message == descriptor.name()) {
        if let Some(value) = fields.remove(former.was) {
            fields.entry(former.is).or_insert_with(|| times(value, former.factor));
        }
    }
    for field in descriptor.fields() {
        let Kind::Message(message) = field.kind() else { continue };
        match fields.get_mut(field.json_name()) {
            Some(Value::Array(values)) => values.iter_mut().for_each(|value| rename(&message, value)),
            Some(value) => rename(&message, value),
            None => {}
        }
    }
}

/// A number in another unit; anything else, such as `"Infinity"`, as it is.
fn times(value: Value, factor: f64) -> Value {
    match value.as_f64() {
        Some(number) if factor != 1.0 => Value::from(number * factor),
        _ => value,
    }
}

/// Angles of a stored decision that were in radians, at the numbers that their fields had.
mod in_radians {
    /// A decision.
    #[derive(Clone, PartialEq, prost::Message)]
    pub(super) struct Decision {
        #[prost(message, optional, tag = "9")]
        pub(super) inputs: Option<Inputs>,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    pub(super) struct Inputs {
        #[prost(message, optional, tag = "3")]
        pub(super) process: Option<Process>,
        #[prost(message, optional, tag = "6")]
        pub(super) rules: Option<Rules>,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    pub(super) struct Process {
        #[prost(message, optional, tag = "2")]
        pub(super) mean_angle: Option<MeanAngle>,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    pub(super) struct MeanAngle {
        #[prost(double, tag = "1")]
        pub(super) angle: f64,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    pub(super) struct Rules {
        #[prost(message, optional, tag = "3")]
        pub(super) spindle: Option<Spindle>,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    pub(super) struct Spindle {
        #[prost(message, optional, tag = "1")]
        pub(super) turning: Option<Turning>,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    pub(super) struct Turning {
        #[prost(double, tag = "1")]
        pub(super) lower: f64,
        #[prost(double, tag = "2")]
        pub(super) upper: f64,
    }
}

/// A stored decision.
///
/// # Errors
/// When the bytes are not one.
pub(crate) fn decision_from_stored(body: Bytes) -> Result<proto::Decision, DecodeError> {
    let former = in_radians::Decision::decode(body.clone())?.inputs.unwrap_or_default();
    let mut decision = proto::Decision::decode(body)?;
    let Some(inputs) = &mut decision.inputs else { return Ok(decision) };
    if let Some(angle) = former.process.and_then(|process| process.mean_angle).filter(|mean| mean.angle != 0.0)
        && let Some(proto::decision_inputs::Evidence::Process(process)) = &mut inputs.evidence
        && let Some(mean) = &mut process.mean_angle
    {
        mean.angle_deg = angle.angle * DEGREES;
    }
    if let Some(limits) = former.rules.and_then(|rules| rules.spindle).and_then(|spindle| spindle.turning)
        && (limits.lower, limits.upper) != (0.0, 0.0)
        && let Some(spindle) = inputs.rules.as_mut().and_then(|rules| rules.spindle.as_mut())
        && let Some(proto::spindle_rule::Rule::Turning(turning)) = &mut spindle.rule
    {
        (turning.lower_deg, turning.upper_deg) = (limits.lower * DEGREES, limits.upper * DEGREES);
    }
    Ok(decision)
}

#[cfg(test)]
mod tests {
    use proto::decision_inputs::Evidence;
    use proto::spindle_rule::Rule;
    use proto::window_length::Length;

    use super::*;

    #[test]
    fn every_name_of_the_table_is_gone_and_its_successor_there() {
        for Former { message, was, is, .. } in &FORMER {
            let descriptor = proto::DESCRIPTORS.get_message_by_name(&format!("feedwave.v1.{message}")).expect(message);
            assert!(descriptor.get_field_by_json_name(was).is_none(), "{message}.{was}");
            assert!(descriptor.get_field_by_json_name(is).is_some(), "{message}.{is}");
        }
    }

    #[test]
    fn a_document_of_an_earlier_version_is_read_with_its_values() {
        let monitoring: proto::MonitoringConfig = document(
            r#"{"window": {"seconds": 0.5}, "idleRunUp": {"speedsRpm": [1000, 2000]}, "spectrum": {"edges": 4},
                "rules": {"spindle": {"turning": {"lowerRad": -3.141592653589793, "upperRad": 0.5}}}}"#,
        )
        .unwrap();
        assert_eq!(monitoring.window.unwrap().length, Some(Length::DurationS(0.5)));
        assert_eq!(monitoring.idle_run_up.unwrap().spindle_rev_per_min, [1_000.0, 2_000.0]);
        assert_eq!(monitoring.spectrum.unwrap().edge_count, Some(4));
        let Some(Rule::Turning(turning)) = monitoring.rules.unwrap().spindle.unwrap().rule else { panic!("turning") };
        assert_eq!((turning.lower_deg, turning.upper_deg), (-180.0, 0.5 * 180.0 / PI));

        let report: proto::ValidationReport = document(
            r#"{"summary": {"bytes": "77"}, "threads": [{"ratio": 1.5, "report": {"leastRatio": 1.25}}],
                "sections": [{"chip": {"feedPerRevMm": 0.1}, "chipSpans": [{"feedPerRevMm": 0.2}]}]}"#,
        )
        .unwrap();
        assert_eq!(report.summary.unwrap().program_bytes, 77);
        assert_eq!(report.threads[0].amplitude_ratio, Some(1.5));
        assert_eq!(report.threads[0].report.as_ref().unwrap().least_amplitude_ratio, Some(1.25));
        assert_eq!(report.sections[0].chip.as_ref().unwrap().feed_mm_per_rev, 0.1);
        assert_eq!(report.sections[0].chip_spans[0].feed_mm_per_rev, 0.2);

        let report: proto::ValidationReport = document(
            r#"{"summary": {"axes": [{"name": "X1"}]}, "sections": [{"axes": [{"name": "Z"}],
                "publishedEnds": {"exceeded": {"name": "Z"}}, "chip": {"speedTolerance": {"minusRevPerMin": 7}}}],
                "thinning": {"rotaryAxes": [{"letter": "A"}], "methods": [{"rotaryAxes": [{"letter": "C"}]}]}}"#,
        )
        .unwrap();
        let (section, thinning) = (&report.sections[0], report.thinning.unwrap());
        let exceeded = section.published_ends.as_ref().unwrap().exceeded.as_ref().unwrap();
        let axes = [&report.summary.unwrap().axes[0].axis, &section.axes[0].axis, &exceeded.axis];
        assert_eq!(axes, ["X1", "Z", "Z"]);
        assert_eq!((&*thinning.rotary_axes[0].axis, &*thinning.methods[0].rotary_axes[0].axis), ("A", "C"));
        assert_eq!(section.chip.as_ref().unwrap().spindle_speed_margin.unwrap().minus_rev_per_min, 7.0);

        // A name that is of today in one message and was one of another.
        let tool: proto::Tool =
            document(r#"{"maxRevPerMin": 4000, "geometry": {"edges": [{"angleDeg": 90}]}}"#).unwrap();
        assert_eq!(tool.max_spindle_rev_per_min, Some(4_000.0));
        assert_eq!(tool.geometry.unwrap().edges[0].angle_deg, 90.0);
    }

    #[test]
    fn a_decision_of_an_earlier_version_keeps_its_angles() {
        let turning = proto::TurningRule { step: Some(0.1), ..Default::default() };
        let now = proto::Decision {
            number: 7,
            inputs: Some(proto::DecisionInputs {
                evidence: Some(Evidence::Process(proto::ProcessEvidence {
                    max_deviation: 0.1,
                    mean_angle: Some(proto::MeanAngle { concentration: 0.9, ..Default::default() }),
                    line: None,
                })),
                rules: Some(proto::DecisionRules {
                    spindle: Some(proto::SpindleRule { rule: Some(Rule::Turning(turning)) }),
                    ..Default::default()
                }),
                ..Default::default()
            }),
            ..Default::default()
        };
        // Messages are merged field by field, so that bytes of both together are those of the earlier version.
        let earlier = in_radians::Decision {
            inputs: Some(in_radians::Inputs {
                process: Some(in_radians::Process { mean_angle: Some(in_radians::MeanAngle { angle: PI / 2.0 }) }),
                rules: Some(in_radians::Rules {
                    spindle: Some(in_radians::Spindle {
                        turning: Some(in_radians::Turning { lower: -PI / 4.0, upper: PI }),
                    }),
                }),
            }),
        };
        let body = [now.encode_to_vec(), earlier.encode_to_vec()].concat();
        let read = decision_from_stored(body.into()).unwrap().inputs.unwrap();
        let Some(Evidence::Process(process)) = read.evidence else { panic!("process") };
        assert_eq!(process.max_deviation, 0.1);
        assert_eq!(process.mean_angle, Some(proto::MeanAngle { angle_deg: 90.0, concentration: 0.9 }));
        let Some(Rule::Turning(turning)) = read.rules.unwrap().spindle.unwrap().rule else { panic!("turning") };
        assert_eq!((turning.lower_deg, turning.upper_deg, turning.step), (-45.0, 180.0, Some(0.1)));
        assert_eq!(decision_from_stored(now.encode_to_vec().into()).unwrap(), now);
    }
}
