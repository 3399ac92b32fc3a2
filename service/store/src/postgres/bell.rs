//! What other replicas wrote into the logs. A notification is only a bell: what is new is read from the database, and
//! looked for now and then without a bell, so that one that did not ring costs a moment and nothing else.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use sqlx::PgConnection;
use sqlx::postgres::{PgListener, PgPoolOptions};
use tokio::sync::{Notify, oneshot};
use tokio::task::JoinHandle;

use super::PostgresOptions;
use super::clock::Clock;
use super::lane::{Newest, Shared};
use super::open::connected;
use super::pool::close;
use super::silence::{Silence, TRIVIAL};
use crate::error::{Result, StoreError};

/// The channel of the notifications.
const CHANNEL: &str = "feedwave";
/// That of what replicas tell each other of runs; who rang is said with it.
pub(super) const PRESENCES: &str = "feedwave_presences";

/// How often the logs are looked at without a bell, which also says what the time is.
const PERIOD: Duration = Duration::from_millis(100);
/// Time from one look to the next at least, however often the bell rings: what comes meanwhile is seen by the next one.
const PAUSE: Duration = Duration::from_millis(3);
/// How often the size of the database is looked at.
const SIZE_PERIOD: Duration = Duration::from_secs(60);
/// Time until a lost connection is tried again.
const RETRY_AFTER: Duration = Duration::from_millis(500);

/// A replica that has not seen the logs for so long is not ready.
const UNSEEN_AT_MOST: Duration = Duration::from_secs(5);

/// Follows the logs.
pub(super) struct Bell {
    seen: Arc<Mutex<Instant>>,
    database_bytes: Arc<AtomicU64>,
    tasks: Mutex<Option<Tasks>>,
}

/// Those that listen, look at the size, and follow.
struct Tasks {
    running: [JoinHandle<()>; 3],
    /// What ends them as it is dropped.
    stops: [oneshot::Sender<()>; 3],
}

/// What is asked: the newest numbers of the logs and the time, microseconds since the Unix epoch.
macro_rules! question {
    ($more:literal) => {
        concat!(
            "SELECT (SELECT newest FROM counters WHERE name = 'decision'), (SELECT newest FROM counters WHERE name = 'event'),
                (EXTRACT(EPOCH FROM CLOCK_TIMESTAMP()) * 1000000)::BIGINT",
            $more
        )
    };
}

async fn ask(connection: &mut PgConnection) -> Result<(Newest, i64)> {
    let answer: (i64, i64, i64) = sqlx::query_as(question!("")).fetch_one(connection).await?;
    Ok(answered(answer))
}

/// Rings, and asks on the same way.
async fn ring(connection: &mut PgConnection) -> Result<(Newest, i64)> {
    let answer: (i64, i64, i64) =
        sqlx::query_as(question!(", pg_notify($1, '')::TEXT")).bind(CHANNEL).fetch_one(connection).await?;
    Ok(answered(answer))
}

const fn answered((decision, event, now_us): (i64, i64, i64)) -> (Newest, i64) {
    (Newest { decision, event }, now_us)
}

/// The clock of the database, and the newest numbers of its logs.
pub(super) async fn ask_first(options: &PostgresOptions) -> Result<(Clock, Newest)> {
    let silence = Silence::new();
    let mut connection = connected(&options.bounded(), options.connect_timeout, &silence).await?;
    let begun = Instant::now();
    let (newest, now_us) = silence.answered(options.answer_limit(), ask(&mut connection)).await?;
    close(connection).await;
    Ok((Clock::new(begun, now_us), newest))
}

impl Bell {
    /// Starts to follow.
    pub(super) fn start(shared: Arc<Shared>) -> Self {
        let database_bytes = Arc::new(AtomicU64::new(0));
        let heard = Arc::new(Notify::new());
        let (stop_listening, listening_ends) = oneshot::channel();
        let (stop_sizing, sizing_ends) = oneshot::channel();
        let (stop_following, following_ends) = oneshot::channel();
        let seen = Arc::new(Mutex::new(Instant::now()));
        // One connection listens for good, the other one reads and rings.
        let listening = tokio::spawn(listen(shared.clone(), heard.clone(), listening_ends));
        let sizing = tokio::spawn(size(shared.clone(), database_bytes.clone(), sizing_ends));
        let follower = Follower { connection: None, shared, heard, seen: seen.clone() };
        let following = tokio::spawn(follower.run(following_ends));
        let tasks =
            Tasks { running: [listening, sizing, following], stops: [stop_listening, stop_sizing, stop_following] };
        Self { seen, database_bytes, tasks: Mutex::new(Some(tasks)) }
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

    /// Whether what other replicas write is seen.
    ///
    /// # Errors
    /// `Unavailable` if nothing was for a while.
    pub(super) fn check(&self) -> Result<()> {
        let seen = *self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        if seen.elapsed() >= UNSEEN_AT_MOST {
            return Err(StoreError::unavailable("what other replicas write cannot be followed"));
        }
        Ok(())
    }

    /// Bytes that the database takes, as they were a while ago.
    pub(super) fn database_bytes(&self) -> u64 {
        self.database_bytes.load(Ordering::Relaxed)
    }
}

/// Hears the bell until the other end of `ended` is gone.
async fn listen(shared: Arc<Shared>, heard: Arc<Notify>, mut ended: oneshot::Receiver<()>) {
    let mut told = false;
    loop {
        tokio::select! {
            _ = &mut ended => return,
            result = hear(&shared, &heard) => {
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

async fn hear(shared: &Shared, heard: &Notify) -> Result<()> {
    // Of its own: a connection that fell silent may keep its place in a pool for good.
    let options = PgPoolOptions::new().max_connections(1).acquire_timeout(shared.away);
    let pool = options.connect_lazy_with(shared.target.connect_options().await?);
    let mut listener = PgListener::connect_with(&pool).await?;
    listener.ignore_pool_close_event(true);
    let listened = async { Ok(listener.listen_all([CHANNEL, PRESENCES]).await?) };
    shared.silence.answered(TRIVIAL, listened).await?;
    loop {
        let rung = tokio::select! {
            result = listener.try_recv() => result?,
            // This one may be silent as well, and nothing is to be asked of it.
            () = shared.silence.broken() => return Ok(()),
        };
        match rung {
            Some(rung) if rung.channel() == CHANNEL => heard.notify_one(),
            Some(rung) if rung.payload() == shared.replica => {}
            Some(_) => shared.announcer.ring_presences(),
            // The connection was lost and is there again: what rang meanwhile was not heard.
            None => {
                heard.notify_one();
                shared.announcer.ring_presences();
            }
        }
    }
}

/// Looks at the size of the database now and then until the other end of `ended` is gone: on a connection of its own, because
/// a large database takes its time, which says nothing of the connections.
async fn size(shared: Arc<Shared>, database_bytes: Arc<AtomicU64>, mut ended: oneshot::Receiver<()>) {
    loop {
        let sized = async {
            let mut connection = connected(&shared.target, shared.away, &shared.silence).await?;
            let asked = async {
                let size = sqlx::query_scalar::<_, i64>("SELECT pg_database_size(CURRENT_DATABASE())");
                Ok(size.fetch_one(&mut connection).await?)
            };
            let bytes = Silence::new().answered(TRIVIAL, asked).await?;
            close(connection).await;
            Ok::<_, StoreError>(bytes)
        };
        tokio::select! {
            _ = &mut ended => return,
            sized = sized => match sized {
                Ok(bytes) => database_bytes.store(bytes.unsigned_abs(), Ordering::Relaxed),
                Err(error) => tracing::debug!(%error, "the size of the database is not known"),
            },
        }
        tokio::select! {
            _ = &mut ended => return,
            () = tokio::time::sleep(SIZE_PERIOD) => {}
        }
    }
}

struct Follower {
    /// `None` at first and after something was not answered.
    connection: Option<PgConnection>,
    shared: Arc<Shared>,
    heard: Arc<Notify>,
    seen: Arc<Mutex<Instant>>,
}

impl Follower {
    async fn run(mut self, mut ended: oneshot::Receiver<()>) {
        let mut fails = false;
        loop {
            let rings = tokio::select! {
                biased;
                _ = &mut ended => break,
                () = self.shared.ring.notified() => true,
                () = self.heard.notified() => false,
                () = tokio::time::sleep(PERIOD) => false,
            };
            let result: Result<()> = tokio::select! {
                _ = &mut ended => break,
                result = self.work(rings) => result,
            };
            match result {
                Ok(()) => {
                    fails = false;
                    let next = *self.seen() + PAUSE;
                    tokio::select! {
                        _ = &mut ended => break,
                        () = tokio::time::sleep_until(next.into()) => {}
                    }
                }
                Err(error) => {
                    if rings {
                        // It did not.
                        self.shared.ring.notify_one();
                    }
                    if !std::mem::replace(&mut fails, true) {
                        tracing::warn!(%error, "the logs of the store cannot be followed");
                    }
                    tokio::time::sleep(PERIOD).await;
                }
            }
        }
        // What this replica wrote last is not left to the others' patience.
        if let Err(error) = self.work(true).await {
            tracing::debug!(%error, "the last bell did not ring");
        }
        if let Some(connection) = self.connection {
            close(connection).await;
        }
    }

    fn seen(&self) -> MutexGuard<'_, Instant> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Rings where it is to, and looks at the logs. On an error the connection is given up.
    async fn work(&mut self, rings: bool) -> Result<()> {
        let shared = self.shared.clone();
        let mut connection = match self.connection.take() {
            Some(connection) => connection,
            None => connected(&shared.target, shared.away, &shared.silence).await?,
        };
        let begun = Instant::now();
        // Who writes without a pause rings without a pause, and is to see what others write as soon as who writes nothing.
        let answer = async { if rings { ring(&mut connection).await } else { ask(&mut connection).await } };
        let (newest, now_us) = shared.silence.answered(TRIVIAL, answer).await?;
        shared.clock.set(begun, now_us);
        shared.announcer.announce(newest);
        *self.seen() = begun;
        self.connection = Some(connection);
        Ok(())
    }
}
