//! `feedwave improve`: a program and a machine in, a better program out, every change with its reason and its gain.
//!
//! Invariants: only words in their place change; what comes out is validated again, and a change that validation does not bear out
//! is not made; what is not changed is said with its reason.

mod edit;
mod plan;
mod text;

use std::collections::BTreeSet;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use feedwave_contract::convert::report_to_proto;
use feedwave_cutting::{Frame, PipelineConfig, SearchGoals, ValidationReport};

use self::edit::{FunctionBlock, function_blocks};
use self::plan::{Change, Outcome, Section};
use super::machine::MachineArgs;
use super::source::Source;
use super::terminal::{Style, print_bytes, tell};
use super::{CliError, EXIT_REFUSED, local, report};

/// Longest program that is improved, bytes.
const MAX_PROGRAM_BYTES: u64 = 64 << 20;

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
  feedwave improve shaft.nc | patch shaft.nc"
)]
pub struct Args {
    /// The program; `-` reads standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    machine: MachineArgs,
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
    fn goals(&self, config: &PipelineConfig) -> SearchGoals {
        SearchGoals {
            margin: self.margin,
            speed_tolerance: 0.01 * self.speed_tolerance,
            max_feed_override: self.feed_override.map_or(config.profile.max_feed_override, |percent| 0.01 * percent),
            frequency_hz: self.frequency,
        }
    }
}

/// Improves it.
///
/// # Errors
/// [`CliError`] when the program or the profile cannot be read, or the result not be written.
pub(super) fn run(args: &Args) -> Result<ExitCode, CliError> {
    if args.out.as_deref().is_some_and(|out| is_same_file(out, &args.file)) {
        return Err(CliError::trouble("--out: is the program itself; changes are made in a copy"));
    }
    let mut source = Source::open(&args.file)?;
    let config = args.machine.config(Frame::Machine, Arc::new([]))?;
    let program = read(&mut source)?;
    let before = local::validate(&mut source, Arc::clone(&config), |_| {})?;
    if !before.is_accepted() {
        tell(&report::text(&report_to_proto(&before), &mut source, Style::stderr())?);
        tell("nothing is improved in a program with errors\n");
        return Ok(ExitCode::from(EXIT_REFUSED));
    }
    let blocks = function_blocks(&program, &config);
    let goals = args.goals(&config);
    let sections = plan::sections(&before, &blocks, &config, &goals, args.least_amplitude);
    let Improved { sections, program: improved, after } =
        settle(sections, &before, &program, &source.name, &config, &goals)?;
    let changed: Vec<&Change> = sections.iter().flat_map(Section::changes).collect();
    print_bytes(&edit::diff(&program, &improved, &source.name))?;
    if let Some(out) = &args.out {
        write(out, &improved)?;
    }
    tell(&text::report(&sections, &before, &after, &goals, changed.len()));
    let holds = sections.iter().all(|section| !matches!(section.outcome, Outcome::NotPossible(_)))
        && text::not_judged(&before) == 0;
    Ok(if holds { ExitCode::SUCCESS } else { ExitCode::from(EXIT_REFUSED) })
}

/// What came of it.
struct Improved {
    sections: Vec<Section>,
    program: Vec<u8>,
    after: ValidationReport,
}

/// Makes the changes and validates what comes out; changes that validation does not bear out are taken back, until all that are
/// left hold together.
fn settle(
    mut sections: Vec<Section>,
    before: &ValidationReport,
    program: &[u8],
    name: &str,
    config: &Arc<PipelineConfig>,
    goals: &SearchGoals,
) -> Result<Improved, CliError> {
    loop {
        let changes: Vec<&Change> = sections.iter().flat_map(Section::changes).collect();
        let improved = edit::apply(program, &changes);
        let mut source = Source::of_bytes(name, &improved)?;
        let after = local::validate(&mut source, Arc::clone(config), |_| {})?;
        let mut taken_back = false;
        for section in &mut sections {
            if let Some(reason) = section.fault(before, &after, goals) {
                section.outcome = Outcome::NotPossible(reason);
                taken_back = true;
            }
        }
        if !taken_back && !after.is_accepted() {
            // What is wrong belongs to no section: nothing is changed.
            for section in &mut sections {
                taken_back |= section.take_back("the program as a whole would be refused with it");
            }
        }
        if !taken_back {
            return Ok(Improved { sections, program: improved, after });
        }
    }
}

fn read(source: &mut Source) -> Result<Vec<u8>, CliError> {
    if source.size > MAX_PROGRAM_BYTES {
        let message = format!("{}: has {} bytes; at most {MAX_PROGRAM_BYTES} are improved", source.name, source.size);
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
        if program.len() as u64 > MAX_PROGRAM_BYTES {
            return Err(CliError::trouble(format!("{}: grows while it is read", source.name)));
        }
    }
    source.rewind()?;
    Ok(program)
}

fn is_same_file(one: &Path, other: &Path) -> bool {
    one == other || same_file::is_same_file(one, other).unwrap_or(false)
}

fn write(path: &Path, program: &[u8]) -> Result<(), CliError> {
    let failed = |error: std::io::Error| CliError::file(path, &error);
    let mut file = std::fs::File::create(path).map_err(failed)?;
    file.write_all(program).and_then(|()| file.sync_all()).map_err(failed)
}

/// Lines on which something is switched on more than once cannot be changed for one of them alone.
fn unique_lines(blocks: &[FunctionBlock]) -> BTreeSet<u32> {
    let mut seen = BTreeSet::new();
    let mut twice = BTreeSet::new();
    for block in blocks {
        if !seen.insert(block.line) {
            twice.insert(block.line);
        }
    }
    &seen - &twice
}
