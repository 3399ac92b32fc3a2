//! The blend with which a vibration and an oscillation begin and end: a share of the amplitude by the place on the path, so
//! that the offset is 0 where the path rests, whatever feed and override do.

/// Blend from nothing (`x` = 0) to the whole (`x` ≥ 1): 10x³ − 15x⁴ + 6x⁵, with velocity and acceleration 0 at both ends.
#[inline]
#[must_use]
pub fn blend(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (10.0 + x * (6.0 * x - 15.0))
}

/// Largest blend(x)/x, rounded up. With a blend over at least this many amplitudes the offset never exceeds the distance
/// from the path's end.
pub const BLEND_STEEPNESS: f64 = 1.198;

/// Largest first, second and third derivative of the blend.
pub(crate) const BLEND_PEAKS: [f64; 3] = [1.875, 5.774, 60.0];

/// Path between two ends towards which an amplitude is blended out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BlendedPath {
    /// Path length over which it is blended, mm.
    pub(crate) ramp_mm: f64,
    /// Path length from the first end to where places are counted from, mm.
    pub(crate) before_mm: f64,
    /// Length of the whole path, mm; `None` while its end is further ahead than the blend.
    pub(crate) length_mm: Option<f64>,
}

impl BlendedPath {
    /// Whether the whole amplitude is there at all of these places, which ascend.
    pub(crate) fn is_whole(&self, s: &[f64]) -> bool {
        let (Some(&first), Some(&last)) = (s.first(), s.last()) else { return true };
        self.before_mm + first >= self.ramp_mm && self.left_mm(last) >= self.ramp_mm
    }

    /// The share of the amplitude at every place. Between the ends of a path shorter than two ramps both blends act.
    pub(crate) fn fill_share(&self, s: &[f64], share: &mut [f64]) {
        let per_mm = 1.0 / self.ramp_mm;
        for (share, &s) in share.iter_mut().zip(s) {
            *share = self.share_of(per_mm, s);
        }
    }

    /// The share at one place.
    pub(crate) fn share(&self, s: f64) -> f64 {
        self.share_of(1.0 / self.ramp_mm, s)
    }

    #[inline]
    fn share_of(&self, per_mm: f64, s: f64) -> f64 {
        blend((self.before_mm + s) * per_mm) * blend(self.left_mm(s) * per_mm)
    }

    fn left_mm(&self, s: f64) -> f64 {
        self.length_mm.map_or(f64::INFINITY, |length_mm| length_mm - (self.before_mm + s))
    }
}
