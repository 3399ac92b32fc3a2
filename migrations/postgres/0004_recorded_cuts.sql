-- Stretches of a run's telemetry that are kept to learn from tool and material: steady cuts, sample by sample.
CREATE TABLE recorded_cuts (
    run_id     TEXT   NOT NULL REFERENCES runs (id) ON DELETE CASCADE,
    -- Counts up from 0 in a run.
    number     BIGINT NOT NULL,
    at_us      BIGINT NOT NULL,
    -- What lists say of it.
    head       BYTEA  NOT NULL,
    -- The samples, compressed with zstd.
    body_bytes BIGINT NOT NULL,
    body       BYTEA  NOT NULL,
    PRIMARY KEY (run_id, number)
);
