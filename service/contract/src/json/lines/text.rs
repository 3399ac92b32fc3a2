//! Values as the mapping writes them.

use serde_json::ser::{CompactFormatter, Formatter as _};

use super::Same;
use crate::json::special;

const MEMORY: &str = "writing into memory does not fail";

#[inline]
pub(super) fn bool(value: bool, json: &mut Vec<u8>) {
    json.extend_from_slice(if value { b"true" } else { b"false" });
}

#[inline]
pub(super) fn u32(value: u32, json: &mut Vec<u8>) {
    CompactFormatter.write_u32(json, value).expect(MEMORY);
}

#[inline]
pub(super) fn f64(value: f64, json: &mut Vec<u8>) {
    if value == 0.0 && value.is_sign_positive() {
        return json.extend_from_slice(b"0.0");
    }
    if decimal(value, json) {
        return;
    }
    match special(value) {
        None => CompactFormatter.write_f64(json, value).expect(MEMORY),
        Some(name) => json.extend_from_slice(name.as_bytes()),
    }
}

/// Two digits of every number below a hundred.
const PAIRS: [[u8; 2]; 100] = {
    let mut pairs = [[0; 2]; 100];
    let mut number = 0;
    while number < 100 {
        pairs[number] = [b'0' + number as u8 / 10, b'0' + number as u8 % 10];
        number += 1;
    }
    pairs
};

/// Writes a number of at most five digits before the point and four behind it, as most of programs are; whether it is one. The double
/// nearest to so short a decimal is nearest to no other that is as short, so that the decimal is what any writer of shortest numbers
/// writes.
#[inline]
fn decimal(value: f64, json: &mut Vec<u8>) -> bool {
    const SCALE: u32 = 10_000;
    const BELOW: f64 = 100_000.0;
    let magnitude = value.abs();
    if magnitude >= BELOW {
        return false;
    }
    let scaled = (magnitude * f64::from(SCALE) + 0.5) as u32;
    if f64::from(scaled) / f64::from(SCALE) != magnitude || scaled >= BELOW as u32 * SCALE {
        return false;
    }
    let (whole, fraction) = (scaled / SCALE, scaled % SCALE);
    let pair = |number: u32| PAIRS[(number % 100) as usize];
    let ([_, a], [b, c], [d, e]) = (pair(whole / 10_000), pair(whole / 100), pair(whole));
    let ([f, g], [h, i]) = (pair(fraction / 100), pair(fraction));
    let mut text = [b'-', a, b, c, d, e, b'.', f, g, h, i];
    let first = match whole {
        0..10 => 5,
        10..100 => 4,
        100..1_000 => 3,
        1_000..10_000 => 2,
        _ => 1,
    };
    let end = match [g, h, i] {
        [_, _, b'1'..=b'9'] => 11,
        [_, b'1'..=b'9', _] => 10,
        [b'1'..=b'9', _, _] => 9,
        _ => 8,
    };
    let first = if value.is_sign_negative() {
        text[first - 1] = b'-';
        first - 1
    } else {
        first
    };
    json.extend_from_slice(&text[first..end]);
    true
}

#[inline]
pub(super) fn string(value: &str, json: &mut Vec<u8>) {
    if value.is_empty() {
        return json.extend_from_slice(b"\"\"");
    }
    serde_json::to_writer(json, value).expect(MEMORY);
}

/// The name of an enum's value, or its number where it has none.
#[inline]
pub(super) fn name<E>(name: Result<&'static str, E>, number: i32, json: &mut Vec<u8>) {
    match name {
        Ok(name) => {
            json.push(b'"');
            json.extend_from_slice(name.as_bytes());
            json.push(b'"');
        }
        Err(_) => CompactFormatter.write_i32(json, number).expect(MEMORY),
    }
}

pub(super) fn list<T>(values: &[T], json: &mut Vec<u8>, write: impl Fn(&T, &mut Vec<u8>)) {
    json.push(b'[');
    for (place, value) in values.iter().enumerate() {
        if place > 0 {
            json.push(b',');
        }
        write(value, json);
    }
    json.push(b']');
}

impl Same for bool {
    #[inline]
    fn is_same(&self, other: &Self) -> bool {
        self == other
    }
}

impl Same for u32 {
    #[inline]
    fn is_same(&self, other: &Self) -> bool {
        self == other
    }
}

impl Same for i32 {
    #[inline]
    fn is_same(&self, other: &Self) -> bool {
        self == other
    }
}

impl Same for f64 {
    #[inline]
    fn is_same(&self, other: &Self) -> bool {
        self.to_bits() == other.to_bits()
    }
}

impl Same for String {
    #[inline]
    fn is_same(&self, other: &Self) -> bool {
        self == other
    }
}

impl<T: Same> Same for Option<T> {
    #[inline]
    fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Some(one), Some(other)) => one.is_same(other),
            (None, None) => true,
            _ => false,
        }
    }
}

impl<T: Same> Same for Vec<T> {
    #[inline]
    fn is_same(&self, other: &Self) -> bool {
        self.len() == other.len() && self.iter().zip(other).all(|(one, other)| one.is_same(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_numbers_are_written_as_any_others() {
        let check = |value: f64| {
            let (mut short, mut json) = (Vec::new(), Vec::new());
            let is_short = decimal(value, &mut short);
            CompactFormatter.write_f64(&mut json, value).unwrap();
            assert!(
                !is_short || short == json,
                "{} {}",
                String::from_utf8_lossy(&short),
                String::from_utf8_lossy(&json)
            );
            is_short
        };
        for scaled in (0..30_000).chain((0..1_000_000_000).step_by(9_973)).chain([999_999_999, 99_999_999, 100_000_000])
        {
            let value = f64::from(scaled) / 10_000.0;
            assert!(check(value) && check(-value), "{value}");
            for neighbour in [value.next_up(), value.next_down(), value * 1.1, value / 3.0] {
                check(neighbour);
            }
        }
        for value in [100_000.0, 99_999.999_99, 0.000_01, 1e300, f64::MIN_POSITIVE, f64::NAN, f64::INFINITY] {
            assert!(!decimal(value, &mut Vec::new()), "{value}");
        }
    }
}
