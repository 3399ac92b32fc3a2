//! Blocks thinned per second and core, in groups of 10 000: a wave with flickering directions, by great circles and with
//! the optional tolerance on the interpolated direction.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_cutting::thinning::{CutPoint, DirectionInterpolation, Thinner, ThinningMethod, ThinningSettings};
use feedwave_motion::kinematics::vector::unit;

const BLOCKS: u32 = 100_000;

/// A surface's pass: 0.3 mm steps over a gentle wave, directions that flicker by half a degree.
fn program() -> Vec<CutPoint> {
    let block = |line: u32| {
        let x = 0.3 * f64::from(line);
        let flicker = if line.is_multiple_of(2) { 0.005 } else { -0.005 };
        let direction = unit([0.05 * libm::sin(x / 40.0) + flicker, 0.3, 1.0]).unwrap_or_default();
        let tip_mm = [x, 0.002 * libm::sin(7.0 * x), libm::cos(x / 40.0)];
        CutPoint { line, tip_mm, direction, rotary_rad: Some([flicker, 0.3]), feed_word: None }
    };
    (1..=BLOCKS).map(block).collect()
}

fn thinning(criterion: &mut Criterion) {
    let program = program();
    let mut group = criterion.benchmark_group("thinning");
    group.throughput(Throughput::Elements(u64::from(BLOCKS)));
    for (name, interpolated_direction_tolerance_deg) in [("flow chart", None), ("bounded direction", Some(1.0))] {
        let settings = ThinningSettings {
            angle_tolerance_deg: 2.0,
            distance_tolerance_mm: 0.01,
            group_blocks: 10_000,
            interpolated_direction_tolerance_deg,
            method: ThinningMethod::Published,
        };
        let thinner = Thinner::new(settings, DirectionInterpolation::GreatCircle);
        let Ok(mut thinner) = thinner else { continue };
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                for point in &program {
                    thinner.push(*point, point.line, &mut |kept| {
                        black_box(kept);
                    });
                }
                thinner.flush(&mut |kept| {
                    black_box(kept);
                });
                black_box(thinner.report())
            });
        });
    }
    group.finish();
}

criterion_group!(benches, thinning);
criterion_main!(benches);
