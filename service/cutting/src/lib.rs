//! Machining functions on top of motion, and the pipeline that turns a program into setpoints.
//!
//! Invariants: pure and deterministic to the bit; memory does not grow with the program; a setpoint's value does
//! not depend on where a stream started; a restored pipeline continues exactly.

#![forbid(unsafe_code)]

mod blend;
mod builder;
mod chip;
mod cut;
mod five_axis;
mod following;
mod interpolator;
mod path_vibration;
mod pipeline;
mod profile;
mod report;
mod setpoint;
pub mod thinning;
pub mod thread;
pub mod tool_oscillation;
mod validation;
mod wording;

pub use chip::*;
pub use cut::Cut;
pub use five_axis::{DroppedRun, ProgramThinning};
pub use following::{FollowingModel, FollowingReport};
pub use path_vibration::*;
pub use pipeline::{
    AppendError, DEFAULT_PERIOD_US, MAX_OVERRIDE_RATIO, MAX_PERIOD_US, MAX_SETPOINTS, MIN_PERIOD_US, OverrideChange,
    Pipeline, PipelineConfig, SnapshotError, Step, Tool,
};
pub use profile::{
    MAX_AMPLITUDE_MM, MAX_CORNER_DIRECTION_TOLERANCE_DEG, MAX_LOOK_AHEAD_BLOCKS, MAX_POLE_TOLERANCE_DEG,
    MAX_SERVO_SUBSTEPS, MIN_LOOK_AHEAD_BLOCKS, MachineProfile,
};
pub use report::{AxisSummary, LimitTimes, PeakPlace, ProgramSummary, ValidationReport};
pub use setpoint::{BLOCK_LENGTH, Frame, ServoColumns, SetpointBlock};
pub use validation::Validation;
