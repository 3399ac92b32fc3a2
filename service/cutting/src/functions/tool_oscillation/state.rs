//! Parts of the path on which a rotary tool oscillates: the words, the section's start and end, what is left of the axes'
//! limits, and the report.

use feedwave_motion::kinematics::ToolFrame;
use feedwave_motion::{Curve, Element, Machine, Planner, TANGENT_TOLERANCE_RAD, top_command};
use feedwave_program::{
    AXIS_COUNT, Axis, Finding, FindingCode, FindingLog, FunctionCommand, Position, Severity, SourceSpan,
};
use serde::{Deserialize, Serialize};

use super::code;
use super::feed_direction::heading;
use super::limits::{GuidedLimits, LeftLimits, LeftOver};
use super::{
    FloorSettings, Judgements, NamedCondition, OscillationBarrier, OscillationRequest, OscillationRun,
    OscillationSectionReport,
};
use crate::functions::switch::{Modal, Switch};
use crate::shared::cut::Cut;
use crate::shared::following::FollowingModel;
use crate::shared::listed::Listed;
use crate::shared::tool::Tool;
use crate::shared::wording::decimal;

/// Reports kept in full; further ones are counted.
const MAX_REPORTS: usize = 1_000;
/// Most numbers in the reports that are listed, about ten bytes each in a stored report: those of tools with many edges are
/// long.
const MAX_REPORT_NUMBERS: usize = 800_000;

/// What a run of the pipeline, and the program's other states, give this function.
#[derive(Clone, Debug)]
pub(crate) struct OscillationInputs<'a> {
    pub(crate) conditions: &'a [NamedCondition],
    pub(crate) floor: &'a FloorSettings,
    pub(crate) request: &'a OscillationRequest,
    pub(crate) machine: &'a Machine,
    pub(crate) following: &'a FollowingModel,
    /// Largest feed override that is permitted, a ratio.
    pub(crate) max_feed_override: f64,
    pub(crate) tools: &'a [Tool],
    /// Number of the tool in the spindle.
    pub(crate) tool: u32,
    /// The frame of the tool on a machine with kinematics.
    pub(crate) frame: Option<ToolFrame>,
    /// Whether another function vibrates along the path.
    pub(crate) vibrates: bool,
}

/// The oscillation between operations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Oscillation {
    switch: Switch<Box<ActiveOscillation>>,
    /// Cutting time with an oscillating tool so far, at the programmed feed, s.
    cutting_time_s: f64,
}

/// Reports on the oscillations of a program, gathered while validating only.
#[derive(Clone, Debug, Default)]
pub(crate) struct OscillationAnalysis {
    judgements: Judgements,
    pub(crate) reports: Listed<OscillationSectionReport>,
}

/// An oscillation that was switched on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ActiveOscillation {
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
    /// For which inclinations of the path, a bit for each of [`super::inclination::Slope::step`].
    pub(super) judged_slopes: u64,
    /// Whether the condition depends on feed and speed.
    pub(super) has_tables: bool,
    /// What the generator gets, and what the axes have left.
    pub(super) run: Option<Box<OscillationRun>>,
    pub(super) left: Option<LeftLimits>,
    /// What they have left on the present element of a guided tool, or on one that climbs or descends.
    pub(super) guided_left: Option<GuidedLimits>,
    /// Whether that is what counts on the present element.
    pub(super) by_shares: bool,
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

impl Modal for Box<ActiveOscillation> {
    const NAME: &'static str = "the oscillation";
    const OFF_WITHOUT_ON: FindingCode = code::OSC_OFF_WITHOUT_ON;
    const NESTED: FindingCode = code::OSC_NESTED;
    const UNCLOSED: FindingCode = code::OSC_UNCLOSED;

    fn on_span(&self) -> SourceSpan {
        self.on_span
    }
}

impl ActiveOscillation {
    /// The words that switch it on. What cannot be used is a finding, and nothing oscillates.
    fn read(
        command: &FunctionCommand,
        span: SourceSpan,
        request: &OscillationRequest,
        cutting_time_before_s: f64,
        findings: &mut FindingLog,
    ) -> Self {
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
        let number = whole('P', "number of the condition", request.condition.is_none());
        let leading_edge = whole('L', "leading edge", false);
        let length = |letter| command.word(letter).map(|word| word.value);
        Self {
            on_span: span,
            number,
            feed_amplitude_mm: length('A'),
            axial_amplitude_mm: length('Q'),
            depth_mm: length('D'),
            leading_edge,
            cutting_time_before_s,
            refused,
            judged: None,
            judged_slopes: 0,
            has_tables: false,
            run: None,
            left: None,
            guided_left: None,
            by_shares: false,
            open: None,
        }
    }

    /// Opens a section before a cutting element, or goes on with it.
    fn enter<B: From<OscillationBarrier>>(
        &mut self,
        element: &Element,
        frame: Option<ToolFrame>,
        planner: &mut Planner<B>,
    ) -> Option<LeftOver> {
        let run = self.run.as_ref()?;
        let left = match element.curve {
            _ if self.by_shares => {
                let guided = matches!(element.curve, Curve::FiveAxis(_));
                self.guided_left.as_ref()?.left_over(run, guided)
            }
            Curve::Line => LeftOver::of_machine(&self.left.as_ref()?.straight, run),
            _ => LeftOver::of_machine(&self.left.as_ref()?.curved, run),
        };
        if self.open.is_none() {
            let run = Box::new(OscillationRun { frame, ..(**run).clone() });
            planner.push_barrier(OscillationBarrier::Start(run).into());
        }
        self.open = Some(OpenSection {
            line: self.open.map_or(element.source.line, |open| open.line),
            length_mm: self.open.map_or(0.0, |open| open.length_mm) + element.length,
            direction: heading(frame.as_ref(), element, element.length),
            ramp_mm: run.ramp_mm,
            judged: self.judged,
        });
        Some(left)
    }
}

impl Oscillation {
    /// Whether it is switched on.
    pub(crate) const fn is_on(&self) -> bool {
        self.switch.is_on()
    }

    /// Cutting time with an oscillating tool so far, at the programmed feed, s.
    pub(crate) const fn cutting_time_s(&self) -> f64 {
        self.cutting_time_s
    }

    /// Carries out a block that switches it; an open section is closed before.
    pub(crate) fn turn(
        &mut self,
        command: &FunctionCommand,
        span: SourceSpan,
        request: &OscillationRequest,
        findings: &mut FindingLog,
    ) {
        let before_s = self.cutting_time_s;
        self.switch.turn(command, span, findings, |findings| {
            Some(Box::new(ActiveOscillation::read(command, span, request, before_s, findings)))
        });
    }

    /// The program ends.
    pub(crate) fn end(&mut self, findings: &mut FindingLog) {
        self.switch.end(findings);
    }

    /// Closes the section, where one is open.
    pub(crate) fn close_section<B: From<OscillationBarrier>>(
        &mut self,
        planner: &mut Planner<B>,
        findings: &mut FindingLog,
    ) {
        let Some(active) = self.switch.on_mut() else { return };
        let Some(OpenSection { line, length_mm, ramp_mm, .. }) = active.open.take() else { return };
        planner.push_barrier(OscillationBarrier::End.into());
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
    pub(crate) fn superpose<B: From<OscillationBarrier>>(
        &mut self,
        element: &Element,
        cut: &Cut,
        inputs: &OscillationInputs<'_>,
        analysis: Option<&mut OscillationAnalysis>,
        planner: &mut Planner<B>,
        findings: &mut FindingLog,
    ) -> Option<LeftOver> {
        let open = self.switch.on()?.open;
        if open.is_some_and(|open| open.turns_sharply(element, inputs.frame.as_ref())) {
            // The offsets turn with the path: they have to be 0 where it turns at once.
            self.close_section(planner, findings);
        }
        let active = self.switch.on_mut().filter(|active| !active.refused)?;
        active.judge_element(element, cut, inputs, analysis, findings);
        if active.refused {
            return None;
        }
        if active.open.is_some_and(|open| open.judged != active.judged) {
            // Another oscillation from here on.
            self.close_section(planner, findings);
        }
        let left = self.switch.on_mut()?.enter(element, inputs.frame, planner)?;
        let feed_mm_per_s = top_command(element, cut.feed, &cut.spindle, inputs.machine);
        self.cutting_time_s += element.length / feed_mm_per_s;
        Some(left)
    }
}

impl OpenSection {
    /// Whether the path turns at once where an element goes on.
    fn turns_sharply(&self, element: &Element, frame: Option<&ToolFrame>) -> bool {
        let (before, after) = (self.direction, heading(frame, element, 0.0));
        let linear = (0..AXIS_COUNT).filter(|&index| !Axis::ALL[index].is_rotary());
        let square: f64 = linear.map(|index| (after[index] - before[index]) * (after[index] - before[index])).sum();
        square.sqrt() > TANGENT_TOLERANCE_RAD
    }
}

impl ActiveOscillation {
    /// Judges an element before it is cut, and refuses what cannot oscillate.
    fn judge_element(
        &mut self,
        element: &Element,
        cut: &Cut,
        inputs: &OscillationInputs<'_>,
        analysis: Option<&mut OscillationAnalysis>,
        findings: &mut FindingLog,
    ) {
        let mut found = Vec::new();
        let (judgements, reports) = match analysis {
            Some(analysis) => (Some(&mut analysis.judgements), Some(&mut analysis.reports)),
            None => (None, None),
        };
        let report = self.prepare(element, cut, inputs, judgements, &mut found);
        self.refused = found.iter().any(|finding| finding.severity == Severity::Error);
        for finding in found {
            // What is found at the switch was found because of this element.
            let is_of_switch = finding.span == self.on_span;
            findings.push(if is_of_switch { finding.at("line", element.source.line.into()) } else { finding });
        }
        if let (Some(reports), Some(report)) = (reports, report) {
            let numbers = report.report.numbers();
            reports.push_of_size(report, numbers, MAX_REPORTS, MAX_REPORT_NUMBERS);
        }
    }
}
