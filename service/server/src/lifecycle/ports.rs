//! The ports, and what is around each call that comes in by them.

use std::net::SocketAddr;
use std::sync::Arc;

use axum::middleware::{Next, from_fn};
use feedwave_contract::convert::timestamp;
use http::{Request, Response, StatusCode, header};
use jiff::Timestamp;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use tonic_health::server::HealthReporter;
use tower::ServiceBuilder;
use tower::util::MapRequestLayer;
use tower_http::classify::{GrpcCode, GrpcErrorsAsFailures, SharedClassifier};
use tower_http::request_id::{MakeRequestId, PropagateRequestIdLayer, RequestId, SetRequestIdLayer};
use tower_http::trace::{DefaultOnResponse, TraceLayer};
use tracing::Level;
use uuid::Uuid;

use super::StartError;
use super::certificates::Certificates;
use super::failures::Failures;
use super::onlookers::Onlookers;
use crate::access::Access;
use crate::api::Api;
use crate::audit::AuditLog;
use crate::config::{Config, ConnectionLimits};
use crate::connections::{App, Clients, Connection, Port, Tls, app};
use crate::cut_off::CutOff;
use crate::error::Error;
use crate::http::{HttpState, REQUEST_ID, router};
use crate::mtconnect::{self, Agent, AgentState};
use crate::observability::metrics::Metrics;
use crate::readiness::Readiness;
use crate::rpc::{RpcLayer, is_grpc, not_grpc};
use crate::services;

/// Longest request id that is taken over from a client, bytes: it comes back in the headers of the answer.
const MAX_REQUEST_ID_BYTES: usize = 128;

/// Ports that are open and not served yet, with their addresses.
pub(super) struct Listeners {
    grpc: (TcpListener, SocketAddr),
    http: (TcpListener, SocketAddr),
    mtconnect: Option<(TcpListener, SocketAddr)>,
}

/// Ports that are served until their tasks end.
#[derive(Debug)]
pub(super) struct Ports {
    pub(super) grpc_addr: SocketAddr,
    pub(super) http_addr: SocketAddr,
    pub(super) mtconnect_addr: Option<SocketAddr>,
    pub(super) grpc: JoinHandle<()>,
    pub(super) http: JoinHandle<()>,
    pub(super) mtconnect: Option<JoinHandle<()>>,
}

/// What calls are answered from.
pub(super) struct Asked<'a> {
    pub(super) api: &'a Api,
    pub(super) access: &'a Access,
    pub(super) audit: &'a AuditLog,
    pub(super) readiness: Readiness,
    pub(super) health: &'a HealthReporter,
}

/// What answers at each port.
pub(super) struct Apps {
    grpc: App,
    http: App,
    mtconnect: Option<App>,
    cut_off: CutOff,
}

impl Apps {
    /// # Errors
    /// [`StartError::Setup`] where the machines that the MTConnect agent shows cannot be read.
    pub(super) async fn new(asked: Asked<'_>, config: &Config) -> Result<Self, StartError> {
        let setup = |error: Error| StartError::Setup(error.to_string());
        let mtconnect = match config.mtconnect.listen {
            Some(_) => Some(mtconnect_app(asked.api, asked.access, config).await.map_err(setup)?),
            None => None,
        };
        let calls = grpc_app(&asked)?;
        // Asked before anything else: whoever asks so has not said who it is.
        let across = || ServiceBuilder::new().map_response(preflight);
        let grpc = app(across().option_layer(config.cors.for_grpc_web()).service(calls.clone()));
        let state = HttpState {
            api: asked.api.clone(),
            readiness: asked.readiness,
            access: asked.access.clone(),
            audit: asked.audit.clone(),
            start_time: timestamp(Timestamp::now().as_microsecond()),
            heartbeat: config.http.heartbeat(),
        };
        let http = app(across().option_layer(config.cors.for_http()).service(router(state, &calls)));
        Ok(Self { grpc, http, mtconnect, cut_off: asked.api.engine.cut_off().clone() })
    }
}

impl Listeners {
    /// Opens the ports that are configured.
    ///
    /// # Errors
    /// [`StartError::Listen`] with the key of the one that cannot be opened.
    pub(super) async fn open(config: &Config) -> Result<Self, StartError> {
        let grpc = listen("grpc.listen", config.grpc.listen).await?;
        let http = listen("http.listen", config.http.listen).await?;
        let mtconnect = match config.mtconnect.listen {
            Some(address) => Some(listen("mtconnect.listen", address).await?),
            None => None,
        };
        Ok(Self { grpc, http, mtconnect })
    }

    /// Serves them: the gRPC port until `draining`, those of onlookers until they are to stop.
    pub(super) fn serve(
        self,
        apps: Apps,
        config: &Config,
        certificates: &Certificates,
        metrics: &Metrics,
        onlookers: &Onlookers,
        draining: CancellationToken,
    ) -> Ports {
        let (limits, refused) = bounded_by_descriptors(config);
        let clients = Clients::new(limits, metrics.connections.clone());
        let refusals = Arc::new(Semaphore::new(refused));
        let port = |name, listener, app, tls: Option<&Arc<Tls>>| Port {
            name,
            listener,
            app,
            tls: tls.cloned(),
            clients: clients.clone(),
            refusals: refusals.clone(),
            streams_per_connection: config.limits.streams_per_connection,
            // A client that still reads when its connection is closed has the time that open calls have.
            linger: config.limits.drain(),
            // Onlookers are shown that it is.
            cut_off: CutOff::default(),
            gives_way: true,
        };
        let ((grpc, grpc_addr), (http, http_addr)) = (self.grpc, self.http);
        let mtconnect_addr = self.mtconnect.as_ref().map(|(_, address)| *address);
        let mtconnect = self.mtconnect.zip(apps.mtconnect);
        let mtconnect = mtconnect.map(|((listener, _), app)| port("mtconnect", listener, app, None));
        let grpc = Port {
            cut_off: apps.cut_off,
            gives_way: false,
            ..port("grpc", grpc, apps.grpc, certificates.grpc.as_ref())
        };
        let http = port("http", http, apps.http, certificates.http.as_ref());
        Ports {
            grpc_addr,
            http_addr,
            mtconnect_addr,
            grpc: tokio::spawn(grpc.serve(draining)),
            http: onlookers.spawn(http.serve(onlookers.stop().clone())),
            mtconnect: mtconnect.map(|mtconnect| onlookers.spawn(mtconnect.serve(onlookers.stop().clone()))),
        }
    }
}

async fn listen(key: &'static str, address: SocketAddr) -> Result<(TcpListener, SocketAddr), StartError> {
    let failed = |source| StartError::Listen { key, address, source };
    let listener = TcpListener::bind(address).await.map_err(failed)?;
    let bound = listener.local_addr().map_err(failed)?;
    Ok((listener, bound))
}

/// What descriptors are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Descriptors {
    /// Connections that are served.
    served: usize,
    /// Connections that are told why they are not.
    refused: usize,
}

impl Descriptors {
    /// The store's readers, its writer and its log, three files each, the runtimes, files that are read anew, and connections to others.
    const OTHERS: usize = 96;
    /// More need not be told at the same time.
    const MOST_REFUSED: usize = 64;

    /// Shares as many among them as the process may have.
    fn of(most: usize) -> Self {
        let others = Self::OTHERS.min(most / 2);
        let refused = Self::MOST_REFUSED.min(most / 8);
        Self { served: most.saturating_sub(others + refused).max(1), refused: refused.max(1) }
    }
}

/// The bounds on connections, with no more of them than the process may have descriptors, and how many may be told at the same time that
/// there is no place.
fn bounded_by_descriptors(config: &Config) -> (ConnectionLimits, usize) {
    let mut limits = config.connections.clone();
    let most = rustix::process::getrlimit(rustix::process::Resource::Nofile).current;
    let most = most.and_then(|most| usize::try_from(most).ok()).unwrap_or(usize::MAX);
    let Descriptors { served, refused } = Descriptors::of(most);
    if limits.total > served {
        tracing::warn!(
            descriptors = most,
            connections = served,
            "connections.total is more than there are descriptors for"
        );
        limits.total = served;
    }
    (limits, refused)
}

/// An answer to a browser that asks what it may ask has nothing in it, and says so: no other one names methods.
fn preflight<B>(mut response: Response<B>) -> Response<B> {
    if response.headers().contains_key(header::ACCESS_CONTROL_ALLOW_METHODS) {
        *response.status_mut() = StatusCode::NO_CONTENT;
    }
    response
}

/// The gRPC services with what is around each call.
fn grpc_app(asked: &Asked<'_>) -> Result<App, StartError> {
    let (api, access, audit) = (asked.api, asked.access.clone(), asked.audit.clone());
    let rpc = RpcLayer::new(api.metrics.clone(), &api.limits, access, audit, api.engine.draining().clone());
    let routes = services::routes(api, api.limits.message_bytes, asked.health)
        .map_err(|error| StartError::Setup(error.to_string()))?;
    let trace = TraceLayer::new(SharedClassifier::new(classifier()))
        .make_span_with(span)
        .on_response(DefaultOnResponse::new().level(Level::DEBUG))
        .on_failure(Failures::default());
    let service = ServiceBuilder::new()
        .layer(from_fn(only_grpc))
        .layer(tonic_web::GrpcWebLayer::new())
        .layer(MapRequestLayer::new(bound_request_id))
        .layer(SetRequestIdLayer::x_request_id(NewRequestId))
        .layer(trace)
        .layer(PropagateRequestIdLayer::x_request_id())
        .layer(rpc)
        .service(routes);
    Ok(app(service))
}

/// Refuses what is no call, whatever the version of HTTP.
async fn only_grpc(request: axum::extract::Request, next: Next) -> Response<axum::body::Body> {
    if is_grpc(request.headers()) { next.run(request).await } else { not_grpc().map(axum::body::Body::new) }
}

/// The MTConnect agent, which follows the machines from here on.
async fn mtconnect_app(api: &Api, access: &Access, config: &Config) -> Result<App, Error> {
    let agent = Agent::new(config.mtconnect.buffer_size);
    let store = api.store.of_all_tenants();
    // Clients of the standard do not say who they are: they all see what one tenant sees.
    let reader = agent.begin(&api.floors.of(config.mtconnect.tenant()), store).await?;
    let draining = api.engine.draining();
    api.engine.spawn(agent.clone().follow(reader, store.clone(), draining.clone()));
    let state = AgentState::new(agent, access.clone(), config.mtconnect.streams, draining.clone());
    Ok(app(mtconnect::router(state)))
}

/// What a client did wrong, or had happen by its own wish, is no failure of the service.
fn classifier() -> GrpcErrorsAsFailures {
    let by_the_client = [
        GrpcCode::Cancelled,
        GrpcCode::InvalidArgument,
        GrpcCode::DeadlineExceeded,
        GrpcCode::NotFound,
        GrpcCode::AlreadyExists,
        GrpcCode::FailedPrecondition,
        GrpcCode::Aborted,
        GrpcCode::OutOfRange,
        GrpcCode::Unimplemented,
    ];
    by_the_client.into_iter().fold(GrpcErrorsAsFailures::new(), GrpcErrorsAsFailures::with_success)
}

/// The span of a call, with its request id and its client.
fn span<B>(request: &Request<B>) -> tracing::Span {
    let id = request.extensions().get::<RequestId>();
    let id = id.and_then(|id| id.header_value().to_str().ok()).unwrap_or_default();
    let client = request.extensions().get::<Arc<Connection>>().map(|connection| connection.client().to_string());
    tracing::info_span!("call", method = request.uri().path(), request_id = id, client)
}

/// Takes away a request id that is too long, so that the call gets one of ours.
fn bound_request_id<B>(mut request: Request<B>) -> Request<B> {
    if request.headers().get(REQUEST_ID).is_some_and(|id| id.len() > MAX_REQUEST_ID_BYTES) {
        request.headers_mut().remove(REQUEST_ID);
    }
    request
}

/// Gives calls an id that come without one.
#[derive(Clone, Copy, Debug)]
struct NewRequestId;

impl MakeRequestId for NewRequestId {
    fn make_request_id<B>(&mut self, _request: &Request<B>) -> Option<RequestId> {
        Uuid::now_v7().to_string().parse().ok().map(RequestId::new)
    }
}

#[cfg(test)]
mod tests {
    use super::Descriptors;

    #[test]
    fn descriptors_are_left_for_the_store() {
        assert_eq!(Descriptors::of(1_024), Descriptors { served: 864, refused: 64 });
        assert_eq!(Descriptors::of(200), Descriptors { served: 79, refused: 25 });
        for most in 0..4_096 {
            let Descriptors { served, refused } = Descriptors::of(most);
            assert!(served >= 1 && refused >= 1, "{most}");
            assert!(most < 4 || served + refused + Descriptors::OTHERS.min(most / 2) <= most.max(2) + 1, "{most}");
        }
    }
}
