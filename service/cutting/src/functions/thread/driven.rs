//! The axes that carry out a pass: X and Z by themselves, or, in a tilted plane, every linear axis by its share of both.

use feedwave_motion::{Machine, PathLimits};
use feedwave_program::Axis;

use super::LeadAxis;
use super::pass::{TAPER_SHARE, axis_limits};
use crate::shared::plane_frame::PlaneFrame;

/// An axis that a pass moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DrivenAxis {
    pub(super) axis: Axis,
    /// Its travel per mm of X and of Z.
    shares: [f64; 2],
    pub(super) limits: PathLimits,
}

/// The axes of a pass.
pub(super) fn driven_axes(frame: Option<&PlaneFrame>, machine: &Machine) -> Vec<DrivenAxis> {
    let of = |(axis, shares): (Axis, [f64; 2])| DrivenAxis { axis, shares, limits: axis_limits(machine, axis) };
    match frame {
        None => [(Axis::X, [1.0, 0.0]), (Axis::Z, [0.0, 1.0])].into_iter().map(of).collect(),
        Some(frame) => frame.axes().iter().filter(|(_, shares)| *shares != [0.0; 2]).copied().map(of).collect(),
    }
}

impl DrivenAxis {
    /// Its part of a travel of X and Z, or of a velocity.
    pub(super) fn part(&self, [x, z]: [f64; 2]) -> f64 {
        self.shares[0] * x + self.shares[1] * z
    }

    /// Its travel per mm across the lead and along it, without a sign.
    pub(super) fn across_and_along(&self, lead_axis: LeadAxis) -> [f64; 2] {
        let [x, z] = self.shares.map(f64::abs);
        match lead_axis {
            LeadAxis::Z => [x, z],
            LeadAxis::X => [z, x],
        }
    }

    /// Share of its limits that changes of speed take beside the vibration: all of it along the lead, [`TAPER_SHARE`] across it, and
    /// in between in the proportion in which it carries both.
    pub(super) fn change_share(&self, lead_axis: LeadAxis) -> f64 {
        let [across, along] = self.across_and_along(lead_axis);
        TAPER_SHARE + (1.0 - TAPER_SHARE) * (along / (across + along))
    }

    /// Its limits as limits of what moves across the lead; `None` where that does not move it.
    pub(super) fn limits_across(&self, lead_axis: LeadAxis) -> Option<PathLimits> {
        let [across, _] = self.across_and_along(lead_axis);
        let PathLimits { velocity, acceleration, jerk } = self.limits;
        (across > 0.0).then(|| PathLimits {
            velocity: velocity / across,
            acceleration: acceleration / across,
            jerk: jerk / across,
        })
    }

    /// Share of its limits that is left for the vibration: all of it where changes of speed do not move it, neither along the lead nor
    /// across it (`moves_across`).
    pub(super) fn vibration_share(&self, lead_axis: LeadAxis, moves_across: bool) -> f64 {
        let [_, along] = self.across_and_along(lead_axis);
        if moves_across || along > 0.0 { 1.0 - self.change_share(lead_axis) } else { 1.0 }
    }
}
