//! Statements of the O-word language: subprograms, branches, loops.

use super::bounds::Round;
use super::line::{self, Statement, is_blank_or_comment, letters};
use super::{CallKind, CallRequest, CallTarget, Interpreter, Jump, Loop, LoopKind, Pending, Progress};
use crate::code;
use crate::{Finding, FindingLog, SourceSpan};

/// Most arguments of a call.
const MAX_ARGUMENTS: usize = 30;

impl Interpreter {
    /// Executes the O-word statement whose `o` is at `at`; `None` where the line is none but the number of a program, and
    /// `Some(false)` after an error, which ends the program.
    pub(in crate::interpreter) fn o_statement(
        &mut self,
        line: &[u8],
        at: usize,
        findings: &mut FindingLog,
    ) -> Option<bool> {
        let span = self.span_in(line, at, line.trim_ascii_end().len());
        let written = line::name(line, at + 1);
        let is_computed = written.is_none();
        let (name, behind) = match written {
            Some(found) => found,
            None => {
                let Some((value, end)) = self.value(line, at + 1, findings) else { return Some(false) };
                let Some(number) = self.target_number(value, span, findings) else { return Some(false) };
                (number.to_string(), end)
            }
        };
        let (start, end) = letters(line, behind);
        let Some(what) = line::statement(&line[start..end]) else {
            if start == end && is_blank_or_comment(line, behind) && !name.starts_with('<') {
                return None;
            }
            let message = "behind an O-word must be sub, call, if, while or another of its words";
            return Some(self.bad_statement::<()>(span, message, findings).is_some());
        };
        if is_computed && what != Statement::Call {
            return Some(self.computed_label(what, &name, span, findings).is_some());
        }
        Some(self.o_execute(what, name, line, end, span, findings).is_some())
    }

    /// Refuses a computed number of what begins, ends or divides lines: what belongs together could not be found without executing it.
    #[cold]
    fn computed_label(&self, what: Statement, name: &str, span: SourceSpan, findings: &mut FindingLog) -> Option<()> {
        findings.push_with(code::STATEMENT, |code| {
            let message = format!("only call may compute its number: that of {} is written out", what.word());
            Finding::new(code, span, message)
                .with_value("number", name.parse().unwrap_or(0.0), "")
                .suggest(format!("write o{name} {}", what.word()))
        });
        None
    }

    fn o_execute(
        &mut self,
        what: Statement,
        name: String,
        line: &[u8],
        at: usize,
        span: SourceSpan,
        findings: &mut FindingLog,
    ) -> Option<()> {
        let mut value = 1.0;
        let mut end = at;
        let is_branch = what == Statement::ElseIf && self.state.flow.branch.take() == Some(self.state.place);
        match what {
            Statement::Call => return self.o_call(name, line, at, span, findings),
            Statement::Return | Statement::EndSub => {
                match self.state.flow.calls.last().map(|call| call.kind) {
                    None => return self.bad_statement(span, "this ends a subprogram, but none was called", findings),
                    Some(CallKind::Sub) => {}
                    Some(_) => {
                        return self.bad_statement(span, "a program that M98 has called returns with M99", findings);
                    }
                }
                self.o_result(line, at, span, findings)?;
                self.end_call(span, None);
                return Some(());
            }
            Statement::ElseIf if !is_branch => {
                value = -1.0;
                end = line.len();
            }
            Statement::If | Statement::ElseIf | Statement::While => {
                let holds;
                (holds, end) = self.condition(line, at, findings)?;
                value = f64::from(u8::from(holds));
            }
            Statement::Repeat => {
                if line.get(line::skip_blanks(line, at)) != Some(&b'[') {
                    return self.bad_statement(
                        span,
                        "behind repeat must be the number of rounds in brackets",
                        findings,
                    );
                }
                let count;
                (count, end) = self.value(line, at, findings)?;
                value = libm::rint(count.unwrap_or(0.0)).clamp(0.0, 1e15);
            }
            _ => {}
        }
        if !is_blank_or_comment(line, end) {
            return self.bad_statement(span, "nothing else may be in the line of an O-word", findings);
        }
        self.wait(span, Jump::OWord(what, value));
        Some(())
    }

    /// The value that a subprogram returns.
    fn o_result(&mut self, line: &[u8], at: usize, span: SourceSpan, findings: &mut FindingLog) -> Option<()> {
        let mut result = None;
        let mut end = at;
        if !is_blank_or_comment(line, at) {
            (result, end) = self.value(line, at, findings)?;
        }
        if !is_blank_or_comment(line, end) {
            return self.bad_statement(span, "one value in brackets, and nothing else, is returned", findings);
        }
        self.state.parameters.set_returned(result);
        Some(())
    }

    fn o_call(
        &mut self,
        name: String,
        line: &[u8],
        mut at: usize,
        span: SourceSpan,
        findings: &mut FindingLog,
    ) -> Option<()> {
        let mut arguments = Vec::new();
        while !is_blank_or_comment(line, at) {
            let next = line::skip_blanks(line, at);
            if line.get(next) != Some(&b'[') || arguments.len() >= MAX_ARGUMENTS {
                return self.bad_statement(span, "a call has at most 30 arguments, each in brackets", findings);
            }
            let (value, end) = self.value(line, next, findings)?;
            arguments.push(Some(value.unwrap_or(0.0)));
            at = end;
        }
        // What is not passed reads 0 in the called program.
        arguments.resize(MAX_ARGUMENTS, Some(0.0));
        let request =
            CallRequest { kind: CallKind::Sub, target: CallTarget::Sub(name), repeats: 1, arguments, by_code: false };
        self.wait(span, Jump::Call(request));
        Some(())
    }

    /// Carries an O-word statement out that goes elsewhere; `value` is 0 or 1 where it has a condition.
    pub(super) fn o_word(
        &mut self,
        what: Statement,
        value: f64,
        pending: &Pending,
        findings: &mut FindingLog,
    ) -> Progress {
        let holds = value > 0.0;
        if what == Statement::While {
            if let Some(progress) = self.next_round(holds, pending) {
                return progress;
            }
            if let Some(open) = self.state.flow.loops.last()
                && open.kind == LoopKind::DoWhile
                && open.last.place == pending.from.place
            {
                return self.round_again(holds, findings);
            }
        }
        let program = pending.from.place.program;
        if self.index(program).is_none() {
            return Progress::NeedsIndex(program);
        }
        let checked = match what {
            Statement::Sub => self.define_sub(pending, findings),
            Statement::If | Statement::While | Statement::DoWhile | Statement::Repeat => {
                self.begin_label(pending, findings)
            }
            _ => self.find_label(what, pending, findings),
        };
        if let Err(progress) = checked {
            return progress;
        }
        match what {
            Statement::If | Statement::ElseIf if holds => Progress::Done,
            Statement::EndIf => Progress::Done,
            Statement::EndWhile | Statement::EndRepeat => self.o_loop_end(pending, findings),
            Statement::If => self.o_branch(&[Statement::ElseIf, Statement::Else, Statement::EndIf], pending, findings),
            Statement::ElseIf if value < 0.0 => self.o_branch(&[Statement::EndIf], pending, findings),
            Statement::ElseIf => {
                self.o_branch(&[Statement::ElseIf, Statement::Else, Statement::EndIf], pending, findings)
            }
            Statement::Else => self.o_branch(&[Statement::EndIf], pending, findings),
            Statement::Sub => self.o_branch(&[Statement::EndSub], pending, findings),
            Statement::While => self.o_loop(LoopKind::While, Statement::EndWhile, value, pending, findings),
            Statement::DoWhile => self.o_loop(LoopKind::DoWhile, Statement::While, value, pending, findings),
            Statement::Repeat => self.o_loop(LoopKind::Repeat, Statement::EndRepeat, value, pending, findings),
            Statement::Break | Statement::Continue => self.o_leave(what, pending, findings),
            _ => self.broken_loop(pending, "this statement has no partner", findings),
        }
    }

    /// Goes on behind the next of these statements of the same name, or at it where it has a condition.
    fn o_branch(&mut self, wanted: &[Statement], pending: &Pending, findings: &mut FindingLog) -> Progress {
        let Some((what, start, behind)) = self.o_partner(wanted, pending) else {
            let names: Vec<_> = wanted.iter().map(|what| what.word()).collect();
            let message = format!("there is no {} of the same number behind it", names.join(" or "));
            return self.broken_loop(pending, &message, findings);
        };
        if what == Statement::ElseIf {
            self.state.flow.branch = Some(start.place);
            self.go_to(start);
        } else {
            self.go_to(behind);
        }
        Progress::Done
    }

    /// The next of these statements of the same name, in the same subprogram.
    fn o_partner(&self, wanted: &[Statement], pending: &Pending) -> Option<(Statement, super::Mark, super::Mark)> {
        let index = self.index(pending.from.place.program)?;
        let own = index.at(pending.from.place.offset)?;
        let in_sub = own.what != Statement::Sub;
        let is_limit = |what| in_sub && matches!(what, Statement::Sub | Statement::EndSub);
        let found = index.next(pending.from.place.offset, |control| {
            control.name == own.name && wanted.contains(&control.what) || is_limit(control.what)
        })?;
        (found.name == own.name && wanted.contains(&found.what)).then_some((found.what, found.start, found.behind))
    }

    fn o_loop(
        &mut self,
        kind: LoopKind,
        last: Statement,
        value: f64,
        pending: &Pending,
        findings: &mut FindingLog,
    ) -> Progress {
        if !self.has_room_for_loop() {
            return self.broken_loop(pending, "too many loops within each other", findings);
        }
        let Some((_, start, behind)) = self.o_partner(&[last], pending) else {
            let message = format!("there is no {} of the same number behind it", last.word());
            return self.broken_loop(pending, &message, findings);
        };
        let program = pending.from.place.program;
        let own = self.index(program).and_then(|index| index.at(pending.from.place.offset));
        let name = own.map_or_else(|| "".into(), |control| control.name.clone());
        let mut looped = self.new_loop(kind, pending, start, behind, name);
        if kind == LoopKind::Repeat {
            looped.rounds = (value as u64).saturating_sub(1);
        }
        self.enter(value > 0.0, looped);
        Progress::Done
    }

    /// `endwhile`, `endrepeat`: the loop that ends on this line goes on.
    fn o_loop_end(&mut self, pending: &Pending, findings: &mut FindingLog) -> Progress {
        let here = pending.from.place;
        let Some(open) = self.state.flow.loops.iter().rposition(|open| open.last.place == here) else {
            return self.broken_loop(pending, "this ends a loop that is not open", findings);
        };
        self.state.flow.loops.truncate(open + 1);
        self.round_again(true, findings)
    }

    /// Begins the next round of the innermost loop, or leaves it.
    fn round_again(&mut self, holds: bool, findings: &mut FindingLog) -> Progress {
        let signature = self.signature();
        let innermost = self.state.flow.loops.len().saturating_sub(1);
        let Some(open) = self.state.flow.loops.last_mut() else { return Progress::Done };
        let before = open.signature;
        let goes_on = match open.kind {
            LoopKind::Repeat => open.rounds > 0,
            _ => holds,
        };
        if !goes_on {
            let behind = open.behind;
            self.state.flow.loops.pop();
            self.go_to(behind);
            return Progress::Done;
        }
        let &mut Loop { kind, head, body, .. } = open;
        // That of a while is counted at its head.
        open.iteration += u64::from(kind != LoopKind::While);
        open.signature = signature;
        open.rounds = open.rounds.saturating_sub(1);
        // A repeat ends by itself.
        if kind != LoopKind::Repeat && self.is_endless(Round::Loop(innermost), Some(before), findings) {
            return Progress::Failed;
        }
        self.go_to(if kind == LoopKind::While { head } else { body });
        Progress::Done
    }

    /// `break`, `continue`
    fn o_leave(&mut self, what: Statement, pending: &Pending, findings: &mut FindingLog) -> Progress {
        let Some(index) = self.index(pending.from.place.program) else { return Progress::Done };
        let name = index.at(pending.from.place.offset).map(|control| control.name.clone());
        let Some(open) = self.state.flow.loops.iter().rposition(|open| Some(&open.name) == name.as_ref()) else {
            return self.broken_loop(pending, "there is no open loop of this number", findings);
        };
        self.state.flow.loops.truncate(open + 1);
        let &Loop { kind, head, last, behind, signature, .. } = &self.state.flow.loops[open];
        match (what, kind) {
            (Statement::Break, _) => {
                self.state.flow.loops.pop();
                self.go_to(behind);
            }
            (_, LoopKind::While) => {
                if self.is_endless(Round::Loop(open), Some(signature), findings) {
                    return Progress::Failed;
                }
                self.go_to(head);
            }
            (_, LoopKind::DoWhile | LoopKind::Repeat) => self.go_to(last),
        }
        Progress::Done
    }
}
