//! Looking ahead over a cut, for the inverse solution that it starts with.
//!
//! The solution is free where a rapid tilts the tool, and where the tool leaves a pole, in which the first rotary axis may
//! turn at rest. What has to be known there are the directions up to the next such rapid. The frame reads the
//! program on for them from where the pipeline is, by an interpreter and a thinning stage of its own, and keeps nothing of it:
//! what was examined is read again when its turn comes. So the choice is a function of the program's bytes, and no part of the state.

use std::sync::Arc;

use feedwave_motion::kinematics::vector::{Vec3, angle};
use feedwave_motion::kinematics::{BranchPreference, CutFailure, CutSearch, Kinematics, KinematicsError};
use feedwave_program::{Axis, GuidedMove, MoveKind, Operation, OperationKind, Position, ToolGuide};
use serde::{Deserialize, Serialize};

/// Most directions that are examined ahead.
pub(crate) const MAX_DIRECTIONS: u64 = 10_000;

/// Directions that make no difference to the rotary axes, rad.
pub(crate) const SAME_DIRECTION_RAD: f64 = 1e-7;

/// A cut that is examined ahead.
#[derive(Clone, Debug)]
pub(crate) struct Ahead {
    pub(crate) kinematics: Arc<Kinematics>,
    pub(crate) search: CutSearch,
    pub(crate) preferred: BranchPreference,
    pub(crate) tool_length_mm: Option<f64>,
    pub(crate) work_offset: Position,
    /// The direction before.
    pub(crate) direction: Vec3,
    /// Line from which the choice holds.
    pub(crate) line: u32,
    /// Lines of the furthest failures.
    pub(crate) failed_lines: [u32; 2],
    /// The cut has come to its end.
    pub(crate) ended: bool,
}

/// The start of a cut.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Chosen {
    /// Values of the rotary axes, rad.
    pub(crate) start_rad: [f64; 2],
    pub(crate) cut: CutNote,
}

/// What is known of a cut from the look-ahead, for the findings within it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct CutNote {
    /// Line from which the choice holds.
    pub(crate) line: u32,
    /// Where the other solution leaves its range.
    pub(crate) other: Option<OtherSolution>,
}

/// How the other inverse solution fares.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct OtherSolution {
    /// Line in which it leaves its range.
    pub(crate) line: u32,
    pub(crate) axis: Axis,
    /// Where the axis would be, degrees.
    pub(crate) value_deg: f64,
    /// Its range, degrees.
    pub(crate) range_deg: [f64; 2],
}

impl Ahead {
    /// The next direction.
    pub(crate) fn push(&mut self, direction: Vec3, line: u32) {
        let at = self.search.count();
        self.search.push(&self.kinematics, direction);
        self.direction = direction;
        for (failed_line, failure) in self.failed_lines.iter_mut().zip(self.search.failed()) {
            if failure.is_some_and(|failure| failure.at == at) {
                *failed_line = line;
            }
        }
    }

    /// Looks at an operation.
    pub(crate) fn operation(&mut self, operation: &Operation) {
        match &operation.kind {
            OperationKind::Guided(guided) => self.guided(guided, operation.span.line),
            OperationKind::Move(_) | OperationKind::Thread(_) | OperationKind::End => self.ended = true,
            _ => {}
        }
    }

    fn guided(&mut self, guided: &GuidedMove, line: u32) {
        let is_same_setup = guided.tool_length_mm == self.tool_length_mm && guided.step.work_offset == self.work_offset;
        let ToolGuide::Vector { end, .. } = guided.guide else { return self.ended = true };
        let turned = end.filter(|&end| angle(end, self.direction) > SAME_DIRECTION_RAD);
        let is_free = guided.step.kind == MoveKind::Rapid && turned.is_some();
        self.ended |= is_free || !is_same_setup;
        if let Some(direction) = turned.filter(|_| !self.ended) {
            self.push(direction, line);
        }
    }

    /// Whether the choice is made, whatever follows.
    pub(crate) fn is_settled(&self) -> bool {
        let search = &self.search;
        self.ended || search.alive() == 1 || search.has_failed() || search.count() >= MAX_DIRECTIONS
    }

    /// The start as far as it is known.
    pub(crate) fn chosen(&self) -> Chosen {
        let (start_rad, solution) = match self.search.chosen(&self.kinematics, self.preferred) {
            Ok(start) => (start.start_rad, None),
            // The one that gets furthest says in its place why not.
            Err(failure) => (failure.start_rad, Some(failure)),
        };
        let is_other = |failure: &CutFailure| solution.is_none_or(|own| own != *failure);
        let others = self.search.failed().iter().zip(self.failed_lines).filter_map(|(failure, line)| {
            let failure = failure.filter(is_other)?;
            let KinematicsError::OutOfRange { axis, value_rad, range_rad } = failure.reason else { return None };
            let (value_deg, range_deg) = (value_rad.to_degrees(), range_rad.map(f64::to_degrees));
            Some(OtherSolution { line, axis, value_deg, range_deg })
        });
        let other = others.max_by_key(|other| other.line);
        Chosen { start_rad, cut: CutNote { line: self.line, other } }
    }
}
