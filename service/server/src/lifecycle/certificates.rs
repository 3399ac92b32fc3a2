//! Certificates of the ports and the clients that are known.

use std::sync::Arc;
use std::time::Duration;

use feedwave_store::Store;
use tokio_util::sync::CancellationToken;

use super::StartError;
use crate::access::Access;
use crate::config::Config;
use crate::connections::{Tls, TlsError};
use crate::observability::metrics::Metrics;

/// How often certificate files are looked at for changes.
const RELOAD_INTERVAL: Duration = Duration::from_secs(10);

/// Certificates of the ports and the clients that are known, taken over anew when their files change.
#[derive(Clone, Debug)]
pub(super) struct Certificates {
    pub(super) grpc: Option<Arc<Tls>>,
    pub(super) http: Option<Arc<Tls>>,
    pub(super) access: Access,
    metrics: Arc<Metrics>,
}

impl Certificates {
    pub(super) fn load(config: &Config, metrics: Arc<Metrics>) -> Result<Self, StartError> {
        let failed = |error: TlsError| StartError::Tls { key: error.key, reason: error.reason };
        let load = |(section, files)| Tls::load(section, files).map_err(failed);
        let http = config.http_tls().map(load).transpose()?;
        // One section is one set of files.
        let grpc = if config.grpc.tls.is_some() { config.grpc_tls().map(load).transpose()? } else { http.clone() };
        let access = Access::load(&config.auth).map_err(|(key, reason)| StartError::Tls { key, reason })?;
        Ok(Self { grpc, http, access, metrics })
    }

    /// Takes over what has changed.
    pub(super) fn reload(&self) {
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
    pub(super) async fn watch(self, store: Store, stop: CancellationToken) {
        while stop.run_until_cancelled(tokio::time::sleep(RELOAD_INTERVAL)).await.is_some() {
            let certificates = self.clone();
            // Files are read on a thread that may wait.
            let _ = tokio::task::spawn_blocking(move || certificates.reload()).await;
            // Another replica may know clients of tenants.
            if let Err(error) = self.access.look_for_tenants(&store).await {
                tracing::debug!(%error, "whether there are tenants is not known");
            }
        }
    }
}
