//! The least time within the rows of a window, by a primal-dual interior point method.
//!
//! All rows but those of the jerk are linear in the coefficients c of b, and the time is convex. A row of the jerk reads
//! |L·c| ≤ φ(b) with φ = 1/√b, which is convex: its tangent at the present b lies below it, so that a step within the rows of
//! the tangent is one within those of the jerk. The tangent is renewed in every step. Steps are those of Newton's method with a
//! predictor and a corrector (Mehrotra); the number of them is bounded, and the result is whatever it is when they are over:
//! whether it keeps the limits is judged by [`super::check`].

use super::banded::Banded;
use super::problem::{PLACES, Problem, Row};
use crate::tolerance::{SPEED_GAP, SPEED_START_SLACK};

/// A one-sided row g(c) ≤ 0 with its slack and its price.
#[derive(Clone, Copy, Default)]
struct Side {
    /// Derivative of g by three coefficients.
    a: Row,
    g: f64,
    slack: f64,
    price: f64,
    /// Change of g along the present direction; then of the price.
    change: f64,
    correction: f64,
}

/// What the method needs between its steps; kept so that windows allocate nothing.
#[derive(Clone, Default)]
pub(super) struct Solver {
    sides: Vec<Side>,
    matrix: Banded,
    gradient: Vec<f64>,
    direction: Vec<f64>,
}

/// Smallest ratio of the next target to the present complementarity, and of that to the last one.
const LEAST_CENTERING: f64 = 1e-3;
const LAST_CENTERING: f64 = 0.3;
/// Part of the way to the nearest limit that a step takes.
const STEP_SHARE: f64 = 0.98;
/// Below this step the next one leads back to the middle.
const SHORT_STEP: f64 = 0.2;
/// Largest ratio of a product of slack and price to their mean, and of that to it.
const OFF_CENTER: f64 = 30.0;
/// 1/(largest relative decrease of a coefficient in a step).
const DECREASE: f64 = 1.4;
/// Largest residual of the rows, as a share of their scale, that counts as none.
const NO_RESIDUAL: f64 = 1e-9;
/// Largest residual that a result may have when the steps are over: less than what plans leave unused of the limits.
const SMALL_RESIDUAL: f64 = 1e-3;

impl Solver {
    /// Improves the coefficients, of which the two at either end are given, in at most `steps` steps, down to a duality gap of
    /// `gap` times the time; whether they keep the rows.
    pub(super) fn solve(&mut self, problem: &Problem, c: &mut [f64], steps: usize, gap: f64) -> bool {
        let intervals = problem.knots.intervals();
        let rows = problem.axes * (2 * PLACES + 2) + 1;
        self.sides.clear();
        self.sides.resize(rows * intervals, Side::default());
        let per_row = 1.0 / self.sides.len() as f64;
        let time_s = problem.time_s(c);
        let last_target = gap * time_s * per_row;
        let mut last_step = 1.0;
        for step in 0..steps {
            let residual = self.evaluate(problem, c, rows, (step == 0).then_some(time_s * per_row));
            let complementarity = self.sides.iter().map(|side| side.slack * side.price).sum::<f64>() * per_row;
            if step > 0 && complementarity < last_target && residual < NO_RESIDUAL {
                return true;
            }
            if !complementarity.is_finite() {
                return false;
            }
            self.center(complementarity);
            self.assemble(problem, c, rows);
            // Predictor: straight at the optimum.
            self.direction.clear();
            self.direction.extend_from_slice(&self.gradient);
            self.matrix.solve(&mut self.direction);
            let mut target = self.predict(rows, complementarity, per_row).max(LAST_CENTERING * last_target);
            if last_step < SHORT_STEP {
                // Back to the middle first.
                target = complementarity;
                self.sides.iter_mut().for_each(|side| side.correction = 0.0);
            }
            // Corrector: with what the predictor's step would miss the products by.
            self.direction.copy_from_slice(&self.gradient);
            for (index, sides) in self.sides.chunks_exact(rows).enumerate() {
                let direction = &mut self.direction[index..index + 3];
                for side in sides {
                    let pull = (target - side.correction) / side.slack;
                    for (direction, a) in direction.iter_mut().zip(side.a) {
                        *direction -= a * pull;
                    }
                }
            }
            for fixed in fixed(intervals) {
                self.direction[fixed] = 0.0;
            }
            self.matrix.solve(&mut self.direction);
            last_step = self.advance(c, rows, target);
        }
        let residual = self.evaluate(problem, c, rows, None);
        residual < SMALL_RESIDUAL
    }

    /// The rows at the present coefficients; slacks follow where the tangent leaves more, and are made when a complementarity
    /// is given. The largest residual, as a share of the row's scale.
    fn evaluate(&mut self, problem: &Problem, c: &[f64], rows: usize, start: Option<f64>) -> f64 {
        let axes = problem.axes;
        let mut largest = 0.0_f64;
        for (index, sides) in self.sides.chunks_exact_mut(rows).enumerate() {
            let c = &c[index..index + 3];
            let dot = |row: &Row| row[0] * c[0] + row[1] * c[1] + row[2] * c[2];
            let mut sides = sides.iter_mut();
            let mut put = |a: Row, g: f64, scale: f64| {
                let Some(side) = sides.next() else { return };
                side.a = a;
                side.g = g;
                match start {
                    Some(complementarity) => {
                        side.slack = (-g).max(SPEED_START_SLACK * scale);
                        side.price = complementarity / side.slack;
                    }
                    None => side.slack = side.slack.max(-g),
                }
                largest = largest.max((g + side.slack) / scale);
            };
            for place in 0..PLACES {
                let at = index * PLACES + place;
                let square = &problem.squares[at];
                let b = dot(square);
                let inverse = 1.0 / b.sqrt();
                let fall = 0.5 * inverse / b;
                for row in &problem.jerks[at * axes..][..axes] {
                    let value = dot(row);
                    put(core::array::from_fn(|k| row[k] + fall * square[k]), value - inverse, inverse);
                    put(core::array::from_fn(|k| fall * square[k] - row[k]), -value - inverse, inverse);
                }
            }
            for row in &problem.accelerations[index * axes..][..axes] {
                // What is given cannot be changed.
                let row = if index == 0 { [0.0; 3] } else { *row };
                let value = dot(&row);
                put(row, value - 1.0, 1.0);
                put(row.map(|value| -value), -value - 1.0, 1.0);
            }
            // Every interval has the cap of its first coefficient; two at either end are given.
            let cap = problem.caps[index];
            if index < 2 || cap.is_infinite() {
                put([0.0; 3], -1.0, 1.0);
            } else {
                put([1.0 / cap, 0.0, 0.0], c[0] / cap - 1.0, 1.0);
            }
        }
        largest
    }

    /// Matrix of Newton's method, factored, and the right side without products.
    fn assemble(&mut self, problem: &Problem, c: &[f64], rows: usize) {
        self.matrix.clear(c.len());
        self.gradient.clear();
        for (index, (&c, weight)) in c.iter().zip(&problem.weights).enumerate() {
            let force = 0.5 * weight / (c * c.sqrt());
            self.gradient.push(force);
            self.matrix.add_diagonal(index, 1.5 * force / c);
        }
        for (index, sides) in self.sides.chunks_exact(rows).enumerate() {
            let mut force = [0.0; 3];
            for side in sides {
                let weight = side.price / side.slack;
                self.matrix.add_square(index, &side.a, weight);
                let pull = weight * (side.g + side.slack);
                for (force, a) in force.iter_mut().zip(side.a) {
                    *force += a * pull;
                }
            }
            for (gradient, force) in self.gradient[index..index + 3].iter_mut().zip(force) {
                *gradient -= force;
            }
        }
        for fixed in fixed(c.len() - 2) {
            self.matrix.fix(fixed);
            self.gradient[fixed] = 0.0;
        }
        self.matrix.factor();
    }

    /// Changes of the rows along the direction.
    fn look_along(&mut self, rows: usize) {
        for (index, sides) in self.sides.chunks_exact_mut(rows).enumerate() {
            let x = &self.direction[index..index + 3];
            for side in sides {
                side.change = side.a[0] * x[0] + side.a[1] * x[1] + side.a[2] * x[2];
            }
        }
    }

    /// How far the predictor gets, as the next target; and what its products miss.
    fn predict(&mut self, rows: usize, complementarity: f64, per_row: f64) -> f64 {
        self.look_along(rows);
        let (mut most, mut most_price) = (1.0_f64, 1.0_f64);
        for side in &mut self.sides {
            let grows = -(side.g + side.slack) - side.change;
            let shrinks = -grows / side.slack;
            most = most.max(shrinks);
            most_price = most_price.max(1.0 - shrinks);
            side.correction = grows * side.price * (shrinks - 1.0);
        }
        let (step, price_step) = (1.0 / most, 1.0 / most_price);
        let mut reached = 0.0;
        for side in &self.sides {
            let grows = -(side.g + side.slack) - side.change;
            let price = side.price * (-1.0 - grows / side.slack);
            reached += (side.slack + step * grows) * (side.price + price_step * price);
        }
        let ratio = reached * per_row / complementarity;
        (ratio * ratio * ratio).max(LEAST_CENTERING) * complementarity
    }

    /// Goes along the direction as far as slacks, prices and coefficients stay positive; the step.
    fn advance(&mut self, c: &mut [f64], rows: usize, target: f64) -> f64 {
        self.look_along(rows);
        let (mut most, mut most_price) = (1.0_f64, 1.0_f64);
        for side in &mut self.sides {
            let grows = -(side.g + side.slack) - side.change;
            most = most.max(-grows / side.slack);
            let price = (target - side.correction) / side.slack - side.price - side.price * grows / side.slack;
            side.correction = price;
            most_price = most_price.max(-price / side.price);
        }
        for (c, x) in c.iter().zip(&self.direction) {
            most = most.max(-DECREASE * x / c);
        }
        let part = |most: f64| if most > STEP_SHARE { STEP_SHARE / most } else { 1.0 };
        let (step, price_step) = (part(most), part(most_price));
        for (c, x) in c.iter_mut().zip(&self.direction) {
            *c += step * x;
        }
        for side in &mut self.sides {
            let grows = -(side.g + side.slack) - side.change;
            side.slack += step * grows;
            side.price += price_step * side.correction;
        }
        step.min(price_step)
    }

    /// Keeps products of slack and price near their mean: far from it steps become short. Prices are free, as nothing but the
    /// products is asked of them.
    fn center(&mut self, complementarity: f64) {
        for side in &mut self.sides {
            let price = complementarity / side.slack;
            side.price = side.price.max(price / OFF_CENTER).min(price * OFF_CENTER);
        }
    }
}

/// The coefficients that are given: two at either end.
fn fixed(intervals: usize) -> [usize; 4] {
    [0, 1, intervals, intervals + 1]
}

/// Gap of a plan, and of the first, coarse one.
pub(super) const GAPS: [f64; 2] = [10.0 * SPEED_GAP, SPEED_GAP];
