//! Jobs: created, validated, watched, listed, cancelled, deleted.

use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::programs_client::ProgramsClient;
use feedwave_contract::proto::validate_program_request::On;
use feedwave_contract::proto::{
    CancelJobRequest, CreateJobRequest, CreateMachineRequest, CreateToolRequest, DeleteJobRequest,
    DeleteMachineRequest, GetJobRequest, GetMachineRequest, GetProgramRequest, GetReportRequest, JobState,
    ListJobEventsRequest, ListJobsRequest, Machine, ProgramFile, Severity, Tool, UpdateMachineRequest,
    ValidateProgramRequest, VibrationEnvelope, WatchJobsRequest,
};
use feedwave_server::config::Limits;
use tonic::Code;

use crate::support::{TURNING, TestServer, lathe_job, patiently, told};

#[tokio::test(flavor = "multi_thread")]
async fn a_turning_program_becomes_a_ready_job_with_its_report() {
    let test = TestServer::start().await;
    let created = test.create(CreateJobRequest { display_name: "shaft".to_owned(), ..lathe_job(TURNING) }).await;
    assert_eq!(created.state(), JobState::Pending);
    assert_eq!(created.program_bytes, TURNING.len() as u64);
    assert_eq!(created.settings.as_ref().unwrap().interpolation_period_us, 1_000);

    let job = test.reaches(&created.name, &[JobState::Ready]).await;
    assert_eq!(job.display_name, "shaft");
    assert!(job.summary.as_ref().unwrap().setpoint_count > 1_000);
    assert_ne!(job.etag, created.etag);

    let report = test.jobs().get_report(GetReportRequest { job: job.name.clone() }).await.unwrap().into_inner();
    let report = report.report.unwrap();
    assert_eq!(report.summary, job.summary);
    assert_eq!(report.sections.len(), 1);
    let section = &report.sections[0];
    assert_eq!((section.frequency_hz, section.amplitude_mm), (41.667, 0.06));
    let chip = section.chip.as_ref().unwrap();
    assert!(chip.broken && (chip.vibrations_per_rev - 2.5).abs() < 1e-3, "{chip:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_program_with_mistakes_is_rejected_with_all_of_them() {
    let test = TestServer::start().await;
    let job = test.validated(lathe_job("G1 X10. Q7 F0.1\nG777\nG2 X20. Z-5. R1. F0.1\nM30\n")).await;
    assert_eq!(job.state(), JobState::Rejected);
    let report = test.jobs().get_report(GetReportRequest { job: job.name.clone() }).await.unwrap().into_inner();
    let report = report.report.unwrap();
    let errors: Vec<_> = report.findings.iter().filter(|finding| finding.severity() == Severity::Error).collect();
    let lines: std::collections::BTreeSet<u32> = errors.iter().map(|finding| finding.line).collect();
    assert!(lines.contains(&1) && lines.contains(&2), "{:?}", report.findings);
    assert!(errors.iter().all(|finding| finding.column >= 1 && !finding.code.is_empty()));
    assert_eq!(report.summary.unwrap().errors, errors.len() as u64);
}

#[tokio::test(flavor = "multi_thread")]
async fn every_offending_field_is_named_at_once() {
    let test = TestServer::start().await;
    let request = CreateJobRequest {
        request_id: "with spaces".to_owned(),
        machine: "lathe".to_owned(),
        source: None,
        display_name: "x".repeat(500),
        interpolation_period_us: 7,
        generation_mode: 42,
        vibration_envelope: 7,
        tools: vec!["tools/fine".to_owned(), "Tools".to_owned()],
        oscillation: None,
        programs: vec![ProgramFile::default()],
        offsets: None,
        file_name: "x".repeat(201),
    };
    let status = test.jobs().create_job(request).await.unwrap_err();
    let (code, reason, fields) = told(&status);
    assert_eq!((code, reason.as_str()), (Code::InvalidArgument, "INVALID_FIELDS"));
    let expected = [
        "request_id",
        "machine",
        "source",
        "programs[0].source",
        "display_name",
        "file_name",
        "interpolation_period_us",
        "generation_mode",
        "vibration_envelope",
        "tools[1]",
    ];
    assert_eq!(fields, expected);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_does_not_exist_is_named() {
    let test = TestServer::start().await;
    let missing_machine = CreateJobRequest { machine: "machines/none".to_owned(), ..lathe_job("M30") };
    let missing_program =
        CreateJobRequest { source: Some(Source::Program(format!("programs/{}", "0".repeat(64)))), ..lathe_job("M30") };
    for (request, name) in [(missing_machine, "machines/none".to_owned()), (missing_program, "0".repeat(64))] {
        let status = test.jobs().create_job(request).await.unwrap_err();
        assert_eq!(told(&status).0, Code::NotFound);
        assert!(status.message().contains(&name), "{}", status.message());
    }
    let name = "jobs/01900000-0000-7000-8000-000000000000".to_owned();
    let status = test.jobs().get_job(GetJobRequest { name }).await.unwrap_err();
    assert_eq!(told(&status).1, "RESOURCE_NOT_FOUND");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_repeated_request_returns_the_first_job() {
    let test = TestServer::start().await;
    let request = CreateJobRequest { request_id: "order-4711".to_owned(), ..lathe_job(TURNING) };
    let first = test.create(request.clone()).await;
    let again = test.create(request.clone()).await;
    assert_eq!(first.name, again.name);
    let listed = test.jobs().list_jobs(ListJobsRequest::default()).await.unwrap().into_inner();
    assert_eq!(listed.jobs.len(), 1);

    let other = CreateJobRequest { interpolation_period_us: 2_000, ..request };
    let status = test.jobs().create_job(other).await.unwrap_err();
    assert_eq!(told(&status).0, Code::AlreadyExists);
    assert_eq!(told(&status).1, "REQUEST_ID_REUSED");
}

/// The answer to the first may have been lost, and anything may have happened since.
#[tokio::test(flavor = "multi_thread")]
async fn a_repeated_request_changes_nothing_and_needs_nothing() {
    let test = TestServer::start().await;
    let name = "machines/only-now".to_owned();
    let lathe = GetMachineRequest { name: "machines/lathe".to_owned() };
    let machine = test.machines().get_machine(lathe).await.unwrap().into_inner().machine.unwrap();
    let machine = Some(Machine { name: String::new(), etag: String::new(), ..machine });
    let request = CreateMachineRequest { machine_id: "only-now".to_owned(), machine };
    test.machines().create_machine(request).await.unwrap();
    let request = CreateJobRequest {
        request_id: "order-4712".to_owned(),
        machine: name.clone(),
        file_name: "first.nc".to_owned(),
        ..lathe_job(TURNING)
    };
    let first = test.create(request.clone()).await;
    test.machines().delete_machine(DeleteMachineRequest { name, ..Default::default() }).await.unwrap();
    test.create(CreateJobRequest { file_name: "newer.nc".to_owned(), ..lathe_job(TURNING) }).await;
    assert_eq!(test.create(request.clone()).await.name, first.name);
    let reused = CreateJobRequest { file_name: "third.nc".to_owned(), ..request };
    let status = test.jobs().create_job(reused).await.unwrap_err();
    assert_eq!(told(&status).1, "REQUEST_ID_REUSED");
    let program = GetProgramRequest { name: first.program };
    let program =
        ProgramsClient::new(test.channel.clone()).get_program(program).await.unwrap().into_inner().program.unwrap();
    assert_eq!(program.file_name, "newer.nc");
}

#[tokio::test(flavor = "multi_thread")]
async fn watchers_see_every_change_in_order_from_any_cursor() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job("G0 X10.\nM30\n")).await;
    let name = job.name.clone();
    test.jobs().delete_job(DeleteJobRequest { name: name.clone(), etag: job.etag }).await.unwrap();

    let request = ListJobEventsRequest { job: name.clone(), ..Default::default() };
    let events = test.jobs().list_job_events(request).await.unwrap().into_inner();
    let states: Vec<_> = events.events.iter().map(|event| (event.previous_state(), event.state())).collect();
    let expected = [
        (JobState::Unspecified, JobState::Pending),
        (JobState::Pending, JobState::Validating),
        (JobState::Validating, JobState::Ready),
        (JobState::Ready, JobState::Unspecified),
    ];
    assert_eq!(states, expected);
    assert!(events.events.is_sorted_by_key(|event| event.sequence));

    let after = events.events[1].sequence;
    let mut watch =
        test.jobs().watch_jobs(WatchJobsRequest { after: Some(after), job: name }).await.unwrap().into_inner();
    for event in &events.events[2..] {
        let seen = patiently(watch.message()).await.unwrap().unwrap();
        assert_eq!(seen.event.as_ref(), Some(event));
    }

    let mut new_only = test.jobs().watch_jobs(WatchJobsRequest::default()).await.unwrap().into_inner();
    let next = test.create(lathe_job("M30\n")).await;
    let seen = patiently(new_only.message()).await.unwrap().unwrap().event.unwrap();
    assert_eq!((seen.job, seen.previous_state), (next.name, JobState::Unspecified.into()));
}

#[tokio::test(flavor = "multi_thread")]
async fn lists_come_in_pages_and_by_state() {
    let test = TestServer::start().await;
    let mut names = Vec::new();
    for index in 0..5 {
        let program = if index == 2 { "G777\n" } else { "M30\n" };
        names.insert(0, test.validated(lathe_job(program)).await.name);
    }
    let mut seen = Vec::new();
    let mut page_token = String::new();
    loop {
        let request = ListJobsRequest { page_size: 2, page_token, ..Default::default() };
        let page = test.jobs().list_jobs(request).await.unwrap().into_inner();
        assert!(page.jobs.len() <= 2);
        seen.extend(page.jobs.into_iter().map(|job| job.name));
        page_token = page.next_page_token;
        if page_token.is_empty() {
            break;
        }
    }
    assert_eq!(seen, names);

    let rejected = ListJobsRequest { states: vec![JobState::Rejected.into()], ..Default::default() };
    let page = test.jobs().list_jobs(rejected).await.unwrap().into_inner();
    assert_eq!(page.jobs.iter().map(|job| &job.name).collect::<Vec<_>>(), [&names[2]]);

    let bad = ListJobsRequest { page_size: -1, states: vec![0], page_token: "x".to_owned(), ..Default::default() };
    assert_eq!(told(&test.jobs().list_jobs(bad).await.unwrap_err()).2, ["page_size", "states[0]"]);
    let bad_token = ListJobsRequest { page_token: "x".to_owned(), ..Default::default() };
    assert_eq!(told(&test.jobs().list_jobs(bad_token).await.unwrap_err()).2, ["page_token"]);
}

/// A job whose validation never ends by itself: weeks of rest, a setpoint every 50 µs.
fn endless() -> CreateJobRequest {
    let program = format!("G21\n{}M30\n", "G4 P80000000\n".repeat(10_000));
    CreateJobRequest { interpolation_period_us: 50, ..lathe_job(&program) }
}

#[tokio::test(flavor = "multi_thread")]
async fn cancelling_ends_a_validation_and_is_harmless_when_repeated() {
    let test = TestServer::with_limits(Limits { validation_workers: 1, ..Limits::default() }).await;
    let long = test.create(endless()).await;
    test.reaches(&long.name, &[JobState::Validating]).await;
    for _ in 0..2 {
        let request = CancelJobRequest { name: long.name.clone() };
        let job = test.jobs().cancel_job(request).await.unwrap().into_inner().job.unwrap();
        assert_eq!(job.state(), JobState::Cancelled);
    }
    // The only worker is free again.
    test.ready(lathe_job("M30\n")).await;
    let status = test.jobs().get_report(GetReportRequest { job: long.name }).await.unwrap_err();
    assert_eq!(told(&status).1, "JOB_NOT_VALIDATED");
}

#[tokio::test(flavor = "multi_thread")]
async fn interrupted_validations_are_taken_up_by_the_next_run() {
    let test = TestServer::with_limits(Limits { validation_workers: 1, ..Limits::default() }).await;
    let long = test.create(endless()).await;
    test.reaches(&long.name, &[JobState::Validating]).await;
    let waiting = test.create(lathe_job(TURNING)).await;
    let folder = test.stop().await;

    let next = TestServer::in_folder(folder, Limits { validation_workers: 2, ..Limits::default() }).await;
    next.reaches(&waiting.name, &[JobState::Ready]).await;
    let request = GetJobRequest { name: long.name };
    let job = next.jobs().get_job(request).await.unwrap().into_inner().job.unwrap();
    assert_eq!(job.state(), JobState::Validating);
    // Its validation would go on for ever.
    drop(next.stop().await);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_keeps_the_machine_and_tools_it_was_created_with() {
    let test = TestServer::start().await;
    let tool = Tool { number: 1, display_name: "rougher".to_owned(), ..Default::default() };
    let request = CreateToolRequest { tool_id: "rougher".to_owned(), tool: Some(tool) };
    test.tools().create_tool(request).await.unwrap();
    let tools = vec!["tools/rougher".to_owned()];
    let job = test.ready(CreateJobRequest { tools, ..lathe_job(TURNING) }).await;
    assert_eq!(job.settings.unwrap().tools[0].display_name, "rougher");

    let request = GetMachineRequest { name: "machines/lathe".to_owned() };
    let mut machine = test.machines().get_machine(request).await.unwrap().into_inner().machine.unwrap();
    machine.profile.as_mut().unwrap().vibration.as_mut().unwrap().max_amplitude_mm = Some(0.01);
    let stale = machine.etag.clone();
    let paths = vec!["profile.vibration.max_amplitude_mm".to_owned()];
    let update_mask = Some(prost_types::FieldMask { paths });
    let request = UpdateMachineRequest { machine: Some(machine.clone()), update_mask };
    test.machines().update_machine(request).await.unwrap();
    let request = UpdateMachineRequest { machine: Some(machine), update_mask: None };
    let status = test.machines().update_machine(request).await.unwrap_err();
    assert_eq!((told(&status).0, told(&status).1.as_str()), (Code::Aborted, "ETAG_MISMATCH"), "{stale}");

    let (_, chunks) = test.collect(crate::support::stream_of(&test.reaches(&job.name, &[JobState::Ready]).await)).await;
    assert!(!chunks.is_empty());
    assert_eq!(test.validated(lathe_job(TURNING)).await.state(), JobState::Rejected);
}

#[tokio::test(flavor = "multi_thread")]
async fn validating_stores_nothing() {
    let test = TestServer::start().await;
    let request = ValidateProgramRequest {
        inline_program: TURNING.as_bytes().to_vec().into(),
        on: Some(On::Machine("machines/lathe".to_owned())),
        ..Default::default()
    };
    let report = test.jobs().validate_program(request.clone()).await.unwrap().into_inner().report.unwrap();
    assert_eq!(report.summary.unwrap().errors, 0);
    let listed = test.jobs().list_jobs(ListJobsRequest::default()).await.unwrap().into_inner();
    assert!(listed.jobs.is_empty());

    let bad = ValidateProgramRequest { on: Some(On::Profile(Default::default())), generation_mode: 9, ..request };
    let status = test.jobs().validate_program(bad).await.unwrap_err();
    assert_eq!(told(&status).2, ["generation_mode", "profile.machine"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_chooses_how_its_vibration_begins_and_ends() {
    let test = TestServer::start().await;
    for (asked, expected) in [
        (VibrationEnvelope::Unspecified, VibrationEnvelope::Blended),
        (VibrationEnvelope::Blended, VibrationEnvelope::Blended),
        (VibrationEnvelope::Published, VibrationEnvelope::Published),
    ] {
        let job = test.ready(CreateJobRequest { vibration_envelope: asked.into(), ..lathe_job(TURNING) }).await;
        assert_eq!(job.settings.as_ref().unwrap().vibration_envelope(), expected);
        let request = GetReportRequest { job: job.name.clone() };
        let report = test.jobs().get_report(request).await.unwrap().into_inner().report.unwrap();
        let section = &report.sections[0];
        assert_eq!(section.envelope(), expected);
        assert_eq!(section.ramp_mm.is_some(), expected == VibrationEnvelope::Blended);
        assert_eq!(section.published_ends.is_some(), expected == VibrationEnvelope::Published);
        assert_eq!(section.full_amplitude_share < 1.0, expected == VibrationEnvelope::Blended);
        assert_eq!(section.clamped_share > 0.0, expected == VibrationEnvelope::Published);
    }
}
