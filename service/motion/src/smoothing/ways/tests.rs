use super::super::Deviation;
use super::super::tests::{Cut, blocks, polyline, within};
use super::*;
use crate::tolerance::LEAST_STOP_KINK;

/// The sharp corners that are to be tried on lines of these lengths, mm, with these turns behind them, rad, within 0.05 mm.
fn tried(legs: &[[f64; 2]]) -> Vec<usize> {
    let machine = Machine::mill();
    let joining = Joining { machine: &machine, many_blocks: true, corner_speed: CornerSpeed::Steady, corners: None };
    let (mut at, mut heading) = ([0.0; 3], 0.0_f64);
    let mut points = vec![at];
    for [length, turn] in legs {
        at[0] += length * libm::cos(heading);
        at[1] += length * libm::sin(heading);
        points.push(at);
        heading += turn;
    }
    let mut smoother = PathSmoother::<Cut>::default();
    for (element, control, carried) in blocks(polyline(&points), within(0.05, 0.0)) {
        let next = Entry {
            full_length_mm: element.length,
            element,
            control,
            carried,
            blocks: 1,
            merged: Deviation::default(),
            start_is_cut: false,
            joins: true,
            corner_speed: CornerSpeed::Steady,
            joint: Joint::Unknown,
        };
        if let Some(before) = smoother.pending.back_mut() {
            before.joint = before.joint_to(&next, joining);
        }
        smoother.pending.push_back(next);
    }
    smoother.undecided(legs.len(), LEAST_STOP_KINK)
}

#[test]
fn corners_between_chords_of_an_arc_are_not_tried() {
    assert!(tried(&[[0.2, 0.4]; 8]).is_empty());
    // The bend of an arc that begins or ends is less at its first corner.
    assert!(tried(&[[0.2, 0.32], [0.15, 0.4], [0.2, 0.5], [0.25, 0.45], [0.2, 0.35]]).is_empty());
}

#[test]
fn corners_that_turn_more_or_otherwise_than_those_beside_them_are_tried() {
    // A square, a step to the other side, a corner among blocks that hardly turn, and one that turns much more.
    assert_eq!(tried(&[[0.2, 1.5]; 4]), [0, 1, 2]);
    assert_eq!(tried(&[[0.2, 0.5], [0.2, -0.5], [0.2, 0.5], [0.2, 0.0]]), [0, 1, 2]);
    assert_eq!(tried(&[[0.2, 0.05], [0.2, 0.05], [0.2, 0.6], [0.2, 0.05], [0.2, 0.05]]), [2]);
    assert_eq!(tried(&[[0.2, 0.2], [0.2, 0.2], [0.2, 0.65], [0.2, 0.2], [0.2, 0.0]]), [2]);
}

#[test]
fn corners_of_blocks_that_are_long_for_the_tolerance_are_tried() {
    assert_eq!(tried(&[[3.0, 0.4]; 4]), [0, 1, 2]);
}
