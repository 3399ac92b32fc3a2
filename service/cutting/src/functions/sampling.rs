//! How finely a wave is sampled: the same for every function that superposes one.

use feedwave_program::Finding;

use crate::shared::wording::decimal;

/// Samples per vibration below which the wave counts as coarse.
pub(crate) const FINE_SAMPLES: f64 = 8.0;
/// Limits are often met exactly, and 1/(f·Δt) is rounded.
const ROUNDING: f64 = 1e-9;

/// How finely a wave is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sampling {
    Fine,
    Coarse,
    /// Below two samples per vibration: another, slower wave would be cut.
    BelowNyquist,
}

impl Sampling {
    /// A wave of so many samples per vibration.
    pub(crate) fn of(samples_per_vibration: f64) -> Self {
        let is_below = |limit: f64| samples_per_vibration < limit * (1.0 - ROUNDING);
        match () {
            () if is_below(2.0) => Self::BelowNyquist,
            () if is_below(FINE_SAMPLES) => Self::Coarse,
            () => Self::Fine,
        }
    }
}

/// Suggests the longest period at which a wave is sampled finely.
pub(crate) fn suggest_period(finding: Finding, frequency_hz: f64) -> Finding {
    let period_ms = 1_000.0 / (FINE_SAMPLES * frequency_hz);
    let message = format!("use a period of at most {} ms", decimal(period_ms, 3));
    finding.suggest_value(message, None, "period", period_ms / 1_000.0, "s")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_that_is_met_but_for_rounding_is_met() {
        assert_eq!(Sampling::of(8.0), Sampling::Fine);
        assert_eq!(Sampling::of(1.0 / (125.0 * 1e-3)), Sampling::Fine);
        assert_eq!(Sampling::of(7.9), Sampling::Coarse);
        assert_eq!(Sampling::of(2.0), Sampling::Coarse);
        assert_eq!(Sampling::of(1.9), Sampling::BelowNyquist);
    }
}
