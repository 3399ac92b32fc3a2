//! Vibrating sections: the words, where a section and its parts start and end, and what the vibration asks of the axes.
//!
//! A section is divided into parts at the junctions that the vibration cannot go over: in the tangential modes all that are
//! not tangent, where the offset would turn with the path and leave it, and in all modes those at which an axis could not
//! follow. The path rests there.

use feedwave_motion::{Element, Machine, Planner, TANGENT_TOLERANCE_RAD};
use feedwave_program::{AXIS_COUNT, Axis, Finding, FindingLog, FunctionCommand, Position, SourceSpan};
use serde::{Deserialize, Serialize};

use crate::code;
use crate::frame::builder::Builder;
use crate::frame::interpolator::{Barrier, SectionPart, SectionStart};
use crate::{
    GenerationMode, PipelineConfig, SectionAnalyzer, VibrationCondition, VibrationDemand, VibrationEnvelope,
    VibrationWordSpans, condition_from_command,
};

/// A vibration that was switched on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ActiveVibration {
    pub(crate) condition: VibrationCondition,
    pub(crate) on_span: SourceSpan,
    pub(crate) words: VibrationWordSpans,
    /// Whether a cutting block has opened a section.
    pub(crate) section_open: bool,
    pub(crate) part: Option<OpenPart>,
}

/// A part of the section, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct OpenPart {
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

impl Builder {
    /// Opens a part of the section before a cutting element, or goes on with it; what the vibration asks of the axes on it.
    pub(crate) fn vibrate(
        &mut self,
        element: &Element,
        feed_mm_per_s: f64,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
    ) -> Option<VibrationDemand> {
        let vibration = self.state.vibration.as_mut().filter(|vibration| vibration.section_open)?;
        let settings = config.vibration();
        let start = Side::of(element, 0.0);
        let goes_over = |part: &OpenPart| {
            let is_tangent = || part.end.direction_change(&start) <= TANGENT_TOLERANCE_RAD;
            let along_path = settings.generation_mode == GenerationMode::AlongPath;
            if settings.envelope == VibrationEnvelope::Published {
                return along_path || is_tangent();
            }
            let demand = settings.demand(vibration.condition, part.feed_mm_per_s);
            let feed = 2.0 * feed_mm_per_s.max(part.feed_mm_per_s);
            let (machine, period_s) = (&config.profile.machine, config.period_s());
            (along_path || is_tangent()) && part.end.is_vibrated_over(&start, &demand, feed, machine, period_s)
        };
        let goes_on = vibration.part.as_ref().is_some_and(goes_over);
        if !goes_on {
            if let Some(part) = vibration.part.take() {
                planner.push_barrier(Barrier::PartEnd);
                if let Some(open) = self.analysis.as_mut().and_then(|analysis| analysis.open.as_mut()) {
                    open.end_part(part.end.direction_change(&start), element.source.line);
                }
            }
            let ramp_mm = settings.ramp_mm(vibration.condition, feed_mm_per_s);
            planner.push_barrier(Barrier::PartStart(SectionPart { ramp_mm }));
            if let Some(open) = self.analysis.as_mut().and_then(|analysis| analysis.open.as_mut()) {
                open.start_part(feed_mm_per_s);
            }
        }
        let part_feed_mm_per_s = vibration.part.map_or(feed_mm_per_s, |part| part.feed_mm_per_s);
        vibration.part = Some(OpenPart { feed_mm_per_s: part_feed_mm_per_s, end: Side::of(element, element.length) });
        Some(settings.demand(vibration.condition, part_feed_mm_per_s))
    }

    pub(crate) fn switch_vibration(
        &mut self,
        command: &FunctionCommand,
        span: SourceSpan,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        if !command.on {
            self.close_section(planner, findings);
            let was_unusable = std::mem::take(&mut self.state.unusable_vibration);
            if self.state.vibration.take().is_none() && !was_unusable {
                findings.push(
                    Finding::new(code::VIB_OFF_WITHOUT_ON, span, "vibration is switched off but was not on")
                        .suggest("remove the block, or switch the vibration on before it"),
                );
            }
            return;
        }
        if let Some(active) = self.state.vibration {
            let line = active.on_span.line;
            findings.push(
                Finding::new(code::VIB_NESTED, span, format!("vibration is on already, since line {line}"))
                    .with_value("on_line", f64::from(line), "")
                    .suggest("switch the vibration off before it is switched on with other values"),
            );
            self.close_section(planner, findings);
        }
        let condition = condition_from_command(command, span, &config.profile.vibration, findings);
        self.state.unusable_vibration = condition.is_none();
        let words = VibrationWordSpans::of(command);
        self.state.vibration = condition.map(|condition| ActiveVibration {
            condition,
            on_span: span,
            words,
            section_open: false,
            part: None,
        });
    }

    /// Opens a section at the first cutting block after the vibration was switched on or interrupted.
    pub(crate) fn open_section(&mut self, config: &PipelineConfig, planner: &mut Planner<Barrier>) {
        let Some(vibration) = &mut self.state.vibration else { return };
        if vibration.section_open {
            return;
        }
        vibration.section_open = true;
        let VibrationCondition { frequency_hz, amplitude_mm } = vibration.condition;
        let follows_up_to = config.profile.vibration.follows_up_to(amplitude_mm);
        planner.push_barrier(Barrier::SectionStart(SectionStart { frequency_hz, amplitude_mm, follows_up_to }));
        if let Some(analysis) = &mut self.analysis {
            let profile = &config.profile;
            let period_s = config.period_s();
            let analyzer = SectionAnalyzer::new(
                vibration.condition,
                vibration.on_span,
                &config.vibration(),
                &profile.machine,
                &profile.following,
                period_s,
            );
            let changes = !config.overrides.is_empty();
            let analyzer = analyzer.with_feed_overrides(profile.max_feed_override, changes);
            analysis.open = Some(analyzer.with_word_spans(vibration.words));
        }
    }

    pub(crate) fn close_section(&mut self, planner: &mut Planner<Barrier>, findings: &mut FindingLog) {
        self.close_oscillation(planner, findings);
        let Some(vibration) = &mut self.state.vibration else { return };
        if !vibration.section_open {
            return;
        }
        vibration.section_open = false;
        vibration.part = None;
        planner.push_barrier(Barrier::SectionEnd);
        if let Some(analysis) = &mut self.analysis {
            analysis.awaiting.extend(analysis.open.take());
        }
    }
}
