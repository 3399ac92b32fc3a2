//! Short blocks planned per second and core: a chain of tangent lines, and a chain with a corner at every block. Beside
//! them what cannot be avoided: moving the same elements through a queue.

use std::collections::VecDeque;
use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_motion::{Element, Machine, MotionRequest, PathMotion, Planner, PlannerSettings, limit_pieces, stretches};
use feedwave_program::{Feed, Move, MoveKind, PathControl, Position, SourceSpan, Spindle};

const BLOCKS: u32 = 10_000;

/// Lines of 0.1 mm, each turned from the one before by `turn_rad`.
fn requests(turn_rad: f64, machine: &Machine) -> Vec<MotionRequest> {
    let mut at: Position = [0.0; 9];
    let line = |index: u32| {
        let start = at;
        let (sin, cos) = (f64::from(index) * turn_rad).sin_cos();
        at[0] += 0.1 * cos;
        at[1] += 0.1 * sin;
        let feed = Feed::PerMinute(3_000.0);
        let mv = Move {
            kind: MoveKind::Cutting,
            start,
            end: at,
            work_offset: [0.0; 9],
            arc: None,
            feed,
            spindle: Spindle::STOPPED,
            tool: 0,
            spline: None,
            path_control: PathControl::default(),
            leads_xyz: false,
            cycle: None,
        };
        let element = Element::from_move(&mv, SourceSpan::default()).expect("it moves");
        let limits = limit_pieces(&element, machine, PathMotion::ZERO, f64::INFINITY).expect("nothing is superposed");
        let stretches = stretches(&element, feed, &Spindle::STOPPED, machine, &limits);
        MotionRequest::new(element, stretches)
    };
    (0..BLOCKS).map(line).collect()
}

fn planning(criterion: &mut Criterion) {
    let machine = Machine::mill();
    let settings = PlannerSettings::new(&machine, 5_000, 1e-3);
    let mut group = criterion.benchmark_group("planning");
    group.throughput(Throughput::Elements(u64::from(BLOCKS)));
    let smooth = requests(1e-4, &machine);
    group.bench_function("queue only", |bencher| {
        bencher.iter(|| {
            let mut queue = VecDeque::new();
            for request in &smooth {
                queue.push_back(request.clone());
                if queue.len() > 512 {
                    black_box(queue.pop_front());
                }
            }
        });
    });
    for (name, turn_rad) in [("tangent chain", 1e-4), ("corner at every block", 0.1)] {
        let requests = requests(turn_rad, &machine);
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let mut planner = Planner::<()>::new(settings.clone());
                for request in &requests {
                    planner.push_motion(request.clone());
                    while let Some(planned) = planner.pop() {
                        black_box(planned);
                    }
                }
                planner.finish();
            });
        });
    }
    group.finish();
}

/// Longest that one block has kept the planner, which plans a whole window now and then: the mean says nothing about it.
fn longest_push(criterion: &mut Criterion) {
    let machine = Machine::mill();
    for (window, turn_rad) in [(1_000, 1e-4), (5_000, 1e-4), (5_000, 0.0)] {
        let settings = PlannerSettings::new(&machine, window, 1e-3);
        let requests = requests(turn_rad, &machine);
        let mut longest = Vec::new();
        for _ in 0..20 {
            let mut planner = Planner::<()>::new(settings.clone());
            let push = |request: &MotionRequest| {
                let request = request.clone();
                let start = Instant::now();
                planner.push_motion(request);
                let passed = start.elapsed();
                while let Some(planned) = planner.pop() {
                    black_box(planned);
                }
                passed
            };
            longest.extend(requests.iter().map(push).max());
        }
        longest.sort();
        let median = longest[longest.len() / 2];
        println!(
            "longest push of {BLOCKS} blocks, window {window}, turning {turn_rad} rad each: median of 20 runs {median:?}"
        );
    }
    let _ = criterion;
}

criterion_group!(benches, planning, longest_push);
criterion_main!(benches);
