//! The clients that are known, from a file: by the hash of a token or by their certificate.

use std::collections::{HashMap, HashSet};
use std::fmt;
use std::path::Path;
use std::sync::Arc;

use jiff::Timestamp;
use serde::Deserialize;
use sha2::{Digest as _, Sha256};

use super::{Identity, Machines, Role, Tenants};

/// How a client is told from others.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    /// What it is called in logs and refusals.
    name: String,
    /// SHA-256 of its token, lower-case hexadecimal.
    #[serde(default)]
    token_sha256: Option<String>,
    /// Subject of its certificate, or, where it has no `=`, the common name in it.
    #[serde(default)]
    certificate: Option<String>,
    roles: Vec<Role>,
    /// Machines on which it may run jobs and send telemetry; `*` is any.
    #[serde(default)]
    machines: Vec<String>,
    /// The tenant that it belongs to; `*`: it acts for any; absent: the default tenant.
    #[serde(default)]
    tenant: Option<String>,
    /// When the entry ends, RFC 3339.
    #[serde(default)]
    expires: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    client: Vec<Entry>,
}

/// A known client until its entry ends.
struct Known {
    identity: Arc<Identity>,
    expires: Option<Timestamp>,
}

/// Every client that is known.
#[derive(Default)]
pub(super) struct KnownClients {
    by_token: HashMap<[u8; 32], Known>,
    by_certificate: HashMap<String, Known>,
    /// Whether any client belongs to a tenant.
    pub(super) has_tenants: bool,
}

impl fmt::Debug for KnownClients {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counts = (self.by_token.len(), self.by_certificate.len());
        f.debug_tuple("KnownClients").field(&counts).finish()
    }
}

impl KnownClients {
    /// Reads the text of a file; says what is wrong with it, without what it says itself.
    pub(super) fn parse(text: &str, path: &Path) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|error| {
            let line = error.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
            format!("{}, line {line}: {}", path.display(), error.message())
        })?;
        let mut known = Self::default();
        let mut names = HashSet::new();
        for entry in file.client {
            let name = entry.name.clone();
            let refused = |reason: &str| Err(format!("{}: the client {name:?} {reason}", path.display()));
            if name.is_empty() || !names.insert(name.clone()) {
                return refused("needs a name that no other has");
            }
            if entry.roles.is_empty() {
                return refused("needs one of the roles viewer, planner, machine, admin");
            }
            let machines = Machines::new(&entry.machines);
            let Ok(tenants) = Tenants::new(entry.tenant.as_deref()) else {
                return refused("has a tenant that is neither * nor 1 to 32 lower-case letters, digits, -, _ and .");
            };
            known.has_tenants |= entry.tenant.is_some();
            let identity = Arc::new(Identity::new(entry.name, &entry.roles, machines, tenants));
            let Ok(expires) = entry.expires.map(|time| time.parse()).transpose() else {
                return refused("has an expires that is no time such as 2027-01-01T00:00:00Z");
            };
            let client = Known { identity, expires };
            let free = match (entry.token_sha256, entry.certificate) {
                (Some(hash), None) => match hash_of_hex(&hash) {
                    Some(hash) => known.by_token.insert(hash, client).is_none(),
                    None => return refused("has a token_sha256 that is not 64 hexadecimal digits"),
                },
                (None, Some(certificate)) if certificate.is_empty() => return refused("has an empty certificate"),
                (None, Some(certificate)) => known.by_certificate.insert(certificate, client).is_none(),
                _ => return refused("needs either token_sha256 or certificate"),
            };
            if !free {
                return refused("has the token or certificate of another one");
            }
        }
        Ok(known)
    }

    /// The client with this token, if its entry has not ended.
    pub(super) fn by_token(&self, token: &str, now: Timestamp) -> Option<Arc<Identity>> {
        valid(self.by_token.get(&hash(token)), now)
    }

    /// The client with this subject or common name, if its entry has not ended.
    pub(super) fn by_certificate(&self, subject: &str, common_name: &str, now: Timestamp) -> Option<Arc<Identity>> {
        // A common name must not pass for a whole subject.
        let by_name = || self.by_certificate.get(common_name).filter(|_| !common_name.contains('='));
        valid(self.by_certificate.get(subject).or_else(by_name), now)
    }
}

fn valid(known: Option<&Known>, now: Timestamp) -> Option<Arc<Identity>> {
    known.filter(|known| known.expires.is_none_or(|expires| now < expires)).map(|known| known.identity.clone())
}

/// What is stored of a token. It is as random as the hash is long, so that a slow hash would add nothing.
fn hash(token: &str) -> [u8; 32] {
    Sha256::digest(token).into()
}

fn hash_of_hex(hex: &str) -> Option<[u8; 32]> {
    let mut hash = [0; 32];
    if hex.len() != 64 || !hex.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return None;
    }
    for (byte, digits) in hash.iter_mut().zip(hex.as_bytes().chunks(2)) {
        *byte = u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
    }
    Some(hash)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<KnownClients, String> {
        KnownClients::parse(text, Path::new("clients.toml"))
    }

    #[test]
    fn clients_are_found_by_their_token_and_by_their_certificate_until_they_end() {
        let hex: String = hash("secret").iter().map(|byte| format!("{byte:02x}")).collect();
        let known = parse(&format!(
            "[[client]]\nname = 'a'\ntoken_sha256 = '{hex}'\nroles = ['planner']\nexpires = '2026-01-01T00:00:00Z'\n\
             [[client]]\nname = 'b'\ncertificate = 'mill-3'\nroles = ['machine']\nmachines = ['machines/mill']\n"
        ));
        let known = known.unwrap();
        let (before, after) = ("2025-12-31T23:59:59Z".parse().unwrap(), "2026-01-01T00:00:00Z".parse().unwrap());
        assert_eq!(known.by_token("secret", before).unwrap().name(), "a");
        assert!(known.by_token("secret", after).is_none() && known.by_token("Secret", before).is_none());
        let machine = known.by_certificate("CN=mill-3, O=plant", "mill-3", after).unwrap();
        assert!(machine.is(Role::Machine) && machine.is(Role::Viewer) && !machine.is(Role::Planner));
        assert!(machine.may_use("mill") && !machine.may_use("lathe"));
        assert!(known.by_certificate("", "", after).is_none());
        let subject = parse("[[client]]\nname = 'b'\ncertificate = 'CN=mill-3'\nroles = ['machine']\n").unwrap();
        assert!(subject.by_certificate("CN=mill-3", "mill-3", after).is_some());
        assert!(subject.by_certificate("CN=CN\\=mill-3", "CN=mill-3", after).is_none());
    }

    #[test]
    fn a_file_that_says_too_little_or_too_much_is_refused_without_its_contents() {
        let refused = |text: &str| parse(text).err().unwrap();
        let hash = "a".repeat(64);
        for (text, why) in [
            ("[[client]]\nname = 'a'\ntoken = 'hidden'\nroles = []\n", "line 3: unknown field `token`"),
            ("[[client]]\nname = 'a'\nroles = ['viewer']\n", "needs either token_sha256 or certificate"),
            ("[[client]]\nname = 'a'\ntoken_sha256 = 'hidden'\nroles = ['viewer']\n", "not 64 hexadecimal digits"),
            ("[[client]]\nname = 'a'\ncertificate = ''\nroles = ['viewer']\n", "an empty certificate"),
            ("[[client]]\nname = 'a'\ncertificate = 'x'\nroles = []\n", "needs one of the roles"),
            ("[[client]]\nname = 'a'\ncertificate = 'x'\nroles = ['boss']\n", "unknown variant `boss`"),
        ] {
            let error = refused(text);
            assert!(error.contains(why) && !error.contains("hidden"), "{error}");
        }
        let twice = format!("[[client]]\nname = 'a'\ntoken_sha256 = '{hash}'\nroles = ['viewer']\n");
        assert!(refused(&(twice.clone() + &twice)).contains("a name that no other has"));
        assert!(refused(&(twice.clone() + &twice.replace("'a'", "'b'"))).contains("of another one"));
    }
}
