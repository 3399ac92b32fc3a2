//! A client of live runs that keeps a ledger of what it heard, through breaks of the connection, and proves it afterwards.

use std::collections::BTreeMap;

use feedwave_contract::proto::feed_override_change::At;
use feedwave_contract::proto::grouping::By;
use feedwave_contract::proto::run_request::Message as Request;
use feedwave_contract::proto::run_response::Message;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::runs_client::RunsClient;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::window_length::Length;
use feedwave_contract::proto::{
    ChannelPair, DataQuality, Decision, DecisionRules, FeedOverrideChange, FeedRule, Grouping, ListDecisionsRequest,
    MonitoringConfig, OverrideBounds, ReplayRunRequest, RunCredit, RunFeedChange, RunReceipt, RunRequest, RunResponse,
    RunStart, RunState, SensorQuantity, Sensors, StreamSetpointsRequest, TelemetryBatch, ToolCheck, WindowLength,
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Code, Status};

use crate::{Clients, stream};

/// 13 s of turning.
pub const LIVE_PART: &str =
    "G21 G94 G97 S1000 M3\nG0 X30. Z2.\nG1 Z-20. F200\nX40. Z-25.\nG4 P200\nG1 Z-40. F250\nM30\n";

/// How its telemetry is judged.
#[must_use]
pub fn live_config() -> MonitoringConfig {
    let seconds = |seconds| Some(WindowLength { length: Some(Length::DurationS(seconds)) });
    MonitoringConfig {
        sample_rate_hz: Some(1_000.0),
        tool: Some(Sensors { quantity: SensorQuantity::Displacement.into(), max: 10.0, ..Default::default() }),
        grouping: Some(Grouping { by: Some(By::SamplesPerPoint(10)) }),
        baseline: seconds(0.1),
        window: seconds(0.1),
        tool_check: Some(ToolCheck { max_ratio: None, max_run_out: Some(0.5) }),
        settling_s: Some(0.0),
        quality: Some(DataQuality {
            min_valid_samples: Some(50),
            stuck_samples: Some(20),
            // The telemetry of this test goes on where it stood, however long the service was away.
            silence_s: Some(3_000.0),
            stale_s: Some(3_000.0),
            ..Default::default()
        }),
        rules: Some(DecisionRules {
            feed: Some(FeedRule { lower: 0.003, upper: 0.01, step: Some(0.5) }),
            feed_bounds: Some(OverrideBounds { lower: 0.125, upper: 1.5 }),
            ..Default::default()
        }),
        ..Default::default()
    }
}

/// Ten samples of a machine that idles for ten batches and then deflects too far, or too little, in turns.
#[must_use]
pub fn live_batch(sequence: u64) -> TelemetryBatch {
    let samples = sequence * 10..(sequence + 1) * 10;
    let cutting = sequence >= 10;
    let deflection = if (sequence / 50).is_multiple_of(2) { 0.02 } else { 0.001 };
    // No two values alike: a sensor that repeats itself is stuck.
    let value = |sample: u64| 1.0 + 1e-6 * (sample % 97) as f64 + if cutting { deflection } else { 0.0 };
    TelemetryBatch {
        sequence,
        time_ns: samples.clone().map(|sample| 1_000_000_000 + sample * 1_000_000).collect(),
        tool: Some(ChannelPair {
            x: samples.clone().map(value).collect(),
            y: samples.clone().map(|sample| 2.0 + 1e-6 * (sample % 89) as f64).collect(),
        }),
        contact: samples.map(|_| cutting).collect(),
        ..Default::default()
    }
}

/// What a client knows of its run, whatever became of the service.
#[derive(Debug, Default)]
pub struct RunLedger {
    run: String,
    durable_batch: Option<u64>,
    decisions: BTreeMap<u64, Decision>,
    changes: Vec<RunFeedChange>,
    /// Values of the columns, setpoint by setpoint.
    setpoints: Vec<Vec<u64>>,
}

/// How a client left off.
#[derive(Debug)]
pub enum Left {
    /// The run has ended.
    Ended,
    /// It has had as many messages as it wanted.
    Enough,
    /// The connection, or the service behind it, broke.
    Broken(Option<Status>),
}

impl RunLedger {
    /// Name of the run; empty before it is known.
    #[must_use]
    pub fn run(&self) -> &str {
        &self.run
    }

    /// Begins the run of a job or takes it up, and runs for `messages` messages, or to its end, or until something breaks.
    ///
    /// # Panics
    /// Where what the service says is not what it said before, or the run is lost.
    pub async fn drive(&mut self, channel: Channel, job: &str, messages: u64) -> Left {
        self.drive_while(channel, job, |count| count < messages).await
    }

    /// As [`RunLedger::drive`], as long as it is to go on after so many messages.
    ///
    /// # Panics
    /// As [`RunLedger::drive`].
    pub async fn drive_while(&mut self, channel: Channel, job: &str, go_on: impl FnMut(u64) -> bool) -> Left {
        match self.try_drive(channel, job, go_on).await {
            Ok(left) => left,
            Err(status) => {
                assert_ne!(status.code(), Code::DataLoss, "{status:?}");
                Left::Broken(Some(status))
            }
        }
    }

    async fn try_drive(
        &mut self,
        channel: Channel,
        job: &str,
        mut go_on: impl FnMut(u64) -> bool,
    ) -> Result<Left, Status> {
        let mut client = RunsClient::new(channel);
        let (requests, outgoing) = mpsc::channel(1_024);
        let say = async |message| requests.send(RunRequest { message: Some(message) }).await.is_ok();
        let target = if self.run.is_empty() { Target::Job(job.to_owned()) } else { Target::Run(self.run.clone()) };
        let start_index = self.setpoints.len() as u64;
        say(Request::Start(RunStart { target: Some(target), start_index, ..Default::default() })).await;
        let mut responses = client.run(ReceiverStream::new(outgoing)).await?.into_inner();
        let mut next_batch = 0;
        let mut count = 0;
        while go_on(count) {
            count += 1;
            let Some(response) = responses.message().await? else { return Ok(Left::Broken(None)) };
            if let Some(Message::Started(started)) = &response.message {
                next_batch = started.durable_batch.map_or(0, |durable| durable + 1);
            }
            let received_before = self.setpoints.len() as u64;
            if self.note(response) {
                return Ok(Left::Ended);
            }
            let received = self.setpoints.len() as u64;
            if received > received_before {
                say(Request::Receipt(RunReceipt { received })).await;
            }
            // A batch and some credit for every message, so that both sides are always busy.
            say(Request::Batch(live_batch(next_batch))).await;
            next_batch += 1;
            say(Request::Credit(RunCredit { end_index: received + 200 })).await;
        }
        Ok(Left::Enough)
    }

    /// Notes what was said; whether it was that the run has ended.
    fn note(&mut self, response: RunResponse) -> bool {
        match response.message.expect("a message") {
            Message::Started(started) => {
                assert!(self.durable_batch <= started.durable_batch, "acknowledged batches are durable");
                assert_eq!(started.feed_changes[..self.changes.len()], self.changes, "so are changes");
                self.changes = started.feed_changes;
                self.run = started.run;
            }
            Message::Chunk(chunk) => {
                assert_eq!(chunk.first_index, self.setpoints.len() as u64);
                let row = |row: usize| chunk.columns.iter().map(|column| column.values[row].to_bits()).collect();
                self.setpoints.extend((0..chunk.count as usize).map(row));
            }
            Message::Decision(decision) => {
                assert!(self.decisions.insert(decision.number, decision).is_none(), "a decision is sent once");
            }
            Message::Ack(ack) => self.durable_batch = Some(ack.durable_batch),
            Message::FeedChange(change) => self.changes.push(change),
            Message::CommandRefused(refused) => panic!("nothing was commanded: {refused:?}"),
            Message::SpindleRequest(request) => panic!("no spindle speed was decided: {request:?}"),
            Message::Ended(ended) => {
                let finished = (RunState::Finished, self.setpoints.len() as u64);
                assert_eq!((ended.state(), ended.setpoint_count), finished);
                return true;
            }
        }
        false
    }

    /// Proves that what the client heard of is what the log has, and what a stream of the whole job and a replay give.
    ///
    /// # Panics
    /// Where it is not.
    pub async fn prove(self, mut clients: Clients, job: String, seed: u64) {
        // The log has every decision that was heard of, and each once.
        let mut telemetry = TelemetryClient::new(clients.channel.clone());
        let request = ListDecisionsRequest { run: self.run.clone(), page_size: 500, ..Default::default() };
        let listed = telemetry.list_decisions(request).await.expect("the decisions are listed").into_inner().decisions;
        for (number, decision) in (0..).zip(&listed) {
            assert_eq!(decision.number, number, "seed {seed}");
        }
        for (number, decision) in &self.decisions {
            assert_eq!(&listed[usize::try_from(*number).expect("a small number")], decision, "seed {seed}");
        }
        assert!(listed.len() > 3, "seed {seed}: {} decisions", listed.len());

        // What was received in pieces is one plan under the changes of the log.
        let overrides = self.changes.iter().map(|change| FeedOverrideChange {
            at: Some(At::SetpointIndex(change.setpoint_index)),
            ratio: Some(change.ratio),
        });
        let request = StreamSetpointsRequest { job, overrides: overrides.collect(), ..Default::default() };
        let whole = stream(&mut clients, request).await.expect("the whole stream");
        for (index, column) in whole.bits_from(0).iter().enumerate() {
            assert!(column.iter().eq(self.setpoints.iter().map(|row| &row[index])), "column {index}, seed {seed}");
        }
        assert_eq!(whole.len(), self.setpoints.len());
        let request = ReplayRunRequest { run: self.run, start_index: 0 };
        let replayed = RunsClient::new(clients.channel).replay_run(request).await.expect("a replay").into_inner();
        assert!(replayed.identical, "seed {seed}: {replayed:?}");
        assert_eq!(
            (replayed.setpoint_count, replayed.decision_count),
            (self.setpoints.len() as u64, listed.len() as u64)
        );
    }
}
