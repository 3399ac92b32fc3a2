//! The store in a PostgreSQL database that any number of replicas share.
//!
//! Writes that go into a log (events, decisions, the audit log) are committed in groups, one group of a log at a time over all replicas,
//! so that its numbers become visible in order and without gaps. All other writes are transactions of their own, side by
//! side. Nothing relies on a session but the lock under which the schema is brought up to date; transactions run at
//! `READ COMMITTED`, take locks on rows, and are repeated where the database says that another came in between.

mod audit;
mod bell;
mod check;
mod checkpoints;
mod clock;
mod copy;
mod documents;
mod fault;
mod jobs;
mod lane;
mod objects;
mod open;
mod options;
mod pool;
mod presences;
mod probe;
mod programs;
mod retention;
mod retry;
mod runs;
mod silence;
mod uploads;
mod validations;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use async_trait::async_trait;
use sqlx::{AssertSqlSafe, Connection as _, PgConnection};
use tokio::sync::{Semaphore, watch};

use crate::Database;
use crate::error::{Result, StoreError};
use crate::logs::LogPlaces;
use crate::objects::Objects;
use crate::settings::{StoreSettings, StoreStats};
use crate::sql::fault::REFUSED;
use crate::sql::logs;
use crate::tenant::{HAS_TENANTS, Tenant};
use bell::Bell;
pub(crate) use check::check;
use clock::Clock;
pub(crate) use copy::copy;
use fault::Remedy;
pub(crate) use fault::{is_certificate, meaning};
use lane::{BoxFuture, Lane, Shared, Transaction};
pub(crate) use open::migrate;
pub(crate) use options::{PostgresOptions, SCHEMES, without_password};
use pool::{Pool, Reader};
use probe::Probing;
use retry::{Failure, Patience};
use silence::{Silence, TRIVIAL};

/// Connections that read on in logs: one for events, one for decisions.
const LOG_CONNECTIONS: u32 = 2;
/// Payload is counted in pieces of this many bytes.
const PAYLOAD_UNIT_BYTES: u64 = 1024;

/// When a migration was done, µs since the Unix epoch.
const MADE: &str = "CAST(EXTRACT(EPOCH FROM installed_on) * 1000000 AS BIGINT)";

/// The store in a PostgreSQL database. Cloning is cheap; clones are the same store.
#[derive(Clone)]
pub(crate) struct PostgresStore {
    inner: Arc<Inner>,
}

struct Inner {
    options: PostgresOptions,
    settings: StoreSettings,
    objects: Objects,
    pool: Pool,
    /// Reads what comes new into a log: who watches does not queue up behind those who ask for something.
    log_pool: Pool,
    /// Writes to the log of events.
    events: Lane,
    /// Commits of runs, with what they write to the log of decisions.
    decisions: Lane,
    /// Writes to the audit log.
    audit: Lane,
    bell: Bell,
    shared: Arc<Shared>,
    probing: Probing,
    payload: Arc<Semaphore>,
    payload_units: u32,
    reads: AtomicU64,
}

#[async_trait]
impl Database for PostgresStore {
    async fn close(&self) {
        self.inner.events.close().await;
        self.inner.decisions.close().await;
        self.inner.audit.close().await;
        self.inner.bell.close().await;
        self.inner.log_pool.close().await;
        self.inner.pool.close().await;
    }

    async fn ping(&self) -> Result<()> {
        if !self.inner.events.is_open() {
            return Err(StoreError::unavailable("it is closed"));
        }
        // Who does not see what other replicas write works on what was cancelled, and watchers hear of nothing.
        self.inner.bell.check()?;
        let mut reader = self.reader().await?;
        let asked = async { Ok(sqlx::query("SELECT 1 FROM jobs LIMIT 1").execute(&mut reader).await?) };
        self.inner.shared.silence.answered(TRIVIAL, asked).await?;
        Ok(())
    }

    async fn probe(&self, patience: Duration) -> Result<()> {
        self.probe_writing(patience).await
    }

    fn watch_faults(&self) -> watch::Receiver<u64> {
        self.inner.probing.faults()
    }

    async fn log_places(&self, tenant: Tenant) -> Result<LogPlaces> {
        let query = sqlx::query_as(AssertSqlSafe(logs::places_of(MADE))).bind(tenant.name());
        Ok(logs::places(query.fetch_one(&mut self.reader().await?).await?))
    }

    async fn has_tenants(&self) -> Result<bool> {
        let found: i64 = sqlx::query_scalar(HAS_TENANTS).fetch_one(&mut self.reader().await?).await?;
        Ok(found != 0)
    }

    fn stats(&self) -> StoreStats {
        let mut stats = self.inner.shared.counts.stats();
        stats.reads = self.inner.reads.load(Ordering::Relaxed);
        stats.database_bytes = self.inner.bell.database_bytes();
        stats
    }
}

impl PostgresStore {
    /// Opens the database, creates it if it does not exist and the user may, and brings its schema up to date.
    ///
    /// # Errors
    /// As [`crate::Store::open`].
    pub(crate) async fn open(options: PostgresOptions, settings: StoreSettings) -> Result<Self> {
        migrate(&options).await?;
        let silence = Silence::new();
        let pool = Pool::new(&options, options.connections, silence.clone())?;
        let log_pool = Pool::new(&options, LOG_CONNECTIONS, silence.clone())?;
        let (clock, newest) = bell::ask_first(&options).await?;
        let shared = Arc::new(Shared::new(&options, &settings, (clock, newest), silence)?);
        let lane = |name| Lane::start(name, shared.clone(), &settings);
        let units = settings.write_queue_bytes.div_ceil(PAYLOAD_UNIT_BYTES).clamp(1, 1 << 28);
        // In range by the line above.
        let payload_units = u32::try_from(units).unwrap_or(u32::MAX);
        let inner = Inner {
            bell: Bell::start(shared.clone()),
            pool,
            log_pool,
            events: lane("events"),
            decisions: lane("decisions"),
            audit: lane("audit"),
            shared,
            probing: Probing::new(),
            payload: Arc::new(Semaphore::new(payload_units as usize)),
            payload_units,
            reads: AtomicU64::new(0),
            options,
            objects: Objects::of(settings.objects.clone())?,
            settings,
        };
        let store = Self { inner: Arc::new(inner) };
        store.remove_orphans().await?;
        store.take_back_presences().await?;
        Ok(store)
    }

    fn settings(&self) -> &StoreSettings {
        &self.inner.settings
    }

    fn clock(&self) -> &Clock {
        &self.inner.shared.clock
    }

    /// Does `work` within a group that writes to the log of events; `payload_bytes` is what it holds in memory until then.
    /// It may be done several times, but takes effect once.
    async fn write_event<T, F>(&self, payload_bytes: usize, work: F) -> Result<T>
    where
        T: Send + 'static,
        F: for<'t> Fn(&'t mut Transaction) -> BoxFuture<'t, Result<T>> + Send + 'static,
    {
        self.guarded(payload_bytes, self.inner.events.write(work)).await
    }

    /// As [`PostgresStore::write_event`], within a group of commits of runs.
    async fn write_run<T, F>(&self, payload_bytes: usize, work: F) -> Result<T>
    where
        T: Send + 'static,
        F: for<'t> Fn(&'t mut Transaction) -> BoxFuture<'t, Result<T>> + Send + 'static,
    {
        self.guarded(payload_bytes, self.inner.decisions.write(work)).await
    }

    /// As [`PostgresStore::write_event`], within a group that writes to the audit log.
    async fn write_audit<T, F>(&self, payload_bytes: usize, work: F) -> Result<T>
    where
        T: Send + 'static,
        F: for<'t> Fn(&'t mut Transaction) -> BoxFuture<'t, Result<T>> + Send + 'static,
    {
        self.guarded(payload_bytes, self.inner.audit.write(work)).await
    }

    /// Does `work`, which writes to no log, in a transaction of its own.
    async fn write<T, F>(&self, payload_bytes: usize, work: F) -> Result<T>
    where
        T: Send,
        F: for<'t> Fn(&'t mut PgConnection) -> BoxFuture<'t, Result<T>> + Send + Sync,
    {
        self.guarded(payload_bytes, self.write_alone(work)).await
    }

    /// A write, unless it is known that none can be done, and with what it holds in memory counted.
    async fn guarded<T>(&self, payload_bytes: usize, write: impl Future<Output = Result<T>> + Send) -> Result<T> {
        let closed = || StoreError::unavailable("it is closed");
        let mut blocked = self.inner.probing.blocked();
        let refused = async {
            // The sender lives as long as the store.
            let reason = blocked.wait_for(Option::is_some).await.ok().and_then(|reason| *reason);
            StoreError::unavailable(reason.unwrap_or("it is closed"))
        };
        let units = (payload_bytes as u64).div_ceil(PAYLOAD_UNIT_BYTES).min(u64::from(self.inner.payload_units));
        let units = u32::try_from(units).unwrap_or(self.inner.payload_units);
        let write = async {
            // A write larger than the whole allowance waits until it is alone.
            let _permit = self.inner.payload.acquire_many(units).await.map_err(|_| closed())?;
            write.await
        };
        let result = tokio::select! {
            biased;
            error = refused => return Err(error),
            result = write => result,
        };
        if let Err(StoreError::Unavailable { reason, source: Some(_) }) = &result
            && *reason != REFUSED
        {
            self.inner.probing.fault();
        }
        result
    }

    async fn write_alone<T, F>(&self, work: F) -> Result<T>
    where
        T: Send,
        F: for<'t> Fn(&'t mut PgConnection) -> BoxFuture<'t, Result<T>> + Send + Sync,
    {
        if !self.inner.events.is_open() {
            return Err(StoreError::unavailable("it is closed"));
        }
        let counts = &self.inner.shared.counts;
        let begun = Instant::now();
        let _queued = counts.queue(1);
        let mut patience = Patience::new(self.inner.options.connect_timeout);
        let result = loop {
            match self.try_write(&work).await {
                Ok(value) => break Ok(value),
                Err(failure) => {
                    if let Err(error) = patience.again(failure).await {
                        break Err(error);
                    }
                }
            }
        };
        counts.done(u64::from(result.is_ok()), u64::from(result.is_err()), u64::from(result.is_ok()));
        if result.is_ok() {
            self.inner.settings.observer.write_committed(1, begun.elapsed());
        }
        result
    }

    async fn try_write<T, F>(&self, work: &F) -> Result<T, Failure>
    where
        F: for<'t> Fn(&'t mut PgConnection) -> BoxFuture<'t, Result<T>>,
    {
        let before = |error: StoreError| Failure::Before(error);
        let limit = self.inner.options.answer_limit();
        let silence = &self.inner.shared.silence;
        let mut lent = self.inner.pool.acquire().await.map_err(before)?;
        // Ended early anywhere below, the connection is closed and the server rolls back.
        let connection = lent.ask().map_err(before)?;
        let begun = async move { Ok(connection.begin().await?) };
        let mut transaction = silence.answered(TRIVIAL, begun).await.map_err(before)?;
        let value = match silence.answered(limit, work(&mut transaction)).await {
            Ok(value) => value,
            Err(error) => {
                match Remedy::of(&error) {
                    Remedy::Reconnect => {}
                    Remedy::Renounce => {
                        drop(transaction);
                        lent.renounce();
                    }
                    Remedy::None | Remedy::Again => {
                        let undone = async { Ok(transaction.rollback().await?) };
                        if silence.answered(TRIVIAL, undone).await.is_ok() {
                            lent.answered();
                        }
                    }
                }
                return Err(before(error));
            }
        };
        let committed = async { Ok(transaction.commit().await?) };
        silence.answered(limit, committed).await.map_err(Failure::During)?;
        lent.answered();
        Ok(value)
    }

    /// A connection for reading.
    async fn reader(&self) -> Result<Reader> {
        self.reader_of(&self.inner.pool).await
    }

    /// A connection for reading on in a log: for what is read once for all who watch, `is_shared`, one of its own.
    async fn log_reader(&self, is_shared: bool) -> Result<Reader> {
        self.reader_of(if is_shared { &self.inner.log_pool } else { &self.inner.pool }).await
    }

    async fn reader_of(&self, pool: &Pool) -> Result<Reader> {
        let begun = Instant::now();
        let lent = pool.acquire().await?;
        self.inner.reads.fetch_add(1, Ordering::Relaxed);
        Ok(Reader::new(lent, self.inner.settings.observer.clone(), begun))
    }
}
