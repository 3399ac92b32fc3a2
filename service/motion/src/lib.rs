//! Motion: geometry by arc length, the machine's axes and limits, spindle-coupled feed, and the feed planner.
//!
//! Invariants: pure and deterministic to the bit (basic IEEE operations and `libm` only); a path position is
//! exact to 1e-9 mm and an element's end is the programmed point to the last bit; every planned motion keeps
//! each axis within its velocity, acceleration and jerk.

#![forbid(unsafe_code)]

mod element;
mod feed;
mod junction;
pub mod kinematics;
mod limits;
mod machine;
mod planner;
mod profile;
mod smoothing;
mod speed;
mod tolerance;
mod wave;

pub use element::{Arc, Curve, Element, FiveAxis, Spline, Turning};
pub use feed::{Stretch, Stretches, stretches, top_command};
pub use limits::{
    LimitExceeded, LimitPiece, LimitPieces, PathLimits, PathMotion, Quantity, TravelExceeded, limit_pieces,
    missing_axis, path_limits, travel_exceeded, travel_exceeded_within,
};
pub use machine::{CarriedBy, Machine, MachineAxis, MachineKind, ProfileProblem};
pub use planner::{
    Ahead, MOST_BYTES_WITHIN_REACH, MOST_WITHIN_REACH, MotionRequest, PathItem, Planned, PlannedMotion, PlannedStretch,
    Planner, PlannerSettings, TooFast, TooManyWithinReach,
};
pub use profile::{PhaseKind, PhaseTimes, Profile, ProfilePart, StretchProfile};
pub use smoothing::{Carried, CornerSpeed, Deviation, Joining, Origin, PathSmoother, Smoothed};
pub use speed::{Course, Governor};
pub use tolerance::{LEAST_FEED_SHARE, TANGENT_TOLERANCE_RAD};
pub use wave::{fill_sin_turns, sin_turns, sincos_turns};
