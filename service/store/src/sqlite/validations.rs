//! The queue of validations in SQLite.

use std::time::Duration;

use async_trait::async_trait;
use uuid::Uuid;

use super::SqliteStore;
use super::jobs::log;
use super::writer::Transaction;
use crate::error::Result;
use crate::jobs::{Job, JobState, Jobs, NewReport};
use crate::sql::jobs::missing;
use crate::sql::record::tenant;
use crate::sql::validations::{Beginning, WAITING, waiting};
use crate::validations::{Attempt, Validations, WaitingJob};

#[async_trait]
impl Validations for SqliteStore {
    async fn waiting_jobs(&self, after: i64, limit: u32) -> Result<Vec<WaitingJob>> {
        let rows = sqlx::query(
            "SELECT j.id, j.sequence, j.client, j.attempts, p.size_bytes
             FROM jobs AS j LEFT JOIN programs AS p ON p.id = j.program_id
             WHERE j.state IN ('pending_validation', 'validating') AND j.sequence > ? ORDER BY j.sequence LIMIT ?",
        )
        .bind(after)
        .bind(limit)
        .fetch_all(&mut self.reader().await?)
        .await?;
        rows.iter().map(waiting).collect()
    }

    async fn abandoned_jobs(&self, _limit: u32) -> Result<Vec<WaitingJob>> {
        Ok(Vec::new())
    }

    fn lease(&self) -> Option<Duration> {
        None
    }

    async fn renew_validation(&self, _id: Uuid) -> Result<bool> {
        Ok(true)
    }

    async fn begin_validation(&self, id: Uuid, max_attempts: u32) -> Result<Attempt> {
        self.write(0, move |tx| Box::pin(begin(tx, id, max_attempts))).await
    }

    async fn end_validation(&self, id: Uuid, to: JobState, detail: &str, report: Option<NewReport>) -> Result<Job> {
        // One process has the file, so the validation is its own.
        Jobs::transition(self, id, &WAITING, to, detail, report).await
    }

    async fn return_attempt(&self, id: Uuid) -> Result<()> {
        self.write(0, move |tx| {
            Box::pin(async move {
                sqlx::query("UPDATE jobs SET attempts = MAX(attempts - 1, 0) WHERE id = ?")
                    .bind(id.to_string())
                    .execute(&mut tx.connection)
                    .await?;
                Ok(())
            })
        })
        .await
    }
}

async fn begin(tx: &mut Transaction, id: Uuid, max_attempts: u32) -> Result<Attempt> {
    let row = sqlx::query("SELECT state, attempts, tenant FROM jobs WHERE id = ?")
        .bind(id.to_string())
        .fetch_optional(&mut tx.connection)
        .await?
        .ok_or_else(|| missing(id))?;
    let Beginning { from, to, detail, attempts, changed, outcome } = Beginning::of(&row, id, max_attempts)?;
    let now_us = tx.now_us();
    sqlx::query(
        "UPDATE jobs SET state = ?, state_detail = ?, attempts = ?, updated_us = IIF(?, ?, updated_us),
            revision = revision + ? WHERE id = ?",
    )
    .bind(to.as_str())
    .bind(&detail)
    .bind(attempts)
    .bind(changed)
    .bind(now_us)
    .bind(i64::from(changed))
    .bind(id.to_string())
    .execute(&mut tx.connection)
    .await?;
    if changed {
        log(tx, (tenant(&row)?, id), Some(from), Some(to), now_us, &detail).await?;
    }
    Ok(outcome)
}
