//! Retention in PostgreSQL. Several replicas may remove at the same time: what one has removed, the others do not find.

use async_trait::async_trait;
use sqlx::AssertSqlSafe;

use super::PostgresStore;
use crate::error::Result;
use crate::sql::check::Parameter;
use crate::sql::retention::RetentionSteps;

/// Decisions whose bytes are counted by one statement: well within its time.
const DECISIONS: i64 = 500_000;

#[async_trait]
impl RetentionSteps for PostgresStore {
    async fn number(&self, sql: String, parameter: i64) -> Result<i64> {
        Ok(sqlx::query_scalar(AssertSqlSafe(sql)).bind(parameter).fetch_one(&mut self.reader().await?).await?)
    }

    async fn ids(&self, sql: String, parameter: Parameter<'_>) -> Result<Vec<String>> {
        let query = sqlx::query_scalar(AssertSqlSafe(sql));
        let query = match parameter {
            Parameter::Text(text) => query.bind(text),
            Parameter::Integer(number) => query.bind(number),
        };
        Ok(query.fetch_all(&mut self.reader().await?).await?)
    }

    async fn change(&self, sql: String, parameter: i64) -> Result<u64> {
        self.write(0, move |connection| {
            let sql = sql.clone();
            Box::pin(async move {
                let changed = sqlx::query(AssertSqlSafe(sql)).bind(parameter).execute(connection).await?;
                Ok(changed.rows_affected())
            })
        })
        .await
    }

    async fn remove_audit(&self, cutoff_us: i64, most: i64) -> Result<u64> {
        self.remove_audit_before(cutoff_us, most).await
    }

    /// But for the logs that have bounds of their own and the few behind the last chunk of an unfinished upload: the
    /// server's files shrink later, if at all. Objects count as long as a program refers to them.
    async fn bytes_in_use(&self) -> Result<u64> {
        let bytes: i64 = sqlx::query_scalar(
            "SELECT ((SELECT COALESCE(SUM(OCTET_LENGTH(data)), 0) FROM program_chunks)
                + (SELECT COALESCE(SUM(size_bytes), 0) FROM objects WHERE content_id IS NOT NULL)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(settings) + OCTET_LENGTH(machine_snapshot)), 0) FROM jobs)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(report)), 0) FROM validation_reports)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(snapshot)), 0) FROM job_checkpoints)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(snapshot)), 0) FROM run_checkpoints)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(body)), 0) FROM recorded_cuts)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(monitor)), 0) FROM runs))::BIGINT",
        )
        .fetch_one(&mut self.reader().await?)
        .await?;
        Ok(bytes.unsigned_abs() + self.bytes_of_decisions().await?)
    }

    async fn bytes_of_job(&self, id: &str) -> Result<u64> {
        let sql = "WITH own (id) AS (SELECT id FROM runs WHERE job_id = $1),
                used (content_id) AS (SELECT content_id FROM programs AS p
                    WHERE (p.id IN (SELECT program_id FROM jobs WHERE id = $1) OR p.id IN (SELECT program_id FROM job_programs WHERE job_id = $1))
                    AND NOT EXISTS (SELECT 1 FROM jobs WHERE program_id = p.id AND id <> $1)
                    AND NOT EXISTS (SELECT 1 FROM job_programs WHERE program_id = p.id AND job_id <> $1))
            SELECT ((SELECT COALESCE(SUM(OCTET_LENGTH(data)), 0) FROM program_chunks WHERE content_id IN (SELECT content_id FROM used))
                + (SELECT COALESCE(SUM(size_bytes), 0) FROM objects WHERE content_id IN (SELECT content_id FROM used))
                + (SELECT COALESCE(SUM(OCTET_LENGTH(settings) + OCTET_LENGTH(machine_snapshot)), 0) FROM jobs WHERE id = $1)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(report)), 0) FROM validation_reports WHERE job_id = $1)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(snapshot)), 0) FROM job_checkpoints WHERE job_id = $1)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(snapshot)), 0) FROM run_checkpoints WHERE run_id IN (SELECT id FROM own))
                + (SELECT COALESCE(SUM(OCTET_LENGTH(body)), 0) FROM recorded_cuts WHERE run_id IN (SELECT id FROM own))
                + (SELECT COALESCE(SUM(OCTET_LENGTH(monitor)), 0) FROM runs WHERE job_id = $1)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(body)), 0) FROM decisions WHERE job_id = $1))::BIGINT";
        let bytes: i64 = sqlx::query_scalar(sql).bind(id).fetch_one(&mut self.reader().await?).await?;
        Ok(bytes.unsigned_abs())
    }

    async fn bytes_set_aside(&self, since_us: i64) -> Result<u64> {
        let sql = "WITH new (content_id) AS (
                SELECT p.content_id FROM programs AS p WHERE p.created_us >= $1
                    AND NOT EXISTS (SELECT 1 FROM jobs WHERE program_id = p.id)
                    AND NOT EXISTS (SELECT 1 FROM job_programs WHERE program_id = p.id)
                UNION ALL SELECT content_id FROM uploads)
            SELECT ((SELECT COALESCE(SUM(OCTET_LENGTH(data)), 0) FROM program_chunks WHERE content_id IN (SELECT content_id FROM new))
                + (SELECT COALESCE(SUM(size_bytes), 0) FROM objects WHERE content_id IN (SELECT content_id FROM new)))::BIGINT";
        let bytes: i64 = sqlx::query_scalar(sql).bind(since_us).fetch_one(&mut self.reader().await?).await?;
        Ok(bytes.unsigned_abs())
    }

    async fn give_back(&self) -> Result<()> {
        Ok(())
    }
}

impl PostgresStore {
    /// Bytes of all decisions, which may be more than can be read within the time of one statement.
    async fn bytes_of_decisions(&self) -> Result<u64> {
        let (mut bytes, mut after) = (0, 0);
        loop {
            let sql = "SELECT COALESCE(SUM(OCTET_LENGTH(body)), 0)::BIGINT, MAX(sequence) FROM
                (SELECT body, sequence FROM decisions WHERE sequence > $1 ORDER BY sequence LIMIT $2) AS part";
            let (part, last): (i64, Option<i64>) =
                sqlx::query_as(sql).bind(after).bind(DECISIONS).fetch_one(&mut self.reader().await?).await?;
            let Some(last) = last else { return Ok(bytes) };
            (bytes, after) = (bytes + part.unsigned_abs(), last);
        }
    }
}
