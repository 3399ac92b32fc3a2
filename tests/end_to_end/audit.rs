//! The audit log: every call that changes something and every refusal for want of rights, kept through `kill -9`, read by
//! admins over gRPC, HTTP and the command line.

use std::collections::BTreeMap;
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt as _;

use bytes::Bytes;
use feedwave_contract::proto::audit_client::AuditClient;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::machines_client::MachinesClient;
use feedwave_contract::proto::runs_client::RunsClient;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::tools_client::ToolsClient;
use feedwave_contract::proto::{
    AdoptToolProposalRequest, AuditEntry, CancelJobRequest, CreateMachineRequest, CreateToolRequest, DeleteJobRequest,
    DeleteMachineRequest, GetJobRequest, IngestEnd, IngestRequest, IngestStart, LearningSource,
    ListAuditEntriesRequest, ListMachinesRequest, ListRunsRequest, Machine, RecordingSettings, RunRequest, RunStart,
    RunState, SetMonitoringRequest, Tool, UpdateMachineRequest, UpdateToolRequest, ingest_request, ingest_start,
    run_request, run_start,
};
use feedwave_tests::{Home, Server, patiently, upload_messages};
use tokio::task::JoinSet;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Status};

use crate::FEEDWAVE;
use crate::access::{bearer, feedwave, token};
use crate::live_runs::config;
use crate::shop_floor::monitored;
use crate::status::assert_error;

async fn channel(server: &Server) -> Channel {
    Endpoint::from_shared(format!("http://{}", server.grpc)).unwrap().connect().await.unwrap()
}

/// The whole log, in pages of `page_size`, with the rights of a token.
async fn log(server: &Server, token: &str, page_size: i32) -> Result<Vec<AuditEntry>, Status> {
    let mut client = AuditClient::new(channel(server).await);
    let mut request = ListAuditEntriesRequest { page_size, ..ListAuditEntriesRequest::default() };
    let mut entries = Vec::new();
    loop {
        let page = client.list_audit_entries(bearer(request.clone(), token)).await?.into_inner();
        assert!(page.entries.len() <= page_size.unsigned_abs() as usize);
        entries.extend(page.entries);
        if page.next_page_token.is_empty() {
            return Ok(entries);
        }
        request.page_token = page.next_page_token;
    }
}

/// Who, what, about what, and what came of it.
fn told(entry: &AuditEntry) -> [&str; 4] {
    [&entry.principal, &entry.method, &entry.resource, &entry.result]
}

// One log is filled by every kind of caller, then read by everyone.
#[tokio::test]
async fn who_changed_what_and_who_was_refused_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("clients.toml");
    let viewer = token(&file, "dashboard", &["--role", "viewer"]).await;
    let planner = token(&file, "planning", &["--role", "planner"]).await;
    let admin = token(&file, "chief", &["--role", "admin"]).await;
    let server = Home::new(FEEDWAVE, &format!("[auth]\nclients = '{}'", file.display())).start().await;

    // A job is made, read and cancelled; reading leaves no trace.
    let mut clients = server.connect().await;
    let request = feedwave_contract::proto::CreateJobRequest {
        machine: "machines/lathe".to_owned(),
        source: Some(Source::InlineProgram(Bytes::from_static(b"M30\n"))),
        ..Default::default()
    };
    let mut created = bearer(request, &planner);
    created.metadata_mut().insert("x-request-id", "made-by-a-test".parse().unwrap());
    let job = clients.jobs.create_job(created).await.unwrap().into_inner().job.unwrap();
    assert_eq!(job.owner, "planning");
    let read = clients.jobs.get_job(bearer(GetJobRequest { name: job.name.clone() }, &viewer)).await.unwrap();
    assert_eq!(read.into_inner().job.unwrap().owner, "planning");
    clients.jobs.cancel_job(bearer(CancelJobRequest { name: job.name.clone() }, &planner)).await.unwrap();
    let unknown = DeleteJobRequest { name: "jobs/1".to_owned(), ..Default::default() };
    clients.jobs.delete_job(bearer(unknown, &planner)).await.unwrap_err();

    // The same refusal, again and again; another one; somebody unknown; and over HTTP.
    let mut machines = MachinesClient::new(channel(&server).await);
    let delete = || DeleteMachineRequest { name: "machines/mill".to_owned(), ..DeleteMachineRequest::default() };
    for _ in 0..5 {
        let status = machines.delete_machine(bearer(delete(), &viewer)).await.unwrap_err();
        assert_error(&status, Code::PermissionDenied, "ROLE_NEEDED");
    }
    machines.list_machines(bearer(ListMachinesRequest::default(), "feedwave_00")).await.unwrap_err();
    assert_eq!(server.web().get("/v1/jobs").await.status, 401);
    let status = log(&server, &planner, 50).await.unwrap_err();
    assert_error(&status, Code::PermissionDenied, "ROLE_NEEDED");

    // How often something was refused is brought into the store from time to time.
    let refused = |entries: &[AuditEntry]| {
        entries.iter().filter(|entry| entry.principal == "dashboard").map(|entry| entry.occurrences).sum::<u64>()
    };
    patiently(async { while refused(&log(&server, &admin, 2).await.unwrap()) < 5 {} }).await;
    let server = server.kill().await.start().await;
    let entries = log(&server, &admin, 3).await.unwrap();
    assert_eq!(refused(&entries), 5);
    let deleted = "/feedwave.v1.Machines/DeleteMachine";
    let mut expected = vec![
        ["planning", "/feedwave.v1.Jobs/CreateJob", job.name.as_str(), "OK"],
        ["planning", "/feedwave.v1.Jobs/CancelJob", job.name.as_str(), "OK"],
        ["planning", "/feedwave.v1.Jobs/DeleteJob", "", "INVALID_ARGUMENT"],
        ["dashboard", deleted, "", "PERMISSION_DENIED"],
        ["", "/feedwave.v1.Machines/ListMachines", "", "UNAUTHENTICATED"],
        ["", "GET /v1/jobs", "", "UNAUTHENTICATED"],
        ["planning", "/feedwave.v1.Audit/ListAuditEntries", "", "PERMISSION_DENIED"],
    ];
    let mut seen: Vec<_> = entries.iter().map(told).collect();
    // A minute may have passed between two of the same.
    seen.dedup();
    assert_eq!(seen, expected);
    assert!(entries.iter().all(|entry| entry.address == "127.0.0.1" && entry.end_time.is_some()));
    assert!(entries.windows(2).all(|pair| pair[0].sequence < pair[1].sequence && pair[0].time.is_some()));
    assert_eq!((entries[0].request_id.as_str(), entries[0].reason.as_str()), ("made-by-a-test", ""));
    assert!(entries[3].reason.contains("the role admin"), "{:?}", entries[3]);

    // The same as lines of JSON, over HTTP, and filtered.
    let url = format!("http://{}", server.grpc);
    let written = feedwave(&["audit", "--server", &url], &[("FEEDWAVE_TOKEN", admin.as_str())]).await;
    assert!(written.status.success(), "{written:?}");
    let lines = String::from_utf8(written.stdout).unwrap();
    let lines: Vec<serde_json::Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), entries.len());
    assert_eq!(lines[0]["resource"], job.name.as_str());
    let value = format!("Bearer {admin}");
    let path = "/v1/audit?pageSize=2&principal=planning";
    let page = server.web().send("GET", path, &[("authorization", value.as_str())], Bytes::new()).await;
    assert_eq!(
        page.json()["entries"].as_array().unwrap().iter().map(|entry| &entry["method"]).collect::<Vec<_>>(),
        ["/feedwave.v1.Jobs/CreateJob", "/feedwave.v1.Jobs/CancelJob"]
    );
    let after = entries[1].sequence.to_string();
    let arguments = ["audit", "--server", url.as_str(), "--after", after.as_str(), "--principal", "planning"];
    let written = feedwave(&arguments, &[("FEEDWAVE_TOKEN", admin.as_str())]).await;
    expected.retain(|entry| entry[0] == "planning");
    assert_eq!(String::from_utf8(written.stdout).unwrap().lines().count(), expected.len() - 2);
    let refused = feedwave(&["audit", "--server", &url], &[("FEEDWAVE_TOKEN", viewer.as_str())]).await;
    assert_eq!(refused.status.code(), Some(2));
    assert!(!server.log().contains(&admin[9..]));
}

/// Who follows by changes has an entry while its call is in progress, and its result when that is known, each once.
#[tokio::test]
async fn who_follows_changes_misses_no_result() {
    let server = Server::start(FEEDWAVE).await;
    let url = format!("http://{}", server.grpc);
    let follow = async |after: &str| {
        let written = feedwave(&["audit", "--server", &url, "--changed-after", after], &[]).await;
        assert!(written.status.success(), "{written:?}");
        let text = String::from_utf8(written.stdout).unwrap();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect::<Vec<serde_json::Value>>()
    };
    let mut clients = server.connect().await;
    let program: Bytes = "G4 P1\n".repeat(1_000).into();
    let (sender, messages) = tokio::sync::mpsc::channel(1);
    let mut uploader = clients.clone();
    let upload = tokio::spawn(async move { uploader.jobs.upload_program(ReceiverStream::new(messages)).await });
    let mut seen = patiently(async {
        loop {
            let seen = follow("0").await;
            if !seen.is_empty() {
                return seen;
            }
        }
    })
    .await;
    assert_eq!(seen.len(), 1, "{seen:?}");
    assert_eq!((seen[0].get("endTime"), &seen[0]["result"]), (None, &serde_json::json!("")), "{seen:?}");

    // Another call, which ends before the first one does.
    clients.create_from(Source::InlineProgram(Bytes::from_static(b"M30\n")), "").await.unwrap();
    for message in upload_messages(&program, 0, program.len()) {
        sender.send(message).await.unwrap();
    }
    drop(sender);
    patiently(upload).await.unwrap().unwrap();
    let cursor = seen[0]["change"].as_str().unwrap().to_owned();
    seen = follow(&cursor).await;
    let told: Vec<_> =
        seen.iter().map(|entry| [&entry["method"], &entry["result"]].map(|text| text.as_str().unwrap())).collect();
    assert_eq!(told, [["/feedwave.v1.Jobs/CreateJob", "OK"], ["/feedwave.v1.Jobs/UploadProgram", "OK"]]);
    assert!(follow(seen[1]["change"].as_str().unwrap()).await.is_empty());
    // By places it would be missed: its entry is older than what was read last.
    let page = server.web().get("/v1/audit?changedAfter=0&pageSize=1").await.json();
    assert_eq!(page["entries"][0]["method"], "/feedwave.v1.Jobs/CreateJob");
    assert_eq!(server.web().get("/v1/audit?changedAfter=0&after=1").await.status, 400);
}

/// What was acknowledged is in the log after `kill -9`, and what was begun without an end says so.
#[tokio::test]
async fn nothing_acknowledged_is_missing_in_the_log() {
    let server = Server::start(FEEDWAVE).await;
    let mut writers = JoinSet::new();
    for writer in 0..4 {
        let mut clients = server.connect().await;
        writers.spawn(async move {
            let mut acknowledged = Vec::new();
            loop {
                let source = Source::InlineProgram(Bytes::from_static(b"M30\n"));
                let id = format!("{writer}-{}", acknowledged.len());
                let Ok(job) = clients.create_from(source, &id).await else { return acknowledged };
                acknowledged.push((job.name.clone(), "CreateJob"));
                if acknowledged.len() % 3 == 0 {
                    let request = DeleteJobRequest { name: job.name.clone(), ..Default::default() };
                    let Ok(_) = clients.jobs.delete_job(request).await else { return acknowledged };
                    acknowledged.push((job.name, "DeleteJob"));
                }
            }
        });
    }
    // Until enough is there, by the log itself.
    patiently(async { while log(&server, "", 500).await.unwrap().len() < 300 {} }).await;
    let home = server.kill().await;
    let acknowledged: Vec<_> = writers.join_all().await.into_iter().flatten().collect();
    let server = home.start().await;
    let mut kept: BTreeMap<(String, String), u32> = BTreeMap::new();
    for entry in log(&server, "", 500).await.unwrap() {
        assert_eq!((entry.principal.as_str(), entry.tenant.as_str()), ("operator", ""));
        assert_eq!(entry.result.is_empty(), entry.end_time.is_none());
        if entry.result == "OK" {
            let method = entry.method.rsplit('/').next().unwrap().to_owned();
            *kept.entry((entry.resource, method)).or_default() += 1;
        }
    }
    assert!(acknowledged.len() >= 100, "{}", acknowledged.len());
    for (name, method) in acknowledged {
        assert_eq!(kept.get(&(name.clone(), method.to_owned())), Some(&1), "{method} {name}");
    }
}

/// A call that is refused names what it is about as one that is done does.
#[tokio::test]
async fn a_refused_call_names_what_it_was_about() {
    let server = Home::new(FEEDWAVE, "").start().await;
    let channel = channel(&server).await;
    let job = server.connect().await.submit("G21\nM30\n").await.job.name;
    let (mut machines, mut tools) = (MachinesClient::new(channel.clone()), ToolsClient::new(channel.clone()));
    let (mut telemetry, mut runs) = (TelemetryClient::new(channel.clone()), RunsClient::new(channel));
    let machine = "machines/new".to_owned();
    let create = CreateMachineRequest { machine_id: "new".to_owned(), machine: None };
    machines.create_machine(create).await.unwrap_err();
    let update = Machine { name: machine.clone(), ..Default::default() };
    let update = UpdateMachineRequest { machine: Some(update), update_mask: None };
    machines.update_machine(update).await.unwrap_err();
    machines.delete_machine(DeleteMachineRequest { name: machine.clone(), ..Default::default() }).await.unwrap_err();
    let tool = "tools/new".to_owned();
    tools.create_tool(CreateToolRequest { tool_id: "new".to_owned(), tool: None }).await.unwrap_err();
    let update = Tool { name: tool.clone(), ..Default::default() };
    tools.update_tool(UpdateToolRequest { tool: Some(update), update_mask: None }).await.unwrap_err();
    let source = LearningSource { tool: tool.clone(), ..Default::default() };
    let adopt = AdoptToolProposalRequest { source: Some(source), ..Default::default() };
    tools.adopt_tool_proposal(adopt).await.unwrap_err();
    telemetry.set_monitoring(SetMonitoringRequest { job: job.clone(), config: None }).await.unwrap_err();
    let target = |job: &str| Some(run_start::Target::Job(job.to_owned()));
    let start = RunStart { target: target(&job), start_index: 7, ..Default::default() };
    let start = RunRequest { message: Some(run_request::Message::Start(start)) };
    runs.run(tokio_stream::iter([start])).await.unwrap_err();
    let run = "runs/01900000-0000-7000-8000-000000000000".to_owned();
    let start = IngestStart {
        target: Some(ingest_start::Target::Run(run.clone())),
        recording: Some(RecordingSettings::default()),
        ..Default::default()
    };
    let start = IngestRequest { message: Some(ingest_request::Message::Start(start)) };
    telemetry.ingest(tokio_stream::iter([start])).await.unwrap_err();
    let entries = log(&server, "", 100).await.unwrap();
    let refused = entries.iter().filter(|entry| entry.result != "OK");
    let told: Vec<_> =
        refused.map(|entry| (entry.method.rsplit('/').next().unwrap(), entry.resource.clone())).collect();
    assert_eq!(
        told,
        [
            ("CreateMachine", machine.clone()),
            ("UpdateMachine", machine.clone()),
            ("DeleteMachine", machine),
            ("CreateTool", tool.clone()),
            ("UpdateTool", tool.clone()),
            ("AdoptToolProposal", tool),
            ("SetMonitoring", job.clone()),
            ("Run", job),
            ("Ingest", run),
        ]
    );
}

/// A client that goes away right after it has ended a run did not give the call up: the log agrees with the run.
#[tokio::test]
async fn the_end_of_a_run_is_logged_though_its_client_does_not_wait() {
    let server = Home::new(FEEDWAVE, "").start().await;
    let job = monitored(&server, config()).await;
    for _ in 0..16 {
        let start = IngestStart { target: Some(ingest_start::Target::Job(job.clone())), ..Default::default() };
        let messages = [ingest_request::Message::Start(start), ingest_request::Message::End(IngestEnd {})];
        let messages = messages.map(|message| IngestRequest { message: Some(message) });
        let mut client = TelemetryClient::new(channel(&server).await);
        drop(client.ingest(tokio_stream::iter(messages)).await.unwrap());
        drop(client);
        let entry = patiently(async {
            loop {
                let newest = log(&server, "", 1000).await.unwrap().pop().unwrap();
                if !newest.result.is_empty() {
                    break newest;
                }
            }
        });
        let entry = entry.await;
        let runs = ListRunsRequest { job: job.clone(), page_size: 1, ..ListRunsRequest::default() };
        let runs = TelemetryClient::new(channel(&server).await).list_runs(runs).await.unwrap().into_inner().runs;
        let is_finished = runs[0].state() == RunState::Finished;
        assert_eq!(entry.result, if is_finished { "OK" } else { "CANCELLED" }, "{entry:?} {:?}", runs[0]);
    }
}

/// What the service makes, its user alone can read; what was there keeps its mode.
#[tokio::test]
async fn files_of_the_service_are_its_users_alone() {
    let home = Home::new(FEEDWAVE, "");
    let mode = |path: &std::path::Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    std::fs::set_permissions(home.path(), Permissions::from_mode(0o755)).unwrap();
    let server = home.start().await;
    server.connect().await.submit("G21\nM30\n").await;
    let home = server.kill().await;
    if std::env::var_os("FEEDWAVE_TEST_STORE").is_none() {
        let copy = home.path().join("copy.db");
        let store = format!("sqlite://{}/feedwave.db", home.path().display());
        let written = feedwave(&["backup", "--store", &store, copy.to_str().unwrap()], &[]).await;
        assert!(written.status.success(), "{written:?}");
    }
    let made = std::fs::read_dir(home.path()).unwrap().map(|entry| entry.unwrap().path());
    let is_of_test = |path: &std::path::PathBuf| path.ends_with("feedwave.toml") || path.ends_with("log.txt");
    let made: Vec<_> = made.filter(|path| !is_of_test(path)).collect();
    assert!(made.iter().any(|path| path.ends_with("ready.json")), "{made:?}");
    for path in made {
        assert_eq!(mode(&path), 0o600, "{}", path.display());
    }
    assert_eq!(mode(home.path()), 0o755);
}
