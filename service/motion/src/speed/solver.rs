//! The least time within the rows of a window, by a primal-dual interior point method.
//!
//! All rows but those of the jerk are linear in the coefficients c of b, and the time is convex. A row of the jerk reads
//! |L·c| ≤ φ(b) with φ = 1/√b, which is convex: its tangent at the present b lies below it, so that a step within the rows of
//! the tangent is one within those of the jerk. The tangent is renewed in every step. Steps are those of Newton's method with a
//! predictor and a corrector (Mehrotra); the number of them is bounded, and the result is whatever it is when they are over:
//! whether it keeps the limits is judged by [`super::check`].

use std::ops::Range;

use super::banded::Banded;
use super::pair::{Found, Pair, Renewal, Steps, larger, largest};
use super::problem::{Problem, Row};
use crate::tolerance::{SPEED_GAP, SPEED_START_SLACK};

/// What the method needs between its steps; kept so that windows allocate nothing.
#[derive(Clone, Default)]
pub(super) struct Solver {
    /// By interval: those of the jerk by place and axis, those of the acceleration by axis, and the bounds of a coefficient.
    pairs: Vec<Pair>,
    /// −dφ/db by interval and place.
    falls: Vec<f64>,
    matrix: Banded,
    gradient: Vec<f64>,
    direction: Vec<f64>,
    /// Sums of the rows, by 1/slack and by the corrections.
    pulls: [Vec<f64>; 2],
    /// Rows of the acceleration, without those that only have what is given.
    accelerations: Vec<Row>,
    /// Bounds of a coefficient c as |factor·c − offset| ≤ 1, without those of given ones.
    bounds: Vec<[f64; 2]>,
}

/// Where the method starts.
#[derive(Clone, Copy)]
pub(super) struct Start {
    /// Duality gap, as a share of the time.
    gap: f64,
    /// Least slack of a limit, as a share of it.
    slack: f64,
}

impl Start {
    /// From coefficients that are some way from the best ones.
    pub(super) const FAR: Self = Self { gap: 1.0, slack: SPEED_START_SLACK };
    /// From the best ones of nearly the same problem.
    pub(super) const NEAR: Self = Self { gap: 1.0, slack: 0.1 };
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
/// Growth of the complementarity at which the steps have failed, and what may be left of it when they are over, as a multiple of the
/// last target.
const MOST_GROWTH: f64 = 1e3;
const MOST_LEFT: f64 = 50.0;
/// Largest residual of the rows, as a share of their scale, that a result may have: less than what plans leave unused of the limits.
const SMALL_RESIDUAL: f64 = 1e-3;

/// The rows of some intervals of a problem.
struct Part<'a> {
    axes: usize,
    places: usize,
    /// Rows of the acceleration in an interval.
    accelerations: usize,
    weights: &'a [f64],
    jerks: &'a [Row],
    squares: &'a [Row],
}

#[inline]
fn dot(a: &Row, c: &[f64]) -> f64 {
    a[0] * c[0] + a[1] * c[1] + a[2] * c[2]
}

/// Sums over the rows of an interval: Σ w·a·aᵀ by its upper triangle, and Σ w·r·a.
#[derive(Clone, Copy, Default)]
struct Sums {
    squares: [f64; 6],
    force: Row,
}

impl Sums {
    /// Adds weight·(a·bᵀ + b·aᵀ)/2.
    #[inline]
    fn add(&mut self, a: &Row, b: &Row, weight: f64) {
        let half = 0.5 * weight;
        let entry = |i: usize, k: usize| half * (a[i] * b[k] + a[k] * b[i]);
        let own = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
        for (sum, own) in self.squares.iter_mut().zip(own) {
            *sum += own;
        }
    }

    /// Adds weight·a·aᵀ.
    #[inline]
    fn add_square(&mut self, a: &Row, weight: f64) {
        let [x, y, z] = a.map(|value| weight * value);
        let own = [x * a[0], x * a[1], x * a[2], y * a[1], y * a[2], z * a[2]];
        for (sum, own) in self.squares.iter_mut().zip(own) {
            *sum += own;
        }
    }

    /// Adds the rows of the jerk at a place, where b is square·c; −dφ/db there.
    #[inline]
    fn add_jerks(
        &mut self,
        square: &Row,
        (rows, pairs): (&[Row], &mut [Pair]),
        c: &[f64],
        mut renew: impl FnMut(&mut Pair, f64, f64, f64) -> [[f64; 2]; 2],
    ) -> f64 {
        let b = dot(square, c);
        let speed = b.sqrt();
        let inverse = 1.0 / speed;
        let fall = 0.5 * inverse / b;
        // Of both rows together, fall·square ± row.
        let (mut across, mut weight, mut pull) = ([0.0; 3], 0.0, 0.0);
        for (row, pair) in rows.iter().zip(pairs) {
            let [weights, pulls] = renew(pair, dot(row, c), inverse, speed);
            self.add_square(row, weights[0] + weights[1]);
            self.add_force(row, pulls[0] - pulls[1]);
            for (across, row) in across.iter_mut().zip(row) {
                *across += (weights[0] - weights[1]) * row;
            }
            weight += weights[0] + weights[1];
            pull += pulls[0] + pulls[1];
        }
        self.add(&across, square, 2.0 * fall);
        self.add_square(square, fall * fall * weight);
        self.add_force(square, fall * pull);
        fall
    }

    #[inline]
    fn add_force(&mut self, a: &Row, force: f64) {
        for (sum, a) in self.force.iter_mut().zip(a) {
            *sum += force * a;
        }
    }
}

impl Solver {
    /// Improves the coefficients that act on these intervals, of which the two at either end are given, in at most `steps` steps,
    /// down to a duality gap of `gap` times the time; whether they keep the rows.
    pub(super) fn solve(
        &mut self,
        problem: &Problem,
        c: &mut [f64],
        range: Range<usize>,
        (steps, gap): (usize, f64),
        start: Start,
    ) -> bool {
        let c = &mut c[range.start..range.end + 2];
        let problem = &self.prepare(problem, range);
        let per_row = 0.5 / self.pairs.len() as f64;
        let time_s: f64 = problem.weights.iter().zip(&*c).map(|(weight, c)| weight / c.sqrt()).sum();
        let last_target = gap * time_s * per_row;
        let mut complementarity = start.gap * time_s * per_row;
        let mut renewal = Renewal::Start(complementarity, start.slack);
        let mut last_step = 1.0;
        for step in 0..steps {
            let Found { residual, products } = self.renew(problem, c, renewal, complementarity);
            complementarity = products * per_row;
            if step > 0 && complementarity < last_target && residual < SMALL_RESIDUAL {
                return true;
            }
            // Where the rows cannot all be kept, steps become nothing and prices grow without end.
            let can_go_on = complementarity <= MOST_GROWTH * start.gap * time_s * per_row;
            if !can_go_on {
                return false;
            }
            self.matrix.factor();
            // Predictor: straight at the optimum.
            self.direction.clear();
            self.direction.extend_from_slice(&self.gradient);
            self.matrix.solve(&mut self.direction);
            let mut target = self.predict(problem, complementarity, per_row).max(LAST_CENTERING * last_target);
            let mut part = 1.0;
            if last_step < SHORT_STEP {
                // Back to the middle first.
                target = complementarity;
                part = 0.0;
            }
            self.correct_direction(target, part);
            let (steps, change) = self.advance(problem, c, target, part);
            complementarity = (products + change) * per_row;
            last_step = steps[0].min(steps[1]);
            renewal = Renewal::Step(steps);
        }
        let Found { residual, .. } = self.renew(problem, c, renewal, complementarity);
        residual < SMALL_RESIDUAL && complementarity < MOST_LEFT * last_target
    }

    /// The rows of some intervals, without those that have nothing but given coefficients; makes room for their pairs.
    fn prepare<'a>(&mut self, problem: &'a Problem, range: Range<usize>) -> Part<'a> {
        let intervals = range.len();
        let (axes, places) = (problem.axes, problem.places);
        let accelerations = axes * problem.acceleration_places;
        self.accelerations.clear();
        self.accelerations
            .extend_from_slice(&problem.accelerations[range.start * accelerations..range.end * accelerations]);
        self.accelerations[..axes].fill([0.0; 3]);
        self.bounds.clear();
        let bounds = problem.per_caps[range.clone()].iter().zip(&problem.floors[range.clone()]);
        self.bounds.extend(bounds.map(|(&per_cap, &floor)| {
            let share = floor * per_cap;
            [2.0 * per_cap / (1.0 - share), if per_cap > 0.0 { (1.0 + share) / (1.0 - share) } else { 0.0 }]
        }));
        self.bounds[..2].fill([0.0; 2]);
        let pairs = axes * places + accelerations + 1;
        // What they held before is written over at the start.
        self.pairs.resize(pairs * intervals, Pair::default());
        self.falls.resize(places * intervals, 0.0);
        Part {
            axes,
            places,
            accelerations,
            weights: &problem.weights[range.start..range.end + 2],
            jerks: &problem.jerks[range.start * axes * places..range.end * axes * places],
            squares: &problem.squares[range.start * places..range.end * places],
        }
    }

    /// The direction of the corrector: to products of `target`, with `part` of what the predictor's step would miss them by.
    fn correct_direction(&mut self, target: f64, part: f64) {
        let [plain, corrections] = &self.pulls;
        self.direction.clear();
        let pulled = self.gradient.iter().zip(plain).zip(corrections);
        self.direction
            .extend(pulled.map(|((gradient, plain), correction)| gradient - (target * plain - part * correction)));
        for fixed in fixed(self.direction.len() - 2) {
            self.direction[fixed] = 0.0;
        }
        self.matrix.solve(&mut self.direction);
    }

    /// The rows at the present coefficients, with their slacks and prices; slacks follow where the tangent leaves more. Then the
    /// matrix of Newton's method, and the right side without products.
    ///
    /// Products of slack and price are kept near their mean before: far from it steps become short. Prices are free, as nothing but
    /// the products is asked of them.
    fn renew(&mut self, problem: &Part<'_>, c: &[f64], renewal: Renewal, complementarity: f64) -> Found {
        let &Part { axes, places, accelerations, .. } = problem;
        let pairs = axes * places + accelerations + 1;
        let prices = [complementarity / OFF_CENTER, complementarity * OFF_CENTER];
        let mut found = Found::default();
        self.matrix.clear(c.len());
        self.gradient.clear();
        for (index, (&c, weight)) in c.iter().zip(problem.weights).enumerate() {
            let force = 0.5 * weight / (c * c.sqrt());
            self.gradient.push(force);
            self.matrix.add_diagonal(index, 1.5 * force / c);
        }
        for (index, own) in self.pairs.chunks_exact_mut(pairs).enumerate() {
            let c = &c[index..index + 3];
            let mut sums = Sums::default();
            let held = own[..places * axes].chunks_exact_mut(axes).zip(&mut self.falls[index * places..][..places]);
            for (place, (own, fall)) in held.enumerate() {
                let at = index * places + place;
                let rows = (&problem.jerks[at * axes..][..axes], own);
                *fall = sums.add_jerks(&problem.squares[at], rows, c, |pair, value, bound, per_scale| {
                    pair.renew(value, bound, per_scale, renewal, prices, &mut found)
                });
            }
            let rows = &self.accelerations[index * accelerations..][..accelerations];
            for (row, pair) in rows.iter().zip(&mut own[places * axes..][..accelerations]) {
                let [weights, pulls] = pair.renew(dot(row, c), 1.0, 1.0, renewal, prices, &mut found);
                sums.add_square(row, weights[0] + weights[1]);
                sums.add_force(row, pulls[0] - pulls[1]);
            }
            // Every interval has the bounds of its first coefficient.
            let [factor, offset] = self.bounds[index];
            let value = factor * c[0] - offset;
            let [weights, pulls] = own[pairs - 1].renew(value, 1.0, 1.0, renewal, prices, &mut found);
            sums.squares[0] += factor * factor * (weights[0] + weights[1]);
            sums.force[0] += factor * (pulls[0] - pulls[1]);
            self.matrix.add(index, &sums.squares);
            for (gradient, force) in self.gradient[index..index + 3].iter_mut().zip(sums.force) {
                *gradient -= force;
            }
        }
        for fixed in fixed(c.len() - 2) {
            self.matrix.fix(fixed);
            self.gradient[fixed] = 0.0;
        }
        found
    }

    /// How far the predictor gets, as the next target; and what its products miss.
    fn predict(&mut self, problem: &Part<'_>, complementarity: f64, per_row: f64) -> f64 {
        let &Part { axes, places, accelerations, .. } = problem;
        let pairs = axes * places + accelerations + 1;
        let mut most = [[1.0_f64; 2]; 2];
        // Sums of the products with none, one and both of the changes.
        let mut sums = [[0.0; 2]; 4];
        for pulls in &mut self.pulls {
            pulls.clear();
            pulls.resize(self.direction.len(), 0.0);
        }
        for (index, own) in self.pairs.chunks_exact_mut(pairs).enumerate() {
            let x = &self.direction[index..index + 3];
            let mut pulled = [[0.0; 3]; 2];
            let mut pull = |row: &Row, by: [[f64; 2]; 2]| {
                for (pulled, by) in pulled.iter_mut().zip(by) {
                    for (pulled, row) in pulled.iter_mut().zip(row) {
                        *pulled += (by[0] - by[1]) * row;
                    }
                }
            };
            for place in 0..places {
                let at = index * places + place;
                let square = problem.squares[at].map(|value| self.falls[at] * value);
                let common = dot(&square, x);
                let mut by_both = [0.0; 2];
                let rows = &problem.jerks[at * axes..][..axes];
                for (row, pair) in rows.iter().zip(&mut own[place * axes..][..axes]) {
                    let change = dot(row, x);
                    let by = pair.predict([common + change, common - change], &mut most, &mut sums);
                    pull(row, by);
                    by_both = [by_both[0] + (by[0][0] + by[0][1]), by_both[1] + (by[1][0] + by[1][1])];
                }
                pull(&square, by_both.map(|by| [by, 0.0]));
            }
            let rows = &self.accelerations[index * accelerations..][..accelerations];
            for (row, pair) in rows.iter().zip(&mut own[places * axes..][..accelerations]) {
                let change = dot(row, x);
                pull(row, pair.predict([change, -change], &mut most, &mut sums));
            }
            let change = self.bounds[index][0] * x[0];
            let by = own[pairs - 1].predict([change, -change], &mut most, &mut sums);
            pull(&[self.bounds[index][0], 0.0, 0.0], by);
            for (pulls, own) in self.pulls.iter_mut().zip(pulled) {
                for (pulls, own) in pulls[index..index + 3].iter_mut().zip(own) {
                    *pulls += own;
                }
            }
        }
        let [step, price_step] = largest(most).map(|most| 1.0 / most);
        let sums = sums.map(|[a, b]| a + b);
        let reached = sums[0] + step * sums[1] + price_step * (sums[2] + step * sums[3]);
        let ratio = reached * per_row / complementarity;
        (ratio * ratio * ratio).max(LEAST_CENTERING) * complementarity
    }

    /// Goes along the direction as far as slacks, prices and coefficients stay positive; the steps, and the change of the products. Slacks and prices follow when
    /// they are renewed.
    fn advance(&mut self, problem: &Part<'_>, c: &mut [f64], target: f64, part: f64) -> (Steps, f64) {
        let &Part { axes, places, accelerations, .. } = problem;
        let pairs = axes * places + accelerations + 1;
        let mut most = [[0.0_f64; 2]; 2];
        // Sums of the products with one and both of the changes.
        let mut sums = [[0.0; 2]; 3];
        let by = [target, part];
        for (index, own) in self.pairs.chunks_exact_mut(pairs).enumerate() {
            let x = &self.direction[index..index + 3];
            for place in 0..places {
                let at = index * places + place;
                let common = self.falls[at] * dot(&problem.squares[at], x);
                let rows = &problem.jerks[at * axes..][..axes];
                for (row, pair) in rows.iter().zip(&mut own[place * axes..][..axes]) {
                    let change = dot(row, x);
                    pair.correct([common + change, common - change], by, &mut most, &mut sums);
                }
            }
            let rows = &self.accelerations[index * accelerations..][..accelerations];
            for (row, pair) in rows.iter().zip(&mut own[places * axes..][..accelerations]) {
                let change = dot(row, x);
                pair.correct([change, -change], by, &mut most, &mut sums);
            }
            let change = self.bounds[index][0] * x[0];
            own[pairs - 1].correct([change, -change], by, &mut most, &mut sums);
        }
        let [mut most, most_price] = largest(most);
        for (c, x) in c.iter().zip(&self.direction) {
            most = larger(most, -DECREASE * x / c);
        }
        let part = |most: f64| if most > STEP_SHARE { STEP_SHARE / most } else { 1.0 };
        let steps = [part(most), part(most_price)];
        for (c, x) in c.iter_mut().zip(&self.direction) {
            *c += steps[0] * x;
        }
        let [step, price_step] = steps;
        let sums = sums.map(|[a, b]| a + b);
        (steps, step * sums[0] + price_step * (sums[1] + step * sums[2]))
    }
}

/// The coefficients that are given: two at either end.
fn fixed(intervals: usize) -> [usize; 4] {
    [0, 1, intervals, intervals + 1]
}

/// Gap of a plan, and of the first, coarse one.
pub(super) const GAPS: [f64; 2] = [30.0 * SPEED_GAP, SPEED_GAP];
