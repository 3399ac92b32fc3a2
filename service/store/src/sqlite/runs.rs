//! Runs and their decisions in SQLite.

mod checkpoints;
mod commit;

use std::ops::Range;

use async_trait::async_trait;
use bytes::Bytes;
use sqlx::sqlite::SqliteRow;
use sqlx::{QueryBuilder, Sqlite, SqliteConnection, SqliteExecutor};
use tokio::sync::watch;
use uuid::Uuid;

use self::commit::write;
use super::SqliteStore;
use super::writer::Transaction;
use crate::Json;
use crate::error::{Kind, Result, StoreError, check_size};
use crate::page::{Page, PageRequest};
use crate::runs::{
    Acknowledgement, AttachedRun, DecisionFilter, DecisionRecord, MAX_DECISIONS, MAX_LISTED, MachineRuns, NewRun,
    OpenCondition, RecordedCutHead, Run, RunCheckpoint, RunCommit, RunCondition, RunMark, RunOverride, RunState, Runs,
    TelemetryGap,
};
use crate::sql::fault::is_reference;
use crate::sql::pages::{page_of, sequence_token};
use crate::sql::record::{signed, unsigned};
use crate::sql::runs::{
    MACHINE_RUNS, Packed, acknowledged, change, check_acknowledgement, condition, decision, gap, machine_runs, missing,
    monitor, monitoring, monitoring_seal, open_condition, open_conditions_query, pack, recorded_cut, recorded_cut_head,
    run, run_seal, scope,
};
use crate::tenant::Tenant;

/// Tells of a run in its job's log of events.
async fn tell(tx: &mut Transaction, run_id: &str, message: &str) -> Result<()> {
    let at_us = tx.now_us();
    let sequence = sqlx::query(
        "INSERT INTO job_events (tenant, job_id, from_state, to_state, at_us, detail)
         SELECT j.tenant, j.id, j.state, j.state, ?, ? FROM jobs AS j JOIN runs AS r ON r.job_id = j.id WHERE r.id = ?",
    )
    .bind(at_us)
    .bind(message)
    .bind(run_id)
    .execute(&mut tx.connection)
    .await?
    .last_insert_rowid();
    tx.event_written(sequence);
    Ok(())
}

/// Everything of a run but the state of its monitor.
macro_rules! run_query {
    ($rest:literal) => {
        concat!(
            "SELECT id, tenant, sequence, job_id, kind, state, state_detail, created_us, updated_us, newest_batch, setpoints_received,
                setpoints_sent, setpoints_digest, settings, attachment, seal,
                (SELECT COUNT(*) FROM run_conditions AS c WHERE c.run_id = runs.id AND c.acknowledged_us IS NULL)
                    AS open_conditions
             FROM runs ",
            $rest
        )
    };
}

async fn find_run(connection: impl SqliteExecutor<'_>, id: Uuid) -> Result<Run> {
    let row = sqlx::query(run_query!("WHERE id = ?")).bind(id.to_string()).fetch_optional(connection).await?;
    run(&row.ok_or_else(|| missing(id))?)
}

async fn find_overrides(connection: impl SqliteExecutor<'_>, id: Uuid) -> Result<Vec<RunOverride>> {
    let rows = sqlx::query("SELECT * FROM run_overrides WHERE run_id = ? ORDER BY number")
        .bind(id.to_string())
        .fetch_all(connection)
        .await?;
    rows.iter().map(change).collect()
}

/// Takes a run up: what is left to do with a run that exists.
async fn take_up(tx: &mut Transaction, id: Uuid) -> Result<(Run, u64, SqliteRow)> {
    let now_us = tx.now_us();
    let row = sqlx::query(
        "UPDATE runs SET attachment = attachment + 1, updated_us = ? WHERE id = ? AND state = 'open'
         RETURNING attachment, monitor_bytes, monitor",
    )
    .bind(now_us)
    .bind(id.to_string())
    .fetch_optional(&mut tx.connection)
    .await?;
    let run = find_run(&mut tx.connection, id).await?;
    match row {
        Some(row) => Ok((run, unsigned(&row, "attachment")?, row)),
        None => Err(StoreError::RunEnded { run_id: id, state: run.state }),
    }
}

/// Why a commit found no run to write to.
async fn refusal(connection: &mut SqliteConnection, id: Uuid) -> Result<StoreError> {
    let run = find_run(connection, id).await?;
    Ok(match run.state {
        RunState::Open => StoreError::Detached { run_id: id },
        state => StoreError::RunEnded { run_id: id, state },
    })
}

#[async_trait]
impl Runs for SqliteStore {
    async fn put_monitoring(&self, job_id: Uuid, config: Json) -> Result<()> {
        let what = "monitoring configuration size in bytes";
        check_size(what, config.get().len(), self.settings().max_document_bytes)?;
        self.write(config.get().len(), move |tx| {
            Box::pin(async move {
                let now_us = tx.now_us();
                let written = sqlx::query(
                    "INSERT OR REPLACE INTO monitoring (job_id, updated_us, config, seal) VALUES (?, ?, ?, ?)",
                )
                .bind(job_id.to_string())
                .bind(now_us)
                .bind(config.get())
                .bind(monitoring_seal(&job_id.to_string(), &config))
                .execute(&mut tx.connection)
                .await;
                match written {
                    Err(error) if is_reference(&error) => Err(StoreError::not_found(Kind::Job, job_id)),
                    written => Ok(written.map(drop)?),
                }
            })
        })
        .await
    }

    async fn monitoring(&self, job_id: Uuid) -> Result<Json> {
        let mut reader = self.reader().await?;
        let row =
            sqlx::query("SELECT j.id AS job_id, m.config, m.seal FROM jobs AS j LEFT JOIN monitoring AS m ON m.job_id = j.id WHERE j.id = ?")
                .bind(job_id.to_string())
                .fetch_optional(&mut reader)
                .await?
                .ok_or_else(|| StoreError::not_found(Kind::Job, job_id))?;
        monitoring(&row, job_id)
    }

    async fn create_run(&self, new: NewRun) -> Result<AttachedRun> {
        check_size("run settings size in bytes", new.settings.get().len(), self.settings().max_document_bytes)?;
        check_size("monitor size in bytes", new.monitor.len(), self.settings().max_snapshot_bytes)?;
        let NewRun { job_id, kind, settings, monitor } = new;
        let (monitor_bytes, packed) = pack(monitor.clone()).await?;
        let payload = packed.len() + settings.get().len();
        self.write(payload, move |tx| {
            Box::pin(async move {
                let id = Uuid::now_v7();
                let now_us = tx.now_us();
                let inserted = sqlx::query(
                    "INSERT INTO runs (id, job_id, kind, state, state_detail, created_us, updated_us, attachment,
                        setpoints_received, setpoints_sent, settings, monitor_bytes, monitor, sequence, tenant,
                        seal)
                     VALUES (?1, ?2, ?3, 'open', '', ?4, ?5, 1, 0, 0, ?6, ?7, ?8,
                        (SELECT COALESCE(MAX(sequence), 0) + 1 FROM runs),
                        COALESCE((SELECT tenant FROM jobs WHERE id = ?2), ''), ?9)",
                )
                .bind(id.to_string())
                .bind(job_id.to_string())
                .bind(kind.as_str())
                .bind(now_us)
                .bind(now_us)
                .bind(settings.get())
                .bind(monitor_bytes)
                .bind(packed)
                .bind(run_seal(&id.to_string(), &job_id.to_string(), kind, &settings))
                .execute(&mut tx.connection)
                .await;
                if let Err(error) = inserted {
                    let unknown = is_reference(&error);
                    return Err(if unknown { StoreError::not_found(Kind::Job, job_id) } else { error.into() });
                }
                let run = find_run(&mut tx.connection, id).await?;
                Ok(AttachedRun { run, attachment: 1, monitor, overrides: Vec::new() })
            })
        })
        .await
    }

    async fn attach_run(&self, id: Uuid) -> Result<AttachedRun> {
        let (run, attachment, row, overrides) = self
            .write(0, move |tx| {
                Box::pin(async move {
                    let (run, attachment, row) = take_up(tx, id).await?;
                    let overrides = find_overrides(&mut tx.connection, id).await?;
                    Ok((run, attachment, row, overrides))
                })
            })
            .await?;
        let monitor = monitor(&row).await?;
        Ok(AttachedRun { run, attachment, monitor, overrides })
    }

    async fn commit_run(&self, id: Uuid, attachment: u64, commit: RunCommit) -> Result<Vec<DecisionRecord>> {
        let attachment = signed("attachment", attachment)?;
        let packed = Packed::of(commit, self.settings()).await?;
        self.write(packed.bytes(), move |tx| Box::pin(write(tx, id, attachment, packed))).await
    }

    async fn run(&self, id: Uuid) -> Result<Run> {
        find_run(&mut self.reader().await?, id).await
    }

    async fn list_runs(&self, tenant: Option<Tenant>, job_id: Option<Uuid>, page: &PageRequest) -> Result<Page<Run>> {
        let scope = scope(tenant, job_id);
        let size = page.bounded_size();
        let mut sql = QueryBuilder::<Sqlite>::new(run_query!("WHERE TRUE"));
        if let Some(tenant) = tenant {
            sql.push(" AND tenant = ").push_bind(tenant.name().to_owned());
        }
        if let Some(job_id) = job_id {
            sql.push(" AND job_id = ").push_bind(job_id.to_string());
        }
        if let Some(before) = scope.after_sequence(&page.token)? {
            sql.push(" AND sequence < ").push_bind(before);
        }
        sql.push(" ORDER BY sequence DESC LIMIT ").push_bind(size as i64 + 1);
        let mut reader = self.reader().await?;
        let rows = sql.build().fetch(&mut reader);
        page_of(rows, size, run, |run| run.settings.get().len(), sequence_token(&scope)).await
    }

    async fn run_conditions(&self, id: Uuid) -> Result<Vec<RunCondition>> {
        let rows = sqlx::query("SELECT * FROM run_conditions WHERE run_id = ? ORDER BY decision_number LIMIT ?")
            .bind(id.to_string())
            .bind(MAX_LISTED)
            .fetch_all(&mut self.reader().await?)
            .await?;
        rows.iter().map(condition).collect()
    }

    async fn acknowledge_condition(
        &self,
        id: Uuid,
        decision_number: Option<u64>,
        by: String,
        note: String,
    ) -> Result<RunCondition> {
        check_acknowledgement(&by, &note)?;
        let number = decision_number.map(|number| signed("decision number", number)).transpose()?;
        self.write(by.len() + note.len(), move |tx| {
            Box::pin(async move {
                let run_id = id.to_string();
                find_run(&mut tx.connection, id).await?;
                let at_us = tx.now_us();
                let row = sqlx::query(
                    "SELECT * FROM run_conditions WHERE run_id = ?1 AND decision_number = COALESCE(?2,
                        (SELECT MAX(decision_number) FROM run_conditions WHERE run_id = ?1))",
                )
                .bind(&run_id)
                .bind(number)
                .fetch_optional(&mut tx.connection)
                .await?;
                let mut kept = condition(&row.ok_or_else(|| StoreError::not_found(Kind::Condition, id))?)?;
                if kept.acknowledged.is_none() {
                    sqlx::query(
                        "UPDATE run_conditions SET acknowledged_us = ?, acknowledged_by = ?, note = ?
                         WHERE run_id = ? AND decision_number = ?",
                    )
                    .bind(at_us)
                    .bind(&by)
                    .bind(&note)
                    .bind(&run_id)
                    .bind(signed("decision number", kept.decision_number)?)
                    .execute(&mut tx.connection)
                    .await?;
                    kept.acknowledged = Some(Acknowledgement { at_us, by: by.clone(), note });
                    let number = kept.decision_number;
                    tell(tx, &run_id, &acknowledged(id, number, &by)).await?;
                }
                Ok(kept)
            })
        })
        .await
    }

    async fn count_open_conditions(&self, tenant: Option<Tenant>) -> Result<u64> {
        let mut sql = QueryBuilder::<Sqlite>::new(
            "SELECT COUNT(*) AS open FROM run_conditions AS c WHERE c.acknowledged_us IS NULL",
        );
        if let Some(tenant) = tenant {
            sql.push(" AND EXISTS (SELECT 1 FROM runs AS r WHERE r.id = c.run_id AND r.tenant = ");
            sql.push_bind(tenant.name().to_owned()).push(")");
        }
        unsigned(&sql.build().fetch_one(&mut self.reader().await?).await?, "open")
    }

    async fn open_conditions(&self, limit: u32) -> Result<Vec<OpenCondition>> {
        let rows = sqlx::query(open_conditions_query!("?")).bind(limit).fetch_all(&mut self.reader().await?).await?;
        rows.iter().map(open_condition).collect()
    }

    async fn machine_runs(&self) -> Result<Vec<MachineRuns>> {
        let rows = sqlx::query(MACHINE_RUNS).fetch_all(&mut self.reader().await?).await?;
        rows.iter().map(machine_runs).collect()
    }

    async fn last_decision(&self, id: Uuid) -> Result<Option<DecisionRecord>> {
        let row = sqlx::query("SELECT * FROM decisions WHERE run_id = ? ORDER BY number DESC LIMIT 1")
            .bind(id.to_string())
            .fetch_optional(&mut self.reader().await?)
            .await?;
        row.as_ref().map(decision).transpose()
    }

    async fn last_decisions_of(&self, id: Uuid, action: &str, most: u32) -> Result<Vec<DecisionRecord>> {
        let sql = "SELECT * FROM decisions WHERE run_id = ? AND action = ? ORDER BY number DESC LIMIT ?";
        let query = sqlx::query(sql).bind(id.to_string()).bind(action).bind(i64::from(most));
        query.fetch_all(&mut self.reader().await?).await?.iter().map(decision).collect()
    }

    async fn run_overrides(&self, id: Uuid) -> Result<Vec<RunOverride>> {
        find_overrides(&mut self.reader().await?, id).await
    }

    async fn put_run_checkpoint(
        &self,
        id: Uuid,
        attachment: u64,
        checkpoint: RunCheckpoint,
        removed: Vec<Range<u64>>,
    ) -> Result<()> {
        checkpoints::put(self, id, attachment, checkpoint, removed).await
    }

    async fn nearest_run_checkpoint(
        &self,
        id: Uuid,
        generation_key: &str,
        setpoint_index: u64,
    ) -> Result<Option<RunCheckpoint>> {
        checkpoints::nearest(self, id, generation_key, setpoint_index).await
    }

    async fn run_monitor(&self, id: Uuid) -> Result<Bytes> {
        let row = sqlx::query("SELECT monitor_bytes, monitor FROM runs WHERE id = ?")
            .bind(id.to_string())
            .fetch_optional(&mut self.reader().await?)
            .await?;
        monitor(&row.ok_or_else(|| missing(id))?).await
    }

    async fn run_marks(&self, id: Uuid) -> Result<Vec<RunMark>> {
        checkpoints::marks(self, id).await
    }

    async fn telemetry_gaps(&self, id: Uuid) -> Result<Vec<TelemetryGap>> {
        let rows = sqlx::query("SELECT * FROM telemetry_gaps WHERE run_id = ? ORDER BY first_batch LIMIT ?")
            .bind(id.to_string())
            .bind(MAX_LISTED)
            .fetch_all(&mut self.reader().await?)
            .await?;
        rows.iter().map(gap).collect()
    }

    async fn recorded_cuts(&self, id: Uuid) -> Result<Vec<RecordedCutHead>> {
        let sql =
            "SELECT run_id, number, at_us, head, seal FROM recorded_cuts WHERE run_id = ? ORDER BY number LIMIT ?";
        let rows = sqlx::query(sql).bind(id.to_string()).bind(MAX_LISTED).fetch_all(&mut self.reader().await?).await?;
        rows.iter().map(recorded_cut_head).collect()
    }

    async fn recorded_cut(&self, id: Uuid, number: u64) -> Result<Bytes> {
        let sql = "SELECT body_bytes, body FROM recorded_cuts WHERE run_id = ? AND number = ?";
        let row = sqlx::query(sql)
            .bind(id.to_string())
            .bind(signed("number of a recorded cut", number)?)
            .fetch_optional(&mut self.reader().await?)
            .await?;
        let missing = || StoreError::not_found(Kind::RecordedCut, format!("{id}/{number}"));
        recorded_cut(&row.ok_or_else(missing)?).await
    }

    async fn decisions_after(&self, sequence: i64, filter: &DecisionFilter, limit: u32) -> Result<Vec<DecisionRecord>> {
        let mut sql = QueryBuilder::<Sqlite>::new("SELECT * FROM decisions WHERE sequence > ");
        sql.push_bind(sequence);
        if let Some(tenant) = filter.tenant {
            sql.push(" AND tenant = ").push_bind(tenant.name().to_owned());
        }
        if let Some(id) = filter.run_id {
            sql.push(" AND run_id = ").push_bind(id.to_string());
        }
        if let Some(id) = filter.job_id {
            sql.push(" AND job_id = ").push_bind(id.to_string());
        }
        sql.push(" ORDER BY sequence LIMIT ").push_bind(limit.min(MAX_DECISIONS));
        let rows = sql.build().fetch_all(&mut self.reader().await?).await?;
        rows.iter().map(decision).collect()
    }

    fn watch_decisions(&self) -> watch::Receiver<i64> {
        self.inner.newest_decision.clone()
    }
}
