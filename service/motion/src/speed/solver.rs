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
    /// 1/slack.
    per_slack: f64,
    price: f64,
    /// Change of the slack along the present direction, and what the predictor's products miss, then the change of the price.
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
const OFF_CENTER: f64 = 1e3;
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
            let (residual, products) = self.evaluate(problem, c, rows, (step == 0).then_some(time_s * per_row));
            let complementarity = products * per_row;
            if step > 0 && complementarity < last_target && residual < NO_RESIDUAL {
                return true;
            }
            if !complementarity.is_finite() {
                return false;
            }
            self.assemble(problem, c, rows, complementarity);
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
                    let pull = (target - side.correction) * side.per_slack;
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
        let (residual, _) = self.evaluate(problem, c, rows, None);
        residual < SMALL_RESIDUAL
    }

    /// The rows at the present coefficients; slacks follow where the tangent leaves more, and are made when a complementarity
    /// is given. The largest residual, as a share of the row's scale, and the sum of the products of slack and price.
    fn evaluate(&mut self, problem: &Problem, c: &[f64], rows: usize, start: Option<f64>) -> (f64, f64) {
        let axes = problem.axes;
        let (mut largest, mut products) = (0.0_f64, 0.0);
        for (index, sides) in self.sides.chunks_exact_mut(rows).enumerate() {
            let c = &c[index..index + 3];
            let dot = |row: &Row| row[0] * c[0] + row[1] * c[1] + row[2] * c[2];
            let mut sides = sides.iter_mut();
            let mut put = |a: Row, g: f64, per_scale: f64| {
                let Some(side) = sides.next() else { return };
                side.a = a;
                side.g = g;
                side.slack = match start {
                    Some(_) => (-g).max(SPEED_START_SLACK / per_scale),
                    None => side.slack.max(-g),
                };
                side.per_slack = 1.0 / side.slack;
                if let Some(complementarity) = start {
                    side.price = complementarity * side.per_slack;
                }
                products += side.slack * side.price;
                largest = largest.max((g + side.slack) * per_scale);
            };
            for place in 0..PLACES {
                let at = index * PLACES + place;
                let square = &problem.squares[at];
                let b = dot(square);
                let speed = b.sqrt();
                let inverse = 1.0 / speed;
                let fall = 0.5 * inverse / b;
                for row in &problem.jerks[at * axes..][..axes] {
                    let value = dot(row);
                    put(core::array::from_fn(|k| row[k] + fall * square[k]), value - inverse, speed);
                    put(core::array::from_fn(|k| fall * square[k] - row[k]), -value - inverse, speed);
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
        (largest, products)
    }

    /// Matrix of Newton's method, factored, and the right side without products.
    ///
    /// Products of slack and price are kept near their mean before: far from it steps become short. Prices are free, as nothing but
    /// the products is asked of them.
    fn assemble(&mut self, problem: &Problem, c: &[f64], rows: usize, complementarity: f64) {
        let prices = [complementarity / OFF_CENTER, complementarity * OFF_CENTER];
        self.matrix.clear(c.len());
        self.gradient.clear();
        for (index, (&c, weight)) in c.iter().zip(&problem.weights).enumerate() {
            let force = 0.5 * weight / (c * c.sqrt());
            self.gradient.push(force);
            self.matrix.add_diagonal(index, 1.5 * force / c);
        }
        for (index, sides) in self.sides.chunks_exact_mut(rows).enumerate() {
            let mut force = [0.0; 3];
            for side in sides {
                side.price = side.price.max(prices[0] * side.per_slack).min(prices[1] * side.per_slack);
                let weight = side.price * side.per_slack;
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

    /// How far the predictor gets, as the next target; and what its products miss.
    fn predict(&mut self, rows: usize, complementarity: f64, per_row: f64) -> f64 {
        let (mut most, mut most_price) = (1.0_f64, 1.0_f64);
        // Sums of the products with none, one and both of the changes.
        let mut sums = [0.0; 4];
        for (index, sides) in self.sides.chunks_exact_mut(rows).enumerate() {
            let x = &self.direction[index..index + 3];
            for side in sides {
                let change = side.a[0] * x[0] + side.a[1] * x[1] + side.a[2] * x[2];
                let grows = -(side.g + side.slack) - change;
                let shrinks = -grows * side.per_slack;
                most = most.max(shrinks);
                most_price = most_price.max(1.0 - shrinks);
                let price = side.price * (shrinks - 1.0);
                side.correction = grows * price;
                sums[0] += side.slack * side.price;
                sums[1] += grows * side.price;
                sums[2] += side.slack * price;
                sums[3] += side.correction;
            }
        }
        let (step, price_step) = (1.0 / most, 1.0 / most_price);
        let reached = sums[0] + step * sums[1] + price_step * (sums[2] + step * sums[3]);
        let ratio = reached * per_row / complementarity;
        (ratio * ratio * ratio).max(LEAST_CENTERING) * complementarity
    }

    /// Goes along the direction as far as slacks, prices and coefficients stay positive; the step.
    fn advance(&mut self, c: &mut [f64], rows: usize, target: f64) -> f64 {
        let (mut most, mut most_price) = (1.0_f64, 1.0_f64);
        for (index, sides) in self.sides.chunks_exact_mut(rows).enumerate() {
            let x = &self.direction[index..index + 3];
            for side in sides {
                let change = side.a[0] * x[0] + side.a[1] * x[1] + side.a[2] * x[2];
                let grows = -(side.g + side.slack) - change;
                let shrinks = -grows * side.per_slack;
                most = most.max(shrinks);
                let price = (target - side.correction) * side.per_slack - side.price * (1.0 - shrinks);
                most_price = most_price.max(-price / side.price);
                (side.change, side.correction) = (grows, price);
            }
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
            side.slack += step * side.change;
            side.price += price_step * side.correction;
        }
        step.min(price_step)
    }
}

/// The coefficients that are given: two at either end.
fn fixed(intervals: usize) -> [usize; 4] {
    [0, 1, intervals, intervals + 1]
}

/// Gap of a plan, and of the first, coarse one.
pub(super) const GAPS: [f64; 2] = [10.0 * SPEED_GAP, SPEED_GAP];
