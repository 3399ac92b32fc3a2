//! Kinematics of machines with two rotary axes, described by data: one ordered chain of axes from the workpiece to the
//! tool gives table-table, head-table and head-head machines, with pivot offsets and tilted rotary axes, and one
//! general solution serves them all (docs/functions/five-axis-thinning.md, "After thinning: tool-centre-point
//! interpolation").
//!
//! **Conventions.** Every axis of the chain is the motion of all that lies on its tool side *relative to* all that lies
//! on its work side, so that it does not matter which parts of the machine are at rest. A positive value moves the tool
//! along (or turns it right-handed about) the axis' direction as seen from the workpiece, as ISO 841 defines the signs.
//! All directions and points are given in *chain coordinates*: fixed to the workpiece side, and equal to the machine's
//! own coordinates while every axis is at zero. With the axes' screw motions written as Eᵢ(qᵢ), the tool centre point
//! and the tool direction are the product of exponentials
//!
//! ```text
//! p = E₁(q₁)·E₂(q₂)·…·E₅(q₅)·(gauge point − L·d),   v = R₁·R₂·d
//! ```
//!
//! with the tool length L, and the tool direction d from the tip to the spindle.

mod branch;
mod chain;
mod description;
mod direction;
mod ease;
mod inverse;
mod jacobian;
mod path;
mod range;
mod tip;
mod tool_frame;
pub mod vector;

pub use branch::{CutFailure, CutSearch, CutStart};
pub use chain::{JointValues, Kinematics, KinematicsError, Setup, ToolPose, WorkFrame};
pub use description::{BranchPreference, ChainAxis, KinematicsDescription, Wrap};
pub use direction::{DirectionPath, FiveAxisSegment, GreatCircle, OppositeDirections, RotaryDirections};
pub use ease::{Ease, Easing};
pub use inverse::{DirectionSolution, InverseSolution};
pub use jacobian::Jacobian;
pub use path::{FiveAxisBlock, FiveAxisCorners, FiveAxisMotion, FiveAxisPoint, FiveAxisRefusal, Toward};
pub use tip::{TipArc, TipCircle, TipCurve, TipPath, TipSpline};
pub use tool_frame::ToolFrame;
