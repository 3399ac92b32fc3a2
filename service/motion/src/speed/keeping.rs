//! Keeping the limits between the places at which a window holds them: they are lowered where they are exceeded, and what is within
//! them is raised to the commanded speeds.

use std::ops::Range;

use super::SpeedPlanner;
use super::check;
use super::grid::LEAST_INTERVALS;
use super::path::Path;
use super::solver::{GAPS, Start};
use crate::tolerance::{SPEED_AROUND, SPEED_CHECKED_SHARE, SPEED_SIDE, SPEED_STEPS, SPEED_TIGHTENINGS};

/// Part of a window above which it is solved again as a whole.
const MOST_AGAIN: f64 = 0.7;
/// Shares of its cap from which on a coefficient is raised towards it, and at which it is there.
const NEAR_CAP: [f64; 2] = [0.997, 0.9994];
/// How much further a limit is lowered than it was exceeded.
const TIGHTENING: f64 = 0.98;

impl SpeedPlanner {
    /// Lowers limits where they are exceeded, and solves again around these places, until all are kept.
    pub(super) fn keep_limits(&mut self, path: &Path<'_>) -> bool {
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

    /// Raises coefficients that are nearly at their caps to them, where all limits are kept then: the method stays a little inside
    /// of every limit, and a commanded speed is one that the path has to have.
    pub(super) fn reach_caps(&mut self, path: &Path<'_>) {
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
}
