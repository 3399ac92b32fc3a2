//! The whole state as one value: a run resumes exactly where it was.

use super::spindle::Requests;
use super::{Monitor, Run, State};
use crate::config::MonitoringConfig;
use crate::rules::SpindleRule;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Changes whenever the layout of a snapshot does, or the meaning of a value in it.
const VERSION: u32 = 7;
/// Without the requests of the spindle speed that are in force at once, but for the newest.
const VERSION_WITH_PLAN: u32 = 6;
/// Without what is known of changes of the spindle speed.
const VERSION_WITHOUT_PLAN: u32 = 5;
/// As [`VERSION_WITHOUT_PLAN`], with the limits of [`SpindleRule::Turning`] in radians.
const VERSION_IN_RADIANS: u32 = 4;
/// What has been added stands at the end of a snapshot, and where there is nothing of it, it is a zero for each of its parts.
const ZEROS_WITH_PLAN: usize = 1;
const ZEROS_WITHOUT_PLAN: usize = 3 + ZEROS_WITH_PLAN;

#[derive(Serialize)]
struct SnapshotRef<'a> {
    version: u32,
    config: &'a MonitoringConfig,
    run: &'a Run,
}

#[derive(Deserialize)]
struct Snapshot {
    config: MonitoringConfig,
    run: Run,
}

/// A snapshot that is not one of this version or is damaged.
#[derive(Debug, Error)]
pub enum SnapshotError {
    /// Written by another version.
    #[error("the snapshot has version {found}, this is version {expected}")]
    Version {
        /// Version of the snapshot.
        found: u32,
        /// Version this crate writes.
        expected: u32,
    },
    /// Not decodable.
    #[error("the snapshot cannot be decoded")]
    Decode(#[from] postcard::Error),
    /// Decodable, but its parts contradict each other.
    #[error("the snapshot contradicts its configuration")]
    Inconsistent,
}

impl Monitor {
    /// Everything a continuation depends on, the configuration included.
    ///
    /// # Errors
    /// [`SnapshotError::Decode`] if the value cannot be encoded.
    pub fn snapshot(&self) -> Result<Vec<u8>, SnapshotError> {
        let snapshot = SnapshotRef { version: VERSION, config: &self.config, run: &self.run };
        Ok(postcard::to_allocvec(&snapshot)?)
    }

    /// Continues from a snapshot.
    ///
    /// # Errors
    /// [`SnapshotError`] when the bytes are not a whole and consistent snapshot of this version.
    pub fn restore(bytes: &[u8]) -> Result<Self, SnapshotError> {
        let (found, rest) = postcard::take_from_bytes::<u32>(bytes)?;
        let zeros = match found {
            VERSION => 0,
            VERSION_WITH_PLAN => ZEROS_WITH_PLAN,
            VERSION_WITHOUT_PLAN | VERSION_IN_RADIANS => ZEROS_WITHOUT_PLAN,
            _ => return Err(SnapshotError::Version { found, expected: VERSION }),
        };
        let Snapshot { mut config, mut run } =
            postcard::from_bytes(&[rest, &[0; ZEROS_WITHOUT_PLAN][..zeros]].concat())?;
        if found != VERSION {
            run.requests = Requests::from_plan(run.spindle);
        }
        if let SpindleRule::Turning { lower_deg, upper_deg, .. } = &mut config.rules.spindle
            && found == VERSION_IN_RADIANS
        {
            [lower_deg, upper_deg].into_iter().for_each(|limit| *limit = limit.to_degrees().clamp(-180.0, 180.0));
        }
        let steps = config.idle_run_up.as_ref().map_or(0, |idle| idle.spindle_rev_per_min.len());
        let step_exists = !matches!(run.state, State::IdleRunUp { step } if step as usize >= steps);
        let rules = &config.rules;
        // While the feed is held its override is 0, and what a resume takes is bounded.
        let feed = run.held_feed.unwrap_or(run.overrides.feed);
        let bounded = [(feed, rules.feed_bounds), (run.overrides.spindle, rules.spindle_bounds)]
            .iter()
            .all(|(value, bounds)| (bounds.lower..=bounds.upper).contains(value));
        if !config.violations().is_empty()
            || !step_exists
            || !bounded
            || (run.held_feed.is_some() && run.overrides.feed != 0.0)
            || run.baseline.len() != config.points()
            || !run.window.fits(&config)
            || !run.requests.fits(run.spindle)
        {
            return Err(SnapshotError::Inconsistent);
        }
        Ok(Self::with_run(config, run))
    }
}
