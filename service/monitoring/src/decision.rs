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
}

/// What is to be done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Action {
    /// Nothing: all is as it should be, or a bound is reached.
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
    let outcome =
        |action, reason| Outcome { action, reason, after: inputs.before, feed_bound: None, spindle_bound: None };
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
                Outcome { after: Overrides::FULL, ..outcome(Action::Change, Reason::Silence) }
            }
            Fallback::Hold | Fallback::Full => outcome(Action::Hold, Reason::Silence),
        },
        Evidence::Process(_) if inputs.threading => outcome(Action::Hold, Reason::Threading),
        Evidence::Process(properties) => process(inputs, &properties, outcome),
    }
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
        if spindle != inputs.before.spindle {
            let (feed, feed_bound) = bounded(inputs.before.feed * (spindle / inputs.before.spindle), rules.feed_bounds);
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
