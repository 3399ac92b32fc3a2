//! The planner over its window's edge: short elements, fixed entry speeds, snapshots.

use feedwave_motion::{
    Element, Machine, MotionRequest, PathLimits, Planned, PlannedMotion, Planner, PlannerSettings, Stretch,
};
use feedwave_program::{Feed, Move, MoveKind, PathControl, SourceSpan, Spindle};
use proptest::prelude::*;

const PERIOD_S: f64 = 1e-3;

/// Straight on along X, in pieces with limits and speeds of their own: only lengths and speeds decide.
fn requests(pieces: &[(f64, f64, f64, u32)]) -> Vec<MotionRequest> {
    let mut at = 0.0;
    let mut requests = Vec::new();
    for &(length_mm, speed_mm_per_s, acceleration, parts) in pieces {
        let mut mv = Move {
            kind: MoveKind::Cutting,
            start: [0.0; 9],
            end: [0.0; 9],
            work_offset: [0.0; 9],
            arc: None,
            feed: Feed::PerMinute(60.0 * speed_mm_per_s),
            spindle: Spindle::STOPPED,
            tool: 0,
            spline: None,
            path_control: PathControl::default(),
        };
        mv.start[0] = at;
        mv.end[0] = at + length_mm;
        at = mv.end[0];
        let Some(element) = Element::from_move(&mv, SourceSpan::default()) else { continue };
        let length = element.length;
        let stretch = |part: u32| Stretch {
            end: if part == parts { length } else { length * f64::from(part) / f64::from(parts) },
            // Alternately faster and slower, as with a changing spindle speed.
            speed_mm_per_s: speed_mm_per_s * if part.is_multiple_of(2) { 1.01 } else { 1.0 },
            spindle_rev_per_s: f64::from(part),
        };
        let limits = PathLimits { velocity: 800.0, acceleration, jerk: 30.0 * acceleration };
        requests.push(MotionRequest { element, limits, stretches: (1..=parts).map(stretch).collect() });
    }
    requests
}

fn pieces(exponents: std::ops::Range<f64>) -> impl Strategy<Value = Vec<(f64, f64, f64, u32)>> {
    let piece = (exponents, -1.0..3.0_f64, 1.0..5.0_f64, prop_oneof![4 => Just(1_u32), 1 => 2..6_u32]);
    let power = |exponent: f64| 10.0_f64.powf(exponent);
    let piece = piece.prop_map(move |(length, speed, acceleration, parts)| {
        (power(length), power(speed), power(acceleration), parts)
    });
    prop::collection::vec(piece, 1..60)
}

fn planner(window: usize) -> Planner<u32> {
    Planner::new(PlannerSettings::new(&Machine::mill(), window, PERIOD_S))
}

fn take(planner: &mut Planner<u32>) -> Vec<PlannedMotion> {
    let motion = |item| match item {
        Planned::Motion(motion) => motion,
        Planned::Barrier(_) => unreachable!("none was pushed"),
    };
    std::iter::from_fn(|| planner.pop()).map(motion).collect()
}

fn plan(requests: &[MotionRequest], window: usize) -> Vec<PlannedMotion> {
    let mut planner = planner(window);
    for request in requests {
        planner.push_motion(request.clone());
    }
    planner.finish();
    take(&mut planner)
}

fn duration_s(motions: &[PlannedMotion]) -> f64 {
    motions.iter().flat_map(|motion| &motion.stretches).map(|stretch| stretch.profile.duration()).sum()
}

/// Every profile really does what it promises: it brakes and accelerates within its length.
fn check(requests: &[MotionRequest], motions: &[PlannedMotion]) -> Result<(), TestCaseError> {
    prop_assert_eq!(requests.len(), motions.len());
    let mut speed = 0.0;
    for (request, motion) in requests.iter().zip(motions) {
        prop_assert_eq!(request.stretches.len(), motion.stretches.len());
        for (wanted, stretch) in request.stretches.iter().zip(&motion.stretches) {
            let profile = &stretch.profile;
            prop_assert_eq!(profile.start_velocity().to_bits(), f64::to_bits(speed));
            speed = profile.end_velocity();
            let top = wanted.speed_mm_per_s.min(request.limits.velocity);
            prop_assert!(profile.peak_velocity() <= top * (1.0 + 1e-9), "{} of {top}", profile.peak_velocity());
            // An impossible change would be cut off at the length long before the time is over.
            let just_before_s = profile.duration() * (1.0 - 1e-12);
            let (s, v, _, _) = profile.state(just_before_s);
            let slack_mm = 1e-8 * profile.length() + 1e-12 * profile.peak_velocity() * profile.duration();
            prop_assert!((profile.length() - s).abs() <= slack_mm, "at {s} of {}", profile.length());
            prop_assert!((v - speed).abs() <= 1e-6 * profile.peak_velocity(), "with {v} instead of {speed}");
            if profile.length() > 1e-9 {
                let early = profile.state(profile.duration() * 0.999).0;
                prop_assert!(early < profile.length() || profile.end_velocity() == 0.0, "arrives early");
            }
        }
    }
    prop_assert_eq!(speed, 0.0);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn plans_are_possible_whatever_the_window(pieces in pieces(-3.0..2.0), window in 2..12_usize) {
        let requests = requests(&pieces);
        check(&requests, &plan(&requests, window))?;
    }

    #[test]
    fn plans_of_tiny_elements_at_speed_are_possible_too(pieces in pieces(-9.0..1.0), window in 2..12_usize) {
        let requests = requests(&pieces);
        check(&requests, &plan(&requests, window))?;
    }

    #[test]
    fn a_window_that_holds_the_chain_plans_like_a_larger_one(pieces in pieces(-3.0..2.0)) {
        let requests = requests(&pieces);
        prop_assert_eq!(plan(&requests, requests.len() + 1), plan(&requests, 1_000));
    }

    #[test]
    fn a_snapshot_anywhere_continues_bit_for_bit(
        pieces in pieces(-3.0..2.0), window in 2..12_usize, cuts in prop::collection::vec(0..60_usize, 1..4), eager: bool,
    ) {
        let requests = requests(&pieces);
        let expected = plan(&requests, window);
        let mut planner = planner(window);
        let mut found = Vec::new();
        for (index, request) in requests.iter().enumerate() {
            planner.push_motion(request.clone());
            if eager {
                found.extend(take(&mut planner));
            }
            if cuts.contains(&index) {
                let snapshot = postcard::to_stdvec(&planner).expect("a planner is plain data");
                let restored: Planner<u32> = postcard::from_bytes(&snapshot).expect("its own bytes");
                prop_assert_eq!(&restored, &planner);
                planner = restored;
            }
        }
        planner.finish();
        found.extend(take(&mut planner));
        prop_assert_eq!(found, expected);
    }
}

#[test]
fn a_window_with_room_to_stop_costs_no_time() {
    // 300 mm as one piece, at 50 mm/s, a 1000, j 30 000: each change takes 50/1000 + 1/30 s at half the speed.
    let whole = duration_s(&plan(&requests(&[(300.0, 50.0, 1_000.0, 1)]), 1_000));
    assert!((whole - (300.0 / 50.0 + 50.0 / 1_000.0 + 1.0 / 30.0)).abs() < 1e-9);
    // In pieces every change of speed ends at a piece's end, which takes longer; but only near the path's two ends.
    let pieces = requests(&[(0.1, 50.0, 1_000.0, 1); 3_000]);
    let all_known = duration_s(&plan(&pieces, 4_000));
    assert!(all_known > whole);
    // Within a piece of 0.1 mm the speed changes by j·(0.1/2v)² = 75/v², so that stopping takes 50³/225 = 556 pieces:
    // with so many always ahead, nothing is lost.
    let windowed = duration_s(&plan(&pieces, 1_200));
    assert!((windowed - all_known).abs() <= 1e-6 * all_known, "{windowed} for {all_known}");
    // With hardly any it is slower, and still arrives.
    assert!(duration_s(&plan(&pieces, 10)) > 1.2 * all_known);
}

#[test]
fn barriers_come_out_in_order_and_make_the_path_rest() {
    let all = requests(&[(10.0, 50.0, 1_000.0, 1); 4]);
    let mut planner = planner(100);
    planner.push_barrier(0);
    planner.push_motion(all[0].clone());
    planner.push_motion(all[1].clone());
    assert_eq!(planner.pop(), Some(Planned::Barrier(0)));
    assert_eq!(planner.pop(), None);
    planner.push_barrier(1);
    planner.push_barrier(2);
    planner.push_motion(all[2].clone());
    planner.push_motion(all[3].clone());
    planner.finish();
    planner.finish();
    let items: Vec<_> = std::iter::from_fn(|| planner.pop()).collect();
    let speeds = |item: &Planned<u32>| match item {
        Planned::Motion(motion) => {
            let profile = &motion.stretches[0].profile;
            Some((profile.start_velocity() > 0.0, profile.end_velocity() > 0.0, motion.tangent_end))
        }
        Planned::Barrier(_) => None,
    };
    let found: Vec<_> = items.iter().map(speeds).collect();
    let (first, last) = (Some((false, true, true)), Some((true, false, false)));
    assert_eq!(found, [first, last, None, None, first, last]);
    assert_eq!((&items[2], &items[3]), (&Planned::Barrier(1), &Planned::Barrier(2)));
}
