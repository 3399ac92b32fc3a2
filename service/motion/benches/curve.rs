//! One curve over many blocks: blocks per second and core of programs of short blocks, beside rounding each corner by
//! itself.

#[path = "../tests/common/mod.rs"]
mod common;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_motion::{CornerSpeed, Joining, PathSmoother};

fn smoothing(criterion: &mut Criterion) {
    let machine = common::machine();
    let mut group = criterion.benchmark_group("smoothing");
    for program in [common::chord_circle(), common::raster(), common::freeform()] {
        let elements = program.elements();
        group.throughput(Throughput::Elements(elements.len() as u64));
        for (way, many_blocks) in [("one curve", true), ("each corner", false)] {
            group.bench_function(format!("{} {way}", program.name), |bencher| {
                bencher.iter(|| {
                    let joining =
                        Joining { machine: &machine, many_blocks, corner_speed: CornerSpeed::Steady, corners: None };
                    let mut smoother = PathSmoother::default();
                    let mut emit = |smoothed| {
                        black_box(smoothed);
                    };
                    for element in &elements {
                        smoother.push(element.clone(), common::within(0.02), common::Cut, joining, &mut emit);
                    }
                    smoother.flush(joining, &mut emit);
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, smoothing);
criterion_main!(benches);
