//! Statements of Macro B: `GOTO`, `IF`, `WHILE`, `DO`, `END`.

use super::bounds::Round;
use super::line::{digits, is_blank_or_comment, letters, return_code};
use super::{Interpreter, Jump, Loop, LoopKind};
use crate::code;
use crate::dialect::Flow;
use crate::lexer::{Lexer, Token, TokenKind};
use crate::{Finding, FindingLog, Operation, SourceSpan};

/// What a statement leaves of its line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Left {
    /// It is done.
    Nothing,
    /// A block is to be executed, from this offset on.
    Block(usize),
}

/// Largest number of a block that a jump leads to.
const LARGEST_TARGET: f64 = 99_999_999.0;

impl Interpreter {
    /// Executes the statement whose first letter is at `at`: what it leaves; nothing after an error, which ends the program.
    pub(super) fn macro_statement(
        &mut self,
        line: &[u8],
        at: usize,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> Option<Left> {
        let (start, end) = letters(line, at);
        let span = self.span_in(line, start, line.trim_ascii_end().len());
        if self.table.dialect.flow == Flow::OWords {
            return self.statement_of_macro_b(span, findings);
        }
        let word = line[start..end].to_ascii_uppercase();
        if word == b"IF" {
            return self.if_statement(line, end, span, operations, findings);
        }
        let done = match word.as_slice() {
            b"" if line.get(start) == Some(&b'[') => self.jump_on_condition(line, start, span, findings),
            b"GOTO" => self.goto(line, end, span, findings),
            b"WHILE" => self.while_statement(line, end, span, findings),
            b"WH" if self.settings.is_haas() => self.while_statement(line, end, span, findings),
            b"WH" => self.bad_statement(span, "WH is WHILE on Haas controls only: write WHILE", findings),
            b"DO" => self.begin_loop(line, end, true, span, findings),
            b"END" => self.end_loop(line, end, span, findings),
            _ => self.bad_statement(span, "this is no statement: IF, GOTO, WHILE, DO and END are", findings),
        };
        done.map(|()| Left::Nothing)
    }

    /// Refuses a statement in a dialect whose control flow is made of O-words: its control reads letters there that are no words.
    #[cold]
    fn statement_of_macro_b(&self, span: SourceSpan, findings: &mut FindingLog) -> Option<Left> {
        findings.push_with(code::STATEMENT, |code| {
            Finding::new(code, span, "this is a statement of Macro B, which LinuxCNC does not have")
                .suggest("write it with O-words, such as o100 if [#1 GT 2] … o100 endif, or o100 while [#1 LT 5] … o100 endwhile")
        });
        None
    }

    /// The place of some bytes of the present line.
    pub(super) fn span_in(&self, line: &[u8], start: usize, end: usize) -> SourceSpan {
        let end = end.clamp(start, line.len());
        SourceSpan {
            program: self.state.place.program,
            line: self.state.lines,
            column: start as u32 + 1,
            length: (end - start) as u32,
        }
    }

    #[cold]
    pub(super) fn bad_statement<T>(&self, span: SourceSpan, message: &str, findings: &mut FindingLog) -> Option<T> {
        findings.push_with(code::STATEMENT, |code| Finding::new(code, span, message));
        None
    }

    fn goto(&mut self, line: &[u8], at: usize, span: SourceSpan, findings: &mut FindingLog) -> Option<()> {
        let (value, end) = self.value(line, at, findings)?;
        let number = self.target_number(value, span, findings)?;
        if !is_blank_or_comment(line, end) {
            return self.bad_statement(span, "GOTO must be last in its block", findings);
        }
        self.wait(span, Jump::Label(number));
        Some(())
    }

    /// The number of a block that is jumped to.
    pub(super) fn target_number(&self, value: Option<f64>, span: SourceSpan, findings: &mut FindingLog) -> Option<u32> {
        let number = value.map(f64::round).filter(|number| (1.0..=LARGEST_TARGET).contains(number));
        let is_whole = |number: &f64| value.is_some_and(|value| (value - number).abs() <= 1e-4);
        match number.filter(is_whole) {
            Some(number) => Some(number as u32),
            None => {
                findings.push_with(code::JUMP_TARGET, |code| {
                    let shown = value.map_or("nothing".to_owned(), |value| value.to_string());
                    let finding = Finding::new(code, span, format!("{shown} is not the number of a block"));
                    finding.with_value("number", value.unwrap_or(0.0), "").suggest("jump to a whole number from 1 on")
                });
                None
            }
        }
    }

    fn if_statement(
        &mut self,
        line: &[u8],
        at: usize,
        span: SourceSpan,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> Option<Left> {
        let (holds, at) = self.condition(line, at, findings)?;
        let (start, end) = letters(line, at);
        let word = line[start..end].to_ascii_uppercase();
        match word.as_slice() {
            b"GOTO" if holds => self.goto(line, end, span, findings)?,
            b"GOTO" => {}
            // A word may follow directly: `THENM30`.
            [b'T', b'H', b'E', b'N', ..] => {
                return self.then_statement(line, start + 4, holds, span, operations, findings);
            }
            b"M" if return_code(line, at).is_some() => {
                let label = self.label_of_return(line, at, span, findings)?;
                if holds {
                    self.end_call(span, label);
                }
            }
            _ => {
                return self.bad_statement(
                    span,
                    "behind the condition must be GOTO with a number, THEN or M99",
                    findings,
                );
            }
        }
        Some(Left::Nothing)
    }

    /// `[…] M99 P10` of Haas controls, which is `IF […] GOTO 10`; without `P` a return.
    fn jump_on_condition(&mut self, line: &[u8], at: usize, span: SourceSpan, findings: &mut FindingLog) -> Option<()> {
        if !self.settings.is_haas() {
            findings.push_with(code::STATEMENT, |code| {
                Finding::new(code, span, "a condition without IF before M99 is of Haas controls, and the profile is not of one")
                    .suggest("write IF […] GOTO with the number of the block, or set drilling.style of the language settings to DRILLING_STYLE_HAAS")
            });
            return None;
        }
        let (holds, at) = self.condition(line, at, findings)?;
        let label = self.label_of_return(line, at, span, findings)?;
        match label {
            _ if !holds => {}
            Some(label) => self.wait(span, Jump::Label(label)),
            None => self.end_call(span, None),
        }
        Some(())
    }

    /// What `P` of the `M99` at `at` says, nothing where there is none; nothing may follow.
    fn label_of_return(
        &mut self,
        line: &[u8],
        at: usize,
        span: SourceSpan,
        findings: &mut FindingLog,
    ) -> Option<Option<u32>> {
        let mut end = return_code(line, at)?;
        let mut label = None;
        let (p, behind) = letters(line, end);
        if line[p..behind].eq_ignore_ascii_case(b"P") {
            let value;
            (value, end) = self.value(line, behind, findings)?;
            label = Some(self.target_number(value, span, findings)?);
        }
        if !is_blank_or_comment(line, end) {
            return self.bad_statement(
                span,
                "behind M99 on a condition may be P with a number, and nothing else",
                findings,
            );
        }
        Some(label)
    }

    /// Exactly one assignment behind `THEN`; on Haas controls a block.
    fn then_statement(
        &mut self,
        line: &[u8],
        at: usize,
        holds: bool,
        span: SourceSpan,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> Option<Left> {
        let (at, end) = letters(line, at);
        if line[at..end].eq_ignore_ascii_case(b"GOTO") {
            if holds {
                self.goto(line, end, span, findings)?;
            }
            return Some(Left::Nothing);
        }
        if self.settings.is_haas() {
            self.check_block_behind_then(line, at, holds, findings)?;
            return Some(if holds { Left::Block(at) } else { Left::Nothing });
        }
        let message = "behind THEN must be one assignment, #1=2, and nothing else";
        if line.get(at) != Some(&b'#') {
            return self.bad_statement(span, message, findings);
        }
        if holds {
            let end = self.assign_at(line, at, operations, findings)?;
            if !is_blank_or_comment(line, end) {
                return self.bad_statement(span, message, findings);
            }
        }
        Some(Left::Nothing)
    }

    /// Refuses what can be no block behind `THEN` of a Haas control; where the condition does not hold, so that nobody reads the block,
    /// also what is no word.
    fn check_block_behind_then(&self, line: &[u8], at: usize, holds: bool, findings: &mut FindingLog) -> Option<()> {
        const WORDS: [TokenKind; 7] = [
            TokenKind::Word,
            TokenKind::Computed,
            TokenKind::Assignment,
            TokenKind::Corner,
            TokenKind::ComputedCorner,
            TokenKind::Output,
            TokenKind::Comment,
        ];
        const STATEMENTS: [TokenKind; 3] = [TokenKind::Statement, TokenKind::Expression, TokenKind::Percent];
        let is_label = |token: &Token| matches!(token.letter, b'N' | b'O');
        let is_wrong = |token: &Token| {
            STATEMENTS.contains(&token.kind) || is_label(token) || !holds && !WORDS.contains(&token.kind)
        };
        let mut is_empty = true;
        for token in Lexer::from(line, at) {
            is_empty &= token.kind == TokenKind::Comment;
            if is_wrong(&token) {
                let span = self.span_in(line, token.start as usize, token.end as usize);
                let message = "behind THEN may be the words of a block without N and O, assignments, or GOTO alone";
                return self.bad_statement(span, message, findings);
            }
        }
        if is_empty {
            let span = self.span_in(line, at.min(line.len()).saturating_sub(4), at);
            return self.bad_statement(span, "behind THEN is nothing to do", findings);
        }
        Some(())
    }

    fn while_statement(&mut self, line: &[u8], at: usize, span: SourceSpan, findings: &mut FindingLog) -> Option<()> {
        let (holds, at) = self.condition(line, at, findings)?;
        let (start, end) = letters(line, at);
        if !line[start..end].eq_ignore_ascii_case(b"DO") {
            return self.bad_statement(span, "behind the condition of WHILE must be DO with a number", findings);
        }
        self.begin_loop(line, end, holds, span, findings)
    }

    fn begin_loop(
        &mut self,
        line: &[u8],
        at: usize,
        holds: bool,
        span: SourceSpan,
        findings: &mut FindingLog,
    ) -> Option<()> {
        match digits(line, at) {
            Some((1..=3, end)) if is_blank_or_comment(line, end) => {
                self.wait(span, Jump::Do(holds));
                Some(())
            }
            _ => self.bad_statement(span, "a loop has the number 1, 2 or 3, and its block nothing behind it", findings),
        }
    }

    fn end_loop(&mut self, line: &[u8], at: usize, span: SourceSpan, findings: &mut FindingLog) -> Option<()> {
        let Some((number, end)) = digits(line, at).filter(|(number, _)| (1..=3).contains(number)) else {
            return self.bad_statement(span, "END has the number of its DO, 1 to 3", findings);
        };
        if !is_blank_or_comment(line, end) {
            return self.bad_statement(span, "END must be alone in its block", findings);
        }
        let here = self.state.place;
        let Some(open) = self.state.flow.loops.iter().rposition(|open| open.last.place == here) else {
            findings.push_with(code::LOOP, |code| {
                Finding::new(code, span, format!("END{number} without a DO{number} that is open"))
            });
            return None;
        };
        self.state.flow.loops.truncate(open + 1);
        let &Loop { kind, head, signature, .. } = &self.state.flow.loops[open];
        debug_assert!(kind == LoopKind::While);
        if self.is_endless(Round::Loop(open), Some(signature), findings) {
            return None;
        }
        self.wait(span, Jump::To(head));
        Some(())
    }
}
