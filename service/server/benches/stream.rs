//! How fast setpoints reach a client, beside raw tonic streams that carry the same bytes in the same run.
//!
//! `setpoints` generates, encodes and sends. `same_messages` sends the same messages made in advance, so that only
//! tonic and prost work. `same_bytes` sends each of them as one opaque field, the fastest that tonic can. Both encodings to the last
//! bit are measured: packed doubles, and raw doubles.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::jobs_client::JobsClient;
use feedwave_contract::proto::setpoints_client::SetpointsClient;
use feedwave_contract::proto::{
    CreateJobRequest, Encoding, JobState, StreamSetpointsRequest, StreamSetpointsResponse, UploadChunk,
    WatchJobsRequest,
};
use feedwave_server::config::{Config, StoreConfig};
use feedwave_server::lifecycle::{RunningServer, Server};
use futures_util::future::BoxFuture;
use futures_util::{Stream, StreamExt as _, stream};
use prost::Message;
use tempfile::TempDir;
use tokio::runtime::Runtime;
use tonic::body::Body;
use tonic::server::{NamedService, ServerStreamingService};
use tonic::transport::Channel;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status, Streaming};
use tonic_prost::ProstCodec;

/// A long vibrating cut: 1.8 million setpoints at 1 ms.
const PROGRAM: &str = "G18 G21 G99\nG97 S1000 M3\nG0 X30. Z0.\nG200 F41.667 A0.06\nG1 Z-3000. F0.1\nG201\nM30\n";

/// Rounds of the measurement in turns.
const ROUNDS: usize = 41;

/// Streams messages made in advance.
struct Prepared<M>(Arc<Vec<M>>);

impl<M> Clone for Prepared<M> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<M> NamedService for Prepared<M> {
    const NAME: &'static str = "bench.Prepared";
}

impl<M: Message + Clone + Default + 'static> ServerStreamingService<()> for Prepared<M> {
    type Response = M;
    type ResponseStream = Pin<Box<dyn Stream<Item = Result<M, Status>> + Send>>;
    type Future = std::future::Ready<Result<Response<Self::ResponseStream>, Status>>;

    fn call(&mut self, _request: Request<()>) -> Self::Future {
        let messages = self.0.clone();
        let indices = stream::iter(0..messages.len());
        let messages: Self::ResponseStream = Box::pin(indices.map(move |index| Ok(messages[index].clone())));
        std::future::ready(Ok(Response::new(messages)))
    }
}

impl<M: Message + Clone + Default + 'static> tower::Service<http::Request<Body>> for Prepared<M> {
    type Response = http::Response<Body>;
    type Error = Infallible;
    type Future = BoxFuture<'static, Result<Self::Response, Infallible>>;

    fn poll_ready(&mut self, _cx: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, request: http::Request<Body>) -> Self::Future {
        let method = self.clone();
        Box::pin(async move {
            let mut grpc = tonic::server::Grpc::new(ProstCodec::<M, ()>::default());
            Ok(grpc.server_streaming(method, request).await)
        })
    }
}

/// A channel to a server that streams these messages.
async fn serve_prepared<M: Message + Clone + Default + 'static>(messages: Vec<M>) -> Channel {
    let incoming = TcpIncoming::bind("127.0.0.1:0".parse().unwrap()).unwrap().with_nodelay(Some(true));
    let url = format!("http://{}", incoming.local_addr().unwrap());
    let prepared = Prepared(Arc::new(messages));
    tokio::spawn(tonic::transport::Server::builder().add_service(prepared).serve_with_incoming(incoming));
    Channel::from_shared(url).unwrap().connect().await.unwrap()
}

/// Reads a prepared stream to its end.
async fn read_prepared<M: Message + Default + 'static>(channel: &Channel) {
    let mut client = tonic::client::Grpc::new(channel.clone());
    client.ready().await.unwrap();
    let path = http::uri::PathAndQuery::from_static("/bench.Prepared/Stream");
    let codec = ProstCodec::<(), M>::default();
    let response = client.server_streaming(Request::new(()), path, codec).await.unwrap();
    drain(response.into_inner()).await;
}

async fn drain<M>(mut messages: Streaming<M>) {
    while let Some(message) = messages.message().await.unwrap() {
        std::hint::black_box(message);
    }
}

struct Service {
    _server: RunningServer,
    _folder: TempDir,
    channel: Channel,
    job: String,
}

impl Service {
    async fn start() -> Self {
        let folder = TempDir::new().unwrap();
        let mut config = Config::default();
        config.grpc.listen = "127.0.0.1:0".parse().unwrap();
        config.http.listen = "127.0.0.1:0".parse().unwrap();
        config.store = StoreConfig::of_file(&folder.path().join("feedwave.db")).unwrap();
        let server = Server::start(config).await.unwrap();
        let url = format!("http://{}", server.grpc_addr());
        let channel = Channel::from_shared(url).unwrap().connect().await.unwrap();
        let mut jobs = JobsClient::new(channel.clone());
        let request = CreateJobRequest {
            machine: "machines/lathe".to_owned(),
            source: Some(Source::InlineProgram(PROGRAM.as_bytes().into())),
            ..Default::default()
        };
        let job = jobs.create_job(request).await.unwrap().into_inner().job.unwrap().name;
        let request = WatchJobsRequest { after: Some(0), job: job.clone() };
        let mut events = jobs.watch_jobs(request).await.unwrap().into_inner();
        while events.message().await.unwrap().unwrap().event.unwrap().state() != JobState::Ready {}
        Self { _server: server, _folder: folder, channel, job }
    }

    async fn stream(&self, encoding: Encoding) -> Streaming<StreamSetpointsResponse> {
        let request = StreamSetpointsRequest { job: self.job.clone(), encoding: encoding.into(), ..Default::default() };
        SetpointsClient::new(self.channel.clone()).stream_setpoints(request).await.unwrap().into_inner()
    }
}

/// Times `iterations` runs of an asynchronous measurement.
fn time<F: Future<Output = ()>>(runtime: &Runtime, iterations: u64, mut measured: impl FnMut() -> F) -> Duration {
    runtime.block_on(async {
        let started = Instant::now();
        for _ in 0..iterations {
            measured().await;
        }
        started.elapsed()
    })
}

fn streaming(criterion: &mut Criterion) {
    let runtime = Runtime::new().unwrap();
    let service = runtime.block_on(Service::start());
    for (name, encoding) in [("packed", Encoding::PackedDouble), ("raw", Encoding::RawDouble)] {
        compare(criterion, &runtime, &service, name, encoding);
    }
}

fn compare(criterion: &mut Criterion, runtime: &Runtime, service: &Service, name: &str, encoding: Encoding) {
    let messages: Vec<StreamSetpointsResponse> =
        runtime.block_on(async { service.stream(encoding).await.map(Result::unwrap).collect().await });
    let bytes: usize = messages.iter().map(Message::encoded_len).sum();
    let opaque = messages.iter().map(|message| UploadChunk { offset: 0, data: message.encode_to_vec().into() });
    let same_bytes = runtime.block_on(serve_prepared(opaque.collect()));
    let same_messages = runtime.block_on(serve_prepared(messages));
    let setpoints = || async { drain(service.stream(encoding).await).await };
    let of_messages = || read_prepared::<StreamSetpointsResponse>(&same_messages);
    let of_bytes = || read_prepared::<UploadChunk>(&same_bytes);

    let mut group = criterion.benchmark_group(format!("stream_{name}"));
    group.throughput(Throughput::Bytes(bytes as u64)).sample_size(20);
    group.bench_function("setpoints", |bencher| {
        bencher.iter_custom(|iterations| time(runtime, iterations, setpoints));
    });
    group.bench_function("same_messages", |bencher| {
        bencher.iter_custom(|iterations| time(runtime, iterations, of_messages));
    });
    group.bench_function("same_bytes", |bencher| {
        bencher.iter_custom(|iterations| time(runtime, iterations, of_bytes));
    });
    group.finish();

    // Other work on the machine comes and goes between the measurements above; taken in turns, all three suffer alike.
    let mut seconds: [Vec<f64>; 3] = Default::default();
    for _ in 0..ROUNDS {
        let measured = [time(runtime, 1, setpoints), time(runtime, 1, of_messages), time(runtime, 1, of_bytes)];
        for (all, one) in seconds.iter_mut().zip(measured) {
            all.push(one.as_secs_f64());
        }
    }
    let [setpoints, messages, opaque] = seconds.map(|mut all| {
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    });
    println!(
        "{name}, in turns, medians: {:.0} MB/s; {:.0} % of the same messages, {:.0} % of the same bytes",
        bytes as f64 / setpoints / 1e6,
        100.0 * messages / setpoints,
        100.0 * opaque / setpoints,
    );
}

criterion_group!(benches, streaming);
criterion_main!(benches);
