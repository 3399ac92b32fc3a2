//! Decimal numbers of a program, read to the nearest double.

/// A number as written.
///
/// Two scalars on purpose: a struct of mixed small fields is copied through memory in overlapping pieces, which
/// stalls the processor at every word of a program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number {
    value: f64,
    /// [`HAS_POINT`], [`SPACED`] and the count of integer digits.
    form: u32,
}

/// Bit of [`Number::has_point`].
const HAS_POINT: u32 = 1 << 16;

/// Bit of [`Number::is_spaced`].
const SPACED: u32 = 1 << 17;

/// Bit of [`Number::is_computed`].
const COMPUTED: u32 = 1 << 18;

/// Bit of [`Number::is_negative`].
const NEGATIVE_AT: u32 = 19;

impl Number {
    /// Zero, as a placeholder in reused storage.
    pub(crate) const ZERO: Self = Self { value: 0.0, form: 0 };

    #[inline]
    fn new(value: f64, has_point: bool, spaced: bool, integer_digits: usize) -> Self {
        let digits = integer_digits.min(usize::from(u16::MAX)) as u32;
        let form = digits | if has_point { HAS_POINT } else { 0 } | if spaced { SPACED } else { 0 };
        Self::signed(value, value.is_sign_negative(), form)
    }

    /// A number of which a zero has no sign, but for what its form says.
    #[inline(always)]
    fn signed(value: f64, negative: bool, form: u32) -> Self {
        Self { value: value + 0.0, form: form | u32::from(negative) << NEGATIVE_AT }
    }

    /// The value of an expression, which is finite. It counts as written with a decimal point, so that it is never scaled, and with as
    /// many digits before the point as it has.
    #[must_use]
    pub(crate) fn computed(value: f64) -> Self {
        let digits = (value.abs().max(1.0) as u64).ilog10() + 1;
        Self::signed(value, value.is_sign_negative(), digits | HAS_POINT | COMPUTED)
    }

    /// Whether it was written with a minus, a zero as well: the sign is a direction where a rotary axis wraps.
    #[inline]
    #[must_use]
    pub(crate) const fn is_negative(self) -> bool {
        self.form & (1 << NEGATIVE_AT) != 0
    }

    /// Whether it is the value of an expression.
    #[inline]
    #[must_use]
    pub(crate) const fn is_computed(self) -> bool {
        self.form & COMPUTED != 0
    }

    /// The nearest double; never NaN, infinite or negative zero.
    #[inline]
    #[must_use]
    pub const fn value(self) -> f64 {
        self.value
    }

    /// Whether it was written with a decimal point.
    #[inline]
    #[must_use]
    pub const fn has_point(self) -> bool {
        self.form & HAS_POINT != 0
    }

    /// Whether spaces were written between its characters.
    #[inline]
    #[must_use]
    pub const fn is_spaced(self) -> bool {
        self.form & SPACED != 0
    }

    /// Digits before the decimal point, leading zeros included.
    #[inline]
    #[must_use]
    pub const fn integer_digits(self) -> u32 {
        self.form & (HAS_POINT - 1)
    }
}

/// Why a number cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NumberDefect {
    /// Two signs, two points, or no digit at all.
    Malformed,
    /// Larger than any double.
    TooLarge,
}

/// A scanned number: where it ends, and what it is, which means nothing if it has a defect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scan {
    pub(crate) end: usize,
    pub(crate) number: Number,
    pub(crate) defect: Option<NumberDefect>,
}

impl Scan {
    fn new(end: usize, number: Result<Number, NumberDefect>) -> Self {
        match number {
            Ok(number) => Self { end, number, defect: None },
            Err(defect) => Self { end, number: Number::ZERO, defect: Some(defect) },
        }
    }
}

/// Decimal digits whose integer a double holds exactly.
const EXACT_DIGITS: usize = 15;

/// Powers of ten that a double holds exactly; one division of an exact integer by one of these rounds once, hence correctly.
const EXACT_POWERS_OF_TEN: [f64; EXACT_DIGITS + 1] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// Whether a number can start with this byte.
#[inline]
pub(crate) const fn starts_number(byte: u8) -> bool {
    matches!(byte, b'0'..=b'9' | b'.' | b'+' | b'-')
}

/// Reads the number that starts at `start`, where [`starts_number`] holds.
#[inline(always)]
pub(crate) fn scan_number(line: &[u8], start: usize) -> Scan {
    match scan_plain(line, start) {
        Some((number, end)) if !continues(line, end) => Scan { end, number, defect: None },
        _ => scan_irregular(line, start),
    }
}

/// Reads a sign, digits and a point as most numbers are of, and where they end; nothing where there is no digit or too many. The
/// number may go on behind that: see [`scan_number`].
#[inline(always)]
pub(crate) fn scan_plain(line: &[u8], start: usize) -> Option<(Number, usize)> {
    let first = *line.get(start)?;
    let negative = first == b'-';
    let integer = start + usize::from(negative | (first == b'+'));
    let mut mantissa = 0;
    let point = scan_digits(line, integer, &mut mantissa);
    let integer_digits = point.wrapping_sub(integer);
    if line.get(point) != Some(&b'.') {
        // Neither none nor too many. Most are codes and labels.
        let is_exact = integer_digits.wrapping_sub(1) < EXACT_DIGITS;
        let magnitude = mantissa.cast_signed() as f64;
        // Subtracted, because zero has no sign.
        let value = if negative { 0.0 - magnitude } else { magnitude };
        let form = integer_digits as u32 | u32::from(negative) << NEGATIVE_AT;
        return is_exact.then_some((Number { value, form }, point));
    }
    let end = scan_digits(line, point + 1, &mut mantissa);
    let fraction_digits = end.wrapping_sub(point).wrapping_sub(1);
    if integer_digits.wrapping_add(fraction_digits).wrapping_sub(1) >= EXACT_DIGITS {
        return None;
    }
    let magnitude = mantissa.cast_signed() as f64 / EXACT_POWERS_OF_TEN.get(fraction_digits)?;
    let value = if negative { 0.0 - magnitude } else { magnitude };
    Some((Number { value, form: integer_digits as u32 | HAS_POINT | u32::from(negative) << NEGATIVE_AT }, end))
}

/// Reads the number without a sign that starts at `start` in an expression, where a sign behind it is an operator.
#[inline]
pub(crate) fn scan_operand(line: &[u8], start: usize) -> Scan {
    let mut end = start;
    let mut at = start;
    while let Some(&byte) = line.get(at) {
        match byte {
            b'0'..=b'9' | b'.' => end = at + 1,
            b' ' | b'\t' => {}
            _ => break,
        }
        at += 1;
    }
    scan_number(&line[..end], start)
}

/// Appends the digits from `at` on to a mantissa; where they end.
#[inline(always)]
fn scan_digits(line: &[u8], mut at: usize, mantissa: &mut u64) -> usize {
    while let Some(&byte) = line.get(at) {
        let digit = u64::from(byte) ^ u64::from(b'0');
        if digit > 9 {
            break;
        }
        *mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
        at += 1;
    }
    at
}

/// Whether the number goes on irregularly after `at`: a second point or sign, or digits after spaces.
#[inline]
fn continues(line: &[u8], at: usize) -> bool {
    match line.get(at) {
        None => false,
        Some(b' ' | b'\t') => {
            let next = line[at + 1..].iter().find(|byte| !matches!(byte, b' ' | b'\t'));
            matches!(next, Some(b'0'..=b'9' | b'.'))
        }
        Some(&byte) => starts_number(byte),
    }
}

/// A number with spaces inside or of many digits, or a run of number characters that is none.
#[cold]
fn scan_irregular(line: &[u8], start: usize) -> Scan {
    let mut text = Vec::new();
    let mut end = start;
    let mut spaced = false;
    for (at, &byte) in line.iter().enumerate().skip(start) {
        if starts_number(byte) {
            // A sign after a space starts something else.
            if matches!(byte, b'+' | b'-') && end != at {
                break;
            }
            spaced |= end != at;
            text.push(byte);
            end = at + 1;
        } else if !matches!(byte, b' ' | b'\t') {
            break;
        }
    }
    Scan::new(end, read_long(&text, spaced))
}

/// Reads a number of any length through the standard library's correctly rounding reader.
#[cold]
fn read_long(text: &[u8], spaced: bool) -> Result<Number, NumberDefect> {
    let value = core::str::from_utf8(text).ok().and_then(|text| text.parse::<f64>().ok());
    let value = value.ok_or(NumberDefect::Malformed)?;
    if !value.is_finite() {
        return Err(NumberDefect::TooLarge);
    }
    let unsigned = text.strip_prefix(b"-").or_else(|| text.strip_prefix(b"+")).unwrap_or(text);
    let integer_digits = unsigned.iter().take_while(|byte| byte.is_ascii_digit()).count();
    Ok(Number::new(value, text.contains(&b'.'), spaced, integer_digits))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[track_caller]
    fn check(text: &str, expected: Result<f64, NumberDefect>, end: usize) {
        let scan = scan_number(text.as_bytes(), 0);
        assert_eq!(scan.defect.map_or(Ok(scan.number.value), Err), expected, "{text}");
        assert_eq!(scan.end, end, "{text}");
    }

    #[test]
    fn numbers_as_posts_write_them() {
        check("10", Ok(10.0), 2);
        check("10.", Ok(10.0), 3);
        check(".5Z", Ok(0.5), 2);
        check("+.5", Ok(0.5), 3);
        check("-12.345 Y1", Ok(-12.345), 7);
        check("0.1", Ok(0.1), 3);
        check("00012.50", Ok(12.5), 8);
        check("0.30000000000000004441", Ok(0.300_000_000_000_000_04), 22);
        check("123456789012345678901234567890", Ok(123_456_789_012_345_678_901_234_567_890.0), 30);
    }

    #[test]
    fn operands_end_before_a_sign() {
        for (text, value, end) in [("10-5]", 10.0, 2), ("1 0 - 5", 10.0, 3), (".5+1", 0.5, 2), ("7]", 7.0, 1)] {
            let scan = scan_operand(text.as_bytes(), 0);
            assert_eq!((scan.number.value, scan.end, scan.defect), (value, end, None), "{text}");
        }
        assert_eq!(scan_operand(b"1.2.3", 0).defect, Some(NumberDefect::Malformed));
    }

    #[test]
    fn computed_numbers_are_never_scaled() {
        for (value, digits) in [(0.0, 1), (9.99, 1), (101.0, 3), (-1000.0, 4)] {
            let number = Number::computed(value);
            assert_eq!((number.value, number.integer_digits()), (value, digits));
            assert!(number.has_point() && number.is_computed() && !number.is_spaced());
        }
        assert!(Number::computed(-0.0).value.is_sign_positive());
    }

    #[test]
    fn negative_zero_is_zero() {
        for text in ["-0", "-0.000", "-0.000000000000000000000000"] {
            let scan = scan_number(text.as_bytes(), 0);
            assert_eq!((scan.number.value.to_bits(), scan.defect), (0, None), "{text}");
        }
    }

    #[test]
    fn malformed_numbers_are_consumed_whole() {
        for text in ["-", "+.", ".", "1.2.3", "--5", "5-3", "1..2"] {
            check(text, Err(NumberDefect::Malformed), text.len());
        }
        let huge = "9".repeat(400);
        check(&huge, Err(NumberDefect::TooLarge), 400);
    }

    #[test]
    fn spaces_inside_a_number() {
        check("1 0. 5 Y", Ok(10.5), 6);
        check("- 5", Ok(-5.0), 3);
        check("10 -5", Ok(10.0), 2);
        let scan = scan_number(b"10 20", 0);
        assert_eq!(scan.number, Number::new(1020.0, false, true, 4));
    }

    proptest! {
        #[test]
        fn exactly_rounded(text in "[+-]?([0-9]{1,25}(\\.[0-9]{0,25})?|\\.[0-9]{1,25})") {
            let scan = scan_number(text.as_bytes(), 0);
            let expected: f64 = text.parse().unwrap();
            prop_assert_eq!(scan.end, text.len());
            prop_assert_eq!(scan.number.value, expected);
        }

        #[test]
        fn any_bytes_end_after_they_start(
            first in prop::sample::select(b"0123456789.+-".to_vec()),
            rest in prop::collection::vec(prop::sample::select(b"059.+- \tX\0\xff".to_vec()), 0..60),
        ) {
            let bytes: Vec<u8> = core::iter::once(first).chain(rest).collect();
            let scan = scan_number(&bytes, 0);
            prop_assert!(scan.end > 0 && scan.end <= bytes.len());
        }
    }
}
