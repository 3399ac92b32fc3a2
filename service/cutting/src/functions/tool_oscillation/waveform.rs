//! Waveforms of the oscillation: periodic, continuous, peak value 1 (docs/functions/tool-oscillation.md, "Motion").

use core::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::curve::PeriodicCurve;
use feedwave_motion::sin_turns;

/// Largest hold share at each extreme: what is left for the two ramps is at least a twenty-fifth of the period.
pub const MAX_HOLD_SHARE: f64 = 0.48;
/// Most points of a table.
pub const MAX_WAVE_POINTS: usize = 256;
/// Least distance of two points of a table, turns: steeper ones would be a step.
pub const MIN_WAVE_POINT_TURNS: f64 = 1e-3;
/// By how much the peak of a table may miss 1.
const PEAK_TOLERANCE: f64 = 1e-9;

/// A waveform over one period; every kind but the table starts at 0, has its highest value around ¼ and its lowest
/// around ¾ of the period.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
pub enum Waveform {
    /// sin 2πτ.
    Sine,
    /// Both extremes are held for `hold_share` of the period each; the ramps between are half periods of a sine of
    /// period 1 − 2·`hold_share`. The joints step the acceleration. With a share of 0 this is a sine.
    HeldPeak {
        /// h, 0 to [`MAX_HOLD_SHARE`].
        hold_share: f64,
    },
    /// The same holds with ramps (15x − 10x³ + 3x⁵)/8, which start and end with no acceleration: the jerk is bounded.
    JerkLimitedHeldPeak {
        /// h, 0 to [`MAX_HOLD_SHARE`].
        hold_share: f64,
    },
    /// Points (phase in turns within [0, 1), value within ±1), joined by a monotone cubic and repeated.
    Table {
        /// 2 to [`MAX_WAVE_POINTS`] points, phases strictly increasing, largest |value| 1.
        points: Vec<[f64; 2]>,
    },
}

/// What makes a waveform unusable.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WaveformError {
    /// The hold share is not between 0 and [`MAX_HOLD_SHARE`].
    #[error("the hold share must be between 0 and {MAX_HOLD_SHARE}, is {0}")]
    HoldShare(f64),
    /// Too few or too many points.
    #[error("a table has 2 to {MAX_WAVE_POINTS} points, this one has {0}")]
    PointCount(usize),
    /// A phase outside [0, 1), not increasing, or too close to its neighbour.
    #[error(
        "point {number} is at phase {phase}: phases lie within 0 and 1 and increase by at least {MIN_WAVE_POINT_TURNS}"
    )]
    Phase {
        /// Which point, counted from 1.
        number: usize,
        /// Its phase.
        phase: f64,
    },
    /// The largest |value| is not 1.
    #[error("the largest value of a table is 1, of this one {0}")]
    Peak(f64),
}

/// Largest |derivatives| of a waveform by its phase in turns: at period P and amplitude A the motion has A·`first`/P,
/// A·`second`/P² and A·`third`/P³.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WavePeaks {
    /// First derivative.
    pub first: f64,
    /// Second derivative.
    pub second: f64,
    /// Third derivative between steps of the second.
    pub third: f64,
    /// Largest step of the second derivative; where it is not 0 the third is unbounded there.
    pub second_step: f64,
}

/// A waveform ready for evaluation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wave(Shape);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Shape {
    Sine,
    /// Quarter ramp, turns.
    HeldPeak(f64),
    JerkLimited(f64),
    Table(PeriodicCurve),
}

impl Waveform {
    /// The waveform ready for evaluation.
    ///
    /// # Errors
    /// [`WaveformError`] where a value is out of its range.
    pub fn compile(&self) -> Result<Wave, WaveformError> {
        let quarter_ramp = |hold_share: f64| {
            let is_possible = (0.0..=MAX_HOLD_SHARE).contains(&hold_share);
            is_possible.then_some(0.25 * (1.0 - 2.0 * hold_share)).ok_or(WaveformError::HoldShare(hold_share))
        };
        Ok(Wave(match self {
            Self::Sine => Shape::Sine,
            Self::HeldPeak { hold_share } => Shape::HeldPeak(quarter_ramp(*hold_share)?),
            Self::JerkLimitedHeldPeak { hold_share } => Shape::JerkLimited(quarter_ramp(*hold_share)?),
            Self::Table { points } => Shape::Table(table(points)?),
        }))
    }

    /// Share of the period for which each extreme is held; 0 for a sine, `None` for a table, whose
    /// [`Wave::trough`] says it.
    #[must_use]
    pub fn hold_share(&self) -> Option<f64> {
        match self {
            Self::Sine => Some(0.0),
            Self::HeldPeak { hold_share } | Self::JerkLimitedHeldPeak { hold_share } => Some(*hold_share),
            Self::Table { .. } => None,
        }
    }
}

fn table(points: &[[f64; 2]]) -> Result<PeriodicCurve, WaveformError> {
    if !(2..=MAX_WAVE_POINTS).contains(&points.len()) {
        return Err(WaveformError::PointCount(points.len()));
    }
    let last = points[points.len() - 1][0];
    let mut before = last - 1.0;
    for (index, &[phase, _]) in points.iter().enumerate() {
        if !((0.0..1.0).contains(&phase) && phase - before >= MIN_WAVE_POINT_TURNS) {
            return Err(WaveformError::Phase { number: index + 1, phase });
        }
        before = phase;
    }
    if let Some(point) = points.iter().find(|point| !point[1].is_finite()) {
        return Err(WaveformError::Peak(point[1]));
    }
    let peak = points.iter().fold(0.0, |peak: f64, point| peak.max(point[1].abs()));
    if (peak - 1.0).abs() > PEAK_TOLERANCE {
        return Err(WaveformError::Peak(peak));
    }
    Ok(PeriodicCurve::through(points))
}

impl Wave {
    /// Whether it is the sine.
    pub(super) fn is_sine(&self) -> bool {
        self.0 == Shape::Sine
    }

    /// Value at a phase in turns, of any size.
    #[inline]
    #[must_use]
    pub fn value(&self, turns: f64) -> f64 {
        match &self.0 {
            Shape::Sine => sin_turns(turns),
            Shape::HeldPeak(quarter_ramp) => held_peak(turns, 0.25 / quarter_ramp),
            Shape::JerkLimited(quarter_ramp) => jerk_limited(turns, 1.0 / quarter_ramp),
            Shape::Table(curve) => curve.value(turns),
        }
    }

    /// [`Wave::value`] of every element of `turns` into the same place of `values`, without a decision within the loop.
    ///
    /// # Panics
    /// When the lengths differ: the caller's columns are out of step.
    pub fn fill(&self, turns: &[f64], values: &mut [f64]) {
        self.fill_shifted(0.0, turns, values);
    }

    /// The same `ahead` turns further on.
    pub(super) fn fill_shifted(&self, ahead: f64, turns: &[f64], values: &mut [f64]) {
        assert_eq!(turns.len(), values.len(), "one phase for each value");
        let pairs = values.iter_mut().zip(turns);
        match &self.0 {
            Shape::Sine => pairs.for_each(|(value, &turns)| *value = sin_turns(turns + ahead)),
            Shape::HeldPeak(quarter_ramp) => {
                let stretch = 0.25 / quarter_ramp;
                pairs.for_each(|(value, &turns)| *value = held_peak(turns + ahead, stretch));
            }
            Shape::JerkLimited(quarter_ramp) => {
                let per_ramp = 1.0 / quarter_ramp;
                pairs.for_each(|(value, &turns)| *value = jerk_limited(turns + ahead, per_ramp));
            }
            Shape::Table(curve) => pairs.for_each(|(value, &turns)| *value = curve.value(turns + ahead)),
        }
    }

    /// Peaks of the derivatives by phase, in closed form.
    #[must_use]
    pub fn peaks(&self) -> WavePeaks {
        match &self.0 {
            Shape::Sine => WavePeaks { first: TAU, second: TAU * TAU, third: TAU * TAU * TAU, second_step: 0.0 },
            Shape::HeldPeak(quarter_ramp) => {
                // The ramp is a sine of this period; it joins the hold where its second derivative is largest.
                let rate = TAU * 0.25 / quarter_ramp;
                let second = rate * rate;
                let second_step = if *quarter_ramp < 0.25 { second } else { 0.0 };
                WavePeaks { first: rate, second, third: rate * second, second_step }
            }
            Shape::JerkLimited(quarter_ramp) => {
                // g' = 15/8·(1−x²)², g'' = −15/2·x·(1−x²) with its peak at 1/√3, g''' = 15/2·(3x²−1) with its at 1.
                let rate = 1.0 / quarter_ramp;
                let second = 5.0 / 3.0f64.sqrt() * rate * rate;
                WavePeaks { first: 1.875 * rate, second, third: 15.0 * rate * rate * rate, second_step: 0.0 }
            }
            Shape::Table(curve) => curve.peaks(),
        }
    }

    /// Middle of the lowest stretch and its length, turns.
    #[must_use]
    pub fn trough(&self) -> (f64, f64) {
        match &self.0 {
            Shape::Table(curve) => curve.extreme(-1.0),
            _ => (0.75, self.hold()),
        }
    }

    /// Middle of the highest stretch and its length, turns.
    #[must_use]
    pub fn crest(&self) -> (f64, f64) {
        match &self.0 {
            Shape::Table(curve) => curve.extreme(1.0),
            _ => (0.25, self.hold()),
        }
    }

    fn hold(&self) -> f64 {
        match &self.0 {
            Shape::HeldPeak(quarter_ramp) | Shape::JerkLimited(quarter_ramp) => 0.5 - 2.0 * quarter_ramp,
            Shape::Sine | Shape::Table(_) => 0.0,
        }
    }
}

/// Adding and subtracting this rounds to the nearest integer, as in [`sin_turns`].
pub(super) const ROUNDING: f64 = 6_755_399_441_055_744.0; // 1.5 · 2⁵²

/// Phase folded onto [0, ¼] around the next zero, and the sign of its half period as a number to copy it from.
#[inline]
fn quarter(turns: f64) -> (f64, f64) {
    let nearest = (turns + ROUNDING) - ROUNDING;
    let reduced = turns - nearest;
    let magnitude = reduced.abs();
    (magnitude.min(0.5 - magnitude), reduced)
}

#[inline]
fn held_peak(turns: f64, stretch: f64) -> f64 {
    let (quarter, sign) = quarter(turns);
    sin_turns((quarter * stretch).min(0.25)).copysign(sign)
}

#[inline]
fn jerk_limited(turns: f64, per_ramp: f64) -> f64 {
    let (quarter, sign) = quarter(turns);
    let x = (quarter * per_ramp).min(1.0);
    let square = x * x;
    (x * (1.875 + square * (0.375 * square - 1.25))).copysign(sign)
}
