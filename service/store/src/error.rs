//! Why an operation of the store did not happen.

use std::error::Error;
use std::fmt;
use std::sync::Arc;

use uuid::Uuid;

use crate::jobs::JobState;
use crate::programs::{ProgramId, UploadBound};
use crate::runs::RunState;

/// Shorthand for results of the store.
pub type Result<T, E = StoreError> = std::result::Result<T, E>;

/// What sort of record an error is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A stored program.
    Program,
    /// An unfinished upload of a program.
    Upload,
    /// A job.
    Job,
    /// The validation report of a job.
    Report,
    /// A checkpoint of a job.
    Checkpoint,
    /// A machine profile.
    Machine,
    /// A tool.
    Tool,
    /// A run.
    Run,
    /// How the telemetry of a job is judged.
    Monitoring,
    /// A condition of a run.
    Condition,
    /// A stretch of a run's telemetry.
    RecordedCut,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Kind::Program => "program",
            Kind::Upload => "upload",
            Kind::Job => "job",
            Kind::Report => "validation report",
            Kind::Checkpoint => "checkpoint",
            Kind::Machine => "machine",
            Kind::Tool => "tool",
            Kind::Run => "run",
            Kind::Monitoring => "monitoring configuration",
            Kind::Condition => "condition of the run",
            Kind::RecordedCut => "recorded cut",
        })
    }
}

/// Why an operation of the store did not happen. Unless a variant says otherwise, nothing was
/// changed. The messages name records and limits, never SQL; the database's own words are only in
/// [`Error::source`].
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// There is no such record.
    #[error("{kind} {id:?} does not exist")]
    NotFound {
        /// Sort of the missing record.
        kind: Kind,
        /// Identifier that was asked for.
        id: String,
    },
    /// A record with this identifier exists already.
    #[error("{kind} {id:?} already exists")]
    AlreadyExists {
        /// Sort of the record.
        kind: Kind,
        /// Identifier that is taken.
        id: String,
    },
    /// The request id was used before, for a job with different content.
    #[error("request id {request_id:?} was used for job {job_id} with different content")]
    Conflict {
        /// The request id used twice.
        request_id: String,
        /// The job made by its first use.
        job_id: Uuid,
    },
    /// The record is still referenced and therefore cannot be deleted.
    #[error("{kind} {id:?} is in use by {users} job(s)")]
    InUse {
        /// Sort of the record.
        kind: Kind,
        /// Identifier of the record.
        id: String,
        /// How many jobs reference it.
        users: u64,
    },
    /// The record changed since the caller read it.
    #[error("{kind} {id:?} has changed: its etag is now {current:?}")]
    EtagMismatch {
        /// Sort of the record.
        kind: Kind,
        /// Identifier of the record.
        id: String,
        /// The etag the record has now.
        current: String,
    },
    /// The page token is damaged, belongs to another list, or was used with other filters.
    #[error("the page token does not belong to this list and its filters")]
    InvalidPageToken,
    /// An upload continues elsewhere than the caller thought.
    #[error("upload {upload_id} continues at byte {expected}, not at byte {given}")]
    WrongOffset {
        /// The upload.
        upload_id: Uuid,
        /// The offset at which the next byte must be appended.
        expected: u64,
        /// The offset the caller gave.
        given: u64,
    },
    /// Something is larger than its limit.
    #[error("the {what} is {size}, the limit is {limit}")]
    TooLarge {
        /// What is too large, with its unit: "program size in bytes".
        what: &'static str,
        /// Its size.
        size: u64,
        /// The largest size allowed.
        limit: u64,
    },
    /// A text has a character that the database cannot keep.
    #[error("a text has the character U+0000, which this database cannot keep")]
    NulCharacter,
    /// There are as many unfinished uploads, or bytes of them, as the settings allow.
    #[error("there are already {limit} {}", bound.what())]
    LimitReached {
        /// What there is enough of.
        bound: UploadBound,
        /// How many are allowed.
        limit: u64,
    },
    /// An upload cannot be finished before all its bytes have arrived.
    #[error("upload {upload_id} has received {received} of {expected} bytes")]
    Incomplete {
        /// The upload.
        upload_id: Uuid,
        /// Bytes received so far.
        received: u64,
        /// Bytes announced when it began.
        expected: u64,
    },
    /// The bytes received do not have the announced hash. The upload was discarded.
    #[error("the upload was discarded: its bytes hash to {actual}, not to the announced {expected}")]
    HashMismatch {
        /// The SHA-256 announced when the upload began.
        expected: Box<ProgramId>,
        /// The SHA-256 of the bytes received.
        actual: Box<ProgramId>,
    },
    /// The job is in none of the states from which the change is allowed.
    #[error("job {job_id} is {actual}, the change needs {}", names(.expected))]
    FailedState {
        /// The job.
        job_id: Uuid,
        /// The state it is in.
        actual: JobState,
        /// The states from which the change is allowed.
        expected: Vec<JobState>,
    },
    /// The run has ended and takes nothing more.
    #[error("run {run_id} is {state} and takes nothing more")]
    RunEnded {
        /// The run.
        run_id: Uuid,
        /// Its state.
        state: RunState,
    },
    /// Another connection resumed the run.
    #[error("run {run_id} was taken up by another connection")]
    Detached {
        /// The run.
        run_id: Uuid,
    },
    /// The database did not do its part: disk full, locked by another program, closed, out of time.
    /// Repeating the operation later may succeed. A write refused this way is not acknowledged; if
    /// it failed while being committed it may still be found written.
    #[error("the database is unavailable: {reason}")]
    Unavailable {
        /// What failed, in words for an operator.
        reason: &'static str,
        /// The cause, where there is one.
        #[source]
        source: Option<Arc<dyn Error + Send + Sync>>,
    },
    /// The database cannot be opened or created.
    #[error("the database cannot be opened: {reason}")]
    CannotOpen {
        /// Why, in words for an operator.
        reason: &'static str,
        /// The cause, where there is one.
        #[source]
        source: Option<Arc<dyn Error + Send + Sync>>,
    },
    /// A copy cannot be made, or put in its place.
    #[error("the copy cannot be made: {reason}")]
    CannotCopy {
        /// Why, in words for an operator.
        reason: &'static str,
        /// The cause, where there is one.
        #[source]
        source: Option<Arc<dyn Error + Send + Sync>>,
    },
    /// Another process has the database open.
    #[error("the database is in use by {holder}: end that process, or name another database")]
    InUseBy {
        /// The process and its host, as it wrote them down.
        holder: String,
    },
    /// The database is not usable by this version: it belongs to a newer version or to another
    /// program.
    #[error("the database cannot be used by this version: {0}")]
    Incompatible(String),
    /// A copy is not intact, so it does not replace a database.
    #[error("the copy is damaged in {count} place(s), first: {first}")]
    Damaged {
        /// How many problems there are.
        count: u64,
        /// The first one.
        first: String,
    },
    /// Stored data cannot be read back as it was written.
    #[error("the database is damaged: {reason}")]
    Corrupt {
        /// What does not fit.
        reason: String,
        /// The cause, where there is one.
        #[source]
        source: Option<Arc<dyn Error + Send + Sync>>,
    },
}

impl StoreError {
    pub(crate) fn not_found(kind: Kind, id: impl ToString) -> Self {
        Self::NotFound { kind, id: id.to_string() }
    }

    pub(crate) fn corrupt(reason: impl Into<String>) -> Self {
        Self::Corrupt { reason: reason.into(), source: None }
    }

    pub(crate) fn corrupt_by(reason: impl Into<String>, source: impl Error + Send + Sync + 'static) -> Self {
        Self::Corrupt { reason: reason.into(), source: Some(Arc::new(source)) }
    }

    pub(crate) fn unavailable(reason: &'static str) -> Self {
        Self::Unavailable { reason, source: None }
    }

    pub(crate) fn unavailable_by(reason: &'static str, source: impl Error + Send + Sync + 'static) -> Self {
        Self::Unavailable { reason, source: Some(Arc::new(source)) }
    }
}

/// The limits of everything that comes from outside.
pub(crate) fn check_size(what: &'static str, size: usize, limit: u64) -> Result<()> {
    match size as u64 {
        size if size > limit => Err(StoreError::TooLarge { what, size, limit }),
        _ => Ok(()),
    }
}

fn names(states: &[JobState]) -> String {
    states.iter().map(|state| state.as_str()).collect::<Vec<_>>().join(" or ")
}
