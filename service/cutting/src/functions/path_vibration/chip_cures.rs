//! What cures a chip that does not break. A change is judged as the words would be written, by the verdict that the program
//! changed so would be given: chips at every permitted feed override, the axes, the ranges of the machine. What something
//! rules out is not offered; the finding says what.

use feedwave_program::{Finding, SourceSpan};

use super::VibrationCondition;
use super::chip::ChipReport;
use super::chip_findings::percent;
use super::findings::{Evidence, amplitude_of_word, amplitude_word, frequency_word};
use super::trial::{Objection, Tried};
use crate::shared::wording::{decimal, round_down, round_up};

/// Another value, and what becomes of the section with it.
pub(super) struct Change {
    /// The frequency, Hz, or the spindle speed, rev/min, as it is written.
    value: f64,
    frequency_hz: f64,
    vibrations_per_rev: f64,
    /// Smallest amplitude that breaks the chip with it, mm; `None` where none is known.
    least_mm: Option<f64>,
    /// Whether that has to be written too, or what rules it out.
    verdict: Result<Beside, Objection>,
}

/// What has to be changed beside a frequency or spindle speed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Beside {
    Nothing,
    /// The amplitude, to this, mm.
    Amplitude(f64),
}

/// Changes that cure an unbroken chip, or would but for what rules them out.
pub(super) struct ChipCures {
    /// Smallest amplitude that breaks it as programmed otherwise, mm.
    amplitude: Option<(f64, Option<Objection>)>,
    frequencies: Vec<Change>,
    speeds: Vec<Change>,
    place: Place,
}

/// The words that are replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Amplitude,
    Frequency,
    Both,
}

impl ChipCures {
    /// What rules out the first of each kind of change, as the end of a message.
    pub(super) fn objections(&self) -> String {
        let amplitude = self.amplitude.as_ref().and_then(|(least_mm, objection)| {
            let objection = objection.as_ref()?;
            Some(format!("; an amplitude of {} mm would, but {objection}", decimal(*least_mm, 4)))
        });
        let first = |changes: &[Change], unit: &str| {
            changes.iter().find_map(|change| {
                let objection = change.verdict.as_ref().err()?;
                Some(format!("; {} {unit} would be no cure: {objection}", decimal(change.value, 3)))
            })
        };
        let rest = [first(&self.frequencies, "Hz"), first(&self.speeds, "rev/min")];
        amplitude.into_iter().chain(rest.into_iter().flatten()).collect()
    }
}

impl Evidence {
    fn in_word(&self) -> impl Fn(f64) -> f64 {
        let inch = self.words.inch;
        move |amplitude_mm| amplitude_of_word(amplitude_mm, inch)
    }

    /// The smallest amplitude that breaks the chip everywhere with everything else as programmed, and what rules it out;
    /// `None` where there is none.
    pub(super) fn amplitude_tried(&self) -> Option<(f64, Option<Objection>)> {
        let programmed = self.trial.with_amplitude(self.condition().amplitude_mm);
        let least_mm = self.trial.least_amplitude_mm(programmed, self.in_word())?;
        let written_mm = self.in_word()(least_mm);
        Some((least_mm, self.trial.objection(self.trial.with_amplitude(written_mm))))
    }

    /// Another frequency or spindle speed, with the amplitude that it needs.
    fn tried(&self, value: f64, rev_per_s: f64, tried: Tried) -> Change {
        let least_mm = self.trial.least_amplitude_mm(tried, self.in_word());
        let verdict = match (self.trial.objection(tried), least_mm) {
            (None, _) => Ok(Beside::Nothing),
            (Some(Objection::Unbroken { .. }), Some(least_mm)) => {
                let mut raised = tried;
                raised.condition.amplitude_mm = self.in_word()(least_mm);
                self.trial.objection(raised).map_or(Ok(Beside::Amplitude(least_mm)), Err)
            }
            (Some(objection), _) => Err(objection),
        };
        let frequency_hz = tried.condition.frequency_hz;
        Change { value, frequency_hz, vibrations_per_rev: frequency_hz / rev_per_s, least_mm, verdict }
    }

    fn frequencies_tried(&self, chip: &ChipReport) -> Vec<Change> {
        let cut = &chip.condition;
        let present = decimal(cut.frequency_hz, 3);
        let written = chip.recommended_frequencies_hz.iter().map(|hz| decimal(*hz, 3));
        // What is programmed already cures nothing.
        let others = written.filter(|word| *word != present).filter_map(|word| word.parse().ok());
        let others = others.filter(|hz: &f64| *hz > 0.0);
        others.map(|hz| self.tried(hz, cut.spindle_rev_per_min / 60.0, self.trial.with_frequency(hz))).collect()
    }

    fn speeds_tried(&self, chip: &ChipReport) -> Vec<Change> {
        let present = decimal(chip.condition.spindle_rev_per_min, 1);
        let written = chip.recommended_spindle_rev_per_min.iter().map(|speed| decimal(*speed, 1));
        let others = written.filter(|word| *word != present).filter_map(|word| word.parse().ok());
        let others = others.filter(|speed: &f64| *speed > 0.0);
        others.map(|speed| self.tried(speed, speed / 60.0, self.trial.with_spindle_speed(speed))).collect()
    }

    /// Changes of one word, or of two, that would break the chip.
    pub(super) fn chip_cures(&self, chip: &ChipReport) -> ChipCures {
        let amplitude = self.amplitude_tried();
        let (frequencies, speeds) = (self.frequencies_tried(chip), self.speeds_tried(chip));
        let amplitude_cures = matches!(amplitude, Some((_, None)));
        let frequency_cures = |beside: fn(Beside) -> bool| {
            frequencies.iter().any(|change| change.verdict.as_ref().is_ok_and(|verdict| beside(*verdict)))
        };
        // An amplitude below f_r/2 breaks the chip at no frequency: it comes first then.
        let place = if amplitude_cures && chip.amplitude_ratio < 1.0 {
            Place::Amplitude
        } else if frequency_cures(|beside| beside == Beside::Nothing) {
            Place::Frequency
        } else if amplitude_cures {
            Place::Amplitude
        } else if frequency_cures(|_| true) && self.both_words().is_some() {
            Place::Both
        } else {
            Place::Frequency
        };
        ChipCures { amplitude, frequencies, speeds, place }
    }

    /// Both words as one text, where they follow each other; whether the frequency comes first.
    fn both_words(&self) -> Option<(SourceSpan, bool)> {
        let (frequency, amplitude) = (self.words.frequency?, self.words.amplitude?);
        let frequency_first = frequency.column < amplitude.column;
        let (first, second) = if frequency_first { (frequency, amplitude) } else { (amplitude, frequency) };
        let gap = second.column.checked_sub(first.column + first.length)?;
        let together = first.program == second.program && first.line == second.line && gap <= 1;
        let length = second.column + second.length - first.column;
        together.then_some((SourceSpan { length, ..first }, frequency_first))
    }

    /// The place of the words that the changes replace.
    pub(super) fn span_of(&self, cures: &ChipCures) -> SourceSpan {
        match (cures.place, self.both_words()) {
            (Place::Both, Some((span, _))) => span,
            (Place::Amplitude, _) => self.amplitude_span(),
            _ => self.frequency_cure(0.0).0,
        }
    }

    /// The changes that nothing rules out, those of the words at the finding's place first.
    pub(super) fn suggest_chip_cures(&self, mut finding: Finding, cures: &ChipCures) -> Finding {
        let amplitude = cures.amplitude.as_ref().filter(|(_, objection)| objection.is_none()).map(|(mm, _)| *mm);
        if let Some(least_mm) = amplitude.filter(|_| cures.place == Place::Amplitude) {
            finding = self.suggest_amplitude(finding, least_mm, self.amplitude_cure(least_mm));
        }
        for change in &cures.frequencies {
            finding = self.suggest_frequency(finding, change, cures.place);
        }
        for change in &cures.speeds {
            let Ok(beside) = change.verdict else { continue };
            let message =
                format!("turn the spindle at {} rev/min: {}", decimal(change.value, 1), self.explained(change, beside));
            finding = finding.suggest_value(message, None, "spindle_speed", change.value, "rev/min");
        }
        if let Some(least_mm) = amplitude.filter(|_| cures.place != Place::Amplitude) {
            finding = self.suggest_amplitude(finding, least_mm, None);
        }
        if self.report.is_kept_whole_by_blends() { self.suggest_length(finding) } else { finding }
    }

    /// The length from which on the blends let enough through.
    pub(super) fn suggest_length(&self, finding: Finding) -> Finding {
        let Some(length_mm) = self.trial.breaking_from_mm().map(|mm| round_up(mm, 3)) else { return finding };
        let of = match self.report.blended_junctions {
            0 => "make the section at least",
            _ => "cut one way between two corners that is at least",
        };
        let message =
            format!("{of} {} mm long: the blends then let the whole amplitude through", decimal(length_mm, 3));
        finding.suggest_value(message, None, "length", length_mm, "mm")
    }

    fn suggest_frequency(&self, finding: Finding, change: &Change, place: Place) -> Finding {
        let Ok(beside) = change.verdict else { return finding };
        let message = format!("vibrate at {} Hz: {}", decimal(change.value, 3), self.explained(change, beside));
        let frequency = frequency_word(change.value);
        let word = match (place, beside) {
            (Place::Frequency, Beside::Nothing) => self.words.frequency.map(|_| frequency),
            (Place::Both, Beside::Amplitude(mm)) => self.both_words().map(|(_, frequency_first)| {
                let amplitude = amplitude_word(mm, self.words.inch);
                if frequency_first { format!("{frequency} {amplitude}") } else { format!("{amplitude} {frequency}") }
            }),
            _ => None,
        };
        finding.suggest_value(message, word, "frequency", change.value, "Hz")
    }

    /// Why a change cures, and what has to be written beside it.
    fn explained(&self, change: &Change, beside: Beside) -> String {
        let up_to = match self.trial.top_override() {
            top if top > 1.0 => format!(" up to a feed override of {} %", percent(top)),
            _ => String::new(),
        };
        let arriving = self.arriving_words(change.frequency_hz);
        let suffices = change
            .least_mm
            .map_or_else(String::new, |mm| format!(", where {} mm suffice{arriving}{up_to}", decimal(mm, 4)));
        let also = match beside {
            Beside::Nothing => String::new(),
            Beside::Amplitude(mm) => format!("; write {} as well", amplitude_word(mm, self.words.inch)),
        };
        format!("D = {}{suffices}{also}", decimal(change.vibrations_per_rev, 1))
    }

    /// What is reckoned to arrive of an amplitude where the drives do not let it through.
    fn arriving_words(&self, frequency_hz: f64) -> String {
        match self.trial.cuts.arriving_share(frequency_hz) {
            share if share < 1.0 => format!(", of which {} % arrive at the tool", percent(share)),
            _ => String::new(),
        }
    }

    /// An amplitude that breaks the chip at every permitted feed override, and its word where the finding is at it.
    pub(super) fn suggest_amplitude(&self, finding: Finding, least_mm: f64, word: Option<String>) -> Finding {
        let top = self.trial.top_override();
        let up_to =
            if top > 1.0 { format!(", enough up to a feed override of {} %", percent(top)) } else { String::new() };
        let VibrationCondition { frequency_hz, amplitude_mm } = self.condition();
        let arriving = self.arriving_words(frequency_hz);
        let message = if least_mm > amplitude_mm {
            format!("raise the amplitude to at least {} mm{arriving}{up_to}", decimal(least_mm, 4))
        } else {
            format!("lower the amplitude to {} mm, whose blends are shorter{arriving}{up_to}", decimal(least_mm, 4))
        };
        finding.suggest_value(message, word, "amplitude", least_mm, "mm")
    }

    /// Frequencies at which the spindle speed may stray by this share of it.
    pub(super) fn suggest_steady_frequencies(&self, mut finding: Finding, chip: &ChipReport, share: f64) -> Finding {
        for change in self.frequencies_tried(chip) {
            let mut condition = self.trial.with_frequency(change.value).condition;
            if let Ok(Beside::Amplitude(mm)) = change.verdict {
                condition.amplitude_mm = self.in_word()(mm);
            }
            let tolerance = self.trial.cuts.spindle_speed_margin(condition, &self.settings);
            if tolerance.is_some_and(|tolerance| tolerance >= share) {
                finding = self.suggest_frequency(finding, &change, Place::Frequency);
            }
        }
        if finding.suggestions.is_empty() {
            finding.suggest("a larger amplitude, or fewer vibrations per revolution, leave the speed more room")
        } else {
            finding
        }
    }

    /// What helps against an override beyond which the chip no longer breaks.
    pub(super) fn suggest_override(&self, mut finding: Finding) -> Finding {
        let Some(permitted) = self.report.at_max_feed_override else { return finding };
        // No override helps where the blends leave too little.
        let largest = permitted.largest_breaking_override.filter(|_| !self.report.is_kept_whole_by_blends());
        let largest = largest.map(|largest| round_down(largest, 4));
        let up_to = permitted.max_feed_override;
        if self.settings.amplitude_follows_feed_up_to.is_none()
            && largest.is_some_and(|largest| largest >= 1.0)
            && self.condition().amplitude_mm * up_to <= self.settings.max_amplitude_mm
            && self.trial.objection_to_following(up_to).is_none()
        {
            let message = format!(
                "let the amplitude follow the feed: vibration.amplitude_follows_feed_up_to = {} in the machine profile",
                decimal(up_to, 4)
            );
            finding = finding.suggest(message);
        }
        if let Some(largest) = largest.filter(|largest| *largest >= 1.0) {
            let planned = self.report.feed_override.is_some_and(|planned| planned > largest);
            let run = if planned { "run at no feed override above" } else { "permit no feed override above" };
            let message = format!(
                "{run} {} %: max_feed_override = {} in the machine profile",
                percent(largest),
                decimal(largest, 4)
            );
            return finding.suggest_value(message, None, "max_feed_override", largest, "");
        }
        // Whatever is programmed may be overridden: the feed has to be low enough at the largest override.
        match self.trial.breaking_margin().map(|margin| round_down(margin, 4)) {
            Some(ratio) if ratio > 0.0 && ratio < 1.0 && self.trial.feed_refusal(ratio).is_none() => {
                let message = format!("feed at most {} % of what is programmed", percent(ratio));
                finding.suggest_value(message, None, "feed_ratio", ratio, "")
            }
            _ => finding,
        }
    }
}
