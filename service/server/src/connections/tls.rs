//! Encryption of a port: certificates from files, taken over anew when the files change, and who shows one.

use std::fmt;
use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError, RwLock};

use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::WebPkiClientVerifier;
use rustls::{ClientConfig, RootCertStore, ServerConfig};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;
use x509_parser::certificate::X509Certificate;
use x509_parser::objects::{oid_registry, oid2abbrev};
use x509_parser::prelude::FromDer as _;
use x509_parser::x509::{AttributeTypeAndValue, RelativeDistinguishedName, X509Name};

use crate::config::{ClientCertificates, TlsConfig};

/// What the two versions of HTTP are called in a handshake.
const PROTOCOLS: [&[u8]; 2] = [b"h2", b"http/1.1"];

/// A certificate that a client has proved to have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PeerCertificate {
    /// Its subject, such as `CN=mill-3, O=plant`, with a backslash before what separates parts of it.
    pub(crate) subject: Arc<str>,
    /// The first common name in it; empty where there is none.
    pub(crate) common_name: Arc<str>,
}

impl PeerCertificate {
    /// What a certificate says; a text where it cannot be read.
    fn read(der: &CertificateDer<'_>) -> Result<Self, String> {
        let (_, certificate) = X509Certificate::from_der(der).map_err(|error| error.to_string())?;
        let subject = certificate.subject();
        let common_name = subject.iter_common_name().next().and_then(|name| name.as_str().ok()).unwrap_or_default();
        Ok(Self { subject: text_of(subject).into(), common_name: common_name.into() })
    }
}

/// A subject as a text that no other subject has: what separates its parts has a backslash before it where it is part of a
/// value.
fn text_of(subject: &X509Name<'_>) -> String {
    let part = |attribute: &AttributeTypeAndValue<'_>| {
        let kind = attribute.attr_type();
        let kind = oid2abbrev(kind, oid_registry()).map_or_else(|_| kind.to_id_string(), str::to_owned);
        let value = attribute.as_str().map_or_else(
            |_| attribute.as_slice().iter().fold("#".to_owned(), |hex, byte| hex + &format!("{byte:02x}")),
            |value| {
                let escaped = |letter: char| {
                    let separates = matches!(letter, ',' | '+' | '=' | '\\' | '#');
                    separates.then_some('\\').into_iter().chain(std::iter::once(letter))
                };
                value.chars().flat_map(escaped).collect()
            },
        );
        format!("{kind}={value}")
    };
    let name = |name: &RelativeDistinguishedName<'_>| name.iter().map(part).collect::<Vec<_>>().join(" + ");
    subject.iter().map(name).collect::<Vec<_>>().join(", ")
}

/// What is wrong with certificates: the configuration key and why.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {reason}")]
pub(crate) struct TlsError {
    pub(crate) key: String,
    pub(crate) reason: String,
}

/// The contents of the files.
#[derive(Clone, PartialEq, Eq)]
struct Contents {
    cert: Vec<u8>,
    key: Vec<u8>,
    client_ca: Option<Vec<u8>>,
}

/// Encryption with what the files say at the moment.
pub(crate) struct Tls {
    files: TlsConfig,
    /// The configuration key of the section.
    section: &'static str,
    config: RwLock<Arc<ServerConfig>>,
    /// What was read last, whether it could be used or not.
    seen: Mutex<Contents>,
}

impl fmt::Debug for Tls {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Tls").field("files", &self.files).finish_non_exhaustive()
    }
}

impl Tls {
    /// Reads the files of this section of the configuration.
    ///
    /// # Errors
    /// [`TlsError`] where one cannot be read or used.
    pub(crate) fn load(section: &'static str, files: &TlsConfig) -> Result<Arc<Self>, TlsError> {
        let contents = read(section, files)?;
        let config = RwLock::new(config(section, files, &contents)?);
        Ok(Arc::new(Self { files: files.clone(), section, config, seen: Mutex::new(contents) }))
    }

    /// Takes the files over where they have changed: whether they had. What cannot be used leaves everything as it was.
    ///
    /// # Errors
    /// [`TlsError`], once for each change.
    pub(crate) fn reload(&self) -> Result<bool, TlsError> {
        let contents = read(self.section, &self.files)?;
        {
            let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
            if *seen == contents {
                return Ok(false);
            }
            seen.clone_from(&contents);
        }
        let config = config(self.section, &self.files, &contents)?;
        *self.config.write().unwrap_or_else(PoisonError::into_inner) = config;
        Ok(true)
    }

    /// The handshake of a connection, and the certificate that the client showed.
    ///
    /// # Errors
    /// Those of the handshake.
    pub(crate) async fn accept<S>(&self, stream: S) -> io::Result<(TlsStream<S>, Option<PeerCertificate>)>
    where
        S: AsyncRead + AsyncWrite + Unpin,
    {
        let config = self.config.read().unwrap_or_else(PoisonError::into_inner).clone();
        let stream = TlsAcceptor::from(config).accept(stream).await?;
        let shown = stream.get_ref().1.peer_certificates().and_then(|chain| chain.first());
        let certificate = shown.map(PeerCertificate::read).transpose();
        Ok((stream, certificate.map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))?))
    }
}

fn read(section: &str, files: &TlsConfig) -> Result<Contents, TlsError> {
    let file = |key: &str, path: &Path| {
        std::fs::read(path).map_err(|error| TlsError {
            key: format!("{section}.{key}"),
            reason: format!("{}: {error}", path.display()),
        })
    };
    Ok(Contents {
        cert: file("cert", &files.cert)?,
        key: file("key", &files.key)?,
        client_ca: files.client_ca.as_deref().map(|path| file("client_ca", path)).transpose()?,
    })
}

fn config(section: &str, files: &TlsConfig, contents: &Contents) -> Result<Arc<ServerConfig>, TlsError> {
    let problem = |key: &str, path: &Path, reason: String| TlsError {
        key: format!("{section}.{key}"),
        reason: format!("{}: {reason}", path.display()),
    };
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let builder = ServerConfig::builder_with_provider(provider.clone())
        .with_safe_default_protocol_versions()
        .map_err(|error| TlsError { key: section.to_owned(), reason: error.to_string() })?;
    let builder = match (&contents.client_ca, &files.client_ca) {
        (Some(pem), Some(path)) => {
            let refused = |reason: String| problem("client_ca", path, reason);
            let mut roots = RootCertStore::empty();
            for certificate in certificates(pem).map_err(refused)? {
                roots.add(certificate).map_err(|error| refused(error.to_string()))?;
            }
            let verifier = WebPkiClientVerifier::builder_with_provider(roots.into(), provider);
            let verifier = match files.client_certificates {
                ClientCertificates::Required => verifier,
                ClientCertificates::Optional => verifier.allow_unauthenticated(),
            };
            builder.with_client_cert_verifier(verifier.build().map_err(|error| refused(error.to_string()))?)
        }
        _ => builder.with_no_client_auth(),
    };
    let chain = certificates(&contents.cert).map_err(|reason| problem("cert", &files.cert, reason))?;
    let key = PrivateKeyDer::from_pem_slice(&contents.key)
        .map_err(|error| problem("key", &files.key, format!("no private key can be read from it: {error}")))?;
    let mut config =
        builder.with_single_cert(chain, key).map_err(|error| problem("cert", &files.cert, error.to_string()))?;
    config.alpn_protocols = PROTOCOLS.map(<[u8]>::to_vec).to_vec();
    Ok(Arc::new(config))
}

/// Encryption of connections to a server whose certificate must be signed by one of the file `ca`; with the files of a certificate
/// chain and its key where it has to be shown who asks.
///
/// # Errors
/// [`TlsError`] with the key `ca`, `cert` or `key` of the section where a file cannot be read or used.
pub(crate) fn client_config(
    section: &str,
    ca: &Path,
    own: Option<(&Path, &Path)>,
) -> Result<Arc<ClientConfig>, TlsError> {
    let problem = |key: &str, path: &Path, reason: String| TlsError {
        key: format!("{section}.{key}"),
        reason: format!("{}: {reason}", path.display()),
    };
    let read = |key: &str, path: &Path| std::fs::read(path).map_err(|error| problem(key, path, error.to_string()));
    let mut roots = RootCertStore::empty();
    for certificate in certificates(&read("ca", ca)?).map_err(|reason| problem("ca", ca, reason))? {
        roots.add(certificate).map_err(|error| problem("ca", ca, error.to_string()))?;
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let builder = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(|error| TlsError { key: section.to_owned(), reason: error.to_string() })?
        .with_root_certificates(roots);
    let config = match own {
        None => builder.with_no_client_auth(),
        Some((cert, key)) => {
            let chain = certificates(&read("cert", cert)?).map_err(|reason| problem("cert", cert, reason))?;
            let private = PrivateKeyDer::from_pem_slice(&read("key", key)?)
                .map_err(|error| problem("key", key, format!("no private key can be read from it: {error}")))?;
            builder.with_client_auth_cert(chain, private).map_err(|error| problem("cert", cert, error.to_string()))?
        }
    };
    Ok(Arc::new(config))
}

/// The certificates of a file, at least one.
fn certificates(pem: &[u8]) -> Result<Vec<CertificateDer<'static>>, String> {
    let certificates: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(pem).collect();
    match certificates {
        Ok(certificates) if certificates.is_empty() => Err("it holds no certificate".to_owned()),
        Ok(certificates) => Ok(certificates),
        Err(error) => Err(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn certificate(names: &[(rcgen::DnType, &str)]) -> PeerCertificate {
        let mut params = rcgen::CertificateParams::default();
        params.distinguished_name = rcgen::DistinguishedName::new();
        for (kind, value) in names {
            params.distinguished_name.push(kind.clone(), *value);
        }
        let key = rcgen::KeyPair::generate().unwrap();
        PeerCertificate::read(params.self_signed(&key).unwrap().der()).unwrap()
    }

    /// Two subjects are never the same text, whatever an authority signs as a name.
    #[test]
    fn subjects_are_told_apart() {
        use rcgen::DnType::{CommonName, OrganizationName};
        let plain = certificate(&[(CommonName, "mill-3"), (OrganizationName, "plant")]);
        assert_eq!((&*plain.subject, &*plain.common_name), ("CN=mill-3, O=plant", "mill-3"));
        let pretended = certificate(&[(CommonName, "mill-3, O=plant")]);
        assert_eq!(&*pretended.subject, "CN=mill-3\\, O\\=plant");
        assert_eq!(&*certificate(&[(CommonName, "a\\, b+c#")]).subject, "CN=a\\\\\\, b\\+c\\#");
    }
}
