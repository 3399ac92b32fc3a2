//! What was acknowledged is there after `kill -9`.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::{GetJobRequest, JobState, ListJobsRequest, WatchJobsRequest};
use feedwave_tests::{Chance, Clients, Home, Server};
use tokio::sync::Notify;
use tokio::task::JoinSet;

use crate::FEEDWAVE;

/// Clients that create jobs at the same time.
const WRITERS: u64 = 8;

/// Program number `number`: every one has its own content and its own answer, ready or rejected.
fn program(number: u64) -> Vec<u8> {
    let refused = if number % 4 == 3 { "G201\n" } else { "" };
    format!("G21 G97 S1000 M3\nG0 X{number}. Z1.\n{refused}M30\n").into_bytes()
}

/// Creates jobs with all writers until the server dies, and kills it once `kills_at` jobs are acknowledged. Answers with
/// the acknowledged jobs' names by request number.
async fn create_until_killed(server: Server, first_number: u64, kills_at: u64) -> (BTreeMap<u64, String>, Home) {
    let next_number = Arc::new(AtomicU64::new(first_number));
    let acknowledged = Arc::new(AtomicU64::new(0));
    let enough = Arc::new(Notify::new());
    let mut writers = JoinSet::new();
    for _ in 0..WRITERS {
        let mut clients = server.connect().await;
        let (next_number, acknowledged, enough) = (next_number.clone(), acknowledged.clone(), enough.clone());
        writers.spawn(async move {
            let mut mine = Vec::new();
            loop {
                let number = next_number.fetch_add(1, Ordering::Relaxed);
                let source = Source::InlineProgram(Bytes::from(program(number)));
                let Ok(job) = clients.create_from(source, &format!("request-{number}")).await else { return mine };
                mine.push((number, job.name));
                if acknowledged.fetch_add(1, Ordering::Relaxed) + 1 == kills_at {
                    enough.notify_one();
                }
            }
        });
    }
    enough.notified().await;
    let home = server.kill().await;
    (writers.join_all().await.into_iter().flatten().collect(), home)
}

async fn all_jobs(clients: &mut Clients) -> BTreeMap<String, JobState> {
    let mut jobs = BTreeMap::new();
    let mut request = ListJobsRequest { page_size: 500, ..ListJobsRequest::default() };
    loop {
        let page = clients.jobs.list_jobs(request.clone()).await.expect("the jobs are listed").into_inner();
        jobs.extend(page.jobs.iter().map(|job| (job.name.clone(), job.state())));
        if page.next_page_token.is_empty() {
            return jobs;
        }
        request.page_token = page.next_page_token;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn acknowledged_jobs_survive_kill_9_and_pending_ones_are_validated_afterwards() {
    // The moments of the kills are random; a failure names the seed.
    let mut chance = Chance::new();
    let seed = chance.seed();
    let mut home = Home::new(FEEDWAVE, "");
    let mut acknowledged = BTreeMap::new();
    for round in 0..3_u64 {
        let kills_at = chance.up_to(200);
        let first_number = 1 + round * 1_000_000;
        let (names, left) = create_until_killed(home.start().await, first_number, kills_at).await;
        assert!(names.len() as u64 >= kills_at, "seed {seed}");
        acknowledged.extend(names);
        home = left;
    }

    let server = home.start().await;
    let mut clients = server.connect().await;
    let mut waiting = all_jobs(&mut clients).await;
    for (number, name) in &acknowledged {
        assert!(waiting.contains_key(name), "job {number} was acknowledged as {name} and is lost; seed {seed}");
        // Its request id is still known, so that a client that did not get the answer may ask again.
        let source = Source::InlineProgram(Bytes::from(program(*number)));
        let again = clients.create_from(source, &format!("request-{number}")).await.expect("the same job");
        assert_eq!(&again.name, name, "seed {seed}");
    }

    // Validation goes on where it stood: every job ends, without anyone asking.
    let request = WatchJobsRequest { after: Some(0), job: String::new() };
    let mut events = clients.jobs.watch_jobs(request).await.expect("the jobs are watched").into_inner();
    while !waiting.is_empty() {
        let message = events.message().await.expect("the watch goes on").expect("the watch does not end by itself");
        let event = message.event.expect("an event");
        if matches!(event.state(), JobState::Ready | JobState::Rejected | JobState::Failed) {
            waiting.remove(&event.job);
        }
    }
    for (number, name) in &acknowledged {
        let job = clients.jobs.get_job(GetJobRequest { name: name.clone() }).await.expect("the job").into_inner().job;
        let expected = if number % 4 == 3 { JobState::Rejected } else { JobState::Ready };
        assert_eq!(job.expect("a job").state(), expected, "job {number}; seed {seed}");
    }
}
