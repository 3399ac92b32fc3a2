//! The codes of machining functions: which words they take, and whether they switch on or off.

use super::execute::Execution;
use crate::code;
use crate::dialect::{FunctionWordRule, Group, Meaning, function_words, letter_bit};
use crate::{Finding, Function, FunctionCommand, FunctionSwitch, FunctionWord, OperationKind, SourceSpan};

impl Execution<'_> {
    /// Collects the words of a machining function's block.
    pub(super) fn function(&mut self) -> Option<(SourceSpan, FunctionCommand)> {
        let (meaning, span) = self.code(Group::Function)?;
        let (function, on) = match meaning {
            Meaning::Function { function, on } => (function, on),
            Meaning::FunctionSwitch(function) => (function, self.function_switch(span)?),
            _ => return None,
        };
        if function == Function::Thinning && !self.switch_thinning(on, span) {
            return None;
        }
        let rules = function_words(function, on);
        let mut words = Vec::with_capacity(rules.len());
        for &FunctionWordRule { letter, is_length, required, instead } in rules {
            // What is in its place was read; this one is no word of the function then.
            if instead.is_some_and(|other| words.iter().any(|word: &FunctionWord| word.letter == char::from(other))) {
                continue;
            }
            if let Some(word) = self.take(letter) {
                let value = match letter {
                    b'X' => self.radius(&word),
                    _ if is_length => self.scaled(&word, true),
                    _ => word.number.value(),
                };
                words.push(FunctionWord { letter: char::from(letter), value, span: self.block.word_span(&word) });
            } else if required && instead.is_none_or(|other| self.block.letters & letter_bit(other) == 0) {
                self.findings.push_with(code::FUNCTION_WORD_MISSING, |code| {
                    let letter = char::from(letter);
                    Finding::new(code, span, format!("the machining function needs {letter}"))
                        .suggest(format!("add {letter} to the block"))
                });
            }
        }
        let others = letter_bit(b'S') | letter_bit(b'T');
        let mut foreign = self.block.letters & !self.used & !others;
        while foreign != 0 {
            let place = foreign.trailing_zeros() as usize;
            foreign &= foreign - 1;
            self.used |= 1 << place;
            let word_span = self.block.word_span(self.block.slot(place));
            self.findings.push_with(code::FUNCTION_WORD, |code| {
                let letter = char::from(b'A' + place as u8);
                let message = format!("{letter} is not a word of this machining function");
                Finding::new(code, word_span, message).suggest("write it in a block of its own")
            });
        }
        Some((span, FunctionCommand { function, on, inch: self.state.inch, frame_offset: self.frame_offset(), words }))
    }

    /// Whether a function is switched off that an error has kept from being on: that was reported, and is no second error.
    fn is_off_already(&mut self, command: &FunctionCommand) -> bool {
        let function = command.function;
        let is_off = !command.on
            && self.state.functions_refused.contains(function)
            && !self.state.functions_on.contains(function);
        if is_off {
            self.state.functions_refused.set(function, false);
        }
        is_off
    }

    /// Whether the `P` of a function's block switches it on or off; `None` after a finding.
    fn function_switch(&mut self, span: SourceSpan) -> Option<bool> {
        let FunctionSwitch { on_p, off_p, .. } = self.settings.thread_vibration;
        let word = self.take(b'P');
        let value = word.map(|word| word.number.value());
        if value == Some(f64::from(on_p)) {
            return Some(true);
        }
        if value == Some(f64::from(off_p)) {
            return Some(false);
        }
        // What its other words mean is not known; that it was to be switched on is likely.
        self.state.functions_refused.set(Function::ThreadVibration, true);
        self.used |= self.block.letters & !(letter_bit(b'S') | letter_bit(b'T'));
        let span = word.map_or(span, |word| self.block.word_span(&word));
        self.findings.push_with(code::FUNCTION_SWITCH, |code| {
            let mut finding = Finding::new(code, span, "no P says whether on or off");
            if let Some(value) = value {
                finding.message = format!("P{value} says neither on nor off");
                finding = finding.with_value("p", value, "");
            }
            finding.suggest(format!("write P{on_p} to switch it on, P{off_p} to switch it off"))
        });
        None
    }

    /// Emits what switches a machining function.
    pub(super) fn switch(&mut self, function: Option<(SourceSpan, FunctionCommand)>) {
        if let Some((span, command)) = function
            && !self.is_off_already(&command)
        {
            self.emit(span, OperationKind::Function(command));
        }
    }
}
