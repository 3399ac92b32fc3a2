//! Programs: listed, read, deleted, interpreted; further program files of jobs.

use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::program_file::Source as FileSource;
use feedwave_contract::proto::programs_client::ProgramsClient;
use feedwave_contract::proto::upload_program_request::Message;
use feedwave_contract::proto::{
    Action, ActionKind, CreateJobRequest, Finding, GetProgramRequest, GetReportRequest, ImproveRequest,
    InterpretRequest, JobState, ListProgramsRequest, Program, ProgramFile, ProgramsDeleteProgramRequest,
    ReadProgramRequest, UploadChunk, UploadHeader, UploadProgramRequest, ValidateProgramRequest, improve_request,
    interpret_request, validate_program_request,
};
use feedwave_server::config::Limits;
use sha2::{Digest as _, Sha256};
use tonic::transport::Channel;
use tonic::{Code, Status};

use crate::support::{TestServer, lathe_job, stream_of, told};

const MAIN: &str = "G21 G98 G97 S500 M3\nG0 X10. Z5.\nM98 P1000\nM30\n";
const SUB: &str = "O1000\nG1 Z-5. F60.\nG1 X20.\nM99\n";

pub(crate) fn programs(test: &TestServer) -> ProgramsClient<Channel> {
    ProgramsClient::new(test.channel.clone())
}

fn inline(name: &str, text: &str) -> ProgramFile {
    let source = Some(FileSource::InlineProgram(text.as_bytes().to_vec().into()));
    ProgramFile { name: name.to_owned(), source }
}

async fn upload(test: &TestServer, file_name: &str, program: &[u8]) -> String {
    let sha256 = Sha256::digest(program).iter().map(|byte| format!("{byte:02x}")).collect();
    let header =
        UploadHeader { sha256, program_bytes: program.len() as u64, offset: 0, file_name: file_name.to_owned() };
    let chunk = UploadChunk { offset: 0, data: program.to_vec().into() };
    let messages = [Message::Header(header), Message::Chunk(chunk)];
    let messages = messages.map(|message| UploadProgramRequest { message: Some(message) });
    let answer = test.jobs().upload_program(futures_util::stream::iter(messages)).await.unwrap();
    answer.into_inner().program
}

/// The first page of programs with this name; of all where it is empty.
async fn list(test: &TestServer, file_name: &str) -> Vec<Program> {
    let request = ListProgramsRequest { file_name: file_name.to_owned(), ..Default::default() };
    programs(test).list_programs(request).await.unwrap().into_inner().programs
}

/// The actions and findings of a whole interpretation.
async fn interpret(test: &TestServer, request: InterpretRequest) -> Result<(Vec<Action>, Vec<Finding>), Status> {
    let mut messages = programs(test).interpret(request).await?.into_inner();
    let (mut actions, mut findings) = (Vec::new(), Vec::new());
    let mut complete = false;
    while let Some(message) = messages.message().await? {
        assert!(!complete, "nothing comes behind the last message");
        actions.extend(message.actions);
        findings.extend(message.findings);
        complete = message.complete;
    }
    assert!(complete, "the last message says so");
    Ok((actions, findings))
}

fn on_lathe(source: interpret_request::Source) -> InterpretRequest {
    let on = Some(interpret_request::On::Machine("machines/lathe".to_owned()));
    InterpretRequest { source: Some(source), on, ..Default::default() }
}

#[tokio::test(flavor = "multi_thread")]
async fn programs_are_found_read_and_deleted() {
    let test = TestServer::start().await;
    let large: Vec<u8> = (0..200_000).flat_map(|line| format!("G1 X{line}.\n").into_bytes()).collect();
    let name = upload(&test, "shaft.nc", &large).await;
    let other = upload(&test, "other.nc", b"M30\n").await;
    let list = async |file_name: &str| list(&test, file_name).await;
    assert_eq!(list("").await.len(), 2);
    let [found] = &list("shaft.nc").await[..] else { panic!("one program has the name") };
    assert_eq!((&found.name, found.size_bytes, found.job_count), (&name, large.len() as u64, 0));
    let answer = programs(&test).get_program(GetProgramRequest { name: name.clone() }).await.unwrap();
    assert_eq!(answer.into_inner().program.as_ref(), Some(found));

    let read = async |offset, length| -> Result<Vec<u8>, Status> {
        let request = ReadProgramRequest { name: name.clone(), offset, length };
        let mut pieces = programs(&test).read_program(request).await?.into_inner();
        let (mut bytes, mut at) = (Vec::new(), offset);
        while let Some(piece) = pieces.message().await? {
            assert_eq!(piece.offset, at);
            at += piece.data.len() as u64;
            bytes.extend_from_slice(&piece.data);
        }
        Ok(bytes)
    };
    assert!(read(0, 0).await.unwrap() == large);
    assert_eq!(read(1_048_570, 20).await.unwrap(), large[1_048_570..1_048_590]);
    assert_eq!(read(large.len() as u64, 0).await.unwrap(), b"");
    let beyond = read(large.len() as u64 + 1, 0).await.unwrap_err();
    assert_eq!((told(&beyond).0, told(&beyond).1.as_str()), (Code::OutOfRange, "START_BEYOND_END"));

    // Uploading it again under another name costs nothing and names it.
    upload(&test, "main.nc", b"M30\n").await;
    assert_eq!(list("main.nc").await[0].name, other);
    let job = test.ready(CreateJobRequest { source: Some(Source::Program(other.clone())), ..lathe_job("") }).await;
    let delete = async |name: &str| {
        let request = ProgramsDeleteProgramRequest { name: name.to_owned() };
        programs(&test).delete_program(request).await
    };
    let status = delete(&other).await.unwrap_err();
    assert_eq!((told(&status).0, told(&status).1.as_str()), (Code::FailedPrecondition, "RESOURCE_IN_USE"));
    assert_eq!(list("main.nc").await[0].job_count, 1, "{}", job.name);
    delete(&name).await.unwrap();
    assert_eq!(told(&delete(&name).await.unwrap_err()).0, Code::NotFound);
    let status = programs(&test).get_program(GetProgramRequest { name: "programs/5".to_owned() }).await.unwrap_err();
    assert_eq!(told(&status).2, ["name"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_names_the_file_of_its_program() {
    let test = TestServer::start().await;
    let list = async |file_name: &str| list(&test, file_name).await;
    let named = |file_name: &str| CreateJobRequest { file_name: file_name.to_owned(), ..lathe_job(MAIN) };
    let job = test.validated(named("shaft.nc")).await;
    let [found] = &list("shaft.nc").await[..] else { panic!("one program has the name") };
    assert_eq!((&found.name, found.file_name.as_str()), (&job.program, "shaft.nc"));

    // Without a name it keeps the one that it has; with another one, stored or not, it has that.
    test.validated(named("")).await;
    assert_eq!(list("shaft.nc").await.len(), 1);
    let stored = Some(Source::Program(job.program.clone()));
    test.validated(CreateJobRequest { source: stored, ..named("axle.nc") }).await;
    assert_eq!(list("axle.nc").await[0].name, job.program);
    assert_eq!(list("shaft.nc").await, []);

    let status = test.jobs().create_job(named(&"n".repeat(201))).await.unwrap_err();
    assert_eq!(told(&status).2, ["file_name"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_call_further_files_and_keep_them() {
    let test = TestServer::start().await;
    // Without the file, the finding names what is missing.
    let job = test.validated(lathe_job(MAIN)).await;
    assert_eq!(job.state(), JobState::Rejected);
    let request = GetReportRequest { job: job.name };
    let report = test.jobs().get_report(request).await.unwrap().into_inner().report.unwrap();
    assert!(report.findings.iter().any(|finding| finding.message.contains("O1000")), "{:?}", report.findings);

    let name = upload(&test, "subs/O1000.nc", SUB.as_bytes()).await;
    let stored = ProgramFile { name: String::new(), source: Some(FileSource::Program(name.clone())) };
    let with = |file| CreateJobRequest { programs: vec![file], ..lathe_job(MAIN) };
    let by_upload = test.ready(with(stored)).await;
    let by_request = test.ready(with(inline("o1000", SUB))).await;
    let (_, one) = test.collect(stream_of(&by_upload)).await;
    let (_, other) = test.collect(stream_of(&by_request)).await;
    assert_eq!(one, other);
    let settings = by_upload.settings.unwrap();
    assert_eq!((settings.programs[0].name.as_str(), settings.programs.len()), ("subs/O1000.nc", 1));

    let status = programs(&test).delete_program(ProgramsDeleteProgramRequest { name }).await.unwrap_err();
    assert_eq!(told(&status).1, "RESOURCE_IN_USE");

    // The same without storing anything, and as actions.
    let validate = ValidateProgramRequest {
        inline_program: MAIN.as_bytes().to_vec().into(),
        on: Some(validate_program_request::On::Machine("machines/lathe".to_owned())),
        programs: vec![inline("O1000.nc", SUB)],
        ..Default::default()
    };
    let report = test.jobs().validate_program(validate).await.unwrap().into_inner().report.unwrap();
    assert_eq!(report.summary.unwrap().errors, 0, "{:?}", report.findings);
    let of_job =
        InterpretRequest { source: Some(interpret_request::Source::Job(by_upload.name.clone())), ..Default::default() };
    let (actions, _) = interpret(&test, of_job.clone()).await.unwrap();
    let cuts: Vec<_> = actions.iter().filter(|action| action.kind() == ActionKind::Line).collect();
    assert_eq!(
        cuts.iter().map(|cut| (cut.file.as_str(), cut.line)).collect::<Vec<_>>(),
        [("subs/O1000.nc", 2), ("subs/O1000.nc", 3)]
    );
    assert_eq!(cuts[1].machine_end.unwrap().x, 10.0, "a radius");
    let on = Some(interpret_request::On::Machine("machines/lathe".to_owned()));
    let status = interpret(&test, InterpretRequest { on, ..of_job }).await.unwrap_err();
    assert_eq!(told(&status).2, ["job"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn findings_in_called_files_name_file_and_calls() {
    let test = TestServer::start().await;
    let source = interpret_request::Source::InlineProgram(MAIN.as_bytes().to_vec().into());
    let bad = SUB.replace("G1 X20.", "G2 X20. Z-9. I1. K0.");
    let request = InterpretRequest { programs: vec![inline("O1000.nc", &bad)], ..on_lathe(source) };
    let (actions, findings) = interpret(&test, request).await.unwrap();
    assert!(actions.iter().all(|action| action.line < 3 || !action.file.is_empty()), "{actions:?}");
    let finding = findings.iter().find(|finding| finding.code == "PRG-ARC-RADIUS-MISMATCH");
    let finding = finding.unwrap_or_else(|| panic!("{findings:?}"));
    assert_eq!((finding.file.as_str(), finding.line), ("O1000.nc", 3));
    let related: Vec<_> =
        finding.related.iter().map(|place| (place.file.as_str(), place.line, place.is_call)).collect();
    assert_eq!(related, [("O1000.nc", 2, false), ("", 3, true)]);
}

#[tokio::test(flavor = "multi_thread")]
async fn findings_of_machining_functions_in_called_files_name_the_calls() {
    let test = TestServer::start().await;
    let validate = ValidateProgramRequest {
        inline_program: b"G21 G18 G99 G97 S1000 M3\nG0 X30. Z2.\nM98 P1000\nM30\n".to_vec().into(),
        on: Some(validate_program_request::On::Machine("machines/lathe".to_owned())),
        programs: vec![
            inline("O1000.nc", "O1000\nM98 P1001\nG0 X32. Z2.\nM98 P1001\nM99\n"),
            inline("O1001.nc", "O1001\nG200 F50. A0.03\nG1 Z-10. F0.1\nG201\nM99\n"),
        ],
        ..Default::default()
    };
    let report = test.jobs().validate_program(validate).await.unwrap().into_inner().report.unwrap();
    let finding = report.findings.iter().find(|finding| finding.code == "VIB-CHIP-UNBROKEN");
    let finding = finding.unwrap_or_else(|| panic!("{:?}", report.findings));
    assert_eq!((finding.file.as_str(), finding.line), ("O1001.nc", 2));
    let calls: Vec<_> = finding.related.iter().map(|place| (place.file.as_str(), place.line, place.is_call)).collect();
    assert_eq!(calls, [("O1000.nc", 2, true), ("", 3, true)]);
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_that_cannot_be_are_refused_with_their_fields() {
    let test = TestServer::with_limits(Limits { inline_program_bytes: 100, ..Limits::default() }).await;
    let status = interpret(&test, InterpretRequest::default()).await.unwrap_err();
    assert_eq!(told(&status).2, ["source", "on"]);
    let large = || "(comment)\n".repeat(11).into_bytes().into();
    let status = interpret(&test, on_lathe(interpret_request::Source::InlineProgram(large()))).await.unwrap_err();
    assert_eq!((told(&status).0, told(&status).2), (Code::InvalidArgument, vec!["inline_program".to_owned()]));
    let request = ImproveRequest {
        source: Some(improve_request::Source::InlineProgram(large())),
        on: Some(improve_request::On::Machine("machines/lathe".to_owned())),
        ..ImproveRequest::default()
    };
    let status = programs(&test).improve(request).await.unwrap_err();
    assert_eq!((told(&status).0, told(&status).2), (Code::InvalidArgument, vec!["inline_program".to_owned()]));
    assert!(status.message().contains("more than the 100 allowed inline"), "{}", status.message());
    let absent = format!("programs/{}", "0".repeat(64));
    let status = interpret(&test, on_lathe(interpret_request::Source::Program(absent.clone()))).await.unwrap_err();
    assert_eq!(told(&status).0, Code::NotFound);
    let files = vec![
        inline("a.nc", "M99\n"),
        inline("A.NC", "M99\n"),
        ProgramFile { name: "b.nc".to_owned(), source: None },
        inline("", &"(comment)\n".repeat(12)),
    ];
    let status = test.jobs().create_job(CreateJobRequest { programs: files, ..lathe_job("M30\n") }).await.unwrap_err();
    assert_eq!(told(&status).2, ["programs[1].name", "programs[2].source", "programs[3].name", "programs"]);
    let missing = ProgramFile { name: "b.nc".to_owned(), source: Some(FileSource::Program(absent)) };
    let request = CreateJobRequest { programs: vec![missing], ..lathe_job("M30\n") };
    assert_eq!(told(&test.jobs().create_job(request).await.unwrap_err()).0, Code::NotFound);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_endless_program_ends_with_its_reader_and_with_the_service() {
    let test = TestServer::with_limits(Limits { concurrent_streams: 1, ..Limits::default() }).await;
    let text = "G21\n#1=0\nWHILE [1 EQ 1] DO1\n#1=#1+1\nG0 X#1\nEND1\nM30\n";
    let request = on_lathe(interpret_request::Source::InlineProgram(text.as_bytes().to_vec().into()));
    let mut messages = programs(&test).interpret(request.clone()).await.unwrap().into_inner();
    let first = messages.message().await.unwrap().unwrap();
    assert!(!first.actions.is_empty() && !first.complete);
    let status = programs(&test).interpret(request.clone()).await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted);
    drop(messages);
    // The place is free again as soon as the interpreter has seen that nobody reads.
    let mut messages = loop {
        match programs(&test).interpret(request.clone()).await {
            Ok(messages) => break messages.into_inner(),
            Err(status) => assert_eq!(status.code(), Code::ResourceExhausted),
        }
    };
    messages.message().await.unwrap().unwrap();
    drop(messages);
    test.stop().await;
}
