//! What is found about the chip of a section: whether it breaks, at which feed override, how surely, and what cures it.

use feedwave_program::Finding;

use super::chip::{ChipReport, FeedCoupling, SurfaceSpeedReport};
use super::code;
use super::findings::Evidence;
use crate::shared::wording::{decimal, round_down, round_up};

/// Share of the spindle speed within which it may stray in practice without notice.
const SPEED_MARGIN: f64 = 0.02;
impl Evidence {
    pub(super) fn chip(&self, findings: &mut Vec<Finding>) {
        if let Some(line) = self.stopped_line {
            let message =
                format!("the spindle is stopped still in line {line}: whether the chip breaks cannot be said");
            findings.push(
                Finding::new(code::VIB_SPINDLE_STOPPED, self.on_span, message)
                    .at("line", line.into())
                    .ranked("", 0.0)
                    .suggest("start the spindle before the section"),
            );
        }
        let (Some(chip), Some(line)) = (&self.report.chip, self.chip_line) else { return };
        let surface = self.report.surface_speed.as_ref();
        let partly = surface.filter(|surface| surface.broken_share < 1.0 && surface.broken_share > 0.0);
        let at_constant_speed = self.report.chip_spans.iter().any(|span| !span.broken);
        if let Some(surface) = partly
            && !at_constant_speed
        {
            findings.push(self.partly_unbroken(surface));
        } else if !chip.broken {
            findings.push(self.unbroken(chip, line));
        } else {
            self.marginal(chip, line, findings);
            findings.extend(self.unbroken_at_permitted_override());
        }
    }

    /// The chip is not cut through: integer D, or an amplitude too small for this D.
    fn unbroken(&self, chip: &ChipReport, line: u32) -> Finding {
        let cut = &chip.condition;
        let reason = match chip.min_amplitude_mm {
            None => format!(
                "makes D = {} vibrations per revolution, a whole number: every revolution follows the one before, and \
                 no amplitude breaks the chip",
                decimal(chip.vibrations_per_rev, 3)
            ),
            Some(least_mm) => format!(
                "makes D = {} vibrations per revolution, where the chip breaks from an amplitude of {} mm on, not {} mm",
                decimal(chip.vibrations_per_rev, 4),
                decimal(round_up(least_mm, 4), 4),
                decimal(cut.amplitude_mm, 4)
            ),
        };
        let share = self.report.broken_share.unwrap_or(0.0);
        let extent = if share > 0.0 {
            format!(" ({} % of the section breaks)", decimal(share * 100.0, 1))
        } else {
            String::new()
        };
        let under = match self.report.feed_override {
            Some(ratio) if ratio != 1.0 => {
                let feed_mm = decimal(cut.feed_per_rev_mm, 5);
                format!(" under the feed override of {} %, {feed_mm} mm/rev", percent(ratio))
            }
            _ => String::new(),
        };
        let message = format!(
            "the chip does not break in line {line}{under}: {} Hz at {} rev/min {reason}{extent}",
            decimal(cut.frequency_hz, 3),
            decimal(cut.spindle_rev_per_min, 1)
        );
        // An amplitude below f_r/2 breaks the chip at no frequency: it comes first then.
        let amplitude_first = chip.amplitude_ratio < 1.0;
        let span = if amplitude_first { self.amplitude_span() } else { self.frequency_cure(0.0).0 };
        let mut finding = Finding::new(code::VIB_CHIP_UNBROKEN, span, message)
            .at("line", line.into())
            .ranked("", -cut.breaking_margin())
            .with_value("vibrations_per_rev", chip.vibrations_per_rev, "")
            .with_value("amplitude_ratio", chip.amplitude_ratio, "")
            .with_value("feed_per_rev", cut.feed_per_rev_mm, "mm")
            .with_value("spindle_speed", cut.spindle_rev_per_min, "rev/min")
            .with_value("broken_share", share, "");
        if let Some(ratio) = self.report.feed_override.filter(|ratio| *ratio != 1.0) {
            finding = finding.with_value("feed_override", ratio, "");
        }
        if amplitude_first {
            finding = self.suggest_amplitude(finding, chip, true);
        }
        finding = suggest_speeds(self.suggest_frequencies(finding, chip, !amplitude_first), chip);
        let finding = if amplitude_first { finding } else { self.suggest_amplitude(finding, chip, false) };
        // At the programmed feed the override is not the cause.
        if self.report.feed_override == Some(1.0) { finding } else { self.suggest_override(finding) }
    }

    /// The chip breaks at every override of the plan, but not at the largest one that the machine permits.
    fn unbroken_at_permitted_override(&self) -> Option<Finding> {
        let permitted = self.report.at_max_feed_override.filter(|permitted| permitted.broken_share < 1.0)?;
        let top = percent(permitted.max_feed_override);
        let largest = permitted.largest_breaking_override.map(|ratio| round_down(ratio, 4));
        let breaking = match (largest, permitted.largest_breaking_feed_per_rev_mm) {
            (Some(largest), Some(feed_mm)) => format!(
                "up to a feed override of {} %, {} mm/rev",
                percent(largest),
                decimal(round_down(feed_mm, 5), 5)
            ),
            _ => "at the overrides of this plan".to_owned(),
        };
        let least_mm = permitted.min_amplitude_mm.map(|least_mm| round_up(least_mm, 4));
        let serving = least_mm.map_or_else(
            || format!("no amplitude up to the machine's {} mm is enough", decimal(self.settings.max_amplitude_mm, 4)),
            |least_mm| format!("an amplitude of {} mm is enough", decimal(least_mm, 4)),
        );
        let message = format!(
            "the chip in line {} breaks {breaking}, and the machine permits {top} %, where {serving}",
            permitted.line
        );
        let mut finding = Finding::new(code::VIB_CHIP_OVERRIDE, self.amplitude_span(), message)
            .at("line", permitted.line.into())
            .ranked("", -permitted.breaking_margin)
            .with_value("max_feed_override", permitted.max_feed_override, "")
            .with_value("breaking_margin", permitted.breaking_margin, "")
            .with_value("broken_share", permitted.broken_share, "");
        if let (Some(largest), Some(feed_mm)) = (largest, permitted.largest_breaking_feed_per_rev_mm) {
            finding = finding.with_value("largest_feed_override", largest, "").with_value(
                "largest_feed_per_rev",
                round_down(feed_mm, 5),
                "mm",
            );
        }
        if let Some(least_mm) = least_mm {
            finding = self.suggest_least_amplitude(finding, least_mm, true);
        }
        Some(self.suggest_override(finding))
    }

    /// What helps against an override beyond which the chip no longer breaks.
    fn suggest_override(&self, finding: Finding) -> Finding {
        let Some(permitted) = self.report.at_max_feed_override else { return finding };
        let programmed_breaks = permitted.largest_breaking_override.is_some_and(|largest| largest >= 1.0);
        let reach_mm = self.condition().amplitude_mm * permitted.max_feed_override;
        let mut finding = finding;
        if self.settings.amplitude_follows_feed_up_to.is_none()
            && programmed_breaks
            && reach_mm <= self.settings.max_amplitude_mm
        {
            let message = format!(
                "let the amplitude follow the feed: vibration.amplitude_follows_feed_up_to = {} in the machine profile",
                decimal(permitted.max_feed_override, 4)
            );
            finding = finding.suggest(message);
        }
        match permitted.largest_breaking_override.map(|largest| round_down(largest, 4)) {
            Some(largest) if largest >= 1.0 => {
                let message = format!(
                    "permit no feed override above {} %: max_feed_override = {} in the machine profile",
                    percent(largest),
                    decimal(largest, 4)
                );
                finding.suggest_value(message, None, "max_feed_override", largest, "")
            }
            // Whatever is programmed may be overridden up to what is permitted.
            Some(largest) if largest > 0.0 => {
                let ratio = round_down(largest / permitted.max_feed_override.max(1.0), 4);
                let message = format!("feed at most {} % of what is programmed", percent(ratio));
                finding.suggest_value(message, None, "feed_ratio", ratio, "")
            }
            _ => finding,
        }
    }

    fn suggest_frequencies(&self, mut finding: Finding, chip: &ChipReport, on_word: bool) -> Finding {
        let rev_per_s = chip.condition.spindle_rev_per_min / 60.0;
        let present = decimal(chip.condition.frequency_hz, 3);
        for &frequency_hz in &chip.recommended_frequencies_hz {
            let shown = decimal(frequency_hz, 3);
            // What is programmed already cures nothing.
            if frequency_hz > self.settings.max_frequency_hz || shown == present {
                continue;
            }
            let message = format!(
                "vibrate at {shown} Hz: D = {}, where {} mm suffice",
                decimal(frequency_hz / rev_per_s, 1),
                decimal(round_up(0.5 * chip.condition.feed_per_rev_mm, 4), 4)
            );
            let word = self.frequency_cure(frequency_hz).1.filter(|_| on_word);
            finding = finding.suggest_value(message, word, "frequency", frequency_hz, "Hz");
        }
        finding
    }

    fn suggest_amplitude(&self, finding: Finding, chip: &ChipReport, on_word: bool) -> Finding {
        // What has to be programmed for this cut, whose amplitude may have followed the feed; it is enough at every
        // permitted override as well, where one does.
        let followed = chip.condition.amplitude_mm / self.condition().amplitude_mm;
        let here_mm = chip.min_amplitude_mm.map(|least_mm| least_mm / followed);
        let everywhere_mm = self.report.at_max_feed_override.and_then(|permitted| permitted.min_amplitude_mm);
        let least_mm = here_mm.map(|here_mm| round_up(here_mm.max(everywhere_mm.unwrap_or(0.0)), 4));
        match least_mm.filter(|least_mm| *least_mm <= self.settings.max_amplitude_mm) {
            Some(least_mm) => self.suggest_least_amplitude(finding, least_mm, on_word),
            None => finding,
        }
    }

    fn suggest_least_amplitude(&self, finding: Finding, least_mm: f64, on_word: bool) -> Finding {
        let up_to = match self.report.at_max_feed_override {
            Some(permitted) if permitted.max_feed_override > 1.0 && permitted.min_amplitude_mm.is_some() => {
                format!(", enough up to a feed override of {} %", percent(permitted.max_feed_override))
            }
            _ => String::new(),
        };
        let message = format!("raise the amplitude to at least {} mm{up_to}", decimal(least_mm, 4));
        let word = self.amplitude_cure(least_mm).filter(|_| on_word);
        finding.suggest_value(message, word, "amplitude", least_mm, "mm")
    }

    /// The chip breaks, but a little more or less spindle speed ends that.
    fn marginal(&self, chip: &ChipReport, line: u32, findings: &mut Vec<Finding>) {
        let Some(tolerance) = chip.speed_tolerance else { return };
        let spindle_rev_per_min = chip.condition.spindle_rev_per_min;
        let above_rev_per_min = tolerance.plus_rev_per_min.unwrap_or(f64::INFINITY);
        let closest_rev_per_min = tolerance.minus_rev_per_min.min(above_rev_per_min);
        if closest_rev_per_min >= SPEED_MARGIN * spindle_rev_per_min {
            return;
        }
        let message = format!(
            "the chip breaks in line {line} only while the spindle holds {} rev/min within {} rev/min ({} %)",
            decimal(spindle_rev_per_min, 1),
            decimal(closest_rev_per_min, 1),
            decimal(closest_rev_per_min / spindle_rev_per_min * 100.0, 2)
        );
        let finding = Finding::new(code::VIB_CHIP_MARGINAL, self.frequency_cure(0.0).0, message)
            .at("line", line.into())
            .ranked("", -closest_rev_per_min / spindle_rev_per_min)
            .with_value("spindle_speed", spindle_rev_per_min, "rev/min")
            .with_value("speed_tolerance", closest_rev_per_min, "rev/min")
            .with_value("vibrations_per_rev", chip.vibrations_per_rev, "");
        findings.push(self.suggest_frequencies(finding, chip, true));
    }

    /// Constant surface speed leads D through whole numbers.
    fn partly_unbroken(&self, surface: &SurfaceSpeedReport) -> Finding {
        let unbroken_share = 1.0 - surface.broken_share;
        let first = surface.unbroken_spans.first();
        let example = first.map_or_else(String::new, |span| {
            format!(
                ", first in line {} from diameter {} to {} mm",
                span.first_line,
                decimal(span.start_diameter_mm, 3),
                decimal(span.end_diameter_mm, 3)
            )
        });
        let message = format!(
            "at constant surface speed the chip does not break on {} % of the path{example}",
            decimal(unbroken_share * 100.0, 1)
        );
        let span_count = surface.unbroken_spans.len() as u64 + surface.unbroken_spans_not_listed;
        Finding::new(code::VIB_PARTLY_UNBROKEN, self.on_span, message)
            .at("line", first.map_or(self.report.first_line, |span| span.first_line).into())
            .ranked("", unbroken_share)
            .with_value("unbroken_share", unbroken_share, "")
            .with_value("unbroken_spans", span_count as f64, "")
            .suggest("turn the section at a constant spindle speed (G97) with half-integer D")
            .suggest("raise the amplitude: the spans around whole D become narrower")
    }
}

/// Spindle speeds of half-integer D with the amplitude that is enough there: half the feed of a revolution, which a feed
/// per minute changes with the speed.
fn suggest_speeds(mut finding: Finding, chip: &ChipReport) -> Finding {
    let cut = &chip.condition;
    let present = decimal(cut.spindle_rev_per_min, 1);
    for &rev_per_min in &chip.recommended_spindle_rev_per_min {
        let shown = decimal(rev_per_min, 1);
        if shown == present {
            continue;
        }
        let feed_per_rev_mm = match cut.feed_coupling {
            FeedCoupling::PerRevolution => cut.feed_per_rev_mm,
            FeedCoupling::PerMinute => cut.feed_per_rev_mm * cut.spindle_rev_per_min / rev_per_min,
        };
        let message = format!(
            "turn the spindle at {shown} rev/min: D = {}, where {} mm suffice",
            decimal(60.0 * cut.frequency_hz / rev_per_min, 1),
            decimal(round_up(0.5 * feed_per_rev_mm, 4), 4)
        );
        finding = finding.suggest_value(message, None, "spindle_speed", rev_per_min, "rev/min");
    }
    finding
}

/// A factor as a percentage, never rounded up.
fn percent(ratio: f64) -> String {
    decimal(round_down(100.0 * ratio, 2), 2)
}
