//! Work on a database file beside the service.

mod backup;
mod check;
mod restore;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, SqliteConnection};

use super::open::{APPLICATION_ID, MIGRATOR};
use crate::error::{Result, StoreError};
use crate::maintenance::CopyReport;
use crate::sql::migrations;

pub(crate) use backup::backup;
pub(crate) use check::check;
pub(crate) use restore::restore;

/// How long to wait for a lock that the service holds for a moment.
const PATIENCE: Duration = Duration::from_secs(60);

fn cannot(reason: &'static str) -> StoreError {
    StoreError::CannotCopy { reason, source: None }
}

fn failed(reason: &'static str) -> impl Fn(std::io::Error) -> StoreError {
    move |error| StoreError::CannotCopy { reason, source: Some(Arc::new(error)) }
}

/// Opens a file of ours that is not newer than this version, without changing its schema.
async fn connect(path: &Path) -> Result<SqliteConnection> {
    if !path.is_file() {
        return Err(StoreError::CannotOpen { reason: "there is no such file", source: None });
    }
    let options = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(false)
        .busy_timeout(PATIENCE)
        .disable_statement_logging();
    let mut connection = options.connect().await?;
    let application: i32 = sqlx::query_scalar("PRAGMA application_id").fetch_one(&mut connection).await?;
    if application != APPLICATION_ID {
        return Err(StoreError::Incompatible("it was made by another program".into()));
    }
    let newest: Option<i64> =
        sqlx::query_scalar("SELECT MAX(version) FROM _sqlx_migrations").fetch_one(&mut connection).await?;
    let known = migrations::newest(&MIGRATOR);
    match newest {
        Some(newest) if newest > known => Err(migrations::newer(newest, known)),
        _ => Ok(connection),
    }
}

/// Copies the database of a connection into a file that is not there, verifies it and brings it to the disk.
async fn copy(connection: &mut SqliteConnection, to: &Path) -> Result<CopyReport> {
    let name = to.to_str().ok_or_else(|| cannot("the name of the copy is not text"))?;
    // The copy can give free space back, whatever the database itself can.
    sqlx::query("PRAGMA auto_vacuum = INCREMENTAL").execute(&mut *connection).await?;
    sqlx::query("VACUUM INTO ?").bind(name).execute(connection).await?;
    let mut copied = connect(to).await?;
    let integrity: String = sqlx::query_scalar("PRAGMA integrity_check(1)").fetch_one(&mut copied).await?;
    if integrity != "ok" {
        return Err(StoreError::corrupt(format!("the copy is not intact: {integrity}")));
    }
    let (jobs, programs): (i64, i64) =
        sqlx::query_as("SELECT (SELECT COUNT(*) FROM jobs), (SELECT COUNT(*) FROM programs)")
            .fetch_one(&mut copied)
            .await?;
    // A copy may be of an earlier version.
    let knows_objects: bool =
        sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM sqlite_schema WHERE type = 'table' AND name = 'objects')")
            .fetch_one(&mut copied)
            .await?;
    let programs_in_objects: i64 = if knows_objects {
        sqlx::query_scalar("SELECT COUNT(*) FROM objects WHERE content_id IS NOT NULL").fetch_one(&mut copied).await?
    } else {
        0
    };
    let newest_event =
        sqlx::query_scalar("SELECT COALESCE(MAX(seq), 0) FROM sqlite_sequence WHERE name = 'job_events'")
            .fetch_one(&mut copied)
            .await?;
    sqlx::Connection::close(copied).await?;
    let file = std::fs::File::open(to).map_err(failed("the copy cannot be read"))?;
    file.sync_all().map_err(failed("the copy cannot be brought to the disk"))?;
    let bytes = file.metadata().map_err(failed("the copy cannot be read"))?.len();
    Ok(CopyReport {
        bytes,
        jobs: jobs.unsigned_abs(),
        programs: programs.unsigned_abs(),
        programs_in_objects: programs_in_objects.unsigned_abs(),
        newest_event,
    })
}

/// A file with something behind its name.
fn beside(path: &Path, suffix: &str) -> std::path::PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

/// Brings a change of names in a folder to the disk.
fn sync_folder(path: &Path) -> Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let synced = std::fs::File::open(folder).and_then(|folder| folder.sync_all());
    synced.map_err(failed("the folder cannot be brought to the disk"))
}

/// Removes a file that need not be there.
fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(failed("a file cannot be removed")(error)),
        _ => Ok(()),
    }
}
