//! The vibration of the least amplitude that breaks the chip of a whole section (docs/functions/path-vibration.md, "A better
//! vibration").
//!
//! Of every cut the chip has to break with a margin M at every spindle speed S' within a tolerance of the programmed one and up
//! to the largest feed override. With the feed f_r of a revolution at that override the cut needs
//!
//! ```text
//! A ≥ M·f_r / (2·|sin(π·60·f/S')|)
//! ```
//!
//! and no amplitude is enough where 60·f/S' is whole for some S'. Between two frequencies at which it is whole at an end of a
//! range of speeds, |sin(π·60·f/S')|/f_r is least at one of both ends: it has no other minimum there, whether the feed is
//! programmed per revolution or per minute. So the reciprocal of the amplitude that is needed is the least of a few concave
//! functions of f, concave itself, and the limits of the axes on A are of the form 1/A ≥ c₁·f, c₂·f², c₃·f³, convex. In every
//! such cell the frequencies that can be are an interval, and the best one of it is found by a search for one maximum and a
//! bisection: to rounding, without a grid.

use core::f64::consts::TAU;

use feedwave_motion::PathMotion;

use super::envelope::{growth, least_ramp_mm};
use super::sin_turns;

mod corners;
mod section;

#[cfg(test)]
mod tests;

pub use corners::{SectionCorners, TooManyCorners};
pub use section::{SearchGoals, Unsearchable};

/// Most cells times speeds that are looked at.
const MAX_WORK: usize = 50_000_000;
/// Steps of a golden section search, each of which leaves 0.618 of the interval.
const GOLDEN_STEPS: u32 = 80;
/// Steps of a bisection.
const BISECTION_STEPS: u32 = 80;
/// Steps in which the largest amplitude is approached from below: each leaves a third of what is missing at most.
const AMPLITUDE_STEPS: u32 = 24;
/// Amplitudes that differ by less than this share are the same: the frequency nearest to the preferred one is chosen.
const SAME_AMPLITUDE: f64 = 1e-9;

/// A cut of a section at a constant spindle speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchCut {
    /// Programmed feed along the path, mm/rev.
    pub feed_per_rev_mm: f64,
    /// Spindle speed, rev/min.
    pub spindle_rev_per_min: f64,
}

/// What a vibration is looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct VibrationSearch {
    /// The cuts; one vibration is to break the chips of all.
    pub cuts: Vec<SearchCut>,
    /// Whether the feed is programmed per minute, so that a slower spindle feeds more in a revolution.
    pub feed_per_minute: bool,
    /// Share by which the spindle may be slower or faster than programmed, 0 to below 1.
    pub speed_tolerance: f64,
    /// Largest feed over the programmed one, divided by the amplitude's ratio to the programmed one at it: the largest feed
    /// override where the amplitude does not follow it.
    pub feed_ratio: f64,
    /// 2A·|sin πD|/f_r that is wanted everywhere, 1 or more.
    pub margin: f64,
    /// Lowest and highest frequency, Hz.
    pub frequency_hz: [f64; 2],
    /// Frequency that is chosen among several as good, Hz.
    pub preferred_hz: f64,
    /// Largest amplitude, mm.
    pub max_amplitude_mm: f64,
    /// Largest velocity, acceleration and jerk of the vibration along the path that every axis can follow, mm/s and so on.
    pub peaks: PathMotion,
    /// How it is blended in and out, which adds to its peaks; `None` as published.
    pub blend: Option<SearchBlend>,
}

/// What the peaks of a vibration grow by where it is blended in and out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchBlend {
    /// Slowest programmed feed, mm/s: it decides how long a blend is at least.
    pub least_feed_mm_per_s: f64,
    /// Fastest one, mm/s, at which a blend goes by.
    pub top_feed_mm_per_s: f64,
    /// What an amplitude that follows the feed override adds to the rate of the envelope, per radian.
    pub following_rate: f64,
}

impl SearchBlend {
    /// By what factors the peaks of velocity, acceleration and jerk exceed those of the sine.
    fn growth(&self, frequency_hz: f64, amplitude_mm: f64) -> [f64; 3] {
        let ramp_mm = least_ramp_mm(frequency_hz, amplitude_mm, self.least_feed_mm_per_s);
        growth(self.top_feed_mm_per_s / (TAU * frequency_hz * ramp_mm) + self.following_rate)
    }
}

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundVibration {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Least amplitude that is enough at it, mm.
    pub amplitude_mm: f64,
}

/// One end of the spindle speeds of a cut.
#[derive(Clone, Copy, Debug)]
struct SpeedEnd {
    /// Seconds of a revolution: vibrations per revolution are this times the frequency.
    rev_s: f64,
    /// Feed of a revolution at it, mm.
    feed_mm: f64,
}

impl VibrationSearch {
    /// Least amplitude that is enough at a frequency, mm, whatever the limits; `None` where no amplitude is.
    #[must_use]
    pub fn least_amplitude_mm(&self, frequency_hz: f64) -> Option<f64> {
        let openness = openness(&self.ends(), frequency_hz);
        (openness > 0.0).then(|| 0.5 * self.margin / openness).filter(|amplitude_mm| amplitude_mm.is_finite())
    }

    /// Largest amplitude at a frequency that the axes and the profile permit, mm.
    #[must_use]
    pub fn largest_amplitude_mm(&self, frequency_hz: f64) -> f64 {
        1.0 / self.closeness(frequency_hz)
    }

    /// Whether a vibration does what is wanted, within the limits; `frequency_hz` may lie outside of the range.
    #[must_use]
    pub fn suffices(&self, frequency_hz: f64, amplitude_mm: f64) -> bool {
        self.least_amplitude_mm(frequency_hz).is_some_and(|least_mm| amplitude_mm >= least_mm)
            && amplitude_mm <= self.largest_amplitude_mm(frequency_hz)
    }

    /// The vibration of the least amplitude; `None` where none does what is wanted within the limits, or where there are too
    /// many different spindle speeds to look at them all.
    #[must_use]
    pub fn solve(&self) -> Option<FoundVibration> {
        let [low_hz, high_hz] = self.frequency_hz;
        let numbers = [low_hz, high_hz, self.feed_ratio, self.margin, self.max_amplitude_mm];
        if self.cuts.is_empty() || !numbers.iter().all(|it| it.is_finite() && *it > 0.0) || low_hz > high_hz {
            return None;
        }
        if low_hz == high_hz {
            let found = FoundVibration { frequency_hz: low_hz, amplitude_mm: self.least_amplitude_mm(low_hz)? };
            return self.suffices(low_hz, found.amplitude_mm).then_some(found);
        }
        let ends = self.ends();
        let edges = self.edges(&ends)?;
        let mut best: Option<FoundVibration> = None;
        for cell in edges.windows(2) {
            let Some(found) = self.solve_cell(&ends, [cell[0], cell[1]]) else { continue };
            let better = best.is_none_or(|best| {
                let nearer =
                    (found.frequency_hz - self.preferred_hz).abs() < (best.frequency_hz - self.preferred_hz).abs();
                found.amplitude_mm < best.amplitude_mm * (1.0 - SAME_AMPLITUDE)
                    || nearer && found.amplitude_mm <= best.amplitude_mm * (1.0 + SAME_AMPLITUDE)
            });
            if better {
                best = Some(found);
            }
        }
        best
    }

    /// Both ends of the speeds of every cut; of several cuts at one speed the one with the largest feed.
    fn ends(&self) -> Vec<SpeedEnd> {
        let mut cuts = self.cuts.clone();
        cuts.sort_by(|a, b| {
            let by_speed = a.spindle_rev_per_min.total_cmp(&b.spindle_rev_per_min);
            by_speed.then(b.feed_per_rev_mm.total_cmp(&a.feed_per_rev_mm))
        });
        cuts.dedup_by(|next, kept| next.spindle_rev_per_min == kept.spindle_rev_per_min);
        let slow_and_fast = [1.0 - self.speed_tolerance, 1.0 + self.speed_tolerance];
        let ends = cuts.iter().flat_map(|cut| {
            slow_and_fast.map(|share| SpeedEnd {
                rev_s: 60.0 / (cut.spindle_rev_per_min * share),
                feed_mm: cut.feed_per_rev_mm * self.feed_ratio / if self.feed_per_minute { share } else { 1.0 },
            })
        });
        ends.collect()
    }

    /// The frequencies at which an end has a whole number of vibrations in a revolution, and the ends of the range, ascending.
    fn edges(&self, ends: &[SpeedEnd]) -> Option<Vec<f64>> {
        let [low_hz, high_hz] = self.frequency_hz;
        let mut edges = vec![low_hz, high_hz];
        for end in ends {
            let (first, last) = ((low_hz * end.rev_s).ceil(), (high_hz * end.rev_s).floor());
            let count = (last - first + 1.0).max(0.0);
            if (edges.len() as f64 + count) * ends.len() as f64 > MAX_WORK as f64 {
                return None;
            }
            edges.extend((0..count as usize).map(|step| (first + step as f64) / end.rev_s));
        }
        edges.extend(self.blend.iter().flat_map(|blend| self.edges_of_blends(blend)));
        edges.retain(|edge| (low_hz..=high_hz).contains(edge));
        edges.sort_by(f64::total_cmp);
        Some(edges)
    }

    /// The frequencies above which the length of a blend no longer follows from the largest amplitude but from the feed, for each of the
    /// limits of the axes: there [`Self::closeness`] turns from one convex function to another.
    fn edges_of_blends(&self, blend: &SearchBlend) -> impl Iterator<Item = f64> {
        let by_amplitude = |frequency_hz: f64, limit: usize| {
            let amplitude_mm = 1.0 / self.closeness_of(frequency_hz)[limit];
            least_ramp_mm(frequency_hz, amplitude_mm, 0.0) > least_ramp_mm(frequency_hz, 0.0, blend.least_feed_mm_per_s)
        };
        let [low_hz, high_hz] = self.frequency_hz;
        (0..3).map(move |limit| {
            let (mut from_hz, mut to_hz) = (low_hz, high_hz);
            for _ in 0..BISECTION_STEPS {
                let middle_hz = 0.5 * (from_hz + to_hz);
                if by_amplitude(middle_hz, limit) {
                    from_hz = middle_hz;
                } else {
                    to_hz = middle_hz;
                }
            }
            to_hz
        })
    }

    /// 1/A of the largest amplitude A that is permitted, 1/mm: rising, and convex in a cell.
    fn closeness(&self, frequency_hz: f64) -> f64 {
        self.closeness_of(frequency_hz).into_iter().fold(1.0 / self.max_amplitude_mm, f64::max)
    }

    /// The same of the limits of velocity, acceleration and jerk alone.
    fn closeness_of(&self, frequency_hz: f64) -> [f64; 3] {
        let rad_per_s = TAU * frequency_hz;
        let PathMotion { velocity, acceleration, jerk } = self.peaks;
        let sine =
            [rad_per_s / velocity, rad_per_s * rad_per_s / acceleration, rad_per_s * rad_per_s * rad_per_s / jerk];
        let Some(blend) = &self.blend else { return sine };
        core::array::from_fn(|limit| {
            // A larger amplitude has a longer blend, which adds less: from below it is never beyond the limit.
            let mut closeness = sine[limit] * blend.growth(frequency_hz, 0.0)[limit];
            for _ in 0..AMPLITUDE_STEPS {
                closeness = sine[limit] * blend.growth(frequency_hz, 1.0 / closeness)[limit];
            }
            closeness
        })
    }

    /// The best frequency of a cell, within which no end has a whole number of vibrations in a revolution.
    fn solve_cell(&self, ends: &[SpeedEnd], cell: [f64; 2]) -> Option<FoundVibration> {
        let [low_hz, high_hz] = cell;
        let middle_hz = 0.5 * (low_hz + high_hz);
        // A whole number lies between both ends of a cut: nothing breaks its chip at every speed.
        let splits = |pair: &[SpeedEnd]| (middle_hz * pair[0].rev_s).floor() != (middle_hz * pair[1].rev_s).floor();
        if high_hz <= low_hz || ends.chunks_exact(2).any(splits) {
            return None;
        }
        let open = |frequency_hz: f64| openness(ends, frequency_hz);
        let spare = |frequency_hz: f64| open(frequency_hz) - 0.5 * self.margin * self.closeness(frequency_hz);
        let mut best_hz = largest_at(open, low_hz, high_hz);
        if spare(best_hz) < 0.0 {
            // Above it less is permitted and more is needed.
            let mut inside_hz = largest_at(spare, low_hz, best_hz);
            if spare(inside_hz) < 0.0 {
                return None;
            }
            let mut outside_hz = best_hz;
            for _ in 0..BISECTION_STEPS {
                let middle_hz = 0.5 * (inside_hz + outside_hz);
                if spare(middle_hz) < 0.0 {
                    outside_hz = middle_hz;
                } else {
                    inside_hz = middle_hz;
                }
            }
            best_hz = inside_hz;
        }
        let amplitude_mm = self.least_amplitude_mm(best_hz)?;
        Some(FoundVibration { frequency_hz: best_hz, amplitude_mm })
    }
}

/// The least |sin πD|/f_r of all ends of speeds, 1/mm. At a whole number of vibrations in a revolution it is 0.
fn openness(ends: &[SpeedEnd], frequency_hz: f64) -> f64 {
    let of = |end: &SpeedEnd| {
        let vibrations = frequency_hz * end.rev_s;
        let lag = vibrations - vibrations.round();
        sin_turns(0.5 * lag).abs() / end.feed_mm
    };
    // Both ends of a cut are on the same side of every whole number, or some speed between them has a whole one.
    let splits = |pair: &[SpeedEnd]| {
        let [slow, fast] = [pair[0], pair[1]].map(|end| frequency_hz * end.rev_s);
        slow != fast && slow.floor() != fast.floor()
    };
    if ends.chunks_exact(2).any(splits) {
        return 0.0;
    }
    ends.iter().map(of).fold(f64::INFINITY, f64::min)
}

/// Where a function with one maximum is largest between two values, by golden section.
fn largest_at(value: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let mut left = high - GOLDEN * (high - low);
    let mut right = low + GOLDEN * (high - low);
    let (mut at_left, mut at_right) = (value(left), value(right));
    for _ in 0..GOLDEN_STEPS {
        if at_left < at_right {
            low = left;
            (left, at_left) = (right, at_right);
            right = low + GOLDEN * (high - low);
            at_right = value(right);
        } else {
            high = right;
            (right, at_right) = (left, at_left);
            left = high - GOLDEN * (high - low);
            at_left = value(left);
        }
    }
    0.5 * (low + high)
}
