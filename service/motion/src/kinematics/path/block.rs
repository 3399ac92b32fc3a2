//! A block of five-axis motion, and the elements that carry it out.

use feedwave_program::{Axis, Position, SourceSpan};
use serde::{Deserialize, Serialize};
use smallvec::SmallVec;
use thiserror::Error;

use super::fit::{RotaryPath, fit};
use super::turning::Turning;
use crate::kinematics::chain::{Kinematics, KinematicsError, Setup, ToolPose};
use crate::kinematics::direction::{GreatCircle, OppositeDirections};
use crate::kinematics::inverse::travel;
use crate::kinematics::range::nearest_turn;
use crate::kinematics::tip::{TipCurve, TipPath};
use crate::kinematics::vector::{Vec3, unit};
use crate::tolerance::{MAX_POLE_TOLERANCE_RAD, POLE_RAD, SAME_POINT_MM, SAME_START_RAD};
use crate::{Curve, Element};

/// Where a five-axis block starts or ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FiveAxisPoint {
    /// Tool centre point, work coordinates, mm.
    pub tip_mm: Vec3,
    /// Tool direction, work coordinates: as programmed where it was programmed as a vector.
    pub direction: Vec3,
    /// Values of the axes of the chain, by letter, in the chain's sense; those of other axes as they are; mm and
    /// degrees.
    pub position: Position,
}

/// Tool direction at the end of a block.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Toward {
    /// By the two rotary axes (first the one next to the work), degrees: each turns evenly to this value, however many turns that
    /// is.
    Angles([f64; 2]),
    /// By a vector in work coordinates, of any length: along the great circle.
    Vector(Vec3),
}

/// A block of five-axis motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FiveAxisBlock<'a> {
    /// Tool centre point at the end, work coordinates, mm.
    pub end_mm: Vec3,
    /// The curve on which it goes there; straight without one.
    pub curve: Option<TipCurve<'a>>,
    /// Direction at the end.
    pub toward: Toward,
    /// Angle to the first rotary axis' line within which a great circle may be bent to lead through it, rad, at most
    /// 0.1; the first rotary axis then hardly turns where it would turn by up to half a turn at little feed. With 0 only
    /// directions within 1e-7 rad of the line are taken along it.
    pub pole_tolerance_rad: f64,
    /// Words that ask for it.
    pub source: SourceSpan,
    /// Whether it is a rapid.
    pub rapid: bool,
}

/// The elements of a block.
#[derive(Clone, Debug, PartialEq)]
pub struct FiveAxisMotion {
    /// In order; none where nothing moves. Two where the first rotary axis has to turn in a pole, with the tool centre point
    /// and the tool direction at rest, before the tool can tilt away from there.
    pub elements: SmallVec<[Element; 1]>,
    /// Where they end: the start of the next block.
    pub end: FiveAxisPoint,
    /// Smallest angle between the programmed direction and the first rotary axis' line, rad: 0 in a pole.
    pub least_pole_distance_rad: f64,
    /// Largest angle between the programmed direction and the one that is taken, rad; not 0 only where a pole is passed.
    pub deviation_rad: f64,
    /// Angle that the first rotary axis turns at rest in a pole, rad.
    pub turn_in_pole_rad: f64,
}

/// Why a block cannot be run.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum FiveAxisRefusal {
    /// A pose within the block has no axis values.
    #[error("{reason}, after {:.1} % of the block", 100.0 * share)]
    Pose {
        /// Share of the block at which it was found.
        share: f64,
        /// What is the matter there.
        reason: KinematicsError,
    },
    /// The direction turns to its opposite.
    #[error(transparent)]
    Opposite(#[from] OppositeDirections),
    /// The axes are not where the block starts.
    #[error("{} is {difference} off the start of the block", axis.letter())]
    Start {
        /// The axis.
        axis: Axis,
        /// Its value less the one that the start of the block needs, mm or degrees.
        difference: f64,
    },
    /// An axis has to reverse so sharply that no polynomial follows: at the edge of what the axes can reach.
    #[error("the rotary axes cannot follow the direction smoothly, after {:.1} % of the block", 100.0 * share)]
    TooSharp {
        /// Share of the block.
        share: f64,
    },
    /// A number of the block is not finite, or its direction is a zero vector.
    #[error("the block has a number that is not finite, or a direction of length zero")]
    NotANumber,
}

impl FiveAxisRefusal {
    fn at(share: f64) -> impl Fn(KinematicsError) -> Self {
        move |reason| Self::Pose { share, reason }
    }
}

impl Kinematics {
    /// The point at which the axes are: tool centre point and direction of axis values by letter (mm and degrees).
    #[must_use]
    pub fn point_at(&self, position: &Position, setup: &Setup) -> FiveAxisPoint {
        let ToolPose { tip_mm, direction } = self.forward(&self.from_position(position), setup);
        FiveAxisPoint { tip_mm, direction, position: *position }
    }

    /// The point with this tool centre point (work coordinates, mm) and these rotary values (first the one next to the
    /// work, degrees); axes beside the chain as in `position`.
    ///
    /// # Errors
    /// [`KinematicsError::Degenerate`], and [`KinematicsError::OutOfRange`] for a rotary axis.
    pub fn point_with(
        &self,
        tip_mm: Vec3,
        rotary_deg: [f64; 2],
        position: &Position,
        setup: &Setup,
    ) -> Result<FiveAxisPoint, KinematicsError> {
        let joints = self.joints_at(tip_mm, rotary_deg.map(f64::to_radians), setup)?;
        if let Some(reason) = self.excess_of(joints.rotary_rad) {
            return Err(reason);
        }
        let (linear, rotary) = self.letters();
        let mut position = *position;
        for (axis, value) in linear.into_iter().zip(joints.linear_mm).chain(rotary.into_iter().zip(rotary_deg)) {
            position[axis.index()] = value;
        }
        let direction = self.forward(&joints, setup).direction;
        Ok(FiveAxisPoint { tip_mm, direction, position })
    }

    /// The elements of a block that starts at `start`: where the block before has ended, or [`Kinematics::point_at`] of where
    /// the axes are. The rotary axes go on in the branch of the inverse solution in which they are; another one
    /// comes only through a pole. [`Kinematics::choose_start`] says where to start so that a whole cut can be made.
    ///
    /// # Errors
    /// [`FiveAxisRefusal`].
    pub fn elements(
        &self,
        setup: &Setup,
        start: &FiveAxisPoint,
        block: &FiveAxisBlock<'_>,
    ) -> Result<FiveAxisMotion, FiveAxisRefusal> {
        let is_finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        let target = match &block.toward {
            Toward::Angles(angles) => is_finite(angles).then_some(Vec3::default()),
            Toward::Vector(vector) => unit(*vector),
        };
        let (Some(target), true) = (target, is_finite(&block.end_mm) && is_finite(&start.position)) else {
            return Err(FiveAxisRefusal::NotANumber);
        };
        match block.toward {
            Toward::Angles(angles) => self.by_angles(setup, start, block, angles),
            Toward::Vector(_) => {
                let tolerance_rad = block.pole_tolerance_rad.clamp(0.0, MAX_POLE_TOLERANCE_RAD);
                let through = self.by_vector(setup, start, block, target, tolerance_rad);
                match through {
                    // The other side of the pole may be out of range where this side is not.
                    Err(FiveAxisRefusal::Pose { reason: KinematicsError::OutOfRange { .. }, .. })
                        if tolerance_rad > POLE_RAD =>
                    {
                        self.by_vector(setup, start, block, target, 0.0).or(through)
                    }
                    _ => through,
                }
            }
        }
    }

    /// Where the rotary axes arrive along the great circle between two directions (chain coordinates) that are not
    /// opposite, rad.
    ///
    /// # Errors
    /// [`KinematicsError::Unreachable`], and [`KinematicsError::OutOfRange`] where an axis leaves its range within the
    /// block.
    pub(in crate::kinematics) fn followed(
        &self,
        [from, to]: [Vec3; 2],
        pole_tolerance_rad: f64,
        from_rad: [f64; 2],
    ) -> Result<[f64; 2], KinematicsError> {
        let follow = |tolerance_rad: f64| {
            let Some(turning) = Turning::new(self, [from, to], tolerance_rad, from_rad)? else {
                return Ok(from_rad);
            };
            let needed_rad = turning.at(0.0)?;
            let needed_rad = [0, 1].map(|axis| nearest_turn(needed_rad[axis], from_rad[axis]));
            // The second axis turns back where the pole is nearest.
            for share in turning.nearest_share().into_iter().chain([1.0]) {
                let reached_rad = turning.reached(needed_rad, share)?;
                if let Some(reason) = self.excess_of(reached_rad) {
                    return Err(reason);
                }
                if share == 1.0 {
                    return Ok(reached_rad);
                }
            }
            Ok(needed_rad)
        };
        let through = follow(pole_tolerance_rad.clamp(0.0, MAX_POLE_TOLERANCE_RAD));
        if pole_tolerance_rad > POLE_RAD && matches!(through, Err(KinematicsError::OutOfRange { .. })) {
            return follow(0.0).or(through);
        }
        through
    }

    fn rotary_deg(&self, position: &Position) -> [f64; 2] {
        self.letters().1.map(|axis| position[axis.index()])
    }

    fn by_angles(
        &self,
        setup: &Setup,
        start: &FiveAxisPoint,
        block: &FiveAxisBlock<'_>,
        to: [f64; 2],
    ) -> Result<FiveAxisMotion, FiveAxisRefusal> {
        let from = self.rotary_deg(&start.position);
        let end = self.point_with(block.end_mm, to, &start.position, setup).map_err(FiveAxisRefusal::at(1.0))?;
        let end_distance = self.pole_distance_rad(to.map(f64::to_radians));
        let start_distance = self.pole_distance_rad(from.map(f64::to_radians));
        let turn_deg = libm::hypot(to[0] - from[0], to[1] - from[1]);
        let path = RotaryPath::Angles { start_rad: from.map(f64::to_radians), end_rad: to.map(f64::to_radians) };
        let element = self.element(setup, start, &end, block, &path, turn_deg)?;
        Ok(FiveAxisMotion {
            elements: element.into_iter().collect(),
            end,
            least_pole_distance_rad: start_distance.min(end_distance),
            deviation_rad: 0.0,
            turn_in_pole_rad: 0.0,
        })
    }

    fn by_vector(
        &self,
        setup: &Setup,
        start: &FiveAxisPoint,
        block: &FiveAxisBlock<'_>,
        target: Vec3,
        tolerance_rad: f64,
    ) -> Result<FiveAxisMotion, FiveAxisRefusal> {
        GreatCircle::new(start.direction, target)?;
        let in_chain = |direction: Vec3| setup.to_chain(&ToolPose { tip_mm: [0.0; 3], direction }).direction;
        let directions = [in_chain(start.direction), in_chain(target)];
        let from_deg = self.rotary_deg(&start.position);
        let from_rad = from_deg.map(f64::to_radians);
        let turning = Turning::new(self, directions, tolerance_rad, from_rad).map_err(FiveAxisRefusal::at(0.0))?;
        let Some(turning) = turning else {
            // The direction stays, and so do the rotary axes.
            let end = self.point_with(block.end_mm, from_deg, &start.position, setup);
            let end = FiveAxisPoint { direction: target, ..end.map_err(FiveAxisRefusal::at(1.0))? };
            let path = RotaryPath::Angles { start_rad: from_rad, end_rad: from_rad };
            let elements = self.element(setup, start, &end, block, &path, 0.0)?.into_iter().collect();
            let least_pole_distance_rad = self.pole_distance_rad(from_rad);
            let (deviation_rad, turn_in_pole_rad) = (0.0, 0.0);
            return Ok(FiveAxisMotion { elements, end, least_pole_distance_rad, deviation_rad, turn_in_pole_rad });
        };
        let needed_rad = turning.at(0.0).map_err(FiveAxisRefusal::at(0.0))?;
        let needed_rad = [0, 1].map(|axis| nearest_turn(needed_rad[axis], from_rad[axis]));
        if travel(needed_rad, from_rad) > SAME_START_RAD {
            return self.after_turn(setup, start, block, &turning, needed_rad);
        }
        let end_rad = turning.reached(from_rad, 1.0).map_err(FiveAxisRefusal::at(1.0))?;
        let end = self.point_with(block.end_mm, end_rad.map(f64::to_degrees), &start.position, setup);
        let end = FiveAxisPoint { direction: target, ..end.map_err(FiveAxisRefusal::at(1.0))? };
        let turn_deg = turning.angle_rad.to_degrees();
        let path = RotaryPath::GreatCircle(&turning);
        let element = self.element(setup, start, &end, block, &path, turn_deg)?;
        Ok(FiveAxisMotion {
            elements: element.into_iter().collect(),
            end,
            least_pole_distance_rad: turning.pole_distance_rad(),
            deviation_rad: turning.deviation_rad(),
            turn_in_pole_rad: 0.0,
        })
    }

    /// The block with a turn of the first rotary axis to `needed_rad` before it, which the pole permits and nothing else does.
    fn after_turn(
        &self,
        setup: &Setup,
        start: &FiveAxisPoint,
        block: &FiveAxisBlock<'_>,
        turning: &Turning,
        needed_rad: [f64; 2],
    ) -> Result<FiveAxisMotion, FiveAxisRefusal> {
        let from_deg = self.rotary_deg(&start.position);
        let (_, letters) = self.letters();
        let difference = |axis: usize| from_deg[axis] - needed_rad[axis].to_degrees();
        let is_in_pole = turning.starts_in_pole();
        if !is_in_pole || difference(1).to_radians().abs() > SAME_START_RAD {
            let axis = usize::from(difference(1).abs() > difference(0).abs());
            return Err(FiveAxisRefusal::Start { axis: letters[axis], difference: difference(axis) });
        }
        let needed_deg = [needed_rad[0].to_degrees(), from_deg[1]];
        let turn = FiveAxisBlock { end_mm: start.tip_mm, curve: None, toward: Toward::Angles(needed_deg), ..*block };
        let turn = self.by_angles(setup, start, &turn, needed_deg)?;
        let turned = FiveAxisPoint { direction: start.direction, ..turn.end };
        let motion = self.elements(setup, &turned, block)?;
        let mut elements = turn.elements;
        elements.extend(motion.elements);
        Ok(FiveAxisMotion { elements, turn_in_pole_rad: difference(0).to_radians().abs(), ..motion })
    }

    /// The element from one point to another; `None` where nothing moves.
    fn element(
        &self,
        setup: &Setup,
        start: &FiveAxisPoint,
        end: &FiveAxisPoint,
        block: &FiveAxisBlock<'_>,
        path: &RotaryPath<'_>,
        turn_deg: f64,
    ) -> Result<Option<Element>, FiveAxisRefusal> {
        let tip = match block.curve {
            None => TipPath::Line([start.tip_mm, end.tip_mm]),
            Some(TipCurve::Spline(spline)) => TipPath::spline(spline.clone()),
            Some(TipCurve::Circle(circle)) => {
                TipPath::along(&circle, start.tip_mm, end.tip_mm).ok_or(FiveAxisRefusal::NotANumber)?
            }
        };
        let length_mm = tip.length_mm();
        // A shorter travel counts as none: derivatives by it would mean nothing.
        let length = if length_mm > SAME_POINT_MM { length_mm } else { turn_deg };
        if !(length > 0.0 && length.is_finite()) {
            return Ok(None);
        }
        let curve = fit(self, setup, &start.position, path, tip, length)?;
        curve.check_start(&start.position)?;
        for (axis, range) in self.ranges() {
            curve.check_range(axis, range)?;
        }
        Ok(Some(Element {
            start: start.position,
            end: end.position,
            work_offset: Position::default(),
            curve: Curve::FiveAxis(Box::new(curve)),
            length,
            source: block.source,
            rapid: block.rapid,
        }))
    }
}
