use proptest::prelude::*;

use super::*;
use crate::smoothing::test_path::{chain, line, shapes};

/// Position, tangent and curvature vector of a Bézier curve, from its definition.
fn evaluate(points: &ControlPoints, t: f64) -> (Vector, Vector, Vector) {
    let derivative = |points: &[Vector]| -> Vec<Vector> {
        points.windows(2).map(|pair| scaled(difference(pair[1], pair[0]), (points.len() - 1) as f64)).collect()
    };
    let value = |points: &[Vector]| -> Vector {
        let mut points = points.to_vec();
        while points.len() > 1 {
            points = points.windows(2).map(|pair| sum(scaled(pair[0], 1.0 - t), scaled(pair[1], t))).collect();
        }
        points[0]
    };
    let first = derivative(points);
    let [velocity, acceleration] = [value(&first), value(&derivative(&first))];
    let square = dot(velocity, velocity);
    let across = difference(acceleration, scaled(velocity, dot(acceleration, velocity) / square));
    (value(points), scaled(velocity, 1.0 / square.sqrt()), scaled(across, 1.0 / square))
}

#[test]
fn right_angle_between_lines_is_rounded_by_the_closed_form() {
    let [before, after] = [line([-10.0, 0.0, 0.0], [0.0; 3]), line([0.0; 3], [0.0, 10.0, 0.0])];
    let rounding = rounding(&before, &after, 0.01, 4.5).expect("a corner to round");
    let cut_mm = rounding.cut_mm;
    // u₁ = 0.6375, u₂ = 0.3125: 0.01·16/(1 + 3.1875 + 3.125)/sin 45°
    assert!((cut_mm - 0.030_943_476).abs() < 1e-8, "{cut_mm}");

    let [before, after] = [before.part(0.0, 10.0 - cut_mm).expect("a rest"), after.part(cut_mm, 10.0).expect("a rest")];
    let points = rounding.curve(&before, &after);
    let deviation_mm =
        (0..=1_000).map(|k| norm(evaluate(&points, f64::from(k) * 1e-3).0)).fold(f64::INFINITY, f64::min);
    assert!(deviation_mm <= 0.01 && deviation_mm > 0.01 - 1e-8, "{deviation_mm}");
    let (start, tangent, curvature) = evaluate(&points, 0.0);
    assert!(norm(difference(start, [-cut_mm, 0.0, 0.0])) < 1e-14);
    assert!(norm(difference(tangent, [1.0, 0.0, 0.0])) < 1e-12 && norm(curvature) < 1e-9 / cut_mm);
    let (end, tangent, curvature) = evaluate(&points, 1.0);
    assert!(norm(difference(end, [0.0, cut_mm, 0.0])) < 1e-14);
    assert!(norm(difference(tangent, [0.0, 1.0, 0.0])) < 1e-12 && norm(curvature) < 1e-9 / cut_mm);
}

#[test]
fn least_cosine_is_that_of_170_degrees() {
    assert!((LEAST_CORNER_COSINE - 170.0_f64.to_radians().cos()).abs() < 1e-15);
}

#[test]
fn corners_that_cannot_be_rounded_stay() {
    let before = line([-10.0, 0.0, 0.0], [0.0; 3]);
    let towards =
        |degrees: f64| line([0.0; 3], [10.0 * degrees.to_radians().cos(), 10.0 * degrees.to_radians().sin(), 0.0]);
    assert!(rounding(&before, &towards(169.0), 0.01, 4.5).is_some());
    assert_eq!(rounding(&before, &towards(171.0), 0.01, 4.5), None, "turns back");
    assert_eq!(rounding(&before, &towards(0.05), 0.01, 4.5), None, "tangent already");
    assert_eq!(rounding(&before, &towards(90.0), 0.0, 4.5), None, "no tolerance");
    assert_eq!(rounding(&before, &towards(90.0), 0.01, 0.5 * LEAST_CORNER_CUT_MM), None, "too short");
    assert_eq!(rounding(&before, &line([0.0, 1e-6, 0.0], [0.0, 10.0, 0.0]), 0.01, 4.5), None, "a gap");
}

/// Distance from a point to an element, by dense samples with parabolic refinement around the nearest.
fn distance_to(element: &Element, point: Vector) -> f64 {
    let at = |s: f64| norm(difference(linear(&element.position(s)), point));
    let samples = 100;
    let step = element.length / f64::from(samples);
    let nearest = (0..=samples).min_by(|&a, &b| at(f64::from(a) * step).total_cmp(&at(f64::from(b) * step)));
    let mut low = (f64::from(nearest.unwrap_or(0)) - 1.0).max(0.0) * step;
    let mut high = (low + 2.0 * step).min(element.length);
    for _ in 0..40 {
        let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
        if at(a) < at(b) { high = b } else { low = a }
    }
    at(0.5 * (low + high))
}

proptest! {
    #[test]
    fn curves_stay_within_tolerance_and_continue_direction_and_curvature(
        shapes in prop::collection::vec(shapes(), 2), exponent in -4.0..0.0_f64, share in 0.001..0.5_f64,
    ) {
        let tolerance_mm = 10.0_f64.powf(exponent);
        let elements = chain(&shapes);
        let [before, after] = [&elements[0], &elements[1]];
        let most_cut_mm = share * before.length.min(after.length);
        let Some(rounding) = rounding(before, after, tolerance_mm, most_cut_mm) else { return Ok(()) };
        let cut_mm = rounding.cut_mm;
        prop_assert!((LEAST_CORNER_CUT_MM..=most_cut_mm).contains(&cut_mm));
        let [rest_before, rest_after] = [
            before.part(0.0, before.length - cut_mm).expect("a rest"),
            after.part(cut_mm, after.length).expect("a rest"),
        ];
        let points = rounding.curve(&rest_before, &rest_after);
        for k in 0..=48 {
            let (point, tangent, _) = evaluate(&points, f64::from(k) / 48.0);
            let off_mm = distance_to(before, point).min(distance_to(after, point));
            prop_assert!(off_mm <= tolerance_mm, "{off_mm} of {tolerance_mm} at {k}");
            prop_assert!(tangent.iter().all(|value| value.is_finite()));
        }
        let corner = linear(&before.end);
        let nearest = (0..=2_000).map(|k| norm(difference(evaluate(&points, f64::from(k) / 2_000.0).0, corner)));
        let nearest = nearest.fold(f64::INFINITY, f64::min);
        prop_assert!(nearest <= tolerance_mm * 1.001, "the corner is {nearest} away");

        for (element, s, t) in [(&rest_before, rest_before.length, 0.0), (&rest_after, 0.0, 1.0)] {
            let joint = Joint::of(element, s);
            let (point, tangent, curvature) = evaluate(&points, t);
            prop_assert!(norm(difference(point, joint.point)) < 1e-12);
            prop_assert!(norm(difference(tangent, joint.tangent)) < 1e-9);
            let scale = norm(joint.curvature).max(1.0 / cut_mm);
            prop_assert!(norm(difference(curvature, joint.curvature)) < 1e-6 * scale);
        }
    }

    #[test]
    fn the_tolerance_is_used_where_the_elements_are_long_enough(
        shapes in prop::collection::vec(shapes(), 2), tolerance_mm in 1e-4..1e-2_f64,
    ) {
        let elements = chain(&shapes);
        let [before, after] = [&elements[0], &elements[1]];
        let [from, to] = [Joint::of(before, before.length), Joint::of(after, 0.0)];
        let deflection = libm::acos(dot(from.tangent, to.tangent).clamp(-1.0, 1.0));
        prop_assume!((0.2..2.5).contains(&deflection));
        let most_cut_mm = 0.45 * before.length.min(after.length);
        let found = rounding(before, after, tolerance_mm, most_cut_mm);
        prop_assume!(tolerance_mm > LEAST_CORNER_CUT_MM && most_cut_mm > 4.0 * LEAST_CORNER_CUT_MM);
        let found = found.expect("a corner to round");
        let cut_mm = found.cut_mm;
        let turn = norm(from.curvature).max(norm(to.curvature)) * cut_mm;
        if cut_mm < 0.99 * most_cut_mm && turn < 0.1 {
            let least = tolerance_mm / (found.shape.deviation() * (0.5 * deflection).sin());
            prop_assert!(cut_mm > 0.5 * least, "{cut_mm} of {least}");
        }
    }
}
