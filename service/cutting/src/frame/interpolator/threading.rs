//! Threading passes: a barrier for the planner, an activity whose variable is the spindle angle.
//!
//! First X moves to the vibration position where the start-up asks for it; then one activity waits for the thread-start
//! reference point and runs the pass, both of which are one function of the spindle angle.

use feedwave_motion::Planned;
use feedwave_program::SpindleDirection;

use super::{Activity, ActivityKind, After, Barrier, Interpolator, Rest, State};
use crate::functions::thread::{ThreadRun, ThreadScratch};
use crate::shared::setpoint::{BLOCK_LENGTH, SetpointBlock};

impl Interpolator {
    /// The pass that the tool is on.
    fn thread(&self) -> Option<&ThreadRun> {
        match self.state.track.current() {
            Some(Planned::Barrier(Barrier::Thread(run))) => Some(run),
            _ => None,
        }
    }

    /// Starts the pass that the tool has come to; in feed hold it waits before it.
    pub(super) fn begin_thread(&mut self) {
        if self.state.feed_override == 0.0 {
            let next = self.state.next;
            let until = self.state.pause.unwrap_or(next + BLOCK_LENGTH as u64);
            return self.hold_feed(until.max(next));
        }
        let Some(run) = self.thread() else { return };
        match run.preparation {
            Some(profile) => {
                let (line, duration_s) = (run.line, profile.duration());
                self.hold(ActivityKind::ThreadPreparation { line }, duration_s, After::RunThread);
            }
            None => self.run_thread(),
        }
    }

    /// Waits for the reference point and runs the pass.
    pub(super) fn run_thread(&mut self) {
        let Some(run) = self.thread() else { return };
        let forwards = match self.state.spindle.direction {
            SpindleDirection::CounterClockwise => -1.0,
            SpindleDirection::Clockwise | SpindleDirection::Stopped => 1.0,
        };
        let (start_deg, duration_s) = run.next_passage(self.state.spindle_rev, forwards);
        let spindle_rev_per_s = forwards * run.rev_per_s;
        self.activate(ActivityKind::Thread { start_deg }, duration_s, spindle_rev_per_s, After::LeaveThread);
        self.state.last_pass = self.state.activity.map(|pass| (self.state.next, pass.last));
    }

    pub(super) fn leave_thread(&mut self) {
        if let Some(run) = self.thread() {
            let rest =
                Rest { position: run.end, work_offset: run.work_offset, line: self.thread_end_line(), tool: None };
            let length_mm = run.path.length_mm();
            self.state.path_base_mm += length_mm;
            self.state.rest = rest;
        }
        self.state.track.advance(0.0);
    }

    fn thread_end_line(&self) -> u32 {
        self.thread().map_or(0, |run| run.path.last_line())
    }

    /// Counts the time of a pass or its preparation.
    pub(super) fn share_thread(&mut self, activity: Activity) {
        let Some(Planned::Barrier(Barrier::Thread(run))) = self.state.track.current() else { return };
        match activity.kind {
            ActivityKind::ThreadPreparation { .. } => {
                if let Some(profile) = run.preparation {
                    self.state.shares.add_preparation(profile);
                }
            }
            _ => self.state.shares.add_pass(run, activity.duration_s),
        }
    }

    /// Setpoints of the preparatory movement: X goes from where it rests to the vibration position.
    pub(super) fn emit_preparation(&mut self, block: &mut SetpointBlock, start: usize, first: u64, line: u32) {
        self.emit_rest(block, start, line);
        let State { track, rest, clock, .. } = &self.state;
        let Some(Planned::Barrier(Barrier::Thread(run))) = track.current() else { return };
        let Some(profile) = run.preparation else { return };
        let count = block.len() - start;
        let (s, speed) = (&mut self.scratch.s[..count], &mut self.scratch.speed[..count]);
        profile.fill(first, self.settings.period_s, clock.lead_s, s, speed);
        for retreat_mm in s.iter_mut() {
            *retreat_mm = retreat_mm.min(profile.length());
        }
        run.fill_preparation(&self.settings.columns, (&rest.position, &rest.work_offset), s, block, start);
    }

    /// Setpoints of a pass; `turned_rev` is the spindle's turn since the activity began.
    pub(super) fn emit_thread(&mut self, block: &mut SetpointBlock, start: usize, turned_rev: impl Fn(usize) -> f64) {
        let State { track, activity, path_base_mm, .. } = &self.state;
        let Some(Planned::Barrier(Barrier::Thread(run))) = track.current() else { return };
        let Some(Activity { kind: ActivityKind::Thread { start_deg }, .. }) = *activity else { return };
        let angles_deg = &mut self.scratch.s[..block.len() - start];
        for (k, angle_deg) in angles_deg.iter_mut().enumerate() {
            *angle_deg = start_deg + 360.0 * turned_rev(k);
        }
        let scratch = self.scratch.thread.get_or_insert_with(ThreadScratch::new);
        run.fill(&self.settings.columns, angles_deg, *path_base_mm, scratch, block, start);
    }
}
