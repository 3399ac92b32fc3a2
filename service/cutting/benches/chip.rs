//! Chip analysis beside a plain sampling of the same thickness, and the wave beside `libm::sin`.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use feedwave_cutting::{
    CutCondition, FeedCoupling, LinearSpan, SpanFeed, SurfaceSpeedAnalysis, analyse, fill_sin_turns, thickness,
};

fn cut(vibrations_per_rev: f64, amplitude_ratio: f64) -> CutCondition {
    CutCondition {
        feed_per_rev_mm: 0.01,
        amplitude_mm: 0.005 * amplitude_ratio,
        frequency_hz: vibrations_per_rev * 1_000.0 / 60.0,
        spindle_rev_per_min: 1_000.0,
        diameter_mm: 20.0,
        feed_coupling: FeedCoupling::PerRevolution,
    }
}

/// Air share and largest thickness from a thousand phases: three digits at best, where the analysis has nine.
fn sampled(condition: &CutCondition) -> (f64, f64) {
    let samples = (0..1_000u32).map(|i| thickness(condition, std::f64::consts::TAU * f64::from(i) / 1_000.0));
    let (air, largest_mm) = samples.fold((0u32, f64::NEG_INFINITY), |(air, largest_mm), thickness_mm| {
        (air + u32::from(thickness_mm <= 0.0), largest_mm.max(thickness_mm))
    });
    (f64::from(air) / 1_000.0, largest_mm)
}

fn chip(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("chip");
    for (name, condition) in [
        ("in phase", cut(3.0, 6.0)),
        ("half-integer", cut(2.5, 6.0)),
        ("golden", cut(2.618_033_988_749_895, 60.0)),
        ("absurd", cut(2.618_033_988_749_895, 1e6)),
        ("absurd and nearly in phase", cut(3.0 + 1e-6, 2e6)),
    ] {
        group.bench_with_input(BenchmarkId::new("analyse", name), &condition, |bencher, condition| {
            bencher.iter(|| analyse(black_box(condition)));
        });
    }
    let golden = cut(2.618_033_988_749_895, 60.0);
    group.bench_function("sampled/golden", |bencher| bencher.iter(|| sampled(black_box(&golden))));
    let facing = LinearSpan {
        line: 1,
        start_mm: 0.0,
        length_mm: 39.0,
        start_radius_mm: 40.0,
        end_radius_mm: 1.0,
        frequency_hz: 60.0,
        amplitude_mm: 0.04,
        feed: SpanFeed::PerMinute(50.0),
        surface_speed_m_per_min: 150.0,
        max_rev_per_min: 3_000.0,
    };
    group.bench_function("surface speed", |bencher| {
        bencher.iter(|| {
            let mut analysis = SurfaceSpeedAnalysis::default();
            analysis.add(black_box(&facing));
            analysis.finish()
        });
    });
    group.finish();
}

fn wave(criterion: &mut Criterion) {
    let turns: Vec<f64> = (0..1_024).map(|i| f64::from(i) * 0.05).collect();
    let mut waves = vec![0.0; turns.len()];
    let mut group = criterion.benchmark_group("wave");
    group.throughput(Throughput::Elements(turns.len() as u64));
    group.bench_function("fill_sin_turns", |bencher| {
        bencher.iter(|| fill_sin_turns(black_box(&turns), black_box(&mut waves)));
    });
    group.bench_function("libm::sin", |bencher| {
        bencher.iter(|| {
            for (wave, &phase) in black_box(&mut waves).iter_mut().zip(black_box(&turns)) {
                *wave = libm::sin(std::f64::consts::TAU * (phase - phase.round()));
            }
        });
    });
    group.finish();
}

criterion_group!(benches, chip, wave);
criterion_main!(benches);
