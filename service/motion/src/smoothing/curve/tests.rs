use core::f64::consts::TAU;

use proptest::prelude::*;

use super::super::test_path::{Shape, chain, shapes};
use super::super::tests::{Block, Cut, blocks, distance_to, polyline, within};
use super::super::vector::{Vector, difference, linear, norm};
use super::super::{CornerSpeed, Joining, Origin, PathSmoother, Smoothed};
use crate::{Curve, Element, Machine, MachineAxis};

fn curve(machine: &Machine) -> Joining<'_> {
    Joining { machine, many_blocks: true, corner_speed: CornerSpeed::Changing, corners: None }
}

fn smooth_on(blocks: &[Block], machine: &Machine) -> Vec<Smoothed<Cut>> {
    let mut smoother = PathSmoother::default();
    let mut smoothed = Vec::new();
    for (element, control, cut) in blocks {
        smoother.push(element.clone(), *control, *cut, curve(machine), &mut |element| smoothed.push(element));
    }
    smoother.flush(curve(machine), &mut |element| smoothed.push(element));
    assert_eq!(smoother, PathSmoother::default(), "nothing is left behind");
    smoothed
}

fn smooth(blocks: &[Block]) -> Vec<Smoothed<Cut>> {
    smooth_on(blocks, &Machine::mill())
}

/// Largest steps of direction and of curvature where elements meet on the way, beside corners that stay on their
/// programmed points.
fn largest_steps(smoothed: &[Smoothed<Cut>], original: &[Element]) -> [f64; 2] {
    let mut largest = [0.0_f64; 2];
    for pair in smoothed.windows(2) {
        let [from, to] = [&pair[0].element, &pair[1].element];
        assert_eq!(from.end, to.start, "no gap");
        if original.iter().any(|element| element.end == from.end) {
            continue;
        }
        let turn = norm(difference(linear(&to.tangent(0.0)), linear(&from.tangent(from.length))));
        let bend = norm(difference(linear(&to.second_derivative(0.0)), linear(&from.second_derivative(from.length))));
        let scale = 1.0 + norm(linear(&to.second_derivative(0.0)));
        // Derivatives of a short piece are off by its rounding.
        let shortest = from.length.min(to.length).min(1.0);
        largest = [largest[0].max(turn * shortest), largest[1].max(bend * shortest * shortest / scale)];
    }
    largest
}

/// Largest distance of these elements from a path, at places along them.
fn farthest(from: &[Element], path: &[Element]) -> f64 {
    let places = |element: &Element| {
        (0..=6).map(|k| linear(&element.position(element.length * f64::from(k) / 6.0))).collect::<Vec<_>>()
    };
    from.iter().flat_map(places).map(|point| distance_to(path, point)).fold(0.0, f64::max)
}

/// Largest distances of the path that is run from the programmed one, and of programmed points from it.
fn distances(smoothed: &[Smoothed<Cut>], original: &[Element]) -> [f64; 2] {
    let run: Vec<Element> = smoothed.iter().map(|smoothed| smoothed.element.clone()).collect();
    [farthest(&run, original), farthest(original, &run)]
}

fn assert_curve(original: &[Element], smoothed: &[Smoothed<Cut>], tolerance_mm: f64) -> Result<(), TestCaseError> {
    prop_assert_eq!(smoothed[0].element.start, original[0].start);
    prop_assert_eq!(smoothed[smoothed.len() - 1].element.end, original[original.len() - 1].end);
    prop_assert_eq!(smoothed.iter().map(|smoothed| smoothed.blocks as usize).sum::<usize>(), original.len());
    let lines: Vec<u32> = smoothed.iter().map(|smoothed| smoothed.element.source.line).collect();
    prop_assert!(lines.is_sorted(), "{lines:?}");
    let [turn, bend] = largest_steps(smoothed, original);
    prop_assert!(turn < 1e-7, "direction jumps by {turn}");
    // Pieces of a hundredth of a millimetre, rounded to 1e-10 mm.
    prop_assert!(bend < 1e-5, "curvature jumps by {bend}");
    for own in smoothed {
        // What a part says of itself bounds how far it is from the programmed path.
        let off_mm = farthest(core::slice::from_ref(&own.element), original);
        let stated_mm = own.deviation.largest_mm;
        prop_assert!(stated_mm <= tolerance_mm, "{stated_mm} stated of {tolerance_mm}");
        let is_curve = matches!(own.origin, Origin::Blocks { .. });
        prop_assert!(!is_curve || off_mm <= stated_mm + 1e-9, "{off_mm} off, {stated_mm} stated");
    }
    let off_mm = distances(smoothed, original);
    prop_assert!(off_mm[0] <= tolerance_mm && off_mm[1] <= tolerance_mm, "{off_mm:?} off of {tolerance_mm}");
    Ok(())
}

/// Chords of a circle, each of this length.
fn circle(radius: f64, chord: f64, sweep_rad: f64) -> Vec<Element> {
    let count = (radius * sweep_rad / chord).round();
    let mut points = Vec::new();
    let mut k = 0.0;
    while k <= count {
        let (sin, cos) = (sweep_rad * k / count).sin_cos();
        points.push([radius * cos, radius * sin, 0.0]);
        k += 1.0;
    }
    polyline(&points)
}

#[test]
fn chords_become_a_circle() {
    let original = circle(20.0, 0.2, TAU);
    let smoothed = smooth(&blocks(original.clone(), within(0.05, 0.0)));
    assert_eq!(smoothed.len(), original.len(), "one element a block");
    assert_curve(&original, &smoothed, 0.05).expect("it is a curve");
    // Away from its ends the curve is the circle: radius, curvature and its change.
    for smoothed in &smoothed[60..original.len() - 60] {
        let element = &smoothed.element;
        for s in [0.0, 0.5 * element.length] {
            let radius = norm(linear(&element.position(s)));
            assert!((radius - 20.0).abs() < 5e-4, "{radius}");
            let curvature = norm(linear(&element.second_derivative(s)));
            assert!((curvature - 0.05).abs() < 1e-3, "{curvature}");
        }
    }
}

#[test]
fn tangent_lines_and_arcs_meet_in_ramps_and_stay_exact_between() {
    let line = Shape::Line { by: [30.0, 0.0, 0.0] };
    let arc = Shape::Arc { radius: 20.0, direction: 0.0, sweep: 0.25 * TAU, rise: 0.0 };
    let up = Shape::Line { by: [0.0, 30.0, 0.0] };
    let original = chain(&[line, arc, up]);
    let smoothed = smooth(&blocks(original.clone(), within(0.02, 0.0)));
    assert_eq!(smoothed.iter().map(|smoothed| smoothed.blocks).collect::<Vec<_>>(), [1, 0, 1, 0, 1]);
    assert_curve(&original, &smoothed, 0.02).expect("it is a curve");
    assert_eq!(smoothed[0].element.curve, Curve::Line);
    assert!(smoothed[0].element.length > 20.0 && smoothed[2].element.length > 10.0);
    let middle = linear(&smoothed[2].element.position(0.5 * smoothed[2].element.length));
    let from_center = difference(middle, [30.0, 20.0, 0.0]);
    assert!((norm(from_center) - 20.0).abs() < 1e-9);
    // The deviation is used: the ramp has no reason to be shorter.
    let off_mm = distances(&smoothed, &original)[0];
    assert!(off_mm > 0.012, "{off_mm}");
}

#[test]
fn a_wall_between_short_blocks_stays_straight() {
    let mut points: Vec<Vector> = vec![[0.0; 3], [40.0, 0.0, 0.0]];
    for k in 1..=30 {
        let (sin, cos) = (f64::from(k) * TAU / 120.0).sin_cos();
        points.push([40.0 + 4.0 * sin, 4.0 - 4.0 * cos, 0.0]);
    }
    points.push([44.0, 40.0, 0.0]);
    let original = polyline(&points);
    let smoothed = smooth(&blocks(original.clone(), within(0.05, 0.0)));
    assert_curve(&original, &smoothed, 0.05).expect("it is a curve");
    let straight_mm: f64 =
        smoothed.iter().filter(|it| it.element.curve == Curve::Line).map(|it| it.element.length).sum();
    assert!(straight_mm > 40.0 - 10.0 + 36.0 - 10.0 - 1e-9, "{straight_mm}");
    for it in smoothed.iter().filter(|it| it.element.curve == Curve::Line) {
        let [start, end] = [linear(&it.element.start), linear(&it.element.end)];
        let on_wall = |point: Vector| point[1].abs() < 1e-9 || (point[0] - 44.0).abs() < 1e-9;
        assert!(on_wall(start) && on_wall(end));
    }
}

#[test]
fn the_curve_stays_within_the_travel_of_the_path() {
    let original = circle(5.0, 0.3, TAU);
    let mut machine = Machine::mill();
    for axis in &mut machine.axes[..2] {
        *axis = MachineAxis { travel_min: Some(-5.0), travel_max: Some(5.0), ..axis.clone() };
    }
    let blocks = blocks(original, within(0.2, 0.0));
    for it in smooth_on(&blocks, &machine) {
        assert_eq!(crate::limits::travel_exceeded(&it.element, &machine), None);
    }
}

#[test]
fn memory_does_not_grow_with_the_path() {
    let machine = Machine::mill();
    let mut smoother = PathSmoother::default();
    let mut given = 0;
    for (count, element) in (1..).zip(circle(50.0, 0.05, TAU)) {
        smoother.push(element, within(0.02, 0.0), Cut(1.0), curve(&machine), &mut |_| given += 1);
        assert!(count - given <= 520, "{} wait", count - given);
    }
}

/// Short blocks that follow a curve with noise, lines and arcs between.
fn mixed() -> impl Strategy<Value = Vec<Shape>> {
    let chords = (3..40_usize, 0.02..1.0_f64, -0.2..0.2_f64, -0.05..0.05_f64, 0.0..TAU).prop_map(
        |(count, length, turn, change, heading)| {
            let mut direction: f64 = heading;
            (0..count)
                .map(|k| {
                    direction += turn + change * k as f64 / count as f64;
                    let by = [length * direction.cos(), length * direction.sin(), 0.02 * length * (k % 3) as f64];
                    Shape::Line { by }
                })
                .collect::<Vec<_>>()
        },
    );
    let one = shapes().prop_map(|shape| vec![shape]);
    prop::collection::vec(prop_oneof![3 => chords, 2 => one], 1..4).prop_map(|parts| parts.concat())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn curves_are_continuous_and_within_tolerance(shapes in mixed(), exponent in -3.0..-0.5_f64) {
        let tolerance_mm = 10.0_f64.powf(exponent);
        let original = chain(&shapes);
        let smoothed = smooth(&blocks(original.clone(), within(tolerance_mm, 0.0)));
        assert_curve(&original, &smoothed, tolerance_mm)?;
    }

    #[test]
    fn storing_the_state_between_blocks_changes_nothing(shapes in mixed(), exponent in -3.0..-0.5_f64) {
        let blocks = blocks(chain(&shapes), within(10.0_f64.powf(exponent), 0.0));
        let machine = Machine::mill();
        let mut stored = Vec::new();
        let mut smoother = PathSmoother::default();
        for (element, control, cut) in &blocks {
            let bytes = postcard::to_stdvec(&smoother).expect("plain data");
            smoother = postcard::from_bytes(&bytes).expect("just written");
            smoother.push(element.clone(), *control, *cut, curve(&machine), &mut |element| stored.push(element));
        }
        smoother.flush(curve(&machine), &mut |element| stored.push(element));
        prop_assert_eq!(stored, smooth(&blocks));
    }
}
