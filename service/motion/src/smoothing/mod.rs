//! Path smoothing (`G64 P Q`): short lines that lie in one line are merged, and corners are rounded by
//! curvature-continuous curves, both within the programmed tolerance.
//!
//! Elements go in as programmed and come out as they are run; the programmed path and the one that is run are nowhere
//! farther apart than the tolerance `P` of the block before the corner. Merging uses no more than `Q` and no more
//! than a twentieth of `P`; what it used is not used again at the corners beside it.
//!
//! A corner is rounded where two cutting elements of one work offset meet, moving X, Y and Z only, or both under tool centre
//! point control, and the block before it asks for continuous path control. It stays where the direction turns by more than 170°, where the
//! elements are too short, and at the ends of everything else. Beside a turn of the tool with its centre point at rest, the turn and the
//! line overlap by the tolerance of the direction, while the tool centre point stays on its line.
//!
//! With [`Joining::many_blocks`], elements that are tangent but bend differently meet in a ramp of curvature, and where corners
//! lie so close together that each leaves no room for the next, the blocks become one curve ([`curve`]), under tool centre point control
//! also one of the rotary axes.
//!
//! A corner stays as well where stopping in it takes less time ([`ways`], [`stop`]), in plans of runs also between short blocks; the curve
//! over many blocks ends there.
//!
//! Smoothing looks ahead over one run of mergeable lines, one window of the curve and some elements behind a sharp corner, and keeps
//! nothing else but the last pieces that it gave on.

mod answers;
mod corner;
mod curve;
mod guided;
mod joint;
mod merge;
mod origin;
mod stop;
#[cfg(test)]
mod test_path;
mod trim;
mod turn;
mod vector;
mod ways;

use std::collections::VecDeque;

use feedwave_program::{Axis, PathControl};
use serde::{Deserialize, Serialize};

use self::answers::{Answers, CornerAnswers, WayAnswers};
pub use self::corner::CornerSpeed;
use self::corner::Used;
use self::curve::Open;
use self::joint::Joint;
pub use self::origin::{Deviation, Origin};
use self::stop::Corner;
use self::vector::Vector;
use self::ways::Way;
use crate::kinematics::FiveAxisCorners;
use crate::tolerance::{
    CORNER_SHARE, LEAST_CURVE_SHARE, LEAST_STOP_KINK, MAX_MERGED_POINTS, MERGING_SHARE, MOST_TRAIL_BYTES,
    TANGENT_TOLERANCE_RAD, TRAIL,
};
use crate::{Curve, Element, Machine, Spline};

/// What belongs to an element besides its path, such as its feed. Lines are merged where it is equal.
pub trait Carried: Clone + PartialEq {
    /// What belongs to the curve between this block and the next; `None` where the corner has to stay.
    fn at_corner(&self, next: &Self) -> Option<Self>;

    /// Commanded speed along an element, mm/s; infinite where the machine decides. A corner is left as it is where stopping in it takes
    /// less time at this speed.
    fn commanded_mm_per_s(&self, _element: &Element, _machine: &Machine) -> f64 {
        f64::INFINITY
    }

    /// Whether that speed is the same wherever an element of this shape lies: corners that are alike are then decided once.
    fn is_alike_everywhere(&self) -> bool {
        false
    }
}

/// An element as it is run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Smoothed<T> {
    /// The element. A merged line names the last of its blocks as its source, the curve at a corner the block after
    /// the corner.
    pub element: Element,
    /// What was pushed along with it.
    pub carried: T,
    /// Blocks that it carries out: 1 for most, more for a merged line, 0 for the curve at a corner.
    pub blocks: u32,
    /// Whether the path rests at its end, whatever follows (exact stop).
    pub rest_at_end: bool,
    /// What it carries out.
    pub origin: Origin,
    /// How far it is from the programmed path.
    pub deviation: Deviation,
}

/// Smooths a path in one pass. Its state can be stored between any two calls and continues bit for bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathSmoother<T> {
    /// The line that the next ones may be merged into.
    run: Option<Entry<T>>,
    /// Ends of the blocks within the run, mm, work coordinates.
    between: Vec<Vector>,
    /// Elements whose ends may be cut back for the corners to the next, in order.
    pending: VecDeque<Entry<T>>,
    /// The curve over many of them that has been begun.
    open: Option<Open>,
    /// The last sharp corner that was given on.
    passed: Passed,
    /// What was given on last, with which trials of ways to pass corners start.
    trail: VecDeque<Smoothed<T>>,
    /// Whether it is a trial itself.
    #[serde(skip)]
    is_trial: bool,
    /// How corners were decided that may come again. No state: what it says would be found again.
    #[serde(skip, default = "Answers::default")]
    answers: WayAnswers<T>,
    /// The same of corners by themselves.
    #[serde(skip, default = "Answers::default")]
    corners: CornerAnswers<T>,
}

/// A sharp corner before what is held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Passed {
    /// How far it lies before the first element that is held, mm.
    distance_mm: f64,
    /// Difference of the directions there; 0 where the path starts or is exact before.
    kink: f64,
}

/// How the corners of a path are passed.
#[derive(Clone, Copy, Debug)]
pub struct Joining<'a> {
    /// Whose travel a curve over many blocks does not leave.
    pub machine: &'a Machine,
    /// Whether short blocks become one curve and tangent elements meet in ramps of curvature; otherwise each corner is
    /// rounded by itself, as far as its elements leave room.
    pub many_blocks: bool,
    /// At the corners of blocks that may become one curve.
    pub corner_speed: CornerSpeed,
    /// How corners under tool centre point control are passed; without it they stay.
    pub corners: Option<FiveAxisCorners<'a>>,
}

/// An element in the smoother.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Entry<T> {
    element: Element,
    /// At its end.
    control: PathControl,
    carried: T,
    blocks: u32,
    /// Deviation used by merging, and where along the element it is.
    merged: Deviation,
    /// Length before its start was cut back, mm.
    full_length_mm: f64,
    /// Whether its start was cut back.
    start_is_cut: bool,
    /// Whether it may become part of a curve over many blocks.
    joins: bool,
    corner_speed: CornerSpeed,
    /// Where it meets the next one.
    joint: Joint,
}

impl<T> Default for PathSmoother<T> {
    fn default() -> Self {
        Self {
            run: None,
            between: Vec::new(),
            pending: VecDeque::new(),
            open: None,
            passed: Passed::default(),
            trail: VecDeque::new(),
            is_trial: false,
            answers: Answers::default(),
            corners: Answers::default(),
        }
    }
}

impl<T: Carried> PathSmoother<T> {
    /// Adds the next element and gives on what is settled by it.
    pub fn push(
        &mut self,
        element: Element,
        control: PathControl,
        carried: T,
        joining: Joining<'_>,
        emit: &mut impl FnMut(Smoothed<T>),
    ) {
        let full_length_mm = element.length;
        let (start_is_cut, joins, joint) = (false, joining.many_blocks, Joint::Unknown);
        let next = Entry {
            element,
            control,
            carried,
            blocks: 1,
            merged: Deviation::default(),
            full_length_mm,
            start_is_cut,
            joins,
            corner_speed: joining.corner_speed,
            joint,
        };
        if self.merge(&next) {
            return;
        }
        self.end_run(joining, emit);
        if next.merge_tolerance_mm().is_some() {
            self.run = Some(next);
        } else {
            self.join(next, joining, emit);
        }
    }

    /// Gives on everything that is held: the last end point stays exact.
    pub fn flush(&mut self, joining: Joining<'_>, emit: &mut impl FnMut(Smoothed<T>)) {
        self.end_run(joining, emit);
        self.advance(true, joining, emit);
        self.passed = Passed::default();
        self.trail.clear();
    }

    /// Merges a line into the present run; `false` where it does not belong to it.
    fn merge(&mut self, next: &Entry<T>) -> bool {
        let Some(run) = &mut self.run else { return false };
        let Some(tolerance_mm) = run.merge_tolerance_mm() else { return false };
        let alike = next.merge_tolerance_mm() == Some(tolerance_mm)
            && next.control == run.control
            && next.joins == run.joins
            && next.carried == run.carried
            && next.element.work_offset == run.element.work_offset
            && next.element.start == run.element.end;
        if !alike || self.between.len() >= MAX_MERGED_POINTS {
            return false;
        }
        self.between.push(vector::linear(&run.element.end));
        let merged = merge::deviation(&run.element.start, &self.between, &next.element.end, tolerance_mm);
        let Some(merged) = merged else {
            self.between.pop();
            return false;
        };
        run.element.end = next.element.end;
        run.element.length = trim::distance(&run.element.start, &run.element.end);
        run.element.source = next.element.source;
        run.full_length_mm = run.element.length;
        run.merged = merged;
        run.blocks = run.blocks.saturating_add(next.blocks);
        true
    }

    fn end_run(&mut self, joining: Joining<'_>, emit: &mut impl FnMut(Smoothed<T>)) {
        self.between.clear();
        if let Some(run) = self.run.take() {
            self.join(run, joining, emit);
        }
    }

    /// Takes the next element and gives on what is settled by it.
    fn join(&mut self, next: Entry<T>, joining: Joining<'_>, emit: &mut impl FnMut(Smoothed<T>)) {
        if let Some(before) = self.pending.back_mut() {
            before.joint = before.joint_to(&next, joining);
        }
        self.pending.push_back(next);
        self.advance(false, joining, emit);
    }

    /// Gives on what is settled.
    fn advance(&mut self, is_last: bool, joining: Joining<'_>, emit: &mut impl FnMut(Smoothed<T>)) {
        loop {
            if self.open.is_some() {
                if !self.advance_curve(is_last, joining, emit) {
                    return;
                }
                continue;
            }
            let Some(front) = self.pending.front() else { return };
            if self.pending.len() == 1 {
                if is_last || front.corner_tolerance_mm().is_none() {
                    self.passed = Passed::default();
                    self.trail.clear();
                    emit(self.pending.remove(0).expect("one is held").finish());
                }
                return;
            }
            match self.turns_back(is_last, joining) {
                None => return,
                Some(true) => {
                    self.round_turn(joining, emit);
                    continue;
                }
                Some(false) => {}
            }
            let Some(front) = self.pending.front() else { return };
            let is_corner = matches!(front.joint, Joint::Corner { .. });
            let goes_on = match self.stops_behind(0, is_last) {
                None => None,
                Some(stops) if stops || !is_corner => Some(false),
                Some(_) => self.goes_on_over(1, is_last),
            };
            match goes_on {
                None => return,
                Some(true) => self.open_curve(emit),
                Some(false) if self.waits_for_ways(is_last, joining) => return,
                Some(false) => self.round_front(joining, emit),
            }
        }
    }

    /// Remembers the last sharp corner of the first elements, which are given on.
    fn pass(&mut self, count: usize) {
        for entry in self.pending.iter().take(count) {
            self.passed.distance_mm += entry.element.length;
            let kink = entry.joint.turn();
            if kink >= LEAST_STOP_KINK {
                self.passed = Passed { distance_mm: 0.0, kink };
            }
        }
    }

    /// Gives on the first element and the curve at its corner to the next, if it has one.
    fn round_front(&mut self, joining: Joining<'_>, emit: &mut impl FnMut(Smoothed<T>)) {
        let stops = self.stops_behind(0, true) == Some(true);
        self.pass(1);
        let Some(mut front) = self.pending.pop_front() else { return };
        if stops {
            front.joint.stop();
        }
        let next = self.pending.front_mut().filter(|_| !stops);
        let corner = next.and_then(|next| front.round_corner(next, joining, &mut self.corners));
        self.give(front.finish(), emit);
        if let Some(corner) = corner {
            self.give(corner, emit);
        }
    }

    /// Gives on a piece of the path that is run.
    fn give(&mut self, piece: Smoothed<T>, emit: &mut impl FnMut(Smoothed<T>)) {
        if self.trail.len() >= TRAIL {
            self.trail.pop_front();
        }
        if piece.element.curve_bytes() <= MOST_TRAIL_BYTES {
            self.trail.push_back(piece.clone());
        } else {
            self.trail.clear();
        }
        emit(piece);
    }
}

impl<T: Carried> Entry<T> {
    /// Whether smoothing can change its path at all.
    fn is_smoothable(&self) -> bool {
        let mut other_axes = Axis::ALL.into_iter().filter(|axis| !matches!(axis, Axis::X | Axis::Y | Axis::Z));
        !self.element.rapid
            && match &self.element.curve {
                Curve::FiveAxis(five_axis) => five_axis.tip().is_line() || five_axis.tip().rests(),
                _ => other_axes.all(|axis| !self.element.moves(axis)),
            }
    }

    /// Whether the tool turns with its centre point at rest.
    fn is_turn(&self) -> bool {
        matches!(&self.element.curve, Curve::FiveAxis(five_axis) if five_axis.tip().rests())
    }

    /// Whether the tool centre point is guided.
    fn is_guided(&self) -> bool {
        matches!(self.element.curve, Curve::FiveAxis(_))
    }

    /// Largest distance of points left out of a line, mm; `None` where it is not to be merged with the next.
    fn merge_tolerance_mm(&self) -> Option<f64> {
        match self.control {
            PathControl::Continuous { tolerance_mm, merge_tolerance_mm }
                if merge_tolerance_mm > 0.0 && matches!(self.element.curve, Curve::Line) && self.is_smoothable() =>
            {
                Some(merge_tolerance_mm.min(MERGING_SHARE * tolerance_mm))
            }
            _ => None,
        }
    }

    /// Largest distance from the programmed path at its end, mm; `None` where the end stays as it is.
    fn corner_tolerance_mm(&self) -> Option<f64> {
        match self.control {
            PathControl::Continuous { tolerance_mm, .. } if tolerance_mm > 0.0 && self.is_smoothable() => {
                Some(tolerance_mm)
            }
            _ => None,
        }
    }

    /// What the corner to the next element asks for.
    fn joint_to(&self, next: &Self, joining: Joining<'_>) -> Joint {
        let Some(tolerance_mm) = self.corner_tolerance_mm() else { return Joint::Fixed };
        let may_be_passed = next.is_smoothable() && self.element.work_offset == next.element.work_offset;
        let carried = self.carried.at_corner(&next.carried).filter(|_| may_be_passed);
        let Some(carried) = carried else { return Joint::Fixed };
        let left_mm = tolerance_mm - self.merged_with(next);
        // Another control may have merged more behind it.
        let is_enough = left_mm >= LEAST_CURVE_SHARE * tolerance_mm;
        if !is_enough {
            return Joint::Fixed;
        }
        let elements = [&self.element, &next.element];
        if self.is_guided() || next.is_guided() {
            return guided::joint(elements, left_mm, self.corner_speed, joining);
        }
        let mut joint = Joint::between(&self.element, &next.element, left_mm, self.corner_speed);
        if let Joint::Corner { stop_from_mm, reach_mm, .. } = &mut joint
            && self.joins
            && next.joins
            && self.corner_speed == CornerSpeed::Steady
        {
            let machine = joining.machine;
            let command = carried.commanded_mm_per_s(&self.element, machine);
            let from_mm = stop::better_from_mm(elements, left_mm, command, machine);
            // Within its reach, they are smoothed out together.
            *stop_from_mm = from_mm.max(*reach_mm);
        }
        joint
    }

    /// Cuts this element and the next one back for the curve between them.
    fn round_corner(
        &mut self,
        next: &mut Self,
        joining: Joining<'_>,
        corners: &mut CornerAnswers<T>,
    ) -> Option<Smoothed<T>> {
        let merged_mm = self.merged_with(next);
        let tolerance_mm = self.corner_tolerance_mm()? - merged_mm;
        if !next.is_smoothable() || self.element.work_offset != next.element.work_offset {
            return None;
        }
        // Of a long element before a curve, most may have been given on.
        let most_cut_mm = (CORNER_SHARE * self.full_length_mm.min(next.full_length_mm)).min(self.element.length);
        let carried = self.carried.at_corner(&next.carried)?;
        let limits_mm = [tolerance_mm, most_cut_mm];
        let (elements, used) = self.rounded(next, limits_mm, joining)?;
        // Where the path does not rest without the curve, the curve never costs time.
        let would_rest = self.is_turn()
            || next.is_turn()
            || matches!(self.joint, Joint::Corner { kink, .. } if kink > TANGENT_TOLERANCE_RAD);
        let is_open = would_rest && self.joint.way() != Way::Rounded;
        if self.joins && next.joins && is_open {
            let is_rounded = match self.corner_speed {
                CornerSpeed::Steady => {
                    let [before, curve, after] = &elements;
                    let blocks = [(before, self.full_length_mm), (after, next.full_length_mm)];
                    let command = carried.commanded_mm_per_s(curve, joining.machine);
                    Corner { curve, blocks, cut_mm: used.cut_mm, command }.is_rounded(joining.machine)
                }
                CornerSpeed::Changing => {
                    let (curve, cut) = ((&elements, &carried), (used.cut_mm, joining.machine));
                    corners.is_rounded([self, next], limits_mm, curve, cut)
                }
            };
            if !is_rounded {
                self.joint.stop();
                return None;
            }
        }
        let [before, element, after] = elements;
        self.element = before;
        next.merged = next.merged.behind(used.cut_mm[1], after.length);
        next.element = after;
        next.start_is_cut = true;
        // Beside a turn no larger tolerance of the path makes it longer.
        let fills_blocks = used.cut_mm[0] >= ALMOST * most_cut_mm || self.is_turn() || next.is_turn();
        Some(Smoothed::corner(element, carried, merged_mm + used.deviation_mm, fills_blocks))
    }

    /// This element and the next one cut back, with the curve between them, within a tolerance and with no more cut than this, mm.
    fn rounded(
        &self,
        next: &Self,
        [tolerance_mm, most_cut_mm]: [f64; 2],
        joining: Joining<'_>,
    ) -> Option<([Element; 3], Used)> {
        let [before, after] = [&self.element, &next.element];
        if self.is_guided() || next.is_guided() {
            let corners = joining.corners?;
            if self.is_turn() || next.is_turn() {
                let entries = [self, next];
                let most_cut = entries.map(|it| (CORNER_SHARE * it.full_length_mm).min(it.element.length));
                let commands = entries.map(|it| it.carried.commanded_mm_per_s(&it.element, joining.machine));
                return guided::ease(&corners, [before, after], [most_cut, commands], joining.machine);
            }
            let shape = guided::shape([before, after], self.joint.kink()?, self.corner_speed);
            return guided::round(&corners, [before, after], [tolerance_mm, most_cut_mm], shape);
        }
        let rounding = if self.joins && next.joins {
            corner::rounding_or_ramp(before, after, tolerance_mm, most_cut_mm, self.corner_speed)
        } else {
            corner::rounding(before, after, tolerance_mm, most_cut_mm)
        }?;
        let before = before.part(0.0, before.length - rounding.cut_mm)?;
        let after = after.part(rounding.cut_mm, after.length)?;
        let spline = Spline::from_polynomial_spans(&[rounding.curve(&before, &after)])?;
        let source = after.source;
        let element = Element::from_spline(before.end, after.start, spline, after.work_offset, source, false)?;
        Some(([before, element, after], rounding.used()))
    }

    /// The larger deviation that merging has used, of two elements, mm.
    fn merged_with(&self, next: &Self) -> f64 {
        self.merged.largest_mm.max(next.merged.largest_mm)
    }

    fn rests_at_end(&self) -> bool {
        self.control == PathControl::ExactStop
    }

    fn finish(self) -> Smoothed<T> {
        let (rest_at_end, deviation) = (self.rests_at_end(), self.merged.behind(0.0, self.element.length));
        let origin = if self.joint.way() == Way::Stop { Origin::BlockToStop } else { Origin::Block };
        let Self { element, carried, blocks, .. } = self;
        Smoothed { element, carried, blocks, rest_at_end, origin, deviation }
    }
}

impl<T> Smoothed<T> {
    /// The curve at a corner, which is farthest from it in its middle.
    fn corner(element: Element, carried: T, largest_mm: f64, fills_blocks: bool) -> Self {
        let deviation = Deviation { largest_mm, at_mm: 0.5 * element.length };
        let origin = Origin::Corner { fills_blocks };
        Self { element, carried, blocks: 0, rest_at_end: false, origin, deviation }
    }
}

/// A corner that takes this part of what it may is as long as it can be.
const ALMOST: f64 = 0.999;

#[cfg(test)]
mod tests;
