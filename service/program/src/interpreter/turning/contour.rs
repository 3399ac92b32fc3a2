//! A contour of lines and arcs, and what passes need to know of it: where it crosses a level, and where it turns back. Points
//! are Z and X, or along and across the passes, mm.

use core::f64::consts::FRAC_PI_2;

use serde::{Deserialize, Serialize};

use crate::SourceSpan;
use crate::compensation::geometry::{Curve, Point, angle_between, minus};

/// Most blocks of a contour.
pub(super) const MAX_PIECES: usize = 2_000;

/// Levels that differ by less than this are one, mm: below any increment, far above rounding.
pub(super) const SAME_MM: f64 = 1e-6;

/// By how much a contour may turn back, mm.
pub(super) const TURNS_BACK_MM: f64 = 1e-3;

/// A quarter turn is told from one that begins or ends an arc by more than this, rad.
const ANGLE_RAD: f64 = 1e-9;

/// A block of a contour.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Piece {
    pub(super) curve: Curve,
    pub(super) span: SourceSpan,
    pub(super) is_rapid: bool,
}

/// A part of a contour that keeps one direction along both axes, and the place of its block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) curve: Curve,
    pub(super) block: usize,
}

impl Part {
    pub(super) fn rises(&self) -> bool {
        self.curve.to[1] > self.curve.from[1]
    }

    pub(super) fn falls(&self) -> bool {
        self.curve.to[1] < self.curve.from[1]
    }

    /// Where it crosses a level between those of its ends.
    pub(super) fn crossing(&self, level: f64) -> Point {
        let Curve { from, to, circle } = self.curve;
        if (level - from[1]).abs() <= f64::EPSILON * level.abs() {
            return [from[0], level];
        }
        if (level - to[1]).abs() <= f64::EPSILON * level.abs() {
            return [to[0], level];
        }
        let along = match circle {
            None => from[0] + (level - from[1]) / (to[1] - from[1]) * (to[0] - from[0]),
            Some(circle) => {
                let radius = self.curve.radius();
                let across = level - circle.center[1];
                let half = (radius * radius - across * across).max(0.0).sqrt();
                let is_behind = from[0] + to[0] > 2.0 * circle.center[0];
                circle.center[0] + if is_behind { half } else { -half }
            }
        };
        [along.clamp(from[0].min(to[0]), from[0].max(to[0])), level]
    }

    /// How high it is at a place along it, between those of its ends.
    pub(super) fn height(&self, along: f64) -> f64 {
        let Curve { from, to, circle } = self.curve;
        match circle {
            None => from[1] + (along - from[0]) / (to[0] - from[0]) * (to[1] - from[1]),
            Some(circle) => {
                let radius = self.curve.radius();
                let out = along - circle.center[0];
                let half = (radius * radius - out * out).max(0.0).sqrt();
                circle.center[1] + if from[1] + to[1] > 2.0 * circle.center[1] { half } else { -half }
            }
        }
    }

    /// The stretch of it from one of its points to another behind it.
    pub(super) fn stretch(&self, from: Point, to: Point) -> Curve {
        match self.curve.circle {
            None => Curve::line(from, to),
            Some(circle) => {
                let clockwise = circle.is_clockwise();
                let angle = angle_between(minus(from, circle.center), minus(to, circle.center), clockwise);
                // A part is at most a quarter turn.
                let angle = if angle > core::f64::consts::PI { 0.0 } else { angle };
                Curve::arc(from, to, circle.center, if clockwise { -angle } else { angle })
            }
        }
    }
}

/// The curves as parts that keep one direction along both axes.
pub(super) fn parts(curves: &[Curve]) -> Vec<Part> {
    let mut parts = Vec::with_capacity(curves.len());
    for (block, curve) in curves.iter().enumerate() {
        divide(curve, &mut |curve| parts.push(Part { curve, block }));
    }
    parts
}

/// Divides a curve at the quarters of its circle.
fn divide(curve: &Curve, emit: &mut impl FnMut(Curve)) {
    let Some(circle) = curve.circle else { return emit(*curve) };
    let radius = curve.radius();
    let out = minus(curve.from, circle.center);
    let start = libm::atan2(out[1], out[0]);
    let sense = if circle.is_clockwise() { -1.0 } else { 1.0 };
    let total = circle.sweep_rad.abs();
    let mut from = curve.from;
    let mut done = 0.0;
    // The first quarter of the circle in the sense of the arc, counted from the first axis.
    let mut quarter = if sense > 0.0 { (start / FRAC_PI_2).floor() + 1.0 } else { (start / FRAC_PI_2).ceil() - 1.0 };
    loop {
        let angle = (quarter * FRAC_PI_2 - start) * sense;
        if angle >= total - ANGLE_RAD {
            break;
        }
        if angle > ANGLE_RAD {
            let unit = match (quarter as i64).rem_euclid(4) {
                0 => [1.0, 0.0],
                1 => [0.0, 1.0],
                2 => [-1.0, 0.0],
                _ => [0.0, -1.0],
            };
            let to = [circle.center[0] + radius * unit[0], circle.center[1] + radius * unit[1]];
            emit(Curve::arc(from, to, circle.center, sense * (angle - done)));
            (from, done) = (to, angle);
        }
        quarter += sense;
    }
    emit(Curve::arc(from, curve.to, circle.center, sense * (total - done)));
}

/// The block where a contour turns back by more than is permitted: along an axis of its points, in the positive direction of
/// which it goes.
pub(super) fn turns_back(parts: &[Part], axis: usize) -> Option<usize> {
    let mut furthest = f64::NEG_INFINITY;
    for part in parts {
        furthest = furthest.max(part.curve.from[axis]);
        if part.curve.to[axis] < furthest - TURNS_BACK_MM {
            return Some(part.block);
        }
    }
    None
}
