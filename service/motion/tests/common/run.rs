//! From a program to the path that is run, and to its time.

use feedwave_motion::{
    Carried, CornerSpeed, Element, Joining, Machine, MotionRequest, PathMotion, PathSmoother, Planned, Planner,
    PlannerSettings, Smoothed, limit_pieces, stretches,
};
use feedwave_program::{Feed, PathControl, Spindle};

use super::{FEED_MM_PER_MIN, Program};

/// Interpolation period of the comparison, s.
pub const PERIOD_S: f64 = 1e-3;

/// One feed for all blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut;

impl Carried for Cut {
    fn at_corner(&self, _: &Self) -> Option<Self> {
        Some(Self)
    }

    fn is_alike_everywhere(&self) -> bool {
        true
    }
}

/// `G64` with this tolerance, and no merging.
#[must_use]
pub fn within(tolerance_mm: f64) -> PathControl {
    PathControl::Continuous { tolerance_mm, merge_tolerance_mm: 0.0 }
}

/// The path as it is run under this path control, for plans in runs or for the least time.
#[must_use]
pub fn smoothed(program: &Program, control: PathControl, speed: CornerSpeed) -> Vec<Smoothed<Cut>> {
    smoothed_elements(program.elements(), control, &super::machine(), speed)
}

/// [`smoothed`] of elements, within the travel of a machine.
#[must_use]
pub fn smoothed_elements(
    elements: Vec<Element>,
    control: PathControl,
    machine: &Machine,
    corner_speed: CornerSpeed,
) -> Vec<Smoothed<Cut>> {
    let joining = Joining { machine, many_blocks: true, corner_speed, corners: None };
    let mut smoother = PathSmoother::default();
    let mut run = Vec::new();
    for element in elements {
        smoother.push(element, control, Cut, joining, &mut |smoothed| run.push(smoothed));
    }
    smoother.flush(joining, &mut |smoothed| run.push(smoothed));
    run
}

/// What the planner is asked for.
#[must_use]
pub fn request(element: Element, rest_at_end: bool, machine: &Machine) -> MotionRequest {
    let feed = Feed::PerMinute(FEED_MM_PER_MIN);
    let pieces = limit_pieces(&element, machine, PathMotion::ZERO, FEED_MM_PER_MIN / 30.0).expect("nothing else moves");
    let stretches = stretches(&element, feed, &Spindle::STOPPED, machine, &pieces);
    let mut request = MotionRequest::new(element, stretches);
    request.rest_at_end = rest_at_end;
    request
}

/// Time of a program under this path control, s.
#[must_use]
pub fn seconds(program: &Program, control: PathControl, machine: &Machine) -> f64 {
    planned(program, control, machine).iter().map(|&(duration_s, _)| duration_s).sum()
}

/// The plan of runs of a program: by stretch, its time, s, and the speed at its end, mm/s.
#[must_use]
pub fn planned(program: &Program, control: PathControl, machine: &Machine) -> Vec<(f64, f64)> {
    let mut planner = Planner::<()>::new(PlannerSettings::new(machine, 5_000, PERIOD_S));
    for Smoothed { element, rest_at_end, .. } in smoothed(program, control, CornerSpeed::Steady) {
        planner.push_motion(request(element, rest_at_end, machine));
    }
    planner.finish();
    let mut stretches = Vec::new();
    while let Some(item) = planner.pop() {
        if let Planned::Motion(motion) = item {
            stretches.extend(motion.stretches.iter().map(|stretch| {
                let duration_s = stretch.profile.duration();
                (duration_s, stretch.profile.state(duration_s).1)
            }));
        }
    }
    stretches
}
