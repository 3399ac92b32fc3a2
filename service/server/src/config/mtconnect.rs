//! The MTConnect agent.

use std::net::SocketAddr;

use feedwave_store::Tenant;
use serde::{Deserialize, Serialize};

use super::problems::{Problem, Range};

/// A read-only agent of MTConnect on a port of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MtConnectConfig {
    /// Address and port; port 0 takes a free one; absent: there is no agent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub listen: Option<SocketAddr>,
    /// Observations that are kept.
    pub buffer_size: usize,
    /// Streams open at once.
    pub streams: usize,
    /// The tenant whose runs are shown: its name; empty for the default one.
    pub tenant: String,
    /// Whether the port may be open to a network: its clients are not known, and nothing is encrypted.
    pub allow_insecure_network: bool,
}

impl Default for MtConnectConfig {
    fn default() -> Self {
        Self { listen: None, buffer_size: 1 << 17, streams: 64, tenant: String::new(), allow_insecure_network: false }
    }
}

impl MtConnectConfig {
    /// Each key with its value and the range that it must be in.
    pub(super) fn ranges(&self) -> [Range; 2] {
        [
            ("mtconnect.buffer_size", self.buffer_size as u64, 128, 1 << 24),
            ("mtconnect.streams", self.streams as u64, 1, 10_000),
        ]
    }

    /// The tenant whose runs are shown.
    pub(crate) fn tenant(&self) -> Tenant {
        // What is no name was refused with the configuration.
        self.tenant.parse().unwrap_or(Tenant::DEFAULT)
    }

    /// What is wrong with where it listens, and with whom it shows.
    pub(super) fn problems(&self) -> impl Iterator<Item = Problem> {
        let tenant = match self.tenant.as_str() {
            "" => None,
            name => name.parse::<Tenant>().err().map(|error| ("mtconnect.tenant", error.to_string())),
        };
        tenant.into_iter().chain(self.open_to_a_network().map(|reason| ("mtconnect.listen", reason)))
    }

    fn open_to_a_network(&self) -> Option<String> {
        let address = self.listen.filter(|address| !address.ip().to_canonical().is_loopback())?;
        (!self.allow_insecure_network).then(|| {
            format!(
                "{address} is open to a network, and clients of MTConnect neither encrypt nor say who they are: listen on \
                 127.0.0.1, or permit it by mtconnect.allow_insecure_network = true"
            )
        })
    }
}
