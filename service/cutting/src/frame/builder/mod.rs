//! From operations to planner input: elements with their limits, speeds and barriers, and what is found
//! about them.

mod checks;
mod functions;
mod guided;
mod threads;

use std::collections::BTreeSet;

use feedwave_motion::{
    Deviation, Element, Joining, LimitExceeded, Machine, MachineAxis, MotionRequest, PathLimits, PathSmoother, Planner,
    Smoothed, TooManyWithinReach, missing_axis, stretches,
};
use feedwave_program::{
    Axis, DwellTime, Finding, FindingLog, MachineCommand, MachineEffect, Move, MoveKind, Operation, OperationKind,
    PathControl, Position, SourceSpan, Spindle, ThreadKind,
};
use serde::{Deserialize, Serialize};

pub(crate) use self::checks::blocks_too_short;
pub(crate) use self::functions::FunctionAnalysis;
use self::functions::Functions;
use crate::code;
use crate::frame::config::PipelineConfig;
use crate::frame::interpolator::Barrier;
use crate::frame::report::PathDeviation;
use crate::functions::five_axis::{Ahead, Chosen, Guide, GuideState};
use crate::functions::thread::WantedPass;
use crate::shared::checks::{MAX_BLOCK_DURATION_S, may_be_drawn, missing, spline_cusp, too_long};
use crate::shared::columns::ColumnMap;
use crate::shared::cut::Cut;
use crate::shared::setpoint::Frame;

const X: usize = Axis::X.index();

/// Modal state between operations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct BuilderState {
    functions: Functions,
    /// Tool in the spindle, 0 before the first.
    tool: u32,
    spindle: Spindle,
    smoother: PathSmoother<Cut>,
    guide: GuideState,
    /// X on the radius where the last move ended, and the work offset that it is counted from, mm.
    x_mm: [f64; 2],
    feed_limited_reported: bool,
    speed_limit_reported: bool,
    /// Where the program has forbidden feed overrides, until a cut behind it was found.
    override_forbidden: Option<SourceSpan>,
}

/// Figures and section reports of a whole program; gathered while validating only.
#[derive(Clone, Debug, Default)]
pub(crate) struct Analysis {
    pub(crate) functions: FunctionAnalysis,
    pub(crate) moves: u64,
    pub(crate) cutting_moves: u64,
    pub(crate) path_length_mm: f64,
    pub(crate) cutting_length_mm: f64,
    pub(crate) tools: BTreeSet<u32>,
    pub(crate) spindle_rev_per_min: Option<[f64; 2]>,
    pub(crate) deviation: Option<PathDeviation>,
}

impl Analysis {
    /// An element is run that is so far from the programmed path.
    fn deviates(&mut self, element: &Element, deviation: Deviation, machine: &Machine) {
        let Deviation { largest_mm, at_mm } = deviation;
        if largest_mm <= self.deviation.as_ref().map_or(0.0, |known| known.largest_mm) {
            return;
        }
        let position = element.position(at_mm);
        let axes = machine.axes.iter().zip(ColumnMap::of(machine, Frame::Machine));
        let place = |(axis, column): (&MachineAxis, ColumnMap)| {
            (axis.name.clone(), column.value(position[axis.axis.index()], &element.work_offset))
        };
        self.deviation = Some(PathDeviation { largest_mm, source: element.source, axes: axes.map(place).collect() });
    }

    /// The spindle turns at this speed while cutting, rev/min.
    fn turns_at(&mut self, rev_per_min: f64) {
        let [least, most] = self.spindle_rev_per_min.get_or_insert([rev_per_min; 2]);
        *least = least.min(rev_per_min);
        *most = most.max(rev_per_min);
    }
}

/// Turns operations into planner input.
#[derive(Clone, Debug)]
pub(crate) struct Builder {
    pub(crate) state: BuilderState,
    pub(crate) analysis: Option<Analysis>,
    /// A pass whose path is requested.
    pub(crate) wanted_pass: Option<WantedPass>,
    /// From the tool to the axes, on machines that have kinematics.
    guide: Option<Guide>,
    /// The inverse solution for the next operation, where it was looked ahead for.
    pub(crate) chosen: Option<Chosen>,
    /// Elements between the smoother and the planner; empty between operations.
    smoothed: Vec<Smoothed<Cut>>,
}

/// How corners are passed. What is superposed is shaped by the programmed blocks and their corners.
fn joining<'a>(functions: &Functions, guide: Option<&'a Guide>, config: &'a PipelineConfig) -> Joining<'a> {
    Joining {
        machine: &config.profile.machine,
        many_blocks: !functions.vibration.is_on() && !functions.oscillation.is_on(),
        corner_speed: config.profile.corner_speed(),
        corners: guide.map(|guide| guide.corners(&config.guide_inputs())),
    }
}

impl BuilderState {
    /// The state at the start of a program, with the axes at this machine position.
    pub(crate) fn at(position: Position) -> Self {
        Self {
            guide: GuideState::at(position),
            functions: Functions::default(),
            tool: 0,
            spindle: Spindle::STOPPED,
            smoother: PathSmoother::default(),
            x_mm: [position[X], 0.0],
            feed_limited_reported: false,
            speed_limit_reported: false,
            override_forbidden: None,
        }
    }
}

impl Builder {
    pub(crate) fn new(state: BuilderState, analysis: Option<Analysis>, guide: Option<Guide>) -> Self {
        Self { state, analysis, wanted_pass: None, guide, chosen: None, smoothed: Vec::new() }
    }

    /// A builder in the same state for times alone: it analyses nothing, looks nowhere ahead, and its rotary axes never run
    /// out.
    pub(crate) fn beside(&self) -> Self {
        Self::new(self.state.clone(), None, self.guide.as_ref().map(Guide::without_ranges))
    }

    /// See [`crate::Pipeline::next_thread_pass`].
    pub(crate) fn next_thread_pass(&self) -> (u64, usize) {
        self.state.functions.threads.next_pass()
    }

    /// Whether the spindle speed may change before an operation that follows a cut or not: nothing that depends on it is in
    /// progress, or would be cut at two speeds.
    pub(crate) fn may_turn_otherwise_before(&self, operation: &Operation, follows_cut: bool) -> bool {
        let Functions { vibration, oscillation, threads } = &self.state.functions;
        let begins_section = || !follows_cut && (vibration.is_on() || oscillation.is_on());
        let turns = self.state.spindle.is_turning();
        turns
            && match &operation.kind {
                OperationKind::Move(mv) => mv.kind == MoveKind::Cutting && begins_section(),
                OperationKind::Guided(guided) => guided.step.kind == MoveKind::Cutting && begins_section(),
                // All passes of a thread, and both strokes of a tap, are cut at one speed.
                OperationKind::Thread(mv) => mv.kind == ThreadKind::Turned && threads.would_begin(mv, operation.span),
                OperationKind::Function(command) => !command.on,
                OperationKind::Tool { .. } => true,
                OperationKind::Stop { .. } => !threads.is_open(),
                _ => false,
            }
    }

    /// Has the path rest on the grid, with everything closed that is in progress.
    pub(crate) fn rest_between(
        &mut self,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        self.flush(config, planner, findings);
        if self.state.functions.threads.is_waiting() {
            self.flush_threads(config, planner, findings);
        }
        self.close_section(planner, findings);
        planner.push_barrier(Barrier::Align);
    }

    /// The spindle turns like this from here on.
    pub(crate) fn turn_spindle(&mut self, spindle: Spindle, planner: &mut Planner<Barrier>) {
        self.state.spindle = spindle;
        planner.push_barrier(Barrier::Spindle(spindle));
    }

    /// What to look ahead for before an operation; nothing for most.
    pub(crate) fn ahead(&self, operation: &Operation, config: &PipelineConfig) -> Option<Ahead> {
        let OperationKind::Guided(guided) = &operation.kind else { return None };
        self.guide.as_ref()?.ahead(guided, operation.span.line, &self.state.guide, &config.guide_inputs())
    }

    /// Plans what path smoothing holds back.
    pub(crate) fn flush(&mut self, config: &PipelineConfig, planner: &mut Planner<Barrier>, findings: &mut FindingLog) {
        let joining = joining(&self.state.functions, self.guide.as_ref(), config);
        self.state.smoother.flush(joining, &mut |smoothed| self.smoothed.push(smoothed));
        self.run_smoothed(config, planner, findings);
    }

    /// Handles one operation.
    pub(crate) fn operation(
        &mut self,
        operation: &Operation,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        let kind = match &operation.kind {
            OperationKind::Move(mv) => mv.kind,
            OperationKind::Guided(guided) => guided.step.kind,
            _ => MoveKind::Rapid,
        };
        if kind != MoveKind::Cutting {
            // Everything but another cut happens on the programmed point, and in the section that it belongs to.
            self.flush(config, planner, findings);
        }
        let is_thread = matches!(&operation.kind, OperationKind::Thread(mv) if mv.kind == ThreadKind::Turned);
        if !is_thread {
            let moves =
                matches!(operation.kind, OperationKind::Move(_) | OperationKind::Guided(_) | OperationKind::Thread(_));
            self.state.functions.threads.interrupt(operation.span, moves);
        }
        if self.state.functions.threads.is_waiting() && !matches!(operation.kind, OperationKind::Thread(_)) {
            // A pass goes on only in the very next block.
            self.flush_threads(config, planner, findings);
        }
        let (span, line) = (operation.span, operation.span.line);
        match &operation.kind {
            OperationKind::Move(mv) if self.holds_rapid(mv, span, config) => {}
            OperationKind::Move(mv) => self.motion(mv, span, config, planner, findings),
            OperationKind::Thread(mv) => {
                self.close_section(planner, findings);
                self.thread(mv, span, config, planner, findings);
            }
            OperationKind::Guided(guided) => self.guided(guided, span, config, planner, findings),
            OperationKind::Dwell { time, work_offset } => {
                self.dwell(*time, Some(work_offset[X]), span, config, planner, findings);
            }
            OperationKind::Spindle(spindle) => {
                if !spindle.is_turning() {
                    self.close_section(planner, findings);
                }
                // The path rests here: the oscillation is blended out before.
                self.close_oscillation(planner, findings);
                self.state.spindle = *spindle;
                planner.push_barrier(Barrier::Spindle(*spindle));
            }
            &OperationKind::Tool { number, .. } => {
                self.close_section(planner, findings);
                self.state.tool = number;
                self.tool(number, span, config, findings);
                planner.push_barrier(Barrier::Dwell { duration_s: 0.0, line, x_offset_mm: None });
            }
            // Compensation is carried out before.
            OperationKind::Coolant(_) | OperationKind::Compensation(_) => {}
            OperationKind::Function(command) => self.switch(command, span, config, planner, findings),
            OperationKind::MachineCode(command) => self.machine_code(command, span, config, planner, findings),
            OperationKind::Stop { .. } => self.rest(line, planner, findings),
            OperationKind::End => {
                self.end_functions(config, planner, findings);
                planner.push_barrier(Barrier::End);
                planner.finish();
            }
        }
    }

    /// What an M code of the machine does to the path.
    fn machine_code(
        &mut self,
        command: &MachineCommand,
        span: SourceSpan,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        self.switch_override(command, span, config);
        match command.effect {
            MachineEffect::None => {}
            MachineEffect::Stop | MachineEffect::Barrier => self.rest(span.line, planner, findings),
            MachineEffect::Dwell { seconds } => {
                self.dwell(DwellTime::Seconds(seconds), None, span, config, planner, findings);
            }
        }
    }

    /// The path rests, for a time that is not known.
    fn rest(&mut self, line: u32, planner: &mut Planner<Barrier>, findings: &mut FindingLog) {
        self.close_section(planner, findings);
        planner.push_barrier(Barrier::Dwell { duration_s: 0.0, line, x_offset_mm: None });
    }

    /// Stands still. Constant surface speed goes by X in the coordinates of the dwell, whose work offset of X may be given.
    fn dwell(
        &mut self,
        time: DwellTime,
        x_offset_mm: Option<f64>,
        span: SourceSpan,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        self.close_section(planner, findings);
        let duration_s = match time {
            DwellTime::Seconds(seconds) => seconds,
            DwellTime::Revolutions(revolutions) => {
                let [x_mm, from_mm] = self.state.x_mm;
                let radius_mm = x_mm + x_offset_mm.map_or(0.0, |offset_mm| from_mm - offset_mm);
                let top_rev_per_s = config.profile.machine.max_spindle_rev_per_min / 60.0;
                revolutions / self.state.spindle.rev_per_s(radius_mm).min(top_rev_per_s)
            }
        };
        // The infinite dwell of a stopped spindle is refused too.
        if (0.0..=MAX_BLOCK_DURATION_S).contains(&duration_s) {
            planner.push_barrier(Barrier::Dwell { duration_s, line: span.line, x_offset_mm });
        } else {
            findings.push(too_long(span, duration_s));
        }
    }

    fn motion(
        &mut self,
        mv: &Move,
        span: SourceSpan,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        if self.guide.is_some() {
            self.state.guide.moved(mv);
        }
        let machine = &config.profile.machine;
        let Some(element) = Element::from_move(mv, span) else {
            if mv.spline.is_some() {
                findings.push(spline_cusp(span));
            }
            return;
        };
        if let Some(axis) = missing_axis(&element, machine) {
            findings.push(missing(axis, span, machine, may_be_drawn(mv, &element)));
            return;
        }
        config.travel().check(&element, findings);

        let cutting = mv.kind == MoveKind::Cutting;
        if cutting {
            self.open_section(mv, config, planner);
            let [least_radius_mm, _] = element.radius_range_mm();
            self.check_speed((&mv.spindle, least_radius_mm), mv.tool, span, config, findings);
            self.check_override(config, findings);
        } else {
            self.close_section(planner, findings);
        }
        if cutting && !self.can_act_on(&element, span, findings) {
            return;
        }
        self.state.x_mm = [mv.end[X], mv.work_offset[X]];
        if let Some(analysis) = &mut self.analysis {
            analysis.moves += 1;
            analysis.cutting_moves += u64::from(cutting);
        }
        let cut = Cut::of(mv, &element);
        let joining = joining(&self.state.functions, self.guide.as_ref(), config);
        let mut parts = element.smooth_parts().into_iter().peekable();
        while let Some(part) = parts.next() {
            // The block stops at its own end only.
            let stops_within = parts.peek().is_some() && mv.path_control == PathControl::ExactStop;
            let control = if stops_within { PathControl::ExactPath } else { mv.path_control };
            self.state.smoother.push(part, control, cut, joining, &mut |smoothed| self.smoothed.push(smoothed));
        }
        self.run_smoothed(config, planner, findings);
    }

    /// Plans what came out of the smoother.
    fn run_smoothed(&mut self, config: &PipelineConfig, planner: &mut Planner<Barrier>, findings: &mut FindingLog) {
        let mut smoothed = std::mem::take(&mut self.smoothed);
        for smoothed in smoothed.drain(..) {
            self.run(smoothed, config, planner, findings);
        }
        self.smoothed = smoothed;
    }

    fn run(
        &mut self,
        smoothed: Smoothed<Cut>,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        let machine = &config.profile.machine;
        let Smoothed { element, carried: cut, blocks, rest_at_end, origin, deviation } = smoothed;
        let (cutting, span) = (!element.rapid, element.source);
        if let Some(analysis) = &mut self.analysis {
            analysis.deviates(&element, deviation, machine);
        }
        if blocks == 0 {
            // The programmed blocks were checked as they came; the curve at a corner may swing out beside them.
            config.travel().check(&element, findings);
        }
        let superposed = self.superpose(&element, &cut, config, planner, findings);
        if let Some(reach) = superposed.reach() {
            config.travel().check_oscillating(&element, reach, findings);
        }
        let pieces = superposed.limit_pieces(&element, machine);
        let machine = superposed.machine(machine);
        let limits = match &pieces {
            Ok(pieces) => Ok(PathLimits::tightest(pieces.iter().map(|piece| &piece.limits))),
            Err(exceeded) => Err(*exceeded),
        };
        self.analyse(&cut, &element, &limits, superposed.is_vibrating(), machine);
        let pieces = match pieces {
            Ok(pieces) => pieces,
            Err(exceeded) => {
                // The section's own report says more where there is one.
                if !self.is_in_analysed_section() {
                    let LimitExceeded { axis, quantity, demanded, limit } = exceeded;
                    let unit = quantity.unit(axis.is_rotary());
                    findings.push(
                        Finding::new(code::AXIS_LIMIT, span, exceeded.to_string())
                            .ranked(format!("{quantity} of {}", axis.letter()), demanded / limit)
                            .with_value("demanded", demanded, unit)
                            .with_value("limit", limit, unit),
                    );
                }
                return;
            }
        };
        let stretches = stretches(&element, cut.feed, &cut.spindle, machine, &pieces);
        // A curve at a corner has no feed of its own that could be missed.
        if cutting && blocks > 0 {
            self.check_feed(&stretches, &element, findings);
        }
        // Where the vibration has to wait for a corner, the path rests there.
        let passes_corners = !superposed.is_vibrating();
        let mut request = MotionRequest::new(element, stretches);
        request.rest_at_end = rest_at_end;
        request.passes_corners = passes_corners;
        request.reach_mm = superposed.reach_mm();
        request.has_full_limits = superposed.has_full_limits();
        request.origin = origin;
        if let Some(TooManyWithinReach { elements }) = planner.push_motion(request) {
            let on_span = self.state.functions.vibration.on_span().unwrap_or(span);
            findings.push(blocks_too_short(on_span, elements).at("line", span.line.into()));
        }
    }

    /// Whether a section in progress reports what its axes cannot follow.
    fn is_in_analysed_section(&mut self) -> bool {
        self.analysis.as_mut().is_some_and(|analysis| analysis.functions.vibration.open_mut().is_some())
    }

    fn analyse(
        &mut self,
        cut: &Cut,
        element: &Element,
        limits: &Result<PathLimits, LimitExceeded>,
        in_section: bool,
        machine: &Machine,
    ) {
        let Some(analysis) = &mut self.analysis else { return };
        analysis.path_length_mm += element.length;
        if element.rapid {
            return;
        }
        analysis.cutting_length_mm += element.length;
        if cut.spindle.is_turning() {
            for radius_mm in element.radius_range_mm() {
                let speed = (cut.spindle.rev_per_s(radius_mm) * 60.0).min(machine.max_spindle_rev_per_min);
                analysis.turns_at(speed);
            }
        }
        if in_section && let Some(open) = analysis.functions.vibration.open_mut() {
            open.add_element(element, cut.feed, &cut.spindle, limits);
        }
    }
}
