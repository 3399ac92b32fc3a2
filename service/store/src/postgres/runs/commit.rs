//! What one commit changes in a run: telemetry taken, gaps, changes of the feed override, decisions and the end.

use sqlx::{Postgres, QueryBuilder};
use uuid::Uuid;

use super::{refusal, tell};
use crate::error::Result;
use crate::postgres::lane::{Log, Transaction};
use crate::runs::{DecisionRecord, NewDecision, RunOverride, RunState};
use crate::sql::record::{parsed, tenant};
use crate::sql::runs::{Packed, PackedCut, change_seal, cut_seal, decision_seal, raised};
use crate::tenant::Tenant;

/// Writes a commit to a run that is open and attached so; the records of its decisions.
pub(super) async fn write(
    tx: &mut Transaction,
    id: Uuid,
    attachment: i64,
    packed: &Packed,
) -> Result<Vec<DecisionRecord>> {
    let at_us = tx.now_us();
    let run_id = id.to_string();
    let (monitor_bytes, monitor) = packed.monitor.as_ref().map(|(bytes, monitor)| (*bytes, monitor.as_slice())).unzip();
    let [received, sent] = packed.setpoints.map_or([None; 2], |counts| counts.map(Some));
    let (state, detail) = packed.end.as_ref().map(|(state, detail)| (*state, detail.as_str())).unzip();
    let row = sqlx::query(
        "UPDATE runs SET updated_us = $1, newest_batch = COALESCE($2, newest_batch),
            monitor_bytes = COALESCE($3, monitor_bytes), monitor = COALESCE($4, monitor),
            setpoints_received = COALESCE($5, setpoints_received), setpoints_sent = COALESCE($6, setpoints_sent),
            setpoints_digest = COALESCE($7, setpoints_digest), state = COALESCE($8, state),
            state_detail = COALESCE($9, state_detail)
         WHERE id = $10 AND attachment = $11 AND state = 'open' RETURNING job_id, tenant",
    )
    .bind(at_us)
    .bind(packed.newest_batch)
    .bind(monitor_bytes)
    .bind(monitor)
    .bind(received)
    .bind(sent)
    .bind(packed.digest.as_deref())
    .bind(state.map(RunState::as_str))
    .bind(detail)
    .bind(&run_id)
    .bind(attachment)
    .fetch_optional(&mut tx.connection)
    .await?;
    let Some(row) = row else { return Err(refusal(&mut tx.connection, id).await?) };
    let of = (tenant(&row)?, parsed::<Uuid>(&row, "job_id")?);

    insert_gaps(tx, &run_id, &packed.gaps, at_us).await?;
    insert_overrides(tx, &run_id, &packed.overrides).await?;
    insert_recorded_cuts(tx, &run_id, &packed.recorded_cuts, at_us).await?;
    let mut records = Vec::with_capacity(packed.decisions.len());
    for (number, decision) in &packed.decisions {
        let sequence = insert_decision(tx, id, of, (*number, decision), at_us).await?;
        let NewDecision { number, body, .. } = decision;
        records.push(DecisionRecord {
            sequence,
            run_id: id,
            job_id: of.1,
            tenant: of.0,
            number: *number,
            at_us,
            body: body.clone(),
            is_intact: true,
        });
    }
    Ok(records)
}

async fn insert_gaps(tx: &mut Transaction, run_id: &str, gaps: &[[i64; 2]], at_us: i64) -> Result<()> {
    if gaps.is_empty() {
        return Ok(());
    }
    let mut sql = QueryBuilder::<Postgres>::new("INSERT INTO telemetry_gaps (run_id, first_batch, last_batch, at_us) ");
    sql.push_values(gaps, |mut row, [first, last]| {
        row.push_bind(run_id).push_bind(first).push_bind(last).push_bind(at_us);
    });
    sql.build().persistent(false).execute(&mut tx.connection).await?;
    Ok(())
}

async fn insert_overrides(tx: &mut Transaction, run_id: &str, overrides: &[([i64; 2], RunOverride)]) -> Result<()> {
    if overrides.is_empty() {
        return Ok(());
    }
    let mut sql = QueryBuilder::<Postgres>::new(
        "INSERT INTO run_overrides (run_id, number, setpoint_index, ratio, cause, seal) ",
    );
    sql.push_values(overrides, |mut row, (numbers, change)| {
        let [number, index] = *numbers;
        row.push_bind(run_id).push_bind(number).push_bind(index).push_bind(change.ratio).push_bind(&change.cause);
        row.push_bind(change_seal(run_id, *numbers, change));
    });
    sql.build().persistent(false).execute(&mut tx.connection).await?;
    Ok(())
}

async fn insert_recorded_cuts(tx: &mut Transaction, run_id: &str, cuts: &[PackedCut], at_us: i64) -> Result<()> {
    for cut in cuts {
        let PackedCut { number, head, body_bytes, body } = cut;
        sqlx::query(
            "INSERT INTO recorded_cuts (run_id, number, at_us, head, body_bytes, body, seal)
             VALUES ($1, $2, $3, $4, $5, $6, $7)",
        )
        .bind(run_id)
        .bind(number)
        .bind(at_us)
        .bind(head.as_slice())
        .bind(body_bytes)
        .bind(body.as_slice())
        .bind(cut_seal(run_id, cut))
        .execute(&mut tx.connection)
        .await?;
    }
    Ok(())
}

/// Writes a decision and the condition that it raises; its number in the log of all decisions.
async fn insert_decision(
    tx: &mut Transaction,
    id: Uuid,
    (tenant, job_id): (Tenant, Uuid),
    (number, decision): (i64, &NewDecision),
    at_us: i64,
) -> Result<i64> {
    let run_id = id.to_string();
    let job = job_id.to_string();
    let seal = decision_seal((tenant, &run_id, &job), (number, decision), at_us);
    let sequence = tx.next(Log::Decision).await?;
    sqlx::query(
        "INSERT INTO decisions (sequence, tenant, run_id, job_id, number, at_us, action, body, seal)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)",
    )
    .bind(sequence)
    .bind(tenant.name())
    .bind(&run_id)
    .bind(job)
    .bind(number)
    .bind(at_us)
    .bind(decision.action)
    .bind(decision.body.as_ref())
    .bind(seal)
    .execute(&mut tx.connection)
    .await?;
    if decision.raises_condition {
        sqlx::query(
            "INSERT INTO run_conditions (run_id, decision_number, action, raised_us, acknowledged_by, note)
             VALUES ($1, $2, $3, $4, '', '')",
        )
        .bind(&run_id)
        .bind(number)
        .bind(decision.action)
        .bind(at_us)
        .execute(&mut tx.connection)
        .await?;
        tell(tx, id, &raised(id, number, decision.action)).await?;
    }
    Ok(sequence)
}
