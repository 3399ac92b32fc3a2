//! Splines by arc length against the curves they are made from, evaluated by the textbook's recursion.

use std::f64::consts::FRAC_1_SQRT_2;

use feedwave_motion::{Curve, Element, Spline};
use feedwave_program::{
    Axis, Feed, Move, MoveKind, PathControl, Plane, Position, SourceSpan, Spindle, SplineGeometry,
};
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
            let inside = self.knot(index) <= u && (u < self.knot(index + 1) || last) && self.knot(index) < self.knot(index + 1);
            return f64::from(u8::from(inside));
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
        fn settle(f: &dyn Fn(f64) -> f64, a: [f64; 2], m: [f64; 2], b: [f64; 2], whole: f64, tolerance: f64, depth: u32) -> f64 {
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
            let [fa, fm, fb] = [a, middle, b].map(|u| inside(u));
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
    let quarter =
        geometry(3, &[[radius, 0.0], [radius, radius], [0.0, radius]], &[1.0, FRAC_1_SQRT_2, 1.0]);
    let element = element(&quarter, 0.0).expect("it moves");
    assert!((element.length - radius * std::f64::consts::FRAC_PI_2).abs() <= 1e-9);
    for k in 0..=1_000 {
        let s = element.length * f64::from(k) / 1_000.0;
        let at = element.position(s);
        // A double at 25 mm is exact to 3.6e-15 mm; the fit adds no more than 1e-10.
        assert!((at[0].hypot(at[1]) - radius).abs() <= 1e-10, "{}", at[0].hypot(at[1]) - radius);
        let angle = s / radius;
        assert!(distance(&at, [radius * angle.cos(), radius * angle.sin()]) <= 1e-9);
    }
    assert!((element.curvature() * radius - 1.0).abs() <= 1e-3, "{}", element.curvature());
    let Curve::Spline(spline) = &element.curve else { panic!("a spline") };
    println!("{} pieces", spline.piece_count());
}
