use feedwave_program::{ArcGeometry, Axis, Feed, Move, MoveKind, PathControl, Plane, SourceSpan, Spindle};

use super::*;
use crate::{Element, Machine, MachineAxis, PathLimits, Profile};

const VELOCITY: f64 = 200.0;
const ACCELERATION: f64 = 2_000.0;
const JERK: f64 = 30_000.0;

impl Guess for Profile {
    fn duration_s(&self) -> f64 {
        self.duration()
    }

    fn at(&self, t_s: f64) -> (f64, f64) {
        let (s, speed, ..) = self.state(t_s);
        (s, speed)
    }
}

fn machine() -> Machine {
    let axis = |axis| MachineAxis::new(axis, VELOCITY, ACCELERATION, JERK);
    Machine { axes: vec![axis(Axis::X), axis(Axis::Y)], ..Machine::mill() }
}

fn mv(from: [f64; 2], to: [f64; 2], arc: Option<ArcGeometry>) -> Element {
    let mut mv = Move {
        kind: MoveKind::Cutting,
        start: [0.0; 9],
        end: [0.0; 9],
        work_offset: [0.0; 9],
        arc,
        feed: Feed::PerMinute(1.0),
        spindle: Spindle::STOPPED,
        tool: 0,
        spline: None,
        path_control: PathControl::default(),
        cycle: None,
        leads_xyz: false,
    };
    mv.start[..2].copy_from_slice(&from);
    mv.end[..2].copy_from_slice(&to);
    Element::from_move(&mv, SourceSpan::default()).expect("it moves")
}

fn circle(radius_mm: f64) -> Element {
    let arc = ArcGeometry { plane: Plane::Xy, center: [0.0; 2], clockwise: false, sweep_rad: core::f64::consts::TAU };
    mv([radius_mm, 0.0], [radius_mm, 0.0], Some(arc))
}

const REST: End = End { speed: 0.0, acceleration: 0.0, reserve: 0.0, reserved_mm: 0.0 };

/// The course from a plan at half the limits and a third of the jerk; `share` of the speed.
fn plan(element: &Element, command: f64, ends: [End; 2]) -> Option<Course> {
    let spans = [Span { start: 0.0, element, from: 0.0, command }];
    let path = Path::new(&spans, element.length, &AxisLimits::new(&machine()));
    let slow = PathLimits { velocity: command.min(30.0), acceleration: 0.5 * ACCELERATION, jerk: 0.3 * JERK };
    let guess = Profile::solve(element.length, ends[0].speed, ends[1].speed, slow).expect("long enough");
    SpeedPlanner::default().plan(&path, ends, &guess)
}

/// Largest velocity, acceleration and jerk of the axes in finite differences, as shares of their limits.
fn differences(element: &Element, course: &Course, period_s: f64) -> [f64; 3] {
    let count = (course.duration() / period_s) as usize + 2;
    let (mut s, mut v) = (vec![0.0; count], vec![0.0; count]);
    course.fill(0, period_s, 0.0, &mut s, &mut v);
    let mut largest = [0.0_f64; 3];
    for axis in [Axis::X, Axis::Y] {
        let mut q = vec![0.0; count];
        element.fill_axis(axis, &s, &mut q);
        let mut padded = vec![q[0]; 3];
        padded.extend(q);
        padded.extend([padded[padded.len() - 1]; 3]);
        for w in padded.windows(4) {
            largest[0] = largest[0].max((w[1] - w[0]).abs() / period_s / VELOCITY);
            largest[1] = largest[1].max((w[2] - 2.0 * w[1] + w[0]).abs() / (period_s * period_s) / ACCELERATION);
            let jerk = (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs();
            largest[2] = largest[2].max(jerk / (period_s * period_s * period_s) / JERK);
        }
    }
    largest
}

fn check(element: &Element, course: &Course) {
    assert!((course.length() - element.length).abs() < 1e-9);
    for period_s in [250e-6, 1e-3, 4e-3] {
        let largest = differences(element, course, period_s);
        assert!(largest.iter().all(|&share| share <= 1.0 + 1e-6), "{largest:?} at {period_s}");
    }
}

#[test]
fn a_straight_line_takes_the_time_of_the_seven_phases() {
    for (length_mm, command) in [(300.0, 200.0), (100.0, 150.0), (20.0, 500.0), (2.0, 80.0), (0.2, 80.0)] {
        let element = mv([0.0, 0.0], [length_mm, 0.0], None);
        let course = plan(&element, command, [REST; 2]).expect("a plan");
        check(&element, &course);
        let limits = PathLimits { velocity: VELOCITY.min(command), acceleration: ACCELERATION, jerk: JERK };
        let optimum = Profile::solve(length_mm, 0.0, 0.0, limits).expect("from rest").duration();
        let ratio = course.duration() / optimum;
        assert!((0.999_999..1.03).contains(&ratio), "{length_mm} mm: {ratio}");
    }
}

#[test]
fn a_circle_is_run_at_the_limit_of_the_acceleration() {
    // v² = A·R where neither velocity nor jerk (v³/R²) is in the way: 1414 mm/s³ of 30 000.
    let element = circle(20.0);
    let speed = (ACCELERATION * 20.0).sqrt().min(VELOCITY);
    let course = plan(&element, 500.0, [REST; 2]).expect("a plan");
    check(&element, &course);
    let middle = course.state(0.5 * course.duration()).1;
    assert!((0.97..1.0).contains(&(middle / speed)), "{middle} of {speed}");
    // From and to speeds on the way.
    let end = End { speed: 100.0, ..REST };
    let moving = plan(&element, 500.0, [end, end]).expect("a plan");
    assert!(moving.duration() < course.duration());
    assert_eq!((moving.state(0.0).1, moving.end_velocity()), (100.0, 100.0));
}

#[test]
fn parts_of_a_course_are_the_course() {
    let element = circle(20.0);
    let course = plan(&element, 500.0, [REST; 2]).expect("a plan");
    let mut total_s = 0.0;
    // At rest a place a bit before the end is passed microseconds before it.
    let mut places: Vec<f64> = (0..37).map(|k| element.length * f64::from(k) / 37.0).collect();
    places.push(course.length());
    for pair in places.windows(2) {
        let part = course.between(pair[0], pair[1]);
        for k in 0..=10 {
            let t = part.duration() * f64::from(k) / 10.0;
            let (whole, own) = (course.state(total_s + t), part.state(t));
            assert!((whole.0 - pair[0] - own.0).abs() < 1e-9, "{whole:?} {own:?}");
            assert!((whole.1 - own.1).abs() < 1e-7, "{whole:?} {own:?}");
        }
        total_s += part.duration();
    }
    assert!((total_s - course.duration()).abs() < 1e-9);
}

#[test]
fn a_fill_depends_on_its_own_times_only() {
    let course = plan(&circle(20.0), 500.0, [REST; 2]).expect("a plan");
    let (mut s, mut v) = (vec![0.0; 900], vec![0.0; 900]);
    course.fill(3, 1e-3, 4e-4, &mut s, &mut v);
    for first in [0, 1, 77, 400] {
        let (mut part_s, mut part_v) = (vec![0.0; 200], vec![0.0; 200]);
        course.fill(3 + first as u64, 1e-3, 4e-4, &mut part_s, &mut part_v);
        assert_eq!((&part_s[..], &part_v[..]), (&s[first..first + 200], &v[first..first + 200]));
    }
}
