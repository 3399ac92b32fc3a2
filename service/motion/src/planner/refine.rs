//! The second step of a planning: pieces of the plan of runs are planned anew for the least time.
//!
//! A piece is a row of whole runs between two places at which the plan of runs has no acceleration, with smooth joints inside.
//! Its ends keep their places and speeds, so that every piece stands for itself: one that is not found, or takes longer than
//! its runs, is left as it is, and a plan is never slower than the one of its runs. Where a junction at an end takes a share of
//! acceleration and jerk, the piece leaves it free there, and only there.

use std::collections::VecDeque;

use super::Waiting;
use super::runs::{Plan, Run};
use crate::speed::{AxisLimits, End, Guess, Path, Span};
use crate::tolerance::{MOST_PIECE_S, NO_RESERVE, SMOOTH_RESERVE, WORTHWHILE};
use crate::{Curve, PlannedStretch, ProfilePart, StretchProfile};

/// A plan that there is, by time.
#[derive(Clone, Debug, Default)]
pub(super) struct PartsGuess {
    /// Time and place of the start of each part.
    parts: Vec<(f64, f64, StretchProfile)>,
    duration_s: f64,
    length: f64,
}

impl PartsGuess {
    pub(super) fn push(&mut self, part: StretchProfile) {
        let (duration_s, length) = (part.duration(), part.length());
        self.parts.push((self.duration_s, self.length, part));
        self.duration_s += duration_s;
        self.length += length;
    }

    /// Length of its path, mm.
    pub(super) fn length(&self) -> f64 {
        self.length
    }

    /// Place, speed, acceleration and jerk at a time.
    pub(super) fn state(&self, t_s: f64) -> (f64, f64, f64, f64) {
        let index = self.parts.partition_point(|&(start_s, ..)| start_s <= t_s).saturating_sub(1);
        let Some((start_s, start, part)) = self.parts.get(index) else { return (self.length, 0.0, 0.0, 0.0) };
        let (s, speed, acceleration, jerk) = part.state(t_s - start_s);
        (start + s, speed, acceleration, jerk)
    }

    /// Speed at its end, mm/s.
    pub(super) fn end_speed(&self) -> f64 {
        self.parts.last().map_or(0.0, |(_, _, part)| part.state(part.duration()).1)
    }
}

impl Guess for PartsGuess {
    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn at(&self, t_s: f64) -> (f64, f64) {
        let (s, speed, ..) = self.state(t_s);
        (s, speed)
    }
}

/// What a junction inside a piece takes: its reserve was found for the speed of the plan of runs, of which the least time takes
/// up to 1.6 times.
fn at_any_speed((place, reserve): (f64, f64)) -> (f64, f64) {
    (place, 2.5 * reserve)
}

/// Where a node's motion is found in the courses.
#[derive(Clone, Copy, Debug)]
pub(super) struct InCourse {
    course: usize,
    /// Place of the node's start on the course, mm.
    offset: f64,
}

impl Plan {
    /// Plans pieces of the first `count` nodes anew. `next_reserve` is what the junction behind them takes.
    pub(super) fn refine(&mut self, chain: &VecDeque<Waiting>, count: usize, limits: &AxisLimits, next_reserve: f64) {
        self.courses.clear();
        let mut from = 0;
        while from < count {
            let to = self.piece_from(chain, from, count);
            if to > from {
                self.refine_piece(chain, from, to, limits, next_reserve);
                from = to;
            } else {
                let Run { first, count, .. } = self.runs[self.nodes[from].run];
                from = first + count;
            }
        }
    }

    /// The node behind the longest piece from node `from` on, which starts a run; `from` where that run has to stay.
    fn piece_from(&mut self, chain: &VecDeque<Waiting>, from: usize, count: usize) -> usize {
        let mut to = from;
        let mut time_s = 0.0;
        while to < count {
            let run = self.nodes[to].run;
            let Run { first, count: nodes, .. } = self.runs[run];
            let end = (first + nodes).min(count);
            let profile = self.profile(run);
            let own = &self.nodes[first..end];
            let is_smooth = |node: &super::Node| node.entry.reserve <= SMOOTH_RESERVE && node.entry.acceleration > 0.0;
            let is_free = own.iter().all(|node| {
                let request = &chain[node.element].request;
                request.has_full_limits && request.follows_override
            });
            // Inside a run a window ends where the speed is constant.
            let [cruise_from, cruise_to] = profile.cruise();
            let ends_inside = end < first + nodes;
            let is_divided = ends_inside && !(cruise_from..=cruise_to).contains(&self.nodes[end].offset);
            let stays = !is_free
                || is_divided
                || self.stop.is_some_and(|stop| stop.node < first + nodes)
                || !own[1..].iter().all(is_smooth)
                || profile.duration() > MOST_PIECE_S;
            let is_joined = to == from || is_smooth(&own[0]);
            if stays || !is_joined || time_s + profile.duration() > MOST_PIECE_S {
                break;
            }
            time_s += profile.duration();
            to = end;
        }
        to
    }

    fn refine_piece(
        &mut self,
        chain: &VecDeque<Waiting>,
        from: usize,
        to: usize,
        limits: &AxisLimits,
        next_reserve: f64,
    ) {
        let runs = self.nodes[from].run..=self.nodes[to - 1].run;
        let mut guess = PartsGuess::default();
        for run in runs.clone() {
            let profile = self.profile(run);
            let Run { first, count, .. } = self.runs[run];
            let end = if first + count > to { self.nodes[to].offset } else { profile.length() };
            guess.push(StretchProfile::Phases(ProfilePart::new(profile, 0.0, end)));
        }
        let mut start = 0.0;
        let mut shortest_s = 0.0;
        let mut spans: Vec<Span<'_>> = Vec::with_capacity(to - from);
        let mut is_straight = true;
        for node in &self.nodes[from..to] {
            let element = &chain[node.element].request.element;
            spans.push(Span { start, element, from: node.start, command: node.commanded });
            start += node.length;
            shortest_s += node.length / node.commanded;
            is_straight &= matches!(element.curve, Curve::Line);
        }
        let exit_reserve = self.nodes.get(to).map_or(next_reserve, |node| node.entry.reserve);
        let reserves = [self.nodes[from].entry.reserve, exit_reserve];
        // The seven phases of a straight move are the least time already.
        let is_least = is_straight && runs.count() == 1 && reserves == [0.0; 2];
        if is_least || guess.duration_s <= shortest_s * WORTHWHILE {
            return;
        }
        let speeds = [guess.at(0.0).1, guess.at(guess.duration_s).1];
        let passed =
            self.nodes[from..to].iter().zip(&spans).skip(1).map(|(node, span)| (span.start, node.entry.reserve));
        let joints: Vec<_> = passed.filter(|&(_, reserve)| reserve > NO_RESERVE).map(at_any_speed).collect();
        let path = Path::new(&spans, start, limits).with_joints(&joints);
        let jerk = limits.largest_jerk();
        let ends: [End; 2] = core::array::from_fn(|k| End::reserving(speeds[k], 0.0, reserves[k], jerk));
        let Some(course) = self.speed.plan(&path, ends, &guess) else { return };
        if course.duration() >= guess.duration_s {
            return;
        }
        let index = self.courses.len();
        self.courses.push(course);
        for (node, span) in self.nodes[from..to].iter_mut().zip(&spans) {
            node.in_course = Some(InCourse { course: index, offset: span.start });
        }
    }

    /// Motion along a node that a piece has been found for.
    pub(super) fn course_of(&self, node: usize) -> Option<StretchProfile> {
        let InCourse { course, offset } = self.nodes[node].in_course?;
        let whole = &self.courses[course];
        let next = self.nodes.get(node + 1).and_then(|next| next.in_course).filter(|next| next.course == course);
        let end = next.map_or(whole.length(), |next| next.offset);
        Some(StretchProfile::Course(whole.between(offset, end)))
    }
}

/// A stretch by the phases of its run.
pub(super) fn by_phases(start: f64, stretch: &crate::Stretch, part: ProfilePart) -> PlannedStretch {
    PlannedStretch { start, stretch: *stretch, profile: StretchProfile::Phases(part) }
}
