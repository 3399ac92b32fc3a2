//! What would become of a section with another vibration, or at another spindle speed: the verdict that a program changed so
//! would be given. A change is suggested only where nothing rules it out.
//!
//! Several sections that one word governs are judged together, as one that has the blocks of all ([`Trial::join`]).
//!
//! Invariant: memory does not grow with the section. What is kept of it decides as the section itself does, or harder; where
//! too much of it is different, a change is not suggested.

use core::fmt;
use std::borrow::Cow;

use feedwave_motion::Quantity;

use super::departure::Departure;
use super::loads::AxisLoads;
use super::trial_cuts::TrialCuts;
use super::{VibrationCondition, VibrationSettings};
use crate::functions::sampling::Sampling;
use crate::shared::wording::{decimal, round_up};

/// Steps in which a following amplitude that breaks the chip is approached.
const AMPLITUDE_STEPS: usize = 8;
/// Smaller amplitudes that are tried, in equal steps.
const SMALLER_AMPLITUDES: u32 = 32;
/// Decimals of an amplitude in mm.
const AMPLITUDE_PLACES: usize = 4;
/// What its last decimal stands for, mm.
const AMPLITUDE_STEP_MM: f64 = 1e-4;

/// A vibration and spindle speed to be tried.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tried {
    pub(super) condition: VibrationCondition,
    /// Another speed than the programmed ones.
    pub(super) spindle_rev_per_min: Option<f64>,
}

/// What rules a change out.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Objection {
    /// Beyond the machine's limit of a frequency, an amplitude or a spindle speed.
    Limit { what: &'static str, limit: f64, unit: &'static str },
    /// Fewer than two setpoints per vibration.
    Sampling { period_s: f64 },
    /// A tangential mode leaves the contour.
    Contour { deviation_mm: f64, tolerance_mm: f64 },
    /// An axis cannot follow.
    Axis { name: Cow<'static, str>, quantity: Quantity, rotary: bool, demanded: f64, permitted: f64 },
    /// The chip does not break everywhere.
    Unbroken { line: u32, feed_override: f64 },
    /// The spindle turns at constant surface speed: no other speed can be tried.
    SurfaceSpeed,
    /// Too many different blocks or curves for it to be known.
    Unknown,
}

impl fmt::Display for Objection {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Limit { what, limit, unit } => {
                write!(formatter, "the machine's largest {what} is {} {unit}", decimal(*limit, 4))
            }
            Self::Sampling { period_s } => {
                write!(formatter, "a period of {} ms is too long for it", decimal(1e3 * period_s, 4))
            }
            Self::Contour { deviation_mm, tolerance_mm } => write!(
                formatter,
                "the tool would leave the contour by {} mm of the permitted {} mm",
                decimal(round_up(*deviation_mm, 6), 6),
                decimal(*tolerance_mm, 6)
            ),
            Self::Axis { name, quantity, rotary, demanded, permitted } => write!(
                formatter,
                "the {name} axis' {quantity} would have to be {} of the permitted {} {}",
                decimal(*demanded, 1),
                decimal(*permitted, 1),
                quantity.unit(*rotary)
            ),
            Self::Unbroken { line, feed_override } => write!(
                formatter,
                "the chip would not break in line {line} at a feed override of {} %",
                decimal(100.0 * feed_override, 2)
            ),
            Self::SurfaceSpeed => {
                formatter.write_str("at constant surface speed (G96) the spindle has no speed of its own")
            }
            Self::Unknown => formatter.write_str("the section has too many different blocks for it to be judged"),
        }
    }
}

/// A section as far as it decides about a change of its vibration.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    pub(super) condition: VibrationCondition,
    pub(super) settings: VibrationSettings,
    pub(super) period_s: f64,
    /// Largest speed of the spindle, and of the tool that it turns.
    pub(super) max_rev_per_min: f64,
    pub(super) departure: Departure,
    pub(super) cuts: TrialCuts,
    pub(super) axes: AxisLoads,
}

impl Trial {
    /// Adds another section with the same vibration and settings.
    pub(super) fn join(&mut self, other: &Self) {
        self.max_rev_per_min = self.max_rev_per_min.min(other.max_rev_per_min);
        self.departure.join(&other.departure);
        self.cuts.join(&other.cuts);
        self.axes.join(&other.axes);
    }

    /// Nothing more is known of what the vibration governs than that it may be anything.
    pub(super) fn forget(&mut self) {
        self.cuts.forget();
        self.axes.forget();
    }

    /// Number of blocks and curves that are kept.
    pub(super) fn kept(&self) -> usize {
        self.cuts.kept() + self.axes.kept()
    }

    /// The vibration as programmed but for what a change says.
    pub(super) const fn with_amplitude(&self, amplitude_mm: f64) -> Tried {
        let frequency_hz = self.condition.frequency_hz;
        Tried { condition: VibrationCondition { frequency_hz, amplitude_mm }, spindle_rev_per_min: None }
    }

    pub(super) const fn with_frequency(&self, frequency_hz: f64) -> Tried {
        let amplitude_mm = self.condition.amplitude_mm;
        Tried { condition: VibrationCondition { frequency_hz, amplitude_mm }, spindle_rev_per_min: None }
    }

    pub(super) const fn with_spindle_speed(&self, rev_per_min: f64) -> Tried {
        Tried { condition: self.condition, spindle_rev_per_min: Some(rev_per_min) }
    }

    /// Largest feed override that the chip is judged at: of the machine's permitted one and of those of the plan.
    pub(super) fn top_override(&self) -> f64 {
        self.cuts.top_override
    }

    /// What forbids a change: limits of the machine, its axes, the contour and the sampling.
    pub(super) fn refusal(&self, tried: Tried) -> Option<Objection> {
        let Tried { condition: VibrationCondition { frequency_hz, amplitude_mm }, spindle_rev_per_min } = tried;
        let settings = &self.settings;
        let limits = [
            ("frequency", frequency_hz, settings.max_frequency_hz, "Hz"),
            ("amplitude", amplitude_mm, settings.max_amplitude_mm, "mm"),
            ("spindle speed", spindle_rev_per_min.unwrap_or(0.0), self.max_rev_per_min, "rev/min"),
        ];
        if let Some((what, _, limit, unit)) = limits.into_iter().find(|(_, value, limit, _)| value > limit) {
            return Some(Objection::Limit { what, limit, unit });
        }
        if Sampling::of(1.0 / (frequency_hz * self.period_s)) == Sampling::BelowNyquist {
            return Some(Objection::Sampling { period_s: self.period_s });
        }
        let deviation_mm = self.departure.of_mm(settings.reach_mm(amplitude_mm));
        if deviation_mm > settings.contour_tolerance_mm {
            return Some(Objection::Contour { deviation_mm, tolerance_mm: settings.contour_tolerance_mm });
        }
        let feed_ratios = spindle_rev_per_min.map_or([1.0; 2], |rev_per_min| self.cuts.feed_ratios(rev_per_min));
        self.axes.objection(tried.condition, settings, feed_ratios, self.period_s)
    }

    /// What an axis would lack inside the section.
    pub(super) fn axis_refusal(&self, tried: Tried) -> Option<Objection> {
        let settings = VibrationSettings { published_limits_bind: false, ..self.settings };
        self.axes.objection(tried.condition, &settings, [1.0; 2], self.period_s)
    }

    /// What an axis would lack with this share of the programmed feed: the blend of a slower feed is shorter.
    pub(super) fn feed_refusal(&self, ratio: f64) -> Option<Objection> {
        self.axes.objection(self.condition, &self.settings, [ratio; 2], self.period_s)
    }

    /// What rules a change out that is to break the chip everywhere, at every permitted feed override.
    pub(super) fn objection(&self, tried: Tried) -> Option<Objection> {
        self.refusal(tried).or_else(|| self.cuts.objection(tried, &self.settings))
    }

    /// Smallest amplitude, in steps of 0.1 µm as it is written, that breaks the chip everywhere with the frequency and spindle
    /// speed of `tried`: above that of `tried`, or where none is or may be there, below it. `None` where none does, or it is not known.
    pub(super) fn least_amplitude_mm(&self, tried: Tried, in_word: impl Fn(f64) -> f64) -> Option<f64> {
        let with = |amplitude_mm: f64| {
            let condition = VibrationCondition { amplitude_mm: in_word(amplitude_mm), ..tried.condition };
            Tried { condition, ..tried }
        };
        let larger_mm = self.larger_amplitude_mm(tried, with);
        if larger_mm.is_some_and(|mm| self.refusal(with(mm)).is_none()) {
            return larger_mm;
        }
        // In a short part a larger amplitude has longer blends, which may let less of it through.
        let shares = (1..SMALLER_AMPLITUDES).map(|step| f64::from(step) / f64::from(SMALLER_AMPLITUDES));
        let mut smaller_mm = shares.map(|share| round_up(tried.condition.amplitude_mm * share, AMPLITUDE_PLACES));
        smaller_mm.find(|mm| self.objection(with(*mm)).is_none()).or(larger_mm)
    }

    /// The same, from that of `tried` on.
    fn larger_amplitude_mm(&self, tried: Tried, with: impl Fn(f64) -> Tried) -> Option<f64> {
        let (mut from_mm, mut last_mm) = (tried.condition.amplitude_mm, 0.0);
        for _ in 0..AMPLITUDE_STEPS {
            let condition = VibrationCondition { amplitude_mm: from_mm, ..tried.condition };
            let margin = self.cuts.worst(Tried { condition, ..tried }, &self.settings)?.margin;
            let mut amplitude_mm = round_up(from_mm / margin, AMPLITUDE_PLACES);
            if !(amplitude_mm > 0.0 && amplitude_mm.is_finite()) {
                return None;
            }
            if amplitude_mm <= last_mm {
                amplitude_mm = round_up(last_mm + 0.5 * AMPLITUDE_STEP_MM, AMPLITUDE_PLACES);
            }
            // A word in inches is a little more or less.
            if self.cuts.objection(with(amplitude_mm), &self.settings).is_none() {
                return Some(amplitude_mm);
            }
            (from_mm, last_mm) = (amplitude_mm, amplitude_mm);
        }
        None
    }

    /// Length from which on a part of the section breaks the chip with the vibration as programmed, mm, at every permitted feed
    /// override; `None` where no length does.
    pub(super) fn breaking_from_mm(&self) -> Option<f64> {
        self.cuts.breaking_from_mm(self.condition, &self.settings)
    }

    /// Least 2A·|sin πD|/f_r at every permitted feed override.
    pub(super) fn breaking_margin(&self) -> Option<f64> {
        let programmed = Tried { condition: self.condition, spindle_rev_per_min: None };
        self.cuts.worst(programmed, &self.settings).map(|worst| worst.margin)
    }

    /// What rules an amplitude out that follows the feed override up to this ratio.
    pub(super) fn objection_to_following(&self, up_to: f64) -> Option<Objection> {
        let settings = VibrationSettings { amplitude_follows_feed_up_to: Some(up_to), ..self.settings };
        let following = Self { settings, ..self.clone() };
        following.objection(Tried { condition: self.condition, spindle_rev_per_min: None })
    }
}
