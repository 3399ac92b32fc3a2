//! The queue of validations: jobs that wait, and attempts counted before the work begins. Where several replicas share a
//! database, who begins one has it for a while, and says again and again that it goes on.

use std::time::Duration;

use async_trait::async_trait;
use uuid::Uuid;

use crate::error::Result;
use crate::jobs::{Job, JobState, NewReport};

/// A job that is to be validated.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WaitingJob {
    /// Identifier of the job.
    pub id: Uuid,
    /// Place in the order in which jobs were created.
    pub sequence: i64,
    /// Who created it.
    pub client: String,
    /// Bytes of the program's source.
    pub program_size_bytes: u64,
    /// Attempts to validate it that did not end in order.
    pub attempts: u32,
}

/// What became of the wish to begin a validation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Attempt {
    /// This attempt, counted from 1, is durably counted: the work may begin.
    Begun(u32),
    /// Another replica is at it.
    Elsewhere,
    /// As many attempts as permitted ended with the process: the job has failed.
    GivenUp,
}

/// Keeps the queue of validations.
#[async_trait]
pub trait Validations {
    /// Jobs that wait for validation or were being validated, in the order in which they were created, behind place
    /// `after`, at most `limit`.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn waiting_jobs(&self, after: i64, limit: u32) -> Result<Vec<WaitingJob>>;

    /// Jobs whose validation another replica began and no longer goes on with, at most `limit`; none where one process has
    /// the database.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn abandoned_jobs(&self, limit: u32) -> Result<Vec<WaitingJob>>;

    /// For how long a validation that was begun is this replica's without a further word; `None`: as long as the process
    /// lives.
    fn lease(&self) -> Option<Duration>;

    /// Says that a validation goes on; false if it is not this replica's any more.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn renew_validation(&self, id: Uuid) -> Result<bool>;

    /// Counts an attempt and marks the job as being validated; of a job that was tried `max_attempts` times without an end
    /// it marks that it failed instead.
    ///
    /// # Errors
    /// `NotFound`, `FailedState` if the job needs no validation any more, `Unavailable`.
    async fn begin_validation(&self, id: Uuid, max_attempts: u32) -> Result<Attempt>;

    /// Moves a job to the state that its validation ended in, with its report. Nothing changes where another replica has
    /// begun a validation of its own, nor where the job needs none any more.
    ///
    /// # Errors
    /// `NotFound`, `FailedState`, `TooLarge`, `Unavailable`.
    async fn end_validation(&self, id: Uuid, to: JobState, detail: &str, report: Option<NewReport>) -> Result<Job>;

    /// Takes back the count of an attempt that was broken off in order, without a result, and lets any replica begin
    /// another. Where another replica has it already, nothing changes.
    ///
    /// # Errors
    /// `Unavailable`. A job that does not exist is none.
    async fn return_attempt(&self, id: Uuid) -> Result<()>;
}
