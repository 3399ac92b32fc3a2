//! Which words change, and why.

use std::collections::BTreeMap;

use feedwave_cutting::{
    FoundVibration, PipelineConfig, SearchGoals, SectionReport, Unsearchable, ValidationReport, VibrationSearch,
};
use feedwave_program::{Finding, Severity};

use super::edit::{FunctionBlock, Word};
use super::unique_lines;
use crate::commands::terminal::number;

/// By which share a margin may miss what is wanted, where words are rounded.
const ROUNDING: f64 = 1e-6;
/// Decimals of a frequency, Hz.
const FREQUENCY_DECIMALS: i32 = 3;
/// Decimals of an amplitude in mm, and in inches.
const AMPLITUDE_DECIMALS: [i32; 2] = [4, 5];
const MM_PER_INCH: f64 = 25.4;

/// A word that changes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Change {
    pub(super) word: Word,
    pub(super) new: String,
}

/// All that one block switches on.
#[derive(Clone, Debug)]
pub(super) struct Section {
    /// The line of the block.
    pub(super) line: u32,
    /// The vibration as programmed.
    pub(super) programmed: FoundVibration,
    /// How far beyond breaking the worst chip is, at the largest override and the worst speed of the tolerance, with what arrives.
    pub(super) margin: f64,
    /// Largest share of a limit that an axis needs.
    pub(super) utilisation: f64,
    /// Share of the amplitude that arrives at the tool, where least of it does.
    pub(super) arriving: f64,
    pub(super) outcome: Outcome,
}

/// What becomes of it.
#[derive(Clone, Debug)]
pub(super) enum Outcome {
    /// It does what is wanted.
    Holds,
    /// It is changed.
    Changed {
        /// The vibration that it becomes.
        found: FoundVibration,
        /// The margin by the same measure.
        margin: f64,
        changes: Vec<Change>,
    },
    /// What is wanted does not hold, for this reason.
    NotPossible(String),
}

impl Section {
    /// The words that change.
    pub(super) fn changes(&self) -> &[Change] {
        match &self.outcome {
            Outcome::Changed { changes, .. } => changes,
            _ => &[],
        }
    }

    /// Takes the changes back; whether there were any.
    pub(super) fn take_back(&mut self, reason: &str) -> bool {
        let changed = !self.changes().is_empty();
        if changed {
            self.outcome = Outcome::NotPossible(reason.to_owned());
        }
        changed
    }

    /// Why the changes of this section do not hold in the validated program; `None` where they do or there are none.
    pub(super) fn fault(
        &self,
        before: &ValidationReport,
        after: &ValidationReport,
        goals: &SearchGoals,
    ) -> Option<String> {
        let Outcome::Changed { found, margin, .. } = &self.outcome else { return None };
        let sections: Vec<_> = after.sections.iter().filter(|section| section.on_line == self.line).collect();
        let vibration = format!("{} Hz with {} mm", number(found.frequency_hz, 6), number(found.amplitude_mm, 4));
        if sections.is_empty() {
            return Some(format!("{vibration} would end the section before it begins"));
        }
        let worse = worsened(&sections, before, after);
        // What a permission of the machine lets pass, such as the published form, is no refusal.
        let refused = after.findings.iter().any(|finding| finding.severity == Severity::Error);
        if refused && sections.iter().any(|section| !section.feasible) {
            let reason = worse.unwrap_or_else(|| "an axis cannot follow it".to_owned());
            return Some(format!("{vibration} would be refused: {reason}"));
        }
        let arriving = arriving(&sections);
        if margin / self.arriving * arriving < goals.margin * (1.0 - ROUNDING) {
            let percent = number(100.0 * arriving, 3);
            return Some(format!(
                "of {vibration} the drives would bring {percent} % to the tool, too little for the margin"
            ));
        }
        if let Some(worse) = worse {
            return Some(format!("{vibration} would be worse in another way: {worse}"));
        }
        // Validation judges at the largest override of the machine and the programmed speed.
        let judged = sections.iter().filter_map(|section| section.at_max_feed_override);
        let comparable = judged.filter(|it| it.max_feed_override <= goals.max_feed_override);
        let least = comparable.map(|it| it.breaking_margin).fold(f64::INFINITY, f64::min);
        let breaks = sections.iter().all(|section| section.broken_share.is_none_or(|share| share >= 1.0));
        (!breaks || least < goals.margin * (1.0 - ROUNDING)).then(|| {
            format!(
                "{vibration} would leave a margin of {} where {} is wanted",
                number(least, 4),
                number(goals.margin, 4)
            )
        })
    }
}

/// Share of the amplitude that arrives at the tool, where least of it does.
fn arriving(sections: &[&SectionReport]) -> f64 {
    let share = |section: &&SectionReport| section.following.arriving_amplitude_mm / section.condition.amplitude_mm;
    sections.iter().map(share).filter(|share| share.is_finite()).fold(1.0, f64::min)
}

/// What validation says of the lines of these sections and did not say before, or of which the first number was smaller.
fn worsened(sections: &[&SectionReport], before: &ValidationReport, after: &ValidationReport) -> Option<String> {
    let is_there = |finding: &&Finding| {
        let line = finding.span.line;
        let of = |section: &&SectionReport| {
            line == section.on_line || (section.first_line..=section.last_line).contains(&line)
        };
        finding.severity != Severity::Info && finding.span.program == 0 && sections.iter().any(of)
    };
    let judged = |finding: &Finding| finding.values.first().map_or(0.0, |value| value.value.abs());
    let is_worse = |finding: &&Finding| {
        let same = |known: &&Finding| known.code == finding.code && known.span.line == finding.span.line;
        before.findings.iter().find(same).is_none_or(|known| judged(finding) > judged(known) * (1.0 + ROUNDING))
    };
    // How sure the chip has to be, with what arrives, is judged by the goals.
    let by_goals = |finding: &&Finding| {
        let name = finding.code.name();
        name.starts_with("VIB-CHIP-") || name == "VIB-FOLLOWING-LOSS"
    };
    let found = after.findings.iter().filter(is_there).filter(|finding| !by_goals(finding)).find(is_worse);
    found.map(|finding| format!("{}, {}", finding.code, finding.message))
}

/// What is to be done for every block that switches a vibration on.
pub(super) fn sections(
    report: &ValidationReport,
    blocks: &[FunctionBlock],
    config: &PipelineConfig,
    goals: &SearchGoals,
    least_amplitude: bool,
) -> Vec<Section> {
    let mut by_line: BTreeMap<u32, Vec<&SectionReport>> = BTreeMap::new();
    for section in &report.sections {
        by_line.entry(section.on_line).or_default().push(section);
    }
    let unique = unique_lines(blocks);
    let of_line = |(line, sections): (u32, Vec<&SectionReport>)| {
        let block = blocks.iter().find(|block| block.line == line).filter(|_| unique.contains(&line));
        plan(line, &sections, block, config, goals, least_amplitude)
    };
    by_line.into_iter().map(of_line).collect()
}

fn plan(
    line: u32,
    sections: &[&SectionReport],
    block: Option<&FunctionBlock>,
    config: &PipelineConfig,
    goals: &SearchGoals,
    least_amplitude: bool,
) -> Section {
    let condition = sections[0].condition;
    let programmed = FoundVibration { frequency_hz: condition.frequency_hz, amplitude_mm: condition.amplitude_mm };
    let axes = sections.iter().flat_map(|section| &section.axes);
    let utilisation = axes.map(|axis| axis.utilisation).fold(0.0, f64::max);
    let arriving = arriving(sections);
    let section = |margin, outcome| Section { line, programmed, margin, utilisation, arriving, outcome };
    let not_possible = |margin, reason: &str| section(margin, Outcome::NotPossible(reason.to_owned()));
    if sections.iter().any(|section| section.condition != condition) {
        return not_possible(0.0, "the block switches on different vibrations, as its words are computed");
    }
    if arriving <= 0.0 {
        return not_possible(0.0, "the drives erase the vibration: nothing of it arrives at the tool");
    }
    // As much more is commanded as the drives lose.
    let commanded = SearchGoals { margin: goals.margin / arriving, ..*goals };
    let search = match VibrationSearch::of_sections(sections, &config.vibration(), &commanded) {
        Ok(search) => search,
        Err(reason) => return not_possible(0.0, unsearchable(reason)),
    };
    let margin = arriving * margin(&search, programmed);
    let suffices = margin >= goals.margin * (1.0 - ROUNDING);
    if suffices && !least_amplitude {
        return section(margin, Outcome::Holds);
    }
    let Some(found) = search.solve() else {
        let reason = "no vibration within the range of frequencies, the limits of the axes and of the profile breaks every chip so \
                      surely: a smaller feed, a smaller margin or tolerance, or another spindle speed would";
        return if suffices { section(margin, Outcome::Holds) } else { not_possible(margin, reason) };
    };
    let (Some(block), true) =
        (block, block.is_some_and(|block| block.frequency.is_some() && block.amplitude.is_some()))
    else {
        return not_possible(margin, "its F and A are not both written as numbers in one block, so no word is changed");
    };
    match rounded(&search, found, programmed, block, least_amplitude) {
        Some((_, changes)) if changes.is_empty() => section(margin, Outcome::Holds),
        Some((found, changes)) => {
            let after = arriving * self::margin(&search, found);
            section(margin, Outcome::Changed { found, margin: after, changes })
        }
        None => not_possible(margin, "what is enough cannot be written in the decimals of a word within the limits"),
    }
}

/// How far beyond breaking the worst chip is, at the largest override and the worst speed of the tolerance.
fn margin(search: &VibrationSearch, vibration: FoundVibration) -> f64 {
    let least = search.least_amplitude_mm(vibration.frequency_hz);
    least.map_or(0.0, |least_mm| search.margin * vibration.amplitude_mm / least_mm)
}

const fn unsearchable(reason: Unsearchable) -> &'static str {
    match reason {
        Unsearchable::NoCut => "nothing is cut with a turning spindle",
        Unsearchable::SurfaceSpeed => {
            "it is cut at constant surface speed, where the vibrations of a revolution change along the path and pass whole \
             numbers: a constant spindle speed (G97) would make one frequency right"
        }
        Unsearchable::TooManyCuts => "it has more different cuts than a report lists",
        Unsearchable::NoFrequency => "no frequency of the range is within the limits of the machine and the sampling",
    }
}

/// The vibration in the decimals of words, and the words; `None` where none of the rounded ones is enough within the limits. An
/// amplitude that is more than enough stays where only the frequency has to change.
fn rounded(
    search: &VibrationSearch,
    found: FoundVibration,
    programmed: FoundVibration,
    block: &FunctionBlock,
    least_amplitude: bool,
) -> Option<(FoundVibration, Vec<Change>)> {
    let unit_mm = if block.inch { MM_PER_INCH } else { 1.0 };
    let decimals = AMPLITUDE_DECIMALS[usize::from(block.inch)];
    let step = 10_f64.powi(-FREQUENCY_DECIMALS);
    let nearest = (found.frequency_hz / step).round();
    // The next ones where the nearest is just beyond a limit.
    let frequencies = [nearest, nearest - 1.0, nearest + 1.0].map(|steps| steps * step);
    let candidates = frequencies.into_iter().filter_map(|frequency_hz| {
        let least_mm = search.least_amplitude_mm(frequency_hz)?;
        let scale = 10_f64.powi(decimals);
        let rounded_mm = (least_mm / unit_mm * scale * (1.0 - 1e-12)).ceil() / scale * unit_mm;
        let keeps = !least_amplitude
            && programmed.amplitude_mm >= least_mm
            && programmed.amplitude_mm <= search.largest_amplitude_mm(frequency_hz);
        let amplitude_mm = if keeps { programmed.amplitude_mm } else { rounded_mm };
        search.suffices(frequency_hz, amplitude_mm).then_some(FoundVibration { frequency_hz, amplitude_mm })
    });
    let [low_hz, high_hz] = search.frequency_hz;
    let within = candidates.filter(|it| (low_hz - step..=high_hz + step).contains(&it.frequency_hz));
    let best = within.min_by(|a, b| a.amplitude_mm.total_cmp(&b.amplitude_mm))?;
    // No change that gains nothing: what is programmed is as good as can be written.
    if search.suffices(programmed.frequency_hz, programmed.amplitude_mm) && best.amplitude_mm >= programmed.amplitude_mm
    {
        return Some((programmed, Vec::new()));
    }
    let word = |word: &Option<Word>, old: f64, new: f64, letter: char, decimals: i32| {
        let text = format!("{letter}{}", decimal(new, decimals));
        let changes = (old - new).abs() > 0.5 * 10_f64.powi(-decimals - 3);
        word.clone().filter(|_| changes).map(|word| Change { word, new: text })
    };
    let frequency = word(&block.frequency, programmed.frequency_hz, best.frequency_hz, 'F', FREQUENCY_DECIMALS);
    let (old, new) = (programmed.amplitude_mm / unit_mm, best.amplitude_mm / unit_mm);
    let amplitude = word(&block.amplitude, old, new, 'A', decimals);
    Some((best, frequency.into_iter().chain(amplitude).collect()))
}

/// A number as a word has it, always with a decimal point: without one some controls count in least increments.
fn decimal(value: f64, decimals: i32) -> String {
    let text = format!("{value:.*}", usize::try_from(decimals).unwrap_or_default());
    let short = text.trim_end_matches('0');
    if short.ends_with('.') { format!("{short}0") } else { short.to_owned() }
}
