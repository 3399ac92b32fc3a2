//! Places between sections and threads where the spindle speed may change while the pipeline runs
//! (docs/functions/adaptive-feed.md, "Planned changes of the spindle speed").
//!
//! The program is read up to such a place and no further until everything before it is interpolated: there the path rests on
//! the grid, and what follows is planned at the speed that holds then. So what the pipeline gives depends on the program and
//! on the changes alone, whenever they become known.

use std::sync::Arc;

use feedwave_program::{Feed, MoveKind, Operation, OperationKind, Spindle, SpindleDirection, SpindleSpeed};
use serde::{Deserialize, Serialize};

use super::Pipeline;
use crate::frame::config::SpindleChange;

/// A change of the spindle speed that cannot be appended; nothing changes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpindleChangeError {
    /// The pipeline is at no place where it is possible ([`Pipeline::place_between`]).
    #[error("the spindle speed can change between sections and threads only")]
    NoPlace,
    /// Not a positive number.
    #[error("a spindle speed of {0} times the programmed one is not possible")]
    Ratio(f64),
}

/// How far the pipeline is with the place ahead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
enum Place {
    /// None is known.
    #[default]
    Unknown,
    /// The operation that waits begins behind one, which was not reached.
    Ahead,
    /// Everything before it was handed out; this is the next setpoint.
    Reached(u64),
    /// The operation that waits begins behind one that was passed.
    Passed,
}

/// The speed of the spindle as planned changes leave it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SpindleState {
    /// Ratio to the programmed speed.
    pub(crate) ratio: f64,
    /// As the program has it.
    programmed: Spindle,
    place: Place,
    /// The place passed last: the first setpoint behind it.
    last: Option<u64>,
    /// Changes taken up.
    taken: usize,
    /// Whether the operation before was a cut.
    follows_cut: bool,
    /// First line in which the speed would exceed the program's own limit of a constant surface speed.
    pub(crate) above_clamp_line: Option<u32>,
}

impl Default for SpindleState {
    fn default() -> Self {
        Self {
            ratio: 1.0,
            programmed: Spindle::STOPPED,
            place: Place::Unknown,
            last: None,
            taken: 0,
            follows_cut: false,
            above_clamp_line: None,
        }
    }
}

impl SpindleState {
    /// The programmed speed with a ratio. A constant surface speed and its clamp change alike, so that the speed is the
    /// programmed one times the ratio everywhere.
    fn turned(spindle: Spindle, ratio: f64) -> Spindle {
        let speed = match spindle.speed {
            SpindleSpeed::Constant { rev_per_min } => SpindleSpeed::Constant { rev_per_min: rev_per_min * ratio },
            SpindleSpeed::Surface { m_per_min, max_rev_per_min } => {
                SpindleSpeed::Surface { m_per_min: m_per_min * ratio, max_rev_per_min: max_rev_per_min * ratio }
            }
        };
        Spindle { speed, ..spindle }
    }

    /// Gives an operation the speed that holds, on its way to the builder. Feeds keep their mm/min: what becomes of the feed
    /// with the speed is said by the feed override.
    pub(super) fn pass(&mut self, operation: &mut Operation, plans: bool) {
        if !plans {
            return;
        }
        self.place = Place::Unknown;
        let ratio = self.ratio;
        let mut cuts = false;
        let (spindle, feed) = match &mut operation.kind {
            OperationKind::Move(mv) => {
                cuts = mv.kind == MoveKind::Cutting;
                (&mut mv.spindle, Some(&mut mv.feed))
            }
            OperationKind::Guided(guided) => {
                cuts = guided.step.kind == MoveKind::Cutting;
                (&mut guided.step.spindle, Some(&mut guided.step.feed))
            }
            OperationKind::Thread(mv) => (&mut mv.spindle, None),
            OperationKind::Spindle(spindle) => {
                self.programmed = *spindle;
                (spindle, None)
            }
            _ => {
                self.follows_cut = false;
                return;
            }
        };
        self.follows_cut = cuts;
        if ratio == 1.0 {
            return;
        }
        let is_clamped =
            matches!(spindle.speed, SpindleSpeed::Surface { max_rev_per_min, .. } if max_rev_per_min.is_finite());
        if ratio > 1.0 && is_clamped && spindle.is_turning() {
            self.above_clamp_line.get_or_insert(operation.span.line);
        }
        *spindle = Self::turned(*spindle, ratio);
        if let Some(Feed::PerRevolution(mm)) = feed {
            *mm /= ratio;
        }
    }
}

impl Pipeline {
    /// Index of the first setpoint behind the place at which the pipeline has stopped: between sections and threads, where the
    /// spindle speed may change. It goes on with the next call for setpoints. `None` at no such place, and wherever
    /// [`super::PipelineConfig::spindle_changes`] is `None`.
    #[must_use]
    pub fn place_between(&self) -> Option<u64> {
        match self.spindle.place {
            Place::Reached(index) => Some(index),
            Place::Unknown | Place::Ahead | Place::Passed => None,
        }
    }

    /// Whether the next setpoint is behind a place that was decided on: its change of the speed is known.
    #[must_use]
    pub fn has_change_at_place(&self) -> bool {
        self.place_between().is_some_and(|index| self.change_at(index).is_some())
    }

    /// Ratio of the spindle speed to the programmed one.
    #[must_use]
    pub fn spindle_ratio(&self) -> f64 {
        self.spindle.ratio
    }

    /// Programmed spindle speed at the place in hand, rev/min; `None` while it depends on the radius, or the spindle is stopped.
    #[must_use]
    pub fn programmed_rev_per_min(&self) -> Option<f64> {
        match self.spindle.programmed {
            Spindle { direction: SpindleDirection::Stopped, .. }
            | Spindle { speed: SpindleSpeed::Surface { .. }, .. } => None,
            Spindle { speed: SpindleSpeed::Constant { rev_per_min }, .. } => Some(rev_per_min),
        }
    }

    /// Changes the spindle speed at the place at which the pipeline has stopped. What follows is, to the last bit, what a
    /// pipeline would give that had the change in its configuration from the start.
    ///
    /// # Errors
    /// [`SpindleChangeError`] elsewhere, or for an impossible ratio.
    pub fn append_spindle_change(&mut self, ratio: f64) -> Result<SpindleChange, SpindleChangeError> {
        let index = self.place_between().ok_or(SpindleChangeError::NoPlace)?;
        if !(ratio.is_finite() && ratio > 0.0) {
            return Err(SpindleChangeError::Ratio(ratio));
        }
        let change = SpindleChange { index, ratio };
        let config = Arc::make_mut(&mut self.config);
        let changes = config.spindle_changes.get_or_insert_default();
        if changes.last().is_some_and(|last| last.index >= index) {
            return Err(SpindleChangeError::NoPlace);
        }
        changes.push(change);
        Ok(change)
    }

    fn change_at(&self, index: u64) -> Option<SpindleChange> {
        let changes = self.config.spindle_changes.as_deref().unwrap_or_default();
        changes.get(self.spindle.taken).copied().filter(|change| change.index <= index)
    }

    /// Whether a place lies before an operation that waits for the builder.
    pub(super) fn stops_before(&self, operation: &Operation) -> bool {
        self.config.spindle_changes.is_some()
            && self.spindle.place == Place::Unknown
            && self.builder.may_turn_otherwise_before(operation, self.spindle.follows_cut)
    }

    /// Has the path rest before the operation that waits.
    pub(super) fn rest_between(&mut self) {
        self.builder.rest_between(&self.config, &mut self.planner, &mut self.findings);
        self.spindle.place = Place::Ahead;
    }

    /// Whether everything before a place has been interpolated, where one is ahead. The first of several at one setpoint counts.
    pub(super) fn reaches_place(&mut self) -> bool {
        if self.spindle.place != Place::Ahead {
            return false;
        }
        let next = self.interpolator.next_index();
        if self.spindle.last == Some(next) {
            self.spindle.place = Place::Passed;
            return false;
        }
        self.spindle.last = Some(next);
        self.spindle.place = Place::Reached(next);
        true
    }

    /// Goes on behind the place at which the pipeline has stopped, at the speed that its change says.
    pub(super) fn leave_place(&mut self) {
        let Some(index) = self.place_between() else { return };
        self.spindle.place = Place::Passed;
        let Some(change) = self.change_at(index) else { return };
        self.spindle.taken += 1;
        self.turn_at(change.ratio);
    }

    /// Goes on behind the place at which the pipeline has stopped, at this ratio to the programmed speed.
    pub(crate) fn leave_place_at(&mut self, ratio: f64) {
        self.spindle.place = Place::Passed;
        self.turn_at(ratio);
    }

    /// The spindle turns at this ratio to its programmed speed from here on.
    fn turn_at(&mut self, ratio: f64) {
        self.spindle.ratio = ratio;
        let spindle = SpindleState::turned(self.spindle.programmed, ratio);
        self.builder.turn_spindle(spindle, &mut self.planner);
    }
}
