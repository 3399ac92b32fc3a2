//! Writes that go into a log. They queue up while a group is being committed; the next group takes all that wait, so
//! that one flush to disk serves many callers. Each write has a savepoint of its own: one that fails takes nothing with
//! it. A group that the database could not commit is done again as a whole.

use std::pin::Pin;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use sqlx::{AssertSqlSafe, Connection as _, PgConnection};
use tokio::sync::{Notify, mpsc, oneshot, watch};
use tokio::task::JoinHandle;
use uuid::Uuid;

use super::PostgresOptions;
use super::clock::Clock;
use super::fault::Remedy;
use super::open::connected;
use super::options::Target;
use super::pool::{TRIED_AFTER, close};
use super::retry::{Failure, Patience};
use super::silence::{Silence, TRIVIAL};
use crate::error::{Result, StoreError};
use crate::settings::{Observer, StoreSettings, StoreStats};

pub(super) type BoxFuture<'a, T> = Pin<Box<dyn Future<Output = T> + Send + 'a>>;

/// A log whose numbers have no gaps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Log {
    Decision,
    Event,
    /// Changes of entries of the audit log.
    AuditChange,
    Audit,
}

impl Log {
    /// Who locks several locks them in this order.
    const ALL: [Self; 4] = [Self::Decision, Self::Event, Self::AuditChange, Self::Audit];

    const fn name(self) -> &'static str {
        match self {
            Self::Decision => "decision",
            Self::Event => "event",
            Self::AuditChange => "audit_change",
            Self::Audit => "audit",
        }
    }
}

/// The newest numbers of the logs that are watched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Newest {
    pub(super) decision: i64,
    pub(super) event: i64,
}

/// Tells of the newest durable rows of the logs.
#[derive(Debug)]
pub(super) struct Announcer {
    decision: watch::Sender<i64>,
    event: watch::Sender<i64>,
    /// Counts how often other replicas rang for their presences.
    presence: watch::Sender<u64>,
}

impl Announcer {
    /// Tells of these, unless newer ones are known already.
    pub(super) fn announce(&self, newest: Newest) {
        for (sender, newest) in [(&self.decision, newest.decision), (&self.event, newest.event)] {
            sender.send_if_modified(|announced| {
                let newer = newest > *announced;
                *announced = newest.max(*announced);
                newer
            });
        }
    }

    /// Tells that another replica rang for its presences, or may have.
    pub(super) fn ring_presences(&self) {
        self.presence.send_modify(|rung| *rung += 1);
    }

    pub(super) fn presences(&self) -> watch::Receiver<u64> {
        self.presence.subscribe()
    }

    pub(super) fn decisions(&self) -> watch::Receiver<i64> {
        self.decision.subscribe()
    }

    pub(super) fn events(&self) -> watch::Receiver<i64> {
        self.event.subscribe()
    }
}

/// What was written and is to be.
#[derive(Debug, Default)]
pub(super) struct Counts {
    queued: AtomicU64,
    commits: AtomicU64,
    committed: AtomicU64,
    failed: AtomicU64,
}

/// Writes that wait or are in progress.
pub(super) struct Queued<'a>(&'a Counts, u64);

impl Drop for Queued<'_> {
    fn drop(&mut self) {
        self.0.queued.fetch_sub(self.1, Ordering::Relaxed);
    }
}

impl Counts {
    pub(super) fn queue(&self, operations: u64) -> Queued<'_> {
        self.queued.fetch_add(operations, Ordering::Relaxed);
        Queued(self, operations)
    }

    pub(super) fn done(&self, succeeded: u64, failed: u64, commits: u64) {
        self.committed.fetch_add(succeeded, Ordering::Relaxed);
        self.failed.fetch_add(failed, Ordering::Relaxed);
        self.commits.fetch_add(commits, Ordering::Relaxed);
    }

    pub(super) fn stats(&self) -> StoreStats {
        StoreStats {
            write_queue_depth: self.queued.load(Ordering::Relaxed),
            commits: self.commits.load(Ordering::Relaxed),
            committed_operations: self.committed.load(Ordering::Relaxed),
            failed_operations: self.failed.load(Ordering::Relaxed),
            ..StoreStats::default()
        }
    }
}

/// What all who write have in common.
pub(super) struct Shared {
    pub(super) clock: Arc<Clock>,
    pub(super) announcer: Announcer,
    pub(super) counts: Counts,
    /// Told when there is something new in a log that other replicas follow.
    pub(super) ring: Notify,
    pub(super) silence: Silence,
    /// Names this process among all that ever had the database.
    pub(super) replica: String,
    /// When it began, by the database's clock, µs.
    pub(super) started_us: i64,
    /// Whether another process has the same name and runs as well.
    has_namesake: AtomicBool,
    observer: Arc<dyn Observer>,
    pub(super) target: Target,
    /// How long the server may be away.
    pub(super) away: Duration,
    /// How long an answer may take.
    limit: Duration,
}

impl Shared {
    pub(super) fn new(
        options: &PostgresOptions,
        settings: &StoreSettings,
        (clock, newest): (Clock, Newest),
        silence: Silence,
    ) -> Result<Self> {
        Ok(Self {
            started_us: clock.now_us(),
            has_namesake: AtomicBool::new(false),
            clock: Arc::new(clock),
            announcer: Announcer {
                decision: watch::Sender::new(newest.decision),
                event: watch::Sender::new(newest.event),
                presence: watch::Sender::new(0),
            },
            replica: format!("{}#{}", settings.replica_name, Uuid::now_v7()),
            counts: Counts::default(),
            ring: Notify::new(),
            silence,
            observer: settings.observer.clone(),
            target: options.bounded(),
            away: options.connect_timeout,
            limit: options.answer_limit(),
        })
    }

    /// Notes whether another process with the name of this one runs.
    pub(super) fn note_namesake(&self, namesake: Option<String>, name: &str) {
        let had = self.has_namesake.swap(namesake.is_some(), Ordering::Relaxed);
        match namesake {
            Some(process) if !had => tracing::error!(
                name,
                process,
                "another replica of this name is running: give each a name of its own (store.replica_name)"
            ),
            None if had => tracing::info!(name, "no other replica of this name is running any more"),
            _ => {}
        }
    }

    /// Whether a lease is of this process, or of an earlier one of the replica with its name, which is no more. Should that
    /// one still run, it finds out as it renews its lease.
    pub(super) fn holds(&self, holder: &str) -> bool {
        let is_former = || former(&self.replica).is_some_and(|former| holder.starts_with(former));
        holder == self.replica || (!self.has_namesake.load(Ordering::Relaxed) && is_former())
    }
}

/// How the names of all processes of the replica begin that this process is of; `None` where it has no name.
pub(super) fn former(replica: &str) -> Option<&str> {
    let (name, process) = replica.rsplit_once('#')?;
    (!name.is_empty()).then(|| &replica[..replica.len() - process.len()])
}

/// What a write works with.
pub(super) struct Transaction {
    /// The connection, inside a transaction.
    pub(super) connection: PgConnection,
    clock: Arc<Clock>,
    /// The newest numbers of the logs that this transaction has locked, in the order of [`Log::ALL`].
    locked: [Option<i64>; Log::ALL.len()],
}

impl Transaction {
    /// The time now in microseconds since the Unix epoch, by the database's clock.
    pub(super) fn now_us(&self) -> i64 {
        self.clock.now_us()
    }

    /// Keeps others from writing to a log until this transaction ends; what they wrote is visible from now on. The
    /// newest number.
    pub(super) async fn lock(&mut self, log: Log) -> Result<i64> {
        if let Some(newest) = self.locked[log as usize] {
            return Ok(newest);
        }
        let newest = sqlx::query_scalar("SELECT newest FROM counters WHERE name = $1 FOR UPDATE")
            .bind(log.name())
            .fetch_one(&mut self.connection)
            .await?;
        self.locked[log as usize] = Some(newest);
        Ok(newest)
    }

    /// The next number of a log.
    pub(super) async fn next(&mut self, log: Log) -> Result<i64> {
        let next = self.lock(log).await? + 1;
        self.locked[log as usize] = Some(next);
        Ok(next)
    }
}

/// The callers' side of a queue of writes.
pub(super) struct Lane {
    queue: Mutex<Option<mpsc::Sender<Box<dyn Operation>>>>,
    task: Mutex<Option<JoinHandle<()>>>,
    shared: Arc<Shared>,
}

impl Lane {
    /// Starts the task that writes.
    pub(super) fn start(name: &'static str, shared: Arc<Shared>, settings: &StoreSettings) -> Self {
        let (queue, receiver) = mpsc::channel(settings.write_queue.max(1));
        let task = Task { name, shared: shared.clone(), connection: None };
        let task = tokio::spawn(task.run(receiver, settings.max_commit_operations.max(1)));
        Self { queue: Mutex::new(Some(queue)), task: Mutex::new(Some(task)), shared }
    }

    /// Does a write in the next group.
    pub(super) async fn write<T, F>(&self, work: F) -> Result<T>
    where
        T: Send + 'static,
        F: for<'t> Fn(&'t mut Transaction) -> BoxFuture<'t, Result<T>> + Send + 'static,
    {
        let closed = || StoreError::unavailable("it is closed");
        let _queued = self.shared.counts.queue(1);
        let queue = lock(&self.queue).clone().ok_or_else(closed)?;
        let (reply, answer) = oneshot::channel();
        queue.send(Box::new(Write { work, result: None, reply })).await.map_err(|_| closed())?;
        drop(queue);
        answer.await.map_err(|_| closed())?
    }

    /// Whether writes are still taken.
    pub(super) fn is_open(&self) -> bool {
        lock(&self.queue).as_ref().is_some_and(|queue| !queue.is_closed())
    }

    /// Commits what is queued, then ends.
    pub(super) async fn close(&self) {
        drop(lock(&self.queue).take());
        let task = lock(&self.task).take();
        if let Some(task) = task
            && let Err(error) = task.await
        {
            tracing::error!(%error, "a writer of the store ended abnormally");
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Only whole values are put in or taken out, so a panic elsewhere cannot leave them half-done.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What became of a write within its transaction.
enum Outcome {
    /// It is to stay.
    Done,
    /// It was refused, and leaves nothing.
    Refused,
    /// The whole transaction has to be done again, or given up.
    Failed(StoreError),
}

/// A queued write, whatever its result.
trait Operation: Send {
    /// Does the write and keeps its result.
    fn run<'t>(&'t mut self, transaction: &'t mut Transaction) -> BoxFuture<'t, Outcome>;

    /// Answers the caller with the result, or with why the transaction failed.
    fn answer(self: Box<Self>, fault: Option<&StoreError>);
}

struct Write<T, F> {
    work: F,
    result: Option<Result<T>>,
    reply: oneshot::Sender<Result<T>>,
}

impl<T, F> Operation for Write<T, F>
where
    T: Send,
    F: for<'t> Fn(&'t mut Transaction) -> BoxFuture<'t, Result<T>> + Send,
{
    fn run<'t>(&'t mut self, transaction: &'t mut Transaction) -> BoxFuture<'t, Outcome> {
        let Self { work, result, .. } = self;
        let work = work(transaction);
        Box::pin(async move {
            let found = work.await;
            let outcome = match &found {
                Ok(_) => Outcome::Done,
                Err(error) if Remedy::of(error) != Remedy::None => Outcome::Failed(error.clone()),
                Err(_) => Outcome::Refused,
            };
            *result = Some(found);
            outcome
        })
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
    name: &'static str,
    shared: Arc<Shared>,
    /// And when it was used last. `None` before the first transaction and after a failed one: its connection is given up
    /// with whatever it holds.
    connection: Option<(PgConnection, Instant)>,
}

impl Task {
    async fn run(mut self, mut queue: mpsc::Receiver<Box<dyn Operation>>, max_operations: usize) {
        let mut batch = Vec::new();
        while queue.recv_many(&mut batch, max_operations).await > 0 {
            self.process(&mut batch).await;
        }
        if let Some((connection, _)) = self.connection {
            close(connection).await;
        }
    }

    async fn process(&mut self, batch: &mut Vec<Box<dyn Operation>>) {
        let begun = Instant::now();
        let mut patience = Patience::new(self.shared.away);
        let outcome = loop {
            match self.commit(batch).await {
                Ok(done) => break Ok(done),
                Err(failure) => {
                    if let Err(error) = patience.again(failure).await {
                        break Err(error);
                    }
                }
            }
        };
        let all = batch.len() as u64;
        let fault = match outcome {
            Ok(succeeded) => {
                self.shared.counts.done(succeeded, all - succeeded, 1);
                let operations = usize::try_from(succeeded).unwrap_or(usize::MAX);
                self.shared.observer.write_committed(operations, begun.elapsed());
                None
            }
            Err(fault) => {
                tracing::error!(error = %fault, lane = self.name, operations = all, "a transaction failed");
                self.shared.counts.done(0, all, 0);
                Some(fault)
            }
        };
        for operation in batch.drain(..) {
            operation.answer(fault.as_ref());
        }
    }

    /// Does a group of writes in one transaction and tells of what is new in the logs; how many succeeded.
    async fn commit(&mut self, batch: &mut [Box<dyn Operation>]) -> Result<u64, Failure> {
        // Taken out, so that on every early end the connection closes and the server rolls back.
        let (mut transaction, succeeded) = self.done(batch).await.map_err(Failure::Before)?;
        let mut last = String::from("RELEASE SAVEPOINT operation");
        for (log, newest) in Log::ALL.into_iter().zip(transaction.locked) {
            if let Some(newest) = newest {
                last += &format!("; UPDATE counters SET newest = {newest} WHERE name = '{}'", log.name());
            }
        }
        last += "; COMMIT";
        let committed = execute(&mut transaction.connection, last);
        self.shared.silence.answered(self.shared.limit, committed).await.map_err(Failure::During)?;
        // Nobody waits for news of the audit log.
        let [decision, event, _, _] = transaction.locked;
        self.connection = Some((transaction.connection, Instant::now()));
        if decision.is_some() || event.is_some() {
            let newest = Newest { decision: decision.unwrap_or(0), event: event.unwrap_or(0) };
            self.shared.announcer.announce(newest);
            self.shared.ring.notify_one();
        }
        Ok(succeeded)
    }

    /// A connection in a new transaction. Nothing was done yet, so one that says nothing is told from a server that has
    /// much to do, and soon.
    async fn begun(&mut self) -> Result<PgConnection> {
        let silence = &self.shared.silence;
        if let Some((mut connection, used)) = self.connection.take()
            && !silence.since(used)
        {
            let tried = async {
                if used.elapsed() >= TRIED_AFTER {
                    connection.ping().await?;
                }
                begin(&mut connection).await
            };
            match silence.answered(TRIVIAL, tried).await {
                Ok(()) => return Ok(connection),
                Err(error) => tracing::debug!(%error, lane = self.name, "a connection is given up"),
            }
        }
        let mut connection = connected(&self.shared.target, self.shared.away, silence).await?;
        silence.answered(self.shared.limit, begin(&mut connection)).await?;
        Ok(connection)
    }

    /// Does a group of writes up to its commit; how many succeeded.
    async fn done(&mut self, batch: &mut [Box<dyn Operation>]) -> Result<(Transaction, u64)> {
        let connection = self.begun().await?;
        let mut transaction =
            Transaction { connection, clock: self.shared.clock.clone(), locked: [None; Log::ALL.len()] };
        let (limit, silence) = (self.shared.limit, &self.shared.silence);
        let mut succeeded = 0;
        let last = batch.len() - 1;
        for (index, operation) in batch.iter_mut().enumerate() {
            let locked = transaction.locked;
            let run = async { Ok(operation.run(&mut transaction).await) };
            let next = match silence.answered(limit, run).await? {
                Outcome::Failed(error) => return Err(error),
                Outcome::Done => {
                    succeeded += 1;
                    "RELEASE SAVEPOINT operation; SAVEPOINT operation"
                }
                Outcome::Refused => {
                    // With the savepoint go its locks.
                    transaction.locked = locked;
                    "ROLLBACK TO SAVEPOINT operation"
                }
            };
            if index < last || next.starts_with("ROLLBACK") {
                silence.answered(limit, execute(&mut transaction.connection, next.to_owned())).await?;
            }
        }
        Ok((transaction, succeeded))
    }
}

/// Each statement is a way to the server and back, so what can go together does.
async fn begin(connection: &mut PgConnection) -> Result<()> {
    execute(connection, "BEGIN; SAVEPOINT operation".to_owned()).await
}

/// Statements that are built of nothing but names and numbers of this file.
async fn execute(connection: &mut PgConnection, sql: String) -> Result<()> {
    sqlx::raw_sql(AssertSqlSafe(sql)).execute(connection).await?;
    Ok(())
}
