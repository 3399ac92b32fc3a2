//! `feedwave improve`: a program and a machine in, a better program out, every change with its reason and its gain.
//!
//! Invariants: only words in their place change; what comes out is validated again, and a change that validation does not bear out
//! is not made; what is not changed is said with its reason.

mod diff;
mod text;

use std::borrow::Cow;
use std::path::PathBuf;
use std::process::ExitCode;

use feedwave_contract::convert::{improvement_goals_from_proto, improvement_to_proto, report_to_proto};
use feedwave_contract::proto;
use feedwave_contract::violations::Violations;
use feedwave_cutting::{Frame, MAX_IMPROVED_BYTES, Surroundings};
use feedwave_program::Place;

use super::machine::MachineArgs;
use super::source::{IncludeArgs, Source, refuse_input};
use super::stability::StabilityArgs;
use super::terminal::{Style, print_bytes, print_json, tell};
use super::validate::Format;
use super::{CliError, EXIT_REFUSED, report};
use crate::output::OutputFile;

/// Arguments of `feedwave improve`.
#[derive(Clone, Debug, clap::Args)]
#[command(
    after_long_help = "Exit codes: 0 everything that is wanted holds, with the changes or without any; 1 errors found, or something
that is wanted does not hold and could not be improved; 2 wrong usage or unreadable file.

Examples:
  feedwave improve shaft.nc
      The changes as a unified diff; reasons, gains and a report before and after on standard error.
  feedwave improve --profile lathe-3.toml --out better.nc shaft.nc
      The whole program as well, in a file of its own.
  feedwave improve --margin 1.3 --speed-tolerance 3 --least-amplitude shaft.nc
  feedwave improve --max-feed 0.25 --max-tolerance 0.02 shaft.nc
      Thicker chips and a larger tolerance as well, where they save time.
  feedwave improve --lobes lobes.json --depth 1.5 --spindle-speed 800:1600 shaft.nc
      Every cut stable as well; where one is not, at the nearest speed that is.
  feedwave improve --format json shaft.nc | jq '.steps[].reason'
  feedwave improve shaft.nc | patch shaft.nc"
)]
pub struct Args {
    /// The program; `-` reads standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    machine: MachineArgs,
    #[command(flatten)]
    include: IncludeArgs,
    /// How far beyond breaking every chip is to be: 2A·|sin πD| over the feed of a revolution, 1 to 10
    #[arg(long, value_name = "FACTOR", default_value = "1.1", value_parser = in_range(1.0, 10.0))]
    margin: f64,
    /// By how many per cent the spindle may be slower or faster than programmed, 0 to 20
    #[arg(long, value_name = "PERCENT", default_value = "2", value_parser = in_range(0.0, 20.0))]
    speed_tolerance: f64,
    /// Lowest and highest frequency in Hz, such as 30:80 [default: by a quarter around the programmed one, and by at least 0.6
    /// vibrations of a revolution]
    #[arg(long, value_name = "LOW:HIGH", value_parser = frequencies)]
    frequency: Option<[f64; 2]>,
    /// Largest feed override up to which chips have to break, % [default: the largest that the machine permits]
    #[arg(long, value_name = "PERCENT", value_parser = in_range(100.0, 200.0))]
    feed_override: Option<f64>,
    /// Lower amplitudes that are more than enough as well
    #[arg(long)]
    least_amplitude: bool,
    /// Lowest and highest spindle speed in rev/min, such as 800:1200, to which the speed of a section may change whose chip breaks at
    /// no frequency otherwise; of a speed that other cuts have as well it is changed for all of them [default: speeds stay]
    #[arg(long, value_name = "LOW:HIGH", value_parser = frequencies)]
    spindle_speed: Option<[f64; 2]>,
    /// Largest feed per revolution in mm: feeds of vibrating sections are raised up to it, at the largest feed override, as far as chips
    /// break within the limits of the axes; a vibration makes the chip thicker than that in places [default: feeds stay]
    #[arg(long, value_name = "MM", value_parser = in_range(1e-4, 10.0))]
    max_feed: Option<f64>,
    /// Largest tolerance of the path in mm, to which tolerances (`G64 P`) are raised where that saves time [default: they stay]
    #[arg(long, value_name = "MM", value_parser = in_range(1e-5, 10.0))]
    max_tolerance: Option<f64>,
    #[command(flatten)]
    stability: StabilityArgs,
    /// Form of the answer: a unified diff, or one JSON object with changes, reasons, gains and both reports
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    format: Format,
    /// File for the whole program with the changes; not the program itself
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

fn in_range(low: f64, high: f64) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| {
        let value = text.trim().parse::<f64>().ok().filter(|value| (low..=high).contains(value));
        value.ok_or_else(|| format!("must be a number from {low} to {high}"))
    }
}

fn frequencies(text: &str) -> Result<[f64; 2], String> {
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite() && *value > 0.0);
    let (low, high) = text.split_once(':').ok_or("write it as LOW:HIGH, such as 30:80")?;
    match (number(low), number(high)) {
        (Some(low), Some(high)) if low <= high => Ok([low, high]),
        _ => Err("both must be positive numbers, the lower one first".to_owned()),
    }
}

impl Args {
    /// What is wanted, as a client would state it.
    fn goals(&self) -> Result<proto::ImprovementGoals, CliError> {
        let (low, high) =
            (|range: Option<[f64; 2]>| range.map(|it| it[0]), |range: Option<[f64; 2]>| range.map(|it| it[1]));
        let stability = self.stability.read()?.zip(self.stability.depth).map(|(lobes, depth_mm)| {
            proto::StabilityGoal { lobes: Some(lobes), depth_mm, depth_tolerance: Some(self.stability.depth_tolerance) }
        });
        Ok(proto::ImprovementGoals {
            margin: Some(self.margin),
            speed_tolerance: Some(0.01 * self.speed_tolerance),
            min_frequency_hz: low(self.frequency),
            max_frequency_hz: high(self.frequency),
            max_feed_override: self.feed_override.map(|percent| 0.01 * percent),
            least_amplitude: self.least_amplitude,
            min_spindle_rev_per_min: low(self.spindle_speed),
            max_spindle_rev_per_min: high(self.spindle_speed),
            max_feed_per_rev_mm: self.max_feed,
            max_tolerance_mm: self.max_tolerance,
            stability,
        })
    }
}

/// Further program files of the program.
struct FurtherFiles<'a>(&'a mut Source);

impl Surroundings for FurtherFiles<'_> {
    type Error = CliError;

    fn further(&mut self, place: Place) -> Result<Cow<'_, [u8]>, CliError> {
        self.0.read(place).map(Cow::Borrowed)
    }

    fn step(&mut self) -> Result<(), CliError> {
        Ok(())
    }
}

/// Improves it.
///
/// # Errors
/// [`CliError`] when the program or the profile cannot be read, or the result not be written.
pub(super) fn run(args: &Args) -> Result<ExitCode, CliError> {
    if let Some(out) = &args.out {
        let program = std::iter::once(("the program", args.file.as_path()));
        refuse_input(out, program.chain(args.machine.files()).chain(args.stability.file()))?;
    }
    let mut source = args.include.open(&args.file)?;
    let config = args.machine.config(Frame::Machine, source.further_names())?;
    let program = read(&mut source)?;
    let mut violations = Violations::default();
    let requested = improvement_goals_from_proto(&mut violations, "goals", Some(&args.goals()?));
    violations.finish().map_err(|violations| CliError::trouble(violations.to_string()))?;
    let goals = requested.on(&config.profile);
    let improvement = feedwave_cutting::improve(&program, &config, &goals, &mut FurtherFiles(&mut source))?;
    if let Some(out) = &args.out {
        refuse_input(out, source.read_files())?;
    }
    let shown = improvement_to_proto(&improvement, &goals);
    if args.format == Format::Json {
        print_json(&shown)?;
    }
    if !improvement.after.is_accepted() && improvement.steps.is_empty() {
        tell(&report::text(&report_to_proto(&improvement.before), &mut source, Style::stderr())?);
        tell("nothing is improved in a program with errors\n");
        return Ok(ExitCode::from(EXIT_REFUSED));
    }
    if args.format == Format::Text {
        print_bytes(&diff::diff(&program, &improvement.program, &source.name))?;
    }
    if let Some(out) = &args.out {
        OutputFile::write_whole(out, &improvement.program).map_err(|error| CliError::file(out, &error))?;
    }
    tell(&text::report(&shown));
    Ok(if improvement.holds() { ExitCode::SUCCESS } else { ExitCode::from(EXIT_REFUSED) })
}

fn read(source: &mut Source) -> Result<Vec<u8>, CliError> {
    if source.size > MAX_IMPROVED_BYTES {
        let message = format!("{}: has {} bytes; at most {MAX_IMPROVED_BYTES} are improved", source.name, source.size);
        return Err(CliError::trouble(message));
    }
    source.rewind()?;
    let mut program = Vec::new();
    loop {
        match source.next_piece()? {
            [] => break,
            piece => program.extend_from_slice(piece),
        }
        // A file may grow while it is read.
        if program.len() as u64 > MAX_IMPROVED_BYTES {
            return Err(CliError::trouble(format!("{}: grows while it is read", source.name)));
        }
    }
    source.rewind()?;
    Ok(program)
}
