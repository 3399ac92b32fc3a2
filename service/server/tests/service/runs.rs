//! Live runs: setpoints by credit, the feed that telemetry decides, and any setpoint again after a break.

use feedwave_contract::proto::feed_override_change::At;
use feedwave_contract::proto::run_request::Message as Request;
use feedwave_contract::proto::run_response::Message;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::runs_client::RunsClient;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    ColumnKind, DecisionAction, DecisionReason, Escalation, EscalationAction, FeedChangeCause, FeedOverrideChange,
    FeedRule, GetRunRequest, ListRunsRequest, MonitoringConfig, OverrideBounds, ReplayRunRequest, ReplayRunResponse,
    RunCommand, RunCommandKind, RunCommandRefused, RunCredit, RunEnded, RunFeedChange, RunReceipt, RunRequest,
    RunResponse, RunSettings, RunStart, RunStarted, RunState, SetMonitoringRequest, SetpointChunk,
    StreamSetpointsRequest, TelemetryBatch, ToolCheck,
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Code, Status, Streaming};

use crate::support::{TURNING, TestServer, column, patiently, stream_of, told};
use crate::telemetry::{self, batch, monitored_job};

/// 6.7 s of turning with a corner and a dwell.
const PART: &str = "G21 G94 G97 S1000 M3\nG0 X30. Z2.\nG1 Z-20. F400\nX40. Z-25.\nG4 P200\nG1 Z-40. F500\nM30\n";

struct LiveRun {
    requests: mpsc::Sender<RunRequest>,
    responses: Streaming<RunResponse>,
    started: RunStarted,
    chunks: Vec<SetpointChunk>,
    changes: Vec<RunFeedChange>,
    refused: Vec<RunCommandRefused>,
    durable_batch: Option<u64>,
    next_index: u64,
}

impl LiveRun {
    async fn open(client: &mut RunsClient<Channel>, start: RunStart) -> Result<Self, Status> {
        let (requests, messages) = mpsc::channel(64);
        let next_index = start.start_index;
        requests.send(RunRequest { message: Some(Request::Start(start)) }).await.unwrap();
        let mut responses = client.run(ReceiverStream::new(messages)).await?.into_inner();
        match responses.message().await?.and_then(|response| response.message) {
            Some(Message::Started(started)) => {
                let changes = started.feed_changes.clone();
                let (chunks, refused) = (Vec::new(), Vec::new());
                Ok(Self { requests, responses, started, chunks, changes, refused, durable_batch: None, next_index })
            }
            other => panic!("a run begins with its start, not with {other:?}"),
        }
    }

    async fn begin(client: &mut RunsClient<Channel>, job: &str) -> Self {
        let start = RunStart { target: Some(Target::Job(job.to_owned())), ..Default::default() };
        Self::open(client, start).await.unwrap()
    }

    async fn take_up(client: &mut RunsClient<Channel>, run: &str, start_index: u64) -> Self {
        let start = RunStart { target: Some(Target::Run(run.to_owned())), start_index, ..Default::default() };
        Self::open(client, start).await.unwrap()
    }

    async fn say(&self, message: Request) {
        // A run that has ended listens no more, and says so in its answers.
        let _ = self.requests.send(RunRequest { message: Some(message) }).await;
    }

    async fn credit(&self, end_index: u64) {
        self.say(Request::Credit(RunCredit { end_index })).await;
    }

    async fn command(&self, kind: RunCommandKind) {
        self.say(Request::Command(RunCommand { kind: kind.into() })).await;
    }

    async fn telemetry(&self, batch: TelemetryBatch) {
        self.say(Request::Batch(batch)).await;
    }

    /// Reads one message; the end, where it is that.
    async fn next(&mut self) -> Result<Option<RunEnded>, Status> {
        let response = patiently(self.responses.message()).await?;
        match response.and_then(|response| response.message).expect("a run does not end without saying so") {
            Message::Chunk(chunk) => {
                assert_eq!(chunk.first_index, self.next_index, "chunks follow each other");
                self.next_index += u64::from(chunk.count);
                self.chunks.push(chunk);
            }
            Message::FeedChange(change) => {
                assert!(change.setpoint_index >= self.next_index, "said before it acts: {change:?}");
                self.changes.push(change);
            }
            Message::Ack(ack) => self.durable_batch = Some(ack.durable_batch),
            Message::Decision(_) => {}
            Message::CommandRefused(refused) => self.refused.push(refused),
            Message::SpindleRequest(request) => panic!("no spindle speed was decided: {request:?}"),
            Message::Ended(ended) => return Ok(Some(ended)),
            Message::Started(started) => panic!("a second start {started:?}"),
        }
        Ok(None)
    }

    /// Reads until so many setpoints have come.
    async fn reach(&mut self, index: u64) {
        while self.next_index < index {
            assert_eq!(self.next().await.unwrap(), None);
        }
    }

    async fn change(&mut self) -> RunFeedChange {
        let before = self.changes.len();
        while self.changes.len() == before {
            assert_eq!(self.next().await.unwrap(), None);
        }
        self.changes[before]
    }

    async fn acknowledged(&mut self, sequence: u64) {
        while self.durable_batch < Some(sequence) {
            assert_eq!(self.next().await.unwrap(), None);
        }
    }

    /// Takes everything there is.
    async fn finish(&mut self) -> RunEnded {
        self.credit(u64::MAX).await;
        loop {
            let received = self.next_index;
            if let Some(ended) = self.next().await.unwrap() {
                return ended;
            }
            if self.next_index > received {
                self.say(Request::Receipt(RunReceipt { received: self.next_index })).await;
            }
        }
    }
}

/// All values of all columns of the chunks, as bits.
fn bits(chunks: &[SetpointChunk]) -> Vec<Vec<u64>> {
    let columns = chunks.first().map_or(0, |chunk| chunk.columns.len());
    (0..columns).map(|index| column(chunks, index).iter().map(|value| value.to_bits()).collect()).collect()
}

/// Monitoring with a step of a twentieth: most of its ratios are no percentage to the bit.
fn config() -> MonitoringConfig {
    let mut config = telemetry::config();
    let rules = config.rules.as_mut().unwrap();
    rules.feed = Some(FeedRule { lower: 0.003, upper: 0.01, step: Some(0.05) });
    config
}

/// The setpoints that a stream of the job gives under these changes.
async fn streamed(server: &TestServer, job: &str, changes: &[RunFeedChange]) -> Vec<Vec<u64>> {
    let overrides = changes.iter().map(|change| FeedOverrideChange {
        at: Some(At::SetpointIndex(change.setpoint_index)),
        ratio: Some(change.ratio),
    });
    let request = StreamSetpointsRequest { job: job.to_owned(), overrides: overrides.collect(), ..Default::default() };
    bits(&server.collect(request).await.1)
}

async fn replay(client: &mut RunsClient<Channel>, run: &str) -> ReplayRunResponse {
    client.replay_run(ReplayRunRequest { run: run.to_owned(), start_index: 0 }).await.unwrap().into_inner()
}

#[tokio::test]
async fn setpoints_come_as_far_as_the_credit_goes_and_are_those_of_the_job() {
    let server = TestServer::start().await;
    let (_, job) = monitored_job(&server, config(), TURNING).await;
    let mut client = RunsClient::new(server.channel.clone());
    let mut run = LiveRun::begin(&mut client, &job.name).await;
    run.credit(100).await;
    run.reach(100).await;
    // Nothing comes beyond the credit: what is asked for next is answered first.
    run.command(RunCommandKind::Hold).await;
    let change = run.change().await;
    assert_eq!((change.setpoint_index, change.ratio, run.next_index), (100, 0.0, 100));
    run.command(RunCommandKind::Resume).await;
    let change = run.change().await;
    assert_eq!((change.setpoint_index, change.ratio, change.cause()), (101, 1.0, FeedChangeCause::Resume));
    let ended = run.finish().await;
    assert_eq!((ended.state(), ended.setpoint_count), (RunState::Finished, run.next_index));

    let name = run.started.run.clone();
    assert_eq!(bits(&run.chunks), streamed(&server, &job.name, &run.changes).await);
    let replayed = replay(&mut client, &name).await;
    assert!(replayed.identical, "{replayed:?}");
    assert_eq!((replayed.setpoint_count, &replayed.digest), (ended.setpoint_count, &ended.digest));

    // A run that nothing changes is the job's own stream.
    let mut plain = LiveRun::begin(&mut client, &job.name).await;
    plain.finish().await;
    let stream = server.collect(stream_of(&job)).await.1;
    assert_eq!(bits(&plain.chunks), bits(&stream));
}

#[tokio::test]
async fn a_decision_slows_down_the_very_stream_it_came_on() {
    let server = TestServer::start().await;
    let (_, job) = monitored_job(&server, config(), PART).await;
    let mut client = RunsClient::new(server.channel.clone());
    let mut run = LiveRun::begin(&mut client, &job.name).await;
    let mut feed = 1.0;
    // Idle, then too large a deflection: each window takes a twentieth off, from the first setpoint not handed out.
    for sequence in 0..10 {
        run.telemetry(batch(sequence, 0.0)).await;
    }
    for window in 1..=10 {
        let handed_out = window * 150;
        run.credit(handed_out).await;
        run.reach(handed_out).await;
        for sequence in window * 10..window * 10 + 10 {
            run.telemetry(batch(sequence, 0.02)).await;
        }
        run.acknowledged(window * 10 + 9).await;
        let expected = if window == 1 { 0 } else { window - 1 };
        assert!(run.changes.len() as u64 >= expected, "{:?}", run.changes);
    }
    for change in &run.changes {
        feed *= 1.0 - 0.05;
        assert_eq!((change.ratio, change.cause()), (feed, FeedChangeCause::Decision));
        assert_eq!(change.setpoint_index % 150, 0, "the earliest that was not handed out: {change:?}");
    }
    assert!(run.changes.len() >= 9);
    let third = run.changes[2].ratio;
    assert_eq!(third, 0.857_374_999_999_999_9);
    run.finish().await;
    assert_eq!(bits(&run.chunks), streamed(&server, &job.name, &run.changes).await);
    let plain = server.collect(stream_of(&job)).await.1;
    assert!(run.next_index > plain.iter().map(|chunk| u64::from(chunk.count)).sum::<u64>(), "slower");
    let replayed = replay(&mut client, &run.started.run).await;
    assert!(replayed.identical && replayed.decision_count >= 10, "{replayed:?}");
}

#[tokio::test]
async fn a_run_that_breaks_anywhere_continues_with_the_same_bits() {
    let server = TestServer::start().await;
    let (_, job) = monitored_job(&server, config(), PART).await;
    let mut client = RunsClient::new(server.channel.clone());
    let mut run = LiveRun::begin(&mut client, &job.name).await;
    let name = run.started.run.clone();
    let mut chunks: Vec<SetpointChunk> = Vec::new();
    let mut sequence = 0;
    for (round, break_at) in [64, 500, 777, 1_600, 3_000].into_iter().enumerate() {
        run.credit(break_at + 200).await;
        for _ in 0..25 {
            run.telemetry(batch(sequence, 0.02)).await;
            sequence += 1;
        }
        run.acknowledged(sequence - 1).await;
        run.reach(break_at).await;
        if round == 2 {
            run.command(RunCommandKind::Hold).await;
            run.change().await;
        }
        chunks.append(&mut run.chunks);
        let (next_index, known) = (run.next_index, run.changes.clone());
        drop(run);
        run = LiveRun::take_up(&mut client, &name, next_index).await;
        assert_eq!(run.started.durable_batch, Some(sequence - 1));
        assert_eq!(run.started.held, round == 2);
        assert_eq!(run.changes[..known.len()], known, "what was said is in the log");
        if round == 2 {
            run.command(RunCommandKind::Resume).await;
            assert_eq!(run.change().await.cause(), FeedChangeCause::Resume);
        }
    }
    let ended = run.finish().await;
    chunks.append(&mut run.chunks);
    assert_eq!(bits(&chunks), streamed(&server, &job.name, &run.changes).await);
    let replayed = replay(&mut client, &name).await;
    assert!(replayed.identical, "{replayed:?}");
    assert_eq!(replayed.digest, ended.digest);
}

/// What was handed out and never arrived comes again as it was, and a change lies behind it.
#[tokio::test]
async fn a_change_after_a_break_leaves_what_was_handed_out_before_as_it_was() {
    let server = TestServer::start().await;
    let (_, job) = monitored_job(&server, config(), PART).await;
    let mut client = RunsClient::new(server.channel.clone());
    let mut run = LiveRun::begin(&mut client, &job.name).await;
    let name = run.started.run.clone();
    run.credit(400).await;
    run.reach(400).await;
    let mut chunks = std::mem::take(&mut run.chunks);
    assert_eq!(run.next_index, 400);
    run.credit(900).await;
    run.reach(900).await;
    drop(run);
    let mut run = LiveRun::take_up(&mut client, &name, 400).await;
    run.command(RunCommandKind::Hold).await;
    let held = run.change().await;
    assert_eq!((held.setpoint_index, held.ratio), (900, 0.0));
    run.command(RunCommandKind::Resume).await;
    run.change().await;
    let ended = run.finish().await;
    chunks.append(&mut run.chunks);
    assert_eq!(bits(&chunks), streamed(&server, &job.name, &run.changes).await);
    let replayed = replay(&mut client, &name).await;
    assert!(replayed.identical, "{replayed:?}");
    assert_eq!(replayed.digest, ended.digest);
}

#[tokio::test]
async fn a_deflection_that_stays_too_large_at_the_lower_bound_holds_the_path_until_somebody_has_seen_it() {
    let server = TestServer::start().await;
    let (mut monitoring, job) = monitored_job(&server, telemetry::escalating(), PART).await;
    let mut client = RunsClient::new(server.channel.clone());
    let mut run = LiveRun::begin(&mut client, &job.name).await;
    let name = run.started.run.clone();
    run.credit(500).await;
    run.reach(500).await;
    for sequence in 0..60 {
        run.telemetry(batch(sequence, 0.02)).await;
    }
    run.acknowledged(59).await;
    let told: Vec<_> =
        run.changes.iter().map(|change| (change.ratio, change.cause(), change.decision_number)).collect();
    assert_eq!(told, [(0.75, FeedChangeCause::Decision, 1), (0.0, FeedChangeCause::Escalation, 3)]);
    // The path comes to rest, and stays there.
    run.credit(1_500).await;
    run.reach(1_500).await;
    let columns = &run.started.header.as_ref().unwrap().columns;
    let feed = columns.iter().position(|column| column.name == "feed_mm_per_min").unwrap();
    assert!(column(&run.chunks, feed)[1_000..].iter().all(|feed| *feed == 0.0));

    // Not acknowledged: a resume is refused with the reason. Holding is possible.
    run.command(RunCommandKind::Resume).await;
    while run.refused.is_empty() {
        assert_eq!(run.next().await.unwrap(), None);
    }
    let refused = &run.refused[0];
    assert_eq!((refused.kind(), refused.reason.as_str()), (RunCommandKind::Resume, "CONDITION_NOT_ACKNOWLEDGED"));
    run.command(RunCommandKind::Hold).await;
    let hold = run.change().await;
    assert_eq!((hold.ratio, hold.cause(), hold.setpoint_index), (0.0, FeedChangeCause::Hold, 1_500));
    let mut chunks = std::mem::take(&mut run.chunks);
    drop(run);

    let mut run = LiveRun::take_up(&mut client, &name, 1_500).await;
    assert!(run.started.feed_held && run.started.held, "{:?}", run.started);
    let seen = telemetry::seen(&name, None, "Ada");
    monitoring.acknowledge_condition(seen).await.unwrap();
    // It stays at rest until the operator resumes.
    run.credit(1_600).await;
    run.reach(1_600).await;
    run.command(RunCommandKind::Resume).await;
    let change = run.change().await;
    assert_eq!((change.ratio, change.cause()), (0.75, FeedChangeCause::Resume));
    let ended = run.finish().await;
    assert_eq!((ended.state(), run.refused.len()), (RunState::Finished, 0));
    chunks.append(&mut run.chunks);
    assert_eq!(bits(&chunks), streamed(&server, &job.name, &run.changes).await);
    let replayed = replay(&mut client, &name).await;
    assert!(replayed.identical && replayed.digest == ended.digest, "{replayed:?}");
}

#[tokio::test]
async fn an_escalation_stops_the_machine_where_that_is_set() {
    let server = TestServer::start().await;
    let mut config = telemetry::escalating();
    config.rules.as_mut().unwrap().escalation =
        Some(Escalation { windows: Some(1), action: EscalationAction::Stop.into() });
    let (mut monitoring, job) = monitored_job(&server, config, PART).await;
    let mut client = RunsClient::new(server.channel.clone());
    let mut run = LiveRun::begin(&mut client, &job.name).await;
    run.credit(500).await;
    run.reach(500).await;
    for sequence in 0..40 {
        run.telemetry(batch(sequence, 0.02)).await;
    }
    let ended = run.finish().await;
    assert_eq!((ended.state(), ended.message.as_str()), (RunState::Stopped, "decision 2 stopped the machine"));
    assert_eq!(run.changes.last().unwrap().cause(), FeedChangeCause::Stop);
    // An unacknowledged condition outlives the run.
    let request = GetRunRequest { name: run.started.run.clone() };
    let stored = monitoring.get_run(request).await.unwrap().into_inner().run.unwrap();
    assert_eq!((stored.open_conditions, stored.conditions[0].action()), (1, DecisionAction::Stop));
    let replayed = replay(&mut client, &run.started.run).await;
    assert!(replayed.identical, "{replayed:?}");
}

#[tokio::test]
async fn an_abort_comes_to_rest_on_the_path_before_the_run_ends() {
    let server = TestServer::start().await;
    let (mut monitoring, job) = monitored_job(&server, config(), PART).await;
    let mut client = RunsClient::new(server.channel.clone());
    let mut run = LiveRun::begin(&mut client, &job.name).await;
    run.credit(2_000).await;
    run.reach(2_000).await;
    run.command(RunCommandKind::Abort).await;
    let ended = run.finish().await;
    assert_eq!(ended.state(), RunState::Aborted);
    assert!((2_010..2_200).contains(&ended.setpoint_count), "{ended:?}");
    let feed_column = run.started.header.as_ref().unwrap().columns.iter().position(|c| c.name == "feed_mm_per_min");
    let feed = column(&run.chunks, feed_column.unwrap());
    assert_eq!(feed.last(), Some(&0.0));
    assert!(feed[2_000] > 0.0, "not at once");
    let replayed = replay(&mut client, &run.started.run).await;
    assert!(replayed.identical, "{replayed:?}");

    // A tool that does not run true stops a run before anything is cut.
    let mut strict = config();
    strict.tool_check = Some(ToolCheck { max_ratio: None, max_run_out: Some(1e-9) });
    let grouping =
        feedwave_contract::proto::Grouping { by: Some(feedwave_contract::proto::grouping::By::AngularPoints(4)) };
    strict.grouping = Some(grouping);
    let request = SetMonitoringRequest { job: job.name.clone(), config: Some(strict) };
    monitoring.set_monitoring(request).await.unwrap();
    let mut run = LiveRun::begin(&mut client, &job.name).await;
    for sequence in 0..11 {
        let samples = sequence * 10..sequence * 10 + 10;
        let angles = samples.map(|sample| sample as f64 * 40.0).collect();
        run.telemetry(TelemetryBatch { spindle_angle_deg: angles, ..batch(sequence, 0.0) }).await;
    }
    let ended = loop {
        if let Some(ended) = run.next().await.unwrap() {
            break ended;
        }
    };
    assert_eq!((ended.state(), ended.setpoint_count), (RunState::Stopped, 0), "{ended:?}");
    let list = feedwave_contract::proto::ListDecisionsRequest { run: run.started.run.clone(), ..Default::default() };
    let decisions = monitoring.list_decisions(list).await.unwrap().into_inner().decisions;
    let outcome = decisions.last().unwrap().outcome.unwrap();
    assert_eq!((outcome.action(), outcome.reason()), (DecisionAction::Stop, DecisionReason::ReplaceTool));
}

/// How many runs there are.
async fn run_count(server: &TestServer) -> usize {
    let mut client = TelemetryClient::new(server.channel.clone());
    client.list_runs(ListRunsRequest::default()).await.unwrap().into_inner().runs.len()
}

/// Neither is the run taken from whoever has it, nor does it go on behind setpoints that nobody was sent, nor is one made.
#[tokio::test]
async fn a_start_that_is_refused_changes_nothing() {
    let server = TestServer::start().await;
    let (_, job) = monitored_job(&server, config(), PART).await;
    let mut client = RunsClient::new(server.channel.clone());
    let mut run = LiveRun::begin(&mut client, &job.name).await;
    run.credit(1_000).await;
    run.reach(1_000).await;
    let again = RunStart { target: Some(Target::Run(run.started.run.clone())), ..Default::default() };
    let unfit = vec![ColumnKind::ServoAmplitude.into()];
    for (start, code) in [
        (RunStart { start_index: 1_001, ..again.clone() }, Code::OutOfRange),
        (RunStart { start_index: u64::MAX, ..again.clone() }, Code::OutOfRange),
        (RunStart { columns: unfit.clone(), ..again.clone() }, Code::InvalidArgument),
        (
            RunStart { target: Some(Target::Job(job.name.clone())), columns: unfit, ..Default::default() },
            Code::InvalidArgument,
        ),
    ] {
        let refused = LiveRun::open(&mut client, start.clone()).await.err().expect("refused");
        assert_eq!(refused.code(), code, "{start:?}");
        if code == Code::OutOfRange {
            assert_eq!(told(&refused).1, "START_BEYOND_SENT");
        }
    }
    run.credit(1_100).await;
    run.reach(1_100).await;
    assert_eq!(run_count(&server).await, 1);
    let name = run.started.run.clone();
    let mut second = LiveRun::take_up(&mut client, &name, 1_100).await;
    second.credit(1_200).await;
    second.reach(1_200).await;
    drop((run, second));

    // The log knows it as well, but for what a breakdown may have taken from it.
    let server = TestServer::in_folder(server.stop().await, feedwave_server::config::Limits::default()).await;
    let mut client = RunsClient::new(server.channel.clone());
    let refused = LiveRun::open(&mut client, RunStart { start_index: 1_200 + 16_385, ..again }).await.err();
    assert_eq!(told(&refused.expect("refused")).1, "START_BEYOND_SENT");
    let mut third = LiveRun::take_up(&mut client, &name, 1_200).await;
    third.finish().await;
}

#[tokio::test]
async fn a_run_that_there_is_no_place_for_is_not_made() {
    let limits = feedwave_server::config::Limits { concurrent_runs: 1, ..Default::default() };
    let server = TestServer::with_limits(limits).await;
    let (_, job) = monitored_job(&server, config(), PART).await;
    let mut client = RunsClient::new(server.channel.clone());
    let mut run = LiveRun::begin(&mut client, &job.name).await;
    for _ in 0..3 {
        let start = RunStart { target: Some(Target::Job(job.name.clone())), ..Default::default() };
        let refused = LiveRun::open(&mut client, start).await.err().expect("refused");
        assert_eq!(told(&refused).1, "OVERLOADED");
    }
    assert_eq!(run_count(&server).await, 1);
    // The stream that has it gives its place up to the one that takes it up, also when nothing else wakes it.
    run.credit(100).await;
    run.reach(100).await;
    run.command(RunCommandKind::Hold).await;
    run.change().await;
    let mut second = LiveRun::take_up(&mut client, &run.started.run, 100).await;
    second.command(RunCommandKind::Resume).await;
    second.finish().await;
}

#[tokio::test]
async fn what_a_run_cannot_do_is_refused_before_anything_moves() {
    let server = TestServer::start().await;
    let (mut monitoring, job) = monitored_job(&server, config(), TURNING).await;
    let mut client = RunsClient::new(server.channel.clone());
    let refused = async |client: &mut RunsClient<Channel>, start: RunStart| {
        told(&LiveRun::open(client, start).await.err().expect("refused"))
    };
    let target = || Some(Target::Job(job.name.clone()));
    let settings = RunSettings { interpolation_period_us: 7, generation_mode: 99, ..Default::default() };
    let start = RunStart { target: target(), start_index: 7, settings: Some(settings), ..Default::default() };
    let (code, _, fields) = refused(&mut client, start).await;
    assert_eq!(code, Code::InvalidArgument);
    assert_eq!(fields, ["start.start_index", "interpolation_period_us", "start.settings.generation_mode"]);

    let mut too_fast = config();
    too_fast.rules.as_mut().unwrap().feed_bounds = Some(OverrideBounds { lower: 0.1, upper: 3.0 });
    // Beyond what the chip of its vibration was judged up to.
    let mut unjudged = config();
    unjudged.rules.as_mut().unwrap().feed_bounds = Some(OverrideBounds { lower: 0.1, upper: 1.6 });
    // Below what is planned.
    let mut too_slow = config();
    too_slow.rules.as_mut().unwrap().feed_bounds = Some(OverrideBounds { lower: 1e-9, upper: 1.0 });
    for unfit in [too_fast, unjudged, too_slow] {
        let request = SetMonitoringRequest { job: job.name.clone(), config: Some(unfit) };
        monitoring.set_monitoring(request).await.unwrap();
        let start = RunStart { target: target(), ..Default::default() };
        let (code, reason, _) = refused(&mut client, start).await;
        assert_eq!((code, reason.as_str()), (Code::FailedPrecondition, "MONITORING_UNFIT"));
    }

    let request = SetMonitoringRequest { job: job.name.clone(), config: Some(config()) };
    monitoring.set_monitoring(request).await.unwrap();
    for wrong in [
        Request::Receipt(RunReceipt { received: 1 }),
        Request::Command(RunCommand::default()),
        Request::Start(RunStart::default()),
    ] {
        let mut run = LiveRun::begin(&mut client, &job.name).await;
        run.say(wrong).await;
        assert_eq!(told(&run.next().await.unwrap_err()).0, Code::InvalidArgument);
    }
}
