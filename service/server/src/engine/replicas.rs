//! What other replicas do to jobs that this one works on.

use feedwave_store::JobState;

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
