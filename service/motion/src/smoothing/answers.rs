//! Corners that are alike are decided once.
//!
//! What is held of the path is stated from its first corner, on a grid that is finer than a position has to be, without what no plan
//! depends on: lines of the program, blocks that are carried out, the offset and the travel of the machine. The ways of its corners are
//! then tried on that, whether the same was tried before or not. So an answer that is remembered is the one that would be found again,
//! bit for bit, and the path does not depend on what is remembered.
//!
//! That is done of lines in X, Y and Z whose commanded speed is the same everywhere, behind lines and short splines. The corners of others
//! are tried where they are. Likewise a plan for the least time of one corner by itself, whether it is rounded or stopped in.

use std::collections::VecDeque;
use std::mem;

use feedwave_program::{Axis, Position, SourceSpan};

use super::curve::Open;
use super::joint::Joint;
use super::origin::{Deviation, Origin};
use super::stop::Corner;
use super::trim::distance;
use super::vector::linear;
use super::ways::{Trials, Way, planned_s};
use super::{Carried, CornerSpeed, Entry, Joining, Passed, PathSmoother, Smoothed};
use crate::tolerance::{LEAST_ASKED_PIECE_MM, MOST_ANSWERS, MOST_ASKED_ELEMENTS, MOST_ASKED_PIECES, on_grid};
use crate::{Curve, Element, Machine, Spline};

/// Everything that a decision depends on besides the machine.
#[derive(Debug, PartialEq)]
pub(super) struct Question<T> {
    held: PathSmoother<T>,
    open: Option<Open>,
    corners: Vec<usize>,
    count: usize,
    trials: Trials,
    corner_speed: CornerSpeed,
}

/// Ways, and the time that was found with them, s.
type Answer = (Vec<Way>, f64);

/// A corner by itself in a plan for the least time.
#[derive(Debug, PartialEq)]
pub(super) struct CornerQuestion<T> {
    /// The blocks before and behind it.
    blocks: [Entry<T>; 2],
    /// What was pushed along with its curve.
    carried: T,
    /// Tolerance and most that is cut from either block, mm.
    limits_mm: [f64; 2],
}

/// The last questions on one machine, and their answers.
#[derive(Debug)]
pub(super) struct Answers<Q, A> {
    known: VecDeque<(Q, A)>,
    /// The machine that they are of, without its travel.
    machine: Option<Machine>,
}

/// How sharp corners of a path were passed.
pub(super) type WayAnswers<T> = Answers<Question<T>, Answer>;

/// Which corners by themselves were rounded.
pub(super) type CornerAnswers<T> = Answers<CornerQuestion<T>, bool>;

impl<Q, A> Default for Answers<Q, A> {
    fn default() -> Self {
        Self { known: VecDeque::new(), machine: None }
    }
}

/// A copy finds its own.
impl<Q, A> Clone for Answers<Q, A> {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// No state: with others the path is the same.
impl<Q, A> PartialEq for Answers<Q, A> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl<Q: PartialEq, A: Clone> Answers<Q, A> {
    /// The answer to a question on a machine, found where it is not remembered.
    fn to(&mut self, question: Q, machine: &Machine, find: impl FnOnce(&Q, &Machine) -> A) -> A {
        if !self.machine.as_ref().is_some_and(|own| is_same(own, machine)) {
            self.known.clear();
            self.machine = None;
        }
        let machine = self.machine.get_or_insert_with(|| without_travel(machine));
        if let Some((_, answer)) = self.known.iter().rev().find(|(known, _)| *known == question) {
            return answer.clone();
        }
        let answer = find(&question, machine);
        if self.known.len() >= MOST_ANSWERS {
            self.known.pop_front();
        }
        self.known.push_back((question, answer.clone()));
        answer
    }
}

impl<T: Carried> Question<T> {
    fn answer(&self, machine: &Machine) -> Answer {
        let Self { held, open, corners, count, trials, corner_speed } = self;
        held.quickest(open.as_ref(), corners, *count, trials, on_machine(machine, *corner_speed))
    }
}

impl<T: Carried> CornerQuestion<T> {
    /// What is to be decided, wherever it lies; `None` where it depends on that.
    fn of(blocks: [&Entry<T>; 2], carried: &T, limits_mm: [f64; 2]) -> Option<Self> {
        let [before, next] = blocks;
        let place = Place { origin: before.element.end, work_offset: before.element.work_offset };
        let blocks = [place.entry(before)?, place.entry(next)?];
        Some(Self { blocks, carried: carried.clone(), limits_mm: limits_mm.map(on_grid) })
    }

    /// Whether it is to be rounded; also where it cannot be, which is found later.
    fn is_rounded(&self, machine: &Machine) -> bool {
        let [before, next] = &self.blocks;
        let Some((elements, used)) = before.rounded(next, self.limits_mm, on_machine(machine, CornerSpeed::Changing))
        else {
            return true;
        };
        let carried = [&before.carried, &self.carried, &next.carried];
        is_rounded_in_least_time(elements.each_ref(), carried, used.cut_mm, machine)
    }
}

impl<T: Carried> CornerAnswers<T> {
    /// Whether a corner between two blocks is to be rounded in a plan for the least time, within a tolerance and with no more cut than
    /// this, mm: the blocks cut back with its curve, and what was pushed along with that. Corners that are alike get the same answer.
    pub(super) fn is_rounded(
        &mut self,
        blocks: [&Entry<T>; 2],
        limits_mm: [f64; 2],
        (elements, carried): (&[Element; 3], &T),
        (cut_mm, machine): ([f64; 2], &Machine),
    ) -> bool {
        match CornerQuestion::of(blocks, carried, limits_mm) {
            Some(question) => self.to(question, machine, CornerQuestion::is_rounded),
            None => {
                let carried = [&blocks[0].carried, carried, &blocks[1].carried];
                is_rounded_in_least_time(elements.each_ref(), carried, cut_mm, machine)
            }
        }
    }
}

fn is_rounded_in_least_time<T: Carried>(
    elements: [&Element; 3],
    carried: [&T; 3],
    cut_mm: [f64; 2],
    machine: &Machine,
) -> bool {
    let [before, curve, after] = elements;
    let blocks = [(before, before.length + cut_mm[0]), (after, after.length + cut_mm[1])];
    let corner = Corner { curve, blocks, cut_mm, command: carried[1].commanded_mm_per_s(curve, machine) };
    corner.is_rounded_in_least_time(machine, || {
        let pieces = elements.into_iter().zip(carried).map(|(element, carried)| (element, carried, false));
        planned_s(pieces, on_machine(machine, CornerSpeed::Changing), &mut Vec::new())
    })
}

/// How the corners of a trial are passed.
fn on_machine(machine: &Machine, corner_speed: CornerSpeed) -> Joining<'_> {
    Joining { machine, many_blocks: true, corner_speed, corners: None }
}

fn without_travel(machine: &Machine) -> Machine {
    let mut machine = machine.clone();
    for axis in &mut machine.axes {
        (axis.travel_min, axis.travel_max) = (None, None);
    }
    machine
}

/// Whether a machine is this one but for its travel.
fn is_same(own: &Machine, machine: &Machine) -> bool {
    *own == without_travel(machine)
}

impl<T: Carried> WayAnswers<T> {
    /// [`PathSmoother::quickest`] of what `held` holds, where corners that are alike get the same answer.
    pub(super) fn quickest(
        &mut self,
        held: &PathSmoother<T>,
        open: Option<&Open>,
        (corners, count): (&[usize], usize),
        trials: Trials,
        joining: Joining<'_>,
    ) -> Answer {
        match held.question(open, corners, count, trials, joining.corner_speed) {
            Some(question) => self.to(question, joining.machine, Question::answer),
            None => held.quickest(open, corners, count, &trials, joining),
        }
    }
}

impl<T: Carried> PathSmoother<T> {
    /// [`WayAnswers::quickest`] of what it holds itself.
    pub(super) fn answer(
        &mut self,
        open: Option<&Open>,
        corners: &[usize],
        count: usize,
        trials: Trials,
        joining: Joining<'_>,
    ) -> Answer {
        let mut answers = mem::take(&mut self.answers);
        let answer = answers.quickest(self, open, (corners, count), trials, joining);
        self.answers = answers;
        answer
    }

    /// What is to be decided, wherever it lies; `None` where it depends on that.
    fn question(
        &self,
        open: Option<&Open>,
        corners: &[usize],
        count: usize,
        trials: Trials,
        corner_speed: CornerSpeed,
    ) -> Option<Question<T>> {
        let front = &self.pending.front()?.element;
        let place = Place { origin: front.end, work_offset: front.work_offset };
        let trail = self.trail.range(self.trail.len().saturating_sub(trials.trail)..);
        let trail: VecDeque<_> = trail.map(|piece| place.piece(piece)).collect::<Option<_>>()?;
        let elements = self.pending.iter().take(trials.elements).take_while(|entry| entry.is_joinable());
        let pending: VecDeque<_> =
            elements.take(MOST_ASKED_ELEMENTS + 1).map(|entry| place.entry(entry)).collect::<Option<_>>()?;
        if pending.len() > MOST_ASKED_ELEMENTS {
            return None;
        }
        let open = match open {
            Some(open) => Some(open.on(pending.front()?)?),
            None => None,
        };
        // It is asked for by plans of runs only.
        let passed = match corner_speed {
            CornerSpeed::Steady => {
                Passed { distance_mm: on_grid(self.passed.distance_mm), kink: on_grid(self.passed.kink) }
            }
            CornerSpeed::Changing => Passed::default(),
        };
        let held = Self { pending, passed, trail, is_trial: true, ..Self::default() };
        Some(Question { held, open, corners: corners.to_vec(), count, trials, corner_speed })
    }
}

/// Where a question is asked.
struct Place {
    origin: Position,
    work_offset: Position,
}

impl Place {
    fn position(&self, position: &Position) -> Position {
        core::array::from_fn(|axis| on_grid(position[axis] - self.origin[axis]))
    }

    /// An element on the grid, from the origin; `None` of arcs and others that cannot be put there.
    fn element(&self, element: &Element) -> Option<Element> {
        if element.work_offset != self.work_offset {
            return None;
        }
        let (start, end) = (self.position(&element.start), self.position(&element.end));
        let (curve, length) = match &element.curve {
            Curve::Line => (Curve::Line, distance(&start, &end)),
            Curve::Spline(spline) => {
                let spline = spline.on_grid(linear(&self.origin), MOST_ASKED_PIECES, LEAST_ASKED_PIECE_MM)?;
                let length = spline.length_mm();
                (Curve::Spline(Box::new(spline)), length)
            }
            Curve::Arc(_) | Curve::FiveAxis(_) => return None,
        };
        let (work_offset, source, rapid) = (Position::default(), SourceSpan::default(), element.rapid);
        let is_long_enough = length >= LEAST_ASKED_PIECE_MM;
        is_long_enough.then_some(Element { start, end, work_offset, curve, length, source, rapid })
    }

    fn entry<T: Carried>(&self, entry: &Entry<T>) -> Option<Entry<T>> {
        let is_line = matches!(entry.element.curve, Curve::Line) && entry.is_smoothable();
        if !is_line || !entry.carried.is_alike_everywhere() {
            return None;
        }
        let element = self.element(&entry.element)?;
        let is_whole = entry.element.length == entry.full_length_mm;
        Some(Entry {
            full_length_mm: if is_whole { element.length } else { on_grid(entry.full_length_mm) },
            element,
            control: entry.control,
            carried: entry.carried.clone(),
            blocks: 1,
            merged: Deviation { largest_mm: on_grid(entry.merged.largest_mm), at_mm: 0.0 },
            start_is_cut: entry.start_is_cut,
            joins: entry.joins,
            corner_speed: entry.corner_speed,
            joint: entry.joint.on_grid(),
        })
    }

    fn piece<T: Carried>(&self, piece: &Smoothed<T>) -> Option<Smoothed<T>> {
        let is_linear = Axis::ALL.into_iter().all(|axis| Spline::has(axis) || !piece.element.moves(axis));
        if !is_linear || !piece.carried.is_alike_everywhere() {
            return None;
        }
        Some(Smoothed {
            element: self.element(&piece.element)?,
            carried: piece.carried.clone(),
            blocks: 1,
            rest_at_end: piece.rest_at_end,
            origin: Origin::Block,
            deviation: Deviation::default(),
        })
    }
}

impl Joint {
    /// The same with its lengths and angles on the grid.
    fn on_grid(self) -> Self {
        match self {
            Self::Corner { reach_mm, kink, angle_rad, stop_from_mm, way } => {
                let [reach_mm, kink, angle_rad, stop_from_mm] = [reach_mm, kink, angle_rad, stop_from_mm].map(on_grid);
                Self::Corner { reach_mm, kink, angle_rad, stop_from_mm, way }
            }
            Self::Unknown | Self::Fixed => self,
        }
    }
}

#[cfg(test)]
mod tests;
