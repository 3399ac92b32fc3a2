//! What an oscillation asks of an axis while it is blended in or out. With E the blend, s the place on the path and D its length,
//! the offset E(s)·u(t) has
//!
//! ```text
//! (E·u)'   = E·u' + E'·s'·u
//! (E·u)''  = E·u'' + 2·E'·s'·u' + (E''·s'² + E'·s'')·u
//! (E·u)''' = E·u''' + 3·E'·s'·u'' + 3·(E''·s'² + E'·s'')·u' + (E'''·s'³ + 3·E''·s'·s'' + E'·s''')·u
//! ```
//!
//! Where the path does not accelerate, a sine of angular frequency ω has all of it in two parts a quarter of a period apart, so
//! that its largest value is that of a right angle: of the jerk √((E·ω³ − 3·E''·s'²·ω)² + (3·E'·s'·ω² − E'''·s'³)²). Of other
//! waveforms all parts count as if they were largest at once, and so does what directions that turn add to them.

use super::DirectionMotion;
use crate::shared::blend::{BLEND_PEAKS, blend};

/// Places of a blend at which what it adds is examined, and the share by which it is more between them at most.
const BLEND_PLACES: u32 = 256;
const BETWEEN_PLACES: f64 = 1.01;

/// What motions ask for that are largest at once.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Demand {
    /// Amplitude and peaks of velocity, acceleration and jerk behind the blend, in mm and s.
    pub(super) whole: [f64; 4],
    /// The largest velocity, acceleration and jerk, the blend at a steady feed included.
    pub(super) steady: [f64; 3],
}

impl Demand {
    /// Of motions whose phase runs faster by `turning`, with a path that goes through the blend at `rate`, 1/s.
    pub(super) fn of<'a>(
        motions: impl Iterator<Item = &'a DirectionMotion>,
        period_s: f64,
        turning: f64,
        rate: f64,
    ) -> Self {
        motions.fold(Self::default(), |sum, motion| {
            let peaks = motion.peaks(period_s);
            let own =
                [motion.amplitude_mm, peaks.velocity_mm_per_s, peaks.acceleration_mm_per_s2, peaks.jerk_mm_per_s3];
            let [a, v, c, j] = own;
            let whole = [a, turning * v, turning * turning * c, turning * turning * turning * j];
            sum.plus(&Self { whole, steady: steady(whole, motion.wave.is_sine().then_some(own), rate) })
        })
    }

    /// Both at once.
    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            whole: core::array::from_fn(|order| self.whole[order] + other.whole[order]),
            steady: core::array::from_fn(|order| self.steady[order] + other.steady[order]),
        }
    }

    /// What an axis has of it that carries this share of its direction.
    pub(super) fn scaled(&self, share: f64) -> Self {
        Self { whole: self.whole.map(|peak| share * peak), steady: self.steady.map(|peak| share * peak) }
    }

    /// Largest slope of the offset over the path: E'·A.
    pub(super) fn slope(&self, ramp_mm: f64) -> f64 {
        BLEND_PEAKS[0] * self.whole[0] / ramp_mm
    }

    /// Jerk that each mm/s² of the path's acceleration asks for within a blend at most: 3·E'·u' + 3·E''·s'·u.
    pub(super) fn jerk_by_acceleration(&self, rate: f64, ramp_mm: f64) -> f64 {
        let ([first, second, _], [amplitude, velocity, ..]) = (BLEND_PEAKS, self.whole);
        3.0 * (first * velocity + second * rate * amplitude) / ramp_mm
    }
}

/// Largest velocity, acceleration and jerk of a motion with this amplitude and these peaks at a steady feed, at the worst place. Of a
/// sine, what it has where nothing turns.
fn steady(whole: [f64; 4], sine: Option<[f64; 4]>, rate: f64) -> [f64; 3] {
    let mut most = [whole[1], whole[2], whole[3]];
    for place in 0..=BLEND_PLACES {
        let x = f64::from(place) / f64::from(BLEND_PLACES);
        let rest = 1.0 - x;
        let blend = [
            blend(x),
            30.0 * x * x * rest * rest * rate,
            60.0 * x * rest * (rest - x) * rate * rate,
            60.0 * (1.0 - 6.0 * x * rest) * rate * rate * rate,
        ];
        let mut here = at_once(whole, blend);
        if let Some(own) = sine {
            let (exact, summed) = (at_right_angles(own, blend), at_once(own, blend));
            here = core::array::from_fn(|order| exact[order] + here[order] - summed[order]);
        }
        for (most, here) in most.iter_mut().zip(here) {
            *most = most.max(here * BETWEEN_PLACES);
        }
    }
    most
}

/// All parts of velocity, acceleration and jerk as if they were largest at once.
fn at_once([a, v, c, j]: [f64; 4], [share, first, second, third]: [f64; 4]) -> [f64; 3] {
    let [second, third] = [second, third].map(f64::abs);
    [
        share * v + first * a,
        share * c + 2.0 * first * v + second * a,
        share * j + 3.0 * first * c + 3.0 * second * v + third * a,
    ]
}

/// Those of a sine.
fn at_right_angles([a, v, c, j]: [f64; 4], [share, first, second, third]: [f64; 4]) -> [f64; 3] {
    [
        libm::hypot(share * v, first * a),
        libm::hypot(share * c - second * a, 2.0 * first * v),
        libm::hypot(share * j - 3.0 * second * v, 3.0 * first * c - third * a),
    ]
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;

    use super::*;
    use crate::functions::tool_oscillation::Waveform;

    /// The largest velocity, acceleration and jerk of a blended motion by differences, over all phases.
    fn by_differences(motion: &DirectionMotion, period_s: f64, rate: f64) -> [f64; 3] {
        let step_s = 2e-5;
        let mut most = [0.0_f64; 3];
        for phase in 0..64 {
            let at = |index: i32| {
                let t = f64::from(index) * step_s;
                blend(t * rate) * motion.offset_mm(t / period_s + f64::from(phase) / 64.0)
            };
            let last = (1.2 / rate / step_s) as i32;
            for index in 0..last {
                let [a, b, c, d] = [0, 1, 2, 3].map(|more| at(index + more));
                let here =
                    [(b - a) / step_s, (c - 2.0 * b + a) / step_s.powi(2), (d - 3.0 * (c - b) - a) / step_s.powi(3)];
                most = core::array::from_fn(|order| most[order].max(here[order].abs()));
            }
        }
        most
    }

    #[test]
    fn what_a_blend_asks_for_is_never_less_than_differences_show_and_of_a_sine_hardly_more() {
        for (waveform, most) in [(Waveform::Sine, 1.02), (Waveform::JerkLimitedHeldPeak { hold_share: 0.3 }, 3.0)] {
            let wave = waveform.compile().expect("possible");
            let motion = DirectionMotion { amplitude_mm: 0.4, phase_turns: 0.0, wave };
            for (period_s, rate) in [(0.1, 10.0), (0.1, 3.0), (0.05, 25.0), (0.1, 1e-3 * TAU)] {
                let Demand { steady, .. } = Demand::of(core::iter::once(&motion), period_s, 1.0, rate);
                let shown = by_differences(&motion, period_s, if rate < 0.1 { 3.0 } else { rate });
                if rate < 0.1 {
                    // A slow blend adds next to nothing.
                    let peaks = motion.peaks(period_s);
                    assert!(steady[2] < 1.02 * peaks.jerk_mm_per_s3, "{steady:?} {peaks:?}");
                    continue;
                }
                for order in 0..3 {
                    let ratio = steady[order] / shown[order];
                    assert!((0.999..most).contains(&ratio), "{waveform:?} {period_s} {rate} {order}: {ratio}");
                }
            }
        }
    }
}
