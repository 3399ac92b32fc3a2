//! The element that rounds a corner between two five-axis blocks: the tool centre point along a curve, and the rotary axes
//! with the angles, velocities and accelerations of both blocks at its ends.
//!
//! With the rotary axes as quintic polynomials of the arc length, and a curve that continues direction and curvature of both
//! blocks, every machine axis passes both ends of the corner with a continuous second derivative: the linear axes are smooth
//! functions of both. Between blocks whose angles change by θ₀′ and θ₁′ per length, the polynomial is nowhere farther than
//! 3/32·|θ₁′ − θ₀′|·L from them, L being the length of the corner.

use feedwave_program::Position;

use super::fit::{RotaryPath, fit};
use crate::kinematics::chain::Kinematics;
use crate::kinematics::tip::TipPath;
use crate::kinematics::vector::angle;
use crate::{Curve, Element, Spline};

/// Places in each half of a corner at which directions are compared.
const HALF_SAMPLES: usize = 8;
/// Largest angle of a polynomial from the blocks, as a share of the change of slope times the length.
const QUINTIC_DEVIATION: f64 = 3.0 / 32.0;
/// Step for the change of direction by a small turn, mm: far below what a direction changes in, far above rounding.
const SLOPE_STEP_MM: f64 = 1e-4;

/// How corners under tool centre point control are rounded.
#[derive(Clone, Copy, Debug)]
pub struct FiveAxisCorners<'a> {
    /// The machine.
    pub kinematics: &'a Kinematics,
    /// Largest angle between the programmed tool direction and the one that is taken, rad.
    pub direction_tolerance_rad: f64,
}

/// The rotary axes along a corner: polynomials of the share of its length, rad.
pub(crate) type Turns = [[f64; 6]; 2];

impl FiveAxisCorners<'_> {
    fn rotary(&self, position: &Position) -> [f64; 2] {
        self.kinematics.from_position(position).rotary_rad
    }

    /// Length of corner, mm, by which the tolerance is used up about; infinite where the direction goes straight on.
    pub(crate) fn longest_mm(&self, before: &Element, after: &Element) -> f64 {
        let at_rad = self.rotary(&before.end);
        let slopes = [before.tangent(before.length), after.tangent(0.0)].map(|slope| self.rotary(&slope));
        let turned = [0, 1].map(|axis| at_rad[axis] + (slopes[1][axis] - slopes[0][axis]) * SLOPE_STEP_MM);
        let directions = self.kinematics.rotary_directions();
        let kink_per_mm = angle(directions.at(at_rad), directions.at(turned)) / SLOPE_STEP_MM;
        self.direction_tolerance_rad / (QUINTIC_DEVIATION * kink_per_mm)
    }

    /// The rotary axes from the end of one block, cut back already, to the start of the other, over a corner of this length.
    pub(crate) fn turns(&self, before: &Element, after: &Element, length_mm: f64) -> Turns {
        let ends = [(before, before.length), (after, 0.0)].map(|(element, s)| {
            let [value, slope, bend] = [element.position(s), element.tangent(s), element.second_derivative(s)];
            [self.rotary(&value), self.rotary(&slope), self.rotary(&bend)]
        });
        let square = length_mm * length_mm;
        core::array::from_fn(|axis| {
            let [[p, v, a], [q, w, b]] =
                ends.map(|[value, slope, bend]| [value[axis], slope[axis] * length_mm, bend[axis] * square]);
            let travel = q - p;
            [
                p,
                v,
                0.5 * a,
                10.0 * travel - 6.0 * v - 4.0 * w - 1.5 * a + 0.5 * b,
                -15.0 * travel + 8.0 * v + 7.0 * w + 1.5 * a - b,
                6.0 * travel - 3.0 * (v + w) - 0.5 * a + 0.5 * b,
            ]
        })
    }

    /// Largest angle between the direction along a corner and that of the blocks at the place that belongs to it, rad, where
    /// `cut_mm` is cut from both of them.
    pub(crate) fn deviation_rad(&self, [before, after]: [&Element; 2], cut_mm: f64, turns: &Turns) -> f64 {
        let directions = self.kinematics.rotary_directions();
        let mut largest = 0.0_f64;
        for sample in 1..2 * HALF_SAMPLES {
            let share = sample as f64 / (2 * HALF_SAMPLES) as f64;
            let from_corner_mm = (2.0 * share - 1.0) * cut_mm;
            let programmed = if from_corner_mm < 0.0 {
                before.position(before.length + from_corner_mm)
            } else {
                after.position(from_corner_mm)
            };
            let taken = turns.map(|turn| turn.iter().rev().fold(0.0, |sum, coefficient| sum * share + coefficient));
            largest = largest.max(angle(directions.at(self.rotary(&programmed)), directions.at(taken)));
        }
        largest
    }

    /// The element along a curve from the end of one block, cut back already, to the start of the other; `None` where a
    /// rotary axis would leave its range, or the axes cannot follow.
    pub(crate) fn element(&self, before: &Element, after: &Element, tip: Spline, turns: Turns) -> Option<Element> {
        let Curve::FiveAxis(own) = &before.curve else { return None };
        let length = tip.length_mm();
        let tip = TipPath::spline(tip);
        let curve = fit(self.kinematics, own.setup(), &before.end, &RotaryPath::Quintics(turns), tip, length).ok()?;
        curve.check_start(&before.end).ok()?;
        for (axis, range) in self.kinematics.ranges() {
            curve.check_range(axis, range).ok()?;
        }
        Some(Element {
            start: before.end,
            end: after.start,
            work_offset: Position::default(),
            curve: Curve::FiveAxis(Box::new(curve)),
            length,
            source: after.source,
            rapid: false,
        })
    }
}
