//! The client side of the contract: connecting, uploading, waiting for validation, decoding setpoints.

use std::path::{Path, PathBuf};
use std::time::Duration;

use feedwave_contract::columns::{self, Column};
use feedwave_contract::names::TENANT_HEADER;
use feedwave_contract::proto::audit_client::AuditClient;
use feedwave_contract::proto::jobs_client::JobsClient;
use feedwave_contract::proto::machines_client::MachinesClient;
use feedwave_contract::proto::programs_client::ProgramsClient;
use feedwave_contract::proto::runs_client::RunsClient;
use feedwave_contract::proto::setpoints_client::SetpointsClient;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::threads_client::ThreadsClient;
use feedwave_contract::proto::tools_client::ToolsClient;
use feedwave_contract::proto::upload_program_request::Message;
use feedwave_contract::proto::{
    ColumnInfo, ColumnKind, Encoding, GetJobRequest, GetReportRequest, GetUploadRequest, Job, JobState, SetpointChunk,
    StreamHeader, UploadChunk, UploadHeader, UploadProgramRequest, ValidationReport, WatchJobsRequest,
};
use feedwave_contract::{MAX_MESSAGE_BYTES, delta, raw_double};
use feedwave_cutting::SetpointBlock;
use sha2::{Digest, Sha256};
use tonic::Status;
use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::Channel;
use tonic_types::StatusExt as _;

use super::CliError;
use super::source::Source;
use super::terminal::{Unit, progress};
use crate::client_tls::{ClientTls, chain};
use crate::output::Layout;

/// Where the token is where no file has it.
const TOKEN_VARIABLE: &str = "FEEDWAVE_TOKEN";
/// How long a connection may take.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);
/// Times that a broken upload or stream is continued without any progress before it is given up.
pub(super) const MAX_RETRIES: u32 = 6;

/// Options that say which service.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ServerArgs {
    /// The service's URL, such as http://127.0.0.1:50051
    #[arg(long, value_name = "URL", env = "FEEDWAVE_SERVER", default_value = "http://127.0.0.1:50051")]
    server: String,
    #[command(flatten)]
    tls: ClientTls,
    /// File with the token to show to the service; without it the token is that of FEEDWAVE_TOKEN, if there is one
    #[arg(long, value_name = "FILE", env = "FEEDWAVE_TOKEN_FILE")]
    token_file: Option<PathBuf>,
    /// Tenant to act for, where the client acts for any; without it the client's own
    #[arg(long, value_name = "TENANT", env = "FEEDWAVE_TENANT")]
    tenant: Option<String>,
}

/// A connection that shows a token with each call.
pub(super) type Connection = InterceptedService<Channel, Credentials>;

/// What is shown with each call, where there is something to show.
#[derive(Clone, Debug, Default)]
pub(super) struct Credentials {
    token: Option<MetadataValue<Ascii>>,
    tenant: Option<MetadataValue<Ascii>>,
}

impl Credentials {
    /// The token of the file, or of the environment, and the tenant.
    fn load(file: Option<&Path>, tenant: Option<&str>) -> Result<Self, CliError> {
        let no_tenant = |_| CliError::trouble("--tenant: this is no name of a tenant");
        let tenant = tenant.map(MetadataValue::try_from).transpose().map_err(no_tenant)?;
        let (place, text) = match file {
            Some(path) => {
                let text = std::fs::read_to_string(path).map_err(|error| CliError::file(path, &error))?;
                (path.display().to_string(), text)
            }
            None => match std::env::var(TOKEN_VARIABLE) {
                Ok(text) => (TOKEN_VARIABLE.to_owned(), text),
                Err(_) => return Ok(Self { token: None, tenant }),
            },
        };
        let value = MetadataValue::try_from(format!("Bearer {}", text.trim()));
        let mut value = value.map_err(|_| CliError::trouble(format!("{place}: this is no token")))?;
        // Neither logged nor kept by the compression of headers.
        value.set_sensitive(true);
        Ok(Self { token: Some(value), tenant })
    }
}

impl Interceptor for Credentials {
    fn call(&mut self, mut request: tonic::Request<()>) -> Result<tonic::Request<()>, Status> {
        let metadata = request.metadata_mut();
        if let Some(token) = &self.token {
            metadata.insert("authorization", token.clone());
        }
        if let Some(tenant) = &self.tenant {
            metadata.insert(TENANT_HEADER, tenant.clone());
        }
        Ok(request)
    }
}

/// Clients over one connection, which is set up anew by itself when it breaks.
#[derive(Clone, Debug)]
pub(super) struct Client {
    pub(super) url: String,
    pub(super) jobs: JobsClient<Connection>,
    pub(super) setpoints: SetpointsClient<Connection>,
    channel: Connection,
}

impl ServerArgs {
    /// Connects.
    pub(super) async fn connect(&self) -> Result<Client, CliError> {
        let endpoint = self.tls.endpoint(&self.server)?.connect_timeout(CONNECT_TIMEOUT);
        let channel = endpoint.http2_keep_alive_interval(Duration::from_secs(20)).connect().await;
        let channel = channel.map_err(|error| CliError::trouble(format!("{}: {}", self.server, chain(&error))))?;
        Ok(Client::with_credentials(
            self.server.clone(),
            channel,
            Credentials::load(self.token_file.as_deref(), self.tenant.as_deref())?,
        ))
    }
}

impl Client {
    pub(super) fn new(url: String, channel: Channel) -> Self {
        Self::with_credentials(url, channel, Credentials::default())
    }

    fn with_credentials(url: String, channel: Channel, credentials: Credentials) -> Self {
        let channel = InterceptedService::new(channel, credentials);
        Self {
            url,
            jobs: JobsClient::new(channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES),
            setpoints: SetpointsClient::new(channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES),
            channel,
        }
    }

    pub(super) fn audit(&self) -> AuditClient<Connection> {
        AuditClient::new(self.channel.clone())
    }

    pub(super) fn machines(&self) -> MachinesClient<Connection> {
        MachinesClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    pub(super) fn programs(&self) -> ProgramsClient<Connection> {
        ProgramsClient::new(self.channel.clone())
    }

    pub(super) fn runs(&self) -> RunsClient<Connection> {
        RunsClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    pub(super) fn telemetry(&self) -> TelemetryClient<Connection> {
        TelemetryClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    pub(super) fn threads(&self) -> ThreadsClient<Connection> {
        ThreadsClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    pub(super) fn tools(&self) -> ToolsClient<Connection> {
        ToolsClient::new(self.channel.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// What the service answered, for people.
    pub(super) fn failed(&self, status: &Status) -> CliError {
        CliError::trouble(format!("{}: {}", self.url, status.message()))
    }

    /// Uploads a program as a file of this name, continuing where an earlier upload of the same bytes ended; its resource name.
    pub(super) async fn upload(&mut self, source: &mut Source, file_name: &str) -> Result<String, CliError> {
        let sha256 = sha256_hex(source)?;
        let name = format!("programs/{sha256}");
        let bar = progress("uploading", Unit::Bytes, source.size);
        let mut retries = 0;
        let mut received = 0;
        loop {
            let request = GetUploadRequest { program: name.clone() };
            let upload = match self.jobs.get_upload(request).await {
                Ok(response) => response.into_inner(),
                Err(status) if retries < MAX_RETRIES && is_passing(&status) => {
                    retries += 1;
                    pause(retries).await;
                    continue;
                }
                Err(status) => return Err(self.failed(&status)),
            };
            if upload.complete {
                bar.finish_and_clear();
                return Ok(name);
            }
            if upload.received_bytes > received {
                (received, retries) = (upload.received_bytes, 0);
            }
            bar.set_position(upload.received_bytes);
            if let Err(status) = self.upload_from(source, &sha256, file_name, upload.received_bytes, &bar).await? {
                if retries == MAX_RETRIES || !is_passing(&status) {
                    return Err(self.failed(&status));
                }
                retries += 1;
                pause(retries).await;
            }
        }
    }

    /// One attempt; the outer error is the file's, the inner one the service's.
    async fn upload_from(
        &mut self,
        source: &mut Source,
        sha256: &str,
        file_name: &str,
        offset: u64,
        bar: &indicatif::ProgressBar,
    ) -> Result<Result<(), Status>, CliError> {
        let (sender, receiver) = tokio::sync::mpsc::channel(4);
        let messages = tokio_stream::wrappers::ReceiverStream::new(receiver);
        let header = UploadHeader {
            sha256: sha256.to_owned(),
            program_bytes: source.size,
            offset,
            file_name: file_name.to_owned(),
        };
        source.seek(offset)?;
        let sending = send_program(source, header, sender, bar);
        let (sent, answer) = tokio::join!(sending, self.jobs.upload_program(messages));
        sent?;
        Ok(answer.map(drop))
    }

    /// Waits until the validation of a job has ended; the job.
    pub(super) async fn validated(&mut self, job: &str) -> Result<Job, CliError> {
        let mut retries = 0;
        loop {
            match self.watch_until_settled(job).await {
                Ok(()) => break,
                Err(status) if retries < MAX_RETRIES && is_passing(&status) => {
                    retries += 1;
                    pause(retries).await;
                }
                Err(status) => return Err(self.failed(&status)),
            }
        }
        let request = GetJobRequest { name: job.to_owned() };
        let response = self.jobs.get_job(request).await.map_err(|status| self.failed(&status))?;
        response.into_inner().job.ok_or_else(|| CliError::trouble(format!("{}: answered without a job", self.url)))
    }

    async fn watch_until_settled(&mut self, job: &str) -> Result<(), Status> {
        let request = WatchJobsRequest { after: Some(0), job: job.to_owned() };
        let mut events = self.jobs.watch_jobs(request).await?.into_inner();
        while let Some(response) = events.message().await? {
            let state = response.event.map(|event| event.state());
            if !matches!(state, Some(JobState::Pending | JobState::Validating)) {
                return Ok(());
            }
        }
        Err(Status::unavailable("the service ended the watch of the job"))
    }

    /// The report of a validated job.
    pub(super) async fn report(&mut self, job: &str) -> Result<ValidationReport, CliError> {
        let request = GetReportRequest { job: job.to_owned() };
        let response = self.jobs.get_report(request).await.map_err(|status| self.failed(&status))?;
        Ok(response.into_inner().report.unwrap_or_default())
    }
}

/// Sends the rest of a program into a call, until the call has ended: its result says why.
async fn send_program(
    source: &mut Source,
    header: UploadHeader,
    call: tokio::sync::mpsc::Sender<UploadProgramRequest>,
    bar: &indicatif::ProgressBar,
) -> Result<(), CliError> {
    let message = |message| UploadProgramRequest { message: Some(message) };
    let mut offset = header.offset;
    if call.send(message(Message::Header(header))).await.is_err() {
        return Ok(());
    }
    loop {
        let piece = source.next_piece()?;
        if piece.is_empty() {
            return Ok(());
        }
        let data = bytes::Bytes::copy_from_slice(piece);
        let length = data.len() as u64;
        if call.send(message(Message::Chunk(UploadChunk { offset, data }))).await.is_err() {
            return Ok(());
        }
        offset += length;
        bar.set_position(offset);
    }
}

/// Whether trying again can help.
pub(super) fn is_passing(status: &Status) -> bool {
    use tonic::Code;
    // Of what is exhausted only that comes back which the service says to ask for again: no message becomes smaller.
    let told_to_retry = || status.get_details_retry_info().is_some();
    // A connection that breaks in the middle shows as UNKNOWN or INTERNAL with the transport's error as source.
    status.code() == Code::Unavailable
        || status.code() == Code::ResourceExhausted && told_to_retry()
        || matches!(status.code(), Code::Unknown | Code::Internal | Code::Cancelled)
            && std::error::Error::source(status).is_some()
}

/// Waits before a retry: 0.1 s, 0.2 s, … 3.2 s.
pub(super) async fn pause(retry: u32) {
    tokio::time::sleep(Duration::from_millis(50 << retry.min(MAX_RETRIES))).await;
}

fn sha256_hex(source: &mut Source) -> Result<String, CliError> {
    source.rewind()?;
    let mut hash = Sha256::new();
    loop {
        match source.next_piece()? {
            [] => return Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()),
            piece => hash.update(piece),
        }
    }
}

/// Turns the chunks of a stream into setpoint blocks.
#[derive(Debug)]
pub(super) struct Decoder {
    columns: Vec<Column>,
    infos: Vec<ColumnInfo>,
    encoding: Encoding,
    period_us: f64,
}

impl Decoder {
    pub(super) fn new(header: &StreamHeader) -> Self {
        Self {
            columns: columns::of_header(&header.columns),
            infos: header.columns.clone(),
            encoding: header.encoding(),
            period_us: header.period_us,
        }
    }

    /// The columns of a file for this stream.
    pub(super) fn layout(&self) -> Layout {
        let known = self.columns.iter().filter(|column| column.kind != ColumnKind::Unspecified);
        Layout::new(known.cloned().collect(), self.period_us)
    }

    /// Where the linear axes X and Y are among the axes, where there are both.
    pub(super) fn xy(&self) -> Option<[usize; 2]> {
        let linear = |column: &&Column| column.kind == ColumnKind::AxisPosition && column.unit == "mm";
        let of = |name: &str| self.columns.iter().filter(linear).find(|column| column.axis == name);
        Some([of("X")?.index, of("Y")?.index])
    }

    /// A chunk as a block; says what is wrong with a chunk that breaks the contract.
    pub(super) fn block(&self, chunk: &SetpointChunk) -> Result<SetpointBlock, String> {
        let count = chunk.count as usize;
        if chunk.columns.len() != self.columns.len() {
            return Err(format!("a chunk has {} columns instead of {}", chunk.columns.len(), self.columns.len()));
        }
        let mut block = SetpointBlock { first_index: chunk.first_index, ..SetpointBlock::default() };
        for ((column, info), sent) in self.columns.iter().zip(&self.infos).zip(&chunk.columns) {
            let values = match self.encoding {
                Encoding::FixedPointDelta => delta::decode(&sent.deltas, info.resolution),
                Encoding::RawDouble => raw_double::decode(&sent.raw)
                    .ok_or_else(|| format!("column {} has {} bytes, no whole doubles", info.name, sent.raw.len()))?,
                Encoding::PackedDouble | Encoding::Unspecified => sent.values.clone(),
            };
            if values.len() != count {
                return Err(format!("column {} has {} values instead of {count}", info.name, values.len()));
            }
            column.put(&mut block, values);
        }
        for run in &chunk.line_runs {
            block.line.extend(std::iter::repeat_n(run.line, (run.count as usize).min(count)));
        }
        if block.line.len() != count {
            return Err(format!("a chunk states the lines of {} setpoints instead of {count}", block.line.len()));
        }
        Ok(block)
    }
}
