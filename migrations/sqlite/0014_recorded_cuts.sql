-- Stretches of a run's telemetry that are kept to learn from tool and material: steady cuts, sample by sample.
CREATE TABLE recorded_cuts (
    run_id     TEXT    NOT NULL REFERENCES runs (id) ON DELETE CASCADE,
    -- Counts up from 0 in a run.
    number     INTEGER NOT NULL,
    at_us      INTEGER NOT NULL,
    -- What lists say of it.
    head       BLOB    NOT NULL,
    -- The samples, compressed with zstd.
    body_bytes INTEGER NOT NULL,
    body       BLOB    NOT NULL,
    PRIMARY KEY (run_id, number)
) STRICT;
