//! Five-axis poses per second and core: a great circle on a table-table machine, one inverse solution per setpoint.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_motion::kinematics::{
    BranchPreference, ChainAxis, DirectionPath, FiveAxisSegment, GreatCircle, Kinematics, KinematicsDescription, Setup,
    Wrap,
};
use feedwave_program::Axis;

const SETPOINTS: u32 = 4_096;

fn axis(axis: Axis, direction: [f64; 3], point_mm: [f64; 3]) -> ChainAxis {
    ChainAxis { axis, direction, point_mm, range: None, wrap: Wrap::Counting }
}

fn poses(criterion: &mut Criterion) {
    let chain = vec![
        axis(Axis::C, [0.0, 0.0, 1.0], [10.0, 5.0, 0.0]),
        axis(Axis::A, [1.0, 0.0, 0.0], [0.0, 5.3, 40.0]),
        axis(Axis::X, [1.0, 0.0, 0.0], [0.0; 3]),
        axis(Axis::Y, [0.0, 1.0, 0.0], [0.0; 3]),
        axis(Axis::Z, [0.0, 0.0, 1.0], [0.0; 3]),
    ];
    let description = KinematicsDescription {
        chain,
        gauge_point_mm: [0.0, 0.0, 500.0],
        tool_direction: [0.0, 0.0, 1.0],
        preferred_branch: BranchPreference::Nearest,
    };
    let machine = Kinematics::new(&description).expect("a sound machine");
    let circle = GreatCircle::new([0.0, 0.6, 0.8], [0.6, 0.0, 0.8]).expect("not opposite");
    let great_circle = DirectionPath::GreatCircle(circle);
    let angles = DirectionPath::Angles { start_rad: [0.0, 0.5], end_rad: [1.0, 0.6] };
    let setup = Setup::new([0.0; 3], 100.0);
    let mut group = criterion.benchmark_group("five axes");
    group.throughput(Throughput::Elements(u64::from(SETPOINTS)));
    for (name, direction) in [("great circle", great_circle), ("angles", angles)] {
        let segment = FiveAxisSegment { start_mm: [0.0; 3], end_mm: [50.0, 20.0, 5.0], direction };
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let mut reference = [0.0, 0.5];
                for index in 0..SETPOINTS {
                    let share = f64::from(index) / f64::from(SETPOINTS);
                    if let Ok(solution) = segment.joints(&machine, &setup, share, reference) {
                        reference = solution.joints.rotary_rad;
                        black_box(solution);
                    }
                }
            });
        });
    }
    group.finish();
}

criterion_group!(benches, poses);
criterion_main!(benches);
