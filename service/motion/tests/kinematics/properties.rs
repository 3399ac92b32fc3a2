//! What holds for every machine and every pose.

use feedwave_motion::kinematics::vector::{Vec3, add_scaled, cross, dot, norm, sub};
use feedwave_motion::kinematics::{
    DirectionPath, FiveAxisSegment, GreatCircle, Kinematics, KinematicsError, Setup, ToolPose, WorkFrame,
};
use proptest::prelude::*;

use super::machines::{a_direction, a_machine, a_point};

pub fn a_setup() -> impl Strategy<Value = Setup> {
    (a_point(500.0), a_direction(), a_direction(), 0.0..300.0_f64).prop_filter_map(
        "parallel directions span no plane",
        |(origin, x, other, tool_length_mm)| {
            let y = feedwave_motion::kinematics::vector::unit(cross(other, x))?;
            Some(Setup { work: WorkFrame::turned(origin, x, y).ok()?, tool_length_mm })
        },
    )
}

/// A pose that the machine can take: any tip, and the direction of random rotary values.
fn a_case() -> impl Strategy<Value = (Kinematics, Setup, ToolPose, [f64; 2])> {
    (a_machine(), a_setup(), a_point(1_000.0), prop::array::uniform2(-3.1..3.1_f64)).prop_map(
        |(machine, setup, tip_mm, rotary)| {
            let direction = machine.rotary_directions().at(rotary);
            let direction = setup.to_work(&ToolPose { tip_mm: [0.0; 3], direction }).direction;
            (machine, setup, ToolPose { tip_mm, direction }, rotary)
        },
    )
}

/// Distance of a point from a segment.
fn from_segment(point: Vec3, start: Vec3, end: Vec3) -> f64 {
    let (travel, to) = (sub(end, start), sub(point, start));
    let share = if dot(travel, travel) > 0.0 { (dot(to, travel) / dot(travel, travel)).clamp(0.0, 1.0) } else { 0.0 };
    norm(sub(point, add_scaled(start, travel, share)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn forward_undoes_inverse_in_both_branches((machine, setup, pose, reference) in a_case()) {
        match machine.inverse_branches(&pose, &setup, reference) {
            Ok(branches) => {
                for branch in branches {
                    match branch {
                        Ok(solution) => {
                            let again = machine.forward(&solution.joints, &setup);
                            // Linear axes out of square by much magnify rounding; the machines here hardly are.
                            let error = norm(sub(again.tip_mm, pose.tip_mm));
                            prop_assert!(error < 1e-9, "tip {error:e}");
                            let error = norm(sub(again.direction, pose.direction));
                            prop_assert!(error < 1e-9, "direction {error:e}");
                        }
                        // A rotary axis among the linear ones may make them dependent, and ranges may exclude a branch.
                        Err(KinematicsError::Degenerate | KinematicsError::OutOfRange { .. }) => {}
                        Err(error) => prop_assert!(false, "{error:?}"),
                    }
                }
            }
            Err(error) => prop_assert!(false, "the direction came from the machine itself: {error:?}"),
        }
    }

    #[test]
    fn one_of_the_branches_is_where_the_direction_came_from((machine, setup, pose, rotary) in a_case()) {
        let solution = machine.solve_direction(setup.to_chain(&pose).direction).expect("reachable");
        prop_assume!(solution.pole_distance_rad > 1e-3);
        let error = solution.branches_rad.map(|branch| {
            let turn = |axis: usize| {
                let difference: f64 = branch[axis] - rotary[axis];
                (difference - std::f64::consts::TAU * (difference / std::f64::consts::TAU).round()).abs()
            };
            turn(0).max(turn(1))
        });
        // At the edge of what can be reached the branches meet and angles have half the digits.
        prop_assert!(error[0].min(error[1]) < 1e-6, "{error:?}");
    }

    #[test]
    fn the_tip_stays_on_its_segment(
        (machine, setup, pose, rotary) in a_case(),
        travel in a_point(50.0),
        turn in prop::array::uniform2(-1.0..1.0_f64),
        by_angle in any::<bool>(),
        shares in prop::collection::vec(0.0..=1.0_f64, 8),
    ) {
        let end_rad = [rotary[0] + turn[0], rotary[1] + turn[1]];
        let end_direction = machine.rotary_directions().at(end_rad);
        let end_direction = setup.to_work(&ToolPose { tip_mm: [0.0; 3], direction: end_direction }).direction;
        let direction = if by_angle {
            DirectionPath::Angles { start_rad: rotary, end_rad }
        } else {
            let Ok(circle) = GreatCircle::new(pose.direction, end_direction) else { return Ok(()) };
            DirectionPath::GreatCircle(circle)
        };
        let segment =
            FiveAxisSegment { start_mm: pose.tip_mm, end_mm: add_scaled(pose.tip_mm, travel, 1.0), direction };
        let mut reference = rotary;
        for share in shares {
            match segment.joints(&machine, &setup, share, reference) {
                Ok(solution) => {
                    let tip_mm = machine.forward(&solution.joints, &setup).tip_mm;
                    let error = from_segment(tip_mm, segment.start_mm, segment.end_mm);
                    prop_assert!(error < 1e-9, "{error:e}");
                    prop_assert!(norm(sub(tip_mm, segment.tip_mm(share))) < 1e-9);
                    reference = solution.joints.rotary_rad;
                }
                Err(KinematicsError::NotARotation | KinematicsError::Singular) => prop_assert!(false),
                // Between reachable directions a great circle may leave what a machine can reach.
                Err(_) => {}
            }
        }
    }

    #[test]
    fn the_jacobian_is_the_slope_of_the_inverse(
        (machine, setup, pose, rotary) in a_case(),
        tip_travel in a_direction(),
        turn in a_direction(),
    ) {
        let solution = machine.solve_direction(setup.to_chain(&pose).direction).expect("reachable");
        if solution.pole_distance_rad < 0.05 {
            return Ok(());
        }
        let (Ok(joints), step) = (machine.joints_at(pose.tip_mm, rotary, &setup), 1e-6) else { return Ok(()) };
        // Out of range the inverse would take the other branch.
        if machine.out_of_range(&joints).next().is_some() {
            return Ok(());
        }
        let Ok(jacobian) = machine.jacobian(&joints, &setup) else { return Ok(()) };
        let size = jacobian.rotary_by_direction.iter().map(|row| norm(*row)).fold(0.0, f64::max);
        let linear = jacobian.linear_by_tip.iter().map(|row| norm(*row)).fold(0.0, f64::max);
        // Close to the edge of what can be reached, or to dependent linear axes, differences say nothing.
        if size > 20.0 || linear > 20.0 {
            return Ok(());
        }
        let along = cross(turn, pose.direction);
        let at = |sign: f64| {
            let direction = add_scaled(pose.direction, along, sign * step);
            let direction = feedwave_motion::kinematics::vector::unit(direction).expect("a direction");
            let pose = ToolPose { tip_mm: add_scaled(pose.tip_mm, tip_travel, sign * step), direction };
            machine.inverse(&pose, &setup, rotary)
        };
        let (Ok(before), Ok(after)) = (at(-1.0), at(1.0)) else { return Ok(()) };
        let rates = jacobian.joint_rates(tip_travel, along);
        let slope = |after: f64, before: f64| (after - before) / (2.0 * step);
        for axis in 0..3 {
            let slope = slope(after.joints.linear_mm[axis], before.joints.linear_mm[axis]);
            let scale = 1.0 + rates.linear_mm[axis].abs() + 1e3 * size;
            prop_assert!((slope - rates.linear_mm[axis]).abs() < 1e-4 * scale, "{slope} {rates:?}");
        }
        for axis in 0..2 {
            let slope = slope(after.joints.rotary_rad[axis], before.joints.rotary_rad[axis]);
            prop_assert!((slope - rates.rotary_rad[axis]).abs() < 1e-4 * (1.0 + size * size), "{slope} {rates:?}");
        }
    }

    #[test]
    fn any_numbers_are_answered(numbers in prop::array::uniform8(any::<f64>()), machine in a_machine()) {
        let [x, y, z, i, j, k, a, b] = numbers;
        let setup = Setup::new([x, y, z], a);
        let pose = ToolPose { tip_mm: [x, y, z], direction: [i, j, k] };
        let inverse = machine.inverse(&pose, &setup, [a, b]);
        let start = machine.choose_start([[i, j, k]; 3], &setup, [a, b]);
        let circle = GreatCircle::new([i, j, k], [x, y, z]);
        // Whatever came out, asking again gives the same to the bit.
        prop_assert_eq!(format!("{inverse:?}"), format!("{:?}", machine.inverse(&pose, &setup, [a, b])));
        let again = machine.choose_start([[i, j, k]; 3], &setup, [a, b]);
        prop_assert_eq!(format!("{start:?}"), format!("{again:?}"));
        prop_assert_eq!(format!("{circle:?}"), format!("{:?}", GreatCircle::new([i, j, k], [x, y, z])));
    }
}
