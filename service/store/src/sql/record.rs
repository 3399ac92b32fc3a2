//! A row of a result, whichever database it is of.

use std::fmt::Display;
use std::str::FromStr;

use sqlx::Row as _;
use sqlx::postgres::PgRow;
use sqlx::sqlite::SqliteRow;

use crate::error::{Result, StoreError};
use crate::tenant::Tenant;
use crate::{Json, RawValue};

/// The columns of a row by name. Whole numbers have 64 bits in every database.
pub(crate) trait Record {
    /// A text.
    fn text(&self, column: &str) -> sqlx::Result<&str>;

    /// A text that may be null.
    fn text_option(&self, column: &str) -> sqlx::Result<Option<&str>>;

    /// A whole number.
    fn integer(&self, column: &str) -> sqlx::Result<i64>;

    /// A whole number that may be null.
    fn integer_option(&self, column: &str) -> sqlx::Result<Option<i64>>;

    /// A number.
    fn real(&self, column: &str) -> sqlx::Result<f64>;

    /// Bytes.
    fn bytes(&self, column: &str) -> sqlx::Result<&[u8]>;

    /// Bytes that may be null.
    fn bytes_option(&self, column: &str) -> sqlx::Result<Option<&[u8]>>;
}

macro_rules! record {
    ($row:ty) => {
        impl Record for $row {
            fn text(&self, column: &str) -> sqlx::Result<&str> {
                self.try_get(column)
            }

            fn text_option(&self, column: &str) -> sqlx::Result<Option<&str>> {
                self.try_get(column)
            }

            fn integer(&self, column: &str) -> sqlx::Result<i64> {
                self.try_get(column)
            }

            fn integer_option(&self, column: &str) -> sqlx::Result<Option<i64>> {
                self.try_get(column)
            }

            fn real(&self, column: &str) -> sqlx::Result<f64> {
                self.try_get(column)
            }

            fn bytes(&self, column: &str) -> sqlx::Result<&[u8]> {
                self.try_get(column)
            }

            fn bytes_option(&self, column: &str) -> sqlx::Result<Option<&[u8]>> {
                self.try_get(column)
            }
        }
    };
}

record!(SqliteRow);
record!(PgRow);

/// A column that was written from a `T`.
pub(crate) fn parsed<T>(row: &impl Record, column: &str) -> Result<T>
where
    T: FromStr<Err: Display>,
{
    parse(row.text(column)?, column)
}

/// The tenant of a record.
pub(crate) fn tenant(row: &impl Record) -> Result<Tenant> {
    match row.text("tenant")? {
        "" => Ok(Tenant::DEFAULT),
        name => parse(name, "tenant"),
    }
}

/// As [`parsed`], of a column that may be null.
pub(crate) fn parsed_option<T>(row: &impl Record, column: &str) -> Result<Option<T>>
where
    T: FromStr<Err: Display>,
{
    row.text_option(column)?.map(|text| parse(text, column)).transpose()
}

/// What a text of a column says.
pub(crate) fn parse<T>(text: &str, column: &str) -> Result<T>
where
    T: FromStr<Err: Display>,
{
    text.parse().map_err(|error| StoreError::corrupt(format!("column {column} holds {text:?}: {error}")))
}

/// A column that was written from an unsigned number.
pub(crate) fn unsigned(row: &impl Record, column: &str) -> Result<u64> {
    let value = row.integer(column)?;
    u64::try_from(value).map_err(|_| StoreError::corrupt(format!("column {column} holds {value}")))
}

/// A column that holds a JSON document.
pub(crate) fn json(row: &impl Record, column: &str) -> Result<Json> {
    to_json(row.text(column)?.to_owned(), column)
}

/// As [`json`], of a column that may be null.
pub(crate) fn json_option(row: &impl Record, column: &str) -> Result<Option<Json>> {
    row.text_option(column)?.map(|text| to_json(text.to_owned(), column)).transpose()
}

pub(crate) fn to_json(text: String, column: &str) -> Result<Json> {
    RawValue::from_string(text).map_err(|error| StoreError::corrupt_by(format!("column {column} holds no JSON"), error))
}

/// An unsigned number as the database keeps it, within `limit`.
pub(crate) fn signed(what: &'static str, value: u64) -> Result<i64> {
    i64::try_from(value).map_err(|_| StoreError::TooLarge { what, size: value, limit: i64::MAX as u64 })
}
