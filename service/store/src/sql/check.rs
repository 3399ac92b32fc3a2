//! Whether every record is as it was written, whichever database it is in.

use std::collections::HashMap;

use async_trait::async_trait;
use bytes::Bytes;
use sha2::{Digest as _, Sha256};

use super::audit::entry;
use super::compress::{decompress, offload};
use super::documents::Document;
use super::jobs::program_missing;
use super::objects::{PIECE, object_name, piece};
use super::record::{Record, json_option, parsed, parsed_option, to_json, unsigned};
use super::runs::{change, decision, recorded_cut_head};
use super::seal;
use crate::error::{Result, StoreError};
use crate::jobs::JobState;
use crate::maintenance::{CheckReport, MAX_PROBLEMS, Problem, ReadDecision};
use crate::objects::{MISSING, Objects};
use crate::programs::{CHUNK_BYTES, ProgramId, ProgramKey};
use crate::runs::{DecisionRecord, RunState};

const NOTHING: &str = "nothing: it is made again when it is needed";
const PROGRAM: &str =
    "the program, and with it streams of the jobs that use it; delete these and it, and upload it again";
const UPLOAD: &str = "what was received of the program; upload it again";
const JOB: &str = "the job; create it again";
const MONITORING: &str = "how telemetry of the job is judged; set its monitoring again";
const REPORT: &str = "the report of the job; create the job again";
const RUN: &str = "the proof of the run";
const RECORDED: &str = "what could be learnt from this cut of the run";
const DOCUMENT: &str = "the machine or tool; put it again";
const EVENT: &str = "a line of the log";
const DECISION: &str = "the decision: who watches passes over it, and the proof of its run is not whole";
const AUDIT: &str = "an entry of the audit log";
/// Rows of a log that are read at once.
const LOG_ROWS: usize = 1_000;
/// What is lost with damage that is not a record's.
pub(crate) const FILE: &str = "what is in the damaged pages; restore a backup";

/// A parameter of a query.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Parameter<'a> {
    Text(&'a str),
    Integer(i64),
}

/// A database whose records are verified; the service may change it meanwhile.
#[async_trait]
pub(crate) trait Verified: Send {
    /// A row of it.
    type Row: Record + Send + Sync;

    /// Rows of a query with parameters `$1` and so on.
    async fn rows(&mut self, sql: &'static str, parameters: &[Parameter<'_>]) -> Result<Vec<Self::Row>>;

    /// The number of the newest event that there ever was, `newest`.
    const NEWEST_EVENT: &'static str;

    /// Whether an error tells of damage, and not of a database that does not answer.
    fn is_damage(error: &StoreError) -> bool;
}

/// A verification in progress.
pub(crate) struct Check<D> {
    /// What is verified.
    pub(crate) database: D,
    /// What was found.
    pub(crate) report: CheckReport,
    read_decision: ReadDecision,
    objects: Objects,
    /// Object stores that do not answer, and why: each is asked until then only.
    silent: HashMap<String, String>,
}

impl<D: Verified> Check<D> {
    /// Of which nothing was looked at yet.
    pub(crate) fn new(database: D, read_decision: ReadDecision) -> Self {
        let report = CheckReport::default();
        Self { database, report, read_decision, objects: Objects::known(), silent: HashMap::new() }
    }

    /// Verifies every record.
    ///
    /// # Errors
    /// Those that tell of no damage.
    pub(crate) async fn records(&mut self) -> Result<()> {
        self.programs().await?;
        self.uploads().await?;
        self.jobs().await?;
        self.monitoring().await?;
        self.reports().await?;
        self.checkpoints().await?;
        self.run_checkpoints().await?;
        self.recorded_cuts().await?;
        self.documents().await?;
        self.runs().await?;
        self.decisions().await?;
        self.events().await?;
        self.audit().await
    }

    /// Something that is not as it was written.
    pub(crate) fn problem(&mut self, kind: &'static str, id: impl ToString, reason: impl ToString, lost: &'static str) {
        if self.report.problems.len() == MAX_PROBLEMS {
            self.report.further_problems += 1;
            return;
        }
        self.report.problems.push(Problem { kind, id: id.to_string(), reason: reason.to_string(), lost });
    }

    fn note(&mut self, kind: &'static str, id: impl ToString, result: Result<()>, lost: &'static str) -> Result<()> {
        let Err(error) = result else { return Ok(()) };
        if !D::is_damage(&error) {
            return Err(error);
        }
        let reason = match &error {
            StoreError::Corrupt { reason, .. } => reason.clone(),
            other => other.to_string(),
        };
        self.problem(kind, id, reason, lost);
        Ok(())
    }

    /// Identifiers of all records of a kind; what cannot even be listed is a problem of the file.
    async fn ids(&mut self, kind: &'static str, sql: &'static str) -> Result<Vec<D::Row>> {
        let rows = match self.database.rows(sql, &[]).await {
            Ok(rows) => rows,
            Err(error) if D::is_damage(&error) => {
                self.problem("file", kind, error, FILE);
                Vec::new()
            }
            Err(error) => return Err(error),
        };
        self.report.checked.push((kind, rows.len() as u64));
        Ok(rows)
    }

    /// The row of one record; `None` where it was removed meanwhile.
    async fn row(&mut self, sql: &'static str, parameters: &[Parameter<'_>]) -> Result<Option<D::Row>> {
        Ok(self.database.rows(sql, parameters).await?.pop())
    }

    async fn programs(&mut self) -> Result<()> {
        for row in self.ids("program", "SELECT id, content_id, size_bytes, chunk_count, seal FROM programs").await? {
            let id = row.text("id")?.to_owned();
            let mut result = self.program(&row).await;
            let is_there = "SELECT id FROM programs WHERE id = $1";
            if result.is_err() && self.row(is_there, &[Parameter::Text(&id)]).await.is_ok_and(|row| row.is_none()) {
                // What belonged to it was removed with it.
                result = Ok(());
            }
            self.note("program", id, result, PROGRAM)?;
        }
        Ok(())
    }

    async fn program(&mut self, row: &D::Row) -> Result<()> {
        seal::PROGRAM.verify(row)?;
        let ProgramKey(expected) = parsed(row, "id")?;
        let (size, count) = (unsigned(row, "size_bytes")?, unsigned(row, "chunk_count")?);
        let (actual, bytes) = self.hash(row.integer("content_id")?, count).await?;
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
            let sql = "SELECT content_id, chunk_index, source_offset, source_bytes, data, seal FROM program_chunks
                WHERE content_id = $1 AND chunk_index = $2";
            let place = [Parameter::Integer(content), Parameter::Integer(i64::try_from(index).unwrap_or(i64::MAX))];
            let row = self.row(sql, &place).await?;
            let Some(row) = row else {
                let source = self.piece(&place, index).await?;
                bytes += source.len() as u64;
                hash = offload(source.len(), move || Ok(hash.chain_update(&source))).await?;
                continue;
            };
            seal::CHUNK.verify(&row)?;
            let size = unsigned(&row, "source_bytes")?;
            if unsigned(&row, "source_offset")? != index * CHUNK_BYTES || size > CHUNK_BYTES {
                return Err(StoreError::corrupt(format!("chunk {index} is not where it belongs")));
            }
            let data = row.bytes("data")?.to_vec();
            let source = offload(data.len(), move || decompress(&data, size)).await?;
            bytes += source.len() as u64;
            hash = offload(source.len(), move || Ok(hash.chain_update(&source))).await?;
        }
        Ok((ProgramId::from_bytes(hash.finalize().into()), bytes))
    }

    /// A chunk that is not in the database, from its object.
    async fn piece(&mut self, place: &[Parameter<'_>], index: u64) -> Result<Bytes> {
        let missing = || StoreError::corrupt(format!("chunk {index} is missing"));
        let row = self.row(PIECE, place).await?.ok_or_else(missing)?;
        let (name, piece) = (object_name(&row)?, piece(&row)?);
        let unread =
            |reason: &str| StoreError::corrupt(format!("its object at {} cannot be read: {reason}", name.place));
        if let Some(reason) = self.silent.get(&name.place) {
            return Err(unread(reason));
        }
        match self.objects.read(&name, &piece).await {
            // What cannot be verified is not known to be intact.
            Err(StoreError::Unavailable { reason, .. }) if reason == MISSING => Err(unread("it is not there")),
            Err(StoreError::Unavailable { reason, source }) => {
                let reason = source.map_or_else(|| reason.to_owned(), |source| format!("{reason}: {source}"));
                let error = unread(&reason);
                self.silent.insert(name.place.clone(), reason);
                Err(error)
            }
            result => result,
        }
    }

    async fn uploads(&mut self) -> Result<()> {
        let sql = "SELECT id, content_id, received_bytes,
                (SELECT COUNT(*) FROM program_chunks AS c WHERE c.content_id = uploads.content_id) AS chunks,
                (SELECT COALESCE(SUM(LENGTH(data)), 0) FROM upload_tails WHERE upload_id = uploads.id) AS tail_bytes
            FROM uploads";
        for row in self.ids("upload", sql).await? {
            let id = row.text("id")?.to_owned();
            let mut result = self.upload(&row).await;
            let is_there = "SELECT id FROM uploads WHERE id = $1";
            if result.is_err() && self.row(is_there, &[Parameter::Text(&id)]).await.is_ok_and(|row| row.is_none()) {
                result = Ok(());
            }
            self.note("upload", id, result, UPLOAD)?;
        }
        Ok(())
    }

    async fn upload(&mut self, row: &D::Row) -> Result<()> {
        let (_, bytes) = self.hash(row.integer("content_id")?, unsigned(row, "chunks")?).await?;
        let (there, received) = (bytes + unsigned(row, "tail_bytes")?, unsigned(row, "received_bytes")?);
        if there == received {
            return Ok(());
        }
        Err(StoreError::corrupt(format!("it has {there} of the {received} bytes received")))
    }

    async fn jobs(&mut self) -> Result<()> {
        for row in self.ids("job", "SELECT id FROM jobs ORDER BY sequence").await? {
            let id = row.text("id")?.to_owned();
            let result = self.job(&id).await;
            self.note("job", id, result, JOB)?;
        }
        Ok(())
    }

    async fn job(&mut self, id: &str) -> Result<()> {
        let sql = "SELECT j.*,
                (SELECT COUNT(*) FROM validation_reports AS r WHERE r.job_id = j.id) AS reports,
                (SELECT MIN(u.program_id) FROM (SELECT j.program_id UNION ALL SELECT f.program_id FROM job_programs AS f
                    WHERE f.job_id = j.id) AS u WHERE NOT EXISTS (SELECT 1 FROM programs WHERE programs.id = u.program_id))
                    AS missing_program
             FROM jobs AS j WHERE j.id = $1";
        let Some(row) = self.row(sql, &[Parameter::Text(id)]).await? else { return Ok(()) };
        parsed::<uuid::Uuid>(&row, "id")?;
        parsed::<ProgramKey>(&row, "program_id")?;
        let state: JobState = parsed(&row, "state")?;
        for column in ["settings", "machine_snapshot"] {
            to_json(row.text(column)?.to_owned(), column)?;
        }
        seal::JOB.verify(&row)?;
        if let Some(id) = row.text_option("missing_program")? {
            return Err(program_missing(id));
        }
        if matches!(state, JobState::Ready | JobState::Rejected) && row.integer("reports")? == 0 {
            return Err(StoreError::corrupt(format!("it is {state} and has no report")));
        }
        Ok(())
    }

    async fn monitoring(&mut self) -> Result<()> {
        for row in self.ids("monitoring configuration", "SELECT job_id FROM monitoring").await? {
            let id = row.text("job_id")?;
            let sql = "SELECT job_id, config, seal FROM monitoring WHERE job_id = $1";
            let result = self.row(sql, &[Parameter::Text(id)]).await.and_then(|row| {
                let Some(row) = row else { return Ok(()) };
                to_json(row.text("config")?.to_owned(), "config")?;
                seal::MONITORING.verify(&row)
            });
            self.note("monitoring configuration", id, result, MONITORING)?;
        }
        Ok(())
    }

    async fn reports(&mut self) -> Result<()> {
        for row in self.ids("report", "SELECT job_id FROM validation_reports").await? {
            let id = row.text("job_id")?.to_owned();
            let head = "SELECT job_id, error_count, warning_count, info_count, summary, seal FROM validation_reports
                WHERE job_id = $1";
            let head = self.row(head, &[Parameter::Text(&id)]).await.and_then(|row| {
                let Some(row) = row else { return Ok(()) };
                json_option(&row, "summary")?;
                seal::REPORT.verify(&row)
            });
            self.note("report", &id, head, REPORT)?;
            let sql = "SELECT report_bytes AS size_bytes, report AS packed FROM validation_reports WHERE job_id = $1";
            let result = self.packed(sql, &[Parameter::Text(&id)]).await;
            let result = result.and_then(|report| {
                let Some(report) = report else { return Ok(()) };
                let text =
                    String::from_utf8(report).map_err(|error| StoreError::corrupt_by("a report is not text", error))?;
                to_json(text, "report").map(drop)
            });
            self.note("report", id, result, REPORT)?;
        }
        Ok(())
    }

    /// A compressed record, `packed` with its `size_bytes`; `None` where it was removed meanwhile.
    async fn packed(&mut self, sql: &'static str, parameters: &[Parameter<'_>]) -> Result<Option<Vec<u8>>> {
        let Some(row) = self.row(sql, parameters).await? else { return Ok(None) };
        let (size, packed) = (unsigned(&row, "size_bytes")?, row.bytes("packed")?.to_vec());
        offload(packed.len(), move || Ok(Some(decompress(&packed, size)?.into()))).await
    }

    async fn checkpoints(&mut self) -> Result<()> {
        let all = "SELECT job_id, interpolation_period_us, generation_key, setpoint_index FROM job_checkpoints";
        for row in self.ids("checkpoint", all).await? {
            let id = row.text("job_id")?;
            let key = [
                Parameter::Text(id),
                Parameter::Integer(row.integer("interpolation_period_us")?),
                Parameter::Text(row.text("generation_key")?),
                Parameter::Integer(row.integer("setpoint_index")?),
            ];
            let sql = "SELECT snapshot_bytes AS size_bytes, snapshot AS packed FROM job_checkpoints
                WHERE job_id = $1 AND interpolation_period_us = $2 AND generation_key = $3 AND setpoint_index = $4";
            let result = self.packed(sql, &key).await.map(drop);
            self.note("checkpoint", id, result, NOTHING)?;
        }
        Ok(())
    }

    async fn run_checkpoints(&mut self) -> Result<()> {
        for row in self.ids("run checkpoint", "SELECT run_id, setpoint_index FROM run_checkpoints").await? {
            let id = row.text("run_id")?;
            let key = [Parameter::Text(id), Parameter::Integer(row.integer("setpoint_index")?)];
            let sql = "SELECT snapshot_bytes AS size_bytes, snapshot AS packed FROM run_checkpoints
                WHERE run_id = $1 AND setpoint_index = $2";
            let result = self.packed(sql, &key).await.map(drop);
            self.note("run checkpoint", format!("runs/{id}"), result, NOTHING)?;
        }
        Ok(())
    }

    async fn recorded_cuts(&mut self) -> Result<()> {
        for row in self.ids("recorded cut", "SELECT run_id, number, at_us, head, seal FROM recorded_cuts").await? {
            let id = row.text("run_id")?;
            self.note("recorded cut", format!("runs/{id}"), recorded_cut_head(&row).map(drop), RECORDED)?;
            let key = [Parameter::Text(id), Parameter::Integer(row.integer("number")?)];
            let sql = "SELECT body_bytes AS size_bytes, body AS packed FROM recorded_cuts
                WHERE run_id = $1 AND number = $2";
            let result = self.packed(sql, &key).await.map(drop);
            self.note("recorded cut", format!("runs/{id}"), result, RECORDED)?;
        }
        Ok(())
    }

    async fn documents(&mut self) -> Result<()> {
        for row in self.ids("document", "SELECT * FROM documents").await? {
            let id = format!("{}s/{}", row.text("collection")?, row.text("id")?);
            self.note("document", id, Document::of(&row).map(drop), DOCUMENT)?;
        }
        Ok(())
    }

    async fn runs(&mut self) -> Result<()> {
        let sql = "SELECT id, job_id, kind, state, settings, seal,
                (SELECT COUNT(*) FROM decisions AS d WHERE d.run_id = runs.id) AS decisions,
                (SELECT COALESCE(MAX(number) - MIN(number) + 1, 0) FROM decisions AS d WHERE d.run_id = runs.id)
                    AS decision_numbers,
                (SELECT COUNT(*) FROM run_overrides AS o WHERE o.run_id = runs.id) AS overrides,
                (SELECT COALESCE(MAX(number) - MIN(number) + 1, 0) FROM run_overrides AS o WHERE o.run_id = runs.id)
                    AS override_numbers
            FROM runs";
        for row in self.ids("run", sql).await? {
            let id = row.text("id")?.to_owned();
            let result = self.run(&id, &row).await;
            self.note("run", id, result, RUN)?;
        }
        Ok(())
    }

    async fn run(&mut self, id: &str, row: &D::Row) -> Result<()> {
        parsed::<RunState>(row, "state")?;
        to_json(row.text("settings")?.to_owned(), "settings")?;
        seal::RUN.verify(row)?;
        for (records, numbers) in [("decisions", "decision_numbers"), ("overrides", "override_numbers")] {
            let (there, numbered) = (unsigned(row, records)?, unsigned(row, numbers)?);
            if there != numbered {
                return Err(StoreError::corrupt(format!("{there} of {numbered} {records} are there")));
            }
        }
        let changes = "SELECT * FROM run_overrides WHERE run_id = $1 ORDER BY number";
        for row in self.database.rows(changes, &[Parameter::Text(id)]).await? {
            change(&row)?;
        }
        let sql = "SELECT monitor_bytes AS size_bytes, monitor AS packed FROM runs WHERE id = $1";
        self.packed(sql, &[Parameter::Text(id)]).await.map(drop)
    }

    /// Every row of a log, a little at a time in the order of its numbers, of which `$1` is the last one that was read.
    async fn log(
        &mut self,
        kind: &'static str,
        sql: &'static str,
        lost: &'static str,
        read: impl Fn(&D::Row) -> Result<()> + Send,
    ) -> Result<()> {
        let (mut last, mut count) = (0, 0);
        loop {
            let rows = match self.database.rows(sql, &[Parameter::Integer(last)]).await {
                Ok(rows) => rows,
                Err(error) if D::is_damage(&error) => {
                    self.problem("file", kind, error, FILE);
                    break;
                }
                Err(error) => return Err(error),
            };
            for row in &rows {
                last = row.integer("sequence")?;
                self.note(kind, last, read(row), lost)?;
            }
            count += rows.len() as u64;
            if rows.len() < LOG_ROWS {
                break;
            }
        }
        self.report.checked.push((kind, count));
        Ok(())
    }

    async fn decisions(&mut self) -> Result<()> {
        let sql = "SELECT * FROM decisions WHERE sequence > $1 ORDER BY sequence LIMIT 1000";
        let read_decision = self.read_decision;
        self.log("decision", sql, DECISION, |row| {
            let DecisionRecord { run_id, number, body, .. } = decision(row)?;
            read_decision(body).map_err(|reason| {
                StoreError::corrupt(format!("the body of decision {number} of runs/{run_id} cannot be read: {reason}"))
            })?;
            seal::DECISION.verify(row)
        })
        .await
    }

    async fn events(&mut self) -> Result<()> {
        let sql = "SELECT sequence, job_id, from_state, to_state FROM job_events WHERE sequence > $1
            ORDER BY sequence LIMIT 1000";
        self.log("event", sql, EVENT, |row| {
            parsed::<uuid::Uuid>(row, "job_id")?;
            parsed_option::<JobState>(row, "from_state")?;
            parsed_option::<JobState>(row, "to_state")?;
            Ok(())
        })
        .await?;
        self.lost_events().await
    }

    /// Numbers that no event has. Retention removes the earliest events, so none behind one that is as early as the next one.
    async fn lost_events(&mut self) -> Result<()> {
        let newest = self.log_rows(D::NEWEST_EVENT).await?.first().map_or(Ok(0), |row| row.integer("newest"))?;
        let gaps =
            "SELECT before, sequence FROM (SELECT sequence, at_us, LAG(sequence) OVER (ORDER BY sequence) AS before,
                LAG(at_us) OVER (ORDER BY sequence) AS before_us FROM job_events) AS e
            WHERE sequence > before + 1 AND at_us >= before_us ORDER BY sequence LIMIT 1000";
        let mut lost = Vec::new();
        for row in self.log_rows(gaps).await? {
            lost.push((row.integer("before")? + 1, row.integer("sequence")? - 1));
        }
        let last = self.log_rows("SELECT sequence FROM job_events ORDER BY sequence DESC LIMIT 1").await?;
        if let Some(last) = last.first().map(|row| row.integer("sequence")).transpose()?
            && last < newest
        {
            lost.push((last + 1, newest));
        }
        for (first, last) in lost {
            self.problem("event", first, format!("events {first} to {last} are not there"), EVENT);
        }
        Ok(())
    }

    /// Rows about a log; none where damage, which reading the log itself tells of, keeps them from being read.
    async fn log_rows(&mut self, sql: &'static str) -> Result<Vec<D::Row>> {
        match self.database.rows(sql, &[]).await {
            Err(error) if D::is_damage(&error) => Ok(Vec::new()),
            rows => rows,
        }
    }

    async fn audit(&mut self) -> Result<()> {
        let sql = "SELECT * FROM audit_entries WHERE sequence > $1 ORDER BY sequence LIMIT 1000";
        self.log("audit entry", sql, AUDIT, |row| entry(row).map(drop)).await?;
        // Whatever rules remove entries, they are counted out.
        let counts = "SELECT tenant, entries, there FROM (SELECT t.tenant, t.entries,
                (SELECT COUNT(*) FROM audit_entries AS e WHERE e.tenant = t.tenant) AS there
            FROM audit_tenants AS t) AS counted WHERE entries <> there ORDER BY tenant LIMIT 1000";
        for row in self.log_rows(counts).await? {
            let (there, entries) = (row.integer("there")?, row.integer("entries")?);
            let reason = format!("{there} of {entries} entries are there");
            self.problem("audit entry", row.text("tenant")?.to_owned(), reason, AUDIT);
        }
        Ok(())
    }
}
