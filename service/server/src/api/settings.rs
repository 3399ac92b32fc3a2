//! Settings of a job, as requested and with what they leave open filled in from the machine and its tools.

use feedwave_contract::convert::{self, enumeration, generation_mode_to_proto, vibration_envelope_to_proto};
use feedwave_contract::proto::{JobSettings, Tool};
use feedwave_contract::{names, proto};
use feedwave_cutting::{DEFAULT_PERIOD_US, MAX_PERIOD_US, MIN_PERIOD_US, MachineProfile};

use super::{Api, tools};
use crate::error::{Error, Result, Violations};
use crate::stored;

/// Most tools in the list of a job.
const MAX_TOOLS: usize = 1_000;

/// An interpolation period: `default` where the request has none.
pub(super) fn check_period_us(violations: &mut Violations, period_us: u32, default: u32) -> u32 {
    match period_us {
        0 => default,
        MIN_PERIOD_US..=MAX_PERIOD_US => period_us,
        _ => {
            let range = format!("must be {MIN_PERIOD_US} to {MAX_PERIOD_US}, is {period_us}");
            violations.add("interpolation_period_us", range);
            default
        }
    }
}

/// Settings as requested, without the tools' data: fields only.
pub(super) struct CheckedSettings<'a> {
    pub(super) interpolation_period_us: u32,
    generation_mode: proto::GenerationMode,
    vibration_envelope: proto::VibrationEnvelope,
    tool_ids: Vec<&'a str>,
    oscillation: Option<&'a proto::OscillationRequest>,
}

/// What every request for a validation says about it.
pub(super) fn check_settings<'a>(
    violations: &mut Violations,
    interpolation_period_us: u32,
    generation_mode: i32,
    vibration_envelope: i32,
    tools: &'a [String],
    oscillation: Option<&'a proto::OscillationRequest>,
) -> CheckedSettings<'a> {
    let interpolation_period_us = check_period_us(violations, interpolation_period_us, DEFAULT_PERIOD_US);
    let generation_mode = enumeration(violations, "generation_mode", generation_mode).unwrap_or_default();
    let vibration_envelope = enumeration(violations, "vibration_envelope", vibration_envelope).unwrap_or_default();
    let tool_ids = check_tools(violations, tools);
    CheckedSettings { interpolation_period_us, generation_mode, vibration_envelope, tool_ids, oscillation }
}

/// The identifiers of the tools that a request names.
pub(super) fn check_tools<'a>(violations: &mut Violations, tools: &'a [String]) -> Vec<&'a str> {
    if tools.len() > MAX_TOOLS {
        violations.add("tools", format!("must list at most {MAX_TOOLS}, lists {}", tools.len()));
    }
    let listed = tools.iter().take(MAX_TOOLS).enumerate();
    listed.filter_map(|(index, name)| violations.check(format!("tools[{index}]"), names::parse_tool(name))).collect()
}

impl Api {
    /// A stored machine's profile, and as the contract has it.
    pub(super) async fn machine_profile(&self, id: &str) -> Result<(MachineProfile, proto::MachineProfile)> {
        let record = self.store.machine(id).await?;
        let machine: proto::Machine = stored::from_stored(record.body.get())?;
        let document = machine.profile.unwrap_or_default();
        let mut violations = Violations::default();
        let profile = convert::profile_from_proto(&mut violations, "profile", &document);
        let profile =
            profile.ok_or_else(|| Error::internal(format!("{id} is refused: {:?}", violations.as_slice())))?;
        Ok((profile, document))
    }

    /// Settings with what they leave open filled in and the tools' data copied.
    pub(super) async fn settings(
        &self,
        checked: &CheckedSettings<'_>,
        profile: &MachineProfile,
    ) -> Result<JobSettings> {
        let default = generation_mode_to_proto(profile.vibration.generation_mode);
        let generation_mode = match checked.generation_mode {
            proto::GenerationMode::Unspecified => default,
            stated => stated,
        };
        let vibration_envelope = match checked.vibration_envelope {
            proto::VibrationEnvelope::Unspecified => vibration_envelope_to_proto(profile.vibration.envelope),
            stated => stated,
        };
        let mut violations = Violations::default();
        // Which conditions there are depends on the machine.
        let oscillation = convert::oscillation_request_from_proto(checked.oscillation);
        for problem in oscillation.problems(&profile.tool_oscillation) {
            violations.add(format!("oscillation.{}", problem.field), problem.message);
        }
        violations.finish()?;
        let tools = self.job_tools(&checked.tool_ids).await?;
        Ok(JobSettings {
            programs: Vec::new(),
            offsets: None,
            interpolation_period_us: checked.interpolation_period_us,
            generation_mode: generation_mode.into(),
            vibration_envelope: vibration_envelope.into(),
            tools,
            oscillation: checked.oscillation.map(|_| convert::oscillation_request_to_proto(&oscillation)),
        })
    }

    /// The data of tools, each with another number.
    pub(super) async fn job_tools(&self, ids: &[&str]) -> Result<Vec<Tool>> {
        let mut tools: Vec<Tool> = Vec::with_capacity(ids.len());
        let mut violations = Violations::default();
        for (index, id) in ids.iter().enumerate() {
            let tool = tools::from_record(&self.store.tool(id).await?)?;
            if let Some(other) = tools.iter().find(|other| other.number == tool.number) {
                let reason = format!("has the number {}, as {} has", tool.number, other.name);
                violations.add(format!("tools[{index}]"), reason);
            }
            tools.push(tool);
        }
        violations.finish()?;
        Ok(tools)
    }
}
