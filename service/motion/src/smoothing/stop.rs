//! Whether a corner takes less time rounded than with a stop in it, in a plan of runs.
//!
//! Round a corner the path runs at one speed, the one that the curve permits. What decides is the time from the middle of the block
//! before it to the middle of the block behind it; corners at their other ends are taken to be like this one.

use crate::tolerance::CORNER_STOP_GAIN;
use crate::{Element, LimitExceeded, Machine, PathLimits, PathMotion, Profile, path_limits};

/// A corner between two blocks.
pub(super) struct Corner<'a> {
    /// Its curve.
    pub(super) curve: &'a Element,
    /// The blocks before and behind it, cut back for it, and their lengths as programmed, mm.
    pub(super) blocks: [(&'a Element, f64); 2],
    /// What is cut from either of them, mm.
    pub(super) cut_mm: f64,
    /// Commanded speed, mm/s.
    pub(super) command: f64,
}

impl Corner<'_> {
    /// Whether it is to be rounded; also where the limits leave nothing, which is found later.
    pub(super) fn is_rounded(&self, machine: &Machine) -> bool {
        self.times_s(machine).map_or(true, |[rounded_s, stopped_s]| rounded_s < stopped_s * CORNER_STOP_GAIN)
    }

    /// Time rounded, and with a stop, s.
    fn times_s(&self, machine: &Machine) -> Result<[f64; 2], LimitExceeded> {
        let limits = |element: &Element| {
            let own = path_limits(element, machine, PathMotion::ZERO)?;
            Ok(PathLimits { velocity: own.velocity.min(self.command), ..own })
        };
        let speed = limits(self.curve)?.velocity;
        let mut times_s = [self.curve.length / speed, 0.0];
        for (element, length) in self.blocks {
            let limits = limits(element)?;
            let half_s = |length: f64, speed: f64| {
                Profile::solve(length, speed, speed, limits).map_or(0.0, |profile| 0.5 * profile.duration())
            };
            times_s[0] += half_s(length - 2.0 * self.cut_mm, speed.min(limits.velocity));
            times_s[1] += half_s(length, 0.0);
        }
        Ok(times_s)
    }
}
