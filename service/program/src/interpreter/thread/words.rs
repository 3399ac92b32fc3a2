//! Words of threading cycles: lengths, counts and what is wrong with them.

use core::ops::RangeInclusive;

use super::super::execute::{Execution, MM_PER_INCH};
use crate::Finding;
use crate::block::Word;
use crate::code;

/// Depths, heights and leads of cycles, mm: far beyond any thread, so that larger numbers are mistakes.
pub(super) const DEPTHS_MM: RangeInclusive<f64> = 1e-4..=100.0;

/// Amounts that may be missing, mm.
pub(super) const AMOUNTS_MM: RangeInclusive<f64> = 0.0..=100.0;

impl Execution<'_> {
    /// A length that is counted in least increments without a decimal point whatever the machine's rule, mm.
    pub(in super::super) fn thousandths(&self, word: &Word) -> f64 {
        let value = word.number.value();
        match (word.number.has_point(), self.state.inch) {
            (true, true) => value * MM_PER_INCH,
            (true, false) => value,
            (false, true) => value / 10_000.0 * MM_PER_INCH,
            (false, false) => value / 1_000.0,
        }
    }

    /// A depth that the cycle needs, mm; `None` after a finding.
    pub(super) fn depth(&mut self, letter: u8, name: &'static str, read: impl Fn(&Self, &Word) -> f64) -> Option<f64> {
        let word = self.needed(letter, name)?;
        self.checked(&word, read(self, &word), name, DEPTHS_MM)
    }

    /// A word that the cycle needs; `None` after a finding.
    pub(super) fn needed(&mut self, letter: u8, name: &'static str) -> Option<Word> {
        let word = self.take(letter);
        if word.is_none() {
            let span = self.block.span();
            self.findings.push_with(code::THREAD_CYCLE_WORD, |code| {
                let (letter, name) = (char::from(letter), name.replace('_', " "));
                let message = format!("the threading cycle needs {letter}, its {name}");
                Finding::new(code, span, message).suggest(format!("add {letter} to the block"))
            });
        }
        word
    }

    /// A length of the cycle, mm: `Some(None)` without the word, `None` after a finding.
    pub(super) fn optional_length(
        &mut self,
        letter: u8,
        name: &'static str,
        range: RangeInclusive<f64>,
    ) -> Option<Option<f64>> {
        match self.take(letter) {
            Some(word) => self.checked(&word, self.scaled(&word, true), name, range).map(Some),
            None => Some(None),
        }
    }

    /// The value of a word if it is in range; `None` after a finding.
    pub(super) fn checked(
        &mut self,
        word: &Word,
        value: f64,
        name: &'static str,
        range: RangeInclusive<f64>,
    ) -> Option<f64> {
        if range.contains(&value) {
            return Some(value);
        }
        self.cycle_value(word, |mut finding| {
            let (least, most) = (*range.start(), *range.end());
            finding.message = format!("the {} is {value}, but must be {least} to {most}", name.replace('_', " "));
            finding
                .with_value(name, value, "")
                .with_value("min", least, "")
                .with_value("max", most, "")
                .suggest(format!("write {least} to {most}, or check whether its decimal point is missing"))
        });
        None
    }

    /// A whole number; `None` after a finding.
    pub(super) fn cycle_count(
        &mut self,
        letter: u8,
        name: &'static str,
        default: u32,
        range: RangeInclusive<f64>,
    ) -> Option<u32> {
        let Some(word) = self.take(letter) else {
            return Some(default);
        };
        let count = self.whole(&word)?;
        self.checked(&word, f64::from(count), name, range).map(|_| count)
    }

    #[cold]
    pub(super) fn cycle_value(&mut self, word: &Word, fill: impl FnOnce(Finding) -> Finding) {
        let span = self.block.word_span(word);
        self.findings.push_with(code::THREAD_CYCLE_VALUE, |code| fill(Finding::new(code, span, "")));
    }

    #[cold]
    pub(super) fn cycle_word_missing(&mut self, message: &'static str) {
        let span = self.block.span();
        self.findings.push_with(code::THREAD_CYCLE_WORD, |code| {
            Finding::new(code, span, message).suggest("add the missing words")
        });
    }
}
