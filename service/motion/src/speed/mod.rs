//! Speed along a path close to the least time, with velocity, acceleration and jerk of every axis limited place by place.
//!
//! The path is given between two places at which its speed and acceleration are known. Between them b(s) = ṡ² is
//! sought as a quadratic B-spline ([`problem`]) by an interior point method ([`solver`]), twice: on knots four milliseconds
//! apart, which gives the knots of the second time. Then every limit is examined between the knots as well ([`check`]); where
//! one is exceeded, it is lowered there and the window is solved again. What comes out is a [`Course`], or nothing: the caller
//! then keeps the plan that it has.
//!
//! From rest b grows with s^(4/3), which is no spline: the path leaves rest, and comes to it, in a short ramp of constant jerk.

use std::ops::Range;

mod banded;
mod check;
mod course;
mod path;
mod problem;
mod solver;
#[cfg(test)]
mod tests;

pub(crate) use course::Segment;
pub use course::{Course, Governor};
pub(crate) use path::{AxisLimits, Path, Span};

use crate::tolerance::{
    RESERVED_S, SPEED_AROUND, SPEED_CHECKED_SHARE, SPEED_GRADE, SPEED_INTERVALS, SPEED_LIMIT_SHARE,
    SPEED_RAMP_INTERVALS, SPEED_RAMP_SHARE, SPEED_SIDE, SPEED_STEPS, SPEED_TIGHTENINGS,
};
use problem::{Knots, Problem};
use solver::{GAPS, Solver, Start};

/// One end of a window.
#[derive(Clone, Copy, Debug)]
pub(crate) struct End {
    pub(crate) speed: f64,
    /// Along the path, mm/s²; zero at rest.
    pub(crate) acceleration: f64,
    /// Share of acceleration and jerk that is left to a junction at it, and as far as it is left, mm.
    pub(crate) reserve: f64,
    pub(crate) reserved_mm: f64,
}

impl End {
    /// An end at which a junction takes a share of acceleration and jerk, on a machine whose largest jerk is this.
    pub(crate) fn reserving(speed: f64, acceleration: f64, reserve: f64, largest_jerk: f64) -> Self {
        // As far as the path comes at the most in the time that differences of setpoints average over.
        let gained = 0.5 * acceleration.abs() * RESERVED_S + largest_jerk * RESERVED_S * RESERVED_S;
        Self { speed, acceleration, reserve, reserved_mm: RESERVED_S * (speed + gained) }
    }
}

/// One of several windows along a path.
#[derive(Clone, Copy, Default)]
pub(crate) struct Window<'a> {
    /// Knots that the window before has at the start of this one, behind its start, and speeds there: what it found can go on.
    pub(crate) knots: &'a [(f64, f64)],
    /// Whether the guess keeps all limits: to be much slower than that somewhere leads astray.
    pub(crate) is_possible: bool,
    /// Whether another window takes over from it; it then leaves a little more of the limits towards its end, so that there is
    /// room for what the next one finds.
    pub(crate) goes_on: bool,
}

/// What is known of a window before: a plan of it, by time.
pub(crate) trait Guess {
    /// Time that it takes, s.
    fn duration_s(&self) -> f64;
    /// Place and speed at a time.
    fn at(&self, t_s: f64) -> (f64, f64);
}

impl Guess for Course {
    fn duration_s(&self) -> f64 {
        self.duration()
    }

    fn at(&self, t_s: f64) -> (f64, f64) {
        let (s, speed, ..) = self.state(t_s);
        (s, speed)
    }
}

/// Plans windows; keeps its memory between them, which is no state.
#[derive(Default)]
pub(crate) struct SpeedPlanner {
    problem: Problem,
    solver: Solver,
    c: Vec<f64>,
    /// Coefficients to go back to.
    before: Vec<f64>,
    /// By interval: part of the limits that may be used, and the place between its ends at which they are held.
    shares: Vec<f64>,
    lowered: Vec<f64>,
    middles: Vec<f64>,
    /// By interval: part of the limits that junctions leave.
    left: Vec<f64>,
    /// By interval: the largest share of a limit that is taken, and where.
    worst: Vec<(f64, f64)>,
}

impl Clone for SpeedPlanner {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// A ramp of constant jerk from or to rest; nothing at an end that moves.
#[derive(Clone, Copy, Default)]
struct Ramp {
    jerk: f64,
    time_s: f64,
    length: f64,
}

impl Ramp {
    fn new(jerk: f64, time_s: f64) -> Self {
        Self { jerk, time_s, length: jerk * time_s * time_s * time_s / 6.0 }
    }

    /// b and |b′| where the ramp meets the spline.
    fn state(&self) -> (f64, f64) {
        let speed = 0.5 * self.jerk * self.time_s * self.time_s;
        (speed * speed, 2.0 * self.jerk * self.time_s)
    }
}

impl core::fmt::Debug for SpeedPlanner {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.debug_struct("SpeedPlanner").finish_non_exhaustive()
    }
}

/// Largest acceleration and jerk along the path at a place.
fn along(path: &Path<'_>, s: f64) -> (f64, f64) {
    let mut derivatives = vec![[0.0; 3]; path.axes.len()];
    path.derivatives(s, &mut derivatives);
    let smallest = |limit: fn(&path::MovedAxis) -> f64| {
        path.axes.iter().zip(&derivatives).map(|(axis, [first, ..])| limit(axis) / first.abs()).fold(f64::MAX, f64::min)
    };
    (smallest(|axis| axis.acceleration), smallest(|axis| axis.jerk))
}

impl SpeedPlanner {
    /// The course along a path from one end to the other, from a plan that there is; `None` where none was found that keeps
    /// every limit.
    pub(crate) fn plan(&mut self, path: &Path<'_>, ends: [End; 2], guess: &dyn Guess) -> Option<Course> {
        self.plan_window(path, ends, guess, Window::default())
    }

    /// [`SpeedPlanner::plan`] of one of several windows.
    pub(crate) fn plan_window(
        &mut self,
        path: &Path<'_>,
        ends: [End; 2],
        guess: &dyn Guess,
        window: Window<'_>,
    ) -> Option<Course> {
        let has_length = path.length > 0.0;
        if path.axes.is_empty() || !has_length {
            return None;
        }
        let places = [0.0, path.length];
        let limits = places.map(|s| along(path, s));
        let change_s = limits.map(|(acceleration, jerk)| acceleration / jerk);
        let [shortest_s, longest_s] = SPEED_INTERVALS;
        let interval_s = (0.25 * change_s[0].min(change_s[1])).clamp(shortest_s, longest_s);
        let ramps: [Ramp; 2] = core::array::from_fn(|k| {
            let End { speed, reserve, .. } = ends[k];
            if speed > 0.0 {
                return Ramp::default();
            }
            let jerk = SPEED_LIMIT_SHARE * SPEED_LIMIT_SHARE * (1.0 - reserve) * limits[k].1;
            let shortest_s = libm::cbrt(6.0 * SPEED_RAMP_SHARE * path.length / jerk);
            let time_s = (SPEED_RAMP_INTERVALS * interval_s).min(0.25 * change_s[k]).min(shortest_s);
            let mut ramp = Ramp::new(jerk, time_s);
            // Where the path bends, it has to be shorter.
            for _ in 0..RAMP_TRIES {
                let ratio = check::ramp(path, k, ramp) / (1.0 - reserve);
                if ratio <= SPEED_CHECKED_SHARE {
                    break;
                }
                ramp = Ramp::new(ramp.jerk * (0.99 / ratio).max(0.7), 0.7 * ramp.time_s);
            }
            ramp
        });
        let ramps_keep =
            (0..2).all(|k| check::ramp(path, k, ramps[k]) <= SPEED_CHECKED_SHARE * (1.0 - ends[k].reserve));
        if !ramps_keep {
            return None;
        }
        let settled_s: [f64; 2] =
            core::array::from_fn(|k| ramps[k].time_s + (2.0 * ends[k].speed / limits[k].1).sqrt());
        let coarse = self.solve(path, ends, ramps, settled_s, 2.0 * interval_s, guess, window, 0.7, GAPS[0]);
        let fine = coarse
            .and_then(|coarse| self.solve(path, ends, ramps, settled_s, interval_s, &coarse, window, 0.7, GAPS[1]));
        // From somewhere else the steps may lead where they did not.
        fine.or_else(|| self.solve(path, ends, ramps, settled_s, interval_s, guess, window, 0.4, GAPS[1]))
    }

    /// The course on knots at equal times of a guess, which is scaled to start with.
    #[allow(clippy::too_many_arguments, reason = "one window, with what its two stages have in common")]
    fn solve(
        &mut self,
        path: &Path<'_>,
        ends: [End; 2],
        ramps: [Ramp; 2],
        settled_s: [f64; 2],
        interval_s: f64,
        guess: &dyn Guess,
        window: Window<'_>,
        scale: f64,
        gap: f64,
    ) -> Option<Course> {
        let (knots, squares) = place_knots(path, ramps, settled_s, interval_s, guess, window.knots)?;
        let intervals = knots.intervals();
        self.place_middles(path, &knots, gap <= GAPS[1]);
        self.left.clear();
        for index in 0..intervals {
            let (from, to) = (knots.0[index], knots.0[index + 1]);
            let at_start = if from < ends[0].reserved_mm { ends[0].reserve } else { 0.0 };
            let at_end = if path.length - to < ends[1].reserved_mm { ends[1].reserve } else { 0.0 };
            self.left.push(1.0 - at_start.max(at_end));
        }
        // Knots are nearly equal in time.
        let around = (RESERVED_S / interval_s).ceil() as usize;
        for &(place, reserve) in path.joints {
            let index = knots.0.partition_point(|&knot| knot <= place);
            for left in &mut self.left[index.saturating_sub(around + 1).min(intervals)..(index + around).min(intervals)]
            {
                *left = left.min(1.0 - reserve);
            }
        }
        self.shares.clone_from(&self.left);
        if window.goes_on {
            for (index, share) in self.shares.iter_mut().enumerate() {
                *share *= 1.0 - SPEED_GRADE * index as f64 / intervals as f64;
            }
        }
        let floor = if window.is_possible { LEAST_OF_GUESS } else { 0.0 };
        let floors = &mut self.problem.floors;
        floors.clear();
        floors.push(0.0);
        floors.extend(squares.windows(2).map(|pair| floor * pair[0].min(pair[1])));
        floors.push(0.0);
        self.c.clear();
        self.c.push(0.0);
        self.c.extend(squares.windows(2).map(|pair| (scale * 0.5 * (pair[0] + pair[1])).max(f64::MIN_POSITIVE)));
        self.c.push(0.0);
        // Out of a dip that is too narrow to brake for it the steps would hardly find.
        for index in 2..=intervals {
            self.c[index] = self.c[index].max(MOST_FALL * self.c[index - 1]);
        }
        for index in (1..intervals).rev() {
            self.c[index] = self.c[index].max(MOST_FALL * self.c[index + 1]);
        }
        let given = |k: usize| {
            let End { speed, acceleration, .. } = ends[k];
            let (b, slope) = ramps[k].state();
            let sign = if k == 0 { 1.0 } else { -1.0 };
            if speed > 0.0 { (speed * speed, 2.0 * acceleration) } else { (b, sign * slope) }
        };
        for (k, knot) in [(0, 0), (1, intervals)] {
            let (b, slope) = given(k);
            let [first, second] = knots.coefficients(knot, b, slope);
            (self.c[knot], self.c[knot + 1]) = (first, second);
        }
        self.problem.build(path, knots, &self.shares, &self.middles);
        if !self.solver.solve(&self.problem, &mut self.c, 0..intervals, (SPEED_STEPS, gap), Start::FAR) {
            return None;
        }
        // A first plan gives knots only.
        let is_last = gap <= GAPS[1];
        let keeps = !is_last || self.keep_limits(path);
        if keeps && is_last {
            self.reach_caps(path);
        }
        keeps.then(|| self.course(path, ramps, ends)).flatten()
    }

    /// Lowers limits where they are exceeded, and solves again around these places, until all are kept.
    fn keep_limits(&mut self, path: &Path<'_>) -> bool {
        let intervals = self.problem.knots.intervals();
        self.worst.clear();
        self.worst.resize(intervals, (0.0, 0.5));
        let all = || core::iter::once(0..intervals).collect::<Vec<_>>();
        let mut changed = all();
        for round in 0..=SPEED_TIGHTENINGS {
            let mut keeps = true;
            for range in &changed {
                let found = (&self.left[..], &mut self.worst[..]);
                keeps &= check::worst(path, &self.problem.knots, &self.c, found, range.clone());
            }
            if keeps {
                return true;
            }
            if round == SPEED_TIGHTENINGS {
                break;
            }
            changed = self.tighten(path);
            self.before.clone_from(&self.c);
            let is_solved = changed.iter().all(|range| {
                self.solver.solve(&self.problem, &mut self.c, range.clone(), (SPEED_STEPS, GAPS[1]), Start::NEAR)
            });
            if !is_solved {
                let is_all = changed.len() == 1 && changed[0].len() == intervals;
                // With its ends as they are, a part of it has no way: the path is at its limits there.
                changed = all();
                self.c.clone_from(&self.before);
                let options = (SPEED_STEPS, GAPS[1]);
                if is_all || !self.solver.solve(&self.problem, &mut self.c, 0..intervals, options, Start::FAR) {
                    return false;
                }
            }
        }
        false
    }

    /// The places inside of intervals at which limits are held: where the path bends fastest, as far as that matters; steps of the
    /// third derivative inside would otherwise be found to exceed the jerk only afterwards.
    fn place_middles(&mut self, path: &Path<'_>, knots: &Knots, is_last: bool) {
        let intervals = knots.intervals();
        self.middles.clear();
        self.middles.resize(intervals, 0.5);
        if !is_last {
            return;
        }
        let mut derivatives = vec![[0.0; 3]; path.axes.len()];
        for (index, middle) in self.middles.iter_mut().enumerate() {
            let (from, to) = (knots.0[index], knots.0[index + 1]);
            let h = to - from;
            let mut twist_at = |share: f64| {
                path.derivatives(from + h * share, &mut derivatives);
                let shares = path.axes.iter().zip(&derivatives).map(|(axis, [.., twist])| twist.abs() / axis.jerk);
                shares.fold(0.0, f64::max)
            };
            let mut largest = twist_at(0.5) * CLEARLY_FASTER;
            let inner = MIDDLES.into_iter().chain(path.middles_between(from, to).map(|s| (s - from) / h));
            for share in inner {
                let twist = twist_at(share);
                if twist > largest {
                    (largest, *middle) = (twist, share);
                }
            }
        }
    }

    /// Raises coefficients that are nearly at their caps to them, where all limits are kept then: the method stays a little inside
    /// of every limit, and a commanded speed is one that the path has to have.
    fn reach_caps(&mut self, path: &Path<'_>) {
        let intervals = self.problem.knots.intervals();
        self.before.clone_from(&self.c);
        let mut changed: Option<Range<usize>> = None;
        // Those at either end are given.
        for index in 2..intervals {
            let per_cap = self.problem.per_caps[index];
            let share = self.c[index] * per_cap;
            let above = (share - NEAR_CAP[0]) / (NEAR_CAP[1] - NEAR_CAP[0]);
            if per_cap <= 0.0 || above <= 0.0 || share >= 1.0 {
                continue;
            }
            let above = above.min(1.0);
            let part = above * above * (3.0 - 2.0 * above);
            let cap = 1.0 / per_cap;
            self.c[index] = if part < 1.0 { self.c[index] + part * (cap - self.c[index]) } else { cap };
            // A coefficient acts on three intervals, up to the one of its number.
            let acts = index - 2..(index + 1).min(intervals);
            changed = Some(changed.map_or(acts.clone(), |changed| changed.start..acts.end));
        }
        let Some(changed) = changed else { return };
        let found = (&self.left[..], &mut self.worst[..]);
        if !check::worst(path, &self.problem.knots, &self.c, found, changed) {
            self.c.clone_from(&self.before);
        }
    }

    /// Lowers the limits where they are exceeded, and holds them there; the intervals to be solved again.
    fn tighten(&mut self, path: &Path<'_>) -> Vec<Range<usize>> {
        let intervals = self.worst.len();
        let mut changed: Vec<Range<usize>> = Vec::new();
        self.lowered.clone_from(&self.shares);
        for (index, &(ratio, place)) in self.worst.iter().enumerate() {
            if ratio > SPEED_CHECKED_SHARE {
                if (SPEED_SIDE..=1.0 - SPEED_SIDE).contains(&place) {
                    self.middles[index] = place;
                }
                let share = self.shares[index] * TIGHTENING / ratio;
                for own in &mut self.lowered[index.saturating_sub(1)..(index + 2).min(intervals)] {
                    *own = own.min(share);
                }
                let around = index.saturating_sub(SPEED_AROUND)..(index + 1 + SPEED_AROUND).min(intervals);
                match changed.last_mut().filter(|last| last.end + LEAST_INTERVALS >= around.start) {
                    Some(last) => last.end = around.end,
                    None => changed.push(around),
                }
            }
        }
        core::mem::swap(&mut self.shares, &mut self.lowered);
        for range in &mut changed {
            // Near an end, up to it.
            if range.start < LEAST_INTERVALS {
                range.start = 0;
            }
            if range.end + LEAST_INTERVALS > intervals {
                range.end = intervals;
            }
            for index in range.clone() {
                if self.shares[index] != self.lowered[index] || self.worst[index].0 > SPEED_CHECKED_SHARE {
                    self.problem.set_interval(path, index, self.shares[index], self.middles[index]);
                }
            }
        }
        let some: usize = changed.iter().map(Range::len).sum();
        if some as f64 > MOST_AGAIN * intervals as f64 { core::iter::once(0..intervals).collect() } else { changed }
    }

    /// The course of the present coefficients.
    fn course(&self, path: &Path<'_>, ramps: [Ramp; 2], ends: [End; 2]) -> Option<Course> {
        let knots = &self.problem.knots;
        let intervals = knots.intervals();
        let mut segments = Vec::with_capacity(intervals + 2);
        let (mut s, mut time_s) = (0.0, 0.0);
        let [rise, fall] = ramps;
        let ramp = |start_s, s, speed, acceleration, jerk| Segment {
            start_s,
            s,
            speed,
            acceleration,
            jerk,
            rate: 0.0,
            governor: Governor::Jerk,
        };
        if rise.time_s > 0.0 {
            segments.push(ramp(0.0, 0.0, 0.0, 0.0, rise.jerk));
            (s, time_s) = (rise.length, rise.time_s);
        }
        let mut governors = check::Governors::new(path, knots, &self.c);
        for index in 0..intervals {
            let length = knots.0[index + 1] - knots.0[index];
            let ((b, slope), (next, next_slope)) = (knots.state(index, &self.c), knots.state(index + 1, &self.c));
            let moves = b > 0.0 && next > 0.0;
            if !moves {
                return None;
            }
            // The given speed to the last bit.
            let is_start = index == 0 && ends[0].speed > 0.0;
            let segment = Segment {
                start_s: time_s,
                s,
                speed: if is_start { ends[0].speed } else { b.sqrt() },
                acceleration: 0.5 * slope,
                jerk: 0.0,
                rate: 0.5 * (next_slope - slope) / length,
                governor: governors.of(index),
            };
            time_s = push_parts(&mut segments, segment, length, 0)?;
            s += length;
        }
        if fall.time_s > 0.0 {
            let speed = 0.5 * fall.jerk * fall.time_s * fall.time_s;
            segments.push(ramp(time_s, path.length - fall.length, speed, -fall.jerk * fall.time_s, fall.jerk));
            time_s += fall.time_s;
        }
        time_s.is_finite().then(|| {
            Course::new(segments, path.length, time_s, ends[1].speed, {
                let inside = path.joints.iter().map(|&(_, reserve)| reserve).fold(0.0, f64::max);
                [ends[0].reserve, ends[1].reserve, inside]
            })
        })
    }
}

/// Adds a segment of this length in parts that are short enough for its series; when it ends. `None` where it rests within.
fn push_parts(segments: &mut Vec<Segment>, segment: Segment, length: f64, depth: u32) -> Option<f64> {
    let end_speed = segment.from(length, 0.0).speed;
    let longest_s = 4.0 * length / (segment.speed + end_speed);
    if segment.rate.abs() * longest_s * longest_s > 16.0 * LARGEST_SERIES {
        if depth >= MOST_PARTS {
            return None;
        }
        let half = 0.5 * length;
        let start_s = push_parts(segments, segment, half, depth + 1)?;
        let rest = Segment { start_s, s: segment.s + half, ..segment.from(half, 0.0) };
        return push_parts(segments, rest, length - half, depth + 1);
    }
    segments.push(segment);
    let time_s = segment.time_to(length, longest_s);
    // Where b falls to zero within, the end is never reached.
    let arrives = (segment.after(time_s).0 - length).abs() <= ARRIVAL * length;
    arrives.then_some(segment.start_s + time_s)
}

/// Largest relative error of the way of a segment at its end.
const ARRIVAL: f64 = 1e-9;

/// How often a ramp is shortened.
const RAMP_TRIES: u32 = 16;
/// Largest |ω|·t² of a segment: what the series leave out is then below rounding.
const LARGEST_SERIES: f64 = 0.25;
/// Most times that an interval is halved.
const MOST_PARTS: u32 = 12;
/// Part of the squared speed of a possible plan that a faster one does not fall below.
const LEAST_OF_GUESS: f64 = 0.3;
/// Part of a coefficient that the next one is at the least, to start with.
const MOST_FALL: f64 = 0.5;
/// Part of a window above which it is solved again as a whole.
const MOST_AGAIN: f64 = 0.7;
/// Shares of its cap from which on a coefficient is raised towards it, and at which it is there.
const NEAR_CAP: [f64; 2] = [0.997, 0.9994];
/// Places of an interval that may be held instead of its middle, and how much faster the path has to bend there.
const MIDDLES: [f64; 6] = [0.375, 0.625, 0.25, 0.75, 0.125, 0.875];
const CLEARLY_FASTER: f64 = 1.001;
/// How much further a limit is lowered than it was exceeded.
const TIGHTENING: f64 = 0.98;

/// Knots at nearly equal times of the guess, closer where the speed has changed for a short time only, and the squares of the
/// guess' speeds there.
fn place_knots(
    path: &Path<'_>,
    ramps: [Ramp; 2],
    settled_s: [f64; 2],
    interval_s: f64,
    guess: &dyn Guess,
    given: &[(f64, f64)],
) -> Option<(Knots, Vec<f64>)> {
    let duration_s = guess.duration_s();
    let step_at = |t: f64| {
        let from_start = t - ramps[0].time_s + settled_s[0];
        let from_end = duration_s - t - ramps[1].time_s + settled_s[1];
        let ends = if settled_s[0] > 0.0 { from_start } else { f64::MAX };
        let step = interval_s.min(0.125 * ends);
        if settled_s[1] > 0.0 { step.min(0.111 * from_end) } else { step }
    };
    let [first, last] = [ramps[0].length, path.length - ramps[1].length];
    let has_middle = last > first;
    if !has_middle {
        return None;
    }
    let (mut places, mut squares) = (vec![first], vec![0.0]);
    let end_s = duration_s - ramps[1].time_s;
    let mut t = ramps[0].time_s;
    let start_speed = guess.at(t).1;
    squares[0] = start_speed * start_speed;
    if let Some(&(given_to, _)) = given.last() {
        places.extend(given.iter().map(|&(place, _)| place));
        squares.extend(given.iter().map(|&(_, speed)| speed * speed));
        t = time_at(guess, given_to);
    }
    let least_s = interval_s * LEAST_INTERVAL;
    loop {
        t += step_at(t).max(least_s);
        let is_inside = t < end_s - 0.5 * step_at(end_s).max(least_s);
        if !is_inside || places.len() > MOST_INTERVALS {
            break;
        }
        let (s, speed) = guess.at(t);
        let least = 0.25 * (speed * step_at(t).max(least_s));
        let before = places[places.len() - 1];
        if s - before > least && last - s > least {
            places.push(s);
            squares.push(speed * speed);
        }
    }
    let end_speed = guess.at(end_s).1;
    places.push(last);
    squares.push(end_speed * end_speed);
    (LEAST_INTERVALS..=MOST_INTERVALS).contains(&(places.len() - 1)).then_some((Knots(places), squares))
}

/// When a guess passes a place, s.
fn time_at(guess: &dyn Guess, place: f64) -> f64 {
    let (mut low, mut high) = (0.0, guess.duration_s());
    for _ in 0..PLACE_STEPS {
        let middle = 0.5 * (low + high);
        if guess.at(middle).0 < place {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Halvings of a time: to a nanosecond of seconds.
const PLACE_STEPS: u32 = 32;
/// Shortest interval, as a share of an ordinary one.
const LEAST_INTERVAL: f64 = 1.0 / 64.0;
/// Fewest intervals: with fewer nothing is free to be chosen.
const LEAST_INTERVALS: usize = 6;
/// Most intervals of a window; bounds its memory.
const MOST_INTERVALS: usize = 1 << 13;
