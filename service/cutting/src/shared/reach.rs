//! How far an oscillation takes the axes from the path.

use feedwave_motion::{Curve, Element};
use feedwave_program::{Axis, Position};

/// Places of a curved element at which its extent with the oscillation is examined.
const PLACES: u32 = 512;

/// How far an oscillation moves the tool from an element at most.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Reach {
    /// Along the feed, across it in the work plane, and along Z, of a tool that stands along Z, mm.
    InPlane { feed_mm: f64, cross_mm: f64, axial_mm: f64 },
    /// Of a guided tool, by linear axis, mm.
    Guided([(Axis, f64); 3]),
}

impl Reach {
    /// The most that an element spans with it, work coordinates.
    pub(crate) fn at_most(&self, element: &Element) -> (Position, Position) {
        let mut extent = element.extent();
        match *self {
            Self::InPlane { feed_mm, cross_mm, axial_mm } => {
                // Where the path climbs, Z has a part of the offset along the feed.
                let most = [feed_mm + cross_mm, feed_mm + cross_mm, axial_mm + feed_mm];
                let most = core::array::from_fn::<_, 3, _>(|axis| ([Axis::X, Axis::Y, Axis::Z][axis], most[axis]));
                widen(&mut extent, &most);
            }
            Self::Guided(axes) => widen(&mut extent, &axes),
        }
        extent
    }

    /// What an element spans with it, work coordinates.
    pub(crate) fn extent(&self, element: &Element) -> (Position, Position) {
        let Self::InPlane { feed_mm, cross_mm, axial_mm } = *self else { return self.at_most(element) };
        let mut extent = element.extent();
        widen(&mut extent, &[(Axis::Z, axial_mm)]);
        // What a curve may swing out between two places.
        let step_mm = element.length / f64::from(PLACES);
        let (places, between_mm) = match element.curve {
            Curve::Line => (1, 0.0),
            _ => (PLACES, 0.25 * element.curvature().abs() * step_mm * step_mm),
        };
        for place in 0..=places {
            let s = element.length * f64::from(place) / f64::from(places);
            let tangent = element.tangent(s);
            let [along_x, along_y, along_z] = [Axis::X, Axis::Y, Axis::Z].map(|axis| tangent[axis.index()].abs());
            let in_plane = libm::hypot(along_x, along_y);
            if in_plane == 0.0 {
                continue;
            }
            let length = libm::hypot(in_plane, along_z);
            let offset = |along: f64, beside: f64| feed_mm * along / length + cross_mm * beside / in_plane;
            let offsets = [
                (Axis::X, offset(along_x, along_y)),
                (Axis::Y, offset(along_y, along_x)),
                (Axis::Z, axial_mm + feed_mm * along_z / length),
            ];
            let climbs = along_z > 0.0;
            for (axis, offset_mm) in offsets.into_iter().take(if climbs { 3 } else { 2 }) {
                let mut at = [0.0];
                element.fill_axis(axis, &[s], &mut at);
                let index = axis.index();
                extent.0[index] = extent.0[index].min(at[0] - offset_mm - between_mm);
                extent.1[index] = extent.1[index].max(at[0] + offset_mm + between_mm);
            }
        }
        extent
    }
}

fn widen((low, high): &mut (Position, Position), by: &[(Axis, f64)]) {
    for &(axis, mm) in by {
        low[axis.index()] -= mm;
        high[axis.index()] += mm;
    }
}
