//! The ramps of constant jerk in which a path leaves rest and comes to it.

use super::path::{MovedAxis, Path};
use super::{End, check};
use crate::tolerance::{SPEED_CHECKED_SHARE, SPEED_LIMIT_SHARE, SPEED_RAMP_INTERVALS, SPEED_RAMP_SHARE};

/// How often a ramp is shortened.
const TRIES: u32 = 16;

/// Largest acceleration and jerk along the path at a place, mm/s² and mm/s³.
#[derive(Clone, Copy)]
pub(super) struct AlongPath {
    pub(super) acceleration: f64,
    pub(super) jerk: f64,
}

impl AlongPath {
    pub(super) fn at(path: &Path<'_>, s: f64) -> Self {
        let mut derivatives = vec![[0.0; 3]; path.axes.len()];
        path.derivatives(s, &mut derivatives);
        let smallest = |limit: fn(&MovedAxis) -> f64| {
            let along = |(axis, [first, ..]): (&MovedAxis, &[f64; 3])| limit(axis) / first.abs();
            path.axes.iter().zip(&derivatives).map(along).fold(f64::MAX, f64::min)
        };
        Self { acceleration: smallest(|axis| axis.acceleration), jerk: smallest(|axis| axis.jerk) }
    }

    /// Time that the acceleration takes from zero to its largest, s.
    pub(super) fn change_s(self) -> f64 {
        self.acceleration / self.jerk
    }
}

/// A ramp of constant jerk from or to rest; nothing at an end that moves.
#[derive(Clone, Copy, Default)]
pub(super) struct Ramp {
    pub(super) jerk: f64,
    pub(super) time_s: f64,
    pub(super) length: f64,
}

impl Ramp {
    pub(super) fn new(jerk: f64, time_s: f64) -> Self {
        Self { jerk, time_s, length: jerk * time_s * time_s * time_s / 6.0 }
    }

    /// b and |b′| where the ramp meets the spline.
    pub(super) fn state(&self) -> (f64, f64) {
        let speed = 0.5 * self.jerk * self.time_s * self.time_s;
        (speed * speed, 2.0 * self.jerk * self.time_s)
    }

    /// The ramp at the start (0) or the end (1) of a path, as long as two intervals where there is room for it; nothing where
    /// the path moves there, and `None` where none keeps the limits.
    pub(super) fn at_end(path: &Path<'_>, k: usize, end: End, limits: AlongPath, interval_s: f64) -> Option<Self> {
        let End { speed, reserve, .. } = end;
        if speed > 0.0 {
            return Some(Self::default());
        }
        let jerk = SPEED_LIMIT_SHARE * SPEED_LIMIT_SHARE * (1.0 - reserve) * limits.jerk;
        let shortest_s = libm::cbrt(6.0 * SPEED_RAMP_SHARE * path.length / jerk);
        let time_s = (SPEED_RAMP_INTERVALS * interval_s).min(0.25 * limits.change_s()).min(shortest_s);
        let mut ramp = Self::new(jerk, time_s);
        // Where the path bends, it has to be shorter.
        for _ in 0..TRIES {
            let ratio = check::ramp(path, k, ramp) / (1.0 - reserve);
            if ratio <= SPEED_CHECKED_SHARE {
                break;
            }
            ramp = Self::new(ramp.jerk * (0.99 / ratio).max(0.7), 0.7 * ramp.time_s);
        }
        (check::ramp(path, k, ramp) <= SPEED_CHECKED_SHARE * (1.0 - reserve)).then_some(ramp)
    }
}
