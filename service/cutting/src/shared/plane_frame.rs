//! X and Z of a tilted plane as travels of the machine's axes: with the rotary axes where they are, the linear ones follow the tool
//! centre point in a fixed proportion, on any chain.

use feedwave_motion::kinematics::{FiveAxisPoint, Kinematics, KinematicsError, Setup};
use feedwave_program::{Axis, Position, TiltedPlane};
use serde::{Deserialize, Serialize};

use super::setpoint::Frame;

/// Distance over which proportions are measured, mm: rounding of positions is far below what they are needed to.
const MEASURED_MM: f64 = 1_000.0;
/// Proportions below this are rounding: over a metre it is a ten-thousandth of a micrometre.
const NOTHING: f64 = 1e-13;
/// Proportions that differ by less are the same.
const SAME: f64 = 1e-9;

/// A path in X and Z of a tilted plane, from one point of the tool to another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PlaneFrame {
    /// X and Z of the plane at the start and at the end, mm.
    ends: [[f64; 2]; 2],
    /// The tool there.
    points: [FiveAxisPoint; 2],
    /// The linear axes of the chain, with their travels per mm of X and of Z.
    axes: [(Axis, [f64; 2]); 3],
    /// Travels of the tool centre point in work coordinates per mm of X and of Z.
    work: [[f64; 2]; 3],
    setup: Setup,
}

impl PlaneFrame {
    /// The frame of a path in a plane between two points of the tool, X and Z of which are `ends` in its coordinates.
    ///
    /// # Errors
    /// [`KinematicsError::Degenerate`].
    pub(crate) fn new(
        kinematics: &Kinematics,
        plane: &TiltedPlane,
        setup: &Setup,
        points: [FiveAxisPoint; 2],
        ends: [[f64; 2]; 2],
    ) -> Result<Self, KinematicsError> {
        let start = &points[0];
        let rotary_rad = kinematics.from_position(&start.position).rotary_rad;
        let at = |direction: [f64; 3], mm: f64| {
            let tip_mm = core::array::from_fn(|k| start.tip_mm[k] + mm * direction[k]);
            kinematics.joints_at(tip_mm, rotary_rad, setup).map(|joints| joints.linear_mm)
        };
        let here_mm = at([0.0; 3], 0.0)?;
        let [x_mm, z_mm] = [at(plane.axes[0], MEASURED_MM)?, at(plane.axes[2], MEASURED_MM)?];
        let letters = kinematics.letters().0;
        let share = |there_mm: f64, here_mm: f64| {
            let share = (there_mm - here_mm) / MEASURED_MM;
            if share.abs() < NOTHING { 0.0 } else { share }
        };
        let axes = core::array::from_fn(|k| (letters[k], [share(x_mm[k], here_mm[k]), share(z_mm[k], here_mm[k])]));
        let work = core::array::from_fn(|k| [plane.axes[0][k], plane.axes[2][k]]);
        Ok(Self { ends, points, axes, work, setup: *setup })
    }

    /// The frame of a path that goes on to the end of another one.
    pub(crate) fn to_end_of(&self, last: &Self) -> Self {
        Self { ends: [self.ends[0], last.ends[1]], points: [self.points[0], last.points[1]], ..self.clone() }
    }

    /// Whether the axes move in the same proportions.
    pub(crate) fn is_parallel_to(&self, other: &Self) -> bool {
        self.axes
            .iter()
            .zip(&other.axes)
            .all(|(one, two)| one.0 == two.0 && one.1.iter().zip(two.1).all(|(one, two)| (one - two).abs() < SAME))
    }

    /// The linear axes, with their travels per mm of X and of Z.
    pub(crate) const fn axes(&self) -> &[(Axis, [f64; 2]); 3] {
        &self.axes
    }

    /// The tool at the end.
    pub(crate) const fn end(&self) -> &FiveAxisPoint {
        &self.points[1]
    }

    pub(crate) const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The axes by letter where X and Z are these, mm and degrees; the end to the bit.
    pub(crate) fn position(&self, place: [f64; 2]) -> Position {
        let mut position = self.points[0].position;
        for (axis, _) in &self.axes {
            position[axis.index()] = self.value(*axis, Frame::Machine, place);
        }
        position
    }

    /// Value of an axis where X and Z are these; in work coordinates X, Y and Z are those of the tool centre point.
    pub(crate) fn value(&self, axis: Axis, frame: Frame, place: [f64; 2]) -> f64 {
        let index = axis.index();
        let is_of_work = frame == Frame::Work && index < 3;
        let [start, end] = self.points.each_ref().map(|point| match is_of_work {
            true => point.tip_mm[index],
            false => point.position[index],
        });
        if place == self.ends[1] {
            return end;
        }
        let shares = if is_of_work {
            Some(self.work[index])
        } else {
            self.axes.iter().find(|(own, _)| *own == axis).map(|(_, shares)| *shares)
        };
        let from = self.ends[0];
        shares.map_or(start, |[of_x, of_z]| start + of_x * (place[0] - from[0]) + of_z * (place[1] - from[1]))
    }
}
