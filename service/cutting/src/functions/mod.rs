//! The machining functions, one folder each: words, state, limits, superposition, judgement and report.

mod axis_load;
pub(crate) mod five_axis;
pub(crate) mod path_vibration;
mod sampling;
mod switch;
pub mod thinning;
pub mod thread;
pub mod tool_oscillation;
