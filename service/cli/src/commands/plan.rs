//! `feedwave plan`: a program into a file of setpoints and pictures.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use clap::ValueEnum;
use feedwave_contract::columns::Extras;
use feedwave_contract::convert::report_to_proto;
use feedwave_cutting::ServoExpander;
use feedwave_cutting::{Frame, GenerationMode, MAX_SERVO_SUBSTEPS, PipelineConfig, SetpointBlock, ValidationReport};
use feedwave_plot::Plots;
use indicatif::ProgressBar;

use super::local::Progress;
use super::machine::MachineArgs;
use super::overrides::OverrideArgs;
use super::pictures::{self, FirstVibration};
use super::source::{IncludeArgs, Source, refuse_input};
use super::terminal::{Style, Unit, count, print_json, progress, tell};
use super::validate::Format;
use super::{CliError, EXIT_REFUSED, local, report};
use crate::output::{CsvWriter, FileFormat, Layout, SetpointWriter, create};

/// Arguments of `feedwave plan`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 written, 1 the program has errors, 2 wrong usage or unusable file.

Examples:
  feedwave plan shaft.nc --out shaft.csv
      Setpoints every millisecond as text.
  feedwave plan shaft.nc --out shaft.parquet --plots pictures
      Compressed columns, and pictures (SVG and PNG): tool path; the path as programmed and as run
      with its deviation in colour and the worst places close up; position over time with the
      vibration, feed, acceleration and jerk, chip thickness around the revolution; for each thread
      the unrolled work, X over the spindle angle and the section of the groove; of a five-axis
      program the rotary axes and tool directions, as programmed and thinned, and the deviation;
      for each tool oscillation waveforms, paths, the layers that the edges remove and the floor.
  feedwave plan shaft.nc --out - --from-time 2.5 --count 1000 | head
      A part of it, on standard output.
  feedwave plan shaft.nc --out shaft.csv --override 2:50 --override 3.5:0 --override 5:100
      As with a hand on the feed override: half the feed from 2 s on, feed hold from 3.5 s to 5 s.
  feedwave plan blade.nc --profile mill.toml --tool 1=120 --frame work --out blade.csv
      Tool centre point and tool direction in work coordinates of a five-axis program.
  feedwave plan shaft.nc --mode servo-side --out conditions.csv
      The command and the condition of the vibration for drives that generate it themselves.
  feedwave plan shaft.nc --mode servo-side --servo-substeps 8 --out drive.csv
      What such a drive generates, eight setpoints per interpolation period.")]
pub struct Args {
    /// The program; `-` reads standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// File to write, `.csv` or `.parquet`; `-` writes CSV to standard output
    #[arg(long, value_name = "FILE", required_unless_present = "plots")]
    out: Option<PathBuf>,
    /// Form of the file, where its name does not say
    #[arg(long, value_enum, value_name = "FORMAT", requires = "out")]
    file_format: Option<FileFormat>,
    /// Directory to draw pictures into; they show the whole program
    #[arg(long, value_name = "DIRECTORY")]
    plots: Option<PathBuf>,
    #[command(flatten)]
    machine: MachineArgs,
    #[command(flatten)]
    include: IncludeArgs,
    #[command(flatten)]
    overrides: OverrideArgs,
    /// Coordinates of the axes
    #[arg(long, value_enum, value_name = "FRAME", default_value_t = FrameArg::Machine)]
    frame: FrameArg,
    /// Run every block, even where the program has blocks thinned
    #[arg(long)]
    every_block: bool,
    /// First setpoint to write
    #[arg(long, value_name = "INDEX", default_value_t = 0)]
    from_index: u64,
    /// Write from the first setpoint at or after this time on, s
    #[arg(long, value_name = "SECONDS", conflicts_with = "from_index", value_parser = time)]
    from_time: Option<f64>,
    /// Setpoints to write at most
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// Form of the result: findings on standard error, or the whole report as JSON on standard output
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    format: Format,
    /// In servo-side mode: write what the drives generate, this many setpoints per period [default: the profile's]
    ///
    /// The command is divided evenly within each period, as a drive without fine interpolation does it: all of its change of
    /// velocity falls into one of the parts, where its acceleration shows as many times as there are parts.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SERVO_SUBSTEPS)))]
    servo_substeps: Option<Option<u32>>,
}

/// Coordinates of the axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum FrameArg {
    /// Positions of the machine's axes, work offsets included
    Machine,
    /// As programmed; X is a radius. Of a five-axis machine the tool centre point, and columns of the tool direction
    Work,
}

impl From<FrameArg> for Frame {
    fn from(frame: FrameArg) -> Self {
        match frame {
            FrameArg::Machine => Self::Machine,
            FrameArg::Work => Self::Work,
        }
    }
}

/// A time on the command line.
pub(super) fn time(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(time_s) if time_s.is_finite() && time_s >= 0.0 => Ok(time_s),
        _ => Err("must be a number of seconds, not negative".to_owned()),
    }
}

/// Plans it.
///
/// # Errors
/// [`CliError`] when a file cannot be used.
pub(super) fn run(args: Args) -> Result<ExitCode, CliError> {
    if let Some(out) = &args.out {
        refuse_input(out, std::iter::once(("the program", args.file.as_path())).chain(args.machine.files()))?;
    }
    let mut source = args.include.open(&args.file)?;
    let config = args.machine.config(args.frame.into(), source.further_names())?;
    let mut config = args.overrides.apply(config)?;
    Arc::make_mut(&mut config).every_block = args.every_block;
    let substeps = substeps(&args, &config)?;
    let format = args.out.as_deref().map(|path| format_of(path, args.file_format)).transpose()?;
    if args.format == Format::Json && args.out.as_deref() == Some(Path::new("-")) {
        return Err(CliError::trouble("--format json: standard output takes the setpoints, give --out a file"));
    }

    let mut vibration = FirstVibration::default();
    let report = local::validate(&mut source, config.clone(), |block| vibration.observe(block))?;
    let shown = report_to_proto(&report);
    match args.format {
        Format::Json => print_json(&shown)?,
        Format::Text => tell(&report::findings_text(&shown, &mut source, Style::stderr())?),
    }
    if !report.is_accepted() {
        tell(&format!("{}\n", report::verdict(&shown, &source.name, Style::stderr())));
        return Ok(ExitCode::from(EXIT_REFUSED));
    }
    if let (Some(path), Some(format)) = (&args.out, format) {
        refuse_input(path, source.read_files())?;
        write(&args, &mut source, &config, &report, substeps, path, format)?;
    }
    if let Some(directory) = &args.plots {
        let files = draw(&mut source, &config, &report, &vibration, directory)?;
        tell(&format!("drew {} pictures into {}\n", files.len(), directory.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Setpoints per interpolation period where the drives' part is to be written.
fn substeps(args: &Args, config: &PipelineConfig) -> Result<Option<u32>, CliError> {
    let servo_side = config.generation_mode == GenerationMode::ServoSide;
    match args.servo_substeps {
        Some(_) if !servo_side => Err(CliError::trouble("--servo-substeps needs --mode servo-side")),
        Some(substeps) => Ok(substeps.or(Some(config.profile.vibration.servo_substeps))),
        None => Ok(None),
    }
}

pub(super) fn format_of(path: &Path, format: Option<FileFormat>) -> Result<FileFormat, CliError> {
    if path == Path::new("-") {
        return match format {
            Some(FileFormat::Parquet) => Err(CliError::trouble("--out -: standard output takes CSV only")),
            _ => Ok(FileFormat::Csv),
        };
    }
    format.or_else(|| FileFormat::of_path(path)).ok_or_else(|| {
        CliError::trouble(format!("--out {}: must end in .csv or .parquet, or --file-format say which", path.display()))
    })
}

/// A writer to a file or standard output.
pub(super) fn writer(path: &Path, format: FileFormat, layout: Layout) -> Result<Box<dyn SetpointWriter>, CliError> {
    if path == Path::new("-") {
        return Ok(Box::new(CsvWriter::new(std::io::stdout(), layout)));
    }
    create(path, format, layout).map_err(|error| CliError::file(path, &error))
}

fn write(
    args: &Args,
    source: &mut Source,
    config: &Arc<PipelineConfig>,
    report: &ValidationReport,
    substeps: Option<u32>,
    path: &Path,
    format: FileFormat,
) -> Result<(), CliError> {
    let divisor = substeps.unwrap_or(1);
    let extras = Extras {
        conditions: config.generation_mode == GenerationMode::ServoSide && substeps.is_none(),
        directions: config.frame == Frame::Work && config.profile.kinematics.is_some(),
    };
    let period_us = f64::from(config.interpolation_period_us) / f64::from(divisor);
    let layout = Layout::of_machine(&config.profile.machine, extras, period_us);
    let from = args.from_time.map_or(args.from_index, |time_s| layout.index_at(time_s));
    let periods = report.summary.setpoint_count;
    let available = periods.saturating_sub(1) * u64::from(divisor) + u64::from(periods > 0);
    if from > 0 && from >= available {
        let last = available.saturating_sub(1);
        return Err(CliError::trouble(format!("setpoint {from} lies beyond the last one, {last}")));
    }
    let wanted = args.count.unwrap_or(u64::MAX).min(available - from);
    let to = from + wanted;

    let failed = |error: std::io::Error| CliError::file(path, &error);
    let mut writer = writer(path, format, layout)?;
    let mut expander =
        substeps.map(|substeps| ServoExpander::new(&config.profile.machine, substeps, config.period_s()));
    let bar: ProgressBar = progress("writing", Unit::Setpoints, to.div_ceil(u64::from(divisor)));
    let mut command = CommandDifferences::default();
    local::generate(source, config.clone(), |block| {
        bar.inc(block.len() as u64);
        if divisor > 1 {
            command.observe(block);
        }
        let block = expander.as_mut().map_or(block, |expander| expander.expand(block));
        let row = |index: u64| index.saturating_sub(block.first_index).min(block.len() as u64) as usize;
        writer.write(block, row(from)..row(to)).map_err(failed)?;
        let enough = block.first_index + block.len() as u64 >= to;
        Ok(if enough { Progress::Enough } else { Progress::Continue })
    })?;
    writer.finish().map_err(failed)?;
    bar.finish_and_clear();
    if path != Path::new("-") {
        tell(&format!("wrote {} setpoints to {}\n", count(wanted), path.display()));
    }
    tell(&command.note(config, divisor));
    Ok(())
}

/// The largest second difference of the command of every axis, over whole interpolation periods.
#[derive(Debug, Default)]
struct CommandDifferences {
    /// The last two commands, older first, and the largest difference.
    axes: Vec<(Vec<f64>, f64)>,
}

impl CommandDifferences {
    fn observe(&mut self, block: &SetpointBlock) {
        self.axes.resize(block.axes.len(), (Vec::new(), 0.0));
        for ((last, largest), column) in self.axes.iter_mut().zip(&block.axes) {
            for &command in column {
                if let [older, newer] = last[..] {
                    *largest = f64::max(*largest, (command - 2.0 * newer + older).abs());
                    last.remove(0);
                }
                last.push(command);
            }
        }
    }

    /// What the division of the command makes of its acceleration, where that is beyond a limit; nothing otherwise.
    fn note(&self, config: &PipelineConfig, parts: u32) -> String {
        let period_s = config.period_s();
        let shown = self.axes.iter().zip(&config.profile.machine.axes).map(|((_, difference), axis)| {
            let shown = f64::from(parts) * difference / (period_s * period_s);
            (shown / axis.max_acceleration_per_s2, shown, axis)
        });
        let Some((_, shown, axis)) = shown.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|worst| worst.0 > 1.0) else {
            return String::new();
        };
        let unit = if axis.axis.is_rotary() { "degrees/s\u{b2}" } else { "mm/s\u{b2}" };
        format!(
            "note: the command is divided evenly within each period, so that its acceleration shows up to {parts} times in \
             one of the parts: {} of {} {unit} on {}. Over whole periods it is within the limits; a drive with fine \
             interpolation spreads it.\n",
            count(shown.round() as u64),
            count(axis.max_acceleration_per_s2.round() as u64),
            axis.name,
        )
    }
}

/// Draws every picture of a valid program; the files.
pub(super) fn draw(
    source: &mut Source,
    config: &Arc<PipelineConfig>,
    report: &ValidationReport,
    vibration: &FirstVibration,
    directory: &Path,
) -> Result<Vec<PathBuf>, CliError> {
    let servo_side = config.generation_mode == GenerationMode::ServoSide;
    let substeps = if servo_side { config.profile.vibration.servo_substeps } else { 1 };
    let period_s = config.period_s() / f64::from(substeps);
    let mut plots: Plots = pictures::prepare(source, config, report, vibration, period_s)?;
    let mut expander = servo_side.then(|| ServoExpander::new(&config.profile.machine, substeps, config.period_s()));
    let bar = progress("drawing", Unit::Setpoints, report.summary.setpoint_count);
    local::generate(source, config.clone(), |block: &SetpointBlock| {
        bar.inc(block.len() as u64);
        plots.push_commands(block);
        plots.push(expander.as_mut().map_or(block, |expander| expander.expand(block)));
        Ok(Progress::Continue)
    })?;
    bar.finish_and_clear();
    let mut files = plots.write(directory).map_err(CliError::trouble)?;
    files.extend(pictures::draw_sections(config, report, directory)?);
    Ok(files)
}
