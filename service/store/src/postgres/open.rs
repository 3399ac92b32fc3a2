//! Opening the database: is it ours, is it current.

use std::time::Duration;

use sqlx::migrate::Migrator;
use sqlx::postgres::PgDatabaseError;
use sqlx::{AssertSqlSafe, ConnectOptions as _, Connection as _, PgConnection};

use super::PostgresOptions;
use super::fault::is_certificate;
use super::options::Target;
use super::retry::{Failure, Patience};
use super::silence::Silence;
use crate::error::{Result, StoreError};
use crate::sql::migrations;

pub(super) static MIGRATOR: Migrator = sqlx::migrate!("../../migrations/postgres");

/// Key of the lock under which the schema is brought up to date ("fwdb").
const MIGRATION_LOCK: i64 = 0x6677_6462;

/// The database to which one connects to create another.
const MAINTENANCE_DATABASE: &str = "postgres";

/// Brings the schema up to date; creates the database where there is none. Replicas that start together do it one
/// after another.
///
/// # Errors
/// As [`crate::Store::open`].
pub(crate) async fn migrate(options: &PostgresOptions) -> Result<()> {
    let mut connection = match connect(options, &options.database).await {
        Err(error) if is_code(&error, "3D000") => {
            create(options).await?;
            connect(options, &options.database).await
        }
        connected => connected,
    }
    .map_err(cannot_open)?;
    sqlx::query("SELECT pg_advisory_lock($1)").bind(MIGRATION_LOCK).execute(&mut connection).await?;
    identify(&mut connection).await?;
    let migrated = MIGRATOR.run_direct(None, &mut connection, false).await;
    migrated.map_err(|error| migrations::fault(error, &MIGRATOR))?;
    warn_of_loss(&mut connection).await?;
    // With the connection goes the lock.
    connection.close().await?;
    Ok(())
}

/// Connects to a database of ours that is not newer than this version, without changing its schema.
///
/// # Errors
/// `CannotOpen`, `Incompatible`, `Unavailable`.
pub(super) async fn connect_unchanged(options: &PostgresOptions) -> Result<PgConnection> {
    let missing = |error| match error {
        error if is_code(&error, "3D000") => {
            StoreError::CannotOpen { reason: "there is no such database", source: None }
        }
        error => cannot_open(error),
    };
    let mut connection = connect(options, &options.database).await.map_err(missing)?;
    if identify(&mut connection).await? == 0 {
        return Err(StoreError::CannotOpen { reason: "there is nothing in the database", source: None });
    }
    let newest: Option<i64> =
        sqlx::query_scalar("SELECT MAX(version) FROM _sqlx_migrations").fetch_one(&mut connection).await?;
    let known = migrations::newest(&MIGRATOR);
    match newest {
        Some(newest) if newest > known => Err(migrations::newer(newest, known)),
        _ => Ok(connection),
    }
}

/// Connects, as long as the server may be away.
pub(super) async fn connect(options: &PostgresOptions, database: &str) -> Result<PgConnection> {
    connected(&options.target(database), options.connect_timeout, &Silence::new()).await
}

/// As [`connect`], where the server may be `away` for so long.
pub(super) async fn connected(target: &Target, away: Duration, silence: &Silence) -> Result<PgConnection> {
    let mut patience = Patience::new(away);
    loop {
        // Boxed: options are large, and everything that may have to connect would hold them.
        let connecting = Box::pin(async { Ok(target.connect_options().await?.connect().await?) });
        match silence.answered(away, connecting).await {
            Ok(connection) => return Ok(connection),
            Err(error) => patience.again(Failure::Before(error)).await?,
        }
    }
}

async fn create(options: &PostgresOptions) -> Result<()> {
    let cannot = |error| match error {
        StoreError::Unavailable { source, .. } => StoreError::CannotOpen {
            reason: "there is no such database, and it cannot be created: create it, owned by the user of the URI",
            source,
        },
        other => other,
    };
    let mut connection = connect(options, MAINTENANCE_DATABASE).await.map_err(cannot)?;
    let sql =
        format!("CREATE DATABASE \"{}\" ENCODING 'UTF8' TEMPLATE template0", options.database.replace('"', "\"\""));
    match sqlx::raw_sql(AssertSqlSafe(sql)).execute(&mut connection).await.map_err(StoreError::from) {
        Ok(_) => tracing::info!(database = options.database, "created"),
        // Another replica did, before or meanwhile.
        Err(error) if is_code(&error, "42P04") || is_code(&error, "23505") => {}
        Err(error) => return Err(cannot(error)),
    }
    connection.close().await?;
    Ok(())
}

/// Looks at the database before anything in it is changed; how many tables it has. That of the migrations does not count: it is
/// made before the first one, and is empty where that was broken off.
async fn identify(connection: &mut PgConnection) -> Result<i64> {
    let (tables, ours, has_migrations): (i64, i64, bool) = sqlx::query_as(
        "SELECT COUNT(*) FILTER (WHERE table_name <> '_sqlx_migrations'), COUNT(*) FILTER (WHERE table_name = 'feedwave'),
            COUNT(*) FILTER (WHERE table_name = '_sqlx_migrations') > 0
         FROM information_schema.tables WHERE table_schema = CURRENT_SCHEMA()",
    )
    .fetch_one(&mut *connection)
    .await?;
    let migrated = ours == 0 && has_migrations && {
        let any = "SELECT EXISTS (SELECT 1 FROM _sqlx_migrations)";
        sqlx::query_scalar::<_, bool>(any).fetch_one(&mut *connection).await?
    };
    if (tables > 0 && ours == 0) || migrated {
        return Err(StoreError::Incompatible("it has tables of another program".into()));
    }
    let encoding: String = sqlx::query_scalar("SHOW server_encoding").fetch_one(connection).await?;
    if encoding != "UTF8" {
        return Err(StoreError::Incompatible(format!("its encoding is {encoding}, and must be UTF8")));
    }
    Ok(tables)
}

/// Tells of settings of the server with which an acknowledged write may be lost.
async fn warn_of_loss(connection: &mut PgConnection) -> Result<()> {
    for (sql, setting) in [("SHOW fsync", "fsync"), ("SHOW synchronous_commit", "synchronous_commit")] {
        let value: String = sqlx::query_scalar(sql).fetch_one(&mut *connection).await?;
        if value == "off" {
            tracing::warn!(setting, "is off at the database server: it may lose what was acknowledged");
        }
    }
    Ok(())
}

fn is_code(error: &StoreError, code: &str) -> bool {
    let StoreError::Unavailable { source: Some(source), .. } = error else { return false };
    let Some(sqlx::Error::Database(database)) = source.downcast_ref::<sqlx::Error>() else { return false };
    database.try_downcast_ref::<PgDatabaseError>().is_some_and(|error| error.code() == code)
}

/// What the server refuses at the door will not be granted by waiting.
fn cannot_open(error: StoreError) -> StoreError {
    let is_of_file =
        matches!(&error, StoreError::Unavailable { source: Some(source), .. } if source.is::<std::io::Error>());
    let is_of_certificate = matches!(&error, StoreError::Unavailable { source: Some(source), .. }
        if source.downcast_ref::<sqlx::Error>().is_some_and(is_certificate));
    let refused = is_of_file
        || is_of_certificate
        || ["28000", "28P01", "3D000", "42501"].iter().any(|code| is_code(&error, code));
    match error {
        StoreError::Unavailable { reason, source } if refused => StoreError::CannotOpen { reason, source },
        other => other,
    }
}
