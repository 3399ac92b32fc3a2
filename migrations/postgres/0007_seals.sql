-- The SHA-256 of what never changes in a record, so that a bit that a disk lost is noticed wherever the record is read.
-- Earlier records have none.

ALTER TABLE program_chunks ADD COLUMN seal BYTEA;
ALTER TABLE programs ADD COLUMN seal BYTEA;
ALTER TABLE jobs ADD COLUMN seal BYTEA;
ALTER TABLE validation_reports ADD COLUMN seal BYTEA;
ALTER TABLE documents ADD COLUMN seal BYTEA;
ALTER TABLE monitoring ADD COLUMN seal BYTEA;
ALTER TABLE runs ADD COLUMN seal BYTEA;
ALTER TABLE run_overrides ADD COLUMN seal BYTEA;
ALTER TABLE decisions ADD COLUMN seal BYTEA;
ALTER TABLE recorded_cuts ADD COLUMN seal BYTEA;
