//! The words of the block that switches the vibration on: `G200 F50 A0.03`.

use feedwave_program::{Finding, FindingCode, FindingLog, FunctionCommand, SourceSpan};
use serde::{Deserialize, Serialize};

use super::code;
use super::findings::{amplitude_word, frequency_word};
use super::{VibrationCondition, VibrationSettings};
use crate::shared::wording::round_down;

/// Lowest frequency, Hz: what a frequency word is written to. Half its period, which a corner may have to wait for
/// in the tangential modes, is minutes, and every figure derived from it stays finite.
pub const MIN_FREQUENCY_HZ: f64 = 1e-3;

/// Where the words of a vibration are, for findings that replace them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct VibrationWordSpans {
    /// The frequency word.
    pub frequency: Option<SourceSpan>,
    /// The amplitude word.
    pub amplitude: Option<SourceSpan>,
    /// Whether the amplitude word is in inches.
    pub inch: bool,
}

impl VibrationWordSpans {
    /// The places of the words of `command`.
    #[must_use]
    pub fn of(command: &FunctionCommand) -> Self {
        let span = |letter| command.word(letter).map(|word| word.span);
        Self { frequency: span('F'), amplitude: span('A'), inch: command.inch }
    }
}

/// Reads and checks the words of a block that switches the vibration on. `None`, with a finding, where a value is
/// missing, is not a positive finite number or is a frequency below [`MIN_FREQUENCY_HZ`]; a value beyond the machine's limits is an error too, but leaves a
/// condition that can be analysed further.
#[must_use]
pub fn condition_from_command(
    command: &FunctionCommand,
    command_span: SourceSpan,
    settings: &VibrationSettings,
    findings: &mut FindingLog,
) -> Option<VibrationCondition> {
    let frequency = Quantity {
        letter: 'F',
        name: "frequency",
        unit: "Hz",
        invalid: code::VIB_FREQUENCY_INVALID,
        beyond_limit: code::VIB_FREQUENCY_LIMIT,
        least: MIN_FREQUENCY_HZ,
        limit: settings.max_frequency_hz,
        limit_word: frequency_word(round_down(settings.max_frequency_hz, 3)),
        example: "F50",
    };
    let amplitude = Quantity {
        letter: 'A',
        name: "amplitude",
        unit: "mm",
        invalid: code::VIB_AMPLITUDE_INVALID,
        beyond_limit: code::VIB_AMPLITUDE_LIMIT,
        least: 0.0,
        limit: settings.max_amplitude_mm,
        limit_word: amplitude_word(round_down(settings.max_amplitude_mm, 4), command.inch),
        example: "A0.03",
    };
    // Both are read before either is judged: one pass reports everything.
    let frequency_hz = frequency.read(command, command_span, findings);
    let amplitude_mm = amplitude.read(command, command_span, findings);
    Some(VibrationCondition { frequency_hz: frequency_hz?, amplitude_mm: amplitude_mm? })
}

/// One word and what holds for it.
struct Quantity {
    letter: char,
    name: &'static str,
    unit: &'static str,
    invalid: FindingCode,
    beyond_limit: FindingCode,
    least: f64,
    limit: f64,
    limit_word: String,
    example: &'static str,
}

impl Quantity {
    fn read(&self, command: &FunctionCommand, command_span: SourceSpan, findings: &mut FindingLog) -> Option<f64> {
        let Self { letter, name, unit, least, limit, example, .. } = self;
        let Some(word) = command.word(*letter) else {
            let message = format!("the vibration has no {name} ({letter} word, {unit})");
            findings.push(
                Finding::new(self.invalid, command_span, message)
                    .suggest(format!("add the {letter} word, such as {example}")),
            );
            return None;
        };
        let value = word.value;
        if !(value.is_finite() && value > 0.0) {
            let message = format!("the vibration's {name} must be a positive number of {unit}, is {value}");
            findings.push(
                Finding::new(self.invalid, word.span, message)
                    .with_value(self.name, value, self.unit)
                    .suggest(format!("write a positive value, such as {example}")),
            );
            return None;
        }
        if value < *least {
            let message = format!("the vibration's {name} must be at least {least} {unit}, is {value:e}");
            findings.push(
                Finding::new(self.invalid, word.span, message)
                    .with_value(self.name, value, self.unit)
                    .with_value("least", *least, self.unit)
                    .suggest(format!("write a typical value, such as {example}")),
            );
            return None;
        }
        if value > self.limit {
            let message =
                format!("the vibration's {name} {value} {unit} exceeds the machine's limit of {limit} {unit}");
            findings.push(
                Finding::new(self.beyond_limit, word.span, message)
                    .with_value(self.name, value, self.unit)
                    .with_value("limit", self.limit, self.unit)
                    .suggest_value(
                        format!("use at most {limit} {unit}"),
                        Some(self.limit_word.clone()),
                        self.name,
                        self.limit,
                        self.unit,
                    ),
            );
        }
        Some(value)
    }
}

#[cfg(test)]
mod tests {
    use feedwave_program::{Function, FunctionWord, Position, Severity};

    use super::*;

    const BLOCK: SourceSpan = SourceSpan { program: 0, line: 3, column: 1, length: 14 };
    const F_WORD: SourceSpan = SourceSpan { program: 0, line: 3, column: 6, length: 3 };
    const A_WORD: SourceSpan = SourceSpan { program: 0, line: 3, column: 10, length: 5 };

    fn read(words: &[(char, f64)]) -> (Option<VibrationCondition>, Vec<Finding>) {
        let word = |&(letter, value): &(char, f64)| FunctionWord {
            letter,
            value,
            span: if letter == 'F' { F_WORD } else { A_WORD },
        };
        let words = words.iter().map(word).collect();
        let frame_offset = Position::default();
        let command = FunctionCommand { function: Function::PathVibration, on: true, inch: false, frame_offset, words };
        let mut findings = FindingLog::default();
        let condition = condition_from_command(&command, BLOCK, &VibrationSettings::default(), &mut findings);
        (condition, findings.findings().to_vec())
    }

    #[test]
    fn the_example_of_the_source_is_read() {
        let (condition, findings) = read(&[('F', 50.0), ('A', 0.03)]);
        assert_eq!(condition, Some(VibrationCondition { frequency_hz: 50.0, amplitude_mm: 0.03 }));
        assert_eq!(findings, []);
    }

    #[test]
    fn missing_and_senseless_words_are_all_reported_at_once() {
        let (condition, findings) = read(&[]);
        assert_eq!(condition, None);
        let codes: Vec<_> = findings.iter().map(|finding| (finding.code.name(), finding.span)).collect();
        assert_eq!(codes, [("VIB-FREQUENCY-INVALID", BLOCK), ("VIB-AMPLITUDE-INVALID", BLOCK)]);
        for bad in [0.0, -50.0, f64::NAN, f64::INFINITY] {
            let (condition, findings) = read(&[('F', bad), ('A', bad)]);
            assert_eq!(condition, None);
            let codes: Vec<_> = findings.iter().map(|finding| (finding.code.name(), finding.span)).collect();
            assert_eq!(codes, [("VIB-FREQUENCY-INVALID", F_WORD), ("VIB-AMPLITUDE-INVALID", A_WORD)]);
            assert!(findings.iter().all(|finding| finding.severity == Severity::Error));
        }
    }

    #[test]
    fn a_frequency_that_is_none_is_refused() {
        for low in [5e-324, 1e-310, 0.000_999] {
            let (condition, findings) = read(&[('F', low), ('A', 0.03)]);
            assert_eq!(condition, None);
            assert_eq!((findings[0].code.name(), findings[0].span), ("VIB-FREQUENCY-INVALID", F_WORD));
        }
        assert!(read(&[('F', MIN_FREQUENCY_HZ), ('A', 0.03)]).0.is_some());
    }

    #[test]
    fn values_beyond_the_limits_suggest_the_limit() {
        let (condition, findings) = read(&[('F', 5_000.0), ('A', 30.0)]);
        assert!(condition.is_some(), "the rest of the section is still analysed");
        let replacements: Vec<_> =
            findings.iter().map(|finding| finding.suggestions[0].replacement.clone().unwrap()).collect();
        assert_eq!(replacements, ["F500", "A1.0"]);
        assert_eq!(findings[0].code, "VIB-FREQUENCY-LIMIT");
        assert_eq!(findings[1].code, "VIB-AMPLITUDE-LIMIT");
    }
}
