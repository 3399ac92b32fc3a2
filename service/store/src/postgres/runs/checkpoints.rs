//! Checkpoints of live runs.

use std::ops::Range;
use std::sync::Arc;

use sqlx::PgConnection;
use uuid::Uuid;

use super::refusal;
use crate::error::Result;
use crate::postgres::PostgresStore;
use crate::runs::{RunCheckpoint, RunMark};
use crate::sql::run_checkpoints::{Packed, checkpoint, mark, packed};

/// See [`crate::Runs::put_run_checkpoint`].
pub(super) async fn put(
    store: &PostgresStore,
    id: Uuid,
    attachment: u64,
    checkpoint: RunCheckpoint,
    removed: Vec<Range<u64>>,
) -> Result<()> {
    let packed = Arc::new(packed(attachment, checkpoint, removed, store.settings()).await?);
    let write = store.write(packed.snapshot.len(), move |connection| {
        let packed = packed.clone();
        Box::pin(async move { write(connection, id, &packed).await })
    });
    write.await
}

async fn write(connection: &mut PgConnection, id: Uuid, packed: &Packed) -> Result<()> {
    let run_id = id.to_string();
    // Who takes the run up waits until this is done, and then finds it.
    let open = sqlx::query("SELECT 1 FROM runs WHERE id = $1 AND attachment = $2 AND state = 'open' FOR NO KEY UPDATE")
        .bind(&run_id)
        .bind(packed.attachment)
        .fetch_optional(&mut *connection)
        .await?;
    if open.is_none() {
        return Err(refusal(connection, id).await?);
    }
    for [first, end] in &packed.removed {
        sqlx::query("DELETE FROM run_checkpoints WHERE run_id = $1 AND setpoint_index >= $2 AND setpoint_index < $3")
            .bind(&run_id)
            .bind(first)
            .bind(end)
            .execute(&mut *connection)
            .await?;
    }
    sqlx::query(
        "INSERT INTO run_checkpoints (run_id, setpoint_index, change_count, generation_key, digest_state, snapshot_bytes,
            snapshot) VALUES ($1, $2, $3, $4, $5, $6, $7)
         ON CONFLICT (run_id, setpoint_index) DO UPDATE SET change_count = EXCLUDED.change_count,
            generation_key = EXCLUDED.generation_key, digest_state = EXCLUDED.digest_state,
            snapshot_bytes = EXCLUDED.snapshot_bytes, snapshot = EXCLUDED.snapshot",
    )
    .bind(&run_id)
    .bind(packed.setpoint_index)
    .bind(packed.change_count)
    .bind(&packed.generation_key)
    .bind(packed.digest_state.as_slice())
    .bind(packed.snapshot_bytes)
    .bind(packed.snapshot.as_slice())
    .execute(connection)
    .await?;
    Ok(())
}

/// See [`crate::Runs::nearest_run_checkpoint`].
pub(super) async fn nearest(
    store: &PostgresStore,
    id: Uuid,
    generation_key: &str,
    setpoint_index: u64,
) -> Result<Option<RunCheckpoint>> {
    let row = sqlx::query(
        "SELECT * FROM run_checkpoints WHERE run_id = $1 AND generation_key = $2 AND setpoint_index <= $3
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
pub(super) async fn marks(store: &PostgresStore, id: Uuid) -> Result<Vec<RunMark>> {
    let rows = sqlx::query(
        "SELECT setpoint_index, digest_state FROM run_checkpoints WHERE run_id = $1 ORDER BY setpoint_index",
    )
    .bind(id.to_string())
    .fetch_all(&mut store.reader().await?)
    .await?;
    rows.iter().map(mark).collect()
}
