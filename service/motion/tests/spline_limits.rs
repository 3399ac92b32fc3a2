//! The promise of `limit_pieces` on splines: whatever mixture of speed, acceleration and jerk it allows, no axis exceeds
//! its limits anywhere on the piece, and pieces are about as fast as their curvature permits.

use std::f64::consts::FRAC_1_SQRT_2;

use feedwave_motion::{
    Curve, Element, LimitPieces, Machine, MachineAxis, PathMotion, Profile, Spline, limit_pieces, path_limits,
};
use feedwave_program::{Axis, Plane, Position, SourceSpan, SplineGeometry};
use proptest::prelude::*;

fn element(order: u8, points: Vec<[f64; 2]>, weights: Vec<f64>, rise: f64) -> Option<Element> {
    let ([x0, y0], [x1, y1]) = (points[0], points[points.len() - 1]);
    let geometry = SplineGeometry { plane: Plane::Xy, order, points, weights };
    let at = |x, y, z| -> Position { [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
    let (start, end) = (at(x0, y0, 0.0), at(x1, y1, rise));
    let spline = Spline::from_geometry(&geometry, &start, &end)?;
    Element::from_spline(start, end, spline, [0.0; 9], SourceSpan::default(), false)
}

fn cubic(points: [[f64; 2]; 4]) -> Element {
    element(4, points.to_vec(), vec![1.0; 4], 0.0).expect("a regular curve")
}

fn machine(axes: [(f64, f64, f64); 3]) -> Machine {
    let axis = |(axis, (velocity, acceleration, jerk))| MachineAxis::new(axis, velocity, acceleration, jerk);
    Machine { axes: [Axis::X, Axis::Y, Axis::Z].into_iter().zip(axes).map(axis).collect(), ..Machine::mill() }
}

/// Elements with continuous curvature, of up to `spans` spans.
fn elements(spans: usize) -> impl Strategy<Value = Element> {
    let points = |count| prop::collection::vec([-50.0..50.0_f64, -50.0..50.0_f64], count);
    (4_u8..=6, 0..spans, -20.0..20.0_f64)
        .prop_flat_map(move |(order, more, rise)| {
            let count = usize::from(order) + more;
            (Just(order), points(count), prop::collection::vec(0.3..3.0_f64, count), Just(rise))
        })
        .prop_filter_map("a cusp", |(order, points, weights, rise)| element(order, points, weights, rise))
}

fn machines() -> impl Strategy<Value = Machine> {
    let power = |exponent: f64| 10.0_f64.powf(exponent);
    let axis =
        move || (1.0..3.0_f64, 2.0..5.0_f64, 3.0..8.0_f64).prop_map(move |(v, a, j)| (power(v), power(a), power(j)));
    [axis(), axis(), axis()].prop_map(machine)
}

/// Where pieces are examined.
const PLACES: [f64; 6] = [0.01, 0.2, 0.4, 0.6, 0.8, 0.99];

/// Calls `check` with three derivatives by arc length, from differences of the tangent, at places inside each piece.
fn on_each(
    element: &Element,
    pieces: &LimitPieces,
    mut check: impl FnMut(usize, f64, [[f64; 3]; 3]) -> Result<(), TestCaseError>,
) -> Result<(), TestCaseError> {
    let least_radius = 1.0 / element.curvature();
    let mut from = 0.0;
    for (index, piece) in pieces.iter().enumerate() {
        let length = piece.end - from;
        for share in PLACES {
            let s = from + share * length;
            let step = 0.005 * length.min(least_radius);
            let [before, at, after] = [s - step, s, s + step].map(|s| element.tangent(s));
            let second = core::array::from_fn(|axis| (after[axis] - before[axis]) / (2.0 * step));
            let third = core::array::from_fn(|axis| (after[axis] - 2.0 * at[axis] + before[axis]) / (step * step));
            check(index, step, [[at[0], at[1], at[2]], second, third])?;
        }
        from = piece.end;
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn no_mixture_within_the_limits_exceeds_an_axis(
        element in elements(5), machine in machines(),
        superposed in prop::array::uniform3(prop_oneof![Just(0.0), 0.0..0.5_f64]),
    ) {
        let alone = path_limits(&element, &machine, PathMotion::ZERO).expect("nothing is superposed");
        let peaks = PathMotion {
            velocity: superposed[0] * alone.velocity,
            acceleration: superposed[1] * alone.acceleration,
            jerk: superposed[2] * alone.jerk,
        };
        let Ok(pieces) = limit_pieces(&element, &machine, peaks, f64::INFINITY) else { return Ok(()) };
        on_each(&element, &pieces, |index, step, [first, second, third]| {
            let limits = pieces[index].limits;
            prop_assert!(limits.velocity > 0.0 && limits.acceleration > 0.0 && limits.jerk > 0.0);
            let (v, a, j) =
                (limits.velocity + peaks.velocity, limits.acceleration + peaks.acceleration, limits.jerk + peaks.jerk);
            // Tangents are doubles up to 1: differences are as exact as this, relative to the curve's own size.
            let (off_second, off_third) = (2e-14 / step, 4e-14 / (step * step));
            for (k, axis) in machine.axes.iter().enumerate() {
                prop_assert!((v * first[k]).abs() <= axis.max_velocity_per_s * (1.0 + 1e-9));
                for (a, j) in [(a, j), (a, -j), (-a, j), (-a, -j)] {
                    let acceleration = (a * first[k] + v * v * second[k]).abs() - v * v * off_second;
                    prop_assert!(acceleration <= axis.max_acceleration_per_s2 * (1.0 + 1e-6), "{acceleration}");
                    let jerk = (j * first[k] + 3.0 * v * a * second[k] + v * v * v * third[k]).abs();
                    let jerk = jerk - 3.0 * v * a.abs() * off_second - v * v * v * off_third;
                    prop_assert!(jerk <= axis.max_jerk_per_s3 * (1.0 + 1e-6), "{jerk} of {}", axis.max_jerk_per_s3);
                }
            }
            Ok(())
        })?;
    }

    /// The same through positions: the fastest motion from rest to rest, sampled.
    #[test]
    fn the_fastest_motion_keeps_every_axis_within_its_limits(element in elements(5), machine in machines()) {
        let limits = path_limits(&element, &machine, PathMotion::ZERO).expect("nothing is superposed");
        let profile = Profile::solve(element.length, 0.0, 0.0, limits).expect("rest to rest fits");
        const SAMPLES: u32 = 2_000;
        let period = profile.duration() / f64::from(SAMPLES);
        let positions: Vec<Position> =
            (0..=SAMPLES).map(|k| element.position(profile.state(period * f64::from(k)).0)).collect();
        for (k, axis) in machine.axes.iter().enumerate() {
            // Differences are means of the derivatives; a double at 100 mm is exact to 1.4e-14 mm, the fit to 1e-10 mm.
            let off = |order: i32| 1e-12 / period.powi(order);
            for pair in positions.windows(4) {
                let [a, b, c, d] = [0, 1, 2, 3].map(|index: usize| pair[index][k]);
                prop_assert!((b - a).abs() / period <= axis.max_velocity_per_s * (1.0 + 1e-9) + off(1));
                let acceleration = (c - 2.0 * b + a).abs() / (period * period);
                prop_assert!(acceleration <= axis.max_acceleration_per_s2 * (1.0 + 1e-6) + off(2));
                let jerk = (d - 3.0 * c + 3.0 * b - a).abs() / (period * period * period);
                prop_assert!(jerk <= axis.max_jerk_per_s3 * (1.0 + 1e-6) + off(3), "{jerk}");
            }
        }
    }

    #[test]
    fn pieces_cover_the_element_and_the_tightest_is_the_whole_elements(element in elements(5), machine in machines()) {
        let pieces = limit_pieces(&element, &machine, PathMotion::ZERO, f64::INFINITY).expect("nothing is superposed");
        prop_assert!(!pieces.is_empty() && pieces.len() <= 256);
        prop_assert!(pieces.windows(2).all(|pair| pair[0].end < pair[1].end) && pieces[0].end > 0.0);
        prop_assert_eq!(pieces[pieces.len() - 1].end, element.length);
        let whole = path_limits(&element, &machine, PathMotion::ZERO).expect("nothing is superposed");
        let least = |of: fn(&feedwave_motion::PathLimits) -> f64| pieces.iter().map(|piece| of(&piece.limits)).fold(f64::INFINITY, f64::min);
        prop_assert_eq!(whole.velocity, least(|limits| limits.velocity));
        prop_assert_eq!(whole.acceleration, least(|limits| limits.acceleration));
        prop_assert_eq!(whole.jerk, least(|limits| limits.jerk));
    }

    /// Where acceleration limits, pieces take little longer than limits of its own at every place would.
    #[test]
    fn pieces_are_about_as_fast_as_their_curvature_permits(element in elements(1)) {
        let machine = machine([(500.0, 1_000.0, 1e15); 3]);
        let pieces = limit_pieces(&element, &machine, PathMotion::ZERO, f64::INFINITY).expect("nothing is superposed");
        // More are joined more coarsely.
        prop_assume!(pieces.len() < 100);
        let mut least_s_per_mm = vec![0.0_f64; pieces.len()];
        on_each(&element, &pieces, |index, _, [first, second, _]| {
            // The largest v for which v²·|second| + 0.6·A·|first| ≤ A and v²·|second| ≤ 0.8·A.
            let bearable = |k: usize| ((1_000.0 * (1.0 - 0.6 * first[k].abs()).min(0.8)) / second[k].abs()).sqrt();
            least_s_per_mm[index] += (0..3).map(bearable).fold(500.0, f64::min).recip() / PLACES.len() as f64;
            Ok(())
        })?;
        let (mut time, mut least, mut from) = (0.0, 0.0, 0.0);
        for (piece, least_s_per_mm) in pieces.iter().zip(least_s_per_mm) {
            time += (piece.end - from) / piece.limits.velocity;
            least += (piece.end - from) * least_s_per_mm;
            from = piece.end;
        }
        prop_assert!(time <= 1.15 * least, "{time} s for {least} s");
    }
}

#[test]
fn a_circle_is_as_fast_as_an_arc() {
    let radius = 50.0;
    let quarter = element(3, vec![[radius, 0.0], [radius, radius], [0.0, radius]], vec![1.0, FRAC_1_SQRT_2, 1.0], 0.0)
        .expect("regular");
    let machine = machine([(1e4, 1_000.0, 1e12); 3]);
    let pieces = limit_pieces(&quarter, &machine, PathMotion::ZERO, f64::INFINITY).expect("alone");
    // An arc takes √(0.8·A·R).
    let arc = (0.8 * 1_000.0 * radius).sqrt();
    for piece in &pieces {
        assert!(piece.limits.velocity >= 0.85 * arc, "{} of {arc}", piece.limits.velocity);
        assert!(piece.limits.velocity <= 1.2 * arc);
        assert!(piece.limits.acceleration >= 0.55 * 1_000.0, "{}", piece.limits.acceleration);
    }
}

#[test]
fn only_the_sharp_turn_is_slow() {
    // A hairpin of two long legs.
    let hairpin = cubic([[0.0, 0.0], [100.0, 1.0], [100.0, -1.0], [0.0, 0.5]]);
    let machine = machine([(200.0, 1_000.0, 20_000.0); 3]);
    let pieces = limit_pieces(&hairpin, &machine, PathMotion::ZERO, f64::INFINITY).expect("alone");
    let slowest = pieces.iter().map(|piece| piece.limits.velocity).fold(f64::INFINITY, f64::min);
    assert!(pieces[0].limits.velocity > 50.0 * slowest, "{} and {slowest}", pieces[0].limits.velocity);
    assert!(pieces[0].end > 0.3 * hairpin.length);
}

#[test]
fn a_straight_spline_has_the_limits_of_a_line() {
    let straight = cubic([[0.0, 0.0], [3.0, 4.0], [27.0, 36.0], [30.0, 40.0]]);
    let line = Element { curve: Curve::Line, ..straight.clone() };
    let machine = machine([(200.0, 1_000.0, 20_000.0), (100.0, 3_000.0, 10_000.0), (1.0, 1.0, 1.0)]);
    let [spline, line] = [straight, line]
        .map(|element| limit_pieces(&element, &machine, PathMotion::ZERO, f64::INFINITY).expect("alone"));
    assert_eq!(spline.len(), 1);
    for (found, wanted) in [
        (spline[0].limits.velocity, line[0].limits.velocity),
        (spline[0].limits.acceleration, line[0].limits.acceleration),
        (spline[0].limits.jerk, line[0].limits.jerk),
    ] {
        assert!((found / wanted - 1.0).abs() <= 1e-12, "{found} for {wanted}");
    }
}

#[test]
fn a_long_spline_has_a_bounded_number_of_pieces() {
    let points: Vec<[f64; 2]> = (0..400).map(|k| [f64::from(k), if k % 2 == 0 { 0.0 } else { 5.0 }]).collect();
    let count = points.len();
    let zigzag = element(4, points, vec![1.0; count], 0.0).expect("regular");
    let machine = machine([(1e4, 1_000.0, 20_000.0); 3]);
    let pieces = limit_pieces(&zigzag, &machine, PathMotion::ZERO, f64::INFINITY).expect("alone");
    assert!(pieces.len() <= 256, "{}", pieces.len());
}
