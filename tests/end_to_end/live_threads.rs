//! Decisions and threads in a live run, and what becomes of a run whose telemetry stops: all without the client's help.

use feedwave_contract::proto::decision_inputs::Evidence;
use feedwave_contract::proto::run_request::Message as Request;
use feedwave_contract::proto::run_response::Message;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::runs_client::RunsClient;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    Decision, DecisionAction, DecisionReason, FeedChangeCause, MonitoringConfig, ReplayRunRequest, RunCredit, RunEnded,
    RunFeedChange, RunReceipt, RunRequest, RunResponse, RunStart, RunStarted, RunState, SetMonitoringRequest,
    SilenceFallback, TelemetryBatch, WatchDecisionsRequest,
};
use feedwave_tests::Server;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Status, Streaming};

use crate::FEEDWAVE;
use crate::live_runs::{batch, config};

/// A cut, a thread of two seconds in line 4, and a cut.
pub(crate) const THREAD: &str =
    "G21 G94 G97 S600 M3\nG0 X30. Z5.\nG1 Z2. F200\nG32 Z-30. F1.5\nG0 X35.\nG1 Z-60. F200\nM30\n";
const PLAIN: &str = "G21 G94 G97 S1000 M3\nG0 X30. Z2.\nG1 Z-20. F200\nM30\n";

struct Live {
    requests: mpsc::Sender<RunRequest>,
    responses: Streaming<RunResponse>,
    started: RunStarted,
    lines: Vec<u32>,
    decisions: Vec<Decision>,
    changes: Vec<RunFeedChange>,
    durable_batch: Option<u64>,
}

impl Live {
    async fn open(server: &Server, target: Target, start_index: u64) -> Result<Self, Status> {
        let mut client = RunsClient::new(server.connect().await.channel);
        let (requests, outgoing) = mpsc::channel(256);
        let start = Request::Start(RunStart { target: Some(target), start_index, ..Default::default() });
        requests.send(RunRequest { message: Some(start) }).await.expect("a first message");
        let mut responses = client.run(ReceiverStream::new(outgoing)).await?.into_inner();
        let Some(Message::Started(started)) = responses.message().await?.and_then(|it| it.message) else {
            panic!("a run begins with its start")
        };
        let (lines, decisions, changes) = (vec![0; start_index as usize], Vec::new(), started.feed_changes.clone());
        Ok(Self { requests, responses, started, lines, decisions, changes, durable_batch: None })
    }

    async fn say(&self, message: Request) {
        // A run that has ended listens no more, and says so in its answers.
        let _ = self.requests.send(RunRequest { message: Some(message) }).await;
    }

    /// The end, where the next message is that.
    async fn next(&mut self) -> Option<RunEnded> {
        let response = self.responses.message().await.expect("no error").expect("a run says that it ends");
        match response.message.expect("a message") {
            Message::Chunk(chunk) => {
                for run in &chunk.line_runs {
                    self.lines.extend(std::iter::repeat_n(run.line, run.count as usize));
                }
            }
            Message::Decision(decision) => self.decisions.push(decision),
            Message::Ack(ack) => self.durable_batch = Some(ack.durable_batch),
            Message::FeedChange(change) => self.changes.push(change),
            Message::CommandRefused(refused) => panic!("nothing was commanded: {refused:?}"),
            Message::SpindleRequest(request) => panic!("no spindle speed was decided: {request:?}"),
            Message::Ended(ended) => return Some(ended),
            Message::Started(started) => panic!("a second start {started:?}"),
        }
        None
    }

    /// Asks for setpoints up to the first of this line, and a hundred more, without having taken any of those.
    async fn reach(&mut self, line: u32) {
        while self.lines.last().is_none_or(|last| *last < line) {
            self.say(Request::Receipt(RunReceipt { received: self.lines.len() as u64 })).await;
            let end_index = self.lines.len() as u64 + 100;
            self.say(Request::Credit(RunCredit { end_index })).await;
            while (self.lines.len() as u64) < end_index {
                assert_eq!(self.next().await, None);
            }
        }
    }

    /// Sends telemetry; the decision on it.
    async fn judge(&mut self, batch: TelemetryBatch) -> (DecisionAction, DecisionReason) {
        let sequence = batch.sequence;
        let before = self.decisions.len();
        self.say(Request::Batch(batch)).await;
        while self.durable_batch < Some(sequence) {
            assert_eq!(self.next().await, None);
        }
        let [decision] = &self.decisions[before..] else { panic!("{:?}", &self.decisions[before..]) };
        let outcome = decision.outcome.expect("an outcome");
        (outcome.action(), outcome.reason())
    }

    async fn finish(&mut self) -> RunEnded {
        self.say(Request::Credit(RunCredit { end_index: u64::MAX })).await;
        loop {
            let received = self.lines.len() as u64;
            self.say(Request::Receipt(RunReceipt { received })).await;
            if let Some(ended) = self.next().await {
                return ended;
            }
        }
    }
}

/// The samples of ten batches as one: a whole window, and the baseline in the first.
fn window(number: u64) -> TelemetryBatch {
    let mut whole = batch(number * 10);
    for sequence in number * 10 + 1..number * 10 + 10 {
        let TelemetryBatch { time_ns, tool, contact, .. } = batch(sequence);
        let (tool, all) = (tool.expect("a sensor"), whole.tool.as_mut().expect("a sensor"));
        whole.time_ns.extend(time_ns);
        all.x.extend(tool.x);
        all.y.extend(tool.y);
        whole.contact.extend(contact);
    }
    TelemetryBatch { sequence: number, ..whole }
}

/// Everything up to the first change as one batch, so that no silence can come between.
fn three_windows() -> TelemetryBatch {
    let mut all = window(0);
    for more in [window(1), window(2)] {
        let (tool, all_tool) = (more.tool.expect("a sensor"), all.tool.as_mut().expect("a sensor"));
        all.time_ns.extend(more.time_ns);
        all_tool.x.extend(tool.x);
        all_tool.y.extend(tool.y);
        all.contact.extend(more.contact);
    }
    all
}

async fn monitored(server: &Server, program: &str, config: MonitoringConfig) -> String {
    let job = server.connect().await.submit(program).await.job.name;
    let mut telemetry = TelemetryClient::new(server.connect().await.channel);
    let request = SetMonitoringRequest { job: job.clone(), config: Some(config) };
    telemetry.set_monitoring(request).await.expect("the configuration is valid");
    job
}

async fn is_replayed(server: &Server, run: &str) {
    let request = ReplayRunRequest { run: run.to_owned(), start_index: 0 };
    let replayed = RunsClient::new(server.connect().await.channel).replay_run(request).await;
    let replayed = replayed.expect("a replay").into_inner();
    assert!(replayed.identical && replayed.decision_count > 0, "{replayed:?}");
}

#[tokio::test]
async fn decisions_hold_while_a_thread_is_handed_out_and_the_run_knows_it_by_itself() {
    let mut server = Server::start(FEEDWAVE).await;
    let job = monitored(&server, THREAD, config()).await;
    let mut run = Live::open(&server, Target::Job(job), 0).await.expect("a run");
    let name = run.started.run.clone();
    let change = (DecisionAction::Change, DecisionReason::FeedAboveLimit);
    let held = (DecisionAction::Hold, DecisionReason::Threading);

    run.judge(window(0)).await;
    run.reach(3).await;
    // A window is judged when the first sample after it has come.
    run.say(Request::Batch(window(1))).await;
    assert_eq!(run.judge(window(2)).await, change);
    run.reach(4).await;
    let changes = run.changes.clone();
    assert_eq!(run.judge(window(3)).await, held, "line 4 is a thread");

    // Killed within the pass, the run knows it still.
    let handed_out = run.lines.len() as u64;
    drop(run);
    server = server.kill().await.start().await;
    let mut run = Live::open(&server, Target::Run(name.clone()), handed_out).await.expect("the run goes on");
    assert_eq!(run.changes, changes);
    assert_eq!(run.judge(window(4)).await, held);
    run.reach(6).await;
    assert_eq!(run.changes, changes, "nothing changed in the thread");
    run.say(Request::Receipt(RunReceipt { received: run.lines.len() as u64 })).await;
    assert_eq!(run.judge(window(5)).await, held, "this window began in the pass");
    let change = (DecisionAction::Change, DecisionReason::FeedBelowLimit);
    assert_eq!(run.judge(window(6)).await, change, "the pass is over, the deflection of this window small");
    assert_eq!(run.finish().await.state(), RunState::Finished);
    drop(run);
    is_replayed(&server, &name).await;
}

// One run for each case, which goes from the first batch to the fallback.
#[tokio::test]
async fn telemetry_that_stops_while_cutting_brings_the_fallback_whether_the_client_is_there_or_not() {
    let server = Server::start(FEEDWAVE).await;
    let cases = [
        (SilenceFallback::Hold, None),
        (SilenceFallback::Full, Some((1.0, FeedChangeCause::Decision))),
        (SilenceFallback::Stop, Some((0.0, FeedChangeCause::Stop))),
    ];
    for ((fallback, expected), client_goes) in cases.into_iter().flat_map(|case| [(case, false), (case, true)]) {
        let mut config = config();
        config.quality.as_mut().expect("demands").silence_s = Some(0.05);
        config.rules.as_mut().expect("rules").fallback = fallback.into();
        let job = monitored(&server, PLAIN, config).await;
        let mut run = Live::open(&server, Target::Job(job), 0).await.expect("a run");
        let name = run.started.run.clone();
        let mut watching = TelemetryClient::new(server.connect().await.channel);
        let request = WatchDecisionsRequest { after: Some(0), run: name.clone(), ..Default::default() };
        let mut watched = watching.watch_decisions(request).await.expect("decisions").into_inner();
        run.say(Request::Credit(RunCredit { end_index: 500 })).await;
        while run.lines.len() < 500 {
            assert_eq!(run.next().await, None);
        }
        run.say(Request::Batch(three_windows())).await;
        while run.durable_batch.is_none() {
            assert_eq!(run.next().await, None);
        }
        let slower = run.changes.last().copied().expect("a change");
        assert_eq!((slower.setpoint_index, slower.cause()), (500, FeedChangeCause::Decision));
        let run = if client_goes {
            drop(run);
            None
        } else {
            Some(run)
        };
        // It comes by the service's own clock.
        let silence = loop {
            let decision = watched.message().await.expect("watching").and_then(|it| it.decision).expect("a decision");
            let outcome = decision.outcome.expect("an outcome");
            if outcome.reason() == DecisionReason::Silence {
                break outcome;
            }
        };
        let expected_action = match fallback {
            SilenceFallback::Full => DecisionAction::Change,
            SilenceFallback::Stop => DecisionAction::Stop,
            _ => DecisionAction::Hold,
        };
        assert_eq!(silence.action(), expected_action, "{fallback:?}");
        // What acts on the setpoints was durable together with the decision.
        let mut run = match run {
            Some(run) => run,
            None => Live::open(&server, Target::Run(name.clone()), 500).await.expect("the run is open"),
        };
        let ended = run.finish().await;
        let change = run.changes.iter().find(|change| change.setpoint_index > 500);
        let expected_end = if fallback == SilenceFallback::Stop { RunState::Stopped } else { RunState::Finished };
        assert_eq!(ended.state(), expected_end, "{fallback:?}, gone: {client_goes}");
        assert_eq!(change.map(|change| (change.ratio, change.cause())), expected, "gone: {client_goes}");
        drop(run);
        is_replayed(&server, &name).await;
    }
}

/// A run that is in its thread behind a slower feed, and gets no more telemetry; `None` where the silence was noticed before.
async fn silent_in_the_thread(server: &Server, silence_s: f64) -> Option<Live> {
    let mut config = config();
    config.quality.as_mut().expect("demands").silence_s = Some(silence_s);
    config.rules.as_mut().expect("rules").fallback = SilenceFallback::Full.into();
    let job = monitored(server, THREAD, config).await;
    let mut run = Live::open(server, Target::Job(job), 0).await.expect("a run");
    run.reach(3).await;
    run.say(Request::Batch(three_windows())).await;
    while run.changes.is_empty() {
        assert_eq!(run.next().await, None);
    }
    run.reach(4).await;
    while !run.decisions.iter().any(in_silence) {
        assert_eq!(run.next().await, None);
    }
    run.decisions.last().is_some_and(|decision| reason(decision) == DecisionReason::Threading).then_some(run)
}

fn in_silence(decision: &Decision) -> bool {
    let evidence = decision.inputs.as_ref().and_then(|inputs| inputs.evidence.as_ref());
    matches!(evidence, Some(Evidence::SilenceNs(_)))
}

fn reason(decision: &Decision) -> DecisionReason {
    decision.outcome.expect("an outcome").reason()
}

#[tokio::test]
async fn telemetry_that_stops_in_a_thread_brings_the_fallback_behind_the_pass() {
    let server = Server::start(FEEDWAVE).await;
    // Where the thread is reached later than that, a longer one is tried.
    let mut silent = None;
    for silence_s in [0.05, 0.5, 5.0, 50.0] {
        silent = silent_in_the_thread(&server, silence_s).await;
        if silent.is_some() {
            break;
        }
    }
    let mut run = silent.expect("a silence in the thread");
    let name = run.started.run.clone();
    let in_the_pass = run.lines.len() as u64;
    assert_eq!(run.changes.len(), 1, "the pass is cut at the feed that it has");
    assert_eq!(run.finish().await.state(), RunState::Finished);
    assert_eq!(run.decisions.last().map(reason), Some(DecisionReason::Silence));
    let [_, full] = run.changes.as_slice() else { panic!("{:?}", run.changes) };
    assert_eq!((full.ratio, full.cause()), (1.0, FeedChangeCause::Decision));
    let pass_end = run.lines.iter().rposition(|line| *line == 4).expect("a pass") as u64;
    assert!(in_the_pass < pass_end && pass_end < full.setpoint_index, "{pass_end}, {full:?}");
    drop(run);
    is_replayed(&server, &name).await;
}
