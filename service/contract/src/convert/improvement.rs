//! Improvements: what is wanted on entry, what came of it on exit.

use feedwave_cutting::{
    Improvement, ImprovementGoals, ImprovementKind, ImprovementOutcome, ImprovementStep, MachineProfile, SearchGoals,
    StabilityGoal, WordChange,
};

use super::report::bounded_report;
use super::report_size::MAX_PAIRED_REPORT_BYTES;
use crate::proto;
use crate::violations::Violations;

/// Margin where none is stated.
const DEFAULT_MARGIN: f64 = 1.1;
/// Tolerance of the spindle speed where none is stated.
const DEFAULT_SPEED_TOLERANCE: f64 = 0.02;
/// Largest margin.
const MAX_MARGIN: f64 = 10.0;
/// Largest tolerance of the spindle speed.
const MAX_SPEED_TOLERANCE: f64 = 0.2;
/// Largest chip thickness that may be asked for, mm.
const MAX_FEED_PER_REV_MM: f64 = 10.0;
/// Largest spindle speed that may be asked for, rev/min.
const MAX_SPINDLE_REV_PER_MIN: f64 = 1e6;

/// Tolerance of the depth where none is stated.
const DEFAULT_DEPTH_TOLERANCE: f64 = 0.1;
/// Largest tolerance of the depth.
const MAX_DEPTH_TOLERANCE: f64 = 0.5;
/// Most points of a chart of lobes.
const MAX_CHART_POINTS: usize = 100_000;

/// Checked goals, for any machine.
#[derive(Clone, Debug, PartialEq)]
pub struct RequestedGoals(proto::ImprovementGoals);

impl RequestedGoals {
    /// What is wanted on this machine.
    #[must_use]
    pub fn on(&self, profile: &MachineProfile) -> ImprovementGoals {
        let Self(goals) = self;
        let range = |low: Option<f64>, high: Option<f64>| low.zip(high).map(|(low, high)| [low, high]);
        ImprovementGoals {
            vibration: SearchGoals {
                margin: goals.margin.unwrap_or(DEFAULT_MARGIN),
                speed_tolerance: goals.speed_tolerance.unwrap_or(DEFAULT_SPEED_TOLERANCE),
                max_feed_override: goals.max_feed_override.unwrap_or(profile.max_feed_override),
                frequency_hz: range(goals.min_frequency_hz, goals.max_frequency_hz),
            },
            least_amplitude: goals.least_amplitude,
            spindle_rev_per_min: range(goals.min_spindle_rev_per_min, goals.max_spindle_rev_per_min),
            max_feed_per_rev_mm: goals.max_feed_per_rev_mm,
            max_tolerance_mm: goals.max_tolerance_mm,
            stability: goals.stability.as_ref().map(stability_goal),
        }
    }
}

/// A checked goal of stability.
fn stability_goal(goal: &proto::StabilityGoal) -> StabilityGoal {
    StabilityGoal {
        chart: goal.lobes.iter().flat_map(stability_chart).collect(),
        depth_mm: goal.depth_mm,
        depth_tolerance: goal.depth_tolerance.unwrap_or(DEFAULT_DEPTH_TOLERANCE),
    }
}

/// The limit of stability, mm, over the spindle speed, rev/min, as lobes have it; `None` where nothing chatters.
pub fn stability_chart(lobes: &proto::StabilityLobes) -> impl Iterator<Item = (f64, Option<f64>)> {
    lobes.chart.iter().map(|point| (point.spindle_rev_per_min, point.limit_mm))
}

fn check_stability(violations: &mut Violations, field: &str, goal: &proto::StabilityGoal) {
    let chart: Vec<_> = goal.lobes.iter().flat_map(stability_chart).collect();
    let ascends = chart.windows(2).all(|pair| pair[0].0 <= pair[1].0);
    let is_possible = |(speed, limit): &(f64, Option<f64>)| {
        speed.is_finite() && *speed > 0.0 && limit.is_none_or(|limit| limit.is_finite() && limit >= 0.0)
    };
    if !(1..=MAX_CHART_POINTS).contains(&chart.len()) {
        violations.add(format!("{field}.lobes.chart"), format!("must have 1 to {MAX_CHART_POINTS} points"));
    } else if !ascends || !chart.iter().all(is_possible) {
        let wanted = "must have positive speeds that ascend, and limits that are no negative numbers";
        violations.add(format!("{field}.lobes.chart"), wanted);
    }
    if !(goal.depth_mm > 0.0 && goal.depth_mm.is_finite()) {
        violations.add(format!("{field}.depth_mm"), "must be a positive number");
    }
    if goal.depth_tolerance.is_some_and(|share| !(0.0..=MAX_DEPTH_TOLERANCE).contains(&share)) {
        violations.add(format!("{field}.depth_tolerance"), format!("must be 0 to {MAX_DEPTH_TOLERANCE}"));
    }
}

/// Checks what is wanted; absent is the default.
pub fn improvement_goals_from_proto(
    violations: &mut Violations,
    field: &str,
    given: Option<&proto::ImprovementGoals>,
) -> RequestedGoals {
    let goals = given.cloned().unwrap_or_default();
    let mut within = |name: &str, value: Option<f64>, low: f64, high: f64| {
        if value.is_some_and(|value| !(low..=high).contains(&value)) {
            violations.add(format!("{field}.{name}"), format!("must be {low} to {high}"));
        }
    };
    within("margin", goals.margin, 1.0, MAX_MARGIN);
    within("speed_tolerance", goals.speed_tolerance, 0.0, MAX_SPEED_TOLERANCE);
    within("max_feed_override", goals.max_feed_override, 1.0, 2.0);
    let mut positive = |name: &str, value: Option<f64>, high: f64| {
        if value.is_some_and(|value| !(value > 0.0 && value <= high)) {
            violations.add(format!("{field}.{name}"), format!("must be a positive number, at most {high}"));
        }
    };
    positive("min_frequency_hz", goals.min_frequency_hz, 1e6);
    positive("max_frequency_hz", goals.max_frequency_hz, 1e6);
    positive("min_spindle_rev_per_min", goals.min_spindle_rev_per_min, MAX_SPINDLE_REV_PER_MIN);
    positive("max_spindle_rev_per_min", goals.max_spindle_rev_per_min, MAX_SPINDLE_REV_PER_MIN);
    positive("max_feed_per_rev_mm", goals.max_feed_per_rev_mm, MAX_FEED_PER_REV_MM);
    positive("max_tolerance_mm", goals.max_tolerance_mm, feedwave_program::MAX_PATH_TOLERANCE_MM);
    let mut pair = |what: &str, low: Option<f64>, high: Option<f64>| match (low, high) {
        (Some(low), Some(high)) if low > high => {
            violations.add(format!("{field}.max_{what}"), format!("is less than min_{what}, {low}"));
        }
        (Some(_), None) => violations.add(format!("{field}.max_{what}"), format!("must be set with min_{what}")),
        (None, Some(_)) => violations.add(format!("{field}.min_{what}"), format!("must be set with max_{what}")),
        _ => {}
    };
    pair("frequency_hz", goals.min_frequency_hz, goals.max_frequency_hz);
    pair("spindle_rev_per_min", goals.min_spindle_rev_per_min, goals.max_spindle_rev_per_min);
    if let Some(stability) = &goals.stability {
        check_stability(violations, &format!("{field}.stability"), stability);
    }
    RequestedGoals(goals)
}

/// What came of improving a program, for these goals.
#[must_use]
pub fn improvement_to_proto(improvement: &Improvement, goals: &ImprovementGoals) -> proto::Improvement {
    proto::Improvement {
        steps: improvement.steps.iter().map(step).collect(),
        changes: improvement.changes.iter().map(word_change).collect(),
        before: Some(bounded_report(&improvement.before, MAX_PAIRED_REPORT_BYTES)),
        after: Some(bounded_report(&improvement.after, MAX_PAIRED_REPORT_BYTES)),
        sections_not_judged: improvement.sections_not_judged(),
        holds: improvement.holds(),
        program_bytes: improvement.program.len() as u64,
        goals: Some(goals_to_proto(goals)),
    }
}

fn goals_to_proto(goals: &ImprovementGoals) -> proto::ImprovementGoals {
    let ends = |range: Option<[f64; 2]>| (range.map(|it| it[0]), range.map(|it| it[1]));
    let SearchGoals { margin, speed_tolerance, max_feed_override, frequency_hz } = goals.vibration;
    let (min_frequency_hz, max_frequency_hz) = ends(frequency_hz);
    let (min_spindle_rev_per_min, max_spindle_rev_per_min) = ends(goals.spindle_rev_per_min);
    proto::ImprovementGoals {
        margin: Some(margin),
        speed_tolerance: Some(speed_tolerance),
        min_frequency_hz,
        max_frequency_hz,
        max_feed_override: Some(max_feed_override),
        least_amplitude: goals.least_amplitude,
        min_spindle_rev_per_min,
        max_spindle_rev_per_min,
        max_feed_per_rev_mm: goals.max_feed_per_rev_mm,
        max_tolerance_mm: goals.max_tolerance_mm,
        stability: goals.stability.as_ref().map(|goal| proto::StabilityGoal {
            lobes: None,
            depth_mm: goal.depth_mm,
            depth_tolerance: Some(goal.depth_tolerance),
        }),
    }
}

fn step(step: &ImprovementStep) -> proto::ImprovementStep {
    let kind = match step.kind {
        ImprovementKind::Vibration => proto::ImprovementKind::Vibration,
        ImprovementKind::SpindleSpeed => proto::ImprovementKind::SpindleSpeed,
        ImprovementKind::Feed => proto::ImprovementKind::Feed,
        ImprovementKind::ThreadPass => proto::ImprovementKind::ThreadPass,
        ImprovementKind::Tolerance => proto::ImprovementKind::Tolerance,
    };
    let outcome = match step.outcome {
        ImprovementOutcome::Stays => proto::ImprovementOutcome::Stays,
        ImprovementOutcome::Changed => proto::ImprovementOutcome::Changed,
        ImprovementOutcome::NotPossible => proto::ImprovementOutcome::NotPossible,
    };
    let figure = |figure: &feedwave_cutting::ImprovementFigure| proto::ImprovementFigure {
        name: figure.name.clone().into_owned(),
        before: figure.before,
        after: figure.after,
        unit: figure.unit.to_owned(),
    };
    proto::ImprovementStep {
        line: step.line,
        kind: kind.into(),
        subject: step.subject.clone(),
        outcome: outcome.into(),
        reason: step.reason.clone(),
        changes: step.changes.iter().map(word_change).collect(),
        figures: step.figures.iter().map(figure).collect(),
    }
}

fn word_change(change: &WordChange) -> proto::WordChange {
    let span = change.span;
    proto::WordChange {
        line: span.line,
        column: span.column,
        length: span.length,
        old: change.old.clone(),
        new: change.new.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn goals_are_checked_in_one_pass_and_absent_ones_have_defaults() {
        let mut violations = Violations::default();
        let given = proto::ImprovementGoals {
            margin: Some(0.5),
            speed_tolerance: Some(f64::NAN),
            min_frequency_hz: Some(80.0),
            max_frequency_hz: Some(30.0),
            max_spindle_rev_per_min: Some(-1.0),
            max_tolerance_mm: Some(1e9),
            stability: Some(proto::StabilityGoal {
                depth_mm: -1.0,
                depth_tolerance: Some(0.9),
                ..proto::StabilityGoal::default()
            }),
            ..proto::ImprovementGoals::default()
        };
        improvement_goals_from_proto(&mut violations, "goals", Some(&given));
        let text = format!("{violations:?}");
        for field in [
            "margin",
            "speed_tolerance",
            "max_frequency_hz",
            "min_spindle_rev_per_min",
            "max_spindle_rev_per_min",
            "max_tolerance_mm",
            "stability.lobes.chart",
            "stability.depth_mm",
            "stability.depth_tolerance",
        ] {
            assert!(text.contains(&format!("goals.{field}")), "{field} is not in {text}");
        }
        let mut violations = Violations::default();
        let profile = MachineProfile::lathe();
        let goals = improvement_goals_from_proto(&mut violations, "goals", None).on(&profile);
        let stated = goals_to_proto(&goals);
        assert_eq!((stated.margin, stated.speed_tolerance), (Some(1.1), Some(0.02)));
        assert_eq!(stated.max_feed_override, Some(profile.max_feed_override));
        assert_eq!(improvement_goals_from_proto(&mut violations, "goals", Some(&stated)).on(&profile), goals);
    }
}
