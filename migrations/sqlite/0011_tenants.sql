-- Who has a record, and who made it. Earlier records are of the default tenant, whose name is empty. What is unique within a
-- tenant (request_id of jobs, id of programs and what refers to it, expected_id of uploads) has a space and the tenant's name
-- behind it, but for the default tenant: so two tenants have the same program without either knowing of the other.

ALTER TABLE jobs ADD COLUMN tenant TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN owner TEXT NOT NULL DEFAULT '';
CREATE INDEX jobs_by_tenant ON jobs (tenant, sequence);
CREATE INDEX jobs_by_tenant_and_state ON jobs (tenant, state, sequence);

ALTER TABLE programs ADD COLUMN tenant TEXT NOT NULL DEFAULT '';
CREATE INDEX programs_by_tenant ON programs (tenant, sequence);

ALTER TABLE runs ADD COLUMN tenant TEXT NOT NULL DEFAULT '';
CREATE INDEX runs_by_tenant ON runs (tenant, sequence);

ALTER TABLE decisions ADD COLUMN tenant TEXT NOT NULL DEFAULT '';
CREATE INDEX decisions_by_tenant ON decisions (tenant, sequence);

ALTER TABLE job_events ADD COLUMN tenant TEXT NOT NULL DEFAULT '';
CREATE INDEX job_events_by_tenant ON job_events (tenant, sequence);
