//! What a run of the pipeline is given.

use std::sync::Arc;

use feedwave_program::{Interpreter, InterpreterState, ToolOffset};
use serde::{Deserialize, Serialize};

use crate::frame::profile::MachineProfile;
use crate::functions::path_vibration::{GenerationMode, VibrationEnvelope, VibrationSettings};
use crate::functions::tool_oscillation::OscillationRequest;
use crate::shared::setpoint::Frame;
use crate::shared::tool::Tool;

/// What a run of the pipeline is for; immutable while it runs.
#[derive(Clone, Debug, PartialEq)]
pub struct PipelineConfig {
    /// The machine.
    pub profile: MachineProfile,
    /// Interpolation period, µs: [`MIN_PERIOD_US`] to [`MAX_PERIOD_US`].
    pub interpolation_period_us: u32,
    /// How the vibration is generated; the profile's mode unless the request says otherwise.
    pub generation_mode: GenerationMode,
    /// How the vibration begins and ends; as the profile says unless the request says otherwise.
    pub vibration_envelope: VibrationEnvelope,
    /// Coordinates of the axis columns.
    pub frame: Frame,
    /// Changes of the feed override, ascending by index. What they act on is planned at 100 % before the first.
    pub overrides: Vec<OverrideChange>,
    /// Changes of the spindle speed, ascending by index, each at a place where one is possible. `None`: the speed is the
    /// program's, and the pipeline stops at none of these places (docs/functions/adaptive-feed.md, "Planned changes of the
    /// spindle speed").
    pub spindle_changes: Option<Vec<SpindleChange>>,
    /// Tools known for this job; a `T` word outside the list is a finding when the list is not empty.
    pub tools: Vec<Tool>,
    /// Names of the job's further program files, in the order of their places ([`feedwave_program::Place::program`] 1 and on).
    pub programs: Arc<[String]>,
    /// What the job asks of the oscillations of its program.
    pub oscillation: OscillationRequest,
    /// Runs every block even where the program has blocks thinned: what thinning is compared with.
    pub every_block: bool,
}

impl PipelineConfig {
    /// Default period, the profile's generation mode, machine coordinates, no tool list.
    #[must_use]
    pub fn new(profile: MachineProfile) -> Self {
        let VibrationSettings { generation_mode, envelope: vibration_envelope, .. } = profile.vibration;
        Self {
            profile,
            interpolation_period_us: DEFAULT_PERIOD_US,
            generation_mode,
            vibration_envelope,
            frame: Frame::Machine,
            overrides: Vec::new(),
            spindle_changes: None,
            tools: Vec::new(),
            programs: Arc::new([]),
            oscillation: OscillationRequest::default(),
            every_block: false,
        }
    }

    /// The table of tool offsets: one row for each tool, with its number.
    #[must_use]
    pub fn tool_offsets(&self) -> Vec<ToolOffset> {
        self.tools.iter().map(|tool| ToolOffset { number: tool.number, ..tool.offset }).collect()
    }

    /// An interpreter before the first line of the job's program: what every reader of it begins with.
    #[must_use]
    pub fn interpreter(&self) -> Interpreter {
        self.equipped(Interpreter::new(self.profile.language.clone()))
    }

    /// The interpreter that goes on where another one of this job stood.
    pub(crate) fn restored_interpreter(&self, state: InterpreterState) -> Interpreter {
        self.equipped(Interpreter::restore(self.profile.language.clone(), state))
    }

    fn equipped(&self, interpreter: Interpreter) -> Interpreter {
        interpreter
            .with_tools(self.tool_offsets())
            .with_spindle_limit(self.profile.machine.max_spindle_rev_per_min)
            .with_programs(self.programs.clone())
    }

    /// The profile's settings of the vibration as this run has them.
    #[must_use]
    pub fn vibration(&self) -> VibrationSettings {
        let Self { generation_mode, vibration_envelope: envelope, .. } = *self;
        VibrationSettings { generation_mode, envelope, ..self.profile.vibration }
    }

    /// Interpolation period, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        f64::from(self.interpolation_period_us) * 1e-6
    }
}

/// Shortest interpolation period, µs.
pub const MIN_PERIOD_US: u32 = 50;
/// Longest interpolation period, µs.
pub const MAX_PERIOD_US: u32 = 20_000;
/// Interpolation period where the request names none, µs.
pub const DEFAULT_PERIOD_US: u32 = 1_000;
/// Most setpoints a program may have: 49 days at 1 ms. Bounds the work that a short text can cause.
pub const MAX_SETPOINTS: u64 = 1 << 32;

/// A change of the feed override. It acts on rapids only by holding them; dwells and the spindle are not affected.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OverrideChange {
    /// Index of the setpoint at whose instant it changes.
    pub index: u64,
    /// Ratio of the feed to the programmed one, 0 (feed hold) to 2.
    pub ratio: f64,
}

/// A change of the spindle speed at a place where it is possible ([`crate::Pipeline::place_between`]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpindleChange {
    /// Index of the first setpoint behind the place.
    pub index: u64,
    /// Ratio of the speed to the programmed one, positive.
    pub ratio: f64,
}
