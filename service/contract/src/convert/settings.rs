//! A job's settings: how its program is run.

use feedwave_cutting::{DEFAULT_PERIOD_US, MachineProfile, PipelineConfig};

use super::offsets::apply_offsets;
use super::{functions, tool_for_pipeline};
use crate::proto;

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
