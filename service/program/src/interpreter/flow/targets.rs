//! Where jumps lead.

use super::index::MAX_ENTRIES;
use super::line::Statement;
use super::{
    Call, CallKind, CallRequest, CallTarget, Found, Index, Interpreter, Jump, Loop, LoopKind, MAX_CALLS, MAX_LOOPS,
    MAX_MACRO_CALLS, Mark, Pending, Progress,
};
use crate::code;
use crate::dialect::Flow;
use crate::{Finding, FindingCode, FindingLog, Place, SourceSpan};

/// Most loops of Macro B that may be open within each other.
const MAX_MACRO_LOOPS: usize = 3;

impl Interpreter {
    /// Carries a jump out, as soon as the programs that it needs are indexed.
    pub(super) fn carry_out(&mut self, pending: &Pending, findings: &mut FindingLog) -> Progress {
        match &pending.jump {
            Jump::To(mark) => {
                self.go_to(*mark);
                Progress::Done
            }
            Jump::Label(number) | Jump::MainReturn(number) => self.go_to_label(*number, pending, findings),
            Jump::Do(holds) => self.do_loop(*holds, pending, findings),
            Jump::OWord(what, value) => self.o_word(*what, *value, pending, findings),
            Jump::Call(request) => self.call(request, pending, findings),
            Jump::Return(label) => self.return_to_caller(*label, pending, findings),
            Jump::Contour => self.find_contour(pending, findings),
        }
    }

    /// The index of a program, if it is there.
    pub(in crate::interpreter) fn index(&self, program: u32) -> Option<&Index> {
        self.indexes.get(program as usize)?.as_deref()
    }

    fn go_to_label(&mut self, number: u32, pending: &Pending, findings: &mut FindingLog) -> Progress {
        let program = pending.from.place.program;
        let Some(index) = self.index(program) else { return Progress::NeedsIndex(program) };
        let found = index.label(number, pending.from.place.offset);
        let enters = match found {
            Found::At(mark) => index
                .loops_around(mark.place.offset)
                .find(|control| !self.state.flow.loops.iter().any(|open| open.head.place == control.start.place))
                .map(|control| control.start),
            _ => None,
        };
        let is_cut = index.is_cut;
        match (found, enters) {
            (Found::At(mark), None) => {
                let flow = &mut self.state.flow;
                flow.loops
                    .retain(|open| (open.head.place.offset..=open.last.place.offset).contains(&mark.place.offset));
                if mark.place > pending.from.place {
                    flow.leave_jumps(mark);
                } else if matches!(pending.jump, Jump::MainReturn(_)) && !flow.has_decided {
                    // Every round is as this one: the control goes on until it is stopped.
                    flow.restarts_at = Some(pending.span);
                    return Progress::Done;
                } else if self.is_jump_endless(mark, pending, findings) {
                    return Progress::Failed;
                }
                self.go_to(mark);
                Progress::Done
            }
            (Found::At(_), Some(head)) => self.no_target(pending, findings, |finding| {
                let message = format!("the jump to N{number} leads into the loop that begins on line {}", head.line());
                (message, finding.suggest("jump to a block before the loop"))
            }),
            (Found::Nowhere, _) if self.reports_unread('N', number, program, findings) => Progress::Failed,
            (Found::Nowhere, _) => self.no_target(pending, findings, |finding| {
                if is_cut {
                    let message = format!("N{number} is not among the first {MAX_ENTRIES} labels of the program");
                    return (message, finding.suggest("leave out the numbers of blocks that no jump leads to"));
                }
                let message = format!("there is no block N{number} to go on with");
                (message, finding.suggest(format!("write N{number} before the block that is meant")))
            }),
            (Found::Twice(first, second), _) => self.no_target(pending, findings, |finding| {
                let message =
                    format!("N{number} is on line {} and on line {}: which is meant?", first.line(), second.line());
                (message, finding.suggest("give one of them another number"))
            }),
        }
    }

    /// The error that a jump has no target.
    #[cold]
    pub(super) fn no_target(
        &self,
        pending: &Pending,
        findings: &mut FindingLog,
        fill: impl FnOnce(Finding) -> (String, Finding),
    ) -> Progress {
        self.refuse(code::JUMP_TARGET, pending, findings, fill)
    }

    /// An error of this code on what is waiting, whose message and further parts `fill` gives.
    #[cold]
    pub(super) fn refuse(
        &self,
        code: FindingCode,
        pending: &Pending,
        findings: &mut FindingLog,
        fill: impl FnOnce(Finding) -> (String, Finding),
    ) -> Progress {
        findings.push_with(code, |code| {
            let (message, mut finding) = fill(Finding::new(code, pending.span, ""));
            finding.message = message;
            finding
        });
        Progress::Failed
    }

    /// `DOm`: one more round, the first round, or on behind the loop.
    fn do_loop(&mut self, holds: bool, pending: &Pending, findings: &mut FindingLog) -> Progress {
        if let Some(progress) = self.next_round(holds, pending) {
            return progress;
        }
        let program = pending.from.place.program;
        let Some(index) = self.index(program) else { return Progress::NeedsIndex(program) };
        let Some(head) = index.at(pending.from.place.offset) else {
            return self.broken_loop(pending, "a loop on a line that has no DO", findings);
        };
        let open = &self.state.flow.loops;
        let nested = open.iter().filter(|open| open.kind == LoopKind::While).count();
        if open.iter().any(|open| open.name == head.name) || nested >= MAX_MACRO_LOOPS {
            return self.broken_loop(pending, "loops may be nested three deep, each with another number", findings);
        }
        let mut inner = Vec::new();
        let mut crossing = false;
        let last = index.next(pending.from.place.offset, |control| match control.what {
            Statement::EndDo if control.name == head.name => true,
            Statement::Do => {
                inner.push(control.name.clone());
                false
            }
            Statement::EndDo => {
                crossing |= inner.pop().as_ref() != Some(&control.name);
                false
            }
            _ => false,
        });
        let Some(last) = last.filter(|_| !crossing && inner.is_empty()) else {
            return self.broken_loop(pending, "the loop has no END of its number, or loops cross", findings);
        };
        let looped = self.new_loop(LoopKind::While, pending, last.start, last.behind, head.name.clone());
        self.enter(holds, looped);
        Progress::Done
    }

    /// The head of a loop that is open already: on with its next round, or behind it.
    pub(super) fn next_round(&mut self, holds: bool, pending: &Pending) -> Option<Progress> {
        let signature = self.signature_at_head();
        let open = self.state.flow.loops.last_mut().filter(|open| open.head.place == pending.from.place)?;
        if holds {
            open.iteration += 1;
            open.signature = signature;
            let (head, last) = (open.head, open.last);
            self.state.flow.restart_jumps(head, last);
        } else {
            let behind = open.behind;
            self.state.flow.loops.pop();
            self.go_to(behind);
        }
        Some(Progress::Done)
    }

    pub(super) fn new_loop(&self, kind: LoopKind, pending: &Pending, last: Mark, behind: Mark, name: Box<str>) -> Loop {
        let (signature, since) = (self.signature_at_head(), self.state.flow.blocks);
        let (head, body) = (pending.from, pending.behind);
        Loop { kind, name, head, body, last, behind, rounds: 0, iteration: 1, since, signature, seen: None }
    }

    /// Begins a loop, or goes on behind it.
    pub(super) fn enter(&mut self, holds: bool, looped: Loop) {
        if holds {
            self.state.flow.has_jumped = true;
            self.state.flow.loops.push(looped);
        } else {
            self.go_to(looped.behind);
        }
    }

    #[cold]
    pub(super) fn broken_loop(&self, pending: &Pending, message: &str, findings: &mut FindingLog) -> Progress {
        findings.push_with(code::LOOP, |code| Finding::new(code, pending.span, message));
        Progress::Failed
    }

    /// Whether one more loop can be opened.
    pub(super) fn has_room_for_loop(&self) -> bool {
        self.state.flow.loops.len() < MAX_LOOPS
    }

    /// Begins a called program.
    pub(in crate::interpreter) fn call(
        &mut self,
        request: &CallRequest,
        pending: &Pending,
        findings: &mut FindingLog,
    ) -> Progress {
        let flow = &self.state.flow;
        let macros = flow.calls.iter().filter(|call| call.kind.is_macro()).count();
        if flow.calls.len() >= MAX_CALLS || request.kind.is_macro() && macros >= MAX_MACRO_CALLS {
            let limit = if flow.calls.len() >= MAX_CALLS { MAX_CALLS } else { MAX_MACRO_CALLS };
            findings.push_with(code::CALL_DEPTH, |code| {
                Finding::new(code, pending.span, format!("more than {limit} calls within each other"))
                    .with_value("limit", limit as f64, "")
                    .suggest("call fewer programs within each other, or let the recursion end")
            });
            return Progress::Failed;
        }
        let target = match self.find_once(&request.target, pending, findings) {
            Ok(mark) => mark,
            Err(progress) => return progress,
        };
        if request.kind == CallKind::Sub {
            self.call_label(target);
        }
        if request.repeats == 0 {
            return Progress::Done;
        }
        if request.kind.has_locals() {
            self.state.parameters.enter(request.locals());
        }
        let modes = std::mem::take(&mut self.state.machine.context);
        let program_number = self.state.program_number;
        if let CallTarget::Program { name, .. } = &request.target {
            self.state.program_number = name.number();
        }
        let flow = &mut self.state.flow;
        if target.place.program != pending.from.place.program {
            flow.first_calls.entry(target.place.program).or_insert(pending.span);
        }
        flow.calls.push(Call {
            kind: request.kind,
            target,
            from: pending.from,
            back: pending.behind,
            span: pending.span,
            by_code: request.by_code,
            run: 1,
            repeats: request.repeats - 1,
            since: flow.blocks,
            loops: std::mem::take(&mut flow.loops),
            jumps: std::mem::take(&mut flow.jumps),
            program_number,
            modes,
        });
        flow.has_jumped = true;
        self.go_to(target);
        Progress::Done
    }

    /// Ends a called program: runs it again, or goes on in the caller.
    fn return_to_caller(&mut self, label: Option<u32>, pending: &Pending, findings: &mut FindingLog) -> Progress {
        let Some(call) = self.state.flow.calls.last_mut() else { return Progress::Done };
        if call.repeats > 0 && label.is_none() {
            call.repeats -= 1;
            call.run = call.run.saturating_add(1);
            let target = call.target;
            self.state.flow.loops.clear();
            self.state.flow.jumps.clear();
            self.go_to(target);
            return Progress::Done;
        }
        let (has_locals, from, back, span) = (call.kind.has_locals(), call.from, call.back, call.span);
        if let Some(label) = label {
            let program = back.place.program;
            if self.index(program).is_none() {
                return Progress::NeedsIndex(program);
            }
            if self.settings.is_haas() {
                let own = pending.from.place;
                let Some(index) = self.index(own.program) else { return Progress::NeedsIndex(own.program) };
                if index.label(label, own.offset) != Found::Nowhere && !self.shares_section(own, from.place) {
                    let there = self.index(program).map(|index| index.label(label, from.place.offset));
                    if there == Some(Found::Nowhere) {
                        return self.go_to_label(label, pending, findings);
                    }
                    return self.unclear_return(label, pending, findings);
                }
            }
            self.leave(has_locals);
            let there = Pending { span, from, behind: back, jump: Jump::Label(label) };
            return self.go_to_label(label, &there, findings);
        }
        self.leave(has_locals);
        self.go_to(back);
        Progress::Done
    }

    /// Whether two places are in one program, so that both have the same blocks (`M97`).
    fn shares_section(&self, one: Place, other: Place) -> bool {
        let start = |place: Place| self.index(place.program).map(|index| index.section_at(place.offset).start);
        start(one) == start(other)
    }

    /// `M99 P` of a Haas control where the program that is read and its caller both have the block: its manual says that this goes
    /// on in the program that is read, other controls go on in the caller.
    #[cold]
    fn unclear_return(&self, label: u32, pending: &Pending, findings: &mut FindingLog) -> Progress {
        self.no_target(pending, findings, |finding| {
            let message = format!(
                "both this program and its caller have a block N{label}: a Haas control goes on in this program, others in the caller"
            );
            (message, finding.suggest(format!("write GOTO {label} to go on in this program, or give the block of the caller another number")))
        })
    }

    /// Takes the caller's loops and variables up again.
    fn leave(&mut self, has_locals: bool) {
        if let Some(call) = self.state.flow.calls.pop() {
            (self.state.flow.loops, self.state.flow.jumps) = (call.loops, call.jumps);
            self.state.program_number = call.program_number;
            let machine = &mut self.state.machine;
            let context = std::mem::replace(&mut machine.context, call.modes);
            if context.restores_at_return {
                machine.returning = context.saved;
            }
        }
        if has_locals {
            self.state.parameters.leave();
        }
    }

    /// A called program that is not ended where its file, or the next program in it, ends it.
    pub(in crate::interpreter) fn report_open_call(&self, span: SourceSpan, findings: &mut FindingLog) {
        let end = if self.table.dialect.flow == Flow::MacroB { "M99" } else { "endsub, or M99" };
        findings.push_with(code::SUBPROGRAM_END, |code| {
            Finding::new(code, span, "the subprogram does not return to its caller")
                .suggest(format!("end it with {end}"))
        });
    }
}

impl Index {
    /// The heads of the Macro B loops whose lines hold this offset.
    fn loops_around(&self, offset: u64) -> impl Iterator<Item = &super::index::Control> {
        let end = self.section_at(offset).end;
        self.controls.iter().filter(move |head| {
            head.what == Statement::Do
                && head.start.place.offset < offset
                && self
                    .next(head.start.place.offset, |control| {
                        control.what == Statement::EndDo && control.name == head.name
                    })
                    .is_some_and(|last| last.start.place.offset >= offset && last.start.place.offset < end)
        })
    }
}

impl CallRequest {
    /// Its arguments as a set of local variables.
    fn locals(&self) -> [Option<f64>; crate::parameters::LOCALS] {
        let mut locals = [None; crate::parameters::LOCALS];
        for (local, argument) in locals.iter_mut().zip(&self.arguments) {
            *local = *argument;
        }
        locals
    }
}

impl CallKind {
    /// The macro that a block which moves in a called program calls: the one before it.
    pub(super) const fn modal_level(self) -> Option<usize> {
        match self {
            Self::Modal { level } => Some(level as usize),
            _ => None,
        }
    }
}
