//! A server from its first port to its last call: start, run, drain.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use feedwave_contract::convert::timestamp;
use feedwave_store::{Store, StoreError, StoreSettings};
use http::Request;
use jiff::Timestamp;
use tokio::net::TcpListener;
use tokio::task::{JoinError, JoinHandle};
use tokio_util::sync::CancellationToken;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;
use tower::ServiceBuilder;
use tower::util::MapRequestLayer;
use tower_http::classify::{GrpcCode, GrpcErrorsAsFailures, SharedClassifier};
use tower_http::request_id::{MakeRequestId, PropagateRequestIdLayer, RequestId, SetRequestIdLayer};
use tower_http::trace::{DefaultOnFailure, DefaultOnResponse, TraceLayer};
use tracing::Level;
use uuid::Uuid;

use crate::access::Access;
use crate::api::Api;
use crate::audit::AuditLog;
use crate::config::{Config, ConnectionLimits};
use crate::connections::{App, Clients, Connection, Port, Tls, TlsError, app};
use crate::engine::Engine;
use crate::error::Error;
use crate::http::{HttpState, router};
use crate::mtconnect::{Agent, AgentState};
use crate::observability::metrics::Metrics;
use crate::observability::rpc::RpcLayer;
use crate::{mtconnect, readiness, retention, services};

/// The header with the id of a call.
pub(crate) const REQUEST_ID: &str = "x-request-id";

/// How often certificate files are looked at for changes.
const RELOAD_INTERVAL: Duration = Duration::from_secs(10);

/// Least time that closing the store may take.
const LEAST_CLOSING: Duration = Duration::from_secs(10);

/// Why a server could not be started.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The store cannot be used.
    #[error("store.uri: {uri}: {source}")]
    Store {
        /// Where it is kept.
        uri: String,
        /// Why.
        source: StoreError,
    },
    /// A port cannot be opened.
    #[error("{key}: {address}: {source}")]
    Listen {
        /// The configuration key.
        key: &'static str,
        /// The address.
        address: SocketAddr,
        /// Why.
        source: std::io::Error,
    },
    /// A certificate, a key or the file of known clients cannot be used.
    #[error("{key}: {reason}")]
    Tls {
        /// The configuration key.
        key: String,
        /// Why.
        reason: String,
    },
    /// Anything else.
    #[error("the server could not be set up: {0}")]
    Setup(String),
}

/// A server that can be started.
#[derive(Debug)]
pub struct Server;

/// A server that runs.
#[derive(Debug)]
pub struct RunningServer {
    grpc_addr: SocketAddr,
    http_addr: SocketAddr,
    mtconnect_addr: Option<SocketAddr>,
    config: Config,
    engine: Engine,
    metrics: Arc<Metrics>,
    store: Store,
    health: HealthReporter,
    certificates: Certificates,
    grpc: JoinHandle<()>,
    http: JoinHandle<()>,
    mtconnect: Option<JoinHandle<()>>,
    http_stop: CancellationToken,
}

impl Server {
    /// Opens the store and both ports, resumes unfinished work, and serves. Call inside a runtime.
    ///
    /// # Errors
    /// [`StartError`] with the configuration key that is at fault.
    pub async fn start(config: Config) -> Result<RunningServer, StartError> {
        let metrics = Arc::new(Metrics::new());
        let store = open_store(&config, metrics.clone()).await?;
        let (grpc_listener, grpc_addr) = listen("grpc.listen", config.grpc.listen).await?;
        let (http_listener, http_addr) = listen("http.listen", config.http.listen).await?;

        let mtconnect_listener = match config.mtconnect.listen {
            Some(address) => Some(listen("mtconnect.listen", address).await?),
            None => None,
        };
        let draining = CancellationToken::new();
        let engine = Engine::new(store.clone(), metrics.clone(), config.limits.clone(), draining.clone());
        let api = Api::new(store.clone(), engine.clone(), metrics.clone(), config.limits.clone());
        let setup = |error: Error| StartError::Setup(error.to_string());
        api.seed_machines().await.map_err(setup)?;
        api.restore_floors().await.map_err(setup)?;

        let health = HealthReporter::new();
        for service in services::names() {
            health.set_service_status(service, ServingStatus::Serving).await;
        }
        let (readiness, probes) = readiness::follow(store.clone(), health.clone(), metrics.clone(), draining.clone());
        engine.spawn(probes);
        let rules = config.retention.clone();
        engine.spawn(retention::follow(store.clone(), metrics.clone(), rules, draining.clone()));
        let certificates = Certificates::load(&config, metrics.clone())?;
        let clients = Clients::new(bounded_by_descriptors(&config), metrics.connections.clone());
        let http_stop = CancellationToken::new();
        let access = certificates.access.clone();
        let audit = AuditLog::new(store.clone(), engine.clone());
        engine.spawn(audit.clone().follow(draining.clone()));
        let http_state = HttpState {
            api: api.clone(),
            readiness,
            access: access.clone(),
            audit: audit.clone(),
            start_time: timestamp(Timestamp::now().as_microsecond()),
            heartbeat: config.http.heartbeat(),
        };
        let port = |name, listener, app, tls: Option<&Arc<Tls>>| Port {
            name,
            listener,
            app,
            tls: tls.cloned(),
            clients: clients.clone(),
            streams_per_connection: config.limits.streams_per_connection,
            // A client that still reads when its connection is closed has the time that open calls have.
            linger: config.limits.drain(),
        };
        let mtconnect_addr = mtconnect_listener.as_ref().map(|(_, address)| *address);
        let mtconnect = match mtconnect_listener {
            Some((listener, _)) => {
                let app = mtconnect_app(&api, &config).await.map_err(setup)?;
                Some(tokio::spawn(port("mtconnect", listener, app, None).serve(http_stop.clone())))
            }
            None => None,
        };
        let grpc = grpc_app(&api, access, audit, &config, &health, &draining)?;
        let grpc = port("grpc", grpc_listener, grpc, certificates.grpc.as_ref()).serve(draining.clone());
        let http = app(ServiceBuilder::new().option_layer(config.cors.for_http()).service(router(http_state)));
        let http = port("http", http_listener, http, certificates.http.as_ref()).serve(http_stop.clone());

        engine.start();
        let (access, stop) = (certificates.access.clone(), http_stop.clone());
        tokio::spawn(async move { stop.run_until_cancelled(access.follow_keys()).await });
        tokio::spawn(certificates.clone().watch(http_stop.clone()));
        Ok(RunningServer {
            grpc_addr,
            http_addr,
            mtconnect_addr,
            engine,
            metrics,
            store,
            health,
            certificates,
            grpc: tokio::spawn(grpc),
            http: tokio::spawn(http),
            mtconnect,
            http_stop,
            config,
        })
    }
}

/// The MTConnect agent, which follows the machines from here on.
async fn mtconnect_app(api: &Api, config: &Config) -> Result<App, Error> {
    let agent = Agent::new(config.mtconnect.buffer_size);
    let store = api.store.of_all_tenants();
    // Clients of the standard do not say who they are: they all see what one tenant sees.
    let reader = agent.begin(&api.floors.of(config.mtconnect.tenant()), store).await?;
    let draining = api.engine.draining();
    api.engine.spawn(agent.clone().follow(reader, store.clone(), draining.clone()));
    let state = AgentState::new(agent, config.mtconnect.streams, draining.clone());
    Ok(app(mtconnect::router(state)))
}

/// The gRPC services with what is around each call.
fn grpc_app(
    api: &Api,
    access: Access,
    audit: AuditLog,
    config: &Config,
    health: &HealthReporter,
    draining: &CancellationToken,
) -> Result<App, StartError> {
    let rpc = RpcLayer::new(api.metrics.clone(), &api.limits, access, audit, draining.clone());
    let routes = services::routes(api, api.limits.message_bytes, health)
        .map_err(|error| StartError::Setup(error.to_string()))?;
    let trace = TraceLayer::new(SharedClassifier::new(classifier()))
        .make_span_with(span)
        .on_response(DefaultOnResponse::new().level(Level::DEBUG))
        .on_failure(DefaultOnFailure::new().level(Level::WARN));
    let service = ServiceBuilder::new()
        // Asked before anything else: whoever asks so has not said who it is.
        .option_layer(config.cors.for_grpc_web())
        .layer(tonic_web::GrpcWebLayer::new())
        .layer(MapRequestLayer::new(bound_request_id))
        .layer(SetRequestIdLayer::x_request_id(NewRequestId))
        .layer(trace)
        .layer(PropagateRequestIdLayer::x_request_id())
        .layer(rpc)
        .service(routes);
    Ok(app(service))
}

/// The bounds on connections, with no more of them than the process may have descriptors: the store and files need some
/// as well.
fn bounded_by_descriptors(config: &Config) -> ConnectionLimits {
    const OTHER_DESCRIPTORS: usize = 64;
    let mut limits = config.connections.clone();
    let descriptors = rustix::process::getrlimit(rustix::process::Resource::Nofile).current;
    if let Some(descriptors) = descriptors.and_then(|descriptors| usize::try_from(descriptors).ok()) {
        let most = descriptors.saturating_sub(OTHER_DESCRIPTORS).max(1);
        if limits.total > most {
            tracing::warn!(descriptors, connections = most, "connections.total is more than there are descriptors for");
            limits.total = most;
        }
    }
    limits
}

/// Certificates of the ports and the clients that are known, taken over anew when their files change.
#[derive(Clone, Debug)]
struct Certificates {
    grpc: Option<Arc<Tls>>,
    http: Option<Arc<Tls>>,
    access: Access,
    metrics: Arc<Metrics>,
}

impl Certificates {
    fn load(config: &Config, metrics: Arc<Metrics>) -> Result<Self, StartError> {
        let failed = |error: TlsError| StartError::Tls { key: error.key, reason: error.reason };
        let load = |(section, files)| Tls::load(section, files).map_err(failed);
        let http = config.http_tls().map(load).transpose()?;
        // One section is one set of files.
        let grpc = if config.grpc.tls.is_some() { config.grpc_tls().map(load).transpose()? } else { http.clone() };
        let access = Access::load(&config.auth).map_err(|(key, reason)| StartError::Tls { key, reason })?;
        Ok(Self { grpc, http, access, metrics })
    }

    /// Takes over what has changed.
    fn reload(&self) {
        match self.access.reload() {
            Ok(false) => {}
            Ok(true) => tracing::info!("the changed file of known clients or keys is used from now on"),
            Err(error) => {
                tracing::error!(%error, "the changed file of known clients or keys cannot be used, the former stays");
            }
        }
        let apart = self.http.iter().filter(|http| !self.grpc.as_ref().is_some_and(|grpc| Arc::ptr_eq(grpc, http)));
        for tls in self.grpc.iter().chain(apart) {
            let outcome = match tls.reload() {
                Ok(false) => continue,
                Ok(true) => {
                    tracing::info!(?tls, "changed certificates are used from now on");
                    "taken_over"
                }
                Err(error) => {
                    tracing::error!(%error, "changed certificates cannot be used, the former ones stay");
                    "refused"
                }
            };
            self.metrics.connections.certificate_reloads.with_label_values(&[outcome]).inc();
        }
    }

    /// Takes over what has changed, again and again.
    async fn watch(self, stop: CancellationToken) {
        while stop.run_until_cancelled(tokio::time::sleep(RELOAD_INTERVAL)).await.is_some() {
            let certificates = self.clone();
            // Files are read on a thread that may wait.
            let _ = tokio::task::spawn_blocking(move || certificates.reload()).await;
        }
    }
}

impl RunningServer {
    /// Address of the gRPC port.
    #[must_use]
    pub const fn grpc_addr(&self) -> SocketAddr {
        self.grpc_addr
    }

    /// Address of the HTTP port.
    #[must_use]
    pub const fn http_addr(&self) -> SocketAddr {
        self.http_addr
    }

    /// Address of the MTConnect agent, where there is one.
    #[must_use]
    pub const fn mtconnect_addr(&self) -> Option<SocketAddr> {
        self.mtconnect_addr
    }

    /// The figures that `/metrics` shows.
    #[must_use]
    pub fn metrics(&self) -> &Metrics {
        &self.metrics
    }

    /// Takes over certificates and known clients whose files have changed, as the service does by itself every few seconds.
    pub fn reload(&self) {
        self.certificates.reload();
    }

    /// Waits until one of the ports fails, which it does only by a fault of the system; the text says why.
    pub async fn failed(&mut self) -> String {
        tokio::select! {
            ended = &mut self.grpc => format!("the gRPC port ended: {ended:?}"),
            ended = &mut self.http => format!("the HTTP port ended: {ended:?}"),
            ended = ended(self.mtconnect.as_mut()) => format!("the MTConnect port ended: {ended:?}"),
        }
    }

    /// Ends the server: new calls are refused, open streams end at once with the reason, other calls have the
    /// configured time to finish. The HTTP port says so until the end.
    pub async fn shutdown(mut self) {
        for service in services::names() {
            self.health.set_service_status(service, ServingStatus::NotServing).await;
        }
        self.engine.draining().cancel();
        let drain = self.config.limits.drain();
        let finished = async {
            if !self.grpc.is_finished() {
                let _ = (&mut self.grpc).await;
            }
            self.engine.stopped().await;
        };
        if tokio::time::timeout(drain, finished).await.is_err() {
            tracing::warn!(seconds = drain.as_secs(), "calls or connections did not finish in time and were cut off");
            self.grpc.abort();
        }
        self.http_stop.cancel();
        if let Some(mut mtconnect) = self.mtconnect.take()
            && tokio::time::timeout(drain, &mut mtconnect).await.is_err()
        {
            mtconnect.abort();
        }
        if !self.http.is_finished() && tokio::time::timeout(drain, &mut self.http).await.is_err() {
            self.http.abort();
        }
        // A disk that does not answer must not keep the process.
        if tokio::time::timeout(drain.max(LEAST_CLOSING), self.store.close()).await.is_err() {
            tracing::error!("the store could not be closed: the disk does not answer");
        }
    }
}

/// The end of a port; of one that is not there, never.
async fn ended(port: Option<&mut JoinHandle<()>>) -> Result<(), JoinError> {
    match port {
        Some(port) => port.await,
        None => std::future::pending().await,
    }
}

async fn open_store(config: &Config, metrics: Arc<Metrics>) -> Result<Store, StartError> {
    for deprecation in config.deprecations() {
        tracing::warn!("{deprecation}");
    }
    let uri = config.store_uri().map_err(|(key, reason)| StartError::Setup(format!("{key}: {reason}")))?;
    let settings = StoreSettings {
        max_program_bytes: config.limits.upload_bytes.max(config.limits.inline_program_bytes),
        max_uploads: config.limits.unfinished_uploads,
        max_client_uploads: config.limits.unfinished_uploads_per_client,
        upload_expiry: Duration::from_secs(config.limits.upload_expiry_s),
        max_audit_entries: config.retention.audit_entries,
        replica_name: config.store.replica_name.clone(),
        observer: metrics,
        ..StoreSettings::default()
    };
    Store::open(&uri, settings).await.map_err(|source| StartError::Store { uri: uri.to_string(), source })
}

async fn listen(key: &'static str, address: SocketAddr) -> Result<(TcpListener, SocketAddr), StartError> {
    let failed = |source| StartError::Listen { key, address, source };
    let listener = TcpListener::bind(address).await.map_err(failed)?;
    let bound = listener.local_addr().map_err(failed)?;
    Ok((listener, bound))
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

/// Longest request id that is taken over from a client, bytes: it comes back in the headers of the answer.
const MAX_REQUEST_ID_BYTES: usize = 128;

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
