//! A job's settings: how its program is run.

use std::collections::BTreeMap;

use feedwave_cutting::{DEFAULT_PERIOD_US, MAX_PERIOD_US, MIN_PERIOD_US, MachineProfile, PipelineConfig};

use super::offsets::{apply_offsets, check_offsets};
use super::tool::check_tools;
use super::{
    MAX_PROGRAM_FILES, check_display_name, enumeration, functions, generation_mode_to_proto,
    oscillation_request_from_proto, oscillation_request_to_proto, tool_for_pipeline, vibration_envelope_to_proto,
};
use crate::proto;
use crate::violations::Violations;

/// Most tools in the list of a job.
pub const MAX_TOOLS: usize = 1_000;

/// An interpolation period, µs: `default` where the request has none.
pub fn check_period_us(violations: &mut Violations, period_us: u32, default: u32) -> u32 {
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

/// Checks the names of further program files, by which calls find them: there are not too many, and no two are the same in
/// whatever case. An empty one may stand for a name that is known later.
pub fn check_file_names<'a>(violations: &mut Violations, field: &str, names: impl ExactSizeIterator<Item = &'a str>) {
    if names.len() > MAX_PROGRAM_FILES {
        violations.add(field, format!("must list at most {MAX_PROGRAM_FILES}, lists {}", names.len()));
    }
    let mut seen = BTreeMap::new();
    for (index, name) in names.take(MAX_PROGRAM_FILES).enumerate() {
        let field = format!("{field}[{index}].name");
        check_display_name(violations, &field, name);
        if name.is_empty() {
            continue;
        }
        if let Some(first) = seen.insert(name.to_lowercase(), index) {
            violations.add(field, format!("is that of file {first} too"));
        }
    }
}

/// How a program is to be planned, as requested and as far as it can be judged without the machine.
#[derive(Clone, Copy, Debug)]
pub struct RequestedSettings<'a> {
    /// Time from one setpoint to the next, µs.
    pub interpolation_period_us: u32,
    generation_mode: proto::GenerationMode,
    vibration_envelope: proto::VibrationEnvelope,
    oscillation: Option<&'a proto::OscillationRequest>,
}

impl<'a> RequestedSettings<'a> {
    /// Takes fields of a request; 0 and unspecified leave a choice open.
    pub fn check(
        violations: &mut Violations,
        interpolation_period_us: u32,
        generation_mode: i32,
        vibration_envelope: i32,
        oscillation: Option<&'a proto::OscillationRequest>,
    ) -> Self {
        Self {
            interpolation_period_us: check_period_us(violations, interpolation_period_us, DEFAULT_PERIOD_US),
            generation_mode: enumeration(violations, "generation_mode", generation_mode).unwrap_or_default(),
            vibration_envelope: enumeration(violations, "vibration_envelope", vibration_envelope).unwrap_or_default(),
            oscillation,
        }
    }

    /// With what they leave open filled in from the machine, and with these tools; without further files and offsets.
    pub fn complete(
        &self,
        violations: &mut Violations,
        profile: &MachineProfile,
        tools: Vec<proto::Tool>,
    ) -> proto::JobSettings {
        let generation_mode = match self.generation_mode {
            proto::GenerationMode::Unspecified => generation_mode_to_proto(profile.vibration.generation_mode),
            stated => stated,
        };
        let vibration_envelope = match self.vibration_envelope {
            proto::VibrationEnvelope::Unspecified => vibration_envelope_to_proto(profile.vibration.envelope),
            stated => stated,
        };
        // Which conditions there are depends on the machine.
        let oscillation = oscillation_request_from_proto(self.oscillation);
        for problem in oscillation.problems(&profile.tool_oscillation) {
            violations.add(format!("oscillation.{}", problem.field), problem.message);
        }
        proto::JobSettings {
            programs: Vec::new(),
            offsets: None,
            interpolation_period_us: self.interpolation_period_us,
            generation_mode: generation_mode.into(),
            vibration_envelope: vibration_envelope.into(),
            tools,
            oscillation: self.oscillation.map(|_| oscillation_request_to_proto(&oscillation)),
        }
    }
}

/// Settings of a caller who states everything in them, the tools' data included; what is open is filled in from the machine.
/// Of further files only the names count.
pub fn settings_from_proto(
    violations: &mut Violations,
    profile: &MachineProfile,
    given: &proto::JobSettings,
) -> proto::JobSettings {
    let requested = RequestedSettings::check(
        violations,
        given.interpolation_period_us,
        given.generation_mode,
        given.vibration_envelope,
        given.oscillation.as_ref(),
    );
    if given.tools.len() > MAX_TOOLS {
        violations.add("tools", format!("must list at most {MAX_TOOLS}, lists {}", given.tools.len()));
    }
    check_tools(violations, "tools", &given.tools[..given.tools.len().min(MAX_TOOLS)]);
    check_file_names(violations, "programs", given.programs.iter().map(|file| file.name.as_str()));
    if let Some(offsets) = &given.offsets {
        check_offsets(violations, "offsets", offsets);
    }
    let programs = given.programs.iter().map(|file| proto::ProgramFile { name: file.name.clone(), source: None });
    proto::JobSettings {
        programs: programs.collect(),
        offsets: given.offsets.clone(),
        ..requested.complete(violations, profile, given.tools.clone())
    }
}

/// What the pipeline is run with for a job with these settings on this machine: in machine coordinates, without changes
/// of the feed override. What the settings leave open is as the profile says.
#[must_use]
pub fn pipeline_config(profile: MachineProfile, settings: &proto::JobSettings) -> PipelineConfig {
    let period_us = settings.interpolation_period_us;
    let mut config = PipelineConfig {
        interpolation_period_us: if period_us == 0 { DEFAULT_PERIOD_US } else { period_us },
        tools: settings.tools.iter().map(tool_for_pipeline).collect(),
        programs: settings.programs.iter().map(|file| file.name.clone()).collect(),
        ..PipelineConfig::new(profile)
    };
    if let Some(offsets) = &settings.offsets {
        apply_offsets(offsets, &mut config.profile.language);
    }
    functions::job_from_proto(settings, &mut config);
    config
}

#[cfg(test)]
mod tests {
    use feedwave_cutting::{GenerationMode, VibrationEnvelope};

    use super::*;

    #[test]
    fn what_is_left_open_is_as_the_profile_says() {
        let mut profile = MachineProfile::lathe();
        profile.vibration.generation_mode = GenerationMode::Tangential;
        profile.vibration.envelope = VibrationEnvelope::Published;
        let config = pipeline_config(profile.clone(), &proto::JobSettings::default());
        assert_eq!(config, PipelineConfig::new(profile.clone()));
        let settings = proto::JobSettings {
            interpolation_period_us: 250,
            generation_mode: proto::GenerationMode::ServoSide.into(),
            vibration_envelope: proto::VibrationEnvelope::Blended.into(),
            tools: vec![proto::Tool { number: 7, length_mm: Some(120.5), ..Default::default() }],
            oscillation: Some(proto::OscillationRequest { parts_before: 3, ..Default::default() }),
            programs: vec![proto::ProgramFile { name: "O1000.nc".to_owned(), source: None }],
            offsets: Some(proto::Offsets {
                external: Some(proto::AxisPosition { z: -2.0, ..Default::default() }),
                ..Default::default()
            }),
        };
        let config = pipeline_config(profile, &settings);
        assert_eq!((config.interpolation_period_us, config.generation_mode), (250, GenerationMode::ServoSide));
        assert_eq!((config.vibration_envelope, config.oscillation.parts_before), (VibrationEnvelope::Blended, 3));
        assert_eq!(*config.programs, ["O1000.nc".to_owned()]);
        assert_eq!(config.profile.language.initial_offset()[2], -2.0);
        assert_eq!((config.tools[0].number, config.tools[0].offset.length_mm()), (7, Some(120.5)));
    }
}
