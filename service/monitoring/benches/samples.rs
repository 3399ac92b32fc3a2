//! Samples per second and core into decisions, beside a loop that only copies the columns and finds the largest value.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_monitoring::{
    Batch, Event, Length, Monitor, MonitoringConfig, Pair, SpectrumConfig, SpikeFilter, SpindleRule, SpindleTable,
};
use std::hint::black_box;

/// Ten seconds at 20 kHz.
const SAMPLES: usize = 200_000;

struct Columns {
    time_ns: Vec<u64>,
    x: Vec<f64>,
    y: Vec<f64>,
    angle_deg: Vec<f64>,
    rev_per_min: Vec<f64>,
    contact: Vec<bool>,
}

fn columns() -> Columns {
    let noise = |index: usize| 1e-4 * ((index * 7919 % 1009) as f64 / 500.0 - 1.0);
    let push = |index: usize| if index < 5000 { 0.0 } else { 0.005 };
    Columns {
        time_ns: (0..SAMPLES as u64).map(|index| index * 50_000).collect(),
        x: (0..SAMPLES).map(|index| 1.0 + push(index) + noise(index)).collect(),
        y: (0..SAMPLES).map(|index| 1.0 - noise(index + 3)).collect(),
        angle_deg: (0..SAMPLES).map(|index| 360.0 * 50.0 * index as f64 / 20_000.0).collect(),
        rev_per_min: vec![3000.0; SAMPLES],
        contact: (0..SAMPLES).map(|index| index >= 5000).collect(),
    }
}

fn config(spectrum: bool) -> MonitoringConfig {
    let mut config = MonitoringConfig { settling_s: 0.1, window: Length::Seconds(0.5), ..MonitoringConfig::default() };
    config.quality.spikes = Some(SpikeFilter { max_step: 0.1, max_run: 3 });
    config.rules.spindle =
        SpindleRule::Milling { limit: 0.02, table: SpindleTable::from_pairs(&[(2000.0, 1800.0), (4000.0, 3500.0)]) };
    config.spectrum = spectrum.then_some(SpectrumConfig {
        samples: 8192,
        min_frequency_hz: 20.0,
        noise_floor: 1e-5,
        harmonic_tolerance_hz: 5.0,
        edges: 4,
    });
    config
}

fn samples(criterion: &mut Criterion) {
    let columns = columns();
    let mut group = criterion.benchmark_group("samples");
    group.throughput(Throughput::Elements(SAMPLES as u64));
    for (name, spectrum) in [("decisions", false), ("decisions with spectrum", true)] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let mut monitor = Monitor::new(config(spectrum)).expect("the configuration is valid");
                let mut decisions = 0;
                let mut sink = |decision| {
                    black_box(decision);
                    decisions += 1;
                };
                monitor.note(Event::ProgrammedSpindle { rev_per_min: 3000.0 }, &mut sink).expect("a possible speed");
                for (sequence, from) in (0..SAMPLES).step_by(2000).enumerate() {
                    let part = from..from + 2000;
                    let batch = Batch {
                        sequence: sequence as u64,
                        time_ns: &columns.time_ns[part.clone()],
                        tool: Some(Pair { x: &columns.x[part.clone()], y: &columns.y[part.clone()] }),
                        spindle_angle_deg: Some(&columns.angle_deg[part.clone()]),
                        spindle_rev_per_min: Some(&columns.rev_per_min[part.clone()]),
                        contact: Some(&columns.contact[part]),
                        ..Batch::default()
                    };
                    monitor.push(&batch, &mut sink).expect("a readable batch");
                }
                assert!(decisions > 15, "{decisions} decisions");
                decisions
            });
        });
    }
    group.bench_function("copy and largest value", |bencher| {
        let mut copies = [vec![0.0; SAMPLES], vec![0.0; SAMPLES], vec![0.0; SAMPLES], vec![0.0; SAMPLES]];
        bencher.iter(|| {
            let mut largest = f64::MIN;
            for (copy, column) in
                copies.iter_mut().zip([&columns.x, &columns.y, &columns.angle_deg, &columns.rev_per_min])
            {
                copy.copy_from_slice(column);
                largest = black_box(&*copy).iter().copied().fold(largest, f64::max);
            }
            largest
        });
    });
    group.finish();
}

criterion_group!(benches, samples);
criterion_main!(benches);
