//! Circular arcs.

use core::f64::consts::TAU;

use feedwave_program::{ArcGeometry, Axis, Position};
use serde::{Deserialize, Serialize};

use crate::tolerance::HUGE_RADIUS_MM;

/// A circular arc. Start and end radius may differ within the arc tolerance: the radius then changes in
/// proportion to the angle, so that both ends are exact and the path is continuous.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Arc {
    /// First axis of the plane.
    pub first: Axis,
    /// Second axis of the plane.
    pub second: Axis,
    /// Centre: first and second axis, mm.
    pub center: [f64; 2],
    /// Radius at the start, mm.
    pub start_radius_mm: f64,
    /// Radius at the end, mm.
    pub end_radius_mm: f64,
    /// Angle of the start seen from the centre, rad.
    pub start_angle_rad: f64,
    /// Swept angle, rad; positive from the first to the second axis.
    pub sweep_rad: f64,
}

impl Arc {
    pub(super) fn new(geometry: &ArcGeometry, start: &Position, end: &Position) -> Self {
        let (first, second) = geometry.plane.axes();
        let from_center =
            |point: &Position| [point[first.index()] - geometry.center[0], point[second.index()] - geometry.center[1]];
        let [u0, v0] = from_center(start);
        let [u1, v1] = from_center(end);
        let mut arc = Self {
            first,
            second,
            center: geometry.center,
            start_radius_mm: libm::hypot(u0, v0),
            end_radius_mm: libm::hypot(u1, v1),
            start_angle_rad: libm::atan2(v0, u0),
            sweep_rad: geometry.sweep_rad,
        };
        if arc.is_huge() && arc.sweep_rad.abs() < 1.0 {
            // A difference of two angles is as exact as a rounded angle, too coarse here; the chord gives it exactly.
            let [du, dv] = [end[first.index()] - start[first.index()], end[second.index()] - start[second.index()]];
            arc.sweep_rad = libm::atan2(u0 * dv - v0 * du, u0 * u1 + v0 * v1);
        }
        arc
    }

    /// Whether angles about the centre are too coarse to place points on the circle.
    pub(super) fn is_huge(&self) -> bool {
        self.start_radius_mm > HUGE_RADIUS_MM
    }

    /// Smallest radius, mm.
    #[must_use]
    pub fn least_radius_mm(&self) -> f64 {
        self.start_radius_mm.min(self.end_radius_mm)
    }

    /// Largest radius, mm.
    pub(super) fn largest_radius_mm(&self) -> f64 {
        self.start_radius_mm.max(self.end_radius_mm)
    }

    pub(super) fn radius_mm(&self, share: f64) -> f64 {
        self.start_radius_mm + (self.end_radius_mm - self.start_radius_mm) * share
    }

    /// Whether the arc has an extreme of position or speed in the direction `angle_rad` of one of its axes.
    ///
    /// Where the radius changes by ρ per radian, the extremes lie up to atan(2·|ρ|/r) beside the direction.
    pub(super) fn passes(&self, angle_rad: f64) -> bool {
        let radial_mm = (self.end_radius_mm - self.start_radius_mm).abs();
        let beside_rad = 2.0 * radial_mm / (self.sweep_rad.abs() * self.least_radius_mm()).max(f64::MIN_POSITIVE);
        let ahead = (angle_rad - self.start_angle_rad) * self.sweep_rad.signum();
        let ahead = ahead - (ahead / TAU).floor() * TAU;
        ahead <= self.sweep_rad.abs() + beside_rad || ahead >= TAU - beside_rad
    }
}
