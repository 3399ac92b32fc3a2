//! Planned changes of the spindle speed: at a place between sections nothing is handed out until the speed of what follows is
//! decided (docs/functions/adaptive-feed.md, "Planned changes of the spindle speed").

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use feedwave_contract::proto;
use feedwave_cutting::{SpindleChange, SpindleTrial, TrialStep};
use feedwave_monitoring::{Decision, Evidence, Reason, SpindleRequest};
use feedwave_program::Finding;

use super::setpoints::Setpoints;
use crate::engine::session::Session;
use crate::error::{Error, Result};

/// What keeps a place between sections.
#[derive(Debug, Default)]
enum Keeps {
    /// Nothing.
    #[default]
    Nothing,
    /// A speed was refused: what that asks for is durable first.
    Refused,
    /// A speed is judged for what follows; this override.
    Judging(Box<SpindleTrial>, f64),
    /// The client is asked since then, by this decision; `needed` where what follows can be cut at no other speed.
    Asking { decision: u64, since: Instant, needed: bool },
}

/// Who goes on at places between sections, and when.
#[derive(Debug)]
pub(super) struct Gate {
    keeps: Keeps,
    /// The place that may be passed: the first setpoint behind it.
    passed: Option<u64>,
    /// The place behind which nothing can be cut at the speed in force.
    unfit: Option<u64>,
    /// How long an answer is waited for.
    patience: Duration,
}

impl Gate {
    pub(super) const fn new(patience: Duration) -> Self {
        Self { keeps: Keeps::Nothing, passed: None, unfit: None, patience }
    }

    /// Whether setpoints may be generated.
    pub(super) fn is_open(&self, setpoints: &Setpoints) -> bool {
        setpoints.open_place().is_none_or(|index| self.passed == Some(index))
    }

    /// Whether [`Gate::advance`] has something to do by itself.
    pub(super) fn is_due(&self, setpoints: &Setpoints, session: &Session) -> bool {
        match self.keeps {
            Keeps::Nothing => !self.is_open(setpoints),
            Keeps::Refused => session.waiting_decisions().is_empty(),
            Keeps::Judging(..) => true,
            Keeps::Asking { .. } => false,
        }
    }

    /// When the patience with the client ends.
    pub(super) fn overdue_at(&self) -> Option<Instant> {
        match self.keeps {
            Keeps::Asking { since, .. } => since.checked_add(self.patience),
            Keeps::Nothing | Keeps::Refused | Keeps::Judging(..) => None,
        }
    }

    /// The client did not answer.
    pub(super) fn overdue(&self, run: String) -> Error {
        let message = format!(
            "the change of the spindle speed was not answered for {} s: answer it (MachineEvent.spindle_answer) when the run \
             is taken up",
            self.patience.as_secs()
        );
        Error::Precondition { reason: "SPINDLE_ANSWER_MISSING", subject: run, message }
    }

    /// Does what is to be done at the place in hand; a request to be sent. With `is_reached` the speed requested is reached, and
    /// comes into force with the next commit.
    pub(super) fn advance(
        &mut self,
        setpoints: &mut Setpoints,
        session: &mut Session,
        is_reached: bool,
    ) -> Result<Option<proto::RunSpindleRequest>> {
        if is_reached {
            return Ok(None);
        }
        let Some(index) = setpoints.open_place().filter(|index| self.passed != Some(*index)) else {
            self.keeps = Keeps::Nothing;
            return Ok(None);
        };
        let request = session.monitor().spindle().request;
        if let ControlFlow::Break(asked) = self.go_on(request, index, setpoints, session)? {
            return Ok(asked);
        }
        let present = setpoints.spindle_ratio();
        match request {
            // The programmed speed was judged by the validation; the trial tells whether anything is cut at it.
            Some(request) => self.try_at(request.spindle, setpoints, session),
            None if present == 1.0 => {
                self.passed = Some(index);
                Ok(None)
            }
            None => self.try_at(present, setpoints, session),
        }
    }

    /// Goes on with what is kept at the place in hand: breaks with what is to be sent, or with nothing while it is not settled.
    fn go_on(
        &mut self,
        request: Option<SpindleRequest>,
        index: u64,
        setpoints: &mut Setpoints,
        session: &mut Session,
    ) -> Result<ControlFlow<Option<proto::RunSpindleRequest>>> {
        match &mut self.keeps {
            Keeps::Asking { decision, needed, .. } => {
                if request.is_some_and(|request| request.decision == *decision) {
                    return Ok(ControlFlow::Break(None));
                }
                // Refused, or another is wanted; one that is reached has opened the place.
                if *needed && request.is_none() {
                    let message = "what follows can be cut at the programmed spindle speed only, which was refused";
                    return Err(Error::Precondition {
                        reason: "SPINDLE_REFUSED",
                        subject: session.run_name(),
                        message: message.to_owned(),
                    });
                }
                self.keeps = Keeps::Nothing;
            }
            Keeps::Judging(trial, spindle) => {
                let spindle = *spindle;
                match setpoints.judge(trial)? {
                    TrialStep::More | TrialStep::NeedInput(_) => return Ok(ControlFlow::Break(None)),
                    TrialStep::Fails(finding) => {
                        self.keeps = Keeps::Refused;
                        if spindle == setpoints.spindle_ratio() {
                            self.unfit = Some(index);
                        }
                        session.refuse_spindle(spindle, index, &reason(&finding))?;
                        return Ok(ControlFlow::Break(None));
                    }
                    TrialStep::Holds { cuts } => {
                        self.keeps = Keeps::Nothing;
                        let request = request.filter(|request| request.spindle == spindle);
                        let is_in_force = spindle == setpoints.spindle_ratio();
                        // The programmed speed may have to be told all the same; where nothing is cut no speed matters.
                        if !cuts || is_in_force && (spindle != 1.0 || request.is_none()) {
                            self.passed = Some(index);
                            return Ok(ControlFlow::Break(None));
                        }
                        if let Some(request) = request {
                            return self
                                .ask(request.decision, spindle, index, setpoints, session)
                                .map(ControlFlow::Break);
                        }
                    }
                }
            }
            Keeps::Refused if !session.waiting_decisions().is_empty() => return Ok(ControlFlow::Break(None)),
            Keeps::Nothing | Keeps::Refused => self.keeps = Keeps::Nothing,
        }
        Ok(ControlFlow::Continue(()))
    }

    fn try_at(
        &mut self,
        spindle: f64,
        setpoints: &Setpoints,
        session: &Session,
    ) -> Result<Option<proto::RunSpindleRequest>> {
        let largest_override = session.monitor().config().rules.feed_bounds.upper;
        let trial = setpoints
            .trial(spindle, largest_override)
            .ok_or_else(|| Error::internal("a spindle speed is judged at no place"))?;
        self.keeps = Keeps::Judging(Box::new(trial), spindle);
        Ok(None)
    }

    fn ask(
        &mut self,
        decision: u64,
        spindle: f64,
        index: u64,
        setpoints: &Setpoints,
        session: &mut Session,
    ) -> Result<Option<proto::RunSpindleRequest>> {
        let rev_per_min = setpoints.rev_per_min_at(spindle);
        session.ask_for_spindle(Some(index), rev_per_min)?;
        // The programmed speed may be wanted by a decision as well, without which the run goes on as it was.
        let needed = spindle == 1.0 && self.unfit == Some(index);
        self.keeps = Keeps::Asking { decision, since: Instant::now(), needed };
        Ok(Some(proto::RunSpindleRequest { decision_number: decision, setpoint_index: index, spindle, rev_per_min }))
    }

    /// The speed of what follows the place was changed.
    pub(super) fn turned(&mut self, change: SpindleChange) {
        self.keeps = Keeps::Nothing;
        self.passed = Some(change.index);
    }
}

/// The planned change of the spindle speed that a decision brings into force.
pub(super) fn change_of(decision: &Decision) -> Option<SpindleChange> {
    let Evidence::SpindleAnswer { request: Some(request), .. } = decision.inputs.evidence else { return None };
    let is_reached = decision.inputs.spindle.planned && decision.outcome.reason == Reason::SpindleReached;
    let index = request.setpoint_index.filter(|_| is_reached)?;
    Some(SpindleChange { index, ratio: request.spindle })
}

fn reason(finding: &Finding) -> String {
    format!("{} in line {}: {}", finding.code, finding.span.line, finding.message)
}
