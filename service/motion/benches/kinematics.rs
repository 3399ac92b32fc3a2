//! Five-axis motion on a table-table machine, per second and core: setpoints of elements by columns, blocks of a CAM
//! program made into elements, and poses solved one by one.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_motion::kinematics::vector::add_scaled;
use feedwave_motion::kinematics::{
    BranchPreference, ChainAxis, DirectionPath, FiveAxisBlock, FiveAxisSegment, GreatCircle, Kinematics,
    KinematicsDescription, Setup, Toward, Wrap,
};
use feedwave_motion::{Machine, MachineAxis, PathMotion, limit_pieces};
use feedwave_program::{Axis, SourceSpan};

const SETPOINTS: u32 = 4_096;
const AXES: [Axis; 5] = [Axis::X, Axis::Y, Axis::Z, Axis::C, Axis::A];

fn axis(axis: Axis, direction: [f64; 3], point_mm: [f64; 3]) -> ChainAxis {
    ChainAxis { axis, direction, point_mm, range: None, wrap: Wrap::Counting }
}

fn block(end_mm: [f64; 3], toward: Toward) -> FiveAxisBlock<'static> {
    FiveAxisBlock { end_mm, curve: None, toward, pole_tolerance_rad: 0.0, source: SourceSpan::default(), rapid: false }
}

/// A table that carries the work on C and A.
fn table() -> Kinematics {
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
    Kinematics::new(&description).expect("a valid machine")
}

/// The inverse solution at every place of a segment.
fn poses(criterion: &mut Criterion) {
    let (machine, setup) = (table(), Setup::new([0.0; 3], 100.0));
    let circle = GreatCircle::new([0.0, 0.6, 0.8], [0.6, 0.0, 0.8]).expect("not opposite");
    let great_circle = DirectionPath::GreatCircle(circle);
    let angles = DirectionPath::Angles { start_rad: [0.0, 0.5], end_rad: [1.0, 0.6] };
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

/// The axes of an element that was solved.
fn columns(criterion: &mut Criterion) {
    let (machine, setup) = (table(), Setup::new([0.0; 3], 100.0));
    let mut group = criterion.benchmark_group("five axes");
    group.throughput(Throughput::Elements(u64::from(SETPOINTS)));
    let start = machine.point_with([0.0; 3], [0.0, 30.0], &[0.0; 9], &setup).expect("a pose");
    let angles = Toward::Angles([57.0, 35.0]);
    let vector = Toward::Vector([0.6, 0.0, 0.8]);
    for (name, toward) in [("columns, great circle", vector), ("columns, angles", angles)] {
        let element = machine.elements(&setup, &start, &block([50.0, 20.0, 5.0], toward)).expect("possible").elements;
        let places: Vec<f64> =
            (0..SETPOINTS).map(|k| element[0].length * f64::from(k) / f64::from(SETPOINTS)).collect();
        let mut column = vec![0.0; places.len()];
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                for axis in AXES {
                    element[0].fill_axis(axis, black_box(&places), &mut column);
                    black_box(&column);
                }
            });
        });
    }
    group.finish();
}

/// Solving an element, and its limits.
fn blocks(criterion: &mut Criterion) {
    let (machine, setup) = (table(), Setup::new([0.0; 3], 100.0));
    let mut group = criterion.benchmark_group("five axes");
    let start = machine.point_with([0.0; 3], [0.0, 30.0], &[0.0; 9], &setup).expect("a pose");
    let limits =
        Machine { axes: AXES.map(|axis| MachineAxis::new(axis, 300.0, 3_000.0, 1e6)).to_vec(), ..Machine::mill() };
    // One degree in a millimetre.
    let angles = Toward::Angles([0.8, 30.6]);
    let vector = Toward::Vector(add_scaled(start.direction, [0.6, 0.0, 0.8], 0.02));
    group.throughput(Throughput::Elements(1));
    for (name, toward) in [("blocks, great circle", vector), ("blocks, angles", angles)] {
        let block = block([0.8, 0.6, 0.1], toward);
        group.bench_function(name, |bencher| bencher.iter(|| machine.elements(&setup, &start, black_box(&block))));
        let element = machine.elements(&setup, &start, &block).expect("possible").elements.remove(0);
        let name = format!("{name}: limits");
        group.bench_function(name, |bencher| {
            bencher.iter(|| limit_pieces(black_box(&element), &limits, PathMotion::ZERO, 200.0));
        });
    }
    group.finish();
}

criterion_group!(benches, poses, columns, blocks);
criterion_main!(benches);
