//! The log of events, read on as it grows.

use std::time::Duration;

use feedwave_store::{EventFilter, JobEvent, MAX_EVENTS, Store};
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

/// How long to wait before asking a store again that did not answer.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// Reads every event behind a number, in order.
#[derive(Debug)]
pub(crate) struct EventReader {
    store: Store,
    newest: watch::Receiver<i64>,
    seen: i64,
    stop: CancellationToken,
}

impl EventReader {
    /// A reader of all that comes from now on, until `stop`.
    pub(crate) fn new(store: Store, stop: CancellationToken) -> Self {
        let mut newest = store.watch_events();
        let seen = *newest.borrow_and_update();
        Self { store, newest, seen, stop }
    }

    /// The next events, as soon as there are some; `None` when there will be no more.
    pub(crate) async fn next(&mut self) -> Option<Vec<JobEvent>> {
        loop {
            let newest = *self.newest.borrow_and_update();
            if self.seen >= newest {
                tokio::select! {
                    () = self.stop.cancelled() => return None,
                    changed = self.newest.changed() => changed.ok()?,
                }
                continue;
            }
            match self.store.events_after(self.seen, &EventFilter::default(), MAX_EVENTS).await {
                Ok(events) => {
                    // Events may have been removed as too old.
                    self.seen = events.last().map_or(newest, |last| last.sequence);
                    if !events.is_empty() {
                        return Some(events);
                    }
                }
                Err(error) => {
                    tracing::warn!(%error, "events of jobs cannot be read");
                    tokio::select! {
                        () = self.stop.cancelled() => return None,
                        () = tokio::time::sleep(RETRY_AFTER) => {}
                    }
                }
            }
        }
    }
}
