//! Where a block ends: its axis words, absolute or incremental, in the coordinates that are in force.

use super::super::execute::Execution;
use super::{Frame, set_bits};
use crate::code;
use crate::dialect::{Letter, letter_bit};
use crate::state::ToolMode;
use crate::{Axis, Finding, Position, SourceSpan};

/// The letters in whose place polar words of LinuxCNC are.
const PLANE_LETTERS: u32 = letter_bit(b'X') | letter_bit(b'Y');

impl Execution<'_> {
    /// The position after the axis words in the mask `axes`, which are used by this.
    #[inline]
    pub(in crate::interpreter) fn target(&mut self, mut axes: u32, frame: Frame) -> Position {
        if self.state.machine.keeps_length && frame == Frame::Work && axes & letter_bit(b'Z') != 0 {
            self.check_kept_length();
        }
        self.show_by_words(axes);
        let more = self.state.coords.due.is_some().then(|| self.take_up_due(axes, frame));
        let coords = &self.state.coords;
        let is_plain = frame == Frame::Work && coords.polar.is_none() && !coords.awaits_absolute;
        let mut end = self.state.position;
        if let Some(words) = self.block.polar().copied() {
            self.used |= axes & PLANE_LETTERS;
            self.place_polar(&words, &mut end);
            axes &= !PLANE_LETTERS;
        }
        if is_plain && self.state.tool_control.held.is_empty() {
            self.plain_target(axes, &mut end);
        } else {
            self.transformed_target(axes, frame, &mut end);
        }
        for (value, more) in end.iter_mut().zip(more.unwrap_or_default()) {
            *value += more;
        }
        end
    }

    /// Places the axes of the words where these are work coordinates, and the program knows where every axis is.
    #[inline]
    fn plain_target(&mut self, axes: u32, end: &mut Position) {
        self.used |= axes;
        let mut named = 0u32;
        for place in set_bits(axes) {
            let letter = self.table.dialect.letters[place];
            let (axis, increment) = match letter {
                Letter::Axis(axis) => (axis, !self.state.absolute),
                Letter::Increment(axis) => (axis, true),
                _ => continue,
            };
            let word = self.block.slot(place);
            let mut value = if axis == Axis::X { self.radius(word) } else { self.scaled(word, letter.is_length()) };
            if named & (1 << axis.index()) != 0 {
                self.named_twice(place);
            }
            named |= 1 << axis.index();
            if axis.is_rotary() && !increment {
                value = self.rolled(axis, value, Frame::Work, place);
            }
            let target = &mut end[axis.index()];
            *target = if increment { *target + value } else { value };
        }
    }

    #[cold]
    fn named_twice(&mut self, place: usize) {
        let word = *self.block.slot(place);
        self.word_conflict(&word, "the block has both an absolute and an incremental word for this axis");
    }

    fn transformed_target(&mut self, axes: u32, frame: Frame, end: &mut Position) {
        let mut named = 0u32;
        self.used |= axes;
        let mut axes = axes;
        if self.state.coords.awaits_absolute {
            self.check_absolute(axes);
        }
        if frame == Frame::Work && self.state.coords.polar.is_some() {
            axes = self.polar_target(axes, end);
        }
        // Machine positions are behind every transformation.
        let mut machine =
            (frame == Frame::Machine && self.state.coords.transform.is_some()).then(|| self.machine_position());
        for place in set_bits(axes) {
            let letter = self.table.dialect.letters[place];
            let (axis, increment) = match letter {
                Letter::Axis(axis) => (axis, !self.state.absolute && frame == Frame::Work),
                Letter::Increment(axis) => (axis, true),
                _ => continue,
            };
            let word = self.block.slot(place);
            let value = if axis == Axis::X { self.radius(word) } else { self.scaled(word, letter.is_length()) };
            if named & (1 << axis.index()) != 0 {
                self.named_twice(place);
            }
            named |= 1 << axis.index();
            let value = if axis.is_rotary() && !increment { self.rolled(axis, value, frame, place) } else { value };
            if !self.state.tool_control.held.is_empty() {
                let span = self.block.word_span(self.block.slot(place));
                self.place_held(axis, increment, value, span);
            }
            if let Some(machine) = &mut machine {
                machine[axis.index()] = value;
                continue;
            }
            let target = &mut end[axis.index()];
            if increment {
                *target += value;
            } else if frame == Frame::Machine {
                *target = value - self.machine_offset()[axis.index()];
            } else {
                *target = value;
            }
        }
        if let Some(machine) = machine {
            *end = self.state.coords.programmed(&machine);
        }
    }

    /// The angle that an absolute word of an axis that rolls over means; others mean what they say.
    #[cold]
    fn rolled(&mut self, axis: Axis, value: f64, frame: Frame, place: usize) -> f64 {
        if !self.settings.coordinates.rolls_over(axis) {
            return value;
        }
        let span = self.block.word_span(self.block.slot(place));
        if self.state.tool_control.held.contains(axis) {
            let message = format!("{} rolls over, but only the machine knows where it is", axis.letter());
            let letter = axis.letter();
            let first = match self.state.tool_control.mode {
                ToolMode::Off => "",
                ToolMode::Plane => "cancel the plane with G69, then ",
                ToolMode::Angles | ToolMode::Vectors => "switch the tool centre point control off with G49, then ",
            };
            let cure = format!("{first}send it to its reference position with G91 G28 {letter}0, and go on in G90");
            self.coord(code::ROLL_OVER, span, message, cure);
            return value;
        }
        let offset = if frame == Frame::Machine { self.machine_offset()[axis.index()] } else { 0.0 };
        let present = self.state.position[axis.index()] + offset;
        if self.table.dialect.is_linuxcnc && offset != 0.0 {
            self.wraps_under_offset(axis, value, [present, offset], span);
            return value;
        }
        let turned = if self.table.dialect.is_linuxcnc {
            wrapped(present, value, self.block.slot(place).number.is_negative())
        } else {
            shorter_turn(present, value)
        };
        match turned {
            Ok(rolled) => rolled,
            Err(message) => {
                let message = format!("{}{value}: {message}", axis.letter());
                let cure = "go there in two moves, or by an incremental one";
                self.findings.push_with(code::ROLL_OVER, |code| {
                    Finding::new(code, span, message).with_value("present", present, "deg").suggest(cure)
                });
                value
            }
        }
    }

    /// Refuses a machine position of an axis that wraps under an offset. LinuxCNC takes the direction and the turn of
    /// such a word from the work position, so that the axis does not end at the angle of the word.
    #[cold]
    fn wraps_under_offset(&mut self, axis: Axis, value: f64, [present, offset]: [f64; 2], span: SourceSpan) {
        let letter = axis.letter();
        let message = format!(
            "G53 {letter}{value}: {letter} wraps, and LinuxCNC does not reach this angle under an offset of {letter}"
        );
        let cure = format!(
            "go there by an incremental move, in G91 and without G53, or take the offset of {letter} away before this block: \
             that of G92 with G92.1, that of the tool with G49, that of the coordinate system with G10 L2 P0 {letter}0"
        );
        self.findings.push_with(code::ROLL_OVER, |code| {
            Finding::new(code, span, message)
                .with_value("present", present, "deg")
                .with_value("offset", offset, "deg")
                .suggest(cure)
        });
    }
}

/// Half a turn is as far in one direction as in the other, within this, degrees.
const HALF_TURN_TOLERANCE_DEG: f64 = 1e-9;

/// Where an axis of LinuxCNC that wraps goes for an absolute word, whose sign is the direction, also that of a zero.
///
/// # Errors
/// Why it goes nowhere.
fn wrapped(present: f64, value: f64, is_negative: bool) -> Result<f64, &'static str> {
    if value.abs() >= 360.0 {
        return Err("an axis that wraps takes less than a full turn");
    }
    let rolled = value.abs() + (present / 360.0).floor() * 360.0;
    Ok(match is_negative {
        false if rolled < present => rolled + 360.0,
        true if rolled > present => rolled - 360.0,
        _ => rolled,
    })
}

/// Where an axis that rolls over comes to an angle by the shorter way.
///
/// # Errors
/// Why neither way is the shorter one.
pub(in crate::interpreter) fn shorter_turn(present: f64, value: f64) -> Result<f64, &'static str> {
    let ahead = (value - present).rem_euclid(360.0);
    if (ahead - 180.0).abs() < HALF_TURN_TOLERANCE_DEG {
        return Err("it is half a turn away, so that both directions are equally short");
    }
    Ok(present + if ahead > 180.0 { ahead - 360.0 } else { ahead })
}
