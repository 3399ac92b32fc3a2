//! A stream of setpoints as a client asks for it, and its rows in turn: without I/O, so that a service and a client without
//! one stream the same.

use std::ops::Range;
use std::sync::Arc;

use feedwave_cutting::{
    BLOCK_LENGTH, Frame, GenerationMode, Pipeline, PipelineConfig, ServoExpander, SetpointBlock, Step,
    setpoint_index_at,
};
use feedwave_motion::Machine;
use feedwave_program::{Finding, Place, Severity};

use crate::columns::{self, Column, Extras};
use crate::convert::{
    check_period_us, enumeration, generation_mode_from_proto, generation_mode_to_proto, overrides_from_proto,
};
use crate::proto::stream_setpoints_request::Start;
use crate::proto::{self, ColumnKind as Kind};
use crate::violations::Violations;

/// Most setpoints that a client can ask for per chunk.
pub const MAX_CHUNK_SIZE: u32 = 1 << 17;
/// Setpoints per chunk unless the client says otherwise, bounded by [`DEFAULT_CHUNK_BYTES`].
const DEFAULT_CHUNK_SIZE: usize = 8_192;
/// Setpoints in the first chunk, which is sent as soon as they are there. With a period of 20 ms they are more than a
/// second of machining, while the next ones are generated.
pub const FIRST_CHUNK_SIZE: usize = 64;
/// Size of a chunk unless the client says otherwise, bytes as packed doubles: where a stream is fastest.
pub const DEFAULT_CHUNK_BYTES: usize = 256 << 10;
/// Largest chunk, bytes as packed doubles: well below the 4 MiB that clients accept by default.
pub const MAX_CHUNK_BYTES: usize = 2 << 20;

/// The columns of a stream and their encoding.
#[derive(Clone, Debug)]
pub struct ColumnSet {
    columns: Vec<Column>,
    infos: Vec<proto::ColumnInfo>,
    encoding: proto::Encoding,
}

impl ColumnSet {
    /// The columns that a client wants; all that there are where it names none. What a stream without conditions
    /// for the drives or directions of the tool does not have is a violation.
    pub fn select(
        violations: &mut Violations,
        wanted: &[i32],
        machine: &Machine,
        conditions: bool,
        directions: bool,
        encoding: proto::Encoding,
    ) -> Self {
        let extras = Extras { conditions, directions };
        for (index, value) in wanted.iter().enumerate() {
            let field = format!("columns[{index}]");
            match Kind::try_from(*value).ok().and_then(columns::needs) {
                Some(needed) if needed.conditions && !conditions => {
                    violations.add(field, "only servo-side mode with conditions as its output has this column");
                }
                Some(needed) if needed.directions && !directions => {
                    violations.add(field, "only work coordinates of a machine with kinematics have this column");
                }
                Some(_) => {}
                None => violations.add(field, format!("{value} is not a column")),
            }
        }
        let mut columns = columns::of_machine(machine, extras);
        columns.retain(|column| wanted.is_empty() || wanted.contains(&column.kind.into()));
        let infos = columns.iter().map(|column| column.info(encoding)).collect();
        Self { columns, infos, encoding }
    }

    /// The columns, in their order.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// What the header says about the columns.
    #[must_use]
    pub fn infos(&self) -> &[proto::ColumnInfo] {
        &self.infos
    }

    /// How their values are written.
    #[must_use]
    pub const fn encoding(&self) -> proto::Encoding {
        self.encoding
    }

    /// Setpoints per chunk when the client asks for `wanted`, 0 for no wish.
    #[must_use]
    pub fn chunk_size(&self, wanted: u32) -> usize {
        let setpoint_bytes = 8 * self.columns.len().max(1);
        match wanted {
            0 => DEFAULT_CHUNK_SIZE.min(DEFAULT_CHUNK_BYTES / setpoint_bytes),
            wanted => (wanted as usize).min(MAX_CHUNK_BYTES / setpoint_bytes),
        }
        .max(1)
    }
}

/// Where a client wants a stream to start.
#[derive(Clone, Copy, Debug, PartialEq)]
enum StreamStart {
    /// At this setpoint.
    Index(u64),
    /// At the first setpoint at or after this time, s.
    Time(f64),
}

impl StreamStart {
    fn check(violations: &mut Violations, start: Option<Start>) -> Self {
        match start {
            None => Self::Index(0),
            Some(Start::StartIndex(index)) => Self::Index(index),
            Some(Start::StartTimeS(time_s)) => {
                if !(time_s.is_finite() && time_s >= 0.0) {
                    violations.add("start_time_s", format!("must be a finite number, not negative, is {time_s}"));
                }
                Self::Time(time_s)
            }
        }
    }

    /// Index of the first setpoint at `period_us` from one to the next.
    fn index(self, period_us: f64) -> u64 {
        match self {
            Self::Index(index) => index,
            Self::Time(time_s) => setpoint_index_at(time_s, period_us),
        }
    }
}

/// What a client wants to have streamed, checked.
#[derive(Clone, Debug)]
pub struct StreamPlan {
    /// Configuration of the pipeline.
    pub config: PipelineConfig,
    /// Columns and their encoding.
    pub columns: ColumnSet,
    /// Setpoints per chunk.
    pub chunk_size: usize,
    /// Servo periods per interpolation period where the stream is expanded to them.
    pub expand: Option<u32>,
    /// Index of the first setpoint to send.
    pub first_index: u64,
    /// Whether it is the job's own plan, and not one with another period, mode or feed.
    pub is_own: bool,
}

impl StreamPlan {
    /// What a request asks for of a job with this configuration. What it leaves open is as the job has it; every problem is
    /// added to `violations`, and then the plan is worth nothing.
    pub fn check(violations: &mut Violations, request: &proto::StreamSetpointsRequest, own: &PipelineConfig) -> Self {
        let start = StreamStart::check(violations, request.start);
        let encoding = match enumeration(violations, "encoding", request.encoding) {
            Some(encoding @ (proto::Encoding::FixedPointDelta | proto::Encoding::RawDouble)) => encoding,
            _ => proto::Encoding::PackedDouble,
        };
        let frame = match enumeration(violations, "frame", request.frame) {
            Some(proto::Frame::Work) => Frame::Work,
            _ => Frame::Machine,
        };
        if request.chunk_size > MAX_CHUNK_SIZE {
            violations.add("chunk_size", format!("must be at most {MAX_CHUNK_SIZE}, is {}", request.chunk_size));
        }
        let generation_mode = enumeration(violations, "generation_mode", request.generation_mode);
        let servo_output = enumeration(violations, "servo_output", request.servo_output);
        let servo_output: proto::ServoOutput = servo_output.unwrap_or_default();
        let period_us = check_period_us(violations, request.interpolation_period_us, own.interpolation_period_us);
        let overrides = overrides_from_proto(violations, "overrides", &request.overrides, period_us);
        let config = PipelineConfig {
            overrides,
            interpolation_period_us: period_us,
            generation_mode: generation_mode.and_then(generation_mode_from_proto).unwrap_or(own.generation_mode),
            frame,
            ..own.clone()
        };
        let servo_side = config.generation_mode == GenerationMode::ServoSide;
        let expanded = servo_side && servo_output == proto::ServoOutput::Expanded;
        let expand = expanded.then_some(config.profile.vibration.servo_substeps);
        let directions = frame == Frame::Work && config.profile.kinematics.is_some() && !expanded;
        let machine = &config.profile.machine;
        let wanted = &request.columns;
        let columns = ColumnSet::select(violations, wanted, machine, servo_side && !expanded, directions, encoding);
        let is_own = period_us == own.interpolation_period_us
            && config.generation_mode == own.generation_mode
            && config.overrides.is_empty();
        let first_index = start.index(f64::from(period_us) / f64::from(expand.unwrap_or(1)));
        let chunk_size = columns.chunk_size(request.chunk_size);
        Self { config, columns, chunk_size, expand, first_index, is_own }
    }

    /// Setpoints of the stream's plan where the job's own has so many.
    #[must_use]
    pub fn setpoint_count(&self, own: u64) -> u64 {
        // The first setpoint has no servo periods before it.
        self.expand.map_or(own, |substeps| own.saturating_sub(1) * u64::from(substeps) + 1)
    }

    /// The header of the stream; `setpoint_count` where it is known.
    #[must_use]
    pub fn header(&self, setpoint_count: Option<u64>) -> proto::StreamHeader {
        let config = &self.config;
        proto::StreamHeader {
            period_us: f64::from(config.interpolation_period_us) / f64::from(self.expand.unwrap_or(1)),
            first_index: self.first_index,
            setpoint_count,
            encoding: self.columns.encoding.into(),
            frame: match config.frame {
                Frame::Machine => proto::Frame::Machine,
                Frame::Work => proto::Frame::Work,
            }
            .into(),
            generation_mode: generation_mode_to_proto(config.generation_mode).into(),
            columns: self.columns.infos.clone(),
        }
    }

    /// The first setpoint of the interpolation that the stream needs: expanding needs the one before the first.
    #[must_use]
    pub fn first_block_index(&self) -> u64 {
        match self.expand {
            Some(substeps) => self.first_index.div_ceil(u64::from(substeps)).saturating_sub(1),
            None => self.first_index,
        }
    }
}

/// What became of the next setpoints of a stream.
#[derive(Debug)]
pub enum StreamStep<'a> {
    /// The pipeline needs bytes from this place on: [`Rows::push`] or [`Rows::finish_input`].
    NeedInput(Place),
    /// So many setpoints of the interpolation lie before the stream's start.
    Skipped(u64),
    /// These rows of a block.
    Rows(&'a SetpointBlock, Range<usize>),
    /// There are no more; the stream's plan has so many setpoints.
    Finished(u64),
    /// The program cannot be run with what the stream asks for.
    Refused,
}

/// The rows of a stream, in turn.
pub struct Rows {
    pipeline: Pipeline,
    block: SetpointBlock,
    expander: Option<ServoExpander>,
    expand: Option<u32>,
    first_index: u64,
    first_block_index: u64,
    /// Setpoints so far, by the stream's own index.
    end: u64,
    /// Setpoints of the next block at most.
    most: usize,
}

impl Rows {
    /// The rows of a plan from a pipeline that is at or before its first setpoint.
    #[must_use]
    pub fn new(plan: &StreamPlan, pipeline: Pipeline) -> Self {
        let machine = &plan.config.profile.machine;
        Self {
            block: pipeline.new_block(),
            pipeline,
            expander: plan.expand.map(|substeps| ServoExpander::new(machine, substeps, plan.config.period_s())),
            expand: plan.expand,
            first_index: plan.first_index,
            first_block_index: plan.first_block_index(),
            end: 0,
            // The first setpoints do not wait for a whole block.
            most: FIRST_CHUNK_SIZE,
        }
    }

    /// The rows of a plan from the program's start.
    #[must_use]
    pub fn from_start(plan: &StreamPlan) -> Self {
        Self::new(plan, Pipeline::new(Arc::new(plan.config.clone())))
    }

    /// Gives the pipeline bytes from the place on that it asked for.
    pub fn push(&mut self, bytes: &[u8]) {
        self.pipeline.push(bytes);
    }

    /// Says that the program ends at the place that was asked for.
    pub fn finish_input(&mut self) {
        self.pipeline.finish_input();
    }

    /// What comes next.
    pub fn step(&mut self) -> StreamStep<'_> {
        match self.pipeline.next_setpoints(&mut self.block, self.most) {
            Step::NeedInput(place) => StreamStep::NeedInput(place),
            Step::Finished => StreamStep::Finished(self.end),
            Step::Refused => StreamStep::Refused,
            Step::Block => {
                self.most = BLOCK_LENGTH;
                let count = self.block.len() as u64;
                if count == 0 {
                    // Setpoints have stopped at an error.
                    return StreamStep::Skipped(0);
                }
                if self.block.first_index + count <= self.first_block_index {
                    self.end = (self.block.first_index + count - 1) * u64::from(self.expand.unwrap_or(1)) + 1;
                    return StreamStep::Skipped(count);
                }
                let block = match &mut self.expander {
                    Some(expander) => expander.expand(&self.block),
                    None => &self.block,
                };
                self.end = block.first_index + block.len() as u64;
                let skipped = self.first_index.saturating_sub(block.first_index).min(block.len() as u64);
                StreamStep::Rows(block, skipped as usize..block.len())
            }
        }
    }

    /// The first error of a program that was refused.
    #[must_use]
    pub fn refusal(&self) -> Option<&Finding> {
        self.pipeline.findings().findings().iter().find(|finding| finding.severity == Severity::Error)
    }
}

/// Why a program is refused that is valid without what the stream asks for; `first` is its first error.
#[must_use]
pub fn refusal_message(first: Option<&Finding>) -> String {
    let reason = first.map_or_else(String::new, |finding| {
        format!(": {} in line {}: {}", finding.code, finding.span.line, finding.message)
    });
    format!("the program is refused with what the stream asks for{reason}")
}

/// Why a stream cannot start behind its plan's end.
#[must_use]
pub fn beyond_end_message(first_index: u64, setpoint_count: u64) -> String {
    format!("the stream has {setpoint_count} setpoints, it cannot start at {first_index}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_means_the_first_setpoint_at_or_after_it() {
        assert_eq!(StreamStart::Time(0.0).index(1_000.0), 0);
        assert_eq!(StreamStart::Time(0.1).index(1_000.0), 100);
        assert_eq!(StreamStart::Time(0.100_4).index(1_000.0), 101);
        assert_eq!(StreamStart::Time(0.001).index(125.0), 8);
        assert_eq!(StreamStart::Index(7).index(1_000.0), 7);
    }
}
