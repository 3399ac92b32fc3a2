//! Configuration of the service: defaults ← TOML file ← environment ← flags, later ones winning.
//!
//! Every key lives in a section. In the environment a key is `FEEDWAVE_<SECTION>__<KEY>`, for example
//! `FEEDWAVE_GRPC__LISTEN`; variables without the double underscore are not keys, so that the ones a
//! cluster sets for a service of this name do no harm. An unknown key, a wrong type and a value out of range are
//! refused with the place, the key and the reason.

mod auth;
mod connections;
mod cors;
mod jwt;
mod limits;
mod mqtt;
mod mtconnect;
mod problems;
mod retention;
mod sources;
mod store;
mod tls;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

pub use auth::AuthConfig;
pub use connections::ConnectionLimits;
pub use cors::CorsConfig;
pub use feedwave_store::{InvalidStoreUri, StoreUri};
pub use jwt::JwtConfig;
pub use limits::Limits;
pub(crate) use mqtt::Broker;
pub use mqtt::MqttConfig;
pub use mtconnect::MtConnectConfig;
use problems::Range;
pub use problems::{ConfigError, ConfigProblem};
pub use retention::RetentionConfig;
use serde::{Deserialize, Serialize};
pub use sources::Overrides;
pub use store::{DatabaseConfig, ObjectsConfig, StoreConfig};
pub use tls::{ClientCertificates, TlsConfig};

/// Exit code for configuration that cannot be used (`EX_CONFIG`).
pub const EXIT_CONFIG: u8 = 78;
/// Environment variables of this service start with it.
pub const ENV_PREFIX: &str = "FEEDWAVE_";

/// Everything that can be set.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// The gRPC port.
    pub grpc: GrpcConfig,
    /// The HTTP port.
    pub http: HttpConfig,
    /// Pages of other origins.
    pub cors: CorsConfig,
    /// The MTConnect agent.
    pub mtconnect: MtConnectConfig,
    /// The publisher to an MQTT broker.
    pub mqtt: MqttConfig,
    /// Encryption of both ports; absent: as `grpc.tls` says, and HTTP has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tls: Option<TlsConfig>,
    /// The store.
    pub store: StoreConfig,
    /// The former place of [`StoreConfig`].
    pub database: DatabaseConfig,
    /// Who clients are.
    pub auth: AuthConfig,
    /// Sizes and counts.
    pub limits: Limits,
    /// Bounds on connections and clients.
    pub connections: ConnectionLimits,
    /// How long records are kept.
    pub retention: RetentionConfig,
    /// The log.
    pub log: LogConfig,
    /// Export of traces.
    pub telemetry: TelemetryConfig,
    /// What `feedwave healthcheck` needs where the gRPC port is encrypted.
    pub healthcheck: HealthcheckConfig,
}

/// The gRPC port.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GrpcConfig {
    /// Address and port; port 0 takes a free one.
    pub listen: SocketAddr,
    /// Encryption of this port alone; absent: as the section `tls` says, or none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tls: Option<TlsConfig>,
}

impl Default for GrpcConfig {
    fn default() -> Self {
        Self { listen: SocketAddr::from(([127, 0, 0, 1], 50_051)), tls: None }
    }
}

/// The HTTP port: for dashboards, Prometheus, probes and the page.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HttpConfig {
    /// Address and port; port 0 takes a free one.
    pub listen: SocketAddr,
    /// How long a stream of events says nothing at most, s.
    pub heartbeat_s: u64,
}

impl Default for HttpConfig {
    fn default() -> Self {
        Self { listen: SocketAddr::from(([127, 0, 0, 1], 8_080)), heartbeat_s: 15 }
    }
}

impl HttpConfig {
    /// [`HttpConfig::heartbeat_s`]
    #[must_use]
    pub const fn heartbeat(&self) -> Duration {
        Duration::from_secs(self.heartbeat_s)
    }

    /// Each key with its value and the range that it must be in.
    const fn ranges(&self) -> [Range; 1] {
        [("http.heartbeat_s", self.heartbeat_s, 1, 300)]
    }
}

/// Form of the log lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// For people.
    #[default]
    Text,
    /// One JSON object per line.
    Json,
}

/// The log, written to standard error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LogConfig {
    /// Form of the lines.
    pub format: LogFormat,
    /// Level, or directives such as `info,feedwave=debug`.
    pub level: String,
}

impl Default for LogConfig {
    fn default() -> Self {
        Self { format: LogFormat::Text, level: "info".to_owned() }
    }
}

/// Export of traces by OpenTelemetry.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TelemetryConfig {
    /// OTLP endpoint over gRPC, such as `http://collector:4317`; absent: nothing is exported.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub otlp_endpoint: Option<String>,
}

/// What `feedwave healthcheck` needs where the gRPC port is encrypted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HealthcheckConfig {
    /// File with the certificates that the server must be signed by, PEM; absent: those that the service shows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ca: Option<PathBuf>,
    /// File with the certificate chain of the client, PEM; absent: none is shown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cert: Option<PathBuf>,
    /// File with the key of the client's certificate, PEM.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub key: Option<PathBuf>,
    /// Name that the server's certificate must have; absent: the address that is asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub domain: Option<String>,
}

impl Config {
    /// Encryption of the gRPC port, and the section that says so.
    #[must_use]
    pub fn grpc_tls(&self) -> Option<(&'static str, &TlsConfig)> {
        let own = self.grpc.tls.as_ref().map(|tls| ("grpc.tls", tls));
        own.or_else(|| self.http_tls())
    }

    /// Encryption of the HTTP port, and the section that says so.
    #[must_use]
    pub fn http_tls(&self) -> Option<(&'static str, &TlsConfig)> {
        self.tls.as_ref().map(|tls| ("tls", tls))
    }
}

#[cfg(test)]
mod tests;
