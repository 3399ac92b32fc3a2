//! Constant surface speed (`G96`): D changes with the diameter along the path, and with it whether the chip
//! breaks.
//!
//! With n = v_c/(2πr) both D = f/n and, for a feed per minute, f_r = F/n are proportional to the radius. Along a
//! path element with linear radius the stretches that break are therefore the [`BreakingRanges`] of D, in
//! closed form; no sampling.

use core::f64::consts::TAU;

use super::breaking_ranges::BreakingRanges;
use super::{CutCondition, FeedCoupling};

/// Unbroken spans listed in a report.
const MAX_LISTED_SPANS: usize = 64;

/// Ranges of D judged exactly in one element. Beyond, the spindle creeps at thousands of vibrations per
/// revolution and the element is judged at this many places instead.
const MAX_LOBES: f64 = 4_096.0;

/// Spans closer than this on the path are one, mm.
const CONTIGUITY_MM: f64 = 1e-9;

/// A stretch of the path along which the radius changes linearly, cut at constant surface speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearSpan {
    /// Source line.
    pub line: u32,
    /// Path position of its start in the section, mm.
    pub start_mm: f64,
    /// Length, mm.
    pub length_mm: f64,
    /// X radius at its start, mm.
    pub start_radius_mm: f64,
    /// X radius at its end, mm.
    pub end_radius_mm: f64,
    /// Vibration frequency, Hz.
    pub frequency_hz: f64,
    /// Vibration amplitude, mm.
    pub amplitude_mm: f64,
    /// Programmed feed.
    pub feed: SpanFeed,
    /// Surface speed, m/min.
    pub surface_speed_m_per_min: f64,
    /// Speed clamp, rev/min; infinite where there is none.
    pub max_rev_per_min: f64,
}

/// Feed along a [`LinearSpan`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpanFeed {
    /// mm/rev
    PerRevolution(f64),
    /// mm/min
    PerMinute(f64),
}

/// A part of the path on which the chip does not break.
#[derive(Clone, Debug, PartialEq)]
pub struct UnbrokenSpan {
    /// Source line of its start.
    pub first_line: u32,
    /// Source line of its end.
    pub last_line: u32,
    /// Path position of its start in the section, mm.
    pub start_mm: f64,
    /// Path position of its end in the section, mm.
    pub end_mm: f64,
    /// Work diameter at its start, mm.
    pub start_diameter_mm: f64,
    /// Work diameter at its end, mm.
    pub end_diameter_mm: f64,
    /// D at its start.
    pub start_vibrations_per_rev: f64,
    /// D at its end.
    pub end_vibrations_per_rev: f64,
}

/// Chip breaking along the parts of a section that are cut at constant surface speed.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceSpeedReport {
    /// Length of those parts, mm.
    pub length_mm: f64,
    /// Share of that length on which the chip breaks.
    pub broken_share: f64,
    /// Spans on which it does not, in the order of the path; the first ones where there are very many.
    pub unbroken_spans: Vec<UnbrokenSpan>,
    /// Further spans, counted but not listed.
    pub unbroken_spans_not_listed: u64,
    /// Slowest and fastest spindle speed of those parts, rev/min.
    pub spindle_rev_per_min: [f64; 2],
}

/// Gathers the spans of one section; bounded memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceSpeedAnalysis {
    length_mm: f64,
    unbroken_mm: f64,
    spans: Vec<UnbrokenSpan>,
    not_listed: u64,
    /// Slowest and fastest spindle speed, rev/min.
    spindle_rev_per_min: Option<[f64; 2]>,
    /// End of the last unbroken span, listed or not.
    last_end_mm: Option<f64>,
}

impl SurfaceSpeedAnalysis {
    /// Analyses one span; spans come in the order of the path. Spans without length and spindle speed are passed
    /// over.
    pub fn add(&mut self, span: &LinearSpan) {
        if !span.is_valid() {
            return;
        }
        self.length_mm += span.length_mm;
        let mut from = 0.0;
        self.turns_at(span.rev_per_min_at(from));
        for to in span.ends_of_linear_parts() {
            self.add_linear(span, from, to);
            self.turns_at(span.rev_per_min_at(to));
            from = to;
        }
    }

    fn turns_at(&mut self, rev_per_min: f64) {
        let [slowest, fastest] = self.spindle_rev_per_min.unwrap_or([rev_per_min; 2]);
        self.spindle_rev_per_min = Some([slowest.min(rev_per_min), fastest.max(rev_per_min)]);
    }

    /// Whether there is a place where the chip does not break.
    pub(crate) fn is_unbroken_somewhere(&self) -> bool {
        self.last_end_mm.is_some()
    }

    /// The report; `None` when nothing was cut at constant surface speed.
    #[must_use]
    pub fn finish(self) -> Option<SurfaceSpeedReport> {
        (self.length_mm > 0.0).then(|| SurfaceSpeedReport {
            length_mm: self.length_mm,
            broken_share: (1.0 - self.unbroken_mm / self.length_mm).clamp(0.0, 1.0),
            unbroken_spans: self.spans,
            unbroken_spans_not_listed: self.not_listed,
            spindle_rev_per_min: self.spindle_rev_per_min.unwrap_or_default(),
        })
    }

    /// The part of `span` between the shares `from` and `to`, on which D is linear.
    fn add_linear(&mut self, span: &LinearSpan, from: f64, to: f64) {
        let ranges = span.breaking_ranges();
        let (start, end) = (span.vibrations_at(from), span.vibrations_at(to));
        let change = end - start;
        let lobes = end.floor().max(start.floor()) - end.floor().min(start.floor()) + 1.0;
        if change == 0.0 {
            if !ranges.breaks_at(start) {
                self.add_unbroken(span, from, to);
            }
        } else if lobes <= MAX_LOBES {
            let step = if change > 0.0 { 1.0 } else { -1.0 };
            let mut lobe = start.floor();
            let mut cursor = from;
            for _ in 0..lobes as u32 {
                if let Some((low, high)) = ranges.in_lobe(lobe) {
                    let share = |vibrations: f64| from + (to - from) * ((vibrations - start) / change).clamp(0.0, 1.0);
                    let (enter, leave) = if step > 0.0 { (share(low), share(high)) } else { (share(high), share(low)) };
                    if leave > enter {
                        self.add_unbroken(span, cursor, enter);
                        cursor = leave;
                    }
                }
                lobe += step;
            }
            self.add_unbroken(span, cursor, to);
        } else {
            let width = (to - from) / MAX_LOBES;
            for index in 0..MAX_LOBES as u32 {
                let low = from + width * f64::from(index);
                if !ranges.breaks_at(span.vibrations_at(low + 0.5 * width)) {
                    self.add_unbroken(span, low, low + width);
                }
            }
        }
    }

    fn add_unbroken(&mut self, span: &LinearSpan, from: f64, to: f64) {
        if to <= from {
            return;
        }
        let (start_mm, end_mm) = (span.start_mm + span.length_mm * from, span.start_mm + span.length_mm * to);
        self.unbroken_mm += end_mm - start_mm;
        let continues = self.last_end_mm.is_some_and(|last_mm| start_mm - last_mm <= CONTIGUITY_MM);
        self.last_end_mm = Some(end_mm);
        let diameter_at = |share: f64| 2.0 * span.radius_at(share).abs();
        if continues {
            // The span that continues may be one of those not listed.
            if let Some(last) = self.spans.last_mut().filter(|_| self.not_listed == 0) {
                last.last_line = span.line;
                last.end_mm = end_mm;
                last.end_diameter_mm = diameter_at(to);
                last.end_vibrations_per_rev = span.vibrations_at(to);
            }
        } else if self.spans.len() < MAX_LISTED_SPANS {
            self.spans.push(UnbrokenSpan {
                first_line: span.line,
                last_line: span.line,
                start_mm,
                end_mm,
                start_diameter_mm: diameter_at(from),
                end_diameter_mm: diameter_at(to),
                start_vibrations_per_rev: span.vibrations_at(from),
                end_vibrations_per_rev: span.vibrations_at(to),
            });
        } else {
            self.not_listed += 1;
        }
    }
}

impl LinearSpan {
    fn is_valid(&self) -> bool {
        self.length_mm > 0.0 && self.surface_speed_m_per_min > 0.0 && self.frequency_hz > 0.0
    }

    /// Shares at which parts end along which D is linear: the radius' magnitude turns at the axis, and below the clamp
    /// radius D stays.
    fn ends_of_linear_parts(&self) -> impl Iterator<Item = f64> + use<> {
        let (start, end) = (self.start_radius_mm, self.end_radius_mm);
        let clamp_radius_mm = self.clamp_radius_mm();
        let mut cuts = [0.0, -clamp_radius_mm, clamp_radius_mm].map(|radius| (radius - start) / (end - start));
        cuts.sort_by(f64::total_cmp);
        cuts.into_iter().filter(|cut| *cut > 0.0 && *cut < 1.0).chain([1.0])
    }

    /// The cut, where the spindle speed is the same all along the span, and the diameter that it follows from, mm; no diameter where
    /// the clamp holds.
    pub(crate) fn steady_cut(&self) -> Option<(CutCondition, Option<f64>)> {
        let [start_mm, end_mm] = [self.start_radius_mm.abs(), self.end_radius_mm.abs()];
        let is_clamped = start_mm.max(end_mm) <= self.clamp_radius_mm();
        let is_round = (self.start_radius_mm - self.end_radius_mm).abs() <= CONTIGUITY_MM;
        let is_steady = self.is_valid() && (is_clamped || is_round);
        is_steady.then(|| (self.cut_at(0.0), (!is_clamped).then_some(2.0 * start_mm)))
    }

    /// The cut at a share of the span.
    pub(crate) fn cut_at(&self, share: f64) -> CutCondition {
        let spindle_rev_per_min = self.rev_per_min_at(share);
        let (feed_per_rev_mm, feed_coupling) = match self.feed {
            SpanFeed::PerRevolution(mm) => (mm, FeedCoupling::PerRevolution),
            SpanFeed::PerMinute(mm) => (mm / spindle_rev_per_min, FeedCoupling::PerMinute),
        };
        CutCondition {
            feed_per_rev_mm,
            amplitude_mm: self.amplitude_mm,
            frequency_hz: self.frequency_hz,
            spindle_rev_per_min,
            diameter_mm: 2.0 * self.radius_at(share).abs(),
            feed_coupling,
        }
    }

    /// The cut of the span that is furthest from breaking, and its margin; `None` for a span without length or speed.
    ///
    /// Between two whole D the margin |sin πD|/f_r is concave, or with a feed per minute concave over linear: it is least at
    /// one of the ends. At a whole D it is 0.
    pub(crate) fn worst_cut(&self) -> Option<(f64, CutCondition)> {
        if !self.is_valid() {
            return None;
        }
        let with_margin = |share: f64| {
            let cut = self.cut_at(share);
            (cut.breaking_margin(), cut)
        };
        let mut worst = with_margin(0.0);
        let mut from = 0.0;
        for to in self.ends_of_linear_parts() {
            let (start, end) = (self.vibrations_at(from), self.vibrations_at(to));
            let whole = start.min(end).ceil();
            if whole <= start.max(end) {
                let share = if end == start { from } else { from + (to - from) * (whole - start) / (end - start) };
                return Some((0.0, self.cut_at(share)));
            }
            let at_end = with_margin(to);
            if at_end.0 < worst.0 {
                worst = at_end;
            }
            from = to;
        }
        Some(worst)
    }

    fn radius_at(&self, share: f64) -> f64 {
        self.start_radius_mm + (self.end_radius_mm - self.start_radius_mm) * share
    }

    /// Radius below which the speed clamp holds, mm: r = v_c/(2π·n_max).
    fn clamp_radius_mm(&self) -> f64 {
        self.surface_speed_m_per_min * 1_000.0 / (TAU * self.max_rev_per_min)
    }

    /// Spindle speed at a share of the span, rev/min.
    fn rev_per_min_at(&self, share: f64) -> f64 {
        60.0 * self.frequency_hz / self.vibrations_at(share)
    }

    /// D at a share of the span.
    fn vibrations_at(&self, share: f64) -> f64 {
        let radius_mm = self.radius_at(share).abs().max(self.clamp_radius_mm());
        60.0 * self.frequency_hz * TAU * radius_mm / (self.surface_speed_m_per_min * 1_000.0)
    }

    fn breaking_ranges(&self) -> BreakingRanges {
        match self.feed {
            SpanFeed::PerRevolution(mm) => BreakingRanges::Constant(mm / (2.0 * self.amplitude_mm)),
            // f_r = F/S and D = 60f/S, whatever S is.
            SpanFeed::PerMinute(mm) => {
                BreakingRanges::Proportional(mm / (60.0 * self.frequency_hz * 2.0 * self.amplitude_mm))
            }
        }
    }
}
