//! Observes the elements of one vibrating section and judges it at its end.
//!
//! Invariant: memory does not grow with the section.

use feedwave_motion::{Curve, Element, LimitExceeded, Machine, MachineKind, PathLimits, TANGENT_TOLERANCE_RAD};
use feedwave_program::{Axis, DrillingCycle, Feed, FindingLog, Position, SourceSpan, Spindle, SpindleSpeed};

use super::chip::{CutCondition, FeedCoupling, LinearSpan, SpanFeed, analyse};
use super::chip_course::{ChipCourse, ChipVerdict, Piece};
use super::chips::ChipBlock;
use super::departure::{Departure, JunctionReach};
use super::findings::Evidence;
use super::following::FollowingLoss;
use super::loads::AxisLoads;
use super::trial::Trial;
use super::{
    FollowingReport, GenerationMode, SamplingReport, SectionPartStart, SectionReport, VibrationCondition,
    VibrationEnvelope, VibrationSettings, VibrationWordSpans, sin_turns,
};
use crate::shared::following::FollowingModel;

/// Pieces in which the radius of an arc counts as linear, for constant surface speed. The chord of a 32nd of
/// a full circle leaves it by half a hundredth of its radius.
const ARC_PIECES: u32 = 32;
/// Parts listed in a report.
const MAX_LISTED_PARTS: usize = 64;

/// Gathers what validation has to say about one vibrating section.
#[derive(Clone, Debug)]
pub struct SectionAnalyzer {
    condition: VibrationCondition,
    on_span: SourceSpan,
    words: VibrationWordSpans,
    settings: VibrationSettings,
    machine_kind: MachineKind,
    max_rev_per_min: f64,
    /// Largest spindle speed of the tool, rev/min.
    max_tool_rev_per_min: f64,
    following: Option<FollowingLoss>,
    period_s: f64,
    drilling_cycle: Option<DrillingCycle>,
    first_line: Option<u32>,
    last_line: u32,
    length_mm: f64,
    parts: Parts,
    loads: AxisLoads,
    /// The junctions that the largest programmed and the largest permitted offset go over; not along the path.
    junctions: Option<[JunctionReach; 2]>,
    /// Largest curvature, 1/mm, and its line.
    sharpest: Option<(f64, u32)>,
    chips: ChipCourse,
    /// First block cut with a stopped spindle.
    stopped_line: Option<u32>,
    /// Whether a block of it was refused before it could be judged.
    refused: bool,
}

/// The parts of a section between the junctions that the vibration does not go over.
#[derive(Clone, Debug, Default)]
struct Parts {
    /// Length of the present part, mm.
    length_mm: f64,
    /// Length over which it is blended in and out, mm; `None` as published.
    ramp_mm: Option<f64>,
    longest_ramp_mm: Option<f64>,
    /// Where they begin; the first ones.
    starts: Vec<SectionPartStart>,
    /// Path length with the whole amplitude in the parts before, mm.
    whole_mm: f64,
    junctions: u64,
    /// Largest |τ₂−τ₁| of a junction that is not tangent, and its line.
    corner: Option<(f64, u32)>,
}

impl Parts {
    fn close(&mut self) {
        self.whole_mm += (self.length_mm - 2.0 * self.ramp_mm.unwrap_or(0.0)).max(0.0);
        self.length_mm = 0.0;
    }
}

impl SectionAnalyzer {
    /// An analyzer at the start of a section that the words at `on_span` switched on. The generation mode in
    /// `settings` is that of the run.
    #[must_use]
    pub fn new(
        condition: VibrationCondition,
        on_span: SourceSpan,
        settings: &VibrationSettings,
        machine: &Machine,
        following: &FollowingModel,
        interpolation_period_s: f64,
    ) -> Self {
        let period_s = match settings.generation_mode {
            GenerationMode::ServoSide => interpolation_period_s / f64::from(settings.servo_substeps.max(1)),
            GenerationMode::AlongPath | GenerationMode::Tangential => interpolation_period_s,
        };
        let reach_mm = settings.reach_mm(condition.amplitude_mm);
        let leaves_path = settings.generation_mode != GenerationMode::AlongPath;
        let largest_mm = reach_mm.max(settings.max_amplitude_mm);
        Self {
            condition,
            on_span,
            words: VibrationWordSpans::default(),
            settings: *settings,
            machine_kind: machine.kind,
            max_rev_per_min: machine.max_spindle_rev_per_min,
            max_tool_rev_per_min: f64::INFINITY,
            following: following.is_stated().then(|| FollowingLoss::new(following, condition)),
            period_s,
            drilling_cycle: None,
            first_line: None,
            last_line: on_span.line,
            length_mm: 0.0,
            parts: Parts::default(),
            loads: AxisLoads::new(condition, settings, machine),
            junctions: leaves_path.then(|| [reach_mm, largest_mm].map(JunctionReach::new)),
            sharpest: None,
            chips: ChipCourse::new(condition, settings),
            stopped_line: None,
            refused: false,
        }
    }

    /// States where the frequency and amplitude words are, so that findings can offer their replacement.
    #[must_use]
    pub fn with_word_spans(mut self, words: VibrationWordSpans) -> Self {
        self.words = words;
        self
    }

    /// Says which feed overrides there are: the largest one that the machine permits, and whether the plan changes it, so that
    /// [`SectionAnalyzer::is_cut`] will be called. Without, all is judged at the programmed feed.
    #[must_use]
    pub fn with_feed_overrides(mut self, max_feed_override: f64, changes: bool) -> Self {
        self.chips = self.chips.with_overrides(max_feed_override, changes);
        self.loads.permit(max_feed_override);
        self
    }

    /// The path has been cut up to a place, mm from the section's start, at this feed override from where it had been cut to
    /// before.
    pub fn is_cut(&mut self, up_to_mm: f64, feed_override: f64) {
        self.chips.is_cut(up_to_mm, feed_override);
        self.loads.permit(feed_override);
    }

    /// A move of a drilling cycle is in the section.
    pub fn is_in_cycle(&mut self, cycle: DrillingCycle) {
        self.drilling_cycle.get_or_insert(cycle);
    }

    /// The tool permits this spindle speed at most.
    pub fn turns_tool_up_to(&mut self, max_rev_per_min: f64) {
        self.max_tool_rev_per_min = self.max_tool_rev_per_min.min(max_rev_per_min);
    }

    /// A block of the section is refused, so that the vibration on it is not judged.
    pub fn refuses_block(&mut self) {
        self.refused = true;
    }

    /// A part of the section starts, at this programmed feed.
    pub fn start_part(&mut self, feed_mm_per_s: f64) {
        self.parts.close();
        self.junctions.iter_mut().flatten().for_each(JunctionReach::interrupt);
        self.parts.ramp_mm = self.settings.ramp_mm(self.condition, feed_mm_per_s);
        let [longest, ramp] = [self.parts.longest_ramp_mm, self.parts.ramp_mm];
        self.parts.longest_ramp_mm = longest.into_iter().chain(ramp).reduce(f64::max);
        if self.parts.starts.len() < MAX_LISTED_PARTS {
            self.parts.starts.push(SectionPartStart { start_mm: self.length_mm, feed_mm_per_s });
        }
        self.chips.start_part(self.length_mm, self.parts.ramp_mm, feed_mm_per_s);
        self.loads.start_part(feed_mm_per_s);
    }

    /// The directions of the axes change so much at a junction, before and behind which a published vibration may be at its
    /// full speed.
    pub fn turns_at_junction(&mut self, kinks: &Position) {
        self.loads.turns_at_junction(kinks);
    }

    /// The vibration goes over a junction of blocks; `direction_change` is |τ₂−τ₁| there.
    pub fn goes_over_junction(&mut self, direction_change: f64, line: u32) {
        for junctions in self.junctions.iter_mut().flatten() {
            junctions.add(self.length_mm, direction_change, line);
        }
    }

    /// The part ends at a junction of blocks; `direction_change` is |τ₂−τ₁| there.
    pub fn end_part(&mut self, direction_change: f64, line: u32) {
        self.parts.junctions += 1;
        if direction_change > TANGENT_TOLERANCE_RAD {
            raise(&mut self.parts.corner, direction_change, line);
        }
    }

    /// Adds the next cutting element of the section. `limits` is what the vibration leaves for the feed on it.
    pub fn add_element(
        &mut self,
        element: &Element,
        feed: Feed,
        spindle: &Spindle,
        limits: &Result<PathLimits, LimitExceeded>,
    ) {
        let line = element.source.line;
        let start_mm = self.length_mm;
        self.first_line.get_or_insert(line);
        self.last_line = line;
        self.length_mm += element.length;
        self.parts.length_mm += element.length;

        let [least_radius_mm, largest_radius_mm] = element.radius_range_mm();
        let fastest_rev_per_s = spindle.rev_per_s(least_radius_mm).min(self.max_rev_per_min / 60.0);
        let feed_mm_per_s = match feed {
            Feed::PerMinute(mm) => mm / 60.0,
            Feed::PerRevolution(mm) => mm * fastest_rev_per_s,
            Feed::InverseTime(per_min) => element.length * per_min / 60.0,
        };
        self.loads.add(element, feed_mm_per_s, limits);
        if let Some(following) = &mut self.following {
            following.add(element, feed_mm_per_s);
        }
        raise(&mut self.sharpest, element.curvature(), line);

        if !spindle.is_turning() {
            self.stopped_line.get_or_insert(line);
            self.chips.add(Piece::Stopped { start_mm, length_mm: element.length });
            return;
        }
        let span_feed = match feed {
            Feed::PerRevolution(mm) => SpanFeed::PerRevolution(mm),
            Feed::PerMinute(mm) => SpanFeed::PerMinute(mm),
            Feed::InverseTime(per_min) => SpanFeed::PerMinute(element.length * per_min),
        };
        match spindle.speed {
            SpindleSpeed::Constant { rev_per_min } => {
                let diameter_mm = match self.machine_kind {
                    MachineKind::Lathe => 2.0 * largest_radius_mm,
                    // The tool turns, and its diameter is not the path's.
                    MachineKind::Mill => 0.0,
                };
                let cut = self.cut(span_feed, rev_per_min, diameter_mm);
                let block =
                    ChipBlock { line, start_mm, length_mm: element.length, cut, surface: None, feed_override: 1.0 };
                self.chips.add(Piece::Constant(block));
            }
            SpindleSpeed::Surface { m_per_min, max_rev_per_min } => {
                let max_rev_per_min = max_rev_per_min.min(self.max_rev_per_min);
                self.add_surface_speed(element, start_mm, span_feed, m_per_min, max_rev_per_min);
            }
        }
    }

    /// The cut of this vibration at a feed and spindle speed.
    fn cut(&self, feed: SpanFeed, spindle_rev_per_min: f64, diameter_mm: f64) -> CutCondition {
        let (feed_per_rev_mm, feed_coupling) = match feed {
            SpanFeed::PerRevolution(mm) => (mm, FeedCoupling::PerRevolution),
            SpanFeed::PerMinute(mm) => (mm / spindle_rev_per_min, FeedCoupling::PerMinute),
        };
        CutCondition {
            feed_per_rev_mm,
            amplitude_mm: self.condition.amplitude_mm,
            frequency_hz: self.condition.frequency_hz,
            spindle_rev_per_min,
            diameter_mm,
            feed_coupling,
        }
    }

    fn add_surface_speed(
        &mut self,
        element: &Element,
        start_mm: f64,
        feed: SpanFeed,
        surface_speed_m_per_min: f64,
        max_rev_per_min: f64,
    ) {
        let pieces = match element.curve {
            Curve::Line => 1,
            Curve::Arc(_) | Curve::Spline(_) | Curve::FiveAxis(_) => ARC_PIECES,
        };
        let radius_at = |index: u32| {
            let mut radius_mm = [0.0];
            element.fill_axis(Axis::X, &[element.length * f64::from(index) / f64::from(pieces)], &mut radius_mm);
            radius_mm[0]
        };
        let length_mm = element.length / f64::from(pieces);
        for index in 0..pieces {
            let span = LinearSpan {
                line: element.source.line,
                start_mm: start_mm + length_mm * f64::from(index),
                length_mm,
                start_radius_mm: radius_at(index),
                end_radius_mm: radius_at(index + 1),
                frequency_hz: self.condition.frequency_hz,
                amplitude_mm: self.condition.amplitude_mm,
                feed,
                surface_speed_m_per_min,
                max_rev_per_min,
            };
            self.chips.add(Piece::at_surface_speed(span));
        }
    }

    /// Ends the section: pushes one finding for each condition that is not met, and reports. `clamped_samples`
    /// of `total_samples` setpoints were clamped at the section's ends; both are 0 when none were generated.
    #[must_use]
    pub fn finish(self, clamped_samples: u64, total_samples: u64, findings: &mut FindingLog) -> SectionReport {
        self.into_evidence(clamped_samples, total_samples).conclude(findings)
    }

    /// What is known of the section at its end; see [`SectionAnalyzer::finish`].
    // As long as the report: every figure is one line.
    pub(super) fn into_evidence(mut self, clamped_samples: u64, total_samples: u64) -> Evidence {
        self.parts.close();
        let VibrationCondition { frequency_hz, amplitude_mm } = self.condition;
        let off_contour = self.settings.generation_mode != GenerationMode::AlongPath;
        let only_off_contour = |value_mm: f64| if off_contour { value_mm } else { 0.0 };
        let reach_mm = self.settings.reach_mm(amplitude_mm);
        let ChipVerdict {
            broken_share,
            worst,
            spans,
            spans_not_listed,
            surface_speed,
            permitted,
            blend,
            trial: mut cuts,
        } = self.chips.finish(self.length_mm);
        let following_is_stated = self.following.is_some();
        let following = match self.following.map(FollowingLoss::into_parts) {
            Some((report, arriving)) => {
                cuts.arrive(arriving);
                report
            }
            None => FollowingReport::of_all(amplitude_mm),
        };
        let curvature = self.sharpest.map_or(0.0, |(curvature, _)| curvature);
        let departure = self.junctions.as_ref().map_or_else(Departure::default, |junctions| Departure {
            curvature_per_mm: curvature,
            at_junctions: junctions.each_ref().map(JunctionReach::departure),
        });
        let corner = self.parts.corner.map_or(0.0, |(change, _)| change);
        let published = self.settings.envelope == VibrationEnvelope::Published;
        let turns_per_period = frequency_hz * self.period_s;
        let published_ends = published.then(|| self.loads.published_ends(self.period_s));
        let deciding_axes = self.loads.deciding(published.then_some(self.period_s));
        let report = SectionReport {
            on_line: self.on_span.line,
            first_line: self.first_line.unwrap_or(self.on_span.line),
            last_line: self.last_line,
            drilling_cycle: self.drilling_cycle,
            condition: self.condition,
            generation_mode: self.settings.generation_mode,
            envelope: self.settings.envelope,
            ramp_mm: self.parts.longest_ramp_mm,
            full_amplitude_share: self.parts.whole_mm / self.length_mm.max(f64::MIN_POSITIVE),
            blended_junctions: if published { 0 } else { self.parts.junctions },
            parts: self.parts.starts,
            published_ends,
            length_mm: self.length_mm,
            travel_mm: 2.0 * amplitude_mm,
            sampling: SamplingReport {
                period_s: self.period_s,
                samples_per_vibration: 1.0 / turns_per_period,
                peak_error: peak_error(turns_per_period),
            },
            axes: self.loads.inside(),
            min_radius_mm: (curvature > 0.0).then(|| 1.0 / curvature),
            contour_deviation_mm: departure.of_mm(reach_mm),
            departure,
            junction_jump_mm: if published { only_off_contour(reach_mm * corner) } else { 0.0 },
            chip: worst.map(|worst| analyse(&worst.cut)),
            feed_override: worst.map(|worst| worst.feed_override),
            at_max_feed_override: permitted,
            chip_spans: spans,
            chip_spans_not_listed: spans_not_listed,
            surface_speed,
            broken_share,
            blend,
            following,
            clamped_share: if total_samples > 0 { clamped_samples as f64 / total_samples as f64 } else { 0.0 },
            largest_amplitude_mm: self.loads.largest_amplitude_mm,
            highest_frequency_hz: self.loads.highest_frequency_hz,
            on_curves: self.loads.on_curves,
            feasible: true,
        };
        Evidence {
            report,
            on_span: self.on_span,
            words: self.words,
            settings: self.settings,
            following_is_stated,
            exceeded: self.loads.exceeded,
            trial: Trial {
                condition: self.condition,
                settings: self.settings,
                period_s: self.period_s,
                max_rev_per_min: self.max_rev_per_min.min(self.max_tool_rev_per_min),
                departure,
                cuts,
                axes: self.loads,
            },
            curve_line: self.sharpest.map(|(_, line)| line),
            junction_line: self.junctions.and_then(|[junctions, _]| junctions.largest).map(|(_, line)| line),
            corner_line: self.parts.corner.map(|(_, line)| line).filter(|_| published),
            chip_line: worst.map(|worst| worst.line),
            stopped_line: self.stopped_line,
            deciding_axes,
            refused: self.refused,
        }
    }
}

/// Keeps the larger value and where it is; 0 is no value.
pub(super) fn raise(largest: &mut Option<(f64, u32)>, value: f64, line: u32) {
    if value > largest.map_or(0.0, |(value, _)| value) {
        *largest = Some((value, line));
    }
}

/// 1 − cos(π·f·Δt), the share of the peak that lies between two samples at most; 1 from f·Δt = ½ on.
fn peak_error(turns_per_period: f64) -> f64 {
    // 1 − cos 2x = 2·sin²x keeps its digits for fine sampling.
    let half = sin_turns(0.25 * turns_per_period.min(0.5));
    2.0 * half * half
}

#[cfg(test)]
mod tests;
