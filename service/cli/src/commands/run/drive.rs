//! A simulated machine on its run: the client's half of `feedwave.v1.Runs`, taken up again where the connection breaks.

use std::collections::VecDeque;

use feedwave_contract::proto::decision_inputs::Evidence;
use feedwave_contract::proto::machine_event::Event;
use feedwave_contract::proto::run_request::Message as Request;
use feedwave_contract::proto::run_response::Message;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::{
    ChannelPair, Decision, DecisionAction, GetRunRequest, MachineEvent, MonitorState, RunCommand, RunCommandKind,
    RunCredit, RunReceipt, RunRequest, RunResponse, RunSettings, RunSpindleRequest, RunStart, RunStarted,
    SpindleAnswer, SpindleAnswerKind, TelemetryBatch,
};
use feedwave_cutting::SetpointBlock;
use feedwave_monitoring::{Batch, Pair};
use feedwave_plot::RunTrace;
use feedwave_simulator::{SetpointError, Setpoints, Simulator};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Status, Streaming};

use super::summary::Summary;
use crate::commands::client::{Client, Decoder, MAX_RETRIES, is_passing, pause};
use crate::commands::terminal::tell;
use crate::commands::{CliError, decisions};

/// Time of the setpoints handed out at once, s.
const STRETCH_S: f64 = 0.1;
/// Most setpoints handed out at once.
const MAX_STRETCH: f64 = 1000.0;
/// How often it is asked whether a condition was acknowledged.
const ASK_EVERY: std::time::Duration = std::time::Duration::from_millis(500);
/// Longest time that the machine idles for one state of the monitoring, s.
const MAX_IDLE_S: f64 = 120.0;

/// Receives every decision, once and in order.
pub(in crate::commands) type OnDecision<'a> = &'a mut dyn FnMut(&Decision) -> Result<(), CliError>;

/// The connection of a run.
struct Open {
    requests: mpsc::Sender<RunRequest>,
    responses: Streaming<RunResponse>,
}

/// A machine on its run.
pub(in crate::commands) struct Drive {
    client: Client,
    machine: Simulator,
    open: Open,
    /// The run, `runs/{run}`.
    pub(in crate::commands) name: String,
    decoder: Decoder,
    pub(in crate::commands) period_us: f64,
    state: MonitorState,
    /// Telemetry that is not known to be durable.
    waiting: VecDeque<TelemetryBatch>,
    /// Setpoints taken, and setpoints that may come.
    pub(in crate::commands) taken: u64,
    credit: u64,
    /// Number of the next decision, and the place of the last one in the log.
    pub(in crate::commands) decided: u64,
    log: u64,
    pub(in crate::commands) summary: Summary,
    pub(in crate::commands) trace: RunTrace,
    /// An escalation holds the feed, and the path has come to rest.
    feed_held: bool,
    at_rest: bool,
}

impl Open {
    async fn connect(
        client: &Client,
        target: Target,
        start_index: u64,
        settings: Option<RunSettings>,
    ) -> Result<(Self, RunStarted), Status> {
        let (requests, messages) = mpsc::channel(64);
        let start = RunStart { target: Some(target), start_index, settings, ..RunStart::default() };
        let first = RunRequest { message: Some(Request::Start(start)) };
        let gone = |_| Status::internal("the request was closed");
        requests.send(first).await.map_err(gone)?;
        let mut runs = client.runs();
        let mut responses = runs.run(ReceiverStream::new(messages)).await?.into_inner();
        match responses.message().await?.and_then(|response| response.message) {
            Some(Message::Started(started)) => Ok((Self { requests, responses }, started)),
            _ => Err(Status::internal("a run did not begin with its start")),
        }
    }
}

fn broken(what: &str) -> CliError {
    CliError::trouble(format!("the service broke its contract: {what}"))
}

impl Drive {
    /// Begins a run of a job; the machine is made for its interpolation period, µs.
    pub(in crate::commands) async fn begin(
        client: &Client,
        job: &str,
        settings: RunSettings,
        limits_mm: Option<[f64; 2]>,
        machine: impl FnOnce(u32) -> Result<Simulator, CliError>,
    ) -> Result<Self, CliError> {
        let connected = Open::connect(client, Target::Job(job.to_owned()), 0, Some(settings)).await;
        let (open, started) = connected.map_err(|status| client.failed(&status))?;
        let state = started.state();
        let RunStarted { run: name, header, .. } = started;
        let header = header.ok_or_else(|| broken("a run began without header"))?;
        let subtitle = format!("{job} \u{b7} {name}");
        let trace = RunTrace::new(subtitle, limits_mm);
        Ok(Self {
            client: client.clone(),
            machine: machine(header.period_us as u32)?,
            open,
            name,
            decoder: Decoder::new(&header),
            period_us: header.period_us,
            state,
            waiting: VecDeque::new(),
            taken: 0,
            credit: 0,
            decided: 0,
            log: 0,
            summary: Summary::default(),
            trace,
            feed_held: false,
            at_rest: true,
        })
    }

    /// Takes the run up again, as after a connection that broke: what is not durable is sent again, and what was
    /// decided unheard is read from the log. The number of the newest durable batch.
    pub(in crate::commands) async fn take_up(&mut self, on: OnDecision<'_>) -> Result<Option<u64>, CliError> {
        let mut retries = 0;
        let started = loop {
            match Open::connect(&self.client, Target::Run(self.name.clone()), self.taken, None).await {
                Ok((open, started)) => {
                    self.open = open;
                    break started;
                }
                Err(status) if is_passing(&status) && retries < MAX_RETRIES => {
                    retries += 1;
                    pause(retries).await;
                }
                Err(status) => return Err(self.failed(&status)),
            }
        };
        if !self.summary.begins(&started.feed_changes) {
            return Err(broken("a run was resumed without the changes of the feed that it had reported"));
        }
        self.acknowledge(started.durable_batch, started.state());
        self.feed_held = started.feed_held;
        for change in started.feed_changes.iter().skip(self.summary.changes()) {
            self.summary.changed(*change);
        }
        loop {
            let page = decisions::page(&self.client, &self.name, self.log).await?;
            for decision in &page.decisions {
                self.decide(decision, on)?;
            }
            if page.decisions.is_empty() {
                break;
            }
        }
        for batch in self.waiting.clone() {
            self.say(Request::Batch(batch)).await;
        }
        self.say(Request::Credit(RunCredit { end_index: self.credit })).await;
        Ok(started.durable_batch)
    }

    fn failed(&self, status: &Status) -> CliError {
        CliError::trouble(format!("{}: {}: {}", self.client.url, self.name, status.message()))
    }

    /// Sends a message. A closed stream is reported by the next answer.
    async fn say(&self, message: Request) {
        let _ = self.open.requests.send(RunRequest { message: Some(message) }).await;
    }

    async fn send(&mut self, batches: Vec<TelemetryBatch>) {
        for batch in batches {
            self.waiting.push_back(batch.clone());
            self.say(Request::Batch(batch)).await;
        }
    }

    fn acknowledge(&mut self, durable: Option<u64>, state: MonitorState) {
        while self.waiting.front().is_some_and(|batch| Some(batch.sequence) <= durable) {
            self.waiting.pop_front();
        }
        self.state = state;
    }

    /// Idles until the monitoring waits for contact: baseline, then the steps of the run-up.
    pub(in crate::commands) async fn idle(
        &mut self,
        baseline_rev_per_min: f64,
        run_up_rev_per_min: &[f64],
        on: OnDecision<'_>,
    ) -> Result<(), CliError> {
        let mut slices = 0_usize;
        while self.summary.end.is_none() {
            let rev_per_min = match self.state {
                MonitorState::Baseline => baseline_rev_per_min,
                // Speeds in turn: each step collects what belongs to it.
                MonitorState::IdleRunUp => {
                    run_up_rev_per_min.get(slices % run_up_rev_per_min.len().max(1)).copied().unwrap_or_default()
                }
                _ => return Ok(()),
            };
            if slices as f64 * STRETCH_S >= MAX_IDLE_S {
                let state = self.state.as_str_name();
                return Err(CliError::trouble(format!(
                    "{}: still {state} after {MAX_IDLE_S} s of idling at {rev_per_min} rev/min: raise --idle-rev-per-min or shorten the \
                     baseline of the job's monitoring",
                    self.name
                )));
            }
            let mut batches = Vec::new();
            let mut sink = |batch: &Batch<'_>| batches.push(batch_to_proto(batch));
            self.machine.idle(STRETCH_S, rev_per_min, &mut sink).map_err(|error| unable(&error))?;
            self.machine.flush(&mut sink);
            self.send(batches).await;
            while self.summary.end.is_none() && !self.waiting.is_empty() {
                self.answer(on).await?;
            }
            slices += 1;
        }
        Ok(())
    }

    /// Follows the setpoints until so many were taken, or to their end.
    pub(in crate::commands) async fn follow(&mut self, until: u64, on: OnDecision<'_>) -> Result<(), CliError> {
        let stretch = (STRETCH_S * 1e6 / self.period_us).clamp(1.0, MAX_STRETCH) as u64;
        while self.summary.end.is_none() && self.taken < until {
            if self.feed_held && self.at_rest && self.waiting.is_empty() {
                self.resume(on).await?;
                continue;
            }
            if self.taken == self.credit && self.waiting.is_empty() {
                self.credit += stretch;
                self.say(Request::Credit(RunCredit { end_index: self.credit })).await;
            }
            self.answer(on).await?;
        }
        Ok(())
    }

    /// Acts on the next message of the service.
    async fn answer(&mut self, on: OnDecision<'_>) -> Result<(), CliError> {
        let response = match self.open.responses.message().await {
            Ok(response) => response,
            Err(status) if is_passing(&status) => {
                tell(&format!("{}: {}; taking the run up again\n", self.client.url, status.message()));
                return self.take_up(on).await.map(drop);
            }
            Err(status) => return Err(self.failed(&status)),
        };
        match response.and_then(|response| response.message) {
            Some(Message::Chunk(chunk)) => {
                let block = self.decoder.block(&chunk).map_err(|what| broken(&what))?;
                if block.first_index != self.taken {
                    return Err(broken("setpoints are missing between two chunks"));
                }
                let batches = self.go(&block)?;
                self.send(batches).await;
                self.taken += block.len() as u64;
                self.say(Request::Receipt(RunReceipt { received: self.taken })).await;
            }
            Some(Message::Decision(decision)) => self.decide(&decision, on)?,
            Some(Message::Ack(ack)) => self.acknowledge(Some(ack.durable_batch), ack.state()),
            Some(Message::FeedChange(change)) => self.summary.changed(change),
            Some(Message::Ended(ended)) => self.summary.end = Some(ended),
            // Another condition was raised in between: it has to be acknowledged, too.
            Some(Message::CommandRefused(_)) => self.feed_held = true,
            Some(Message::SpindleRequest(request)) => self.turn(request).await?,
            Some(Message::Started(_)) => return Err(broken("a run began twice")),
            None => return Err(broken("a run ended without saying so")),
        }
        Ok(())
    }

    /// Turns at the speed that is requested between two sections, and says so.
    async fn turn(&mut self, request: RunSpindleRequest) -> Result<(), CliError> {
        let mut batches = Vec::new();
        let mut sink = |batch: &Batch<'_>| batches.push(batch_to_proto(batch));
        let rev_per_min = request.rev_per_min;
        self.machine.idle(STRETCH_S, rev_per_min.unwrap_or_default(), &mut sink).map_err(|error| unable(&error))?;
        self.machine.flush(&mut sink);
        let answer = SpindleAnswer {
            decision_number: request.decision_number,
            kind: SpindleAnswerKind::Reached.into(),
            reached_ns: Some(self.machine.clock_ns()),
            rev_per_min,
            note: String::new(),
        };
        if let Some(last) = batches.last_mut() {
            last.events.push(MachineEvent { event: Some(Event::SpindleAnswer(answer)) });
        }
        self.send(batches).await;
        Ok(())
    }

    /// Waits at rest until the held feed is acknowledged, then resumes.
    async fn resume(&mut self, on: OnDecision<'_>) -> Result<(), CliError> {
        tell(&format!("{0}: the feed is held; acknowledge it: feedwave acknowledge {0} --by NAME\n", self.name));
        let mut telemetry = self.client.telemetry();
        loop {
            let request = GetRunRequest { name: self.name.clone() };
            let answer = match telemetry.get_run(request).await {
                Ok(answer) => answer.into_inner(),
                // The service has gone, and the run's connection with it.
                Err(status) if is_passing(&status) => return self.take_up(on).await.map(drop),
                Err(status) => return Err(self.failed(&status)),
            };
            if answer.run.is_some_and(|run| run.open_conditions == 0) {
                break;
            }
            tokio::time::sleep(ASK_EVERY).await;
        }
        self.say(Request::Command(RunCommand { kind: RunCommandKind::Resume.into() })).await;
        self.feed_held = false;
        Ok(())
    }

    fn decide(&mut self, decision: &Decision, on: OnDecision<'_>) -> Result<(), CliError> {
        self.log = self.log.max(decision.sequence);
        if decision.number < self.decided {
            return Ok(());
        }
        self.decided = decision.number + 1;
        on(decision)?;
        self.feed_held |= decision.outcome.is_some_and(|outcome| outcome.action() == DecisionAction::HoldFeed);
        if let Some(after) = decision.outcome.and_then(|outcome| outcome.after) {
            // A planned speed is part of the setpoints.
            let plan = decision.inputs.as_ref().and_then(|inputs| inputs.spindle_plan.as_ref());
            if plan.is_none_or(|plan| !plan.planned) {
                self.machine.set_spindle_override(after.spindle).map_err(|error| unable(&error))?;
            }
            let time_s = decision.sensor_time_ns as f64 * 1e-9;
            self.trace.decide(time_s, after.feed);
            let evidence = decision.inputs.as_ref().and_then(|inputs| inputs.evidence.as_ref());
            if let Some(Evidence::Process(process)) = evidence {
                self.trace.measure(time_s, process.max_deviation);
            }
        }
        self.summary.decided(decision);
        Ok(())
    }

    /// Moves the machine along setpoints; what its sensors said.
    fn go(&mut self, block: &SetpointBlock) -> Result<Vec<TelemetryBatch>, CliError> {
        let mut batches = Vec::new();
        let mut sink = |batch: &Batch<'_>| batches.push(batch_to_proto(batch));
        let setpoints = Setpoints {
            first_index: block.first_index,
            axes_mm: self.decoder.xy().map(|[x, y]| [&block.axes[x][..], &block.axes[y][..]]),
            path_position_mm: &block.path_position_mm,
            feed_mm_per_min: &block.feed_mm_per_min,
            spindle_angle_deg: &block.spindle_angle_deg,
            line: &block.line,
        };
        self.at_rest = block.feed_mm_per_min.last() == Some(&0.0);
        self.machine.push(&setpoints, &mut sink).map_err(|error| unable(&error))?;
        let time_s = self.machine.clock_ns() as f64 * 1e-9;
        self.trace.deflect(time_s, self.machine.take_peak_deflection_mm());
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
        velocity: pair(batch.velocity_mm_per_s),
        spindle_angle_deg: batch.spindle_angle_deg.unwrap_or_default().to_vec(),
        spindle_rev_per_min: batch.spindle_rev_per_min.unwrap_or_default().to_vec(),
        contact: batch.contact.unwrap_or_default().to_vec(),
        line: batch.line.unwrap_or_default().to_vec(),
    }
}
