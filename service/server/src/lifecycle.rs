//! A server from its first port to its last call: start, run, drain.

mod certificates;
mod failures;
mod onlookers;
mod ports;

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use feedwave_store::{Store, StoreError, StoreSettings};
use tokio::task::{JoinError, JoinHandle};
use tokio_util::sync::CancellationToken;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;

use self::certificates::Certificates;
use self::onlookers::Onlookers;
use self::ports::{Apps, Asked, Listeners, Ports};
use crate::api::Api;
use crate::audit::AuditLog;
use crate::config::Config;
use crate::engine::Engine;
use crate::error::Error;
use crate::events::EventReader;
use crate::mqtt::{self, Publisher};
use crate::observability::metrics::Metrics;
use crate::{floor, readiness, retention, services};

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
    /// A certificate, a key, a password or the file of known clients cannot be used.
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
    config: Config,
    engine: Engine,
    metrics: Arc<Metrics>,
    store: Store,
    health: HealthReporter,
    certificates: Certificates,
    ports: Ports,
    mqtt: Option<JoinHandle<()>>,
    onlookers: Onlookers,
}

impl Server {
    /// Opens the store and both ports, resumes unfinished work, and serves. Call inside a runtime.
    ///
    /// # Errors
    /// [`StartError`] with the configuration key that is at fault.
    pub async fn start(config: Config) -> Result<RunningServer, StartError> {
        let metrics = Arc::new(Metrics::new());
        let store = open_store(&config, metrics.clone()).await?;
        let onlookers = Onlookers::start().map_err(|error| StartError::Setup(error.to_string()))?;
        let listeners = Listeners::open(&config).await?;
        let draining = CancellationToken::new();
        let engine = Engine::new(store.clone(), metrics.clone(), config.limits.clone(), draining.clone());
        let api = Api::new(store.clone(), engine.clone(), metrics.clone(), config.limits.clone());
        let setup = |error: Error| StartError::Setup(error.to_string());
        api.seed_machines().await.map_err(setup)?;
        // What happens while the log is read is told afterwards.
        let events = EventReader::new(store.clone(), draining.clone());
        api.restore_floors().await.map_err(setup)?;
        engine.spawn(floor::follow(api.floors.clone(), store.clone(), events));
        engine.spawn(floor::share(api.floors.clone(), store.clone(), draining.clone()));

        let health = HealthReporter::new();
        for service in services::names() {
            health.set_service_status(service, ServingStatus::Serving).await;
        }
        health.set_service_status(services::LIVENESS, ServingStatus::Serving).await;
        let cut_off = engine.cut_off().clone();
        let (readiness, probes) =
            readiness::follow(store.clone(), health.clone(), metrics.clone(), cut_off, draining.clone());
        engine.spawn(probes);
        let (rules, expiry) = (config.retention.clone(), Duration::from_secs(config.limits.upload_expiry_s));
        let floors = api.floors.clone();
        engine.spawn(retention::follow(store.clone(), metrics.clone(), rules, expiry, floors, draining.clone()));
        let certificates = Certificates::load(&config, metrics.clone())?;
        let tenants = certificates.access.look_for_tenants(&store).await;
        tenants.map_err(|error| StartError::Setup(error.to_string()))?;
        let mqtt = Publisher::new(&config.mqtt, &api)
            .map_err(|error| StartError::Tls { key: error.key, reason: error.reason })?;
        let audit = AuditLog::new(store.clone(), engine.clone());
        engine.spawn(audit.clone().follow(draining.clone()));
        let asked = Asked { api: &api, access: &certificates.access, audit: &audit, readiness, health: &health };
        let apps = Apps::new(asked, &config).await?;

        engine.start();
        let ports = listeners.serve(apps, &config, &certificates, &metrics, &onlookers, draining);
        let (access, stop) = (certificates.access.clone(), onlookers.stop().clone());
        tokio::spawn(async move { stop.run_until_cancelled(access.follow_keys()).await });
        tokio::spawn(certificates.clone().watch(store.clone(), onlookers.stop().clone()));
        let mqtt = mqtt.map(|publisher| onlookers.spawn(publisher.run(onlookers.stop().clone())));
        Ok(RunningServer { config, engine, metrics, store, health, certificates, ports, onlookers, mqtt })
    }
}

impl RunningServer {
    /// Address of the gRPC port.
    #[must_use]
    pub const fn grpc_addr(&self) -> SocketAddr {
        self.ports.grpc_addr
    }

    /// Address of the HTTP port.
    #[must_use]
    pub const fn http_addr(&self) -> SocketAddr {
        self.ports.http_addr
    }

    /// Address of the MTConnect agent, where there is one.
    #[must_use]
    pub const fn mtconnect_addr(&self) -> Option<SocketAddr> {
        self.ports.mtconnect_addr
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
            ended = &mut self.ports.grpc => format!("the gRPC port ended: {ended:?}"),
            ended = &mut self.ports.http => format!("the HTTP port ended: {ended:?}"),
            ended = ended(self.ports.mtconnect.as_mut()) => format!("the MTConnect port ended: {ended:?}"),
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
            if !self.ports.grpc.is_finished() {
                let _ = (&mut self.ports.grpc).await;
            }
            self.engine.stopped().await;
        };
        if tokio::time::timeout(drain, finished).await.is_err() {
            tracing::warn!(seconds = drain.as_secs(), "calls or connections did not finish in time and were cut off");
            self.ports.grpc.abort();
        }
        self.onlookers.stop().cancel();
        if let Some(mut mtconnect) = self.ports.mtconnect.take()
            && tokio::time::timeout(drain, &mut mtconnect).await.is_err()
        {
            mtconnect.abort();
        }
        if let Some(mut mqtt) = self.mqtt.take()
            && tokio::time::timeout(mqtt::GOODBYE * 2, &mut mqtt).await.is_err()
        {
            tracing::warn!("the MQTT broker does not answer: it will say itself that the service is gone");
            mqtt.abort();
        }
        if !self.ports.http.is_finished() && tokio::time::timeout(drain, &mut self.ports.http).await.is_err() {
            self.ports.http.abort();
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
        objects: config.store.objects.settings(),
        max_uploads: config.limits.unfinished_uploads,
        max_client_uploads: config.limits.unfinished_uploads_per_client,
        max_uploads_bytes: config.limits.max_unfinished_upload_bytes(),
        max_client_uploads_bytes: config.limits.max_unfinished_upload_bytes_per_client(),
        upload_expiry: Duration::from_secs(config.limits.upload_expiry_s),
        max_audit_entries: config.retention.audit_entries,
        replica_name: config.store.replica_name.clone(),
        observer: metrics,
        ..StoreSettings::default()
    };
    Store::open(&uri, settings).await.map_err(|source| StartError::Store { uri: uri.to_string(), source })
}
