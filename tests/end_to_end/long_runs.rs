//! A live run of many setpoints goes on from its own checkpoints, however far it has come, and is proved from the middle.

use feedwave_contract::proto::feed_override_change::At;
use feedwave_contract::proto::runs_client::RunsClient;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    FeedOverrideChange, ReplayRunRequest, ReplayRunResponse, RunCommandKind, RunFeedChange, RunSettings, RunState,
    SetMonitoringRequest, StreamSetpointsRequest,
};
use feedwave_tests::{Home, LiveClient, Server, patiently, stream};
use tonic::Code;
use tonic_types::StatusExt as _;

use crate::FEEDWAVE;
use crate::live_runs::{PART, config};

/// Setpoints between two checkpoints of a run.
const INTERVAL: u64 = 1 << 17;
/// 13 s of turning are twice as many setpoints as a checkpoint is behind another.
const SETTINGS: RunSettings = RunSettings {
    interpolation_period_us: 50,
    generation_mode: 0,
    frame: 0,
    monitoring: None,
    plans_spindle: false,
    recording: None,
};

/// A job whose telemetry may be judged.
async fn monitored_job(server: &Server) -> String {
    let mut clients = server.connect().await;
    let job = clients.submit(PART).await.job.name;
    let request = SetMonitoringRequest { job: job.clone(), config: Some(config()) };
    let mut telemetry = TelemetryClient::new(clients.channel);
    telemetry.set_monitoring(request).await.expect("the configuration is valid");
    job
}

/// Setpoints that the service has generated in vain since it was started.
async fn regenerated(server: &Server) -> u64 {
    let answer = server.web().get("/metrics").await;
    let line = answer.text().lines().find_map(|line| line.strip_prefix("feedwave_setpoints_regenerated_total "));
    line.expect("the figure is shown").parse().expect("a number")
}

async fn replay(server: &Server, run: &str, start_index: u64) -> ReplayRunResponse {
    let request = ReplayRunRequest { run: run.to_owned(), start_index };
    RunsClient::new(server.connect().await.channel).replay_run(request).await.expect("a replay").into_inner()
}

/// The setpoints that a stream of the job gives under these changes.
async fn streamed(server: &Server, job: &str, changes: &[RunFeedChange]) -> Vec<Vec<u64>> {
    let overrides = changes.iter().map(|change| FeedOverrideChange {
        at: Some(At::SetpointIndex(change.setpoint_index)),
        ratio: Some(change.ratio),
    });
    let request = StreamSetpointsRequest {
        job: job.to_owned(),
        interpolation_period_us: SETTINGS.interpolation_period_us,
        overrides: overrides.collect(),
        ..StreamSetpointsRequest::default()
    };
    let mut clients = server.connect().await;
    stream(&mut clients, request).await.expect("the whole stream").bits_from(0)
}

#[tokio::test]
async fn a_long_run_goes_on_from_its_checkpoint_after_a_kill() {
    let mut server = Server::start(FEEDWAVE).await;
    let job = monitored_job(&server).await;
    let mut run = LiveClient::begin(server.connect().await.channel, &job, SETTINGS).await.expect("it begins");
    let name = run.started.run.clone();
    // Changes before and behind the checkpoint: a rest on the path over it, too.
    let mut index = 20_000;
    for rest in [2_000, 500, INTERVAL, 700] {
        run.reach(index).await.expect("setpoints");
        run.command(RunCommandKind::Hold).await.expect("a hold");
        run.reach(index + rest).await.expect("a rest");
        run.command(RunCommandKind::Resume).await.expect("a resume");
        index += rest + 10_000;
    }
    run.reach(index).await.expect("setpoints");
    let mut setpoints = std::mem::take(&mut run.setpoints);
    // The checkpoint is durable once a replay can begin there.
    patiently(async { while replay(&server, &name, INTERVAL + 64).await.first_index < INTERVAL {} }).await;

    // Work, not time: what was generated again is what is behind the last checkpoint.
    for more in [2_000, 3_000] {
        server = server.kill().await.start().await;
        assert_eq!(regenerated(&server).await, 0);
        run = LiveClient::take_up(server.connect().await.channel, &name, index).await.expect("it is taken up");
        run.reach(index + more).await.expect("setpoints");
        let again = regenerated(&server).await;
        let behind = index % INTERVAL;
        assert!(again <= behind && again + 64 >= behind, "{again} of {index}, {behind} behind the checkpoint");
        run.command(RunCommandKind::Hold).await.expect("a hold");
        run.reach(index + more + 400).await.expect("a rest");
        run.command(RunCommandKind::Resume).await.expect("a resume");
        run.reach(index + more + 500).await.expect("setpoints");
        setpoints.append(&mut run.setpoints);
        index += more + 500;
    }
    let ended = run.finish().await.expect("its end");
    setpoints.append(&mut run.setpoints);
    assert_eq!((ended.state(), ended.setpoint_count), (RunState::Finished, setpoints.len() as u64));

    let whole = streamed(&server, &job, &run.changes).await;
    for (number, column) in whole.iter().enumerate() {
        assert!(column.iter().eq(setpoints.iter().map(|row| &row[number])), "column {number}");
    }
    // The proof, of the whole and of the end alone.
    let proof = replay(&server, &name, 0).await;
    assert!(proof.identical && proof.digest == ended.digest, "{proof:?}");
    assert_eq!((proof.first_index, proof.setpoint_count), (0, ended.setpoint_count));
    let proof = replay(&server, &name, 2 * INTERVAL + 1_000).await;
    assert!(proof.identical && proof.digest == ended.digest, "{proof:?}");
    assert!((2 * INTERVAL..2 * INTERVAL + 64).contains(&proof.first_index), "{proof:?}");
    assert_eq!(proof.first_index + proof.setpoint_count, ended.setpoint_count);
    let beyond = ReplayRunRequest { run: name, start_index: ended.setpoint_count + 1 };
    let refused = RunsClient::new(server.connect().await.channel).replay_run(beyond).await.unwrap_err();
    assert_eq!(refused.code(), Code::OutOfRange);
}

#[tokio::test]
async fn a_stream_under_changes_goes_on_from_the_checkpoint_before_the_first() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let program = format!("G21 G94 G97 S1000 M3\nG0 X30. Z2.\nG4 P{}\nG1 Z-20. F200\nX40. Z-25.\nM30\n", 280_000);
    let job = clients.submit(&program).await.job.name;
    let change = |index, ratio| FeedOverrideChange { at: Some(At::SetpointIndex(index)), ratio: Some(ratio) };
    let request = |start_index| StreamSetpointsRequest {
        job: job.clone(),
        start: Some(feedwave_contract::proto::stream_setpoints_request::Start::StartIndex(start_index)),
        overrides: vec![change(281_000, 0.5), change(282_000, 0.0), change(282_500, 1.25)],
        ..StreamSetpointsRequest::default()
    };
    let whole = stream(&mut clients, request(0)).await.expect("a stream").bits_from(283_000);
    assert_eq!(regenerated(&server).await, 0);
    let rest = stream(&mut clients, request(283_000)).await.expect("a stream");
    assert!(rest.bits_from(283_000) == whole && rest.len() > 1_000);
    let again = regenerated(&server).await;
    assert!(again > 0 && again < 283_000 - 2 * INTERVAL, "{again}");
}

#[tokio::test]
async fn a_client_without_receipts_loses_its_stream_and_not_its_run() {
    let server = Home::new(FEEDWAVE, "[limits]\nreceipt_s = 1\n").start().await;
    let job = monitored_job(&server).await;
    let channel = server.connect().await.channel;
    let mut run = LiveClient::begin(channel.clone(), &job, RunSettings::default()).await.expect("it begins");
    run.credit(u64::MAX).await;
    // It takes everything there is, and says nothing of it.
    let refused = loop {
        match run.next().await {
            Ok(ended) => assert_eq!(ended, None, "without a receipt nobody knows"),
            Err(refused) => break refused,
        }
    };
    assert_eq!(refused.code(), Code::FailedPrecondition, "{refused:?}");
    let details = refused.get_error_details();
    assert_eq!(details.error_info().map(|info| info.reason.as_str()), Some("RECEIPTS_MISSING"));
    assert!(refused.message().contains("RunReceipt"), "{refused:?}");

    // Taking up at a setpoint is a receipt of those before.
    let name = run.started.run.clone();
    let mut again = LiveClient::take_up(channel, &name, run.next_index).await.expect("it is taken up");
    let ended = again.finish().await.expect("its end");
    // However much of it came before the stream ended.
    assert!(run.next_index > 0 && run.next_index <= again.next_index);
    assert_eq!((ended.state(), ended.setpoint_count), (RunState::Finished, again.next_index));
}
