//! Jobs: created, validated, listed, refused, cancelled, deleted.

use std::collections::BTreeSet;

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::validate_program_request::On;
use feedwave_contract::proto::{
    CancelJobRequest, CreateJobRequest, CreateMachineRequest, DeleteJobRequest, DeleteProgramRequest, GetJobRequest,
    GetMachineRequest, GetPlanSummaryRequest, GetReportRequest, GetToolRequest, JobState, ListJobEventsRequest,
    ListJobsRequest, ProgramsDeleteProgramRequest, Severity, StreamSetpointsRequest, ValidateProgramRequest,
};
use feedwave_tests::{SHAFT, SHAFT_CURED, Server, long_dwell, stream};
use tonic::Code;

use crate::FEEDWAVE;
use crate::status::{assert_error, violated_fields};

#[tokio::test]
async fn the_chip_that_never_breaks_is_reported_with_its_cure_and_the_cure_works() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;

    let trap = clients.submit(SHAFT).await;
    assert_eq!(trap.job.state(), JobState::Ready, "a warning does not refuse: {:?}", trap.report);
    let finding = trap.report.findings.iter().find(|finding| finding.code == "VIB-CHIP-UNBROKEN");
    let finding = finding.unwrap_or_else(|| panic!("{:?}", trap.codes()));
    assert_eq!((finding.severity(), finding.line), (Severity::Warning, 5));
    let suggested: Vec<f64> =
        finding.suggestions.iter().filter_map(|suggestion| Some(suggestion.value.as_ref()?.value)).collect();
    for frequency_hz in [125.0 / 3.0, 175.0 / 3.0] {
        assert!(suggested.iter().any(|value| (value - frequency_hz).abs() < 1e-3), "{suggested:?}");
    }

    let cured = clients.submit(SHAFT_CURED).await;
    assert_eq!(cured.job.state(), JobState::Ready);
    assert!(!cured.codes().contains(&"VIB-CHIP-UNBROKEN"), "{:?}", cured.codes());
    let [section] = cured.report.sections.as_slice() else { panic!("{:?}", cured.report.sections) };
    assert_eq!((section.first_line, section.last_line), (6, 7));
}

#[tokio::test]
async fn a_program_with_errors_is_stored_as_rejected_with_its_report() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let outcome = clients.submit("G21 G97 S1000 M3\nG1 X10. Z-5. F0.1\nG777 Q5.\nG1 Z-9\nG201\nM30\n").await;
    assert_eq!(outcome.job.state(), JobState::Rejected);
    let errors: BTreeSet<u32> = outcome
        .report
        .findings
        .iter()
        .filter(|finding| finding.severity() == Severity::Error)
        .map(|finding| finding.line)
        .collect();
    assert!(errors.contains(&3) && errors.contains(&5), "all errors in one pass: {:?}", outcome.report.findings);
    assert!(outcome.report.findings.iter().all(|finding| finding.column >= 1 && !finding.message.is_empty()));

    let request = StreamSetpointsRequest { job: outcome.job.name.clone(), ..StreamSetpointsRequest::default() };
    let refused = stream(&mut clients, request).await.unwrap_err();
    assert_eq!(refused.code(), Code::FailedPrecondition, "{refused:?}");
}

#[tokio::test]
async fn validation_alone_stores_nothing() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let request = ValidateProgramRequest {
        inline_program: SHAFT.as_bytes().into(),
        on: Some(On::Machine("machines/lathe".to_owned())),
        ..ValidateProgramRequest::default()
    };
    let report = clients.jobs.validate_program(request).await.unwrap().into_inner().report.unwrap();
    assert!(report.findings.iter().any(|finding| finding.code == "VIB-CHIP-UNBROKEN"));
    let listed = clients.jobs.list_jobs(ListJobsRequest::default()).await.unwrap().into_inner();
    assert_eq!(listed.jobs, []);
    let events = clients.jobs.list_job_events(ListJobEventsRequest::default()).await.unwrap().into_inner();
    assert_eq!(events.events, []);
}

#[tokio::test]
async fn a_repeated_request_id_makes_one_job() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let source = |program: &str| Source::InlineProgram(Bytes::from(program.to_owned()));
    let first = clients.create_from(source(SHAFT), "shift-1").await.unwrap();
    let again = clients.create_from(source(SHAFT), "shift-1").await.unwrap();
    assert_eq!(first.name, again.name);
    let other = clients.create_from(source(SHAFT_CURED), "shift-1").await.unwrap_err();
    assert_error(&other, Code::AlreadyExists, "REQUEST_ID_REUSED");
    let without = clients.create_from(source(SHAFT), "").await.unwrap();
    assert_ne!(first.name, without.name);
    let listed = clients.jobs.list_jobs(ListJobsRequest::default()).await.unwrap().into_inner();
    let names: Vec<_> = listed.jobs.iter().map(|job| job.name.as_str()).collect();
    assert_eq!(names, [&without.name, &first.name], "newest first");
}

#[tokio::test]
async fn every_field_that_is_wrong_is_named_at_once() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let request = CreateJobRequest {
        request_id: "x".repeat(65),
        machine: "lathe".to_owned(),
        source: None,
        display_name: "n".repeat(201),
        interpolation_period_us: 7,
        generation_mode: 99,
        tools: vec!["tools/ok".to_owned(), "drill".to_owned()],
        ..CreateJobRequest::default()
    };
    let status = clients.jobs.create_job(request).await.unwrap_err();
    let fields = violated_fields(&status);
    for field in ["display_name", "generation_mode", "interpolation_period_us", "machine", "request_id"] {
        assert!(fields.iter().any(|violated| violated == field), "{field} is not in {fields:?}");
    }
    assert!(fields.iter().any(|field| field.starts_with("tools[1]")), "{fields:?}");
    assert!(fields.len() >= 7, "the missing program too: {fields:?}");
}

#[tokio::test]
async fn what_does_not_exist_is_not_found() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let nobody = "jobs/01900000-0000-7000-8000-000000000001".to_owned();
    let job = clients.jobs.get_job(GetJobRequest { name: nobody.clone() }).await.unwrap_err();
    let report = clients.jobs.get_report(GetReportRequest { job: nobody.clone() }).await.unwrap_err();
    let cancel = clients.jobs.cancel_job(CancelJobRequest { name: nobody.clone() }).await.unwrap_err();
    let delete = DeleteJobRequest { name: nobody.clone(), etag: String::new() };
    let delete = clients.jobs.delete_job(delete).await.unwrap_err();
    let summary = GetPlanSummaryRequest { job: nobody.clone() };
    let summary = clients.setpoints.get_plan_summary(summary).await.unwrap_err();
    let request = StreamSetpointsRequest { job: nobody, ..StreamSetpointsRequest::default() };
    let setpoints = stream(&mut clients, request).await.unwrap_err();
    let machine = GetMachineRequest { name: "machines/nowhere".to_owned() };
    let machine = clients.machines.get_machine(machine).await.unwrap_err();
    let tool = clients.tools.get_tool(GetToolRequest { name: "tools/none".to_owned() }).await.unwrap_err();
    let program = ProgramsDeleteProgramRequest { name: format!("programs/{}", "0".repeat(64)) };
    let program = clients.programs.delete_program(program).await.unwrap_err();
    let create = CreateJobRequest {
        machine: "machines/nowhere".to_owned(),
        source: Some(Source::InlineProgram(SHAFT.as_bytes().into())),
        ..CreateJobRequest::default()
    };
    let create = clients.jobs.create_job(create).await.unwrap_err();
    for status in [job, report, cancel, delete, summary, setpoints, machine, tool, program, create] {
        assert_error(&status, Code::NotFound, "RESOURCE_NOT_FOUND");
    }
    let malformed = clients.jobs.get_job(GetJobRequest { name: "jobs/7".to_owned() }).await.unwrap_err();
    assert_eq!(violated_fields(&malformed), ["name"]);
}

#[tokio::test]
async fn lists_are_cut_into_pages_that_cover_everything_once() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let mut created = Vec::new();
    for number in 0..7 {
        let job = clients.create(format!("G0 X{number}. Z1.\nM30\n")).await.unwrap();
        created.push(job.name);
    }
    let mut listed = Vec::new();
    let mut page_token = String::new();
    loop {
        let request = ListJobsRequest { page_size: 3, page_token, ..ListJobsRequest::default() };
        let page = clients.jobs.list_jobs(request).await.unwrap().into_inner();
        assert!(page.jobs.len() <= 3);
        listed.extend(page.jobs.into_iter().map(|job| job.name));
        page_token = page.next_page_token;
        if page_token.is_empty() {
            break;
        }
    }
    created.reverse();
    assert_eq!(listed, created);

    let request = ListJobsRequest { page_token: "made up".to_owned(), ..ListJobsRequest::default() };
    assert_eq!(violated_fields(&clients.jobs.list_jobs(request).await.unwrap_err()), ["page_token"]);
    let request = ListJobsRequest { machine: "machines/mill".to_owned(), ..ListJobsRequest::default() };
    assert_eq!(clients.jobs.list_jobs(request).await.unwrap().into_inner().jobs, []);
    let request = ListJobsRequest { states: vec![JobState::Rejected.into()], ..ListJobsRequest::default() };
    assert_eq!(clients.jobs.list_jobs(request).await.unwrap().into_inner().jobs, []);
}

#[tokio::test]
async fn events_tell_the_life_of_a_job_in_order() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit("G0 X1. Z1.\nM30\n").await.job;
    let request = ListJobEventsRequest { job: job.name.clone(), ..ListJobEventsRequest::default() };
    let events = clients.jobs.list_job_events(request).await.unwrap().into_inner();
    let states: Vec<JobState> = events.events.iter().map(feedwave_contract::proto::JobEvent::state).collect();
    assert_eq!(states, [JobState::Pending, JobState::Validating, JobState::Ready]);
    assert!(
        events
            .events
            .windows(2)
            .all(|pair| { pair[0].sequence < pair[1].sequence && pair[0].state() == pair[1].previous_state() })
    );
    assert_eq!(events.next_page_token, "");

    // The same in pages, and after a cursor.
    let (mut paged, mut page_token) = (Vec::new(), String::new());
    loop {
        let request = ListJobEventsRequest { job: job.name.clone(), page_size: 2, page_token, ..Default::default() };
        let page = clients.jobs.list_job_events(request).await.unwrap().into_inner();
        paged.extend(page.events);
        page_token = page.next_page_token;
        if page_token.is_empty() {
            break;
        }
        let elsewhere = ListJobEventsRequest { page_token: page_token.clone(), ..Default::default() };
        assert_eq!(violated_fields(&clients.jobs.list_job_events(elsewhere).await.unwrap_err()), ["page_token"]);
    }
    assert_eq!(paged, events.events);
    let after = events.events[0].sequence;
    let request = ListJobEventsRequest { after, job: job.name.clone(), ..Default::default() };
    assert_eq!(clients.jobs.list_job_events(request).await.unwrap().into_inner().events, events.events[1..]);
}

#[tokio::test]
async fn a_deleted_job_is_gone_and_its_program_can_then_be_deleted() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit("G0 X1. Z1.\nM30\n").await.job;
    let in_use = ProgramsDeleteProgramRequest { name: job.program.clone() };
    let status = clients.programs.delete_program(in_use.clone()).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition, "{status:?}");
    let former = DeleteProgramRequest { name: job.program.clone() };
    #[expect(deprecated, reason = "it stays for those who call it")]
    let status = clients.jobs.delete_program(former).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition, "{status:?}");
    let stale = DeleteJobRequest { name: job.name.clone(), etag: "stale".to_owned() };
    assert_eq!(clients.jobs.delete_job(stale).await.unwrap_err().code(), Code::Aborted);
    let delete = DeleteJobRequest { name: job.name.clone(), etag: job.etag };
    clients.jobs.delete_job(delete).await.unwrap();
    let gone = clients.jobs.get_job(GetJobRequest { name: job.name }).await.unwrap_err();
    assert_error(&gone, Code::NotFound, "RESOURCE_NOT_FOUND");
    clients.programs.delete_program(in_use).await.unwrap();
}

#[tokio::test]
async fn cancelling_ends_the_job_s_streams() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit(&long_dwell(3_000)).await.job;
    let request = StreamSetpointsRequest { job: job.name.clone(), ..StreamSetpointsRequest::default() };
    let mut messages = clients.setpoints.stream_setpoints(request.clone()).await.unwrap().into_inner();
    messages.message().await.unwrap();
    let cancelled = CancelJobRequest { name: job.name.clone() };
    let cancelled = clients.jobs.cancel_job(cancelled).await.unwrap().into_inner().job.unwrap();
    assert_eq!(cancelled.state(), JobState::Cancelled);
    let status = loop {
        match messages.message().await {
            Ok(Some(_)) => {}
            Ok(None) => panic!("the stream ended as if nothing had happened"),
            Err(status) => break status,
        }
    };
    assert_error(&status, Code::Aborted, "JOB_CANCELLED");
    assert_eq!(stream(&mut clients, request).await.unwrap_err().code(), Code::FailedPrecondition);
}

#[tokio::test]
async fn a_profile_with_several_faults_is_refused_with_all_of_them() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let request = GetMachineRequest { name: "machines/lathe".to_owned() };
    let mut machine = clients.machines.get_machine(request).await.unwrap().into_inner().machine.unwrap();
    let profile = machine.profile.as_mut().unwrap();
    profile.language.as_mut().unwrap().max_line_bytes = Some(1);
    profile.vibration.as_mut().unwrap().max_amplitude_mm = Some(-1.0);
    let request = CreateMachineRequest { machine_id: "Lathe 2".to_owned(), machine: Some(machine) };
    let fields = violated_fields(&clients.machines.create_machine(request).await.unwrap_err());
    assert!(fields.len() >= 3, "{fields:?}");
    for field in ["machine_id", "max_amplitude_mm", "max_line_bytes"] {
        assert!(fields.iter().any(|violated| violated.ends_with(field)), "{field} is not in {fields:?}");
    }
}

#[tokio::test]
async fn a_look_ahead_too_wide_for_checkpoints_only_makes_late_streams_begin_later() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let request = GetMachineRequest { name: "machines/mill".to_owned() };
    let mut machine = clients.machines.get_machine(request).await.unwrap().into_inner().machine.unwrap();
    machine.profile.as_mut().unwrap().look_ahead_blocks = Some(100_000);
    let request = CreateMachineRequest { machine_id: "far-sighted".to_owned(), machine: Some(machine) };
    let created = clients.machines.create_machine(request).await.unwrap().into_inner().machine.unwrap();
    assert_eq!(created.profile.unwrap().look_ahead_blocks, Some(100_000));

    // The first checkpoint is due after 2^17 setpoints, when the plan holds all of the short blocks.
    let program = format!("G21 G91 G94 G4 P131050\nG1 F6000\n{}M30\n", "X.001\n".repeat(130_000));
    let request = CreateJobRequest {
        machine: created.name,
        source: Some(Source::InlineProgram(program.into())),
        ..CreateJobRequest::default()
    };
    let job = clients.jobs.create_job(request).await.unwrap().into_inner().job.unwrap();
    let outcome = clients.validated(&job.name).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings);
    let count = outcome.report.summary.unwrap().setpoint_count;
    let start = Some(feedwave_contract::proto::stream_setpoints_request::Start::StartIndex(131_500));
    let request = StreamSetpointsRequest { job: job.name, start, ..StreamSetpointsRequest::default() };
    let setpoints = stream(&mut clients, request).await.unwrap();
    assert_eq!(setpoints.len() as u64, count - 131_500);
    let end = setpoints.column("X_mm").last().copied().unwrap();
    assert!((end - 130.0).abs() < 1e-6, "{end}");
}
