-- Who asked for what and what came of it: every call that changes something, and every one that was refused for want of rights.
CREATE TABLE audit_entries (
    sequence    INTEGER PRIMARY KEY AUTOINCREMENT,
    at_us       INTEGER NOT NULL,
    -- When the result was known, or was the same again; null while it is not known.
    ended_us    INTEGER,
    principal   TEXT    NOT NULL,
    tenant      TEXT    NOT NULL,
    address     TEXT    NOT NULL,
    certificate TEXT    NOT NULL,
    method      TEXT    NOT NULL,
    request_id  TEXT    NOT NULL,
    resource    TEXT    NOT NULL,
    -- Name of a status code of gRPC; empty while it is not known.
    result      TEXT    NOT NULL,
    reason      TEXT    NOT NULL,
    occurrences INTEGER NOT NULL
) STRICT;
CREATE INDEX audit_entries_by_principal ON audit_entries (principal, sequence);
CREATE INDEX audit_entries_by_tenant ON audit_entries (tenant, sequence);
