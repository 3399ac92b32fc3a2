//! How much memory the service takes for a program of any size: from the upload to the last setpoint.

use std::path::Path;
use std::time::{Duration, Instant};

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::stream_setpoints_response::Message;
use feedwave_contract::proto::upload_program_request::Message as Upload;
use feedwave_contract::proto::{
    CreateJobRequest, JobState, StreamSetpointsRequest, UploadChunk, UploadHeader, UploadProgramRequest,
};
use sha2::{Digest, Sha256};

use crate::{Home, many_blocks};

const PIECE_BYTES: usize = 1 << 20;

/// Peak of the service's resident memory after each part of the work, bytes, and what was done.
#[derive(Clone, Copy, Debug)]
pub struct MemoryUse {
    /// Size of the program, bytes.
    pub program_bytes: u64,
    /// Setpoints streamed.
    pub setpoints: u64,
    /// From the request of the stream to its first setpoints.
    pub first_setpoints: Duration,
    /// Peak before any work.
    pub idle_bytes: u64,
    /// Peak after the upload.
    pub uploaded_bytes: u64,
    /// Peak after validation.
    pub validated_bytes: u64,
    /// Peak after all setpoints were streamed.
    pub streamed_bytes: u64,
}

/// The generated program in pieces, so that no side ever holds all of it.
fn pieces(bytes: u64) -> impl Iterator<Item = Bytes> {
    let mut blocks = many_blocks(bytes);
    std::iter::from_fn(move || {
        let mut piece = String::with_capacity(PIECE_BYTES + 64);
        while piece.len() < PIECE_BYTES {
            match blocks.next() {
                Some(block) => piece.push_str(&block),
                None => break,
            }
        }
        (!piece.is_empty()).then(|| Bytes::from(piece))
    })
}

/// Uploads, validates and streams a generated program of about `bytes` bytes, and reads the operating system's account
/// (`VmHWM`) of the process of this binary after each.
///
/// # Panics
/// When the service does not do its work.
pub async fn measure_memory(binary: &Path, bytes: u64) -> MemoryUse {
    let server = Home::new(binary, "").start().await;
    let mut clients = server.connect().await;
    let idle_bytes = server.peak_resident_bytes();

    let mut hash = Sha256::new();
    let mut program_bytes = 0;
    for piece in pieces(bytes) {
        hash.update(&piece);
        program_bytes += piece.len() as u64;
    }
    let sha256 = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    let header = Upload::Header(UploadHeader { sha256, program_bytes, offset: 0, ..Default::default() });
    let chunks = pieces(bytes).scan(0, |offset, data| {
        let chunk = UploadChunk { offset: *offset, data };
        *offset += chunk.data.len() as u64;
        Some(Upload::Chunk(chunk))
    });
    let messages = std::iter::once(header).chain(chunks).map(|message| UploadProgramRequest { message: Some(message) });
    let uploaded =
        clients.jobs.upload_program(futures_util::stream::iter(messages)).await.expect("the upload is taken");
    let uploaded_bytes = server.peak_resident_bytes();

    let request = CreateJobRequest {
        machine: "machines/lathe".to_owned(),
        source: Some(Source::Program(uploaded.into_inner().program)),
        interpolation_period_us: 20_000,
        ..CreateJobRequest::default()
    };
    let job = clients.jobs.create_job(request).await.expect("the job is created").into_inner().job.expect("a job");
    let outcome = clients.validated(&job.name).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings.first());
    let validated_bytes = server.peak_resident_bytes();

    let request = StreamSetpointsRequest { job: job.name, ..StreamSetpointsRequest::default() };
    let asked = Instant::now();
    let mut first_setpoints = None;
    let mut messages = clients.setpoints.stream_setpoints(request).await.expect("the stream opens").into_inner();
    let mut setpoints = 0;
    while let Some(message) = messages.message().await.expect("the stream goes on") {
        if let Some(Message::Chunk(chunk)) = message.message {
            setpoints += u64::from(chunk.count);
            first_setpoints.get_or_insert_with(|| asked.elapsed());
        }
    }
    assert_eq!(setpoints, outcome.report.summary.expect("a summary").setpoint_count);
    let streamed_bytes = server.peak_resident_bytes();
    let first_setpoints = first_setpoints.unwrap_or_default();
    MemoryUse { program_bytes, setpoints, first_setpoints, idle_bytes, uploaded_bytes, validated_bytes, streamed_bytes }
}
