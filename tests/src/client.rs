//! Clients of the service, and what several tests ask of them.

use std::net::SocketAddr;

use bytes::Bytes;
use feedwave_contract::proto::jobs_client::JobsClient;
use feedwave_contract::proto::machines_client::MachinesClient;
use feedwave_contract::proto::programs_client::ProgramsClient;
use feedwave_contract::proto::setpoints_client::SetpointsClient;
use feedwave_contract::proto::threads_client::ThreadsClient;
use feedwave_contract::proto::tools_client::ToolsClient;
use feedwave_contract::proto::upload_program_request::Message;
use feedwave_contract::proto::{
    CreateJobRequest, GetJobRequest, GetReportRequest, Job, JobState, UploadChunk, UploadHeader, UploadProgramRequest,
    ValidationReport, WatchJobsRequest, create_job_request::Source,
};
use sha2::{Digest, Sha256};
use tonic::Status;
use tonic::transport::{Channel, Endpoint};

/// Clients over one connection.
#[derive(Clone)]
pub struct Clients {
    /// The connection itself.
    pub channel: Channel,
    /// Jobs.
    pub jobs: JobsClient<Channel>,
    /// Setpoints.
    pub setpoints: SetpointsClient<Channel>,
    /// Threads.
    pub threads: ThreadsClient<Channel>,
    /// Machines.
    pub machines: MachinesClient<Channel>,
    /// Tools.
    pub tools: ToolsClient<Channel>,
    /// Programs.
    pub programs: ProgramsClient<Channel>,
}

/// A job that came to its end, with its report.
pub struct Outcome {
    /// The job.
    pub job: Job,
    /// What validation found.
    pub report: ValidationReport,
}

impl Outcome {
    /// Codes of the findings, in their order.
    #[must_use]
    pub fn codes(&self) -> Vec<&str> {
        self.report.findings.iter().map(|finding| finding.code.as_str()).collect()
    }
}

impl Clients {
    /// Connects.
    ///
    /// # Panics
    /// When the port cannot be reached.
    pub async fn connect(address: SocketAddr) -> Self {
        let endpoint = Endpoint::from_shared(format!("http://{address}")).expect("a valid address");
        Self::of(endpoint.connect().await.expect("the port is open"))
    }

    /// Clients over this connection.
    #[must_use]
    pub fn of(channel: Channel) -> Self {
        Self {
            jobs: JobsClient::new(channel.clone()),
            setpoints: SetpointsClient::new(channel.clone()),
            threads: ThreadsClient::new(channel.clone()),
            machines: MachinesClient::new(channel.clone()),
            tools: ToolsClient::new(channel.clone()),
            programs: ProgramsClient::new(channel.clone()),
            channel,
        }
    }

    /// Creates a job on `machines/lathe` from an inline program.
    ///
    /// # Errors
    /// As the service answers.
    pub async fn create(&mut self, program: impl Into<Vec<u8>>) -> Result<Job, Status> {
        let source = Source::InlineProgram(Bytes::from(program.into()));
        self.create_from(source, "").await
    }

    /// Creates a job on `machines/lathe`.
    ///
    /// # Errors
    /// As the service answers.
    ///
    /// # Panics
    /// When the answer has no job.
    pub async fn create_from(&mut self, source: Source, request_id: &str) -> Result<Job, Status> {
        let request = CreateJobRequest {
            machine: "machines/lathe".to_owned(),
            request_id: request_id.to_owned(),
            source: Some(source),
            ..CreateJobRequest::default()
        };
        let response = self.jobs.create_job(request).await?.into_inner();
        Ok(response.job.expect("a job"))
    }

    /// Watches a job until its validation has ended, and reads it with its report.
    ///
    /// # Panics
    /// When the service fails, or the job is cancelled.
    pub async fn validated(&mut self, job: &str) -> Outcome {
        let request = WatchJobsRequest { after: Some(0), job: job.to_owned() };
        let mut events = self.jobs.watch_jobs(request).await.expect("the job is watched").into_inner();
        loop {
            let event = events.message().await.expect("the watch goes on").and_then(|message| message.event);
            let event = event.expect("the watch does not end by itself");
            match event.state() {
                JobState::Ready | JobState::Rejected => break,
                JobState::Cancelled | JobState::Failed => panic!("{event:?}"),
                _ => {}
            }
        }
        let job_request = GetJobRequest { name: job.to_owned() };
        let report_request = GetReportRequest { job: job.to_owned() };
        let job = self.jobs.get_job(job_request).await.expect("the job is read").into_inner().job;
        let report = self.jobs.get_report(report_request).await.expect("the report is read").into_inner().report;
        Outcome { job: job.expect("a job"), report: report.expect("a report") }
    }

    /// Creates a job from an inline program and waits until it is validated.
    ///
    /// # Panics
    /// When the service fails.
    pub async fn submit(&mut self, program: &str) -> Outcome {
        let job = self.create(program).await.expect("the job is created");
        self.validated(&job.name).await
    }
}

/// SHA-256 as lower-case hexadecimal digits.
#[must_use]
pub fn sha256_hex(data: &[u8]) -> String {
    Sha256::digest(data).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Messages that upload `program` from `offset` on, in pieces of `piece` bytes.
#[must_use]
pub fn upload_messages(program: &Bytes, offset: usize, piece: usize) -> Vec<UploadProgramRequest> {
    let header = UploadHeader {
        sha256: sha256_hex(program),
        program_bytes: program.len() as u64,
        offset: offset as u64,
        ..UploadHeader::default()
    };
    let header = std::iter::once(Message::Header(header));
    let starts = (offset..program.len()).step_by(piece);
    let chunks = starts.map(|start| {
        let data = program.slice(start..program.len().min(start + piece));
        Message::Chunk(UploadChunk { offset: start as u64, data })
    });
    header.chain(chunks).map(|message| UploadProgramRequest { message: Some(message) }).collect()
}

/// Uploads a whole program; answers with its resource name.
///
/// # Errors
/// As the service answers.
pub async fn upload(clients: &mut Clients, program: &Bytes) -> Result<String, Status> {
    let messages = upload_messages(program, 0, 256 << 10);
    let response = clients.jobs.upload_program(futures_util::stream::iter(messages)).await?.into_inner();
    assert_eq!(response.received_bytes, program.len() as u64);
    Ok(response.program)
}
