//! Connections for reads and single writes. A connection that was cut on its way (by a failover, a load balancer or a
//! translation of addresses that forgot it) is not told of it: it stays open and says nothing. So whatever is asked has a
//! limit, and a connection goes back only once all that was asked of it was answered. The pool of sqlx waits without a
//! limit for the answer of a connection that comes back, which takes its place for good.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use futures_util::future::BoxFuture;
use futures_util::stream::BoxStream;
use futures_util::{StreamExt as _, TryStreamExt as _, stream};
use sqlx::postgres::{PgQueryResult, PgRow, PgStatement, PgTypeInfo};
use sqlx::{Connection as _, Describe, Either, Execute, Executor, PgConnection, Postgres, SqlStr};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::PostgresOptions;
use super::open::connected;
use super::options::Target;
use super::silence::{Silence, TRIVIAL};
use crate::error::{Result, StoreError};
use crate::settings::Observer;

/// A connection that was not used for so long is tried before it is used.
pub(super) const TRIED_AFTER: Duration = Duration::from_secs(1);
/// A connection that was not used for so long is closed.
const IDLE_AT_MOST: Duration = Duration::from_secs(10 * 60);
/// A connection of this age is closed: what a session keeps at the server grows.
const AGE_AT_MOST: Duration = Duration::from_secs(30 * 60);

/// Connections that are made when they are needed. Cloning is cheap; clones are the same pool.
#[derive(Clone)]
pub(super) struct Pool {
    inner: Arc<Inner>,
}

struct Inner {
    target: Target,
    connections: u32,
    /// How long to wait for the server or for a free connection.
    patience: Duration,
    /// How long an answer may take.
    limit: Duration,
    silence: Silence,
    turns: Arc<Semaphore>,
    closed: AtomicBool,
    /// What waits to be used, the last one used last.
    idle: Mutex<Vec<Idle>>,
    /// Connections that were made before are given up.
    renounced: Mutex<Option<Instant>>,
}

struct Idle {
    connection: PgConnection,
    made: Instant,
    used: Instant,
}

impl Pool {
    /// One of at most so many connections.
    ///
    /// # Errors
    /// `CannotOpen`.
    pub(super) fn new(options: &PostgresOptions, connections: u32, silence: Silence) -> Result<Self> {
        Ok(Self {
            inner: Arc::new(Inner {
                target: options.bounded(),
                connections,
                patience: options.connect_timeout,
                limit: options.answer_limit(),
                silence,
                turns: Arc::new(Semaphore::new(connections as usize)),
                closed: AtomicBool::new(false),
                idle: Mutex::default(),
                renounced: Mutex::default(),
            }),
        })
    }

    /// A connection that answers.
    ///
    /// # Errors
    /// `Unavailable` where the server is away or all connections are in use for too long.
    pub(super) async fn acquire(&self) -> Result<Lent> {
        let lending = async {
            let turn = self.inner.turns.clone().acquire_owned().await.map_err(|_| sqlx::Error::PoolClosed)?;
            if self.inner.closed.load(Ordering::Acquire) {
                return Err(sqlx::Error::PoolClosed.into());
            }
            let (connection, made) = self.inner.connection().await?;
            Ok(Lent { connection: Some(connection), made, asked: false, pool: self.inner.clone(), _turn: turn })
        };
        let lent = tokio::time::timeout(self.inner.patience, lending).await;
        lent.unwrap_or_else(|_| Err(sqlx::Error::PoolTimedOut.into()))
    }

    /// Lends no more, and closes every connection once what is being done with it is done.
    pub(super) async fn close(&self) {
        self.inner.closed.store(true, Ordering::Release);
        let all = self.inner.turns.acquire_many(self.inner.connections);
        if tokio::time::timeout(self.inner.patience, all).await.is_err() {
            tracing::warn!("connections of the store are still in use: they end with the process");
        }
        self.inner.turns.close();
        let idle = std::mem::take(&mut *self.inner.idle());
        for Idle { connection, .. } in idle {
            close(connection).await;
        }
    }
}

/// Says good-bye, if that can be said at once.
pub(super) async fn close(connection: PgConnection) {
    match tokio::time::timeout(TRIVIAL, connection.close()).await {
        Ok(Ok(())) => {}
        Ok(Err(error)) => tracing::debug!(%error, "closing a connection failed"),
        Err(_) => tracing::debug!("closing a connection took too long"),
    }
}

impl Inner {
    fn idle(&self) -> MutexGuard<'_, Vec<Idle>> {
        // Only whole values are put in or taken out.
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// One that was used before and answers, or a new one; and when it was made.
    async fn connection(&self) -> Result<(PgConnection, Instant)> {
        loop {
            let next = self.idle().pop();
            let Some(Idle { mut connection, made, used }) = next else { break };
            // Those that were used last before another one fell silent are not even tried.
            if self.is_renounced(made) || self.silence.since(used) || used.elapsed() >= IDLE_AT_MOST {
                continue;
            }
            if used.elapsed() < TRIED_AFTER {
                return Ok((connection, made));
            }
            match self.silence.answered(TRIVIAL, async { Ok(connection.ping().await?) }).await {
                Ok(()) => return Ok((connection, made)),
                Err(error) => tracing::debug!(%error, "a connection that was not used for a while is given up"),
            }
        }
        Ok((connected(&self.target, self.patience, &self.silence).await?, Instant::now()))
    }

    fn is_renounced(&self, made: Instant) -> bool {
        // Only whole values are put in.
        self.renounced.lock().unwrap_or_else(PoisonError::into_inner).is_some_and(|renounced| made <= renounced)
    }

    fn take_back(&self, connection: PgConnection, made: Instant) {
        if self.closed.load(Ordering::Acquire) || self.is_renounced(made) || made.elapsed() >= AGE_AT_MOST {
            return;
        }
        let mut idle = self.idle();
        // The first one was not used for the longest time.
        if idle.first().is_some_and(|idle| idle.used.elapsed() >= IDLE_AT_MOST) {
            idle.remove(0);
        }
        idle.push(Idle { connection, made, used: Instant::now() });
    }
}

/// A connection that is in use. It is closed, at once and without a word, if something asked of it was not answered when
/// this is dropped, because it took too long or because nobody waits any more.
pub(super) struct Lent {
    /// There until this is dropped.
    connection: Option<PgConnection>,
    made: Instant,
    /// Whether something asked of it was not answered yet.
    asked: bool,
    pool: Arc<Inner>,
    _turn: OwnedSemaphorePermit,
}

impl Lent {
    /// Asks something of the connection; who does tells by [`Lent::answered`] that all was answered.
    ///
    /// # Errors
    /// `Unavailable` if something is unanswered.
    pub(super) fn ask(&mut self) -> Result<&mut PgConnection> {
        if std::mem::replace(&mut self.asked, true) {
            return Err(StoreError::unavailable("its connection failed"));
        }
        self.connection.as_mut().ok_or_else(|| StoreError::unavailable("its connection failed"))
    }

    /// All connections that were made up to now are given up as they come back or are needed, this one among them: what is wrong
    /// with their sessions may stay so.
    pub(super) fn renounce(&self) {
        *self.pool.renounced.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    }

    /// Everything asked was answered: the connection can serve others.
    pub(super) const fn answered(&mut self) {
        self.asked = false;
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        if let Some(connection) = self.connection.take()
            && !self.asked
        {
            self.pool.take_back(connection, self.made);
        }
    }
}

/// A connection for reading; reports its use when dropped. Each statement has the time that an answer may take.
pub(super) struct Reader {
    lent: Lent,
    observer: Arc<dyn Observer>,
    begun: Instant,
}

impl Reader {
    pub(super) fn new(lent: Lent, observer: Arc<dyn Observer>, begun: Instant) -> Self {
        Self { lent, observer, begun }
    }

    /// Does a read of the connection within the time that an answer may take.
    async fn read<'s, T, F>(&'s mut self, work: impl FnOnce(&'s mut PgConnection) -> F) -> sqlx::Result<T>
    where
        F: Future<Output = sqlx::Result<T>> + 's,
    {
        let Lent { connection, asked, pool, .. } = &mut self.lent;
        let connection = connection.as_mut().filter(|_| !*asked).ok_or(sqlx::Error::WorkerCrashed)?;
        *asked = true;
        let result = pool.silence.answered_raw(pool.limit, work(connection)).await;
        // What the server refused it has answered, and what cannot be decoded has arrived.
        *asked = matches!(
            &result,
            Err(sqlx::Error::Io(_) | sqlx::Error::Tls(_) | sqlx::Error::Protocol(_) | sqlx::Error::WorkerCrashed)
        );
        result
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        self.observer.read_done(self.begun.elapsed());
    }
}

impl fmt::Debug for Reader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Reader").finish_non_exhaustive()
    }
}

impl<'c> Executor<'c> for &'c mut Reader {
    type Database = Postgres;

    fn fetch_many<'e, 'q: 'e, E>(self, query: E) -> BoxStream<'e, sqlx::Result<Either<PgQueryResult, PgRow>>>
    where
        'c: 'e,
        E: 'q + Execute<'q, Postgres>,
    {
        // The answer is taken whole: a caller who is slow would use up the time that it may take.
        let answer = async move { self.read(|connection| connection.fetch_many(query).try_collect::<Vec<_>>()).await };
        stream::once(answer).map_ok(|all| stream::iter(all.into_iter().map(Ok))).try_flatten().boxed()
    }

    fn fetch_optional<'e, 'q: 'e, E>(self, query: E) -> BoxFuture<'e, sqlx::Result<Option<PgRow>>>
    where
        'c: 'e,
        E: 'q + Execute<'q, Postgres>,
    {
        Box::pin(async move { self.read(|connection| connection.fetch_optional(query)).await })
    }

    fn prepare_with<'e>(self, sql: SqlStr, parameters: &'e [PgTypeInfo]) -> BoxFuture<'e, sqlx::Result<PgStatement>>
    where
        'c: 'e,
    {
        Box::pin(async move { self.read(|connection| connection.prepare_with(sql, parameters)).await })
    }

    fn describe<'e>(self, sql: SqlStr) -> BoxFuture<'e, sqlx::Result<Describe<Postgres>>>
    where
        'c: 'e,
    {
        Box::pin(async move { self.read(|connection| connection.describe(sql)).await })
    }
}
