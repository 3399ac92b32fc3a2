//! A live run through `kill -9`: no acknowledged batch, no decision and no setpoint that was heard of is lost or changes.

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
    MonitoringConfig, OverrideBounds, ReplayRunRequest, RunCredit, RunFeedChange, RunReceipt, RunRequest, RunStart,
    RunState, SensorQuantity, Sensors, SetMonitoringRequest, StreamSetpointsRequest, TelemetryBatch, ToolCheck,
    WindowLength,
};
use feedwave_tests::{Chance, Home, Server, stream};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

use crate::FEEDWAVE;

/// 13 s of turning.
pub(crate) const PART: &str =
    "G21 G94 G97 S1000 M3\nG0 X30. Z2.\nG1 Z-20. F200\nX40. Z-25.\nG4 P200\nG1 Z-40. F250\nM30\n";
/// How often the service is killed.
const KILLS: u64 = 6;

pub(crate) fn config() -> MonitoringConfig {
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
pub(crate) fn batch(sequence: u64) -> TelemetryBatch {
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

/// What the client knows of its run, whatever became of the service.
#[derive(Default)]
pub(crate) struct Known {
    run: String,
    durable_batch: Option<u64>,
    decisions: BTreeMap<u64, Decision>,
    changes: Vec<RunFeedChange>,
    /// Values of the columns, setpoint by setpoint.
    setpoints: Vec<Vec<u64>>,
}

/// Runs until the service dies, which it does after `messages` messages, or to the end of the run; whether that was it.
pub(crate) async fn drive(server: &Server, job: &str, known: &mut Known, messages: u64) -> bool {
    let mut client = RunsClient::new(server.connect().await.channel);
    let (requests, outgoing) = mpsc::channel(1_024);
    let say = async |message| requests.send(RunRequest { message: Some(message) }).await.is_ok();
    let target = if known.run.is_empty() { Target::Job(job.to_owned()) } else { Target::Run(known.run.clone()) };
    let start_index = known.setpoints.len() as u64;
    say(Request::Start(RunStart { target: Some(target), start_index, ..Default::default() })).await;
    let mut responses = client.run(ReceiverStream::new(outgoing)).await.expect("the run is taken up").into_inner();
    let mut next_batch = 0;
    let mut left = messages;
    while left > 0 {
        let Ok(Some(response)) = responses.message().await else { panic!("the service ended by itself") };
        left -= 1;
        match response.message.expect("a message") {
            Message::Started(started) => {
                assert!(known.durable_batch <= started.durable_batch, "acknowledged batches are durable");
                assert_eq!(started.feed_changes[..known.changes.len()], known.changes, "so are changes");
                known.changes = started.feed_changes;
                known.run = started.run;
                next_batch = started.durable_batch.map_or(0, |durable| durable + 1);
            }
            Message::Chunk(chunk) => {
                assert_eq!(chunk.first_index, known.setpoints.len() as u64);
                for row in 0..chunk.count as usize {
                    known.setpoints.push(chunk.columns.iter().map(|column| column.values[row].to_bits()).collect());
                }
                say(Request::Receipt(RunReceipt { received: known.setpoints.len() as u64 })).await;
            }
            Message::Decision(decision) => {
                assert!(known.decisions.insert(decision.number, decision).is_none(), "a decision is sent once");
            }
            Message::Ack(ack) => known.durable_batch = Some(ack.durable_batch),
            Message::FeedChange(change) => known.changes.push(change),
            Message::CommandRefused(refused) => panic!("nothing was commanded: {refused:?}"),
            Message::Ended(ended) => {
                assert_eq!((ended.state(), ended.setpoint_count), (RunState::Finished, known.setpoints.len() as u64));
                return true;
            }
        }
        // A batch and some credit for every message, so that both sides are always busy.
        say(Request::Batch(batch(next_batch))).await;
        next_batch += 1;
        say(Request::Credit(RunCredit { end_index: known.setpoints.len() as u64 + 200 })).await;
    }
    false
}

#[tokio::test]
async fn a_live_run_survives_kills_at_any_moment() {
    let mut chance = Chance::new();
    let seed = chance.seed();
    let mut server = Home::new(FEEDWAVE, "").start().await;
    let job = server.connect().await.submit(PART).await.job.name;
    let mut telemetry = TelemetryClient::new(server.connect().await.channel);
    let request = SetMonitoringRequest { job: job.clone(), config: Some(config()) };
    telemetry.set_monitoring(request).await.expect("the configuration is valid");

    let mut known = Known::default();
    let mut kills = 0;
    loop {
        let messages = if kills < KILLS { chance.up_to(60) } else { u64::MAX };
        if drive(&server, &job, &mut known, messages).await {
            break;
        }
        server = server.kill().await.start().await;
        kills += 1;
    }
    assert_eq!(kills, KILLS, "seed {seed}");
    prove(&server, job, known, seed).await;
}

/// Proves that what the client heard of is what the log has, and what a stream of the whole job and a replay give.
pub(crate) async fn prove(server: &Server, job: String, known: Known, seed: u64) {
    // The log has every decision that was heard of, and each once.
    let mut clients = server.connect().await;
    let mut telemetry = TelemetryClient::new(clients.channel.clone());
    let request = ListDecisionsRequest { run: known.run.clone(), page_size: 500, ..Default::default() };
    let listed = telemetry.list_decisions(request).await.expect("the decisions are listed").into_inner().decisions;
    for (number, decision) in (0..).zip(&listed) {
        assert_eq!(decision.number, number, "seed {seed}");
    }
    for (number, decision) in &known.decisions {
        assert_eq!(&listed[usize::try_from(*number).expect("a small number")], decision, "seed {seed}");
    }
    assert!(listed.len() > 3, "seed {seed}: {} decisions", listed.len());

    // What was received in pieces is one plan under the changes of the log.
    let overrides = known.changes.iter().map(|change| FeedOverrideChange {
        at: Some(At::SetpointIndex(change.setpoint_index)),
        ratio: Some(change.ratio),
    });
    let request = StreamSetpointsRequest { job, overrides: overrides.collect(), ..Default::default() };
    let whole = stream(&mut clients, request).await.expect("the whole stream");
    for (index, column) in whole.bits_from(0).iter().enumerate() {
        assert!(column.iter().eq(known.setpoints.iter().map(|row| &row[index])), "column {index}, seed {seed}");
    }
    assert_eq!(whole.len(), known.setpoints.len());
    let request = ReplayRunRequest { run: known.run, start_index: 0 };
    let replayed = RunsClient::new(clients.channel).replay_run(request).await.expect("a replay").into_inner();
    assert!(replayed.identical, "seed {seed}: {replayed:?}");
    assert_eq!((replayed.setpoint_count, replayed.decision_count), (known.setpoints.len() as u64, listed.len() as u64));
}
