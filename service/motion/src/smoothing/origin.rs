//! What becomes of the programmed path: what a piece of the path that is run carries out, and how far it is from that.

use serde::{Deserialize, Serialize};

use super::Entry;
use super::vector::{Vector, cross, difference, linear, norm, scaled};
use crate::tolerance::EVEN_TURN_SHARE;
use crate::{Curve, Element};

/// What an element of the path that is run carries out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Origin {
    /// A programmed block, several that lie in one line, or what corners leave of them.
    #[default]
    Block,
    /// The same, where the corner at its end stays because a stop in it takes less time than rounding it within the tolerance.
    BlockToStop,
    /// The curve in place of a corner, or a ramp of curvature between tangent blocks.
    Corner {
        /// Whether the blocks beside it have no room for a longer one, whatever the tolerance.
        fills_blocks: bool,
    },
    /// A part of one curve over many short blocks.
    Blocks {
        /// Whether the blocks here are straight and turn evenly, as the chords of an arc do.
        like_chords: bool,
    },
}

/// How far a piece of the path that is run is from the programmed path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// Largest distance between places that belong to each other, mm: in one curve over many blocks, and where blocks were merged into
    /// lines first, an upper bound of it; at a corner with an arc, at the places that were examined.
    pub largest_mm: f64,
    /// Arc length along the element where it is, mm.
    pub at_mm: f64,
}

impl Deviation {
    /// The same with a part of the start cut off, on what is left: `length` mm.
    pub(super) fn behind(self, cut_mm: f64, length: f64) -> Self {
        Self { at_mm: (self.at_mm - cut_mm).clamp(0.0, length), ..self }
    }
}

/// How a path bends from one straight element to the next: the change of direction by the mean length, along the axis of the turn.
fn bend(before: &Element, after: &Element) -> Option<Vector> {
    let are_straight = matches!((&before.curve, &after.curve), (Curve::Line, Curve::Line));
    let [from, to] = [linear(&before.tangent(before.length)), linear(&after.tangent(0.0))];
    are_straight.then(|| scaled(cross(from, to), 2.0 / (before.length + after.length)))
}

/// Whether three elements turn as the chords of one arc do.
pub(super) fn turn_evenly<T>(three: [&Entry<T>; 3]) -> bool {
    turns_differ(three) <= EVEN_TURN_SHARE
}

/// Difference of the bends between three elements, as a share of the larger one; infinite where they are not straight or do not bend.
pub(super) fn turns_differ<T>([first, second, third]: [&Entry<T>; 3]) -> f64 {
    let bends = [bend(&first.element, &second.element), bend(&second.element, &third.element)];
    let [Some(before), Some(behind)] = bends else { return f64::INFINITY };
    let largest = norm(before).max(norm(behind));
    if largest > 0.0 { norm(difference(behind, before)) / largest } else { f64::INFINITY }
}
