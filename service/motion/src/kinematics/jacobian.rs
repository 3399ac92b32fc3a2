//! Velocities of the axes by those of the tool centre point and the tool direction.

use super::chain::{JointValues, Kinematics, KinematicsError, Setup, solve};
use super::inverse::SINGULAR_RAD;
use super::vector::{Vec3, add, add_scaled, cross, dot, rotate, scale, sub};

/// How the axis values change with the pose: the rows of the inverse Jacobian in work coordinates. The change of the
/// direction is perpendicular to the direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jacobian {
    /// Per linear axis: mm by mm of the tool centre point.
    pub linear_by_tip: [Vec3; 3],
    /// Per linear axis: mm by the change of the unit direction vector (rad).
    pub linear_by_direction: [Vec3; 3],
    /// Per rotary axis: rad by the change of the unit direction vector (rad). The tool centre point does not matter.
    pub rotary_by_direction: [Vec3; 2],
}

impl Jacobian {
    /// Velocities of the axes (mm/s and rad/s) for those of the tool centre point (mm/s) and the direction (1/s); likewise
    /// for any small change. Accelerations also have the part that comes from the change of the Jacobian itself.
    #[must_use]
    pub fn joint_rates(&self, tip_per_s: Vec3, direction_per_s: Vec3) -> JointValues {
        let linear = |axis: usize| {
            dot(self.linear_by_tip[axis], tip_per_s) + dot(self.linear_by_direction[axis], direction_per_s)
        };
        JointValues {
            linear_mm: [linear(0), linear(1), linear(2)],
            rotary_rad: self.rotary_by_direction.map(|row| dot(row, direction_per_s)),
        }
    }
}

impl Kinematics {
    /// The Jacobian of the axis values by the pose, at these axis values.
    ///
    /// With the rotary axes' lines at present, ωᵢ through cᵢ, and the direction v = R₁R₂d: v' = θ₁'·ω₁×v + θ₂'·ω₂×v, hence
    /// θ₁' = v'·(ω₂×v)×v / D and θ₂' = −v'·(ω₁×v)×v / D with D = v·(ω₁×v)×(ω₂×v); and p' = M·x' + Σθᵢ'·ωᵢ×(p − cᵢ) with
    /// the present directions M of the linear axes.
    ///
    /// # Errors
    ///
    /// [`KinematicsError::Singular`] in a pole, [`KinematicsError::Degenerate`] where the linear axes do not span space.
    pub fn jacobian(&self, joints: &JointValues, setup: &Setup) -> Result<Jacobian, KinematicsError> {
        let pose = self.forward_in_chain(joints, setup.tool_length_mm);
        let mut columns = [[0.0; 3]; 3];
        // Line of each rotary axis at present: a point on it and its direction. One pass from the tool to the work.
        let mut lines = [([0.0; 3], [0.0; 3]); 2];
        for (index, joint) in self.joints.iter().enumerate().rev() {
            if let Some(place) = self.rotary.iter().position(|&rotary| rotary == index) {
                let turn = libm::sincos(joints.rotary_rad[place]);
                columns = columns.map(|column| rotate(joint.direction, turn, column));
                for (point, direction) in &mut lines[place + 1..] {
                    *point = add(joint.point, rotate(joint.direction, turn, sub(*point, joint.point)));
                    *direction = rotate(joint.direction, turn, *direction);
                }
                lines[place] = (joint.point, joint.direction);
            } else if let Some(place) = self.linear.iter().position(|&linear| linear == index) {
                let after = self.rotary.iter().filter(|&&rotary| rotary < index).count();
                for (point, _) in &mut lines[after..] {
                    *point = add_scaled(*point, joint.direction, joints.linear_mm[place]);
                }
                columns[place] = joint.direction;
            }
        }
        let v = pose.direction;
        let turned = lines.map(|(_, direction)| cross(direction, v));
        let determinant = dot(v, cross(turned[0], turned[1]));
        if determinant.abs() <= SINGULAR_RAD {
            return Err(KinematicsError::Singular);
        }
        let rotary = [scale(cross(turned[1], v), 1.0 / determinant), scale(cross(turned[0], v), -1.0 / determinant)];
        let lever = lines.map(|(point, direction)| cross(direction, sub(pose.tip_mm, point)));
        // Column k: the linear axes for a unit of the k-th component of p', and of v' through the rotary axes.
        let mut by_tip = [[0.0; 3]; 3];
        let mut by_direction = [[0.0; 3]; 3];
        for component in 0..3 {
            let mut tip = [0.0; 3];
            tip[component] = 1.0;
            let carried = add(scale(lever[0], rotary[0][component]), scale(lever[1], rotary[1][component]));
            let solved = (solve(columns, tip)?, solve(columns, scale(carried, -1.0))?);
            for axis in 0..3 {
                by_tip[axis][component] = solved.0[axis];
                by_direction[axis][component] = solved.1[axis];
            }
        }
        // From chain to work coordinates: rows turn like vectors.
        let turn_out = |row: Vec3| setup.work.turn_out(row);
        Ok(Jacobian {
            linear_by_tip: by_tip.map(turn_out),
            linear_by_direction: by_direction.map(turn_out),
            rotary_by_direction: rotary.map(turn_out),
        })
    }
}
