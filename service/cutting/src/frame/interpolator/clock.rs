//! Instants on the interpolation grid.

use serde::{Deserialize, Serialize};

/// The instant `period·Δt + lead_s` with 0 ≤ `lead_s` < Δt.
///
/// Time is kept as a whole number of periods and a remainder: a plain sum of seconds would lose so many bits
/// over a long program that the third difference of the positions became noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Clock {
    pub(super) period: u64,
    pub(super) lead_s: f64,
}

impl Clock {
    /// The instant `duration_s` later.
    pub(super) fn advanced(self, duration_s: f64, period_s: f64) -> Self {
        let total_s = self.lead_s + duration_s;
        let mut periods = (total_s / period_s).floor();
        let mut lead_s = total_s - periods * period_s;
        // The quotient is rounded: put the remainder back into its interval.
        if lead_s < 0.0 {
            periods -= 1.0;
            lead_s += period_s;
        }
        if lead_s >= period_s {
            periods += 1.0;
            lead_s -= period_s;
        }
        Self { period: self.period.saturating_add(periods.max(0.0) as u64), lead_s: lead_s.max(0.0) }
    }

    /// The first grid instant at or after this one.
    pub(super) fn aligned(self) -> Self {
        if self.lead_s > 0.0 { Self { period: self.period + 1, lead_s: 0.0 } } else { self }
    }

    /// Time from this instant to its [`Clock::aligned`], s.
    pub(super) fn to_alignment_s(self, period_s: f64) -> f64 {
        if self.lead_s > 0.0 { period_s - self.lead_s } else { 0.0 }
    }

    /// Time since the grid instant `period`, s; `period` must not lie later.
    pub(super) fn since_s(self, period: u64, period_s: f64) -> f64 {
        (self.period - period) as f64 * period_s + self.lead_s
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn remainder_stays_in_its_period(lead in 0.0..1.0_f64, duration in 0.0..1e6_f64, period_us in 50_u32..20_000) {
            let period_s = f64::from(period_us) * 1e-6;
            let start = Clock { period: 7, lead_s: lead * period_s * 0.999_999 };
            let end = start.advanced(duration, period_s);
            prop_assert!(end.lead_s >= 0.0 && end.lead_s < period_s);
            let elapsed = end.since_s(7, period_s) - start.lead_s;
            prop_assert!((elapsed - duration).abs() <= 1e-9 * duration.max(1.0), "{elapsed} for {duration}");
        }
    }

    #[test]
    fn a_grid_instant_is_its_own_alignment() {
        let on_grid = Clock { period: 3, lead_s: 0.0 };
        assert_eq!(on_grid.aligned(), on_grid);
        assert_eq!(on_grid.to_alignment_s(1e-3), 0.0);
        let between = Clock { period: 3, lead_s: 2.5e-4 };
        assert_eq!(between.aligned(), Clock { period: 4, lead_s: 0.0 });
        assert_eq!(between.to_alignment_s(1e-3), 1e-3 - 2.5e-4);
    }
}
