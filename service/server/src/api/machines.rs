//! `feedwave.v1.Machines`.

use feedwave_contract::convert::{self, timestamp};
use feedwave_contract::names;
use feedwave_contract::proto::machines_server::Machines;
use feedwave_contract::proto::{
    CreateMachineRequest, CreateMachineResponse, DeleteMachineRequest, DeleteMachineResponse, GetMachineRequest,
    GetMachineResponse, GetStateRequest, GetStateResponse, ListMachinesRequest, ListMachinesResponse,
    ListStatesRequest, ListStatesResponse, Machine, UpdateMachineRequest, UpdateMachineResponse, WatchStateRequest,
    WatchStateResponse,
};
use feedwave_cutting::MachineProfile;
use feedwave_store::{Json, MachineRecord};
use tonic::{Request, Response, Status, async_trait};

use super::guarded::{Guarded, deadline};
use super::jobs::ResponseStream;
use super::{Api, etag, mask, page_request};
use crate::error::{Error, Result, Violations};
use crate::stored;

/// The document that the store keeps of a machine.
pub(super) fn to_document(display_name: &str, profile: &MachineProfile) -> Result<Json> {
    stored::to_stored(&Machine {
        display_name: display_name.to_owned(),
        profile: Some(convert::profile_to_proto(profile)),
        ..Default::default()
    })
}

fn from_record(record: &MachineRecord) -> Result<Machine> {
    Ok(Machine {
        name: names::machine(&record.id),
        etag: record.etag.clone(),
        create_time: Some(timestamp(record.created_us)),
        update_time: Some(timestamp(record.updated_us)),
        ..stored::from_stored(record.body.get())?
    })
}

/// What a client says about a machine, checked.
fn check(violations: &mut Violations, machine: &Machine) -> Option<MachineProfile> {
    convert::check_display_name(violations, "machine.display_name", &machine.display_name);
    match &machine.profile {
        Some(profile) => convert::profile_from_proto(violations, "machine.profile", profile),
        None => {
            violations.add("machine.profile", "must be set");
            None
        }
    }
}

/// The document of a machine that a client sends.
fn checked_document(mut violations: Violations, machine: &Machine) -> Result<Json> {
    let profile = check(&mut violations, machine);
    violations.finish()?;
    let profile = profile.ok_or_else(|| Error::internal("a profile was neither accepted nor refused"))?;
    to_document(&machine.display_name, &profile)
}

impl Api {
    /// Adds a machine.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn create_machine(&self, request: CreateMachineRequest) -> Result<CreateMachineResponse> {
        self.concerns(&request.machine_id, names::check_id, names::machine);
        let mut violations = Violations::default();
        violations.check("machine_id", names::check_id(&request.machine_id));
        let document = checked_document(violations, &request.machine.unwrap_or_default())?;
        let record = self.store.create_machine(Some(&request.machine_id), document).await?;
        let machine = from_record(&record)?;
        self.floors.put_machine(&record.id, &record.etag, &machine.display_name);
        // There may be runs of an earlier one of this name.
        if let Err(error) = self.floors.recall(self.store.of_all_tenants(), |id| id == record.id).await {
            tracing::warn!(%error, machine = record.id, "what an earlier machine of this name did is not shown");
        }
        Ok(CreateMachineResponse { machine: Some(machine) })
    }

    /// Reads a machine.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn get_machine(&self, request: GetMachineRequest) -> Result<GetMachineResponse> {
        let id = names::parse_machine(&request.name).map_err(|error| Error::invalid("name", error.to_string()))?;
        Ok(GetMachineResponse { machine: Some(from_record(&self.store.machine(id).await?)?) })
    }

    /// Lists machines.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn list_machines(&self, request: ListMachinesRequest) -> Result<ListMachinesResponse> {
        let mut violations = Violations::default();
        let page = page_request(&mut violations, request.page_size, request.page_token);
        violations.finish()?;
        let page = self.store.list_machines(&page).await?;
        Ok(ListMachinesResponse {
            machines: page.items.iter().map(from_record).collect::<Result<_>>()?,
            next_page_token: page.next_token.unwrap_or_default(),
            unreachable: page.unreachable.iter().map(|id| names::machine(id)).collect(),
        })
    }

    /// Replaces a machine or some of its fields.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn update_machine(&self, request: UpdateMachineRequest) -> Result<UpdateMachineResponse> {
        let given = request.machine.unwrap_or_default();
        self.concerns(&given.name, names::parse_machine, names::machine);
        let id =
            names::parse_machine(&given.name).map_err(|error| Error::invalid("machine.name", error.to_string()))?;
        // What is replaced as a whole may be damaged.
        let record = match mask::replaces_everything(request.update_mask.as_ref()) {
            true => None,
            false => Some(self.store.machine(id).await?),
        };
        let stored = record.as_ref().map_or_else(|| Ok(Machine::default()), from_record)?;
        let updated = mask::apply(&stored, &given, request.update_mask.as_ref())?;
        let document = checked_document(Violations::default(), &updated)?;
        // What is kept was just read: it must not have changed since.
        let expected = etag(&given.etag).or_else(|| record.as_ref().map(|record| record.etag.as_str()));
        let record = self.store.update_machine(id, expected, document).await?;
        let machine = from_record(&record)?;
        self.floors.put_machine(&record.id, &record.etag, &machine.display_name);
        Ok(UpdateMachineResponse { machine: Some(machine) })
    }

    /// Removes a machine.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn delete_machine(&self, request: DeleteMachineRequest) -> Result<DeleteMachineResponse> {
        self.concerns(&request.name, names::parse_machine, names::machine);
        let id = names::parse_machine(&request.name).map_err(|error| Error::invalid("name", error.to_string()))?;
        self.store.delete_machine(id, etag(&request.etag)).await?;
        self.floors.remove_machine(id);
        Ok(DeleteMachineResponse {})
    }
}

#[async_trait]
impl Machines for Api {
    async fn create_machine(
        &self,
        request: Request<CreateMachineRequest>,
    ) -> Result<Response<CreateMachineResponse>, Status> {
        self.answer(request, async |api, request| api.create_machine(request).await).await
    }

    async fn get_machine(&self, request: Request<GetMachineRequest>) -> Result<Response<GetMachineResponse>, Status> {
        self.answer(request, async |api, request| api.get_machine(request).await).await
    }

    async fn list_machines(
        &self,
        request: Request<ListMachinesRequest>,
    ) -> Result<Response<ListMachinesResponse>, Status> {
        self.answer(request, async |api, request| api.list_machines(request).await).await
    }

    async fn update_machine(
        &self,
        request: Request<UpdateMachineRequest>,
    ) -> Result<Response<UpdateMachineResponse>, Status> {
        self.answer(request, async |api, request| api.update_machine(request).await).await
    }

    async fn delete_machine(
        &self,
        request: Request<DeleteMachineRequest>,
    ) -> Result<Response<DeleteMachineResponse>, Status> {
        self.answer(request, async |api, request| api.delete_machine(request).await).await
    }

    async fn get_state(&self, request: Request<GetStateRequest>) -> Result<Response<GetStateResponse>, Status> {
        self.answer(request, async |api, request| api.get_machine_state(&request)).await
    }

    async fn list_states(&self, request: Request<ListStatesRequest>) -> Result<Response<ListStatesResponse>, Status> {
        self.answer(request, async |api, request| api.list_states(request)).await
    }

    type WatchStateStream = ResponseStream<WatchStateResponse>;

    async fn watch_state(
        &self,
        request: Request<WatchStateRequest>,
    ) -> Result<Response<Self::WatchStateStream>, Status> {
        let deadline = deadline(request.metadata().as_ref());
        let api = self.called_by(request.extensions());
        let states = Box::pin(api.watch_states(&request.into_inner())?);
        let guarded = Guarded::new(states, deadline)
            .ends_with(self.engine.draining(), Error::Draining)
            .ends_when_cut_off(self.engine.cut_off());
        Ok(Response::new(Box::pin(guarded)))
    }
}
