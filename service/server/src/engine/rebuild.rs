//! Checkpoints made anew, where those that are stored cannot be used: they are derived from the program, so nothing is lost.

use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError};

use feedwave_cutting::Pipeline;
use feedwave_store::{Checkpoint, CheckpointSet, JobDetail, JobState, Store, StoreError};
use tokio::runtime::Handle;
use uuid::Uuid;

use super::turns::Next;
use super::validation::{Go, validate};
use super::{Engine, checkpoint_set, job_config};
use crate::error::{Error, Result};

/// Jobs whose checkpoints are being made anew.
#[derive(Clone, Debug, Default)]
pub(super) struct Rebuilding(Arc<Mutex<HashSet<Uuid>>>);

impl Rebuilding {
    fn jobs(&self) -> std::sync::MutexGuard<'_, HashSet<Uuid>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Stores a snapshot of a pipeline. Call on a blocking thread.
pub(super) fn store_checkpoint(
    runtime: &Handle,
    store: &Store,
    set: &CheckpointSet,
    pipeline: &Pipeline,
) -> Result<()> {
    let checkpoint = Checkpoint {
        setpoint_index: pipeline.next_index(),
        input_offset: pipeline.place().offset,
        snapshot: pipeline.snapshot().map_err(Error::internal)?.into(),
    };
    match runtime.block_on(store.put_checkpoints(set, vec![checkpoint])) {
        // Derived data: without it streams only begin later. A wide look-ahead over splines is that large.
        Err(error @ StoreError::TooLarge { .. }) => {
            tracing::warn!(job = %set.job_id, index = pipeline.next_index(), %error, "no checkpoint");
            Ok(())
        }
        stored => Ok(stored?),
    }
}

impl Engine {
    /// Makes the checkpoints of a job anew in the background; streams meanwhile begin at the start of the program.
    pub(super) fn rebuild_checkpoints(&self, detail: &JobDetail) {
        let id = detail.job.id;
        if detail.job.state != JobState::Ready || !self.inner.rebuilding.jobs().insert(id) {
            return;
        }
        let (engine, detail) = (self.clone(), detail.clone());
        self.inner.tasks.spawn(async move {
            match engine.rebuild(&detail).await {
                Ok(()) => tracing::info!(job = %id, "checkpoints were made anew"),
                Err(error) => tracing::warn!(job = %id, ?error, "checkpoints could not be made anew"),
            }
            engine.inner.rebuilding.jobs().remove(&id);
        });
    }

    async fn rebuild(&self, detail: &JobDetail) -> Result<()> {
        let inner = &self.inner;
        let guard = inner.active.enter(detail.job.id);
        inner.store.delete_checkpoints(detail.job.id).await?;
        let config = Arc::new(job_config(detail)?);
        let set = checkpoint_set(detail.job.id, &config);
        let source = self.job_source(detail)?;
        let mut times = 0;
        loop {
            let bytes = detail.job.program_size_bytes;
            // On behalf of nobody: it has a share of its own.
            let mut turn = inner.turns.request("checkpoints", bytes, times).await.ok_or(Error::Draining)?;
            let (config, set, source) = (config.clone(), set.clone(), source.clone());
            let (store, runtime) = (inner.store.clone(), Handle::current());
            let (cancelled, draining) = (guard.token().clone(), inner.draining.clone());
            let run = inner.tasks.spawn_blocking(move || {
                turn.start();
                let stopped = || cancelled.is_cancelled() || draining.is_cancelled();
                let step = |_, _| {
                    if !stopped() && turn.is_over() && turn.rest() == Next::SetAside {
                        return Go::SetAside;
                    }
                    if stopped() { Go::Stop } else { Go::On }
                };
                validate(config, &source, step, |pipeline| store_checkpoint(&runtime, &store, &set, pipeline))
            });
            match run.await.map_err(Error::internal)?? {
                super::validation::Outcome::SetAside => times += 1,
                _ => return Ok(()),
            }
        }
    }
}
