//! The passes of a cycle along a contour, handed on a few moves at a time.

use super::super::super::{Interpreter, LineOutcome};
use super::super::passes::{self, Step};
use super::{ContourRun, Whereabouts};
use crate::state::Motion;
use crate::{ArcGeometry, Axis, Feed, Move, MoveKind, Operation, OperationKind, PathControl, Plane};

/// Moves that are handed on at once.
const CHUNK: usize = 64;

impl Interpreter {
    /// Hands on the next moves of the passes.
    #[cold]
    pub(in super::super::super) fn cut_contour(&mut self, operations: &mut Vec<Operation>) -> LineOutcome {
        let Some(mut run) = self.state.flow.contour.take() else { return LineOutcome::Elsewhere };
        let steps = self.steps.take().unwrap_or_else(|| {
            // The same moves as before the snapshot from which this interpreter was restored.
            passes::plan(&run.request, run.contour()).map(|plan| plan.steps).unwrap_or_default().into()
        });
        let from = run.done as usize;
        let to = steps.len().min(from + CHUNK);
        for step in &steps[from.min(to)..to] {
            self.cut_step(&run, step, operations);
        }
        self.state.flow.moved();
        run.done = to as u32;
        if to < steps.len() {
            self.steps = Some(steps);
            self.state.flow.contour = Some(run);
            return LineOutcome::Elsewhere;
        }
        self.resume_compensation(&run, operations);
        if let (Whereabouts::Sub(_), Some(step)) = (run.request.contour, steps.last()) {
            // LinuxCNC goes on with the motion code of the last move.
            self.state.motion = match step.curve.circle {
                Some(circle) => Motion::Arc { clockwise: circle.is_clockwise() },
                None if step.is_rapid => Motion::Rapid,
                None => Motion::Linear,
            };
        }
        LineOutcome::Elsewhere
    }

    fn cut_step(&mut self, run: &ContourRun, step: &Step, operations: &mut Vec<Operation>) {
        // LinuxCNC counts the move to the contour as one of its blocks.
        let behind = usize::from(!matches!(run.request.contour, Whereabouts::Sub(_)));
        let span =
            step.block.and_then(|block| run.pieces.get(block as usize + behind)).map_or(run.span, |piece| piece.span);
        let [z, x] = step.curve.to;
        let start = self.state.position;
        let mut end = start;
        (end[Axis::Z.index()], end[Axis::X.index()]) = (z, x);
        let arc = step.curve.circle.map(|circle| ArcGeometry {
            plane: Plane::Zx,
            center: circle.center,
            clockwise: circle.is_clockwise(),
            sweep_rad: circle.sweep_rad,
        });
        let follows = step.block.is_some();
        let state = &self.state;
        let kind = OperationKind::Move(Move {
            kind: if step.is_rapid { MoveKind::Rapid } else { MoveKind::Cutting },
            start,
            end,
            work_offset: state.coords.total,
            arc,
            spline: None,
            // Passes go through their corners exactly; the contour is cut as the program says.
            path_control: if follows { state.path_control } else { PathControl::ExactPath },
            feed: if step.is_rapid { Feed::PerMinute(0.0) } else { run.request.feed.unwrap_or(Feed::PerMinute(0.0)) },
            leads_xyz: false,
            spindle: state.spindle(),
            tool: state.tool,
            cycle: None,
        });
        operations.push(Operation { span, kind });
        self.state.position = end;
    }
}
