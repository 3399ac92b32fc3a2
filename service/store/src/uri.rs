//! Where a store is kept: a URI whose scheme chooses the database.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use url::Url;

use crate::postgres::{self, PostgresOptions};
use crate::sqlite::{self, SqliteOptions};

/// Every scheme that a URI may have.
const SCHEMES: [&str; 2] = [sqlite::SCHEME, postgres::SCHEMES[0]];

/// Where a store is kept. The scheme chooses the database:
///
/// | URI | database |
/// | --- | --- |
/// | `sqlite:///absolute/path/to/file.db` | in this file, created where there is none; its folder must exist and be writable, for three more files lie beside it |
/// | `postgres://user@host/database` | in this database of a PostgreSQL server, created where there is none and the user may; also `postgresql://` |
///
/// Options of a file follow as in `sqlite:///var/lib/feedwave/feedwave.db?readers=8&busy_timeout_s=10`:
///
/// | option | range | default | meaning |
/// | --- | --- | --- | --- |
/// | `readers` | 1 to 64 | 4 | connections that read at the same time |
/// | `busy_timeout_s` | 0 to 3600 | 5 | how long to wait for a lock that another process holds, or for a free reader, s |
/// | `read_timeout_s` | 1 to 3600 | 45 | a read that has not answered by then is given up, s |
///
/// Options of a server, as in `postgres://feedwave@db.plant.example:5432/feedwave?sslmode=verify-full&connections=32`:
///
/// | option | range | default | meaning |
/// | --- | --- | --- | --- |
/// | `host`, `user` | path, name | – | folder of the server's socket, as in `postgres:///feedwave?host=/run/postgresql&user=feedwave` |
/// | `sslmode` | `disable`, `require`, `verify-ca`, `verify-full` | `verify-full`; `disable` on this machine without certificates | encryption of the connection |
/// | `sslrootcert` | path | the system's | certificate of the authority that signed the server's |
/// | `sslcert`, `sslkey` | paths | – | certificate and key of the user |
/// | `password_file` | path | – | file with the password; it may also stand in the URI or in `PGPASSWORD` |
/// | `connections` | 1 to 1000 | 16 | connections for reads and single writes; four more write the logs and follow them |
/// | `connect_timeout_s` | 1 to 3600 | 5 | how long to wait for the server, also while it restarts, or for a free connection, s |
/// | `statement_timeout_s` | 1 to 3600 | 30 | after which a statement is given up, s |
/// | `application_name` | text | `feedwave` | what the server calls the connections |
///
/// What would weaken a promise of the store, such as its synchronisation with the disk, is no option.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct StoreUri {
    text: String,
    /// The text without a password.
    shown: String,
    place: Place,
}

/// A database with what it has to know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    Sqlite(SqliteOptions),
    Postgres(Box<PostgresOptions>),
}

/// Why a text is not the URI of a store. The message never repeats the text, which may hold a password.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct InvalidStoreUri(pub(crate) String);

impl InvalidStoreUri {
    pub(crate) fn new(reason: impl Into<String>) -> Self {
        Self(reason.into())
    }
}

impl StoreUri {
    /// A URI as it may be.
    pub const EXAMPLE: &str = sqlite::EXAMPLE;

    /// The store in this file, relative to the working folder where the path is relative.
    ///
    /// # Errors
    /// [`InvalidStoreUri`] if the path is empty, or relative while there is no working folder.
    pub fn of_file(path: &Path) -> Result<Self, InvalidStoreUri> {
        let absolute = std::path::absolute(path)
            .map_err(|error| InvalidStoreUri::new(format!("the path {path:?} cannot be used: {error}")))?;
        let options = SqliteOptions::new(absolute);
        let text = options.to_uri();
        Ok(Self { shown: text.clone(), text, place: Place::Sqlite(options) })
    }

    /// The file that the store is in, if it is in one.
    #[must_use]
    pub fn file(&self) -> Option<&Path> {
        match &self.place {
            Place::Sqlite(options) => Some(&options.path),
            Place::Postgres(_) => None,
        }
    }

    pub(crate) const fn place(&self) -> &Place {
        &self.place
    }
}

impl FromStr for StoreUri {
    type Err = InvalidStoreUri;

    fn from_str(text: &str) -> Result<Self, InvalidStoreUri> {
        let example = Self::EXAMPLE;
        if text.is_empty() {
            return Err(InvalidStoreUri::new(format!("it is empty; one is {example}")));
        }
        // The parser would drop some of them without a word.
        if text.contains(|symbol: char| symbol.is_whitespace() || symbol.is_control()) {
            return Err(InvalidStoreUri::new("white space and control characters are written as in %20"));
        }
        let mut escapes = text.split('%').skip(1);
        if !escapes.all(|rest| rest.len() >= 2 && rest.bytes().take(2).all(|digit| digit.is_ascii_hexdigit())) {
            return Err(InvalidStoreUri::new("two hexadecimal digits follow a %; a percent sign itself is %25"));
        }
        let url = Url::parse(text).map_err(|error| match error {
            url::ParseError::RelativeUrlWithoutBase => {
                InvalidStoreUri::new(format!("it has no scheme, as in {example}"))
            }
            error => InvalidStoreUri::new(format!("it is no URI: {error}")),
        })?;
        let place = match url.scheme() {
            sqlite::SCHEME => Place::Sqlite(SqliteOptions::from_url(&url)?),
            scheme if postgres::SCHEMES.contains(&scheme) => {
                Place::Postgres(Box::new(PostgresOptions::from_url(&url)?))
            }
            other => {
                let known = SCHEMES.join(", ");
                return Err(InvalidStoreUri::new(format!("the scheme {other:?} is unknown, known are: {known}")));
            }
        };
        Ok(Self { shown: postgres::without_password(&url), text: url.into(), place })
    }
}

impl TryFrom<String> for StoreUri {
    type Error = InvalidStoreUri;

    fn try_from(text: String) -> Result<Self, InvalidStoreUri> {
        text.parse()
    }
}

impl From<StoreUri> for String {
    fn from(uri: StoreUri) -> Self {
        uri.text
    }
}

/// Without the password.
impl fmt::Display for StoreUri {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.shown)
    }
}

impl fmt::Debug for StoreUri {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// The value of an option that is a whole number.
pub(crate) fn number(key: &str, value: &str, low: u32, high: u32) -> Result<u32, InvalidStoreUri> {
    let number = value.parse().ok().filter(|number| (low..=high).contains(number));
    number
        .ok_or_else(|| InvalidStoreUri::new(format!("{key} must be a whole number from {low} to {high}, is {value:?}")))
}
