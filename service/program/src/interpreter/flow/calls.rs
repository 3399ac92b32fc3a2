//! Calls of programs by codes: `M97`, `M98`, `M99`, `M198`, `G65` to `G67`.

use super::line::skip_blanks;
use super::{CallKind, CallRequest, CallTarget, Interpreter, Jump, ModalCall, Pending};
use crate::block::{Rest, no_program_name};
use crate::code;
use crate::consequence;
use crate::dialect::{CodeTable, Flow, Group, Meaning, letter_bit};
use crate::lexer::{Lexer, TokenKind};
use crate::parameters::LOCALS;
use crate::{DecimalPointRule, Finding, FindingLog, LanguageSettings, ProgramName, SourceSpan};

/// Most repetitions of a called program.
const MAX_REPEATS: u32 = 99_999_999;
/// Most macros that are run behind every block that moves.
const MAX_MODAL: usize = 4;

/// The local variable of an argument's letter; 0 for letters that pass none.
const fn local_of(letter: u8) -> usize {
    match letter {
        b'A' => 1,
        b'B' => 2,
        b'C' => 3,
        b'I' => 4,
        b'J' => 5,
        b'K' => 6,
        b'D' => 7,
        b'E' => 8,
        b'F' => 9,
        b'H' => 11,
        b'M' => 13,
        b'Q' => 17,
        b'R' => 18,
        b'S' => 19,
        b'T' => 20,
        b'U' => 21,
        b'V' => 22,
        b'W' => 23,
        b'X' => 24,
        b'Y' => 25,
        b'Z' => 26,
        _ => 0,
    }
}

/// The number of the program that `P` of `M98` calls, and the repetitions that stand before it: with more than four digits
/// and no `L`, where numbers of programs have four.
pub(crate) fn called_program(
    table: &CodeTable,
    settings: &LanguageSettings,
    p: u32,
    digits: u32,
    has_l: bool,
) -> (u32, Option<u32>) {
    let splits = table.dialect.flow == Flow::MacroB
        && settings.program_number_digits == 4
        && !has_l
        && (digits > 4 || p > 9_999);
    if splits { (p % 10_000, Some(p / 10_000).filter(|&repeats| repeats > 0)) } else { (p, None) }
}

/// The words of a macro call.
#[derive(Default)]
struct Arguments {
    locals: Vec<Option<f64>>,
    program: Option<f64>,
    name: Option<ProgramName>,
    repeats: Option<f64>,
    /// Place of the last of I, J and K, 0 before the first, and the triple that it belongs to.
    last: (u8, usize),
}

impl Arguments {
    /// Takes a word; whether its letter passes an argument.
    ///
    /// I, J and K come in triples: a letter that repeats or goes back in their order opens the next one. The first triple is that of
    /// the letters themselves (`I4 J5 K6`).
    fn take(&mut self, letter: u8, value: Option<f64>) -> bool {
        let local = match letter {
            b'I' | b'J' | b'K' => {
                let place = letter - b'I' + 1;
                if place <= self.last.0 {
                    self.last.1 += 1;
                }
                self.last.0 = place;
                3 * (self.last.1 + 1) + usize::from(place)
            }
            _ => local_of(letter),
        };
        if local == 0 || local > LOCALS {
            return false;
        }
        self.locals.resize(LOCALS, None);
        self.locals[local - 1] = value;
        true
    }
}

impl Interpreter {
    /// What the subprogram code of the present block asks for.
    pub(in crate::interpreter) fn subprogram(&mut self, findings: &mut FindingLog) -> bool {
        let Some(code) = self.block.code(Group::Subprogram) else { return true };
        let (meaning, span) = (self.table.code(code.place).meaning, self.block.code_span(code));
        match meaning {
            Meaning::Call => self.plain_call(span, findings),
            Meaning::LocalCall => match self.whole_word(b'P') {
                Some(label) => {
                    self.wait_for_call(span, CallTarget::Label(label));
                    true
                }
                None => self.no_program(span, findings),
            },
            Meaning::Return => {
                if self.state.flow.calls.last().is_some_and(|call| call.kind == CallKind::Sub) {
                    let message =
                        "M99 returns from a program that M98 has called, but this one was called by an O-word";
                    findings.push_with(code::SUBPROGRAM_END, |code| {
                        Finding::new(code, span, message).suggest("end it with endsub, or return before its end")
                    });
                    return false;
                }
                if self.table.dialect.is_linuxcnc && self.block.word(b'P').is_some() {
                    findings.push_with(code::JUMP_TARGET, |code| {
                        Finding::new(code, span, "M99 of LinuxCNC takes no P: it returns behind the call")
                            .suggest("leave P out, or write the loop with O-words")
                    });
                    return false;
                }
                self.state.flow.has_decided |= self.block.word(b'P').is_some_and(|word| word.number.is_computed());
                self.end_call(span, self.whole_word(b'P'));
                true
            }
            _ => true,
        }
    }

    /// A word of the block as a whole number.
    fn whole_word(&self, letter: u8) -> Option<u32> {
        let value = self.block.word(letter)?.number.value();
        ((0.0..=99_999_999.0).contains(&value) && libm::rint(value) == value).then_some(value as u32)
    }

    /// `M98`, `M198`.
    fn plain_call(&mut self, span: SourceSpan, findings: &mut FindingLog) -> bool {
        let label = self.whole_word(b'Q');
        let times = self.whole_word(b'L');
        let called = self.called_name.take().filter(|_| matches!(self.block.rest, Some(Rest::CalledName(_))));
        let (name, before) = match (called, self.whole_word(b'P')) {
            (Some(name), None) => (name, None),
            (Some(name), Some(_)) => return self.called_twice::<()>(&name, span, findings).is_some(),
            (None, Some(p)) => {
                let digits = self.block.word(b'P').map_or(0, |word| word.number.integer_digits());
                let has_l = self.block.word(b'L').is_some();
                let (number, before) = called_program(&self.table, &self.settings, p, digits, has_l);
                (ProgramName::Number(number), before)
            }
            (None, None) => {
                if let Some(label) = label {
                    self.wait_for_call(span, CallTarget::Label(label));
                    return true;
                }
                return self.no_program(span, findings);
            }
        };
        if times == Some(0) && self.reports_no_repeats(span, findings) {
            return false;
        }
        let repeats = before.or(times).unwrap_or(1);
        let target = CallTarget::Program { name, label };
        self.wait_for_call_of(span, target, repeats);
        true
    }

    fn wait_for_call(&mut self, span: SourceSpan, target: CallTarget) {
        let repeats = self.whole_word(b'L').unwrap_or(1);
        self.wait_for_call_of(span, target, repeats);
    }

    fn wait_for_call_of(&mut self, span: SourceSpan, target: CallTarget, repeats: u32) {
        let (kind, by_code) = (CallKind::Plain, self.block.calls_by_code);
        self.wait(span, Jump::Call(CallRequest { kind, target, repeats, arguments: Vec::new(), by_code }));
    }

    #[cold]
    fn no_program(&self, span: SourceSpan, findings: &mut FindingLog) -> bool {
        if consequence::follows_from(code::SUBPROGRAM_MISSING, self.block.unread, self.state.unread) {
            return false;
        }
        findings.push_with(code::SUBPROGRAM_MISSING, |code| {
            Finding::new(code, span, "no P says which program is called")
                .suggest("add P with the number of the program")
        });
        false
    }

    /// Waits for a jump at the end of the present line.
    pub(in crate::interpreter) fn wait(&mut self, span: SourceSpan, jump: Jump) {
        let from = super::Mark { place: self.state.place, lines: self.state.lines.saturating_sub(1) };
        self.state.flow.pending = Some(Box::new(Pending { span, from, behind: from, jump }));
    }

    /// `M99`, `endsub`, `return`: back to the caller; in the main program to a block, or to its end.
    pub(super) fn end_call(&mut self, span: SourceSpan, label: Option<u32>) {
        match (self.state.flow.calls.is_empty(), label) {
            (false, label) => self.wait(span, Jump::Return(label)),
            (true, Some(label)) => self.wait(span, Jump::MainReturn(label)),
            (true, None) => self.state.flow.restarts_at = Some(span),
        }
    }

    /// `G65`, `G66` with the words behind the code, from `at` on.
    pub(in crate::interpreter) fn macro_call(
        &mut self,
        line: &[u8],
        at: usize,
        modal: bool,
        findings: &mut FindingLog,
    ) -> bool {
        let span = self.span_in(line, skip_blanks(line, 0), line.trim_ascii_end().len());
        if self.block.has_words_before_call() {
            let message =
                "a macro call is not the first code of its block, so that what stands before it would be lost";
            findings.push_with(code::STATEMENT, |code| {
                Finding::new(code, span, message).suggest("write what stands before it in a block of its own before")
            });
            return false;
        }
        let Some(arguments) = self.arguments(line, at, findings) else { return false };
        let whole = |value: Option<f64>| value.filter(|it| libm::rint(*it) == *it && (0.0..=99_999_999.0).contains(it));
        let number = whole(arguments.program).map(|number| ProgramName::Number(number as u32));
        let Some(name) = arguments.name.or(number) else { return self.no_program(span, findings) };
        let repeats = match arguments.repeats {
            None => 1,
            Some(repeats) => whole(Some(repeats)).map_or(1, |repeats| repeats as u32).min(MAX_REPEATS),
        };
        if repeats == 0 && self.reports_no_repeats(span, findings) {
            return false;
        }
        let target = CallTarget::Program { name, label: None };
        let kind = if modal { CallKind::Modal { level: 0 } } else { CallKind::Macro };
        let by_code = self.block.calls_by_code;
        let request = CallRequest { kind, target, repeats, arguments: arguments.locals, by_code };
        if !modal {
            self.wait(span, Jump::Call(request));
            return true;
        }
        if self.state.flow.modal.len() >= MAX_MODAL {
            findings.push_with(code::CALL_DEPTH, |code| {
                Finding::new(code, span, format!("more than {MAX_MODAL} modal macros"))
                    .suggest("end one with G67 before")
            });
            return false;
        }
        self.state.flow.modal.push(ModalCall { request, span });
        true
    }

    /// The words behind `G65`.
    fn arguments(&mut self, line: &[u8], mut at: usize, findings: &mut FindingLog) -> Option<Arguments> {
        let mut arguments = Arguments::default();
        // A code that the profile replaces has said which program it calls.
        let by_code = self.block.calls_by_code;
        if by_code {
            let said = |letter| self.block.word(letter).map(|word| word.number.value());
            (arguments.program, arguments.repeats) = (said(b'P'), said(b'L'));
        }
        let mut seen = 0;
        loop {
            at = skip_blanks(line, at);
            let Some(token) = Lexer::new(&line[at..]).next() else { return Some(arguments) };
            let span = self.span_in(line, at + token.start as usize, at + token.end as usize);
            if matches!(token.kind, TokenKind::Comment) {
                at += token.end as usize;
                continue;
            }
            if line[at] == b'<' {
                at = self.argument_name(line, at, seen == 0, &mut arguments, findings)?;
                continue;
            }
            let letter = line[at].to_ascii_uppercase();
            if !letter.is_ascii_alphabetic() {
                return self.bad_statement(span, "this is no argument of a macro", findings);
            }
            // I, J and K come in triples.
            if seen & letter_bit(letter) != 0 && !matches!(letter, b'I' | b'J' | b'K') {
                return self.argument_twice(letter, span, findings);
            }
            seen |= letter_bit(letter);
            if !matches!(letter, b'P' | b'L') && local_of(letter) == 0 {
                let message = format!("{} passes no argument to a macro", char::from(letter));
                return self.bad_statement(span, &message, findings);
            }
            let (value, end) = self.value(line, at + 1, findings)?;
            let is_written_whole = token.kind == TokenKind::Word && !token.number.has_point();
            match letter {
                b'P' if let Some(name) = &arguments.name => return self.called_twice(name, span, findings),
                b'P' if by_code => return self.bad_statement(span, "P passes no argument to a macro", findings),
                b'P' => arguments.program = value,
                b'L' => arguments.repeats = value,
                _ => {
                    let scaled = self.argument(letter, value, is_written_whole, span, findings);
                    if !arguments.take(letter, scaled) {
                        let message = format!("{} passes no argument to a macro", char::from(letter));
                        return self.bad_statement(span, &message, findings);
                    }
                }
            }
            at = end;
        }
    }

    /// The name in `< >` at `at`, directly behind the code of a macro call: where it ends.
    fn argument_name(
        &self,
        line: &[u8],
        at: usize,
        is_first: bool,
        arguments: &mut Arguments,
        findings: &mut FindingLog,
    ) -> Option<usize> {
        let is_haas = self.settings.is_haas();
        let is_free = is_first && !is_haas && arguments.program.is_none() && arguments.name.is_none();
        if let Some((name, length)) = ProgramName::read(&line[at..]).filter(|_| is_free) {
            arguments.name = Some(name);
            return Some(at + length);
        }
        let end = line[at..].iter().position(|&byte| byte == b'>').map_or(line.len(), |length| at + length + 1);
        let span = self.span_in(line, at, end);
        findings.push_with(code::NUMBER_MISSING, |code| {
            no_program_name(Finding::new(code, span, ""), &line[at..end], is_haas)
        });
        None
    }

    /// A call that names its program by a name and by `P`.
    #[cold]
    fn called_twice<T>(&self, name: &ProgramName, span: SourceSpan, findings: &mut FindingLog) -> Option<T> {
        findings.push_with(code::WORD_CONFLICT, |code| {
            Finding::new(code, span, format!("both {name} and P say which program is called"))
                .suggest("keep one of them")
        });
        None
    }

    #[cold]
    fn argument_twice(&self, letter: u8, span: SourceSpan, findings: &mut FindingLog) -> Option<Arguments> {
        findings.push_with(code::WORD_DUPLICATE, |code| {
            let message =
                format!("{} stands twice in the macro call: which one counts is not said", char::from(letter));
            Finding::new(code, span, message).suggest("keep one of them; I, J and K alone may repeat")
        });
        None
    }

    /// The value of an argument: without a decimal point it counts in least increments where the machine's numbers do.
    fn argument(
        &self,
        letter: u8,
        value: Option<f64>,
        is_written_whole: bool,
        span: SourceSpan,
        findings: &mut FindingLog,
    ) -> Option<f64> {
        // A feed means what it does in a block.
        let counts = !matches!(letter, b'D' | b'E' | b'F' | b'H' | b'M' | b'S' | b'T');
        let value = value?;
        if !(is_written_whole && counts && value != 0.0) {
            return Some(value);
        }
        let scales = self.settings.decimal_point == DecimalPointRule::LeastIncrement;
        let scaled = if scales { value / if self.state.inch { 10_000.0 } else { 1_000.0 } } else { value };
        findings.push_with(code::ARGUMENT_WITHOUT_POINT, |code| {
            let letter = char::from(letter);
            Finding::new(code, span, format!("{letter}{value} without a decimal point passes {scaled}"))
                .with_value("value", value, "")
                .with_value("passed", scaled, "")
                .suggest_replacement("write the decimal point", format!("{letter}{scaled:?}"))
        });
        Some(scaled)
    }

    /// `L0` of a call of Macro B, which is then reported: some controls pass the call over, others make it once.
    #[cold]
    fn reports_no_repeats(&self, span: SourceSpan, findings: &mut FindingLog) -> bool {
        let is_unclear = self.table.dialect.flow == Flow::MacroB;
        if is_unclear {
            findings.push_with(code::WORD_CONFLICT, |code| {
                Finding::new(code, span, "L0: some controls pass the call over, others make it once")
                    .suggest("leave L out for one call, or leave the block out")
            });
        }
        is_unclear
    }

    /// `G67`: the newest modal macro ends.
    pub(in crate::interpreter) fn end_modal_call(&mut self) {
        self.state.flow.modal.pop();
    }

    /// After a block that moved: runs the modal macro that is in force.
    pub(in crate::interpreter) fn call_modal(&mut self) {
        let flow = &self.state.flow;
        if flow.pending.is_some() {
            return;
        }
        let within = flow.calls.iter().rev().find_map(|call| call.kind.modal_level());
        let in_force = within.unwrap_or(flow.modal.len());
        let Some(level) = in_force.checked_sub(1) else { return };
        let Some(ModalCall { request, span }) = flow.modal.get(level).cloned() else { return };
        let request = CallRequest { kind: CallKind::Modal { level: level as u32 }, ..request };
        self.wait(span, Jump::Call(request));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn locals(words: &str) -> Vec<(usize, f64)> {
        let mut arguments = Arguments::default();
        for word in words.split(' ') {
            assert!(arguments.take(word.as_bytes()[0], Some(word[1..].parse().unwrap())), "{word}");
        }
        let set = arguments.locals.iter().enumerate();
        set.filter_map(|(place, value)| value.map(|value| (place + 1, value))).collect()
    }

    #[test]
    fn letters_pass_their_variables() {
        let letters = "A1 B2 C3 D7 E8 F9 H11 I4 J5 K6 M13 Q17 R18 S19 T20 U21 V22 W23 X24 Y25 Z26";
        assert!(locals(letters).iter().all(|(place, value)| *place as f64 == *value));
        assert!("GLNOP".bytes().all(|letter| local_of(letter) == 0));
    }

    #[test]
    fn triples_go_on_where_a_letter_repeats_or_goes_back() {
        assert_eq!(locals("A1 B2 I-3 I4 D5"), [(1, 1.0), (2, 2.0), (4, -3.0), (7, 5.0)], "the later word wins");
        assert_eq!(locals("A5 B10 I1 I2 K3"), [(1, 5.0), (2, 10.0), (4, 1.0), (7, 2.0), (9, 3.0)]);
        assert_eq!(locals("K1 I2 J3 I4"), [(6, 1.0), (7, 2.0), (8, 3.0), (10, 4.0)]);
    }
}
