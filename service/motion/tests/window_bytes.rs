//! The planner's window is bounded by the memory that it takes, whatever its elements are.

use core::mem::size_of;

use feedwave_motion::{
    Ahead, Curve, Element, Machine, MachineAxis, MachineKind, MotionRequest, PathMotion, Planned, Planner,
    PlannerSettings, Spline, limit_pieces, stretches,
};
use feedwave_program::{Axis, Feed, Position, SourceSpan, Spindle};

const PERIOD_S: f64 = 1e-3;
/// A piece of a spline: start, length, its inverse, and ten coefficients of three axes.
const PIECE_BYTES: usize = (3 + 3 * 10) * size_of::<f64>();
/// Elements of the window, far more than the memory is for.
const WINDOW: usize = 100_000;

fn machine() -> Machine {
    let axes = [Axis::X, Axis::Y, Axis::Z].map(|axis| MachineAxis::new(axis, 200.0, 2_000.0, 30_000.0));
    Machine { kind: MachineKind::Mill, axes: axes.to_vec(), max_spindle_rev_per_min: 20_000.0 }
}

/// One of many tangent parts of a wave, each a spline of so many spans of 0.1 mm.
fn part(number: u32, spans: u32) -> Element {
    let at = |k: u32| {
        let x = 0.1 * f64::from(k);
        ([x, (0.5 * x).sin(), 0.0], [1.0, 0.5 * (0.5 * x).cos(), 0.0])
    };
    let third = |point: [f64; 3], slope: [f64; 3], mm: f64| [0, 1, 2].map(|axis| point[axis] + mm * slope[axis]);
    let points: Vec<_> = (0..spans)
        .map(|span| {
            let [(from, leaves), (to, arrives)] = [0, 1].map(|end| at(number * spans + span + end));
            [from, third(from, leaves, 0.1 / 3.0), third(to, arrives, -0.1 / 3.0), to]
        })
        .collect();
    let spline = Spline::from_cubic_spans(&points).expect("it is smooth");
    let position = |point: [f64; 3]| -> Position { [point[0], point[1], point[2], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
    let [start, end] = [points[0][0], points[points.len() - 1][3]].map(position);
    Element::from_spline(start, end, spline, [0.0; 9], SourceSpan::default(), false).expect("its ends are its own")
}

fn request(element: Element, machine: &Machine, mm_per_min: f64) -> MotionRequest {
    let pieces = limit_pieces(&element, machine, PathMotion::ZERO, f64::INFINITY).expect("nothing is superposed");
    let stretches = stretches(&element, Feed::PerMinute(mm_per_min), &Spindle::STOPPED, machine, &pieces);
    MotionRequest::new(element, stretches)
}

/// Memory of what waits, counted by its known sizes; the elements; and what the planner counts.
fn waiting(planner: &Planner<u32>) -> [usize; 3] {
    let sizes = planner.waiting().map(|item| match item {
        Ahead::Motion(request) => {
            let pieces = match &request.element.curve {
                Curve::Spline(spline) => spline.piece_count(),
                _ => 0,
            };
            size_of::<MotionRequest>() + pieces * PIECE_BYTES + size_of_val(request.stretches.as_slice())
        }
        Ahead::Planned(_) => unreachable!("nothing is planned again"),
        Ahead::Barrier(_) => 0,
    });
    let sizes: Vec<_> = sizes.collect();
    [sizes.iter().sum(), sizes.len(), planner.window_bytes()]
}

/// The most that waits while `count` splines of so many spans are planned; memory, elements.
fn most_waiting(bytes: usize, [count, spans]: [u32; 2], mm_per_min: f64) -> [usize; 2] {
    let machine = machine();
    let settings = PlannerSettings::new(&machine, WINDOW, PERIOD_S).with_window_bytes(bytes);
    let mut planner: Planner<u32> = Planner::new(settings);
    let (mut most, mut most_elements, mut planned, mut end_speed) = (0, 0, 0, 0.0_f64);
    let mut take = |planner: &mut Planner<u32>| {
        while let Some(item) = planner.pop() {
            let Planned::Motion(motion) = item else { panic!("there is no barrier") };
            for stretch in &motion.stretches {
                let speed = stretch.profile.state(0.0).1;
                assert!((speed - end_speed).abs() <= 1e-6 * end_speed.max(1.0), "{end_speed} to {speed} mm/s");
                end_speed = stretch.profile.state(stretch.profile.duration()).1;
            }
            planned += 1;
        }
    };
    for number in 0..count {
        planner.push_motion(request(part(number, spans), &machine, mm_per_min));
        take(&mut planner);
        let [counted, elements, said] = waiting(&planner);
        assert!(counted <= said, "{counted} bytes are more than {said}");
        most = most.max(said);
        most_elements = most_elements.max(elements);
    }
    planner.finish();
    take(&mut planner);
    assert_eq!(planned, count, "all of them come out");
    assert!(end_speed < 1e-9, "and the path rests at its end");
    [most, most_elements]
}

#[test]
fn splines_of_many_points_wait_within_a_bound_of_memory() {
    for spans in [20, 200] {
        let bytes = 4 << 20;
        let [most, elements] = most_waiting(bytes, [8_000 / spans, spans], 6_000.0);
        assert!(most > bytes / 2 && most < bytes + bytes / 8, "{most} of {bytes} bytes");
        assert!(elements < WINDOW / 100, "{elements} elements");
    }
}

#[test]
fn a_window_of_splines_that_all_brake_is_bounded_as_well() {
    // At this feed the whole window is less than a stop takes.
    let bytes = 128 << 10;
    let [most, _] = most_waiting(bytes, [200, 20], 12_000.0);
    assert!(most < 2 * bytes + bytes / 2, "{most} of {bytes} bytes");
}

#[test]
fn few_bytes_cost_no_more_than_time() {
    let planned_s = |bytes: usize| {
        let machine = machine();
        let mut planner: Planner<u32> =
            Planner::new(PlannerSettings::new(&machine, WINDOW, PERIOD_S).with_window_bytes(bytes));
        for number in 0..100 {
            planner.push_motion(request(part(number, 20), &machine, 6_000.0));
        }
        planner.finish();
        let items = std::iter::from_fn(|| planner.pop());
        let durations = items.map(|item| match item {
            Planned::Motion(motion) => motion.stretches.iter().map(|stretch| stretch.profile.duration()).sum(),
            Planned::Barrier(_) => 0.0,
        });
        durations.sum::<f64>()
    };
    let [all, few] = [1 << 30, 1 << 20].map(planned_s);
    assert!((all - few).abs() < 1e-3 * all, "{all} and {few} s");
}
