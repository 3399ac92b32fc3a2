//! Boring with an oriented tool: `G76` and `G87` of mills.

use super::super::execute::Execution;
use super::Hole;
use crate::{Feed, MachineCommand, MachineEffect, MoveKind, OperationKind, Position, SpindleDirection};

impl Execution<'_> {
    /// `G76`: the tool stops in its orientation, leaves the wall, and comes out without a mark.
    pub(super) fn fine_bore(&mut self, hole: &Hole, direction: SpindleDirection) {
        self.feed_along(hole, hole.bottom);
        self.wait(hole);
        self.orient();
        self.shift_by(hole, 1.0);
        self.rapid_along(hole, hole.clear);
        self.shift_by(hole, -1.0);
        self.turn(direction);
    }

    /// `G87`: the tool passes the hole off its centre, and cuts upwards from the far side.
    pub(super) fn back_bore(&mut self, hole: &Hole, at: &Position, direction: SpindleDirection) {
        let mut over = *at;
        over[hole.axis] = self.state.position[hole.axis];
        self.drill_to(MoveKind::Rapid, over, Feed::PerMinute(0.0));
        self.orient();
        self.shift_by(hole, 1.0);
        self.rapid_along(hole, hole.r);
        self.shift_by(hole, -1.0);
        self.turn(direction);
        self.feed_along(hole, hole.bottom);
        self.wait(hole);
        self.orient();
        self.shift_by(hole, 1.0);
        self.rapid_along(hole, hole.clear);
        self.shift_by(hole, -1.0);
        self.turn(direction);
    }

    /// The spindle stops at the angle that the machine has for it, as by `M19`.
    fn orient(&mut self) {
        self.turn(SpindleDirection::Stopped);
        let command = MachineCommand { number: 19, effect: MachineEffect::Barrier, words: Vec::new() };
        self.emit(self.block.span(), OperationKind::MachineCode(command));
    }

    fn shift_by(&mut self, hole: &Hole, factor: f64) {
        let mut end = self.state.position;
        for (value, shift) in end.iter_mut().zip(&hole.shift) {
            *value += factor * shift;
        }
        self.drill_to(MoveKind::Rapid, end, Feed::PerMinute(0.0));
    }
}
