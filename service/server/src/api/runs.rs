//! `feedwave.v1.Runs`.

use feedwave_contract::convert::{
    check_period_us, enumeration, generation_mode_from_proto, generation_mode_to_proto, monitoring_to_proto,
    overrides_to_proto, recording_from_proto, recording_to_proto, state_to_proto as monitor_state_to_proto,
};
use feedwave_contract::proto::run_request::Message as RequestMessage;
use feedwave_contract::proto::run_response::Message;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::runs_server::Runs;
use feedwave_contract::proto::{
    ReplayRunRequest, ReplayRunResponse, RunRequest, RunResponse, RunSettings, RunStart, RunStarted, StreamHeader,
    ValidationReport,
};
use feedwave_contract::stream::ColumnSet;
use feedwave_contract::{names, proto};
use feedwave_cutting::{Frame, GenerationMode, MAX_OVERRIDE_RATIO, MIN_OVERRIDE_RATIO, PipelineConfig};
use feedwave_monitoring::{Monitor, MonitoringConfig, SpindleRule};
use feedwave_store::{AttachedRun, JobDetail, JobState, NewRun, Run, RunKind};
use futures_util::{StreamExt as _, stream};
use tonic::{Request, Response, Status, Streaming, async_trait};
use uuid::Uuid;

use super::guarded::{Guarded, deadline};
use super::jobs::{ResponseStream, job_id};
use super::telemetry::check_recordable;
use super::{Api, unreadable};
use crate::engine::{self, LiveInput, LiveIntake, LivePlan, feed_change_to_proto};
use crate::error::{Error, Result, Violations};
use crate::stored::{self, config_from_message, run_settings};

/// Configuration of the pipeline of a run.
fn pipeline_config(detail: &JobDetail, settings: &RunSettings) -> Result<PipelineConfig> {
    let own = engine::job_config(detail)?;
    let period_us = match settings.interpolation_period_us {
        0 => own.interpolation_period_us,
        period_us => period_us,
    };
    Ok(PipelineConfig {
        interpolation_period_us: period_us,
        spindle_changes: settings.plans_spindle.then(Vec::new),
        generation_mode: generation_mode_from_proto(settings.generation_mode()).unwrap_or(own.generation_mode),
        frame: if settings.frame() == proto::Frame::Work { Frame::Work } else { Frame::Machine },
        ..own
    })
}

/// What a start asks for, as far as it can be judged without the job.
struct CheckedStart<'a> {
    target: &'a Target,
    encoding: proto::Encoding,
}

/// What a start goes on with.
enum Begun {
    /// A run that is to be made.
    New(NewRun),
    /// One that was begun before.
    Before(Run),
}

impl Begun {
    fn settings(&self) -> Result<RunSettings> {
        stored::from_stored(match self {
            Self::New(new) => new.settings.get(),
            Self::Before(run) => run.settings.get(),
        })
    }
}

fn check_start(start: &RunStart) -> Result<CheckedStart<'_>> {
    let mut violations = Violations::default();
    let encoding = match enumeration(&mut violations, "start.encoding", start.encoding) {
        Some(encoding @ (proto::Encoding::FixedPointDelta | proto::Encoding::RawDouble)) => encoding,
        _ => proto::Encoding::PackedDouble,
    };
    match &start.target {
        None => violations.add("start.target", "job or run must be set"),
        Some(Target::Job(name)) => {
            violations.check("start.job", names::parse_job(name));
            if start.start_index != 0 {
                violations.add("start.start_index", format!("must be 0 for a new run, is {}", start.start_index));
            }
            let settings = start.settings.clone().unwrap_or_default();
            check_period_us(&mut violations, settings.interpolation_period_us, 0);
            enumeration::<proto::GenerationMode>(
                &mut violations,
                "start.settings.generation_mode",
                settings.generation_mode,
            );
            enumeration::<proto::Frame>(&mut violations, "start.settings.frame", settings.frame);
            if let Some(recording) = &settings.recording {
                recording_from_proto(&mut violations, "start.settings.recording", recording);
            }
        }
        Some(Target::Run(name)) => {
            violations.check("start.run", names::parse_run(name));
            if start.settings.is_some() {
                violations.add("start.settings", "must not be set for a run that is taken up: it keeps its own");
            }
        }
    }
    violations.finish()?;
    let target = start.target.as_ref().ok_or_else(|| Error::internal("a start was neither accepted nor refused"))?;
    Ok(CheckedStart { target, encoding })
}

impl Api {
    async fn start_run(&self, request: Request<Streaming<RunRequest>>) -> Result<ResponseStream<RunResponse>> {
        let deadline = deadline(request.metadata().as_ref());
        let mut messages = request.into_inner();
        let start = first_message(&mut messages).await?;
        match &start.target {
            Some(Target::Job(name)) => self.concerns(name, names::parse_job, names::job),
            Some(Target::Run(name)) => self.concerns(name, names::parse_run, names::run),
            None => {}
        }
        let CheckedStart { target, encoding } = check_start(&start)?;
        let (job, before) = match target {
            Target::Job(name) => (job_id("start.job", name)?, None),
            Target::Run(name) => {
                let run = self.live_run(name).await?;
                (run.job_id, Some(run))
            }
        };
        // Registered before the state is read, so that a cancellation in between is not missed.
        let guard = self.engine.enter(job);
        let cancelled = guard.token().clone();
        let detail = self.job_detail(job).await?;
        self.caller.concerns(names::job(job));
        self.caller.check_machine(&detail.job.machine_id)?;
        if detail.job.state != JobState::Ready {
            let subject = names::job(job);
            let message = format!("{subject} is {}, only a ready job can be run", detail.job.state);
            return Err(Error::Precondition { reason: "JOB_NOT_READY", subject, message });
        }
        let begun = match before {
            Some(run) => Begun::Before(run),
            None => Begun::New(self.new_run(&detail, start.settings.unwrap_or_default()).await?),
        };
        let config = pipeline_config(&detail, &begun.settings()?)?;
        let mut violations = Violations::default();
        let conditions = config.generation_mode == GenerationMode::ServoSide;
        let directions = config.frame == Frame::Work && config.profile.kinematics.is_some();
        let machine = &config.profile.machine;
        let columns = ColumnSet::select(&mut violations, &start.columns, machine, conditions, directions, encoding);
        violations.finish()?;
        // What is refused up to here changes nothing: no run is made, and whoever has one keeps it.
        let (attached, place) = match begun {
            Begun::New(new) => {
                let place = self.engine.run_place()?;
                (self.store.create_run(new).await?, Some(place))
            }
            Begun::Before(run) => {
                self.engine.handed_out().check(&run, start.start_index)?;
                (self.store.attach_run(run.id).await?, self.engine.run_place().ok())
            }
        };
        // Whoever had the run is told, and gives up its place.
        let presence = self.floor().taken_up(self.store.of_all_tenants(), &detail.job, &attached).await?;
        let place = self.engine.place_or_given_up(place).await?;
        let started = started(&attached, &config, &columns, encoding, start.start_index)?;
        let plan = LivePlan { config, columns, first_index: start.start_index, sensor_time_ns: start.sensor_time_ns };
        let (intake, run) = self.engine.drive(&detail, &attached, plan, guard, presence, place).await?;
        tracing::info!(run = %attached.run.id, first_index = start.start_index, "live run");
        self.engine.spawn(take_in(messages, intake));
        let started = stream::once(std::future::ready(Ok(started)));
        let mut work = Some(self.caller.work());
        let run = run.inspect(move |message| {
            if matches!(message, Ok(RunResponse { message: Some(Message::Ended(_)) }))
                && let Some(work) = work.take()
            {
                work.has_done();
            }
        });
        let guarded = Guarded::new(started.chain(run), deadline)
            .ends_with(self.engine.draining(), Error::Draining)
            .ends_when_cut_off(self.engine.cut_off())
            .ends_with(&cancelled, Error::JobCancelled { job: names::job(job) });
        Ok(Box::pin(guarded))
    }

    /// A live run.
    async fn live_run(&self, name: &str) -> Result<Run> {
        let run = self.store.run(run_id(name)?).await?;
        if run.kind != RunKind::Live {
            let message = format!("{name} takes telemetry only and has no setpoints");
            return Err(Error::Precondition { reason: "RUN_NOT_LIVE", subject: name.to_owned(), message });
        }
        Ok(run)
    }

    /// A run to be made, whose setpoints can follow its decisions.
    async fn new_run(&self, detail: &JobDetail, asked: RunSettings) -> Result<NewRun> {
        let job = detail.job.id;
        let monitoring = config_from_message(&stored::from_stored(self.store.monitoring(job).await?.get())?)?;
        let plans_spindle = self.check_monitoring(detail, &monitoring).await?;
        let recording = asked.recording.as_ref().and_then(|recording| {
            // It was accepted with the start.
            recording_from_proto(&mut Violations::default(), "start.settings.recording", recording)
        });
        check_recordable(&monitoring, "start.settings.recording", recording)?;
        let config = pipeline_config(detail, &RunSettings { plans_spindle, ..asked })?;
        let settings = RunSettings {
            interpolation_period_us: config.interpolation_period_us,
            generation_mode: generation_mode_to_proto(config.generation_mode).into(),
            frame: frame_to_proto(config.frame).into(),
            monitoring: Some(monitoring_to_proto(&monitoring)),
            plans_spindle,
            recording: recording.as_ref().map(recording_to_proto),
        };
        let monitor = Monitor::new(monitoring)
            .map_err(|violations| Error::internal(format!("a stored configuration is refused: {violations:?}")))?;
        let monitor = if plans_spindle { monitor.planning_spindle() } else { monitor };
        let monitor = monitor.snapshot().map_err(Error::internal)?.into();
        Ok(NewRun { job_id: job, kind: RunKind::Live, settings: stored::to_stored(&settings)?, monitor })
    }

    /// Refuses monitoring whose decisions setpoints cannot follow; whether changes of the spindle speed have to be planned,
    /// since what is cut depends on it.
    async fn check_monitoring(&self, detail: &JobDetail, monitoring: &MonitoringConfig) -> Result<bool> {
        let job = detail.job.id;
        let unfit = |message| {
            let subject = format!("{}/monitoring", names::job(job));
            Err(Error::Precondition { reason: "MONITORING_UNFIT", subject, message })
        };
        let upper = monitoring.rules.feed_bounds.upper;
        if upper > MAX_OVERRIDE_RATIO {
            return unfit(format!(
                "rules.feed_bounds.upper is {upper}, setpoints follow a feed override up to {MAX_OVERRIDE_RATIO}: lower it"
            ));
        }
        let lower = monitoring.rules.feed_bounds.lower;
        if lower < MIN_OVERRIDE_RATIO {
            return unfit(format!(
                "rules.feed_bounds.lower is {lower}, setpoints follow a feed override from {MIN_OVERRIDE_RATIO} on: raise it"
            ));
        }
        let judged = engine::job_config(detail)?.profile.max_feed_override;
        if upper <= judged && monitoring.rules.spindle == SpindleRule::None {
            return Ok(false);
        }
        let report: ValidationReport = stored::from_stored(self.store.report(job).await?.report.get())?;
        let judged_of = match () {
            () if upper <= judged => None,
            () if !report.sections.is_empty() => Some("whether the chip of the program's vibration breaks was"),
            () if !report.oscillations.is_empty() => Some("the conditions of the tool's oscillation were"),
            () => None,
        };
        if let Some(what) = judged_of {
            return unfit(format!(
                "rules.feed_bounds.upper is {upper}, {what} judged up to {judged}, the max_feed_override of its machine: \
                 lower it, or raise that one and validate a new job"
            ));
        }
        let depends = !report.sections.is_empty() || !report.threads.is_empty() || !report.oscillations.is_empty();
        Ok(depends && monitoring.rules.spindle != SpindleRule::None)
    }

    /// Replays a run.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn replay_run(&self, request: ReplayRunRequest) -> Result<ReplayRunResponse> {
        let id = names::parse_run(&request.run).map_err(|error| Error::invalid("run", error.to_string()))?;
        let run = self.store.run(id).await?;
        let detail = self.job_detail(run.job_id).await?;
        let config = match run.kind {
            RunKind::Live => Some(pipeline_config(&detail, &run_settings(&run)?)?),
            RunKind::Telemetry => None,
        };
        self.engine.replay(&detail, run, config, request.start_index).await
    }
}

fn run_id(name: &str) -> Result<Uuid> {
    names::parse_run(name).map_err(|error| Error::invalid("start.run", error.to_string()))
}

const fn frame_to_proto(frame: Frame) -> proto::Frame {
    match frame {
        Frame::Machine => proto::Frame::Machine,
        Frame::Work => proto::Frame::Work,
    }
}

/// The client's first message.
async fn first_message(messages: &mut Streaming<RunRequest>) -> Result<RunStart> {
    match messages.message().await {
        Ok(Some(RunRequest { message: Some(RequestMessage::Start(start)) })) => Ok(start),
        Ok(_) => Err(Error::invalid("message", "the first message must be the start")),
        Err(status) => Err(status.into()),
    }
}

fn started(
    attached: &AttachedRun,
    config: &PipelineConfig,
    columns: &ColumnSet,
    encoding: proto::Encoding,
    first_index: u64,
) -> Result<RunResponse> {
    let monitor = Monitor::restore(&attached.monitor).map_err(Error::internal)?;
    let feed_changes: Vec<_> = attached.overrides.iter().map(feed_change_to_proto).collect::<Result<_>>()?;
    let header = StreamHeader {
        period_us: f64::from(config.interpolation_period_us),
        first_index,
        setpoint_count: None,
        encoding: encoding.into(),
        frame: frame_to_proto(config.frame).into(),
        generation_mode: generation_mode_to_proto(config.generation_mode).into(),
        columns: columns.infos().to_vec(),
    };
    let started = RunStarted {
        run: names::run(attached.run.id),
        header: Some(header),
        durable_batch: attached.run.newest_batch,
        overrides: Some(overrides_to_proto(monitor.overrides())),
        state: monitor_state_to_proto(monitor.state()).into(),
        held: held(&feed_changes),
        feed_changes,
        feed_held: monitor.holds_feed(),
    };
    Ok(RunResponse { message: Some(Message::Started(started)) })
}

/// Whether the operator holds the feed: changes of the spindle speed end no hold.
fn held(changes: &[proto::RunFeedChange]) -> bool {
    let lasting = changes.iter().rev().find(|change| change.cause() != proto::FeedChangeCause::Spindle);
    lasting.is_some_and(|change| change.cause() == proto::FeedChangeCause::Hold)
}

/// Passes on what the client says until it goes away.
async fn take_in(mut messages: Streaming<RunRequest>, intake: LiveIntake) {
    loop {
        let message = tokio::select! {
            message = messages.message() => message,
            () = intake.left() => return,
        };
        let input = match message.map(|message| message.map(|RunRequest { message }| message)) {
            Ok(None) => return,
            Ok(Some(Some(RequestMessage::Batch(batch)))) => {
                LiveInput::Batch(Box::new(batch), std::time::Instant::now())
            }
            Ok(Some(Some(RequestMessage::Credit(credit)))) => LiveInput::Credit(credit.end_index),
            Ok(Some(Some(RequestMessage::Receipt(receipt)))) => LiveInput::Receipt(receipt.received),
            Ok(Some(Some(RequestMessage::Command(command)))) => LiveInput::Command(command.kind()),
            Ok(Some(Some(RequestMessage::Start(_)) | None)) => {
                LiveInput::Refused(Error::invalid("message", "must be set, and only the first one is the start"))
            }
            Err(status) => match unreadable(status) {
                Some(error) => LiveInput::Refused(error),
                None => return,
            },
        };
        if !intake.take(input).await {
            return;
        }
    }
}

#[async_trait]
impl Runs for Api {
    type RunStream = ResponseStream<RunResponse>;

    async fn run(&self, request: Request<Streaming<RunRequest>>) -> Result<Response<Self::RunStream>, Status> {
        Ok(Response::new(self.called_by(request.extensions()).start_run(request).await?))
    }

    async fn replay_run(&self, request: Request<ReplayRunRequest>) -> Result<Response<ReplayRunResponse>, Status> {
        self.answer(request, async |api, request| api.replay_run(request).await).await
    }
}
