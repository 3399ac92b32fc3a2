//! The same loop through every kind of sensor, and with contact found from the signal.

use super::harness::{Live, SLOT, SLOT_REV_PER_MIN, judging, mill, run};
use feedwave_monitoring::{ContactSource, MonitoringConfig, Quantity, Reason, Sensors, ToolCheck};
use feedwave_simulator::{Description, SensorPair, Sway};

/// The slot twice as deep as its feed allows; a change of sensors must not change what is decided.
fn comes_down(description: Description, config: MonitoringConfig) -> Live {
    let live = run(SLOT, SLOT_REV_PER_MIN, description, config);
    let reasons = live.reasons();
    let slower = reasons.iter().filter(|reason| **reason == Reason::FeedAboveLimit).count();
    assert_eq!(reasons[0], Reason::ToolFit);
    // Near the limit a window may lie on either side of it.
    let allowed = [Reason::FeedAboveLimit, Reason::WithinLimits];
    assert!(slower >= 3 && reasons[1..].iter().all(|reason| allowed.contains(reason)), "{reasons:?}");
    assert!(reasons[1..4].iter().all(|reason| *reason == Reason::FeedAboveLimit), "{reasons:?}");
    assert!(reasons.ends_with(&[Reason::WithinLimits; 5]), "{reasons:?}");
    live
}

/// Sensors that the run-out and not the ratio to a stand-off judges.
fn sensors(quantity: Quantity, most: f64) -> MonitoringConfig {
    let mut config = judging();
    config.tool = Some(Sensors { quantity, min: -most, max: most });
    config.tool_check = ToolCheck { max_ratio: None, max_run_out: None };
    config.quality.spikes = None;
    config
}

#[test]
fn strain_gauges() {
    let quantity = Quantity::Strain { mm_per_strain: 40.0 };
    let mut description = mill(1.0);
    description.tool_sensors =
        Some(SensorPair { quantity, stand_off: 0.0, noise: 1e-4 / 40.0, ..SensorPair::default() });
    let by_strain = comes_down(description, sensors(quantity, 0.01));
    let by_distance = comes_down(mill(1.0), judging());
    let ratio = by_strain.monitor.overrides().feed / by_distance.monitor.overrides().feed;
    assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
}

#[test]
fn accelerometers_without_the_commanded_motion() {
    let mut description = mill(1.0);
    let quantity = Quantity::Acceleration;
    description.tool_sensors = Some(SensorPair { quantity, stand_off: 0.0, noise: 50.0, ..SensorPair::default() });
    let mut config = sensors(quantity, 1e7);
    config.rules.feed.lower = 0.0;
    // Nothing is too much at first; then what the first window shows has to come down to 70 %.
    config.rules.feed.upper = 1e9;
    let first =
        run(SLOT, SLOT_REV_PER_MIN, description.clone(), config.clone()).windows().next().unwrap().0.max_deviation;
    config.rules.feed.upper = 0.7 * first;
    let live = comes_down(description, config);
    assert!((0.62..0.74).contains(&live.monitor.overrides().feed), "{:?}", live.monitor.overrides());
}

#[test]
fn the_tool_relative_to_the_work_where_both_sway() {
    let mut description = mill(1.0);
    // Far more than the limits, and too slow for the mean of a window to remove it.
    description.sway = Some(Sway { amplitude_mm: 0.05, frequency_hz: 2.3 });
    description.work_sensors = Some(SensorPair::default());
    let mut config = judging();
    config.work = config.tool;
    config.tool_check = ToolCheck { max_ratio: None, max_run_out: Some(0.01) };
    let live = comes_down(description.clone(), config);
    let last = live.windows().last().unwrap().0;
    assert!((0.003..=0.01).contains(&last.max_deviation), "{last:?}");
    // The tool alone is believed to be bent by what only sways.
    let mut alone = judging();
    alone.tool_check = ToolCheck { max_ratio: None, max_run_out: Some(1.0) };
    let alone = run(SLOT, SLOT_REV_PER_MIN, description, alone);
    assert!(alone.windows().any(|(properties, _)| properties.max_deviation > 0.03));
}

#[test]
fn contact_is_detected_from_the_signal_as_it_is_flagged() {
    let mut config = judging();
    config.contact = ContactSource::Detected { threshold: 0.0015, on_samples: 3, off_samples: 400 };
    let detected = comes_down(mill(1.0), config);
    let flagged = comes_down(mill(1.0), judging());
    let start = |live: &Live| live.decisions[1].span.first_ns;
    // The chips of one revolution, 20 ms, are enough to tell.
    assert!(start(&detected).abs_diff(start(&flagged)) < 20_000_000);
    assert!(!detected.monitor.in_contact(), "the slot has ended");
}
