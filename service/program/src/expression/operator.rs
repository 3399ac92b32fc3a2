//! Operators: one table per dialect, and what each of them does.

use super::parse::Operand;

/// What an operator does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operation {
    Power,
    Times,
    Divide,
    Modulo,
    Plus,
    Minus,
    Equal,
    NotEqual,
    Greater,
    GreaterOrEqual,
    Less,
    LessOrEqual,
    And,
    Or,
    Xor,
}

impl Operation {
    /// Whether it compares.
    pub(crate) const fn compares(self) -> bool {
        use Operation::{Equal, Greater, GreaterOrEqual, Less, LessOrEqual, NotEqual};
        matches!(self, Equal | NotEqual | Greater | GreaterOrEqual | Less | LessOrEqual)
    }

    /// Whether it computes with numbers alone.
    pub(super) const fn is_arithmetic(self) -> bool {
        !self.compares() && !matches!(self, Self::And | Self::Or | Self::Xor)
    }
}

/// An operator of a dialect.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Operator {
    /// As it is written, in upper case.
    pub(crate) text: &'static [u8],
    pub(crate) operation: Operation,
    /// Precedence: higher ones bind tighter; operators of one level are carried out from left to right.
    pub(crate) level: u8,
}

const fn row(text: &'static [u8], operation: Operation, level: u8) -> Operator {
    Operator { text, operation, level }
}

/// Macro B: `AND` binds as `*`, `OR` and `XOR` as `+`; comparisons stand in conditions only.
pub(super) static FANUC: &[Operator] = &[
    row(b"*", Operation::Times, 3),
    row(b"/", Operation::Divide, 3),
    row(b"+", Operation::Plus, 2),
    row(b"-", Operation::Minus, 2),
    row(b"MOD", Operation::Modulo, 3),
    row(b"AND", Operation::And, 3),
    row(b"OR", Operation::Or, 2),
    row(b"XOR", Operation::Xor, 2),
    row(b"EQ", Operation::Equal, 1),
    row(b"NE", Operation::NotEqual, 1),
    row(b"GT", Operation::Greater, 1),
    row(b"GE", Operation::GreaterOrEqual, 1),
    row(b"LT", Operation::Less, 1),
    row(b"LE", Operation::LessOrEqual, 1),
];

/// LinuxCNC: the power binds tightest, `AND`, `OR` and `XOR` are one level below the comparisons.
pub(super) static LINUXCNC: &[Operator] = &[
    row(b"**", Operation::Power, 5),
    row(b"*", Operation::Times, 4),
    row(b"/", Operation::Divide, 4),
    row(b"+", Operation::Plus, 3),
    row(b"-", Operation::Minus, 3),
    row(b"MOD", Operation::Modulo, 4),
    row(b"EQ", Operation::Equal, 2),
    row(b"NE", Operation::NotEqual, 2),
    row(b"GT", Operation::Greater, 2),
    row(b"GE", Operation::GreaterOrEqual, 2),
    row(b"LT", Operation::Less, 2),
    row(b"LE", Operation::LessOrEqual, 2),
    row(b"AND", Operation::And, 1),
    row(b"OR", Operation::Or, 1),
    row(b"XOR", Operation::Xor, 1),
];

/// The operator of a table that stands at the start of `text`.
#[inline]
pub(crate) fn operator_at(table: &'static [Operator], text: &[u8]) -> Option<&'static Operator> {
    let first = text.first()?.to_ascii_uppercase();
    let stands = |operator: &&Operator| {
        operator.text[0] == first
            && text.get(..operator.text.len()).is_some_and(|written| written.eq_ignore_ascii_case(operator.text))
    };
    table.iter().find(stands)
}

/// Why an operation has no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Impossible {
    DivisionByZero,
    /// A negative number to a power that is not whole.
    Power,
    /// `MOD` of negative numbers: controls differ.
    NegativeModulo,
    /// Bits of a number that is not whole or has more than 32 of them.
    Bits,
    /// A truth value where a number is needed, or a number where a truth value is.
    Truth,
}

/// Two numbers that count as equal in LinuxCNC (of release 2.9: 1 EQ 1.00009 is true, 1 EQ 1.0002 is not).
const EQUAL_LINUXCNC: f64 = 1e-4;

/// Two numbers that count as equal in Macro B, where they are compared to the eight or so digits of the control.
fn equal_fanuc(left: f64, right: f64) -> bool {
    (left - right).abs() <= 1e-9 * left.abs().max(1.0)
}

/// The integer bits of a number.
fn bits(value: f64) -> Result<i64, Impossible> {
    let whole = value as i64;
    let is_fit = whole as f64 == value && (i64::from(i32::MIN)..=i64::from(u32::MAX)).contains(&whole);
    if is_fit { Ok(whole) } else { Err(Impossible::Bits) }
}

const fn number(value: f64) -> Result<Operand, Impossible> {
    Ok(Operand::Number(value))
}

/// Arithmetic that is the same everywhere; a vacant value counts as 0.
fn arithmetic(operation: Operation, left: f64, right: f64) -> Result<Operand, Impossible> {
    number(match operation {
        Operation::Times => left * right,
        Operation::Divide if right == 0.0 => return Err(Impossible::DivisionByZero),
        Operation::Divide => left / right,
        Operation::Plus => left + right,
        Operation::Minus => left - right,
        Operation::Power if left < 0.0 && libm::floor(right) != right => return Err(Impossible::Power),
        Operation::Power if left == 0.0 && right < 0.0 => return Err(Impossible::DivisionByZero),
        _ => libm::pow(left, right),
    })
}

fn compare(operation: Operation, left: f64, right: f64, equal: bool) -> bool {
    match operation {
        Operation::Equal => equal,
        Operation::NotEqual => !equal,
        Operation::Greater => left > right,
        Operation::GreaterOrEqual => left >= right,
        Operation::Less => left < right,
        _ => left <= right,
    }
}

fn logic(operation: Operation, left: bool, right: bool) -> bool {
    match operation {
        Operation::And => left && right,
        Operation::Or => left || right,
        _ => left != right,
    }
}

/// Carries an operation of Macro B out.
pub(super) fn fanuc(operation: Operation, left: Operand, right: Operand) -> Result<Operand, Impossible> {
    if let (Operand::Truth(left), Operand::Truth(right), Operation::And | Operation::Or | Operation::Xor) =
        (left, right, operation)
    {
        return Ok(Operand::Truth(logic(operation, left, right)));
    }
    let is_vacant = (left == Operand::Vacant, right == Operand::Vacant);
    let (Some(left), Some(right)) = (left.or_zero(), right.or_zero()) else {
        return Err(Impossible::Truth);
    };
    match operation {
        Operation::Modulo => {
            // Halves away from zero, as ROUND does.
            let (left, right) = (libm::round(left), libm::round(right));
            match right {
                0.0 => Err(Impossible::DivisionByZero),
                _ if left < 0.0 || right < 0.0 => Err(Impossible::NegativeModulo),
                _ => number(libm::fmod(left, right)),
            }
        }
        Operation::And => number((bits(left)? & bits(right)?) as f64),
        Operation::Or => number((bits(left)? | bits(right)?) as f64),
        Operation::Xor => number((bits(left)? ^ bits(right)?) as f64),
        // Equality tells vacant from zero, the other comparisons do not.
        _ if operation.compares() => {
            let equal = is_vacant.0 == is_vacant.1 && equal_fanuc(left, right);
            Ok(Operand::Truth(compare(operation, left, right, equal)))
        }
        _ => arithmetic(operation, left, right),
    }
}

/// Carries an operation of LinuxCNC out: truth values are the numbers 1 and 0, and any number but 0 is true.
pub(super) fn linuxcnc(operation: Operation, left: Operand, right: Operand) -> Result<Operand, Impossible> {
    let (Some(left), Some(right)) = (left.or_zero(), right.or_zero()) else {
        return Err(Impossible::Truth);
    };
    match operation {
        Operation::Modulo if right == 0.0 => Err(Impossible::DivisionByZero),
        Operation::Modulo => {
            let rest = libm::fmod(left, right);
            number(if rest < 0.0 { rest + right.abs() } else { rest })
        }
        Operation::And | Operation::Or | Operation::Xor => {
            number(f64::from(u8::from(logic(operation, left != 0.0, right != 0.0))))
        }
        _ if operation.compares() => {
            let equal = (left - right).abs() < EQUAL_LINUXCNC;
            number(f64::from(u8::from(compare(operation, left, right, equal))))
        }
        _ => arithmetic(operation, left, right),
    }
}
