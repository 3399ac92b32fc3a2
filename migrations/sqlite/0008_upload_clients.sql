-- Who uploads, for limits by client.
ALTER TABLE uploads ADD COLUMN client TEXT NOT NULL DEFAULT '';
CREATE INDEX uploads_by_client ON uploads (client);
