//! What machines do: seen while a run goes on, and as the log has it after a kill; conditions until they are acknowledged.

use bytes::Bytes;
use feedwave_contract::proto::machine_event::Event;
use feedwave_contract::proto::machines_client::MachinesClient;
use feedwave_contract::proto::run_request::Message as Request;
use feedwave_contract::proto::run_response::Message;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::runs_client::RunsClient;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    AcknowledgeConditionRequest, Availability, ConditionSeverity, CreateMachineRequest, DeleteJobRequest,
    DeleteMachineRequest, Escalation, Execution, GetMachineRequest, IngestEnd, IngestRequest, IngestStart, Machine,
    MachineEvent, MachineState, MonitoringConfig, OverrideBounds, RunCredit, RunReceipt, RunRequest, RunResponse,
    RunStart, SetMonitoringRequest, TelemetryBatch, WatchStateRequest, WatchStateResponse, ingest_request,
    ingest_start,
};
use feedwave_tests::{Server, patiently};
use http::StatusCode;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Status, Streaming};

use crate::FEEDWAVE;
use crate::live_runs::{PART, batch, config};

pub(crate) async fn monitored(server: &Server, config: MonitoringConfig) -> String {
    let job = server.connect().await.submit(PART).await.job.name;
    let mut telemetry = TelemetryClient::new(server.connect().await.channel);
    let request = SetMonitoringRequest { job: job.clone(), config: Some(config) };
    telemetry.set_monitoring(request).await.expect("the configuration is valid");
    job
}

/// A request in a tenant; without a name in the default one.
pub(crate) fn in_tenant<T>(message: T, tenant: &str) -> tonic::Request<T> {
    let mut request = tonic::Request::new(message);
    if !tenant.is_empty() {
        request.metadata_mut().insert("x-feedwave-tenant", tenant.parse().expect("a name"));
    }
    request
}

/// A run, and what it was told.
pub(crate) struct Live {
    requests: mpsc::Sender<RunRequest>,
    responses: Streaming<RunResponse>,
    pub(crate) run: String,
    pub(crate) received: u64,
}

impl Live {
    pub(crate) async fn open(server: &Server, target: Target, start_index: u64) -> Self {
        Self::open_in(server, "", target, start_index).await
    }

    /// Opens a run in a tenant; without a name in the default one.
    pub(crate) async fn open_in(server: &Server, tenant: &str, target: Target, start_index: u64) -> Self {
        let mut client = RunsClient::new(server.connect().await.channel);
        let (requests, outgoing) = mpsc::channel(256);
        let start = Request::Start(RunStart { target: Some(target), start_index, ..Default::default() });
        requests.send(RunRequest { message: Some(start) }).await.expect("a first message");
        let mut responses =
            client.run(in_tenant(ReceiverStream::new(outgoing), tenant)).await.expect("a run").into_inner();
        let first = responses.message().await.expect("an answer").and_then(|response| response.message);
        let Some(Message::Started(started)) = first else { panic!("a run begins with its start, not {first:?}") };
        Self { requests, responses, run: started.run, received: start_index }
    }

    pub(crate) async fn say(&self, message: Request) {
        let _ = self.requests.send(RunRequest { message: Some(message) }).await;
    }

    async fn next(&mut self) -> Message {
        let response = self.responses.message().await.expect("no error").expect("the stream goes on");
        let message = response.message.expect("a message");
        if let Message::Chunk(chunk) = &message {
            self.received += u64::from(chunk.count);
        }
        message
    }

    /// Asks for setpoints up to this one.
    pub(crate) async fn reach(&mut self, end_index: u64) {
        self.say(Request::Credit(RunCredit { end_index })).await;
        while self.received < end_index {
            self.next().await;
        }
    }

    pub(crate) async fn take(&self, received: u64) {
        self.say(Request::Receipt(RunReceipt { received })).await;
    }

    /// Sends telemetry, and waits until it is durable.
    pub(crate) async fn measure(&mut self, batches: std::ops::Range<u64>) {
        for sequence in batches.clone() {
            self.say(Request::Batch(batch(sequence))).await;
        }
        loop {
            if let Message::Ack(ack) = self.next().await
                && ack.durable_batch + 1 >= batches.end
            {
                return;
            }
        }
    }

    pub(crate) async fn finish(mut self) {
        self.say(Request::Credit(RunCredit { end_index: u64::MAX })).await;
        while !matches!(self.next().await, Message::Ended(_)) {
            self.take(self.received).await;
        }
    }
}

/// States of a machine as they come.
pub(crate) struct Watch(Streaming<WatchStateResponse>);

impl Watch {
    pub(crate) async fn open(server: &Server, name: &str) -> Self {
        let mut machines = MachinesClient::new(server.connect().await.channel);
        let request = WatchStateRequest { name: name.to_owned() };
        Self(machines.watch_state(request).await.expect("machines are watched").into_inner())
    }

    async fn next(&mut self) -> WatchStateResponse {
        patiently(self.0.message()).await.expect("no error").expect("the watch goes on")
    }

    /// The first state that is as wanted.
    pub(crate) async fn until(&mut self, wanted: impl Fn(&MachineState) -> bool) -> MachineState {
        loop {
            let state = self.next().await.state.expect("a state");
            if wanted(&state) {
                return state;
            }
        }
    }
}

fn codes(state: &MachineState) -> Vec<&str> {
    state.conditions.iter().map(|condition| condition.code.as_str()).collect()
}

// One run from its first setpoint over a kill to its end, and what every reader has of it at each step.
#[tokio::test]
async fn a_live_run_is_seen_as_it_goes_and_as_the_log_has_it_after_a_kill() {
    let server = Server::start(FEEDWAVE).await;
    let job = monitored(&server, config()).await;
    let web = server.web();
    let idle = web.get("/v1/machines/lathe/state").await;
    assert_eq!(idle.status, StatusCode::OK);
    assert_eq!(idle.json()["execution"], "EXECUTION_IDLE");
    let tag = idle.header("etag").to_owned();
    let same = web.send("GET", "/v1/machines/lathe/state", &[("if-none-match", &tag)], Bytes::new()).await;
    assert_eq!(same.status, StatusCode::NOT_MODIFIED);

    let mut watch = Watch::open(&server, "machines/lathe").await;
    assert_eq!(watch.next().await.state.expect("a state").execution(), Execution::Idle);
    let mut live = Live::open(&server, Target::Job(job.clone()), 0).await;
    let ready = watch.until(|state| state.availability() == Availability::Available).await;
    assert_eq!(ready.execution(), Execution::Ready);
    live.reach(600).await;
    live.take(500).await;
    // Baseline, and a window in which the tool deflects too far.
    live.measure(0..25).await;
    let is_seen = |state: &MachineState| {
        let run = state.run.as_ref().expect("a run");
        run.progress.is_some_and(|progress| progress.taken == 500) && run.process.is_some()
    };
    let state = watch.until(is_seen).await;
    assert_eq!((state.execution(), state.availability()), (Execution::Running, Availability::Available));
    let run = state.run.clone().expect("a run");
    assert_eq!((&run.run, &run.job), (&live.run, &job));
    let commanded = run.commanded.as_ref().expect("a setpoint was taken");
    assert!((1..=7).contains(&commanded.line) && commanded.axes.len() == 2, "{commanded:?}");
    assert!((commanded.spindle_rev_per_min - 1_000.0).abs() < 1.0, "{commanded:?}");
    let progress = run.progress.expect("how far it is");
    assert!(progress.ratio > 0.0 && progress.ratio < 1.0 && progress.remaining_s.is_some(), "{progress:?}");
    let process = run.process.as_ref().expect("a window");
    assert!(process.value.is_some_and(|value| value > process.upper), "{process:?}");
    assert_eq!((process.lower, process.upper, process.unit.as_str()), (0.003, 0.01, "mm"));
    let last = run.last_decision.as_ref().expect("a decision");
    assert_eq!(last.outcome.and_then(|outcome| outcome.after).map(|after| after.feed), Some(0.5));
    // The change acts behind what was handed out: at the setpoint taken the feed is the programmed one.
    assert_eq!(run.overrides.map(|overrides| overrides.feed), Some(1.0));
    let condition = state.conditions.iter().find(|condition| condition.code == "FEED_ABOVE_LIMIT");
    let condition = condition.unwrap_or_else(|| panic!("{:?}", codes(&state)));
    assert_eq!(
        (condition.severity(), condition.limit, condition.value),
        (ConditionSeverity::Warning, Some(0.01), process.value)
    );

    // The HTTP port says the same, of the machine, of all machines, and of the run.
    let shown = web.get("/v1/machines/lathe/state").await.json();
    assert_eq!(shown["run"]["run"], live.run);
    assert_eq!(shown["run"]["progress"]["taken"], "500");
    let list = web.get("/v1/machines").await.json();
    let names: Vec<_> = list["states"].as_array().expect("states").iter().map(|state| &state["machine"]).collect();
    assert_eq!(names, ["machines/lathe", "machines/mill"]);
    let of_run = web.get(&format!("/v1/{}", live.run)).await.json();
    assert_eq!(of_run["state"], "RUN_STATE_OPEN");
    assert_eq!(of_run["activity"]["execution"], "EXECUTION_RUNNING");

    // In force once the setpoint is taken from which it acts.
    live.reach(1_400).await;
    live.take(live.received).await;
    let half = |state: &MachineState| {
        state.run.as_ref().and_then(|run| run.overrides).is_some_and(|overrides| overrides.feed == 0.5)
    };
    let halved = watch.until(half).await.run.expect("a run");

    let decided = halved.last_decision.expect("a decision").number;
    let server = server.kill().await.start().await;
    let web = server.web();
    let after = web.get("/v1/machines/lathe/state").await.json();
    assert_eq!(after["execution"], "EXECUTION_INTERRUPTED");
    assert_eq!(after["availability"], "AVAILABILITY_UNAVAILABLE");
    assert_eq!(after["run"]["run"], live.run);
    assert_eq!(after["run"]["lastDecision"]["number"], decided.to_string());
    for value in ["commanded", "process", "overrides", "programmedRevPerMin"] {
        assert!(after["run"].get(value).is_none(), "{value} is not known: {after}");
    }

    // Taken up again, it goes on to its end.
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let again = Live::open(&server, Target::Run(live.run.clone()), live.received).await;
    again.finish().await;
    let done = watch.until(|state| state.execution() == Execution::Finished && state.finished_runs == 1).await;
    assert_eq!(done.availability(), Availability::Unavailable);
    assert_eq!(done.run.and_then(|run| run.progress).map(|progress| progress.ratio), Some(1.0));
    let server = server.kill().await.start().await;
    let after = server.web().get("/v1/machines/lathe/state").await.json();
    assert_eq!((&after["execution"], &after["finishedRuns"]), (&"EXECUTION_FINISHED".into(), &"1".into()));

    // With its job the run is gone.
    let mut clients = server.connect().await;
    clients.jobs.delete_job(DeleteJobRequest { name: job, ..Default::default() }).await.expect("the job is deleted");
    let after = server.web().get("/v1/machines/lathe/state").await.json();
    assert_eq!(after["execution"], "EXECUTION_IDLE");
    assert!(after.get("run").is_none(), "{after}");
}

#[tokio::test]
async fn a_run_that_broke_off_has_no_values() {
    let server = Server::start(FEEDWAVE).await;
    let job = monitored(&server, config()).await;
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let mut live = Live::open(&server, Target::Job(job), 0).await;
    live.reach(100).await;
    live.take(100).await;
    watch.until(|state| state.execution() == Execution::Running).await;
    drop(live);
    let state = watch.until(|state| state.execution() == Execution::Interrupted).await;
    assert_eq!(state.availability(), Availability::Unavailable);
    let run = state.run.expect("a run");
    assert!(run.commanded.is_none() && run.overrides.is_none() && run.process.is_none(), "{run:?}");
    assert_eq!(run.progress.map(|progress| (progress.taken, progress.remaining_s)), Some((100, None)));
}

/// Telemetry of a machine that has its setpoints from elsewhere.
pub(crate) struct Ingest {
    requests: mpsc::Sender<IngestRequest>,
    pub(crate) run: String,
    responses: Streaming<feedwave_contract::proto::IngestResponse>,
}

impl Ingest {
    pub(crate) async fn open(server: &Server, job: String) -> Self {
        Self::open_at(server, ingest_start::Target::Job(job)).await
    }

    pub(crate) async fn open_at(server: &Server, target: ingest_start::Target) -> Self {
        use feedwave_contract::proto::ingest_response::Message;
        let mut client = TelemetryClient::new(server.connect().await.channel);
        let (requests, outgoing) = mpsc::channel(256);
        let start = IngestStart { target: Some(target), sensor_time_ns: None, recording: None };
        let start = IngestRequest { message: Some(ingest_request::Message::Start(start)) };
        requests.send(start).await.expect("a first message");
        let mut responses = client.ingest(ReceiverStream::new(outgoing)).await.expect("a run").into_inner();
        let first = responses.message().await.expect("an answer").and_then(|response| response.message);
        let Some(Message::Started(started)) = first else { panic!("a run begins with its start, not {first:?}") };
        Self { requests, run: started.run, responses }
    }

    /// Ends the run.
    pub(crate) async fn end(&self) {
        let message = Some(ingest_request::Message::End(IngestEnd {}));
        self.requests.send(IngestRequest { message }).await.expect("the service listens");
    }

    /// The error that ends the stream.
    pub(crate) async fn error(&mut self) -> Status {
        loop {
            match patiently(self.responses.message()).await {
                Ok(response) => assert!(response.is_some(), "an end without a reason"),
                Err(status) => return status,
            }
        }
    }

    pub(crate) async fn send(&self, batch: TelemetryBatch) {
        let message = Some(ingest_request::Message::Batch(batch));
        self.requests.send(IngestRequest { message }).await.expect("the service listens");
    }
}

/// Telemetry with an escalation that holds the feed, and the state then.
async fn held(server: &Server, watch: &mut Watch) -> (Ingest, MachineState) {
    let mut config = config();
    let rules = config.rules.as_mut().expect("rules");
    rules.feed_bounds = Some(OverrideBounds { lower: 0.5, upper: 1.5 });
    rules.escalation = Some(Escalation { windows: Some(2), ..Default::default() });
    let job = monitored(server, config).await;
    let ingest = Ingest::open(server, job).await;
    for sequence in 0..50 {
        ingest.send(batch(sequence)).await;
    }
    let held = watch.until(|state| state.execution() == Execution::Held).await;
    (ingest, held)
}

#[tokio::test]
async fn a_condition_says_what_was_judged_also_after_a_kill() {
    let server = Server::start(FEEDWAVE).await;
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let (_ingest, held) = held(&server, &mut watch).await;
    let [condition, ..] = held.conditions.as_slice() else { panic!("{held:?}") };
    let value = condition.value.expect("what was judged");
    assert!((value - 0.02).abs() < 1e-3, "{condition:?}");
    assert_eq!((condition.limit, condition.unit.as_str()), (Some(0.01), "mm"));
    let sentence = format!("deviation {value:.4} mm stayed above 0.0100 mm at the lower feed bound: the feed is held");
    assert_eq!(condition.message, sentence);

    let server = server.kill().await.start().await;
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let after = watch.until(|_| true).await;
    assert_eq!(after.conditions.first(), Some(condition));
    // Whoever takes the run up changes nothing of it.
    let run = ingest_start::Target::Run(condition.run.clone());
    let _ingest = Ingest::open_at(&server, run).await;
    let after = watch.until(|state| state.execution() == Execution::Held).await;
    assert_eq!(after.conditions.first(), Some(condition));
}

#[tokio::test]
async fn a_condition_is_shown_until_it_was_acknowledged_and_the_machine_resumed() {
    let server = Server::start(FEEDWAVE).await;
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let (ingest, held) = held(&server, &mut watch).await;
    let [condition, ..] = held.conditions.as_slice() else { panic!("{held:?}") };
    assert_eq!((condition.code.as_str(), condition.severity()), ("ABOVE_LIMIT_AT_BOUND", ConditionSeverity::Fault));
    assert!(condition.needs_acknowledgement && condition.acknowledge_time.is_none(), "{condition:?}");
    assert_eq!(condition.run, ingest.run);

    let mut telemetry = TelemetryClient::new(server.connect().await.channel);
    let request = AcknowledgeConditionRequest {
        run: ingest.run.clone(),
        decision_number: condition.decision_number,
        acknowledged_by: "Ada".to_owned(),
        ..Default::default()
    };
    telemetry.acknowledge_condition(request).await.expect("it is acknowledged");
    let is_acknowledged =
        |state: &MachineState| state.conditions.iter().any(|condition| condition.acknowledged_by == "Ada");
    let seen = watch.until(is_acknowledged).await;
    assert_eq!(seen.execution(), Execution::Held, "only the machine itself resumes");
    let resume = MachineEvent { event: Some(Event::Resume(true)) };
    ingest.send(TelemetryBatch { events: vec![resume], ..batch(50) }).await;
    watch.until(|state| !codes(state).contains(&"ABOVE_LIMIT_AT_BOUND")).await;
}

#[tokio::test]
async fn machines_come_and_go() {
    let server = Server::start(FEEDWAVE).await;
    let mut machines = MachinesClient::new(server.connect().await.channel);
    let mill = GetMachineRequest { name: "machines/mill".to_owned() };
    let mill = machines.get_machine(mill).await.expect("a machine").into_inner().machine.expect("a machine");
    let mut watch = Watch::open(&server, "").await;
    for _ in 0..2 {
        watch.next().await;
    }
    let machine = Machine { display_name: "Cell 7".to_owned(), profile: mill.profile, ..Default::default() };
    let request = CreateMachineRequest { machine_id: "cell-7".to_owned(), machine: Some(machine) };
    machines.create_machine(request).await.expect("a machine is made");
    let made = watch.next().await;
    assert_eq!(made.state.expect("a state").display_name, "Cell 7");
    let request = DeleteMachineRequest { name: "machines/cell-7".to_owned(), ..Default::default() };
    machines.delete_machine(request).await.expect("the machine is deleted");
    let gone = watch.next().await;
    assert!(gone.deleted && gone.state.expect("its name").machine == "machines/cell-7");
    let web = server.web();
    assert_eq!(web.get("/v1/machines/cell-7/state").await.status, StatusCode::NOT_FOUND);
    assert_eq!(web.get("/v1/machines/Cell/state").await.status, StatusCode::BAD_REQUEST);
    let page = web.get("/v1/machines?pageSize=1").await.json();
    assert_eq!(page["states"][0]["machine"], "machines/lathe");
    let token = page["nextPageToken"].as_str().expect("a token");
    let next = web.get(&format!("/v1/machines?pageSize=1&pageToken={token}")).await.json();
    assert_eq!((&next["states"][0]["machine"], &next["nextPageToken"]), (&"machines/mill".into(), &"".into()));
}
