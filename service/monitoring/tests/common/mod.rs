//! Synthetic telemetry: a spindle at a steady speed with a deflection that the test chooses.
#![allow(dead_code, reason = "every test file uses its part")]

pub mod any_bytes;

use feedwave_monitoring::{
    Batch, Decision, Event, Grouping, Length, Monitor, MonitoringConfig, Pair, Quality, Rules, ToolCheck,
};

/// Columns that grow sample by sample.
#[derive(Debug, Clone, Default)]
pub struct Columns {
    pub time_ns: Vec<u64>,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    pub angle_deg: Vec<f64>,
    pub rev_per_min: Vec<f64>,
    pub contact: Vec<bool>,
}

pub const PERIOD_NS: u64 = 1_000_000;
/// 600 rev/min at 1 kHz: 100 samples in a revolution.
pub const RPM: f64 = 600.0;

impl Columns {
    /// Adds `count` samples with the given deflection; noise of ±1e-6 mm keeps the sensors from looking stuck.
    pub fn add(&mut self, count: usize, deflection: [f64; 2], contact: bool) -> &mut Self {
        for _ in 0..count {
            let index = self.time_ns.len() as u64;
            let last = self.time_ns.last().map_or(0, |last| last + PERIOD_NS);
            let noise = 1e-6 * ((index * 7919 % 101) as f64 / 50.0 - 1.0);
            self.time_ns.push(last);
            self.x.push(1.0 + deflection[0] + noise);
            self.y.push(1.0 + deflection[1] - noise);
            self.angle_deg.push(360.0 * (RPM / 60.0) * 1e-3 * index as f64 + 0.005);
            self.rev_per_min.push(RPM);
            self.contact.push(contact);
        }
        self
    }

    pub fn len(&self) -> usize {
        self.time_ns.len()
    }

    pub fn batch(&self, sequence: u64, from: usize, to: usize) -> Batch<'_> {
        Batch {
            sequence,
            time_ns: &self.time_ns[from..to],
            tool: Some(Pair { x: &self.x[from..to], y: &self.y[from..to] }),
            spindle_angle_deg: Some(&self.angle_deg[from..to]),
            spindle_rev_per_min: Some(&self.rev_per_min[from..to]),
            contact: Some(&self.contact[from..to]),
            ..Batch::default()
        }
    }
}

/// 36 points, baseline of 3 series, settling 2 s, windows of 1 s, the default rules with p = 2 %.
pub fn config() -> MonitoringConfig {
    let mut rules = Rules::default();
    rules.feed.step = 0.02;
    MonitoringConfig {
        sample_rate_hz: 1000.0,
        grouping: Grouping::Angle { points: 36 },
        baseline: Length::Series(3),
        tool_check: ToolCheck { max_ratio: Some(0.01), max_run_out: None },
        settling_s: 2.0,
        window: Length::Seconds(1.0),
        quality: Quality {
            min_valid_samples: 250,
            stuck_samples: 250,
            max_gap_s: 0.01,
            ..MonitoringConfig::default().quality
        },
        rules,
        ..MonitoringConfig::default()
    }
}

pub fn monitor(config: MonitoringConfig) -> Monitor {
    Monitor::new(config).unwrap_or_else(|violations| panic!("{violations:?}"))
}

/// Pushes everything as one batch.
pub fn run(monitor: &mut Monitor, columns: &Columns) -> Vec<Decision> {
    let sequence = monitor.newest_batch().map_or(0, |newest| newest + 1);
    let mut decisions = Vec::new();
    monitor.push(&columns.batch(sequence, 0, columns.len()), &mut |decision| decisions.push(decision)).unwrap();
    decisions
}

pub fn note(monitor: &mut Monitor, event: Event) -> Vec<Decision> {
    let mut decisions = Vec::new();
    monitor.note(event, &mut |decision| decisions.push(decision)).unwrap();
    decisions
}

/// Baseline (400 samples), then contact with this deflection through settling (2 s) and `windows` windows of 1 s.
pub fn cutting(deflection: [f64; 2], windows: usize) -> Columns {
    let mut columns = Columns::default();
    columns.add(400, [0.0; 2], false).add(2001 + 1000 * windows, deflection, true);
    columns
}
