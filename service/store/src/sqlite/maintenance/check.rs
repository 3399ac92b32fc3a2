//! Whether every record is as it was written.

use std::path::Path;

use sha2::{Digest as _, Sha256};
use sqlx::sqlite::SqliteRow;
use sqlx::{Row as _, SqliteConnection};

use super::connect;
use crate::error::{Result, StoreError};
use crate::jobs::JobState;
use crate::maintenance::{CheckReport, MAX_PROBLEMS, Problem};
use crate::programs::{CHUNK_BYTES, ProgramId, ProgramKey};
use crate::runs::RunState;
use crate::sql::compress::{decompress, offload};
use crate::sql::record::{parsed, parsed_option, to_json, unsigned};

const NOTHING: &str = "nothing: it is made again when it is needed";
const PROGRAM: &str = "the program, and with it streams of the jobs that use it; upload it again";
const UPLOAD: &str = "what was received of the program; upload it again";
const JOB: &str = "the job; create it again";
const REPORT: &str = "the report of the job; create the job again";
const RUN: &str = "the proof of the run";
const DOCUMENT: &str = "the machine or tool; put it again";
const FILE: &str = "what is in the damaged pages; restore a backup";
const EVENT: &str = "a line of the log";

struct Check {
    connection: SqliteConnection,
    report: CheckReport,
}

/// See [`crate::check`].
pub(crate) async fn check(path: &Path) -> Result<CheckReport> {
    let mut connection = connect(path).await?;
    sqlx::query("PRAGMA query_only = ON").execute(&mut connection).await?;
    let mut check = Check { connection, report: CheckReport::default() };
    check.file().await;
    check.programs().await?;
    check.uploads().await?;
    check.jobs().await?;
    check.reports().await?;
    check.checkpoints().await?;
    check.run_checkpoints().await?;
    check.documents().await?;
    check.runs().await?;
    check.events().await?;
    sqlx::Connection::close(check.connection).await?;
    Ok(check.report)
}

impl Check {
    fn problem(&mut self, kind: &'static str, id: impl ToString, reason: impl ToString, lost: &'static str) {
        if self.report.problems.len() == MAX_PROBLEMS {
            self.report.further_problems += 1;
            return;
        }
        self.report.problems.push(Problem { kind, id: id.to_string(), reason: reason.to_string(), lost });
    }

    fn note(&mut self, kind: &'static str, id: impl ToString, result: Result<()>, lost: &'static str) {
        if let Err(error) = result {
            let reason = match &error {
                StoreError::Corrupt { reason, .. } => reason.clone(),
                other => other.to_string(),
            };
            self.problem(kind, id, reason, lost);
        }
    }

    /// Identifiers of all records of a kind; what cannot even be listed is a problem of the file.
    async fn ids(&mut self, kind: &'static str, sql: &'static str) -> Vec<SqliteRow> {
        let rows = sqlx::query(sql).fetch_all(&mut self.connection).await;
        let rows = rows.unwrap_or_else(|error| {
            self.problem("file", kind, error, FILE);
            Vec::new()
        });
        self.report.checked.push((kind, rows.len() as u64));
        rows
    }

    async fn file(&mut self) {
        let lines: Vec<String> = sqlx::query_scalar("PRAGMA integrity_check(100)")
            .fetch_all(&mut self.connection)
            .await
            .unwrap_or_else(|error| vec![error.to_string()]);
        for line in lines.into_iter().filter(|line| line != "ok") {
            self.problem("file", "", line, FILE);
        }
        let broken = sqlx::query("PRAGMA foreign_key_check").fetch_all(&mut self.connection).await;
        for row in broken.unwrap_or_default() {
            let table: String = row.try_get("table").unwrap_or_default();
            let parent: String = row.try_get("parent").unwrap_or_default();
            let id = row.try_get::<Option<i64>, _>("rowid").ok().flatten().unwrap_or_default();
            self.problem("file", format!("{table} {id}"), format!("what it refers to in {parent} is missing"), FILE);
        }
    }

    async fn programs(&mut self) -> Result<()> {
        for row in self.ids("program", "SELECT id, content_id, size_bytes, chunk_count FROM programs").await {
            let id: String = row.try_get("id")?;
            let result = self.program(&row).await;
            self.note("program", id, result, PROGRAM);
        }
        Ok(())
    }

    async fn program(&mut self, row: &SqliteRow) -> Result<()> {
        let ProgramKey(expected) = parsed(row, "id")?;
        let (size, count) = (unsigned(row, "size_bytes")?, unsigned(row, "chunk_count")?);
        let (actual, bytes) = self.hash(row.try_get("content_id")?, count).await?;
        if bytes != size {
            return Err(StoreError::corrupt(format!("it has {bytes} bytes, not {size}")));
        }
        if actual.as_bytes() != expected.as_bytes() {
            return Err(StoreError::corrupt(format!("its bytes hash to {actual}")));
        }
        Ok(())
    }

    /// Hash and size of the first chunks of a content.
    async fn hash(&mut self, content: i64, count: u64) -> Result<(ProgramId, u64)> {
        let mut hash = Sha256::new();
        let mut bytes = 0;
        for index in 0..count {
            let row = sqlx::query(
                "SELECT source_offset, source_bytes, data FROM program_chunks WHERE content_id = ? AND chunk_index = ?",
            )
            .bind(content)
            .bind(i64::try_from(index).unwrap_or(i64::MAX))
            .fetch_optional(&mut self.connection)
            .await?
            .ok_or_else(|| StoreError::corrupt(format!("chunk {index} is missing")))?;
            let size = unsigned(&row, "source_bytes")?;
            if unsigned(&row, "source_offset")? != index * CHUNK_BYTES || size > CHUNK_BYTES {
                return Err(StoreError::corrupt(format!("chunk {index} is not where it belongs")));
            }
            let data: Vec<u8> = row.try_get("data")?;
            let source = offload(data.len(), move || decompress(&data, size)).await?;
            bytes += source.len() as u64;
            hash = offload(source.len(), move || Ok(hash.chain_update(&source))).await?;
        }
        Ok((ProgramId::from_bytes(hash.finalize().into()), bytes))
    }

    async fn uploads(&mut self) -> Result<()> {
        let sql = "SELECT id, content_id, received_bytes,
                (SELECT COUNT(*) FROM program_chunks AS c WHERE c.content_id = uploads.content_id) AS chunks,
                (SELECT COALESCE(SUM(LENGTH(data)), 0) FROM upload_tails WHERE upload_id = uploads.id) AS tail_bytes
            FROM uploads";
        for row in self.ids("upload", sql).await {
            let id: String = row.try_get("id")?;
            let result = self.upload(&row).await;
            self.note("upload", id, result, UPLOAD);
        }
        Ok(())
    }

    async fn upload(&mut self, row: &SqliteRow) -> Result<()> {
        let (_, bytes) = self.hash(row.try_get("content_id")?, unsigned(row, "chunks")?).await?;
        let (there, received) = (bytes + unsigned(row, "tail_bytes")?, unsigned(row, "received_bytes")?);
        if there == received {
            return Ok(());
        }
        Err(StoreError::corrupt(format!("it has {there} of the {received} bytes received")))
    }

    async fn jobs(&mut self) -> Result<()> {
        for row in self.ids("job", "SELECT id FROM jobs ORDER BY sequence").await {
            let id: String = row.try_get("id")?;
            let result = self.job(&id).await;
            self.note("job", id, result, JOB);
        }
        Ok(())
    }

    async fn job(&mut self, id: &str) -> Result<()> {
        let row = sqlx::query(
            "SELECT j.id, j.state, j.program_id, j.settings, j.machine_snapshot, m.config,
                EXISTS (SELECT 1 FROM validation_reports AS r WHERE r.job_id = j.id) AS reported
             FROM jobs AS j LEFT JOIN monitoring AS m ON m.job_id = j.id WHERE j.id = ?",
        )
        .bind(id)
        .fetch_one(&mut self.connection)
        .await?;
        parsed::<uuid::Uuid>(&row, "id")?;
        parsed::<ProgramKey>(&row, "program_id")?;
        let state: JobState = parsed(&row, "state")?;
        for column in ["settings", "machine_snapshot"] {
            to_json(row.try_get(column)?, column)?;
        }
        if let Some(config) = row.try_get::<Option<String>, _>("config")? {
            to_json(config, "config")?;
        }
        if matches!(state, JobState::Ready | JobState::Rejected) && !row.try_get::<bool, _>("reported")? {
            return Err(StoreError::corrupt(format!("it is {state} and has no report")));
        }
        Ok(())
    }

    async fn reports(&mut self) -> Result<()> {
        for row in self.ids("report", "SELECT job_id FROM validation_reports").await {
            let id: String = row.try_get("job_id")?;
            let result = self.packed("SELECT report_bytes, report FROM validation_reports WHERE job_id = ?", &id).await;
            let result = result.and_then(|report| {
                let text =
                    String::from_utf8(report).map_err(|error| StoreError::corrupt_by("a report is not text", error))?;
                to_json(text, "report").map(drop)
            });
            self.note("report", id, result, REPORT);
        }
        Ok(())
    }

    /// A compressed record: its size, then its bytes.
    async fn packed(&mut self, sql: &'static str, id: &str) -> Result<Vec<u8>> {
        let row = sqlx::query(sql).bind(id).fetch_one(&mut self.connection).await?;
        let (size, packed): (i64, Vec<u8>) = (row.try_get(0)?, row.try_get(1)?);
        let size = u64::try_from(size).map_err(|_| StoreError::corrupt("a size is negative"))?;
        offload(packed.len(), move || Ok(decompress(&packed, size)?.into())).await
    }

    async fn checkpoints(&mut self) -> Result<()> {
        for row in self.ids("checkpoint", "SELECT CAST(rowid AS TEXT) AS place, job_id FROM job_checkpoints").await {
            let (place, id): (String, String) = (row.try_get("place")?, row.try_get("job_id")?);
            let sql = "SELECT snapshot_bytes, snapshot FROM job_checkpoints WHERE rowid = CAST(? AS INTEGER)";
            let result = self.packed(sql, &place).await.map(drop);
            self.note("checkpoint", id, result, NOTHING);
        }
        Ok(())
    }

    async fn run_checkpoints(&mut self) -> Result<()> {
        for row in self.ids("run checkpoint", "SELECT CAST(rowid AS TEXT) AS place, run_id FROM run_checkpoints").await
        {
            let (place, id): (String, String) = (row.try_get("place")?, row.try_get("run_id")?);
            let sql = "SELECT snapshot_bytes, snapshot FROM run_checkpoints WHERE rowid = CAST(? AS INTEGER)";
            let result = self.packed(sql, &place).await.map(drop);
            self.note("run checkpoint", format!("runs/{id}"), result, NOTHING);
        }
        Ok(())
    }

    async fn documents(&mut self) -> Result<()> {
        for row in self.ids("document", "SELECT collection, id, body FROM documents").await {
            let (collection, id): (String, String) = (row.try_get("collection")?, row.try_get("id")?);
            let result = row.try_get("body").map_err(Into::into).and_then(|body| to_json(body, "body").map(drop));
            self.note("document", format!("{collection}s/{id}"), result, DOCUMENT);
        }
        Ok(())
    }

    async fn runs(&mut self) -> Result<()> {
        let sql = "SELECT id, state, settings,
                (SELECT COUNT(*) FROM decisions AS d WHERE d.run_id = runs.id) AS decisions,
                (SELECT COALESCE(MAX(number) - MIN(number) + 1, 0) FROM decisions AS d WHERE d.run_id = runs.id)
                    AS decision_numbers,
                (SELECT COUNT(*) FROM run_overrides AS o WHERE o.run_id = runs.id) AS overrides,
                (SELECT COALESCE(MAX(number) - MIN(number) + 1, 0) FROM run_overrides AS o WHERE o.run_id = runs.id)
                    AS override_numbers
            FROM runs";
        for row in self.ids("run", sql).await {
            let id: String = row.try_get("id")?;
            let result = self.run(&id, &row).await;
            self.note("run", id, result, RUN);
        }
        Ok(())
    }

    async fn run(&mut self, id: &str, row: &SqliteRow) -> Result<()> {
        parsed::<RunState>(row, "state")?;
        to_json(row.try_get("settings")?, "settings")?;
        for (records, numbers) in [("decisions", "decision_numbers"), ("overrides", "override_numbers")] {
            let (there, numbered) = (unsigned(row, records)?, unsigned(row, numbers)?);
            if there != numbered {
                return Err(StoreError::corrupt(format!("{there} of {numbered} {records} are there")));
            }
        }
        self.packed("SELECT monitor_bytes, monitor FROM runs WHERE id = ?", id).await.map(drop)
    }

    async fn events(&mut self) -> Result<()> {
        let rows = self.ids("event", "SELECT sequence, job_id, from_state, to_state FROM job_events").await;
        for row in rows {
            let sequence: i64 = row.try_get("sequence")?;
            let event = || -> Result<()> {
                parsed::<uuid::Uuid>(&row, "job_id")?;
                parsed_option::<JobState>(&row, "from_state")?;
                parsed_option::<JobState>(&row, "to_state")?;
                Ok(())
            };
            self.note("event", sequence, event(), EVENT);
        }
        Ok(())
    }
}
