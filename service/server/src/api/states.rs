//! What machines do now: read, listed, watched.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use feedwave_contract::names;
use feedwave_contract::proto::{
    GetStateRequest, GetStateResponse, ListStatesRequest, ListStatesResponse, MachineState, WatchStateRequest,
    WatchStateResponse,
};
use feedwave_store::{Page, Scope, StoreError};
use futures_util::{Stream, stream};

use super::{Api, page_request};
use crate::error::{Error, Result, Violations};
use crate::floor::{FloorReader, Shown};

/// Least time between two states of a machine that who watches is given.
const PACE: Duration = Duration::from_millis(50);

fn unknown(id: &str) -> Error {
    Error::NotFound { kind: "machine".to_owned(), name: names::machine(id) }
}

impl Api {
    /// Reads what a machine does now.
    ///
    /// # Errors
    /// As the contract says.
    pub fn get_machine_state(&self, request: &GetStateRequest) -> Result<GetStateResponse> {
        Ok(GetStateResponse { state: Some(self.shown(&request.name)?.state.clone()) })
    }

    /// What a machine does now, with the texts that all readers share.
    pub(crate) fn shown(&self, name: &str) -> Result<Arc<Shown>> {
        let id = names::parse_machine(name).map_err(|error| Error::invalid("name", error.to_string()))?;
        self.floor().state(id).ok_or_else(|| unknown(id))
    }

    /// Lists what machines do now.
    ///
    /// # Errors
    /// As the contract says.
    pub fn list_states(&self, request: ListStatesRequest) -> Result<ListStatesResponse> {
        let page = self.list_shown(request)?;
        Ok(ListStatesResponse {
            states: page.items.iter().map(|shown| shown.state.clone()).collect(),
            next_page_token: page.next_token.unwrap_or_default(),
        })
    }

    /// A page of what machines do now, with the texts that all readers share.
    pub(crate) fn list_shown(&self, request: ListStatesRequest) -> Result<Page<Arc<Shown>>> {
        let mut violations = Violations::default();
        let page = page_request(&mut violations, request.page_size, request.page_token);
        violations.finish()?;
        let scope = Scope::of([b"states".as_slice()]);
        let after = match scope.position(&page.token)? {
            Some(position) => Some(String::from_utf8(position).map_err(|_| StoreError::InvalidPageToken)?),
            None => None,
        };
        let size = page.bounded_size();
        let states = self.floor().states(after.as_deref(), size + 1);
        Ok(Page::cut(states, size, |last| scope.token(last.machine_id().as_bytes())))
    }

    /// States of machines as they change, without end.
    ///
    /// # Errors
    /// As the contract says.
    pub fn watch_states(
        &self,
        request: &WatchStateRequest,
    ) -> Result<impl Stream<Item = Result<WatchStateResponse>> + Send + use<>> {
        let machine = if request.name.is_empty() {
            None
        } else {
            let id = names::parse_machine(&request.name).map_err(|error| Error::invalid("name", error.to_string()))?;
            self.floor().state(id).ok_or_else(|| unknown(id))?;
            Some(id.to_owned())
        };
        let watch = StateWatch { reader: self.floor().reader(machine).every(PACE), read: VecDeque::new() };
        Ok(stream::unfold(watch, async |mut watch| watch.next().await.map(|response| (Ok(response), watch))))
    }
}

/// Reads states as they come.
struct StateWatch {
    reader: FloorReader,
    read: VecDeque<WatchStateResponse>,
}

impl StateWatch {
    async fn next(&mut self) -> Option<WatchStateResponse> {
        loop {
            if let Some(response) = self.read.pop_front() {
                return Some(response);
            }
            let changes = self.reader.next().await?;
            let states = changes.states.iter().map(|shown| (shown.state.clone(), false));
            let gone = changes
                .gone
                .iter()
                .map(|id| (MachineState { machine: names::machine(id), ..MachineState::default() }, true));
            let responses = states.chain(gone);
            self.read.extend(responses.map(|(state, deleted)| WatchStateResponse { state: Some(state), deleted }));
        }
    }
}
