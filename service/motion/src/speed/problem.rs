//! The problem of a window: knots, and every limit as a row over the coefficients of b.
//!
//! b = ṡ² is a quadratic B-spline: on an interval between two knots its second derivative is constant, and three coefficients
//! decide. A coefficient is at most the square of every speed commanded where it acts, since a B-spline stays between its
//! coefficients. At the knots and in the middle of every interval the limits of the axes hold:
//!
//! ```text
//! acceleration  |q″·b + ½·q′·b′| ≤ A
//! jerk          |q‴·b + 3/2·q″·b′ + ½·q′·b″| ≤ J/√b
//! ```

use super::path::{Derivatives, Path};
use crate::tolerance::{SPEED_LIMIT_SHARE, SPEED_SIDE};

/// Places of an interval at which the jerk is held: its ends and its middle.
pub(super) const PLACES: usize = 3;

/// Knots of the place; beyond both ends they are mirrored.
#[derive(Clone, Debug, Default)]
pub(super) struct Knots(pub(super) Vec<f64>);

/// How b and b′ follow from the coefficients with the number of a knot and the next: b = weights·c, b′ = slope·(c₁ − c₀).
#[derive(Clone, Copy)]
pub(super) struct AtKnot {
    pub(super) weights: [f64; 2],
    pub(super) slope: f64,
}

impl Knots {
    /// Number of intervals.
    pub(super) fn intervals(&self) -> usize {
        self.0.len() - 1
    }

    /// A knot, by its number from −2 to two beyond the last.
    pub(super) fn at(&self, index: isize) -> f64 {
        let last = self.intervals() as isize;
        let knot = |index: isize| self.0[index.clamp(0, last) as usize];
        if index < 0 {
            2.0 * knot(0) - knot(-index)
        } else if index > last {
            2.0 * knot(last) - knot(2 * last - index)
        } else {
            knot(index)
        }
    }

    pub(super) fn at_knot(&self, index: usize) -> AtKnot {
        let index = index as isize;
        let (before, here, after) = (self.at(index - 1), self.at(index), self.at(index + 1));
        let per_both = 1.0 / (after - before);
        AtKnot { weights: [(after - here) * per_both, (here - before) * per_both], slope: 2.0 * per_both }
    }

    /// b and b′ at a knot.
    pub(super) fn state(&self, index: usize, c: &[f64]) -> (f64, f64) {
        let AtKnot { weights, slope } = self.at_knot(index);
        (weights[0] * c[index] + weights[1] * c[index + 1], slope * (c[index + 1] - c[index]))
    }

    /// The coefficients with the numbers of a knot and the next that give it b and b′.
    pub(super) fn coefficients(&self, index: usize, b: f64, derivative: f64) -> [f64; 2] {
        let AtKnot { weights, slope } = self.at_knot(index);
        let step = derivative / slope;
        [b - weights[1] * step, b + weights[0] * step]
    }
}

/// The rows of one limit at one place, as shares of it: |row·c|, on three coefficients.
pub(super) type Row = [f64; 3];

/// Everything that limits the speed of a window, by interval.
#[derive(Clone, Debug, Default)]
pub(super) struct Problem {
    pub(super) knots: Knots,
    pub(super) axes: usize,
    /// 1/largest coefficient, 0 where it has none.
    pub(super) per_caps: Vec<f64>,
    /// Smallest coefficients: less than what is known to be possible.
    pub(super) floors: Vec<f64>,
    /// Weights of the time: the sum of weight/√c is about ∫ds/√b.
    pub(super) weights: Vec<f64>,
    /// By knot but the last, and axis.
    pub(super) accelerations: Vec<Row>,
    /// By interval, place and axis.
    pub(super) jerks: Vec<Row>,
    /// b by the coefficients; by interval and place.
    pub(super) squares: Vec<Row>,
    derivatives: Vec<Derivatives>,
}

/// A row of b, b′ and b″ in the interval from knot `index` on, `x` from its start.
pub(super) fn basis(knots: &Knots, index: usize, x: f64) -> [Row; 3] {
    let h = knots.0[index + 1] - knots.0[index];
    let (start, end) = (knots.at_knot(index), knots.at_knot(index + 1));
    let first = [-start.slope, start.slope, 0.0];
    let last = [0.0, -end.slope, end.slope];
    let value = [start.weights[0], start.weights[1], 0.0];
    let second: Row = core::array::from_fn(|k| (last[k] - first[k]) / h);
    let slope = core::array::from_fn(|k| first[k] + second[k] * x);
    let square = core::array::from_fn(|k| value[k] + x * (first[k] + 0.5 * x * second[k]));
    [square, slope, second]
}

impl Problem {
    /// The rows for these knots. `shares` are the parts of the limits of acceleration and jerk that may be used, by interval;
    /// `middles` the places between their ends, from 0 to 1, at which they are held.
    pub(super) fn build(&mut self, path: &Path<'_>, knots: Knots, shares: &[f64], middles: &[f64]) {
        let intervals = knots.intervals();
        let axes = path.axes.len();
        self.knots = knots;
        self.axes = axes;
        self.accelerations.resize(intervals * axes, [0.0; 3]);
        self.jerks.resize(intervals * PLACES * axes, [0.0; 3]);
        self.squares.resize(intervals * PLACES, [0.0; 3]);
        self.derivatives.resize(axes, [0.0; 3]);
        self.per_caps.clear();
        self.per_caps.resize(intervals + 2, 0.0);
        self.weights.clear();
        for index in 0..intervals + 2 {
            let (before, after) = (self.knots.at(index as isize - 2), self.knots.at(index as isize + 1));
            self.weights.push((after - before) / 3.0);
        }
        for index in 0..intervals {
            self.set_interval(path, index, shares[index], middles[index]);
        }
    }

    /// The rows of one interval.
    pub(super) fn set_interval(&mut self, path: &Path<'_>, index: usize, share: f64, middle: f64) {
        let share = share * SPEED_LIMIT_SHARE;
        let [from, to] = [self.knots.0[index], self.knots.0[index + 1]];
        let h = to - from;
        let command = path.command(from, to);
        let mut per_speed = 1.0 / command;
        for place in 0..PLACES {
            // Where elements meet, derivatives of the side of this interval.
            let x = h * [SPEED_SIDE, middle, 1.0 - SPEED_SIDE][place];
            path.derivatives(from + x, &mut self.derivatives);
            let x = h * [0.0, middle, 1.0][place];
            let [square, slope, second] = basis(&self.knots, index, x);
            let at = index * PLACES + place;
            self.squares[at] = square;
            for (number, (axis, [first, bend, twist])) in path.axes.iter().zip(&self.derivatives).enumerate() {
                let per_jerk = 1.0 / (axis.jerk * share);
                self.jerks[at * self.axes + number] = core::array::from_fn(|k| {
                    (twist * square[k] + 1.5 * bend * slope[k] + 0.5 * first * second[k]) * per_jerk
                });
                if place == 0 {
                    let per_acceleration = 1.0 / (axis.acceleration * share);
                    self.accelerations[index * self.axes + number] =
                        core::array::from_fn(|k| (bend * square[k] + 0.5 * first * slope[k]) * per_acceleration);
                }
                per_speed = per_speed.max(first.abs() / (SPEED_LIMIT_SHARE * axis.velocity));
            }
        }
        for per_cap in &mut self.per_caps[index..index + 3] {
            *per_cap = per_cap.max(per_speed * per_speed);
        }
    }
}
