//! Settings of a job, as requested and with what they leave open filled in from the machine and its tools.

use feedwave_contract::convert::{self, MAX_TOOLS, RequestedSettings};
use feedwave_contract::proto::{JobSettings, Tool};
use feedwave_contract::{names, proto};
use feedwave_cutting::MachineProfile;

use super::{Api, tools};
use crate::error::{Error, Result, Violations};
use crate::stored;

/// Settings as requested, without the tools' data: fields only.
pub(super) struct CheckedSettings<'a> {
    pub(super) requested: RequestedSettings<'a>,
    tool_ids: Vec<&'a str>,
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
    let requested =
        RequestedSettings::check(violations, interpolation_period_us, generation_mode, vibration_envelope, oscillation);
    CheckedSettings { requested, tool_ids: check_tools(violations, tools) }
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
        let mut violations = Violations::default();
        let settings = checked.requested.complete(&mut violations, profile, Vec::new());
        violations.finish()?;
        Ok(JobSettings { tools: self.job_tools(&checked.tool_ids).await?, ..settings })
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
