//! Simulated samples per second and core, beside drawing the noise alone.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_simulator::{Contact, Description, Setpoints, Simulator, Where};
use std::hint::black_box;

/// A second of setpoints at 1 ms.
const SETPOINTS: usize = 1000;

fn description(regenerative: bool) -> Description {
    Description {
        regenerative,
        contacts: vec![Contact { at: Where::Path { from_mm: 0.0, to_mm: 1e9 }, depth_mm: 1.0 }],
        sample_rate_hz: 100_000,
        batch_samples: 1000,
        ..Description::default()
    }
}

fn simulator(criterion: &mut Criterion) {
    let path: Vec<f64> = (0..SETPOINTS).map(|index| 0.01 * index as f64).collect();
    let feed = vec![600.0; SETPOINTS];
    let angle: Vec<f64> = (0..SETPOINTS).map(|index| 18.0 * index as f64).collect();
    let line = vec![1; SETPOINTS];
    let setpoints = Setpoints {
        first_index: 0,
        axes_mm: None,
        path_position_mm: &path,
        feed_mm_per_min: &feed,
        spindle_angle_deg: &angle,
        line: &line,
    };
    let mut group = criterion.benchmark_group("simulator");
    group.throughput(Throughput::Elements(99_900));
    for (name, regenerative) in [("four edges", false), ("four edges, regenerative", true)] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let mut machine = Simulator::new(description(regenerative)).expect("a possible description");
                let mut samples = 0;
                machine
                    .push(&setpoints, &mut |batch| samples += black_box(batch).time_ns.len())
                    .expect("possible setpoints");
                // 99.9 batches of simulated time; the last one is not full yet.
                assert_eq!(samples, 99_000);
                samples
            });
        });
    }
    group.finish();
}

criterion_group!(benches, simulator);
criterion_main!(benches);
