//! From Bézier spans to polynomials of the arc length.
//!
//! A piece is the polynomial of degree 9 that has the curve's position and its first four derivatives by arc length at
//! both ends. Pieces thus meet with four continuous derivatives within a span. The derivatives come from power series:
//! the curve's by its parameter, its speed |c′| = √(c′·c′), integrated, reverted and inserted into the curve's. The
//! error of such a Hermite interpolant is h¹⁰/10!·(t(1 − t))⁵ times the tenth derivative, largest in the middle; it is
//! measured there and at the quarters, and a span is halved until it is small enough. Lengths are Gauss-Legendre sums.

use super::bezier::{Bezier, binomial};
use super::polynomial::COEFFICIENTS;
use super::spline::Piece;
use crate::tolerance::{
    MAX_SPLINE_HALVINGS, MAX_SPLINE_PIECES, SPLINE_FIT_MM, SPLINE_FIT_TANGENT, SPLINE_QUADRATURE, SPLINE_ROUNDING,
};

/// Derivatives matched at each end, the position among them.
const MATCHED: usize = COEFFICIENTS / 2;

/// Gauss-Legendre quadrature with 7 points: abscissas on 0 to 1 beside the middle, and weights.
const MIDDLE_WEIGHT: f64 = 0.208_979_591_836_734_7;
const GAUSS: [[f64; 2]; 3] = [
    [0.202_922_575_688_698_6, 0.190_915_025_252_559_47],
    [0.370_765_592_799_697_2, 0.139_852_695_744_638_34],
    [0.474_553_956_171_379_26, 0.064_742_483_084_434_85],
];

fn norm(v: &[f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

fn length_between(span: &Bezier, from: f64, to: f64) -> f64 {
    let (middle, width) = (0.5 * (from + to), to - from);
    let speed = |u: f64| norm(&span.at(u).1);
    let sides: f64 = GAUSS
        .iter()
        .map(|[offset, weight]| weight * (speed(middle - width * offset) + speed(middle + width * offset)))
        .sum();
    width * (sides + MIDDLE_WEIGHT * speed(middle))
}

/// The parameter about an end of a span as a power series of the arc length.
struct Parameter {
    /// Coefficients of the second, third and fourth power of x = arc length / first speed; that of the first is 1.
    higher: [f64; 3],
    /// Powers of x at the whole length.
    powers: [f64; MATCHED],
}

impl Parameter {
    /// From the Taylor coefficients of the span; `None` where its speed is zero.
    fn new(c: &[[f64; 3]; MATCHED], length: f64) -> Option<Self> {
        let slope = |k: usize| c[k + 1].map(|value| value * (k + 1) as f64);
        // Speed as a power series, its integral relative to its first term.
        let mut speed = [0.0; MATCHED - 1];
        speed[0] = norm(&c[1]);
        if speed[0] == 0.0 || !speed[0].is_finite() {
            return None;
        }
        for k in 1..MATCHED - 1 {
            let square: f64 = (0..=k).map(|j| slope(j).iter().zip(slope(k - j)).map(|(a, b)| a * b).sum::<f64>()).sum();
            let known: f64 = (1..k).map(|j| speed[j] * speed[k - j]).sum();
            speed[k] = (square - known) / (2.0 * speed[0]);
        }
        let [a2, a3, a4] = core::array::from_fn(|k| speed[k + 1] / (speed[0] * (k + 2) as f64));
        // Reverted: parameter = x + b2·x² + b3·x³ + b4·x⁴ with x = arc length / first speed.
        let higher = [-a2, 2.0 * a2 * a2 - a3, 5.0 * a2 * a3 - a4 - 5.0 * a2 * a2 * a2];
        let x = length / speed[0];
        Some(Self { higher, powers: [1.0, x, x * x, x * x * x, x * x * x * x] })
    }

    /// Taylor coefficients by arc length in units of the whole length, from those by the parameter; of each coordinate.
    fn by_arc_length(&self, c: &[[f64; 3]; MATCHED]) -> [[f64; 3]; MATCHED] {
        let [b2, b3, b4] = self.higher;
        let mut taylor = [[0.0; 3]; MATCHED];
        for axis in 0..3 {
            let [c0, c1, c2, c3, c4] = c.map(|coefficient| coefficient[axis]);
            let composed = [
                c0,
                c1,
                c2 + c1 * b2,
                c3 + 2.0 * c2 * b2 + c1 * b3,
                c4 + 3.0 * c3 * b2 + c2 * (b2 * b2 + 2.0 * b3) + c1 * b4,
            ];
            for k in 0..MATCHED {
                taylor[k][axis] = composed[k] * self.powers[k];
            }
        }
        taylor
    }
}

/// The polynomial on 0 to 1 with these Taylor coefficients about 0 and about 1.
fn hermite(left: [f64; MATCHED], right: [f64; MATCHED]) -> [f64; COEFFICIENTS] {
    // p(t) = left(t) + t⁵·q(t). About 1, with τ = t − 1, q = (right(τ) − left(1 + τ))·(1 + τ)⁻⁵.
    const INVERSE: [f64; MATCHED] = [1.0, -5.0, 15.0, -35.0, 70.0];
    let missing: [f64; MATCHED] = core::array::from_fn(|k| {
        if k == 0 {
            return (right[0] - left[0]) - left[1..].iter().sum::<f64>();
        }
        right[k] - (k..MATCHED).map(|j| binomial(j, k) * left[j]).sum::<f64>()
    });
    let about_one: [f64; MATCHED] = core::array::from_fn(|k| (0..=k).map(|j| missing[j] * INVERSE[k - j]).sum::<f64>());
    let mut polynomial = [0.0; COEFFICIENTS];
    polynomial[..MATCHED].copy_from_slice(&left);
    for k in 0..MATCHED {
        let sign = |j: usize| if (j - k).is_multiple_of(2) { 1.0 } else { -1.0 };
        polynomial[MATCHED + k] = (k..MATCHED).map(|j| sign(j) * binomial(j, k) * about_one[j]).sum();
    }
    polynomial
}

/// The polynomials of the arc length with what spans of one parameter have at both ends: of the span itself, and of one that is taken
/// along by its parameter.
fn pieces<const SPANS: usize>(spans: [&Bezier; SPANS], length: f64) -> Option<[Piece; SPANS]> {
    let parameters =
        [Parameter::new(&spans[0].taylor(false), length)?, Parameter::new(&spans[0].taylor(true), length)?];
    Some(spans.map(|span| {
        let [left, right] = [false, true].map(|at_end| {
            let taylor = span.taylor(at_end);
            parameters[usize::from(at_end)].by_arc_length(&taylor)
        });
        let polynomial = |axis: usize| hermite(left.map(|c| c[axis]), right.map(|c| c[axis]));
        Piece::new(0.0, length, [polynomial(0), polynomial(1), polynomial(2)])
    }))
}

/// The piece of a whole span, and of those that are taken along, if they are as close to them as they must be. `size_mm` scales rounding.
fn fit<const SPANS: usize>(spans: [&Bezier; SPANS], size_mm: f64) -> Option<[Piece; SPANS]> {
    let span = spans[0];
    let quarters: [f64; 4] = core::array::from_fn(|k| length_between(span, 0.25 * k as f64, 0.25 * (k + 1) as f64));
    let length: f64 = quarters.iter().sum();
    let coarse = length_between(span, 0.0, 1.0);
    // Quarters are 4¹⁴ times as exact as the whole.
    let is_measured = length > 0.0 && length.is_finite() && (coarse - length).abs() <= SPLINE_QUADRATURE * length;
    if !is_measured {
        return None;
    }
    let pieces = pieces(spans, length)?;
    let rounding = SPLINE_ROUNDING * size_mm;
    let mut s = 0.0;
    for (k, quarter) in quarters.iter().enumerate().take(3) {
        s += quarter;
        let u = 0.25 * (k + 1) as f64;
        let speed = norm(&span.at(u).1);
        for (piece, span) in pieces.iter().zip(spans) {
            let (point, slope) = span.at(u);
            for axis in 0..3 {
                let off_mm = (piece.value(axis, s) - point[axis]).abs();
                let turned = (piece.slope(axis, s) - slope[axis] / speed).abs();
                let fits = off_mm <= SPLINE_FIT_MM + rounding && turned <= SPLINE_FIT_TANGENT + rounding / length;
                if !fits {
                    return None;
                }
            }
        }
    }
    Some(pieces)
}

/// Appends the pieces of a span from arc length `s` on and gives where they end; `None` when there are too many, which a
/// cusp needs. Spans that are taken along by its parameter have the same stretches.
pub(super) fn append<const SPANS: usize>(
    pieces: &mut [Vec<Piece>; SPANS],
    spans: [&Bezier; SPANS],
    s: f64,
    size_mm: f64,
    depth: u32,
) -> Option<f64> {
    if let Some(fitted) = fit(spans, size_mm) {
        if pieces[0].len() >= MAX_SPLINE_PIECES {
            return None;
        }
        let end = fitted[0].clone().moved_to(s).end();
        for (pieces, piece) in pieces.iter_mut().zip(fitted) {
            pieces.push(piece.moved_to(s));
        }
        return Some(end);
    }
    if depth >= MAX_SPLINE_HALVINGS {
        return None;
    }
    let halves = spans.map(Bezier::halves);
    (0..2).try_fold(s, |s, half| {
        let spans = core::array::from_fn(|k| &halves[k][half]);
        append(pieces, spans, s, size_mm, depth + 1)
    })
}
