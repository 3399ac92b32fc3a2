//! The cuts of a section as far as they decide whether another vibration, or another spindle speed, breaks the chip.

use super::chip::{CutCondition, FeedCoupling, LinearSpan, SpanFeed, reaches_through};
use super::chip_blend::{LongestPart, reached_share, whole_from_mm};
use super::chip_course::{Following, Piece};
use super::following::Arriving;
use super::trial::{Objection, Tried};
use super::{VibrationCondition, VibrationSettings};

/// Different cuts that are kept at constant spindle speed.
const MAX_CUTS: usize = 64;
/// Spans that are kept at constant surface speed.
const MAX_SPANS: usize = 256;

/// Cuts of a section at the feed overrides that decide: the largest permitted one, or that of the plan where it is larger.
#[derive(Clone, Debug, Default)]
pub(super) struct TrialCuts {
    constant: Vec<TrialCut>,
    surface: Vec<TrialSpan>,
    /// There are more than are kept.
    is_incomplete: bool,
    pub(super) top_override: f64,
    /// What the drives let through; `None` where nothing is stated of them.
    arriving: Option<Arriving>,
}

/// Cuts at one spindle speed and override: the fastest.
#[derive(Clone, Copy, Debug)]
struct TrialCut {
    line: u32,
    feed: SpanFeed,
    spindle_rev_per_min: f64,
    /// Its speed follows from a constant surface speed: another one is no word of the program.
    at_surface_speed: bool,
    feed_override: f64,
    /// The longest part of its section between two places without vibration; `None` as published.
    longest_part: Option<LongestPart>,
}

/// A span at constant surface speed and its override, likewise.
#[derive(Clone, Copy, Debug)]
struct TrialSpan {
    span: LinearSpan,
    feed_override: f64,
    longest_part: Option<LongestPart>,
}

/// Whether the blends let no more through to a part than to the other.
fn is_no_longer(part: Option<LongestPart>, other: Option<LongestPart>) -> bool {
    match (part, other) {
        (Some(part), Some(other)) => part.length_mm <= other.length_mm && part.feed_mm_per_s >= other.feed_mm_per_s,
        (part, other) => part.is_some() == other.is_some(),
    }
}

impl TrialSpan {
    /// Whether whatever breaks the chip here breaks it there.
    fn decides_for(&self, other: &Self) -> bool {
        let place = |span: LinearSpan| LinearSpan { line: 0, start_mm: 0.0, length_mm: 0.0, ..span };
        place(self.span) == place(other.span)
            && self.feed_override == other.feed_override
            && is_no_longer(self.longest_part, other.longest_part)
    }
}

impl TrialCut {
    /// Whether whatever breaks the chip here breaks it there.
    fn decides_for(&self, other: &Self) -> bool {
        self.spindle_rev_per_min == other.spindle_rev_per_min
            && self.at_surface_speed == other.at_surface_speed
            && self.feed_override == other.feed_override
            && core::mem::discriminant(&self.feed) == core::mem::discriminant(&other.feed)
            && value_of(self.feed) >= value_of(other.feed)
            && is_no_longer(self.longest_part, other.longest_part)
    }

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
    pub(super) margin: f64,
    line: u32,
    feed_override: f64,
}

impl TrialCuts {
    /// The longest part of the section between two places without vibration.
    pub(super) fn is_divided(&mut self, longest_part: Option<LongestPart>) {
        self.constant.iter_mut().for_each(|cut| cut.longest_part = longest_part);
        self.surface.iter_mut().for_each(|span| span.longest_part = longest_part);
    }

    /// See [`super::trial::Trial::join`].
    pub(super) fn join(&mut self, other: &Self) {
        other.constant.iter().for_each(|cut| self.add_cut(*cut));
        other.surface.iter().for_each(|span| self.join_span(*span));
        self.is_incomplete |= other.is_incomplete;
        self.top_override = self.top_override.max(other.top_override);
        match (&mut self.arriving, &other.arriving) {
            (Some(arriving), Some(other)) => arriving.join(other),
            (arriving, other) => *arriving = arriving.take().or_else(|| other.clone()),
        }
    }

    /// See [`super::trial::Trial::forget`].
    pub(super) fn forget(&mut self) {
        (self.constant, self.surface, self.is_incomplete) = (Vec::new(), Vec::new(), true);
    }

    /// How many are kept.
    pub(super) fn kept(&self) -> usize {
        self.constant.len() + self.surface.len()
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
    fn reached_share(
        &self,
        tried: Tried,
        settings: &VibrationSettings,
        cut: &CutCondition,
        longest_part: Option<LongestPart>,
    ) -> f64 {
        let Some(LongestPart { length_mm, feed_mm_per_s, .. }) = longest_part else { return 1.0 };
        let [_, faster] = tried.spindle_rev_per_min.map_or([1.0; 2], |speed| self.feed_ratios(speed));
        let Some(ramp_mm) = settings.ramp_mm(tried.condition, feed_mm_per_s * faster) else { return 1.0 };
        reached_share(length_mm, ramp_mm, cut.feed_per_rev_mm, cut.vibration_mm())
    }

    /// Length from which on a part of the section lets the whole amplitude through, mm, where that breaks every one of these cuts;
    /// `None` where it does not, or as published.
    pub(super) fn breaking_from_mm(&self, condition: VibrationCondition, settings: &VibrationSettings) -> Option<f64> {
        let (programmed, following) =
            (Tried { condition, spindle_rev_per_min: None }, Following::of(condition, settings));
        let is_judged = !self.is_incomplete && self.surface.is_empty();
        let lengths_mm = self.constant.iter().filter(|_| is_judged).map(|kept| {
            let cut = kept.tried(programmed, following);
            let ramp_mm = settings.ramp_mm(condition, kept.longest_part?.feed_mm_per_s)?;
            cut.breaks_chip().then(|| whole_from_mm(ramp_mm, cut.feed_per_rev_mm, cut.vibration_mm()))
        });
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
                let at_surface_speed = block.surface.is_some();
                let longest_part = None;
                self.add_cut(TrialCut {
                    line,
                    feed,
                    spindle_rev_per_min,
                    at_surface_speed,
                    feed_override,
                    longest_part,
                });
            }
            Piece::Surface(span) if self.surface.len() < MAX_SPANS => {
                self.surface.push(TrialSpan { span, feed_override, longest_part: None });
            }
            Piece::Surface(_) => self.is_incomplete = true,
            Piece::Stopped { .. } => return,
        }
        self.top_override = self.top_override.max(feed_override);
    }

    fn add_cut(&mut self, cut: TrialCut) {
        if self.constant.iter().any(|kept| kept.decides_for(&cut)) {
            return;
        }
        match self.constant.iter().position(|kept| cut.decides_for(kept)) {
            Some(index) => self.constant[index] = cut,
            None if self.constant.len() < MAX_CUTS => self.constant.push(cut),
            None => self.is_incomplete = true,
        }
    }

    fn join_span(&mut self, span: TrialSpan) {
        if self.surface.iter().any(|kept| kept.decides_for(&span)) {
            return;
        }
        match self.surface.iter().position(|kept| span.decides_for(kept)) {
            Some(index) => self.surface[index] = span,
            None if self.surface.len() < MAX_SPANS => self.surface.push(span),
            None => self.is_incomplete = true,
        }
    }

    /// Between what ratios of the present ones feeds would be at a spindle speed.
    pub(super) fn feed_ratios(&self, spindle_rev_per_min: f64) -> [f64; 2] {
        let ratios = self.constant.iter().map(|cut| match cut.feed {
            SpanFeed::PerRevolution(_) => spindle_rev_per_min / cut.spindle_rev_per_min,
            SpanFeed::PerMinute(_) => 1.0,
        });
        ratios.fold([1.0; 2], |[least, largest], ratio| [ratio.min(least), ratio.max(largest)])
    }

    /// The cut that would be furthest from breaking with what arrives; `None` where nothing is cut, or it is not known.
    pub(super) fn worst(&self, tried: Tried, settings: &VibrationSettings) -> Option<TriedCut> {
        if self.is_incomplete || self.has_other_speed(tried) {
            return None;
        }
        let VibrationCondition { frequency_hz, amplitude_mm } = tried.condition;
        let following = Following::of(tried.condition, settings);
        let arriving = self.arriving_share(frequency_hz);
        let constant = self.constant.iter().map(|cut| {
            let with = cut.tried(tried, following);
            let margin =
                arriving * with.breaking_margin() * self.reached_share(tried, settings, &with, cut.longest_part);
            TriedCut { margin, line: cut.line, feed_override: cut.feed_override }
        });
        let surface = self.surface.iter().filter_map(|&TrialSpan { span, feed_override, longest_part }| {
            let with = Piece::Surface(LinearSpan { frequency_hz, amplitude_mm, ..span }).at(feed_override, following);
            let Piece::Surface(span) = with else { return None };
            span.worst_cut().map(|(margin, cut)| {
                let margin = arriving * margin * self.reached_share(tried, settings, &cut, longest_part);
                TriedCut { margin, line: span.line, feed_override }
            })
        });
        constant.chain(surface).min_by(|a, b| a.margin.total_cmp(&b.margin))
    }

    /// Whether a spindle speed is tried where the diameter says it.
    fn has_other_speed(&self, tried: Tried) -> bool {
        let is_of_diameter = || !self.surface.is_empty() || self.constant.iter().any(|cut| cut.at_surface_speed);
        tried.spindle_rev_per_min.is_some() && is_of_diameter()
    }

    pub(super) fn objection(&self, tried: Tried, settings: &VibrationSettings) -> Option<Objection> {
        match self.worst(tried, settings) {
            None if self.has_other_speed(tried) => Some(Objection::SurfaceSpeed),
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
