//! Threading passes: a barrier for the planner, an activity whose variable is the spindle angle.
//!
//! First X moves to the vibration position where the start-up asks for it; then one activity waits for the thread-start
//! reference point and runs the pass, both of which are one function of the spindle angle.

use feedwave_motion::Planned;
use feedwave_program::SpindleDirection;

use super::functions::{FunctionActivity, FunctionBarrier, FunctionStep};
use super::{Activity, ActivityKind, After, Barrier, Interpolator, Rest, State};
use crate::functions::thread::{ThreadRun, ThreadScratch};
use crate::shared::setpoint::SetpointBlock;
use crate::shared::track::Track;

impl Interpolator {
    /// The pass that the tool is on.
    fn thread(&self) -> Option<&ThreadRun> {
        pass_on(&self.state.track)
    }

    /// Starts the pass that the tool has come to; in feed hold it waits before it.
    pub(super) fn begin_thread(&mut self) {
        if self.state.feed_override == 0.0 {
            return self.hold_feed();
        }
        let Some(run) = self.thread() else { return };
        match run.preparation {
            Some(profile) => {
                let (line, duration_s) = (run.line, profile.duration());
                let kind = ActivityKind::Function(FunctionActivity::ThreadPreparation { line });
                self.hold(kind, duration_s, After::Function(FunctionStep::RunThread));
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
        let kind = ActivityKind::Function(FunctionActivity::Thread { start_deg });
        self.activate(kind, duration_s, spindle_rev_per_s, After::Function(FunctionStep::LeaveThread));
        self.state.functions.last_pass = self.state.activity.map(|pass| (self.state.next, pass.last));
    }

    pub(super) fn leave_thread(&mut self) {
        if let Some(run) = self.thread() {
            let tool = run.frame.as_ref().map(|frame| (frame.end().tip_mm, *frame.setup()));
            let rest = Rest { position: run.end, work_offset: run.work_offset, line: self.thread_end_line(), tool };
            let length_mm = run.path.length_mm();
            self.state.path_base_mm += length_mm;
            self.state.rest = rest;
        }
        self.state.track.advance(0.0);
    }

    fn thread_end_line(&self) -> u32 {
        self.thread().map_or(0, |run| run.path.last_line())
    }

    /// Counts the time of the preparatory movement.
    pub(super) fn share_preparation(&mut self) {
        if let Some(profile) = self.thread().and_then(|run| run.preparation) {
            self.state.shares.add_preparation(profile);
        }
    }

    /// Counts the time of a pass.
    pub(super) fn share_pass(&mut self, duration_s: f64) {
        let State { track, shares, .. } = &mut self.state;
        if let Some(run) = pass_on(track) {
            shares.add_pass(run, duration_s);
        }
    }

    /// Setpoints of the preparatory movement: X goes from where it rests to the vibration position.
    pub(super) fn emit_preparation(&mut self, block: &mut SetpointBlock, start: usize, first: u64, line: u32) {
        self.emit_rest(block, start, line);
        let State { track, rest, clock, .. } = &self.state;
        let Some(run) = pass_on(track) else { return };
        let Some(profile) = run.preparation else { return };
        let count = block.len() - start;
        let (s, speed) = (&mut self.scratch.s[..count], &mut self.scratch.speed[..count]);
        profile.fill(first, self.settings.period_s, clock.lead_s, s, speed);
        for retreat_mm in s.iter_mut() {
            *retreat_mm = retreat_mm.min(profile.length());
        }
        run.fill_preparation(&self.settings.columns, (&rest.position, &rest.work_offset), s, block, start);
    }

    /// Setpoints of a pass, `first` periods after its start at the angle `start_deg`.
    pub(super) fn emit_thread(
        &mut self,
        block: &mut SetpointBlock,
        start: usize,
        first: u64,
        activity: Activity,
        start_deg: f64,
    ) {
        let State { track, clock, path_base_mm, .. } = &self.state;
        let Some(run) = pass_on(track) else { return };
        let (lead_s, period_s, rev_per_s) = (clock.lead_s, self.settings.period_s, activity.spindle_rev_per_s.abs());
        let first = first as f64;
        let angles_deg = &mut self.scratch.s[..block.len() - start];
        for (k, angle_deg) in (0..angles_deg.len()).zip(angles_deg.iter_mut()) {
            let turned_rev = rev_per_s * ((first + k as f64) * period_s - lead_s);
            *angle_deg = start_deg + 360.0 * turned_rev;
        }
        let scratch = self.scratch.functions.thread.get_or_insert_with(ThreadScratch::new);
        run.fill(&self.settings.columns, angles_deg, *path_base_mm, scratch, block, start);
        if let Some(tool) = &self.settings.tool {
            let setup = run.frame.as_ref().map(|frame| frame.setup());
            tool.fill(block, start..block.len(), &run.work_offset, setup);
        }
    }
}

/// The pass that the tool is on.
fn pass_on(track: &Track<Barrier>) -> Option<&ThreadRun> {
    match track.current() {
        Some(Planned::Barrier(Barrier::Function(FunctionBarrier::Thread(run)))) => Some(run),
        _ => None,
    }
}
