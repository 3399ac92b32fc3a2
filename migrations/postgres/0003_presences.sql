-- What replicas tell each other of runs whose streams are connected to them. It can be lost: the log has what happened.
CREATE TABLE presences (
    -- The process that tells.
    replica      TEXT   NOT NULL,
    run_id       TEXT   NOT NULL,
    tenant       TEXT   NOT NULL,
    -- That of the run.
    sequence     BIGINT NOT NULL,
    -- 1, or 0 for a stream that has ended.
    is_connected BIGINT NOT NULL,
    told_us      BIGINT NOT NULL,
    body         BYTEA  NOT NULL,
    PRIMARY KEY (replica, run_id)
);
