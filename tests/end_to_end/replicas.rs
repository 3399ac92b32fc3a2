//! Three replicas on one database of a PostgreSQL server: jobs, watchers and live runs on any of them, and `kill -9`.
//! `tests/postgres/run.sh` starts a server and says in `FEEDWAVE_TEST_STORE` where it is.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv4Addr};
use std::time::{Duration, Instant};

use feedwave_contract::proto::machines_client::MachinesClient;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    AcknowledgeConditionRequest, Availability, CancelJobRequest, CreateMachineRequest, DeleteJobRequest,
    DeleteMachineRequest, Escalation, Execution, GetJobRequest, GetMachineRequest, JobState, Machine, MachineState,
    OverrideBounds, RunSettings, SetMonitoringRequest, WatchJobsRequest,
};
use feedwave_tests::{
    Chance, Clients, Home, LIVE_PART, Left, LiveClient, RunLedger, Server, live_config, patiently, shared_store,
};
use tokio::task::JoinSet;
use tonic::Code;
use tonic::transport::Endpoint;

use crate::FEEDWAVE;
use crate::live_runs::{batch, config};
use crate::shop_floor::{Ingest, Live, Watch, monitored};
use crate::status::assert_error;
use crate::take_over::{abort, error_of, hold};
use crate::validation_queue::{begins, create_endless};

async fn replicas<const N: usize>() -> [Server; N] {
    let store = shared_store();
    let mut servers = Vec::new();
    for _ in 0..N {
        servers.push(Home::on(FEEDWAVE, &store, "").start().await);
    }
    servers.try_into().unwrap_or_else(|_| unreachable!("as many as were started"))
}

/// An event with its sequence number.
type Seen = (u64, String, JobState);

/// Every event until so many jobs have ended, and when it came.
async fn watch(mut clients: Clients, jobs: usize) -> (Vec<Seen>, Vec<Instant>) {
    let request = WatchJobsRequest { after: Some(0), job: String::new() };
    let mut events = clients.jobs.watch_jobs(request).await.expect("jobs are watched").into_inner();
    let (mut seen, mut times, mut ended) = (Vec::new(), Vec::new(), 0);
    while ended < jobs {
        let event = events.message().await.expect("the watch goes on").and_then(|message| message.event);
        let event = event.expect("an event");
        ended += usize::from(matches!(event.state(), JobState::Ready | JobState::Rejected));
        seen.push((event.sequence, event.job.clone(), event.state()));
        times.push(Instant::now());
    }
    (seen, times)
}

/// How much later than the first of several watchers the last one saw an event: the median, 99 of 100, the longest.
fn spread(times: &[Vec<Instant>]) -> [Duration; 3] {
    let events = 0..times[0].len();
    let mut spreads: Vec<Duration> = events
        .map(|event| {
            let seen = times.iter().map(|times| times[event]);
            seen.clone().max().expect("a watcher").duration_since(seen.min().expect("a watcher"))
        })
        .collect();
    spreads.sort_unstable();
    let last = spreads.len() - 1;
    [last / 2, last * 99 / 100, last].map(|place| spreads[place])
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn jobs_of_any_replica_are_validated_once_and_seen_everywhere() {
    const JOBS: usize = 60;
    let servers = replicas::<3>().await;
    let mut watchers = JoinSet::new();
    for server in &servers {
        watchers.spawn(watch(server.connect().await, JOBS));
    }
    let mut creations = JoinSet::new();
    for index in 0..JOBS {
        let mut clients = servers[index % 3].connect().await;
        creations.spawn(async move { clients.create(format!("G21\nG0 X{index}.\nM30\n")).await.expect("a job").name });
    }
    let created = creations.join_all().await;
    let (seen, times): (Vec<_>, Vec<_>) = watchers.join_all().await.into_iter().unzip();
    // What docs/scaling.md says of it.
    println!("an event at the last of three replicas after the first: {:.1?}", spread(&times));
    assert!(seen.iter().all(|each| *each == seen[0]), "every watcher sees the same, in the same order");
    assert!(seen[0].windows(2).all(|pair| pair[0].0 < pair[1].0));
    let mut states: HashMap<&str, Vec<JobState>> = HashMap::new();
    for (_, job, state) in &seen[0] {
        states.entry(job).or_default().push(*state);
    }
    for job in &created {
        let expected = [JobState::Pending, JobState::Validating, JobState::Ready];
        assert_eq!(states[job.as_str()], expected, "{job}: validated once");
    }
    // A job is one and the same wherever it is asked for.
    for server in &servers {
        let request = GetJobRequest { name: created[0].clone() };
        let job = server.connect().await.jobs.get_job(request).await.expect("a job").into_inner().job;
        assert_eq!(job.expect("a job").state(), JobState::Ready);
    }
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn what_a_killed_replica_was_at_another_one_takes_up() {
    let store = shared_store();
    let first = Home::on(FEEDWAVE, &store, "").start().await;
    let job = create_endless(&mut first.connect().await).await.name;
    begins(&mut first.connect().await, &job, 1).await;
    let second = Home::on(FEEDWAVE, &store, "").start().await;
    drop(first.kill().await);
    // Once the first one has not been heard of for long enough.
    let mut clients = second.connect().await;
    begins(&mut clients, &job, 2).await;
    let read = clients.jobs.get_job(GetJobRequest { name: job.clone() }).await.expect("a job").into_inner().job;
    assert_eq!(read.expect("a job").validation_attempts, 2);
    clients.jobs.cancel_job(CancelJobRequest { name: job }).await.expect("the job is cancelled");
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_job_that_is_cancelled_elsewhere_is_worked_on_no_longer() {
    let store = shared_store();
    let first = Home::on(FEEDWAVE, &store, "").start().await;
    let name = create_endless(&mut first.connect().await).await.name;
    begins(&mut first.connect().await, &name, 1).await;
    let second = Home::on(FEEDWAVE, &store, "").start().await;
    second.connect().await.jobs.cancel_job(CancelJobRequest { name }).await.expect("the job is cancelled");
    let idle =
        async { while !first.web().get("/metrics").await.text().contains("\nfeedwave_active_validations 0\n") {} };
    patiently(idle).await;
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_live_run_moves_from_replica_to_replica() {
    const MOVES: usize = 8;
    let mut chance = Chance::new();
    let seed = chance.seed();
    let servers = replicas::<3>().await;
    let mut servers = servers.map(Some);
    let job = servers[0].as_ref().expect("a server").connect().await.submit(LIVE_PART).await.job.name;
    let mut telemetry = TelemetryClient::new(servers[1].as_ref().expect("a server").connect().await.channel);
    let request = SetMonitoringRequest { job: job.clone(), config: Some(live_config()) };
    telemetry.set_monitoring(request).await.expect("the configuration is valid");

    let mut known = RunLedger::default();
    let mut moves = 0;
    loop {
        let messages = if moves < MOVES { chance.up_to(60) } else { u64::MAX };
        let place = &mut servers[moves % 3];
        match known.drive(place.as_ref().expect("a server").connect().await.channel, &job, messages).await {
            Left::Ended => break,
            Left::Enough => {}
            Left::Broken(status) => panic!("the service ended by itself: {status:?}"),
        }
        // Every other time the connection breaks, and the replica lives on; else it is killed.
        if moves % 2 == 0 {
            let home = place.take().expect("a server").kill().await;
            *place = Some(home.start().await);
        }
        moves += 1;
    }
    assert_eq!(moves, MOVES, "seed {seed}");
    known.prove(servers[0].as_ref().expect("a server").connect().await, job, seed).await;
}

/// Waits until every watcher has seen this of a machine; when each did.
async fn seen_by_all(watches: &mut [Watch], wanted: Availability, times: &mut [Vec<Instant>]) {
    let seen = watches.iter_mut().zip(times).map(async |(watch, times)| {
        watch.until(|state| state.availability() == wanted).await;
        times.push(Instant::now());
    });
    futures_util::future::join_all(seen).await;
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn who_comes_and_goes_at_one_replica_does_so_at_every_one() {
    let servers = replicas::<3>().await;
    let job = monitored(&servers[0], config()).await;
    let mut watches = Vec::new();
    for server in &servers {
        watches.push(Watch::open(server, "machines/lathe").await);
    }
    let (mut target, mut times) = (Target::Job(job), [const { Vec::new() }; 3]);
    for server in servers.iter().cycle().take(30) {
        let live = Live::open(server, target, 0).await;
        target = Target::Run(live.run.clone());
        seen_by_all(&mut watches, Availability::Available, &mut times).await;
        drop(live);
        seen_by_all(&mut watches, Availability::Unavailable, &mut times).await;
    }
    // What docs/scaling.md says of it.
    println!("a state at the last of three replicas after the first: {:.1?}", spread(&times));
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn what_a_machine_does_is_seen_at_every_replica() {
    let [first, second] = replicas::<2>().await;
    let mut watch = Watch::open(&second, "machines/lathe").await;
    let job = monitored(&first, config()).await;
    let mut live = Live::open(&first, Target::Job(job.clone()), 0).await;
    live.reach(600).await;
    live.take(500).await;
    live.measure(0..25).await;
    let is_seen = |state: &MachineState| {
        let run = state.run.as_ref();
        run.is_some_and(|run| run.progress.is_some_and(|progress| progress.taken == 500) && run.process.is_some())
    };
    let state = watch.until(is_seen).await;
    assert_eq!((state.execution(), state.availability()), (Execution::Running, Availability::Available));
    assert_eq!((state.run.expect("a run").run, state.other_runs), (live.run.clone(), 0));
    // Of the run itself it says the same.
    let of_run = second.web().get(&format!("/v1/{}", live.run)).await.json();
    assert_eq!(of_run["activity"]["execution"], "EXECUTION_RUNNING");

    // A replica that is gone takes its streams with it.
    let home = first.kill().await;
    let state = watch.until(|state| state.execution() == Execution::Interrupted).await;
    assert_eq!(state.availability(), Availability::Unavailable);
    assert!(state.run.is_some_and(|run| run.process.is_none() && run.commanded.is_none()));
    let first = home.start().await;
    let mut watch_first = Watch::open(&first, "machines/lathe").await;

    // Taken up elsewhere it goes on, is seen everywhere, and ends once.
    let again = Live::open(&second, Target::Run(live.run.clone()), live.received).await;
    watch_first.until(|state| state.availability() == Availability::Available).await;
    again.finish().await;
    for watch in [&mut watch, &mut watch_first] {
        let done = watch.until(|state| state.execution() == Execution::Finished).await;
        let done = if done.finished_runs > 0 { done } else { watch.until(|state| state.finished_runs > 0).await };
        assert_eq!((done.availability(), done.finished_runs), (Availability::Unavailable, 1));
    }
    // With its job the run is gone, wherever that was deleted.
    let mut clients = first.connect().await;
    clients.jobs.delete_job(DeleteJobRequest { name: job, ..Default::default() }).await.expect("the job is deleted");
    for watch in [&mut watch, &mut watch_first] {
        let state = watch.until(|state| state.run.is_none()).await;
        assert_eq!(state.execution(), Execution::Idle);
    }
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_run_that_is_taken_up_at_one_replica_ends_its_stream_at_another() {
    let [first, second] = replicas::<2>().await;
    let job = monitored(&first, config()).await;
    let mut watches = [Watch::open(&first, "machines/lathe").await, Watch::open(&second, "machines/lathe").await];
    let channel = first.connect().await.channel;
    let mut former = LiveClient::begin(channel, &job, RunSettings::default()).await.expect("a run");
    former.reach(1_000).await.expect("setpoints");
    for watch in &mut watches {
        watch.until(|state| state.execution() == Execution::Running).await;
    }
    let channel = second.connect().await.channel;
    let mut newer = LiveClient::take_up(channel, &former.started.run, 1_000).await.expect("the run is taken up");
    assert_error(&error_of(&mut former).await, Code::Aborted, "RUN_TAKEN_UP");
    hold(&mut newer, &mut watches[0]).await;
    for server in [&first, &second] {
        let mut watch = Watch::open(server, "machines/lathe").await;
        let state = watch.until(|state| state.execution() == Execution::Held).await;
        assert_eq!((state.availability(), state.other_runs), (Availability::Available, 0));
    }
    abort(&mut newer).await;
    for watch in &mut watches {
        let state = watch.until(|state| state.availability() == Availability::Unavailable).await;
        assert_eq!(state.execution(), Execution::Stopped);
    }
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_condition_is_seen_and_acknowledged_at_any_replica() {
    let [first, second] = replicas::<2>().await;
    let mut config = config();
    let rules = config.rules.as_mut().expect("rules");
    rules.feed_bounds = Some(OverrideBounds { lower: 0.5, upper: 1.5 });
    rules.escalation = Some(Escalation { windows: Some(2), ..Default::default() });
    let job = monitored(&first, config).await;
    let mut watch = Watch::open(&second, "machines/lathe").await;
    let ingest = Ingest::open(&first, job.clone()).await;
    for sequence in 0..50 {
        ingest.send(batch(sequence)).await;
    }
    let waits = |state: &MachineState| {
        let mut conditions = state.conditions.iter();
        conditions.any(|condition| condition.needs_acknowledgement && condition.acknowledge_time.is_none())
    };
    let seen = watch.until(waits).await;
    let waiting = seen.conditions.iter().find(|condition| condition.needs_acknowledgement).expect("a condition");
    let mut telemetry = TelemetryClient::new(second.connect().await.channel);
    let request = AcknowledgeConditionRequest {
        run: ingest.run.clone(),
        decision_number: waiting.decision_number,
        acknowledged_by: "Ada".to_owned(),
        ..Default::default()
    };
    telemetry.acknowledge_condition(request).await.expect("the condition is acknowledged");
    let is_acknowledged =
        |state: &MachineState| state.conditions.iter().any(|condition| condition.acknowledged_by == "Ada");
    for server in [&first, &second] {
        Watch::open(server, "machines/lathe").await.until(is_acknowledged).await;
    }

    // A job that is cancelled elsewhere is over everywhere.
    second.connect().await.jobs.cancel_job(CancelJobRequest { name: job }).await.expect("the job is cancelled");
    for server in [&first, &second] {
        let mut watch = Watch::open(server, "machines/lathe").await;
        let state = watch.until(|state| state.execution() == Execution::Stopped).await;
        assert_eq!(state.availability(), Availability::Unavailable);
    }
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_machine_that_one_replica_was_given_every_replica_shows() {
    let [first, second] = replicas::<2>().await;
    let path = "/v1/machines/lathe-2/state";
    let mut machines = MachinesClient::new(first.connect().await.channel);
    let lathe = machines.get_machine(GetMachineRequest { name: "machines/lathe".to_owned() }).await;
    let lathe = lathe.expect("a machine").into_inner().machine.expect("a machine");
    let machine = Machine { display_name: "Second".to_owned(), profile: lathe.profile, ..Default::default() };
    let request = CreateMachineRequest { machine_id: "lathe-2".to_owned(), machine: Some(machine) };
    machines.create_machine(request).await.expect("a machine is made");
    let web = second.web();
    let shown = async {
        loop {
            let answer = web.get(path).await;
            if answer.status.is_success() {
                return answer.json();
            }
        }
    };
    assert_eq!(patiently(shown).await["displayName"], "Second");
    let request = DeleteMachineRequest { name: "machines/lathe-2".to_owned(), ..Default::default() };
    machines.delete_machine(request).await.expect("the machine is deleted");
    patiently(async { while web.get(path).await.status.is_success() {} }).await;
}

/// A client of its own address.
async fn connect_from(server: &Server, last: u8) -> Clients {
    let endpoint = Endpoint::from_shared(format!("http://{}", server.grpc)).expect("a valid address");
    let endpoint = endpoint.local_address(Some(IpAddr::V4(Ipv4Addr::new(127, 0, 0, last))));
    Clients::of(endpoint.connect().await.expect("the service listens"))
}

/// Setpoints after which shares are held against each other: of so many turns that one that is cut short says nothing.
const ENOUGH: u64 = 20_000_000;
const ONE_WORKER: &str = "[limits]\nvalidation_workers = 1\nbegun_validations = 32\nvalidation_turn_ms = 5\n";

/// Makes so many endless jobs of a client, at one replica after the other.
async fn jobs_of(client: u8, count: usize, servers: &[&Server]) -> Vec<String> {
    let mut jobs = Vec::new();
    for server in servers.iter().cycle().take(count) {
        jobs.push(create_endless(&mut connect_from(server, client).await).await.name);
    }
    jobs
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn clients_have_equal_shares_of_all_replicas_however_many_jobs_they_have() {
    let store = shared_store();
    let first = Home::on(FEEDWAVE, &store, ONE_WORKER).start().await;
    let second = Home::on(FEEDWAVE, &store, ONE_WORKER).start().await;
    // Nine jobs of one client, then three of another.
    let many = jobs_of(11, 9, &[&first, &second]).await;
    let few = jobs_of(12, 3, &[&first, &second]).await;
    have_equal_shares([&first, &second], [many, few]).await;
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_client_whose_jobs_are_all_at_one_replica_has_an_equal_share_of_all() {
    let store = shared_store();
    let first = Home::on(FEEDWAVE, &store, ONE_WORKER).start().await;
    let (mut many, few) = (jobs_of(11, 3, &[&first]).await, jobs_of(12, 3, &[&first]).await);
    for name in many.iter().chain(&few) {
        begins(&mut first.connect().await, name, 1).await;
    }
    let second = Home::on(FEEDWAVE, &store, ONE_WORKER).start().await;
    many.append(&mut jobs_of(11, 6, &[&second]).await);
    have_equal_shares([&first, &second], [many, few]).await;
}

/// Proves that two clients have equal shares of two replicas together, and ends their jobs.
async fn have_equal_shares([first, second]: [&Server; 2], jobs: [Vec<String>; 2]) {
    for name in jobs.iter().flatten() {
        begins(&mut first.connect().await, name, 1).await;
    }
    // Setpoints of jobs by the replica that validates them, which knows how far its own have come.
    let done = async |jobs: &[String]| {
        let mut setpoints = [0, 0];
        for name in jobs {
            let mut seen = [0, 0];
            for (seen, server) in seen.iter_mut().zip([first, second]) {
                let request = GetJobRequest { name: name.clone() };
                let job = server.connect().await.jobs.get_job(request).await.expect("a job").into_inner().job;
                *seen = job.and_then(|job| job.validation).map_or(0, |progress| progress.setpoint_count);
            }
            setpoints[usize::from(seen[1] > seen[0])] += seen[0].max(seen[1]);
        }
        setpoints
    };
    let since = async |jobs: &[String], before: [u64; 2]| {
        let now = done(jobs).await;
        [now[0] - before[0], now[1] - before[1]]
    };
    let before = [done(&jobs[0]).await, done(&jobs[1]).await];
    let shares = async {
        loop {
            let shares = [since(&jobs[0], before[0]).await, since(&jobs[1], before[1]).await];
            if shares.iter().flatten().sum::<u64>() >= ENOUGH {
                return shares;
            }
        }
    };
    let shares = patiently(shares).await;
    let [many, few] = shares.map(|by_replica| by_replica.iter().sum::<u64>());
    // A replica that the machine gives little time can do no more than work for the one with fewer jobs alone.
    let there = (0..2).filter(|&replica| shares[1][replica] > 0).map(|replica| shares[0][replica] + shares[1][replica]);
    let has_all_there = 10 * few >= 9 * there.sum::<u64>();
    // By jobs it would be three to one.
    assert!((many < 2 * few || has_all_there) && few < 2 * many, "{shares:?} setpoints");
    for name in jobs.into_iter().flatten() {
        let request = CancelJobRequest { name };
        first.connect().await.jobs.cancel_job(request).await.expect("the job is cancelled");
    }
}
