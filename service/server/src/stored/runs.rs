//! Records of runs as the contract has them: states, conditions, settings, decisions.

use feedwave_contract::convert::{monitoring_from_proto, timestamp};
use feedwave_contract::proto::{Decision, RunCondition, RunSettings};
use feedwave_contract::{names, proto};
use feedwave_monitoring::MonitoringConfig;
use feedwave_store::{DecisionRecord, Run as RunRecord, RunCondition as ConditionRecord, RunState};

use super::{decision_from_stored, from_stored};
use crate::error::{Error, Result, Violations};

/// A condition as the contract has it.
pub(crate) fn condition_to_proto(condition: &ConditionRecord) -> RunCondition {
    let action = match condition.action.as_str() {
        "hold_feed" => proto::DecisionAction::HoldFeed,
        "stop" => proto::DecisionAction::Stop,
        _ => proto::DecisionAction::Unspecified,
    };
    let seen = condition.acknowledged.as_ref();
    RunCondition {
        decision_number: condition.decision_number,
        action: action.into(),
        raise_time: Some(timestamp(condition.raised_us)),
        acknowledge_time: seen.map(|seen| timestamp(seen.at_us)),
        acknowledged_by: seen.map(|seen| seen.by.clone()).unwrap_or_default(),
        note: seen.map(|seen| seen.note.clone()).unwrap_or_default(),
    }
}

/// A state as the contract has it.
#[must_use]
pub(crate) const fn run_state_to_proto(state: RunState) -> proto::RunState {
    match state {
        RunState::Open => proto::RunState::Open,
        RunState::Finished => proto::RunState::Finished,
        RunState::Stopped => proto::RunState::Stopped,
        RunState::Aborted => proto::RunState::Aborted,
    }
}

/// What a stored run was made with.
pub(crate) fn run_settings(run: &RunRecord) -> Result<RunSettings> {
    from_stored(run.settings.get())
}

/// How telemetry is judged, from a stored message.
pub(crate) fn config_from_message(message: &proto::MonitoringConfig) -> Result<MonitoringConfig> {
    let mut violations = Violations::default();
    monitoring_from_proto(&mut violations, "config", message)
        .ok_or_else(|| Error::internal(format!("a stored configuration is refused: {:?}", violations.as_slice())))
}

/// A stored decision.
///
/// # Errors
/// [`Error::Damaged`] when it cannot be read.
pub(crate) fn decision_from_record(record: &DecisionRecord) -> Result<Decision> {
    let damaged = |why: String| Error::Damaged(format!("decision {} of run {}: {why}", record.number, record.run_id));
    if !record.is_intact {
        return Err(damaged("it is not as it was written".into()));
    }
    let read = decision_from_stored(record.body.clone());
    let mut decision = read.map_err(|error| damaged(error.to_string()))?;
    name_decision(&mut decision, record);
    Ok(decision)
}

/// Gives a decision its place in the log.
pub(crate) fn name_decision(decision: &mut Decision, record: &DecisionRecord) {
    decision.sequence = record.sequence.unsigned_abs();
    decision.run = names::run(record.run_id);
    decision.job = names::job(record.job_id);
    decision.time = Some(timestamp(record.at_us));
}
