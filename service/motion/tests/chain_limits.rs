//! Limits over whole plans: setpoints of tangent chains, corners and short elements, differenced as a drive sees them.

use feedwave_motion::{
    Element, Machine, MachineAxis, MotionRequest, PathMotion, Planned, PlannedMotion, Planner, PlannerSettings,
    limit_pieces, stretches,
};
use feedwave_program::{ArcGeometry, Axis, Feed, Move, MoveKind, PathControl, Plane, Position, SourceSpan, Spindle};
use proptest::prelude::*;

/// One element, joined to the one before with a turn of direction.
#[derive(Clone, Copy, Debug)]
struct Piece {
    turn_rad: f64,
    shape: Shape,
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    Line {
        length_mm: f64,
    },
    /// `radial_mm` is by how much the end misses the circle.
    Arc {
        radius_mm: f64,
        sweep_rad: f64,
        radial_mm: f64,
    },
}

fn pieces(lengths: std::ops::Range<f64>) -> impl Strategy<Value = Vec<Piece>> {
    let length = lengths.prop_map(|exponent| 10.0_f64.powf(exponent));
    let shape = prop_oneof![
        length.clone().prop_map(|length_mm| Shape::Line { length_mm }),
        (length, 0.02..3.0_f64, any::<bool>(), -0.005..0.005_f64, any::<bool>()).prop_map(
            |(length_mm, sweep_rad, left, radial_mm, exact)| {
                let radius_mm = length_mm / sweep_rad;
                let radial_mm = if exact { 0.0 } else { radial_mm * radius_mm.min(1.0) };
                Shape::Arc { radius_mm, sweep_rad: if left { sweep_rad } else { -sweep_rad }, radial_mm }
            }
        ),
    ];
    // Mostly exactly tangent, often nearly, now and then a corner.
    let turn_rad = prop_oneof![6 => Just(0.0), 5 => -9e-4..9e-4_f64, 1 => -3.0..3.0_f64];
    let piece = (turn_rad, shape).prop_map(|(turn_rad, shape)| Piece { turn_rad, shape });
    prop::collection::vec(piece, 1..30)
}

fn elements(pieces: &[Piece]) -> Vec<Element> {
    let mut at = [0.0, 0.0];
    let mut heading: f64 = 0.7;
    let mut elements = Vec::new();
    for piece in pieces {
        heading += piece.turn_rad;
        let (end, arc) = match piece.shape {
            Shape::Line { length_mm } => ([at[0] + length_mm * heading.cos(), at[1] + length_mm * heading.sin()], None),
            Shape::Arc { radius_mm, sweep_rad, radial_mm } => {
                let side = sweep_rad.signum();
                // Where the radius grows, the path heads outwards of the circle's tangent.
                let tangent = heading + side * (radial_mm / (radius_mm * sweep_rad.abs())).atan();
                let center = [at[0] - side * radius_mm * tangent.sin(), at[1] + side * radius_mm * tangent.cos()];
                let end_tangent = tangent + sweep_rad;
                let end_radius_mm = radius_mm + radial_mm;
                let end = [
                    center[0] + side * end_radius_mm * end_tangent.sin(),
                    center[1] - side * end_radius_mm * end_tangent.cos(),
                ];
                heading = end_tangent - side * (radial_mm / (end_radius_mm * sweep_rad.abs())).atan();
                let clockwise = sweep_rad < 0.0;
                (end, Some(ArcGeometry { plane: Plane::Xy, center, clockwise, sweep_rad }))
            }
        };
        let position = |[x, y]: [f64; 2]| -> Position { [x, y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
        let mv = Move {
            kind: MoveKind::Cutting,
            start: position(at),
            end: position(end),
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
        elements.extend(Element::from_move(&mv, SourceSpan::default()));
        at = end;
    }
    elements
}

/// Two unlike axes; with a high jerk the acceleration limits bind, with a low one the jerk limits.
fn machine(jerk_scale: f64) -> Machine {
    let mut machine = Machine::mill();
    machine.axes = vec![
        MachineAxis::new(Axis::X, 400.0, 6_000.0, 200_000.0 * jerk_scale),
        MachineAxis::new(Axis::Y, 300.0, 4_000.0, 300_000.0 * jerk_scale),
    ];
    machine
}

fn plan(
    elements: &[Element],
    machine: &Machine,
    feed_mm_per_min: f64,
    window: usize,
    period_s: f64,
) -> Vec<PlannedMotion> {
    let mut planner = Planner::<()>::new(PlannerSettings::new(machine, window, period_s));
    for element in elements {
        let limits = limit_pieces(element, machine, PathMotion::ZERO, f64::INFINITY).expect("nothing is superposed");
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

/// Positions of X and Y at every period of the whole plan.
fn setpoints(motions: &[PlannedMotion], period_s: f64) -> Vec<[f64; 2]> {
    let mut setpoints = Vec::new();
    // Time of the stretch's start since the setpoint before it.
    let mut lead_s = 0.0;
    for motion in motions {
        for stretch in &motion.stretches {
            let duration_s = stretch.profile.duration();
            let count = ((duration_s + lead_s) / period_s).floor() as u64;
            for k in 0..=count {
                let time_s = k as f64 * period_s - lead_s;
                if time_s >= 0.0 && time_s < duration_s {
                    let position = motion.element.position(stretch.start + stretch.profile.state(time_s).0);
                    setpoints.push([position[0], position[1]]);
                }
            }
            // Where the next setpoint is due, seen from the end.
            let next = (0..=count + 1).map(|k| k as f64 * period_s - lead_s).find(|&time_s| time_s >= duration_s);
            lead_s = duration_s - next.expect("count + 1 lies beyond the end");
        }
    }
    setpoints
}

fn check(
    pieces: &[Piece],
    machine: &Machine,
    feed_mm_per_min: f64,
    window: usize,
    period_s: f64,
) -> Result<(), TestCaseError> {
    let motions = plan(&elements(pieces), machine, feed_mm_per_min, window, period_s);
    let p = setpoints(&motions, period_s);
    // Positions up to 1e3 mm round to 1.2e-13 mm and an arc's angle to 1e-15 rad of a 100 mm radius: 5e-13 mm in all.
    let noise_mm = 5e-13;
    for k in 3..p.len() {
        for (column, axis) in machine.axes.iter().enumerate() {
            let [p0, p1, p2, p3] = [p[k - 3], p[k - 2], p[k - 1], p[k]].map(|point| point[column]);
            let velocity = (p3 - p2) / period_s;
            let acceleration = ((p3 - p2) - (p2 - p1)) / (period_s * period_s);
            let jerk = ((p3 - p2) - 2.0 * (p2 - p1) + (p1 - p0)) / (period_s * period_s * period_s);
            let holds = |found: f64, limit: f64, order: i32| {
                found.abs() <= limit * (1.0 + 1e-6) + 2.0_f64.powi(order) * noise_mm / period_s.powi(order)
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
    Ok(())
}

/// Corners that are passed with a step of velocity: over any time an axis changes its velocity by no more than one step and what
/// its acceleration permits.
fn check_steps(pieces: &[Piece], machine: &Machine, feed_mm_per_min: f64, period_s: f64) -> Result<(), TestCaseError> {
    let p = setpoints(&plan(&elements(pieces), machine, feed_mm_per_min, 512, period_s), period_s);
    for periods in [1, 2, 3, 5, 8, 21, 55] {
        for k in periods + 1..p.len() {
            for (column, axis) in machine.axes.iter().enumerate() {
                let velocity = |k: usize| (p[k][column] - p[k - 1][column]) / period_s;
                let change = (velocity(k) - velocity(k - periods)).abs();
                let permitted = axis.max_velocity_step_per_s + axis.max_acceleration_per_s2 * periods as f64 * period_s;
                prop_assert!(
                    change <= permitted * (1.0 + 1e-6),
                    "{change} of {permitted} mm/s of {} at {k}",
                    axis.name
                );
            }
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn steps_at_corners_do_not_add_up(
        mut pieces in pieces(-2.5..1.0), turn_rad in 1.1e-3..0.3_f64, count in 0..300_usize, length_exponent in -3.0..0.0_f64,
        feed in 300.0..30_000.0_f64, step_mm_per_s in 0.5..20.0_f64,
        period_s in prop_oneof![Just(2.5e-4), Just(1e-3), Just(4e-3)], jerk_scale in 0.0..3.0_f64,
    ) {
        let shape = Shape::Line { length_mm: 10.0_f64.powf(length_exponent) };
        pieces.extend(vec![Piece { turn_rad, shape }; count]);
        let mut machine = machine(10.0_f64.powf(jerk_scale));
        machine.axes.iter_mut().for_each(|axis| axis.max_velocity_step_per_s = step_mm_per_s);
        check_steps(&pieces, &machine, feed, period_s)?;
    }

    #[test]
    fn setpoints_of_whole_plans_keep_every_limit(
        pieces in pieces(-1.5..2.0), feed in 300.0..30_000.0_f64, window in 2..40_usize,
        period_s in prop_oneof![Just(5e-4), Just(1e-3), Just(2e-3), Just(8e-3)], jerk_scale in 0.0..3.0_f64,
    ) {
        check(&pieces, &machine(10.0_f64.powf(jerk_scale)), feed, window, period_s)?;
    }

    #[test]
    fn many_junctions_within_one_period_keep_every_limit(
        pieces in pieces(-4.0..-0.5), feed in 300.0..30_000.0_f64, window in 2..40_usize,
        period_s in prop_oneof![Just(1e-3), Just(4e-3)], jerk_scale in 0.0..3.0_f64,
    ) {
        check(&pieces, &machine(10.0_f64.powf(jerk_scale)), feed, window, period_s)?;
    }

    #[test]
    fn a_circle_in_chords_is_as_slow_as_the_circle(
        chord_exponent in -4.0..-1.0_f64, turn_rad in 1e-4..9.9e-4_f64, feed in 3_000.0..24_000.0_f64,
        period_s in prop_oneof![Just(1e-3), Just(4e-3)], jerk_scale in 0.0..3.0_f64,
    ) {
        let shape = Shape::Line { length_mm: 10.0_f64.powf(chord_exponent) };
        let pieces = vec![Piece { turn_rad, shape }; 3_000];
        check(&pieces, &machine(10.0_f64.powf(jerk_scale)), feed, 512, period_s)?;
    }
}
