//! How long a program may go round: its bounds, and the loop or the call that is named where one of them is reached.
//!
//! Bounds count blocks, as nobody knows in advance whether a loop ends. A round after which everything is as after one before is
//! endless at once: what follows depends on nothing else. Rounds are held against one of the rounds before, which is replaced at
//! twice its number, so that rounds that repeat in turn are found as well (R. P. Brent, "An improved Monte Carlo factorization
//! algorithm", 1980).

use super::{
    Call, FlowState, Interpreter, JumpLoop, Loop, LoopKind, MAX_LOOPS, Mark, Pending, Seen, Signature, span_of,
};
use crate::code;
use crate::dialect::Flow;
use crate::{Finding, FindingLog, InterpreterState, SourceSpan};

/// The round whose state is kept first, where rounds change variables: most loops end before, and pay nothing.
const FIRST_SEEN: u64 = 8;
/// Most loops within each other of which a state is kept.
const MOST_SEEN: usize = 4;

/// What goes round again.
#[derive(Clone, Copy)]
pub(super) enum Round {
    /// The open loop at this place.
    Loop(usize),
    /// The innermost loop of jumps.
    Jumps,
}

/// Why every further round is as one before.
#[derive(Clone, Copy)]
enum Repeats {
    /// Nothing has changed in it.
    AtOnce,
    /// It moves on, but what is decided in it depends on nothing that has changed.
    Deciding,
    /// Everything is as it was so many rounds before.
    Since(u64),
}

/// Something that is run more than once.
#[derive(Clone, Copy)]
enum Repeated<'a> {
    Loop(&'a Loop),
    Jumps(&'a JumpLoop),
    Call(&'a Call),
}

impl Repeated<'_> {
    /// Blocks that were executed before it began.
    const fn since(self) -> u64 {
        match self {
            Self::Loop(open) => open.since,
            Self::Jumps(open) => open.since,
            Self::Call(call) => call.since,
        }
    }

    /// The round that it is in, from 1.
    fn round(self) -> u64 {
        match self {
            Self::Loop(open) => open.iteration,
            Self::Jumps(open) => open.iteration,
            Self::Call(call) => u64::from(call.run),
        }
    }

    /// Its first block.
    fn first(self) -> SourceSpan {
        match self {
            Self::Loop(open) => span_of(open.head),
            Self::Jumps(open) => span_of(open.first),
            Self::Call(call) => span_of(call.target),
        }
    }

    /// Where it goes round again: what is wrong, is wrong with this.
    fn place(self) -> SourceSpan {
        match self {
            Self::Loop(open) => span_of(open.head),
            Self::Jumps(open) => open.span,
            Self::Call(call) => call.span,
        }
    }

    /// What it is, and its lines.
    fn name(self, flow: Flow) -> String {
        match self {
            Self::Loop(open) => {
                let name = &open.name;
                let kind = match (flow, open.kind) {
                    (Flow::MacroB, _) => format!("DO{name} … END{name}"),
                    (Flow::OWords, LoopKind::While) => format!("o{name} while … endwhile"),
                    (Flow::OWords, LoopKind::DoWhile) => format!("o{name} do … while"),
                    (Flow::OWords, LoopKind::Repeat) => format!("o{name} repeat … endrepeat"),
                };
                format!("the loop {kind} from line {} to line {}", open.head.line(), open.last.line())
            }
            Self::Jumps(open) => {
                let (first, last) = (open.first.line(), open.span.line);
                format!("the loop that the jump on line {last} makes, back to line {first}")
            }
            Self::Call(call) => {
                format!("the program from line {} on that line {} calls", call.target.line(), call.span.line)
            }
        }
    }

    /// Says of a finding which round of it was the last, and where it begins.
    fn named(self, finding: Finding) -> Finding {
        let finding = finding.at("iteration", self.round()).with_value("first_line", f64::from(self.first().line), "");
        if self.first().line == self.place().line {
            return finding;
        }
        finding.related_to("its first block", self.first())
    }
}

impl Signature {
    /// Whether nothing has changed between the two.
    fn is_as(self, later: Self) -> bool {
        (self.changes, self.moves, self.codes) == (later.changes, later.moves, later.codes)
    }

    /// Whether everything that was decided between the two is decided again in the same way: no variable has changed, and no statement
    /// has asked for what the control sets.
    fn decides_as(self, later: Self) -> bool {
        (self.changes, self.asked) == (later.changes, later.asked)
    }
}

impl FlowState {
    /// What is being run more than once on the line that is read, outermost first.
    fn repeated(&self, line: u32) -> impl Iterator<Item = Repeated<'_>> {
        let waiting = self.calls.iter().flat_map(|call| {
            let again = (call.run > 1).then_some(Repeated::Call(call));
            loops_of(&call.loops, &call.jumps, call.from.line()).chain(again)
        });
        waiting.chain(loops_of(&self.loops, &self.jumps, line))
    }

    /// The innermost of them that has taken more than this many blocks.
    fn repeated_for(&self, line: u32, blocks: u64) -> Option<Repeated<'_>> {
        let repeated = self.repeated(line).filter(|it| self.blocks - it.since() > blocks);
        repeated.max_by_key(|it| it.since())
    }

    /// Forgets the loops of jumps that a jump to this line leaves.
    pub(super) fn leave_jumps(&mut self, to: Mark) {
        self.jumps.retain(|open| (open.first.place..=open.last.place).contains(&to.place));
    }

    /// Forgets the loops of jumps within these lines, which are gone through anew.
    pub(super) fn restart_jumps(&mut self, first: Mark, last: Mark) {
        self.jumps.retain(|open| open.first.place < first.place || open.last.place > last.place);
    }
}

/// The loops of one program that its line is in.
fn loops_of<'a>(loops: &'a [Loop], jumps: &'a [JumpLoop], line: u32) -> impl Iterator<Item = Repeated<'a>> {
    let around = jumps.iter().filter(move |open| (open.first.line()..=open.last.line()).contains(&line));
    loops.iter().map(Repeated::Loop).chain(around.map(Repeated::Jumps))
}

impl Interpreter {
    /// By what two visits of one place are told apart.
    pub(super) fn signature(&self) -> Signature {
        let FlowState { moves, codes, asked, .. } = self.state.flow;
        Signature { changes: self.state.parameters.changes(), moves, codes, asked }
    }

    /// That of a loop at its head, whose condition is a part of the round.
    pub(super) fn signature_at_head(&self) -> Signature {
        Signature { asked: self.state.flow.asked_before, ..self.signature() }
    }

    /// Counts a block that was executed; `false` after an error, where there were too many.
    #[inline]
    pub(super) fn count_block(&mut self, moves: bool, span: SourceSpan, findings: &mut FindingLog) -> bool {
        let flow = &mut self.state.flow;
        flow.blocks += 1;
        if moves {
            flow.moves += 1;
            flow.still_blocks = 0;
        } else {
            flow.still_blocks += 1;
        }
        if flow.blocks <= self.settings.max_executed_blocks && flow.still_blocks <= self.settings.max_still_blocks {
            return true;
        }
        !self.is_beyond_bounds(span, findings)
    }

    /// Whether a bound is exceeded: that of all blocks, or that of a loop without motion.
    #[cold]
    fn is_beyond_bounds(&self, span: SourceSpan, findings: &mut FindingLog) -> bool {
        let flow = &self.state.flow;
        let (line, language) = (self.state.lines, self.table.dialect.flow);
        let (count, limit, what, looped) = if flow.blocks > self.settings.max_executed_blocks {
            let limit = self.settings.max_executed_blocks;
            // The loop that took most of them, or the one that the last of them is in.
            let looped = flow.repeated_for(line, limit / 2).or_else(|| flow.repeated_for(line, 0));
            (flow.blocks, limit, "blocks were executed", looped)
        } else {
            let limit = self.settings.max_still_blocks;
            let Some(looped) = flow.repeated_for(line, limit) else { return false };
            (flow.still_blocks, limit, "blocks were executed without any motion", Some(looped))
        };
        findings.push_with(code::ENDLESS, |code| {
            let place = looped.map_or(span, Repeated::place);
            let within = looped.map_or(String::new(), |it| format!(" in {}, round {}", it.name(language), it.round()));
            let finding = Finding::new(code, place, format!("{count} {what}{within}, more than the limit of {limit}"))
                .with_value("blocks", count as f64, "")
                .with_value("limit", limit as f64, "")
                .suggest("let the loop end, or raise the limit in the language settings of the machine profile");
            let Some(looped) = looped else { return finding };
            let finding = looped.named(finding);
            if (span.program, span.line) == (place.program, place.line) {
                return finding;
            }
            finding.related_to("the block at which the limit was reached", span)
        });
        true
    }

    /// Notes that the program goes back to a line before; whether it never ends, which is then reported.
    pub(super) fn is_jump_endless(&mut self, to: Mark, pending: &Pending, findings: &mut FindingLog) -> bool {
        let signature = self.signature();
        let flow = &mut self.state.flow;
        let mut jump = JumpLoop {
            first: to,
            last: pending.from,
            from: pending.from.place,
            span: pending.span,
            signature,
            seen: None,
            iteration: 2,
            since: flow.blocks,
        };
        let mut before = None;
        flow.jumps.retain_mut(|open| {
            if open.from == jump.from {
                before = Some(open.signature);
            } else if open.is_around(&jump) {
                return true;
            } else if !open.crosses(&jump) {
                return false;
            }
            jump.join(open);
            false
        });
        if flow.jumps.len() >= MAX_LOOPS {
            flow.jumps.remove(0);
        }
        flow.jumps.push(jump);
        self.is_endless(Round::Jumps, before, findings)
    }

    /// An error where what goes round again is in a state that it was in before; `before` is the signature of the last round.
    pub(super) fn is_endless(&mut self, round: Round, before: Option<Signature>, findings: &mut FindingLog) -> bool {
        // What goes back is a program; from here on nothing counts on.
        self.state.evidence.settle();
        let now = self.signature();
        let repeats = match before {
            Some(before) if before.is_as(now) => Some(Repeats::AtOnce),
            Some(before) if before.decides_as(now) => Some(Repeats::Deciding),
            before => self.rounds_since_same(round, before).map(|rounds| match rounds {
                1 => Repeats::AtOnce,
                _ => Repeats::Since(rounds),
            }),
        };
        let (Some(repeats), Some(looped)) = (repeats, self.repeated_at(round)) else { return false };
        findings.push_with(code::ENDLESS, |code| {
            let name = looped.name(self.table.dialect.flow);
            let message = match repeats {
                Repeats::AtOnce => format!(
                    "nothing has changed since the last round of {name}: no variable, no position, no mode. It never ends"
                ),
                Repeats::Deciding => format!(
                    "no variable has changed since the last round of {name}, and nothing in it asks for anything else. It never ends"
                ),
                Repeats::Since(rounds) => format!(
                    "everything is as it was {rounds} rounds before in {name}: variables, position, modes. It never ends"
                ),
            };
            let finding = looped.named(Finding::new(code, looped.place(), message));
            finding.suggest("change what its condition asks for, or leave the loop by a jump")
        });
        true
    }

    fn repeated_at(&self, round: Round) -> Option<Repeated<'_>> {
        let flow = &self.state.flow;
        match round {
            Round::Loop(place) => flow.loops.get(place).map(Repeated::Loop),
            Round::Jumps => flow.jumps.last().map(Repeated::Jumps),
        }
    }

    /// How many rounds ago everything was as it is now; keeps the state of this round where it is its turn.
    fn rounds_since_same(&mut self, round: Round, before: Option<Signature>) -> Option<u64> {
        // A round that changes no variable repeats itself but for what it asks of the control: its state is kept at once.
        let is_suspect = before.is_some_and(|before| before.changes == self.state.parameters.changes());
        let (number, seen) = self.state.flow.seen_in(round)?;
        let kept = seen.take();
        let is_turn = match &kept {
            Some(seen) if self.is_as(seen) => return Some(number - seen.round),
            Some(seen) => number >= 2 * seen.round,
            None => is_suspect || number >= FIRST_SEEN,
        };
        let kept = if is_turn { Some(self.keep_round(number)) } else { kept };
        if let Some((_, seen)) = self.state.flow.seen_in(round) {
            *seen = kept;
        }
        if is_turn {
            self.state.flow.limit_seen();
        }
        None
    }

    /// Whether everything but control flow is as it was.
    #[inline]
    fn is_as(&mut self, seen: &Seen) -> bool {
        // What most rounds differ in comes first.
        self.state.position == seen.state.position
            && self.state.parameters.are_as(&seen.state.parameters)
            && self.is_all_as(seen)
    }

    #[cold]
    fn is_all_as(&mut self, seen: &Seen) -> bool {
        self.state.flow.modal == seen.modal && self.without_flow(|state| *state == seen.state)
    }

    #[cold]
    fn keep_round(&mut self, round: u64) -> Box<Seen> {
        let state = self.without_flow(Clone::clone);
        Box::new(Seen { round, state, modal: self.state.flow.modal.clone() })
    }

    /// What is made of the state without what counts on.
    fn without_flow<T>(&mut self, read: impl FnOnce(&InterpreterState) -> T) -> T {
        let flow = std::mem::take(&mut self.state.flow);
        let changes = self.state.parameters.exchange_changes(0);
        let made = read(&self.state);
        self.state.parameters.exchange_changes(changes);
        self.state.flow = flow;
        made
    }
}

impl FlowState {
    /// The number of the present round, and the state that it is held against.
    fn seen_in(&mut self, round: Round) -> Option<(u64, &mut Option<Box<Seen>>)> {
        match round {
            Round::Loop(place) => self.loops.get_mut(place).map(|open| (open.iteration, &mut open.seen)),
            Round::Jumps => self.jumps.last_mut().map(|open| (open.iteration, &mut open.seen)),
        }
    }

    /// Forgets the state that is kept of the outermost loop, where too many are.
    fn limit_seen(&mut self) {
        let waiting = self.calls.iter_mut().flat_map(|call| seen_of(&mut call.loops, &mut call.jumps));
        let mut kept: Vec<_> = waiting.chain(seen_of(&mut self.loops, &mut self.jumps)).collect();
        if kept.len() > MOST_SEEN {
            *kept[0] = None;
        }
    }
}

/// The states that are kept of the loops of one program.
fn seen_of<'a>(loops: &'a mut [Loop], jumps: &'a mut [JumpLoop]) -> impl Iterator<Item = &'a mut Option<Box<Seen>>> {
    let all = loops.iter_mut().map(|open| &mut open.seen).chain(jumps.iter_mut().map(|open| &mut open.seen));
    all.filter(|seen| seen.is_some())
}

impl JumpLoop {
    /// Whether the other one is within it and ends before it does.
    fn is_around(&self, other: &Self) -> bool {
        self.first.place <= other.first.place && other.last.place < self.last.place
    }

    /// Whether they share lines although neither is within the other.
    fn crosses(&self, other: &Self) -> bool {
        let is_apart = self.last.place < other.first.place || other.last.place < self.first.place;
        !is_apart && !self.is_around(other) && !other.is_around(self)
    }

    /// Takes a loop over that goes over its lines as well: both are one from now on.
    fn join(&mut self, other: &mut Self) {
        if other.first.place < self.first.place {
            self.first = other.first;
        }
        if other.last.place > self.last.place {
            self.last = other.last;
        }
        self.iteration = self.iteration.max(other.iteration + 1);
        self.seen = other.seen.take().or_else(|| self.seen.take());
        self.since = self.since.min(other.since);
    }
}
