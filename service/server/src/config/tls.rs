//! Encryption of the ports.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Encryption of a port.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TlsConfig {
    /// File with the certificate chain, PEM.
    pub cert: PathBuf,
    /// File with the private key, PEM.
    pub key: PathBuf,
    /// File with the certificates that clients must be signed by, PEM; absent: clients are not asked for one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub client_ca: Option<PathBuf>,
    /// Whether a client that `client_ca` asks for a certificate may have none.
    #[serde(default)]
    pub client_certificates: ClientCertificates,
}

/// Whether clients need a certificate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClientCertificates {
    /// Who shows none is not connected.
    #[default]
    Required,
    /// Who shows none is a client without a certificate.
    Optional,
}
