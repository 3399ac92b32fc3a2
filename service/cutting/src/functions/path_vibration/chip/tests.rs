use core::f64::consts::{PI, TAU};

use proptest::prelude::*;

use super::*;

/// The example of the source with another frequency: S1000, A0.03, F0.01 mm/rev, diameter 20 mm.
fn example(frequency_hz: f64) -> CutCondition {
    CutCondition {
        feed_per_rev_mm: 0.01,
        amplitude_mm: 0.03,
        frequency_hz,
        spindle_rev_per_min: 1_000.0,
        diameter_mm: 20.0,
        feed_coupling: FeedCoupling::PerRevolution,
    }
}

/// Vibrations per revolution `d` and amplitude ratio `q` at S1000 and f_r = 0.1 mm.
fn cut(d: f64, q: f64) -> CutCondition {
    CutCondition {
        feed_per_rev_mm: 0.1,
        amplitude_mm: 0.05 * q,
        frequency_hz: d * 1_000.0 / 60.0,
        spindle_rev_per_min: 1_000.0,
        diameter_mm: 50.0,
        feed_coupling: FeedCoupling::PerRevolution,
    }
}

/// Air share and largest thickness by letting the tool run: the surface is the furthest any revolution reached.
fn simulate(condition: &CutCondition, angles: u32, measured_revolutions: u32) -> (f64, f64) {
    let d = condition.vibrations_per_rev();
    let settle = 60;
    let mut surface_mm = vec![f64::NEG_INFINITY; angles as usize];
    let (mut air, mut largest_mm) = (0u64, f64::NEG_INFINITY);
    for revolution in 0..settle + measured_revolutions {
        for (index, surface) in surface_mm.iter_mut().enumerate() {
            let turns = f64::from(revolution) + index as f64 / f64::from(angles);
            let tool_mm = condition.feed_per_rev_mm * turns + condition.amplitude_mm * libm::sin(TAU * d * turns);
            if revolution >= settle {
                air += u64::from(tool_mm <= *surface);
                largest_mm = f64::max(largest_mm, tool_mm - *surface);
            }
            *surface = surface.max(tool_mm);
        }
    }
    (air as f64 / (f64::from(angles) * f64::from(measured_revolutions)), largest_mm)
}

#[test]
fn the_example_of_the_source_vibrates_in_phase_and_never_breaks() {
    let report = analyse(&example(50.0));
    assert_eq!(report.vibrations_per_rev, 3.0);
    assert_eq!(report.amplitude_ratio, 6.0);
    assert!(!report.broken);
    assert_eq!(report.air_share.to_bits(), 0, "no minus zero in reports");
    assert_eq!(report.largest_thickness_mm, 0.01);
    assert_eq!(report.min_amplitude_mm, None);
    assert_eq!((report.longest_chip_mm, report.mean_chip_mm, report.spindle_speed_margin), (None, None, None));
    for step in 0..100 {
        assert_eq!(thickness(&example(50.0), f64::from(step) * 0.1), 0.01, "h = f_r everywhere");
    }
    // asin(1/6)/π vibrations per revolution to either side; the half-integers cure it with margin.
    let edge = libm::asin(1.0 / 6.0) / PI;
    let Nearest { below: Some(below), above: Some(above) } = report.breaking_frequencies_hz else { panic!() };
    assert!((below - (3.0 - edge) * 1_000.0 / 60.0).abs() < 1e-12);
    assert!((above - (3.0 + edge) * 1_000.0 / 60.0).abs() < 1e-12);
    assert_eq!(report.recommended_frequencies_hz.len(), 2);
    assert!((report.recommended_frequencies_hz[0] - 125.0 / 3.0).abs() < 1e-12);
    assert!((report.recommended_frequencies_hz[1] - 175.0 / 3.0).abs() < 1e-12);
    assert!((report.recommended_spindle_rev_per_min[0] - 3_000.0 / 3.5).abs() < 1e-9);
    assert_eq!(report.recommended_spindle_rev_per_min[1], 1_200.0);
}

#[test]
fn half_integers_cut_the_example_through_with_large_margin() {
    for (frequency_hz, d) in [(125.0 / 3.0, 2.5), (175.0 / 3.0, 3.5)] {
        let report = analyse(&example(frequency_hz));
        assert!(report.broken);
        assert!((report.vibrations_per_rev - d).abs() < 1e-12);
        assert!((report.min_amplitude_mm.unwrap() - 0.005).abs() < 1e-15, "A ≥ f_r/2 suffices");
        assert!((report.breaks_per_rev - d).abs() < 1e-12);
        assert!((report.air_share_previous_revolution - libm::acos(1.0 / 6.0) / PI).abs() < 1e-12);
        // Older revolutions: two back is in phase, so the chip is never thicker than 2·f_r.
        assert!((report.largest_thickness_mm - 0.02).abs() < 1e-9);
        let (air, largest_mm) = simulate(&report.condition, 20_000, 4);
        assert!((report.air_share - air).abs() < 2e-4, "{} but the simulation has {air}", report.air_share);
        assert!((report.largest_thickness_mm - largest_mm).abs() < 1e-6);
        let chips_mm = report.mean_chip_mm.unwrap() * report.breaks_per_rev;
        assert!((chips_mm - (1.0 - report.air_share) * 20.0 * PI).abs() < 1e-9, "chips and air fill the revolution");
        let tolerance = report.spindle_speed_margin.unwrap();
        assert!(tolerance.minus_rev_per_min > 100.0 && tolerance.plus_rev_per_min.unwrap() > 100.0);
    }
}

#[test]
fn whole_vibrations_per_revolution_are_recognised_through_rounding() {
    // 60·16.7/1002 is one unit in the last place off 1.
    for (frequency_hz, spindle_rev_per_min) in [(16.7, 1_002.0), (0.1, 6.0), (70.0, 600.0), (333.3, 19_998.0)] {
        let condition = CutCondition { frequency_hz, spindle_rev_per_min, ..example(50.0) };
        let report = analyse(&condition);
        assert!(!report.broken);
        assert_eq!(report.min_amplitude_mm, None, "D = {}", report.vibrations_per_rev);
    }
}

#[test]
fn equality_counts_as_broken() {
    let report = analyse(&CutCondition { amplitude_mm: 0.005, ..example(125.0 / 3.0) });
    assert!(report.broken && report.air_share < 1e-6);
    assert!((report.breaks_per_rev - 2.5).abs() < 1e-12);
    assert!(!analyse(&CutCondition { amplitude_mm: 0.004_999, ..example(125.0 / 3.0) }).broken);
}

#[test]
fn slow_vibration_makes_chips_longer_than_a_revolution() {
    let report = analyse(&cut(0.5, 4.0));
    assert!(report.broken);
    assert!((report.breaks_per_rev - 0.5).abs() < 1e-12);
    assert!(report.longest_chip_mm.unwrap() > 50.0 * PI);
    assert_eq!(report.recommended_frequencies_hz.len(), 1, "it is a half-integer already");
    assert!((report.recommended_frequencies_hz[0] - 500.0 / 60.0).abs() < 1e-12);
    let slow = analyse(&cut(0.01, 4.0));
    assert!(!slow.broken && slow.breaking_frequencies_hz.below.is_none());
    assert_eq!(slow.recommended_frequencies_hz.len(), 1);
}

#[test]
fn an_amplitude_too_small_for_any_frequency_says_so() {
    let report = analyse(&cut(2.4, 0.9));
    assert!(!report.broken);
    assert_eq!(report.breaking_frequencies_hz, Nearest::default());
    assert_eq!(report.breaking_spindle_rev_per_min, Nearest::default());
    assert_eq!(report.recommended_frequencies_hz.len(), 2, "the best frequencies are known all the same");
    assert!(report.min_amplitude_mm.unwrap() > report.condition.amplitude_mm);
}

#[test]
fn absurd_ratios_are_quick_and_stay_in_range() {
    for d in [2.5, 3.0 + 1e-6, 3.0 + 1e-5, 1e-6, 0.618_033_988_749_895, 1e12 + 0.3, 1e300] {
        for q in [1e3, 1e6, 2e6, 1e300] {
            let report = analyse(&cut(d, q));
            assert!((0.0..=1.0).contains(&report.air_share), "D {d}, Q {q}");
            assert!(report.largest_thickness_mm > 0.0 && report.earlier_revolutions <= MAX_EARLIER_REVOLUTIONS);
        }
    }
    assert!(analyse(&cut(0.618_033_988_749_895, 1e6)).exact, "only revolutions that can be seen are counted");
}

#[test]
fn senseless_conditions_yield_an_unbroken_report() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let valid = example(125.0 / 3.0);
        for condition in [
            CutCondition { feed_per_rev_mm: bad, ..valid },
            CutCondition { amplitude_mm: bad, ..valid },
            CutCondition { frequency_hz: bad, ..valid },
            CutCondition { spindle_rev_per_min: bad, ..valid },
        ] {
            let report = analyse(&condition);
            assert!(!report.broken && !condition.breaks_chip());
            assert!(thickness(&condition, 1.0).is_nan());
        }
    }
    let overflowing = CutCondition { feed_per_rev_mm: 1e-308, amplitude_mm: 1e10, ..example(40.0) };
    assert!(!analyse(&overflowing).broken);
}

#[test]
fn feed_per_minute_bounds_the_speeds_on_both_sides() {
    // F = 100 mm/min: at lower speed the feed per revolution grows until the amplitude no longer reaches.
    let condition = CutCondition { feed_coupling: FeedCoupling::PerMinute, ..cut(1.5, 3.0) };
    let tolerance = analyse(&condition).spindle_speed_margin.unwrap();
    let at = |deviation: f64| {
        let spindle_rev_per_min = condition.spindle_rev_per_min + deviation;
        let feed_per_rev_mm = condition.feed_per_rev_mm * condition.spindle_rev_per_min / spindle_rev_per_min;
        CutCondition { spindle_rev_per_min, feed_per_rev_mm, ..condition }.breaks_chip()
    };
    let plus = tolerance.plus_rev_per_min.unwrap();
    assert!(at(plus - 1e-6) && !at(plus + 1e-6));
    assert!(at(1e-6 - tolerance.minus_rev_per_min) && !at(-tolerance.minus_rev_per_min - 1e-6));
    // In the first arch no higher speed does harm: both sides of the condition fall with D.
    let fast = CutCondition { feed_coupling: FeedCoupling::PerMinute, ..cut(0.3, 3.0) };
    assert_eq!(analyse(&fast).spindle_speed_margin.unwrap().plus_rev_per_min, None);
    // Beyond D = 2A/f_r·D no speed breaks the chip; the nearest that does is a higher one.
    let slow = CutCondition { feed_coupling: FeedCoupling::PerMinute, ..cut(40.5, 0.1) };
    let nearest = analyse(&slow).breaking_spindle_rev_per_min;
    assert!(nearest.below.is_none() && nearest.above.unwrap() > 1_000.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_analysis_agrees_with_the_simulated_surface(d in 0.3..6.0f64, q in 0.2..12.0f64) {
        let condition = cut(d, q);
        let report = analyse(&condition);
        let (air, largest_mm) = simulate(&condition, 600, 300);
        prop_assert!((report.air_share - air).abs() < 0.01, "{} but the simulation has {air}", report.air_share);
        prop_assert!(largest_mm <= report.largest_thickness_mm + 1e-9);
        prop_assert!(report.largest_thickness_mm - largest_mm < 0.02 * condition.feed_per_rev_mm * (1.0 + q));
        // A stretch of air narrower than the grid may slip through, the reverse may not.
        prop_assert!(report.broken || air == 0.0);
        prop_assert!(!report.broken || air > 0.0 || report.air_share < 0.01);
        prop_assert!(report.air_share >= report.air_share_previous_revolution - 1e-12);
        prop_assert!(report.exact);
    }

    #[test]
    fn the_thickness_never_exceeds_the_reported_largest_and_comes_close(d in 0.01..20.0f64, q in 0.1..60.0f64) {
        let condition = cut(d, q);
        let report = analyse(&condition);
        let sampled = (0..2_000).map(|i| thickness(&condition, TAU * f64::from(i) / 2_000.0));
        let largest_mm = sampled.fold(f64::NEG_INFINITY, f64::max);
        prop_assert!(largest_mm <= report.largest_thickness_mm + 1e-9);
        // Between two samples no sinusoid rises by more than half a step at its steepest.
        let step_mm = 2.0 * condition.amplitude_mm * TAU / 4_000.0;
        prop_assert!(report.largest_thickness_mm <= largest_mm + step_mm);
    }

    #[test]
    fn revolutions_left_out_never_matter(d in 0.01..20.0f64, q in 0.1..60.0f64, phase_rad in 0.0..TAU) {
        let condition = cut(d, q);
        let all = (1..=2_000u32).map(|r| {
            let r = f64::from(r);
            let half = PI * r * (d - d.round());
            0.1 * r + 2.0 * condition.amplitude_mm * libm::sin(half) * libm::cos(phase_rad - half)
        });
        let least_mm = all.fold(f64::INFINITY, f64::min);
        prop_assert!((thickness(&condition, phase_rad) - least_mm).abs() < 1e-9);
    }

    #[test]
    fn limits_lie_where_breaking_begins(d in 0.05..20.0f64, q in 0.5..20.0f64, per_minute: bool) {
        let feed_coupling = if per_minute { FeedCoupling::PerMinute } else { FeedCoupling::PerRevolution };
        let condition = CutCondition { feed_coupling, ..cut(d, q) };
        let report = analyse(&condition);
        let at_speed = |spindle_rev_per_min: f64| {
            let speed_ratio = condition.spindle_rev_per_min / spindle_rev_per_min;
            let feed_per_rev_mm = condition.feed_per_rev_mm * if per_minute { speed_ratio } else { 1.0 };
            CutCondition { spindle_rev_per_min, feed_per_rev_mm, ..condition }.breaks_chip()
        };
        let at_frequency = |frequency_hz: f64| CutCondition { frequency_hz, ..condition }.breaks_chip();
        if let Some(amplitude_mm) = report.min_amplitude_mm {
            let breaks = |amplitude_mm: f64| CutCondition { amplitude_mm, ..condition }.breaks_chip();
            prop_assert!(breaks(amplitude_mm) && !breaks(amplitude_mm * (1.0 - 1e-9)));
        }
        let outward = 1e-7;
        for (value, sign) in [(report.breaking_frequencies_hz.below, -1.0), (report.breaking_frequencies_hz.above, 1.0)] {
            let Some(hz) = value else { continue };
            prop_assert!(at_frequency(hz * (1.0 + sign * outward)) && !at_frequency(hz * (1.0 - sign * outward)));
        }
        let speeds = report.breaking_spindle_rev_per_min;
        for (value, sign) in [(speeds.below, -1.0), (speeds.above, 1.0)] {
            let Some(speed) = value else { continue };
            prop_assert!(at_speed(speed * (1.0 + sign * outward)) && !at_speed(speed * (1.0 - sign * outward)));
        }
        if let Some(tolerance) = report.spindle_speed_margin {
            let low = condition.spindle_rev_per_min - tolerance.minus_rev_per_min;
            prop_assert!(low <= 0.0 || at_speed(low * (1.0 + 1e-9)) && !at_speed(low * (1.0 - 1e-6)));
            if let Some(plus) = tolerance.plus_rev_per_min {
                let high = condition.spindle_rev_per_min + plus;
                prop_assert!(at_speed(high * (1.0 - 1e-9)) && !at_speed(high * (1.0 + 1e-6)));
            }
        }
    }
}

/// Share of a span that breaks, by sampling the closed condition.
fn sampled_broken_share(span: &LinearSpan, samples: u32) -> f64 {
    let broken = (0..samples).filter(|&i| {
        let share = (f64::from(i) + 0.5) / f64::from(samples);
        let radius_mm = (span.start_radius_mm + (span.end_radius_mm - span.start_radius_mm) * share).abs();
        let spindle_rev_per_min =
            (span.surface_speed_m_per_min * 1_000.0 / (TAU * radius_mm)).min(span.max_rev_per_min);
        let feed_per_rev_mm = match span.feed {
            SpanFeed::PerRevolution(mm) => mm,
            SpanFeed::PerMinute(mm) => mm / spindle_rev_per_min,
        };
        CutCondition {
            feed_per_rev_mm,
            amplitude_mm: span.amplitude_mm,
            frequency_hz: span.frequency_hz,
            spindle_rev_per_min,
            diameter_mm: 0.0,
            feed_coupling: FeedCoupling::PerRevolution,
        }
        .breaks_chip()
    });
    broken.count() as f64 / f64::from(samples)
}

fn facing() -> LinearSpan {
    LinearSpan {
        line: 7,
        start_mm: 0.0,
        length_mm: 39.0,
        start_radius_mm: 40.0,
        end_radius_mm: 1.0,
        frequency_hz: 60.0,
        amplitude_mm: 0.04,
        feed: SpanFeed::PerRevolution(0.05),
        surface_speed_m_per_min: 150.0,
        max_rev_per_min: 3_000.0,
    }
}

#[test]
fn facing_at_constant_surface_speed_lists_the_spans_that_do_not_break() {
    let span = facing();
    let mut analysis = SurfaceSpeedAnalysis::default();
    analysis.add(&span);
    let report = analysis.finish().unwrap();
    assert!((report.broken_share - sampled_broken_share(&span, 100_000)).abs() < 1e-4);
    let unbroken_mm: f64 = report.unbroken_spans.iter().map(|span| span.end_mm - span.start_mm).sum();
    assert!((unbroken_mm - 39.0 * (1.0 - report.broken_share)).abs() < 1e-9);
    for part in &report.unbroken_spans {
        // Every span is around one integer D, and the last is the part where the clamp holds or D stays below it.
        assert!(part.end_vibrations_per_rev <= part.start_vibrations_per_rev);
        assert!(part.start_vibrations_per_rev - part.end_vibrations_per_rev < 1.0);
        assert!(part.end_diameter_mm < part.start_diameter_mm);
    }
    assert_eq!(report.unbroken_spans_not_listed, 0);
}

#[test]
fn spans_continue_across_elements_and_long_lists_are_counted() {
    let whole = facing();
    let mut once = SurfaceSpeedAnalysis::default();
    once.add(&whole);
    let mut pieces = SurfaceSpeedAnalysis::default();
    for i in 0..13u32 {
        let at = |i: u32| 39.0 * f64::from(i) / 13.0;
        pieces.add(&LinearSpan {
            start_mm: at(i),
            length_mm: 3.0,
            start_radius_mm: 40.0 - at(i),
            end_radius_mm: 40.0 - at(i + 1),
            ..whole
        });
    }
    let (once, pieces) = (once.finish().unwrap(), pieces.finish().unwrap());
    assert_eq!(once.unbroken_spans.len(), pieces.unbroken_spans.len());
    assert!((once.broken_share - pieces.broken_share).abs() < 1e-9);

    let mut many = SurfaceSpeedAnalysis::default();
    many.add(&LinearSpan { frequency_hz: 500.0, start_radius_mm: 400.0, max_rev_per_min: f64::INFINITY, ..whole });
    let many = many.finish().unwrap();
    assert_eq!(many.unbroken_spans.len(), 64);
    assert!(many.unbroken_spans_not_listed > 0);
}

#[test]
fn nothing_at_constant_surface_speed_means_no_report() {
    assert_eq!(SurfaceSpeedAnalysis::default().finish(), None);
    let mut analysis = SurfaceSpeedAnalysis::default();
    analysis.add(&LinearSpan { surface_speed_m_per_min: 0.0, ..facing() });
    analysis.add(&LinearSpan { length_mm: 0.0, ..facing() });
    assert_eq!(analysis.finish(), None);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn surface_speed_shares_agree_with_sampling(
        start_radius_mm in -20.0..60.0f64,
        end_radius_mm in -20.0..60.0f64,
        feed in 0.01..0.3f64,
        per_minute: bool,
        clamped: bool,
        frequency_hz in 10.0..200.0f64,
    ) {
        let span = LinearSpan {
            start_radius_mm,
            end_radius_mm,
            frequency_hz,
            feed: if per_minute { SpanFeed::PerMinute(feed * 1_000.0) } else { SpanFeed::PerRevolution(feed) },
            max_rev_per_min: if clamped { 2_500.0 } else { f64::INFINITY },
            ..facing()
        };
        let mut analysis = SurfaceSpeedAnalysis::default();
        analysis.add(&span);
        let report = analysis.finish().unwrap();
        prop_assert!((report.broken_share - sampled_broken_share(&span, 20_000)).abs() < 0.01);
    }

    #[test]
    fn creeping_spindles_are_judged_quickly(surface_speed_m_per_min in 1e-6..1e-3f64) {
        let mut analysis = SurfaceSpeedAnalysis::default();
        analysis.add(&LinearSpan { surface_speed_m_per_min, ..facing() });
        let report = analysis.finish().unwrap();
        prop_assert!((0.0..=1.0).contains(&report.broken_share));
        prop_assert!(report.unbroken_spans.len() <= 64);
    }
}
