//! `feedwave healthcheck`: the probe of the container image, which has no shell and no other client.

use std::error::Error;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use tonic::transport::{Certificate, ClientTlsConfig, Endpoint, Identity};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;

use crate::args::GlobalArgs;
use crate::cli::CliError;
use crate::config::Overrides;

/// Flags of `feedwave healthcheck`.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// The service's URL; by default that of the configuration, on this machine
    #[arg(long, value_name = "URL")]
    server: Option<String>,
    /// Service to ask about, such as `feedwave.v1.Jobs`; by default the whole server
    #[arg(long, value_name = "NAME", default_value = "")]
    service: String,
    /// How long to wait for an answer, s
    #[arg(long, value_name = "SECONDS", default_value_t = 3)]
    timeout: u64,
    /// Certificates that the server must be signed by, PEM
    #[arg(long, value_name = "FILE")]
    ca: Option<PathBuf>,
    /// Client certificate, PEM
    #[arg(long, value_name = "FILE", requires = "key")]
    cert: Option<PathBuf>,
    /// Key of the client certificate, PEM
    #[arg(long, value_name = "FILE", requires = "cert")]
    key: Option<PathBuf>,
    /// Name that the server's certificate must have, where it differs from the URL's
    #[arg(long, value_name = "NAME")]
    domain: Option<String>,
}

/// Asks.
///
/// # Errors
/// [`CliError`] with exit code 1 when the service does not answer that it serves.
pub async fn run(args: Args, global: &GlobalArgs) -> Result<ExitCode, CliError> {
    let url = match &args.server {
        Some(url) => url.clone(),
        None => {
            let config = global.load(Overrides::default())?;
            let scheme = if config.grpc.tls.is_some() { "https" } else { "http" };
            format!("{scheme}://{}", reachable(config.grpc.listen))
        }
    };
    let timeout = Duration::from_secs(args.timeout);
    let mut endpoint = Endpoint::from_shared(url.clone()).map_err(|error| CliError::new(format!("{url}: {error}")))?;
    endpoint = endpoint.connect_timeout(timeout).timeout(timeout);
    if url.starts_with("https:") {
        endpoint = endpoint.tls_config(tls(&args)?).map_err(CliError::new)?;
    }
    let failed = |error: &dyn Error| CliError::new(format!("{url}: {}", chain(error)));
    let channel = endpoint.connect().await.map_err(|error| failed(&error))?;
    let request = HealthCheckRequest { service: args.service };
    let response = HealthClient::new(channel).check(request).await.map_err(|status| match status.source() {
        Some(cause) => failed(cause),
        None => CliError::new(format!("{url}: {}", status.message())),
    })?;
    let status = response.into_inner().status();
    if status == ServingStatus::Serving {
        Ok(ExitCode::SUCCESS)
    } else {
        Err(CliError::new(format!("{url}: {}", status.as_str_name())))
    }
}

/// An error and its causes: "transport error" alone tells nobody anything.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(&format!(": {error}"));
        cause = error.source();
    }
    text
}

fn tls(args: &Args) -> Result<ClientTlsConfig, CliError> {
    let read =
        |path: &PathBuf| std::fs::read(path).map_err(|error| CliError::new(format!("{}: {error}", path.display())));
    let mut tls = ClientTlsConfig::new();
    if let Some(ca) = &args.ca {
        tls = tls.ca_certificate(Certificate::from_pem(read(ca)?));
    }
    if let (Some(cert), Some(key)) = (&args.cert, &args.key) {
        tls = tls.identity(Identity::from_pem(read(cert)?, read(key)?));
    }
    Ok(match &args.domain {
        Some(domain) => tls.domain_name(domain),
        None => tls,
    })
}

/// An address to connect to: a server that listens everywhere listens on this machine.
fn reachable(listen: SocketAddr) -> SocketAddr {
    let loopback = match listen.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => IpAddr::V4(Ipv4Addr::LOCALHOST),
        IpAddr::V6(ip) if ip.is_unspecified() => IpAddr::V6(Ipv6Addr::LOCALHOST),
        ip => ip,
    };
    SocketAddr::new(loopback, listen.port())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_that_listens_everywhere_is_asked_on_this_machine() {
        assert_eq!(reachable("0.0.0.0:7".parse().unwrap()), "127.0.0.1:7".parse().unwrap());
        assert_eq!(reachable("[::]:7".parse().unwrap()), "[::1]:7".parse().unwrap());
        assert_eq!(reachable("10.1.2.3:7".parse().unwrap()), "10.1.2.3:7".parse().unwrap());
    }
}
