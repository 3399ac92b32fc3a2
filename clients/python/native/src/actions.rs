//! The actions of a program.

use std::sync::Arc;

use feedwave_contract::convert::{action_to_proto, finding_to_proto};
use feedwave_contract::proto;
use feedwave_cutting::{Interpretation, InterpretationStep, PipelineConfig};
use prost::Message as _;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::source::{Signals, Source};

/// An iterator over `InterpretResponse` as bytes: actions, in the last one the findings.
#[pyclass(module = "feedwave._native")]
pub(crate) struct Actions {
    /// None behind the last message.
    reading: Option<Reading>,
}

/// What works without Python's lock.
struct Reading {
    interpretation: Interpretation,
    programs: Arc<[String]>,
    source: Source,
    signals: Signals,
}

impl Actions {
    pub(crate) fn new(config: &PipelineConfig, source: Source) -> Self {
        let interpretation = Interpretation::new(config);
        let programs = config.programs.clone();
        Self { reading: Some(Reading { interpretation, programs, source, signals: Signals::default() }) }
    }
}

#[pymethods]
impl Actions {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyBytes>>> {
        let Some(mut reading) = self.reading.take() else { return Ok(None) };
        let (message, reading) = py.detach(move || match reading.next_actions()? {
            Some(message) => PyResult::Ok((message, Some(reading))),
            None => Ok((reading.findings(), None)),
        })?;
        self.reading = reading;
        Ok(Some(PyBytes::new(py, &message.encode_to_vec())))
    }
}

impl Reading {
    /// The next actions; none at the end of the program.
    fn next_actions(&mut self) -> PyResult<Option<proto::InterpretResponse>> {
        loop {
            self.signals.step()?;
            let step = self.interpretation.step();
            let operations = self.interpretation.take_operations();
            let actions: Vec<_> = operations.map(|operation| action_to_proto(&operation, &self.programs)).collect();
            if let InterpretationStep::NeedInput(place) = step {
                let interpretation = &mut self.interpretation;
                self.source.read(place, |piece| match piece {
                    [] => interpretation.finish_input(),
                    piece => interpretation.push(piece),
                })?;
            }
            if !actions.is_empty() {
                return Ok(Some(proto::InterpretResponse { actions, ..Default::default() }));
            }
            if matches!(step, InterpretationStep::Ended) {
                return Ok(None);
            }
        }
    }

    /// The last message.
    fn findings(self) -> proto::InterpretResponse {
        let found = self.interpretation.into_findings().into_sorted();
        let findings = found.iter().map(|finding| finding_to_proto(finding, &self.programs)).collect();
        proto::InterpretResponse { findings, complete: true, ..Default::default() }
    }
}
