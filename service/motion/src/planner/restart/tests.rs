use proptest::prelude::*;

use super::super::start::tests::{Piece, machine, pieces, request};
use crate::{MotionRequest, PathItem, Planned, Planner, PlannerSettings, TooFast};

fn requests(pieces: &[Piece]) -> Vec<MotionRequest> {
    let (machine, mut at, mut heading) = (machine(), [0.0; 9], 0.2);
    pieces.iter().filter_map(|&piece| request(&mut at, &mut heading, piece, &machine)).collect()
}

/// A planner that knows a path and has planned the start of it.
fn knowing(requests: &[MotionRequest], window: usize) -> Planner<u32> {
    let mut planner = Planner::new(PlannerSettings::new(&machine(), window, 1e-3));
    for request in requests {
        planner.push_motion(request.clone());
    }
    planner
}

/// Times and speeds at the starts of what comes out, s and mm/s.
fn taken(planner: &mut Planner<u32>) -> Vec<(f64, f64)> {
    let mut stretches = Vec::new();
    while let Some(Planned::Motion(motion)) = planner.pop() {
        let own = motion.stretches.iter().map(|own| (own.profile.duration(), own.profile.state(0.0).1));
        stretches.extend(own);
    }
    stretches
}

/// The whole path planned again from a speed at another override, in parts or as a whole.
fn again(path: &[MotionRequest], speed: f64, ratio: f64, in_parts: bool) -> Result<Vec<(f64, f64)>, TooFast> {
    let mut planner = Planner::new(PlannerSettings::new(&machine(), 5_000, 1e-3));
    if in_parts {
        planner.restart(speed, ratio, path.iter().cloned().map(PathItem::Motion).collect())?;
    } else {
        planner.feed_override = ratio;
        (planner.entry_speed, planner.overspeed) = (speed, speed);
        (planner.next_plan, planner.next_start) = (usize::MAX, None);
        for request in path {
            planner.push_motion(request.clone());
        }
    }
    planner.finish();
    if planner.too_fast { Err(TooFast) } else { Ok(taken(&mut planner)) }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn parts_take_no_longer_than_the_whole(
        pieces in pieces(), share in 0.0..1.2_f64, ratio in prop_oneof![0.1..2.0_f64, Just(1.0)],
    ) {
        let path = requests(&pieces);
        let first = path[0].stretches[0];
        let speed = share * first.speed_mm_per_s.min(first.limits.velocity);
        let [parts, whole] = [true, false].map(|in_parts| again(&path, speed, ratio, in_parts));
        if let (Ok(parts), Ok(whole)) = (&parts, &whole) {
            let time_s = |stretches: &[(f64, f64)]| stretches.iter().map(|&(time_s, _)| time_s).sum::<f64>();
            let (parts_s, whole_s) = (time_s(parts), time_s(whole));
            prop_assert!(parts_s <= whole_s * 1.001, "{parts_s} and {whole_s} s");
            prop_assert!((parts[0].1 - speed).abs() <= 1e-6 * speed);
        }
        // What the whole permits, the first part does.
        prop_assert!(parts.is_ok() || whole.is_err());
    }

    #[test]
    fn when_it_is_taken_and_when_the_rest_is_known_changes_nothing(
        pieces in pieces(), known in 1..200_usize, ratio in 0.1..2.0_f64, store: bool,
    ) {
        let path = requests(&pieces);
        let known = known.min(path.len());
        let mut outcomes = Vec::new();
        for takes_at_once in [true, false] {
            let mut planner = knowing(&path[..known], 5_000);
            planner.restart(0.0, ratio, Vec::new()).expect("from rest");
            let mut stretches = Vec::new();
            for request in &path[known..] {
                if takes_at_once {
                    stretches.extend(taken(&mut planner));
                }
                planner.push_motion(request.clone());
                if store {
                    let bytes = postcard::to_stdvec(&planner).expect("plain data");
                    planner = postcard::from_bytes(&bytes).expect("its own bytes");
                }
            }
            planner.finish();
            stretches.extend(taken(&mut planner));
            outcomes.push(stretches);
        }
        prop_assert_eq!(&outcomes[0], &outcomes[1]);
    }
}

#[test]
fn a_change_plans_what_lies_close_ahead_however_much_is_known() {
    // 100 mm/s on lines of 0.2 mm: a stop takes 6 mm, and 0.3 s are 30 mm, which is 180 lines.
    let path = requests(&vec![(0.2, None, 6_000.0); 9_000]);
    let mut planner = knowing(&path, 5_000);
    let count = planner.ready.len() + planner.chain.len();
    assert_eq!(count, 9_000);
    for (speed, ratio) in [(100.0, 0.8), (60.0, 1.5), (100.0, 0.0), (0.0, 1.0)] {
        planner.restart(speed, ratio, Vec::new()).expect("there is room to stop");
        let planned = planner.ready.len() + planner.chain.len();
        assert!(planned <= 400, "{planned} elements at {ratio}");
        let left = planner.waiting().count() + planner.ready.len();
        assert_eq!(left, 9_000 + usize::from(planner.is_held()), "an element is divided by a stop inside it");
        planner = knowing(&path, 5_000);
    }
}

#[test]
fn a_change_that_is_not_possible_leaves_the_planner_as_it_was() {
    let path = requests(&[(0.2, None, 6_000.0); 40]);
    let mut planner = knowing(&path, 5_000);
    planner.push_barrier(7);
    let before = planner.clone();
    assert_eq!(planner.restart(150.0, 0.5, Vec::new()), Err(TooFast), "8 mm are too little to stop in");
    assert_eq!(planner, before);
}
