//! An escalation through `kill -9`: it happens once, its condition stays until it is acknowledged, and so does the
//! acknowledgement.

use feedwave_contract::proto::run_request::Message as Request;
use feedwave_contract::proto::run_response::Message;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::runs_client::RunsClient;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    AcknowledgeConditionRequest, DecisionAction, DecisionReason, Escalation, FeedChangeCause, GetRunRequest,
    ListDecisionsRequest, OverrideBounds, ReplayRunRequest, Run, RunCommand, RunCommandKind, RunCredit, RunFeedChange,
    RunReceipt, RunRequest, RunStart, RunStarted, RunState, SetMonitoringRequest,
};
use feedwave_tests::{Home, Server};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Streaming};

use crate::FEEDWAVE;
use crate::live_runs::{PART, batch, config};

/// Batches up to two windows after the one that escalates.
const BATCHES: u64 = 50;

/// The connection of a run.
struct Link {
    requests: mpsc::Sender<RunRequest>,
    responses: Streaming<feedwave_contract::proto::RunResponse>,
    started: RunStarted,
}

/// What the client knows of its run, whatever became of the service.
#[derive(Default)]
struct Known {
    run: String,
    setpoints: u64,
    changes: Vec<RunFeedChange>,
    durable_batch: Option<u64>,
}

impl Link {
    async fn open(server: &Server, job: &str, known: &mut Known) -> Self {
        let mut client = RunsClient::new(server.connect().await.channel);
        let (requests, outgoing) = mpsc::channel(1_024);
        let target = if known.run.is_empty() { Target::Job(job.to_owned()) } else { Target::Run(known.run.clone()) };
        let start = RunStart { target: Some(target), start_index: known.setpoints, ..Default::default() };
        requests.send(RunRequest { message: Some(Request::Start(start)) }).await.expect("a request");
        let mut responses = client.run(ReceiverStream::new(outgoing)).await.expect("the run is taken up").into_inner();
        let first = responses.message().await.expect("an answer").and_then(|response| response.message);
        let Some(Message::Started(started)) = first else { panic!("a run begins with its start, not with {first:?}") };
        assert_eq!(started.feed_changes[..known.changes.len()], known.changes, "what was said is in the log");
        assert!(known.durable_batch <= started.durable_batch, "what was acknowledged is durable");
        known.run.clone_from(&started.run);
        known.changes.clone_from(&started.feed_changes);
        known.durable_batch = started.durable_batch;
        Self { requests, responses, started }
    }

    async fn say(&self, message: Request) {
        self.requests.send(RunRequest { message: Some(message) }).await.expect("the service listens");
    }

    /// Takes one message; whether the run has ended with it.
    async fn next(&mut self, known: &mut Known) -> bool {
        let response = self.responses.message().await.expect("no error").expect("a run says that it ends");
        match response.message.expect("a message") {
            Message::Chunk(chunk) => {
                assert_eq!(chunk.first_index, known.setpoints);
                known.setpoints += u64::from(chunk.count);
                self.say(Request::Receipt(RunReceipt { received: known.setpoints })).await;
            }
            Message::Ack(ack) => known.durable_batch = Some(ack.durable_batch),
            Message::FeedChange(change) => known.changes.push(change),
            Message::Decision(_) => {}
            Message::Ended(ended) => {
                assert_eq!((ended.state(), ended.setpoint_count), (RunState::Finished, known.setpoints));
                return true;
            }
            other => panic!("{other:?}"),
        }
        false
    }

    /// Sends what is not durable, and takes so many messages.
    async fn escalate(&mut self, known: &mut Known, messages: u64) {
        self.say(Request::Credit(RunCredit { end_index: 500 })).await;
        for sequence in known.durable_batch.map_or(0, |durable| durable + 1)..BATCHES {
            self.say(Request::Batch(batch(sequence))).await;
        }
        for _ in 0..messages {
            if known.durable_batch == Some(BATCHES - 1) {
                break;
            }
            self.next(known).await;
        }
    }
}

async fn run_of(server: &Server, known: &Known) -> Run {
    let mut client = TelemetryClient::new(server.connect().await.channel);
    let answer = client.get_run(GetRunRequest { name: known.run.clone() }).await.expect("the run is kept");
    answer.into_inner().run.expect("a run")
}

/// Conditions that dashboards show as open, and those that the metrics count.
async fn shown(server: &Server) -> (u64, f64) {
    let web = server.web();
    let state = web.get("/v1/state").await.json();
    let metrics = web.get("/metrics").await;
    let line = metrics.text().lines().find(|line| line.starts_with("feedwave_open_conditions ")).map(str::to_owned);
    let counted = line.and_then(|line| line.rsplit(' ').next()?.parse().ok()).expect("the conditions are counted");
    (state["openConditions"].as_u64().unwrap_or_default(), counted)
}

/// Whether the machine shows that an escalation holds the feed, and which of its conditions are acknowledged.
async fn on_the_floor(server: &Server) -> (bool, Vec<bool>) {
    let state = server.web().get("/v1/machines/lathe/state").await.json();
    let of_log = |condition: &&serde_json::Value| condition["needsAcknowledgement"] == true;
    let conditions = state["conditions"].as_array().expect("conditions").iter().filter(of_log);
    let acknowledged = conditions.map(|condition| !condition["acknowledgeTime"].is_null());
    (state["run"]["feedHeld"] == true, acknowledged.collect())
}

// One run through every kill, and what the log, the feed and the dashboard have of it then.
#[tokio::test]
async fn an_escalation_survives_kills_at_any_moment_once() {
    let mut server = Home::new(FEEDWAVE, "").start().await;
    let job = server.connect().await.submit(PART).await.job.name;
    let mut config = config();
    let rules = config.rules.as_mut().expect("rules");
    rules.feed_bounds = Some(OverrideBounds { lower: 0.5, upper: 1.5 });
    rules.escalation = Some(Escalation { windows: Some(2), ..Default::default() });
    let request = SetMonitoringRequest { job: job.clone(), config: Some(config) };
    let mut telemetry = TelemetryClient::new(server.connect().await.channel);
    telemetry.set_monitoring(request).await.expect("the configuration is valid");

    // Killed after ever more messages, and at last before the client receives anything of the escalation.
    let mut known = Known::default();
    for messages in [6, 9, 12, 15, 3, 0] {
        let mut link = Link::open(&server, &job, &mut known).await;
        link.escalate(&mut known, messages).await;
        server = server.kill().await.start().await;
    }
    let mut link = Link::open(&server, &job, &mut known).await;
    link.escalate(&mut known, u64::MAX).await;
    while known.changes.len() < 2 {
        link.next(&mut known).await;
    }
    // Decisions go on: what holds the feed is not what was decided last.
    let mut late = batch(BATCHES);
    late.time_ns.iter_mut().for_each(|time_ns| *time_ns += 10_000_000_000);
    link.say(Request::Batch(late)).await;
    while known.durable_batch < Some(BATCHES) {
        link.next(&mut known).await;
    }
    drop(link);
    server = server.kill().await.start().await;

    // Once, in the log of decisions, in that of the feed, and as a condition.
    let causes: Vec<_> = known.changes.iter().map(|change| (change.ratio, change.cause())).collect();
    assert_eq!(causes, [(0.5, FeedChangeCause::Decision), (0.0, FeedChangeCause::Escalation)]);
    let mut telemetry = TelemetryClient::new(server.connect().await.channel);
    let request = ListDecisionsRequest { run: known.run.clone(), page_size: 500, ..Default::default() };
    let listed = telemetry.list_decisions(request).await.expect("the decisions are listed").into_inner().decisions;
    let holds = |action: DecisionAction| action == DecisionAction::HoldFeed;
    let raised: Vec<_> = listed.iter().filter(|it| it.outcome.is_some_and(|outcome| holds(outcome.action()))).collect();
    assert_eq!(raised.len(), 1, "{listed:?}");
    let kept = run_of(&server, &known).await;
    assert_eq!((kept.conditions.len(), kept.open_conditions), (1, 1), "{kept:?}");
    assert_eq!(kept.conditions[0].decision_number, raised[0].number);
    assert_eq!(shown(&server).await, (1, 1.0));
    assert_ne!(listed.last().and_then(|it| it.outcome).map(|it| it.reason()), Some(DecisionReason::FeedHeld));
    assert_eq!(on_the_floor(&server).await, (true, vec![false]));

    // A resume is refused before the acknowledgement, which is kept as it was given first, through a kill, too.
    let mut link = Link::open(&server, &job, &mut known).await;
    assert!(link.started.feed_held && link.started.overrides.is_some_and(|it| it.feed == 0.0), "{:?}", link.started);
    let resume = Request::Command(RunCommand { kind: RunCommandKind::Resume.into() });
    link.say(resume.clone()).await;
    let answer = link.responses.message().await.expect("no error").and_then(|response| response.message);
    assert!(matches!(answer, Some(Message::CommandRefused(_))), "{answer:?}");
    drop(link);
    let by = |by: &str| AcknowledgeConditionRequest {
        run: known.run.clone(),
        decision_number: None,
        acknowledged_by: by.to_owned(),
        note: String::new(),
    };
    let first = telemetry.acknowledge_condition(by("Ada")).await.expect("acknowledged").into_inner().condition;
    server = server.kill().await.start().await;
    let mut telemetry = TelemetryClient::new(server.connect().await.channel);
    let again = telemetry.acknowledge_condition(by("Bob")).await.expect("harmless").into_inner().condition;
    assert_eq!(first, again);
    let unknown = AcknowledgeConditionRequest { decision_number: Some(1), ..by("Ada") };
    assert_eq!(telemetry.acknowledge_condition(unknown).await.expect_err("no condition").code(), Code::NotFound);
    assert_eq!(run_of(&server, &known).await.conditions, first.into_iter().collect::<Vec<_>>());
    assert_eq!(shown(&server).await, (0, 0.0));
    assert_eq!(on_the_floor(&server).await, (true, vec![true]), "it holds the feed, whoever knows of it");
    let events = server.web().get("/v1/events").await.json();
    let events = events["events"].as_array().expect("events");
    let told = events.iter().filter(|event| event.to_string().contains("condition")).count();
    assert_eq!(told, 2, "raised and acknowledged, once each: {events:?}");

    // Acknowledged, but not resumed; then resumed, once.
    let mut link = Link::open(&server, &job, &mut known).await;
    assert!(link.started.feed_held);
    link.say(resume).await;
    while known.changes.len() < 3 {
        link.next(&mut known).await;
    }
    drop(link);
    server = server.kill().await.start().await;
    assert_eq!(on_the_floor(&server).await, (false, vec![]));
    let mut link = Link::open(&server, &job, &mut known).await;
    assert!(!link.started.feed_held && known.changes.len() == 3, "{:?}", link.started);
    assert_eq!((known.changes[2].ratio, known.changes[2].cause()), (0.5, FeedChangeCause::Resume));
    link.say(Request::Credit(RunCredit { end_index: u64::MAX })).await;
    while !link.next(&mut known).await {}
    let mut runs = RunsClient::new(server.connect().await.channel);
    let replayed =
        runs.replay_run(ReplayRunRequest { run: known.run, start_index: 0 }).await.expect("a replay").into_inner();
    assert!(replayed.identical, "{replayed:?}");
    assert_eq!((replayed.setpoint_count, replayed.decision_count), (known.setpoints, listed.len() as u64));
}
