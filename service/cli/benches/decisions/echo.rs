//! The bare stream: decodes the same batches and answers where a window ends, with as many bytes as a decision has.

use std::convert::Infallible;
use std::pin::Pin;
use std::task::{Context, Poll};

use feedwave_contract::proto::ingest_request::Message as Request;
use feedwave_contract::proto::ingest_response::Message;
use feedwave_contract::proto::{Decision, IngestRequest, IngestResponse};
use futures_util::future::BoxFuture;
use futures_util::{Stream, StreamExt as _};
use tonic::body::Body;
use tonic::server::{NamedService, StreamingService};
use tonic::transport::server::TcpIncoming;
use tonic::{Response, Status, Streaming};
use tonic_prost::ProstCodec;

use super::Options;

/// Bytes of a decision as the service sends it.
const DECISION_BYTES: usize = 400;

#[derive(Clone)]
struct Echo {
    /// One answer for so many batches.
    every: u64,
}

impl NamedService for Echo {
    const NAME: &'static str = "feedwave.v1.Telemetry";
}

impl StreamingService<IngestRequest> for Echo {
    type Response = IngestResponse;
    type ResponseStream = Pin<Box<dyn Stream<Item = Result<IngestResponse, Status>> + Send>>;
    type Future = std::future::Ready<Result<Response<Self::ResponseStream>, Status>>;

    fn call(&mut self, request: tonic::Request<Streaming<IngestRequest>>) -> Self::Future {
        let every = self.every;
        let goes_on = |request: &Result<IngestRequest, Status>| {
            let end = matches!(request, Ok(IngestRequest { message: Some(Request::End(_)) }));
            std::future::ready(!end)
        };
        let answers = request.into_inner().take_while(goes_on).filter_map(move |request| {
            let answer = match request {
                Ok(IngestRequest { message: Some(Request::Batch(batch)) }) if batch.sequence % every == every - 1 => {
                    let sensor_time_ns = batch.time_ns.last().copied().unwrap_or_default();
                    let decision = Decision { job: "x".repeat(DECISION_BYTES), sensor_time_ns, ..Default::default() };
                    Some(Ok(IngestResponse { message: Some(Message::Decision(decision)) }))
                }
                Ok(_) => None,
                Err(status) => Some(Err(status)),
            };
            std::future::ready(answer)
        });
        std::future::ready(Ok(Response::new(Box::pin(answers))))
    }
}

impl tower::Service<http::Request<Body>> for Echo {
    type Response = http::Response<Body>;
    type Error = Infallible;
    type Future = BoxFuture<'static, Result<Self::Response, Infallible>>;

    fn poll_ready(&mut self, _cx: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, request: http::Request<Body>) -> Self::Future {
        let method = self.clone();
        Box::pin(async move {
            let mut grpc = tonic::server::Grpc::new(ProstCodec::<IngestResponse, IngestRequest>::default());
            Ok(grpc.streaming(method, request).await)
        })
    }
}

/// Serves until it is killed; `folder` is the file for its address.
pub async fn serve(options: &Options) {
    let incoming = TcpIncoming::bind("127.0.0.1:0".parse().expect("an address")).expect("a port");
    let incoming = incoming.with_nodelay(Some(true));
    let ready_file = options.folder.clone().expect("a ready file");
    let ready = serde_json::json!({ "grpc": incoming.local_addr().expect("an address").to_string() });
    std::fs::write(ready_file.with_extension("part"), ready.to_string()).expect("a ready file");
    std::fs::rename(ready_file.with_extension("part"), ready_file).expect("a ready file");
    let echo = Echo { every: options.window_ms / options.batch_ms[0] };
    tonic::transport::Server::builder().add_service(echo).serve_with_incoming(incoming).await.expect("serves");
}
