//! `feedwave.v1.Jobs`: jobs. Their events and their programs are in modules of their own.

use std::collections::HashMap;
use std::pin::Pin;

use feedwave_contract::convert::{self, timestamp, timestamp_us};
use feedwave_contract::proto::jobs_server::Jobs;
use feedwave_contract::proto::{
    CancelJobRequest, CancelJobResponse, CreateJobRequest, CreateJobResponse, DeleteJobRequest, DeleteJobResponse,
    DeleteProgramRequest, DeleteProgramResponse, GetJobRequest, GetJobResponse, GetReportRequest, GetReportResponse,
    GetUploadRequest, GetUploadResponse, Job, JobSettings, ListJobEventsRequest, ListJobEventsResponse,
    ListJobsRequest, ListJobsResponse, UploadProgramRequest, UploadProgramResponse, ValidateProgramRequest,
    ValidateProgramResponse, ValidationReport, WatchJobsRequest, WatchJobsResponse, create_job_request,
    validate_program_request,
};
use feedwave_contract::{names, proto};
use feedwave_cutting::PipelineConfig;
use feedwave_store::{Fingerprint, Job as JobRecord, JobDetail, JobFilter, JobState, NewJob, ProgramId, StoreError};
use futures_util::Stream;
use prost::Message as _;
use tonic::{Request, Response, Status, Streaming, async_trait};
use uuid::Uuid;

use super::guarded::{Guarded, deadline};
use super::settings::check_settings;
use super::{Api, etag, page_request};
use crate::engine::{self, File, ValidationProgress};
use crate::error::{Error, Result, Violations};
use crate::stored;

/// Longest request id, characters.
const MAX_REQUEST_ID: usize = 64;

/// A state as the contract has it.
#[must_use]
pub(crate) const fn state_to_proto(state: JobState) -> proto::JobState {
    match state {
        JobState::PendingValidation => proto::JobState::Pending,
        JobState::Validating => proto::JobState::Validating,
        JobState::Ready => proto::JobState::Ready,
        JobState::Rejected => proto::JobState::Rejected,
        JobState::Cancelled => proto::JobState::Cancelled,
        JobState::Failed => proto::JobState::Failed,
    }
}

fn state_from_proto(state: proto::JobState) -> Option<JobState> {
    JobState::ALL.into_iter().find(|known| state_to_proto(*known) == state)
}

fn job_to_proto(
    job: &JobRecord,
    settings: Option<JobSettings>,
    progress: &HashMap<Uuid, ValidationProgress>,
) -> Result<Job> {
    // The engine may be behind the store: a job whose validation has ended shows none.
    let waits = matches!(job.state, JobState::PendingValidation | JobState::Validating);
    let progress = progress.get(&job.id).copied().unwrap_or_default();
    Ok(Job {
        name: names::job(job.id),
        display_name: job.display_name.clone(),
        owner: job.owner.clone(),
        state: state_to_proto(job.state).into(),
        state_message: job.state_detail.clone(),
        machine: names::machine(&job.machine_id),
        program: names::program(job.program_id),
        program_bytes: job.program_size_bytes,
        settings,
        summary: job.summary.as_ref().and_then(|stored| summary(job.id, stored.get())),
        etag: job.etag(),
        create_time: Some(timestamp(job.created_us)),
        update_time: Some(timestamp(job.updated_us)),
        validation: waits.then_some(proto::ValidationProgress {
            queue_place: progress.queue_place,
            read_bytes: progress.bytes_read,
            setpoint_count: progress.setpoint_count,
        }),
        validation_attempts: job.attempts,
    })
}

/// The summary of a job's report. One that is damaged is left out, as in the store.
fn summary(job: Uuid, stored: &str) -> Option<proto::ProgramSummary> {
    let read = stored::from_stored(stored);
    read.inspect_err(|error| tracing::error!(%job, %error, "the summary of a report is damaged")).ok()
}

/// The identifier of the job that a request names.
pub(super) fn job_id(field: &str, name: &str) -> Result<Uuid> {
    names::parse_job(name).map_err(|error| Error::invalid(field, error.to_string()))
}

/// Whether an inline program is within the limit; what is larger is uploaded.
pub(super) fn check_inline(violations: &mut Violations, size: usize, limit: u64) {
    if size as u64 > limit {
        let reason = format!("has {size} bytes, more than the {limit} allowed inline; upload it instead");
        violations.add("inline_program", reason);
    }
}

fn check_request_id(violations: &mut Violations, request_id: &str) {
    let valid = request_id.len() <= MAX_REQUEST_ID && request_id.bytes().all(|byte| byte.is_ascii_graphic());
    if !valid {
        violations.add("request_id", format!("must be 1 to {MAX_REQUEST_ID} printable ASCII characters"));
    }
}

impl Api {
    /// A job as the contract has it.
    fn detail_to_proto(&self, detail: &JobDetail) -> Result<Job> {
        job_to_proto(&detail.job, Some(engine::job_settings(detail)?), &self.engine.progress(&[detail.job.id]))
    }

    /// Stores a job of the caller.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn create_job(&self, request: CreateJobRequest) -> Result<CreateJobResponse> {
        let mut violations = Violations::default();
        check_request_id(&mut violations, &request.request_id);
        let machine_id = violations.check("machine", names::parse_machine(&request.machine));
        let program_id = self.check_source(&mut violations, request.source.as_ref());
        let inline_bytes = match &request.source {
            Some(create_job_request::Source::InlineProgram(program)) => program.len(),
            _ => 0,
        };
        self.check_program_files(&mut violations, "programs", &request.programs, inline_bytes);
        convert::check_display_name(&mut violations, "display_name", &request.display_name);
        convert::check_display_name(&mut violations, "file_name", &request.file_name);
        let checked = check_settings(
            &mut violations,
            request.interpolation_period_us,
            request.generation_mode,
            request.vibration_envelope,
            &request.tools,
            request.oscillation.as_ref(),
        );
        if let Some(offsets) = &request.offsets {
            convert::check_offsets(&mut violations, "offsets", offsets);
        }
        violations.finish()?;
        let (Some(machine_id), Some(program_id)) = (machine_id, program_id) else {
            return Err(Error::internal("a request was neither accepted nor refused"));
        };

        let fingerprint = CreateJobRequest { request_id: String::new(), ..request.clone() }.encode_to_vec();
        let fingerprint = Fingerprint::of([fingerprint.as_slice()]);
        // A repeat changes nothing, whatever became of the machine and the tools since.
        if !request.request_id.is_empty()
            && let Some(job) = self.store.repeated_job(&request.request_id, &fingerprint).await?
        {
            return Ok(CreateJobResponse { job: Some(self.detail_to_proto(&self.job_detail(job.id).await?)?) });
        }
        let (profile, document) = self.machine_profile(machine_id).await?;
        let mut settings = self.settings(&checked, &profile).await?;
        let (programs, further_program_ids) = self.store_files(&request.programs).await?;
        settings.programs = programs;
        settings.offsets = request.offsets.clone();
        if let Some(create_job_request::Source::InlineProgram(program)) = &request.source {
            self.store.put_program(program.clone()).await?;
        }
        self.name_program(program_id, &request.file_name).await?;
        let new = NewJob {
            tenant: self.caller.tenant(),
            owner: self.caller.name().to_owned(),
            request_id: if request.request_id.is_empty() {
                Uuid::now_v7().to_string()
            } else {
                request.request_id.clone()
            },
            fingerprint,
            display_name: request.display_name.clone(),
            program_id,
            further_program_ids,
            machine_id: machine_id.to_owned(),
            client: self.caller.client(),
            machine_snapshot: stored::to_stored(&document)?,
            settings: stored::to_stored(&settings)?,
        };
        let job = self.store.create_job(new).await?;
        tracing::info!(job = %job.id, program = %job.program_id, machine = %job.machine_id, "created");
        self.engine.wake();
        Ok(CreateJobResponse { job: Some(self.detail_to_proto(&self.job_detail(job.id).await?)?) })
    }

    /// The program that a new job is for. An inline one is not stored yet.
    fn check_source(
        &self,
        violations: &mut Violations,
        source: Option<&create_job_request::Source>,
    ) -> Option<ProgramId> {
        match source {
            Some(create_job_request::Source::InlineProgram(program)) => {
                check_inline(violations, program.len(), self.limits.inline_program_bytes);
                Some(ProgramId::of(program))
            }
            Some(create_job_request::Source::Program(name)) => violations.check("program", names::parse_program(name)),
            None => {
                violations.add("source", "inline_program or program must be set");
                None
            }
        }
    }

    /// Validates a program without storing anything.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn validate_program(&self, request: ValidateProgramRequest) -> Result<ValidateProgramResponse> {
        let mut violations = Violations::default();
        check_inline(&mut violations, request.inline_program.len(), self.limits.inline_program_bytes);
        self.check_program_files(&mut violations, "programs", &request.programs, request.inline_program.len());
        let checked = check_settings(
            &mut violations,
            request.interpolation_period_us,
            request.generation_mode,
            request.vibration_envelope,
            &request.tools,
            request.oscillation.as_ref(),
        );
        if let Some(offsets) = &request.offsets {
            convert::check_offsets(&mut violations, "offsets", offsets);
        }
        let mut machine_id = None;
        let mut profile = None;
        match &request.on {
            Some(validate_program_request::On::Machine(name)) => {
                machine_id = violations.check("machine", names::parse_machine(name));
            }
            Some(validate_program_request::On::Profile(given)) => {
                profile = convert::profile_from_proto(&mut violations, "profile", given);
            }
            None => violations.add("on", "machine or profile must be set"),
        }
        let overrides = convert::overrides_from_proto(
            &mut violations,
            "overrides",
            &request.overrides,
            checked.requested.interpolation_period_us,
        );
        convert::check_holds(&mut violations, "overrides", &overrides, checked.requested.interpolation_period_us);
        violations.finish()?;
        let profile = match (profile, machine_id) {
            (Some(profile), _) => profile,
            (None, Some(id)) => self.machine_profile(id).await?.0,
            (None, None) => return Err(Error::internal("a request was neither accepted nor refused")),
        };
        let mut settings = self.settings(&checked, &profile).await?;
        let program_bytes = request.inline_program.len() as u64;
        let (source, programs) = self.sources(File::Memory(request.inline_program), &request.programs).await?;
        settings.programs = programs;
        settings.offsets = request.offsets;
        let config = PipelineConfig { overrides, ..convert::pipeline_config(profile, &settings) };
        let report = self.engine.validate_program(&self.caller.client(), config, program_bytes, source).await?;
        Ok(ValidateProgramResponse { report: Some(convert::report_to_proto(&report)) })
    }

    /// Reads a job.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn get_job(&self, request: GetJobRequest) -> Result<GetJobResponse> {
        let id = job_id("name", &request.name)?;
        let detail = self.job_detail(id).await?;
        Ok(GetJobResponse { job: Some(self.marked(id, self.detail_to_proto(&detail)).await?) })
    }

    /// A job with its documents.
    pub(super) async fn job_detail(&self, id: Uuid) -> Result<JobDetail> {
        self.marked(id, self.store.job_detail(id).await.map_err(Error::from)).await
    }

    /// What was read of a job, which is marked where that is damaged.
    pub(super) async fn marked<T>(&self, id: Uuid, read: Result<T>) -> Result<T> {
        match read {
            Ok(read) => Ok(read),
            Err(error) => Err(self.engine.mark_damaged(id, error).await),
        }
    }

    /// Reads the report of a job.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn get_report(&self, request: GetReportRequest) -> Result<GetReportResponse> {
        let id = job_id("job", &request.job)?;
        let job = self.store.job(id).await?;
        if job.findings.is_none() {
            let subject = names::job(id);
            let message = format!("{subject} is {} and has no report", job.state);
            if matches!(job.state, JobState::Ready | JobState::Rejected) {
                // It was written with the state.
                return Err(self.engine.mark_damaged(id, Error::Damaged(message)).await);
            }
            return Err(Error::Precondition { reason: "JOB_NOT_VALIDATED", subject, message });
        }
        let stored = self.store.report(id).await.map_err(Error::from);
        let report = stored.and_then(|stored| stored::from_stored::<ValidationReport>(stored.report.get()));
        Ok(GetReportResponse { report: Some(self.marked(id, report).await?) })
    }

    /// Lists jobs.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn list_jobs(&self, request: ListJobsRequest) -> Result<ListJobsResponse> {
        let mut violations = Violations::default();
        let page = page_request(&mut violations, request.page_size, request.page_token);
        let mut filter = JobFilter::default();
        for (index, state) in request.states.iter().enumerate() {
            match proto::JobState::try_from(*state).ok().and_then(state_from_proto) {
                Some(state) => filter.states.push(state),
                None => violations.add(format!("states[{index}]"), format!("{state} is not a state of a job")),
            }
        }
        if !request.machine.is_empty() {
            let id = violations.check("machine", names::parse_machine(&request.machine));
            filter.machine_id = id.map(str::to_owned);
        }
        let mut time = |field: &str, time: Option<prost_types::Timestamp>| {
            time.and_then(|time| violations.check(field, timestamp_us(&time)))
        };
        filter.created_from_us = time("created_from", request.created_from);
        filter.created_before_us = time("created_before", request.created_before);
        violations.finish()?;
        filter.states.sort_unstable();
        filter.states.dedup();
        let page = self.store.list_jobs(filter, &page).await?;
        let progress = self.engine.progress(&page.items.iter().map(|job| job.id).collect::<Vec<_>>());
        Ok(ListJobsResponse {
            jobs: page.items.iter().map(|job| job_to_proto(job, None, &progress)).collect::<Result<_>>()?,
            next_page_token: page.next_token.unwrap_or_default(),
            unreachable: page.unreachable.iter().map(|id| format!("jobs/{id}")).collect(),
        })
    }

    /// Cancels a job.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn cancel_job(&self, request: CancelJobRequest) -> Result<CancelJobResponse> {
        let id = job_id("name", &request.name)?;
        let from = [JobState::PendingValidation, JobState::Validating, JobState::Ready];
        let transition = self.store.transition(id, &from, JobState::Cancelled, "cancelled by a client", None).await;
        match transition {
            Ok(_) => tracing::info!(job = %id, "cancelled"),
            // Repeating the call is harmless.
            Err(StoreError::FailedState { actual: JobState::Cancelled, .. }) => {}
            Err(error) => return Err(error.into()),
        }
        self.engine.cancel_job(id);
        Ok(CancelJobResponse { job: Some(self.detail_to_proto(&self.job_detail(id).await?)?) })
    }

    /// Deletes a job.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn delete_job(&self, request: DeleteJobRequest) -> Result<DeleteJobResponse> {
        let id = job_id("name", &request.name)?;
        let deleted = self.store.delete_job(id, etag(&request.etag)).await?;
        self.floor().forget_job(&deleted.machine_id, id);
        self.engine.cancel_job(id);
        tracing::info!(job = %id, "deleted");
        Ok(DeleteJobResponse {})
    }
}

/// Messages of a server stream.
pub(super) type ResponseStream<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

#[async_trait]
impl Jobs for Api {
    async fn create_job(&self, request: Request<CreateJobRequest>) -> Result<Response<CreateJobResponse>, Status> {
        self.answer(request, async |api, request| api.create_job(request).await).await
    }

    async fn upload_program(
        &self,
        request: Request<Streaming<UploadProgramRequest>>,
    ) -> Result<Response<UploadProgramResponse>, Status> {
        self.answer(request, async |api, messages| api.upload_program(messages).await).await
    }

    async fn get_upload(&self, request: Request<GetUploadRequest>) -> Result<Response<GetUploadResponse>, Status> {
        self.answer(request, async |api, request| api.get_upload(request).await).await
    }

    async fn validate_program(
        &self,
        request: Request<ValidateProgramRequest>,
    ) -> Result<Response<ValidateProgramResponse>, Status> {
        self.answer(request, async |api, request| api.validate_program(request).await).await
    }

    async fn get_job(&self, request: Request<GetJobRequest>) -> Result<Response<GetJobResponse>, Status> {
        self.answer(request, async |api, request| api.get_job(request).await).await
    }

    async fn get_report(&self, request: Request<GetReportRequest>) -> Result<Response<GetReportResponse>, Status> {
        self.answer(request, async |api, request| api.get_report(request).await).await
    }

    async fn list_jobs(&self, request: Request<ListJobsRequest>) -> Result<Response<ListJobsResponse>, Status> {
        self.answer(request, async |api, request| api.list_jobs(request).await).await
    }

    async fn list_job_events(
        &self,
        request: Request<ListJobEventsRequest>,
    ) -> Result<Response<ListJobEventsResponse>, Status> {
        self.answer(request, async |api, request| api.list_job_events(request).await).await
    }

    type WatchJobsStream = ResponseStream<WatchJobsResponse>;

    async fn watch_jobs(&self, request: Request<WatchJobsRequest>) -> Result<Response<Self::WatchJobsStream>, Status> {
        let deadline = deadline(request.metadata().as_ref());
        let api = self.called_by(request.extensions());
        let events = Box::pin(api.watch_events(&request.into_inner())?);
        let guarded = Guarded::new(events, deadline)
            .ends_with(self.engine.draining(), Error::Draining)
            .ends_when_cut_off(self.engine.cut_off());
        Ok(Response::new(Box::pin(guarded)))
    }

    async fn cancel_job(&self, request: Request<CancelJobRequest>) -> Result<Response<CancelJobResponse>, Status> {
        self.answer(request, async |api, request| api.cancel_job(request).await).await
    }

    async fn delete_job(&self, request: Request<DeleteJobRequest>) -> Result<Response<DeleteJobResponse>, Status> {
        self.answer(request, async |api, request| api.delete_job(request).await).await
    }

    async fn delete_program(
        &self,
        request: Request<DeleteProgramRequest>,
    ) -> Result<Response<DeleteProgramResponse>, Status> {
        self.answer(request, async |api, request| api.delete_program(request).await).await
    }
}
