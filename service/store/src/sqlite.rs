//! The store in an SQLite file: one connection that writes, a pool of connections that read.

mod audit;
mod checkpointer;
mod checkpoints;
mod documents;
mod fault;
mod jobs;
mod lock;
pub(crate) mod maintenance;
mod objects;
mod open;
mod options;
mod presences;
mod probe;
mod programs;
mod reader;
mod reading;
mod retention;
mod runs;
#[cfg(test)]
mod tests;
mod uploads;
mod validations;
mod writer;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use async_trait::async_trait;
use sqlx::{AssertSqlSafe, SqlitePool};
use tokio::sync::watch;

use crate::Database;
use crate::error::{Result, StoreError};
use crate::logs::LogPlaces;
use crate::objects::Objects;
use crate::settings::{StoreSettings, StoreStats};
use crate::sql::logs;
use crate::tenant::{HAS_TENANTS, Tenant};
use fault::is_damage;
pub(crate) use fault::meaning;
pub(crate) use options::{EXAMPLE, SCHEME, SqliteOptions};
use probe::Probing;
use reader::Reader;
use reading::Reading;
use writer::{BoxFuture, Transaction, Writer};

/// When a migration was done, s since the Unix epoch.
const MADE: &str = "CAST(strftime('%s', installed_on) AS INTEGER)";

/// The store in an SQLite file. Cloning is cheap; clones are the same store.
#[derive(Clone)]
pub(crate) struct SqliteStore {
    inner: Arc<Inner>,
}

struct Inner {
    options: SqliteOptions,
    settings: StoreSettings,
    objects: Objects,
    writer: Writer,
    probing: Arc<Probing>,
    reading: Reading,
    readers: SqlitePool,
    reads: AtomicU64,
    newest_event: watch::Receiver<i64>,
    newest_decision: watch::Receiver<i64>,
}

#[async_trait]
impl Database for SqliteStore {
    async fn close(&self) {
        self.inner.writer.close().await;
        self.inner.readers.close().await;
    }

    async fn ping(&self) -> Result<()> {
        if !self.inner.writer.is_open() {
            return Err(StoreError::unavailable("it is closed"));
        }
        let mut reader = self.reader().await?;
        sqlx::query("SELECT 1 FROM jobs LIMIT 1").execute(&mut reader).await?;
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
        let mut stats = self.inner.writer.stats();
        stats.reads = self.inner.reads.load(Ordering::Relaxed);
        stats.database_bytes = std::fs::metadata(&self.inner.options.path).map_or(0, |file| file.len());
        stats
    }
}

impl SqliteStore {
    /// Opens the database file, creates it if it does not exist, and brings its schema up to date. The folder must
    /// exist, and no other process may have the database open as a store.
    ///
    /// # Errors
    /// As [`crate::Store::open`].
    pub(crate) async fn open(options: SqliteOptions, settings: StoreSettings) -> Result<Self> {
        let opened = open::open(&options).await?;
        let readers = opened.readers.clone();
        let probing = Arc::new(Probing::new(&options));
        let (writer, announced) = Writer::start(opened, probing.clone(), &settings);
        let inner = Inner {
            options,
            objects: Objects::of(settings.objects.clone())?,
            settings,
            writer,
            probing,
            reading: Reading::default(),
            readers,
            reads: AtomicU64::new(0),
            newest_event: announced.event,
            newest_decision: announced.decision,
        };
        let store = Self { inner: Arc::new(inner) };
        store.remove_orphans().await?;
        store.let_announced_go().await?;
        Ok(store)
    }

    fn settings(&self) -> &StoreSettings {
        &self.inner.settings
    }

    /// Does `work` within a transaction; `payload_bytes` is what it holds in memory until then. Without any it takes next to
    /// nothing, and is done while there is no room for others: so records can be removed.
    async fn write<T, F>(&self, payload_bytes: usize, work: F) -> Result<T>
    where
        T: Send + 'static,
        F: for<'t> FnOnce(&'t mut Transaction) -> BoxFuture<'t, Result<T>> + Send + 'static,
    {
        match self.inner.writer.write(payload_bytes, work).await {
            Err(error @ StoreError::Corrupt { .. }) => Err(self.inner.read_fault().await.unwrap_or(error)),
            done => done,
        }
    }

    async fn reader(&self) -> Result<Reader<'_>> {
        Ok(Reader::of(&self.inner).await?)
    }
}
