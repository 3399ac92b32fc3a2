//! Whether a motion that was not planned by limits of the axes keeps them.

use super::course::Course;
use super::path::Path;
use super::{End, check};
use crate::tolerance::{SPEED_CHECKED_SHARE, SPEED_SIDE};

/// Times between the places that are examined, s: the limits left unused are more than what axes change in between.
const STEP_S: f64 = 5e-4;

/// Whether a course from a place of a path on keeps the limits of every axis, of which junctions take their shares: at the ends, as given
/// there, and at the joints of the path.
pub(crate) fn keeps_limits(path: &Path<'_>, ends: [End; 2], course: &Course, from: f64) -> bool {
    let mut derivatives = Vec::with_capacity(path.axes.len());
    let mut span = 0;
    let end = from + course.length();
    let mut keeps = |s: f64, state: [f64; 3]| {
        derivatives.clear();
        span = path.span_from(span, s);
        path.add_derivatives(span, s, &mut derivatives);
        let [velocity, others] = check::shares_in_time(path, &derivatives, state);
        velocity <= SPEED_CHECKED_SHARE && others <= SPEED_CHECKED_SHARE * left(path, ends, [s, end], state)
    };
    let mut breaks = Vec::new();
    for part in course.parts() {
        let start = from + part.segment.s;
        let steps = (part.duration_s / STEP_S).ceil().max(1.0);
        for step in 0..=steps as usize {
            let (x, state) = part.state(part.duration_s * step as f64 / steps);
            if !keeps(start + x, state) {
                return false;
            }
        }
        breaks.clear();
        path.add_breaks(0, [start, start + part.length], &mut breaks);
        let side = SPEED_SIDE * part.length;
        for &place in &breaks {
            let (_, state) = part.state(part.segment.time_to(place - start, part.duration_s));
            if !(keeps(place - side, state) && keeps(place + side, state)) {
                return false;
            }
        }
    }
    true
}

/// What junctions leave of the limits of acceleration and jerk at a place before an end, which is passed in this state.
fn left(path: &Path<'_>, [start, end]: [End; 2], [s, length]: [f64; 2], [speed, acceleration, jerk]: [f64; 3]) -> f64 {
    let near_mm = End::reserving(speed, acceleration, 0.0, jerk.abs()).reserved_mm;
    let at_joints = path.joints.iter().filter(|&&(place, _)| (place - s).abs() <= near_mm);
    let taken = at_joints.map(|&(_, reserve)| reserve).fold(0.0, f64::max);
    let at_start = if s < start.reserved_mm { start.reserve } else { 0.0 };
    let at_end = if length - s < near_mm { end.reserve } else { 0.0 };
    1.0 - taken.max(at_start).max(at_end)
}
