//! Corners within the contours of LinuxCNC's cycles, where `A` and `C` are no axes: `A` puts an arc of that radius between a line
//! and the next one, tangent to both, `C` the chord of that arc.

use super::super::super::Interpreter;
use super::super::super::corner::geometry::{self, Joint, Misfit, Segment};
use super::super::super::corner::{Corner, CornerKind};
use super::super::contour::Piece;
use super::{ContourRun, Stage, Whereabouts};
use crate::compensation::geometry::Curve;
use crate::dialect::letter_bit;
use crate::{Finding, FindingLog, Plane, SourceSpan, code};

/// The words of corners.
const CORNER_LETTERS: u32 = letter_bit(b'A') | letter_bit(b'C');

impl Interpreter {
    /// Takes the corner words of a line of a contour, so that they move nothing.
    pub(super) fn take_corner_words(&mut self, findings: &mut FindingLog) {
        let letters = self.block.letters & CORNER_LETTERS;
        let reads =
            |run: &ContourRun| run.stage == Stage::Reading && matches!(run.request.contour, Whereabouts::Sub(_));
        if letters == 0 || self.block.unclear || !self.state.flow.contour.as_deref().is_some_and(reads) {
            return;
        }
        let word = *self.block.slot(letters.trailing_zeros() as usize);
        let span = self.block.word_span(&word);
        self.block.letters &= !letters;
        if letters == CORNER_LETTERS {
            return refuse(span, "one block has both A, a rounding, and C, a chamfer", findings);
        }
        let size_mm = self.with_execution(&mut Vec::new(), findings, |execution| execution.scaled(&word, true));
        let rounds = letters == letter_bit(b'A');
        if size_mm < 0.0 || size_mm == 0.0 && rounds {
            return refuse(span, "the size of a chamfer or a rounding must be positive", findings);
        }
        let kind = if rounds { CornerKind::Round(size_mm) } else { CornerKind::Chamfer(size_mm) };
        let corner = Corner { kind, direction: None, plane: Plane::Zx, span, inch: self.state.inch };
        if let Some(run) = &mut self.state.flow.contour {
            // A chamfer of no size is none.
            run.asked_corner = (size_mm > 0.0).then_some(corner);
        }
    }
}

impl ContourRun {
    /// Adds a move of the contour, behind the corner that waits for it.
    pub(super) fn push(&mut self, mut piece: Piece, findings: &mut FindingLog) {
        if let Some(corner) = self.corner.take()
            && let Some(last) = self.pieces.last_mut()
        {
            match joined(&last.curve, &corner, &piece.curve) {
                Ok([first, middle, next]) => {
                    (last.curve, piece.curve) = (first, next);
                    let middle = Piece { curve: middle, is_rapid: false, ..*last };
                    self.pieces.push(middle);
                }
                Err(message) => {
                    self.is_broken = true;
                    refuse(corner.span, message, findings);
                }
            }
        }
        self.pieces.push(piece);
        self.corner = self.asked_corner.take();
    }

    /// Behind a line of the contour: corner words of a line without a move are no corner.
    pub(super) fn check_asked_corner(&mut self, findings: &mut FindingLog) {
        if let Some(corner) = self.asked_corner.take() {
            self.is_broken = true;
            refuse(corner.span, "A and C stand in a block that moves", findings);
        }
    }

    /// Behind the last line of the contour: no corner waits for another move.
    pub(super) fn check_last_corner(&mut self, findings: &mut FindingLog) {
        if let Some(corner) = self.corner.take() {
            self.is_broken = true;
            refuse(corner.span, "no move follows in the contour", findings);
        }
    }
}

/// Two lines with a corner between them.
fn joined(first: &Curve, corner: &Corner, next: &Curve) -> Result<[Curve; 3], &'static str> {
    if first.circle.is_some() || next.circle.is_some() {
        return Err("it is not between two lines");
    }
    let (CornerKind::Round(radius_mm) | CornerKind::Chamfer(radius_mm)) = corner.kind;
    let line = |curve: &Curve| Segment::new(curve.from, curve.to, None);
    let joint = geometry::rounding(&line(first), &line(next), radius_mm).map_err(Misfit::message)?;
    let Some(Joint { from, to, arc: Some((center, clockwise)) }) = joint else {
        return Err("the next line goes straight on");
    };
    let is_left = |curve: &Curve| !geometry::is_same(curve.from, curve.to);
    let (first, next) = (Curve::line(first.from, from), Curve::line(to, next.to));
    if !is_left(&first) || !is_left(&next) {
        return Err("nothing is left of one of its lines");
    }
    let middle = match corner.kind {
        CornerKind::Chamfer(_) => Curve::line(from, to),
        CornerKind::Round(_) => Curve::arc(from, to, center, geometry::sweep(from, to, center, clockwise)),
    };
    Ok([first, middle, next])
}

#[cold]
fn refuse(span: SourceSpan, message: &str, findings: &mut FindingLog) {
    findings.push_with(code::CORNER, |code| {
        Finding::new(code, span, format!("the corner of the contour cannot be made: {message}"))
            .suggest("let two lines meet that are long enough for it, or write it as a block of G1, G2 or G3")
    });
}
