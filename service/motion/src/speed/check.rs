//! Whether a speed keeps every limit between the knots as well, and which one it is at.

use std::ops::Range;

use super::course::Governor;
use super::path::{Derivatives, Path};
use super::problem::{Basis, Knots};
use super::ramp::Ramp;
use super::samples::Samples;
use crate::tolerance::{SPEED_CHECKED_SHARE, SPEED_LIMIT_SHARE};

/// Least part of b at the ends of an interval that it falls to within: 3 % of the speed.
const LEAST_SQUARE: f64 = 1e-3;
/// Places of a ramp that are examined, beside its start.
const PLACES: usize = 8;

/// What the axes do at a place, as shares of their limits: the largest of velocity, acceleration and jerk.
pub(super) fn shares(path: &Path<'_>, derivatives: &[Derivatives], [b, slope, second]: [f64; 3]) -> [f64; 3] {
    let speed = b.sqrt();
    let mut largest = [0.0_f64; 3];
    for (axis, [first, bend, twist]) in path.axes.iter().zip(derivatives) {
        let velocity = first * speed;
        let acceleration = bend * b + 0.5 * first * slope;
        let jerk = speed * (twist * b + 1.5 * bend * slope + 0.5 * first * second);
        largest[0] = largest[0].max(velocity.abs() / axis.velocity);
        largest[1] = largest[1].max(acceleration.abs() / axis.acceleration);
        largest[2] = largest[2].max(jerk.abs() / axis.jerk);
    }
    largest
}

/// The largest share of a limit in each of these intervals, and the place where it is; whether all are within what junctions leave of
/// their limits.
pub(super) fn worst(
    (path, samples): (&Path<'_>, &Samples),
    knots: &Knots,
    c: &[f64],
    (left, worst): (&[f64], &mut [(f64, usize)]),
    range: Range<usize>,
) -> bool {
    let mut keeps = true;
    for index in range {
        let left = left[index];
        let h = knots.0[index + 1] - knots.0[index];
        let [b, slope, second] = Basis::of(knots, index).state(&c[index..]);
        let [_, middle, _] = samples.held(index);
        let mut largest = (0.0_f64, middle);
        for place in samples.of(index) {
            let x = h * samples.share(place);
            let state = [b + x * (slope + 0.5 * x * second), slope + x * second, second];
            let moves = state[0] > 0.0;
            if !moves {
                largest = (f64::INFINITY, place);
                break;
            }
            let [velocity, acceleration, jerk] = shares(path, samples.derivatives(place), state);
            let ratio = velocity.max(acceleration.max(jerk) / left);
            if ratio > largest.0 {
                largest = (ratio, place);
            }
        }
        // Between the places b could fall below zero where it bends upwards: the path would turn back.
        let lowest = if second > 0.0 { (-slope / second).max(0.0).min(h) } else { h };
        let at_lowest = b + lowest * (slope + 0.5 * lowest * second);
        let at_end = b + h * (slope + 0.5 * h * second);
        let stays_positive = at_lowest > LEAST_SQUARE * b.min(at_end);
        if !stays_positive {
            largest = (f64::INFINITY, middle);
        }
        keeps &= largest.0 <= SPEED_CHECKED_SHARE;
        worst[index] = largest;
    }
    keeps
}

/// The largest share of a limit on the ramp at the start or at the end of a path.
pub(super) fn ramp(path: &Path<'_>, end: usize, ramp: Ramp) -> f64 {
    let mut derivatives = vec![[0.0; 3]; path.axes.len()];
    let mut largest = 0.0_f64;
    for place in 0..=PLACES {
        let Ramp { jerk, time_s, .. } = Ramp::new(ramp.jerk, ramp.time_s * place as f64 / PLACES as f64);
        let distance = jerk * time_s * time_s * time_s / 6.0;
        path.derivatives(if end == 0 { distance } else { path.length - distance }, &mut derivatives);
        let (speed, acceleration) = (0.5 * jerk * time_s * time_s, jerk * time_s);
        // Backwards in time the acceleration has the opposite sign.
        let acceleration = if end == 0 { acceleration } else { -acceleration };
        for (axis, [first, bend, twist]) in path.axes.iter().zip(&derivatives) {
            let accelerates = bend * speed * speed + first * acceleration;
            let jerks = first * jerk + 3.0 * bend * speed * acceleration + twist * speed * speed * speed;
            largest = largest.max(accelerates.abs() / axis.acceleration).max(jerks.abs() / axis.jerk);
        }
    }
    largest
}

/// What governs each interval.
pub(super) struct Governors<'a> {
    pub(super) path: &'a Path<'a>,
    pub(super) samples: &'a Samples,
    pub(super) knots: &'a Knots,
    pub(super) c: &'a [f64],
}

/// A speed within this share of the commanded one is at it.
const AT_COMMAND: f64 = 0.999;
/// Share of an acceleration that is most of it.
const MOSTLY: f64 = 0.7;

impl Governors<'_> {
    pub(super) fn of(&self, index: usize) -> Governor {
        let (from, to) = (self.knots.0[index], self.knots.0[index + 1]);
        let x = 0.5 * (to - from);
        let [_, middle, _] = self.samples.held(index);
        let derivatives = self.samples.derivatives(middle);
        let [b, slope, second] = Basis::of(self.knots, index).state(&self.c[index..]);
        let state = [b + x * (slope + 0.5 * x * second), slope + x * second, second];
        let [velocity, acceleration, jerk] = shares(self.path, derivatives, state);
        let fastest = state[0].sqrt() / self.path.command(from, to);
        if fastest >= AT_COMMAND {
            Governor::Feed
        } else if velocity >= SPEED_LIMIT_SHARE * AT_COMMAND && velocity >= acceleration.max(jerk) {
            Governor::Velocity
        } else if acceleration > jerk {
            let axes = self.path.axes.iter().zip(derivatives);
            let turning =
                axes.map(|(axis, [_, bend, _])| (bend * state[0]).abs() / axis.acceleration).fold(0.0, f64::max);
            if turning >= MOSTLY * acceleration { Governor::Turning } else { Governor::Acceleration }
        } else {
            Governor::Jerk
        }
    }
}
