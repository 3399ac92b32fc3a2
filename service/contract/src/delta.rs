//! Fixed-point deltas: the compact encoding of a column. Every value is rounded to whole steps of the column's
//! resolution; the first value is sent as it is, every further one as the difference from the one before.
//!
//! Invariants: a finite value comes back within half a step; −∞ and +∞ come back exactly.

/// Steps that represent −∞ and +∞.
const NEGATIVE_INFINITY: i64 = i64::MIN;
const POSITIVE_INFINITY: i64 = i64::MAX;

/// Rounds `values` to steps of 1/`steps_per_unit` and appends their differences to `deltas`.
///
/// `last` is the steps of the value before, 0 before the first one of a chunk; returns the steps of the last value.
/// Values beyond the range of 64 bits (9 million kilometres at a nanometre) become infinite.
pub fn encode(values: &[f64], steps_per_unit: f64, mut last: i64, deltas: &mut Vec<i64>) -> i64 {
    deltas.extend(values.iter().map(|value| {
        // The cast saturates: infinities become the extreme values.
        let steps = (value * steps_per_unit).round() as i64;
        let delta = steps.wrapping_sub(last);
        last = steps;
        delta
    }));
    last
}

/// The values of one column of one chunk. `resolution` is the column's, as the stream's header states it.
#[must_use]
pub fn decode(deltas: &[i64], resolution: f64) -> Vec<f64> {
    // 1e-6 is not a double but its reciprocal is: dividing gives the double nearest to the decimal value.
    let steps_per_unit = (1.0 / resolution).round();
    let mut steps = 0_i64;
    deltas
        .iter()
        .map(|delta| {
            steps = steps.wrapping_add(*delta);
            match steps {
                NEGATIVE_INFINITY => f64::NEG_INFINITY,
                POSITIVE_INFINITY => f64::INFINITY,
                steps => steps as f64 / steps_per_unit,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn round_trip(values: &[f64]) -> Vec<f64> {
        let mut deltas = Vec::new();
        encode(values, 1e6, 0, &mut deltas);
        decode(&deltas, 1e-6)
    }

    #[test]
    fn decimal_values_come_back_exactly_and_infinities_too() {
        let values = [0.0, 10.0, -0.000_001, 123.456_789, f64::INFINITY, 1.5, f64::NEG_INFINITY, f64::INFINITY];
        assert_eq!(round_trip(&values), values);
    }

    #[test]
    fn a_column_encoded_in_pieces_is_the_column_encoded_at_once() {
        let values = [1.0, 2.5, 2.5, -7.0];
        let mut whole = Vec::new();
        encode(&values, 1e6, 0, &mut whole);
        let mut pieces = Vec::new();
        let last = encode(&values[..1], 1e6, 0, &mut pieces);
        encode(&values[1..], 1e6, last, &mut pieces);
        assert_eq!(whole, pieces);
        assert_eq!(whole, [1_000_000, 1_500_000, 0, -9_500_000]);
    }

    proptest! {
        #[test]
        fn values_come_back_within_half_a_step(values in prop::collection::vec(-1e6..1e6f64, 0..200)) {
            for (value, decoded) in values.iter().zip(round_trip(&values)) {
                // Beside the rounding to a step, the product and the quotient each round once.
                let rounding = 2.0 * f64::EPSILON * value.abs();
                prop_assert!((value - decoded).abs() <= 0.5e-6 + rounding, "{value} came back as {decoded}");
            }
        }
    }
}
