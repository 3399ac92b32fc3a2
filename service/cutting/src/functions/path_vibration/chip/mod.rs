//! Will the chip break? (docs/functions/path-vibration.md, "Will the chip break?"; ES 2 634 340 T3)
//!
//! The tool cuts over the surface that all earlier revolutions left. At vibration phase u the uncut thickness is
//! h(u) = min over q ≥ 1 of [q·f_r + 2A·sin(πqD)·cos(u − πqD)], D vibrations per revolution, and the chip is cut
//! through where h ≤ 0.
//!
//! Two facts make the figures exact and cheap. The chip breaks if and only if 2A·|sin πD| ≥ f_r. And since
//! h_q depends on q·D modulo 1 only, revolution q + m is hidden behind revolution q everywhere as soon as
//! 2A·|sin πmD| ≤ m·f_r: the first such m bounds how far back any surface is left to see.

mod breaking_ranges;
mod surface;
mod surface_speed;

use breaking_ranges::{BreakingRanges, Neighbours};
pub use surface::thickness;
use surface::{Surface, reduced_lag};
pub use surface_speed::{LinearSpan, SpanFeed, SurfaceSpeedAnalysis, SurfaceSpeedReport, UnbrokenSpan};

/// How the feed per revolution depends on the spindle speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FeedCoupling {
    /// Feed programmed in mm/rev: fixed when the spindle speed changes.
    PerRevolution,
    /// Feed programmed in mm/min (or as inverse time): f_r = F/S.
    PerMinute,
}

/// A steady cut with vibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutCondition {
    /// Feed along the path f_r, mm/rev.
    pub feed_per_rev_mm: f64,
    /// Vibration amplitude A, mm.
    pub amplitude_mm: f64,
    /// Vibration frequency f, Hz.
    pub frequency_hz: f64,
    /// Spindle speed S, rev/min.
    pub spindle_rev_per_min: f64,
    /// Work diameter at the cut, mm; 0 where it is unknown.
    pub diameter_mm: f64,
    /// What a change of spindle speed does to the feed per revolution.
    pub feed_coupling: FeedCoupling,
}

/// What becomes of the chip of a steady cut.
#[derive(Clone, Debug, PartialEq)]
pub struct ChipReport {
    /// The cut that was analysed.
    pub condition: CutCondition,
    /// D = 60·f/S.
    pub vibrations_per_rev: f64,
    /// Q = 2A/f_r.
    pub amplitude_ratio: f64,
    /// Whether the chip is cut through at all: 2A·|sin πD| ≥ f_r.
    pub broken: bool,
    /// Share of a revolution, averaged over many, in which the tool cuts air; over all earlier revolutions.
    pub air_share: f64,
    /// The same against the previous revolution only, acos(1/(Q·|sin πD|))/π: never above [`Self::air_share`].
    pub air_share_previous_revolution: f64,
    /// Largest uncut chip thickness, mm.
    pub largest_thickness_mm: f64,
    /// Breaks per revolution, averaged over many; 0 when unbroken.
    pub breaks_per_rev: f64,
    /// Longest chip on the work's circumference, mm; `None` when unbroken or the diameter is unknown.
    pub longest_chip_mm: Option<f64>,
    /// Mean chip on the work's circumference, mm; `None` when unbroken or the diameter is unknown.
    pub mean_chip_mm: Option<f64>,
    /// Smallest amplitude that breaks the chip at this frequency and speed, mm; `None` at integer D.
    pub min_amplitude_mm: Option<f64>,
    /// Nearest frequencies from which on this amplitude breaks the chip, Hz; absent when it is broken already or
    /// none does.
    pub breaking_frequencies_hz: Nearest,
    /// Frequencies of half-integer D around the present one, where the smallest amplitude (f_r/2) suffices, Hz;
    /// nearest first.
    pub recommended_frequencies_hz: Vec<f64>,
    /// Nearest spindle speeds from which on this amplitude breaks the chip, rev/min; absent when it is broken
    /// already or none does.
    pub breaking_spindle_rev_per_min: Nearest,
    /// Spindle speeds of half-integer D around the present one, rev/min; nearest first.
    pub recommended_spindle_rev_per_min: Vec<f64>,
    /// How far the spindle speed may stray before the chip no longer breaks; `None` when it is unbroken.
    pub spindle_speed_margin: Option<SpindleSpeedMargin>,
    /// Earlier revolutions whose surface can be seen by the tool; more do not change the figures.
    pub earlier_revolutions: u32,
    /// Whether all of them were taken into account. Beyond [`MAX_EARLIER_REVOLUTIONS`] the air share is a lower
    /// and the largest thickness an upper bound; whether the chip breaks is exact in any case.
    pub exact: bool,
}

/// The nearest values on either side of the present one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nearest {
    /// Nearest lower value.
    pub below: Option<f64>,
    /// Nearest higher value.
    pub above: Option<f64>,
}

/// Deviation of the spindle speed within which the chip stays broken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpindleSpeedMargin {
    /// Downwards, rev/min.
    pub minus_rev_per_min: f64,
    /// Upwards, rev/min; `None` when no higher speed leaves the chip unbroken.
    pub plus_rev_per_min: Option<f64>,
}

impl SpindleSpeedMargin {
    /// The smaller of the two, rev/min.
    pub(crate) fn closest_rev_per_min(&self) -> f64 {
        self.minus_rev_per_min.min(self.plus_rev_per_min.unwrap_or(f64::INFINITY))
    }
}

/// Most earlier revolutions that are taken into account. Q bounds how many matter, so programs that cut
/// anything need a handful; the limit keeps absurd ones fast.
pub const MAX_EARLIER_REVOLUTIONS: u32 = 1 << 14;

/// Relative allowance on 2A·|sin πD| ≥ f_r, so that the limits computed from it (smallest amplitude, speeds and
/// frequencies) count as breaking in spite of their rounding.
const BREAKING_ALLOWANCE: f64 = 1e-12;

impl CutCondition {
    /// D = 60·f/S, vibrations per spindle revolution.
    #[must_use]
    pub fn vibrations_per_rev(&self) -> f64 {
        60.0 * self.frequency_hz / self.spindle_rev_per_min
    }

    /// Length of path of one vibration, f_r/D, mm.
    pub(crate) fn vibration_mm(&self) -> f64 {
        self.feed_per_rev_mm / self.vibrations_per_rev()
    }

    /// How far beyond breaking the cut is: 2A·|sin πD|/f_r. The chip breaks at 1 and above; 0 at integer D and for
    /// a condition that is not [valid](Self::is_valid).
    #[must_use]
    pub fn breaking_margin(&self) -> f64 {
        if !self.is_valid() {
            return 0.0;
        }
        let lag = reduced_lag(self.vibrations_per_rev());
        2.0 * self.amplitude_mm * surface::sin_half_turns(lag).abs() / self.feed_per_rev_mm
    }

    /// Whether the chip is cut through at all.
    #[must_use]
    pub fn breaks_chip(&self) -> bool {
        reaches_through(self.breaking_margin())
    }

    /// How far the spindle speed may stray before the chip no longer breaks; `None` when it is unbroken.
    pub(crate) fn spindle_speed_margin(&self) -> Option<SpindleSpeedMargin> {
        let spindle_at = |vibrations: f64| 60.0 * self.frequency_hz / vibrations;
        let by_speed = || BreakingRanges::when_speed_changes(self).around(self.vibrations_per_rev());
        self.breaks_chip().then(|| spindle_speed_margin(self, by_speed(), spindle_at))
    }

    /// Whether feed, amplitude, frequency and spindle speed are positive numbers whose ratios are finite.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let positive = |value: f64| value > 0.0 && value.is_finite();
        [self.feed_per_rev_mm, self.amplitude_mm, self.frequency_hz, self.spindle_rev_per_min].into_iter().all(positive)
            && positive(self.vibrations_per_rev())
            && positive(2.0 * self.amplitude_mm / self.feed_per_rev_mm)
    }
}

/// 2A·|sin πD|/f_r ≥ 1, within the rounding of the limits computed from it.
pub(crate) fn reaches_through(margin: f64) -> bool {
    margin >= 1.0 - BREAKING_ALLOWANCE
}

/// Analyses a steady cut. A condition that is not [valid](CutCondition::is_valid) never breaks the chip and has
/// neither limits nor recommendations.
#[must_use]
pub fn analyse(condition: &CutCondition) -> ChipReport {
    if !condition.is_valid() {
        return without_vibration(condition);
    }
    let vibrations_per_rev = condition.vibrations_per_rev();
    let amplitude_ratio = 2.0 * condition.amplitude_mm / condition.feed_per_rev_mm;
    let margin = condition.breaking_margin();
    let broken = reaches_through(margin);
    let surface = Surface::new(condition);
    let air = surface.air();
    let (largest_thickness_mm, thickness_is_exact) = surface.largest_thickness_mm();
    let circumference_mm = core::f64::consts::PI * condition.diameter_mm;
    let on_circumference = |vibration_turns: f64| {
        (broken && condition.diameter_mm > 0.0).then(|| vibration_turns / vibrations_per_rev * circumference_mm)
    };

    let spindle_at = |vibrations: f64| 60.0 * condition.frequency_hz / vibrations;
    let frequency_at = |vibrations: f64| vibrations * condition.spindle_rev_per_min / 60.0;
    let by_frequency = BreakingRanges::Constant(1.0 / amplitude_ratio).around(vibrations_per_rev);
    let by_speed = BreakingRanges::when_speed_changes(condition).around(vibrations_per_rev);
    let halves = nearest_half_integers(vibrations_per_rev);
    let mut recommended_spindle: Vec<f64> = halves.iter().map(|&half| spindle_at(half)).collect();
    let distance = |rev_per_min: &f64| (rev_per_min - condition.spindle_rev_per_min).abs();
    recommended_spindle.sort_by(|a, b| distance(a).total_cmp(&distance(b)));

    ChipReport {
        condition: *condition,
        vibrations_per_rev,
        amplitude_ratio,
        broken,
        air_share: air.share,
        air_share_previous_revolution: if broken {
            libm::acos((1.0 / margin).min(1.0)) / core::f64::consts::PI
        } else {
            0.0
        },
        largest_thickness_mm,
        breaks_per_rev: air.count as f64 * vibrations_per_rev,
        longest_chip_mm: on_circumference(air.longest_gap_turns),
        mean_chip_mm: on_circumference((1.0 - air.share) / air.count as f64),
        min_amplitude_mm: (margin > 0.0).then(|| condition.amplitude_mm / margin),
        breaking_frequencies_hz: if broken {
            Nearest::default()
        } else {
            Nearest { below: by_frequency.below.map(frequency_at), above: by_frequency.above.map(frequency_at) }
        },
        recommended_frequencies_hz: halves.into_iter().map(frequency_at).collect(),
        breaking_spindle_rev_per_min: if broken {
            Nearest::default()
        } else {
            // A higher D is a lower speed.
            Nearest { below: by_speed.above.map(spindle_at), above: by_speed.below.map(spindle_at) }
        },
        recommended_spindle_rev_per_min: recommended_spindle,
        spindle_speed_margin: broken.then(|| spindle_speed_margin(condition, by_speed, spindle_at)),
        earlier_revolutions: surface.earlier_revolutions(),
        exact: surface.is_complete() && thickness_is_exact,
    }
}

fn spindle_speed_margin(
    condition: &CutCondition,
    by_speed: Neighbours,
    spindle_at: impl Fn(f64) -> f64,
) -> SpindleSpeedMargin {
    // Broken, and yet in no range: at the very edge of one, up to rounding.
    let vibrations_per_rev = condition.vibrations_per_rev();
    let (low, high) = by_speed.containing.unwrap_or((vibrations_per_rev, vibrations_per_rev));
    SpindleSpeedMargin {
        minus_rev_per_min: (condition.spindle_rev_per_min - spindle_at(high)).max(0.0),
        plus_rev_per_min: (low > 0.0).then(|| (spindle_at(low) - condition.spindle_rev_per_min).max(0.0)),
    }
}

/// The one or two half-integers around `vibrations_per_rev`, nearest first.
fn nearest_half_integers(vibrations_per_rev: f64) -> Vec<f64> {
    // One that D equals but for rounding has no neighbour worth naming.
    let nearest = vibrations_per_rev.floor() + 0.5;
    if (nearest - vibrations_per_rev).abs() <= 1e-9 * vibrations_per_rev {
        return vec![nearest];
    }
    let below = (vibrations_per_rev - 0.5).floor() + 0.5;
    let mut halves = vec![below, below + 1.0];
    halves.retain(|&half| half > 0.0);
    halves.sort_by(|a, b| (a - vibrations_per_rev).abs().total_cmp(&(b - vibrations_per_rev).abs()));
    halves
}

/// The report of a cut that does not vibrate or does not turn: a chip of the feed's thickness without end.
fn without_vibration(condition: &CutCondition) -> ChipReport {
    ChipReport {
        condition: *condition,
        vibrations_per_rev: 0.0,
        amplitude_ratio: 0.0,
        broken: false,
        air_share: 0.0,
        air_share_previous_revolution: 0.0,
        largest_thickness_mm: condition.feed_per_rev_mm,
        breaks_per_rev: 0.0,
        longest_chip_mm: None,
        mean_chip_mm: None,
        min_amplitude_mm: None,
        breaking_frequencies_hz: Nearest::default(),
        recommended_frequencies_hz: Vec::new(),
        breaking_spindle_rev_per_min: Nearest::default(),
        recommended_spindle_rev_per_min: Vec::new(),
        spindle_speed_margin: None,
        earlier_revolutions: 0,
        exact: true,
    }
}

#[cfg(test)]
mod tests;
