//! Retention in SQLite.

use async_trait::async_trait;
use sqlx::{AssertSqlSafe, Row as _};

use super::SqliteStore;
use crate::error::Result;
use crate::sql::check::Parameter;
use crate::sql::retention::RetentionSteps;

/// Pages given back by one write.
const PAGES: u32 = 1_000;

impl SqliteStore {
    /// Bytes of programs whose jobs may be yet to come, and of unfinished ones.
    async fn bytes_of_new_programs(&self, since_us: i64) -> Result<u64> {
        let sql = "WITH new (content_id) AS (
                SELECT p.content_id FROM programs AS p WHERE p.created_us >= ?
                    AND NOT EXISTS (SELECT 1 FROM jobs WHERE program_id = p.id)
                    AND NOT EXISTS (SELECT 1 FROM job_programs WHERE program_id = p.id)
                UNION ALL SELECT content_id FROM uploads)
            SELECT (SELECT COALESCE(SUM(LENGTH(data)), 0) FROM upload_tails)
            + (SELECT COALESCE(SUM(LENGTH(data)), 0) FROM program_chunks WHERE content_id IN new)
            + (SELECT COALESCE(SUM(size_bytes), 0) FROM objects WHERE content_id IN new)";
        let bytes: i64 = sqlx::query_scalar(sql).bind(since_us).fetch_one(&mut self.reader().await?).await?;
        Ok(bytes.unsigned_abs())
    }

    /// Bytes of the logs that have bounds of their own. It reads all of them.
    async fn bytes_of_logs(&self) -> Result<u64> {
        let bytes: i64 = sqlx::query_scalar(
            "SELECT COALESCE(SUM(pages.pgsize), 0) FROM sqlite_schema AS tree JOIN dbstat AS pages ON pages.name = tree.name
                WHERE tree.tbl_name IN ('audit_entries', 'job_events') AND pages.aggregate = TRUE",
        )
        .fetch_one(&mut self.reader().await?)
        .await?;
        Ok(bytes.unsigned_abs())
    }
}

#[async_trait]
impl RetentionSteps for SqliteStore {
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
        self.write(0, move |tx| {
            Box::pin(async move {
                let changed = sqlx::query(AssertSqlSafe(sql)).bind(parameter).execute(&mut tx.connection).await?;
                Ok(changed.rows_affected())
            })
        })
        .await
    }

    async fn remove_audit(&self, cutoff_us: i64, most: i64) -> Result<u64> {
        self.remove_audit_before(cutoff_us, most).await
    }

    /// Free space is not counted; objects are, as long as a program refers to them.
    async fn bytes_in_use(&self) -> Result<u64> {
        let row = sqlx::query(
            "SELECT (SELECT COALESCE(SUM(size_bytes), 0) FROM objects WHERE content_id IS NOT NULL) AS objects,
                (SELECT page_count FROM pragma_page_count) - (SELECT freelist_count FROM pragma_freelist_count) AS pages,
                (SELECT page_size FROM pragma_page_size) AS bytes",
        )
        .fetch_one(&mut self.reader().await?)
        .await?;
        let [pages, bytes, objects] =
            [row.try_get::<i64, _>("pages")?, row.try_get("bytes")?, row.try_get("objects")?].map(i64::unsigned_abs);
        Ok(pages * bytes + objects)
    }

    async fn bytes_set_aside(&self, since_us: i64) -> Result<u64> {
        Ok(self.bytes_of_logs().await? + self.bytes_of_new_programs(since_us).await?)
    }

    /// Of a database that was made for that.
    async fn give_back(&self) -> Result<()> {
        loop {
            let free = "SELECT freelist_count FROM pragma_freelist_count";
            let before: i64 = sqlx::query_scalar(free).fetch_one(&mut self.reader().await?).await?;
            self.write(0, move |tx| {
                Box::pin(async move {
                    let sql = format!("PRAGMA incremental_vacuum({PAGES})");
                    sqlx::query(AssertSqlSafe(sql)).execute(&mut tx.connection).await?;
                    Ok(())
                })
            })
            .await?;
            let after: i64 = sqlx::query_scalar(free).fetch_one(&mut self.reader().await?).await?;
            if after == 0 || after >= before {
                return Ok(());
            }
        }
    }
}
