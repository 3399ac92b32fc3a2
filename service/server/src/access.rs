//! Who a client is and what it may do.
//!
//! A client shows a token (`authorization: Bearer …`) or a certificate. What it shows is looked up in the file of known
//! clients, or is a token of an identity provider; without either everybody is the operator and may do everything.

mod caller;
mod jwt;
mod known;
mod table;

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock};

pub use caller::Caller;
pub(crate) use caller::Work;
use feedwave_contract::names::TENANT_HEADER;
use feedwave_store::{Store, Tenant};
use http::uri::Authority;
use http::{HeaderMap, header};
use jiff::Timestamp;
use known::KnownClients;
use serde::Deserialize;
pub(crate) use table::{Effect, Needs, of_method, of_route};

use self::jwt::Provider;
use crate::config::AuthConfig;
use crate::connections::Connection;
use crate::error::{Error, Result};

/// What a client may do. Each may read as a viewer does; an admin may do everything.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Reads everything.
    Viewer,
    /// Uploads programs; creates, cancels and deletes jobs; sets how they are monitored.
    Planner,
    /// Runs jobs on machines and sends their telemetry.
    Machine,
    /// Does everything: machines and tools as well.
    Admin,
}

/// The host of an authority that is nothing but a host, and a port where there is one.
fn host_of(authority: Option<&Authority>) -> Option<&str> {
    let authority = authority?;
    let port = authority.as_str().strip_prefix(authority.host())?;
    let is_port = |port: &str| port.bytes().all(|byte| byte.is_ascii_digit());
    (port.is_empty() || port.strip_prefix(':').is_some_and(is_port)).then_some(authority.host())
}

/// Ends of names that the public DNS does not have: a page of another site cannot be called so.
const DOMAINS_OF_NETWORKS: [&str; 4] = ["local", "internal", "lan", "svc"];

impl Role {
    /// As it is written in the file of clients.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Planner => "planner",
            Self::Machine => "machine",
            Self::Admin => "admin",
        }
    }

    const ALL: [Self; 4] = [Self::Viewer, Self::Planner, Self::Machine, Self::Admin];

    fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|role| role.name() == name)
    }

    const fn bit(self) -> u8 {
        1 << self as u8
    }
}

/// Machines on which a client may run jobs.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Machines {
    Any,
    /// Their identifiers.
    These(Vec<String>),
}

impl Machines {
    /// Machines as the file names them: `machines/lathe`, `lathe`, or `*` for any.
    fn new(names: &[String]) -> Self {
        if names.iter().any(|name| name == "*") {
            return Self::Any;
        }
        Self::These(names.iter().map(|name| name.strip_prefix("machines/").unwrap_or(name).to_owned()).collect())
    }
}

/// The tenants that a client acts for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tenants {
    /// Any that it asks for; the default one where it asks for none.
    Any,
    /// This one.
    One(Tenant),
}

impl Tenants {
    /// Tenants as the file names them: a name, or `*` for any; without one the default tenant.
    fn new(name: Option<&str>) -> Result<Self, feedwave_store::InvalidTenant> {
        match name {
            None => Ok(Self::One(Tenant::DEFAULT)),
            Some("*") => Ok(Self::Any),
            Some(name) => name.parse().map(Self::One),
        }
    }
}

/// A client that is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    name: String,
    roles: u8,
    machines: Machines,
    tenants: Tenants,
}

impl Identity {
    fn new(name: String, roles: &[Role], machines: Machines, tenants: Tenants) -> Self {
        Self { name, roles: roles.iter().fold(0, |bits, role| bits | role.bit()), machines, tenants }
    }

    /// Who everybody is where clients need not say who they are.
    fn operator() -> Self {
        Self::new("operator".to_owned(), &[Role::Admin], Machines::Any, Tenants::Any)
    }

    /// What it is called.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether a role is its own.
    const fn has(&self, role: Role) -> bool {
        self.roles & role.bit() != 0
    }

    /// Whether it may do what a role may.
    #[must_use]
    pub const fn is(&self, role: Role) -> bool {
        // Every role reads.
        self.roles & (role.bit() | Role::Admin.bit()) != 0 || matches!(role, Role::Viewer)
    }

    /// Whether it may run jobs on a machine and send its telemetry.
    #[must_use]
    pub fn may_use(&self, machine_id: &str) -> bool {
        match &self.machines {
            Machines::Any => true,
            Machines::These(machines) => self.is(Role::Admin) || machines.iter().any(|machine| machine == machine_id),
        }
    }

    /// Refuses a machine that the client may not use.
    ///
    /// # Errors
    /// [`Error::PermissionDenied`].
    pub fn check_machine(&self, machine_id: &str) -> Result<()> {
        if self.may_use(machine_id) {
            return Ok(());
        }
        let needs = format!("the role machine for machines/{machine_id}");
        Err(Error::PermissionDenied { client: self.name.clone(), role: Role::Machine.name(), needs })
    }
}

/// Whether the text of a file of known clients can be used.
///
/// # Errors
/// What is wrong with it, without what it says itself.
pub fn check_clients(text: &str, path: &Path) -> Result<(), String> {
    KnownClients::parse(text, path).map(|_| ())
}

/// Decides who may do what. Cloning is cheap.
#[derive(Clone, Debug)]
pub struct Access {
    inner: Arc<Inner>,
}

struct Inner {
    /// Where known clients are listed.
    file: Option<PathBuf>,
    /// Whose tokens are known as well. Without it and the file everybody is the operator.
    provider: Option<Provider>,
    known: RwLock<Arc<KnownClients>>,
    /// Whether there are records of tenants, or were clients of any. These stay separate whatever the file says later.
    has_tenants: AtomicBool,
    /// What was read last, whether it could be used or not.
    seen: Mutex<String>,
    operator: Arc<Identity>,
    /// Hosts by whose name the service is reached.
    hosts: Vec<String>,
}

impl fmt::Debug for Inner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Access").field("file", &self.file).finish_non_exhaustive()
    }
}

impl Access {
    /// Reads the file of known clients and that of the identity provider's keys, where there are such.
    ///
    /// # Errors
    /// The configuration key, and what is wrong with it.
    pub fn load(config: &AuthConfig) -> Result<Self, (String, String)> {
        let of_clients = |reason| ("auth.clients".to_owned(), reason);
        let file = config.clients.clone();
        let (text, known) = match &file {
            Some(path) => {
                let text = std::fs::read_to_string(path);
                let text = text.map_err(|error| of_clients(format!("{}: {error}", path.display())))?;
                let known = KnownClients::parse(&text, path).map_err(of_clients)?;
                (text, known)
            }
            None => (String::new(), KnownClients::default()),
        };
        let provider = config.jwt.as_ref().map(Provider::load).transpose();
        let provider = provider.map_err(|reason| ("auth.jwt.jwks".to_owned(), reason))?;
        let operator = Arc::new(Identity::operator());
        let (known, seen, hosts) = (RwLock::new(Arc::new(known)), Mutex::new(text), config.hosts.clone());
        let has_tenants = AtomicBool::default();
        let inner = Inner { file, provider, known, has_tenants, seen, operator, hosts };
        Ok(Self { inner: Arc::new(inner) })
    }

    /// Takes the file over where it has changed: whether it had. What cannot be used leaves everything as it was.
    ///
    /// # Errors
    /// What is wrong with it, once for each change.
    pub fn reload(&self) -> Result<bool, String> {
        let keys = self.inner.provider.as_ref().map_or(Ok(false), Provider::reload);
        Ok(self.reload_clients()? | keys?)
    }

    fn reload_clients(&self) -> Result<bool, String> {
        let Some(path) = &self.inner.file else { return Ok(false) };
        let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        {
            let mut seen = self.inner.seen.lock().unwrap_or_else(PoisonError::into_inner);
            if *seen == text {
                return Ok(false);
            }
            seen.clone_from(&text);
        }
        let known = KnownClients::parse(&text, path)?;
        let mut held = self.inner.known.write().unwrap_or_else(PoisonError::into_inner);
        if held.has_tenants {
            // Records of tenants do not go with the last client of one.
            self.inner.has_tenants.store(true, Ordering::Release);
        }
        *held = Arc::new(known);
        drop(held);
        Ok(true)
    }

    /// Learns from the store whether there are records of tenants, which an earlier file of clients may have had.
    ///
    /// # Errors
    /// Where the store does not answer.
    pub(crate) async fn look_for_tenants(&self, store: &Store) -> feedwave_store::Result<()> {
        if !self.inner.has_tenants.load(Ordering::Acquire) && store.has_tenants().await? {
            self.inner.has_tenants.store(true, Ordering::Release);
        }
        Ok(())
    }

    /// Refuses a host by whose name a page of another site may reach the service through a browser that can reach it (DNS rebinding),
    /// where clients need not say who they are: what is asked has to be localhost, an address, or a host that the configuration names.
    /// Other computers may ask for names that the public DNS does not have as well.
    ///
    /// # Errors
    /// [`Error::HostDenied`].
    pub(crate) fn check_host<B>(
        &self,
        needs: Needs,
        request: &http::Request<B>,
        connection: Option<&Arc<Connection>>,
    ) -> Result<()> {
        let knows_clients = self.inner.file.is_some() || self.inner.provider.is_some();
        if needs == Needs::Nobody || knows_clients {
            return Ok(());
        }
        self.check_name(request, connection)
    }

    /// The same for a port whose clients never say who they are.
    ///
    /// # Errors
    /// [`Error::HostDenied`].
    pub(crate) fn check_name<B>(&self, request: &http::Request<B>, connection: Option<&Arc<Connection>>) -> Result<()> {
        let is_from_here = connection.is_none_or(|connection| connection.address().is_loopback());
        let written = request.headers().get_all(header::HOST).iter().map(|host| host.to_str().ok()?.parse().ok());
        let mut asked = request.uri().authority().cloned().map(Some).into_iter().chain(written);
        // What cannot be read may be read by a browser.
        let is_own = |authority: Option<Authority>| {
            host_of(authority.as_ref()).is_some_and(|host| self.is_own_name(host, is_from_here))
        };
        if asked.all(is_own) { Ok(()) } else { Err(Error::HostDenied) }
    }

    /// Whether no other site can have this name.
    fn is_own_name(&self, host: &str, is_from_here: bool) -> bool {
        let host = host.trim_end_matches('.').to_ascii_lowercase();
        let address = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(&host);
        let last = host.rsplit('.').next().unwrap_or_default();
        let is_of_network = last == host || DOMAINS_OF_NETWORKS.contains(&last) || host.ends_with(".home.arpa");
        last == "localhost"
            || is_of_network && !is_from_here
            || address.parse::<std::net::IpAddr>().is_ok()
            || self.inner.hosts.iter().any(|known| known.eq_ignore_ascii_case(&host))
    }

    /// Asks for the keys of the identity provider again and again, where they are behind a URL.
    pub async fn follow_keys(&self) {
        if let Some(provider) = &self.inner.provider {
            provider.follow().await;
        }
    }

    /// Who asks, and whether that client may do what needs `needs`. Takes the token away from the headers.
    ///
    /// # Errors
    /// In the second value: [`Error::Unauthenticated`], [`Error::PermissionDenied`], [`Error::TenantDenied`], and
    /// [`Error::Invalid`] for a tenant that cannot be.
    pub(crate) async fn authorize(
        &self,
        needs: Needs,
        headers: &mut HeaderMap,
        connection: Option<&Arc<Connection>>,
    ) -> (Caller, Result<()>) {
        let shown = headers.remove(header::AUTHORIZATION);
        let caller = Caller::nobody(connection.cloned());
        let Needs::Role(role) = needs else { return (caller, Ok(())) };
        let (identity, has_tenants) = match self.identity(shown.as_ref(), connection).await {
            Ok(identity) => identity,
            Err(error) => return (caller, Err(error)),
        };
        let tenant = tenant_asked_for(headers);
        let asked_for = *tenant.as_ref().unwrap_or(&None);
        let refused = match (tenant, identity.tenants) {
            (Err(error), _) => Err(error),
            (Ok(Some(tenant)), Tenants::One(own)) if own != tenant => {
                Err(Error::TenantDenied { client: identity.name.clone() })
            }
            _ if !identity.is(role) => {
                let needs = format!("the role {}", role.name());
                Err(Error::PermissionDenied { client: identity.name.clone(), role: role.name(), needs })
            }
            _ => Ok(()),
        };
        let asked_for = asked_for.filter(|_| refused.is_ok() || identity.tenants == Tenants::Any);
        (caller.known(identity, asked_for, has_tenants), refused)
    }

    /// Who asks, and whether there are tenants.
    async fn identity(
        &self,
        shown: Option<&http::HeaderValue>,
        connection: Option<&Arc<Connection>>,
    ) -> Result<(Arc<Identity>, bool)> {
        if self.inner.file.is_none() && self.inner.provider.is_none() {
            return Ok((self.inner.operator.clone(), false));
        }
        let known = self.inner.known.read().unwrap_or_else(PoisonError::into_inner).clone();
        let now = Timestamp::now();
        let has_tenants = known.has_tenants
            || self.inner.has_tenants.load(Ordering::Acquire)
            || self.inner.provider.as_ref().is_some_and(Provider::has_tenants);
        let identity = match (shown, connection.and_then(|connection| connection.certificate())) {
            (Some(shown), _) => {
                let token = shown
                    .to_str()
                    .ok()
                    .and_then(bearer)
                    .ok_or(Error::Unauthenticated { why: "the header authorization has no bearer token" })?;
                match (known.by_token(token, now), &self.inner.provider) {
                    (Some(identity), _) => identity,
                    // What has no points is no token of a provider.
                    (None, Some(provider)) if token.contains('.') => Arc::new(provider.identity(token).await?),
                    (None, _) => return Err(Error::Unauthenticated { why: "the token is not known or has ended" }),
                }
            }
            (None, Some(shown)) => known
                .by_certificate(&shown.subject, &shown.common_name, now)
                .ok_or(Error::Unauthenticated { why: "the certificate is of no known client" })?,
            (None, None) => return Err(Error::Unauthenticated { why: "a bearer token or a certificate is needed" }),
        };
        Ok((identity, has_tenants))
    }
}

/// The tenant that a client asks for.
fn tenant_asked_for(headers: &HeaderMap) -> Result<Option<Tenant>> {
    let Some(value) = headers.get(TENANT_HEADER) else { return Ok(None) };
    let tenant = value.to_str().ok().and_then(|name| name.parse().ok());
    tenant.map(Some).ok_or_else(|| Error::invalid(TENANT_HEADER, feedwave_store::InvalidTenant.to_string()))
}

/// The token in the value of the header.
fn bearer(value: &str) -> Option<&str> {
    let (scheme, token) = value.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim()).filter(|token| !token.is_empty())
}
