//! The layer around every gRPC call: counts it, times it to the end of its body, bounds how many are in progress, of
//! everybody and of one client, turns new ones away while the service is ending, answers those alone who may ask, has the
//! audit log keep what changes something, ends calls at their deadline and where they panic, and completes statuses that the
//! transport makes.

use std::collections::HashMap;
use std::panic::AssertUnwindSafe;
use std::sync::{Arc, LazyLock};
use std::task::{Context, Poll};
use std::time::Instant;

use bytes::Bytes;
use feedwave_contract::proto::DESCRIPTORS;
use futures_util::FutureExt as _;
use futures_util::future::BoxFuture;
use http::{HeaderMap, Request, Response};
use http_body::Frame;
use prometheus::IntCounter;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_util::sync::CancellationToken;
use tonic::body::Body;
use tonic::{Code, Status};
use tower_http::request_id::RequestId;

use super::answer::AnswerBody;
use super::metrics::{GaugeGuard, Metrics};
use crate::access::{Access, Effect, of_method};
use crate::api::deadline;
use crate::audit::{AuditLog, Audited, asked};
use crate::config::Limits;
use crate::connections::{Connection, Held, HeldBytes, OpenCall, RequestBody, Resource, Unread};
use crate::engine::until;
use crate::error::{Error, complete};
use crate::services;

/// What kind of call a method is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Method {
    /// What a call of it takes up.
    resource: Resource,
    /// Whether clients send a stream of messages.
    sends_many: bool,
    /// Whether the answer is a stream of messages.
    answers_many: bool,
    /// Whether clients may pause between two messages: they do where both sides send.
    may_pause: bool,
}

impl Method {
    const fn new(is_watcher: bool, sends_many: bool, answers_many: bool) -> Self {
        let resource = if is_watcher {
            Resource::Watcher
        } else if sends_many || answers_many {
            Resource::Stream
        } else {
            Resource::Call
        };
        Self { resource, sends_many, answers_many, may_pause: sends_many && answers_many }
    }
}

/// Methods by their paths. Only they may appear as a label; everything else is counted as one, so that clients cannot grow
/// the metrics.
static METHODS: LazyLock<HashMap<String, Method>> = LazyLock::new(|| {
    let services = DESCRIPTORS.services();
    services
        .flat_map(|service| {
            let of = |method: prost_reflect::MethodDescriptor| {
                let is_watcher = method.name().starts_with("Watch");
                let kind = Method::new(is_watcher, method.is_client_streaming(), method.is_server_streaming());
                (format!("/{}/{}", service.full_name(), method.name()), kind)
            };
            service.methods().map(of).collect::<Vec<_>>()
        })
        .collect()
});

/// Methods that have to answer while the service is ending and must not wait for a place.
const HEALTH_PREFIX: &str = "/grpc.health.v1.Health/";
/// Of these, the one that stays open.
const HEALTH_WATCH: &str = "/grpc.health.v1.Health/Watch";
/// Reflection, of either version.
const REFLECTION_PREFIX: &str = "/grpc.reflection.";

/// The label and the kind of a method.
fn method(path: &str) -> (&'static str, Method) {
    match METHODS.get_key_value(path) {
        Some((name, method)) => (name.as_str(), *method),
        None => (
            "other",
            Method::new(path == HEALTH_WATCH, path.starts_with(REFLECTION_PREFIX), path.starts_with(REFLECTION_PREFIX)),
        ),
    }
}

/// Makes [`RpcService`]s.
#[derive(Clone, Debug)]
pub struct RpcLayer {
    metrics: Arc<Metrics>,
    places: Arc<Semaphore>,
    limit: usize,
    message_bytes: usize,
    access: Access,
    audit: AuditLog,
    draining: CancellationToken,
}

/// What a call holds to the end of its answer.
#[derive(Default)]
struct Places {
    _in_all: Option<OwnedSemaphorePermit>,
    _of_client: Option<Held>,
    _of_connection: Option<OpenCall>,
}

impl RpcLayer {
    /// A layer that lets as many calls through at once as the limits permit, and none once `draining` is cancelled.
    #[must_use]
    pub(crate) fn new(
        metrics: Arc<Metrics>,
        limits: &Limits,
        access: Access,
        audit: AuditLog,
        draining: CancellationToken,
    ) -> Self {
        let (limit, message_bytes) = (limits.concurrent_requests, limits.message_bytes);
        Self { metrics, places: Arc::new(Semaphore::new(limit)), limit, message_bytes, access, audit, draining }
    }

    /// Places for a call, held to the end of its response.
    fn admit(&self, path: &str, method: Method, connection: Option<&Arc<Connection>>) -> Result<Places, Error> {
        let _of_connection = connection.map(Connection::begin_call);
        let is_health = path.starts_with(HEALTH_PREFIX);
        if is_health && path != HEALTH_WATCH {
            return Ok(Places { _of_connection, ..Places::default() });
        }
        if self.draining.is_cancelled() && !is_health {
            return Err(Error::Draining);
        }
        let of_client = |connection: &Arc<Connection>| connection.clients().take(connection.client(), method.resource);
        let _of_client = connection.map(of_client).transpose()?;
        let overloaded = |_| {
            self.metrics.connections.refused("calls in progress");
            Error::Overloaded { what: "calls in progress", limit: self.limit as u64 }
        };
        let _in_all = if is_health { None } else { Some(self.places.clone().try_acquire_owned().map_err(overloaded)?) };
        Ok(Places { _in_all, _of_client, _of_connection })
    }

    /// The body of a request, counted where the connection is known, and what holds its bytes.
    fn request_body(
        &self,
        body: Body,
        method: Method,
        connection: Option<&Arc<Connection>>,
    ) -> (Body, Option<HeldBytes>) {
        let Some(connection) = connection else { return (body, None) };
        let clients = connection.clients();
        let held = HeldBytes::new(clients.request_bytes(connection.client()).into());
        let pause = (!method.may_pause).then(|| clients.limits().request_timeout());
        let body = RequestBody::new(body, held.clone(), self.message_bytes, method.sends_many, pause);
        (Body::new(body), Some(held))
    }
}

impl RpcLayer {
    /// Answers a call of somebody who may make it.
    async fn answer<S>(
        &self,
        mut inner: S,
        mut request: Request<Body>,
        method: Method,
        call: &mut Call,
    ) -> Result<Response<Body>, S::Error>
    where
        S: tower::Service<Request<Body>, Response = Response<Body>>,
    {
        let (needs, effect) = of_method(request.uri().path());
        let connection = call.connection.clone();
        let (caller, verdict) = self.access.authorize(needs, request.headers_mut(), connection.as_ref()).await;
        let id = request.extensions().get::<RequestId>().map(|id| id.header_value().clone());
        let id = || id.as_ref().and_then(|id| id.to_str().ok()).unwrap_or_default();
        if let Err(error) = verdict {
            if matches!(error.code(), Code::Unauthenticated | Code::PermissionDenied) {
                self.audit.denied(asked(&caller, call.method, id()), &error).await;
            }
            return Ok(error.into_answer());
        }
        if effect == Effect::Changes {
            match self.audit.begin(asked(&caller, call.method, id()), &caller).await {
                Ok(audited) => call.audited = Some(audited),
                Err(error) => return Ok(error.into_answer()),
            }
        }
        request.extensions_mut().insert(caller);
        let mut held = None;
        let request = request.map(|body| {
            let (body, bytes) = self.request_body(body, method, connection.as_ref());
            held = bytes;
            body
        });
        let answer = inner.call(request).await;
        // The request has become something else, or nothing.
        drop(held);
        answer
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

impl<S> tower::Service<Request<Body>> for RpcService<S>
where
    S: tower::Service<Request<Body>, Response = Response<Body>> + Clone + Send + 'static,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = BoxFuture<'static, Result<Self::Response, Self::Error>>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        self.inner.poll_ready(cx)
    }

    fn call(&mut self, mut request: Request<Body>) -> Self::Future {
        if !services::may_compress(request.uri().path()) {
            request.headers_mut().remove("grpc-accept-encoding");
        }
        let connection = request.extensions().get::<Arc<Connection>>().cloned();
        let (name, method) = method(request.uri().path());
        let admitted = self.layer.admit(request.uri().path(), method, connection.as_ref());
        let mut call = Call::new(&self.layer, name, connection);
        match admitted {
            Ok(places) => call.places = places,
            Err(error) => return Box::pin(async move { Ok(observe(error.into_answer(), call)) }),
        }
        // The one that is ready does the call; the next one is asked for its readiness anew.
        let next = self.inner.clone();
        let inner = std::mem::replace(&mut self.inner, next);
        let layer = self.layer.clone();
        Box::pin(async move {
            let deadline = deadline(request.headers());
            let answered = tokio::select! {
                biased;
                answered = AssertUnwindSafe(layer.answer(inner, request, method, &mut call)).catch_unwind() => answered,
                () = until(deadline) => Ok(Ok(Error::DeadlineExceeded.into_answer())),
            };
            let response = match answered {
                Ok(answer) => answer?,
                Err(_) => call.panicked().into_answer(),
            };
            let status = Status::from_header_map(response.headers());
            call.end_audit(status, method).await;
            Ok(observe(response, call))
        })
    }
}

impl Error {
    /// The error as the whole answer to a call.
    fn into_answer(self) -> Response<Body> {
        Status::from(self).into_http()
    }
}

fn observe(mut response: Response<Body>, mut call: Call) -> Response<Body> {
    call.see(response.headers_mut());
    let connection = call.connection.clone();
    response.map(|body| {
        let body = AnswerBody::new(body, call);
        if let Some(connection) = connection {
            let answer: Arc<dyn Unread> = body.answer();
            connection.watch(Arc::downgrade(&answer));
        }
        Body::new(body)
    })
}

/// A call in progress; counted when dropped.
pub(super) struct Call {
    metrics: Arc<Metrics>,
    method: &'static str,
    message_bytes: usize,
    started: Instant,
    code: Option<Code>,
    /// Why it was not done, where the status says so.
    reason: String,
    /// The entry of the audit log, while it has no result.
    audited: Option<Audited>,
    sent_bytes: IntCounter,
    connection: Option<Arc<Connection>>,
    _active: GaugeGuard,
    places: Places,
}

impl Call {
    fn new(layer: &RpcLayer, method: &'static str, connection: Option<Arc<Connection>>) -> Self {
        let metrics = &layer.metrics;
        Self {
            metrics: metrics.clone(),
            method,
            message_bytes: layer.message_bytes,
            started: Instant::now(),
            code: None,
            reason: String::new(),
            audited: None,
            sent_bytes: metrics.sent_bytes.with_label_values(&[method]),
            connection,
            _active: GaugeGuard::new(&metrics.active_requests),
            places: Places::default(),
        }
    }

    /// Completes and notes the status where these headers or trailers have one.
    pub(super) fn see(&mut self, headers: &mut HeaderMap) {
        complete(headers, self.message_bytes);
        if let Some(code) = headers.get("grpc-status") {
            self.code = Some(Code::from_bytes(code.as_bytes()));
            if self.audited.is_some() {
                self.reason = Status::from_header_map(headers).map_or_else(String::new, |s| s.message().to_owned());
            }
        }
    }

    /// Has the audit log keep the result, where it is known with the head of the answer.
    async fn end_audit(&mut self, status: Option<Status>, method: Method) {
        if status.is_none() && method.answers_many {
            return;
        }
        if let Some(audited) = self.audited.take() {
            let (code, reason) = status.as_ref().map_or((Code::Ok, ""), |status| (status.code(), status.message()));
            audited.end(code, reason).await;
        }
    }

    /// Counts what is sent.
    pub(super) fn sent(&mut self, frame: &mut Frame<Bytes>) {
        if let Some(data) = frame.data_ref() {
            self.sent_bytes.inc_by(data.len() as u64);
        }
        if let Some(trailers) = frame.trailers_mut() {
            self.see(trailers);
        }
    }

    /// The error of a call that panicked. Where and why the panic itself has said in the log.
    pub(super) fn panicked(&self) -> Error {
        self.metrics.connections.panics.inc();
        Error::internal(format!("{} panicked", self.method))
    }

    /// The error of a call whose answer is not read.
    pub(super) fn unread(&self) -> Error {
        self.metrics.connections.unread_streams.inc();
        let limits = self.connection.as_ref().map(|connection| connection.clients().limits());
        let seconds = limits.map_or(0, |limits| limits.unread_timeout_s);
        tracing::info!(method = self.method, seconds, "an answer that nobody reads is ended");
        Error::Unread { seconds }
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        // Without a status the client went away before the end.
        let code = self.code.unwrap_or(Code::Cancelled);
        if let (Some(audited), Some(code)) = (&mut self.audited, self.code) {
            audited.end_later(code, &self.reason);
        }
        let code = code_name(code);
        self.metrics.requests.with_label_values(&[self.method, code]).inc();
        self.metrics.request_seconds.with_label_values(&[self.method]).observe(self.started.elapsed().as_secs_f64());
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
    use http_body::Body as _;
    use tonic_types::StatusExt as _;
    use tower::{Layer as _, Service as _};

    use super::*;
    use crate::config::AuthConfig;
    use crate::engine::Engine;

    fn reason(headers: &HeaderMap) -> (Code, String) {
        let status = Status::from_header_map(headers).unwrap();
        (status.code(), status.get_error_details().error_info().unwrap().reason.clone())
    }

    /// A layer over an empty store.
    async fn layer_of(limits: Limits) -> (tempfile::TempDir, Arc<Metrics>, RpcLayer) {
        let folder = tempfile::tempdir().unwrap();
        let uri = feedwave_store::StoreUri::of_file(&folder.path().join("feedwave.db")).unwrap();
        let store = feedwave_store::Store::open(&uri, feedwave_store::StoreSettings::default()).await.unwrap();
        let (metrics, draining) = (Arc::new(Metrics::new()), CancellationToken::new());
        let engine = Engine::new(store.clone(), metrics.clone(), limits.clone(), draining.clone());
        let (access, audit) = (Access::load(&AuthConfig::default()).unwrap(), AuditLog::new(store, engine));
        let layer = RpcLayer::new(metrics.clone(), &limits, access, audit, draining);
        (folder, metrics, layer)
    }

    #[tokio::test]
    async fn a_panic_ends_its_call_and_no_other() {
        let limits = Limits { concurrent_requests: 1, ..Limits::default() };
        let (_folder, metrics, layer) = layer_of(limits).await;
        let request = || Request::new(Body::empty());
        let at_once = tower::service_fn(|_: Request<Body>| -> std::future::Ready<Result<Response<Body>, Status>> {
            panic!("before there is a future")
        });
        let later = tower::service_fn(async |_: Request<Body>| -> Result<Response<Body>, Status> { panic!("in it") });
        for _ in 0..2 {
            // The place is free again each time.
            let answer = layer.layer(at_once).call(request()).await.unwrap();
            assert_eq!(reason(answer.headers()), (Code::Internal, "INTERNAL".to_owned()));
            drop(answer);
            let answer = layer.layer(later).call(request()).await.unwrap();
            assert_eq!(reason(answer.headers()), (Code::Internal, "INTERNAL".to_owned()));
        }
        let in_body = tower::service_fn(async |_: Request<Body>| -> Result<Response<Body>, Status> {
            let frames = futures_util::stream::once(async { Ok::<_, Status>(Frame::data(Bytes::from_static(b"1"))) });
            let frames =
                futures_util::StreamExt::chain(frames, futures_util::stream::poll_fn(|_| panic!("in the answer")));
            Ok(Response::new(Body::new(StreamBody(Box::pin(frames)))))
        });
        let mut body = layer.layer(in_body).call(request()).await.unwrap().into_body();
        let mut next = async || std::future::poll_fn(|cx| std::pin::Pin::new(&mut body).poll_frame(cx)).await;
        assert_eq!(next().await.unwrap().unwrap().into_data().unwrap(), "1");
        let trailers = next().await.unwrap().unwrap().into_trailers().unwrap();
        assert_eq!(reason(&trailers), (Code::Internal, "INTERNAL".to_owned()));
        assert!(next().await.is_none());
        assert_eq!(metrics.connections.panics.get(), 5);
        assert_eq!(metrics.active_requests.get(), 0);
    }

    /// A body of frames.
    struct StreamBody(std::pin::Pin<Box<dyn futures_util::Stream<Item = Result<Frame<Bytes>, Status>> + Send>>);

    impl http_body::Body for StreamBody {
        type Data = Bytes;
        type Error = Status;

        fn poll_frame(
            mut self: std::pin::Pin<&mut Self>,
            cx: &mut Context<'_>,
        ) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
            futures_util::Stream::poll_next(self.0.as_mut(), cx)
        }
    }

    #[tokio::test]
    async fn a_call_ends_at_its_deadline_with_a_status_that_says_so() {
        let (_folder, _, layer) = layer_of(Limits::default()).await;
        tokio::time::pause();
        let endless = tower::service_fn(|_: Request<Body>| std::future::pending::<Result<Response<Body>, Status>>());
        let mut request = Request::new(Body::empty());
        request.headers_mut().insert("grpc-timeout", "2S".parse().unwrap());
        let mut answer = layer.layer(endless).call(request);
        assert!((&mut answer).now_or_never().is_none());
        tokio::time::advance(std::time::Duration::from_millis(1_990)).await;
        assert!((&mut answer).now_or_never().is_none());
        tokio::time::advance(std::time::Duration::from_millis(20)).await;
        let response = answer.await.unwrap();
        let status = Status::from_header_map(response.headers()).unwrap();
        assert_eq!(status.code(), Code::DeadlineExceeded);
        assert_eq!(status.get_error_details().error_info().unwrap().reason, "DEADLINE_EXCEEDED");
    }
}
