//! What the server does not answer. A connection that was cut on its way is not told of it, so every answer has a limit;
//! and where one connection fell silent, the others that were used before it are not trusted either.

use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::watch;

use crate::error::Result;

/// How long the server may take for what costs it nothing: a sign of life, the beginning of a transaction.
pub(super) const TRIVIAL: Duration = Duration::from_secs(2);
/// How long it may take for anything, once a connection was found silent meanwhile.
const DOUBTFUL: Duration = Duration::from_secs(4);

/// When a connection was last found silent. Cloning is cheap; clones are the same.
#[derive(Debug, Clone)]
pub(super) struct Silence {
    /// When what was not answered was asked.
    last: Arc<watch::Sender<Option<Instant>>>,
}

impl Silence {
    pub(super) fn new() -> Self {
        Self { last: Arc::new(watch::channel(None).0) }
    }

    /// Whether a connection was found silent at or after a time.
    pub(super) fn since(&self, time: Instant) -> bool {
        self.last.borrow().is_some_and(|last| last >= time)
    }

    /// Comes back once a connection was found silent.
    pub(super) async fn broken(&self) {
        // The sender lives as long as this.
        let _ = self.last.subscribe().changed().await;
    }

    fn note(&self, asked: Instant) {
        self.last.send_modify(|last| *last = (*last).max(Some(asked)));
    }

    /// The result of `work`, or that the server did not answer within `limit`.
    ///
    /// # Errors
    /// As `work`, and `Unavailable`.
    pub(super) async fn answered<T>(&self, limit: Duration, work: impl Future<Output = Result<T>>) -> Result<T> {
        self.within(limit, work).await.unwrap_or_else(|silent| Err(silent.into()))
    }

    /// As [`Silence::answered`], of what speaks of errors as sqlx does.
    ///
    /// # Errors
    /// As `work`, and `Io`.
    pub(super) async fn answered_raw<T>(
        &self,
        limit: Duration,
        work: impl Future<Output = sqlx::Result<T>>,
    ) -> sqlx::Result<T> {
        self.within(limit, work).await.unwrap_or_else(Err)
    }

    async fn within<T>(&self, limit: Duration, work: impl Future<Output = T>) -> sqlx::Result<T> {
        let begun = Instant::now();
        let mut last = self.last.subscribe();
        let doubtful = async {
            tokio::time::sleep(DOUBTFUL).await;
            // The sender lives as long as this.
            let _ = last.wait_for(|last| last.is_some_and(|last| last + TRIVIAL >= begun)).await;
        };
        tokio::select! {
            biased;
            result = work => return Ok(result),
            () = tokio::time::sleep(limit) => {}
            () = doubtful => {}
        }
        self.note(begun);
        Err(sqlx::Error::Io(io::Error::new(io::ErrorKind::TimedOut, "no answer in time")))
    }
}
