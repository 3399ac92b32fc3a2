//! A change of the feed override while a course is run: as much of it as a stop takes is planned anew from the present speed and
//! acceleration, up to a speed without acceleration from which all that is known behind it can be planned in runs, or to rest.
//!
//! What has to come down brakes at once at the jerk, where every axis keeps its limits so ([`super::braking`]). Where the axes are at their
//! limits for another reason, as in a corner, the motion goes on as it is until it can, or the speed is solved for. Never is it above
//! what was permitted before the change.

use core::ops::Range;

use super::braking::{Braking, Slower, sampled};
use super::refine::PartsGuess;
use super::{MotionRequest, PathItem, PlannedMotion, Planner};
use crate::profile::reachable_speed;
use crate::speed::{AxisLimits, Course, End, Guess, Path, Span, keeps_limits};
use crate::tolerance::{
    BRAKING_SHARES, CEILING_MARGIN, CHANGE_S, DIRECT_SHARES, HARDER_STEPS, LATER_SHARES, LATER_STEP_S, LATER_STEPS,
    LEAST_OF_ALL, LOWER_SPEEDS, NEARLY_ALL, PASSING_S, PASSING_SHARE, PASSING_STEP_S, REACHING_SHARE, REST_MARGIN,
    SAME_POINT_MM,
};
use crate::{PathLimits, PlannedStretch, StretchProfile};

/// The part of a course that a change of the feed override plans anew.
struct Rest<'a> {
    motions: &'a [PlannedMotion],
    /// Its path, one span for every stretch as far as it is planned anew, at the speeds commanded from now on.
    spans: Vec<Span<'a>>,
    /// Speeds commanded so far, by span.
    former: Vec<f64>,
    /// The motion so far, and its places and speeds in short steps of time.
    before: PartsGuess,
    speeds: Vec<(f64, f64)>,
    /// Shares of acceleration and jerk left to junctions at its start, at its end and inside.
    reserves: [f64; 3],
    /// Speed and acceleration at its start.
    speed: f64,
    acceleration: f64,
    /// Whether it ends where the course does: a junction may be there.
    is_whole: bool,
}

impl<'a> Rest<'a> {
    /// The first `reach` mm of a course, from a former feed override to another one; all of it where little would be left.
    fn new(motions: &'a [PlannedMotion], [former, feed_override]: [f64; 2], reach: f64) -> Option<Self> {
        let whole: f64 = motions.iter().flat_map(|motion| &motion.stretches).map(|own| own.profile.length()).sum();
        let is_whole = whole <= reach * ALMOST_REACHED;
        let mut rest = Self {
            motions,
            spans: Vec::new(),
            former: Vec::new(),
            before: PartsGuess::default(),
            speeds: Vec::new(),
            reserves: [0.0; 3],
            speed: 0.0,
            acceleration: 0.0,
            is_whole,
        };
        for motion in motions {
            for PlannedStretch { start, stretch, profile } in &motion.stretches {
                let StretchProfile::Course(course) = profile else { return None };
                let at = rest.before.length();
                if !is_whole && at >= reach {
                    break;
                }
                let [entry, exit, inside] = course.reserves();
                let before = rest.spans.first().map_or(entry, |_| rest.reserves[0]);
                rest.reserves = [before, exit, inside.max(rest.reserves[2])];
                let command = motion.commanded(stretch, feed_override);
                rest.spans.push(Span { start: at, element: &motion.element, from: *start, command });
                rest.former.push(motion.commanded(stretch, former));
                let is_inside = is_whole || at + course.length() <= reach + SAME_POINT_MM;
                let own =
                    if is_inside { profile.clone() } else { StretchProfile::Course(course.between(0.0, reach - at)) };
                rest.before.push(own);
            }
        }
        if !is_whole {
            // Somewhere inside: what joints take there.
            rest.reserves[1] = rest.reserves[2];
        }
        (_, rest.speed, rest.acceleration, _) = rest.before.state(0.0);
        rest.speeds = sampled(&rest.before);
        (rest.speed > 0.0).then_some(rest)
    }

    fn length(&self) -> f64 {
        self.before.length()
    }

    /// Highest speed that was permitted between two places so far: the commanded one, or that of the motion where it was still coming down
    /// to that.
    fn permitted(&self, from: f64, to: f64) -> f64 {
        let first = self.spans.partition_point(|span| span.start <= from).saturating_sub(1);
        let within = self.spans[first..].iter().zip(&self.former[first..]).take_while(|(span, _)| span.start <= to);
        let commanded = within.map(|(_, &former)| former).fold(f64::INFINITY, f64::min);
        let first = self.speeds.partition_point(|&(place, _)| place <= from).saturating_sub(1);
        let last = self.speeds.partition_point(|&(place, _)| place < to).min(self.speeds.len() - 1);
        self.speeds[first..=last].iter().map(|&(_, speed)| speed).fold(commanded, f64::max)
    }

    /// Lowest commanded speed, mm/s.
    fn target(&self) -> f64 {
        self.spans.iter().map(|span| span.command).fold(f64::INFINITY, f64::min)
    }

    /// Where its junctions are, on machines with this largest jerk, and the share that each takes: elements begin there. One that lies so
    /// little behind that it matters is among them.
    fn joints(&self, jerk: f64) -> Vec<(f64, f64)> {
        let reserve = self.reserves[2];
        if reserve <= 0.0 {
            return Vec::new();
        }
        let near_mm = End::reserving(self.speed, self.acceleration, 0.0, jerk).reserved_mm;
        let begins = self.spans.iter().map(|span| (span.start - span.from, span.start));
        let matter = begins.filter(|&(place, start)| place > -near_mm && (place == start || start == 0.0));
        matter.map(|(place, _)| (place, reserve)).collect()
    }

    /// The ends of its path where it is left at a place `length` at this speed, on machines with this largest jerk.
    fn ends(&self, length: f64, end_speed: f64, jerk: f64) -> [End; 2] {
        let is_end = self.is_whole && length >= self.length() - SAME_POINT_MM;
        let [_, at_end, inside] = self.reserves;
        let exit = match end_speed {
            0.0 => 0.0,
            _ if is_end => at_end,
            _ => inside,
        };
        [
            End::reserving(self.speed, self.acceleration, self.reserves[0], jerk),
            End::reserving(end_speed, 0.0, exit, jerk),
        ]
    }

    /// A braking along the path to the speed that is commanded where it ends, at a share of the limits `along` it, which keeps the limits
    /// of every axis; to `most` mm/s at the most. Where the path is at these limits for another reason, as in a corner, it begins after one of
    /// so many steps of the motion so far, with which it is over soonest. `None` where there is none, or nothing has to come down at once.
    fn braked(
        &self,
        steps: Range<usize>,
        most: f64,
        along: impl Fn(f64) -> PathLimits,
        limits: &AxisLimits,
    ) -> Option<Course> {
        let jerk = limits.largest_jerk();
        let mut joints = self.joints(jerk);
        if self.is_whole {
            joints.push((self.length(), self.reserves[1]));
        }
        let path = Path::new(&self.spans, self.length(), limits).with_joints(&joints);
        // A lower feed must not wait until it is faster than an acceleration in progress makes it.
        let highest = match self.target() {
            target if target > 0.0 => Braking::new(self.speed, self.acceleration, 0.0, &along(DIRECT_SHARES[0])).peak,
            _ => f64::INFINITY,
        };
        let mut found: Option<(f64, f64, Braking)> = None;
        let mut last = steps.end;
        for step in steps {
            let t_s = step as f64 * LATER_STEP_S;
            if step >= last {
                break;
            }
            let (s, speed, acceleration, _) = self.before.state(t_s);
            if t_s > 0.0 && t_s >= self.before.duration_s() {
                break;
            }
            let shares: &[f64] = if step == 0 { &DIRECT_SHARES } else { &LATER_SHARES };
            for &share in shares {
                let least = if step == 0 { NEARLY_ALL } else { LEAST_OF_ALL };
                let state = [s, speed, acceleration];
                let Some(braking) = self.braking_from(state, [least, most], &along(share)) else { continue };
                let [length, end_speed] = [s + braking.length(), braking.course.end_velocity()];
                let is_inside = braking.length() > 0.0 && length < self.length() - SAME_POINT_MM;
                let is_lower = step == 0 || braking.peak <= highest.max(end_speed);
                let ends = self.ends(length, end_speed, jerk);
                if is_inside && is_lower && keeps_limits(&path, ends, &braking.course, s) {
                    let over_s = t_s + braking.course.duration();
                    if found.as_ref().is_none_or(|&(_, least_s, _)| over_s < least_s) {
                        // A harder one may be possible a little later.
                        last = step + HARDER_STEPS;
                        found = Some((t_s, over_s, braking));
                    }
                    break;
                }
            }
        }
        let (t_s, _, braking) = found?;
        let course = match self.before.until(t_s)? {
            before if before.length() > 0.0 => Course::joined(&[before, braking.course]),
            _ => braking.course,
        };
        Some(course.with_reserves(self.reserves))
    }

    /// A braking from a place, a speed and an acceleration to the speed that is commanded where it ends. `None` where nothing has to come down
    /// at once; an acceleration that has to end at a commanded speed has, from the share `least` of the jerk on, and speeds
    /// above `most` mm/s have to come down too.
    fn braking_from(
        &self,
        [s, speed, acceleration]: [f64; 3],
        [least, most]: [f64; 2],
        along: &PathLimits,
    ) -> Option<Braking> {
        let span = self.spans.partition_point(|span| span.start <= s).saturating_sub(1);
        let spans = &self.spans[span..];
        let mut target = spans.first()?.command.min(most);
        loop {
            let peak = speed + 0.5 * acceleration.max(0.0) * acceleration / along.jerk;
            let braking = match Braking::up_to(speed, acceleration, target, least, along) {
                Some(braking) => braking,
                None if target > 0.0 && peak <= target => return None,
                None => Braking::new(speed, acceleration, target, along),
            };
            let within = spans.iter().take_while(|span| span.start <= s + braking.length());
            let lowest = within.map(|span| span.command).fold(f64::INFINITY, f64::min);
            if lowest >= target {
                return Some(braking);
            }
            target = lowest;
        }
    }

    /// Lowest and highest speed without acceleration at which it can end, as far as a share of the limits `along` the path
    /// decides.
    fn end_speeds(&self, along: impl Fn(f64) -> PathLimits) -> [f64; 2] {
        let least = Braking::new(self.speed, self.acceleration, 0.0, &along(REACHING_SHARE)).speed(self.length());
        if self.is_whole {
            // The junction there is known to be passed at that speed only.
            let end = self.before.end_speed();
            return [(least / CEILING_MARGIN).min(end), end];
        }
        let limits = along(REACHING_SHARE);
        // A braking in progress ends first.
        let braked_s = (-self.acceleration).max(0.0) / limits.jerk;
        let slowest = (self.speed - 0.5 * limits.jerk * braked_s * braked_s).max(0.0);
        let left_mm = (self.length() - self.speed * braked_s).max(0.0);
        let last = self.motions.iter().flat_map(|motion| &motion.stretches).nth(self.spans.len() - 1);
        let fastest = last.map_or(0.0, |last| last.stretch.limits.velocity);
        let most = reachable_speed(slowest, f64::MAX, left_mm, &limits).min(fastest).min(self.target());
        [least / CEILING_MARGIN, most.max(least / CEILING_MARGIN)]
    }

    /// What is left where it is run up to the place `length`, and what follows: first `path`, then `own`, which is part of it only where
    /// there is no `path`; how many own items there are in it.
    fn followed_by<B>(
        &self,
        length: f64,
        path: Vec<PathItem<B>>,
        own: Option<PathItem<B>>,
    ) -> (Vec<PathItem<B>>, usize) {
        let mut left = self.left_from(length);
        let own = own.filter(|_| path.is_empty());
        let has = usize::from(own.is_some());
        let mut path = path.into_iter().chain(own).peekable();
        if let (Some(last), Some(PathItem::Motion(next))) = (left.last_mut(), path.peek())
            && next.start > 0.0
            && last.stretches.last().is_some_and(|last| last.end == next.start)
        {
            // The rest of the same element.
            last.stretches.extend(next.stretches.iter().copied());
            path.next();
        }
        (left.into_iter().map(PathItem::Motion).chain(path).collect(), has)
    }

    /// What is left of its path where it is run up to the place `length`.
    fn left_from(&self, length: f64) -> Vec<MotionRequest> {
        let mut left = Vec::new();
        let mut span = self.spans.iter();
        for motion in self.motions {
            let mut left_from = None;
            for (index, planned) in motion.stretches.iter().enumerate() {
                let from = match span.next() {
                    Some(own) if own.start + planned.profile.length() <= length + SAME_POINT_MM => continue,
                    Some(own) if own.start < length - SAME_POINT_MM => planned.start + (length - own.start),
                    _ => planned.start,
                };
                left_from = left_from.or(Some((index, from)));
            }
            left.extend(left_from.map(|(index, from)| motion.request_from(index, from)));
        }
        left
    }

    /// The motions on a new course, which may end before them.
    fn on(&self, course: &Course) -> Vec<PlannedMotion> {
        let mut motions = Vec::with_capacity(self.motions.len());
        let mut spans = self.spans.iter();
        for motion in self.motions {
            let mut stretches = smallvec::SmallVec::new();
            for planned in &motion.stretches {
                let is_reached = |span: &&Span<'_>| span.start < course.length() - SAME_POINT_MM;
                let Some(span) = spans.next().filter(is_reached) else { break };
                let whole = span.start + planned.profile.length();
                let end = whole.min(course.length());
                let mut stretch = planned.stretch;
                if whole > course.length() + SAME_POINT_MM {
                    stretch.end = planned.start + (end - span.start);
                }
                let profile = StretchProfile::Course(course.between(span.start, end));
                stretches.push(PlannedStretch { start: planned.start, stretch, profile });
            }
            if !stretches.is_empty() {
                motions.push(motion.with_stretches(stretches));
            }
        }
        motions
    }
}

/// What is left of a course when it is planned anew up to the end is less than this part of that.
const ALMOST_REACHED: f64 = 1.1;

impl<B> Planner<B> {
    /// How much of a course has to be known for a change of the feed override at its start, mm, as far as what is known of it says; infinite
    /// on a planner that makes none.
    #[must_use]
    pub fn reach_of_change(&self, rest: &[PlannedMotion]) -> f64 {
        let Some(limits) = &self.settings.limits else { return f64::INFINITY };
        let [acceleration, jerk] = limits.least();
        let stop_mm = |share: f64, speed: f64, present: f64| {
            let limits = PathLimits { velocity: f64::INFINITY, acceleration: share * acceleration, jerk: share * jerk };
            REST_MARGIN * Braking::new(speed, present, 0.0, &limits).length()
        };
        let (mut time_s, mut reach, mut passed) = (0.0, 0.0_f64, 0.0);
        for profile in rest.iter().flat_map(|motion| &motion.stretches).map(|own| &own.profile) {
            let (_, speed, acceleration, _) = profile.state(0.0);
            if time_s == 0.0 {
                reach = stop_mm(REACHING_SHARE, speed, acceleration).max(CHANGE_S * speed);
            }
            // In a corner it may have to go on at first.
            let mut t_s = (time_s / PASSING_STEP_S).ceil() * PASSING_STEP_S - time_s;
            while t_s < profile.duration() && time_s + t_s <= PASSING_S {
                let (s, speed, acceleration, _) = profile.state(t_s);
                if speed > 0.0 {
                    reach = reach.max(passed + s + stop_mm(PASSING_SHARE, speed, acceleration));
                }
                t_s += PASSING_STEP_S;
            }
            (time_s, passed) = (time_s + profile.duration(), passed + profile.length());
            if time_s > PASSING_S {
                break;
            }
        }
        ALMOST_REACHED * reach
    }

    /// Plans a course anew at another feed override: `rest` are motions on it, the first one from the present place on, as far as
    /// [`Planner::reach_of_change`] or to where its plan ends; `path` is what follows in front of what was not taken. The motions that
    /// are run first; what is behind them is planned as by [`Planner::restart`]. `None` where there is no such plan; the course
    /// then has to go on, and the planner is as it was.
    pub fn change_course(
        &mut self,
        rest: &[PlannedMotion],
        feed_override: f64,
        path: Vec<PathItem<B>>,
    ) -> Option<Vec<PlannedMotion>>
    where
        B: Clone,
    {
        let limits = self.settings.limits.clone()?;
        let reach = self.reach_of_change(rest);
        let rest = Rest::new(rest, [self.feed_override, feed_override], reach)?;
        let (most_acceleration, most_jerk) = Path::new(&rest.spans, rest.length(), &limits).least_along();
        let along = |share: f64| PathLimits {
            velocity: f64::INFINITY,
            acceleration: share * most_acceleration,
            jerk: share * most_jerk,
        };
        let at_once = rest.braked(0..1, f64::INFINITY, along, &limits);
        if let Some(motions) = at_once.and_then(|course| self.changed_to(&rest, &course, feed_override, &path)) {
            return Some(motions);
        }
        if rest.target() <= 0.0
            && let Some(course) = self.stop(&rest, along, &limits)
        {
            return self.changed_to(&rest, &course, feed_override, &path);
        }
        if let Some(motions) = self.solved(&rest, feed_override, along, &limits, &path) {
            return Some(motions);
        }
        // What follows may need a lower speed.
        LOWER_SPEEDS.into_iter().find_map(|share| {
            let course = rest.braked(1..LATER_STEPS, share * rest.target(), along, &limits)?;
            self.changed_to(&rest, &course, feed_override, &path)
        })
    }

    /// The course that comes to rest sooner: one that goes on as it is before it brakes, or one whose speed is solved for.
    fn stop(&mut self, rest: &Rest<'_>, along: impl Fn(f64) -> PathLimits, limits: &AxisLimits) -> Option<Course> {
        let solved = BRAKING_SHARES.into_iter().find_map(|share| {
            let braking = Braking::new(rest.speed, rest.acceleration, 0.0, &along(share));
            let stop_mm = REST_MARGIN * braking.length();
            if stop_mm <= rest.length() { self.changed(rest, [stop_mm, 0.0], &braking, limits) } else { None }
        });
        let later = rest.braked(1..LATER_STEPS, f64::INFINITY, &along, limits);
        later.into_iter().chain(solved).min_by(|a, b| a.duration().total_cmp(&b.duration()))
    }

    /// Goes on with a course and what is planned behind it; `None` where the path there needs a lower speed.
    fn changed_to(
        &mut self,
        rest: &Rest<'_>,
        course: &Course,
        feed_override: f64,
        path: &[PathItem<B>],
    ) -> Option<Vec<PlannedMotion>>
    where
        B: Clone,
    {
        let path = rest.followed_by(course.length(), path.to_vec(), self.first_not_taken());
        let again = self.planned_again([course.end_velocity(); 2], feed_override, path).ok()?;
        self.go_on_with(again);
        Some(rest.on(course))
    }

    /// The change by a course whose speed is solved for, to a place from which what is behind it can be run.
    fn solved(
        &mut self,
        rest: &Rest<'_>,
        feed_override: f64,
        along: impl Fn(f64) -> PathLimits,
        limits: &AxisLimits,
        path: &[PathItem<B>],
    ) -> Option<Vec<PlannedMotion>>
    where
        B: Clone,
    {
        let target = rest.target();
        let path = rest.followed_by(rest.length(), path.to_vec(), self.first_not_taken());
        let again = self.planned_again(rest.end_speeds(&along), feed_override, path).ok()?;
        let course = BRAKING_SHARES.into_iter().find_map(|share| {
            let braking = Braking::new(rest.speed, rest.acceleration, target, &along(share));
            self.changed(rest, [rest.length(), again.speed], &braking, limits)
        })?;
        self.go_on_with(again);
        Some(rest.on(&course))
    }

    /// A course from the present state to a speed at a place. It may be as fast as a braking, whatever is commanded.
    fn changed(
        &mut self,
        rest: &Rest<'_>,
        [length, end_speed]: [f64; 2],
        braking: &Braking,
        limits: &AxisLimits,
    ) -> Option<Course> {
        let target = rest.target();
        let comes_to_rest = end_speed <= 0.0 && target <= 0.0;
        let ceiling = |from: f64, to: f64| {
            let speed = braking.speed(from);
            // What comes to rest at a place may be as fast as it likes before.
            let above = if comes_to_rest {
                CEILING_MARGIN * braking.peak
            } else {
                speed + (CEILING_MARGIN - 1.0) * (speed - target).max(0.0)
            };
            // A lower feed must not make it faster than it was permitted to be.
            above.min(rest.permitted(from, to))
        };
        let joints = rest.joints(limits.largest_jerk());
        let whole = Path::new(&rest.spans, length, limits).with_joints(&joints);
        let path = if braking.peak > target { whole.with_ceiling(&ceiling) } else { whole };
        let ends = rest.ends(length, end_speed, limits.largest_jerk());
        // The plan so far is too fast where the path comes to rest, and the braking where it turns before.
        let slower = comes_to_rest.then(|| Slower::of([&rest.before, braking], length));
        let guess: &dyn Guess = slower.as_ref().map_or(&rest.before, |slower| slower);
        self.scratch.speed.plan(&path, ends, guess)
    }
}
