//! What is done again, how often, and for how long.

use std::time::Duration;

use tokio::time::Instant;
use uuid::Uuid;

use super::fault::Remedy;
use crate::error::{Result, StoreError};

/// How often a transaction is repeated in between which others came.
const MOST_CONFLICTS: u32 = 12;
/// First and longest pause before a further try.
const PAUSES: [Duration; 2] = [Duration::from_millis(2), Duration::from_millis(500)];

/// How a transaction failed.
#[derive(Debug)]
pub(super) enum Failure {
    /// Before it was committed: nothing of it is there.
    Before(StoreError),
    /// While it was being committed: it may be there.
    During(StoreError),
}

/// How much longer a transaction is tried.
#[derive(Debug)]
pub(super) struct Patience {
    until: Instant,
    /// Whether it was tried with another connection.
    reconnected: bool,
    conflicts: u32,
    pause: Duration,
}

impl Patience {
    /// For a server that may be away for so long.
    pub(super) fn new(away: Duration) -> Self {
        Self { until: Instant::now() + away, reconnected: false, conflicts: 0, pause: PAUSES[0] }
    }

    /// Returns when to try again.
    ///
    /// # Errors
    /// Why not.
    pub(super) async fn again(&mut self, failure: Failure) -> Result<()> {
        let (error, remedy) = match failure {
            Failure::Before(error) => {
                let remedy = Remedy::of(&error);
                (error, remedy)
            }
            // What the server itself refused to commit is not there; what it did not answer may be.
            Failure::During(error) => {
                let refused = Remedy::of(&error) == Remedy::Again;
                (error, if refused { Remedy::Again } else { Remedy::None })
            }
        };
        match remedy {
            Remedy::None | Remedy::Renounce => return Err(error),
            Remedy::Again if self.conflicts == MOST_CONFLICTS => return Err(error),
            Remedy::Again => self.conflicts += 1,
            // However long a connection took to be found silent, a new one may work.
            Remedy::Reconnect if self.reconnected && Instant::now() >= self.until => return Err(error),
            Remedy::Reconnect => self.reconnected = true,
        }
        tracing::debug!(%error, "a transaction is tried again");
        // Of several in each other's way not all come back at once.
        let share = f64::from(Uuid::now_v7().as_bytes()[15]) / 256.0;
        tokio::time::sleep(self.pause.mul_f64(0.5 + share)).await;
        self.pause = (self.pause * 2).min(PAUSES[1]);
        Ok(())
    }
}
