//! `feedwave healthcheck`: the probe of the container image, which has no shell and no other client.

use std::error::Error;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::process::ExitCode;
use std::time::Duration;

use feedwave_server::config::{ClientCertificates, Config, Overrides};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;

use crate::args::GlobalArgs;
use crate::client_tls::{ClientTls, chain};
use crate::commands::CliError;

/// Flags of `feedwave healthcheck`.
#[derive(Clone, Debug, clap::Args)]
#[command(
    after_long_help = "Exit codes: 0 it serves, 1 it does not, or does not answer, 2 wrong usage, 78 the configuration cannot be used."
)]
pub struct Args {
    /// The service's URL; by default that of the configuration, on this machine
    #[arg(long, value_name = "URL")]
    server: Option<String>,
    /// Service to ask about, such as `feedwave.v1.Jobs`; `liveness`: whether the process answers, whatever its store does;
    /// by default the whole server
    #[arg(long, value_name = "NAME", default_value = "")]
    service: String,
    /// How long to wait for an answer, s
    #[arg(long, value_name = "SECONDS", default_value_t = 3)]
    timeout: u64,
    #[command(flatten)]
    tls: ClientTls,
}

/// Asks.
///
/// # Errors
/// [`CliError`] with exit code 1 when the service is not serving, 2 when it cannot be asked so.
pub async fn run(args: Args, global: &GlobalArgs) -> Result<ExitCode, CliError> {
    let config = global.load(Overrides::default())?;
    let url = args.server.clone().unwrap_or_else(|| {
        let scheme = if config.grpc_tls().is_some() { "https" } else { "http" };
        format!("{scheme}://{}", reachable(config.grpc.listen))
    });
    let timeout = Duration::from_secs(args.timeout);
    let options = if url.starts_with("https:") {
        let tls = tls(args.tls, &config);
        let asked = args.server.is_none()
            && config.grpc_tls().is_some_and(|(_, tls)| {
                tls.client_ca.is_some() && tls.client_certificates == ClientCertificates::Required
            });
        if asked && tls.cert.is_none() {
            return Err(CliError::new(
                "client_ca of tls or grpc.tls asks clients for a certificate: set healthcheck.cert and healthcheck.key",
            ));
        }
        tls
    } else {
        args.tls
    };
    let endpoint = options.endpoint(&url)?.connect_timeout(timeout).timeout(timeout);
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

/// What the flags say, then the section `healthcheck`; by default the server must show what it is configured with.
fn tls(flags: ClientTls, config: &Config) -> ClientTls {
    let probe = config.healthcheck.clone();
    let own = || config.grpc_tls().map(|(_, tls)| tls.cert.clone());
    // A certificate and a key belong together, wherever they come from.
    let (cert, key) = if flags.cert.is_some() { (flags.cert, flags.key) } else { (probe.cert, probe.key) };
    ClientTls { ca: flags.ca.or(probe.ca).or_else(own), cert, key, domain: flags.domain.or(probe.domain) }
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
    use feedwave_server::config::{HealthcheckConfig, TlsConfig};

    use super::*;

    #[test]
    fn flags_win_over_configuration_and_the_own_certificates_are_trusted_without_either() {
        let mut config = Config::default();
        config.grpc.tls = Some(TlsConfig { cert: "own".into(), key: "own.key".into(), ..TlsConfig::default() });
        assert_eq!(tls(ClientTls::default(), &config).ca, Some("own".into()));

        config.healthcheck = HealthcheckConfig {
            ca: Some("ca".into()),
            cert: Some("cert".into()),
            key: Some("key".into()),
            domain: Some("feedwave.plant".to_owned()),
        };
        let configured = tls(ClientTls::default(), &config);
        assert_eq!((configured.ca, configured.domain.as_deref()), (Some("ca".into()), Some("feedwave.plant")));
        assert_eq!((configured.cert, configured.key), (Some("cert".into()), Some("key".into())));

        let flags = ClientTls { cert: Some("a".into()), key: Some("b".into()), ..ClientTls::default() };
        let both = tls(flags, &config);
        assert_eq!((both.ca, both.cert, both.key), (Some("ca".into()), Some("a".into()), Some("b".into())));
    }

    #[test]
    fn a_server_that_listens_everywhere_is_asked_on_this_machine() {
        assert_eq!(reachable("0.0.0.0:7".parse().unwrap()), "127.0.0.1:7".parse().unwrap());
        assert_eq!(reachable("[::]:7".parse().unwrap()), "[::1]:7".parse().unwrap());
        assert_eq!(reachable("10.1.2.3:7".parse().unwrap()), "10.1.2.3:7".parse().unwrap());
    }
}
