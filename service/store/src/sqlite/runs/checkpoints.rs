//! Checkpoints of live runs.

use std::ops::Range;

use sqlx::Row;
use sqlx::sqlite::SqliteRow;
use uuid::Uuid;

use super::refusal;
use crate::error::{Result, check_size};
use crate::runs::{RunCheckpoint, RunMark};
use crate::sqlite::SqliteStore;
use crate::sqlite::compress::{compress, decompress, offload};
use crate::sqlite::fault::{signed, unsigned};

/// Longest generation key and state of a digest, bytes.
const MAX_KEY_BYTES: u64 = 1024;

/// See [`crate::Runs::put_run_checkpoint`].
pub(super) async fn put(
    store: &SqliteStore,
    id: Uuid,
    attachment: u64,
    checkpoint: RunCheckpoint,
    removed: Vec<Range<u64>>,
) -> Result<()> {
    let RunCheckpoint { mark: RunMark { setpoint_index, digest_state }, change_count, generation_key, snapshot } =
        checkpoint;
    check_size("generation key size in bytes", generation_key.len(), MAX_KEY_BYTES)?;
    check_size("digest state size in bytes", digest_state.len(), MAX_KEY_BYTES)?;
    check_size("snapshot size in bytes", snapshot.len(), store.settings().max_snapshot_bytes)?;
    let attachment = signed("attachment", attachment)?;
    let setpoint_index = signed("setpoint index", setpoint_index)?;
    let change_count = signed("number of changes", change_count)?;
    let snapshot_bytes = signed("snapshot size in bytes", snapshot.len() as u64)?;
    let bound = |range: Range<u64>| Ok([signed("setpoint index", range.start)?, signed("setpoint index", range.end)?]);
    let removed: Vec<_> = removed.into_iter().map(bound).collect::<Result<_>>()?;
    let packed = offload(snapshot.len(), move || compress(&snapshot)).await?;
    let write = store.write(packed.len(), move |tx| {
        Box::pin(async move {
            let run_id = id.to_string();
            let open = sqlx::query("SELECT 1 FROM runs WHERE id = ? AND attachment = ? AND state = 'open'")
                .bind(&run_id)
                .bind(attachment)
                .fetch_optional(&mut tx.connection)
                .await?;
            if open.is_none() {
                return Err(refusal(&mut tx.connection, id).await?);
            }
            for [first, end] in removed {
                sqlx::query(
                    "DELETE FROM run_checkpoints WHERE run_id = ? AND setpoint_index >= ? AND setpoint_index < ?",
                )
                .bind(&run_id)
                .bind(first)
                .bind(end)
                .execute(&mut tx.connection)
                .await?;
            }
            sqlx::query(
                "INSERT OR REPLACE INTO run_checkpoints (run_id, setpoint_index, change_count, generation_key,
                    digest_state, snapshot_bytes, snapshot) VALUES (?, ?, ?, ?, ?, ?, ?)",
            )
            .bind(&run_id)
            .bind(setpoint_index)
            .bind(change_count)
            .bind(generation_key)
            .bind(digest_state.as_ref())
            .bind(snapshot_bytes)
            .bind(packed)
            .execute(&mut tx.connection)
            .await?;
            Ok(())
        })
    });
    write.await
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
    .fetch_optional(&mut *store.reader().await?)
    .await?;
    let Some(row) = row else { return Ok(None) };
    let size = unsigned(&row, "snapshot_bytes")?;
    let packed: Vec<u8> = row.try_get("snapshot")?;
    Ok(Some(RunCheckpoint {
        mark: mark(&row)?,
        change_count: unsigned(&row, "change_count")?,
        generation_key: row.try_get("generation_key")?,
        snapshot: offload(packed.len(), move || decompress(&packed, size)).await?,
    }))
}

/// See [`crate::Runs::run_marks`].
pub(super) async fn marks(store: &SqliteStore, id: Uuid) -> Result<Vec<RunMark>> {
    let rows = sqlx::query(
        "SELECT setpoint_index, digest_state FROM run_checkpoints WHERE run_id = ? ORDER BY setpoint_index",
    )
    .bind(id.to_string())
    .fetch_all(&mut *store.reader().await?)
    .await?;
    rows.iter().map(mark).collect()
}

fn mark(row: &SqliteRow) -> Result<RunMark> {
    let digest_state: Vec<u8> = row.try_get("digest_state")?;
    Ok(RunMark { setpoint_index: unsigned(row, "setpoint_index")?, digest_state: digest_state.into() })
}
