//! Which machine a program is checked for.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::ValueEnum;
use feedwave_cutting::{
    DEFAULT_PERIOD_US, Frame, GenerationMode, MAX_PERIOD_US, MIN_PERIOD_US, MachineProfile, PipelineConfig,
    VibrationEnvelope,
};
use figment::Figment;
use figment::providers::Serialized;

use super::oscillation::OscillationArgs;
use super::tools::ToolArgs;
use super::{CliError, data_file};
use crate::output::AxisColumn;

/// Options that say which machine.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct MachineArgs {
    /// Machine profile, TOML or JSON; what it leaves out is as for the generic machine
    #[arg(long, value_name = "FILE")]
    profile: Option<PathBuf>,
    /// Generic machine to use, or to complete the profile with [default: what the profile says, or lathe]
    #[arg(long, value_enum, value_name = "KIND")]
    machine_kind: Option<Kind>,
    /// Interpolation period, µs
    #[arg(long, value_name = "MICROSECONDS", default_value_t = DEFAULT_PERIOD_US,
        value_parser = clap::value_parser!(u32).range(i64::from(MIN_PERIOD_US)..=i64::from(MAX_PERIOD_US)))]
    period_us: u32,
    /// How vibration along the path is generated [default: what the profile says, or along-path]
    #[arg(long, value_enum, value_name = "MODE")]
    mode: Option<Mode>,
    /// How vibration along the path begins and ends [default: what the profile says, or blended]
    #[arg(long, value_enum, value_name = "FORM")]
    envelope: Option<Envelope>,
    #[command(flatten)]
    tools: ToolArgs,
    #[command(flatten)]
    oscillation: OscillationArgs,
}

/// A generic machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// X and Z, diameters in X, feed per revolution
    Lathe,
    /// X, Y and Z, feed per minute
    Mill,
}

/// How vibration along the path is generated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Mode {
    /// The tool goes back and forth on the programmed contour itself
    AlongPath,
    /// The vibration is split over the axes by the tangent
    Tangential,
    /// The drives generate the vibration from conditions in the setpoints
    ServoSide,
}

impl From<Mode> for GenerationMode {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::AlongPath => Self::AlongPath,
            Mode::Tangential => Self::Tangential,
            Mode::ServoSide => Self::ServoSide,
        }
    }
}

/// How vibration along the path begins and ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Envelope {
    /// Blended in and out over the path, within the axes' limits
    Blended,
    /// The whole sine from the first setpoint on, clamped at the ends
    Published,
}

impl From<Envelope> for VibrationEnvelope {
    fn from(envelope: Envelope) -> Self {
        match envelope {
            Envelope::Blended => Self::Blended,
            Envelope::Published => Self::Published,
        }
    }
}

impl MachineArgs {
    /// What the pipeline is to be run with.
    pub(super) fn config(&self, frame: Frame) -> Result<Arc<PipelineConfig>, CliError> {
        let profile = match &self.profile {
            Some(path) => read_profile(path, self.machine_kind)?,
            None => generic(self.machine_kind.unwrap_or(Kind::Lathe)),
        };
        let mut config = PipelineConfig::new(profile);
        config.interpolation_period_us = self.period_us;
        config.frame = frame;
        config.tools = self.tools.read()?;
        config.oscillation = self.oscillation.checked(&config.profile.tool_oscillation)?;
        if let Some(mode) = self.mode {
            config.generation_mode = mode.into();
        }
        if let Some(envelope) = self.envelope {
            config.vibration_envelope = envelope.into();
        }
        Ok(Arc::new(config))
    }
}

fn generic(kind: Kind) -> MachineProfile {
    match kind {
        Kind::Lathe => MachineProfile::lathe(),
        Kind::Mill => MachineProfile::mill(),
    }
}

/// A machine profile from a file.
pub(super) fn profile_of(path: &Path) -> Result<MachineProfile, CliError> {
    read_profile(path, None)
}

fn read_profile(path: &Path, kind: Option<Kind>) -> Result<MachineProfile, CliError> {
    let stated = data_file::read(path)?;
    // A profile that says what kind of machine it is need not be given it again.
    let stated_kind = stated.extract_inner::<String>("machine.kind").ok();
    let kind = kind.unwrap_or(if stated_kind.as_deref() == Some("mill") { Kind::Mill } else { Kind::Lathe });
    let profile: MachineProfile = Figment::from(Serialized::defaults(generic(kind)))
        .merge(stated)
        .extract()
        .map_err(|error| data_file::not_as_expected(path, error))?;
    let problems = profile.problems();
    if problems.is_empty() {
        return Ok(profile);
    }
    Err(data_file::wrong(path, problems.iter().map(|problem| (problem.field.as_str(), problem.message.as_str()))))
}

/// The axis columns of a machine's setpoints.
pub(super) fn axis_columns(profile: &MachineProfile) -> Vec<AxisColumn> {
    let axes = profile.machine.axes.iter();
    axes.map(|axis| AxisColumn { name: axis.name.clone(), rotary: axis.axis.is_rotary() }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str, text: &str) -> Result<MachineProfile, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join(name);
        std::fs::write(&path, text).unwrap();
        read_profile(&path, None).map_err(|error| error.message.replace(&path.display().to_string(), name))
    }

    #[test]
    fn a_profile_states_only_what_differs() {
        let profile = read("m.toml", "[vibration]\nmax_frequency_hz = 200.0\n").unwrap();
        assert_eq!(profile.vibration.max_frequency_hz, 200.0);
        assert_eq!(profile.machine, MachineProfile::lathe().machine);
        let profile = read("m.json", r#"{"machine": {"kind": "mill"}, "following": {"filter_length_s": 0.02}}"#);
        let profile = profile.unwrap();
        assert_eq!(profile.language, MachineProfile::mill().language);
        assert_eq!(profile.following.filter_length_s, Some(0.02));
    }

    #[test]
    fn a_whole_profile_survives_the_round_trip() {
        for profile in [MachineProfile::lathe(), MachineProfile::mill()] {
            assert_eq!(read("m.json", &serde_json::to_string(&profile).unwrap()), Ok(profile));
        }
    }

    #[test]
    fn what_is_wrong_is_named_with_its_key() {
        let error = read("m.toml", "[vibration]\nmax_frequency_hz = -1.0\nmax_amplitude_mm = 0.0\n").unwrap_err();
        assert_eq!(error.lines().count(), 2, "{error}");
        assert!(error.starts_with("m.toml: vibration.max_frequency_hz: must be a positive"), "{error}");
        let error = read("m.toml", "[vibration]\nmax_frequency = 1.0\n").unwrap_err();
        assert!(error.contains("max_frequency"), "{error}");
        assert!(read("m.json", "{").is_err());
    }
}
