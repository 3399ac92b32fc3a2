//! `feedwave.v1.Threads`.

use feedwave_contract::convert;
use feedwave_contract::names;
use feedwave_contract::proto;
use feedwave_contract::proto::follow_spindle_request::Message as RequestMessage;
use feedwave_contract::proto::follow_spindle_response::Message;
use feedwave_contract::proto::plan_thread_request::On;
use feedwave_contract::proto::threads_server::Threads;
use feedwave_contract::proto::{
    FollowSpindleRequest, FollowSpindleResponse, FollowSpindleStart, FollowedPass, FollowedPositions,
    PlanThreadRequest, PlanThreadResponse, SpindleAngleKind, SpindleAngles, SpindleEventKind, ValidationReport,
};
use feedwave_cutting::thread::{KeptPass, SpindleEvent, SpindleWatch, ThreadFollower, plan_thread};
use feedwave_store::JobState;
use futures_util::{StreamExt as _, stream};
use tonic::{Request, Response, Status, Streaming, async_trait};

use super::Api;
use super::guarded::{Guarded, deadline};
use super::jobs::{ResponseStream, job_id};
use crate::engine;
use crate::error::{Error, Result, Violations};
use crate::stored;

/// Angles of one batch.
const MAX_ANGLES: usize = 65_536;

impl Api {
    /// Plans the passes of a thread.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn plan_thread(&self, request: PlanThreadRequest) -> Result<PlanThreadResponse> {
        let mut violations = Violations::default();
        let (field, profile) = match &request.on {
            Some(On::Machine(name)) => match violations.check("machine", names::parse_machine(name)) {
                Some(id) => ("machine", self.machine_profile(id).await.map(|(profile, _)| Some(profile))),
                None => ("machine", Ok(None)),
            },
            Some(On::Profile(given)) => {
                ("profile.machine", Ok(convert::profile_from_proto(&mut violations, "profile", given)))
            }
            None => {
                violations.add("on", "machine or profile must be set");
                ("on", Ok(None))
            }
        };
        // What is wrong with the request itself is said first, whatever became of the machine.
        let known = profile.as_ref().ok().and_then(Option::as_ref);
        let planned = convert::thread_request_from_proto(&mut violations, &request, field, known);
        violations.finish()?;
        profile?;
        let (thread, options) = planned.ok_or_else(|| Error::internal("a request was neither accepted nor refused"))?;
        let plan = self.engine.compute(move || plan_thread(&thread)).await?;
        Ok(convert::thread_plan_to_proto(&plan, &options))
    }
}

/// A pass that is being followed.
struct Following {
    follower: ThreadFollower,
    watch: SpindleWatch,
    kind: SpindleAngleKind,
    /// Time of the last angle, ns.
    last_ns: Option<u64>,
    /// Positions given.
    given: u64,
}

impl Following {
    /// The positions of one batch.
    fn positions(&mut self, SpindleAngles { angles_deg, time_ns }: &SpindleAngles) -> Result<FollowedPositions> {
        if !(1..=MAX_ANGLES).contains(&angles_deg.len()) {
            let description = format!("must list 1 to {MAX_ANGLES} angles, lists {}", angles_deg.len());
            return Err(Error::invalid("angles.angles_deg", description));
        }
        self.check_times(angles_deg.len(), time_ns)?;
        let mut positions = FollowedPositions { first_index: self.given, ..FollowedPositions::default() };
        for column in
            [&mut positions.x_mm, &mut positions.z_mm, &mut positions.path_position_mm, &mut positions.retreat_mm]
        {
            column.reserve_exact(angles_deg.len());
        }
        for (index, &angle_deg) in angles_deg.iter().enumerate() {
            let place = match self.kind {
                SpindleAngleKind::Unwrapped => self.follower.unwrapped(angle_deg),
                SpindleAngleKind::Encoder | SpindleAngleKind::Unspecified => self.follower.encoder(angle_deg),
            };
            let place = place.map_err(|error| {
                Error::invalid(format!("angles.angles_deg[{index}]"), format!("{error}: {angle_deg}"))
            })?;
            let time_s = time_ns.get(index).map(|ns| *ns as f64 * 1e-9);
            let angle_deg = self.follower.angle_deg().unwrap_or_default();
            if let Some(event) = self.watch.observe(self.follower.path(), angle_deg, time_s) {
                positions.events.push(event_to_proto(self.given + index as u64, event));
            }
            positions.x_mm.push(place.radius_mm);
            positions.z_mm.push(place.z_mm);
            positions.path_position_mm.push(place.path_mm);
            positions.retreat_mm.push(place.retreat_mm);
        }
        self.given += angles_deg.len() as u64;
        positions.over = self.follower.is_over();
        Ok(positions)
    }

    /// Whether times are there for all angles or none, and rise.
    fn check_times(&mut self, angles: usize, time_ns: &[u64]) -> Result<()> {
        if !time_ns.is_empty() && time_ns.len() != angles {
            let description = format!("has {} values, angles_deg {angles}: one for each, or none", time_ns.len());
            return Err(Error::invalid("angles.time_ns", description));
        }
        for (index, &ns) in time_ns.iter().enumerate() {
            if self.last_ns.replace(ns).is_some_and(|last_ns| last_ns >= ns) {
                return Err(Error::invalid(format!("angles.time_ns[{index}]"), format!("must rise, is {ns}")));
            }
        }
        Ok(())
    }
}

/// What the spindle does, as the contract has it.
fn event_to_proto(index: u64, event: SpindleEvent) -> proto::SpindleEvent {
    let plain = |kind: SpindleEventKind| proto::SpindleEvent { index, kind: kind.into(), ..Default::default() };
    match event {
        SpindleEvent::Reversed { back_deg } => proto::SpindleEvent { back_deg, ..plain(SpindleEventKind::Reversed) },
        SpindleEvent::Stopped => plain(SpindleEventKind::Stopped),
        SpindleEvent::TooFast { rev_per_min, limit_rev_per_min } => proto::SpindleEvent {
            spindle_rev_per_min: rev_per_min,
            limit_rev_per_min,
            ..plain(SpindleEventKind::TooFast)
        },
        SpindleEvent::Regular => plain(SpindleEventKind::Regular),
    }
}

/// The next batch of a client; `None` when it has ended the call.
async fn next_angles(messages: &mut Streaming<FollowSpindleRequest>) -> Result<Option<SpindleAngles>> {
    match messages.message().await {
        Ok(None) => Ok(None),
        Ok(Some(FollowSpindleRequest { message: Some(RequestMessage::Angles(angles)) })) => Ok(Some(angles)),
        Ok(Some(_)) => Err(Error::invalid("message", "after the start every message must carry angles")),
        Err(status) => Err(status.into()),
    }
}

impl Api {
    /// The pass that a client wants to follow, as it is described to the client.
    async fn follow(&self, start: &FollowSpindleStart, id: uuid::Uuid) -> Result<(Following, FollowedPass)> {
        let mut violations = Violations::default();
        let kind = convert::enumeration(&mut violations, "start.angle_kind", start.angle_kind);
        if let Some(angle_deg) = start.reference_angle_deg.filter(|angle_deg| !angle_deg.is_finite()) {
            violations.add("start.reference_angle_deg", format!("must be a finite number, is {angle_deg}"));
        }
        violations.finish()?;
        let detail = self.job_detail(id).await?;
        if detail.job.state != JobState::Ready {
            let subject = names::job(id);
            let message = format!("{subject} is {}, only a ready job can be followed", detail.job.state);
            return Err(Error::Precondition { reason: "JOB_NOT_READY", subject, message });
        }
        let report: ValidationReport = stored::from_stored(self.store.report(id).await?.report.get())?;
        let thread = report.threads.get(start.thread as usize).and_then(|section| section.thread.as_ref());
        let thread = thread.ok_or_else(|| beyond("start.thread", start.thread, report.threads.len()))?;
        let thread = convert::thread_from_proto(thread);
        let pass = thread.passes.get(start.pass as usize);
        let pass = pass.ok_or_else(|| beyond("start.pass", start.pass, thread.passes.len()))?;
        // As it is planned, chamfers and parts included, which the thread of the report does not have.
        let KeptPass { path, in_plane } = self.engine.thread_pass(&detail, start.thread, start.pass).await?;
        if in_plane {
            let subject = names::job(id);
            let message = format!(
                "the pass in line {} is in a tilted plane: several axes make its X and Z, and this call gives positions of X and Z \
                 only; take its setpoints, which have every axis",
                pass.span.line
            );
            return Err(Error::Precondition { reason: "THREAD_IN_PLANE", subject, message });
        }
        let profile = engine::job_config(&detail)?.profile;
        let default_deg = profile.thread_vibration.reference_angle_deg;
        let reference_angle_deg = start.reference_angle_deg.unwrap_or(default_deg);
        let followed = FollowedPass {
            line: pass.span.line,
            rotation: convert::rotation_to_proto(thread.geometry.rotation).into(),
            reference_angle_deg,
            lead_start_deg: path.lead_start_deg(),
            lead_end_deg: path.lead_end_deg(),
            rest_deg: path.rest_deg(),
            programmed_rev_per_min: thread.spindle_rev_per_min,
        };
        let watch = SpindleWatch::new(&profile.machine);
        let follower = ThreadFollower::new(path, thread.geometry.rotation, reference_angle_deg);
        let following = Following { follower, watch, kind: kind.unwrap_or_default(), last_ns: None, given: 0 };
        Ok((following, followed))
    }

    async fn start_following(
        &self,
        request: Request<Streaming<FollowSpindleRequest>>,
    ) -> Result<ResponseStream<FollowSpindleResponse>> {
        let deadline = deadline(request.metadata().as_ref());
        let mut messages = request.into_inner();
        let start = match messages.message().await {
            Ok(Some(FollowSpindleRequest { message: Some(RequestMessage::Start(start)) })) => start,
            Ok(_) => return Err(Error::invalid("message", "the first message must be the start")),
            Err(status) => return Err(status.into()),
        };
        let id = job_id("start.job", &start.job)?;
        // Registered before the state is read, so that a cancellation in between is not missed.
        let guard = self.engine.enter(id);
        let cancelled = guard.token().clone();
        self.caller.concerns(names::job(id));
        self.caller.check_machine(&self.store.job(id).await?.machine_id)?;
        let (following, followed) = self.follow(&start, id).await?;
        tracing::info!(job = %names::job(id), thread = start.thread, pass = start.pass, "follow the spindle");
        let first = FollowSpindleResponse { message: Some(Message::FollowedPass(followed)) };
        // A batch is read when the answer to the one before has been taken: a slow reader slows its sender.
        let answers = stream::try_unfold((messages, following, guard), async |(mut messages, mut following, guard)| {
            let Some(angles) = next_angles(&mut messages).await? else { return Ok(None) };
            let positions = Message::Positions(following.positions(&angles)?);
            Ok(Some((FollowSpindleResponse { message: Some(positions) }, (messages, following, guard))))
        });
        let answers = stream::once(std::future::ready(Ok(first))).chain(answers);
        let guarded = Guarded::new(Box::pin(answers), deadline)
            .ends_with(self.engine.draining(), Error::Draining)
            .ends_with(&cancelled, Error::JobCancelled { job: names::job(id) });
        Ok(Box::pin(guarded))
    }
}

fn beyond(field: &str, index: u32, count: usize) -> Error {
    Error::invalid(field, format!("counts from 0: there are {count} in the report, asked for is {index}"))
}

#[async_trait]
impl Threads for Api {
    type FollowSpindleStream = ResponseStream<FollowSpindleResponse>;

    async fn follow_spindle(
        &self,
        request: Request<Streaming<FollowSpindleRequest>>,
    ) -> Result<Response<Self::FollowSpindleStream>, Status> {
        Ok(Response::new(self.called_by(request.extensions()).start_following(request).await?))
    }

    async fn plan_thread(&self, request: Request<PlanThreadRequest>) -> Result<Response<PlanThreadResponse>, Status> {
        self.answer(request, async |api, request| api.plan_thread(request).await).await
    }
}
