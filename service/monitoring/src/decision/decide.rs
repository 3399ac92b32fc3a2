//! What follows from the inputs of a decision.

use super::{
    Action, Bound, Evidence, HoldReason, Inputs, Outcome, Overrides, Properties, Reason, SpindleAnswer, SpindlePlan,
    SpindleRequest,
};
use crate::rules::{Bounds, EscalationAction, Fallback, Property, Rules, SpindleRule};
use crate::spectrum::LineOrigin;

/// The decision that follows from the inputs.
///
/// Stop wins; then bad data and threads hold; then a feed that is held stays so; then a property that stays above its
/// limit at the lower feed bound escalates; then the spindle rule, which scales the feed so that the feed per edge
/// stays; the feed rule only when the spindle rule changes nothing, and no larger feed where it wants a speed beyond its bounds.
pub fn decide(inputs: &Inputs) -> Outcome {
    let outcome = |action, reason| Outcome {
        action,
        reason,
        after: inputs.before,
        feed_bound: None,
        spindle_bound: None,
        planned_spindle: None,
    };
    match inputs.evidence {
        Evidence::ToolCheck { least, most, max_ratio, max_run_out } => {
            if (0..2).all(|axis| runs_true(least[axis], most[axis], max_ratio, max_run_out)) {
                outcome(Action::Keep, Reason::ToolFit)
            } else {
                outcome(Action::Stop, Reason::ReplaceTool)
            }
        }
        Evidence::IdleCheck { difference, max_difference, .. } if difference > max_difference => {
            outcome(Action::Stop, Reason::ServiceMachine)
        }
        Evidence::IdleCheck { .. } => outcome(Action::Keep, Reason::MachineFit),
        Evidence::Unfit(reason) => outcome(Action::Hold, Reason::Data(reason)),
        Evidence::Silence { .. } => match inputs.rules.fallback {
            Fallback::Stop => outcome(Action::Stop, Reason::Silence),
            Fallback::Full if inputs.held => outcome(Action::Hold, Reason::FeedHeld),
            Fallback::Full if inputs.threading => outcome(Action::Hold, Reason::Threading),
            Fallback::Full if inputs.before != Overrides::FULL || inputs.spindle.awaits_other_than(1.0) => {
                full(inputs, outcome(Action::Change, Reason::Silence))
            }
            Fallback::Hold | Fallback::Full => outcome(Action::Hold, Reason::Silence),
        },
        Evidence::SpindleAnswer { answer, request, .. } => answered(inputs, answer, request, outcome),
        Evidence::SpindleUnfit { spindle, .. } => {
            // At the programmed speed everything was judged.
            let back = spindle == inputs.before.spindle && inputs.spindle.request.is_none();
            Outcome { planned_spindle: back.then_some(1.0), ..outcome(Action::Keep, Reason::SpindleUnfit) }
        }
        Evidence::Process(_) if inputs.threading => outcome(Action::Hold, Reason::Threading),
        Evidence::Process(properties) => process(inputs, &properties, outcome),
    }
}

/// Both overrides at 100 %, the spindle's at the next place where it can change; what was planned for there is given up.
fn full(inputs: &Inputs, change: Outcome) -> Outcome {
    if !inputs.spindle.planned {
        return Outcome { after: Overrides::FULL, ..change };
    }
    let plan = inputs.spindle;
    let is_wanted = plan.awaits_other_than(1.0) || (plan.request.is_none() && inputs.before.spindle != 1.0);
    let action = if inputs.before.feed == 1.0 { Action::Keep } else { Action::Change };
    let after = Overrides { feed: 1.0, ..inputs.before };
    Outcome { action, after, planned_spindle: is_wanted.then_some(1.0), ..change }
}

/// What follows from the machine's answer to a decision on the spindle speed.
fn answered(
    inputs: &Inputs,
    answer: SpindleAnswer,
    request: Option<SpindleRequest>,
    outcome: impl Fn(Action, Reason) -> Outcome,
) -> Outcome {
    let Some(request) = request else { return outcome(Action::Keep, Reason::SpindleNotAsked) };
    let (spindle, reason) = match (answer, inputs.spindle.planned) {
        (SpindleAnswer::Accepted, _) => return outcome(Action::Keep, Reason::SpindleAccepted),
        // It has been in force since it was decided.
        (SpindleAnswer::Reached { .. }, false) => return outcome(Action::Keep, Reason::SpindleReached),
        (SpindleAnswer::Reached { .. }, true) => (request.spindle, Reason::SpindleReached),
        (SpindleAnswer::Refused, true) => return outcome(Action::Keep, Reason::SpindleRefused),
        // A later decision is in force, which goes back further when it is refused as well.
        (SpindleAnswer::Refused, false)
            if inputs.spindle.request.is_some_and(|newest| newest.decision != request.decision) =>
        {
            return outcome(Action::Keep, Reason::SpindleRefused);
        }
        (SpindleAnswer::Refused, false) => (request.from, Reason::SpindleRefused),
    };
    let (feed, feed_bound) = feed_with_spindle(inputs, spindle);
    Outcome { after: Overrides { feed, spindle }, feed_bound, ..outcome(Action::Change, reason) }
}

/// The feed override with which the feed per edge or revolution stays at another spindle override; a held feed stays held.
fn feed_with_spindle(inputs: &Inputs, spindle: f64) -> (f64, Option<Bound>) {
    if inputs.held {
        return (inputs.before.feed, None);
    }
    bounded(inputs.before.feed * (spindle / inputs.before.spindle), inputs.rules.feed_bounds)
}

/// The property that the rules judge; `None` where the window does not have it: noise has no frequency of vibration.
fn property(rules: &Rules, properties: &Properties) -> Option<f64> {
    match rules.property {
        Property::Deviation => Some(properties.max_deviation),
        Property::VibrationAmplitude => properties.line.map(|line| line.amplitude),
        Property::VibrationFrequency => {
            properties.line.filter(|line| line.origin != LineOrigin::Noise).map(|line| line.frequency_hz)
        }
    }
}

/// Windows in a row, with this one, in which the property was above its upper limit at the lower feed bound.
///
/// Only a window that is judged counts or breaks the row: bad data, threads, silence and a missing spectrum say nothing
/// about the property, and a pause of contact belongs to the window around it.
pub fn windows_at_bound(inputs: &Inputs) -> u32 {
    let value = match &inputs.evidence {
        Evidence::Process(properties) if !inputs.threading && !inputs.held => property(&inputs.rules, properties),
        _ => None,
    };
    let Rules { feed, feed_bounds, .. } = &inputs.rules;
    match value {
        Some(value) if value > feed.upper && inputs.before.feed <= feed_bounds.lower => {
            inputs.windows_at_bound.saturating_add(1)
        }
        Some(_) => 0,
        None => inputs.windows_at_bound,
    }
}

/// (max − min)/max ≤ C and max − min within the absolute limit. A largest distance of 0 has no ratio and fails.
fn runs_true(least: f64, most: f64, max_ratio: Option<f64>, max_run_out: Option<f64>) -> bool {
    let run_out = most - least;
    max_ratio.is_none_or(|limit| most > 0.0 && run_out / most <= limit)
        && max_run_out.is_none_or(|limit| run_out <= limit)
}

fn process(inputs: &Inputs, properties: &Properties, outcome: impl Fn(Action, Reason) -> Outcome) -> Outcome {
    let rules = &inputs.rules;
    let Some(value) = property(rules, properties) else {
        return outcome(Action::Hold, Reason::Data(HoldReason::NoSpectrum));
    };
    if inputs.held {
        return outcome(Action::Hold, Reason::FeedHeld);
    }
    if let Some(escalation) = rules.escalation
        && windows_at_bound(inputs) >= escalation.windows
    {
        let (action, feed) = match escalation.action {
            EscalationAction::Hold => (Action::HoldFeed, 0.0),
            EscalationAction::Stop => (Action::Stop, inputs.before.feed),
        };
        let after = Overrides { feed, ..inputs.before };
        return Outcome { after, feed_bound: Some(Bound::Lower), ..outcome(action, Reason::AboveLimitAtBound) };
    }
    let wanted = match wanted_spindle(inputs, properties, value) {
        Ok(wanted) => wanted,
        Err(reason) => return outcome(Action::Hold, reason),
    };
    let (mut spindle_bound, mut beyond_bound) = (None, None);
    if let Some((wanted, reason)) = wanted {
        let spindle;
        (spindle, spindle_bound) = bounded(wanted, rules.spindle_bounds);
        beyond_bound = spindle_bound.filter(|_| spindle == inputs.before.spindle).map(|_| reason);
        let SpindlePlan { planned, request, refused } = inputs.spindle;
        // Until a planned change is in force, and where it was refused, the feed rule goes on alone.
        let waits = (planned && request.is_some()) || refused == Some(spindle);
        if spindle != inputs.before.spindle && !waits {
            if planned {
                return Outcome { planned_spindle: Some(spindle), spindle_bound, ..outcome(Action::Keep, reason) };
            }
            let (feed, feed_bound) = feed_with_spindle(inputs, spindle);
            let after = Overrides { feed, spindle };
            return Outcome { after, feed_bound, spindle_bound, ..outcome(Action::Change, reason) };
        }
    }
    let (factor, reason) = if value < rules.feed.lower {
        if let Some(reason) = beyond_bound {
            // What the spindle would mend is still there: a smaller feed relieves it, a larger one does not.
            return Outcome { spindle_bound, ..outcome(Action::Keep, reason) };
        }
        (1.0 + rules.feed.step, Reason::FeedBelowLimit)
    } else if value > rules.feed.upper {
        (1.0 - rules.feed.step, Reason::FeedAboveLimit)
    } else {
        return Outcome { spindle_bound, ..outcome(Action::Keep, Reason::WithinLimits) };
    };
    let (feed, feed_bound) = bounded(inputs.before.feed * factor, rules.feed_bounds);
    let action = if feed == inputs.before.feed { Action::Keep } else { Action::Change };
    let after = Overrides { feed, ..inputs.before };
    Outcome { after, feed_bound, spindle_bound, ..outcome(action, reason) }
}

/// The spindle override that the spindle rule wants and why, where it wants another one; an error is why it cannot say.
fn wanted_spindle(inputs: &Inputs, properties: &Properties, value: f64) -> Result<Option<(f64, Reason)>, Reason> {
    let before = inputs.before.spindle;
    match &inputs.rules.spindle {
        SpindleRule::Turning { lower_deg, upper_deg, step, min_concentration } => match properties.mean_angle {
            Some((angle, concentration)) if concentration >= *min_concentration => {
                if angle < *lower_deg {
                    Ok(Some((before * (1.0 + step), Reason::AngleBelowLimit)))
                } else if angle > *upper_deg {
                    Ok(Some((before * (1.0 - step), Reason::AngleAboveLimit)))
                } else {
                    Ok(None)
                }
            }
            _ => Ok(None),
        },
        SpindleRule::Milling { limit, table } if value >= *limit => {
            let programmed = inputs.programmed_rev_per_min.filter(|&rev_per_min| rev_per_min > 0.0);
            let (current, programmed) = inputs.current_rev_per_min.zip(programmed).ok_or(Reason::SpeedUnknown)?;
            let rev_per_min = table.spindle_rev_per_min(current).ok_or(Reason::SpeedNotInTable)?;
            Ok(Some((rev_per_min / programmed, Reason::SpeedFromTable)))
        }
        SpindleRule::None | SpindleRule::Milling { .. } => Ok(None),
    }
}

/// The value within bounds, and which one it hit.
fn bounded(value: f64, bounds: Bounds) -> (f64, Option<Bound>) {
    if value < bounds.lower {
        (bounds.lower, Some(Bound::Lower))
    } else if value > bounds.upper {
        (bounds.upper, Some(Bound::Upper))
    } else {
        (value, None)
    }
}
