//! The oscillation as a motion: offsets of the tool as a function of the oscillation's phase, which the spindle turns.
//!
//! ```text
//! p(τ) = p_cmd + E·(u(τ)·x̂ + y(τ)·(x̂×ẑ) + w(τ)·ẑ)
//! ```
//!
//! x̂ is the feed direction, the unit tangent of the path in space, and ẑ the tool axis, τ the phase in turns, E the blend at the
//! ends. x̂×ẑ stands for its unit vector. **w is positive where the tool is retracted**; the protrusion is −w.

use serde::{Deserialize, Serialize};

use super::waveform::{ROUNDING, Wave, WavePeaks};
use super::{DirectionOscillation, OscillationCondition, ToolGeometry};
use crate::shared::blend::BLEND_STEEPNESS;

/// Offsets of the tool from its commanded place, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolOffset {
    /// Along the feed direction, positive forwards.
    pub feed_mm: f64,
    /// Along feed direction × tool axis.
    pub cross_mm: f64,
    /// Along the tool axis, positive retracted from the work.
    pub retraction_mm: f64,
}

impl ToolOffset {
    /// By how much the tool protrudes towards the work, mm: the negative of the retraction.
    #[must_use]
    pub fn protrusion_mm(&self) -> f64 {
        -self.retraction_mm
    }
}

/// One direction of the oscillation, ready for evaluation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DirectionMotion {
    /// Amplitude, mm.
    pub amplitude_mm: f64,
    /// Phase by which it runs ahead, turns.
    pub phase_turns: f64,
    /// The waveform.
    pub wave: Wave,
}

impl DirectionMotion {
    pub(super) fn new(direction: &DirectionOscillation, wave: Wave) -> Self {
        Self { amplitude_mm: direction.amplitude_mm, phase_turns: direction.phase_deg / 360.0, wave }
    }

    /// Offset at phase τ, mm.
    #[must_use]
    pub fn offset_mm(&self, turns: f64) -> f64 {
        self.amplitude_mm * self.wave.value(turns + self.phase_turns)
    }

    /// [`DirectionMotion::offset_mm`] of every phase of `turns` into the same place of `offsets`.
    ///
    /// # Panics
    /// When the lengths differ: the caller's columns are out of step.
    pub fn fill_offset_mm(&self, turns: &[f64], offsets: &mut [f64]) {
        self.wave.fill_shifted(self.phase_turns, turns, offsets);
        for offset in offsets {
            *offset *= self.amplitude_mm;
        }
    }

    /// Middle of the lowest stretch, turns within [0, 1), and its length.
    #[must_use]
    pub fn trough(&self) -> (f64, f64) {
        let (middle, length) = self.wave.trough();
        let phase = middle - self.phase_turns;
        (phase - phase.floor(), length)
    }

    /// Peaks of the motion at a period, in mm and s.
    #[must_use]
    pub fn peaks(&self, period_s: f64) -> DirectionPeaks {
        let WavePeaks { first, second, third, second_step } = self.wave.peaks();
        let velocity = self.amplitude_mm / period_s;
        let acceleration = velocity / period_s;
        DirectionPeaks {
            velocity_mm_per_s: velocity * first,
            acceleration_mm_per_s2: acceleration * second,
            jerk_mm_per_s3: acceleration / period_s * third,
            acceleration_step_mm_per_s2: acceleration * second_step,
        }
    }
}

/// Peaks of the motion in one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DirectionPeaks {
    /// mm/s
    pub velocity_mm_per_s: f64,
    /// mm/s²
    pub acceleration_mm_per_s2: f64,
    /// mm/s³, between steps of the acceleration.
    pub jerk_mm_per_s3: f64,
    /// Largest step of the acceleration, mm/s²; where it is not 0 the jerk is unbounded there.
    pub acceleration_step_mm_per_s2: f64,
}

/// A synchronised oscillation of one tool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ToolOscillation {
    /// Periods per revolution M.
    pub periods_per_rev: u32,
    /// Phase at the spindle's zero while the feed goes in the work plane's first direction, turns.
    pub phase_at_zero_turns: f64,
    /// Along the feed direction.
    pub feed: DirectionMotion,
    /// Along the tool axis, positive retracted.
    pub axial: DirectionMotion,
    /// Along feed direction × tool axis.
    pub cross: Option<DirectionMotion>,
}

impl ToolOscillation {
    /// Puts `condition` onto the tool with M periods per revolution and `leading_edge` (counted from 1) in the feed
    /// direction at the condition's phase. `None` where a waveform or the edge is impossible: [`super::judge`] says why.
    #[must_use]
    pub fn new(
        tool: &ToolGeometry,
        condition: &OscillationCondition,
        periods_per_rev: u32,
        leading_edge: u32,
    ) -> Option<Self> {
        let compile = |direction: &DirectionOscillation| {
            direction.waveform.compile().ok().map(|wave| DirectionMotion::new(direction, wave))
        };
        let edge = tool.edges.get((leading_edge as usize).checked_sub(1)?)?;
        // At the spindle angle of the edge the phase is the condition's.
        let turns = condition.leading_edge.phase_deg / 360.0 - f64::from(periods_per_rev) * edge.angle_deg / 360.0;
        Some(Self {
            periods_per_rev,
            phase_at_zero_turns: turns - turns.floor(),
            feed: compile(&condition.feed)?,
            axial: compile(&condition.axial)?,
            cross: match &condition.cross {
                Some(cross) => Some(compile(cross)?),
                None => None,
            },
        })
    }

    /// Phase τ, turns, at a spindle angle in the direction of rotation, with the feed direction `feed_turns` further in
    /// that direction than the work plane's first one. Nothing but the angle decides it: a changed speed keeps the step.
    #[inline]
    #[must_use]
    pub fn phase_turns(&self, spindle_rev: f64, feed_turns: f64) -> f64 {
        // Whole revolutions are whole periods; without them no precision is lost over a long section. Rounding to the
        // nearest one by addition vectorises, unlike a call of `floor`.
        let angle = spindle_rev - ((spindle_rev + ROUNDING) - ROUNDING) - feed_turns;
        f64::from(self.periods_per_rev) * angle + self.phase_at_zero_turns
    }

    /// Phase at which an edge points in the feed direction, turns within [0, 1).
    #[must_use]
    pub fn phase_of_edge(&self, tool: &ToolGeometry, edge: usize) -> f64 {
        let turns = self.phase_turns(tool.edges[edge].angle_deg / 360.0, 0.0);
        turns - turns.floor()
    }

    /// Offsets at phase τ.
    #[must_use]
    pub fn offset(&self, turns: f64) -> ToolOffset {
        ToolOffset {
            feed_mm: self.feed.offset_mm(turns),
            cross_mm: self.cross.as_ref().map_or(0.0, |cross| cross.offset_mm(turns)),
            retraction_mm: self.axial.offset_mm(turns),
        }
    }

    /// Phase error, degrees within ±180: by how much the middle of the largest protrusion comes after the middle of the
    /// largest retreat in the feed direction. 0 where one of them does not oscillate.
    #[must_use]
    pub fn phase_error_deg(&self) -> f64 {
        if self.feed.amplitude_mm == 0.0 || self.axial.amplitude_mm == 0.0 {
            return 0.0;
        }
        let turns = self.axial.trough().0 - self.feed.trough().0;
        360.0 * (turns - turns.round())
    }
}

/// Length of path over which the oscillation is blended in and out, mm: the feed of a whole number of periods, `periods`
/// or as many as keep an amplitude within the section.
#[must_use]
pub fn ramp_mm(periods: u32, feed_per_period_mm: f64, amplitude_mm: f64, may_overrun: bool) -> f64 {
    let least = if may_overrun || feed_per_period_mm <= 0.0 {
        1.0
    } else {
        (BLEND_STEEPNESS * amplitude_mm / feed_per_period_mm).ceil()
    };
    f64::from(periods.max(1)).max(least) * feed_per_period_mm
}
