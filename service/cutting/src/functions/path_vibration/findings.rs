//! From the evidence of a section to findings: one for each kind, with the numbers and what cures it. Sections of one switch
//! share its place: the findings' log counts them and keeps the worst.

use feedwave_motion::{LEAST_FEED_SHARE, LimitExceeded, Quantity};
use feedwave_program::{Finding, FindingLog, Severity, SourceSpan};

use super::code;
use super::loads::Exceeded;
use super::trial::{Objection, Trial, Tried};
use super::{
    AxisLoadReport, GenerationMode, SectionReport, VibrationCondition, VibrationEnvelope, VibrationSettings,
    VibrationWordSpans,
};
use crate::functions::axis_load::{AxisCodes, AxisLoad};
use crate::functions::sampling::{FINE_SAMPLES, Sampling, suggest_period};
use crate::shared::wording::{decimal, round_down, word};

/// Everything known about a section at its end.
#[derive(Clone, Debug)]
pub(super) struct Evidence {
    pub(super) report: SectionReport,
    pub(super) on_span: SourceSpan,
    pub(super) words: VibrationWordSpans,
    pub(super) settings: VibrationSettings,
    pub(super) following_is_stated: bool,
    /// First element that the axes cannot follow, and its line.
    pub(super) exceeded: Option<Exceeded>,
    pub(super) curve_line: Option<u32>,
    /// Line behind the junctions that are gone over and change the direction most.
    pub(super) junction_line: Option<u32>,
    /// Line after the sharpest corner of a published vibration.
    pub(super) corner_line: Option<u32>,
    pub(super) chip_line: Option<u32>,
    pub(super) stopped_line: Option<u32>,
    /// The axes as reported: with what curves leave of their limits, and the steps of a published vibration.
    pub(super) deciding_axes: Vec<AxisLoadReport>,
    /// Whether a block of the section was refused before it could be judged.
    pub(super) refused: bool,
    /// What becomes with another vibration of the section, and of others that its words govern.
    pub(super) trial: Trial,
}

impl Evidence {
    /// Pushes the findings and completes the report.
    pub(super) fn conclude(self, log: &mut FindingLog) -> SectionReport {
        let findings = self.findings();
        let report = self.report(&findings);
        for finding in findings {
            log.push(finding);
        }
        report
    }

    /// What is found, in the same order whatever [`Evidence::trial`] says of other vibrations.
    pub(super) fn findings(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        self.sampling(&mut findings);
        self.axes(&mut findings);
        self.travel(&mut findings);
        self.contour(&mut findings);
        self.junction(&mut findings);
        self.published_ends(&mut findings);
        self.chip(&mut findings);
        self.following(&mut findings);
        findings
    }

    /// The report of the section with these findings.
    pub(super) fn report(&self, findings: &[Finding]) -> SectionReport {
        // The steps of a published vibration may be permitted; the axes follow them no better for it.
        let exceeds_at_ends = self.report.published_ends.as_ref().is_some_and(|ends| ends.exceeded.is_some());
        let feasible = self.report.length_mm > 0.0
            && !self.refused
            && !exceeds_at_ends
            && findings.iter().all(|finding| finding.severity != Severity::Error);
        SectionReport { feasible, axes: self.deciding_axes.clone(), ..self.report.clone() }
    }

    pub(super) fn condition(&self) -> VibrationCondition {
        self.report.condition
    }

    /// The place to change the frequency, and its new word where the place is that word alone.
    pub(super) fn frequency_cure(&self, frequency_hz: f64) -> (SourceSpan, Option<String>) {
        let word = self.words.frequency.map(|_| frequency_word(frequency_hz));
        (self.words.frequency.unwrap_or(self.on_span), word)
    }

    pub(super) fn amplitude_span(&self) -> SourceSpan {
        self.words.amplitude.unwrap_or(self.on_span)
    }

    /// A new amplitude word, where the finding is at the old one and the amplitude can be written.
    pub(super) fn amplitude_cure(&self, amplitude_mm: f64) -> Option<String> {
        self.words.amplitude.filter(|_| amplitude_mm > 0.0).map(|_| amplitude_word(amplitude_mm, self.words.inch))
    }

    fn sampling(&self, findings: &mut Vec<Finding>) {
        let frequency_hz = self.condition().frequency_hz;
        let sampling = &self.report.sampling;
        let samples = sampling.samples_per_vibration;
        let servo_side = self.settings.generation_mode == GenerationMode::ServoSide;
        let with_values = |finding: Finding| {
            finding
                .ranked("", 1.0 / samples)
                .with_value("frequency", frequency_hz, "Hz")
                .with_value("period", sampling.period_s, "s")
                .with_value("samples_per_vibration", samples, "")
                .with_value("peak_error", sampling.peak_error, "")
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
        match Sampling::of(samples) {
            Sampling::Fine => {}
            Sampling::BelowNyquist => {
                let highest_hz = round_down(1.0 / (FINE_SAMPLES * sampling.period_s), 3);
                let (span, word) = self.frequency_cure(highest_hz);
                let message = format!("{wave}: below two samples another, slower wave would be cut");
                let finding = with_values(Finding::new(code::VIB_SAMPLING_NYQUIST, span, message));
                let cure = format!("use at most {} Hz at this period", decimal(highest_hz, 3));
                let finding = suggest_mode(suggest_period(finding, frequency_hz));
                findings.push(finding.suggest_value(cure, word, "frequency", highest_hz, "Hz"));
            }
            Sampling::Coarse => {
                let message = format!(
                    "{wave}: up to {} % of its peak is lost between samples",
                    decimal(sampling.peak_error * 100.0, 1)
                );
                let finding = with_values(Finding::new(code::VIB_SAMPLING_COARSE, self.on_span, message));
                findings.push(suggest_period(suggest_mode(finding), frequency_hz));
            }
        }
    }

    fn axes(&self, findings: &mut Vec<Finding>) {
        let before = findings.len();
        for axis in &self.report.axes {
            for load in loads(axis) {
                let AxisLoad { quantity, demanded, limit, .. } = load;
                if load.exceeds(0.0) {
                    let of =
                        if quantity == Quantity::Velocity { "feed and vibration take" } else { "the vibration takes" };
                    let message = format!(
                        "{of} {} {} of the {} axis' {quantity}, whose limit is {} (line {})",
                        decimal(demanded, 1),
                        load.unit(),
                        axis.axis,
                        decimal(limit, 1),
                        axis.line
                    );
                    findings.push(self.axis_finding(&load, &axis.axis, axis.line, message));
                }
            }
        }
        // On a curve the turning takes part of the limits too.
        if let Some(Exceeded { limit: exceeded, nominal, line }) = &self.exceeded {
            let LimitExceeded { axis, quantity, demanded, limit } = *exceeded;
            let load = AxisLoad { quantity, rotary: axis.is_rotary(), demanded, limit };
            let code = load.code(&AXIS_CODES);
            if findings[before..].iter().all(|finding| finding.code != code) {
                let message = if *nominal == limit {
                    format!("{exceeded} (line {line})")
                } else {
                    on_curve(exceeded, *nominal, &load, *line)
                };
                let finding = self.axis_finding(&load, &axis.letter().to_string(), *line, message);
                let (permitted, nominal) = (exceeded.permitted(), *nominal);
                let finding = finding.with_value("permitted", permitted, load.unit());
                findings.push(finding.with_value("axis_limit", nominal, load.unit()));
            }
        }
    }

    fn axis_finding(&self, load: &AxisLoad, axis: &str, line: u32, message: String) -> Finding {
        let AxisLoad { quantity, limit, .. } = *load;
        let finding = Finding::new(load.code(&AXIS_CODES), self.amplitude_span(), message).at("line", line.into());
        let mut finding = load.with_numbers(finding, axis.to_owned());
        let follows = |tried: Tried| self.trial.axis_refusal(tried).is_none();
        let amplitude_mm = self.trial.axes.largest_amplitude_mm.map(|mm| round_down(mm, 4)).filter(|mm| *mm > 0.0);
        if let Some(amplitude_mm) = amplitude_mm.filter(|mm| follows(self.trial.with_amplitude(*mm))) {
            let mm = decimal(amplitude_mm, 4);
            let message = format!("the axes can follow an amplitude of {mm} mm at this frequency");
            let message = message + &self.but_unbroken(self.trial.with_amplitude(amplitude_mm));
            let word = self.amplitude_cure(amplitude_mm);
            finding = finding.suggest_value(message, word, "amplitude", amplitude_mm, "mm");
        }
        let frequency_hz = self.trial.axes.highest_frequency_hz.map(|hz| round_down(hz, 3)).filter(|hz| *hz > 0.0);
        if let Some(frequency_hz) = frequency_hz.filter(|hz| follows(self.trial.with_frequency(*hz))) {
            let message = format!("the axes can follow {} Hz at this amplitude", decimal(frequency_hz, 3));
            let message = message + &self.but_unbroken(self.trial.with_frequency(frequency_hz));
            finding = finding.suggest_value(message, None, "frequency", frequency_hz, "Hz");
        }
        // At a standstill of the feed something would fit.
        if quantity == Quantity::Velocity && self.settings.demand(self.condition(), 0.0).peaks(0.0).velocity < limit {
            finding = finding.suggest("lower the feed");
        }
        finding
    }

    /// What a cure adds with which the axes or the contour are kept, and the chip does not break.
    fn but_unbroken(&self, tried: Tried) -> String {
        match self.trial.cuts.objection(tried, &self.settings) {
            Some(unbroken @ Objection::Unbroken { .. }) => format!(", but {unbroken}"),
            _ => String::new(),
        }
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
            let cure = cure + &self.but_unbroken(self.trial.with_amplitude(amplitude_mm));
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
            .ranked("", ramps_mm - length_mm)
            .with_value("length", length_mm, "mm")
            .with_value("ramps", ramps_mm, "mm")
            .at("line", self.report.first_line.into());
        Some(finding.suggest("use a longer section, or a smaller amplitude and a higher frequency"))
    }

    fn contour(&self, findings: &mut Vec<Finding>) {
        let (deviation_mm, tolerance_mm) = (self.report.contour_deviation_mm, self.settings.contour_tolerance_mm);
        if deviation_mm <= tolerance_mm {
            return;
        }
        let departure = &self.report.departure;
        let at_junctions_mm = departure.at_junctions_mm(self.settings.reach_mm(self.condition().amplitude_mm));
        let curve = self.report.min_radius_mm.zip(self.curve_line);
        let curve =
            curve.map(|(radius_mm, line)| format!("on the radius of {} mm in line {line}", decimal(radius_mm, 3)));
        let junction = self.junction_line.map(|line| format!("at the junction before line {line}"));
        let places = match (curve, junction) {
            (Some(curve), Some(junction)) => {
                format!("{curve}, {} mm of it {junction}", decimal(at_junctions_mm, 6))
            }
            (curve, junction) => curve.or(junction).unwrap_or_default(),
        };
        let message = format!(
            "along the tangent the tool leaves the contour by {} mm {places}, more than the tolerance of {} mm",
            decimal(deviation_mm, 6),
            decimal(tolerance_mm, 6)
        );
        // A smaller amplitude may follow further below the largest permitted one.
        let followed = self.settings.amplitude_follows_feed_up_to.unwrap_or(1.0).max(1.0);
        // The rounding of a radius must not bring it back over the tolerance.
        let amplitude_mm = round_down((1.0 - 1e-9) * departure.largest_offset_mm(tolerance_mm) / followed, 4);
        let cure = format!("use an amplitude of at most {} mm", decimal(amplitude_mm, 4));
        let cure = cure + &self.but_unbroken(self.trial.with_amplitude(amplitude_mm));
        let line = if at_junctions_mm > 0.5 * deviation_mm { self.junction_line } else { self.curve_line };
        let finding = Finding::new(code::VIB_CONTOUR, self.amplitude_span(), message)
            .at("line", line.unwrap_or(self.report.on_line).into())
            .ranked("", deviation_mm)
            .with_value("deviation", deviation_mm, "mm")
            .with_value("at_junctions", at_junctions_mm, "mm")
            .with_value("tolerance", tolerance_mm, "mm");
        let finding = match self.report.min_radius_mm {
            Some(radius_mm) => finding.with_value("radius", radius_mm, "mm"),
            None => finding,
        };
        findings.push(
            finding.suggest("generate the vibration along the path, which never leaves the contour").suggest_value(
                cure,
                self.amplitude_cure(amplitude_mm),
                "amplitude",
                amplitude_mm,
                "mm",
            ),
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
        let (quantity, [demanded, limit]) = axis.most_exceeded();
        let unit = quantity.unit(axis.rotary);
        let at_override = match self.trial.top_override() {
            top if top > 1.0 => format!(" and a feed override of {} %", decimal(100.0 * top, 2)),
            _ => String::new(),
        };
        let message = format!(
            "the published form steps the velocity by {} mm/s at its start and by up to {} mm/s at each clamp and at its end{}: \
             at this period{at_override} up to {} {unit} of the {} axis, whose limit is {}",
            decimal(ends.start_velocity_step_mm_per_s, 2),
            decimal(ends.clamp_velocity_step_mm_per_s, 2),
            if ends.has_corners { ", and turns with the path at corners" } else { "" },
            decimal(demanded, 0),
            axis.axis,
            decimal(limit, 0)
        );
        findings.push(
            Finding::new(code, self.on_span, message)
                .ranked(axis.axis.clone(), demanded / limit)
                .with_value("start_velocity_step", ends.start_velocity_step_mm_per_s, "mm/s")
                .with_value("clamp_velocity_step", ends.clamp_velocity_step_mm_per_s, "mm/s")
                .with_value("demanded", demanded, unit)
                .with_value("limit", limit, unit)
                .at("line", self.report.first_line.into())
                .suggest("blend the vibration in and out, so that the axes can follow its beginning and end"),
        );
    }
}

const AXIS_CODES: AxisCodes = [code::VIB_AXIS_VELOCITY, code::VIB_AXIS_ACCELERATION, code::VIB_AXIS_JERK];

fn loads(axis: &AxisLoadReport) -> [AxisLoad; 3] {
    let demanded = [axis.velocity_per_s, axis.acceleration_per_s2, axis.jerk_per_s3];
    let limits = [axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3];
    AxisLoad::of_linear(demanded, limits).map(|load| AxisLoad { rotary: axis.rotary, ..load })
}

/// `F` word of a frequency, to 0.001 Hz.
pub(super) fn frequency_word(frequency_hz: f64) -> String {
    format!("F{}", decimal(frequency_hz, 3))
}

/// The amplitude that an `A` word says, mm.
pub(super) fn amplitude_of_word(amplitude_mm: f64, inch: bool) -> f64 {
    let value: f64 = amplitude_word(amplitude_mm, inch)[1..].parse().unwrap_or(f64::NAN);
    if inch { value * MM_PER_INCH } else { value }
}

/// `A` word of an amplitude, to 0.1 µm (in an inch program to 10⁻⁹ inch, never above the amplitude); always with a
/// decimal point, whatever a machine reads without one.
pub(super) fn amplitude_word(amplitude_mm: f64, inch: bool) -> String {
    if inch { word('A', round_down(amplitude_mm / MM_PER_INCH, 9), 9) } else { word('A', amplitude_mm, 4) }
}

/// By definition.
const MM_PER_INCH: f64 = 25.4;

/// What an axis has, and what the planner leaves of it on a curve.
fn on_curve(exceeded: &LimitExceeded, nominal: f64, load: &AxisLoad, line: u32) -> String {
    let LimitExceeded { axis, quantity, demanded, limit } = *exceeded;
    let fixed = |value: f64| format!("{value:.1}");
    format!(
        "on the curve in line {line} the planner leaves {} {unit} of the {} axis' {quantity} to the superposed motion, which takes {}: the \
         axis' own limit is {}, of which it grants {} along the curve and reserves the rest for turning, whatever the feed, and {} % of \
         that is for the feed",
        fixed(exceeded.permitted()),
        axis.letter(),
        fixed(demanded),
        fixed(nominal),
        fixed(limit),
        decimal(100.0 * LEAST_FEED_SHARE, 0),
        unit = load.unit()
    )
}
