//! The queue of validations in SQLite.

use async_trait::async_trait;
use sqlx::Row;
use uuid::Uuid;

use super::SqliteStore;
use super::fault::{parsed, tenant, unsigned};
use super::jobs::{log, missing};
use super::writer::Transaction;
use crate::error::{Result, StoreError};
use crate::jobs::JobState;
use crate::validations::{Attempt, Validations, WaitingJob};

/// The states of a job that is to be validated.
const WAITING: [JobState; 2] = [JobState::PendingValidation, JobState::Validating];

#[async_trait]
impl Validations for SqliteStore {
    async fn waiting_jobs(&self, after: i64, limit: u32) -> Result<Vec<WaitingJob>> {
        let rows = sqlx::query(
            "SELECT j.id, j.sequence, j.client, j.attempts, p.size_bytes
             FROM jobs AS j CROSS JOIN programs AS p ON p.id = j.program_id
             WHERE j.state IN ('pending_validation', 'validating') AND j.sequence > ? ORDER BY j.sequence LIMIT ?",
        )
        .bind(after)
        .bind(limit)
        .fetch_all(&mut *self.reader().await?)
        .await?;
        let waiting = |row| {
            Ok(WaitingJob {
                id: parsed(row, "id")?,
                sequence: row.try_get("sequence")?,
                client: row.try_get("client")?,
                program_size_bytes: unsigned(row, "size_bytes")?,
                attempts: u32::try_from(unsigned(row, "attempts")?).unwrap_or(u32::MAX),
            })
        };
        rows.iter().map(waiting).collect()
    }

    async fn begin_validation(&self, id: Uuid, max_attempts: u32) -> Result<Attempt> {
        self.write(0, move |tx| Box::pin(begin(tx, id, max_attempts))).await
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
    let (state, attempts): (JobState, i64) = (parsed(&row, "state")?, row.try_get("attempts")?);
    if !WAITING.contains(&state) {
        return Err(StoreError::FailedState { job_id: id, actual: state, expected: WAITING.to_vec() });
    }
    let attempt = u32::try_from(attempts).unwrap_or(u32::MAX).saturating_add(1);
    let given_up = attempt > max_attempts;
    let (to, detail) = match (given_up, attempt) {
        (true, _) => (
            JobState::Failed,
            format!("validation ended with the service {attempts} time(s), which is as often as it is tried"),
        ),
        (false, 1) => (JobState::Validating, String::new()),
        (false, _) => (
            JobState::Validating,
            format!("attempt {attempt} of {max_attempts}: the one before ended with the service"),
        ),
    };
    let now_us = tx.now_us();
    // One that was broken off in order goes on as if nothing had happened.
    let changed = state != to || attempt > 1;
    sqlx::query(
        "UPDATE jobs SET state = ?, state_detail = ?, attempts = ?, updated_us = IIF(?, ?, updated_us),
            revision = revision + ? WHERE id = ?",
    )
    .bind(to.as_str())
    .bind(&detail)
    .bind(if given_up { attempts } else { i64::from(attempt) })
    .bind(changed)
    .bind(now_us)
    .bind(i64::from(changed))
    .bind(id.to_string())
    .execute(&mut tx.connection)
    .await?;
    if changed {
        log(tx, (tenant(&row)?, id), Some(state), Some(to), now_us, &detail).await?;
    }
    Ok(if given_up { Attempt::GivenUp } else { Attempt::Begun(attempt) })
}
