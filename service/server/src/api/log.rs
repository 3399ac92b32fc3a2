//! Logs of the store as they are followed: state changes of jobs, and decisions. The newest records are read once for all
//! who watch.

use std::collections::VecDeque;
use std::sync::{Arc, OnceLock};

use feedwave_contract::json;
use feedwave_contract::json::Name;
use feedwave_store::{Store, Tenant};
use futures_util::{Stream, stream};
use prometheus::IntCounter;
use tokio::sync::{Mutex, watch};
use uuid::Uuid;

use crate::error::Result;

/// Records read together for a watcher, and for all of them.
const PAGE: u32 = 500;
/// Records kept; a watcher that is further behind reads the store itself.
const KEPT: usize = 4_096;

/// A record of a log.
#[derive(Debug)]
pub(crate) struct Entry<M> {
    /// Its place in the log.
    pub(crate) sequence: i64,
    /// Whose it is, and what it is of: a filter by these wants it.
    of: LogFilter,
    /// What the contract says of it.
    pub(crate) message: M,
    json: OnceLock<String>,
}

impl<M: Name> Entry<M> {
    pub(super) fn new(sequence: i64, of: LogFilter, message: M) -> Arc<Self> {
        Arc::new(Self { sequence, of, message, json: OnceLock::new() })
    }

    /// The message as JSON, written once for all who watch.
    pub(crate) fn json(&self) -> &str {
        self.json.get_or_init(|| json::to_string(&self.message))
    }
}

/// Which records are wanted; the default wants all.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LogFilter {
    /// Only this tenant's.
    pub(super) tenant: Option<Tenant>,
    /// Only those of this job.
    pub(super) job: Option<Uuid>,
    /// Only those of this run.
    pub(super) run: Option<Uuid>,
}

impl LogFilter {
    /// All that a tenant has.
    pub(crate) fn of_tenant(tenant: Tenant) -> Self {
        Self { tenant: Some(tenant), ..Self::default() }
    }

    fn wants<M>(&self, entry: &Entry<M>) -> bool {
        let Self { tenant, job, run } = *self;
        let of = &entry.of;
        let is_theirs = tenant.is_none() || of.tenant == tenant;
        is_theirs && (job.is_none() || of.job == job) && (run.is_none() || of.run == run)
    }
}

/// A log of the store.
pub(crate) trait Log: Send + Sync + 'static {
    /// What the contract says of a record.
    type Message: Name + Clone + Send + Sync;

    /// What it is a log of, for people.
    const RECORDS: &'static str;

    /// The place of the newest record.
    fn newest(store: &Store) -> watch::Receiver<i64>;

    /// Records behind a place, at most `limit`.
    fn read(
        store: &Store,
        after: i64,
        filter: LogFilter,
        limit: u32,
    ) -> impl Future<Output = Result<Vec<Stored<Self::Message>>>> + Send;
}

/// A record as it was read.
pub(crate) struct Stored<M> {
    /// Its place in the log.
    pub(super) sequence: i64,
    /// What it says; an error where that is damaged.
    pub(super) entry: Result<Arc<Entry<M>>>,
}

/// The newest records of a log.
#[derive(Debug)]
pub(crate) struct Recent<L: Log> {
    kept: Mutex<Kept<L::Message>>,
    /// Counts records that were passed over.
    unreadable: IntCounter,
}

#[derive(Debug)]
struct Kept<M> {
    /// Every record behind this place up to `to` is here.
    from: i64,
    to: i64,
    entries: VecDeque<Arc<Entry<M>>>,
}

/// Records behind a cursor.
struct Found<M> {
    /// Those that were wanted.
    entries: Vec<Arc<Entry<M>>>,
    /// Place up to which there is no other.
    to: i64,
}

impl<L: Log> Recent<L> {
    /// Records from the newest of the store on; `unreadable` counts those that cannot be read.
    pub(crate) fn new(store: &Store, unreadable: IntCounter) -> Self {
        let newest = *L::newest(store).borrow();
        Self { kept: Mutex::new(Kept { from: newest, to: newest, entries: VecDeque::new() }), unreadable }
    }

    /// What can be read. A damaged record is said and passed over: it must not keep those who watch from the ones behind it.
    fn readable(&self, read: Vec<Stored<L::Message>>) -> impl Iterator<Item = Arc<Entry<L::Message>>> {
        read.into_iter().filter_map(|Stored { sequence, entry }| match entry {
            Ok(entry) => Some(entry),
            Err(error) => {
                tracing::error!(sequence, %error, "one of the {} cannot be read, and is passed over", L::RECORDS);
                self.unreadable.inc();
                None
            }
        })
    }

    /// At most a page of records behind `after`; `None` where they are not kept. `newest` is the newest one that is
    /// durable.
    async fn after(
        &self,
        store: &Store,
        after: i64,
        newest: i64,
        filter: LogFilter,
    ) -> Result<Option<Found<L::Message>>> {
        let mut kept = self.kept.lock().await;
        // What nobody has watched need not be read now.
        let oldest = newest.saturating_sub(i64::try_from(KEPT).unwrap_or(i64::MAX));
        if kept.to < oldest {
            *kept = Kept { from: oldest, to: oldest, entries: VecDeque::new() };
        }
        while kept.to < newest {
            let read = L::read(store, kept.to, LogFilter::default(), PAGE).await?;
            // Places have gaps where a write was taken back.
            kept.to = read.last().map_or(newest, |last| last.sequence);
            kept.entries.extend(self.readable(read));
            let surplus = kept.entries.len().saturating_sub(KEPT);
            for _ in 0..surplus {
                if let Some(passed) = kept.entries.pop_front() {
                    kept.from = passed.sequence;
                }
            }
        }
        if after < kept.from {
            return Ok(None);
        }
        let first = kept.entries.partition_point(|entry| entry.sequence <= after);
        let wanted = kept.entries.range(first..).filter(|entry| filter.wants(entry));
        let entries: Vec<_> = wanted.take(PAGE as usize).cloned().collect();
        let is_all = entries.len() < PAGE as usize;
        let to = if is_all { kept.to } else { entries.last().map_or(kept.to, |last| last.sequence) };
        Ok(Some(Found { entries, to }))
    }
}

/// Reads the records of a log as they come. A wait that is given up has passed nothing over.
pub(crate) struct LogWatch<L: Log> {
    store: Store,
    recent: Arc<Recent<L>>,
    newest: watch::Receiver<i64>,
    after: i64,
    filter: LogFilter,
    read: VecDeque<Arc<Entry<L::Message>>>,
}

impl<L: Log> LogWatch<L> {
    /// Follows a log behind a place; where none is named, behind the newest record.
    pub(crate) fn new(store: &Store, recent: &Arc<Recent<L>>, after: Option<i64>, filter: LogFilter) -> Self {
        let newest = L::newest(store);
        let after = after.unwrap_or_else(|| *newest.borrow());
        Self { store: store.clone(), recent: recent.clone(), newest, after, filter, read: VecDeque::new() }
    }

    /// The next record; `None` when the store was closed.
    pub(crate) async fn next(&mut self) -> Result<Option<Arc<Entry<L::Message>>>> {
        loop {
            if let Some(entry) = self.pop() {
                return Ok(Some(entry));
            }
            if !self.is_ready().await {
                return Ok(None);
            }
            self.fill().await?;
        }
    }

    /// Waits until the log has records that were not handed on; `false` when the store was closed.
    pub(crate) async fn is_ready(&mut self) -> bool {
        let after = self.after;
        !self.read.is_empty() || self.newest.wait_for(|newest| *newest > after).await.is_ok()
    }

    /// Reads a page of what there is by now, unless there is some left to hand on.
    pub(crate) async fn fill(&mut self) -> Result<()> {
        let newest = *self.newest.borrow_and_update();
        if !self.read.is_empty() || newest <= self.after {
            return Ok(());
        }
        if let Some(found) = self.recent.after(&self.store, self.after, newest, self.filter).await? {
            self.after = found.to.max(self.after);
            self.read.extend(found.entries);
            return Ok(());
        }
        let read = L::read(&self.store, self.after, self.filter, PAGE).await?;
        // Records of others are passed over; a full page may not reach the newest one.
        let last = read.last().map_or(newest, |last| last.sequence);
        self.after = if read.len() < PAGE as usize { last.max(newest) } else { last };
        self.read.extend(self.recent.readable(read));
        Ok(())
    }

    /// The next record of those that were read.
    pub(crate) fn pop(&mut self) -> Option<Arc<Entry<L::Message>>> {
        self.read.pop_front()
    }

    /// The messages of the records, without end.
    pub(super) fn messages(self) -> impl Stream<Item = Result<L::Message>> + Send {
        stream::try_unfold(self, async |mut watch| Ok(watch.next().await?.map(|entry| (entry.message.clone(), watch))))
    }
}
