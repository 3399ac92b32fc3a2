use feedwave_program::{ArcGeometry, Axis, Feed, Move, MoveKind, PathControl, Plane, SourceSpan, Spindle};

use super::*;
use crate::MachineAxis;

const PERIOD_S: f64 = 1e-3;

fn mv(start: [f64; 3], end: [f64; 3]) -> Move {
    let position = |[x, y, z]: [f64; 3]| -> Position { [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
    Move {
        kind: MoveKind::Cutting,
        start: position(start),
        end: position(end),
        work_offset: [0.0; AXIS_COUNT],
        arc: None,
        feed: Feed::PerMinute(600.0),
        spindle: Spindle::STOPPED,
        tool: 0,
        spline: None,
        path_control: PathControl::default(),
        leads_xyz: false,
        cycle: None,
    }
}

fn element(mv: &Move) -> Element {
    Element::from_move(mv, SourceSpan::default()).expect("it moves")
}

fn line(start: [f64; 3], end: [f64; 3]) -> Element {
    element(&mv(start, end))
}

/// A quarter circle that leaves the origin along +X and turns left.
fn quarter(radius: f64) -> Element {
    let center = [0.0, radius];
    let arc = ArcGeometry { plane: Plane::Xy, center, clockwise: false, sweep_rad: core::f64::consts::FRAC_PI_2 };
    element(&Move { arc: Some(arc), ..mv([0.0, 0.0, 0.0], [radius, radius, 0.0]) })
}

fn rules() -> JunctionRules {
    let mut machine = Machine::mill();
    machine.axes = [Axis::X, Axis::Y, Axis::Z].map(|axis| MachineAxis::new(axis, 500.0, 10_000.0, 5e6)).to_vec();
    JunctionRules::new(&machine, PERIOD_S)
}

#[test]
fn one_straight_line_in_two_parts_is_no_junction() {
    let [a, b] = [line([0.0; 3], [30.0, 40.0, 0.0]), line([30.0, 40.0, 0.0], [90.0, 120.0, 0.0])];
    let junction = rules().junction(&a, &b, 123.0, 0.0, true).expect("passes");
    assert_eq!(junction.speed, 123.0);
    assert!(junction.reserve < 1e-9);
}

#[test]
fn a_line_into_an_arc_steps_its_acceleration_within_one_period() {
    // Δp″ = 1/r = 0.1/mm: v² ≤ 0.35·j·T/(0.75·0.1) = 0.35·5e6·1e-3/0.075.
    let [a, b] = [line([-50.0, 0.0, 0.0], [0.0; 3]), quarter(10.0)];
    let fastest = (0.35_f64 * 5e6 * 1e-3 / 0.075).sqrt();
    let junction = rules().junction(&a, &b, 1e3, 0.0, true).expect("passes");
    assert!((junction.speed - fastest).abs() < 1e-9 * fastest);
    assert!((junction.reserve - 0.35).abs() < 1e-9);
    // At half that speed a quarter of the share is used.
    let junction = rules().junction(&a, &b, 0.5 * fastest, 0.0, true).expect("passes");
    assert_eq!(junction.speed, 0.5 * fastest);
    assert!((junction.reserve - 0.35 / 4.0).abs() < 1e-9);
}

#[test]
fn a_small_change_of_direction_is_passed_slowly_and_a_large_one_not_at_all() {
    let turned = |angle: f64| line([0.0; 3], [50.0 * angle.cos(), 50.0 * angle.sin(), 0.0]);
    let before = line([-50.0, 0.0, 0.0], [0.0; 3]);
    // The step in Y, 5e-4·v: within 0.05·a = 500 mm/s² per period v ≤ 1000; within 0.1·j per period² v ≤ 1000 too.
    let junction = rules().junction(&before, &turned(5e-4), 2e3, 0.0, true).expect("passes");
    assert!((junction.speed - 1_000.0).abs() < 1e-3, "{}", junction.speed);
    assert!((junction.reserve - LARGEST_RESERVE).abs() < 1e-6);
    assert!(rules().junction(&before, &turned(1.1e-3), 2e3, 0.0, true).is_none());
    assert!(rules().junction(&before, &turned(3.0), 2e3, 0.0, true).is_none());
    assert!(rules().junction(&before, &turned(core::f64::consts::PI), 2e3, 0.0, true).is_none());
}

#[test]
fn junctions_in_quick_succession_count_by_their_rate() {
    // A chord of 0.01 mm is passed in a tenth of the period at 100 mm/s. Acceleration: v²·5e-4/0.01 ≤ 0.05·10 000 gives
    // 100 mm/s; jerk: v²·5e-4·1.5/0.01/T ≤ 0.1·5e6 gives √6667 = 81.65 mm/s. One junction alone would allow 1000.
    let angle = 5e-4_f64;
    let before = line([-0.01, 0.0, 0.0], [0.0; 3]);
    let after = line([0.0; 3], [0.01 * angle.cos(), 0.01 * angle.sin(), 0.0]);
    let junction = rules().junction(&before, &after, 1e3, 0.0, true).expect("passes");
    assert!((junction.speed - 81.65).abs() < 0.01, "{}", junction.speed);
}

#[test]
fn corners_in_quick_succession_count_by_their_rate() {
    // Chords of a circle, 0.02 mm long with 0.04 rad between them: v·0.04 ≤ 5 mm/s would let them pass at 125 mm/s, and
    // v²·0.04/0.02 ≤ 0.5·10 000 is 50 mm/s.
    let mut machine = Machine::mill();
    machine.axes = [Axis::X, Axis::Y].map(|axis| MachineAxis::new(axis, 500.0, 10_000.0, 5e6)).to_vec();
    machine.axes.iter_mut().for_each(|axis| axis.max_velocity_step_per_s = 5.0);
    let rules = JunctionRules::new(&machine, PERIOD_S);
    let turned = |length: f64| line([0.0; 3], [length * 0.04_f64.cos(), length * 0.04_f64.sin(), 0.0]);
    let before = |length: f64| line([-length, 0.0, 0.0], [0.0; 3]);
    let passes = |from: f64, to: f64| rules.junction(&before(from), &turned(to), 1e3, 0.0, true).expect("passes");
    for (from, to) in [(0.02, 0.02), (30.0, 0.02), (0.02, 30.0)] {
        let junction = passes(from, to);
        assert!((junction.speed - 50.0).abs() < 0.02, "{} mm/s", junction.speed);
        assert!((junction.reserve - LARGEST_RESERVE).abs() < 1e-12);
    }
    // Alone it is passed with its step.
    let alone = passes(30.0, 30.0);
    assert!((alone.speed * 0.04_f64.sin() - 5.0).abs() < 1e-9, "{} mm/s", alone.speed);
    assert!(alone.reserve < 0.003, "{}", alone.reserve);
}

#[test]
fn an_axis_the_machine_lacks_does_not_limit() {
    let mut machine = Machine::mill();
    machine.axes.truncate(1);
    let [a, b] = [line([-50.0, 0.0, 0.0], [0.0; 3]), quarter(10.0)];
    let junction = JunctionRules::new(&machine, PERIOD_S).junction(&a, &b, 50.0, 0.0, true).expect("passes");
    assert!(junction.reserve < 1e-15);
}

#[test]
fn the_path_rests_between_rapid_and_cut_at_gaps_and_without_speed() {
    let [a, b] = [line([0.0; 3], [10.0, 0.0, 0.0]), line([10.0, 0.0, 0.0], [20.0, 0.0, 0.0])];
    assert!(rules().junction(&a, &b, 10.0, 0.0, true).is_some());
    assert!(rules().junction(&a, &b, 0.0, 0.0, true).is_none());
    assert!(rules().junction(&Element { rapid: true, ..a.clone() }, &b, 10.0, 0.0, true).is_none());
    let beyond = line([10.001, 0.0, 0.0], [20.0, 0.0, 0.0]);
    assert!(rules().junction(&a, &beyond, 10.0, 0.0, true).is_none());
    // The same machine position in other work coordinates is the same place.
    let mut shifted = line([110.0, 0.0, 0.0], [120.0, 0.0, 0.0]);
    assert!(rules().junction(&a, &shifted, 10.0, 0.0, true).is_none());
    shifted.work_offset[0] = -100.0;
    assert!(rules().junction(&a, &shifted, 10.0, 0.0, true).is_some());
    // A rotary axis that starts to turn along with the path is a corner.
    let mut turning = mv([10.0, 0.0, 0.0], [20.0, 0.0, 0.0]);
    turning.end[Axis::C.index()] = 1.0;
    assert!(rules().junction(&a, &element(&turning), 10.0, 0.0, true).is_none());
}

#[test]
fn the_shares_leave_room_for_every_mixture() {
    // The formulas beside the constants, for every share u of a junction.
    for k in 0..=1_000 {
        let used = LARGEST_RESERVE * f64::from(k) / 1_000.0;
        let left = 1.0 - used;
        let tangent = 0.8 * left + 0.4 * used;
        let normal = 0.6 * left + used;
        assert!((tangent * tangent + normal * normal).sqrt() <= 1.0 + 1e-12, "jerk at {used}");
        let kink = KINK_ACCELERATION_SHARE * used / LARGEST_RESERVE;
        let tangential = 0.6 * left;
        assert!((0.64 + tangential * tangential).sqrt() + kink <= 1.0 + 1e-12, "acceleration at {used}");
    }
}
