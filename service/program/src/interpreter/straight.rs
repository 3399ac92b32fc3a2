//! Straight moves by words of linear axes and a feed, as most blocks of long programs are: what such a block does beside that follows
//! from what is in force, which is looked at once for a run of them instead of at every block.
//!
//! Every other block may change anything and ends the run, but for an arc, which changes nothing that a run depends on. A block of a
//! run does what the steps of [`Execution`](super::execute::Execution) do with it, no more and no less.

use super::Interpreter;
use super::execute::{LEAST_RATE, MM_PER_INCH, counts_increments, scaled_length};
use super::motion::set_bits;
use crate::dialect::{FeedUnit, Group, Letter, Meaning, letter_bit};
use crate::finding::FindingMark;
use crate::state::{Motion, Phase};
use crate::{Axis, Feed, FindingLog, Move, MoveKind, Operation, OperationKind, PathControl, Position, Spindle};

/// The letters of an arc beside axes.
const ARC_LETTERS: u32 = letter_bit(b'F') | letter_bit(b'I') | letter_bit(b'J') | letter_bit(b'K') | letter_bit(b'R');

/// Whether blocks of linear axes are straight moves now.
#[derive(Clone, Debug, Default)]
pub(super) enum Straight {
    /// Nobody has looked since a block changed what is in force.
    #[default]
    Unknown,
    /// They are something else, or judged block by block.
    No,
    /// They are, and have this in common.
    Run(Common),
}

/// What straight moves of a run have in common.
#[derive(Clone, Debug)]
pub(super) struct Common {
    work_offset: Position,
    path_control: PathControl,
    spindle: Spindle,
    spindle_turns: bool,
}

impl Interpreter {
    /// Carries the present block out if it is a straight move of a run; nothing is done otherwise.
    #[inline]
    pub(super) fn moves_straight(
        &mut self,
        mark: &FindingMark,
        operations: &mut Vec<Operation>,
        findings: &FindingLog,
    ) -> bool {
        let letters = self.table.linear_letters;
        if findings.has_errors_since(mark) || !self.block.is_motion_of(letters | ARC_LETTERS) {
            self.straight = Straight::Unknown;
            return false;
        }
        let code = self.block.code(Group::Motion).map(|code| self.table.code(code.place).meaning);
        let kind = match (code, self.state.motion) {
            (Some(Meaning::Rapid), Motion::Rapid | Motion::Linear | Motion::Arc { .. }) | (None, Motion::Rapid) => {
                MoveKind::Rapid
            }
            (Some(Meaning::Linear), Motion::Rapid | Motion::Linear | Motion::Arc { .. }) | (None, Motion::Linear) => {
                MoveKind::Cutting
            }
            (Some(Meaning::Arc { .. }), _) | (None, Motion::Arc { .. }) => return false,
            _ => {
                self.straight = Straight::Unknown;
                return false;
            }
        };
        if matches!(self.straight, Straight::Unknown) {
            self.straight = self.common_of_straight().map_or(Straight::No, Straight::Run);
        }
        let is_done = self.block.letters & ARC_LETTERS & !letter_bit(b'F') == 0
            && self.block.letters & letters != 0
            && self.move_straight(kind, operations);
        if !is_done {
            self.straight = Straight::Unknown;
        }
        is_done
    }

    /// What straight moves have in common from here on; nothing where a step other than the move itself might do something.
    fn common_of_straight(&self) -> Option<Common> {
        let state = &self.state;
        let is_told_by_flow = state.flow.waits() || state.flow.has_jumped() || state.flow.calls_after_moves();
        let is_open = state.nurbs.is_some()
            || state.plane_sequence.is_some()
            || state.corner.is_some()
            || state.angle_line.is_some()
            || state.spline_exit.is_some()
            || state.skipping_data.is_some()
            || !self.corners.is_empty();
        let is_another_motion =
            state.drilling.cycle.is_some() || !state.tool_control.is_plain() || state.compensation.on.is_some();
        // Behind G40, until the tool is on the programmed path again.
        let is_beside = !state.compensator.is_off();
        let coords = &state.coords;
        let is_transformed =
            coords.transform.is_some() || coords.polar.is_some() || coords.awaits_absolute || coords.due.is_some();
        // Behind a tool change, until the length is called or judged.
        let keeps_length = state.machine.keeps_length;
        let is_as_usual = state.phase == Phase::Blocks
            && state.evidence.is_settled()
            && state.unread == 0
            && state.feed_unit != FeedUnit::InverseTime
            && !self.settings.plain_drawing_words;
        if is_told_by_flow
            || is_open
            || is_another_motion
            || is_beside
            || is_transformed
            || keeps_length
            || !is_as_usual
        {
            return None;
        }
        Some(Common {
            work_offset: coords.total,
            path_control: state.path_control,
            spindle: state.spindle(),
            spindle_turns: state.spindle_turns(),
        })
    }

    /// Moves to where the words of the block say, unless something is wrong with it.
    // Longer than most: nothing may be changed before everything was looked at, and a call here costs every block.
    #[inline]
    fn move_straight(&mut self, kind: MoveKind, operations: &mut Vec<Operation>) -> bool {
        let Straight::Run(common) = &self.straight else { return false };
        let state = &mut self.state;
        let written = match self.block.word(b'F') {
            Some(word) if word.number.value() < LEAST_RATE => return false,
            Some(word)
                if state.feed_unit == FeedUnit::PerRevolution
                    && counts_increments(self.settings.decimal_point, word) =>
            {
                return false;
            }
            word => word.map(|word| word.number.value()),
        };
        let in_mm = |written: f64| if state.inch { written * MM_PER_INCH } else { written };
        let rate = written.map_or(state.feed, in_mm);
        let feed = match (kind, state.feed_unit) {
            (MoveKind::Rapid, _) => Feed::PerMinute(0.0),
            (MoveKind::Cutting, FeedUnit::PerMinute) if rate > 0.0 => Feed::PerMinute(rate),
            (MoveKind::Cutting, FeedUnit::PerRevolution) if rate > 0.0 && common.spindle_turns => {
                Feed::PerRevolution(rate)
            }
            _ => return false,
        };
        let start = state.position;
        let mut end = start;
        let mut named = 0_u32;
        for place in set_bits(self.block.letters & self.table.linear_letters) {
            let (axis, increment) = match self.table.dialect.letters[place] {
                Letter::Axis(axis) => (axis, !state.absolute),
                Letter::Increment(axis) => (axis, true),
                _ => return false,
            };
            if named & (1 << axis.index()) != 0 {
                return false;
            }
            named |= 1 << axis.index();
            let mut value = scaled_length(self.settings.decimal_point, state.inch, self.block.slot(place));
            if axis == Axis::X && state.x_diameter {
                value *= 0.5;
            }
            let target = &mut end[axis.index()];
            *target = if increment { *target + value } else { value };
        }
        if let Some(written) = written {
            (state.feed, state.feed_as_written) = (rate, written);
            state.thread.forget_lead();
            (state.reported.feed, state.reported.lead) = (false, false);
        }
        if let Some(code) = self.block.code(Group::Motion) {
            state.motion_code = self.table.code(code.place).tenths as i16;
        }
        state.motion = if kind == MoveKind::Rapid { Motion::Rapid } else { Motion::Linear };
        state.sequence_number = self.block.sequence_number().or(state.sequence_number);
        state.position = end;
        if end != start {
            let span = self.block.span();
            state.moved_by = span;
            let (path_control, spindle, tool) = (common.path_control, common.spindle, state.tool);
            let work_offset = common.work_offset;
            let leads_xyz = self.table.dialect.is_linuxcnc;
            // In place, where a push would make the operation first and copy it then.
            operations.extend(core::iter::once_with(|| {
                let step = Move {
                    kind,
                    start,
                    end,
                    work_offset,
                    arc: None,
                    spline: None,
                    path_control,
                    feed,
                    leads_xyz,
                    spindle,
                    tool,
                    cycle: None,
                };
                Operation { span, kind: OperationKind::Move(step) }
            }));
        }
        true
    }
}
