//! Vibrating sections: the words, where a section and its parts start and end, and what the vibration asks of the axes.
//!
//! A section is divided into parts at the junctions that the vibration cannot go over: in the tangential modes all that are
//! not tangent, where the offset would turn with the path and leave it, and in all modes those at which an axis could not
//! follow. The path rests there.

use feedwave_motion::{Element, Machine, Planner, TANGENT_TOLERANCE_RAD};
use feedwave_program::{AXIS_COUNT, Axis, FindingCode, FindingLog, FunctionCommand, Position, SourceSpan};
use serde::{Deserialize, Serialize};

use super::code;
use super::{
    GenerationMode, SectionAnalyzer, SectionBarrier, SectionPart, SectionStart, VibrationAnalysis, VibrationCondition,
    VibrationDemand, VibrationEnvelope, VibrationSettings, VibrationWordSpans, condition_from_command,
};
use crate::functions::switch::{Modal, Switch};
use crate::shared::following::FollowingModel;

/// What a run of the pipeline gives this function.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VibrationInputs<'a> {
    /// The profile's settings as this run has them.
    pub(crate) settings: VibrationSettings,
    pub(crate) machine: &'a Machine,
    pub(crate) following: &'a FollowingModel,
    pub(crate) period_s: f64,
    /// Largest feed override of the machine.
    pub(crate) max_feed_override: f64,
    /// Whether the run knows of changes of the feed override.
    pub(crate) has_overrides: bool,
}

/// The vibration along the path between operations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Vibration {
    switch: Switch<ActiveVibration>,
}

/// A vibration that was switched on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct ActiveVibration {
    condition: VibrationCondition,
    on_span: SourceSpan,
    words: VibrationWordSpans,
    /// Whether a cutting block has opened a section.
    section_open: bool,
    part: Option<OpenPart>,
}

impl Modal for ActiveVibration {
    const NAME: &'static str = "the vibration";
    const OFF_WITHOUT_ON: FindingCode = code::VIB_OFF_WITHOUT_ON;
    const NESTED: FindingCode = code::VIB_NESTED;
    const UNCLOSED: FindingCode = code::VIB_UNCLOSED;

    fn on_span(&self) -> SourceSpan {
        self.on_span
    }
}

/// A part of the section, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct OpenPart {
    /// Programmed feed at its start, mm/s.
    feed_mm_per_s: f64,
    /// End of its last element.
    end: Side,
}

/// One side of a junction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Side {
    tangent: Position,
    bend: Position,
    /// Length of the element, mm.
    length_mm: f64,
}

/// Parts of what the vibration leaves of acceleration and jerk that a junction may take; the feed leaves a quarter. On a curve
/// a step across the path may take 0.6 of what is left free along it: √((0.6 − u)² + (0.8 + 0.6·u)²) ≤ 1 up to 0.17, and
/// √((0.8 − u)² + (0.6 + u)²) ≤ 1 up to 0.2 for the jerk.
const JUNCTION_ACCELERATION_SHARE: f64 = 0.15;
const JUNCTION_JERK_SHARE: f64 = 0.25;
/// Shares of acceleration and jerk that a curve leaves along the path; the jerk beside its turning.
const ALONG_CURVE: [f64; 2] = [0.6, 0.8];

impl Side {
    fn of(element: &Element, s: f64) -> Self {
        Self { tangent: element.tangent(s), bend: element.second_derivative(s), length_mm: element.length }
    }

    /// |τ₂−τ₁| over the linear axes.
    fn direction_change(&self, next: &Self) -> f64 {
        let linear = (0..AXIS_COUNT).filter(|&index| !Axis::ALL[index].is_rotary());
        let change = linear.map(|index| next.tangent[index] - self.tangent[index]);
        change.map(|change| change * change).sum::<f64>().sqrt()
    }

    /// |Δτ| of every axis.
    fn kinks(&self, next: &Self) -> Position {
        core::array::from_fn(|index| (next.tangent[index] - self.tangent[index]).abs())
    }

    /// Whether every axis can follow a vibration that goes over the junction to `next`.
    ///
    /// Over a junction the axes see a step of velocity V·Δτ and one of acceleration V²·Δp″, with V the speed of feed and
    /// vibration together. Setpoints spread them over the period T, as [`feedwave_motion`]'s planner reckons with for the
    /// feed. Along the tangent also the offset A itself turns: a step of position A·Δτ, and of velocity A·v·Δp″.
    fn is_vibrated_over(
        &self,
        next: &Self,
        demand: &VibrationDemand,
        feed: f64,
        machine: &Machine,
        period_s: f64,
    ) -> bool {
        let peaks = demand.peaks(feed);
        let speed = feed + peaks.velocity;
        let offset_mm = demand.offset_beside_path_mm();
        let length_mm = self.length_mm.min(next.length_mm);
        let per_s = (1.5 * speed / length_mm).max(1.0 / period_s);
        let turns = |side: &Self| side.bend.iter().any(|bend| *bend != 0.0);
        let is_curved = turns(self) || turns(next);
        let weakest = |limit: fn(&feedwave_motion::MachineAxis) -> f64| {
            machine.axes.iter().filter(|axis| !axis.axis.is_rotary()).map(limit).fold(f64::INFINITY, f64::min)
        };
        machine.axes.iter().all(|axis| {
            let index = axis.axis.index();
            let kink = (next.tangent[index] - self.tangent[index]).abs();
            let bend = (next.bend[index] - self.bend[index]).abs();
            if kink == 0.0 && bend == 0.0 {
                return true;
            }
            let along = self.tangent[index].abs().max(next.tangent[index].abs());
            let [acceleration_left, jerk_left] = if is_curved && !axis.axis.is_rotary() {
                let most_bent = self.bend.iter().chain(&next.bend).fold(0.0_f64, |most, bend| most.max(bend.abs()));
                let turning = speed * speed * speed * most_bent * most_bent;
                [
                    ALONG_CURVE[0] * weakest(|axis| axis.max_acceleration_per_s2) - peaks.acceleration,
                    ALONG_CURVE[1] * weakest(|axis| axis.max_jerk_per_s3) - turning - peaks.jerk,
                ]
            } else {
                [axis.max_acceleration_per_s2 - peaks.acceleration * along, axis.max_jerk_per_s3 - peaks.jerk * along]
            };
            let velocity_step = speed * kink + 2.0 * feed * offset_mm * bend;
            let acceleration_step = speed * speed * bend + peaks.acceleration * kink;
            let acceleration = (velocity_step + offset_mm * kink * per_s) * per_s;
            let jerk = (acceleration_step + (velocity_step + 2.0 * offset_mm * kink * per_s) * per_s) * per_s;
            acceleration <= JUNCTION_ACCELERATION_SHARE * acceleration_left && jerk <= JUNCTION_JERK_SHARE * jerk_left
        })
    }
}

impl ActiveVibration {
    /// Whether it goes over the junction from the end of a part to an element that starts like this.
    fn goes_over(&self, part: &OpenPart, start: &Side, feed_mm_per_s: f64, inputs: &VibrationInputs<'_>) -> bool {
        let settings = &inputs.settings;
        let is_tangent = || part.end.direction_change(start) <= TANGENT_TOLERANCE_RAD;
        let along_path = settings.generation_mode == GenerationMode::AlongPath;
        if settings.envelope == VibrationEnvelope::Published {
            return along_path || is_tangent();
        }
        let demand = settings.demand(self.condition, part.feed_mm_per_s);
        let feed = 2.0 * feed_mm_per_s.max(part.feed_mm_per_s);
        (along_path || is_tangent()) && part.end.is_vibrated_over(start, &demand, feed, inputs.machine, inputs.period_s)
    }
}

impl Vibration {
    pub(crate) const fn is_on(&self) -> bool {
        self.switch.is_on()
    }

    /// Where it was switched on.
    pub(crate) fn on_span(&self) -> Option<SourceSpan> {
        self.switch.on().map(Modal::on_span)
    }

    /// Carries out a block that switches it; an open section is closed before.
    pub(crate) fn turn(
        &mut self,
        command: &FunctionCommand,
        span: SourceSpan,
        settings: &VibrationSettings,
        findings: &mut FindingLog,
    ) {
        self.switch.turn(command, span, findings, |findings| {
            let condition = condition_from_command(command, span, settings, findings)?;
            let words = VibrationWordSpans::of(command);
            Some(ActiveVibration { condition, on_span: span, words, section_open: false, part: None })
        });
    }

    /// The program ends.
    pub(crate) fn end(&mut self, findings: &mut FindingLog) {
        self.switch.end(findings);
    }

    /// Opens a part of the section before a cutting element, or goes on with it; what the vibration asks of the axes on it.
    pub(crate) fn superpose<B: From<SectionBarrier>>(
        &mut self,
        element: &Element,
        feed_mm_per_s: f64,
        inputs: &VibrationInputs<'_>,
        analysis: Option<&mut VibrationAnalysis>,
        planner: &mut Planner<B>,
    ) -> Option<VibrationDemand> {
        let vibration = self.switch.on_mut().filter(|vibration| vibration.section_open)?;
        let start = Side::of(element, 0.0);
        let goes_on = vibration.part.is_some_and(|part| vibration.goes_over(&part, &start, feed_mm_per_s, inputs));
        let mut open = analysis.and_then(|analysis| analysis.open.as_mut());
        if let (VibrationEnvelope::Published, Some(open), Some(part)) =
            (inputs.settings.envelope, open.as_mut(), vibration.part)
        {
            open.turns_at_junction(&part.end.kinks(&start));
        }
        if goes_on {
            if let (Some(open), Some(part)) = (&mut open, vibration.part) {
                open.goes_over_junction(part.end.direction_change(&start), element.source.line);
            }
        } else {
            if let Some(part) = vibration.part.take() {
                planner.push_barrier(SectionBarrier::PartEnd.into());
                if let Some(open) = &mut open {
                    open.end_part(part.end.direction_change(&start), element.source.line);
                }
            }
            let ramp_mm = inputs.settings.ramp_mm(vibration.condition, feed_mm_per_s);
            planner.push_barrier(SectionBarrier::PartStart(SectionPart { ramp_mm }).into());
            if let Some(open) = open {
                open.start_part(feed_mm_per_s);
            }
        }
        let part_feed_mm_per_s = vibration.part.map_or(feed_mm_per_s, |part| part.feed_mm_per_s);
        vibration.part = Some(OpenPart { feed_mm_per_s: part_feed_mm_per_s, end: Side::of(element, element.length) });
        Some(inputs.settings.demand(vibration.condition, part_feed_mm_per_s))
    }

    /// Opens a section at the first cutting block after the vibration was switched on or interrupted.
    pub(crate) fn open_section<B: From<SectionBarrier>>(
        &mut self,
        inputs: &VibrationInputs<'_>,
        analysis: Option<&mut VibrationAnalysis>,
        planner: &mut Planner<B>,
    ) {
        let Some(vibration) = self.switch.on_mut().filter(|vibration| !vibration.section_open) else { return };
        vibration.section_open = true;
        let VibrationCondition { frequency_hz, amplitude_mm } = vibration.condition;
        let follows_up_to = inputs.settings.follows_up_to(amplitude_mm);
        planner.push_barrier(SectionBarrier::Start(SectionStart { frequency_hz, amplitude_mm, follows_up_to }).into());
        if let Some(analysis) = analysis {
            let analyzer = SectionAnalyzer::new(
                vibration.condition,
                vibration.on_span,
                &inputs.settings,
                inputs.machine,
                inputs.following,
                inputs.period_s,
            );
            let analyzer = analyzer.with_feed_overrides(inputs.max_feed_override, inputs.has_overrides);
            analysis.open = Some(analyzer.with_word_spans(vibration.words));
        }
    }

    /// Closes the section, where one is open.
    pub(crate) fn close_section<B: From<SectionBarrier>>(
        &mut self,
        analysis: Option<&mut VibrationAnalysis>,
        planner: &mut Planner<B>,
    ) {
        let Some(vibration) = self.switch.on_mut().filter(|vibration| vibration.section_open) else { return };
        vibration.section_open = false;
        vibration.part = None;
        planner.push_barrier(SectionBarrier::End.into());
        if let Some(analysis) = analysis {
            analysis.awaiting.extend(analysis.open.take());
        }
    }
}
