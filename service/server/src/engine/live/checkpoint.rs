//! Checkpoints of a live run: the generator's state with the running digest, so that a run of hours is taken up and proved
//! within what it generates in a moment.

use std::ops::Range;
use std::sync::Arc;

use feedwave_cutting::{OverrideChange, Pipeline, PipelineConfig};
use feedwave_store::{RunCheckpoint, RunMark, StoreError};
use sha2::digest::common::hazmat::{SerializableState as _, SerializedState};
use sha2::{Digest as _, Sha256};
use uuid::Uuid;

use crate::engine::{Engine, generation_key};
use crate::error::{Error, Result};

/// Setpoints between two checkpoints: what is generated in vain at most where a run is taken up, a tenth of a second.
pub(super) const INTERVAL: u64 = 1 << 17;
/// Checkpoints are kept at every interval over so many of them, at every second one over twice as many, and so on: their
/// number grows with the logarithm of the run's length.
const KEPT: u64 = 16;

/// The digest of the setpoints of a run, and how far a generator has come with them.
#[derive(Debug)]
pub(super) struct Start {
    pub(super) pipeline: Pipeline,
    pub(super) digest: Sha256,
}

/// The state of a generator with the digest of what it has generated, as a checkpoint.
pub(super) fn checkpoint(pipeline: &Pipeline, digest: &Sha256) -> Result<RunCheckpoint> {
    let config = pipeline.config();
    Ok(RunCheckpoint {
        mark: RunMark { setpoint_index: pipeline.next_index(), digest_state: digest_state(digest).into() },
        change_count: config.overrides.len() as u64,
        generation_key: generation_key(config),
        snapshot: pipeline.snapshot().map_err(Error::internal)?.into(),
    })
}

/// The state of a digest as bytes.
pub(super) fn digest_state(digest: &Sha256) -> Vec<u8> {
    digest.serialize().to_vec()
}

/// Setpoints whose checkpoints go where the one at `index` is kept.
pub(super) fn outdated(index: u64) -> Vec<Range<u64>> {
    let number = index / INTERVAL;
    let goes = |power: u32| {
        let old = number.checked_sub(KEPT << power)?;
        (old > 0 && old.trailing_zeros() == power).then(|| old * INTERVAL..(old + 1) * INTERVAL)
    };
    (0..u64::BITS - KEPT.ilog2()).map_while(|power| (KEPT << power <= number).then(|| goes(power))).flatten().collect()
}

/// Where the checkpoint behind one at `index` is due.
pub(super) const fn due_after(index: u64) -> u64 {
    (index / INTERVAL + 1) * INTERVAL
}

/// A generator that goes on where a checkpoint was taken, under all the changes of the run's log.
fn restore(config: &PipelineConfig, changes: &[OverrideChange], checkpoint: &RunCheckpoint) -> Result<Start, String> {
    let known = usize::try_from(checkpoint.change_count).ok().filter(|known| *known <= changes.len());
    let known = known.ok_or_else(|| format!("it knows {} of {} changes", checkpoint.change_count, changes.len()))?;
    let (before, after) = changes.split_at(known);
    let config = Arc::new(PipelineConfig { overrides: before.to_vec(), ..config.clone() });
    let mut pipeline = Pipeline::restore(config, &checkpoint.snapshot).map_err(|error| error.to_string())?;
    if pipeline.next_index() != checkpoint.mark.setpoint_index {
        return Err(format!("its snapshot is of setpoint {}", pipeline.next_index()));
    }
    for change in after {
        pipeline.append_override(*change).map_err(|error| error.to_string())?;
    }
    let state = SerializedState::<Sha256>::try_from(checkpoint.mark.digest_state.as_ref());
    let digest = state.ok().and_then(|state| Sha256::deserialize(&state).ok());
    Ok(Start { pipeline, digest: digest.ok_or("the state of its digest cannot be read")? })
}

impl Engine {
    /// A generator of a run at or before a setpoint, as near as a checkpoint allows.
    ///
    /// # Errors
    /// Those of the store.
    pub(super) async fn run_near(
        &self,
        run: Uuid,
        config: &PipelineConfig,
        changes: &[OverrideChange],
        index: u64,
    ) -> Result<Start> {
        let key = generation_key(config);
        let stored = match self.inner.store.nearest_run_checkpoint(run, &key, index).await {
            Ok(stored) => stored,
            // Derived data: without it the run only goes on later.
            Err(error @ StoreError::Corrupt { .. }) => {
                tracing::warn!(%run, ?error, "damaged checkpoint of a run");
                None
            }
            Err(error) => return Err(error.into()),
        };
        if let Some(checkpoint) = stored {
            match restore(config, changes, &checkpoint) {
                Ok(start) => return Ok(start),
                Err(reason) => {
                    tracing::warn!(%run, index = checkpoint.mark.setpoint_index, reason, "unusable checkpoint of a run");
                }
            }
        }
        let config = Arc::new(PipelineConfig { overrides: changes.to_vec(), ..config.clone() });
        Ok(Start { pipeline: Pipeline::new(config), digest: Sha256::new() })
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn a_run_of_ten_hours_keeps_few_checkpoints_and_the_newest_ones_all() {
        let mut kept = BTreeSet::new();
        let mut most = 0;
        // Ten hours at 1 ms, and at 50 µs.
        for number in 1..=20 * 36_000_000 / INTERVAL {
            // Blocks end somewhere behind the place where a checkpoint is due.
            let index = number * INTERVAL + number % 100;
            for range in outdated(index) {
                let gone: Vec<u64> = kept.range(range).copied().collect();
                assert_eq!(gone.len(), 1, "each goes once, in its turn");
                kept.retain(|index| *index != gone[0]);
            }
            kept.insert(index);
            most = most.max(kept.len());
            let newest: Vec<u64> = kept.iter().rev().take(KEPT as usize).map(|index| index / INTERVAL).collect();
            assert!(newest.iter().copied().eq((1..=number).rev().take(KEPT as usize)), "{newest:?}");
        }
        assert!(most <= 128, "{most}");
        // What a replay from the middle generates in vain is a share of what follows.
        let last = kept.last().copied().unwrap_or(0);
        for (before, after) in kept.iter().zip(kept.iter().skip(1)) {
            assert!((after - before) as f64 <= (0.15 * (last - before) as f64).max(1.1 * INTERVAL as f64));
        }
    }

    #[test]
    fn a_digest_goes_on_from_its_state() {
        let mut whole = Sha256::new();
        whole.update([7; 1_000]);
        let state = SerializedState::<Sha256>::try_from(digest_state(&whole).as_slice()).unwrap();
        let mut rest = Sha256::deserialize(&state).unwrap();
        whole.update([8; 77]);
        rest.update([8; 77]);
        assert_eq!(whole.finalize(), rest.finalize());
    }
}
