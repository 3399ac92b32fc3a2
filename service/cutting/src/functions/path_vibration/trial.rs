//! What would become of a section with another vibration, or at another spindle speed: the verdict that a program changed so
//! would be given. A change is suggested only where nothing rules it out.
//!
//! Invariant: memory does not grow with the section. What is kept of it decides as the section itself does, or harder; where
//! too much of it is different, a change is not suggested.

use core::fmt;
use std::borrow::Cow;

use feedwave_motion::Quantity;

use super::chip::{CutCondition, FeedCoupling, LinearSpan, SpanFeed, reaches_through};
use super::chip_blend::{LongestPart, reached_share, whole_from_mm};
use super::chip_course::{Following, Piece};
use super::following::Arriving;
use super::loads::AxisLoads;
use super::{GenerationMode, VibrationCondition, VibrationSettings};
use crate::functions::sampling::Sampling;
use crate::shared::wording::{decimal, round_up};

/// Different cuts that are kept of a section at constant spindle speed.
const MAX_CUTS: usize = 64;
/// Spans at constant surface speed that are kept of it.
const MAX_SPANS: usize = 256;
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
    /// Largest curvature, 1/mm.
    pub(super) curvature: f64,
    pub(super) cuts: TrialCuts,
    pub(super) axes: AxisLoads,
}

impl Trial {
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
        let reach_mm = amplitude_mm * settings.follows_up_to(amplitude_mm).unwrap_or(1.0);
        let deviation_mm = 0.5 * reach_mm * reach_mm * self.curvature;
        if settings.generation_mode != GenerationMode::AlongPath && deviation_mm > settings.contour_tolerance_mm {
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

/// Cuts of a section at the feed overrides that decide: the largest permitted one, or that of the plan where it is larger.
#[derive(Clone, Debug, Default)]
pub(super) struct TrialCuts {
    constant: Vec<TrialCut>,
    surface: Vec<(LinearSpan, f64)>,
    /// There are more than are kept.
    is_incomplete: bool,
    top_override: f64,
    /// `None` as published.
    longest_part: Option<LongestPart>,
    /// What the drives let through; `None` where nothing is stated of them.
    arriving: Option<Arriving>,
}

/// Cuts at one spindle speed and override: the fastest.
#[derive(Clone, Copy, Debug)]
struct TrialCut {
    line: u32,
    feed: SpanFeed,
    spindle_rev_per_min: f64,
    feed_override: f64,
}

impl TrialCut {
    /// The cut with another vibration or at another spindle speed, at its override.
    fn tried(&self, tried: Tried, following: Following) -> CutCondition {
        let spindle_rev_per_min = tried.spindle_rev_per_min.unwrap_or(self.spindle_rev_per_min);
        let feed_per_rev_mm = match self.feed {
            SpanFeed::PerRevolution(mm) => mm,
            SpanFeed::PerMinute(mm) => mm / spindle_rev_per_min,
        };
        CutCondition {
            feed_per_rev_mm: feed_per_rev_mm * self.feed_override,
            amplitude_mm: tried.condition.amplitude_mm * following.ratio_at(self.feed_override),
            frequency_hz: tried.condition.frequency_hz,
            spindle_rev_per_min,
            diameter_mm: 0.0,
            feed_coupling: FeedCoupling::PerRevolution,
        }
    }
}

/// The cut that would be furthest from breaking.
#[derive(Clone, Copy, Debug)]
pub(super) struct TriedCut {
    margin: f64,
    line: u32,
    feed_override: f64,
}

impl TrialCuts {
    /// The longest part of the section between two places without vibration.
    pub(super) fn is_divided(&mut self, longest_part: Option<LongestPart>) {
        self.longest_part = longest_part;
    }

    /// Not all of the amplitude arrives at the tool.
    pub(super) fn arrive(&mut self, arriving: Arriving) {
        self.arriving = Some(arriving);
    }

    /// Share of the amplitude that the drives let through at a frequency.
    pub(super) fn arriving_share(&self, frequency_hz: f64) -> f64 {
        self.arriving.as_ref().map_or(1.0, |arriving| arriving.share(frequency_hz))
    }

    /// Share of the amplitude that the blends let through to the chip.
    fn reached_share(&self, tried: Tried, settings: &VibrationSettings, cut: &CutCondition) -> f64 {
        let Some(LongestPart { length_mm, feed_mm_per_s, .. }) = self.longest_part else { return 1.0 };
        let [_, faster] = tried.spindle_rev_per_min.map_or([1.0; 2], |speed| self.feed_ratios(speed));
        let Some(ramp_mm) = settings.ramp_mm(tried.condition, feed_mm_per_s * faster) else { return 1.0 };
        reached_share(length_mm, ramp_mm, cut.feed_per_rev_mm, cut.vibration_mm())
    }

    /// Length from which on a part of the section lets the whole amplitude through, mm, where that breaks every one of these cuts;
    /// `None` where it does not, or as published.
    fn breaking_from_mm(&self, condition: VibrationCondition, settings: &VibrationSettings) -> Option<f64> {
        let ramp_mm = settings.ramp_mm(condition, self.longest_part?.feed_mm_per_s)?;
        let (programmed, following) =
            (Tried { condition, spindle_rev_per_min: None }, Following::of(condition, settings));
        let is_judged = !self.is_incomplete && self.surface.is_empty();
        let cuts = self.constant.iter().filter(|_| is_judged).map(|cut| cut.tried(programmed, following));
        let lengths_mm =
            cuts.map(|cut| cut.breaks_chip().then(|| whole_from_mm(ramp_mm, cut.feed_per_rev_mm, cut.vibration_mm())));
        lengths_mm.collect::<Option<Vec<_>>>()?.into_iter().reduce(f64::max)
    }

    /// Adds a piece at the programmed feed that is cut at an override.
    pub(super) fn add(&mut self, piece: &Piece, feed_override: f64) {
        match *piece {
            Piece::Constant(block) => {
                let cut = block.cut;
                let feed = match cut.feed_coupling {
                    FeedCoupling::PerRevolution => SpanFeed::PerRevolution(cut.feed_per_rev_mm),
                    FeedCoupling::PerMinute => SpanFeed::PerMinute(cut.feed_per_rev_mm * cut.spindle_rev_per_min),
                };
                let (line, spindle_rev_per_min) = (block.line, cut.spindle_rev_per_min);
                self.add_cut(TrialCut { line, feed, spindle_rev_per_min, feed_override });
            }
            Piece::Surface(span) if self.surface.len() < MAX_SPANS => self.surface.push((span, feed_override)),
            Piece::Surface(_) => self.is_incomplete = true,
            Piece::Stopped { .. } => return,
        }
        self.top_override = self.top_override.max(feed_override);
    }

    fn add_cut(&mut self, cut: TrialCut) {
        let is_alike = |kept: &TrialCut| {
            kept.spindle_rev_per_min == cut.spindle_rev_per_min
                && kept.feed_override == cut.feed_override
                && core::mem::discriminant(&kept.feed) == core::mem::discriminant(&cut.feed)
        };
        match self.constant.iter().position(is_alike) {
            Some(index) if value_of(self.constant[index].feed) < value_of(cut.feed) => self.constant[index] = cut,
            Some(_) => {}
            None if self.constant.len() < MAX_CUTS => self.constant.push(cut),
            None => self.is_incomplete = true,
        }
    }

    /// Between what ratios of the present ones feeds would be at a spindle speed.
    fn feed_ratios(&self, spindle_rev_per_min: f64) -> [f64; 2] {
        let ratios = self.constant.iter().map(|cut| match cut.feed {
            SpanFeed::PerRevolution(_) => spindle_rev_per_min / cut.spindle_rev_per_min,
            SpanFeed::PerMinute(_) => 1.0,
        });
        ratios.fold([1.0; 2], |[least, largest], ratio| [ratio.min(least), ratio.max(largest)])
    }

    /// The cut that would be furthest from breaking with what arrives; `None` where nothing is cut, or it is not known.
    fn worst(&self, tried: Tried, settings: &VibrationSettings) -> Option<TriedCut> {
        if self.is_incomplete || (tried.spindle_rev_per_min.is_some() && !self.surface.is_empty()) {
            return None;
        }
        let VibrationCondition { frequency_hz, amplitude_mm } = tried.condition;
        let following = Following::of(tried.condition, settings);
        let arriving = self.arriving_share(frequency_hz);
        let constant = self.constant.iter().map(|cut| {
            let with = cut.tried(tried, following);
            let margin = arriving * with.breaking_margin() * self.reached_share(tried, settings, &with);
            TriedCut { margin, line: cut.line, feed_override: cut.feed_override }
        });
        let surface = self.surface.iter().filter_map(|&(span, feed_override)| {
            let with = Piece::Surface(LinearSpan { frequency_hz, amplitude_mm, ..span }).at(feed_override, following);
            let Piece::Surface(span) = with else { return None };
            span.worst_cut().map(|(margin, cut)| {
                let margin = arriving * margin * self.reached_share(tried, settings, &cut);
                TriedCut { margin, line: span.line, feed_override }
            })
        });
        constant.chain(surface).min_by(|a, b| a.margin.total_cmp(&b.margin))
    }

    fn objection(&self, tried: Tried, settings: &VibrationSettings) -> Option<Objection> {
        match self.worst(tried, settings) {
            None => Some(Objection::Unknown),
            Some(worst) if reaches_through(worst.margin) => None,
            Some(TriedCut { line, feed_override, .. }) => Some(Objection::Unbroken { line, feed_override }),
        }
    }

    /// Smallest share of its spindle speed within which every cut would stay broken; `None` where it is not known.
    pub(super) fn spindle_speed_margin(
        &self,
        condition: VibrationCondition,
        settings: &VibrationSettings,
    ) -> Option<f64> {
        if self.is_incomplete || !self.surface.is_empty() {
            return None;
        }
        let following = Following::of(condition, settings);
        let tolerances = self.constant.iter().map(|cut| {
            let (feed_per_rev_mm, feed_coupling) = match cut.feed {
                SpanFeed::PerRevolution(mm) => (mm, FeedCoupling::PerRevolution),
                SpanFeed::PerMinute(mm) => (mm / cut.spindle_rev_per_min, FeedCoupling::PerMinute),
            };
            let cut = CutCondition {
                feed_per_rev_mm: feed_per_rev_mm * cut.feed_override,
                amplitude_mm: condition.amplitude_mm * following.ratio_at(cut.feed_override),
                frequency_hz: condition.frequency_hz,
                spindle_rev_per_min: cut.spindle_rev_per_min,
                diameter_mm: 0.0,
                feed_coupling,
            };
            cut.spindle_speed_margin()
                .map_or(0.0, |tolerance| tolerance.closest_rev_per_min() / cut.spindle_rev_per_min)
        });
        tolerances.reduce(f64::min)
    }
}

const fn value_of(feed: SpanFeed) -> f64 {
    match feed {
        SpanFeed::PerRevolution(mm) | SpanFeed::PerMinute(mm) => mm,
    }
}
