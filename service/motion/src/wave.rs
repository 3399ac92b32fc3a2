//! The wave of vibrations, arcs and oscillations: sin(2π·turns), fast enough for the hot loop and the same on every
//! platform.
//!
//! Working in turns instead of radians makes the reduction exact: whole and half turns give exactly 0, quarter
//! turns exactly ±1, and a phase does not lose precision to a rounded 2π however long the section lasts.

use core::f64::consts::TAU;

/// Adding and subtracting this rounds to the nearest integer (ties to even) for |x| ≤ 2⁵¹: above 2⁵² the spacing
/// of doubles is 1. Unlike a call to `round` it vectorises on every target.
const ROUNDING: f64 = 6_755_399_441_055_744.0; // 1.5 · 2⁵²

/// sin(2π·`turns`).
///
/// Exactly 0 at multiples of half a turn, exactly ±1 at odd multiples of a quarter turn, odd, never outside
/// [−1, 1]; elsewhere within 2 units in the last place of the true value of the reduced argument. Meaningful for
/// |`turns`| ≤ 2⁵⁰ (70 000 years at 500 Hz); NaN for NaN and infinities.
#[inline]
#[must_use]
pub fn sin_turns(turns: f64) -> f64 {
    let nearest = (turns + ROUNDING) - ROUNDING;
    let reduced = turns - nearest;
    // Both folds are exact (Sterbenz): the first onto [0, ¼] turn, the second onto [0, ⅛] from either end.
    let magnitude = reduced.abs();
    let quarter = magnitude.min(0.5 - magnitude);
    // Both series are evaluated and one is selected: without a branch the loop over a column vectorises.
    let rising = sin_kernel(quarter * TAU);
    let near_peak = cos_kernel((0.25 - quarter) * TAU);
    let value = if quarter <= 0.125 { rising } else { near_peak };
    value.copysign(reduced)
}

/// sin(2π·`turns`) and cos(2π·`turns`) for little more than one of them. The sine is [`sin_turns`] to the bit, the cosine as
/// exact: the same two series, exchanged.
#[inline]
#[must_use]
pub fn sincos_turns(turns: f64) -> (f64, f64) {
    let nearest = (turns + ROUNDING) - ROUNDING;
    let reduced = turns - nearest;
    let magnitude = reduced.abs();
    let quarter = magnitude.min(0.5 - magnitude);
    let eighth = quarter.min(0.25 - quarter) * TAU;
    let (small, large) = (sin_kernel(eighth), cos_kernel(eighth));
    let (sin, cos) = if quarter <= 0.125 { (small, large) } else { (large, small) };
    // The cosine is negative beyond a quarter turn to either side.
    (sin.copysign(reduced), cos.copysign(0.25 - magnitude))
}

/// [`sin_turns`] of every element of `turns` into the same place of `waves`.
///
/// # Panics
/// When the lengths differ: the caller's columns are out of step.
pub fn fill_sin_turns(turns: &[f64], waves: &mut [f64]) {
    assert_eq!(turns.len(), waves.len(), "one phase for each wave value");
    for (wave, &phase) in waves.iter_mut().zip(turns) {
        *wave = sin_turns(phase);
    }
}

/// Taylor series of sin on [0, π/4]: the first term left out is below 1e-19 of the value.
#[inline]
fn sin_kernel(z: f64) -> f64 {
    let s = z * z;
    let tail = -1.0 / 1_307_674_368_000.0 + s * (1.0 / 355_687_428_096_000.0);
    let tail = 1.0 / 6_227_020_800.0 + s * tail;
    let tail = -1.0 / 39_916_800.0 + s * tail;
    let tail = 1.0 / 362_880.0 + s * tail;
    let tail = -1.0 / 5_040.0 + s * tail;
    let tail = 1.0 / 120.0 + s * tail;
    let tail = -1.0 / 6.0 + s * tail;
    z + z * (s * tail)
}

/// Taylor series of cos on [0, π/4]: the first term left out is below 3e-18.
#[inline]
fn cos_kernel(z: f64) -> f64 {
    let s = z * z;
    let tail = -1.0 / 87_178_291_200.0 + s * (1.0 / 20_922_789_888_000.0);
    let tail = 1.0 / 479_001_600.0 + s * tail;
    let tail = -1.0 / 3_628_800.0 + s * tail;
    let tail = 1.0 / 40_320.0 + s * tail;
    let tail = -1.0 / 720.0 + s * tail;
    let tail = 1.0 / 24.0 + s * tail;
    1.0 - (0.5 * s - s * (s * tail))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn whole_half_and_quarter_turns_are_exact() {
        for whole in [-1_000_000.0, -7.0, -1.0, 0.0, 1.0, 2.0, 3.0, 123_456_789.0] {
            assert_eq!(sin_turns(whole), 0.0);
            assert_eq!(sin_turns(whole + 0.5), 0.0);
            assert_eq!(sin_turns(whole + 0.25), 1.0);
            assert_eq!(sin_turns(whole + 0.75), -1.0);
        }
    }

    #[test]
    fn sine_and_cosine_are_those_of_the_single_functions() {
        for i in -4_000..=4_000 {
            let turns = f64::from(i) / 1_600.0;
            let (sin, cos) = sincos_turns(turns);
            assert_eq!(sin.to_bits(), sin_turns(turns).to_bits(), "{turns}");
            assert!((cos - libm::cos(TAU * (turns - turns.round()))).abs() < 4.0 * f64::EPSILON, "{turns}");
        }
        assert_eq!([0.0, 0.25, 0.5, -0.25].map(|turns| sincos_turns(turns).1.abs()), [1.0, 0.0, 1.0, 0.0]);
        assert_eq!((sincos_turns(0.5).1, sincos_turns(-0.5).1, sincos_turns(7.0).1), (-1.0, -1.0, 1.0));
        assert!(sincos_turns(f64::NAN).1.is_nan());
    }

    #[test]
    fn not_a_number_stays_one_and_huge_phases_stay_in_range() {
        assert!(sin_turns(f64::NAN).is_nan());
        assert!(sin_turns(f64::INFINITY).is_nan());
        for turns in [1e15, -1e15 + 0.125] {
            assert!(sin_turns(turns).abs() <= 1.0);
        }
    }

    #[test]
    fn slices_equal_single_values_to_the_bit() {
        let turns: Vec<f64> = (0..1_000).map(|i| f64::from(i) * 0.05 - 3.0).collect();
        let mut waves = vec![0.0; turns.len()];
        fill_sin_turns(&turns, &mut waves);
        for (&phase, &wave) in turns.iter().zip(&waves) {
            assert_eq!(wave.to_bits(), sin_turns(phase).to_bits());
        }
    }

    #[test]
    fn dense_scan_stays_within_two_units_in_the_last_place_of_the_reference() {
        let count = 200_000;
        for i in 0..=count {
            let turns = f64::from(i) / f64::from(count) * 0.5;
            // Reference on the half turn folded likewise, so that 2π·turns is rounded where sin is steep only.
            let folded = turns.min(0.5 - turns);
            let reference = libm::sin(folded * TAU);
            let ulp = f64::EPSILON * reference.max(f64::MIN_POSITIVE);
            let error = (sin_turns(turns) - reference).abs();
            assert!(error <= 2.0 * ulp, "sin_turns({turns}) is {error:e} off");
        }
    }

    proptest! {
        #[test]
        fn odd_periodic_and_close_to_libm(turns in -1_000.0..1_000.0f64) {
            prop_assert_eq!(sin_turns(-turns).to_bits(), (-sin_turns(turns)).to_bits());
            // The shift rounds `turns` to the precision of the larger sum, at most 2⁻⁴³ turns.
            prop_assert!((sin_turns(turns + 1_024.0) - sin_turns(turns)).abs() < 1e-12);
            let reduced = turns - turns.round();
            prop_assert!((sin_turns(turns) - libm::sin(TAU * reduced)).abs() < 4.0 * f64::EPSILON);
        }
    }
}
