//! What replicas tell each other, in a table of PostgreSQL. Times are the database's.

use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use sqlx::{PgConnection, Postgres, QueryBuilder};
use tokio::sync::watch;
use uuid::Uuid;

use super::PostgresStore;
use super::bell::PRESENCES;
use super::lane::former;
use crate::error::{Result, check_size};
use crate::presences::{Presence, Presences, ToldPresence, ToldUse};
use crate::sql::documents::{MACHINES_MARK, machines_mark};
use crate::sql::record::{Record as _, parsed, tenant};

/// The time now, microseconds since the Unix epoch.
const NOW_US: &str = "(EXTRACT(EPOCH FROM CLOCK_TIMESTAMP()) * 1000000)::BIGINT";
/// What was not told again for so long is removed, µs.
const KEPT_US: i64 = 60_000_000;
/// The same of the time that a client used, µs.
const USE_KEPT_US: i64 = 10_000_000;
/// Rows of one statement.
const ROWS: usize = 500;

/// Writes what a replica tells.
async fn tell(
    connection: &mut PgConnection,
    replica: &str,
    told: &[Presence],
    gone: &[Uuid],
    rings: bool,
) -> Result<()> {
    for told in told.chunks(ROWS) {
        let mut sql = QueryBuilder::<Postgres>::new(
            "INSERT INTO presences (replica, run_id, tenant, sequence, is_connected, body, told_us) ",
        );
        sql.push_values(told, |mut row, presence| {
            row.push_bind(replica.to_owned())
                .push_bind(presence.run_id.to_string())
                .push_bind(presence.tenant.name().to_owned())
                .push_bind(presence.sequence)
                .push_bind(i64::from(presence.is_connected))
                .push_bind(presence.body.to_vec())
                .push(NOW_US);
        });
        sql.push(
            " ON CONFLICT (replica, run_id) DO UPDATE SET is_connected = EXCLUDED.is_connected, body = EXCLUDED.body,
                told_us = EXCLUDED.told_us",
        );
        sql.build().execute(&mut *connection).await?;
    }
    for gone in gone.chunks(ROWS) {
        let mut sql = QueryBuilder::<Postgres>::new("DELETE FROM presences WHERE replica = ");
        sql.push_bind(replica.to_owned()).push(" AND run_id IN (");
        let mut ids = sql.separated(", ");
        for id in gone {
            ids.push_bind(id.to_string());
        }
        sql.push(")");
        sql.build().execute(&mut *connection).await?;
    }
    let mut sql = QueryBuilder::<Postgres>::new("DELETE FROM presences WHERE told_us < ");
    sql.push(NOW_US).push(" - ").push_bind(KEPT_US);
    sql.build().execute(&mut *connection).await?;
    if rings {
        sqlx::query("SELECT pg_notify($1, $2)").bind(PRESENCES).bind(replica).execute(connection).await?;
    }
    Ok(())
}

/// Adds what clients used of a replica's workers.
async fn tell_use(connection: &mut PgConnection, replica: &str, used: &[(String, Duration)]) -> Result<()> {
    for used in used.chunks(ROWS) {
        let mut sql = QueryBuilder::<Postgres>::new("INSERT INTO validation_use (replica, client, used_us, told_us) ");
        sql.push_values(used, |mut row, (client, used)| {
            row.push_bind(replica.to_owned())
                .push_bind(client.clone())
                .push_bind(i64::try_from(used.as_micros()).unwrap_or(i64::MAX))
                .push(NOW_US);
        });
        sql.push(
            " ON CONFLICT (replica, client) DO UPDATE SET used_us = validation_use.used_us + EXCLUDED.used_us,
                told_us = EXCLUDED.told_us",
        );
        sql.build().execute(&mut *connection).await?;
    }
    let mut sql = QueryBuilder::<Postgres>::new("DELETE FROM validation_use WHERE told_us < ");
    sql.push(NOW_US).push(" - ").push_bind(USE_KEPT_US);
    sql.build().execute(connection).await?;
    Ok(())
}

impl PostgresStore {
    /// Takes back what an earlier process of the replica with this name told, which is no more: its streams broke with it.
    pub(super) async fn take_back_presences(&self) -> Result<()> {
        let Some(former) = former(&self.inner.shared.replica).map(str::to_owned) else { return Ok(()) };
        self.write(0, move |connection| {
            let former = former.clone();
            Box::pin(async move {
                let delete = sqlx::query("DELETE FROM presences WHERE LEFT(replica, LENGTH($1)) = $1");
                delete.bind(former).execute(connection).await?;
                Ok(())
            })
        })
        .await
    }
}

#[async_trait]
impl Presences for PostgresStore {
    async fn tell_presences(&self, told: Vec<Presence>, gone: Vec<Uuid>, rings: bool) -> Result<()> {
        let limit = self.settings().max_document_bytes;
        for presence in &told {
            check_size("presence size in bytes", presence.body.len(), limit)?;
        }
        let payload = told.iter().map(|presence| presence.body.len()).sum();
        let (replica, told) = (self.inner.shared.replica.clone(), Arc::new((told, gone)));
        self.write(payload, move |connection| {
            let (replica, told) = (replica.clone(), told.clone());
            Box::pin(async move { tell(connection, &replica, &told.0, &told.1, rings).await })
        })
        .await
    }

    fn watch_presences(&self) -> watch::Receiver<u64> {
        self.inner.shared.announcer.presences()
    }

    async fn presences(&self, window: Duration) -> Result<Vec<ToldPresence>> {
        let window_us = i64::try_from(window.as_micros()).unwrap_or(i64::MAX);
        let rows = sqlx::query(
            "SELECT replica, run_id, tenant, sequence, is_connected, told_us, age_us, CASE WHEN age_us <= $2 THEN body END AS body
             FROM (SELECT *, (EXTRACT(EPOCH FROM CLOCK_TIMESTAMP()) * 1000000)::BIGINT - told_us AS age_us
                   FROM presences WHERE replica <> $1) AS told
             ORDER BY told_us, replica, run_id",
        )
        .bind(&self.inner.shared.replica)
        .bind(window_us)
        .fetch_all(&mut self.reader().await?)
        .await?;
        let told = rows.iter().map(|row| {
            Ok(ToldPresence {
                replica: row.text("replica")?.to_owned(),
                run_id: parsed(row, "run_id")?,
                tenant: tenant(row)?,
                sequence: row.integer("sequence")?,
                is_connected: row.integer("is_connected")? != 0,
                told_us: row.integer("told_us")?,
                age: Duration::from_micros(u64::try_from(row.integer("age_us")?).unwrap_or(0)),
                body: row.bytes_option("body")?.map(|body| body.to_vec().into()),
            })
        });
        told.collect()
    }

    async fn tell_use(&self, used: Vec<(String, Duration)>) -> Result<()> {
        let (replica, used) = (self.inner.shared.replica.clone(), Arc::new(used));
        self.write(0, move |connection| {
            let (replica, used) = (replica.clone(), used.clone());
            Box::pin(async move { tell_use(connection, &replica, &used).await })
        })
        .await
    }

    async fn told_use(&self) -> Result<Vec<ToldUse>> {
        let rows = sqlx::query("SELECT replica, client, used_us FROM validation_use WHERE replica <> $1")
            .bind(&self.inner.shared.replica)
            .fetch_all(&mut self.reader().await?)
            .await?;
        let told = rows.iter().map(|row| {
            Ok(ToldUse {
                replica: row.text("replica")?.to_owned(),
                client: row.text("client")?.to_owned(),
                used: Duration::from_micros(u64::try_from(row.integer("used_us")?).unwrap_or(0)),
            })
        });
        told.collect()
    }

    async fn machines_mark(&self) -> Result<[i64; 3]> {
        machines_mark(&sqlx::query(MACHINES_MARK).fetch_one(&mut self.reader().await?).await?)
    }
}
