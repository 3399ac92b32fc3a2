//! The feed planner: bounded look-ahead over the path, and a jerk-limited profile for all of it.
//!
//! Elements arrive in order. Where two of them cannot be passed at speed, and at every barrier, the path rests; what
//! lies between two rests is a chain. A chain is planned when its end is known or when the window is full, by elements or by the
//! memory that they take: then the path is assumed to rest at the window's end, which is always safe, and about the first half
//! of the window is released. The first time it is planned earlier, as soon as a second of it no longer depends on what
//! follows ([`start`]). All planning follows from what was pushed so far and from changes of the feed override, so the result does not
//! depend on when it is taken out.
//!
//! Planning in runs has two steps. First neighbouring stretches are gathered into runs ([`runs`]) that share one set of limits,
//! so that acceleration carries on from one short block into the next. Then a backward and a forward pass over the
//! ends of the runs, where there is no acceleration, give the speeds there, and each run one [`Profile`].
//!
//! A feed override scales the commanded speeds. When it changes, what has not been run is planned again from the present speed
//! ([`restart`]); that speed may then be too high for the new commands, and the first runs brake.

mod behind;
mod braking;
mod change;
mod cruise;
mod reach;
mod refine;
mod request;
mod restart;
mod runs;
mod start;

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::junction::{Junction, JunctionRules};
use crate::speed::AxisLimits;
use crate::tolerance::{FIRST_PLAN, LARGEST_RESERVE, LEAST_START, WINDOW_BYTES};
use crate::{Machine, Stretch};

use behind::Behind;
use reach::WithinReach;
pub use reach::{MOST_BYTES_WITHIN_REACH, MOST_WITHIN_REACH, TooManyWithinReach};
use refine::{Released, Row};
pub use request::{Ahead, MotionRequest, PathItem, Planned, PlannedMotion, PlannedStretch};
use runs::{Node, Plan, Run, Stop};

/// Settings of a planner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannerSettings {
    /// Elements looked ahead.
    window: usize,
    /// Memory that they take at the most, bytes.
    window_bytes: usize,
    junctions: JunctionRules,
    /// Limits of the axes where the speed is planned for the least time.
    limits: Option<AxisLimits>,
}

impl PlannerSettings {
    /// Settings for a machine and an interpolation period: steps of velocity and acceleration at junctions happen
    /// within one period, and the axes must follow them within their limits.
    #[must_use]
    pub fn new(machine: &Machine, window: usize, period_s: f64) -> Self {
        Self {
            window: window.max(4),
            window_bytes: WINDOW_BYTES,
            junctions: JunctionRules::new(machine, period_s),
            limits: None,
        }
    }

    /// Bounds the memory that the window takes, by [`MotionRequest::bytes`], whatever its elements are; twice as much where all of it
    /// brakes, so that there is no place to divide it. Several elements have to fit.
    #[must_use]
    pub const fn with_window_bytes(mut self, bytes: usize) -> Self {
        self.window_bytes = bytes;
        self
    }

    /// Plans close to the least time, with the limits of the axes place by place, instead of runs under one set of limits.
    #[must_use]
    pub fn for_least_time(mut self, machine: &Machine) -> Self {
        self.limits = Some(AxisLimits::new(machine));
        self
    }
}

/// The present speed is too high to plan anew from: the plan so far has to go on until it is slower.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the speed at the start is too high for the path ahead")]
pub struct TooFast;

/// An element waiting to be planned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Waiting {
    request: MotionRequest,
    /// How it is entered; at rest where the chain starts.
    entry: Junction,
}

/// Plans a path in one pass. Its state can be stored between any two calls and continues bit for bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Planner<B> {
    settings: PlannerSettings,
    /// Ratio of the speeds to the commanded ones.
    feed_override: f64,
    /// What the chain does not have yet, since the limits within reach are not known. A restart leaves it.
    within_reach: WithinReach,
    /// The present chain, as far as it is not released.
    chain: VecDeque<Waiting>,
    /// Speed at the chain's start, mm/s; without acceleration.
    entry_speed: f64,
    /// Fastest that the chain may be run until it has slowed down to its commanded speeds, mm/s.
    overspeed: f64,
    /// The run that the chain goes on with, where a part of that was released.
    begun: Option<Run>,
    /// Stretches per run of what was planned and not released, in order.
    runs_before: Vec<usize>,
    /// Chain length at which it is planned next.
    next_plan: usize,
    /// Memory that the chain takes, and with which it is planned next, bytes.
    chain_bytes: usize,
    next_plan_bytes: usize,
    /// Chain length at which a start is tried next; none is once the first part of a chain was released, unless it was planned again.
    next_start: Option<usize>,
    /// Whether the path was planned again: it is then released in short parts, for the next time.
    was_changed: bool,
    /// What is to be planned behind the chain, before anything that is pushed.
    behind: Behind<B>,
    /// Whether the path rests at the end of what is ready because no speed is commanded behind it.
    is_held: bool,
    /// Whether nothing follows what was pushed.
    finished: bool,
    /// Whether a restart has turned out to be impossible.
    too_fast: bool,
    ready: VecDeque<Released<B>>,
    /// What of it is settled, where it is planned for the least time.
    row: Row,
    /// Where a restart is free to choose the speed at the chain's start: lowest and highest, mm/s.
    #[serde(skip)]
    free_entry: Option<[f64; 2]>,
    #[serde(skip)]
    scratch: Plan,
}

impl<B> Planner<B> {
    /// A planner at rest, at 100 % feed override.
    #[must_use]
    pub fn new(settings: PlannerSettings) -> Self {
        Self {
            feed_override: 1.0,
            within_reach: WithinReach::default(),
            chain: VecDeque::new(),
            entry_speed: 0.0,
            overspeed: 0.0,
            begun: None,
            runs_before: Vec::new(),
            next_plan: settings.window.min(FIRST_PLAN),
            chain_bytes: 0,
            next_plan_bytes: settings.window_bytes,
            next_start: Some(LEAST_START),
            was_changed: false,
            behind: Behind::default(),
            is_held: false,
            finished: false,
            too_fast: false,
            ready: VecDeque::new(),
            row: Row::default(),
            free_entry: None,
            scratch: Plan::default(),
            settings,
        }
    }

    /// The feed override, as a ratio; 0 is feed hold.
    #[must_use]
    pub const fn feed_override(&self) -> f64 {
        self.feed_override
    }

    /// Whether the path is at rest, or will be, at a place where no speed is commanded.
    #[must_use]
    pub const fn is_held(&self) -> bool {
        self.is_held
    }

    /// Adds the next element. Says so where more is within reach of the first that waits than may wait: all that waits is then
    /// planned without what follows, and may exceed limits.
    pub fn push_motion(&mut self, request: MotionRequest) -> Option<TooManyWithinReach> {
        if request.reach_mm == 0.0 {
            self.plan_all_within_reach();
            self.add(PathItem::Motion(request));
            return None;
        }
        let too_many = self.within_reach.push(request);
        if too_many.is_some() {
            self.plan_all_within_reach();
        }
        while let Some(known) = self.within_reach.pop() {
            self.add(PathItem::Motion(known));
        }
        too_many
    }

    /// Plans what comes next, or leaves it behind what is to be planned before.
    fn add(&mut self, item: PathItem<B>) {
        if self.is_held || !self.behind.is_empty() { self.behind.push_back(item) } else { self.plan_item(item) }
    }

    fn plan_item(&mut self, item: PathItem<B>) {
        match item {
            PathItem::Motion(request) => self.plan_motion(request),
            PathItem::Barrier(barrier) => self.plan_barrier(barrier),
        }
    }

    /// Nothing that follows is within reach of what waits.
    fn plan_all_within_reach(&mut self) {
        for (_, request) in self.within_reach.take() {
            self.add(PathItem::Motion(request));
        }
    }

    fn plan_motion(&mut self, request: MotionRequest) {
        let top_speed = |stretch: &Stretch, request: &MotionRequest| {
            stretch.limits.velocity.min(request.commanded(stretch, self.feed_override).max(self.overspeed))
        };
        let before = self.chain.back().filter(|before| !before.request.rest_at_end);
        let junction = before.and_then(|Waiting { request: before, .. }| {
            let (from, to) = (before.stretches.last()?, request.stretches.first()?);
            let top_speed = top_speed(from, before).min(top_speed(to, &request));
            let acceleration = from.limits.acceleration.min(to.limits.acceleration);
            let passes_corners = before.passes_corners && request.passes_corners;
            let rules = &self.settings.junctions;
            rules.junction(&before.element, &request.element, top_speed, acceleration, passes_corners)
        });
        if junction.is_none() {
            self.release_chain();
        }
        if self.is_held {
            return self.behind.push_front(PathItem::Motion(request));
        }
        let passed_reserve = if self.entry_speed > 0.0 { request.entry_reserve } else { 0.0 };
        let entry = junction.unwrap_or(Junction { reserve: passed_reserve, ..Junction::REST });
        self.chain_bytes += request.bytes();
        self.chain.push_back(Waiting { request, entry });
        if self.chain.len() >= self.next_plan || self.chain_bytes >= self.next_plan_bytes {
            self.release_window();
        } else if self.next_start.is_some_and(|count| self.chain.len() >= count) {
            self.start();
        }
    }

    /// Memory that the part of the path takes that waits for more to be known, bytes ([`MotionRequest::bytes`]).
    #[must_use]
    pub const fn window_bytes(&self) -> usize {
        self.chain_bytes
    }

    /// Counts anew what the chain takes, after a part of it has gone.
    fn count_bytes(&mut self) {
        self.chain_bytes = self.chain.iter().map(|waiting| waiting.request.bytes()).sum();
    }

    /// Adds a barrier; the path rests there.
    pub fn push_barrier(&mut self, barrier: B) {
        self.plan_all_within_reach();
        self.add(PathItem::Barrier(barrier));
    }

    fn plan_barrier(&mut self, barrier: B) {
        self.release_chain();
        if self.is_held {
            return self.behind.push_front(PathItem::Barrier(barrier));
        }
        self.scratch.lacks_more = false;
        self.ready.push_back(Released::barrier(barrier));
    }

    /// Says that nothing follows.
    pub fn finish(&mut self) {
        self.plan_all_within_reach();
        self.finished = true;
        if self.behind.is_empty() {
            self.release_chain();
        }
    }

    /// Takes the next planned item; `None` until more is pushed or the path is finished.
    pub fn pop(&mut self) -> Option<Planned<B>> {
        loop {
            if let Some(planned) = self.pop_ready() {
                return Some(planned);
            }
            if !self.plan_more() {
                return None;
            }
        }
    }

    fn pop_ready(&mut self) -> Option<Planned<B>> {
        if self.settings.limits.is_some() {
            self.settle_first();
            self.row.settled = self.row.settled.checked_sub(1)?;
        }
        self.ready.pop_front().map(|released| released.planned)
    }

    /// Plans the next of what is to be planned behind the chain; whether there was something.
    fn plan_more(&mut self) -> bool {
        if self.is_held {
            return false;
        }
        if let Some(item) = self.behind.pop_front() {
            self.plan_item(item);
            return true;
        }
        let ends_here = self.finished && !self.chain.is_empty();
        if ends_here {
            self.release_chain();
        }
        ends_here
    }

    /// What was pushed and is not planned, in order.
    pub fn waiting(&self) -> impl Iterator<Item = Ahead<'_, B>> {
        let within_reach = self.within_reach.waiting().map(Ahead::Motion);
        self.chain.iter().map(|waiting| Ahead::Motion(&waiting.request)).chain(self.behind.items()).chain(within_reach)
    }

    /// Releases the chain, which ends here at rest.
    fn release_chain(&mut self) {
        if self.chain.is_empty() || self.is_held() {
            return;
        }
        if !self.plan(Some(Junction::REST)) {
            return self.clear_chain();
        }
        if let Some(stop) = self.scratch.stop {
            return self.release_until(stop);
        }
        self.release(self.chain.len(), 0.0);
        self.overspeed = 0.0;
        self.next_start = self.next_start.map(|_| LEAST_START);
    }

    fn clear_chain(&mut self) {
        if let Some(last) = self.ready.back_mut() {
            last.last.get_or_insert(0.0);
        }
        self.scratch.lacks_more = false;
        self.chain.clear();
        self.chain_bytes = 0;
    }

    /// Releases about half of the chain, which goes on.
    fn release_window(&mut self) {
        if self.is_held() {
            return;
        }
        if !self.plan(None) {
            return self.clear_chain();
        }
        if let Some(stop) = self.scratch.stop {
            return self.release_until(stop);
        }
        let (window, window_bytes) = (self.settings.window, self.settings.window_bytes);
        let (is_too_long, is_too_large) = (self.chain.len() >= 2 * window, self.chain_bytes >= 2 * window_bytes);
        let is_overdue = is_too_long || is_too_large;
        let enough = match (is_too_long, is_too_large) {
            (true, _) => window / 2,
            // Fewer would soon have to be planned again.
            (false, true) => (self.chain.len() / 4).max(1),
            (false, false) => 1,
        };
        match self.scratch.cut(self.chain.len() / 2).filter(|&(count, _)| count >= enough) {
            Some((count, speed)) => {
                self.release(count, speed);
                self.start_again();
            }
            // All of it brakes: with more of the path known there will be a place to divide it.
            None if !is_overdue => self.runs_before = self.scratch.run_lengths(0),
            None => self.release(self.chain.len(), 0.0),
        }
        self.next_plan = window.max(self.chain.len() + window / 4);
        self.next_plan_bytes = window_bytes.max(self.chain_bytes + window_bytes / 4);
    }

    /// Plans the whole chain, from its entry speed to rest at its end, where it meets what follows at the junction `end`, if that is
    /// known; whether there is such a plan.
    fn plan(&mut self, end: Option<Junction>) -> bool {
        let plan = &mut self.scratch;
        plan.nodes.clear();
        let exits = self.chain.iter().skip(1).map(|next| Some(next.entry)).chain([end]);
        for (element, (Waiting { request, entry }, exit)) in self.chain.iter().zip(exits).enumerate() {
            let left = 1.0 - entry.reserve.max(exit.map_or(LARGEST_RESERVE, |exit| exit.reserve));
            let mut start = request.start;
            let mut entry = *entry;
            for stretch in &request.stretches {
                let mut node = Node::new(element, stretch, start, left, entry, request, self.feed_override);
                node.joins = exit.is_some() || start > request.start;
                plan.nodes.push(node);
                start = stretch.end;
                entry = Junction::NONE;
            }
        }
        plan.gather(self.begun.as_ref(), &[]);
        if let Some(range) = self.free_entry {
            let Some(speed) = plan.entry_within(range) else {
                self.too_fast = true;
                return false;
            };
            self.entry_speed = speed;
        }
        if plan.solve(self.entry_speed) {
            return true;
        }
        // Gathered as in the plan before, the part that was planned can be run as it was planned.
        plan.gather(None, &self.runs_before);
        let is_possible = plan.solve(self.entry_speed);
        self.too_fast |= !is_possible && self.is_restarting();
        debug_assert!(is_possible || self.is_restarting(), "what was planned can be run");
        is_possible || !self.is_restarting()
    }

    /// Releases the planned chain up to where it stops because no speed is commanded.
    fn release_until(&mut self, stop: Stop) {
        let Stop { node, s } = stop;
        let element = self.scratch.element(node);
        let first = self.scratch.first_node_of(element);
        self.release(element, 0.0);
        if let Some(Waiting { request, entry }) = self.chain.front_mut() {
            let within = node - first;
            let start = if within == 0 { request.start } else { request.stretches[within - 1].end };
            let stop = (start + s).min(request.stretches[within].end);
            if stop > request.start {
                let mut before = request.clone();
                before.entry_reserve = entry.reserve;
                before.stretches.truncate(within + 1);
                before.stretches[within].end = stop;
                let stretches = self.scratch.planned(&before, first, Some(s));
                let planned = Planned::Motion(PlannedMotion::new(before, stretches));
                self.ready.push_back(Released { planned, entry: *entry, last: Some(0.0) });
                request.start = stop;
                request.stretches.drain(..within);
                if stop >= request.stretches[0].end {
                    request.stretches.remove(0);
                }
            }
            *entry = Junction::REST;
            if request.stretches.is_empty() {
                self.chain.pop_front();
            }
        }
        if let Some(Waiting { entry, .. }) = self.chain.front_mut() {
            *entry = Junction::REST;
        }
        self.overspeed = 0.0;
        self.begun = None;
        self.runs_before.clear();
        self.count_bytes();
        self.is_held = true;
    }

    /// Releases the first `count` elements of the planned chain, which has this speed behind them, mm/s.
    fn release(&mut self, count: usize, end_speed: f64) {
        self.free_entry = None;
        let mut node = 0;
        let divides = self.settings.limits.is_some();
        for Waiting { mut request, entry } in self.chain.drain(..count) {
            request.entry_reserve = entry.reserve;
            let stretches = self.scratch.planned(&request, node, None);
            node += stretches.len();
            let motion = PlannedMotion::new(request, stretches);
            let planned = Planned::Motion(if divides { motion.divided_at_cruises(self.feed_override) } else { motion });
            self.ready.push_back(Released { planned, entry, last: None });
        }
        if let Some(last) = self.ready.back_mut().filter(|_| count > 0 && end_speed == 0.0) {
            last.last = Some(self.chain.front().map_or(0.0, |next| next.entry.reserve));
        }
        self.entry_speed = end_speed;
        self.scratch.lacks_more = false;
        self.begun = self.scratch.begun_at(node, self.begun.as_ref());
        self.runs_before = self.scratch.run_lengths(node);
        self.next_plan = self.settings.window;
        self.next_plan_bytes = self.settings.window_bytes;
        self.count_bytes();
    }
}
