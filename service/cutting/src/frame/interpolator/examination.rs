//! What a report says of the motion of a whole program: which axis limits it for how long, and where it slows down. Gathered while
//! validating only: it is no state, and no setpoint depends on it.

use feedwave_motion::{
    Element, Governor, Machine, MachineAxis, PhaseKind, PlannedMotion, PlannedStretch, StretchProfile,
};

use super::time_shares::{ROUNDING_S, cruise_governor};
use crate::frame::report::{AxisLimitTimes, LimitKind};
use crate::frame::slowdown::{Course, Slowdowns};

/// Examines the motion, stretch by stretch.
#[derive(Clone, Debug)]
pub(crate) struct Examination {
    axes: Vec<MachineAxis>,
    /// By axis column.
    pub(crate) axis_times: Vec<AxisLimitTimes>,
    pub(crate) slowdowns: Slowdowns,
}

/// Motion at an instant: place on the element, mm, speed, acceleration and jerk along the path.
type State = (f64, f64, f64, f64);

impl Examination {
    pub(crate) fn new(machine: &Machine) -> Self {
        let axis_times =
            machine.axes.iter().map(|axis| AxisLimitTimes { axis: axis.name.clone(), ..AxisLimitTimes::default() });
        Self { axes: machine.axes.clone(), axis_times: axis_times.collect(), slowdowns: Slowdowns::default() }
    }

    /// Takes in a stretch that was run, or what of it was, at this feed override.
    pub(super) fn stretch(&mut self, motion: &PlannedMotion, index: usize, feed_override: f64) {
        let Some(planned) = motion.stretches.get(index) else { return };
        self.add_axis_times(motion, planned, feed_override);
        if motion.element.rapid {
            return self.slowdowns.interrupt();
        }
        let ratio = if motion.follows_override() { feed_override } else { 1.0 };
        let course = Course { motion, planned, ratio, is_last: index + 1 == motion.stretches.len() };
        self.slowdowns.stretch(&course, &self.axes);
    }

    fn add_axis_times(&mut self, motion: &PlannedMotion, planned: &PlannedStretch, feed_override: f64) {
        let profile = &planned.profile;
        let at = |t_s: f64| {
            let (s, speed, acceleration, jerk) = profile.state(t_s);
            (planned.start + s, speed, acceleration, jerk)
        };
        match profile {
            StretchProfile::Phases(part) => {
                for (phase, start_s, time_s) in part.phases().filter(|&(.., time_s)| time_s > ROUNDING_S) {
                    let governor = match phase {
                        PhaseKind::Jerk => Some(Governor::Jerk),
                        PhaseKind::Acceleration => Some(Governor::Acceleration),
                        PhaseKind::Cruise => cruise_governor(motion, &planned.stretch, part, feed_override),
                    };
                    self.add(&motion.element, governor, at(start_s + 0.5 * time_s), time_s);
                }
            }
            StretchProfile::Course(course) => {
                for (governor, start_s, time_s) in course.governed() {
                    self.add(&motion.element, Some(governor), at(start_s + 0.5 * time_s), time_s);
                }
            }
        }
    }

    /// Adds a time to the axis that takes the largest share of the limit which governs.
    fn add(&mut self, element: &Element, governor: Option<Governor>, state: State, time_s: f64) {
        let kinds: &[LimitKind] = match governor {
            Some(Governor::Velocity) => &[LimitKind::Velocity],
            Some(Governor::Acceleration) => &[LimitKind::Acceleration],
            Some(Governor::Jerk) => &[LimitKind::Jerk],
            // Either of them holds a curve at a constant speed.
            Some(Governor::Turning) => &[LimitKind::Acceleration, LimitKind::Jerk],
            Some(Governor::Feed) | None => return,
        };
        let derivatives = element.derivatives(state.0);
        let mut largest = (0.0, 0, kinds[0]);
        for (column, axis) in self.axes.iter().enumerate() {
            let at = derivatives.map(|derivative| derivative[axis.axis.index()]);
            for &kind in kinds {
                let share = share(axis, kind, at, state);
                if share > largest.0 {
                    largest = (share, column, kind);
                }
            }
        }
        let (_, column, kind) = largest;
        if let Some(times) = self.axis_times.get_mut(column) {
            *times.of(kind) += time_s;
        }
    }
}

/// Share of a limit of an axis that a motion takes, from the derivatives of the axis by arc length.
fn share(axis: &MachineAxis, kind: LimitKind, [first, bend, twist]: [f64; 3], state: State) -> f64 {
    let (_, speed, acceleration, jerk) = state;
    match kind {
        LimitKind::Velocity => (first * speed).abs() / axis.max_velocity_per_s,
        LimitKind::Acceleration => (bend * speed * speed + first * acceleration).abs() / axis.max_acceleration_per_s2,
        LimitKind::Jerk => {
            let turning = speed * (twist * speed * speed + 3.0 * bend * acceleration);
            (turning + first * jerk).abs() / axis.max_jerk_per_s3
        }
    }
}
