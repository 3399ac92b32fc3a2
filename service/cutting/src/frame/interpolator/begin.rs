//! What begins next: a stretch of a motion, or what a barrier asks for.

use feedwave_motion::Planned;
use feedwave_program::{Axis, Spindle, SpindleDirection};

use super::{Activity, ActivityKind, After, Barrier, Interpolator};

const X: usize = Axis::X.index();

impl Interpolator {
    /// Takes the next item; `false` when it, or the path that the vibration may reach from it, is not there yet.
    pub(super) fn begin(&mut self) -> bool {
        self.state.track.leave_shown();
        let Some(item) = self.state.track.current() else { return false };
        if let (Some(index), Planned::Motion(motion)) = (self.state.resume, item) {
            if index >= motion.stretches.len() || !self.reach_is_known() {
                return false;
            }
            self.state.resume = None;
            self.begin_stretch(index);
            return true;
        }
        if let (Planned::Barrier(_), Some(examination)) = (item, &mut self.examination) {
            examination.slowdowns.interrupt();
        }
        match item {
            // Shown only.
            Planned::Motion(motion) if motion.stretches.is_empty() => return false,
            Planned::Motion(_) => {
                if !self.reach_is_known() {
                    return false;
                }
                self.begin_stretch(0);
            }
            Planned::Barrier(Barrier::Function(_)) => self.begin_function(),
            &Planned::Barrier(Barrier::Dwell { duration_s, line, x_offset_mm }) => {
                let rest = &self.state.rest;
                let shift_mm = x_offset_mm.map_or(0.0, |offset_mm| rest.work_offset[X] - offset_mm);
                let radius_mm = rest.position[X] + shift_mm;
                self.hold_at(radius_mm, ActivityKind::Hold { line }, duration_s, After::LeaveMotion);
            }
            Planned::Barrier(Barrier::Align) => self.align_then(After::LeaveMotion),
            &Planned::Barrier(Barrier::Spindle(spindle)) => {
                self.state.spindle = spindle;
                self.state.track.advance(self.state.functions.reach_back_mm());
            }
            Planned::Barrier(Barrier::End) => self.align_then(After::EndProgram),
        }
        true
    }

    pub(super) fn begin_stretch(&mut self, index: usize) {
        let state = &mut self.state;
        let Some(motion) = state.track.motion(state.track.current_index()) else { return };
        let stretch = &motion.stretches[index];
        let duration_s = stretch.profile.duration();
        let spindle_rev_per_s = signed(state.spindle, stretch.stretch.spindle_rev_per_s);
        self.activate(ActivityKind::Stretch(index), duration_s, spindle_rev_per_s, After::Continue);
    }

    pub(super) fn hold(&mut self, kind: ActivityKind, duration_s: f64, after: After) {
        self.hold_at(self.state.rest.position[X], kind, duration_s, after);
    }

    /// Rests where constant surface speed sees the tool at this radius.
    fn hold_at(&mut self, radius_mm: f64, kind: ActivityKind, duration_s: f64, after: After) {
        if let Some(examination) = &mut self.examination {
            examination.slowdowns.interrupt();
        }
        let spindle_rev_per_s = match kind {
            // The vibration's spindle speed is that of the stretch before.
            ActivityKind::VibratingHold | ActivityKind::FeedHold { .. } => {
                let last = self.last_motion().and_then(|motion| motion.stretches.last());
                last.map_or(0.0, |stretch| signed(self.state.spindle, stretch.stretch.spindle_rev_per_s))
            }
            _ => {
                let rev_per_s = self.state.spindle.rev_per_s(radius_mm).min(self.settings.top_rev_per_s);
                signed(self.state.spindle, rev_per_s)
            }
        };
        self.activate(kind, duration_s, spindle_rev_per_s, after);
    }

    /// Rests up to the next grid instant, whose setpoint is the exact resting point.
    pub(super) fn align_then(&mut self, after: After) {
        let line = self.state.rest.line;
        self.align(ActivityKind::Hold { line }, after);
    }

    pub(super) fn align(&mut self, kind: ActivityKind, after: After) {
        let wait_s = self.state.clock.to_alignment_s(self.settings.period_s);
        self.hold(kind, wait_s, after);
        if let Some(activity) = &mut self.state.activity {
            activity.end = self.state.clock.aligned();
            activity.last = activity.end.period;
        }
    }

    pub(super) fn activate(&mut self, kind: ActivityKind, duration_s: f64, spindle_rev_per_s: f64, after: After) {
        let end = self.state.clock.advanced(duration_s, self.settings.period_s);
        self.state.after = after;
        let (last, feed_override) = (end.period, self.state.feed_override);
        self.state.activity = Some(Activity { kind, spindle_rev_per_s, end, last, duration_s, feed_override });
    }
}

fn signed(spindle: Spindle, rev_per_s: f64) -> f64 {
    match spindle.direction {
        SpindleDirection::Stopped => 0.0,
        SpindleDirection::Clockwise => rev_per_s,
        SpindleDirection::CounterClockwise => -rev_per_s,
    }
}
