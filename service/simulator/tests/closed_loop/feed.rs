//! The feed rule: too fast comes down, too slow goes up, right stays.

use super::harness::{Live, SLOT, SLOT_REV_PER_MIN, judging, mill, run};
use feedwave_monitoring::{Action, Bound, Reason};

/// Depth at which the programmed feed is between the limits: the deflection is 0.0080 mm.
const RIGHT_MM: f64 = 0.5;

#[test]
fn a_feed_too_high_comes_down_until_the_deflection_is_inside_the_limits() {
    let live = run(SLOT, SLOT_REV_PER_MIN, mill(2.0 * RIGHT_MM), judging());
    let reasons = live.reasons();
    let slower = reasons.iter().filter(|reason| **reason == Reason::FeedAboveLimit).count();
    assert_eq!(reasons[0], Reason::ToolFit);
    assert!(slower >= 3, "{reasons:?}");
    assert!(reasons[1..=slower].iter().all(|reason| *reason == Reason::FeedAboveLimit), "{reasons:?}");
    assert!(reasons[slower + 1..].iter().all(|reason| *reason == Reason::WithinLimits), "{reasons:?}");
    assert!(reasons.len() > slower + 5, "{reasons:?}");
    assert_eq!(live.changes(), slower);
    let feed = live.monitor.overrides().feed;
    let expected = (0..slower).fold(1.0, |feed, _| feed * 0.95);
    assert_eq!((feed, live.monitor.overrides().spindle), (expected, 1.0));
    let deflections: Vec<f64> = live.windows().map(|(properties, _)| properties.max_deviation).collect();
    assert!(deflections[0] > 0.01 && deflections.windows(2).all(|pair| pair[1] < 1.05 * pair[0]), "{deflections:?}");
    assert!(deflections[slower..].iter().all(|value| (0.003..=0.01).contains(value)), "{deflections:?}");
    // What the sensors said is what the tool did: the setpoints were slower, and so its true deflection smaller.
    let cutting: Vec<_> = live.truth.iter().filter(|(_, peak, _)| *peak > 0.003).collect();
    let (first, last) = (cutting[10], cutting[cutting.len() - 10]);
    assert!((last.2 / first.2 - expected).abs() < 1e-9, "{first:?} {last:?}");
    assert!((last.1 / first.1 - expected).abs() < 0.02, "{first:?} {last:?}");
}

#[test]
fn a_feed_too_low_goes_up_to_the_limits() {
    let live = run(SLOT, SLOT_REV_PER_MIN, mill(0.3 * RIGHT_MM), judging());
    let reasons = live.reasons();
    let faster = reasons.iter().filter(|reason| **reason == Reason::FeedBelowLimit).count();
    assert!(faster >= 2, "{reasons:?}");
    // At the very limit a window may lie on either side of it: one step more, then no more.
    let allowed = [Reason::FeedBelowLimit, Reason::WithinLimits];
    assert!(reasons[1..].iter().all(|reason| allowed.contains(reason)), "{reasons:?}");
    assert!(reasons[reasons.len() - 5..].iter().all(|reason| *reason == Reason::WithinLimits), "{reasons:?}");
    assert_eq!(live.changes(), faster);
    assert!(live.monitor.overrides().feed > 1.1 && faster < 6);
}

#[test]
fn inside_the_limits_nothing_changes() {
    let live = run(SLOT, SLOT_REV_PER_MIN, mill(RIGHT_MM), judging());
    let reasons = live.reasons();
    assert!(reasons.len() > 20 && reasons[1..].iter().all(|reason| *reason == Reason::WithinLimits), "{reasons:?}");
    assert_eq!(live.changes(), 0);
}

#[test]
fn a_cut_that_no_feed_can_save_comes_to_rest_and_a_resume_tries_the_bound_again() {
    let mut judging = judging();
    judging.rules.feed.step = 0.5;
    judging.rules.feed_bounds.lower = 0.4;
    let mut live = run(SLOT, SLOT_REV_PER_MIN, mill(10.0 * RIGHT_MM), judging);
    let rows = |live: &Live, from: usize| -> Vec<_> {
        let outcomes = live.decisions[from..].iter().map(|decision| decision.outcome);
        outcomes.map(|outcome| (outcome.action, outcome.reason, outcome.after.feed)).collect()
    };
    let keep = (Action::Keep, Reason::FeedAboveLimit, 0.4);
    let hold = (Action::HoldFeed, Reason::AboveLimitAtBound, 0.0);
    let found = rows(&live, 1);
    let change = |feed| (Action::Change, Reason::FeedAboveLimit, feed);
    assert_eq!(found[..7], [change(0.5), change(0.4), keep, keep, keep, keep, hold], "{found:?}");
    // The path is at rest in the middle of the cut.
    let at_rest = |live: &Live| assert!(live.monitor.holds_feed() && live.truth[live.truth.len() - 1].2 == 0.0);
    at_rest(&live);
    assert_eq!(live.changes(), 3);
    let from = live.decisions.len();
    live.resume();
    // The window in which the path starts again may be one of little deflection.
    let again: Vec<_> = rows(&live, from).into_iter().filter(|row| row.1 != Reason::WithinLimits).collect();
    assert_eq!(again[..5], [keep, keep, keep, keep, hold], "{again:?}");
    at_rest(&live);
    assert_eq!(live.changes(), 5);
    assert_eq!(live.replayed_decisions(), live.decisions);
}

#[test]
fn a_cut_that_no_feed_can_save_goes_on_at_the_bound_where_escalation_is_off() {
    let mut judging = judging();
    judging.rules.feed.step = 0.5;
    judging.rules.feed_bounds.lower = 0.4;
    judging.rules.escalation = None;
    let live = run(SLOT, SLOT_REV_PER_MIN, mill(10.0 * RIGHT_MM), judging);
    let outcomes: Vec<_> = live.decisions[1..].iter().map(|decision| decision.outcome).collect();
    assert_eq!((outcomes[0].after.feed, outcomes[0].feed_bound), (0.5, None));
    assert_eq!((outcomes[1].after.feed, outcomes[1].feed_bound), (0.4, Some(Bound::Lower)));
    for outcome in &outcomes[2..] {
        assert_eq!((outcome.action, outcome.reason), (Action::Keep, Reason::FeedAboveLimit));
        assert_eq!((outcome.after.feed, outcome.feed_bound), (0.4, Some(Bound::Lower)));
    }
    assert!(outcomes.len() > 10 && live.changes() == 2);
}

#[test]
fn the_same_seed_decides_the_same_and_a_replay_from_the_log_is_identical() {
    let mut description = mill(2.0 * RIGHT_MM);
    description.tool_sensors = description.tool_sensors.map(|mut pair| {
        (pair.noise, pair.outlier_rate, pair.outlier_size) = (5e-4, 0.001, 0.5);
        pair
    });
    description.drop_rate = 0.001;
    let live = run(SLOT, SLOT_REV_PER_MIN, description.clone(), judging());
    let again = run(SLOT, SLOT_REV_PER_MIN, description.clone(), judging());
    assert!(live.changes() > 0);
    assert_eq!(live.decisions, again.decisions);
    assert_eq!(live.setpoints, again.setpoints);
    assert_eq!(live.replayed_decisions(), live.decisions);
    assert!(live.replayed_setpoints() == live.setpoints, "the path under these overrides to the bit");
    description.seed += 1;
    let other = run(SLOT, SLOT_REV_PER_MIN, description, judging());
    assert_ne!(other.decisions, live.decisions, "other noise is other evidence");
    assert!((other.monitor.overrides().feed / live.monitor.overrides().feed - 1.0).abs() < 0.06);
}
