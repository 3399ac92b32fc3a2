//! What other replicas do to jobs that this one works on, and what clients use of all replicas together.

use std::collections::HashMap;
use std::time::Duration;

use feedwave_store::{JobState, ToldUse};
use tokio::time::MissedTickBehavior;

use super::Engine;
use crate::events::EventReader;

/// Ends the work on jobs that were cancelled or deleted, wherever that was asked for, until the service ends. Where one
/// process has the database, nothing is to be done.
pub(super) async fn follow(engine: Engine, mut events: EventReader) {
    if engine.inner.store.lease().is_none() {
        return;
    }
    while let Some(events) = events.next().await {
        for event in events {
            if matches!(event.to_state, None | Some(JobState::Cancelled)) {
                engine.cancel_job(event.job_id);
            }
        }
    }
}

/// How often replicas tell each other what clients used: so much their shares may be apart for a while.
const PERIOD: Duration = Duration::from_millis(100);

/// Tells other replicas what clients used of this one's workers, and charges what they used there, until the service ends. Where one
/// process has the database, nothing is to be done.
pub(super) async fn share(engine: Engine) {
    let inner = &engine.inner;
    if inner.store.lease().is_none() {
        return;
    }
    let mut rounds = tokio::time::interval(PERIOD);
    rounds.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut elsewhere = Elsewhere::default();
    while inner.draining.run_until_cancelled(rounds.tick()).await.is_some() {
        let untold = inner.turns.take_untold();
        if untold.is_empty() && inner.turns.is_idle() {
            // What is used meanwhile is nobody's loss here.
            elsewhere = Elsewhere::default();
            continue;
        }
        let exchange = async {
            if !untold.is_empty() {
                inner.store.tell_use(untold).await?;
            }
            inner.store.told_use().await
        };
        match exchange.await {
            Ok(told) => inner.turns.charge_elsewhere(elsewhere.further(&told)),
            Err(error) => tracing::debug!(%error, "what clients use of other replicas is not known"),
        }
    }
}

/// What was heard last, by replica and client.
#[derive(Debug, Default)]
struct Elsewhere(Option<HashMap<(String, String), Duration>>);

impl Elsewhere {
    /// What was used since the last time; at the first time nothing.
    fn further<'a>(&mut self, told: &'a [ToldUse]) -> Vec<(&'a str, Duration)> {
        let key = |told: &ToldUse| (told.replica.clone(), told.client.clone());
        let now = told.iter().map(|told| (key(told), told.used)).collect();
        let Some(before) = self.0.replace(now) else { return Vec::new() };
        let further = told.iter().map(|told| {
            let known = before.get(&key(told)).copied().unwrap_or_default();
            // One that is less was counted from nothing again.
            (told.client.as_str(), told.used.checked_sub(known).unwrap_or(told.used))
        });
        further.filter(|(_, used)| !used.is_zero()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_used_elsewhere_is_counted_once_from_the_first_time_on() {
        let told = |replica: &str, client: &str, ms| ToldUse {
            replica: replica.to_owned(),
            client: client.to_owned(),
            used: Duration::from_millis(ms),
        };
        let ms = Duration::from_millis;
        let mut elsewhere = Elsewhere::default();
        assert_eq!(elsewhere.further(&[told("b", "one", 7_000)]), []);
        let next = [told("b", "one", 7_100), told("c", "one", 50), told("b", "two", 30)];
        assert_eq!(elsewhere.further(&next), [("one", ms(100)), ("one", ms(50)), ("two", ms(30))]);
        assert_eq!(elsewhere.further(&next), []);
        assert_eq!(elsewhere.further(&[told("b", "one", 20)]), [("one", ms(20))]);
    }
}
