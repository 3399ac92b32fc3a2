//! The compiled chain: forward solution, and the linear axes for given rotary ones.

use feedwave_program::{Axis, Position};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::description::{BranchPreference, KinematicsDescription, Wrap, places};
use super::vector::{Vec3, add, add_scaled, cross, dot, rotate, scale, sub, unit};
use crate::machine::ProfileProblem;

/// Smallest volume that the directions of the linear axes may span in a pose (1 for orthogonal ones): with less, rounding
/// in travels a hundred times the distance would cost the precision of the tool centre point, 1e-9 mm.
pub(super) const LEAST_VOLUME: f64 = 1e-2;
/// How far the columns of a rotation may be from unit length and right angles: CAM posts print six decimals.
const ROTATION_TOLERANCE: f64 = 1e-5;

/// Values of the five axes, each kind in the order of the chain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointValues {
    /// The linear axes, mm.
    pub linear_mm: [f64; 3],
    /// The rotary axes, rad.
    pub rotary_rad: [f64; 2],
}

/// Tool centre point and tool direction in work coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ToolPose {
    /// Tool centre point, mm.
    pub tip_mm: Vec3,
    /// Unit vector from the tip to the spindle.
    pub direction: Vec3,
}

/// Work coordinates: where they lie on the part of the machine that carries the workpiece. They move with it, so an offset
/// that is set once holds for every rotary position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorkFrame {
    pub(super) origin_mm: Vec3,
    /// Directions of X, Y and Z of the work coordinates.
    axes: [Vec3; 3],
}

impl WorkFrame {
    /// Work coordinates parallel to the chain's, with their origin there, mm.
    #[must_use]
    pub const fn at(origin_mm: Vec3) -> Self {
        Self { origin_mm, axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] }
    }

    /// Work coordinates with these directions of X and Y, as for a tilted plane; Z follows right-handed, and Y is made
    /// exactly perpendicular to X.
    ///
    /// # Errors
    ///
    /// With X and Y that are not perpendicular unit vectors to within 1e-5.
    pub fn turned(origin_mm: Vec3, x: Vec3, y: Vec3) -> Result<Self, KinematicsError> {
        let is_unit = |v: Vec3| (dot(v, v) - 1.0).abs() <= ROTATION_TOLERANCE;
        let perpendicular = dot(x, y).abs() <= ROTATION_TOLERANCE;
        let refused = KinematicsError::NotARotation;
        if !(is_unit(x) && is_unit(y) && perpendicular) {
            return Err(refused);
        }
        let x = unit(x).ok_or(refused)?;
        let z = unit(cross(x, y)).ok_or(refused)?;
        Ok(Self { origin_mm, axes: [x, cross(z, x), z] })
    }

    pub(super) fn turn_in(&self, v: Vec3) -> Vec3 {
        add_scaled(add_scaled(scale(self.axes[0], v[0]), self.axes[1], v[1]), self.axes[2], v[2])
    }

    pub(super) fn turn_out(&self, v: Vec3) -> Vec3 {
        self.axes.map(|axis| dot(axis, v))
    }
}

/// What a machine is set up with: where the work lies, and how long the tool is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setup {
    /// Work coordinates.
    pub work: WorkFrame,
    /// From the gauge point to the tool centre point, mm.
    pub tool_length_mm: f64,
}

impl Setup {
    /// Work coordinates at `origin_mm` in chain coordinates, and a tool of this length.
    #[must_use]
    pub const fn new(origin_mm: Vec3, tool_length_mm: f64) -> Self {
        Self { work: WorkFrame::at(origin_mm), tool_length_mm }
    }

    /// A pose in work coordinates as one in chain coordinates.
    #[must_use]
    pub fn to_chain(&self, pose: &ToolPose) -> ToolPose {
        let tip_mm = add(self.work.origin_mm, self.work.turn_in(pose.tip_mm));
        ToolPose { tip_mm, direction: self.work.turn_in(pose.direction) }
    }

    /// A pose in chain coordinates as one in work coordinates.
    #[must_use]
    pub fn to_work(&self, pose: &ToolPose) -> ToolPose {
        let tip_mm = self.work.turn_out(sub(pose.tip_mm, self.work.origin_mm));
        ToolPose { tip_mm, direction: self.work.turn_out(pose.direction) }
    }
}

/// Why a pose has no axis values.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum KinematicsError {
    /// The rotary axes cannot give the tool this direction at all.
    #[error("the rotary axes miss the direction by {:.6} degrees", missing_rad.to_degrees())]
    Unreachable {
        /// Angle from the direction to the nearest one that can be reached, rad.
        missing_rad: f64,
    },
    /// Both inverse solutions are outside the range of a rotary axis.
    #[error(
        "{} would have to turn to {:.6} degrees, beyond its range from {:.6} to {:.6}",
        axis.letter(), value_rad.to_degrees(), range_rad[0].to_degrees(), range_rad[1].to_degrees()
    )]
    OutOfRange {
        /// The rotary axis.
        axis: Axis,
        /// Where it would be in the better of the two solutions, rad.
        value_rad: f64,
        /// Its range, rad.
        range_rad: [f64; 2],
    },
    /// In this pose the linear axes cannot move the tool in every direction.
    #[error("the linear axes do not span space in this pose")]
    Degenerate,
    /// The direction is along the first rotary axis: the rotary velocities have no finite value.
    #[error("the tool is parallel to the rotary axis next to the work")]
    Singular,
    /// The directions of a work frame are not perpendicular unit vectors.
    #[error("the directions of the work coordinates are not perpendicular unit vectors")]
    NotARotation,
}

impl KinematicsError {
    /// How far outside its range a rotary axis would be, rad; 0 for every other reason.
    #[must_use]
    pub fn excess_rad(&self) -> f64 {
        match self {
            Self::OutOfRange { value_rad, range_rad: [low, high], .. } => (low - value_rad).max(value_rad - high),
            _ => 0.0,
        }
    }
}

/// One compiled axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Joint {
    pub axis: Axis,
    pub direction: Vec3,
    pub point: Vec3,
    /// mm or rad.
    pub range: Option<[f64; 2]>,
    pub wrap: Wrap,
}

/// A valid description, ready to solve.
#[derive(Clone, Debug, PartialEq)]
pub struct Kinematics {
    pub(super) joints: Vec<Joint>,
    /// Place in [`JointValues`] of each joint.
    pub(super) places: Vec<usize>,
    pub(super) rotary: [usize; 2],
    pub(super) linear: [usize; 3],
    pub(super) gauge_point: Vec3,
    pub(super) tool_direction: Vec3,
    pub(super) preferred: BranchPreference,
}

impl Kinematics {
    /// Compiles a description.
    ///
    /// # Errors
    ///
    /// Everything that is wrong with it, by field.
    pub fn new(description: &KinematicsDescription) -> Result<Self, Vec<ProfileProblem>> {
        let problems = description.validate();
        let (linear, rotary) = (places(&description.chain, false), places(&description.chain, true));
        let (Ok(linear), Ok(rotary), true) =
            (<[usize; 3]>::try_from(linear), <[usize; 2]>::try_from(rotary), problems.is_empty())
        else {
            return Err(problems);
        };
        let joint = |axis: &super::ChainAxis| {
            let to_rad = |value: f64| if axis.axis.is_rotary() { value.to_radians() } else { value };
            Joint {
                axis: axis.axis,
                direction: unit(axis.direction).unwrap_or_default(),
                point: axis.point_mm,
                range: axis.range.map(|range| range.map(to_rad)),
                wrap: axis.wrap,
            }
        };
        let place = |index: usize| {
            let of_kind = |place: &usize| description.chain[*place].axis.is_rotary();
            let rotary = of_kind(&index);
            (0..index).filter(|other| of_kind(other) == rotary).count()
        };
        Ok(Self {
            joints: description.chain.iter().map(joint).collect(),
            places: (0..description.chain.len()).map(place).collect(),
            rotary,
            linear,
            gauge_point: description.gauge_point_mm,
            tool_direction: unit(description.tool_direction).unwrap_or_default(),
            preferred: description.preferred_branch,
        })
    }

    /// Letters of the linear and the rotary axes, in the order of [`JointValues`].
    #[must_use]
    pub fn letters(&self) -> ([Axis; 3], [Axis; 2]) {
        (self.linear.map(|index| self.joints[index].axis), self.rotary.map(|index| self.joints[index].axis))
    }

    /// Axis values by letter (mm and degrees), zero for letters the chain does not have.
    #[must_use]
    pub fn to_position(&self, joints: &JointValues) -> Position {
        let mut position = Position::default();
        let (linear, rotary) = self.letters();
        for (axis, value) in linear.into_iter().zip(joints.linear_mm) {
            position[axis.index()] = value;
        }
        for (axis, value) in rotary.into_iter().zip(joints.rotary_rad) {
            position[axis.index()] = value.to_degrees();
        }
        position
    }

    /// Axis values of a position by letter (mm and degrees).
    #[must_use]
    pub fn from_position(&self, position: &Position) -> JointValues {
        let (linear, rotary) = self.letters();
        JointValues {
            linear_mm: linear.map(|axis| position[axis.index()]),
            rotary_rad: rotary.map(|axis| position[axis.index()].to_radians()),
        }
    }

    /// The pose in work coordinates that these axis values give.
    #[must_use]
    pub fn forward(&self, joints: &JointValues, setup: &Setup) -> ToolPose {
        setup.to_work(&self.forward_in_chain(joints, setup.tool_length_mm))
    }

    /// Where the gauge point is for these axis values, in chain coordinates, mm: the origin of the work coordinates that are
    /// set by moving the bare spindle there.
    #[must_use]
    pub fn gauge_point_at(&self, joints: &JointValues) -> Vec3 {
        self.forward_in_chain(joints, 0.0).tip_mm
    }

    /// The work coordinates that lie where the bare spindle's gauge point is for these axis values, parallel to the machine's
    /// axes in that position. So a rotary value of an axis that carries the work turns them on the work, one of an axis that
    /// carries the tool does not.
    #[must_use]
    pub fn work_frame_at(&self, joints: &JointValues) -> WorkFrame {
        let first_linear = self.linear.iter().copied().min().unwrap_or_default();
        let turned = |v: Vec3| {
            let carrying = self.joints[..first_linear].iter().zip(&self.places).rev();
            carrying.fold(v, |v, (joint, &place)| rotate(joint.direction, libm::sincos(joints.rotary_rad[place]), v))
        };
        let axes = WorkFrame::at([0.0; 3]).axes.map(turned);
        WorkFrame { origin_mm: self.gauge_point_at(joints), axes }
    }

    /// Axis values for a tool centre point in work coordinates (mm) with given rotary values (rad).
    ///
    /// # Errors
    ///
    /// [`KinematicsError::Degenerate`].
    pub fn joints_at(&self, tip_mm: Vec3, rotary_rad: [f64; 2], setup: &Setup) -> Result<JointValues, KinematicsError> {
        let tip = setup.to_chain(&ToolPose { tip_mm, direction: [0.0; 3] }).tip_mm;
        let turns = rotary_rad.map(libm::sincos);
        // One pass from the tool to the work: the tip with the linear axes at zero, and the linear axes' directions.
        let mut origin = add_scaled(self.gauge_point, self.tool_direction, -setup.tool_length_mm);
        let mut columns = [[0.0; 3]; 3];
        for (joint, &place) in self.joints.iter().zip(&self.places).rev() {
            if joint.axis.is_rotary() {
                origin = add(joint.point, rotate(joint.direction, turns[place], sub(origin, joint.point)));
                columns = columns.map(|column| rotate(joint.direction, turns[place], column));
            } else {
                columns[place] = joint.direction;
            }
        }
        let linear_mm = solve(columns, sub(tip, origin))?;
        Ok(JointValues { linear_mm, rotary_rad })
    }

    pub(super) fn forward_in_chain(&self, joints: &JointValues, tool_length_mm: f64) -> ToolPose {
        let mut tip_mm = add_scaled(self.gauge_point, self.tool_direction, -tool_length_mm);
        let mut direction = self.tool_direction;
        for (joint, &place) in self.joints.iter().zip(&self.places).rev() {
            if joint.axis.is_rotary() {
                let turn = libm::sincos(joints.rotary_rad[place]);
                tip_mm = add(joint.point, rotate(joint.direction, turn, sub(tip_mm, joint.point)));
                direction = rotate(joint.direction, turn, direction);
            } else {
                tip_mm = add_scaled(tip_mm, joint.direction, joints.linear_mm[place]);
            }
        }
        ToolPose { tip_mm, direction }
    }
}

/// Solves [a b c]·x = r by Cramer's rule.
pub(super) fn solve([a, b, c]: [Vec3; 3], r: Vec3) -> Result<Vec3, KinematicsError> {
    let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
    let volume = dot(a, bc);
    if volume.abs() < LEAST_VOLUME {
        return Err(KinematicsError::Degenerate);
    }
    Ok([dot(bc, r) / volume, dot(ca, r) / volume, dot(ab, r) / volume])
}
