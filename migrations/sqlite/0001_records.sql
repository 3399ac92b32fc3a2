-- Times are microseconds since the Unix epoch. Identifiers of jobs and uploads are UUIDs, those of
-- programs the SHA-256 of their source, both as lower-case text.

-- The bytes of a program or of an unfinished upload. A content that neither refers to is being
-- removed, piece by piece.
CREATE TABLE contents (
    id INTEGER PRIMARY KEY AUTOINCREMENT
) STRICT;

-- 1 MiB of source per chunk, the last one shorter; each compressed alone with zstd, so that any
-- offset is read without what precedes it.
CREATE TABLE program_chunks (
    content_id    INTEGER NOT NULL REFERENCES contents (id),
    chunk_index   INTEGER NOT NULL,
    source_offset INTEGER NOT NULL,
    source_bytes  INTEGER NOT NULL,
    data          BLOB    NOT NULL,
    PRIMARY KEY (content_id, chunk_index)
) STRICT;

CREATE TABLE programs (
    id          TEXT    NOT NULL PRIMARY KEY,
    content_id  INTEGER NOT NULL UNIQUE REFERENCES contents (id),
    size_bytes  INTEGER NOT NULL,
    chunk_count INTEGER NOT NULL,
    created_us  INTEGER NOT NULL
) STRICT;

CREATE TABLE uploads (
    id             TEXT    NOT NULL PRIMARY KEY,
    content_id     INTEGER NOT NULL UNIQUE REFERENCES contents (id),
    expected_id    TEXT    NOT NULL,
    size_bytes     INTEGER NOT NULL,
    received_bytes INTEGER NOT NULL,
    created_us     INTEGER NOT NULL,
    updated_us     INTEGER NOT NULL,
    UNIQUE (expected_id, size_bytes)
) STRICT;

-- Received bytes that do not fill a chunk yet, as they came.
CREATE TABLE upload_tails (
    upload_id     TEXT    NOT NULL REFERENCES uploads (id) ON DELETE CASCADE,
    source_offset INTEGER NOT NULL,
    data          BLOB    NOT NULL,
    PRIMARY KEY (upload_id, source_offset)
) STRICT;

CREATE TABLE jobs (
    id               TEXT    NOT NULL PRIMARY KEY,
    request_id       TEXT    NOT NULL UNIQUE,
    fingerprint      BLOB    NOT NULL,
    display_name     TEXT    NOT NULL,
    program_id       TEXT    NOT NULL REFERENCES programs (id),
    machine_id       TEXT    NOT NULL,
    state            TEXT    NOT NULL
        CHECK (state IN ('pending_validation', 'validating', 'ready', 'rejected', 'cancelled', 'failed')),
    state_detail     TEXT    NOT NULL,
    created_us       INTEGER NOT NULL,
    updated_us       INTEGER NOT NULL,
    revision         INTEGER NOT NULL,
    -- Last, so that lists do not read past them.
    settings         TEXT    NOT NULL,
    machine_snapshot TEXT    NOT NULL
) STRICT;
CREATE INDEX jobs_by_time ON jobs (created_us, id);
CREATE INDEX jobs_by_state ON jobs (state, created_us, id);
CREATE INDEX jobs_by_machine ON jobs (machine_id, created_us, id);
CREATE INDEX jobs_by_program ON jobs (program_id);

CREATE TABLE validation_reports (
    job_id        TEXT    NOT NULL PRIMARY KEY REFERENCES jobs (id) ON DELETE CASCADE,
    error_count   INTEGER NOT NULL,
    warning_count INTEGER NOT NULL,
    info_count    INTEGER NOT NULL,
    created_us    INTEGER NOT NULL,
    summary       TEXT,
    report_bytes  INTEGER NOT NULL,
    -- JSON, compressed with zstd.
    report        BLOB    NOT NULL
) STRICT;

-- The log of state changes. It outlives the jobs, hence no reference.
CREATE TABLE job_events (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    job_id     TEXT    NOT NULL,
    from_state TEXT,
    to_state   TEXT,
    at_us      INTEGER NOT NULL,
    detail     TEXT    NOT NULL
) STRICT;
CREATE INDEX job_events_by_job ON job_events (job_id, sequence);

-- Derived data: a generator continues from a snapshot instead of from the start.
CREATE TABLE job_checkpoints (
    job_id                  TEXT    NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    interpolation_period_us INTEGER NOT NULL,
    generation_key          TEXT    NOT NULL,
    setpoint_index          INTEGER NOT NULL,
    input_offset            INTEGER NOT NULL,
    snapshot_bytes          INTEGER NOT NULL,
    -- Compressed with zstd.
    snapshot                BLOB    NOT NULL,
    PRIMARY KEY (job_id, interpolation_period_us, generation_key, setpoint_index)
) STRICT;

-- Machine profiles and tools: JSON changed as a whole, guarded by its revision.
CREATE TABLE documents (
    collection TEXT    NOT NULL CHECK (collection IN ('machine', 'tool')),
    id         TEXT    NOT NULL,
    -- The number by which programs call a tool.
    number     INTEGER CHECK ((number IS NOT NULL) = (collection = 'tool')),
    created_us INTEGER NOT NULL,
    updated_us INTEGER NOT NULL,
    revision   INTEGER NOT NULL,
    body       TEXT    NOT NULL,
    PRIMARY KEY (collection, id)
) STRICT;
CREATE INDEX documents_by_number ON documents (collection, number, id);
