//! Direction between the ends of a block: by the angles of the rotary axes when the program gives angles, along the
//! great circle when it gives vectors (docs/functions/five-axis-thinning.md, "After thinning: tool-centre-point
//! interpolation").

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::chain::{JointValues, Kinematics, KinematicsError, Setup, ToolPose};
use super::inverse::InverseSolution;
use super::vector::{Vec3, add, add_scaled, angle, cross, dot, norm, rotate, scale, sub, unit};

/// Directions this close to opposite have no great circle between them, rad: their common plane would be noise.
const OPPOSITE_RAD: f64 = 1e-9;

/// Two directions are opposite: every plane through them holds a great circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the two directions are opposite, so that no plane between them is given")]
pub struct OppositeDirections;

/// The great circle between two directions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GreatCircle {
    start: Vec3,
    end: Vec3,
    /// Unit vector perpendicular to the start, towards the end.
    towards: Vec3,
    angle_rad: f64,
}

impl GreatCircle {
    /// From one unit vector to another.
    ///
    /// # Errors
    ///
    /// With opposite ones.
    pub fn new(start: Vec3, end: Vec3) -> Result<Self, OppositeDirections> {
        let normal = cross(start, end);
        let angle_rad = libm::atan2(norm(normal), dot(start, end));
        if std::f64::consts::PI - angle_rad < OPPOSITE_RAD {
            return Err(OppositeDirections);
        }
        // Equal directions have no plane and need none.
        let towards = unit(cross(normal, start)).unwrap_or_default();
        Ok(Self { start, end, towards, angle_rad })
    }

    /// Angle between the two directions, rad.
    #[must_use]
    pub const fn angle_rad(&self) -> f64 {
        self.angle_rad
    }

    /// The direction at a share of the angle; the programmed directions to the last bit at 0 and 1.
    #[must_use]
    pub fn at(&self, share: f64) -> Vec3 {
        if share <= 0.0 {
            return self.start;
        }
        if share >= 1.0 {
            return self.end;
        }
        let (sine, cosine) = libm::sincos(self.angle_rad * share);
        add_scaled(scale(self.start, cosine), self.towards, sine)
    }
}

/// The rotary axes alone: which direction their values give. It is all that thinning needs to know of a machine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RotaryDirections {
    first: Vec3,
    second: Vec3,
    tool: Vec3,
}

impl RotaryDirections {
    /// The line of the first rotary axis, the one next to the work: a unit vector. Along it lie the poles.
    #[must_use]
    pub const fn first_axis(&self) -> Vec3 {
        self.first
    }

    /// A vector in chain coordinates as the tool sees it: R₂(−θ₂)·R₁(−θ₁)·v.
    #[must_use]
    pub fn as_seen_by_tool(&self, rotary_rad: [f64; 2], v: Vec3) -> Vec3 {
        let [first, second] = rotary_rad.map(|angle_rad| libm::sincos(-angle_rad));
        rotate(self.second, second, rotate(self.first, first, v))
    }

    /// A vector that the tool carries in chain coordinates: R₁(θ₁)·R₂(θ₂)·v.
    #[must_use]
    pub fn as_carried_by_tool(&self, rotary_rad: [f64; 2], v: Vec3) -> Vec3 {
        let [first, second] = rotary_rad.map(libm::sincos);
        rotate(self.first, first, rotate(self.second, second, v))
    }

    /// Derivatives of the direction by either rotary value, turned back by the first one: a₁×v₂ and a₂×v₂ with v₂ = R₂(θ₂)·d. Lengths and
    /// angles between them depend on the second value alone.
    #[must_use]
    pub(crate) fn changes(&self, second_rad: f64) -> [Vec3; 2] {
        let direction = rotate(self.second, libm::sincos(second_rad), self.tool);
        [cross(self.first, direction), cross(self.second, direction)]
    }

    /// v = R₁(θ₁)·R₂(θ₂)·d, a unit vector in chain coordinates.
    #[must_use]
    pub fn at(&self, rotary_rad: [f64; 2]) -> Vec3 {
        let [first, second] = rotary_rad.map(libm::sincos);
        rotate(self.first, first, rotate(self.second, second, self.tool))
    }
}

/// How the direction goes from the start of a block to its end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DirectionPath {
    /// Each rotary axis turns evenly, rad.
    Angles {
        /// Values at the start.
        start_rad: [f64; 2],
        /// Values at the end.
        end_rad: [f64; 2],
    },
    /// Along the great circle between two directions in work coordinates.
    GreatCircle(GreatCircle),
}

/// A block of five-axis motion: the tool centre point goes straight in work coordinates while the direction turns.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FiveAxisSegment {
    /// Tool centre point at the start, work coordinates, mm.
    pub start_mm: Vec3,
    /// Tool centre point at the end, work coordinates, mm.
    pub end_mm: Vec3,
    /// Tool direction between them.
    pub direction: DirectionPath,
}

impl FiveAxisSegment {
    /// The tool centre point at a share of the block, mm; the programmed points to the last bit at 0 and 1.
    #[must_use]
    pub fn tip_mm(&self, share: f64) -> Vec3 {
        if share >= 1.0 {
            return self.end_mm;
        }
        add(self.start_mm, scale(sub(self.end_mm, self.start_mm), share.max(0.0)))
    }

    /// Length of the tool centre point's path, mm.
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        norm(sub(self.end_mm, self.start_mm))
    }

    /// The axis values at a share of the block. Along a great circle those nearest to `reference_rad` are taken: the
    /// rotary values of the setpoint before.
    ///
    /// # Errors
    ///
    /// Every [`KinematicsError`] of a pose.
    pub fn joints(
        &self,
        kinematics: &Kinematics,
        setup: &Setup,
        share: f64,
        reference_rad: [f64; 2],
    ) -> Result<InverseSolution, KinematicsError> {
        let tip_mm = self.tip_mm(share);
        match &self.direction {
            DirectionPath::GreatCircle(circle) => {
                kinematics.inverse(&ToolPose { tip_mm, direction: circle.at(share) }, setup, reference_rad)
            }
            DirectionPath::Angles { start_rad, end_rad } => {
                let share = share.clamp(0.0, 1.0);
                let rotary_rad = [0, 1].map(|axis| {
                    if share == 1.0 {
                        end_rad[axis]
                    } else {
                        start_rad[axis] + (end_rad[axis] - start_rad[axis]) * share
                    }
                });
                let joints: JointValues = kinematics.joints_at(tip_mm, rotary_rad, setup)?;
                let pole_distance_rad = kinematics.pole_distance_rad(rotary_rad);
                let singular = pole_distance_rad <= super::inverse::SINGULAR_RAD;
                Ok(InverseSolution { joints, pole_distance_rad, singular })
            }
        }
    }
}

impl Kinematics {
    /// The rotary axes alone.
    #[must_use]
    pub fn rotary_directions(&self) -> RotaryDirections {
        let [first, second] = self.rotary.map(|index| self.joints[index].direction);
        RotaryDirections { first, second, tool: self.tool_direction }
    }

    /// Angle between the direction that these rotary values give and the line of the first rotary axis, rad: 0 in a
    /// pole.
    #[must_use]
    pub fn pole_distance_rad(&self, rotary_rad: [f64; 2]) -> f64 {
        let axis = self.joints[self.rotary[0]].direction;
        let cone = angle(axis, self.rotary_directions().at(rotary_rad));
        cone.min(std::f64::consts::PI - cone)
    }
}
