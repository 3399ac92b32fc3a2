//! Control flow: jumps, loops, branches and subprograms.
//!
//! A statement decides what comes next as soon as it is executed; where its target has to be looked for, the jump waits until the
//! program is indexed, which one pass over its bytes does. The state of it all is small and part of the interpreter's: the callers
//! of the program that is read, the loops that are open in it, and the jump that waits.

mod bounds;
mod calls;
mod index;
mod labels;
mod line;
mod macro_b;
mod o_words;
mod programs;
mod targets;
mod values;
mod whole_lines;

use std::collections::BTreeMap;

use labels::Labels;

pub(crate) use calls::called_program;
pub(super) use index::{Index, Indexer};
pub(crate) use line::{Statement, classify, digits, is_conditional_return, name};
pub(super) use whole_lines::FlowLine;

use serde::{Deserialize, Serialize};

use super::Interpreter;
use super::turning::ContourRun;
use crate::finding::FindingMark;
use crate::state::{ModeContext, Phase};
use crate::{FindingLog, InterpreterState, Operation, Place, ProgramName, SourceSpan};

/// Most programs that wait for the one that is read.
pub(super) const MAX_CALLS: usize = 10;
/// Most of them with local variables of their own.
pub(super) const MAX_MACRO_CALLS: usize = 4;
/// Most loops open in one program.
const MAX_LOOPS: usize = 64;

/// Where a line begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Mark {
    pub(crate) place: Place,
    /// Lines before it.
    pub(crate) lines: u32,
}

impl Mark {
    const fn start_of(program: u32) -> Self {
        Self { place: Place { program, offset: 0 }, lines: 0 }
    }

    pub(super) const fn line(self) -> u32 {
        self.lines + 1
    }
}

/// What a search for a place found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Found {
    Nowhere,
    At(Mark),
    Twice(Mark, Mark),
}

/// Everything that control flow remembers between two lines.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct FlowState {
    /// The programs that wait for the one that is read, outermost first.
    pub(crate) calls: Vec<Call>,
    /// The first call of each further program.
    first_calls: BTreeMap<u32, SourceSpan>,
    /// Loops that are open in the program that is read, outermost first.
    loops: Vec<Loop>,
    /// Macros that are run behind every block that moves, oldest first (`G66`).
    modal: Vec<ModalCall>,
    /// A jump whose target has to be looked for.
    pending: Option<Box<Pending>>,
    /// The line of an `elseif` that a jump has reached: its condition counts.
    branch: Option<Place>,
    /// Blocks executed.
    blocks: u64,
    /// Blocks executed since the last one that moved.
    still_blocks: u64,
    /// Blocks that moved.
    moves: u64,
    /// Blocks with codes.
    codes: u64,
    /// Statements that asked for what the control sets: a position, a mode, an offset.
    asked: u64,
    /// Those before the last statement: what the head of a loop asks is a part of the round that it begins.
    asked_before: u64,
    /// Loops that jumps back have made in the program that is read, outermost first.
    jumps: Vec<JumpLoop>,
    /// A program was called or a jump made: what is behind the end of the program need not be looked at.
    has_jumped: bool,
    /// `M99` in the main program.
    restarts_at: Option<SourceSpan>,
    /// The program that was read has ended with `M99` and called nothing.
    pub(super) may_be_subprogram: bool,
    /// A condition or a computed jump was carried out: a round may end otherwise than the one before.
    has_decided: bool,
    /// O-words that have begun something.
    labels: Labels,
    /// The turning cycle along a contour that is being carried out.
    pub(super) contour: Option<Box<ContourRun>>,
}

/// By what two visits of one place are told apart, each a count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Signature {
    /// Changes of variables.
    changes: u64,
    moves: u64,
    codes: u64,
    /// Statements that asked for what the control sets.
    asked: u64,
}

/// Everything at the end of a round of a loop, which later rounds are held against.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Seen {
    /// That round.
    round: u64,
    /// Everything but control flow.
    state: InterpreterState,
    /// Macros that were in force.
    modal: Vec<ModalCall>,
}

/// A program that waits for one that it called.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Call {
    kind: CallKind,
    /// Where the called program begins.
    target: Mark,
    /// The line that called.
    from: Mark,
    /// Where the caller goes on.
    back: Mark,
    /// The block that called.
    pub(crate) span: SourceSpan,
    /// A code of the profile called it.
    by_code: bool,
    /// Which time it is run, from 1.
    run: u32,
    /// How often it is still to be run after this time.
    repeats: u32,
    /// Blocks executed before it.
    since: u64,
    /// The caller's loops.
    loops: Vec<Loop>,
    /// Likewise, those that it has made by jumps.
    jumps: Vec<JumpLoop>,
    /// The number of the caller.
    program_number: Option<u32>,
    /// The modes that the caller has saved.
    modes: ModeContext,
}

/// How a program was called.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum CallKind {
    /// `M98`, `M97`: it shares the caller's local variables.
    Plain,
    /// `G65`: with local variables of its own.
    Macro,
    /// Behind a block that moved (`G66`): likewise, and what moves in it calls the macro before this one.
    Modal {
        /// Place of the macro among the modal ones.
        level: u32,
    },
    /// `o… call`: with local variables of its own.
    Sub,
}

impl CallKind {
    const fn has_locals(self) -> bool {
        !matches!(self, Self::Plain)
    }

    const fn is_macro(self) -> bool {
        matches!(self, Self::Macro | Self::Modal { .. })
    }
}

/// A loop that is open.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Loop {
    kind: LoopKind,
    /// Its number or name.
    name: Box<str>,
    /// The line that begins it.
    head: Mark,
    /// The line behind that.
    body: Mark,
    /// The line that ends it.
    last: Mark,
    /// The line behind that.
    behind: Mark,
    /// Rounds that are still to be begun, of a `repeat`.
    rounds: u64,
    /// Rounds begun.
    iteration: u64,
    /// Blocks executed before it.
    since: u64,
    /// The state when the last round began.
    signature: Signature,
    /// The state that rounds are held against.
    seen: Option<Box<Seen>>,
}

/// A loop that a program makes by jumps back (`GOTO`, `M99 P`); jumps whose lines cross make one together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct JumpLoop {
    /// The first line that it goes back to.
    first: Mark,
    /// The last line that it goes back from.
    last: Mark,
    /// The line of its latest jump.
    from: Place,
    /// What asked for that.
    span: SourceSpan,
    /// The state at that.
    signature: Signature,
    /// The state that rounds are held against.
    seen: Option<Box<Seen>>,
    /// Rounds begun, the one before its first jump among them.
    iteration: u64,
    /// Blocks executed before its first jump.
    since: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum LoopKind {
    /// Its head is executed before every round.
    While,
    /// Its last line is executed behind every round.
    DoWhile,
    Repeat,
}

/// A macro that is run behind every block that moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct ModalCall {
    request: CallRequest,
    span: SourceSpan,
}

/// A call as it was asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct CallRequest {
    pub(super) kind: CallKind,
    pub(super) target: CallTarget,
    pub(super) repeats: u32,
    /// Local variables of the called program, from `#1` on.
    pub(super) arguments: Vec<Option<f64>>,
    /// A code calls it that the profile replaces by the call.
    pub(super) by_code: bool,
}

/// What is called.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub(super) enum CallTarget {
    /// A program, and the label in it where it begins.
    Program { name: ProgramName, label: Option<u32> },
    /// A label of the same program.
    Label(u32),
    /// An O-word subprogram by its number or name.
    Sub(String),
}

/// A jump whose target has to be looked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Pending {
    /// What asked for it.
    pub(super) span: SourceSpan,
    /// Its line.
    pub(super) from: Mark,
    /// The line behind it.
    pub(super) behind: Mark,
    jump: Jump,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Jump {
    /// `GOTO`
    Label(u32),
    /// `M99 P` of the main program.
    MainReturn(u32),
    /// `DOm`, with the value of its `WHILE`.
    Do(bool),
    /// A statement of the O-word language, with the value of its condition or its count where it has one.
    OWord(Statement, f64),
    Call(CallRequest),
    /// The end of a called program, and the label of the caller where it goes on.
    Return(Option<u32>),
    /// To a line that is known.
    To(Mark),
    /// The contour of a turning cycle.
    Contour,
}

/// How far a jump got.
pub(super) enum Progress {
    Done,
    /// This program has to be indexed first.
    NeedsIndex(u32),
    /// It cannot be carried out: an error was pushed.
    Failed,
}

impl Interpreter {
    /// Whether the present line belongs to a loop or a called program.
    #[inline]
    pub(super) const fn is_nested(&self) -> bool {
        !(self.state.flow.calls.is_empty() && self.state.flow.loops.is_empty())
    }

    /// Says of the findings since the mark, which are those of a line, within which calls and in which round of a loop they were made.
    #[cold]
    pub(super) fn place_in_calls(&self, mark: FindingMark, findings: &mut FindingLog) {
        let flow = &self.state.flow;
        let round = flow.loops.last().map(|open| open.iteration);
        findings.change_since(mark, |finding| {
            finding.met_within(flow.calls.iter().rev().map(|call| call.span), round);
        });
    }

    /// Goes on with what waits, once the bytes that it needs were read.
    pub(super) fn settle(&mut self, operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        let Some(pending) = self.state.flow.pending.take() else { return };
        let mark = self.is_nested().then(|| findings.mark());
        match self.carry_out(&pending, findings) {
            Progress::Done => {
                if let Some(saved) = self.state.machine.returning.take() {
                    self.with_execution(operations, findings, |execution| {
                        execution.restore_codes(&saved, pending.span);
                    });
                }
            }
            Progress::NeedsIndex(program) => {
                self.state.flow.pending = Some(pending);
                self.begin_index(program);
            }
            Progress::Failed => {
                if let Some(mark) = mark {
                    self.place_in_calls(mark, findings);
                }
                self.give_up(pending.span, operations, findings);
            }
        }
    }

    /// Begins to read a program for its index.
    pub(super) fn begin_index(&mut self, program: u32) {
        let flow = self.table.dialect.flow;
        self.indexing = Some(Box::new(Indexer::new(program, flow, &self.settings)));
    }

    /// The program of a restored interpreter that has to be indexed before anything else.
    pub(super) fn resume_pending(&mut self) {
        if let Some(pending) = &self.state.flow.pending {
            self.begin_index(pending.from.place.program);
        }
    }

    /// Ends the execution after an error of control flow: where the program goes on is not known.
    pub(super) fn give_up(&mut self, span: SourceSpan, operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        self.state.nurbs = None;
        self.state.reported.trailing = true;
        if !self.state.has_ended() {
            self.state.evidence.go_on();
            self.close(span, operations, findings);
        }
    }

    /// Goes to a line.
    pub(super) fn go_to(&mut self, mark: Mark) {
        self.state.flow.has_jumped = true;
        // What can be carried out so is a program, and its lines are read again.
        self.state.evidence.settle();
        self.state.place = mark.place;
        self.state.lines = mark.lines;
        (self.state.last_line_bytes, self.state.blank_lines) = (0, 0);
        self.state.after_return = false;
        self.state.phase = Phase::Blocks;
    }
}

/// The whole of a line, as far as it is known without its text.
fn span_of(mark: Mark) -> SourceSpan {
    SourceSpan { program: mark.place.program, line: mark.line(), column: 1, length: 0 }
}

impl FlowState {
    /// Whether a modal macro (`G66`) is in force.
    pub(super) const fn has_modal_calls(&self) -> bool {
        !self.modal.is_empty()
    }

    /// Whether lines were passed over and no block has done anything: those of subprograms of the O-word language.
    pub(super) const fn has_only_passed_subprograms(&self) -> bool {
        self.has_jumped && self.moves == 0 && self.codes == 0
    }

    /// Whether something has to be done before the next line.
    #[inline]
    pub(super) const fn waits(&self) -> bool {
        self.pending.is_some() || self.restarts_at.is_some() || self.contour.is_some()
    }

    /// Whether a jump waits whose target has to be looked for.
    pub(super) const fn waits_for_target(&self) -> bool {
        self.pending.is_some()
    }

    /// Whether the program that is read, or one that waits for it, was called by a code of the profile.
    pub(crate) fn is_called_by_code(&self) -> bool {
        self.calls.iter().any(|call| call.by_code)
    }

    /// The calls that first led to a further program, innermost first.
    pub(crate) fn first_calls_of(&self, program: u32) -> impl Iterator<Item = SourceSpan> {
        // A program was called before it called another one, so this comes to an end.
        let caller = |call: &SourceSpan| self.first_call_of(call.program);
        core::iter::successors(self.first_call_of(program), caller)
    }

    fn first_call_of(&self, program: u32) -> Option<SourceSpan> {
        // The job's own program may be called as well, and was there before.
        self.first_calls.get(&program).filter(|_| program != 0).copied()
    }

    /// Something moved without a block.
    pub(super) const fn moved(&mut self) {
        self.moves += 1;
        self.still_blocks = 0;
    }

    /// Whether a macro is run behind every block that moves.
    pub(super) const fn calls_after_moves(&self) -> bool {
        !self.modal.is_empty()
    }

    /// Whether lines may be executed more than once.
    pub(super) const fn has_jumped(&self) -> bool {
        self.has_jumped
    }
}
