//! The blocks of a contour: which codes it may have, and the moves that are taken of them.

use super::super::super::Interpreter;
use super::super::contour::{MAX_PIECES, Piece};
use super::{ContourRun, place};
use crate::compensation::geometry::Curve;
use crate::dialect::{Group, Letter, Meaning};
use crate::{Axis, CompensationCommand, Finding, FindingLog, MoveKind, Operation, OperationKind, Plane, code};

impl Interpreter {
    /// Refuses codes that no contour has.
    pub(super) fn check_contour_block(&mut self, findings: &mut FindingLog) {
        let meaning = |group| self.block.code(group).map(|code| (self.table.code(code.place).meaning, code));
        let is_of_contour = |meaning: Meaning| {
            matches!(
                meaning,
                Meaning::Rapid
                    | Meaning::Linear
                    | Meaning::Arc { .. }
                    | Meaning::Dwell
                    | Meaning::ExactStop
                    | Meaning::AlreadySo
                    | Meaning::SpeedClamp
                    | Meaning::SpeedClampOrThreadCycle
            )
        };
        let groups = [Group::Motion, Group::NonModal, Group::Stop, Group::Units, Group::WorkOffset];
        let wrong = groups.into_iter().find_map(|group| {
            let (found, code) = meaning(group)?;
            (!is_of_contour(found)).then(|| self.block.code_span(code))
        });
        let Some(span) = wrong.filter(|_| !self.block.is_empty()) else { return };
        let Some(run) = &mut self.state.flow.contour else { return };
        run.is_broken = true;
        let line = run.span.line;
        findings.push_with(code::TURNING_CONTOUR, |code| {
            Finding::new(code, span, format!("this code is within the contour of the cycle of line {line}"))
                .with_value("line", f64::from(line), "")
                .suggest("write it before the contour or behind it: a contour has G0 to G3, G4, G96, G97, F and S")
        });
    }

    /// Takes the moves of a block of the contour.
    pub(super) fn take_contour(
        &mut self,
        is_first: bool,
        before: usize,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) {
        let named = [Axis::Z, Axis::X].map(|axis| {
            let letters = self.table.dialect.letters.iter().enumerate();
            letters.filter(|(_, letter)| letter.is_of(axis)).any(|(place, _)| self.block.letters & (1 << place) != 0)
        });
        let counts = self.counts_in_contour();
        let here = place(&self.state.position);
        let block_span = (!self.block.is_empty()).then(|| self.block.span());
        let waits = self.state.corner.is_some() || self.state.angle_line.is_some();
        let Some(run) = &mut self.state.flow.contour else { return };
        run.counts |= counts;
        // The contour of a subprogram begins with the first of its blocks that names an axis.
        let is_blocks = run.last.is_some();
        let is_first = if is_blocks { is_first } else { run.named == [false; 2] };
        if is_first && run.pieces.is_empty() {
            run.named = named;
        }
        let from = if run.is_finish() { operations.len() } else { before };
        for operation in &operations[before..] {
            run.take(operation, findings);
        }
        run.check_asked_corner(findings);
        let mut ends = None;
        for operation in operations.drain(from..) {
            if operation.kind == OperationKind::End {
                ends = Some(operation);
            }
        }
        operations.extend(ends);
        // A first block that ends where it starts is the move to the contour all the same.
        if is_first && run.pieces.is_empty() && named != [false; 2] && !waits {
            let span = block_span.unwrap_or(run.span);
            run.pieces.push(Piece { curve: Curve::line(here, here), span, is_rapid: true });
        }
    }
}

impl Interpreter {
    /// Whether a word of this block places X or Z by how far it is from where the tool is.
    fn counts_in_contour(&self) -> bool {
        let letters = self.table.dialect.letters.iter().enumerate();
        let mut counting = letters.filter(|(_, letter)| match letter {
            Letter::Increment(axis) => matches!(axis, Axis::X | Axis::Z),
            Letter::Axis(axis) => matches!(axis, Axis::X | Axis::Z) && !self.state.absolute,
            _ => false,
        });
        counting
            .any(|(place, _)| self.block.letters & (1 << place) != 0 && self.block.slot(place).number.value() != 0.0)
    }
}

impl ContourRun {
    /// Takes an operation of a block of the contour.
    fn take(&mut self, operation: &Operation, findings: &mut FindingLog) {
        // The finishing cycle of the same contour says the same of the same place.
        let mut refuse = |run: &mut Self, message: &'static str, cure: &'static str| {
            run.is_broken = true;
            findings.push_with(code::TURNING_CONTOUR, |code| {
                Finding::new(
                    code,
                    operation.span,
                    format!("the contour of the cycle of line {} {message}", run.span.line),
                )
                .with_value("line", f64::from(run.span.line), "")
                .suggest(cure)
                .ranked(message, 0.0)
            });
        };
        let cure = "write the contour with lines and arcs in X and Z";
        match &operation.kind {
            OperationKind::Move(step) => {
                let others = |axis: &Axis| !matches!(axis, Axis::X | Axis::Z);
                let curve = match step.arc {
                    Some(arc) => Curve::arc(place(&step.start), place(&step.end), arc.center, arc.sweep_rad),
                    None => Curve::line(place(&step.start), place(&step.end)),
                };
                let moves = |axis: Axis| step.start[axis.index()] != step.end[axis.index()];
                if moves(Axis::A) || moves(Axis::C) {
                    let cure = "write the contour with lines and arcs in X and Z; where A is the angle of a line and C a \
                                chamfer, set language.plain_drawing_words of the machine profile to true";
                    refuse(self, "turns A or C", cure);
                } else if Axis::ALL.into_iter().filter(others).any(moves) {
                    refuse(self, "moves another axis than X and Z", cure);
                } else if step.spline.is_some() || step.arc.is_some_and(|arc| arc.plane != Plane::Zx) {
                    refuse(self, "has a curve that is no arc in the plane of Z and X", cure);
                } else if self.pieces.len() >= MAX_PIECES {
                    self.is_cut = true;
                } else {
                    self.push(Piece { curve, span: operation.span, is_rapid: step.kind == MoveKind::Rapid }, findings);
                }
            }
            OperationKind::Thread(_) | OperationKind::Guided(_) => {
                refuse(self, "has a move that is no line and no arc", cure);
            }
            OperationKind::Compensation(CompensationCommand::On(mode)) => {
                self.left = Some(mode.left);
                if !self.is_finish() {
                    self.note_compensation(operation.span, findings);
                }
            }
            _ => {}
        }
    }
}
