//! How long records are kept.

use std::time::Duration;

use async_trait::async_trait;

use crate::error::Result;

/// How long records are kept; `None`: for ever.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RetentionPolicy {
    /// Jobs that are cancelled, whose runs cannot be taken up, and those that are ready, rejected or failed and have no open
    /// run, since their last change. Their reports, checkpoints, runs and decisions go with them.
    pub jobs: Option<Duration>,
    /// Runs that have ended, since their last change. Their decisions go with them.
    pub runs: Option<Duration>,
    /// Programs that no job uses, since they were stored.
    pub programs: Option<Duration>,
    /// Events of jobs.
    pub events: Option<Duration>,
    /// Entries of the audit log.
    pub audit: Option<Duration>,
    /// Bytes in use within the database, free space, events and the audit log not counted: beyond, the oldest jobs that have
    /// ended go, and the programs that no job uses then. What those logs take is bounded by their own rules: it neither goes
    /// for the sake of jobs, nor do jobs go for its sake.
    pub bytes: Option<u64>,
}

/// How many records were removed, or would have been.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Removed {
    /// Jobs.
    pub jobs: u64,
    /// Runs, those of the jobs not counted.
    pub runs: u64,
    /// Programs.
    pub programs: u64,
    /// Events.
    pub events: u64,
    /// Entries of the audit log.
    pub audit: u64,
}

/// Removes what is kept no longer.
#[async_trait]
pub trait Retention {
    /// Counts what a policy would remove; what goes because of the size is not foreseen.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn expired(&self, policy: &RetentionPolicy) -> Result<Removed>;

    /// Removes it, a little at a time, so that other writes are not delayed, and gives free space back to the file system
    /// where the database was made for that.
    ///
    /// # Errors
    /// `Unavailable`; what was removed until then stays removed.
    async fn remove_expired(&self, policy: &RetentionPolicy) -> Result<Removed>;
}
