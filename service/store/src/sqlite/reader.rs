//! A connection for reading, whose every answer has a limit: a disk that does not answer by then may never do.

use std::fmt;
use std::sync::atomic::Ordering;
use std::time::Instant;

use futures_util::future::BoxFuture;
use futures_util::stream::{self, BoxStream};
use futures_util::{StreamExt as _, TryStreamExt as _};
use sqlx::pool::PoolConnection;
use sqlx::sqlite::{SqliteQueryResult, SqliteRow, SqliteStatement, SqliteTypeInfo};
use sqlx::{Describe, Either, Execute, Executor, SqlStr, Sqlite};

use super::Inner;
use crate::error::StoreError;

/// A connection for reading; reports its use when dropped.
///
/// Each row has the time that an answer may take, and what SQLite tells as damage is held against the files themselves.
pub(super) struct Reader<'a> {
    connection: PoolConnection<Sqlite>,
    inner: &'a Inner,
    begun: Instant,
}

impl<'a> Reader<'a> {
    /// Waits until a connection is free, for as long as the options of the store say.
    pub(super) async fn of(inner: &'a Inner) -> sqlx::Result<Self> {
        let begun = Instant::now();
        Ok(Self { connection: inner.readers.acquire().await?, inner, begun })
    }
}

impl Inner {
    /// What a disk answers in time.
    async fn answered<T>(&self, work: impl Future<Output = sqlx::Result<T>>) -> sqlx::Result<T> {
        let Ok(answer) = tokio::time::timeout(self.options.read_timeout, work).await else {
            return Err(StoreError::unavailable("it does not answer reads in time").into());
        };
        match answer {
            Err(error) if super::is_damage(&error) => Err(self.read_fault().await.map_or(error, Into::into)),
            answer => answer,
        }
    }

    /// Why the files cannot be read; `None` where they can.
    pub(super) async fn read_fault(&self) -> Option<StoreError> {
        self.reading.fault(&self.options.path).await
    }
}

impl Drop for Reader<'_> {
    fn drop(&mut self) {
        self.inner.reads.fetch_add(1, Ordering::Relaxed);
        self.inner.settings.observer.read_done(self.begun.elapsed());
    }
}

impl fmt::Debug for Reader<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Reader").finish_non_exhaustive()
    }
}

impl<'c> Executor<'c> for &'c mut Reader<'_> {
    type Database = Sqlite;

    fn fetch_many<'e, 'q: 'e, E>(self, query: E) -> BoxStream<'e, sqlx::Result<Either<SqliteQueryResult, SqliteRow>>>
    where
        'c: 'e,
        E: 'q + Execute<'q, Sqlite>,
    {
        let Reader { connection, inner, .. } = self;
        let inner: &'e Inner = inner;
        let rows = connection.fetch_many(query);
        let next = move |mut rows: BoxStream<'e, _>| async move {
            let row = inner.answered(rows.try_next()).await?;
            Ok(row.map(|row| (row, rows)))
        };
        stream::try_unfold(rows, next).boxed()
    }

    fn fetch_optional<'e, 'q: 'e, E>(self, query: E) -> BoxFuture<'e, sqlx::Result<Option<SqliteRow>>>
    where
        'c: 'e,
        E: 'q + Execute<'q, Sqlite>,
    {
        Box::pin(self.inner.answered(self.connection.fetch_optional(query)))
    }

    fn prepare_with<'e>(
        self,
        sql: SqlStr,
        parameters: &'e [SqliteTypeInfo],
    ) -> BoxFuture<'e, sqlx::Result<SqliteStatement>>
    where
        'c: 'e,
    {
        Box::pin(self.inner.answered(self.connection.prepare_with(sql, parameters)))
    }

    fn describe<'e>(self, sql: SqlStr) -> BoxFuture<'e, sqlx::Result<Describe<Sqlite>>>
    where
        'c: 'e,
    {
        Box::pin(self.inner.answered(self.connection.describe(sql)))
    }
}
