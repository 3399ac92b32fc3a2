//! The least time along a path that a planner has made, found by another method than that of planners.
//!
//! The problem is the one of the crate (b(s) = ṡ², limits of every axis pointwise), but values of b at nodes a millisecond
//! apart are sought, with derivatives by differences of three of them and limits at the nodes only, by a primal barrier
//! method: Newton's steps on t·time − Σ ln(slack), with t rising. The start is the plan at lower speed, which keeps every
//! limit strictly. Next to rest b is at most what constant jerk from rest gives. Limits between the nodes and the
//! acceleration of the first node are free, so that what comes out is rather below the least time than above.

use feedwave_motion::{Element, Machine, PlannedMotion};

/// Time between nodes on the plan that is started from, s.
const NODE_S: f64 = 1e-3;
/// Duality gap at the end, as a share of the time.
const GAP: f64 = 1e-3;
/// Factor of t from one stage to the next.
const STAGE: f64 = 6.0;
/// Most steps of Newton's method in a stage.
const STEPS: usize = 40;

/// A place of the path with what limits the speed there.
struct Node {
    s: f64,
    /// Upper bound of b, and b of the plan.
    cap: f64,
    planned: f64,
    /// By axis of the machine: first three derivatives of the position by s.
    derivatives: Vec<[f64; 3]>,
}

/// One row over three neighbouring values of b, as a share of its limit.
struct Row {
    node: usize,
    a: [f64; 3],
    /// Whether its bound is 1/√b at the node instead of 1.
    is_jerk: bool,
}

struct Section {
    nodes: Vec<Node>,
    rows: Vec<Row>,
    /// Time before the first node and behind the last.
    ends_s: f64,
}

/// Time of the plan and the least time on its path, s, from rest to rest.
pub fn times(motions: &[PlannedMotion], machine: &Machine) -> [f64; 2] {
    let mut total = [0.0; 2];
    let mut samples: Vec<Sample<'_>> = Vec::new();
    let (mut start_s, mut start) = (0.0, 0.0);
    let mut next_s = NODE_S;
    for motion in motions {
        for planned in &motion.stretches {
            let profile = &planned.profile;
            while next_s < start_s + profile.duration() {
                let (s, speed, ..) = profile.state(next_s - start_s);
                samples.push(Sample { s: start + s, speed, element: &motion.element, own_s: planned.start + s });
                next_s += NODE_S;
            }
            start_s += profile.duration();
            start += profile.length();
            let end_speed = profile.state(profile.duration()).1;
            if end_speed < 1e-9 {
                total[0] += start_s;
                total[1] += section(&samples, start, machine).map_or(start_s, |own| own.least_time());
                samples.clear();
                (start_s, start, next_s) = (0.0, 0.0, NODE_S);
            }
        }
    }
    total
}

struct Sample<'a> {
    s: f64,
    speed: f64,
    element: &'a Element,
    own_s: f64,
}

/// The largest b at a distance from rest, and the time from rest, at this jerk along the path.
fn from_rest(distance: f64, jerk: f64) -> (f64, f64) {
    let time_s = (6.0 * distance / jerk).cbrt();
    let speed = 0.5 * jerk * time_s * time_s;
    (speed * speed, time_s)
}

fn section(samples: &[Sample<'_>], length: f64, machine: &Machine) -> Option<Section> {
    if samples.len() < 8 {
        return None;
    }
    let derivatives = |sample: &Sample<'_>| -> Vec<[f64; 3]> {
        let all = sample.element.derivatives(sample.own_s);
        machine.axes.iter().map(|axis| all.map(|values| values[axis.axis.index()])).collect()
    };
    let along = |sample: &Sample<'_>| {
        let axes = machine.axes.iter().zip(derivatives(sample));
        axes.map(|(axis, [first, ..])| axis.max_jerk_per_s3 / first.abs()).fold(f64::MAX, f64::min)
    };
    let [start_jerk, end_jerk] = [along(&samples[0]), along(&samples[samples.len() - 1])];
    let mut nodes: Vec<Node> = Vec::new();
    for sample in samples {
        if nodes.last().is_some_and(|before| sample.s - before.s < 1e-9) {
            continue;
        }
        let derivatives = derivatives(sample);
        let axes = machine.axes.iter().zip(&derivatives);
        let fastest = axes.map(|(axis, [first, ..])| axis.max_velocity_per_s / first.abs()).fold(f64::MAX, f64::min);
        let fastest = fastest.min(1e3);
        let cap =
            (fastest * fastest).min(from_rest(sample.s, start_jerk).0).min(from_rest(length - sample.s, end_jerk).0);
        nodes.push(Node { s: sample.s, cap, planned: sample.speed * sample.speed, derivatives });
    }
    let mut rows = Vec::new();
    for k in 1..nodes.len() - 1 {
        let (before, here, after) = (nodes[k - 1].s, nodes[k].s, nodes[k + 1].s);
        let (h0, h1) = (here - before, after - here);
        let slope = [-h1 / (h0 * (h0 + h1)), (h1 - h0) / (h0 * h1), h0 / (h1 * (h0 + h1))];
        let second = [2.0 / (h0 * (h0 + h1)), -2.0 / (h0 * h1), 2.0 / (h1 * (h0 + h1))];
        let value = [0.0, 1.0, 0.0];
        for (axis, [first, bend, twist]) in machine.axes.iter().zip(&nodes[k].derivatives) {
            if first.abs() + bend.abs() + twist.abs() < 1e-12 {
                continue;
            }
            let acceleration =
                core::array::from_fn(|i| (bend * value[i] + 0.5 * first * slope[i]) / axis.max_acceleration_per_s2);
            let jerk = core::array::from_fn(|i| {
                (twist * value[i] + 1.5 * bend * slope[i] + 0.5 * first * second[i]) / axis.max_jerk_per_s3
            });
            rows.push(Row { node: k, a: acceleration, is_jerk: false });
            rows.push(Row { node: k, a: jerk, is_jerk: true });
        }
    }
    let (first, last) = (nodes[0].s, length - nodes[nodes.len() - 1].s);
    Some(Section { nodes, rows, ends_s: from_rest(first, start_jerk).1 + from_rest(last, end_jerk).1 })
}

impl Section {
    fn time_s(&self, b: &[f64]) -> f64 {
        let pairs = self.nodes.windows(2).zip(b.windows(2));
        pairs.map(|(nodes, b)| 2.0 * (nodes[1].s - nodes[0].s) / (b[0].sqrt() + b[1].sqrt())).sum()
    }

    /// −Σ ln(slack); `None` outside of the limits.
    fn barrier(&self, b: &[f64]) -> Option<f64> {
        let mut total = 0.0;
        let mut add = |slack: f64| {
            total -= slack.ln();
            slack > 0.0
        };
        let keeps = b.iter().zip(&self.nodes).all(|(&b, node)| b > 0.0 && add(1.0 - b / node.cap));
        let keeps = keeps
            && self.rows.iter().all(|row| {
                let value: f64 = (0..3).map(|i| row.a[i] * b[row.node - 1 + i]).sum();
                let bound = row.bound(b);
                // Relative to the bound, so that rows of both kinds weigh the same.
                add((bound - value) / bound) && add((bound + value) / bound)
            });
        keeps.then_some(total)
    }

    fn least_time(&self) -> f64 {
        let scales = (1..30).map(|k| 0.93_f64.powi(k));
        let start = scales
            .map(|scale| self.nodes.iter().map(|node| scale * node.planned).collect::<Vec<_>>())
            .find(|b| self.barrier(b).is_some());
        let Some(mut b) = start else { panic!("the plan keeps its limits") };
        let sides = (2 * self.rows.len() + self.nodes.len()) as f64;
        let mut t = sides / (0.3 * self.time_s(&b));
        let last = sides / (GAP * self.time_s(&b));
        loop {
            self.minimise(&mut b, t);
            if t >= last {
                break;
            }
            t = (t * STAGE).min(last);
        }
        self.time_s(&b) + self.ends_s
    }

    /// Newton's method with the parts of the second derivative that are never negative.
    fn minimise(&self, b: &mut Vec<f64>, t: f64) {
        let count = b.len();
        let mut value = t * self.time_s(b) + self.barrier(b).expect("inside");
        for _ in 0..STEPS {
            let mut matrix = vec![[0.0; 3]; count];
            let mut gradient = vec![0.0; count];
            self.add_time(b, t, &mut matrix, &mut gradient);
            for (k, node) in self.nodes.iter().enumerate() {
                let force = 1.0 / (node.cap - b[k]);
                gradient[k] += force;
                matrix[k][0] += force * force;
            }
            for row in &self.rows {
                row.add(b, &mut matrix, &mut gradient);
            }
            let mut step: Vec<f64> = gradient.iter().map(|value| -value).collect();
            solve(&mut matrix, &mut step);
            let decrease: f64 = -gradient.iter().zip(&step).map(|(g, x)| g * x).sum::<f64>();
            if decrease < 1e-3 * (1.0 + 1e-6 * value.abs()) {
                return;
            }
            let mut share = 1.0;
            let moved = loop {
                let next: Vec<f64> = b.iter().zip(&step).map(|(b, x)| b + share * x).collect();
                let at = self.barrier(&next).map(|barrier| t * self.time_s(&next) + barrier);
                if let Some(at) = at.filter(|&at| at <= value - 0.1 * share * decrease) {
                    break Some((next, at));
                }
                share *= 0.6;
                if share < 1e-8 {
                    break None;
                }
            };
            let Some((next, at)) = moved else { return };
            (*b, value) = (next, at);
        }
    }

    fn add_time(&self, b: &[f64], t: f64, matrix: &mut [[f64; 3]], gradient: &mut [f64]) {
        for (k, nodes) in self.nodes.windows(2).enumerate() {
            let length = nodes[1].s - nodes[0].s;
            let speeds = [b[k].sqrt(), b[k + 1].sqrt()];
            let sum = speeds[0] + speeds[1];
            for (i, speed) in speeds.into_iter().enumerate() {
                gradient[k + i] -= t * length / (sum * sum * speed);
                matrix[k + i][0] +=
                    t * length * (1.0 / (sum * speed * speed) + 0.5 / (speed * speed * speed)) / (sum * sum);
            }
            matrix[k + 1][1] += t * length / (sum * sum * sum * speeds[0] * speeds[1]);
        }
    }
}

impl Row {
    fn bound(&self, b: &[f64]) -> f64 {
        if self.is_jerk { 1.0 / b[self.node].sqrt() } else { 1.0 }
    }

    /// Adds its two sides; both slacks are divided by the bound φ: ln(φ ∓ a·b) − ln φ.
    fn add(&self, b: &[f64], matrix: &mut [[f64; 3]], gradient: &mut [f64]) {
        let first = self.node - 1;
        let value: f64 = (0..3).map(|i| self.a[i] * b[first + i]).sum();
        let bound = self.bound(b);
        let fall = if self.is_jerk { 0.5 * bound / b[self.node] } else { 0.0 };
        for sign in [1.0, -1.0] {
            let slack = bound - sign * value;
            let mut outwards = self.a.map(|a| sign * a);
            outwards[1] += fall;
            for i in 0..3 {
                gradient[first + i] += outwards[i] / slack;
                for j in 0..=i {
                    matrix[first + i][i - j] += outwards[i] * outwards[j] / (slack * slack);
                }
            }
            gradient[self.node] -= fall / bound;
            matrix[self.node][0] += 2.0 * (fall / bound) * (fall / bound);
        }
    }
}

/// Solves the symmetric system with two bands beside the diagonal: `matrix[i][k]` is the entry of row i and column i − k.
fn solve(matrix: &mut [[f64; 3]], x: &mut [f64]) {
    for i in 0..matrix.len() {
        for k in (0..=i.min(2)).rev() {
            let j = i - k;
            let mut sum = matrix[i][k];
            for m in i.saturating_sub(2)..j {
                sum -= matrix[i][i - m] * matrix[j][j - m];
            }
            matrix[i][k] = if k == 0 { sum.max(1e-300).sqrt() } else { sum / matrix[j][0] };
        }
        for k in 1..=i.min(2) {
            x[i] -= matrix[i][k] * x[i - k];
        }
        x[i] /= matrix[i][0];
    }
    for i in (0..matrix.len()).rev() {
        for k in 1..=2 {
            if let Some(row) = matrix.get(i + k) {
                x[i] -= row[k] * x[i + k];
            }
        }
        x[i] /= matrix[i][0];
    }
}
