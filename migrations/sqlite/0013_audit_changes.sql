-- Results come into entries that were read already: a number that grows with each change of an entry lets readers follow them.
-- And how many entries each tenant has, so that the bound of the log is kept at the cost of who fills it.

ALTER TABLE audit_entries ADD COLUMN change INTEGER NOT NULL DEFAULT 0;
UPDATE audit_entries SET change = sequence;
CREATE INDEX audit_entries_by_change ON audit_entries (change);
CREATE INDEX audit_entries_by_principal_change ON audit_entries (principal, change);
CREATE INDEX audit_entries_by_tenant_change ON audit_entries (tenant, change);

-- The newest numbers that were given, where they are no row's key.
CREATE TABLE counters (
    name   TEXT    NOT NULL PRIMARY KEY,
    newest INTEGER NOT NULL
) STRICT;
INSERT INTO counters (name, newest)
    SELECT 'audit_change', COALESCE((SELECT seq FROM sqlite_sequence WHERE name = 'audit_entries'), 0);

CREATE TABLE audit_tenants (
    tenant  TEXT    NOT NULL PRIMARY KEY,
    entries INTEGER NOT NULL
) STRICT;
INSERT INTO audit_tenants (tenant, entries) SELECT tenant, COUNT(*) FROM audit_entries GROUP BY tenant;
