//! Lines with an angle: the coordinate that is missing follows from it, or the common point of two lines.

use serde::{Deserialize, Serialize};

use super::corner::Corner;
use super::execute::Execution;
use super::motion::Frame;
use crate::block::Word;
use crate::code;
use crate::coordinates::direction;
use crate::dialect::letter_bit;
use crate::state::Motion;
use crate::{Finding, MoveKind, Operation, OperationKind, SourceSpan};

/// Lines whose directions differ by less, as a sine, are parallel.
const PARALLEL: f64 = 1e-9;

/// A line with an angle whose end the next line says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct AngleLine {
    span: SourceSpan,
    angle_deg: f64,
    corner: Option<Corner>,
}

impl Execution<'_> {
    /// The angle word of the block: `,A`, or `A` where the profile says so.
    #[inline]
    pub(super) fn angle_word(&mut self) -> Option<Word> {
        if self.block.has_comma_words()
            && let Some(word) = self.block.comma_word(b'A')
        {
            return Some(*word);
        }
        if self.settings.plain_drawing_words && self.state.motion == Motion::Linear { self.take(b'A') } else { None }
    }

    /// A straight cut with an angle from the first axis of the plane.
    #[cold]
    pub(super) fn angle_motion(&mut self, word: Word, axes: u32) {
        self.commas_used = true;
        let span = self.block.word_span(&word);
        let (first, second) = self.state.plane.axes();
        let named = self.named_axes(axes);
        let only_in_plane = named.without(first).without(second).is_empty();
        if self.state.coords.polar.is_some() {
            self.state.position = self.target(axes, Frame::Work);
            return self.angle_error(
                span,
                "an angle of a line in polar coordinates (G16)",
                "end polar coordinates with G15 before it",
            );
        }
        if self.state.motion != Motion::Linear || !only_in_plane || !self.state.tool_control.is_plain() {
            self.state.position = self.target(axes, Frame::Work);
            return self.angle_error(
                span,
                "an angle belongs to a line (G1) in the plane",
                "write G1 in the block, and other axes in one of their own",
            );
        }
        let angle_deg = self.scaled(&word, false);
        let corner = self.corner_words(axes);
        let mut end = self.target(axes, Frame::Work);
        let start = self.state.position;
        let (along, across) = (first.index(), second.index());
        let [cosine, sine] = direction(angle_deg);
        match (named.contains(first), named.contains(second)) {
            (false, false) => {
                if self.state.angle_line.is_some() {
                    return self.angle_error(
                        span,
                        "the end of the line before it is not known yet",
                        "write both coordinates of this line's end",
                    );
                }
                self.state.angle_line = Some(Box::new(AngleLine { span: self.block.span(), angle_deg, corner }));
                return;
            }
            (true, false) if cosine.abs() > PARALLEL => {
                end[across] = start[across] + (end[along] - start[along]) * sine / cosine;
            }
            (false, true) if sine.abs() > PARALLEL => {
                end[along] = start[along] + (end[across] - start[across]) * cosine / sine;
            }
            (true, true) => {
                if !self.meet(angle_deg, end[along], end[across], span) {
                    self.state.position = end;
                    return;
                }
            }
            _ => {
                self.state.position = end;
                return self.angle_error(
                    span,
                    "the line never reaches the coordinate that is given",
                    "write the other coordinate, or an angle that is not along the other axis",
                );
            }
        }
        if let Some(feed) = self.cutting_feed() {
            self.emit_with_corner(corner, |this| this.emit_move(MoveKind::Cutting, &end, None, feed));
        }
        self.state.position = end;
    }

    /// The first of two lines, to the point that it has in common with this block's; whether there is one.
    fn meet(&mut self, angle_deg: f64, along: f64, across: f64, span: SourceSpan) -> bool {
        let Some(line) = self.state.angle_line.take() else {
            self.angle_error(
                span,
                "both coordinates and an angle say the same thing twice",
                "remove the angle, or one coordinate",
            );
            return false;
        };
        let (first, second) = self.state.plane.axes();
        let (d, e) = (direction(line.angle_deg), direction(angle_deg));
        let determinant = d[0] * e[1] - d[1] * e[0];
        if determinant.abs() <= PARALLEL {
            self.angle_error(
                span,
                "the two lines are parallel, so that they have no point in common",
                "write the end of the first line, or another angle",
            );
            return false;
        }
        let start = self.state.position;
        let (to_end, to_side) = (along - start[first.index()], across - start[second.index()]);
        let distance = (to_end * e[1] - to_side * e[0]) / determinant;
        let mut point = start;
        point[first.index()] += d[0] * distance;
        point[second.index()] += d[1] * distance;
        if let Some(feed) = self.cutting_feed() {
            let step = self.new_move(MoveKind::Cutting, point, feed);
            self.emit_with_corner(line.corner, |this| {
                this.operations.push(Operation { span: line.span, kind: OperationKind::Move(step) });
            });
        }
        self.state.position = point;
        true
    }

    /// Whether a line with an angle waits for its end and this block does not say it, which is then reported.
    #[cold]
    pub(super) fn check_angle_line(&mut self) {
        if let Some(line) = self.state.angle_line.take() {
            unfinished(&line, self.findings);
        }
    }

    #[cold]
    fn angle_error(&mut self, span: SourceSpan, message: &'static str, cure: &'static str) {
        self.used |= letter_bit(b'R');
        self.findings.push_with(code::CORNER, |code| Finding::new(code, span, message).suggest(cure));
    }
}

/// Reports a line whose end no block says.
#[cold]
pub(super) fn unfinished(line: &AngleLine, findings: &mut crate::FindingLog) {
    findings.push_with(code::CORNER, |code| {
        Finding::new(
            code,
            line.span,
            "a line with an angle alone ends where the next line begins, which must have an angle and its end",
        )
        .suggest(
            "let a line with an angle and both coordinates of its end follow at once, or write one coordinate here",
        )
    });
}
