//! The store as one caller sees it: the records of its tenant, and machines and tools, which are everybody's. What belongs to
//! another tenant does not exist. Who changes something has it in the audit log by its name. What has the name of a method of the store
//! does what that does.

use bytes::Bytes;
use feedwave_contract::names;
use feedwave_store::{
    AttachedRun, AuditEntry, AuditFilter, DecisionFilter, DecisionRecord, EventFilter, Fingerprint, Job, JobDetail,
    JobEvent, JobFilter, JobState, Json, Kind, MachineRecord, NewJob, NewReport, NewRun, Page, PageRequest,
    ProgramEntry, ProgramId, ProgramInfo, RecordedCutHead, Result, Run, RunCondition, Store, StoreError, StoredReport,
    TelemetryGap, Tenant, ToolFilter, ToolRecord, UploadId, UploadInfo, UploadStart,
};
use tokio::sync::watch;
use uuid::Uuid;

use crate::access::Caller;

/// The store as one caller sees it. Cloning is cheap.
#[derive(Clone, Debug)]
pub(crate) struct Records {
    store: Store,
    caller: Caller,
}

fn missing(kind: Kind, id: impl ToString) -> StoreError {
    StoreError::NotFound { kind, id: id.to_string() }
}

impl Records {
    /// What a caller sees of a store.
    pub(crate) const fn new(store: Store, caller: Caller) -> Self {
        Self { store, caller }
    }

    /// The same store as another caller sees it.
    pub(crate) fn called_by(&self, caller: Caller) -> Self {
        Self { store: self.store.clone(), caller }
    }

    /// The store with the records of all tenants: for work on what the caller was already found to have.
    pub(crate) const fn of_all_tenants(&self) -> &Store {
        &self.store
    }

    fn tenant(&self) -> Tenant {
        self.caller.tenant()
    }

    /// The identifier of a program of this tenant.
    fn own(&self, id: ProgramId) -> ProgramId {
        id.of_tenant(self.tenant())
    }
}

/// Jobs.
impl Records {
    pub(crate) async fn job(&self, id: Uuid) -> Result<Job> {
        let job = self.store.job(id).await?;
        if job.tenant == self.tenant() { Ok(job) } else { Err(missing(Kind::Job, id)) }
    }

    pub(crate) async fn job_detail(&self, id: Uuid) -> Result<JobDetail> {
        match self.store.job_detail(id).await {
            Ok(detail) if detail.job.tenant == self.tenant() => Ok(detail),
            Ok(_) => Err(missing(Kind::Job, id)),
            // Only who may see it learns of the damage.
            Err(error) => self.job(id).await.and(Err(error)),
        }
    }

    /// See [`feedwave_store::Jobs::create_job`]; the job is the caller's.
    pub(crate) async fn create_job(&self, new: NewJob) -> Result<Job> {
        let new = NewJob { tenant: self.tenant(), owner: self.caller.name().to_owned(), ..new };
        let job = self.store.create_job(new).await?;
        self.caller.concerns(names::job(job.id));
        Ok(job)
    }

    /// The job that the same request made before, if there is one.
    pub(crate) async fn repeated_job(&self, request_id: &str, fingerprint: &Fingerprint) -> Result<Option<Job>> {
        let Some((job, first)) = self.store.job_by_request(self.tenant(), request_id).await? else { return Ok(None) };
        let job = job.repeated(&first, fingerprint)?;
        self.caller.concerns(names::job(job.id));
        Ok(Some(job))
    }

    pub(crate) async fn list_jobs(&self, filter: JobFilter, page: &PageRequest) -> Result<Page<Job>> {
        self.store.list_jobs(&JobFilter { tenant: Some(self.tenant()), ..filter }, page).await
    }

    pub(crate) async fn transition(
        &self,
        id: Uuid,
        from: &[JobState],
        to: JobState,
        detail: &str,
        report: Option<NewReport>,
    ) -> Result<Job> {
        self.caller.concerns(names::job(id));
        self.job(id).await?;
        self.store.transition(id, from, to, detail, report).await
    }

    pub(crate) async fn report(&self, id: Uuid) -> Result<StoredReport> {
        self.job(id).await?;
        self.store.report(id).await
    }

    /// See [`feedwave_store::Jobs::delete_job`]; the job as it was.
    pub(crate) async fn delete_job(&self, id: Uuid, etag: Option<&str>) -> Result<Job> {
        self.caller.concerns(names::job(id));
        let job = self.job(id).await?;
        self.store.delete_job(id, etag).await?;
        Ok(job)
    }

    pub(crate) async fn events_after(&self, sequence: i64, job_id: Option<Uuid>, limit: u32) -> Result<Vec<JobEvent>> {
        let filter = EventFilter { tenant: Some(self.tenant()), job_id };
        self.store.events_after(sequence, &filter, limit).await
    }

    /// See [`feedwave_store::Jobs::watch_events`]: it tells of the events of all tenants, by their numbers.
    pub(crate) fn watch_events(&self) -> watch::Receiver<i64> {
        self.store.watch_events()
    }
}

/// Programs.
impl Records {
    pub(crate) async fn put_program(&self, source: Bytes) -> Result<ProgramInfo> {
        self.store.put_program(self.tenant(), source).await
    }

    pub(crate) async fn program_info(&self, id: ProgramId) -> Result<ProgramInfo> {
        self.store.program_info(self.own(id)).await
    }

    pub(crate) async fn program_entry(&self, id: ProgramId) -> Result<ProgramEntry> {
        self.store.program_entry(self.own(id)).await
    }

    pub(crate) async fn list_programs(&self, file_name: &str, page: &PageRequest) -> Result<Page<ProgramEntry>> {
        self.store.list_programs(Some(self.tenant()), file_name, page).await
    }

    pub(crate) async fn name_program(&self, id: ProgramId, file_name: &str) -> Result<()> {
        self.store.name_program(self.own(id), file_name).await
    }

    pub(crate) async fn delete_program(&self, id: ProgramId) -> Result<()> {
        self.caller.concerns(names::program(id));
        self.store.delete_program(self.own(id)).await
    }

    pub(crate) async fn begin_upload(&self, expected: ProgramId, size_bytes: u64) -> Result<UploadStart> {
        self.caller.concerns(names::program(expected));
        self.store.begin_upload(self.own(expected), size_bytes, &self.caller.client()).await
    }

    /// See [`feedwave_store::Programs::append_upload`], of an upload that the caller has begun.
    pub(crate) async fn append_upload(&self, upload: &UploadInfo, offset: u64, data: Bytes) -> Result<u64> {
        self.store.append_upload(upload.id, offset, data).await
    }

    /// See [`feedwave_store::Programs::finish_upload`], of an upload that the caller has begun.
    pub(crate) async fn finish_upload(&self, upload: &UploadInfo) -> Result<ProgramInfo> {
        self.store.finish_upload(upload.id).await
    }

    pub(crate) async fn uploads(&self) -> Result<Vec<UploadInfo>> {
        let mut uploads = self.store.uploads().await?;
        uploads.retain(|upload| upload.expected.tenant() == self.tenant());
        Ok(uploads)
    }

    /// See [`feedwave_store::Programs::delete_upload`], of one of [`Records::uploads`].
    pub(crate) async fn delete_upload(&self, id: UploadId) -> Result<()> {
        self.store.delete_upload(id).await
    }
}

/// Runs.
impl Records {
    pub(crate) async fn put_monitoring(&self, job_id: Uuid, config: Json) -> Result<()> {
        self.caller.concerns(names::job(job_id));
        self.job(job_id).await?;
        self.store.put_monitoring(job_id, config).await
    }

    pub(crate) async fn monitoring(&self, job_id: Uuid) -> Result<Json> {
        self.job(job_id).await?;
        self.store.monitoring(job_id).await
    }

    pub(crate) async fn create_run(&self, new: NewRun) -> Result<AttachedRun> {
        self.job(new.job_id).await?;
        let attached = self.store.create_run(new).await?;
        self.caller.concerns(names::run(attached.run.id));
        Ok(attached)
    }

    pub(crate) async fn attach_run(&self, id: Uuid) -> Result<AttachedRun> {
        self.caller.concerns(names::run(id));
        self.run(id).await?;
        self.store.attach_run(id).await
    }

    pub(crate) async fn run(&self, id: Uuid) -> Result<Run> {
        let run = self.store.run(id).await?;
        if run.tenant == self.tenant() { Ok(run) } else { Err(missing(Kind::Run, id)) }
    }

    pub(crate) async fn list_runs(&self, job_id: Option<Uuid>, page: &PageRequest) -> Result<Page<Run>> {
        self.store.list_runs(Some(self.tenant()), job_id, page).await
    }

    pub(crate) async fn run_conditions(&self, run: &Run) -> Result<Vec<RunCondition>> {
        self.store.run_conditions(run.id).await
    }

    pub(crate) async fn telemetry_gaps(&self, run: &Run) -> Result<Vec<TelemetryGap>> {
        self.store.telemetry_gaps(run.id).await
    }

    pub(crate) async fn recorded_cuts(&self, run: &Run) -> Result<Vec<RecordedCutHead>> {
        self.store.recorded_cuts(run.id).await
    }

    pub(crate) async fn recorded_cut(&self, run: &Run, number: u64) -> Result<Bytes> {
        self.store.recorded_cut(run.id, number).await
    }

    pub(crate) async fn acknowledge_condition(
        &self,
        id: Uuid,
        decision_number: Option<u64>,
        by: String,
        note: String,
    ) -> Result<RunCondition> {
        self.caller.concerns(names::run(id));
        self.run(id).await?;
        self.store.acknowledge_condition(id, decision_number, by, note).await
    }

    pub(crate) async fn decisions_after(
        &self,
        sequence: i64,
        filter: &DecisionFilter,
        limit: u32,
    ) -> Result<Vec<DecisionRecord>> {
        let filter = DecisionFilter { tenant: Some(self.tenant()), ..*filter };
        self.store.decisions_after(sequence, &filter, limit).await
    }

    /// See [`feedwave_store::Runs::watch_decisions`]: it tells of the decisions of all tenants, by their numbers.
    pub(crate) fn watch_decisions(&self) -> watch::Receiver<i64> {
        self.store.watch_decisions()
    }
}

/// The figures of what the caller may see: of its tenant, or of all.
impl Records {
    pub(crate) async fn count_jobs(&self) -> Result<Vec<(JobState, u64)>> {
        self.store.count_jobs(self.caller.confined_to()).await
    }

    pub(crate) async fn count_open_conditions(&self) -> Result<u64> {
        self.store.count_open_conditions(self.caller.confined_to()).await
    }

    /// Position of the newest event.
    pub(crate) async fn newest_event(&self) -> Result<i64> {
        match self.caller.confined_to() {
            Some(tenant) => self.store.newest_event(tenant).await,
            None => Ok(self.store.latest_sequence()),
        }
    }

    pub(crate) async fn audit_after(&self, sequence: i64, principal: &str, limit: u32) -> Result<Vec<AuditEntry>> {
        self.store.audit_after(sequence, &self.audit_filter(principal), limit).await
    }

    pub(crate) async fn audit_changed_after(
        &self,
        change: i64,
        principal: &str,
        limit: u32,
    ) -> Result<Vec<AuditEntry>> {
        self.store.audit_changed_after(change, &self.audit_filter(principal), limit).await
    }

    /// What the caller may see of the audit log, of this client or, where it is empty, of all.
    fn audit_filter(&self, principal: &str) -> AuditFilter {
        AuditFilter {
            tenant: self.caller.confined_to().map(|tenant| tenant.name().to_owned()),
            principal: Some(principal.to_owned()).filter(|principal| !principal.is_empty()),
        }
    }
}

/// Machines and tools: the workshop's, whatever the tenant.
impl Records {
    pub(crate) async fn create_machine(&self, id: Option<&str>, body: Json) -> Result<MachineRecord> {
        if let Some(id) = id {
            self.caller.concerns(names::machine(id));
        }
        self.store.create_machine(id, body).await
    }

    pub(crate) async fn machine(&self, id: &str) -> Result<MachineRecord> {
        self.store.machine(id).await
    }

    pub(crate) async fn list_machines(&self, page: &PageRequest) -> Result<Page<MachineRecord>> {
        self.store.list_machines(page).await
    }

    pub(crate) async fn update_machine(&self, id: &str, etag: Option<&str>, body: Json) -> Result<MachineRecord> {
        self.caller.concerns(names::machine(id));
        self.store.update_machine(id, etag, body).await
    }

    pub(crate) async fn delete_machine(&self, id: &str, etag: Option<&str>) -> Result<()> {
        self.caller.concerns(names::machine(id));
        self.store.delete_machine(id, etag).await
    }

    pub(crate) async fn create_tool(&self, id: Option<&str>, number: u32, body: Json) -> Result<ToolRecord> {
        if let Some(id) = id {
            self.caller.concerns(names::tool(id));
        }
        self.store.create_tool(id, number, body).await
    }

    pub(crate) async fn tool(&self, id: &str) -> Result<ToolRecord> {
        self.store.tool(id).await
    }

    pub(crate) async fn list_tools(&self, filter: &ToolFilter, page: &PageRequest) -> Result<Page<ToolRecord>> {
        self.store.list_tools(filter, page).await
    }

    pub(crate) async fn update_tool(
        &self,
        id: &str,
        etag: Option<&str>,
        number: u32,
        body: Json,
    ) -> Result<ToolRecord> {
        self.caller.concerns(names::tool(id));
        self.store.update_tool(id, etag, number, body).await
    }

    pub(crate) async fn delete_tool(&self, id: &str, etag: Option<&str>) -> Result<()> {
        self.caller.concerns(names::tool(id));
        self.store.delete_tool(id, etag).await
    }
}
