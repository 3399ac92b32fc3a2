//! The tables of a store with their columns.

/// What a column holds; all but keys may be null.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Integer,
    Real,
    Text,
    Bytes,
}

use Kind::{Bytes, Integer, Real, Text};

/// A table with its columns, the first of which are its key.
pub(super) struct Table {
    pub(super) name: &'static str,
    pub(super) keys: usize,
    pub(super) columns: &'static [(&'static str, Kind)],
}

/// Every table that holds records; what another one refers to comes first.
pub(super) const TABLES: [Table; 21] = [
    Table { name: "contents", keys: 1, columns: &[("id", Integer)] },
    Table {
        name: "program_chunks",
        keys: 2,
        columns: &[
            ("content_id", Integer),
            ("chunk_index", Integer),
            ("source_offset", Integer),
            ("source_bytes", Integer),
            ("data", Bytes),
        ],
    },
    Table {
        name: "programs",
        keys: 1,
        columns: &[
            ("id", Text),
            ("content_id", Integer),
            ("size_bytes", Integer),
            ("chunk_count", Integer),
            ("created_us", Integer),
            ("file_name", Text),
            ("sequence", Integer),
            ("tenant", Text),
        ],
    },
    Table {
        name: "uploads",
        keys: 1,
        columns: &[
            ("id", Text),
            ("content_id", Integer),
            ("expected_id", Text),
            ("size_bytes", Integer),
            ("received_bytes", Integer),
            ("created_us", Integer),
            ("updated_us", Integer),
            ("client", Text),
        ],
    },
    Table {
        name: "upload_tails",
        keys: 2,
        columns: &[("upload_id", Text), ("source_offset", Integer), ("data", Bytes)],
    },
    Table {
        name: "jobs",
        keys: 1,
        columns: &[
            ("id", Text),
            ("sequence", Integer),
            ("request_id", Text),
            ("fingerprint", Bytes),
            ("display_name", Text),
            ("program_id", Text),
            ("machine_id", Text),
            ("state", Text),
            ("state_detail", Text),
            ("created_us", Integer),
            ("updated_us", Integer),
            ("revision", Integer),
            ("client", Text),
            ("attempts", Integer),
            ("settings", Text),
            ("machine_snapshot", Text),
            ("tenant", Text),
            ("owner", Text),
        ],
    },
    Table { name: "job_programs", keys: 2, columns: &[("job_id", Text), ("program_id", Text)] },
    Table {
        name: "validation_reports",
        keys: 1,
        columns: &[
            ("job_id", Text),
            ("error_count", Integer),
            ("warning_count", Integer),
            ("info_count", Integer),
            ("created_us", Integer),
            ("summary", Text),
            ("report_bytes", Integer),
            ("report", Bytes),
        ],
    },
    Table {
        name: "job_events",
        keys: 1,
        columns: &[
            ("sequence", Integer),
            ("job_id", Text),
            ("from_state", Text),
            ("to_state", Text),
            ("at_us", Integer),
            ("detail", Text),
            ("tenant", Text),
        ],
    },
    Table {
        name: "job_checkpoints",
        keys: 4,
        columns: &[
            ("job_id", Text),
            ("interpolation_period_us", Integer),
            ("generation_key", Text),
            ("setpoint_index", Integer),
            ("input_offset", Integer),
            ("snapshot_bytes", Integer),
            ("snapshot", Bytes),
        ],
    },
    Table {
        name: "documents",
        keys: 2,
        columns: &[
            ("collection", Text),
            ("id", Text),
            ("number", Integer),
            ("created_us", Integer),
            ("updated_us", Integer),
            ("revision", Integer),
            ("body", Text),
        ],
    },
    Table { name: "monitoring", keys: 1, columns: &[("job_id", Text), ("updated_us", Integer), ("config", Text)] },
    Table {
        name: "runs",
        keys: 1,
        columns: &[
            ("id", Text),
            ("sequence", Integer),
            ("job_id", Text),
            ("kind", Text),
            ("state", Text),
            ("state_detail", Text),
            ("created_us", Integer),
            ("updated_us", Integer),
            ("attachment", Integer),
            ("newest_batch", Integer),
            ("setpoints_received", Integer),
            ("setpoints_sent", Integer),
            ("setpoints_digest", Bytes),
            ("settings", Text),
            ("monitor_bytes", Integer),
            ("monitor", Bytes),
            ("tenant", Text),
        ],
    },
    Table {
        name: "telemetry_gaps",
        keys: 2,
        columns: &[("run_id", Text), ("first_batch", Integer), ("last_batch", Integer), ("at_us", Integer)],
    },
    Table {
        name: "decisions",
        keys: 1,
        columns: &[
            ("sequence", Integer),
            ("run_id", Text),
            ("job_id", Text),
            ("number", Integer),
            ("at_us", Integer),
            ("action", Text),
            ("body", Bytes),
            ("tenant", Text),
        ],
    },
    Table {
        name: "run_overrides",
        keys: 2,
        columns: &[
            ("run_id", Text),
            ("number", Integer),
            ("setpoint_index", Integer),
            ("ratio", Real),
            ("cause", Text),
        ],
    },
    Table {
        name: "run_conditions",
        keys: 2,
        columns: &[
            ("run_id", Text),
            ("decision_number", Integer),
            ("action", Text),
            ("raised_us", Integer),
            ("acknowledged_us", Integer),
            ("acknowledged_by", Text),
            ("note", Text),
        ],
    },
    Table {
        name: "run_checkpoints",
        keys: 2,
        columns: &[
            ("run_id", Text),
            ("setpoint_index", Integer),
            ("change_count", Integer),
            ("generation_key", Text),
            ("digest_state", Bytes),
            ("snapshot_bytes", Integer),
            ("snapshot", Bytes),
        ],
    },
    Table {
        name: "recorded_cuts",
        keys: 2,
        columns: &[
            ("run_id", Text),
            ("number", Integer),
            ("at_us", Integer),
            ("head", Bytes),
            ("body_bytes", Integer),
            ("body", Bytes),
        ],
    },
    Table {
        name: "audit_entries",
        keys: 1,
        columns: &[
            ("sequence", Integer),
            ("at_us", Integer),
            ("ended_us", Integer),
            ("principal", Text),
            ("tenant", Text),
            ("address", Text),
            ("certificate", Text),
            ("method", Text),
            ("request_id", Text),
            ("resource", Text),
            ("result", Text),
            ("reason", Text),
            ("occurrences", Integer),
            ("change", Integer),
        ],
    },
    Table { name: "audit_tenants", keys: 1, columns: &[("tenant", Text), ("entries", Integer)] },
];

/// Tables of a file that hold no records, or records that become others.
pub(super) const OTHERS: [&str; 6] =
    ["_sqlx_migrations", "counters", "object_chunks", "objects", "probe", "sqlite_sequence"];
