//! Arcs whose radius changes, mostly by the rounding of I, J and K: they turn unevenly along their length.

use super::{Arc, Curve, Element};

/// Places that are evened together.
const EVENED_TOGETHER: usize = 64;

impl Element {
    /// An arc whose radius changes.
    pub(super) fn spiral(&self) -> Option<&Arc> {
        match &self.curve {
            Curve::Arc(arc) if arc.is_spiral() => Some(arc),
            _ => None,
        }
    }

    /// What would have been travelled if it turned evenly, in place of the arc length `s`, mm: the same but on spirals.
    #[must_use]
    pub fn evened(&self, s: f64) -> f64 {
        match self.spiral() {
            Some(arc) if s > 0.0 && s < self.length => self.length * arc.sweep_share(s / self.length),
            _ => s,
        }
    }

    /// Fills `out` by the lengths of [`Element::evened`] in place of `s`.
    pub(super) fn for_evened(&self, arc: &Arc, s: &[f64], out: &mut [f64], fill: impl Fn(&[f64], &mut [f64])) {
        let mut buffer = [0.0; EVENED_TOGETHER];
        let per_length = 1.0 / self.length;
        for (s, out) in s.chunks(EVENED_TOGETHER).zip(out.chunks_mut(EVENED_TOGETHER)) {
            let even = &mut buffer[..s.len()];
            for (even, &s) in even.iter_mut().zip(s) {
                let inside = self.length * arc.sweep_share(s.max(0.0) * per_length);
                *even = if s < self.length { inside } else { s };
            }
            fill(even, out);
        }
    }
}
