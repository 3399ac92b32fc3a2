//! Any configuration is refused with reasons or runs; any telemetry, in any batches, gives decisions that their inputs
//! reproduce, overrides within bounds, and the same again after a restart from a snapshot. Damaged snapshots are refused. The
//! fuzz target `telemetry` and the random tests here run it.

use feedwave_monitoring::{
    Batch, ContactSource, Decision, Escalation, EscalationAction, Event, Evidence, Fallback, Grouping, IdleRunUp,
    Length, Monitor, MonitoringConfig, Overrides, Pair, Property, Quantity, Sensors, SpectrumConfig, SpikeFilter,
    SpindleRule, SpindleTable,
};

/// The input as choices and numbers; zeros when it ends.
struct Source<'a>(&'a [u8]);

impl Source<'_> {
    fn byte(&mut self) -> u8 {
        let Some((&first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        first
    }

    /// Whether something is so that is so once in `n` times.
    fn one_in(&mut self, n: u8) -> bool {
        self.byte().is_multiple_of(n)
    }

    fn bits(&mut self) -> u64 {
        u64::from_le_bytes(std::array::from_fn(|_| self.byte()))
    }

    /// Mostly the common value, else any of 2⁶⁴.
    fn number(&mut self, common: f64) -> f64 {
        match self.byte() {
            0..=239 => common,
            240..=247 => common * f64::from(self.byte()) / 16.0,
            _ => f64::from_bits(self.bits()),
        }
    }

    fn count(&mut self, common: u32) -> u32 {
        match self.byte() {
            0..=239 => common,
            // No more than what a refusal is quick about.
            _ => self.bits() as u32 & 0xF_FFFF,
        }
    }

    fn length(&mut self) -> Length {
        if self.one_in(2) { Length::Seconds(self.number(0.01)) } else { Length::Series(self.count(2)) }
    }

    fn sensors(&mut self) -> Sensors {
        let quantity = match self.byte() % 3 {
            0 => Quantity::Displacement,
            1 => Quantity::Strain { mm_per_strain: self.number(50.0) },
            _ => Quantity::Acceleration,
        };
        Sensors { quantity, min: self.number(0.0), max: self.number(100.0) }
    }
}

// As long as the settings.
fn configuration(source: &mut Source<'_>) -> MonitoringConfig {
    let mut config = MonitoringConfig { sample_rate_hz: source.number(10_000.0), ..MonitoringConfig::default() };
    config.tool = (!source.one_in(8)).then(|| source.sensors());
    config.work = source.one_in(4).then(|| source.sensors());
    if source.one_in(3) {
        config.grouping = Grouping::Time { samples_per_point: source.count(5) };
    } else {
        config.grouping = Grouping::Angle { points: source.count(4) };
    }
    (config.baseline, config.window) = (source.length(), source.length());
    config.tool_check.max_ratio = source.one_in(4).then(|| source.number(0.5));
    config.tool_check.max_run_out = source.one_in(4).then(|| source.number(0.5));
    config.idle_run_up = source.one_in(4).then(|| IdleRunUp {
        spindle_rev_per_min: (0..source.byte() % 70).map(|step| source.number(100.0 + f64::from(step))).collect(),
        speed_tolerance: source.number(0.1),
        length: source.length(),
        max_difference: source.number(1.0),
    });
    if source.one_in(2) {
        let (on_samples, off_samples) = (source.count(2), source.count(5));
        config.contact = ContactSource::Detected { threshold: source.number(0.01), on_samples, off_samples };
    }
    config.settling_s = source.number(0.001);
    config.spectrum = source.one_in(3).then(|| SpectrumConfig {
        samples: source.count(64),
        min_frequency_hz: source.number(20.0),
        noise_floor: source.number(1e-5),
        harmonic_tolerance_hz: source.number(5.0),
        edges: source.count(3),
    });
    let quality = &mut config.quality;
    if source.one_in(2) {
        quality.spikes = Some(SpikeFilter { max_step: source.number(0.1), max_run: source.count(2) });
    }
    (quality.min_valid_samples, quality.stuck_samples) = (source.count(8), source.count(8));
    (quality.max_removed, quality.max_gap_s) = (source.number(0.3), source.number(0.005));
    (quality.silence_s, quality.stale_s) = (source.number(0.01), source.number(0.1));
    let rules = &mut config.rules;
    rules.property = [Property::Deviation, Property::VibrationAmplitude, Property::VibrationFrequency]
        [usize::from(source.byte() % 3)];
    (rules.feed.lower, rules.feed.upper, rules.feed.step) =
        (source.number(0.1), source.number(1.0), source.number(0.1));
    rules.fallback = [Fallback::Hold, Fallback::Full, Fallback::Stop][usize::from(source.byte() % 3)];
    rules.escalation = (!source.one_in(3)).then(|| Escalation {
        windows: source.count(2),
        action: if source.one_in(2) { EscalationAction::Hold } else { EscalationAction::Stop },
    });
    rules.spindle = match source.byte() % 3 {
        0 => SpindleRule::None,
        1 => SpindleRule::Turning {
            lower_deg: source.number(-0.5),
            upper_deg: source.number(0.5),
            step: source.number(0.1),
            min_concentration: source.number(0.1),
        },
        _ => SpindleRule::Milling {
            limit: source.number(1.0),
            table: SpindleTable::from_pairs(&[
                (source.number(500.0), 400.0),
                (source.number(900.0), source.number(800.0)),
            ]),
        },
    };
    config
}

/// Columns of one batch.
#[derive(Default)]
struct Columns {
    time_ns: Vec<u64>,
    values: [Vec<f64>; 10],
    contact: Vec<bool>,
    line: Vec<u32>,
}

impl Columns {
    fn read(source: &mut Source<'_>, sensor_time_ns: &mut u64) -> Self {
        let mut columns = Self::default();
        let kind = source.byte();
        for _ in 0..source.byte() {
            *sensor_time_ns = match source.byte() {
                0..=250 => sensor_time_ns.wrapping_add(100_000),
                251..=253 => sensor_time_ns.wrapping_add(u64::from(source.byte()) << (kind % 24)),
                _ => source.bits(),
            };
            columns.time_ns.push(*sensor_time_ns);
            let small = f64::from(source.byte()) / 256.0;
            for (index, column) in columns.values.iter_mut().enumerate() {
                let common = if index == 6 { *sensor_time_ns as f64 * 1e-6 } else { small * (1.0 + index as f64) };
                column.push(if kind < 32 { source.number(common) } else { common });
            }
            columns.contact.push(!kind.is_multiple_of(8));
            columns.line.push(u32::from(kind));
        }
        columns
    }

    fn batch(&self, sequence: u64, lacking: u8) -> Batch<'_> {
        let [tool_x, tool_y, work_x, work_y, commanded_x, commanded_y, angle, rpm, velocity_x, velocity_y] =
            &self.values;
        let has = |bit: u8| lacking < 224 || lacking & (1 << bit) == 0;
        // A column of another length is refused.
        let short = if lacking == 223 { self.contact.len() / 2 } else { self.contact.len() };
        Batch {
            sequence,
            time_ns: &self.time_ns,
            tool: has(0).then_some(Pair { x: tool_x, y: tool_y }),
            work: has(1).then_some(Pair { x: work_x, y: work_y }),
            commanded: has(2).then_some(Pair { x: commanded_x, y: commanded_y }),
            velocity_mm_per_s: has(5).then_some(Pair { x: velocity_x, y: velocity_y }),
            spindle_angle_deg: has(3).then_some(angle),
            spindle_rev_per_min: has(4).then_some(rpm),
            contact: Some(&self.contact[..short]),
            line: has(6).then_some(&self.line),
        }
    }
}

fn event(source: &mut Source<'_>, sensor_time_ns: u64) -> Event {
    match source.byte() % 8 {
        0 => Event::ProgrammedSpindle { rev_per_min: source.number(600.0) },
        1 => Event::Overrides { feed: source.number(1.0), spindle: source.number(1.0) },
        2 => Event::Threading(source.one_in(2)),
        3 => Event::Tool(u32::from(source.byte() % 2)),
        4 if source.one_in(2) => Event::Resume,
        4 => Event::Rebaseline,
        5 => Event::Clock(source.bits()),
        _ => Event::Clock(sensor_time_ns),
    }
}

/// Takes batches and events from the input; with `restarts` it goes on from a snapshot after each.
fn run(config: &MonitoringConfig, input: &[u8], restarts: bool) -> Vec<Decision> {
    let mut source = Source(input);
    let mut monitor = Monitor::new(config.clone()).expect("nothing is wrong with it");
    let mut decisions = Vec::new();
    let (mut sensor_time_ns, mut sequence) = (0, 0);
    while !source.0.is_empty() {
        let mut sink = |decision| decisions.push(decision);
        if source.one_in(4) {
            // A refused event changes nothing.
            let _ = monitor.note(event(&mut source, sensor_time_ns), &mut sink);
        } else {
            sequence = match source.byte() {
                0..=239 => sequence + 1,
                240..=247 => sequence,
                _ => source.bits() >> 1,
            };
            let columns = Columns::read(&mut source, &mut sensor_time_ns);
            let _ = monitor.push(&columns.batch(sequence, source.byte()), &mut sink);
        }
        if restarts {
            let snapshot = monitor.snapshot().expect("any state can be kept");
            monitor = Monitor::restore(&snapshot).expect("what was kept is whole");
        }
    }
    decisions
}

/// Panics where any of it does not hold; says how many decisions there were, `None` where the configuration was refused.
pub fn check(input: &[u8]) -> Option<usize> {
    let _ = Monitor::restore(input);
    let mut source = Source(input);
    let config = configuration(&mut source);
    let violations = config.violations();
    if !violations.is_empty() {
        assert_eq!(Monitor::new(config).err(), Some(violations));
        return None;
    }
    let decisions = run(&config, source.0, false);
    assert_eq!(decisions, run(&config, source.0, true));
    let bounds = [config.rules.feed_bounds, config.rules.spindle_bounds];
    for decision in &decisions {
        assert!(decision.is_reproduced(), "{decision:?}");
        let Overrides { feed, spindle } = decision.outcome.after;
        for (value, bounds) in [feed, spindle].into_iter().zip(bounds) {
            assert!((bounds.lower..=bounds.upper).contains(&value), "{decision:?}");
        }
        if let Evidence::Process(properties) = decision.inputs.evidence {
            assert!(properties.max_deviation.is_finite(), "{decision:?}");
            assert!(decision.span.valid >= u64::from(config.quality.min_valid_samples), "{decision:?}");
        }
    }
    Some(decisions.len())
}
