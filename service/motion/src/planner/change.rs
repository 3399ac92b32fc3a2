//! A change of the feed override while a course is run: the rest of the course is planned anew from the present speed and
//! acceleration, to its end or to rest.

use super::refine::PartsGuess;
use super::{MotionRequest, PlannedMotion, Planner};
use crate::profile::change_length;
use crate::speed::{Course, End, Guess, Path, Span};
use crate::tolerance::{BRAKING_SHARES, CEILING_MARGIN, REST_MARGIN};
use crate::{PathLimits, PlannedStretch, Profile, StretchProfile};

/// What a change of the feed override makes of the rest of a course.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangedCourse {
    /// What is run: the first motion goes on with the present element.
    pub motions: Vec<PlannedMotion>,
    /// What is left of the path that was given, where it comes to rest before the end.
    pub left: Vec<MotionRequest>,
    /// Speed behind the motions, mm/s; the acceleration is zero there.
    pub end_speed: f64,
}

/// A speed that falls as fast as a share of the limits lets it.
struct Braking {
    speed: f64,
    acceleration: f64,
    /// Time until the present acceleration has ended, s.
    peak_s: f64,
    /// Highest speed: the present acceleration ends first.
    peak: f64,
    /// How far that takes, mm.
    peak_mm: f64,
    fall: Profile,
}

impl Braking {
    fn new(speed: f64, acceleration: f64, target: f64, limits: &PathLimits) -> Self {
        let rise_s = acceleration.max(0.0) / limits.jerk;
        let peak = speed + 0.5 * acceleration.max(0.0) * rise_s;
        let peak_mm = rise_s * (speed + rise_s * acceleration.max(0.0) / 3.0);
        let target = target.min(peak);
        let length = change_length(peak, target, limits);
        Self {
            speed,
            acceleration: acceleration.max(0.0),
            peak_s: rise_s,
            peak,
            peak_mm,
            fall: Profile::with_cruise(length, peak, peak, target, limits),
        }
    }

    fn length(&self) -> f64 {
        self.peak_mm + self.fall.length()
    }

    /// Speed at a place.
    fn speed(&self, s: f64) -> f64 {
        if s <= self.peak_mm { self.peak } else { self.fall.state(self.fall.time_at(s - self.peak_mm)).1 }
    }
}

/// A braking to rest as a first plan, stretched to its place.
impl Guess for Braking {
    fn duration_s(&self) -> f64 {
        REST_MARGIN * (self.peak_s + self.fall.duration())
    }

    fn at(&self, t_s: f64) -> (f64, f64) {
        let t_s = t_s / REST_MARGIN;
        let (s, speed) = if t_s < self.peak_s {
            let fallen = t_s / self.peak_s;
            let speed = self.speed + self.acceleration * t_s * (1.0 - 0.5 * fallen);
            (t_s * (self.speed + self.acceleration * t_s * (0.5 - fallen / 6.0)), speed)
        } else {
            let (s, speed, ..) = self.fall.state(t_s - self.peak_s);
            (self.peak_mm + s, speed)
        };
        (REST_MARGIN * s, speed)
    }
}

impl<B> Planner<B> {
    /// Plans the rest of a course anew at another feed override: `rest` are motions on courses up to the place where its plan
    /// ends, the first one from the present place on. `None` where there is no such plan; the course then has to go on.
    pub fn change_course(&mut self, rest: &[PlannedMotion], feed_override: f64) -> Option<ChangedCourse> {
        let limits = self.settings.limits.as_ref()?;
        let mut guess = PartsGuess::default();
        let mut spans: Vec<Span<'_>> = Vec::new();
        let mut reserves = [0.0; 3];
        for motion in rest {
            for PlannedStretch { start, stretch, profile } in &motion.stretches {
                let StretchProfile::Course(course) = profile else { return None };
                reserves = course.reserves();
                let command = motion.commanded(stretch, feed_override);
                spans.push(Span { start: guess.length(), element: &motion.element, from: *start, command });
                guess.push(profile.clone());
            }
        }
        let (_, speed, acceleration, _) = guess.state(0.0);
        let moves = speed > 0.0;
        if !moves {
            return None;
        }
        let joints: Vec<_> = match reserves[2] {
            reserve if reserve > 0.0 => spans.iter().map(|span| (span.start, reserve)).collect(),
            _ => Vec::new(),
        };
        let path = Path::new(&spans, guess.length(), limits);
        let path_mm = path.length;
        let (most_acceleration, most_jerk) = path.least_along();
        let end = guess.end_speed();
        let jerk = limits.largest_jerk();
        let ends = |end_speed: f64| {
            let exit_reserve = if end_speed > 0.0 { reserves[1] } else { 0.0 };
            [End::reserving(speed, acceleration, reserves[0], jerk), End::reserving(end_speed, 0.0, exit_reserve, jerk)]
        };
        let target = spans.iter().map(|span| span.command).fold(f64::INFINITY, f64::min);
        for share in BRAKING_SHARES {
            let limits_along = PathLimits {
                velocity: f64::INFINITY,
                acceleration: share * most_acceleration,
                jerk: share * most_jerk,
            };
            let braking = Braking::new(speed, acceleration, target, &limits_along);
            let stop_mm = REST_MARGIN * braking.length();
            let (length, end_speed) = if target > 0.0 || stop_mm > path.length {
                (path.length, end.min(target.max(braking.speed(path.length) / CEILING_MARGIN)))
            } else {
                (stop_mm, 0.0)
            };
            let ceiling = |s: f64| {
                let speed = braking.speed(s);
                // What comes to rest at a place may be as fast as it likes before.
                let margin = CEILING_MARGIN - 1.0;
                if length < path.length {
                    CEILING_MARGIN * braking.peak
                } else {
                    speed + margin * (speed - target).max(0.0)
                }
            };
            let needs_ceiling = braking.peak > target;
            let whole = Path::new(&spans, length, limits).with_joints(&joints);
            let path = if needs_ceiling { whole.with_ceiling(&ceiling) } else { whole };
            // The plan so far is too fast where the path comes to rest.
            let before: &dyn Guess = if length < path_mm { &braking } else { &guess };
            if let Some(course) = self.scratch.speed.plan(&path, ends(end_speed), before) {
                return Some(changed(rest, &spans, &course));
            }
        }
        None
    }
}

/// The motions on a new course, which may end before them.
fn changed(rest: &[PlannedMotion], spans: &[Span<'_>], course: &Course) -> ChangedCourse {
    let mut motions = Vec::with_capacity(rest.len());
    let mut left = Vec::new();
    let mut span = 0;
    for motion in rest {
        let mut stretches = smallvec::SmallVec::new();
        let mut left_from = None;
        for (index, planned) in motion.stretches.iter().enumerate() {
            let start = spans[span].start;
            let end = spans.get(span + 1).map_or(course.length(), |next| next.start).min(course.length());
            span += 1;
            if start >= course.length() {
                left_from = left_from.or(Some((index, planned.start)));
                continue;
            }
            let mut stretch = planned.stretch;
            let is_whole = spans.get(span).map_or(planned.profile.length(), |next| next.start - start) <= end - start;
            if !is_whole {
                stretch.end = planned.start + (end - start);
                left_from = Some((index, stretch.end));
            }
            let profile = StretchProfile::Course(course.between(start, end));
            stretches.push(PlannedStretch { start: planned.start, stretch, profile });
        }
        if let Some((index, start)) = left_from {
            left.push(motion.request_from(index, start));
        }
        if !stretches.is_empty() {
            motions.push(motion.with_stretches(stretches));
        }
    }
    ChangedCourse { motions, left, end_speed: course.end_velocity() }
}
