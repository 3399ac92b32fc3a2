use core::cell::Cell;

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

use super::*;
use crate::{CutCondition, FeedCoupling};

const FREE: PathMotion = PathMotion { velocity: 1e9, acceleration: 1e12, jerk: 1e15 };

fn search(cuts: &[(f64, f64)]) -> VibrationSearch {
    let cut = |&(feed_per_rev_mm, spindle_rev_per_min): &(f64, f64)| SearchCut { feed_per_rev_mm, spindle_rev_per_min };
    VibrationSearch {
        cuts: cuts.iter().map(cut).collect(),
        feed_per_minute: false,
        speed_tolerance: 0.0,
        feed_ratio: 1.0,
        margin: 1.0,
        frequency_hz: [38.0, 62.0],
        preferred_hz: 50.0,
        max_amplitude_mm: 1.0,
        peaks: FREE,
        blend: None,
    }
}

#[test]
fn the_trap_of_the_source_is_left_at_half_a_vibration() {
    // S1000, F50: D = 3. At D = 2.5 and 3.5 half the feed is enough; the search prefers the nearer, and the lower of both.
    let found = search(&[(0.01, 1_000.0)]).solve().unwrap();
    assert!((found.amplitude_mm - 0.005).abs() < 1e-12, "{found:?}");
    assert!((found.frequency_hz - 41.666_667).abs() < 1e-4 || (found.frequency_hz - 58.333_333).abs() < 1e-4);
    // With a tolerance of the speed the lower one is the less sensitive.
    let tolerant =
        VibrationSearch { speed_tolerance: 0.02, margin: 1.1, feed_ratio: 1.2, ..search(&[(0.01, 1_000.0)]) };
    let found = tolerant.solve().unwrap();
    // f·60/1020 and f·60/980 are as far from 2.5: f = 2.5·2/(60/1020 + 60/980), and both miss it by 0.05.
    assert!((found.frequency_hz - 41.65).abs() < 1e-6, "{found:?}");
    let expected_mm = 1.1 * 0.012 / (2.0 * (core::f64::consts::PI * 0.05).cos());
    assert!((found.amplitude_mm - expected_mm).abs() < 1e-9, "{found:?} {expected_mm}");
}

#[test]
fn axes_that_cannot_follow_lower_the_frequency_to_what_they_can() {
    // At the best frequency 41.667 Hz the amplitude of 0.005 mm needs 2π·41.667·0.005 = 1.309 mm/s.
    let slow = VibrationSearch {
        peaks: PathMotion { velocity: 1.3, ..FREE },
        frequency_hz: [34.0, 49.0],
        ..search(&[(0.01, 1_000.0)])
    };
    let found = slow.solve().unwrap();
    assert!((41.0..41.5).contains(&found.frequency_hz), "{found:?}");
    let velocity = TAU * found.frequency_hz * found.amplitude_mm;
    assert!((velocity - 1.3).abs() < 1e-9, "as fast as it may be: {velocity}");
    let slower = VibrationSearch { peaks: PathMotion { velocity: 1.29, ..FREE }, ..slow };
    assert_eq!(slower.solve(), None);
}

#[test]
fn what_cannot_be_is_none() {
    // One speed has a whole number wherever the other has half of one more.
    assert_eq!(VibrationSearch { margin: 1.0, speed_tolerance: 0.3, ..search(&[(0.01, 1_000.0)]) }.solve(), None);
    assert_eq!(VibrationSearch { max_amplitude_mm: 0.004, ..search(&[(0.01, 1_000.0)]) }.solve(), None);
    assert_eq!(search(&[]).solve(), None);
    for broken in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        assert_eq!(VibrationSearch { frequency_hz: [broken, 50.0], ..search(&[(0.01, 1_000.0)]) }.solve(), None);
        assert_eq!(VibrationSearch { margin: broken, ..search(&[(0.01, 1_000.0)]) }.solve(), None);
    }
    // More cells than are looked at.
    let many: Vec<_> = (0..5_000).map(|step| (0.01, 0.5 + f64::from(step) * 1e-3)).collect();
    assert_eq!(VibrationSearch { frequency_hz: [1.0, 500.0], ..search(&many) }.solve(), None);
}

fn any_search() -> impl Strategy<Value = VibrationSearch> {
    let cuts = proptest::collection::vec((0.005_f64..0.4, 200.0_f64..4_000.0), 1..4);
    let peaks = (2.0_f64..400.0, 500.0_f64..50_000.0, 5e5_f64..5e7);
    let blend = proptest::option::of((0.05_f64..4.0, 1.0_f64..1.5, prop_oneof![Just(0.0), 0.0_f64..0.04]));
    (
        cuts,
        (any::<bool>(), blend),
        0.0_f64..0.04,
        1.0_f64..1.6,
        1.0_f64..1.5,
        5.0_f64..150.0,
        1.0_f64..3.0,
        0.05_f64..1.0,
        peaks,
    )
        .prop_map(
            |(cuts, (feed_per_minute, blend), speed_tolerance, feed_ratio, margin, low_hz, width, max_mm, peaks)| {
                VibrationSearch {
                    feed_per_minute,
                    speed_tolerance,
                    feed_ratio,
                    margin,
                    frequency_hz: [low_hz, low_hz * width],
                    preferred_hz: low_hz,
                    max_amplitude_mm: max_mm,
                    peaks: PathMotion { velocity: peaks.0, acceleration: peaks.1, jerk: peaks.2 },
                    blend: blend.map(|(least_feed_mm_per_s, ratio, following_rate)| SearchBlend {
                        least_feed_mm_per_s,
                        top_feed_mm_per_s: ratio * least_feed_mm_per_s,
                        following_rate,
                    }),
                    ..search(&cuts)
                }
            },
        )
}

/// The least amplitude at a frequency by its definition: every cut at many speeds of its range, judged as validation judges it.
fn by_definition(search: &VibrationSearch, frequency_hz: f64) -> f64 {
    let mut needed_mm: f64 = 0.0;
    for cut in &search.cuts {
        for step in -20..=20 {
            let share = 1.0 + search.speed_tolerance * f64::from(step) / 20.0;
            let rev_per_min = cut.spindle_rev_per_min * share;
            let condition = CutCondition {
                feed_per_rev_mm: cut.feed_per_rev_mm * search.feed_ratio
                    / if search.feed_per_minute { share } else { 1.0 },
                amplitude_mm: 1.0,
                frequency_hz,
                spindle_rev_per_min: rev_per_min,
                diameter_mm: 0.0,
                feed_coupling: FeedCoupling::PerRevolution,
            };
            needed_mm = needed_mm.max(search.margin / condition.breaking_margin());
        }
    }
    needed_mm
}

/// Whether the peaks of a vibration with its blend are within the limits, by their definition.
fn is_followed(search: &VibrationSearch, frequency_hz: f64, amplitude_mm: f64) -> bool {
    let rad_per_s = TAU * frequency_hz;
    let growth = search.blend.map_or([1.0; 3], |blend| {
        let ramp_mm = (1.2 * amplitude_mm).max(2.0 * blend.least_feed_mm_per_s / frequency_hz);
        let r = blend.top_feed_mm_per_s / (rad_per_s * ramp_mm) + blend.following_rate;
        let [b1, b2, b3] = [1.875, 5.774, 60.0];
        [
            (b1 * r).hypot(1.0),
            (1.0 + b2 * r * r).hypot(2.0 * b1 * r),
            (1.0 + 3.0 * b2 * r * r).hypot(3.0 * b1 * r + b3 * r * r * r),
        ]
    });
    let PathMotion { velocity, acceleration, jerk } = search.peaks;
    let limits = [velocity, acceleration, jerk].into_iter().zip(growth).zip(1..);
    amplitude_mm <= search.max_amplitude_mm * (1.0 + 1e-9)
        && limits
            .into_iter()
            .all(|((limit, growth), power)| amplitude_mm * rad_per_s.powi(power) * growth <= limit * (1.0 + 1e-9))
}

#[test]
fn the_largest_amplitude_is_what_the_blends_let_the_axes_follow() {
    let mut runner = TestRunner::new(Config { cases: 500, ..Config::default() });
    runner
        .run(&(any_search(), 0.0_f64..1.0), |(search, place)| {
            let [low_hz, high_hz] = search.frequency_hz;
            let frequency_hz = low_hz + place * (high_hz - low_hz);
            let largest_mm = search.largest_amplitude_mm(frequency_hz);
            prop_assert!(is_followed(&search, frequency_hz, largest_mm), "{} mm", largest_mm);
            prop_assert!(!is_followed(&search, frequency_hz, largest_mm * (1.0 + 1e-6)), "{} mm", largest_mm);
            Ok(())
        })
        .unwrap();
}

#[test]
fn nothing_better_is_found_by_trying_every_frequency() {
    let mut runner = TestRunner::new(Config { cases: 1_000, ..Config::default() });
    let solved = Cell::new(0);
    runner
        .run(&any_search(), |search| {
            let found = search.solve();
            let [low_hz, high_hz] = search.frequency_hz;
            let mut least_mm = f64::INFINITY;
            for step in 0..=20_000 {
                let frequency_hz = low_hz + (high_hz - low_hz) * f64::from(step) / 20_000.0;
                let Some(needed_mm) = search.least_amplitude_mm(frequency_hz) else { continue };
                if needed_mm < least_mm && needed_mm <= search.largest_amplitude_mm(frequency_hz) {
                    // The closed form is what the definition says.
                    let defined_mm = by_definition(&search, frequency_hz);
                    prop_assert!((needed_mm / defined_mm - 1.0).abs() < 1e-9, "{} and {}", needed_mm, defined_mm);
                    least_mm = needed_mm;
                }
            }
            match found {
                Some(found) => {
                    solved.set(solved.get() + 1);
                    prop_assert!(found.amplitude_mm <= least_mm * (1.0 + 1e-3), "{:?} and {}", found, least_mm);
                    prop_assert!((low_hz..=high_hz).contains(&found.frequency_hz));
                    let largest_mm = search.largest_amplitude_mm(found.frequency_hz);
                    prop_assert!(found.amplitude_mm <= largest_mm * (1.0 + 1e-9), "{:?}", found);
                    let defined_mm = by_definition(&search, found.frequency_hz);
                    prop_assert!((found.amplitude_mm / defined_mm - 1.0).abs() < 1e-9);
                }
                None => prop_assert!(least_mm.is_infinite(), "{} was found by trying", least_mm),
            }
            Ok(())
        })
        .unwrap();
    assert!(solved.get() >= 150, "{} of 1000 have a solution", solved.get());
}
