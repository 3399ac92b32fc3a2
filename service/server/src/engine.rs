//! What works between calls and the pure pipeline: validation of jobs in the background, and generation of
//! setpoints for streams. Every pipeline runs on a blocking thread, looks at its cancellation token between
//! blocks, and never holds more than a few blocks.

mod active;
mod columns;
mod improvement;
mod interpretation;
mod live;
mod rebuild;
mod replicas;
mod schedule;
mod session;
mod source;
mod stream;
mod telemetry;
mod thread_path;
mod turns;
mod validation;
mod worker;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use feedwave_cutting::{MachineProfile, PipelineConfig};
use feedwave_store::{CheckpointSet, JobDetail, JobState, ProgramId, Store, StoreError, WaitingJob};
use tokio::sync::{Notify, Semaphore, mpsc};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;
use uuid::Uuid;

pub use active::{ActiveJobs, JobGuard};
pub use interpretation::Actions;
pub use live::LiveRun;
pub(crate) use live::{LiveInput, LiveIntake, LivePlan, feed_change_to_proto};
pub use session::{MAX_BATCH_EVENTS, MAX_BATCH_SAMPLES};
pub use source::{File, Source};
pub use stream::Generator;
pub(crate) use stream::beyond_end;
pub use telemetry::Ingestion;
pub(crate) use telemetry::Intake;
pub use turns::ValidationProgress;

use crate::config::Limits;
use crate::cut_off::CutOff;
use crate::error::{Error, Result, Violations};
use crate::events::EventReader;
use crate::observability::VERSION;
use crate::observability::metrics::Metrics;
use crate::stored;
use feedwave_contract::convert;
use feedwave_contract::names;
use feedwave_contract::proto;
use turns::{Turn, Turns};

/// Longest reason that a job is marked with, bytes.
const MAX_REASON_BYTES: usize = 1_000;

/// The engine of one server. Cloning is cheap.
#[derive(Clone, Debug)]
pub struct Engine {
    inner: Arc<Inner>,
}

struct Inner {
    store: Store,
    metrics: Arc<Metrics>,
    limits: Limits,
    /// Work that cancelling or deleting a job has to end.
    active: ActiveJobs,
    stream_places: Arc<Semaphore>,
    run_places: Arc<Semaphore>,
    handed_out: live::HandedOut,
    /// Places for the arithmetic of calls that is no validation.
    validation_places: Arc<Semaphore>,
    /// Jobs whose checkpoints are being made anew.
    rebuilding: rebuild::Rebuilding,
    /// Whose turn it is to validate.
    turns: Turns,
    /// Jobs whose turn has come; taken by the workers as they start.
    given: Mutex<Option<mpsc::UnboundedReceiver<(WaitingJob, Turn)>>>,
    wake: Notify,
    /// Where the grid of commits that can wait begins, for all runs.
    commit_grid: std::time::Instant,
    /// Cancelled when the service begins to end.
    draining: CancellationToken,
    cut_off: CutOff,
    tasks: TaskTracker,
}

impl std::fmt::Debug for Inner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Engine").field("limits", &self.limits).finish_non_exhaustive()
    }
}

impl Engine {
    /// An engine that does nothing yet; [`Engine::start`] sets the workers going.
    #[must_use]
    pub fn new(store: Store, metrics: Arc<Metrics>, limits: Limits, draining: CancellationToken) -> Self {
        let (turns, given) = Turns::new(
            limits.validation_workers,
            limits.begun_validations,
            limits.validation_turn(),
            store.lease().is_some(),
            metrics.clone(),
            draining.clone(),
        );
        let inner = Inner {
            rebuilding: rebuild::Rebuilding::default(),
            turns,
            given: Mutex::new(Some(given)),
            stream_places: Arc::new(Semaphore::new(limits.concurrent_streams)),
            run_places: Arc::new(Semaphore::new(limits.concurrent_runs)),
            handed_out: live::HandedOut::default(),
            validation_places: Arc::new(Semaphore::new(limits.validation_workers)),
            store,
            metrics,
            limits,
            active: ActiveJobs::default(),
            wake: Notify::new(),
            commit_grid: std::time::Instant::now(),
            draining,
            cut_off: CutOff::default(),
            tasks: TaskTracker::new(),
        };
        Self { inner: Arc::new(inner) }
    }

    /// Takes up jobs that wait for validation, those that an earlier run of the service left behind included.
    pub fn start(&self) {
        let given = self.inner.given.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(given) = given {
            let engine = self.clone();
            self.inner.tasks.spawn(async move { worker::run(engine, given).await });
            let events = EventReader::new(self.inner.store.clone(), self.inner.draining.clone());
            self.inner.tasks.spawn(replicas::follow(self.clone(), events));
            self.inner.tasks.spawn(replicas::share(self.clone()));
        }
    }

    /// Says that there is a new job to validate.
    pub fn wake(&self) {
        self.inner.wake.notify_one();
    }

    /// Registers work on a job, so that cancelling the job ends it.
    #[must_use]
    pub fn enter(&self, id: Uuid) -> JobGuard {
        self.inner.active.enter(id)
    }

    /// How far the validations of these jobs are; those that neither wait nor are validated are left out.
    #[must_use]
    pub fn progress(&self, jobs: &[Uuid]) -> HashMap<Uuid, ValidationProgress> {
        self.inner.turns.progress(jobs)
    }

    /// Jobs whose validation has begun and not ended.
    #[must_use]
    pub fn jobs_under_way(&self) -> u64 {
        self.inner.turns.jobs_under_way()
    }

    /// What the live runs of this replica have handed out.
    pub(crate) fn handed_out(&self) -> &live::HandedOut {
        &self.inner.handed_out
    }

    /// Ends the work on a job: its validation and its streams.
    pub fn cancel_job(&self, id: Uuid) {
        self.inner.active.cancel(id);
    }

    /// Marks a job as failed whose stored data is damaged, with the reason; other errors change nothing. Returns what is to be told.
    pub async fn mark_damaged(&self, id: Uuid, error: Error) -> Error {
        let Error::Damaged(reason) = &error else { return error };
        let from = [JobState::PendingValidation, JobState::Validating, JobState::Ready, JobState::Rejected];
        let mut detail = format!("stored data is damaged: {reason}");
        detail.truncate(detail.floor_char_boundary(MAX_REASON_BYTES));
        match self.inner.store.transition(id, &from, JobState::Failed, &detail, None).await {
            Ok(_) => tracing::error!(job = %id, %reason, "the job is marked as damaged"),
            // It is marked already, or gone.
            Err(StoreError::FailedState { .. } | StoreError::NotFound { .. }) => {}
            Err(error) => tracing::error!(job = %id, %reason, %error, "a damaged job could not be marked"),
        }
        error
    }

    /// The token that is cancelled when the service begins to end.
    #[must_use]
    pub fn draining(&self) -> &CancellationToken {
        &self.inner.draining
    }

    /// Whether this replica is cut off from the database of several.
    #[must_use]
    pub fn cut_off(&self) -> &CutOff {
        &self.inner.cut_off
    }

    /// Does something that the end of the service waits for.
    pub fn spawn(&self, work: impl Future<Output = ()> + Send + 'static) {
        self.inner.tasks.spawn(work);
    }

    /// Does work to its end, whoever still waits for it: what gives up the wait does not give up the work.
    ///
    /// # Errors
    /// [`Error::Internal`] where it panicked.
    pub(crate) async fn to_its_end<T: Send + 'static>(
        &self,
        work: impl Future<Output = T> + Send + 'static,
    ) -> Result<T> {
        self.inner.tasks.spawn(work).await.map_err(Error::internal)
    }

    /// Waits until nothing works any more; call once [`Engine::draining`] is cancelled.
    pub async fn stopped(&self) {
        self.inner.tasks.close();
        self.inner.tasks.wait().await;
    }
}

/// Configuration of the pipeline for a stored job.
///
/// # Errors
/// [`Error::Internal`] when the stored documents cannot be read.
pub fn job_config(detail: &JobDetail) -> Result<PipelineConfig> {
    let profile: proto::MachineProfile = stored::from_stored(detail.machine_snapshot.get())?;
    Ok(convert::pipeline_config(stored_profile(&profile)?, &job_settings(detail)?))
}

impl Engine {
    /// The programs of a stored job: its own, and its further files. Call inside a runtime.
    ///
    /// # Errors
    /// [`Error::Internal`] when the stored documents cannot be read.
    pub fn job_source(&self, detail: &JobDetail) -> Result<Source> {
        let store = &self.inner.store;
        let (own, size_bytes) = (detail.job.program_id, detail.job.program_size_bytes);
        let mut files = vec![File::stored_of_size(store.clone(), own, size_bytes)];
        for file in job_settings(detail)?.programs {
            files.push(File::stored(store.clone(), stored_program(&file)?.of_tenant(own.tenant())));
        }
        Ok(Source::new(files))
    }
}

/// The program of a further file whose bytes are stored.
fn stored_program(file: &proto::ProgramFile) -> Result<ProgramId> {
    let name = match &file.source {
        Some(proto::program_file::Source::Program(name)) => name.as_str(),
        _ => "",
    };
    names::parse_program(name).map_err(|error| Error::internal(format!("a stored further file: {error}")))
}

/// Settings of a stored job.
///
/// # Errors
/// [`Error::Internal`] when the stored document cannot be read.
pub fn job_settings(detail: &JobDetail) -> Result<proto::JobSettings> {
    stored::from_stored(detail.settings.get())
}

/// A profile that was checked before it was stored.
fn stored_profile(profile: &proto::MachineProfile) -> Result<MachineProfile> {
    let mut violations = Violations::default();
    convert::profile_from_proto(&mut violations, "profile", profile)
        .ok_or_else(|| Error::internal(format!("a stored profile is refused: {:?}", violations.as_slice())))
}

/// Waits until an instant; for ever where there is none.
pub(crate) async fn until(instant: Option<impl Into<Instant>>) {
    match instant {
        Some(instant) => tokio::time::sleep_until(instant.into()).await,
        None => std::future::pending().await,
    }
}

/// Which stored checkpoints fit a run of the pipeline over a job.
fn checkpoint_set(job_id: Uuid, config: &PipelineConfig) -> CheckpointSet {
    let interpolation_period_us = config.interpolation_period_us;
    CheckpointSet { job_id, interpolation_period_us, generation_key: generation_key(config) }
}

/// What a checkpoint depends on besides job, interpolation period and changes of the feed.
fn generation_key(config: &PipelineConfig) -> String {
    let mode = convert::generation_mode_to_proto(config.generation_mode).as_str_name();
    // Another version may plan otherwise: its checkpoints are not ours.
    format!("{mode}/{VERSION}")
}
