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
mod mtconnect;
mod tls;

use std::fmt;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

pub use auth::AuthConfig;
pub use connections::ConnectionLimits;
pub use cors::CorsConfig;
use feedwave_contract::MAX_MESSAGE_BYTES;
pub use feedwave_store::{InvalidStoreUri, StoreUri};
use figment::Figment;
use figment::providers::{Env, Format, Serialized, Toml};
use figment::value::Value;
pub use jwt::JwtConfig;
pub use mtconnect::MtConnectConfig;
use serde::{Deserialize, Serialize};
pub use tls::{ClientCertificates, TlsConfig};

/// Exit code for configuration that cannot be used (`EX_CONFIG`).
pub const EXIT_CONFIG: u8 = 78;
/// Environment variables of this service start with it.
pub const ENV_PREFIX: &str = "FEEDWAVE_";

/// The file of the store where none is named, in the working directory.
const DEFAULT_STORE_FILE: &str = "feedwave.db";

/// Everything that can be set.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// The gRPC port.
    pub grpc: GrpcConfig,
    /// The read-only HTTP port.
    pub http: HttpConfig,
    /// Pages of other origins.
    pub cors: CorsConfig,
    /// The MTConnect agent.
    pub mtconnect: MtConnectConfig,
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

/// The read-only HTTP port.
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
}

/// The store: jobs, programs, reports, machines, tools and runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StoreConfig {
    /// Where it is kept; absent: the file `feedwave.db` in the working directory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uri: Option<StoreUri>,
    /// Name of this replica among those that share the store.
    pub replica_name: String,
}

impl StoreConfig {
    /// The store in this file, relative to the working directory where the path is relative.
    ///
    /// # Errors
    /// [`InvalidStoreUri`] if the path is empty.
    pub fn of_file(path: &Path) -> Result<Self, InvalidStoreUri> {
        StoreUri::of_file(path).map(|uri| Self { uri: Some(uri), ..Self::default() })
    }
}

/// What named the store before `store.uri` did; still read.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DatabaseConfig {
    /// File of the store.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
}

/// Sizes and counts that bound what clients can ask for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Largest program sent inline, bytes.
    pub inline_program_bytes: u64,
    /// Largest uploaded program, bytes.
    pub upload_bytes: u64,
    /// Unfinished uploads kept at a time.
    pub unfinished_uploads: u32,
    /// Of these most of one client.
    pub unfinished_uploads_per_client: u32,
    /// How long an unfinished upload is kept to which nothing comes, s.
    pub upload_expiry_s: u64,
    /// Largest request message, bytes.
    pub message_bytes: usize,
    /// Calls in progress at once, streams included.
    pub concurrent_requests: usize,
    /// Setpoint streams open at once.
    pub concurrent_streams: usize,
    /// Runs in progress at once, live ones and those of telemetry only.
    pub concurrent_runs: usize,
    /// How long a live run waits for the client's receipt of setpoints that were sent, s: then its stream ends, and the run can
    /// be taken up.
    pub receipt_s: u64,
    /// Streams that one connection may have open at once.
    pub streams_per_connection: u32,
    /// Programs validated at once.
    pub validation_workers: usize,
    /// How long a validation computes while others wait, ms: then it is another one's turn.
    pub validation_turn_ms: u64,
    /// Validations that keep what they have done between their turns; one client has at most half of them.
    pub begun_validations: usize,
    /// Attempts to validate a job that may end with the service; then the job has failed.
    pub validation_attempts: u32,
    /// How long open calls may take to finish when the service ends, and clients to read the rest of a connection that is
    /// closed, s.
    pub drain_s: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            inline_program_bytes: 1 << 20,
            upload_bytes: 2 << 30,
            unfinished_uploads: 256,
            unfinished_uploads_per_client: 64,
            upload_expiry_s: 86_400,
            message_bytes: 4 << 20,
            concurrent_requests: 1_024,
            concurrent_streams: 64,
            concurrent_runs: 64,
            receipt_s: 3_600,
            streams_per_connection: 128,
            validation_workers: std::thread::available_parallelism()
                .map_or(2, |cores| cores.get().saturating_sub(1).max(2)),
            validation_turn_ms: 200,
            begun_validations: 16,
            validation_attempts: 3,
            drain_s: 10,
        }
    }
}

impl Limits {
    /// [`Limits::validation_turn_ms`]
    #[must_use]
    pub const fn validation_turn(&self) -> Duration {
        Duration::from_millis(self.validation_turn_ms)
    }

    /// [`Limits::receipt_s`]
    #[must_use]
    pub const fn receipt_patience(&self) -> Duration {
        Duration::from_secs(self.receipt_s)
    }

    /// [`Limits::drain_s`]
    #[must_use]
    pub const fn drain(&self) -> Duration {
        Duration::from_secs(self.drain_s)
    }
}

/// How long records are kept; absent keys: for ever.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RetentionConfig {
    /// Jobs that have ended, with their reports and runs, since their last change, days.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jobs_days: Option<u32>,
    /// Runs that have ended, with their decisions, days.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub runs_days: Option<u32>,
    /// Programs that no job uses, days.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub programs_days: Option<u32>,
    /// Events of jobs, days.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub events_days: Option<u32>,
    /// Entries of the audit log, days.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub audit_days: Option<u32>,
    /// Most entries of the audit log: the oldest ones go first.
    pub audit_entries: u64,
    /// Bytes in use within the store: beyond, the oldest jobs that have ended go.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_bytes: Option<u64>,
    /// Only says what would be removed.
    pub dry_run: bool,
}

impl Default for RetentionConfig {
    fn default() -> Self {
        Self {
            jobs_days: None,
            runs_days: None,
            programs_days: None,
            events_days: None,
            audit_days: None,
            audit_entries: 1_000_000,
            max_bytes: None,
            dry_run: false,
        }
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

/// One thing that makes configuration unusable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigProblem {
    /// Where it was set: a file, an environment variable, a flag.
    pub place: String,
    /// Its key, such as `grpc.listen`; empty where the problem is with the whole place.
    pub key: String,
    /// What is wrong with it.
    pub reason: String,
}

/// Configuration that cannot be used, with everything that is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigError(pub Vec<ConfigProblem>);

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.0.iter().enumerate() {
            if index > 0 {
                f.write_str("\n")?;
            }
            write!(f, "{}: ", problem.place)?;
            if !problem.key.is_empty() {
                write!(f, "{}: ", problem.key)?;
            }
            f.write_str(&problem.reason)?;
        }
        Ok(())
    }
}

impl std::error::Error for ConfigError {}

/// Values from flags, by key; absent ones are skipped.
#[derive(Clone, Debug, Default)]
pub struct Overrides(Vec<(&'static str, Value)>);

impl Overrides {
    /// Sets a key where the flag was given.
    #[must_use]
    pub fn set(mut self, key: &'static str, value: Option<impl Into<Value>>) -> Self {
        self.0.extend(value.map(|value| (key, value.into())));
        self
    }
}

impl Config {
    /// Reads configuration from everywhere and checks it.
    ///
    /// # Errors
    /// [`ConfigError`] with every problem found.
    pub fn load(file: Option<&Path>, flags: &Overrides) -> Result<Self, ConfigError> {
        let mut figment = Figment::from(Serialized::defaults(Self::default()));
        if let Some(path) = file {
            if !path.is_file() {
                let reason = "there is no such file".to_owned();
                return Err(ConfigError(vec![ConfigProblem {
                    place: path.display().to_string(),
                    key: String::new(),
                    reason,
                }]));
            }
            figment = figment.merge(Toml::file_exact(path));
        }
        figment = figment.merge(Env::prefixed(ENV_PREFIX).filter(|key| key.as_str().contains("__")).split("__"));
        for (key, value) in &flags.0 {
            figment = figment.merge(Flag { key, value });
        }
        let config: Self = figment.extract().map_err(|errors| {
            let problem = |error: figment::Error| {
                let key = key_of(&error);
                ConfigProblem { place: place_of(error.metadata.as_ref(), &key), key, reason: reason_of(&error.kind) }
            };
            ConfigError(errors.into_iter().map(problem).collect())
        })?;
        let problems: Vec<ConfigProblem> = config
            .problems()
            .into_iter()
            .map(|(key, reason)| {
                let place = place_of(figment.find_metadata(key), key);
                ConfigProblem { place, key: key.to_owned(), reason }
            })
            .collect();
        if problems.is_empty() { Ok(config) } else { Err(ConfigError(problems)) }
    }

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

    /// Where the store is kept.
    ///
    /// # Errors
    /// The key and what is wrong with it, where `store.uri` and `database.path` name different stores or none.
    pub fn store_uri(&self) -> Result<StoreUri, (&'static str, String)> {
        let file = self.database.path.as_deref();
        match (&self.store.uri, file) {
            (Some(uri), None) => Ok(uri.clone()),
            (uri, file) => {
                let file = StoreUri::of_file(file.unwrap_or(Path::new(DEFAULT_STORE_FILE)))
                    .map_err(|error| ("database.path", error.to_string()))?;
                match uri {
                    Some(uri) if uri.file() != file.file() => {
                        let reason = format!("names another store than store.uri ({uri}): keep store.uri alone");
                        Err(("database.path", reason))
                    }
                    Some(uri) => Ok(uri.clone()),
                    None => Ok(file),
                }
            }
        }
    }

    /// What is still read but should be written otherwise, in words for the log.
    #[must_use]
    pub fn deprecations(&self) -> Vec<String> {
        let uri = self.database.path.as_ref().and_then(|_| self.store_uri().ok());
        uri.map(|uri| format!("database.path is the former name of store.uri: set store.uri to {uri} in its stead"))
            .into_iter()
            .collect()
    }

    /// Values of the right type that still cannot be used, by key.
    fn problems(&self) -> Vec<(&'static str, String)> {
        let limits = &self.limits;
        let mut problems = Vec::new();
        let mut range = |key, value: u64, low: u64, high: u64| {
            if !(low..=high).contains(&value) {
                problems.push((key, format!("must be {low} to {high}, is {value}")));
            }
        };
        let message_bytes = limits.message_bytes as u64;
        range("limits.message_bytes", message_bytes, 64 << 10, MAX_MESSAGE_BYTES as u64);
        // What surrounds an inline program in its message counts too.
        range("limits.inline_program_bytes", limits.inline_program_bytes, 1, message_bytes.saturating_sub(32 << 10));
        range("limits.upload_bytes", limits.upload_bytes, 1, 1 << 40);
        range("limits.unfinished_uploads", limits.unfinished_uploads.into(), 1, 100_000);
        range("limits.unfinished_uploads_per_client", limits.unfinished_uploads_per_client.into(), 1, 100_000);
        range("limits.upload_expiry_s", limits.upload_expiry_s, 1, 31_536_000);
        range("limits.concurrent_requests", limits.concurrent_requests as u64, 1, 1_000_000);
        range("limits.concurrent_streams", limits.concurrent_streams as u64, 1, 10_000);
        range("limits.concurrent_runs", limits.concurrent_runs as u64, 1, 10_000);
        range("limits.receipt_s", limits.receipt_s, 1, 31_536_000);
        range("limits.streams_per_connection", u64::from(limits.streams_per_connection), 1, 100_000);
        range("limits.validation_workers", limits.validation_workers as u64, 1, 1_024);
        range("limits.validation_turn_ms", limits.validation_turn_ms, 1, 60_000);
        range("limits.begun_validations", limits.begun_validations as u64, 1, 1_024);
        range("limits.validation_attempts", limits.validation_attempts.into(), 1, 1_000);
        range("limits.drain_s", limits.drain_s, 0, 3_600);
        range("retention.audit_entries", self.retention.audit_entries, 1_000, 1_000_000_000);
        range("http.heartbeat_s", self.http.heartbeat_s, 1, 300);
        for (key, value, low, high) in self.connections.ranges(message_bytes).into_iter().chain(self.mtconnect.ranges())
        {
            range(key, value, low, high);
        }
        if let Some(jwt) = &self.auth.jwt {
            for (key, value, low, high) in jwt.ranges() {
                range(key, value, low, high);
            }
            problems.extend(jwt.problems());
        }
        problems.extend(self.mtconnect.problems());
        problems.extend(self.cors.problem().map(|reason| ("cors.origins", reason)));
        if let Err(problem) = self.store_uri() {
            problems.push(problem);
        }
        if let Err(error) = tracing_subscriber::EnvFilter::try_new(&self.log.level) {
            problems.push(("log.level", error.to_string()));
        }
        if let Some(endpoint) = &self.telemetry.otlp_endpoint {
            let valid = endpoint.parse::<http::Uri>().is_ok_and(|uri| uri.scheme().is_some() && uri.host().is_some());
            if !valid {
                problems.push(("telemetry.otlp_endpoint", format!("must be a URL with a scheme, is {endpoint:?}")));
            }
        }
        let (own, tls, probe) = (self.grpc.tls.as_ref(), self.tls.as_ref(), &self.healthcheck);
        problems.extend(self.insecure_ports());
        if own.is_some() && tls.is_some() {
            problems.push(("grpc.tls", "the section tls encrypts both ports already: keep one of them".to_owned()));
        }
        let files = [
            ("auth.clients", self.auth.clients.as_ref()),
            ("auth.jwt.jwks_ca", self.auth.jwt.as_ref().and_then(|jwt| jwt.jwks_ca.as_ref())),
            ("tls.cert", tls.map(|tls| &tls.cert)),
            ("tls.key", tls.map(|tls| &tls.key)),
            ("tls.client_ca", tls.and_then(|tls| tls.client_ca.as_ref())),
            ("grpc.tls.cert", own.map(|tls| &tls.cert)),
            ("grpc.tls.key", own.map(|tls| &tls.key)),
            ("grpc.tls.client_ca", own.and_then(|tls| tls.client_ca.as_ref())),
            ("healthcheck.ca", probe.ca.as_ref()),
            ("healthcheck.cert", probe.cert.as_ref()),
            ("healthcheck.key", probe.key.as_ref()),
        ];
        for (key, path) in files {
            if let Some((path, error)) = path.and_then(|path| std::fs::File::open(path).err().map(|e| (path, e))) {
                problems.push((key, format!("{}: {error}", path.display())));
            }
        }
        match (&probe.cert, &probe.key) {
            (Some(_), None) => problems.push(("healthcheck.cert", "needs healthcheck.key".to_owned())),
            (None, Some(_)) => problems.push(("healthcheck.key", "needs healthcheck.cert".to_owned())),
            _ => {}
        }
        problems
    }
}

/// One flag as a source of configuration.
struct Flag<'a> {
    key: &'a str,
    value: &'a Value,
}

impl figment::Provider for Flag<'_> {
    fn metadata(&self) -> figment::Metadata {
        figment::Metadata::named("command line")
    }

    fn data(&self) -> Result<figment::value::Map<figment::Profile, figment::value::Dict>, figment::Error> {
        let nested = figment::util::nest(self.key, self.value.clone());
        let dict = nested.into_dict().unwrap_or_default();
        Ok(figment::value::Map::from([(figment::Profile::Default, dict)]))
    }
}

fn place_of(metadata: Option<&figment::Metadata>, key: &str) -> String {
    match metadata {
        Some(figment::Metadata { source: Some(figment::Source::File(path)), .. }) => path.display().to_string(),
        Some(metadata) if metadata.name.contains("environment") => {
            format!("environment variable {ENV_PREFIX}{}", key.to_ascii_uppercase().replace('.', "__"))
        }
        Some(metadata) => metadata.name.to_string(),
        None => "configuration".to_owned(),
    }
}

fn reason_of(kind: &figment::error::Kind) -> String {
    match kind {
        figment::error::Kind::UnknownField(_, known) => format!("unknown key, known are {}", known.join(", ")),
        kind => kind.to_string(),
    }
}

/// The key that an error is about. An unknown field is named by the error's kind, not by its path.
fn key_of(error: &figment::Error) -> String {
    let mut path = error.path.clone();
    if let figment::error::Kind::UnknownField(field, _) = &error.kind
        && path.last() != Some(field)
    {
        path.push(field.clone());
    }
    path.join(".")
}

#[cfg(test)]
mod tests;
