//! Chamfers and roundings between two blocks: the first move waits for the second.

pub(super) mod geometry;

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::execute::{Execution, MM_PER_INCH};
use super::motion::{PLAIN_CORNER_LETTERS, set_bits};
use crate::block::Word;
use crate::code;
use crate::dialect::{Letter, letter_bit};
use crate::state::{InterpreterState, Motion};
use crate::{
    ArcGeometry, Axis, Feed, Finding, FindingLog, Move, MoveKind, Operation, OperationKind, Plane, Position, SourceSpan,
};

use geometry::{Joint, Misfit, Segment};

/// What is put between two moves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum CornerKind {
    /// A straight cut that begins and ends this far from the corner, mm.
    Chamfer(f64),
    /// A tangent arc of this radius, mm.
    Round(f64),
}

/// A corner as its words ask for it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Corner {
    pub(crate) kind: CornerKind,
    /// For words without a comma: the axis of the next move and whether it goes in the positive direction.
    pub(crate) direction: Option<(Axis, bool)>,
    pub(crate) plane: Plane,
    pub(crate) span: SourceSpan,
    /// It is written in inches.
    pub(crate) inch: bool,
}

/// A move that waits for the next one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PendingCorner {
    held: Operation,
    corner: Corner,
}

impl Execution<'_> {
    /// The corner that the words of a block ask for, for its last move; the axis words are in the mask `axes`.
    #[cold]
    pub(super) fn corner_words(&mut self, axes: u32) -> Option<Corner> {
        let plane = self.state.plane;
        let block = self.block;
        let with_comma = [b'C', b'R'].into_iter().find_map(|letter| Some((letter, *block.comma_word(letter)?)));
        if let Some((letter, word)) = with_comma {
            self.commas_used = true;
            if self.state.coords.transform.as_ref().is_some_and(|transform| transform.scaling.is_some()) {
                let span = self.block.word_span(&word);
                self.coord(
                    code::COORD_SHAPE,
                    span,
                    "whether a scaling scales chamfers and roundings depends on the control",
                    "write the corner with G1 and G2 or G3",
                );
                return None;
            }
            let size = self.scaled(&word, true);
            return self.corner(letter, &word, size, None, plane);
        }
        if !self.table.dialect.plain_corners {
            return None;
        }
        if self.settings.plain_drawing_words
            && let Some((letter, word)) = self.plain_corner()
        {
            self.used |= letter_bit(letter);
            let size = self.scaled(&word, true);
            return self.corner(letter, &word, size, None, plane);
        }
        if axes.count_ones() != 1 {
            return None;
        }
        let along = set_bits(axes).find_map(|place| match self.table.dialect.letters[place] {
            Letter::Axis(axis) | Letter::Increment(axis) => Some(axis),
            _ => None,
        })?;
        let (across, chamfer) = match along {
            Axis::X => (Axis::Z, b'K'),
            Axis::Z => (Axis::X, b'I'),
            _ => return None,
        };
        let plain = if self.settings.plain_drawing_words { letter_bit(b'C') } else { 0 };
        let known = plain | letter_bit(b'R') | letter_bit(chamfer);
        let mut words = set_bits(self.block.letters & !self.used & known);
        let letter = b'A' + words.next()? as u8;
        let word = self.take(letter)?;
        let size = self.scaled(&word, true);
        self.corner(letter, &word, size.abs(), Some((across, size > 0.0)), plane)
    }

    /// `C` or `R` of the drawing without a comma and without a sign, for any next move; with one it says where that goes.
    fn plain_corner(&self) -> Option<(u8, Word)> {
        let unused = |letter: u8| self.block.word(letter).copied().filter(|_| self.used & letter_bit(letter) == 0);
        let mut words = [b'C', b'R'].into_iter().filter_map(|letter| Some((letter, unused(letter)?)));
        words.next().filter(|(_, word)| word.number.value() >= 0.0)
    }

    fn corner(
        &mut self,
        letter: u8,
        word: &Word,
        size_mm: f64,
        direction: Option<(Axis, bool)>,
        plane: Plane,
    ) -> Option<Corner> {
        let span = self.block.word_span(word);
        if size_mm < 0.0 || size_mm == 0.0 && direction.is_some() {
            self.findings.push_with(code::CORNER, |code| {
                Finding::new(code, span, "the size of a chamfer or a rounding must be positive")
                    .with_value("size", size_mm, "mm")
                    .suggest("write its size without a sign, or remove it")
            });
            return None;
        }
        let kind = if letter == b'R' { CornerKind::Round(size_mm) } else { CornerKind::Chamfer(size_mm) };
        // A corner of no size is none.
        (size_mm > 0.0).then_some(Corner { kind, direction, plane, span, inch: self.state.inch })
    }

    /// Emits a move that may have a corner at its end.
    pub(super) fn emit_with_corner(&mut self, corner: Option<Corner>, emit: impl FnOnce(&mut Self)) {
        let before = self.operations.len();
        emit(self);
        if let Some(corner) = corner
            && self.operations.len() > before
        {
            self.corners.push((self.operations.len() - 1, corner));
        }
    }

    /// Leaves the words of a corner alone where its move could not be carried out, which has a finding of its own.
    #[cold]
    pub(super) fn pass_over_corner(&mut self, is_plain: bool) {
        self.commas_used = true;
        self.used |= if is_plain { PLAIN_CORNER_LETTERS } else { 0 };
    }

    /// Says that the words of a corner are in a block without the move that they belong to.
    pub(super) fn check_comma_words(&mut self) {
        if !self.block.has_comma_words() || self.block.unclear || self.commas_used {
            return;
        }
        let block = self.block;
        let is_guided = !self.state.tool_control.is_plain();
        let is_motion = matches!(self.state.motion, Motion::Linear | Motion::Arc { .. });
        let moves = self.block.letters & self.table.axis_letters != 0;
        for letter in [b'C', b'R', b'A'] {
            let Some(word) = block.comma_word(letter) else { continue };
            let (message, cure) = match letter {
                b'A' if is_guided => (
                    "the angle of a line is not carried out in a tilted plane, under tool centre point control, or behind them",
                    "write where the line ends in place of its angle",
                ),
                b'C' | b'R' if is_motion && moves => (
                    "the block moves nothing, so that there is no corner at its end",
                    "leave the word out, or correct where the block ends",
                ),
                _ => (
                    "a word with a comma belongs to a move with G1, G2 or G3",
                    "write it in the block of the move before the corner",
                ),
            };
            let span = block.word_span(word);
            self.findings.push_with(code::CORNER, |code| Finding::new(code, span, message).suggest(cure));
        }
    }
}

/// Hands operations on, except a move with a corner, which waits for the next one. `corners` names operations by their place.
#[cold]
pub(super) fn join(
    state: &mut InterpreterState,
    corners: &[(usize, Corner)],
    is_refused: bool,
    blocks_corner: Option<SourceSpan>,
    operations: &mut Vec<Operation>,
    from: usize,
    findings: &mut FindingLog,
) {
    let new = operations.split_off(from);
    if new.is_empty() {
        if is_refused {
            release(state, operations);
        } else if let Some(span) = blocks_corner
            && state.angle_line.is_none()
        {
            interrupted(state, span, operations, findings);
        }
        return;
    }
    for (place, mut operation) in new.into_iter().enumerate() {
        // A corner may take the whole of the move behind it.
        let is_taken = state.corner.take().is_some_and(|pending| close(*pending, &mut operation, operations, findings));
        match corners.iter().find(|(at, _)| *at == from + place) {
            Some((_, corner)) => state.corner = Some(Box::new(PendingCorner { held: operation, corner: *corner })),
            None if is_taken || operation.is_nothing() => {}
            None => operations.push(operation),
        }
    }
}

/// The move that waits, without a corner.
pub(super) fn release(state: &mut InterpreterState, operations: &mut Vec<Operation>) {
    if let Some(pending) = state.corner.take() {
        operations.push(pending.held);
    }
}

/// Reports that no move follows the one that waits.
pub(super) fn interrupted(
    state: &mut InterpreterState,
    by: SourceSpan,
    operations: &mut Vec<Operation>,
    findings: &mut FindingLog,
) {
    if let Some(pending) = &state.corner {
        refuse(&pending.corner, by.line, Refusal::of("no move follows in the next block", MOVE_AT_ONCE), findings);
    }
    release(state, operations);
}

const MOVE_AT_ONCE: &str = "let a move with G1, G2 or G3 in the plane follow at once";

const OTHER_COORDINATES: Refusal = Refusal::of(
    "the coordinates change behind it",
    "change the coordinates before the corner's first move or behind its second",
);

/// Why a corner cannot be made, and what would help.
struct Refusal {
    message: &'static str,
    cure: Cow<'static, str>,
}

impl Refusal {
    const fn of(message: &'static str, cure: &'static str) -> Self {
        Self { message, cure: Cow::Borrowed(cure) }
    }

    fn of_size(misfit: Misfit, corner: &Corner, first: &Segment, last: &Segment) -> Self {
        const OTHER: &str = "write the corner as blocks with G1, G2 or G3, or leave it away";
        let kind = corner.kind;
        let (unit_mm, unit) = if corner.inch { (MM_PER_INCH, "inch") } else { (1.0, "mm") };
        let fits = |size: f64| kind.with_size(size * unit_mm).between(first, last).is_ok_and(|joint| joint.is_some());
        let largest = match misfit {
            Misfit::TurnsBack => None,
            Misfit::TooLarge | Misfit::NoCircle | Misfit::TooLargeForArc => {
                geometry::largest_that_fits(fits, kind.size_mm() / unit_mm)
            }
        };
        let cure = largest.map_or(Cow::Borrowed(OTHER), |size| format!("write at most {size} {unit}").into());
        Self { message: misfit.message(), cure }
    }
}

impl CornerKind {
    const fn size_mm(self) -> f64 {
        match self {
            Self::Chamfer(size_mm) | Self::Round(size_mm) => size_mm,
        }
    }

    const fn with_size(self, size_mm: f64) -> Self {
        match self {
            Self::Chamfer(_) => Self::Chamfer(size_mm),
            Self::Round(_) => Self::Round(size_mm),
        }
    }

    /// What it puts between two parts of the path; nothing where they are tangent.
    fn between(self, first: &Segment, last: &Segment) -> Result<Option<Joint>, Misfit> {
        match self {
            Self::Chamfer(size_mm) => geometry::chamfer(first, last, size_mm),
            Self::Round(radius_mm) => geometry::rounding(first, last, radius_mm),
        }
    }
}

#[cold]
fn refuse(corner: &Corner, next_line: u32, Refusal { message, cure }: Refusal, findings: &mut FindingLog) {
    findings.push_with(code::CORNER, |code| {
        Finding::new(code, corner.span, format!("the corner cannot be made: {message}"))
            .with_value("next_line", f64::from(next_line), "")
            .suggest(cure)
    });
}

/// Puts the corner between the move that waits and the one behind it; whether it takes the whole of that.
fn close(
    pending: PendingCorner,
    next: &mut Operation,
    operations: &mut Vec<Operation>,
    findings: &mut FindingLog,
) -> bool {
    let PendingCorner { mut held, corner } = pending;
    let line = next.span.line;
    match joined(&held, &corner, next) {
        Err(refusal) => refuse(&corner, line, refusal, findings),
        Ok(None) => findings.push_with(code::CORNER_STRAIGHT, |code| {
            let message = "the path goes straight on here: there is no corner to cut or to round";
            Finding::new(code, corner.span, message)
                .with_value("next_line", f64::from(line), "")
                .suggest("leave the corner out, or check the end of the block and of the next one")
        }),
        Ok(Some(parts)) => {
            let [first, middle, last] = *parts;
            let mut between = held.clone();
            replace_step(&mut between, middle);
            if first.start != first.end {
                replace_step(&mut held, first);
                operations.push(held);
            }
            let is_taken = last.is_nothing();
            replace_step(next, last);
            operations.push(between);
            return is_taken;
        }
    }
    operations.push(held);
    false
}

fn replace_step(operation: &mut Operation, step: Move) {
    if let Some(place) = operation.kind.path_step_mut() {
        *place = step;
    }
}

/// Whether a corner can be between two moves: both are lines or arcs in its plane, and the second goes where its sign says.
fn check_sides(first: &Move, last: &Move, corner: &Corner) -> Result<(), Refusal> {
    let is_curve = |step: &Move| step.kind == MoveKind::Cutting && step.spline.is_none();
    if !is_curve(first) || !is_curve(last) {
        return Err(Refusal::of("what follows is no move with G1, G2 or G3", MOVE_AT_ONCE));
    }
    if first.end != last.start || first.work_offset != last.work_offset {
        return Err(OTHER_COORDINATES);
    }
    if matches!(first.feed, Feed::InverseTime(_)) {
        return Err(Refusal::of(
            "under inverse time the corner has no time of its own",
            "select a feed per minute or per revolution before it",
        ));
    }
    let (along, across) = corner.plane.axes();
    let outside = |step: &Move| {
        let planar = |axis: usize| axis == along.index() || axis == across.index();
        (0..step.end.len()).any(|axis| !planar(axis) && step.start[axis] != step.end[axis])
            || step.arc.is_some_and(|arc| arc.plane != corner.plane)
    };
    let turns = |step: &Move| {
        let rotary = |axis: &Axis| axis.is_rotary() && step.start[axis.index()] != step.end[axis.index()];
        Axis::ALL.iter().any(rotary)
    };
    if turns(first) || turns(last) {
        return Err(Refusal::of(
            "A, B or C moves as an axis",
            "turn the axis in a block of its own; if A and C are words of the drawing here, set \
             language.plain_drawing_words of the machine profile",
        ));
    }
    if outside(first) || outside(last) {
        return Err(Refusal::of(
            "a move leaves the plane",
            "move the other axes in a block before the corner or behind it",
        ));
    }
    if let Some((axis, positive)) = corner.direction {
        let travel = last.end[axis.index()] - last.start[axis.index()];
        let other = if axis == along { across } else { along };
        let is_straight = last.arc.is_none() && last.end[other.index()] == last.start[other.index()];
        if !is_straight || travel == 0.0 || (travel > 0.0) != positive {
            return Err(Refusal::of(
                "its sign is not the direction of the next move, which must be at right angles",
                "write the sign of the next move, or the corner as blocks with G1, G2 or G3",
            ));
        }
    }
    Ok(())
}

/// The three moves instead of two; nothing where the moves are tangent, so that there is no corner.
fn joined(held: &Operation, corner: &Corner, next: &Operation) -> Result<Option<Box<[Move; 3]>>, Refusal> {
    let (Some(first), Some(last)) = (held.kind.path_step(), next.kind.path_step()) else {
        return Err(match next.kind {
            OperationKind::Compensation(_) => Refusal::of(
                "the next block switches the radius compensation on or off",
                "let a move of the contour follow at once, and switch the compensation behind it",
            ),
            _ => Refusal::of("what follows is no move", MOVE_AT_ONCE),
        });
    };
    if held.kind.path_frame() != next.kind.path_frame() {
        return Err(OTHER_COORDINATES);
    }
    check_sides(first, last, corner)?;
    let (along, across) = corner.plane.axes();
    let point = |position: &Position| [position[along.index()], position[across.index()]];
    let segment = |step: &Move| Segment::new(point(&step.start), point(&step.end), step.arc.as_ref());
    let (before, behind) = (segment(first), segment(last));
    let joint = corner.kind.between(&before, &behind);
    let joint = joint.map_err(|misfit| Refusal::of_size(misfit, corner, &before, &behind))?;
    let Some(Joint { from, to, arc }) = joint else { return Ok(None) };
    let placed = |point: [f64; 2]| {
        let mut position = first.end;
        (position[along.index()], position[across.index()]) = (point[0], point[1]);
        position
    };
    let (from_position, to_position) = (placed(from), placed(to));
    let trimmed = |step: &Move, start: Position, end: Position| {
        // Of a move that the corner takes whole nothing is left.
        let is_left = !geometry::is_same(point(&start), point(&end));
        let start = if is_left { start } else { end };
        let arc = step.arc.filter(|_| is_left).map(|arc| ArcGeometry {
            sweep_rad: geometry::sweep(point(&start), point(&end), arc.center, arc.clockwise),
            ..arc
        });
        Move { start, end, arc, ..step.clone() }
    };
    let head = trimmed(first, first.start, from_position);
    let tail = trimmed(last, to_position, last.end);
    let arc = arc.map(|(center, clockwise)| ArcGeometry {
        plane: corner.plane,
        center,
        clockwise,
        sweep_rad: geometry::sweep(from, to, center, clockwise),
    });
    let middle = Move { start: from_position, end: to_position, arc, ..first.clone() };
    Ok(Some(Box::new([head, middle, tail])))
}
