use feedwave_program::{Move, MoveKind, SourceSpan};
use proptest::prelude::*;

use super::test_path::{Shape, at, chain, line, lines, moved, shapes};
use super::vector::{difference, dot, linear, norm, scaled};
use super::*;

/// Feed, mm/min; the curve at a corner has the slower one, and 0 keeps every corner.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Cut(pub(super) f64);

impl Carried for Cut {
    fn at_corner(&self, next: &Self) -> Option<Self> {
        let slower = self.0.min(next.0);
        (slower > 0.0).then_some(Self(slower))
    }

    fn is_alike_everywhere(&self) -> bool {
        true
    }
}

pub(super) const fn within(tolerance_mm: f64, merge_tolerance_mm: f64) -> PathControl {
    PathControl::Continuous { tolerance_mm, merge_tolerance_mm }
}

/// Each corner by itself.
const fn each_corner(machine: &Machine) -> Joining<'_> {
    Joining { machine, many_blocks: false, corner_speed: CornerSpeed::Steady, corners: None }
}

pub(super) type Block = (Element, PathControl, Cut);

/// Blocks on lines 1, 2, 3... with one control.
pub(super) fn blocks(elements: Vec<Element>, control: PathControl) -> Vec<Block> {
    let number = |(mut element, line): (Element, u32)| {
        element.source = SourceSpan { line, column: 1, length: 1, ..SourceSpan::default() };
        (element, control, Cut(100.0))
    };
    elements.into_iter().zip(1..).map(number).collect()
}

fn smooth(blocks: &[Block]) -> Vec<Smoothed<Cut>> {
    let mill = Machine::mill();
    let mut smoother = PathSmoother::default();
    let mut smoothed = Vec::new();
    for (element, control, cut) in blocks {
        smoother.push(element.clone(), *control, *cut, each_corner(&mill), &mut |element| smoothed.push(element));
    }
    smoother.flush(each_corner(&mill), &mut |element| smoothed.push(element));
    assert_eq!(smoother, PathSmoother::default(), "nothing is left behind");
    smoothed
}

/// Three sides of a square of 10 mm.
fn sides() -> Vec<Element> {
    let by = [[10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [-10.0, 0.0, 0.0]];
    chain(&by.map(|by| Shape::Line { by }))
}

#[test]
fn exact_path_goes_straight_through() {
    for (control, rest_at_end) in [(PathControl::ExactPath, false), (PathControl::ExactStop, true)] {
        let mill = Machine::mill();
        let mut smoother = PathSmoother::default();
        for (element, control, cut) in blocks(sides(), control) {
            let mut smoothed = Vec::new();
            smoother.push(element.clone(), control, cut, each_corner(&mill), &mut |element| smoothed.push(element));
            assert_eq!(
                smoothed,
                [Smoothed {
                    element,
                    carried: cut,
                    blocks: 1,
                    rest_at_end,
                    origin: Origin::Block,
                    deviation: Deviation::default()
                }]
            );
        }
        assert_eq!(smoother, PathSmoother::default());
    }
}

#[test]
fn corners_of_a_square_are_rounded() {
    let smoothed = smooth(&blocks(sides(), within(0.01, 0.0)));
    let lines: Vec<u32> = smoothed.iter().map(|smoothed| smoothed.element.source.line).collect();
    assert_eq!(lines, [1, 2, 2, 3, 3]);
    assert_eq!(smoothed.iter().map(|smoothed| smoothed.blocks).collect::<Vec<_>>(), [1, 0, 1, 0, 1]);
    let cut_mm = 0.030_943_476;
    assert_eq!(smoothed[0].element.start, at([0.0; 3]));
    assert!((smoothed[0].element.length - (10.0 - cut_mm)).abs() < 1e-8);
    assert!((smoothed[2].element.length - (10.0 - 2.0 * cut_mm)).abs() < 2e-8);
    assert_eq!(smoothed[4].element.end, at([0.0, 10.0, 0.0]));
    let corner = &smoothed[1].element;
    let middle = linear(&corner.position(0.5 * corner.length));
    let deviation_mm = norm(difference(middle, [10.0, 0.0, 0.0]));
    assert!(deviation_mm <= 0.01 && deviation_mm > 0.01 - 1e-8, "{deviation_mm}");
}

#[test]
fn corners_stay_exact_where_they_must() {
    let control = within(0.01, 0.0);
    let unchanged = |blocks: &[Block]| {
        let smoothed = smooth(blocks);
        smoothed.iter().map(|smoothed| &smoothed.element).eq(blocks.iter().map(|(element, ..)| element))
    };
    let square = blocks(sides(), control);
    assert!(!unchanged(&square));

    let mut stopping = square.clone();
    stopping[0].1 = PathControl::ExactStop;
    stopping[1].1 = PathControl::ExactPath;
    assert!(unchanged(&stopping), "the block before the corner decides");

    let mut rapid = square.clone();
    rapid[1].0.rapid = true;
    assert!(unchanged(&rapid), "a rapid between cuts");

    let mut offset = square.clone();
    offset[1].0.work_offset[0] = 5.0;
    assert!(unchanged(&offset), "other work offsets");

    let mut rotary = square.clone();
    rotary[1].0.end[3] = 90.0;
    rotary[2].0.start[3] = 90.0;
    rotary[2].0.end[3] = 90.0;
    assert!(unchanged(&rotary), "a rotary axis moves");

    let mut carried = square.clone();
    carried[1].2 = Cut(0.0);
    assert!(unchanged(&carried), "what belongs to the blocks does not go together");
}

#[test]
fn flushing_between_keeps_the_corner() {
    let square = blocks(sides(), within(0.01, 0.01));
    let mill = Machine::mill();
    let mut smoother = PathSmoother::default();
    let mut smoothed = Vec::new();
    for (element, control, cut) in square.iter().cloned() {
        smoother.push(element, control, cut, each_corner(&mill), &mut |element| smoothed.push(element));
        smoother.flush(each_corner(&mill), &mut |element| smoothed.push(element));
    }
    assert!(smoothed.iter().map(|smoothed| &smoothed.element).eq(square.iter().map(|(element, ..)| element)));
}

#[test]
fn the_corner_has_what_belongs_to_both_blocks() {
    let mut square = blocks(sides(), within(0.01, 0.0));
    square[1].2 = Cut(50.0);
    let feeds: Vec<f64> = smooth(&square).iter().map(|smoothed| smoothed.carried.0).collect();
    assert_eq!(feeds, [100.0, 50.0, 50.0, 50.0, 100.0]);
}

pub(super) fn polyline(points: &[Vector]) -> Vec<Element> {
    points.windows(2).map(|pair| line(pair[0], pair[1])).collect()
}

#[test]
fn points_in_a_line_are_merged() {
    let points = [[0.0; 3], [1.0, 0.004, 0.0], [2.0, -0.003, 0.002], [3.0, 0.0, 0.0], [3.0, 5.0, 0.0]];
    let smoothed = smooth(&blocks(polyline(&points), within(0.2, 0.01)));
    assert_eq!(smoothed.iter().map(|smoothed| smoothed.blocks).collect::<Vec<_>>(), [3, 0, 1]);
    assert_eq!(smoothed[0].element.source.line, 3, "the last of its blocks");
    assert_eq!(smoothed[0].element.start, at(points[0]));
    // The corner has what merging left of the tolerance: 0.2 − 0.004.
    let corner = &smoothed[1].element;
    let middle = linear(&corner.position(0.5 * corner.length));
    let deviation_mm = norm(difference(middle, points[3]));
    assert!((deviation_mm - 0.196).abs() < 1e-8, "{deviation_mm}");

    let smoothed = smooth(&blocks(polyline(&points), within(0.05, 0.001)));
    assert_eq!(smoothed.iter().map(|smoothed| smoothed.blocks).sum::<u32>(), 4);
    assert!(smoothed.iter().all(|smoothed| smoothed.blocks <= 1), "points farther off than Q stay");
}

#[test]
fn only_blocks_alike_are_merged() {
    let points: [Vector; 4] = core::array::from_fn(|k| [k as f64, 0.0, 0.0]);
    let control = within(0.01, 0.01);
    let merged = |blocks: &[Block]| smooth(blocks).iter().map(|smoothed| smoothed.blocks).collect::<Vec<_>>();
    let straight = blocks(polyline(&points), control);
    assert_eq!(merged(&straight), [3]);

    let mut other_feed = straight.clone();
    other_feed[1].2 = Cut(70.0);
    assert_eq!(merged(&other_feed), [1, 1, 1]);
    let mut other_control = straight.clone();
    other_control[1].1 = PathControl::ExactStop;
    assert_eq!(merged(&other_control), [1, 1, 1]);
    assert_eq!(merged(&blocks(polyline(&points), within(0.01, 0.0))), [1, 1, 1], "no Q");
}

#[test]
fn a_run_is_bounded() {
    let points: Vec<Vector> = (0..=2_000).map(|k| [f64::from(k), 0.0, 0.0]).collect();
    let mill = Machine::mill();
    let mut smoother = PathSmoother::default();
    let mut smoothed = Vec::new();
    for (element, control, cut) in blocks(polyline(&points), within(0.01, 0.01)) {
        smoother.push(element, control, cut, each_corner(&mill), &mut |element| smoothed.push(element));
        assert!(smoother.between.len() <= MAX_MERGED_POINTS);
    }
    smoother.flush(each_corner(&mill), &mut |element| smoothed.push(element));
    assert_eq!(smoothed.iter().map(|smoothed| smoothed.blocks).collect::<Vec<_>>(), [513, 513, 513, 461]);
}

#[test]
fn rapids_and_rotary_blocks_are_not_merged() {
    let rapid = |x: f64| Move { kind: MoveKind::Rapid, ..moved([x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], None) };
    let elements = [0.0, 1.0, 2.0].map(|x| Element::from_move(&rapid(x), SourceSpan::default()).expect("it moves"));
    assert_eq!(smooth(&blocks(elements.to_vec(), within(0.01, 0.01))).len(), 3);
}

/// Distance from a point to the nearest of the elements, by samples refined around the nearest.
pub(super) fn distance_to(elements: &[Element], point: Vector) -> f64 {
    let to = |element: &Element| {
        let at = |s: f64| norm(difference(linear(&element.position(s)), point));
        if element.curve == Curve::Line {
            let along = linear(&element.tangent(0.0));
            return at(dot(difference(point, linear(&element.start)), along).clamp(0.0, element.length));
        }
        let step = element.length / 60.0;
        let nearest = (0..=60).min_by(|&a, &b| at(f64::from(a) * step).total_cmp(&at(f64::from(b) * step)));
        let mut low = (f64::from(nearest.unwrap_or(0)) - 1.0).max(0.0) * step;
        let mut high = (low + 2.0 * step).min(element.length);
        for _ in 0..35 {
            let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
            if at(a) < at(b) { high = b } else { low = a }
        }
        at(0.5 * (low + high))
    };
    // An element comes no nearer than its start less its length.
    let mut by_start: Vec<(f64, &Element)> = elements
        .iter()
        .map(|element| (norm(difference(linear(&element.start), point)) - element.length, element))
        .collect();
    by_start.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut nearest = f64::INFINITY;
    for (least, element) in by_start {
        if least >= nearest {
            break;
        }
        nearest = nearest.min(to(element));
    }
    nearest
}

fn assert_smooth(original: &[Element], smoothed: &[Smoothed<Cut>], tolerance_mm: f64) -> Result<(), TestCaseError> {
    let elements: Vec<Element> = smoothed.iter().map(|smoothed| smoothed.element.clone()).collect();
    prop_assert_eq!(elements[0].start, original[0].start);
    prop_assert_eq!(elements[elements.len() - 1].end, original[original.len() - 1].end);
    for pair in smoothed.windows(2) {
        let [from, to] = [&pair[0].element, &pair[1].element];
        prop_assert_eq!(from.end, to.start, "no gap");
        if pair.iter().all(|smoothed| smoothed.blocks > 0) {
            continue;
        }
        let [out, into] = [linear(&from.tangent(from.length)), linear(&to.tangent(0.0))];
        let [out_length, into_length] = [norm(out), norm(into)];
        let turn = norm(difference(scaled(into, 1.0 / into_length), scaled(out, 1.0 / out_length)));
        prop_assert!(turn < 1e-6, "direction jumps by {turn}");
        let across = |element: &Element, s: f64, tangent: Vector, length: f64| {
            let second = linear(&element.second_derivative(s));
            let along = dot(second, tangent) / (length * length);
            scaled(difference(second, scaled(tangent, along)), 1.0 / (length * length))
        };
        let bend = difference(across(to, 0.0, into, into_length), across(from, from.length, out, out_length));
        let corner_length = if pair[0].blocks == 0 { from.length } else { to.length };
        prop_assert!(norm(bend) < 1e-6 / corner_length, "curvature jumps by {} on {corner_length}", norm(bend));
    }
    for element in &elements {
        for k in 0..=24 {
            let off_mm = distance_to(original, linear(&element.position(element.length * f64::from(k) / 24.0)));
            prop_assert!(off_mm <= tolerance_mm, "{off_mm} off of {tolerance_mm}");
        }
    }
    for element in original {
        let off_mm = distance_to(&elements, linear(&element.end));
        prop_assert!(off_mm <= tolerance_mm, "the programmed point is {off_mm} off of {tolerance_mm}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn smoothed_paths_are_continuous_and_within_tolerance(
        shapes in prop::collection::vec(shapes(), 1..8), exponent in -3.5..-0.5_f64, share in 0.0..1.0_f64,
    ) {
        let tolerance_mm = 10.0_f64.powf(exponent);
        let original = chain(&shapes);
        let smoothed = smooth(&blocks(original.clone(), within(tolerance_mm, share * tolerance_mm)));
        prop_assert_eq!(smoothed.iter().map(|smoothed| smoothed.blocks as usize).sum::<usize>(), original.len());
        assert_smooth(&original, &smoothed, tolerance_mm)?;
    }

    #[test]
    fn noisy_straight_runs_merge_within_tolerance(
        offsets in prop::collection::vec((0.001..0.5_f64, -1.0..1.0_f64, -1.0..1.0_f64), 2..60), noise_mm in 0.0..0.01_f64,
    ) {
        let mut points = vec![[0.0; 3]];
        for (step, y, z) in offsets {
            points.push([points[points.len() - 1][0] + step, y * noise_mm, z * noise_mm]);
        }
        let original = polyline(&points);
        let smoothed = smooth(&blocks(original.clone(), within(0.1, 0.005)));
        prop_assert_eq!(smoothed.iter().map(|smoothed| smoothed.blocks as usize).sum::<usize>(), original.len());
        assert_smooth(&original, &smoothed, 0.1)?;
        if noise_mm < 0.0017 {
            // Every point is within √2·0.0017 of the axis, and the ends of any line, too: none is farther than 0.0049 from a line.
            prop_assert!(smoothed.len() == 1, "{} elements", smoothed.len());
        }
    }

    #[test]
    fn storing_the_state_between_blocks_changes_nothing(
        shapes in prop::collection::vec(prop_oneof![shapes(), lines()], 1..12),
        controls in prop::collection::vec(0..4_usize, 12),
    ) {
        let controls = controls.into_iter().map(|choice| {
            [PathControl::ExactPath, PathControl::ExactStop, within(0.05, 0.02), within(0.01, 0.0)][choice]
        });
        let mut blocks = blocks(chain(&shapes), PathControl::ExactPath);
        for (block, control) in blocks.iter_mut().zip(controls) {
            block.1 = control;
        }
        let mut stored = Vec::new();
        let mill = Machine::mill();
    let mut smoother = PathSmoother::default();
        for (element, control, cut) in &blocks {
            let bytes = postcard::to_stdvec(&smoother).expect("plain data");
            smoother = postcard::from_bytes(&bytes).expect("just written");
            smoother.push(element.clone(), *control, *cut, each_corner(&mill), &mut |element| stored.push(element));
        }
        smoother.flush(each_corner(&mill), &mut |element| stored.push(element));
        prop_assert_eq!(stored, smooth(&blocks));
    }
}

#[test]
fn a_noisy_run_is_divided_where_a_point_is_farther_from_every_line_than_the_tolerance() {
    // Neighbours in opposite corners of the noise are up to 2·√2 times it apart: 0.0056 mm, where 0.005 mm are permitted.
    let elements = |noise_mm: f64| {
        let points = [[0.0; 3], [0.3, noise_mm, noise_mm], [0.6, -noise_mm, -noise_mm], [0.601, noise_mm, noise_mm]];
        smooth(&blocks(polyline(&points), within(0.1, 0.005))).len()
    };
    assert_eq!((elements(0.00169), elements(0.00199)), (1, 3));
}
