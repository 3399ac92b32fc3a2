use feedwave_program::{ArcGeometry, Axis, Feed, Move, MoveKind, PathControl, Plane, Position, SourceSpan, Spindle};
use proptest::prelude::*;

use crate::{
    Element, Machine, MachineAxis, MachineKind, MotionRequest, PathMotion, Planned, Planner, PlannerSettings,
    limit_pieces, stretches,
};

pub(in crate::planner) fn machine() -> Machine {
    let axes = [Axis::X, Axis::Y, Axis::Z].map(|axis| MachineAxis::new(axis, 200.0, 2_000.0, 30_000.0));
    Machine { kind: MachineKind::Mill, axes: axes.to_vec(), max_spindle_rev_per_min: 20_000.0 }
}

/// Length of a line or radius and sweep of an arc, tangent to what is before; and the feed, mm/min.
pub(in crate::planner) type Piece = (f64, Option<f64>, f64);

pub(in crate::planner) fn request(
    at: &mut Position,
    heading: &mut f64,
    (size, sweep, feed): Piece,
    machine: &Machine,
) -> Option<MotionRequest> {
    let start = *at;
    let arc = sweep.map(|sweep_rad: f64| {
        let side = size * sweep_rad.signum();
        let center = [at[0] - side * heading.sin(), at[1] + side * heading.cos()];
        *heading += sweep_rad;
        (at[0], at[1]) = (center[0] + side * heading.sin(), center[1] - side * heading.cos());
        ArcGeometry { plane: Plane::Xy, center, clockwise: sweep_rad < 0.0, sweep_rad }
    });
    if arc.is_none() {
        at[0] += size * heading.cos();
        at[1] += size * heading.sin();
    }
    let mv = Move {
        kind: MoveKind::Cutting,
        start,
        end: *at,
        work_offset: [0.0; 9],
        arc,
        spline: None,
        path_control: PathControl::default(),
        feed: Feed::PerMinute(feed),
        spindle: Spindle::STOPPED,
        tool: 0,
        leads_xyz: false,
        cycle: None,
    };
    let element = Element::from_move(&mv, SourceSpan::default())?;
    let pieces = limit_pieces(&element, machine, PathMotion::ZERO, f64::INFINITY).ok()?;
    let stretches = stretches(&element, Feed::PerMinute(feed), &Spindle::STOPPED, machine, &pieces);
    Some(MotionRequest::new(element, stretches))
}

/// Time of a path, and how many elements were pushed when the first ones came out.
fn planned(pieces: &[Piece], starts: bool) -> (f64, usize) {
    let machine = machine();
    let mut planner: Planner<()> = Planner::new(PlannerSettings::new(&machine, 5_000, 1e-3));
    if !starts {
        planner.next_start = None;
    }
    let (mut at, mut heading) = ([0.0; 9], 0.2);
    let (mut time_s, mut first) = (0.0, None);
    let mut take = |planner: &mut Planner<()>, pushed: usize| {
        while let Some(Planned::Motion(motion)) = planner.pop() {
            first.get_or_insert(pushed);
            time_s += motion.stretches.iter().map(|stretch| stretch.profile.duration()).sum::<f64>();
        }
    };
    for (index, &piece) in pieces.iter().enumerate() {
        if let Some(request) = request(&mut at, &mut heading, piece, &machine) {
            planner.push_motion(request);
        }
        take(&mut planner, index + 1);
    }
    planner.finish();
    take(&mut planner, pieces.len());
    (time_s, first.unwrap_or_default())
}

pub(in crate::planner) fn pieces() -> impl Strategy<Value = Vec<Piece>> {
    let feed = prop_oneof![Just(1_200.0), Just(6_000.0), Just(30_000.0)];
    let line = (0.05..8.0_f64).prop_map(|length| (length, None));
    let arc = (0.5..40.0_f64, 0.02..1.5_f64, any::<bool>())
        .prop_map(|(radius, sweep, left)| (radius, Some(if left { sweep } else { -sweep })));
    let piece = prop_oneof![3 => line, 1 => arc];
    let scale = prop_oneof![Just(0.1), Just(1.0), Just(4.0)];
    // The feed changes now and then, or hardly ever.
    let rare = prop_oneof![Just(6), Just(200)];
    (prop::collection::vec((piece, any::<u8>()), 40..900), feed, scale, rare).prop_map(|(pieces, feed, scale, rare)| {
        pieces
            .into_iter()
            .map(|((size, sweep), slow)| (scale * size, sweep, if slow % rare == 0 { 0.5 * feed } else { feed }))
            .collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_start_takes_no_time(pieces in pieces()) {
        let ((early_s, _), (whole_s, _)) = (planned(&pieces, true), planned(&pieces, false));
        prop_assert!(early_s <= whole_s * 1.001, "{early_s} and {whole_s} s");
    }
}

#[test]
fn what_the_next_junction_takes_slows_nothing_before_it() {
    // At 32 elements a run at 20 mm/s is known up to its last element, whose next junction is not, and a second of it.
    let pieces = [vec![(0.05, None, 600.0); 22], vec![(3.0, None, 1_200.0); 10], vec![(0.05, None, 600.0); 8]].concat();
    let ((early_s, first), (whole_s, _)) = (planned(&pieces, true), planned(&pieces, false));
    assert_eq!(first, 32);
    assert!((early_s / whole_s - 1.0).abs() < 1e-9, "{early_s} and {whole_s} s");
}

#[test]
fn a_run_that_may_go_on_with_less_acceleration_is_divided_where_that_costs_nothing() {
    // Arcs join the run on lines that is divided by the start.
    let line = (2.0, None, 1_200.0);
    let arcs = [vec![line; 20], [(30.0, Some(0.05), 1_200.0), line].repeat(20)].concat();
    let ((early_s, first), (whole_s, _)) = (planned(&arcs, true), planned(&arcs, false));
    assert_eq!(first, 32);
    assert!(early_s <= whole_s * (1.0 + 1e-9), "{early_s} and {whole_s} s");
}

#[test]
fn the_first_part_comes_when_a_stop_is_known_and_a_second_of_it() {
    // 100 mm/s on lines of 5 mm: a second is 20 of them, a stop takes 6 mm.
    let lines = vec![(5.0, None, 6_000.0); 400];
    assert_eq!(planned(&lines, true).1, 32);
    assert_eq!(planned(&lines, false).1, 400);
    // Short ones take longer to make up a second.
    let short = vec![(0.5, None, 6_000.0); 400];
    assert_eq!(planned(&short, true).1, 243);
}
