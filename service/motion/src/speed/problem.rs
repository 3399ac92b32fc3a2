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

use super::path::Path;
use super::samples::Samples;
use crate::tolerance::SPEED_LIMIT_SHARE;

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
    /// Places of an interval at which the jerk is held: its ends and one between them, or that one only.
    pub(super) places: usize,
    /// The same of the acceleration: its start and the one between the ends, or the start only; its end is the next one's start.
    pub(super) acceleration_places: usize,
    /// 1/largest coefficient, 0 where it has none.
    pub(super) per_caps: Vec<f64>,
    /// Smallest coefficients: less than what is known to be possible.
    pub(super) floors: Vec<f64>,
    /// Weights of the time: the sum of weight/√c is about ∫ds/√b.
    pub(super) weights: Vec<f64>,
    /// By interval, place and axis.
    pub(super) accelerations: Vec<Row>,
    /// By interval, place and axis.
    pub(super) jerks: Vec<Row>,
    /// b by the coefficients; by interval and place.
    pub(super) squares: Vec<Row>,
}

/// How the limits are held in an interval.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hold {
    /// Part of the limits of acceleration and jerk that may be used.
    pub(super) share: f64,
    /// The place between its ends at which they are held, and the part of that part which is permitted there.
    pub(super) middle: usize,
    pub(super) middle_share: f64,
}

/// Rows of b and b′ at the start of an interval and of its b″, over its three coefficients.
#[derive(Clone, Copy)]
pub(super) struct Basis {
    value: Row,
    slope: Row,
    second: Row,
}

impl Basis {
    /// Those of the interval from knot `index` on.
    pub(super) fn of(knots: &Knots, index: usize) -> Self {
        let per_length = 1.0 / (knots.0[index + 1] - knots.0[index]);
        let (start, end) = (knots.at_knot(index), knots.at_knot(index + 1));
        let value = [start.weights[0], start.weights[1], 0.0];
        let slope = [-start.slope, start.slope, 0.0];
        let last = [0.0, -end.slope, end.slope];
        let second = core::array::from_fn(|k| (last[k] - slope[k]) * per_length);
        Self { value, slope, second }
    }

    /// Rows of b, b′ and b″, `x` from its start.
    pub(super) fn at(&self, x: f64) -> [Row; 3] {
        let slope = core::array::from_fn(|k| self.slope[k] + self.second[k] * x);
        let square = core::array::from_fn(|k| self.value[k] + x * (self.slope[k] + 0.5 * x * self.second[k]));
        [square, slope, self.second]
    }

    /// b, b′ and b″ at its start.
    pub(super) fn state(&self, c: &[f64]) -> [f64; 3] {
        [self.value, self.slope, self.second].map(|row| row[0] * c[0] + row[1] * c[1] + row[2] * c[2])
    }
}

impl Problem {
    /// The rows for these knots, at all held places or, for a first plan, at the fewest.
    pub(super) fn build(
        &mut self,
        path: &Path<'_>,
        (knots, samples): (Knots, &Samples),
        is_first: bool,
        holds: &[Hold],
    ) {
        let intervals = knots.intervals();
        let axes = path.axes.len();
        self.knots = knots;
        self.axes = axes;
        (self.places, self.acceleration_places) = if is_first { (1, 1) } else { (3, 2) };
        self.accelerations.resize(intervals * self.acceleration_places * axes, [0.0; 3]);
        self.jerks.resize(intervals * self.places * axes, [0.0; 3]);
        self.squares.resize(intervals * self.places, [0.0; 3]);
        self.per_caps.clear();
        self.per_caps.resize(intervals + 2, 0.0);
        self.weights.clear();
        for index in 0..intervals + 2 {
            let (before, after) = (self.knots.at(index as isize - 2), self.knots.at(index as isize + 1));
            self.weights.push((after - before) / 3.0);
        }
        for (index, &hold) in holds[..intervals].iter().enumerate() {
            self.set_interval(path, samples, index, hold);
        }
    }

    /// The rows of one interval.
    pub(super) fn set_interval(&mut self, path: &Path<'_>, samples: &Samples, index: usize, hold: Hold) {
        let Hold { share, middle, middle_share } = hold;
        let [from, to] = [self.knots.0[index], self.knots.0[index + 1]];
        let h = to - from;
        let basis = Basis::of(&self.knots, index);
        let mut per_speed = 1.0 / path.command(from, to);
        let [start, _, end] = samples.held(index);
        let part = |sample: usize| share * if sample == middle { middle_share } else { SPEED_LIMIT_SHARE };
        let held = if self.places == 1 { &[middle][..] } else { &[start, middle, end] };
        for (place, &sample) in held.iter().enumerate() {
            let part = part(sample);
            let [square, slope, second] = basis.at(h * samples.share(sample));
            let at = index * self.places + place;
            self.squares[at] = square;
            let rows = &mut self.jerks[at * self.axes..][..self.axes];
            for ((axis, [first, bend, twist]), row) in path.axes.iter().zip(samples.derivatives(sample)).zip(rows) {
                let per_jerk = 1.0 / (axis.jerk * part);
                *row = core::array::from_fn(|k| {
                    (twist * square[k] + 1.5 * bend * slope[k] + 0.5 * first * second[k]) * per_jerk
                });
            }
        }
        for (place, &sample) in [start, middle][..self.acceleration_places].iter().enumerate() {
            let part = part(sample);
            let [square, slope, _] = basis.at(h * samples.share(sample));
            let at = index * self.acceleration_places + place;
            let rows = &mut self.accelerations[at * self.axes..][..self.axes];
            for ((axis, [first, bend, _]), row) in path.axes.iter().zip(samples.derivatives(sample)).zip(rows) {
                let per_acceleration = 1.0 / (axis.acceleration * part);
                *row = core::array::from_fn(|k| (bend * square[k] + 0.5 * first * slope[k]) * per_acceleration);
            }
        }
        for sample in [start, middle, end] {
            for (axis, [first, ..]) in path.axes.iter().zip(samples.derivatives(sample)) {
                per_speed = per_speed.max(first.abs() / (SPEED_LIMIT_SHARE * axis.velocity));
            }
        }
        for per_cap in &mut self.per_caps[index..index + 3] {
            *per_cap = per_cap.max(per_speed * per_speed);
        }
    }
}
