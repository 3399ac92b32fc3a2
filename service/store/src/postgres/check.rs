//! Whether every record of a database is as it was written. Its pages, indices and references are the server's to verify.

use async_trait::async_trait;
use sqlx::postgres::PgRow;
use sqlx::{Connection as _, PgConnection};

use super::PostgresOptions;
use super::open::connect_unchanged;
use crate::error::{Result, StoreError};
use crate::maintenance::{CheckReport, ReadDecision};
use crate::sql::check::{Check, Parameter, Verified};

/// See [`crate::check`].
pub(crate) async fn check(options: &PostgresOptions, read_decision: ReadDecision) -> Result<CheckReport> {
    let mut connection = connect_unchanged(options).await?;
    sqlx::query("SET default_transaction_read_only = on").execute(&mut connection).await?;
    let mut check = Check::new(connection, read_decision);
    check.records().await?;
    check.database.close().await?;
    Ok(check.report)
}

#[async_trait]
impl Verified for PgConnection {
    type Row = PgRow;

    const NEWEST_EVENT: &'static str = "SELECT newest FROM counters WHERE name = 'event'";

    async fn rows(&mut self, sql: &'static str, parameters: &[Parameter<'_>]) -> Result<Vec<PgRow>> {
        let mut query = sqlx::query(sql);
        for parameter in parameters {
            query = match *parameter {
                Parameter::Text(text) => query.bind(text.to_owned()),
                Parameter::Integer(integer) => query.bind(integer),
            };
        }
        Ok(query.fetch_all(self).await?)
    }

    fn is_damage(error: &StoreError) -> bool {
        // A server that is away, or a connection that breaks, has not damaged anything.
        matches!(error, StoreError::Corrupt { .. })
    }
}
