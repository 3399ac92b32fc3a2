//! The encoding of protobuf messages, as far as reading what generated types have written needs it: every record is whole.

/// How a value is encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    /// Seven bits in a byte, the lowest first.
    Varint,
    /// Eight bytes, the lowest first.
    Fixed64,
    /// Four bytes, the lowest first.
    Fixed32,
    /// A length and as many bytes: a text, a message, or a list of numbers.
    Bytes,
}

/// A value as it is encoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Raw<'a> {
    Varint(u64),
    Fixed64(u64),
    Fixed32(u32),
    Bytes(&'a [u8]),
}

impl<'a> Raw<'a> {
    /// Its bits as a number; 0 for bytes.
    pub(super) const fn number(self) -> u64 {
        match self {
            Self::Varint(number) | Self::Fixed64(number) => number,
            Self::Fixed32(number) => number as u64,
            Self::Bytes(_) => 0,
        }
    }

    /// Its bytes; none for a number.
    pub(super) const fn bytes(self) -> &'a [u8] {
        match self {
            Self::Bytes(bytes) => bytes,
            _ => &[],
        }
    }
}

/// A value and the number of its field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Record<'a> {
    pub(super) number: u32,
    pub(super) value: Raw<'a>,
}

/// The records of a message, in the order of its bytes.
pub(super) fn records(mut bytes: &[u8]) -> impl Iterator<Item = Record<'_>> {
    std::iter::from_fn(move || {
        if bytes.is_empty() {
            return None;
        }
        let key = varint(&mut bytes);
        let wire = match key & 7 {
            0 => Type::Varint,
            1 => Type::Fixed64,
            2 => Type::Bytes,
            5 => Type::Fixed32,
            // Groups, which no message of this syntax has.
            _ => return None,
        };
        Some(Record { number: (key >> 3) as u32, value: take(&mut bytes, wire) })
    })
}

/// The values of a list of numbers that are in one record.
pub(super) fn packed(mut bytes: &[u8], wire: Type) -> impl Iterator<Item = Raw<'_>> {
    std::iter::from_fn(move || (!bytes.is_empty()).then(|| take(&mut bytes, wire)))
}

/// A number whose sign is its lowest bit.
pub(super) const fn unfold(number: u64) -> i64 {
    (number >> 1) as i64 ^ -((number & 1) as i64)
}

fn take<'a>(bytes: &mut &'a [u8], wire: Type) -> Raw<'a> {
    match wire {
        Type::Varint => Raw::Varint(varint(bytes)),
        Type::Fixed64 => Raw::Fixed64(u64::from_le_bytes(array(bytes))),
        Type::Fixed32 => Raw::Fixed32(u32::from_le_bytes(array(bytes))),
        Type::Bytes => {
            let length = varint(bytes);
            Raw::Bytes(front(bytes, length as usize))
        }
    }
}

/// So many bytes from the front, or what is left.
fn front<'a>(bytes: &mut &'a [u8], length: usize) -> &'a [u8] {
    let (taken, rest) = bytes.split_at(length.min(bytes.len()));
    *bytes = rest;
    taken
}

fn array<const N: usize>(bytes: &mut &[u8]) -> [u8; N] {
    let mut array = [0; N];
    let taken = front(bytes, N);
    array[..taken.len()].copy_from_slice(taken);
    array
}

fn varint(bytes: &mut &[u8]) -> u64 {
    let mut value = 0;
    for shift in (0..u64::BITS).step_by(7) {
        let Some((&byte, rest)) = bytes.split_first() else { break };
        *bytes = rest;
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            break;
        }
    }
    value
}
