//! A disk that is full, fails, hangs or is gone: nothing is acknowledged that is not kept, everybody is told at once, and the
//! service goes on when the disk does.

use std::fs::File;
use std::os::unix::fs::PermissionsExt as _;
use std::process::Stdio;
use std::time::Duration;

use feedwave_contract::proto::{
    DeleteJobRequest, GetJobRequest, GetPlanSummaryRequest, GetReportRequest, Job, JobState, ListJobsRequest,
    ProgramsDeleteProgramRequest, ReadProgramRequest, StreamSetpointsRequest, WatchJobsRequest,
};
use feedwave_tests::{Clients, Home, Server, patiently, stream, upload};
use rustix::process::{Pid, Signal, kill_process};
use tokio::process::Command;
use tonic::{Code, Status};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use tonic_types::StatusExt as _;

use crate::FEEDWAVE;
use crate::library::{EDQUOT, EIO, ENOSPC, Faults};

const PROGRAM: &str = "G21\nG0 X10. Z1.\nM30\n";

async fn start(faults: &Faults) -> Server {
    let mut home = Home::new(FEEDWAVE, "");
    home.set_environment(faults.environment.clone());
    home.start().await
}

/// Waits until `/readyz` answers so, with these words.
async fn readiness(server: &Server, status: u16, words: &str) {
    let answered = async {
        loop {
            let answer = server.web().get("/readyz").await;
            if answer.status == status && answer.text().contains(words) {
                return;
            }
        }
    };
    patiently(answered).await;
}

/// Waits until gRPC health says so.
async fn health(clients: &Clients, status: ServingStatus) {
    let mut health = HealthClient::new(clients.channel.clone());
    let mut watch = health.watch(HealthCheckRequest::default()).await.expect("health is watched").into_inner();
    while patiently(watch.message()).await.expect("the watch goes on").expect("a status").status() != status {}
    // Whatever the store does, the process lives: nobody shall restart it.
    let liveness = HealthCheckRequest { service: "liveness".to_owned() };
    let lives = health.check(liveness).await.expect("health is told").into_inner();
    assert_eq!(lives.status(), ServingStatus::Serving);
}

fn assert_unavailable(status: &Status) {
    assert_eq!(status.code(), Code::Unavailable, "{status:?}");
    assert_eq!(status.get_error_details().error_info().expect("details").reason, "STORE_UNAVAILABLE");
    assert!(status.get_error_details().retry_info().is_some_and(|info| info.retry_delay.is_some()), "{status:?}");
}

/// What holds whatever the fault is: told while it lasts, over without a restart, and nothing acknowledged lost.
async fn survives(reason: &str, begin: impl AsyncFnOnce(&Server, &Faults), end: impl AsyncFnOnce(&Server, &Faults)) {
    let faults = Faults::new();
    let server = start(&faults).await;
    let mut clients = server.connect().await;
    let before: Job = clients.submit(PROGRAM).await.job;
    readiness(&server, 200, "ok").await;
    begin(&server, &faults).await;
    let told = patiently(clients.create("G21\nG0 X11. Z1.\nM30\n")).await;
    if let Err(status) = &told {
        assert_unavailable(status);
    }
    readiness(&server, 503, reason).await;
    health(&clients, ServingStatus::NotServing).await;
    // From now on it is known: refused at once.
    assert_unavailable(&patiently(clients.create("G21\nG0 X12. Z1.\nM30\n")).await.unwrap_err());
    let metrics = server.web().get("/metrics").await;
    assert!(metrics.text().contains("feedwave_store_writable 0"), "{}", metrics.text());

    end(&server, &faults).await;
    readiness(&server, 200, "ok").await;
    health(&clients, ServingStatus::Serving).await;
    let after = clients.submit(PROGRAM).await.job;
    let mut kept = vec![before.name, after.name];
    kept.extend(told.map(|job| job.name));
    let server = server.kill().await.start().await;
    let mut clients = server.connect().await;
    for name in kept {
        clients.jobs.get_job(GetJobRequest { name }).await.expect("what was acknowledged is kept");
    }
}

#[tokio::test]
async fn a_full_disk() {
    let begin = async |_: &Server, faults: &Faults| faults.writes_fail(ENOSPC);
    survives("the disk is full", begin, async |_, faults| faults.writes_fail(0)).await;
}

#[tokio::test]
async fn a_disk_that_fails_to_write() {
    let begin = async |_: &Server, faults: &Faults| faults.writes_fail(EIO);
    survives("reading or writing the file failed", begin, async |_, faults| faults.writes_fail(0)).await;
}

#[tokio::test]
async fn a_disk_that_fails_to_synchronise() {
    let begin = async |_: &Server, faults: &Faults| faults.syncs_fail(EIO);
    survives("reading or writing the file failed", begin, async |_, faults| faults.syncs_fail(0)).await;
}

#[tokio::test]
async fn a_log_that_cannot_be_moved_into_the_database() {
    let faults = Faults::new();
    let server = start(&faults).await;
    let clients = &mut server.connect().await;
    let mut kept = vec![clients.submit(PROGRAM).await.job.name];
    faults.spare_log(true);
    faults.writes_fail(ENOSPC);
    // What the log has room for is kept as ever, but nobody thinks that all is well.
    kept.push(clients.submit("G21\nG0 X11. Z1.\nM30\n").await.job.name);
    readiness(&server, 503, "the disk is full").await;
    health(clients, ServingStatus::NotServing).await;
    kept.push(clients.submit("G21\nG0 X12. Z1.\nM30\n").await.job.name);
    faults.writes_fail(0);
    readiness(&server, 200, "ok").await;
    health(clients, ServingStatus::Serving).await;
    let server = server.kill().await.start().await;
    let mut clients = server.connect().await;
    for name in kept {
        clients.jobs.get_job(GetJobRequest { name }).await.expect("what was acknowledged is kept");
    }
}

#[tokio::test]
async fn a_disk_that_does_not_answer() {
    let begin = async |_: &Server, faults: &Faults| faults.syncs_hang(true);
    survives("does not answer in time", begin, async |_, faults| faults.syncs_hang(false)).await;
}

#[tokio::test]
async fn a_slow_disk_is_waited_for() {
    let faults = Faults::new();
    let server = start(&faults).await;
    let mut clients = server.connect().await;
    let mut kept = vec![clients.submit(PROGRAM).await.job.name];
    faults.syncs_take_longer(100);
    let creations = (0..16).map(|number| {
        let mut clients = clients.clone();
        async move { clients.create(format!("G21\nG0 X{number}. Z1.\nM30\n")).await }
    });
    for created in patiently(futures_util::future::join_all(creations)).await {
        match created {
            Ok(job) => kept.push(job.name),
            Err(status) => assert_unavailable(&status),
        }
    }
    // Slowness alone is no reason to be sent away.
    kept.push(clients.submit("G21\nG0 X20. Z1.\nM30\n").await.job.name);
    readiness(&server, 200, "ok").await;
    let server = server.kill().await.start().await;
    let mut clients = server.connect().await;
    for name in kept {
        clients.jobs.get_job(GetJobRequest { name }).await.expect("what was acknowledged is kept");
    }
}

#[tokio::test]
async fn a_quota_that_is_used_up() {
    let begin = async |_: &Server, faults: &Faults| faults.writes_fail(EDQUOT);
    survives("reading or writing the file failed", begin, async |_, faults| faults.writes_fail(0)).await;
}

#[tokio::test]
async fn a_disk_that_fails_to_read_is_no_damage() {
    let faults = Faults::new();
    let server = start(&faults).await;
    let name = server.connect().await.submit(&noise(1)).await.job.name;
    // What has just been started has the program nowhere but on the disk.
    let server = server.kill().await.start().await;
    let mut clients = server.connect().await;
    faults.reads_fail(EIO);
    assert_unavailable(&stream(&mut clients, setpoints_of(&name)).await.map(drop).unwrap_err());
    // It may still know the report.
    if let Err(status) = clients.jobs.get_report(GetReportRequest { job: name.clone() }).await {
        assert_unavailable(&status);
    }
    let store = format!("sqlite://{}", server.home().path().join("feedwave.db").display());
    let mut check = Command::new(FEEDWAVE);
    check.args(["check", "--store", &store]).envs(faults.environment.iter().cloned());
    let check = patiently(check.output()).await.expect("it is started");
    let told = String::from_utf8_lossy(&check.stderr);
    assert!(check.status.code() == Some(2) && told.contains("reading the file failed"), "{}: {told}", check.status);

    faults.reads_fail(0);
    readiness(&server, 200, "ok").await;
    let job = clients.jobs.get_job(GetJobRequest { name }).await.expect("it is there").into_inner().job.expect("a job");
    assert_eq!(job.state(), JobState::Ready, "{}", job.state_message);
    assert!(!server.log().contains("marked as damaged"), "{}", server.log());
}

#[tokio::test]
async fn reads_that_hang_end_calls_and_streams() {
    let faults = Faults::new();
    let mut home = Home::new(FEEDWAVE, "");
    let file = home.path().join("feedwave.db").display().to_string();
    let uri = format!("sqlite://{file}?read_timeout_s=1&busy_timeout_s=1");
    let mut environment = faults.environment.clone();
    environment.push(("FEEDWAVE_STORE__URI".to_owned(), uri));
    home.set_environment(environment);
    let server = home.start().await;
    let job = server.connect().await.submit(&noise(1)).await.job;
    // What has just been started has them nowhere but on the disk.
    let server = server.kill().await.start().await;
    let mut clients = server.connect().await;
    faults.reads_hang(true);
    let told = [
        clients.jobs.list_jobs(ListJobsRequest::default()).await.map(drop),
        clients.setpoints.get_plan_summary(GetPlanSummaryRequest { job: job.name.clone() }).await.map(drop),
        stream(&mut clients, setpoints_of(&job.name)).await.map(drop),
        read(&mut clients, &job.program, || {}).await,
        watch(&mut clients, &job).await,
    ];
    for told in told {
        assert_unavailable(&told.expect_err("nothing can be read"));
    }
    assert_eq!(server.web().get("/v1/jobs").await.status, 503);

    faults.reads_hang(false);
    readiness(&server, 200, "ok").await;
    stream(&mut clients, setpoints_of(&job.name)).await.expect("the job is there");
    read(&mut clients, &job.program, || {}).await.expect("the program is there");
    assert!(!server.log().contains("marked as damaged"), "{}", server.log());
}

fn setpoints_of(job: &str) -> StreamSetpointsRequest {
    StreamSetpointsRequest { job: job.to_owned(), ..StreamSetpointsRequest::default() }
}

/// Reads a program to its end; `begun` is called once the first piece has come.
async fn read(clients: &mut Clients, name: &str, begun: impl FnOnce()) -> Result<(), Status> {
    let request = ReadProgramRequest { name: name.to_owned(), ..ReadProgramRequest::default() };
    let mut pieces = clients.programs.read_program(request).await?.into_inner();
    let mut begun = Some(begun);
    while pieces.message().await?.is_some() {
        if let Some(begun) = begun.take() {
            begun();
        }
    }
    Ok(())
}

/// Watches a job from its first event on, until it is refused.
async fn watch(clients: &mut Clients, job: &Job) -> Result<(), Status> {
    let request = WatchJobsRequest { after: Some(0), job: job.name.clone() };
    let mut events = clients.jobs.watch_jobs(request).await?.into_inner();
    events.message().await.map(drop)
}

#[tokio::test]
async fn a_disk_that_fails_under_a_stream_is_no_damage() {
    let faults = Faults::new();
    let server = start(&faults).await;
    let mut clients = server.connect().await;
    let program: String = (1..=16).map(noise).collect();
    let name = upload(&mut clients, &program.into()).await.expect("it is taken");
    let server = server.kill().await.start().await;
    let mut clients = server.connect().await;
    let told = read(&mut clients, &name, || faults.reads_fail(EIO)).await;
    assert_unavailable(&told.expect_err("the rest cannot be read"));
    faults.reads_fail(0);
    readiness(&server, 200, "ok").await;
    read(&mut clients, &name, || {}).await.expect("the program is there");
}

#[tokio::test]
async fn a_file_that_is_gone() {
    let rename = async |server: &Server, from: &str, to: &str| {
        let folder = server.home().path();
        std::fs::rename(folder.join(from), folder.join(to)).expect("it is renamed");
    };
    let begin = async |server: &Server, _: &Faults| rename(server, "feedwave.db", "elsewhere.db").await;
    let end = async |server: &Server, _: &Faults| rename(server, "elsewhere.db", "feedwave.db").await;
    survives("removed or replaced", begin, end).await;
}

#[tokio::test]
async fn what_is_written_into_a_removed_file_is_not_acknowledged() {
    for (behind, reason) in
        [("", "its file was removed"), ("-wal", "(-wal) was removed"), ("-shm", "(-shm) was removed")]
    {
        let server = Server::start(FEEDWAVE).await;
        let mut clients = server.connect().await;
        let before = clients.submit(PROGRAM).await.job.name;
        std::fs::remove_file(server.home().path().join(format!("feedwave.db{behind}"))).expect("it is removed");
        let told = clients.create("G21\nG0 X11. Z1.\nM30\n").await.map(|job| job.name);
        assert_unavailable(&told.unwrap_err());
        readiness(&server, 503, reason).await;
        health(&clients, ServingStatus::NotServing).await;
        if behind.is_empty() {
            continue;
        }
        // The end in order moves what the log has into the database.
        server.signal(Signal::TERM);
        let (_, home) = patiently(server.ended()).await;
        let server = home.start().await;
        let mut clients = server.connect().await;
        clients.jobs.get_job(GetJobRequest { name: before }).await.expect("what was acknowledged is kept");
        clients.submit(PROGRAM).await;
    }
}

#[tokio::test]
async fn a_hanging_disk_does_not_keep_the_process_alive() {
    let faults = Faults::new();
    let mut home = Home::new(FEEDWAVE, "[limits]\ndrain_s = 1");
    home.set_environment(faults.environment.clone());
    let server = home.start().await;
    server.connect().await.submit(PROGRAM).await;
    faults.syncs_hang(true);
    readiness(&server, 503, "").await;
    server.signal(Signal::TERM);
    patiently(server.ended()).await;
}

#[tokio::test]
async fn records_are_removed_while_there_is_no_room_for_others() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit(PROGRAM).await.job;
    let mut home = server.kill().await;
    // More than any disk has is kept free.
    let uri = format!("sqlite://{}?headroom_mib=1073741824", home.path().join("feedwave.db").display());
    home.set_environment(vec![("FEEDWAVE_STORE__URI".to_owned(), uri)]);
    let server = home.start().await;
    readiness(&server, 503, "full but for what is kept").await;
    let mut clients = server.connect().await;
    assert_unavailable(&clients.create("G21\nG0 X11. Z1.\nM30\n").await.unwrap_err());
    clients
        .jobs
        .delete_job(DeleteJobRequest { name: job.name.clone(), etag: String::new() })
        .await
        .expect("it is deleted");
    let name = job.program;
    clients.programs.delete_program(ProgramsDeleteProgramRequest { name }).await.expect("it is deleted");

    let mut home = server.kill().await;
    home.set_environment(Vec::new());
    let server = home.start().await;
    let mut clients = server.connect().await;
    let gone = clients.jobs.get_job(GetJobRequest { name: job.name }).await.unwrap_err();
    assert_eq!(gone.code(), Code::NotFound, "{gone:?}");
    clients.submit(PROGRAM).await;
}

#[tokio::test]
async fn a_start_on_a_hanging_disk_says_so_and_can_be_ended() {
    let faults = Faults::new();
    let home = Home::new(FEEDWAVE, "");
    faults.syncs_hang(true);
    let log = home.path().join("log.txt");
    let mut starting = Command::new(FEEDWAVE)
        .args(["serve", "--config"])
        .arg(home.path().join("feedwave.toml"))
        .envs(faults.environment.iter().cloned())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(File::create(&log).expect("a file"))
        .kill_on_drop(true)
        .spawn()
        .expect("the service is started");
    let told = async {
        let mut ticks = tokio::time::interval(Duration::from_millis(20));
        while !std::fs::read_to_string(&log).expect("the log").contains("waiting for the store") {
            ticks.tick().await;
        }
    };
    patiently(told).await;
    let pid = starting.id().and_then(|id| Pid::from_raw(id.cast_signed())).expect("it runs");
    kill_process(pid, Signal::TERM).expect("it is told to end");
    let ended = patiently(starting.wait()).await.expect("it ends");
    assert!(ended.success(), "{ended}: {}", std::fs::read_to_string(&log).expect("the log"));
}

/// A program of comments that hardly compress.
fn noise(mut state: u64) -> String {
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        char::from(b'a' + (state >> 59) as u8 % 26)
    };
    let comment: String = (0..900_000).map(|index| if index % 60 == 59 { '\n' } else { noise() }).collect();
    let lines = comment.lines().map(|line| format!("({line})\n")).collect::<String>();
    format!("G21\n{lines}M30\n")
}

/// Creates jobs until one is refused: those that were acknowledged, and the refusal.
async fn fill(clients: &mut Clients) -> (Vec<String>, Status) {
    let mut kept = Vec::new();
    loop {
        match clients.create(noise(kept.len() as u64 + 1)).await {
            Ok(job) => kept.push(job.name),
            Err(status) => return (kept, status),
        }
        assert!(kept.len() < 1_000, "nothing is full");
    }
}

#[tokio::test]
async fn a_limit_of_file_sizes_does_not_end_the_process() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wrapper = folder.path().join("feedwave");
    std::fs::write(&wrapper, format!("#!/bin/sh\nulimit -f 16384\nexec {FEEDWAVE} \"$@\"\n")).expect("a script");
    std::fs::set_permissions(&wrapper, std::fs::Permissions::from_mode(0o755)).expect("it can be run");
    let server = Home::new(&wrapper, "").start().await;
    let mut clients = server.connect().await;
    let (kept, status) = fill(&mut clients).await;
    assert_unavailable(&status);
    // Small writes find room again as soon as the log could be moved into the database: either answer is right.
    let afterwards = clients.create(PROGRAM).await;
    if let Err(status) = afterwards {
        assert_unavailable(&status);
    }
    for name in kept {
        clients.jobs.get_job(GetJobRequest { name }).await.expect("what was acknowledged is kept");
    }
}

/// Run by `tests/faults/long.sh`, with temporary files on a file system of 48 MiB.
#[tokio::test]
#[ignore = "needs a small file system"]
async fn a_small_disk_that_fills_up() {
    let server = Server::start(FEEDWAVE).await;
    let filler = server.home().path().join("filler");
    std::fs::write(&filler, vec![1; 16 << 20]).expect("there is room at first");
    let mut clients = server.connect().await;
    let (kept, status) = fill(&mut clients).await;
    assert_unavailable(&status);
    readiness(&server, 503, "the disk is full").await;
    std::fs::remove_file(filler).expect("it is removed");
    readiness(&server, 200, "ok").await;
    clients.submit(PROGRAM).await;
    let server = server.kill().await.start().await;
    let mut clients = server.connect().await;
    for name in kept {
        clients.jobs.get_job(GetJobRequest { name }).await.expect("what was acknowledged is kept");
    }
}
