//! From sensor signals to feed and spindle decisions, as a pure state machine (docs/functions/adaptive-feed.md).
//!
//! Samples and events go in, in order; [`Decision`]s come out. Invariants: pure and deterministic to the bit, whatever
//! the batch boundaries; memory is bounded by the configuration; no decision from bad data; every decision carries all
//! its inputs and [`decide`] recomputes it from them; a restored [`Monitor`] continues exactly.
//!
//! The tool path never changes: a decision scales all feed axes by one factor, and the spindle speed by another.

#![forbid(unsafe_code)]

mod batch;
mod channel;
mod config;
mod decision;
mod learning;
mod lobes;
mod monitor;
mod points;
mod recorder;
mod rules;
mod spectrum;

pub use batch::{Batch, BatchError, Event, EventError, MAX_BATCH_SAMPLES, Pair, Receipt};
pub use config::{
    ContactSource, Grouping, IdleRunUp, Length, MonitoringConfig, Quality, Quantity, Sensors, SpectrumConfig,
    SpikeFilter, ToolCheck, Violation,
};
pub use decision::{
    Action, Bound, Decision, Evidence, HoldReason, Inputs, Outcome, Overrides, Properties, Reason, Removed, Span,
    SpindleAnswer, SpindlePlan, SpindleRequest, decide, windows_at_bound,
};
pub use learning::{
    CutRecord, Estimate, LearningError, LearningModel, Learnt, LearntMode, MAX_LEARNING_SAMPLES, MAX_RECORDS,
    MIN_RECORD_SAMPLES, learn, settling_samples,
};
pub use lobes::{
    ChartLimit, ChartPoint, LOW_IMMERSION, LOW_IMMERSION_ERROR, LobeError, LobePoint, Lobes, MillingModel, Mode,
    Pocket, PocketRequest, StabilityRobustness, TurningModel, dynamics_problems, limiting_width_mm, most_stable_speed,
    stability_robustness, stable_speeds,
};
pub use monitor::{Monitor, SnapshotError, State};
pub use recorder::{CutConditions, MAX_RECORDED_CUTS, RecordedCut, Recorder, RecordingError, RecordingLimits};
pub use rules::{
    Bounds, Escalation, EscalationAction, Fallback, FeedRule, Property, Rules, SpindleRule, SpindleTable, TableRow,
};
pub use spectrum::{LineOrigin, SpectralLine};
