//! The gRPC services. Each method is an ordinary function on [`Api`] over the contract's messages; the HTTP port
//! uses the same ones.

mod audit;
mod decisions;
mod events;
mod guarded;
mod jobs;
mod learning;
mod lobes;
mod log;
mod machines;
mod mask;
mod programs;
mod runs;
mod setpoints;
mod settings;
mod states;
mod telemetry;
mod threads;
mod tools;

use std::sync::Arc;

use feedwave_store::{Page, PageRequest, Scope, Store, StoreError};
use tonic::{Request, Response, Status};

pub(crate) use decisions::DecisionLog;
pub(crate) use events::EventLog;
pub(crate) use guarded::deadline;
pub(crate) use jobs::state_to_proto;
pub(crate) use log::{Entry as LogEntry, LogFilter, LogWatch, Recent};

use crate::access::Caller;
use crate::config::Limits;
use crate::engine::Engine;
use crate::error::{Error, Result, Violations};
use crate::floor::{Floor, Floors};
use crate::observability::metrics::Metrics;
use crate::records::Records;

/// What the services work with. Cloning is cheap.
#[derive(Clone)]
pub struct Api {
    pub(crate) store: Records,
    pub(crate) engine: Engine,
    pub(crate) metrics: Arc<Metrics>,
    pub(crate) limits: Limits,
    pub(crate) recent_events: Arc<Recent<EventLog>>,
    pub(crate) recent_decisions: Arc<Recent<DecisionLog>>,
    pub(crate) floors: Floors,
    /// Who is answered.
    pub(crate) caller: Caller,
}

impl std::fmt::Debug for Api {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Api").field("limits", &self.limits).finish_non_exhaustive()
    }
}

impl Api {
    /// Services over a store and an engine.
    #[must_use]
    pub fn new(store: Store, engine: Engine, metrics: Arc<Metrics>, limits: Limits) -> Self {
        let recent_events = Arc::new(Recent::new(&store, metrics.unreadable_records.clone()));
        let recent_decisions = Arc::new(Recent::new(&store, metrics.unreadable_records.clone()));
        let caller = Caller::service();
        let floors = Floors::default();
        let store = Records::new(store, caller.clone());
        Self { store, engine, metrics, limits, recent_events, recent_decisions, floors, caller }
    }

    /// What machines do, as the caller sees it.
    pub(crate) fn floor(&self) -> Floor {
        self.floors.of(self.caller.tenant())
    }

    /// Takes over from the log what machines do. Call once, before anybody asks.
    ///
    /// # Errors
    /// Those of the store.
    pub async fn restore_floors(&self) -> Result<()> {
        self.floors.restore(self.store.of_all_tenants()).await
    }

    /// The services as this caller sees them.
    pub(crate) fn called_by(&self, extensions: &http::Extensions) -> Self {
        let caller = extensions.get::<Caller>().cloned().unwrap_or_else(|| Caller::nobody(None));
        Self { store: self.store.called_by(caller.clone()), caller, ..self.clone() }
    }

    /// Has the audit log name what a call is about, as soon as it is known: refusals name it as well. A name that is none names nothing.
    fn concerns<'a, T, E>(&self, name: &'a str, parse: fn(&'a str) -> Result<T, E>, to_name: fn(T) -> String) {
        if let Ok(id) = parse(name) {
            self.caller.concerns(to_name(id));
        }
    }

    /// Answers a unary call.
    async fn answer<Q, A>(
        &self,
        request: Request<Q>,
        method: impl AsyncFnOnce(Self, Q) -> Result<A>,
    ) -> Result<Response<A>, Status> {
        let api = self.called_by(request.extensions());
        Ok(Response::new(method(api, request.into_inner()).await?))
    }

    /// Creates `machines/lathe` and `machines/mill` where there is no machine at all.
    ///
    /// # Errors
    /// Those of the store.
    pub async fn seed_machines(&self) -> Result<()> {
        use feedwave_cutting::MachineProfile;

        let page = PageRequest { size: 1, token: String::new() };
        if !self.store.list_machines(&page).await?.items.is_empty() {
            return Ok(());
        }
        let default = [("lathe", "Lathe", MachineProfile::lathe()), ("mill", "Mill", MachineProfile::mill())];
        for (id, display_name, profile) in default {
            let document = machines::to_document(display_name, &profile)?;
            match self.store.create_machine(Some(id), document).await {
                Ok(_) | Err(StoreError::AlreadyExists { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}

/// A page of a list as the store wants it.
fn page_request(violations: &mut Violations, page_size: i32, page_token: String) -> PageRequest {
    let size = u32::try_from(page_size).unwrap_or_else(|_| {
        violations.add("page_size", format!("must not be negative, is {page_size}"));
        0
    });
    PageRequest { size, token: page_token }
}

/// A page of a log: records in the order of their sequence numbers, after a cursor.
struct LogPage {
    request: PageRequest,
    scope: Scope,
    /// Sequence number that the page begins after.
    after: i64,
}

impl LogPage {
    /// The page of the log `name` that a request with these filters asks for.
    ///
    /// # Errors
    /// [`StoreError::InvalidPageToken`].
    fn new(request: PageRequest, name: &str, after: u64, filters: &[&str]) -> Result<Self> {
        let cursor_bytes = after.to_be_bytes();
        let parts = [name.as_bytes(), &cursor_bytes].into_iter().chain(filters.iter().map(|filter| filter.as_bytes()));
        let scope = Scope::of(parts);
        let after = match scope.position(&request.token)? {
            Some(position) => i64::from_be_bytes(position.try_into().map_err(|_| StoreError::InvalidPageToken)?),
            None => cursor(after),
        };
        Ok(Self { request, scope, after })
    }

    /// Records to read: one more than the page has tells whether there is another.
    fn limit(&self) -> u32 {
        u32::try_from(self.request.bounded_size()).unwrap_or(u32::MAX - 1) + 1
    }

    /// The page of what was read, and the token of the next one.
    fn cut<T>(&self, records: Vec<T>, sequence: impl Fn(&T) -> i64) -> (Vec<T>, String) {
        let token = |last: &T| self.scope.token(&sequence(last).to_be_bytes());
        let page = Page::cut(records, self.request.bounded_size(), token);
        (page.items, page.next_token.unwrap_or_default())
    }
}

/// A cursor of a log as the store counts; one beyond its range is beyond every record.
fn cursor(after: u64) -> i64 {
    i64::try_from(after).unwrap_or(i64::MAX)
}

/// An etag as the store wants it: empty means any.
fn etag(etag: &str) -> Option<&str> {
    Some(etag).filter(|etag| !etag.is_empty())
}

/// What is wrong with a message of a client's stream; `None` where it is the connection that broke: then there is no
/// receiver to tell, and what was in progress goes on without the client.
fn unreadable(status: Status) -> Option<Error> {
    std::error::Error::source(&status).is_none().then(|| status.into())
}
