//! What the pictures of the chips of vibrating sections show.

use std::collections::HashSet;

use feedwave_cutting::{CutCondition, SectionReport, ValidationReport};
use feedwave_plot::{Cut, Plots};

use super::super::terminal::number;

/// Pictures of chips at most: sections of one program are mostly alike.
const MAX_CHIP_PICTURES: usize = 8;

/// Adds a picture for each cut that is another.
pub(super) fn prepare(plots: &mut Plots, report: &ValidationReport) {
    let mut drawn = HashSet::new();
    for section in &report.sections {
        let Some((subtitle, cuts)) = cuts(section) else { continue };
        let headings: Vec<_> = cuts.iter().map(|cut| cut.heading.clone()).collect();
        if drawn.len() < MAX_CHIP_PICTURES && drawn.insert(headings) {
            plots.add_chip(format!("chip-line-{}", section.first_line), subtitle, cuts);
        }
    }
}

/// The programmed cut and, where it does not break the chip, the suggested one.
fn cuts(section: &SectionReport) -> Option<(String, Vec<Cut>)> {
    let chip = section.chip.as_ref()?;
    let condition = chip.condition;
    let subtitle = format!(
        "lines {} to {} \u{b7} {} rev/min \u{b7} feed {} mm/rev",
        section.first_line,
        section.last_line,
        number(condition.spindle_rev_per_min, 5),
        number(condition.feed_per_rev_mm, 4)
    );
    let mut cuts = vec![cut("programmed", condition)];
    if !chip.broken
        && let Some(&frequency_hz) = chip.recommended_frequencies_hz.first()
    {
        let mut suggested = CutCondition { frequency_hz, ..condition };
        if !suggested.breaks_chip() {
            // At half-integer D half the feed is enough; a little more breaks it with certainty.
            suggested.amplitude_mm = 0.6 * condition.feed_per_rev_mm;
        }
        cuts.push(cut("suggested", suggested));
    }
    Some((subtitle, cuts))
}

fn cut(which: &str, condition: CutCondition) -> Cut {
    let broken = condition.breaks_chip();
    let heading = format!(
        "{which}: {} Hz, amplitude {} mm",
        number(condition.frequency_hz, 5),
        number(condition.amplitude_mm, 3)
    );
    let per_rev = format!("{:.3} vibrations per revolution", condition.vibrations_per_rev());
    let margin = condition.breaking_margin();
    let verdict = if broken {
        format!("{per_rev}: the chip breaks")
    } else if margin == 0.0 {
        format!("{per_rev}: in phase, no amplitude breaks the chip")
    } else {
        format!("{per_rev}: the amplitude is {} % of what breaks the chip", number(margin * 100.0, 2))
    };
    Cut { heading, verdict, condition }
}
