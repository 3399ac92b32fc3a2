//! Jobs, their reports and events as rows.

use uuid::Uuid;

use super::compress::{compress, decompress, offload};
use super::record::{Record, json, json_option, parsed, parsed_option, signed, tenant, to_json, unsigned};
use super::seal::{JOB, REPORT};
use crate::Json;
use crate::error::{Kind, Result, StoreError, check_size};
use crate::jobs::{FindingCounts, Job, JobDetail, JobEvent, JobFilter, JobState, NewJob, NewReport, StoredReport};
use crate::page::{Scope, tenant_scope};
use crate::programs::ProgramKey;
use crate::settings::StoreSettings;

/// Longest request id, machine id, display name and detail in bytes.
const MAX_TEXT_BYTES: u64 = 4096;

pub(crate) fn job(row: &impl Record) -> Result<Job> {
    let findings = match row.integer_option("error_count")? {
        Some(_) => Some(findings(row)?),
        None => None,
    };
    // The key has the tenant behind it.
    let request_id = row.text("request_id")?;
    let request_id = request_id.split_once(' ').map_or(request_id, |(request_id, _)| request_id);
    Ok(Job {
        id: parsed(row, "id")?,
        sequence: row.integer("sequence")?,
        tenant: tenant(row)?,
        owner: row.text("owner")?.to_owned(),
        request_id: request_id.to_owned(),
        display_name: row.text("display_name")?.to_owned(),
        program_id: parsed::<ProgramKey>(row, "program_id")?.0,
        program_size_bytes: program_size(row)?,
        machine_id: row.text("machine_id")?.to_owned(),
        state: parsed(row, "state")?,
        state_detail: row.text("state_detail")?.to_owned(),
        findings,
        summary: summary(row),
        created_us: row.integer("created_us")?,
        updated_us: row.integer("updated_us")?,
        revision: unsigned(row, "revision")?,
        attempts: u32::try_from(unsigned(row, "attempts")?).unwrap_or(u32::MAX),
    })
}

/// Size of the program of a job; 0 where its row is lost, so that the job is listed and deleted with the others.
pub(crate) fn program_size(row: &impl Record) -> Result<u64> {
    match row.integer_option("size_bytes")? {
        Some(_) => unsigned(row, "size_bytes"),
        None => Ok(0),
    }
}

/// What the report says in short. One that is damaged is left out, so that the job is listed, read and deleted with the others.
fn summary(row: &impl Record) -> Option<Json> {
    REPORT.verify_by(row, "report_seal").and_then(|()| json_option(row, "summary")).unwrap_or_else(|error| {
        tracing::error!(%error, "the summary of a report is damaged");
        None
    })
}

pub(crate) fn findings(row: &impl Record) -> Result<FindingCounts> {
    Ok(FindingCounts {
        errors: unsigned(row, "error_count")?,
        warnings: unsigned(row, "warning_count")?,
        infos: unsigned(row, "info_count")?,
    })
}

pub(crate) fn event(row: &impl Record) -> Result<JobEvent> {
    Ok(JobEvent {
        sequence: row.integer("sequence")?,
        tenant: tenant(row)?,
        job_id: parsed(row, "job_id")?,
        from_state: parsed_option(row, "from_state")?,
        to_state: parsed_option(row, "to_state")?,
        at_us: row.integer("at_us")?,
        detail: row.text("detail")?.to_owned(),
    })
}

pub(crate) fn missing(id: Uuid) -> StoreError {
    StoreError::not_found(Kind::Job, id)
}

/// A report ready to be written.
#[derive(Debug)]
pub(crate) struct PackedReport {
    /// Numbers of errors, warnings and infos.
    pub(crate) counts: [i64; 3],
    pub(crate) summary: Option<String>,
    pub(crate) report_bytes: i64,
    pub(crate) report: Vec<u8>,
}

impl PackedReport {
    async fn of(report: NewReport) -> Result<Self> {
        let NewReport { report, findings, summary } = report;
        let bytes = report.get().len();
        let packed = offload(bytes, move || compress(report.get().as_bytes())).await?;
        Ok(Self {
            counts: [
                signed("number of errors", findings.errors)?,
                signed("number of warnings", findings.warnings)?,
                signed("number of infos", findings.infos)?,
            ],
            summary: summary.map(|summary| summary.get().to_owned()),
            report_bytes: signed("report size in bytes", bytes as u64)?,
            report: packed,
        })
    }
}

impl PackedReport {
    /// The seal of its row.
    pub(crate) fn seal(&self, job_id: &str) -> Vec<u8> {
        let [errors, warnings, infos] = self.counts.map(Into::into);
        REPORT.seal([job_id.into(), errors, warnings, infos, self.summary.as_deref().into()])
    }
}

/// The seal of the row of a new job.
pub(crate) fn seal(new: &NewJob, id: &str) -> Vec<u8> {
    JOB.seal([
        id.into(),
        new.tenant.name().into(),
        new.tenant.key(&new.request_id).as_str().into(),
        new.fingerprint.as_bytes().as_slice().into(),
        new.program_id.of_tenant(new.tenant).key().as_str().into(),
        new.machine_id.as_str().into(),
        new.settings.get().into(),
        new.machine_snapshot.get().into(),
    ])
}

/// The token scope of a job list.
pub(crate) fn scope(filter: &JobFilter) -> Scope {
    let mut states: Vec<_> = filter.states.iter().map(|state| state.as_str()).collect();
    states.sort_unstable();
    states.dedup();
    // A present and an absent filter differ in length, so no value can pass for "absent".
    let time = |time: Option<i64>| time.map(i64::to_be_bytes).map_or_else(Vec::new, Vec::from);
    let machine = filter.machine_id.as_deref().map_or_else(String::new, |id| format!("={id}"));
    let [from, before] = [filter.created_from_us, filter.created_before_us].map(time);
    Scope::of([b"jobs", states.join(",").as_bytes(), machine.as_bytes(), &from, &before, &tenant_scope(filter.tenant)])
}

/// Refuses a new job that is larger than it may be; the bytes that it holds in memory.
pub(crate) fn check_new(new: &NewJob, settings: &StoreSettings) -> Result<usize> {
    for (what, text) in [
        ("request id size in bytes", &new.request_id),
        ("display name size in bytes", &new.display_name),
        ("machine id size in bytes", &new.machine_id),
        ("client size in bytes", &new.client),
        ("owner size in bytes", &new.owner),
    ] {
        check_size(what, text.len(), MAX_TEXT_BYTES)?;
    }
    let limit = settings.max_document_bytes;
    check_size("machine profile size in bytes", new.machine_snapshot.get().len(), limit)?;
    check_size("job settings size in bytes", new.settings.get().len(), limit)?;
    Ok(new.machine_snapshot.get().len() + new.settings.get().len())
}

/// Refuses a change of state that is larger than it may be; its report ready to be written.
pub(crate) async fn packed(
    detail: &str,
    report: Option<NewReport>,
    settings: &StoreSettings,
) -> Result<Option<PackedReport>> {
    check_size("detail size in bytes", detail.len(), MAX_TEXT_BYTES)?;
    let Some(report) = report else { return Ok(None) };
    check_size("report size in bytes", report.report.get().len(), settings.max_report_bytes)?;
    let summary = report.summary.as_ref().map_or(0, |summary| summary.get().len());
    check_size("report summary size in bytes", summary, settings.max_document_bytes)?;
    PackedReport::of(report).await.map(Some)
}

/// A job with its documents.
pub(crate) fn detail(row: &impl Record) -> Result<JobDetail> {
    JOB.verify(row)?;
    let own = row.integer_option("size_bytes")?.is_none().then(|| row.text("program_id")).transpose()?;
    if let Some(id) = own.or(row.text_option("missing_program")?) {
        return Err(program_missing(id));
    }
    Ok(JobDetail { job: job(row)?, machine_snapshot: json(row, "machine_snapshot")?, settings: json(row, "settings")? })
}

/// What is said of a job whose program is not there.
pub(crate) fn program_missing(id: &str) -> StoreError {
    // The key has the tenant behind it.
    let id = id.split_once(' ').map_or(id, |(id, _)| id);
    StoreError::corrupt(format!("programs/{id} of the job is missing"))
}

/// A report as it was stored.
pub(crate) async fn report(row: &impl Record, id: Uuid) -> Result<StoredReport> {
    REPORT.verify(row)?;
    let size = unsigned(row, "report_bytes")?;
    let packed = row.bytes("report")?.to_vec();
    let report = offload(packed.len(), move || {
        let text = String::from_utf8(decompress(&packed, size)?.into())
            .map_err(|error| StoreError::corrupt_by("a report is not text", error))?;
        to_json(text, "report")
    })
    .await?;
    Ok(StoredReport { job_id: id, report, findings: findings(row)?, created_us: row.integer("created_us")? })
}

/// A job that has just been created under this number.
pub(crate) fn created(new: NewJob, id: Uuid, sequence: i64, program_size_bytes: u64, now_us: i64) -> Job {
    Job {
        id,
        sequence,
        tenant: new.tenant,
        owner: new.owner,
        request_id: new.request_id,
        display_name: new.display_name,
        program_id: new.program_id.of_tenant(new.tenant),
        program_size_bytes,
        machine_id: new.machine_id,
        state: JobState::PendingValidation,
        state_detail: String::new(),
        findings: None,
        summary: None,
        created_us: now_us,
        updated_us: now_us,
        revision: 1,
        attempts: 0,
    }
}
