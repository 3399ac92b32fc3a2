//! Jobs, their reports and events in SQLite.

use async_trait::async_trait;
use sqlx::{AssertSqlSafe, QueryBuilder, Row, Sqlite, SqliteConnection, SqliteExecutor};
use tokio::sync::watch;
use uuid::Uuid;

use super::SqliteStore;
use super::reader::Reader;
use super::writer::Transaction;
use crate::error::{Kind, Result, StoreError};
use crate::jobs::{
    EventFilter, Fingerprint, Job, JobDetail, JobEvent, JobFilter, JobState, Jobs, MAX_EVENTS, NewJob, NewReport,
    StoredReport,
};
use crate::page::{Page, PageRequest};
use crate::sql::fault::is_reference;
use crate::sql::jobs::{PackedReport, check_new, created, detail, event, job, missing, packed, report, scope, seal};
use crate::sql::logs::{OF_JOB, TenantLog};
use crate::sql::pages::{page_of, sequence_token};
use crate::sql::record::{parsed, tenant, unsigned};
use crate::tenant::Tenant;

macro_rules! job_query {
    ($columns:literal, $rest:literal) => {
        concat!(
            "SELECT j.id, j.sequence, j.request_id, j.fingerprint, j.display_name, j.program_id, p.size_bytes, j.machine_id, j.state,
                j.state_detail, j.created_us, j.updated_us, j.revision, j.attempts, j.tenant, j.owner,
                j.id AS job_id, r.error_count, r.warning_count, r.info_count, r.summary, r.seal AS report_seal ", $columns,
            " FROM jobs AS j LEFT JOIN programs AS p ON p.id = j.program_id
                LEFT JOIN validation_reports AS r ON r.job_id = j.id ",
            $rest
        )
    };
}

async fn find_job(connection: impl SqliteExecutor<'_>, id: Uuid) -> Result<Job> {
    let row = sqlx::query(job_query!("", "WHERE j.id = ?")).bind(id.to_string()).fetch_optional(connection).await?;
    job(&row.ok_or_else(|| missing(id))?)
}

/// Writes an event into the log; its number, which none ever has again.
pub(super) async fn log(
    tx: &mut Transaction,
    (tenant, id): (Tenant, Uuid),
    from: Option<JobState>,
    to: Option<JobState>,
    at_us: i64,
    detail: &str,
) -> Result<i64> {
    let sequence = sqlx::query(
        "INSERT INTO job_events (tenant, job_id, from_state, to_state, at_us, detail) VALUES (?, ?, ?, ?, ?, ?)",
    )
    .bind(tenant.name())
    .bind(id.to_string())
    .bind(from.map(JobState::as_str))
    .bind(to.map(JobState::as_str))
    .bind(at_us)
    .bind(detail)
    .execute(&mut tx.connection)
    .await?
    .last_insert_rowid();
    tx.event_written(sequence);
    Ok(sequence)
}

/// Writes a report in place of an earlier one.
async fn insert_report(connection: &mut SqliteConnection, id: Uuid, report: PackedReport, at_us: i64) -> Result<()> {
    let id = id.to_string();
    let seal = report.seal(&id);
    let [errors, warnings, infos] = report.counts;
    sqlx::query(
        "INSERT OR REPLACE INTO validation_reports
            (job_id, error_count, warning_count, info_count, created_us, summary, report_bytes, report, seal)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(id)
    .bind(errors)
    .bind(warnings)
    .bind(infos)
    .bind(at_us)
    .bind(report.summary)
    .bind(report.report_bytes)
    .bind(report.report)
    .bind(seal)
    .execute(connection)
    .await?;
    Ok(())
}

/// Between which numbers the jobs created from and before these times are, found by the index over times: the list itself
/// goes by numbers. `None` where there are none.
async fn bounds(connection: &mut Reader<'_>, filter: &JobFilter) -> Result<Option<(i64, i64)>> {
    let (from, before) = (filter.created_from_us, filter.created_before_us);
    if from.is_none() && before.is_none() {
        return Ok(Some((0, i64::MAX)));
    }
    let row = sqlx::query(
        "SELECT MIN(sequence) AS first, MAX(sequence) AS last FROM jobs WHERE created_us >= ? AND created_us < ?",
    )
    .bind(from.unwrap_or(i64::MIN))
    .bind(before.unwrap_or(i64::MAX))
    .fetch_one(connection)
    .await?;
    let first: Option<i64> = row.try_get("first")?;
    Ok(first.zip(row.try_get("last")?))
}

fn push_states(sql: &mut QueryBuilder<Sqlite>, states: &[JobState]) {
    sql.push("(");
    let mut list = sql.separated(", ");
    for state in states {
        list.push_bind(state.as_str());
    }
    sql.push(")");
}

#[async_trait]
impl Jobs for SqliteStore {
    async fn create_job(&self, new: NewJob) -> Result<Job> {
        let payload = check_new(&new, self.settings())?;
        self.write(payload, move |tx| Box::pin(create(tx, new))).await
    }

    async fn job(&self, id: Uuid) -> Result<Job> {
        find_job(&mut self.reader().await?, id).await
    }

    async fn job_detail(&self, id: Uuid) -> Result<JobDetail> {
        let row = sqlx::query(job_query!(", j.machine_snapshot, j.settings, j.seal, (SELECT MIN(f.program_id) FROM job_programs AS f WHERE f.job_id = j.id
                AND NOT EXISTS (SELECT 1 FROM programs WHERE programs.id = f.program_id)) AS missing_program", "WHERE j.id = ?"))
            .bind(id.to_string())
            .fetch_optional(&mut self.reader().await?)
            .await?
            .ok_or_else(|| missing(id))?;
        detail(&row)
    }

    async fn job_by_request(&self, tenant: Tenant, request_id: &str) -> Result<Option<(Job, Fingerprint)>> {
        let row = sqlx::query(job_query!("", "WHERE j.request_id = ?"))
            .bind(tenant.key(request_id))
            .fetch_optional(&mut self.reader().await?)
            .await?;
        row.map(|row| Ok((job(&row)?, Fingerprint::stored(row.try_get("fingerprint")?)))).transpose()
    }

    async fn list_jobs(&self, filter: &JobFilter, page: &PageRequest) -> Result<Page<Job>> {
        let scope = scope(filter);
        let size = page.bounded_size();
        let mut reader = self.reader().await?;
        let before = scope.after_sequence(&page.token)?;
        let Some((first, last)) = bounds(&mut reader, filter).await? else {
            return Ok(Page { items: Vec::new(), next_token: None, unreachable: Vec::new() });
        };
        let mut sql = QueryBuilder::<Sqlite>::new(job_query!("", "WHERE j.sequence >= "));
        sql.push_bind(first).push(" AND j.sequence <= ");
        sql.push_bind(before.map_or(last, |before| last.min(before.saturating_sub(1))));
        if let Some(tenant) = filter.tenant {
            sql.push(" AND j.tenant = ").push_bind(tenant.name().to_owned());
        }
        if !filter.states.is_empty() {
            sql.push(" AND j.state IN ");
            push_states(&mut sql, &filter.states);
        }
        if let Some(machine) = &filter.machine_id {
            sql.push(" AND j.machine_id = ").push_bind(machine);
        }
        if let Some(from) = filter.created_from_us {
            // The sign keeps the order of the list from being left for the index over times.
            sql.push(" AND +j.created_us >= ").push_bind(from);
        }
        if let Some(before) = filter.created_before_us {
            sql.push(" AND +j.created_us < ").push_bind(before);
        }
        sql.push(" ORDER BY j.sequence DESC LIMIT ").push_bind(size as i64 + 1);
        let rows = sql.build().fetch(&mut reader);
        page_of(
            rows,
            size,
            job,
            |job| job.summary.as_ref().map_or(0, |summary| summary.get().len()),
            sequence_token(&scope),
        )
        .await
    }

    async fn jobs_in_state(&self, states: &[JobState], limit: u32) -> Result<Vec<Uuid>> {
        let mut sql = QueryBuilder::<Sqlite>::new("SELECT id FROM jobs WHERE state IN ");
        push_states(&mut sql, states);
        sql.push(" ORDER BY sequence LIMIT ").push_bind(limit);
        let rows = sql.build().fetch_all(&mut self.reader().await?).await?;
        rows.iter().map(|row| parsed(row, "id")).collect()
    }

    async fn count_jobs(&self, tenant: Option<Tenant>) -> Result<Vec<(JobState, u64)>> {
        let sql = match tenant {
            Some(_) => "SELECT state, COUNT(*) AS jobs FROM jobs WHERE tenant = ? GROUP BY state",
            None => "SELECT state, COUNT(*) AS jobs FROM jobs GROUP BY state",
        };
        let mut query = sqlx::query(sql);
        if let Some(tenant) = &tenant {
            query = query.bind(tenant.name());
        }
        let rows = query.fetch_all(&mut self.reader().await?).await?;
        rows.iter().map(|row| Ok((parsed(row, "state")?, unsigned(row, "jobs")?))).collect()
    }

    async fn transition(
        &self,
        id: Uuid,
        from: &[JobState],
        to: JobState,
        detail: &str,
        report: Option<NewReport>,
    ) -> Result<Job> {
        let report = packed(detail, report, self.settings()).await?;
        let payload = report.as_ref().map_or(0, |report| report.report.len());
        let (from, detail) = (from.to_vec(), detail.to_owned());
        self.write(payload, move |tx| Box::pin(change(tx, id, from, to, detail, report))).await
    }

    async fn report(&self, id: Uuid) -> Result<StoredReport> {
        let row = sqlx::query("SELECT * FROM validation_reports WHERE job_id = ?")
            .bind(id.to_string())
            .fetch_optional(&mut self.reader().await?)
            .await?;
        let Some(row) = row else {
            self.job(id).await?;
            return Err(StoreError::not_found(Kind::Report, id));
        };
        report(&row, id).await
    }

    async fn delete_job(&self, id: Uuid, etag: Option<&str>) -> Result<()> {
        let etag = etag.map(str::to_owned);
        self.write(0, move |tx| {
            Box::pin(async move {
                let job = find_job(&mut tx.connection, id).await?;
                let current = job.etag();
                if etag.is_some_and(|etag| etag != current) {
                    return Err(StoreError::EtagMismatch { kind: Kind::Job, id: id.to_string(), current });
                }
                let note = AssertSqlSafe(TenantLog::Decisions.note_removal(OF_JOB));
                sqlx::query(note).bind(id.to_string()).execute(&mut tx.connection).await?;
                sqlx::query("DELETE FROM jobs WHERE id = ?").bind(id.to_string()).execute(&mut tx.connection).await?;
                let now_us = tx.now_us();
                log(tx, (job.tenant, id), Some(job.state), None, now_us, "deleted").await.map(drop)
            })
        })
        .await
    }

    async fn events_after(&self, sequence: i64, filter: &EventFilter, limit: u32) -> Result<Vec<JobEvent>> {
        let mut sql = QueryBuilder::<Sqlite>::new("SELECT * FROM job_events WHERE sequence > ");
        sql.push_bind(sequence);
        if let Some(tenant) = filter.tenant {
            sql.push(" AND tenant = ").push_bind(tenant.name().to_owned());
        }
        if let Some(id) = filter.job_id {
            sql.push(" AND job_id = ").push_bind(id.to_string());
        }
        sql.push(" ORDER BY sequence LIMIT ").push_bind(limit.min(MAX_EVENTS));
        let rows = sql.build().fetch_all(&mut self.reader().await?).await?;
        rows.iter().map(event).collect()
    }

    async fn newest_event(&self, tenant: Tenant) -> Result<i64> {
        let newest = sqlx::query_scalar("SELECT COALESCE(MAX(sequence), 0) FROM job_events WHERE tenant = ?");
        Ok(newest.bind(tenant.name()).fetch_one(&mut self.reader().await?).await?)
    }

    fn latest_sequence(&self) -> i64 {
        *self.inner.newest_event.borrow()
    }

    fn watch_events(&self) -> watch::Receiver<i64> {
        self.inner.newest_event.clone()
    }
}

async fn create(tx: &mut Transaction, new: NewJob) -> Result<Job> {
    let earlier = sqlx::query(job_query!("", "WHERE j.request_id = ?"))
        .bind(new.tenant.key(&new.request_id))
        .fetch_optional(&mut tx.connection)
        .await?;
    if let Some(row) = earlier {
        return job(&row)?.repeated(&Fingerprint::stored(row.try_get("fingerprint")?), &new.fingerprint);
    }
    let id = Uuid::now_v7();
    let state = JobState::PendingValidation;
    let now_us = tx.now_us();
    // Its number is that of its first event: who reads on behind a number misses no job, whatever was deleted.
    let sequence = log(tx, (new.tenant, id), None, Some(state), now_us, "").await?;
    let inserted = sqlx::query(
        "INSERT INTO jobs (id, request_id, fingerprint, display_name, program_id, machine_id, state, state_detail,
            created_us, updated_us, revision, settings, machine_snapshot, client, sequence, tenant, owner,
            seal)
         VALUES (?, ?, ?, ?, ?, ?, ?, '', ?, ?, 1, ?, ?, ?, ?, ?, ?, ?)
         RETURNING (SELECT size_bytes FROM programs WHERE id = program_id) AS size_bytes",
    )
    .bind(id.to_string())
    .bind(new.tenant.key(&new.request_id))
    .bind(new.fingerprint.as_bytes().as_slice())
    .bind(&new.display_name)
    .bind(new.program_id.of_tenant(new.tenant).key())
    .bind(&new.machine_id)
    .bind(state.as_str())
    .bind(now_us)
    .bind(now_us)
    .bind(new.settings.get())
    .bind(new.machine_snapshot.get())
    .bind(&new.client)
    .bind(sequence)
    .bind(new.tenant.name())
    .bind(&new.owner)
    .bind(seal(&new, &id.to_string()))
    .fetch_one(&mut tx.connection)
    .await;
    let row = inserted.map_err(|error| {
        if is_reference(&error) { StoreError::not_found(Kind::Program, new.program_id) } else { error.into() }
    })?;
    for further in new.further_program_ids.iter().copied() {
        let inserted = sqlx::query("INSERT OR IGNORE INTO job_programs (job_id, program_id) VALUES (?, ?)")
            .bind(id.to_string())
            .bind(further.of_tenant(new.tenant).key())
            .execute(&mut tx.connection)
            .await;
        inserted.map_err(|error| {
            if is_reference(&error) { StoreError::not_found(Kind::Program, further) } else { error.into() }
        })?;
    }
    let size_bytes = unsigned(&row, "size_bytes")?;
    Ok(created(new, id, sequence, size_bytes, now_us))
}

async fn change(
    tx: &mut Transaction,
    id: Uuid,
    from: Vec<JobState>,
    to: JobState,
    detail: String,
    report: Option<PackedReport>,
) -> Result<Job> {
    let state = sqlx::query("SELECT state, tenant FROM jobs WHERE id = ?")
        .bind(id.to_string())
        .fetch_optional(&mut tx.connection)
        .await?
        .ok_or_else(|| missing(id))?;
    let actual: JobState = parsed(&state, "state")?;
    if !from.contains(&actual) {
        return Err(StoreError::FailedState { job_id: id, actual, expected: from });
    }
    let now_us = tx.now_us();
    sqlx::query("UPDATE jobs SET state = ?, state_detail = ?, updated_us = ?, revision = revision + 1 WHERE id = ?")
        .bind(to.as_str())
        .bind(&detail)
        .bind(now_us)
        .bind(id.to_string())
        .execute(&mut tx.connection)
        .await?;
    if let Some(report) = report {
        insert_report(&mut tx.connection, id, report, now_us).await?;
    }
    log(tx, (tenant(&state)?, id), Some(actual), Some(to), now_us, &detail).await?;
    find_job(&mut tx.connection, id).await
}
