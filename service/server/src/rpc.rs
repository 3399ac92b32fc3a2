//! The layer around every gRPC call: counts it, times it to the end of its body, bounds how many are in progress, of
//! everybody and of one client, turns new ones away while the service is ending, answers those alone who may ask, has the
//! audit log keep what changes something, ends calls at their deadline and where they panic, and completes statuses that the
//! transport makes.

mod answer;

use std::collections::HashMap;
use std::panic::AssertUnwindSafe;
use std::sync::{Arc, LazyLock};
use std::task::{Context, Poll};
use std::time::Instant;

use bytes::Bytes;
use feedwave_contract::codec::{Account, accounted};
use feedwave_contract::proto::DESCRIPTORS;
use feedwave_store::AuditRequest;
use futures_util::FutureExt as _;
use futures_util::future::BoxFuture;
use http::{HeaderMap, Request, Response, StatusCode, header};
use http_body::Frame;
use prometheus::IntCounter;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_util::sync::CancellationToken;
use tonic::body::Body;
use tonic::{Code, Status};
use tower_http::request_id::RequestId;
use tracing::Instrument as _;

use answer::AnswerBody;

use crate::access::{Access, Caller, Effect, of_method};
use crate::api::deadline;
use crate::audit::{AuditLog, Audited, asked};
use crate::config::Limits;
use crate::connections::{Connection, Held, OpenCall, RequestBody, RequestMemory, Resource, Unread};
use crate::engine::until;
use crate::error::{Error, code_name, complete};
use crate::observability::metrics::{GaugeGuard, Metrics};
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

    /// A request whose bytes, and what its messages become, are counted where the connection is known; and what holds them.
    fn counted(
        &self,
        request: Request<Body>,
        method: Method,
        connection: Option<&Arc<Connection>>,
    ) -> (Request<Body>, Option<RequestMemory>) {
        let Some(connection) = connection else { return (request, None) };
        let clients = connection.clients();
        let held = RequestMemory::new(clients, connection.client());
        let pause = (!method.may_pause).then(|| clients.limits().request_timeout());
        let counted = |body| RequestBody::new(body, held.clone(), self.message_bytes, method.sends_many, pause);
        let mut request = request.map(|body| Body::new(counted(body)));
        request.extensions_mut().insert(held.account());
        (request, Some(held))
    }
}

/// Has a request answered by the services, which ask its account before they decode a message.
async fn answered<S>(inner: &mut S, mut request: Request<Body>) -> Result<Response<Body>, S::Error>
where
    S: tower::Service<Request<Body>, Response = Response<Body>>,
{
    match request.extensions_mut().remove::<Account>() {
        Some(account) => accounted(account, inner.call(request)).await,
        None => inner.call(request).await,
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
        S: tower::Service<Request<Body>, Response = Response<Body>> + Send + 'static,
        S::Future: Send,
        S::Error: Send + 'static,
    {
        let (needs, effect) = of_method(request.uri().path());
        let connection = call.connection.clone();
        let named = self.access.check_host(needs, &request, connection.as_ref());
        let (caller, verdict) = self.access.authorize(needs, request.headers_mut(), connection.as_ref()).await;
        let id = request.extensions().get::<RequestId>().map(|id| id.header_value().clone());
        let id = id.as_ref().and_then(|id| id.to_str().ok()).unwrap_or_default();
        let asked = asked(&caller, call.method, id);
        if let Err(error) = named.and(verdict) {
            if matches!(error.code(), Code::Unauthenticated | Code::PermissionDenied) {
                self.audit.denied(asked, &caller, &error).await;
            }
            return Ok(error.into_answer());
        }
        request.extensions_mut().insert(caller.clone());
        let (request, held) = self.counted(request, method, connection.as_ref());
        if effect == Effect::Changes {
            if method.resource == Resource::Call {
                return self.change(inner, request, asked, caller, call).await;
            }
            match self.audit.begin(asked, &caller).await {
                Ok(audited) => call.audited = Some(audited),
                Err(error) => return Ok(error.into_answer()),
            }
        }
        let answer = answered(&mut inner, request).await;
        // The request has become something else, or nothing.
        drop(held);
        answer
    }

    /// Does a call that changes something to its end, with its result in the audit log: a client that goes away, and a
    /// deadline, end the wait for the answer and not the work, of which one half would be without the other.
    async fn change<S>(
        &self,
        mut inner: S,
        request: Request<Body>,
        asked: AuditRequest,
        caller: Caller,
        call: &Call,
    ) -> Result<Response<Body>, S::Error>
    where
        S: tower::Service<Request<Body>, Response = Response<Body>> + Send + 'static,
        S::Future: Send,
        S::Error: Send + 'static,
    {
        let (audit, places) = (self.audit.clone(), call.places.clone());
        let (metrics, method) = (call.metrics.clone(), call.method);
        let work = async move {
            // They are taken up as long as the work is.
            let _places = places;
            let audited = match audit.begin(asked, &caller).await {
                Ok(audited) => audited,
                Err(error) => return Ok(error.into_answer()),
            };
            let done = AssertUnwindSafe(answered(&mut inner, request)).catch_unwind().await;
            let answer = match done {
                Ok(answer) => answer?,
                Err(_) => panicked(&metrics, method).into_answer(),
            };
            let status = Status::from_header_map(answer.headers());
            let (code, reason) = status.as_ref().map_or((Code::Ok, ""), |status| (status.code(), status.message()));
            audited.end(code, reason).await;
            Ok(answer)
        };
        let done = self.audit.engine().to_its_end(work.in_current_span()).await;
        done.unwrap_or_else(|error| Ok(error.into_answer()))
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
        if !is_grpc(request.headers()) {
            return Box::pin(std::future::ready(Ok(not_grpc())));
        }
        let connection = request.extensions().get::<Arc<Connection>>().cloned();
        let (name, method) = method(request.uri().path());
        let admitted = self.layer.admit(request.uri().path(), method, connection.as_ref());
        let mut call = Call::new(&self.layer, name, connection);
        match admitted {
            Ok(places) => call.places = Arc::new(places),
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

/// Whether a request says that it is a call. Pages of other sites can have a browser send other kinds, with the certificate of
/// whoever looks at them, without asking first.
pub(crate) fn is_grpc(headers: &HeaderMap) -> bool {
    headers.get(header::CONTENT_TYPE).is_some_and(|kind| kind.as_bytes().starts_with(b"application/grpc"))
}

pub(crate) fn not_grpc() -> Response<Body> {
    let mut response = Response::new(Body::empty());
    *response.status_mut() = StatusCode::UNSUPPORTED_MEDIA_TYPE;
    response
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

fn panicked(metrics: &Metrics, method: &str) -> Error {
    metrics.connections.panics.inc();
    Error::internal(format!("{method} panicked"))
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
    places: Arc<Places>,
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
            places: Arc::default(),
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
        panicked(&self.metrics, self.method)
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
        // Without a status the client went away before the end: of the answer, or of what it asked for.
        let is_done = self.audited.as_ref().is_some_and(Audited::is_done);
        let code = self.code.unwrap_or(if is_done { Code::Ok } else { Code::Cancelled });
        if let (Some(audited), Some(code)) = (&mut self.audited, self.code) {
            audited.end_later(code, &self.reason);
        }
        let code = code_name(code);
        self.metrics.requests.with_label_values(&[self.method, code]).inc();
        self.metrics.request_seconds.with_label_values(&[self.method]).observe(self.started.elapsed().as_secs_f64());
    }
}

#[cfg(test)]
mod tests;
