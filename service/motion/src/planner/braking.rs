//! Braking along a path whatever it is like: what a change of the feed override asks for, as a motion and as a guess.

use super::refine::PartsGuess;
use crate::speed::{Course, Guess};
use crate::tolerance::REST_MARGIN;
use crate::{PathLimits, StretchProfile};

/// A speed that comes down as fast as constant limits let it, from a speed and an acceleration to a speed without.
pub(super) struct Braking {
    pub(super) course: Course,
    /// Highest speed: an acceleration in progress ends first.
    pub(super) peak: f64,
}

impl Braking {
    /// To `target`, or to where the acceleration in progress leads at the lowest and at the highest.
    pub(super) fn new(speed: f64, acceleration: f64, target: f64, limits: &PathLimits) -> Self {
        let PathLimits { acceleration: most, jerk, .. } = *limits;
        // An acceleration that would lead below rest has to end sooner.
        let jerk = if acceleration < 0.0 { jerk.max(0.5 * acceleration * acceleration / speed) } else { jerk };
        let change = 0.5 * acceleration * acceleration / jerk;
        // Without acceleration: where one in progress ends, or where a braking in progress seems to have begun.
        let from = speed + change;
        let lowest = if acceleration < 0.0 { (speed - change).max(0.0) } else { from };
        let target = target.min(lowest);
        let drop = from - target;
        let most = most.max(-acceleration).min((drop * jerk).sqrt()).max(-acceleration);
        let hold_s = if most > 0.0 { ((drop - most * most / jerk) / most).max(0.0) } else { 0.0 };
        let phases = [(-jerk, ((most + acceleration) / jerk).max(0.0)), (0.0, hold_s), (jerk, most / jerk)];
        let course = Course::of_phases([speed, acceleration], &phases, target);
        Self { course, peak: if acceleration > 0.0 { from } else { speed } }
    }

    /// The end of an acceleration at exactly a speed; `None` where that takes more than the limits, or less than this share of the jerk.
    pub(super) fn up_to(speed: f64, acceleration: f64, target: f64, least: f64, limits: &PathLimits) -> Option<Self> {
        let rises = acceleration > 0.0 && target > speed;
        let jerk = 0.5 * acceleration * acceleration / (target - speed);
        let is_about = rises && jerk <= limits.jerk && jerk >= least * limits.jerk;
        is_about.then(|| {
            let course = Course::of_phases([speed, acceleration], &[(-jerk, acceleration / jerk)], target);
            Self { course, peak: target }
        })
    }

    pub(super) fn length(&self) -> f64 {
        self.course.length()
    }

    /// Speed at a place, the highest up to where that is.
    pub(super) fn speed(&self, s: f64) -> f64 {
        let (speed, acceleration) = self.course.at_place(s);
        if acceleration > 0.0 { self.peak } else { speed }
    }
}

/// A braking to rest as a first plan, stretched to its place.
impl Guess for Braking {
    fn duration_s(&self) -> f64 {
        REST_MARGIN * self.course.duration()
    }

    fn at(&self, t_s: f64) -> (f64, f64) {
        let (s, speed, ..) = self.course.state(t_s / REST_MARGIN);
        (REST_MARGIN * s, speed)
    }
}

impl PartsGuess {
    /// What comes of it before a time, s, which has courses only.
    pub(super) fn until(&self, t_s: f64) -> Option<Course> {
        let passed = self.parts.iter().take_while(|&&(start_s, ..)| start_s < t_s);
        let courses: Option<Vec<_>> = passed
            .map(|(start_s, _, part)| match part {
                StretchProfile::Course(course) => Some(course.until(t_s - start_s)),
                StretchProfile::Phases(_) => None,
            })
            .collect();
        courses.map(|courses| Course::joined(&courses))
    }
}

/// The slower of two plans of the same path at every place, as far as both go.
pub(super) struct Slower {
    /// Time, place and speed; the acceleration is constant in between.
    states: Vec<[f64; 3]>,
}

impl Slower {
    /// Over the first `length` mm.
    pub(super) fn of(plans: [&dyn Guess; 2], length: f64) -> Self {
        let sampled = plans.map(sampled);
        let mut places: Vec<f64> = sampled.iter().flatten().map(|&(place, _)| place).collect();
        places.retain(|&place| place < length);
        places.push(length);
        places.sort_by(f64::total_cmp);
        places.dedup();
        let mut states: Vec<[f64; 3]> = Vec::with_capacity(places.len());
        let mut next = [1; 2];
        for place in places {
            let mut slowest = f64::INFINITY;
            for (own, next) in sampled.iter().zip(&mut next) {
                while *next + 1 < own.len() && own[*next].0 < place {
                    *next += 1;
                }
                slowest = slowest.min(speed_between(own[*next - 1], own[*next], place));
            }
            let time_s = states.last().map_or(0.0, |&[time_s, before, speed]| {
                let mean = 0.5 * (speed + slowest);
                if mean > 0.0 { time_s + (place - before) / mean } else { time_s }
            });
            states.push([time_s, place, slowest]);
        }
        Self { states }
    }
}

/// Places and speeds of a plan in short steps of time.
pub(super) fn sampled(plan: &dyn Guess) -> Vec<(f64, f64)> {
    let count = (plan.duration_s() / GUESS_STEP_S).ceil().clamp(1.0, MOST_GUESS_STEPS);
    let at = |number: f64| plan.at(plan.duration_s() * number / count);
    (0..=count as u32).map(|number| at(f64::from(number))).collect()
}

/// Speed at a place between two others with speeds, at constant acceleration.
fn speed_between((from, speed): (f64, f64), (to, end_speed): (f64, f64), place: f64) -> f64 {
    let share = if to > from { ((place - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 };
    (speed * speed + share * (end_speed * end_speed - speed * speed)).sqrt()
}

impl Guess for Slower {
    fn duration_s(&self) -> f64 {
        self.states.last().map_or(0.0, |&[time_s, ..]| time_s)
    }

    fn at(&self, t_s: f64) -> (f64, f64) {
        let next = self.states.partition_point(|&[time_s, ..]| time_s <= t_s).min(self.states.len() - 1);
        let [end_s, end, end_speed] = self.states[next];
        let [start_s, start, speed] = self.states[next.saturating_sub(1)];
        let span_s = end_s - start_s;
        if span_s <= 0.0 || t_s >= end_s {
            return (end, end_speed);
        }
        let passed_s = (t_s - start_s).max(0.0);
        let at = speed + (end_speed - speed) * passed_s / span_s;
        (start + 0.5 * (speed + at) * passed_s, at)
    }
}

/// Times between the places at which the slower of two plans is known, s, and the most of them.
const GUESS_STEP_S: f64 = 1e-3;
const MOST_GUESS_STEPS: f64 = 4096.0;
