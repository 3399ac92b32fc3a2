//! What the errors of databases mean to the store.

use std::sync::Arc;

use sqlx::error::ErrorKind;
use sqlx::postgres::PgDatabaseError;

use crate::error::StoreError;
use crate::{postgres, sqlite};

/// What a broken constraint is called: the database works, and what was asked of it was wrong.
pub(crate) const REFUSED: &str = "it refused the operation";

/// What an error that a database itself reported means.
pub(crate) enum Meaning {
    /// What it holds is damaged, in words for an operator.
    Corrupt(&'static str),
    /// A text has a character that it cannot keep.
    Text,
    /// It did not do its part, in words for an operator.
    Unavailable(&'static str),
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        use sqlx::Error as E;
        let error = match error {
            E::AnyDriverError(source) => match source.downcast::<Self>() {
                Ok(own) => return *own,
                Err(source) => E::AnyDriverError(source),
            },
            error => error,
        };
        let reason = match &error {
            E::Database(database) => {
                let meaning = match database.try_downcast_ref::<PgDatabaseError>() {
                    Some(error) => postgres::meaning(error),
                    None => sqlite::meaning(&**database),
                };
                match meaning {
                    Meaning::Corrupt(reason) => return Self::corrupt_by(reason, error),
                    Meaning::Text => return Self::NulCharacter,
                    Meaning::Unavailable(reason) => reason,
                }
            }
            E::ColumnDecode { .. } | E::ColumnNotFound(_) | E::Decode(_) | E::TypeNotFound { .. } => {
                return Self::corrupt_by("a record has an unexpected form", error);
            }
            error if postgres::is_certificate(error) => "the certificate of its server is not accepted",
            // SQLite reports what its files do by codes.
            E::Io(_) => "the connection to it failed",
            E::Tls(_) => "the encrypted connection to it failed",
            E::PoolTimedOut => "no connection became free in time",
            E::PoolClosed | E::WorkerCrashed => "it is closed",
            _ => "it failed",
        };
        Self::Unavailable { reason, source: Some(Arc::new(error)) }
    }
}

/// What stands between sqlx and its caller speaks of errors as sqlx does.
impl From<StoreError> for sqlx::Error {
    fn from(error: StoreError) -> Self {
        Self::AnyDriverError(Box::new(error))
    }
}

/// Whether a reference to a missing record, or from a remaining one, refused the write.
pub(crate) fn is_reference(error: &sqlx::Error) -> bool {
    matches!(error, sqlx::Error::Database(database) if database.kind() == ErrorKind::ForeignKeyViolation)
}
