//! Tokens of an identity provider.

use std::net::IpAddr;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::problems::{Problem, Range};

/// Tokens of an identity provider (JWT), and which of their claims say what.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JwtConfig {
    /// The provider's public keys (JWKS): a file, or a URL.
    pub jwks: String,
    /// Certificates that the provider's must be signed by, PEM; needed where the URL is one of https.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jwks_ca: Option<PathBuf>,
    /// What the claim `iss` must be.
    pub issuer: String,
    /// What the claim `aud` must be, or list.
    pub audience: String,
    /// The claim with the name of the client.
    pub name_claim: String,
    /// The claim with the roles: a list, or words with spaces between them.
    pub roles_claim: String,
    /// What the names of roles begin with there.
    pub role_prefix: String,
    /// The claim with the tenant; absent: all have the default tenant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tenant_claim: Option<String>,
    /// The claim with the machines of the role machine, as the roles are given; absent: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub machines_claim: Option<String>,
    /// By how much the clocks of the provider and the service may differ, s.
    pub leeway_s: u64,
    /// How often the keys behind a URL are asked for, s.
    pub refresh_s: u64,
    /// How long they are not asked for again, whatever tokens name, s.
    pub least_refresh_s: u64,
    /// How long they are used while the provider does not answer, s.
    pub stale_s: u64,
}

impl Default for JwtConfig {
    fn default() -> Self {
        Self {
            jwks: String::new(),
            jwks_ca: None,
            issuer: String::new(),
            audience: String::new(),
            name_claim: "sub".to_owned(),
            roles_claim: "roles".to_owned(),
            role_prefix: String::new(),
            tenant_claim: None,
            machines_claim: None,
            leeway_s: 30,
            refresh_s: 300,
            least_refresh_s: 30,
            stale_s: 86_400,
        }
    }
}

impl JwtConfig {
    /// Whether the keys are behind a URL.
    #[must_use]
    pub fn is_url(&self) -> bool {
        self.jwks.starts_with("http://") || self.jwks.starts_with("https://")
    }

    /// Whole numbers with their ranges, by key.
    pub(super) fn ranges(&self) -> [Range; 4] {
        [
            ("auth.jwt.leeway_s", self.leeway_s, 0, 300),
            ("auth.jwt.refresh_s", self.refresh_s, 1, 86_400),
            ("auth.jwt.least_refresh_s", self.least_refresh_s, 1, 86_400),
            ("auth.jwt.stale_s", self.stale_s, 1, 31_536_000),
        ]
    }

    /// Texts that cannot be used, by key.
    pub(super) fn problems(&self) -> Vec<Problem> {
        let mut problems = Vec::new();
        let texts = [
            ("auth.jwt.jwks", &self.jwks),
            ("auth.jwt.issuer", &self.issuer),
            ("auth.jwt.audience", &self.audience),
            ("auth.jwt.name_claim", &self.name_claim),
            ("auth.jwt.roles_claim", &self.roles_claim),
        ];
        for (key, _) in texts.into_iter().filter(|(_, text)| text.is_empty()) {
            problems.push((key, "must be set".to_owned()));
        }
        let uri = self.jwks.parse::<http::Uri>();
        let host = uri.as_ref().ok().and_then(http::Uri::host).unwrap_or_default();
        let is_local = host == "localhost"
            || host.trim_matches(['[', ']']).parse::<IpAddr>().is_ok_and(|address| address.is_loopback());
        let has_password =
            uri.as_ref().ok().and_then(http::Uri::authority).is_some_and(|name| name.as_str().contains('@'));
        if self.is_url() && has_password {
            // Not shown: it may hold a password.
            problems
                .push(("auth.jwt.jwks", "has a name before @: keys are public, and asked for without one".to_owned()));
        } else if self.is_url() && host.is_empty() {
            problems.push(("auth.jwt.jwks", format!("{:?} is no URL", self.jwks)));
        } else if self.jwks.starts_with("http://") && !is_local {
            let reason = "keys that come over a network without encryption prove nothing: use https, or a file";
            problems.push(("auth.jwt.jwks", reason.to_owned()));
        } else if self.jwks.starts_with("https://") && self.jwks_ca.is_none() {
            let reason = "must be set where auth.jwt.jwks is a URL of https, for example to the system's \
                          /etc/ssl/certs/ca-certificates.crt";
            problems.push(("auth.jwt.jwks_ca", reason.to_owned()));
        }
        problems
    }
}
