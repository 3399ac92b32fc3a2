//! Times of records.

use std::time::{SystemTime, UNIX_EPOCH};

/// What this machine's clock says, microseconds since the Unix epoch.
pub(crate) fn system_us() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |age| age.as_micros());
    i64::try_from(now).unwrap_or(i64::MAX)
}

/// By how much times may be ahead of a clock that went back, µs.
const ADJUSTMENT_US: i64 = 60_000_000;

/// The time after `latest_us` that a clock at `now_us` gives.
pub(crate) fn following(now_us: i64, latest_us: i64) -> i64 {
    let ahead = latest_us.saturating_sub(now_us);
    if ahead > ADJUSTMENT_US { now_us } else { now_us.max(latest_us.saturating_add(1)) }
}

#[cfg(test)]
mod tests {
    use super::following;

    #[test]
    fn a_clock_that_is_adjusted_is_passed_and_one_that_is_set_back_is_followed() {
        assert_eq!(following(1_000, 10), 1_000);
        assert_eq!(following(1_000, 1_000), 1_001);
        assert_eq!(following(1_000, 60_000_999), 60_001_000);
        assert_eq!(following(1_000, 60_001_001), 1_000);
        assert_eq!(following(0, i64::MAX), 0);
    }
}
