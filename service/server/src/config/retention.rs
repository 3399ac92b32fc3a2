//! How long records are kept.

use serde::{Deserialize, Serialize};

use super::problems::Range;

/// How long records are kept; absent keys: for ever.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RetentionConfig {
    /// Jobs that have ended, with their reports and runs, since their last change, days.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jobs_days: Option<u32>,
    /// Runs that have ended, with their decisions, days.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub runs_days: Option<u32>,
    /// Programs that no job uses, days.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub programs_days: Option<u32>,
    /// Events of jobs, days.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub events_days: Option<u32>,
    /// Entries of the audit log, days.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub audit_days: Option<u32>,
    /// Most entries of the audit log: beyond, the oldest ones of the tenants that have most go.
    pub audit_entries: u64,
    /// Bytes in use within the store, its logs of events and audit not counted: beyond, the oldest jobs that have ended go.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_bytes: Option<u64>,
    /// Only says what would be removed.
    pub dry_run: bool,
}

impl Default for RetentionConfig {
    fn default() -> Self {
        Self {
            jobs_days: None,
            runs_days: None,
            programs_days: None,
            events_days: None,
            audit_days: None,
            audit_entries: 1_000_000,
            max_bytes: None,
            dry_run: false,
        }
    }
}

impl RetentionConfig {
    /// Each key with its value and the range that it must be in.
    pub(super) const fn ranges(&self) -> [Range; 1] {
        [("retention.audit_entries", self.audit_entries, 1_000, 1_000_000_000)]
    }
}
