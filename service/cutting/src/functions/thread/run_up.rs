//! How the lead axis comes from rest into step with the spindle, and back to rest at the end
//! (docs/functions/thread-vibration.md, "Infeed, tapers and run-up": acceleration of the lead axis at the start takes
//! an approach length).
//!
//! The run-up is a function of the spindle angle, not of time: the axis then lags behind the ideal line by half the
//! run-up angle in every pass, whatever the spindle speed, so that all passes stay in one groove. Its velocity
//! rises as 3s² − 2s³ over the share s of the run-up: no step in velocity or acceleration. The run-down is the same
//! backwards.

use serde::{Deserialize, Serialize};

/// Run-up of the lead axis, and its run-down seen from the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunUp {
    /// Spindle angle over which the axis accelerates, degrees; 0 starts with full speed.
    pub angle_deg: f64,
}

/// Greatest slope of 3s² − 2s³.
const PEAK_ACCELERATION: f64 = 1.5;
/// Greatest curvature of 3s² − 2s³.
const PEAK_JERK: f64 = 6.0;

impl RunUp {
    /// The shortest run-up within acceleration and jerk limits: from 1.5·v/t ≤ a and 6·v/t² ≤ j.
    #[must_use]
    pub fn within(lead_mm: f64, rev_per_s: f64, acceleration_mm_per_s2: f64, jerk_mm_per_s3: f64) -> Self {
        let velocity_mm_per_s = lead_mm * rev_per_s;
        let by_acceleration_s = PEAK_ACCELERATION * velocity_mm_per_s / acceleration_mm_per_s2;
        let by_jerk_s = libm::sqrt(PEAK_JERK * velocity_mm_per_s / jerk_mm_per_s3);
        Self { angle_deg: 360.0 * rev_per_s * by_acceleration_s.max(by_jerk_s) }
    }

    /// Angle through which a spindle in exact ratio would have turned, degrees, when the real one has turned by
    /// `turned_deg` since the start of the lead axis.
    #[must_use]
    pub fn synchronous_deg(self, turned_deg: f64) -> f64 {
        if turned_deg <= 0.0 {
            0.0
        } else if turned_deg >= self.angle_deg {
            turned_deg - self.lag_deg()
        } else {
            // The integral of 3s² − 2s³.
            let share = turned_deg / self.angle_deg;
            self.angle_deg * share * share * share * (1.0 - 0.5 * share)
        }
    }

    /// Angle by which the axis lags behind the ideal line after the run-up, degrees.
    #[must_use]
    pub fn lag_deg(self) -> f64 {
        0.5 * self.angle_deg
    }

    /// Travel until the ratio is exact, mm.
    #[must_use]
    pub fn travel_mm(self, lead_mm: f64) -> f64 {
        lead_mm * self.lag_deg() / 360.0
    }
}

/// The motion of the lead axis through one pass, as angles of a spindle in exact ratio: run-up, exact lead, run-down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LeadTravel {
    run_up: RunUp,
    travel_deg: f64,
}

impl LeadTravel {
    /// A motion over `travel_deg`; where it is too short for run-up and run-down, both are shortened to fill it.
    pub(super) fn new(run_up: RunUp, travel_deg: f64) -> Self {
        Self { run_up: RunUp { angle_deg: run_up.angle_deg.min(travel_deg) }, travel_deg }
    }

    /// Angle through which the spindle turns meanwhile, degrees.
    pub(super) fn angle_deg(&self) -> f64 {
        self.travel_deg + self.run_up.angle_deg
    }

    /// [`RunUp::synchronous_deg`] of the whole motion; it rests at 0 before and at its end after it.
    pub(super) fn synchronous_deg(&self, turned_deg: f64) -> f64 {
        let left_deg = self.angle_deg() - turned_deg;
        if left_deg >= self.run_up.angle_deg {
            self.run_up.synchronous_deg(turned_deg)
        } else {
            self.travel_deg - self.run_up.synchronous_deg(left_deg)
        }
    }
}
