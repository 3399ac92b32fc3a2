//! Whether a file and every record in it are as they were written.

use std::path::Path;

use async_trait::async_trait;
use sqlx::sqlite::SqliteRow;
use sqlx::{Row as _, SqliteConnection};

use super::connect;
use crate::error::{Result, StoreError};
use crate::maintenance::{CheckReport, ReadDecision};
use crate::sql::check::{Check, FILE, Parameter, Verified};
use crate::sqlite::reading::Reading;

/// See [`crate::check`].
pub(crate) async fn check(path: &Path, read_decision: ReadDecision) -> Result<CheckReport> {
    let report = checked(path, read_decision).await;
    if report.as_ref().is_ok_and(CheckReport::is_intact) {
        return report;
    }
    // What could not be read is not known to be damaged.
    Reading::default().fault(path).await.map_or(report, Err)
}

async fn checked(path: &Path, read_decision: ReadDecision) -> Result<CheckReport> {
    let mut connection = connect(path).await?;
    sqlx::query("PRAGMA query_only = ON").execute(&mut connection).await?;
    let mut check = Check::new(connection, read_decision);
    check.file().await;
    check.records().await?;
    sqlx::Connection::close(check.database).await?;
    Ok(check.report)
}

#[async_trait]
impl Verified for SqliteConnection {
    type Row = SqliteRow;

    const NEWEST_EVENT: &'static str = "SELECT seq AS newest FROM sqlite_sequence WHERE name = 'job_events'";

    async fn rows(&mut self, sql: &'static str, parameters: &[Parameter<'_>]) -> Result<Vec<SqliteRow>> {
        let mut query = sqlx::query(sql);
        for parameter in parameters {
            query = match *parameter {
                Parameter::Text(text) => query.bind(text.to_owned()),
                Parameter::Integer(integer) => query.bind(integer),
            };
        }
        Ok(query.fetch_all(self).await?)
    }

    fn is_damage(_: &StoreError) -> bool {
        // There is nothing between it and the file.
        true
    }
}

impl Check<SqliteConnection> {
    async fn file(&mut self) {
        let lines: Vec<String> = sqlx::query_scalar("PRAGMA integrity_check(100)")
            .fetch_all(&mut self.database)
            .await
            .unwrap_or_else(|error| vec![error.to_string()]);
        for line in lines.into_iter().filter(|line| line != "ok") {
            self.problem("file", "", line, FILE);
        }
        let broken = sqlx::query("PRAGMA foreign_key_check").fetch_all(&mut self.database).await;
        for row in broken.unwrap_or_default() {
            let table: String = row.try_get("table").unwrap_or_default();
            let parent: String = row.try_get("parent").unwrap_or_default();
            let id = row.try_get::<Option<i64>, _>("rowid").ok().flatten().unwrap_or_default();
            self.problem("file", format!("{table} {id}"), format!("what it refers to in {parent} is missing"), FILE);
        }
    }
}
