//! The planner over its window's edge: short elements, fixed entry speeds, snapshots.

use feedwave_motion::{
    Element, Machine, MotionRequest, PathItem, PathLimits, Planned, PlannedMotion, Planner, PlannerSettings,
    ProfilePart, Stretch, StretchProfile,
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
            cycle: None,
            leads_xyz: false,
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
            limits: PathLimits { velocity: 800.0, acceleration, jerk: 30.0 * acceleration },
        };
        requests.push(MotionRequest::new(element, (1..=parts).map(stretch).collect()));
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

fn phases(profile: &StretchProfile) -> &ProfilePart {
    profile.phases().expect("a plan of runs")
}

/// Speeds at the start and end of a part of a profile.
fn end_speeds(profile: &StretchProfile) -> [f64; 2] {
    [profile.state(0.0).1, profile.state(profile.duration()).1]
}

/// Every profile really does what it promises: it brakes and accelerates within its length, and its parts follow one
/// another without a step of speed or acceleration.
fn check(requests: &[MotionRequest], motions: &[PlannedMotion]) -> Result<(), TestCaseError> {
    prop_assert_eq!(requests.len(), motions.len());
    let mut before = (0.0, 0.0);
    for (request, motion) in requests.iter().zip(motions) {
        prop_assert_eq!(request.stretches.len(), motion.stretches.len());
        let mut at = 0.0;
        for (wanted, planned) in request.stretches.iter().zip(&motion.stretches) {
            prop_assert_eq!(planned.start, at);
            prop_assert_eq!(planned.stretch, *wanted);
            at = wanted.end;
            let profile = phases(&planned.profile);
            prop_assert!((profile.length() - (wanted.end - planned.start)).abs() <= 1e-9 * profile.whole().length());
            let (_, v, a, _) = profile.state(0.0);
            // Positions on a run round to its length's ulps, where the acceleration changes by jerk times time.
            let rounding_s = 1e-12 * profile.whole().duration();
            let top = wanted.speed_mm_per_s.min(wanted.limits.velocity);
            prop_assert!((v - before.0).abs() <= 1e-6 * top, "speed {v} after {}", before.0);
            let step = 1e-6 * wanted.limits.acceleration + wanted.limits.jerk * rounding_s;
            prop_assert!((a - before.1).abs() <= step, "acceleration {a} after {}", before.1);
            for k in 0..=16 {
                let (_, v, a, j) = profile.state(profile.duration() * (f64::from(k) / 16.0));
                prop_assert!(v <= top * (1.0 + 1e-9), "{v} of {top}");
                prop_assert!(a.abs() <= wanted.limits.acceleration * (1.0 + 1e-9));
                prop_assert!(j.abs() <= wanted.limits.jerk * (1.0 + 1e-9));
                before = (v, a);
            }
            // An impossible change would be cut off at the length long before the time is over.
            let whole = profile.whole();
            let (s, v, _, _) = whole.state(whole.duration() * (1.0 - 1e-12));
            let slack_mm = 1e-8 * whole.length() + 1e-12 * whole.peak_velocity() * whole.duration();
            prop_assert!((whole.length() - s).abs() <= slack_mm, "at {s} of {}", whole.length());
            let exit = whole.end_velocity();
            prop_assert!((v - exit).abs() <= 1e-6 * whole.peak_velocity(), "with {v} instead of {exit}");
        }
        prop_assert_eq!(at, request.element.length);
    }
    prop_assert_eq!(before.0, 0.0);
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
    // In pieces it takes as long: acceleration carries on from one into the next.
    let pieces = requests(&[(0.1, 50.0, 1_000.0, 1); 3_000]);
    let all_known = duration_s(&plan(&pieces, 4_000));
    assert!((all_known - whole).abs() <= 1e-9, "{all_known} for {whole}");
    // A change of speed takes 50/2·(50/1000 + 1/30) mm, 21 pieces: with so many always ahead, nothing is lost.
    let windowed = duration_s(&plan(&pieces, 100));
    assert!((windowed - whole).abs() <= 1e-9, "{windowed} for {whole}");
    // With hardly any it is slower, and still arrives.
    assert!(duration_s(&plan(&pieces, 10)) > 1.2 * whole);
}

#[test]
fn stretches_under_slightly_different_limits_share_a_run_and_a_change_of_feed_divides() {
    let time = |pieces: &[(f64, f64, f64, u32)]| duration_s(&plan(&requests(pieces), 1_000));
    // Every other piece has a tenth less acceleration: no slower than all of them with the lesser one.
    let mixed: Vec<_> = (0..1_000).map(|k| (0.1, 50.0, if k % 2 == 0 { 1_000.0 } else { 900.0 }, 1)).collect();
    let least = time(&[(100.0, 50.0, 900.0, 1)]);
    assert!((time(&mixed) - least).abs() < 1e-9, "{} for {least}", time(&mixed));
    // The feed changes in the middle, where it is programmed, and is reached on both sides.
    let changed = plan(&requests(&[(100.0, 50.0, 1_000.0, 1), (100.0, 49.0, 1_000.0, 1)]), 1_000);
    let peaks: Vec<f64> = changed
        .iter()
        .map(|motion| motion.stretches[0].profile.phases().expect("phases").whole().peak_velocity())
        .collect();
    assert_eq!(peaks, [50.0, 49.0]);
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
            Some(end_speeds(profile).map(|speed| speed > 0.0))
        }
        Planned::Barrier(_) => None,
    };
    let found: Vec<_> = items.iter().map(speeds).collect();
    let (first, last) = (Some([false, true]), Some([true, false]));
    assert_eq!(found, [first, last, None, None, first, last]);
    assert_eq!((&items[2], &items[3]), (&Planned::Barrier(1), &Planned::Barrier(2)));
}

#[test]
fn feed_hold_keeps_what_follows_however_full_the_window_is() {
    // More than a window before a barrier, and more behind it: the window is full when the hold has divided the path.
    let requests = requests(&[(5.0, 40.0, 1_000.0, 1); 8]);
    for speed in [0.0, 1.0] {
        let mut planner = planner(4);
        let motions = |from: usize, to: usize| requests[from..to].iter().cloned().map(PathItem::Motion);
        let path: Vec<_> = motions(0, 6).chain([PathItem::Barrier(7)]).chain(motions(6, 8)).collect();
        planner.restart(speed, 0.0, path.clone()).expect("there is room to stop");
        assert!(planner.is_held());
        // What is run to the place where it rests, and what is behind that.
        assert_eq!(take(&mut planner).len(), usize::from(speed > 0.0));
        let kept: Vec<_> = planner.waiting().map(PathItem::from).collect();
        assert_eq!((kept.len(), &kept[1..]), (path.len(), &path[1..]));
        assert!(matches!(&kept[0], PathItem::Motion(first) if (first.start > 0.0) == (speed > 0.0)));
    }
}

#[test]
fn what_does_not_follow_the_override_is_run_as_programmed_and_held_only_after_it() {
    let mut all = requests(&[(40.0, 50.0, 1_000.0, 1); 3]);
    all[1].follows_override = false;
    let top_speeds = |ratio: f64| {
        let mut planner = planner(100);
        planner.restart(0.0, ratio, all.iter().cloned().map(PathItem::Motion).collect()).expect("from rest");
        planner.finish();
        let speeds: Vec<f64> = take(&mut planner)
            .iter()
            .map(|motion| {
                motion
                    .stretches
                    .iter()
                    .map(|stretch| stretch.profile.phases().expect("phases").whole().peak_velocity())
                    .fold(0.0, f64::max)
            })
            .collect();
        (speeds, planner.is_held())
    };
    assert_eq!(top_speeds(0.5), (vec![25.0, 50.0, 25.0], false));
    assert_eq!(top_speeds(0.0), (vec![], true));
    // While in what does not follow it, the path rests only where that ends.
    let mut planner = planner(100);
    planner.restart(50.0, 0.0, all[1..].iter().cloned().map(PathItem::Motion).collect()).expect("there is room");
    let planned = take(&mut planner);
    assert_eq!((planned.len(), planner.is_held()), (1, true));
    let [entry, exit] = end_speeds(&planned[0].stretches[0].profile);
    assert_eq!((entry, exit, planned[0].stretches[0].stretch.end), (50.0, 0.0, 40.0));
}
