//! Compensation of tool radius and nose (`G41`, `G42`): a stage behind the interpreter that offsets the contour.
//!
//! The interpreter says by [`OperationKind::Compensation`] when it is on; the stage takes these operations out, and every
//! move between them comes out as the path of the centre of the tool, or of the reference point of a turning tool. While it
//! is off, operations are not touched. Where a block ends depends on the block behind it, so that the stage holds one block
//! back; blocks without motion in the plane wait behind it.

mod contour;
mod distance;
pub(crate) mod geometry;
mod joint;
mod report;
#[cfg(test)]
mod tests;
mod window;

use serde::{Deserialize, Serialize};

use crate::{FindingLog, Operation, OperationKind, Plane, SourceSpan};

use contour::{Contour, Sink};

/// Switches the compensation of the tool radius.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum CompensationCommand {
    /// `G40`
    Off,
    /// `G41`, `G42`
    On(CompensationMode),
    /// A cycle begins that is not compensated: the last block ends as programmed, and nothing is compensated until it is on again.
    Suspend,
    /// Behind `G40`: the next move names the present programmed point in the plane, so that it goes there.
    Exit,
}

/// How the contour is compensated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CompensationMode {
    /// The tool is left of the path (`G41`), seen against the normal of the plane.
    pub left: bool,
    /// The plane of the contour.
    pub plane: Plane,
    /// The contour is in the coordinates of a tilted plane (`G68.2`), onto whose normal the tool axis is turned.
    pub tilted: bool,
    /// Radius of the tool or its nose, mm, not negative; 0 compensates nothing.
    pub radius_mm: f64,
    /// From the centre of the nose to the reference point of the tool, along the axes of the plane, mm; 0 for a mill.
    pub reference_mm: [f64; 2],
    /// How blocks are joined.
    pub rules: CompensationRules,
}

/// How the blocks of a compensated contour are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CompensationRules {
    /// As LinuxCNC does it: arcs about outside corners.
    LinuxCnc,
    /// As FANUC controls do it.
    Fanuc {
        /// Moves to the contour and from it.
        entry: CompensationEntry,
        /// How outside corners are passed.
        corner: CompensationCorner,
    },
}

/// How the tool gets to a compensated contour and away from it, as FANUC controls name it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CompensationEntry {
    /// Straight to the point beside the start of the first block behind it, and straight away from the end of the last.
    #[default]
    A,
    /// Around an outside corner between the entry and the first block, the exit and the last one.
    B,
    /// As A; where the compensation is switched on in a block without motion, by a move of its own at right angles to the
    /// first block.
    C,
}

/// How the tool gets around an outside corner of a compensated contour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CompensationCorner {
    /// Along the tangents, cut off beyond a right angle.
    #[default]
    Linear,
    /// Along an arc about the corner.
    Circular,
}

/// The cure of what cannot be done while the tool still stands beside a contour behind `G40`.
pub(crate) const LEAVE_FIRST: &str = "move in the plane with the G40, straight and away from the part, before it";

/// The stage. It is its whole state, too.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Compensator {
    contour: Option<Box<Contour>>,
}

impl Compensator {
    /// Whether every operation but [`OperationKind::Compensation`] passes through as it is.
    #[must_use]
    #[inline]
    pub const fn is_off(&self) -> bool {
        self.contour.is_none()
    }

    /// The plane of the contour that is in work.
    pub(crate) fn plane(&self) -> Option<Plane> {
        self.contour.as_ref().map(|contour| contour.plane())
    }

    /// Takes an operation; appends what can be carried out now, in order.
    pub fn push(&mut self, operation: Operation, out: &mut Vec<Operation>, findings: &mut FindingLog) {
        if let OperationKind::Compensation(command) = operation.kind {
            return self.switch(command, operation.span, out, findings);
        }
        let Some(contour) = &mut self.contour else {
            // To the programmed point, where the tool is already.
            if !operation.is_nothing() {
                out.push(operation);
            }
            return;
        };
        if contour.take(operation, &mut Sink { out, findings }) {
            self.contour = None;
        }
    }

    /// Appends what is held back, where operations end without [`OperationKind::End`].
    pub fn finish(&mut self, out: &mut Vec<Operation>, findings: &mut FindingLog) {
        if let Some(mut contour) = self.contour.take() {
            contour.stand(&mut Sink { out, findings });
        }
    }

    /// Passes the operations from the `from`th on through the stage.
    #[inline]
    pub fn apply(&mut self, operations: &mut Vec<Operation>, from: usize, findings: &mut FindingLog) {
        let switches = |operation: &Operation| matches!(operation.kind, OperationKind::Compensation(_));
        if self.is_off() && !operations[from..].iter().any(switches) {
            return;
        }
        self.apply_all(operations, from, findings);
    }

    fn apply_all(&mut self, operations: &mut Vec<Operation>, from: usize, findings: &mut FindingLog) {
        // One operation, as most lines give, needs no list of its own.
        if operations.len() == from + 1
            && let Some(operation) = operations.pop()
        {
            return self.push(operation, operations, findings);
        }
        for operation in operations.split_off(from) {
            self.push(operation, operations, findings);
        }
    }

    fn switch(
        &mut self,
        command: CompensationCommand,
        span: SourceSpan,
        out: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) {
        match (command, &mut self.contour) {
            (CompensationCommand::On(mode), None) if mode.radius_mm > 0.0 => {
                self.contour = Some(Box::new(Contour::new(mode, span, [0.0; 2])));
            }
            (CompensationCommand::On(mode), Some(contour)) if mode.radius_mm > 0.0 && contour.is_leaving() => {
                contour.stand(&mut Sink { out, findings });
                self.contour = Some(Box::new(Contour::new(mode, span, contour.displacement())));
            }
            // Switching on what is on is judged where it is read.
            (CompensationCommand::On(_), _) | (_, None) => {}
            (CompensationCommand::Exit, Some(contour)) => contour.name_exit(),
            (CompensationCommand::Off, Some(contour)) => {
                if contour.leave(span, &mut Sink { out, findings }) {
                    self.contour = None;
                }
            }
            (CompensationCommand::Suspend, Some(contour)) => {
                if contour.suspend(span, &mut Sink { out, findings }) {
                    self.contour = None;
                }
            }
        }
    }
}
