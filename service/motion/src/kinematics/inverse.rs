//! Inverse solution: the rotary values of a tool direction, both branches, and the axis values of a pose.
//!
//! The direction is turned in two steps, v = R₁(θ₁)·z and z = R₂(θ₂)·d (the second Paden–Kahan subproblem; Murray, Li and
//! Sastry, *A Mathematical Introduction to Robotic Manipulation*, 1994, section 3.2). z has the component of v along the first
//! axis and that of d along the second, which leaves two directions, mirrored at the plane of the axes.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::chain::{JointValues, Kinematics, KinematicsError, Setup, ToolPose};
use super::description::BranchPreference;
use super::range::nearest_turn;
use super::vector::{Vec3, add_scaled, angle, angle_about, cross, dot, norm, scale, sub};

/// Directions closer to the first rotary axis than this have no angle of it, rad. It is a tenth of the precision promised
/// for directions, and less than the last digit of any program's vectors.
pub(super) const SINGULAR_RAD: f64 = 1e-10;
/// A direction that is missed by no more than this counts as reachable, as rounding may miss it, rad.
const REACH_SLACK_RAD: f64 = 1e-10;

/// Both inverse solutions of a tool direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DirectionSolution {
    /// Values of the two rotary axes within (−π, π], rad: the solution with the larger value of the second axis, then the
    /// other one. They are equal in a pole, and at the edge of what can be reached.
    pub branches_rad: [[f64; 2]; 2],
    /// Angle between the direction and the line of the first rotary axis, rad: 0 in a pole.
    pub pole_distance_rad: f64,
    /// Whether the direction is in a pole: every value of the first rotary axis gives it, and 0 is entered for it.
    pub singular: bool,
}

/// The axis values of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InverseSolution {
    /// The axis values; those of linear axes may be outside their range, see [`Kinematics::out_of_range`].
    pub joints: JointValues,
    /// Angle between the direction and the line of the first rotary axis, rad.
    pub pole_distance_rad: f64,
    /// Whether the direction is in a pole, so that the first rotary axis was left where it is.
    pub singular: bool,
}

impl Kinematics {
    /// Both solutions of a tool direction (unit vector in chain coordinates).
    ///
    /// # Errors
    ///
    /// [`KinematicsError::Unreachable`].
    pub fn solve_direction(&self, direction: Vec3) -> Result<DirectionSolution, KinematicsError> {
        let [first, second] = self.rotary.map(|index| self.joints[index].direction);
        let (tool, between) = (self.tool_direction, dot(first, second));
        // z = (a₁·v)·a₁ + x·e₁ ± y·e₂ with e₁ in the plane of the axes: its part across a₁ is as long as that of v, and its
        // component along a₂ is that of d. Differences of nearly equal numbers are avoided, so that directions close
        // to a pole keep their precision.
        let across = cross(cross(first, second), first);
        let sine = norm(across);
        let e1 = scale(across, 1.0 / sine);
        let e2 = cross(first, e1);
        let radius = norm(cross(direction, first));
        let x = self.along_plane(direction, first, second, sine, between);
        let pole_distance_rad = libm::atan2(radius, dot(direction, first).abs());
        if x.abs() > radius {
            let missing_rad = self.missing(direction, first, second);
            if missing_rad > REACH_SLACK_RAD {
                return Err(KinematicsError::Unreachable { missing_rad });
            }
        }
        let singular = radius <= SINGULAR_RAD;
        let y = libm::sqrt(((radius - x) * (radius + x)).max(0.0));
        let solution = |y: f64| {
            let middle = if singular {
                scale(first, if dot(direction, first) < 0.0 { -1.0 } else { 1.0 })
            } else {
                add_scaled(add_scaled(scale(first, dot(direction, first)), e1, x), e2, y)
            };
            let turn = if singular { 0.0 } else { angle_about(first, middle, direction) };
            [turn, angle_about(second, tool, middle)]
        };
        let (mut larger, mut smaller) = (solution(y), solution(-y));
        if larger[1] < smaller[1] {
            std::mem::swap(&mut larger, &mut smaller);
        }
        Ok(DirectionSolution { branches_rad: [larger, smaller], pole_distance_rad, singular })
    }

    /// x = (a₂·d − (a₁·a₂)(a₁·v)) / |a₂ across a₁|, from the differences to the nearer pole.
    fn along_plane(&self, direction: Vec3, first: Vec3, second: Vec3, sine: f64, between: f64) -> f64 {
        // With the pole p = ±a₁ nearer to v: a₁·v = ±(1 − |v − p|²/2).
        let sign = if dot(direction, first) < 0.0 { -1.0 } else { 1.0 };
        let to_pole = sub(direction, scale(first, sign));
        let at_pole = dot(second, self.tool_direction) - sign * between;
        (at_pole + sign * between * dot(to_pole, to_pole) / 2.0) / sine
    }

    /// Angle from a direction to the nearest one that the axes can reach, rad: their cones about the first axis lie
    /// between |ψ₁ − ψ₂| and ψ₁ + ψ₂, with ψ₁ between the axes and ψ₂ between the second one and the tool.
    fn missing(&self, direction: Vec3, first: Vec3, second: Vec3) -> f64 {
        let (axes, tool) = (angle(first, second), angle(second, self.tool_direction));
        let (least, most) = ((axes - tool).abs(), (axes + tool).min(2.0 * PI - axes - tool));
        let cone = angle(first, direction);
        (least - cone).max(cone - most).max(0.0)
    }

    /// The rotary values (rad) of a branch nearest to `reference_rad` within the ranges; the excess of the worse axis
    /// where there is none.
    fn in_range(
        &self,
        branch_rad: [f64; 2],
        singular: bool,
        reference_rad: [f64; 2],
    ) -> Result<[f64; 2], KinematicsError> {
        let mut values = branch_rad;
        for (value, (&index, reference)) in values.iter_mut().zip(self.rotary.iter().zip(reference_rad)) {
            let joint = &self.joints[index];
            let free = singular && index == self.rotary[0];
            *value = if free {
                joint.range.map_or(reference, |[low, high]| reference.clamp(low, high))
            } else {
                let outside = |value| joint.refusal(value).unwrap_or(KinematicsError::Degenerate);
                joint.nearest_in_range(*value, reference).map_err(outside)?
            };
        }
        Ok(values)
    }

    /// The rotary values (rad) of a direction in chain coordinates that are nearest to `reference_rad`, by the axis that
    /// has further to go, within the ranges; in a pole the first axis stays where it is.
    ///
    /// # Errors
    ///
    /// [`KinematicsError::Unreachable`] and [`KinematicsError::OutOfRange`].
    pub fn nearest_rotary(&self, direction: Vec3, reference_rad: [f64; 2]) -> Result<[f64; 2], KinematicsError> {
        self.nearest_of(&self.solve_direction(direction)?, reference_rad)
    }

    fn nearest_of(&self, solution: &DirectionSolution, reference_rad: [f64; 2]) -> Result<[f64; 2], KinematicsError> {
        match solution.branches_rad.map(|branch| self.in_range(branch, solution.singular, reference_rad)) {
            [Ok(larger), Ok(smaller)] => {
                Ok(if travel(smaller, reference_rad) < travel(larger, reference_rad) { smaller } else { larger })
            }
            [Ok(only), Err(_)] | [Err(_), Ok(only)] => Ok(only),
            [Err(larger), Err(smaller)] => Err(less_excess(larger, smaller)),
        }
    }

    /// The rotary values (rad) nearest to `reference_rad` whatever the ranges: how the motion continues without a jump.
    pub(super) fn continued(&self, solution: &DirectionSolution, reference_rad: [f64; 2]) -> [f64; 2] {
        let [larger, smaller] = solution.branches_rad.map(|branch| {
            let first = if solution.singular { reference_rad[0] } else { nearest_turn(branch[0], reference_rad[0]) };
            [first, nearest_turn(branch[1], reference_rad[1])]
        });
        if travel(smaller, reference_rad) < travel(larger, reference_rad) { smaller } else { larger }
    }

    /// The axis values of a pose in work coordinates, with the rotary values nearest to `reference_rad`.
    ///
    /// # Errors
    ///
    /// Every [`KinematicsError`] of a pose.
    pub fn inverse(
        &self,
        pose: &ToolPose,
        setup: &Setup,
        reference_rad: [f64; 2],
    ) -> Result<InverseSolution, KinematicsError> {
        let solution = self.solve_direction(setup.to_chain(pose).direction)?;
        let rotary_rad = self.nearest_of(&solution, reference_rad)?;
        self.complete(pose, setup, &solution, rotary_rad)
    }

    /// The axis values of a pose in work coordinates in both branches (see [`DirectionSolution`]), each nearest to
    /// `reference_rad` within the ranges.
    ///
    /// # Errors
    ///
    /// [`KinematicsError::Unreachable`]; the other ones per branch.
    #[allow(clippy::type_complexity, reason = "a pair of results says what it is")]
    pub fn inverse_branches(
        &self,
        pose: &ToolPose,
        setup: &Setup,
        reference_rad: [f64; 2],
    ) -> Result<[Result<InverseSolution, KinematicsError>; 2], KinematicsError> {
        let solution = self.solve_direction(setup.to_chain(pose).direction)?;
        Ok(solution.branches_rad.map(|branch| {
            let rotary_rad = self.in_range(branch, solution.singular, reference_rad)?;
            self.complete(pose, setup, &solution, rotary_rad)
        }))
    }

    fn complete(
        &self,
        pose: &ToolPose,
        setup: &Setup,
        solution: &DirectionSolution,
        rotary_rad: [f64; 2],
    ) -> Result<InverseSolution, KinematicsError> {
        let joints = self.joints_at(pose.tip_mm, rotary_rad, setup)?;
        Ok(InverseSolution { joints, pole_distance_rad: solution.pole_distance_rad, singular: solution.singular })
    }

    /// The solution that the profile prefers to start a cut with.
    #[must_use]
    pub const fn preferred(&self) -> BranchPreference {
        self.preferred
    }
}

impl BranchPreference {
    /// Whether these rotary values may start a cut before other ones.
    pub(super) fn prefers(self, values_rad: [f64; 2], other_rad: [f64; 2]) -> bool {
        let second = |values: [f64; 2]| nearest_turn(values[1], 0.0);
        match self {
            Self::Nearest => false,
            Self::Larger => second(values_rad) > second(other_rad) + SINGULAR_RAD,
            Self::Smaller => second(values_rad) < second(other_rad) - SINGULAR_RAD,
        }
    }
}

/// Travel of the axis that has further to go, rad.
pub(super) fn travel(values: [f64; 2], reference: [f64; 2]) -> f64 {
    (values[0] - reference[0]).abs().max((values[1] - reference[1]).abs())
}

fn less_excess(a: KinematicsError, b: KinematicsError) -> KinematicsError {
    if b.excess_rad() < a.excess_rad() { b } else { a }
}
