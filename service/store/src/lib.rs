//! What the service keeps: programs, jobs with their reports and checkpoints, runs of jobs with their
//! decisions, machine profiles and tools, and the audit log.
//!
//! The crate knows records, not machining. Everything whose meaning belongs to machining (profiles,
//! job settings, reports, tool data, snapshots of a generator) is opaque JSON or bytes beside the
//! few columns by which records are found. One trait per aggregate ([`Programs`], [`Jobs`],
//! [`Validations`], [`Checkpoints`], [`Runs`], [`Presences`], [`Machines`], [`Tools`], [`Audit`]) and [`Database`] over them say what a database must do; a
//! [`Store`] is the database that a [`StoreUri`] names. One more database is one more implementation of the traits,
//! one more scheme of the URI, and the same tests.
//!
//! Guarantees that hold for every method:
//!
//! - A write has reached the disk when its future resolves with `Ok`. A future dropped before that
//!   may or may not have written; writes are made so that they can be repeated.
//! - A write happens entirely or not at all.
//! - Reads see every write acknowledged before they began.
//! - Nothing is removed unless asked, by a call or by a [`RetentionPolicy`].
#![forbid(unsafe_code)]

mod audit;
mod checkpoints;
mod error;
mod jobs;
mod logs;
mod machines;
mod maintenance;
mod objects;
mod page;
mod postgres;
mod presences;
mod programs;
mod retention;
mod runs;
mod settings;
mod sql;
mod sqlite;
mod store;
mod tenant;
mod tools;
mod uri;
mod validations;

pub use audit::{Audit, AuditEntry, AuditFilter, AuditRequest, AuditResult, MAX_AUDIT_ENTRIES, MAX_AUDIT_TEXT_BYTES};
pub use checkpoints::{Checkpoint, CheckpointSet, Checkpoints};
pub use error::{Kind, Result, StoreError};
pub use jobs::{
    EventFilter, FindingCounts, Fingerprint, Job, JobDetail, JobEvent, JobFilter, JobState, Jobs, MAX_EVENTS, NewJob,
    NewReport, StoredReport, UnknownJobState,
};
pub use logs::{LogPlace, LogPlaces};
pub use machines::{MachineRecord, Machines};
pub use maintenance::{
    CheckReport, CopyError, CopyReport, MAX_PROBLEMS, Problem, ReadDecision, TableCopy, backup, check, check_with,
    copy, migrate, restore,
};
pub use objects::{InvalidObjectsUri, ObjectSettings, ObjectsUri};
pub use page::{DEFAULT_PAGE_SIZE, MAX_PAGE_SIZE, Page, PageRequest, Scope};
pub use presences::{Presence, Presences, ToldPresence, ToldUse};
pub use programs::{
    CHUNK_BYTES, InvalidProgramId, MAX_PUT_BYTES, ProgramEntry, ProgramId, ProgramInfo, Programs, UploadBound,
    UploadId, UploadInfo, UploadStart,
};
pub use retention::{Removed, Retention, RetentionPolicy};
pub use runs::{
    Acknowledgement, AttachedRun, DecisionFilter, DecisionRecord, MAX_DECISIONS, MAX_LISTED, MachineRuns, NewDecision,
    NewRecordedCut, NewRun, OpenCondition, RecordedCutHead, Run, RunCheckpoint, RunCommit, RunCondition, RunKind,
    RunMark, RunOverride, RunSetpoints, RunState, Runs, TelemetryGap, UnknownName,
};
pub use settings::{NoObserver, Observer, StoreSettings, StoreStats};
pub use store::{Database, Store};
pub use tenant::{InvalidTenant, MAX_TENANT_BYTES, Tenant};
pub use tools::{ToolFilter, ToolRecord, Tools};
pub use uri::{InvalidStoreUri, StoreUri};
pub use validations::{Attempt, Validations, WaitingJob};

/// A JSON document the store keeps without looking inside. That it is well-formed is checked when
/// the value is made ([`to_raw_value`], [`RawValue::from_string`]).
pub type Json = Box<RawValue>;
pub use serde_json::value::{RawValue, to_raw_value};
