//! The codes of the program language's findings.

mod compensation;
mod coordinates;
mod cycle;
mod expression;
mod flow;
mod motion;
mod text;
mod thread;
mod tool;
mod turning;
mod words;

pub use self::compensation::*;
pub use self::coordinates::*;
pub use self::cycle::*;
pub use self::expression::*;
pub use self::flow::*;
pub use self::motion::*;
pub use self::text::*;
pub use self::thread::*;
pub use self::tool::*;
pub use self::turning::*;
pub use self::words::*;

use crate::CodeTable;
#[cfg(test)]
use crate::FindingCode;

/// Every finding code of the program language, by topic.
pub const TABLES: [CodeTable; 11] = [
    TEXT_CODES,
    WORDS_CODES,
    EXPRESSION_CODES,
    FLOW_CODES,
    MOTION_CODES,
    CYCLE_CODES,
    TURNING_CODES,
    THREAD_CODES,
    TOOL_CODES,
    COMPENSATION_CODES,
    COORDINATE_CODES,
];

/// Whether the program language makes findings of this code.
#[cfg(test)]
pub(crate) fn is_of_language(code: FindingCode) -> bool {
    code.name().starts_with("PRG-")
}

#[cfg(test)]
mod tests {
    use super::TABLES;

    #[test]
    fn codes_are_of_the_language() {
        for entry in TABLES.iter().flat_map(|table| table.entries) {
            assert!(entry.name.starts_with("PRG-"), "{}", entry.name);
        }
    }
}
