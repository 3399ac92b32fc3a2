//! What a change of the tool's length or offset leaves for the moves behind it. The machine does not move with the change: FANUC adds it to
//! the next move of the axis, whose word may be absolute or incremental. Absolute words have it by their coordinates; for
//! incremental ones it is kept here.

use super::Execution;
use crate::code;
use crate::coordinates::OffsetDue;
use crate::dialect::Letter;
use crate::interpreter::motion::{Frame, set_bits};
use crate::state::LengthCompensation;
use crate::{Axis, DialectName, Finding, Position, SourceSpan};

impl Execution<'_> {
    /// Keeps what the tool's offset has become more than `before`.
    pub(in super::super) fn offset_changed(&mut self, before: &Position) {
        // Whatever it is, it is as the program says.
        if let Some(due) = self.state.coords.due.take() {
            self.keep_due(OffsetDue { returned: false, ..*due });
        }
        // LinuxCNC counts incremental words from where the tip is.
        if self.is_linuxcnc_dialect() || *before == self.state.length.offset {
            return;
        }
        let machine = self.machine_position();
        let mut due = self.state.coords.due.take().unwrap_or_default();
        for axis in Axis::ALL {
            let place = axis.index();
            let change = self.state.length.offset[place] - before[place];
            let earlier = if due.is_due(axis, &machine) { due.change[place] } else { 0.0 };
            due.change[place] = earlier + change;
            due.axes = if due.change[place] == 0.0 { due.axes.without(axis) } else { due.axes.with_axis(axis) };
        }
        due.machine = machine;
        self.keep_due(*due);
    }

    fn keep_due(&mut self, due: OffsetDue) {
        self.state.coords.due = (!due.axes.is_empty() || due.returned).then(|| Box::new(due));
    }

    /// `G28` has returned an axis: older Haas mills cancel the tool length with it, newer ones keep it.
    pub(in super::super) fn length_returned(&mut self) {
        if self.is_haas()
            && self.settings.dialect == DialectName::Mill
            && self.state.length.offset != Position::default()
        {
            self.state.coords.due.get_or_insert_default().returned = true;
        }
    }

    /// Reports an absolute place along Z where `G28` may have cancelled the length.
    fn check_returned(&mut self, span: SourceSpan) {
        let Some(due) = self.state.coords.due.as_mut().filter(|due| due.returned) else { return };
        due.returned = false;
        let LengthCompensation { number, length_mm, negative, .. } = self.state.length;
        let calls = if negative { "G44" } else { "G43" };
        self.findings.push_with(code::LENGTH_RETURN, |code| {
            let message = format!(
                "G28 has returned to the reference position since the length {length_mm} mm of H{number} was called: some Haas \
                 controls have cancelled it, others have not, and Z goes to different places"
            );
            Finding::new(code, span, message)
                .with_value("length", length_mm, "mm")
                .suggest(format!("call the length again with {calls} H{number} in this block or before it"))
                .suggest("write G49 before it, where Z is to be without the length")
        });
    }

    /// Nothing is due to these axes any more.
    pub(in super::super) fn forget_due(&mut self, axes: u32) {
        let Some(mut due) = self.state.coords.due.take() else { return };
        for place in set_bits(axes) {
            if let Letter::Axis(axis) | Letter::Increment(axis) = self.table.dialect.letters[place] {
                due.axes = due.axes.without(axis);
            }
        }
        self.keep_due(*due);
    }

    /// What the words in the mask `axes` move more than they say, as the offset has changed since the last move of their axes. Where
    /// controls differ in that, it is reported.
    #[cold]
    pub(in super::super) fn take_up_due(&mut self, axes: u32, frame: Frame) -> Position {
        let mut more = Position::default();
        let Some(due) = self.state.coords.due.clone() else { return more };
        let machine = self.machine_position();
        for place in set_bits(axes) {
            let (axis, increment) = match self.table.dialect.letters[place] {
                Letter::Axis(axis) => (axis, !self.state.absolute && frame == Frame::Work),
                Letter::Increment(axis) => (axis, true),
                _ => continue,
            };
            if axis == Axis::Z && !increment && frame == Frame::Work {
                self.check_returned(self.block.word_span(self.block.slot(place)));
            }
            if increment && due.is_due(axis, &machine) {
                more[axis.index()] = due.change[axis.index()];
                if !self.adds_due() {
                    let span = self.block.word_span(self.block.slot(place));
                    self.due_unclear(axis, due.change[axis.index()], span);
                }
            }
        }
        self.forget_due(axes);
        more
    }

    /// Whether the control is known to add the change of an offset to an incremental word.
    fn adds_due(&self) -> bool {
        let coords = &self.state.coords;
        let is_plain = coords.transform.is_none() && coords.polar.is_none() && self.state.tool_control.is_plain();
        self.settings.dialect == DialectName::Mill
            && !self.settings.is_haas()
            && is_plain
            && self.state.drilling.cycle.is_none()
    }

    /// Reports an incremental level of a cycle that the change of an offset may belong to.
    pub(in super::super) fn check_due_level(&mut self, axis: Axis, along: u32, from_start: bool) {
        let Some(due) = self.state.coords.due.clone() else { return };
        if axis == Axis::Z && !from_start {
            self.check_returned(self.block.span());
        }
        if from_start && due.is_due(axis, &self.machine_position()) {
            self.due_unclear(axis, due.change[axis.index()], self.block.span());
        }
        self.forget_due(along);
    }

    fn due_unclear(&mut self, axis: Axis, change_mm: f64, span: SourceSpan) {
        let letter = axis.letter();
        self.findings.push_with(code::LENGTH_INCREMENT, |code| {
            let message = format!(
                "an incremental word is the first of {letter} since the tool offset changed by {change_mm} mm: controls differ in \
                 whether it moves by the change as well"
            );
            Finding::new(code, span, message)
                .with_value("change", change_mm, "mm")
                .suggest(format!("let an absolute word of {letter} come first"))
        });
    }
}
