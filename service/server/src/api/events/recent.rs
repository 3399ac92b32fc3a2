//! The newest events of jobs, read from the store once for all who watch.

use std::collections::VecDeque;

use feedwave_store::{EventFilter, JobEvent, MAX_EVENTS, Store};
use tokio::sync::Mutex;

use crate::error::Result;

/// Events kept; a watcher that is further behind reads the store itself.
const KEPT: usize = 4_096;

/// The newest events.
#[derive(Debug)]
pub(crate) struct RecentEvents {
    kept: Mutex<Kept>,
}

#[derive(Debug)]
struct Kept {
    /// Every event behind this sequence number up to `to` is here.
    from: i64,
    to: i64,
    events: VecDeque<JobEvent>,
}

/// Events behind a cursor.
pub(super) struct Found {
    /// Those that were wanted.
    pub(super) events: Vec<JobEvent>,
    /// Sequence number up to which there is no other.
    pub(super) to: i64,
}

impl RecentEvents {
    /// Events from the newest of the store on.
    pub(crate) fn new(store: &Store) -> Self {
        let newest = store.latest_sequence();
        Self { kept: Mutex::new(Kept { from: newest, to: newest, events: VecDeque::new() }) }
    }

    /// At most `limit` events behind `after`; `None` where they are not kept any more. `newest` is the
    /// newest one that is durable.
    pub(super) async fn after(
        &self,
        store: &Store,
        after: i64,
        newest: i64,
        filter: &EventFilter,
        limit: usize,
    ) -> Result<Option<Found>> {
        let mut kept = self.kept.lock().await;
        while kept.to < newest {
            let events = store.events_after(kept.to, &EventFilter::default(), MAX_EVENTS).await?;
            // Sequence numbers have gaps where a write was taken back.
            kept.to = events.last().map_or(newest, |last| last.sequence);
            kept.events.extend(events);
            let surplus = kept.events.len().saturating_sub(KEPT);
            for _ in 0..surplus {
                if let Some(passed) = kept.events.pop_front() {
                    kept.from = passed.sequence;
                }
            }
        }
        if after < kept.from {
            return Ok(None);
        }
        let first = kept.events.partition_point(|event| event.sequence <= after);
        let is_wanted = |event: &&JobEvent| {
            filter.job_id.is_none_or(|job| event.job_id == job)
                && filter.tenant.is_none_or(|tenant| event.tenant == tenant)
        };
        let wanted = kept.events.range(first..).filter(is_wanted);
        let events: Vec<JobEvent> = wanted.take(limit).cloned().collect();
        let to = if events.len() < limit { kept.to } else { events.last().map_or(kept.to, |last| last.sequence) };
        Ok(Some(Found { events, to }))
    }
}
