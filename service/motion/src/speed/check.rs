//! Whether a speed keeps every limit between the knots as well, and which one it is at.

use std::ops::Range;

use feedwave_program::AXIS_COUNT;

use super::course::Governor;
use super::path::{Derivatives, Path};
use super::problem::{Basis, Knots};
use super::ramp::Ramp;
use super::samples::{EXAMINED_PARTS, Samples};
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

/// The same in a state by time, speed, acceleration and jerk along the path: the share of velocity, and the larger one of acceleration and
/// jerk.
pub(super) fn shares_in_time(
    path: &Path<'_>,
    derivatives: &[Derivatives],
    [speed, acceleration, jerk]: [f64; 3],
) -> [f64; 2] {
    let mut largest = [0.0_f64; 2];
    for (axis, [first, bend, twist]) in path.axes.iter().zip(derivatives) {
        let accelerates = bend * speed * speed + first * acceleration;
        let jerks = first * jerk + 3.0 * bend * speed * acceleration + twist * speed * speed * speed;
        largest[0] = largest[0].max((first * speed).abs() / axis.velocity);
        largest[1] = largest[1].max(accelerates.abs() / axis.acceleration).max(jerks.abs() / axis.jerk);
    }
    largest
}

/// Where a quantity that is known at three places with equal distances has a peak near the middle one, in these distances from it, and
/// what it is there, on the parabola through the three.
fn peak(around: &[f64]) -> Option<(f64, f64)> {
    let &[before, own, after] = around else { return None };
    let (slope, bend) = (0.5 * (after - before), before - 2.0 * own + after);
    let is_peak = own >= before && own >= after && bend < 0.0;
    is_peak.then(|| (-slope / bend, own - 0.5 * slope * slope / bend))
}

/// The speed on an interval, and what of the limits is left to it there.
struct Interval<'a> {
    path: &'a Path<'a>,
    /// b, b′ and b″ at its start.
    start: [f64; 3],
    left: f64,
}

impl Interval<'_> {
    /// b, b′ and b″, `x` from its start.
    fn state(&self, x: f64) -> [f64; 3] {
        let [b, slope, second] = self.start;
        [b + x * (slope + 0.5 * x * second), slope + x * second, second]
    }

    /// The largest share of what is left of a limit, `x` from its start.
    fn ratio(&self, derivatives: &[Derivatives], x: f64) -> f64 {
        let [velocity, acceleration, jerk] = shares(self.path, derivatives, self.state(x));
        velocity.max(acceleration.max(jerk) / self.left)
    }

    /// The largest ratio between places in equal parts from `from` on, `part` apart, with these ratios, and the number of the place that is
    /// next to it; where it seems to be above what is permitted and above those. Where the path is slower than it was thought to be when
    /// the places were chosen, they are far apart in time.
    fn largest_between(&self, ratios: &[f64], (from, part): (f64, f64)) -> Option<(f64, usize)> {
        let most = ratios.iter().copied().fold(SPEED_CHECKED_SHARE, f64::max);
        let peaks = ratios.windows(3).enumerate().filter_map(|(before, around)| {
            let (offset, _) = peak(around).filter(|&(_, ratio)| ratio > most)?;
            let x = part * ((before + 1) as f64 + offset);
            let mut derivatives = [[0.0; 3]; AXIS_COUNT];
            self.path.derivatives(from + x, &mut derivatives);
            Some((self.ratio(&derivatives, x), before + 1))
        });
        peaks.max_by(|a, b| a.0.total_cmp(&b.0))
    }
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
        let h = knots.0[index + 1] - knots.0[index];
        let start @ [b, slope, second] = Basis::of(knots, index).state(&c[index..]);
        let own = Interval { path, start, left: left[index] };
        let [first, middle, _] = samples.held(index);
        let mut largest = (0.0_f64, middle);
        let mut ratios = [0.0; EXAMINED_PARTS + 1];
        for place in samples.of(index) {
            let x = h * samples.share(place);
            let [b, ..] = own.state(x);
            let moves = b > 0.0;
            if !moves {
                largest = (f64::INFINITY, place);
                break;
            }
            let ratio = own.ratio(samples.derivatives(place), x);
            if ratio > largest.0 {
                largest = (ratio, place);
            }
            if let Some(known) = ratios.get_mut(place - first) {
                *known = ratio;
            }
        }
        let part = h / EXAMINED_PARTS as f64;
        if let Some((ratio, number)) = own.largest_between(&ratios, (knots.0[index], part))
            && ratio > largest.0
        {
            largest = (ratio, first + number);
        }
        // Between the places b could fall below zero where it bends upwards: the path would turn back.
        let lowest = if second > 0.0 { (-slope / second).max(0.0).min(h) } else { h };
        let [[at_lowest, ..], [at_end, ..]] = [lowest, h].map(|x| own.state(x));
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
