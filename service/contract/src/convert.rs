//! Between the contract's messages and the types of the pipeline: once on entry, with every violation reported,
//! and once on exit.

mod action;
mod decision;
mod drilling;
mod feed_override;
mod functions;
mod improvement;
mod language;
mod learning;
mod lobes;
mod machine_codes;
mod monitoring;
mod offsets;
mod parameters;
mod profile;
mod report;
mod report_size;
mod settings;
mod tool;

use prost_types::Timestamp;

pub use action::action_to_proto;
pub use decision::{
    action_name, decision_from_proto, decision_to_proto, overrides_to_proto, spindle_answer_from_proto, state_to_proto,
};
pub use feed_override::{check_holds, overrides_from_proto};
pub use functions::path_vibration::{
    generation_mode_from_proto, generation_mode_to_proto, vibration_envelope_from_proto, vibration_envelope_to_proto,
};
pub use functions::thread::{
    rotation_to_proto, thread_from_proto, thread_plan_to_proto, thread_report_to_proto, thread_request_from_proto,
    thread_to_proto,
};
pub use functions::tool_oscillation::{oscillation_request_from_proto, oscillation_request_to_proto};
pub use improvement::{RequestedGoals, improvement_goals_from_proto, improvement_to_proto, stability_chart};
pub use learning::{
    LearningPlan, MAX_LEARNING_RUNS, conditions_of, learning_names, learning_record_of, recorded_cut_to_proto,
    recording_from_proto, recording_to_proto,
};
pub use lobes::{StabilityModel, pocket_search_from_proto, stability_model_from_proto};
pub use monitoring::{monitoring_from_proto, monitoring_to_proto};
pub use offsets::check_offsets;
pub use profile::{profile_from_proto, profile_to_proto};
pub use report::{finding_to_proto, report_to_proto, summary_to_proto};
pub use settings::{
    MAX_TOOLS, RequestedSettings, check_file_names, check_period_us, pipeline_config, settings_from_proto,
};
pub use tool::{check_named_tool, check_tool, check_tools, tool_for_pipeline};

use crate::violations::Violations;

/// Most further program files of a job.
pub const MAX_PROGRAM_FILES: usize = 1_000;

/// Longest name for people, characters.
pub const MAX_DISPLAY_NAME: usize = 200;

/// An enumeration's value; a violation where this version does not know it.
pub fn enumeration<E: TryFrom<i32>>(violations: &mut Violations, field: &str, value: i32) -> Option<E> {
    let converted = E::try_from(value).ok();
    if converted.is_none() {
        violations.add(field, format!("{value} is not a value of this enumeration"));
    }
    converted
}

/// Checks a name for people.
pub fn check_display_name(violations: &mut Violations, field: &str, name: &str) {
    if name.chars().count() > MAX_DISPLAY_NAME {
        violations.add(field, format!("must have at most {MAX_DISPLAY_NAME} characters"));
    }
    check_printable(violations, field, name);
}

/// Checks that text of a client does nothing to the terminal of whoever reads it.
pub fn check_printable(violations: &mut Violations, field: &str, text: &str) {
    if text.chars().any(char::is_control) {
        violations.add(field, "must not have control characters");
    }
}

/// Microseconds since the Unix epoch as a timestamp.
#[must_use]
pub const fn timestamp(us: i64) -> Timestamp {
    Timestamp { seconds: us.div_euclid(1_000_000), nanos: (us.rem_euclid(1_000_000) * 1_000) as i32 }
}

/// A timestamp as microseconds since the Unix epoch, rounded up, so that "before" and "from" select by whole
/// microseconds.
///
/// # Errors
/// A text for the client where the timestamp is out of range.
pub fn timestamp_us(timestamp: &Timestamp) -> Result<i64, &'static str> {
    if !(0..1_000_000_000).contains(&timestamp.nanos) {
        return Err("nanos must be 0 to 999999999");
    }
    let micros = (i64::from(timestamp.nanos) + 999) / 1_000;
    timestamp
        .seconds
        .checked_mul(1_000_000)
        .and_then(|us| us.checked_add(micros))
        .ok_or("must be a time that 64-bit microseconds can tell")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::proto;

    #[test]
    fn timestamps_survive_the_round_trip_before_and_after_the_epoch() {
        for us in [-1, 0, 1, 1_700_000_000_123_456, -1_700_000_000_123_456] {
            assert_eq!(timestamp_us(&timestamp(us)), Ok(us));
        }
        assert_eq!(timestamp(-1), Timestamp { seconds: -1, nanos: 999_999_000 });
        assert_eq!(timestamp_us(&Timestamp { seconds: 0, nanos: 1 }), Ok(1));
    }

    #[test]
    fn timestamps_out_of_range_are_refused() {
        assert!(timestamp_us(&Timestamp { seconds: 0, nanos: -1 }).is_err());
        assert!(timestamp_us(&Timestamp { seconds: i64::MAX, nanos: 0 }).is_err());
    }

    #[test]
    fn unknown_enumeration_values_are_violations() {
        let mut violations = Violations::default();
        let mode: Option<proto::GenerationMode> = enumeration(&mut violations, "generation_mode", 99);
        assert_eq!(mode, None);
        assert_eq!(violations.as_slice()[0].field, "generation_mode");
    }
}
