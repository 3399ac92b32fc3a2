//! Every fault leads to a hold, none to a decision from bad data, and the loop goes on afterwards.

use super::harness::{Live, SLOT, SLOT_REV_PER_MIN, judging, mill, run};
use feedwave_monitoring::{Action, Fallback, HoldReason, Overrides, Reason, State};
use feedwave_simulator::{Fault, FaultKind, Mounting, SensorPair, Where};

/// The slot twice as deep as its feed allows, with a fault from 1 s on, amid the steps down.
fn with(kind: FaultKind, to_s: f64) -> Live {
    let mut description = mill(1.0);
    description.faults = vec![Fault { at: Where::Time { from_s: 1.0, to_s }, kind }];
    run(SLOT, SLOT_REV_PER_MIN, description, judging())
}

/// Forces are proportional to the feed, and so is the deflection: 0.0159 mm at 100 %, the largest mean of the samples of ten degrees as the harmonics of
/// the force give it (`physics.rs` holds the deflection against them). A window may begin at the feed before.
fn believes_nothing_false(live: &Live) {
    for (properties, feed) in live.windows() {
        let at_full = properties.max_deviation / feed;
        assert!((0.0155..0.0159 * 1.05 / 0.95).contains(&at_full), "{at_full} mm at 100 %, {properties:?}");
    }
    for decision in &live.decisions {
        assert!(decision.is_reproduced());
        let changed = decision.outcome.action == Action::Change;
        assert!(!changed || decision.outcome.reason == Reason::FeedAboveLimit, "{decision:?}");
    }
    assert_eq!(live.replayed_decisions(), live.decisions);
}

/// Holds with this reason, then comes down to the limits as if nothing had been: 0.0159 mm to 0.01 mm are ten steps of 5 %.
fn holds_and_recovers(kind: FaultKind, reason: Reason) {
    holds_and_recovers_after(kind, 1.5, reason);
}

fn holds_and_recovers_after(kind: FaultKind, to_s: f64, reason: Reason) {
    let live = with(kind, to_s);
    believes_nothing_false(&live);
    let reasons = live.reasons();
    let held: Vec<_> = live.decisions.iter().filter(|decision| decision.outcome.action == Action::Hold).collect();
    assert!(held.iter().any(|decision| decision.outcome.reason == reason), "{kind:?}: {reasons:?}");
    assert!(held.iter().all(|decision| decision.outcome.after == decision.inputs.before));
    assert_eq!(reasons[2], Reason::FeedAboveLimit, "{kind:?}: {reasons:?}");
    assert!(reasons.ends_with(&[Reason::WithinLimits; 5]), "{kind:?}: {reasons:?}");
    assert!(
        (live.monitor.overrides().feed - 0.95f64.powi(10)).abs() < 0.03,
        "{kind:?}: {:?}",
        live.monitor.overrides()
    );
}

#[test]
fn a_lost_sensor() {
    holds_and_recovers(FaultKind::SensorLost(Mounting::Tool), Reason::Data(HoldReason::SensorMissing));
}

#[test]
fn values_that_are_no_numbers() {
    holds_and_recovers(FaultKind::NotANumber(Mounting::Tool), Reason::Data(HoldReason::NotFinite));
}

#[test]
fn a_stuck_value() {
    holds_and_recovers(FaultKind::Stuck(Mounting::Tool), Reason::Data(HoldReason::StuckSensor));
}

#[test]
fn a_clock_that_jumps() {
    // To either side and back.
    holds_and_recovers(FaultKind::ClockJump(30_000_000), Reason::Data(HoldReason::TimeGap));
    holds_and_recovers(FaultKind::ClockJump(-30_000_000), Reason::Data(HoldReason::TimeOutOfOrder));
    // Stamps further behind the clock than a silence may last are one, and it is reported once.
    holds_and_recovers(FaultKind::ClockJump(-700_000_000), Reason::Silence);
    let told = |reason: &&Reason| **reason == Reason::Silence;
    assert_eq!(with(FaultKind::ClockJump(-700_000_000), 1.5).reasons().iter().filter(told).count(), 1);
    holds_and_recovers(FaultKind::ClockJump(i64::MIN), Reason::Silence);
    // Stamps far ahead of the clock are none, however much telemetry seems to be missing before them.
    holds_and_recovers(FaultKind::ClockJump(5_000_000_000), Reason::Data(HoldReason::TimeOutOfOrder));
    holds_and_recovers(FaultKind::ClockJump(i64::MAX), Reason::Data(HoldReason::TimeOutOfOrder));
}

#[test]
fn batches_swapped_or_lost() {
    holds_and_recovers(FaultKind::SwappedBatches, Reason::Data(HoldReason::BatchGap));
    holds_and_recovers_after(FaultKind::LostBatches, 1.02, Reason::Data(HoldReason::BatchGap));
    // So many of them are a silence.
    holds_and_recovers(FaultKind::LostBatches, Reason::Silence);
}

#[test]
fn duplicate_batches_change_nothing() {
    assert_eq!(with(FaultKind::DuplicateBatches, 1.5).decisions, with(FaultKind::ClockJump(0), 1.5).decisions);
}

#[test]
fn telemetry_that_stops_brings_the_configured_fallback() {
    holds_and_recovers(FaultKind::Silence, Reason::Silence);
    let with_fallback = |fallback| {
        let mut description = mill(1.0);
        description.faults = vec![Fault { at: Where::Time { from_s: 1.0, to_s: 1.5 }, kind: FaultKind::Silence }];
        let mut judging = judging();
        judging.rules.fallback = fallback;
        run(SLOT, SLOT_REV_PER_MIN, description, judging)
    };
    let full = with_fallback(Fallback::Full);
    let silence = full.decisions.iter().find(|decision| decision.outcome.reason == Reason::Silence).unwrap();
    assert!(silence.inputs.before.feed < 1.0);
    assert_eq!((silence.outcome.action, silence.outcome.after), (Action::Change, Overrides::FULL));
    // Noticed in the block in which the tolerated 50 ms end.
    assert!((1_040_000_000..1_060_000_000).contains(&silence.time_ns), "{}", silence.time_ns);
    assert!(full.reasons().ends_with(&[Reason::WithinLimits; 5]), "and down it comes again");
    let stop = with_fallback(Fallback::Stop);
    assert_eq!(
        (stop.monitor.state(), stop.decisions.last().unwrap().outcome.reason),
        (State::Stopped, Reason::Silence)
    );
}

#[test]
fn outliers_and_lost_samples_are_removed_counted_and_do_not_matter() {
    let mut description = mill(1.0);
    description.tool_sensors =
        Some(SensorPair { outlier_rate: 0.01, outlier_size: 0.8, ..description.tool_sensors.unwrap() });
    description.drop_rate = 0.01;
    let live = run(SLOT, SLOT_REV_PER_MIN, description, judging());
    believes_nothing_false(&live);
    let removed = live.decisions.iter().fold([0, 0], |[spikes, dropped], decision| {
        let removed = decision.span.removed;
        [spikes + removed.spikes, dropped + removed.dropped]
    });
    let samples: u64 = live.decisions.iter().map(|decision| decision.span.samples).sum();
    for removed in removed {
        assert!((f64::from(removed) / samples as f64 - 0.01).abs() < 0.001, "{removed} of {samples}");
    }
    assert!(live.reasons().ends_with(&[Reason::WithinLimits; 5]));
}
