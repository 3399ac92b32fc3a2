//! The background workers: jobs that wait become ready or rejected. The store is the queue, so nothing is lost
//! when the service stops.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::Duration;

use feedwave_contract::convert::{report_to_proto, summary_to_proto};
use feedwave_cutting::ValidationReport;
use feedwave_store::{Checkpoint, FindingCounts, JobState, NewReport, StoreError};
use tokio::task::JoinSet;
use tracing::Instrument as _;
use uuid::Uuid;

use super::validation::{Outcome, validate};
use super::{Engine, checkpoint_set, job_config};
use crate::error::{Error, Result};
use crate::observability::metrics::GaugeGuard;
use crate::stored;

/// How long to wait before asking a store again that did not answer.
const RETRY_AFTER: Duration = Duration::from_secs(1);
/// Jobs read together when the queue is read.
const QUEUE_PAGE: u32 = 1_000;

/// Keeps the workers busy until the service ends.
pub(super) async fn run(engine: Engine) {
    let inner = &engine.inner;
    let mut running = JoinSet::new();
    let mut in_hand = HashSet::new();
    while !inner.draining.is_cancelled() {
        let mut retry = false;
        match fill(&engine, &mut running, &mut in_hand).await {
            Ok(waiting) => inner.metrics.validation_queue.set(waiting),
            Err(error) => {
                tracing::warn!(%error, "the queue of validations cannot be read");
                retry = true;
            }
        }
        tokio::select! {
            () = inner.draining.cancelled() => {}
            () = inner.wake.notified() => {}
            () = tokio::time::sleep(RETRY_AFTER), if retry => {}
            Some(ended) = running.join_next(), if !running.is_empty() => match ended {
                Ok(id) => { in_hand.remove(&id); }
                // The task itself never panics: it catches what the pipeline throws.
                Err(error) => tracing::error!(%error, "a validation worker failed"),
            },
        }
    }
    // Validations look at the same token.
    while running.join_next().await.is_some() {}
}

/// Gives waiting jobs to free workers; returns how many still wait.
async fn fill(engine: &Engine, running: &mut JoinSet<Uuid>, in_hand: &mut HashSet<Uuid>) -> Result<i64> {
    // A job found in state `validating` that no worker holds was interrupted: it is validated again.
    let states = [JobState::PendingValidation, JobState::Validating];
    let ids = engine.inner.store.jobs_in_state(&states, QUEUE_PAGE).await?;
    let mut waiting = 0;
    for id in ids {
        if in_hand.contains(&id) {
            continue;
        }
        if running.len() >= engine.inner.limits.validation_workers {
            waiting += 1;
            continue;
        }
        in_hand.insert(id);
        let engine = engine.clone();
        let span = tracing::info_span!("validate", job = %id);
        running.spawn(async move { work(engine, id).await }.instrument(span));
    }
    Ok(waiting)
}

/// Validates one job, again and again while the store does not answer. Returns the job's identifier.
async fn work(engine: Engine, id: Uuid) -> Uuid {
    loop {
        match attempt(&engine, id).await {
            Ok(()) => return id,
            Err(Error::StoreUnavailable(error)) => tracing::warn!(%error, "the store does not answer"),
            Err(error) => {
                tracing::error!(error = ?error, "validation failed");
                engine.inner.metrics.validations.with_label_values(&["failed"]).inc();
                match finish(&engine, id, JobState::Failed, &error.to_string(), None).await {
                    Err(Error::StoreUnavailable(_)) => {}
                    _ => return id,
                }
            }
        }
        tokio::select! {
            () = engine.inner.draining.cancelled() => return id,
            () = tokio::time::sleep(RETRY_AFTER) => {}
        }
    }
}

async fn attempt(engine: &Engine, id: Uuid) -> Result<()> {
    let inner = &engine.inner;
    let started = [JobState::PendingValidation, JobState::Validating];
    let guard = inner.active.enter(id);
    let _counted = GaugeGuard::new(&inner.metrics.active_validations);
    match inner.store.transition(id, &started, JobState::Validating, "", None).await {
        Ok(_) => {}
        // Cancelled or deleted in the meantime.
        Err(StoreError::FailedState { .. } | StoreError::NotFound { .. }) => return Ok(()),
        Err(error) => return Err(error.into()),
    }
    let detail = inner.store.job_detail(id).await?;
    let config = Arc::new(job_config(&detail)?);
    let set = checkpoint_set(id, &config);
    let source = engine.job_source(&detail)?;
    let store = inner.store.clone();
    let runtime = tokio::runtime::Handle::current();
    let (cancelled, draining) = (guard.token().clone(), inner.draining.clone());
    let run = tokio::task::spawn_blocking(move || {
        let stop = || cancelled.is_cancelled() || draining.is_cancelled();
        validate(config, &source, stop, |pipeline| {
            let checkpoint = Checkpoint {
                setpoint_index: pipeline.next_index(),
                input_offset: pipeline.place().offset,
                snapshot: pipeline.snapshot().map_err(Error::internal)?.into(),
            };
            match runtime.block_on(store.put_checkpoints(&set, vec![checkpoint])) {
                // Derived data: without it streams only begin later. A wide look-ahead over splines is that large.
                Err(error @ StoreError::TooLarge { .. }) => {
                    tracing::warn!(job = %id, index = pipeline.next_index(), %error, "no checkpoint");
                    Ok(())
                }
                stored => Ok(stored?),
            }
        })
    });
    let outcome = run.await.map_err(|panic| Error::internal(format!("the pipeline failed: {panic}")))??;
    let Outcome::Reported(report) = outcome else { return Ok(()) };
    conclude(engine, id, &report).await
}

async fn conclude(engine: &Engine, id: Uuid, report: &ValidationReport) -> Result<()> {
    let summary = &report.summary;
    let stored = NewReport {
        report: stored::to_stored(&report_to_proto(report))?,
        findings: FindingCounts { errors: summary.errors, warnings: summary.warnings, infos: summary.infos },
        summary: Some(stored::to_stored(&summary_to_proto(summary))?),
    };
    let (state, outcome, detail) = if report.is_accepted() {
        (JobState::Ready, "ready", String::new())
    } else {
        engine.inner.store.delete_checkpoints(id).await?;
        (JobState::Rejected, "rejected", format!("{} error(s) in the program", summary.errors))
    };
    engine.inner.metrics.validations.with_label_values(&[outcome]).inc();
    tracing::info!(outcome, setpoints = summary.setpoint_count, errors = summary.errors, "validated");
    finish(engine, id, state, &detail, Some(stored)).await
}

async fn finish(engine: &Engine, id: Uuid, state: JobState, detail: &str, report: Option<NewReport>) -> Result<()> {
    let from = [JobState::PendingValidation, JobState::Validating];
    match engine.inner.store.transition(id, &from, state, detail, report).await {
        // Cancelled or deleted in the meantime: that is final.
        Ok(_) | Err(StoreError::FailedState { .. } | StoreError::NotFound { .. }) => Ok(()),
        Err(error) => Err(error.into()),
    }
}
