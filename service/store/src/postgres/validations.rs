//! The queue of validations in PostgreSQL. Who begins one has a lease on it, by the database's clock, and renews it; a
//! replica that is gone lets it run out, and another one begins anew. The state of the job decides which result counts.

use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use sqlx::Row as _;
use uuid::Uuid;

use super::PostgresStore;
use super::jobs::{change, log};
use super::lane::{Log, Shared, Transaction};
use crate::error::Result;
use crate::jobs::{Job, JobState, NewReport};
use crate::sql::jobs::{missing, packed};
use crate::sql::record::tenant;
use crate::sql::validations::{Beginning, WAITING, waiting};
use crate::validations::{Attempt, Validations, WaitingJob};

/// For how long a validation is a replica's without a further word.
const LEASE: Duration = Duration::from_secs(15);

/// The same, µs.
pub(super) const LEASE_US: i64 = 15_000_000;

#[async_trait]
impl Validations for PostgresStore {
    async fn waiting_jobs(&self, after: i64, limit: u32) -> Result<Vec<WaitingJob>> {
        let rows = sqlx::query(
            "SELECT j.id, j.sequence, j.client, j.attempts, p.size_bytes
             FROM jobs AS j LEFT JOIN programs AS p ON p.id = j.program_id
             WHERE j.state IN ('pending_validation', 'validating') AND j.sequence > $1 ORDER BY j.sequence LIMIT $2",
        )
        .bind(after)
        .bind(i64::from(limit))
        .fetch_all(&mut self.reader().await?)
        .await?;
        rows.iter().map(waiting).collect()
    }

    async fn abandoned_jobs(&self, limit: u32) -> Result<Vec<WaitingJob>> {
        let rows = sqlx::query(
            "SELECT j.id, j.sequence, j.client, j.attempts, p.size_bytes
             FROM jobs AS j LEFT JOIN programs AS p ON p.id = j.program_id
             WHERE j.state = 'validating' AND (j.lease_until_us IS NULL OR j.lease_until_us < $1)
             ORDER BY j.sequence LIMIT $2",
        )
        .bind(self.clock().now_us())
        .bind(i64::from(limit))
        .fetch_all(&mut self.reader().await?)
        .await?;
        rows.iter().map(waiting).collect()
    }

    fn lease(&self) -> Option<Duration> {
        Some(LEASE)
    }

    async fn renew_validation(&self, id: Uuid) -> Result<bool> {
        let (owner, until_us) = (self.inner.shared.replica.clone(), self.clock().now_us() + LEASE_US);
        self.write(0, move |connection| {
            let owner = owner.clone();
            Box::pin(async move {
                // Also one that has run out, as long as nobody has taken it up.
                let renewed = sqlx::query(
                    "UPDATE jobs SET lease_until_us = $1 WHERE id = $2 AND lease_owner = $3 AND state = 'validating'",
                )
                .bind(until_us)
                .bind(id.to_string())
                .bind(owner)
                .execute(connection)
                .await?;
                Ok(renewed.rows_affected() == 1)
            })
        })
        .await
    }

    async fn begin_validation(&self, id: Uuid, max_attempts: u32) -> Result<Attempt> {
        let shared = self.inner.shared.clone();
        self.write_event(0, move |tx| Box::pin(begin(tx, id, max_attempts, shared.clone()))).await
    }

    async fn end_validation(&self, id: Uuid, to: JobState, detail: &str, report: Option<NewReport>) -> Result<Job> {
        let report = packed(detail, report, self.settings()).await?.map(Arc::new);
        let payload = report.as_ref().map_or(0, |report| report.report.len());
        let (owner, detail) = (self.inner.shared.replica.clone(), detail.to_owned());
        self.write_event(payload, move |tx| {
            let (owner, detail, report) = (Some(owner.clone()), detail.clone(), report.clone());
            Box::pin(change(tx, id, (WAITING.to_vec(), owner), to, detail, report))
        })
        .await
    }

    async fn return_attempt(&self, id: Uuid) -> Result<()> {
        let owner = self.inner.shared.replica.clone();
        self.write(0, move |connection| {
            let owner = owner.clone();
            Box::pin(async move {
                sqlx::query(
                    "UPDATE jobs SET attempts = GREATEST(attempts - 1, 0), lease_owner = NULL, lease_until_us = NULL
                     WHERE id = $1 AND lease_owner = $2",
                )
                .bind(id.to_string())
                .bind(owner)
                .execute(connection)
                .await?;
                Ok(())
            })
        })
        .await
    }
}

async fn begin(tx: &mut Transaction, id: Uuid, max_attempts: u32, shared: Arc<Shared>) -> Result<Attempt> {
    tx.lock(Log::Event).await?;
    // One that somebody else is just writing to is not waited for: the log is locked.
    let row = sqlx::query(
        "SELECT state, attempts, tenant, lease_owner, lease_until_us FROM jobs WHERE id = $1 FOR NO KEY UPDATE SKIP LOCKED",
    )
    .bind(id.to_string())
    .fetch_optional(&mut tx.connection)
    .await?;
    let Some(row) = row else {
        let there: bool = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM jobs WHERE id = $1)")
            .bind(id.to_string())
            .fetch_one(&mut tx.connection)
            .await?;
        return if there { Ok(Attempt::Elsewhere) } else { Err(missing(id)) };
    };
    let Beginning { from, to, detail, attempts, changed, outcome } = Beginning::of(&row, id, max_attempts)?;
    let now_us = tx.now_us();
    let holder: Option<String> = row.try_get("lease_owner")?;
    let until_us: Option<i64> = row.try_get("lease_until_us")?;
    let of_another = holder.is_some_and(|holder| !shared.holds(&holder));
    if of_another && until_us.is_some_and(|until_us| until_us >= now_us) {
        return Ok(Attempt::Elsewhere);
    }
    let lease = (to == JobState::Validating).then(|| (shared.replica.clone(), now_us + LEASE_US));
    let (owner, until_us) = lease.unzip();
    sqlx::query(
        "UPDATE jobs SET state = $1, state_detail = $2, attempts = $3,
            updated_us = CASE WHEN $4 THEN $5 ELSE updated_us END, revision = revision + $6, lease_owner = $7,
            lease_until_us = $8 WHERE id = $9",
    )
    .bind(to.as_str())
    .bind(&detail)
    .bind(attempts)
    .bind(changed)
    .bind(now_us)
    .bind(i64::from(changed))
    .bind(owner)
    .bind(until_us)
    .bind(id.to_string())
    .execute(&mut tx.connection)
    .await?;
    if changed {
        log(tx, (tenant(&row)?, id), Some(from), Some(to), now_us, &detail).await?;
    }
    Ok(outcome)
}
