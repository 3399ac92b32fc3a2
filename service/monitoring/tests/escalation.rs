//! A property that stays above its limit at the lower feed bound does not go on for ever.

use crate::common::{Columns, PERIOD_NS, config, cutting, monitor, note, run};
use feedwave_monitoring::{
    Action, Bound, Decision, Escalation, EscalationAction, Event, Fallback, HoldReason, Monitor, MonitoringConfig,
    Overrides, Property, Reason, SpectrumConfig,
};
use std::f64::consts::TAU;

const DEEP: [f64; 2] = [0.05, 0.0];

/// The feed reaches its lower bound of 90 % with the second window.
fn escalating(windows: u32, action: EscalationAction) -> MonitoringConfig {
    let mut config = config();
    config.rules.feed.step = 0.06;
    config.rules.feed_bounds.lower = 0.9;
    config.rules.escalation = Some(Escalation { windows, action });
    config
}

/// Samples that go on after those that were taken.
fn more(before: &Columns, fill: impl FnOnce(&mut Columns)) -> Columns {
    let mut columns = before.clone();
    fill(&mut columns);
    let from = before.len();
    Columns {
        time_ns: columns.time_ns.split_off(from),
        x: columns.x.split_off(from),
        y: columns.y.split_off(from),
        angle_deg: columns.angle_deg.split_off(from),
        rev_per_min: columns.rev_per_min.split_off(from),
        contact: columns.contact.split_off(from),
    }
}

/// Takes samples in after those before, and what was decided.
fn go_on(monitor: &mut Monitor, all: &mut Columns, count: usize, deflection: [f64; 2]) -> Vec<Decision> {
    let next = more(all, |columns| {
        columns.add(count, deflection, true);
    });
    all.add(count, deflection, true);
    run(monitor, &next)
}

fn rows(decisions: &[Decision]) -> Vec<(u32, Action)> {
    decisions.iter().map(|decision| (decision.inputs.windows_at_bound, decision.outcome.action)).collect()
}

#[test]
fn the_feed_is_held_after_so_many_windows_in_a_row_until_a_resume() {
    let mut monitor = monitor(escalating(5, EscalationAction::Hold));
    let mut all = cutting(DEEP, 9);
    let decisions = run(&mut monitor, &all);
    // Tool check, two steps down to 90 %, four windows at the bound, the fifth escalates, and the feed stays held.
    let keep = Action::Keep;
    assert_eq!(
        rows(&decisions),
        [
            (0, keep),
            (0, Action::Change),
            (0, Action::Change),
            (0, keep),
            (1, keep),
            (2, keep),
            (3, keep),
            (4, Action::HoldFeed),
            (5, Action::Hold),
            (5, Action::Hold)
        ]
    );
    let escalation = &decisions[7].outcome;
    assert_eq!((escalation.reason, escalation.feed_bound), (Reason::AboveLimitAtBound, Some(Bound::Lower)));
    assert_eq!(escalation.after, Overrides { feed: 0.0, spindle: 1.0 });
    assert!(decisions[8..].iter().all(|held| held.outcome.reason == Reason::FeedHeld && held.inputs.held));
    assert!(decisions.iter().all(Decision::is_reproduced));
    assert!(monitor.holds_feed() && monitor.overrides().feed == 0.0);
    // Nothing but a resume lets it go on: no quiet window, no override of the operator, no other tool.
    assert_eq!(go_on(&mut monitor, &mut all, 1000, [0.001, 0.0])[0].outcome.reason, Reason::FeedHeld);
    note(&mut monitor, Event::Overrides { feed: 1.2, spindle: 1.0 });
    note(&mut monitor, Event::Tool(3));
    note(&mut monitor, Event::Tool(0));
    assert_eq!(monitor.overrides().feed, 0.0);
    note(&mut monitor, Event::Overrides { feed: 0.9, spindle: 1.0 });
    note(&mut monitor, Event::Resume);
    assert!(!monitor.holds_feed() && monitor.overrides().feed == 0.9);
    // The row starts over.
    let again = go_on(&mut monitor, &mut all, 5000, DEEP);
    assert_eq!(rows(&again), [(0, keep), (1, keep), (2, keep), (3, keep), (4, Action::HoldFeed)]);
}

#[test]
fn the_machine_stops_where_that_is_set_and_the_cut_goes_on_where_nothing_is() {
    let mut stops = monitor(escalating(1, EscalationAction::Stop));
    let decisions = run(&mut stops, &cutting(DEEP, 6));
    let last = decisions.last().unwrap();
    assert_eq!(
        (decisions.len(), last.outcome.action, last.outcome.reason),
        (4, Action::Stop, Reason::AboveLimitAtBound)
    );
    assert_eq!(last.outcome.after.feed, 0.9);
    let mut off = monitor(MonitoringConfig {
        rules: feedwave_monitoring::Rules { escalation: None, ..escalating(1, EscalationAction::Hold).rules },
        ..config()
    });
    let decisions = run(&mut off, &cutting(DEEP, 40));
    assert_eq!(decisions.len(), 41);
    assert!(decisions[3..].iter().all(|decision| decision.outcome.action == Action::Keep));
    // Said in every decision.
    assert!(decisions.iter().all(|decision| decision.inputs.rules.escalation.is_none()));
    assert_eq!(decisions[40].inputs.windows_at_bound, 37);
}

#[test]
fn a_window_within_the_limit_breaks_the_row_and_one_that_is_not_judged_does_not() {
    let escalating = || monitor(escalating(3, EscalationAction::Hold));
    // Two windows at the bound, then one within the limits.
    let (mut broken, mut all) = (escalating(), cutting(DEEP, 4));
    run(&mut broken, &all);
    let inside = go_on(&mut broken, &mut all, 1000, [0.005, 0.0]);
    assert_eq!((inside[0].inputs.windows_at_bound, inside[0].outcome.reason), (2, Reason::WithinLimits));
    assert_eq!(rows(&go_on(&mut broken, &mut all, 2000, DEEP)), [(0, Action::Keep), (1, Action::Keep)]);

    // A window of bad data.
    let (mut spoilt, mut all) = (escalating(), cutting(DEEP, 4));
    run(&mut spoilt, &all);
    let mut bad = more(&all, |columns| {
        columns.add(1000, DEEP, true);
    });
    bad.x[..900].fill(f64::NAN);
    all.add(1000, DEEP, true);
    let held = run(&mut spoilt, &bad);
    assert_eq!(held[0].outcome.reason, Reason::Data(HoldReason::NotFinite));
    assert_eq!(rows(&go_on(&mut spoilt, &mut all, 1000, DEEP)), [(2, Action::HoldFeed)]);

    // A thread.
    let (mut threads, mut all) = (escalating(), cutting(DEEP, 4));
    run(&mut threads, &all);
    note(&mut threads, Event::Threading(true));
    assert_eq!(go_on(&mut threads, &mut all, 1000, DEEP)[0].outcome.reason, Reason::Threading);
    note(&mut threads, Event::Threading(false));
    let after = go_on(&mut threads, &mut all, 2000, DEEP);
    assert_eq!(
        rows(&after),
        [(2, Action::Hold), (2, Action::HoldFeed)],
        "the window that began in the thread is not judged"
    );

    // A pause of contact in the middle of a window.
    let (mut paused, mut all) = (escalating(), cutting(DEEP, 4));
    run(&mut paused, &all);
    assert!(go_on(&mut paused, &mut all, 600, DEEP).is_empty());
    let pause = more(&all, |columns| {
        columns.add(3000, [0.0; 2], false);
    });
    all.add(3000, [0.0; 2], false);
    assert!(run(&mut paused, &pause).is_empty());
    assert_eq!(rows(&go_on(&mut paused, &mut all, 1000, DEEP)), [(2, Action::HoldFeed)]);

    // Another tool, and a new baseline, begin a new row.
    let (mut other, all) = (escalating(), cutting(DEEP, 4));
    run(&mut other, &all);
    note(&mut other, Event::Rebaseline);
    let mut again = Columns::default();
    again.add(400, [0.0; 2], false).add(2001 + 3000, DEEP, true);
    let shift = all.len() as u64 * PERIOD_NS;
    again.time_ns.iter_mut().for_each(|time| *time += shift);
    assert_eq!(rows(&run(&mut other, &again))[1..3], [(0, Action::Keep), (1, Action::Keep)]);
}

#[test]
fn silence_does_not_give_a_held_feed_back() {
    let mut config = escalating(1, EscalationAction::Hold);
    config.rules.fallback = Fallback::Full;
    let mut monitor = monitor(config);
    let all = cutting(DEEP, 3);
    run(&mut monitor, &all);
    assert!(monitor.holds_feed());
    let last = all.time_ns[all.len() - 1];
    let silence = note(&mut monitor, Event::Clock(last + 2_000_000_000));
    assert_eq!((silence[0].outcome.action, silence[0].outcome.reason), (Action::Hold, Reason::FeedHeld));
    assert_eq!(monitor.overrides().feed, 0.0);
    // Whoever resumes is still without telemetry.
    let resumed = note(&mut monitor, Event::Resume);
    assert_eq!((resumed[0].outcome.action, resumed[0].outcome.reason), (Action::Change, Reason::Silence));
    assert!(resumed[0].is_reproduced());
    assert_eq!(monitor.overrides(), Overrides::FULL);
}

#[test]
fn a_snapshot_keeps_the_row_and_the_hold() {
    let samples = cutting(DEEP, 9);
    let whole = run(&mut monitor(escalating(5, EscalationAction::Hold)), &samples);
    for cut in [4_000, 6_500, 7_401, 7_402, 9_000] {
        let mut first = monitor(escalating(5, EscalationAction::Hold));
        let mut decisions = Vec::new();
        first.push(&samples.batch(0, 0, cut), &mut |decision| decisions.push(decision)).unwrap();
        let mut second = Monitor::restore(&first.snapshot().unwrap()).unwrap();
        assert_eq!(second.holds_feed(), first.holds_feed());
        second.push(&samples.batch(1, cut, samples.len()), &mut |decision| decisions.push(decision)).unwrap();
        assert_eq!(decisions, whole, "cut at {cut}");
    }
}

#[test]
fn amplitude_and_frequency_of_vibration_escalate_like_the_deflection() {
    for (property, lower, upper) in
        [(Property::VibrationAmplitude, 0.001, 0.005), (Property::VibrationFrequency, 10.0, 100.0)]
    {
        let mut config = escalating(5, EscalationAction::Hold);
        config.spectrum = Some(SpectrumConfig {
            samples: 512,
            min_frequency_hz: 20.0,
            noise_floor: 1e-4,
            harmonic_tolerance_hz: 3.0,
            edges: 1,
        });
        config.rules.property = property;
        config.rules.feed.lower = lower;
        config.rules.feed.upper = upper;
        let mut columns = cutting([0.0; 2], 8);
        for index in 2_401..columns.len() {
            columns.x[index] += 0.02 * libm::sin(TAU * 0.173 * index as f64);
        }
        let decisions = run(&mut monitor(config), &columns);
        let last = &decisions[7];
        let found = (last.inputs.windows_at_bound, last.outcome.action, last.outcome.reason);
        assert_eq!(found, (4, Action::HoldFeed, Reason::AboveLimitAtBound), "{property:?}");
    }
}

#[test]
fn no_windows_and_far_too_many_are_refused() {
    for windows in [0, 10_001] {
        let [violation] = &escalating(windows, EscalationAction::Hold).violations()[..] else { panic!("{windows}") };
        assert_eq!(violation.field, "rules.escalation.windows");
    }
}
