use proptest::prelude::*;

use super::*;

fn cut(frequency_hz: f64, feed_coupling: FeedCoupling) -> CutCondition {
    CutCondition {
        feed_per_rev_mm: 0.01,
        amplitude_mm: 0.03,
        frequency_hz,
        spindle_rev_per_min: 1_000.0,
        diameter_mm: 0.0,
        feed_coupling,
    }
}

#[test]
fn a_whole_number_within_the_tolerance_is_the_worst_case() {
    let sure = cut(125.0 / 3.0, FeedCoupling::PerRevolution);
    let exact = chip_robustness(&sure, &CutTolerances::default());
    assert!((exact.margin - 6.0).abs() < 1e-9 && (exact.worst_margin - 6.0).abs() < 1e-9 && exact.share == 1.0);
    assert!((exact.largest_feed_per_rev_mm - 0.06).abs() < 1e-12);
    let within = chip_robustness(&sure, &CutTolerances { speed: 0.02, feed: 0.2, amplitude: 0.1 });
    // D = 2.5/0.98 is the farthest from a half: 6·cos(π·0.0510)·0.9/1.2.
    let expected = 6.0 * (core::f64::consts::PI * (2.5 / 0.98 - 2.5)).cos() * 0.9 / 1.2;
    assert!((within.worst_margin - expected).abs() < 1e-9 && within.share == 1.0, "{within:?}");
    let trap = chip_robustness(
        &cut(50.0, FeedCoupling::PerRevolution),
        &CutTolerances { speed: 0.02, ..CutTolerances::default() },
    );
    assert_eq!((trap.worst_margin, trap.margin), (0.0, 0.0));
    // |sin πD| ≥ 1/6 from D = 3 ± 0.0533 on: of the speeds from 980 to 1020 those outside of 982.5 to 1018.1.
    let broken = (1_020.0 - 3_000.0 / (3.0 - 0.053_3) + 3_000.0 / (3.0 + 0.053_3) - 980.0) / 40.0;
    assert!((trap.share - broken).abs() < 1e-3, "{} {broken}", trap.share);
}

#[test]
fn what_is_impossible_breaks_nothing() {
    for tolerances in [
        CutTolerances { speed: 1.0, ..CutTolerances::default() },
        CutTolerances { feed: -0.1, ..CutTolerances::default() },
        CutTolerances { amplitude: f64::NAN, ..CutTolerances::default() },
    ] {
        assert_eq!(chip_robustness(&cut(40.0, FeedCoupling::PerMinute), &tolerances).share, 0.0);
    }
    assert_eq!(chip_robustness(&cut(f64::NAN, FeedCoupling::PerMinute), &CutTolerances::default()).share, 0.0);
}

proptest! {
    #[test]
    fn worst_case_and_share_are_those_of_a_dense_sample(
        frequency_hz in 10.0_f64..90.0,
        amplitude_mm in 0.004_f64..0.03,
        tolerances in (0.0_f64..0.1, 0.0_f64..0.3, 0.0_f64..0.3),
        per_minute in any::<bool>(),
    ) {
        let coupling = if per_minute { FeedCoupling::PerMinute } else { FeedCoupling::PerRevolution };
        let cut = CutCondition { amplitude_mm, ..cut(frequency_hz, coupling) };
        let (speed, feed, amplitude) = tolerances;
        let found = chip_robustness(&cut, &CutTolerances { speed, feed, amplitude });
        let (mut broken, mut least, mut all) = (0_u32, f64::INFINITY, 0_u32);
        let steps = 60;
        let place = |step: i32, tolerance: f64| 1.0 + tolerance * f64::from(step) / f64::from(steps);
        for s in (-steps..=steps).map(|step| place(step, speed)) {
            for f in (-steps..=steps).step_by(4).map(|step| place(step, feed)) {
                for a in (-steps..=steps).step_by(4).map(|step| place(step, amplitude)) {
                    let rev_per_min = cut.spindle_rev_per_min * s;
                    let sample = CutCondition {
                        feed_per_rev_mm: cut.feed_per_rev_mm * f / if per_minute { s } else { 1.0 },
                        amplitude_mm: cut.amplitude_mm * a,
                        spindle_rev_per_min: rev_per_min,
                        ..cut
                    };
                    let margin = sample.breaking_margin();
                    least = least.min(margin);
                    broken += u32::from(margin >= 1.0);
                    all += 1;
                }
            }
        }
        prop_assert!(found.worst_margin <= least + 1e-9, "{:?} {}", found, least);
        // The corners are among the samples.
        prop_assert!(found.worst_margin == 0.0 || (found.worst_margin - least).abs() < 1e-9, "{:?} {}", found, least);
        let sampled = f64::from(broken) / f64::from(all);
        prop_assert!((found.share - sampled).abs() < 0.12, "{:?} {}", found, sampled);
        prop_assert_eq!(found.worst_margin >= 1.0 && found.share < 1.0 - 1e-9, false);
    }
}
