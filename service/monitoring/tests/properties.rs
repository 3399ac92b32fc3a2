//! Invariants over random telemetry, faults included.

use crate::common::{Columns, PERIOD_NS, config, monitor};
use feedwave_monitoring::{
    Action, Batch, ContactSource, Decision, Event, Evidence, Fallback, Grouping, Length, Monitor, MonitoringConfig,
    SpectrumConfig, SpikeFilter, SpindleRule, SpindleTable,
};
use proptest::prelude::*;

/// A stretch of one deflection, with one fault at its start.
#[derive(Debug, Clone)]
struct Stretch {
    length: usize,
    deflection: [f64; 2],
    contact: bool,
    fault: u8,
}

fn stretch() -> impl Strategy<Value = Stretch> {
    (1usize..900, -0.05..0.05f64, -0.05..0.05f64, prop::bool::weighted(0.8), 0u8..12)
        .prop_map(|(length, x, y, contact, fault)| Stretch { length, deflection: [x, y], contact, fault })
}

fn columns(stretches: &[Stretch]) -> Columns {
    let mut columns = Columns::default();
    columns.add(400, [0.0; 2], false);
    for stretch in stretches {
        let at = columns.len();
        columns.add(stretch.length, stretch.deflection, stretch.contact);
        let end = columns.len().min(at + 300);
        match stretch.fault {
            0 => columns.x[at] = f64::NAN,
            1 => columns.y[at..end].fill(f64::INFINITY),
            2 => columns.x[at..end].fill(1.0),
            3 => columns.time_ns[at] = columns.time_ns[at - 1],
            4 => columns.time_ns[at] -= 20 * PERIOD_NS,
            5 => *columns.time_ns.last_mut().unwrap() += 900 * PERIOD_NS,
            6 => columns.angle_deg[at] = f64::NEG_INFINITY,
            7 => columns.rev_per_min[at] = f64::NAN,
            8 => columns.y[at] = 1e300,
            _ => {}
        }
    }
    columns
}

fn configuration(kind: u8) -> MonitoringConfig {
    let mut config = config();
    config.settling_s = 0.3;
    config.window = Length::Seconds(0.4);
    config.quality.spikes = Some(SpikeFilter { max_step: 0.2, max_run: 2 });
    config.rules.feed.step = 0.2;
    config.rules.fallback = [Fallback::Hold, Fallback::Full, Fallback::Stop][usize::from(kind) % 3];
    config.spectrum = Some(SpectrumConfig {
        samples: 256,
        min_frequency_hz: 5.0,
        noise_floor: 1e-5,
        harmonic_tolerance_hz: 2.0,
        edges: 2,
    });
    config.rules.spindle = match kind % 4 {
        0 => SpindleRule::None,
        1 => SpindleRule::Turning { lower_deg: -1.0, upper_deg: 1.0, step: 0.1, min_concentration: 0.1 },
        _ => SpindleRule::Milling { limit: 0.02, table: SpindleTable::from_pairs(&[(500.0, 450.0), (2000.0, 1500.0)]) },
    };
    if kind.is_multiple_of(5) {
        config.grouping = Grouping::Time { samples_per_point: 7 };
        config.baseline = Length::Seconds(0.3);
    } else if kind % 5 == 1 {
        config.window = Length::Series(3);
        config.contact = ContactSource::Detected { threshold: 0.004, on_samples: 3, off_samples: 9 };
    }
    config
}

fn started(kind: u8) -> Monitor {
    let mut monitor = monitor(configuration(kind));
    monitor.note(Event::ProgrammedSpindle { rev_per_min: 600.0 }, &mut |_| {}).unwrap();
    monitor
}

/// Pushes in batches that end at the cuts; a snapshot is taken and restored at each when asked.
fn run(kind: u8, columns: &Columns, cuts: &[usize], restart: bool) -> (Vec<Decision>, Vec<u8>) {
    let mut monitor = started(kind);
    let mut decisions = Vec::new();
    let mut cuts: Vec<_> = cuts.iter().map(|cut| cut % (columns.len() + 1)).collect();
    cuts.extend([0, columns.len()]);
    cuts.sort_unstable();
    for (sequence, part) in cuts.windows(2).enumerate() {
        let batch: Batch<'_> = columns.batch(sequence as u64, part[0], part[1]);
        monitor.push(&batch, &mut |decision| decisions.push(decision)).unwrap();
        if restart {
            monitor = Monitor::restore(&monitor.snapshot().unwrap()).unwrap();
        }
    }
    let bits = decisions.iter().flat_map(|decision| postcard::to_allocvec(decision).unwrap()).collect();
    (decisions, bits)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_split_gives_the_same_bits(
        kind in 0u8..60,
        stretches in prop::collection::vec(stretch(), 1..12),
        cuts in prop::collection::vec(0usize..12_000, 0..40),
    ) {
        let columns = columns(&stretches);
        let (_, whole) = run(kind, &columns, &[], false);
        let (_, split) = run(kind, &columns, &cuts, false);
        let (_, resumed) = run(kind, &columns, &cuts, true);
        prop_assert_eq!(&whole, &split);
        prop_assert_eq!(&whole, &resumed);
    }

    #[test]
    fn decisions_are_valid(kind in 0u8..60, stretches in prop::collection::vec(stretch(), 1..12)) {
        let columns = columns(&stretches);
        let (decisions, bits) = run(kind, &columns, &[], false);
        let config = configuration(kind);
        let mut before = feedwave_monitoring::Overrides::FULL;
        let mut rest = bits.as_slice();
        for (number, decision) in decisions.iter().enumerate() {
            // The record as it was stored reproduces itself.
            let (stored, next) = postcard::take_from_bytes::<Decision>(rest).unwrap();
            rest = next;
            prop_assert_eq!(&stored, decision);
            prop_assert!(stored.is_reproduced());
            prop_assert_eq!(decision.number, number as u64);
            prop_assert_eq!(decision.inputs.before, before);
            let after = decision.outcome.after;
            let rules = &config.rules;
            // A feed hold is below all bounds, and lasts until the feed is changed.
            let action = decision.outcome.action;
            let is_held = action == Action::HoldFeed || (before.feed == 0.0 && action == Action::Hold);
            let within = (rules.feed_bounds.lower..=rules.feed_bounds.upper).contains(&after.feed);
            prop_assert!(if is_held { after.feed == 0.0 } else { within }, "{:?}", decision.outcome);
            prop_assert!((rules.spindle_bounds.lower..=rules.spindle_bounds.upper).contains(&after.spindle));
            prop_assert_eq!(matches!(action, Action::Change | Action::HoldFeed), after != before);
            if let Evidence::Process(properties) = decision.inputs.evidence {
                prop_assert!(properties.max_deviation.is_finite());
                prop_assert!(decision.span.valid >= u64::from(config.quality.min_valid_samples));
            }
            let span = decision.span;
            let dropped = u64::from(span.removed.dropped);
            let counted = span.valid + span.removed.total() - dropped == span.samples;
            prop_assert!(counted, "every sample of a window is used or counted as removed: {:?}", span);
            before = after;
        }
    }

    #[test]
    fn damaged_snapshots_never_panic_and_short_ones_are_refused(at in 0usize..4000, value in any::<u8>()) {
        let columns = columns(&[Stretch { length: 700, deflection: [0.01, 0.0], contact: true, fault: 9 }]);
        let mut monitor = started(2);
        monitor.push(&columns.batch(0, 0, 900), &mut |_| {}).unwrap();
        let mut bytes = monitor.snapshot().unwrap();
        let length = bytes.len();
        bytes[at % length] = value;
        let _ = Monitor::restore(&bytes);
        bytes.truncate(at % length);
        prop_assert!(Monitor::restore(&bytes).is_err());
    }
}
