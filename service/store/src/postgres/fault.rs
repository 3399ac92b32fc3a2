//! What PostgreSQL's errors mean to the store, and which of them go by themselves.

use sqlx::postgres::PgDatabaseError;

use crate::error::StoreError;
use crate::sql::fault::{Meaning, REFUSED};

/// What an error means, by its SQLSTATE, <https://www.postgresql.org/docs/current/errcodes-appendix.html>.
pub(crate) fn meaning(error: &PgDatabaseError) -> Meaning {
    let code = error.code();
    Meaning::Unavailable(match code {
        "XX001" | "XX002" => return Meaning::Corrupt("the server found damaged data"),
        // The only character of UTF-8 that it refuses.
        "22021" => return Meaning::Text,
        "40001" | "40P01" => "it is busy with conflicting writes",
        "57014" | "55P03" => "it did not answer in time",
        "25P03" | "57P01" | "57P02" | "57P03" | "57P05" => "the server is stopping or starting",
        "53300" => "the server has no connection left",
        "53100" => "the disk of the server is full",
        "25006" => "the server is read-only",
        "28000" | "28P01" => "the server refused the user or the password",
        "42501" => "the user lacks a right",
        "3D000" => "the server has no such database",
        _ if code.starts_with("08") => "the connection to it failed",
        _ if code.starts_with("53") => "the server is out of resources",
        _ if code.starts_with("58") => "the server cannot read or write its files",
        _ => REFUSED,
    })
}

/// Whether the certificate that the server showed is not accepted, which trying again does not change.
pub(crate) fn is_certificate(error: &sqlx::Error) -> bool {
    let source: Option<&(dyn std::error::Error + 'static)> = match error {
        sqlx::Error::Io(error) => error.get_ref().map(|source| source as _),
        sqlx::Error::Tls(source) => Some(source.as_ref()),
        _ => None,
    };
    let source = source.and_then(|source| source.downcast_ref::<rustls::Error>());
    matches!(source, Some(rustls::Error::InvalidCertificate(_)))
}

/// What can be done about a failed operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Remedy {
    /// Nothing but telling.
    None,
    /// Another transaction came in between: do it again.
    Again,
    /// There is no connection: do it again with another one.
    Reconnect,
    /// Nothing but telling; what comes later needs other connections, as a session keeps what is wrong with it.
    Renounce,
}

impl Remedy {
    /// Of an operation that failed so before it was committed.
    pub(super) fn of(error: &StoreError) -> Self {
        let StoreError::Unavailable { source: Some(source), .. } = error else { return Self::None };
        let Some(error) = source.downcast_ref::<sqlx::Error>() else { return Self::None };
        match error {
            error if is_certificate(error) => Self::None,
            sqlx::Error::Io(_) | sqlx::Error::Tls(_) | sqlx::Error::Protocol(_) => Self::Reconnect,
            sqlx::Error::Database(database) => match database.try_downcast_ref::<PgDatabaseError>() {
                Some(error) => Self::of_code(error.code()),
                None => Self::None,
            },
            _ => Self::None,
        }
    }

    fn of_code(code: &str) -> Self {
        match code {
            "40001" | "40P01" => Self::Again,
            "25P03" | "53300" | "57P01" | "57P02" | "57P03" | "57P05" => Self::Reconnect,
            _ if code.starts_with("08") => Self::Reconnect,
            // Of a server that takes writes again, as of one that was a standby, a session goes on to be read-only.
            "25006" => Self::Renounce,
            _ => Self::None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Remedy;

    #[test]
    fn only_what_goes_by_itself_is_done_again() {
        for (code, remedy) in [
            ("40001", Remedy::Again),
            ("40P01", Remedy::Again),
            ("57P01", Remedy::Reconnect),
            ("57P03", Remedy::Reconnect),
            ("08006", Remedy::Reconnect),
            ("23505", Remedy::None),
            ("57014", Remedy::None),
            ("53100", Remedy::None),
            ("28P01", Remedy::None),
            ("25006", Remedy::Renounce),
        ] {
            assert_eq!(Remedy::of_code(code), remedy, "{code}");
        }
    }
}
