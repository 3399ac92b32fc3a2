//! Motion along one stretch: a part of a seven-phase profile, or of a course.

use serde::{Deserialize, Serialize};

use super::ProfilePart;
use crate::Course;

/// Motion along a stretch as a function of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "most stretches have phases, and a box would allocate once per stretch")]
pub enum StretchProfile {
    /// Phases of constant jerk under one set of limits.
    Phases(ProfilePart),
    /// Close to the least time, with limits by place.
    Course(Course),
}

impl StretchProfile {
    /// The phases, where it has them.
    #[must_use]
    pub const fn phases(&self) -> Option<&ProfilePart> {
        match self {
            Self::Phases(part) => Some(part),
            Self::Course(_) => None,
        }
    }

    /// Length covered, mm.
    #[must_use]
    pub fn length(&self) -> f64 {
        match self {
            Self::Phases(part) => part.length(),
            Self::Course(course) => course.length(),
        }
    }

    /// Time taken, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        match self {
            Self::Phases(part) => part.duration(),
            Self::Course(course) => course.duration(),
        }
    }

    /// Path position from its start, speed, acceleration and jerk at local time `t_s`; the ends beyond them.
    #[must_use]
    pub fn state(&self, t_s: f64) -> (f64, f64, f64, f64) {
        match self {
            Self::Phases(part) => part.state(t_s),
            Self::Course(course) => course.state(t_s),
        }
    }

    /// Path positions from its start and speeds at the local times `(first + k) · period_s − offset_s`. Each value
    /// depends on its own time only, whatever `first` a fill starts with.
    ///
    /// # Panics
    /// When the slices differ in length.
    pub fn fill(&self, first: u64, period_s: f64, offset_s: f64, out_s: &mut [f64], out_v: &mut [f64]) {
        match self {
            Self::Phases(part) => part.fill(first, period_s, offset_s, out_s, out_v),
            Self::Course(course) => course.fill(first, period_s, offset_s, out_s, out_v),
        }
    }
}
