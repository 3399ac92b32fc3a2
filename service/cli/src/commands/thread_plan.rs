//! `feedwave thread-plan`: the passes of a thread whose chip breaks, as a program.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use clap::{ArgGroup, ValueEnum};
use feedwave_contract::convert::{profile_to_proto, thread_plan_to_proto, thread_request_from_proto};
use feedwave_contract::proto;
use feedwave_contract::proto::PlanThreadResponse;
use feedwave_contract::proto::plan_thread_request::Advance;
use feedwave_contract::violations::{Violation, Violations};
use feedwave_cutting::thread::{ThreadPlan, plan_thread};
use feedwave_cutting::{Frame, MachineProfile};
use feedwave_plot as plot;

use super::machine::MachineArgs;
use super::source::{Source, refuse_input};
use super::terminal::{Style, print, print_json, tell};
use super::validate::Format;
use super::{CliError, EXIT_REFUSED, findings, report};
use crate::output::OutputFile;

/// What a file that is not read is called where findings name it.
const NAME: &str = "thread";

/// Arguments of `feedwave thread-plan`.
#[derive(Debug, clap::Args)]
#[command(
    group(ArgGroup::new("advance").required(true).args(["pitch", "lead", "threads_per_inch"])),
    after_long_help = "Depths, infeeds, amplitudes and thicknesses are on the radius, in the program they are diameters.

Exit codes: 0 planned, 1 refused (findings say why), 2 wrong usage or unusable file.

Examples:
  feedwave thread-plan --work-diameter 10 --pitch 1.5 --depth 0.92 --first-depth 0.35 --start-z 5 --end-z -20 \\
      --spindle 300 --finishing-thickness 0.08 --out m10.nc
      An M10 thread: passes on standard output, the program in m10.nc.
  feedwave thread-plan --work-diameter 10 --pitch 1.5 --depth 0.92 --first-depth 0.35 --start-z 5 --end-z -20 \\
      --approach 5 --spindle 300 --finishing-thickness 0.08 --infeed modified-flank --relief-angle 3 --plots pictures
      Infeed along the flank, the run-up of Z checked against 5 mm before the work, pictures of all passes;
      the program on standard output.
  feedwave thread-plan --work-diameter 40 --pitch 3 --starts 2 --depth 1.7 --first-depth 0.5 --start-z 12 --end-z -40 \\
      --spindle 200 --finishing-thickness 0.1 --method start-position --hand left --format json | jq .thread.passes
      A left-hand thread with two starts, brought to their places by Z; for scripts.
  feedwave thread-plan --work-diameter 21.3 --threads-per-inch 14 --taper 0.03125 --included-angle 55 --depth 1.16 \\
      --first-depth 0.4 --start-z 4 --end-z -16 --spindle 250 --finishing-thickness 0.08
      A tapered pipe thread, 1:16 on the diameter.
  feedwave thread-plan --face-z 0 --start-radius 40 --end-radius 10 --pitch 4 --depth 1 --first-depth 0.4 \\
      --spindle 200 --finishing-thickness 0.1
      A scroll on a face: the lead is along X, the tool vibrates along Z."
)]
pub struct Args {
    /// Diameter of the uncut work at the start position, of a thread along Z
    #[arg(long, value_name = "MM", required_unless_present = "face_z", help_heading = "Thread")]
    work_diameter: Option<f64>,
    /// Z of the uncut face at the start position, of a thread along X: depths and amplitudes are along Z then
    #[arg(
        long,
        value_name = "MM",
        conflicts_with_all = ["work_diameter", "start_z", "end_z", "side", "hand"],
        requires_all = ["start_radius", "end_radius"],
        help_heading = "Thread"
    )]
    face_z: Option<f64>,
    /// Distance of neighbouring grooves
    #[arg(long, value_name = "MM", help_heading = "Thread")]
    pitch: Option<f64>,
    /// Advance per revolution: the pitch times the number of starts
    #[arg(long, value_name = "MM", help_heading = "Thread")]
    lead: Option<f64>,
    /// Grooves per inch of length
    #[arg(long, value_name = "COUNT", help_heading = "Thread")]
    threads_per_inch: Option<f64>,
    /// Number of starts, 1 to 30
    #[arg(long, value_name = "COUNT", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=30),
        help_heading = "Thread")]
    starts: u32,
    /// Depth of the finished thread
    #[arg(long, value_name = "MM", help_heading = "Thread")]
    depth: f64,
    /// Where Z starts
    #[arg(long, value_name = "MM", required_unless_present = "face_z", help_heading = "Thread")]
    start_z: Option<f64>,
    /// Where the thread ends
    #[arg(long, value_name = "MM", required_unless_present = "face_z", help_heading = "Thread")]
    end_z: Option<f64>,
    /// Radius where X starts, of a thread along X
    #[arg(long, value_name = "MM", requires = "face_z", help_heading = "Thread")]
    start_radius: Option<f64>,
    /// Radius where a thread along X ends
    #[arg(long, value_name = "MM", requires = "face_z", help_heading = "Thread")]
    end_radius: Option<f64>,
    /// Travel of the lead axis before it reaches the work; its run-up must end there [default: what the profile says, or
    /// not judged]
    #[arg(long, value_name = "MM", help_heading = "Thread")]
    approach: Option<f64>,
    /// Change of the work's radius, or of its face, per travel of the lead axis, positive where the work grows along the cut
    #[arg(long, value_name = "MM/MM", default_value_t = 0.0, help_heading = "Thread")]
    taper: f64,
    /// Outside or inside
    #[arg(long, value_enum, value_name = "SIDE", default_value_t = Side::External, help_heading = "Thread")]
    side: Side,
    /// Hand wanted [default: what spindle and direction of cut make]
    #[arg(long, value_enum, value_name = "HAND", help_heading = "Thread")]
    hand: Option<Hand>,
    /// Included angle of the tool [default: what the profile says, or 60]
    #[arg(long, value_name = "DEGREES", help_heading = "Tool and material")]
    included_angle: Option<f64>,
    /// Width of the tool's tip along the lead; 0 for a pointed tool
    #[arg(long, value_name = "MM", default_value_t = 0.0, help_heading = "Tool and material")]
    root_flat: f64,
    /// Largest depth of the first pass
    #[arg(long, value_name = "MM", help_heading = "Tool and material")]
    first_depth: f64,
    /// Largest thickness that tool and material bear in any pass [default: what the profile says, or unlimited]
    #[arg(long, value_name = "MM", help_heading = "Tool and material")]
    max_thickness: Option<f64>,
    /// Depth left to the finishing pass, which does not vibrate
    #[arg(long, value_name = "MM", default_value_t = 0.02, help_heading = "Tool and material")]
    finishing_allowance: f64,
    /// Largest thickness that the finishing pass may find, crests included [default: what the profile says, or twice the
    /// allowance]
    #[arg(long, value_name = "MM", help_heading = "Tool and material")]
    finishing_thickness: Option<f64>,
    /// Spindle speed
    #[arg(long, value_name = "REV/MIN", help_heading = "Passes")]
    spindle: f64,
    /// Direction of the spindle [default: what the requested hand needs, or forward]
    #[arg(long, value_enum, value_name = "ROTATION", help_heading = "Passes")]
    rotation: Option<Rotation>,
    /// Vibrations per revolution of the spindle, D [default: what the profile says, or 2]
    #[arg(long, value_name = "D", help_heading = "Passes")]
    vibrations_per_rev: Option<f64>,
    /// How the tool comes into the groove
    #[arg(long, value_enum, value_name = "PATTERN", default_value_t = Infeed::Radial, help_heading = "Passes")]
    infeed: Infeed,
    /// Angle between infeed and flank, for --infeed modified-flank
    #[arg(long, value_name = "DEGREES", default_value_t = 3.0, help_heading = "Passes")]
    relief_angle: f64,
    /// How the depth grows from pass to pass
    #[arg(long, value_enum, value_name = "LAW", default_value_t = Law::SquareRoot, help_heading = "Passes")]
    law: Law,
    /// How passes are brought to their place
    #[arg(long, value_enum, value_name = "METHOD", default_value_t = Method::StartAngle, help_heading = "Passes")]
    method: Method,
    /// How the vibration starts [default: what the profile says, or preparatory]
    #[arg(long, value_enum, value_name = "START", help_heading = "Passes")]
    start_up: Option<StartUp>,
    /// Amplitude over the smallest that breaks the chip
    #[arg(long, value_name = "FACTOR", default_value_t = 1.1, help_heading = "Passes")]
    amplitude_margin: f64,
    /// Distance of the return path from the work's surface
    #[arg(long, value_name = "MM", default_value_t = 2.0, help_heading = "Program")]
    clearance: f64,
    /// Amplitude ratio of the G165 word; passes that do not follow it state their amplitude
    #[arg(long, value_name = "RATIO", default_value_t = 1.2, help_heading = "Program")]
    ratio: f64,
    /// File for the program; `-` is standard output, the passes then go to standard error
    #[arg(long, value_name = "FILE", default_value = "-", help_heading = "Program")]
    out: PathBuf,
    /// Directory to draw pictures into
    #[arg(long, value_name = "DIRECTORY", help_heading = "Program")]
    plots: Option<PathBuf>,
    /// Form of the answer on standard output; JSON has the program, too
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text, help_heading = "Program")]
    format: Format,
    #[command(flatten)]
    machine: MachineArgs,
}

/// Declares an option's values with the value of the contract that each represents.
macro_rules! option_values {
    ($(#[$outer:meta])* $name:ident: $contract:ident { $($(#[$inner:meta])* $variant:ident => $value:ident,)+ }) => {
        $(#[$outer])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
        enum $name {
            $($(#[$inner])* $variant,)+
        }

        impl $name {
            fn value(self) -> i32 {
                match self {
                    $(Self::$variant => proto::$contract::$value.into(),)+
                }
            }
        }
    };
}

option_values! {
    /// Side of the work.
    Side: ThreadSide {
        /// On the outside
        External => External,
        /// In a bore
        Internal => Internal,
    }
}
option_values! {
    /// Hand of a thread.
    Hand: ThreadHand {
        /// Right hand
        Right => Right,
        /// Left hand
        Left => Left,
    }
}
option_values! {
    /// Direction of the spindle.
    Rotation: SpindleRotation {
        /// M3
        Forward => Forward,
        /// M4
        Reverse => Reverse,
    }
}
option_values! {
    /// How the tool comes into the groove.
    Infeed: InfeedPattern {
        /// Straight in: both flanks cut
        Radial => Radial,
        /// Along one flank
        Flank => Flank,
        /// A little steeper than the flank
        ModifiedFlank => ModifiedFlank,
        /// Along both flanks in turn
        AlternatingFlank => AlternatingFlank,
    }
}
option_values! {
    /// How the depth grows.
    Law: DepthLaw {
        /// As the square root of the pass: equal sections
        SquareRoot => SquareRoot,
        /// By the same amount in every pass
        Constant => Constant,
    }
}
option_values! {
    /// How passes are brought to their place.
    Method: PassMethod {
        /// Method 1: by the start position along the lead
        StartPosition => StartPosition,
        /// Method 2: by the start angle Q
        StartAngle => StartAngle,
    }
}
option_values! {
    /// How the vibration starts.
    StartUp: ThreadStartUp {
        /// The tool moves to the vibration position beforehand
        Preparatory => Preparatory,
        /// The vibration starts from phase 0 after its phase shift
        Delayed => Delayed,
    }
}

impl Args {
    fn request(&self, period_us: u32) -> proto::PlanThreadRequest {
        let advance = [
            self.pitch.map(Advance::PitchMm),
            self.lead.map(Advance::LeadMm),
            self.threads_per_inch.map(Advance::ThreadsPerInch),
        ];
        proto::PlanThreadRequest {
            on: None,
            side: self.side.value(),
            hand: self.hand.map_or(0, Hand::value),
            rotation: self.rotation.map_or(0, Rotation::value),
            lead_axis: match self.face_z {
                Some(_) => proto::ThreadLeadAxis::X.into(),
                None => proto::ThreadLeadAxis::Z.into(),
            },
            work_diameter_mm: self.work_diameter.unwrap_or_default(),
            face_z_mm: self.face_z.unwrap_or_default(),
            start_radius_mm: self.start_radius.unwrap_or_default(),
            end_radius_mm: self.end_radius.unwrap_or_default(),
            starts: self.starts,
            taper: self.taper,
            start_z_mm: self.start_z.unwrap_or_default(),
            end_z_mm: self.end_z.unwrap_or_default(),
            approach_mm: self.approach,
            included_angle_deg: self.included_angle,
            root_flat_mm: self.root_flat,
            depth_mm: self.depth,
            finishing_allowance_mm: Some(self.finishing_allowance),
            first_depth_mm: self.first_depth,
            max_thickness_mm: self.max_thickness,
            finishing_thickness_mm: self.finishing_thickness,
            infeed: self.infeed.value(),
            relief_angle_deg: Some(self.relief_angle),
            law: self.law.value(),
            method: self.method.value(),
            start_up: self.start_up.map_or(0, StartUp::value),
            vibrations_per_rev: self.vibrations_per_rev,
            spindle_rev_per_min: self.spindle,
            amplitude_margin: Some(self.amplitude_margin),
            interpolation_period_us: period_us,
            clearance_mm: Some(self.clearance),
            amplitude_ratio: Some(self.ratio),
            advance: advance.into_iter().flatten().next(),
        }
    }
}

/// Plans it.
///
/// # Errors
/// [`CliError`] when an option or a file cannot be used.
pub(super) fn run(args: Args) -> Result<ExitCode, CliError> {
    refuse_input(&args.out, args.machine.files())?;
    let config = args.machine.config(Frame::Machine, Arc::new([]))?;
    let mut violations = Violations::default();
    let request = args.request(config.interpolation_period_us);
    let request = thread_request_from_proto(&mut violations, &request, "machine_kind", Some(&config.profile));
    let Some((request, options)) = request else { return Err(wrong_options(violations.as_slice())) };
    let plan = plan_thread(&request);
    let answer = thread_plan_to_proto(&plan, &options);
    match plan {
        Ok(plan) => {
            let code = planned(&args, &plan, &answer)?;
            tell(&machine_notes(&args, &config.profile));
            Ok(code)
        }
        Err(_) => refused(&args, &answer),
    }
}

fn planned(args: &Args, plan: &ThreadPlan, answer: &PlanThreadResponse) -> Result<ExitCode, CliError> {
    let to_file = args.out != Path::new("-");
    if to_file {
        OutputFile::write_whole(&args.out, answer.program.as_bytes())
            .map_err(|error| CliError::file(&args.out, &error))?;
    }
    if args.format == Format::Json {
        print_json(answer)?;
    } else {
        let style = if to_file { Style::stdout() } else { Style::stderr() };
        let text = text(answer, style)?;
        if to_file {
            print(&text)?;
            tell(&format!("wrote {} passes to {}\n", plan.job.passes.len(), args.out.display()));
        } else {
            tell(&text);
            print(&answer.program)?;
        }
    }
    if let Some(directory) = &args.plots {
        let thread = plot::ThreadPictures { name: "thread".to_owned(), job: &plan.job, report: &plan.report };
        let files = plot::write_thread(&thread, directory).map_err(CliError::trouble)?;
        tell(&format!("drew {} pictures into {}\n", files.len(), directory.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Which options are not in the program and not as the machine has it: with its profile alone a validation judges otherwise.
fn machine_notes(args: &Args, profile: &MachineProfile) -> String {
    let own = profile_to_proto(profile).thread_vibration.unwrap_or_default();
    let number = |option, key, stated: Option<f64>, own: Option<f64>| {
        stated.filter(|_| stated != own).map(|value| (option, key, value.to_string()))
    };
    let start_up = args.start_up.map(StartUp::value).filter(|&stated| stated != own.start_up);
    let start_up = start_up.and_then(|stated| proto::ThreadStartUp::try_from(stated).ok());
    let differing = [
        number("vibrations-per-rev", "vibrations_per_rev", args.vibrations_per_rev, own.vibrations_per_rev),
        start_up.map(|stated| ("start-up", "start_up", format!("{:?}", stated.as_str_name()))),
        number("included-angle", "included_angle_deg", args.included_angle, own.included_angle_deg),
        number("approach", "approach_mm", args.approach, own.approach_mm),
        number("max-thickness", "max_thickness_mm", args.max_thickness, own.max_thickness_mm),
        number(
            "finishing-thickness",
            "max_finishing_thickness_mm",
            args.finishing_thickness,
            own.max_finishing_thickness_mm,
        ),
    ];
    let note = |(option, key, value): (&str, &str, String)| {
        format!(
            "note: --{option} is not in the program: validate judges the same where the machine profile has \
             thread_vibration.{key} = {value}\n"
        )
    };
    differing.into_iter().flatten().map(note).collect()
}

/// Passes, chips and notes for people.
fn text(answer: &PlanThreadResponse, style: Style) -> Result<String, CliError> {
    let mut text = String::new();
    if let (Some(thread), Some(report)) = (&answer.thread, &answer.report) {
        let heading = format!("Thread in {} passes", thread.passes.len());
        text = report::thread_text(&heading, thread, report, style);
        text.push('\n');
    }
    text.push_str(&findings_text(answer, style)?);
    Ok(text)
}

fn refused(args: &Args, answer: &PlanThreadResponse) -> Result<ExitCode, CliError> {
    match args.format {
        Format::Json => print_json(answer)?,
        Format::Text => {
            let style = Style::stderr();
            tell(&findings_text(answer, style)?);
            tell(&format!("{}: {}, no program is written\n", style.bold(NAME), style.bad("refused")));
        }
    }
    Ok(ExitCode::from(EXIT_REFUSED))
}

/// Findings on a plan have no place in a program.
fn findings_text(answer: &PlanThreadResponse, style: Style) -> Result<String, CliError> {
    findings::text(&answer.findings, &mut Source::of_text(NAME, "")?, style)
}

/// The option that says a field: named as it, without the unit, but for a few.
fn option_of(field: &str) -> String {
    let units = ["_rev_per_min", "_mm", "_deg"];
    let name = match field {
        "amplitude_ratio" => "ratio",
        "spindle_rev_per_min" => "spindle",
        "interpolation_period_us" => "period_us",
        "advance" => "pitch",
        field => units.iter().find_map(|unit| field.strip_suffix(unit)).unwrap_or(field),
    };
    name.replace('_', "-")
}

/// Violations by the options that they are about.
fn wrong_options(violations: &[Violation]) -> CliError {
    let line = |violation: &Violation| format!("--{}: {}", option_of(&violation.field), violation.description);
    CliError::trouble(violations.iter().map(line).collect::<Vec<_>>().join("\n"))
}

#[cfg(test)]
mod tests {
    use clap::Args as _;

    use super::*;

    #[test]
    fn what_is_wrong_is_said_of_options_that_there_are() {
        let wrong = proto::PlanThreadRequest {
            starts: 99,
            taper: 9.0,
            root_flat_mm: -1.0,
            included_angle_deg: Some(0.0),
            finishing_allowance_mm: Some(-1.0),
            max_thickness_mm: Some(-1.0),
            finishing_thickness_mm: Some(-1.0),
            approach_mm: Some(-1.0),
            relief_angle_deg: Some(99.0),
            vibrations_per_rev: Some(0.0),
            amplitude_margin: Some(0.0),
            amplitude_ratio: Some(0.0),
            clearance_mm: Some(-1.0),
            interpolation_period_us: 1,
            hand: 99,
            side: 99,
            rotation: 99,
            law: 99,
            method: 99,
            start_up: 99,
            infeed: 99,
            ..proto::PlanThreadRequest::default()
        };
        let mut violations = Violations::default();
        assert!(thread_request_from_proto(&mut violations, &wrong, "machine_kind", None).is_none());
        let command = Args::augment_args(clap::Command::new("thread-plan"));
        let options: Vec<_> = command.get_arguments().filter_map(clap::Arg::get_long).collect();
        let fields =
            |description: &str| description.split(' ').any(|word| word.contains('_')).then(|| description.to_owned());
        assert!(violations.as_slice().len() > 20);
        for violation in violations.as_slice() {
            let option = option_of(&violation.field);
            assert!(options.contains(&option.as_str()), "--{option} of {}", violation.field);
            assert_eq!(fields(&violation.description), None, "it names a field");
        }
    }
}
