//! What the frame and the functions both know.

pub(crate) mod blend;
pub(crate) mod checks;
pub(crate) mod code;
pub(crate) mod columns;
pub(crate) mod cut;
pub(crate) mod following;
pub(crate) mod listed;
pub(crate) mod plane_frame;
pub(crate) mod reach;
pub(crate) mod setpoint;
pub(crate) mod superposition;
pub(crate) mod tool;
pub(crate) mod track;
pub(crate) mod wording;
