//! The interpolator: planned motions and barriers in, setpoints at every interpolation period out.
//!
//! It runs along the [`Track`] in activities (a planned stretch, or a hold), each of which starts at an exact
//! instant and covers the grid periods up to its end; what is left of a period is carried into the next
//! activity. Starts and ends of vibrating sections, ends of oscillating ones and the end of the program are aligned
//! to the grid, so that the exact end point is a setpoint. A sample is a function of its index and the activity only, never of where
//! a block or a stream began.

mod barrier;
mod begin;
mod clock;
mod columns;
mod examination;
mod feed_override;
mod functions;
mod tapping;
mod threading;
mod time_shares;
mod vibrating;

use std::sync::Arc;

use feedwave_motion::kinematics::vector::Vec3;
use feedwave_motion::kinematics::{Kinematics, Setup};
use feedwave_motion::{Machine, Planned, PlannedMotion};
use feedwave_program::{Position, Spindle};
use serde::{Deserialize, Serialize};

pub(crate) use self::barrier::Barrier;
use self::clock::Clock;
use self::columns::Scratch;
pub(crate) use self::examination::Examination;
use self::functions::{FunctionActivity, FunctionStep, RunningFunctions};
use self::time_shares::TimeShares;
use crate::functions::path_vibration::{GenerationMode, SectionSamples};
use crate::shared::columns::{ColumnMap, ToolColumns};
use crate::shared::setpoint::{Frame, SetpointBlock};
use crate::shared::track::Track;

/// What a call to [`Interpolator::fill`] brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fill {
    /// The block is full.
    Full,
    /// More planned items are needed.
    Starved,
    /// A vibrating section ended: [`Interpolator::take_finished_section`].
    SectionEnded,
    /// The program's last setpoint was delivered.
    Ended,
    /// The setpoint of [`Interpolator::pause_at`] is next.
    Paused,
}

/// A running interpolator.
#[derive(Clone, Debug)]
pub(crate) struct Interpolator {
    settings: Settings,
    pub(crate) state: State,
    scratch: Scratch,
    /// For a report of the whole program; while validating only.
    pub(crate) examination: Option<Box<Examination>>,
}

#[derive(Clone, Debug)]
struct Settings {
    period_s: f64,
    mode: GenerationMode,
    columns: Vec<ColumnMap>,
    /// Where the direction of the tool is asked for.
    tool: Option<ToolColumns>,
    /// Highest spindle speed of the machine, rev/s.
    top_rev_per_s: f64,
}

/// Everything that changes while interpolating; a snapshot of it continues bit for bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct State {
    track: Track<Barrier>,
    /// Index of the next setpoint.
    next: u64,
    /// Start of the present activity, or of the next one between activities.
    clock: Clock,
    activity: Option<Activity>,
    after: After,
    functions: RunningFunctions,
    rest: Rest,
    spindle: Spindle,
    /// Spindle angle at `clock`, revolutions, signed.
    spindle_rev: f64,
    /// Path length up to the start of the current element, mm.
    path_base_mm: f64,
    shares: TimeShares,
    /// Ratio of the feed override that the next activity is planned at.
    feed_override: f64,
    /// The stretch of the current motion that is waited for: the feed override has divided the motion there.
    resume: Option<usize>,
    /// Index before whose setpoint the feed override changes.
    pause: Option<u64>,
    ended: bool,
}

/// What is being interpolated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Activity {
    kind: ActivityKind,
    /// Signed spindle speed, rev/s.
    spindle_rev_per_s: f64,
    /// Where the activity ends.
    end: Clock,
    /// Index of its last setpoint; none is left when it lies before the next index.
    last: u64,
    duration_s: f64,
    /// Ratio of the feed override that it is planned at.
    feed_override: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
enum ActivityKind {
    /// This stretch of the current motion.
    Stretch(usize),
    /// At rest at the end of the current motion while the section vibrates on.
    VibratingHold,
    /// At rest.
    Hold { line: u32 },
    /// Of a function's own.
    Function(FunctionActivity),
    /// At rest within the current motion, at arc length `s` mm: feed hold.
    FeedHold { s: f64 },
}

/// What comes when the present activity has ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
enum After {
    /// The next stretch, or the next item.
    Continue,
    /// The next item; a wait for the vibration at a junction is over.
    LeaveMotion,
    /// What the function does that asked for the activity.
    Function(FunctionStep),
    /// Nothing: the last setpoint was given.
    EndProgram,
}

/// Position of the tool between motions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Rest {
    position: Position,
    work_offset: Position,
    line: u32,
    /// Centre point of a guided tool, work coordinates, mm, and what it was guided with.
    tool: Option<(Vec3, Setup)>,
}

impl Interpolator {
    /// An interpolator at index 0, at rest at `position` (work coordinates of `work_offset`).
    pub(crate) fn new(
        machine: &Machine,
        period_s: f64,
        mode: GenerationMode,
        frame: Frame,
        position: Position,
        work_offset: Position,
    ) -> Self {
        let state = State {
            track: Track::default(),
            next: 0,
            clock: Clock::default(),
            // The first setpoint is the start position at time 0.
            activity: Some(Activity {
                kind: ActivityKind::Hold { line: 0 },
                spindle_rev_per_s: 0.0,
                end: Clock::default(),
                last: 0,
                duration_s: 0.0,
                feed_override: 1.0,
            }),
            after: After::Continue,
            functions: RunningFunctions::default(),
            rest: Rest { position, work_offset, line: 0, tool: None },
            spindle: Spindle::STOPPED,
            spindle_rev: 0.0,
            path_base_mm: 0.0,
            shares: TimeShares::default(),
            feed_override: 1.0,
            resume: None,
            pause: None,
            ended: false,
        };
        let columns = ColumnMap::of(machine, frame);
        let top_rev_per_s = machine.max_spindle_rev_per_min / 60.0;
        Self {
            settings: Settings { period_s, mode, columns, tool: None, top_rev_per_s },
            state,
            scratch: Scratch::new(),
            examination: None,
        }
    }

    /// Shows the direction of the tool, as far as the machine has the axes.
    pub(crate) fn with_tool_direction(mut self, machine: &Machine, kinematics: &Arc<Kinematics>) -> Self {
        self.settings.tool = ToolColumns::of(machine, kinematics);
        if let Some(tool) = &self.settings.tool {
            tool.settle(&mut self.settings.columns);
        }
        self
    }

    pub(crate) const fn shows_tool_direction(&self) -> bool {
        self.settings.tool.is_some()
    }

    pub(crate) fn state(&self) -> &State {
        &self.state
    }

    /// Index of the next setpoint.
    pub(crate) fn next_index(&self) -> u64 {
        self.state.next
    }

    /// Time of everything interpolated so far, s.
    pub(crate) fn elapsed_s(&self) -> f64 {
        self.state.clock.since_s(0, self.settings.period_s)
    }

    /// Says that what follows the present activity is planned at this feed override.
    pub(crate) fn follow_override(&mut self, ratio: f64) {
        self.state.feed_override = ratio;
    }

    pub(crate) fn last_thread_pass(&self) -> Option<(u64, u64)> {
        self.state.functions.last_pass
    }

    pub(crate) fn shares(&self) -> TimeShares {
        self.state.shares
    }

    /// The samples of a section that ended since the last call.
    pub(crate) fn take_finished_section(&mut self) -> Option<SectionSamples> {
        self.state.functions.finished_section.take()
    }

    /// Goes on from this state.
    pub(crate) fn restore(&mut self, state: State) {
        self.state = state;
        self.state.track.count_bytes();
    }

    /// Planned items held: those within one amplitude of the tool.
    pub(crate) fn held_items(&self) -> usize {
        self.state.track.len()
    }

    /// Memory that they take at the most, bytes.
    pub(crate) fn held_bytes(&self) -> usize {
        self.state.track.bytes()
    }

    /// Source line of the item that the tool is on or waits for.
    pub(crate) fn line(&self) -> u32 {
        self.last_motion().map_or(self.state.rest.line, |motion| motion.element.source.line)
    }

    pub(crate) fn push(&mut self, item: Planned<Barrier>) {
        match &item {
            Planned::Motion(motion) if motion.goes_on() => self.state.track.extend_last(&motion.stretches),
            _ => self.state.track.push(item),
        }
    }

    /// Adds setpoints to `block` until it has `most`, items are missing, a section has ended
    /// or the program has.
    pub(crate) fn fill(&mut self, block: &mut SetpointBlock, most: usize) -> Fill {
        while block.len() < most {
            if self.state.ended {
                return Fill::Ended;
            }
            match self.state.activity {
                Some(activity) if self.state.next <= activity.last => {
                    if self.state.pause == Some(self.state.next) {
                        return Fill::Paused;
                    }
                    // A change of the feed override takes back what lies ahead, under an activity that is not over.
                    if !self.reach_is_known() {
                        return Fill::Starved;
                    }
                    self.emit(block, activity, most - block.len());
                }
                Some(activity) => {
                    self.complete(activity);
                    if self.state.functions.finished_section.is_some() {
                        return Fill::SectionEnded;
                    }
                }
                None => {
                    if !self.begin() {
                        return Fill::Starved;
                    }
                }
            }
        }
        Fill::Full
    }

    /// Ends an activity and does what comes after it.
    fn complete(&mut self, activity: Activity) {
        let state = &mut self.state;
        state.activity = None;
        state.spindle_rev += activity.spindle_rev_per_s * activity.duration_s;
        state.clock = activity.end;
        match activity.kind {
            ActivityKind::Stretch(index) => {
                if let Some(motion) = state.track.motion(state.track.current_index()) {
                    state.shares.add_stretch(motion, index, activity.duration_s, activity.feed_override);
                    if let Some(examination) = &mut self.examination {
                        examination.stretch(motion, index, activity.feed_override);
                    }
                }
            }
            ActivityKind::Hold { .. } | ActivityKind::VibratingHold | ActivityKind::FeedHold { .. } => {
                state.shares.limits.rest_s += activity.duration_s;
            }
            ActivityKind::Function(kind) => self.share_function(activity, kind),
        }
        match std::mem::replace(&mut self.state.after, After::Continue) {
            After::Continue => {
                if let ActivityKind::Stretch(index) = activity.kind {
                    self.after_stretch(index);
                }
            }
            After::LeaveMotion => self.leave_motion(),
            After::Function(step) => self.carry_out(step),
            After::EndProgram => self.state.ended = true,
        }
    }

    fn after_stretch(&mut self, index: usize) {
        let state = &self.state;
        let Some(motion) = state.track.motion(state.track.current_index()) else { return };
        if index + 1 < motion.stretches.len() {
            self.begin_stretch(index + 1);
            return;
        }
        if motion.stretches.last().is_some_and(|last| last.stretch.end < motion.element.length) {
            self.state.resume = Some(index + 1);
            return;
        }
        self.leave_motion();
    }

    fn leave_motion(&mut self) {
        let state = &mut self.state;
        if let Some(motion) = state.track.motion(state.track.current_index()) {
            state.path_base_mm += motion.element.length;
            state.rest = Rest::after(&motion.element);
        }
        state.track.advance(state.functions.reach_back_mm());
    }

    /// Whether the path is known as far ahead as the functions need it from here.
    pub(crate) fn reach_is_known(&self) -> bool {
        self.state.functions.know_path(&self.state.track)
    }

    /// The motion the tool is on, or the one before a barrier.
    fn last_motion(&self) -> Option<&PlannedMotion> {
        self.last_motion_index().and_then(|item| self.state.track.motion(item))
    }

    fn last_motion_index(&self) -> Option<usize> {
        (0..=self.state.track.current_index()).rev().find(|&item| self.state.track.motion(item).is_some())
    }
}
