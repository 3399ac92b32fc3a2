//! Which machine a program is checked for.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::ValueEnum;
use feedwave_cutting::{
    DEFAULT_PERIOD_US, Frame, GenerationMode, MAX_PERIOD_US, MIN_PERIOD_US, MachineProfile, PipelineConfig, Tool,
};
use figment::Figment;
use figment::providers::{Format as _, Serialized, Toml};

use super::CliError;
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
    /// A tool and its length from the gauge point, such as 1=120.5; may be repeated. H of G43.4 and G43.5 means these
    /// lengths, and with any of them other tools are unknown
    #[arg(long = "tool", value_name = "NUMBER=MM", value_parser = tool)]
    tools: Vec<Tool>,
}

/// A tool with its length, as the command line writes it.
fn tool(text: &str) -> Result<Tool, String> {
    let (number, length) = text.split_once('=').ok_or("write it as NUMBER=MM, such as 1=120.5")?;
    let number = number.trim().parse::<u32>().ok().filter(|number| (1..=9_999).contains(number));
    let number = number.ok_or("the number must be 1 to 9999")?;
    let length_mm = length.trim().parse::<f64>().ok().filter(|length| length.is_finite() && *length > 0.0);
    let length_mm = Some(length_mm.ok_or("the length must be a positive number of millimetres")?);
    Ok(Tool { number, name: String::new(), max_rev_per_min: None, length_mm, geometry: None })
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
        config.tools.clone_from(&self.tools);
        if let Some(mode) = self.mode {
            config.generation_mode = mode.into();
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

fn read_profile(path: &Path, kind: Option<Kind>) -> Result<MachineProfile, CliError> {
    let name = path.display();
    let text = std::fs::read_to_string(path).map_err(|error| CliError::file(path, &error))?;
    let is_json = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    let stated = if is_json {
        let value: serde_json::Value =
            serde_json::from_str(&text).map_err(|error| CliError::trouble(format!("{name}: {error}")))?;
        Figment::from(Serialized::defaults(value))
    } else {
        Figment::from(Toml::string(&text))
    };
    // A profile that says what kind of machine it is need not be told so again.
    let stated_kind = stated.extract_inner::<String>("machine.kind").ok();
    let kind = kind.unwrap_or(if stated_kind.as_deref() == Some("mill") { Kind::Mill } else { Kind::Lathe });
    let profile: MachineProfile = Figment::from(Serialized::defaults(generic(kind)))
        .merge(stated)
        .extract()
        .map_err(|error| CliError::trouble(problems_of(path, error)))?;
    let problems = profile.problems();
    if problems.is_empty() {
        return Ok(profile);
    }
    let lines = problems.iter().map(|problem| format!("{name}: {}: {}", problem.field, problem.message));
    Err(CliError::trouble(lines.collect::<Vec<_>>().join("\n")))
}

/// Every problem of a profile that does not have the right form, one a line.
fn problems_of(path: &Path, error: figment::Error) -> String {
    let lines = error.into_iter().map(|problem| {
        let key = problem.path.join(".");
        let separator = if key.is_empty() { "" } else { ": " };
        format!("{}: {key}{separator}{}", path.display(), problem.kind)
    });
    lines.collect::<Vec<_>>().join("\n")
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
    fn tools_are_numbers_with_lengths() {
        let one = tool("1=120.5").unwrap();
        assert_eq!((one.number, one.length_mm), (1, Some(120.5)));
        for wrong in ["1", "=5", "0=5", "10000=5", "1=", "1=0", "1=-2", "1=nan", "x=1"] {
            assert!(tool(wrong).is_err(), "{wrong}");
        }
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
