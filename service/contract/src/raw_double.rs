//! Raw doubles: the encoding of a column as the bytes of its values, which a client takes over without a copy
//! (`numpy.frombuffer`, a typed array). IEEE 754 binary64, little-endian.

/// Bytes of a value.
const VALUE_BYTES: usize = size_of::<f64>();

/// Appends the bytes of `values` to `bytes`.
pub fn encode(values: &[f64], bytes: &mut Vec<u8>) {
    let first = bytes.len();
    bytes.resize(first + VALUE_BYTES * values.len(), 0);
    for (into, value) in bytes[first..].as_chunks_mut::<VALUE_BYTES>().0.iter_mut().zip(values) {
        *into = value.to_le_bytes();
    }
}

/// The values of one column of one chunk; `None` for bytes that are not whole values.
#[must_use]
pub fn decode(bytes: &[u8]) -> Option<Vec<f64>> {
    let (values, rest) = bytes.as_chunks::<VALUE_BYTES>();
    rest.is_empty().then(|| values.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_little_endian_and_come_back_to_the_bit() {
        let values = [1.0, -0.0, f64::NEG_INFINITY, 0.1 + 0.2, f64::MIN_POSITIVE / 2.0];
        let mut bytes = vec![7];
        encode(&values, &mut bytes);
        assert_eq!(bytes[..9], [7, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f]);
        let back: Vec<u64> = decode(&bytes[1..]).unwrap().into_iter().map(f64::to_bits).collect();
        assert_eq!(back, values.map(f64::to_bits));
        assert_eq!(decode(&bytes), None);
        assert_eq!(decode(&[]), Some(Vec::new()));
    }
}
