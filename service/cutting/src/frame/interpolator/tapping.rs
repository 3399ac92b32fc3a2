//! Strokes of rigid taps: a barrier for the planner, an activity of spindle and tool together.

use feedwave_motion::Planned;

use super::functions::{FunctionActivity, FunctionBarrier, FunctionStep};
use super::{Activity, ActivityKind, After, Barrier, Interpolator, Rest, State};
use crate::functions::thread::TapRun;
use crate::shared::columns::{fill_axes, still};
use crate::shared::setpoint::SetpointBlock;
use crate::shared::track::Track;

impl Interpolator {
    /// The stroke that the tool is on.
    fn tap(&self) -> Option<&TapRun> {
        tap_on(&self.state.track)
    }

    /// Starts the stroke that the tool has come to; in feed hold it waits before it.
    pub(super) fn begin_tap(&mut self) {
        if self.state.feed_override == 0.0 {
            return self.hold_feed();
        }
        let Some(run) = self.tap() else { return };
        let duration_s = run.profile.duration();
        // The stroke itself turns the spindle.
        let kind = ActivityKind::Function(FunctionActivity::Tap);
        self.activate(kind, duration_s, 0.0, After::Function(FunctionStep::LeaveTap));
        self.state.functions.last_pass = self.state.activity.map(|stroke| (self.state.next, stroke.last));
    }

    pub(super) fn leave_tap(&mut self) {
        if let Some(run) = self.tap() {
            let (turn_rev, length_mm) = (run.turn_rev(), run.element.length);
            let rest = Rest::after(&run.element);
            self.state.spindle_rev += turn_rev;
            self.state.path_base_mm += length_mm;
            self.state.rest = rest;
        }
        self.state.track.advance(0.0);
    }

    /// Counts the time of a stroke.
    pub(super) fn share_tap(&mut self) {
        let State { track, shares, .. } = &mut self.state;
        if let Some(run) = tap_on(track) {
            shares.add_tap(run.profile);
        }
    }

    /// Setpoints of a stroke, `first` periods after its start.
    pub(super) fn emit_tap(&mut self, block: &mut SetpointBlock, start: usize, first: u64, activity: Activity) {
        let State { track, clock, next, path_base_mm, spindle_rev, .. } = &self.state;
        let Some(run) = tap_on(track) else { return };
        let count = block.len() - start;
        let (s, speed) = (&mut self.scratch.s[..count], &mut self.scratch.speed[..count]);
        run.profile.fill(first, self.settings.period_s, clock.lead_s, s, speed);
        let length_mm = run.element.length;
        for s in s.iter_mut() {
            *s = s.min(length_mm);
        }
        // A setpoint at the very instant of the end is the end.
        let is_at_end = activity.end.lead_s == 0.0 && next + count as u64 > activity.end.period;
        if let Some(last) = s.last_mut().filter(|_| is_at_end) {
            *last = length_mm;
        }
        for (row, (s, speed)) in s.iter().zip(&*speed).enumerate() {
            block.path_position_mm[start + row] = path_base_mm + s;
            block.feed_mm_per_min[start + row] = speed * 60.0;
            block.spindle_angle_deg[start + row] = (spindle_rev + run.rev_per_mm * s) * 360.0;
        }
        block.line[start..].fill(run.element.source.line);
        fill_axes(&self.settings.columns, self.settings.tool.as_ref(), &run.element, s, block, start);
        if let Some(servo) = &mut block.servo {
            still(servo, start);
        }
    }
}

/// The stroke that the tool is on.
fn tap_on(track: &Track<Barrier>) -> Option<&TapRun> {
    match track.current() {
        Some(Planned::Barrier(Barrier::Function(FunctionBarrier::Tap(run)))) => Some(run),
        _ => None,
    }
}
