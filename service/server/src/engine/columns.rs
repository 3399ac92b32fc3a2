//! From setpoint blocks to the chunks of a stream: which columns, in which encoding, how many setpoints at a time.

use std::ops::Range;

use feedwave_contract::{delta, proto};
use feedwave_cutting::SetpointBlock;
use feedwave_motion::Machine;
use proto::ColumnKind as Kind;

use crate::error::Violations;

/// Most setpoints that a client can ask for per chunk.
pub const MAX_CHUNK_SIZE: u32 = 1 << 17;
/// Setpoints per chunk unless the client says otherwise, bounded by [`USUAL_CHUNK_BYTES`].
const USUAL_CHUNK_SIZE: usize = 8_192;
/// Setpoints in the first chunk, which is sent as soon as they are there. With a period of 20 ms they are more than a
/// second of machining, while the next ones are generated.
pub(super) const FIRST_CHUNK_SIZE: usize = 64;
/// By how much the next chunks grow.
const CHUNK_GROWTH: usize = 4;
/// Size of a chunk unless the client says otherwise, bytes as packed doubles: where a stream is fastest.
const USUAL_CHUNK_BYTES: usize = 256 << 10;
/// Largest chunk, bytes as packed doubles: well below the 4 MiB that clients accept by default.
const MAX_CHUNK_BYTES: usize = 2 << 20;

/// Kinds that every stream has, in the order in which they are sent.
const USUAL_KINDS: [Kind; 5] =
    [Kind::AxisPosition, Kind::PathPosition, Kind::Feed, Kind::VibrationOffset, Kind::SpindleAngle];
/// Kinds that conditions for the drives have in addition.
const SERVO_KINDS: [Kind; 5] =
    [Kind::ServoAmplitude, Kind::ServoFrequency, Kind::ServoPhase, Kind::ServoClampLow, Kind::ServoClampHigh];

/// Axes of a vector in work coordinates.
const VECTOR_AXES: [&str; 3] = ["x", "y", "z"];

/// One column: its kind and, where the kind comes once per axis (of the machine, or of a vector), the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ColumnSource {
    kind: Kind,
    axis: usize,
}

/// The columns of a stream and their encoding.
#[derive(Clone, Debug)]
pub struct ColumnSet {
    sources: Vec<ColumnSource>,
    infos: Vec<proto::ColumnInfo>,
    /// Steps per unit of each column in fixed-point encoding.
    steps_per_unit: Vec<f64>,
    encoding: proto::Encoding,
}

const fn is_per_axis(kind: Kind) -> bool {
    matches!(kind, Kind::AxisPosition | Kind::ServoAmplitude | Kind::ServoClampLow | Kind::ServoClampHigh)
}

/// Steps per unit: a nanometre, a microdegree, a microhertz, a billionth of a turn or of a unit vector.
const fn steps_per_unit(kind: Kind) -> f64 {
    match kind {
        Kind::ServoPhase | Kind::ToolDirection => 1e9,
        _ => 1e6,
    }
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
        let servo_kinds: &[Kind] = if conditions { &SERVO_KINDS } else { &[] };
        let direction_kind = directions.then_some(Kind::ToolDirection);
        let available: Vec<Kind> = USUAL_KINDS.iter().chain(servo_kinds).copied().chain(direction_kind).collect();
        for (index, value) in wanted.iter().enumerate() {
            let field = format!("columns[{index}]");
            match Kind::try_from(*value) {
                Ok(kind) if available.contains(&kind) => {}
                Ok(kind) if SERVO_KINDS.contains(&kind) => {
                    violations.add(field, "only servo-side mode with conditions as its output has this column");
                }
                Ok(Kind::ToolDirection) => {
                    violations.add(field, "only work coordinates of a machine with kinematics have this column");
                }
                _ => violations.add(field, format!("{value} is not a column")),
            }
        }
        let kinds = available.into_iter().filter(|kind| wanted.is_empty() || wanted.contains(&i32::from(*kind)));
        let sources: Vec<ColumnSource> = kinds
            .flat_map(|kind| {
                let count = match kind {
                    Kind::ToolDirection => VECTOR_AXES.len(),
                    _ if is_per_axis(kind) => machine.axes.len(),
                    _ => 1,
                };
                (0..count).map(move |axis| ColumnSource { kind, axis })
            })
            .collect();
        let infos = sources.iter().map(|source| source.info(machine, encoding)).collect();
        let steps_per_unit = sources.iter().map(|source| steps_per_unit(source.kind)).collect();
        Self { sources, infos, steps_per_unit, encoding }
    }

    /// What the header says about the columns.
    #[must_use]
    pub fn infos(&self) -> &[proto::ColumnInfo] {
        &self.infos
    }

    /// Setpoints per chunk when the client asks for `wanted`, 0 for no wish.
    #[must_use]
    pub fn chunk_size(&self, wanted: u32) -> usize {
        let setpoint_bytes = 8 * self.sources.len().max(1);
        match wanted {
            0 => USUAL_CHUNK_SIZE.min(USUAL_CHUNK_BYTES / setpoint_bytes),
            wanted => (wanted as usize).min(MAX_CHUNK_BYTES / setpoint_bytes),
        }
        .max(1)
    }
}

impl ColumnSource {
    fn info(self, machine: &Machine, encoding: proto::Encoding) -> proto::ColumnInfo {
        let axis = is_per_axis(self.kind).then(|| &machine.axes[self.axis]);
        let axis_unit = if axis.is_some_and(|axis| axis.axis.is_rotary()) { "deg" } else { "mm" };
        let axis_name = axis.map(|axis| axis.name.clone()).unwrap_or_default();
        let lower = axis_name.to_ascii_lowercase();
        let (name, unit) = match self.kind {
            Kind::AxisPosition => (format!("{lower}_{axis_unit}"), axis_unit),
            Kind::PathPosition => ("path_position_mm".to_owned(), "mm"),
            Kind::Feed => ("feed_mm_per_min".to_owned(), "mm/min"),
            Kind::VibrationOffset => ("vibration_offset_mm".to_owned(), "mm"),
            Kind::SpindleAngle => ("spindle_angle_deg".to_owned(), "deg"),
            Kind::ServoAmplitude => (format!("{lower}_amplitude_mm"), "mm"),
            Kind::ServoFrequency => ("vibration_frequency_hz".to_owned(), "Hz"),
            Kind::ServoPhase => ("vibration_phase_turns".to_owned(), "turns"),
            Kind::ServoClampLow => (format!("{lower}_clamp_low_mm"), "mm"),
            Kind::ServoClampHigh => (format!("{lower}_clamp_high_mm"), "mm"),
            Kind::ToolDirection => (format!("tool_direction_{}", VECTOR_AXES[self.axis]), ""),
            Kind::Unspecified => (String::new(), ""),
        };
        let resolution = match encoding {
            proto::Encoding::FixedPointDelta => 1.0 / steps_per_unit(self.kind),
            _ => 0.0,
        };
        proto::ColumnInfo { kind: self.kind.into(), name, axis: axis_name, unit: unit.to_owned(), resolution }
    }

    fn values(self, block: &SetpointBlock) -> &[f64] {
        match (self.kind, &block.servo) {
            (Kind::AxisPosition, _) => &block.axes[self.axis],
            (Kind::PathPosition, _) => &block.path_position_mm,
            (Kind::Feed, _) => &block.feed_mm_per_min,
            (Kind::VibrationOffset, _) => &block.vibration_offset_mm,
            (Kind::SpindleAngle, _) => &block.spindle_angle_deg,
            (Kind::ToolDirection, _) => &block.tool_direction[self.axis],
            (Kind::ServoAmplitude, Some(servo)) => &servo.amplitude_mm[self.axis],
            (Kind::ServoFrequency, Some(servo)) => &servo.frequency_hz,
            (Kind::ServoPhase, Some(servo)) => &servo.phase_turns,
            (Kind::ServoClampLow, Some(servo)) => &servo.clamp_low_mm[self.axis],
            (Kind::ServoClampHigh, Some(servo)) => &servo.clamp_high_mm[self.axis],
            // Selection lets these through only where blocks have conditions.
            (_, None) | (Kind::Unspecified, _) => &[],
        }
    }
}

/// Gathers setpoints into chunks.
pub(super) struct ChunkWriter<'a> {
    columns: &'a ColumnSet,
    chunk_size: usize,
    /// Setpoints in the present chunk.
    wanted: usize,
    chunk: proto::SetpointChunk,
    /// Steps of the last value of each column, for the next difference.
    last_steps: Vec<i64>,
}

impl<'a> ChunkWriter<'a> {
    pub(super) fn new(columns: &'a ColumnSet, chunk_size: usize, first_index: u64) -> Self {
        let mut writer = Self {
            columns,
            chunk_size,
            wanted: chunk_size.min(FIRST_CHUNK_SIZE),
            chunk: proto::SetpointChunk::default(),
            last_steps: Vec::new(),
        };
        writer.begin(first_index);
        writer
    }

    /// Adds these rows of a block; full chunks go to `send`. Stops when `send` reports that the receiver is gone.
    pub(super) fn write(
        &mut self,
        block: &SetpointBlock,
        mut rows: Range<usize>,
        mut send: impl FnMut(proto::SetpointChunk) -> bool,
    ) -> bool {
        while !rows.is_empty() {
            let free = self.wanted - self.chunk.count as usize;
            let taken = rows.start..rows.end.min(rows.start + free);
            rows.start = taken.end;
            self.append(block, taken);
            if self.chunk.count as usize == self.wanted && !send(self.take()) {
                return false;
            }
        }
        true
    }

    /// The last chunk, where there is something left.
    pub(super) fn finish(mut self) -> Option<proto::SetpointChunk> {
        (self.chunk.count > 0).then(|| self.take())
    }

    fn append(&mut self, block: &SetpointBlock, rows: Range<usize>) {
        let columns = self.columns;
        let fixed_point = columns.encoding == proto::Encoding::FixedPointDelta;
        for (index, (source, column)) in columns.sources.iter().zip(&mut self.chunk.columns).enumerate() {
            let values = &source.values(block)[rows.clone()];
            if fixed_point {
                let last = &mut self.last_steps[index];
                *last = delta::encode(values, columns.steps_per_unit[index], *last, &mut column.deltas);
            } else {
                column.values.extend_from_slice(values);
            }
        }
        let lines = &block.line[rows.clone()];
        for run in lines.chunk_by(|a, b| a == b) {
            let (line, count) = (run[0], run.len() as u32);
            match self.chunk.line_runs.last_mut() {
                Some(last) if last.line == line => last.count += count,
                _ => self.chunk.line_runs.push(proto::LineRun { line, count }),
            }
        }
        self.chunk.count += rows.len() as u32;
    }

    fn take(&mut self) -> proto::SetpointChunk {
        let next = self.chunk.first_index + u64::from(self.chunk.count);
        let full = std::mem::take(&mut self.chunk);
        self.wanted = (CHUNK_GROWTH * self.wanted).min(self.chunk_size);
        self.begin(next);
        full
    }

    fn begin(&mut self, first_index: u64) {
        let fixed_point = self.columns.encoding == proto::Encoding::FixedPointDelta;
        let column = || proto::Column {
            values: Vec::with_capacity(if fixed_point { 0 } else { self.wanted }),
            deltas: Vec::with_capacity(if fixed_point { self.wanted } else { 0 }),
        };
        self.chunk = proto::SetpointChunk {
            first_index,
            columns: self.columns.sources.iter().map(|_| column()).collect(),
            ..Default::default()
        };
        self.last_steps.clear();
        self.last_steps.resize(self.columns.sources.len(), 0);
    }
}

#[cfg(test)]
mod tests;
