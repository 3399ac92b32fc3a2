//! What the frame and the functions both know.

pub(crate) mod blend;
pub(crate) mod cut;
pub(crate) mod setpoint;
pub(crate) mod wording;
