//! Tool length compensation: `G43 H`, `G44 H`, `G49`.
//!
//! On FANUC and Haas mills the length is along Z whatever the plane of arcs; in LinuxCNC a tool has an offset along every axis. It is
//! part of the offset of every move: machine Z = work Z + work offset + length, so that work coordinates are those of the tip, and machine coordinates those of the machine's control point.
//! Switching moves nothing (on some controls `G43` without an axis word moves Z by the length): the same place has other
//! coordinates, and the next word of Z says where the tip goes. In a tilted plane the length is along the tool axis.

use super::execute::Execution;
use crate::block::Word;
use crate::code;
use crate::dialect::{Group, Meaning, letter_bit};
use crate::state::{LengthCompensation, Motion, ToolMode};
use crate::{Axis, AxisSet, DialectName, Finding, Position, SourceSpan, ToolOffset};

impl Execution<'_> {
    /// `G43`, `G44`, and `G49` for both.
    pub(super) fn length_compensation(&mut self) {
        match self.code(Group::LengthCompensation) {
            Some((Meaning::LengthCompensation { negative }, span)) => self.length_on(negative, span),
            Some((Meaning::LengthOffset { adds }, span)) => self.length_offset_words(adds, span),
            Some((Meaning::ToolControlOff, span)) => {
                self.no_length_word();
                if self.state.length.is_on {
                    self.switch_length(LengthCompensation::default(), span);
                }
            }
            None if self.is_length_named_anew() => {
                let span = self.block.span();
                self.length_on(self.state.length.negative, span);
            }
            _ => {}
        }
    }

    /// `H` without a code while a length is in force: FANUC and Haas controls go over to that length, and `H0` to none.
    fn is_length_named_anew(&self) -> bool {
        let is_free = self.block.letters & !self.used & letter_bit(b'H') != 0
            && self.block.code(Group::Subprogram).is_none()
            && self.state.tool_control.is_plain();
        self.settings.dialect == DialectName::Mill && self.state.length.is_on && is_free
    }

    /// `G49 H0`, as posts write it: the offset 0 is none. In LinuxCNC `G49` has no words.
    fn no_length_word(&mut self) {
        let is_none = self.block.word(b'H').is_some_and(|word| word.number.value() == 0.0);
        if is_none && !self.is_linuxcnc_dialect() {
            self.used |= letter_bit(b'H');
        }
    }

    fn length_on(&mut self, negative: bool, span: SourceSpan) {
        let word = self.take(b'H');
        if matches!(self.state.tool_control.mode, ToolMode::Angles | ToolMode::Vectors) {
            let on_line = self.state.tool_control.on_line;
            return self.length_nested(span, "tool centre point control", on_line);
        }
        let named = match word {
            Some(word) => match self.whole(&word) {
                Some(number) => Some(number),
                None => return,
            },
            None => None,
        };
        let number = match named {
            // In LinuxCNC it is the tool in the spindle, and none has no length.
            None | Some(0) if self.is_linuxcnc_dialect() => {
                if let Some(next) = self.length_of_spindle_tool(span) {
                    self.switch_length(next, span);
                }
                return;
            }
            Some(number) => number,
            None if self.settings.coordinates.length_of_tool => self.state.tool,
            // H is modal, as the length is.
            None => self.state.length.number,
        };
        if number == 0 && named.is_some() {
            if self.code(Group::LengthCompensation).is_some() {
                self.note_no_length(span);
            }
            let none =
                LengthCompensation { is_on: true, negative, on_line: span.line, ..LengthCompensation::default() };
            return self.switch_length(none, span);
        }
        if number == 0 {
            return self.findings.push_with(code::LENGTH_NUMBER, |code| {
                Finding::new(code, span, "the number H of the tool length is missing")
                    .suggest("add H with the number of the tool, such as H1")
                    .suggest("set language.coordinates.length_of_tool of the machine profile if it is that of the tool in the spindle")
                    .suggest("switch the compensation off with G49")
            });
        }
        if let Some(word) = word {
            self.check_length_of_tool(&word, number);
        }
        if let Some(next) = self.length_of_row(number, negative, span) {
            self.switch_length(next, span);
        }
    }

    /// `G43 H0`: the offset 0 is always 0.
    #[cold]
    fn note_no_length(&mut self, span: SourceSpan) {
        let tool = self.state.tool;
        self.findings.push_with(code::LENGTH_NONE, |code| {
            Finding::new(code, span, "H0 is no length: Z is that of the machine's control point behind it")
                .suggest(format!("write G49, or the number of the tool's length, such as H{}", tool.max(1)))
        });
    }

    /// What `G43` or `G44` with this row of the table puts in force; `None` after a finding.
    fn length_of_row(&mut self, number: u32, negative: bool, span: SourceSpan) -> Option<LengthCompensation> {
        let length_mm = self.known_length_mm(number, span)?;
        let length_mm = if negative { -length_mm } else { length_mm };
        let mut offset = Position::default();
        match self.tool_row(number).and_then(|row| row.total()) {
            Some(total) if self.is_linuxcnc_dialect() => offset = total,
            _ => offset[Axis::Z.index()] = length_mm,
        }
        let on_line = span.line;
        Some(LengthCompensation { is_on: true, number, geometry_number: number, negative, length_mm, offset, on_line })
    }

    /// What `G43` alone puts in force in LinuxCNC: the offset of the tool in the spindle; `None` after a finding.
    pub(super) fn length_of_spindle_tool(&mut self, span: SourceSpan) -> Option<LengthCompensation> {
        match self.state.tool {
            0 => Some(LengthCompensation { is_on: true, on_line: span.line, ..LengthCompensation::default() }),
            tool => self.length_of_row(tool, false, span),
        }
    }

    /// The length of a row of the table with its wear, mm; `None` after a finding.
    pub(super) fn known_length_mm(&mut self, number: u32, span: SourceSpan) -> Option<f64> {
        let length_mm = self.tool_row(number).as_ref().and_then(ToolOffset::length_mm);
        if length_mm.is_none() {
            self.findings.push_with(code::TOOL_LENGTH, |code| {
                let message = format!("no tool {number} with a length is known, so that H{number} means nothing");
                Finding::new(code, span, message)
                    .with_value("length_offset", f64::from(number), "")
                    .suggest("give the tool its length, and the job the tool")
            });
        }
        length_mm
    }

    /// Names the length of another tool than the one in the spindle.
    pub(super) fn check_length_of_tool(&mut self, word: &Word, number: u32) {
        let tool = self.state.tool;
        if tool == 0 || tool == number {
            return;
        }
        let span = self.block.word_span(word);
        self.findings.push_with(code::LENGTH_OTHER_TOOL, |code| {
            let message = format!("H{number} is the length of another tool than T{tool}, which is in the spindle");
            Finding::new(code, span, message)
                .with_value("length_offset", f64::from(number), "")
                .with_value("tool", f64::from(tool), "")
                .suggest_replacement("use the length of the tool", format!("H{tool}"))
        });
    }

    /// Another unit while an offset is in force in LinuxCNC, which does not convert its number.
    #[cold]
    pub(super) fn note_unit_under_offset(&mut self, span: SourceSpan) {
        if self.state.length.offset == Position::default() {
            return;
        }
        let length_mm = self.state.length.length_mm;
        self.findings.push_with(code::LENGTH_UNIT, |code| {
            let message =
                "another unit while a tool offset is in force: LinuxCNC goes on with its number in the new unit";
            Finding::new(code, span, message)
                .with_value("length", length_mm, "mm")
                .suggest("change the unit before the offset is in force, or behind G49")
        });
    }

    /// Z moves with the length of the tool before a tool change still in force; once per tool change.
    #[cold]
    pub(super) fn check_kept_length(&mut self) {
        // The way home counts from where the tip is, and leads the machine to a place of its own.
        let goes_home = matches!(
            self.code(Group::NonModal),
            Some((Meaning::Reference | Meaning::FurtherReference | Meaning::ReferenceReturn, _))
        );
        if goes_home || !std::mem::take(&mut self.state.machine.keeps_length) {
            return;
        }
        let (number, tool, on_line) = (self.state.length.number, self.state.tool, self.state.length.on_line);
        let span = self.block.span();
        self.findings.push_with(code::LENGTH_OTHER_TOOL, |code| {
            let message =
                format!("Z moves with H{number} of line {on_line} still in force, but T{tool} is in the spindle");
            Finding::new(code, span, message)
                .with_value("length_offset", f64::from(number), "")
                .with_value("tool", f64::from(tool), "")
                .suggest(format!("call the length of the tool before, such as G43 H{tool}"))
        });
    }

    /// Another length from here on; the axes stay where they are.
    pub(super) fn switch_length(&mut self, mut next: LengthCompensation, span: SourceSpan) {
        self.state.machine.keeps_length = false;
        if self.state.tool_control.mode == ToolMode::Plane {
            if next.negative {
                return self.not_permitted(span, "a tool length that is subtracted (G44)");
            }
            next.offset = Position::default();
            let change_mm = next.length_mm - self.state.length.length_mm;
            self.state.length = next;
            if change_mm != 0.0 && !self.ends_contour(span, "another tool length in a tilted plane") {
                // The machine rests, and the tip moves along the tool axis: along the normal where that is aligned.
                let control = &mut self.state.tool_control;
                let moved = if control.is_aligned { AxisSet::NONE.with_axis(Axis::Z) } else { AxisSet::LINEAR };
                control.held = control.held.with(moved);
                self.check_cut_with_change(change_mm, span);
            }
            return;
        }
        let before = self.state.length.offset;
        let change_mm =
            (0..before.len()).map(|axis| next.offset[axis] - before[axis]).find(|change_mm| *change_mm != 0.0);
        if change_mm.is_some() && self.is_length_scaled(span) {
            return;
        }
        self.rebase(|state| state.length = next);
        self.offset_changed(&before);
        if let Some(change_mm) = change_mm {
            self.check_cut_with_change(change_mm, span);
        }
    }

    /// A cut in the block that changes the length goes by the change as well as by what is programmed.
    fn check_cut_with_change(&mut self, change_mm: f64, span: SourceSpan) {
        let motion = match self.code(Group::Motion) {
            Some((Meaning::Rapid, _)) => return,
            Some((Meaning::Linear, _)) => Motion::Linear,
            Some(_) => Motion::Unclear,
            // What an earlier finding left unclear may be a rapid.
            None if self.state.motion == Motion::Unclear => return,
            None => self.state.motion,
        };
        let is_rapid = match self.code(Group::NonModal) {
            Some((Meaning::Reference | Meaning::FurtherReference | Meaning::ReferenceReturn, _)) => true,
            Some((Meaning::MachineCoordinates, _)) => motion != Motion::Linear,
            _ => false,
        };
        let code = match motion {
            _ if is_rapid => return,
            Motion::None | Motion::Rapid => return,
            Motion::Linear => code::LENGTH_WHILE_CUTTING_STRAIGHT,
            _ => code::LENGTH_WHILE_CUTTING,
        };
        // Words that the code itself took, such as those of G43.1, move nothing.
        if self.block.letters & self.table.axis_letters & !self.used == 0 {
            return;
        }
        self.findings.push_with(code, |code| {
            let message = format!("the tool length changes by {change_mm} mm in a cutting block");
            Finding::new(code, span, message)
                .with_value("change", change_mm, "mm")
                .suggest("change it in a block of its own, or with G0")
        });
    }

    #[cold]
    pub(super) fn length_nested(&mut self, span: SourceSpan, what: &'static str, on_line: u32) {
        self.findings.push_with(code::TOOL_CONTROL_NESTED, |code| {
            Finding::new(code, span, format!("{what} is on, since line {on_line}"))
                .with_value("on_line", f64::from(on_line), "")
                .suggest("switch it off with G49 first")
        });
    }

    /// Whether the coordinates scale or mirror Z, so that another length is refused; it is then reported.
    fn is_length_scaled(&mut self, span: SourceSpan) -> bool {
        let is_scaled = self.state.coords.transform.as_ref().is_some_and(|transform| transform.factor(Axis::Z) != 1.0);
        is_scaled && self.is_transform_on(span, "another tool length")
    }

    /// What machine coordinates are more than work coordinates, per axis.
    #[inline]
    pub(super) const fn machine_offset(&self) -> Position {
        self.state.coords.total
    }

    /// What machine coordinates are more than work coordinates but for the tool, per axis.
    #[inline]
    pub(super) const fn frame_offset(&self) -> Position {
        self.state.coords.frame
    }
}
