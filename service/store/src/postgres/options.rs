//! What the URI of a PostgreSQL store says.

use std::fmt;
use std::net::IpAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use percent_encoding::percent_decode_str;
use sqlx::ConnectOptions as _;
use sqlx::postgres::{PgConnectOptions, PgSslMode};
use url::Url;

use crate::error::{Result, StoreError};
use crate::uri::{InvalidStoreUri, number};

/// Schemes of the URI; both mean the same.
pub(crate) const SCHEMES: [&str; 2] = ["postgres", "postgresql"];
/// A URI as it should be.
pub(crate) const EXAMPLE: &str = "postgres://feedwave@db.plant.example/feedwave";
/// Options of the URI.
const OPTIONS: &str = "host, user, sslmode, sslrootcert, sslcert, sslkey, password_file, connections, connect_timeout_s, statement_timeout_s, \
    application_name";

/// Port where the URI names none.
const PORT: u16 = 5432;

/// A database on a server and how it is used.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct PostgresOptions {
    /// Name or address of the server, or the folder of its socket.
    host: String,
    port: u16,
    user: String,
    password: Option<String>,
    /// A file with the password.
    password_file: Option<PathBuf>,
    /// The database.
    pub(super) database: String,
    encryption: Encryption,
    root_certificate: Option<PathBuf>,
    certificate: Option<PathBuf>,
    key: Option<PathBuf>,
    application_name: String,
    /// Most connections for reads and single writes; seven more write the logs and follow them.
    pub(super) connections: u32,
    /// How long to wait for the server or for a free connection, also while the server restarts.
    pub(super) connect_timeout: Duration,
    /// After which a statement is given up.
    pub(super) statement_timeout: Duration,
}

/// How the connection is encrypted: `sslmode`. Modes that fall back to no encryption without a word are not offered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encryption {
    Disable,
    Require,
    VerifyCa,
    VerifyFull,
}

impl Encryption {
    const NAMES: [(&str, Self); 4] = [
        ("disable", Self::Disable),
        ("require", Self::Require),
        ("verify-ca", Self::VerifyCa),
        ("verify-full", Self::VerifyFull),
    ];

    fn of(name: &str) -> Result<Self, InvalidStoreUri> {
        let known = Self::NAMES.into_iter().find(|(known, _)| *known == name);
        known.map(|(_, mode)| mode).ok_or_else(|| {
            let names = Self::NAMES.map(|(name, _)| name).join(", ");
            InvalidStoreUri::new(format!("sslmode must be one of {names}, is {name:?}"))
        })
    }

    const fn mode(self) -> PgSslMode {
        match self {
            Self::Disable => PgSslMode::Disable,
            Self::Require => PgSslMode::Require,
            Self::VerifyCa => PgSslMode::VerifyCa,
            Self::VerifyFull => PgSslMode::VerifyFull,
        }
    }
}

impl fmt::Debug for PostgresOptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { host, port, user, database, encryption, .. } = self;
        write!(f, "PostgresOptions({user}@{host}:{port}/{database}, {encryption:?})")
    }
}

/// A part of the URI as text.
fn decoded(what: &str, part: &str) -> Result<String, InvalidStoreUri> {
    let text = percent_decode_str(part).decode_utf8();
    let text = text.map_err(|_| InvalidStoreUri::new(format!("the {what} is not UTF-8")))?;
    if text.contains('\0') {
        return Err(InvalidStoreUri::new(format!("the {what} has a %00")));
    }
    Ok(text.into_owned())
}

/// Whether a host is this machine, to which nothing listens in between.
fn is_local(host: &str) -> bool {
    let address = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
    host.starts_with('/') || host == "localhost" || address.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

impl PostgresOptions {
    /// What a URI with one of these schemes says.
    pub(crate) fn from_url(url: &Url) -> Result<Self, InvalidStoreUri> {
        if url.fragment().is_some() {
            return Err(InvalidStoreUri::new("a # is written %23"));
        }
        let database = decoded("name of the database", url.path().strip_prefix('/').unwrap_or_default())?;
        if database.is_empty() || database.contains('/') {
            return Err(InvalidStoreUri::new(format!("its path is not the name of a database, as in {EXAMPLE}")));
        }
        let mut options = Self {
            host: decoded("host", url.host_str().unwrap_or_default())?,
            port: url.port().unwrap_or(PORT),
            user: decoded("user", url.username())?,
            password: url.password().map(|password| decoded("password", password)).transpose()?,
            password_file: None,
            database,
            encryption: Encryption::VerifyFull,
            root_certificate: None,
            certificate: None,
            key: None,
            application_name: "feedwave".to_owned(),
            connections: 16,
            connect_timeout: Duration::from_secs(5),
            statement_timeout: Duration::from_secs(30),
        };
        let encryption = options.read_query(url)?;
        if options.host.is_empty() {
            return Err(InvalidStoreUri::new(format!("it names no host, as {EXAMPLE} does")));
        }
        if options.user.is_empty() {
            return Err(InvalidStoreUri::new(format!("it names no user, as {EXAMPLE} does")));
        }
        // Who states certificates wants them to be used.
        let has_certificates = options.root_certificate.is_some() || options.certificate.is_some();
        let is_plain = is_local(&options.host) && !has_certificates;
        options.encryption = encryption.unwrap_or(if is_plain { Encryption::Disable } else { Encryption::VerifyFull });
        if has_certificates && options.encryption == Encryption::Disable {
            return Err(InvalidStoreUri::new("sslmode=disable uses no certificates: leave them out, or sslmode"));
        }
        if options.root_certificate.is_some() && options.encryption == Encryption::Require {
            return Err(InvalidStoreUri::new(
                "sslmode=require does not look at sslrootcert: verify-ca and verify-full do",
            ));
        }
        if options.password.is_some() && options.password_file.is_some() {
            return Err(InvalidStoreUri::new("it has a password and a password_file: keep one"));
        }
        if options.certificate.is_some() != options.key.is_some() {
            return Err(InvalidStoreUri::new("sslcert and sslkey are given together"));
        }
        Ok(options)
    }

    /// Reads the options; the encryption, where they name it.
    fn read_query(&mut self, url: &Url) -> Result<Option<Encryption>, InvalidStoreUri> {
        let mut encryption = None;
        let mut given = Vec::new();
        for (key, value) in url.query_pairs() {
            let file = || Some(PathBuf::from(&*value)).filter(|path| path.is_absolute());
            let file = || file().ok_or_else(|| InvalidStoreUri::new(format!("{key} must be an absolute path")));
            let seconds = |low| number(&key, &value, low, 3_600).map(|value| Duration::from_secs(value.into()));
            match &*key {
                "host" if value.starts_with('/') && self.host.is_empty() => self.host = value.clone().into_owned(),
                "host" => {
                    return Err(InvalidStoreUri::new(
                        "the option host is the folder of a socket, where no host is before the path",
                    ));
                }
                "user" if self.user.is_empty() => self.user = value.clone().into_owned(),
                "sslmode" => encryption = Some(Encryption::of(&value)?),
                "sslrootcert" => self.root_certificate = Some(file()?),
                "sslcert" => self.certificate = Some(file()?),
                "sslkey" => self.key = Some(file()?),
                "password_file" => self.password_file = Some(file()?),
                "connections" => self.connections = number(&key, &value, 1, 1_000)?,
                "connect_timeout_s" => self.connect_timeout = seconds(1)?,
                "statement_timeout_s" => self.statement_timeout = seconds(1)?,
                "application_name" => self.application_name = value.clone().into_owned(),
                _ => {
                    return Err(InvalidStoreUri::new(format!("the option {key:?} is unknown, known are: {OPTIONS}")));
                }
            }
            if given.contains(&key) {
                return Err(InvalidStoreUri::new(format!("the option {key} is given twice")));
            }
            given.push(key);
        }
        Ok(encryption)
    }

    /// How to connect to a database of the server. Everything about a session is said as it begins.
    pub(super) fn target(&self, database: &str) -> Target {
        let mut options = PgConnectOptions::new_without_pgpass()
            .host(self.host.trim_start_matches('[').trim_end_matches(']'))
            .port(self.port)
            .username(&self.user)
            .database(database)
            .ssl_mode(self.encryption.mode())
            .application_name(&self.application_name)
            .disable_statement_logging();
        if let Some(password) = &self.password {
            options = options.password(password);
        }
        if let Some(certificate) = &self.root_certificate {
            options = options.ssl_root_cert(certificate);
        }
        if let (Some(certificate), Some(key)) = (&self.certificate, &self.key) {
            options = options.ssl_client_cert(certificate).ssl_client_key(key);
        }
        Target { options, password_file: self.password_file.clone() }
    }

    /// As [`PostgresOptions::target`], with bounds on what a session may take. A replica that is cut off in the
    /// middle of a transaction must not hold its locks for long.
    pub(super) fn bounded(&self) -> Target {
        let statement_ms = self.statement_timeout.as_millis();
        let Target { options, password_file } = self.target(&self.database);
        let options = options.options([
            ("default_transaction_isolation", "read committed".to_owned()),
            ("statement_timeout", format!("{statement_ms}ms")),
            ("idle_in_transaction_session_timeout", format!("{}ms", IDLE_IN_TRANSACTION.as_millis())),
            ("tcp_keepalives_idle", "10".to_owned()),
            ("tcp_keepalives_interval", "2".to_owned()),
            ("tcp_keepalives_count", "3".to_owned()),
        ]);
        Target { options, password_file }
    }

    /// How long an answer of the server may take: longer than it lets itself take.
    pub(super) fn answer_limit(&self) -> Duration {
        self.statement_timeout + self.connect_timeout
    }
}

/// What one connects to.
#[derive(Clone, Debug)]
pub(super) struct Target {
    options: PgConnectOptions,
    /// Read for each connection: passwords change while the service runs.
    password_file: Option<PathBuf>,
}

impl Target {
    /// How to connect to it now.
    ///
    /// # Errors
    /// `Unavailable` with the error of the file if the one with the password cannot be read.
    pub(super) async fn connect_options(&self) -> Result<PgConnectOptions> {
        let options = self.options.clone();
        let Some(file) = &self.password_file else { return Ok(options) };
        let text = tokio::fs::read_to_string(file).await.map_err(|error| StoreError::Unavailable {
            reason: "the file of its password cannot be read",
            source: Some(Arc::new(error)),
        })?;
        Ok(options.password(text.trim_end_matches(['\r', '\n'])))
    }
}

/// How long the server waits for the next statement of a transaction.
const IDLE_IN_TRANSACTION: Duration = Duration::from_secs(5);

/// A URI without its password, which is for nobody to read.
pub(crate) fn without_password(url: &Url) -> String {
    let mut url = url.clone();
    if url.password().is_some() {
        // A URI with a password has a host, and then one can be set.
        let _ = url.set_password(Some("***"));
    }
    url.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn the_file_of_the_password_is_read_for_each_connection() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("password");
        let url = format!("postgres://feedwave@db/feedwave?password_file={}", file.display());
        let target = PostgresOptions::from_url(&url.parse().unwrap()).unwrap().bounded();
        let missing = target.connect_options().await.unwrap_err();
        assert!(matches!(missing, StoreError::Unavailable { source: Some(_), .. }), "{missing:?}");
        for password in ["one", "two"] {
            std::fs::write(&file, format!("{password}\n")).unwrap();
            let url = target.connect_options().await.unwrap().to_url_lossy();
            assert_eq!(url.password(), Some(password));
        }
    }
}
