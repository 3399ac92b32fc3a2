//! Tilted work planes: `G68.2`, `G53.1` and `G53.6` that turn the tool axis onto the plane's normal, `G69`; and what goes to machine
//! positions from there.

mod forms;

use self::forms::Form;
use super::execute::Execution;
use super::motion::Frame;
use super::tool_control::ROTARY_LETTERS;
use crate::code;
use crate::dialect::{Group, Meaning, letter_bit};
use crate::state::{LengthCompensation, Motion, ToolControl, ToolMode};
use crate::{
    Axis, AxisSet, Feed, Finding, Function, GuidedMove, MoveKind, OperationKind, Position, SourceSpan, ThreadPlane,
    TiltedPlane, ToolAxisSolution, ToolGuide,
};

/// The words of `G68.2`.
const PLANE_LETTERS: u32 = letter_bit(b'X')
    | letter_bit(b'Y')
    | letter_bit(b'Z')
    | letter_bit(b'I')
    | letter_bit(b'J')
    | letter_bit(b'K')
    | letter_bit(b'P')
    | letter_bit(b'Q')
    | letter_bit(b'R');

impl Execution<'_> {
    /// `G68.2`, `G69`, `G53.1` and `G53.6`.
    pub(super) fn tilted_plane(&mut self) {
        let align = match self.code(Group::NonModal) {
            Some((Meaning::AlignTool { about_tip }, span)) => Some((about_tip, span)),
            _ => None,
        };
        match self.code(Group::Rotation) {
            Some((Meaning::TiltedPlane, span)) => {
                if let Some((_, span)) = align {
                    self.used |= PLANE_LETTERS | letter_bit(b'H');
                    if self.state.tool_control.mode == ToolMode::Off {
                        self.enter_plane(None, span.line);
                    }
                    return self.plane_error(span, "the tool axis in the block that tilts the plane", |finding| {
                        finding.suggest("write G53.1 in the next block")
                    });
                }
                self.plane_on(span);
            }
            Some((Meaning::RotationOff, span)) => self.plane_off(span),
            _ => {}
        }
        if let Some((about_tip, span)) = align {
            self.align_tool(about_tip, span);
        }
    }

    /// Ends a drilling cycle whose levels are in the coordinates before a plane or in it, which is reported.
    fn end_cycle_before_plane(&mut self, span: SourceSpan) {
        let ends_here = self.code(Group::Cycle).is_some()
            || self.code(Group::Motion).is_some_and(|(meaning, _)| !matches!(meaning, Meaning::Drill(_)));
        if self.state.drilling.cycle.is_none() || ends_here {
            return;
        }
        let line = self.state.drilling.line;
        self.findings.push_with(code::PLANE_BLOCK, |code| {
            let message =
                format!("the drilling cycle of line {line} is in force, whose levels are of other coordinates");
            Finding::new(code, span, message)
                .with_value("cycle_line", f64::from(line), "")
                .suggest("end it with G80 first")
        });
        self.leave_cycle();
        self.state.motion = Motion::Unclear;
    }

    fn plane_on(&mut self, span: SourceSpan) {
        self.end_cycle_before_plane(span);
        let plane = match self.plane_form(span) {
            Form::Plane(plane) => Some(plane),
            Form::Part => return,
            Form::Refused => None,
        };
        let ends_contour = plane.is_some() && self.ends_contour(span, "a tilted plane (G68.2)");
        let control = self.state.tool_control;
        match control.mode {
            ToolMode::Off => {}
            // Once the contour is left, G69 is the next thing.
            ToolMode::Plane if ends_contour || self.state.is_plane_refused() => {}
            ToolMode::Plane => {
                let on_line = control.on_line;
                return self.findings.push_with(code::PLANE_NESTED, |code| {
                    let message = format!("a tilted plane is on already, since line {on_line}");
                    Finding::new(code, span, message)
                        .with_value("on_line", f64::from(on_line), "")
                        .suggest("cancel it with G69 first")
                });
            }
            ToolMode::Angles | ToolMode::Vectors => return self.not_permitted(span, "a tilted plane"),
        }
        let plane = plane.filter(|_| !self.is_transform_on(span, "a tilted plane") && !self.is_length_subtracted(span));
        self.enter_plane(plane, span.line);
    }

    /// `G44`, which is reported.
    fn is_length_subtracted(&mut self, span: SourceSpan) -> bool {
        if self.state.length.negative {
            self.plane_error(span, "the tool length is subtracted (G44): in a tilted plane it is added", |it| {
                it.suggest("switch it off with G49, or over to G43, first")
            });
        }
        self.state.length.negative
    }

    /// From here on coordinates are those of the plane; without one, as it was refused, they are nobody's.
    fn enter_plane(&mut self, plane: Option<TiltedPlane>, on_line: u32) {
        self.state.compensation.on = None;
        // The length is along the tool axis now, wherever that points.
        self.state.length.offset = Position::default();
        self.resolve_held();
        self.state.spline_exit = None;
        let held = self.state.tool_control.held.with(AxisSet::LINEAR);
        self.state.tool_control = ToolControl { mode: ToolMode::Plane, on_line, held, ..ToolControl::default() };
        self.state.plane_tilted = plane;
        self.note_work_of_threads();
    }

    /// The surface of the work that a vibration of threads in force has stated is one of the coordinates before.
    fn note_work_of_threads(&mut self) {
        self.state.thread.work_is_elsewhere |= self.state.functions_on.contains(Function::ThreadVibration);
    }

    /// Reports a plane of several blocks that this block does not go on with.
    #[cold]
    pub(super) fn check_plane_sequence(&mut self) {
        let goes_on = matches!(self.code(Group::Rotation), Some((Meaning::TiltedPlane, _)));
        let is_empty = self.block.letters & !letter_bit(b'N') == 0
            && self.code(Group::Motion).is_none()
            && !self.block.has_codes_besides_motion();
        if let Some(sequence) = self.state.plane_sequence.as_deref().copied().filter(|_| !goes_on && !is_empty) {
            self.plane_incomplete(sequence);
        }
    }

    fn plane_off(&mut self, span: SourceSpan) {
        self.state.plane_sequence = None;
        if self.state.tool_control.mode != ToolMode::Plane {
            return;
        }
        self.end_cycle_before_plane(span);
        self.ends_contour(span, "the end of a tilted plane (G69)");
        // Only the machine knows where the axes are in plain coordinates.
        let held = self.state.tool_control.held.with(AxisSet::LINEAR);
        self.state.tool_control = ToolControl { held, ..ToolControl::default() };
        self.state.plane_tilted = None;
        self.note_work_of_threads();
        self.state.length.offset[Axis::Z.index()] = self.state.length.length_mm;
        self.resolve_held();
        self.state.spline_exit = None;
    }

    /// `G53.1`: the rotary axes turn, the linear ones rest. `G53.6`: the linear axes follow, so that the tool centre point rests on
    /// the work; with `H` that of another length than the one in force.
    fn align_tool(&mut self, about_tip: bool, span: SourceSpan) {
        let word = self.take(b'P');
        let length = if about_tip { self.take(b'H') } else { None };
        if self.state.tool_control.mode != ToolMode::Plane {
            return self.findings.push_with(code::PLANE_OFF, |code| {
                Finding::new(code, span, "the tool axis is to be turned onto a plane, but none is tilted")
                    .suggest("tilt the plane first, such as G68.2 X0 Y0 Z0 I0 J30. K0")
            });
        }
        self.ends_contour(span, "a turn of the tool axis onto the plane (G53.1, G53.6)");
        let solution = match word.map(|word| (word, word.number.value())) {
            None | Some((_, 0.0)) => ToolAxisSolution::Preferred,
            Some((_, 1.0)) => ToolAxisSolution::Larger,
            Some((_, 2.0)) => ToolAxisSolution::Smaller,
            Some((word, _)) => {
                return self
                    .word_conflict(&word, "P chooses between two solutions: P1, P2, or P0 for the preferred one");
            }
        };
        let in_force = self.state.length.number;
        let length_offset = match length {
            Some(word) => match self.length_offset(length, span) {
                Some(number) if in_force == 0 || in_force == number => {
                    self.check_length_of_tool(&word, number);
                    number
                }
                Some(_) => {
                    return self.plane_error(span, "G53.6 with another tool length than the one in force", |finding| {
                        finding.suggest("leave out H, or switch the length off with G49 before")
                    });
                }
                None => return,
            },
            None => in_force,
        };
        if about_tip && length_offset == 0 {
            return self.length_missing(span);
        }
        let held = &mut self.state.tool_control.held;
        // The place of the tip stays known where it is the one that the program leads.
        if !about_tip || length_offset != in_force {
            *held = held.with(AxisSet::LINEAR);
        }
        *held = held.with(AxisSet::ROTARY);
        self.state.tool_control.is_aligned = true;
        self.state.tool_control.turned_length = if in_force == 0 { length_offset } else { 0 };
        let step = self.new_move(MoveKind::Rapid, self.state.position, Feed::PerMinute(0.0));
        let mut guided = self.guided_step(ToolGuide::Align { solution, about_tip }, step);
        guided.held = guided.held.with(AxisSet::LINEAR);
        guided.length_offset = length_offset;
        if length_offset != in_force {
            guided.tool_length_mm = self.known_length_mm(length_offset, span);
        }
        self.emit(self.block.span(), OperationKind::Guided(Box::new(guided)));
    }

    /// Reports a cut that leads the gauge point along a plane onto which the tool axis was turned about the tip.
    pub(super) fn check_turned_length(&mut self, span: SourceSpan, kind: &OperationKind) {
        let number = self.state.tool_control.turned_length;
        let is_cut = match kind {
            OperationKind::Guided(guided) => guided.step.kind == MoveKind::Cutting && guided.guide == ToolGuide::Plane,
            OperationKind::Thread(thread) => thread.plane.is_some(),
            _ => false,
        };
        if !is_cut || self.state.length.number != 0 {
            return;
        }
        // Once for each turn.
        self.state.tool_control.turned_length = 0;
        self.findings.push_with(code::PLANE_LENGTH, |code| {
            let message = format!(
                "a cut of the gauge point: G53.6 turned about the tip of H{number}, but no tool length is in force"
            );
            Finding::new(code, span, message)
                .with_value("length_offset", f64::from(number), "")
                .suggest(format!("switch the length on behind G53.6, with G43 H{number} where Z is placed"))
        });
    }

    /// A block while `G33` is in force in a tilted plane: a thread along lines of the plane.
    pub(super) fn thread_in_plane(&mut self) {
        let has_axes = self.block.letters & self.table.axis_letters & !self.used & !letter_bit(b'A') != 0;
        if has_axes && !self.block.unclear && self.state.tool_control.held.meets(AxisSet::LINEAR) {
            // Where it starts only the machine knows, so that neither its travel nor the axis of its lead is known.
            self.state.position =
                self.target(self.block.letters & self.table.axis_letters & !ROTARY_LETTERS, Frame::Work);
            self.used = u32::MAX;
            return self.held_start(self.block.span());
        }
        self.thread_motion();
    }

    /// The tilted plane in which a thread or a tap is cut.
    pub(super) fn thread_plane(&self) -> Option<Box<ThreadPlane>> {
        let LengthCompensation { number: length_offset, length_mm: tool_length_mm, .. } = self.state.length;
        self.state.plane_tilted.map(|plane| Box::new(ThreadPlane { plane, length_offset, tool_length_mm }))
    }

    /// A rapid or a cut of the axes themselves from within a tilted plane (`G53`, `G28`): to `end` in work coordinates in the
    /// axes `named`, the others rest.
    pub(super) fn emit_from_plane(&mut self, kind: MoveKind, end: Position, named: AxisSet, feed: Feed) {
        let held = Axis::ALL
            .into_iter()
            .fold(AxisSet::NONE, |held, axis| if named.contains(axis) { held } else { held.with_axis(axis) });
        let step = self.new_move(kind, end, feed);
        let guided = GuidedMove {
            step,
            guide: ToolGuide::Axes,
            held,
            turned: AxisSet::NONE,
            length_offset: 0,
            tool_length_mm: Some(0.0),
            plane: None,
            is_pure_cut: false,
        };
        self.emit(self.block.span(), OperationKind::Guided(Box::new(guided)));
        let control = &mut self.state.tool_control;
        control.held = control.held.with(AxisSet::LINEAR);
        control.is_aligned &= !named.meets(AxisSet::ROTARY);
    }

    /// Reports rotary axes that a word moves in a tilted plane: whether there are any. Some controls then keep the tool where it is on
    /// the work, others the linear axes, and others take the words around the plane.
    pub(super) fn refuse_rotary_words(&mut self, rotary: u32) -> bool {
        if rotary == 0 {
            return false;
        }
        let span = self.block.word_span(self.block.slot(rotary.trailing_zeros() as usize));
        if self.is_on_contour() {
            self.plane_error(span, "an angle of a rotary axis on a contour in a tilted plane", |finding| {
                finding.suggest("take it out of the contour: position the rotary axes before G68.2")
            });
            return true;
        }
        self.plane_error(span, "an angle of a rotary axis in a tilted plane", |finding| {
            finding
                .suggest("turn the tool axis onto the plane with G53.1, or position the rotary axes before G68.2")
                .suggest("cancel the plane with G69 first")
        });
        true
    }

    #[cold]
    fn plane_error(&mut self, span: SourceSpan, message: &'static str, fill: impl FnOnce(Finding) -> Finding) {
        self.findings.push_with(code::PLANE_BLOCK, |code| fill(Finding::new(code, span, message)));
    }
}
