//! Decisions: from the monitor to the contract, and their inputs back again to decide once more.

use feedwave_monitoring as monitoring;
use feedwave_monitoring::{
    Action, Bound, Decision, Evidence, HoldReason, Inputs, LineOrigin, Outcome, Properties, Reason, SpindleAnswer,
    SpindlePlan, SpindleRequest, State,
};

use super::monitoring::{rules_from_proto, rules_to_proto};
use crate::proto;
use crate::violations::Violations;
use proto::decision_inputs::Evidence as ProtoEvidence;

/// Pairs of a monitor's value and the contract's name for it.
macro_rules! same_names {
    ($to:ident, $from:ident: $ours:ty = $theirs:ty { $($name:ident),* $(,)? }) => {
        const fn $to(value: $ours) -> $theirs {
            match value {
                $(<$ours>::$name => <$theirs>::$name,)*
            }
        }

        fn $from(value: $theirs) -> Option<$ours> {
            match value {
                $(<$theirs>::$name => Some(<$ours>::$name),)*
                _ => None,
            }
        }
    };
}

same_names!(hold_to_proto, hold_from_proto: HoldReason = proto::HoldReason {
    TooFewSamples, NotFinite, StuckSensor, SensorMissing, TimeOutOfOrder, TimeGap, TimeTooDense, Stale, BatchGap,
    PointsMissing, OtherTool, NoSpectrum,
});
same_names!(action_to_proto, action_from_proto: Action = proto::DecisionAction {
    Keep, Change, Hold, Stop, HoldFeed,
});
same_names!(bound_to_proto, bound_from_proto: Bound = proto::OverrideBound { Lower, Upper });

/// Reasons but for that of the data, which has one of its own.
const REASONS: [(Reason, proto::DecisionReason); 21] = [
    (Reason::ToolFit, proto::DecisionReason::ToolFit),
    (Reason::ReplaceTool, proto::DecisionReason::ReplaceTool),
    (Reason::MachineFit, proto::DecisionReason::MachineFit),
    (Reason::ServiceMachine, proto::DecisionReason::ServiceMachine),
    (Reason::WithinLimits, proto::DecisionReason::WithinLimits),
    (Reason::FeedBelowLimit, proto::DecisionReason::FeedBelowLimit),
    (Reason::FeedAboveLimit, proto::DecisionReason::FeedAboveLimit),
    (Reason::AngleBelowLimit, proto::DecisionReason::AngleBelowLimit),
    (Reason::AngleAboveLimit, proto::DecisionReason::AngleAboveLimit),
    (Reason::SpeedFromTable, proto::DecisionReason::SpeedFromTable),
    (Reason::SpeedNotInTable, proto::DecisionReason::SpeedNotInTable),
    (Reason::SpeedUnknown, proto::DecisionReason::SpeedUnknown),
    (Reason::Threading, proto::DecisionReason::Threading),
    (Reason::Silence, proto::DecisionReason::Silence),
    (Reason::AboveLimitAtBound, proto::DecisionReason::AboveLimitAtBound),
    (Reason::FeedHeld, proto::DecisionReason::FeedHeld),
    (Reason::SpindleAccepted, proto::DecisionReason::SpindleAccepted),
    (Reason::SpindleReached, proto::DecisionReason::SpindleReached),
    (Reason::SpindleRefused, proto::DecisionReason::SpindleRefused),
    (Reason::SpindleNotAsked, proto::DecisionReason::SpindleNotAsked),
    (Reason::SpindleUnfit, proto::DecisionReason::SpindleUnfit),
];

/// A decision as the contract has it, but for its place in the log, which the store gives it.
#[must_use]
pub fn decision_to_proto(decision: &Decision) -> proto::Decision {
    let span = &decision.span;
    let removed = span.removed;
    proto::Decision {
        number: decision.number,
        sensor_time_ns: decision.time_ns,
        tool: decision.tool,
        span: Some(proto::DecisionSpan {
            first_ns: span.first_ns,
            last_ns: span.last_ns,
            first_sample: span.first_sample,
            samples: span.samples,
            valid: span.valid,
            removed: Some(proto::RemovedSamples {
                non_finite: removed.non_finite,
                out_of_range: removed.out_of_range,
                spikes: removed.spikes,
                stuck: removed.stuck,
                missing: removed.missing,
                dropped: removed.dropped,
            }),
        }),
        inputs: Some(inputs_to_proto(&decision.inputs)),
        outcome: Some(outcome_to_proto(&decision.outcome)),
        note: decision.note.clone(),
        ..proto::Decision::default()
    }
}

fn inputs_to_proto(inputs: &Inputs) -> proto::DecisionInputs {
    let evidence = match inputs.evidence {
        Evidence::ToolCheck { least, most, max_ratio, max_run_out } => {
            ProtoEvidence::ToolCheck(proto::ToolCheckEvidence {
                least: least.to_vec(),
                most: most.to_vec(),
                max_ratio,
                max_run_out,
            })
        }
        Evidence::IdleCheck { spindle_rev_per_min, difference, max_difference } => {
            ProtoEvidence::IdleCheck(proto::IdleCheckEvidence { spindle_rev_per_min, difference, max_difference })
        }
        Evidence::Process(Properties { max_deviation, mean_angle, line }) => {
            ProtoEvidence::Process(proto::ProcessEvidence {
                max_deviation,
                mean_angle: mean_angle.map(|(angle_deg, concentration)| proto::MeanAngle { angle_deg, concentration }),
                line: line.map(line_to_proto),
            })
        }
        Evidence::Unfit(reason) => ProtoEvidence::Unfit(hold_to_proto(reason).into()),
        Evidence::Silence { tolerated_ns } => ProtoEvidence::SilenceNs(tolerated_ns),
        Evidence::SpindleAnswer { decision, answer, request } => {
            let (reached_ns, rev_per_min) = match answer {
                SpindleAnswer::Reached { time_ns, rev_per_min } => (time_ns, rev_per_min),
                SpindleAnswer::Accepted | SpindleAnswer::Refused => (None, None),
            };
            ProtoEvidence::SpindleAnswer(proto::SpindleAnswerEvidence {
                decision_number: decision,
                kind: answer_kind(answer).into(),
                reached_ns,
                rev_per_min,
                request: request.map(request_to_proto),
            })
        }
        Evidence::SpindleUnfit { spindle, setpoint_index } => {
            ProtoEvidence::SpindleUnfit(proto::SpindleUnfitEvidence { spindle, setpoint_index })
        }
    };
    proto::DecisionInputs {
        evidence: Some(evidence),
        rules: Some(rules_to_proto(&inputs.rules)),
        before: Some(overrides_to_proto(inputs.before)),
        programmed_rev_per_min: inputs.programmed_rev_per_min,
        current_rev_per_min: inputs.current_rev_per_min,
        threading: inputs.threading,
        windows_at_bound: inputs.windows_at_bound,
        feed_held: inputs.held,
        spindle_plan: (inputs.spindle != SpindlePlan::default()).then(|| proto::SpindlePlan {
            planned: inputs.spindle.planned,
            request: inputs.spindle.request.map(request_to_proto),
            refused_spindle: inputs.spindle.refused,
        }),
    }
}

const fn answer_kind(answer: SpindleAnswer) -> proto::SpindleAnswerKind {
    match answer {
        SpindleAnswer::Accepted => proto::SpindleAnswerKind::Accepted,
        SpindleAnswer::Reached { .. } => proto::SpindleAnswerKind::Reached,
        SpindleAnswer::Refused => proto::SpindleAnswerKind::Refused,
    }
}

/// An answer to a decision on the spindle speed; `None` without a kind.
#[must_use]
pub const fn spindle_answer_from_proto(
    kind: proto::SpindleAnswerKind,
    reached_ns: Option<u64>,
    rev_per_min: Option<f64>,
) -> Option<SpindleAnswer> {
    match kind {
        proto::SpindleAnswerKind::Accepted => Some(SpindleAnswer::Accepted),
        proto::SpindleAnswerKind::Reached => Some(SpindleAnswer::Reached { time_ns: reached_ns, rev_per_min }),
        proto::SpindleAnswerKind::Refused => Some(SpindleAnswer::Refused),
        proto::SpindleAnswerKind::Unspecified => None,
    }
}

const fn request_to_proto(request: SpindleRequest) -> proto::SpindleRequest {
    let SpindleRequest { decision, spindle, from, accepted, setpoint_index, rev_per_min } = request;
    let (decision_number, spindle_before) = (decision, from);
    proto::SpindleRequest { decision_number, spindle, spindle_before, accepted, setpoint_index, rev_per_min }
}

const fn request_from_proto(request: proto::SpindleRequest) -> SpindleRequest {
    let proto::SpindleRequest { decision_number, spindle, spindle_before, accepted, setpoint_index, rev_per_min } =
        request;
    let (decision, from) = (decision_number, spindle_before);
    SpindleRequest { decision, spindle, from, accepted, setpoint_index, rev_per_min }
}

fn line_to_proto(line: monitoring::SpectralLine) -> proto::SpectralLine {
    let (origin, harmonic) = match line.origin {
        LineOrigin::EdgePassing(harmonic) => (proto::LineOrigin::EdgePassing, harmonic),
        LineOrigin::Spindle(harmonic) => (proto::LineOrigin::Spindle, harmonic),
        LineOrigin::Chatter => (proto::LineOrigin::Chatter, 0),
        LineOrigin::Noise => (proto::LineOrigin::Noise, 0),
        LineOrigin::Undetermined => (proto::LineOrigin::Undetermined, 0),
    };
    proto::SpectralLine { frequency_hz: line.frequency_hz, amplitude: line.amplitude, origin: origin.into(), harmonic }
}

fn outcome_to_proto(outcome: &Outcome) -> proto::DecisionOutcome {
    let bound = |bound: Option<Bound>| bound.map_or(proto::OverrideBound::Unspecified, bound_to_proto).into();
    let (reason, hold_reason) = match outcome.reason {
        Reason::Data(hold) => (proto::DecisionReason::Data, hold_to_proto(hold)),
        reason => {
            let named = REASONS.iter().find(|(ours, _)| *ours == reason);
            (named.map_or(proto::DecisionReason::Unspecified, |(_, theirs)| *theirs), proto::HoldReason::Unspecified)
        }
    };
    proto::DecisionOutcome {
        action: action_to_proto(outcome.action).into(),
        reason: reason.into(),
        hold_reason: hold_reason.into(),
        after: Some(overrides_to_proto(outcome.after)),
        feed_bound: bound(outcome.feed_bound),
        spindle_bound: bound(outcome.spindle_bound),
        planned_spindle: outcome.planned_spindle,
    }
}

/// Overrides as the contract has them.
#[must_use]
pub const fn overrides_to_proto(overrides: monitoring::Overrides) -> proto::Overrides {
    proto::Overrides { feed: overrides.feed, spindle: overrides.spindle }
}

/// Name of an action in the database.
#[must_use]
pub const fn action_name(action: Action) -> &'static str {
    match action {
        Action::Keep => "keep",
        Action::Change => "change",
        Action::Hold => "hold",
        Action::Stop => "stop",
        Action::HoldFeed => "hold_feed",
    }
}

/// State of a monitor as a message of the contract.
#[must_use]
pub const fn state_to_proto(state: State) -> proto::MonitorState {
    match state {
        State::Baseline => proto::MonitorState::Baseline,
        State::IdleRunUp { .. } => proto::MonitorState::IdleRunUp,
        State::WaitingForContact => proto::MonitorState::WaitingForContact,
        State::Settling => proto::MonitorState::Settling,
        State::Measuring => proto::MonitorState::Measuring,
        State::Stopped => proto::MonitorState::Stopped,
    }
}

/// What a stored decision depended on and what came out; `None` where the message is not whole.
#[must_use]
pub fn decision_from_proto(decision: &proto::Decision) -> Option<(Inputs, Outcome)> {
    let (inputs, outcome) = (decision.inputs.as_ref()?, decision.outcome.as_ref()?);
    let evidence = evidence_from_proto(inputs.evidence.as_ref()?)?;
    let mut violations = Violations::default();
    let rules = rules_from_proto(&mut violations, inputs.rules.as_ref()?);
    if !violations.is_empty() {
        return None;
    }
    let reason = match outcome.reason() {
        proto::DecisionReason::Data => Reason::Data(hold_from_proto(outcome.hold_reason())?),
        reason => REASONS.iter().find(|(_, theirs)| *theirs == reason)?.0,
    };
    let inputs = Inputs {
        evidence,
        rules,
        before: overrides_from_message(inputs.before)?,
        programmed_rev_per_min: inputs.programmed_rev_per_min,
        current_rev_per_min: inputs.current_rev_per_min,
        threading: inputs.threading,
        windows_at_bound: inputs.windows_at_bound,
        held: inputs.feed_held,
        spindle: inputs.spindle_plan.map_or_else(SpindlePlan::default, |plan| SpindlePlan {
            planned: plan.planned,
            request: plan.request.map(request_from_proto),
            refused: plan.refused_spindle,
        }),
    };
    let outcome = Outcome {
        action: action_from_proto(outcome.action())?,
        reason,
        after: overrides_from_message(outcome.after)?,
        feed_bound: bound_from_proto(outcome.feed_bound()),
        spindle_bound: bound_from_proto(outcome.spindle_bound()),
        planned_spindle: outcome.planned_spindle,
    };
    Some((inputs, outcome))
}

fn evidence_from_proto(evidence: &ProtoEvidence) -> Option<Evidence> {
    Some(match evidence {
        ProtoEvidence::ToolCheck(check) => Evidence::ToolCheck {
            least: check.least.as_slice().try_into().ok()?,
            most: check.most.as_slice().try_into().ok()?,
            max_ratio: check.max_ratio,
            max_run_out: check.max_run_out,
        },
        ProtoEvidence::IdleCheck(check) => Evidence::IdleCheck {
            spindle_rev_per_min: check.spindle_rev_per_min,
            difference: check.difference,
            max_difference: check.max_difference,
        },
        ProtoEvidence::Process(process) => Evidence::Process(Properties {
            max_deviation: process.max_deviation,
            mean_angle: process.mean_angle.map(|mean| (mean.angle_deg, mean.concentration)),
            line: match &process.line {
                Some(line) => Some(line_from_proto(line)?),
                None => None,
            },
        }),
        ProtoEvidence::Unfit(reason) => Evidence::Unfit(hold_from_proto(proto::HoldReason::try_from(*reason).ok()?)?),
        ProtoEvidence::SilenceNs(tolerated_ns) => Evidence::Silence { tolerated_ns: *tolerated_ns },
        ProtoEvidence::SpindleAnswer(it) => Evidence::SpindleAnswer {
            decision: it.decision_number,
            answer: spindle_answer_from_proto(it.kind(), it.reached_ns, it.rev_per_min)?,
            request: it.request.map(request_from_proto),
        },
        ProtoEvidence::SpindleUnfit(it) => {
            Evidence::SpindleUnfit { spindle: it.spindle, setpoint_index: it.setpoint_index }
        }
    })
}

fn overrides_from_message(overrides: Option<proto::Overrides>) -> Option<monitoring::Overrides> {
    overrides.map(|overrides| monitoring::Overrides { feed: overrides.feed, spindle: overrides.spindle })
}

fn line_from_proto(line: &proto::SpectralLine) -> Option<monitoring::SpectralLine> {
    let origin = match line.origin() {
        proto::LineOrigin::EdgePassing => LineOrigin::EdgePassing(line.harmonic),
        proto::LineOrigin::Spindle => LineOrigin::Spindle(line.harmonic),
        proto::LineOrigin::Chatter => LineOrigin::Chatter,
        proto::LineOrigin::Noise => LineOrigin::Noise,
        proto::LineOrigin::Undetermined => LineOrigin::Undetermined,
        proto::LineOrigin::Unspecified => return None,
    };
    Some(monitoring::SpectralLine { frequency_hz: line.frequency_hz, amplitude: line.amplitude, origin })
}

#[cfg(test)]
mod tests {
    use feedwave_monitoring::{Overrides, Rules, Span, decide};

    use super::super::monitoring::{monitoring_from_proto, tests::full};
    use super::*;

    fn check(evidence: Evidence, rules: Rules, spindle: SpindlePlan) {
        let inputs = Inputs {
            evidence,
            rules,
            before: Overrides { feed: 0.1 + 0.2, spindle: 1.0 / 3.0 },
            programmed_rev_per_min: Some(1.0 / 7.0),
            current_rev_per_min: None,
            threading: false,
            windows_at_bound: 4,
            held: false,
            spindle,
        };
        let outcome = decide(&inputs);
        let note = "note".to_owned();
        let decision = Decision { number: 7, time_ns: 1, tool: 2, span: Span::default(), inputs, outcome, note };
        let (inputs, outcome) = decision_from_proto(&decision_to_proto(&decision)).expect("whole");
        assert_eq!((&inputs, &outcome), (&decision.inputs, &decision.outcome));
        assert_eq!(decide(&inputs), outcome);
    }

    #[test]
    fn every_decision_can_be_made_again_from_its_message() {
        let mut violations = Violations::default();
        let milling = monitoring_from_proto(&mut violations, "config", &full()).expect("valid").rules;
        let turning = Rules {
            spindle: monitoring::SpindleRule::Turning {
                lower_deg: -0.1,
                upper_deg: 0.3,
                step: 0.05,
                min_concentration: 0.4,
            },
            ..Rules::default()
        };
        let line = |origin| monitoring::SpectralLine { frequency_hz: 0.1, amplitude: 1.0 / 3.0, origin };
        let process = |line| Evidence::Process(Properties { max_deviation: 0.1, mean_angle: Some((0.7, 0.9)), line });
        let origins = [
            LineOrigin::EdgePassing(3),
            LineOrigin::Spindle(2),
            LineOrigin::Chatter,
            LineOrigin::Noise,
            LineOrigin::Undetermined,
        ];
        let mut evidence = vec![
            Evidence::ToolCheck { least: [1.0, 2.0], most: [1.1, 2.2], max_ratio: Some(0.02), max_run_out: None },
            Evidence::IdleCheck { spindle_rev_per_min: 1e4, difference: 0.002, max_difference: 0.001 },
            Evidence::Silence { tolerated_ns: 500_000_000 },
            process(None),
        ];
        evidence.extend(origins.map(|origin| process(Some(line(origin)))));
        evidence.extend(
            (1..=12)
                .map(|reason| Evidence::Unfit(hold_from_proto(proto::HoldReason::try_from(reason).unwrap()).unwrap())),
        );
        let request = SpindleRequest {
            decision: 2,
            spindle: 0.9,
            from: 1.0 / 3.0,
            accepted: true,
            setpoint_index: Some(7),
            rev_per_min: Some(1_350.0),
        };
        let reached = SpindleAnswer::Reached { time_ns: Some(8), rev_per_min: Some(1_350.5) };
        for answer in [SpindleAnswer::Accepted, reached, SpindleAnswer::Refused] {
            for request in [None, Some(request)] {
                evidence.push(Evidence::SpindleAnswer { decision: 2, answer, request });
            }
        }
        evidence.push(Evidence::SpindleUnfit { spindle: 1.0 / 3.0, setpoint_index: 9 });
        let plans = [
            SpindlePlan::default(),
            SpindlePlan { planned: true, request: Some(request), refused: None },
            SpindlePlan { planned: true, request: None, refused: Some(0.7) },
        ];
        for rules in [Rules::default(), milling, turning] {
            for &evidence in &evidence {
                for spindle in plans {
                    check(evidence, rules.clone(), spindle);
                }
            }
        }
    }

    #[test]
    fn every_reason_has_a_name() {
        for number in 1..=22 {
            let reason = proto::DecisionReason::try_from(number).unwrap();
            let named = REASONS.iter().filter(|(_, theirs)| *theirs == reason).count();
            assert_eq!(named, usize::from(reason != proto::DecisionReason::Data), "{reason:?}");
        }
    }
}
