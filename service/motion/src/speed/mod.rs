//! Speed along a path close to the least time, with velocity, acceleration and jerk of every axis limited place by place.
//!
//! The path is given between two places at which its speed and acceleration are known. Between them b(s) = ṡ² is
//! sought as a quadratic B-spline ([`problem`]) by an interior point method ([`solver`]), twice: on knots far apart,
//! which gives the knots of the second time ([`grid`]), or at once on close ones where the path passes narrow bends.
//! Then every limit is examined between the knots as well ([`check`]); where one is exceeded, it is lowered there and the
//! window is solved again around it ([`keeping`]). What comes out is a [`Course`] ([`segments`]), or nothing: the caller
//! then keeps the plan that it has.
//!
//! From rest b grows with s^(4/3), which is no spline: the path leaves rest, and comes to it, in a short ramp of constant jerk
//! ([`ramp`]).

mod banded;
mod check;
mod course;
mod grid;
mod keeping;
mod pair;
mod path;
mod problem;
mod ramp;
mod samples;
mod segments;
mod solver;
#[cfg(test)]
mod tests;
mod trial;

pub use course::{Course, Governor};
pub(crate) use path::{AxisLimits, Path, Span};
pub(crate) use trial::keeps_limits;

use crate::tolerance::{RESERVED_S, SPEED_GRADE, SPEED_INTERVALS, SPEED_LIMIT_SHARE, SPEED_STEPS};
use problem::{Hold, Knots, Problem};
use ramp::{AlongPath, Ramp};
use samples::{EXAMINED_PARTS, HELD_PARTS, Samples};
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

/// What all stages of solving a window have in common.
struct Task<'a> {
    path: &'a Path<'a>,
    ends: [End; 2],
    ramps: [Ramp; 2],
    /// Time for which the speed can have changed at either end, s: knots are closer there.
    settled_s: [f64; 2],
    window: Window<'a>,
}

impl Task<'_> {
    /// b and b′ at the start (0) or the end (1) of the spline.
    fn given(&self, k: usize) -> (f64, f64) {
        let End { speed, acceleration, .. } = self.ends[k];
        let (b, slope) = self.ramps[k].state();
        let sign = if k == 0 { 1.0 } else { -1.0 };
        if speed > 0.0 { (speed * speed, 2.0 * acceleration) } else { (b, sign * slope) }
    }
}

/// One stage: on knots this time of the guess apart, from its squared speeds by this factor, down to a duality gap.
#[derive(Clone, Copy)]
struct Stage<'a> {
    guess: &'a dyn Guess,
    /// Whether that is what the window is planned from, and not an earlier stage.
    is_known: bool,
    interval_s: f64,
    scale: f64,
    gap: f64,
}

/// Plans windows; keeps its memory between them, which is no state.
#[derive(Default)]
pub(crate) struct SpeedPlanner {
    problem: Problem,
    solver: Solver,
    c: Vec<f64>,
    /// Places, and squared speeds there, of the guess that windows are planned from.
    known: Vec<(f64, f64)>,
    /// Coefficients to go back to.
    before: Vec<f64>,
    /// By interval.
    holds: Vec<Hold>,
    samples: Samples,
    /// By interval: part of the limits that junctions leave.
    left: Vec<f64>,
    /// By interval: the largest share of a limit that is taken, and where.
    worst: Vec<(f64, usize)>,
}

impl Clone for SpeedPlanner {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl core::fmt::Debug for SpeedPlanner {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.debug_struct("SpeedPlanner").finish_non_exhaustive()
    }
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
        let limits = [0.0, path.length].map(|s| AlongPath::at(path, s));
        let [shortest_s, longest_s] = SPEED_INTERVALS;
        let quarter_s = 0.25 * limits[0].change_s().min(limits[1].change_s());
        let interval_s = quarter_s.clamp(shortest_s, longest_s);
        let ramp = |k: usize| Ramp::at_end(path, k, ends[k], limits[k], interval_s);
        let ramps = [ramp(0)?, ramp(1)?];
        let settled_s = core::array::from_fn(|k| ramps[k].time_s + (2.0 * ends[k].speed / limits[k].jerk).sqrt());
        let task = Task { path, ends, ramps, settled_s, window };
        let stage = Stage { guess, is_known: true, interval_s, scale: FOUND_SCALE, gap: GAPS[1] };
        let coarse_s = FIRST_INTERVALS * interval_s;
        let coarse = self.solve(&task, Stage { interval_s: coarse_s, scale: GUESS_SCALE, gap: GAPS[0], ..stage });
        let fine = match &coarse {
            Some(coarse) => Stage { guess: coarse, is_known: false, ..stage },
            None => Stage { interval_s: DIP_INTERVALS * interval_s, ..stage },
        };
        let Some(found) = self.solve(&task, fine) else {
            // From somewhere else the steps may lead where they did not.
            return self.solve(&task, Stage { scale: LEAST_SCALE, ..stage });
        };
        let creeps = coarse.is_some_and(|coarse| found.duration() > MOST_SLOWER * coarse.duration());
        if !creeps {
            return Some(found);
        }
        let other = self.solve(&task, Stage { interval_s: DIP_INTERVALS * interval_s, ..stage });
        Some(other.filter(|other| other.duration() < found.duration()).unwrap_or(found))
    }

    /// The course on knots at equal times of a guess, which is scaled to start with.
    fn solve(&mut self, task: &Task<'_>, stage: Stage<'_>) -> Option<Course> {
        let path = task.path;
        // A first plan gives knots only.
        let is_last = stage.gap <= GAPS[1];
        let (knots, squares) = grid::place_knots(task, stage.guess, stage.interval_s)?;
        if stage.is_known {
            self.known.clear();
            self.known.extend(knots.0.iter().copied().zip(squares.iter().copied()));
        }
        self.set_floors(task, &knots);
        // Knots far apart would not show how narrow bends are passed.
        if !is_last && grid::dips(path, &knots, &squares) {
            return None;
        }
        let intervals = knots.intervals();
        self.samples.take(path, &knots, if is_last { EXAMINED_PARTS } else { HELD_PARTS });
        self.share_limits(task, &knots, stage.interval_s);
        if is_last {
            grid::place_middles(path, &self.samples, (&knots, &squares), &mut self.holds);
        }
        self.start_from(task, &knots, &squares, stage.scale);
        self.problem.build(path, (knots, &self.samples), !is_last, &self.holds);
        if !self.solve_rows(0..intervals, (SPEED_STEPS, stage.gap), Start::FAR) {
            return None;
        }
        if is_last {
            if !self.keep_limits(path) {
                return None;
            }
            self.reach_caps(path);
        }
        segments::course(task, (&self.problem.knots, &self.samples), &self.c)
    }

    /// What every interval may use of the limits: junctions take a part, and the window leaves some to the next one.
    fn share_limits(&mut self, task: &Task<'_>, knots: &Knots, interval_s: f64) {
        let &Task { path, ends, .. } = task;
        let intervals = knots.intervals();
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
            let own = index.saturating_sub(around + 1).min(intervals)..(index + around).min(intervals);
            for left in &mut self.left[own] {
                *left = left.min(1.0 - reserve);
            }
        }
        let grade = if task.window.goes_on { SPEED_GRADE / intervals as f64 } else { 0.0 };
        self.holds.clear();
        for (index, left) in self.left.iter().enumerate() {
            let [_, middle, _] = self.samples.held(index);
            let share = left * (1.0 - grade * index as f64);
            self.holds.push(Hold { share, middle, middle_share: SPEED_LIMIT_SHARE });
        }
    }

    /// The smallest coefficients, from the squares of the speeds that are known to be possible.
    fn set_floors(&mut self, task: &Task<'_>, knots: &Knots) {
        let floor = if task.window.is_possible { LEAST_OF_GUESS } else { 0.0 };
        let known = &self.known;
        let mut last = 0;
        // A known place at or before the start of an interval, up to the first one behind its end.
        let slowest = |ends: &[f64]| {
            while known.get(last + 1).is_some_and(|&(place, _)| place <= ends[0]) {
                last += 1;
            }
            let mut slowest = f64::INFINITY;
            for &(place, square) in &known[last..] {
                slowest = square.min(slowest);
                if place >= ends[1] {
                    break;
                }
            }
            slowest
        };
        let floors = &mut self.problem.floors;
        floors.clear();
        floors.push(0.0);
        floors.extend(knots.0.windows(2).map(slowest).map(|square| floor * square));
        floors.push(0.0);
    }

    /// The coefficients to start with, from the squares of the guess' speeds at the knots; those at the ends are given by what is
    /// known there.
    fn start_from(&mut self, task: &Task<'_>, knots: &Knots, squares: &[f64], scale: f64) {
        let intervals = knots.intervals();
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
        for (k, knot) in [(0, 0), (1, intervals)] {
            let (b, slope) = task.given(k);
            let [first, second] = knots.coefficients(knot, b, slope);
            (self.c[knot], self.c[knot + 1]) = (first, second);
        }
    }
}

/// Interval of the first plan as a multiple of that of the second: it gives knots only.
const FIRST_INTERVALS: f64 = 5.0;
/// The same of a plan whose knots are those of a guess with deep dips: it passes narrow bends, and intervals are longer for it than for
/// the guess, which is slower.
const DIP_INTERVALS: f64 = 0.8;
/// Ratio of the time of a second plan to that of the first from which on it is taken to creep through bends that the first one has no knots
/// in, and the knots of the guess are tried: they are close there.
const MOST_SLOWER: f64 = 1.06;
/// Parts of the squared speeds that the steps start from: of a guess for a first plan, of that plan, or where no way was found.
const GUESS_SCALE: f64 = 0.7;
const FOUND_SCALE: f64 = 0.97;
const LEAST_SCALE: f64 = 0.4;
/// Part of the squared speed of a possible plan that a faster one does not fall below.
const LEAST_OF_GUESS: f64 = 0.3;
/// Part of a coefficient that the next one is at the least, to start with.
const MOST_FALL: f64 = 0.5;
