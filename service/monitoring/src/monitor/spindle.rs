//! Decisions on the spindle speed after they were made: the machine's answers, and speeds that are not possible
//! (docs/functions/adaptive-feed.md, "Planned changes of the spindle speed").

use super::Monitor;
use crate::decision::{Decision, Evidence, Outcome, Overrides, Span, SpindleAnswer, SpindlePlan, SpindleRequest};

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
        let request = request.filter(is_due);
        let time_ns = self.run.last_ns.unwrap_or(0);
        let held_feed = self.run.held_feed;
        self.decide(time_ns, Span::default(), Evidence::SpindleAnswer { decision, answer, request }, sink);
        let Some(SpindleRequest { spindle, from, .. }) = request else { return };
        match answer {
            SpindleAnswer::Accepted => {
                self.run.spindle.request = request.map(|request| SpindleRequest { accepted: true, ..request });
                return;
            }
            SpindleAnswer::Reached { .. } => self.run.spindle = SpindlePlan { request: None, refused: None, planned },
            SpindleAnswer::Refused => {
                self.run.spindle = SpindlePlan { request: None, refused: Some(spindle), planned };
            }
        }
        let turned = match (answer, planned) {
            (SpindleAnswer::Reached { .. }, true) => spindle / from,
            (SpindleAnswer::Refused, false) => from / spindle,
            _ => return,
        };
        // What a resume takes keeps the feed per edge as well.
        if let Some(feed) = held_feed {
            let bounds = self.config.rules.feed_bounds;
            self.run.held_feed = Some((feed * turned).clamp(bounds.lower, bounds.upper));
        }
        // What was collected so far mixes two speeds.
        self.restart_window();
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
        self.run.spindle.request = Some(SpindleRequest {
            decision: number,
            spindle,
            from: before.spindle,
            accepted: false,
            setpoint_index: None,
            rev_per_min: None,
        });
    }
}
