//! A change of the feed override while a course is run: as much of it as a stop takes is planned anew from the present speed and
//! acceleration, up to a speed without acceleration from which all that is known behind it can be planned in runs, or to rest.

use super::refine::PartsGuess;
use super::{MotionRequest, PathItem, PlannedMotion, Planner};
use crate::profile::{change_length, reachable_speed};
use crate::speed::{AxisLimits, Course, End, Guess, Path, Span};
use crate::tolerance::{BRAKING_SHARES, CEILING_MARGIN, CHANGE_S, REACHING_SHARE, REST_MARGIN, SAME_POINT_MM};
use crate::{PathLimits, PlannedStretch, Profile, StretchProfile};

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

/// The slower of two plans of the same path at every place, as far as both go.
struct Slower {
    /// Time, place and speed; the acceleration is constant in between.
    states: Vec<[f64; 3]>,
}

impl Slower {
    /// Over the first `length` mm.
    fn of(plans: [&dyn Guess; 2], length: f64) -> Self {
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
fn sampled(plan: &dyn Guess) -> Vec<(f64, f64)> {
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
    /// How much of a course has to be known for a change of the feed override at this speed and acceleration, mm; infinite on a
    /// planner that makes none.
    #[must_use]
    pub fn reach_of_change(&self, speed: f64, acceleration: f64) -> f64 {
        let Some(limits) = &self.settings.limits else { return f64::INFINITY };
        let [acceleration_limit, jerk] = limits.least();
        let limits = PathLimits {
            velocity: f64::INFINITY,
            acceleration: REACHING_SHARE * acceleration_limit,
            jerk: REACHING_SHARE * jerk,
        };
        let stop_mm = REST_MARGIN * Braking::new(speed, acceleration, 0.0, &limits).length();
        ALMOST_REACHED * stop_mm.max(CHANGE_S * speed)
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
        let first = rest.first()?.stretches.first()?;
        let (_, speed, acceleration, _) = first.profile.state(0.0);
        let reach = self.reach_of_change(speed, acceleration);
        let rest = Rest::new(rest, [self.feed_override, feed_override], reach)?;
        let (most_acceleration, most_jerk) = Path::new(&rest.spans, rest.length(), &limits).least_along();
        let along = |share: f64| PathLimits {
            velocity: f64::INFINITY,
            acceleration: share * most_acceleration,
            jerk: share * most_jerk,
        };
        let target = rest.target();
        if target <= 0.0 {
            for share in BRAKING_SHARES {
                let braking = Braking::new(rest.speed, rest.acceleration, 0.0, &along(share));
                let stop_mm = REST_MARGIN * braking.length();
                if stop_mm > rest.length() {
                    break;
                }
                if let Some(course) = self.changed(&rest, [stop_mm, 0.0], &braking, &limits) {
                    let path = rest.followed_by(course.length(), path, self.first_not_taken());
                    let again = self.planned_again([0.0; 2], feed_override, path).ok()?;
                    self.go_on_with(again);
                    return Some(rest.on(&course));
                }
            }
        }
        let path = rest.followed_by(rest.length(), path, self.first_not_taken());
        let again = self.planned_again(rest.end_speeds(along), feed_override, path).ok()?;
        let course = BRAKING_SHARES.into_iter().find_map(|share| {
            let braking = Braking::new(rest.speed, rest.acceleration, target, &along(share));
            self.changed(&rest, [rest.length(), again.speed], &braking, &limits)
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
        let joints: Vec<_> = match rest.reserves[2] {
            reserve if reserve > 0.0 => rest.spans.iter().map(|span| (span.start, reserve)).collect(),
            _ => Vec::new(),
        };
        let whole = Path::new(&rest.spans, length, limits).with_joints(&joints);
        let path = if braking.peak > target { whole.with_ceiling(&ceiling) } else { whole };
        let jerk = limits.largest_jerk();
        let exit_reserve = if end_speed > 0.0 { rest.reserves[1] } else { 0.0 };
        let ends = [
            End::reserving(rest.speed, rest.acceleration, rest.reserves[0], jerk),
            End::reserving(end_speed, 0.0, exit_reserve, jerk),
        ];
        // The plan so far is too fast where the path comes to rest, and the braking where it turns before.
        let slower = comes_to_rest.then(|| Slower::of([&rest.before, braking], length));
        let guess: &dyn Guess = slower.as_ref().map_or(&rest.before, |slower| slower);
        self.scratch.speed.plan(&path, ends, guess)
    }
}
