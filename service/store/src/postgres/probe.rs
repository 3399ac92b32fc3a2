//! Whether writing works: a durable write.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use sqlx::PgConnection;
use tokio::sync::watch;
use tokio::task::JoinHandle;

use super::PostgresStore;
use super::lane::former;
use super::validations::LEASE_US;
use crate::error::{Result, StoreError};

/// What a probe writes once a write has failed, bytes: where this fits, ordinary writes do.
const BALLAST_BYTES: usize = 1 << 20;
/// After which the row of a process that probes no more is removed, µs.
const KEPT_US: i64 = 86_400_000_000;

const STALLED: &str = "the database server does not answer in time";

/// Why writes are refused without being tried.
type Blocked = Option<&'static str>;

/// What is known about writing.
#[derive(Debug)]
pub(super) struct Probing {
    blocked: watch::Sender<Blocked>,
    /// Counts writes that the database could not do.
    faults: watch::Sender<u64>,
    pending: Mutex<Pending>,
}

#[derive(Debug, Default)]
struct Pending {
    /// A probe that has not come back yet.
    write: Option<JoinHandle<Result<()>>>,
    /// Whether the last one failed.
    failed: bool,
    /// Faults when the last one began.
    faults: u64,
}

impl Probing {
    pub(super) fn new() -> Self {
        Self { blocked: watch::channel(None).0, faults: watch::channel(0).0, pending: Mutex::default() }
    }

    fn pending(&self) -> MutexGuard<'_, Pending> {
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Follows why writes are refused without being tried.
    pub(super) fn blocked(&self) -> watch::Receiver<Blocked> {
        self.blocked.subscribe()
    }

    /// Follows the number of writes that the database could not do.
    pub(super) fn faults(&self) -> watch::Receiver<u64> {
        self.faults.subscribe()
    }

    /// Notes that the database could not do a write.
    pub(super) fn fault(&self) {
        self.faults.send_modify(|faults| *faults += 1);
    }

    fn block(&self, reason: Blocked) {
        self.blocked.send_if_modified(|blocked| std::mem::replace(blocked, reason) != reason);
    }
}

impl PostgresStore {
    /// See [`crate::Database::probe`].
    pub(super) async fn probe_writing(&self, patience: Duration) -> Result<()> {
        let probing = &self.inner.probing;
        let (mut write, faults) = {
            let mut pending = probing.pending();
            let faults = *probing.faults.borrow();
            let ballast = pending.failed || faults != pending.faults;
            let write = pending.write.take().unwrap_or_else(|| {
                let store = self.clone();
                tokio::spawn(async move { store.write_probe(if ballast { BALLAST_BYTES } else { 0 }).await })
            });
            (write, faults)
        };
        let result = match tokio::time::timeout(patience, &mut write).await {
            Ok(Ok(result)) => result,
            Ok(Err(_)) => Err(StoreError::unavailable("the service is ending")),
            Err(_) => {
                probing.pending().write = Some(write);
                probing.block(Some(STALLED));
                return Err(StoreError::unavailable(STALLED));
            }
        };
        probing.block(None);
        let mut pending = probing.pending();
        pending.failed = result.is_err();
        pending.faults = faults;
        result
    }

    async fn write_probe(&self, ballast_bytes: usize) -> Result<()> {
        for bytes in [ballast_bytes, 0] {
            let shared = &self.inner.shared;
            let (replica, started_us, now_us) = (shared.replica.clone(), shared.started_us, self.clock().now_us());
            let namesake = self
                .write_alone(move |connection| {
                    let replica = replica.clone();
                    Box::pin(async move {
                        sqlx::query(
                            "INSERT INTO probes (replica, at_us, ballast) VALUES ($1, $2, $3)
                             ON CONFLICT (replica) DO UPDATE SET at_us = EXCLUDED.at_us, ballast = EXCLUDED.ballast",
                        )
                        .bind(&replica)
                        .bind(now_us)
                        .bind(vec![0_u8; bytes])
                        .execute(&mut *connection)
                        .await?;
                        sqlx::query("DELETE FROM probes WHERE at_us < $1")
                            .bind(now_us - KEPT_US)
                            .execute(&mut *connection)
                            .await?;
                        namesake(connection, &replica, started_us.max(now_us - LEASE_US)).await
                    })
                })
                .await?;
            shared.note_namesake(namesake, &self.settings().replica_name);
            if ballast_bytes == 0 {
                break;
            }
        }
        Ok(())
    }
}

/// Another process with the name of this one that has probed since.
async fn namesake(connection: &mut PgConnection, replica: &str, since_us: i64) -> Result<Option<String>> {
    let Some(former) = former(replica) else { return Ok(None) };
    let found = sqlx::query_scalar(
        "SELECT MAX(replica) FROM probes WHERE LEFT(replica, LENGTH($1)) = $1 AND replica <> $2 AND at_us > $3",
    );
    Ok(found.bind(former).bind(replica).bind(since_us).fetch_one(connection).await?)
}
