//! Tokens of an identity provider (JWT): verified by its public keys, which are kept, and asked for anew from time to time and
//! when a token names one that is not known.

mod crypto;
mod fetch;
mod keys;

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::Duration;

use jsonwebtoken::errors::ErrorKind;
use jsonwebtoken::{Header, Validation, decode, decode_header};
use serde_json::{Map, Value};
use tokio::time::Instant;

use self::fetch::{Endpoint, MAX_BYTES};
use self::keys::{Key, KeySet};
use super::{Identity, Machines, Role, Tenants};
use crate::config::JwtConfig;
use crate::error::{Error, Result};

/// Longest token, bytes.
const MAX_TOKEN_BYTES: usize = 8 << 10;
/// Longest name of a client, bytes.
const MAX_NAME_BYTES: usize = 200;
/// What the names of clients begin with, so that none is taken for one of the file.
const NAME_PREFIX: &str = "jwt:";

/// An identity provider.
pub(super) struct Provider {
    config: JwtConfig,
    source: Source,
    held: RwLock<Option<Arc<Held>>>,
    /// When keys were asked for last; held while they are, so that all who need them wait for one answer.
    asked: tokio::sync::Mutex<Option<Instant>>,
    /// What a file had last, whether it could be used or not.
    seen: Mutex<Vec<u8>>,
}

/// Where the keys are.
enum Source {
    File(PathBuf),
    Endpoint(Endpoint),
}

/// Keys, and since when.
struct Held {
    keys: KeySet,
    since: Instant,
}

const fn refused(why: &'static str) -> Error {
    Error::Unauthenticated { why }
}

impl Provider {
    /// A provider; keys of a file are read, those behind a URL asked for later.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(super) fn load(config: &JwtConfig) -> Result<Self, String> {
        crypto::install();
        let source = if config.is_url() {
            Source::Endpoint(Endpoint::new(&config.jwks, config.jwks_ca.as_deref())?)
        } else {
            Source::File(PathBuf::from(&config.jwks))
        };
        let provider = Self {
            config: config.clone(),
            source,
            held: RwLock::default(),
            asked: tokio::sync::Mutex::default(),
            seen: Mutex::default(),
        };
        provider.reload()?;
        Ok(provider)
    }

    /// Whether its clients belong to tenants.
    pub(super) const fn has_tenants(&self) -> bool {
        self.config.tenant_claim.is_some()
    }

    /// Takes a file over where it has changed: whether it had. What cannot be used leaves everything as it was.
    ///
    /// # Errors
    /// What is wrong with it, once for each change.
    pub(super) fn reload(&self) -> Result<bool, String> {
        let Source::File(path) = &self.source else { return Ok(false) };
        let failed = |reason: String| format!("{}: {reason}", path.display());
        let text = std::fs::read(path).map_err(|error| failed(error.to_string()))?;
        {
            let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
            if *seen == text {
                return Ok(false);
            }
            seen.clone_from(&text);
        }
        if text.len() > MAX_BYTES {
            return Err(failed(format!("it has {} bytes, more than {MAX_BYTES}", text.len())));
        }
        self.hold(KeySet::parse(&text).map_err(failed)?);
        Ok(true)
    }

    fn hold(&self, keys: KeySet) {
        let held = Arc::new(Held { keys, since: Instant::now() });
        *self.held.write().unwrap_or_else(PoisonError::into_inner) = Some(held);
    }

    /// The keys, unless they were not confirmed for too long.
    fn held(&self) -> Option<Arc<Held>> {
        let held = self.held.read().unwrap_or_else(PoisonError::into_inner).clone();
        let stale = Duration::from_secs(self.config.stale_s);
        let is_file = matches!(self.source, Source::File(_));
        held.filter(|held| is_file || held.since.elapsed() < stale)
    }

    /// Asks for the keys, unless they were asked for within `least`.
    async fn refresh(&self, least: Duration) {
        let Source::Endpoint(endpoint) = &self.source else { return };
        let mut asked = self.asked.lock().await;
        if asked.is_some_and(|asked| asked.elapsed() < least) {
            return;
        }
        *asked = Some(Instant::now());
        let answer = endpoint.get().await.and_then(|text| KeySet::parse(&text));
        // Who has waited for an answer that took long does not ask again.
        *asked = Some(Instant::now());
        match answer {
            Ok(keys) => self.hold(keys),
            Err(reason) => {
                tracing::warn!(jwks = self.config.jwks, reason, "the keys of the identity provider cannot be had");
            }
        }
    }

    /// Asks for the keys again and again, each time so long after they were asked for last, by whomever.
    pub(super) async fn follow(&self) {
        let period = Duration::from_secs(self.config.refresh_s);
        loop {
            self.refresh(Duration::from_secs(self.config.least_refresh_s)).await;
            let since = self.asked.lock().await.map_or(Duration::ZERO, |asked| asked.elapsed());
            tokio::time::sleep(period.saturating_sub(since)).await;
        }
    }

    /// Who shows this token.
    ///
    /// # Errors
    /// [`Error::Unauthenticated`], and [`Error::KeysUnavailable`] where there are no keys to verify it by.
    pub(super) async fn identity(&self, token: &str) -> Result<Identity> {
        if token.len() > MAX_TOKEN_BYTES {
            return Err(refused("the token is too long"));
        }
        let header = decode_header(token).map_err(|_| refused("the token is none that is known, and no JWT"))?;
        if header.crit.is_some() {
            return Err(refused("the token asks for something that is not known here (crit)"));
        }
        let known = |held: &Option<Arc<Held>>| held.as_ref().is_some_and(|held| key(held, &header).is_some());
        let mut held = self.held();
        if !known(&held) {
            self.refresh(Duration::from_secs(self.config.least_refresh_s)).await;
            held = self.held();
        }
        let held = held.ok_or(Error::KeysUnavailable)?;
        let key = key(&held, &header).ok_or(refused("the token is signed by no known key"))?;
        if !key.is_for(header.alg) {
            return Err(refused("the token is signed by another algorithm than its key is for"));
        }
        let claims = decode::<Map<String, Value>>(token, key.key(), &self.validation(&header)).map_err(why)?.claims;
        // One issuer: what names several is of whoever is among them.
        if claims.get("iss").and_then(Value::as_str) != Some(self.config.issuer.as_str()) {
            return Err(refused("the token is of another issuer"));
        }
        self.identity_of(&claims)
    }

    fn validation(&self, header: &Header) -> Validation {
        let mut validation = Validation::new(header.alg);
        validation.leeway = self.config.leeway_s;
        validation.validate_nbf = true;
        validation.set_issuer(&[&self.config.issuer]);
        validation.set_audience(&[&self.config.audience]);
        validation.set_required_spec_claims(&["exp", "iss", "aud"]);
        validation
    }

    /// Who a verified token is about.
    fn identity_of(&self, claims: &Map<String, Value>) -> Result<Identity> {
        let config = &self.config;
        let name = claim(claims, &config.name_claim).and_then(Value::as_str).unwrap_or_default();
        let is_printable = !name.is_empty() && name.len() <= MAX_NAME_BYTES && !name.chars().any(char::is_control);
        if !is_printable {
            return Err(refused("the token has no name of a client, or one that is too long"));
        }
        let roles: Vec<Role> = texts(claim(claims, &config.roles_claim))
            .into_iter()
            .filter_map(|role| Role::of_name(role.strip_prefix(config.role_prefix.as_str())?))
            .collect();
        if roles.is_empty() {
            return Err(refused("the token names no role of this service"));
        }
        let tenants = match &config.tenant_claim {
            None => Tenants::new(None),
            // Who belongs to no tenant must not come to see what the default one has.
            Some(tenant) => Tenants::new(Some(claim(claims, tenant).and_then(Value::as_str).unwrap_or_default())),
        };
        let tenants = tenants.map_err(|_| refused("the token names no tenant, or one that cannot be"))?;
        let machines = config.machines_claim.as_ref().map(|name| texts(claim(claims, name))).unwrap_or_default();
        let machines: Vec<String> = machines.into_iter().map(str::to_owned).collect();
        Ok(Identity::new(format!("{NAME_PREFIX}{name}"), &roles, Machines::new(&machines), tenants))
    }
}

fn key<'a>(held: &'a Held, header: &Header) -> Option<&'a Key> {
    held.keys.find(header.kid.as_deref())
}

/// A claim by its name, or by its path with points between the names.
fn claim<'a>(claims: &'a Map<String, Value>, name: &str) -> Option<&'a Value> {
    if let Some(value) = claims.get(name) {
        return Some(value);
    }
    let mut names = name.split('.');
    let first = claims.get(names.next()?)?;
    names.try_fold(first, |value, name| value.get(name))
}

/// A list of texts, or a text with spaces between them.
fn texts(value: Option<&Value>) -> Vec<&str> {
    match value {
        Some(Value::String(text)) => text.split_whitespace().collect(),
        Some(Value::Array(items)) => items.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    }
}

/// Why a token is refused, without what it says.
fn why(error: jsonwebtoken::errors::Error) -> Error {
    refused(match error.kind() {
        ErrorKind::ExpiredSignature => "the token has ended",
        ErrorKind::ImmatureSignature => "the token does not begin before a later time",
        ErrorKind::InvalidIssuer => "the token is of another issuer",
        ErrorKind::InvalidAudience => "the token is for another service",
        ErrorKind::MissingRequiredClaim(_) | ErrorKind::InvalidClaimFormat(_) => {
            "the token has not all of exp, iss and aud, or one of these or nbf in a form that cannot be read"
        }
        _ => "the token's signature is not valid",
    })
}

#[cfg(test)]
mod tests;
