//! Telemetry becomes decisions: once, durably, whatever the connection does.

use std::ops::Range;

use feedwave_contract::proto::ingest_request::Message as Request;
use feedwave_contract::proto::ingest_response::Message;
use feedwave_contract::proto::ingest_start::Target;
use feedwave_contract::proto::machine_event::Event;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::window_length::Length;
use feedwave_contract::proto::{
    AcknowledgeConditionRequest, CancelJobRequest, ChannelPair, Decision, DecisionAction, DecisionReason,
    DecisionRules, Escalation, FeedRule, GetMonitoringRequest, GetRunRequest, HoldReason, IngestEnd, IngestRequest,
    IngestResponse, IngestStart, IngestStarted, Job, ListDecisionsRequest, MachineEvent, MonitorState,
    MonitoringConfig, OverrideBound, OverrideBounds, Run, RunState, SetMonitoringRequest, SilenceFallback,
    TelemetryAck, TelemetryBatch, WatchDecisionsRequest, WindowLength,
};
use feedwave_tests::live_config;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Code, Status, Streaming};

use crate::support::{TestServer, lathe_job, patiently, resting, told};

/// Samples per second, and per batch: ten batches make a window.
const RATE_HZ: u64 = 1_000;
const BATCH: u64 = 10;

pub fn seconds(seconds: f64) -> Option<WindowLength> {
    Some(WindowLength { length: Some(Length::DurationS(seconds)) })
}

pub fn config() -> MonitoringConfig {
    let feed = Some(FeedRule { lower: 0.003, upper: 0.01, step: Some(0.05) });
    MonitoringConfig { rules: Some(DecisionRules { feed, ..Default::default() }), ..live_config() }
}

/// Batch `sequence` of a machine that idles for ten batches and then cuts with this deflection.
pub fn batch(sequence: u64, deflection_mm: f64) -> TelemetryBatch {
    batch_of(sequence, sequence * BATCH..(sequence + 1) * BATCH, deflection_mm)
}

/// These samples of the same machine as one batch.
fn batch_of(sequence: u64, samples: Range<u64>, deflection_mm: f64) -> TelemetryBatch {
    let cutting = |sample: u64| sample >= 10 * BATCH;
    // No two values alike: a sensor that repeats itself is stuck.
    let ripple = |sample: u64| 1e-6 * (sample % 97) as f64;
    let offset = |sample: u64| if cutting(sample) { deflection_mm } else { 0.0 };
    TelemetryBatch {
        sequence,
        time_ns: samples.clone().map(|sample| 1_000_000_000 + sample * 1_000_000_000 / RATE_HZ).collect(),
        tool: Some(ChannelPair {
            x: samples.clone().map(|sample| 1.0 + offset(sample) + ripple(sample)).collect(),
            y: samples.clone().map(|sample| 2.0 + ripple(sample)).collect(),
        }),
        contact: samples.map(cutting).collect(),
        ..Default::default()
    }
}

struct Session {
    requests: mpsc::Sender<IngestRequest>,
    responses: Streaming<IngestResponse>,
    started: IngestStarted,
    decisions: Vec<Decision>,
}

impl Session {
    async fn open(client: &mut TelemetryClient<Channel>, target: Target) -> Result<Self, Status> {
        let (requests, messages) = mpsc::channel(64);
        let start = IngestStart { target: Some(target), sensor_time_ns: None, recording: None };
        requests.send(IngestRequest { message: Some(Request::Start(start)) }).await.unwrap();
        let mut responses = client.ingest(ReceiverStream::new(messages)).await?.into_inner();
        match responses.message().await?.and_then(|response| response.message) {
            Some(Message::Started(started)) => Ok(Self { requests, responses, started, decisions: Vec::new() }),
            other => panic!("a run begins with its start, not with {other:?}"),
        }
    }

    async fn send(&self, batch: TelemetryBatch) {
        // A service that listens no more says why in its answers.
        let _ = self.requests.send(IngestRequest { message: Some(Request::Batch(batch)) }).await;
    }

    async fn next(&mut self) -> Result<Option<TelemetryAck>, Status> {
        let response = patiently(self.responses.message()).await?;
        Ok(match response.and_then(|response| response.message) {
            Some(Message::Decision(decision)) => {
                self.decisions.push(decision);
                Some(TelemetryAck::default())
            }
            Some(Message::Ack(ack)) => Some(ack),
            None => None,
            other => panic!("{other:?}"),
        })
    }

    /// Reads until this batch is acknowledged; the acknowledgement.
    async fn acknowledged(&mut self, sequence: u64) -> TelemetryAck {
        loop {
            let ack = self.next().await.unwrap().expect("acknowledgements come");
            if ack.durable_batch == sequence {
                return ack;
            }
        }
    }

    /// Ends the run and reads the rest.
    async fn finish(self) -> Vec<Decision> {
        let Self { requests, mut responses, mut decisions, .. } = self;
        requests.send(IngestRequest { message: Some(Request::End(IngestEnd {})) }).await.unwrap();
        while let Some(response) = patiently(responses.message()).await.unwrap() {
            if let Some(Message::Decision(decision)) = response.message {
                decisions.push(decision);
            }
        }
        decisions
    }
}

async fn monitored(server: &TestServer, config: MonitoringConfig) -> (TelemetryClient<Channel>, Job) {
    monitored_job(server, config, &resting(1)).await
}

pub async fn monitored_job(
    server: &TestServer,
    config: MonitoringConfig,
    program: &str,
) -> (TelemetryClient<Channel>, Job) {
    let job = server.ready(lathe_job(program)).await;
    let mut client = TelemetryClient::new(server.channel.clone());
    let request = SetMonitoringRequest { job: job.name.clone(), config: Some(config) };
    client.set_monitoring(request).await.unwrap();
    (client, job)
}

fn brief(decision: &Decision) -> (u64, DecisionAction, DecisionReason, f64) {
    let outcome = decision.outcome.as_ref().unwrap();
    (decision.number, outcome.action(), outcome.reason(), outcome.after.unwrap().feed)
}

// One run through all its decisions, each of which follows from the one before.
#[tokio::test]
async fn too_large_a_deflection_takes_the_feed_down_step_by_step_to_its_bound_and_holds_it_there() {
    let server = TestServer::start().await;
    let (mut client, job) = monitored(&server, config()).await;
    let mut session = Session::open(&mut client, Target::Job(job.name.clone())).await.unwrap();
    assert_eq!(session.started.durable_batch, None);
    assert_eq!(session.started.state(), MonitorState::Baseline);
    for sequence in 0..10 + 10 * 60 {
        session.send(batch(sequence, 0.02)).await;
    }
    let ack = session.acknowledged(609).await;
    assert_eq!(ack.state(), MonitorState::Measuring);
    let run = session.started.run.clone();
    let decisions = session.finish().await;
    assert_eq!(brief(&decisions[0]), (0, DecisionAction::Keep, DecisionReason::ToolFit, 1.0));
    let mut feed: f64 = 1.0;
    let mut at_bound = 0;
    for (number, decision) in (1..).zip(&decisions[1..]) {
        let mut reason = DecisionReason::FeedAboveLimit;
        let (action, bound) = match feed * (1.0 - 0.05) {
            _ if feed == 0.0 => {
                reason = DecisionReason::FeedHeld;
                (DecisionAction::Hold, OverrideBound::Unspecified)
            }
            _ if feed == 0.1 && at_bound == 4 => {
                reason = DecisionReason::AboveLimitAtBound;
                feed = 0.0;
                (DecisionAction::HoldFeed, OverrideBound::Lower)
            }
            _ if feed == 0.1 => {
                at_bound += 1;
                (DecisionAction::Keep, OverrideBound::Lower)
            }
            lower if lower < 0.1 => {
                feed = 0.1;
                (DecisionAction::Change, OverrideBound::Lower)
            }
            lower => {
                feed = lower;
                (DecisionAction::Change, OverrideBound::Unspecified)
            }
        };
        assert_eq!(brief(decision), (number, action, reason, feed));
        assert_eq!(decision.outcome.as_ref().unwrap().feed_bound(), bound);
    }
    assert_eq!(feed, 0.0, "held by default");
    assert!(decisions.len() >= 59, "{}", decisions.len());

    // The log has the same, in order, for dashboards and watchers.
    let mut listed = Vec::new();
    let mut request = ListDecisionsRequest { run: run.clone(), page_size: 25, ..Default::default() };
    loop {
        let page = client.list_decisions(request.clone()).await.unwrap().into_inner();
        listed.extend(page.decisions);
        request.page_token = page.next_page_token;
        if request.page_token.is_empty() {
            break;
        }
    }
    assert_eq!(listed, decisions);
    let watch = WatchDecisionsRequest { after: Some(0), job: job.name.clone(), run: String::new() };
    let mut watched = client.watch_decisions(watch).await.unwrap().into_inner();
    for decision in &decisions {
        assert_eq!(patiently(watched.message()).await.unwrap().unwrap().decision.as_ref(), Some(decision));
    }
    let stored = client.get_run(GetRunRequest { name: run }).await.unwrap().into_inner().run.unwrap();
    assert_eq!((stored.state(), stored.durable_batch, stored.gaps.len()), (RunState::Finished, Some(609), 0));
    let [condition] = &stored.conditions[..] else { panic!("{stored:?}") };
    assert_eq!((stored.open_conditions, condition.action()), (1, DecisionAction::HoldFeed));
    assert_eq!(stored.monitoring.unwrap().settling_s, Some(0.0));
}

/// The feed reaches its lower bound with the first window, and escalates after two more above the limit.
pub fn escalating() -> MonitoringConfig {
    let mut config = config();
    let rules = config.rules.as_mut().unwrap();
    rules.feed = Some(FeedRule { lower: 0.003, upper: 0.01, step: Some(0.25) });
    rules.feed_bounds = Some(OverrideBounds { lower: 0.75, upper: 1.5 });
    rules.escalation = Some(Escalation { windows: Some(2), ..Default::default() });
    config
}

pub fn seen(run: &str, decision_number: Option<u64>, by: &str) -> AcknowledgeConditionRequest {
    let (run, acknowledged_by) = (run.to_owned(), by.to_owned());
    AcknowledgeConditionRequest { run, decision_number, acknowledged_by, note: "insert worn".to_owned() }
}

// One run: each refusal holds only between the steps before and behind it.
#[tokio::test]
async fn a_held_feed_needs_an_acknowledgement_and_a_resume_also_after_a_restart() {
    let server = TestServer::start().await;
    let (mut client, job) = monitored(&server, escalating()).await;
    let mut session = Session::open(&mut client, Target::Job(job.name)).await.unwrap();
    let run = session.started.run.clone();
    for sequence in 0..60 {
        session.send(batch(sequence, 0.02)).await;
    }
    session.acknowledged(59).await;
    let (hold, held) = (DecisionAction::HoldFeed, DecisionReason::FeedHeld);
    let found: Vec<_> = session.decisions.iter().map(brief).collect();
    assert_eq!(found[3], (3, hold, DecisionReason::AboveLimitAtBound, 0.0), "{found:?}");
    assert_eq!(found[4], (4, DecisionAction::Hold, held, 0.0));
    assert_eq!(session.decisions[3].inputs.as_ref().unwrap().windows_at_bound, 1);
    drop(session);

    let server = TestServer::in_folder(server.stop().await, feedwave_server::config::Limits::default()).await;
    let mut client = TelemetryClient::new(server.channel.clone());
    let stored = async |client: &mut TelemetryClient<Channel>| -> Run {
        client.get_run(GetRunRequest { name: run.clone() }).await.unwrap().into_inner().run.unwrap()
    };
    let open = stored(&mut client).await;
    assert_eq!((open.open_conditions, open.conditions[0].decision_number), (1, 3));
    assert_eq!((open.conditions[0].action(), open.conditions[0].acknowledge_time), (hold, None));

    // Not acknowledged: a resume ends the connection, and changes nothing.
    let resume = |sequence| {
        let event = MachineEvent { event: Some(Event::Resume(true)) };
        TelemetryBatch { events: vec![event], ..batch(sequence, 0.005) }
    };
    let mut session = Session::open(&mut client, Target::Run(run.clone())).await.unwrap();
    assert!(session.started.feed_held && session.started.overrides.unwrap().feed == 0.0, "{:?}", session.started);
    session.send(resume(60)).await;
    let (code, reason, _) = told(&session.next().await.unwrap_err());
    assert_eq!((code, reason.as_str()), (Code::FailedPrecondition, "CONDITION_NOT_ACKNOWLEDGED"));

    // What makes no sense is refused.
    let nobody = AcknowledgeConditionRequest { note: "n".repeat(1_001), ..seen("7", None, " ") };
    let (code, _, fields) = told(&client.acknowledge_condition(nobody).await.unwrap_err());
    assert_eq!((code, &fields[..]), (Code::InvalidArgument, &["run", "acknowledged_by", "note"].map(String::from)[..]));
    // What would change the terminal of another.
    let forged = AcknowledgeConditionRequest { note: "a\nb".to_owned(), ..seen(&run, None, "Eve\u{1b}[31m") };
    let (code, _, fields) = told(&client.acknowledge_condition(forged).await.unwrap_err());
    assert_eq!((code, &fields[..]), (Code::InvalidArgument, &["acknowledged_by", "note"].map(String::from)[..]));
    let (code, _, _) = told(&client.acknowledge_condition(seen(&run, Some(4), "Ada")).await.unwrap_err());
    assert_eq!(code, Code::NotFound);
    // The first acknowledgement stays.
    let first = client.acknowledge_condition(seen(&run, None, " Ada ")).await.unwrap().into_inner().condition.unwrap();
    assert_eq!((first.acknowledged_by.as_str(), first.note.as_str()), ("Ada", "insert worn"));
    let again = client.acknowledge_condition(seen(&run, Some(3), "Bob")).await.unwrap().into_inner();
    assert_eq!(again.condition.as_ref(), Some(&first));
    let closed = stored(&mut client).await;
    assert_eq!((closed.open_conditions, &closed.conditions[..]), (0, &[first][..]));

    // An acknowledgement resumes nothing, a resume does; the resume sent twice does once.
    let mut session = Session::open(&mut client, Target::Run(run.clone())).await.unwrap();
    assert!(session.started.feed_held && session.started.durable_batch == Some(59), "{:?}", session.started);
    session.send(resume(60)).await;
    session.send(resume(60)).await;
    for sequence in 61..80 {
        session.send(batch(sequence, 0.005)).await;
    }
    session.acknowledged(79).await;
    let decision = session.decisions.last().unwrap();
    assert_eq!(decision.inputs.as_ref().unwrap().windows_at_bound, 0);
    let (_, action, reason, feed) = brief(decision);
    assert_eq!((action, reason, feed), (DecisionAction::Keep, DecisionReason::WithinLimits, 0.75));
}

#[tokio::test]
async fn a_run_that_is_taken_up_again_and_again_makes_the_decisions_of_one_that_is_not() {
    let server = TestServer::start().await;
    let (mut client, job) = monitored(&server, config()).await;
    const LAST: u64 = 199;
    let deflection = |sequence: u64| if sequence < 100 { 0.02 } else { 0.001 };
    let mut whole = Session::open(&mut client, Target::Job(job.name.clone())).await.unwrap();
    for sequence in 0..=LAST {
        whole.send(batch(sequence, deflection(sequence))).await;
    }
    whole.acknowledged(LAST).await;
    let whole = whole.finish().await;

    let mut session = Session::open(&mut client, Target::Job(job.name.clone())).await.unwrap();
    let run = session.started.run.clone();
    let mut heard = Vec::new();
    for cut_at in [3, 17, 18, 64, 121, LAST] {
        let first = session.started.durable_batch.map_or(0, |durable| durable + 1);
        for sequence in first..=cut_at {
            session.send(batch(sequence, deflection(sequence))).await;
        }
        // Some of it may be durable, some not; the connection breaks anywhere.
        if cut_at % 2 == 1 {
            session.acknowledged(cut_at).await;
        }
        heard.append(&mut session.decisions);
        drop(session);
        session = Session::open(&mut client, Target::Run(run.clone())).await.unwrap();
        assert!(session.started.durable_batch <= Some(cut_at));
    }
    session.finish().await;
    let request = ListDecisionsRequest { run, page_size: 500, ..Default::default() };
    let listed = client.list_decisions(request).await.unwrap().into_inner().decisions;
    assert!(heard.iter().all(|heard| listed.contains(heard)), "what was sent is in the log");
    let content = |decisions: &[Decision]| -> Vec<_> {
        decisions.iter().map(|d| (d.number, d.sensor_time_ns, d.span, d.inputs.clone(), d.outcome)).collect()
    };
    assert_eq!(content(&listed), content(&whole));
}

#[tokio::test]
async fn duplicates_are_dropped_and_gaps_are_reported_and_void_their_window() {
    let server = TestServer::start().await;
    let (mut client, job) = monitored(&server, config()).await;
    let mut session = Session::open(&mut client, Target::Job(job.name)).await.unwrap();
    for sequence in (0..15).chain(5..20).chain(24..31) {
        session.send(batch(sequence, 0.02)).await;
    }
    let mut gaps = Vec::new();
    let mut duplicates = 0;
    loop {
        let ack = session.next().await.unwrap().unwrap();
        gaps.extend(ack.gaps.iter().map(|gap| (gap.first, gap.last)));
        duplicates += ack.duplicates;
        if ack.durable_batch == 30 {
            break;
        }
    }
    assert_eq!((gaps, duplicates), (vec![(20, 23)], 10));
    let run = session.started.run.clone();
    let decisions = session.finish().await;
    let outcomes: Vec<_> = decisions.iter().map(|decision| decision.outcome.unwrap()).collect();
    let held = outcomes.iter().find(|outcome| outcome.action() == DecisionAction::Hold).unwrap();
    assert_eq!((held.reason(), held.hold_reason()), (DecisionReason::Data, HoldReason::BatchGap));
    let stored = client.get_run(GetRunRequest { name: run }).await.unwrap().into_inner().run.unwrap();
    assert_eq!(stored.gaps.iter().map(|gap| (gap.first, gap.last)).collect::<Vec<_>>(), [(20, 23)]);
}

#[tokio::test]
async fn telemetry_that_stops_while_cutting_brings_the_fallback_also_when_the_client_is_gone() {
    let server = TestServer::start().await;
    let mut config = config();
    config.quality.as_mut().unwrap().silence_s = Some(0.1);
    config.rules.as_mut().unwrap().fallback = SilenceFallback::Full.into();
    let (mut client, job) = monitored(&server, config).await;
    for gone in [false, true] {
        let watch = WatchDecisionsRequest { after: None, job: job.name.clone(), run: String::new() };
        let mut log = client.watch_decisions(watch).await.unwrap().into_inner();
        let mut session = Session::open(&mut client, Target::Job(job.name.clone())).await.unwrap();
        // One batch up to the decision that slows down, so that no silence can come before it.
        session.send(batch_of(0, 0..25 * BATCH, 0.02)).await;
        while session.decisions.len() < 2 {
            session.next().await.unwrap().expect("the run goes on");
        }
        let slower = session.decisions.last().map(brief).expect("a decision");
        assert_eq!(slower, (1, DecisionAction::Change, DecisionReason::FeedAboveLimit, 0.95));
        if gone {
            drop(session);
        }
        let fallback = loop {
            let decision = patiently(log.message()).await.unwrap().unwrap().decision.unwrap();
            if decision.outcome.unwrap().reason() == DecisionReason::Silence {
                break decision;
            }
        };
        let (_, action, _, feed) = brief(&fallback);
        assert_eq!((action, feed), (DecisionAction::Change, 1.0), "gone: {gone}");
    }
}

#[tokio::test]
async fn whoever_takes_a_run_up_last_has_it() {
    let server = TestServer::start().await;
    let (mut client, job) = monitored(&server, config()).await;
    let mut first = Session::open(&mut client, Target::Job(job.name)).await.unwrap();
    first.send(batch(0, 0.0)).await;
    first.acknowledged(0).await;
    let mut second = Session::open(&mut client, Target::Run(first.started.run.clone())).await.unwrap();
    assert_eq!(second.started.durable_batch, Some(0));
    first.send(batch(1, 0.0)).await;
    let status = loop {
        match first.next().await {
            Ok(Some(_)) => {}
            Ok(None) => panic!("an end without a reason"),
            Err(status) => break status,
        }
    };
    assert_eq!((status.code(), told(&status).1.as_str()), (Code::Aborted, "RUN_TAKEN_UP"));
    second.send(batch(1, 0.0)).await;
    second.acknowledged(1).await;
    let run = second.started.run.clone();
    second.finish().await;
    let status = Session::open(&mut client, Target::Run(run)).await.err().unwrap();
    assert_eq!((status.code(), told(&status).1.as_str()), (Code::FailedPrecondition, "RUN_ENDED"));
}

#[tokio::test]
async fn a_run_of_a_cancelled_job_is_not_taken_up() {
    let server = TestServer::start().await;
    let (mut client, job) = monitored(&server, config()).await;
    let mut session = Session::open(&mut client, Target::Job(job.name.clone())).await.unwrap();
    session.send(batch(0, 0.0)).await;
    session.acknowledged(0).await;
    server.jobs().cancel_job(CancelJobRequest { name: job.name }).await.unwrap();
    let run = session.started.run.clone();
    let status = Session::open(&mut client, Target::Run(run)).await.err().unwrap();
    assert_eq!((status.code(), told(&status).1.as_str()), (Code::FailedPrecondition, "JOB_NOT_READY"));
}

#[tokio::test]
async fn what_makes_no_sense_is_refused_with_its_fields() {
    let server = TestServer::start().await;
    let (mut client, job) = monitored(&server, config()).await;
    let mut wrong = config();
    wrong.rules.as_mut().unwrap().feed = Some(FeedRule { lower: 0.01, upper: 0.003, step: None });
    wrong.window = seconds(0.01);
    let request = SetMonitoringRequest { job: job.name.clone(), config: Some(wrong) };
    let (code, reason, fields) = told(&client.set_monitoring(request).await.unwrap_err());
    assert_eq!((code, reason.as_str()), (Code::InvalidArgument, "INVALID_FIELDS"));
    assert_eq!(fields, ["config.window", "config.rules.feed.lower"]);
    let request = GetMonitoringRequest { job: job.name.clone() };
    let kept = client.get_monitoring(request).await.unwrap().into_inner().config.unwrap();
    assert_eq!(kept.rules.unwrap().feed.unwrap().upper, 0.01, "what was set before stays");

    let event = |event| MachineEvent { event: Some(event) };
    let mut short = batch(0, 0.0);
    short.contact.pop();
    let cases = [
        (short, "batch.contact"),
        (
            TelemetryBatch { events: vec![event(Event::ProgrammedRevPerMin(f64::NAN))], ..batch(0, 0.0) },
            "batch.events[0]",
        ),
        (TelemetryBatch { events: vec![event(Event::Resume(false))], ..batch(0, 0.0) }, "batch.events[0].resume"),
        (TelemetryBatch { events: vec![MachineEvent::default()], ..batch(0, 0.0) }, "batch.events[0].event"),
        (TelemetryBatch { time_ns: vec![1; 100_001], ..Default::default() }, "batch.time_ns"),
    ];
    for (wrong, field) in cases {
        let mut session = Session::open(&mut client, Target::Job(job.name.clone())).await.unwrap();
        session.send(wrong).await;
        let (code, _, fields) = told(&session.next().await.unwrap_err());
        assert_eq!((code, fields.as_slice()), (Code::InvalidArgument, [field.to_owned()].as_slice()));
    }
    let other = server.ready(lathe_job(&resting(2))).await;
    let status = Session::open(&mut client, Target::Job(other.name)).await.err().unwrap();
    assert_eq!(status.code(), Code::NotFound, "nothing says how its telemetry is judged: {status:?}");
}

#[tokio::test]
async fn a_server_that_ends_says_so_and_loses_nothing_acknowledged() {
    let server = TestServer::start().await;
    let (mut client, job) = monitored(&server, config()).await;
    let mut session = Session::open(&mut client, Target::Job(job.name)).await.unwrap();
    for sequence in 0..30 {
        session.send(batch(sequence, 0.02)).await;
    }
    session.acknowledged(29).await;
    let (run, heard) = (session.started.run.clone(), std::mem::take(&mut session.decisions));
    drop(client);
    let ending = tokio::spawn(server.stop());
    let status = loop {
        match session.next().await {
            Ok(Some(_)) => {}
            Ok(None) => panic!("an end without a reason"),
            Err(status) => break status,
        }
    };
    assert_eq!(told(&status).1, "SERVER_DRAINING");
    drop(session);
    let folder = patiently(ending).await.unwrap();

    let server = TestServer::in_folder(folder, Default::default()).await;
    let mut client = TelemetryClient::new(server.channel.clone());
    let session = Session::open(&mut client, Target::Run(run.clone())).await.unwrap();
    assert_eq!(session.started.durable_batch, Some(29));
    drop(session);
    let request = ListDecisionsRequest { run, page_size: 500, ..Default::default() };
    assert_eq!(client.list_decisions(request).await.unwrap().into_inner().decisions, heard);
}
