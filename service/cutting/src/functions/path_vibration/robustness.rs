//! How surely the chip of a cut breaks when feed, amplitude and spindle speed are known within tolerances only
//! (docs/functions/path-vibration.md, "How surely does it break?").
//!
//! The chip breaks where the ratio ρ = A/f_r is at least c(S) = 1/(2·|sin(π·60·f/S)|). Over a range of speeds c is largest at one of
//! its ends, or unbounded where 60·f/S is whole within it, so the worst case is exact. The share is that of the box of
//! tolerances, each value as likely as any other of its range: for one speed the share of amplitudes and feeds is a closed form, and
//! the speeds are summed up in equal steps between the places at which the form changes.

use super::CutCondition;
use super::chip::FeedCoupling;
use super::sin_turns;

#[cfg(test)]
mod tests;

/// Steps of the sum over the spindle speeds.
const SPEED_STEPS: u32 = 4_096;

/// By which shares values may differ from what is programmed, 0 to below 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CutTolerances {
    /// Spindle speed, both ways.
    pub speed: f64,
    /// Feed of a revolution, both ways; a feed per minute changes with the speed beside.
    pub feed: f64,
    /// Amplitude, both ways.
    pub amplitude: f64,
}

/// What becomes of the chip within the tolerances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChipRobustness {
    /// 2A·|sin πD|/f_r as programmed: the chip breaks at 1 and above.
    pub margin: f64,
    /// The least of all values within the tolerances; 0 where D is whole for one of them.
    pub worst_margin: f64,
    /// Share of all values within the tolerances for which the chip breaks, 0 to 1; to 1e-3.
    pub share: f64,
    /// Largest feed of a revolution, as programmed, with which it breaks for all values within the tolerances, mm.
    pub largest_feed_per_rev_mm: f64,
}

/// How surely the chip of a cut breaks. A cut that is not [valid](CutCondition::is_valid), or tolerances that are not within 0
/// and 1, break nothing.
#[must_use]
pub fn chip_robustness(cut: &CutCondition, tolerances: &CutTolerances) -> ChipRobustness {
    let CutTolerances { speed, feed, amplitude } = *tolerances;
    let are_tolerances = [speed, feed, amplitude].into_iter().all(|share| (0.0..1.0).contains(&share));
    if !cut.is_valid() || !are_tolerances {
        return ChipRobustness { margin: 0.0, worst_margin: 0.0, share: 0.0, largest_feed_per_rev_mm: 0.0 };
    }
    let worst = worst_openness(cut, speed) * (1.0 - amplitude) / (1.0 + feed);
    ChipRobustness {
        margin: cut.breaking_margin(),
        worst_margin: worst,
        share: share(cut, tolerances),
        largest_feed_per_rev_mm: worst * cut.feed_per_rev_mm,
    }
}

/// 2A·|sin πD|/f_r at a share of the programmed speed.
fn openness(cut: &CutCondition, share: f64) -> f64 {
    let coupling = match cut.feed_coupling {
        FeedCoupling::PerRevolution => 1.0,
        FeedCoupling::PerMinute => share,
    };
    let vibrations = cut.vibrations_per_rev() / share;
    let lag = vibrations - vibrations.round();
    2.0 * cut.amplitude_mm * sin_turns(0.5 * lag).abs() / cut.feed_per_rev_mm * coupling
}

/// The least of it over the tolerance of the speed.
fn worst_openness(cut: &CutCondition, speed: f64) -> f64 {
    let vibrations = cut.vibrations_per_rev();
    let [most, least] = [1.0 - speed, 1.0 + speed].map(|share| vibrations / share);
    if most.floor() >= least.ceil() {
        return 0.0;
    }
    openness(cut, 1.0 - speed).min(openness(cut, 1.0 + speed))
}

fn share(cut: &CutCondition, tolerances: &CutTolerances) -> f64 {
    let at = |step: u32| {
        let place = (f64::from(step) + 0.5) / f64::from(SPEED_STEPS);
        let speed = 1.0 - tolerances.speed + 2.0 * tolerances.speed * place;
        share_of_ratios(openness(cut, speed), tolerances)
    };
    if tolerances.speed == 0.0 {
        return at(0);
    }
    (0..SPEED_STEPS).map(at).sum::<f64>() / f64::from(SPEED_STEPS)
}

/// Share of the amplitudes a ∈ [1 − α, 1 + α] and feeds b ∈ [1 − β, 1 + β] with openness·a/b ≥ 1.
fn share_of_ratios(openness: f64, tolerances: &CutTolerances) -> f64 {
    let CutTolerances { feed, amplitude, .. } = *tolerances;
    let [low, high] = [1.0 - amplitude, 1.0 + amplitude];
    let [least, most] = [1.0 - feed, 1.0 + feed];
    // For an amplitude a all feeds up to openness·a: 0 up to the amplitude `first`, all from `full` on, linear between.
    if openness * high < least {
        return 0.0;
    }
    let of_feeds = |a: f64| if feed == 0.0 { 1.0 } else { ((openness * a - least) / (most - least)).clamp(0.0, 1.0) };
    let (first, full) = ((least / openness).clamp(low, high), (most / openness).clamp(low, high));
    if amplitude == 0.0 {
        return of_feeds(1.0) * if openness >= least { 1.0 } else { 0.0 };
    }
    let linear = 0.5 * (of_feeds(first) + of_feeds(full)) * (full - first);
    (linear + (high - full)) / (high - low)
}
