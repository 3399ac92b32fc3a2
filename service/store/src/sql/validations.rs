//! The queue of validations as rows, and what an attempt makes of a job.

use uuid::Uuid;

use super::jobs::program_size;
use super::record::{Record, parsed, unsigned};
use crate::error::{Result, StoreError};
use crate::jobs::JobState;
use crate::validations::{Attempt, WaitingJob};

/// The states of a job that is to be validated.
pub(crate) const WAITING: [JobState; 2] = [JobState::PendingValidation, JobState::Validating];

pub(crate) fn waiting(row: &impl Record) -> Result<WaitingJob> {
    Ok(WaitingJob {
        id: parsed(row, "id")?,
        sequence: row.integer("sequence")?,
        client: row.text("client")?.to_owned(),
        program_size_bytes: program_size(row)?,
        attempts: u32::try_from(unsigned(row, "attempts")?).unwrap_or(u32::MAX),
    })
}

/// What an attempt makes of a job.
#[derive(Debug)]
pub(crate) struct Beginning {
    /// The job's state until now.
    pub(crate) from: JobState,
    /// Its state from now on.
    pub(crate) to: JobState,
    /// Why.
    pub(crate) detail: String,
    /// Attempts from now on.
    pub(crate) attempts: i64,
    /// Whether the job changes: one that was broken off in order goes on as if nothing had happened.
    pub(crate) changed: bool,
    /// What the caller is told.
    pub(crate) outcome: Attempt,
}

impl Beginning {
    /// Of a job with the columns `state` and `attempts`, tried at most so often.
    ///
    /// # Errors
    /// `FailedState` if the job needs no validation any more, `Corrupt`.
    pub(crate) fn of(row: &impl Record, id: Uuid, max_attempts: u32) -> Result<Self> {
        let (from, attempts): (JobState, i64) = (parsed(row, "state")?, row.integer("attempts")?);
        if !WAITING.contains(&from) {
            return Err(StoreError::FailedState { job_id: id, actual: from, expected: WAITING.to_vec() });
        }
        let attempt = u32::try_from(attempts).unwrap_or(u32::MAX).saturating_add(1);
        if attempt > max_attempts {
            let detail =
                format!("validation ended with the service {attempts} time(s), which is as often as it is tried");
            let to = JobState::Failed;
            return Ok(Self { from, to, detail, attempts, changed: true, outcome: Attempt::GivenUp });
        }
        let detail = match attempt {
            1 => String::new(),
            _ => format!("attempt {attempt} of {max_attempts}: the one before ended with the service"),
        };
        let to = JobState::Validating;
        let changed = from != to || attempt > 1;
        Ok(Self { from, to, detail, attempts: i64::from(attempt), changed, outcome: Attempt::Begun(attempt) })
    }
}
