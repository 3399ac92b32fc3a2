//! Who a call is done for.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use feedwave_contract::proto::CallerState;
use feedwave_store::Tenant;
use tokio_util::task::TaskTracker;
use tokio_util::task::task_tracker::TaskTrackerToken;

use super::{Identity, Role, Tenants};
use crate::connections::Connection;
use crate::error::Result;

/// Who a call is done for: a client, in one tenant. Cloning is cheap; clones are of the same call.
#[derive(Clone, Debug)]
pub struct Caller {
    identity: Option<Arc<Identity>>,
    tenant: Tenant,
    /// Whether the tenant was asked for by the header.
    is_tenant_chosen: bool,
    /// Whether there are tenants at all.
    has_tenants: bool,
    connection: Option<Arc<Connection>>,
    /// What the call is about, for the audit log.
    subject: Arc<Mutex<String>>,
    /// Whether all that was asked for is done.
    is_done: Arc<AtomicBool>,
    /// What is still done for the call, whether or not its client is there.
    works: TaskTracker,
}

/// What is done for a call though its client may have gone away. Dropped without having been done, it was given up.
#[derive(Debug)]
pub(crate) struct Work {
    is_done: Arc<AtomicBool>,
    _token: TaskTrackerToken,
}

impl Work {
    /// States that all that the call asked for is done.
    pub(crate) fn has_done(self) {
        self.is_done.store(true, Ordering::Release);
    }
}

impl Caller {
    /// Nobody that is known.
    pub(crate) fn nobody(connection: Option<Arc<Connection>>) -> Self {
        Self {
            identity: None,
            tenant: Tenant::DEFAULT,
            is_tenant_chosen: false,
            has_tenants: true,
            connection,
            subject: Arc::default(),
            is_done: Arc::default(),
            works: TaskTracker::new(),
        }
    }

    /// The service itself.
    pub(crate) fn service() -> Self {
        Self { has_tenants: false, ..Self::nobody(None) }
    }

    /// A client in its own tenant, or in the one that it asks for. `has_tenants` where any client belongs to one.
    pub(super) fn known(mut self, identity: Arc<Identity>, asked_for: Option<Tenant>, has_tenants: bool) -> Self {
        self.tenant = asked_for.unwrap_or(match identity.tenants {
            Tenants::Any => Tenant::DEFAULT,
            Tenants::One(tenant) => tenant,
        });
        self.is_tenant_chosen = asked_for.is_some();
        self.has_tenants = has_tenants;
        self.identity = Some(identity);
        self
    }

    /// Name of the client; empty where it is nobody known.
    #[must_use]
    pub fn name(&self) -> &str {
        self.identity.as_ref().map_or("", |identity| identity.name())
    }

    /// The tenant that a client which is known acts for.
    pub(crate) fn known_tenant(&self) -> Option<Tenant> {
        self.identity.is_some().then_some(self.tenant)
    }

    /// The tenant whose records the call sees, and whose new records are.
    #[must_use]
    pub const fn tenant(&self) -> Tenant {
        self.tenant
    }

    /// The client as it is told of itself.
    pub(crate) fn described(&self) -> CallerState {
        let identity = self.identity.as_deref();
        let has = |role: &&Role| identity.is_some_and(|identity| identity.has(**role));
        CallerState {
            name: self.name().to_owned(),
            roles: Role::ALL.iter().filter(has).map(|role| role.name().to_owned()).collect(),
            tenant: self.tenant.to_string(),
            any_tenant: identity.is_some_and(|identity| identity.tenants == Tenants::Any),
            has_tenants: self.has_tenants,
        }
    }

    /// The one tenant whose records the call may see, where it may not see all.
    #[must_use]
    pub fn confined_to(&self) -> Option<Tenant> {
        let sees_all = match &self.identity {
            Some(identity) => identity.tenants == Tenants::Any || !self.has_tenants,
            None => !self.has_tenants,
        };
        (!sees_all || self.is_tenant_chosen).then_some(self.tenant)
    }

    /// Who it is, for shares and limits of clients; empty where it is not known.
    #[must_use]
    pub fn client(&self) -> String {
        self.connection.as_ref().map_or_else(String::new, |connection| connection.client().to_string())
    }

    /// Refuses a machine that the client may not use.
    ///
    /// # Errors
    /// [`crate::error::Error::PermissionDenied`].
    pub(crate) fn check_machine(&self, machine_id: &str) -> Result<()> {
        self.identity.as_ref().map_or(Ok(()), |identity| identity.check_machine(machine_id))
    }

    /// The connection that the call came over.
    pub(crate) const fn connection(&self) -> Option<&Arc<Connection>> {
        self.connection.as_ref()
    }

    /// States what the call is about, for the audit log.
    pub(crate) fn concerns(&self, subject: impl Into<String>) {
        *self.subject.lock().unwrap_or_else(PoisonError::into_inner) = subject.into();
    }

    /// Begins work for the call: who goes away before the end of the answer has not cancelled what is done by then.
    pub(crate) fn work(&self) -> Work {
        Work { is_done: self.is_done.clone(), _token: self.works.token() }
    }

    /// Whether all that was asked for is done.
    pub(crate) fn is_done(&self) -> bool {
        self.is_done.load(Ordering::Acquire)
    }

    /// Waits until nothing is done for the call any more; whether all that was asked for is done.
    pub(crate) async fn settled(&self) -> bool {
        self.works.close();
        self.works.wait().await;
        self.is_done()
    }

    /// What the call is about, as far as it is known.
    pub(crate) fn subject(&self) -> String {
        self.subject.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
