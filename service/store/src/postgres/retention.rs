//! Retention in PostgreSQL. Several replicas may remove at the same time: what one has removed, the others do not find.

use std::time::Duration;

use async_trait::async_trait;
use sqlx::AssertSqlSafe;
use uuid::Uuid;

use super::PostgresStore;
use crate::error::{Result, StoreError};
use crate::programs::{ProgramKey, Programs as _};
use crate::retention::{Removed, Retention, RetentionPolicy};
use crate::sql::record::parsed;

/// Records removed by one write.
const BATCH: i64 = 100;

/// Programs younger than this are not removed for the sake of size: their jobs may be yet to come.
const UNUSED: Duration = Duration::from_secs(3_600);

/// Jobs that may go and were changed before a time.
const JOBS: &str = "FROM jobs AS j WHERE j.state IN ('ready', 'rejected', 'cancelled', 'failed') AND j.updated_us < $1
    AND NOT EXISTS (SELECT 1 FROM runs AS r WHERE r.job_id = j.id AND r.state = 'open')";
const RUNS: &str = "FROM runs AS j WHERE j.state <> 'open' AND j.updated_us < $1";
const PROGRAMS: &str = "FROM programs AS j WHERE j.created_us < $1
    AND NOT EXISTS (SELECT 1 FROM jobs WHERE program_id = j.id)
    AND NOT EXISTS (SELECT 1 FROM job_programs WHERE program_id = j.id)";
const EVENTS: &str = "FROM job_events AS j WHERE j.at_us < $1";
const AUDIT: &str = "FROM audit_entries AS j WHERE j.at_us < $1";

impl PostgresStore {
    fn cutoff(&self, age: Option<Duration>) -> Option<i64> {
        let age_us = i64::try_from(age?.as_micros()).unwrap_or(i64::MAX);
        Some(self.clock().now_us().saturating_sub(age_us))
    }

    async fn count(&self, from: &str, age: Option<Duration>) -> Result<u64> {
        let Some(cutoff) = self.cutoff(age) else { return Ok(0) };
        let sql = format!("SELECT COUNT(*) {from}");
        let count: i64 =
            sqlx::query_scalar(AssertSqlSafe(sql)).bind(cutoff).fetch_one(&mut self.reader().await?).await?;
        Ok(count.unsigned_abs())
    }

    /// Removes records, oldest first; how many.
    async fn remove(&self, table: &'static str, from: &'static str, cutoff: i64) -> Result<u64> {
        let mut removed = 0;
        loop {
            let gone = self
                .write(0, move |connection| {
                    Box::pin(async move {
                        let sql = format!(
                            "DELETE FROM {table} WHERE sequence IN
                                (SELECT j.sequence {from} ORDER BY j.sequence LIMIT {BATCH})"
                        );
                        let gone = sqlx::query(AssertSqlSafe(sql)).bind(cutoff).execute(connection).await?;
                        Ok(gone.rows_affected())
                    })
                })
                .await?;
            removed += gone;
            if gone < BATCH.unsigned_abs() {
                return Ok(removed);
            }
        }
    }

    /// Removes the oldest jobs, at most so many; they are logged as deleted.
    async fn remove_jobs(&self, cutoff: i64, most: i64) -> Result<u64> {
        let sql = format!("SELECT j.id {JOBS} ORDER BY j.sequence LIMIT {most}");
        let rows = sqlx::query(AssertSqlSafe(sql)).bind(cutoff).fetch_all(&mut self.reader().await?).await?;
        let mut removed = 0;
        for row in &rows {
            let id: Uuid = parsed(row, "id")?;
            match crate::Jobs::delete_job(self, id, None).await {
                Ok(()) => removed += 1,
                Err(StoreError::NotFound { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(removed)
    }

    /// Removes the oldest job that may go, with the programs that no other one uses: whatever their age, theirs has come.
    async fn remove_oldest_job(&self, removed: &mut Removed) -> Result<bool> {
        let sql = format!("SELECT j.id {JOBS} ORDER BY j.sequence LIMIT 1");
        let row = sqlx::query(AssertSqlSafe(sql)).bind(i64::MAX).fetch_optional(&mut self.reader().await?).await?;
        let Some(row) = row else { return Ok(false) };
        let id: Uuid = parsed(&row, "id")?;
        let used = "SELECT program_id AS id FROM jobs WHERE id = $1
            UNION SELECT program_id FROM job_programs WHERE job_id = $1";
        let used = sqlx::query(used).bind(id.to_string()).fetch_all(&mut self.reader().await?).await?;
        match crate::Jobs::delete_job(self, id, None).await {
            Ok(()) => removed.jobs += 1,
            Err(StoreError::NotFound { .. }) => {}
            Err(error) => return Err(error),
        }
        for row in &used {
            let ProgramKey(program) = parsed(row, "id")?;
            match self.delete_program(program).await {
                Ok(()) => removed.programs += 1,
                Err(StoreError::NotFound { .. } | StoreError::InUse { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(true)
    }

    /// Bytes of programs whose jobs may be yet to come, and of unfinished ones. No job goes to make room for them.
    async fn bytes_of_new_programs(&self) -> Result<u64> {
        let sql = "SELECT COALESCE(SUM(OCTET_LENGTH(data)), 0)::BIGINT FROM program_chunks WHERE content_id IN (
            SELECT p.content_id FROM programs AS p WHERE p.created_us >= $1
                AND NOT EXISTS (SELECT 1 FROM jobs WHERE program_id = p.id)
                AND NOT EXISTS (SELECT 1 FROM job_programs WHERE program_id = p.id)
            UNION ALL SELECT content_id FROM uploads)";
        let since = self.cutoff(Some(UNUSED)).unwrap_or(i64::MIN);
        let bytes: i64 = sqlx::query_scalar(sql).bind(since).fetch_one(&mut self.reader().await?).await?;
        Ok(bytes.unsigned_abs())
    }

    async fn remove_programs(&self, cutoff: i64) -> Result<u64> {
        let mut removed = 0;
        loop {
            let sql = format!("SELECT j.id {PROGRAMS} ORDER BY j.sequence LIMIT {BATCH}");
            let rows = sqlx::query(AssertSqlSafe(sql)).bind(cutoff).fetch_all(&mut self.reader().await?).await?;
            let before = removed;
            for row in &rows {
                let ProgramKey(id) = parsed(row, "id")?;
                match self.delete_program(id).await {
                    Ok(()) => removed += 1,
                    // A job was created with it meanwhile.
                    Err(StoreError::NotFound { .. } | StoreError::InUse { .. }) => {}
                    Err(error) => return Err(error),
                }
            }
            if rows.len() < BATCH as usize || removed == before {
                return Ok(removed);
            }
        }
    }

    /// Removes the oldest jobs that have ended, and the programs that no job uses then, until what is kept of them has no
    /// more than so many bytes.
    async fn remove_beyond(&self, bytes: u64, removed: &mut Removed) -> Result<()> {
        if self.bytes_in_use().await? <= bytes {
            return Ok(());
        }
        removed.programs += self.remove_programs(self.cutoff(Some(UNUSED)).unwrap_or(i64::MAX)).await?;
        let most = bytes.saturating_add(self.bytes_of_new_programs().await?);
        while self.bytes_in_use().await? > most && self.remove_oldest_job(removed).await? {}
        Ok(())
    }

    /// Bytes of what is kept, but for the logs that have bounds of their own and the few behind the last chunk of an
    /// unfinished upload: the server's files shrink later, if at all.
    async fn bytes_in_use(&self) -> Result<u64> {
        let bytes: i64 = sqlx::query_scalar(
            "SELECT ((SELECT COALESCE(SUM(OCTET_LENGTH(data)), 0) FROM program_chunks)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(settings) + OCTET_LENGTH(machine_snapshot)), 0) FROM jobs)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(report)), 0) FROM validation_reports)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(snapshot)), 0) FROM job_checkpoints)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(snapshot)), 0) FROM run_checkpoints)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(body)), 0) FROM recorded_cuts)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(monitor)), 0) FROM runs)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(body)), 0) FROM decisions))::BIGINT",
        )
        .fetch_one(&mut self.reader().await?)
        .await?;
        Ok(bytes.unsigned_abs())
    }
}

#[async_trait]
impl Retention for PostgresStore {
    async fn expired(&self, policy: &RetentionPolicy) -> Result<Removed> {
        Ok(Removed {
            jobs: self.count(JOBS, policy.jobs).await?,
            runs: self.count(RUNS, policy.runs).await?,
            programs: self.count(PROGRAMS, policy.programs).await?,
            events: self.count(EVENTS, policy.events).await?,
            audit: self.count(AUDIT, policy.audit).await?,
        })
    }

    async fn remove_expired(&self, policy: &RetentionPolicy) -> Result<Removed> {
        let mut removed = Removed::default();
        if let Some(cutoff) = self.cutoff(policy.runs) {
            removed.runs = self.remove("runs", RUNS, cutoff).await?;
        }
        if let Some(cutoff) = self.cutoff(policy.jobs) {
            loop {
                let gone = self.remove_jobs(cutoff, BATCH).await?;
                removed.jobs += gone;
                if gone == 0 {
                    break;
                }
            }
        }
        if let Some(cutoff) = self.cutoff(policy.programs) {
            removed.programs = self.remove_programs(cutoff).await?;
        }
        if let Some(cutoff) = self.cutoff(policy.events) {
            removed.events = self.remove("job_events", EVENTS, cutoff).await?;
        }
        if let Some(cutoff) = self.cutoff(policy.audit) {
            loop {
                let gone = self.remove_audit(cutoff, BATCH).await?;
                removed.audit += gone;
                if gone < BATCH.unsigned_abs() {
                    break;
                }
            }
        }
        if let Some(bytes) = policy.bytes {
            self.remove_beyond(bytes, &mut removed).await?;
        }
        Ok(removed)
    }
}
