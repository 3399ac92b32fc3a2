//! What control flow does with whole lines.

use std::sync::Arc;

use super::macro_b::Left;
use super::{CallKind, Mark, classify};
use crate::block::Rest;
use crate::code;
use crate::dialect::{Flow, Group, Meaning};
use crate::interpreter::{Interpreter, LineOutcome, Straight};
use crate::state::{Motion, Phase};
use crate::{Finding, FindingLog, Operation, OperationKind, ProgramName, SourceSpan};

/// What control flow leaves of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::interpreter) enum FlowLine {
    /// Nothing.
    Done,
    /// The words of its block are still to be executed.
    Words,
    /// So is what stands from this offset on, as if it were alone in its line.
    Block(usize),
}

impl Interpreter {
    /// Carries out what the line that was just read waits for.
    #[cold]
    pub(in crate::interpreter) fn settle_behind(&mut self, operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        let behind = Mark { place: self.state.place, lines: self.state.lines };
        if let Some(pending) = &mut self.state.flow.pending {
            pending.behind = behind;
        }
        self.settle(operations, findings);
        self.end_pass(operations, findings);
    }

    /// Ends the program where its main program has begun again.
    fn end_pass(&mut self, operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        if let Some(span) = self.state.flow.restarts_at.take() {
            findings.push_with(code::MAIN_RETURN, |code| {
                Finding::new(code, span, "the control starts the program again here; one pass of it is planned").suggest(
                    "where the file is a subprogram, this is its return: name it as a further file of the program that calls it",
                )
            });
            self.end(span, operations, findings);
            // What is behind it is read where it is called, or is another program, which may be the main one.
            self.state.reported.trailing = !self.state.flow.may_be_subprogram;
        }
    }

    /// Reads bytes for the index that is being made.
    #[cold]
    pub(in crate::interpreter) fn read_for_index(
        &mut self,
        input: &[u8],
        end_of_input: bool,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> LineOutcome {
        let Some(indexing) = &mut self.indexing else { return LineOutcome::Elsewhere };
        if !input.is_empty() {
            if indexing.read(input, end_of_input) {
                return LineOutcome::Elsewhere;
            }
            return LineOutcome::NeedMore;
        }
        if !end_of_input {
            return LineOutcome::NeedMore;
        }
        let Some(indexing) = self.indexing.take() else { return LineOutcome::Elsewhere };
        let program = indexing.program() as usize;
        if self.indexes.len() <= program {
            self.indexes.resize(program + 1, None);
        }
        self.indexes[program] = Some(Arc::new(indexing.finish()));
        self.settle(operations, findings);
        self.end_pass(operations, findings);
        LineOutcome::Elsewhere
    }

    /// Executes a line that is a statement, calls a macro, or has a program number.
    #[cold]
    pub(in crate::interpreter) fn flow_line(
        &mut self,
        line: &[u8],
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> FlowLine {
        let span = self.span_in(line, 0, line.len());
        self.state.flow.asked_before = self.state.flow.asked;
        self.state.sequence_number = self.block.sequence_number().or(self.state.sequence_number);
        let goes_on = match self.block.rest {
            Some(Rest::Statement(at)) => {
                self.state.flow.has_decided = true;
                match self.macro_statement(line, at as usize, operations, findings) {
                    Some(Left::Block(from)) => return FlowLine::Block(from),
                    left => left.is_some(),
                }
            }
            Some(Rest::Arguments { at, modal }) => self.macro_call(line, at as usize, modal, findings),
            Some(Rest::OWord(at)) => match self.o_statement(line, at as usize, findings) {
                Some(goes_on) => goes_on,
                None => return self.program_begins(span, operations, findings),
            },
            rest @ (None | Some(Rest::CalledName(_))) => {
                if let Some(Rest::CalledName(at)) = rest {
                    self.called_name = ProgramName::read(&line[at as usize..]).map(|(name, _)| name);
                }
                return match self.block.word(b'O') {
                    Some(word) => self.program_begins(self.block.word_span(word), operations, findings),
                    None => FlowLine::Words,
                };
            }
        };
        if self.state.phase == Phase::Start {
            self.state.phase = Phase::Blocks;
        }
        let goes_on = goes_on && self.count_block(false, span, findings);
        if !goes_on {
            self.give_up(span, operations, findings);
        }
        FlowLine::Done
    }

    /// A program number: the line of the program that was called goes on; behind the first block of another one the program before
    /// it is not ended.
    fn program_begins(
        &mut self,
        span: SourceSpan,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> FlowLine {
        let goes_on = match self.block.rest {
            None | Some(Rest::CalledName(_)) => FlowLine::Words,
            Some(_) => FlowLine::Done,
        };
        let is_target = self.state.flow.calls.last().is_some_and(|call| call.target.place == self.state.place);
        if is_target || self.state.phase != Phase::Blocks {
            return goes_on;
        }
        // LinuxCNC goes on into the program that begins.
        if self.table.dialect.flow == Flow::OWords
            && self.state.flow.calls.last().is_none_or(|call| call.kind != CallKind::Sub)
        {
            return goes_on;
        }
        if self.state.flow.calls.is_empty() {
            findings.push_with(code::NO_END, |code| {
                Finding::new(code, span, "the next program begins before this one is ended")
                    .suggest("end it with M30 (or M2)")
            });
        } else {
            self.report_open_call(span, findings);
        }
        self.give_up(span, operations, findings);
        FlowLine::Done
    }

    /// Executes what stands behind `THEN` from an offset on, as if it were alone in its line.
    #[cold]
    pub(in crate::interpreter) fn block_behind_condition(
        &mut self,
        line: &[u8],
        from: usize,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) {
        let mut alone = line.to_vec();
        alone[..from].fill(b' ');
        let mark = findings.mark();
        self.straight = Straight::Unknown;
        self.parse_block(&alone, &mark, findings);
        self.execute_line(&alone, &mark, operations, findings);
        // An end on a condition is not the only one: what is behind it is no rest.
        self.state.flow.has_jumped |= self.state.has_ended();
    }

    /// Whether a line behind the end begins a program or a subprogram.
    pub(in crate::interpreter) fn begins_program(&self, line: &[u8]) -> bool {
        classify(line, self.table.dialect.flow, false).begins_program()
    }

    /// Whether the file that ends is that of a called program, which is an error.
    pub(in crate::interpreter) fn ends_called_file(
        &mut self,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> bool {
        if self.state.flow.calls.is_empty() {
            return false;
        }
        let span = self.state.flow.calls.last().map_or(SourceSpan::default(), |call| call.span);
        self.report_open_call(span, findings);
        self.give_up(span, operations, findings);
        true
    }

    /// What follows from a block that was executed: a call, a return, or the macro that follows every block that moves.
    #[inline]
    pub(in crate::interpreter) fn after_block(
        &mut self,
        before: usize,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) {
        if self.block.code(Group::Subprogram).is_some() {
            let had_jumped = std::mem::replace(&mut self.state.flow.has_jumped, true);
            if !self.subprogram(findings) {
                let span = self.block.span();
                return self.give_up(span, operations, findings);
            }
            let returns = self.state.flow.restarts_at.is_some();
            self.state.flow.may_be_subprogram = returns && !had_jumped && self.table.dialect.flow == Flow::MacroB;
        }
        if self.block.code(Group::MacroCall).is_some() {
            self.end_modal_call();
        }
        if self.state.flow.has_jumped || !self.state.flow.modal.is_empty() {
            self.after_repeated_block(before, operations, findings);
        }
    }

    #[cold]
    fn after_repeated_block(&mut self, before: usize, operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        let is_move = |operation: &Operation| {
            matches!(operation.kind, OperationKind::Move(_) | OperationKind::Thread(_) | OperationKind::Guided(_))
        };
        let moves = operations[before.min(operations.len())..].iter().any(is_move) || self.state.is_plane_refused();
        self.state.flow.codes += u64::from(self.block.has_codes());
        let span = self.block.span();
        if !self.count_block(moves, span, findings) {
            return self.give_up(span, operations, findings);
        }
        if moves || !self.state.flow.modal.is_empty() && self.names_a_place() {
            self.call_modal();
        }
    }

    /// Whether the block names where a move ends, be it the place where the tool is: controls call a modal macro there, too.
    fn names_a_place(&self) -> bool {
        // The axis words of these are none of a move.
        const OTHERS: [Group; 5] = [Group::Scaling, Group::Rotation, Group::Mirror, Group::Function, Group::MacroCall];
        let one_block = self.block.code(Group::NonModal).map(|code| self.table.code(code.place).meaning);
        self.block.letters & self.table.axis_letters != 0
            && !self.block.unclear
            && matches!(self.state.motion, Motion::Rapid | Motion::Linear | Motion::Arc { .. })
            && matches!(one_block, None | Some(Meaning::MachineCoordinates | Meaning::ExactStop))
            && !OTHERS.into_iter().any(|group| self.block.code(group).is_some())
    }
}
