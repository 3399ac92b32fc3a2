//! One run of the pipeline over a whole program, to judge it and to leave checkpoints for streams.

use std::sync::Arc;

use feedwave_cutting::{Pipeline, PipelineConfig, Step, Validation, ValidationReport};

use super::source::Source;
use super::turns::{Next, Turn};
use crate::error::{Error, Result};
use crate::observability::metrics::GaugeGuard;

/// Setpoints between the first checkpoints: what a stream generates in vain when it starts in between, some
/// milliseconds.
pub(super) const CHECKPOINT_INTERVAL: u64 = 1 << 17;
/// Later ones lie further apart, by this share of the index, so that their number grows with the logarithm of the
/// program's length only: at most 500 for the longest program there can be.
const CHECKPOINT_SHARE: u64 = 64;

/// What became of a validation.
pub(super) enum Outcome {
    /// The report.
    Reported(Box<ValidationReport>),
    /// It was stopped first.
    Stopped,
    /// It is to begin again later.
    SetAside,
}

/// What a validation does after a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Go {
    /// The next one.
    On,
    /// None any more.
    Stop,
    /// It gives up what it has done.
    SetAside,
}

/// Runs the pipeline to the end, or until `step` says so, which is told after every block or input the bytes read and the
/// setpoints generated. `checkpoint` is called between blocks, with the pipeline, wherever one is due.
///
/// # Errors
/// Those of the source and of `checkpoint`.
pub(super) fn validate(
    config: Arc<PipelineConfig>,
    source: &Source,
    mut step: impl FnMut(u64, u64) -> Go,
    mut checkpoint: impl FnMut(&Pipeline) -> Result<()>,
) -> Result<Outcome> {
    let mut validation = Validation::new(config);
    let mut due = CHECKPOINT_INTERVAL;
    loop {
        match step(validation.pipeline().place().offset, validation.pipeline().next_index()) {
            Go::On => {}
            Go::Stop => return Ok(Outcome::Stopped),
            Go::SetAside => return Ok(Outcome::SetAside),
        }
        match validation.step() {
            Step::NeedInput(place) => match source.read(place)? {
                Some(bytes) => validation.push(&bytes),
                None => validation.finish_input(),
            },
            Step::Block => {
                let next_index = validation.pipeline().next_index();
                // An empty block: setpoints have stopped at an error.
                if next_index >= due && !validation.block().is_empty() {
                    checkpoint(validation.pipeline())?;
                    due = next_index + CHECKPOINT_INTERVAL.max(next_index / CHECKPOINT_SHARE);
                }
            }
            Step::Finished | Step::Refused => return Ok(Outcome::Reported(Box::new(validation.finish()))),
        }
    }
}

impl super::Engine {
    /// Does some milliseconds of arithmetic where it holds up no call.
    ///
    /// # Errors
    /// [`Error::Internal`] where no thread can be had for it.
    pub async fn compute<T: Send + 'static>(&self, work: impl FnOnce() -> T + Send + 'static) -> Result<T> {
        let place = self.inner.validation_places.clone().acquire_owned().await.map_err(Error::internal)?;
        let run = self.inner.tasks.spawn_blocking(move || {
            let _held = place;
            work()
        });
        run.await.map_err(Error::internal)
    }

    /// Validates a program of `program_bytes` bytes for `client` without storing anything; it has turns as the validations
    /// of jobs have. Dropping the future ends the work.
    ///
    /// # Errors
    /// [`Error::Draining`] when the service ends first.
    pub async fn validate_program(
        &self,
        client: &str,
        config: PipelineConfig,
        program_bytes: u64,
        source: Source,
    ) -> Result<ValidationReport> {
        let config = Arc::new(config);
        let mut times = 0;
        loop {
            let turn = self.inner.turns.request(client, program_bytes, times).await.ok_or(Error::Draining)?;
            match self.validate_in_turns(turn, config.clone(), source.clone()).await? {
                Outcome::Reported(report) => return Ok(*report),
                Outcome::Stopped => return Err(Error::Draining),
                Outcome::SetAside => times += 1,
            }
        }
    }

    async fn validate_in_turns(&self, mut turn: Turn, config: Arc<PipelineConfig>, source: Source) -> Result<Outcome> {
        let token = self.inner.draining.child_token();
        let cancel_when_dropped = token.clone().drop_guard();
        let active = GaugeGuard::new(&self.inner.metrics.active_validations);
        let run = self.inner.tasks.spawn_blocking(move || {
            let _active = active;
            turn.start();
            let step = |_, _| {
                if !token.is_cancelled() && turn.is_over() && turn.rest() == Next::SetAside {
                    return Go::SetAside;
                }
                if token.is_cancelled() { Go::Stop } else { Go::On }
            };
            validate(config, &source, step, |_| Ok(()))
        });
        let outcome = run.await.map_err(Error::internal)?;
        drop(cancel_when_dropped);
        outcome
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checkpoints_of_the_longest_program_stay_few() {
        let mut due = CHECKPOINT_INTERVAL;
        let mut count = 0;
        while due < 1 << 32 {
            count += 1;
            due += CHECKPOINT_INTERVAL.max(due / CHECKPOINT_SHARE);
        }
        assert!(count <= 500, "{count}");
    }
}
