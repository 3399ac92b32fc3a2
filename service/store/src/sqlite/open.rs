//! Opening the file: is it ours, is it current, and with which guarantees.

use std::path::Path;

use sqlx::migrate::Migrator;
use sqlx::sqlite::{SqliteAutoVacuum, SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{ConnectOptions, Connection, SqliteConnection, SqlitePool};

use super::SqliteOptions;
use super::lock::FileLock;
use super::writer::Newest;
use crate::error::{Result, StoreError};
use crate::sql::migrations;

pub(super) static MIGRATOR: Migrator = sqlx::migrate!("../../migrations/sqlite");

/// Marks the file as ours ("fwdb"), so that no other program's database is ever migrated.
pub(super) const APPLICATION_ID: i32 = 0x6677_6462;

/// Pages of the write-ahead log, 64 MiB, from which on a commit moves them itself. It is done beside the writer long
/// before, but for writes that come faster than that.
const AUTOCHECKPOINT_PAGES: &str = "16384";

/// After a checkpoint the write-ahead log is cut down to this size; a large upload would otherwise
/// leave it large for good.
const JOURNAL_SIZE_LIMIT: &str = "67108864";

pub(super) struct Opened {
    pub(super) writer: SqliteConnection,
    pub(super) options: SqliteConnectOptions,
    pub(super) readers: SqlitePool,
    pub(super) newest: Newest,
    pub(super) lock: FileLock,
}

pub(super) async fn open(wanted: &SqliteOptions) -> Result<Opened> {
    let path: &Path = &wanted.path;
    let cannot = |reason| StoreError::CannotOpen { reason, source: None };
    if path.is_dir() {
        return Err(cannot("it is a folder"));
    }
    if path.parent().is_some_and(|folder| !folder.is_dir()) {
        return Err(cannot("its folder does not exist"));
    }

    let mut lock = FileLock::take(path, wanted.busy_timeout).await?;
    let plain = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .busy_timeout(wanted.busy_timeout)
        .disable_statement_logging()
        // Of a new file: free space can be given back. An earlier one has it after a backup and its restore.
        .auto_vacuum(SqliteAutoVacuum::Incremental);
    let fresh = identify(&plain).await?;

    let options = plain
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        .pragma("wal_autocheckpoint", AUTOCHECKPOINT_PAGES)
        .pragma("journal_size_limit", JOURNAL_SIZE_LIMIT);
    let mut writer = options.connect().await?;
    lock.hold(path)?;
    if fresh {
        sqlx::query("PRAGMA application_id = 0x66776462").execute(&mut writer).await?;
    }
    MIGRATOR.run_direct(None, &mut writer, false).await.map_err(|error| migrations::fault(error, &MIGRATOR))?;
    let newest = Newest {
        event: newest_row(&mut writer, "job_events").await?,
        decision: newest_row(&mut writer, "decisions").await?,
    };

    // Should the file be gone later, an empty one in its place would take what is written.
    let options = options.create_if_missing(false);
    let readers = SqlitePoolOptions::new()
        .max_connections(wanted.readers)
        .acquire_timeout(wanted.busy_timeout)
        .idle_timeout(None)
        .max_lifetime(None)
        .test_before_acquire(false)
        .connect_with(options.clone().pragma("query_only", "ON"))
        .await?;
    Ok(Opened { writer, options, readers, newest, lock })
}

/// Position of the newest row that a log ever had.
async fn newest_row(connection: &mut SqliteConnection, table: &str) -> Result<i64> {
    let newest = sqlx::query_scalar("SELECT COALESCE(MAX(seq), 0) FROM sqlite_sequence WHERE name = ?");
    Ok(newest.bind(table).fetch_one(connection).await?)
}

/// Looks at the file before anything in it is changed. True if it is new.
async fn identify(plain: &SqliteConnectOptions) -> Result<bool> {
    let mut connection = plain.connect().await.map_err(|error| match StoreError::from(error) {
        StoreError::Unavailable { reason, source } => StoreError::CannotOpen { reason, source },
        other => other,
    })?;
    let application: i32 = sqlx::query_scalar("PRAGMA application_id").fetch_one(&mut connection).await?;
    let tables: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM sqlite_schema").fetch_one(&mut connection).await?;
    connection.close().await?;
    match (application, tables) {
        (APPLICATION_ID, _) => Ok(false),
        (0, 0) => Ok(true),
        _ => Err(StoreError::Incompatible("it was made by another program".into())),
    }
}
