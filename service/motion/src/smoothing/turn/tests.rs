use proptest::prelude::*;

use super::super::tests::{Block, Cut, blocks, distance_to, polyline, within};
use super::super::vector::{Vector, difference, linear, norm, scaled, sum};
use super::super::{CornerSpeed, Joining, Origin, PathSmoother, Smoothed};
use super::step_share;
use crate::{Element, Machine};

fn smooth(blocks: &[Block], corner_speed: CornerSpeed) -> Vec<Smoothed<Cut>> {
    let machine = Machine::mill();
    let joining = Joining { machine: &machine, many_blocks: true, corner_speed, corners: None };
    let mut smoother = PathSmoother::default();
    let mut smoothed = Vec::new();
    for (element, control, cut) in blocks {
        smoother.push(element.clone(), *control, *cut, joining, &mut |element| smoothed.push(element));
    }
    smoother.flush(joining, &mut |element| smoothed.push(element));
    assert_eq!(smoother, PathSmoother::default(), "nothing is left behind");
    smoothed
}

/// Two lines of 10 mm that run back, with a step between them.
fn u_turn(step_mm: f64) -> Vec<Element> {
    polyline(&[[0.0; 3], [10.0, 0.0, 0.0], [10.0, step_mm, 0.0], [0.0, step_mm, 0.0]])
}

/// Whether the path is a U-turn in one curve, by the lines and blocks of what it is made of.
fn is_turned(smoothed: &[Smoothed<Cut>]) -> bool {
    let parts: Vec<_> = smoothed.iter().map(|part| (part.element.source.line, part.blocks)).collect();
    parts == [(1, 0), (1, 1), (2, 1), (3, 0), (3, 1)] && matches!(smoothed[1].origin, Origin::Corner { .. })
}

#[test]
fn the_step_starts_and_brakes_like_an_axis() {
    for (t, share) in [(-1.0, 0.0), (-0.5, 1.0 / 12.0), (0.0, 0.5), (0.5, 11.0 / 12.0), (1.0, 1.0)] {
        assert!((step_share(t) - share).abs() < 1e-15, "{t}");
    }
}

#[test]
fn a_short_step_is_passed_in_one_reversal() {
    let smoothed = smooth(&blocks(u_turn(0.1), within(0.05, 0.0)), CornerSpeed::Changing);
    assert!(is_turned(&smoothed), "{smoothed:#?}");
    // The lines are exact up to the curve, which turns in the middle of the step, as far before it as the tolerance leaves.
    let [before, _, tip, _, after] = &smoothed[..] else { unreachable!("counted above") };
    assert_eq!([before.element.start[1], before.element.end[1]], [0.0; 2]);
    assert_eq!([after.element.start[1], after.element.end[1]], [0.1; 2]);
    let middle = linear(&tip.element.position(0.5 * tip.element.length));
    assert!(middle[0] > 9.95 && middle[0] < 9.98 && (middle[1] - 0.05).abs() < 1e-6, "{middle:?}");
    // Plans in runs pass it at one speed: they stop.
    assert!(!is_turned(&smooth(&blocks(u_turn(0.1), within(0.05, 0.0)), CornerSpeed::Steady)));
}

#[test]
fn other_corners_are_no_u_turns() {
    for points in [
        // The step is long, the path goes on, or the lines are askew.
        [[0.0; 3], [10.0, 0.0, 0.0], [10.0, 8.0, 0.0], [0.0, 8.0, 0.0]],
        [[0.0; 3], [10.0, 0.0, 0.0], [10.0, 0.1, 0.0], [20.0, 0.1, 0.0]],
        [[0.0; 3], [10.0, 0.0, 0.0], [10.0, 0.1, 0.0], [0.0, 3.0, 0.0]],
    ] {
        assert!(
            !is_turned(&smooth(&blocks(polyline(&points), within(0.05, 0.0)), CornerSpeed::Changing)),
            "{points:?}"
        );
    }
}

/// Largest distance of these elements from a path, at places along them.
fn farthest(from: &[Element], path: &[Element]) -> f64 {
    let places = |element: &Element| {
        (0..=24).map(|k| linear(&element.position(element.length * f64::from(k) / 24.0))).collect::<Vec<_>>()
    };
    from.iter().flat_map(places).map(|point| distance_to(path, point)).fold(0.0, f64::max)
}

proptest! {
    #[test]
    fn u_turns_keep_the_tolerance_and_meet_smoothly(
        lengths in prop::array::uniform2(2.0..40.0_f64),
        step_mm in (-4.0..0.5_f64).prop_map(f64::exp),
        step_turn in -0.8..0.8_f64,
        skew in prop_oneof![Just([0.0; 2]), prop::array::uniform2(-0.06..0.06_f64)],
        tolerance_mm in (-6.0..-0.7_f64).prop_map(f64::exp),
    ) {
        let rounded = |point: Vector| point.map(|value| (value * 1e6).round() / 1e6);
        let corner = [lengths[0], 0.0, 0.0];
        let step = [step_mm * step_turn.sin(), step_mm * step_turn.cos(), 0.2 * step_mm];
        let second = sum(corner, step);
        let back = [-1.0, skew[0], skew[1]];
        let last = sum(second, scaled(back, lengths[1]));
        let original = polyline(&[[0.0; 3], corner, second, last].map(rounded));
        let smoothed = smooth(&blocks(original.clone(), within(tolerance_mm, 0.0)), CornerSpeed::Changing);
        prop_assert_eq!(smoothed[0].element.start, original[0].start);
        prop_assert_eq!(smoothed[smoothed.len() - 1].element.end, original[2].end);
        prop_assert_eq!(smoothed.iter().map(|part| part.blocks).sum::<u32>(), 3);
        let run: Vec<Element> = smoothed.iter().map(|part| part.element.clone()).collect();
        let off_mm = [farthest(&run, &original), farthest(&original, &run)];
        prop_assert!(off_mm[0] <= tolerance_mm && off_mm[1] <= tolerance_mm, "{off_mm:?} off of {tolerance_mm}");
        if is_turned(&smoothed) {
            for part in smoothed.iter().filter(|part| matches!(part.origin, Origin::Corner { .. })) {
                let own_mm = farthest(core::slice::from_ref(&part.element), &original);
                let stated_mm = part.deviation.largest_mm;
                prop_assert!(own_mm <= stated_mm && stated_mm <= tolerance_mm, "{own_mm} off, {stated_mm} stated");
            }
            for pair in run.windows(2) {
                prop_assert_eq!(pair[0].end, pair[1].start);
                let turn = norm(difference(linear(&pair[1].tangent(0.0)), linear(&pair[0].tangent(pair[0].length))));
                prop_assert!(turn < 1e-7, "direction jumps by {turn}");
            }
        }
    }
}
