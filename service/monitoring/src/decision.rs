//! Decisions: pure functions of their inputs, which every record carries (docs/functions/adaptive-feed.md,
//! "Decisions").

use crate::rules::{Bounds, EscalationAction, Fallback, Property, Rules, SpindleRule};
use crate::spectrum::SpectralLine;
use serde::{Deserialize, Serialize};

/// Overrides as factors (1 = 100 %).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Overrides {
    /// Of the programmed feed, in mm per minute, of all axes alike.
    pub feed: f64,
    /// Of the programmed spindle speed.
    pub spindle: f64,
}

impl Overrides {
    /// Both at 100 %.
    pub const FULL: Self = Self { feed: 1.0, spindle: 1.0 };
}

/// Samples that were removed, by cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Removed {
    /// NaN or infinite values, angles included.
    pub non_finite: u32,
    /// Outside the sensor's range.
    pub out_of_range: u32,
    /// Single jumps.
    pub spikes: u32,
    /// Values of a stuck sensor.
    pub stuck: u32,
    /// Samples of batches without a needed column.
    pub missing: u32,
    /// Dropped by the sender, by the time stamps.
    pub dropped: u32,
}

impl Removed {
    /// All together.
    pub fn total(&self) -> u64 {
        [self.non_finite, self.out_of_range, self.spikes, self.stuck, self.missing, self.dropped]
            .into_iter()
            .map(u64::from)
            .sum()
    }
}

/// The stretch of samples a decision is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Span {
    /// Time stamp of the first sample, ns.
    pub first_ns: u64,
    /// Time stamp of the last sample, ns.
    pub last_ns: u64,
    /// Index of the first sample in the run.
    pub first_sample: u64,
    /// Samples that came.
    pub samples: u64,
    /// Samples that were used.
    pub valid: u64,
    /// Samples that were not.
    pub removed: Removed,
}

/// Process properties of a window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Properties {
    /// max D, mm (mm/s² with accelerations).
    pub max_deviation: f64,
    /// Circular mean of α in degrees and the length of its mean resultant (1 = all alike); `None` without a direction.
    pub mean_angle: Option<(f64, f64)>,
    /// Dominant spectral line.
    pub line: Option<SpectralLine>,
}

/// Why nothing was decided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum HoldReason {
    /// Fewer valid samples than demanded, or a larger fraction removed than allowed.
    TooFewSamples,
    /// Too many NaN or infinite values.
    NotFinite,
    /// A channel repeats one value.
    StuckSensor,
    /// A needed column is missing.
    SensorMissing,
    /// Time stamps that do not rise.
    TimeOutOfOrder,
    /// A jump of the time stamps beyond the largest gap.
    TimeGap,
    /// Far more samples than the time stamps and the nominal rate allow.
    TimeTooDense,
    /// Time stamps far behind the clock.
    Stale,
    /// Batches are missing.
    BatchGap,
    /// Not every angular point was seen.
    PointsMissing,
    /// The baseline belongs to another tool.
    OtherTool,
    /// The spectrum is not complete.
    NoSpectrum,
}

/// What a decision is based on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Evidence {
    /// The baseline's extremes of the point means.
    ToolCheck {
        /// Smallest X⁰ and Y⁰.
        least: [f64; 2],
        /// Largest X⁰ and Y⁰.
        most: [f64; 2],
        /// C.
        max_ratio: Option<f64>,
        /// Absolute limit.
        max_run_out: Option<f64>,
    },
    /// One step of the idle run-up.
    IdleCheck {
        /// Speed of the step, rev/min.
        spindle_rev_per_min: f64,
        /// Largest |X_i¹ − X_i⁰|, |Y_i¹ − Y_i⁰|.
        difference: f64,
        /// Limit of the machine.
        max_difference: f64,
    },
    /// A window of the process.
    Process(Properties),
    /// A window that is no evidence.
    Unfit(HoldReason),
    /// No telemetry while cutting.
    Silence {
        /// Length of the silence that was tolerated, ns.
        tolerated_ns: u64,
    },
    /// The machine's answer to a decision on the spindle speed.
    SpindleAnswer {
        /// Number of the decision.
        decision: u64,
        /// What it answers.
        answer: SpindleAnswer,
        /// The request it belongs to; `None` where no such answer is waited for.
        request: Option<SpindleRequest>,
    },
    /// What follows cannot be cut at a spindle speed: a condition would no longer hold.
    SpindleUnfit {
        /// The override that was judged.
        spindle: f64,
        /// First setpoint of what was judged.
        setpoint_index: u64,
    },
}

/// What the machine answers to a decision on the spindle speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum SpindleAnswer {
    /// It will set the speed.
    Accepted,
    /// The spindle turns at the speed.
    Reached {
        /// Since then, on the sensors' clock, ns.
        time_ns: Option<u64>,
        /// As it was measured, rev/min.
        rev_per_min: Option<f64>,
    },
    /// It will not set the speed.
    Refused,
}

/// A change of the spindle speed that a decision requested and that was not answered to the end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpindleRequest {
    /// Number of the decision.
    pub decision: u64,
    /// Override requested.
    pub spindle: f64,
    /// Override before.
    pub from: f64,
    /// Whether the machine has accepted it.
    pub accepted: bool,
    /// First setpoint at the speed, once a planned change has come to its place.
    pub setpoint_index: Option<u64>,
    /// The speed there, rev/min, where it is one.
    pub rev_per_min: Option<f64>,
}

impl SpindleRequest {
    /// Share by which a measured speed may differ from the one requested to be reached.
    pub const TOLERANCE: f64 = 0.01;

    /// Whether a measured speed, rev/min, is the one requested.
    #[must_use]
    pub fn is_reached_at(&self, measured_rev_per_min: f64) -> bool {
        self.rev_per_min.is_none_or(|wanted| (measured_rev_per_min - wanted).abs() <= Self::TOLERANCE * wanted)
    }
}

/// How changes of the spindle speed come into force, and what is known of the last one.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct SpindlePlan {
    /// Whether changes are planned for a place between sections, and in force once the machine has reached the speed;
    /// otherwise they are in force as they are decided.
    pub planned: bool,
    /// The request in progress.
    pub request: Option<SpindleRequest>,
    /// Override that was refused last, by the machine or because conditions would no longer hold: not requested again until the
    /// programmed speed, the tool or the override has changed.
    pub refused: Option<f64>,
}

/// Everything the decision depends on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Inputs {
    /// What was seen.
    pub evidence: Evidence,
    /// Limits and steps.
    pub rules: Rules,
    /// Overrides before.
    pub before: Overrides,
    /// Programmed spindle speed, rev/min.
    pub programmed_rev_per_min: Option<f64>,
    /// Spindle speed of the window, rev/min: measured, or programmed times override.
    pub current_rev_per_min: Option<f64>,
    /// Whether a thread is being cut, or was at some time of the window.
    pub threading: bool,
    /// Windows in a row before this one in which the property was above its limit at the lower feed bound.
    pub windows_at_bound: u32,
    /// Whether an escalation holds the feed.
    pub held: bool,
    /// How a change of the spindle speed would come into force.
    pub spindle: SpindlePlan,
}

/// What is to be done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Action {
    /// The overrides stay: all is as it should be, a bound is reached, or a change of the spindle speed is planned
    /// ([`Outcome::planned_spindle`]).
    Keep,
    /// The overrides change to the new values.
    Change,
    /// Nothing may be decided: the overrides stay.
    Hold,
    /// The machine is to stop.
    Stop,
    /// The feed is to be held, its override is 0, until the machine resumes.
    HoldFeed,
}

/// Which rule decided, and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reason {
    /// The tool runs true.
    ToolFit,
    /// Run-out beyond the limit: replace the tool.
    ReplaceTool,
    /// The machine runs quietly at this step.
    MachineFit,
    /// Idle vibration beyond the limit: stop and service the machine.
    ServiceMachine,
    /// All properties are inside their limits.
    WithinLimits,
    /// Below D*: faster feed.
    FeedBelowLimit,
    /// Above D**: slower feed.
    FeedAboveLimit,
    /// Mean α below α*: faster spindle.
    AngleBelowLimit,
    /// Mean α above α**: slower spindle.
    AngleAboveLimit,
    /// At or above D***: speed from the table.
    SpeedFromTable,
    /// At or above D***, but the current speed is in no band of the table.
    SpeedNotInTable,
    /// At or above D***, but the spindle speed is unknown.
    SpeedUnknown,
    /// A thread is being cut.
    Threading,
    /// The data is no evidence.
    Data(HoldReason),
    /// Telemetry stopped while cutting.
    Silence,
    /// Above the upper limit at the lower feed bound, for as many windows in a row as are tolerated.
    AboveLimitAtBound,
    /// The feed is held since an escalation.
    FeedHeld,
    /// The machine accepts the spindle speed.
    SpindleAccepted,
    /// The machine has reached the spindle speed.
    SpindleReached,
    /// The machine refuses the spindle speed.
    SpindleRefused,
    /// The machine answers what it was not asked, or answers too early.
    SpindleNotAsked,
    /// A condition would no longer hold at the spindle speed.
    SpindleUnfit,
}

/// Which bound of an override was hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Bound {
    /// The lower one.
    Lower,
    /// The upper one.
    Upper,
}

/// Result of a decision.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// What is to be done.
    pub action: Action,
    /// Rule and reason.
    pub reason: Reason,
    /// Overrides afterwards.
    pub after: Overrides,
    /// Bound of the feed override that was hit.
    pub feed_bound: Option<Bound>,
    /// Bound of the spindle override that was hit.
    pub spindle_bound: Option<Bound>,
    /// Spindle override that is to be in force from the next place on where that is possible.
    pub planned_spindle: Option<f64>,
}

/// One record: number, place and time, inputs, outcome.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// Counts up from 0 in a run.
    pub number: u64,
    /// When it was made, on the sensors' clock, ns.
    pub time_ns: u64,
    /// Tool in the spindle.
    pub tool: u32,
    /// Samples it is about.
    pub span: Span,
    /// All it depends on.
    pub inputs: Inputs,
    /// What came out.
    pub outcome: Outcome,
    /// What else is to be known of it, for people; nothing depends on it.
    pub note: String,
}

impl Decision {
    /// Whether its inputs give its outcome again.
    pub fn is_reproduced(&self) -> bool {
        decide(&self.inputs) == self.outcome
    }
}

/// The decision that follows from the inputs.
///
/// Stop wins; then bad data and threads hold; then a feed that is held stays so; then a property that stays above its
/// limit at the lower feed bound escalates; then the spindle rule, which scales the feed so that the feed per edge
/// stays; the feed rule only when the spindle rule changes nothing.
pub fn decide(inputs: &Inputs) -> Outcome {
    let outcome = |action, reason| Outcome {
        action,
        reason,
        after: inputs.before,
        feed_bound: None,
        spindle_bound: None,
        planned_spindle: None,
    };
    match inputs.evidence {
        Evidence::ToolCheck { least, most, max_ratio, max_run_out } => {
            if (0..2).all(|axis| runs_true(least[axis], most[axis], max_ratio, max_run_out)) {
                outcome(Action::Keep, Reason::ToolFit)
            } else {
                outcome(Action::Stop, Reason::ReplaceTool)
            }
        }
        Evidence::IdleCheck { difference, max_difference, .. } if difference > max_difference => {
            outcome(Action::Stop, Reason::ServiceMachine)
        }
        Evidence::IdleCheck { .. } => outcome(Action::Keep, Reason::MachineFit),
        Evidence::Unfit(reason) => outcome(Action::Hold, Reason::Data(reason)),
        Evidence::Silence { .. } => match inputs.rules.fallback {
            Fallback::Stop => outcome(Action::Stop, Reason::Silence),
            Fallback::Full if inputs.held => outcome(Action::Hold, Reason::FeedHeld),
            Fallback::Full if inputs.threading => outcome(Action::Hold, Reason::Threading),
            Fallback::Full if inputs.before != Overrides::FULL => {
                full(inputs, outcome(Action::Change, Reason::Silence))
            }
            Fallback::Hold | Fallback::Full => outcome(Action::Hold, Reason::Silence),
        },
        Evidence::SpindleAnswer { answer, request, .. } => answered(inputs, answer, request, outcome),
        Evidence::SpindleUnfit { spindle, .. } => {
            // At the programmed speed everything was judged.
            let back = spindle == inputs.before.spindle && inputs.spindle.request.is_none();
            Outcome { planned_spindle: back.then_some(1.0), ..outcome(Action::Keep, Reason::SpindleUnfit) }
        }
        Evidence::Process(_) if inputs.threading => outcome(Action::Hold, Reason::Threading),
        Evidence::Process(properties) => process(inputs, &properties, outcome),
    }
}

/// Both overrides at 100 %, the spindle's at the next place where it can change.
fn full(inputs: &Inputs, change: Outcome) -> Outcome {
    if !inputs.spindle.planned {
        return Outcome { after: Overrides::FULL, ..change };
    }
    let requested = inputs.spindle.request.map_or(inputs.before.spindle, |request| request.spindle);
    let action = if inputs.before.feed == 1.0 { Action::Keep } else { Action::Change };
    let after = Overrides { feed: 1.0, ..inputs.before };
    let planned_spindle = (inputs.before.spindle != 1.0 && requested != 1.0).then_some(1.0);
    Outcome { action, after, planned_spindle, ..change }
}

/// What follows from the machine's answer to a decision on the spindle speed.
fn answered(
    inputs: &Inputs,
    answer: SpindleAnswer,
    request: Option<SpindleRequest>,
    outcome: impl Fn(Action, Reason) -> Outcome,
) -> Outcome {
    let Some(request) = request else { return outcome(Action::Keep, Reason::SpindleNotAsked) };
    let (spindle, reason) = match (answer, inputs.spindle.planned) {
        (SpindleAnswer::Accepted, _) => return outcome(Action::Keep, Reason::SpindleAccepted),
        // It has been in force since it was decided.
        (SpindleAnswer::Reached { .. }, false) => return outcome(Action::Keep, Reason::SpindleReached),
        (SpindleAnswer::Reached { .. }, true) => (request.spindle, Reason::SpindleReached),
        (SpindleAnswer::Refused, true) => return outcome(Action::Keep, Reason::SpindleRefused),
        (SpindleAnswer::Refused, false) => (request.from, Reason::SpindleRefused),
    };
    let (feed, feed_bound) = feed_with_spindle(inputs, spindle);
    Outcome { after: Overrides { feed, spindle }, feed_bound, ..outcome(Action::Change, reason) }
}

/// The feed override with which the feed per edge or revolution stays at another spindle override; a held feed stays held.
fn feed_with_spindle(inputs: &Inputs, spindle: f64) -> (f64, Option<Bound>) {
    if inputs.held {
        return (inputs.before.feed, None);
    }
    bounded(inputs.before.feed * (spindle / inputs.before.spindle), inputs.rules.feed_bounds)
}

/// The property that the rules judge; `None` where the window does not have it.
fn property(rules: &Rules, properties: &Properties) -> Option<f64> {
    match rules.property {
        Property::Deviation => Some(properties.max_deviation),
        Property::VibrationAmplitude => properties.line.map(|line| line.amplitude),
        Property::VibrationFrequency => properties.line.map(|line| line.frequency_hz),
    }
}

/// Windows in a row, with this one, in which the property was above its upper limit at the lower feed bound.
///
/// Only a window that is judged counts or breaks the row: bad data, threads, silence and a missing spectrum say nothing
/// about the property, and a pause of contact belongs to the window around it.
pub fn windows_at_bound(inputs: &Inputs) -> u32 {
    let value = match &inputs.evidence {
        Evidence::Process(properties) if !inputs.threading && !inputs.held => property(&inputs.rules, properties),
        _ => None,
    };
    let Rules { feed, feed_bounds, .. } = &inputs.rules;
    match value {
        Some(value) if value > feed.upper && inputs.before.feed <= feed_bounds.lower => {
            inputs.windows_at_bound.saturating_add(1)
        }
        Some(_) => 0,
        None => inputs.windows_at_bound,
    }
}

/// (max − min)/max ≤ C and max − min within the absolute limit. A largest distance of 0 has no ratio and fails.
fn runs_true(least: f64, most: f64, max_ratio: Option<f64>, max_run_out: Option<f64>) -> bool {
    let run_out = most - least;
    max_ratio.is_none_or(|limit| most > 0.0 && run_out / most <= limit)
        && max_run_out.is_none_or(|limit| run_out <= limit)
}

fn process(inputs: &Inputs, properties: &Properties, outcome: impl Fn(Action, Reason) -> Outcome) -> Outcome {
    let rules = &inputs.rules;
    let Some(value) = property(rules, properties) else {
        return outcome(Action::Hold, Reason::Data(HoldReason::NoSpectrum));
    };
    if inputs.held {
        return outcome(Action::Hold, Reason::FeedHeld);
    }
    if let Some(escalation) = rules.escalation
        && windows_at_bound(inputs) >= escalation.windows
    {
        let (action, feed) = match escalation.action {
            EscalationAction::Hold => (Action::HoldFeed, 0.0),
            EscalationAction::Stop => (Action::Stop, inputs.before.feed),
        };
        let after = Overrides { feed, ..inputs.before };
        return Outcome { after, feed_bound: Some(Bound::Lower), ..outcome(action, Reason::AboveLimitAtBound) };
    }
    let wanted = match wanted_spindle(inputs, properties, value) {
        Ok(wanted) => wanted,
        Err(reason) => return outcome(Action::Hold, reason),
    };
    let mut spindle_bound = None;
    if let Some((wanted, reason)) = wanted {
        let spindle;
        (spindle, spindle_bound) = bounded(wanted, rules.spindle_bounds);
        let SpindlePlan { planned, request, refused } = inputs.spindle;
        // Until a planned change is in force, and where it was refused, the feed rule goes on alone.
        let waits = (planned && request.is_some()) || refused == Some(spindle);
        if spindle != inputs.before.spindle && !waits {
            if planned {
                return Outcome { planned_spindle: Some(spindle), spindle_bound, ..outcome(Action::Keep, reason) };
            }
            let (feed, feed_bound) = feed_with_spindle(inputs, spindle);
            let after = Overrides { feed, spindle };
            return Outcome { after, feed_bound, spindle_bound, ..outcome(Action::Change, reason) };
        }
    }
    let (factor, reason) = if value < rules.feed.lower {
        (1.0 + rules.feed.step, Reason::FeedBelowLimit)
    } else if value > rules.feed.upper {
        (1.0 - rules.feed.step, Reason::FeedAboveLimit)
    } else {
        return Outcome { spindle_bound, ..outcome(Action::Keep, Reason::WithinLimits) };
    };
    let (feed, feed_bound) = bounded(inputs.before.feed * factor, rules.feed_bounds);
    let action = if feed == inputs.before.feed { Action::Keep } else { Action::Change };
    let after = Overrides { feed, ..inputs.before };
    Outcome { after, feed_bound, spindle_bound, ..outcome(action, reason) }
}

/// The spindle override that the spindle rule wants and why, where it wants another one; an error is why it cannot say.
fn wanted_spindle(inputs: &Inputs, properties: &Properties, value: f64) -> Result<Option<(f64, Reason)>, Reason> {
    let before = inputs.before.spindle;
    match &inputs.rules.spindle {
        SpindleRule::Turning { lower_deg, upper_deg, step, min_concentration } => match properties.mean_angle {
            Some((angle, concentration)) if concentration >= *min_concentration => {
                if angle < *lower_deg {
                    Ok(Some((before * (1.0 + step), Reason::AngleBelowLimit)))
                } else if angle > *upper_deg {
                    Ok(Some((before * (1.0 - step), Reason::AngleAboveLimit)))
                } else {
                    Ok(None)
                }
            }
            _ => Ok(None),
        },
        SpindleRule::Milling { limit, table } if value >= *limit => {
            let programmed = inputs.programmed_rev_per_min.filter(|&rev_per_min| rev_per_min > 0.0);
            let (current, programmed) = inputs.current_rev_per_min.zip(programmed).ok_or(Reason::SpeedUnknown)?;
            let rev_per_min = table.spindle_rev_per_min(current).ok_or(Reason::SpeedNotInTable)?;
            Ok(Some((rev_per_min / programmed, Reason::SpeedFromTable)))
        }
        SpindleRule::None | SpindleRule::Milling { .. } => Ok(None),
    }
}

/// The value within bounds, and which one it hit.
fn bounded(value: f64, bounds: Bounds) -> (f64, Option<Bound>) {
    if value < bounds.lower {
        (bounds.lower, Some(Bound::Lower))
    } else if value > bounds.upper {
        (bounds.upper, Some(Bound::Upper))
    } else {
        (value, None)
    }
}
