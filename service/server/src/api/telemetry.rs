//! `feedwave.v1.Telemetry`.

use feedwave_contract::convert::{
    check_printable, monitoring_from_proto, monitoring_to_proto, overrides_to_proto, recording_from_proto,
    recording_to_proto, state_to_proto as monitor_state_to_proto, timestamp,
};
use feedwave_contract::proto::ingest_request::Message as RequestMessage;
use feedwave_contract::proto::ingest_response::Message;
use feedwave_contract::proto::ingest_start::Target;
use feedwave_contract::proto::spindle_rule::Rule;
use feedwave_contract::proto::telemetry_server::Telemetry;
use feedwave_contract::proto::{
    AcknowledgeConditionRequest, AcknowledgeConditionResponse, BatchGap, GetMonitoringRequest, GetMonitoringResponse,
    GetRunRequest, GetRunResponse, IngestRequest, IngestResponse, IngestStart, IngestStarted, ListDecisionsRequest,
    ListDecisionsResponse, ListRunsRequest, ListRunsResponse, Run, RunSettings, SetMonitoringRequest,
    SetMonitoringResponse, WatchDecisionsRequest, WatchDecisionsResponse,
};
use feedwave_contract::{names, proto};
use feedwave_monitoring::{Monitor, MonitoringConfig, Recorder, RecordingLimits};
use feedwave_store::{AttachedRun, Job as JobRecord, JobState, NewRun, Run as RunRecord, RunKind};
use futures_util::{StreamExt as _, stream};
use tokio::sync::OwnedSemaphorePermit;
use tonic::{Request, Response, Status, Streaming, async_trait};
use uuid::Uuid;

use super::guarded::{Guarded, deadline};
use super::jobs::{ResponseStream, job_id};
use super::{Api, page_request, unreadable};
use crate::access::Work;
use crate::engine::Intake;
use crate::error::{Error, Result, Violations};
use crate::stored::{self, condition_to_proto, config_from_message, run_settings, run_state_to_proto};

/// Longest name of who acknowledges a condition, and longest note.
const MAX_OPERATOR_CHARACTERS: usize = 200;
const MAX_NOTE_CHARACTERS: usize = 1_000;

fn run_to_proto(run: &RunRecord) -> Run {
    Run {
        name: names::run(run.id),
        job: names::job(run.job_id),
        kind: match run.kind {
            RunKind::Telemetry => proto::RunKind::Telemetry,
            RunKind::Live => proto::RunKind::Live,
        }
        .into(),
        state: run_state_to_proto(run.state).into(),
        state_message: run.state_detail.clone(),
        create_time: Some(timestamp(run.created_us)),
        update_time: Some(timestamp(run.updated_us)),
        durable_batch: run.newest_batch,
        open_conditions: run.open_conditions.try_into().unwrap_or(u32::MAX),
        ..Run::default()
    }
}

impl Api {
    /// Sets how the telemetry of a job is judged.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn set_monitoring(&self, request: SetMonitoringRequest) -> Result<SetMonitoringResponse> {
        let mut violations = Violations::default();
        self.concerns(&request.job, names::parse_job, names::job);
        let job = violations.check("job", names::parse_job(&request.job));
        let mut table_from = None;
        let config = match request.config {
            Some(mut config) => {
                table_from = self.fill_table(&mut violations, &mut config).await?;
                // A table that could not be filled is reported already.
                let valid = violations.is_empty();
                monitoring_from_proto(&mut violations, "config", &config).filter(|_| valid)
            }
            None => {
                violations.add("config", "must be set");
                None
            }
        };
        violations.finish()?;
        let (Some(job), Some(config)) = (job, config) else {
            return Err(Error::internal("a request was neither accepted nor refused"));
        };
        let mut config = monitoring_to_proto(&config);
        let spindle = config.rules.as_mut().and_then(|rules| rules.spindle.as_mut());
        if let Some(Rule::Milling(rule)) = spindle.and_then(|spindle| spindle.rule.as_mut()) {
            rule.table_from = table_from;
        }
        self.store.put_monitoring(job, stored::to_stored(&config)?).await?;
        Ok(SetMonitoringResponse { config: Some(config) })
    }

    /// Reads how the telemetry of a job is judged.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn get_monitoring(&self, request: GetMonitoringRequest) -> Result<GetMonitoringResponse> {
        let config = self.store.monitoring(job_id("job", &request.job)?).await?;
        Ok(GetMonitoringResponse { config: Some(stored::from_stored(config.get())?) })
    }

    /// Reads a run.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn get_run(&self, request: GetRunRequest) -> Result<GetRunResponse> {
        let id = names::parse_run(&request.name).map_err(|error| Error::invalid("name", error.to_string()))?;
        let record = self.store.run(id).await?;
        let gaps = self.store.telemetry_gaps(&record).await?;
        let gaps = gaps.iter().map(|gap| BatchGap { first: gap.first, last: gap.last }).collect();
        let monitoring = run_settings(&record)?.monitoring;
        let conditions = self.store.run_conditions(&record).await?.iter().map(condition_to_proto).collect();
        let activity = match self.floor().activity_of(self.store.of_all_tenants(), &record).await {
            Ok(activity) => Some(activity),
            // What is whole of the run is read all the same; the job says that it is damaged.
            Err(Error::Damaged(_)) => None,
            Err(error) => return Err(error),
        };
        Ok(GetRunResponse { run: Some(Run { gaps, monitoring, conditions, activity, ..run_to_proto(&record) }) })
    }

    /// Acknowledges a condition of a run.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn acknowledge_condition(
        &self,
        request: AcknowledgeConditionRequest,
    ) -> Result<AcknowledgeConditionResponse> {
        let AcknowledgeConditionRequest { run, decision_number, acknowledged_by, note } = request;
        let mut violations = Violations::default();
        let id = violations.check("run", names::parse_run(&run));
        let by = acknowledged_by.trim().to_owned();
        let characters = by.chars().count();
        if characters == 0 || characters > MAX_OPERATOR_CHARACTERS {
            let why = format!("must have 1 to {MAX_OPERATOR_CHARACTERS} characters, has {characters}");
            violations.add("acknowledged_by", why);
        }
        let characters = note.chars().count();
        if characters > MAX_NOTE_CHARACTERS {
            violations.add("note", format!("must have at most {MAX_NOTE_CHARACTERS} characters, has {characters}"));
        }
        check_printable(&mut violations, "acknowledged_by", &by);
        check_printable(&mut violations, "note", &note);
        violations.finish()?;
        let id = id.ok_or_else(|| Error::internal("a request was neither accepted nor refused"))?;
        let condition = self.store.acknowledge_condition(id, decision_number, by, note).await?;
        tracing::info!(run = %id, decision = condition.decision_number, "condition acknowledged");
        let condition = condition_to_proto(&condition);
        let job = self.store.job(self.store.run(id).await?.job_id).await?;
        self.floor().acknowledge(&job.machine_id, id, &condition);
        Ok(AcknowledgeConditionResponse { condition: Some(condition) })
    }

    /// Lists runs.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn list_runs(&self, request: ListRunsRequest) -> Result<ListRunsResponse> {
        let mut violations = Violations::default();
        let page = page_request(&mut violations, request.page_size, request.page_token);
        let job = job_filter(&mut violations, &request.job);
        violations.finish()?;
        let page = self.store.list_runs(job, &page).await?;
        Ok(ListRunsResponse {
            runs: page.items.iter().map(run_to_proto).collect(),
            next_page_token: page.next_token.unwrap_or_default(),
            unreachable: page.unreachable.iter().map(|id| format!("runs/{id}")).collect(),
        })
    }

    async fn start_ingestion(
        &self,
        request: Request<Streaming<IngestRequest>>,
    ) -> Result<ResponseStream<IngestResponse>> {
        let deadline = deadline(request.metadata().as_ref());
        let mut messages = request.into_inner();
        let start = first_message(&mut messages).await?;
        match &start.target {
            Some(Target::Job(name)) => self.concerns(name, names::parse_job, names::job),
            Some(Target::Run(name)) => self.concerns(name, names::parse_run, names::run),
            None => {}
        }
        let recording = checked_recording(&start)?;
        let target = start.target.as_ref().ok_or_else(|| Error::invalid("start.target", "job or run must be set"))?;
        let job = match target {
            Target::Job(name) => job_id("start.job", name)?,
            Target::Run(name) => {
                let id = names::parse_run(name).map_err(|error| Error::invalid("start.run", error.to_string()))?;
                let run = self.store.run(id).await?;
                if run.kind != RunKind::Telemetry {
                    let message = format!("{name} is a live run, take it up as one");
                    return Err(Error::Precondition { reason: "RUN_IS_LIVE", subject: name.clone(), message });
                }
                run.job_id
            }
        };
        // Registered before the run is taken up, so that a cancellation in between is not missed.
        let guard = self.engine.enter(job);
        let cancelled = guard.token().clone();
        self.caller.concerns(names::job(job));
        let record = self.store.job(job).await?;
        self.caller.check_machine(&record.machine_id)?;
        let (attached, place) = self.attach(target, &record, recording).await?;
        // Whoever had the run is told, and gives up its place.
        let presence = self.floor().taken_up(self.store.of_all_tenants(), &record, &attached).await?;
        let place = self.engine.place_or_given_up(place).await?;
        let (intake, ingestion) = self.engine.ingest(&attached, start.sensor_time_ns, guard, presence, place).await?;
        tracing::info!(run = %attached.run.id, durable_batch = attached.run.newest_batch, "telemetry");
        let started = started(&attached)?;
        self.engine.spawn(take_in(messages, intake, self.caller.work()));
        let started = stream::once(std::future::ready(Ok(started)));
        let guarded = Guarded::new(started.chain(ingestion), deadline)
            .ends_with(self.engine.draining(), Error::Draining)
            .ends_when_cut_off(self.engine.cut_off())
            .ends_with(&cancelled, Error::JobCancelled { job: names::job(job) });
        Ok(Box::pin(guarded))
    }

    /// The run that a client begins or takes up, and a place among those in progress where there is one.
    async fn attach(
        &self,
        target: &Target,
        &JobRecord { id: job, state, .. }: &JobRecord,
        recording: Option<RecordingLimits>,
    ) -> Result<(AttachedRun, Option<OwnedSemaphorePermit>)> {
        if state != JobState::Ready {
            let subject = names::job(job);
            let message = format!("{subject} is {state}, only a ready job can be run");
            return Err(Error::Precondition { reason: "JOB_NOT_READY", subject, message });
        }
        if let Target::Run(name) = target {
            let id = names::parse_run(name).map_err(|error| Error::invalid("start.run", error.to_string()))?;
            return Ok((self.store.attach_run(id).await?, self.engine.run_place().ok()));
        }
        let monitoring: proto::MonitoringConfig = stored::from_stored(self.store.monitoring(job).await?.get())?;
        let config = config_from_message(&monitoring)?;
        check_recordable(&config, "start.recording", recording)?;
        let monitor = Monitor::new(config)
            .map_err(|violations| Error::internal(format!("a stored configuration is refused: {violations:?}")))?;
        let monitor = monitor.snapshot().map_err(Error::internal)?.into();
        let recording = recording.as_ref().map(recording_to_proto);
        let settings = RunSettings { monitoring: Some(monitoring), recording, ..RunSettings::default() };
        let settings = stored::to_stored(&settings)?;
        // No run is made that there is no place for.
        let place = self.engine.run_place()?;
        let new = NewRun { job_id: job, kind: RunKind::Telemetry, settings, monitor };
        Ok((self.store.create_run(new).await?, Some(place)))
    }
}

/// What of a new run is kept to learn from.
fn checked_recording(start: &IngestStart) -> Result<Option<RecordingLimits>> {
    let Some(recording) = &start.recording else { return Ok(None) };
    let mut violations = Violations::default();
    let limits = recording_from_proto(&mut violations, "start.recording", recording);
    if matches!(start.target, Some(Target::Run(_))) {
        violations.add("start.recording", "must not be set for a run that is taken up: it keeps its own");
    }
    violations.finish()?;
    Ok(limits)
}

/// Refuses to record what says nothing of the tool's deflection.
pub(super) fn check_recordable(
    config: &MonitoringConfig,
    field: &'static str,
    recording: Option<RecordingLimits>,
) -> Result<()> {
    let Some(limits) = recording else { return Ok(()) };
    let refused = Recorder::new(config, limits, Vec::new(), 0).err();
    refused.map_or(Ok(()), |error| Err(Error::invalid(field, error.to_string())))
}

fn job_filter(violations: &mut Violations, job: &str) -> Option<Uuid> {
    if job.is_empty() { None } else { violations.check("job", names::parse_job(job)) }
}

/// The client's first message.
async fn first_message(messages: &mut Streaming<IngestRequest>) -> Result<IngestStart> {
    match messages.message().await {
        Ok(Some(IngestRequest { message: Some(RequestMessage::Start(start)) })) => Ok(start),
        Ok(_) => Err(Error::invalid("message", "the first message must be the start")),
        Err(status) => Err(status.into()),
    }
}

fn started(attached: &AttachedRun) -> Result<IngestResponse> {
    let monitor = Monitor::restore(&attached.monitor).map_err(Error::internal)?;
    let started = IngestStarted {
        run: names::run(attached.run.id),
        durable_batch: attached.run.newest_batch,
        overrides: Some(overrides_to_proto(monitor.overrides())),
        state: monitor_state_to_proto(monitor.state()).into(),
        feed_held: monitor.holds_feed(),
    };
    Ok(IngestResponse { message: Some(Message::Started(started)) })
}

/// Passes batches on until the client ends the run or goes away.
async fn take_in(mut messages: Streaming<IngestRequest>, intake: Intake, work: Work) {
    loop {
        // What a client sent before it left counts.
        let message = tokio::select! {
            biased;
            message = messages.message() => message,
            () = intake.left() => return,
        };
        let wanted = match message {
            Ok(Some(IngestRequest { message: Some(RequestMessage::Batch(batch)) })) => intake.batch(batch).await,
            Ok(Some(IngestRequest { message: Some(RequestMessage::End(_)) })) => return intake.end(work).await,
            Ok(Some(_)) => {
                let error = Error::invalid("message", "after the start it must be a batch or the end");
                return intake.refuse(error).await;
            }
            Ok(None) => return,
            Err(status) => match unreadable(status) {
                Some(error) => return intake.refuse(error).await,
                None => return,
            },
        };
        if !wanted {
            return;
        }
    }
}

#[async_trait]
impl Telemetry for Api {
    async fn set_monitoring(
        &self,
        request: Request<SetMonitoringRequest>,
    ) -> Result<Response<SetMonitoringResponse>, Status> {
        self.answer(request, async |api, request| api.set_monitoring(request).await).await
    }

    async fn get_monitoring(
        &self,
        request: Request<GetMonitoringRequest>,
    ) -> Result<Response<GetMonitoringResponse>, Status> {
        self.answer(request, async |api, request| api.get_monitoring(request).await).await
    }

    type IngestStream = ResponseStream<IngestResponse>;

    async fn ingest(&self, request: Request<Streaming<IngestRequest>>) -> Result<Response<Self::IngestStream>, Status> {
        Ok(Response::new(self.called_by(request.extensions()).start_ingestion(request).await?))
    }

    async fn acknowledge_condition(
        &self,
        request: Request<AcknowledgeConditionRequest>,
    ) -> Result<Response<AcknowledgeConditionResponse>, Status> {
        let acknowledge = async |api: Self, request: AcknowledgeConditionRequest| {
            // A name that is none is refused with everything else that is wrong.
            if let Ok(run) = names::parse_run(&request.run) {
                api.caller.concerns(names::run(run));
                let job = api.store.run(run).await?.job_id;
                api.caller.check_machine(&api.store.job(job).await?.machine_id)?;
            }
            api.acknowledge_condition(request).await
        };
        self.answer(request, acknowledge).await
    }

    async fn get_run(&self, request: Request<GetRunRequest>) -> Result<Response<GetRunResponse>, Status> {
        self.answer(request, async |api, request| api.get_run(request).await).await
    }

    async fn list_runs(&self, request: Request<ListRunsRequest>) -> Result<Response<ListRunsResponse>, Status> {
        self.answer(request, async |api, request| api.list_runs(request).await).await
    }

    async fn list_decisions(
        &self,
        request: Request<ListDecisionsRequest>,
    ) -> Result<Response<ListDecisionsResponse>, Status> {
        self.answer(request, async |api, request| api.list_decisions(request).await).await
    }

    type WatchDecisionsStream = ResponseStream<WatchDecisionsResponse>;

    async fn watch_decisions(
        &self,
        request: Request<WatchDecisionsRequest>,
    ) -> Result<Response<Self::WatchDecisionsStream>, Status> {
        let deadline = deadline(request.metadata().as_ref());
        let api = self.called_by(request.extensions());
        let decisions = Box::pin(api.watch_decisions(&request.into_inner())?);
        let guarded = Guarded::new(decisions, deadline)
            .ends_with(self.engine.draining(), Error::Draining)
            .ends_when_cut_off(self.engine.cut_off());
        Ok(Response::new(Box::pin(guarded)))
    }
}
