//! `feedwave.v1.Threads`.

use tonic::{Request, Response, Status, async_trait};

use super::{Api, answer};
use crate::convert;
use crate::error::{Error, Result, Violations};
use crate::names;
use crate::proto::plan_thread_request::On;
use crate::proto::threads_server::Threads;
use crate::proto::{PlanThreadRequest, PlanThreadResponse};

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
        let plan = self.engine.plan_thread(thread).await?;
        Ok(convert::thread_plan_to_proto(&plan, &options))
    }
}

#[async_trait]
impl Threads for Api {
    async fn plan_thread(&self, request: Request<PlanThreadRequest>) -> Result<Response<PlanThreadResponse>, Status> {
        answer(request, async |request| self.plan_thread(request).await).await
    }
}
