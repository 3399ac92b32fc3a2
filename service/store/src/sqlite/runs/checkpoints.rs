//! Checkpoints of live runs.

use std::ops::Range;

use uuid::Uuid;

use super::refusal;
use crate::error::Result;
use crate::runs::{RunCheckpoint, RunMark};
use crate::sql::run_checkpoints::{Packed, checkpoint, mark, packed};
use crate::sqlite::SqliteStore;
use crate::sqlite::writer::Transaction;

/// See [`crate::Runs::put_run_checkpoint`].
pub(super) async fn put(
    store: &SqliteStore,
    id: Uuid,
    attachment: u64,
    checkpoint: RunCheckpoint,
    removed: Vec<Range<u64>>,
) -> Result<()> {
    let packed = packed(attachment, checkpoint, removed, store.settings()).await?;
    store.write(packed.snapshot.len(), move |tx| Box::pin(write(tx, id, packed))).await
}

async fn write(tx: &mut Transaction, id: Uuid, packed: Packed) -> Result<()> {
    let run_id = id.to_string();
    let open = sqlx::query("SELECT 1 FROM runs WHERE id = ? AND attachment = ? AND state = 'open'")
        .bind(&run_id)
        .bind(packed.attachment)
        .fetch_optional(&mut tx.connection)
        .await?;
    if open.is_none() {
        return Err(refusal(&mut tx.connection, id).await?);
    }
    for [first, end] in packed.removed {
        sqlx::query("DELETE FROM run_checkpoints WHERE run_id = ? AND setpoint_index >= ? AND setpoint_index < ?")
            .bind(&run_id)
            .bind(first)
            .bind(end)
            .execute(&mut tx.connection)
            .await?;
    }
    sqlx::query(
        "INSERT OR REPLACE INTO run_checkpoints (run_id, setpoint_index, change_count, generation_key, digest_state,
            snapshot_bytes, snapshot) VALUES (?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(&run_id)
    .bind(packed.setpoint_index)
    .bind(packed.change_count)
    .bind(packed.generation_key)
    .bind(packed.digest_state)
    .bind(packed.snapshot_bytes)
    .bind(packed.snapshot)
    .execute(&mut tx.connection)
    .await?;
    Ok(())
}

/// See [`crate::Runs::nearest_run_checkpoint`].
pub(super) async fn nearest(
    store: &SqliteStore,
    id: Uuid,
    generation_key: &str,
    setpoint_index: u64,
) -> Result<Option<RunCheckpoint>> {
    let row = sqlx::query(
        "SELECT * FROM run_checkpoints WHERE run_id = ? AND generation_key = ? AND setpoint_index <= ?
         ORDER BY setpoint_index DESC LIMIT 1",
    )
    .bind(id.to_string())
    .bind(generation_key)
    // No stored index is beyond, so the nearest stays the nearest.
    .bind(i64::try_from(setpoint_index).unwrap_or(i64::MAX))
    .fetch_optional(&mut store.reader().await?)
    .await?;
    match row {
        Some(row) => checkpoint(&row).await.map(Some),
        None => Ok(None),
    }
}

/// See [`crate::Runs::run_marks`].
pub(super) async fn marks(store: &SqliteStore, id: Uuid) -> Result<Vec<RunMark>> {
    let rows = sqlx::query(
        "SELECT setpoint_index, digest_state FROM run_checkpoints WHERE run_id = ? ORDER BY setpoint_index",
    )
    .bind(id.to_string())
    .fetch_all(&mut store.reader().await?)
    .await?;
    rows.iter().map(mark).collect()
}
