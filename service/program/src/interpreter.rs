//! Interpreter: lines in, operations and findings out. It performs no I/O: the caller holds the buffer.

mod angle;
mod arc;
mod assign;
mod compensation;
mod coordinates;
mod corner;
mod doubt;
mod drill;
mod execute;
mod flow;
mod framing;
mod function;
mod length;
mod lines;
mod machine_code;
mod motion;
mod path_control;
mod pocket;
mod probe;
mod saved;
mod shown_system;
mod spindle;
mod spline;
mod straight;
mod system;
#[cfg(test)]
mod tests;
mod thread;
mod tilted;
mod tool_control;
mod turning;

use std::collections::HashMap;
use std::sync::Arc;

use crate::block::Block;
use crate::consequence;
use crate::dialect::{CodeTable, Group, Meaning, letter_bit};
use crate::finding::FindingMark;
use crate::state::Phase;
use crate::{
    Compensator, Finding, FindingLog, Function, InterpreterState, LanguageSettings, Operation, OperationKind, Place,
    ProgramName, SourceSpan, ToolOffset,
};

use corner::Corner;
use execute::Execution;
use flow::{CallTarget, FlowLine, Index, Indexer, Mark};
pub(crate) use flow::{FlowState, Statement, called_program, classify, digits, is_conditional_return, name};
pub(crate) use lines::find_line_end;
use straight::Straight;
pub(crate) use system::System;

pub(crate) use angle::AngleLine;
pub(crate) use coordinates::set_initial_offsets;
pub(crate) use corner::PendingCorner;
pub(crate) use saved::SavedModes;

/// What [`Interpreter::read_line`] did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineOutcome {
    /// This many bytes from the front of the input are done with: a line with its terminator, a part of a line
    /// that is too long to be read, or text after the end of the program. Never 0. The next line need not be the one
    /// behind it: it is at [`Interpreter::place`].
    Consumed(usize),
    /// Nothing of the input is done with, as what comes next is elsewhere, at [`Interpreter::place`].
    Elsewhere,
    /// The input holds no complete line and more may come.
    NeedMore,
    /// All input is consumed and [`OperationKind::End`] has been appended, now or before.
    Ended,
}

/// Reads a program line by line.
///
/// Within a block the order of execution is fixed by the dialect, whatever the order of its words:
///
/// 1. unit (`G20`, `G21`) on FANUC and Haas controls; feed mode; feed; tool; spindle speed and its mode; `M3`, `M4`; coolant on;
/// 2. unit in LinuxCNC, so that the feed of its block is read in the unit before;
/// 3. dwell; plane; path control; work offset; distance mode; tool length; machining function; reference position;
/// 4. motion; `M5` and `M9` on FANUC and Haas controls (in LinuxCNC with 1); program stop or end.
///
/// The unit comes first in a block of a machining function, whose words are its own.
///
/// A NURBS, from `G5.2` to `G5.3`, is one move, and the block that opens it says its feed and its path control.
///
/// A block with an error sets its modal states and its end position but emits no operation, so that the blocks
/// after it are judged on their own.
#[derive(Clone, Debug)]
pub struct Interpreter {
    settings: LanguageSettings,
    state: InterpreterState,
    table: CodeTable,
    tools: Vec<ToolOffset>,
    /// Highest speed of the machine's spindle, rev/min; infinite where it is not known.
    spindle_limit_rev_per_min: f64,
    /// Names of the job's further programs.
    programs: Arc<[String]>,
    /// What is where in the job's programs, of those that a jump needed. It is no part of the state: it is made anew.
    indexes: Vec<Option<Arc<Index>>>,
    /// Where the programs begin that were called by number or name, by the file of the call. It is no part of the state: it is
    /// found anew.
    called: HashMap<(u32, CallTarget), Mark>,
    /// The index that is being made.
    indexing: Option<Box<Indexer>>,
    /// The moves of the turning cycle that is being carried out. They are no part of the state: they are made anew.
    steps: Option<Arc<[turning::Step]>>,
    /// Whether blocks of linear axes alone are straight moves. It is no part of the state: it follows from it.
    straight: Straight,
    /// Storage of the present line's words, reused.
    block: Block,
    /// Corners behind operations of the present block, by the places of these; empty between lines.
    corners: Vec<(usize, Corner)>,
    /// The program that the present block calls by its name.
    called_name: Option<ProgramName>,
}

/// A UTF-8 byte order mark.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

impl Interpreter {
    /// An interpreter before the first line of a program.
    #[must_use]
    pub fn new(settings: LanguageSettings) -> Self {
        let state = InterpreterState::new(&settings);
        Self::restore(settings, state)
    }

    /// An interpreter that goes on where another one with the same settings stood when `state` was taken.
    #[must_use]
    pub fn restore(settings: LanguageSettings, state: InterpreterState) -> Self {
        let table = CodeTable::new(&settings);
        let mut interpreter = Self {
            table,
            settings,
            state,
            tools: Vec::new(),
            spindle_limit_rev_per_min: f64::INFINITY,
            programs: Arc::new([]),
            indexes: Vec::new(),
            called: HashMap::new(),
            indexing: None,
            steps: None,
            straight: Straight::default(),
            block: Block::default(),
            corners: Vec::new(),
            called_name: None,
        };
        interpreter.resume_pending();
        interpreter
    }

    /// With the job's table of tool offsets; of several rows with one number the first counts. A restored interpreter goes
    /// on identically with the same ones.
    #[must_use]
    pub fn with_tools(mut self, tools: Vec<ToolOffset>) -> Self {
        self.tools = tools;
        self
    }

    /// With the highest speed of the machine's spindle, rev/min, at which it clamps constant surface speed. A restored interpreter
    /// goes on identically with the same one.
    #[must_use]
    pub const fn with_spindle_limit(mut self, rev_per_min: f64) -> Self {
        self.spindle_limit_rev_per_min = rev_per_min;
        self
    }

    /// With the names of the job's further program files, in the order of their places ([`Place::program`] 1 and on): those of
    /// subprograms. A restored interpreter goes on identically with the same ones.
    #[must_use]
    pub fn with_programs(mut self, programs: Arc<[String]>) -> Self {
        self.programs = programs;
        self
    }

    /// Reads a whole program that is in memory, or what is left of one.
    #[must_use]
    pub fn read_all(mut self, source: &[u8]) -> (Vec<Operation>, FindingLog) {
        let mut operations = Vec::new();
        let mut findings = FindingLog::default();
        loop {
            let rest = &source[source.len().min(self.place().offset as usize)..];
            match self.read_line(rest, true, &mut operations, &mut findings) {
                LineOutcome::Consumed(_) | LineOutcome::Elsewhere => {}
                LineOutcome::NeedMore | LineOutcome::Ended => return (operations, findings),
            }
        }
    }

    /// What is remembered between lines.
    #[must_use]
    pub const fn state(&self) -> &InterpreterState {
        &self.state
    }

    /// Where the next bytes begin that it is to be given.
    #[inline]
    #[must_use]
    pub fn place(&self) -> Place {
        self.indexing.as_ref().map_or(self.state.place, |indexing| indexing.place())
    }

    /// Where the line is that is carried out next; `None` while a program is read for what a jump leads to.
    #[must_use]
    pub const fn executes_at(&self) -> Option<Place> {
        if self.indexing.is_none() { Some(self.state.place) } else { None }
    }

    /// How the program is read.
    #[must_use]
    pub const fn settings(&self) -> &LanguageSettings {
        &self.settings
    }

    /// Reads at most one line from the front of `input`, which begins at [`Interpreter::place`], and appends its operations
    /// and findings.
    ///
    /// `end_of_input` says that nothing comes after `input`. How the input is cut into pieces makes no difference
    /// to what is appended; a caller that offers more than [`LanguageSettings::max_line_bytes`] always gets on.
    #[inline]
    pub fn read_line(
        &mut self,
        input: &[u8],
        end_of_input: bool,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> LineOutcome {
        let before = operations.len();
        let outcome = self.read_line_as_programmed(input, end_of_input, operations, findings);
        self.state.compensator.apply(operations, before, findings);
        outcome
    }

    /// The same without the compensation of tool radius and nose.
    #[inline]
    fn read_line_as_programmed(
        &mut self,
        input: &[u8],
        end_of_input: bool,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> LineOutcome {
        if self.indexing.is_some() {
            return self.read_for_index(input, end_of_input, operations, findings);
        }
        let contour_mark = match &self.state.flow.contour {
            None => None,
            Some(run) if run.is_cutting() => return self.cut_contour(operations),
            Some(_) => Some(findings.mark()),
        };
        let before = operations.len();
        let mark = self.is_nested().then(|| findings.mark());
        let outcome = self.read(input, end_of_input, operations, findings);
        if let Some(mark) = mark
            && findings.has_grown_since(mark)
        {
            self.place_in_calls(mark, findings);
        }
        if let LineOutcome::Consumed(length) = outcome {
            let at = self.state.place;
            self.state.place.offset += length as u64;
            if self.state.flow.waits() {
                self.settle_behind(operations, findings);
                self.follow_contour(at, before, contour_mark.as_ref(), operations, findings);
            }
        }
        outcome
    }

    /// Reads one whole line without its end.
    // As long as the kinds of lines: whoever takes one returns, and the order is that of what is asked first.
    #[inline]
    fn line(&mut self, mut line: &[u8], operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        // Nothing can be in front of the first line, so that later ones need one comparison only.
        if self.state.lines == 0 && self.state.first_line == 0 {
            line = line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(line);
        }
        self.state.lines = self.state.lines.saturating_add(1);
        self.note_line_end(line);
        let number = self.state.lines;
        if self.state.evidence.goes_on() {
            return self.look_on(line, number, operations, findings);
        }
        if self.state.has_ended() {
            return self.report_trailing(line, number, findings);
        }
        if self.state.first_line == 0 && self.is_foreign_start(line, number, operations, findings) {
            return;
        }
        if self.may_be_title(line) && self.is_title(line, number, findings) {
            return;
        }
        let mark = findings.mark();
        if !self.state.coords.tables.assigned.is_empty() && !self.apply_assigned(operations, findings) {
            return;
        }
        self.parse_block(line, &mark, findings);
        if self.moves_straight(&mark, operations, findings) {
            return;
        }
        if self.block.unclear
            && let Some(foreign) = self.recognise_foreign(line, !self.state.evidence.is_readable())
        {
            return self.refuse_file(foreign, line.len(), number, operations, findings);
        }
        if !self.state.evidence.is_settled() && self.is_evidently_foreign(line, operations, findings) {
            return;
        }
        if self.state.flow.contour.is_some() && self.approach_contour(&mark, findings) {
            return;
        }
        if let Some(span) = self.block.percent {
            if self.table.dialect.is_linuxcnc && !findings.has_grown_since(mark) {
                self.check_percent(line, span, findings);
            }
            if self.state.percent_seen || self.state.phase != Phase::Start {
                if !self.block.is_empty() {
                    self.push_trailing(self.block.span(), findings);
                }
                // Behind it nothing of a called program can follow.
                if !self.ends_called_file(operations, findings) {
                    self.end(span, operations, findings);
                }
                return;
            }
            self.state.percent_seen = true;
        }
        if self.state.skipping_data.is_some() {
            return self.skip_data(operations, findings);
        }
        self.execute_line(line, &mark, operations, findings);
    }

    /// Reads the words of the present line.
    #[inline]
    fn parse_block(&mut self, line: &[u8], mark: &FindingMark, findings: &mut FindingLog) {
        let system =
            System { state: &self.state, settings: &self.settings, dialect: self.table.dialect, tools: &self.tools };
        let place = (self.state.place.program, self.state.lines);
        self.block.parse(line, place, &self.table, self.settings.block_delete, system, findings, mark);
    }

    /// Executes the block that was read from a line.
    #[inline]
    fn execute_line(
        &mut self,
        line: &[u8],
        mark: &FindingMark,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) {
        if self.block.needs_assigning() && self.assign(line, operations, findings) {
            return;
        }
        if self.block.rest.is_some() || self.block.word(b'O').is_some() {
            match self.flow_line(line, operations, findings) {
                FlowLine::Done => return,
                FlowLine::Words => {}
                FlowLine::Block(from) => return self.block_behind_condition(line, from, operations, findings),
            }
        } else if self.block.is_empty() {
            self.state.unread |= self.block.unread;
            self.forget_unread_feed();
            return;
        }
        self.execute(mark, operations, findings);
    }

    /// Lets the execution of the present block do something.
    #[inline]
    fn with_execution<T>(
        &mut self,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
        act: impl FnOnce(&mut Execution<'_>) -> T,
    ) -> T {
        act(&mut Execution {
            settings: &self.settings,
            table: &self.table,
            tools: &self.tools,
            spindle_limit_rev_per_min: self.spindle_limit_rev_per_min,
            state: &mut self.state,
            block: &self.block,
            operations,
            findings,
            used: 0,
            exact_stop: false,
            machine_rapid: false,
            corners: &mut self.corners,
            commas_used: false,
            doubt: None,
            clamps: Vec::new(),
        })
    }

    /// Puts offsets that a block before has assigned in force. Whether the program goes on.
    #[cold]
    fn apply_assigned(&mut self, operations: &mut Vec<Operation>, findings: &mut FindingLog) -> bool {
        for (number, value) in core::mem::take(&mut self.state.coords.tables.assigned) {
            if let Err(refusal) = system::assign_offset(&mut self.state, &self.settings, &self.tools, number, value) {
                let line = self.state.lines.saturating_sub(1).max(1);
                let span = SourceSpan { program: self.state.place.program, line, column: 1, length: 0 };
                findings
                    .push_with(refusal.code, |code| Finding::new(code, span, refusal.message).suggest(refusal.cure));
                self.give_up(span, operations, findings);
                return false;
            }
        }
        true
    }

    /// A block between `G10 L50` and `G11`.
    #[cold]
    fn skip_data(&mut self, operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        let code = self.block.code(Group::NonModal).map(|code| self.table.code(code.place).meaning);
        if code == Some(Meaning::DataSettingEnd) {
            self.state.skipping_data = None;
            return;
        }
        if self.block.code(Group::Stop).is_none() && self.block.code(Group::Subprogram).is_none() {
            return;
        }
        self.give_up(self.block.span(), operations, findings);
    }

    /// Executes the words of the present block; findings from `mark` on are its own.
    #[inline]
    fn execute(&mut self, mark: &FindingMark, operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        let operations_before = operations.len();
        let unread = self.state.unread | self.block.unread;
        #[allow(clippy::redundant_closure_for_method_calls, reason = "the path of the method has one lifetime only")]
        let end = self.with_execution(operations, findings, |execution| execution.run());
        let is_refused = findings.has_errors_since(mark);
        if unread != 0 {
            self.note_unread(mark.kept(), unread, findings);
        }
        if self.block.code(Group::Function).is_some() {
            self.note_functions(&operations[operations_before..], is_refused);
        }
        if is_refused {
            operations.truncate(operations_before);
            self.break_nurbs();
            // Without the block, what follows is another contour: it is not judged.
            self.state.compensator = Compensator::default();
        }
        if self.state.corner.is_some() || !self.corners.is_empty() {
            // A block of a number alone is nothing between two moves.
            let between = self.block.has_codes().then(|| self.block.span());
            let corners = &self.corners;
            corner::join(&mut self.state, corners, is_refused, between, operations, operations_before, findings);
            self.corners.clear();
        }
        if let Some(Operation { span, kind: OperationKind::Move(_) }) =
            operations.get(operations_before..).and_then(<[_]>::last)
        {
            self.state.moved_by = *span;
        }
        if let Some(span) = end {
            return self.end(span, operations, findings);
        }
        if self.state.flow.contour.is_some() {
            self.begin_contour(is_refused, findings);
        }
        self.after_block(operations_before, operations, findings);
    }

    /// Takes back what only follows from words that could not be read, and remembers which modal words those were.
    #[cold]
    fn note_unread(&mut self, from: usize, unread: u32, findings: &mut FindingLog) {
        let in_block = self.block.unread;
        findings.withdraw(from, |finding| consequence::follows_from(finding.code, in_block, unread));
        let mut read = self.block.letters & !self.table.axis_letters;
        for (group, letter) in [(Group::Motion, b'G'), (Group::Spindle, b'M')] {
            if self.block.code(group).is_some() {
                read |= letter_bit(letter);
            }
        }
        if self.state.absolute {
            read |= self.table.dialect.letters_placed_by(self.block.letters);
        }
        self.state.unread = self.state.unread & !read | in_block;
        self.forget_unread_feed();
    }

    /// A feed or a lead that could not be read takes the one before it out of force, so that nothing is judged by it.
    fn forget_unread_feed(&mut self) {
        if self.block.unread & letter_bit(b'F') != 0 {
            self.state.feed = 0.0;
            self.state.thread.forget_lead();
            (self.state.reported.feed, self.state.reported.lead) = (true, true);
        }
    }

    /// Remembers which machining functions a block has switched, or would have without its error.
    fn note_functions(&mut self, operations: &[Operation], is_refused: bool) {
        for operation in operations {
            let OperationKind::Function(command) = &operation.kind else { continue };
            let (function, on) = (command.function, command.on);
            if !is_refused {
                self.state.functions_on.set(function, on);
            }
            if on {
                self.state.functions_refused.set(function, is_refused);
                if function == Function::ThreadVibration {
                    self.state.thread.work_is_elsewhere = false;
                }
            }
        }
    }

    /// After an error in a block: the NURBS that it belongs to makes no curve.
    fn break_nurbs(&mut self) {
        if let Some(nurbs) = &mut self.state.nurbs {
            nurbs.broken = true;
        }
    }
}

/// Reads a whole program that is in memory.
#[must_use]
pub fn interpret(source: &[u8], settings: LanguageSettings) -> (Vec<Operation>, FindingLog) {
    Interpreter::new(settings).read_all(source)
}
