//! Seven-phase jerk-limited profiles between two speeds, without acceleration at either end, and parts of them.

mod part;
mod stretch;

use serde::{Deserialize, Serialize};

pub use self::part::{PhaseKind, PhaseTimes, ProfilePart};
pub use self::stretch::StretchProfile;
use crate::PathLimits;
use crate::tolerance::{SOLVER_PRECISION, SOLVER_SLACK, SOLVER_STEPS, TIME_PRECISION};

/// Speed along a length as a function of time: acceleration ramps up, holds and ramps down, the speed cruises, and
/// the same backwards; any phase may be empty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    length: f64,
    /// Start speed, cruise speed and end speed, mm/s.
    speeds: [f64; 3],
    rise: Change,
    fall: Change,
    cruise_s: f64,
}

/// A change of speed without acceleration at either end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Change {
    /// Signed jerk of the first ramp, mm/s³.
    jerk: f64,
    /// Length of each jerk ramp, s.
    ramp_s: f64,
    /// Time at constant acceleration, s.
    hold_s: f64,
}

impl Change {
    /// The fastest change from `from` to `to`.
    fn new(from: f64, to: f64, limits: &PathLimits) -> Self {
        let difference = (to - from).abs();
        let sign = if to >= from { 1.0 } else { -1.0 };
        let full_ramp_s = limits.acceleration / limits.jerk;
        let full_difference = limits.acceleration * full_ramp_s;
        if difference >= full_difference {
            let hold_s = (difference - full_difference) / limits.acceleration;
            Self { jerk: sign * limits.jerk, ramp_s: full_ramp_s, hold_s }
        } else {
            Self { jerk: sign * limits.jerk, ramp_s: (difference / limits.jerk).sqrt(), hold_s: 0.0 }
        }
    }

    fn duration_s(&self) -> f64 {
        2.0 * self.ramp_s + self.hold_s
    }
}

/// Time of the fastest change of speed by `difference`, s.
fn change_time_s(difference: f64, limits: &PathLimits) -> f64 {
    let full_ramp_s = limits.acceleration / limits.jerk;
    if difference >= limits.acceleration * full_ramp_s {
        difference / limits.acceleration + full_ramp_s
    } else {
        2.0 * (difference / limits.jerk).sqrt()
    }
}

/// Length that the fastest change from one speed to another takes, mm: mean speed times time, since the change is
/// symmetric about its middle.
pub(crate) fn change_length(from: f64, to: f64, limits: &PathLimits) -> f64 {
    0.5 * (from + to) * change_time_s((to - from).abs(), limits)
}

/// Highest speed, at most `wanted`, that a change from `from` reaches within `length`; at least `from`.
pub(crate) fn reachable_speed(from: f64, wanted: f64, length: f64, limits: &PathLimits) -> f64 {
    if wanted <= from || change_length(from, wanted, limits) <= length {
        return wanted.max(from);
    }
    largest_fitting(from, wanted, length, |speed| change_length(from, speed, limits))
}

/// Highest speed, at most `wanted`, from which a change leads within `length` to `exit` or to some speed below it.
///
/// See [`reachable_exit`] for why rest may be reached from a higher speed than `exit` is. Between the two the highest
/// entry has no maximum, so that the ends decide, and a higher `exit` never gives a lower answer.
pub(crate) fn highest_entry(exit: f64, wanted: f64, length: f64, limits: &PathLimits) -> f64 {
    let to_exit = reachable_speed(exit, wanted, length, limits).min(wanted);
    if to_exit >= wanted { wanted } else { to_exit.max(reachable_speed(0.0, wanted, length, limits)) }
}

/// Highest speed, at most `wanted`, to which a change from `from` leads within `length`, up or down; the lowest above it
/// where there is none.
///
/// Braking without acceleration at its end takes *longer* to a small speed than to rest: (v + u)·√(v − u) grows with u
/// up to v/3. A speed that is a little too high for `wanted` may still stop, so the answer then lies below the hump.
pub(crate) fn reachable_exit(from: f64, wanted: f64, length: f64, limits: &PathLimits) -> f64 {
    if wanted >= from {
        return reachable_speed(from, wanted, length, limits);
    }
    if change_length(from, wanted, limits) <= length * (1.0 + SOLVER_SLACK) {
        return wanted;
    }
    let to_rest = change_length(from, 0.0, limits);
    if to_rest > length * (1.0 + SOLVER_SLACK) {
        // Faster than commanded: brake as far as it goes.
        let (mut high, mut low) = (from, wanted);
        for _ in 0..SOLVER_STEPS {
            let middle = 0.5 * (low + high);
            if change_length(from, middle, limits) <= length {
                high = middle;
            } else {
                low = middle;
            }
        }
        return high;
    }
    // Where rest just fits, a bit that it lacks must not lead to the other side of the hump, which is far above `wanted`.
    largest_fitting(0.0, wanted, length.max(to_rest), |speed| change_length(from, speed, limits))
}

/// Largest speed of [low, high) whose changes of speed take no more than `length`: a root of the increasing function
/// `needed(speed) − length` by regula falsi (Illinois), from the side that fits.
fn largest_fitting(mut low: f64, mut high: f64, length: f64, needed: impl Fn(f64) -> f64) -> f64 {
    let mut excess_low = needed(low) - length;
    let mut excess_high = needed(high) - length;
    let mut low_moved_last = None;
    for _ in 0..SOLVER_STEPS {
        if high - low <= SOLVER_PRECISION * high {
            break;
        }
        let secant = low - excess_low * (high - low) / (excess_high - excess_low);
        // Rounding must not throw the estimate out of its bracket.
        let estimate = if secant > low && secant < high { secant } else { 0.5 * (low + high) };
        let excess = needed(estimate) - length;
        if excess > 0.0 {
            high = estimate;
            excess_high = excess;
            // A side that stays put twice is pulled in, else it would stay for ever.
            if low_moved_last == Some(false) {
                excess_low *= 0.5;
            }
            low_moved_last = Some(false);
        } else {
            low = estimate;
            excess_low = excess;
            if low_moved_last == Some(true) {
                excess_high *= 0.5;
            }
            low_moved_last = Some(true);
            if excess >= -SOLVER_PRECISION * length {
                break;
            }
        }
        // The other side of a converged estimate is a hair away: step over the root instead of creeping up to it.
        let below = high * (1.0 - SOLVER_PRECISION);
        if excess > 0.0 && excess <= SOLVER_PRECISION * length && below > low && needed(below) <= length {
            return below;
        }
    }
    low
}

impl Profile {
    /// The fastest profile of this shape over `length` mm from `start` to `end` mm/s within the limits; `None` when the
    /// length is too short to change from one speed to the other.
    #[must_use]
    pub fn solve(length: f64, start: f64, end: f64, limits: PathLimits) -> Option<Self> {
        let lowest = start.max(end);
        let needed = |cruise: f64| change_length(start, cruise, &limits) + change_length(end, cruise, &limits);
        if needed(lowest) > length {
            // Rounding may make a change miss the length it was made for by some bits: then it fills it exactly.
            let change = change_length(start, end, &limits);
            return (change <= length * (1.0 + SOLVER_SLACK))
                .then(|| Self::with_cruise(length, start, lowest, end, &limits));
        }
        let highest = limits.velocity.max(lowest);
        let cruise = if needed(highest) <= length { highest } else { largest_fitting(lowest, highest, length, needed) };
        Some(Self::with_cruise(length, start, cruise, end, &limits))
    }

    /// The profile with this cruise speed, which must not be below either end's; clipped at `length` should the
    /// changes of speed not fit.
    pub(crate) fn with_cruise(length: f64, start: f64, cruise: f64, end: f64, limits: &PathLimits) -> Self {
        let changes = change_length(start, cruise, limits) + change_length(end, cruise, limits);
        let cruise_s = if cruise > 0.0 { ((length - changes) / cruise).max(0.0) } else { 0.0 };
        Self {
            length,
            speeds: [start, cruise, end],
            rise: Change::new(start, cruise, limits),
            fall: Change::new(cruise, end, limits),
            cruise_s,
        }
    }

    /// Length covered, mm.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Time taken, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.rise.duration_s() + self.cruise_s + self.fall.duration_s()
    }

    /// Speed at the start, mm/s.
    #[must_use]
    pub fn start_velocity(&self) -> f64 {
        self.speeds[0]
    }

    /// Speed between the two changes of speed, mm/s.
    #[must_use]
    pub fn cruise_velocity(&self) -> f64 {
        self.speeds[1]
    }

    /// Highest speed, mm/s.
    #[must_use]
    pub fn peak_velocity(&self) -> f64 {
        self.speed_range()[1]
    }

    /// Speed at the end, mm/s.
    #[must_use]
    pub fn end_velocity(&self) -> f64 {
        self.speeds[2]
    }

    /// The phases in order.
    fn phases(&self) -> [Phase; 7] {
        let [start, cruise, _] = self.speeds;
        let mut phases = [Phase::default(); 7];
        let mut state = Phase { speed: start, ..Phase::default() };
        let shape = [
            (self.rise.ramp_s, self.rise.jerk),
            (self.rise.hold_s, 0.0),
            (self.rise.ramp_s, -self.rise.jerk),
            (self.cruise_s, 0.0),
            (self.fall.ramp_s, self.fall.jerk),
            (self.fall.hold_s, 0.0),
            (self.fall.ramp_s, -self.fall.jerk),
        ];
        for (index, (duration_s, jerk)) in shape.into_iter().enumerate() {
            if index == 3 || index == 4 {
                // Cruise exactly, not at a sum of ramps.
                state.speed = cruise;
                state.acceleration = 0.0;
            }
            state.jerk = jerk;
            phases[index] = state;
            state = state.at(duration_s);
            state.start_s += duration_s;
        }
        phases
    }

    /// Path position, speed, acceleration and jerk at local time `t_s`; the ends beyond them.
    #[must_use]
    pub fn state(&self, t_s: f64) -> (f64, f64, f64, f64) {
        if t_s <= 0.0 {
            return (0.0, self.speeds[0], 0.0, self.rise.jerk);
        }
        if t_s >= self.duration() {
            return (self.length, self.speeds[2], 0.0, -self.fall.jerk);
        }
        let phases = self.phases();
        let phase = phases.iter().rev().find(|phase| phase.start_s <= t_s).unwrap_or(&phases[0]);
        let state = phase.at(t_s - phase.start_s);
        let [slowest, fastest] = self.speed_range();
        let speed = state.speed.clamp(slowest, fastest);
        (state.s.clamp(0.0, self.length), speed, state.acceleration, phase.jerk)
    }

    /// Time at which it passes the path position `s`, s: the inverse of [`Profile::state`]. Where it rests at an end,
    /// that end's time.
    #[must_use]
    pub fn time_at(&self, s: f64) -> f64 {
        if s <= 0.0 {
            return 0.0;
        }
        if s >= self.length {
            return self.duration();
        }
        let phases = self.phases();
        let index = phases.iter().rposition(|phase| phase.s <= s).unwrap_or(0);
        let duration_s = phases.get(index + 1).map_or(self.duration(), |next| next.start_s) - phases[index].start_s;
        phases[index].start_s + phases[index].time_to(s - phases[index].s, duration_s)
    }

    /// The profile up to where its acceleration can end soonest when the rise is broken off at local time `t_s`:
    /// what lies before `t_s` is the same to the bit, and it ends where its acceleration does, or at its end when it is
    /// braking towards that by then.
    #[must_use]
    pub fn broken_off(&self, t_s: f64) -> Self {
        let rise_s = self.rise.duration_s();
        if t_s >= rise_s + self.cruise_s {
            return *self;
        }
        let [start, cruise, _] = self.speeds;
        let mut rise = self.rise;
        let mut cruise_s = 0.0;
        let mut speed = cruise;
        if t_s >= rise_s {
            cruise_s = t_s - rise_s;
        } else if rise.jerk > 0.0 && t_s < rise.ramp_s + rise.hold_s {
            rise.hold_s = (t_s - rise.ramp_s).clamp(0.0, rise.hold_s);
            rise.ramp_s = rise.ramp_s.min(t_s.max(0.0));
            speed = start + rise.jerk * rise.ramp_s * (rise.ramp_s + rise.hold_s);
        }
        let fall = Change { jerk: -rise.jerk, ramp_s: 0.0, hold_s: 0.0 };
        let mut broken = Self { length: 0.0, speeds: [start, speed, speed], rise, fall, cruise_s };
        let [.., last] = broken.phases();
        broken.length = last.s.min(self.length);
        broken
    }

    /// Path positions and speeds at the local times `(first + k) · period_s − offset_s`. Each value depends on
    /// its own time only, whatever `first` a fill starts with.
    ///
    /// # Panics
    /// When the slices differ in length.
    pub fn fill(&self, first: u64, period_s: f64, offset_s: f64, out_s: &mut [f64], out_v: &mut [f64]) {
        self.fill_part(first, period_s, offset_s, [0.0, self.length], out_s, out_v);
    }

    /// [`Profile::fill`] between two path positions, seen from the first of them.
    fn fill_part(
        &self,
        first: u64,
        period_s: f64,
        offset_s: f64,
        [from, to]: [f64; 2],
        out_s: &mut [f64],
        out_v: &mut [f64],
    ) {
        assert_eq!(out_s.len(), out_v.len(), "one speed for every position");
        let first = first as f64;
        // Added as whole floating point numbers, which is exact and takes no check of each sum.
        let time_s = |k: usize| (first + k as f64) * period_s - offset_s;
        let phases = self.phases();
        let duration_s = self.duration();
        let mut k = 0;
        for (index, phase) in phases.iter().enumerate() {
            let end_s = phases.get(index + 1).map_or(duration_s, |next| next.start_s);
            // Guess where the phase ends, then correct the guess by the exact comparison.
            let guess = ((end_s + offset_s) / period_s - first).clamp(k as f64, out_s.len() as f64);
            let mut end = guess as usize;
            while end < out_s.len() && time_s(end) < end_s {
                end += 1;
            }
            while end > k && time_s(end - 1) >= end_s {
                end -= 1;
            }
            let Phase { start_s, s, speed, acceleration, jerk } = *phase;
            let s = s - from;
            let count = end - k;
            let run_first = first + k as f64;
            // A range beside them, since `enumerate` checks its count.
            for ((index, out_s), out_v) in (0..count).zip(&mut out_s[k..end]).zip(&mut out_v[k..end]) {
                // Before the start it rests there.
                let t = ((run_first + index as f64) * period_s - offset_s - start_s).max(0.0);
                *out_s = s + t * (speed + t * (0.5 * acceleration + t * (jerk / 6.0)));
                *out_v = speed + t * (acceleration + t * (0.5 * jerk));
            }
            k += count;
        }
        out_s[k..].fill(to - from);
        out_v[k..].fill(self.speeds[2]);
        // Rounding must not lead out of the profile.
        let [slowest, fastest] = self.speed_range();
        let length = to - from;
        for (s, v) in out_s[..k].iter_mut().zip(&mut out_v[..k]) {
            *s = s.clamp(0.0, length);
            *v = v.clamp(slowest, fastest);
        }
    }

    /// Lowest and highest of the three speeds, mm/s.
    fn speed_range(&self) -> [f64; 2] {
        let [start, cruise, end] = self.speeds;
        [start.min(cruise).min(end), start.max(cruise).max(end)]
    }

    /// Path positions between which the speed is constant, mm.
    pub(crate) fn cruise(&self) -> [f64; 2] {
        let phases = self.phases();
        [phases[3].s, phases[4].s]
    }
}

/// State at the start of a phase of constant jerk.
#[derive(Clone, Copy, Debug, Default)]
struct Phase {
    start_s: f64,
    s: f64,
    speed: f64,
    acceleration: f64,
    jerk: f64,
}

impl Phase {
    /// Time within the phase, at most `duration_s`, at which it has gone `length` mm: Newton's method on the
    /// increasing cubic, kept within a bracket.
    fn time_to(&self, length: f64, duration_s: f64) -> f64 {
        if self.acceleration == 0.0 && self.jerk == 0.0 {
            return (length / self.speed).clamp(0.0, duration_s);
        }
        let (mut low, mut high) = (0.0, duration_s);
        let whole = self.at(duration_s).s - self.s;
        let mut t = duration_s * (length / whole).clamp(0.0, 1.0);
        for _ in 0..SOLVER_STEPS {
            let excess = t * (self.speed + t * (0.5 * self.acceleration + t * (self.jerk / 6.0))) - length;
            let speed = self.speed + t * (self.acceleration + t * (0.5 * self.jerk));
            if excess > 0.0 {
                high = t;
            } else {
                low = t;
            }
            let next = t - excess / speed;
            let next = if next > low && next < high { next } else { 0.5 * (low + high) };
            let is_settled = (next - t).abs() <= TIME_PRECISION * duration_s;
            t = next;
            if is_settled {
                break;
            }
        }
        t
    }

    /// The state `t` seconds into the phase.
    fn at(&self, t: f64) -> Self {
        Self {
            s: self.s + t * (self.speed + t * (0.5 * self.acceleration + t * (self.jerk / 6.0))),
            speed: self.speed + t * (self.acceleration + t * (0.5 * self.jerk)),
            acceleration: self.acceleration + t * self.jerk,
            ..*self
        }
    }
}

#[cfg(test)]
mod tests;
