//! What replicas tell each other: of runs whose streams are connected to them, and of the time that clients used of their workers.
//! None of it is asked for a decision, and all of it can be lost: the log has what happened, and shares even out from then on.

use std::time::Duration;

use async_trait::async_trait;
use bytes::Bytes;
use tokio::sync::watch;
use uuid::Uuid;

use crate::error::Result;
use crate::tenant::Tenant;

/// What a replica tells of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Presence {
    /// The run.
    pub run_id: Uuid,
    /// The tenant whose run it is.
    pub tenant: Tenant,
    /// Place in the order in which runs began.
    pub sequence: i64,
    /// Whether its stream is connected, or was until then.
    pub is_connected: bool,
    /// What it does.
    pub body: Bytes,
}

/// What another replica has told of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ToldPresence {
    /// The replica: a name of that process alone.
    pub replica: String,
    /// The run.
    pub run_id: Uuid,
    /// The tenant whose run it is.
    pub tenant: Tenant,
    /// Place in the order in which runs began.
    pub sequence: i64,
    /// Whether its stream is connected, or was until then.
    pub is_connected: bool,
    /// When it was told, microseconds since the Unix epoch by the database's clock.
    pub told_us: i64,
    /// How long ago that was.
    pub age: Duration,
    /// What it does; `None` where it was told longer ago than was asked for.
    pub body: Option<Bytes>,
}

/// What another replica has told of the time that a client used of its validation workers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ToldUse {
    /// The replica: a name of that process alone.
    pub replica: String,
    /// The client, as its shares are counted.
    pub client: String,
    /// In all, since it used any after a pause.
    pub used: Duration,
}

/// Keeps what replicas tell each other. Where one process has the database, nobody is told anything.
#[async_trait]
pub trait Presences {
    /// Tells of runs, in place of what this replica told of them before, and takes back what it told of `gone`. What
    /// any replica has not told again for long is removed. With `rings` the others are told to look at once.
    ///
    /// # Errors
    /// `TooLarge`, `Unavailable`.
    async fn tell_presences(&self, told: Vec<Presence>, gone: Vec<Uuid>, rings: bool) -> Result<()>;

    /// Changes when another replica rings: what it tells is to be looked at. It may not change where something is amiss, so
    /// that looking now and then is needed as well.
    fn watch_presences(&self) -> watch::Receiver<u64>;

    /// What other replicas have told, with the bodies of what they told within `window`.
    ///
    /// # Errors
    /// `Corrupt`, `Unavailable`.
    async fn presences(&self, window: Duration) -> Result<Vec<ToldPresence>>;

    /// Tells how much more clients have used of this replica's validation workers. What any replica has not told more of for long is
    /// removed.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn tell_use(&self, used: Vec<(String, Duration)>) -> Result<()>;

    /// What clients have used at other replicas.
    ///
    /// # Errors
    /// `Corrupt`, `Unavailable`.
    async fn told_use(&self) -> Result<Vec<ToldUse>>;

    /// Differs from an earlier one where machines were added, changed or removed meanwhile.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn machines_mark(&self) -> Result<[i64; 3]>;
}
