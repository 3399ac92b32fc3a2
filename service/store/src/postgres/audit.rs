//! The audit log in PostgreSQL. Its numbers become visible in order, as those of the other logs: who reads on behind an
//! entry misses none.

use async_trait::async_trait;
use sqlx::{PgConnection, Postgres, QueryBuilder};

use super::PostgresStore;
use super::lane::{Log, Transaction};
use crate::audit::{
    Audit, AuditEntry, AuditFilter, AuditRequest, AuditResult, MAX_AUDIT_ENTRIES, MAX_AUDIT_TEXT_BYTES,
};
use crate::error::Result;
use crate::sql::audit::{Order, REMOVED, ROUND, TENANTS, by_tenant, cut, entry, losses};
use crate::sql::record::signed;

/// Numbers a change of an entry. Who changes the log does this first, so that nobody waits for another in a circle.
async fn next_change(tx: &mut Transaction) -> Result<i64> {
    tx.next(Log::AuditChange).await
}

/// Counts entries that a tenant has lost.
async fn count_out(connection: &mut PgConnection, tenant: &str, gone: i64) -> Result<()> {
    sqlx::query("UPDATE audit_tenants SET entries = entries - $1 WHERE tenant = $2")
        .bind(gone)
        .bind(tenant)
        .execute(&mut *connection)
        .await?;
    sqlx::query("DELETE FROM audit_tenants WHERE tenant = $1 AND entries <= 0")
        .bind(tenant)
        .execute(connection)
        .await?;
    Ok(())
}

/// Removes entries beyond the bound, some at a time: the oldest ones of the tenants that have most.
async fn keep_bound(connection: &mut PgConnection, most: i64) -> Result<()> {
    let sql = "SELECT COALESCE(SUM(entries), 0)::BIGINT FROM audit_tenants";
    let all: i64 = sqlx::query_scalar(sql).fetch_one(&mut *connection).await?;
    let excess = (all - most).min(REMOVED);
    if excess <= 0 {
        return Ok(());
    }
    let sql = "SELECT tenant, entries FROM audit_tenants ORDER BY entries DESC, tenant LIMIT $1";
    let counts: Vec<(String, i64)> = sqlx::query_as(sql).bind(TENANTS).fetch_all(&mut *connection).await?;
    for (tenant, lost) in losses(&counts, excess) {
        let gone = sqlx::query(
            "DELETE FROM audit_entries WHERE sequence IN
                (SELECT sequence FROM audit_entries WHERE tenant = $1 ORDER BY sequence LIMIT $2)",
        )
        .bind(tenant)
        .bind(lost)
        .execute(&mut *connection)
        .await?;
        count_out(connection, tenant, gone.rows_affected().cast_signed()).await?;
    }
    Ok(())
}

async fn begin(tx: &mut Transaction, request: AuditRequest, result: Option<AuditResult>, most: i64) -> Result<i64> {
    let change = next_change(tx).await?;
    let sequence = tx.next(Log::Audit).await?;
    let at_us = tx.now_us();
    let ended_us = result.as_ref().map(|_| at_us);
    let result = result.unwrap_or_default();
    // The entry and its count go to the server together.
    sqlx::query(
        "WITH counted AS (INSERT INTO audit_tenants AS counts (tenant, entries) VALUES ($5, 1)
            ON CONFLICT (tenant) DO UPDATE SET entries = counts.entries + 1)
         INSERT INTO audit_entries (sequence, at_us, ended_us, principal, tenant, address, certificate, method, request_id,
            resource, result, reason, occurrences, change) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, 1, $13)",
    )
    .bind(sequence)
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
    .bind(change)
    .execute(&mut tx.connection)
    .await?;
    if sequence % ROUND == 0 {
        keep_bound(&mut tx.connection, most).await?;
    }
    Ok(sequence)
}

async fn end(tx: &mut Transaction, sequence: i64, result: AuditResult) -> Result<()> {
    let change = next_change(tx).await?;
    let at_us = tx.now_us();
    sqlx::query(
        "UPDATE audit_entries SET change = $1, ended_us = $2, resource = $3, result = $4, reason = $5 WHERE sequence = $6",
    )
    .bind(change)
    .bind(at_us)
    .bind(cut(&result.resource))
    .bind(cut(&result.code))
    .bind(cut(&result.reason))
    .bind(sequence)
    .execute(&mut tx.connection)
    .await?;
    Ok(())
}

async fn repeat(tx: &mut Transaction, sequence: i64, times: i64) -> Result<()> {
    let change = next_change(tx).await?;
    let at_us = tx.now_us();
    sqlx::query(
        "UPDATE audit_entries SET change = $1, ended_us = $2, occurrences = occurrences + $3 WHERE sequence = $4",
    )
    .bind(change)
    .bind(at_us)
    .bind(times)
    .bind(sequence)
    .execute(&mut tx.connection)
    .await?;
    Ok(())
}

/// Removes up to `most` entries from before a time, oldest first; how many.
async fn remove_before(tx: &mut Transaction, cutoff_us: i64, most: i64) -> Result<u64> {
    tx.lock(Log::AuditChange).await?;
    let gone: Vec<String> = sqlx::query_scalar(
        "DELETE FROM audit_entries WHERE sequence IN
            (SELECT sequence FROM audit_entries WHERE at_us < $1 ORDER BY sequence LIMIT $2) RETURNING tenant",
    )
    .bind(cutoff_us)
    .bind(most)
    .fetch_all(&mut tx.connection)
    .await?;
    for (tenant, lost) in by_tenant(&gone) {
        count_out(&mut tx.connection, tenant, lost).await?;
    }
    Ok(gone.len() as u64)
}

impl PostgresStore {
    /// Removes up to `most` entries from before a time, oldest first; how many.
    pub(super) async fn remove_audit_before(&self, cutoff_us: i64, most: i64) -> Result<u64> {
        self.write_audit(0, move |tx| Box::pin(remove_before(tx, cutoff_us, most))).await
    }

    async fn entries(&self, order: Order, after: i64, filter: &AuditFilter, limit: u32) -> Result<Vec<AuditEntry>> {
        let column = order.column();
        let mut sql = QueryBuilder::<Postgres>::new(format!("SELECT * FROM audit_entries WHERE {column} > "));
        sql.push_bind(after);
        if let Some(tenant) = &filter.tenant {
            sql.push(" AND tenant = ").push_bind(tenant);
        }
        if let Some(principal) = &filter.principal {
            sql.push(" AND principal = ").push_bind(principal);
        }
        sql.push(format!(" ORDER BY {column} LIMIT ")).push_bind(i64::from(limit.min(MAX_AUDIT_ENTRIES)));
        let rows = sql.build().fetch_all(&mut self.reader().await?).await?;
        rows.iter().map(entry).collect()
    }
}

#[async_trait]
impl Audit for PostgresStore {
    async fn begin_audit(&self, request: AuditRequest, result: Option<AuditResult>) -> Result<i64> {
        let most = signed("entries of the audit log", self.settings().max_audit_entries)?;
        self.write_audit(MAX_AUDIT_TEXT_BYTES, move |tx| Box::pin(begin(tx, request.clone(), result.clone(), most)))
            .await
    }

    async fn end_audit(&self, sequence: i64, result: AuditResult) -> Result<()> {
        self.write_audit(MAX_AUDIT_TEXT_BYTES, move |tx| Box::pin(end(tx, sequence, result.clone()))).await
    }

    async fn repeat_audit(&self, sequence: i64, times: u64) -> Result<()> {
        let times = signed("occurrences", times)?;
        self.write_audit(0, move |tx| Box::pin(repeat(tx, sequence, times))).await
    }

    async fn audit_after(&self, sequence: i64, filter: &AuditFilter, limit: u32) -> Result<Vec<AuditEntry>> {
        self.entries(Order::Sequence, sequence, filter, limit).await
    }

    async fn audit_changed_after(&self, change: i64, filter: &AuditFilter, limit: u32) -> Result<Vec<AuditEntry>> {
        self.entries(Order::Change, change, filter, limit).await
    }
}
