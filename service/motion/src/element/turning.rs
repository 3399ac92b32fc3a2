//! How fast an element turns: bounds, stretch by stretch.

use super::{Curve, Element};

/// A stretch of an element, from where the one before ends (the first one: from its start), with bounds that hold everywhere on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turning {
    /// Arc length where it ends, mm.
    pub end_mm: f64,
    /// Upper bound of how fast the direction of the path on the workpiece changes, rad/mm; under five-axis motion that of the tool
    /// centre point.
    pub path_rad_per_mm: f64,
    /// Upper bound of how fast both rotary axes of a five-axis chain turn together, rad/mm.
    pub rotary_rad_per_mm: f64,
}

impl Element {
    /// Bounds of how fast it turns, from its start to its end. Where the tool centre point rests there is no direction: its path then
    /// counts as straight.
    #[must_use]
    pub fn turnings(&self) -> Vec<Turning> {
        let whole = |path_rad_per_mm| vec![Turning { end_mm: self.length, path_rad_per_mm, rotary_rad_per_mm: 0.0 }];
        match &self.curve {
            Curve::Line => whole(0.0),
            Curve::Arc(arc) => {
                let turn = arc.fastest_turn(self.length);
                whole(self.curvature() + 2.0 * arc.most_outwards(self.length) * turn)
            }
            Curve::Spline(spline) => spline
                .curvatures()
                .map(|(end_mm, path_rad_per_mm)| Turning { end_mm, path_rad_per_mm, rotary_rad_per_mm: 0.0 })
                .collect(),
            Curve::FiveAxis(five_axis) => five_axis.turnings(),
        }
    }
}
