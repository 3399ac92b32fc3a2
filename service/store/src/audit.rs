//! The audit log: who asked for what, when, from where, and what came of it.

use async_trait::async_trait;

use crate::error::Result;

/// What somebody asks for.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct AuditRequest {
    /// Who asks, by the name of a known client; empty where it is nobody known.
    pub principal: String,
    /// The tenant that it is asked for.
    pub tenant: String,
    /// Address that it comes from.
    pub address: String,
    /// Subject of the certificate that was shown; empty without one.
    pub certificate: String,
    /// What is asked for, such as `/feedwave.v1.Jobs/CreateJob`.
    pub method: String,
    /// Identifier of the call.
    pub request_id: String,
}

/// What came of it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct AuditResult {
    /// The record that it was about, such as `jobs/…`; empty where there is none.
    pub resource: String,
    /// Name of a status code of gRPC, such as `OK`.
    pub code: String,
    /// Why it was not done; empty where it was.
    pub reason: String,
}

/// An entry of the log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AuditEntry {
    /// Position in the log; grows by time, never used twice.
    pub sequence: i64,
    /// Number of its newest change, the first of which is that it was made; grows by time over all entries, never used
    /// twice.
    pub change: i64,
    /// When it was asked for, microseconds since the Unix epoch.
    pub at_us: i64,
    /// When the result was known, or was the same again, microseconds since the Unix epoch.
    pub ended_us: Option<i64>,
    /// What was asked for.
    pub request: AuditRequest,
    /// What came of it; `None` while it is in progress, and where the service ended before it did.
    pub result: Option<AuditResult>,
    /// How often the same was refused to the same client; 1 for anything else.
    pub occurrences: u64,
}

/// Which entries a list shows. The default shows all.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct AuditFilter {
    /// Only what this tenant's clients asked for.
    pub tenant: Option<String>,
    /// Only what this client asked for.
    pub principal: Option<String>,
}

/// Most entries that [`Audit::audit_after`] returns at a time.
pub const MAX_AUDIT_ENTRIES: u32 = 1000;

/// Longest text of an entry in bytes; what is longer is cut.
pub const MAX_AUDIT_TEXT_BYTES: usize = 512;

/// Keeps the audit log, at most [`crate::StoreSettings::max_audit_entries`]. Beyond, the oldest entries of the tenants that
/// have most go: whoever writes much loses what is his own.
#[async_trait]
pub trait Audit {
    /// Stores what is asked for, before it is done; with its result where that is known already. The entry's position.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn begin_audit(&self, request: AuditRequest, result: Option<AuditResult>) -> Result<i64>;

    /// Stores what came of it.
    ///
    /// # Errors
    /// `Unavailable`. That the entry is not kept any more is none.
    async fn end_audit(&self, sequence: i64, result: AuditResult) -> Result<()>;

    /// Counts that the same was refused so many times more.
    ///
    /// # Errors
    /// `Unavailable`. That the entry is not kept any more is none.
    async fn repeat_audit(&self, sequence: i64, times: u64) -> Result<()>;

    /// Entries after position `sequence` (0 for all), oldest first, at most `limit` and never more than
    /// [`MAX_AUDIT_ENTRIES`].
    ///
    /// # Errors
    /// `Unavailable`.
    async fn audit_after(&self, sequence: i64, filter: &AuditFilter, limit: u32) -> Result<Vec<AuditEntry>>;

    /// Entries that were made or changed after the change `change` (0 for all), in the order of their newest changes, at most
    /// `limit` and never more than [`MAX_AUDIT_ENTRIES`]. Who reads on behind the newest change that it has seen misses no
    /// entry, no result and no count that is kept.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn audit_changed_after(&self, change: i64, filter: &AuditFilter, limit: u32) -> Result<Vec<AuditEntry>>;
}
