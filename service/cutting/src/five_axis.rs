//! Five-axis programs: thinning as a stage of the pipeline, its report, and the way of guided moves into the planner.

mod ahead;
mod guide;
mod report;
mod stage;
mod timed;

pub(crate) use ahead::{Ahead, Chosen, Scout};
pub(crate) use guide::{Guide, GuideState, Guided, no_kinematics};
pub(crate) use report::report_findings;
pub use report::{DroppedRun, ProgramThinning};
pub(crate) use stage::{StageState, ThinningStage};
pub(crate) use timed::TimedPlans;
