//! `feedwave.v1.Setpoints`.

use feedwave_contract::convert::{
    enumeration, generation_mode_from_proto, generation_mode_to_proto, overrides_from_proto,
};
use feedwave_contract::proto::setpoints_server::Setpoints;
use feedwave_contract::proto::stream_setpoints_request::Start;
use feedwave_contract::proto::stream_setpoints_response::Message;
use feedwave_contract::proto::{
    AxisLimitUse, GetPlanSummaryRequest, GetPlanSummaryResponse, PlanSummary, ProgramSummary, StreamHeader,
    StreamSetpointsRequest, StreamSetpointsResponse,
};
use feedwave_contract::{names, proto};
use feedwave_cutting::{Frame, GenerationMode, PipelineConfig};
use feedwave_store::{JobDetail, JobState};
use futures_util::{StreamExt as _, stream};
use tonic::{Request, Response, Status, async_trait};

use super::Api;
use super::guarded::{Guarded, deadline};
use super::jobs::{ResponseStream, job_id};
use super::settings::check_period_us;
use crate::engine::{self, ColumnSet, MAX_CHUNK_SIZE, StreamPlan, StreamStart};
use crate::error::{Error, Result, Violations};
use crate::stored;

/// What a request asks for, checked against the job.
struct Checked {
    plan: StreamPlan,
    header: StreamHeader,
}

/// Fields that can be judged without the job.
struct CheckedFields {
    start: StreamStart,
    encoding: proto::Encoding,
    frame: Frame,
    generation_mode: Option<GenerationMode>,
    servo_output: proto::ServoOutput,
}

fn check_fields(violations: &mut Violations, request: &StreamSetpointsRequest) -> CheckedFields {
    let start = match request.start {
        None => StreamStart::Index(0),
        Some(Start::StartIndex(index)) => StreamStart::Index(index),
        Some(Start::StartTimeS(time_s)) => {
            if !(time_s.is_finite() && time_s >= 0.0) {
                violations.add("start_time_s", format!("must be a finite number, not negative, is {time_s}"));
            }
            StreamStart::Time(time_s)
        }
    };
    let encoding = match enumeration(violations, "encoding", request.encoding) {
        Some(encoding @ (proto::Encoding::FixedPointDelta | proto::Encoding::RawDouble)) => encoding,
        _ => proto::Encoding::PackedDouble,
    };
    let frame = match enumeration(violations, "frame", request.frame) {
        Some(proto::Frame::Work) => Frame::Work,
        _ => Frame::Machine,
    };
    if request.chunk_size > MAX_CHUNK_SIZE {
        violations.add("chunk_size", format!("must be at most {MAX_CHUNK_SIZE}, is {}", request.chunk_size));
    }
    let generation_mode = enumeration(violations, "generation_mode", request.generation_mode);
    let servo_output = enumeration(violations, "servo_output", request.servo_output);
    CheckedFields {
        start,
        encoding,
        frame,
        generation_mode: generation_mode.and_then(generation_mode_from_proto),
        servo_output: servo_output.unwrap_or_default(),
    }
}

/// Everything that the stream needs, from the request and the job.
fn check(request: &StreamSetpointsRequest, detail: &JobDetail) -> Result<Checked> {
    let own = engine::job_config(detail)?;
    let mut violations = Violations::default();
    let fields = check_fields(&mut violations, request);
    let period_us = check_period_us(&mut violations, request.interpolation_period_us, own.interpolation_period_us);
    let overrides = overrides_from_proto(&mut violations, "overrides", &request.overrides, period_us);
    let config = PipelineConfig {
        overrides,
        interpolation_period_us: period_us,
        generation_mode: fields.generation_mode.unwrap_or(own.generation_mode),
        frame: fields.frame,
        ..own.clone()
    };
    let servo_side = config.generation_mode == GenerationMode::ServoSide;
    let expanded = servo_side && fields.servo_output == proto::ServoOutput::Expanded;
    let expand = expanded.then_some(config.profile.vibration.servo_substeps);
    let machine = &config.profile.machine;
    let conditions = servo_side && !expanded;
    let directions = config.frame == Frame::Work && config.profile.kinematics.is_some() && !expanded;
    let columns =
        ColumnSet::select(&mut violations, &request.columns, machine, conditions, directions, fields.encoding);
    violations.finish()?;

    let is_own_plan = config.interpolation_period_us == own.interpolation_period_us
        && config.generation_mode == own.generation_mode
        && config.overrides.is_empty();
    let setpoint_count = if is_own_plan {
        let summary = plan_summary(detail)?;
        // The first setpoint has no servo periods before it.
        let periods = summary.setpoint_count.saturating_sub(1);
        Some(expand.map_or(summary.setpoint_count, |substeps| periods * u64::from(substeps) + 1))
    } else {
        None
    };
    let setpoint_period_us = f64::from(period_us) / f64::from(expand.unwrap_or(1));
    let first_index = fields.start.index(setpoint_period_us);
    if let Some(count) = setpoint_count.filter(|count| first_index > *count) {
        return Err(engine::beyond_end(first_index, count));
    }
    let header = StreamHeader {
        period_us: setpoint_period_us,
        first_index,
        setpoint_count,
        encoding: fields.encoding.into(),
        frame: match fields.frame {
            Frame::Machine => proto::Frame::Machine,
            Frame::Work => proto::Frame::Work,
        }
        .into(),
        generation_mode: generation_mode_to_proto(config.generation_mode).into(),
        columns: columns.infos().to_vec(),
    };
    let chunk_size = columns.chunk_size(request.chunk_size);
    Ok(Checked { plan: StreamPlan { config, columns, chunk_size, expand, first_index }, header })
}

/// Summary of a validated job.
fn plan_summary(detail: &JobDetail) -> Result<ProgramSummary> {
    match &detail.job.summary {
        Some(summary) => stored::from_stored(summary.get()),
        None => {
            let subject = names::job(detail.job.id);
            let message = format!("{subject} is {} and has no plan", detail.job.state);
            Err(Error::Precondition { reason: "JOB_NOT_VALIDATED", subject, message })
        }
    }
}

impl Api {
    /// Times, counts, extents and peaks of a job's plan.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn get_plan_summary(&self, request: GetPlanSummaryRequest) -> Result<GetPlanSummaryResponse> {
        let detail = self.store.job_detail(job_id("job", &request.job)?).await?;
        let summary = plan_summary(&detail)?;
        let axes = engine::job_config(&detail)?.profile.machine.axes;
        let limit_use = |axis: &feedwave_motion::MachineAxis| {
            let reached = summary.axes.iter().find(|reached| reached.name == axis.name)?;
            Some(AxisLimitUse {
                axis: axis.name.clone(),
                velocity_share: reached.peak_velocity_per_s / axis.max_velocity_per_s,
                acceleration_share: reached.peak_acceleration_per_s2 / axis.max_acceleration_per_s2,
                jerk_share: reached.peak_jerk_per_s3 / axis.max_jerk_per_s3,
            })
        };
        let limit_use = axes.iter().filter_map(limit_use).collect();
        let job = names::job(detail.job.id);
        Ok(GetPlanSummaryResponse { plan_summary: Some(PlanSummary { job, summary: Some(summary), limit_use }) })
    }

    async fn start_stream(
        &self,
        request: Request<StreamSetpointsRequest>,
    ) -> Result<ResponseStream<StreamSetpointsResponse>> {
        let deadline = deadline(request.metadata().as_ref());
        let request = request.into_inner();
        let id = job_id("job", &request.job)?;
        // Registered before the state is read, so that a cancellation in between is not missed.
        let guard = self.engine.enter(id);
        let cancelled = guard.token().clone();
        let detail = self.store.job_detail(id).await?;
        let job = names::job(id);
        if detail.job.state != JobState::Ready {
            let message = format!("{job} is {}, only a ready job can be streamed", detail.job.state);
            return Err(Error::Precondition { reason: "JOB_NOT_READY", subject: job, message });
        }
        let Checked { plan, header } = check(&request, &detail)?;
        tracing::info!(%job, first_index = plan.first_index, "stream");
        let setpoints = self.metrics.setpoints.clone();
        let chunks = self.engine.generate(&detail, guard, plan, deadline).await?.map(move |chunk| {
            let chunk = chunk?;
            setpoints.inc_by(u64::from(chunk.count));
            Ok(StreamSetpointsResponse { message: Some(Message::Chunk(chunk)) })
        });
        let header = StreamSetpointsResponse { message: Some(Message::Header(header)) };
        let messages = stream::once(std::future::ready(Ok(header))).chain(chunks);
        let guarded = Guarded::new(messages, deadline)
            .ends_with(self.engine.draining(), Error::Draining)
            .ends_with(&cancelled, Error::JobCancelled { job });
        Ok(Box::pin(guarded))
    }
}

#[async_trait]
impl Setpoints for Api {
    type StreamSetpointsStream = ResponseStream<StreamSetpointsResponse>;

    async fn stream_setpoints(
        &self,
        request: Request<StreamSetpointsRequest>,
    ) -> Result<Response<Self::StreamSetpointsStream>, Status> {
        Ok(Response::new(self.called_by(request.extensions()).start_stream(request).await?))
    }

    async fn get_plan_summary(
        &self,
        request: Request<GetPlanSummaryRequest>,
    ) -> Result<Response<GetPlanSummaryResponse>, Status> {
        self.answer(request, async |api, request| api.get_plan_summary(request).await).await
    }
}
