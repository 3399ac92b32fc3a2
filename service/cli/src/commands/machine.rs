//! Which machine a program is checked for.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::ValueEnum;
use feedwave_contract::convert::{
    check_display_name, oscillation_request_to_proto, pipeline_config, profile_from_proto, profile_to_proto,
};
use feedwave_contract::proto::{GenerationMode, JobSettings, VibrationEnvelope};
use feedwave_contract::violations::Violations;
use feedwave_contract::{names, proto};
use feedwave_cutting::{DEFAULT_PERIOD_US, Frame, MAX_PERIOD_US, MIN_PERIOD_US, MachineProfile, PipelineConfig};

use super::offsets::OffsetArgs;
use super::tool_oscillation::OscillationArgs;
use super::tools::ToolArgs;
use super::{CliError, data_file};

/// Options that say which machine.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct MachineArgs {
    /// Machine profile, the contract's `MachineProfile` or `Machine` as TOML or JSON; axes that it leaves out are those of
    /// the generic machine
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
    offsets: OffsetArgs,
    #[command(flatten)]
    oscillation: OscillationArgs,
}

/// A generic machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Kind {
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

impl Mode {
    /// The value of the contract; 0 where nothing is chosen.
    pub(super) fn value(mode: Option<Self>) -> i32 {
        mode.map_or(GenerationMode::Unspecified, |mode| match mode {
            Self::AlongPath => GenerationMode::AlongPath,
            Self::Tangential => GenerationMode::Tangential,
            Self::ServoSide => GenerationMode::ServoSide,
        })
        .into()
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

impl Envelope {
    /// The value of the contract; 0 where nothing is chosen.
    pub(super) fn value(envelope: Option<Self>) -> i32 {
        envelope
            .map_or(VibrationEnvelope::Unspecified, |envelope| match envelope {
                Self::Blended => VibrationEnvelope::Blended,
                Self::Published => VibrationEnvelope::Published,
            })
            .into()
    }
}

impl MachineArgs {
    /// The files that are read, with what they are called.
    pub(super) fn files(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let files = [
            ("the file of --profile", self.profile.as_deref()),
            ("the file of --tools", self.tools.file()),
            ("the file of --offsets", self.offsets.file()),
        ];
        files.into_iter().filter_map(|(name, path)| Some((name, path?)))
    }

    /// What the pipeline is to be run with, with further program files of these names.
    pub(super) fn config(&self, frame: Frame, programs: Arc<[String]>) -> Result<Arc<PipelineConfig>, CliError> {
        let profile = match &self.profile {
            Some(path) => read_machine(path, self.machine_kind)?.profile,
            None => self.machine_kind.unwrap_or(Kind::Lathe).generic(),
        };
        let settings = JobSettings {
            interpolation_period_us: self.period_us,
            generation_mode: Mode::value(self.mode),
            vibration_envelope: Envelope::value(self.envelope),
            tools: self.tools.read()?,
            offsets: self.offsets.read()?,
            oscillation: Some(oscillation_request_to_proto(&self.oscillation.checked(&profile.tool_oscillation)?)),
            programs: Vec::new(),
        };
        Ok(Arc::new(PipelineConfig { frame, programs, ..pipeline_config(profile, &settings) }))
    }
}

/// A machine from a file: its message as an upload takes it, and as the pipeline needs it.
#[derive(Debug)]
pub(super) struct MachineFile {
    /// The message; the axes and the highest spindle speed are stated.
    pub(super) machine: proto::Machine,
    /// Its profile.
    pub(super) profile: MachineProfile,
    /// Whether the file has the profile alone.
    pub(super) is_profile: bool,
    /// Fields of the machine's model that the file leaves out.
    pub(super) completed: Vec<&'static str>,
}

impl Kind {
    fn generic(self) -> MachineProfile {
        match self {
            Self::Lathe => MachineProfile::lathe(),
            Self::Mill => MachineProfile::mill(),
        }
    }
}

/// Reads a machine: a `MachineProfile`, or a `Machine` with its profile. Axes and highest spindle speed that it leaves out
/// are those of the generic machine of its kind, everything else is as the contract says. `kind` is the kind where the
/// file states none.
pub(super) fn read_machine(path: &Path, kind: Option<Kind>) -> Result<MachineFile, CliError> {
    let document = data_file::read(path)?;
    let names = ["profile", "name", "display_name", "etag", "create_time", "update_time"];
    let (mut machine, prefix) = if names.iter().any(|name| document.states(&[name])) {
        (data_file::message::<proto::Machine>(path, &document)?, "profile")
    } else {
        let profile = data_file::message(path, &document)?;
        (proto::Machine { profile: Some(profile), ..Default::default() }, "")
    };
    let profile = machine.profile.get_or_insert_default();
    let stated = |field: &str| {
        let path = [prefix, "machine", field];
        document.states(if prefix.is_empty() { &path[1..] } else { &path })
    };
    let completed = complete(path, profile.machine.get_or_insert_default(), kind, stated)?;
    let mut violations = Violations::default();
    if !machine.name.is_empty() {
        violations.check("name", names::parse_machine(&machine.name));
    }
    check_display_name(&mut violations, "display_name", &machine.display_name);
    let profile = profile_from_proto(&mut violations, prefix, machine.profile.get_or_insert_default());
    match profile {
        Some(profile) if violations.is_empty() => {
            Ok(MachineFile { machine, profile, is_profile: prefix.is_empty(), completed })
        }
        _ => Err(data_file::refused(path, &violations)),
    }
}

/// Fills in what a file leaves out of the model of its machine, and returns which fields; `stated` says which it does not.
fn complete(
    path: &Path,
    model: &mut proto::MachineModel,
    kind: Option<Kind>,
    stated: impl Fn(&str) -> bool,
) -> Result<Vec<&'static str>, CliError> {
    let stated_kind = match model.kind() {
        proto::MachineKind::Lathe => Some(Kind::Lathe),
        proto::MachineKind::Mill => Some(Kind::Mill),
        proto::MachineKind::Unspecified => None,
    };
    if let (Some(asked), Some(stated)) = (kind, stated_kind)
        && asked != stated
    {
        let message = format!("--machine-kind contradicts {}, whose machine.kind is another", path.display());
        return Err(CliError::trouble(message));
    }
    let generic = stated_kind.or(kind).unwrap_or(Kind::Lathe).generic();
    let generic = profile_to_proto(&generic).machine.unwrap_or_default();
    let completed: Vec<_> =
        ["kind", "axes", "max_spindle_rev_per_min"].into_iter().filter(|field| !stated(field)).collect();
    for &field in &completed {
        match field {
            "kind" => model.kind = generic.kind,
            "axes" => model.axes.clone_from(&generic.axes),
            _ => model.max_spindle_rev_per_min = generic.max_spindle_rev_per_min,
        }
    }
    Ok(completed)
}

#[cfg(test)]
mod tests {
    use feedwave_contract::json;

    use super::*;

    fn read_as(kind: Option<Kind>, name: &str, text: &str) -> Result<MachineFile, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join(name);
        std::fs::write(&path, text).unwrap();
        read_machine(&path, kind).map_err(|error| error.message.replace(&path.display().to_string(), name))
    }

    fn read(name: &str, text: &str) -> Result<MachineProfile, String> {
        read_as(None, name, text).map(|file| file.profile)
    }

    #[test]
    fn a_profile_states_only_what_differs() {
        let profile = read("m.toml", "[vibration]\nmax_frequency_hz = 200.0\n").unwrap();
        assert_eq!(profile.vibration.max_frequency_hz, 200.0);
        assert_eq!(profile.machine, MachineProfile::lathe().machine);
        let text = r#"{"machine": {"kind": "MACHINE_KIND_MILL"}, "following": {"filterLengthS": 0.02}}"#;
        let profile = read("m.json", text).unwrap();
        assert_eq!(profile.language, MachineProfile::mill().language);
        assert_eq!(profile.following.common.filter_length_s, Some(0.02));
        // Nothing stated, nothing different.
        assert_eq!(read("m.toml", ""), Ok(MachineProfile::lathe()));
        assert_eq!(read_as(Some(Kind::Mill), "m.toml", "").unwrap().profile, MachineProfile::mill());
    }

    #[test]
    fn a_whole_profile_survives_the_round_trip() {
        for profile in [MachineProfile::lathe(), MachineProfile::mill()] {
            let message = profile_to_proto(&profile);
            assert_eq!(read("m.json", &json::to_string(&message)), Ok(profile.clone()));
            let machine = proto::Machine {
                name: "machines/m-1".to_owned(),
                display_name: "M 1".to_owned(),
                profile: Some(message),
                etag: "e".to_owned(),
                ..Default::default()
            };
            let file = read_as(None, "m.json", &json::to_string(&machine)).unwrap();
            assert_eq!((file.machine, file.profile), (machine, profile));
        }
    }

    #[test]
    fn what_is_wrong_is_named_as_an_upload_names_it() {
        let error = read("m.toml", "[vibration]\nmax_frequency_hz = -1.0\nmax_amplitude_mm = 0.0\n").unwrap_err();
        assert_eq!(error.lines().count(), 2, "{error}");
        assert!(error.starts_with("m.toml: vibration.max_frequency_hz: must be a positive"), "{error}");
        let error = read("m.toml", "[vibration]\nmax_frequency = 1.0\n").unwrap_err();
        assert!(error.contains("vibration.max_frequency: ") && error.contains("is max_frequency_hz meant?"), "{error}");
        assert!(read("m.json", "{").is_err());
        let error = read("m.toml", "[language]\nwork_offsets = [{ x = 1, y = nan }]\n").unwrap_err();
        assert_eq!(error, "m.toml: language.work_offsets[0].y: must be finite");
        let error = read("m.toml", "[profile.language]\nwork_offsets = [{ x = inf }]\n").unwrap_err();
        assert_eq!(error, "m.toml: profile.language.work_offsets[0].x: must be finite");
        let error = read("m.toml", "name = 'Lathe 1'\n[profile.machine]\nmax_spindle_rev_per_min = 0\n").unwrap_err();
        assert!(
            error.contains("m.toml: name: must be of the form") && error.contains("machine.max_spindle_rev"),
            "{error}"
        );
        assert!(read("m.toml", "[machine]\naxes = []\n").unwrap_err().contains("machine.axes"));
        let error = read_as(Some(Kind::Lathe), "m.toml", "[machine]\nkind = 'MACHINE_KIND_MILL'\n").unwrap_err();
        assert!(error.contains("--machine-kind contradicts m.toml"), "{error}");
    }

    /// A file of the form before files were messages of the contract.
    const FORMER: &str = "[machine]\nkind = 'mill'\n[language]\nwork_offsets = [[1.0, 2.0]]\n\
        [[tool_oscillation]]\nname = 'speed'\nnumber = 3\n[tool_oscillation.condition]\nperiod = { per_revolution = 1 }\n\
        feed = { amplitude_mm = 0.4, waveform = { kind = 'sine' } }\n\
        axial = { amplitude_mm = 0.05, waveform = { kind = 'held_peak', hold_share = 0.26 } }\n\
        leading_edge = { edge = 1, rotation = { every_parts = 50 } }\n\
        [[tool_oscillation.tables]]\nquantity = 'feed_amplitude'\nvalues = [[0.2, 0.6]]\n";

    #[test]
    fn a_file_of_the_former_form_is_told_what_to_change() {
        let error = read("m.toml", FORMER).unwrap_err();
        for line in [
            "machine.kind: must be \"MACHINE_KIND_MILL\", is \"mill\"",
            "language.work_offsets[0]: is a list, write { x = 1.0, y = 2.0 }",
            "tool_oscillation[0].condition: is of a former form of these files: write what is in it beside name and number",
            "tool_oscillation[0].condition.period: is of a former form of these files: write periods_per_rev = 1 or",
            "tool_oscillation[0].condition.feed.waveform.kind: is of a former form of these files: write sine = {}, ",
            "tool_oscillation[0].condition.axial.waveform.hold_share: is of a former form of these files: write it inside: ",
            "tool_oscillation[0].condition.leading_edge.rotation: is of a former form of these files: write every_parts = 50",
            "tool_oscillation[0].tables[0].quantity: must be \"TABLE_QUANTITY_FEED_AMPLITUDE\", is \"feed_amplitude\"",
            "tool_oscillation[0].tables[0].values: is of a former form of these files: write rows = [{ values = [0.2, 0.6] }]",
        ] {
            assert!(error.contains(&format!("m.toml: {line}")), "{line} is not in\n{error}");
        }
    }
}
