-- Who created a job, for shares of the validation workers: an address, or another name that the service gives a client.
ALTER TABLE jobs ADD COLUMN client TEXT NOT NULL DEFAULT '';
-- Times that validation was begun and not ended in order: counted before the work, so that a job that takes the process
-- with it is known.
ALTER TABLE jobs ADD COLUMN attempts INTEGER NOT NULL DEFAULT 0;
