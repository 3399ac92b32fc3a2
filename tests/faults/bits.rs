//! Bits that a disk lost: what still reads well is not taken for what was written.

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::program_file::Source as FileSource;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    CreateJobRequest, CreateToolRequest, DeleteJobRequest, DeleteToolRequest, GetJobRequest, GetMachineRequest,
    GetToolRequest, JobState, ListMachinesRequest, ListToolsRequest, Machine, ProgramFile, SetMonitoringRequest, Tool,
    ToolKind, UpdateMachineRequest,
};
use feedwave_tests::{Clients, Home, LIVE_PART, RunLedger, Server, live_config};
use prost_types::FieldMask;
use tonic::Code;

use crate::FEEDWAVE;
use crate::data::{assert_exit, damaged, from, jobs, read_all};

/// A service that has a record of every kind that is sealed; the name of its job.
async fn full() -> (Server, String) {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    create_tool(&mut clients).await;
    let job = clients.submit(LIVE_PART).await.job.name;
    let request = SetMonitoringRequest { job: job.clone(), config: Some(live_config()) };
    TelemetryClient::new(clients.channel.clone()).set_monitoring(request).await.expect("the configuration is valid");
    RunLedger::default().drive(clients.channel.clone(), &job, 300).await;
    (server, job)
}

async fn create_tool(clients: &mut Clients) {
    let tool = Tool { number: 11, kind: ToolKind::Turning.into(), length_mm: Some(111.0), ..Tool::default() };
    let request = CreateToolRequest { tool_id: "t11".to_owned(), tool: Some(tool) };
    clients.tools.create_tool(request).await.expect("the tool is valid");
}

/// A job that is ready, whose program calls a further file.
async fn with_subprogram(clients: &mut Clients) -> String {
    let file = Bytes::from_static(b"O1000\nG0 X11. Z2.\nM99\n");
    let further = ProgramFile { name: "O1000.nc".to_owned(), source: Some(FileSource::InlineProgram(file)) };
    let request = CreateJobRequest {
        machine: "machines/lathe".to_owned(),
        source: Some(Source::InlineProgram(Bytes::from_static(b"G21\nG0 X10. Z1.\nM98 P1000\nM30\n"))),
        programs: vec![further],
        ..CreateJobRequest::default()
    };
    let job = clients.jobs.create_job(request).await.expect("the job is created").into_inner().job.expect("a job");
    let outcome = clients.validated(&job.name).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.codes());
    job.name
}

#[tokio::test]
async fn a_lost_bit_of_any_record_is_found() {
    let (server, _) = full().await;
    assert_exit("check", server.home().path(), &[], 0, "intact").await;
    let home = damaged(server, "UPDATE probe SET at_us = 0").await;
    let intact = home.path().join("feedwave.db");
    // Each leaves a record that can be read, and says something else.
    for (kind, change) in [
        ("program", "UPDATE programs SET chunk_count = chunk_count + 2"),
        ("program", "UPDATE program_chunks SET source_bytes = source_bytes + 2"),
        ("job", "UPDATE jobs SET settings = REPLACE(settings, '1', '3')"),
        ("job", "UPDATE jobs SET settings = REPLACE(settings, '\"', '\"') || ' '"),
        ("job", "UPDATE jobs SET machine_snapshot = REPLACE(machine_snapshot, '1', '3')"),
        ("job", "UPDATE jobs SET machine_id = 'mathe'"),
        ("monitoring configuration", "UPDATE monitoring SET config = REPLACE(config, '1', '3')"),
        ("report", "UPDATE validation_reports SET summary = REPLACE(summary, '1', '3')"),
        ("report", "UPDATE validation_reports SET warning_count = warning_count + 1"),
        ("document", "UPDATE documents SET body = REPLACE(body, '1', '3') WHERE collection = 'machine'"),
        ("document", "UPDATE documents SET number = 10 WHERE collection = 'tool'"),
        ("run", "UPDATE runs SET settings = settings || ' '"),
        ("run", "UPDATE run_overrides SET ratio = ratio + 0.125"),
        ("decision", "UPDATE decisions SET at_us = at_us + 1"),
    ] {
        let copy = Home::new(FEEDWAVE, "");
        std::fs::copy(&intact, copy.path().join("feedwave.db")).expect("the database is copied");
        let server = copy.start().await;
        let copy = damaged(server, change).await;
        let text = assert_exit("check", copy.path(), &["--format", "json"], 1, "").await;
        let report: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let problem = &report["problems"][0];
        assert_eq!(problem["kind"], kind, "{change}: {text}");
        let reason = problem["reason"].as_str().expect("a reason");
        assert!(reason.contains("not as it was written") && reason.contains("seal"), "{change}: {reason}");
    }
}

#[tokio::test]
async fn a_job_with_a_lost_bit_moves_nothing() {
    for change in [
        "UPDATE jobs SET machine_snapshot = REPLACE(machine_snapshot, '1', '3')",
        "UPDATE jobs SET settings = settings || ' '",
        "UPDATE programs SET size_bytes = size_bytes - 1",
        "UPDATE program_chunks SET chunk_index = chunk_index, seal = zeroblob(32)",
        "DELETE FROM programs WHERE id IN (SELECT program_id FROM jobs)",
        "DELETE FROM programs WHERE id IN (SELECT program_id FROM job_programs)",
    ] {
        let server = Server::start(FEEDWAVE).await;
        let mut clients = server.connect().await;
        let job = with_subprogram(&mut clients).await;
        let home = damaged(server, change).await;
        let server = home.start().await;
        let mut clients = server.connect().await;
        let status = read_all(&mut clients, from(&job, 0)).await.expect_err(change);
        assert_eq!(status.code(), Code::DataLoss, "{change}: {status:?}");
        // It is marked, others are made, and it can be deleted.
        let listed = jobs(&mut clients).await.remove(0);
        assert_eq!((&listed.name, listed.state()), (&job, JobState::Failed), "{change}");
        assert!(listed.state_message.starts_with("stored data is damaged"), "{change}: {listed:?}");
        let other = clients.submit("G21\nG0 X11. Z1.\nM30\n").await.job.name;
        assert!(read_all(&mut clients, from(&other, 0)).await.expect("a stream") > 0, "{change}");
        let request = DeleteJobRequest { name: job.clone(), ..DeleteJobRequest::default() };
        clients.jobs.delete_job(request).await.expect("it is deleted");
        let gone = clients.jobs.get_job(GetJobRequest { name: job }).await.unwrap_err();
        assert_eq!(gone.code(), Code::NotFound, "{change}: {gone:?}");
    }
}

#[tokio::test]
async fn a_job_that_waits_and_has_lost_its_program_fails_with_the_reason() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit("G21\nG0 X10. Z1.\nM30\n").await.job.name;
    let home = damaged(server, "UPDATE jobs SET state = 'pending_validation'").await;
    let home = damaged(home.start().await, "DELETE FROM programs").await;
    let text = assert_exit("check", home.path(), &[], 1, "of the job is missing").await;
    assert!(text.contains(&job["jobs/".len()..]), "{text}");
    let home = damaged(home.start().await, "UPDATE jobs SET state = 'pending_validation'").await;
    let server = home.start().await;
    let mut clients = server.connect().await;
    loop {
        let listed = jobs(&mut clients).await.remove(0);
        if listed.state() == JobState::Failed {
            assert!(listed.state_message.contains("of the job is missing"), "{listed:?}");
            return;
        }
    }
}

#[tokio::test]
async fn a_machine_or_tool_with_a_lost_bit_is_named_and_put_again() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    create_tool(&mut clients).await;
    let lathe = "machines/lathe".to_owned();
    let request = GetMachineRequest { name: lathe.clone() };
    let machine = clients.machines.get_machine(request.clone()).await.expect("a machine").into_inner().machine;
    let machine = machine.expect("a machine");
    let home = damaged(server, "UPDATE documents SET body = REPLACE(body, '1', '3')").await;
    let server = home.start().await;
    let mut clients = server.connect().await;
    assert_eq!(clients.machines.get_machine(request.clone()).await.unwrap_err().code(), Code::DataLoss);
    assert_eq!(clients.create("M30\n").await.unwrap_err().code(), Code::DataLoss);
    let listed = clients.machines.list_machines(ListMachinesRequest::default()).await.expect("a list").into_inner();
    assert!(listed.unreachable.contains(&lathe) && !listed.machines.iter().any(|machine| machine.name == lathe));
    let shown = server.web().get("/v1/machines").await.json();
    assert!(shown.to_string().contains("\"machines/lathe\""), "{shown}");

    // What is left of it is not merged with what is put.
    let update = async |machine: &Machine, paths: &[&str]| {
        let paths = paths.iter().map(|&path| path.to_owned()).collect();
        let request = UpdateMachineRequest { machine: Some(machine.clone()), update_mask: Some(FieldMask { paths }) };
        clients.machines.clone().update_machine(request).await
    };
    assert_eq!(update(&machine, &["display_name"]).await.unwrap_err().code(), Code::DataLoss);
    update(&machine, &["*"]).await.expect("it is put again");
    let again = clients.machines.get_machine(request).await.expect("a machine").into_inner().machine;
    assert_eq!(again.expect("a machine").profile, machine.profile);
    clients.submit("G21\nG0 X10. Z1.\nM30\n").await;

    let tool = "tools/t11".to_owned();
    let refused = clients.tools.get_tool(GetToolRequest { name: tool.clone() }).await.unwrap_err();
    assert_eq!(refused.code(), Code::DataLoss);
    let listed = clients.tools.list_tools(ListToolsRequest::default()).await.expect("a list").into_inner();
    assert_eq!(listed.unreachable, [tool.as_str()]);
    let request = DeleteToolRequest { name: tool, ..DeleteToolRequest::default() };
    clients.tools.delete_tool(request).await.expect("it is deleted");
    create_tool(&mut clients).await;
    let home = damaged(server, "DELETE FROM documents WHERE collection = 'machine' AND id <> 'lathe'").await;
    assert_exit("check", home.path(), &[], 0, "intact").await;
}
