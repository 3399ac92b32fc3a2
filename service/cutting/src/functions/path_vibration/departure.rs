//! How far an offset along the tangent takes the tool off the contour (docs/functions/path-vibration.md, "Three generation modes").
//!
//! With p the path, τ its direction and a the offset at s, the tool is beside p(s + a) by no more than
//!
//! ```text
//! |p(s) + a·τ(s) − p(s + a)| ≤ ∫₀ᵃ |τ(s + u) − τ(s)| du
//! ```
//!
//! so that a curve of radius R adds a²/(2R), and a junction within reach, at the distance d < |a|, adds (|a| − d)·|τ₂−τ₁|.

use std::collections::VecDeque;

use super::section::raise;

/// Changes of direction below this are the rounding of tangents.
const LEAST_CHANGE: f64 = 1e-12;
/// Junctions closer together than this share of the offset are taken for one, which adds that share to what is said of them at
/// most. It bounds the memory, however short the blocks are.
const TOGETHER_SHARE: f64 = 1.0 / 64.0;

/// Bound of how far offsets along the tangent leave the contour of a section; 0 along the path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Departure {
    /// Largest curvature, 1/mm.
    pub curvature_per_mm: f64,
    /// What junctions that are gone over add: for the largest offset of the programmed amplitude, and for the largest that the machine
    /// permits.
    pub at_junctions: [JunctionDeparture; 2],
}

/// What the junctions of a section add for an offset.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JunctionDeparture {
    /// The offset, mm.
    pub offset_mm: f64,
    /// What they add to the distance from the contour at most, mm.
    pub departure_mm: f64,
}

impl JunctionDeparture {
    fn per_mm(self) -> f64 {
        if self.offset_mm > 0.0 { self.departure_mm / self.offset_mm } else { 0.0 }
    }
}

impl Departure {
    /// Bound of the distance from the contour, mm, for offsets up to this one.
    #[must_use]
    pub fn of_mm(&self, offset_mm: f64) -> f64 {
        0.5 * self.curvature_per_mm * offset_mm * offset_mm + self.at_junctions_mm(offset_mm)
    }

    /// The part of junctions: a convex function of the offset that begins at 0, so for a smaller offset in proportion at most.
    pub(super) fn at_junctions_mm(&self, offset_mm: f64) -> f64 {
        let [programmed, permitted] = self.at_junctions;
        offset_mm * if offset_mm <= programmed.offset_mm { programmed.per_mm() } else { permitted.per_mm() }
    }

    /// Largest offset with which this tolerance is kept, mm; infinite where nothing is left.
    #[must_use]
    pub fn largest_offset_mm(&self, tolerance_mm: f64) -> f64 {
        // The root of κ/2·a² + m·a = t, in the form that does not cancel.
        let largest = |per_mm: f64| {
            let root = (per_mm * per_mm + 2.0 * self.curvature_per_mm * tolerance_mm).sqrt();
            2.0 * tolerance_mm / (per_mm + root)
        };
        let [programmed, permitted] = self.at_junctions;
        let smaller = largest(programmed.per_mm());
        if smaller <= programmed.offset_mm { smaller } else { largest(permitted.per_mm()).max(programmed.offset_mm) }
    }

    /// The larger of both.
    pub(super) fn join(&mut self, other: &Self) {
        self.curvature_per_mm = self.curvature_per_mm.max(other.curvature_per_mm);
        for (own, other) in self.at_junctions.iter_mut().zip(other.at_junctions) {
            own.offset_mm = own.offset_mm.max(other.offset_mm);
            own.departure_mm = own.departure_mm.max(other.departure_mm);
        }
    }
}

/// The junctions that an offset of this size goes over at a time.
#[derive(Clone, Debug)]
pub(super) struct JunctionReach {
    offset_mm: f64,
    within: VecDeque<Junction>,
    /// Largest departure, mm, and the line behind its junction.
    pub(super) largest: Option<(f64, u32)>,
}

/// A junction, or several close together.
#[derive(Clone, Copy, Debug)]
struct Junction {
    first_mm: f64,
    last_mm: f64,
    /// Sum of |τ₂−τ₁|.
    change: f64,
    /// Departure of an offset that begins right before it, mm, as far as the path is known.
    ahead_mm: f64,
}

impl JunctionReach {
    pub(super) const fn new(offset_mm: f64) -> Self {
        Self { offset_mm, within: VecDeque::new(), largest: None }
    }

    /// The offset does not go over what comes now.
    pub(super) fn interrupt(&mut self) {
        self.within.clear();
    }

    /// A junction that is gone over, at a place of the path; `change` is |τ₂−τ₁|. An offset leaves the contour most where it begins
    /// right at a junction, forwards before it or backwards behind it.
    pub(super) fn add(&mut self, at_mm: f64, change: f64, line: u32) {
        if change <= LEAST_CHANGE {
            return;
        }
        let Self { offset_mm, within, largest } = self;
        while within.front().is_some_and(|first| at_mm - first.last_mm >= *offset_mm) {
            within.pop_front();
        }
        let mut behind_mm = *offset_mm * change;
        for junction in within.iter_mut() {
            let reach_mm = *offset_mm - (at_mm - junction.last_mm);
            behind_mm += reach_mm * junction.change;
            junction.ahead_mm += reach_mm * change;
            raise(largest, junction.ahead_mm, line);
        }
        raise(largest, behind_mm, line);
        let together_mm = TOGETHER_SHARE * *offset_mm;
        match within.back_mut().filter(|last| at_mm - last.first_mm < together_mm) {
            // An offset may begin right before the newest of them as well.
            Some(last) => {
                last.ahead_mm += (at_mm - last.last_mm) * change;
                raise(largest, last.ahead_mm, line);
                last.change += change;
                last.last_mm = at_mm;
            }
            None => {
                let ahead_mm = *offset_mm * change;
                within.push_back(Junction { first_mm: at_mm, last_mm: at_mm, change, ahead_mm });
            }
        }
    }

    pub(super) fn departure(&self) -> JunctionDeparture {
        let departure_mm = self.largest.map_or(0.0, |(departure_mm, _)| departure_mm);
        JunctionDeparture { offset_mm: self.offset_mm, departure_mm }
    }
}

#[cfg(test)]
mod tests;
