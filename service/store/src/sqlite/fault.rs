//! What SQLite's errors mean to the store.

use sqlx::error::DatabaseError;

use crate::sql::fault::{Meaning, REFUSED};

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

/// Whether SQLite tells an error as damage of the file.
pub(super) fn is_damage(error: &sqlx::Error) -> bool {
    matches!(error, sqlx::Error::Database(error) if matches!(meaning(&**error), Meaning::Corrupt(_)))
}

/// What an error means.
pub(crate) fn meaning(error: &dyn DatabaseError) -> Meaning {
    // Extended codes carry the primary code in their low byte.
    let code = error.code().and_then(|code| code.parse::<i32>().ok()).unwrap_or(0) & 0xff;
    Meaning::Unavailable(match code {
        code::CORRUPT | code::NOTADB => return Meaning::Corrupt("the file is not an intact SQLite database"),
        code::BUSY | code::LOCKED => "it is locked by another program",
        code::READONLY => "it is read-only",
        code::IOERR => "reading or writing the file failed",
        code::FULL => "the disk is full",
        code::CANTOPEN => "the file cannot be opened",
        _ => REFUSED,
    })
}
