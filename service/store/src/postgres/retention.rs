//! Retention in PostgreSQL. Several replicas may remove at the same time: what one has removed, the others do not find.

use async_trait::async_trait;
use sqlx::AssertSqlSafe;

use super::PostgresStore;
use crate::error::Result;
use crate::sql::check::Parameter;
use crate::sql::retention::RetentionSteps;

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
                + (SELECT COALESCE(SUM(OCTET_LENGTH(monitor)), 0) FROM runs)
                + (SELECT COALESCE(SUM(OCTET_LENGTH(body)), 0) FROM decisions))::BIGINT",
        )
        .fetch_one(&mut self.reader().await?)
        .await?;
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
