//! Cycles along a contour under compensation of the nose (FANUC, Haas). `G41` and `G42` may stand before the cycle or in its contour. The
//! offset is out of force where the cycle begins and ends: finishing switches it on in the first block of the contour and off in the
//! way back, roughing ignores it. Behind the cycle it is on again with the next move.

use super::super::super::Interpreter;
use super::super::super::execute::Execution;
use super::super::request::Whereabouts;
use super::ContourRun;
use crate::state::Roughed;
use crate::{CompensationCommand, Finding, FindingLog, Operation, OperationKind, SourceSpan, code};

/// Switches the stage behind the interpreter.
const fn switch(span: SourceSpan, command: CompensationCommand) -> Operation {
    Operation { span, kind: OperationKind::Compensation(command) }
}

impl ContourRun {
    /// In the block of the cycle: takes the compensation that is on out of force, or begins the contour with it.
    pub(in super::super) fn suspend_compensation(&mut self, execution: &mut Execution<'_>) {
        if let Whereabouts::Blocks { first, last } = self.request.contour
            && let Some(roughed) = execution.state.turning.roughed
            && roughed.blocks == [first, last]
        {
            self.roughed = Some((roughed.facing, roughed.outward));
        }
        let Some(on) = execution.state.compensation.on else { return };
        self.left = Some(on.mode.left);
        execution.operations.push(switch(self.span, CompensationCommand::Suspend));
        if self.is_finish() {
            execution.operations.push(switch(self.span, CompensationCommand::On(on.mode)));
        } else if on.mode.radius_mm > 0.0 {
            self.note_compensation(self.span, execution.findings);
        }
    }

    /// Says once that the passes of a roughing cycle ignore the compensation.
    pub(super) fn note_compensation(&mut self, span: SourceSpan, findings: &mut FindingLog) {
        if std::mem::replace(&mut self.is_compensated, true) {
            return;
        }
        findings.push_with(code::TURNING_COMPENSATION, |code| {
            let message = format!(
                "the compensation of the nose acts in the finishing cycle; the passes of line {} ignore it",
                self.span.line
            );
            Finding::new(code, span, message)
        });
    }
}

impl Interpreter {
    /// Behind the contour of a finishing cycle: the way back is that of the programmed point.
    pub(super) fn leave_contour(&self, run: &ContourRun, operations: &mut Vec<Operation>) {
        if self.suspends(run) {
            operations.push(switch(run.span, CompensationCommand::Off));
        }
    }

    /// Behind a cycle: the compensation is on again, with the next move.
    pub(super) fn resume_compensation(&self, run: &ContourRun, operations: &mut Vec<Operation>) {
        if let Some(on) = self.state.compensation.on.filter(|_| self.suspends(run)) {
            operations.push(switch(run.span, CompensationCommand::On(on.mode)));
        }
    }

    /// Whether a cycle takes the compensation that is on out of force.
    fn suspends(&self, run: &ContourRun) -> bool {
        self.state.compensation.on.is_some()
            && !self.table.dialect.is_linuxcnc
            && !matches!(run.request.contour, Whereabouts::Sub(_))
    }

    /// Remembers on which side of its contour a roughing cycle found the stock.
    pub(super) fn note_side(&mut self, run: &ContourRun, outward: Option<(bool, f64)>) {
        if let (Whereabouts::Blocks { first, last }, Some((facing, outward))) = (run.request.contour, outward) {
            self.state.turning.roughed = Some(Roughed { blocks: [first, last], facing, outward });
        }
    }
}
