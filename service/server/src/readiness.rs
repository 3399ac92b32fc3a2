//! Whether the service can do its work: it is asked of the store by writing, again and again, and told to gRPC health,
//! `/readyz` and the metrics.

use std::sync::Arc;
use std::time::Duration;

use feedwave_store::{Store, StoreError};
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;

use crate::error::{Error, Result};
use crate::observability::metrics::Metrics;
use crate::services;

/// Time between two probes while nothing fails.
const PERIOD: Duration = Duration::from_secs(2);
/// Least time between two probes, however many writes fail.
const LEAST_PERIOD: Duration = Duration::from_millis(100);
/// How long a probe may take. A disk that is slower is as good as none: callers would wait as long.
const PATIENCE: Duration = Duration::from_secs(5);

/// What the last probe found.
#[derive(Clone, Debug)]
pub struct Readiness {
    fault: watch::Receiver<Option<Arc<StoreError>>>,
}

impl Readiness {
    /// Succeeds while the service can do its work.
    ///
    /// # Errors
    /// [`Error::StoreUnavailable`] with the reason.
    pub fn check(&self) -> Result<()> {
        match &*self.fault.borrow() {
            Some(error) => Err(Error::StoreUnavailable(error.clone())),
            None => Ok(()),
        }
    }
}

/// Begins to probe, until `draining`.
pub(crate) fn follow(
    store: Store,
    health: HealthReporter,
    metrics: Arc<Metrics>,
    draining: CancellationToken,
) -> (Readiness, impl Future<Output = ()> + Send + 'static) {
    let (sender, fault) = watch::channel(None);
    metrics.store_writable.set(1);
    let probes = async move {
        let mut faults = store.watch_faults();
        loop {
            let probe = tokio::select! {
                probe = store.probe(PATIENCE) => probe,
                () = draining.cancelled() => return,
            };
            let found = probe.err().map(Arc::new);
            let changed = sender.borrow().is_some() != found.is_some();
            if changed && !draining.is_cancelled() {
                let status = match &found {
                    Some(error) => {
                        tracing::error!(%error, "the store cannot be written: not ready");
                        ServingStatus::NotServing
                    }
                    None => {
                        tracing::info!("the store can be written again: ready");
                        ServingStatus::Serving
                    }
                };
                metrics.store_writable.set(i64::from(found.is_none()));
                for service in services::names() {
                    health.set_service_status(service, status).await;
                }
            }
            sender.send_replace(found);
            tokio::select! {
                () = tokio::time::sleep(PERIOD) => {}
                () = async {
                    tokio::time::sleep(LEAST_PERIOD).await;
                    if faults.changed().await.is_err() {
                        std::future::pending::<()>().await;
                    }
                } => {}
                () = draining.cancelled() => return,
            }
        }
    };
    (Readiness { fault }, probes)
}
