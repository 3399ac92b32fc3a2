//! Parts of profiles: a run of stretches has one profile, of which every stretch is a part.

use serde::{Deserialize, Serialize};
use smallvec::{SmallVec, smallvec};

use super::Profile;
use crate::tolerance::SOLVER_SLACK;

/// A part of a profile: from one of its path positions to another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProfilePart {
    profile: Profile,
    /// Path positions of its start and end on the profile, mm, and the times they are passed at, s.
    start: (f64, f64),
    end: (f64, f64),
}

impl ProfilePart {
    /// The part of `profile` from path position `start` to `end`, mm.
    #[must_use]
    pub fn new(profile: Profile, start: f64, end: f64) -> Self {
        let start_s = profile.time_at(start);
        let end_s = profile.time_at(end).max(start_s);
        Self { profile, start: (start, start_s), end: (end, end_s) }
    }

    /// The part with its profile broken off at local time `t_s`, see [`Profile::broken_off`]: what lies before is the
    /// same to the bit.
    #[must_use]
    pub fn broken_off(&self, t_s: f64) -> Self {
        self.on(self.profile.broken_off(self.start.1 + t_s.clamp(0.0, self.duration())), self.start.1)
    }

    /// This part once the one before it on the same profile was broken off.
    #[must_use]
    pub fn after(&self, before: &Self) -> Self {
        self.on(before.profile, before.end.1)
    }

    /// The part on another profile, which it enters at `start_s`, as far as that goes.
    fn on(&self, profile: Profile, start_s: f64) -> Self {
        let end = self.end.0.min(profile.length);
        Self { profile, start: (self.start.0, start_s), end: (end, profile.time_at(end).max(start_s)) }
    }

    /// The profile it is a part of.
    #[must_use]
    pub const fn whole(&self) -> &Profile {
        &self.profile
    }

    /// Path positions of its start and end on the whole profile, mm.
    #[must_use]
    pub const fn range(&self) -> [f64; 2] {
        [self.start.0, self.end.0]
    }

    /// Whether it has no acceleration at its end.
    pub(crate) fn ends_steadily(&self) -> bool {
        let [from, to] = self.steady_range();
        let end = self.end.0;
        end >= self.profile.length * (1.0 - SOLVER_SLACK) || (from..=to).contains(&end)
    }

    /// Whether its speed is constant.
    pub(crate) fn is_steady(&self) -> bool {
        let [from, to] = self.steady_range();
        from <= self.start.0 && self.end.0 <= to
    }

    /// The parts before, in and behind a cruise of at least `long_s`; `None` where none of it is that long, or it is all of the part.
    pub(crate) fn around_cruise(&self, long_s: f64) -> Option<SmallVec<[Self; 3]>> {
        let [from, to] = self.profile.cruise();
        let [from, to] = [from.max(self.start.0), to.min(self.end.0)];
        if to - from < long_s * self.profile.cruise_velocity() || self.is_steady() {
            return None;
        }
        let rounding = SOLVER_SLACK * self.profile.length;
        let mut places: SmallVec<[f64; 4]> = smallvec![self.start.0];
        places.extend(
            [from, to].into_iter().filter(|place| place - self.start.0 > rounding && self.end.0 - place > rounding),
        );
        places.push(self.end.0);
        Some(places.windows(2).map(|ends| Self::new(self.profile, ends[0], ends[1])).collect())
    }

    /// Where the whole profile has a constant speed, with some rounding.
    fn steady_range(&self) -> [f64; 2] {
        let [from, to] = self.profile.cruise();
        let rounding = SOLVER_SLACK * self.profile.length;
        [from - rounding, to + rounding]
    }

    /// Time on the whole profile at its start, s.
    #[must_use]
    pub const fn start_time_s(&self) -> f64 {
        self.start.1
    }

    /// Length covered, mm.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.end.0 - self.start.0
    }

    /// Time taken, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.end.1 - self.start.1
    }

    /// Its phases in order: what each is, when it starts by local time, s, and how long it lasts, s; together
    /// [`ProfilePart::duration`]. Phases outside the part last no time.
    pub fn phases(&self) -> impl Iterator<Item = (PhaseKind, f64, f64)> + '_ {
        let Profile { rise, fall, cruise_s, .. } = self.profile;
        let phases = [
            (PhaseKind::Jerk, rise.ramp_s),
            (PhaseKind::Acceleration, rise.hold_s),
            (PhaseKind::Jerk, rise.ramp_s),
            (PhaseKind::Cruise, cruise_s),
            (PhaseKind::Jerk, fall.ramp_s),
            (PhaseKind::Acceleration, fall.hold_s),
            (PhaseKind::Jerk, fall.ramp_s),
        ];
        let mut start_s = 0.0;
        phases.into_iter().map(move |(phase, duration_s)| {
            let end_s = start_s + duration_s;
            let inside_s = start_s.max(self.start.1);
            start_s = end_s;
            (phase, inside_s - self.start.1, (end_s.min(self.end.1) - inside_s).max(0.0))
        })
    }

    /// How its time divides among the phases of the profile; together [`ProfilePart::duration`].
    #[must_use]
    pub fn phase_times(&self) -> PhaseTimes {
        let mut times = PhaseTimes::default();
        for (phase, _, time_s) in self.phases() {
            *match phase {
                PhaseKind::Jerk => &mut times.jerk_s,
                PhaseKind::Acceleration => &mut times.acceleration_s,
                PhaseKind::Cruise => &mut times.cruise_s,
            } += time_s;
        }
        times
    }

    /// Path position from its start, speed, acceleration and jerk at local time `t_s`; the ends beyond them.
    #[must_use]
    pub fn state(&self, t_s: f64) -> (f64, f64, f64, f64) {
        // A sum could miss the end by a bit.
        let time_s = if t_s >= self.duration() { self.end.1 } else { self.start.1 + t_s.max(0.0) };
        let (s, v, a, j) = self.profile.state(time_s);
        ((s - self.start.0).clamp(0.0, self.length()), v, a, j)
    }

    /// Path positions from its start and speeds at the local times `(first + k) · period_s − offset_s`. Each value
    /// depends on its own time only, whatever `first` a fill starts with.
    ///
    /// # Panics
    /// When the slices differ in length.
    pub fn fill(&self, first: u64, period_s: f64, offset_s: f64, out_s: &mut [f64], out_v: &mut [f64]) {
        self.profile.fill_part(first, period_s, offset_s - self.start.1, self.range(), out_s, out_v);
    }
}

/// What a phase of a profile is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhaseKind {
    /// The acceleration changes.
    Jerk,
    /// Constant acceleration other than zero.
    Acceleration,
    /// Constant speed.
    Cruise,
}

/// Times spent in the phases of a profile, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhaseTimes {
    /// While the acceleration changes.
    pub jerk_s: f64,
    /// At constant acceleration other than zero.
    pub acceleration_s: f64,
    /// At constant speed.
    pub cruise_s: f64,
}
