//! Receipts of a live run: how many setpoints the client has taken, and how long it has been owing one.

use std::time::{Duration, Instant};

/// What the client has acknowledged of what it was sent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Receipts {
    received: u64,
    /// How long setpoints may wait for a receipt.
    patience: Duration,
    /// Since when there are some without, and no receipt has come.
    owing_since: Option<Instant>,
}

impl Receipts {
    pub(super) const fn new(received: u64, patience: Duration) -> Self {
        Self { received, patience, owing_since: None }
    }

    /// Setpoints that the client has taken, counted from the first.
    pub(super) const fn received(&self) -> u64 {
        self.received
    }

    /// How long setpoints may wait for a receipt.
    pub(super) const fn patience(&self) -> Duration {
        self.patience
    }

    /// Setpoints were handed out.
    pub(super) fn owes(&mut self, now: Instant) {
        self.owing_since.get_or_insert(now);
    }

    /// The client has taken `received` of the `sent` setpoints that were handed out; it need not be the newest receipt.
    pub(super) fn receive(&mut self, received: u64, sent: u64, now: Instant) {
        if received > self.received {
            self.received = received;
            self.owing_since = (received < sent).then_some(now);
        }
    }

    /// When the patience ends; `None` while nothing is owed.
    pub(super) fn overdue_at(&self) -> Option<Instant> {
        // Beyond what an instant can say there is no end.
        self.owing_since.and_then(|since| since.checked_add(self.patience))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patience_begins_anew_with_every_receipt_and_ends_with_the_last() {
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs(seconds);
        let mut receipts = Receipts::new(10, Duration::from_secs(60));
        assert_eq!(receipts.overdue_at(), None, "nothing was sent");
        receipts.owes(at(1));
        receipts.owes(at(50));
        assert_eq!(receipts.overdue_at(), Some(at(61)), "more setpoints do not prolong it");
        receipts.receive(10, 100, at(55));
        assert_eq!(receipts.overdue_at(), Some(at(61)), "nor does a receipt of nothing new");
        receipts.receive(40, 100, at(58));
        assert_eq!((receipts.received(), receipts.overdue_at()), (40, Some(at(118))));
        receipts.receive(100, 100, at(59));
        assert_eq!((receipts.received(), receipts.overdue_at()), (100, None));
        receipts.owes(at(70));
        assert_eq!(receipts.overdue_at(), Some(at(130)));
    }
}
