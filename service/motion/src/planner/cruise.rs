//! Dividing stretches where a long cruise begins and ends, before what is around it is planned for the least time.
//!
//! A cruise at the commanded speed cannot be faster, and has no acceleration at its ends. So rows end there, and do not solve for it.

use smallvec::SmallVec;

use super::request::{PlannedMotion, PlannedStretch};
use crate::tolerance::{AT_COMMAND, LONG_CRUISE_S};
use crate::{Curve, ProfilePart, StretchProfile};

impl PlannedMotion {
    /// The motion with each stretch divided at the ends of a long cruise at its commanded speed at this feed override.
    pub(super) fn divided_at_cruises(mut self, feed_override: f64) -> Self {
        let cuts_of = |planned: &PlannedStretch| {
            let part = planned.profile.phases()?;
            let command = self.commanded(&planned.stretch, feed_override);
            // The phases of a straight move from its start to its end are the least time already.
            let is_least = matches!(self.element.curve, Curve::Line) && part.length() >= part.whole().length();
            if is_least || part.whole().cruise_velocity() < command * (1.0 - AT_COMMAND) {
                return None;
            }
            part.around_cruise(LONG_CRUISE_S)
        };
        if !self.has_full_limits || !self.stretches.iter().any(|planned| cuts_of(planned).is_some()) {
            return self;
        }
        let mut stretches = SmallVec::new();
        for planned in &self.stretches {
            match cuts_of(planned) {
                Some(parts) => push_parts(&mut stretches, planned, parts),
                None => stretches.push(planned.clone()),
            }
        }
        self.stretches = stretches;
        self
    }
}

/// Adds the parts of a stretch.
fn push_parts(
    stretches: &mut SmallVec<[PlannedStretch; 1]>,
    whole: &PlannedStretch,
    parts: SmallVec<[ProfilePart; 3]>,
) {
    let mut start = whole.start;
    let count = parts.len();
    for (index, part) in parts.into_iter().enumerate() {
        let mut stretch = whole.stretch;
        if index + 1 < count {
            stretch.end = start + part.length();
        }
        stretches.push(PlannedStretch { start, stretch, profile: StretchProfile::Phases(part) });
        start = stretch.end;
    }
}
