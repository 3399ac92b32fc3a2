//! `feedwave run`
//!
//! The client's half of a live run, in step with the service: credit is given for a stretch of setpoints, the machine
//! moves along it, and the next stretch waits until the telemetry of this one is durable. What a decision changes thus
//! acts on the very next stretch, however fast the computer is.

mod drive;
mod machine;
mod summary;

use std::path::PathBuf;
use std::process::ExitCode;

use feedwave_plot::write_run;
use feedwave_simulator::Simulator;
use tonic::Code;

use super::client::{Client, ServerArgs};
use super::decisions::{heading, line};
use super::terminal::{print, tell};
use super::{CliError, EXIT_REFUSED};
pub(super) use drive::Drive;
use feedwave_contract::proto::{
    Decision, GetMonitoringRequest, MonitoringConfig, ProcessProperty, RecordingSettings, RunSettings, RunState,
    SetMonitoringRequest,
};
use machine::MachineArgs;
pub(super) use machine::default_monitoring;

/// Arguments of `feedwave run`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 finished, 1 stopped or aborted, 2 wrong usage or no answer.

Examples:
  feedwave run \"$job\" --simulate --cut 3:1.0
      The default mill cuts 1 mm deep in line 3.
  feedwave run \"$job\" --simulate
      A dry run: nothing is cut, so that nothing changes the feed.
  feedwave run \"$job\" --simulate --cut 3-7:0.5 --cut 9:2 --seed 4
  feedwave run \"$job\" --simulate --description machine.json
      Everything about the machine, its tool, its sensors and their faults from a file.
  feedwave replay runs/0197b3c2-…
      Afterwards: proves that its decisions and setpoints follow from the log.")]
pub struct Args {
    /// The job, `jobs/{job}` or the part after the slash
    #[arg(value_name = "JOB")]
    job: String,
    #[command(flatten)]
    server: ServerArgs,
    /// Simulate the machine; the only kind of machine that this command can move
    #[arg(long)]
    simulate: bool,
    #[command(flatten)]
    machine: MachineArgs,
    /// Keep steady cuts of the telemetry to learn from (`feedwave learn`), at most so many bytes [default: 8388608]
    #[arg(long, value_name = "BYTES", num_args = 0..=1, default_missing_value = "8388608")]
    record: Option<u64>,
    /// Directory for a picture of deflection, limits and feed override over time, SVG and PNG; created where there is none
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// [`CliError`] when the machine cannot be simulated, or the service refuses the run or does not answer.
pub(super) async fn run(args: Args) -> Result<ExitCode, CliError> {
    if !args.simulate {
        return Err(CliError::trouble("only a simulated machine can be run from the command line: add --simulate"));
    }
    let mut description = args.machine.description()?;
    if let Some(directory) = &args.plots {
        std::fs::create_dir_all(directory).map_err(|error| CliError::file(directory, &error))?;
    }
    let client = args.server.connect().await?;
    let job = if args.job.contains('/') { args.job } else { format!("jobs/{}", args.job) };
    let monitoring = monitoring(&client, &job, &description).await?;
    let machine = |period_us| {
        description.interpolation_period_us = period_us;
        Simulator::new(description).map_err(|violations| machine::refused(&violations))
    };
    let recording = args.record.map(|max_bytes| RecordingSettings { max_bytes: Some(max_bytes), cut_s: None });
    let settings = RunSettings { recording, ..RunSettings::default() };
    let mut run = Drive::begin(&client, &job, settings, limits_mm(&monitoring), machine).await?;
    print(&format!("{}\n{}\n", run.name, heading()))?;
    let mut show = |decision: &Decision| print(&format!("{}\n", line(decision)));
    let idle_speeds = monitoring.idle_run_up.map(|run_up| run_up.spindle_rev_per_min).unwrap_or_default();
    run.idle(args.machine.idle_rev_per_min, &idle_speeds, &mut show).await?;
    run.follow(u64::MAX, &mut show).await?;
    print(&run.summary.text(&run.name, run.period_us))?;
    if let Some(directory) = &args.plots {
        for path in write_run(&run.trace, directory).map_err(CliError::trouble)? {
            tell(&format!("wrote {}\n", path.display()));
        }
    }
    let finished = run.summary.end.as_ref().is_some_and(|end| end.state() == RunState::Finished);
    Ok(if finished { ExitCode::SUCCESS } else { ExitCode::from(EXIT_REFUSED) })
}

/// Limits of the deflection, where that is what is judged.
fn limits_mm(monitoring: &MonitoringConfig) -> Option<[f64; 2]> {
    let rules = monitoring.rules.as_ref()?;
    let is_deviation = matches!(rules.property(), ProcessProperty::Unspecified | ProcessProperty::Deviation);
    rules.feed.filter(|_| is_deviation).map(|feed| [feed.lower, feed.upper])
}

/// The job's monitoring; where it has none, one that fits the simulated sensors is set.
async fn monitoring(
    client: &Client,
    job: &str,
    description: &feedwave_simulator::Description,
) -> Result<MonitoringConfig, CliError> {
    let mut telemetry = client.telemetry();
    let failed = |status| client.failed(&status);
    match telemetry.get_monitoring(GetMonitoringRequest { job: job.to_owned() }).await {
        Ok(response) => Ok(response.into_inner().config.unwrap_or_default()),
        // A job that does not exist is reported by the attempt to set its monitoring.
        Err(status) if status.code() == Code::NotFound => {
            let config = Some(default_monitoring(description)?);
            let set = telemetry.set_monitoring(SetMonitoringRequest { job: job.to_owned(), config }).await;
            let config = set.map_err(failed)?.into_inner().config.unwrap_or_default();
            if let Some(feed) = config.rules.as_ref().and_then(|rules| rules.feed) {
                let (lower, upper) = (feed.lower, feed.upper);
                tell(&format!("{job} had no monitoring; set: deflection between {lower} and {upper} mm\n"));
            }
            Ok(config)
        }
        Err(status) => Err(failed(status)),
    }
}
