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
use crate::error::{Error, Result};
use crate::observability::rpc::code_name;

/// How long refusals that are the same are counted by one entry.
const WINDOW: Duration = Duration::from_secs(60);
/// How often counts are brought into the store.
const FLUSH_INTERVAL: Duration = Duration::from_secs(1);
/// Kinds of refusals that are counted at a time; any further one is an entry of its own.
const MAX_KINDS: usize = 4_096;

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

/// What makes refusals the same: everything but the identifier of the call.
#[derive(PartialEq, Eq, Hash)]
struct Refusal {
    principal: String,
    tenant: String,
    address: String,
    certificate: String,
    method: String,
    reason: String,
}

struct Counted {
    sequence: i64,
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
        tenant: caller.tenant().name().to_owned(),
        address: connection.map_or_else(String::new, |connection| connection.address().to_string()),
        certificate: certificate.map_or_else(String::new, |certificate| certificate.subject.to_string()),
        method: method.to_owned(),
        request_id: request_id.to_owned(),
    }
}

fn refused(error: &Error) -> AuditResult {
    AuditResult { resource: String::new(), code: code_name(error.code()).to_owned(), reason: error.to_string() }
}

impl AuditLog {
    /// The log of a store.
    pub(crate) fn new(store: Store, engine: Engine) -> Self {
        Self { store, engine, refusals: Arc::default() }
    }

    fn refusals(&self) -> MutexGuard<'_, HashMap<Refusal, Counted>> {
        self.refusals.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Stores what is asked for: what cannot be stored must not be done.
    ///
    /// # Errors
    /// [`Error::StoreUnavailable`].
    pub(crate) async fn begin(&self, request: AuditRequest, caller: &Caller) -> Result<Audited> {
        let sequence = self.store.begin_audit(request, None).await?;
        Ok(Audited { log: self.clone(), sequence, caller: caller.clone(), is_ended: false })
    }

    /// Stores that something was refused for want of rights; the same of the same client is counted.
    pub(crate) async fn denied(&self, request: AuditRequest, error: &Error) {
        let result = refused(error);
        let refusal = Refusal {
            principal: request.principal.clone(),
            tenant: request.tenant.clone(),
            address: request.address.clone(),
            certificate: request.certificate.clone(),
            method: request.method.clone(),
            reason: result.reason.clone(),
        };
        let now = Instant::now();
        if let Some(counted) = self.refusals().get_mut(&refusal)
            && now.duration_since(counted.since) < WINDOW
        {
            counted.further += 1;
            return;
        }
        match self.store.begin_audit(request, Some(result)).await {
            Ok(sequence) => self.count(refusal, Counted { sequence, since: now, further: 0 }).await,
            Err(error) => tracing::warn!(%error, "a refusal is missing in the audit log"),
        }
    }

    /// Has further refusals of the kind counted by an entry.
    async fn count(&self, refusal: Refusal, counted: Counted) {
        let replaced = {
            let mut refusals = self.refusals();
            let is_known = refusals.contains_key(&refusal);
            if is_known || refusals.len() < MAX_KINDS { refusals.insert(refusal, counted) } else { None }
        };
        // What the window before has counted since it was last brought into the store.
        if let Some(Counted { sequence, further, .. }) = replaced.filter(|counted| counted.further > 0) {
            self.repeat(sequence, further).await;
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
            match std::mem::take(&mut counted.further) {
                0 => {}
                further => counts.push((counted.sequence, further)),
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
    fn result(&mut self, code: &str, reason: &str) -> AuditResult {
        self.is_ended = true;
        AuditResult { resource: self.caller.subject(), code: code.to_owned(), reason: reason.to_owned() }
    }

    /// Stores what came of it.
    pub(crate) async fn end(mut self, code: tonic::Code, reason: &str) {
        let result = self.result(code_name(code), reason);
        store(self.log.store.clone(), self.sequence, result).await;
    }

    /// The same where nothing can wait for it.
    pub(crate) fn end_later(&mut self, code: tonic::Code, reason: &str) {
        let result = self.result(code_name(code), reason);
        self.log.engine.spawn(store(self.log.store.clone(), self.sequence, result));
    }
}

async fn store(store: Store, sequence: i64, result: AuditResult) {
    if let Err(error) = store.end_audit(sequence, result).await {
        tracing::warn!(%error, sequence, "a result is missing in the audit log");
    }
}

impl Drop for Audited {
    fn drop(&mut self) {
        if !self.is_ended {
            self.end_later(tonic::Code::Cancelled, "the client went away before the end");
        }
    }
}
