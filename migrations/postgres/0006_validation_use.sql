-- What replicas tell each other of the time that clients used of their validation workers. It can be lost: shares come back to each
-- other from then on.
CREATE TABLE validation_use (
    -- The process that tells.
    replica TEXT   NOT NULL,
    client  TEXT   NOT NULL,
    -- In all since the row was made.
    used_us BIGINT NOT NULL,
    told_us BIGINT NOT NULL,
    PRIMARY KEY (replica, client)
);
