//! From setpoint blocks to the chunks of a stream.

use std::ops::Range;

use feedwave_contract::stream::{ColumnSet, FIRST_CHUNK_SIZE};
use feedwave_contract::{delta, proto, raw_double};
use feedwave_cutting::SetpointBlock;

/// By how much the next chunks grow.
const CHUNK_GROWTH: usize = 4;

/// Gathers setpoints into chunks.
pub(super) struct ChunkWriter<'a> {
    columns: &'a ColumnSet,
    chunk_size: usize,
    /// Setpoints in the present chunk.
    wanted: usize,
    chunk: proto::SetpointChunk,
    /// Steps of the last value of each column, for the next difference.
    last_steps: Vec<i64>,
    /// Raw doubles of the present chunk, by column.
    raw: Vec<Vec<u8>>,
}

impl<'a> ChunkWriter<'a> {
    pub(super) fn new(columns: &'a ColumnSet, chunk_size: usize, first_index: u64) -> Self {
        let mut writer = Self {
            columns,
            chunk_size,
            wanted: chunk_size.min(FIRST_CHUNK_SIZE),
            chunk: proto::SetpointChunk::default(),
            last_steps: Vec::new(),
            raw: Vec::new(),
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
        for (index, (column, into)) in columns.columns().iter().zip(&mut self.chunk.columns).enumerate() {
            // Selection permits a column only where blocks have it.
            let values = &column.values(block).unwrap_or_default()[rows.clone()];
            match columns.encoding() {
                proto::Encoding::FixedPointDelta => {
                    let last = &mut self.last_steps[index];
                    *last = delta::encode(values, column.steps_per_unit, *last, &mut into.deltas);
                }
                proto::Encoding::RawDouble => raw_double::encode(values, &mut self.raw[index]),
                proto::Encoding::PackedDouble | proto::Encoding::Unspecified => into.values.extend_from_slice(values),
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
        let mut full = std::mem::take(&mut self.chunk);
        for (column, raw) in full.columns.iter_mut().zip(&mut self.raw) {
            column.raw = std::mem::take(raw).into();
        }
        self.wanted = (CHUNK_GROWTH * self.wanted).min(self.chunk_size);
        self.begin(next);
        full
    }

    fn begin(&mut self, first_index: u64) {
        let encoding = self.columns.encoding();
        let room = |of| if encoding == of { self.wanted } else { 0 };
        let column = || proto::Column {
            values: Vec::with_capacity(room(proto::Encoding::PackedDouble)),
            deltas: Vec::with_capacity(room(proto::Encoding::FixedPointDelta)),
            ..Default::default()
        };
        let raw_bytes = size_of::<f64>() * room(proto::Encoding::RawDouble);
        self.raw = self.columns.columns().iter().map(|_| Vec::with_capacity(raw_bytes)).collect();
        self.chunk = proto::SetpointChunk {
            first_index,
            columns: self.columns.columns().iter().map(|_| column()).collect(),
            ..Default::default()
        };
        self.last_steps.clear();
        self.last_steps.resize(self.columns.columns().len(), 0);
    }
}

#[cfg(test)]
mod tests;
