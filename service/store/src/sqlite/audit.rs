//! The audit log in SQLite.

use async_trait::async_trait;
use sqlx::{QueryBuilder, Sqlite, SqliteConnection};

use super::SqliteStore;
use crate::audit::{Audit, AuditEntry, AuditFilter, AuditRequest, AuditResult, MAX_AUDIT_ENTRIES};
use crate::error::Result;
use crate::sql::audit::{Order, REMOVED, ROUND, TENANTS, by_tenant, cut, entry, losses};
use crate::sql::record::signed;

/// Numbers a change of an entry.
async fn next_change(connection: &mut SqliteConnection) -> Result<i64> {
    let sql = "UPDATE counters SET newest = newest + 1 WHERE name = 'audit_change' RETURNING newest";
    Ok(sqlx::query_scalar(sql).fetch_one(connection).await?)
}

/// Counts entries that a tenant has lost.
async fn count_out(connection: &mut SqliteConnection, tenant: &str, gone: i64) -> Result<()> {
    sqlx::query("UPDATE audit_tenants SET entries = entries - ? WHERE tenant = ?")
        .bind(gone)
        .bind(tenant)
        .execute(&mut *connection)
        .await?;
    sqlx::query("DELETE FROM audit_tenants WHERE tenant = ? AND entries <= 0").bind(tenant).execute(connection).await?;
    Ok(())
}

/// Removes entries beyond the bound, some at a time: the oldest ones of the tenants that have most.
async fn keep_bound(connection: &mut SqliteConnection, most: i64) -> Result<()> {
    let sql = "SELECT COALESCE(SUM(entries), 0) FROM audit_tenants";
    let all: i64 = sqlx::query_scalar(sql).fetch_one(&mut *connection).await?;
    let excess = (all - most).min(REMOVED);
    if excess <= 0 {
        return Ok(());
    }
    let sql = "SELECT tenant, entries FROM audit_tenants ORDER BY entries DESC, tenant LIMIT ?";
    let counts: Vec<(String, i64)> = sqlx::query_as(sql).bind(TENANTS).fetch_all(&mut *connection).await?;
    for (tenant, lost) in losses(&counts, excess) {
        let gone = sqlx::query(
            "DELETE FROM audit_entries WHERE sequence IN
                (SELECT sequence FROM audit_entries WHERE tenant = ? ORDER BY sequence LIMIT ?)",
        )
        .bind(tenant)
        .bind(lost)
        .execute(&mut *connection)
        .await?;
        count_out(connection, tenant, gone.rows_affected().cast_signed()).await?;
    }
    Ok(())
}

async fn begin(
    connection: &mut SqliteConnection,
    at_us: i64,
    request: AuditRequest,
    result: Option<AuditResult>,
    most: i64,
) -> Result<i64> {
    let change = next_change(connection).await?;
    let ended_us = result.as_ref().map(|_| at_us);
    let result = result.unwrap_or_default();
    let tenant = cut(&request.tenant);
    let sequence = sqlx::query(
        "INSERT INTO audit_entries (change, at_us, ended_us, principal, tenant, address, certificate, method, request_id,
            resource, result, reason, occurrences) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, 1)",
    )
    .bind(change)
    .bind(at_us)
    .bind(ended_us)
    .bind(cut(&request.principal))
    .bind(&*tenant)
    .bind(cut(&request.address))
    .bind(cut(&request.certificate))
    .bind(cut(&request.method))
    .bind(cut(&request.request_id))
    .bind(cut(&result.resource))
    .bind(cut(&result.code))
    .bind(cut(&result.reason))
    .execute(&mut *connection)
    .await?
    .last_insert_rowid();
    sqlx::query(
        "INSERT INTO audit_tenants (tenant, entries) VALUES (?, 1)
         ON CONFLICT (tenant) DO UPDATE SET entries = entries + 1",
    )
    .bind(&*tenant)
    .execute(&mut *connection)
    .await?;
    if sequence % ROUND == 0 {
        keep_bound(connection, most).await?;
    }
    Ok(sequence)
}

async fn end(connection: &mut SqliteConnection, at_us: i64, sequence: i64, result: AuditResult) -> Result<()> {
    let change = next_change(connection).await?;
    sqlx::query(
        "UPDATE audit_entries SET change = ?, ended_us = ?, resource = ?, result = ?, reason = ? WHERE sequence = ?",
    )
    .bind(change)
    .bind(at_us)
    .bind(cut(&result.resource))
    .bind(cut(&result.code))
    .bind(cut(&result.reason))
    .bind(sequence)
    .execute(connection)
    .await?;
    Ok(())
}

async fn repeat(connection: &mut SqliteConnection, at_us: i64, sequence: i64, times: i64) -> Result<()> {
    let change = next_change(connection).await?;
    sqlx::query("UPDATE audit_entries SET change = ?, ended_us = ?, occurrences = occurrences + ? WHERE sequence = ?")
        .bind(change)
        .bind(at_us)
        .bind(times)
        .bind(sequence)
        .execute(connection)
        .await?;
    Ok(())
}

impl SqliteStore {
    /// Removes up to `most` entries from before a time, oldest first; how many.
    pub(super) async fn remove_audit_before(&self, cutoff_us: i64, most: i64) -> Result<u64> {
        self.write(0, move |tx| {
            Box::pin(async move {
                let gone: Vec<String> = sqlx::query_scalar(
                    "DELETE FROM audit_entries WHERE sequence IN
                        (SELECT sequence FROM audit_entries WHERE at_us < ? ORDER BY sequence LIMIT ?) RETURNING tenant",
                )
                .bind(cutoff_us)
                .bind(most)
                .fetch_all(&mut tx.connection)
                .await?;
                for (tenant, lost) in by_tenant(&gone) {
                    count_out(&mut tx.connection, tenant, lost).await?;
                }
                Ok(gone.len() as u64)
            })
        })
        .await
    }

    async fn entries(&self, order: Order, after: i64, filter: &AuditFilter, limit: u32) -> Result<Vec<AuditEntry>> {
        let column = order.column();
        let mut sql = QueryBuilder::<Sqlite>::new(format!("SELECT * FROM audit_entries WHERE {column} > "));
        sql.push_bind(after);
        if let Some(tenant) = &filter.tenant {
            sql.push(" AND tenant = ").push_bind(tenant);
        }
        if let Some(principal) = &filter.principal {
            sql.push(" AND principal = ").push_bind(principal);
        }
        sql.push(format!(" ORDER BY {column} LIMIT ")).push_bind(limit.min(MAX_AUDIT_ENTRIES));
        let rows = sql.build().fetch_all(&mut self.reader().await?).await?;
        rows.iter().map(entry).collect()
    }
}

#[async_trait]
impl Audit for SqliteStore {
    async fn begin_audit(&self, request: AuditRequest, result: Option<AuditResult>) -> Result<i64> {
        let most = signed("entries of the audit log", self.settings().max_audit_entries)?;
        self.write(0, move |tx| {
            let at_us = tx.now_us();
            Box::pin(begin(&mut tx.connection, at_us, request, result, most))
        })
        .await
    }

    async fn end_audit(&self, sequence: i64, result: AuditResult) -> Result<()> {
        self.write(0, move |tx| {
            let at_us = tx.now_us();
            Box::pin(end(&mut tx.connection, at_us, sequence, result))
        })
        .await
    }

    async fn repeat_audit(&self, sequence: i64, times: u64) -> Result<()> {
        let times = signed("occurrences", times)?;
        self.write(0, move |tx| {
            let at_us = tx.now_us();
            Box::pin(repeat(&mut tx.connection, at_us, sequence, times))
        })
        .await
    }

    async fn audit_after(&self, sequence: i64, filter: &AuditFilter, limit: u32) -> Result<Vec<AuditEntry>> {
        self.entries(Order::Sequence, sequence, filter, limit).await
    }

    async fn audit_changed_after(&self, change: i64, filter: &AuditFilter, limit: u32) -> Result<Vec<AuditEntry>> {
        self.entries(Order::Change, change, filter, limit).await
    }
}
