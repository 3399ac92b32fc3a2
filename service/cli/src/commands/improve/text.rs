//! What changed and why, what did not, and the program before and after, as text.

use std::fmt::Write as _;

use feedwave_contract::proto::{
    Improvement, ImprovementFigure, ImprovementGoals, ImprovementKind, ImprovementOutcome, ImprovementStep,
    ValidationReport,
};

use crate::commands::report::suggestions_of_motion;
use crate::commands::terminal::{counted, number};

/// The report.
pub(super) fn report(improvement: &Improvement) -> String {
    let (Some(before), Some(after)) = (&improvement.before, &improvement.after) else { return String::new() };
    let mut text = format!("{}\n", heading(improvement));
    let is_of_vibration =
        |step: &ImprovementStep| matches!(step.kind(), ImprovementKind::Vibration | ImprovementKind::SpindleSpeed);
    if let Some(goals) = improvement.goals.as_ref().filter(|_| improvement.steps.iter().any(is_of_vibration)) {
        let _ = writeln!(text, "wanted: {}", wanted(goals));
        let _ = writeln!(text, "{}", stability(goals));
    }
    for step in &improvement.steps {
        text.push_str(&of_step(step));
    }
    let not_judged = improvement.sections_not_judged;
    if not_judged > 0 {
        let _ = writeln!(
            text,
            "\n{} not judged, as a report lists {} at most: divide the program. The figures below are of those that are listed",
            counted(not_judged, "section"),
            before.sections.len()
        );
    }
    text.push_str(&comparison(before, after));
    let suggestions = suggestions_of_motion(after);
    if !suggestions.is_empty() {
        text.push_str("\nwould save time, and is left to you, as it changes the path or the machine:\n");
        for suggestion in suggestions {
            let _ = writeln!(text, "  {suggestion}");
        }
    }
    text
}

fn heading(improvement: &Improvement) -> String {
    let missed = improvement.steps.iter().filter(|step| step.outcome() == ImprovementOutcome::NotPossible);
    let (passes, vibrations): (Vec<_>, Vec<_>) = missed.partition(|step| step.kind() == ImprovementKind::ThreadPass);
    let mut text = match improvement.changes.len() {
        0 => "nothing is changed".to_owned(),
        changes => format!("{} changed", counted(changes as u64, "word")),
    };
    for (missed, what) in [(vibrations.len(), "vibration"), (passes.len(), "threading pass")] {
        if missed > 0 {
            let _ = write!(text, "; {} could not be made to hold", counted(missed as u64, what));
        }
    }
    text
}

fn wanted(goals: &ImprovementGoals) -> String {
    format!(
        "every chip breaks with a margin of {}, up to {} % of the feed and with the spindle within {} % of its speed, by a vibration \
         that leaves the feed a tenth of every axis' acceleration and jerk; margins below are the least within all that",
        number(goals.margin(), 4),
        number(100.0 * goals.max_feed_override(), 4),
        number(100.0 * goals.speed_tolerance(), 3)
    )
}

fn stability(goals: &ImprovementGoals) -> String {
    let Some(goal) = &goals.stability else {
        return "stability is not judged: no lobes are given".to_owned();
    };
    format!(
        "every cut is stable at a depth of {} mm \u{b1} {} %; margins of stability are the limit over the largest depth, at the worst speed \
         of the tolerance",
        number(goal.depth_mm, 4),
        number(100.0 * goal.depth_tolerance(), 3)
    )
}

fn of_step(step: &ImprovementStep) -> String {
    let ImprovementStep { line, subject, reason, .. } = step;
    match step.outcome() {
        ImprovementOutcome::Changed => {}
        ImprovementOutcome::NotPossible => {
            return format!("\nline {line}: {subject} does not hold and stays: {reason}\n");
        }
        _ => return format!("\nline {line}: {subject} stays: {reason}\n"),
    }
    let words = step.changes.iter().map(|change| format!("{} becomes {}", change.old, change.new));
    let mut text = format!("\nline {line}: {}\n  reason: {reason}\n", words.collect::<Vec<_>>().join(", "));
    let figures = step.figures.iter().map(figure);
    let _ = writeln!(text, "  gain: {}", figures.collect::<Vec<_>>().join(", "));
    text
}

fn figure(figure: &ImprovementFigure) -> String {
    let ImprovementFigure { name, before, after, unit } = figure;
    let gap = if unit.is_empty() { "" } else { " " };
    format!("{name} {} to {}{gap}{unit}", number(*before, 4), number(*after, 4))
}

/// Figures of the whole program, before and after.
fn comparison(before: &ValidationReport, after: &ValidationReport) -> String {
    let share = |report: &ValidationReport| {
        let judged = report.sections.iter().filter_map(|section| Some((section.broken_share?, section.length_mm)));
        let (broken, length) = judged.fold((0.0, 0.0), |sum, (share, mm)| (sum.0 + share * mm, sum.1 + mm));
        if length > 0.0 { format!("{} %", number(100.0 * broken / length, 4)) } else { "-".to_owned() }
    };
    let load = |report: &ValidationReport| {
        let axes = report.sections.iter().flat_map(|section| &section.axes).map(|axis| axis.utilisation);
        axes.reduce(f64::max).map_or_else(|| "-".to_owned(), |most| format!("{} %", number(100.0 * most, 3)))
    };
    let summary = |report: &ValidationReport| report.summary.clone().unwrap_or_default();
    let time = |report: &ValidationReport| format!("{} s", number(summary(report).duration_s, 5));
    let warnings = |report: &ValidationReport| summary(report).warnings.to_string();
    type Figure<'a> = (&'a str, &'a dyn Fn(&ValidationReport) -> String);
    let rows: [Figure<'_>; 4] = [
        ("vibrating path with broken chips", &share),
        ("largest load of an axis that vibrates", &load),
        ("machining time", &time),
        ("warnings", &warnings),
    ];
    let mut text = format!("\n{:<40}{:>12}{:>12}\n", "", "before", "after");
    for (name, figure) in rows {
        let _ = writeln!(text, "{name:<40}{:>12}{:>12}", figure(before), figure(after));
    }
    text
}
