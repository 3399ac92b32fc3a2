//! Which jobs are worked on right now, so that cancelling a job ends the work.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use tokio_util::sync::CancellationToken;
use uuid::Uuid;

#[derive(Debug, Default)]
struct Entry {
    token: CancellationToken,
    users: usize,
}

/// One token for each job that is worked on.
#[derive(Clone, Debug, Default)]
pub struct ActiveJobs {
    entries: Arc<Mutex<HashMap<Uuid, Entry>>>,
}

impl ActiveJobs {
    fn entries(&self) -> std::sync::MutexGuard<'_, HashMap<Uuid, Entry>> {
        // Nothing in here panics half-way, so a poisoned map is valid.
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Registers work on a job until the guard is dropped.
    #[must_use]
    pub fn enter(&self, id: Uuid) -> JobGuard {
        let mut entries = self.entries();
        let entry = entries.entry(id).or_default();
        entry.users += 1;
        JobGuard { jobs: self.clone(), id, token: entry.token.clone() }
    }

    /// Ends all work on a job that is in progress.
    pub fn cancel(&self, id: Uuid) {
        if let Some(entry) = self.entries().get(&id) {
            entry.token.cancel();
        }
    }
}

/// Work on a job.
#[derive(Debug)]
pub struct JobGuard {
    jobs: ActiveJobs,
    id: Uuid,
    token: CancellationToken,
}

impl JobGuard {
    /// Cancelled when the job is.
    #[must_use]
    pub fn token(&self) -> &CancellationToken {
        &self.token
    }
}

impl Drop for JobGuard {
    fn drop(&mut self) {
        let mut entries = self.jobs.entries();
        if let Some(entry) = entries.get_mut(&self.id) {
            entry.users -= 1;
            if entry.users == 0 {
                entries.remove(&self.id);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cancelling_reaches_all_work_on_the_job_and_nothing_else() {
        let jobs = ActiveJobs::default();
        let (id, other) = (Uuid::from_u128(1), Uuid::from_u128(2));
        let guards = [jobs.enter(id), jobs.enter(id)];
        let bystander = jobs.enter(other);
        jobs.cancel(id);
        assert!(guards.iter().all(|guard| guard.token().is_cancelled()));
        assert!(!bystander.token().is_cancelled());
    }

    #[test]
    fn finished_work_leaves_nothing_behind() {
        let jobs = ActiveJobs::default();
        let id = Uuid::from_u128(1);
        let first = jobs.enter(id);
        jobs.cancel(id);
        drop(first);
        assert!(jobs.entries().is_empty());
        assert!(!jobs.enter(id).token().is_cancelled());
    }
}
