//! The layer around every gRPC call: counts it, times it to the end of its body, bounds how many are in progress,
//! turns new ones away while the service is ending, ends them at their deadline, and completes statuses that the
//! transport makes.

use std::collections::HashSet;
use std::pin::Pin;
use std::sync::{Arc, LazyLock};
use std::task::{Context, Poll};
use std::time::Instant;

use feedwave_contract::proto::DESCRIPTORS;
use futures_util::future::BoxFuture;
use http::{HeaderMap, Request, Response};
use http_body::{Frame, SizeHint};
use prometheus::IntCounter;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_util::sync::CancellationToken;
use tonic::body::Body;
use tonic::{Code, Status};

use super::metrics::{GaugeGuard, Metrics};
use crate::api::deadline;
use crate::config::Limits;
use crate::engine::until;
use crate::error::{Error, complete};
use crate::services;

/// Paths that may appear as a label; everything else is counted as one, so that clients cannot grow the metrics.
static METHODS: LazyLock<HashSet<String>> = LazyLock::new(|| {
    let services = DESCRIPTORS.services();
    services
        .flat_map(|service| {
            service.methods().map(|method| format!("/{}/{}", service.full_name(), method.name())).collect::<Vec<_>>()
        })
        .collect()
});

/// Methods that have to answer while the service is ending and must not wait for a place.
const HEALTH_PREFIX: &str = "/grpc.health.v1.Health/";

/// Makes [`RpcService`]s.
#[derive(Clone, Debug)]
pub struct RpcLayer {
    metrics: Arc<Metrics>,
    places: Arc<Semaphore>,
    limit: usize,
    message_bytes: usize,
    draining: CancellationToken,
}

impl RpcLayer {
    /// A layer that lets as many calls through at once as the limits permit, and none once `draining` is cancelled.
    #[must_use]
    pub fn new(metrics: Arc<Metrics>, limits: &Limits, draining: CancellationToken) -> Self {
        let (limit, message_bytes) = (limits.concurrent_requests, limits.message_bytes);
        Self { metrics, places: Arc::new(Semaphore::new(limit)), limit, message_bytes, draining }
    }

    /// A place for a call, held to the end of its response.
    fn admit(&self, path: &str) -> Result<Option<OwnedSemaphorePermit>, Error> {
        if path.starts_with(HEALTH_PREFIX) {
            return Ok(None);
        }
        if self.draining.is_cancelled() {
            return Err(Error::Draining);
        }
        let overloaded = |_| Error::Overloaded { what: "calls in progress", limit: self.limit as u64 };
        self.places.clone().try_acquire_owned().map(Some).map_err(overloaded)
    }
}

impl<S> tower::Layer<S> for RpcLayer {
    type Service = RpcService<S>;

    fn layer(&self, inner: S) -> Self::Service {
        RpcService { inner, layer: self.clone() }
    }
}

/// A service whose calls are counted, timed and bounded.
#[derive(Clone, Debug)]
pub struct RpcService<S> {
    inner: S,
    layer: RpcLayer,
}

impl<S, B> tower::Service<Request<B>> for RpcService<S>
where
    S: tower::Service<Request<B>, Response = Response<Body>>,
    S::Future: Send + 'static,
    S::Error: 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = BoxFuture<'static, Result<Self::Response, Self::Error>>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        self.inner.poll_ready(cx)
    }

    fn call(&mut self, mut request: Request<B>) -> Self::Future {
        if !services::may_compress(request.uri().path()) {
            request.headers_mut().remove("grpc-accept-encoding");
        }
        let path = request.uri().path();
        let admitted = self.layer.admit(path);
        let metrics = &self.layer.metrics;
        let method = METHODS.get(path).map_or("other", String::as_str);
        let mut call = Call {
            metrics: metrics.clone(),
            method,
            message_bytes: self.layer.message_bytes,
            started: Instant::now(),
            code: None,
            sent_bytes: metrics.sent_bytes.with_label_values(&[method]),
            _active: GaugeGuard::new(&metrics.active_requests),
            place: None,
        };
        match admitted {
            Ok(place) => {
                call.place = place;
                let deadline = deadline(request.headers());
                let response = self.inner.call(request);
                Box::pin(async move {
                    let response = tokio::select! {
                        biased;
                        response = response => response?,
                        () = until(deadline) => Status::from(Error::DeadlineExceeded).into_http(),
                    };
                    Ok(observe(response, call))
                })
            }
            Err(error) => {
                let response = Status::from(error).into_http();
                Box::pin(async move { Ok(observe(response, call)) })
            }
        }
    }
}

fn observe(mut response: Response<Body>, mut call: Call) -> Response<Body> {
    call.see(response.headers_mut());
    response.map(|inner| Body::new(ObservedBody { inner, call }))
}

/// A call in progress; counted when dropped.
struct Call {
    metrics: Arc<Metrics>,
    method: &'static str,
    message_bytes: usize,
    started: Instant,
    code: Option<Code>,
    sent_bytes: IntCounter,
    _active: GaugeGuard,
    place: Option<OwnedSemaphorePermit>,
}

impl Call {
    /// Completes and notes the status where these headers or trailers have one.
    fn see(&mut self, headers: &mut HeaderMap) {
        complete(headers, self.message_bytes);
        if let Some(code) = headers.get("grpc-status") {
            self.code = Some(Code::from_bytes(code.as_bytes()));
        }
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        // Without a status the client went away before the end.
        let code = code_name(self.code.unwrap_or(Code::Cancelled));
        self.metrics.requests.with_label_values(&[self.method, code]).inc();
        self.metrics.request_seconds.with_label_values(&[self.method]).observe(self.started.elapsed().as_secs_f64());
    }
}

struct ObservedBody {
    inner: Body,
    call: Call,
}

impl http_body::Body for ObservedBody {
    type Data = bytes::Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Self::Data>, Self::Error>>> {
        let mut polled = Pin::new(&mut self.inner).poll_frame(cx);
        if let Poll::Ready(Some(Ok(frame))) = &mut polled {
            if let Some(data) = frame.data_ref() {
                self.call.sent_bytes.inc_by(data.len() as u64);
            }
            if let Some(trailers) = frame.trailers_mut() {
                self.call.see(trailers);
            }
        }
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.inner.size_hint()
    }
}

/// Name of a status code as the gRPC documentation writes it.
#[must_use]
pub const fn code_name(code: Code) -> &'static str {
    match code {
        Code::Ok => "OK",
        Code::Cancelled => "CANCELLED",
        Code::Unknown => "UNKNOWN",
        Code::InvalidArgument => "INVALID_ARGUMENT",
        Code::DeadlineExceeded => "DEADLINE_EXCEEDED",
        Code::NotFound => "NOT_FOUND",
        Code::AlreadyExists => "ALREADY_EXISTS",
        Code::PermissionDenied => "PERMISSION_DENIED",
        Code::ResourceExhausted => "RESOURCE_EXHAUSTED",
        Code::FailedPrecondition => "FAILED_PRECONDITION",
        Code::Aborted => "ABORTED",
        Code::OutOfRange => "OUT_OF_RANGE",
        Code::Unimplemented => "UNIMPLEMENTED",
        Code::Internal => "INTERNAL",
        Code::Unavailable => "UNAVAILABLE",
        Code::DataLoss => "DATA_LOSS",
        Code::Unauthenticated => "UNAUTHENTICATED",
    }
}

#[cfg(test)]
mod tests {
    use tonic_types::StatusExt as _;
    use tower::{Layer as _, Service as _};

    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_call_ends_at_its_deadline_with_a_status_that_says_so() {
        let layer = RpcLayer::new(Arc::new(Metrics::new()), &Limits::default(), CancellationToken::new());
        let endless = tower::service_fn(|_: Request<Body>| std::future::pending::<Result<Response<Body>, Status>>());
        let mut request = Request::new(Body::empty());
        request.headers_mut().insert("grpc-timeout", "2S".parse().unwrap());
        let started = tokio::time::Instant::now();
        let response = layer.layer(endless).call(request).await.unwrap();
        assert_eq!(started.elapsed().as_secs(), 2);
        let status = Status::from_header_map(response.headers()).unwrap();
        assert_eq!(status.code(), Code::DeadlineExceeded);
        assert_eq!(status.get_error_details().error_info().unwrap().reason, "DEADLINE_EXCEEDED");
    }
}
