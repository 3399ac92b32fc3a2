//! No decision from bad data: every fault holds with its reason, and the run recovers.

use crate::common::{Columns, PERIOD_NS, config, cutting, monitor, note, run};
use feedwave_monitoring::{
    Action, Batch, BatchError, Decision, Event, EventError, Fallback, HoldReason, MAX_BATCH_SAMPLES, Monitor,
    Overrides, Reason, Receipt, SpikeFilter, SpindleRule, State,
};

/// First sample of the first measuring window of [`cutting`], and some sample well inside it.
const INSIDE: usize = 2700;

fn reasons(decisions: &[Decision]) -> Vec<Reason> {
    decisions.iter().map(|decision| decision.outcome.reason).collect()
}

/// Damages the first of two windows with a deflection above D**, and expects it to hold and the second to decide.
fn holds_then_recovers(expected: HoldReason, damage: impl FnOnce(&mut Columns)) -> Vec<Decision> {
    let mut columns = cutting([0.05, 0.0], 2);
    damage(&mut columns);
    let mut monitor = monitor(config());
    let decisions = run(&mut monitor, &columns);
    assert_eq!(reasons(&decisions), [Reason::ToolFit, Reason::Data(expected), Reason::FeedAboveLimit]);
    assert_eq!(decisions[1].outcome.action, Action::Hold);
    assert_eq!(decisions[1].outcome.after, Overrides::FULL);
    assert_eq!(monitor.overrides().feed, 0.98);
    decisions
}

#[test]
fn too_many_values_that_are_no_numbers() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let decisions = holds_then_recovers(HoldReason::NotFinite, |columns| columns.x[INSIDE..INSIDE + 150].fill(bad));
        assert_eq!(decisions[1].span.removed.non_finite, 150);
        assert_eq!(decisions[1].span.valid, 850);
    }
    holds_then_recovers(HoldReason::NotFinite, |columns| columns.angle_deg[INSIDE..INSIDE + 150].fill(f64::NAN));
}

#[test]
fn a_few_wrong_values_are_removed_and_counted() {
    let mut columns = cutting([0.005, 0.0], 1);
    columns.x[INSIDE] = f64::NAN;
    columns.y[INSIDE + 10] = 1e6;
    columns.x[INSIDE + 20] = 50.0;
    let mut config = config();
    config.quality.spikes = Some(SpikeFilter { max_step: 0.1, max_run: 3 });
    let decisions = run(&mut monitor(config), &columns);
    let removed = decisions[1].span.removed;
    assert_eq!((removed.non_finite, removed.out_of_range, removed.spikes, removed.total()), (1, 1, 1, 3));
    assert_eq!(decisions[1].span.valid, 997);
    assert_eq!(decisions[1].outcome.reason, Reason::WithinLimits);
}

#[test]
fn a_real_step_is_no_spike() {
    let mut config = config();
    config.quality.spikes = Some(SpikeFilter { max_step: 0.02, max_run: 3 });
    let decisions = run(&mut monitor(config), &cutting([0.05, 0.0], 1));
    assert_eq!(decisions[1].outcome.reason, Reason::FeedAboveLimit);
}

#[test]
fn a_stuck_sensor() {
    let decisions = holds_then_recovers(HoldReason::StuckSensor, |columns| columns.y[INSIDE..INSIDE + 260].fill(1.0));
    assert_eq!(decisions[1].span.removed.stuck, 11);
}

#[test]
fn most_values_out_of_range() {
    holds_then_recovers(HoldReason::TooFewSamples, |columns| {
        for (index, x) in columns.x[INSIDE..INSIDE + 200].iter_mut().enumerate() {
            *x = -5.0 - index as f64;
        }
    });
}

#[test]
fn time_stamps_that_stand_or_go_back() {
    holds_then_recovers(HoldReason::TimeOutOfOrder, |columns| columns.time_ns[INSIDE] = columns.time_ns[INSIDE - 1]);
    holds_then_recovers(HoldReason::TimeOutOfOrder, |columns| columns.time_ns.swap(INSIDE, INSIDE + 1));
}

#[test]
fn a_clock_that_jumps_back_or_ahead() {
    let minute_ns = 60_000_000_000;
    for from_ns in [minute_ns, 0] {
        let mut columns = cutting([0.05, 0.0], 2);
        columns.time_ns.iter_mut().for_each(|time| *time += from_ns);
        let jump_to = if from_ns == 0 { 100_000_000 } else { 1000 };
        for (index, time) in columns.time_ns[INSIDE..].iter_mut().enumerate() {
            *time = if from_ns == 0 { INSIDE as u64 * PERIOD_NS + jump_to } else { jump_to } + index as u64 * PERIOD_NS;
        }
        let expected = if from_ns == 0 { HoldReason::TimeGap } else { HoldReason::TimeOutOfOrder };
        let decisions = run(&mut monitor(config()), &columns);
        assert_eq!(reasons(&decisions), [Reason::ToolFit, Reason::Data(expected), Reason::FeedAboveLimit]);
    }
}

/// Batches of 100 samples, with the clock told before each, as a connection does.
fn told_the_clock(monitor: &mut Monitor, columns: &Columns, true_ns: impl Fn(usize) -> u64) -> Vec<Decision> {
    let mut decisions = Vec::new();
    for (sequence, from) in (0..columns.len()).step_by(100).enumerate() {
        let to = columns.len().min(from + 100);
        decisions.extend(note(monitor, Event::Clock(true_ns(to - 1))));
        monitor.push(&columns.batch(sequence as u64, from, to), &mut |decision| decisions.push(decision)).unwrap();
    }
    decisions
}

#[test]
fn one_stamp_far_ahead_of_the_clock_voids_its_window_only() {
    let hour_ns = 3_600_000_000_000;
    let mut columns = cutting([0.05, 0.0], 3);
    let true_ns = columns.time_ns.clone();
    columns.time_ns[INSIDE] += hour_ns;
    let mut config = config();
    config.rules.fallback = Fallback::Full;
    let decisions = told_the_clock(&mut monitor(config), &columns, |index| true_ns[index]);
    let void = Reason::Data(HoldReason::TimeOutOfOrder);
    assert_eq!(reasons(&decisions), [Reason::ToolFit, void, Reason::FeedAboveLimit, Reason::FeedAboveLimit]);
}

#[test]
fn a_clock_that_was_set_ahead_is_no_silence() {
    let hour_ns = 3_600_000_000_000;
    let mut columns = cutting([0.05, 0.0], 3);
    columns.time_ns[INSIDE..].iter_mut().for_each(|time| *time += hour_ns);
    let mut config = config();
    config.rules.fallback = Fallback::Full;
    let mut monitor = monitor(config);
    let mut decisions = Vec::new();
    for (sequence, from) in (0..columns.len()).step_by(100).enumerate() {
        let to = columns.len().min(from + 100);
        let is_set = from <= INSIDE + 200 && INSIDE + 200 < to;
        let behind_ns = if from < INSIDE + 200 && !is_set { hour_ns } else { 0 };
        let now_ns = columns.time_ns[to - 1];
        let event = if is_set { Event::ClockSet(now_ns) } else { Event::Clock(now_ns.saturating_sub(behind_ns)) };
        if from >= INSIDE || is_set {
            decisions.extend(note(&mut monitor, event));
        }
        monitor.push(&columns.batch(sequence as u64, from, to), &mut |decision| decisions.push(decision)).unwrap();
    }
    let void = Reason::Data(HoldReason::TimeOutOfOrder);
    assert!(!reasons(&decisions).contains(&Reason::Silence), "{:?}", reasons(&decisions));
    assert!(reasons(&decisions).contains(&void), "{:?}", reasons(&decisions));
    assert_eq!(reasons(&decisions).last(), Some(&Reason::FeedAboveLimit));
}

#[test]
fn stamps_too_dense_to_be_true_end_the_window() {
    let mut columns = cutting([0.05, 0.0], 6);
    let start = columns.time_ns[INSIDE];
    for (index, time) in columns.time_ns[INSIDE..].iter_mut().enumerate() {
        *time = start + index as u64;
    }
    let decisions = run(&mut monitor(config()), &columns);
    assert_eq!(reasons(&decisions), [Reason::ToolFit, Reason::Data(HoldReason::TimeTooDense)]);
    assert_eq!(decisions[1].span.samples, 4002);
}

#[test]
fn samples_dropped_in_transit_are_counted() {
    let mut columns = cutting([0.05, 0.0], 2);
    // Every second sample is lost for 400 ms: time goes on, samples do not come.
    for (index, time) in columns.time_ns.iter_mut().enumerate().skip(INSIDE) {
        *time += (index - INSIDE).min(200) as u64 * PERIOD_NS;
    }
    let decisions = run(&mut monitor(config()), &columns);
    assert_eq!(decisions[1].span.removed.dropped, 200);
    assert_eq!(decisions[1].outcome.reason, Reason::Data(HoldReason::TooFewSamples));
}

#[test]
fn batches_by_number() {
    let columns = cutting([0.05, 0.0], 2);
    let mut monitor = monitor(config());
    let mut decisions = Vec::new();
    let mut push = |sequence, from, to| {
        monitor.push(&columns.batch(sequence, from, to), &mut |decision| decisions.push(decision)).unwrap()
    };
    assert_eq!(push(5, 0, INSIDE), Receipt::Accepted);
    assert_eq!(push(5, 0, INSIDE), Receipt::Dropped { newest: 5 });
    assert_eq!(push(8, INSIDE, INSIDE + 100), Receipt::AcceptedAfterGap { first: 6, last: 7 });
    assert_eq!(push(7, 0, 100), Receipt::Dropped { newest: 8 });
    assert_eq!(push(9, INSIDE + 100, columns.len()), Receipt::Accepted);
    assert_eq!(reasons(&decisions), [Reason::ToolFit, Reason::Data(HoldReason::BatchGap), Reason::FeedAboveLimit]);
}

#[test]
fn a_missing_column_holds_and_returns() {
    let columns = cutting([0.05, 0.0], 2);
    for lacking in 0..3 {
        let mut monitor = monitor(config());
        let mut decisions = Vec::new();
        for (sequence, (from, to)) in
            [(0, INSIDE), (INSIDE, INSIDE + 50), (INSIDE + 50, columns.len())].iter().enumerate()
        {
            let mut batch = columns.batch(sequence as u64, *from, *to);
            if sequence == 1 {
                batch = match lacking {
                    0 => Batch { tool: None, ..batch },
                    1 => Batch { spindle_angle_deg: None, ..batch },
                    _ => Batch { contact: None, ..batch },
                };
            }
            monitor.push(&batch, &mut |decision| decisions.push(decision)).unwrap();
        }
        assert_eq!(
            reasons(&decisions),
            [Reason::ToolFit, Reason::Data(HoldReason::SensorMissing), Reason::FeedAboveLimit]
        );
    }
}

#[test]
fn the_baseline_of_another_tool() {
    let mut monitor = monitor(config());
    run(&mut monitor, &cutting([0.05, 0.0], 0));
    note(&mut monitor, Event::Tool(7));
    let mut columns = cutting([0.05, 0.0], 2);
    columns.contact.fill(true);
    columns.time_ns.iter_mut().for_each(|time| *time += 2401 * PERIOD_NS);
    let decisions = run(&mut monitor, &columns);
    assert!(decisions.len() >= 3);
    assert!(reasons(&decisions).iter().all(|reason| *reason == Reason::Data(HoldReason::OtherTool)));
    assert_eq!(decisions[0].tool, 7);
    note(&mut monitor, Event::Rebaseline);
    assert_eq!(monitor.state(), State::Baseline);
}

#[test]
fn stale_samples_are_no_evidence() {
    let mut monitor = monitor(config());
    let columns = cutting([0.05, 0.0], 1);
    monitor.push(&columns.batch(0, 0, INSIDE), &mut |_| {}).unwrap();
    // The clock is far ahead: first the silence is noticed, and what arrives afterwards is old.
    let silence = note(&mut monitor, Event::Clock(columns.time_ns[INSIDE] + 3_000_000_000));
    assert_eq!(reasons(&silence), [Reason::Silence]);
    let mut decisions = Vec::new();
    let late = cutting([0.05, 0.0], 2);
    monitor.push(&late.batch(1, INSIDE, late.len()), &mut |decision| decisions.push(decision)).unwrap();
    assert!(!decisions.is_empty());
    assert!(decisions.iter().all(|decision| decision.outcome.action == Action::Hold), "{:?}", reasons(&decisions));
}

#[test]
fn silence_while_cutting_brings_the_fallback_once() {
    for (fallback, action, state) in [
        (Fallback::Hold, Action::Hold, State::Measuring),
        (Fallback::Full, Action::Change, State::Measuring),
        (Fallback::Stop, Action::Stop, State::Stopped),
    ] {
        let mut config = config();
        config.rules.fallback = fallback;
        let mut monitor = monitor(config);
        let columns = cutting([0.05, 0.0], 1);
        run(&mut monitor, &columns);
        let last = *columns.time_ns.last().unwrap();
        assert!(note(&mut monitor, Event::Clock(last + 500_000_000)).is_empty(), "not longer than tolerated");
        let decisions = note(&mut monitor, Event::Clock(last + 500_000_001));
        assert_eq!((decisions[0].outcome.action, monitor.state()), (action, state));
        assert_eq!(decisions[0].time_ns, last + 500_000_000);
        assert!(decisions[0].is_reproduced());
        assert!(note(&mut monitor, Event::Clock(last + 900_000_000)).is_empty(), "once");
    }
}

#[test]
fn silence_gives_up_a_planned_speed_and_takes_it_back_where_it_was_asked_for() {
    let requested = |setpoint_index| {
        let mut config = config();
        config.rules.fallback = Fallback::Full;
        config.rules.spindle =
            SpindleRule::Turning { lower_deg: 10.0, upper_deg: 20.0, step: 0.05, min_concentration: 0.1 };
        let mut monitor = monitor(config).planning_spindle();
        let columns = cutting([0.05, 0.0], 1);
        run(&mut monitor, &columns);
        assert_eq!(monitor.spindle().request.map(|request| request.spindle), Some(1.05));
        note(&mut monitor, Event::SpindlePlace { setpoint_index, rev_per_min: None });
        let last = *columns.time_ns.last().unwrap();
        let decisions = note(&mut monitor, Event::Clock(last + 500_000_001));
        assert_eq!((reasons(&decisions), decisions[0].outcome.planned_spindle), (vec![Reason::Silence], Some(1.0)));
        assert!(decisions[0].is_reproduced());
        monitor.spindle().request.map(|request| request.spindle)
    };
    assert_eq!(requested(None), None, "nobody was asked");
    assert_eq!(requested(Some(38)), Some(1.0), "the machine may have begun to change the speed");
}

/// A thread begins behind a window with a decision, and telemetry stops in it; the silence is noticed there, and holds.
fn silent_in_a_thread(fallback: Fallback) -> (Monitor, u64) {
    let mut config = config();
    config.rules.fallback = fallback;
    let mut monitor = monitor(config);
    let columns = cutting([0.05, 0.0], 1);
    run(&mut monitor, &columns);
    assert_eq!(monitor.overrides().feed, 0.98);
    assert!(note(&mut monitor, Event::Threading(true)).is_empty());
    let noticed_ns = columns.time_ns.last().unwrap() + 500_000_001;
    let held = note(&mut monitor, Event::Clock(noticed_ns));
    let reason = if fallback == Fallback::Full { Reason::Threading } else { Reason::Silence };
    assert_eq!((reasons(&held), monitor.overrides().feed), (vec![reason], 0.98));
    let monitor = Monitor::restore(&monitor.snapshot().unwrap()).unwrap();
    (monitor, noticed_ns)
}

#[test]
fn silence_that_begins_in_a_thread_brings_its_fallback_behind_it() {
    let (mut monitor, noticed_ns) = silent_in_a_thread(Fallback::Full);
    assert!(note(&mut monitor, Event::Clock(noticed_ns + 1_000_000_000)).is_empty(), "the pass goes on");
    let behind = note(&mut monitor, Event::Threading(false));
    assert_eq!((reasons(&behind), monitor.overrides()), (vec![Reason::Silence], Overrides::FULL));
    assert_eq!((behind[0].outcome.action, behind[0].time_ns), (Action::Change, noticed_ns + 1_000_000_000));
    assert!(behind[0].is_reproduced());
    for threading in [true, false] {
        assert!(note(&mut monitor, Event::Threading(threading)).is_empty(), "once");
    }
    assert!(note(&mut monitor, Event::Clock(noticed_ns + 2_000_000_000)).is_empty(), "once");

    let (mut monitor, _) = silent_in_a_thread(Fallback::Hold);
    assert!(note(&mut monitor, Event::Threading(false)).is_empty(), "it held, and holds");
}

#[test]
fn silence_that_ends_in_a_thread_brings_nothing_behind_it() {
    let (mut monitor, noticed_ns) = silent_in_a_thread(Fallback::Full);
    let mut columns = Columns::default();
    columns.add(100, [0.05, 0.0], true);
    columns.time_ns.iter_mut().for_each(|time| *time += noticed_ns + 1_000_000);
    assert!(run(&mut monitor, &columns).is_empty());
    assert!(note(&mut monitor, Event::Threading(false)).is_empty());
    assert_eq!(monitor.overrides().feed, 0.98);
}

#[test]
fn silence_is_the_same_whether_a_clock_or_the_next_sample_tells() {
    let after_silence = |told: bool| {
        let mut config = config();
        config.rules.fallback = Fallback::Full;
        let mut monitor = monitor(config);
        let mut columns = cutting([0.05, 0.0], 3);
        columns.time_ns[3500..].iter_mut().for_each(|time| *time += 900_000_000);
        let mut decisions = Vec::new();
        monitor.push(&columns.batch(0, 0, 3500), &mut |decision| decisions.push(decision)).unwrap();
        if told {
            decisions.extend(note(&mut monitor, Event::Clock(columns.time_ns[3499] + 600_000_000)));
        }
        monitor.push(&columns.batch(1, 3500, columns.len()), &mut |decision| decisions.push(decision)).unwrap();
        decisions
    };
    let decisions = after_silence(false);
    assert_eq!(decisions, after_silence(true));
    assert_eq!(
        reasons(&decisions),
        [Reason::ToolFit, Reason::FeedAboveLimit, Reason::Silence, Reason::Data(HoldReason::TimeGap)]
    );
    assert_eq!(decisions[2].outcome.after, Overrides::FULL);
}

#[test]
fn samples_as_late_as_a_silence_is_long_do_not_end_it() {
    let mut monitor = monitor(config());
    let columns = cutting([0.05, 0.0], 3);
    let mut decisions = Vec::new();
    // The clock is 700 ms ahead of the stamps from the first window on, as after a jump of either.
    for (sequence, from) in (0..columns.len()).step_by(100).enumerate() {
        let to = columns.len().min(from + 100);
        monitor.push(&columns.batch(sequence as u64, from, to), &mut |decision| decisions.push(decision)).unwrap();
        let ahead_ns = if from > INSIDE { 700_000_000 } else { 0 };
        decisions.extend(note(&mut monitor, Event::Clock(columns.time_ns[to - 1] + ahead_ns)));
    }
    assert_eq!(
        reasons(&decisions),
        [Reason::ToolFit, Reason::Silence, Reason::Data(HoldReason::TimeGap), Reason::FeedAboveLimit]
    );
}

#[test]
fn silence_without_contact_is_no_matter() {
    let mut monitor = monitor(config());
    let mut columns = Columns::default();
    columns.add(400, [0.0; 2], false);
    run(&mut monitor, &columns);
    assert!(note(&mut monitor, Event::Clock(u64::MAX)).is_empty());
}

#[test]
fn unreadable_batches_and_impossible_events_change_nothing() {
    let mut monitor = monitor(config());
    let before = monitor.snapshot().unwrap();
    let columns = cutting([0.0; 2], 0);
    let short = Batch { contact: Some(&columns.contact[1..]), ..columns.batch(0, 0, columns.len()) };
    assert_eq!(
        monitor.push(&short, &mut |_| {}),
        Err(BatchError::ColumnLength { column: "contact", length: 2400, samples: 2401 })
    );
    let times = vec![0; MAX_BATCH_SAMPLES + 1];
    let huge = Batch { time_ns: &times, ..Batch::default() };
    assert!(matches!(monitor.push(&huge, &mut |_| {}), Err(BatchError::TooLarge { .. })));
    for rev_per_min in [f64::NAN, -1.0, f64::INFINITY] {
        assert!(matches!(
            monitor.note(Event::ProgrammedSpindle { rev_per_min }, &mut |_| {}),
            Err(EventError::SpindleSpeed(_))
        ));
    }
    for (feed, spindle, which) in [(0.05, 1.0, "feed"), (f64::NAN, 1.0, "feed"), (1.0, 1.3, "spindle")] {
        let refused = monitor.note(Event::Overrides { feed, spindle }, &mut |_| {});
        assert!(matches!(refused, Err(EventError::Override { which: found, .. }) if found == which));
    }
    assert_eq!(monitor.snapshot().unwrap(), before);
}
