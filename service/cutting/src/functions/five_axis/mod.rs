//! Moves under tool centre point control: guided moves into the planner.

mod ahead;
pub(crate) mod code;
mod guide;
mod state;

pub(crate) use ahead::{Ahead, Chosen, Scout};
pub(crate) use guide::{Guide, GuideState, Guided, no_kinematics};
