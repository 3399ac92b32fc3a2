//! Putting a copy in the place of a database.

use std::path::Path;

use sqlx::{Connection, SqliteConnection};

use super::{beside, check, connect, copy, failed, remove, sync_folder};
use crate::error::{Result, StoreError};
use crate::maintenance::{CopyError, CopyReport};
use crate::sqlite::SqliteOptions;
use crate::sqlite::lock::FileLock;

/// See [`crate::restore`].
pub(crate) async fn restore(
    options: &SqliteOptions,
    from: &Path,
    accept_damage: bool,
) -> Result<CopyReport, CopyError> {
    let path = options.path.as_path();
    let source = connect(from).await.map_err(CopyError::From)?;
    let _lock = FileLock::take(path, options.busy_timeout).await.map_err(CopyError::To)?;
    let part = beside(path, ".restoring");
    let report = copied(source, &part, accept_damage).await?;
    replace(path, &part).await.map_err(CopyError::To)?;
    Ok(report)
}

/// Makes a whole copy beside the database. What does not succeed is about whence it comes, but for what the disk does.
async fn copied(mut source: SqliteConnection, part: &Path, accept_damage: bool) -> Result<CopyReport, CopyError> {
    remove(part).map_err(CopyError::To)?;
    // What is verified is the copy: what will be used.
    let copied = copy(&mut source, part).await;
    if copied.is_err() {
        remove(part).map_err(CopyError::To)?;
    }
    let report = copied.map_err(|error| match error {
        StoreError::Corrupt { .. } | StoreError::Incompatible(_) => CopyError::From(error),
        error => CopyError::To(error),
    })?;
    // Nothing was written to it.
    let _ = source.close().await;
    let found = check(part, |_| Ok(())).await.map_err(CopyError::From)?;
    if let Some(first) = found.problems.first()
        && !accept_damage
    {
        remove(part).map_err(CopyError::To)?;
        let count = found.problems.len() as u64 + found.further_problems;
        let first = format!("{} {}: {}", first.kind, first.id, first.reason);
        return Err(CopyError::From(StoreError::Damaged { count, first }));
    }
    Ok(report)
}

/// Puts a copy in the place of the database.
async fn replace(path: &Path, part: &Path) -> Result<()> {
    if path.exists() {
        keep(path).await?;
    }
    // Without its log, which was emptied or is kept, nothing of the earlier database comes back into the copy.
    remove(&beside(path, "-wal"))?;
    remove(&beside(path, "-shm"))?;
    sync_folder(path)?;
    std::fs::rename(part, path).map_err(failed("the copy cannot be put in its place"))?;
    sync_folder(path)
}

/// Keeps the database that is about to be replaced under another name as well.
async fn keep(path: &Path) -> Result<()> {
    let kept = beside(path, ".replaced");
    for name in [kept.clone(), beside(&kept, "-wal")] {
        remove(&name)?;
    }
    // Everything into the file itself, so that it is whole without its log. Where it is too damaged for that, the log is
    // kept with it.
    let emptied = empty_log(path).await;
    std::fs::hard_link(path, &kept).map_err(failed("the earlier database cannot be kept"))?;
    let log = beside(path, "-wal");
    if emptied.is_err() && log.exists() {
        std::fs::hard_link(&log, beside(&kept, "-wal")).map_err(failed("the earlier database cannot be kept"))?;
    }
    sync_folder(path)
}

async fn empty_log(path: &Path) -> Result<()> {
    let mut connection: SqliteConnection = connect(path).await?;
    let busy: i64 = sqlx::query_scalar("PRAGMA wal_checkpoint(TRUNCATE)").fetch_one(&mut connection).await?;
    connection.close().await?;
    if busy == 0 { Ok(()) } else { Err(StoreError::unavailable("it is locked by another program")) }
}
