//! Damaged data, and copies of a database: what is damaged is told, what is derived is made again, and a copy is whole or
//! not there.

use std::path::Path;
use std::process::{Output, Stdio};
use std::time::Duration;

use feedwave_contract::proto::grouping::By;
use feedwave_contract::proto::stream_setpoints_request::Start;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::window_length::Length;
use feedwave_contract::proto::{
    DecisionRules, DeleteJobRequest, FeedRule, GetJobRequest, Grouping, Job, JobState, ListJobsRequest,
    MonitoringConfig, RunCommandKind, RunSettings, SensorQuantity, Sensors, SetMonitoringRequest,
    StreamSetpointsRequest, ToolCheck, WatchDecisionsRequest, WindowLength,
};
use feedwave_tests::{
    Chance, Clients, Home, LIVE_PART, LiveClient, RunLedger, Server, live_config, long_dwell, patiently, stream,
};
use rustix::process::Signal;
use sqlx::Connection as _;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use tokio::process::Command;
use tonic::{Code, Status};

use crate::FEEDWAVE;

fn uri(folder: &Path) -> String {
    format!("sqlite://{}?busy_timeout_s=0", folder.join("feedwave.db").display())
}

fn command(name: &str, folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(FEEDWAVE);
    command.args([name, "--store", &uri(folder)]).args(arguments).kill_on_drop(true);
    command.stdin(Stdio::null());
    command
}

async fn run(name: &str, folder: &Path, arguments: &[&str]) -> Output {
    patiently(command(name, folder, arguments).output()).await.expect("the binary is started")
}

fn told(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

pub(crate) async fn assert_exit(name: &str, folder: &Path, arguments: &[&str], code: i32, words: &str) -> String {
    let output = run(name, folder, arguments).await;
    let text = told(&output);
    assert_eq!(output.status.code(), Some(code), "{name} {arguments:?}: {text}");
    assert!(text.contains(words), "{words:?} is not in: {text}");
    text
}

/// Ends a service in order and does something to its database.
pub(crate) async fn damaged(server: Server, sql: &'static str) -> Home {
    server.signal(Signal::TERM);
    let (_, home) = patiently(server.ended()).await;
    let path = home.path().join("feedwave.db");
    // A disk does not look at references.
    let options = SqliteConnectOptions::new().filename(path).foreign_keys(false);
    let mut database = SqliteConnection::connect_with(&options).await.expect("the database");
    let changed = sqlx::query(sql).execute(&mut database).await.expect("it is damaged");
    assert!(changed.rows_affected() > 0, "{sql}");
    database.close().await.expect("it is closed");
    home
}

pub(crate) async fn jobs(clients: &mut Clients) -> Vec<Job> {
    let request = ListJobsRequest { page_size: 500, ..ListJobsRequest::default() };
    clients.jobs.list_jobs(request).await.expect("the jobs are listed").into_inner().jobs
}

pub(crate) fn from(job: &str, index: u64) -> StreamSetpointsRequest {
    StreamSetpointsRequest {
        job: job.to_owned(),
        start: Some(Start::StartIndex(index)),
        ..StreamSetpointsRequest::default()
    }
}

/// How a stream ends.
pub(crate) async fn read_all(clients: &mut Clients, request: StreamSetpointsRequest) -> Result<u64, Status> {
    let mut messages = clients.setpoints.stream_setpoints(request).await?.into_inner();
    let mut count = 0;
    while messages.message().await?.is_some() {
        count += 1;
    }
    Ok(count)
}

#[tokio::test]
async fn a_damaged_checkpoint_is_made_again_and_nobody_notices() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit(&long_dwell(300)).await.job.name;
    let whole = stream(&mut clients, from(&job, 290_000)).await.expect("a stream");
    let home = damaged(server, "UPDATE job_checkpoints SET snapshot = x'00'").await;
    assert_exit("check", home.path(), &[], 1, "it is made again when it is needed").await;

    let server = home.start().await;
    let mut clients = server.connect().await;
    let again = stream(&mut clients, from(&job, 290_000)).await.expect("a stream");
    assert!(again.bits_from(290_000) == whole.bits_from(290_000) && again.len() > 1_000);
    let rebuilt = async {
        while !server.log().contains("checkpoints were made anew") {
            server.web().get("/healthz").await;
        }
    };
    patiently(rebuilt).await;
    assert_exit("check", server.home().path(), &[], 0, "intact").await;
    assert!(!server.log().contains("ERROR"), "{}", server.log());
}

/// A run that was broken off behind its first checkpoint: its job, its name, and the setpoints from the checkpoint on.
async fn broken_off(server: &Server) -> (String, String, Vec<Vec<u64>>) {
    let clients = &mut server.connect().await;
    let job = clients.submit(&long_dwell(300)).await.job.name;
    let mut telemetry = TelemetryClient::new(clients.channel.clone());
    let config = MonitoringConfig {
        sample_rate_hz: Some(1_000.0),
        tool: Some(Sensors { quantity: SensorQuantity::Displacement.into(), max: 10.0, ..Sensors::default() }),
        grouping: Some(Grouping { by: Some(By::SamplesPerPoint(10)) }),
        baseline: Some(WindowLength { length: Some(Length::DurationS(2.0)) }),
        tool_check: Some(ToolCheck { max_ratio: None, max_run_out: Some(0.5) }),
        rules: Some(DecisionRules {
            feed: Some(FeedRule { lower: 0.003, upper: 0.01, step: None }),
            ..DecisionRules::default()
        }),
        ..MonitoringConfig::default()
    };
    let request = SetMonitoringRequest { job: job.clone(), config: Some(config) };
    telemetry.set_monitoring(request).await.expect("the configuration is valid");
    let mut run = LiveClient::begin(clients.channel.clone(), &job, RunSettings::default()).await.expect("a run");
    run.reach(140_000).await.expect("setpoints");
    run.setpoints.drain(..139_000);
    // A hold is durable before it is told, and what was sent with it.
    run.command(RunCommandKind::Hold).await.expect("a hold");
    (job, run.started.run, run.setpoints)
}

#[tokio::test]
async fn a_run_with_a_damaged_checkpoint_goes_on_and_nobody_notices() {
    let server = Server::start(FEEDWAVE).await;
    let (_, name, setpoints) = broken_off(&server).await;
    let home = damaged(server, "UPDATE run_checkpoints SET snapshot = x'00'").await;
    assert_exit("check", home.path(), &[], 1, "it is made again when it is needed").await;
    let server = home.start().await;
    let channel = server.connect().await.channel;
    let mut run = LiveClient::take_up(channel, &name, 139_000).await.expect("it is taken up");
    run.reach(140_000).await.expect("setpoints");
    assert!(run.setpoints == setpoints && run.started.held);
    assert!(server.log().contains("damaged checkpoint of a run"), "{}", server.log());
}

#[tokio::test]
async fn a_run_goes_no_further_where_what_was_sent_does_not_come_again() {
    let server = Server::start(FEEDWAVE).await;
    let (_, name, _) = broken_off(&server).await;
    let home = damaged(server, "UPDATE runs SET setpoints_digest = zeroblob(32)").await;
    let server = home.start().await;
    let channel = server.connect().await.channel;
    let mut run = LiveClient::take_up(channel, &name, 139_000).await.expect("it is taken up");
    let refused = run.reach(141_000).await.unwrap_err();
    assert_eq!(refused.code(), Code::DataLoss, "{refused:?}");
    assert!(run.next_index < 140_000, "nothing that was not sent before");
}

#[tokio::test]
async fn a_decision_that_cannot_be_read_keeps_nobody_from_those_behind_it() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit(LIVE_PART).await.job.name;
    let request = SetMonitoringRequest { job: job.clone(), config: Some(live_config()) };
    TelemetryClient::new(clients.channel.clone()).set_monitoring(request).await.expect("the configuration is valid");
    RunLedger::default().drive(clients.channel.clone(), &job, 300).await;
    let listed = server.web().get("/v1/decisions").await.json();
    let listed = listed["decisions"].as_array().expect("decisions");
    assert!(listed.len() > 4, "{listed:?}");
    let is_readable = |decision: &&serde_json::Value| !["2", "3"].contains(&decision["number"].as_str().unwrap_or(""));
    let readable: Vec<_> = listed.iter().filter(is_readable).map(|decision| decision["sequence"].clone()).collect();
    let home = damaged(server, "UPDATE decisions SET body = x'ff' WHERE number IN (2, 3)").await;
    assert_exit("check", home.path(), &[], 1, "the body of decision 2 of runs/").await;

    let server = home.start().await;
    let mut greeting = server.web().open("/v1/stream", &[]).await;
    let newest = patiently(greeting.next_event()).await.expect("a greeting").id;
    let begin = format!("{}-0-0", newest.split_once('-').expect("a stamp").0);
    let mut events = server.web().open("/v1/stream", &[("last-event-id", &begin)]).await;
    let mut told = Vec::new();
    while told.len() < readable.len() {
        let event = patiently(events.next_event()).await.expect("the stream goes on");
        if event.event == "decision" {
            told.push(event.data["sequence"].clone());
        }
    }
    assert_eq!(told, readable);
    let metrics = server.web().get("/metrics").await;
    assert!(metrics.text().contains("\nfeedwave_unreadable_records_total 2\n"), "{}", metrics.text());
    assert!(server.log().contains("cannot be read, and is passed over"), "{}", server.log());

    let mut telemetry = TelemetryClient::new(server.connect().await.channel);
    let request = WatchDecisionsRequest { after: Some(0), job, ..WatchDecisionsRequest::default() };
    let mut watched = telemetry.watch_decisions(request).await.expect("decisions").into_inner();
    for sequence in readable {
        let response = patiently(watched.message()).await.expect("the stream goes on").expect("a decision");
        assert_eq!(response.decision.expect("a decision").sequence.to_string(), sequence);
    }
}

#[tokio::test]
async fn a_damaged_entry_of_the_audit_log_is_found() {
    let server = Server::start(FEEDWAVE).await;
    server.connect().await.submit("G21\nG0 X10. Z1.\nM30\n").await;
    let text = assert_exit("check", server.home().path(), &[], 0, "intact").await;
    assert!(text.contains("audit entry") && text.contains("decision"), "{text}");
    let home = damaged(server, "UPDATE audit_entries SET occurrences = -1").await;
    assert_exit("check", home.path(), &[], 1, "column occurrences holds -1").await;
}

#[tokio::test]
async fn a_job_whose_program_is_damaged_is_marked_and_others_are_not() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit("G21\nG0 X10. Z1.\nM30\n").await.job.name;
    let other = clients.submit("G21\nG0 X11. Z1.\nM30\n").await.job.name;
    let home = damaged(server, "UPDATE program_chunks SET data = x'00' WHERE content_id = 1").await;
    let text = assert_exit("check", home.path(), &["--format", "json"], 1, "a compressed record").await;
    let report: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((report["problems"][0]["kind"].as_str(), report["intact"].as_bool()), (Some("program"), Some(false)));

    let server = home.start().await;
    let mut clients = server.connect().await;
    let status = read_all(&mut clients, from(&job, 0)).await.unwrap_err();
    assert_eq!(status.code(), Code::DataLoss, "{status:?}");
    let job = clients.jobs.get_job(GetJobRequest { name: job }).await.expect("the job").into_inner().job;
    let job = job.expect("a job");
    assert_eq!(job.state(), JobState::Failed);
    assert!(job.state_message.starts_with("stored data is damaged"), "{job:?}");
    assert!(read_all(&mut clients, from(&other, 0)).await.expect("a stream") > 0);
}

#[tokio::test]
async fn a_damaged_job_is_marked_and_lists_are_whole() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit("G21\nG0 X10. Z1.\nM30\n").await.job.name;
    let home = damaged(server, "UPDATE jobs SET machine_snapshot = 'no JSON'").await;
    assert_exit("check", home.path(), &[], 1, "column machine_snapshot holds no JSON").await;
    let server = home.start().await;
    let mut clients = server.connect().await;
    let read = clients.jobs.get_job(GetJobRequest { name: job.clone() }).await.unwrap_err();
    assert_eq!(read.code(), Code::DataLoss, "{read:?}");
    let listed = jobs(&mut clients).await.remove(0);
    assert_eq!((&listed.name, listed.state()), (&job, JobState::Failed));
    assert!(listed.state_message.starts_with("stored data is damaged"), "{listed:?}");

    // One that cannot be shown whole hides no other one.
    let other = clients.submit("G21\nG0 X11. Z1.\nM30\n").await.job.name;
    let home = damaged(server, "UPDATE validation_reports SET summary = 'no JSON'").await;
    assert_exit("check", home.path(), &[], 1, "column summary holds no JSON").await;
    let server = home.start().await;
    let mut clients = server.connect().await;
    let listed = jobs(&mut clients).await;
    assert_eq!((listed.len(), &listed[0].name, &listed[0].summary), (2, &other, &None));
    let status = read_all(&mut clients, from(&other, 0)).await.unwrap_err();
    assert_eq!(status.code(), Code::DataLoss, "{status:?}");
    assert_eq!(jobs(&mut clients).await[0].state(), JobState::Failed);
    let third = clients.submit("G21\nG0 X12. Z1.\nM30\n").await.job.name;
    let home = damaged(server, "DELETE FROM validation_reports").await;
    let server = home.start().await;
    let mut clients = server.connect().await;
    let status = read_all(&mut clients, from(&third, 0)).await.unwrap_err();
    assert_eq!(status.code(), Code::DataLoss, "a job that is ready had a report: {status:?}");
    for name in [job, other, third] {
        clients.jobs.delete_job(DeleteJobRequest { name, ..DeleteJobRequest::default() }).await.expect("it is deleted");
    }
}

#[tokio::test]
async fn a_backup_is_made_while_the_service_works_and_is_restored_elsewhere() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let first = clients.submit("G21\nG0 X10. Z1.\nM30\n").await.job;
    let mut busy = server.connect().await;
    let work = tokio::spawn(async move {
        for number in 0.. {
            if busy.create(format!("G21\nG0 X{number}. Z1.\nM30\n")).await.is_err() {
                return;
            }
        }
    });
    let copy = server.home().path().join("copy");
    let to = copy.to_str().expect("text");
    assert_exit("backup", server.home().path(), &[to], 0, "written").await;
    let refused = format!("{to}: the copy cannot be made: a file of this name is there already");
    assert_exit("backup", server.home().path(), &[to], 2, &refused).await;
    let nowhere = server.home().path().join("nowhere/copy");
    let nowhere = nowhere.to_str().expect("text");
    let refused = format!("{nowhere}: the copy cannot be made: no file can be created in its folder");
    assert_exit("backup", server.home().path(), &[nowhere], 2, &refused).await;
    let in_use = format!("in use by process {} on host", server.pid());
    assert_exit("restore", server.home().path(), &[to], 2, &in_use).await;
    work.abort();

    // Into an empty place, and over what is there.
    let home = Home::new(FEEDWAVE, "");
    for _ in 0..2 {
        assert_exit("restore", home.path(), &[to], 0, "restored").await;
        assert_exit("check", home.path(), &[], 0, "intact").await;
    }
    assert!(home.path().join("feedwave.db.replaced").is_file());
    let restored = home.start().await;
    let mut there = restored.connect().await;
    let kept = there.jobs.get_job(GetJobRequest { name: first.name.clone() }).await.expect("the job").into_inner().job;
    assert_eq!(
        kept,
        Some(clients.jobs.get_job(GetJobRequest { name: first.name }).await.unwrap().into_inner().job.unwrap())
    );
    there.submit("G21\nG0 X9. Z1.\nM30\n").await;
}

#[tokio::test]
async fn what_is_newer_or_damaged_is_not_restored() {
    let server = Server::start(FEEDWAVE).await;
    server.connect().await.submit("G21\nM30\n").await;
    let newer = "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
        VALUES (9999, 'later', TRUE, x'00', 0)";
    let home = damaged(server, newer).await;
    let file = |home: &Home| home.path().join("feedwave.db").to_str().expect("text").to_owned();
    let target = Home::new(FEEDWAVE, "");
    assert_exit("restore", target.path(), &[&file(&home)], 2, "changed by a newer version").await;

    let server = Server::start(FEEDWAVE).await;
    server.connect().await.submit("G21\nM30\n").await;
    let home = damaged(server, "UPDATE validation_reports SET report = x'00'").await;
    assert_exit("restore", target.path(), &[&file(&home)], 1, "--accept-damage").await;
    assert!(!target.path().join("feedwave.db").exists());
    assert_exit("restore", target.path(), &[&file(&home), "--accept-damage"], 0, "restored").await;
    std::fs::write(target.path().join("other"), b"SQLite format 3\0 or not").expect("a file");
    let other = target.path().join("other").to_str().expect("text").to_owned();
    // It is told of the file that is wrong.
    assert_exit("restore", target.path(), &[&other], 2, &other).await;
    let absent = format!("{other}.absent");
    assert_exit("restore", target.path(), &[&absent], 2, &format!("{absent}: ")).await;
}

#[tokio::test]
async fn rows_that_are_gone_from_the_logs_are_told() {
    for (sql, told) in [
        ("DELETE FROM job_events WHERE sequence = 2", "events 2 to 2 are not there"),
        ("DELETE FROM job_events WHERE sequence > 1", "events 2 to "),
        ("DELETE FROM audit_entries WHERE sequence = 1", "entries are there"),
    ] {
        let server = Server::start(FEEDWAVE).await;
        let mut clients = server.connect().await;
        for _ in 0..2 {
            clients.submit("G21\nM30\n").await;
        }
        assert_exit("check", server.home().path(), &[], 0, "intact").await;
        let home = damaged(server, sql).await;
        assert_exit("check", home.path(), &[], 1, told).await;
    }
    // What retention removes is not missing.
    let server = Server::start(FEEDWAVE).await;
    server.connect().await.submit("G21\nM30\n").await;
    let home = damaged(server, "DELETE FROM job_events WHERE sequence <= 2").await;
    assert_exit("check", home.path(), &[], 0, "intact").await;
}

#[tokio::test]
async fn a_copy_is_whole_or_not_there_whenever_it_is_killed() {
    // The moments are random; a failure names the seed.
    let mut chance = Chance::new();
    let seed = chance.seed();
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    for number in 0..20 {
        clients.submit(&format!("G21\nG0 X{number}. Z1.\nM30\n")).await;
    }
    let old = Home::new(FEEDWAVE, "").start().await;
    old.connect().await.submit("G21\nM30\n").await;
    old.signal(Signal::TERM);
    let (_, target) = patiently(old.ended()).await;

    for round in 0..12 {
        let copy = server.home().path().join(format!("copy-{round}"));
        let name = copy.to_str().expect("text");
        let moment = Duration::from_micros(chance.up_to(60_000));
        let (command_name, folder, arguments) = if round % 2 == 0 {
            ("backup", server.home().path(), [name])
        } else {
            let whole = server.home().path().join("whole");
            if !whole.exists() {
                assert_exit("backup", server.home().path(), &[whole.to_str().expect("text")], 0, "written").await;
            }
            std::fs::copy(&whole, &copy).expect("a copy");
            ("restore", target.path(), [name])
        };
        let mut child = command(command_name, folder, &arguments)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the binary is started");
        let ended = tokio::time::timeout(moment, child.wait()).await;
        if ended.is_err() {
            child.kill().await.expect("it is killed");
        }
        if copy.exists() {
            let home = Home::new(FEEDWAVE, "");
            assert_exit("restore", home.path(), &[name], 0, "restored").await;
        }
        let text = assert_exit("check", target.path(), &[], 0, "intact").await;
        assert!(text.contains("1 job(s)") || text.contains("20 job(s)"), "seed {seed}: {text}");
    }
    assert_eq!(jobs(&mut clients).await.len(), 20);
    target.start().await.connect().await.submit("G21\nM30\n").await;
}

#[tokio::test]
async fn what_is_kept_no_longer_is_removed_but_not_by_a_dry_run() {
    let mut home = Home::new(FEEDWAVE, "[retention]\njobs_days = 7\nprograms_days = 7\nevents_days = 7");
    home.set_environment(vec![("FEEDWAVE_RETENTION__DRY_RUN".to_owned(), "true".to_owned())]);
    let server = home.start().await;
    let mut clients = server.connect().await;
    for number in 0..5 {
        clients.submit(&format!("G21\nG0 X{number}. Z1.\nM30\n")).await;
    }
    // Eight days later for the first three, their programs and all events.
    let later = "UPDATE jobs SET updated_us = updated_us - 691200000000
        WHERE id IN (SELECT id FROM jobs ORDER BY sequence LIMIT 3)";
    let home = damaged(server, later).await;
    let server = home.start().await;
    let home = damaged(server, "UPDATE programs SET created_us = created_us - 691200000000 WHERE sequence <= 3").await;
    let server = home.start().await;
    let mut home = damaged(server, "UPDATE job_events SET at_us = at_us - 691200000000").await;

    let removed = async |server: &Server, words: &str| {
        while !server.log().contains(words) {
            server.web().get("/healthz").await;
        }
    };
    let server = home.start().await;
    patiently(removed(&server, "dry run: this would be removed jobs=3 runs=0 programs=3 events=15")).await;
    let metrics = server.web().get("/metrics").await;
    assert!(metrics.text().contains("feedwave_retention_expired{kind=\"jobs\"} 3"), "{}", metrics.text());
    assert_eq!(jobs(&mut server.connect().await).await.len(), 5);
    home = server.kill().await;

    home.set_environment(Vec::new());
    let server = home.start().await;
    patiently(removed(&server, "retention: removed jobs=3 runs=0 programs=3 events=15")).await;
    let metrics = server.web().get("/metrics").await;
    assert!(metrics.text().contains("feedwave_retention_removed_total{kind=\"programs\"} 3"), "{}", metrics.text());
    assert_eq!(jobs(&mut server.connect().await).await.len(), 2);
    let text = assert_exit("check", server.home().path(), &[], 0, "intact").await;
    assert!(text.contains("2 program(s)") && text.contains("2 job(s)"), "{text}");
}
