//! The store: whichever database its URI names.

use std::fmt;
use std::ops::Deref;
use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use tokio::sync::watch;

use crate::audit::Audit;
use crate::checkpoints::Checkpoints;
use crate::error::Result;
use crate::jobs::Jobs;
use crate::logs::LogPlaces;
use crate::machines::Machines;
use crate::postgres::PostgresStore;
use crate::presences::Presences;
use crate::programs::Programs;
use crate::retention::Retention;
use crate::runs::Runs;
use crate::settings::{StoreSettings, StoreStats};
use crate::sqlite::SqliteStore;
use crate::tenant::Tenant;
use crate::tools::Tools;
use crate::uri::{Place, StoreUri};
use crate::validations::Validations;

/// A database that keeps everything.
#[async_trait]
pub trait Database:
    Programs + Jobs + Validations + Checkpoints + Runs + Presences + Machines + Tools + Audit + Retention + Send + Sync
{
    /// Ends the store in order: waits for the writes in progress, refuses new ones, and closes the database. Dropping
    /// the store without closing it loses nothing that was acknowledged.
    async fn close(&self);

    /// Verifies that the database answers reads and that writes are taken, for readiness probes.
    ///
    /// # Errors
    /// `Unavailable`, `Corrupt`.
    async fn ping(&self) -> Result<()>;

    /// Verifies that writing works, by a durable write that is not larger than it has to be. Where it does not come back
    /// within `patience`, or the database is no longer where it was opened, further writes are refused at once until a
    /// probe succeeds; those that wait are answered likewise.
    ///
    /// # Errors
    /// `Unavailable` with the reason.
    async fn probe(&self, patience: Duration) -> Result<()>;

    /// Counts writes that the database could not do, so that a probe follows them at once.
    fn watch_faults(&self) -> watch::Receiver<u64>;

    /// How far the logs of a tenant have come.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn log_places(&self, tenant: Tenant) -> Result<LogPlaces>;

    /// Whether there are records of any tenant but the default one.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn has_tenants(&self) -> Result<bool>;

    /// Counters since the store was opened.
    fn stats(&self) -> StoreStats;
}

/// The store. Cloning is cheap; clones are the same store, and are closed with it.
#[derive(Clone)]
pub struct Store {
    uri: StoreUri,
    database: Arc<dyn Database>,
}

impl Store {
    /// Opens the database at `uri`, creates it where its kind allows that and it does not exist, and brings its schema
    /// up to date. Errors do not repeat the URI.
    ///
    /// # Errors
    /// `CannotOpen` if there is none and none can be made, `InUseBy` another process, `Incompatible` if it belongs to a newer version or to another
    /// program, `Corrupt` if it is not intact, `Unavailable`.
    pub async fn open(uri: &StoreUri, settings: StoreSettings) -> Result<Self> {
        let database: Arc<dyn Database> = match uri.place() {
            Place::Sqlite(options) => Arc::new(SqliteStore::open(options.clone(), settings).await?),
            Place::Postgres(options) => Arc::new(PostgresStore::open((**options).clone(), settings).await?),
        };
        Ok(Self { uri: uri.clone(), database })
    }

    /// Where it is kept.
    #[must_use]
    pub const fn uri(&self) -> &StoreUri {
        &self.uri
    }
}

impl Deref for Store {
    type Target = dyn Database;

    fn deref(&self) -> &Self::Target {
        &*self.database
    }
}

impl fmt::Debug for Store {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Store").field(&self.uri).finish()
    }
}
