//! How a cycle along a contour goes through the program: its contour is looked for and read, its passes are handed on, and the
//! program goes on.

mod blocks;
mod compensated;
mod corners;
mod cut;

use serde::{Deserialize, Serialize};

use super::super::corner::Corner;
use super::super::flow::{CallKind, CallRequest, CallTarget, Found, Jump, Mark, Pending, Progress};
use super::super::saved::SavedModes;
use super::super::{Interpreter, angle, corner};
use super::beyond::Writing;
use super::contour::{MAX_PIECES, Piece};
use super::passes::{self, Contour, Refusal};
use super::request::{Job, Request, Whereabouts};
use crate::compensation::geometry::Point;
use crate::dialect::Group;
use crate::finding::FindingMark;
use crate::state::{Motion, RadiusCompensation, ThreadModes};
use crate::{Axis, Finding, FindingLog, Operation, Place, Position, SourceSpan, code};

/// A cycle along a contour that is being carried out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ContourRun {
    request: Request,
    /// The block of the cycle.
    span: SourceSpan,
    stage: Stage,
    /// The line of the cycle.
    from: Mark,
    /// The first block of the contour, and the last one where it has a number.
    first: Mark,
    last: Option<Mark>,
    /// The block behind that of the cycle.
    behind: Mark,
    /// The contour follows the cycle at once.
    follows: bool,
    /// Calls that were open when the contour began.
    depth: u32,
    modes: Option<Box<Modes>>,
    /// What was read of it, the move to it first.
    pieces: Vec<Piece>,
    /// The corner that the words of the present line ask for, and the one that waits behind the last piece for the next.
    asked_corner: Option<Corner>,
    corner: Option<Corner>,
    /// Whether its first block names Z and X.
    named: [bool; 2],
    /// Some of its words count from where the tool is.
    counts: bool,
    /// It has more blocks than are read.
    is_cut: bool,
    /// Something of it or of the cycle is wrong: no passes follow.
    is_broken: bool,
    /// Its nose compensation has been reported.
    is_compensated: bool,
    /// The side of the contour on which the compensated tool is: left of it (`G41`) or right.
    left: Option<bool>,
    /// What a roughing cycle along the same contour has said of its side: the passes went along X, and which way is out.
    roughed: Option<(bool, f64)>,
    /// Moves handed on.
    done: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Stage {
    /// Its block was read.
    Asked,
    /// The contour is looked for directly behind the cycle.
    Approaching,
    /// The blocks of the contour are read.
    Reading,
    /// The passes are handed on.
    Cutting,
}

/// What is in force again behind a contour that was only read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Modes {
    saved: SavedModes,
    position: Position,
    motion: Motion,
    thread: ThreadModes,
    tool: u32,
    next_tool: Option<u32>,
    compensation: RadiusCompensation,
}

impl ContourRun {
    /// A cycle whose block was read; without passes where it is broken.
    pub(super) fn asked(request: Request, span: SourceSpan, is_broken: bool) -> Self {
        Self {
            request,
            span,
            stage: Stage::Asked,
            from: Mark::default(),
            first: Mark::default(),
            last: None,
            behind: Mark::default(),
            follows: false,
            depth: 0,
            modes: None,
            pieces: Vec::new(),
            asked_corner: None,
            corner: None,
            named: [false; 2],
            counts: false,
            is_cut: false,
            is_broken,
            is_compensated: false,
            left: None,
            roughed: None,
            done: 0,
        }
    }

    /// Whether its passes are handed on.
    pub(crate) fn is_cutting(&self) -> bool {
        self.stage == Stage::Cutting
    }

    /// Whether its own blocks are carried out.
    pub(in super::super) fn is_finish(&self) -> bool {
        self.request.job == Job::Finish
    }

    fn contour(&self) -> Contour<'_> {
        Contour {
            pieces: &self.pieces,
            named: self.named,
            start: self.request.start,
            tool: self.request.tool,
            left: self.left,
            roughed: self.roughed,
        }
    }
}

/// Z and X of a position.
const fn place(position: &Position) -> Point {
    [position[Axis::Z.index()], position[Axis::X.index()]]
}

impl Interpreter {
    /// Looks for the contour of the cycle whose block was just executed; `is_refused` where it has an error.
    #[cold]
    pub(in super::super) fn begin_contour(&mut self, is_refused: bool, findings: &mut FindingLog) {
        let leads = [Group::Subprogram, Group::MacroCall].into_iter().find_map(|group| self.block.code(group));
        let leads = leads.map(|code| self.block.code_span(code));
        let Some(run) = &mut self.state.flow.contour else { return };
        if run.stage != Stage::Asked {
            return;
        }
        if let Some(span) = leads {
            // Both say where the program goes on.
            self.state.flow.contour = None;
            return findings.push_with(code::TURNING_CONTOUR, |code| {
                let message = "a call, a return or a modal macro in the block of a cycle along a contour";
                Finding::new(code, span, message).suggest("write it in a block of its own")
            });
        }
        run.is_broken |= is_refused;
        let span = run.span;
        self.wait(span, Jump::Contour);
    }

    /// Finds the contour that a cycle waits for.
    pub(in super::super) fn find_contour(&mut self, pending: &Pending, findings: &mut FindingLog) -> Progress {
        let Some(run) = &self.state.flow.contour else { return Progress::Done };
        let (contour, finishes) = (run.request.contour, run.is_finish());
        match contour {
            Whereabouts::Blocks { first, last } => {
                let program = pending.from.place.program;
                let Some(index) = self.index(program) else { return Progress::NeedsIndex(program) };
                let found = index.contour(first, last, pending.from.place.offset);
                let (first, last) = match found {
                    Ok(found) => found,
                    Err(message) => {
                        let unread = [first, last].map(|number| {
                            let is_nowhere = index.label(number, pending.from.place.offset) == Found::Nowhere;
                            is_nowhere && self.reports_unread('N', number, program, findings)
                        });
                        return match unread {
                            [false, false] => self.no_contour(pending.span, message, findings),
                            _ => {
                                self.state.flow.contour = None;
                                Progress::Failed
                            }
                        };
                    }
                };
                let Some(run) = &mut self.state.flow.contour else { return Progress::Done };
                (run.from, run.first, run.last, run.behind) = (pending.from, first, Some(last), pending.behind);
                if finishes {
                    self.read_contour();
                    self.go_to(first);
                } else {
                    run.stage = Stage::Approaching;
                }
                Progress::Done
            }
            Whereabouts::Sub(number) => {
                // What is not passed reads 0.
                let request = CallRequest {
                    kind: CallKind::Sub,
                    target: CallTarget::Sub(number.to_string()),
                    repeats: 1,
                    arguments: vec![Some(0.0); 30],
                    by_code: false,
                };
                let progress = self.call(&request, pending, findings);
                if matches!(progress, Progress::Done) {
                    let first = Mark { place: self.state.place, lines: self.state.lines };
                    if let Some(run) = &mut self.state.flow.contour {
                        (run.first, run.behind, run.follows) = (first, pending.behind, true);
                        run.from = pending.from;
                    }
                    self.read_contour();
                } else if matches!(progress, Progress::Failed) {
                    self.state.flow.contour = None;
                }
                progress
            }
        }
    }

    #[cold]
    fn no_contour(&mut self, span: SourceSpan, message: String, findings: &mut FindingLog) -> Progress {
        self.state.flow.contour = None;
        findings.push_with(code::TURNING_CONTOUR, |code| {
            Finding::new(code, span, message).suggest(
                "give the first and the last block of the contour the numbers P and Q, each once in the program",
            )
        });
        Progress::Failed
    }

    /// The next block is the first of the contour.
    fn read_contour(&mut self) {
        let modes = Modes {
            // A contour that is only read changes nothing of the compensation.
            saved: SavedModes::of(&self.state).without_compensation(),
            position: self.state.position,
            motion: self.state.motion,
            thread: self.state.thread,
            tool: self.state.tool,
            next_tool: self.state.next_tool,
            compensation: self.state.compensation,
        };
        let calls = self.state.flow.calls.len() as u32;
        let Some(run) = &mut self.state.flow.contour else { return };
        run.stage = Stage::Reading;
        run.depth = calls;
        run.modes = Some(Box::new(modes));
        let [z, x] = run.request.start;
        self.state.position[Axis::Z.index()] = z;
        self.state.position[Axis::X.index()] = x;
    }

    /// A line that was parsed while a contour is awaited: `true` where it is not the first of it, which is then gone to.
    #[cold]
    pub(in super::super) fn approach_contour(&mut self, mark: &FindingMark, findings: &mut FindingLog) -> bool {
        self.take_corner_words(findings);
        let Some(run) = &mut self.state.flow.contour else { return false };
        if run.stage != Stage::Approaching || self.block.is_nothing() {
            return false;
        }
        let (span, first) = (run.span, run.first);
        if self.state.place == first.place {
            run.follows = true;
            self.read_contour();
            return false;
        }
        findings.rewind(*mark);
        self.read_contour();
        self.wait(span, Jump::To(first));
        true
    }

    /// At the end of the input while a contour is awaited or read: `true` where the program goes on with it.
    #[cold]
    pub(in super::super) fn contour_at_end(&mut self, findings: &mut FindingLog) -> bool {
        let Some(run) = &self.state.flow.contour else { return false };
        match run.stage {
            Stage::Approaching => {
                let first = run.first;
                self.read_contour();
                self.go_to(first);
                true
            }
            Stage::Reading => {
                self.unfinished_contour(findings);
                false
            }
            Stage::Asked | Stage::Cutting => false,
        }
    }

    fn unfinished_contour(&mut self, findings: &mut FindingLog) {
        let Some(run) = self.state.flow.contour.take() else { return };
        findings.push_with(code::TURNING_CONTOUR, |code| {
            Finding::new(code, run.span, "the program ends within the contour of this cycle")
                .suggest("put the whole contour, up to its last block, before the end of the program")
        });
    }

    /// Takes the line at `at`, which was executed, as part of the contour; its operations begin at `before`, its findings at the
    /// mark, where the contour was there before it.
    #[cold]
    pub(in super::super) fn follow_contour(
        &mut self,
        at: Place,
        before: usize,
        mark: Option<&FindingMark>,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) {
        let Some(run) = &mut self.state.flow.contour else { return };
        let is_within = match run.last {
            Some(last) => (run.first.place..=last.place).contains(&at),
            None => at != run.from.place,
        };
        if run.stage != Stage::Reading || !is_within {
            return;
        }
        run.is_broken |= mark.is_some_and(|mark| findings.has_errors_since(mark));
        let is_first = run.first.place == at;
        let finishes = run.is_finish();
        self.check_contour_block(findings);
        self.take_contour(is_first, before, operations, findings);
        if self.state.has_ended() {
            // What is behind the end is the rest of the contour.
            self.state.reported.trailing = true;
            if self.state.flow.contour.as_ref().is_some_and(|run| !run.is_broken) {
                self.unfinished_contour(findings);
            }
            self.state.flow.contour = None;
            return;
        }
        if self.state.flow.waits_for_target() {
            return;
        }
        let Some(run) = &self.state.flow.contour else { return };
        let calls = self.state.flow.calls.len() as u32;
        let (is_done, is_left) = match run.last {
            Some(last) => {
                let inside = run.first.place..=last.place;
                (at == last.place && calls == run.depth, !inside.contains(&self.state.place) || calls != run.depth)
            }
            None => (calls < run.depth, false),
        };
        if is_done {
            self.end_contour(finishes, operations, findings);
        } else if is_left {
            let span = run.span;
            self.state.flow.contour = None;
            findings.push_with(code::TURNING_CONTOUR, |code| {
                Finding::new(code, span, "the program leaves the contour of this cycle before its last block")
                    .suggest("write the contour without calls and without jumps out of it")
            });
            self.give_up(span, operations, findings);
        }
    }

    /// Behind the last block of the contour.
    fn end_contour(&mut self, finishes: bool, operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        let before = operations.len();
        let Some(span) = self.state.flow.contour.as_ref().map(|run| run.span) else { return };
        let mark = findings.mark();
        corner::interrupted(&mut self.state, span, operations, findings);
        if let Some(line) = self.state.angle_line.take() {
            angle::unfinished(&line, findings);
        }
        self.take_contour(false, before, operations, findings);
        if let Some(run) = &mut self.state.flow.contour {
            run.check_last_corner(findings);
        }
        let has_errors = findings.has_errors_since(&mark);
        let Some(mut run) = self.state.flow.contour.take() else { return };
        if finishes {
            self.leave_contour(&run, operations);
        }
        run.is_broken |= has_errors;
        if run.is_cut {
            findings.push_with(code::TURNING_LIMIT, |code| {
                Finding::new(code, run.span, format!("the contour has more than {MAX_PIECES} moves"))
                    .with_value("limit", MAX_PIECES as f64, "")
                    .suggest("divide the contour, or let the CAM system write arcs")
            });
            run.is_broken = true;
        }
        if !finishes && let Some(modes) = run.modes.take() {
            self.restore_modes(&modes, run.span, operations, findings);
        } else if let Some(modes) = run.modes.take() {
            self.state.motion = modes.motion;
        }
        self.after_contour(&run, findings);
        if run.is_broken {
            return;
        }
        match passes::plan(&run.request, run.contour()) {
            Ok(plan) => {
                note(&run, plan.has_pockets, plan.cuts_in, findings);
                self.note_side(&run, plan.outward);
                if plan.steps.is_empty() {
                    self.resume_compensation(&run, operations);
                } else {
                    self.steps = Some(plan.steps.into());
                    run.stage = Stage::Cutting;
                    self.state.flow.contour = Some(run);
                }
            }
            Err(Refusal { code, span, message, cure, beyond }) => {
                let cycle = run.span;
                let writing =
                    Writing { is_inch: self.state.inch, is_diameter: self.state.x_diameter, counts: run.counts };
                findings.push_with(code, |code| {
                    if let Some(beyond) = beyond {
                        return beyond.finding(code, cycle, writing);
                    }
                    let place = span.unwrap_or(cycle);
                    let finding =
                        Finding::new(code, place, message).with_value("cycle_line", f64::from(cycle.line), "");
                    finding.suggest(cure)
                });
            }
        }
    }

    /// Where the program goes on behind a contour.
    fn after_contour(&mut self, run: &ContourRun, findings: &mut FindingLog) {
        if run.is_finish() {
            self.go_to(run.behind);
        } else if !run.follows {
            findings.push_with(code::TURNING_DETACHED, |code| {
                let (first, last) = (run.first.line(), run.last.map_or(0, Mark::line));
                let message = format!(
                    "the contour of this cycle is not behind it, but on lines {first} to {last}: the program goes on behind the cycle"
                );
                Finding::new(code, run.span, message)
                    .with_value("first_line", f64::from(first), "")
                    .with_value("last_line", f64::from(last), "")
                    .suggest("put the contour directly behind the cycle, unless this is meant")
            });
            self.go_to(run.behind);
        }
    }

    /// Puts in force again what was before a contour that was only read.
    fn restore_modes(
        &mut self,
        modes: &Modes,
        span: SourceSpan,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) {
        let before = operations.len();
        let reported = self.state.reported;
        self.with_execution(operations, findings, |execution| execution.restore(&modes.saved, span));
        operations.truncate(before);
        let state = &mut self.state;
        state.reported = reported;
        state.position = modes.position;
        state.motion = modes.motion;
        (state.thread.lead_mm, state.thread.lead_as_written) = (modes.thread.lead_mm, modes.thread.lead_as_written);
        (state.tool, state.next_tool) = (modes.tool, modes.next_tool);
        state.compensation = modes.compensation;
    }
}

/// What is worth saying about a cycle.
fn note(run: &ContourRun, has_pockets: bool, cuts_in: bool, findings: &mut FindingLog) {
    if has_pockets {
        findings.push_with(code::TURNING_POCKETS, |code| {
            let message = "the contour has pockets: the order of their passes differs by the model of the control";
            Finding::new(code, run.span, message)
        });
    }
    if cuts_in {
        findings.push_with(code::TURNING_ALLOWANCE, |code| {
            let message = "an allowance of this cycle points into the finished part: it cuts deeper than the contour";
            Finding::new(code, run.span, message)
                .suggest("change the sign of U or W: from the finished part to the stock")
        });
    }
}
