//! Parts of elements.

use feedwave_program::Position;

use super::vector::{difference, linear, norm};
use crate::{Arc, Curve, Element};

impl Element {
    /// The part from arc length `from` to `to`, with 0 ≤ `from` < `to` ≤ `length`. An end that is not cut off stays
    /// exact to the bit; `None` where nothing is left, and of five-axis motion whose tool centre point rests or rounds a
    /// corner.
    pub(super) fn part(&self, from: f64, to: f64) -> Option<Self> {
        let [start, end] = [self.position(from), self.position(to)];
        let (curve, length) = match &self.curve {
            Curve::Line => (Curve::Line, distance(&start, &end)),
            Curve::Arc(arc) => {
                let [first, last] = [from / self.length, to / self.length];
                let part = arc.part(arc.sweep_share(first), arc.sweep_share(last));
                (Curve::Arc(part), self.length * (last - first))
            }
            Curve::Spline(spline) => {
                let spline = spline.between(from, to)?;
                let length = spline.length_mm();
                (Curve::Spline(Box::new(spline)), length)
            }
            Curve::FiveAxis(five_axis) => (Curve::FiveAxis(Box::new(five_axis.between(from, to)?)), to - from),
        };
        (length > 0.0).then(|| Self { start, end, curve, length, ..self.clone() })
    }
}

impl Arc {
    /// The part between two shares of the sweep: angle and radius change in proportion to each other, and still do.
    fn part(&self, first: f64, last: f64) -> Self {
        let growth_mm = self.end_radius_mm - self.start_radius_mm;
        let [first_mm, last_mm] = self.per_rad_mm;
        let per_rad_mm = |share: f64| first_mm + (last_mm - first_mm) * share;
        Self {
            per_rad_mm: [
                if first > 0.0 { per_rad_mm(first) } else { first_mm },
                if last < 1.0 { per_rad_mm(last) } else { last_mm },
            ],
            start_radius_mm: if first > 0.0 { self.start_radius_mm + growth_mm * first } else { self.start_radius_mm },
            end_radius_mm: if last < 1.0 { self.start_radius_mm + growth_mm * last } else { self.end_radius_mm },
            start_angle_rad: self.start_angle_rad + self.sweep_rad * first,
            sweep_rad: self.sweep_rad * (last - first),
            ..*self
        }
    }
}

/// Distance of two points, mm, in the axes that smoothing moves.
pub(super) fn distance(a: &Position, b: &Position) -> f64 {
    norm(difference(linear(b), linear(a)))
}

#[cfg(test)]
mod tests;
