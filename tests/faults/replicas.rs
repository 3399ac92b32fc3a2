//! Three replicas behind a plain TCP balancer on one database of a PostgreSQL server, with everything at once: jobs,
//! watchers, streams and live runs, while replicas are killed, are cut off from the database, have a clock that jumps, and
//! the database itself crashes and comes back. A ledger of what was acknowledged proves that nothing is lost, done twice or
//! out of order. `FEEDWAVE_REPLICA_FAULTS` says how many faults.

use std::collections::{BTreeMap, HashMap};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::stream_setpoints_request::Start;
use feedwave_contract::proto::stream_setpoints_response::Message;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    GetJobRequest, GetRunRequest, JobState, ListJobsRequest, RunState, SetMonitoringRequest, StreamSetpointsRequest,
    WatchJobsRequest,
};
use feedwave_tests::{
    Chance, Clients, Database, Gate, Home, LIVE_PART, Left, RunLedger, Server, live_config, long_dwell, patiently,
    shared_store, stream,
};
use tokio::sync::watch;
use tokio::task::JoinSet;
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Status};

use crate::FEEDWAVE;
use crate::library::Faults;

/// Faults where nothing else is asked for.
const FAULTS: u64 = 9;
/// Clients that create jobs.
const CREATORS: u64 = 2;
/// Pause of a client that was not answered.
const PAUSE: Duration = Duration::from_millis(50);

/// A replica, and its wire to the database.
struct Replica {
    server: Option<Server>,
    wire: Gate,
}

impl Replica {
    async fn start(store: &Database, environment: Vec<(String, String)>) -> Self {
        let (before, rest) = store.uri.split_once("127.0.0.1:").expect("a server of this machine");
        let (port, rest) = rest.split_once('/').expect("a database");
        let database = SocketAddr::from(([127, 0, 0, 1], port.parse().expect("a port")));
        let wire = Gate::new(vec![database]).await;
        let mut through_wire = store.clone();
        through_wire.uri = format!("{before}{}/{rest}&connect_timeout_s=2&statement_timeout_s=2", wire.address);
        let mut home = Home::on(FEEDWAVE, &through_wire, "");
        home.set_environment(environment);
        Self { server: Some(home.start().await), wire }
    }

    fn address(&self) -> SocketAddr {
        self.server.as_ref().expect("a server").grpc
    }

    async fn kill(&mut self) {
        let home = self.server.take().expect("a server").kill().await;
        self.server = Some(home.start().await);
    }
}

/// A connection through the balancer, once there is one.
async fn connect(balancer: SocketAddr) -> Channel {
    let endpoint = Endpoint::from_shared(format!("http://{balancer}")).expect("a valid address");
    loop {
        if let Ok(channel) = endpoint.connect().await {
            return channel;
        }
        tokio::time::sleep(PAUSE).await;
    }
}

/// What all clients share.
struct Storm {
    balancer: SocketAddr,
    /// Calls that were answered and messages that came.
    answered: watch::Sender<u64>,
    /// Whether all faults are over.
    over: watch::Receiver<bool>,
}

impl Storm {
    fn answered(&self) {
        self.answered.send_modify(|count| *count += 1);
    }

    fn is_over(&self) -> bool {
        *self.over.borrow()
    }

    async fn clients(&self) -> Clients {
        Clients::of(connect(self.balancer).await)
    }

    /// Asks again, by another connection each time, until it is answered.
    async fn ask<T, F>(&self, mut call: impl FnMut(Clients) -> F) -> T
    where
        F: Future<Output = Result<T, Status>>,
    {
        patiently(async {
            loop {
                match call(self.clients().await).await {
                    Ok(answer) => {
                        self.answered();
                        return answer;
                    }
                    Err(_) => tokio::time::sleep(PAUSE).await,
                }
            }
        })
        .await
    }

    /// Creates a job under a request id, however often it takes; its name.
    async fn create(&self, program: Bytes, request_id: String) -> String {
        let create = |mut clients: Clients| {
            let (program, request_id) = (program.clone(), request_id.clone());
            async move { clients.create_from(Source::InlineProgram(program), &request_id).await }
        };
        self.ask(create).await.name
    }
}

/// Creates jobs under request ids of its own, each until it is acknowledged; their names.
async fn create(storm: Arc<Storm>, creator: u64) -> BTreeMap<String, String> {
    let mut ledger = BTreeMap::new();
    while !storm.is_over() {
        let number = ledger.len();
        let request_id = format!("storm-{creator}-{number}");
        let program = Bytes::from(format!("G21\nG0 X{creator}. Z{number}.\nM30\n"));
        let name = storm.create(program, request_id.clone()).await;
        ledger.insert(request_id, name);
    }
    ledger
}

/// Every event of jobs, each once and in order, until so many different jobs are ready.
async fn watch_jobs(storm: Arc<Storm>, mut expected: watch::Receiver<Option<usize>>) -> Vec<(u64, String, JobState)> {
    let mut seen: Vec<(u64, String, JobState)> = Vec::new();
    let mut ready = 0;
    loop {
        let after = seen.last().map_or(0, |event| event.0);
        let request = WatchJobsRequest { after: Some(after), job: String::new() };
        let mut clients = storm.clients().await;
        let Ok(events) = clients.jobs.watch_jobs(request).await else { continue };
        let mut events = events.into_inner();
        loop {
            if expected.borrow().is_some_and(|expected| ready >= expected) {
                return seen;
            }
            let message = tokio::select! {
                message = events.message() => message,
                _ = expected.changed() => continue,
            };
            let Ok(Some(message)) = message else { break };
            let Some(event) = message.event else { continue };
            assert!(seen.last().is_none_or(|last| last.0 < event.sequence), "{event:?} after {:?}", seen.last());
            ready += usize::from(event.state() == JobState::Ready);
            seen.push((event.sequence, event.job.clone(), event.state()));
            storm.answered();
        }
    }
}

/// Streams a whole job again and again, each time in as many pieces as it takes, and holds it against what it must be.
async fn read_streams(storm: Arc<Storm>, job: String, whole: Arc<Vec<Vec<u64>>>) -> u64 {
    let mut streams = 0;
    let length = whole[0].len();
    while !storm.is_over() {
        let mut index = 0;
        while index < length {
            let request = StreamSetpointsRequest {
                job: job.clone(),
                start: Some(Start::StartIndex(index as u64)),
                ..StreamSetpointsRequest::default()
            };
            let mut clients = storm.clients().await;
            let Ok(messages) = clients.setpoints.stream_setpoints(request).await else {
                tokio::time::sleep(PAUSE).await;
                continue;
            };
            let mut messages = messages.into_inner();
            while let Ok(Some(message)) = messages.message().await {
                let Some(Message::Chunk(chunk)) = message.message else { continue };
                assert_eq!(chunk.first_index, index as u64, "chunks follow each other");
                let end = index + chunk.count as usize;
                for (column, whole) in chunk.columns.iter().zip(whole.iter()) {
                    let same = column.values.iter().map(|value| value.to_bits()).eq(whole[index..end].iter().copied());
                    assert!(same, "setpoints {index} to {end}");
                }
                index = end;
                storm.answered();
            }
        }
        streams += 1;
    }
    streams
}

/// Runs one job after another to its end, on whatever replica; what is known of each run, and how often it broke.
async fn run_live(storm: Arc<Storm>) -> (Vec<(String, RunLedger)>, u64) {
    let (mut runs, mut breaks) = (Vec::new(), 0);
    while !storm.is_over() || runs.is_empty() {
        let job = storm.create(Bytes::from(LIVE_PART), format!("live-{}", runs.len())).await;
        let state = |clients| job_state(clients, job.clone());
        while patiently(storm.ask(state)).await != JobState::Ready {
            tokio::time::sleep(PAUSE).await;
        }
        let request = SetMonitoringRequest { job: job.clone(), config: Some(live_config()) };
        storm.ask(|clients| set_monitoring(clients, request.clone())).await;
        let mut ledger = RunLedger::default();
        loop {
            // A few messages at a time, so that faults find it in the middle.
            match patiently(ledger.drive(storm.clients().await.channel, &job, 40)).await {
                Left::Ended => break,
                Left::Enough => storm.answered(),
                Left::Broken(_) => {
                    breaks += 1;
                    if !ledger.run().is_empty() && has_ended(&storm, ledger.run()).await {
                        break;
                    }
                    tokio::time::sleep(PAUSE).await;
                }
            }
        }
        runs.push((job, ledger));
    }
    (runs, breaks)
}

async fn job_state(mut clients: Clients, name: String) -> Result<JobState, Status> {
    let job = clients.jobs.get_job(GetJobRequest { name }).await?.into_inner().job;
    Ok(job.expect("a job").state())
}

async fn set_monitoring(clients: Clients, request: SetMonitoringRequest) -> Result<(), Status> {
    TelemetryClient::new(clients.channel).set_monitoring(request).await.map(drop)
}

async fn run_state(clients: Clients, name: String) -> Result<RunState, Status> {
    let run = TelemetryClient::new(clients.channel).get_run(GetRunRequest { name }).await?.into_inner().run;
    Ok(run.expect("a run").state())
}

/// Whether a run has ended: the word of it may be lost like any other.
async fn has_ended(storm: &Storm, run: &str) -> bool {
    let state = storm.ask(|clients| run_state(clients, run.to_owned())).await;
    assert!(matches!(state, RunState::Open | RunState::Finished), "{state:?}");
    state == RunState::Finished
}

/// Crashes the database server and starts it again.
async fn restart_database() {
    let script = std::env::var("FEEDWAVE_TEST_POSTGRES_RESTART").expect("tests/postgres/run.sh sets it");
    let status = patiently(tokio::process::Command::new(script).status()).await.expect("the script is there");
    assert!(status.success(), "the server starts again");
}

#[derive(Debug, Clone, Copy)]
enum Fault {
    Kill,
    Crash,
    Cut,
    Clock,
}

/// Waits until so many more calls were answered.
async fn progress(answered: &mut watch::Receiver<u64>, more: u64) {
    let until = *answered.borrow_and_update() + more;
    patiently(answered.wait_for(|count| *count >= until)).await.expect("clients go on");
}

/// Does faults one after another, each in the middle of the work; what they were.
async fn storm_on(
    replicas: &mut [Replica],
    balancer: &Gate,
    mut answered: watch::Receiver<u64>,
    clock: &Faults,
    chance: &mut Chance,
) -> Vec<(Fault, usize)> {
    let count = std::env::var("FEEDWAVE_REPLICA_FAULTS").map_or(FAULTS, |count| count.parse().expect("a number"));
    let mut faults = Vec::new();
    for number in 0..count {
        progress(&mut answered, 20 + chance.up_to(200)).await;
        // Every kind comes in turn, at random places and moments.
        let fault = [Fault::Kill, Fault::Cut, Fault::Crash, Fault::Clock, Fault::Kill, Fault::Cut][number as usize % 6];
        let place = usize::try_from(chance.up_to(replicas.len() as u64)).expect("a small number") - 1;
        match fault {
            Fault::Kill => {
                replicas[place].kill().await;
                balancer.set_targets(replicas.iter().map(Replica::address).collect());
            }
            Fault::Crash => restart_database().await,
            Fault::Cut => {
                replicas[place].wire.cut(true);
                // The others go on meanwhile.
                progress(&mut answered, 100 + chance.up_to(200)).await;
                replicas[place].wire.cut(false);
            }
            Fault::Clock => clock.clock_ahead(i64::try_from(chance.up_to(7_200)).expect("hours") - 3_600),
        }
        faults.push((fault, place));
    }
    faults
}

/// Every job of the store, by its request id.
async fn all_jobs(clients: &mut Clients) -> HashMap<String, JobState> {
    let (mut jobs, mut page_token) = (HashMap::new(), String::new());
    loop {
        let request = ListJobsRequest { page_size: 500, page_token, ..ListJobsRequest::default() };
        let page = clients.jobs.list_jobs(request).await.expect("the jobs are listed").into_inner();
        for job in page.jobs {
            let state = job.state();
            assert_eq!(jobs.insert(job.name, state), None, "a job is listed once");
        }
        page_token = page.next_page_token;
        if page_token.is_empty() {
            return jobs;
        }
    }
}

// One history of work and faults, and what is left of it behind them.
#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn nothing_is_lost_done_twice_or_reordered_when_replicas_and_the_database_fail() {
    let mut chance = Chance::new();
    let seed = chance.seed();
    let store = shared_store();
    let clock = Faults::new();
    // Half an hour wrong from the start, and never twice the same.
    clock.clock_ahead(-1_800);
    let mut replicas = vec![
        Replica::start(&store, clock.environment.clone()).await,
        Replica::start(&store, Vec::new()).await,
        Replica::start(&store, Vec::new()).await,
    ];
    let balancer = Gate::new(replicas.iter().map(Replica::address).collect()).await;
    let (over, is_over) = watch::channel(false);
    let (answered, progress) = watch::channel(0);
    let storm = Arc::new(Storm { balancer: balancer.address, answered, over: is_over });

    let mut clients = storm.clients().await;
    let streamed = clients.submit(&long_dwell(20)).await.job.name;
    let request = StreamSetpointsRequest { job: streamed.clone(), ..StreamSetpointsRequest::default() };
    let whole = Arc::new(stream(&mut clients, request).await.expect("a stream").bits_from(0));

    let (expect, expected) = watch::channel(None);
    let begun = Instant::now();
    let mut creators = JoinSet::new();
    for creator in 0..CREATORS {
        creators.spawn(create(storm.clone(), creator));
    }
    let mut watchers = JoinSet::new();
    for _ in 0..3 {
        watchers.spawn(watch_jobs(storm.clone(), expected.clone()));
    }
    let readers = tokio::spawn(read_streams(storm.clone(), streamed, whole));
    let live = tokio::spawn(run_live(storm.clone()));
    let faults = storm_on(&mut replicas, &balancer, progress, &clock, &mut chance).await;
    over.send_replace(true);

    let ledger: BTreeMap<String, String> = creators.join_all().await.into_iter().flatten().collect();
    let streams = readers.await.expect("setpoints are the same");
    let (runs, breaks) = live.await.expect("runs go on");
    let jobs = ledger.len() + runs.len() + 1;
    expect.send_replace(Some(jobs));
    let seen = patiently(watchers.join_all()).await;
    println!(
        "{faults:?}: {jobs} jobs, {streams} streams, {} runs with {breaks} breaks, {} events in {:.0?}, seed {seed}",
        runs.len(),
        seen[0].len(),
        begun.elapsed()
    );

    // What was acknowledged is there, once, and was done once.
    let mut clients = replicas[1].server.as_ref().expect("a server").connect().await;
    let found = all_jobs(&mut clients).await;
    assert_eq!(found.len(), jobs, "a request id makes one job; seed {seed}");
    for job in ledger.values().chain(runs.iter().map(|(job, _)| job)) {
        assert_eq!(found.get(job), Some(&JobState::Ready), "{job}, seed {seed}");
    }
    assert!(seen.iter().all(|each| *each == seen[0]), "every watcher saw the same, in the same order; seed {seed}");
    let mut ends: HashMap<&str, u64> = HashMap::new();
    for (_, job, _) in seen[0].iter().filter(|event| event.2 == JobState::Ready) {
        *ends.entry(job).or_default() += 1;
    }
    assert!(ends.len() == jobs && ends.values().all(|count| *count == 1), "validated once: {ends:?}, seed {seed}");
    for (job, run) in runs {
        run.prove(clients.clone(), job, seed).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_replica_that_is_cut_off_while_it_owns_a_run_writes_nothing_to_it_any_more() {
    let store = shared_store();
    let first = Replica::start(&store, Vec::new()).await;
    let second = Replica::start(&store, Vec::new()).await;
    let at = async |replica: &Replica| replica.server.as_ref().expect("a server").connect().await;
    let job = at(&first).await.submit(LIVE_PART).await.job.name;
    let request = SetMonitoringRequest { job: job.clone(), config: Some(live_config()) };
    let mut telemetry = TelemetryClient::new(at(&first).await.channel);
    telemetry.set_monitoring(request).await.expect("the configuration is valid");

    let mut ledger = RunLedger::default();
    for _ in 0..3 {
        // What the replica can no longer make durable it does not acknowledge, and in the end it says so.
        let cut_off = ledger.drive_while(at(&first).await.channel, &job, |count| {
            first.wire.cut(count >= 30);
            true
        });
        let left = patiently(cut_off).await;
        assert!(matches!(left, Left::Broken(Some(_))), "{left:?}");
        let begun = Instant::now();
        let left = ledger.drive(at(&second).await.channel, &job, 30).await;
        assert!(matches!(left, Left::Enough), "{left:?}");
        println!("30 messages on the other replica after {:.0?}", begun.elapsed());
        // What was on its way arrives late, and is refused: the run is another replica's.
        first.wire.cut(false);
    }
    let left = patiently(ledger.drive(at(&second).await.channel, &job, u64::MAX)).await;
    assert!(matches!(left, Left::Ended), "{left:?}");
    ledger.prove(at(&first).await, job, 0).await;
}

/// A client connects when it has to, and a balancer leads it to whichever replica it likes: it is sent away by the one that cannot work.
#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_client_of_a_replica_that_is_cut_off_comes_to_another_one_by_itself() {
    let store = shared_store();
    let replicas = [Replica::start(&store, Vec::new()).await, Replica::start(&store, Vec::new()).await];
    let balancer = Gate::new(vec![replicas[0].address()]).await;
    let channel = connect(balancer.address).await;
    let mut clients = Clients::of(channel.clone());
    let job = clients.submit(LIVE_PART).await.job.name;
    let request = SetMonitoringRequest { job: job.clone(), config: Some(live_config()) };
    let mut telemetry = TelemetryClient::new(channel.clone());
    telemetry.set_monitoring(request).await.expect("the configuration is valid");
    let watched = WatchJobsRequest { after: None, job: String::new() };
    let mut events = clients.jobs.watch_jobs(watched).await.expect("jobs are watched").into_inner();
    let idle = connect(balancer.address).await;
    balancer.set_targets(replicas.iter().map(Replica::address).collect());

    let mut ledger = RunLedger::default();
    let begun = Instant::now();
    let left = ledger.drive_while(channel.clone(), &job, |count| {
        replicas[0].wire.cut(count >= 30);
        true
    });
    let left = patiently(left).await;
    let Left::Broken(Some(status)) = left else { panic!("{left:?}") };
    assert_eq!(status.code(), Code::Unavailable, "{status:?}");
    println!("sent away after {:.1?}", begun.elapsed());
    let ended = patiently(events.message()).await.expect_err("nothing is seen from there");
    assert_eq!(ended.code(), Code::Unavailable, "{ended:?}");
    for channel in [channel, idle] {
        let served = async {
            let mut jobs = Clients::of(channel.clone()).jobs;
            while jobs.get_job(GetJobRequest { name: job.clone() }).await.is_err() {
                tokio::time::sleep(PAUSE).await;
            }
        };
        patiently(served).await;
        let left = patiently(ledger.drive_while(channel, &job, |count| count < 30)).await;
        assert!(matches!(left, Left::Enough), "{left:?}");
    }
    let clients = replicas[1].server.as_ref().expect("a server").connect().await;
    let left = patiently(ledger.drive(clients.channel.clone(), &job, u64::MAX)).await;
    assert!(matches!(left, Left::Ended), "{left:?}");
    ledger.prove(clients, job, 0).await;
}
