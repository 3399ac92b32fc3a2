//! The second step of a planning: what was released in runs is planned anew for the least time when it is about to be taken.
//!
//! Where the plan of runs has no acceleration, at the ends of runs and where it is steady, its motion is divided into sections.
//! Sections at their commanded speed stay as they are. The others form rows, with smooth joints between them; at its ends, which keep
//! their places and speeds, a row has no acceleration. It is planned in windows, each of which ends where a section does, as that
//! does; the next one takes over well before, from the speed and acceleration there, so that no acceleration has to end where
//! windows meet. A window that is not found, or takes longer than what is known, is left as it is known: from the window before up
//! to its end, by the runs beyond. So a plan is never slower than the one of its runs. Where a junction at an end takes a share of
//! acceleration and jerk, the row leaves it free there, and only there.
//!
//! A window is planned when the first element on it is taken and all of it was released, over several releases where the path goes
//! on from one to the next. So it does not matter when that is, and a change of the feed override withdraws little that has cost time.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::{Planned, PlannedMotion, Planner};
use crate::junction::Junction;
use crate::speed::{AxisLimits, Course, End, Guess, Path, Span, SpeedPlanner, Window};
use crate::tolerance::{
    AT_COMMAND, AT_REST, FIRST_WINDOW_S, HANDOVER, HANDOVER_STOPS, KEPT_KNOTS, LEAST_FOUND_S, MOST_RUN_S, NO_RESERVE,
    OTHER_WINDOWS, RESERVED_S, SMOOTH_RESERVE, WINDOW_S, WORTHWHILE,
};
use crate::{Curve, ProfilePart, StretchProfile};

/// An item that was released.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Released<B> {
    pub(super) planned: Planned<B>,
    /// How its element is entered.
    pub(super) entry: Junction,
    /// Where the path rests behind it, the share that the junction there takes.
    pub(super) last: Option<f64>,
}

impl<B> Released<B> {
    pub(super) fn barrier(barrier: B) -> Self {
        Self { planned: Planned::Barrier(barrier), entry: Junction::REST, last: Some(0.0) }
    }
}

/// A plan that there is, by time.
#[derive(Clone, Debug, Default)]
pub(super) struct PartsGuess {
    /// Time and place of the start of each part.
    pub(super) parts: Vec<(f64, f64, StretchProfile)>,
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

/// A stretch that is released and not settled.
#[derive(Clone, Copy, Debug)]
struct Node {
    item: usize,
    length: f64,
    /// Arc length of its element where it starts, mm.
    start: f64,
    /// Commanded speed, mm/s.
    command: f64,
    /// Share of acceleration and jerk that the junction at its start takes.
    reserve: f64,
    /// Whether a row goes on over the junction at its start.
    is_smooth: bool,
    /// Whether it has the limits of the axes to itself.
    is_free: bool,
    part: ProfilePart,
}

/// Nodes up to the next place without acceleration.
#[derive(Clone, Copy, Debug)]
struct Section {
    /// The first of its nodes.
    first: usize,
    duration_s: f64,
    /// Whether it can be planned anew, and may gain by it.
    is_open: bool,
}

/// Stretches from the first that is not settled on.
struct Ahead<'a, B> {
    ready: &'a VecDeque<Released<B>>,
    feed_override: f64,
    item: usize,
    stretch: usize,
    nodes: Vec<Node>,
    /// What the junction takes at which the path rests, where the nodes reach to it.
    end: Option<f64>,
    /// Whether there was a wish for nodes that are not released.
    lacks_more: bool,
}

impl<B> Ahead<'_, B> {
    /// Adds the next stretch; whether the path has no acceleration at its end. `None` where the path rests, and behind all that is
    /// released.
    fn add_node(&mut self) -> Option<bool> {
        if self.end.is_some() {
            return None;
        }
        let Some(released) = self.ready.get(self.item) else {
            self.lacks_more = true;
            return None;
        };
        let Planned::Motion(motion) = &released.planned else { return None };
        let planned = motion.stretches.get(self.stretch)?;
        let StretchProfile::Phases(part) = planned.profile else { return None };
        let entry = if self.stretch == 0 { released.entry } else { Junction::NONE };
        let command = motion.commanded(&planned.stretch, self.feed_override);
        // While it is too fast, it has to brake as it does.
        let is_commanded = part.state(0.0).1 <= command * (1.0 + AT_COMMAND);
        self.nodes.push(Node {
            item: self.item,
            length: part.length(),
            start: planned.start,
            command,
            reserve: entry.reserve,
            is_smooth: entry.reserve <= SMOOTH_RESERVE && entry.acceleration > 0.0,
            is_free: motion.has_full_limits && motion.follows_override() && is_commanded,
            part,
        });
        self.stretch += 1;
        if self.stretch == motion.stretches.len() {
            self.end = released.last;
            (self.item, self.stretch) = (self.item + 1, 0);
        }
        Some(part.ends_steadily())
    }

    /// Adds the next section.
    fn add_section(&mut self) -> Option<Section> {
        let first = self.nodes.len();
        let mut ends_steadily = self.add_node()?;
        while !ends_steadily {
            match self.add_node() {
                Some(ends) => ends_steadily = ends,
                None => break,
            }
        }
        let own = &self.nodes[first..];
        let duration_s = own.iter().map(|node| node.part.duration()).sum();
        let at_command =
            own.iter().all(|node| node.part.is_steady() && node.part.state(0.0).1 >= node.command * (1.0 - AT_COMMAND));
        let is_open = ends_steadily
            && !at_command
            && own.iter().all(|node| node.is_free)
            && own[1..].iter().all(|node| node.is_smooth)
            && duration_s <= MOST_RUN_S;
        Some(Section { first, duration_s, is_open })
    }
}

/// How far what was released is settled: at most in the middle of a row, between two windows of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Row {
    /// Items that are settled.
    pub(super) settled: usize,
    /// Stretches of the next one that are.
    done: usize,
    /// What is settled of the next stretch.
    head: Option<Course>,
    /// What the last window has found from there on, and how many stretches it leads over, with that one.
    found: Option<Course>,
    known: usize,
    /// Joints that lie so little behind that they matter, and the shares they take; places from there, mm.
    passed: Vec<(f64, f64)>,
    /// Time of the last window, s.
    window_s: f64,
}

/// What is to be planned at once.
struct Task<'a, B> {
    ahead: &'a Ahead<'a, B>,
    /// Nodes of it, and the joints over them.
    count: usize,
    joints: &'a [(f64, f64)],
    /// What the junction at its end takes.
    exit_reserve: f64,
    is_last: bool,
    /// Part of what was found beyond its start in which it keeps the knots.
    kept: f64,
}

/// What came of it.
enum Outcome {
    Faster(Course),
    /// It is as fast as commanded, or as can be.
    NothingToGain,
    NotFound,
}

impl Row {
    /// Settles some more of what is ready, of which nothing is settled; whether enough of the path is released for that.
    pub(super) fn settle<B>(
        &mut self,
        ready: &mut VecDeque<Released<B>>,
        feed_override: f64,
        limits: &AxisLimits,
        speed: &mut SpeedPlanner,
    ) -> bool {
        let Some(Released { planned: Planned::Motion(_), .. }) = ready.front() else {
            self.settled = ready.len().min(1);
            return true;
        };
        let stretch = self.done;
        let mut ahead =
            Ahead { ready: &*ready, feed_override, item: 0, stretch, nodes: Vec::new(), end: None, lacks_more: false };
        let mut single = 0;
        if self.found.is_some() {
            while ahead.nodes.len() < self.known && ahead.add_node().is_some() {}
        } else {
            let section = ahead.add_section();
            single = ahead.nodes.len();
            if ahead.lacks_more {
                return false;
            }
            if !section.is_some_and(|section| section.is_open) {
                self.leave(ready, single.max(1));
                return true;
            }
        }
        let known = (ahead.nodes.len(), ahead.item, ahead.stretch, ahead.end);
        let window_s = (2.0 * self.window_s).clamp(FIRST_WINDOW_S, WINDOW_S);
        let (mut count, mut exit_reserve, mut is_last) = extend(&mut ahead, window_s);
        if ahead.lacks_more {
            return false;
        }
        let mut joints = self.joints(&ahead.nodes[..count]);
        let task = Task { ahead: &ahead, count, joints: &joints, exit_reserve, is_last, kept: KEPT_KNOTS };
        let mut outcome = self.plan(&task, limits, speed);
        // Up to another end, or on other knots, there may be a way on.
        let mut others = OTHER_WINDOWS.iter().filter(|_| self.found.is_some());
        while matches!(outcome, Outcome::NotFound)
            && let Some(&[share, kept]) = others.next()
        {
            ahead.nodes.truncate(known.0);
            (_, ahead.item, ahead.stretch, ahead.end) = known;
            (count, exit_reserve, is_last) = extend(&mut ahead, share * window_s);
            joints = self.joints(&ahead.nodes[..count]);
            outcome =
                self.plan(&Task { ahead: &ahead, count, joints: &joints, exit_reserve, is_last, kept }, limits, speed);
        }
        match outcome {
            Outcome::Faster(course) => {
                self.window_s = window_s;
                self.keep(ready, &course, count, (!is_last).then_some(joints), limits.least());
            }
            other if self.found.is_some() => {
                let joints = self.joints(&ahead.nodes[..self.known]);
                let may_find_later = matches!(other, Outcome::NotFound);
                self.go_on_with_found(ready, joints, may_find_later, limits.least());
            }
            Outcome::NotFound if count > single => match self.plan_alone(&ahead, single, limits, speed) {
                Some(course) => self.put(ready, &course, Some(single)),
                None => self.leave(ready, single),
            },
            Outcome::NothingToGain => self.leave(ready, count),
            Outcome::NotFound => self.leave(ready, single),
        }
        true
    }

    /// Goes on with what was found before, where no other window is: to its end, or to somewhat farther on it where there may be a
    /// way from there.
    fn go_on_with_found<B>(
        &mut self,
        ready: &mut VecDeque<Released<B>>,
        joints: Vec<(f64, f64)>,
        may_find_later: bool,
        least: [f64; 2],
    ) {
        let known = self.known;
        let Some(found) = self.found.take() else { return };
        if may_find_later && found.duration() > LEAST_FOUND_S {
            self.keep(ready, &found, known, Some(joints), least);
        } else {
            self.put(ready, &found, Some(known));
        }
    }

    /// A course over the first section alone, which is `count` stretches, where it is faster.
    fn plan_alone<B>(
        &self,
        ahead: &Ahead<'_, B>,
        count: usize,
        limits: &AxisLimits,
        speed: &mut SpeedPlanner,
    ) -> Option<Course> {
        let exit_reserve = ahead.nodes[count].reserve;
        let joints = self.joints(&ahead.nodes[..count]);
        let task = Task { ahead, count, joints: &joints, exit_reserve, is_last: true, kept: KEPT_KNOTS };
        match self.plan(&task, limits, speed) {
            Outcome::Faster(course) => Some(course),
            _ => None,
        }
    }

    /// Settles what a window over `count` stretches has found: all of the last one, of others, which have joints, up to where the
    /// next one takes over, by the smallest acceleration and jerk of an axis.
    fn keep<B>(
        &mut self,
        ready: &mut VecDeque<Released<B>>,
        course: &Course,
        count: usize,
        joints: Option<Vec<(f64, f64)>>,
        least: [f64; 2],
    ) {
        self.found = None;
        let Some(joints) = joints else { return self.put(ready, course, Some(count)) };
        let kept = course.handover(HANDOVER, HANDOVER_STOPS, least);
        let found = course.between(kept, course.length());
        let reach = RESERVED_S * found.state(0.0).1;
        self.passed = joints.into_iter().map(|(place, reserve)| (place - kept, reserve)).collect();
        // A step a little before a window is averaged over into it.
        self.passed.retain(|&(place, _)| place <= 0.0 && place > -reach);
        self.found = Some(found);
        self.known = count;
        self.put(ready, &course.between(0.0, kept), None);
    }

    /// Makes a course the motion of what it leads over; all of it where it ends behind that many stretches.
    fn put<B>(&mut self, ready: &mut VecDeque<Released<B>>, course: &Course, count: Option<usize>) {
        let whole = match self.head.take() {
            Some(head) => Course::joined(&[head, course.clone()]),
            None => course.clone(),
        };
        let (mut offset, mut settled) = (0.0, 0);
        while let Some(Planned::Motion(motion)) = ready.get_mut(self.settled).map(|released| &mut released.planned) {
            let Some(planned) = motion.stretches.get_mut(self.done) else { break };
            let mut end = offset + planned.profile.length();
            match count {
                Some(count) if settled == count => break,
                Some(count) if settled + 1 == count => end = whole.length(),
                None if end > whole.length() => break,
                _ => {}
            }
            planned.profile = StretchProfile::Course(whole.between(offset, end));
            offset = end;
            settled += 1;
            self.done += 1;
            if self.done == motion.stretches.len() {
                (self.settled, self.done) = (self.settled + 1, 0);
            }
        }
        self.known = self.known.saturating_sub(settled);
        if count.is_some() {
            (self.found, self.known) = (None, 0);
            self.passed.clear();
        } else if offset < whole.length() {
            self.head = Some(whole.between(offset, whole.length()));
        }
    }

    /// Leaves the motion of the next stretches as it is.
    fn leave<B>(&mut self, ready: &VecDeque<Released<B>>, count: usize) {
        for _ in 0..count {
            let Some(Planned::Motion(motion)) = ready.get(self.settled).map(|released| &released.planned) else {
                return;
            };
            self.done += 1;
            if self.done >= motion.stretches.len() {
                (self.settled, self.done) = (self.settled + 1, 0);
            }
        }
    }

    /// How much of the first node lies before the window, mm.
    fn inside(&self) -> f64 {
        self.head.as_ref().map_or(0.0, Course::length)
    }

    /// A course that is faster than what is known.
    fn plan<B>(&self, task: &Task<'_, B>, limits: &AxisLimits, speed: &mut SpeedPlanner) -> Outcome {
        let nodes = &task.ahead.nodes[..task.count];
        let mut guess = PartsGuess::default();
        let mut known = 0;
        if let Some(found) = &self.found {
            guess.push(StretchProfile::Course(found.clone()));
            known = self.known;
        }
        for node in &nodes[known..] {
            guess.push(StretchProfile::Phases(node.part));
        }
        let (start_speed, start_acceleration) =
            self.found.as_ref().map_or((guess.at(0.0).1, 0.0), |found| (found.state(0.0).1, found.state(0.0).2));
        let mut place = -self.inside();
        let mut spans = Vec::with_capacity(nodes.len());
        for node in nodes {
            let start = place.max(0.0);
            let Planned::Motion(PlannedMotion { element, .. }) = &task.ahead.ready[node.item].planned else {
                return Outcome::NotFound;
            };
            spans.push(Span { start, element, from: node.start + (start - place), command: node.command });
            place += node.length;
        }
        let length = place;
        let entry_reserve = if self.found.is_some() { 0.0 } else { nodes[0].reserve };
        let is_one_run =
            self.found.is_none() && nodes.windows(2).all(|pair| pair[0].part.whole() == pair[1].part.whole());
        // The phases of a straight move are the least time already.
        let is_straight = || spans.iter().all(|span| matches!(span.element.curve, Curve::Line));
        let is_least = is_one_run && [entry_reserve, task.exit_reserve] == [0.0; 2] && is_straight();
        let ends = spans.iter().skip(1).map(|span| span.start).chain([length]);
        let shortest_s: f64 = spans.iter().zip(ends).map(|(span, end)| (end - span.start) / span.command).sum();
        if is_least || guess.duration_s <= shortest_s * WORTHWHILE {
            return Outcome::NothingToGain;
        }
        let at_rest = |speed: f64| if speed > AT_REST { speed } else { 0.0 };
        let path = Path::new(&spans, length, limits).with_joints(task.joints);
        let jerk = limits.largest_jerk();
        let ends = [
            End::reserving(at_rest(start_speed), start_acceleration, entry_reserve, jerk),
            End::reserving(at_rest(guess.end_speed()), 0.0, task.exit_reserve, jerk),
        ];
        let knots = self.found.as_ref().map_or_else(Vec::new, |found| found.knots(task.kept));
        let window = Window { knots: &knots, is_possible: true, goes_on: !task.is_last };
        match speed.plan_window(&path, ends, &guess, window) {
            Some(course) if course.duration() < guess.duration_s => Outcome::Faster(course),
            _ => Outcome::NotFound,
        }
    }

    /// Places of the joints of a window over these nodes that take a share of acceleration and jerk, and those shares.
    fn joints(&self, nodes: &[Node]) -> Vec<(f64, f64)> {
        let mut place = -self.inside();
        let mut joints = self.passed.clone();
        for (index, node) in nodes.iter().enumerate() {
            // What is at the start of a row is left to its end; what is behind the start of a window is known.
            if index > 0 && node.reserve > NO_RESERVE {
                joints.push(at_any_speed((place, node.reserve)));
            }
            place += node.length;
        }
        joints
    }
}

/// Adds sections that go on from what is ahead, of about this time; how many nodes there are then, what the junction behind them
/// takes, and whether the row ends there.
fn extend<B>(ahead: &mut Ahead<'_, B>, window_s: f64) -> (usize, f64, bool) {
    let mut time_s: f64 = 0.0;
    loop {
        let count = ahead.nodes.len();
        if let Some(reserve) = ahead.end {
            return (count, reserve, true);
        }
        let Some(section) = ahead.add_section() else { return (count, 0.0, true) };
        let Node { reserve, is_smooth, .. } = ahead.nodes[section.first];
        if !section.is_open || !is_smooth {
            return (count, reserve, true);
        }
        if time_s >= window_s {
            return (count, reserve, false);
        }
        time_s += section.duration_s;
    }
}

impl<B> Planner<B> {
    /// Has the first of what is ready settled, if enough is ready.
    pub(super) fn settle_first(&mut self) {
        let Some(limits) = &self.settings.limits else { return };
        let (ready, scratch) = (&mut self.ready, &mut self.scratch);
        while self.row.settled == 0 && !ready.is_empty() && !scratch.lacks_more {
            scratch.lacks_more = !self.row.settle(ready, self.feed_override, limits, &mut scratch.speed);
        }
    }
}
