//! What a report says of the sections of one line, and whether one is worse than another.

use feedwave_program::{Finding, Severity};

use super::vibration::search;
use crate::shared::wording::decimal;
use crate::{FoundVibration, PipelineConfig, SearchGoals, SectionReport, ValidationReport, VibrationSearch};

/// By which share a margin may miss what is wanted, where words are rounded.
pub(super) const ROUNDING: f64 = 1e-6;

/// Share of the amplitude that the drives bring to the tool, where least of it arrives.
pub(super) fn followed(sections: &[&SectionReport]) -> f64 {
    sections.iter().map(|section| section.followed_share()).fold(1.0, f64::min)
}

/// Share of the amplitude that arrives at the chip at the largest override, past the drives and the blends.
pub(super) fn arriving(sections: &[&SectionReport], goals: &SearchGoals) -> f64 {
    followed(sections) * reached(sections, goals)
}

/// Share of the amplitude that the blends let through, where least of it passes.
pub(super) fn reached(sections: &[&SectionReport], goals: &SearchGoals) -> f64 {
    sections.iter().map(|section| section.reached_share(goals.max_feed_override)).fold(1.0, f64::min)
}

/// How far beyond breaking the worst chip is, at the largest override and the worst speed of the tolerance.
pub(super) fn margin(search: &VibrationSearch, vibration: FoundVibration) -> f64 {
    let least = search.least_amplitude_mm(vibration.frequency_hz);
    least.map_or(0.0, |least_mm| search.margin * vibration.amplitude_mm / least_mm)
}

/// Largest share of a limit that an axis of these sections needs.
pub(super) fn utilisation(sections: &[&SectionReport]) -> f64 {
    sections.iter().flat_map(|section| &section.axes).map(|axis| axis.utilisation).fold(0.0, f64::max)
}

/// A vibration as text.
pub(super) fn vibration_text(it: FoundVibration) -> String {
    format!("{} Hz, {} mm", decimal(it.frequency_hz, 4), decimal(it.amplitude_mm, 5))
}

/// A vibration with the margin that it is to have, and the share that arrived before.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    pub(super) found: FoundVibration,
    pub(super) margin: f64,
    pub(super) arriving: f64,
}

/// Why a changed vibration of a line does not hold in the validated program; `None` where it does.
pub(super) fn fault(
    line: u32,
    wanted: &Wanted,
    before: &ValidationReport,
    after: &ValidationReport,
    config: &PipelineConfig,
    goals: &SearchGoals,
) -> Option<String> {
    let sections: Vec<_> = after.sections.iter().filter(|section| section.on_line == line).collect();
    let found = wanted.found;
    let vibration = format!("{} Hz with {} mm", decimal(found.frequency_hz, 4), decimal(found.amplitude_mm, 5));
    if sections.is_empty() {
        return Some(format!("{vibration} would end the section before it begins"));
    }
    let worse = worse_in(&sections, before, after);
    // What a permission of the machine lets pass, such as the published form, is no refusal.
    let refused = after.findings.iter().any(|finding| finding.severity == Severity::Error);
    if refused && sections.iter().any(|section| !section.feasible) {
        let reason = worse.unwrap_or_else(|| "an axis cannot follow it".to_owned());
        return Some(format!("{vibration} would be refused: {reason}"));
    }
    let arriving = arriving(&sections, goals);
    if wanted.margin / wanted.arriving * arriving < goals.margin * (1.0 - ROUNDING) {
        let percent = decimal(100.0 * arriving, 1);
        return Some(format!(
            "of {vibration} {} would bring {percent} % to the chip, too little for the margin",
            if reached(&sections, goals) < 1.0 { "drives and blends" } else { "the drives" }
        ));
    }
    if let Some(worse) = worse {
        return Some(format!("{vibration} would be worse in another way: {worse}"));
    }
    // What blends at junctions leave unbroken is judged as a finding.
    let breaks = |section: &&SectionReport| {
        !section.is_kept_whole_by_blends() && section.chip_spans.iter().all(|span| span.broken)
    };
    let breaks = sections.iter().all(breaks);
    let margin = margin_of(&sections, config, goals);
    (!breaks || margin < goals.margin * (1.0 - ROUNDING)).then(|| {
        format!(
            "{vibration} would leave a margin of {} where {} is wanted",
            decimal(margin, 4),
            decimal(goals.margin, 4)
        )
    })
}

/// How far beyond breaking the worst chip of these sections is with the vibration that they have, with what arrives of it; 0 where
/// that cannot be said.
pub(super) fn margin_of(sections: &[&SectionReport], config: &PipelineConfig, goals: &SearchGoals) -> f64 {
    let Some(condition) = sections.first().map(|section| section.condition) else { return 0.0 };
    let vibration = FoundVibration { frequency_hz: condition.frequency_hz, amplitude_mm: condition.amplitude_mm };
    let arriving = arriving(sections, goals);
    search(sections, arriving, config, goals).map_or(0.0, |search| arriving * margin(&search, vibration))
}

/// What validation says of the lines of these sections and did not say before, or of which the first number was smaller.
fn worse_in(sections: &[&SectionReport], before: &ValidationReport, after: &ValidationReport) -> Option<String> {
    let is_there = |finding: &Finding| {
        let line = finding.span.line;
        let of = |section: &&SectionReport| {
            line == section.on_line || (section.first_line..=section.last_line).contains(&line)
        };
        finding.span.program == 0 && sections.iter().any(of)
    };
    // How sure the chip has to be, with what arrives, is judged by the goals; how much of the path breaks, by what did before.
    let lines: Vec<u32> = sections.iter().map(|section| section.on_line).collect();
    let breaks_no_less = broken_mm(after, &lines) >= broken_mm(before, &lines) * (1.0 - ROUNDING);
    let by_goals = |finding: &Finding| {
        let name = finding.code.name();
        name.starts_with("VIB-CHIP-")
            || name == "VIB-FOLLOWING-LOSS"
            || (name == "VIB-PARTLY-UNBROKEN" && breaks_no_less)
    };
    worse(before, after, |finding| is_there(finding) && !by_goals(finding))
}

/// Length on which the sections of these lines break the chip, mm.
fn broken_mm(report: &ValidationReport, lines: &[u32]) -> f64 {
    let of = report.sections.iter().filter(|section| lines.contains(&section.on_line));
    of.map(|section| section.broken_share.unwrap_or(0.0) * section.length_mm).sum()
}

/// The first warning or error of these that validation did not give before, or of which the first number was smaller.
pub(super) fn worse(
    before: &ValidationReport,
    after: &ValidationReport,
    counts: impl Fn(&Finding) -> bool,
) -> Option<String> {
    let judged = |finding: &Finding| finding.values.first().map_or(0.0, |value| value.value.abs());
    let is_worse = |finding: &&Finding| {
        let same = |known: &&Finding| {
            known.code == finding.code
                && known.span.program == finding.span.program
                && known.span.line == finding.span.line
        };
        before.findings.iter().find(same).is_none_or(|known| judged(finding) > judged(known) * (1.0 + ROUNDING))
    };
    let mut grave = after.findings.iter().filter(|finding| finding.severity != Severity::Info && counts(finding));
    grave.find(is_worse).map(|finding| format!("{}, {}", finding.code, finding.message))
}
