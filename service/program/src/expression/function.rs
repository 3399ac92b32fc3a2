//! Functions: one table per dialect, and what each of them does. Angles are in degrees.

use crate::AngleRange;

/// What a function does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Function {
    Sine,
    Cosine,
    Tangent,
    ArcSine,
    ArcCosine,
    /// `ATAN[a]`, or `ATAN[a]/[b]`
    ArcTangent,
    SquareRoot,
    Absolute,
    Round,
    /// `FIX` toward zero and `FUP` away from it.
    TowardZero,
    AwayFromZero,
    /// `FIX` and `FUP` of LinuxCNC.
    Floor,
    Ceiling,
    Logarithm,
    Exponential,
    /// `POW[a,b]`
    Power,
    /// From binary-coded decimal digits.
    FromDecimalDigits,
    /// To binary-coded decimal digits.
    ToDecimalDigits,
    /// `EXISTS[#<name>]`
    Exists,
    /// Known, and not carried out: it depends on how the argument was written in the calling block.
    AddPoint,
}

const MACRO_B: [(&[u8], Function); 17] = [
    (b"SIN", Function::Sine),
    (b"COS", Function::Cosine),
    (b"TAN", Function::Tangent),
    (b"ASIN", Function::ArcSine),
    (b"ACOS", Function::ArcCosine),
    (b"ATAN", Function::ArcTangent),
    (b"SQRT", Function::SquareRoot),
    (b"ABS", Function::Absolute),
    (b"ROUND", Function::Round),
    (b"FIX", Function::TowardZero),
    (b"FUP", Function::AwayFromZero),
    (b"LN", Function::Logarithm),
    (b"EXP", Function::Exponential),
    (b"POW", Function::Power),
    (b"BIN", Function::FromDecimalDigits),
    (b"BCD", Function::ToDecimalDigits),
    (b"ADP", Function::AddPoint),
];

const LINUX: [(&[u8], Function); 14] = [
    (b"SIN", Function::Sine),
    (b"COS", Function::Cosine),
    (b"TAN", Function::Tangent),
    (b"ASIN", Function::ArcSine),
    (b"ACOS", Function::ArcCosine),
    (b"ATAN", Function::ArcTangent),
    (b"SQRT", Function::SquareRoot),
    (b"ABS", Function::Absolute),
    (b"ROUND", Function::Round),
    (b"FIX", Function::Floor),
    (b"FUP", Function::Ceiling),
    (b"LN", Function::Logarithm),
    (b"EXP", Function::Exponential),
    (b"EXISTS", Function::Exists),
];

/// The functions of a dialect: name in upper case, and what it does.
pub(crate) type Functions = &'static [(&'static [u8], Function)];

pub(super) static FANUC: Functions = &MACRO_B;
pub(super) static LINUXCNC: Functions = &LINUX;

/// The function of this name.
pub(crate) fn function_named(table: Functions, name: &[u8]) -> Option<Function> {
    table.iter().find(|(text, _)| name.eq_ignore_ascii_case(text)).map(|&(_, function)| function)
}

/// Largest number of eight decimal digits.
const EIGHT_DIGITS: f64 = 99_999_999.0;

/// A function of one argument; `Err` says what the argument must be.
pub(super) fn apply(function: Function, value: f64, range: AngleRange, increments: f64) -> Result<f64, &'static str> {
    Ok(match function {
        Function::Sine => libm::sin(value.to_radians()),
        Function::Cosine => libm::cos(value.to_radians()),
        Function::Tangent => libm::tan(value.to_radians()),
        Function::ArcSine | Function::ArcCosine if value.abs() > 1.0 => return Err("must lie between -1 and 1"),
        Function::ArcSine => turned(libm::asin(value).to_degrees(), range),
        Function::ArcCosine => libm::acos(value).to_degrees(),
        Function::ArcTangent => libm::atan(value).to_degrees(),
        Function::SquareRoot if value < 0.0 => return Err("must not be negative"),
        Function::SquareRoot => libm::sqrt(value),
        Function::Absolute => value.abs(),
        Function::Round => nearest_increment(value, increments),
        Function::TowardZero => libm::trunc(value),
        Function::AwayFromZero if value < 0.0 => libm::floor(value),
        Function::AwayFromZero | Function::Ceiling => libm::ceil(value),
        Function::Floor => libm::floor(value),
        Function::Logarithm if value <= 0.0 => return Err("must be greater than 0"),
        Function::Logarithm => libm::log(value),
        Function::Exponential => libm::exp(value),
        Function::FromDecimalDigits => from_digits(value)?,
        Function::ToDecimalDigits => to_digits(value)?,
        Function::Power | Function::Exists | Function::AddPoint => return Err("is not a single number"),
    })
}

/// `ATAN[a]/[b]`, degrees.
pub(super) fn arc_tangent(y: f64, x: f64, range: AngleRange) -> f64 {
    turned(libm::atan2(y, x).to_degrees(), range)
}

/// An angle in the range of the control.
fn turned(angle: f64, range: AngleRange) -> f64 {
    if range == AngleRange::Positive && angle < 0.0 { angle + 360.0 } else { angle }
}

/// The nearest whole number, halves away from zero.
pub(crate) fn nearest(value: f64) -> f64 {
    libm::trunc(value + if value < 0.0 { -0.5 } else { 0.5 })
}

/// The nearest least increment, of which there are so many per unit.
pub(crate) fn nearest_increment(value: f64, increments: f64) -> f64 {
    nearest(value * increments) / increments
}

/// `BIN`: the number whose decimal digits stand in four bits each.
fn from_digits(value: f64) -> Result<f64, &'static str> {
    const REASON: &str = "must be a whole number of up to eight digits 0 to 9, four bits each";
    let bits = value as u32;
    if f64::from(bits) != value {
        return Err(REASON);
    }
    (0..8).rev().map(|place| bits >> (4 * place) & 15).try_fold(0.0, |number, digit| match digit {
        0..=9 => Ok(number * 10.0 + f64::from(digit)),
        _ => Err(REASON),
    })
}

/// `BCD`: the decimal digits of a number in four bits each.
fn to_digits(value: f64) -> Result<f64, &'static str> {
    let mut rest = value as u32;
    if f64::from(rest) != value || value > EIGHT_DIGITS {
        return Err("must be a whole number from 0 to 99999999");
    }
    let mut bits = 0;
    for place in 0..8 {
        bits |= (rest % 10) << (4 * place);
        rest /= 10;
    }
    Ok(f64::from(bits))
}
