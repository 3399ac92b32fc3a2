//! Removes what is kept no longer, now and every hour: unfinished uploads, and what the configuration says. What was removed in any way
//! is given back to the file system.

use std::sync::Arc;
use std::time::Duration;

use feedwave_store::{Removed, Result, RetentionPolicy, Store};
use tokio_util::sync::CancellationToken;

use crate::config::RetentionConfig;
use crate::floor::Floors;
use crate::observability::metrics::Metrics;

/// Time between two rounds.
const PERIOD: Duration = Duration::from_secs(3_600);

impl RetentionConfig {
    /// As the store understands it.
    #[must_use]
    pub fn policy(&self) -> RetentionPolicy {
        let days = |days: Option<u32>| days.map(|days| Duration::from_secs(u64::from(days) * 86_400));
        RetentionPolicy {
            jobs: days(self.jobs_days),
            runs: days(self.runs_days),
            programs: days(self.programs_days),
            events: days(self.events_days),
            audit: days(self.audit_days),
            bytes: self.max_bytes,
        }
    }
}

/// Goes round until `draining`, as often as uploads expire where that is sooner.
pub(crate) async fn follow(
    store: Store,
    metrics: Arc<Metrics>,
    config: RetentionConfig,
    upload_expiry: Duration,
    floors: Floors,
    draining: CancellationToken,
) {
    let policy = config.policy();
    let period = PERIOD.min(upload_expiry);
    loop {
        tokio::select! {
            result = round(&store, &metrics, &policy, config.dry_run, &floors) => {
                if let Err(error) = result {
                    tracing::warn!(%error, "what is kept no longer could not be removed");
                }
            }
            () = draining.cancelled() => return,
        }
        tokio::select! {
            () = tokio::time::sleep(period) => {}
            () = draining.cancelled() => return,
        }
    }
}

async fn round(
    store: &Store,
    metrics: &Metrics,
    policy: &RetentionPolicy,
    dry_run: bool,
    floors: &Floors,
) -> Result<()> {
    store.expire_uploads().await?;
    if *policy == RetentionPolicy::default() {
        // Nothing is too old, but clients delete as well.
        store.remove_expired(policy).await?;
        return Ok(());
    }
    let expired = store.expired(policy).await?;
    for (kind, count) in by_kind(expired) {
        metrics.retention_expired.with_label_values(&[kind]).set(i64::try_from(count).unwrap_or(i64::MAX));
    }
    let Removed { jobs, runs, programs, events, audit } = expired;
    if dry_run {
        tracing::info!(jobs, runs, programs, events, audit, "retention, dry run: this would be removed");
        if policy.bytes.is_some() {
            tracing::info!("retention, dry run: what max_bytes would remove besides is not foreseen");
        }
        return Ok(());
    }
    let removed = store.remove_expired(policy).await?;
    for (kind, count) in by_kind(removed) {
        metrics.retention_removed.with_label_values(&[kind]).inc_by(count);
        metrics.retention_expired.with_label_values(&[kind]).set(0);
    }
    if removed != Removed::default() {
        let Removed { jobs, runs, programs, events, audit } = removed;
        tracing::info!(jobs, runs, programs, events, audit, "retention: removed");
    }
    // Jobs are removed with an event each, runs with none, and perhaps by another replica.
    if policy.runs.is_some() {
        floors.forget_removed(store).await?;
    }
    Ok(())
}

fn by_kind(removed: Removed) -> [(&'static str, u64); 5] {
    let Removed { jobs, runs, programs, events, audit } = removed;
    [("jobs", jobs), ("runs", runs), ("programs", programs), ("events", events), ("audit", audit)]
}

#[cfg(test)]
mod tests {
    use bytes::Bytes;
    use feedwave_store::{StoreSettings, Tenant};

    use super::*;

    #[tokio::test]
    async fn what_clients_delete_is_given_back_without_any_policy() {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("feedwave.db");
        let open = || async {
            let uri = format!("sqlite://{}", path.display());
            Store::open(&uri.parse().unwrap(), StoreSettings::default()).await.unwrap()
        };
        let size = || std::fs::metadata(&path).unwrap().len();
        // Bytes that do not compress.
        let mut state = 1_u32;
        let noise = std::iter::repeat_with(|| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        });
        let store = open().await;
        let program = store.put_program(Tenant::DEFAULT, noise.take(1 << 20).collect::<Bytes>()).await.unwrap();
        store.close().await;
        let full = size();
        let store = open().await;
        store.delete_program(program.id).await.unwrap();
        round(&store, &Metrics::new(), &RetentionPolicy::default(), false, &Floors::default()).await.unwrap();
        store.close().await;
        assert!(size() + (1 << 19) < full, "{} of {full}", size());
    }
}
