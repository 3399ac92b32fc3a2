//! Whether the service can do its work: it is asked of the store by writing and reading, again and again, and told to gRPC
//! health, `/readyz` and the metrics. Who asks any of these gets what was found last: asking often makes no work.

use std::sync::Arc;
use std::time::Duration;

use feedwave_store::{Store, StoreError};
use tokio::sync::watch;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;

use crate::cut_off::CutOff;
use crate::error::{Error, Result};
use crate::observability::metrics::Metrics;
use crate::services;

/// Time between two probes while nothing fails.
const PERIOD: Duration = Duration::from_secs(2);
/// Least time between two probes, however many writes fail.
const LEAST_PERIOD: Duration = Duration::from_millis(100);
/// How long a probe may take. A disk that is slower is as good as none: callers would wait as long.
const PATIENCE: Duration = Duration::from_secs(5);
/// What was found longer ago says nothing: writing, reading and the time between two probes, and as much again for a
/// computer that has too much to do.
const MAX_AGE: Duration = PATIENCE.saturating_mul(2).saturating_add(PERIOD).saturating_mul(2);

/// What a probe found.
#[derive(Debug)]
struct Found {
    fault: Option<Arc<StoreError>>,
    at: Instant,
}

/// What the last probe found.
#[derive(Clone, Debug)]
pub struct Readiness {
    last: watch::Receiver<Found>,
}

impl Readiness {
    /// Succeeds while the service can do its work, as far as was seen lately.
    ///
    /// # Errors
    /// [`Error::StoreUnavailable`] with the reason.
    pub fn check(&self) -> Result<()> {
        let last = self.last.borrow();
        let old = || StoreError::Unavailable { reason: "it was not probed lately", source: None };
        match &last.fault {
            Some(error) => Err(Error::StoreUnavailable(error.clone())),
            None if last.at.elapsed() > MAX_AGE => Err(Error::StoreUnavailable(Arc::new(old()))),
            None => Ok(()),
        }
    }
}

/// Writes to the store and reads from it.
async fn probe(store: &Store) -> feedwave_store::Result<()> {
    store.probe(PATIENCE).await?;
    let late = StoreError::Unavailable { reason: "it does not answer reads in time", source: None };
    tokio::time::timeout(PATIENCE, store.ping()).await.unwrap_or(Err(late))
}

/// Begins to probe, until `draining`.
pub(crate) fn follow(
    store: Store,
    health: HealthReporter,
    metrics: Arc<Metrics>,
    cut_off: CutOff,
    draining: CancellationToken,
) -> (Readiness, impl Future<Output = ()> + Send + 'static) {
    let (sender, last) = watch::channel(Found { fault: None, at: Instant::now() });
    metrics.store_writable.set(1);
    let probes = async move {
        let mut faults = store.watch_faults();
        loop {
            let probe = tokio::select! {
                probe = probe(&store) => probe,
                () = draining.cancelled() => return,
            };
            let found = probe.err().map(Arc::new);
            let changed = sender.borrow().fault.is_some() != found.is_some();
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
                if store.lease().is_some() {
                    cut_off.set(found.is_some());
                }
                for service in services::names() {
                    health.set_service_status(service, status).await;
                }
            }
            sender.send_replace(Found { fault: found, at: Instant::now() });
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
    (Readiness { last }, probes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A readiness of which the last probe found this.
    fn found(fault: Option<StoreError>) -> (watch::Sender<Found>, Readiness) {
        let (sender, last) = watch::channel(Found { fault: fault.map(Arc::new), at: Instant::now() });
        (sender, Readiness { last })
    }

    #[tokio::test(start_paused = true)]
    async fn what_was_found_long_ago_says_nothing() {
        let (sender, readiness) = found(None);
        tokio::time::advance(MAX_AGE).await;
        readiness.check().unwrap();
        tokio::time::advance(Duration::from_millis(1)).await;
        let refused = readiness.check().unwrap_err().to_string();
        assert!(refused.contains("was not probed lately"), "{refused}");
        sender.send_replace(Found { fault: None, at: Instant::now() });
        readiness.check().unwrap();
    }

    #[tokio::test(start_paused = true)]
    async fn a_fault_is_told_until_a_probe_succeeds() {
        let (sender, readiness) = found(Some(StoreError::Unavailable { reason: "the disk is full", source: None }));
        tokio::time::advance(MAX_AGE * 2).await;
        let refused = readiness.check().unwrap_err().to_string();
        assert!(refused.contains("the disk is full"), "{refused}");
        sender.send_replace(Found { fault: None, at: Instant::now() });
        readiness.check().unwrap();
    }
}
