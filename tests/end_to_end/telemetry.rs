//! Telemetry with every kind of fault, through `kill -9` at random moments: the decisions are those of a session that
//! nothing interrupted, each made once, and none from bad data.

use feedwave_contract::proto::decision_inputs::Evidence;
use feedwave_contract::proto::ingest_request::Message as Request;
use feedwave_contract::proto::ingest_response::Message;
use feedwave_contract::proto::ingest_start::Target;
use feedwave_contract::proto::runs_client::RunsClient;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    BatchGap, Decision, DecisionAction, DecisionReason, GetRunRequest, HoldReason, IngestEnd, IngestRequest,
    IngestStart, ListDecisionsRequest, ReplayRunRequest, Run, RunState, SetMonitoringRequest, TelemetryBatch,
};
use feedwave_tests::{Chance, Home, Server};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

use crate::FEEDWAVE;
use crate::live_runs::{batch, config};

/// Any program: its telemetry is judged only.
const PART: &str = "G21 G94 G97 S1000 M3\nG0 X30. Z2.\nG1 Z-20. F200\nM30\n";
/// How often the service is killed.
const KILLS: usize = 8;
/// A deflection that no good data shows: a decision that saw it was made from bad data.
const WRONG_MM: f64 = 0.5;

/// What goes wrong with a batch.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    NotANumber,
    Infinite,
    Stuck,
    SensorLost,
    BackInTime,
    Swapped,
    Missing,
}

/// One fault in every other window of ten batches, in turn.
fn fault_at(sequence: u64) -> Option<Fault> {
    use Fault::{BackInTime, Infinite, Missing, NotANumber, SensorLost, Stuck, Swapped};
    let faults = [NotANumber, Infinite, Stuck, SensorLost, BackInTime, Swapped, Missing];
    let (window, within) = (sequence / 10, sequence % 10);
    let is_bad = window >= 3 && window % 2 == 1 && (3..7).contains(&within);
    is_bad.then(|| faults[(window as usize / 2 - 1) % faults.len()])
}

/// Everything that a faulty machine sends, in its order.
fn everything() -> Vec<TelemetryBatch> {
    let mut all: Vec<TelemetryBatch> = Vec::new();
    for sequence in 0..400 {
        let mut batch = batch(sequence);
        // From here on the clock of the sensors is an hour ahead.
        if sequence >= 300 {
            batch.time_ns.iter_mut().for_each(|time_ns| *time_ns += 3_600_000_000_000);
        }
        let fault = fault_at(sequence);
        let tool = batch.tool.as_mut().expect("a sensor");
        if fault.is_some() {
            tool.y.iter_mut().for_each(|y| *y += WRONG_MM);
        }
        match fault {
            Some(Fault::NotANumber) => tool.x.fill(f64::NAN),
            Some(Fault::Infinite) => tool.x.fill(f64::NEG_INFINITY),
            Some(Fault::Stuck) => tool.x.fill(1.25),
            Some(Fault::SensorLost) if sequence % 2 == 0 => batch.tool = None,
            // One of its two sensors.
            Some(Fault::SensorLost) => tool.y.clear(),
            Some(Fault::BackInTime) => batch.time_ns.iter_mut().for_each(|time_ns| *time_ns -= 500_000_000),
            Some(Fault::Missing) => continue,
            Some(Fault::Swapped) | None => {}
        }
        let at = all.len();
        // Overtaken by the one after.
        let place = if fault == Some(Fault::Swapped) && sequence % 2 == 1 { at - 1 } else { at };
        all.insert(place, batch.clone());
        if sequence % 7 == 0 {
            all.push(batch);
        }
    }
    all
}

/// What the client has heard.
#[derive(Default)]
struct Heard {
    run: String,
    durable_batch: Option<u64>,
    decisions: Vec<Decision>,
    duplicates: u32,
}

/// Sends what is not durable, until the service dies, which it does after `messages` messages, or to the end of the
/// session; whether that was it.
async fn ingest(server: &Server, job: &str, heard: &mut Heard, messages: usize) -> bool {
    let mut client = TelemetryClient::new(server.connect().await.channel);
    let (requests, outgoing) = mpsc::channel(16);
    let target = if heard.run.is_empty() { Target::Job(job.to_owned()) } else { Target::Run(heard.run.clone()) };
    let start = Request::Start(IngestStart { target: Some(target), sensor_time_ns: None, recording: None });
    requests.send(IngestRequest { message: Some(start) }).await.expect("a first message");
    let mut responses = client.ingest(ReceiverStream::new(outgoing)).await.expect("a session").into_inner();
    let mut sender = None;
    let mut requests = Some(requests);
    for _ in 0..messages {
        match responses.message().await.expect("the service is there") {
            None => return true,
            Some(response) => match response.message.expect("a message") {
                Message::Started(started) => {
                    assert!(heard.durable_batch <= started.durable_batch, "acknowledged batches are durable");
                    heard.run = started.run;
                    // Where it left off, and some of what it may know already.
                    let durable = started.durable_batch;
                    let all = everything();
                    let known = durable.map_or(0, |durable| {
                        all.iter().position(|batch| batch.sequence > durable).unwrap_or(all.len())
                    });
                    let requests = requests.take().expect("one start");
                    sender = Some(tokio::spawn(async move {
                        for batch in all.into_iter().skip(known.saturating_sub(3)) {
                            let _ = requests.send(IngestRequest { message: Some(Request::Batch(batch)) }).await;
                        }
                        let _ = requests.send(IngestRequest { message: Some(Request::End(IngestEnd {})) }).await;
                    }));
                }
                Message::Decision(decision) => heard.decisions.push(decision),
                Message::Ack(ack) => {
                    heard.durable_batch = Some(ack.durable_batch);
                    heard.duplicates += ack.duplicates;
                }
            },
        }
    }
    if let Some(sender) = sender {
        sender.abort();
    }
    false
}

async fn listed(server: &Server, run: &str) -> Vec<Decision> {
    let mut client = TelemetryClient::new(server.connect().await.channel);
    let (mut all, mut page_token) = (Vec::new(), String::new());
    loop {
        let request = ListDecisionsRequest { run: run.to_owned(), page_token, page_size: 7, ..Default::default() };
        let page = client.list_decisions(request).await.expect("a page").into_inner();
        all.extend(page.decisions);
        page_token = page.next_page_token;
        if page_token.is_empty() {
            return all;
        }
    }
}

async fn run_of(server: &Server, name: &str) -> Run {
    let mut client = TelemetryClient::new(server.connect().await.channel);
    let request = GetRunRequest { name: name.to_owned() };
    client.get_run(request).await.expect("the run").into_inner().run.expect("a run")
}

/// A decision without what is its own in every run.
fn made(decision: &Decision) -> Decision {
    Decision { sequence: 0, run: String::new(), time: None, ..decision.clone() }
}

// One run, held against the same without kills.
#[tokio::test]
async fn decisions_on_faulty_telemetry_survive_kills_each_once_and_none_from_bad_data() {
    let mut chance = Chance::new();
    let seed = chance.seed();
    let mut server = Home::new(FEEDWAVE, "").start().await;
    let job = server.connect().await.submit(PART).await.job.name;
    let mut telemetry = TelemetryClient::new(server.connect().await.channel);
    let request = SetMonitoringRequest { job: job.clone(), config: Some(config()) };
    telemetry.set_monitoring(request).await.expect("the configuration is valid");

    let mut whole = Heard::default();
    assert!(ingest(&server, &job, &mut whole, usize::MAX).await);
    let mut heard = Heard::default();
    let mut kills = 0;
    loop {
        let messages = if kills < KILLS { chance.up_to(8) as usize } else { usize::MAX };
        if ingest(&server, &job, &mut heard, messages).await {
            break;
        }
        server = server.kill().await.start().await;
        kills += 1;
    }

    // Those of the session that nothing interrupted, in the log of both.
    let (log, reference) = (listed(&server, &heard.run).await, listed(&server, &whole.run).await);
    assert_eq!(reference, whole.decisions, "what was heard is the log");
    let (log_made, reference_made): (Vec<_>, Vec<_>) =
        (log.iter().map(made).collect(), reference.iter().map(made).collect());
    assert_eq!(log_made, reference_made, "seed {seed}, {kills} kills");
    for (number, decision) in (0..).zip(&log) {
        assert_eq!(decision.number, number, "each once, seed {seed}");
    }
    for decision in &heard.decisions {
        assert_eq!(&log[decision.number as usize], decision, "what was heard is durable, seed {seed}");
    }
    assert!(whole.duplicates >= 50, "{}", whole.duplicates);

    // What changed anything was made from good data.
    let outcome = |decision: &Decision| decision.outcome.expect("an outcome");
    for decision in &log {
        let evidence = decision.inputs.as_ref().and_then(|inputs| inputs.evidence.as_ref());
        if outcome(decision).action() == DecisionAction::Change {
            let Some(Evidence::Process(process)) = evidence else { panic!("no evidence: {decision:?}") };
            let is_true = |mm: f64| (process.max_deviation - mm).abs() < 2e-4;
            assert!(is_true(0.02) || is_true(0.001), "{decision:?}");
        }
    }
    assert!(log.iter().any(|decision| outcome(decision).action() == DecisionAction::Change));
    let held: Vec<HoldReason> =
        log.iter().map(outcome).filter(|it| it.reason() == DecisionReason::Data).map(|it| it.hold_reason()).collect();
    for reason in [
        HoldReason::NotFinite,
        HoldReason::StuckSensor,
        HoldReason::SensorMissing,
        HoldReason::TimeOutOfOrder,
        HoldReason::TimeGap,
        HoldReason::BatchGap,
    ] {
        assert!(held.contains(&reason), "{reason:?} is not among {held:?}");
    }

    // What never came, or came too late, is reported.
    let run = run_of(&server, &heard.run).await;
    assert_eq!((run.state(), run.durable_batch), (RunState::Finished, Some(399)));
    assert_eq!(run.gaps, run_of(&server, &whole.run).await.gaps);
    assert!(run.gaps.contains(&BatchGap { first: 153, last: 156 }), "{:?}", run.gaps);
    for run in [&heard.run, &whole.run] {
        let request = ReplayRunRequest { run: run.clone(), start_index: 0 };
        let mut runs = RunsClient::new(server.connect().await.channel);
        let replayed = runs.replay_run(request).await.expect("a replay").into_inner();
        assert!(replayed.identical && replayed.decision_count == log.len() as u64, "{replayed:?}");
    }
}
