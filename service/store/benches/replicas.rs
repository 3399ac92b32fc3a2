//! Decisions and jobs made durable in a file and on a PostgreSQL server, in the same run, and on the server through one, two and three
//! replicas at once; and how long after that the other replicas know of an event. Without `FEEDWAVE_TEST_STORE` only the file is measured:
//!
//! ```text
//! tests/postgres/run.sh cargo bench -p feedwave-store --bench replicas
//! ```

mod common;

use std::time::{Duration, Instant};

use common::new_job;
use feedwave_store::{
    NewDecision, NewRun, ProgramId, RawValue, RunCommit, RunKind, Store, StoreSettings, StoreUri, Tenant,
};
use tokio::task::JoinSet;
use uuid::Uuid;

/// How long each line is measured.
const TIME: Duration = Duration::from_secs(3);
/// Callers at once of each replica, where there are many.
const MANY: usize = 32;

/// What every caller does again and again.
#[derive(Clone, Copy)]
enum Work {
    Decisions,
    Jobs,
}

/// Works until the time is over; how long each piece took.
async fn work(store: Store, program: ProgramId, work: Work, until: Instant) -> Vec<Duration> {
    let job_id = store.create_job(new_job(program)).await.expect("creates a job").id;
    let settings = RawValue::from_string("{}".into()).expect("JSON");
    let new = NewRun { job_id, kind: RunKind::Live, settings, monitor: vec![0; 512].into() };
    let run = store.create_run(new).await.expect("creates a run");
    let mut times = Vec::new();
    for number in 0.. {
        let begun = Instant::now();
        if begun >= until {
            break;
        }
        match work {
            Work::Jobs => {
                store.create_job(new_job(program)).await.expect("creates a job");
            }
            Work::Decisions => {
                let body = vec![7; 600].into();
                let decision = NewDecision { number, action: "change", body, raises_condition: false };
                let telemetry = Some((Some(number), vec![0; 512].into()));
                let commit = RunCommit { telemetry, decisions: vec![decision], ..RunCommit::default() };
                store.commit_run(run.run.id, run.attachment, commit).await.expect("commits");
            }
        }
        times.push(begun.elapsed());
    }
    times
}

/// Opens so many replicas of a store, works with so many callers on each, and prints what came of it.
async fn measure(name: &str, uri: &StoreUri, replicas: usize, callers: usize, kind: Work) {
    let mut stores = Vec::new();
    for _ in 0..replicas {
        stores.push(Store::open(uri, StoreSettings::default()).await.expect("opens"));
    }
    let program = stores[0].put_program(Tenant::DEFAULT, "M30\n".into()).await.expect("puts").id;
    let begun = Instant::now();
    let mut tasks = JoinSet::new();
    for store in &stores {
        for _ in 0..callers {
            tasks.spawn(work(store.clone(), program, kind, begun + TIME));
        }
    }
    let mut times: Vec<Duration> = tasks.join_all().await.into_iter().flatten().collect();
    let rate = times.len() as f64 / begun.elapsed().as_secs_f64();
    times.sort_unstable();
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e3;
    let what = match kind {
        Work::Decisions => "decisions",
        Work::Jobs => "jobs",
    };
    println!(
        "{name:<10} {replicas} replica(s) {callers:>3} callers each: {rate:>7.0} {what}/s, p50 {:>6.2} ms, p99 {:>6.2} ms",
        at(0.5),
        at(0.99)
    );
    for store in stores {
        store.close().await;
    }
}

/// Events of each line.
const EVENTS: usize = 500;

/// Makes events at one of three replicas, one after another, while so many callers write at each, and prints how long after they were
/// acknowledged both others know of them.
async fn hear(uri: &StoreUri, callers: usize) {
    let mut stores = Vec::new();
    for _ in 0..3 {
        stores.push(Store::open(uri, StoreSettings::default()).await.expect("opens"));
    }
    let program = stores[0].put_program(Tenant::DEFAULT, "M30\n".into()).await.expect("puts").id;
    let mut tasks = JoinSet::new();
    for store in &stores {
        for _ in 0..callers {
            // Until they are stopped.
            tasks.spawn(work(store.clone(), program, Work::Decisions, Instant::now() + TIME * 1_000));
        }
    }
    let mut times = Vec::new();
    for _ in 0..EVENTS {
        stores[0].create_job(new_job(program)).await.expect("creates a job");
        let acknowledged = Instant::now();
        let newest = *stores[0].watch_events().borrow();
        for store in &stores[1..] {
            store.watch_events().wait_for(|known| *known >= newest).await.expect("is open");
        }
        times.push(acknowledged.elapsed());
        // Not all at the same moment of what a replica does again and again.
        tokio::time::sleep(Duration::from_millis(times.len() as u64 % 7)).await;
    }
    tasks.shutdown().await;
    times.sort_unstable();
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e3;
    println!(
        "known to both other replicas, {callers:>3} callers each: p50 {:>6.2} ms, p99 {:>6.2} ms, at most {:>6.2} ms",
        at(0.5),
        at(0.99),
        at(1.0)
    );
    for store in stores {
        store.close().await;
    }
}

#[tokio::main]
async fn main() {
    let folder = tempfile::TempDir::new().expect("a temporary folder");
    let file = StoreUri::of_file(&folder.path().join("feedwave.db")).expect("a path");
    let server = std::env::var("FEEDWAVE_TEST_STORE").ok().map(|pattern| -> StoreUri {
        pattern.replace("{}", &format!("bench-{}", Uuid::now_v7())).parse().expect("a URI")
    });
    if let Some(server) = &server {
        for callers in [0, 1, 4, MANY] {
            hear(server, callers).await;
        }
    }
    for kind in [Work::Decisions, Work::Jobs] {
        for callers in [1, MANY] {
            measure("file", &file, 1, callers, kind).await;
            for replicas in 1..=3 {
                if let Some(server) = &server {
                    measure("server", server, replicas, callers, kind).await;
                }
            }
        }
    }
}
