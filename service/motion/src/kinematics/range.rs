//! Ranges and turns of the rotary axes.

use std::f64::consts::{PI, TAU};

use super::chain::{Joint, JointValues, Kinematics, KinematicsError};
use super::description::Wrap;

/// How far beyond a range still counts as at its end, rad or mm: what rounding adds to a value at the end.
const RANGE_SLACK: f64 = 1e-9;

/// `angle` plus the turns that bring it nearest to `reference`; at half a turn it is approached in the positive
/// direction.
#[must_use]
pub(super) fn nearest_turn(angle: f64, reference: f64) -> f64 {
    let travel = angle - reference;
    angle - TAU * libm::ceil((travel - PI) / TAU)
}

impl Joint {
    /// How far a value is outside the range.
    pub(super) fn excess(&self, value: f64) -> f64 {
        let excess = self.range.map_or(0.0, |[low, high]| (low - value).max(value - high));
        if excess <= RANGE_SLACK { 0.0 } else { excess }
    }

    /// Why a rotary axis cannot be at a value; nothing where it can.
    pub(super) fn refusal(&self, value: f64) -> Option<KinematicsError> {
        let range_rad = self.range.filter(|_| self.excess(value) > 0.0)?;
        Some(KinematicsError::OutOfRange { axis: self.axis, value_rad: value, range_rad })
    }

    /// `angle` plus the turns that bring it nearest to `reference` while it stays in range, or else the value that is
    /// least outside.
    pub(super) fn nearest_in_range(&self, angle: f64, reference: f64) -> Result<f64, f64> {
        let nearest = nearest_turn(angle, reference);
        let Some([low, high]) = self.range.filter(|_| self.excess(nearest) > 0.0) else {
            return Ok(nearest);
        };
        // Outside: the equivalent that is just inside the end which is exceeded, if it is not beyond the other one.
        let above = nearest > high;
        let turns = if above { libm::floor((high - nearest) / TAU) } else { libm::ceil((low - nearest) / TAU) };
        let candidates = [turns, if above { turns + 1.0 } else { turns - 1.0 }].map(|turns| nearest + turns * TAU);
        // The second one is taken only where rounding put the first one a turn too far in.
        match candidates.map(|candidate| self.excess(candidate)) {
            [_, 0.0] => Ok(candidates[1]),
            [0.0, _] => Ok(candidates[0]),
            [first, second] => Err(candidates[usize::from(second < first)]),
        }
    }
}

impl Kinematics {
    /// The same machine with rotary axes that never run out.
    #[must_use]
    pub fn without_rotary_ranges(mut self) -> Self {
        for rotary in self.rotary {
            self.joints[rotary].range = None;
        }
        self
    }

    /// The axes that have a range and count their turns, with it, mm or degrees.
    pub fn axis_ranges(&self) -> impl Iterator<Item = (feedwave_program::Axis, [f64; 2])> + '_ {
        let counting = self.joints.iter().filter(|joint| !joint.axis.is_rotary() || joint.wrap == Wrap::Counting);
        counting.filter_map(|joint| {
            let of_program = |value: f64| if joint.axis.is_rotary() { value.to_degrees() } else { value };
            Some((joint.axis, joint.range?.map(of_program)))
        })
    }

    /// The rotary axes that have a range, with it, rad.
    pub(super) fn ranges(&self) -> impl Iterator<Item = (feedwave_program::Axis, [f64; 2])> + '_ {
        self.rotary.iter().filter_map(|&index| Some((self.joints[index].axis, self.joints[index].range?)))
    }

    /// Whether a rotary axis (0: next to the work, 1: next to the tool) rolls over.
    #[must_use]
    pub fn rolls_over(&self, rotary: usize) -> bool {
        self.joints[self.rotary[rotary]].wrap == Wrap::Rollover
    }

    /// The value a rotary axis (0: next to the work, 1: next to the tool) goes to from `from_deg` when `commanded_deg` is
    /// programmed as an absolute angle: as written for an axis that counts, the shortest path for one that rolls over; degrees.
    #[must_use]
    pub fn approach_deg(&self, rotary: usize, commanded_deg: f64, from_deg: f64) -> f64 {
        if !self.rolls_over(rotary) {
            return commanded_deg;
        }
        let (commanded_rad, from_rad) = (commanded_deg.to_radians(), from_deg.to_radians());
        commanded_deg + 360.0 * libm::round((nearest_turn(commanded_rad, from_rad) - commanded_rad) / TAU)
    }

    /// A rotary axis' value as its display shows it: within [0, 2π) for one that rolls over.
    #[must_use]
    pub fn displayed(&self, rotary: usize, value_rad: f64) -> f64 {
        match self.joints[self.rotary[rotary]].wrap {
            Wrap::Counting => value_rad,
            Wrap::Rollover => {
                let turn = value_rad - TAU * libm::floor(value_rad / TAU);
                if turn < TAU { turn } else { 0.0 }
            }
        }
    }

    /// The axes that are outside their range, with how far (mm or rad), linear ones first; empty for an allowed pose.
    pub fn out_of_range(&self, joints: &JointValues) -> impl Iterator<Item = (feedwave_program::Axis, f64)> + '_ {
        let places = self.linear.into_iter().chain(self.rotary);
        let values = joints.linear_mm.into_iter().chain(joints.rotary_rad);
        places.zip(values).filter_map(|(place, value)| {
            let joint = &self.joints[place];
            let excess = joint.excess(value);
            (excess > 0.0).then_some((joint.axis, excess))
        })
    }
}
