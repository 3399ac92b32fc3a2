//! Who clients are, and whether the service may be open to a network.

use std::net::SocketAddr;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::problems::Problem;
use super::{Config, JwtConfig};

/// Who clients are.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AuthConfig {
    /// File with the clients that are known by a token or a certificate, and their roles; absent: everybody may do
    /// everything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clients: Option<PathBuf>,
    /// Tokens of an identity provider; absent: none are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jwt: Option<JwtConfig>,
    /// Names by which clients on this computer reach the service besides localhost, where they need not say who they are:
    /// those of a proxy, for example.
    pub hosts: Vec<String>,
    /// Whether ports may be open to a network without encryption or without knowing clients.
    pub allow_insecure_network: bool,
}

impl AuthConfig {
    /// Whether clients have to say who they are.
    #[must_use]
    pub const fn knows_clients(&self) -> bool {
        self.clients.is_some() || self.jwt.is_some()
    }
}

impl Config {
    /// Ports that a network reaches without encryption or without clients having to say who they are, by key, with what is
    /// missing.
    pub(super) fn insecure_ports(&self) -> Vec<Problem> {
        if self.auth.allow_insecure_network {
            return Vec::new();
        }
        let open = |key: &'static str, address: SocketAddr, encrypted: bool| {
            let missing = match (encrypted, self.auth.knows_clients()) {
                (true, true) => return None,
                (false, true) => "without encryption (section tls)",
                (true, false) => "without knowing who clients are (auth.clients, auth.jwt)",
                (false, false) => {
                    "without encryption (section tls) and without knowing who clients are (auth.clients, auth.jwt)"
                }
            };
            if address.ip().to_canonical().is_loopback() {
                return None;
            }
            let how = "set what is missing, listen on 127.0.0.1, or permit it by auth.allow_insecure_network = true";
            Some((key, format!("{address} is open to a network {missing}: {how}")))
        };
        let ports = [
            open("grpc.listen", self.grpc.listen, self.grpc_tls().is_some()),
            open("http.listen", self.http.listen, self.http_tls().is_some()),
        ];
        ports.into_iter().flatten().collect()
    }
}
