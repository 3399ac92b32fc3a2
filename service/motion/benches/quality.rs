//! What planning costs, fast and for the least time, beside what is planned: blocks of 0.2 mm within 0.05 mm on the generic mill,
//! from programmed elements to motion, at a feed that mostly governs and at one that never does.

#[path = "../tests/common/mod.rs"]
mod common;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_motion::{
    CornerSpeed, Element, Joining, Machine, MotionRequest, PathMotion, PathSmoother, Planned, Planner, PlannerSettings,
    Smoothed, limit_pieces, stretches,
};
use feedwave_program::{Feed, Spindle};

const BLOCKS: usize = 10_000;

/// Time of the program, s.
fn plan(elements: &[Element], feed_mm_per_min: f64, machine: &Machine, is_least_time: bool) -> f64 {
    let settings = PlannerSettings::new(machine, 5_000, common::PERIOD_S);
    let (settings, corner_speed) = if is_least_time {
        (settings.for_least_time(machine), CornerSpeed::Changing)
    } else {
        (settings, CornerSpeed::Steady)
    };
    let joining = Joining { machine, many_blocks: true, corner_speed, corners: None };
    let mut smoother = PathSmoother::default();
    let mut planner = Planner::<()>::new(settings);
    let mut time_s = 0.0;
    let mut take = |planner: &mut Planner<()>| {
        while let Some(Planned::Motion(motion)) = planner.pop() {
            time_s += motion.stretches.iter().map(|stretch| stretch.profile.duration()).sum::<f64>();
            black_box(motion);
        }
    };
    let mut push = |Smoothed { element, rest_at_end, .. }: Smoothed<common::Cut>| {
        let pieces =
            limit_pieces(&element, machine, PathMotion::ZERO, feed_mm_per_min / 30.0).expect("nothing else moves");
        let stretches = stretches(&element, Feed::PerMinute(feed_mm_per_min), &Spindle::STOPPED, machine, &pieces);
        let mut request = MotionRequest::new(element, stretches);
        request.rest_at_end = rest_at_end;
        planner.push_motion(request);
        take(&mut planner);
    };
    for element in elements {
        smoother.push(element.clone(), common::within(0.05), common::Cut, joining, &mut push);
    }
    smoother.flush(joining, &mut push);
    planner.finish();
    take(&mut planner);
    time_s
}

fn qualities(criterion: &mut Criterion) {
    let machine = Machine::mill();
    let elements = common::ripples(BLOCKS).elements();
    let mut group = criterion.benchmark_group("quality");
    group.throughput(Throughput::Elements(BLOCKS as u64)).sample_size(10);
    for feed_mm_per_min in [6_000.0, 60_000.0] {
        for (name, is_least_time) in [("fast", false), ("least time", true)] {
            let time_s = plan(&elements, feed_mm_per_min, &machine, is_least_time);
            println!("{name} at F{feed_mm_per_min}: {time_s:.2} s of machining");
            group.bench_function(format!("{name} F{feed_mm_per_min}"), |bencher| {
                bencher.iter(|| plan(&elements, feed_mm_per_min, &machine, is_least_time));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, qualities);
criterion_main!(benches);
