-- Conditions of a run that need attention: raised by a decision, in its transaction, and acknowledged once.
CREATE TABLE run_conditions (
    run_id          TEXT    NOT NULL REFERENCES runs (id) ON DELETE CASCADE,
    decision_number INTEGER NOT NULL,
    action          TEXT    NOT NULL,
    raised_us       INTEGER NOT NULL,
    acknowledged_us INTEGER,
    acknowledged_by TEXT    NOT NULL,
    note            TEXT    NOT NULL,
    PRIMARY KEY (run_id, decision_number)
) STRICT;
CREATE INDEX open_run_conditions ON run_conditions (run_id) WHERE acknowledged_us IS NULL;
