//! The audit log in SQLite.

use async_trait::async_trait;
use sqlx::{QueryBuilder, Sqlite, SqliteConnection};

use super::SqliteStore;
use crate::audit::{
    Audit, AuditEntry, AuditFilter, AuditRequest, AuditResult, MAX_AUDIT_ENTRIES, MAX_AUDIT_TEXT_BYTES,
};
use crate::error::Result;
use crate::sql::audit::{REMOVED, ROUND, cut, entry};
use crate::sql::record::signed;

/// Removes the oldest entries beyond the bound, some at a time.
async fn remove_oldest(connection: &mut SqliteConnection, newest: i64, most: i64) -> Result<()> {
    sqlx::query(
        "DELETE FROM audit_entries WHERE sequence IN
            (SELECT sequence FROM audit_entries WHERE sequence <= ? ORDER BY sequence LIMIT ?)",
    )
    .bind(newest.saturating_sub(most))
    .bind(REMOVED)
    .execute(connection)
    .await?;
    Ok(())
}

#[async_trait]
impl Audit for SqliteStore {
    async fn begin_audit(&self, request: AuditRequest, result: Option<AuditResult>) -> Result<i64> {
        let most = signed("entries of the audit log", self.settings().max_audit_entries)?;
        self.write(MAX_AUDIT_TEXT_BYTES, move |tx| {
            Box::pin(async move {
                let at_us = tx.now_us();
                let ended_us = result.as_ref().map(|_| at_us);
                let result = result.unwrap_or_default();
                let sequence = sqlx::query(
                    "INSERT INTO audit_entries (at_us, ended_us, principal, tenant, address, certificate, method, request_id,
                        resource, result, reason, occurrences) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, 1)",
                )
                .bind(at_us)
                .bind(ended_us)
                .bind(cut(&request.principal))
                .bind(cut(&request.tenant))
                .bind(cut(&request.address))
                .bind(cut(&request.certificate))
                .bind(cut(&request.method))
                .bind(cut(&request.request_id))
                .bind(cut(&result.resource))
                .bind(cut(&result.code))
                .bind(cut(&result.reason))
                .execute(&mut tx.connection)
                .await?
                .last_insert_rowid();
                if sequence % ROUND == 0 {
                    remove_oldest(&mut tx.connection, sequence, most).await?;
                }
                Ok(sequence)
            })
        })
        .await
    }

    async fn end_audit(&self, sequence: i64, result: AuditResult) -> Result<()> {
        self.write(MAX_AUDIT_TEXT_BYTES, move |tx| {
            Box::pin(async move {
                let at_us = tx.now_us();
                sqlx::query(
                    "UPDATE audit_entries SET ended_us = ?, resource = ?, result = ?, reason = ? WHERE sequence = ?",
                )
                .bind(at_us)
                .bind(cut(&result.resource))
                .bind(cut(&result.code))
                .bind(cut(&result.reason))
                .bind(sequence)
                .execute(&mut tx.connection)
                .await?;
                Ok(())
            })
        })
        .await
    }

    async fn repeat_audit(&self, sequence: i64, times: u64) -> Result<()> {
        let times = signed("occurrences", times)?;
        self.write(0, move |tx| {
            Box::pin(async move {
                let at_us = tx.now_us();
                sqlx::query("UPDATE audit_entries SET ended_us = ?, occurrences = occurrences + ? WHERE sequence = ?")
                    .bind(at_us)
                    .bind(times)
                    .bind(sequence)
                    .execute(&mut tx.connection)
                    .await?;
                Ok(())
            })
        })
        .await
    }

    async fn audit_after(&self, sequence: i64, filter: &AuditFilter, limit: u32) -> Result<Vec<AuditEntry>> {
        let mut sql = QueryBuilder::<Sqlite>::new("SELECT * FROM audit_entries WHERE sequence > ");
        sql.push_bind(sequence);
        if let Some(tenant) = &filter.tenant {
            sql.push(" AND tenant = ").push_bind(tenant);
        }
        if let Some(principal) = &filter.principal {
            sql.push(" AND principal = ").push_bind(principal);
        }
        sql.push(" ORDER BY sequence LIMIT ").push_bind(limit.min(MAX_AUDIT_ENTRIES));
        let rows = sql.build().fetch_all(&mut *self.reader().await?).await?;
        rows.iter().map(entry).collect()
    }
}
