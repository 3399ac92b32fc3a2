use core::f64::consts::PI;

use proptest::prelude::*;

use super::*;

const CONDITION: VibrationCondition = VibrationCondition { frequency_hz: 125.0 / 3.0, amplitude_mm: 0.0055 };

fn course(up_to: Option<f64>, max_feed_override: f64) -> ChipCourse {
    let settings = VibrationSettings { amplitude_follows_feed_up_to: up_to, ..VibrationSettings::default() };
    ChipCourse::new(CONDITION, &settings).with_overrides(max_feed_override, true)
}

/// 10 mm at 1000 rev/min: D = 2.5, a margin of 1.1.
fn block(start_mm: f64) -> Piece {
    let cut = CutCondition {
        feed_per_rev_mm: 0.01,
        amplitude_mm: CONDITION.amplitude_mm,
        frequency_hz: CONDITION.frequency_hz,
        spindle_rev_per_min: 1_000.0,
        diameter_mm: 10.0,
        feed_coupling: FeedCoupling::PerRevolution,
    };
    Piece::Constant(ChipBlock { line: 4, start_mm, length_mm: 10.0, cut, surface: None, feed_override: 1.0 })
}

#[test]
fn a_change_of_the_override_divides_the_section_at_its_place() {
    let mut course = course(None, 1.5);
    course.add(block(0.0));
    course.add(block(10.0));
    course.is_cut(4.0, 1.0);
    course.is_cut(16.0, 1.5);
    course.is_cut(16.0, 0.3);
    course.is_cut(f64::INFINITY, 0.5);
    let verdict = course.finish(20.0);
    assert!((verdict.broken_share.unwrap() - 0.4).abs() < 1e-12);
    let worst = verdict.worst.unwrap();
    assert_eq!((worst.feed_override, worst.line), (1.5, 4));
    assert!((worst.cut.feed_per_rev_mm - 0.015).abs() < 1e-15);
    let spans: Vec<_> = verdict.spans.iter().map(|span| (span.start_mm, span.feed_override, span.broken)).collect();
    assert_eq!(spans, [(0.0, 1.0, true), (4.0, 1.5, false), (16.0, 0.5, true)]);
    let permitted = verdict.permitted.unwrap();
    assert_eq!((permitted.max_feed_override, permitted.broken_share), (1.5, 0.0));
    assert!((permitted.largest_breaking_override.unwrap() - 1.1).abs() < 1e-9);
    assert!((permitted.largest_breaking_feed_per_rev_mm.unwrap() - 0.011).abs() < 1e-11);
    assert!((permitted.min_amplitude_mm.unwrap() - 0.0075).abs() < 1e-11);
}

#[test]
fn an_amplitude_that_follows_serves_as_far_as_it_does() {
    for (up_to, max_feed_override, breaks, largest) in
        [(1.5, 1.5, true, 1.65), (1.2, 1.3, true, 1.32), (1.2, 1.5, false, 1.32), (1.0, 1.5, false, 1.1)]
    {
        let mut course = course(Some(up_to), max_feed_override);
        course.add(block(0.0));
        course.is_cut(f64::INFINITY, 0.2);
        let verdict = course.finish(10.0);
        assert_eq!(verdict.broken_share, Some(1.0), "the amplitude goes down with the feed, the margin stays");
        assert!((verdict.worst.unwrap().cut.breaking_margin() - 1.1).abs() < 1e-9);
        let permitted = verdict.permitted.unwrap();
        assert_eq!(permitted.broken_share == 1.0, breaks, "{up_to} {max_feed_override}");
        assert!((permitted.largest_breaking_override.unwrap() - largest).abs() < 1e-9);
        let least_mm = permitted.min_amplitude_mm.unwrap();
        assert_eq!(least_mm <= CONDITION.amplitude_mm, breaks);
    }
}

#[test]
fn at_whole_numbers_no_override_and_no_amplitude_breaks() {
    let mut course = course(None, 1.5);
    let Piece::Constant(mut whole) = block(0.0) else { unreachable!() };
    whole.cut.spindle_rev_per_min = 1_250.0;
    course.add(Piece::Constant(whole));
    let permitted = course.finish(10.0).permitted.unwrap();
    assert_eq!((permitted.breaking_margin, permitted.broken_share), (0.0, 0.0));
    assert_eq!((permitted.largest_breaking_override, permitted.min_amplitude_mm), (None, None));
}

proptest! {
    #[test]
    fn the_worst_cut_at_constant_surface_speed_is_that_of_many(
        start_radius_mm in -40.0..40.0_f64,
        end_radius_mm in -40.0..40.0_f64,
        m_per_min in 5.0..200.0_f64,
        max_rev_per_min in 500.0..4_000.0_f64,
        frequency_hz in 5.0..120.0_f64,
        per_minute in any::<bool>(),
        feed in 0.01..0.2_f64,
    ) {
        let span = LinearSpan {
            line: 7,
            start_mm: 0.0,
            length_mm: 10.0,
            start_radius_mm,
            end_radius_mm,
            frequency_hz,
            amplitude_mm: 0.05,
            feed: if per_minute { SpanFeed::PerMinute(feed * 1_000.0) } else { SpanFeed::PerRevolution(feed) },
            surface_speed_m_per_min: m_per_min,
            max_rev_per_min,
        };
        let (worst, cut) = span.worst_cut().unwrap();
        let margins = (0..=4_000).map(|k| span.cut_at(f64::from(k) / 4_000.0).breaking_margin());
        let least = margins.fold(f64::INFINITY, f64::min);
        prop_assert!(worst <= least + 1e-12, "{} of {}", worst, least);
        prop_assert!((cut.breaking_margin() - worst).abs() < 1e-6);
        // Between two samples D changes by no more than this.
        let step = (span.cut_at(0.0).vibrations_per_rev() - span.cut_at(1.0).vibrations_per_rev()).abs().max(
            60.0 * frequency_hz * PI * 80.0 / (m_per_min * 1_000.0)) / 4_000.0;
        let slope = 2.0 * span.amplitude_mm * PI * step * 4.0;
        let least_feed_mm = if per_minute { feed * 1_000.0 / max_rev_per_min } else { feed };
        prop_assert!(least - worst <= slope / least_feed_mm + 1e-9 || worst == 0.0, "{} of {}", worst, least);
    }
}
