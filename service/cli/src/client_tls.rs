//! The client's side of encryption: certificates to trust, a certificate of its own, and errors with their causes.

use std::error::Error;
use std::path::{Path, PathBuf};

use tonic::transport::{Certificate, ClientTlsConfig, Endpoint, Identity};

use crate::commands::CliError;

/// Options of a client of an encrypted port.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct ClientTls {
    /// Certificates that the server must be signed by, PEM
    #[arg(long, value_name = "FILE", env = "FEEDWAVE_CA")]
    pub(crate) ca: Option<PathBuf>,
    /// Client certificate, PEM
    #[arg(long, value_name = "FILE", requires = "key", env = "FEEDWAVE_CERT")]
    pub(crate) cert: Option<PathBuf>,
    /// Key of the client certificate, PEM
    #[arg(long, value_name = "FILE", requires = "cert", env = "FEEDWAVE_KEY")]
    pub(crate) key: Option<PathBuf>,
    /// Name that the server's certificate must have, where it differs from the URL's
    #[arg(long, value_name = "NAME", env = "FEEDWAVE_DOMAIN")]
    pub(crate) domain: Option<String>,
}

impl ClientTls {
    /// Where a URL leads, encrypted as it says.
    pub(crate) fn endpoint(&self, url: &str) -> Result<Endpoint, CliError> {
        let failed = |error: &dyn Error| CliError::trouble(format!("{url}: {}", chain(error)));
        let scheme = url.split_once("://").map(|(scheme, _)| scheme.to_ascii_lowercase());
        let is_encrypted = match scheme.as_deref() {
            Some("https") => true,
            Some("http") => false,
            _ => return Err(CliError::trouble(format!("{url}: is no URL such as http://127.0.0.1:50051"))),
        };
        let is_asked = [&self.ca, &self.cert, &self.key].iter().any(|file| file.is_some()) || self.domain.is_some();
        if is_asked && !is_encrypted {
            let options = "--ca, --cert, --key and --domain (FEEDWAVE_CA and so on) are of https:// URLs";
            return Err(CliError::trouble(format!("{url}: would not be encrypted: {options}")));
        }
        let endpoint = Endpoint::from_shared(url.to_owned()).map_err(|error| failed(&error))?;
        if is_encrypted { endpoint.tls_config(self.config()?).map_err(|error| failed(&error)) } else { Ok(endpoint) }
    }

    /// The same for a connection.
    fn config(&self) -> Result<ClientTlsConfig, CliError> {
        let read = |path: &Path| std::fs::read(path).map_err(|error| CliError::file(path, &error));
        let mut tls = ClientTlsConfig::new();
        if let Some(ca) = &self.ca {
            tls = tls.ca_certificate(Certificate::from_pem(read(ca)?));
        }
        if let (Some(cert), Some(key)) = (&self.cert, &self.key) {
            tls = tls.identity(Identity::from_pem(read(cert)?, read(key)?));
        }
        Ok(match &self.domain {
            Some(domain) => tls.domain_name(domain),
            None => tls,
        })
    }
}

/// An error and its causes: "transport error" alone explains nothing.
pub(crate) fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        let cause_text = cause.to_string();
        if !text.ends_with(&cause_text) {
            text = format!("{text}: {cause_text}");
        }
        source = cause.source();
    }
    text
}
