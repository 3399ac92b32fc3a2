//! What goes into the planner and what comes out.

use serde::{Deserialize, Serialize};
use smallvec::SmallVec;

use crate::tolerance::{ELEMENT_BYTES, STRETCH_BYTES};
use crate::{Element, Origin, Stretch, StretchProfile, Stretches};

/// An element to plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionRequest {
    /// The element.
    pub element: Element,
    /// Arc length where the motion begins, mm: 0, but where a change of the feed override has divided the element.
    pub start: f64,
    /// Commanded speeds and limits along it; the first one starts at `start`.
    pub stretches: Stretches,
    /// Share of acceleration and jerk to leave to the junction at the element's start, where that was passed already.
    pub(super) entry_reserve: f64,
    /// Whether it rests at its end even where the next element is tangent (exact stop).
    pub rest_at_end: bool,
    /// Whether corners at its ends may be passed with the velocity step that the machine permits.
    pub passes_corners: bool,
    /// Whether the feed override acts on it; it does not on threads.
    pub follows_override: bool,
    /// How far ahead of the command and behind it the position may be, mm: every place then has the strictest limits within this
    /// distance along the path.
    pub reach_mm: f64,
    /// Whether it has the limits of the machine's axes to itself: nothing is superposed. Only then its speed can be planned
    /// for the least time.
    pub has_full_limits: bool,
    /// What of the program it carries out; the plan does not depend on it.
    pub origin: Origin,
}

impl MotionRequest {
    /// The whole of an element, in exact path mode.
    #[must_use]
    pub const fn new(element: Element, stretches: Stretches) -> Self {
        Self {
            element,
            start: 0.0,
            stretches,
            entry_reserve: 0.0,
            rest_at_end: false,
            passes_corners: true,
            follows_override: true,
            reach_mm: 0.0,
            has_full_limits: true,
            origin: Origin::Block,
        }
    }

    /// Upper bound of the memory that it takes while it is planned, bytes; the same on every platform.
    #[must_use]
    pub fn bytes(&self) -> usize {
        ELEMENT_BYTES + STRETCH_BYTES * self.stretches.len() + self.element.curve_bytes()
    }

    /// Commanded speed of a stretch at this feed override, mm/s.
    pub(crate) fn commanded(&self, stretch: &Stretch, feed_override: f64) -> f64 {
        commanded(self.follows_override, stretch, feed_override)
    }
}

/// Commanded speed of a stretch at this feed override, mm/s. Feed hold stops rapids too, which have no feed.
fn commanded(follows_override: bool, stretch: &Stretch, feed_override: f64) -> f64 {
    match feed_override {
        _ if !follows_override => stretch.speed_mm_per_s,
        0.0 => 0.0,
        ratio => stretch.speed_mm_per_s * ratio,
    }
}

/// Stretches without the divisions of a plan: those that differ in nothing but their ends are one.
fn whole_stretches(planned: impl Iterator<Item = Stretch>) -> Stretches {
    let mut whole = Stretches::new();
    for stretch in planned {
        match whole.last_mut().filter(|last| Stretch { end: stretch.end, ..**last } == stretch) {
            Some(last) => last.end = stretch.end,
            None => whole.push(stretch),
        }
    }
    whole
}

/// A stretch with its profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedStretch {
    /// Arc length where it starts, mm.
    pub start: f64,
    /// Where it ends, and what it was asked for.
    pub stretch: Stretch,
    /// Motion along it, from 0 to its length.
    pub profile: StretchProfile,
}

/// A planned element.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedMotion {
    /// The element.
    pub element: Element,
    /// Its stretches in order; at least one.
    pub stretches: SmallVec<[PlannedStretch; 1]>,
    entry_reserve: f64,
    rest_at_end: bool,
    passes_corners: bool,
    follows_override: bool,
    pub(super) has_full_limits: bool,
    origin: Origin,
}

impl PlannedMotion {
    /// Upper bound of the memory that it takes, bytes; the same on every platform.
    #[must_use]
    pub fn bytes(&self) -> usize {
        ELEMENT_BYTES + STRETCH_BYTES * self.stretches.len() + self.element.curve_bytes()
    }

    pub(super) fn new(request: MotionRequest, stretches: SmallVec<[PlannedStretch; 1]>) -> Self {
        let MotionRequest {
            element,
            entry_reserve,
            rest_at_end,
            passes_corners,
            follows_override,
            has_full_limits,
            origin,
            ..
        } = request;
        Self {
            element,
            stretches,
            entry_reserve,
            rest_at_end,
            passes_corners,
            follows_override,
            has_full_limits,
            origin,
        }
    }

    /// Commanded speed of a stretch at this feed override, mm/s.
    pub(super) fn commanded(&self, stretch: &Stretch, feed_override: f64) -> f64 {
        commanded(self.follows_override, stretch, feed_override)
    }

    /// The same with other stretches.
    pub(super) fn with_stretches(&self, stretches: SmallVec<[PlannedStretch; 1]>) -> Self {
        Self { element: self.element.clone(), stretches, ..*self }
    }

    /// Asks again for all of it.
    #[must_use]
    pub fn request(&self) -> MotionRequest {
        self.request_from(0, self.stretches.first().map_or(0.0, |first| first.start))
    }

    /// Asks again for the part of it that begins at arc length `start`, mm, inside or at the start of stretch `first`.
    #[must_use]
    pub fn request_from(&self, first: usize, start: f64) -> MotionRequest {
        let &Self { entry_reserve, rest_at_end, passes_corners, follows_override, has_full_limits, origin, .. } = self;
        let stretches = whole_stretches(self.stretches[first..].iter().map(|planned| planned.stretch));
        MotionRequest {
            element: self.element.clone(),
            start,
            stretches,
            entry_reserve,
            rest_at_end,
            passes_corners,
            follows_override,
            // Its limits have that.
            reach_mm: 0.0,
            has_full_limits,
            origin,
        }
    }

    /// What is left of a course from local time `t_s` of stretch `first` on, and the index of the stretch behind it where its plan
    /// ends in this element; `None` where it is not on a course all that way, or nothing is left.
    #[must_use]
    pub fn rest_of_course(&self, first: usize, t_s: f64) -> Option<(Self, Option<usize>)> {
        let mut stretches = SmallVec::new();
        for (index, planned) in self.stretches.iter().enumerate().skip(first) {
            let StretchProfile::Course(course) = &planned.profile else { return None };
            let mut own = planned.clone();
            if index == first && t_s > 0.0 {
                let (s, rest) = course.rest_from(t_s);
                let is_left = s > 0.0 && rest.duration() > 0.0;
                if !is_left {
                    return None;
                }
                own.start += s;
                own.profile = StretchProfile::Course(rest);
            }
            stretches.push(own);
            if course.ends_plan() {
                return Some((self.with_stretches(stretches), Some(index + 1)));
            }
        }
        (!stretches.is_empty()).then(|| (self.with_stretches(stretches), None))
    }

    /// Whether it is the rest of an element that a change of the feed override has divided.
    #[must_use]
    pub fn goes_on(&self) -> bool {
        self.stretches.first().is_some_and(|first| first.start > 0.0)
    }

    /// Whether the feed override and feed hold act on it.
    #[must_use]
    pub const fn follows_override(&self) -> bool {
        self.follows_override
    }

    /// Whether it rests at its end whatever follows: exact stop.
    #[must_use]
    pub const fn rests_at_end(&self) -> bool {
        self.rest_at_end
    }

    /// What of the program it carries out.
    #[must_use]
    pub const fn origin(&self) -> Origin {
        self.origin
    }
}

/// What comes out of the planner, in the order in which it went in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "most items are motions, and a box would allocate once per element")]
pub enum Planned<B> {
    /// A planned element.
    Motion(PlannedMotion),
    /// A barrier, at which the path rests.
    Barrier(B),
}

/// A part of the path that is to be planned again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "most items are motions, and a box would allocate once per element")]
pub enum PathItem<B> {
    /// An element.
    Motion(MotionRequest),
    /// A barrier, at which the path rests.
    Barrier(B),
}

/// What waits to be planned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ahead<'a, B> {
    /// An element.
    Motion(&'a MotionRequest),
    /// An element that was planned before a change of the feed override.
    Planned(&'a PlannedMotion),
    /// A barrier, at which the path rests.
    Barrier(&'a B),
}

impl<B> Ahead<'_, B> {
    /// Whether an element begins here; not with the rest of one.
    #[must_use]
    pub fn begins_element(&self) -> bool {
        match self {
            Self::Motion(request) => request.start == 0.0,
            Self::Planned(motion) => !motion.goes_on(),
            Self::Barrier(_) => false,
        }
    }

    /// The element, without any motion.
    #[must_use]
    pub fn unplanned(&self) -> Option<PlannedMotion> {
        match self {
            Self::Motion(request) => Some(PlannedMotion::new((*request).clone(), SmallVec::new())),
            Self::Planned(motion) => Some(motion.with_stretches(SmallVec::new())),
            Self::Barrier(_) => None,
        }
    }
}

impl<B: Clone> From<Ahead<'_, B>> for PathItem<B> {
    fn from(ahead: Ahead<'_, B>) -> Self {
        match ahead {
            Ahead::Motion(request) => Self::Motion(request.clone()),
            Ahead::Planned(motion) => Self::Motion(motion.request()),
            Ahead::Barrier(barrier) => Self::Barrier(barrier.clone()),
        }
    }
}

impl<B> From<Planned<B>> for PathItem<B> {
    fn from(planned: Planned<B>) -> Self {
        match planned {
            Planned::Motion(motion) => Self::Motion(motion.request()),
            Planned::Barrier(barrier) => Self::Barrier(barrier),
        }
    }
}
