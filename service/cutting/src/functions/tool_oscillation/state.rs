//! Parts of the path on which a rotary tool oscillates: the words, the section's start and end, what is left of the axes'
//! limits, and the report.

use std::sync::Arc;

use feedwave_motion::{Curve, Element, Machine, Planner, TANGENT_TOLERANCE_RAD, top_command};
use feedwave_program::{AXIS_COUNT, Axis, Finding, FindingLog, FunctionCommand, Position, Severity, SourceSpan};
use serde::{Deserialize, Serialize};

use super::OscillationRun;
use super::judgement::heading;
use super::limits::LeftLimits;
use crate::PipelineConfig;
use crate::code;
use crate::frame::builder::{Builder, MAX_SECTION_REPORTS};
use crate::frame::interpolator::Barrier;
use crate::functions::five_axis::Guide;
use crate::shared::cut::Cut;
use crate::shared::wording::decimal;

/// An oscillation that was switched on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ActiveOscillation {
    pub(super) on_span: SourceSpan,
    /// Number of the condition; none where the program leaves it to the job.
    pub(super) number: Option<u32>,
    pub(super) feed_amplitude_mm: Option<f64>,
    pub(super) axial_amplitude_mm: Option<f64>,
    pub(super) depth_mm: Option<f64>,
    pub(super) leading_edge: Option<u32>,
    /// Oscillating cutting time of the program before it was switched on, s.
    pub(super) cutting_time_before_s: f64,
    /// Whether it cannot run; that was reported.
    pub(super) refused: bool,
    /// What it was judged at last: tool, feed (mm/min), spindle speed (rev/min, negative counter-clockwise).
    pub(super) judged: Option<(u32, f64, f64)>,
    /// Whether the condition depends on feed and speed.
    pub(super) has_tables: bool,
    /// What the generator gets, and what the axes have left.
    pub(super) run: Option<Box<OscillationRun>>,
    pub(super) left: Option<LeftLimits>,
    open: Option<OpenSection>,
}

/// A section that the path is in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct OpenSection {
    /// Line of its first element.
    line: u32,
    /// Its length so far, mm.
    length_mm: f64,
    /// Direction at its end.
    direction: Position,
    /// Length over which the oscillation is blended in and out, mm.
    ramp_mm: f64,
    /// What it was opened for; see [`ActiveOscillation::judged`].
    judged: Option<(u32, f64, f64)>,
}

impl Builder {
    pub(crate) fn switch_oscillation(
        &mut self,
        command: &FunctionCommand,
        span: SourceSpan,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        self.close_oscillation(planner, findings);
        let active = self.state.oscillation.take();
        if !command.on {
            if active.is_none() {
                let message = "the oscillation is switched off but was not on";
                let finding = Finding::new(code::OSC_OFF_WITHOUT_ON, span, message);
                findings.push(finding.suggest("remove the block, or switch the oscillation on before it"));
            }
            return;
        }
        if let Some(active) = active {
            let line = active.on_span.line;
            let message = format!("the oscillation is on already, since line {line}");
            findings.push(
                Finding::new(code::OSC_NESTED, span, message)
                    .with_value("on_line", f64::from(line), "")
                    .suggest("switch it off before it is switched on with other values"),
            );
        }
        let mut refused = false;
        let mut whole = |letter: char, name: &'static str, needed: bool| {
            let word = command.word(letter);
            let value = word.map(|word| word.value).filter(|value| value.fract() == 0.0 && (0.0..=1e6).contains(value));
            if value.is_none() && (needed || word.is_some()) {
                let place = word.map_or(span, |word| word.span);
                let message = format!("the {name} of the oscillation ({letter} word) is missing or not a whole number");
                let finding = Finding::new(code::OSC_WORD, place, message);
                findings.push(finding.suggest(format!("write the {name}, such as {letter}1")));
                refused = true;
            }
            value.map(|value| value as u32)
        };
        let number = whole('P', "number of the condition", config.oscillation.condition.is_none());
        let leading_edge = whole('L', "leading edge", false);
        let length = |letter| command.word(letter).map(|word| word.value);
        self.state.oscillation = Some(Box::new(ActiveOscillation {
            on_span: span,
            number,
            feed_amplitude_mm: length('A'),
            axial_amplitude_mm: length('Q'),
            depth_mm: length('D'),
            leading_edge,
            cutting_time_before_s: self.state.oscillating_cutting_time_s,
            refused,
            judged: None,
            has_tables: false,
            run: None,
            left: None,
            open: None,
        }));
    }

    /// The end of the program.
    pub(crate) fn end_oscillation(&mut self, findings: &mut FindingLog) {
        if let Some(active) = self.state.oscillation.take() {
            let message = "the program ends while the oscillation switched on here is still on";
            let finding = Finding::new(code::OSC_UNCLOSED, active.on_span, message);
            findings.push(finding.suggest("switch the oscillation off before the end of the program"));
        }
    }

    pub(crate) fn close_oscillation(&mut self, planner: &mut Planner<Barrier>, findings: &mut FindingLog) {
        let Some(active) = &mut self.state.oscillation else { return };
        let Some(OpenSection { line, length_mm, ramp_mm, .. }) = active.open.take() else { return };
        planner.push_barrier(Barrier::OscillationEnd);
        let needed_mm = 2.0 * ramp_mm;
        if length_mm < needed_mm {
            let message = format!(
                "a part of the path without corners is {} mm long, shorter than the {} mm over which the oscillation is \
                 blended in and out",
                decimal(length_mm, 4),
                decimal(needed_mm, 4)
            );
            findings.push(
                Finding::new(code::OSC_SECTION_SHORT, active.on_span, message)
                    .at("line", line.into())
                    .ranked("", needed_mm - length_mm)
                    .with_value("length", length_mm, "mm")
                    .with_value("ramps", needed_mm, "mm")
                    .suggest("round corners with G64, or blend over fewer periods"),
            );
        }
    }

    /// Opens a section before a cutting element, or goes on with it; what the axes have left for the element.
    pub(crate) fn oscillate(
        &mut self,
        element: &Element,
        cut: &Cut,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) -> Option<Arc<Machine>> {
        let rotary = self.guide.as_ref().and_then(Guide::under_fixed_spindle);
        let turns_sharply = self.state.oscillation.as_ref().and_then(|active| active.open).is_some_and(|open| {
            let (before, after) = (open.direction, heading(rotary.as_ref(), element, 0.0));
            let linear = (0..AXIS_COUNT).filter(|&index| !Axis::ALL[index].is_rotary());
            let square: f64 = linear.map(|index| (after[index] - before[index]) * (after[index] - before[index])).sum();
            square.sqrt() > TANGENT_TOLERANCE_RAD
        });
        if turns_sharply {
            // The offsets turn with the path: they have to be 0 where it turns at once.
            self.close_oscillation(planner, findings);
        }
        let tool = self.state.tool;
        let vibrates = self.state.vibration.is_some();
        let active = self.state.oscillation.as_mut().filter(|active| !active.refused)?;
        let mut found = Vec::new();
        let judgements = self.analysis.as_mut().map(|analysis| &mut analysis.judgements);
        let report = active.prepare(element, cut, tool, rotary.as_ref(), vibrates, config, judgements, &mut found);
        active.refused = found.iter().any(|finding| finding.severity == Severity::Error);
        for finding in found {
            // What is found at the switch was found because of this element.
            let is_of_switch = finding.span == active.on_span;
            findings.push(if is_of_switch { finding.at("line", element.source.line.into()) } else { finding });
        }
        if let (Some(analysis), Some(report)) = (&mut self.analysis, report) {
            analysis.oscillation_count += 1;
            if analysis.oscillations.len() < MAX_SECTION_REPORTS {
                analysis.oscillations.push(report);
            }
        }
        if active.refused {
            return None;
        }
        if active.open.is_some_and(|open| open.judged != active.judged) {
            // Another oscillation from here on.
            self.close_oscillation(planner, findings);
        }
        let active = self.state.oscillation.as_mut()?;
        let (run, left) = (active.run.as_ref()?, active.left.as_ref()?);
        if active.open.is_none() {
            planner.push_barrier(Barrier::OscillationStart(Box::new(OscillationRun { rotary, ..(**run).clone() })));
        }
        active.open = Some(OpenSection {
            line: active.open.map_or(element.source.line, |open| open.line),
            length_mm: active.open.map_or(0.0, |open| open.length_mm) + element.length,
            direction: heading(rotary.as_ref(), element, element.length),
            ramp_mm: run.ramp_mm,
            judged: active.judged,
        });
        let feed_mm_per_s = top_command(element, cut.feed, &cut.spindle, &config.profile.machine);
        self.state.oscillating_cutting_time_s += element.length / feed_mm_per_s;
        Some(Arc::clone(if element.curve == Curve::Line { &left.straight } else { &left.curved }))
    }
}
