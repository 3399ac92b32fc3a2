-- Programs have the name of the file that they were uploaded as, and jobs have further program files.

ALTER TABLE programs ADD COLUMN file_name TEXT NOT NULL DEFAULT '';
CREATE INDEX programs_by_time ON programs (created_us, id);
CREATE INDEX programs_by_file_name ON programs (file_name, created_us, id) WHERE file_name <> '';

-- The further program files of a job; their names and their order are in its settings.
CREATE TABLE job_programs (
    job_id     TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    program_id TEXT NOT NULL REFERENCES programs (id),
    PRIMARY KEY (job_id, program_id)
) STRICT, WITHOUT ROWID;
CREATE INDEX job_programs_by_program ON job_programs (program_id, job_id);
