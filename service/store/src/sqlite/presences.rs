//! Presences in SQLite, which one process has: there is nobody to be told.

use std::time::Duration;

use async_trait::async_trait;
use tokio::sync::watch;
use uuid::Uuid;

use super::SqliteStore;
use crate::error::Result;
use crate::presences::{Presence, Presences, ToldPresence, ToldUse};
use crate::sql::documents::{MACHINES_MARK, machines_mark};

#[async_trait]
impl Presences for SqliteStore {
    async fn tell_presences(&self, _told: Vec<Presence>, _gone: Vec<Uuid>, _rings: bool) -> Result<()> {
        Ok(())
    }

    fn watch_presences(&self) -> watch::Receiver<u64> {
        watch::Sender::new(0).subscribe()
    }

    async fn presences(&self, _window: Duration) -> Result<Vec<ToldPresence>> {
        Ok(Vec::new())
    }

    async fn tell_use(&self, _used: Vec<(String, Duration)>) -> Result<()> {
        Ok(())
    }

    async fn told_use(&self) -> Result<Vec<ToldUse>> {
        Ok(Vec::new())
    }

    async fn machines_mark(&self) -> Result<[i64; 3]> {
        machines_mark(&sqlx::query(MACHINES_MARK).fetch_one(&mut self.reader().await?).await?)
    }
}
