//! What the place where two elements meet asks of the curve.

use serde::{Deserialize, Serialize};

use super::corner::{self, CornerSpeed};
use super::ways::Way;
use crate::Element;
use crate::tolerance::{
    CURVE_MOST_END_MM, CURVE_MOST_END_REACH, LEAST_CORNER_COSINE, RAMP_DEVIATION, SAME_POINT_MM, TANGENT_TOLERANCE_RAD,
};

/// Where an element meets the next one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Joint {
    /// Nothing is known of the next one.
    Unknown,
    /// It stays as it is.
    Fixed,
    /// A curve may pass it.
    Corner {
        /// What it would reach into both elements, mm; 0 where it is to be passed by itself.
        reach_mm: f64,
        /// Difference of the directions, 2·sin(θ/2).
        kink: f64,
        /// Angle that a curve has to pass, rad: that of the path, or one that leaves it as little room as a turn of the tool does.
        angle_rad: f64,
        /// Distance of corners like it on both sides from which on a stop in it takes less time than passing it, mm.
        stop_from_mm: f64,
        /// How it is passed, where that is decided.
        way: Way,
    },
}

impl Joint {
    /// What a curve within this tolerance would reach, whatever the lengths of the elements.
    pub(super) fn between(before: &Element, after: &Element, tolerance_mm: f64, speed: CornerSpeed) -> Self {
        let Some((kink, bend, cosine)) = corner::steps(before, after, SAME_POINT_MM) else { return Self::Fixed };
        // A direction that is no number is kept as well.
        let goes_on = cosine >= LEAST_CORNER_COSINE;
        if !goes_on {
            return Self::Fixed;
        }
        let mut reach_mm = corner::reach_mm(kink, tolerance_mm, speed);
        if kink <= TANGENT_TOLERANCE_RAD {
            reach_mm = reach_mm.min((tolerance_mm / (RAMP_DEVIATION * bend)).sqrt());
        }
        let curvature = corner::largest_curvature(before, after);
        reach_mm = reach_mm.min(CURVE_MOST_END_REACH * (tolerance_mm / curvature).sqrt());
        Self::corner(reach_mm, kink, kink)
    }

    /// A corner that nothing is decided of, with its reach, mm, the difference of the directions and the angle that a curve has to pass.
    pub(super) fn corner(reach_mm: f64, kink: f64, angle_rad: f64) -> Self {
        let reach_mm = reach_mm.min(CURVE_MOST_END_MM);
        Self::Corner { reach_mm, kink, angle_rad, stop_from_mm: f64::INFINITY, way: Way::Open }
    }

    /// Difference of the directions, where a curve may pass it.
    pub(super) fn kink(&self) -> Option<f64> {
        match *self {
            Self::Corner { kink, .. } => Some(kink),
            Self::Unknown | Self::Fixed => None,
        }
    }

    /// How it is passed, where that is decided.
    pub(super) fn way(&self) -> Way {
        match *self {
            Self::Corner { way, .. } => way,
            Self::Unknown | Self::Fixed => Way::Open,
        }
    }

    /// Decides that the path stops in it, where a curve could pass it.
    pub(super) fn stop(&mut self) {
        if let Self::Corner { way, .. } = self {
            *way = Way::Stop;
        }
    }

    /// [`Joint::kink`], where a place that stays as it is counts as the sharpest.
    pub(super) fn turn(&self) -> f64 {
        self.kink().unwrap_or(f64::INFINITY)
    }
}
