//! Threading passes: a barrier for the planner, an activity whose variable is the spindle angle.
//!
//! First X moves to the vibration position where the start-up asks for it; then one activity waits for the thread-start
//! reference point and runs the pass, both of which are one function of the spindle angle.

use feedwave_motion::{PhaseTimes, Planned, Profile, ProfilePart};
use feedwave_program::{Axis, Position, SpindleDirection};
use serde::{Deserialize, Serialize};

use super::{PathColumns, ThreadPath};
use crate::SetpointBlock;
use crate::frame::interpolator::columns::{Scratch, still};
use crate::frame::interpolator::{Activity, ActivityKind, After, Barrier, Interpolator, Rest, TimeShares};

/// A pass to run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ThreadRun {
    pub(crate) path: ThreadPath,
    /// Where it ends, to the bit.
    pub(crate) end: Position,
    pub(crate) work_offset: Position,
    /// Movement of X to the vibration position, where it is done here.
    pub(crate) preparation: Option<Profile>,
    /// Sign of X in which the tool retreats.
    pub(crate) outwards: f64,
    /// Spindle angle of the thread-start reference point, revolutions.
    pub(crate) reference_rev: f64,
    /// Spindle speed without its sense, rev/s.
    pub(crate) rev_per_s: f64,
    /// First source line.
    pub(crate) line: u32,
}

impl TimeShares {
    /// The part of a pass in which the lead axis moves is cutting, the waits before and after are rest.
    fn add_pass(&mut self, run: &ThreadRun, duration_s: f64) {
        let s_per_deg = 1.0 / (360.0 * run.rev_per_s);
        let lead_s = ((run.path.lead_end_deg() - run.path.lead_start_deg()) * s_per_deg).min(duration_s);
        let changing_s = (run.path.changing_deg() * s_per_deg).min(lead_s);
        self.cutting_s += lead_s;
        self.limits.acceleration_s += changing_s;
        self.limits.feed_s += lead_s - changing_s;
        self.limits.rest_s += duration_s - lead_s;
    }

    fn add_preparation(&mut self, profile: Profile) {
        let PhaseTimes { jerk_s, acceleration_s, cruise_s } =
            ProfilePart::new(profile, 0.0, profile.length()).phase_times();
        self.rapid_s += profile.duration();
        self.limits.jerk_s += jerk_s;
        self.limits.acceleration_s += acceleration_s;
        self.limits.axis_velocity_s += cruise_s;
    }
}

impl Interpolator {
    /// The pass that the tool is on.
    fn thread(&self) -> Option<&ThreadRun> {
        match self.state.track.current() {
            Some(Planned::Barrier(Barrier::Thread(run))) => Some(run),
            _ => None,
        }
    }

    /// Starts the pass that the tool has come to; in feed hold it waits before it.
    pub(crate) fn begin_thread(&mut self) {
        if self.state.feed_override == 0.0 {
            let next = self.state.next;
            let until = self.state.pause.unwrap_or(next + crate::BLOCK_LENGTH as u64);
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
    pub(crate) fn run_thread(&mut self) {
        let Some(run) = self.thread() else { return };
        let forwards = match self.state.spindle.direction {
            SpindleDirection::CounterClockwise => -1.0,
            SpindleDirection::Clockwise | SpindleDirection::Stopped => 1.0,
        };
        // The next passage of the reference point, this very instant included.
        let past_rev = forwards * (self.state.spindle_rev - run.reference_rev);
        let start_deg = 360.0 * (past_rev - past_rev.ceil());
        let duration_s = (run.path.rest_deg() - start_deg) / (360.0 * run.rev_per_s);
        let spindle_rev_per_s = forwards * run.rev_per_s;
        self.activate(ActivityKind::Thread { start_deg }, duration_s, spindle_rev_per_s, After::LeaveThread);
        self.state.last_pass = self.state.activity.map(|pass| (self.state.next, pass.last));
    }

    pub(crate) fn leave_thread(&mut self) {
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
    pub(crate) fn share_thread(&mut self, activity: Activity) {
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
    pub(crate) fn emit_preparation(&mut self, block: &mut SetpointBlock, start: usize, first: u64, line: u32) {
        self.emit_rest(block, start, line);
        let Some(Planned::Barrier(Barrier::Thread(run))) = self.state.track.current() else { return };
        let Some(profile) = run.preparation else { return };
        let count = block.len() - start;
        let Scratch { s, speed, .. } = &mut self.scratch;
        let (s, speed) = (&mut s[..count], &mut speed[..count]);
        profile.fill(first, self.settings.period_s, self.state.clock.lead_s, s, speed);
        for retreat_mm in s.iter_mut() {
            *retreat_mm = retreat_mm.min(profile.length());
        }
        block.vibration_offset_mm[start..].copy_from_slice(s);
        let rest = &self.state.rest;
        let columns = self.settings.columns.iter().zip(&mut block.axes).filter(|(map, _)| map.axis == Axis::X);
        for (map, column) in columns {
            for (value, retreat_mm) in column[start..].iter_mut().zip(&*s) {
                *value = rest.position[Axis::X.index()] + run.outwards * retreat_mm;
            }
            map.apply(&rest.work_offset, &mut column[start..]);
        }
    }

    /// Setpoints of a pass, from its spindle angles in the scratch.
    pub(crate) fn emit_thread(&mut self, block: &mut SetpointBlock, start: usize, turned_rev: impl Fn(usize) -> f64) {
        let Some(Planned::Barrier(Barrier::Thread(run))) = self.state.track.current() else { return };
        let Some(Activity { kind: ActivityKind::Thread { start_deg }, .. }) = self.state.activity else { return };
        let count = block.len() - start;
        let Scratch { s, speed, vibration, combined, .. } = &mut self.scratch;
        for (k, angle_deg) in s[..count].iter_mut().enumerate() {
            *angle_deg = start_deg + 360.0 * turned_rev(k);
        }
        let (x, z) = (&mut vibration[..count], &mut combined[..count]);
        run.path.fill(
            &s[..count],
            PathColumns {
                x,
                z,
                path_mm: &mut block.path_position_mm[start..],
                speed: &mut speed[..count],
                retreat_mm: &mut block.vibration_offset_mm[start..],
                line: &mut block.line[start..],
            },
        );
        for path_mm in &mut block.path_position_mm[start..] {
            *path_mm += self.state.path_base_mm;
        }
        let mm_per_min = 360.0 * 60.0 * run.rev_per_s;
        for (feed, mm_per_deg) in block.feed_mm_per_min[start..].iter_mut().zip(&*speed) {
            *feed = mm_per_deg * mm_per_min;
        }
        for (map, column) in self.settings.columns.iter().zip(&mut block.axes) {
            let column = &mut column[start..];
            match map.axis {
                Axis::X => column.copy_from_slice(x),
                Axis::Z => column.copy_from_slice(z),
                other => column.fill(run.end[other.index()]),
            }
            map.apply(&run.work_offset, column);
        }
        if let Some(servo) = &mut block.servo {
            still(servo, start);
        }
    }
}
