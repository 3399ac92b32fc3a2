//! Expressions of the macro languages: the bytes of a line in, a value or a defect with its place out.
//!
//! What dialects differ in is data ([`Rules`]): operators with their precedence, functions, depth, what a condition is. Values come from
//! [`Variables`]. Evaluation allocates nothing but for a defect, and its depth is bounded.

mod extent;
mod function;
mod name;
mod operator;
mod parse;
mod rules;
#[cfg(test)]
mod tests;

pub(crate) use extent::{operation_end, starts_value, value_end};
pub(crate) use function::{nearest, nearest_increment};
pub(crate) use name::Name;
pub(crate) use rules::{FANUC, HAAS, LINUXCNC, Rules};

use std::borrow::Cow;

use crate::{AngleRange, FindingCode, code};
use parse::{Operand, Parser};
pub(crate) use parse::{WHOLE_TOLERANCE, whole_near};

/// A value: a number, or vacant (Macro B: a variable never assigned).
pub(crate) type Value = Option<f64>;

/// What an expression reads.
pub(crate) trait Variables {
    /// The parameter of this number.
    fn numbered(&self, number: u32) -> Result<Reading, Refusal>;

    /// The named parameter, `None` where it was never assigned.
    fn named(&self, name: &Name) -> Result<Option<f64>, Refusal>;
}

/// What reading a parameter gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reading {
    pub(crate) value: Value,
    /// It comes from a probe, whose result is not known here.
    pub(crate) is_probed: bool,
}

impl From<Value> for Reading {
    fn from(value: Value) -> Self {
        Self { value, is_probed: false }
    }
}

/// Why a parameter cannot be read or assigned.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Refusal {
    pub(crate) code: FindingCode,
    pub(crate) message: String,
    pub(crate) cure: Cow<'static, str>,
}

/// What is wrong with an expression, and where: it becomes a finding at that place.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Defect {
    pub(crate) code: FindingCode,
    /// Offset of the first byte in the line, and of the byte behind the last.
    pub(crate) start: usize,
    pub(crate) end: usize,
    pub(crate) message: String,
    /// The numbers that led to it: what each is, and its value.
    pub(crate) values: Vec<(&'static str, f64)>,
    pub(crate) cure: Cow<'static, str>,
}

impl Defect {
    pub(crate) fn new(code: FindingCode, start: usize, end: usize, message: impl Into<String>) -> Box<Self> {
        Box::new(Self { code, start, end, message: message.into(), values: Vec::new(), cure: Cow::Borrowed("") })
    }

    /// Adds the cure in words.
    pub(crate) fn cure(mut self: Box<Self>, cure: impl Into<Cow<'static, str>>) -> Box<Self> {
        self.cure = cure.into();
        self
    }

    /// Adds a number that led to it.
    pub(crate) fn value(mut self: Box<Self>, name: &'static str, value: f64) -> Box<Self> {
        self.values.push((name, value));
        self
    }

    pub(crate) fn refused(refusal: Refusal, start: usize, end: usize) -> Box<Self> {
        Self::new(refusal.code, start, end, refusal.message).cure(refusal.cure)
    }
}

/// Something about an expression that is worth saying and changes nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoteKind {
    /// Numbers that are not whole were compared for equality.
    Equality,
    /// The result of a probe was read.
    Probe,
}

/// A [`NoteKind`] with its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Note {
    pub(crate) kind: NoteKind,
    pub(crate) start: usize,
    pub(crate) end: usize,
}

impl Note {
    /// What the finding about it says: code, message and cure.
    pub(crate) const fn text(self) -> (FindingCode, &'static str, &'static str) {
        match self.kind {
            NoteKind::Equality => (
                code::EXPRESSION_EQUALITY,
                "numbers that are not whole are compared for equality; they count as equal within 1e-9",
                "compare the difference with a tolerance, such as ABS[#1-2.5] LT 0.001",
            ),
            NoteKind::Probe => (
                code::PARAMETER_PROBED,
                "the result of a probe is read; here it is the programmed end of the probing move",
                "bring the expected result with the profile ([[language.parameters]], #5061 and on) or with the offsets of the job \
                 ([[parameters]]), and check what depends on it",
            ),
        }
    }
}

/// What an evaluation reads, and what it has to say.
pub(crate) struct Context<'a> {
    pub(crate) rules: &'static Rules,
    pub(crate) variables: &'a dyn Variables,
    /// Range of `ATAN[a]/[b]` and `ASIN` where the control's parameters choose it.
    pub(crate) angle_range: AngleRange,
    /// Least increments per unit that `ROUND` rounds to, in the word of an address; 1 elsewhere.
    pub(crate) increments: f64,
    /// In the order in which they were met.
    pub(crate) notes: Vec<Note>,
}

impl<'a> Context<'a> {
    pub(crate) const fn new(rules: &'static Rules, variables: &'a dyn Variables, angle_range: AngleRange) -> Self {
        Self { rules, variables, angle_range, increments: 1.0, notes: Vec::new() }
    }
}

/// What an assignment sets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Target {
    Numbered(u32),
    Named(Name),
}

/// An assignment that has been read and not been made yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Assignment {
    pub(crate) target: Target,
    pub(crate) value: Value,
    /// From the `#` to the end of the value.
    pub(crate) start: usize,
    pub(crate) end: usize,
}

/// Reads the value that starts at `at` (a number, a parameter, brackets or a function, with a sign or without), and says where it ends.
pub(crate) fn evaluate(line: &[u8], at: usize, context: &mut Context<'_>) -> Result<(Value, usize), Box<Defect>> {
    let mut parser = Parser::new(line, at, context);
    let operand = parser.operand()?;
    let value = parser.number(operand, at)?;
    Ok((value, parser.at()))
}

/// Reads the condition in brackets that starts at `at`, and says where it ends.
pub(crate) fn condition(line: &[u8], at: usize, context: &mut Context<'_>) -> Result<(bool, usize), Box<Defect>> {
    let mut parser = Parser::new(line, at, context);
    let operand = parser.bracketed()?;
    let holds = match operand {
        Operand::Truth(holds) => holds,
        Operand::Number(value) if parser.rules().truths_are_numbers => value != 0.0,
        Operand::Number(_) | Operand::Vacant => {
            return Err(Defect::new(
                code::EXPRESSION_TRUTH,
                at,
                parser.at(),
                "this is a number where a condition is needed",
            )
            .cure("compare it: [#1 NE 0]"));
        }
    };
    Ok((holds, parser.at()))
}

/// Reads the assignment whose `#` is at `at`, and says in it where it ends. Nothing is assigned yet.
pub(crate) fn assignment(line: &[u8], at: usize, context: &mut Context<'_>) -> Result<Assignment, Box<Defect>> {
    let mut parser = Parser::new(line, at, context);
    let target = parser.target()?;
    if !parser.takes(b'=') {
        return Err(Defect::new(code::EXPRESSION_MALFORMED, at, parser.at(), "a parameter without an address letter")
            .cure("write the letter before it, or = and its new value behind it"));
    }
    let start = parser.at();
    let operand = if parser.rules().assigns_expressions { parser.expression()? } else { parser.operand()? };
    let value = parser.number(operand, start)?;
    Ok(Assignment { target, value, start: at, end: parser.at() })
}
