//! The background workers: jobs that wait become ready or rejected. The store is the queue, so nothing is lost
//! when the service stops; whose turn it is, `turns` says.

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use feedwave_contract::convert::{report_to_proto, summary_to_proto};
use feedwave_cutting::ValidationReport;
use feedwave_store::{Attempt, FindingCounts, JobDetail, JobState, NewReport, StoreError, WaitingJob};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::MissedTickBehavior;
use tracing::Instrument as _;
use uuid::Uuid;

use super::rebuild::store_checkpoint;
use super::turns::{Next, Turn};
use super::validation::{Go, Outcome, validate};
use super::{Engine, checkpoint_set, job_config};
use crate::error::{Error, Result};
use crate::observability::metrics::GaugeGuard;
use crate::stored;

/// How long to wait before asking a store again that did not answer.
const RETRY_AFTER: Duration = Duration::from_secs(1);
/// How often a validation is renewed within its lease.
const RENEWALS: u32 = 3;
/// Jobs read together when the queue is read.
const QUEUE_PAGE: u32 = 10_000;
/// Most jobs that wait in memory, some hundred bytes each. Those behind them wait in the store, in the order in which they
/// were created.
const MOST_WAITING: usize = 100_000;

/// Jobs of which it is decided in memory what comes next.
#[derive(Debug, Default)]
struct Queue {
    /// Everything in the store up to this place was read.
    read_to: i64,
    /// Jobs that wait or are under way.
    in_hand: HashSet<Uuid>,
    /// Whether there may be more in the store.
    more: bool,
}

/// What becomes of a job after its turns.
enum End {
    /// It needs no validation any more, or the service ends.
    Over(Uuid),
    /// It has no place among those begun, and waits again; how often until now.
    SetAside(WaitingJob, u32),
}

/// Keeps the workers busy until the service ends.
pub(super) async fn run(engine: Engine, mut given: mpsc::UnboundedReceiver<(WaitingJob, Turn)>) {
    let inner = &engine.inner;
    let mut running = JoinSet::new();
    let mut queue = Queue { more: true, ..Queue::default() };
    // Jobs come from other replicas as well.
    let mut events = inner.store.watch_events();
    let lease = inner.store.lease();
    let mut renewals = tokio::time::interval(lease.unwrap_or(RETRY_AFTER * RENEWALS) / RENEWALS);
    renewals.set_missed_tick_behavior(MissedTickBehavior::Delay);
    while !inner.draining.is_cancelled() {
        let mut retry = false;
        if queue.more
            && let Err(error) = fill(&engine, &mut queue).await
        {
            tracing::warn!(%error, "the queue of validations cannot be read");
            retry = true;
        }
        tokio::select! {
            () = inner.draining.cancelled() => {}
            () = inner.wake.notified() => queue.more = true,
            Ok(()) = events.changed(), if lease.is_some() => queue.more = true,
            _ = renewals.tick(), if lease.is_some() => {
                if let Err(error) = take_up(&engine, &mut queue).await {
                    tracing::warn!(%error, "abandoned validations cannot be looked for");
                }
            }
            () = tokio::time::sleep(RETRY_AFTER), if retry => {}
            Some((job, turn)) = given.recv() => {
                let engine = engine.clone();
                let span = tracing::info_span!("validate", job = %job.id);
                running.spawn(async move { work(engine, job, turn).await }.instrument(span));
            }
            Some(ended) = running.join_next(), if !running.is_empty() => match ended {
                Ok(End::Over(id)) => {
                    queue.in_hand.remove(&id);
                    queue.more = queue.more || queue.in_hand.len() + 1 == MOST_WAITING;
                }
                Ok(End::SetAside(job, times)) => inner.turns.set_aside(job, times),
                // The task itself never panics: it catches what the pipeline throws.
                Err(error) => tracing::error!(%error, "a validation worker failed"),
            },
        }
    }
    // Those whose turn came now never begin; validations look at the same token.
    given.close();
    while given.recv().await.is_some() {}
    while running.join_next().await.is_some() {}
}

/// Reads jobs that wait, as far as there is room for them.
async fn fill(engine: &Engine, queue: &mut Queue) -> Result<()> {
    while queue.more && queue.in_hand.len() < MOST_WAITING {
        let jobs = engine.inner.store.waiting_jobs(queue.read_to, QUEUE_PAGE).await?;
        queue.more = jobs.len() == QUEUE_PAGE as usize;
        for job in jobs {
            queue.read_to = queue.read_to.max(job.sequence);
            if queue.in_hand.insert(job.id) {
                engine.inner.turns.add_job(job);
            }
        }
    }
    Ok(())
}

/// Takes up jobs that other replicas began and no longer go on with.
async fn take_up(engine: &Engine, queue: &mut Queue) -> Result<()> {
    for job in engine.inner.store.abandoned_jobs(QUEUE_PAGE).await? {
        if queue.in_hand.insert(job.id) {
            engine.inner.turns.add_job(job);
        }
    }
    Ok(())
}

/// Validates one job, again and again while the store does not answer.
async fn work(engine: Engine, job: WaitingJob, turn: Turn) -> End {
    let id = job.id;
    let mut turn = Some(turn);
    loop {
        let error = match attempt(&engine, &job, &mut turn).await {
            Ok(end) => return end,
            Err(error) => error,
        };
        // The time until the next attempt is for others.
        drop(turn.take());
        match error {
            Error::StoreUnavailable(error) => tracing::warn!(%error, "the store does not answer"),
            error if is_gone(&engine, id).await => {
                tracing::debug!(%error, "the job was cancelled or deleted");
                return End::Over(id);
            }
            error => {
                tracing::error!(error = ?error, "validation failed");
                engine.inner.metrics.validations.with_label_values(&["failed"]).inc();
                match finish(&engine, id, JobState::Failed, &error.to_string(), None).await {
                    Err(Error::StoreUnavailable(_)) => {}
                    _ => return End::Over(id),
                }
            }
        }
        tokio::select! {
            () = engine.inner.draining.cancelled() => return End::Over(id),
            () = tokio::time::sleep(RETRY_AFTER) => {}
        }
        turn = engine.inner.turns.request(&job.client, job.program_size_bytes, 0).await;
        if turn.is_none() {
            return End::Over(id);
        }
    }
}

/// Whether a job needs no validation any more.
async fn is_gone(engine: &Engine, id: Uuid) -> bool {
    match engine.inner.store.job(id).await {
        Ok(job) => !matches!(job.state, JobState::PendingValidation | JobState::Validating),
        Err(error) => matches!(error, StoreError::NotFound { .. }),
    }
}

async fn attempt(engine: &Engine, job: &WaitingJob, turn: &mut Option<Turn>) -> Result<End> {
    let (inner, id) = (&engine.inner, job.id);
    let guard = inner.active.enter(id);
    match inner.store.begin_validation(id, inner.limits.validation_attempts).await {
        Ok(Attempt::Begun(1)) => {}
        Ok(Attempt::Begun(attempt)) => tracing::warn!(attempt, "an earlier attempt ended with the service"),
        Ok(Attempt::GivenUp) => {
            tracing::error!(attempts = job.attempts, "validation ended with the service each time: given up");
            inner.metrics.validations.with_label_values(&["failed"]).inc();
            return Ok(End::Over(id));
        }
        // Should that replica end, the job is found again among those that were abandoned.
        Ok(Attempt::Elsewhere) => return Ok(End::Over(id)),
        // Cancelled or deleted in the meantime.
        Err(StoreError::FailedState { .. } | StoreError::NotFound { .. }) => return Ok(End::Over(id)),
        Err(error) => return Err(error.into()),
    }
    let times = turn.as_ref().map_or(0, Turn::times);
    let stop = guard.token().child_token();
    let mut validation = std::pin::pin!(validated(engine, id, &stop, turn));
    let result = tokio::select! {
        result = &mut validation => result,
        () = lost(engine, id) => {
            stop.cancel();
            drop(validation.await);
            tracing::warn!("the validation is not this replica's any more");
            return Ok(End::Over(id));
        }
    };
    let broken_off = !matches!(result, Ok(Outcome::Reported(_)));
    if broken_off {
        // The process is as it was: whatever the cause, it was not taken down.
        inner.store.return_attempt(id).await?;
    }
    match result? {
        Outcome::Reported(report) => {
            conclude(engine, id, &report).await?;
            Ok(End::Over(id))
        }
        Outcome::Stopped => Ok(End::Over(id)),
        Outcome::SetAside => Ok(End::SetAside(job.clone(), times + 1)),
    }
}

/// Says again and again that a validation goes on; returns once it is another replica's.
async fn lost(engine: &Engine, id: Uuid) {
    let store = &engine.inner.store;
    let Some(lease) = store.lease() else { return std::future::pending().await };
    loop {
        tokio::time::sleep(lease / RENEWALS).await;
        match store.renew_validation(id).await {
            Ok(true) => {}
            // It was cancelled, then the validation is told; or another replica has it.
            Ok(false) => return,
            Err(error) => tracing::warn!(%error, "the validation could not be renewed"),
        }
    }
}

/// Validates a job that has a turn.
async fn validated(
    engine: &Engine,
    id: Uuid,
    cancelled: &tokio_util::sync::CancellationToken,
    turn: &mut Option<Turn>,
) -> Result<Outcome> {
    let inner = &engine.inner;
    let detail: JobDetail = inner.store.job_detail(id).await?;
    let config = Arc::new(job_config(&detail)?);
    let set = checkpoint_set(id, &config);
    let source = engine.job_source(&detail)?;
    let store = inner.store.clone();
    let runtime = tokio::runtime::Handle::current();
    let (cancelled, draining) = (cancelled.clone(), inner.draining.clone());
    let progress = inner.turns.track(id);
    let active = GaugeGuard::new(&inner.metrics.active_validations);
    let mut turn = turn.take().ok_or_else(|| Error::internal("a validation without a turn"))?;
    let run = tokio::task::spawn_blocking(move || {
        let _active = active;
        turn.start();
        let step = |bytes_read, setpoint_count| {
            progress.bytes_read.store(bytes_read, Ordering::Relaxed);
            progress.setpoint_count.store(setpoint_count, Ordering::Relaxed);
            let stopped = || cancelled.is_cancelled() || draining.is_cancelled();
            if !stopped() && turn.is_over() && turn.rest() == Next::SetAside {
                return Go::SetAside;
            }
            if stopped() { Go::Stop } else { Go::On }
        };
        validate(config, &source, step, |pipeline| store_checkpoint(&runtime, &store, &set, pipeline))
    });
    let outcome = run.await;
    inner.turns.untrack(id);
    outcome.map_err(|panic| Error::internal(format!("the pipeline failed: {panic}")))?
}

async fn conclude(engine: &Engine, id: Uuid, report: &ValidationReport) -> Result<()> {
    let summary = &report.summary;
    let stored = NewReport {
        report: stored::to_stored(&report_to_proto(report))?,
        findings: FindingCounts { errors: summary.errors, warnings: summary.warnings, infos: summary.infos },
        summary: Some(stored::to_stored(&summary_to_proto(summary, &report.programs))?),
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
    match engine.inner.store.end_validation(id, state, detail, report).await {
        // Cancelled or deleted in the meantime, or another replica began anew: that is final.
        Ok(_) | Err(StoreError::FailedState { .. } | StoreError::NotFound { .. }) => Ok(()),
        Err(error) => Err(error.into()),
    }
}
