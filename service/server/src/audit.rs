//! The audit log: what is asked is stored before it is done, what came of it before it is answered, and refusals for want of
//! rights before they are sent. Reading touches none of it.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use feedwave_store::{AuditRequest, AuditResult, Store};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

use crate::access::Caller;
use crate::engine::Engine;
use crate::error::{Error, Result, code_name};

/// How long refusals that are the same are counted by one entry.
const WINDOW: Duration = Duration::from_secs(60);
/// How often counts are brought into the store.
const FLUSH_INTERVAL: Duration = Duration::from_secs(1);
/// Kinds of refusals of those who are not known that are counted apart at a time; any further ones are counted together. Those of
/// known clients are bounded by their number.
const MAX_KINDS: usize = 1_024;
/// Kinds of one client that are counted apart, of a known one by its name, of others by their address; its further ones are counted
/// together, so that nobody without rights can fill the log, nor hide what another one was refused.
const MAX_KINDS_OF_CLIENT: usize = 16;
/// Why what is counted together was refused.
const TOGETHER: &str = "further refusals, more than are counted apart";

/// What stands for the tenant of those who have shown nothing that is known: no tenant is called so, so that none sees them.
const NO_TENANT: &str = "?";

/// The log. Cloning is cheap.
#[derive(Clone)]
pub(crate) struct AuditLog {
    store: Store,
    engine: Engine,
    refusals: Arc<Mutex<HashMap<Refusal, Counted>>>,
}

impl std::fmt::Debug for AuditLog {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AuditLog").finish_non_exhaustive()
    }
}

/// What makes refusals the same. The empty client, principal and method stand for any.
#[derive(Clone, Default, PartialEq, Eq, Hash)]
struct Refusal {
    /// The client as its shares are counted: one host has many addresses.
    client: String,
    principal: String,
    tenant: String,
    method: String,
    reason: String,
}

impl Refusal {
    /// The kind that holds further refusals of the same client; of any that is not known where `of_all`.
    fn together(&self, of_all: bool) -> Self {
        let reason = TOGETHER.to_owned();
        if !self.principal.is_empty() {
            return Self { principal: self.principal.clone(), reason, ..Self::default() };
        }
        let client = if of_all { String::new() } else { self.client.clone() };
        Self { client, reason, ..Self::default() }
    }

    /// Whether both are of one client: known ones are told by their names, wherever they call from.
    fn is_of_client_of(&self, other: &Self) -> bool {
        self.principal == other.principal && (!self.principal.is_empty() || self.client == other.client)
    }
}

struct Counted {
    /// The entry that counts them; not known while it is stored.
    sequence: Option<i64>,
    since: Instant,
    /// Times that the store does not have yet.
    further: u64,
}

/// What is asked for.
pub(crate) fn asked(caller: &Caller, method: &str, request_id: &str) -> AuditRequest {
    let connection = caller.connection();
    let certificate = connection.and_then(|connection| connection.certificate());
    AuditRequest {
        principal: caller.name().to_owned(),
        tenant: caller.known_tenant().map_or_else(|| NO_TENANT.to_owned(), |tenant| tenant.name().to_owned()),
        address: connection.map_or_else(String::new, |connection| connection.address().to_string()),
        certificate: certificate.map_or_else(String::new, |certificate| certificate.subject.to_string()),
        method: method.to_owned(),
        request_id: request_id.to_owned(),
    }
}

/// A request of which nothing is told.
fn nobody() -> AuditRequest {
    AuditRequest { tenant: NO_TENANT.to_owned(), ..AuditRequest::default() }
}

fn refused(error: &Error) -> AuditResult {
    AuditResult { resource: String::new(), code: code_name(error.code()).to_owned(), reason: error.to_string() }
}

impl AuditLog {
    /// The log of a store.
    pub(crate) fn new(store: Store, engine: Engine) -> Self {
        Self { store, engine, refusals: Arc::default() }
    }

    pub(crate) const fn engine(&self) -> &Engine {
        &self.engine
    }

    fn refusals(&self) -> MutexGuard<'_, HashMap<Refusal, Counted>> {
        self.refusals.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Stores what is asked for: what cannot be stored must not be done.
    ///
    /// # Errors
    /// [`Error::StoreUnavailable`].
    pub(crate) async fn begin(&self, request: AuditRequest, caller: &Caller) -> Result<Audited> {
        let (log, caller) = (self.clone(), caller.clone());
        // Whoever gives up meanwhile leaves no entry without a result.
        let begun = self.engine.to_its_end(async move {
            let sequence = log.store.begin_audit(request, None).await?;
            Ok(Audited { log, sequence, caller, is_ended: false })
        });
        begun.await?
    }

    /// Stores that something was refused for want of rights; the same of the same client is counted.
    pub(crate) async fn denied(&self, request: AuditRequest, caller: &Caller, error: &Error) {
        let first = self.first_of_its_kind(request, &caller.client(), refused(error));
        let Some((refusal, request, result)) = first else { return };
        let log = self.clone();
        let stored = self.engine.to_its_end(async move {
            let stored = log.store.begin_audit(request, Some(result)).await;
            log.stored(&refusal, stored);
        });
        if let Err(error) = stored.await {
            tracing::warn!(%error, "a refusal is missing in the audit log");
        }
    }

    /// Counts a refusal. What is to be stored, where none of its kind is counted yet: those that come while it is stored are
    /// counted already.
    fn first_of_its_kind(
        &self,
        mut request: AuditRequest,
        client: &str,
        mut result: AuditResult,
    ) -> Option<(Refusal, AuditRequest, AuditResult)> {
        let mut refusals = self.refusals();
        let mut refusal = Refusal {
            client: client.to_owned(),
            principal: request.principal.clone(),
            tenant: request.tenant.clone(),
            method: request.method.clone(),
            reason: result.reason.clone(),
        };
        if !refusals.contains_key(&refusal) {
            let is_known = !refusal.principal.is_empty();
            let of_unknown = refusals.keys().filter(|kind| kind.principal.is_empty());
            let is_full = !is_known && of_unknown.take(MAX_KINDS).count() == MAX_KINDS;
            let is_full_of_client = is_full || {
                let of_client = refusals.keys().filter(|kind| kind.is_of_client_of(&refusal));
                of_client.take(MAX_KINDS_OF_CLIENT).count() == MAX_KINDS_OF_CLIENT
            };
            if is_full_of_client {
                refusal = refusal.together(is_full);
                TOGETHER.clone_into(&mut result.reason);
                let AuditRequest { principal, tenant, address, certificate, .. } = request;
                request = match (is_known, is_full) {
                    (true, _) => AuditRequest { principal, tenant, address, certificate, ..nobody() },
                    (false, false) => AuditRequest { address, certificate, ..nobody() },
                    (false, true) => nobody(),
                };
            }
        }
        if let Some(counted) = refusals.get_mut(&refusal) {
            counted.further += 1;
            return None;
        }
        refusals.insert(refusal.clone(), Counted { sequence: None, since: Instant::now(), further: 0 });
        Some((refusal, request, result))
    }

    /// Has further refusals of the kind counted by the entry that was stored.
    fn stored(&self, refusal: &Refusal, stored: feedwave_store::Result<i64>) {
        let mut refusals = self.refusals();
        match stored {
            Ok(sequence) => {
                if let Some(counted) = refusals.get_mut(refusal) {
                    counted.sequence = Some(sequence);
                }
            }
            Err(error) => {
                let times = 1 + refusals.remove(refusal).map_or(0, |counted| counted.further);
                tracing::warn!(%error, times, "refusals are missing in the audit log");
            }
        }
    }

    async fn repeat(&self, sequence: i64, times: u64) {
        if let Err(error) = self.store.repeat_audit(sequence, times).await {
            tracing::warn!(%error, times, "refusals are missing in the audit log");
        }
    }

    /// Brings what was counted into the store.
    async fn flush(&self) {
        let now = Instant::now();
        let mut counts = Vec::new();
        self.refusals().retain(|_, counted| {
            // What is still being stored is counted later.
            let Some(sequence) = counted.sequence else { return true };
            match std::mem::take(&mut counted.further) {
                0 => {}
                further => counts.push((sequence, further)),
            }
            now.duration_since(counted.since) < WINDOW
        });
        for (sequence, times) in counts {
            self.repeat(sequence, times).await;
        }
    }

    /// Brings what was counted into the store, again and again, and at last when `stop` is cancelled.
    pub(crate) async fn follow(self, stop: CancellationToken) {
        while stop.run_until_cancelled(tokio::time::sleep(FLUSH_INTERVAL)).await.is_some() {
            self.flush().await;
        }
        self.flush().await;
    }
}

/// An entry whose result is not known yet. Dropped before it is, its call was given up.
pub(crate) struct Audited {
    log: AuditLog,
    sequence: i64,
    caller: Caller,
    is_ended: bool,
}

impl Audited {
    fn result(&mut self, code: tonic::Code, reason: &str) -> AuditResult {
        self.is_ended = true;
        result(&self.caller, code, reason)
    }

    /// Whether all that was asked for is done, whoever reads the end of the answer.
    pub(crate) fn is_done(&self) -> bool {
        self.caller.is_done()
    }

    /// Stores what came of it.
    pub(crate) async fn end(mut self, code: tonic::Code, reason: &str) {
        let result = self.result(code, reason);
        end(self.log.store.clone(), self.sequence, result).await;
    }

    /// The same where nothing can wait for it.
    pub(crate) fn end_later(&mut self, code: tonic::Code, reason: &str) {
        let result = self.result(code, reason);
        self.log.engine.spawn(end(self.log.store.clone(), self.sequence, result));
    }
}

fn result(caller: &Caller, code: tonic::Code, reason: &str) -> AuditResult {
    AuditResult { resource: caller.subject(), code: code_name(code).to_owned(), reason: reason.to_owned() }
}

async fn end(store: Store, sequence: i64, result: AuditResult) {
    if let Err(error) = store.end_audit(sequence, result).await {
        tracing::warn!(%error, sequence, "a result is missing in the audit log");
    }
}

impl Drop for Audited {
    fn drop(&mut self) {
        if self.is_ended {
            return;
        }
        // What the client had asked for before it went away may still be done.
        let (store, sequence, caller) = (self.log.store.clone(), self.sequence, self.caller.clone());
        self.log.engine.spawn(async move {
            let (code, reason) = match caller.settled().await {
                true => (tonic::Code::Ok, ""),
                false => (tonic::Code::Cancelled, "the client went away before the end"),
            };
            end(store, sequence, result(&caller, code, reason)).await;
        });
    }
}
