//! Five-axis kinematics (docs/functions/five-axis-thinning.md): known machines in figures, inverse against forward over
//! random machines and poses, ranges and turns, poles, the choice of the branch, refusals.

mod arcs;
mod five_axis;
mod limits;
mod machines;
mod properties;

use std::f64::consts::{FRAC_PI_2, PI};

use feedwave_motion::kinematics::vector::{Vec3, norm, sub};
use feedwave_motion::kinematics::{
    BranchPreference, DirectionPath, FiveAxisSegment, GreatCircle, JointValues, Kinematics, KinematicsDescription,
    KinematicsError, OppositeDirections, Setup, ToolPose, WorkFrame, Wrap,
};
use feedwave_program::Axis;
use machines::*;

fn assert_near(actual: &[f64], expected: &[f64], tolerance: f64) {
    let near = actual.len() == expected.len() && actual.iter().zip(expected).all(|(a, e)| (a - e).abs() <= tolerance);
    assert!(near, "{actual:?} is not {expected:?}");
}

fn tilted(degrees: f64, azimuth_degrees: f64) -> Vec3 {
    let (tilt, azimuth) = (degrees.to_radians(), azimuth_degrees.to_radians());
    [libm::sin(tilt) * libm::cos(azimuth), libm::sin(tilt) * libm::sin(azimuth), libm::cos(tilt)]
}

#[test]
fn a_head_swings_the_tip_about_its_pivot() {
    // Pivot of A at (0, 0.4, 700), gauge point at z 500, tool 100: the tip is 300 below the pivot. A 90° about X takes
    // what is below (−z) to +y.
    let machine = compiled(&head_head());
    let joints = JointValues { linear_mm: [1.0, 2.0, 3.0], rotary_rad: [0.0, FRAC_PI_2] };
    let pose = machine.forward(&joints, &Setup::new([0.0; 3], 100.0));
    // Relative to the pivot (y −0.4, z −300) → (y 300, z −0.4); then the linear axes.
    assert_near(&pose.tip_mm, &[1.0, 0.4 + 300.0 + 2.0, 700.0 - 0.4 + 3.0], 1e-12);
    assert_near(&pose.direction, &[0.0, -1.0, 0.0], 1e-15);
}

#[test]
fn work_coordinates_move_with_the_table() {
    // The work zero lies 50 beside the centre of a C table. With C at 90° the tool has turned against the work: the
    // machine's X now is the work's Y.
    let machine = compiled(&table_table_bc());
    let setup = Setup::new([50.0, 0.0, 0.0], 100.0);
    let start = JointValues { linear_mm: [50.0, 0.0, -400.0], rotary_rad: [0.0, 0.0] };
    assert_near(&machine.forward(&start, &setup).tip_mm, &[0.0; 3], 1e-12);
    let on_zero = machine.joints_at([0.0; 3], [FRAC_PI_2, 0.0], &setup).expect("a pose");
    assert_near(&on_zero.linear_mm, &[0.0, -50.0, -400.0], 1e-12);
    let beside = machine.joints_at([0.0, 7.0, 0.0], [FRAC_PI_2, 0.0], &setup).expect("a pose");
    assert_near(&beside.linear_mm, &[7.0, -50.0, -400.0], 1e-12);
    assert_near(&machine.gauge_point_at(&start), &[50.0, 0.0, 100.0], 1e-12);
}

#[test]
fn turned_work_coordinates_turn_points_and_directions() {
    let machine = compiled(&head_table());
    let turned = WorkFrame::turned([1.0, 2.0, 3.0], Y, [-1.0, 0.0, 0.0]).expect("a rotation");
    let setup = Setup { work: turned, tool_length_mm: 80.0 };
    let pose = ToolPose { tip_mm: [10.0, 0.0, 0.0], direction: tilted(30.0, 0.0) };
    let in_chain = setup.to_chain(&pose);
    assert_near(&in_chain.tip_mm, &[1.0, 12.0, 3.0], 1e-12);
    assert_near(&in_chain.direction, &tilted(30.0, 90.0), 1e-15);
    let joints = machine.inverse(&pose, &setup, [0.0; 2]).expect("reachable").joints;
    assert_near(&machine.forward(&joints, &setup).tip_mm, &pose.tip_mm, 1e-9);
    assert_eq!(WorkFrame::turned([0.0; 3], X, [0.1, 1.0, 0.0]), Err(KinematicsError::NotARotation));
    assert_eq!(WorkFrame::turned([0.0; 3], [f64::NAN; 3], Y), Err(KinematicsError::NotARotation));
}

#[test]
fn a_trunnion_has_two_solutions() {
    // Tool tilted 30° towards +y of the work: A −30° with C 0°, or A +30° with C 180°.
    let machine = compiled(&table_table_ac());
    let solution = machine.solve_direction(tilted(30.0, 90.0)).expect("reachable");
    let [larger, smaller] = solution.branches_rad.map(|branch| branch.map(f64::to_degrees));
    assert_near(&[larger[0].abs(), larger[1]], &[180.0, 30.0], 1e-12);
    assert_near(&smaller, &[0.0, -30.0], 1e-12);
    assert_near(&[solution.pole_distance_rad.to_degrees()], &[30.0], 1e-12);
    // Beyond 30° only the negative branch is in range.
    let rotary = machine.nearest_rotary(tilted(60.0, 90.0), [PI, 0.5]).expect("reachable").map(f64::to_degrees);
    assert_near(&[rotary[0].abs(), rotary[1]], &[0.0_f64.max(rotary[0].abs()), -60.0], 1e-12);
}

#[test]
fn a_nutating_head_reaches_its_cone_and_no_further() {
    // B by 180° about the line at 45° lays the tool down; beyond the horizontal nothing can be reached.
    let machine = compiled(&nutating_head());
    let down = machine.solve_direction(tilted(90.0, 90.0)).expect("reachable").branches_rad[0];
    assert_near(&[down[1].abs().to_degrees()], &[180.0], 1e-5);
    let error = machine.solve_direction(tilted(100.0, 90.0)).expect_err("too far");
    let KinematicsError::Unreachable { missing_rad } = error else { panic!("{error:?}") };
    assert_near(&[missing_rad.to_degrees()], &[10.0], 1e-9);
}

#[test]
fn in_a_pole_the_first_axis_stays() {
    for description in [table_table_ac(), head_table(), head_head(), nutating_head()] {
        let machine = compiled(&description);
        let pose = ToolPose { tip_mm: [1.0, 2.0, 3.0], direction: Z };
        let setup = Setup::new([0.0; 3], 120.0);
        let solution = machine.inverse(&pose, &setup, [1.25, 0.1]).expect("reachable");
        assert!(solution.singular);
        assert_near(&solution.joints.rotary_rad, &[1.25, 0.0], 1e-12);
        assert_near(&machine.forward(&solution.joints, &setup).tip_mm, &pose.tip_mm, 1e-9);
        assert_eq!(machine.jacobian(&solution.joints, &setup), Err(KinematicsError::Singular));
    }
}

#[test]
fn close_to_a_pole_directions_keep_their_precision() {
    for description in [table_table_ac(), head_table(), head_head(), nutating_head()] {
        let machine = compiled(&description);
        for exponent in 1..=9 {
            let tilt = 10.0_f64.powi(-exponent);
            let direction = tilted(tilt.to_degrees(), 77.0);
            for branch in machine.solve_direction(direction).expect("reachable").branches_rad {
                let error = norm(sub(machine.rotary_directions().at(branch), direction));
                assert!(error < 1e-15, "{error:e} at a tilt of {tilt:e}");
            }
        }
    }
}

#[test]
fn turns_stay_in_range_and_near() {
    let mut description = table_table_bc();
    description.chain[0].range = Some([-200.0, 400.0]);
    let machine = compiled(&description);
    // 350° of C is nearest to 340°; from 30° it is −10°.
    let direction = machine.rotary_directions().at([350.0_f64.to_radians(), 0.5]);
    let c_from = |from: f64| {
        machine.nearest_rotary(direction, [from.to_radians(), 0.5]).expect("in range").map(f64::to_degrees)[0]
    };
    assert_near(&[c_from(340.0), c_from(30.0), c_from(399.0)], &[350.0, -10.0, 350.0], 1e-9);
    // 30° from 400° would be 390°, which is in range; 50° (410°) is not, and C goes back to 50°.
    let at = |c: f64| machine.rotary_directions().at([f64::to_radians(c), 0.5]);
    let c_to =
        |c: f64| machine.nearest_rotary(at(c), [400.0_f64.to_radians(), 0.5]).expect("in range").map(f64::to_degrees);
    assert_near(&[c_to(30.0)[0]], &[390.0], 1e-9);
    // The other branch, C 230° with B negative, is nearer than returning to 50°.
    assert_near(&c_to(50.0), &[230.0, -0.5_f64.to_degrees()], 1e-9);
}

#[test]
fn ranges_that_exclude_both_branches_say_by_how_much() {
    let mut description = table_table_bc();
    description.chain[1].range = Some([-20.0, 20.0]);
    let error = compiled(&description).nearest_rotary(tilted(50.0, 10.0), [0.0; 2]).expect_err("out of range");
    let KinematicsError::OutOfRange { axis, value_rad, range_rad } = error else { panic!("{error:?}") };
    assert_eq!((axis, range_rad), (Axis::B, [-20.0_f64, 20.0].map(f64::to_radians)));
    assert_near(&[value_rad.abs().to_degrees(), error.excess_rad().to_degrees()], &[50.0, 30.0], 1e-9);
}

#[test]
fn rollover_takes_the_short_path_and_counting_the_programmed_one() {
    let mut description = table_table_bc();
    description.chain[0].wrap = Wrap::Rollover;
    let machine = compiled(&description);
    let degrees = |value: f64| value.to_radians();
    let approached = |rotary, from_deg| machine.approach_deg(rotary, 10.0, from_deg);
    assert_near(&[approached(0, 350.0), approached(0, -350.0), approached(1, 350.0)], &[370.0, -350.0, 10.0], 0.0);
    assert_near(&[machine.approach_deg(0, 180.0, 0.0)], &[180.0], 0.0);
    assert_near(&[machine.displayed(0, degrees(370.0))], &[degrees(10.0)], 1e-12);
    assert_near(&[machine.displayed(0, -1e-20)], &[0.0], 0.0);
}

fn sweep(degrees: impl Iterator<Item = f64>, azimuth: f64) -> Vec<Vec3> {
    degrees.map(|degrees| tilted(degrees, azimuth)).collect()
}

#[test]
fn a_cut_through_the_pole_keeps_c_and_changes_the_branch() {
    let machine = compiled(&table_table_bc());
    let directions = sweep((-30..=30).map(f64::from), 25.0);
    let start = machine.choose_start(directions, &Setup::new([0.0; 3], 0.0), [0.0; 2]).expect("possible");
    assert_near(&[start.start_rad[0] - start.end_rad[0]], &[0.0], 1e-9);
    assert_near(&[start.start_rad[1] + start.end_rad[1]], &[0.0], 1e-9);
    assert_near(&[start.largest_step_rad.to_degrees()], &[1.0], 1e-9);
    assert_eq!(start.singular, 1);
}

#[test]
fn the_branch_is_chosen_for_the_whole_cut() {
    // A −120°…30°: from upright towards 100°, only A negative gets to the end, though both can start.
    let machine = compiled(&table_table_ac());
    let directions = sweep((1..=100).map(f64::from), 90.0);
    let start = machine.choose_start(directions.clone(), &Setup::new([0.0; 3], 0.0), [3.0, 0.1]).expect("possible");
    assert_near(&start.start_rad, &[0.0, -1.0_f64.to_radians()], 1e-9);
    assert_near(&[start.end_rad[1].to_degrees()], &[-100.0], 1e-9);
    // Starting in the pole C is made ready before: it does not jump at the second block.
    let from_pole = [vec![Z], directions].concat();
    let start = machine.choose_start(from_pole, &Setup::new([0.0; 3], 0.0), [1.0, 0.0]).expect("possible");
    assert_near(&start.start_rad, &[0.0, 0.0], 1e-9);
    assert_near(&[start.largest_step_rad.to_degrees()], &[1.0], 1e-9);
    // Beyond −120° there is no solution, and the place is named.
    let failure = machine
        .choose_start(sweep((1..=130).map(f64::from), 90.0), &Setup::new([0.0; 3], 0.0), [0.0; 2])
        .expect_err("out of range");
    assert_eq!(failure.at, 120);
    assert!(matches!(failure.reason, KinematicsError::OutOfRange { axis: Axis::A, .. }), "{failure:?}");
}

#[test]
fn the_profile_prefers_a_branch() {
    let start = |preferred_branch| {
        let machine = compiled(&KinematicsDescription { preferred_branch, ..table_table_bc() });
        let directions = sweep((10..20).map(f64::from), 0.0);
        machine.choose_start(directions, &Setup::new([0.0; 3], 0.0), [0.1, -0.2]).expect("possible").start_rad[1]
    };
    let degrees = [BranchPreference::Larger, BranchPreference::Smaller, BranchPreference::Nearest]
        .map(|preferred| start(preferred).to_degrees());
    assert_near(&degrees, &[10.0, -10.0, 10.0], 1e-9);
}

#[test]
fn turns_are_chosen_for_the_whole_cut() {
    // C limited to ±200°, starting at 150° and going up by 300°: it must begin a turn lower.
    let mut description = table_table_bc();
    description.chain[0].range = Some([-220.0, 220.0]);
    description.chain[1].range = Some([0.0, 90.0]);
    let machine = compiled(&description);
    let directions: Vec<Vec3> = (0..=30).map(|step| tilted(40.0, 150.0 + 10.0 * f64::from(step))).collect();
    let start = machine.choose_start(directions, &Setup::new([0.0; 3], 0.0), [2.6, 0.7]).expect("possible");
    assert_near(&[start.start_rad[0], start.end_rad[0]].map(f64::to_degrees), &[-210.0, 90.0], 1e-9);
}

#[test]
fn a_great_circle_is_even_and_ends_exactly() {
    let (start, end) = (tilted(10.0, 0.0), tilted(70.0, 120.0));
    let circle = GreatCircle::new(start, end).expect("not opposite");
    assert_eq!((circle.at(0.0), circle.at(1.0)), (start, end));
    let middle = circle.at(0.5);
    assert_near(&[norm(middle), norm(sub(middle, start)) - norm(sub(middle, end))], &[1.0, 0.0], 1e-15);
    assert_eq!(GreatCircle::new(X, [-1.0, 0.0, 0.0]), Err(OppositeDirections));
    assert_eq!(GreatCircle::new(X, X).expect("equal").at(0.3), X);
}

#[test]
fn opposite_angle_paths_keep_the_tip_in_place() {
    // Only the rotary axes move: the tool centre point stays where it is.
    let machine = compiled(&head_head());
    let direction = DirectionPath::Angles { start_rad: [0.0, 0.0], end_rad: [2.0, 1.0] };
    let segment = FiveAxisSegment { start_mm: [5.0, 6.0, 7.0], end_mm: [5.0, 6.0, 7.0], direction };
    let setup = Setup::new([0.0; 3], 75.0);
    for step in 0..=20 {
        let solution = segment.joints(&machine, &setup, f64::from(step) / 20.0, [0.0; 2]).expect("a pose");
        assert_near(&machine.forward(&solution.joints, &setup).tip_mm, &[5.0, 6.0, 7.0], 1e-9);
        assert_eq!(solution.singular, step == 0);
    }
}

fn fields(description: &KinematicsDescription) -> Vec<String> {
    let problems = Kinematics::new(description).expect_err("invalid");
    problems.into_iter().map(|problem| problem.field).collect()
}

#[test]
fn invalid_descriptions_are_refused_field_by_field() {
    let broken = |change: fn(&mut KinematicsDescription)| {
        let mut description = table_table_bc();
        change(&mut description);
        fields(&description)
    };
    assert_eq!(broken(|d| d.chain[0].direction = [0.0; 3]), ["chain[0].direction"]);
    assert_eq!(broken(|d| d.chain[2].direction = [f64::NAN, 0.0, 1.0]), ["chain[2].direction"]);
    assert_eq!(broken(|d| d.chain[1].point_mm[2] = f64::INFINITY), ["chain[1].point_mm"]);
    assert_eq!(broken(|d| d.chain[1].range = Some([10.0, 10.0])), ["chain[1].range"]);
    assert_eq!(broken(|d| d.chain[4].range = Some([0.0, 1e9])), ["chain[4].range"]);
    assert_eq!(broken(|d| d.chain[4].axis = Axis::X), ["chain[4].axis"]);
    assert_eq!(broken(|d| d.chain[2].axis = Axis::A), ["chain"]);
    assert_eq!(broken(|d| d.chain.truncate(4)), ["chain"]);
    assert_eq!(broken(|d| d.chain[4].direction = [1.0, 1.0, 0.0]), ["chain"]);
    assert_eq!(broken(|d| d.chain[0].direction = [0.0, -1.0, 0.0]), ["chain[1].direction"]);
    assert_eq!(broken(|d| d.tool_direction = Y), ["tool_direction"]);
    assert_eq!(broken(|d| d.tool_direction = [0.0; 3]), ["tool_direction"]);
    assert_eq!(broken(|d| d.gauge_point_mm[0] = 1e300), ["gauge_point_mm"]);
    let rollover_in_range = |d: &mut KinematicsDescription| {
        d.chain[0].range = Some([0.0, 90.0]);
        d.chain[0].wrap = Wrap::Rollover;
    };
    assert_eq!(broken(rollover_in_range), ["chain[0].wrap"]);
    assert_eq!(fields(&machine(vec![])), ["chain"]);
}

#[test]
fn descriptions_are_data() {
    let json = r#"{
        "chain": [
            { "axis": "C", "direction": [0, 0, 1], "wrap": "rollover" },
            { "axis": "B", "direction": [0, 1, 0], "point_mm": [0.2, 0, -60], "range": [-5, 110] },
            { "axis": "X", "direction": [1, 0, 0] },
            { "axis": "Y", "direction": [0, 1, 0] },
            { "axis": "Z", "direction": [0, 0, 1] }
        ],
        "gauge_point_mm": [0, 0, 500],
        "tool_direction": [0, 0, 1],
        "preferred_branch": "larger"
    }"#;
    let description: KinematicsDescription = serde_json::from_str(json).expect("a description");
    let again = serde_json::to_string(&description).expect("json");
    assert_eq!(serde_json::from_str::<KinematicsDescription>(&again).expect("a description"), description);
    let machine = compiled(&description);
    assert_eq!(machine.letters(), ([Axis::X, Axis::Y, Axis::Z], [Axis::C, Axis::B]));
    let joints = JointValues { linear_mm: [1.0, 2.0, 3.0], rotary_rad: [PI, FRAC_PI_2] };
    let position = machine.to_position(&joints);
    assert_eq!(position, [1.0, 2.0, 3.0, 0.0, 90.0, 180.0, 0.0, 0.0, 0.0]);
    assert_eq!(machine.from_position(&position), joints);
    let beyond = JointValues { rotary_rad: [0.0, 2.0], ..joints };
    assert_eq!(machine.out_of_range(&beyond).map(|(axis, _)| axis).collect::<Vec<_>>(), [Axis::B]);
    assert_eq!(machine.out_of_range(&joints).count(), 0);
    assert!(serde_json::from_str::<KinematicsDescription>(&json.replace("wrap", "warp")).is_err());
}
