//! The machining functions, one folder each: words, state, limits, superposition, judgement and report.

pub(crate) mod five_axis;
pub(crate) mod path_vibration;
pub(crate) mod switch;
pub mod thinning;
pub mod thread;
pub mod tool_oscillation;
