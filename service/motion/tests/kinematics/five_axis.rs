//! Five-axis elements: the tool centre point stays on its segment, the ends are exact, and the axes are smooth.

use feedwave_motion::Element;
use feedwave_motion::kinematics::vector::{Vec3, add, add_scaled, angle, cross, norm, scale, sub, unit};
use feedwave_motion::kinematics::{
    FiveAxisBlock, FiveAxisMotion, FiveAxisPoint, FiveAxisRefusal, GreatCircle, Kinematics, KinematicsError, Setup,
    Toward,
};
use feedwave_program::{Axis, SourceSpan};
use proptest::prelude::*;

use super::machines::{
    a_machine, a_point, compiled, head_head, head_table, nutating_head, table_table_ac, table_table_bc,
};
use super::properties::a_setup;

pub fn block(end_mm: Vec3, toward: Toward) -> FiveAxisBlock<'static> {
    FiveAxisBlock { end_mm, curve: None, toward, pole_tolerance_rad: 0.0, source: SourceSpan::default(), rapid: false }
}

/// The point with these rotary values.
pub fn point(machine: &Kinematics, setup: &Setup, tip_mm: Vec3, rotary_deg: [f64; 2]) -> Option<FiveAxisPoint> {
    machine.point_with(tip_mm, rotary_deg, &[0.0; 9], setup).ok()
}

/// Checks what is promised of every setpoint.
fn check(
    machine: &Kinematics,
    setup: &Setup,
    [start, end]: [&FiveAxisPoint; 2],
    element: &Element,
    direction: impl Fn(f64) -> Vec3,
    direction_tolerance: f64,
) {
    assert_eq!(element.position(0.0), start.position);
    assert_eq!(element.position(element.length), end.position);
    let travel = sub(end.tip_mm, start.tip_mm);
    let samples: Vec<f64> = (0..=97).map(|k| element.length * f64::from(k) / 97.0).collect();
    for &s in samples.iter().chain(samples.iter().rev()) {
        let joints = machine.from_position(&element.position(s));
        let pose = machine.forward(&joints, setup);
        let share = s / element.length;
        let error = norm(sub(pose.tip_mm, add_scaled(start.tip_mm, travel, share)));
        assert!(error < 1e-9, "tip {error:e} at {share}");
        let error = angle(pose.direction, direction(share));
        assert!(error < direction_tolerance, "direction {error:e} at {share}");
    }
    // Columns are the same to the bit wherever they begin.
    for axis in Axis::ALL {
        let mut column = vec![0.0; samples.len()];
        element.fill_axis(axis, &samples, &mut column);
        for (value, &s) in column.iter().zip(&samples) {
            assert_eq!(value.to_bits(), element.position(s)[axis.index()].to_bits());
        }
    }
}

fn only(motion: &FiveAxisMotion) -> &Element {
    assert_eq!(motion.elements.len(), 1, "{motion:?}");
    &motion.elements[0]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn by_angles_the_tip_stays_on_its_segment(
        machine in a_machine(),
        setup in a_setup(),
        tip_mm in a_point(300.0),
        travel_mm in a_point(40.0),
        from in prop::array::uniform2(-100.0..100.0_f64),
        turn in prop::array::uniform2(-60.0..60.0_f64),
    ) {
        let Some(start) = point(&machine, &setup, tip_mm, from) else { return Ok(()) };
        let to = [from[0] + turn[0], from[1] + turn[1]];
        match machine.elements(&setup, &start, &block(add(tip_mm, travel_mm), Toward::Angles(to))) {
            Ok(motion) => {
                let directions = |share: f64| {
                    let rotary = [0, 1].map(|axis| (from[axis] + turn[axis] * share).to_radians());
                    let direction = machine.rotary_directions().at(rotary);
                    setup.to_work(&feedwave_motion::kinematics::ToolPose { tip_mm, direction }).direction
                };
                check(&machine, &setup, [&start, &motion.end], only(&motion), directions, 1e-10);
                let rotary = machine.letters().1.map(|axis| motion.end.position[axis.index()]);
                prop_assert_eq!(rotary, to);
            }
            Err(FiveAxisRefusal::Pose { reason: KinematicsError::Degenerate | KinematicsError::OutOfRange { .. }, .. }) => {}
            // A rotary axis among the linear ones may bring them close to dependence.
            Err(FiveAxisRefusal::TooSharp { .. }) => {
                let steep = (0..=100).any(|k| {
                    let rotary = [0, 1].map(|axis| (from[axis] + turn[axis] * f64::from(k) / 100.0).to_radians());
                    let joints = machine.joints_at(tip_mm, rotary, &setup);
                    let jacobian = joints.and_then(|joints| machine.jacobian(&joints, &setup));
                    jacobian.map_or(true, |jacobian| jacobian.linear_by_tip.iter().any(|row| norm(*row) > 5.0))
                });
                prop_assert!(steep);
            }
            Err(refusal) => prop_assert!(false, "{refusal}"),
        }
    }

    #[test]
    fn by_vectors_the_tip_stays_on_its_segment_and_the_direction_on_its_great_circle(
        machine in a_machine(),
        setup in a_setup(),
        tip_mm in a_point(300.0),
        travel_mm in a_point(40.0),
        from in prop::array::uniform2(-100.0..100.0_f64),
        turn in prop::array::uniform2(-60.0..60.0_f64),
    ) {
        let Some(start) = point(&machine, &setup, tip_mm, from) else { return Ok(()) };
        let to = [from[0] + turn[0], from[1] + turn[1]];
        let Some(target) = point(&machine, &setup, tip_mm, to) else { return Ok(()) };
        let target = target.direction;
        let Ok(circle) = GreatCircle::new(start.direction, target) else { return Ok(()) };
        match machine.elements(&setup, &start, &block(add(tip_mm, travel_mm), Toward::Vector(target))) {
            Ok(motion) => {
                let tolerance = motion.deviation_rad + 1e-9;
                check(&machine, &setup, [&start, &motion.end], only(&motion), |share| circle.at(share), tolerance);
            }
            // Between reachable directions a great circle may leave what a machine can reach, or come to its edge.
            Err(FiveAxisRefusal::Pose { .. } | FiveAxisRefusal::TooSharp { .. }) => {}
            Err(refusal) => prop_assert!(false, "{refusal}"),
        }
    }

    #[test]
    fn poles_are_passed_closely_without_a_jump(
        kind in 0_usize..4,
        side in prop::array::uniform2(-3.1..3.1_f64),
        beside in -9.0..-1.0_f64,
        tilts in prop::array::uniform2(0.05..0.6_f64),
        tolerance in prop_oneof![Just(0.0), Just(1e-3), Just(0.05)],
    ) {
        let machine = compiled(&[table_table_bc, head_table, head_head, nutating_head][kind]());
        let setup = Setup::new([30.0, -20.0, 50.0], 120.0);
        let beside_rad = 10.0_f64.powf(beside);
        // From one side of the Z direction to the other, beside it by the angle given.
        let along: Vec3 = [side[0].cos(), side[0].sin(), 0.0];
        let across: Vec3 = [-along[1], along[0], 0.0];
        let at = |tilt: f64| {
            let v = add(scale(along, tilt.sin()), add(scale(across, beside_rad), [0.0, 0.0, tilt.cos()]));
            unit(v).expect("not zero")
        };
        let (from, to) = (at(-tilts[0]), at(tilts[1]));
        let solution = machine.solve_direction(from).expect("reachable");
        let start = point(&machine, &setup, [1.0, 2.0, 3.0], solution.branches_rad[usize::from(side[1] > 0.0)].map(f64::to_degrees)).expect("in range");
        let start = FiveAxisPoint { direction: from, ..start };
        let wanted = FiveAxisBlock { pole_tolerance_rad: tolerance, ..block([31.0, 12.0, -3.0], Toward::Vector(to)) };
        let motion = machine.elements(&setup, &start, &wanted).expect("possible");
        prop_assert!(motion.deviation_rad <= tolerance.max(1e-7));
        let circle = GreatCircle::new(from, to).expect("not opposite");
        let deviation = motion.deviation_rad + 1e-9;
        check(&machine, &setup, [&start, &motion.end], only(&motion), |share| circle.at(share), deviation);
        let element = only(&motion);
        // Through the pole the first axis hardly turns; beside it, it turns half a turn in the width of the passing.
        let first = machine.letters().1[0].index();
        let turned = (element.end[first] - element.start[first]).abs();
        if motion.deviation_rad > 0.0 {
            prop_assert!(turned < 90.0, "{turned}");
        }
        // The bound holds where the axis turns fastest, about as far from the pole as it is passed, and all along.
        let slope = element.largest_tangent()[first];
        let (angle_rad, nearest_rad) = (angle(from, to), pole_distance(from, to));
        let nearest = element.length * tilts[0] / (tilts[0] + tilts[1]);
        let width = element.length * nearest_rad / angle_rad;
        let fine = (-200..=200).map(|k| nearest + 0.02 * width * f64::from(k));
        let places: Vec<f64> = (0..256).map(|k| element.length * f64::from(k) / 256.0).chain(fine).collect();
        let steepest = places.iter().map(|&s| element.tangent(s)[first].abs()).fold(0.0, f64::max);
        prop_assert!(steepest <= slope * (1.0 + 1e-12), "{steepest} {slope}");
        // It is no more than the axis needs: with axes at right angles, 1/sin of that distance times the tool's turning.
        if kind < 3 && motion.deviation_rad == 0.0 {
            let exact = (angle_rad / nearest_rad.sin()).to_degrees() / element.length;
            prop_assert!((slope / exact - 1.0).abs() <= 1e-6, "{slope} {exact}");
        }
        // No jump: no step turns by more than the bound permits. Where two polynomials meet, either may be off by its fit:
        // 2e-12 rad, and two units in the last place of the share of the length.
        let step = 1e-3 / (slope + 1.0);
        let meeting = 2.0 * (2e-12_f64.to_degrees() + 2.0 * f64::EPSILON * slope * element.length);
        for place in places {
            let [from, to] = [place, place + step].map(|s| s.clamp(0.0, element.length));
            let [a, b] = [from, to].map(|s| element.position(s)[first]);
            prop_assert!((b - a).abs() <= slope * (to - from) * (1.0 + 1e-9) + meeting, "{a} {b} at {place}");
        }
    }
}

/// Angle at which the great circle between two directions passes Z, rad.
fn pole_distance(from: Vec3, to: Vec3) -> f64 {
    unit(cross(from, to)).expect("different directions")[2].asin().abs()
}

#[test]
fn tilting_a_table_moves_what_lies_on_it() {
    // B = 90° about (0.2, ·, −60) takes a tip at (0.2, 0, −50), 10 mm over the line, to the side of +X; the tool follows.
    let machine = compiled(&table_table_bc());
    let setup = Setup::new([0.0; 3], 0.0);
    let start = point(&machine, &setup, [0.2, 0.0, -50.0], [0.0, 0.0]).expect("in range");
    let motion =
        machine.elements(&setup, &start, &block([0.2, 0.0, -50.0], Toward::Angles([0.0, 90.0]))).expect("possible");
    let element = only(&motion);
    assert_eq!(element.length, 90.0);
    let joints = machine.from_position(&element.position(30.0));
    let pose = machine.forward(&joints, &setup);
    assert!(norm(sub(pose.tip_mm, [0.2, 0.0, -50.0])) < 1e-9);
    assert!((element.position(30.0)[Axis::B.index()] - 30.0).abs() < 1e-12);
}

/// On each kind of machine: 30° of the second axis about a known line, with the linear axes worked out by hand.
#[test]
fn each_kind_of_machine_compensates_by_hand_calculation() {
    let (sine, cosine) = (0.5, 0.75_f64.sqrt());
    // Head-head: the tip is L = 100 below the gauge point (500), the pivot (·, 0.4, 700) 300 over the tip. Tilting A by 30°
    // with the tip at rest moves the pivot: tip − pivot = (·, −0.4, −300) turns to (·, −0.4c + 300s, −0.4s − 300c).
    let machine = compiled(&head_head());
    let setup = Setup::new([0.0; 3], 100.0);
    let start = point(&machine, &setup, [0.0, 0.0, 400.0], [0.0, 0.0]).expect("in range");
    let motion =
        machine.elements(&setup, &start, &block([0.0, 0.0, 400.0], Toward::Angles([0.0, 30.0]))).expect("possible");
    let end = motion.end.position;
    assert!((end[1] - (-0.4 - (-0.4 * cosine + 300.0 * sine))).abs() < 1e-9, "{end:?}");
    assert!((end[2] - (-300.0 - (-0.4 * sine - 300.0 * cosine))).abs() < 1e-9, "{end:?}");
    // Head-table: the same with B about (0, ·, 650): (0, ·, −250) turns to (−250s, ·, −250c).
    let machine = compiled(&head_table());
    let start = point(&machine, &setup, [0.0, 0.0, 400.0], [0.0, 0.0]).expect("in range");
    let motion =
        machine.elements(&setup, &start, &block([0.0, 0.0, 400.0], Toward::Angles([0.0, 30.0]))).expect("possible");
    let end = motion.end.position;
    assert!((end[0] - 250.0 * sine).abs() < 1e-9 && (end[2] - (-250.0 + 250.0 * cosine)).abs() < 1e-9, "{end:?}");
    // Table-table: A about (·, 5.3, 40). In the chain's sense the tool turns by −30° about the table's line as the table
    // turns by 30° under it; a tip on the line stays where it is.
    let machine = compiled(&table_table_ac());
    let start = point(&machine, &setup, [7.0, 5.3, 40.0], [0.0, 0.0]).expect("in range");
    let motion =
        machine.elements(&setup, &start, &block([7.0, 5.3, 40.0], Toward::Angles([0.0, -30.0]))).expect("possible");
    assert!(norm(sub([0, 1, 2].map(|k| motion.end.position[k]), [0, 1, 2].map(|k| start.position[k]))) < 1e-9);
}

#[test]
fn leaving_a_pole_the_first_axis_turns_at_rest() {
    let machine = compiled(&table_table_bc());
    let setup = Setup::new([0.0; 3], 50.0);
    let start = machine.point_at(&[0.0; 9], &setup);
    let tilted = unit([0.3, 0.3, 0.9]).expect("a direction");
    let motion = machine.elements(&setup, &start, &block([10.0, 0.0, 0.0], Toward::Vector(tilted))).expect("possible");
    assert_eq!(motion.elements.len(), 2);
    let [turn, tilt] = [&motion.elements[0], &motion.elements[1]];
    assert!((motion.turn_in_pole_rad - std::f64::consts::FRAC_PI_4).abs() < 1e-12, "{}", motion.turn_in_pole_rad);
    assert!((turn.length - 45.0).abs() < 1e-9);
    assert_eq!(turn.end, tilt.start);
    assert_eq!(motion.least_pole_distance_rad, 0.0);
    // And back into it the first axis stays where it is.
    let back =
        machine.elements(&setup, &motion.end, &block([0.0; 3], Toward::Vector([0.0, 0.0, 1.0]))).expect("possible");
    let first = machine.letters().1[0].index();
    assert!((back.end.position[first] - motion.end.position[first]).abs() < 1e-9);
}

#[test]
fn what_cannot_be_run_is_refused() {
    let machine = compiled(&table_table_ac());
    let setup = Setup::new([0.0; 3], 50.0);
    let start = point(&machine, &setup, [0.0; 3], [0.0, -30.0]).expect("in range");
    let refused = |start: &FiveAxisPoint, toward: Toward| {
        machine.elements(&setup, start, &block([1.0, 0.0, 0.0], toward)).expect_err("refused")
    };
    assert!(matches!(
        refused(&start, Toward::Angles([0.0, 40.0])),
        FiveAxisRefusal::Pose { reason: reason @ KinematicsError::OutOfRange { axis: Axis::A, .. }, .. } if (reason.excess_rad().to_degrees() - 10.0).abs() < 1e-9
    ));
    assert!(matches!(refused(&start, Toward::Vector(scale(start.direction, -1.0))), FiveAxisRefusal::Opposite(_)));
    assert_eq!(refused(&start, Toward::Vector([0.0; 3])), FiveAxisRefusal::NotANumber);
    let elsewhere = FiveAxisPoint { tip_mm: [1.0, 0.0, 0.0], ..start };
    assert!(matches!(refused(&elsewhere, Toward::Angles([0.0, -20.0])), FiveAxisRefusal::Start { .. }));
    // A nutating head at 45° does not look upwards.
    let machine = compiled(&nutating_head());
    let start = point(&machine, &setup, [0.0; 3], [0.0, 60.0]).expect("in range");
    let refusal = machine.elements(&setup, &start, &block([1.0, 0.0, 0.0], Toward::Vector([0.6, 0.0, -0.8])));
    assert!(
        matches!(refusal, Err(FiveAxisRefusal::Pose { reason: KinematicsError::Unreachable { .. }, .. })),
        "{refusal:?}"
    );
}
