//! Moves what the write-ahead log holds into the database, beside the writer: what is acknowledged is in the log, so no
//! commit has to wait for it. Without it the log grows, and the commit that reaches its limit does it itself.

use std::sync::Arc;
use std::time::Duration;

use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Connection, SqliteConnection};
use tokio::sync::{Notify, oneshot};

use super::probe::Probing;
use crate::error::{Result, StoreError};

/// Time from the first commit after a checkpoint to the next one: long enough that pages changed again and again are
/// moved once.
const PERIOD: Duration = Duration::from_secs(1);

/// Follows commits until the writer, which holds the other end of `ended`, is no more.
pub(super) async fn run(
    options: SqliteConnectOptions,
    commits: Arc<Notify>,
    probing: Arc<Probing>,
    mut ended: oneshot::Receiver<()>,
) {
    let mut connection = None;
    loop {
        tokio::select! {
            _ = &mut ended => break,
            () = commits.notified() => {}
        }
        tokio::select! {
            _ = &mut ended => break,
            () = tokio::time::sleep(PERIOD) => {}
        }
        match checkpoint(connection.take(), &options).await {
            Ok(used) => {
                connection = Some(used);
                probing.log_moves(None);
            }
            // The writer does it in the end, or fails with the same cause; until then the log only grows.
            Err(error) => {
                tracing::warn!(%error, "moving the log into the database failed");
                if let StoreError::Unavailable { reason, .. } = error {
                    probing.log_moves(Some(reason));
                }
            }
        }
    }
    if let Some(connection) = connection
        && let Err(error) = connection.close().await
    {
        tracing::warn!(%error, "closing the database failed");
    }
}

/// Moves as much as no reader still needs; never waits.
pub(super) async fn checkpoint(
    connection: Option<SqliteConnection>,
    options: &SqliteConnectOptions,
) -> Result<SqliteConnection> {
    let mut connection = match connection {
        Some(connection) => connection,
        None => options.connect().await?,
    };
    sqlx::query("PRAGMA wal_checkpoint(PASSIVE)").execute(&mut connection).await?;
    Ok(connection)
}
