//! Many jobs, long ones, and some that take the service down: nobody waits for ever, and it is visible how long.

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::{
    CreateJobRequest, DeleteJobRequest, GetJobRequest, Job, JobState, ListJobsRequest, ValidateProgramRequest,
    WatchJobsRequest, validate_program_request::On,
};
use feedwave_tests::{Clients, Home, Server, patiently};
use tokio::task::JoinSet;

use crate::FEEDWAVE;

/// A job whose validation never ends by itself: weeks of rest, a setpoint every 50 µs.
fn endless() -> CreateJobRequest {
    let program = format!("G21\n{}M30\n", "G4 P80000000\n".repeat(1_000));
    CreateJobRequest {
        machine: "machines/lathe".to_owned(),
        source: Some(Source::InlineProgram(Bytes::from(program))),
        interpolation_period_us: 50,
        ..CreateJobRequest::default()
    }
}

pub(crate) async fn create_endless(clients: &mut Clients) -> Job {
    clients.jobs.create_job(endless()).await.expect("the job is created").into_inner().job.expect("a job")
}

async fn get(clients: &mut Clients, name: &str) -> Job {
    let request = GetJobRequest { name: name.to_owned() };
    clients.jobs.get_job(request).await.expect("the job is read").into_inner().job.expect("a job")
}

/// Waits until validation of a job has begun for the `count`th time.
pub(crate) async fn begins(clients: &mut Clients, name: &str, count: usize) {
    let request = WatchJobsRequest { after: Some(0), job: name.to_owned() };
    let mut events = clients.jobs.watch_jobs(request).await.expect("the job is watched").into_inner();
    let mut seen = 0;
    while seen < count {
        let event = events.message().await.expect("the watch goes on").and_then(|message| message.event);
        seen += usize::from(event.expect("an event").state() == JobState::Validating);
    }
}

#[tokio::test]
async fn a_job_that_takes_the_service_down_each_time_fails_and_others_do_not() {
    let mut home = Home::new(FEEDWAVE, "[limits]\nvalidation_workers = 2");
    let server = home.start().await;
    let mut clients = server.connect().await;
    let job = create_endless(&mut clients).await;
    begins(&mut clients, &job.name, 1).await;
    // Orderly ends do not count.
    server.signal(rustix::process::Signal::TERM);
    home = patiently(server.ended()).await.1;
    for attempt in 1..=3 {
        let server = home.start().await;
        let mut clients = server.connect().await;
        // The first one goes on where the orderly end had left it, without an event.
        begins(&mut clients, &job.name, attempt).await;
        while get(&mut clients, &job.name).await.validation_attempts != u32::try_from(attempt).unwrap() {}
        home = server.kill().await;
    }
    let server = home.start().await;
    let mut clients = server.connect().await;
    let other = clients.submit("G21\nM30\n").await.job;
    assert_eq!((other.state(), other.validation_attempts), (JobState::Ready, 1));
    let request = WatchJobsRequest { after: Some(0), job: job.name.clone() };
    let mut events = clients.jobs.watch_jobs(request).await.expect("the job is watched").into_inner();
    loop {
        let event = events.message().await.expect("the watch goes on").and_then(|message| message.event);
        let event = event.expect("an event");
        if event.state() == JobState::Failed {
            assert!(event.message.contains("ended with the service 3 time(s)"), "{event:?}");
            break;
        }
    }
    let job = get(&mut clients, &job.name).await;
    assert_eq!((job.state(), job.validation_attempts, job.validation), (JobState::Failed, 3, None));
    assert!(job.state_message.contains("ended with the service"), "{job:?}");
}

#[tokio::test]
async fn a_short_program_is_validated_while_endless_ones_hold_every_worker() {
    let limits = "[limits]\nvalidation_workers = 1\nbegun_validations = 2\nvalidation_turn_ms = 5";
    let server = Home::new(FEEDWAVE, limits).start().await;
    let mut clients = server.connect().await;
    let mut endless_jobs = Vec::new();
    for _ in 0..6 {
        endless_jobs.push(create_endless(&mut clients).await.name);
    }
    for name in &endless_jobs {
        begins(&mut clients, name, 1).await;
    }
    // As a job, and on request.
    let short = clients.submit("G21\nG0 X10. Z1.\nM30\n").await.job;
    assert_eq!(short.state(), JobState::Ready);
    let request = ValidateProgramRequest {
        inline_program: Bytes::from_static(b"G21\nM30\n"),
        on: Some(On::Machine("machines/lathe".to_owned())),
        ..ValidateProgramRequest::default()
    };
    let report = patiently(clients.jobs.validate_program(request)).await.expect("a report").into_inner().report;
    assert_eq!(report.expect("a report").summary.expect("a summary").errors, 0);

    // So is one that is longer than any turn, though every place is taken by one that never ends.
    let dwell = clients.submit("G21\nG0 X10. Z1.\nG4 P200000\nM30\n").await.job;
    assert_eq!(dwell.state(), JobState::Ready);

    // The long ones go on, and tell how far they are.
    let mut most = 0;
    while most < 100_000 {
        for name in &endless_jobs {
            let progress = get(&mut clients, name).await.validation.expect("it is not over");
            most = most.max(progress.setpoint_count);
        }
    }
    let metrics = server.web().get("/metrics").await;
    let metrics = metrics.text();
    assert!(metrics.contains("feedwave_validations_set_aside_total"), "{metrics}");
    let figure = |name: &str| -> u64 {
        let line = metrics.lines().find_map(|line| line.strip_prefix(&format!("{name} ")));
        line.unwrap_or_else(|| panic!("no {name} in {metrics}")).parse().expect("a number")
    };
    assert!(figure("feedwave_begun_validations") <= 2 && figure("feedwave_validations_set_aside_total") > 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_queue_is_counted_beyond_a_thousand_and_places_are_told() {
    let server = Home::new(FEEDWAVE, "[limits]\nvalidation_workers = 1\nbegun_validations = 1").start().await;
    let mut clients = server.connect().await;
    let first = create_endless(&mut clients).await.name;
    begins(&mut clients, &first, 1).await;
    let mut creations = JoinSet::new();
    for _ in 0..12 {
        let mut clients = server.connect().await;
        creations.spawn(async move {
            for _ in 0..100 {
                create_endless(&mut clients).await;
            }
        });
    }
    creations.join_all().await;
    let state = server.web().get("/v1/state").await.json();
    let queued = state["queuedValidations"].as_u64().expect("a number");
    assert!((1_199..=1_201).contains(&queued), "{state}");
    let metrics = server.web().get("/metrics").await;
    let metrics = metrics.text();
    let shown = metrics.lines().find_map(|line| line.strip_prefix("feedwave_validation_queue ")).expect("the queue");
    assert!((1_199..=1_201).contains(&shown.parse::<u64>().expect("a number")), "{shown}");

    let request = ListJobsRequest { page_size: 500, ..ListJobsRequest::default() };
    let jobs = clients.jobs.list_jobs(request).await.expect("the jobs are listed").into_inner().jobs;
    let places = jobs.iter().filter_map(|job| job.validation).map(|progress| progress.queue_place);
    let (least, most) = places.fold((u64::MAX, 0), |(least, most), place| (least.min(place), most.max(place)));
    assert!(least > 0 && most > 499 && most <= 1_200, "{least} to {most}");
}

#[tokio::test]
async fn deleting_jobs_that_are_validated_is_no_error() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    for _ in 0..2 {
        let job = create_endless(&mut clients).await;
        // So far that checkpoints are being stored.
        while get(&mut clients, &job.name).await.validation.is_none_or(|progress| progress.setpoint_count < 200_000) {}
        let request = DeleteJobRequest { name: job.name, etag: String::new() };
        clients.jobs.delete_job(request).await.expect("the job is deleted");
    }
    clients.submit("G21\nM30\n").await;
    let (status, log) = {
        server.signal(rustix::process::Signal::TERM);
        let log = server.home().path().join("log.txt");
        let (status, home) = patiently(server.ended()).await;
        let text = std::fs::read_to_string(log).expect("the log is read");
        drop(home);
        (status, text)
    };
    assert!(status.success() && !log.contains("ERROR"), "{log}");
}

#[tokio::test(flavor = "multi_thread")]
async fn watchers_that_do_not_read_cost_no_reads_of_the_store() {
    const WATCHERS: usize = 200;
    const JOBS: usize = 30;
    let server = Home::new(FEEDWAVE, "[connections]\nwatchers_per_client = 512").start().await;
    let mut clients = server.connect().await;
    let mut watchers = Vec::new();
    for _ in 0..WATCHERS / 100 {
        let mut clients = server.connect().await;
        for _ in 0..100 {
            let request = WatchJobsRequest { after: None, job: String::new() };
            watchers.push(clients.jobs.watch_jobs(request).await.expect("the jobs are watched").into_inner());
        }
    }
    for _ in 0..JOBS {
        clients.submit("G21\nM30\n").await;
    }
    let metrics = server.web().get("/metrics").await;
    let metrics = metrics.text();
    let reads =
        metrics.lines().find_map(|line| line.strip_prefix("feedwave_store_read_seconds_count ")).expect("reads");
    let reads: usize = reads.parse().expect("a number");
    // Three events a job; without sharing each of them would be read by each watcher.
    assert!(reads < WATCHERS * JOBS / 4, "{reads} reads");
    // They have missed nothing.
    let mut seen = 0;
    while seen < 3 * JOBS {
        let message = patiently(watchers[0].message()).await.expect("the watch goes on");
        message.expect("the watch does not end by itself");
        seen += 1;
    }
}
