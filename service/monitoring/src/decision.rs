//! Decisions: pure functions of their inputs, which every record carries (docs/functions/adaptive-feed.md,
//! "Decisions").

mod decide;

pub use decide::{decide, windows_at_bound};

use crate::rules::Rules;
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
    /// Time stamps that do not rise, or are far ahead of the clock.
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
    /// The spectrum is not complete, or nothing in it is above the noise floor, where a frequency is judged.
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
    /// Override before, to which a refusal goes back.
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
    /// The request in progress; of several the newest.
    pub request: Option<SpindleRequest>,
    /// Override that was refused last, by the machine or because conditions would no longer hold: not requested again until the
    /// programmed speed, the tool or the override has changed.
    pub refused: Option<f64>,
}

impl SpindlePlan {
    /// Whether a planned change waits that would bring another override than this one.
    #[must_use]
    pub fn awaits_other_than(&self, spindle: f64) -> bool {
        self.planned && self.request.is_some_and(|request| request.spindle != spindle)
    }
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
