//! What dialects differ in.

use super::function::{self, Functions};
use super::operator::{self, Impossible, Operation, Operator};
use super::parse::Operand;

/// The expressions of one dialect.
pub(crate) struct Rules {
    pub(crate) operators: &'static [Operator],
    pub(crate) functions: Functions,
    pub(super) apply: fn(Operation, Operand, Operand) -> Result<Operand, Impossible>,
    /// Brackets, functions and parameters within each other.
    pub(crate) max_depth: u32,
    /// Comparisons give truth values, which stand in conditions only; otherwise they give the numbers 1 and 0.
    pub(crate) has_truth_values: bool,
    /// Truth values are the numbers 1 and 0 where numbers are needed, and every number but 0 is a true condition.
    pub(super) truths_are_numbers: bool,
    /// Parameters may have names: `#<name>`.
    pub(crate) has_names: bool,
    /// A parameter may follow the `#` of another one without brackets: `##1`.
    pub(crate) chains_parameters: bool,
    /// A whole expression may stand behind `=` without brackets: `#1=#2+1`.
    pub(crate) assigns_expressions: bool,
    /// Several assignments in a line see each other's values; otherwise all see those before the line.
    pub(crate) assigns_in_sequence: bool,
    /// An assignment may share its line with codes that have no words: `#101=0 M99`.
    pub(crate) assigns_beside_codes: bool,
    /// `ATAN[a]/[b]` and `ASIN` have the range of the control's parameters; otherwise -180 to 180 and -90 to 90.
    pub(crate) chooses_angle_range: bool,
    /// `DPRNT` and the like write to files and printers.
    pub(crate) has_output: bool,
    /// Values of words are rounded to the least increment of their address.
    pub(crate) rounds_words: bool,
}

impl core::fmt::Debug for Rules {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.debug_struct("Rules").field("max_depth", &self.max_depth).finish_non_exhaustive()
    }
}

/// FANUC Macro B.
pub(crate) static FANUC: Rules = MACRO_B;

/// Haas.
pub(crate) static HAAS: Rules = Rules { truths_are_numbers: true, assigns_beside_codes: true, ..MACRO_B };

const MACRO_B: Rules = Rules {
    operators: operator::FANUC,
    functions: function::FANUC,
    apply: operator::fanuc,
    max_depth: 5,
    has_truth_values: true,
    truths_are_numbers: false,
    has_names: false,
    chains_parameters: false,
    assigns_expressions: true,
    assigns_in_sequence: true,
    assigns_beside_codes: false,
    chooses_angle_range: true,
    has_output: true,
    rounds_words: true,
};

/// LinuxCNC.
pub(crate) static LINUXCNC: Rules = Rules {
    operators: operator::LINUXCNC,
    functions: function::LINUXCNC,
    apply: operator::linuxcnc,
    max_depth: 32,
    has_truth_values: false,
    truths_are_numbers: true,
    has_names: true,
    chains_parameters: true,
    assigns_expressions: false,
    assigns_in_sequence: false,
    assigns_beside_codes: true,
    chooses_angle_range: false,
    has_output: false,
    rounds_words: false,
};
