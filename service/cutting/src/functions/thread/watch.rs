//! What a real spindle does within a pass that a control reports: it turns back, stops, or is too fast for the axes.
//!
//! The position stays a function of the angle in all of these, so that the tool does not leave its groove: it waits where the
//! spindle stops, and goes back with it. What the machine makes of it is the machine's business.

use feedwave_motion::{Machine, PathLimits};
use feedwave_program::Axis;

use super::ThreadPath;
use super::pass::axis_limits;

/// A spindle that comes back by more than this has turned round, degrees: a coupling and an encoder shake by less.
pub const REVERSAL_DEG: f64 = 5.0;
/// Time over which a speed is measured at least, s: a reading of the encoder more or less does not count.
const SPEED_S: f64 = 0.02;
/// A spindle that has turned by less than `STANDSTILL_DEG` for this long has stopped, s.
pub const STANDSTILL_S: f64 = 0.5;
/// See [`STANDSTILL_S`], degrees.
const STANDSTILL_DEG: f64 = 1.0;
/// Measured speeds may exceed a limit by this share: what encoders and time stamps are off by.
const SPEED_TOLERANCE: f64 = 0.01;

/// What the spindle does within a pass. Each is told when it begins, and that it is over with [`SpindleEvent::Regular`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpindleEvent {
    /// It has come back by so many degrees.
    Reversed {
        /// From the furthest angle of the pass.
        back_deg: f64,
    },
    /// It has stopped.
    Stopped,
    /// It turns faster than the axes can follow here.
    TooFast {
        /// Measured speed, rev/min.
        rev_per_min: f64,
        /// Highest speed at this place of the pass, rev/min.
        limit_rev_per_min: f64,
    },
    /// It turns forwards, at a speed that the axes can follow.
    Regular,
}

/// What the watch says of the spindle now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Condition {
    #[default]
    Regular,
    Reversed,
    Stopped,
    TooFast,
}

/// A reading: the angle from the reference point, degrees, and its time, s.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reading {
    angle_deg: f64,
    time_s: f64,
}

/// Watches the spindle of one pass.
#[derive(Clone, Debug, PartialEq)]
pub struct SpindleWatch {
    /// Limits of X and Z.
    limits: [PathLimits; 2],
    furthest_deg: Option<f64>,
    /// Where the speed is measured from.
    measured_from: Option<Reading>,
    /// Where the spindle was when it last had turned.
    moved_at: Option<Reading>,
    too_fast: Option<(f64, f64)>,
    /// Where it has stopped, degrees, until it turns forwards from there or back.
    stopped_at_deg: Option<f64>,
    told: Condition,
}

impl SpindleWatch {
    /// A watch over the axes of this machine.
    #[must_use]
    pub fn new(machine: &Machine) -> Self {
        let limits = [Axis::X, Axis::Z].map(|axis| axis_limits(machine, axis));
        Self {
            limits,
            furthest_deg: None,
            measured_from: None,
            moved_at: None,
            too_fast: None,
            stopped_at_deg: None,
            told: Condition::Regular,
        }
    }

    /// Takes in an angle from the reference point, degrees in the direction of rotation, and its time, s, where that is known:
    /// without times neither speeds nor stops can be seen. What has begun or ended with it; nothing outside the pass.
    pub fn observe(&mut self, path: &ThreadPath, angle_deg: f64, time_s: Option<f64>) -> Option<SpindleEvent> {
        let furthest_deg = self.furthest_deg.map_or(angle_deg, |furthest_deg| furthest_deg.max(angle_deg));
        self.furthest_deg = Some(furthest_deg);
        if furthest_deg < path.first_motion_deg() || furthest_deg >= path.rest_deg() {
            self.told = Condition::Regular;
            return None;
        }
        // Before the lead there is no groove yet that a spindle could turn back in: only the speed counts.
        let on_lead = furthest_deg >= path.lead_start_deg();
        let stopped = time_s.is_some_and(|time_s| self.turn(path, Reading { angle_deg, time_s }));
        let back_deg = furthest_deg - angle_deg;
        // From a stop it may turn back as well: only forwards it is over.
        let is_at_rest = self.stopped_at_deg.is_some_and(|rest_deg| angle_deg < rest_deg + STANDSTILL_DEG);
        let turns_back = on_lead && back_deg > REVERSAL_DEG;
        self.stopped_at_deg = match (on_lead && stopped, is_at_rest) {
            _ if turns_back => None,
            (true, _) => self.stopped_at_deg.or(Some(angle_deg)),
            (false, true) => self.stopped_at_deg,
            (false, false) => None,
        };
        let (condition, event) = if turns_back {
            (Condition::Reversed, SpindleEvent::Reversed { back_deg })
        } else if self.stopped_at_deg.is_some() {
            (Condition::Stopped, SpindleEvent::Stopped)
        } else if let Some((rev_per_min, limit_rev_per_min)) = self.too_fast {
            (Condition::TooFast, SpindleEvent::TooFast { rev_per_min, limit_rev_per_min })
        } else {
            (Condition::Regular, SpindleEvent::Regular)
        };
        (core::mem::replace(&mut self.told, condition) != condition).then_some(event)
    }

    /// Measures the speed; whether the spindle has stopped.
    fn turn(&mut self, path: &ThreadPath, now: Reading) -> bool {
        let moved_at = *self.moved_at.get_or_insert(now);
        if (now.angle_deg - moved_at.angle_deg).abs() >= STANDSTILL_DEG {
            self.moved_at = Some(now);
        }
        let from = *self.measured_from.get_or_insert(now);
        let passed_s = now.time_s - from.time_s;
        if passed_s >= SPEED_S {
            self.measured_from = Some(now);
            let rev_per_s = (now.angle_deg - from.angle_deg) / 360.0 / passed_s;
            let limit_rev_per_s = path.fastest_rev_per_s([from.angle_deg, now.angle_deg], self.limits);
            let is_too_fast = rev_per_s > limit_rev_per_s * (1.0 + SPEED_TOLERANCE);
            self.too_fast = is_too_fast.then_some((60.0 * rev_per_s, 60.0 * limit_rev_per_s));
        }
        let still_since = self.moved_at.map_or(now.time_s, |moved| moved.time_s);
        now.time_s - still_since >= STANDSTILL_S
    }
}
