//! From the evidence of a section to findings: one for each kind, with the numbers and what cures it. Sections of one switch
//! share its place: the findings' log counts them and keeps the worst.

use feedwave_motion::{LimitExceeded, Quantity};
use feedwave_program::{Finding, FindingCode, FindingLog, Severity, SourceSpan};

use super::chip::{ChipReport, CutCondition, SurfaceSpeedReport};
use super::code;
use super::following::FollowingModel;
use super::{
    AxisLoadReport, GenerationMode, SectionReport, VibrationCondition, VibrationEnvelope, VibrationSettings,
    VibrationWordSpans,
};
use crate::shared::wording::{decimal, round_down, round_up, word};

/// Samples per vibration period below which the wave counts as coarse (docs/functions/path-vibration.md, "Findings").
const FINE_SAMPLES: f64 = 8.0;
/// Share of the spindle speed within which it may stray in practice without notice.
const SPEED_MARGIN: f64 = 0.02;
/// Share of the amplitude that has to arrive at the tool.
const ARRIVING_SHARE: f64 = 0.9;

/// Everything known about a section at its end.
pub(super) struct Evidence {
    pub(super) report: SectionReport,
    pub(super) on_span: SourceSpan,
    pub(super) words: VibrationWordSpans,
    pub(super) settings: VibrationSettings,
    pub(super) following: FollowingModel,
    /// First element that the axes cannot follow, and its line.
    pub(super) exceeded: Option<(LimitExceeded, u32)>,
    pub(super) curve_line: Option<u32>,
    /// Line after the sharpest corner of a published vibration.
    pub(super) corner_line: Option<u32>,
    pub(super) chip_line: Option<u32>,
    pub(super) stopped_line: Option<u32>,
}

impl Evidence {
    /// Pushes the findings and completes the report.
    pub(super) fn conclude(mut self, log: &mut FindingLog) -> SectionReport {
        let mut findings = Vec::new();
        self.sampling(&mut findings);
        self.axes(&mut findings);
        self.travel(&mut findings);
        self.contour(&mut findings);
        self.junction(&mut findings);
        self.published_ends(&mut findings);
        self.chip(&mut findings);
        self.following(&mut findings);
        self.report.feasible = findings.iter().all(|finding| finding.severity != Severity::Error);
        for finding in findings {
            log.push(finding);
        }
        self.report
    }

    fn condition(&self) -> VibrationCondition {
        self.report.condition
    }

    /// The place to change the frequency, and its new word where the place is that word alone.
    fn frequency_cure(&self, frequency_hz: f64) -> (SourceSpan, Option<String>) {
        let word = self.words.frequency.map(|_| frequency_word(frequency_hz));
        (self.words.frequency.unwrap_or(self.on_span), word)
    }

    fn amplitude_span(&self) -> SourceSpan {
        self.words.amplitude.unwrap_or(self.on_span)
    }

    /// A new amplitude word, where the finding is at the old one and the amplitude can be written.
    fn amplitude_cure(&self, amplitude_mm: f64) -> Option<String> {
        self.words.amplitude.filter(|_| amplitude_mm > 0.0).map(|_| amplitude_word(amplitude_mm, self.words.inch))
    }

    fn sampling(&self, findings: &mut Vec<Finding>) {
        let frequency_hz = self.condition().frequency_hz;
        let sampling = &self.report.sampling;
        let samples = sampling.samples_per_vibration;
        // Limits are often met exactly, and 1/(f·Δt) is rounded.
        let is_below = |limit: f64| samples < limit * (1.0 - 1e-9);
        let fine_period_ms = 1_000.0 / (FINE_SAMPLES * frequency_hz);
        let servo_side = self.settings.generation_mode == GenerationMode::ServoSide;
        let with_values = |finding: Finding| {
            finding
                .with_value("frequency", frequency_hz, "Hz")
                .with_value("period", sampling.period_s, "s")
                .with_value("samples_per_vibration", samples, "")
                .with_value("peak_error", sampling.peak_error, "")
        };
        let suggest_period = |finding: Finding| {
            let message = format!("use a period of at most {} ms", decimal(fine_period_ms, 3));
            finding.suggest_value(message, None, "period", fine_period_ms / 1_000.0, "s")
        };
        let suggest_mode = |finding: Finding| {
            if servo_side {
                finding.suggest("generate more servo periods per interpolation period")
            } else {
                finding.suggest("use the servo-side mode, where the drive generates the wave on its own shorter period")
            }
        };
        let wave = format!(
            "{} Hz is sampled {} times per vibration at a period of {} ms",
            decimal(frequency_hz, 3),
            decimal(samples, 2),
            decimal(sampling.period_s * 1_000.0, 4)
        );
        if is_below(2.0) {
            let highest_hz = round_down(1.0 / (FINE_SAMPLES * sampling.period_s), 3);
            let (span, word) = self.frequency_cure(highest_hz);
            let message = format!("{wave}: below two samples another, slower wave would be cut");
            let finding = with_values(Finding::new(code::VIB_SAMPLING_NYQUIST, span, message));
            let cure = format!("use at most {} Hz at this period", decimal(highest_hz, 3));
            let finding = suggest_mode(suggest_period(finding));
            findings.push(finding.suggest_value(cure, word, "frequency", highest_hz, "Hz"));
        } else if is_below(FINE_SAMPLES) {
            let message = format!(
                "{wave}: up to {} % of its peak is lost between samples",
                decimal(sampling.peak_error * 100.0, 1)
            );
            let finding = with_values(Finding::new(code::VIB_SAMPLING_COARSE, self.on_span, message));
            findings.push(suggest_period(suggest_mode(finding)));
        }
    }

    fn axes(&self, findings: &mut Vec<Finding>) {
        let before = findings.len();
        for axis in &self.report.axes {
            for quantity in [Quantity::Velocity, Quantity::Acceleration, Quantity::Jerk] {
                let (demanded, limit) = demand(axis, quantity);
                if demanded > limit {
                    let of =
                        if quantity == Quantity::Velocity { "feed and vibration take" } else { "the vibration takes" };
                    let message = format!(
                        "{of} {} {} of the {} axis' {quantity}, whose limit is {} (line {})",
                        decimal(demanded, 1),
                        quantity.unit(axis.rotary),
                        axis.name,
                        decimal(limit, 1),
                        axis.line
                    );
                    let load =
                        Load { axis: &axis.name, rotary: axis.rotary, quantity, demanded, limit, line: axis.line };
                    findings.push(self.axis_finding(&load, message));
                }
            }
        }
        // On a curve the turning takes part of the limits too.
        if let Some((exceeded, line)) = &self.exceeded
            && findings[before..].iter().all(|finding| finding.code != axis_code(exceeded.quantity))
        {
            let message = format!("{exceeded} (line {line})");
            let LimitExceeded { axis, quantity, demanded, limit } = *exceeded;
            let (name, rotary) = (axis.letter().to_string(), axis.is_rotary());
            let load = Load { axis: &name, rotary, quantity, demanded, limit, line: *line };
            findings.push(self.axis_finding(&load, message));
        }
    }

    fn axis_finding(&self, load: &Load<'_>, message: String) -> Finding {
        let Load { axis, rotary, quantity, demanded, limit, line } = *load;
        let mut finding = Finding::new(axis_code(quantity), self.amplitude_span(), message)
            .at("line", line.into())
            .ranked(axis.to_owned(), demanded / limit)
            .with_value("demanded", demanded, quantity.unit(rotary))
            .with_value("limit", limit, quantity.unit(rotary));
        if let Some(amplitude_mm) = self.report.largest_amplitude_mm.map(|mm| round_down(mm, 4)).filter(|mm| *mm > 0.0)
        {
            let message =
                format!("the axes can follow an amplitude of {} mm at this frequency", decimal(amplitude_mm, 4));
            let word = self.amplitude_cure(amplitude_mm);
            finding = finding.suggest_value(message, word, "amplitude", amplitude_mm, "mm");
        }
        if let Some(frequency_hz) = self.report.highest_frequency_hz.map(|hz| round_down(hz, 3)).filter(|hz| *hz > 0.0)
        {
            let message = format!("the axes can follow {} Hz at this amplitude", decimal(frequency_hz, 3));
            finding = finding.suggest_value(message, None, "frequency", frequency_hz, "Hz");
        }
        // At a standstill of the feed something would fit.
        if quantity == Quantity::Velocity && self.settings.demand(self.condition(), 0.0).peaks(0.0).velocity < limit {
            finding = finding.suggest("lower the feed");
        }
        finding
    }

    fn travel(&self, findings: &mut Vec<Finding>) {
        let SectionReport { length_mm, travel_mm, clamped_share, envelope, .. } = self.report;
        if envelope == VibrationEnvelope::Blended {
            findings.extend(self.never_whole());
            return;
        }
        if length_mm >= travel_mm {
            return;
        }
        // Nothing was clamped where an error stopped the setpoints before they came here.
        let clamping = if clamped_share > 0.0 {
            format!("{} % of its setpoints are clamped at its ends", decimal(clamped_share * 100.0, 1))
        } else {
            "the clamps at its ends dominate".to_owned()
        };
        let message = format!(
            "the section is {} mm long, shorter than the vibration's travel of {} mm: {clamping}",
            decimal(length_mm, 4),
            decimal(travel_mm, 4)
        );
        let amplitude_mm = round_down(0.5 * length_mm, 4);
        let finding = Finding::new(code::VIB_TRAVEL_SHORT, self.amplitude_span(), message)
            .at("line", self.report.first_line.into())
            .ranked("", travel_mm - length_mm)
            .with_value("length", length_mm, "mm")
            .with_value("travel", travel_mm, "mm")
            .with_value("clamped_share", clamped_share, "");
        findings.push(if amplitude_mm > 0.0 {
            let cure = format!("use an amplitude of at most {} mm, or a longer section", decimal(amplitude_mm, 4));
            finding.suggest_value(cure, self.amplitude_cure(amplitude_mm), "amplitude", amplitude_mm, "mm")
        } else {
            finding.suggest("use a longer section")
        });
    }

    /// The section is too short for the whole amplitude.
    fn never_whole(&self) -> Option<Finding> {
        let SectionReport { length_mm, full_amplitude_share, .. } = self.report;
        let ramps_mm = 2.0 * self.report.ramp_mm.filter(|_| full_amplitude_share == 0.0)?;
        let message = format!(
            "the vibration never reaches its amplitude: it is blended in and out over {} mm, and no part of the section of {} mm \
             is longer",
            decimal(ramps_mm, 4),
            decimal(length_mm, 4)
        );
        let finding = Finding::new(code::VIB_TRAVEL_SHORT, self.amplitude_span(), message)
            .with_value("length", length_mm, "mm")
            .with_value("ramps", ramps_mm, "mm");
        Some(finding.suggest("use a longer section, or a smaller amplitude and a higher frequency"))
    }

    fn contour(&self, findings: &mut Vec<Finding>) {
        let (deviation_mm, tolerance_mm) = (self.report.contour_deviation_mm, self.settings.contour_tolerance_mm);
        let (Some(radius_mm), Some(line)) = (self.report.min_radius_mm, self.curve_line) else { return };
        if deviation_mm <= tolerance_mm {
            return;
        }
        let message = format!(
            "along the tangent the tool leaves the contour by {} mm on the radius of {} mm in line {line}, more than the \
             tolerance of {} mm",
            decimal(deviation_mm, 6),
            decimal(radius_mm, 3),
            decimal(tolerance_mm, 6)
        );
        let followed = self.settings.follows_up_to(self.condition().amplitude_mm).unwrap_or(1.0);
        let amplitude_mm = round_down((2.0 * radius_mm * tolerance_mm).sqrt() / followed, 4);
        let cure = format!("use an amplitude of at most {} mm", decimal(amplitude_mm, 4));
        findings.push(
            Finding::new(code::VIB_CONTOUR, self.amplitude_span(), message)
                .at("line", line.into())
                .ranked("", deviation_mm)
                .with_value("deviation", deviation_mm, "mm")
                .with_value("tolerance", tolerance_mm, "mm")
                .with_value("radius", radius_mm, "mm")
                .suggest("generate the vibration along the path, which never leaves the contour")
                .suggest_value(cure, self.amplitude_cure(amplitude_mm), "amplitude", amplitude_mm, "mm"),
        );
    }

    fn junction(&self, findings: &mut Vec<Finding>) {
        let jump_mm = self.report.junction_jump_mm;
        let Some(line) = self.corner_line.filter(|_| jump_mm > 0.0) else { return };
        let rest_s = 0.5 / self.condition().frequency_hz;
        let message = format!(
            "the corner at the start of line {line} would make the offset jump by up to {} mm; the command rests there \
             until the vibration passes zero, at most {} ms",
            decimal(jump_mm, 5),
            decimal(rest_s * 1_000.0, 2)
        );
        findings.push(
            Finding::new(code::VIB_JUNCTION_JUMP, self.on_span, message)
                .at("line", line.into())
                .ranked("", jump_mm)
                .with_value("jump", jump_mm, "mm")
                .with_value("longest_rest", rest_s, "s")
                .suggest("generate the vibration along the path, which goes back around the corner")
                .suggest("round the corner with a tangent arc"),
        );
    }

    /// A published vibration steps the velocity at its ends.
    fn published_ends(&self, findings: &mut Vec<Finding>) {
        let Some(ends) = &self.report.published_ends else { return };
        let Some(axis) = &ends.exceeded else { return };
        let bind = self.settings.published_limits_bind;
        let code = if bind { code::VIB_PUBLISHED_ENDS } else { code::VIB_PUBLISHED_ENDS_PERMITTED };
        let message = format!(
            "the published form steps the velocity by {} mm/s at its start and by up to {} mm/s at each clamp and at its end: \
             at this period up to {} mm/s² of the {} axis, whose limit is {}",
            decimal(ends.start_velocity_step_mm_per_s, 2),
            decimal(ends.clamp_velocity_step_mm_per_s, 2),
            decimal(axis.acceleration_per_s2, 0),
            axis.name,
            decimal(axis.max_acceleration_per_s2, 0)
        );
        findings.push(
            Finding::new(code, self.on_span, message)
                .with_value("start_velocity_step", ends.start_velocity_step_mm_per_s, "mm/s")
                .with_value("clamp_velocity_step", ends.clamp_velocity_step_mm_per_s, "mm/s")
                .with_value("demanded", axis.acceleration_per_s2, "mm/s²")
                .with_value("limit", axis.max_acceleration_per_s2, "mm/s²")
                .suggest("blend the vibration in and out, so that the axes can follow its beginning and end"),
        );
    }

    fn chip(&self, findings: &mut Vec<Finding>) {
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
            finding = finding.with_value("feed_override", 100.0 * ratio, "%");
        }
        if amplitude_first {
            finding = self.suggest_amplitude(finding, chip, true);
        }
        finding = self.suggest_frequencies(finding, chip, !amplitude_first);
        for &rev_per_min in &chip.recommended_spindle_rev_per_min {
            let message = format!("turn the spindle at {} rev/min", decimal(rev_per_min, 1));
            finding = finding.suggest_value(message, None, "spindle_speed", rev_per_min, "rev/min");
        }
        let finding = if amplitude_first { finding } else { self.suggest_amplitude(finding, chip, false) };
        // At the programmed feed the override is not the cause.
        if self.report.feed_override == Some(1.0) { finding } else { self.suggest_override(finding) }
    }

    /// The chip breaks at every override of the plan, but not at the largest one that the machine permits.
    fn unbroken_at_permitted_override(&self) -> Option<Finding> {
        let permitted = self.report.at_max_feed_override.filter(|permitted| permitted.broken_share < 1.0)?;
        let top = percent(permitted.max_feed_override);
        let largest = permitted.largest_breaking_override.map(|ratio| round_down(100.0 * ratio, 2));
        let breaking = match (largest, permitted.largest_breaking_feed_per_rev_mm) {
            (Some(largest), Some(feed_mm)) => format!(
                "up to a feed override of {} %, {} mm/rev",
                decimal(largest, 2),
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
            .with_value("max_feed_override", 100.0 * permitted.max_feed_override, "%")
            .with_value("breaking_margin", permitted.breaking_margin, "")
            .with_value("broken_share", permitted.broken_share, "");
        if let (Some(largest), Some(feed_mm)) = (largest, permitted.largest_breaking_feed_per_rev_mm) {
            finding = finding.with_value("largest_feed_override", largest, "%").with_value(
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
            Some(largest) if largest > 0.0 => {
                let message = format!("feed at most {} % of what is programmed", percent(largest));
                finding.suggest_value(message, None, "feed_override", 100.0 * largest, "%")
            }
            _ => finding,
        }
    }

    fn suggest_frequencies(&self, mut finding: Finding, chip: &ChipReport, on_word: bool) -> Finding {
        let rev_per_s = chip.condition.spindle_rev_per_min / 60.0;
        let permitted = |hz: &&f64| **hz <= self.settings.max_frequency_hz;
        for &frequency_hz in chip.recommended_frequencies_hz.iter().filter(permitted) {
            let message = format!(
                "vibrate at {} Hz: D = {}, where {} mm suffice",
                decimal(frequency_hz, 3),
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

    fn following(&self, findings: &mut Vec<Finding>) {
        if !self.following.is_stated() {
            return;
        }
        let VibrationCondition { frequency_hz, amplitude_mm } = self.condition();
        let following = &self.report.following;
        let arriving_mm = following.arriving_amplitude_mm;
        let no_longer_breaks = self.report.chip.as_ref().is_some_and(|chip| {
            chip.broken && !CutCondition { amplitude_mm: arriving_mm, ..chip.condition }.breaks_chip()
        });
        if arriving_mm >= ARRIVING_SHARE * amplitude_mm && !no_longer_breaks {
            return;
        }
        let consequence = if no_longer_breaks { ", too little to break the chip" } else { "" };
        let message = format!(
            "of {} mm amplitude at {} Hz only {} mm arrive at the tool{consequence}",
            decimal(amplitude_mm, 4),
            decimal(frequency_hz, 3),
            decimal(arriving_mm, 5)
        );
        let finding = Finding::new(code::VIB_FOLLOWING_LOSS, self.amplitude_span(), message)
            .at("line", self.report.first_line.into())
            .ranked("", f64::from(u8::from(no_longer_breaks)))
            .with_value("arriving_amplitude", arriving_mm, "mm")
            .with_value("filter_gain", following.filter_gain, "")
            .with_value("loop_gain", following.loop_gain, "")
            .with_value("phase_lag", following.phase_lag_rad, "rad");
        let to_command_mm = following.amplitude_to_command_mm.map(|command_mm| round_up(command_mm, 4));
        findings.push(match to_command_mm.filter(|command_mm| *command_mm <= self.settings.max_amplitude_mm) {
            Some(command_mm) => {
                let cure =
                    format!("command {} mm, so that {} mm arrive", decimal(command_mm, 4), decimal(amplitude_mm, 4));
                finding.suggest_value(cure, self.amplitude_cure(command_mm), "amplitude", command_mm, "mm")
            }
            None if following.filter_gain < following.loop_gain => {
                finding.suggest("shorten the filter behind interpolation, or choose a lower frequency")
            }
            None => finding.suggest("choose a lower frequency, or a stiffer position loop"),
        });
    }
}

/// A factor as a percentage, never rounded up.
fn percent(ratio: f64) -> String {
    decimal(round_down(100.0 * ratio, 2), 2)
}

/// What a section asks of one limit of an axis.
#[derive(Clone, Copy)]
struct Load<'a> {
    axis: &'a str,
    rotary: bool,
    quantity: Quantity,
    demanded: f64,
    limit: f64,
    line: u32,
}

fn axis_code(quantity: Quantity) -> FindingCode {
    match quantity {
        Quantity::Velocity => code::VIB_AXIS_VELOCITY,
        Quantity::Acceleration => code::VIB_AXIS_ACCELERATION,
        Quantity::Jerk => code::VIB_AXIS_JERK,
    }
}

fn demand(axis: &AxisLoadReport, quantity: Quantity) -> (f64, f64) {
    match quantity {
        Quantity::Velocity => (axis.velocity_per_s, axis.max_velocity_per_s),
        Quantity::Acceleration => (axis.acceleration_per_s2, axis.max_acceleration_per_s2),
        Quantity::Jerk => (axis.jerk_per_s3, axis.max_jerk_per_s3),
    }
}

/// `F` word of a frequency, to 0.001 Hz.
pub(super) fn frequency_word(frequency_hz: f64) -> String {
    format!("F{}", decimal(frequency_hz, 3))
}

/// `A` word of an amplitude, to 0.1 µm (in an inch program to 10⁻⁹ inch, never above the amplitude); always with a
/// decimal point, whatever a machine reads without one.
pub(super) fn amplitude_word(amplitude_mm: f64, inch: bool) -> String {
    if inch { word('A', round_down(amplitude_mm / MM_PER_INCH, 9), 9) } else { word('A', amplitude_mm, 4) }
}

/// By definition.
const MM_PER_INCH: f64 = 25.4;
