//! Machining functions on top of motion, and the pipeline that turns a program into setpoints.
//!
//! Invariants: pure and deterministic to the bit; memory does not grow with the program; a setpoint's value does
//! not depend on where a stream started; a restored pipeline continues exactly.
//!
//! `frame` is what all programs pass through, `functions` has one folder per machining function, and `shared` is
//! what both know.

#![forbid(unsafe_code)]

mod frame;
mod functions;
mod improvement;
mod shared;

pub use frame::config::{
    DEFAULT_PERIOD_US, MAX_PERIOD_US, MAX_SETPOINTS, MIN_PERIOD_US, OverrideChange, PipelineConfig, SpindleChange,
};
pub use frame::interpretation::{Interpretation, InterpretationStep};
pub use frame::pipeline::{AppendError, Pipeline, SnapshotError, SpindleChangeError, Step};
pub use frame::profile::{
    MAX_CORNER_DIRECTION_TOLERANCE_DEG, MAX_HOLD_S, MAX_LOOK_AHEAD_BLOCKS, MAX_OVERRIDE_RATIO, MAX_POLE_TOLERANCE_DEG,
    MAX_SERVO_SUBSTEPS, MIN_LOOK_AHEAD_BLOCKS, MIN_OVERRIDE_RATIO, MachineProfile, PlanQuality, is_override_ratio,
};
pub use frame::report::{
    AxisLimitTimes, AxisSummary, LimitTimes, PathDeviation, PeakPlace, ProgramSummary, Slowdown, SlowdownCause,
    SlowdownCure, ValidationReport,
};
pub use frame::spindle_trial::{SpindleTrial, TrialStep};
pub use frame::tool_path::{GuidedCuts, PathPoint, ToolMotion, ToolPath, ToolPathSink};
pub use frame::validation::Validation;
pub use functions::path_vibration::*;
pub use functions::thinning::{DroppedRun, MethodFigures, ProgramThinning};
// By name: the codes of one function must not hide those of all.
pub use functions::code;
pub use functions::*;
pub use improvement::{
    Improvement, ImprovementFigure, ImprovementGoals, ImprovementKind, ImprovementOutcome, ImprovementStep,
    MAX_IMPROVED_BYTES, StabilityGoal, Surroundings, WordChange, improve,
};
pub use shared::cut::Cut;
pub use shared::following::{AxisDrive, AxisFollowing, DriveModel, FollowingContour, FollowingModel};
pub use shared::setpoint::{BLOCK_LENGTH, Frame, ServoColumns, SetpointBlock, setpoint_index_at};
pub use shared::tool::Tool;
pub use shared::track::MAX_AMPLITUDE_MM;
