//! Work on a database beside the service: verifying it, and copies of it to and fro.

use std::path::Path;

use bytes::Bytes;

use crate::error::{Result, StoreError};
use crate::postgres;
use crate::settings::StoreSettings;
use crate::sqlite::maintenance;
use crate::store::Store;
use crate::uri::{Place, StoreUri};

/// Something that is not as it was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// What it is about: `file`, `program`, `upload`, `job`, `report`, `checkpoint`, `document`, `run`, `event`.
    pub kind: &'static str,
    /// Identifier of the record; empty where it is none.
    pub id: String,
    /// What does not fit.
    pub reason: String,
    /// What is lost with it.
    pub lost: &'static str,
}

/// What a verification found.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CheckReport {
    /// How many records of each kind were looked at.
    pub checked: Vec<(&'static str, u64)>,
    /// What is wrong, at most [`MAX_PROBLEMS`].
    pub problems: Vec<Problem>,
    /// Problems beyond those.
    pub further_problems: u64,
}

/// Most problems that a verification lists.
pub const MAX_PROBLEMS: usize = 10_000;

impl CheckReport {
    /// Whether everything is as it was written.
    #[must_use]
    pub fn is_intact(&self) -> bool {
        self.problems.is_empty() && self.further_problems == 0
    }
}

/// What a copy holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CopyReport {
    /// Its size, bytes.
    pub bytes: u64,
    /// Jobs.
    pub jobs: u64,
    /// Programs.
    pub programs: u64,
    /// Programs of these whose bytes are in an object store, and not in the copy: it is complete only with the objects.
    pub programs_in_objects: u64,
    /// Sequence number of the newest event.
    pub newest_event: i64,
}

/// Verifies every record of a database: hashes of programs, also of those in an object store, reports, logs, and of a file the file itself and references,
/// which a server verifies. The service may run meanwhile.
///
/// # Errors
/// `CannotOpen`, `Incompatible`, `Unavailable`. That something is damaged is no error but what the report says.
pub async fn check(uri: &StoreUri) -> Result<CheckReport> {
    check_with(uri, |_| Ok(())).await
}

/// Reads the body of a decision, of which the store knows nothing; why it cannot be read.
pub type ReadDecision = fn(Bytes) -> std::result::Result<(), String>;

/// As [`check`], the bodies of decisions included.
///
/// # Errors
/// Those of [`check`].
pub async fn check_with(uri: &StoreUri, read_decision: ReadDecision) -> Result<CheckReport> {
    match uri.place() {
        Place::Sqlite(options) => maintenance::check(&options.path, read_decision).await,
        Place::Postgres(options) => postgres::check(options, read_decision).await,
    }
}

/// Copies a database as it is at one moment into a new file; the service may run meanwhile. The file appears once it is
/// complete, verified and on the disk. What is in an object store is not in it.
///
/// # Errors
/// `CannotOpen`, `CannotCopy` also where the file is there already, `Incompatible`, `Corrupt`, `Unavailable`.
pub async fn backup(uri: &StoreUri, to: &Path) -> Result<CopyReport> {
    match uri.place() {
        Place::Sqlite(options) => maintenance::backup(&options.path, to).await,
        Place::Postgres(_) => Err(of_the_server("copying it is the server's: pg_dump, or its own backups")),
    }
}

/// Puts a copy in the place of a database that no service uses, at once: whenever it is interrupted, either the earlier
/// database or the copy is there. The earlier one is kept beside it, with `.replaced` behind its name.
///
/// # Errors
/// `InUseBy` a service, `Incompatible` if the copy is of a newer version or no copy, `Damaged` if it is not intact and
/// `accept_damage` does not say otherwise, `CannotOpen`, `CannotCopy`, `Unavailable`.
pub async fn restore(uri: &StoreUri, from: &Path, accept_damage: bool) -> Result<CopyReport, CopyError> {
    match uri.place() {
        Place::Sqlite(options) => maintenance::restore(options, from, accept_damage).await,
        Place::Postgres(_) => {
            Err(CopyError::To(of_the_server("restoring it is the server's: pg_restore, or its own backups")))
        }
    }
}

/// What was copied of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableCopy {
    /// Its name.
    pub table: &'static str,
    /// Its rows.
    pub rows: u64,
    /// SHA-256 over all of them, which is the same on both sides.
    pub sha256: [u8; 32],
}

/// Why nothing was copied, and which side it is about.
#[derive(Debug, Clone, thiserror::Error)]
pub enum CopyError {
    /// The store to copy.
    #[error(transparent)]
    From(StoreError),
    /// The store to copy to.
    #[error(transparent)]
    To(StoreError),
}

/// Copies everything in an SQLite file that no service uses into an empty database of a PostgreSQL server, all of it or
/// nothing, and compares what was written with what was read. The file stays as it is. Programs in an object store are
/// in the database then.
///
/// # Errors
/// `InUseBy` a service, `Damaged` if the file is not intact, `CannotOpen` where there is no file, or records in the
/// database, or where the URIs name anything else, `Incompatible`, `Corrupt`, `Unavailable`.
pub async fn copy(from: &StoreUri, to: &StoreUri) -> Result<Vec<TableCopy>, CopyError> {
    match (from.place(), to.place()) {
        (Place::Sqlite(from), Place::Postgres(to)) => postgres::copy(from, to).await,
        (from, _) => {
            let error = of_the_server("copied is from a file (sqlite) into the database of a server (postgres)");
            Err(if matches!(from, Place::Sqlite(_)) { CopyError::To(error) } else { CopyError::From(error) })
        }
    }
}

/// Brings the schema of a database up to date, creates that of a server where the user may, and changes nothing else; a
/// service does the same as it starts.
///
/// # Errors
/// As [`crate::Store::open`], and `CannotOpen` where there is no file.
pub async fn migrate(uri: &StoreUri) -> Result<()> {
    match uri.place() {
        Place::Sqlite(options) => {
            // A name that is not the file's would be up to date at once.
            if !options.path.is_file() {
                return Err(StoreError::CannotOpen { reason: "there is no such file", source: None });
            }
            let store = Store::open(uri, StoreSettings::default()).await?;
            store.close().await;
            Ok(())
        }
        Place::Postgres(options) => postgres::migrate(options).await,
    }
}

/// That something is not done to the database of a server from here.
fn of_the_server(reason: &'static str) -> StoreError {
    StoreError::CannotOpen { reason, source: None }
}
