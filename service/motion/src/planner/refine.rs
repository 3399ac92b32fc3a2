//! The second step of a planning: rows of runs are planned anew for the least time.
//!
//! A row is made of whole runs with smooth joints between them; at its ends, which keep their places and speeds, the plan of runs
//! has no acceleration. It is planned in windows. Each ends where a run does, as that does; the next one takes over well before,
//! from the speed and acceleration there, so that no acceleration has to end where windows meet. A window that is not found, or
//! takes longer than what is known, is left as it is known: from the window before up to its end, by the runs beyond. So a plan is
//! never slower than the one of its runs. Where a junction at an end takes a share of acceleration and jerk, the row leaves it free
//! there, and only there.

use std::collections::VecDeque;
use std::ops::Range;

use super::Waiting;
use super::runs::{Node, Plan, Run};
use crate::speed::{AxisLimits, Course, End, Guess, Path, Span, Window};
use crate::tolerance::{
    AT_REST, HANDOVER, KEPT_KNOTS, MOST_RUN_S, NO_RESERVE, RESERVED_S, SMOOTH_RESERVE, WINDOW_S, WORTHWHILE,
};
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

/// What a junction inside a row takes: its reserve was found for the speed of the plan of runs, of which the least time takes
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

/// A row of nodes that is planned window by window: what is settled of it, and what the last window found beyond.
#[derive(Default)]
struct Row {
    /// Courses one behind the other, from node `first` on.
    settled: Vec<Course>,
    first: usize,
    /// The node in which the present window starts, and how far from its start, mm.
    at: usize,
    inside: f64,
    /// What the last window has found from there on, up to the node `next`.
    found: Option<Course>,
    next: usize,
}

impl Plan {
    /// Plans rows of the first `count` nodes anew. `next_reserve` is what the junction behind them takes.
    pub(super) fn refine(&mut self, chain: &VecDeque<Waiting>, count: usize, limits: &AxisLimits, next_reserve: f64) {
        self.courses.clear();
        let mut from = 0;
        while from < count {
            let to = self.row_from(chain, from, count);
            if to > from {
                self.refine_row(chain, from..to, limits, next_reserve);
                from = to;
            } else {
                from = self.run_end(from, count);
            }
        }
    }

    /// The node behind the run of a node, at most `count`.
    fn run_end(&self, node: usize, count: usize) -> usize {
        let Run { first, count: nodes, .. } = self.runs[self.nodes[node].run];
        (first + nodes).min(count)
    }

    /// The node behind the longest row from node `from` on, which starts a run; `from` where that run has to stay.
    fn row_from(&mut self, chain: &VecDeque<Waiting>, from: usize, count: usize) -> usize {
        let mut to = from;
        while to < count {
            let run = self.nodes[to].run;
            let Run { first, count: nodes, .. } = self.runs[run];
            let end = (first + nodes).min(count);
            let profile = self.profile(run);
            let own = &self.nodes[first..end];
            let is_smooth = |node: &Node| node.entry.reserve <= SMOOTH_RESERVE && node.entry.acceleration > 0.0;
            let is_free = own.iter().all(|node| {
                let request = &chain[node.element].request;
                request.has_full_limits && request.follows_override
            });
            // Inside a run a release ends where the speed is constant.
            let [cruise_from, cruise_to] = profile.cruise();
            let ends_inside = end < first + nodes;
            let is_divided = ends_inside && !(cruise_from..=cruise_to).contains(&self.nodes[end].offset);
            let stays = !is_free
                || is_divided
                || self.stop.is_some_and(|stop| stop.node < first + nodes)
                || !own[1..].iter().all(is_smooth)
                || profile.duration() > MOST_RUN_S;
            let is_joined = to == from || is_smooth(&own[0]);
            if stays || !is_joined {
                break;
            }
            to = end;
        }
        to
    }

    /// Plans a row of runs in windows, each from the state that the one before has a while before its end.
    fn refine_row(&mut self, chain: &VecDeque<Waiting>, nodes: Range<usize>, limits: &AxisLimits, next_reserve: f64) {
        let mut row = Row { first: nodes.start, at: nodes.start, next: nodes.start, ..Row::default() };
        let mut window_s = WINDOW_S;
        while row.next < nodes.end {
            let end = self.window_end(&row, nodes.end, window_s);
            if let Some(course) = self.plan_window(chain, &row, end..nodes.end, limits, next_reserve) {
                window_s = WINDOW_S;
                let is_last = end == nodes.end;
                row.next = end;
                row.found = None;
                if is_last {
                    row.settled.push(course);
                } else {
                    let kept = course.calmest_place(HANDOVER);
                    self.advance(&mut row, kept);
                    row.found = Some(course.between(kept, course.length()));
                    row.settled.push(course.between(0.0, kept));
                }
            } else if let Some(found) = row.found.take() {
                // What was found before goes on to its end.
                row.settled.push(found);
                (row.at, row.inside) = (row.next, 0.0);
            } else {
                let single = self.run_end(row.next, nodes.end);
                if end > single {
                    window_s = 0.0;
                    continue;
                }
                // The run stays as it is.
                self.settle(&mut row);
                row = Row { first: single, at: single, next: single, ..Row::default() };
                window_s = WINDOW_S;
            }
        }
        row.settled.extend(row.found.take());
        self.settle(&mut row);
    }

    /// The next window starts so far behind the present one.
    fn advance(&self, row: &mut Row, length: f64) {
        row.inside += length;
        while row.at + 1 < row.next && row.inside >= self.nodes[row.at].length {
            row.inside -= self.nodes[row.at].length;
            row.at += 1;
        }
    }

    /// Makes what is settled of a row the motion of its nodes.
    fn settle(&mut self, row: &mut Row) {
        if row.settled.is_empty() {
            return;
        }
        let index = self.courses.len();
        self.courses.push(Course::joined(&row.settled));
        row.settled.clear();
        let mut offset = 0.0;
        for node in &mut self.nodes[row.first..row.next] {
            node.in_course = Some(InCourse { course: index, offset });
            offset += node.length;
        }
    }

    /// The node behind the window: what was found before, and runs that take about `window_s`, at least one.
    fn window_end(&mut self, row: &Row, to: usize, window_s: f64) -> usize {
        let mut time_s = 0.0;
        let mut end = row.next;
        while end < to && (end == row.next || time_s < window_s) {
            time_s += self.profile(self.nodes[end].run).duration();
            end = self.run_end(end, to);
        }
        end
    }

    /// The course of the window up to node `end`, the last one of the row where that is the `last` node; `None` where there is
    /// none that is faster than what is known.
    fn plan_window(
        &mut self,
        chain: &VecDeque<Waiting>,
        row: &Row,
        Range { start: end, end: last }: Range<usize>,
        limits: &AxisLimits,
        next_reserve: f64,
    ) -> Option<Course> {
        let is_last = end == last;
        let mut guess = PartsGuess::default();
        if let Some(found) = &row.found {
            guess.push(StretchProfile::Course(found.clone()));
        }
        let mut node = row.next;
        while node < end {
            let run = self.nodes[node].run;
            let profile = self.profile(run);
            let next = self.run_end(node, end);
            let Run { first, count, .. } = self.runs[run];
            let to = if first + count > next { self.nodes[next].offset } else { profile.length() };
            guess.push(StretchProfile::Phases(ProfilePart::new(profile, 0.0, to)));
            node = next;
        }
        let (start_speed, start_acceleration) =
            row.found.as_ref().map_or((guess.at(0.0).1, 0.0), |found| (found.state(0.0).1, found.state(0.0).2));
        let (spans, length) = self.spans(chain, row, end);
        let joints = self.joints(row, end, start_speed);
        let exit_reserve = self.nodes.get(end).map_or(next_reserve, |node| node.entry.reserve);
        let entry_reserve = if row.found.is_some() { 0.0 } else { self.nodes[row.next].entry.reserve };
        let is_one_run = row.found.is_none() && self.run_end(row.next, end) == end;
        // The seven phases of a straight move are the least time already.
        let is_straight = || spans.iter().all(|span| matches!(span.element.curve, Curve::Line));
        let is_least = is_one_run && [entry_reserve, exit_reserve] == [0.0; 2] && is_straight();
        let ends = spans.iter().skip(1).map(|span| span.start).chain([length]);
        let shortest_s: f64 = spans.iter().zip(ends).map(|(span, end)| (end - span.start) / span.command).sum();
        if is_least || guess.duration_s <= shortest_s * WORTHWHILE {
            return None;
        }
        let at_rest = |speed: f64| if speed > AT_REST { speed } else { 0.0 };
        let end_speed = at_rest(guess.at(guess.duration_s).1);
        let path = Path::new(&spans, length, limits).with_joints(&joints);
        let jerk = limits.largest_jerk();
        let ends = [
            End::reserving(at_rest(start_speed), start_acceleration, entry_reserve, jerk),
            End::reserving(end_speed, 0.0, exit_reserve, jerk),
        ];
        let knots = row.found.as_ref().map_or_else(Vec::new, |found| found.knots(KEPT_KNOTS));
        let window = Window { knots: &knots, goes_on: !is_last };
        let course = self.speed.plan_window(&path, ends, &guess, window);
        course.filter(|course| course.duration() < guess.duration_s)
    }

    /// The path of the window up to node `end`, and its length, mm.
    fn spans<'a>(&self, chain: &'a VecDeque<Waiting>, row: &Row, end: usize) -> (Vec<Span<'a>>, f64) {
        let mut place = -row.inside;
        let mut spans = Vec::with_capacity(end - row.at);
        for node in &self.nodes[row.at..end] {
            let start = place.max(0.0);
            let element = &chain[node.element].request.element;
            spans.push(Span { start, element, from: node.start + (start - place), command: node.commanded });
            place += node.length;
        }
        (spans, place)
    }

    /// Places of the joints of the window up to node `end` that take a share of acceleration and jerk, and those shares.
    fn joints(&self, row: &Row, end: usize, start_speed: f64) -> Vec<(f64, f64)> {
        let mut joints = Vec::new();
        let mut add = |place: f64, node: &Node| {
            if node.entry.reserve > NO_RESERVE {
                joints.push(at_any_speed((place, node.entry.reserve)));
            }
        };
        if row.found.is_some() {
            // A step a little before the window is averaged over into it.
            let (mut place, mut index) = (-row.inside, row.at);
            while place > -RESERVED_S * start_speed && index > row.first {
                add(place, &self.nodes[index]);
                index -= 1;
                place -= self.nodes[index].length;
            }
        }
        let mut place = -row.inside;
        for (node, next) in self.nodes[row.at..end].iter().zip(&self.nodes[row.at + 1..end]) {
            place += node.length;
            add(place, next);
        }
        joints
    }

    /// Motion along a node that a course has been found for.
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
