//! Whether the chip breaks along a section: at the feed overrides that it is cut at, place by place, and at the largest
//! one that is permitted.
//!
//! The feed per revolution is proportional to the override r, so that the margin 2A·|sin πD|/f_r of a cut is its margin at
//! the programmed feed times a(r)/r, where a(r) is the ratio at which the amplitude follows. That never grows with r: what
//! breaks the chip at one override does so at every lower one, but where the amplitude has followed it down.

use std::collections::VecDeque;

use super::ChipSpan;
use super::chip::reaches_through;
use super::chip::{CutCondition, FeedCoupling, LinearSpan, SpanFeed, SurfaceSpeedAnalysis, SurfaceSpeedReport};
use super::chip_blend::{BlendTally, LongestPart, Parts, reached_share};
use super::chips::{ChipBlock, ChipStretches};
use super::report::{BlendReport, FEW_JUNCTIONS_SHARE};
use super::trial_cuts::TrialCuts;
use super::{OverrideReport, SurfaceCut, VibrationCondition, VibrationSettings};

/// A piece that ends this little beyond the place of a change ends there, mm: rounding of path lengths.
const SAME_PLACE_MM: f64 = 1e-9;

/// How the amplitude of a section follows the feed override.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Following {
    amplitude_mm: f64,
    /// Largest ratio at which it follows; `None`: it stays.
    up_to: Option<f64>,
}

impl Following {
    pub(super) fn of(condition: VibrationCondition, settings: &VibrationSettings) -> Self {
        let amplitude_mm = condition.amplitude_mm;
        Self { amplitude_mm, up_to: settings.follows_up_to(amplitude_mm) }
    }

    /// Ratio of the commanded amplitude to the programmed one.
    pub(super) fn ratio_at(self, feed_override: f64) -> f64 {
        self.up_to.map_or(1.0, |limit| feed_override.min(limit))
    }

    /// Largest feed override at which a cut breaks its chip that has this margin at the programmed feed; `None` where it
    /// does at none.
    fn largest_breaking(self, margin: f64) -> Option<f64> {
        match self.up_to {
            None => (margin > 0.0).then_some(margin),
            Some(limit) => reaches_through(margin).then_some(margin * limit),
        }
    }
}

/// A piece of the path, at the programmed feed.
#[derive(Clone, Copy, Debug)]
pub(super) enum Piece {
    /// At a constant spindle speed.
    Constant(ChipBlock),
    /// At a constant surface speed, along which the radius changes linearly.
    Surface(LinearSpan),
    /// With a stopped spindle: nothing can be said, and what follows is a stretch of its own.
    Stopped { start_mm: f64, length_mm: f64 },
}

impl Piece {
    pub(super) fn start_mm(&self) -> f64 {
        match *self {
            Self::Constant(ChipBlock { start_mm, .. })
            | Self::Surface(LinearSpan { start_mm, .. })
            | Self::Stopped { start_mm, .. } => start_mm,
        }
    }

    pub(super) fn length_mm(&self) -> f64 {
        match *self {
            Self::Constant(ChipBlock { length_mm, .. })
            | Self::Surface(LinearSpan { length_mm, .. })
            | Self::Stopped { length_mm, .. } => length_mm,
        }
    }

    pub(super) fn line(&self) -> u32 {
        match *self {
            Self::Constant(ChipBlock { line, .. }) | Self::Surface(LinearSpan { line, .. }) => line,
            Self::Stopped { .. } => 0,
        }
    }

    /// The cut at a place of the section; `None` with a stopped spindle.
    pub(super) fn cut_at(&self, place_mm: f64) -> Option<CutCondition> {
        match self {
            Self::Constant(block) => Some(block.cut),
            Self::Surface(span) => Some(span.cut_at(((place_mm - span.start_mm) / span.length_mm).clamp(0.0, 1.0))),
            Self::Stopped { .. } => None,
        }
    }

    /// A span at constant surface speed: where the spindle speed does not change along it, as at one diameter or at its clamp, a piece
    /// at constant spindle speed.
    pub(super) fn at_surface_speed(span: LinearSpan) -> Self {
        let Some((cut, diameter_mm)) = span.steady_cut() else { return Self::Surface(span) };
        let LinearSpan { line, start_mm, length_mm, surface_speed_m_per_min, max_rev_per_min, .. } = span;
        let surface = Some(SurfaceCut { m_per_min: surface_speed_m_per_min, diameter_mm, max_rev_per_min });
        Self::Constant(ChipBlock { line, start_mm, length_mm, cut, surface, feed_override: 1.0 })
    }

    /// Largest feed of a revolution, mm; `None` with a stopped spindle.
    pub(super) fn largest_feed_per_rev_mm(&self) -> Option<f64> {
        let ends = [self.cut_at(self.start_mm())?, self.cut_at(self.start_mm() + self.length_mm())?];
        Some(ends[0].feed_per_rev_mm.max(ends[1].feed_per_rev_mm))
    }

    /// Its parts before and after `length_mm`.
    fn divided(self, length_mm: f64) -> [Self; 2] {
        let (start_mm, rest_mm) = (self.start_mm() + length_mm, self.length_mm() - length_mm);
        match self {
            Self::Constant(block) => [
                Self::Constant(ChipBlock { length_mm, ..block }),
                Self::Constant(ChipBlock { start_mm, length_mm: rest_mm, ..block }),
            ],
            Self::Surface(span) => {
                let share = length_mm / span.length_mm;
                let radius_mm = span.start_radius_mm + (span.end_radius_mm - span.start_radius_mm) * share;
                [
                    Self::Surface(LinearSpan { length_mm, end_radius_mm: radius_mm, ..span }),
                    Self::Surface(LinearSpan { start_mm, length_mm: rest_mm, start_radius_mm: radius_mm, ..span }),
                ]
            }
            Self::Stopped { start_mm: first_mm, .. } => {
                [Self::Stopped { start_mm: first_mm, length_mm }, Self::Stopped { start_mm, length_mm: rest_mm }]
            }
        }
    }

    /// The piece under a feed override.
    pub(super) fn at(self, feed_override: f64, following: Following) -> Self {
        let amplitude_ratio = following.ratio_at(feed_override);
        match self {
            Self::Constant(mut block) => {
                block.cut.feed_per_rev_mm *= feed_override;
                block.cut.amplitude_mm *= amplitude_ratio;
                block.feed_override = feed_override;
                Self::Constant(block)
            }
            Self::Surface(mut span) => {
                span.feed = match span.feed {
                    SpanFeed::PerRevolution(mm) => SpanFeed::PerRevolution(mm * feed_override),
                    SpanFeed::PerMinute(mm) => SpanFeed::PerMinute(mm * feed_override),
                };
                span.amplitude_mm *= amplitude_ratio;
                Self::Surface(span)
            }
            Self::Stopped { .. } => self,
        }
    }

    /// The cut that is furthest from breaking.
    fn worst(&self) -> Option<Worst> {
        let (margin, cut, line) = match self {
            Self::Constant(block) => (block.cut.breaking_margin(), block.cut, block.line),
            Self::Surface(span) => {
                let (margin, cut) = span.worst_cut()?;
                (margin, cut, span.line)
            }
            Self::Stopped { .. } => return None,
        };
        Some(Worst { margin, cut, line })
    }
}

/// The cut that is furthest from breaking.
#[derive(Clone, Copy, Debug)]
struct Worst {
    margin: f64,
    cut: CutCondition,
    line: u32,
}

impl Worst {
    /// At a whole D the margin is 0 whatever the feed: the largest one needs most.
    fn is_worse_than(&self, other: &Self) -> bool {
        self.margin < other.margin
            || (self.margin == other.margin && self.cut.feed_per_rev_mm > other.cut.feed_per_rev_mm)
    }
}

/// The cut that a report is about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WorstCut {
    pub(super) cut: CutCondition,
    pub(super) line: u32,
    pub(super) feed_override: f64,
}

/// Chip breaking gathered over pieces under their overrides.
#[derive(Clone, Debug, Default)]
struct Tally {
    chips: ChipStretches,
    surface_speed: SurfaceSpeedAnalysis,
    /// The cut at the start of the first piece at constant surface speed on which the chip does not break everywhere; of the
    /// first one until there is such a piece.
    surface_cut: Option<WorstCut>,
    blend: BlendTally,
}

/// What a tally says of a section.
struct Tallied {
    broken_share: Option<f64>,
    worst: Option<WorstCut>,
    surface_speed: Option<SurfaceSpeedReport>,
    blend: Option<BlendReport>,
    chips: ChipStretches,
}

impl Tally {
    fn add(&mut self, piece: &Piece, parts: &Parts, feed_override: f64) {
        self.blend.add(piece, parts, feed_override);
        match piece {
            Piece::Constant(block) => self.chips.add(block),
            Piece::Surface(span) => {
                self.chips.interrupt();
                let was_unbroken = self.surface_speed.is_unbroken_somewhere();
                self.surface_speed.add(span);
                let becomes_unbroken = !was_unbroken && self.surface_speed.is_unbroken_somewhere();
                if self.surface_cut.is_none() || becomes_unbroken {
                    self.surface_cut = Some(WorstCut { cut: span.cut_at(0.0), line: span.line, feed_override });
                }
            }
            Piece::Stopped { .. } => self.chips.interrupt(),
        }
    }

    /// Judges a section of `length_mm`.
    fn finish(mut self, parts: &Parts, length_mm: f64) -> Tallied {
        let surface_speed = core::mem::take(&mut self.surface_speed).finish();
        let surface = surface_speed.as_ref();
        let surface_mm = surface.map_or(0.0, |surface| surface.length_mm);
        let steady_mm = self.chips.broken_mm() + surface.map_or(0.0, |surface| surface.broken_share * surface_mm);
        let cut_mm = self.chips.length_mm() + surface_mm;
        let blend = core::mem::take(&mut self.blend).finish(parts, length_mm);
        // What breaks nowhere is judged by the amplitude that there is; elsewhere the cut with the whole one.
        let never = blend.never.filter(|_| steady_mm > 0.0);
        let broken_mm = if never.is_some() { 0.0 } else { (steady_mm - blend.inside_mm).max(0.0) };
        let broken_share = (cut_mm > 0.0).then(|| broken_mm / cut_mm);
        let worst = never.or_else(|| self.worst(surface));
        Tallied { broken_share, worst, blend: blend.report, chips: self.chips, surface_speed }
    }

    /// The cut furthest from breaking: at constant surface speed that in the middle of the first span that does not break.
    fn worst(&self, surface: Option<&SurfaceSpeedReport>) -> Option<WorstCut> {
        let at_surface_speed = self.surface_cut.map(|start| {
            let Some(span) = surface.and_then(|surface| surface.unbroken_spans.first()) else { return start };
            let vibrations_per_rev = 0.5 * (span.start_vibrations_per_rev + span.end_vibrations_per_rev);
            let spindle_rev_per_min = 60.0 * start.cut.frequency_hz / vibrations_per_rev;
            let speed_ratio = match start.cut.feed_coupling {
                FeedCoupling::PerRevolution => 1.0,
                FeedCoupling::PerMinute => start.cut.spindle_rev_per_min / spindle_rev_per_min,
            };
            let cut = CutCondition {
                feed_per_rev_mm: start.cut.feed_per_rev_mm * speed_ratio,
                spindle_rev_per_min,
                diameter_mm: 0.5 * (span.start_diameter_mm + span.end_diameter_mm),
                ..start.cut
            };
            WorstCut { cut, line: span.first_line, ..start }
        });
        let both = [self.chips.worst(), at_surface_speed].into_iter().flatten();
        both.min_by(|a, b| {
            let by_margin = a.cut.breaking_margin().total_cmp(&b.cut.breaking_margin());
            by_margin.then(b.cut.feed_per_rev_mm.total_cmp(&a.cut.feed_per_rev_mm))
        })
    }
}

/// Chip breaking along one section. Its memory does not grow with the section: pieces wait only until they are cut.
#[derive(Clone, Debug)]
pub(super) struct ChipCourse {
    following: Following,
    max_amplitude_mm: f64,
    max_feed_override: f64,
    /// Whether pieces wait for the override that they are cut at, instead of being cut at the programmed feed.
    waits: bool,
    waiting: VecDeque<Piece>,
    /// Places up to which the path has been cut, and at which overrides, while the amplitude there is not known yet.
    cuts: VecDeque<(f64, f64)>,
    /// Up to where the path is known, mm; infinite once it is over.
    known_mm: f64,
    parts: Parts,
    /// How far back the revolution before can be, mm.
    lag_mm: f64,
    cut: Tally,
    permitted: Tally,
    trial: TrialCuts,
    /// At the programmed feed.
    worst: Option<Worst>,
}

/// The judgement of the chip of a section.
pub(super) struct ChipVerdict {
    pub(super) broken_share: Option<f64>,
    pub(super) worst: Option<WorstCut>,
    pub(super) spans: Vec<ChipSpan>,
    pub(super) spans_not_listed: u64,
    pub(super) surface_speed: Option<SurfaceSpeedReport>,
    pub(super) permitted: Option<OverrideReport>,
    /// What the blends leave of it; `None` as published.
    pub(super) blend: Option<BlendReport>,
    /// What decides about another vibration.
    pub(super) trial: TrialCuts,
}

impl ChipCourse {
    pub(super) fn new(condition: VibrationCondition, settings: &VibrationSettings) -> Self {
        Self {
            following: Following::of(condition, settings),
            max_amplitude_mm: settings.max_amplitude_mm,
            max_feed_override: 1.0,
            waits: false,
            waiting: VecDeque::new(),
            cuts: VecDeque::new(),
            known_mm: 0.0,
            parts: Parts::default(),
            lag_mm: 0.0,
            cut: Tally::default(),
            permitted: Tally::default(),
            trial: TrialCuts::default(),
            worst: None,
        }
    }

    /// See [`super::SectionAnalyzer::with_feed_overrides`].
    pub(super) fn with_overrides(self, max_feed_override: f64, waits: bool) -> Self {
        Self { max_feed_override, waits, ..self }
    }

    /// A part starts at a place of the section, and the one before ends.
    pub(super) fn start_part(&mut self, place_mm: f64, ramp_mm: Option<f64>, feed_mm_per_s: f64) {
        if let Some(ramp_mm) = ramp_mm {
            self.parts.start(place_mm, ramp_mm, feed_mm_per_s);
            self.advance();
        }
    }

    pub(super) fn add(&mut self, piece: Piece) {
        if let Some(worst) = piece.worst()
            && self.worst.is_none_or(|known| worst.is_worse_than(&known))
        {
            self.worst = Some(worst);
        }
        let feed_mm = piece.largest_feed_per_rev_mm().unwrap_or(0.0);
        self.lag_mm = self.lag_mm.max(feed_mm * self.max_feed_override);
        self.known_mm = piece.start_mm() + piece.length_mm();
        self.waiting.push_back(piece);
        self.advance();
    }

    /// The path has been cut up to a place of the section at a feed override; what was cut before stays.
    pub(super) fn is_cut(&mut self, up_to_mm: f64, feed_override: f64) {
        self.cuts.push_back((up_to_mm, feed_override));
        self.advance();
    }

    /// Judges what has been cut, as far as the amplitude is known.
    fn advance(&mut self) {
        let judged_mm = self.parts.judged_up_to_mm(self.known_mm);
        while let Some(piece) = self.waiting.pop_front() {
            let Some(&(up_to_mm, feed_override)) = self.cuts.front().or((!self.waits).then_some(&(f64::INFINITY, 1.0)))
            else {
                return self.waiting.push_front(piece);
            };
            let before_mm = up_to_mm - piece.start_mm();
            if before_mm <= SAME_PLACE_MM {
                self.waiting.push_front(piece);
                self.cuts.pop_front();
                continue;
            }
            let is_divided = before_mm < piece.length_mm() - SAME_PLACE_MM;
            let needed_mm = if is_divided { up_to_mm } else { piece.start_mm() + piece.length_mm() };
            if needed_mm > judged_mm {
                return self.waiting.push_front(piece);
            }
            let piece = if is_divided {
                let [piece, rest] = piece.divided(before_mm);
                self.waiting.push_front(rest);
                piece
            } else {
                piece
            };
            self.judge(&piece, feed_override);
        }
    }

    fn judge(&mut self, piece: &Piece, feed_override: f64) {
        let permitted = piece.at(self.max_feed_override, self.following);
        self.permitted.add(&permitted, &self.parts, self.max_feed_override);
        self.cut.add(&piece.at(feed_override, self.following), &self.parts, feed_override);
        self.trial.add(piece, feed_override.max(self.max_feed_override));
        self.parts.forget_before(piece.start_mm() - self.lag_mm);
    }

    /// The verdict on a section of `length_mm`; what still waits is judged at the programmed feed.
    pub(super) fn finish(mut self, length_mm: f64) -> ChipVerdict {
        self.parts.close(length_mm);
        self.known_mm = f64::INFINITY;
        self.is_cut(f64::INFINITY, 1.0);
        self.trial.is_divided(self.parts.longest());
        let permitted = self.permitted_report(length_mm);
        let Tallied { broken_share, worst, surface_speed, blend, chips } = self.cut.finish(&self.parts, length_mm);
        let (spans, spans_not_listed) = chips.into_spans(length_mm);
        let trial = self.trial;
        ChipVerdict { broken_share, worst, spans, spans_not_listed, surface_speed, permitted, blend, trial }
    }

    fn permitted_report(&mut self, length_mm: f64) -> Option<OverrideReport> {
        let broken_share = core::mem::take(&mut self.permitted).finish(&self.parts, length_mm).broken_share?;
        let Worst { margin, cut, line } = self.worst?;
        let amplitude_ratio = self.following.ratio_at(self.max_feed_override);
        let least_mm = |needed_override: f64| {
            let commanded_mm = needed_override * cut.amplitude_mm / margin;
            let programmed_mm = commanded_mm / self.following.up_to.map_or(1.0, |limit| needed_override.min(limit));
            (margin > 0.0 && commanded_mm <= self.max_amplitude_mm).then_some(programmed_mm)
        };
        // Where the blends decide, the feed alone does not say up to which override.
        let blends_decide = broken_share < 1.0 - FEW_JUNCTIONS_SHARE
            && reaches_through(margin * amplitude_ratio / self.max_feed_override);
        let largest = self.following.largest_breaking(margin).filter(|_| !blends_decide);
        let reached = self.parts.longest().map_or(1.0, |LongestPart { length_mm, ramp_mm, .. }| {
            let ratio = self.max_feed_override;
            reached_share(length_mm, ramp_mm, ratio * cut.feed_per_rev_mm, ratio * cut.vibration_mm())
        });
        Some(OverrideReport {
            max_feed_override: self.max_feed_override,
            broken_share,
            breaking_margin: reached * margin * amplitude_ratio / self.max_feed_override,
            blends_decide,
            line,
            largest_breaking_override: largest,
            largest_breaking_feed_per_rev_mm: largest.map(|ratio| cut.feed_per_rev_mm * ratio),
            min_amplitude_mm: least_mm(self.max_feed_override).filter(|_| !blends_decide),
        })
    }
}

#[cfg(test)]
mod tests;
