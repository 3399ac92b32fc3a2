-- Results come into entries that were read already: a number that grows with each change of an entry lets readers follow them.
-- And how many entries each tenant has, so that the bound of the log is kept at the cost of who fills it.

ALTER TABLE audit_entries ADD COLUMN change BIGINT NOT NULL DEFAULT 0;
UPDATE audit_entries SET change = sequence;
CREATE INDEX audit_entries_by_change ON audit_entries (change);
CREATE INDEX audit_entries_by_principal_change ON audit_entries (principal, change);
CREATE INDEX audit_entries_by_tenant_change ON audit_entries (tenant, change);

INSERT INTO counters (name, newest) SELECT 'audit_change', newest FROM counters WHERE name = 'audit';

CREATE TABLE audit_tenants (
    tenant  TEXT   NOT NULL PRIMARY KEY,
    entries BIGINT NOT NULL
);
INSERT INTO audit_tenants (tenant, entries) SELECT tenant, COUNT(*) FROM audit_entries GROUP BY tenant;
