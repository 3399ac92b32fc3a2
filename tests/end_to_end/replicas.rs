//! Three replicas on one database of a PostgreSQL server: jobs, watchers and live runs on any of them, and `kill -9`.
//! `tests/postgres/run.sh` starts a server and says in `FEEDWAVE_TEST_STORE` where it is.

use std::collections::HashMap;

use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{CancelJobRequest, GetJobRequest, JobState, SetMonitoringRequest, WatchJobsRequest};
use feedwave_tests::{Chance, Clients, Home, LIVE_PART, Left, RunLedger, Server, live_config, patiently, shared_store};
use tokio::task::JoinSet;

use crate::FEEDWAVE;
use crate::validation_queue::{begins, create_endless};

async fn replicas<const N: usize>() -> [Server; N] {
    let uri = shared_store();
    let mut servers = Vec::new();
    for _ in 0..N {
        servers.push(Home::on(FEEDWAVE, &uri, "").start().await);
    }
    servers.try_into().unwrap_or_else(|_| unreachable!("as many as were started"))
}

/// Every event, by its sequence number, until so many jobs have ended.
async fn watch(mut clients: Clients, jobs: usize) -> Vec<(u64, String, JobState)> {
    let request = WatchJobsRequest { after: Some(0), job: String::new() };
    let mut events = clients.jobs.watch_jobs(request).await.expect("jobs are watched").into_inner();
    let (mut seen, mut ended) = (Vec::new(), 0);
    while ended < jobs {
        let event = events.message().await.expect("the watch goes on").and_then(|message| message.event);
        let event = event.expect("an event");
        ended += usize::from(matches!(event.state(), JobState::Ready | JobState::Rejected));
        seen.push((event.sequence, event.job.clone(), event.state()));
    }
    seen
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
    let seen = watchers.join_all().await;
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
    let uri = shared_store();
    let first = Home::on(FEEDWAVE, &uri, "").start().await;
    let job = create_endless(&mut first.connect().await).await.name;
    begins(&mut first.connect().await, &job, 1).await;
    let second = Home::on(FEEDWAVE, &uri, "").start().await;
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
    let uri = shared_store();
    let first = Home::on(FEEDWAVE, &uri, "").start().await;
    let name = create_endless(&mut first.connect().await).await.name;
    begins(&mut first.connect().await, &name, 1).await;
    let second = Home::on(FEEDWAVE, &uri, "").start().await;
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
