//! The frame in which all roughing is the same: along the passes in the direction of the contour, and across them away from the
//! finished part.

use crate::compensation::geometry::{Curve, Point};

/// How Z and X become along and across.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    /// Along is X.
    pub(super) swaps: bool,
    /// Whether along and across are the negative axes: 1 or −1.
    pub(super) signs: [f64; 2],
}

impl Frame {
    /// From Z and X.
    pub(super) const fn to(&self, point: Point) -> Point {
        let [along, across] = if self.swaps { [point[1], point[0]] } else { point };
        [along * self.signs[0], across * self.signs[1]]
    }

    /// To Z and X.
    pub(super) const fn back(&self, point: Point) -> Point {
        let [along, across] = [point[0] * self.signs[0], point[1] * self.signs[1]];
        if self.swaps { [across, along] } else { [along, across] }
    }

    /// Whether angles change their sense: 1 or −1.
    fn sense(&self) -> f64 {
        self.signs[0] * self.signs[1] * if self.swaps { -1.0 } else { 1.0 }
    }

    /// A curve from Z and X.
    pub(super) fn curve(&self, curve: &Curve) -> Curve {
        self.map(curve, |point| self.to(point))
    }

    /// A curve to Z and X.
    pub(super) fn curve_back(&self, curve: &Curve) -> Curve {
        self.map(curve, |point| self.back(point))
    }

    fn map(&self, curve: &Curve, point: impl Fn(Point) -> Point) -> Curve {
        let (from, to) = (point(curve.from), point(curve.to));
        match curve.circle {
            None => Curve::line(from, to),
            Some(circle) => Curve::arc(from, to, point(circle.center), circle.sweep_rad * self.sense()),
        }
    }
}

/// A curve moved by an amount.
pub(super) fn moved(curve: &Curve, by: Point) -> Curve {
    let plus = |point: Point| [point[0] + by[0], point[1] + by[1]];
    match curve.circle {
        None => Curve::line(plus(curve.from), plus(curve.to)),
        Some(circle) => Curve::arc(plus(curve.from), plus(curve.to), plus(circle.center), circle.sweep_rad),
    }
}
