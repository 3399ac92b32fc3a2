//! Asks an identity provider for its keys: one GET, bounded in time and size, without redirects.

use std::path::Path;
use std::time::Duration;

use bytes::Bytes;
use http::{Request, StatusCode, Uri, header};
use http_body_util::{BodyExt as _, Empty, Limited};
use hyper_util::rt::TokioIo;
use rustls::pki_types::ServerName;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;

use crate::connections::client_config;

/// How long it may take in all.
pub(super) const TIMEOUT: Duration = Duration::from_secs(5);
/// Largest answer, bytes.
pub(super) const MAX_BYTES: usize = 256 << 10;

/// Where keys are asked for.
pub(super) struct Endpoint {
    uri: Uri,
    host: String,
    port: u16,
    tls: Option<TlsConnector>,
}

impl Endpoint {
    /// An endpoint; one of https must have a certificate that is signed by one of `ca`.
    ///
    /// # Errors
    /// What is wrong with either.
    pub(super) fn new(url: &str, ca: Option<&Path>) -> Result<Self, String> {
        let uri: Uri = url.parse().map_err(|error| format!("{url:?} is no URL: {error}"))?;
        let host = uri.host().ok_or_else(|| format!("{url:?} names no host"))?.to_owned();
        let is_https = uri.scheme_str() == Some("https");
        let port = uri.port_u16().unwrap_or(if is_https { 443 } else { 80 });
        let tls = match (is_https, ca) {
            (true, Some(ca)) => {
                let config = client_config("auth.jwt", ca, None).map_err(|error| error.reason)?;
                Some(TlsConnector::from(config))
            }
            (true, None) => return Err("https needs the certificates that the provider's is signed by".to_owned()),
            (false, _) => None,
        };
        Ok(Self { host: host.trim_matches(['[', ']']).to_owned(), uri, port, tls })
    }

    /// The answer.
    ///
    /// # Errors
    /// Why there is none.
    pub(super) async fn get(&self) -> Result<Bytes, String> {
        let answer = tokio::time::timeout(TIMEOUT, self.ask()).await;
        answer.unwrap_or_else(|_| Err(format!("no answer within {} s", TIMEOUT.as_secs())))
    }

    async fn ask(&self) -> Result<Bytes, String> {
        let stream = TcpStream::connect((self.host.as_str(), self.port)).await.map_err(|error| error.to_string())?;
        match &self.tls {
            None => self.ask_over(stream).await,
            Some(tls) => {
                let name = ServerName::try_from(self.host.clone()).map_err(|error| error.to_string())?;
                self.ask_over(tls.connect(name, stream).await.map_err(|error| error.to_string())?).await
            }
        }
    }

    async fn ask_over(&self, stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static) -> Result<Bytes, String> {
        let failed = |error: &dyn std::error::Error| error.to_string();
        let (mut sender, connection) =
            hyper::client::conn::http1::handshake(TokioIo::new(stream)).await.map_err(|error| failed(&error))?;
        let exchange = async {
            let path = self.uri.path_and_query().map_or("/", |path| path.as_str());
            let authority = self.uri.authority().map_or(self.host.as_str(), |authority| authority.as_str());
            // A name and a password in the URL are for nobody.
            let host = authority.rsplit_once('@').map_or(authority, |(_, host)| host);
            let request = Request::get(path)
                .header(header::HOST, host)
                .header(header::ACCEPT, "application/json")
                .header(header::CONNECTION, "close")
                .body(Empty::<Bytes>::new())
                .map_err(|error| failed(&error))?;
            let response = sender.send_request(request).await.map_err(|error| failed(&error))?;
            if response.status() != StatusCode::OK {
                return Err(format!("the answer is {}", response.status()));
            }
            let body = Limited::new(response.into_body(), MAX_BYTES).collect().await;
            body.map(http_body_util::Collected::to_bytes).map_err(|error| error.to_string())
        };
        // The connection lives as long as somebody waits for the answer.
        let mut exchange = std::pin::pin!(exchange);
        tokio::select! {
            answer = exchange.as_mut() => answer,
            _ = connection => exchange.await,
        }
    }
}
