//! The switch of a modal function: on, off, on again while it is on, and still on at the end of the program.

use feedwave_program::{Finding, FindingCode, FindingLog, FunctionCommand, SourceSpan};
use serde::{Deserialize, Serialize};

/// What a modal function is switched on with.
pub(crate) trait Modal {
    /// The function with its article, such as "the oscillation".
    const NAME: &'static str;
    /// It is switched off but was not on.
    const OFF_WITHOUT_ON: FindingCode;
    /// It is switched on while it is on.
    const NESTED: FindingCode;
    /// It is on at the end of the program.
    const UNCLOSED: FindingCode;

    /// Where it was switched on.
    fn on_span(&self) -> SourceSpan;
}

/// A modal function of the program. What is open of it is closed before it is switched.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Switch<T> {
    on: Option<T>,
    /// Whether it was switched on with words that cannot be used: an error that was reported already.
    unusable: bool,
}

impl<T> Default for Switch<T> {
    fn default() -> Self {
        Self { on: None, unusable: false }
    }
}

impl<T: Modal> Switch<T> {
    pub(crate) fn on(&self) -> Option<&T> {
        self.on.as_ref()
    }

    pub(crate) fn on_mut(&mut self) -> Option<&mut T> {
        self.on.as_mut()
    }

    pub(crate) const fn is_on(&self) -> bool {
        self.on.is_some()
    }

    /// Whether it was switched on with words that cannot be used, which was reported.
    pub(crate) const fn is_unusable(&self) -> bool {
        self.unusable
    }

    /// Carries out a block that switches the function; `read` reads the words that switch it on.
    pub(crate) fn turn(
        &mut self,
        command: &FunctionCommand,
        span: SourceSpan,
        findings: &mut FindingLog,
        read: impl FnOnce(&mut FindingLog) -> Option<T>,
    ) {
        let (before, name) = (self.on.take(), T::NAME);
        let was_unusable = std::mem::take(&mut self.unusable);
        if !command.on {
            if before.is_none() && !was_unusable {
                let message = format!("{name} is switched off but was not on");
                let cure = format!("remove the block, or switch {name} on before it");
                findings.push(Finding::new(T::OFF_WITHOUT_ON, span, message).suggest(cure));
            }
            return;
        }
        if let Some(before) = before {
            let line = before.on_span().line;
            let message = format!("{name} is on already, since line {line}");
            findings.push(
                Finding::new(T::NESTED, span, message)
                    .with_value("on_line", f64::from(line), "")
                    .suggest("switch it off before it is switched on with other values"),
            );
        }
        self.on = read(findings);
        self.unusable = self.on.is_none();
    }

    /// The program ends.
    pub(crate) fn end(&mut self, findings: &mut FindingLog) {
        if let Some(on) = self.on.take() {
            let name = T::NAME;
            let message = format!("the program ends while {name} switched on here is still on");
            let cure = format!("switch {name} off before the end of the program");
            findings.push(Finding::new(T::UNCLOSED, on.on_span(), message).suggest(cure));
        }
    }
}

#[cfg(test)]
mod tests {
    use feedwave_program::{Function, Position};

    use super::*;
    use crate::functions::path_vibration::code;

    struct On(SourceSpan);

    impl Modal for On {
        const NAME: &'static str = "the function";
        const OFF_WITHOUT_ON: FindingCode = code::VIB_OFF_WITHOUT_ON;
        const NESTED: FindingCode = code::VIB_NESTED;
        const UNCLOSED: FindingCode = code::VIB_UNCLOSED;

        fn on_span(&self) -> SourceSpan {
            self.0
        }
    }

    /// Codes and lines of what is found where a switch is turned like this (line, on, words usable), then the program ends.
    fn found(turns: &[(u32, bool, bool)]) -> Vec<(String, u32)> {
        let (mut switch, mut findings) = (Switch::<On>::default(), FindingLog::default());
        for &(line, on, usable) in turns {
            let span = SourceSpan { line, column: 1, length: 4, ..SourceSpan::default() };
            let command = FunctionCommand {
                function: Function::PathVibration,
                on,
                words: Vec::new(),
                inch: false,
                frame_offset: Position::default(),
            };
            switch.turn(&command, span, &mut findings, |_| usable.then_some(On(span)));
            assert_eq!((switch.is_on(), switch.is_unusable()), (on && usable, on && !usable));
        }
        switch.end(&mut findings);
        findings.into_findings().iter().map(|finding| (finding.code.to_string(), finding.span.line)).collect()
    }

    #[test]
    fn on_and_off_in_turn_say_nothing() {
        assert_eq!(found(&[(1, true, true), (2, false, true), (3, true, true), (4, false, true)]), []);
    }

    #[test]
    fn every_mistake_is_found_once_and_where_it_is() {
        assert_eq!(found(&[(1, false, true)]), [("VIB-OFF-WITHOUT-ON".to_owned(), 1)]);
        let nested = found(&[(1, true, true), (2, true, true), (3, false, true)]);
        assert_eq!(nested, [("VIB-NESTED".to_owned(), 2)]);
        assert_eq!(
            found(&[(1, true, true), (5, true, true)]),
            [("VIB-NESTED".to_owned(), 5), ("VIB-UNCLOSED".to_owned(), 5)]
        );
    }

    #[test]
    fn words_that_cannot_be_used_were_reported_and_excuse_the_block_that_switches_off() {
        assert_eq!(found(&[(1, true, false), (2, false, true)]), []);
        assert_eq!(found(&[(1, true, false), (2, true, true), (3, false, true)]), []);
        assert_eq!(found(&[(1, true, false)]), []);
    }
}
