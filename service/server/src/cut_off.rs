//! Whether this replica is cut off from the database that it shares with others: whoever waits here for what only the database
//! knows is sent away, to a replica that reaches it.

use std::sync::Arc;

use tokio::sync::watch;

/// Whether it is. Cloning is cheap; clones are the same.
#[derive(Clone, Debug)]
pub struct CutOff {
    now: Arc<watch::Sender<bool>>,
}

impl Default for CutOff {
    fn default() -> Self {
        Self { now: Arc::new(watch::Sender::new(false)) }
    }
}

impl CutOff {
    /// Notes whether it is.
    pub(crate) fn set(&self, is_cut_off: bool) {
        self.now.send_if_modified(|now| std::mem::replace(now, is_cut_off) != is_cut_off);
    }

    /// Comes back once it is.
    pub(crate) fn begun(&self) -> impl Future<Output = ()> + Send + 'static {
        let (mut receiver, now) = (self.now.subscribe(), self.now.clone());
        async move {
            // The sender is kept until then.
            let _ = receiver.wait_for(|is_cut_off| *is_cut_off).await;
            drop(now);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn who_waits_is_told_and_who_comes_later_as_well() {
        let cut_off = CutOff::default();
        let waiting = tokio::spawn(cut_off.begun());
        cut_off.set(true);
        waiting.await.unwrap();
        cut_off.begun().await;
        cut_off.set(false);
        assert!(futures_util::FutureExt::now_or_never(cut_off.begun()).is_none());
    }
}
