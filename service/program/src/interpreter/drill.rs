//! Drilling, boring and tapping cycles: `G73`, `G74`, `G76` of mills, `G81` to `G89`, and `G33.1`.
//!
//! A cycle becomes the moves that the control makes, each with the place of the block that asked for them. At every hole:
//! rapid to its place at the level where the tool is, rapid to the R level, the cut, and the return to the level of the start
//! (`G98`) or to the R level (`G99`). The level of the start is where the tool was along the drilling axis when the mode
//! began. The words stay until `G80` or a motion code; in LinuxCNC, R and Z only for as long as the code does.

mod boring;
mod cut;
mod drive;
mod levels;
mod pattern;
mod tap;
mod transformed;
mod words;

pub(super) use self::cut::MAX_STROKES;
use self::pattern::Bolts;
use super::execute::Execution;
use super::motion::{Frame, set_bits};
use super::tool_control::{GuidedPath, ROTARY_LETTERS};
use crate::code;
use crate::dialect::{Group, Letter, Meaning, letter_bit};
use crate::state::{Cycle, Motion, ToolControl, ToolMode};
use crate::{
    Axis, AxisSet, DialectName, DrillingStyle, Feed, Finding, MoveKind, OperationKind, PathControl, Position,
    SourceSpan, SpindleDirection,
};

/// The words of a cycle beside axes.
const WORDS: u32 = letter_bit(b'R')
    | letter_bit(b'Q')
    | letter_bit(b'P')
    | letter_bit(b'L')
    | letter_bit(b'K')
    | letter_bit(b'I')
    | letter_bit(b'J');

/// How the tool gets deeper between retracts, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pecks {
    /// In one stroke.
    None,
    /// By `Q` each.
    Constant(f64),
    /// Haas: `I` first, `J` less with each, at least `K`.
    Reducing { first: f64, less: f64, least: f64 },
}

/// The holes of one block, with everything resolved: lengths in mm, X a radius, work coordinates.
#[derive(Clone, Copy, Debug)]
struct Hole {
    cycle: Cycle,
    /// Index of the drilling axis.
    axis: usize,
    /// Direction out of the hole along the axis, 1 or −1.
    up: f64,
    /// Place of the first hole, and from one to the next.
    at: Position,
    step: Position,
    repeats: u32,
    r: f64,
    bottom: f64,
    /// Where the tool returns to.
    clear: f64,
    pecks: Pecks,
    /// Haas: `G73` goes out of the hole after each so much.
    out_after: Option<f64>,
    dwell_s: f64,
    /// Where an oriented tool is moved off the wall.
    shift: Position,
    drive: Drive,
    /// Where the holes are that are neither at one place nor in steps.
    pattern: Option<pattern::Pattern>,
    /// How many times faster a rigid tap goes out than in.
    tap_retract: f64,
    /// Polar coordinates: the angle from one hole to the next about the zero of the work coordinates, degrees.
    polar_step_deg: Option<f64>,
}

/// What makes the tool cut.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Drive {
    Feed(Feed),
    /// The spindle: lead, mm per revolution.
    Spindle {
        lead_mm: f64,
    },
}

impl Execution<'_> {
    /// `G98`, `G99` and `G80`.
    pub(super) fn drilling_modes(&mut self) {
        if let Some((Meaning::CycleReturn { to_r }, _)) = self.code(Group::CycleReturn) {
            self.state.drilling.to_r = to_r;
        }
        let linuxcnc = self.is_linuxcnc();
        // In LinuxCNC it counts for nothing beside a motion code, and else leaves none in force.
        if let Some((Meaning::CycleEnd, _)) = self.code(Group::Cycle)
            && !(linuxcnc && self.block.code(Group::Motion).is_some())
        {
            self.leave_cycle();
            if linuxcnc {
                self.state.motion = Motion::None;
                self.state.motion_code = 800;
            }
        }
    }

    /// A motion code, or `G80`: no cycle is in force any more.
    #[inline]
    pub(super) fn leave_cycle(&mut self) {
        if self.state.drilling.cycle.is_some() {
            self.state.machine.rigid_tapping = false;
        }
        self.state.drilling.leave(self.is_linuxcnc());
    }

    pub(super) fn is_linuxcnc(&self) -> bool {
        self.settings.dialect == DialectName::LinuxCnc
    }

    /// Whether the cycles are those of a FANUC lathe.
    pub(super) fn has_lathe_cycles(&self) -> bool {
        self.settings.dialect == DialectName::Lathe && self.settings.drilling.style == DrillingStyle::Fanuc
    }

    /// Whether the block belongs to a drilling cycle of a FANUC lathe.
    pub(super) fn is_lathe_cycle_block(&self) -> bool {
        let is_in_force = match self.code(Group::Motion) {
            Some((meaning, _)) => matches!(meaning, Meaning::Drill(_)),
            None => self.state.drilling.cycle.is_some() && self.block.code(Group::Cycle).is_none(),
        };
        is_in_force && self.has_lathe_cycles()
    }

    /// The code of a cycle.
    pub(super) fn enter_cycle(&mut self, cycle: Cycle) {
        let keeps_words = !self.is_linuxcnc();
        let line = self.block.span().line;
        let drilling = &mut self.state.drilling;
        if drilling.cycle != Some(cycle) && !keeps_words {
            (drilling.r_level, drilling.bottom, drilling.q) = (None, None, None);
        }
        drilling.cycle = Some(cycle);
        (drilling.line, drilling.refused) = (line, None);
        self.state.spline_exit = None;
    }

    /// A block while a cycle is in force.
    #[cold]
    pub(super) fn drill(&mut self, frame: Frame) {
        let Some(cycle) = self.state.drilling.cycle else { return };
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        let words = self.block.letters & !self.used & WORDS;
        if self.block.unclear {
            self.used |= WORDS;
            self.state.position = self.target(axes & !self.letters_of(self.state.plane.normal()), Frame::Work);
            return;
        }
        self.show_by_words(axes);
        if frame == Frame::Machine {
            return self.refuse_cycle(
                code::MACHINE_MOTION,
                "machine coordinates go with G0 or G1 only",
                "end it with G80",
            );
        }
        let opens = matches!(self.code(Group::Motion), Some((Meaning::Drill(_), _)));
        let bolts = match self.code(Group::NonModal) {
            Some((Meaning::BoltHoles(pattern), span)) => match self.bolts(pattern, span) {
                Some(bolts) => Some(bolts),
                None => {
                    self.used = u32::MAX;
                    return;
                }
            },
            _ => None,
        };
        if axes == 0 && bolts.is_none() && (self.is_linuxcnc() || words & letter_bit(b'R') == 0) {
            if opens && self.is_linuxcnc() {
                let message = format!("{} has no axis word, so that it drills nowhere", cycle.name());
                self.used |= WORDS;
                self.cycle_word(&message, "add X or Y with the place of the hole");
            }
            return;
        }
        if matches!(self.state.tool_control.mode, ToolMode::Angles | ToolMode::Vectors) {
            self.used |= WORDS | axes;
            self.state.motion = Motion::Unclear;
            self.leave_cycle();
            return self.not_permitted(self.block.span(), "a drilling cycle");
        }
        if self.is_cycle_on_contour("a drilling cycle") {
            self.used |= WORDS;
            self.state.position = self.target(axes, Frame::Work);
            return self.leave_cycle();
        }
        if self.state.tool_control.mode == ToolMode::Plane && self.refuse_rotary_words(axes & ROTARY_LETTERS) {
            self.used |= WORDS | axes;
            return;
        }
        let Some((cycle, axis)) = self.cycle_here(cycle) else { return };
        if self.is_cycle_transformed(cycle, axis) {
            return;
        }
        if axes == 0 && bolts.is_none() && self.state.drilling.bottom.is_none() && !self.is_linuxcnc() {
            return self.keep_cycle_words(cycle, axis);
        }
        self.drill_block(cycle, axis, axes, bolts);
    }

    /// The cycle that a code means on this control, and its axis; nothing after a finding.
    fn cycle_here(&mut self, cycle: Cycle) -> Option<(Cycle, Axis)> {
        let normal = self.state.plane.normal();
        if self.has_lathe_cycles() {
            return match cycle {
                Cycle::Peck => Some((Cycle::Peck, Axis::Z)),
                Cycle::Tap => Some((Cycle::Tap, Axis::Z)),
                Cycle::Bore => Some((Cycle::BoreDwell, Axis::Z)),
                Cycle::BackBore => Some((Cycle::Peck, Axis::X)),
                Cycle::BoreManual => Some((Cycle::Tap, Axis::X)),
                Cycle::BoreDwell => Some((Cycle::BoreDwell, Axis::X)),
                _ => {
                    let message = format!("{} is no cycle of a FANUC lathe", cycle.name());
                    let cure = "where the control has it as a mill does, set language.drilling.style of the machine profile to DRILLING_STYLE_HAAS";
                    self.refuse_cycle(code::CYCLE_UNDEFINED, &message, cure);
                    None
                }
            };
        }
        let axis = if self.settings.dialect == DialectName::Lathe { Axis::Z } else { normal };
        match cycle {
            Cycle::BoreManual | Cycle::BackBore if cycle == Cycle::BoreManual || self.settings.is_haas() => {
                let name = cycle.name();
                let message =
                    format!("in {name} the operator retracts the tool by hand, so that its path is not known");
                self.refuse_cycle(code::CYCLE_UNDEFINED, &message, "use G86, which retracts by itself");
                None
            }
            Cycle::BackBore if self.is_linuxcnc() => {
                let message = "what G87 does is not defined in LinuxCNC";
                self.refuse_cycle(code::CYCLE_UNDEFINED, message, "write the moves with G0, G1 and M19");
                None
            }
            Cycle::BackBore if self.state.drilling.to_r => {
                let message = "G87 returns to the level of the start only, but G99 is in force";
                self.refuse_cycle(code::CYCLE_UNDEFINED, message, "write G98 in its block");
                None
            }
            _ => Some((cycle, axis)),
        }
    }

    /// Refuses the cycle as a whole: axis words are followed silently up to the next motion code.
    fn refuse_cycle(&mut self, code: crate::FindingCode, message: &str, cure: &str) {
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        self.used |= WORDS;
        self.state.position = self.target(axes, Frame::Work);
        self.leave_cycle();
        self.state.motion = Motion::Unclear;
        let span = self.block.span();
        self.findings.push_with(code, |code| Finding::new(code, span, message).suggest(cure));
    }

    /// The letters of the words that place an axis.
    pub(super) fn letters_of(&self, axis: Axis) -> u32 {
        let letters = self.table.dialect.letters.iter().enumerate();
        let names =
            |letter: &Letter| matches!(letter, Letter::Axis(named) | Letter::Increment(named) if *named == axis);
        letters.filter(|(_, letter)| names(letter)).fold(0, |mask, (place, _)| mask | 1 << place)
    }

    /// The holes of a block.
    fn drill_block(&mut self, cycle: Cycle, axis: Axis, axes: u32, bolts: Option<Bolts>) {
        let along = self.letters_of(axis);
        if (self.block.letters & !self.used & WORDS) | axes & along != 0 {
            self.state.drilling.refused = None;
        }
        self.check_cycle_axes(axes, axis);
        let start = self.state.position;
        let polar = self.polar_steps(axes & !along);
        let (held_before, mark) = (self.state.tool_control.held, self.findings.mark());
        let at = self.target(axes & !along, Frame::Work);
        if self.state.tool_control.held.meets(AxisSet::LINEAR) {
            self.used |= along | WORDS;
            self.state.position = at;
            if !self.findings.has_errors_since(&mark) {
                self.held_start(self.block.span());
            }
            return;
        }
        let mut hole = self.hole(cycle, axis, axes & along, &start, at);
        if let Some(bolts) = bolts
            && let Some((hole, repeats)) = &mut hole
        {
            *repeats = bolts.count;
            if self.check_strokes(hole.pecks.strokes((hole.r - hole.bottom).abs()), bolts.count).is_none() {
                self.state.position = at;
                return;
            }
        }
        let Some((mut hole, repeats)) = hole else {
            self.state.position = at;
            return;
        };
        self.note_return(hole.axis, hole.r, &start);
        if repeats == 0 {
            // The words are stored, and nothing moves.
            return;
        }
        hole.repeats = repeats;
        self.state.drilling.refused = None;
        if let Some(bolts) = bolts {
            self.place_bolts(&mut hole, bolts);
        } else if repeats > 1 {
            hole.polar_step_deg = polar.unwrap_or_else(|()| {
                self.refuse_polar_steps();
                None
            });
        }
        let ToolControl { mode, held, .. } = self.state.tool_control;
        if matches!(hole.drive, Drive::Spindle { .. }) && mode == ToolMode::Off && !held.is_empty() {
            // A stroke without a plane says where every axis is, the rotary ones among them.
            self.state.position = at;
            return self.held_start(self.block.span());
        }
        if held_before != held {
            self.come_over(&hole, &start, at);
        }
        self.emit_holes(&hole);
    }

    /// Moves over a hole from where only the machine knows: even a place with the same numbers may be another one.
    fn come_over(&mut self, hole: &Hole, start: &Position, at: Position) {
        let modal = std::mem::replace(&mut self.state.path_control, PathControl::ExactPath);
        let mut over = at;
        over[hole.axis] = start[hole.axis];
        self.drill_guided(MoveKind::Rapid, over, Feed::PerMinute(0.0));
        self.state.path_control = modal;
    }

    /// Reports words of axes that the cycle does not move.
    fn check_cycle_axes(&mut self, axes: u32, drilling: Axis) {
        let linuxcnc = self.is_linuxcnc();
        for place in set_bits(axes) {
            let (Letter::Axis(axis) | Letter::Increment(axis)) = self.table.dialect.letters[place] else { continue };
            let parallel = matches!(axis, Axis::U | Axis::V | Axis::W);
            if axis == drilling || !(parallel || linuxcnc && axis.is_rotary()) {
                continue;
            }
            let span = self.block.word_span(self.block.slot(place));
            self.findings.push_with(code::CYCLE_AXIS, |code| {
                let message = format!("{} does not move within a drilling cycle", axis.letter());
                Finding::new(code, span, message).suggest("move it in a block before the cycle")
            });
        }
    }

    /// Warns of a change from `G99` to `G98` within the mode.
    fn note_return(&mut self, axis: usize, r: f64, start: &Position) {
        let to_r = self.state.drilling.to_r;
        let before = self.state.drilling.returned_to_r.replace(to_r);
        let level = self.start_level(axis);
        let (span, linuxcnc) = (self.block.span(), self.is_linuxcnc());
        // To an R level above the start LinuxCNC goes where the tool is.
        if before != Some(true) || to_r || start[axis] == level || linuxcnc && level < r {
            return;
        }
        self.findings.push_with(code::CYCLE_RETURN, |code| {
            let message = if linuxcnc {
                "G98 while the tool is at the R level: it goes to the next hole and up to the level of the start at once"
            } else {
                "G98 while the tool is at the R level: it goes to the next hole there, and returns to the level of the start behind it only"
            };
            Finding::new(code, span, message)
                .with_value("level", start[axis], "mm")
                .with_value("start_level", level, "mm")
                .suggest("end the cycle with G80, raise the tool with G0, and open the cycle again")
        });
    }

    /// The level at which the mode began, as a work coordinate.
    fn start_level(&mut self, axis: usize) -> f64 {
        let offset = if self.is_linuxcnc() { 0.0 } else { self.machine_offset()[axis] };
        let here = self.state.position[axis];
        match self.state.drilling.start_level {
            Some(level) => level - offset,
            None => {
                self.state.drilling.start_level = Some(here + offset);
                here
            }
        }
    }

    /// Emits the moves of the holes, through every programmed point.
    fn emit_holes(&mut self, hole: &Hole) {
        let modal = std::mem::replace(&mut self.state.path_control, PathControl::ExactPath);
        let direction = self.state.spindle_direction;
        if matches!(hole.drive, Drive::Spindle { .. }) {
            self.turn(SpindleDirection::Stopped);
        }
        let axis = hole.axis;
        if self.is_linuxcnc() && self.state.position[axis] != hole.r && self.start_level(axis) < hole.r {
            // To an R level above the start where the tool is, whether that is up or, from one still higher, down.
            let mut up = self.state.position;
            up[axis] = hole.r;
            let step = self.new_move(MoveKind::Rapid, up, Feed::PerMinute(0.0));
            self.emit(self.block.span(), OperationKind::Move(step));
            self.name_cycle();
            self.state.position = up;
        }
        let clamps = std::mem::take(&mut self.clamps);
        let mut at = hole.at;
        for number in 0..hole.repeats {
            if let Some(pattern) = &hole.pattern {
                pattern.place(number, self.state.plane, &mut at);
            } else if let Some(step_deg) = hole.polar_step_deg.filter(|_| number > 0) {
                self.next_polar_hole(&mut at, step_deg);
            } else if number > 0 {
                self.next_hole(hole, &mut at);
            }
            let here = self.state.position[axis];
            let level = if self.is_linuxcnc() && !(number == 0 && here > hole.r) { hole.clear } else { here };
            if hole.cycle == Cycle::BackBore {
                self.back_bore(hole, &at, direction);
                continue;
            }
            at[axis] = level;
            self.drill_to(MoveKind::Rapid, at, Feed::PerMinute(0.0));
            self.clamp(&clamps);
            self.rapid_along(hole, hole.r);
            self.cut_hole(hole, direction);
        }
        self.state.path_control = modal;
    }

    /// A straight move of a cycle.
    fn drill_to(&mut self, kind: MoveKind, end: Position, feed: Feed) {
        if !self.is_move(&end) {
            return;
        }
        if self.state.tool_control.is_plain() {
            self.emit_move(kind, &end, None, feed);
            self.name_cycle();
            self.state.position = end;
        } else {
            self.drill_guided(kind, end, feed);
        }
    }

    /// A straight move of a cycle whose start only the machine may know.
    fn drill_guided(&mut self, kind: MoveKind, end: Position, feed: Feed) {
        self.emit_guided(self.guide(None), kind, end, feed, GuidedPath::Straight);
        self.name_cycle();
        self.state.position = end;
    }

    /// Says in the move emitted last which cycle it belongs to.
    fn name_cycle(&mut self) {
        if self.state.is_plane_refused() {
            return;
        }
        let cycle = self.state.drilling.called();
        match self.operations.last_mut().map(|operation| &mut operation.kind) {
            Some(OperationKind::Move(step)) => step.cycle = cycle,
            Some(OperationKind::Guided(guided)) => guided.step.cycle = cycle,
            _ => {}
        }
    }

    fn along(&self, hole: &Hole, level: f64) -> Position {
        let mut end = self.state.position;
        end[hole.axis] = level;
        end
    }

    fn rapid_along(&mut self, hole: &Hole, level: f64) {
        self.drill_to(MoveKind::Rapid, self.along(hole, level), Feed::PerMinute(0.0));
    }

    fn feed_along(&mut self, hole: &Hole, level: f64) {
        if let Drive::Feed(feed) = hole.drive {
            self.drill_to(MoveKind::Cutting, self.along(hole, level), feed);
        }
    }

    /// Changes the sense of the spindle.
    fn turn(&mut self, direction: SpindleDirection) {
        let before = self.state.spindle();
        self.state.spindle_direction = direction;
        self.emit_spindle(before, self.block.span());
    }

    /// Where what is wrong with the cycle is reported, once for all holes of the same words.
    pub(super) fn cycle_span(&mut self) -> SourceSpan {
        *self.state.drilling.refused.get_or_insert(self.block.span())
    }

    #[cold]
    fn cycle_word(&mut self, message: &str, cure: &str) {
        let span = self.cycle_span();
        self.findings.push_with(code::CYCLE_WORD, |code| Finding::new(code, span, message).suggest(cure));
    }
}
