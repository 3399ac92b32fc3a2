//! Limits under five-axis motion: setpoints of whole plans, differenced as a drive sees them, on every machine axis.

use feedwave_motion::kinematics::vector::{Vec3, add, scale, sub, unit};
use feedwave_motion::kinematics::{FiveAxisBlock, GreatCircle, Kinematics, Setup, Toward};
use feedwave_motion::{
    Element, Machine, MachineAxis, MotionRequest, PathMotion, Planned, PlannedMotion, Planner, PlannerSettings,
    limit_pieces, stretches,
};
use feedwave_program::{Feed, Position, Spindle};
use proptest::prelude::*;

use super::five_axis::{block, point};
use super::machines::{a_point, compiled, head_head, head_table, nutating_head, table_table_ac, table_table_bc};

/// A block of the path, in `parts` of equal length.
#[derive(Clone, Copy, Debug)]
struct Step {
    travel_mm: Vec3,
    toward: Turn,
    parts: u32,
}

#[derive(Clone, Copy, Debug)]
enum Turn {
    /// By the rotary axes, degrees.
    Angles([f64; 2]),
    /// To a direction that lies across the pole from the present one, beside it by an angle, rad.
    Across { beside_rad: f64, tilt_rad: f64 },
    /// By a vector that is added to the direction.
    Vector(Vec3),
}

fn a_step() -> impl Strategy<Value = Step> {
    let turn = prop_oneof![
        2 => prop::array::uniform2(-40.0..40.0_f64).prop_map(Turn::Angles),
        2 => a_point(0.4).prop_map(Turn::Vector),
        2 => (-5.0..-1.0_f64, 0.05..0.5_f64)
            .prop_map(|(exponent, tilt_rad)| Turn::Across { beside_rad: 10.0_f64.powf(exponent), tilt_rad }),
    ];
    // Now and then the tip rests.
    let travel_mm = prop_oneof![5 => a_point(20.0), 1 => Just([0.0; 3]), 2 => a_point(0.2)];
    (travel_mm, turn, 1_u32..4).prop_map(|(travel_mm, toward, parts)| Step { travel_mm, toward, parts })
}

/// The elements of a path, without what a machine refuses.
fn elements(machine: &Kinematics, setup: &Setup, steps: &[Step], pole_tolerance_rad: f64) -> Vec<Element> {
    let mut at = point(machine, setup, [10.0, -20.0, 30.0], [20.0, 15.0]).expect("in range");
    let mut elements = Vec::new();
    for step in steps {
        let rotary = machine.letters().1.map(|axis| at.position[axis.index()]);
        let from = at;
        for part in 1..=step.parts {
            let share = f64::from(part) / f64::from(step.parts);
            let toward = match step.toward {
                Turn::Angles(turn) => Toward::Angles([0, 1].map(|axis| rotary[axis] + turn[axis] * share)),
                Turn::Vector(travel) => {
                    let to = unit(add(from.direction, travel)).expect("not zero");
                    Toward::Vector(GreatCircle::new(from.direction, to).expect("not opposite").at(share))
                }
                Turn::Across { beside_rad, tilt_rad } => {
                    // Towards the other side of Z, in the plane that passes beside it.
                    let [x, y, _] = from.direction;
                    let azimuth = y.atan2(x) + std::f64::consts::PI;
                    let tilt = [azimuth.cos() * tilt_rad.sin(), azimuth.sin() * tilt_rad.sin(), tilt_rad.cos()];
                    let beside = [-azimuth.sin() * beside_rad, azimuth.cos() * beside_rad, 0.0];
                    let to = unit(add(tilt, beside)).expect("not zero");
                    let Ok(circle) = GreatCircle::new(from.direction, to) else { break };
                    Toward::Vector(circle.at(share))
                }
            };
            let end_mm = add(from.tip_mm, scale(step.travel_mm, share));
            let wanted = FiveAxisBlock { pole_tolerance_rad, ..block(end_mm, toward) };
            let Ok(motion) = machine.elements(setup, &at, &wanted) else { break };
            elements.extend(motion.elements);
            at = motion.end;
        }
    }
    elements
}

fn axes(machine: &Kinematics, jerk_scale: f64) -> Machine {
    let (linear, rotary) = machine.letters();
    let mut axes = Vec::new();
    for (axis, (velocity, acceleration)) in
        linear.into_iter().zip([(400.0, 5_000.0), (300.0, 6_000.0), (200.0, 3_000.0)])
    {
        axes.push(MachineAxis::new(axis, velocity, acceleration, 100_000.0 * jerk_scale));
    }
    for (axis, (velocity, acceleration)) in rotary.into_iter().zip([(180.0, 1_500.0), (90.0, 800.0)]) {
        axes.push(MachineAxis::new(axis, velocity, acceleration, 20_000.0 * jerk_scale));
    }
    Machine { axes, ..Machine::mill() }
}

fn plan(elements: &[Element], machine: &Machine, feed_mm_per_min: f64, period_s: f64) -> Vec<PlannedMotion> {
    let mut planner = Planner::<()>::new(PlannerSettings::new(machine, 30, period_s));
    for element in elements {
        let top_speed = 2.0 * feed_mm_per_min / 60.0;
        let limits = limit_pieces(element, machine, PathMotion::ZERO, top_speed).expect("nothing is superposed");
        assert!(limits.len() <= 256);
        let stretches = stretches(element, Feed::PerMinute(feed_mm_per_min), &Spindle::STOPPED, machine, &limits);
        planner.push_motion(MotionRequest::new(element.clone(), stretches));
    }
    planner.finish();
    let motion = |item| match item {
        Planned::Motion(motion) => motion,
        Planned::Barrier(()) => unreachable!("none was pushed"),
    };
    std::iter::from_fn(|| planner.pop()).map(motion).collect()
}

/// Positions at every period of the whole plan, with the largest slope of each axis by arc length around.
fn setpoints(motions: &[PlannedMotion], period_s: f64) -> Vec<(Position, Position)> {
    let mut setpoints = Vec::new();
    let mut lead_s = 0.0;
    for motion in motions {
        let slope = motion.element.largest_tangent();
        for stretch in &motion.stretches {
            let duration_s = stretch.profile.duration();
            let mut k = 0;
            let at = |k: u64| k as f64 * period_s - lead_s;
            while at(k) < duration_s {
                if at(k) >= 0.0 {
                    let s = stretch.start + stretch.profile.state(at(k)).0;
                    setpoints.push((motion.element.position(s), slope));
                }
                k += 1;
            }
            lead_s = duration_s - at(k);
        }
    }
    setpoints
}

fn check(elements: &[Element], machine: &Machine, feed_mm_per_min: f64, period_s: f64) -> Result<usize, TestCaseError> {
    let motions = plan(elements, machine, feed_mm_per_min, period_s);
    let setpoints = setpoints(&motions, period_s);
    for (k, window) in setpoints.windows(4).enumerate() {
        for axis in &machine.axes {
            let index = axis.axis.index();
            let [p0, p1, p2, p3] = [0, 1, 2, 3].map(|at: usize| window[at].0[index]);
            let velocity = (p3 - p2) / period_s;
            let acceleration = ((p3 - p2) - (p2 - p1)) / (period_s * period_s);
            let jerk = ((p3 - p2) - 2.0 * (p2 - p1) + (p1 - p0)) / (period_s * period_s * period_s);
            // Polynomials fit to 1e-10, and a place on the path is rounded to 1e-14 mm, which counts where an axis moves much.
            let slope = window.iter().fold(0.0_f64, |slope, (_, slopes)| slope.max(slopes[index]));
            let noise = 2e-10 + 4e-14 * slope;
            let holds = |found: f64, limit: f64, order: i32| {
                found.abs() <= limit * (1.0 + 1e-6) + 2.0_f64.powi(order) * noise / period_s.powi(order)
            };
            prop_assert!(holds(velocity, axis.max_velocity_per_s, 1), "velocity {velocity} of {} at {k}", axis.name);
            prop_assert!(
                holds(acceleration, axis.max_acceleration_per_s2, 2),
                "acceleration {acceleration} of {} at {k}",
                axis.name
            );
            prop_assert!(holds(jerk, axis.max_jerk_per_s3, 3), "jerk {jerk} of {} at {k}", axis.name);
        }
    }
    Ok(setpoints.len())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(120))]

    #[test]
    fn setpoints_of_whole_five_axis_plans_keep_every_limit(
        kind in 0_usize..5,
        steps in prop::collection::vec(a_step(), 1..8),
        feed in 300.0..20_000.0_f64,
        period_s in prop_oneof![Just(1e-3), Just(2e-3), Just(4e-3)],
        jerk_scale in 0.0..2.5_f64,
        tolerance in prop_oneof![Just(0.0), Just(0.01)],
    ) {
        let machine = [table_table_ac, table_table_bc, head_table, head_head, nutating_head][kind]();
        let machine = compiled(&machine);
        let setup = Setup::new([40.0, 10.0, 20.0], 90.0);
        let elements = elements(&machine, &setup, &steps, tolerance);
        let count = check(&elements, &axes(&machine, 10.0_f64.powf(jerk_scale)), feed, period_s)?;
        prop_assert!(elements.is_empty() || count > 4);
    }
}

/// A block in parts is the same motion: it passes their ends at speed.
#[test]
fn a_divided_block_is_run_as_one() {
    let machine = compiled(&head_table());
    let setup = Setup::new([40.0, 10.0, 20.0], 90.0);
    let limits = axes(&machine, 100.0);
    for toward in [Turn::Angles([50.0, 20.0]), Turn::Vector([0.3, 0.4, 0.1])] {
        let times = [1, 20].map(|parts| {
            let elements = elements(&machine, &setup, &[Step { travel_mm: [60.0, 30.0, 0.0], toward, parts }], 0.0);
            let motions = plan(&elements, &limits, 3_000.0, 1e-3);
            motions.iter().flat_map(|motion| &motion.stretches).map(|stretch| stretch.profile.duration()).sum::<f64>()
        });
        // Twenty rests would cost seconds.
        assert!(times[1] < 1.05 * times[0], "{times:?}");
    }
}

/// Beside the pole the feed is as low as the first axis asks for, and only there.
#[test]
fn beside_a_pole_the_feed_is_limited_and_a_tolerance_spares_it() {
    let machine = compiled(&table_table_bc());
    let setup = Setup::new([40.0, 10.0, 20.0], 90.0);
    let limits = axes(&machine, 100.0);
    let start = point(&machine, &setup, [0.0; 3], [0.0, 20.0]).expect("in range");
    let target = unit(add(scale(sub([0.0, 0.0, 1.0], start.direction), 1.0), [0.0, 1e-3, 1.0])).expect("not zero");
    let run = |pole_tolerance_rad: f64| {
        let wanted = FiveAxisBlock { pole_tolerance_rad, ..block([50.0, 0.0, 0.0], Toward::Vector(target)) };
        let motion = machine.elements(&setup, &start, &wanted).expect("possible");
        let planned = plan(&motion.elements, &limits, 3_000.0, 1e-3);
        let time_s: f64 = planned.iter().flat_map(|motion| &motion.stretches).map(|s| s.profile.duration()).sum();
        (motion, time_s)
    };
    let (beside, beside_s) = run(0.0);
    let (through, through_s) = run(0.01);
    let first = machine.letters().1[0].index();
    let turned = |element: &Element| (element.end[first] - element.start[first]).abs();
    assert!(turned(&beside.elements[0]) > 170.0, "{}", turned(&beside.elements[0]));
    assert!(turned(&through.elements[0]) < 10.0, "{}", turned(&through.elements[0]));
    assert_eq!(beside.deviation_rad, 0.0);
    assert!(through.deviation_rad > 1e-4 && through.deviation_rad < 1e-3, "{}", through.deviation_rad);
    // 1 s at the feed alone, and C takes 1 s more for its half turn at 180°/s.
    assert!(through_s < 1.5 && beside_s > through_s + 0.9 && beside_s < 4.0, "{through_s} {beside_s}");
}
