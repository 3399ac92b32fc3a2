-- Lists are in the order in which records were made, whatever the clock said: a number of its own instead of a time.

ALTER TABLE jobs ADD COLUMN sequence INTEGER NOT NULL DEFAULT 0;
UPDATE jobs SET sequence = numbered.place
    FROM (SELECT id, ROW_NUMBER() OVER (ORDER BY created_us, id) AS place FROM jobs) AS numbered
    WHERE numbered.id = jobs.id;
DROP INDEX jobs_by_time;
DROP INDEX jobs_by_state;
DROP INDEX jobs_by_machine;
CREATE UNIQUE INDEX jobs_by_sequence ON jobs (sequence);
CREATE INDEX jobs_by_time ON jobs (created_us, sequence);
CREATE INDEX jobs_by_state ON jobs (state, sequence);
CREATE INDEX jobs_by_machine ON jobs (machine_id, sequence);

ALTER TABLE runs ADD COLUMN sequence INTEGER NOT NULL DEFAULT 0;
UPDATE runs SET sequence = numbered.place
    FROM (SELECT id, ROW_NUMBER() OVER (ORDER BY created_us, id) AS place FROM runs) AS numbered
    WHERE numbered.id = runs.id;
DROP INDEX runs_by_time;
DROP INDEX runs_by_job;
CREATE UNIQUE INDEX runs_by_sequence ON runs (sequence);
CREATE INDEX runs_by_job ON runs (job_id, sequence);

ALTER TABLE programs ADD COLUMN sequence INTEGER NOT NULL DEFAULT 0;
UPDATE programs SET sequence = numbered.place
    FROM (SELECT id, ROW_NUMBER() OVER (ORDER BY created_us, id) AS place FROM programs) AS numbered
    WHERE numbered.id = programs.id;
DROP INDEX programs_by_time;
DROP INDEX programs_by_file_name;
CREATE UNIQUE INDEX programs_by_sequence ON programs (sequence);
CREATE INDEX programs_by_file_name ON programs (file_name, sequence) WHERE file_name <> '';
