//! What needs attention: conditions that follow from decisions, from the log, from the report of a job, from errors.

use feedwave_contract::names;
use feedwave_contract::proto::decision_inputs::Evidence;
use feedwave_contract::proto::{
    ConditionSeverity as Severity, ConditionSource as Source, Decision, DecisionAction as Action,
    DecisionReason as Reason, MachineCondition, OverrideBound, ProcessProperty as Property, ProcessReading,
};
use prost_types::Timestamp;

use super::Logged;
use crate::error::Error;

/// Code of the condition that a job has warnings.
const FINDINGS: &str = "FINDINGS";

/// Conditions that follow from the decisions of a run, at most one of each kind.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Alarms {
    /// The validation report of the job has warnings.
    findings: Option<MachineCondition>,
    /// A property is beyond a limit.
    process: Option<MachineCondition>,
    /// Telemetry is silent or bad.
    telemetry: Option<MachineCondition>,
    /// A decision stopped the machine.
    stop: Option<MachineCondition>,
    /// An error ended the stream.
    error: Option<MachineCondition>,
}

impl Alarms {
    /// Those of a run whose job has so many warnings.
    pub(super) fn new(run: &str, warnings: u64, time: Option<Timestamp>) -> Self {
        let findings = (warnings > 0).then(|| MachineCondition {
            code: FINDINGS.to_owned(),
            severity: Severity::Warning.into(),
            source: Source::Program.into(),
            message: format!(
                "the validation report of the job has {warnings} {}",
                if warnings == 1 { "warning" } else { "warnings" }
            ),
            raise_time: time,
            run: run.to_owned(),
            ..MachineCondition::default()
        });
        Self { findings, ..Self::default() }
    }

    pub(super) fn all(&self) -> Vec<MachineCondition> {
        let Self { findings, process, telemetry, stop, error } = self;
        [findings, process, telemetry, stop, error].into_iter().flatten().cloned().collect()
    }

    /// What follows from a decision; `reading` is what its window showed.
    pub(super) fn decided(&mut self, decision: &Decision, reading: Option<&ProcessReading>) {
        let Some(outcome) = &decision.outcome else { return };
        let condition = || condition(decision, reading);
        match outcome.reason() {
            Reason::Data | Reason::Silence => renew(&mut self.telemetry, condition()),
            Reason::WithinLimits | Reason::ToolFit | Reason::MachineFit => {
                (self.process, self.telemetry) = (None, None);
            }
            // Faster is no alarm, but for where it would go beyond what is permitted.
            Reason::FeedBelowLimit if outcome.feed_bound() == OverrideBound::Unspecified => {
                (self.process, self.telemetry) = (None, None);
            }
            Reason::FeedBelowLimit
            | Reason::FeedAboveLimit
            | Reason::AngleBelowLimit
            | Reason::AngleAboveLimit
            | Reason::SpeedFromTable
            | Reason::SpeedNotInTable
            | Reason::SpeedUnknown => {
                self.telemetry = None;
                renew(&mut self.process, condition());
            }
            // The log has it, with its acknowledgement.
            Reason::AboveLimitAtBound => (self.process, self.telemetry) = (None, None),
            Reason::ReplaceTool | Reason::ServiceMachine => self.telemetry = None,
            Reason::FeedHeld
            | Reason::Threading
            | Reason::SpindleAccepted
            | Reason::SpindleReached
            | Reason::SpindleRefused
            | Reason::SpindleNotAsked
            | Reason::SpindleUnfit
            | Reason::Unspecified => {}
        }
        let is_logged = outcome.reason() == Reason::AboveLimitAtBound;
        self.stop = (outcome.action() == Action::Stop && !is_logged)
            .then(|| MachineCondition { severity: Severity::Fault.into(), ..condition() });
        if self.stop.is_some() {
            self.telemetry = None;
        }
    }

    /// A batch came: telemetry is silent no more.
    pub(super) fn heard(&mut self) -> bool {
        let was_silent = self.telemetry.as_ref().is_some_and(|condition| condition.code == "SILENCE");
        if was_silent {
            self.telemetry = None;
        }
        was_silent
    }

    /// The cut is over, and with it what was judged of it; whether that was anything.
    pub(super) fn leave_cut(&mut self) -> bool {
        self.process.take().is_some()
    }

    /// The error that ended the stream.
    pub(super) fn failed(&mut self, run: &str, error: &Error, time: Timestamp) {
        self.error = Some(MachineCondition {
            code: error.reason().to_owned(),
            severity: Severity::Fault.into(),
            source: Source::Service.into(),
            message: error.to_string(),
            raise_time: Some(time),
            run: run.to_owned(),
            ..MachineCondition::default()
        });
    }

    /// What is not current any more once the stream is gone.
    pub(super) fn rest(&mut self) {
        (self.process, self.telemetry) = (None, None);
    }
}

/// Puts a condition in the place of one of its kind, which keeps its beginning where it is the same.
fn renew(place: &mut Option<MachineCondition>, new: MachineCondition) {
    let since = place.as_ref().filter(|old| old.code == new.code).map(|old| old.raise_time);
    *place = Some(MachineCondition { raise_time: since.unwrap_or(new.raise_time), ..new });
}

/// The name of an enum value without what is before it: `DECISION_REASON_SILENCE` is `SILENCE`.
fn short(name: &str, prefix: &str) -> String {
    name.strip_prefix(prefix).unwrap_or(name).to_owned()
}

fn condition(decision: &Decision, reading: Option<&ProcessReading>) -> MachineCondition {
    let outcome = decision.outcome.unwrap_or_default();
    let (code, source) = match outcome.reason() {
        Reason::Data => (short(outcome.hold_reason().as_str_name(), "HOLD_REASON_"), Source::Telemetry),
        Reason::Silence => ("SILENCE".to_owned(), Source::Telemetry),
        reason => (short(reason.as_str_name(), "DECISION_REASON_"), Source::Process),
    };
    let limit = reading.and_then(|reading| limit(outcome.reason(), reading));
    let judged = reading.filter(|_| limit.is_some());
    MachineCondition {
        code,
        severity: Severity::Warning.into(),
        source: source.into(),
        message: sentence(decision, reading),
        raise_time: decision.time,
        decision_number: Some(decision.number),
        run: decision.run.clone(),
        value: judged.and_then(|reading| reading.value),
        limit,
        unit: judged.map(|reading| reading.unit.clone()).unwrap_or_default(),
        ..MachineCondition::default()
    }
}

/// The limit that a reason is about.
fn limit(reason: Reason, reading: &ProcessReading) -> Option<f64> {
    match reason {
        Reason::FeedAboveLimit => Some(reading.upper),
        Reason::FeedBelowLimit => Some(reading.lower),
        _ => None,
    }
}

/// A condition of the log.
pub(super) fn of_log(logged: &Logged) -> MachineCondition {
    let Logged { run, condition, reading, .. } = logged;
    let what = if condition.action() == Action::Stop { "the machine is stopped" } else { "the feed is held" };
    let beyond = match reading {
        Some(reading) => compared(reading, "stayed above", reading.upper),
        None => "the property stayed above its limit".to_owned(),
    };
    MachineCondition {
        code: short(Reason::AboveLimitAtBound.as_str_name(), "DECISION_REASON_"),
        severity: Severity::Fault.into(),
        source: Source::Process.into(),
        message: format!("{beyond} at the lower feed bound: {what}"),
        raise_time: condition.raise_time,
        decision_number: Some(condition.decision_number),
        run: names::run(*run),
        needs_acknowledgement: true,
        acknowledge_time: condition.acknowledge_time,
        acknowledged_by: condition.acknowledged_by.clone(),
        value: reading.as_ref().and_then(|reading| reading.value),
        limit: reading.as_ref().map(|reading| reading.upper),
        unit: reading.as_ref().map(|reading| reading.unit.clone()).unwrap_or_default(),
    }
}

/// What the window of a decision showed, in this unit of the deviation; `None` where the decision is about something else.
pub(super) fn reading(decision: &Decision, deviation_unit: &str) -> Option<ProcessReading> {
    let inputs = decision.inputs.as_ref()?;
    let Some(Evidence::Process(process)) = &inputs.evidence else { return None };
    let rules = inputs.rules.as_ref()?;
    let feed = rules.feed?;
    let property = match rules.property() {
        Property::Unspecified => Property::Deviation,
        property => property,
    };
    let (value, unit) = match property {
        Property::VibrationFrequency => (process.line.map(|line| line.frequency_hz), "Hz"),
        Property::VibrationAmplitude => (process.line.map(|line| line.amplitude), deviation_unit),
        Property::Deviation | Property::Unspecified => (Some(process.max_deviation), deviation_unit),
    };
    let span = decision.span.as_ref();
    Some(ProcessReading {
        time: decision.time,
        decision_number: decision.number,
        property: property.into(),
        value,
        lower: feed.lower,
        upper: feed.upper,
        unit: unit.to_owned(),
        max_deviation: process.max_deviation,
        deviation_unit: deviation_unit.to_owned(),
        line: process.line,
        spindle_rev_per_min: inputs.current_rev_per_min,
        window_s: span.map_or(0.0, |span| span.last_ns.saturating_sub(span.first_ns) as f64 * 1e-9),
    })
}

/// What a window showed and a limit, as the beginning of a sentence.
fn compared(reading: &ProcessReading, how: &str, limit: f64) -> String {
    let what = match reading.property() {
        Property::VibrationAmplitude => "vibration amplitude",
        Property::VibrationFrequency => "vibration frequency",
        Property::Deviation | Property::Unspecified => "deviation",
    };
    let (value, unit) = (reading.value.unwrap_or_default(), &reading.unit);
    format!("{what} {value:.4} {unit} {how} {limit:.4} {unit}")
}

/// A decision in one sentence with the numbers.
fn sentence(decision: &Decision, reading: Option<&ProcessReading>) -> String {
    let outcome = decision.outcome.unwrap_or_default();
    let beyond = |how: &str, limit: fn(&ProcessReading) -> f64| {
        reading.map_or_else(String::new, |reading| compared(reading, how, limit(reading)) + ": ")
    };
    let after = outcome.after.unwrap_or_default();
    let (feed, spindle) = (after.feed * 100.0, outcome.planned_spindle.unwrap_or(after.spindle) * 100.0);
    match outcome.reason() {
        Reason::FeedAboveLimit => format!("{}feed {feed:.0} %", beyond("is above", |reading| reading.upper)),
        Reason::FeedBelowLimit => format!("{}feed {feed:.0} %", beyond("is below", |reading| reading.lower)),
        Reason::AngleBelowLimit => format!("the mean angle is below its limit: spindle {spindle:.0} %"),
        Reason::AngleAboveLimit => format!("the mean angle is above its limit: spindle {spindle:.0} %"),
        Reason::SpeedFromTable => format!("the milling limit is reached: spindle {spindle:.0} % from the table"),
        Reason::SpeedNotInTable => "the milling limit is reached, and the table has no band for this speed".to_owned(),
        Reason::SpeedUnknown => "the milling limit is reached, and the spindle speed is not known".to_owned(),
        Reason::ReplaceTool => "the run-out is beyond its limit: replace the tool".to_owned(),
        Reason::ServiceMachine => "idle vibration is beyond its limit: service the machine".to_owned(),
        Reason::Silence if outcome.action() == Action::Stop => {
            "telemetry stopped while cutting: the machine is stopped".to_owned()
        }
        Reason::Silence => format!("telemetry stopped while cutting: feed {feed:.0} %"),
        Reason::Data => {
            let why = short(outcome.hold_reason().as_str_name(), "HOLD_REASON_").to_lowercase().replace('_', " ");
            format!("the data is no evidence ({why}): the overrides stay")
        }
        reason => short(reason.as_str_name(), "DECISION_REASON_").to_lowercase().replace('_', " "),
    }
}
