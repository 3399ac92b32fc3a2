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
    match special(value) {
        None => CompactFormatter.write_f64(json, value).expect(MEMORY),
        Some(name) => json.extend_from_slice(name.as_bytes()),
    }
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
