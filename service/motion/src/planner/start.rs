//! The start of a path: its first part is released before the window is full, as soon as it no longer depends on what follows.
//!
//! The speeds between runs follow from what lies behind them, back from the end of what is known, where the path is assumed to rest,
//! and from what lies before. Where the way back from rest and that from the highest speed permitted there meet, more of the path
//! would change nothing: what lies before is released as it would be with all of it known. How far that is ahead is what a stop
//! takes, so that the first setpoints do not wait for a count of elements, of which each may be many merged blocks.
//!
//! That holds for runs that are complete. What the last element leaves to the junction behind it is not known, so it is a run of its
//! own for once; the run before it may go on with more, which brings it lower limits. Such a run is divided only where it is long: what is
//! slower does not join it then, and with less acceleration it would still be steady where it is divided. The run that is divided
//! goes on as the same run ([`Plan::begun_at`]), with the limits and the neighbours that it has in a plan of the whole.

use super::Planner;
use super::runs::{Plan, Run};
use crate::tolerance::{LONG_STOPS, OPEN_STOPS, RESTART_S, START_S};

impl<B> Planner<B> {
    /// Releases the first part of a chain that comes from rest, or was planned again, where enough of it is settled; otherwise it is tried
    /// again with half as many elements more.
    pub(super) fn start(&mut self) {
        self.next_start = Some(self.chain.len() + self.chain.len() / 2);
        let comes_from_rest = self.entry_speed == 0.0 && self.overspeed == 0.0;
        if self.is_held || !(comes_from_rest || self.was_changed) {
            return;
        }
        if !self.plan(None) {
            // There may be a way with more of the path known.
            self.too_fast = false;
            return;
        }
        if let Some(stop) = self.scratch.stop {
            if self.was_changed {
                self.release_until(stop);
            }
            return;
        }
        let time_s = if self.was_changed { RESTART_S } else { START_S };
        match self.scratch.settled_cut(time_s) {
            Some((count, speed, command)) => {
                self.release(count, speed);
                if speed <= command {
                    self.overspeed = 0.0;
                }
                self.start_again();
            }
            None if self.was_changed => self.runs_before = self.scratch.run_lengths(0),
            None => {}
        }
    }
}

impl Plan {
    /// Where to divide a planned chain so that its first part is as it would be with more of the path known, and takes this time at the
    /// least: the number of elements, the speed there, at which it has no acceleration, and the highest speed of the limits there.
    fn settled_cut(&mut self, least_s: f64) -> Option<(usize, f64, f64)> {
        let settled = self.settled_runs()?;
        let mut before_s = Vec::with_capacity(settled);
        let mut time_s = 0.0;
        for run in 0..settled {
            before_s.push(time_s);
            time_s += self.profile(run).duration();
        }
        (0..settled).rev().find_map(|run| {
            let (node, speed, inside_s) = self.place_in_cruise(run).or_else(|| self.place_at_start(run))?;
            (before_s[run] + inside_s >= least_s).then(|| (self.element(node), speed, self.runs[run].velocity()))
        })
    }

    /// How many runs at the start have entries that do not depend on what follows what is known. The plan is as it was.
    fn settled_runs(&mut self) -> Option<usize> {
        let entry_speed = self.runs.first()?.entry;
        let open = self.open_run()?;
        // Joined by what asks for less, a short run would be another one; a long one is divided instead.
        let known = if self.runs[open].length >= LONG_STOPS * self.runs[open].stop_mm() { open + 1 } else { open };
        // From rest the path is never above the speeds from which what follows is passed.
        let comes_from_rest = entry_speed == 0.0;
        let mut settled = self.settled_of(known, Run::velocity, !comes_from_rest)?;
        if self.is_overspeed {
            settled = settled.min(self.settled_of(known, Run::hard_velocity, true)?);
        }
        self.solve(entry_speed).then_some(settled)
    }

    /// How many of the first `known` runs have the same highest speeds at their starts whatever follows them.
    fn settled_of(&mut self, known: usize, velocity: fn(&Run) -> f64, with_entries: bool) -> Option<usize> {
        let last_velocity = self.runs[..known].last().map(velocity)?;
        let mut speeds = |end_speed: f64| -> Vec<[f64; 2]> {
            self.backward_from(known, end_speed, velocity);
            let own = |run: &Run| [run.passing, if with_entries { run.entry } else { run.passing }];
            self.runs[..known].iter().map(own).collect()
        };
        // A change of speed takes longest to a third of it.
        let [rest, slow, fast] = [0.0, last_velocity / 3.0, last_velocity].map(&mut speeds);
        Some((0..known).take_while(|&run| rest[run] == slow[run] && slow[run] == fast[run]).count())
    }

    /// The run that may go on: the last one before the last element, whose limits are not known.
    fn open_run(&self) -> Option<usize> {
        let last = self.first_node_of(self.nodes.last()?.element);
        self.nodes[last].run.checked_sub(1)
    }

    /// The last start of an element where a run is at the highest speed of its limits: the node, that speed, and the time up to there.
    fn place_in_cruise(&mut self, run: usize) -> Option<(usize, f64, f64)> {
        let profile = self.profile(run);
        let own = &self.runs[run];
        let [from, mut to] = profile.cruise();
        if self.open_run() == Some(run) {
            // With lower limits it would brake earlier.
            to = to.min(own.length - OPEN_STOPS * own.stop_mm());
        }
        let speed = profile.cruise_velocity();
        let is_highest = speed > 0.0 && speed >= own.velocity();
        let node = (own.first + 1..own.first + own.count)
            .rfind(|&index| self.starts_element(index) && (from..=to).contains(&self.nodes[index].offset))?;
        is_highest.then(|| (node, speed, profile.time_at(self.nodes[node].offset)))
    }

    /// The start of a run that is one of an element.
    fn place_at_start(&self, run: usize) -> Option<(usize, f64, f64)> {
        let own = &self.runs[run];
        (own.entry > 0.0 && self.starts_element(own.first)).then_some((own.first, own.entry, 0.0))
    }
}

#[cfg(test)]
pub(super) mod tests;
