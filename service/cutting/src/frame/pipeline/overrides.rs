//! Changes of the feed override while the pipeline runs.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Pipeline;
use crate::frame::config::OverrideChange;
use crate::frame::profile::{MAX_OVERRIDE_RATIO, MIN_OVERRIDE_RATIO, is_override_ratio};

/// A change of the feed override that cannot be appended; nothing changes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AppendError {
    /// What lies before was handed out already, or is governed by a change appended before.
    #[error("setpoint {index} lies before {earliest}, the earliest at which the feed override can change")]
    TooEarly {
        /// Index of the change.
        index: u64,
        /// See [`Pipeline::earliest_override`].
        earliest: u64,
    },
    /// Neither 0 nor a number from [`MIN_OVERRIDE_RATIO`] to [`MAX_OVERRIDE_RATIO`].
    #[error("a feed override of {0} is neither 0 nor between {MIN_OVERRIDE_RATIO} and {MAX_OVERRIDE_RATIO}")]
    Ratio(f64),
}

/// Progress through the changes of the feed override.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct OverrideState {
    /// Number of changes taken up.
    taken: usize,
    /// The ratio that waits for the path to brake less.
    pending: Option<f64>,
}

impl Pipeline {
    /// Index of the earliest setpoint at which a change of the feed override can still be appended; call between blocks.
    #[must_use]
    pub fn earliest_override(&self) -> u64 {
        let after_last = self.config.overrides.last().map_or(0, |last| last.index + 1);
        self.next_index().max(after_last)
    }

    /// Adds a change of the feed override while the pipeline runs; call between blocks. What follows is, to the last bit,
    /// what a pipeline would give that had the change in its configuration from the start.
    ///
    /// # Errors
    /// [`AppendError`] for a change before [`Pipeline::earliest_override`] or an impossible ratio.
    pub fn append_override(&mut self, change: OverrideChange) -> Result<(), AppendError> {
        let OverrideChange { index, ratio } = change;
        if !is_override_ratio(ratio) {
            return Err(AppendError::Ratio(ratio));
        }
        let earliest = self.earliest_override();
        if index < earliest {
            return Err(AppendError::TooEarly { index, earliest });
        }
        Arc::make_mut(&mut self.config).overrides.push(change);
        self.interpolator.end_feed_hold_at(index);
        self.interpolator.pause_at(self.interpolator.pause().into_iter().chain([index]).min());
        Ok(())
    }

    /// Takes up the change of the feed override that is due.
    pub(super) fn change_override(&mut self) {
        let next = self.interpolator.next_index();
        while let Some(change) = self.config.overrides.get(self.overrides.taken).filter(|change| change.index <= next) {
            self.overrides.pending = Some(change.ratio);
            self.overrides.taken += 1;
            self.interpolator.follow_with_amplitude(change.ratio);
        }
        let Some(ratio) = self.overrides.pending else { return self.interpolator.pause_at(self.next_override()) };
        let place_mm = self.interpolator.section_place_mm();
        let again = self.interpolator.change_override(&mut self.planner, ratio);
        if again.is_none() {
            if let Some(analysis) = &mut self.builder.analysis {
                analysis.functions.vibration.changes_override(place_mm, ratio);
            }
            self.overrides.pending = None;
            self.interpolator.follow_override(ratio);
        }
        self.interpolator.pause_at(again.into_iter().chain(self.next_override()).min());
    }

    fn next_override(&self) -> Option<u64> {
        self.config.overrides.get(self.overrides.taken).map(|change| change.index)
    }

    pub(super) fn at_next_override(mut self) -> Self {
        self.interpolator.pause_at(self.next_override());
        self
    }

    /// Rests while no speed is commanded; `false` when the path ahead has to be known first.
    pub(super) fn rest_in_feed_hold(&mut self) -> bool {
        self.interpolator.show_path(self.planner.waiting());
        if self.interpolator.goes_on() {
            return self.interpolator.reach_is_known();
        }
        self.interpolator.hold_feed();
        true
    }
}
