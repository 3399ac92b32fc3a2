//! The tool's own directions, and what the linear axes do for an offset of the tool along them.
//!
//! With the rotary axes where they are, the tool centre point is an affine function of the linear axes. So an offset of the tool
//! on the work, whatever turns the work or the tool, is exactly one of the linear axes.

use feedwave_program::Axis;
use serde::{Deserialize, Serialize};

use super::chain::{Kinematics, KinematicsError, solve};
use super::direction::RotaryDirections;
use super::vector::{Vec3, add_scaled, cross, dot, rotate, scale, unit};

/// The frame of the tool in the spindle, and the axes that move it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ToolFrame {
    directions: RotaryDirections,
    /// The rotary axes and their lines, the one next to the work first.
    rotary: [(Axis, Vec3); 2],
    /// Two directions across the tool and the one along it to the spindle, with both rotary axes at zero: right-handed.
    own: [Vec3; 3],
    /// The linear axes in the order of the chain: letter, direction with both rotary axes at zero, and how many of those are
    /// between it and the work.
    linear: [(Axis, Vec3, u8); 3],
}

impl Kinematics {
    /// The frame of the tool. Across a tool along Z are X and Y; in general the first direction is as near as can be to the
    /// coordinate axis that follows, in the order X, Y, Z, the one nearest to the tool.
    #[must_use]
    pub fn tool_frame(&self) -> ToolFrame {
        let tool = self.tool_direction;
        let along = (0..3).max_by(|&a, &b| tool[a].abs().total_cmp(&tool[b].abs())).unwrap_or(2);
        let mut next = [0.0; 3];
        next[(along + 1) % 3] = 1.0;
        let first = unit(add_scaled(next, tool, -dot(tool, next))).unwrap_or(next);
        let linear = self.linear.map(|index| {
            let between = self.rotary.iter().filter(|&&rotary| rotary < index).count();
            (self.joints[index].axis, self.joints[index].direction, between as u8)
        });
        ToolFrame {
            directions: self.rotary_directions(),
            rotary: self.rotary.map(|index| (self.joints[index].axis, self.joints[index].direction)),
            own: [first, cross(tool, first), tool],
            linear,
        }
    }
}

impl ToolFrame {
    /// The linear axes, in the order of the chain.
    #[must_use]
    pub fn linear_axes(&self) -> [Axis; 3] {
        self.linear.map(|(axis, ..)| axis)
    }

    /// The rotary axes, the one next to the work first.
    #[must_use]
    pub fn rotary_axes(&self) -> [Axis; 2] {
        self.rotary.map(|(axis, _)| axis)
    }

    /// Whether the linear axes move along the tool's own directions wherever the rotary axes are: both of them turn the work.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        self.linear.iter().all(|&(_, _, between)| between == 2)
    }

    /// A vector in chain coordinates by its components across and along the tool.
    #[must_use]
    pub fn seen(&self, rotary_rad: [f64; 2], v: Vec3) -> Vec3 {
        let v = self.directions.as_seen_by_tool(rotary_rad, v);
        self.own.map(|own| dot(own, v))
    }

    /// The vector in chain coordinates with these components across and along the tool.
    #[must_use]
    pub fn carried(&self, rotary_rad: [f64; 2], offset: Vec3) -> Vec3 {
        self.directions.as_carried_by_tool(rotary_rad, self.in_spindle(offset))
    }

    fn in_spindle(&self, offset: Vec3) -> Vec3 {
        add_scaled(add_scaled(scale(self.own[0], offset[0]), self.own[1], offset[1]), self.own[2], offset[2])
    }

    /// By how much the linear axes (in the order of the chain) move for an offset with these components across and along the
    /// tool, mm; the rotary axes rest.
    ///
    /// # Errors
    /// [`KinematicsError::Degenerate`].
    pub fn linear_mm(&self, rotary_rad: [f64; 2], offset: Vec3) -> Result<Vec3, KinematicsError> {
        if self.is_constant() {
            return solve(self.linear.map(|(_, direction, _)| direction), self.in_spindle(offset));
        }
        let turns = rotary_rad.map(libm::sincos);
        let columns = self.linear.map(|(_, direction, between)| {
            (0..usize::from(between)).rev().fold(direction, |v, place| rotate(self.rotary[place].1, turns[place], v))
        });
        solve(columns, self.carried(rotary_rad, offset))
    }
}
