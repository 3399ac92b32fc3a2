//! The setpoints of a run, chunk by chunk, with the digest of all that were handed out.

use feedwave_contract::proto;
use feedwave_cutting::{
    BLOCK_LENGTH, OverrideChange, Pipeline, SetpointBlock, SpindleChange, SpindleTrial, Step, TrialStep,
};
use feedwave_program::Severity;
use feedwave_store::RunCheckpoint;
use sha2::{Digest as _, Sha256};

use super::checkpoint::{self, Start};
use crate::engine::columns::ChunkWriter;
use crate::engine::source::Source;
use crate::error::{Error, Result};
use feedwave_contract::stream::{ColumnSet, FIRST_CHUNK_SIZE};

/// Answer to a request for setpoints.
#[derive(Debug)]
pub(super) enum Next {
    /// Setpoints from the start index on.
    Chunk(proto::SetpointChunk),
    /// Setpoints before the start index: nothing to hand out.
    Passed,
    /// There are no more.
    End,
}

/// Generates the setpoints of a run and digests them.
pub(super) struct Setpoints {
    pipeline: Pipeline,
    source: Source,
    columns: ColumnSet,
    /// Setpoints before this one are not handed out; a client that takes a run up has them.
    first_index: u64,
    block: SetpointBlock,
    rows: Vec<u8>,
    digest: Sha256,
    /// Whether the path rests at the last setpoint.
    at_rest: bool,
    /// A setpoint with the digest that those before it have to have: what was handed out once.
    expected: Option<(u64, [u8; 32])>,
    /// Index from which on the next checkpoint is taken.
    checkpoint_due: u64,
    /// One that was taken and not asked for.
    checkpoint: Option<RunCheckpoint>,
}

impl Setpoints {
    pub(super) fn new(start: Start, source: Source, columns: ColumnSet, first_index: u64) -> Self {
        let Start { pipeline, digest } = start;
        Self {
            source,
            columns,
            first_index,
            block: pipeline.new_block(),
            rows: Vec::new(),
            digest,
            at_rest: true,
            expected: None,
            checkpoint_due: checkpoint::due_after(pipeline.next_index()),
            checkpoint: None,
            pipeline,
        }
    }

    /// Proves on the way that the first `count` setpoints have this digest.
    pub(super) fn expecting(self, count: u64, digest: [u8; 32]) -> Self {
        let ahead = count > self.next_index();
        Self { expected: ahead.then_some((count, digest)), ..self }
    }

    /// Index of the next setpoint: so many were generated.
    pub(super) fn next_index(&self) -> u64 {
        self.pipeline.next_index()
    }

    /// First setpoint that is handed out.
    pub(super) const fn first_index(&self) -> u64 {
        self.first_index
    }

    /// How many were handed out, by this stream of the run or by one before it.
    pub(super) fn handed_out(&self) -> u64 {
        let before = self.expected.map_or(0, |(count, _)| count);
        self.next_index().max(self.first_index).max(before)
    }

    /// See [`Pipeline::earliest_override`]. What was handed out once is not changed any more, though the client that comes back may
    /// ask for it again.
    pub(super) fn earliest_change(&self) -> u64 {
        let handed_out = self.expected.map_or(0, |(count, _)| count);
        self.pipeline.earliest_override().max(self.first_index).max(handed_out)
    }

    /// The setpoints that were generated last.
    pub(super) const fn block(&self) -> &SetpointBlock {
        &self.block
    }

    /// Whether the path rests at the last setpoint.
    pub(super) const fn at_rest(&self) -> bool {
        self.at_rest
    }

    /// Whether the client may be cutting a thread, given how many setpoints it has taken.
    pub(super) fn cuts_thread(&self, received: u64) -> bool {
        let pass = self.pipeline.last_thread_pass();
        pass.is_some_and(|(first, last)| first < self.next_index() && received <= last)
    }

    /// Digest of all setpoints before [`Setpoints::next_index`].
    pub(super) fn digest(&self) -> [u8; 32] {
        self.digest.clone().finalize().into()
    }

    /// State of that digest.
    pub(super) fn digest_state(&self) -> Vec<u8> {
        checkpoint::digest_state(&self.digest)
    }

    /// Whether there is one that was not asked for.
    pub(super) const fn has_checkpoint(&self) -> bool {
        self.checkpoint.is_some()
    }

    /// The newest checkpoint that was taken since this was asked last.
    pub(super) fn take_checkpoint(&mut self) -> Option<RunCheckpoint> {
        self.checkpoint.take()
    }

    /// Hands nothing out before this setpoint, where blocks end then.
    pub(super) const fn generate_to(&mut self, index: u64) {
        self.first_index = index;
    }

    /// Changes the feed.
    pub(super) fn append(&mut self, change: OverrideChange) -> Result<()> {
        self.pipeline.append_override(change).map_err(Error::internal)
    }

    /// The place between sections at which the generator has stopped and whose spindle speed is not decided: the first setpoint
    /// behind it. What was handed out once was decided.
    pub(super) fn open_place(&self) -> Option<u64> {
        let decided = self.expected.map_or(0, |(count, _)| count).max(self.first_index);
        self.pipeline.place_between().filter(|index| *index >= decided && !self.pipeline.has_change_at_place())
    }

    /// Spindle override at the next setpoint.
    pub(super) fn spindle_ratio(&self) -> f64 {
        self.pipeline.spindle_ratio()
    }

    /// Spindle speed at the place with this override, rev/min, where it is one.
    pub(super) fn rev_per_min_at(&self, spindle: f64) -> Option<f64> {
        self.pipeline.programmed_rev_per_min().map(|programmed| programmed * spindle)
    }

    /// Begins to judge another spindle speed for what follows the place, at feed overrides up to the largest one.
    pub(super) fn trial(&self, spindle: f64, largest_override: f64) -> Option<SpindleTrial> {
        SpindleTrial::new(&self.pipeline, spindle, largest_override)
    }

    /// Goes on with a trial.
    pub(super) fn judge(&mut self, trial: &mut SpindleTrial) -> Result<TrialStep> {
        let step = trial.step();
        let TrialStep::NeedInput(place) = step else { return Ok(step) };
        match self.source.read(place)? {
            Some(bytes) => trial.push(&bytes),
            None => trial.finish_input(),
        }
        Ok(TrialStep::More)
    }

    /// Changes the spindle speed at the place.
    pub(super) fn turn(&mut self, change: SpindleChange) -> Result<()> {
        let done = self.pipeline.append_spindle_change(change.ratio).map_err(Error::internal)?;
        if done == change { Ok(()) } else { Err(Error::internal("a spindle speed was changed at another place")) }
    }

    /// The next setpoints before `end`, which lies after [`Setpoints::next_index`].
    pub(super) fn next(&mut self, end: u64) -> Result<Next> {
        let next = self.next_index();
        // What the client has is passed over in large blocks.
        let (end, most) =
            if next < self.first_index { (self.first_index, BLOCK_LENGTH) } else { (end, FIRST_CHUNK_SIZE) };
        let end = self.expected.map_or(end, |(count, _)| end.min(count));
        let most = usize::try_from(end - next).map_or(most, |left| left.min(most));
        loop {
            match self.pipeline.next_setpoints(&mut self.block, most) {
                Step::NeedInput(place) => match self.source.read(place)? {
                    Some(bytes) => self.pipeline.push(&bytes),
                    None => self.pipeline.finish_input(),
                },
                Step::Block => break,
                Step::Finished if self.expected.is_some() => return Err(self.differs()),
                Step::Finished => return Ok(Next::End),
                Step::Refused => return Err(self.refused()),
            }
        }
        let block = &self.block;
        if block.is_empty() {
            // A place between sections.
            return Ok(Next::Passed);
        }
        add_rows(block, &mut self.rows);
        self.digest.update(&self.rows);
        self.at_rest = block.feed_mm_per_min.last() == Some(&0.0);
        if self.expected.is_some_and(|(count, digest)| count == self.next_index() && digest != self.digest()) {
            return Err(self.differs());
        }
        self.expected = self.expected.filter(|(count, _)| *count > self.next_index());
        if self.next_index() >= self.checkpoint_due {
            self.checkpoint_due = checkpoint::due_after(self.next_index());
            self.checkpoint = Some(checkpoint::checkpoint(&self.pipeline, &self.digest)?);
        }
        let block = &self.block;
        if next < self.first_index {
            return Ok(Next::Passed);
        }
        let mut chunk = None;
        let mut writer = ChunkWriter::new(&self.columns, block.len(), block.first_index);
        writer.write(block, 0..block.len(), |full| chunk.replace(full).is_none());
        chunk.map(Next::Chunk).ok_or_else(|| Error::internal("a block did not become a chunk"))
    }

    /// What was handed out once does not come again: by another version, or from damaged data.
    fn differs(&self) -> Error {
        let count = self.expected.map_or(0, |(count, _)| count);
        Error::Damaged(format!(
            "the first {count} setpoints of this run do not come again as they were sent: begin a new run"
        ))
    }

    fn refused(&self) -> Error {
        let findings = self.pipeline.findings().findings();
        let first = findings.iter().find(|finding| finding.severity == Severity::Error);
        let reason = first.map_or_else(String::new, |finding| {
            format!("{} in line {}: {}", finding.code, finding.span.line, finding.message)
        });
        let message = format!("the program is refused under the feed of this run: {reason}");
        Error::Precondition { reason: "PROGRAM_REFUSED", subject: "program".to_owned(), message }
    }
}

/// The setpoints of a block as bytes, setpoint by setpoint, so that they do not depend on where blocks end.
fn add_rows(block: &SetpointBlock, rows: &mut Vec<u8>) {
    rows.clear();
    let servo = block.servo.as_ref();
    for row in 0..block.len() {
        rows.extend_from_slice(&block.line[row].to_le_bytes());
        let columns = block.axes.iter().chain([
            &block.path_position_mm,
            &block.feed_mm_per_min,
            &block.vibration_offset_mm,
            &block.spindle_angle_deg,
        ]);
        let servo_columns = servo.into_iter().flat_map(|servo| {
            let per_axis = servo.amplitude_mm.iter().chain(&servo.clamp_low_mm).chain(&servo.clamp_high_mm);
            per_axis.chain([&servo.frequency_hz, &servo.phase_turns])
        });
        for column in columns.chain(servo_columns) {
            rows.extend_from_slice(&column[row].to_le_bytes());
        }
    }
}
