//! Setpoints in batches.

use feedwave_contract::columns::Column;
use feedwave_contract::stream::{Rows, StreamPlan, StreamStep, beyond_end_message, refusal_message};
use feedwave_contract::{proto, raw_double};
use prost::Message as _;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::refusal::refused;
use crate::source::{Signals, Source};

/// A batch as Python takes it: index of the first setpoint, columns, lines.
type Taken<'py> = (u64, Vec<Bound<'py, PyBytes>>, Bound<'py, PyBytes>);

/// An iterator over batches of setpoints: index of the first one, little-endian doubles of each column, and
/// little-endian numbers of 32 bits of the lines.
#[pyclass(module = "feedwave._native")]
pub(crate) struct Setpoints {
    header: proto::StreamHeader,
    generation: Generation,
    ended: bool,
}

/// What works without Python's lock.
struct Generation {
    rows: Rows,
    source: Source,
    signals: Signals,
    columns: Vec<Column>,
    first_index: u64,
    batch_size: usize,
    /// What is generated and not taken.
    batch: Batch,
    finished: bool,
}

/// Columns as bytes.
#[derive(Default)]
struct Batch {
    first_index: u64,
    count: usize,
    columns: Vec<Vec<u8>>,
    lines: Vec<u8>,
}

impl Setpoints {
    pub(crate) fn new(plan: &StreamPlan, source: Source, setpoint_count: u64) -> PyResult<Self> {
        let setpoint_count = plan.is_own.then(|| plan.setpoint_count(setpoint_count));
        if let Some(count) = setpoint_count.filter(|count| plan.first_index > *count) {
            return Err(beyond_end(plan.first_index, count));
        }
        let columns = plan.columns.columns().to_vec();
        let generation = Generation {
            rows: Rows::from_start(plan),
            source,
            signals: Signals::default(),
            batch: Batch::new(plan.first_index, columns.len()),
            columns,
            first_index: plan.first_index,
            batch_size: plan.chunk_size,
            finished: false,
        };
        Ok(Self { header: plan.header(setpoint_count), generation, ended: false })
    }
}

#[pymethods]
impl Setpoints {
    /// The `StreamHeader` as bytes.
    fn header<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.header.encode_to_vec())
    }

    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Taken<'py>>> {
        if self.ended {
            return Ok(None);
        }
        // Whatever goes wrong, nothing comes behind it.
        self.ended = true;
        let generation = &mut self.generation;
        let batch = py.detach(|| generation.next_batch())?;
        if batch.count == 0 {
            return Ok(None);
        }
        self.ended = false;
        let columns = batch.columns.iter().map(|column| PyBytes::new(py, column)).collect();
        Ok(Some((batch.first_index, columns, PyBytes::new(py, &batch.lines))))
    }
}

impl Generation {
    /// The next setpoints; none at the end.
    fn next_batch(&mut self) -> PyResult<Batch> {
        while !self.finished && self.batch.count < self.batch_size {
            self.signals.step()?;
            match self.rows.step() {
                StreamStep::NeedInput(place) => {
                    let rows = &mut self.rows;
                    self.source.read(place, |piece| match piece {
                        [] => rows.finish_input(),
                        piece => rows.push(piece),
                    })?;
                }
                StreamStep::Skipped(_) => {}
                StreamStep::Rows(block, range) => {
                    let batch = &mut self.batch;
                    batch.count += range.len();
                    for (column, bytes) in self.columns.iter().zip(&mut batch.columns) {
                        // Selection permits a column only where blocks have it.
                        raw_double::encode(&column.values(block).unwrap_or_default()[range.clone()], bytes);
                    }
                    batch.lines.extend(block.line[range].iter().flat_map(|line| line.to_le_bytes()));
                }
                StreamStep::Finished(end) => {
                    if self.first_index > end {
                        return Err(beyond_end(self.first_index, end));
                    }
                    self.finished = true;
                }
                StreamStep::Refused => {
                    let message = refusal_message(self.rows.refusal());
                    return Err(refused("FAILED_PRECONDITION", "PROGRAM_REFUSED", message));
                }
            }
        }
        Ok(self.batch.take(self.batch_size))
    }
}

impl Batch {
    fn new(first_index: u64, columns: usize) -> Self {
        Self { first_index, columns: vec![Vec::new(); columns], ..Self::default() }
    }

    /// Takes the first setpoints, `most` of them at most.
    fn take(&mut self, most: usize) -> Self {
        let taken = self.count.min(most);
        let cut = |bytes: &mut Vec<u8>, size: usize| {
            let rest = bytes.split_off(taken * size);
            std::mem::replace(bytes, rest)
        };
        let first = Self {
            first_index: self.first_index,
            count: taken,
            columns: self.columns.iter_mut().map(|column| cut(column, size_of::<f64>())).collect(),
            lines: cut(&mut self.lines, size_of::<u32>()),
        };
        self.first_index += taken as u64;
        self.count -= taken;
        first
    }
}

fn beyond_end(first_index: u64, setpoint_count: u64) -> PyErr {
    refused("OUT_OF_RANGE", "START_BEYOND_END", beyond_end_message(first_index, setpoint_count))
}
