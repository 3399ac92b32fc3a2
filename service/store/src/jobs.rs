//! Jobs: a program on a machine with settings, its state, and the log of its state changes.

use std::fmt;
use std::str::FromStr;

use async_trait::async_trait;
use sha2::{Digest, Sha256};
use tokio::sync::watch;
use uuid::Uuid;

use crate::Json;
use crate::error::{Result, StoreError};
use crate::page::{Page, PageRequest};
use crate::programs::ProgramId;
use crate::tenant::Tenant;

/// State of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum JobState {
    /// Stored, not yet validated.
    PendingValidation,
    /// Being validated.
    Validating,
    /// Validated without errors: setpoints can be streamed.
    Ready,
    /// Validated with errors; the report says which.
    Rejected,
    /// Cancelled on request.
    Cancelled,
    /// The service could not do its part; the event's detail says why.
    Failed,
}

impl JobState {
    /// Every state.
    pub const ALL: [Self; 6] =
        [Self::PendingValidation, Self::Validating, Self::Ready, Self::Rejected, Self::Cancelled, Self::Failed];

    /// Name of the state in the database and in messages, for example `pending_validation`.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::PendingValidation => "pending_validation",
            Self::Validating => "validating",
            Self::Ready => "ready",
            Self::Rejected => "rejected",
            Self::Cancelled => "cancelled",
            Self::Failed => "failed",
        }
    }
}

impl fmt::Display for JobState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// The text names no job state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("not the name of a job state")]
pub struct UnknownJobState;

impl FromStr for JobState {
    type Err = UnknownJobState;

    fn from_str(text: &str) -> Result<Self, UnknownJobState> {
        Self::ALL.into_iter().find(|state| state.as_str() == text).ok_or(UnknownJobState)
    }
}

/// A digest of what a client asked for, which distinguishes a repeated request from a different one
/// with the same request id.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Fingerprint([u8; 32]);

impl Fingerprint {
    /// The fingerprint of a request made of these parts. Take what the client sent, before anything
    /// that may change between two attempts (defaults, the current machine profile) is filled in.
    pub fn of<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> Self {
        let mut hash = Sha256::new();
        for part in parts {
            // The length keeps ("ab", "c") apart from ("a", "bc").
            hash.update((part.len() as u64).to_le_bytes());
            hash.update(part);
        }
        Self(hash.finalize().into())
    }

    /// The fingerprint that was kept; bytes that are none become one that no request has.
    pub(crate) fn stored(bytes: &[u8]) -> Self {
        bytes.try_into().map_or_else(|_| Self::of([bytes]), Self)
    }

    /// The digest.
    pub const fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

/// A job to be created.
#[derive(Debug, Clone)]
pub struct NewJob {
    /// The tenant whose job it is; its programs must be of the same one.
    pub tenant: Tenant,
    /// Name of the client that creates it; may be empty.
    pub owner: String,
    /// Chosen by the client; a second creation with the same id and fingerprint in the tenant returns the first
    /// job.
    pub request_id: String,
    /// Digest of what the client asked for.
    pub fingerprint: Fingerprint,
    /// Name for people.
    pub display_name: String,
    /// The program, which must be stored.
    pub program_id: ProgramId,
    /// Further program files, which must be stored and remain while the job does; one may be there more than once.
    pub further_program_ids: Vec<ProgramId>,
    /// The machine's identifier, by which jobs are filtered.
    pub machine_id: String,
    /// Who creates it: validations are shared out by clients.
    pub client: String,
    /// The machine profile as it is now: later edits of the profile do not change the job.
    pub machine_snapshot: Json,
    /// Settings of the job.
    pub settings: Json,
}

/// How many findings a report has, by severity.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FindingCounts {
    /// Findings that prevent the job.
    pub errors: u64,
    /// Findings that deserve attention.
    pub warnings: u64,
    /// Findings that inform.
    pub infos: u64,
}

/// A job as lists show it.
#[derive(Debug, Clone)]
pub struct Job {
    /// Identifier (UUID version 7).
    pub id: Uuid,
    /// Place in the order in which jobs were created.
    pub sequence: i64,
    /// The tenant whose job it is.
    pub tenant: Tenant,
    /// Name of the client that created it; may be empty.
    pub owner: String,
    /// The client's request id.
    pub request_id: String,
    /// Name for people.
    pub display_name: String,
    /// The program.
    pub program_id: ProgramId,
    /// Bytes of the program's source; 0 where the program is lost.
    pub program_size_bytes: u64,
    /// The machine's identifier.
    pub machine_id: String,
    /// State of the job.
    pub state: JobState,
    /// Detail of the last state change, for example why the job failed; may be empty.
    pub state_detail: String,
    /// Counts of the validation report, once there is one.
    pub findings: Option<FindingCounts>,
    /// Summary given with the validation report, for lists.
    pub summary: Option<Json>,
    /// When it was created, microseconds since the Unix epoch.
    pub created_us: i64,
    /// When it last changed, microseconds since the Unix epoch.
    pub updated_us: i64,
    /// Counts the changes, from 1.
    pub revision: u64,
    /// Attempts to validate it, but for those that were broken off in order.
    pub attempts: u32,
}

impl Job {
    /// The job as the answer to a repeated request.
    ///
    /// # Errors
    /// [`StoreError::Conflict`] where the request that it was created by, `first`, is another one.
    pub fn repeated(self, first: &Fingerprint, repeated: &Fingerprint) -> Result<Self> {
        if first == repeated {
            return Ok(self);
        }
        Err(StoreError::Conflict { request_id: self.request_id, job_id: self.id })
    }
}

impl Job {
    /// Strong entity tag: equal exactly while the job is unchanged. Without quotes.
    pub fn etag(&self) -> String {
        self.revision.to_string()
    }
}

/// A job with its documents.
#[derive(Debug, Clone)]
pub struct JobDetail {
    /// The job as lists show it.
    pub job: Job,
    /// The machine profile when the job was created.
    pub machine_snapshot: Json,
    /// Settings of the job.
    pub settings: Json,
}

/// A validation report to be stored.
#[derive(Debug, Clone)]
pub struct NewReport {
    /// The report.
    pub report: Json,
    /// Its findings by severity.
    pub findings: FindingCounts,
    /// What lists show of it.
    pub summary: Option<Json>,
}

/// A stored validation report.
#[derive(Debug, Clone)]
pub struct StoredReport {
    /// The job.
    pub job_id: Uuid,
    /// The report.
    pub report: Json,
    /// Its findings by severity.
    pub findings: FindingCounts,
    /// When it was stored, microseconds since the Unix epoch.
    pub created_us: i64,
}

/// One change of a job's state. Events stay when their job is deleted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JobEvent {
    /// Position in the log of all jobs; grows by time, never used twice.
    pub sequence: i64,
    /// The tenant whose job it is.
    pub tenant: Tenant,
    /// The job.
    pub job_id: Uuid,
    /// State before; `None` when the job was created.
    pub from_state: Option<JobState>,
    /// State after; `None` when the job was deleted.
    pub to_state: Option<JobState>,
    /// When it happened, microseconds since the Unix epoch.
    pub at_us: i64,
    /// Why, in words; may be empty.
    pub detail: String,
}

/// Which jobs a list shows. The default shows all.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct JobFilter {
    /// Only this tenant's.
    pub tenant: Option<Tenant>,
    /// Only these states; empty for any.
    pub states: Vec<JobState>,
    /// Only this machine.
    pub machine_id: Option<String>,
    /// Only jobs created at this time or later, microseconds since the Unix epoch.
    pub created_from_us: Option<i64>,
    /// Only jobs created before this time, microseconds since the Unix epoch.
    pub created_before_us: Option<i64>,
}

/// Which events a list shows. The default shows all.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EventFilter {
    /// Only this tenant's.
    pub tenant: Option<Tenant>,
    /// Only this job's.
    pub job_id: Option<Uuid>,
}

/// Most events that [`Jobs::events_after`] returns at a time.
pub const MAX_EVENTS: u32 = 1000;

/// Keeps jobs.
#[async_trait]
pub trait Jobs {
    /// Creates a job in state [`JobState::PendingValidation`], or returns the one that the same
    /// request created before.
    ///
    /// # Errors
    /// `Conflict` if the request id was used with another fingerprint, `NotFound` if the program
    /// does not exist, `TooLarge`, `Unavailable`.
    async fn create_job(&self, job: NewJob) -> Result<Job>;

    /// A job as lists show it.
    ///
    /// # Errors
    /// `NotFound`, `Unavailable`.
    async fn job(&self, id: Uuid) -> Result<Job>;

    /// A job with machine profile and settings.
    ///
    /// # Errors
    /// `NotFound`, `Unavailable`.
    async fn job_detail(&self, id: Uuid) -> Result<JobDetail>;

    /// The job of a tenant created with this request id, if there is one, and the fingerprint of that request.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn job_by_request(&self, tenant: Tenant, request_id: &str) -> Result<Option<(Job, Fingerprint)>>;

    /// Jobs in the order in which they were created, newest first, whatever the clock said. Jobs created while paging do
    /// not shift later pages.
    ///
    /// # Errors
    /// `InvalidPageToken`, `Unavailable`.
    async fn list_jobs(&self, filter: &JobFilter, page: &PageRequest) -> Result<Page<Job>>;

    /// Identifiers of jobs in one of these states, oldest first, at most `limit`: for taking up work
    /// after a restart.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn jobs_in_state(&self, states: &[JobState], limit: u32) -> Result<Vec<Uuid>>;

    /// How many jobs of one tenant or of all are in each state; states without jobs are absent.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn count_jobs(&self, tenant: Option<Tenant>) -> Result<Vec<(JobState, u64)>>;

    /// Changes a job's state if it is now one of `from`, stores the report if there is one (in
    /// place of an earlier one), and logs the event, all at once.
    ///
    /// # Errors
    /// `NotFound`, `FailedState` if the job is in another state, `TooLarge`, `Unavailable`.
    async fn transition(
        &self,
        id: Uuid,
        from: &[JobState],
        to: JobState,
        detail: &str,
        report: Option<NewReport>,
    ) -> Result<Job>;

    /// The validation report of a job.
    ///
    /// # Errors
    /// `NotFound` if the job does not exist or has no report yet, `Corrupt`, `Unavailable`.
    async fn report(&self, id: Uuid) -> Result<StoredReport>;

    /// Deletes a job with its report and checkpoints, and logs the event. The program stays.
    ///
    /// # Errors
    /// `NotFound`, `EtagMismatch` if an etag is given and the job changed, `Unavailable`.
    async fn delete_job(&self, id: Uuid, etag: Option<&str>) -> Result<()>;

    /// Events after position `sequence` (0 for all), oldest first, at most `limit` and never more than [`MAX_EVENTS`].
    ///
    /// # Errors
    /// `Unavailable`.
    async fn events_after(&self, sequence: i64, filter: &EventFilter, limit: u32) -> Result<Vec<JobEvent>>;

    /// Position of the newest event of a tenant that is kept; 0 if there is none.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn newest_event(&self, tenant: Tenant) -> Result<i64>;

    /// Position of the newest event; 0 if there is none yet.
    fn latest_sequence(&self) -> i64;

    /// Follows [`Jobs::latest_sequence`]: changes once events are durable, so that
    /// [`Jobs::events_after`] finds them.
    fn watch_events(&self) -> watch::Receiver<i64>;
}
