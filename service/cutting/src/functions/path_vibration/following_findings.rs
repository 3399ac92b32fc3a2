//! What is found about drives that do not follow the vibration as it is commanded.
//!
//! The share that arrives is the same of every amplitude, so no amplitude ends a finding about the share: a warning is given only
//! for what follows from it, and what ends that is judged with the share that arrives then.

use feedwave_program::Finding;

use super::chip::{ChipReport, CutCondition};
use super::chip_findings::percent;
use super::code;
use super::findings::Evidence;
use super::{VibrationCondition, trial::Objection};
use crate::shared::wording::{decimal, round_down, round_up};

/// Share of the amplitude that has to arrive unmentioned.
const ARRIVING_SHARE: f64 = 0.9;
/// Largest share of the amplitude that may arrive unmentioned.
const EXCESSIVE_SHARE: f64 = 1.1;
/// Most vibrations of a revolution at which a frequency is looked for.
const MOST_VIBRATIONS: f64 = 200.0;

impl Evidence {
    pub(super) fn following(&self, findings: &mut Vec<Finding>) {
        if !self.following_is_stated {
            return;
        }
        findings.extend(self.following_loss());
        findings.extend(self.following_excess());
        self.following_contour(findings);
    }

    /// Less arrives than is commanded: a warning where that is too little for the chip.
    fn following_loss(&self) -> Option<Finding> {
        let amplitude_mm = self.condition().amplitude_mm;
        let following = &self.report.following;
        let share = following.arriving_amplitude_mm / amplitude_mm;
        let arrives = |cut: &CutCondition| CutCondition { amplitude_mm: cut.amplitude_mm * share, ..*cut };
        let broken = self.report.chip.as_ref().filter(|chip| chip.broken);
        let finding = match broken.filter(|chip| !arrives(&chip.condition).breaks_chip()) {
            Some(chip) => self.no_longer_breaks(chip),
            None if share < ARRIVING_SHARE => self.share_arrives(broken.is_some(), share),
            None => return None,
        };
        Some(
            finding
                .at("line", self.report.first_line.into())
                .with_value("arriving_amplitude", following.arriving_amplitude_mm, "mm")
                .with_value("filter_gain", following.filter_gain, "")
                .with_value("loop_gain", following.loop_gain, "")
                .with_value("phase_lag", following.phase_lag_rad, "rad"),
        )
    }

    /// What is commanded would break the chip, and what arrives does not.
    fn no_longer_breaks(&self, chip: &ChipReport) -> Finding {
        let VibrationCondition { frequency_hz, amplitude_mm } = self.condition();
        let cures = self.chip_cures(chip);
        let message = format!(
            "of {} mm amplitude at {} Hz only {} mm arrive at the tool, too little to break the chip{}",
            decimal(amplitude_mm, 4),
            decimal(frequency_hz, 3),
            decimal(self.report.following.arriving_amplitude_mm, 5),
            cures.objections()
        );
        let finding = Finding::new(code::VIB_FOLLOWING_LOSS, self.span_of(&cures), message).ranked("", 1.0);
        let finding = self.suggest_chip_cures(finding, &cures);
        finding.suggest(self.what_passes_more())
    }

    /// A share of every amplitude arrives.
    fn share_arrives(&self, breaks_chip: bool, share: f64) -> Finding {
        let VibrationCondition { frequency_hz, amplitude_mm } = self.condition();
        let following = &self.report.following;
        let message = format!(
            "of {} mm amplitude at {} Hz {} mm arrive at the tool{}",
            decimal(amplitude_mm, 4),
            decimal(frequency_hz, 3),
            decimal(following.arriving_amplitude_mm, 5),
            if breaks_chip { ", enough to break the chip" } else { "" }
        );
        let passing_hz = self.passing_frequency_hz();
        let (span, word) = match passing_hz {
            Some(frequency_hz) => self.frequency_cure(frequency_hz),
            None => (self.amplitude_span(), None),
        };
        let finding = Finding::new(code::VIB_FOLLOWING_LOSS_NOTED, span, message).ranked("", 0.0);
        let finding = match passing_hz {
            Some(frequency_hz) => {
                let cure = format!(
                    "vibrate at {} Hz, where more than nine tenths of every amplitude arrive and the chip breaks",
                    decimal(frequency_hz, 3)
                );
                finding.suggest_value(cure, word, "frequency", frequency_hz, "Hz")
            }
            None => finding,
        };
        let finding = match following.amplitude_to_command_mm.map(|command_mm| round_up(command_mm, 4)) {
            Some(command_mm) if command_mm <= self.settings.max_amplitude_mm => finding.suggest(format!(
                "nothing has to be changed where that is enough; {} mm arrive of {} mm, and as of every amplitude {} %, so that \
                 this is said of it again",
                decimal(amplitude_mm, 4),
                decimal(command_mm, 4),
                percent(share)
            )),
            _ => finding,
        };
        finding.suggest(self.what_passes_more())
    }

    /// The highest lower frequency, as it is written, at which the drives let enough of any amplitude through and the chip breaks.
    fn passing_frequency_hz(&self) -> Option<f64> {
        let rev_per_s = self.report.chip.as_ref()?.condition.spindle_rev_per_min / 60.0;
        let present_hz = self.condition().frequency_hz;
        let most = (present_hz / rev_per_s).min(MOST_VIBRATIONS) as u32;
        // A chip breaks best half of a vibration behind the last revolution.
        let halves = (0..=most).rev().map(|whole| (f64::from(whole) + 0.5) * rev_per_s);
        let written = halves.filter_map(|frequency_hz| decimal(frequency_hz, 3).parse().ok());
        written.filter(|frequency_hz| *frequency_hz < present_hz).find(|&frequency_hz| {
            self.trial.cuts.arriving_share(frequency_hz) > ARRIVING_SHARE
                && self.trial.objection(self.trial.with_frequency(frequency_hz)).is_none()
        })
    }

    /// What lets more of any amplitude through.
    fn what_passes_more(&self) -> &'static str {
        let following = &self.report.following;
        if following.filter_gain < following.loop_gain {
            "a shorter filter behind interpolation, or a lower frequency, lets more through"
        } else {
            "a lower frequency, or a stiffer position loop, lets more through"
        }
    }

    /// The drives resonate with the vibration: a warning where more arrives than the machine permits.
    fn following_excess(&self) -> Option<Finding> {
        let VibrationCondition { frequency_hz, amplitude_mm } = self.condition();
        let arriving_mm = self.report.following.largest_arriving_amplitude_mm;
        let (share, most_mm) = (arriving_mm / amplitude_mm, self.settings.max_amplitude_mm);
        if share <= EXCESSIVE_SHARE {
            return None;
        }
        let message = format!(
            "of {} mm amplitude at {} Hz the drives make {} mm at the tool",
            decimal(amplitude_mm, 4),
            decimal(frequency_hz, 3),
            decimal(arriving_mm, 5)
        );
        let told = |finding: Finding| {
            finding.at("line", self.report.first_line.into()).ranked("", share).with_value(
                "arriving_amplitude",
                arriving_mm,
                "mm",
            )
        };
        let below = "choose a frequency further below the resonance of the drives";
        if arriving_mm <= most_mm {
            let finding = told(Finding::new(code::VIB_FOLLOWING_EXCESS_NOTED, self.amplitude_span(), message));
            let command_mm = round_down(amplitude_mm / share, 4);
            let finding = finding.suggest(format!(
                "nothing has to be changed where that is not too much; at most {} mm arrive of {} mm, and as of every amplitude \
                 {} %, so that this is said of it again",
                decimal(amplitude_mm, 4),
                decimal(command_mm, 4),
                percent(share)
            ));
            return Some(finding.suggest(below));
        }
        let message = format!("{message}, more than the machine's largest amplitude of {} mm", decimal(most_mm, 4));
        let finding = told(Finding::new(code::VIB_FOLLOWING_EXCESS, self.amplitude_span(), message))
            .with_value("limit", most_mm, "mm");
        let command_mm = round_down(most_mm / share, 4);
        let objection = self.trial.objection(self.trial.with_amplitude(command_mm));
        let finding = match objection {
            None | Some(Objection::Unknown) if command_mm > 0.0 => {
                let cure = format!("command at most {} mm", decimal(command_mm, 4));
                finding.suggest_value(cure, self.amplitude_cure(command_mm), "amplitude", command_mm, "mm")
            }
            _ => finding,
        };
        Some(finding.suggest(below))
    }

    /// The axes lag by different amounts on a slope, or all of them on a curve.
    fn following_contour(&self, findings: &mut Vec<Finding>) {
        let Some(contour) = &self.report.following.contour else { return };
        let tolerance_mm = self.settings.contour_tolerance_mm;
        if contour.together_mm <= tolerance_mm {
            return;
        }
        let message = format!(
            "the lag of the drives leaves the contour by {} mm, of which {} mm by the feed",
            decimal(contour.together_mm, 5),
            decimal(contour.feed_mm, 5)
        );
        let line = if contour.feed_mm > contour.vibration_mm { contour.feed_line } else { contour.vibration_line };
        findings.push(
            Finding::new(code::VIB_FOLLOWING_CONTOUR, self.on_span, message)
                .at("line", line.into())
                .ranked("", contour.together_mm)
                .with_value("contour_error", contour.together_mm, "mm")
                .with_value("by_feed", contour.feed_mm, "mm")
                .with_value("by_vibration", contour.vibration_mm, "mm")
                .with_value("tolerance", tolerance_mm, "mm")
                .suggest("feed slower, give the axes the same position loop, or feed their velocity forward"),
        );
    }
}
