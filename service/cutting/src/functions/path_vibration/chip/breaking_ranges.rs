//! For which numbers of vibrations per revolution D the chip breaks: at most one range in each interval between
//! two integers, since |sin πD| is one concave arch there.

use core::f64::consts::PI;

use super::{BREAKING_ALLOWANCE, CutCondition, FeedCoupling};
use feedwave_motion::sin_turns;

/// Steps of a bisection down to neighbouring doubles in [0, 1].
const BISECTION_STEPS: u32 = 60;

/// The condition |sin πD| ≥ f_r/(2A), as D changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum BreakingRanges {
    /// f_r stays: the right side is this constant.
    Constant(f64),
    /// Feed per minute at constant frequency: f_r = F/S = (F/60f)·D, so the right side is this value times D.
    Proportional(f64),
}

/// Where D lies among the ranges that break the chip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Neighbours {
    /// The range that D lies in.
    pub(super) containing: Option<(f64, f64)>,
    /// Upper end of the nearest range below D.
    pub(super) below: Option<f64>,
    /// Lower end of the nearest range above D.
    pub(super) above: Option<f64>,
}

impl BreakingRanges {
    /// The ranges when the spindle speed changes and the programmed feed stays.
    pub(super) fn when_speed_changes(condition: &CutCondition) -> Self {
        let level = condition.feed_per_rev_mm / (2.0 * condition.amplitude_mm);
        match condition.feed_coupling {
            FeedCoupling::PerRevolution => Self::Constant(level),
            FeedCoupling::PerMinute => Self::Proportional(level / condition.vibrations_per_rev()),
        }
    }

    /// Whether the chip breaks at D.
    pub(super) fn breaks_at(self, vibrations_per_rev: f64) -> bool {
        let lag = super::reduced_lag(vibrations_per_rev);
        super::surface::sin_half_turns(lag).abs() >= self.level_at(vibrations_per_rev) * (1.0 - BREAKING_ALLOWANCE)
    }

    fn level_at(self, vibrations_per_rev: f64) -> f64 {
        match self {
            Self::Constant(level) => level,
            Self::Proportional(slope) => slope * vibrations_per_rev,
        }
    }

    /// The range that breaks the chip between the integers `lobe` and `lobe` + 1.
    pub(super) fn in_lobe(self, lobe: f64) -> Option<(f64, f64)> {
        match self {
            Self::Constant(level) => {
                let edge = (level <= 1.0 + BREAKING_ALLOWANCE).then(|| libm::asin(level.min(1.0)) / PI)?;
                Some((lobe + edge, lobe + 1.0 - edge))
            }
            Self::Proportional(slope) => {
                // sin πx − slope·(lobe + x) is concave on [0, 1]; its top separates the two roots.
                let excess = |x: f64| sin_turns(0.5 * x) - slope * (lobe + x);
                let top = libm::acos((slope / PI).min(1.0)) / PI;
                let height = excess(top);
                if !(height >= -BREAKING_ALLOWANCE && top > 0.0) {
                    return None;
                }
                if height <= 0.0 {
                    return Some((lobe + top, lobe + top));
                }
                // D = 0 itself, an infinitely fast spindle, is the lower root of the first lobe.
                let low = if lobe == 0.0 { 0.0 } else { root(excess, 0.0, top) };
                Some((lobe + low, lobe + root(excess, 1.0, top)))
            }
        }
    }

    /// The last lobe that has a range, at most `lobe`.
    fn last_lobe_up_to(self, lobe: f64) -> Option<f64> {
        let mut candidate = match self {
            Self::Constant(_) => lobe,
            // The arch is 1 high, so the level passes it before D = 1/slope.
            Self::Proportional(slope) => lobe.min((1.0 / slope).floor()),
        };
        // At most two steps: half a lobe before D = 1/slope the arch is still above the level.
        for _ in 0..4 {
            if candidate < 0.0 {
                return None;
            }
            if self.in_lobe(candidate).is_some() {
                return Some(candidate);
            }
            candidate -= 1.0;
        }
        None
    }

    /// Where D lies among the ranges.
    pub(super) fn around(self, vibrations_per_rev: f64) -> Neighbours {
        let lobe = vibrations_per_rev.floor();
        let here = self.in_lobe(lobe);
        let range_below = || {
            let lower = self.last_lobe_up_to(lobe - 1.0)?;
            self.in_lobe(lower).map(|range| range.1)
        };
        let range_above = || self.in_lobe(lobe + 1.0).map(|range| range.0);
        match here {
            Some((low, _)) if vibrations_per_rev < low => {
                Neighbours { containing: None, below: range_below(), above: Some(low) }
            }
            Some((_, high)) if vibrations_per_rev > high => {
                Neighbours { containing: None, below: Some(high), above: range_above() }
            }
            containing => Neighbours { containing, below: range_below(), above: range_above() },
        }
    }
}

/// The zero of `excess` between `outside`, where it is not positive, and `inside`, where it is: the last place
/// found to be inside.
fn root(excess: impl Fn(f64) -> f64, mut outside: f64, mut inside: f64) -> f64 {
    for _ in 0..BISECTION_STEPS {
        let middle = 0.5 * (outside + inside);
        if excess(middle) >= 0.0 {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}
