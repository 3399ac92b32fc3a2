//! `feedwave validate`: findings and report of a program.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use feedwave_contract::convert::report_to_proto;
use feedwave_cutting::Frame;

use super::machine::MachineArgs;
use super::overrides::OverrideArgs;
use super::source::IncludeArgs;
use super::terminal::{Style, print, print_json};
use super::{CliError, EXIT_REFUSED, local, report};

/// Arguments of `feedwave validate`.
#[derive(Debug, clap::Args)]
#[command(
    after_long_help = "Exit codes: 0 accepted (warnings allowed), 1 errors found, 2 wrong usage or unreadable file.

Examples:
  feedwave validate shaft.nc
      Check a turning program on a generic lathe.
  feedwave validate --machine-kind mill pocket.nc
  feedwave validate --profile lathe-3.toml --period-us 250 shaft.nc
      The machine's own limits, codes and diameter rule; setpoints every 0.25 ms.
  feedwave validate --override 0:80 shaft.nc
      Times, peaks and chips at 80 % of the programmed feed.
  feedwave validate --format json shaft.nc | jq '.sections[].chip.broken'
      For scripts: feedwave.v1.ValidationReport of the contract, as the service answers it.
  cat shaft.nc | feedwave validate --deny-warnings - && echo clean"
)]
pub struct Args {
    /// The program; `-` reads standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    machine: MachineArgs,
    #[command(flatten)]
    include: IncludeArgs,
    #[command(flatten)]
    overrides: OverrideArgs,
    /// Form of the answer
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    format: Format,
    /// Exit with 1 on warnings too
    #[arg(long)]
    deny_warnings: bool,
}

/// Form of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// For people
    Text,
    /// One JSON object: the message of the service's contract
    Json,
}

/// Checks it.
///
/// # Errors
/// [`CliError`] when the program or the profile cannot be read.
pub(super) fn run(args: Args) -> Result<ExitCode, CliError> {
    let mut source = args.include.open(&args.file)?;
    let config = args.machine.config(Frame::Machine, source.further_names())?;
    let config = args.overrides.apply(config)?;
    let report = local::validate(&mut source, config, |_| {})?;
    let shown = report_to_proto(&report);
    match args.format {
        Format::Json => print_json(&shown)?,
        Format::Text => print(&report::text(&shown, &mut source, Style::stdout())?)?,
    }
    let refused = !report.is_accepted() || args.deny_warnings && report.summary.warnings > 0;
    Ok(if refused { ExitCode::from(EXIT_REFUSED) } else { ExitCode::SUCCESS })
}
