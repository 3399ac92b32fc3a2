//! The machining functions, one folder each: words, state, limits, superposition, judgement and report.
//!
//! Here are their list and that of their finding codes; what is public of them is the crate's.

mod axis_load;
pub(crate) mod five_axis;
pub(crate) mod path_vibration;
mod sampling;
mod switch;
pub mod thinning;
pub mod thread;
pub mod tool_oscillation;

/// The codes of this crate's findings; each function has its own table.
pub mod code {
    use feedwave_program::CodeTable;

    pub use super::five_axis::code::*;
    pub use super::path_vibration::code::*;
    pub use super::thinning::code::*;
    pub use super::thread::code::*;
    pub use super::tool_oscillation::code::*;
    pub use crate::shared::code::*;

    /// Every finding code of this crate, by function.
    pub const TABLES: [CodeTable; 6] = [
        MACHINE_CODES,
        PATH_VIBRATION_CODES,
        TOOL_OSCILLATION_CODES,
        THREAD_VIBRATION_CODES,
        FIVE_AXIS_CODES,
        THINNING_CODES,
    ];
}
