-- States of the generator of a live run, with the running digest of what it had generated, so that a run of hours is taken up
-- and proved without generating it from the start. Derived data.
CREATE TABLE run_checkpoints (
    run_id         TEXT    NOT NULL REFERENCES runs (id) ON DELETE CASCADE,
    -- Setpoint that is generated next.
    setpoint_index INTEGER NOT NULL,
    -- Changes of the feed, from the first one on, that the generator knew.
    change_count   INTEGER NOT NULL,
    -- Names everything else that the snapshot depends on.
    generation_key TEXT    NOT NULL,
    -- State of the digest of all setpoints before.
    digest_state   BLOB    NOT NULL,
    -- State of the generator, compressed with zstd.
    snapshot_bytes INTEGER NOT NULL,
    snapshot       BLOB    NOT NULL,
    PRIMARY KEY (run_id, setpoint_index)
) STRICT;
