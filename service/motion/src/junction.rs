//! How fast the path may run from one element into the next.
//!
//! Two elements that meet tangentially still differ a little in direction (rounded end points) and mostly in
//! curvature (a line runs into an arc). With path speed v the axes see a velocity step v·Δτ and an acceleration step
//! v²·Δp″. Setpoints spread a step over the interpolation period T: their second differences are the acceleration
//! averaged with a hat of height 1/T, their third differences the jerk averaged with a quadratic B-spline of height
//! ¾/T and slope at most 1/T². Where elements are shorter than v·T several junctions fall into one average: with
//! elements of length ℓ their steps then come at the rate v/ℓ. A junction thus adds at most
//!
//! ```text
//! v·Δτ·max(1/T, v/ℓ)          to the acceleration
//! v·Δτ·max(1/T, 3/2·v/ℓ)/T    to the jerk, and
//! v²·Δp″·max(3/4/T, v/ℓ)      to the jerk
//! a·Δτ·max(1/T, v/ℓ)          to the jerk, where the path accelerates by a through it
//! ```
//!
//! of an axis. Each may use a fixed share of the axis' limit, and the elements on both sides leave that share free.
//!
//! A corner is passed with the step of velocity v·Δτ that the machine permits of an axis. In chords the steps follow each other at
//! the rate v/ℓ, which is an acceleration of v²·Δτ/ℓ however small each of them is. It may use a share of the axis' limit too.

use feedwave_program::{AXIS_COUNT, Position};
use serde::{Deserialize, Serialize};

use crate::tolerance::{
    BEND_JERK_SHARE, KINK_ACCELERATION_SHARE, KINK_JERK_SHARE, KINK_RAMP_SHARE, LARGEST_RESERVE, SAME_POINT_MM,
    TANGENT_TOLERANCE_RAD,
};
use crate::{Element, Machine};

/// What a machine allows at junctions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct JunctionRules {
    period_s: f64,
    /// Per axis 1/(largest acceleration), s²/mm; 0 where the machine has no such axis.
    per_acceleration: Position,
    /// Per axis 1/(largest jerk), s³/mm; 0 where the machine has no such axis.
    per_jerk: Position,
    /// Per axis the largest step of its velocity at a corner, mm/s; 0 where the machine has no such axis.
    velocity_step: Position,
}

/// A junction that the path passes without resting.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Junction {
    /// Highest speed, mm/s.
    pub(crate) speed: f64,
    /// Share of acceleration and jerk that the elements on both sides leave to it.
    pub(crate) reserve: f64,
    /// Largest acceleration along the path through it, mm/s²; 0 where there must be none.
    pub(crate) acceleration: f64,
}

impl Junction {
    /// Where the path rests.
    pub(crate) const REST: Self = Self { speed: 0.0, reserve: 0.0, acceleration: 0.0 };
    /// Inside an element: nothing changes.
    pub(crate) const NONE: Self = Self { speed: f64::INFINITY, reserve: 0.0, acceleration: f64::INFINITY };

    /// A corner that may be passed at this speed where it stands alone, and has elements of this length beside it. The step of
    /// velocity of the axis with the least acceleration for it is `kink` of the speed, over that acceleration, s²/mm.
    fn at_corner(speed: f64, kink: f64, length_mm: f64) -> Self {
        let speed = speed.min((LARGEST_RESERVE * length_mm / kink).sqrt());
        let reserve = speed * speed * kink / length_mm;
        Self { speed, reserve, acceleration: 0.0 }
    }
}

impl JunctionRules {
    pub(crate) fn new(machine: &Machine, period_s: f64) -> Self {
        let mut rules = Self {
            period_s,
            per_acceleration: [0.0; AXIS_COUNT],
            per_jerk: [0.0; AXIS_COUNT],
            velocity_step: [0.0; AXIS_COUNT],
        };
        // Two axes that carry out the same program axis together are limited by the weaker one.
        for axis in &machine.axes {
            let index = axis.axis.index();
            let is_first = rules.per_jerk[index] == 0.0;
            let other_step = if is_first { f64::INFINITY } else { rules.velocity_step[index] };
            rules.velocity_step[index] = axis.max_velocity_step_per_s.min(other_step);
            rules.per_acceleration[index] = rules.per_acceleration[index].max(1.0 / axis.max_acceleration_per_s2);
            rules.per_jerk[index] = rules.per_jerk[index].max(1.0 / axis.max_jerk_per_s3);
        }
        rules
    }

    /// The junction from one element to the next at no more than `top_speed`, with no more than `acceleration` along
    /// the path; `None` where the path must rest. A corner is passed only where `passes_corners`.
    pub(crate) fn junction(
        &self,
        from: &Element,
        to: &Element,
        top_speed: f64,
        acceleration: f64,
        passes_corners: bool,
    ) -> Option<Junction> {
        if from.rapid != to.rapid {
            return None;
        }
        let tangents = [from.tangent(from.length), to.tangent(0.0)];
        let bends = [from.second_derivative(from.length), to.second_derivative(0.0)];
        let mut square = 0.0;
        // Largest steps relative to the axes' limits, per unit of v and v².
        let (mut kink_acceleration, mut kink_jerk, mut bend_jerk) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut corner_speed = top_speed;
        let length = from.length.min(to.length);
        for index in 0..AXIS_COUNT {
            let gap = (to.start[index] + to.work_offset[index]) - (from.end[index] + from.work_offset[index]);
            if gap.abs() > SAME_POINT_MM {
                return None;
            }
            let kink = (tangents[1][index] - tangents[0][index]).abs();
            let bend = (bends[1][index] - bends[0][index]).abs();
            square += kink * kink;
            if kink > 0.0 {
                corner_speed = corner_speed.min(self.velocity_step[index] / kink);
            }
            kink_acceleration = kink_acceleration.max(kink * self.per_acceleration[index]);
            kink_jerk = kink_jerk.max(kink * self.per_jerk[index]);
            bend_jerk = bend_jerk.max(bend * self.per_jerk[index]);
        }
        if square > TANGENT_TOLERANCE_RAD * TANGENT_TOLERANCE_RAD {
            let passes = passes_corners && !from.rapid && corner_speed > 0.0;
            return passes.then(|| Junction::at_corner(corner_speed, kink_acceleration, length));
        }

        let period_s = self.period_s;
        // A division by zero is no limit at all.
        let speed = top_speed
            .min(KINK_ACCELERATION_SHARE * period_s / kink_acceleration)
            .min((KINK_ACCELERATION_SHARE * length / kink_acceleration).sqrt())
            .min(KINK_JERK_SHARE * period_s * period_s / kink_jerk)
            .min((KINK_JERK_SHARE * period_s * length / (1.5 * kink_jerk)).sqrt())
            .min((BEND_JERK_SHARE * period_s / (0.75 * bend_jerk)).sqrt())
            .min(libm::cbrt(BEND_JERK_SHARE * length / bend_jerk));

        let per_s = speed / length;
        // The path's own acceleration steps in the direction of an axis, too.
        let ramp_jerk_per_acceleration = kink_jerk * per_s.max(1.0 / period_s);
        let top_acceleration = KINK_RAMP_SHARE / ramp_jerk_per_acceleration;
        let ramp_jerk = acceleration.min(top_acceleration) * ramp_jerk_per_acceleration;
        let acceleration = speed * kink_acceleration * per_s.max(1.0 / period_s);
        let jerk = speed * kink_jerk * (1.5 * per_s).max(1.0 / period_s) / period_s
            + speed * speed * bend_jerk * per_s.max(0.75 / period_s)
            + ramp_jerk;
        let reserve = jerk.max(acceleration * (LARGEST_RESERVE / KINK_ACCELERATION_SHARE)).min(LARGEST_RESERVE);
        (speed > 0.0).then_some(Junction { speed, reserve, acceleration: top_acceleration })
    }
}

#[cfg(test)]
mod tests;
