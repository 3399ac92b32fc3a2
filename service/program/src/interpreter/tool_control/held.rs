//! Axes that only the machine knows the places of, as the coordinates have changed and no word has placed them since.

use super::super::corner::Corner;
use super::super::execute::Execution;
use crate::code;
use crate::state::Motion;
use crate::{Axis, AxisSet, Finding, MoveKind, Position, SourceSpan, ToolGuide};

impl Execution<'_> {
    /// Whether a straight move to `end` moves nothing. Behind words that place an axis that was held, only the machine knows. Along a
    /// contour, where a block that moves nothing is none of it, what rests is known although other axes are held.
    pub(in super::super) fn is_still(&self, end: &Position, held_before: AxisSet) -> bool {
        let nothing_is_placed =
            held_before.is_empty() || self.is_on_contour() && held_before == self.state.tool_control.held;
        nothing_is_placed && !self.is_move(end)
    }

    /// The chamfer or the rounding behind a guided move, where words with a comma ask for one.
    pub(super) fn guided_corner(
        &mut self,
        guide: ToolGuide,
        kind: MoveKind,
        axes: u32,
        held_before: AxisSet,
    ) -> Option<Corner> {
        let has_path = matches!(guide, ToolGuide::Plane | ToolGuide::Axes) && kind == MoveKind::Cutting;
        let is_curve = matches!(self.state.motion, Motion::Linear | Motion::Arc { .. });
        if !self.block.has_comma_words() || !has_path || !is_curve {
            return None;
        }
        let words = [b'C', b'R', b'A'].map(|letter| self.block.comma_word(letter).copied());
        let ([Some(word), _, None] | [None, Some(word), None]) = words else { return None };
        let corner = self.corner_words(axes);
        if corner.is_some() && held_before.meets(AxisSet::LINEAR) && !self.state.is_plane_refused() {
            self.held_start(self.block.word_span(&word));
            return None;
        }
        corner
    }

    /// A word of an axis that only the machine knows the place of: an absolute one places it.
    #[cold]
    pub(in super::super) fn place_held(&mut self, axis: Axis, increment: bool, value: f64, span: SourceSpan) {
        let held = &mut self.state.tool_control.held;
        if !held.contains(axis) {
            return;
        }
        if !increment {
            *held = held.without(axis);
        } else if value != 0.0 {
            self.findings.push_with(code::TOOL_CONTROL_HELD, |code| {
                let letter = axis.letter();
                let message = format!(
                    "{letter} by {value} from a place that the program does not know: the coordinates have changed \
                     with the tool centre point control or a tilted plane"
                );
                Finding::new(code, span, message)
                    .with_value("increment", value, if axis.is_rotary() { "deg" } else { "mm" })
                    .suggest(format!("place {letter} with an absolute word first"))
            });
        }
    }

    /// Reports a curve, a corner or a cycle that starts from a place that only the machine knows.
    pub(in super::super) fn held_start(&mut self, span: SourceSpan) {
        self.findings.push_with(code::TOOL_CONTROL_HELD, |code| {
            let message = "an arc, a spline, a corner, a thread or a drilling cycle from a place that the program does not know: the \
                           coordinates have changed with the tool centre point control or a tilted plane";
            Finding::new(code, span, message).suggest("place every axis with G0 or G1 first")
        });
    }
}
