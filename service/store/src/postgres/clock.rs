//! The database's clock, as this process reckons it: one clock for all replicas, however theirs are set.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use crate::sql::clock::following;

/// What the clock of the database says.
#[derive(Debug)]
pub(super) struct Clock {
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    /// When the database was asked, and what it said then, microseconds since the Unix epoch.
    asked: (Instant, i64),
    latest_us: i64,
}

impl Clock {
    /// A clock that was asked between `begun` and now.
    pub(super) fn new(begun: Instant, now_us: i64) -> Self {
        Self { state: Mutex::new(State { asked: (middle(begun), now_us), latest_us: 0 }) }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Only whole values are put in.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes what the database said between `begun` and now.
    pub(super) fn set(&self, begun: Instant, now_us: i64) {
        self.state().asked = (middle(begun), now_us);
    }

    /// The time now in microseconds since the Unix epoch, later than at the call before.
    pub(super) fn now_us(&self) -> i64 {
        let mut state = self.state();
        let (asked, asked_us) = state.asked;
        let passed = i64::try_from(asked.elapsed().as_micros()).unwrap_or(i64::MAX);
        state.latest_us = following(asked_us.saturating_add(passed), state.latest_us);
        state.latest_us
    }
}

/// The middle of the time since `begun`: when the database read its clock, as far as is known.
fn middle(begun: Instant) -> Instant {
    begun + begun.elapsed() / 2
}
