//! `feedwave validate`: findings and report of a program.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use clap::ValueEnum;
use feedwave_contract::convert::report_to_proto;
use feedwave_cutting::{Frame, PipelineConfig, PlanQuality};

use super::machine::MachineArgs;
use super::overrides::OverrideArgs;
use super::source::IncludeArgs;
use super::terminal::{Style, number, print, print_json, tell};
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
  feedwave validate --machine-kind mill --compare-qualities mould.nc
      Machining times planned fast and for the least time.
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
    /// Plan the program in the other quality as well, for its time
    #[arg(long)]
    compare_qualities: bool,
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
    let clock = Instant::now();
    let report = local::validate(&mut source, Arc::clone(&config), |_| {})?;
    let planning_s = clock.elapsed().as_secs_f64();
    let mut shown = report_to_proto(&report);
    if args.compare_qualities && report.is_accepted() {
        let other = in_other_quality(&config);
        let compared = report_to_proto(&local::validate(&mut source, other, |_| {})?);
        if let (Some(summary), Some(other)) = (&mut shown.summary, compared.summary) {
            summary.quality_times.extend(other.quality_times);
        }
    }
    match args.format {
        Format::Json => print_json(&shown)?,
        Format::Text => {
            print(&report::text(&shown, &mut source, Style::stdout())?)?;
            if report.is_accepted() && report.summary.duration_s > 0.0 {
                tell(&planning(planning_s, report.summary.duration_s));
            }
        }
    }
    let refused = !report.is_accepted() || args.deny_warnings && report.summary.warnings > 0;
    Ok(if refused { ExitCode::from(EXIT_REFUSED) } else { ExitCode::SUCCESS })
}

/// The same with the speed along the path planned in the other quality.
fn in_other_quality(config: &Arc<PipelineConfig>) -> Arc<PipelineConfig> {
    let mut other = PipelineConfig::clone(config);
    other.profile.plan_quality = match other.profile.plan_quality {
        PlanQuality::Fast => PlanQuality::LeastTime,
        PlanQuality::LeastTime => PlanQuality::Fast,
    };
    Arc::new(other)
}

/// How long reading and planning took against machining.
fn planning(planning_s: f64, duration_s: f64) -> String {
    let ratio = number(duration_s / planning_s.max(1e-9), 3);
    format!("read, planned and interpolated in {} s here: {ratio} s of machining per second\n", number(planning_s, 3))
}
