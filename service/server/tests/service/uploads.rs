//! Uploads: in pieces, continued, wrong, too large, deleted.

use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::upload_program_request::Message;
use feedwave_contract::proto::{
    CreateJobRequest, GetUploadRequest, ProgramsDeleteProgramRequest, UploadChunk, UploadHeader, UploadProgramRequest,
    UploadProgramResponse,
};
use feedwave_server::config::Limits;
use sha2::{Digest as _, Sha256};
use tonic::{Code, Status};

use crate::programs::programs;
use crate::support::{TURNING, TestServer, lathe_job, told};

fn sha256(program: &[u8]) -> String {
    Sha256::digest(program).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A valid program of some size.
fn large_program() -> Vec<u8> {
    let mut program = String::from("G21 G97 S500 M3\nG0 X20. Z0.\n");
    for index in 0..40_000 {
        program.push_str(&format!("G1 X{}. Z-{}. F5.\n", 20 + index % 2, index % 7));
    }
    program.push_str("M30\n");
    program.into_bytes()
}

async fn upload(
    test: &TestServer,
    program: &[u8],
    sha256: String,
    bytes: std::ops::Range<usize>,
) -> Result<UploadProgramResponse, Status> {
    let offset = bytes.start as u64;
    let header = UploadHeader { sha256, program_bytes: program.len() as u64, offset, ..Default::default() };
    let mut messages = vec![UploadProgramRequest { message: Some(Message::Header(header)) }];
    let mut offset = offset;
    for piece in program[bytes].chunks(100_000) {
        let chunk = UploadChunk { offset, data: piece.to_vec().into() };
        offset += piece.len() as u64;
        messages.push(UploadProgramRequest { message: Some(Message::Chunk(chunk)) });
    }
    let response = test.jobs().upload_program(futures_util::stream::iter(messages)).await?;
    Ok(response.into_inner())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_broken_upload_is_continued_and_becomes_a_job() {
    let test = TestServer::start().await;
    let program = large_program();
    let sha256 = sha256(&program);
    let name = format!("programs/{sha256}");
    let progress = async || {
        let request = GetUploadRequest { program: name.clone() };
        test.jobs().get_upload(request).await.unwrap().into_inner()
    };
    assert_eq!((progress().await.received_bytes, progress().await.complete), (0, false));

    let cut = 350_000;
    let response = upload(&test, &program, sha256.clone(), 0..cut).await.unwrap();
    assert_eq!((response.program.as_str(), response.received_bytes), ("", cut as u64));
    assert_eq!((progress().await.received_bytes, progress().await.program_bytes), (cut as u64, program.len() as u64));

    // Continuing elsewhere is refused and says where to continue.
    let status = upload(&test, &program, sha256.clone(), 0..program.len()).await.unwrap_err();
    assert_eq!((told(&status).0, told(&status).1.as_str()), (Code::OutOfRange, "UPLOAD_OFFSET"));
    assert!(status.message().contains(&cut.to_string()), "{}", status.message());

    let response = upload(&test, &program, sha256.clone(), cut..program.len()).await.unwrap();
    assert_eq!((response.program, response.received_bytes), (name.clone(), program.len() as u64));
    assert!(progress().await.complete);

    // Uploading it again costs nothing but the header.
    let response = upload(&test, &program, sha256, 0..0).await.unwrap();
    assert_eq!(response.received_bytes, program.len() as u64);

    let job = test.ready(CreateJobRequest { source: Some(Source::Program(name.clone())), ..lathe_job("") }).await;
    assert_eq!(job.program_bytes, program.len() as u64);
    let status = programs(&test).delete_program(ProgramsDeleteProgramRequest { name }).await.unwrap_err();
    assert_eq!((told(&status).0, told(&status).1.as_str()), (Code::FailedPrecondition, "RESOURCE_IN_USE"));
}

#[tokio::test(flavor = "multi_thread")]
async fn bytes_with_another_hash_are_discarded() {
    let test = TestServer::start().await;
    let announced = sha256(b"another program");
    let program = TURNING.as_bytes();
    let status = upload(&test, program, announced.clone(), 0..program.len()).await.unwrap_err();
    assert_eq!((told(&status).0, told(&status).2), (Code::InvalidArgument, vec!["header.sha256".to_owned()]));
    let request = GetUploadRequest { program: format!("programs/{announced}") };
    assert_eq!(test.jobs().get_upload(request).await.unwrap().into_inner(), Default::default());
}

#[tokio::test(flavor = "multi_thread")]
async fn uploads_that_cannot_be_are_refused() {
    let test = TestServer::with_limits(Limits { upload_bytes: 1_000, ..Limits::default() }).await;
    let program = vec![b' '; 1_001];
    let status = upload(&test, &program, "abc".to_owned(), 0..1).await.unwrap_err();
    assert_eq!(told(&status).2, ["header.sha256", "header.program_bytes"]);

    let chunk = UploadProgramRequest { message: Some(Message::Chunk(UploadChunk::default())) };
    let status = test.jobs().upload_program(futures_util::stream::iter([chunk])).await.unwrap_err();
    assert_eq!(told(&status).2, ["header"]);
    let status = test.jobs().upload_program(futures_util::stream::iter([])).await.unwrap_err();
    assert_eq!(told(&status).2, ["header"]);

    let header = UploadHeader { sha256: sha256(b"12"), program_bytes: 2, offset: 0, ..Default::default() };
    let too_much = UploadChunk { offset: 0, data: b"123".to_vec().into() };
    let messages = [
        UploadProgramRequest { message: Some(Message::Header(header)) },
        UploadProgramRequest { message: Some(Message::Chunk(too_much)) },
    ];
    let status = test.jobs().upload_program(futures_util::stream::iter(messages)).await.unwrap_err();
    assert_eq!(told(&status).2, ["chunk.data"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_received_can_be_deleted() {
    let test = TestServer::start().await;
    let program = TURNING.as_bytes();
    let name = format!("programs/{}", sha256(program));
    upload(&test, program, sha256(program), 0..10).await.unwrap();
    programs(&test).delete_program(ProgramsDeleteProgramRequest { name: name.clone() }).await.unwrap();
    let progress = test.jobs().get_upload(GetUploadRequest { program: name.clone() }).await.unwrap().into_inner();
    assert_eq!(progress.received_bytes, 0);
    let status = programs(&test).delete_program(ProgramsDeleteProgramRequest { name }).await.unwrap_err();
    assert_eq!(told(&status).0, Code::NotFound);
}
