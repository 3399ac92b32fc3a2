//! What other replicas wrote into the logs. A notification is only a bell: what is new is read from the database, and
//! looked for now and then without a bell, so that one that did not ring costs a moment and nothing else.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use sqlx::PgPool;
use sqlx::postgres::PgListener;
use tokio::sync::{Notify, oneshot};
use tokio::task::JoinHandle;

use super::PostgresOptions;
use super::clock::Clock;
use super::lane::{Newest, Shared};
use super::open;
use crate::error::{Result, StoreError};

/// The channel of the notifications.
const CHANNEL: &str = "feedwave";

/// How often the logs are looked at without a bell, which also says what the time is.
const PERIOD: Duration = Duration::from_millis(100);
/// How often the size of the database is looked at.
const SIZE_PERIOD: Duration = Duration::from_secs(60);
/// Time until a lost connection is tried again.
const RETRY_AFTER: Duration = Duration::from_millis(500);

/// Follows the logs.
pub(super) struct Bell {
    database_bytes: Arc<AtomicU64>,
    tasks: Mutex<Option<Tasks>>,
}

/// Those that listen and follow.
struct Tasks {
    running: [JoinHandle<()>; 2],
    /// What ends them as it is dropped.
    stops: [oneshot::Sender<()>; 2],
}

/// The newest numbers of the logs and the time, microseconds since the Unix epoch.
async fn ask(pool: &PgPool) -> Result<(Newest, i64)> {
    let (decision, event, now_us): (i64, i64, i64) = sqlx::query_as(
        "SELECT (SELECT newest FROM counters WHERE name = 'decision'), (SELECT newest FROM counters WHERE name = 'event'),
            (EXTRACT(EPOCH FROM CLOCK_TIMESTAMP()) * 1000000)::BIGINT",
    )
    .fetch_one(pool)
    .await?;
    Ok((Newest { decision, event }, now_us))
}

/// The clock of the database, and the newest numbers of its logs.
pub(super) async fn ask_first(pool: &PgPool) -> Result<(Clock, Newest)> {
    let begun = Instant::now();
    let (newest, now_us) = ask(pool).await?;
    Ok((Clock::new(begun, now_us), newest))
}

impl Bell {
    /// Starts to follow.
    pub(super) fn start(options: &PostgresOptions, shared: Arc<Shared>) -> Result<Self> {
        // One connection listens for good, the other one reads and rings.
        let pool = open::pool(options, 2)?;
        let database_bytes = Arc::new(AtomicU64::new(0));
        let heard = Arc::new(Notify::new());
        let (stop_listening, listening_ends) = oneshot::channel();
        let (stop_following, following_ends) = oneshot::channel();
        let listening = tokio::spawn(listen(pool.clone(), heard.clone(), listening_ends));
        let follower = Follower { pool, shared, heard, database_bytes: database_bytes.clone() };
        let following = tokio::spawn(follower.run(following_ends));
        let tasks = Tasks { running: [listening, following], stops: [stop_listening, stop_following] };
        Ok(Self { database_bytes, tasks: Mutex::new(Some(tasks)) })
    }

    pub(super) async fn close(&self) {
        let tasks = self.tasks.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some(Tasks { running, stops }) = tasks else { return };
        drop(stops);
        for task in running {
            if let Err(error) = task.await {
                tracing::error!(%error, "a follower of the store ended abnormally");
            }
        }
    }

    /// Bytes that the database takes, as they were a while ago.
    pub(super) fn database_bytes(&self) -> u64 {
        self.database_bytes.load(Ordering::Relaxed)
    }
}

/// Hears the bell until the other end of `ended` is gone.
async fn listen(pool: PgPool, heard: Arc<Notify>, mut ended: oneshot::Receiver<()>) {
    let mut told = false;
    loop {
        tokio::select! {
            _ = &mut ended => return,
            result = hear(&pool, &heard) => {
                // Told once: without a bell the logs are looked at all the same.
                if let Err(error) = result && !std::mem::replace(&mut told, true) {
                    tracing::warn!(%error, "the database rings no bell: what other replicas write is seen a little later");
                }
            }
        }
        tokio::select! {
            _ = &mut ended => return,
            () = tokio::time::sleep(RETRY_AFTER) => {}
        }
    }
}

async fn hear(pool: &PgPool, heard: &Notify) -> Result<()> {
    let mut listener = PgListener::connect_with(pool).await?;
    listener.ignore_pool_close_event(true);
    listener.listen(CHANNEL).await?;
    loop {
        // Also when the connection was lost and is there again: what rang meanwhile was not heard.
        listener.try_recv().await?;
        heard.notify_one();
    }
}

struct Follower {
    pool: PgPool,
    shared: Arc<Shared>,
    heard: Arc<Notify>,
    database_bytes: Arc<AtomicU64>,
}

impl Follower {
    async fn run(self, mut ended: oneshot::Receiver<()>) {
        let mut size_due = Instant::now();
        let mut fails = false;
        loop {
            let rings = tokio::select! {
                biased;
                _ = &mut ended => break,
                () = self.shared.ring.notified() => true,
                () = self.heard.notified() => false,
                () = tokio::time::sleep(PERIOD) => false,
            };
            let work = async {
                if rings {
                    sqlx::query("SELECT pg_notify($1, '')").bind(CHANNEL).execute(&self.pool).await?;
                    return Ok(());
                }
                self.look(&mut size_due).await
            };
            let result: Result<()> = tokio::select! {
                _ = &mut ended => break,
                result = work => result,
            };
            match result {
                Ok(()) => fails = false,
                Err(error) => {
                    if !std::mem::replace(&mut fails, true) {
                        tracing::warn!(%error, "the logs of the store cannot be followed");
                    }
                    tokio::time::sleep(PERIOD).await;
                }
            }
        }
        // What this replica wrote last is not left to the others' patience.
        if let Ok(mut connection) = self.pool.acquire().await {
            let rung = sqlx::query("SELECT pg_notify($1, '')").bind(CHANNEL).execute(&mut *connection).await;
            if let Err(error) = rung {
                tracing::debug!(%error, "the last bell did not ring");
            }
        }
        self.pool.close().await;
    }

    async fn look(&self, size_due: &mut Instant) -> Result<()> {
        let begun = Instant::now();
        let (newest, now_us) = ask(&self.pool).await?;
        self.shared.clock.set(begun, now_us);
        self.shared.announcer.announce(newest);
        if *size_due <= begun {
            let bytes: i64 = sqlx::query_scalar("SELECT pg_database_size(CURRENT_DATABASE())")
                .fetch_one(&self.pool)
                .await
                .map_err(StoreError::from)?;
            self.database_bytes.store(bytes.unsigned_abs(), Ordering::Relaxed);
            *size_due = begun + SIZE_PERIOD;
        }
        Ok(())
    }
}
