//! Setpoints per second and core: profile, lines and arcs on three axes, beside a plain sine and copy loop over as many
//! values in the same run.

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_motion::{Element, Machine, PathLimits, PathMotion, Profile, limit_pieces};
use feedwave_program::{
    ArcGeometry, Axis, Feed, Move, MoveKind, PathControl, Plane, SourceSpan, Spindle, SplineGeometry,
};

const SETPOINTS: usize = 4_096;
const PERIOD_S: f64 = 1e-3;

/// A `G5`: an S of two turns that rises.
fn cubic() -> Move {
    let points = vec![[0.0, 0.0], [0.0, 60.0], [40.0, -40.0], [40.0, 20.0]];
    let geometry = SplineGeometry { plane: Plane::Xy, order: 4, points, weights: vec![1.0; 4] };
    Move {
        kind: MoveKind::Cutting,
        start: [0.0; 9],
        end: [40.0, 20.0, 10.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        work_offset: [0.0; 9],
        arc: None,
        feed: Feed::PerMinute(1_000.0),
        spindle: Spindle::STOPPED,
        tool: 0,
        spline: Some(Box::new(geometry)),
        path_control: PathControl::default(),
        leads_xyz: false,
        cycle: None,
    }
}

fn element(radius_mm: Option<f64>) -> Element {
    let mut start = [0.0; 9];
    let mut end = [0.0; 9];
    let arc = radius_mm.map(|radius_mm| {
        start[0] = radius_mm;
        end[1] = radius_mm;
        ArcGeometry { plane: Plane::Xy, center: [0.0, 0.0], clockwise: false, sweep_rad: TAU / 4.0 }
    });
    if arc.is_none() {
        end = [30.0, 40.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    }
    end[2] = 20.0;
    let mv = Move {
        kind: MoveKind::Cutting,
        start,
        end,
        work_offset: [0.0; 9],
        arc,
        feed: Feed::PerMinute(1_000.0),
        spindle: Spindle::STOPPED,
        tool: 0,
        spline: None,
        path_control: PathControl::default(),
        leads_xyz: false,
        cycle: None,
    };
    Element::from_move(&mv, SourceSpan::default()).expect("it moves")
}

fn filling(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("filling");
    group.throughput(Throughput::Elements(SETPOINTS as u64));
    let mut s = vec![0.0; SETPOINTS];
    let mut v = vec![0.0; SETPOINTS];
    let mut axes = vec![vec![0.0; SETPOINTS]; 3];

    group.bench_function("sine and copy", |bencher| {
        let phases: Vec<f64> = (0..SETPOINTS).map(|k| 1e-3 * k as f64).collect();
        bencher.iter(|| {
            for (out, phase) in s.iter_mut().zip(black_box(&phases)) {
                *out = libm::sin(*phase);
            }
            for axis in &mut axes {
                axis.copy_from_slice(&s);
            }
            black_box(&mut axes);
        });
    });

    group.bench_function("profile", |bencher| {
        let limits = PathLimits { velocity: 100.0, acceleration: 500.0, jerk: 2_000.0 };
        // Four seconds, of which every phase has a part.
        let profile = Profile::solve(350.0, 0.0, 0.0, limits).expect("rest to rest fits");
        bencher.iter(|| profile.fill(black_box(0), PERIOD_S, 0.0, black_box(&mut s), black_box(&mut v)));
    });

    for (name, element) in [
        ("line, three axes", element(None)),
        ("arc, three axes", element(Some(50.0))),
        ("arc of a huge radius, three axes", element(Some(1e6))),
        ("spline, three axes", Element::from_move(&cubic(), SourceSpan::default()).expect("it moves")),
    ] {
        for (k, s) in s.iter_mut().enumerate() {
            *s = element.length * k as f64 / SETPOINTS as f64;
        }
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                for (axis, out) in [Axis::X, Axis::Y, Axis::Z].into_iter().zip(&mut axes) {
                    element.fill_axis(axis, black_box(&s), black_box(out));
                }
            });
        });
    }
    group.finish();
}

/// What a spline costs before it moves, per block.
fn preparing(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("preparing a spline");
    let mv = cubic();
    let element = Element::from_move(&mv, SourceSpan::default()).expect("it moves");
    let machine = Machine::mill();
    group.bench_function("by arc length", |bencher| {
        bencher.iter(|| Element::from_move(black_box(&mv), SourceSpan::default()));
    });
    group.bench_function("limits", |bencher| {
        bencher.iter(|| limit_pieces(black_box(&element), &machine, PathMotion::ZERO, f64::INFINITY));
    });
    group.finish();
}

criterion_group!(benches, filling, preparing);
criterion_main!(benches);
