//! A program's settings, and validation with them.

use std::borrow::Cow;
use std::sync::Arc;

use feedwave_contract::convert::{
    improvement_goals_from_proto, improvement_to_proto, pipeline_config, profile_from_proto, report_to_proto,
    settings_from_proto,
};
use feedwave_contract::proto;
use feedwave_contract::stream::StreamPlan;
use feedwave_contract::violations::Violations;
use feedwave_cutting::{PipelineConfig, Step, Surroundings, Validation, ValidationReport, improve};
use feedwave_program::Place;
use prost::Message as _;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::actions::Actions;
use crate::refusal::{decoded, finish};
use crate::setpoints::Setpoints;
use crate::source::{Signals, Source};

/// A machine and the settings with which programs are run on it.
#[pyclass(frozen, module = "feedwave._native")]
#[derive(Debug)]
pub(crate) struct Job {
    config: PipelineConfig,
}

#[pymethods]
impl Job {
    /// From a `MachineProfile` and `JobSettings` as bytes. Of further files the settings have the names.
    #[new]
    fn new(profile: &[u8], settings: &[u8]) -> PyResult<Self> {
        let mut violations = Violations::default();
        let profile = profile_from_proto(&mut violations, "profile", &decoded(profile)?);
        let settings: proto::JobSettings = decoded(settings)?;
        let config = profile.map(|profile| {
            let settings = settings_from_proto(&mut violations, &profile, &settings);
            pipeline_config(profile, &settings)
        });
        finish(violations)?;
        let config = config
            .ok_or_else(|| crate::refused("INTERNAL", "", "a profile was neither read nor refused".to_owned()))?;
        Ok(Self { config })
    }

    /// The `ValidationReport` of a program as bytes; of the `StreamSetpointsRequest` only the changes of the feed count.
    fn validate<'py>(&self, py: Python<'py>, request: &[u8], read: Py<PyAny>) -> PyResult<Bound<'py, PyBytes>> {
        let config = Arc::new(self.plan(request)?.config);
        let report = py.detach(|| validate(config, &Source::new(read)))?;
        Ok(PyBytes::new(py, &report_to_proto(&report).encode_to_vec()))
    }

    /// Improves a program for `ImprovementGoals` as bytes: an `Improvement` as bytes, and the program that came out. Only further files are
    /// read.
    fn improve<'py>(
        &self,
        py: Python<'py>,
        goals: &[u8],
        program: &[u8],
        read: Py<PyAny>,
    ) -> PyResult<(Bound<'py, PyBytes>, Bound<'py, PyBytes>)> {
        let mut violations = Violations::default();
        let requested = improvement_goals_from_proto(&mut violations, "goals", Some(&decoded(goals)?));
        finish(violations)?;
        let goals = requested.on(&self.config.profile);
        let config = Arc::new(self.config.clone());
        let mut files = FurtherFiles { source: Source::new(read), signals: Signals::default() };
        let improvement = py.detach(|| improve(program, &config, &goals, &mut files))?;
        let message = improvement_to_proto(&improvement, &goals).encode_to_vec();
        Ok((PyBytes::new(py, &message), PyBytes::new(py, &improvement.program)))
    }

    /// The setpoints that a `StreamSetpointsRequest` asks for, of a program whose plan has `setpoint_count`.
    fn setpoints(&self, request: &[u8], read: Py<PyAny>, setpoint_count: u64) -> PyResult<Setpoints> {
        Setpoints::new(&self.plan(request)?, Source::new(read), setpoint_count)
    }

    /// The actions of a program.
    fn actions(&self, read: Py<PyAny>) -> Actions {
        Actions::new(&self.config, Source::new(read))
    }
}

impl Job {
    fn plan(&self, request: &[u8]) -> PyResult<StreamPlan> {
        let mut violations = Violations::default();
        let plan = StreamPlan::check(&mut violations, &decoded(request)?, &self.config);
        finish(violations)?;
        Ok(plan)
    }
}

/// The further files of a program that is improved.
struct FurtherFiles {
    source: Source,
    signals: Signals,
}

impl Surroundings for FurtherFiles {
    type Error = PyErr;

    fn further(&mut self, place: Place) -> PyResult<Cow<'_, [u8]>> {
        let mut bytes = Vec::new();
        self.source.read(place, |piece| bytes.extend_from_slice(piece))?;
        Ok(Cow::Owned(bytes))
    }

    fn step(&mut self) -> PyResult<()> {
        self.signals.step()
    }
}

fn validate(config: Arc<PipelineConfig>, source: &Source) -> PyResult<ValidationReport> {
    let mut validation = Validation::new(config);
    let mut signals = Signals::default();
    loop {
        match validation.step() {
            Step::NeedInput(place) => source.read(place, |piece| match piece {
                [] => validation.finish_input(),
                piece => validation.push(piece),
            })?,
            Step::Block => signals.step()?,
            Step::Finished | Step::Refused => return Ok(validation.finish()),
        }
    }
}
