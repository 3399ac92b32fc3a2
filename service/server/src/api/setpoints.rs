//! `feedwave.v1.Setpoints`.

use feedwave_contract::names;
use feedwave_contract::proto::setpoints_server::Setpoints;
use feedwave_contract::proto::stream_setpoints_response::Message;
use feedwave_contract::proto::{
    AxisLimitUse, GetPlanSummaryRequest, GetPlanSummaryResponse, PlanSummary, ProgramSummary, StreamHeader,
    StreamSetpointsRequest, StreamSetpointsResponse,
};
use feedwave_contract::stream::StreamPlan;
use feedwave_store::{JobDetail, JobState};
use futures_util::{StreamExt as _, stream};
use tonic::{Request, Response, Status, async_trait};

use super::Api;
use super::guarded::{Guarded, deadline};
use super::jobs::{ResponseStream, job_id};
use crate::engine;
use crate::error::{Error, Result, Violations};
use crate::stored;

/// What a request asks for, checked against the job.
struct Checked {
    plan: StreamPlan,
    header: StreamHeader,
}

/// Everything that the stream needs, from the request and the job.
fn check(request: &StreamSetpointsRequest, detail: &JobDetail) -> Result<Checked> {
    let own = engine::job_config(detail)?;
    let mut violations = Violations::default();
    let plan = StreamPlan::check(&mut violations, request, &own);
    violations.finish()?;
    let setpoint_count = match plan.is_own {
        true => Some(plan.setpoint_count(plan_summary(detail)?.setpoint_count)),
        false => None,
    };
    if let Some(count) = setpoint_count.filter(|count| plan.first_index > *count) {
        return Err(engine::beyond_end(plan.first_index, count));
    }
    let header = plan.header(setpoint_count);
    Ok(Checked { plan, header })
}

/// Summary of a validated job.
fn plan_summary(detail: &JobDetail) -> Result<ProgramSummary> {
    match &detail.job.summary {
        Some(summary) => stored::from_stored(summary.get()),
        // Both are written with the state.
        None if detail.job.findings.is_some() || detail.job.state == JobState::Ready => {
            Err(Error::Damaged("the summary of its report cannot be read".into()))
        }
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
        let detail = self.job_detail(job_id("job", &request.job)?).await?;
        let summary = self.marked(detail.job.id, plan_summary(&detail)).await?;
        let axes = engine::job_config(&detail)?.profile.machine.axes;
        let limit_use = |axis: &feedwave_motion::MachineAxis| {
            let reached = summary.axes.iter().find(|reached| reached.axis == axis.name)?;
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
        let detail = self.job_detail(id).await?;
        let job = names::job(id);
        if detail.job.state != JobState::Ready {
            let message = format!("{job} is {}, only a ready job can be streamed", detail.job.state);
            return Err(Error::Precondition { reason: "JOB_NOT_READY", subject: job, message });
        }
        let Checked { plan, header } = self.marked(id, check(&request, &detail)).await?;
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
