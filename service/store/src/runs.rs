//! Runs: the telemetry of a job as far as it is durable, the decisions made from it, and what a live run did.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use async_trait::async_trait;
use bytes::Bytes;
use tokio::sync::watch;
use uuid::Uuid;

use crate::Json;
use crate::error::Result;
use crate::page::{Page, PageRequest};
use crate::tenant::Tenant;

/// What a run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RunKind {
    /// Telemetry of a machine that has its setpoints from elsewhere.
    Telemetry,
    /// Setpoints are handed out, and decisions act on them.
    Live,
}

/// State of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RunState {
    /// It may go on.
    Open,
    /// It came to its end.
    Finished,
    /// A decision stopped it.
    Stopped,
    /// The client gave it up.
    Aborted,
}

/// The text names nothing of the kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("not a known name")]
pub struct UnknownName;

macro_rules! names {
    ($type:ident { $($variant:ident = $name:literal),* $(,)? }) => {
        impl $type {
            /// Name in the database.
            pub const fn as_str(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }
        }

        impl FromStr for $type {
            type Err = UnknownName;

            fn from_str(text: &str) -> Result<Self, UnknownName> {
                match text {
                    $($name => Ok(Self::$variant),)*
                    _ => Err(UnknownName),
                }
            }
        }

        impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.as_str())
            }
        }
    };
}

names!(RunKind { Telemetry = "telemetry", Live = "live" });
names!(RunState { Open = "open", Finished = "finished", Stopped = "stopped", Aborted = "aborted" });

/// A run to be created.
#[derive(Debug, Clone)]
pub struct NewRun {
    /// The job.
    pub job_id: Uuid,
    /// What it is.
    pub kind: RunKind,
    /// What the client asked for.
    pub settings: Json,
    /// State of the monitor at the beginning.
    pub monitor: Bytes,
}

/// A run as lists show it.
#[derive(Debug, Clone)]
pub struct Run {
    /// Identifier (UUID version 7).
    pub id: Uuid,
    /// The tenant whose run it is: that of the job.
    pub tenant: Tenant,
    /// Place in the order in which runs began.
    pub sequence: i64,
    /// The job.
    pub job_id: Uuid,
    /// What it is.
    pub kind: RunKind,
    /// Its state.
    pub state: RunState,
    /// Why; may be empty.
    pub state_detail: String,
    /// When it was created, microseconds since the Unix epoch.
    pub created_us: i64,
    /// When it last changed, microseconds since the Unix epoch.
    pub updated_us: i64,
    /// Number of the newest telemetry batch that is durable.
    pub newest_batch: Option<u64>,
    /// Setpoints of a live run.
    pub setpoints: RunSetpoints,
    /// What the client asked for.
    pub settings: Json,
    /// How often it was begun or taken up when it was read.
    pub attachment: u64,
    /// Conditions that are not acknowledged.
    pub open_conditions: u64,
}

/// How far the setpoints of a live run have come.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RunSetpoints {
    /// Setpoints from the first one on that the client has acknowledged.
    pub received: u64,
    /// Setpoints from the first one on that were handed out.
    pub sent: u64,
    /// SHA-256 of the latter.
    pub digest: Option<[u8; 32]>,
}

/// A resumed run, with everything needed to continue.
#[derive(Debug, Clone)]
pub struct AttachedRun {
    /// The run.
    pub run: Run,
    /// Proof of being the newest to take it up; every commit shows it.
    pub attachment: u64,
    /// State of the monitor after [`Run::newest_batch`].
    pub monitor: Bytes,
    /// Changes of the feed override so far, in order.
    pub overrides: Vec<RunOverride>,
}

/// A decision to be kept.
#[derive(Debug, Clone)]
pub struct NewDecision {
    /// Counts up from 0 in a run.
    pub number: u64,
    /// What is to be done, for people who look into the database.
    pub action: &'static str,
    /// The decision with all its inputs.
    pub body: Bytes,
    /// Whether it raises a condition of the run.
    pub raises_condition: bool,
}

/// Something of a run that needs attention.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunCondition {
    /// Number of the decision that raised it.
    pub decision_number: u64,
    /// What that decision did.
    pub action: String,
    /// When it was raised, microseconds since the Unix epoch.
    pub raised_us: i64,
    /// Who acknowledged it; `None`: not acknowledged.
    pub acknowledged: Option<Acknowledgement>,
}

/// The acknowledgement of a condition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Acknowledgement {
    /// When, microseconds since the Unix epoch.
    pub at_us: i64,
    /// Who.
    pub by: String,
    /// What they had to say.
    pub note: String,
}

/// A kept decision.
#[derive(Debug, Clone)]
pub struct DecisionRecord {
    /// Position in the log of all runs; grows by time, never used twice.
    pub sequence: i64,
    /// The run.
    pub run_id: Uuid,
    /// The run's job.
    pub job_id: Uuid,
    /// The tenant whose run it is.
    pub tenant: Tenant,
    /// Counts up from 0 in a run.
    pub number: u64,
    /// When it was stored, microseconds since the Unix epoch.
    pub at_us: i64,
    /// The decision with all its inputs.
    pub body: Bytes,
    /// Whether it is as it was written: one that is not keeps nobody from those behind it.
    pub is_intact: bool,
}

/// Telemetry batches that never came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TelemetryGap {
    /// First missing number.
    pub first: u64,
    /// Last missing number.
    pub last: u64,
}

/// A change of the feed override of a live run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunOverride {
    /// Counts up from 0 in a run.
    pub number: u64,
    /// Setpoint from which it acts.
    pub setpoint_index: u64,
    /// Ratio of the feed to the programmed one.
    pub ratio: f64,
    /// What brought it: a decision, an operator.
    pub cause: String,
}

/// The state of the generator of a live run before it produces one setpoint. Derived data: losing it costs time, never
/// content.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunCheckpoint {
    /// What of the run it is the state at.
    pub mark: RunMark,
    /// Changes of the feed override, from the first one on, that the generator knew.
    pub change_count: u64,
    /// Names everything else that the snapshot depends on, the version of the generator included.
    pub generation_key: String,
    /// State of the generator.
    pub snapshot: Bytes,
}

/// A setpoint of a run with the running digest of all before it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunMark {
    /// Index of the setpoint produced next.
    pub setpoint_index: u64,
    /// State of the digest of the setpoints before.
    pub digest_state: Bytes,
}

/// A stretch of a run's telemetry to be kept to learn from.
#[derive(Debug, Clone)]
pub struct NewRecordedCut {
    /// Counts up from 0 in a run.
    pub number: u64,
    /// What lists say of it.
    pub head: Bytes,
    /// Its samples.
    pub body: Bytes,
}

/// What lists say of a stretch that is kept.
#[derive(Debug, Clone)]
pub struct RecordedCutHead {
    /// Counts up from 0 in a run.
    pub number: u64,
    /// When it was stored, microseconds since the Unix epoch.
    pub at_us: i64,
    /// What was given as the head.
    pub head: Bytes,
}

/// What happened in a run since the last commit; all of it becomes durable at once.
#[derive(Debug, Clone, Default)]
pub struct RunCommit {
    /// Newest batch and the monitor's state after it; `None` leaves both.
    pub telemetry: Option<(Option<u64>, Bytes)>,
    /// Decisions made, in order.
    pub decisions: Vec<NewDecision>,
    /// Batches found missing.
    pub gaps: Vec<TelemetryGap>,
    /// Changes of the feed override.
    pub overrides: Vec<RunOverride>,
    /// Stretches of telemetry to keep.
    pub recorded_cuts: Vec<NewRecordedCut>,
    /// Setpoints so far; `None` leaves them.
    pub setpoints: Option<RunSetpoints>,
    /// End of the run with its reason.
    pub end: Option<(RunState, String)>,
}

/// Which decisions a list shows. The default shows all.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct DecisionFilter {
    /// Only this tenant's.
    pub tenant: Option<Tenant>,
    /// Only this run's.
    pub run_id: Option<Uuid>,
    /// Only those of this job's runs.
    pub job_id: Option<Uuid>,
}

/// The runs of a machine, as far as its present state needs them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MachineRuns {
    /// The machine's identifier.
    pub machine_id: String,
    /// The tenant whose runs they are.
    pub tenant: Tenant,
    /// The run that began last.
    pub newest: Uuid,
    /// Runs that came to their end.
    pub finished: u64,
}

/// A condition that nobody has acknowledged, and where it belongs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OpenCondition {
    /// The machine's identifier.
    pub machine_id: String,
    /// The tenant whose run it is of.
    pub tenant: Tenant,
    /// The run that it is of.
    pub run_id: Uuid,
    /// The run's job.
    pub job_id: Uuid,
    /// The condition.
    pub condition: RunCondition,
}

/// Most gaps and conditions that are listed of a run.
pub const MAX_LISTED: u32 = 500;
/// Most decisions that [`Runs::decisions_after`] returns at a time.
pub const MAX_DECISIONS: u32 = 1000;

/// Keeps runs.
#[async_trait]
pub trait Runs {
    /// Keeps how the telemetry of a job is judged, in place of what was kept before.
    ///
    /// # Errors
    /// `NotFound` if the job does not exist, `TooLarge`, `Unavailable`.
    async fn put_monitoring(&self, job_id: Uuid, config: Json) -> Result<()>;

    /// How the telemetry of a job is judged.
    ///
    /// # Errors
    /// `NotFound` if the job does not exist or nothing was kept, `Unavailable`.
    async fn monitoring(&self, job_id: Uuid) -> Result<Json>;

    /// Creates a run and takes it up.
    ///
    /// # Errors
    /// `NotFound` if the job does not exist, `TooLarge`, `Unavailable`.
    async fn create_run(&self, run: NewRun) -> Result<AttachedRun>;

    /// Resumes an open run; the connection that had it before can no longer write.
    ///
    /// # Errors
    /// `NotFound`, `RunEnded` if it is not open any more, `Unavailable`.
    async fn attach_run(&self, id: Uuid) -> Result<AttachedRun>;

    /// Makes durable what happened in a run; the stored decisions in order.
    ///
    /// # Errors
    /// `NotFound` if the run was deleted, `Detached` if another connection resumed it, `RunEnded`, `TooLarge`,
    /// `Unavailable`.
    async fn commit_run(&self, id: Uuid, attachment: u64, commit: RunCommit) -> Result<Vec<DecisionRecord>>;

    /// A run.
    ///
    /// # Errors
    /// `NotFound`, `Unavailable`.
    async fn run(&self, id: Uuid) -> Result<Run>;

    /// Runs by creation time, newest first, of one tenant or of all, of one job or of all.
    ///
    /// # Errors
    /// `InvalidPageToken`, `Unavailable`.
    async fn list_runs(&self, tenant: Option<Tenant>, job_id: Option<Uuid>, page: &PageRequest) -> Result<Page<Run>>;

    /// Conditions of a run in the order in which they were raised, at most [`MAX_LISTED`].
    ///
    /// # Errors
    /// `Unavailable`.
    async fn run_conditions(&self, id: Uuid) -> Result<Vec<RunCondition>>;

    /// Stores the acknowledgement of a condition of a run, the newest where no decision is named; the first one is
    /// kept. The job's log of events tells of it.
    ///
    /// # Errors
    /// `NotFound` if the run or the condition does not exist, `TooLarge`, `Unavailable`.
    async fn acknowledge_condition(
        &self,
        id: Uuid,
        decision_number: Option<u64>,
        by: String,
        note: String,
    ) -> Result<RunCondition>;

    /// Unacknowledged conditions of the runs of one tenant or of all.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn count_open_conditions(&self, tenant: Option<Tenant>) -> Result<u64>;

    /// The newest unacknowledged conditions of every tenant's runs on every machine, at most `limit` of each,
    /// oldest first.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn open_conditions(&self, limit: u32) -> Result<Vec<OpenCondition>>;

    /// The runs of every tenant on every machine that has had one of it, by identifier and tenant.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn machine_runs(&self) -> Result<Vec<MachineRuns>>;

    /// The decision that a run made last.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn last_decision(&self, id: Uuid) -> Result<Option<DecisionRecord>>;

    /// The newest decisions of a run with this action, at most so many, the newest first.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn last_decisions_of(&self, id: Uuid, action: &str, most: u32) -> Result<Vec<DecisionRecord>>;

    /// Changes of the feed override of a run, in order.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn run_overrides(&self, id: Uuid) -> Result<Vec<RunOverride>>;

    /// Keeps a checkpoint of a run, in place of one at the same setpoint, and removes those whose setpoints are in one of
    /// `removed`.
    ///
    /// # Errors
    /// `NotFound` if the run was deleted, `Detached` if another connection resumed it, `RunEnded`, `TooLarge`,
    /// `Unavailable`.
    async fn put_run_checkpoint(
        &self,
        id: Uuid,
        attachment: u64,
        checkpoint: RunCheckpoint,
        removed: Vec<Range<u64>>,
    ) -> Result<()>;

    /// The last checkpoint of a run with this generation key at or before a setpoint.
    ///
    /// # Errors
    /// `Corrupt`, `Unavailable`.
    async fn nearest_run_checkpoint(
        &self,
        id: Uuid,
        generation_key: &str,
        setpoint_index: u64,
    ) -> Result<Option<RunCheckpoint>>;

    /// State of the monitor of a run as it was committed last.
    ///
    /// # Errors
    /// `NotFound`, `Corrupt`, `Unavailable`.
    async fn run_monitor(&self, id: Uuid) -> Result<Bytes>;

    /// Setpoints of the checkpoints of a run with their running digests, by index, whatever generated them.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn run_marks(&self, id: Uuid) -> Result<Vec<RunMark>>;

    /// Missing batches of a run, by number, at most [`MAX_LISTED`].
    ///
    /// # Errors
    /// `Unavailable`.
    async fn telemetry_gaps(&self, id: Uuid) -> Result<Vec<TelemetryGap>>;

    /// Stretches that are kept of a run, by number, at most [`MAX_LISTED`].
    ///
    /// # Errors
    /// `Unavailable`.
    async fn recorded_cuts(&self, id: Uuid) -> Result<Vec<RecordedCutHead>>;

    /// The samples of a stretch of a run.
    ///
    /// # Errors
    /// `NotFound` where there is none of this number, `Corrupt`, `Unavailable`.
    async fn recorded_cut(&self, id: Uuid, number: u64) -> Result<Bytes>;

    /// Decisions after position `sequence` (0 for all), oldest first, at most `limit` and never more than
    /// [`MAX_DECISIONS`].
    ///
    /// # Errors
    /// `Unavailable`.
    async fn decisions_after(&self, sequence: i64, filter: &DecisionFilter, limit: u32) -> Result<Vec<DecisionRecord>>;

    /// Follows the position of the newest decision: changes once decisions are durable, so that
    /// [`Runs::decisions_after`] finds them.
    fn watch_decisions(&self) -> watch::Receiver<i64>;
}
