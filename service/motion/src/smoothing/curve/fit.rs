//! The smoothing spline: a cubic spline q over the arc length s of the programmed path p that makes
//!
//! ```text
//! ∫ |q‴|² ds + ∫ |q − p|²/λ⁶ ds
//! ```
//!
//! least, with position, direction and curvature given at both ends. λ is a length: what the path does within it is smoothed
//! out, what it does over several λ is followed. A corner of θ is left by θ·λ/3 (the kernel 1/(1 + ω⁶) of the problem
//! on a long path, integrated against θ/ω²), and a circle of radius R shrinks by R·(λ/R)⁶ only, so that the curve leaves the
//! path where that bends unevenly and nowhere else. λ starts at what the local turning allows, see [`super::path`], and is
//! lowered around every place that is too far off until none is.
//!
//! Both integrals are sums over the samples and spans, the normal equations have three bands beside the diagonal, and one
//! factorisation serves all coordinates: X, Y and Z, and under tool centre point control the rotary axes.

#![allow(clippy::needless_range_loop, reason = "the indices of banded systems are sums and differences")]

use core::ops::Range;

use super::super::vector::{difference, scaled, sum};
use super::bezier::{Span, State};
use super::path::Sample;
use super::place::{filled, first};
use crate::tolerance::{CURVE_ROUNDS, CURVE_SCALE_GRADE};

/// Bands of the normal equations beside the diagonal.
const BANDS: usize = 3;

/// Working space of the fit; nothing of it lasts.
#[derive(Clone, Debug, Default)]
pub(super) struct Fit<const N: usize> {
    /// Each end four times.
    knots: Vec<f64>,
    coefficients: Vec<[f64; N]>,
    /// Third derivative on each span by its four coefficients, times the root of its length.
    thirds: Vec<[f64; 4]>,
    rows: Vec<[f64; BANDS + 1]>,
    right: Vec<[f64; N]>,
    scales: Vec<f64>,
    /// The coefficients that are not fixed by an end.
    free: Range<usize>,
}

impl<const N: usize> Fit<N> {
    /// The spans of the curve on these knots, into `spans`; `false` where the tolerance cannot be kept.
    ///
    /// `farthest` raises the ratios of deviation to tolerance at the samples to those of the stretches beside them.
    pub(super) fn solve(
        &mut self,
        knots: &[f64],
        samples: &[Sample],
        ends: [&State; 2],
        spans: &mut Vec<Span>,
        farthest: impl Fn(&[Span], &mut Vec<f64>),
    ) -> bool {
        let span_count = knots.len() - 1;
        self.knots.clear();
        self.knots.extend([knots[0]; 3]);
        self.knots.extend_from_slice(knots);
        self.knots.extend([knots[span_count]; 3]);
        self.coefficients.clear();
        self.coefficients.resize(span_count + 3, [0.0; N]);
        self.fix_ends(ends);
        self.measure_thirds(knots);
        self.scales.clear();
        self.scales.extend(samples.iter().map(|sample| sample.scale));
        self.grade(samples);
        let mut ratios = Vec::with_capacity(samples.len());
        for _ in 0..CURVE_ROUNDS {
            self.solve_once(samples);
            ratios.clear();
            for sample in samples {
                let at =
                    (0..4).fold([0.0; N], |at, k| sum(at, scaled(self.coefficients[sample.span + k], sample.basis[k])));
                ratios.push(sample.ratio(at));
            }
            if ratios.iter().all(|&ratio| ratio <= 1.0) {
                spans.clear();
                for span in 0..span_count {
                    let own: [[f64; N]; 4] = core::array::from_fn(|k| self.coefficients[span + k]);
                    let points = control_points(self.local_knots(span), &own).map(filled);
                    spans.push(Span { from: knots[span], to: knots[span + 1], points });
                }
                farthest(spans, &mut ratios);
                if ratios.iter().all(|&ratio| ratio <= 1.0) {
                    return true;
                }
            }
            for (scale, &ratio) in self.scales.iter_mut().zip(&ratios) {
                // A ratio that is no number lowers the scale as well.
                let is_within = ratio <= 1.0;
                if !is_within {
                    *scale *= (0.95 / ratio).clamp(0.5, 0.97);
                }
            }
            self.grade(samples);
        }
        false
    }

    /// The rows of the third derivative of every span.
    fn measure_thirds(&mut self, knots: &[f64]) {
        self.thirds.clear();
        for span in 0..knots.len() - 1 {
            let length = knots[span + 1] - knots[span];
            let scale = 6.0 / (length * length * length) * length.sqrt();
            self.thirds.push(core::array::from_fn(|unit| {
                let mut own = [[0.0]; 4];
                own[unit][0] = 1.0;
                let [b0, b1, b2, b3] = control_points(self.local_knots(span), &own).map(|point| point[0]);
                scale * ((b3 - b0) - 3.0 * (b2 - b1))
            }));
        }
    }

    /// Knots that the coefficients of a span depend on.
    fn local_knots(&self, span: usize) -> &[f64] {
        &self.knots[span + 1..span + 7]
    }

    /// Keeps the scales from changing too fast along the path.
    fn grade(&mut self, samples: &[Sample]) {
        for k in 1..samples.len() {
            let step = CURVE_SCALE_GRADE * (samples[k].s - samples[k - 1].s);
            self.scales[k] = self.scales[k].min(self.scales[k - 1] + step);
        }
        for k in (1..samples.len()).rev() {
            let step = CURVE_SCALE_GRADE * (samples[k].s - samples[k - 1].s);
            self.scales[k - 1] = self.scales[k - 1].min(self.scales[k] + step);
        }
    }

    /// The first and the last three coefficients; two where the curvature is free, the third being a first guess.
    fn fix_ends(&mut self, [start, end]: [&State; 2]) {
        let knots = &self.knots;
        let last = self.coefficients.len() - 1;
        let fixed = |state: &State| if state.is_free { 2 } else { 3 };
        self.free = fixed(start)..last + 1 - fixed(end);
        let count = knots.len();
        let leading = [knots[4] - knots[3], knots[5] - knots[3]];
        let trailing = [knots[count - 5] - knots[count - 4], knots[count - 6] - knots[count - 4]];
        let three = |state: &State, [one, two]: [f64; 2]| {
            let [point, slope, bend] = [state.point, state.first, state.second].map(first);
            let second = sum(point, scaled(slope, one / 3.0));
            let slope = sum(slope, scaled(bend, 0.5 * one));
            [point, second, sum(second, scaled(slope, two / 3.0))]
        };
        for (k, coefficient) in three(start, leading).into_iter().enumerate() {
            self.coefficients[k] = coefficient;
        }
        for (k, coefficient) in three(end, trailing).into_iter().enumerate() {
            self.coefficients[last - k] = coefficient;
        }
    }

    /// Solves for the coefficients between the fixed ones with the present scales.
    fn solve_once(&mut self, samples: &[Sample]) {
        let count = self.free.len();
        self.rows.clear();
        self.rows.resize(count, [0.0; BANDS + 1]);
        self.right.clear();
        self.right.resize(count, [0.0; N]);
        let mut equations = Equations {
            rows: &mut self.rows,
            right: &mut self.right,
            coefficients: &self.coefficients,
            free: self.free.clone(),
        };
        for (span, row) in self.thirds.iter().enumerate() {
            equations.add(span, row, 1.0, [0.0; N]);
        }
        for (sample, &scale) in samples.iter().zip(&self.scales) {
            let cube = scale * scale * scale;
            let weight = sample.weight_mm / (cube * cube);
            let (span, basis) = (sample.span, &sample.basis);
            equations.add(span, basis, weight, first(sample.point));
        }
        for row in 0..count {
            let pivot = self.rows[row];
            let reach = BANDS.min(count - 1 - row);
            for p in 1..=reach {
                let factor = pivot[p] / pivot[0];
                for q in p..=reach {
                    self.rows[row + p][q - p] -= factor * pivot[q];
                }
                self.right[row + p] = difference(self.right[row + p], scaled(self.right[row], factor));
            }
        }
        for row in (0..count).rev() {
            let pivot = self.rows[row];
            let mut value = self.right[row];
            for p in 1..=BANDS.min(count - 1 - row) {
                value = difference(value, scaled(self.coefficients[self.free.start + row + p], pivot[p]));
            }
            self.coefficients[self.free.start + row] = scaled(value, 1.0 / pivot[0]);
        }
    }
}

/// The normal equations under construction.
struct Equations<'a, const N: usize> {
    rows: &'a mut [[f64; BANDS + 1]],
    right: &'a mut [[f64; N]],
    coefficients: &'a [[f64; N]],
    free: Range<usize>,
}

impl<const N: usize> Equations<'_, N> {
    /// Adds weight·(row·c − target)² of the four coefficients c of a span.
    fn add(&mut self, span: usize, row: &[f64; 4], weight: f64, target: [f64; N]) {
        let mut rest = target;
        let mut lowest = 4;
        let mut behind = 0;
        for k in 0..4 {
            if self.free.contains(&(span + k)) {
                lowest = lowest.min(k);
                behind = k + 1;
            } else {
                // What is fixed goes to the right side.
                rest = difference(rest, scaled(self.coefficients[span + k], row[k]));
            }
        }
        for a in lowest..behind {
            let place = span + a - self.free.start;
            let weighted = weight * row[a];
            self.right[place] = sum(self.right[place], scaled(rest, weighted));
            for b in a..behind {
                self.rows[place][b - a] += weighted * row[b];
            }
        }
    }
}

/// Bézier control points of a span between knots 2 and 3 of the six that its coefficients depend on.
fn control_points<const N: usize>(knots: &[f64], own: &[[f64; N]; 4]) -> [[f64; N]; 4] {
    let (from, to) = (knots[2], knots[3]);
    [[from; 3], [from, from, to], [from, to, to], [to; 3]].map(|arguments| {
        let mut points = *own;
        for (level, x) in arguments.into_iter().enumerate() {
            for i in (level + 1..4).rev() {
                let [low, high] = [knots[i - 1], knots[i + 2 - level]];
                let share = (x - low) / (high - low);
                points[i] = sum(points[i - 1], scaled(difference(points[i], points[i - 1]), share));
            }
        }
        points[3]
    })
}

/// Values of the four basis functions of a span at an arc length within it.
pub(super) fn basis(knots: impl Fn(isize) -> f64, s: f64) -> [f64; 4] {
    // Knots −2 to 3 relative to the span's start.
    let mut values = [1.0, 0.0, 0.0, 0.0];
    for level in 1..=3 {
        let mut saved = 0.0;
        for r in 0..level {
            let right = knots(r as isize + 1) - s;
            let left = s - knots(1 - (level - r) as isize);
            let part = values[r] / (right + left);
            values[r] = saved + right * part;
            saved = left * part;
        }
        values[level] = saved;
    }
    values
}
