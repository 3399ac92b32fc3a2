//! What the version of a schema means to the store.

use std::sync::Arc;

use sqlx::migrate::{MigrateError, Migrator};

use crate::error::StoreError;

/// The newest migration that this version knows.
pub(crate) fn newest(migrator: &Migrator) -> i64 {
    migrator.iter().map(|migration| migration.version).max().unwrap_or(0)
}

/// That a schema is newer than this version.
pub(crate) fn newer(version: i64, known: i64) -> StoreError {
    StoreError::Incompatible(format!(
        "it was changed by a newer version (it has migration {version}, this version knows those up to {known})"
    ))
}

/// Why bringing a schema up to date by `migrator` failed.
pub(crate) fn fault(error: MigrateError, migrator: &Migrator) -> StoreError {
    match error {
        MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _) => error.into(),
        MigrateError::VersionMissing(version) => newer(version, newest(migrator)),
        MigrateError::VersionMismatch(version) => {
            StoreError::Incompatible(format!("its migration {version} differs from this version's"))
        }
        other => StoreError::Unavailable { reason: "migrating it failed", source: Some(Arc::new(other)) },
    }
}
