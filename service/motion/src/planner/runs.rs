//! One planning of a chain: stretches gathered into runs, speeds where runs meet, profiles.
//!
//! A run is a sequence of stretches under one set of limits, the strictest of each: within it acceleration carries on
//! over the ends of blocks, and where two runs meet there is none. Gathering costs time where limits differ, dividing
//! costs time because acceleration has to end; a stretch joins the run before it while the first is the smaller loss.

use crate::junction::Junction;
use crate::profile::{change_length, highest_entry, reachable_exit, reachable_speed};
use crate::speed::SpeedPlanner;
use crate::tolerance::{SAME_COMMAND, SOLVER_SLACK};
use crate::{MotionRequest, PathLimits, PlannedStretch, Profile, ProfilePart, Stretch, StretchProfile};
use serde::{Deserialize, Serialize};
use smallvec::SmallVec;

/// One stretch of the chain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Index of its element in the chain.
    pub(super) element: usize,
    pub(super) length: f64,
    /// Limits that the junctions leave; the velocity is the commanded one where that is lower.
    limits: PathLimits,
    /// Largest velocity whatever is commanded, mm/s.
    hard_velocity: f64,
    /// Commanded velocity at 100 % override, mm/s, and what of it the limits leave.
    command: f64,
    target_velocity: f64,
    /// Commanded velocity at the present override, mm/s.
    commanded: f64,
    follows_override: bool,
    pub(super) entry: Junction,
    /// Whether it may join the run before it. Where the next junction is not known, limits leave it the largest share that there is,
    /// which a run would lose as a whole.
    pub(super) joins: bool,
    /// Path position in its run, mm.
    pub(super) offset: f64,
    pub(super) run: usize,
}

impl Node {
    /// The stretch from arc length `start` on; `left` is the share of acceleration and jerk that junctions leave.
    pub(super) fn new(
        element: usize,
        stretch: &Stretch,
        start: f64,
        left: f64,
        entry: Junction,
        request: &MotionRequest,
        feed_override: f64,
    ) -> Self {
        let hard_velocity = stretch.limits.velocity;
        let commanded = request.commanded(stretch, feed_override);
        Self {
            element,
            length: stretch.end - start,
            limits: PathLimits {
                velocity: hard_velocity.min(commanded),
                acceleration: left * stretch.limits.acceleration,
                jerk: left * stretch.limits.jerk,
            },
            hard_velocity,
            command: stretch.speed_mm_per_s,
            target_velocity: hard_velocity.min(stretch.speed_mm_per_s),
            commanded,
            follows_override: request.follows_override,
            entry,
            joins: true,
            offset: 0.0,
            run: 0,
        }
    }
}

/// Stretches under one set of limits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Run {
    pub(super) first: usize,
    pub(super) count: usize,
    pub(super) length: f64,
    /// Length of what of it was released, mm.
    released_mm: f64,
    limits: PathLimits,
    hard_velocity: f64,
    target_velocity: f64,
    /// Time at every stretch's own target velocity, with what was released, s.
    ideal_s: f64,
    /// Largest of each limit among the stretches.
    best: PathLimits,
    command: f64,
    /// The lowest commanded velocity at the present override, mm/s.
    commanded: f64,
    follows_override: bool,
    /// Highest speed of the junction at its start, mm/s.
    junction_speed: f64,
    /// Speed at its start, mm/s.
    pub(super) entry: f64,
    /// Highest speed at its start from which the path ahead can be run, mm/s; found by every planning.
    #[serde(skip)]
    highest: f64,
    /// Highest speed at its start from which that of the next one is reached, mm/s: from a little more the path can stop, and only stop.
    pub(super) passing: f64,
    profile: Option<Profile>,
}

impl Run {
    fn of(index: usize, node: &Node) -> Self {
        Self {
            first: index,
            count: 1,
            length: node.length,
            released_mm: 0.0,
            limits: node.limits,
            hard_velocity: node.hard_velocity,
            target_velocity: node.target_velocity,
            ideal_s: node.length / node.target_velocity,
            best: node.limits,
            command: node.command,
            commanded: node.commanded,
            follows_override: node.follows_override,
            junction_speed: node.entry.speed,
            entry: 0.0,
            highest: 0.0,
            passing: 0.0,
            profile: None,
        }
    }

    /// The run with the next stretch.
    fn with(&self, node: &Node) -> Self {
        let Junction { speed: junction, acceleration, .. } = node.entry;
        let (a, b) = (&self.limits, &node.limits);
        Self {
            count: self.count + 1,
            length: self.length + node.length,
            limits: PathLimits {
                velocity: a.velocity.min(b.velocity).min(junction),
                acceleration: a.acceleration.min(b.acceleration).min(acceleration),
                jerk: a.jerk.min(b.jerk),
            },
            hard_velocity: self.hard_velocity.min(node.hard_velocity).min(junction),
            target_velocity: self.target_velocity.min(node.target_velocity).min(junction),
            ideal_s: self.ideal_s + node.length / node.target_velocity,
            commanded: self.commanded.min(node.commanded),
            best: PathLimits {
                velocity: self.best.velocity,
                acceleration: self.best.acceleration.max(b.acceleration),
                jerk: self.best.jerk.max(b.jerk),
            },
            ..*self
        }
    }

    /// Whether the next stretch joins this run; then the run with it.
    fn joined_by(&self, node: &Node) -> Option<Self> {
        if !node.joins || node.entry.acceleration == 0.0 || self.follows_override != node.follows_override {
            return None;
        }
        // A programmed change of feed takes place where it is programmed.
        let commands = [self.command.min(node.command), self.command.max(node.command)];
        let fastest = self.hard_velocity.max(node.hard_velocity);
        if commands[0] < commands[1] * (1.0 - SAME_COMMAND) && commands[0] < fastest {
            return None;
        }
        let joined = self.with(node);
        let PathLimits { acceleration, jerk, .. } = joined.limits;
        let velocity = joined.target_velocity;
        let traverse_s = (joined.released_mm + joined.length) / velocity;
        let (ramp_s, best_ramp_s) = (acceleration / jerk, joined.best.acceleration / joined.best.jerk);
        let slower_change_s =
            velocity / acceleration - velocity / joined.best.acceleration + (ramp_s - best_ramp_s).max(0.0);
        let slower_travel_s = traverse_s - joined.ideal_s - SOLVER_SLACK * traverse_s;
        if slower_travel_s + slower_change_s.min(traverse_s) > ramp_s {
            return None;
        }
        // Where it cruises, a lower speed is reached at the price of a small change of speed.
        let cruising_mm = velocity * (velocity / acceleration + ramp_s);
        let step = self.target_velocity.max(node.target_velocity) - velocity;
        let divides = (self.released_mm + self.length).max(node.length) >= cruising_mm
            && slower_travel_s > 2.0 * step * (step / jerk).sqrt() / velocity;
        (!divides).then_some(joined)
    }

    /// The same after all of it was released.
    fn released(self) -> Self {
        Self { count: 0, length: 0.0, released_mm: self.released_mm + self.length, ..self }
    }

    /// Length in which it stops from the highest speed of its limits, mm.
    pub(super) fn stop_mm(&self) -> f64 {
        change_length(self.limits.velocity, 0.0, &self.limits)
    }

    /// Highest speed of its limits, mm/s.
    pub(super) const fn velocity(&self) -> f64 {
        self.limits.velocity
    }

    /// Highest speed of its limits whatever is commanded, mm/s.
    pub(super) const fn hard_velocity(&self) -> f64 {
        self.hard_velocity
    }

    /// The limits with the largest velocity whatever is commanded.
    fn hard_limits(&self) -> PathLimits {
        PathLimits { velocity: self.hard_velocity, ..self.limits }
    }

    /// The fastest profile to the speed `exit`.
    fn solve(&self, exit: f64) -> Profile {
        let Self { length, entry, limits, .. } = *self;
        if entry <= limits.velocity {
            let profile = Profile::solve(length, entry, exit, limits);
            debug_assert!(profile.is_some(), "the passes leave room for every change of speed");
            return profile.unwrap_or_else(|| Profile::with_cruise(length, entry, entry.max(exit), exit, &limits));
        }
        let change = change_length(entry, exit, &limits);
        debug_assert!(change <= length * (1.0 + SOLVER_SLACK), "the passes leave room to brake");
        // Faster than commanded: down to the command at once, where the length permits it.
        let command = limits.velocity.max(exit);
        let needed = change_length(entry, command, &limits) + change_length(command, exit, &limits);
        let cruise = if needed <= length {
            command
        } else if exit > 0.0 {
            exit
        } else {
            entry
        };
        Profile::with_cruise(length, entry, cruise, exit, &limits)
    }
}

/// Where the path comes to rest because no speed is commanded.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    /// The stretch in which it stops.
    pub(super) node: usize,
    /// Path position in that stretch, mm.
    pub(super) s: f64,
}

/// A plan of a chain; kept between plannings so that they allocate nothing.
#[derive(Debug, Default)]
pub(super) struct Plan {
    pub(super) nodes: Vec<Node>,
    pub(super) runs: Vec<Run>,
    pub(super) stop: Option<Stop>,
    /// Whether it is entered faster than its commands permit.
    pub(super) is_overspeed: bool,
    pub(super) speed: SpeedPlanner,
    /// Whether what is released was found to be too little to settle more of it.
    pub(super) lacks_more: bool,
}

impl Clone for Plan {
    /// It is no state.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for Plan {
    /// It is no state.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Plan {
    /// Gathers the nodes into runs. The first node goes on with the run that has begun, if it joins that, or else the first runs
    /// have the given numbers of nodes.
    pub(super) fn gather(&mut self, begun: Option<&Run>, given: &[usize]) {
        self.runs.clear();
        let mut given = given.iter().copied();
        // Nodes that still belong to a given run.
        let mut due = 0;
        let mut was_given = false;
        for index in 0..self.nodes.len() {
            let node = self.nodes[index];
            let joined = match self.runs.last() {
                None => begun.and_then(|begun| begun.joined_by(&node)),
                Some(run) if due > 0 => Some(run.with(&node)),
                Some(run) if !was_given => run.joined_by(&node),
                _ => None,
            };
            match (joined, self.runs.last_mut()) {
                (Some(joined), Some(run)) => {
                    *run = joined;
                    due -= usize::from(due > 0);
                }
                (Some(joined), None) => self.runs.push(joined),
                _ => {
                    self.runs.push(Run::of(index, &node));
                    let count = given.next();
                    due = count.map_or(0, |count| count.saturating_sub(1));
                    was_given = count.is_some();
                }
            }
            let run = self.runs.len() - 1;
            let offset = self.runs[run].length - node.length;
            self.nodes[index].run = run;
            self.nodes[index].offset = offset;
        }
    }

    /// The run that goes on at this node after what is before it was released, where one does: gathered anew from there, the path
    /// would have other runs, which can be slower.
    pub(super) fn begun_at(&self, node: usize, begun: Option<&Run>) -> Option<Run> {
        let run = self.runs.get(self.nodes.get(node)?.run)?;
        let (start, others) = self.nodes[run.first..node].split_first()?;
        let first = match begun.filter(|_| run.released_mm > 0.0) {
            Some(begun) => begun.with(start),
            None => Run::of(0, start),
        };
        Some(others.iter().fold(first, |run, node| run.with(node)).released())
    }

    /// Finds the speeds between the runs, from `entry_speed` to rest; whether there are any.
    pub(super) fn solve(&mut self, entry_speed: f64) -> bool {
        self.stop = None;
        let velocity = |run: &Run| run.limits.velocity;
        self.backward(velocity);
        let Some(first) = self.runs.first() else { return true };
        let is_overspeed = entry_speed > first.entry * (1.0 + SOLVER_SLACK);
        self.is_overspeed = is_overspeed;
        if is_overspeed {
            self.backward(|run| run.hard_velocity);
            if entry_speed > self.runs[0].entry * (1.0 + SOLVER_SLACK) {
                return false;
            }
        }
        for run in &mut self.runs {
            run.highest = run.entry;
        }
        if is_overspeed {
            // Lower speeds than the highest possible ones are possible too, and are what is commanded.
            self.backward(velocity);
        }
        // There is room for the highest speed to the bit only: what rounding has brought above it would grow from run to run.
        self.runs[0].entry = entry_speed.min(self.runs[0].highest);
        for index in 0..self.runs.len() {
            let run = self.runs[index];
            if run.limits.velocity <= 0.0 {
                let braking_mm = change_length(run.entry, 0.0, &run.limits);
                if braking_mm <= run.length {
                    self.runs[index].profile =
                        Some(Profile::with_cruise(braking_mm, run.entry, run.entry, 0.0, &run.limits));
                    self.stop = Some(self.stop_at(index, braking_mm));
                    return true;
                }
            }
            if let Some(next) = self.runs.get_mut(index + 1) {
                // What is a little faster before a place may have to stop there, which takes far longer.
                let passes = run.entry <= next.passing
                    || change_length(run.entry, next.passing, &run.limits) <= run.length * (1.0 + SOLVER_SLACK);
                let wanted = if passes { next.passing } else { next.entry };
                let exit = reachable_exit(run.entry, wanted, run.length, &run.limits);
                next.entry = exit.min(next.highest);
            }
        }
        true
    }

    /// The highest of these speeds, lowest and highest, from which the path can be run as commanded, or else the lowest where it can
    /// be run from that.
    pub(super) fn entry_within(&mut self, [least, most]: [f64; 2]) -> Option<f64> {
        self.backward(|run| run.limits.velocity);
        let highest = self.runs.first()?.entry;
        if highest >= least {
            return Some(highest.min(most));
        }
        self.backward(|run| run.hard_velocity);
        (self.runs[0].entry >= least).then_some(least)
    }

    /// Highest speeds at the starts of the runs from which the path can rest at its end, at no more than `velocity` in
    /// every run.
    fn backward(&mut self, velocity: impl Fn(&Run) -> f64) {
        self.backward_from(self.runs.len(), 0.0, velocity);
    }

    /// [`Plan::backward`] for the first `count` runs, with another speed than rest at their end.
    pub(super) fn backward_from(&mut self, count: usize, end_speed: f64, velocity: impl Fn(&Run) -> f64) {
        let (mut exit, mut passing) = (end_speed, end_speed);
        for index in (0..count).rev() {
            let run = &self.runs[index];
            let mut cap = velocity(run);
            if index > 0 {
                cap = cap.min(run.junction_speed).min(velocity(&self.runs[index - 1]));
            }
            exit = highest_entry(exit, cap, run.length, &run.hard_limits());
            passing = reachable_speed(passing, cap, run.length, &run.hard_limits()).min(cap);
            self.runs[index].entry = exit;
            self.runs[index].passing = passing;
        }
    }

    fn stop_at(&self, run: usize, s: f64) -> Stop {
        let Run { first, count, .. } = self.runs[run];
        let nodes = &self.nodes[first..first + count];
        let within = nodes.partition_point(|node| node.offset <= s).max(1) - 1;
        Stop { node: first + within, s: (s - nodes[within].offset).clamp(0.0, nodes[within].length) }
    }

    /// Element of a node.
    pub(super) fn element(&self, node: usize) -> usize {
        self.nodes[node].element
    }

    pub(super) fn profile(&mut self, run: usize) -> Profile {
        if let Some(profile) = self.runs[run].profile {
            return profile;
        }
        let exit = self.runs.get(run + 1).map_or(0.0, |next| next.entry);
        let profile = self.runs[run].solve(exit);
        self.runs[run].profile = Some(profile);
        profile
    }

    /// Whether a node is the first of an element, and not of all.
    pub(super) fn starts_element(&self, node: usize) -> bool {
        node > 0 && self.nodes[node].element != self.nodes[node - 1].element
    }

    /// The first node of an element.
    pub(super) fn first_node_of(&self, element: usize) -> usize {
        self.nodes.partition_point(|node| node.element < element)
    }

    /// The stretches of a request, whose first one is node `first`, with their profiles; the last of them ends `stop` mm
    /// from its start, where that is given.
    pub(super) fn planned(
        &mut self,
        request: &MotionRequest,
        first: usize,
        stop: Option<f64>,
    ) -> SmallVec<[PlannedStretch; 1]> {
        let mut start = request.start;
        let mut planned = SmallVec::with_capacity(request.stretches.len());
        for (index, stretch) in request.stretches.iter().enumerate() {
            let node = first + index;
            let Node { run, offset, .. } = self.nodes[node];
            let Run { first: run_first, count, .. } = self.runs[run];
            let profile = self.profile(run);
            let is_last = node + 1 == run_first + count;
            let mut end = if is_last { profile.length() } else { self.nodes[node + 1].offset };
            if let Some(stop) = stop.filter(|_| index + 1 == request.stretches.len()) {
                end = (offset + stop).min(profile.length());
            }
            let profile = StretchProfile::Phases(ProfilePart::new(profile, offset, end));
            planned.push(PlannedStretch { start, stretch: *stretch, profile });
            start = stretch.end;
        }
        planned
    }

    /// Numbers of nodes of the runs from this node on.
    pub(super) fn run_lengths(&self, node: usize) -> Vec<usize> {
        let Some(&Node { run, .. }) = self.nodes.get(node) else { return Vec::new() };
        let left = |run: &Run| run.first + run.count - run.first.max(node);
        self.runs[run..].iter().map(left).collect()
    }

    /// Where to divide the chain so that its first part can be released: the number of elements, near `wanted`, and the
    /// speed there, at which it has no acceleration. `None` where all of it brakes.
    pub(super) fn cut(&mut self, wanted: usize) -> Option<(usize, f64)> {
        let node = self.first_node_of(wanted);
        let run = self.nodes.get(node)?.run;
        let Run { first, count, length, entry, limits, .. } = self.runs[run];
        if node == first {
            return Some((wanted, entry));
        }
        let profile = self.profile(run);
        let [from, to] = profile.cruise();
        let starts_element = |index: usize| self.starts_element(index);
        let inside = || (first + 1..first + count).filter(|&index| starts_element(index));
        let cruising = inside().filter(|&index| (from..=to).contains(&self.nodes[index].offset));
        if let Some(index) = cruising.min_by_key(|&index| index.abs_diff(node))
            && profile.cruise_velocity() > 0.0
        {
            return Some((self.nodes[index].element, profile.cruise_velocity()));
        }
        // Cruise a little lower than the peak, so that the cruise reaches an element's end.
        let exit = profile.end_velocity();
        if entry <= limits.velocity {
            let before = inside().rfind(|&index| self.nodes[index].offset <= from);
            let after = inside().find(|&index| self.nodes[index].offset > from);
            let cruise_at = |index: usize| {
                let s = self.nodes[index].offset;
                let up = reachable_speed(entry, limits.velocity, s, &limits);
                let down = reachable_speed(exit, limits.velocity, length - s, &limits);
                (index, up.min(down))
            };
            let best = before.into_iter().chain(after).map(cruise_at).max_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((index, cruise)) = best.filter(|&(_, cruise)| cruise > 0.0 && cruise >= entry.max(exit)) {
                self.runs[run].profile = Some(Profile::with_cruise(length, entry, cruise, exit, &limits));
                return Some((self.nodes[index].element, cruise));
            }
        }
        // Ends of the run itself: the later one, unless that is the end of all that is known.
        let end = first + count;
        if end < self.nodes.len() && starts_element(end) {
            return Some((self.nodes[end].element, exit));
        }
        starts_element(first).then(|| (self.nodes[first].element, entry))
    }
}
