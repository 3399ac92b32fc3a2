//! The audit log in PostgreSQL. Its numbers become visible in order, as those of the other logs: who reads on behind an
//! entry misses none.

use async_trait::async_trait;
use sqlx::{Postgres, QueryBuilder};

use super::PostgresStore;
use super::lane::{Log, Transaction};
use crate::audit::{
    Audit, AuditEntry, AuditFilter, AuditRequest, AuditResult, MAX_AUDIT_ENTRIES, MAX_AUDIT_TEXT_BYTES,
};
use crate::error::Result;
use crate::sql::audit::{REMOVED, ROUND, cut, entry};
use crate::sql::record::signed;

async fn begin(tx: &mut Transaction, request: AuditRequest, result: Option<AuditResult>, most: i64) -> Result<i64> {
    let sequence = tx.next(Log::Audit).await?;
    let at_us = tx.now_us();
    let ended_us = result.as_ref().map(|_| at_us);
    let result = result.unwrap_or_default();
    sqlx::query(
        "INSERT INTO audit_entries (sequence, at_us, ended_us, principal, tenant, address, certificate, method, request_id,
            resource, result, reason, occurrences) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, 1)",
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
    .execute(&mut tx.connection)
    .await?;
    if sequence % ROUND == 0 {
        sqlx::query(
            "DELETE FROM audit_entries WHERE sequence IN
                (SELECT sequence FROM audit_entries WHERE sequence <= $1 ORDER BY sequence LIMIT $2)",
        )
        .bind(sequence.saturating_sub(most))
        .bind(REMOVED)
        .execute(&mut tx.connection)
        .await?;
    }
    Ok(sequence)
}

async fn end(tx: &mut Transaction, sequence: i64, result: AuditResult) -> Result<()> {
    let at_us = tx.now_us();
    sqlx::query("UPDATE audit_entries SET ended_us = $1, resource = $2, result = $3, reason = $4 WHERE sequence = $5")
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
    let at_us = tx.now_us();
    sqlx::query("UPDATE audit_entries SET ended_us = $1, occurrences = occurrences + $2 WHERE sequence = $3")
        .bind(at_us)
        .bind(times)
        .bind(sequence)
        .execute(&mut tx.connection)
        .await?;
    Ok(())
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
        let mut sql = QueryBuilder::<Postgres>::new("SELECT * FROM audit_entries WHERE sequence > ");
        sql.push_bind(sequence);
        if let Some(tenant) = &filter.tenant {
            sql.push(" AND tenant = ").push_bind(tenant);
        }
        if let Some(principal) = &filter.principal {
            sql.push(" AND principal = ").push_bind(principal);
        }
        sql.push(" ORDER BY sequence LIMIT ").push_bind(i64::from(limit.min(MAX_AUDIT_ENTRIES)));
        let rows = sql.build().fetch_all(&mut *self.reader().await?).await?;
        rows.iter().map(entry).collect()
    }
}
