//! Polynomials of arc length and their Bernstein coefficients, between whose smallest and largest a polynomial stays.

use super::bezier::binomial;
use crate::tolerance::{SPLINE_ROUNDING, SPLINE_STRAIGHT_MM};

/// Coefficients of a piece's polynomial: degree 9.
pub(crate) const COEFFICIENTS: usize = 10;

/// Most parts a piece is halved into to find where it is farthest, as a power of two.
const EXTREME_HALVINGS: u32 = 24;

/// A polynomial on 0 to 1 by its Bernstein coefficients.
pub(super) type Bernstein = [f64; COEFFICIENTS];

/// The polynomial p(place + share·u) of u, by a Taylor shift.
pub(crate) fn shifted<const N: usize>(mut polynomial: [f64; N], place: f64, share: f64) -> [f64; N] {
    for lowest in 0..N - 1 {
        for k in (lowest..N - 1).rev() {
            polynomial[k] += place * polynomial[k + 1];
        }
    }
    let mut power = 1.0;
    for coefficient in &mut polynomial {
        *coefficient *= power;
        power *= share;
    }
    polynomial
}

/// Bernstein coefficients of a derivative by arc length of a polynomial on 0 to 1.
pub(super) fn bernstein(mut polynomial: [f64; COEFFICIENTS], derivative: usize, per_length: f64) -> Bernstein {
    for _ in 0..derivative {
        for k in 1..COEFFICIENTS {
            polynomial[k - 1] = polynomial[k] * k as f64 * per_length;
        }
        polynomial[COEFFICIENTS - 1] = 0.0;
    }
    let degree = COEFFICIENTS - 1;
    core::array::from_fn(|i| (0..=i).map(|k| binomial(i, k) / binomial(degree, k) * polynomial[k]).sum())
}

/// The first and the second half of a polynomial.
pub(super) fn halves(polynomial: &Bernstein) -> [Bernstein; 2] {
    let (mut left, mut right) = ([0.0; COEFFICIENTS], *polynomial);
    for (k, left) in left.iter_mut().enumerate() {
        *left = right[0];
        for i in 0..COEFFICIENTS - 1 - k {
            right[i] = 0.5 * (right[i] + right[i + 1]);
        }
    }
    [left, right]
}

/// Raises `found` to the largest value of the polynomial, or beyond it by no more than rounding.
pub(super) fn raise_to_largest(polynomial: &Bernstein, found: &mut f64, depth: u32) {
    *found = found.max(polynomial[0]).max(polynomial[COEFFICIENTS - 1]);
    let bound = polynomial.iter().fold(f64::NEG_INFINITY, |bound, &value| bound.max(value));
    if bound <= *found + (SPLINE_STRAIGHT_MM + SPLINE_ROUNDING * bound.abs()) || depth >= EXTREME_HALVINGS {
        *found = found.max(bound);
    } else {
        halves(polynomial).iter().for_each(|half| raise_to_largest(half, found, depth + 1));
    }
}

/// Stretch of a path of some axes by its tangent.
#[derive(Clone, Copy)]
pub(crate) struct Part<const AXES: usize> {
    /// Arc length where it ends, mm.
    pub(crate) end: f64,
    length: f64,
    /// Bernstein coefficients of the first derivative by arc length.
    tangent: [Bernstein; AXES],
}

impl<const AXES: usize> Part<AXES> {
    pub(super) fn new(end: f64, length: f64, tangent: [Bernstein; AXES]) -> Self {
        Self { end, length, tangent }
    }

    /// Its first and its second half.
    pub(crate) fn halves(&self) -> [Self; 2] {
        let length = 0.5 * self.length;
        let halved = self.tangent.each_ref().map(halves);
        let half = |place: usize, end: f64| Self { end, length, tangent: halved.map(|halves| halves[place]) };
        [half(0, self.end - length), half(1, self.end)]
    }

    /// Upper bounds of |first|, |second| and |third derivative| of the axes: those of the Bernstein coefficients, which are
    /// differences of those of the derivative before.
    pub(crate) fn bounds(&self) -> [[f64; AXES]; 3] {
        self.measure(|polynomial| polynomial.iter().fold(0.0, |largest, value| value.abs().max(largest)))
    }

    /// The same just where it starts and where it ends.
    pub(crate) fn ends(&self) -> [[[f64; AXES]; 3]; 2] {
        [
            self.measure(|polynomial| polynomial[0].abs()),
            self.measure(|polynomial| polynomial[polynomial.len() - 1].abs()),
        ]
    }

    /// What `of` finds in the Bernstein coefficients, by derivative and axis.
    fn measure(&self, of: impl Fn(&[f64]) -> f64) -> [[f64; AXES]; 3] {
        let mut found = [[0.0; AXES]; 3];
        for (axis, tangent) in self.tangent.iter().enumerate() {
            let mut polynomial = *tangent;
            for (order, found) in found.iter_mut().enumerate() {
                let count = COEFFICIENTS - order;
                found[axis] = of(&polynomial[..count]);
                let per_step = (count - 1) as f64 / self.length;
                for k in 1..count {
                    polynomial[k - 1] = (polynomial[k] - polynomial[k - 1]) * per_step;
                }
            }
        }
        found
    }
}
