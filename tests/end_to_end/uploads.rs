//! Large programs, sent in pieces, over connections that break and servers that die.

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::programs_client::ProgramsClient;
use feedwave_contract::proto::{
    GetUploadRequest, GetUploadResponse, JobState, ListUploadsRequest, ProgramsDeleteProgramRequest,
    UploadProgramRequest, UploadProgramResponse,
};
use feedwave_tests::{Clients, Server, many_blocks, patiently, sha256_hex, upload, upload_messages};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Response, Status};
use tonic_types::StatusExt as _;

use crate::FEEDWAVE;
use crate::status::{assert_error, violated_fields};

const PIECE: usize = 256 << 10;

fn large_program() -> Bytes {
    many_blocks(6 << 20).collect::<String>().into()
}

async fn send(clients: &mut Clients, messages: Vec<UploadProgramRequest>) -> Result<UploadProgramResponse, Status> {
    let response = clients.jobs.upload_program(futures_util::stream::iter(messages)).await?;
    Ok(response.into_inner())
}

async fn progress(clients: &mut Clients, name: &str) -> Result<GetUploadResponse, Status> {
    let request = GetUploadRequest { program: name.to_owned() };
    Ok(clients.jobs.get_upload(request).await?.into_inner())
}

/// Sends part of a program, leaves the call open, and waits until the service acknowledges at least `wanted` bytes.
/// Answers with what was acknowledged and with the open call: its sender and its answer.
async fn send_part(
    clients: &mut Clients,
    program: &Bytes,
    name: &str,
    wanted: usize,
) -> (u64, mpsc::Sender<UploadProgramRequest>, JoinHandle<Result<UploadProgramResponse, Status>>) {
    let (sender, receiver) = mpsc::channel(4);
    let mut uploader = clients.clone();
    let answer = tokio::spawn(async move {
        let response = uploader.jobs.upload_program(ReceiverStream::new(receiver)).await;
        response.map(Response::into_inner)
    });
    let enough = 1 + (2 * wanted).div_ceil(PIECE);
    for message in upload_messages(program, 0, PIECE).into_iter().take(enough) {
        sender.send(message).await.expect("the call is open");
    }
    // Acknowledgement is what GetUpload says.
    let acknowledged = async {
        loop {
            if let Ok(progress) = progress(clients, name).await
                && progress.received_bytes >= wanted as u64
            {
                return progress.received_bytes;
            }
        }
    };
    (patiently(acknowledged).await, sender, answer)
}

#[tokio::test]
async fn a_large_program_is_uploaded_and_becomes_a_job() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let program = large_program();
    let name = upload(&mut clients, &program).await.unwrap();
    assert_eq!(name, format!("programs/{}", sha256_hex(&program)));
    let state = progress(&mut clients, &name).await.unwrap();
    assert!(state.complete);
    assert_eq!((state.received_bytes, state.program_bytes), (program.len() as u64, program.len() as u64));
    let job = clients.create_from(Source::Program(name.clone()), "").await.unwrap();
    let outcome = clients.validated(&job.name).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings.first());
    assert_eq!(outcome.report.summary.unwrap().program_bytes, program.len() as u64);
    // The same content has the same address: a second upload has nothing to do.
    assert_eq!(upload(&mut clients, &program).await.unwrap(), name);
}

#[tokio::test]
async fn acknowledged_bytes_survive_a_killed_server_and_the_upload_goes_on() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let program = large_program();
    let name = format!("programs/{}", sha256_hex(&program));
    let (acknowledged, _open_call, _answer) = send_part(&mut clients, &program, &name, 2 << 20).await;
    let server = server.kill().await.start().await;

    let mut clients = server.connect().await;
    let state = progress(&mut clients, &name).await.unwrap();
    assert!(!state.complete);
    assert!(state.received_bytes >= acknowledged, "{} of {acknowledged} acknowledged bytes", state.received_bytes);
    assert_eq!(state.program_bytes, program.len() as u64);
    let early = clients.create_from(Source::Program(name.clone()), "").await.unwrap_err();
    assert!(matches!(early.code(), Code::FailedPrecondition | Code::NotFound), "{early:?}");

    let from = usize::try_from(state.received_bytes).unwrap();
    let response = send(&mut clients, upload_messages(&program, from, PIECE)).await.unwrap();
    assert_eq!((response.program.as_str(), response.received_bytes), (name.as_str(), program.len() as u64));
    let job = clients.create_from(Source::Program(name), "").await.unwrap();
    assert_eq!(clients.validated(&job.name).await.job.state(), JobState::Ready);
}

#[tokio::test]
async fn a_call_that_ends_early_keeps_what_was_acknowledged() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let program = large_program();
    let name = format!("programs/{}", sha256_hex(&program));
    let (acknowledged, open_call, answer) = send_part(&mut clients, &program, &name, 1 << 20).await;
    // The client ends its side before the last byte: an answer, not an error, and nothing is lost.
    drop(open_call);
    let answer = answer.await.unwrap().unwrap();
    assert_eq!(answer.program, "");
    assert!(answer.received_bytes >= acknowledged);
    let state = progress(&mut clients, &name).await.unwrap();
    assert_eq!((state.received_bytes, state.complete), (answer.received_bytes, false));

    let from_the_start = send(&mut clients, upload_messages(&program, 0, PIECE)).await.unwrap_err();
    assert_error(&from_the_start, Code::OutOfRange, "UPLOAD_OFFSET");
    let from = usize::try_from(state.received_bytes).unwrap();
    let response = send(&mut clients, upload_messages(&program, from, PIECE)).await.unwrap();
    assert_eq!(response.program, name);
}

#[tokio::test]
async fn a_call_that_breaks_keeps_what_was_acknowledged() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let program = large_program();
    let name = format!("programs/{}", sha256_hex(&program));
    let mut breaking = server.connect().await;
    let (acknowledged, open_call, answer) = send_part(&mut breaking, &program, &name, 1 << 20).await;
    // The client is gone with its connection.
    answer.abort();
    drop((open_call, breaking));
    // What is still in transit may arrive meanwhile; the service names the right offset whenever it is asked.
    let goes_on = async {
        loop {
            let state = progress(&mut clients, &name).await.unwrap();
            assert!(state.received_bytes >= acknowledged && !state.complete);
            let from = usize::try_from(state.received_bytes).unwrap();
            match send(&mut clients, upload_messages(&program, from, PIECE)).await {
                Ok(response) => return assert_eq!(response.program, name),
                Err(status) => assert_error(&status, Code::OutOfRange, "UPLOAD_OFFSET"),
            }
        }
    };
    patiently(goes_on).await;
}

#[tokio::test]
async fn content_that_is_not_what_was_announced_is_refused() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let program = Bytes::from_static(b"G0 X1.\nM30\n");
    let name = format!("programs/{}", sha256_hex(&program));
    let mut messages = upload_messages(&program, 0, PIECE);
    let tampered = upload_messages(&Bytes::from_static(b"G0 X2.\nM30\n"), 0, PIECE);
    messages[1] = tampered[1].clone();
    let status = send(&mut clients, messages).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument, "{status:?}");
    assert!(!progress(&mut clients, &name).await.is_ok_and(|state| state.complete));
    // The address is not blocked: the true content can follow.
    assert_eq!(upload(&mut clients, &program).await.unwrap(), name);
    clients.programs.delete_program(ProgramsDeleteProgramRequest { name: name.clone() }).await.unwrap();
    assert!(!progress(&mut clients, &name).await.is_ok_and(|state| state.complete));
}

#[tokio::test]
async fn an_upload_that_breaks_the_rules_is_refused() {
    let server = feedwave_tests::Home::new(FEEDWAVE, "[limits]\nupload_bytes = 1000000").start().await;
    let mut clients = server.connect().await;
    let program = large_program();
    let messages = upload_messages(&program, 0, PIECE);
    let too_large = send(&mut clients, messages[..1].to_vec()).await.unwrap_err();
    assert!(matches!(too_large.code(), Code::InvalidArgument | Code::ResourceExhausted), "{too_large:?}");
    assert_eq!(violated_fields(&send(&mut clients, messages[1..2].to_vec()).await.unwrap_err()), ["header"]);
    assert_eq!(violated_fields(&send(&mut clients, Vec::new()).await.unwrap_err()), ["header"]);

    let small = Bytes::from(program.slice(..600_000).to_vec());
    let mut gap = upload_messages(&small, 0, PIECE);
    gap.remove(1);
    let status = send(&mut clients, gap).await.unwrap_err();
    assert_error(&status, Code::OutOfRange, "UPLOAD_OFFSET");
}

/// A program that was announced only, number `number`.
fn announced(number: u8) -> Vec<UploadProgramRequest> {
    upload_messages(&Bytes::from(vec![b'0' + number; 100]), 0, PIECE)[..1].to_vec()
}

/// The refusal of a share says which bound it is, and when to try again.
#[track_caller]
fn assert_client_limit(status: &Status, key: &str) {
    assert_error(status, Code::ResourceExhausted, "CLIENT_LIMIT");
    let details = status.get_error_details();
    assert_eq!(details.quota_failure().unwrap().violations[0].subject, key, "{status:?}");
    assert!(details.retry_info().is_some_and(|info| info.retry_delay.is_some()), "{status:?}");
}

#[tokio::test]
async fn announced_bytes_of_unfinished_uploads_have_bounds() {
    let limits =
        "[limits]\nupload_bytes = 1000\nunfinished_upload_bytes_per_client = 1000\nunfinished_upload_bytes = 1000";
    let server = feedwave_tests::Home::new(FEEDWAVE, limits).start().await;
    let mut clients = server.connect().await;
    for number in 0..10 {
        send(&mut clients, announced(number)).await.unwrap();
    }
    let refused = send(&mut clients, announced(10)).await.unwrap_err();
    assert_error(&refused, Code::ResourceExhausted, "OVERLOADED");
    assert!(refused.message().contains("1000 bytes of unfinished uploads"), "{refused:?}");

    let mut home = server.kill().await;
    home.set_environment(vec![("FEEDWAVE_LIMITS__UNFINISHED_UPLOAD_BYTES".to_owned(), "2000".to_owned())]);
    let server = home.start().await;
    let mut clients = server.connect().await;
    let refused = send(&mut clients, announced(10)).await.unwrap_err();
    assert_client_limit(&refused, "limits.unfinished_upload_bytes_per_client");
}

#[tokio::test]
async fn headers_without_data_keep_nobody_out_for_long() {
    let limits = "[limits]\nunfinished_uploads_per_client = 3\nunfinished_uploads = 5";
    let server = feedwave_tests::Home::new(FEEDWAVE, limits).start().await;
    let mut clients = server.connect().await;
    for number in 0..3 {
        let answer = send(&mut clients, announced(number)).await.unwrap();
        assert_eq!((answer.program.as_str(), answer.received_bytes), ("", 0));
    }
    let refused = send(&mut clients, announced(3)).await.unwrap_err();
    assert_client_limit(&refused, "limits.unfinished_uploads_per_client");
    assert!(refused.message().contains("as many unfinished uploads as one may have, 3"), "{refused:?}");

    // An operator sees them, and deletes one.
    let mut programs = ProgramsClient::new(clients.channel.clone());
    let uploads = programs.list_uploads(ListUploadsRequest::default()).await.unwrap().into_inner().uploads;
    let mut paged = Vec::new();
    let mut page_token = String::new();
    for size in [2, 1] {
        let request = ListUploadsRequest { page_size: 2, page_token };
        let page = programs.list_uploads(request).await.unwrap().into_inner();
        assert_eq!(page.uploads.len(), size);
        paged.extend(page.uploads);
        page_token = page.next_page_token;
    }
    assert_eq!((&paged, page_token.as_str()), (&uploads, ""));
    let shown: Vec<_> = uploads.iter().map(|upload| (upload.client.as_str(), upload.program_bytes)).collect();
    assert_eq!(shown, [("127.0.0.1", 100); 3]);
    clients.programs.delete_program(ProgramsDeleteProgramRequest { name: uploads[0].program.clone() }).await.unwrap();
    send(&mut clients, announced(3)).await.unwrap();

    // They expire, whatever was limited.
    let mut home = server.kill().await;
    home.set_environment(vec![("FEEDWAVE_LIMITS__UPLOAD_EXPIRY_S".to_owned(), "1".to_owned())]);
    let server = home.start().await;
    let mut clients = server.connect().await;
    let goes_on = async { while send(&mut clients, announced(4)).await.is_err() {} };
    patiently(goes_on).await;
    assert!(server.log().contains("an unfinished upload has expired"), "{}", server.log());
}
