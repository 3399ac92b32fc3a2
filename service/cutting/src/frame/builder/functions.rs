//! The machining functions in the builder: what they are given, where they are switched, closed and ended, what they ask of
//! a cut, and what they report.
//!
//! This is the place, with [`Functions`] and [`FunctionAnalysis`], to which a function is added.

use feedwave_motion::kinematics::FiveAxisMotion;
use feedwave_motion::{
    Curve, Element, LimitExceeded, LimitPieces, Machine, PathLimits, PathMotion, Planner, limit_pieces, top_command,
};
use feedwave_program::{Finding, FindingLog, Function, FunctionCommand, Move, SourceSpan};
use serde::{Deserialize, Serialize};

use super::Builder;
use crate::code;
use crate::frame::config::PipelineConfig;
use crate::frame::interpolator::Barrier;
use crate::frame::report::ValidationReport;
use crate::functions::five_axis::{Guide, GuideInputs};
use crate::functions::path_vibration::{
    GenerationMode, Vibration, VibrationAnalysis, VibrationDemand, VibrationInputs,
};
use crate::functions::thread::{ThreadAnalysis, ThreadInputs, Threads};
use crate::functions::tool_oscillation::{LeftOver, Oscillation, OscillationAnalysis, OscillationInputs};
use crate::shared::checks::{Travel, is_rotary_only};
use crate::shared::cut::Cut;
use crate::shared::reach::Reach;

/// What every function remembers between operations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Functions {
    pub(super) vibration: Vibration,
    pub(super) oscillation: Oscillation,
    pub(super) threads: Threads,
}

/// What every function finds out about a program, gathered while validating only.
#[derive(Clone, Debug, Default)]
pub(crate) struct FunctionAnalysis {
    pub(crate) vibration: VibrationAnalysis,
    pub(crate) oscillation: OscillationAnalysis,
    pub(crate) threads: ThreadAnalysis,
}

/// What of a run's configuration every function is given.
impl PipelineConfig {
    pub(super) fn vibration_inputs(&self) -> VibrationInputs<'_> {
        VibrationInputs {
            settings: self.vibration(),
            machine: &self.profile.machine,
            following: &self.profile.following,
            period_s: self.period_s(),
            max_feed_override: self.profile.max_feed_override,
            has_overrides: !self.overrides.is_empty(),
        }
    }

    pub(super) fn thread_inputs(&self) -> ThreadInputs<'_> {
        ThreadInputs {
            settings: &self.profile.thread_vibration,
            machine: &self.profile.machine,
            travel: self.travel(),
            following: &self.profile.following,
            period_s: self.period_s(),
        }
    }

    pub(super) fn travel(&self) -> Travel<'_> {
        Travel { machine: &self.profile.machine, kinematics: self.profile.kinematics.as_ref() }
    }

    /// The largest feed override that the machine or the plan permits, a ratio of at least 1.
    fn largest_override(&self) -> f64 {
        let planned = self.overrides.iter().map(|change| change.ratio);
        planned.fold(self.profile.max_feed_override, f64::max).max(1.0)
    }

    pub(super) fn guide_inputs(&self) -> GuideInputs {
        GuideInputs {
            pole_tolerance_deg: self.profile.pole_tolerance_deg,
            corner_direction_tolerance_deg: self.profile.corner_direction_tolerance_deg,
        }
    }
}

/// What the functions ask of the axes on an element.
pub(super) struct Superposed {
    /// What superposed offsets leave of the limits.
    left: Option<LeftOver>,
    vibration: Option<VibrationDemand>,
    /// Highest speed that is commanded, mm/s.
    top_speed: f64,
}

impl Superposed {
    /// The machine with the limits that are left.
    pub(super) fn machine<'a>(&'a self, machine: &'a Machine) -> &'a Machine {
        self.left.as_ref().map_or(machine, |left| &left.machine)
    }

    /// How far an oscillation moves the tool from the path, where there is one.
    pub(super) fn reach(&self) -> Option<&Reach> {
        self.left.as_ref().map(|left| &left.reach)
    }

    /// How far the position is ahead of the command and behind it along the path at most, mm.
    pub(super) fn reach_mm(&self) -> f64 {
        self.vibration.as_ref().map_or(0.0, VibrationDemand::offset_along_path_mm)
    }

    /// The limits of the element, in pieces.
    pub(super) fn limit_pieces(&self, element: &Element, machine: &Machine) -> Result<LimitPieces, LimitExceeded> {
        let machine = self.machine(machine);
        let mut pieces = match &self.vibration {
            Some(demand) => demand.limit_pieces(element, machine, self.top_speed),
            // Twice the commanded speed is the most that a feed override asks for.
            None => limit_pieces(element, machine, PathMotion::ZERO, 2.0 * self.top_speed),
        }?;
        if let Some(path) = self.left.as_ref().and_then(|left| left.path) {
            for piece in &mut pieces {
                piece.limits = PathLimits::tightest([piece.limits, path].iter());
            }
        }
        Ok(pieces)
    }

    /// Whether nothing takes a part of the limits of the axes.
    pub(super) const fn has_full_limits(&self) -> bool {
        self.left.is_none() && self.vibration.is_none()
    }

    /// Whether the element is one of a section that vibrates along the path.
    pub(super) const fn is_vibrating(&self) -> bool {
        self.vibration.is_some()
    }
}

impl Builder {
    /// Carries out a block that switches a function. What is open of it ends here.
    pub(super) fn switch(
        &mut self,
        command: &FunctionCommand,
        span: SourceSpan,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        match command.function {
            Function::PathVibration => {
                if !command.on || self.state.functions.vibration.is_on() {
                    self.close_section(planner, findings);
                }
                self.state.functions.vibration.turn(command, span, &config.profile.vibration, findings);
            }
            Function::ToolOscillation => {
                self.close_oscillation(planner, findings);
                self.state.functions.oscillation.turn(command, span, &config.oscillation, findings);
            }
            Function::ThreadVibration => {
                self.close_thread(config, findings);
                self.state.functions.threads.turn(command, span, findings);
            }
            // A stage before the builder.
            Function::Thinning => {}
        }
    }

    /// The program ends: what is open of every function is closed, and what is still on is found.
    pub(super) fn end_functions(
        &mut self,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        self.close_section(planner, findings);
        self.close_thread(config, findings);
        let Functions { vibration, oscillation, threads } = &mut self.state.functions;
        threads.end(findings);
        vibration.end(findings);
        oscillation.end(findings);
    }

    /// Opens a vibrating section at the first cutting block after the vibration was switched on or interrupted, or goes on with it.
    pub(super) fn open_section(&mut self, mv: &Move, config: &PipelineConfig, planner: &mut Planner<Barrier>) {
        let mut analysis = self.analysis.as_mut().map(|analysis| &mut analysis.functions.vibration);
        let inputs = config.vibration_inputs();
        self.state.functions.vibration.open_section(&inputs, analysis.as_deref_mut(), planner);
        let Some(open) = analysis.and_then(VibrationAnalysis::open_mut) else { return };
        let tool = config.tools.iter().find(|listed| listed.number == mv.tool);
        if let Some(max_rev_per_min) = tool.and_then(|tool| tool.max_rev_per_min) {
            open.turns_tool_up_to(max_rev_per_min);
        }
        if let Some(cycle) = mv.cycle {
            open.is_in_cycle(cycle);
        }
    }

    /// Closes the sections of all functions that follow the path: it is interrupted here.
    pub(super) fn close_section(&mut self, planner: &mut Planner<Barrier>, findings: &mut FindingLog) {
        self.close_oscillation(planner, findings);
        let analysis = self.analysis.as_mut().map(|analysis| &mut analysis.functions.vibration);
        self.state.functions.vibration.close_section(analysis, planner);
    }

    /// Closes the oscillating section: the path rests here.
    pub(super) fn close_oscillation(&mut self, planner: &mut Planner<Barrier>, findings: &mut FindingLog) {
        self.state.functions.oscillation.close_section(planner, findings);
    }

    pub(crate) fn close_thread(&mut self, config: &PipelineConfig, findings: &mut FindingLog) {
        let analysis = self.analysis.as_mut().map(|analysis| &mut analysis.functions.threads);
        self.state.functions.threads.close(&config.thread_inputs(), analysis, findings);
    }

    /// Whether what is switched on can act on a cutting element of a move, or a finding.
    pub(super) fn can_act_on(&mut self, element: &Element, span: SourceSpan, findings: &mut FindingLog) -> bool {
        if self.state.functions.vibration.is_on() && is_rotary_only(element) {
            findings.push(no_path(span, "only rotary axes move here: there is no path to vibrate along"));
            self.refuse_block_of_section();
            return false;
        }
        true
    }

    /// The vibrating section in progress has a block that is not run: nothing is said of the vibration on it.
    fn refuse_block_of_section(&mut self) {
        let analysis = self.analysis.as_mut().map(|analysis| &mut analysis.functions.vibration);
        if let Some(open) = analysis.and_then(VibrationAnalysis::open_mut) {
            open.refuses_block();
        }
    }

    /// Whether what is switched on can act on a cut of a guided tool, or a finding.
    pub(super) fn can_act_on_guided(
        &mut self,
        motion: &FiveAxisMotion,
        span: SourceSpan,
        config: &PipelineConfig,
        findings: &mut FindingLog,
    ) -> bool {
        if !self.state.functions.vibration.is_on() {
            return true;
        }
        let rests = |element: &Element| matches!(&element.curve, Curve::FiveAxis(it) if it.tip().length_mm() == 0.0);
        if motion.elements.iter().any(rests) {
            let message = "the tool centre point rests while the tool turns here: there is no path to vibrate along";
            findings.push(no_path(span, message));
            self.refuse_block_of_section();
            return false;
        }
        if config.generation_mode != GenerationMode::AlongPath {
            let message = "under tool centre point control the tool vibrates along the path only: split over the axes it \
                           would leave the path";
            let finding = Finding::new(code::VIB_FIVE_AXIS, span, message);
            findings.push(finding.suggest("choose the generation mode along the path"));
            self.refuse_block_of_section();
            return false;
        }
        true
    }

    /// What the functions ask of the axes on an element; nothing on rapids.
    pub(super) fn superpose(
        &mut self,
        element: &Element,
        cut: &Cut,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) -> Superposed {
        let machine = &config.profile.machine;
        let left = if element.rapid { None } else { self.oscillate(element, cut, config, planner, findings) };
        let top_machine = left.as_ref().map_or(machine, |left| &left.machine);
        let top_speed = top_command(element, cut.feed, &cut.spindle, top_machine);
        let vibration = if element.rapid { None } else { self.vibrate(element, top_speed, config, planner) };
        Superposed { left, vibration, top_speed }
    }

    /// What the oscillation leaves of the axes' limits on an element.
    fn oscillate(
        &mut self,
        element: &Element,
        cut: &Cut,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) -> Option<LeftOver> {
        let inputs = OscillationInputs {
            conditions: &config.profile.tool_oscillation,
            floor: &config.profile.oscillation_floor,
            request: &config.oscillation,
            machine: &config.profile.machine,
            following: &config.profile.following,
            max_feed_override: config.largest_override(),
            tools: &config.tools,
            tool: self.state.tool,
            frame: self.guide.as_ref().map(Guide::tool_frame),
            vibrates: self.state.functions.vibration.is_on(),
        };
        let analysis = self.analysis.as_mut().map(|analysis| &mut analysis.functions.oscillation);
        self.state.functions.oscillation.superpose(element, cut, &inputs, analysis, planner, findings)
    }

    /// What the vibration along the path asks of the axes on an element.
    fn vibrate(
        &mut self,
        element: &Element,
        top_speed: f64,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
    ) -> Option<VibrationDemand> {
        let analysis = self.analysis.as_mut().map(|analysis| &mut analysis.functions.vibration);
        let vibration = &mut self.state.functions.vibration;
        vibration.superpose(element, top_speed, &config.vibration_inputs(), analysis, planner)
    }

    /// Adds what the functions found out about the program to its report, whose summary says whether it is refused.
    pub(crate) fn report_functions(&self, analysis: FunctionAnalysis, report: &mut ValidationReport) {
        let FunctionAnalysis { vibration, oscillation, threads } = analysis;
        let is_accepted = report.is_accepted();
        let summary = &mut report.summary;
        summary.section_count = vibration.sections.count;
        summary.oscillation_count = oscillation.reports.count;
        summary.thread_count = threads.reports.count;
        summary.thread_passes = threads.passes;
        if is_accepted {
            summary.oscillating_cutting_time_s = self.state.functions.oscillation.cutting_time_s();
        }
        report.sections = vibration.sections.first;
        report.oscillations = oscillation.reports.first;
        report.threads = threads.reports.first;
    }
}

fn no_path(span: SourceSpan, message: &str) -> Finding {
    Finding::new(code::VIB_ROTARY_ONLY, span, message).suggest("switch the vibration off for this block")
}
