//! Checkpoints in PostgreSQL.

use std::collections::BTreeMap;
use std::sync::Arc;

use async_trait::async_trait;
use sqlx::{PgConnection, Postgres, QueryBuilder};
use uuid::Uuid;

use super::PostgresStore;
use crate::checkpoints::{Checkpoint, CheckpointSet, Checkpoints};
use crate::error::{Kind, Result, StoreError};
use crate::sql::checkpoints::{Packed, ROWS, checkpoint, packed};
use crate::sql::fault::is_reference;

impl PostgresStore {
    async fn write_checkpoints(&self, set: &CheckpointSet, checkpoints: Vec<Checkpoint>, replace: bool) -> Result<()> {
        let packed = packed(set, checkpoints, self.settings()).await?;
        let payload = packed.iter().map(|checkpoint| checkpoint.snapshot.len()).sum();
        // Of several with one index the last one is kept; a statement can write a row only once.
        let packed: BTreeMap<_, _> = packed.into_iter().map(|packed| (packed.setpoint_index, packed)).collect();
        let packed: Arc<[Packed]> = packed.into_values().collect();
        let set = set.clone();
        self.write(payload, move |connection| {
            let (set, packed) = (set.clone(), packed.clone());
            Box::pin(async move { put(connection, &set, &packed, replace).await })
        })
        .await
    }
}

async fn put(connection: &mut PgConnection, set: &CheckpointSet, packed: &[Packed], replace: bool) -> Result<()> {
    let id = set.job_id.to_string();
    let period = i64::from(set.interpolation_period_us);
    if replace {
        sqlx::query(
            "DELETE FROM job_checkpoints WHERE job_id = $1 AND interpolation_period_us = $2 AND generation_key = $3",
        )
        .bind(&id)
        .bind(period)
        .bind(&set.generation_key)
        .execute(&mut *connection)
        .await?;
    }
    for rows in packed.chunks(ROWS) {
        let mut sql = QueryBuilder::<Postgres>::new(
            "INSERT INTO job_checkpoints (job_id, interpolation_period_us, generation_key, setpoint_index, input_offset,
                snapshot_bytes, snapshot) ",
        );
        sql.push_values(rows, |mut row, checkpoint| {
            row.push_bind(&id)
                .push_bind(period)
                .push_bind(&set.generation_key)
                .push_bind(checkpoint.setpoint_index)
                .push_bind(checkpoint.input_offset)
                .push_bind(checkpoint.snapshot_bytes)
                .push_bind(checkpoint.snapshot.as_slice());
        });
        sql.push(
            " ON CONFLICT (job_id, interpolation_period_us, generation_key, setpoint_index) DO UPDATE
             SET input_offset = EXCLUDED.input_offset, snapshot_bytes = EXCLUDED.snapshot_bytes,
                snapshot = EXCLUDED.snapshot",
        );
        sql.build()
            .persistent(false)
            .execute(&mut *connection)
            .await
            .map_err(|error| if is_reference(&error) { StoreError::not_found(Kind::Job, &id) } else { error.into() })?;
    }
    Ok(())
}

#[async_trait]
impl Checkpoints for PostgresStore {
    async fn put_checkpoints(&self, set: &CheckpointSet, checkpoints: Vec<Checkpoint>) -> Result<()> {
        self.write_checkpoints(set, checkpoints, false).await
    }

    async fn replace_checkpoints(&self, set: &CheckpointSet, checkpoints: Vec<Checkpoint>) -> Result<()> {
        self.write_checkpoints(set, checkpoints, true).await
    }

    async fn nearest_checkpoint(&self, set: &CheckpointSet, setpoint_index: u64) -> Result<Option<Checkpoint>> {
        let row = sqlx::query(
            "SELECT setpoint_index, input_offset, snapshot_bytes, snapshot FROM job_checkpoints
             WHERE job_id = $1 AND interpolation_period_us = $2 AND generation_key = $3 AND setpoint_index <= $4
             ORDER BY setpoint_index DESC LIMIT 1",
        )
        .bind(set.job_id.to_string())
        .bind(i64::from(set.interpolation_period_us))
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
        self.write(0, move |connection| {
            Box::pin(async move {
                sqlx::query("DELETE FROM job_checkpoints WHERE job_id = $1")
                    .bind(job_id.to_string())
                    .execute(connection)
                    .await?;
                Ok(())
            })
        })
        .await
    }
}
