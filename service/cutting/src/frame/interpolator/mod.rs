//! The interpolator: planned motions and barriers in, setpoints at every interpolation period out.
//!
//! It runs along the [`Track`] in activities (a planned stretch, or a hold), each of which starts at an exact
//! instant and covers the grid periods up to its end; what is left of a period is carried into the next
//! activity. Starts and ends of vibrating sections, ends of oscillating ones and the end of the program are aligned
//! to the grid, so that the exact end point is a setpoint. A sample is a function of its index and the activity only, never of where
//! a block or a stream began.

mod clock;
pub(crate) mod columns;
mod feed_override;
mod track;

use feedwave_motion::kinematics::vector::Vec3;
use feedwave_motion::kinematics::{Kinematics, Setup};
use feedwave_motion::{Curve, Machine, PhaseTimes, Planned, PlannedMotion, PlannedStretch};
use feedwave_program::{Position, Spindle, SpindleDirection};
use serde::{Deserialize, Serialize};

use self::clock::Clock;
use self::columns::{ColumnMap, Scratch, ToolColumns};
use self::track::Track;
pub(crate) use self::track::{Barrier, SectionPart, SectionStart};
use crate::functions::path_vibration::Amplitude;
use crate::functions::tool_oscillation::OscillationRun;
use crate::{Frame, GenerationMode, LimitTimes, SetpointBlock, sin_turns};

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

/// Where the time of a program goes, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct TimeShares {
    pub(crate) cutting_s: f64,
    pub(crate) rapid_s: f64,
    /// The same time, and that at rest, by what governs it.
    pub(crate) limits: LimitTimes,
}

/// A cruise within this share of a speed is at that speed.
const SAME_SPEED: f64 = 1e-9;
/// A cruise this short is what rounding leaves between two ramps, s.
const ROUNDING_S: f64 = 1e-12;

impl TimeShares {
    fn add_stretch(&mut self, motion: &PlannedMotion, index: usize, duration_s: f64, feed_override: f64) {
        let element = &motion.element;
        *(if element.rapid { &mut self.rapid_s } else { &mut self.cutting_s }) += duration_s;
        let Some(PlannedStretch { stretch, profile, .. }) = motion.stretches.get(index) else { return };
        let PhaseTimes { jerk_s, acceleration_s, cruise_s } = profile.phase_times();
        self.limits.jerk_s += jerk_s;
        self.limits.acceleration_s += acceleration_s;
        let ratio = if motion.follows_override() { feed_override } else { 1.0 };
        let reached = profile.whole().cruise_velocity() * (1.0 + SAME_SPEED);
        let limits = &mut self.limits;
        let governed_s = match element.curve {
            _ if cruise_s <= ROUNDING_S => &mut limits.jerk_s,
            _ if !element.rapid && reached >= stretch.speed_mm_per_s * ratio => &mut limits.feed_s,
            _ if reached < stretch.limits.velocity => &mut limits.corners_s,
            Curve::Line => &mut limits.axis_velocity_s,
            Curve::Arc(_) | Curve::Spline(_) | Curve::FiveAxis(_) => &mut limits.curvature_s,
        };
        *governed_s += cruise_s;
    }
}

/// Samples of one vibrating section.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SectionSamples {
    pub(crate) total: u64,
    pub(crate) clamped: u64,
}

/// A running interpolator.
#[derive(Clone, Debug)]
pub(crate) struct Interpolator {
    pub(crate) settings: Settings,
    pub(crate) state: State,
    pub(crate) scratch: Scratch,
}

#[derive(Clone, Debug)]
pub(crate) struct Settings {
    pub(crate) period_s: f64,
    pub(crate) mode: GenerationMode,
    pub(crate) columns: Vec<ColumnMap>,
    /// Where the direction of the tool is asked for.
    pub(crate) tool: Option<ToolColumns>,
    /// Highest spindle speed of the machine, rev/s.
    pub(crate) top_rev_per_s: f64,
}

/// Everything that changes while interpolating; a snapshot of it continues bit for bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct State {
    pub(crate) track: Track,
    /// Index of the next setpoint.
    pub(crate) next: u64,
    /// Start of the present activity, or of the next one between activities.
    pub(crate) clock: Clock,
    pub(crate) activity: Option<Activity>,
    pub(crate) after: After,
    pub(crate) section: Option<Section>,
    pub(crate) amplitude: Amplitude,
    pub(crate) oscillation: Option<Box<OscillationRun>>,
    pub(crate) rest: Rest,
    pub(crate) spindle: Spindle,
    /// Spindle angle at `clock`, revolutions, signed.
    pub(crate) spindle_rev: f64,
    /// Path length up to the start of the current element, mm.
    pub(crate) path_base_mm: f64,
    pub(crate) shares: TimeShares,
    /// Ratio of the feed override that the next activity is planned at.
    pub(crate) feed_override: f64,
    pub(crate) finished_section: Option<SectionSamples>,
    /// The stretch of the current motion that is waited for: the feed override has divided the motion there.
    pub(crate) resume: Option<usize>,
    /// Index before whose setpoint the feed override changes.
    pub(crate) pause: Option<u64>,
    pub(crate) ended: bool,
    /// First and last setpoint of the threading pass begun last.
    pub(crate) last_pass: Option<(u64, u64)>,
}

/// What is being interpolated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Activity {
    pub(crate) kind: ActivityKind,
    /// Signed spindle speed, rev/s.
    pub(crate) spindle_rev_per_s: f64,
    /// Where the activity ends.
    pub(crate) end: Clock,
    /// Index of its last setpoint; none is left when it lies before the next index.
    pub(crate) last: u64,
    pub(crate) duration_s: f64,
    /// Ratio of the feed override that it is planned at.
    pub(crate) feed_override: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum ActivityKind {
    /// This stretch of the current motion.
    Stretch(usize),
    /// At rest at the end of the current motion while the section vibrates on.
    VibratingHold,
    /// At rest.
    Hold { line: u32 },
    /// X moving to the vibration position of the current pass.
    ThreadPreparation { line: u32 },
    /// The current pass, from this spindle angle to the reference point on, degrees in the direction of rotation.
    Thread { start_deg: f64 },
    /// At rest within the current motion, at arc length `s` mm: feed hold.
    FeedHold { s: f64 },
}

/// What comes when the present activity has ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum After {
    /// The next stretch, or the next item.
    Continue,
    /// The next item; a wait for the vibration at a junction is over.
    LeaveMotion,
    /// The pass whose preparatory movement is done.
    RunThread,
    /// The next item; the pass is over.
    LeaveThread,
    /// The section starts.
    OpenSection(SectionStart),
    /// The wait for the vibration is over: align to the grid.
    SettleSection,
    /// The section is over.
    CloseSection,
    /// The oscillating section is over.
    CloseOscillation,
    /// Nothing: the last setpoint was given.
    EndProgram,
}

/// A running vibrating section.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Section {
    pub(crate) start_period: u64,
    pub(crate) condition: SectionStart,
    pub(crate) part: SectionPart,
    /// Path length of the parts before the present one, and with the present one once it has ended, mm.
    pub(crate) before_mm: f64,
    pub(crate) ended_mm: f64,
    pub(crate) samples: SectionSamples,
}

/// Position of the tool between motions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Rest {
    pub(crate) position: Position,
    pub(crate) work_offset: Position,
    pub(crate) line: u32,
    /// Centre point of a guided tool, work coordinates, mm, and what it was guided with.
    pub(crate) tool: Option<(Vec3, Setup)>,
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
            section: None,
            amplitude: Amplitude::default(),
            oscillation: None,
            rest: Rest { position, work_offset, line: 0, tool: None },
            spindle: Spindle::STOPPED,
            spindle_rev: 0.0,
            path_base_mm: 0.0,
            shares: TimeShares::default(),
            feed_override: 1.0,
            finished_section: None,
            resume: None,
            pause: None,
            ended: false,
            last_pass: None,
        };
        let columns = ColumnMap::of(machine, frame);
        let top_rev_per_s = machine.max_spindle_rev_per_min / 60.0;
        Self {
            settings: Settings { period_s, mode, columns, tool: None, top_rev_per_s },
            state,
            scratch: Scratch::new(),
        }
    }

    /// Shows the direction of the tool, as far as the machine has the axes.
    pub(crate) fn with_tool_direction(mut self, machine: &Machine, kinematics: &Kinematics) -> Self {
        self.settings.tool = ToolColumns::of(machine, kinematics);
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
        self.state.last_pass
    }

    pub(crate) fn shares(&self) -> TimeShares {
        self.state.shares
    }

    /// The samples of a section that ended since the last call.
    pub(crate) fn take_finished_section(&mut self) -> Option<SectionSamples> {
        self.state.finished_section.take()
    }

    /// Planned items held: those within one amplitude of the tool.
    pub(crate) fn held_items(&self) -> usize {
        self.state.track.len()
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
                    if self.state.finished_section.is_some() {
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
                }
            }
            ActivityKind::Hold { .. } | ActivityKind::VibratingHold | ActivityKind::FeedHold { .. } => {
                state.shares.limits.rest_s += activity.duration_s;
            }
            ActivityKind::ThreadPreparation { .. } | ActivityKind::Thread { .. } => self.share_thread(activity),
        }
        match std::mem::replace(&mut self.state.after, After::Continue) {
            After::Continue => {
                if let ActivityKind::Stretch(index) = activity.kind {
                    self.after_stretch(index);
                }
            }
            After::LeaveMotion => self.leave_motion(),
            After::RunThread => self.run_thread(),
            After::LeaveThread => self.leave_thread(),
            After::OpenSection(condition) => {
                let start_period = self.state.clock.period;
                let (part, samples) = (SectionPart::default(), SectionSamples::default());
                self.state.section =
                    Some(Section { start_period, condition, part, before_mm: 0.0, ended_mm: 0.0, samples });
                self.state.amplitude.open(&condition);
                self.state.track.advance(condition.reach_mm());
            }
            After::SettleSection => self.settle_section(),
            After::CloseSection => {
                self.state.finished_section = self.state.section.take().map(|section| section.samples);
                self.state.track.advance(0.0);
            }
            After::CloseOscillation => {
                self.state.oscillation = None;
                self.state.track.advance(0.0);
            }
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
            let element = &motion.element;
            state.path_base_mm += element.length;
            let tool = match &element.curve {
                Curve::FiveAxis(five_axis) => Some((five_axis.tip().ends()[1], *five_axis.setup())),
                _ => None,
            };
            let (position, work_offset, line) = (element.end, element.work_offset, element.source.line);
            state.rest = Rest { position, work_offset, line, tool };
        }
        let keep_mm = state.section.map_or(0.0, |section| section.condition.reach_mm());
        state.track.advance(keep_mm);
    }

    /// Takes the next item; `false` when it, or the path that the vibration may reach from it, is not there yet.
    fn begin(&mut self) -> bool {
        let Some(item) = self.state.track.current() else { return false };
        if let (Some(index), Planned::Motion(motion)) = (self.state.resume, item) {
            if index >= motion.stretches.len() || !self.reach_is_known() {
                return false;
            }
            self.state.resume = None;
            self.begin_stretch(index);
            return true;
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
            Planned::Barrier(Barrier::SectionStart(condition)) => {
                let condition = *condition;
                self.align_then(After::OpenSection(condition));
            }
            Planned::Barrier(Barrier::SectionEnd) => {
                // The clamp holds a positive offset at the end point; a negative one would be cut off.
                let wait_s = self.clamped_section().map_or(0.0, |section| self.wait_for_zero_s(section, true));
                self.hold(ActivityKind::VibratingHold, wait_s, After::SettleSection);
            }
            Planned::Barrier(Barrier::PartStart(part)) => {
                let part = *part;
                if let Some(section) = &mut self.state.section {
                    section.part = part;
                    section.before_mm = section.ended_mm;
                }
                self.state.track.advance(0.0);
            }
            Planned::Barrier(Barrier::PartEnd) => match self.end_part() {
                // The offset would jump with the direction unless it is zero here.
                Some(section) => {
                    let wait_s = self.wait_for_zero_s(section, false);
                    self.hold(ActivityKind::VibratingHold, wait_s, After::LeaveMotion);
                }
                None => self.state.track.advance(0.0),
            },
            Planned::Barrier(Barrier::OscillationStart(run)) => {
                let run = run.clone();
                self.state.oscillation = Some(run);
                self.state.track.advance(0.0);
            }
            Planned::Barrier(Barrier::OscillationEnd) => self.align_then(After::CloseOscillation),
            &Planned::Barrier(Barrier::Dwell { duration_s, line }) => {
                self.hold(ActivityKind::Hold { line }, duration_s, After::LeaveMotion);
            }
            Planned::Barrier(Barrier::Spindle(spindle)) => {
                self.state.spindle = *spindle;
                let keep_mm = self.state.section.map_or(0.0, |section| section.condition.reach_mm());
                self.state.track.advance(keep_mm);
            }
            Planned::Barrier(Barrier::Thread(_)) => self.begin_thread(),
            Planned::Barrier(Barrier::End) => self.align_then(After::EndProgram),
        }
        true
    }

    /// Whether the path is known as far ahead as a vibration may reach from here, and as an oscillation is blended out over.
    pub(crate) fn reach_is_known(&self) -> bool {
        let vibration_mm =
            self.state.section.map(|section| section.part.ramp_mm.unwrap_or_else(|| section.condition.reach_mm()));
        let blend_mm = self.state.oscillation.as_ref().map(|run| run.ramp_mm);
        vibration_mm.into_iter().chain(blend_mm).all(|reach_mm| self.state.track.is_known_ahead(reach_mm))
    }

    fn begin_stretch(&mut self, index: usize) {
        let state = &mut self.state;
        let Some(motion) = state.track.motion(state.track.current_index()) else { return };
        let stretch = &motion.stretches[index];
        let duration_s = stretch.profile.duration();
        let spindle_rev_per_s = signed(state.spindle, stretch.stretch.spindle_rev_per_s);
        self.activate(ActivityKind::Stretch(index), duration_s, spindle_rev_per_s, After::Continue);
    }

    pub(crate) fn hold(&mut self, kind: ActivityKind, duration_s: f64, after: After) {
        let radius_mm = self.state.rest.position[0];
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

    /// Rests up to the next grid instant, whose setpoint is the section's exact end point.
    fn settle_section(&mut self) {
        let period_s = self.settings.period_s;
        let aligned = self.state.clock.aligned().period;
        // A blended vibration is 0 here. While the offset is not negative the clamp holds the end point, and drives that generate the vibration
        // themselves arrive there without a jump; otherwise the command alone is there.
        let arrives = |section: &Section| sin_turns(columns::phase_turns(section, period_s, aligned)) >= 0.0;
        let line = self.state.rest.line;
        let kind = match &self.state.section {
            Some(section) if section.part.ramp_mm.is_some() || arrives(section) => ActivityKind::VibratingHold,
            _ => ActivityKind::Hold { line },
        };
        self.align(kind, After::CloseSection);
    }

    /// Rests up to the next grid instant, whose setpoint is the exact resting point.
    fn align_then(&mut self, after: After) {
        let line = self.state.rest.line;
        self.align(ActivityKind::Hold { line }, after);
    }

    fn align(&mut self, kind: ActivityKind, after: After) {
        let wait_s = self.state.clock.to_alignment_s(self.settings.period_s);
        self.hold(kind, wait_s, after);
        if let Some(activity) = &mut self.state.activity {
            activity.end = self.state.clock.aligned();
            activity.last = activity.end.period;
        }
    }

    pub(crate) fn activate(&mut self, kind: ActivityKind, duration_s: f64, spindle_rev_per_s: f64, after: After) {
        let end = self.state.clock.advanced(duration_s, self.settings.period_s);
        self.state.after = after;
        let (last, feed_override) = (end.period, self.state.feed_override);
        self.state.activity = Some(Activity { kind, spindle_rev_per_s, end, last, duration_s, feed_override });
    }

    /// Time until the vibration next passes zero, s; with `only_if_negative` 0 while its offset is not negative.
    fn wait_for_zero_s(&self, section: Section, only_if_negative: bool) -> f64 {
        let frequency_hz = section.condition.frequency_hz;
        let half_turns = 2.0 * frequency_hz * self.state.clock.since_s(section.start_period, self.settings.period_s);
        let is_negative = half_turns.floor() % 2.0 == 1.0;
        if only_if_negative && !is_negative {
            return 0.0;
        }
        (half_turns.ceil() - half_turns) / (2.0 * frequency_hz)
    }

    /// Ends the present part of the section; see [`Interpolator::clamped_section`].
    fn end_part(&mut self) -> Option<Section> {
        let (part_mm, _) = self.state.track.section_place(self.state.track.current_index());
        if let Some(section) = &mut self.state.section {
            section.ended_mm = section.before_mm + part_mm;
        }
        self.clamped_section()
    }

    /// The section, where its vibration is clamped at the ends of its parts instead of blended out.
    fn clamped_section(&self) -> Option<Section> {
        self.state.section.filter(|section| section.part.ramp_mm.is_none())
    }

    /// The motion the tool is on, or the one before a barrier.
    fn last_motion(&self) -> Option<&PlannedMotion> {
        self.last_motion_index().and_then(|item| self.state.track.motion(item))
    }

    fn last_motion_index(&self) -> Option<usize> {
        (0..=self.state.track.current_index()).rev().find(|&item| self.state.track.motion(item).is_some())
    }
}

fn signed(spindle: Spindle, rev_per_s: f64) -> f64 {
    match spindle.direction {
        SpindleDirection::Stopped => 0.0,
        SpindleDirection::Clockwise => rev_per_s,
        SpindleDirection::CounterClockwise => -rev_per_s,
    }
}
