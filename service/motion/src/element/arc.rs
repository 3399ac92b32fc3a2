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
    /// Length of path per radian at the start and at the end, mm; in between it changes evenly.
    pub per_rad_mm: [f64; 2],
}

/// Radii that differ by less of themselves are the same but for rounding.
const SAME_RADIUS_SHARE: f64 = 1e-12;

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
            per_rad_mm: [0.0; 2],
        };
        if arc.is_huge() && arc.sweep_rad.abs() < 1.0 {
            // A difference of two angles is as exact as a rounded angle, too coarse here; the chord gives it exactly.
            let [du, dv] = [end[first.index()] - start[first.index()], end[second.index()] - start[second.index()]];
            arc.sweep_rad = libm::atan2(u0 * dv - v0 * du, u0 * u1 + v0 * v1);
        }
        arc
    }

    /// Measures it while other axes travel by the root of `beside_square`, mm²; its length, mm.
    ///
    /// On a spiral of radius r, which grows by k a radian, and with a rise of h a radian the path has √(r² + k² + h²) a radian. That is
    /// exact at both ends, where elements meet, and off by about (Δr / r)² / 8 in between.
    pub(super) fn measure(&mut self, beside_square: f64) -> f64 {
        let radial_mm = self.end_radius_mm - self.start_radius_mm;
        let mean_radius_mm = 0.5 * (self.start_radius_mm + self.end_radius_mm);
        let sweep_rad = self.sweep_rad.abs();
        if radial_mm.abs() > SAME_RADIUS_SHARE * mean_radius_mm {
            let square = (radial_mm * radial_mm + beside_square) / (sweep_rad * sweep_rad);
            let per_rad_mm = |radius_mm: f64| (radius_mm * radius_mm + square).sqrt();
            self.per_rad_mm = [per_rad_mm(self.start_radius_mm), per_rad_mm(self.end_radius_mm)];
            return self.mean_per_rad_mm() * sweep_rad;
        }
        let around_mm = mean_radius_mm * self.sweep_rad;
        let length_mm = (around_mm * around_mm + radial_mm * radial_mm + beside_square).sqrt();
        self.per_rad_mm = [length_mm / sweep_rad; 2];
        length_mm
    }

    /// Whether its radius changes, by more than rounding.
    pub(super) fn is_spiral(&self) -> bool {
        self.per_rad_mm[0] != self.per_rad_mm[1]
    }

    fn mean_per_rad_mm(&self) -> f64 {
        0.5 * (self.per_rad_mm[0] + self.per_rad_mm[1])
    }

    /// Share of the sweep at a share of the length.
    pub(crate) fn sweep_share(&self, length_share: f64) -> f64 {
        let [first, last] = self.per_rad_mm;
        if first == last {
            return length_share;
        }
        let travelled = self.mean_per_rad_mm() * length_share;
        2.0 * travelled / (first + (first * first + 2.0 * (last - first) * travelled).sqrt())
    }

    /// Share of the length at a share of the sweep.
    #[must_use]
    pub fn length_share(&self, sweep_share: f64) -> f64 {
        let [first, last] = self.per_rad_mm;
        if first == last {
            return sweep_share;
        }
        (first + 0.5 * (last - first) * sweep_share) * sweep_share / self.mean_per_rad_mm()
    }

    /// First, second and third derivative, by arc length, of the length that would have been travelled at this share of the sweep if it
    /// turned evenly: 1, 0 and 0 where it does.
    pub(super) fn evenness(&self, sweep_share: f64, length_mm: f64) -> [f64; 3] {
        let [first, last] = self.per_rad_mm;
        let here = first + (last - first) * sweep_share;
        let [first_derivative, bend] = [self.mean_per_rad_mm() / here, (last - first) / (here * length_mm)];
        let square = first_derivative * first_derivative;
        [first_derivative, -bend * square, 3.0 * bend * bend * square * first_derivative]
    }

    /// Upper bound of the angle turned per length, rad/mm.
    pub(crate) fn fastest_turn(&self, length_mm: f64) -> f64 {
        let turn = self.sweep_rad.abs() / length_mm;
        if self.is_spiral() { turn.max(1.0 / self.per_rad_mm[0]).max(1.0 / self.per_rad_mm[1]) } else { turn }
    }

    /// Largest share of the path along the circle.
    pub(crate) fn most_along(&self, length_mm: f64) -> f64 {
        if !self.is_spiral() {
            return self.largest_radius_mm() * self.sweep_rad.abs() / length_mm;
        }
        let [first, last] = self.per_rad_mm;
        (self.start_radius_mm / first).max(self.end_radius_mm / last)
    }

    /// Upper bound of the share of the path outwards.
    pub(crate) fn most_outwards(&self, length_mm: f64) -> f64 {
        let growth_mm = (self.end_radius_mm - self.start_radius_mm).abs();
        growth_mm / self.sweep_rad.abs() * self.fastest_turn(length_mm)
    }

    /// Bounds of the second and third derivative in [`Arc::evenness`], by the first, 1/mm and 1/mm².
    pub(crate) fn unevenness(&self, length_mm: f64) -> [f64; 2] {
        if !self.is_spiral() {
            return [0.0; 2];
        }
        // Both are largest at one of the ends, as the first is.
        let [start, end] = [0.0, 1.0].map(|share| self.evenness(share, length_mm));
        let of = |at: [f64; 3]| [at[1].abs() / at[0], at[2].abs() / at[0]];
        let ([bend, change], [other_bend, other_change]) = (of(start), of(end));
        [bend.max(other_bend), change.max(other_change)]
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
