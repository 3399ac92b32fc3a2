//! The feed planner: speeds at the junctions of elements within bounded look-ahead, and a profile for every stretch.
//!
//! Elements arrive in order. Where two of them do not meet tangentially, and at every barrier, the path rests; what
//! lies between two rests is a chain. A chain is planned by a backward and a forward pass over its junctions, when
//! its end is known or when the window is full: then the path is assumed to rest at the window's end, which is
//! always safe, and the first half of the window is released. All planning happens when something is pushed, so the
//! result does not depend on when it is taken out.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};
use smallvec::SmallVec;

use crate::junction::{Junction, JunctionRules};
use crate::profile::{highest_entry, reachable_exit};
use crate::tolerance::LARGEST_RESERVE;
use crate::{Element, Machine, PathLimits, Profile, Stretches};

/// An element to plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionRequest {
    /// The element.
    pub element: Element,
    /// Largest feed motion along it.
    pub limits: PathLimits,
    /// Commanded speeds along it.
    pub stretches: Stretches,
}

/// A stretch with its profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedStretch {
    /// Arc length where it starts, mm.
    pub start: f64,
    /// Arc length where it ends, mm.
    pub end: f64,
    /// Motion along it, from 0 to `end − start`.
    pub profile: Profile,
    /// Spindle speed, rev/s, without its sense.
    pub spindle_rev_per_s: f64,
}

/// A planned element.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedMotion {
    /// The element.
    pub element: Element,
    /// Its stretches in order; at least one.
    pub stretches: SmallVec<[PlannedStretch; 1]>,
    /// Whether the next element follows tangentially.
    pub tangent_end: bool,
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

/// Settings of a planner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannerSettings {
    /// Elements looked ahead.
    window: usize,
    junctions: JunctionRules,
}

impl PlannerSettings {
    /// Settings for a machine and an interpolation period: steps of velocity and acceleration at junctions happen
    /// within one period, and the axes must follow them within their limits.
    #[must_use]
    pub fn new(machine: &Machine, window: usize, period_s: f64) -> Self {
        Self { window: window.max(2), junctions: JunctionRules::new(machine, period_s) }
    }
}

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
    /// The present chain, as far as it is not released.
    chain: VecDeque<Waiting>,
    /// Speed at the chain's start, mm/s.
    entry_speed: f64,
    ready: VecDeque<Planned<B>>,
    #[serde(skip)]
    scratch: Scratch,
}

/// Junction speeds of the chain; kept between plans so that planning allocates nothing.
#[derive(Clone, Debug, Default)]
struct Scratch {
    nodes: Vec<Node>,
}

impl PartialEq for Scratch {
    /// Scratch is no state.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// One stretch of the chain.
#[derive(Clone, Copy, Debug)]
struct Node {
    length: f64,
    limits: PathLimits,
    /// Highest speed at its start, then the planned one.
    entry: f64,
}

impl<B> Planner<B> {
    /// A planner at rest.
    #[must_use]
    pub fn new(settings: PlannerSettings) -> Self {
        Self { settings, chain: VecDeque::new(), entry_speed: 0.0, ready: VecDeque::new(), scratch: Scratch::default() }
    }

    /// Adds the next element.
    pub fn push_motion(&mut self, request: MotionRequest) {
        let junction = self.chain.back().and_then(|before| {
            let top_speed = before.request.top_speed_at_end().min(request.top_speed_at_start());
            self.settings.junctions.junction(&before.request.element, &request.element, top_speed)
        });
        if junction.is_none() {
            self.release_chain();
        }
        self.chain.push_back(Waiting { request, entry: junction.unwrap_or(Junction::REST) });
        if self.chain.len() >= self.settings.window {
            // What the next junction will need is not known yet.
            self.plan(LARGEST_RESERVE);
            self.release(self.chain.len() / 2);
        }
    }

    /// Adds a barrier; the path rests there.
    pub fn push_barrier(&mut self, barrier: B) {
        self.release_chain();
        self.ready.push_back(Planned::Barrier(barrier));
    }

    /// Says that nothing follows.
    pub fn finish(&mut self) {
        self.release_chain();
    }

    /// Takes the next planned item; `None` until more is pushed or the path is finished.
    pub fn pop(&mut self) -> Option<Planned<B>> {
        self.ready.pop_front()
    }

    fn release_chain(&mut self) {
        if !self.chain.is_empty() {
            self.plan(Junction::REST.reserve);
            self.release(self.chain.len());
        }
        self.entry_speed = 0.0;
    }

    /// Plans the junction speeds of the whole chain, from its entry speed to rest at its end, where the junction after
    /// it takes the share `end_reserve`.
    fn plan(&mut self, end_reserve: f64) {
        let nodes = &mut self.scratch.nodes;
        nodes.clear();
        let exits = self.chain.iter().skip(1).map(|next| next.entry.reserve).chain([end_reserve]);
        for (Waiting { request, entry }, exit_reserve) in self.chain.iter().zip(exits) {
            let left = 1.0 - entry.reserve.max(exit_reserve);
            let mut start = 0.0;
            let mut entry_limit = entry.speed;
            for stretch in &request.stretches {
                let velocity = request.limits.velocity.min(stretch.speed_mm_per_s);
                let limits = PathLimits {
                    velocity,
                    acceleration: left * request.limits.acceleration,
                    jerk: left * request.limits.jerk,
                };
                nodes.push(Node { length: stretch.end - start, limits, entry: entry_limit.min(velocity) });
                start = stretch.end;
                // The next stretch limits its entry to its own velocity too.
                entry_limit = velocity;
            }
        }
        nodes[0].entry = self.entry_speed;
        let mut exit = 0.0;
        for node in nodes.iter_mut().skip(1).rev() {
            node.entry = highest_entry(exit, node.entry, node.length, &node.limits);
            exit = node.entry;
        }
        for index in 1..nodes.len() {
            let before = nodes[index - 1];
            nodes[index].entry = reachable_exit(before.entry, nodes[index].entry, before.length, &before.limits);
        }
    }

    /// Releases the first `count` elements of the planned chain.
    fn release(&mut self, count: usize) {
        let nodes = &self.scratch.nodes;
        let mut node = 0;
        for _ in 0..count {
            let Some(Waiting { request, .. }) = self.chain.pop_front() else { break };
            let tangent_end = !self.chain.is_empty();
            let mut start = 0.0;
            let mut stretches = SmallVec::new();
            for stretch in &request.stretches {
                let Node { length, limits, entry } = nodes[node];
                node += 1;
                let exit = nodes.get(node).map_or(0.0, |next| next.entry);
                let profile = Profile::solve(length, entry, exit, limits);
                debug_assert!(profile.is_some(), "the passes leave room for every change of speed");
                let profile =
                    profile.unwrap_or_else(|| Profile::with_cruise(length, entry, entry.max(exit), exit, &limits));
                let spindle_rev_per_s = stretch.spindle_rev_per_s;
                stretches.push(PlannedStretch { start, end: stretch.end, profile, spindle_rev_per_s });
                start = stretch.end;
            }
            self.ready.push_back(Planned::Motion(PlannedMotion { element: request.element, stretches, tangent_end }));
        }
        self.entry_speed = nodes.get(node).map_or(0.0, |next| next.entry);
    }
}

impl MotionRequest {
    fn top_speed_at_start(&self) -> f64 {
        self.limits.velocity.min(self.stretches.first().map_or(0.0, |stretch| stretch.speed_mm_per_s))
    }

    fn top_speed_at_end(&self) -> f64 {
        self.limits.velocity.min(self.stretches.last().map_or(0.0, |stretch| stretch.speed_mm_per_s))
    }
}
