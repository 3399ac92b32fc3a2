//! Keeping the limits between the places at which a window holds them: they are lowered where they are exceeded, and what is within
//! them is raised to the commanded speeds.

use std::ops::Range;

use super::SpeedPlanner;
use super::check;
use super::grid::LEAST_INTERVALS;
use super::path::Path;
use super::solver::{GAPS, Start};
use crate::tolerance::{
    SPEED_AROUND, SPEED_CHECKED_SHARE, SPEED_HELD_SHARE, SPEED_LIMIT_SHARE, SPEED_STEPS, SPEED_TIGHTENINGS,
};

/// Part of a window above which it is solved again as a whole.
const MOST_AGAIN: f64 = 0.7;
/// Shares of its cap from which on a coefficient is raised towards it, and at which it is there.
const NEAR_CAP: [f64; 2] = [0.995, 0.999];
/// How often parts of a row of raised coefficients are taken back before all of it is.
const MOST_LOWERINGS: usize = 8;
/// Largest excess that a limit is lowered by at once; b that falls below zero has no other.
const MOST_EXCESS: f64 = 2.0;

impl SpeedPlanner {
    /// Lowers limits where they are exceeded, and solves again around these places, until all are kept.
    pub(super) fn keep_limits(&mut self, path: &Path<'_>) -> bool {
        let intervals = self.problem.knots.intervals();
        self.worst.clear();
        self.worst.resize(intervals, (0.0, 0));
        let all = || core::iter::once(0..intervals).collect::<Vec<_>>();
        let mut changed = all();
        for round in 0..=SPEED_TIGHTENINGS {
            let mut keeps = true;
            for range in &changed {
                let found = (&self.left[..], &mut self.worst[..]);
                keeps &= check::worst((path, &self.samples), &self.problem.knots, &self.c, found, range.clone());
            }
            if keeps {
                return true;
            }
            if round == SPEED_TIGHTENINGS {
                break;
            }
            changed = self.tighten(path);
            self.before.clone_from(&self.c);
            let options = (SPEED_STEPS, GAPS[1]);
            let mut is_solved = changed.iter_mut().all(|range| self.solve_part(range, options));
            for start in [Start::NEAR, Start::FAR] {
                if is_solved {
                    break;
                }
                changed = all();
                self.c.clone_from(&self.before);
                is_solved = self.solve_rows(0..intervals, options, start);
            }
            if !is_solved {
                return false;
            }
        }
        false
    }

    /// Improves the coefficients of some intervals within all rows; whether that was possible. The method leaves a little of the rows: what is
    /// above a commanded speed by that is lowered to it.
    pub(super) fn solve_rows(&mut self, part: Range<usize>, options: (usize, f64), start: Start) -> bool {
        let free = part.start + 2..part.end;
        let is_solved = self.solver.solve(&self.problem, &mut self.c, part, options, start);
        for (c, &per_cap) in self.c[free.clone()].iter_mut().zip(&self.problem.per_caps[free]) {
            *c = if per_cap > 0.0 { c.min(1.0 / per_cap) } else { *c };
        }
        is_solved
    }

    /// Solves a part of the window again. With its ends as they are it may have no way, as the path is at its limits there: then more
    /// around it, up to what is better solved as a whole.
    fn solve_part(&mut self, part: &mut Range<usize>, options: (usize, f64)) -> bool {
        let intervals = self.worst.len();
        loop {
            if self.solve_rows(part.clone(), options, Start::NEAR) {
                return true;
            }
            let own = part.start..part.end + 2;
            self.c[own.clone()].copy_from_slice(&self.before[own]);
            let more = part.len();
            *part = up_to_ends(part.start.saturating_sub(more)..(part.end + more).min(intervals), intervals);
            if part.len() as f64 > MOST_AGAIN * intervals as f64 {
                return false;
            }
        }
    }

    /// Holds the limits where they are exceeded, and lowers those that are held there already; the intervals to be solved again.
    ///
    /// No more than that: where a window starts at the limits, another one has found what is just possible.
    fn tighten(&mut self, path: &Path<'_>) -> Vec<Range<usize>> {
        let intervals = self.worst.len();
        let mut changed: Vec<Range<usize>> = Vec::new();
        for (index, &(ratio, place)) in self.worst.iter().enumerate() {
            if ratio <= SPEED_CHECKED_SHARE {
                continue;
            }
            let hold = &mut self.holds[index];
            let [start, _, end] = self.samples.held(index);
            let is_inside = place != start && place != end;
            if is_inside && hold.middle_share < SPEED_HELD_SHARE {
                (hold.middle, hold.middle_share) = (place, SPEED_HELD_SHARE);
            } else {
                hold.share *= SPEED_LIMIT_SHARE / ratio.min(MOST_EXCESS);
            }
            self.problem.set_interval(path, &self.samples, index, *hold);
            let around = index.saturating_sub(SPEED_AROUND)..(index + 1 + SPEED_AROUND).min(intervals);
            match changed.last_mut().filter(|last| last.end + LEAST_INTERVALS >= around.start) {
                Some(last) => last.end = around.end,
                None => changed.push(around),
            }
        }
        for range in &mut changed {
            *range = up_to_ends(range.clone(), intervals);
        }
        let some: usize = changed.iter().map(Range::len).sum();
        if some as f64 > MOST_AGAIN * intervals as f64 { core::iter::once(0..intervals).collect() } else { changed }
    }

    /// Raises coefficients that are nearly at their caps to them, where all limits are kept then: the method stays a little inside of every
    /// limit, and a commanded speed is one that the path has to have.
    pub(super) fn reach_caps(&mut self, path: &Path<'_>) {
        let intervals = self.problem.knots.intervals();
        // Those at either end are given.
        let mut index = 2;
        while index < intervals {
            let first = index;
            self.before.clear();
            while index < intervals
                && let Some(raised) = raised(self.c[index], self.problem.per_caps[index])
            {
                self.before.push(self.c[index]);
                self.c[index] = raised;
                index += 1;
            }
            if index == first {
                index += 1;
                continue;
            }
            self.lower_raised(path, first..index);
        }
    }

    /// Takes back what of a row of raised coefficients acts where a limit is exceeded then.
    fn lower_raised(&mut self, path: &Path<'_>, row: Range<usize>) {
        // A coefficient acts on three intervals, up to the one of its number.
        let acts = row.start - 2..row.end;
        for _ in 0..MOST_LOWERINGS {
            let found = (&self.left[..], &mut self.worst[..]);
            if check::worst((path, &self.samples), &self.problem.knots, &self.c, found, acts.clone()) {
                return;
            }
            for interval in acts.clone().filter(|&interval| self.worst[interval].0 > SPEED_CHECKED_SHARE) {
                let own = interval.max(row.start)..(interval + 3).min(row.end);
                self.c[own.clone()].copy_from_slice(&self.before[own.start - row.start..own.end - row.start]);
            }
        }
        self.c[row].copy_from_slice(&self.before);
    }
}

/// What a coefficient is raised to that is nearly at its cap.
fn raised(c: f64, per_cap: f64) -> Option<f64> {
    let share = c * per_cap;
    let above = (share - NEAR_CAP[0]) / (NEAR_CAP[1] - NEAR_CAP[0]);
    if per_cap <= 0.0 || above <= 0.0 || share >= 1.0 {
        return None;
    }
    let above = above.min(1.0);
    let part = above * above * (3.0 - 2.0 * above);
    let cap = 1.0 / per_cap;
    Some(if part < 1.0 { c + part * (cap - c) } else { cap })
}

/// A part of so many intervals; near an end of them, up to it.
fn up_to_ends(part: Range<usize>, intervals: usize) -> Range<usize> {
    let start = if part.start < LEAST_INTERVALS { 0 } else { part.start };
    let end = if part.end + LEAST_INTERVALS > intervals { intervals } else { part.end };
    start..end
}
