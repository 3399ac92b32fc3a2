//! Moves under tool centre point control: guided moves into the planner.

mod ahead;
pub(crate) mod code;
mod guide;

pub(crate) use ahead::{Ahead, Chosen};
pub(crate) use guide::{Guide, GuideInputs, GuideState, Guided, no_kinematics};
