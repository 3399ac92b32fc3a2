//! Splines by arc length against the curves they are made from, evaluated by the textbook's recursion.

use std::f64::consts::FRAC_1_SQRT_2;

use feedwave_motion::{Curve, Element, Spline};
use feedwave_program::{Axis, Feed, Move, MoveKind, PathControl, Plane, Position, SourceSpan, Spindle, SplineGeometry};
use proptest::prelude::*;

fn position(x: f64, y: f64, z: f64) -> Position {
    [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

fn geometry(order: u8, points: &[[f64; 2]], weights: &[f64]) -> SplineGeometry {
    SplineGeometry { plane: Plane::Xy, order, points: points.to_vec(), weights: weights.to_vec() }
}

fn cubic(points: [[f64; 2]; 4]) -> SplineGeometry {
    geometry(4, &points, &[1.0; 4])
}

/// The element of a curve in the XY plane that rises from Z0 to `rise`.
fn element(geometry: &SplineGeometry, rise: f64) -> Option<Element> {
    let [[x0, y0], [x1, y1]] = [geometry.points[0], geometry.points[geometry.points.len() - 1]];
    let mv = Move {
        kind: MoveKind::Cutting,
        start: position(x0, y0, 0.0),
        end: position(x1, y1, rise),
        work_offset: [0.0; 9],
        arc: None,
        spline: Some(Box::new(geometry.clone())),
        path_control: PathControl::default(),
        feed: Feed::PerMinute(1_000.0),
        spindle: Spindle::STOPPED,
        tool: 0,
        cycle: None,
        leads_xyz: false,
    };
    Element::from_move(&mv, SourceSpan::default())
}

/// The NURBS in the plane by the recursion of its basis functions, and its length by quadrature.
struct Reference<'a>(&'a SplineGeometry);

impl Reference<'_> {
    fn degree(&self) -> usize {
        usize::from(self.0.order) - 1
    }

    /// The parameter runs from 0 to this.
    fn spans(&self) -> usize {
        self.0.points.len() - self.degree()
    }

    fn knot(&self, index: usize) -> f64 {
        index.saturating_sub(self.degree()).min(self.spans()) as f64
    }

    fn basis(&self, index: usize, degree: usize, u: f64) -> f64 {
        if degree == 0 {
            let last = self.knot(index + 1) == self.spans() as f64 && u == self.knot(index + 1);
            let inside =
                self.knot(index) <= u && (u < self.knot(index + 1) || last) && self.knot(index) < self.knot(index + 1);
            return f64::from(u8::from(inside));
        }
        if u < self.knot(index) || u > self.knot(index + degree + 1) {
            return 0.0;
        }
        let part = |numerator: f64, width: f64, basis: f64| if width > 0.0 { numerator / width * basis } else { 0.0 };
        let (left, right) = (self.knot(index), self.knot(index + degree + 1));
        part(u - left, self.knot(index + degree) - left, self.basis(index, degree - 1, u))
            + part(right - u, right - self.knot(index + 1), self.basis(index + 1, degree - 1, u))
    }

    fn basis_slope(&self, index: usize, u: f64) -> f64 {
        let degree = self.degree();
        let part = |width: f64, basis: f64| if width > 0.0 { degree as f64 / width * basis } else { 0.0 };
        part(self.knot(index + degree) - self.knot(index), self.basis(index, degree - 1, u))
            - part(self.knot(index + degree + 1) - self.knot(index + 1), self.basis(index + 1, degree - 1, u))
    }

    fn sums(&self, basis: impl Fn(usize) -> f64) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for (index, (point, weight)) in self.0.points.iter().zip(&self.0.weights).enumerate() {
            let share = weight * basis(index);
            for (sum, value) in sums.iter_mut().zip([point[0], point[1], 1.0]) {
                *sum += share * value;
            }
        }
        sums
    }

    fn at(&self, u: f64) -> [f64; 2] {
        let [x, y, w] = self.sums(|index| self.basis(index, self.degree(), u));
        [x / w, y / w]
    }

    fn speed(&self, u: f64) -> f64 {
        let [x, y, w] = self.sums(|index| self.basis(index, self.degree(), u));
        let [dx, dy, dw] = self.sums(|index| self.basis_slope(index, u));
        ((dx - dw * x / w) / w).hypot((dy - dw * y / w) / w)
    }

    /// Length from `from` to `to` by Simpson's rule, halved until it settles.
    fn length(&self, from: f64, to: f64, tolerance: f64) -> f64 {
        fn settle(
            f: &dyn Fn(f64) -> f64,
            a: [f64; 2],
            m: [f64; 2],
            b: [f64; 2],
            whole: f64,
            tolerance: f64,
            depth: u32,
        ) -> f64 {
            let [left, right] = [0.5 * (a[0] + m[0]), 0.5 * (m[0] + b[0])].map(|u| [u, f(u)]);
            let sixth = (b[0] - a[0]) / 12.0;
            let halves = [sixth * (a[1] + 4.0 * left[1] + m[1]), sixth * (m[1] + 4.0 * right[1] + b[1])];
            let error = halves[0] + halves[1] - whole;
            if error.abs() <= 15.0 * tolerance || depth > 40 {
                return halves[0] + halves[1] + error / 15.0;
            }
            settle(f, a, left, m, halves[0], 0.5 * tolerance, depth + 1)
                + settle(f, m, right, b, halves[1], 0.5 * tolerance, depth + 1)
        }
        let f = |u: f64| self.speed(u);
        // Knots are where derivatives jump.
        let mut length = 0.0;
        let mut a = from;
        while a < to {
            let b = (a.floor() + 1.0).min(to);
            // Just inside of the span, so that the speed is that of this span.
            let inside = |u: f64| f(u.clamp(a.floor(), (a.floor() + 1.0).next_down()));
            let middle = 0.5 * (a + b);
            let [fa, fm, fb] = [a, middle, b].map(&inside);
            let whole = (b - a) / 6.0 * (fa + 4.0 * fm + fb);
            length += settle(&inside, [a, fa], [middle, fm], [b, fb], whole, tolerance, 0);
            a = b;
        }
        length
    }
}

fn distance(position: &Position, point: [f64; 2]) -> f64 {
    (position[0] - point[0]).hypot(position[1] - point[1])
}

#[test]
fn a_quarter_of_a_circle_is_one() {
    let radius = 25.0;
    let quarter = geometry(3, &[[radius, 0.0], [radius, radius], [0.0, radius]], &[1.0, FRAC_1_SQRT_2, 1.0]);
    let element = element(&quarter, 0.0).expect("it moves");
    assert!((element.length - radius * std::f64::consts::FRAC_PI_2).abs() <= 1e-9);
    for k in 0..=1_000 {
        let s = element.length * f64::from(k) / 1_000.0;
        let at = element.position(s);
        assert!((at[0].hypot(at[1]) - radius).abs() <= 1e-12, "{}", at[0].hypot(at[1]) - radius);
        let angle = s / radius;
        assert!(distance(&at, [radius * angle.cos(), radius * angle.sin()]) <= 1e-9);
    }
    assert!((element.curvature() * radius - 1.0).abs() <= 1e-3, "{}", element.curvature());
    assert_eq!(spline(&element).piece_count(), 4);
}

fn curves() -> impl Strategy<Value = SplineGeometry> {
    let point = || [-50.0..50.0_f64, -50.0..50.0_f64];
    (2_u8..=6, 0_usize..6).prop_flat_map(move |(order, more)| {
        let count = usize::from(order) + more;
        (
            Just(order),
            prop::collection::vec(point(), count),
            prop_oneof![Just(vec![1.0; count]), prop::collection::vec(0.3..3.0_f64, count)],
        )
            .prop_map(|(order, points, weights)| geometry(order, &points, &weights))
    })
}

/// Curves without corners or steps of curvature.
fn smooth_curves() -> impl Strategy<Value = SplineGeometry> {
    curves().prop_filter("of one span or with continuous curvature", |curve| {
        curve.order >= 4 || usize::from(curve.order) == curve.points.len()
    })
}

fn spline(element: &Element) -> &Spline {
    let Curve::Spline(spline) = &element.curve else { panic!("not a spline") };
    spline
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_arc_length_leads_to_where_the_curve_is(curve in curves(), share in 0.0..1.0_f64, rise in prop_oneof![Just(0.0), -20.0..20.0_f64]) {
        let Some(element) = element(&curve, rise) else { return Ok(()) };
        let reference = Reference(&curve);
        let length = reference.length(0.0, reference.spans() as f64, 1e-12);
        let planar = (element.length * element.length - rise * rise).sqrt();
        prop_assert!((planar - length).abs() <= 1e-9, "{planar} for {length}");
        let u = share * reference.spans() as f64;
        let travel = reference.length(0.0, u, 1e-12) / length;
        let found = element.position(travel * element.length);
        prop_assert!(distance(&found, reference.at(u)) <= 1e-9, "{} mm off", distance(&found, reference.at(u)));
        prop_assert!((found[2] - rise * travel).abs() <= 1e-9);
    }

    #[test]
    fn tangents_are_unit_vectors_and_derivatives(curve in smooth_curves(), share in 0.001..0.999_f64, rise in -20.0..20.0_f64) {
        let Some(element) = element(&curve, rise) else { return Ok(()) };
        let s = share * element.length;
        let tangent = element.tangent(s);
        let square: f64 = tangent.iter().map(|value| value * value).sum();
        prop_assert!((square.sqrt() - 1.0).abs() <= 1e-9, "{}", square.sqrt() - 1.0);
        // A chord over 2·h turns by 2·κ·h: it is off by κ²·h²/6 or by what curvature changes.
        let step = 1e-5 * element.length.min(1.0 / element.curvature());
        let (before, after) = (element.position(s - step), element.position(s + step));
        for axis in 0..3 {
            let slope = (after[axis] - before[axis]) / (2.0 * step);
            prop_assert!((slope - tangent[axis]).abs() <= 1e-7 + 1e-13 / step, "{slope} for {}", tangent[axis]);
        }
    }

    #[test]
    fn columns_are_single_positions_in_any_order_and_ends_are_exact(
        curve in curves(), rise in -20.0..20.0_f64, shares in prop::collection::vec(-0.1..1.1_f64, 1..60),
    ) {
        let Some(element) = element(&curve, rise) else { return Ok(()) };
        let s: Vec<f64> = shares.iter().map(|share| share * element.length).collect();
        let mut column = vec![0.0; s.len()];
        for axis in Axis::ALL {
            element.fill_axis(axis, &s, &mut column);
            for (value, &s) in column.iter().zip(&s) {
                prop_assert_eq!(value.to_bits(), element.position(s)[axis.index()].to_bits());
            }
            element.fill_tangent(axis, &s, &mut column);
            for (value, &s) in column.iter().zip(&s) {
                prop_assert_eq!(value.to_bits(), element.tangent(s)[axis.index()].to_bits());
            }
        }
        prop_assert_eq!(element.position(element.length), element.end);
        prop_assert_eq!(element.position(element.length.next_up()), element.end);
        prop_assert_eq!(element.position(0.0), element.start);
        prop_assert_eq!(element.position(-1.0), element.start);
        // The exact ends join the curve.
        for (s, end) in [(element.length.next_down(), element.end), (f64::MIN_POSITIVE, element.start)] {
            let near = element.position(s);
            prop_assert!((0..3).all(|axis| (near[axis] - end[axis]).abs() <= 1e-12 * (1.0 + end[axis].abs())));
        }
    }

    #[test]
    fn bounds_hold_everywhere_and_are_close(curve in smooth_curves(), rise in -20.0..20.0_f64) {
        let Some(element) = element(&curve, rise) else { return Ok(()) };
        let ((low, high), steepest, curvature) = (element.extent(), element.largest_tangent(), element.curvature());
        let (mut found_low, mut found_high, mut found_steepest) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3], [0.0_f64; 3]);
        const SAMPLES: u32 = 4_000;
        let step = element.length / f64::from(SAMPLES);
        for k in 0..=SAMPLES {
            let s = step * f64::from(k);
            let (position, tangent, next) = (element.position(s), element.tangent(s), element.tangent(s + 0.5 * step));
            let mut turned = 0.0;
            for axis in 0..3 {
                found_low[axis] = found_low[axis].min(position[axis]);
                found_high[axis] = found_high[axis].max(position[axis]);
                found_steepest[axis] = found_steepest[axis].max(tangent[axis].abs());
                turned += (next[axis] - tangent[axis]) * (next[axis] - tangent[axis]);
            }
            prop_assert!(turned.sqrt() <= curvature * 0.5 * step * (1.0 + 1e-9) + 1e-12);
        }
        for axis in 0..3 {
            prop_assert!(found_low[axis] >= low[axis] - 1e-11 && found_high[axis] <= high[axis] + 1e-11);
            // From the nearest sample, at most half a step away, the curve leaves its tangent by κ/2 of its square.
            let missed = (0.5 * step) * (0.5 * step) * 0.5 * curvature + 1e-9;
            prop_assert!(found_low[axis] - low[axis] <= missed && high[axis] - found_high[axis] <= missed);
            prop_assert!(found_steepest[axis] <= steepest[axis] + 1e-12 && steepest[axis] <= 1.0 + 1e-9);
            prop_assert!(steepest[axis] - found_steepest[axis] <= 0.5 * step * curvature + 1e-9);
        }
    }

    #[test]
    fn smooth_parts_are_the_same_path(curve in curves(), shares in prop::collection::vec(0.0..1.0_f64, 20), rise in -20.0..20.0_f64) {
        let Some(whole) = element(&curve, rise) else { return Ok(()) };
        let parts = whole.clone().smooth_parts();
        let single = usize::from(curve.order) == curve.points.len();
        let steps = if curve.order >= 4 || single { 0 } else { curve.points.len() - usize::from(curve.order) };
        prop_assert!(parts.len() <= steps + 1, "{} parts", parts.len());
        // And a corner is one.
        if curve.order == 2 {
            let corners = curve.points.windows(3).filter(|legs| {
                let [[ux, uy], [vx, vy]] = [0, 1].map(|k| [legs[k + 1][0] - legs[k][0], legs[k + 1][1] - legs[k][1]]);
                (ux * vy - uy * vx).abs() > 1e-3 * ux.hypot(uy) * vx.hypot(vy)
            });
            prop_assert!(parts.len() > corners.count(), "{} parts", parts.len());
        }
        prop_assert_eq!(parts[0].start, whole.start);
        prop_assert_eq!(parts[parts.len() - 1].end, whole.end);
        prop_assert!((parts.iter().map(|part| part.length).sum::<f64>() - whole.length).abs() <= 1e-10);
        prop_assert!(parts.windows(2).all(|pair| pair[0].end == pair[1].start));
        for share in shares {
            let s = share * whole.length;
            let mut from = 0.0;
            for part in &parts {
                if s >= from && s <= from + part.length {
                    let (a, b) = (whole.position(s), part.position(s - from));
                    prop_assert!((0..3).all(|axis| (a[axis] - b[axis]).abs() <= 1e-10));
                }
                from += part.length;
            }
        }
    }
}

/// Where the curvature passes through zero, and in turns of fractions of a micrometre, rounding is no step.
#[test]
fn a_smooth_span_is_one_part_however_it_bends() {
    let inflected = geometry(
        6,
        &[
            [-0.697_371_493_030_695_6, -32.397_079_621_210_68],
            [-22.497_532_350_448_39, -3.067_986_061_549_946],
            [-20.494_875_386_943_722, 27.239_415_376_528_505],
            [-7.065_088_313_437_213, 10.524_888_450_000_207],
            [-32.767_115_894_832_07, 32.216_917_969_217_91],
            [-45.634_006_873_232_14, 29.367_735_355_725_56],
            [0.0, 0.0],
            [0.0, 29.977_144_728_588_45],
        ],
        &[
            1.212_925_331_817_446_9,
            0.540_256_702_664_499_8,
            1.757_319_305_237_338_8,
            1.644_460_843_577_568_3,
            1.872_668_634_468_535,
            1.567_620_976_731_202_6,
            0.3,
            0.3,
        ],
    );
    let turned_sharply = geometry(
        5,
        &[
            [39.902_639_731_144_88, 42.509_699_189_536_44],
            [-7.761_159_388_913_286, -31.521_668_845_098_834],
            [11.742_206_622_356_226, -37.122_336_333_473_17],
            [15.775_271_665_875_112, -4.891_793_792_595_205],
            [-44.460_196_648_928_715, -19.818_003_915_666_367],
            [0.0, 0.0],
            [0.0, 0.0],
            [0.0, -21.482_790_495_747_38],
        ],
        &[
            2.940_453_552_962_454_7,
            0.311_146_451_345_067,
            1.746_051_286_538_465_6,
            1.030_367_179_977_088_2,
            0.852_217_166_226_239_8,
            0.3,
            0.3,
            0.3,
        ],
    );
    for (curve, rise, least_curvature) in
        [(inflected, 12.500_210_019_066_678, 10.0), (turned_sharply, 4.260_030_609_668_106, 1e7)]
    {
        let whole = element(&curve, rise).expect("it moves");
        assert!(whole.curvature() > least_curvature, "{}", whole.curvature());
        assert_eq!(whole.smooth_parts().len(), 1);
    }
}

#[test]
fn a_straight_spline_is_a_line() {
    // Unevenly spaced control points, and both ends at rest in the parameter.
    for points in
        [[[0.0, 0.0], [3.0, 4.0], [27.0, 36.0], [30.0, 40.0]], [[0.0, 0.0], [0.0, 0.0], [30.0, 40.0], [30.0, 40.0]]]
    {
        let element = element(&cubic(points), 120.0).expect("it moves");
        assert!((element.length - 130.0).abs() <= 1e-12);
        assert_eq!(element.curvature(), 0.0);
        for k in 0..=130 {
            let share = f64::from(k) / 130.0;
            let at = element.position(f64::from(k));
            for (found, whole) in at.iter().zip([30.0, 40.0, 120.0]) {
                assert!((found - whole * share).abs() <= 1e-12);
            }
        }
        assert_eq!(element.extent(), (element.start, element.end));
    }
}

#[test]
fn a_cubic_has_the_length_of_its_integral() {
    // G5 I0 J6 P0 Q-6 X1 Y1 from X0 Y0: x = 3u² − 2u³, y = 18u − 51u² + 34u³; Simpson's rule with 2·10⁶ steps.
    let element = element(&cubic([[0.0, 0.0], [0.0, 6.0], [1.0, -5.0], [1.0, 1.0]]), 0.0).expect("it moves");
    let speed = |u: f64| (6.0 * u - 6.0 * u * u).hypot(18.0 - 102.0 * u + 102.0 * u * u);
    let steps = 2_000_000;
    let weight = |k: u32| {
        if k == 0 || k == steps {
            1.0
        } else if k % 2 == 1 {
            4.0
        } else {
            2.0
        }
    };
    let sum: f64 = (0..=steps).map(|k| weight(k) * speed(f64::from(k) / f64::from(steps))).sum();
    assert!((element.length - sum / f64::from(3 * steps)).abs() <= 1e-9, "{}", element.length);
    // Up, down between the two turns of y at u = (102 ± √3060)/204, and up again.
    let (low, high) = element.extent();
    let y = |u: f64| u * (18.0 + u * (-51.0 + 34.0 * u));
    let turns = [-1.0, 1.0].map(|sign| y((102.0 + sign * 3_060.0_f64.sqrt()) / 204.0));
    assert!((high[1] - turns[0].max(1.0)).abs() <= 1e-9 && (low[1] - turns[1].min(0.0)).abs() <= 1e-9);
    // Turns of 0.007 mm radius have their price.
    assert!(spline(&element).piece_count() <= 128, "{}", spline(&element).piece_count());
}

#[test]
fn what_is_no_regular_curve_is_refused() {
    let spline_of = |geometry: &SplineGeometry| {
        Spline::from_geometry(geometry, &position(0.0, 0.0, 0.0), &position(10.0, 0.0, 0.0))
    };
    let points = [[0.0, 0.0], [10.0, 10.0], [0.0, 10.0], [10.0, 0.0]];
    // The legs cross so that the curve has a cusp: (0, 0), (10, 10), (0, 10), (10, 0).
    assert!(spline_of(&cubic(points)).is_none());
    assert!(spline_of(&cubic([[0.0, 0.0], [12.0, 10.0], [-2.0, 10.0], [10.0, 0.0]])).is_some(), "a loop");
    // Turns round on a line.
    assert!(spline_of(&cubic([[0.0, 0.0], [30.0, 0.0], [-20.0, 0.0], [10.0, 0.0]])).is_none());
    for (order, weights) in [(1, 1.0), (11, 1.0), (5, 1.0), (4, 0.0), (4, -1.0), (4, f64::NAN), (4, f64::INFINITY)] {
        assert!(spline_of(&geometry(order, &points[..], &[weights; 4])).is_none());
    }
    assert!(spline_of(&geometry(4, &points, &[1.0; 3])).is_none());
    assert!(spline_of(&cubic([[0.0, 0.0], [f64::NAN, 1.0], [5.0, 5.0], [10.0, 0.0]])).is_none());
    assert!(spline_of(&geometry(4, &[], &[])).is_none());
    let span = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [5.0, 0.0, 0.0]];
    assert!(Spline::from_polynomial_spans(&[]).is_none());
    assert!(Spline::from_polynomial_spans(&[span, span]).is_none(), "a gap");
    assert!(Spline::from_polynomial_spans(&[[[1.0; 3]; 6]]).is_none(), "a point");
    let line = Spline::from_polynomial_spans(&[span]).expect("a line");
    assert_eq!(line.length_mm(), 5.0);
    assert_eq!(line.ends(), [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]]);
    // Not where the spline is.
    let (start, end) = (position(0.0, 0.0, 0.0), position(5.0, 0.0, 1e-6));
    assert!(Element::from_spline(start, end, line, [0.0; 9], SourceSpan::default(), false).is_none());
}
