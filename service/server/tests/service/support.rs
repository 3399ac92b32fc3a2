//! A server of its own for each test, and what the tests say to it.

use std::net::SocketAddr;
use std::time::Duration;

use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::jobs_client::JobsClient;
use feedwave_contract::proto::machines_client::MachinesClient;
use feedwave_contract::proto::setpoints_client::SetpointsClient;
use feedwave_contract::proto::stream_setpoints_response::Message;
use feedwave_contract::proto::tools_client::ToolsClient;
use feedwave_contract::proto::{
    CreateJobRequest, GetJobRequest, Job, JobState, SetpointChunk, StreamHeader, StreamSetpointsRequest,
    StreamSetpointsResponse, WatchJobsRequest,
};
use feedwave_server::config::{Config, Limits, StoreConfig};
use feedwave_server::lifecycle::{RunningServer, Server};
pub use feedwave_tests::{PATIENCE, patiently, within_a_deadline};
use tempfile::TempDir;
use tonic::transport::Channel;
use tonic::{Code, Status, Streaming};
use tonic_types::StatusExt as _;

/// A turning program with a rapid, a cut, an arc and a vibrating section whose chip breaks (D = 2.5).
pub const TURNING: &str = "\
%
O0001 (SHAFT)
G18 G21 G99
T0101
G97 S1000 M3
G0 X30. Z2.
G1 Z-1. F0.2
G200 F41.667 A0.06
G1 X30. Z-6. F0.1
G2 X38. Z-10. R4.
G1 Z-14.
G201
G0 X60. Z20.
M5
M30
%
";

/// A program that rests for a long time: many setpoints from few bytes.
pub fn resting(seconds: u32) -> String {
    format!("G21\nG0 X10.\nG4 P{}\nM30\n", u64::from(seconds) * 1_000)
}

pub struct TestServer {
    pub server: RunningServer,
    pub channel: Channel,
    folder: TempDir,
}

impl TestServer {
    pub async fn start() -> Self {
        Self::with_limits(Limits::default()).await
    }

    pub async fn with_limits(limits: Limits) -> Self {
        let folder = TempDir::new().unwrap();
        Self::in_folder(folder, limits).await
    }

    pub async fn in_folder(folder: TempDir, limits: Limits) -> Self {
        let free: SocketAddr = "127.0.0.1:0".parse().unwrap();
        // A test that is slow to read is not cut off.
        let limits = Limits { drain_s: PATIENCE.as_secs(), ..limits };
        let mut config = Config { limits, ..Config::default() };
        config.grpc.listen = free;
        config.http.listen = free;
        config.store = StoreConfig::of_file(&folder.path().join("feedwave.db")).unwrap();
        let server = Server::start(config).await.unwrap();
        let url = format!("http://{}", server.grpc_addr());
        let channel = Channel::from_shared(url).unwrap().connect().await.unwrap();
        Self { server, channel, folder }
    }

    /// Ends the server and keeps its database.
    pub async fn stop(self) -> TempDir {
        drop(self.channel);
        self.server.shutdown().await;
        self.folder
    }

    pub fn jobs(&self) -> JobsClient<Channel> {
        JobsClient::new(self.channel.clone())
    }

    pub fn setpoints(&self) -> SetpointsClient<Channel> {
        SetpointsClient::new(self.channel.clone())
    }

    pub fn machines(&self) -> MachinesClient<Channel> {
        MachinesClient::new(self.channel.clone())
    }

    pub fn tools(&self) -> ToolsClient<Channel> {
        ToolsClient::new(self.channel.clone())
    }

    pub async fn create(&self, request: CreateJobRequest) -> Job {
        self.jobs().create_job(request).await.unwrap().into_inner().job.unwrap()
    }

    /// Creates a job and waits until it has been validated.
    pub async fn validated(&self, request: CreateJobRequest) -> Job {
        let job = self.create(request).await;
        self.reaches(&job.name, &[JobState::Ready, JobState::Rejected, JobState::Failed]).await
    }

    pub async fn ready(&self, request: CreateJobRequest) -> Job {
        let job = self.validated(request).await;
        assert_eq!(job.state(), JobState::Ready, "{}", job.state_message);
        job
    }

    /// Waits until the job is in one of these states.
    pub async fn reaches(&self, job: &str, states: &[JobState]) -> Job {
        let request = WatchJobsRequest { after: Some(0), job: job.to_owned() };
        let mut events = self.jobs().watch_jobs(request).await.unwrap().into_inner();
        patiently(async {
            loop {
                let event = events.message().await.unwrap().unwrap().event.unwrap();
                if states.contains(&event.state()) {
                    break;
                }
            }
        })
        .await;
        let request = GetJobRequest { name: job.to_owned() };
        self.jobs().get_job(request).await.unwrap().into_inner().job.unwrap()
    }

    pub async fn stream(&self, request: StreamSetpointsRequest) -> Result<Streaming<StreamSetpointsResponse>, Status> {
        Ok(self.setpoints().stream_setpoints(request).await?.into_inner())
    }

    /// The whole stream.
    pub async fn collect(&self, request: StreamSetpointsRequest) -> (StreamHeader, Vec<SetpointChunk>) {
        let mut messages = self.stream(request).await.unwrap();
        let header = header(&mut messages).await;
        let mut chunks = Vec::new();
        while let Some(message) = messages.message().await.unwrap() {
            chunks.push(chunk(message));
        }
        (header, chunks)
    }
}

/// Asks again and again until the condition holds.
pub async fn eventually(mut condition: impl FnMut() -> bool) {
    let mut ticks = tokio::time::interval(Duration::from_millis(5));
    patiently(async {
        while !condition() {
            ticks.tick().await;
        }
    })
    .await;
}

pub async fn header(messages: &mut Streaming<StreamSetpointsResponse>) -> StreamHeader {
    match messages.message().await.unwrap().and_then(|message| message.message) {
        Some(Message::Header(header)) => header,
        other => panic!("a stream begins with its header, not with {other:?}"),
    }
}

pub fn chunk(message: StreamSetpointsResponse) -> SetpointChunk {
    match message.message {
        Some(Message::Chunk(chunk)) => chunk,
        other => panic!("chunks follow the header, not {other:?}"),
    }
}

/// One column of all chunks.
pub fn column(chunks: &[SetpointChunk], index: usize) -> Vec<f64> {
    chunks.iter().flat_map(|chunk| chunk.columns[index].values.iter().copied()).collect()
}

pub fn lathe_job(program: &str) -> CreateJobRequest {
    CreateJobRequest {
        machine: "machines/lathe".to_owned(),
        source: Some(Source::InlineProgram(program.as_bytes().to_vec().into())),
        ..Default::default()
    }
}

pub fn stream_of(job: &Job) -> StreamSetpointsRequest {
    StreamSetpointsRequest { job: job.name.clone(), ..Default::default() }
}

/// Code, reason, and the fields of its violations.
pub fn told(status: &Status) -> (Code, String, Vec<String>) {
    let details = status.get_error_details();
    let reason = details.error_info().map(|info| info.reason.clone()).unwrap_or_default();
    let fields = details.bad_request().map(|bad| bad.field_violations.iter().map(|v| v.field.clone()).collect());
    (status.code(), reason, fields.unwrap_or_default())
}
