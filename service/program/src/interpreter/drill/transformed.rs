//! Holes in coordinates other than plain ones: what is refused where they are transformed, and steps of an angle in polar ones.

use super::super::execute::Execution;
use super::Hole;
use crate::code;
use crate::coordinates::direction;
use crate::state::Cycle;
use crate::{Axis, Position};

impl Execution<'_> {
    /// Whether the coordinates change what the levels of a cycle mean, so that it is refused; that is then reported.
    pub(super) fn is_cycle_transformed(&mut self, cycle: Cycle, axis: Axis) -> bool {
        let transform = self.state.coords.transform.as_ref();
        let message = if transform.is_some_and(|transform| transform.factor(axis) != 1.0) {
            "what the levels of a cycle are along a scaled or mirrored axis depends on the control"
        } else if transform.is_some_and(|transform| !transform.keeps_plane(self.state.plane)) {
            "a drilling cycle in another plane than that of the rotation"
        } else if !matches!(cycle, Cycle::FineBore | Cycle::BackBore) {
            return false;
        } else if transform.is_some() {
            "in which direction the tool is moved off the wall in transformed coordinates depends on the control"
        } else if self.state.plane_tilted.is_some() {
            "the spindle is oriented in the machine, so the direction off the wall is not that of the axes of a tilted plane"
        } else {
            return false;
        };
        self.refuse_cycle(
            code::COORD_SHAPE,
            message,
            "write the moves with G0 and G1, or the cycle in plain coordinates",
        );
        true
    }

    /// By which angle the holes of a block with repeats follow each other in polar coordinates; an error where they differ in more.
    pub(super) fn polar_steps(&self, axes: u32) -> Result<Option<f64>, ()> {
        if self.state.coords.polar.is_none() || self.state.absolute {
            return Ok(None);
        }
        let (first, second) = self.state.plane.axes();
        if axes & self.letters_of(first) != 0 {
            return Err(());
        }
        let angle = self.block.letters & axes & self.letters_of(second) != 0;
        Ok(angle.then(|| self.scaled(self.block.slot(self.letters_of(second).trailing_zeros() as usize), false)))
    }

    #[cold]
    pub(super) fn refuse_polar_steps(&mut self) {
        let span = self.block.span();
        self.coord(
            code::COORD_AMBIGUOUS,
            span,
            "repeats with an incremental radius in polar coordinates: controls differ in the pole of the further holes",
            "write each hole in a block of its own",
        );
    }

    /// The next hole of a row; under polar words of LinuxCNC, which start from the hole before.
    pub(super) fn next_hole(&mut self, hole: &Hole, at: &mut Position) {
        if let Some(words) = self.block.polar().copied() {
            return self.place_polar(&words, at);
        }
        for (value, step) in at.iter_mut().zip(&hole.step) {
            *value += step;
        }
    }

    /// The next hole on the circle.
    pub(super) fn next_polar_hole(&mut self, at: &mut Position, step_deg: f64) {
        let (first, second) = self.state.plane.axes();
        let Some(polar) = &mut self.state.coords.polar else { return };
        let (Some(radius_mm), Some(angle_deg)) = (polar.radius_mm, polar.angle_deg) else { return };
        let angle_deg = angle_deg + step_deg;
        polar.angle_deg = Some(angle_deg);
        let [cosine, sine] = direction(angle_deg);
        at[first.index()] = radius_mm * cosine;
        at[second.index()] = radius_mm * sine;
    }
}
