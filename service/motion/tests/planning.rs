//! Profiles and the planner: closed forms, limits by finite differences, continuity, order and restarts.

use feedwave_motion::{
    Element, LimitPiece, Machine, MachineAxis, MotionRequest, PathLimits, PathMotion, Planned, PlannedMotion, Planner,
    PlannerSettings, Profile, StretchProfile, limit_pieces, path_limits, stretches,
};
use feedwave_program::{
    ArcGeometry, Axis, Feed, Move, MoveKind, PathControl, Plane, Position, SourceSpan, Spindle, SpindleDirection,
    SpindleSpeed,
};
use proptest::prelude::*;

const PERIOD_S: f64 = 1e-3;

fn limits(velocity: f64, acceleration: f64, jerk: f64) -> PathLimits {
    PathLimits { velocity, acceleration, jerk }
}

#[test]
fn rest_to_rest_takes_the_time_of_the_closed_form() {
    // v 100 mm/s, a 1000 mm/s², j 10000 mm/s³: each change of speed takes v/a + a/j = 0.2 s and 10 mm; the
    // remaining 80 mm of 100 mm take 0.8 s: 1.2 s in all.
    let profile = Profile::solve(100.0, 0.0, 0.0, limits(100.0, 1_000.0, 10_000.0)).expect("rest to rest fits");
    assert!((profile.duration() - 1.2).abs() < 1e-12);
    // Too short to reach full acceleration: d = 2·j·(T/4)³ with T the duration.
    let short = Profile::solve(0.02, 0.0, 0.0, limits(100.0, 1_000.0, 10_000.0)).expect("rest to rest fits");
    let quarter = (0.02_f64 / (2.0 * 10_000.0)).cbrt();
    assert!((short.duration() - 4.0 * quarter).abs() < 1e-9 * short.duration());
}

fn profiles() -> impl Strategy<Value = (f64, f64, f64, PathLimits)> {
    let exponent = -9.0..6.0_f64;
    (exponent, 0.0..1.0_f64, 0.0..1.0_f64, 0.1..1_000.0_f64, 1.0..6.0_f64, 2.0..8.0_f64).prop_map(
        |(length, start, end, velocity, acceleration, jerk)| {
            let limits = limits(velocity, 10.0_f64.powf(acceleration), 10.0_f64.powf(jerk));
            (10.0_f64.powf(length), start * velocity, end * velocity, limits)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn profiles_keep_their_limits_and_arrive((length, start, end, limits) in profiles()) {
        let Some(profile) = Profile::solve(length, start, end, limits) else { return Ok(()) };
        let duration = profile.duration();
        prop_assert!(duration.is_finite() && duration >= 0.0);
        // Simpson's rule over the speed, which is quadratic between the steps of the jerk, so that only the up to six
        // steps with a phase boundary inside are inexact, by less than their own length each.
        const STEPS: u32 = 4_000;
        let mut integral = 0.0;
        for k in 0..STEPS {
            let at = |share: f64| profile.state(duration * (f64::from(k) + share) / f64::from(STEPS));
            let [first, middle, last] = [at(0.0), at(0.5), at(1.0)];
            integral += (first.1 + 4.0 * middle.1 + last.1) / 6.0 * duration / f64::from(STEPS);
            let (s, v, a, j) = middle;
            prop_assert!((0.0..=length).contains(&s));
            prop_assert!(v >= -1e-9 * limits.velocity && v <= limits.velocity * (1.0 + 1e-9), "speed {v}");
            prop_assert!(a.abs() <= limits.acceleration * (1.0 + 1e-9), "acceleration {a}");
            prop_assert!(j.abs() <= limits.jerk * (1.0 + 1e-9), "jerk {j}");
        }
        let inexact = 6.0 * profile.peak_velocity() * duration / f64::from(STEPS);
        prop_assert!((integral - length).abs() <= inexact.min(0.01 * length), "{integral} for {length}");
        let before_end = profile.state(duration * (1.0 - 1e-13));
        prop_assert!((before_end.0 - length).abs() <= 1e-9 * length, "arrives at {} of {length}", before_end.0);
        prop_assert!((before_end.1 - end).abs() <= 1e-6 * limits.velocity.max(1e-6), "with {} of {end}", before_end.1);
    }

    #[test]
    fn no_other_cruise_speed_is_faster((length, start, end, limits) in profiles(), share in 0.0..1.0_f64) {
        let Some(profile) = Profile::solve(length, start, end, limits) else { return Ok(()) };
        let lowest = start.max(end);
        let slower = PathLimits { velocity: lowest + share * (limits.velocity - lowest), ..limits };
        if let Some(other) = Profile::solve(length, start, end, slower) {
            prop_assert!(profile.duration() <= other.duration() * (1.0 + 1e-9));
        }
    }

    #[test]
    fn a_fill_gives_the_same_bits_wherever_it_starts(
        (length, start, end, limits) in profiles(), lead in 0.0..1.0_f64, cut in 0..500_usize,
    ) {
        let Some(profile) = Profile::solve(length, start, end, limits) else { return Ok(()) };
        let lead_s = lead * PERIOD_S;
        let (mut s, mut v) = (vec![0.0; 500], vec![0.0; 500]);
        profile.fill(1, PERIOD_S, lead_s, &mut s, &mut v);
        let (mut s_cut, mut v_cut) = (vec![0.0; 500 - cut], vec![0.0; 500 - cut]);
        profile.fill(1 + cut as u64, PERIOD_S, lead_s, &mut s_cut, &mut v_cut);
        for k in cut..500 {
            prop_assert_eq!(s[k].to_bits(), s_cut[k - cut].to_bits());
            prop_assert_eq!(v[k].to_bits(), v_cut[k - cut].to_bits());
            let state = profile.state((k + 1) as f64 * PERIOD_S - lead_s);
            prop_assert!((state.0 - s[k]).abs() <= 1e-12 * length.max(1e-3));
        }
        prop_assert!(s.windows(2).all(|pair| pair[1] >= pair[0]));
    }
}

/// A random path: lines and tangent arcs in XY with a little Z, corners between some of them.
#[derive(Clone, Copy, Debug)]
enum Piece {
    /// Length and turn of direction before it, rad.
    Line(f64, f64),
    /// Radius and sweep, tangent to what is before it.
    Arc(f64, f64),
    Barrier,
}

fn pieces() -> impl Strategy<Value = Vec<Piece>> {
    let piece = prop_oneof![
        4 => (0.001..30.0_f64).prop_map(|length| Piece::Line(length, 0.0)),
        1 => (0.01..30.0_f64, -3.0..3.0_f64).prop_map(|(length, turn)| Piece::Line(length, turn)),
        1 => (0.01..30.0_f64, -9e-4..9e-4_f64).prop_map(|(length, turn)| Piece::Line(length, turn)),
        4 => (0.1..30.0_f64, 0.05..3.0_f64, any::<bool>())
            .prop_map(|(radius, sweep, left)| Piece::Arc(radius, if left { sweep } else { -sweep })),
        1 => Just(Piece::Barrier),
    ];
    prop::collection::vec(piece, 1..40)
}

fn element(start: Position, end: Position, arc: Option<ArcGeometry>) -> Option<Element> {
    let mv = Move {
        kind: MoveKind::Cutting,
        start,
        end,
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
    Element::from_move(&mv, SourceSpan::default())
}

fn elements(pieces: &[Piece]) -> Vec<Option<Element>> {
    let mut at: Position = [0.0; 9];
    let mut heading: f64 = 0.3;
    let mut elements = Vec::new();
    for piece in pieces {
        match *piece {
            Piece::Barrier => elements.push(None),
            Piece::Line(length, turn) => {
                heading += turn;
                let mut end = at;
                end[0] += length * heading.cos();
                end[1] += length * heading.sin();
                elements.extend(element(at, end, None).map(Some));
                at = end;
            }
            Piece::Arc(radius, sweep) => {
                let side = sweep.signum();
                let center = [at[0] - side * radius * heading.sin(), at[1] + side * radius * heading.cos()];
                heading += sweep;
                let mut end = at;
                end[0] = center[0] + side * radius * heading.sin();
                end[1] = center[1] - side * radius * heading.cos();
                let arc = ArcGeometry { plane: Plane::Xy, center, clockwise: sweep < 0.0, sweep_rad: sweep };
                elements.extend(element(at, end, Some(arc)).map(Some));
                at = end;
            }
        }
    }
    elements
}

fn machine(scale: f64) -> Machine {
    let mut machine = Machine::mill();
    machine.axes = vec![
        MachineAxis::new(Axis::X, 400.0 * scale, 6_000.0 * scale, 200_000.0 * scale),
        MachineAxis::new(Axis::Y, 300.0 * scale, 4_000.0 * scale, 300_000.0 * scale),
        MachineAxis::new(Axis::Z, 200.0 * scale, 3_000.0 * scale, 100_000.0 * scale),
    ];
    machine
}

fn plan(elements: &[Option<Element>], machine: &Machine, feed: f64, window: usize, eager: bool) -> Vec<Planned<u32>> {
    let mut planner = Planner::new(PlannerSettings::new(machine, window, PERIOD_S));
    let mut planned = Vec::new();
    for (index, element) in elements.iter().enumerate() {
        match element {
            None => planner.push_barrier(index as u32),
            Some(element) => {
                let limits =
                    limit_pieces(element, machine, PathMotion::ZERO, f64::INFINITY).expect("nothing is superposed");
                let stretches = stretches(element, Feed::PerMinute(feed), &Spindle::STOPPED, machine, &limits);
                planner.push_motion(MotionRequest::new(element.clone(), stretches));
            }
        }
        if eager {
            planned.extend(std::iter::from_fn(|| planner.pop()));
        }
    }
    planner.finish();
    planned.extend(std::iter::from_fn(|| planner.pop()));
    planned
}

fn end_speeds(profile: &StretchProfile) -> [f64; 2] {
    [profile.state(0.0).1, profile.state(profile.duration()).1]
}

fn follows_tangentially(before: Option<&Element>, element: &Element) -> bool {
    before.is_some_and(|before| {
        let (from, to) = (before.tangent(before.length), element.tangent(0.0));
        (0..9).map(|axis| (to[axis] - from[axis]) * (to[axis] - from[axis])).sum::<f64>().sqrt() <= 1e-3
    })
}

fn motions<'a>(planned: &'a [Planned<u32>]) -> Vec<&'a PlannedMotion> {
    let motion = |item: &'a Planned<u32>| match item {
        Planned::Motion(motion) => Some(motion),
        Planned::Barrier(_) => None,
    };
    planned.iter().filter_map(motion).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn plans_are_continuous_in_order_and_independent_of_when_they_are_taken(
        pieces in pieces(), feed in 100.0..20_000.0_f64, window in 2..20_usize,
    ) {
        let elements = elements(&pieces);
        let machine = machine(1.0);
        let planned = plan(&elements, &machine, feed, window, false);
        prop_assert_eq!(&planned, &plan(&elements, &machine, feed, window, true));
        prop_assert_eq!(planned.len(), elements.len());
        let mut speed = 0.0;
        let mut before = None;
        for (index, (item, element)) in planned.iter().zip(&elements).enumerate() {
            match (item, element) {
                (Planned::Barrier(barrier), None) => {
                    prop_assert_eq!(*barrier as usize, index);
                    prop_assert_eq!(speed, 0.0);
                    before = None;
                }
                (Planned::Motion(motion), Some(element)) => {
                    prop_assert_eq!(&motion.element, element);
                    if !follows_tangentially(before, element) {
                        prop_assert_eq!(speed, 0.0);
                    }
                    before = Some(element);
                    let mut at = 0.0;
                    for stretch in &motion.stretches {
                        prop_assert_eq!(stretch.start, at);
                        let [start_velocity, end_velocity] = end_speeds(&stretch.profile);
                        prop_assert!((start_velocity - speed).abs() <= 1e-6 * feed / 60.0, "{start_velocity} after {speed}");
                        prop_assert!((stretch.profile.length() - (stretch.stretch.end - stretch.start)).abs() <= 1e-12);
                        prop_assert!(stretch.profile.phases().expect("phases").whole().peak_velocity() <= feed / 60.0 * (1.0 + 1e-12));
                        speed = end_velocity;
                        at = stretch.stretch.end;
                    }
                    prop_assert_eq!(at, element.length);
                }
                _ => prop_assert!(false, "order is kept"),
            }
        }
        prop_assert_eq!(speed, 0.0);
    }

    #[test]
    fn every_axis_keeps_its_limits_inside_elements(pieces in pieces(), feed in 1_000.0..30_000.0_f64, scale in 0.3..3.0_f64) {
        let machine = machine(scale);
        let planned = plan(&elements(&pieces), &machine, feed, 1_024, false);
        for motion in motions(&planned) {
            for stretch in &motion.stretches {
                let duration = stretch.profile.duration();
                // Third differences over h: rounding of 1e-14 mm, eight times, over h³, stays below 1e-3 of the
                // smallest jerk limit (3e4) for h ≥ 2e-4 s; the error of a difference itself is second order.
                let h = (duration / 400.0).max(2e-4);
                let samples = (duration / h) as usize;
                let at = |k: usize| motion.element.position(stretch.start + stretch.profile.state(k as f64 * h).0);
                for k in 3..=samples {
                    let p = [at(k - 3), at(k - 2), at(k - 1), at(k)];
                    for (axis, limit) in machine.axes.iter().enumerate() {
                        let v = (p[3][axis] - p[2][axis]) / h;
                        let a = (p[3][axis] - 2.0 * p[2][axis] + p[1][axis]) / (h * h);
                        let j = (p[3][axis] - 3.0 * p[2][axis] + 3.0 * p[1][axis] - p[0][axis]) / (h * h * h);
                        prop_assert!(v.abs() <= limit.max_velocity_per_s * (1.0 + 1e-6), "velocity {v}");
                        prop_assert!(a.abs() <= limit.max_acceleration_per_s2 * (1.0 + 1e-6), "acceleration {a}");
                        prop_assert!(j.abs() <= limit.max_jerk_per_s3 * (1.0 + 1e-3), "jerk {j}");
                    }
                }
            }
        }
    }

    #[test]
    fn superposed_motion_and_feed_together_keep_the_limits(
        radius in 1.0..50.0_f64, sweep in 0.5..6.0_f64, frequency in 5.0..60.0_f64, amplitude in 0.001..0.05_f64,
    ) {
        let omega = std::f64::consts::TAU * frequency;
        let peaks = PathMotion {
            velocity: omega * amplitude,
            acceleration: omega * omega * amplitude,
            jerk: omega * omega * omega * amplitude,
        };
        let mut machine = machine(3.0);
        for axis in &mut machine.axes {
            axis.max_jerk_per_s3 = 8e6;
        }
        let elements = elements(&[Piece::Arc(radius, sweep)]);
        let element = elements[0].as_ref().expect("an arc");
        let Ok(limits) = path_limits(element, &machine, peaks) else { return Ok(()) };
        let profile = Profile::solve(element.length, 0.0, 0.0, limits).expect("rest to rest fits");
        let duration = profile.duration();
        let h = 2e-4;
        let at = |k: usize| {
            let t = k as f64 * h;
            element.position(profile.state(t).0 + amplitude * (omega * t).sin())
        };
        let inside = |k: usize| {
            let s = profile.state(k as f64 * h).0;
            s > 2.0 * amplitude && s < element.length - 2.0 * amplitude
        };
        for k in 3..(duration / h) as usize {
            if !(inside(k - 3) && inside(k)) {
                continue;
            }
            let p = [at(k - 3), at(k - 2), at(k - 1), at(k)];
            for (axis, limit) in machine.axes.iter().enumerate() {
                let v = (p[3][axis] - p[2][axis]) / h;
                let a = (p[3][axis] - 2.0 * p[2][axis] + p[1][axis]) / (h * h);
                let j = (p[3][axis] - 3.0 * p[2][axis] + 3.0 * p[1][axis] - p[0][axis]) / (h * h * h);
                prop_assert!(v.abs() <= limit.max_velocity_per_s * (1.0 + 1e-6), "velocity {v}");
                prop_assert!(a.abs() <= limit.max_acceleration_per_s2 * (1.0 + 1e-6), "acceleration {a}");
                prop_assert!(j.abs() <= limit.max_jerk_per_s3 * (1.0 + 1e-3), "jerk {j}");
            }
        }
    }
}

fn face(from_mm: f64, to_mm: f64) -> Element {
    let mut start = [0.0; 9];
    let mut end = [0.0; 9];
    start[0] = from_mm;
    end[0] = to_mm;
    element(start, end, None).expect("it moves")
}

/// Limits that do not matter.
const ANY: &[LimitPiece] =
    &[LimitPiece { end: 0.0, limits: PathLimits { velocity: 1.0, acceleration: 1.0, jerk: 1.0 } }];

fn surface(m_per_min: f64, max_rev_per_min: f64) -> Spindle {
    Spindle { direction: SpindleDirection::Clockwise, speed: SpindleSpeed::Surface { m_per_min, max_rev_per_min } }
}

proptest! {
    #[test]
    fn surface_speed_is_held_within_one_per_cent_and_never_exceeded(
        from in 1.0..200.0_f64, to in -50.0..200.0_f64, m_per_min in 20.0..400.0_f64,
    ) {
        prop_assume!((from - to).abs() > 1e-3);
        let element = face(from, to);
        let machine = Machine::lathe();
        let spindle = surface(m_per_min, 4_000.0);
        let parts = stretches(&element, Feed::PerRevolution(0.2), &spindle, &machine, ANY);
        prop_assert_eq!(parts.last().expect("one at least").end, element.length);
        let mut start = 0.0;
        for part in &parts {
            prop_assert!(part.end > start);
            prop_assert!((part.speed_mm_per_s - 0.2 * part.spindle_rev_per_s).abs() < 1e-12);
            for share in [0.0, 0.3, 0.7, 1.0] {
                let radius = element.position(start + share * (part.end - start))[0].abs();
                let ideal = spindle.rev_per_s(radius).min(machine.max_spindle_rev_per_min / 60.0);
                prop_assert!(part.spindle_rev_per_s <= ideal * (1.0 + 1e-9), "{} of {ideal}", part.spindle_rev_per_s);
                prop_assert!(part.spindle_rev_per_s >= ideal / 1.0201, "{} of {ideal}", part.spindle_rev_per_s);
            }
            start = part.end;
        }
    }
}

#[test]
fn facing_through_the_centre_without_a_clamp_stays_finite() {
    let parts = stretches(
        &face(100.0, -100.0),
        Feed::PerRevolution(0.2),
        &surface(200.0, f64::INFINITY),
        &Machine::lathe(),
        ANY,
    );
    assert!(parts.len() < 2_000, "{}", parts.len());
    assert!(parts.iter().all(|part| part.spindle_rev_per_s.is_finite() && part.spindle_rev_per_s <= 5_000.0 / 60.0));
}

#[test]
fn inverse_time_gives_the_block_its_time() {
    let element = face(0.0, 30.0);
    let parts = stretches(&element, Feed::InverseTime(2.0), &Spindle::STOPPED, &Machine::mill(), ANY);
    // F2 is half a minute for 30 mm.
    assert!((parts[0].speed_mm_per_s - 1.0).abs() < 1e-12);
}

#[test]
fn bad_machines_are_refused_field_by_field() {
    let mut machine = Machine::lathe();
    machine.axes[0].max_velocity_per_s = 0.0;
    machine.axes[1].max_jerk_per_s3 = f64::NAN;
    machine.axes[1].name = "X".to_owned();
    machine.axes[0].max_velocity_step_per_s = -1.0;
    machine.axes[0].travel_min = Some(5.0);
    machine.axes[0].travel_max = Some(5.0);
    machine.max_spindle_rev_per_min = -1.0;
    let fields: Vec<String> = machine.validate().into_iter().map(|problem| problem.field).collect();
    for field in [
        "axes[0].max_velocity_per_s",
        "axes[1].max_jerk_per_s3",
        "axes[1].name",
        "axes[0].max_velocity_step_per_s",
        "axes[0].travel_max",
        "max_spindle_rev_per_min",
    ] {
        assert!(fields.iter().any(|found| found == field), "{field} among {fields:?}");
    }
    machine.axes.clear();
    assert!(machine.validate().iter().any(|problem| problem.field == "axes"));
    assert!(Machine::lathe().validate().is_empty() && Machine::mill().validate().is_empty());
}
