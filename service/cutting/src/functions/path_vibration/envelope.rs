//! How a vibration starts and ends, and its loads on the axes (docs/functions/path-vibration.md, "Start and end").
//!
//! With the phase in radians φ = ωt, the amplitude A, the envelope E of the place σ on the path, L its length and
//! r = v/(ω·L), how much of it goes by per radian, the offset o = A·E(σ)·sin φ has at a constant speed v
//!
//! ```text
//! o'   = ωA·(E·cos φ + r·E'·sin φ)
//! o''  = ω²A·((r²E'' − E)·sin φ + 2r·E'·cos φ)
//! o''' = ω³A·((r³E''' − 3r·E')·sin φ + (3r²E'' − E)·cos φ)
//! ```
//!
//! with E' the derivatives by σ/L. Sine and cosine together are at most the root of the sum of the squares, and with
//! E ≤ 1 and the largest derivatives B₁, B₂ and B₃ of the blend
//!
//! ```text
//! |o'|   ≤ ωA·√(1 + (B₁r)²)
//! |o''|  ≤ ω²A·√((1 + B₂r²)² + (2B₁r)²)
//! |o'''| ≤ ω³A·√((1 + 3B₂r²)² + (3B₁r + B₃r³)²)
//! ```
//!
//! That holds between two ramps that meet, too, where E is the product of two blends, up to r = 1/5. An amplitude that
//! follows the feed override is a blend over time beside; derivatives of the product of two blends that go by at the
//! rates r and q are those of one at r + q at most. A feed that changes its speed with a and j adds
//!
//! ```text
//! a·(1 + E'·A/L·sin φ)                                              to the acceleration
//! j·(1 + E'·A/L·sin φ) + 3a·A/L·ω·(r·E''·sin φ + E'·cos φ)          to the jerk
//! ```

use core::f64::consts::TAU;

use feedwave_motion::{Element, LimitExceeded, LimitPieces, Machine, PathLimits, PathMotion, limit_pieces};
use serde::{Deserialize, Serialize};

use super::{GenerationMode, PEAK_RESERVE, RAMP_VIBRATIONS, VibrationCondition, VibrationSettings};
use crate::shared::blend::BLEND_PEAKS;

/// How a vibration begins and ends (docs/functions/path-vibration.md, "Start and end").
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VibrationEnvelope {
    /// The amplitude is blended in and out over the path, and the axes' limits hold at the ends as inside.
    #[default]
    Blended,
    /// The form of the source: the whole sine from the first setpoint on, and positions clamped at the ends.
    Published,
}

/// Length of the blend in amplitudes at least: the offset then never exceeds the distance from the end.
const LEAST_RAMP_AMPLITUDES: f64 = 1.2;
/// Length of the blend in vibrations at the programmed feed at least.
const RAMP_PERIODS: f64 = 2.0;
/// Largest r for which the peaks are known: where two ramps meet the envelope bends more than in one. The first block of a
/// part has 1/4π at most, under an override of 200 % twice that, and 1/8π more while the amplitude follows.
const MAX_RATE: f64 = 0.2;
/// Part of acceleration and jerk beside the vibration that the feed leaves to junctions which are vibrated over.
const JUNCTION_SHARE: f64 = 0.25;

/// A vibration as it is run: what the axes have to follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct VibrationDemand {
    rad_per_s: f64,
    /// Largest amplitude with what changes of it add to the peaks, mm.
    amplitude_mm: f64,
    /// What following the feed override adds to r.
    following_rate: f64,
    /// Length of the blend, mm; `None` as published.
    ramp_mm: Option<f64>,
    /// Whether the offset goes along the tangent, beside a curved path.
    leaves_path: bool,
}

impl VibrationSettings {
    /// Length over which a vibration is blended in and out where it begins at this programmed feed, mm; `None` as published.
    pub(crate) fn ramp_mm(&self, condition: VibrationCondition, feed_mm_per_s: f64) -> Option<f64> {
        let VibrationCondition { frequency_hz, amplitude_mm } = condition;
        let reach_mm = self.reach_mm(amplitude_mm);
        match self.envelope {
            VibrationEnvelope::Blended => Some(least_ramp_mm(frequency_hz, reach_mm, feed_mm_per_s)),
            VibrationEnvelope::Published => None,
        }
    }

    /// What a vibration that began at this programmed feed asks of the axes.
    pub(crate) fn demand(&self, condition: VibrationCondition, first_feed_mm_per_s: f64) -> VibrationDemand {
        let follows_up_to = self.follows_up_to(condition.amplitude_mm);
        VibrationDemand {
            rad_per_s: TAU * condition.frequency_hz,
            amplitude_mm: condition.amplitude_mm * follows_up_to.map_or(1.0, |ratio| ratio * PEAK_RESERVE),
            following_rate: follows_up_to.map_or(0.0, |_| 1.0 / (TAU * RAMP_VIBRATIONS)),
            ramp_mm: self.ramp_mm(condition, first_feed_mm_per_s),
            leaves_path: self.generation_mode != GenerationMode::AlongPath,
        }
    }
}

impl VibrationDemand {
    /// Largest amplitude with what changes of it add to the peaks, mm.
    pub(crate) const fn amplitude_mm(&self) -> f64 {
        self.amplitude_mm
    }

    /// Largest offset along the path, mm.
    pub(crate) const fn offset_along_path_mm(&self) -> f64 {
        if self.leaves_path { 0.0 } else { self.amplitude_mm }
    }

    /// Largest offset beside a curved path, mm.
    pub(crate) const fn offset_beside_path_mm(&self) -> f64 {
        if self.leaves_path { self.amplitude_mm } else { 0.0 }
    }

    /// r at a speed of the feed.
    fn rate(&self, ramp_mm: f64, feed_mm_per_s: f64) -> f64 {
        feed_mm_per_s / (self.rad_per_s * ramp_mm) + self.following_rate
    }

    /// Peaks along the path while the feed goes at no more than this speed.
    pub(crate) fn peaks(&self, feed_mm_per_s: f64) -> PathMotion {
        let velocity = self.rad_per_s * self.amplitude_mm;
        let [first, second, third] = match self.ramp_mm {
            Some(ramp_mm) => growth(self.rate(ramp_mm, feed_mm_per_s)),
            None => [1.0; 3],
        };
        PathMotion {
            velocity: velocity * first,
            acceleration: self.rad_per_s * velocity * second,
            jerk: self.rad_per_s * self.rad_per_s * velocity * third,
        }
    }

    /// Largest motion of the feed along the pieces of an element that is cut at no more than `top_command_mm_per_s` before the
    /// feed override.
    ///
    /// # Errors
    /// [`LimitExceeded`] where the vibration leaves nothing for the feed even at the lowest of the speeds examined.
    pub(crate) fn limit_pieces(
        &self,
        element: &Element,
        machine: &Machine,
        top_command_mm_per_s: f64,
    ) -> Result<LimitPieces, LimitExceeded> {
        let lowered = self.for_offsets_beside(element, machine);
        let machine = lowered.as_ref().unwrap_or(machine);
        let at = |speed: f64| {
            let mut pieces = limit_pieces(element, machine, self.peaks(speed), speed)?;
            for piece in &mut pieces {
                piece.limits = self.left_for_feed(piece.limits, speed);
            }
            Ok(pieces)
        };
        let [mut speed, slowest] = self.speeds(top_command_mm_per_s);
        while speed > slowest {
            if let Ok(pieces) = at(speed) {
                return Ok(pieces);
            }
            speed = (speed * SPEED_STEP).max(slowest);
        }
        at(slowest)
    }

    /// What an element permits feed and vibration together: the largest velocity, acceleration and jerk along the path, each alone.
    pub(crate) fn permitted(&self, element: &Element, machine: &Machine, top_command_mm_per_s: f64) -> PathMotion {
        let lowered = self.for_offsets_beside(element, machine);
        let [_, slowest] = self.speeds(top_command_mm_per_s);
        let top_speed = slowest + self.peaks(slowest).velocity;
        let pieces = limit_pieces(element, lowered.as_ref().unwrap_or(machine), PathMotion::ZERO, top_speed);
        // Without a vibration, nothing can be too much.
        let limits = pieces.map_or(PathLimits::NONE, |pieces| PathLimits::tightest(pieces.iter().map(|it| &it.limits)));
        PathMotion { velocity: limits.velocity, acceleration: limits.acceleration, jerk: limits.jerk }
    }

    /// The machine with lower limits where the offset goes along the tangent of a curve: with κ its curvature and i the
    /// normal, (c + o·τ)' has beside the derivatives of the path along itself another i·κ·o·c', so that all derivatives
    /// are up to 1 + κ·A times as large.
    fn for_offsets_beside(&self, element: &Element, machine: &Machine) -> Option<Machine> {
        let factor = 1.0 + element.curvature() * self.amplitude_mm;
        if !self.leaves_path || self.ramp_mm.is_none() || factor == 1.0 {
            return None;
        }
        let mut machine = machine.clone();
        for axis in &mut machine.axes {
            axis.max_velocity_per_s /= factor;
            axis.max_acceleration_per_s2 /= factor;
            axis.max_jerk_per_s3 /= factor;
        }
        Some(machine)
    }

    /// Highest and lowest speed of the feed to reserve limits for. Twice the commanded one is the most that a feed override
    /// asks for; where that cannot be followed a lower one limits the feed, down to the commanded one. A command faster than
    /// the one that the blend was made for may be lowered to that.
    pub(super) fn speeds(&self, top_command_mm_per_s: f64) -> [f64; 2] {
        let fastest = 2.0 * top_command_mm_per_s;
        let Some(ramp_mm) = self.ramp_mm else { return [fastest; 2] };
        let per_rate = self.rad_per_s * ramp_mm;
        let blend_made_for = per_rate / (TAU * RAMP_PERIODS);
        let slowest = top_command_mm_per_s.min(blend_made_for);
        [fastest.min((MAX_RATE - self.following_rate) * per_rate).max(slowest), slowest]
    }

    /// What the feed may do at no more than `feed_mm_per_s` where `left` is left along the path beside the peaks.
    pub(crate) fn left_for_feed(&self, left: PathLimits, feed_mm_per_s: f64) -> PathLimits {
        let Some(ramp_mm) = self.ramp_mm else { return left };
        let [first, second, _] = BLEND_PEAKS;
        let steepness = self.amplitude_mm / ramp_mm;
        let slope = 1.0 + first * steepness;
        let (acceleration, jerk) = ((1.0 - JUNCTION_SHARE) * left.acceleration, (1.0 - JUNCTION_SHARE) * left.jerk);
        let rate = self.rate(ramp_mm, feed_mm_per_s);
        let swing = (first * first + second * rate * (second * rate)).sqrt();
        // Half of the jerk at most goes with the acceleration.
        let jerk_per_acceleration = 3.0 * steepness * self.rad_per_s * swing;
        let acceleration = (acceleration / slope).min(0.5 * jerk / jerk_per_acceleration);
        PathLimits {
            velocity: left.velocity.min(feed_mm_per_s),
            acceleration,
            jerk: (jerk - jerk_per_acceleration * acceleration) / slope,
        }
    }
}

/// Length of the blend of a vibration that reaches so far, where it begins at this feed, mm.
pub(super) fn least_ramp_mm(frequency_hz: f64, reach_mm: f64, feed_mm_per_s: f64) -> f64 {
    (LEAST_RAMP_AMPLITUDES * reach_mm).max(RAMP_PERIODS * feed_mm_per_s / frequency_hz)
}

/// From one speed to reserve limits for to the next lower one.
const SPEED_STEP: f64 = 0.9;
/// By what factors the peaks of velocity, acceleration and jerk exceed those of the sine at a rate r of the envelope.
pub(super) fn growth(rate: f64) -> [f64; 3] {
    let [b1, b2, b3] = BLEND_PEAKS;
    let square = rate * rate;
    let root = |a: f64, b: f64| (a * a + b * b).sqrt();
    [
        root(1.0, b1 * rate),
        root(1.0 + b2 * square, 2.0 * b1 * rate),
        root(1.0 + 3.0 * b2 * square, 3.0 * b1 * rate + b3 * square * rate),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The blend and its first three derivatives.
    fn blend(x: f64) -> [f64; 4] {
        if !(0.0..=1.0).contains(&x) {
            return [if x < 0.0 { 0.0 } else { 1.0 }, 0.0, 0.0, 0.0];
        }
        let y = 1.0 - x;
        [
            x * x * x * (10.0 + x * (6.0 * x - 15.0)),
            30.0 * x * x * y * y,
            60.0 * x * y * (1.0 - 2.0 * x),
            60.0 * (1.0 - 6.0 * x + 6.0 * x * x),
        ]
    }

    #[test]
    fn the_growth_of_the_peaks_bounds_every_place_of_long_and_short_paths() {
        for rate in (0..=20).map(|step| f64::from(step) / 20.0 * MAX_RATE) {
            let bound = growth(rate);
            for length in (1..=120).map(|step| f64::from(step) / 50.0) {
                for place in (0..=400).map(|step| f64::from(step) / 400.0 * length) {
                    let (a, b) = (blend(place), blend(length - place));
                    let e = [
                        a[0] * b[0],
                        a[1] * b[0] - a[0] * b[1],
                        a[2] * b[0] - 2.0 * a[1] * b[1] + a[0] * b[2],
                        a[3] * b[0] - 3.0 * a[2] * b[1] + 3.0 * a[1] * b[2] - a[0] * b[3],
                    ];
                    let (r, r2, r3) = (rate, rate * rate, rate * rate * rate);
                    let found = [
                        e[0].hypot(r * e[1]),
                        (r2 * e[2] - e[0]).hypot(2.0 * r * e[1]),
                        (r3 * e[3] - 3.0 * r * e[1]).hypot(3.0 * r2 * e[2] - e[0]),
                    ];
                    for (found, bound) in found.into_iter().zip(bound) {
                        assert!(found <= bound * (1.0 + 1e-12), "{found} > {bound} at {place} of {length}, r {rate}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_blend_is_as_long_as_the_page_says() {
        let settings = VibrationSettings::default();
        let condition = VibrationCondition { frequency_hz: 45.0, amplitude_mm: 0.1 };
        assert_eq!(settings.ramp_mm(condition, 1.6), Some(1.2 * 0.1));
        assert_eq!(settings.ramp_mm(condition, 9.0), Some(0.4));
        let published = VibrationSettings { envelope: VibrationEnvelope::Published, ..settings };
        assert_eq!(published.ramp_mm(condition, 9.0), None);
        let following = VibrationSettings { amplitude_follows_feed_up_to: Some(1.5), ..settings };
        assert!((following.ramp_mm(condition, 1.6).unwrap() - 0.18).abs() < 1e-15);
    }

    #[test]
    fn speeds_go_from_twice_the_command_to_what_the_blend_was_made_for() {
        let settings = VibrationSettings::default();
        let condition = VibrationCondition { frequency_hz: 45.0, amplitude_mm: 0.01 };
        let demand = settings.demand(condition, 9.0);
        assert_eq!(demand.speeds(9.0), [18.0, 9.0]);
        let [fastest, slowest] = demand.speeds(1e6);
        assert!(fastest > 18.0 && fastest < 23.0 && (slowest - 9.0).abs() < 1e-12, "{fastest} {slowest}");
    }
}
