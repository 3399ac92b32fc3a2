//! What changed and why, what did not, and the program before and after, as text.

use std::fmt::Write as _;

use feedwave_contract::convert::report_to_proto;
use feedwave_cutting::{FoundVibration, SearchGoals, ValidationReport};

use super::plan::{Outcome, Section};
use crate::commands::report::suggestions_of_motion;
use crate::commands::terminal::{counted, number};

/// The report.
pub(super) fn report(
    sections: &[Section],
    before: &ValidationReport,
    after: &ValidationReport,
    goals: &SearchGoals,
    changes: usize,
) -> String {
    let mut text = format!("{}\n", heading(sections, changes));
    if !sections.is_empty() {
        let _ = writeln!(text, "wanted: {}", wanted(goals));
    }
    for section in sections {
        text.push_str(&of_section(section, after));
    }
    let not_judged = not_judged(before);
    if not_judged > 0 {
        let _ = writeln!(
            text,
            "\n{} not judged, as a report lists {} at most: divide the program. The figures below are of those that are listed",
            counted(not_judged, "section"),
            before.sections.len()
        );
    }
    text.push_str(&comparison(before, after));
    let suggestions = suggestions_of_motion(&report_to_proto(after));
    if !suggestions.is_empty() {
        text.push_str("\nwould save time, and is left to you, as it changes the path or the machine:\n");
        for suggestion in suggestions {
            let _ = writeln!(text, "  {suggestion}");
        }
    }
    text
}

/// Sections that the report counts and does not list.
pub(super) fn not_judged(report: &ValidationReport) -> u64 {
    report.summary.section_count.saturating_sub(report.sections.len() as u64)
}

fn heading(sections: &[Section], changes: usize) -> String {
    let missed = sections.iter().filter(|section| matches!(section.outcome, Outcome::NotPossible(_))).count();
    let missed = if missed == 0 {
        String::new()
    } else {
        format!("; {} could not be made to hold", counted(missed as u64, "vibration"))
    };
    match changes {
        0 => format!("nothing is changed{missed}"),
        _ => format!("{} changed{missed}", counted(changes as u64, "word")),
    }
}

fn wanted(goals: &SearchGoals) -> String {
    format!(
        "every chip breaks with a margin of {}, up to {} % of the feed and with the spindle within {} % of its speed",
        number(goals.margin, 4),
        number(100.0 * goals.max_feed_override, 4),
        number(100.0 * goals.speed_tolerance, 3)
    )
}

fn vibration(it: FoundVibration) -> String {
    format!("{} Hz, {} mm", number(it.frequency_hz, 6), number(it.amplitude_mm, 4))
}

fn of_section(section: &Section, after: &ValidationReport) -> String {
    let Section { line, programmed, margin, utilisation, outcome, .. } = section;
    match outcome {
        Outcome::Holds => {
            format!("\nline {line}: {} stays: margin {}\n", vibration(*programmed), number(*margin, 4))
        }
        Outcome::NotPossible(reason) => {
            format!("\nline {line}: {} does not hold and stays: {reason}\n", vibration(*programmed))
        }
        Outcome::Changed { found, margin: reached, changes } => {
            let words = changes.iter().map(|change| format!("{} becomes {}", change.word.text, change.new));
            let mut text = format!("\nline {line}: {}\n", words.collect::<Vec<_>>().join(", "));
            let why = if *margin < 1.0 {
                "the chip does not break everywhere".to_owned()
            } else {
                format!("the chip breaks with a margin of {}", number(*margin, 4))
            };
            let _ = writeln!(text, "  reason: at {} {why}", vibration(*programmed));
            let axes = after.sections.iter().filter(|it| it.on_line == *line).flat_map(|section| &section.axes);
            let largest = axes.map(|axis| axis.utilisation).fold(0.0, f64::max);
            let _ = writeln!(
                text,
                "  gain: margin {} to {}, amplitude {} to {} mm, largest axis load {} to {} % of a limit",
                number(*margin, 4),
                number(*reached, 4),
                number(programmed.amplitude_mm, 4),
                number(found.amplitude_mm, 4),
                number(100.0 * utilisation, 3),
                number(100.0 * largest, 3)
            );
            text
        }
    }
}

/// Figures of the whole program, before and after.
fn comparison(before: &ValidationReport, after: &ValidationReport) -> String {
    let share = |report: &ValidationReport| {
        let judged = report.sections.iter().filter_map(|section| Some((section.broken_share?, section.length_mm)));
        let (broken, length) = judged.fold((0.0, 0.0), |sum, (share, mm)| (sum.0 + share * mm, sum.1 + mm));
        if length > 0.0 { format!("{} %", number(100.0 * broken / length, 4)) } else { "-".to_owned() }
    };
    let at_most = |report: &ValidationReport| {
        let margins = report.sections.iter().filter_map(|section| section.at_max_feed_override);
        let least = margins.map(|it| it.breaking_margin).reduce(f64::min);
        least.map_or_else(|| "-".to_owned(), |least| number(least, 4))
    };
    let load = |report: &ValidationReport| {
        let axes = report.sections.iter().flat_map(|section| &section.axes).map(|axis| axis.utilisation);
        axes.reduce(f64::max).map_or_else(|| "-".to_owned(), |most| format!("{} %", number(100.0 * most, 3)))
    };
    let time = |report: &ValidationReport| format!("{} s", number(report.summary.duration_s, 5));
    let warnings = |report: &ValidationReport| report.summary.warnings.to_string();
    type Figure<'a> = (&'a str, &'a dyn Fn(&ValidationReport) -> String);
    let rows: [Figure<'_>; 5] = [
        ("vibrating path with broken chips", &share),
        ("least margin at the largest override", &at_most),
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
