//! What is found about the chip of a section: whether it breaks, at which feed override, how surely, and what cures it.

use feedwave_program::Finding;

use super::OverrideReport;
use super::chip::{ChipReport, SurfaceSpeedReport, reaches_through};
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
            && !self.report.is_kept_whole_by_blends()
        {
            findings.push(self.partly_unbroken(surface));
        } else if !chip.broken {
            findings.push(self.unbroken(chip, line));
        } else {
            self.marginal(chip, line, findings);
            findings.extend(self.unbroken_between_blends());
            findings.extend(self.unbroken_at_permitted_override());
        }
    }

    /// The chip is not cut through: integer D, or an amplitude too small for this D.
    fn unbroken(&self, chip: &ChipReport, line: u32) -> Finding {
        let cut = &chip.condition;
        let reason = match chip.min_amplitude_mm {
            Some(least_mm) if self.report.is_kept_whole_by_blends() => format!(
                "needs a steady amplitude of {} mm to break it, and the blends of {} mm at the ends of the section and of its \
                 parts let through {}",
                decimal(round_up(least_mm, 4), 4),
                decimal(self.report.ramp_mm.unwrap_or(0.0), 4),
                let_through(cut.amplitude_mm)
            ),
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
        let cures = self.chip_cures(chip);
        let message = format!(
            "the chip does not break in line {line}{under}: {} Hz at {} rev/min {reason}{extent}{}",
            decimal(cut.frequency_hz, 3),
            decimal(cut.spindle_rev_per_min, 1),
            cures.objections()
        );
        let mut finding = Finding::new(code::VIB_CHIP_UNBROKEN, self.span_of(&cures), message)
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
        let finding = self.suggest_chip_cures(finding, &cures);
        // At the programmed feed the override is not the cause.
        if self.report.feed_override == Some(1.0) { finding } else { self.suggest_override(finding) }
    }

    /// The blends inside of the section leave at least a whole revolution unbroken: a closed ring of chip, and more.
    fn unbroken_between_blends(&self) -> Option<Finding> {
        let (line, revolutions) = self.report.unbroken_between_blends()?;
        let blend = self.report.blend?;
        let unbroken_share = 1.0 - self.report.broken_share?;
        let message = format!(
            "the vibration is blended out and in at junctions inside of the section ({} of them): the chip does not break on {} % of the section beside its \
             first and last blend, and stays whole for up to {} revolutions ({} mm) from line {line} on",
            self.report.blended_junctions,
            decimal(unbroken_share * 100.0, 1),
            decimal(round_up(revolutions, 2), 2),
            decimal(blend.longest_unbroken_mm, 4)
        );
        let finding = Finding::new(code::VIB_PARTLY_UNBROKEN, self.on_span, message)
            .at("line", line.into())
            .ranked("", unbroken_share)
            .with_value("unbroken_share", unbroken_share, "")
            .with_value("longest_unbroken_revolutions", revolutions, "")
            .with_value("longest_unbroken", blend.longest_unbroken_mm, "mm");
        Some(finding.suggest(
            "round the corners with tangent arcs, which the vibration goes over; fewer corners leave less unbroken",
        ))
    }

    /// The chip breaks at every override of the plan, but not at the largest one that the machine permits.
    fn unbroken_at_permitted_override(&self) -> Option<Finding> {
        let permitted = self.report.at_max_feed_override;
        let permitted = permitted.filter(|it| it.blends_decide || !reaches_through(it.breaking_margin))?;
        if permitted.blends_decide {
            return self.blended_at_permitted_override(&permitted);
        }
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
        let amplitude = self.amplitude_tried();
        let serving = match &amplitude {
            Some((least_mm, None)) => format!("an amplitude of {} mm is enough", decimal(*least_mm, 4)),
            Some((least_mm, Some(objection))) => {
                format!("an amplitude of {} mm would be enough, but {objection}", decimal(*least_mm, 4))
            }
            None => "no amplitude is known to be enough".to_owned(),
        };
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
        if let Some((least_mm, None)) = amplitude {
            finding = self.suggest_amplitude(finding, least_mm, self.amplitude_cure(least_mm));
        }
        Some(self.suggest_override(finding))
    }

    /// At the largest override the blends let through too little for the chip to break anywhere, or leave more unbroken.
    fn blended_at_permitted_override(&self, permitted: &OverrideReport) -> Option<Finding> {
        if permitted.broken_share > 0.0 {
            return None;
        }
        let message = format!(
            "the chip breaks at the feed of the plan, and the machine permits {} %, where the blends of {} mm let through too \
             little amplitude for it to break anywhere",
            percent(permitted.max_feed_override),
            decimal(self.report.ramp_mm.unwrap_or(0.0), 4)
        );
        let finding = Finding::new(code::VIB_CHIP_OVERRIDE, self.on_span, message)
            .at("line", permitted.line.into())
            .ranked("", -permitted.breaking_margin)
            .with_value("max_feed_override", permitted.max_feed_override, "")
            .with_value("broken_share", permitted.broken_share, "");
        let finding = self.suggest_length(finding);
        Some(finding.suggest("permit less override (max_feed_override in the machine profile)"))
    }

    /// The chip breaks, but a little more or less spindle speed ends that.
    fn marginal(&self, chip: &ChipReport, line: u32, findings: &mut Vec<Finding>) {
        let Some(tolerance) = chip.spindle_speed_margin else { return };
        let spindle_rev_per_min = chip.condition.spindle_rev_per_min;
        let closest_rev_per_min = tolerance.closest_rev_per_min();
        if closest_rev_per_min >= SPEED_MARGIN * spindle_rev_per_min {
            return;
        }
        let share = closest_rev_per_min / spindle_rev_per_min * 100.0;
        let within = match decimal(closest_rev_per_min, 1) {
            none if none == "0" => "less than 0.1 rev/min".to_owned(),
            some => format!("{some} rev/min ({} %)", decimal(share, 2)),
        };
        let message = format!(
            "the chip breaks in line {line} only while the spindle holds {} rev/min within {within}",
            decimal(spindle_rev_per_min, 1)
        );
        let finding = Finding::new(code::VIB_CHIP_MARGINAL, self.frequency_cure(0.0).0, message)
            .at("line", line.into())
            .ranked("", -closest_rev_per_min / spindle_rev_per_min)
            .with_value("spindle_speed", spindle_rev_per_min, "rev/min")
            .with_value("spindle_speed_margin", closest_rev_per_min, "rev/min")
            .with_value("vibrations_per_rev", chip.vibrations_per_rev, "");
        findings.push(self.suggest_steady_frequencies(finding, chip, SPEED_MARGIN));
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

/// The steady amplitude that breaks as much as what the blends let through.
fn let_through(amplitude_mm: f64) -> String {
    match round_down(amplitude_mm, 6) {
        0.0 => "nothing of the vibration".to_owned(),
        amplitude_mm => format!("no more than one of {} mm over a whole vibration", decimal(amplitude_mm, 6)),
    }
}

/// A factor as a percentage, never rounded up.
pub(super) fn percent(ratio: f64) -> String {
    decimal(round_down(100.0 * ratio, 2), 2)
}
