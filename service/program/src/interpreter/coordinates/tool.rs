//! Offsets of a lathe's `T` word, and `G43.1`, `G43.2` of LinuxCNC.

use super::Execution;
use crate::code;
use crate::state::LengthCompensation;
use crate::{Axis, Finding, Position, SourceSpan};

/// The axes along which a turning tool has an offset.
const TURNING_AXES: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

impl Execution<'_> {
    /// The offset of a lathe's `T` word: wear and geometry; 0 cancels. Nothing moves, the next words of the axes include it.
    pub(in super::super) fn turning_offset(&mut self, tool: u32, number: u32, span: SourceSpan) {
        let geometry_number = self.geometry_number(tool, number);
        let offset = self.turning_offset_mm(tool, [geometry_number, number], span);
        let Some(offset) = offset else { return };
        let length_mm = offset[Axis::Z.index()];
        let next = LengthCompensation {
            is_on: number != 0,
            number,
            geometry_number,
            negative: false,
            length_mm,
            offset,
            on_line: span.line,
        };
        if offset != self.state.length.offset && self.is_transform_on(span, "another tool offset") {
            return;
        }
        let before = self.state.length.offset;
        self.rebase(|state| state.length = next);
        self.offset_changed(&before);
    }

    /// Refuses a `T` word of a lathe with one or two digits where offsets are known: of four digits whose zeros are left out it is the
    /// offset of that number, of two it is the tool.
    pub(in super::super) fn check_short_tool_word(&mut self, tool: u32, span: SourceSpan) {
        let none = Position::default();
        let mut rows = self.tools.iter().chain(&self.state.coords.tables.tools);
        if rows.all(|row| row.geometry.unwrap_or_default() == none && row.wear == none) {
            return;
        }
        self.findings.push_with(code::CODE_AMBIGUOUS, |code| {
            let message = format!("T{tool} is T00{tool:02} (offset {tool}) on some controls, and tool {tool} on others");
            Finding::new(code, span, message)
                .with_value("number", f64::from(tool), "")
                .suggest(format!(
                    "write T{tool:02}{tool:02} for the tool with the offset of its number, T{tool:02}00 for the tool without one"
                ))
                .suggest(
                    "where T names both by two digits, set language.coordinates.two_digit_tools of the machine profile to true",
                )
        });
    }

    /// The row of tool offsets that the geometry of a lathe's tool is in, when a `T` word names that tool and an offset.
    pub(in super::super) const fn geometry_number(&self, tool: u32, number: u32) -> u32 {
        if self.settings.coordinates.geometry_by_tool && number != 0 { tool } else { number }
    }

    fn turning_offset_mm(
        &mut self,
        tool: u32,
        [geometry_number, number]: [u32; 2],
        span: SourceSpan,
    ) -> Option<Position> {
        let mut offset = Position::default();
        if number == 0 {
            return Some(offset);
        }
        let geometry = self.tool_row(geometry_number).and_then(|row| row.geometry);
        let is_table = self.tools.iter().chain(&self.state.coords.tables.tools).any(|row| row.geometry.is_some());
        // That the job does not have the tool at all is a finding of its own.
        let is_tool_known = self.tool_row(tool).is_some();
        if geometry.is_none() && is_table && is_tool_known {
            // Some tools are measured and this is not: its coordinates would be those of another point.
            self.findings.push_with(code::OFFSET_UNKNOWN, |code| {
                Finding::new(code, span, format!("the geometry of tool offset {geometry_number} is not known"))
                    .with_value("offset", f64::from(geometry_number), "")
                    .suggest("give the tool its offset, and the job the tool")
            });
            return None;
        }
        let wear = self.tool_row(number).map_or(Position::default(), |row| row.wear);
        for axis in TURNING_AXES.map(Axis::index) {
            offset[axis] = geometry.map_or(0.0, |geometry| geometry[axis]) + wear[axis];
        }
        Some(offset)
    }

    /// `G43.1` with the offsets of axes, and `G43.2` with those of a further tool.
    pub(in super::super) fn length_offset_words(&mut self, adds: bool, span: SourceSpan) {
        let mut offset = self.state.length.offset;
        if adds {
            let Some(word) = self.take(b'H') else {
                let message = "the number H of the tool whose offset is added is missing";
                return self.coord(code::LENGTH_NUMBER, span, message, "add H with the number of the tool");
            };
            let Some(number) = self.whole(&word) else { return };
            if self.block.letters & self.table.axis_letters & !self.used != 0 {
                let message = "G43.2 H with words of axes, which LinuxCNC 2.9 refuses";
                return self.coord(code::COORD_WORD, span, message, "write the move in a block of its own");
            }
            // The row 0 of LinuxCNC's table is the spindle.
            let number = if number == 0 { self.state.tool } else { number };
            let more = match number {
                0 => Some(Position::default()),
                _ => self.tool_row(number).map(|row| row.total().unwrap_or_default()),
            };
            let Some(more) = more else {
                return self.unknown_offset(number, span, "the tool is not in the table of tools");
            };
            for (offset, more) in offset.iter_mut().zip(more) {
                *offset += more;
            }
        } else {
            let axes = self.take_axes();
            if axes.is_empty() {
                let message = "G43.1 names no axis";
                return self.coord(code::COORD_WORD, span, message, "add the axes with their offsets, such as Z100");
            }
            axes.iter().for_each(|(axis, _, value)| offset[axis.index()] = *value);
        }
        let length_mm = offset[Axis::Z.index()];
        let number = self.state.length.number;
        let next = LengthCompensation {
            is_on: true,
            number,
            geometry_number: number,
            negative: false,
            length_mm,
            offset,
            on_line: span.line,
        };
        self.switch_length(next, span);
    }
}
