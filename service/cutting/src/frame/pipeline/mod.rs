//! From program bytes to setpoints, without I/O: bytes are pushed in, blocks are pulled out.

mod overrides;
mod places;
mod reading;

use std::collections::VecDeque;
use std::sync::Arc;

use feedwave_motion::kinematics::Kinematics;
use feedwave_motion::{MOST_BYTES_WITHIN_REACH, MOST_WITHIN_REACH, Planner};
use feedwave_program::{
    Finding, FindingLog, InterpreterState, Operation, Place, Reader, Reading, SourcePages, SourceSpan,
};
use serde::{Deserialize, Serialize};

use crate::code;
use crate::frame::builder::{Analysis, Builder, BuilderState, blocks_too_short};
use crate::frame::config::{MAX_SETPOINTS, PipelineConfig};
use crate::frame::interpolator::{self, Barrier, Examination, Fill, Interpolator};
use crate::frame::scout::Scout;
use crate::frame::timed::TimedPlans;
use crate::functions::five_axis::Guide;
use crate::functions::path_vibration::GenerationMode;
use crate::functions::thinning::{StageState, ThinningStage};
use crate::functions::thread::{KeptPass, WantedPass};
use crate::shared::setpoint::{BLOCK_LENGTH, Frame, SetpointBlock};

pub use overrides::AppendError;
use overrides::OverrideState;
pub use places::SpindleChangeError;
use places::SpindleState;

/// Findings kept while streaming: the program was validated before, so the first one matters only.
const STREAM_FINDINGS: usize = 16;
/// Version of the snapshot's layout; a snapshot of another version is refused.
const SNAPSHOT_VERSION: u8 = 63;

/// What a call to [`Pipeline::next_block`] brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Program bytes from this place on are needed: [`Pipeline::push`], or [`Pipeline::finish_input`] where the program
    /// ends there, then call again with the same block.
    NeedInput(Place),
    /// The block was filled; it may be short at the end of a program and where the feed override changes, and empty at a
    /// place where the spindle speed may change ([`Pipeline::place_between`]).
    Block,
    /// The program has ended; every setpoint was delivered.
    Finished,
    /// The program has an error ([`Pipeline::findings`]): no setpoint follows.
    Refused,
}

/// The state cannot be kept as bytes, or not be restored from them.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SnapshotError {
    /// The state could not be serialised.
    #[error("the snapshot cannot be written: {0}")]
    Write(postcard::Error),
    /// The bytes are no snapshot.
    #[error("the snapshot cannot be read: {0}")]
    Read(postcard::Error),
    /// Written by another version.
    #[error("the snapshot has layout version {found}, this is version {SNAPSHOT_VERSION}")]
    Version {
        /// Version of the snapshot.
        found: u8,
    },
}

/// A running pipeline. Its memory does not grow with the program.
#[derive(Clone, Debug)]
pub struct Pipeline {
    pub(crate) config: Arc<PipelineConfig>,
    pages: SourcePages,
    reader: Reader,
    operations: Vec<Operation>,
    pub(crate) thinning: ThinningStage,
    /// The same by the other method; while validating only.
    pub(crate) compared: Option<ThinningStage>,
    /// Operations that wait for the builder; empty between lines, but while more has to be known of what follows.
    waiting: VecDeque<Operation>,
    /// Looks ahead for the first of them. It is no part of the state: another one sees the same.
    scout: Option<Box<Scout>>,
    /// Plans of the thinned parts for their times; while validating only.
    pub(crate) timed: Option<TimedPlans>,
    pub(crate) builder: Builder,
    planner: Planner<Barrier>,
    pub(crate) interpolator: Interpolator,
    pub(crate) findings: FindingLog,
    overrides: OverrideState,
    pub(crate) spindle: SpindleState,
    /// Whether the block in hand was begun by an earlier call.
    block_begun: bool,
}

/// Everything that changes while a pipeline runs.
#[derive(Serialize, Deserialize)]
struct Snapshot {
    interpreter: InterpreterState,
    thinning: StageState,
    waiting: VecDeque<Operation>,
    builder: BuilderState,
    planner: Planner<Barrier>,
    interpolator: interpolator::State,
    overrides: OverrideState,
    spindle: SpindleState,
}

/// The version and a state behind it.
fn encoded<T: Serialize>(state: &T) -> Result<Vec<u8>, SnapshotError> {
    postcard::to_extend(state, vec![SNAPSHOT_VERSION]).map_err(SnapshotError::Write)
}

impl Pipeline {
    /// A pipeline at the start of a program.
    #[must_use]
    pub fn new(config: Arc<PipelineConfig>) -> Self {
        Self::with_analysis(config, None)
    }

    pub(crate) fn with_analysis(config: Arc<PipelineConfig>, analysis: Option<Analysis>) -> Self {
        let language = &config.profile.language;
        let interpreter = config.interpreter();
        let work_offset = language.initial_offset();
        let mut position = language.initial_position;
        for (value, offset) in position.iter_mut().zip(work_offset) {
            *value -= offset;
        }
        let mut interpolator = Interpolator::new(
            &config.profile.machine,
            config.period_s(),
            config.generation_mode,
            config.frame,
            position,
            work_offset,
        );
        let findings = if analysis.is_some() { FindingLog::default() } else { FindingLog::with_limit(STREAM_FINDINGS) };
        let is_validation = analysis.is_some();
        // An invalid description is refused before it gets here; without one, five-axis moves are findings.
        let kinematics = config.profile.kinematics.as_ref().and_then(|it| Kinematics::new(it).ok()).map(Arc::new);
        if let (Frame::Work, Some(kinematics)) = (config.frame, &kinematics) {
            interpolator = interpolator.with_tool_direction(&config.profile.machine, kinematics);
        }
        if is_validation {
            interpolator.examination = Some(Box::new(Examination::new(&config.profile.machine)));
        }
        let settings = config.profile.planner_settings(config.period_s());
        let thinning =
            ThinningStage::new(config.profile.thinning, !config.every_block, kinematics.clone(), is_validation);
        Self {
            pages: SourcePages::default(),
            reader: Reader::new(interpreter),
            operations: Vec::new(),
            compared: is_validation.then(|| thinning.by_other_method()),
            thinning,
            waiting: VecDeque::new(),
            scout: None,
            timed: is_validation.then(TimedPlans::default),
            builder: Builder::new(BuilderState::at(language.initial_position), analysis, kinematics.map(Guide::new)),
            planner: Planner::new(settings),
            interpolator,
            findings,
            overrides: OverrideState::default(),
            spindle: SpindleState::default(),
            block_begun: false,
            config,
        }
        .at_next_override()
    }

    /// A pipeline that continues, bit for bit, where [`Pipeline::snapshot`] was taken with the same
    /// configuration and program.
    ///
    /// # Errors
    /// [`SnapshotError`] when the bytes are not a snapshot of this version.
    pub fn restore(config: Arc<PipelineConfig>, snapshot: &[u8]) -> Result<Self, SnapshotError> {
        let (found, state) = postcard::take_from_bytes::<u8>(snapshot).map_err(SnapshotError::Read)?;
        if found != SNAPSHOT_VERSION {
            return Err(SnapshotError::Version { found });
        }
        let snapshot: Snapshot = postcard::from_bytes(state).map_err(SnapshotError::Read)?;
        let interpreter = config.restored_interpreter(snapshot.interpreter);
        let mut fresh = Self::new(config);
        fresh.builder.state = snapshot.builder;
        fresh.thinning.state = snapshot.thinning;
        fresh.waiting = snapshot.waiting;
        fresh.interpolator.restore(snapshot.interpolator);
        let Snapshot { planner, overrides, spindle, .. } = snapshot;
        let pages = SourcePages::from(interpreter.place());
        Ok(Self { pages, reader: Reader::new(interpreter), planner, overrides, spindle, ..fresh })
    }

    /// The state between two blocks, for [`Pipeline::restore`]; take it after [`Step::Block`] only. It does not
    /// depend on the frame: a snapshot taken with one may be restored with the other.
    ///
    /// # Errors
    /// [`SnapshotError::Write`] when the state cannot be serialised; there is nothing to store then.
    pub fn snapshot(&self) -> Result<Vec<u8>, SnapshotError> {
        let snapshot = Snapshot {
            interpreter: self.reader.interpreter.state().clone(),
            thinning: self.thinning.state.clone(),
            waiting: self.waiting.clone(),
            builder: self.builder.state.clone(),
            planner: self.planner.clone(),
            interpolator: self.interpolator.state().clone(),
            overrides: self.overrides,
            spindle: self.spindle,
        };
        encoded(&snapshot)
    }

    /// Where the next line of the program is that is read.
    #[must_use]
    pub fn place(&self) -> Place {
        self.reader.interpreter.place()
    }

    /// Index of the next setpoint; between blocks, that of the first setpoint of the next block.
    #[must_use]
    pub fn next_index(&self) -> u64 {
        self.interpolator.next_index()
    }

    /// First and last setpoint of the threading pass that was begun last, however far it has been handed out; the last
    /// is the one before the first where the pass is over within a period.
    #[must_use]
    pub fn last_thread_pass(&self) -> Option<(u64, u64)> {
        self.interpolator.last_thread_pass()
    }

    /// Keeps the path of one pass: its thread and its number there count from 0, in the order of the report's threads and of
    /// their passes. It must not have been planned yet ([`Pipeline::next_thread_pass`]).
    #[must_use]
    pub fn keeping_path(mut self, thread: u64, pass: usize) -> Self {
        self.builder.wanted_pass = Some(WantedPass { place: (thread, pass), pass: None });
        self
    }

    /// The pass whose path is kept, as soon as it is planned, which is before its setpoints come.
    #[must_use]
    pub fn kept_pass(&self) -> Option<&KeptPass> {
        self.builder.wanted_pass.as_ref()?.pass.as_ref()
    }

    /// Thread and number, counted from 0, of the first pass that was not planned yet, where it belongs to the last thread; it
    /// may be the first of the next thread as well.
    #[must_use]
    pub fn next_thread_pass(&self) -> (u64, usize) {
        self.builder.next_thread_pass()
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &PipelineConfig {
        &self.config
    }

    /// What was found so far.
    #[must_use]
    pub fn findings(&self) -> &FindingLog {
        &self.findings
    }

    /// A block of the right shape for [`Pipeline::next_block`].
    #[must_use]
    pub fn new_block(&self) -> SetpointBlock {
        let servo = self.config.generation_mode == GenerationMode::ServoSide;
        let block = SetpointBlock::for_machine(&self.config.profile.machine, servo);
        if self.interpolator.shows_tool_direction() { block.with_tool_direction() } else { block }
    }

    /// Gives the pipeline bytes from the place on that it asked for ([`Step::NeedInput`]), at first the start of the program;
    /// further calls go on behind them. Pieces of 64 KiB to 1 MiB are best.
    pub fn push(&mut self, bytes: &[u8]) {
        self.pages.push(bytes);
    }

    /// Says that the program ends at the place that was asked for, or behind the bytes given since.
    pub fn finish_input(&mut self) {
        self.pages.finish();
    }

    /// Answers a [`Step::NeedInput`] from a program in memory.
    pub fn supply(&mut self, place: Place, program: &[u8]) {
        supply(&mut self.pages, place, program);
    }

    /// Fills the next block of setpoints. `block` comes from [`Pipeline::new_block`] and may be used again and
    /// again.
    pub fn next_block(&mut self, block: &mut SetpointBlock) -> Step {
        self.next_setpoints(block, BLOCK_LENGTH)
    }

    /// [`Pipeline::next_block`] with at most so many setpoints, for a caller that waits for the first ones. `most` is 1
    /// to [`BLOCK_LENGTH`]; beyond, the nearest of the two holds.
    pub fn next_setpoints(&mut self, block: &mut SetpointBlock, most: usize) -> Step {
        self.leave_place();
        if !self.block_begun {
            block.clear(self.interpolator.next_index());
            self.block_begun = true;
        }
        let step = self.run(block, most.clamp(1, BLOCK_LENGTH));
        self.block_begun = matches!(step, Step::NeedInput(_));
        step
    }

    fn run(&mut self, block: &mut SetpointBlock, most: usize) -> Step {
        loop {
            match self.interpolator.fill(block, most) {
                Fill::Full => {
                    if let (Some(analysis), Some(place_mm)) =
                        (&mut self.builder.analysis, self.interpolator.section_place_mm())
                    {
                        analysis.functions.vibration.is_cut(place_mm);
                    }
                    break;
                }
                Fill::Ended => return if block.is_empty() { Step::Finished } else { Step::Block },
                Fill::SectionEnded => {
                    let samples = self.interpolator.take_finished_section();
                    if let (Some(samples), Some(analysis)) = (samples, &mut self.builder.analysis) {
                        analysis.functions.vibration.finish_section(samples, &mut self.findings);
                    }
                }
                Fill::Starved => match self.planner.pop() {
                    Some(item) => {
                        self.interpolator.push(item);
                        self.check_held_items();
                    }
                    None => {
                        if self.planner.is_held() && self.rest_in_feed_hold() {
                            continue;
                        }
                        if self.reaches_place() {
                            break;
                        }
                        match self.read_line() {
                            Reading::NeedInput => return Step::NeedInput(self.pages.wanted()),
                            Reading::More => {}
                            // A fault of ours, which must not go on for ever: its end finishes the path.
                            Reading::Ended => unreachable!("a program that has ended leaves nothing to wait for"),
                        }
                    }
                },
                Fill::Paused => {
                    self.change_override();
                    // Planning anew takes its time: with many changes in a block, the caller could not stop between.
                    if !block.is_empty() {
                        break;
                    }
                }
            }
            if self.findings.has_errors() {
                return Step::Refused;
            }
        }
        if self.interpolator.next_index() > MAX_SETPOINTS {
            self.refuse_more_setpoints(block.line.last().copied().unwrap_or_default());
            return Step::Refused;
        }
        Step::Block
    }

    fn refuse_more_setpoints(&mut self, line: u32) {
        let message = format!("the program has more than {MAX_SETPOINTS} setpoints at this interpolation period");
        let finding = Finding::new(
            code::PLAN_TOO_MANY_SETPOINTS,
            SourceSpan { line, column: 1, ..SourceSpan::default() },
            message,
        );
        let finding = finding.with_value("limit", MAX_SETPOINTS as f64, "");
        self.findings.push(finding.suggest("use a longer interpolation period, or split the program"));
    }

    /// Bounds the memory that a vibration of large amplitude on very short blocks takes.
    fn check_held_items(&mut self) {
        let (items, bytes) = (self.interpolator.held_items(), self.interpolator.held_bytes());
        if items > MOST_WITHIN_REACH || bytes > MOST_BYTES_WITHIN_REACH {
            let span = SourceSpan { line: self.interpolator.line(), column: 1, ..SourceSpan::default() };
            self.findings.push(blocks_too_short(span, items));
        }
    }

    /// Forgets what is planned but will not be interpolated.
    pub(crate) fn discard_planned(&mut self) {
        while self.planner.pop().is_some() {}
    }

    pub(crate) fn wanted(&self) -> Place {
        self.pages.wanted()
    }

    pub(crate) fn interpreter_state(&self) -> &InterpreterState {
        self.reader.interpreter.state()
    }
}

/// Most bytes of a program in memory that are copied at once.
const SUPPLY_BYTES: usize = 1 << 20;

/// Supplies the bytes of a program in memory that are wanted at a place, or its end.
pub(crate) fn supply(pages: &mut SourcePages, place: Place, program: &[u8]) {
    match program.get(place.offset as usize..) {
        None | Some([]) => pages.finish(),
        Some(rest) => pages.push(&rest[..rest.len().min(SUPPLY_BYTES)]),
    }
}

#[cfg(test)]
mod tests {
    use serde::{Serialize, Serializer, ser::SerializeSeq as _};

    use super::*;
    use crate::frame::profile::MachineProfile;

    /// A list that does not say how long it is, as a member of the state with a serialisation of its own might.
    struct Unserialisable;

    impl Serialize for Unserialisable {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            serializer.serialize_seq(None)?.end()
        }
    }

    #[test]
    fn a_state_that_cannot_be_serialised_is_an_error_and_no_snapshot() {
        assert!(matches!(encoded(&Unserialisable), Err(SnapshotError::Write(_))));
        assert_eq!(encoded(&7_u8), Ok(vec![SNAPSHOT_VERSION, 7]));
    }

    #[test]
    fn bytes_that_are_no_snapshot_of_this_version_are_refused() {
        let config = Arc::new(PipelineConfig::new(MachineProfile::lathe()));
        let restore = |bytes: &[u8]| Pipeline::restore(Arc::clone(&config), bytes).err();
        let mut snapshot = Pipeline::new(Arc::clone(&config)).snapshot().expect("plain data");
        assert_eq!(restore(&snapshot), None);
        assert!(matches!(restore(&[]), Some(SnapshotError::Read(_))), "what an unwritten one would be");
        assert!(matches!(restore(&snapshot[..snapshot.len() / 2]), Some(SnapshotError::Read(_))));
        snapshot[0] += 1;
        assert_eq!(restore(&snapshot), Some(SnapshotError::Version { found: SNAPSHOT_VERSION + 1 }));
    }
}
