//! A speed along a stretch as a function of time, in segments on which it is known in closed form.
//!
//! On a segment b = ṡ² is a quadratic polynomial of the place, so that s̈ = b′/2 is linear in it: with x the distance since the
//! segment's start, ẍ = a + ω·x. Its solution are hyperbolic or circular functions of ω·t², taken as series: segments last
//! milliseconds, and |ω|·t² stays below one. Next to rest the jerk is constant instead.

use serde::{Deserialize, Serialize};

use crate::tolerance::{RESERVED_S, SAME_POINT_MM, SOLVER_STEPS, TIME_PRECISION};

/// Relative change of a time in a step of Newton's method that leaves it exact to rounding: the error of the next one is as small as its
/// square.
const NEWTON_SETTLED: f64 = 1e-10;

/// Part of the highest speed around a place below which the path creeps there.
const CREEP_SHARE: f64 = 0.1;

/// What a course is limited by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Governor {
    /// The commanded feed.
    Feed,
    /// Velocity of an axis.
    Velocity,
    /// Acceleration of an axis, mostly of the feed.
    Acceleration,
    /// Acceleration of an axis, mostly of turning.
    Turning,
    /// Jerk of an axis.
    #[default]
    Jerk,
}

/// Part of a course: state at its start, and how it goes on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Segment {
    /// When it starts, s.
    pub(crate) start_s: f64,
    /// Place of its start, mm.
    pub(crate) s: f64,
    pub(crate) speed: f64,
    pub(crate) acceleration: f64,
    /// Constant part of the jerk, mm/s³.
    pub(crate) jerk: f64,
    /// ω: change of the acceleration by the place, 1/s².
    pub(crate) rate: f64,
    pub(crate) governor: Governor,
}

impl Segment {
    /// Distance and speed `t` seconds after its start.
    #[inline]
    pub(super) fn after(&self, t: f64) -> (f64, f64) {
        let square = t * t;
        let z = self.rate * square;
        // sinh(√z)/√z and (cosh(√z) − 1)/z.
        let sine = 1.0
            + z * (1.0 / 6.0)
                * (1.0 + z * (1.0 / 20.0) * (1.0 + z * (1.0 / 42.0) * (1.0 + z * (1.0 / 72.0) * (1.0 + z / 110.0))));
        let cosine = 0.5
            + z * (1.0 / 24.0)
                * (1.0 + z * (1.0 / 30.0) * (1.0 + z * (1.0 / 56.0) * (1.0 + z * (1.0 / 90.0) * (1.0 + z / 132.0))));
        let distance = t * (self.speed * sine + t * (self.acceleration * cosine + t * (self.jerk * (1.0 / 6.0))));
        let speed = self.speed * (1.0 + z * cosine) + t * (self.acceleration * sine + t * (0.5 * self.jerk));
        (distance, speed)
    }

    /// The rest of it from the distance `x` on.
    pub(super) fn from(&self, x: f64, t: f64) -> Self {
        let (speed, acceleration) = if self.jerk == 0.0 {
            let square = self.speed * self.speed + x * (2.0 * self.acceleration + self.rate * x);
            (square.max(0.0).sqrt(), self.acceleration + self.rate * x)
        } else {
            (self.after(t).1, self.acceleration + self.jerk * t)
        };
        Self { start_s: 0.0, s: 0.0, speed: speed.max(0.0), acceleration, ..*self }
    }

    /// Time at which it has gone `length` mm, at most `longest_s`: Newton's method within a bracket, from the mean speed.
    pub(crate) fn time_to(&self, length: f64, longest_s: f64) -> f64 {
        if length <= 0.0 {
            return 0.0;
        }
        let (mut low, mut high) = (0.0, longest_s);
        let mut t = if self.speed > 0.0 { (length / self.speed).min(high) } else { high };
        if self.jerk == 0.0 {
            let end = (self.speed * self.speed + length * (2.0 * self.acceleration + self.rate * length)).max(0.0);
            let mean = self.speed + end.sqrt();
            t = if mean > 0.0 { (2.0 * length / mean).min(high) } else { high };
        }
        for _ in 0..SOLVER_STEPS {
            let (distance, speed) = self.after(t);
            let excess = distance - length;
            if excess > 0.0 {
                high = t;
            } else {
                low = t;
            }
            let next = t - excess / speed;
            // A bracket without an upper end holds whatever lies above the lower one.
            let is_inside = next > low && next < high;
            let next = if is_inside { next } else { 0.5 * (low + high) };
            let precision = if is_inside { NEWTON_SETTLED } else { TIME_PRECISION };
            let is_settled = (next - t).abs() <= precision * t;
            t = next;
            if is_settled || t.is_infinite() {
                break;
            }
        }
        t
    }
}

/// A segment of a course with its length and its time.
pub(super) struct Part {
    pub(super) segment: Segment,
    pub(super) length: f64,
    pub(super) duration_s: f64,
}

impl Part {
    /// Distance since its start, and speed, acceleration and jerk, `t` seconds after that.
    pub(super) fn state(&self, t: f64) -> (f64, [f64; 3]) {
        let Segment { acceleration, jerk, rate, .. } = self.segment;
        let (x, speed) = self.segment.after(t);
        let speed = speed.max(0.0);
        (x, [speed, acceleration + jerk * t + rate * x, jerk + rate * speed])
    }
}

/// Speed along a stretch, jerk-limited, from one speed and acceleration to others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Course {
    /// In order; the first one starts at place and time 0.
    segments: Box<[Segment]>,
    length: f64,
    duration_s: f64,
    end_speed: f64,
    /// Whether the acceleration is zero at its end, because it was planned to there.
    ends_plan: bool,
    /// Shares of acceleration and jerk that its plan leaves to the junctions at its start, at its end and inside.
    reserves: [f64; 3],
}

impl Course {
    /// The course of these segments, which together go `length` mm and last `duration_s`, to a speed at its end.
    pub(crate) fn new(
        segments: Vec<Segment>,
        length: f64,
        duration_s: f64,
        end_speed: f64,
        reserves: [f64; 3],
    ) -> Self {
        Self { segments: segments.into_boxed_slice(), length, duration_s, end_speed, ends_plan: true, reserves }
    }

    /// Length covered, mm.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Time taken, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.duration_s
    }

    /// Speed at its end, mm/s.
    #[must_use]
    pub fn end_velocity(&self) -> f64 {
        self.end_speed
    }

    /// Whether the plan that it is a part of ends with it: the acceleration is zero there.
    #[must_use]
    pub const fn ends_plan(&self) -> bool {
        self.ends_plan
    }

    /// Shares of acceleration and jerk left to the junctions at the start and the end of its plan, and inside.
    pub(crate) const fn reserves(&self) -> [f64; 3] {
        self.reserves
    }

    /// What is left of it from local time `t_s` on, and its place there, mm.
    #[must_use]
    pub fn rest_from(&self, t_s: f64) -> (f64, Self) {
        let s = self.state(t_s).0;
        (s, self.between(s, self.length))
    }

    /// What comes of it before local time `t_s`.
    #[must_use]
    pub fn until(&self, t_s: f64) -> Self {
        self.between(0.0, self.state(t_s).0)
    }

    /// The course of these phases of constant jerk from a speed and an acceleration on, each with its jerk and its time, which end at
    /// `end_speed`.
    pub(crate) fn of_phases([speed, acceleration]: [f64; 2], phases: &[(f64, f64)], end_speed: f64) -> Self {
        let mut segments = Vec::with_capacity(phases.len());
        let (mut s, mut start_s) = (0.0, 0.0);
        let (mut speed, mut acceleration) = (speed, acceleration);
        for &(jerk, time_s) in phases.iter().filter(|&&(_, time_s)| time_s > 0.0) {
            let governor = if jerk == 0.0 { Governor::Acceleration } else { Governor::Jerk };
            let segment = Segment { start_s, s, speed, acceleration, jerk, rate: 0.0, governor };
            let (distance, reached) = segment.after(time_s);
            segments.push(segment);
            (s, start_s) = (s + distance, start_s + time_s);
            (speed, acceleration) = (reached, acceleration + jerk * time_s);
        }
        Self::new(segments, s, start_s, end_speed, [0.0; 3])
    }

    /// The same with other shares of acceleration and jerk that are left to junctions.
    pub(crate) fn with_reserves(self, reserves: [f64; 3]) -> Self {
        Self { reserves, ..self }
    }

    /// Speed and acceleration at a place, mm/s and mm/s².
    pub(crate) fn at_place(&self, s: f64) -> (f64, f64) {
        let index = self.segments.partition_point(|segment| segment.s <= s).saturating_sub(1);
        match self.segments.get(index) {
            Some(segment) if s < self.length => {
                let x = (s - segment.s).max(0.0);
                let t = segment.time_to(x, self.end_of(index) - segment.start_s);
                let acceleration = segment.acceleration + segment.jerk * t + segment.rate * x;
                (segment.after(t).1.max(0.0), acceleration)
            }
            _ => (self.end_speed, 0.0),
        }
    }

    /// Its segments with how long each is.
    pub(super) fn parts(&self) -> impl Iterator<Item = Part> + '_ {
        self.segments.iter().enumerate().map(|(index, &segment)| {
            let end = self.segments.get(index + 1).map_or(self.length, |next| next.s);
            Part { segment, length: end - segment.s, duration_s: self.end_of(index) - segment.start_s }
        })
    }

    /// When segment `index` ends, s.
    fn end_of(&self, index: usize) -> f64 {
        self.segments.get(index + 1).map_or(self.duration_s, |next| next.start_s)
    }

    /// The part from one place to another, mm.
    /// See [`Course::rest_from`] for the part from an instant on.
    pub(crate) fn between(&self, from: f64, to: f64) -> Self {
        let first = self.segments.partition_point(|segment| segment.s <= from).saturating_sub(1);
        let mut segments = Vec::new();
        let (mut s, mut time_s) = (0.0, 0.0);
        let mut end_speed = self.end_speed;
        let mut reserves = self.reserves;
        for (index, segment) in self.segments.iter().enumerate().skip(first) {
            if segment.s >= to {
                break;
            }
            let end = self.segments.get(index + 1).map_or(self.length, |next| next.s);
            let whole_s = self.end_of(index) - segment.start_s;
            let entered_s = if segment.s < from { segment.time_to(from - segment.s, whole_s) } else { 0.0 };
            let left_s = if to < end { segment.time_to(to - segment.s, whole_s) } else { whole_s };
            if index == first && segment.start_s + entered_s > RESERVED_S {
                // The junction at the start of its plan is too far behind.
                reserves[0] = 0.0;
            }
            let x = (from - segment.s).max(0.0);
            let part = if x > 0.0 { segment.from(x, entered_s) } else { *segment };
            if to < end {
                end_speed = segment.after(left_s).1;
            }
            segments.push(Segment { start_s: time_s, s, ..part });
            s += end.min(to) - segment.s - x;
            time_s += (left_s - entered_s).max(0.0);
        }
        // Places of stretches are sums of lengths: the end may be rounded.
        let ends_plan = self.ends_plan && to >= self.length - SAME_POINT_MM;
        Self { ends_plan, ..Self::new(segments, to - from, time_s, end_speed, reserves) }
    }

    /// Courses one behind the other.
    pub(crate) fn joined(parts: &[Self]) -> Self {
        let mut segments = Vec::with_capacity(parts.iter().map(|part| part.segments.len()).sum());
        let (mut length, mut duration_s) = (0.0, 0.0);
        let mut reserves = [0.0_f64; 3];
        for (index, part) in parts.iter().enumerate() {
            let moved = |segment: &Segment| Segment {
                start_s: duration_s + segment.start_s,
                s: length + segment.s,
                ..*segment
            };
            segments.extend(part.segments.iter().map(moved));
            length += part.length;
            duration_s += part.duration_s;
            let [start, end, inside] = part.reserves;
            reserves[2] = reserves[2].max(inside);
            if index == 0 {
                reserves[0] = start;
            } else {
                // Where parts meet is inside now.
                reserves[2] = reserves[2].max(start).max(reserves[1]);
            }
            reserves[1] = end;
        }
        let end_speed = parts.last().map_or(0.0, |last| last.end_speed);
        let ends_plan = parts.last().is_some_and(|last| last.ends_plan);
        Self { ends_plan, ..Self::new(segments, length, duration_s, end_speed, reserves) }
    }

    /// Of the places where segments start, within these shares of the time, the one with the least acceleration; where the path creeps only
    /// if it does so all the time: from there another one hardly finds its way.
    fn calmest_place(&self, [from, to]: [f64; 2]) -> f64 {
        let times = from * self.duration_s..to * self.duration_s;
        let within = || self.segments.iter().filter(|segment| times.contains(&segment.start_s));
        let fastest = within().map(|segment| segment.speed).fold(0.0, f64::max);
        let moving = within().filter(|segment| segment.speed >= CREEP_SHARE * fastest);
        let calmest = moving.min_by(|a, b| a.acceleration.abs().total_cmp(&b.acceleration.abs()));
        calmest.map_or(0.5 * self.length, |segment| segment.s)
    }

    /// Where another one may take over: at these shares of its time or later, up to these multiples of the time that a stop takes at
    /// the most before its end, with the smallest acceleration and jerk of an axis.
    pub(crate) fn handover(&self, [from, to]: [f64; 2], stops: [f64; 2], [acceleration, jerk]: [f64; 2]) -> f64 {
        let fastest = self.segments.iter().map(|segment| segment.speed).fold(0.0, f64::max);
        let stop = (fastest / acceleration + acceleration / jerk) / self.duration_s;
        self.calmest_place([from.max(1.0 - stops[0] * stop), to.max(1.0 - stops[1] * stop)])
    }

    /// Places and speeds at the starts of its segments but the first, in this first share of its time.
    pub(crate) fn knots(&self, share: f64) -> Vec<(f64, f64)> {
        let within = self.segments.iter().skip(1).take_while(|segment| segment.start_s <= share * self.duration_s);
        within.map(|segment| (segment.s, segment.speed)).collect()
    }

    /// Path position, speed, acceleration and jerk at local time `t_s`; the ends beyond them.
    #[must_use]
    pub fn state(&self, t_s: f64) -> (f64, f64, f64, f64) {
        let t_s = t_s.clamp(0.0, self.duration_s);
        let index = self.segments.partition_point(|segment| segment.start_s <= t_s).saturating_sub(1);
        let Some(segment) = self.segments.get(index) else { return (self.length, self.end_speed, 0.0, 0.0) };
        let t = t_s - segment.start_s;
        let (x, speed) = segment.after(t);
        let acceleration = segment.acceleration + segment.jerk * t + segment.rate * x;
        let s = if t_s >= self.duration_s { self.length } else { (segment.s + x).clamp(0.0, self.length) };
        let speed = if t_s >= self.duration_s { self.end_speed } else { speed.max(0.0) };
        (s, speed, acceleration, segment.jerk + segment.rate * speed)
    }

    /// Path positions and speeds at the local times `(first + k) · period_s − offset_s`. Each value depends on its own time
    /// only, whatever `first` a fill starts with.
    ///
    /// # Panics
    /// When the slices differ in length.
    pub fn fill(&self, first: u64, period_s: f64, offset_s: f64, out_s: &mut [f64], out_v: &mut [f64]) {
        assert_eq!(out_s.len(), out_v.len(), "one speed for every position");
        let first = first as f64;
        let time_s = |k: usize| (first + k as f64) * period_s - offset_s;
        let start_s = if out_s.is_empty() { 0.0 } else { time_s(0) };
        let mut index = self.segments.partition_point(|segment| segment.start_s <= start_s).saturating_sub(1);
        for (k, (out_s, out_v)) in out_s.iter_mut().zip(out_v).enumerate() {
            let t_s = time_s(k).max(0.0);
            while self.segments.get(index + 1).is_some_and(|next| next.start_s <= t_s) {
                index += 1;
            }
            if t_s >= self.duration_s {
                (*out_s, *out_v) = (self.length, self.end_speed);
                continue;
            }
            let segment = &self.segments[index];
            let (x, speed) = segment.after(t_s - segment.start_s);
            *out_s = (segment.s + x).clamp(0.0, self.length);
            *out_v = speed.max(0.0);
        }
    }

    /// Its parts in order, of some milliseconds each: what governs it, when it starts, s, and how long it lasts, s.
    pub fn governed(&self) -> impl Iterator<Item = (Governor, f64, f64)> + '_ {
        (0..self.segments.len()).map(|index| {
            let segment = &self.segments[index];
            (segment.governor, segment.start_s, self.end_of(index) - segment.start_s)
        })
    }
}
