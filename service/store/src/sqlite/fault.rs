//! What the database's errors mean to the store.

use std::fmt::Display;
use std::str::FromStr;
use std::sync::Arc;

use sqlx::Row;
use sqlx::error::ErrorKind;
use sqlx::sqlite::SqliteRow;

use crate::error::{Result, StoreError};
use crate::tenant::Tenant;
use crate::{Json, RawValue};

/// SQLite's primary result codes, <https://www.sqlite.org/rescode.html>.
mod code {
    pub(super) const BUSY: i32 = 5;
    pub(super) const LOCKED: i32 = 6;
    pub(super) const READONLY: i32 = 8;
    pub(super) const IOERR: i32 = 10;
    pub(super) const CORRUPT: i32 = 11;
    pub(super) const FULL: i32 = 13;
    pub(super) const CANTOPEN: i32 = 14;
    pub(super) const NOTADB: i32 = 26;
}

/// What a broken constraint is called: the database works, and what was asked of it was wrong.
pub(super) const REFUSED: &str = "it refused the operation";

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        use sqlx::Error as E;
        let reason = match &error {
            E::Database(database) => {
                // Extended codes carry the primary code in their low byte.
                let code = database.code().and_then(|code| code.parse::<i32>().ok()).unwrap_or(0) & 0xff;
                match code {
                    code::CORRUPT | code::NOTADB => {
                        return Self::corrupt_by("the file is not an intact SQLite database", error);
                    }
                    code::BUSY | code::LOCKED => "it is locked by another program",
                    code::READONLY => "it is read-only",
                    code::IOERR => "reading or writing the file failed",
                    code::FULL => "the disk is full",
                    code::CANTOPEN => "the file cannot be opened",
                    _ => REFUSED,
                }
            }
            E::ColumnDecode { .. } | E::ColumnNotFound(_) | E::Decode(_) | E::TypeNotFound { .. } => {
                return Self::corrupt_by("a record has an unexpected form", error);
            }
            E::Io(_) => "reading or writing the file failed",
            E::PoolTimedOut => "no reader became free in time",
            E::PoolClosed | E::WorkerCrashed => "it is closed",
            _ => "it failed",
        };
        Self::Unavailable { reason, source: Some(Arc::new(error)) }
    }
}

/// Whether a reference to a missing record, or from a remaining one, refused the write.
pub(super) fn is_reference(error: &sqlx::Error) -> bool {
    matches!(error, sqlx::Error::Database(database) if database.kind() == ErrorKind::ForeignKeyViolation)
}

/// A column that was written from a `T`.
pub(super) fn parsed<T>(row: &SqliteRow, column: &str) -> Result<T>
where
    T: FromStr<Err: Display>,
{
    parse(row.try_get::<&str, _>(column)?, column)
}

/// The tenant of a record.
pub(super) fn tenant(row: &SqliteRow) -> Result<Tenant> {
    match row.try_get::<&str, _>("tenant")? {
        "" => Ok(Tenant::DEFAULT),
        name => parse(name, "tenant"),
    }
}

/// As [`parsed`], of a column that may be null.
pub(super) fn parsed_option<T>(row: &SqliteRow, column: &str) -> Result<Option<T>>
where
    T: FromStr<Err: Display>,
{
    row.try_get::<Option<&str>, _>(column)?.map(|text| parse(text, column)).transpose()
}

fn parse<T>(text: &str, column: &str) -> Result<T>
where
    T: FromStr<Err: Display>,
{
    text.parse().map_err(|error| StoreError::corrupt(format!("column {column} holds {text:?}: {error}")))
}

/// A column that was written from an unsigned number.
pub(super) fn unsigned(row: &SqliteRow, column: &str) -> Result<u64> {
    let value: i64 = row.try_get(column)?;
    u64::try_from(value).map_err(|_| StoreError::corrupt(format!("column {column} holds {value}")))
}

/// A column that holds a JSON document.
pub(super) fn json(row: &SqliteRow, column: &str) -> Result<Json> {
    to_json(row.try_get(column)?, column)
}

/// As [`json`], of a column that may be null.
pub(super) fn json_option(row: &SqliteRow, column: &str) -> Result<Option<Json>> {
    row.try_get::<Option<String>, _>(column)?.map(|text| to_json(text, column)).transpose()
}

pub(super) fn to_json(text: String, column: &str) -> Result<Json> {
    RawValue::from_string(text).map_err(|error| StoreError::corrupt_by(format!("column {column} holds no JSON"), error))
}

/// An unsigned number as the database keeps it, within `limit`.
pub(super) fn signed(what: &'static str, value: u64) -> Result<i64> {
    i64::try_from(value).map_err(|_| StoreError::TooLarge { what, size: value, limit: i64::MAX as u64 })
}
