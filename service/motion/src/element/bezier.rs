//! Rational Bézier spans: what every spline is made of before it is measured by arc length.

use crate::tolerance::MAX_SPLINE_DEGREE;

/// A point times its weight, and the weight.
pub(super) type Weighted = [f64; 4];

/// A Bézier span with homogeneous control points over the parameter 0 to 1.
#[derive(Clone, Copy)]
pub(super) struct Bezier {
    degree: usize,
    points: [Weighted; MAX_SPLINE_DEGREE + 1],
}

fn mix(a: &Weighted, b: &Weighted, share: f64) -> Weighted {
    core::array::from_fn(|k| a[k] + (b[k] - a[k]) * share)
}

/// Pascal's triangle.
const BINOMIALS: [[f64; MAX_SPLINE_DEGREE + 1]; MAX_SPLINE_DEGREE + 1] = {
    let mut rows = [[0.0; MAX_SPLINE_DEGREE + 1]; MAX_SPLINE_DEGREE + 1];
    let mut n = 0;
    while n <= MAX_SPLINE_DEGREE {
        rows[n][0] = 1.0;
        let mut k = 1;
        while k <= n {
            rows[n][k] = rows[n - 1][k - 1] + rows[n - 1][k];
            k += 1;
        }
        n += 1;
    }
    rows
};

/// Binomial coefficient n over k, for n up to the highest degree.
pub(super) fn binomial(n: usize, k: usize) -> f64 {
    BINOMIALS[n][k]
}

impl Bezier {
    /// The span with these control points, at least two and at most one more than the highest degree.
    pub(super) fn new(points: &[Weighted]) -> Self {
        let mut span = Self { degree: points.len() - 1, points: [[0.0; 4]; MAX_SPLINE_DEGREE + 1] };
        span.points[..points.len()].copy_from_slice(points);
        span
    }

    /// Span `index` of the NURBS with clamped uniform knots, by its blossom: control point k of a span from a to b is
    /// the polar form at (d − k) times a and k times b.
    pub(super) fn of_nurbs(points: &[Weighted], degree: usize, index: usize) -> Self {
        let knot = |k: usize| k.saturating_sub(degree).min(points.len() - degree) as f64;
        let last = degree + index;
        let mut bezier = Self { degree, points: [[0.0; 4]; MAX_SPLINE_DEGREE + 1] };
        for at_end in 0..=degree {
            let mut polar = [[0.0; 4]; MAX_SPLINE_DEGREE + 1];
            polar[..=degree].copy_from_slice(&points[index..=last]);
            for round in 1..=degree {
                let argument = if round <= degree - at_end { knot(last) } else { knot(last + 1) };
                for k in (round..=degree).rev() {
                    let (left, right) = (knot(index + k), knot(last + 1 + k - round));
                    polar[k] = mix(&polar[k - 1], &polar[k], (argument - left) / (right - left));
                }
            }
            bezier.points[at_end] = polar[degree];
        }
        bezier
    }

    /// Control points.
    pub(super) fn points(&self) -> &[Weighted] {
        &self.points[..=self.degree]
    }

    /// Makes the span start at `point`.
    pub(super) fn start_at(&mut self, point: Weighted) {
        self.points[0] = point;
    }

    /// Position and derivative by the parameter.
    pub(super) fn at(&self, u: f64) -> ([f64; 3], [f64; 3]) {
        let mut points = self.points;
        for count in (2..=self.degree).rev() {
            for k in 0..count {
                points[k] = mix(&points[k], &points[k + 1], u);
            }
        }
        let value = mix(&points[0], &points[1], u);
        let degree = self.degree as f64;
        let slope: Weighted = core::array::from_fn(|k| degree * (points[1][k] - points[0][k]));
        let position = core::array::from_fn(|k| value[k] / value[3]);
        let derivative = core::array::from_fn(|k| (slope[k] - slope[3] * (value[k] / value[3])) / value[3]);
        (position, derivative)
    }

    /// The first and the second half, by de Casteljau's subdivision.
    pub(super) fn halves(&self) -> [Self; 2] {
        let (mut left, mut right) = (*self, *self);
        for k in 0..=self.degree {
            left.points[k] = right.points[0];
            for i in 0..self.degree - k {
                right.points[i] = mix(&right.points[i], &right.points[i + 1], 0.5);
            }
        }
        [left, right]
    }

    /// Taylor coefficients of the position about the start, or about the end, by the parameter.
    pub(super) fn taylor<const N: usize>(&self, at_end: bool) -> [[f64; 3]; N] {
        let mut differences = self.points;
        if at_end {
            differences[..=self.degree].reverse();
        }
        let mut weighted = [[0.0; 4]; N];
        for (k, weighted) in weighted.iter_mut().enumerate().take(self.degree + 1) {
            let factor = binomial(self.degree, k);
            *weighted = differences[0].map(|value| factor * value);
            for i in 0..self.degree - k {
                let (a, b) = (differences[i], differences[i + 1]);
                differences[i] = core::array::from_fn(|c| if at_end { a[c] - b[c] } else { b[c] - a[c] });
            }
        }
        // Division of power series.
        let mut position = [[0.0; 3]; N];
        for k in 0..N {
            for c in 0..3 {
                let known: f64 = (1..=k).map(|j| weighted[j][3] * position[k - j][c]).sum();
                position[k][c] = (weighted[k][c] - known) / weighted[0][3];
            }
        }
        position
    }
}
