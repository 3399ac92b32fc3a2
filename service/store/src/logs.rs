//! How far the logs of a tenant have come, and what of them is kept no longer.

/// Places in the logs of a tenant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LogPlaces {
    /// When the schema was made, and how long that took: no other store has both, and this one has them for ever.
    pub store: [i64; 2],
    /// State changes of jobs.
    pub events: LogPlace,
    /// Decisions.
    pub decisions: LogPlace,
}

/// Places in a log, of the records of one tenant.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LogPlace {
    /// Of the newest record, whether it is still there or not; 0 if there was none.
    pub newest: i64,
    /// Of the newest record that is not there any more; 0 if all are.
    pub removed: i64,
}
