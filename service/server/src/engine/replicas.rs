//! What other replicas do to jobs that this one works on.

use std::time::Duration;

use feedwave_store::{EventFilter, JobState, MAX_EVENTS};

use super::Engine;

/// How long to wait before asking a store again that did not answer.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// Ends the work on jobs that were cancelled or deleted, wherever that was asked for, until the service ends. Where one
/// process has the database, nothing is to be done.
pub(super) async fn follow(engine: Engine) {
    let inner = &engine.inner;
    if inner.store.lease().is_none() {
        return;
    }
    let mut newest = inner.store.watch_events();
    let mut seen = *newest.borrow_and_update();
    loop {
        tokio::select! {
            () = inner.draining.cancelled() => return,
            changed = newest.changed() => if changed.is_err() { return },
        }
        while seen < *newest.borrow_and_update() {
            let events = match inner.store.events_after(seen, &EventFilter::default(), MAX_EVENTS).await {
                Ok(events) => events,
                Err(error) => {
                    tracing::warn!(%error, "events of jobs cannot be read");
                    tokio::select! {
                        () = inner.draining.cancelled() => return,
                        () = tokio::time::sleep(RETRY_AFTER) => continue,
                    }
                }
            };
            // Events may have been removed as too old.
            let Some(last) = events.last() else { break };
            seen = last.sequence;
            for event in events {
                if matches!(event.to_state, None | Some(JobState::Cancelled)) {
                    engine.cancel_job(event.job_id);
                }
            }
        }
    }
}
