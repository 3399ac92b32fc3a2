//! `feedwave run`
//!
//! The client's half of a live run, in step with the service: credit is given for a stretch of setpoints, the machine
//! moves along it, and the next stretch waits until the telemetry of this one is durable. What a decision changes thus
//! acts on the very next stretch, however fast the computer is.

mod machine;
mod summary;

use std::path::PathBuf;
use std::process::ExitCode;

use feedwave_cutting::SetpointBlock;
use feedwave_monitoring::{Batch, Pair};
use feedwave_simulator::{SetpointError, Setpoints, Simulator};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Streaming};

use super::client::{Client, Decoder, ServerArgs};
use super::decisions::{heading, line};
use super::terminal::{print, tell};
use super::{CliError, EXIT_REFUSED};
use crate::plot::{RunTrace, write_run};
use crate::proto::decision_inputs::Evidence;
use crate::proto::run_request::Message as Request;
use crate::proto::run_response::Message;
use crate::proto::run_start::Target;
use crate::proto::runs_client::RunsClient;
use crate::proto::telemetry_client::TelemetryClient;
use crate::proto::{
    ChannelPair, GetMonitoringRequest, MonitorState, MonitoringConfig, ProcessProperty, RunCredit, RunReceipt,
    RunRequest, RunResponse, RunStart, RunStarted, RunState, SetMonitoringRequest, TelemetryBatch,
};
use machine::MachineArgs;
use summary::Summary;

/// Time of the setpoints handed out at once, s.
const STRETCH_S: f64 = 0.1;
/// Most setpoints handed out at once.
const MAX_STRETCH: f64 = 1000.0;
/// Longest time that the machine idles for one state of the monitoring, s.
const MAX_IDLE_S: f64 = 120.0;

/// Arguments of `feedwave run`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 finished, 1 stopped or aborted, 2 wrong usage or no answer.

Examples:
  feedwave run \"$job\" --simulate --cut 3:1.0
      The default mill cuts 1 mm deep in line 3.
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
    let open = Open::begin(&client, &job).await?;
    description.interpolation_period_us = open.period_us as u32;
    let machine = Simulator::new(description).map_err(|violations| machine::refused(&violations))?;
    let mut trace = RunTrace { subtitle: format!("{job} \u{b7} {}", open.name), ..RunTrace::default() };
    let rules = monitoring
        .rules
        .as_ref()
        .filter(|rules| matches!(rules.property(), ProcessProperty::Unspecified | ProcessProperty::Deviation));
    trace.limits_mm = rules.and_then(|rules| rules.feed).map(|feed| [feed.lower, feed.upper]);
    trace.feed_percent.push(0.0, 100.0);
    let mut run = Run { client, machine, open, summary: Summary::default(), trace, feed: 1.0 };
    print(&format!("{}\n{}\n", run.open.name, heading()))?;
    let idle_speeds = monitoring.idle_run_up.map(|run_up| run_up.speeds_rpm).unwrap_or_default();
    run.idle(args.machine.idle_rpm, &idle_speeds).await?;
    run.follow().await?;
    print(&run.summary.text(&run.open.name, run.open.period_us))?;
    if let Some(directory) = &args.plots {
        run.trace.feed_percent.push(run.machine.clock_ns() as f64 * 1e-9, 100.0 * run.feed);
        for path in write_run(&run.trace, directory).map_err(CliError::trouble)? {
            tell(&format!("wrote {}\n", path.display()));
        }
    }
    let finished = run.summary.end.as_ref().is_some_and(|end| end.state() == RunState::Finished);
    Ok(if finished { ExitCode::SUCCESS } else { ExitCode::from(EXIT_REFUSED) })
}

/// The job's monitoring; where it has none, one that fits the simulated sensors is set.
async fn monitoring(
    client: &Client,
    job: &str,
    description: &feedwave_simulator::Description,
) -> Result<MonitoringConfig, CliError> {
    let mut telemetry = TelemetryClient::new(client.channel.clone());
    let failed = |status| client.failed(&status);
    match telemetry.get_monitoring(GetMonitoringRequest { job: job.to_owned() }).await {
        Ok(response) => Ok(response.into_inner().config.unwrap_or_default()),
        // A job that does not exist is told by the attempt to set its monitoring.
        Err(status) if status.code() == Code::NotFound => {
            let config = Some(machine::usual_monitoring(description)?);
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

/// The connection of a run.
struct Open {
    name: String,
    requests: mpsc::Sender<RunRequest>,
    responses: Streaming<RunResponse>,
    decoder: Decoder,
    period_us: f64,
    state: MonitorState,
    /// Newest telemetry batch that was sent, and that is durable.
    sent: Option<u64>,
    durable: Option<u64>,
    /// Setpoints taken, and setpoints that may come.
    taken: u64,
    credit: u64,
}

impl Open {
    async fn begin(client: &Client, job: &str) -> Result<Self, CliError> {
        let (requests, messages) = mpsc::channel(64);
        let start = RunStart { target: Some(Target::Job(job.to_owned())), ..RunStart::default() };
        let first = RunRequest { message: Some(Request::Start(start)) };
        requests.send(first).await.map_err(CliError::trouble)?;
        let mut runs = RunsClient::new(client.channel.clone());
        let response = runs.run(ReceiverStream::new(messages)).await.map_err(|status| client.failed(&status))?;
        let mut responses = response.into_inner();
        let first = responses.message().await.map_err(|status| client.failed(&status))?;
        match first.and_then(|response| response.message) {
            Some(Message::Started(started)) => {
                let state = started.state();
                let RunStarted { run: name, header, .. } = started;
                let header = header.ok_or_else(|| broken("a run began without header"))?;
                let (decoder, period_us) = (Decoder::new(&header), header.period_us);
                let (sent, durable, taken, credit) = (None, None, 0, 0);
                Ok(Self { name, requests, responses, decoder, period_us, state, sent, durable, taken, credit })
            }
            _ => Err(broken("a run did not begin with its start")),
        }
    }

    /// Says something. That nobody listens any more is told by the next answer.
    async fn say(&self, message: Request) {
        let _ = self.requests.send(RunRequest { message: Some(message) }).await;
    }

    async fn send(&mut self, batches: Vec<TelemetryBatch>) {
        for batch in batches {
            self.sent = self.sent.max(Some(batch.sequence));
            self.say(Request::Batch(batch)).await;
        }
    }

    fn is_durable(&self) -> bool {
        self.durable >= self.sent
    }
}

fn broken(what: &str) -> CliError {
    CliError::trouble(format!("the service broke its contract: {what}"))
}

/// A machine on its run.
struct Run {
    client: Client,
    machine: Simulator,
    open: Open,
    summary: Summary,
    trace: RunTrace,
    /// Feed override decided last.
    feed: f64,
}

impl Run {
    /// Idles until the monitoring waits for contact: baseline, then the steps of the run-up.
    async fn idle(&mut self, baseline_rpm: f64, run_up_rpm: &[f64]) -> Result<(), CliError> {
        let mut slices = 0_usize;
        while self.summary.end.is_none() {
            let rpm = match self.open.state {
                MonitorState::Baseline => baseline_rpm,
                // Speeds in turn: each step collects what belongs to it.
                MonitorState::IdleRunUp => {
                    run_up_rpm.get(slices % run_up_rpm.len().max(1)).copied().unwrap_or_default()
                }
                _ => return Ok(()),
            };
            if slices as f64 * STRETCH_S >= MAX_IDLE_S {
                let state = self.open.state.as_str_name();
                return Err(CliError::trouble(format!(
                    "{}: still {state} after {MAX_IDLE_S} s of idling at {rpm} rev/min: raise --idle-rpm or shorten the \
                     baseline of the job's monitoring",
                    self.open.name
                )));
            }
            let mut batches = Vec::new();
            let mut sink = |batch: &Batch<'_>| batches.push(batch_to_proto(batch));
            self.machine.idle(STRETCH_S, rpm, &mut sink).map_err(|error| unable(&error))?;
            self.machine.flush(&mut sink);
            self.open.send(batches).await;
            while self.summary.end.is_none() && !self.open.is_durable() {
                self.answer().await?;
            }
            slices += 1;
        }
        Ok(())
    }

    /// Follows the setpoints to their end.
    async fn follow(&mut self) -> Result<(), CliError> {
        let stretch = (STRETCH_S * 1e6 / self.open.period_us).clamp(1.0, MAX_STRETCH) as u64;
        while self.summary.end.is_none() {
            if self.open.taken == self.open.credit && self.open.is_durable() {
                self.open.credit += stretch;
                self.open.say(Request::Credit(RunCredit { end_index: self.open.credit })).await;
            }
            self.answer().await?;
        }
        Ok(())
    }

    /// Acts on the next message of the service.
    async fn answer(&mut self) -> Result<(), CliError> {
        let response = self.open.responses.message().await;
        let response = response.map_err(|status| {
            CliError::trouble(format!("{}: {}: {}", self.client.url, self.open.name, status.message()))
        })?;
        match response.and_then(|response| response.message) {
            Some(Message::Chunk(chunk)) => {
                let block = self.open.decoder.block(&chunk).map_err(|what| broken(&what))?;
                if block.first_index != self.open.taken {
                    return Err(broken("setpoints are missing between two chunks"));
                }
                let batches = self.go(&block)?;
                self.open.send(batches).await;
                self.open.taken += block.len() as u64;
                self.open.say(Request::Receipt(RunReceipt { received: self.open.taken })).await;
            }
            Some(Message::Decision(decision)) => {
                print(&format!("{}\n", line(&decision)))?;
                if let Some(after) = decision.outcome.and_then(|outcome| outcome.after) {
                    self.machine.set_spindle_override(after.spindle).map_err(|error| unable(&error))?;
                    let time_s = decision.sensor_time_ns as f64 * 1e-9;
                    self.trace.feed_percent.push(time_s, 100.0 * self.feed);
                    self.trace.feed_percent.push(time_s, 100.0 * after.feed);
                    self.feed = after.feed;
                    let evidence = decision.inputs.as_ref().and_then(|inputs| inputs.evidence.as_ref());
                    if let Some(Evidence::Process(process)) = evidence {
                        self.trace.measured_mm.push(time_s, process.max_deviation);
                    }
                }
                self.summary.decided(&decision);
            }
            Some(Message::Ack(ack)) => {
                self.open.durable = self.open.durable.max(Some(ack.durable_batch));
                self.open.state = ack.state();
            }
            Some(Message::FeedChange(change)) => self.summary.changed(change),
            Some(Message::Ended(ended)) => self.summary.end = Some(ended),
            Some(Message::Started(_)) => return Err(broken("a run began twice")),
            None => return Err(broken("a run ended without saying so")),
        }
        Ok(())
    }

    /// Moves the machine along setpoints; what its sensors said.
    fn go(&mut self, block: &SetpointBlock) -> Result<Vec<TelemetryBatch>, CliError> {
        let mut batches = Vec::new();
        let mut sink = |batch: &Batch<'_>| batches.push(batch_to_proto(batch));
        let setpoints = Setpoints {
            first_index: block.first_index,
            axes_mm: self.open.decoder.xy().map(|[x, y]| [&block.axes[x][..], &block.axes[y][..]]),
            path_position_mm: &block.path_position_mm,
            feed_mm_per_min: &block.feed_mm_per_min,
            spindle_angle_deg: &block.spindle_angle_deg,
            line: &block.line,
        };
        self.machine.push(&setpoints, &mut sink).map_err(|error| unable(&error))?;
        let time_s = self.machine.clock_ns() as f64 * 1e-9;
        self.trace.true_mm.push(time_s, self.machine.take_peak_deflection_mm());
        // The run may end with these setpoints, and their telemetry belongs to it.
        self.machine.flush(&mut sink);
        Ok(batches)
    }
}

fn unable(error: &SetpointError) -> CliError {
    CliError::trouble(format!("the simulated machine cannot follow: {error}"))
}

fn batch_to_proto(batch: &Batch<'_>) -> TelemetryBatch {
    let pair = |pair: Option<Pair<'_>>| pair.map(|pair| ChannelPair { x: pair.x.to_vec(), y: pair.y.to_vec() });
    TelemetryBatch {
        sequence: batch.sequence,
        events: Vec::new(),
        time_ns: batch.time_ns.to_vec(),
        tool: pair(batch.tool),
        work: pair(batch.work),
        commanded: pair(batch.commanded),
        spindle_angle_rad: batch.spindle_angle_rad.unwrap_or_default().to_vec(),
        spindle_rpm: batch.spindle_rpm.unwrap_or_default().to_vec(),
        contact: batch.contact.unwrap_or_default().to_vec(),
    }
}
