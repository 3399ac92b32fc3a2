//! Runs, their commits and conditions as rows.

use bytes::Bytes;
use uuid::Uuid;

use super::compress::{compress, decompress, offload};
use super::record::{Record, json, parsed, signed, tenant, to_json, unsigned};
use super::seal::{CHANGE, DECISION, MONITORING, RECORDED_CUT, RUN, Value};
use crate::Json;
use crate::error::{Kind, Result, StoreError, check_size};
use crate::page::{Scope, tenant_scope};
use crate::runs::{
    Acknowledgement, DecisionRecord, MachineRuns, NewDecision, NewRecordedCut, OpenCondition, RecordedCutHead, Run,
    RunCommit, RunCondition, RunKind, RunOverride, RunSetpoints, RunState, TelemetryGap,
};
use crate::settings::StoreSettings;
use crate::tenant::Tenant;

/// Most gaps and changes in one commit: well within SQLite's 32 766 parameters.
const MAX_ROWS: u64 = 4096;

/// Longest reason of an end and cause of a change, bytes.
const MAX_TEXT_BYTES: u64 = 4096;

pub(crate) fn missing(id: Uuid) -> StoreError {
    StoreError::not_found(Kind::Run, id)
}

pub(crate) fn run(row: &impl Record) -> Result<Run> {
    RUN.verify(row)?;
    let digest = match row.bytes_option("setpoints_digest")? {
        Some(digest) => {
            let digest = digest.try_into().map_err(|_| StoreError::corrupt("a digest has not 32 bytes"))?;
            Some(digest)
        }
        None => None,
    };
    let newest_batch = match row.integer_option("newest_batch")? {
        Some(_) => Some(unsigned(row, "newest_batch")?),
        None => None,
    };
    Ok(Run {
        id: parsed(row, "id")?,
        tenant: tenant(row)?,
        sequence: row.integer("sequence")?,
        job_id: parsed(row, "job_id")?,
        kind: parsed(row, "kind")?,
        state: parsed(row, "state")?,
        state_detail: row.text("state_detail")?.to_owned(),
        created_us: row.integer("created_us")?,
        updated_us: row.integer("updated_us")?,
        newest_batch,
        setpoints: RunSetpoints {
            received: unsigned(row, "setpoints_received")?,
            sent: unsigned(row, "setpoints_sent")?,
            digest,
        },
        settings: json(row, "settings")?,
        attachment: unsigned(row, "attachment")?,
        open_conditions: unsigned(row, "open_conditions")?,
    })
}

pub(crate) fn condition(row: &impl Record) -> Result<RunCondition> {
    let at_us = row.integer_option("acknowledged_us")?;
    let (by, note) = (row.text("acknowledged_by")?.to_owned(), row.text("note")?.to_owned());
    Ok(RunCondition {
        decision_number: unsigned(row, "decision_number")?,
        action: row.text("action")?.to_owned(),
        raised_us: row.integer("raised_us")?,
        acknowledged: at_us.map(|at_us| Acknowledgement { at_us, by, note }),
    })
}

/// A commit with its numbers and the monitor's state as the database keeps them.
#[derive(Debug)]
pub(crate) struct Packed {
    pub(crate) newest_batch: Option<i64>,
    pub(crate) monitor: Option<(i64, Vec<u8>)>,
    pub(crate) setpoints: Option<[i64; 2]>,
    pub(crate) digest: Option<Vec<u8>>,
    pub(crate) decisions: Vec<(i64, NewDecision)>,
    pub(crate) gaps: Vec<[i64; 2]>,
    pub(crate) overrides: Vec<([i64; 2], RunOverride)>,
    pub(crate) recorded_cuts: Vec<PackedCut>,
    pub(crate) end: Option<(RunState, String)>,
}

/// A stretch of telemetry as the database keeps it.
#[derive(Debug)]
pub(crate) struct PackedCut {
    pub(crate) number: i64,
    pub(crate) head: Vec<u8>,
    pub(crate) body_bytes: i64,
    pub(crate) body: Vec<u8>,
}

impl PackedCut {
    async fn of(cut: NewRecordedCut) -> Result<Self> {
        let NewRecordedCut { number, head, body } = cut;
        Ok(Self {
            number: signed("number of a recorded cut", number)?,
            head: head.into(),
            body_bytes: signed("recorded cut size in bytes", body.len() as u64)?,
            body: offload(body.len(), move || compress(&body)).await?,
        })
    }
}

impl Packed {
    /// Refuses a commit that is larger than it may be.
    pub(crate) async fn of(commit: RunCommit, settings: &StoreSettings) -> Result<Self> {
        check_commit(&commit, settings)?;
        let RunCommit { telemetry, decisions, gaps, overrides, recorded_cuts, setpoints, end } = commit;
        let mut packed_cuts = Vec::with_capacity(recorded_cuts.len());
        for cut in recorded_cuts {
            packed_cuts.push(PackedCut::of(cut).await?);
        }
        let (newest_batch, monitor) = match telemetry {
            Some((newest, monitor)) => {
                let newest = newest.map(|newest| signed("batch number", newest)).transpose()?;
                (newest, Some(pack(monitor).await?))
            }
            None => (None, None),
        };
        let number = |decision: NewDecision| Ok((signed("decision number", decision.number)?, decision));
        let gap = |gap: TelemetryGap| Ok([signed("batch number", gap.first)?, signed("batch number", gap.last)?]);
        let change = |change: RunOverride| {
            let numbers = [signed("change number", change.number)?, signed("setpoint index", change.setpoint_index)?];
            Ok((numbers, change))
        };
        let count = |setpoints: RunSetpoints| {
            Ok::<_, StoreError>([
                signed("setpoint index", setpoints.received)?,
                signed("setpoint index", setpoints.sent)?,
            ])
        };
        Ok(Self {
            newest_batch,
            monitor,
            setpoints: setpoints.map(count).transpose()?,
            digest: setpoints.and_then(|setpoints| setpoints.digest).map(Vec::from),
            decisions: decisions.into_iter().map(number).collect::<Result<_>>()?,
            gaps: gaps.into_iter().map(gap).collect::<Result<_>>()?,
            overrides: overrides.into_iter().map(change).collect::<Result<_>>()?,
            recorded_cuts: packed_cuts,
            end,
        })
    }

    pub(crate) fn bytes(&self) -> usize {
        let decisions: usize = self.decisions.iter().map(|(_, decision)| decision.body.len()).sum();
        let cuts: usize = self.recorded_cuts.iter().map(|cut| cut.head.len() + cut.body.len()).sum();
        self.monitor.as_ref().map_or(0, |(_, monitor)| monitor.len()) + decisions + cuts
    }
}

/// The seal of the row of a run.
pub(crate) fn run_seal(id: &str, job_id: &str, kind: RunKind, settings: &Json) -> Vec<u8> {
    RUN.seal([id.into(), job_id.into(), kind.as_str().into(), settings.get().into()])
}

/// The seal of the row of a change of the feed override.
pub(crate) fn change_seal(run_id: &str, [number, index]: [i64; 2], change: &RunOverride) -> Vec<u8> {
    CHANGE.seal([run_id.into(), number.into(), index.into(), Value::Real(change.ratio), change.cause.as_str().into()])
}

/// The seal of the row of a recorded cut.
pub(crate) fn cut_seal(run_id: &str, cut: &PackedCut) -> Vec<u8> {
    RECORDED_CUT.seal([run_id.into(), cut.number.into(), cut.head.as_slice().into()])
}

/// The seal of the row of a decision.
pub(crate) fn decision_seal(
    (tenant, run_id, job_id): (Tenant, &str, &str),
    (number, decision): (i64, &NewDecision),
    at_us: i64,
) -> Vec<u8> {
    DECISION.seal([
        tenant.name().into(),
        run_id.into(),
        job_id.into(),
        number.into(),
        at_us.into(),
        decision.action.into(),
        decision.body.as_ref().into(),
    ])
}

/// The seal of the row of a monitoring configuration.
pub(crate) fn monitoring_seal(job_id: &str, config: &Json) -> Vec<u8> {
    MONITORING.seal([job_id.into(), config.get().into()])
}

/// The monitoring configuration of a job that is there, if it has one.
pub(crate) fn monitoring(row: &impl Record, job_id: Uuid) -> Result<Json> {
    let config = row.text_option("config")?.ok_or_else(|| StoreError::not_found(Kind::Monitoring, job_id))?;
    MONITORING.verify(row)?;
    to_json(config.to_owned(), "config")
}

/// Size and compressed bytes of the state of a monitor.
pub(crate) async fn pack(monitor: Bytes) -> Result<(i64, Vec<u8>)> {
    let bytes = signed("monitor size in bytes", monitor.len() as u64)?;
    Ok((bytes, offload(monitor.len(), move || compress(&monitor)).await?))
}

fn check_commit(commit: &RunCommit, settings: &StoreSettings) -> Result<()> {
    if let Some((_, monitor)) = &commit.telemetry {
        check_size("monitor size in bytes", monitor.len(), settings.max_snapshot_bytes)?;
    }
    for decision in &commit.decisions {
        check_size("decision size in bytes", decision.body.len(), settings.max_document_bytes)?;
    }
    for cut in &commit.recorded_cuts {
        check_size("recorded cut size in bytes", cut.body.len(), settings.max_snapshot_bytes)?;
        check_size("recorded cut head size in bytes", cut.head.len(), MAX_TEXT_BYTES)?;
    }
    check_size("telemetry gaps", commit.gaps.len(), MAX_ROWS)?;
    check_size("changes of the feed override", commit.overrides.len(), MAX_ROWS)?;
    let texts = commit.overrides.iter().map(|change| &change.cause).chain(commit.end.iter().map(|end| &end.1));
    for text in texts {
        check_size("reason size in bytes", text.len(), MAX_TEXT_BYTES)?;
    }
    Ok(())
}

/// Refuses an acknowledgement that is larger than it may be.
pub(crate) fn check_acknowledgement(by: &str, note: &str) -> Result<()> {
    for text in [by, note] {
        check_size("acknowledgement size in bytes", text.len(), MAX_TEXT_BYTES)?;
    }
    Ok(())
}

/// The token scope of a list of runs.
pub(crate) fn scope(tenant: Option<Tenant>, job_id: Option<Uuid>) -> Scope {
    let job: &[u8] = job_id.as_ref().map_or(&[], |id| id.as_bytes());
    Scope::of([b"runs".as_slice(), job, &tenant_scope(tenant)])
}

pub(crate) fn change(row: &impl Record) -> Result<RunOverride> {
    CHANGE.verify(row)?;
    Ok(RunOverride {
        number: unsigned(row, "number")?,
        setpoint_index: unsigned(row, "setpoint_index")?,
        ratio: row.real("ratio")?,
        cause: row.text("cause")?.to_owned(),
    })
}

pub(crate) fn gap(row: &impl Record) -> Result<TelemetryGap> {
    Ok(TelemetryGap { first: unsigned(row, "first_batch")?, last: unsigned(row, "last_batch")? })
}

pub(crate) fn recorded_cut_head(row: &impl Record) -> Result<RecordedCutHead> {
    RECORDED_CUT.verify(row)?;
    Ok(RecordedCutHead {
        number: unsigned(row, "number")?,
        at_us: row.integer("at_us")?,
        head: row.bytes("head")?.to_vec().into(),
    })
}

/// The samples of a stretch.
pub(crate) async fn recorded_cut(row: &impl Record) -> Result<Bytes> {
    let size = unsigned(row, "body_bytes")?;
    let packed = row.bytes("body")?.to_vec();
    offload(packed.len(), move || decompress(&packed, size)).await
}

pub(crate) fn decision(row: &impl Record) -> Result<DecisionRecord> {
    let is_intact = match DECISION.verify(row) {
        Err(StoreError::Corrupt { .. }) => false,
        verified => verified.map(|()| true)?,
    };
    Ok(DecisionRecord {
        is_intact,
        sequence: row.integer("sequence")?,
        run_id: parsed(row, "run_id")?,
        job_id: parsed(row, "job_id")?,
        tenant: tenant(row)?,
        number: unsigned(row, "number")?,
        at_us: row.integer("at_us")?,
        body: row.bytes("body")?.to_vec().into(),
    })
}

/// Unacknowledged conditions, at most so many of a tenant on a machine.
macro_rules! open_conditions_query {
    ($limit:literal) => {
        concat!(
            "SELECT * FROM (
                SELECT c.*, r.tenant, r.job_id, j.machine_id, ROW_NUMBER() OVER (
                        PARTITION BY r.tenant, j.machine_id ORDER BY c.raised_us DESC, c.decision_number DESC) AS place
                FROM run_conditions AS c JOIN runs AS r ON r.id = c.run_id JOIN jobs AS j ON j.id = r.job_id
                WHERE c.acknowledged_us IS NULL) AS open
             WHERE place <= ",
            $limit,
            " ORDER BY raised_us, decision_number"
        )
    };
}
pub(crate) use open_conditions_query;

/// The newest run of each tenant on each machine, and how many came to their end.
pub(crate) const MACHINE_RUNS: &str = "SELECT found.machine_id, found.tenant, newest.id, found.finished
     FROM (SELECT j.machine_id, r.tenant, MAX(r.sequence) AS sequence,
            COUNT(CASE WHEN r.state = 'finished' THEN 1 END) AS finished
        FROM runs AS r JOIN jobs AS j ON j.id = r.job_id GROUP BY j.machine_id, r.tenant) AS found
        JOIN runs AS newest ON newest.sequence = found.sequence
     ORDER BY found.machine_id, found.tenant";

pub(crate) fn open_condition(row: &impl Record) -> Result<OpenCondition> {
    Ok(OpenCondition {
        machine_id: row.text("machine_id")?.to_owned(),
        tenant: tenant(row)?,
        run_id: parsed(row, "run_id")?,
        job_id: parsed(row, "job_id")?,
        condition: condition(row)?,
    })
}

pub(crate) fn machine_runs(row: &impl Record) -> Result<MachineRuns> {
    Ok(MachineRuns {
        machine_id: row.text("machine_id")?.to_owned(),
        tenant: tenant(row)?,
        newest: parsed(row, "id")?,
        finished: unsigned(row, "finished")?,
    })
}

/// State of the monitor of a run.
pub(crate) async fn monitor(row: &impl Record) -> Result<Bytes> {
    let size = unsigned(row, "monitor_bytes")?;
    let packed = row.bytes("monitor")?.to_vec();
    offload(packed.len(), move || decompress(&packed, size)).await
}

/// What the log of events says of a condition that a decision raised.
pub(crate) fn raised(run_id: Uuid, number: i64, action: &str) -> String {
    format!("runs/{run_id}: decision {number} raised a condition: {action}")
}

/// What the log of events says of a condition that somebody acknowledged.
pub(crate) fn acknowledged(run_id: Uuid, number: u64, by: &str) -> String {
    format!("runs/{run_id}: {by} acknowledged the condition of decision {number}")
}
