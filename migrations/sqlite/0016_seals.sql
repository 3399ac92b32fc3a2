-- The SHA-256 of what never changes in a record, so that a bit that a disk lost is noticed wherever the record is read.
-- Earlier records have none.

ALTER TABLE program_chunks ADD COLUMN seal BLOB;
ALTER TABLE programs ADD COLUMN seal BLOB;
ALTER TABLE jobs ADD COLUMN seal BLOB;
ALTER TABLE validation_reports ADD COLUMN seal BLOB;
ALTER TABLE documents ADD COLUMN seal BLOB;
ALTER TABLE monitoring ADD COLUMN seal BLOB;
ALTER TABLE runs ADD COLUMN seal BLOB;
ALTER TABLE run_overrides ADD COLUMN seal BLOB;
ALTER TABLE decisions ADD COLUMN seal BLOB;
ALTER TABLE recorded_cuts ADD COLUMN seal BLOB;
