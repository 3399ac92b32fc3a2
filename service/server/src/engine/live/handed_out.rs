//! How many setpoints of a run a client may have.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use feedwave_store::{AttachedRun, Run};
use uuid::Uuid;

use crate::error::{Error, Result};

/// Setpoints that are handed out at most before the log says so: after a breakdown no more are missing in it.
pub(super) const MOST_UNCOMMITTED: u64 = 16_384;

/// What the streams of this replica have handed out of the runs that they were the last to have, as far as is known here.
#[derive(Clone, Debug, Default)]
pub(crate) struct HandedOut {
    runs: Arc<Mutex<HashMap<Uuid, Count>>>,
}

#[derive(Clone, Copy, Debug)]
struct Count {
    /// The stream's number of the run's: a later one, maybe of another replica, has handed out more.
    attachment: u64,
    /// All setpoints before this one may be with the client.
    index: u64,
}

impl HandedOut {
    /// Refuses that a run goes on behind what was handed out: the client cannot have the setpoints between.
    ///
    /// # Errors
    /// [`Error::OutOfRange`].
    pub(crate) fn check(&self, run: &Run, first_index: u64) -> Result<()> {
        let logged = run.setpoints.sent;
        let known = self.runs().get(&run.id).filter(|count| count.attachment == run.attachment).copied();
        let most = known.map_or(logged.saturating_add(MOST_UNCOMMITTED), |known| known.index.max(logged));
        if first_index <= most {
            return Ok(());
        }
        let sent = known.map_or(logged, |_| most);
        let message = format!("start_index is {first_index}, but only {sent} setpoints were handed out");
        let metadata = vec![("setpoints_sent", sent.to_string())];
        Err(Error::OutOfRange { reason: "START_BEYOND_SENT", message, metadata })
    }

    /// The count of a run that goes on from `first_index`.
    pub(super) fn of_run(&self, attached: &AttachedRun, first_index: u64) -> RunHandedOut {
        let (run, attachment) = (&attached.run, attached.attachment);
        let index = run.setpoints.sent.max(first_index);
        let mut runs = self.runs();
        let before = runs.get(&run.id).filter(|before| before.attachment < attachment).map_or(0, |before| before.index);
        runs.insert(run.id, Count { attachment, index: index.max(before) });
        RunHandedOut { all: self.clone(), run: run.id, attachment }
    }

    fn runs(&self) -> MutexGuard<'_, HashMap<Uuid, Count>> {
        self.runs.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The count of one stream of a run.
#[derive(Debug)]
pub(super) struct RunHandedOut {
    all: HandedOut,
    run: Uuid,
    attachment: u64,
}

impl RunHandedOut {
    /// All setpoints before this one may be with the client.
    pub(super) fn reach(&self, index: u64) {
        let mut runs = self.all.runs();
        if let Some(count) = runs.get_mut(&self.run).filter(|count| count.attachment == self.attachment) {
            count.index = index.max(count.index);
        }
    }

    /// The run has ended, or is another stream's, which has its own count.
    pub(super) fn forget(&self) {
        let mut runs = self.all.runs();
        if runs.get(&self.run).is_some_and(|count| count.attachment == self.attachment) {
            runs.remove(&self.run);
        }
    }
}

#[cfg(test)]
mod tests {
    use feedwave_store::{RunKind, RunSetpoints, RunState, Tenant};
    use serde_json::value::RawValue;

    use super::*;

    fn run(attachment: u64, sent: u64) -> AttachedRun {
        let run = Run {
            id: Uuid::from_u128(7),
            tenant: Tenant::DEFAULT,
            sequence: 1,
            job_id: Uuid::from_u128(3),
            kind: RunKind::Live,
            state: RunState::Open,
            state_detail: String::new(),
            created_us: 0,
            updated_us: 0,
            newest_batch: None,
            setpoints: RunSetpoints { received: 0, sent, digest: None },
            settings: RawValue::from_string("{}".to_owned()).unwrap(),
            attachment,
            open_conditions: 0,
        };
        AttachedRun { run, attachment, monitor: Vec::new().into(), overrides: Vec::new() }
    }

    #[test]
    fn what_another_replica_handed_out_since_is_not_refused() {
        let (one, other) = (HandedOut::default(), HandedOut::default());
        one.of_run(&run(1, 0), 0).reach(10_000);
        assert!(one.check(&run(1, 9_000).run, 10_000).is_ok());
        assert!(one.check(&run(1, 9_000).run, 10_001).is_err(), "exact where it was handed out");
        other.of_run(&run(2, 9_500), 10_000).reach(10_700);
        // The other replica broke down before it was in the log.
        assert!(one.check(&run(2, 9_500).run, 10_700).is_ok());
        assert!(one.check(&run(2, 9_500).run, 9_500 + MOST_UNCOMMITTED + 1).is_err());
    }

    #[test]
    fn a_stream_that_lost_its_run_changes_nothing() {
        let all = HandedOut::default();
        let first = all.of_run(&run(1, 0), 0);
        first.reach(100);
        let second = all.of_run(&run(2, 50), 80);
        first.reach(1_000);
        first.forget();
        assert!(all.check(&run(2, 50).run, 100).is_ok() && all.check(&run(2, 50).run, 101).is_err());
        second.forget();
        first.reach(1_000);
        assert!(all.runs().is_empty());
    }
}
