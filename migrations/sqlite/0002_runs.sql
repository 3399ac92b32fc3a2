-- How the telemetry of a job is judged; copied into a run when it begins.
CREATE TABLE monitoring (
    job_id     TEXT    NOT NULL PRIMARY KEY REFERENCES jobs (id) ON DELETE CASCADE,
    updated_us INTEGER NOT NULL,
    -- JSON.
    config     TEXT    NOT NULL
) STRICT;

-- A run of a job: telemetry in, decisions out, and in a live run the setpoints under them.
CREATE TABLE runs (
    id                 TEXT    NOT NULL PRIMARY KEY,
    job_id             TEXT    NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    kind               TEXT    NOT NULL CHECK (kind IN ('telemetry', 'live')),
    state              TEXT    NOT NULL CHECK (state IN ('open', 'finished', 'stopped', 'aborted')),
    state_detail       TEXT    NOT NULL,
    created_us         INTEGER NOT NULL,
    updated_us         INTEGER NOT NULL,
    -- Counts who took the run up: only the newest may write.
    attachment         INTEGER NOT NULL,
    -- Number of the newest telemetry batch that the monitor's state holds.
    newest_batch       INTEGER,
    -- Setpoints from the first one on that the client has acknowledged, were handed out, and the SHA-256 of the latter.
    setpoints_received INTEGER NOT NULL,
    setpoints_sent     INTEGER NOT NULL,
    setpoints_digest   BLOB,
    settings           TEXT    NOT NULL,
    -- State of the monitor after the newest batch, compressed with zstd.
    monitor_bytes      INTEGER NOT NULL,
    monitor            BLOB    NOT NULL
) STRICT;
CREATE INDEX runs_by_time ON runs (created_us, id);
CREATE INDEX runs_by_job ON runs (job_id, created_us, id);

-- Telemetry batches that never came.
CREATE TABLE telemetry_gaps (
    run_id      TEXT    NOT NULL REFERENCES runs (id) ON DELETE CASCADE,
    first_batch INTEGER NOT NULL,
    last_batch  INTEGER NOT NULL,
    at_us       INTEGER NOT NULL,
    PRIMARY KEY (run_id, first_batch)
) STRICT;

CREATE TABLE decisions (
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    run_id   TEXT    NOT NULL REFERENCES runs (id) ON DELETE CASCADE,
    job_id   TEXT    NOT NULL,
    number   INTEGER NOT NULL,
    at_us    INTEGER NOT NULL,
    action   TEXT    NOT NULL,
    -- The decision with all its inputs.
    body     BLOB    NOT NULL,
    UNIQUE (run_id, number)
) STRICT;
CREATE INDEX decisions_by_run ON decisions (run_id);
CREATE INDEX decisions_by_job ON decisions (job_id);

-- Changes of the feed override of a live run, by the setpoint from which they act.
CREATE TABLE run_overrides (
    run_id         TEXT    NOT NULL REFERENCES runs (id) ON DELETE CASCADE,
    number         INTEGER NOT NULL,
    setpoint_index INTEGER NOT NULL,
    ratio          REAL    NOT NULL,
    cause          TEXT    NOT NULL,
    PRIMARY KEY (run_id, number)
) STRICT;
