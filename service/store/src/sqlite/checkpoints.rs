//! Checkpoints in SQLite.

use async_trait::async_trait;
use sqlx::{QueryBuilder, Sqlite};
use uuid::Uuid;

use super::SqliteStore;
use crate::checkpoints::{Checkpoint, CheckpointSet, Checkpoints};
use crate::error::{Kind, Result, StoreError};
use crate::sql::checkpoints::{ROWS, checkpoint, packed};
use crate::sql::fault::is_reference;

impl SqliteStore {
    async fn write_checkpoints(&self, set: &CheckpointSet, checkpoints: Vec<Checkpoint>, replace: bool) -> Result<()> {
        let mut packed = packed(set, checkpoints, self.settings()).await?;
        let payload = packed.iter().map(|checkpoint| checkpoint.snapshot.len()).sum();
        let set = set.clone();
        self.write(payload, move |tx| {
            Box::pin(async move {
                let id = set.job_id.to_string();
                if replace {
                    sqlx::query(
                        "DELETE FROM job_checkpoints
                         WHERE job_id = ? AND interpolation_period_us = ? AND generation_key = ?",
                    )
                    .bind(&id)
                    .bind(set.interpolation_period_us)
                    .bind(&set.generation_key)
                    .execute(&mut tx.connection)
                    .await?;
                }
                while !packed.is_empty() {
                    let mut sql = QueryBuilder::<Sqlite>::new(
                        "INSERT OR REPLACE INTO job_checkpoints (job_id, interpolation_period_us, generation_key,
                            setpoint_index, input_offset, snapshot_bytes, snapshot) ",
                    );
                    sql.push_values(packed.drain(..packed.len().min(ROWS)), |mut row, checkpoint| {
                        row.push_bind(id.clone())
                            .push_bind(set.interpolation_period_us)
                            .push_bind(set.generation_key.clone())
                            .push_bind(checkpoint.setpoint_index)
                            .push_bind(checkpoint.input_offset)
                            .push_bind(checkpoint.snapshot_bytes)
                            .push_bind(checkpoint.snapshot);
                    });
                    sql.build().persistent(false).execute(&mut tx.connection).await.map_err(|error| {
                        if is_reference(&error) { StoreError::not_found(Kind::Job, &id) } else { error.into() }
                    })?;
                }
                Ok(())
            })
        })
        .await
    }
}

#[async_trait]
impl Checkpoints for SqliteStore {
    async fn put_checkpoints(&self, set: &CheckpointSet, checkpoints: Vec<Checkpoint>) -> Result<()> {
        self.write_checkpoints(set, checkpoints, false).await
    }

    async fn replace_checkpoints(&self, set: &CheckpointSet, checkpoints: Vec<Checkpoint>) -> Result<()> {
        self.write_checkpoints(set, checkpoints, true).await
    }

    async fn nearest_checkpoint(&self, set: &CheckpointSet, setpoint_index: u64) -> Result<Option<Checkpoint>> {
        let row = sqlx::query(
            "SELECT setpoint_index, input_offset, snapshot_bytes, snapshot FROM job_checkpoints
             WHERE job_id = ? AND interpolation_period_us = ? AND generation_key = ? AND setpoint_index <= ?
             ORDER BY setpoint_index DESC LIMIT 1",
        )
        .bind(set.job_id.to_string())
        .bind(set.interpolation_period_us)
        .bind(&set.generation_key)
        // No stored index is beyond, so the nearest stays the nearest.
        .bind(i64::try_from(setpoint_index).unwrap_or(i64::MAX))
        .fetch_optional(&mut self.reader().await?)
        .await?;
        match row {
            Some(row) => checkpoint(&row).await.map(Some),
            None => Ok(None),
        }
    }

    async fn delete_checkpoints(&self, job_id: Uuid) -> Result<()> {
        self.write(0, move |tx| {
            Box::pin(async move {
                sqlx::query("DELETE FROM job_checkpoints WHERE job_id = ?")
                    .bind(job_id.to_string())
                    .execute(&mut tx.connection)
                    .await?;
                Ok(())
            })
        })
        .await
    }
}
