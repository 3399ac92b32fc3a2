//! Decisions on the spindle speed after they were made: the machine's answers, and speeds that are not possible
//! (docs/functions/adaptive-feed.md, "Planned changes of the spindle speed").

use super::Monitor;
use crate::decision::{Decision, Evidence, Outcome, Overrides, Span, SpindleAnswer, SpindlePlan, SpindleRequest};
use serde::{Deserialize, Serialize};

/// Decisions on the spindle speed that an answer is taken for, where they are in force at once. An answer is voluntary: of more
/// decisions the oldest counts as carried out.
pub(super) const MAX_REQUESTS: usize = 16;

/// A decision on the spindle speed that is in force at once, and has not come to its end.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Asked {
    request: SpindleRequest,
    /// Refused; what a later one goes back to depends on it.
    refused: bool,
}

/// Decisions on the spindle speed that are in force at once, oldest first. What is in force follows from what the machine says of
/// each of them: it is the last one that is not refused, or what was in force before the first.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Requests(Vec<Asked>);

impl Requests {
    /// What a snapshot from before there were several knows.
    pub(super) fn from_plan(plan: SpindlePlan) -> Self {
        let asked = plan.request.filter(|_| !plan.planned).map(|request| Asked { request, refused: false });
        Self(asked.into_iter().collect())
    }

    /// Whether a restored value can be.
    pub(super) fn fits(&self, plan: SpindlePlan) -> bool {
        let numbers = self.0.windows(2).all(|pair| pair[0].request.decision < pair[1].request.decision);
        let in_force = if plan.planned { None } else { plan.request };
        self.0.len() <= MAX_REQUESTS && numbers && (!plan.planned || self.0.is_empty()) && self.in_force() == in_force
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    fn push(&mut self, request: SpindleRequest) {
        if self.0.len() == MAX_REQUESTS {
            self.forget_to(0);
        }
        self.0.push(Asked { request, refused: false });
    }

    /// Takes away everything up to an index; what is in force there is what the next one goes back to.
    fn forget_to(&mut self, index: usize) {
        let base = self.base(index + 1);
        self.0.drain(..=index);
        if let (Some(first), Some(base)) = (self.0.first_mut(), base) {
            first.request.from = base;
        }
    }

    /// Override before the request with this index, as far as none before it is refused; it may be one behind the last.
    fn base(&self, index: usize) -> Option<f64> {
        let standing = self.0.iter().take(index).rfind(|asked| !asked.refused).map(|asked| asked.request.spindle);
        standing.or_else(|| self.0.first().map(|asked| asked.request.from))
    }

    fn position(&self, decision: u64) -> Option<usize> {
        self.0.iter().position(|asked| asked.request.decision == decision && !asked.refused)
    }

    /// A request that is not refused, with the override that its refusal goes back to.
    fn get(&self, decision: u64) -> Option<SpindleRequest> {
        let index = self.position(decision)?;
        let from = self.base(index)?;
        Some(SpindleRequest { from, ..self.0[index].request })
    }

    /// The one in force.
    fn in_force(&self) -> Option<SpindleRequest> {
        self.get(self.0.iter().rfind(|asked| !asked.refused)?.request.decision)
    }

    /// The override that is wanted from what is in force, where that was refused.
    fn refused_next(&self) -> Option<f64> {
        let behind = self.0.iter().rposition(|asked| !asked.refused).map_or(0, |index| index + 1);
        self.0.get(behind).map(|asked| asked.request.spindle)
    }

    fn take(&mut self, decision: u64, answer: SpindleAnswer) {
        let Some(index) = self.position(decision) else { return };
        match answer {
            SpindleAnswer::Accepted => self.0[index].request.accepted = true,
            SpindleAnswer::Refused => self.0[index].refused = true,
            SpindleAnswer::Reached { .. } => self.forget_to(index),
        }
    }
}

impl Monitor {
    /// The machine answers a decision on the spindle speed: one record, whether it was asked or not.
    pub(super) fn answer(&mut self, decision: u64, answer: SpindleAnswer, sink: &mut dyn FnMut(Decision)) {
        let SpindlePlan { planned, request, .. } = self.run.spindle;
        let is_due = |request: &SpindleRequest| {
            let is_early = planned && request.setpoint_index.is_none();
            let says_new = match answer {
                SpindleAnswer::Accepted => !request.accepted,
                SpindleAnswer::Reached { rev_per_min, .. } => {
                    !is_early && (!planned || rev_per_min.is_none_or(|measured| request.is_reached_at(measured)))
                }
                SpindleAnswer::Refused => true,
            };
            request.decision == decision && says_new
        };
        let request = if planned { request } else { self.run.requests.get(decision) }.filter(is_due);
        let time_ns = self.run.last_ns.unwrap_or(0);
        let (before, held_feed) = (self.run.overrides.spindle, self.run.held_feed);
        self.decide(time_ns, Span::default(), Evidence::SpindleAnswer { decision, answer, request }, sink);
        let Some(request) = request else { return };
        if planned {
            self.conclude(request, answer);
        } else {
            self.conclude_at_once(request, answer);
        }
        let after = self.run.overrides.spindle;
        let is_turned = match answer {
            SpindleAnswer::Accepted => false,
            SpindleAnswer::Reached { .. } => planned,
            SpindleAnswer::Refused => after != before,
        };
        if !is_turned {
            return;
        }
        // What a resume takes keeps the feed per edge as well.
        if let Some(feed) = held_feed {
            let bounds = self.config.rules.feed_bounds;
            self.run.held_feed = Some((feed * (after / before)).clamp(bounds.lower, bounds.upper));
        }
        // What was collected so far mixes two speeds.
        self.restart_window();
    }

    /// An answer to a planned change.
    fn conclude(&mut self, request: SpindleRequest, answer: SpindleAnswer) {
        let (request, refused) = match answer {
            SpindleAnswer::Accepted => {
                self.run.spindle.request = Some(SpindleRequest { accepted: true, ..request });
                return;
            }
            SpindleAnswer::Reached { .. } => (None, None),
            SpindleAnswer::Refused => (None, Some(request.spindle)),
        };
        self.run.spindle = SpindlePlan { request, refused, planned: true };
    }

    /// An answer to one of the changes that were in force at once.
    fn conclude_at_once(&mut self, request: SpindleRequest, answer: SpindleAnswer) {
        let was_in_force = self.run.spindle.request.is_some_and(|newest| newest.decision == request.decision);
        self.run.requests.take(request.decision, answer);
        let refused = match answer {
            SpindleAnswer::Accepted => self.run.spindle.refused,
            SpindleAnswer::Reached { .. } if !was_in_force => self.run.spindle.refused,
            SpindleAnswer::Reached { .. } => self.run.requests.refused_next(),
            SpindleAnswer::Refused => self.run.requests.refused_next().or(Some(request.spindle)),
        };
        self.run.spindle = SpindlePlan { request: self.run.requests.in_force(), refused, planned: false };
    }

    /// A speed is not possible for what follows: the planned one is given up, the present one goes back to the programmed one.
    pub(super) fn drop_spindle(&mut self, spindle: f64, setpoint_index: u64, sink: &mut dyn FnMut(Decision)) {
        let time_ns = self.run.last_ns.unwrap_or(0);
        self.decide(time_ns, Span::default(), Evidence::SpindleUnfit { spindle, setpoint_index }, sink);
        let SpindlePlan { request, .. } = self.run.spindle;
        if request.is_some_and(|request| request.spindle == spindle) {
            self.run.spindle.request = None;
            self.run.spindle.refused = Some(spindle);
        }
    }

    /// Remembers the request that a decision makes. One for the speed in force gives up what waits; the machine is asked where it
    /// may have begun to change the speed.
    pub(super) fn request_spindle(&mut self, number: u64, before: Overrides, evidence: Evidence, outcome: &Outcome) {
        let decided = matches!(evidence, Evidence::Process(_) | Evidence::Silence { .. });
        let at_once = Some(outcome.after.spindle).filter(|spindle| decided && *spindle != before.spindle);
        let Some(spindle) = outcome.planned_spindle.or(at_once) else { return };
        let was_asked =
            self.run.spindle.request.is_some_and(|request| request.accepted || request.setpoint_index.is_some());
        if outcome.planned_spindle == Some(before.spindle) && !was_asked {
            self.run.spindle.request = None;
            return;
        }
        let request = SpindleRequest {
            decision: number,
            spindle,
            from: before.spindle,
            accepted: false,
            setpoint_index: None,
            rev_per_min: None,
        };
        self.run.spindle.request = Some(request);
        if !self.run.spindle.planned {
            self.run.requests.push(request);
        }
    }
}
