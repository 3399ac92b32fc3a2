//! Planning anew from the present speed, at another feed override.
//!
//! No more is planned at once than has to be known for the first part to be as it would be with all of it known ([`super::start`]), however
//! much was known; the rest is taken up when that part was taken ([`super::behind`]). What there is goes on where that is not possible.

use std::collections::VecDeque;

use super::behind::Behind;
use super::{Ahead, PathItem, Planned, Planner, TooFast};
use crate::tolerance::LEAST_START;

/// A path that is planned again, beside what there is.
pub(super) struct Again<B> {
    planner: Planner<B>,
    /// What of the path in front is not planned, and how many items of what was not taken are.
    path: VecDeque<PathItem<B>>,
    taken: usize,
    /// Speed at its start, mm/s.
    pub(super) speed: f64,
}

impl<B: Clone> Planner<B> {
    /// Plans anew what was not taken, with `path` in front of it: from `speed` mm/s without acceleration, at another feed override. At 0
    /// the path comes to rest as soon as it can, where the override acts on it.
    ///
    /// # Errors
    /// [`TooFast`] when the path ahead, as far as it is known, cannot be run from that speed within the limits; the planner then is as
    /// it was.
    pub fn restart(&mut self, speed: f64, feed_override: f64, path: Vec<PathItem<B>>) -> Result<(), TooFast> {
        let again = self.planned_again([speed; 2], feed_override, (path, 0))?;
        self.go_on_with(again);
        Ok(())
    }

    /// Plans anew from the highest of these speeds, lowest and highest, from which the commands ahead can be kept, or else from the
    /// lowest: `path` and, behind it, what was not taken but for so many items.
    pub(super) fn planned_again(
        &mut self,
        [least, most]: [f64; 2],
        feed_override: f64,
        (path, has): (Vec<PathItem<B>>, usize),
    ) -> Result<Again<B>, TooFast> {
        let mut planner = Self {
            feed_override,
            entry_speed: most,
            overspeed: most,
            free_entry: (least < most).then_some([least, most]),
            finished: self.finished,
            next_plan: usize::MAX,
            next_plan_bytes: usize::MAX,
            was_changed: true,
            scratch: core::mem::take(&mut self.scratch),
            ..Self::new(self.settings.clone())
        };
        planner.scratch.lacks_more = false;
        let mut taken = 0;
        let own = self.not_taken().skip(has).map(PathItem::from);
        let items = path.iter().cloned().chain(own).inspect(|_| taken += 1);
        let begun = planner.begin(least, items);
        if begun.is_err() {
            self.scratch = core::mem::take(&mut planner.scratch);
        }
        let mut path = VecDeque::from(path);
        let of_path = taken.min(path.len());
        path.drain(..of_path);
        begun.map(|speed| Again { planner, path, taken: has + taken - of_path, speed })
    }

    /// The first item that was not taken.
    pub(super) fn first_not_taken(&self) -> Option<PathItem<B>> {
        self.not_taken().next().map(PathItem::from)
    }

    /// Plans the first part of a path; the speed at its start, from a lowest one on.
    fn begin(&mut self, least: f64, mut path: impl Iterator<Item = PathItem<B>>) -> Result<f64, TooFast> {
        while self.ready.is_empty() && !self.is_held && !self.too_fast {
            let Some(item) = path.next() else {
                self.plan_known();
                break;
            };
            self.plan_item(item);
        }
        let chosen = match self.ready.front().map(|released| &released.planned) {
            Some(Planned::Motion(motion)) => motion.stretches.first().map_or(0.0, |first| first.profile.state(0.0).1),
            Some(Planned::Barrier(_)) => 0.0,
            None if self.chain.is_empty() => 0.0,
            None => self.entry_speed,
        };
        self.free_entry = None;
        self.next_plan = self.settings.window.max(self.chain.len() + 1);
        self.next_plan_bytes = self.settings.window_bytes.max(self.chain_bytes + 1);
        let rests_while_fast = least > 0.0 && chosen <= 0.0;
        if self.too_fast || rests_while_fast { Err(TooFast) } else { Ok(chosen) }
    }

    /// Plans all that is known, of which no part can be released without what follows.
    fn plan_known(&mut self) {
        if self.finished {
            self.release_chain();
        } else if self.chain.len() >= self.settings.window || self.chain_bytes >= self.settings.window_bytes {
            self.release_window();
        } else if (self.entry_speed > 0.0 || self.feed_override == 0.0) && self.plan(None) {
            match self.scratch.stop {
                Some(stop) => self.release_until(stop),
                None => self.runs_before = self.scratch.run_lengths(0),
            }
        }
    }
}

impl<B> Planner<B> {
    /// Goes on with what was planned again.
    pub(super) fn go_on_with(&mut self, again: Again<B>) {
        let Again { mut planner, path, taken, .. } = again;
        let ready = core::mem::take(&mut self.ready);
        let chain = core::mem::take(&mut self.chain);
        let mut behind = Behind::new(ready, chain, core::mem::take(&mut self.behind));
        behind.remove_front(taken);
        behind.prepend(path);
        // What came when the path was found to rest before it.
        while let Some(item) = planner.behind.pop_front() {
            behind.push_front(item);
        }
        planner.behind = behind;
        planner.within_reach = core::mem::take(&mut self.within_reach);
        *self = planner;
    }

    /// What was pushed and not taken, but for what waits for the limits within reach.
    fn not_taken(&self) -> impl Iterator<Item = Ahead<'_, B>> {
        let ready = self.ready.iter().map(|released| Ahead::from(&released.planned));
        let chain = self.chain.iter().map(|waiting| Ahead::Motion(&waiting.request));
        ready.chain(chain).chain(self.behind.items())
    }

    /// Whether a restart is in progress.
    pub(super) const fn is_restarting(&self) -> bool {
        self.next_plan == usize::MAX
    }

    /// Says that the next part of a path that was planned again may be released as soon as it depends on nothing behind it.
    pub(super) fn start_again(&mut self) {
        self.next_start = self.was_changed.then_some(self.chain.len() + (self.chain.len() / 2).max(LEAST_START));
    }
}

#[cfg(test)]
mod tests;
