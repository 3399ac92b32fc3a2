//! The path of one threading pass of a stored job, from the last checkpoint before it was planned.

use std::sync::Arc;

use feedwave_cutting::thread::KeptPass;
use feedwave_cutting::{MAX_SETPOINTS, Pipeline, PipelineConfig, Step};
use feedwave_store::JobDetail;

use super::Engine;
use super::validation::CHECKPOINT_INTERVAL;
use crate::error::{Error, Result};

impl Engine {
    /// One pass of a stored job's thread: the program is planned up to it, from a checkpoint on. Both numbers
    /// count from 0, in the order of the report's threads and of their passes. Dropping the future ends the work.
    ///
    /// # Errors
    /// [`Error::Draining`] when the service ends first, those of the store, and [`Error::Internal`] where the program has no
    /// such pass.
    pub async fn thread_pass(&self, detail: &JobDetail, thread: u32, pass: u32) -> Result<KeptPass> {
        let config = Arc::new(super::job_config(detail)?);
        let source = self.job_source(detail)?;
        let place = self.inner.validation_places.clone().acquire_owned().await.map_err(Error::internal)?;
        let wanted = (u64::from(thread), pass as usize);
        let mut pipeline = self.pipeline_before(detail, config, wanted).await?.keeping_path(wanted.0, wanted.1);
        let token = self.inner.draining.child_token();
        let cancel_when_dropped = token.clone().drop_guard();
        let regenerated = self.inner.metrics.regenerated_setpoints.clone();
        let run = self.inner.tasks.spawn_blocking(move || {
            let _held = place;
            let mut block = pipeline.new_block();
            loop {
                if let Some(pass) = pipeline.kept_pass() {
                    return Ok(pass.clone());
                }
                if token.is_cancelled() {
                    return Err(Error::Draining);
                }
                match pipeline.next_block(&mut block) {
                    Step::NeedInput(place) => match source.read(place)? {
                        Some(bytes) => pipeline.push(&bytes),
                        None => pipeline.finish_input(),
                    },
                    Step::Block => regenerated.inc_by(block.len() as u64),
                    Step::Finished | Step::Refused => {
                        return Err(Error::internal(format!("no pass {pass} of thread {thread} was planned")));
                    }
                }
            }
        });
        let pass = run.await.map_err(Error::internal)?;
        drop(cancel_when_dropped);
        pass
    }

    /// A pipeline that has not planned a pass yet, as near before it as a checkpoint allows: what is planned grows with the
    /// setpoint, so the checkpoints are bisected.
    async fn pipeline_before(
        &self,
        detail: &JobDetail,
        config: Arc<PipelineConfig>,
        wanted: (u64, usize),
    ) -> Result<Pipeline> {
        let mut best = Pipeline::new(config.clone());
        // The last checkpoint at or before `low` has not planned it, none from `high` on has not.
        let (mut low, mut high) = (0, MAX_SETPOINTS);
        while high - low > CHECKPOINT_INTERVAL {
            let middle = low + (high - low) / 2;
            let pipeline = self.pipeline_near(detail, config.clone(), middle).await?;
            let index = pipeline.next_index();
            if index <= best.next_index() {
                low = middle;
            } else if pipeline.next_thread_pass() <= wanted {
                (best, low) = (pipeline, middle);
            } else {
                high = index;
            }
        }
        Ok(best)
    }
}
