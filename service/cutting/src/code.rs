//! The codes of this crate's findings; each function has its own table.

use feedwave_program::CodeTable;

pub use crate::functions::five_axis::code::*;
pub use crate::functions::path_vibration::code::*;
pub use crate::functions::thinning::code::*;
pub use crate::functions::thread::code::*;
pub use crate::functions::tool_oscillation::code::*;
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
