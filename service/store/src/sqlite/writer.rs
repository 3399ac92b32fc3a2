//! The one writer. Writes queue up while a transaction is being committed; the next transaction
//! takes all that wait, so that one flush to disk serves many callers. Each write has a savepoint of
//! its own: one that fails takes nothing with it.

use std::pin::Pin;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Connection, SqliteConnection};
use tokio::runtime::Handle;
use tokio::sync::{Notify, OwnedSemaphorePermit, Semaphore, mpsc, oneshot, watch};
use tokio::task::JoinHandle;

use super::checkpointer;
use super::lock::FileLock;
use super::open::Opened;
use super::probe::Probing;
use crate::error::{Result, StoreError};
use crate::settings::{Observer, StoreSettings, StoreStats};
use crate::sql::clock::{following, system_us};
use crate::sql::fault::REFUSED;

pub(super) type BoxFuture<'a, T> = Pin<Box<dyn Future<Output = T> + Send + 'a>>;

/// Payload is counted in pieces of this many bytes: a semaphore holds at most 2^29 permits on the
/// smallest platform, and small writes need no exact count.
const PAYLOAD_UNIT_BYTES: u64 = 1024;

/// What a write works with.
pub(super) struct Transaction {
    /// The connection, inside a transaction.
    pub(super) connection: SqliteConnection,
    latest_us: i64,
    newest: Newest,
}

/// Positions of the newest rows of the logs that are followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Newest {
    pub(super) event: i64,
    pub(super) decision: i64,
}

/// Follows the newest durable rows.
pub(super) struct Announced {
    pub(super) event: watch::Receiver<i64>,
    pub(super) decision: watch::Receiver<i64>,
}

/// Tells of the newest durable rows.
struct Announcer {
    event: watch::Sender<i64>,
    decision: watch::Sender<i64>,
}

impl Announcer {
    fn newest(&self) -> Newest {
        Newest { event: *self.event.borrow(), decision: *self.decision.borrow() }
    }

    fn announce(&self, newest: Newest) {
        let tell = |sender: &watch::Sender<i64>, newest: i64| {
            sender.send_if_modified(|announced| std::mem::replace(announced, newest) != newest);
        };
        tell(&self.event, newest.event);
        tell(&self.decision, newest.decision);
    }
}

impl Transaction {
    /// The time now in microseconds since the Unix epoch, later than at the call before, even when the clock is adjusted
    /// a little. Once it is set back it is followed: the order of records is that of their numbers, not of their times.
    pub(super) fn now_us(&mut self) -> i64 {
        self.latest_us = following(system_us(), self.latest_us);
        self.latest_us
    }

    /// Tells that an event was written, to be announced once it is durable.
    pub(super) fn event_written(&mut self, sequence: i64) {
        self.newest.event = self.newest.event.max(sequence);
    }

    /// As [`Transaction::event_written`], of a decision.
    pub(super) fn decision_written(&mut self, sequence: i64) {
        self.newest.decision = self.newest.decision.max(sequence);
    }
}

/// The caller's side of the writer.
pub(super) struct Writer {
    queue: Mutex<Option<mpsc::Sender<Box<dyn Operation>>>>,
    /// The one that writes, and the one that empties the log beside it.
    tasks: Mutex<Option<[JoinHandle<()>; 2]>>,
    payload: Arc<Semaphore>,
    payload_units: u32,
    counters: Arc<Counters>,
    probing: Arc<Probing>,
}

#[derive(Default)]
struct Counters {
    queued: AtomicU64,
    commits: AtomicU64,
    committed: AtomicU64,
    failed: AtomicU64,
}

impl Writer {
    /// Starts the task that writes, and opens further connections should the first one fail. The second value follows
    /// the newest durable rows.
    pub(super) fn start(opened: Opened, probing: Arc<Probing>, settings: &StoreSettings) -> (Self, Announced) {
        let Opened { writer: connection, options, newest, lock, .. } = opened;
        let (queue, receiver) = mpsc::channel(settings.write_queue.max(1));
        let (event_sender, event) = watch::channel(newest.event);
        let (decision_sender, decision) = watch::channel(newest.decision);
        let counters = Arc::new(Counters::default());
        let commits = Arc::new(Notify::new());
        let (alive, ended) = oneshot::channel();
        let checkpointer = tokio::spawn(checkpointer::run(options.clone(), commits.clone(), probing.clone(), ended));
        let task = Task {
            transaction: Some(Transaction { connection, latest_us: 0, newest }),
            options,
            latest_us: 0,
            announcer: Announcer { event: event_sender, decision: decision_sender },
            observer: settings.observer.clone(),
            counters: counters.clone(),
            commits,
            probing: probing.clone(),
            _alive: alive,
            _lock: lock,
        };
        let (runtime, max_operations) = (Handle::current(), settings.max_commit_operations.max(1));
        // A thread of its own: a commit is many short waits, none of which may queue up behind other tasks.
        let task = tokio::task::spawn_blocking(move || runtime.block_on(task.run(receiver, max_operations)));
        let units = settings.write_queue_bytes.div_ceil(PAYLOAD_UNIT_BYTES).clamp(1, 1 << 28);
        // In range by the line above.
        let payload_units = u32::try_from(units).unwrap_or(u32::MAX);
        let writer = Self {
            queue: Mutex::new(Some(queue)),
            tasks: Mutex::new(Some([task, checkpointer])),
            payload: Arc::new(Semaphore::new(payload_units as usize)),
            payload_units,
            counters,
            probing,
        };
        (writer, Announced { event, decision })
    }

    /// Does a write, unless it is known that none can be done.
    pub(super) async fn write<T, F>(&self, payload_bytes: usize, work: F) -> Result<T>
    where
        T: Send + 'static,
        F: for<'t> FnOnce(&'t mut Transaction) -> BoxFuture<'t, Result<T>> + Send + 'static,
    {
        let mut blocked = self.probing.blocked();
        let refused = async {
            // The sender lives as long as the writer.
            let reason = blocked.wait_for(Option::is_some).await.ok().and_then(|reason| *reason);
            StoreError::unavailable(reason.unwrap_or("it is closed"))
        };
        let result = tokio::select! {
            biased;
            error = refused => return Err(error),
            result = self.write_unblocked(payload_bytes, work) => result,
        };
        if let Err(StoreError::Unavailable { reason, source: Some(_) }) = &result
            && *reason != REFUSED
        {
            self.probing.fault();
        }
        result
    }

    /// As [`Writer::write`], whatever is known.
    pub(super) async fn write_unblocked<T, F>(&self, payload_bytes: usize, work: F) -> Result<T>
    where
        T: Send + 'static,
        F: for<'t> FnOnce(&'t mut Transaction) -> BoxFuture<'t, Result<T>> + Send + 'static,
    {
        let closed = || StoreError::unavailable("it is closed");
        // A write larger than the whole allowance waits until it is alone.
        let units = (payload_bytes as u64).div_ceil(PAYLOAD_UNIT_BYTES).min(u64::from(self.payload_units));
        let units = u32::try_from(units).unwrap_or(self.payload_units);
        let permit = self.payload.clone().acquire_many_owned(units).await.map_err(|_| closed())?;
        let queue = lock(&self.queue).clone().ok_or_else(closed)?;
        let place = queue.reserve().await.map_err(|_| closed())?;
        let (reply, answer) = oneshot::channel();
        self.counters.queued.fetch_add(1, Ordering::Relaxed);
        place.send(Box::new(Write {
            work: Some(work),
            result: None,
            reply,
            brings_bytes: payload_bytes > 0,
            _permit: permit,
        }));
        answer.await.map_err(|_| closed())?
    }

    /// Whether writes are still taken.
    pub(super) fn is_open(&self) -> bool {
        lock(&self.queue).as_ref().is_some_and(|queue| !queue.is_closed())
    }

    /// Commits what is queued, then ends.
    pub(super) async fn close(&self) {
        drop(lock(&self.queue).take());
        let tasks = lock(&self.tasks).take();
        for task in tasks.into_iter().flatten() {
            if let Err(error) = task.await {
                tracing::error!(%error, "the writer of the store ended abnormally");
            }
        }
    }

    pub(super) fn stats(&self) -> StoreStats {
        let Counters { queued, commits, committed, failed } = &*self.counters;
        StoreStats {
            write_queue_depth: queued.load(Ordering::Relaxed),
            commits: commits.load(Ordering::Relaxed),
            committed_operations: committed.load(Ordering::Relaxed),
            failed_operations: failed.load(Ordering::Relaxed),
            ..StoreStats::default()
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Only whole values are put in or taken out, so a panic elsewhere cannot leave them half-done.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A queued write, whatever its result.
trait Operation: Send {
    /// Does the write and keeps its result; true if it is to stay.
    fn run<'t>(&'t mut self, transaction: &'t mut Transaction) -> BoxFuture<'t, bool>;

    /// Whether it takes more space than next to nothing.
    fn brings_bytes(&self) -> bool;

    /// Answers the caller with the result, or with why the transaction failed.
    fn answer(self: Box<Self>, fault: Option<&StoreError>);
}

struct Write<T, F> {
    work: Option<F>,
    result: Option<Result<T>>,
    reply: oneshot::Sender<Result<T>>,
    brings_bytes: bool,
    _permit: OwnedSemaphorePermit,
}

impl<T, F> Operation for Write<T, F>
where
    T: Send,
    F: for<'t> FnOnce(&'t mut Transaction) -> BoxFuture<'t, Result<T>> + Send,
{
    fn run<'t>(&'t mut self, transaction: &'t mut Transaction) -> BoxFuture<'t, bool> {
        Box::pin(async {
            if let Some(work) = self.work.take() {
                self.result = Some(work(transaction).await);
            }
            matches!(self.result, Some(Ok(_)))
        })
    }

    fn brings_bytes(&self) -> bool {
        self.brings_bytes
    }

    fn answer(self: Box<Self>, fault: Option<&StoreError>) {
        let result = match (self.result, fault) {
            // What the write itself was refused for says more than that the transaction failed.
            (Some(Err(error)), _) => Err(error),
            (_, Some(fault)) => Err(fault.clone()),
            (Some(result), None) => result,
            (None, None) => Err(StoreError::unavailable("the write was not done")),
        };
        // A caller who no longer waits does not want the answer.
        let _ = self.reply.send(result);
    }
}

struct Task {
    /// `None` after a failed transaction: its connection is given up with whatever it holds.
    transaction: Option<Transaction>,
    options: SqliteConnectOptions,
    latest_us: i64,
    announcer: Announcer,
    observer: Arc<dyn Observer>,
    counters: Arc<Counters>,
    /// Told after every commit.
    commits: Arc<Notify>,
    probing: Arc<Probing>,
    /// Its end also ends the receivers of the commits.
    _alive: oneshot::Sender<()>,
    /// Held until the last write is done.
    _lock: FileLock,
}

impl Task {
    async fn run(mut self, mut queue: mpsc::Receiver<Box<dyn Operation>>, max_operations: usize) {
        let mut batch = Vec::new();
        while queue.recv_many(&mut batch, max_operations).await > 0 {
            self.refuse_without_room(&mut batch);
            if !batch.is_empty() {
                self.process(&mut batch).await;
            }
        }
        if let Some(transaction) = self.transaction
            && let Err(error) = transaction.connection.close().await
        {
            tracing::warn!(%error, "closing the database failed");
        }
    }

    /// Refuses what brings bytes where the disk has no room for it.
    fn refuse_without_room(&self, batch: &mut Vec<Box<dyn Operation>>) {
        if !batch.iter().any(|operation| operation.brings_bytes()) {
            return;
        }
        let Some(fault) = self.probing.cramped().map(StoreError::unavailable) else { return };
        for operation in batch.extract_if(.., |operation| operation.brings_bytes()) {
            self.counters.queued.fetch_sub(1, Ordering::Relaxed);
            self.counters.failed.fetch_add(1, Ordering::Relaxed);
            operation.answer(Some(&fault));
        }
    }

    async fn process(&mut self, batch: &mut Vec<Box<dyn Operation>>) {
        let begun = Instant::now();
        let outcome = self.commit(batch).await;
        let Counters { queued, commits, committed, failed } = &*self.counters;
        queued.fetch_sub(batch.len() as u64, Ordering::Relaxed);
        let fault = match outcome {
            Ok((succeeded, newest)) => {
                commits.fetch_add(1, Ordering::Relaxed);
                committed.fetch_add(succeeded as u64, Ordering::Relaxed);
                failed.fetch_add((batch.len() - succeeded) as u64, Ordering::Relaxed);
                self.observer.write_committed(succeeded, begun.elapsed());
                self.announcer.announce(newest);
                self.commits.notify_one();
                None
            }
            Err(fault) => {
                tracing::error!(error = %fault, operations = batch.len(), "a transaction failed");
                failed.fetch_add(batch.len() as u64, Ordering::Relaxed);
                Some(fault)
            }
        };
        for operation in batch.drain(..) {
            operation.answer(fault.as_ref());
        }
    }

    /// Does a batch of writes in one transaction. Returns how many succeeded and the newest rows.
    async fn commit(&mut self, batch: &mut [Box<dyn Operation>]) -> Result<(usize, Newest)> {
        // Taken out, so that on every early end the connection closes and rolls back.
        let mut transaction = match self.transaction.take() {
            Some(transaction) => transaction,
            None => {
                // It would make what is missing anew, beside the files that the others have.
                self.check_files()?;
                let connection = self.options.connect().await?;
                Transaction { connection, latest_us: self.latest_us, newest: self.announcer.newest() }
            }
        };
        // Each statement is a hop to the connection's thread, so what can go together does.
        sqlx::query("BEGIN IMMEDIATE; SAVEPOINT operation").execute(&mut transaction.connection).await?;
        let last = batch.len() - 1;
        let mut succeeded = 0;
        for (index, operation) in batch.iter_mut().enumerate() {
            let newest = transaction.newest;
            if operation.run(&mut transaction).await {
                succeeded += 1;
            } else {
                transaction.newest = newest;
                sqlx::query("ROLLBACK TO operation").execute(&mut transaction.connection).await?;
            }
            self.latest_us = transaction.latest_us;
            let next =
                if index < last { "RELEASE operation; SAVEPOINT operation" } else { "RELEASE operation; COMMIT" };
            sqlx::query(next).execute(&mut transaction.connection).await?;
        }
        let newest = transaction.newest;
        self.transaction = Some(transaction);
        // What is in a file without a name is not kept.
        self.check_files()?;
        Ok((succeeded, newest))
    }

    fn check_files(&self) -> Result<()> {
        let Some(reason) = self.probing.gone() else { return Ok(()) };
        self.probing.fault();
        Err(StoreError::unavailable(reason))
    }
}
