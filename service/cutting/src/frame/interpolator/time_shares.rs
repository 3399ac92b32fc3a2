//! Where the time of a program goes.

use feedwave_motion::{
    Course, Curve, Governor, PhaseTimes, PlannedMotion, PlannedStretch, Profile, ProfilePart, Stretch, StretchProfile,
};
use serde::{Deserialize, Serialize};

use crate::frame::report::LimitTimes;
use crate::functions::thread::ThreadRun;

/// Where the time of a program goes, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct TimeShares {
    pub(crate) cutting_s: f64,
    pub(crate) rapid_s: f64,
    /// The same time, and that at rest, by what governs it.
    pub(crate) limits: LimitTimes,
}

/// A cruise within this share of a speed is at that speed.
const SAME_SPEED: f64 = 1e-9;
/// A cruise this short is what rounding leaves between two ramps, s.
pub(super) const ROUNDING_S: f64 = 1e-12;

/// What governs a part of a profile where its speed is constant: the feed, the velocity of an axis or the turning of the path;
/// `None` where it is slower than all of them ask for, for the sake of corners and neighbouring blocks.
pub(super) fn cruise_governor(
    motion: &PlannedMotion,
    stretch: &Stretch,
    part: &ProfilePart,
    feed_override: f64,
) -> Option<Governor> {
    let ratio = if motion.follows_override() { feed_override } else { 1.0 };
    let reached = part.whole().cruise_velocity() * (1.0 + SAME_SPEED);
    match motion.element.curve {
        _ if !motion.element.rapid && reached >= stretch.speed_mm_per_s * ratio => Some(Governor::Feed),
        _ if reached < stretch.limits.velocity => None,
        Curve::Line => Some(Governor::Velocity),
        Curve::Arc(_) | Curve::Spline(_) | Curve::FiveAxis(_) => Some(Governor::Turning),
    }
}

impl LimitTimes {
    fn add_course(&mut self, course: &Course) {
        for (governor, _, time_s) in course.governed() {
            *match governor {
                Governor::Feed => &mut self.feed_s,
                Governor::Velocity => &mut self.axis_velocity_s,
                Governor::Acceleration => &mut self.acceleration_s,
                Governor::Turning => &mut self.curvature_s,
                Governor::Jerk => &mut self.jerk_s,
            } += time_s;
        }
    }
}

impl TimeShares {
    pub(super) fn add_stretch(&mut self, motion: &PlannedMotion, index: usize, duration_s: f64, feed_override: f64) {
        let element = &motion.element;
        *(if element.rapid { &mut self.rapid_s } else { &mut self.cutting_s }) += duration_s;
        let Some(PlannedStretch { stretch, profile, .. }) = motion.stretches.get(index) else { return };
        let part = match profile {
            StretchProfile::Phases(part) => part,
            StretchProfile::Course(course) => return self.limits.add_course(course),
        };
        let PhaseTimes { jerk_s, acceleration_s, cruise_s } = part.phase_times();
        self.limits.jerk_s += jerk_s;
        self.limits.acceleration_s += acceleration_s;
        let limits = &mut self.limits;
        let governed_s = match cruise_governor(motion, stretch, part, feed_override) {
            _ if cruise_s <= ROUNDING_S => &mut limits.jerk_s,
            None => &mut limits.corners_s,
            Some(Governor::Feed) => &mut limits.feed_s,
            Some(Governor::Velocity) => &mut limits.axis_velocity_s,
            Some(_) => &mut limits.curvature_s,
        };
        *governed_s += cruise_s;
    }

    /// The part of a pass in which the lead axis moves is cutting, the waits before and after are rest.
    pub(super) fn add_pass(&mut self, run: &ThreadRun, duration_s: f64) {
        let s_per_deg = 1.0 / (360.0 * run.rev_per_s);
        let lead_s = ((run.path.lead_end_deg() - run.path.lead_start_deg()) * s_per_deg).min(duration_s);
        let changing_s = (run.path.changing_deg() * s_per_deg).min(lead_s);
        self.cutting_s += lead_s;
        self.limits.acceleration_s += changing_s;
        self.limits.feed_s += lead_s - changing_s;
        self.limits.rest_s += duration_s - lead_s;
    }

    /// A stroke of a rigid tap is cutting, at the feed of its spindle while that is constant.
    pub(super) fn add_tap(&mut self, profile: Profile) {
        let PhaseTimes { jerk_s, acceleration_s, cruise_s } =
            ProfilePart::new(profile, 0.0, profile.length()).phase_times();
        self.cutting_s += profile.duration();
        self.limits.jerk_s += jerk_s;
        self.limits.acceleration_s += acceleration_s;
        self.limits.feed_s += cruise_s;
    }

    pub(super) fn add_preparation(&mut self, profile: Profile) {
        let PhaseTimes { jerk_s, acceleration_s, cruise_s } =
            ProfilePart::new(profile, 0.0, profile.length()).phase_times();
        self.rapid_s += profile.duration();
        self.limits.jerk_s += jerk_s;
        self.limits.acceleration_s += acceleration_s;
        self.limits.axis_velocity_s += cruise_s;
    }
}
