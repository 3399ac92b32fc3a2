//! Probing moves: the whole travel is the path, as only the machine finds the contact.

use super::execute::Execution;
use super::motion::Frame;
use crate::code;
use crate::dialect::{FeedUnit, Flow, letter_bit};
use crate::state::Motion;
use crate::{Axis, Finding, MoveKind, SourceSpan};

impl Execution<'_> {
    /// `G31`, `G36`, `G37`, and `G38.2` to `G38.5`: a move at the feed.
    pub(super) fn probing_move(&mut self) {
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        let span = self.block.span();
        let is_fanuc = self.table.dialect.flow == Flow::MacroB;
        if is_fanuc && self.block.word(b'R').is_some_and(|word| [0.0, 1.0].contains(&word.number.value())) {
            // Whether the move accelerates (Mitsubishi).
            self.used |= letter_bit(b'R');
        }
        if axes == 0 && is_fanuc && !self.block.unclear {
            // The feed of a later one.
            return;
        }
        if axes == 0 {
            return self.probe_error(span, "a probing move names no axis");
        }
        if !self.state.tool_control.is_plain() {
            self.used |= axes;
            return self.probe_error(span, "probing under tool centre point control is not possible");
        }
        let end = self.target(axes, Frame::Work);
        let turns = Axis::ALL
            .into_iter()
            .any(|axis| axis.is_rotary() && end[axis.index()] != self.state.position[axis.index()]);
        if self.block.unclear {
            self.state.position = end;
            return;
        }
        let refusal = match () {
            () if turns => Some("rotary axes cannot move while probing"),
            () if self.state.feed_unit == FeedUnit::InverseTime => {
                Some("probing needs a feed per minute, not inverse time")
            }
            () if self.state.feed_unit == FeedUnit::PerRevolution && self.is_linuxcnc_dialect() => {
                Some("probing needs a feed per minute, not per revolution")
            }
            () if end == self.state.position && !self.is_probe_without_alarm() => {
                Some("the probing move has no travel")
            }
            () => None,
        };
        if let Some(message) = refusal {
            self.probe_error(span, message);
        } else if let Some(feed) = self.cutting_feed()
            && end != self.state.position
        {
            self.findings.push_with(code::PROBE_UNKNOWN, |code| {
                Finding::new(code, span, "where the probe finds its contact is not known: the whole travel is the path")
            });
            self.emit_move(MoveKind::Cutting, &end, None, feed);
        }
        self.state.probed = Some(end);
        self.state.position = end;
    }

    /// `G38.3` and `G38.5`, which raise no alarm: without a travel LinuxCNC takes the present place for their result.
    fn is_probe_without_alarm(&self) -> bool {
        self.state.motion == Motion::Probe && matches!(self.state.motion_code, 383 | 385)
    }

    #[cold]
    fn probe_error(&mut self, span: SourceSpan, message: &'static str) {
        self.findings.push_with(code::PROBE, |code| Finding::new(code, span, message));
    }
}
