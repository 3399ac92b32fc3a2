//! The logs of tenants: how far they have come, and up to where records were removed. Rows of `counters` say the latter.

use crate::logs::{LogPlace, LogPlaces};

/// A log that tenants read on in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TenantLog {
    /// State changes of jobs.
    Events,
    /// Decisions.
    Decisions,
}

impl TenantLog {
    const fn table(self) -> &'static str {
        match self {
            Self::Events => "job_events",
            Self::Decisions => "decisions",
        }
    }

    /// The statement that notes the removal of the rows, `j`, that satisfy a condition. It comes before they are removed: who reads on
    /// may be told once too often to begin anew, but not once too seldom.
    pub(crate) fn note_removal(self, condition: &str) -> String {
        let table = self.table();
        format!(
            "INSERT INTO counters (name, newest)
                SELECT 'removed_{table}:' || j.tenant, MAX(j.sequence) FROM {table} AS j WHERE {condition} GROUP BY j.tenant
                ON CONFLICT (name) DO UPDATE SET newest =
                    CASE WHEN excluded.newest > counters.newest THEN excluded.newest ELSE counters.newest END"
        )
    }

    /// The columns of a place, of the tenant `$1`.
    fn columns(self) -> String {
        let table = self.table();
        format!(
            "(SELECT COALESCE(MAX(sequence), 0) FROM {table} WHERE tenant = $1),
            (SELECT COALESCE(MAX(newest), 0) FROM counters WHERE name = 'removed_{table}:' || $1)"
        )
    }
}

/// The decisions that go with a job, `$1`.
pub(crate) const OF_JOB: &str = "j.job_id = $1";

/// A row of [`places_of`].
pub(crate) type PlacesRow = (i64, i64, i64, i64, i64, i64);

/// The query for the places of a tenant, `$1`; `made` is the database's expression of when a migration was done as a number.
pub(crate) fn places_of(made: &str) -> String {
    let [events, decisions] = [TenantLog::Events, TenantLog::Decisions].map(TenantLog::columns);
    let first = "FROM _sqlx_migrations WHERE version = 1";
    format!("SELECT {events}, {decisions}, (SELECT {made} {first}), (SELECT execution_time {first})")
}

/// What a row says.
pub(crate) fn places(row: PlacesRow) -> LogPlaces {
    let (newest_event, removed_events, newest_decision, removed_decisions, made, took) = row;
    let place = |newest: i64, removed| LogPlace { newest: newest.max(removed), removed };
    LogPlaces {
        store: [made, took],
        events: place(newest_event, removed_events),
        decisions: place(newest_decision, removed_decisions),
    }
}
