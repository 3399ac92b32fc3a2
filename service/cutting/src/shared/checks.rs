//! Checks of every move, whatever carries it out: axes, travel and time.

use feedwave_motion::kinematics::{ChainAxis, KinematicsDescription, Wrap};
use feedwave_motion::{Curve, Element, Machine, MachineKind, TravelExceeded, travel_exceeded, travel_exceeded_within};
use feedwave_program::{Axis, Finding, FindingLog, Move, MoveKind, Position, SourceSpan};

use super::code;
use super::reach::Reach;

/// Longest time a single block may take, s: one day. A slower one is a slip of a decimal point.
pub(crate) const MAX_BLOCK_DURATION_S: f64 = 86_400.0;

/// Whether the length of an element is in degrees: only rotary axes move.
pub(crate) fn is_rotary_only(element: &Element) -> bool {
    !matches!(element.curve, Curve::FiveAxis(_))
        && Axis::ALL.into_iter().all(|axis| axis.is_rotary() || !element.moves(axis))
}

/// Whether a move cuts along X or Z, where A and C may be words of the drawing.
pub(crate) fn may_be_drawn(mv: &Move, element: &Element) -> bool {
    mv.kind == MoveKind::Cutting && (element.moves(Axis::X) || element.moves(Axis::Z))
}

/// A word of an axis that the machine does not have; one finding for all of its words. `is_drawn`: A and C may be words of the drawing.
pub(crate) fn missing(axis: Axis, span: SourceSpan, machine: &Machine, is_drawn: bool) -> Finding {
    let letter = axis.letter();
    let finding = Finding::new(code::AXIS_MISSING, span, format!("the machine has no {letter} axis"))
        .suggest("remove the word, or add the axis to the machine profile")
        .everywhere(letter.to_string());
    if is_drawn && machine.kind == MachineKind::Lathe && matches!(axis, Axis::A | Axis::C) {
        let cure = "where A is the angle of a line and C a chamfer, set language.plain_drawing_words of the machine profile to true";
        return finding.suggest(cure);
    }
    finding
}

/// How far the axes go: the travel of each, and its range in the chain of a machine with kinematics.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Travel<'a> {
    pub(crate) machine: &'a Machine,
    pub(crate) kinematics: Option<&'a KinematicsDescription>,
}

/// How far beyond a range still counts as at its end, mm or degrees: what rounding adds to a value at the end.
const RANGE_SLACK: f64 = 1e-7;

impl Travel<'_> {
    /// Reports the first axis that an element would take too far.
    pub(crate) fn check(&self, element: &Element, findings: &mut FindingLog) {
        if let Some(exceeded) = self.exceeded(element) {
            findings.push(self.finding(&exceeded, element));
        }
    }

    /// As [`Self::check`], where an oscillation is superposed on an element that by itself stays within travel.
    pub(crate) fn check_oscillating(&self, element: &Element, reach: &Reach, findings: &mut FindingLog) {
        let is_limited = self.machine.has_travel() || self.chain().iter().any(|link| link.range.is_some());
        if !is_limited || self.exceeded(element).is_some() {
            return;
        }
        let exceeded = |extent| {
            travel_exceeded_within(extent, element, self.machine).or_else(|| self.range_exceeded(extent, element))
        };
        if exceeded(reach.at_most(element)).is_none() {
            return;
        }
        if let Some(exceeded) = exceeded(reach.extent(element)) {
            let finding = self.finding(&exceeded, element);
            findings.push(finding.suggest("the oscillation is superposed there: a smaller amplitude reaches less far"));
        }
    }

    /// The first axis that the path of an element takes too far.
    fn exceeded(&self, element: &Element) -> Option<TravelExceeded> {
        // Where a straight move begins was the end of the one before.
        let reached = || match element.curve {
            Curve::Line => (element.end, element.end),
            _ => element.extent(),
        };
        travel_exceeded(element, self.machine).or_else(|| self.range_exceeded(reached(), element))
    }

    fn chain(&self) -> &[ChainAxis] {
        self.kinematics.map_or(&[], |kinematics| &kinematics.chain)
    }

    fn finding(&self, exceeded: &TravelExceeded, element: &Element) -> Finding {
        let letter = exceeded.axis.letter();
        let unit = if exceeded.axis.is_rotary() { "deg" } else { "mm" };
        let message = format!(
            "{letter} would reach {:.3} {unit}, beyond its travel limit {:.3} {unit} (machine coordinates)",
            exceeded.value, exceeded.limit
        );
        let end = if exceeded.value < exceeded.limit { "low" } else { "high" };
        Finding::new(code::AXIS_TRAVEL, element.source, message)
            .ranked(format!("{letter} {end}"), (exceeded.value - exceeded.limit).abs())
            .with_value("position", exceeded.value, unit)
            .with_value("limit", exceeded.limit, unit)
            .suggest("check the work offset and the programmed coordinate")
    }

    /// The first axis that would leave its range in the chain, from the smallest and largest position of each, work coordinates.
    /// An axis that rolls over has none that a word could exceed, and those of a guided tool were judged where its path was made.
    fn range_exceeded(&self, (low, high): (Position, Position), element: &Element) -> Option<TravelExceeded> {
        let is_guided = matches!(element.curve, Curve::FiveAxis(_));
        let exceeded = |link: &ChainAxis| {
            let [least, most] = link.range?;
            let (axis, index) = (link.axis, link.axis.index());
            let is_judged = axis.is_rotary() && (is_guided || link.wrap == Wrap::Rollover);
            if is_judged || !(element.moves(axis) || low[index] < high[index]) {
                return None;
            }
            let [low, high] = [&low, &high].map(|end| end[index] + element.work_offset[index]);
            let below = (low < least - RANGE_SLACK).then_some((low, least));
            let above = (high > most + RANGE_SLACK).then_some((high, most));
            below.or(above).map(|(value, limit)| TravelExceeded { axis, value, limit })
        };
        self.chain().iter().find_map(exceeded)
    }
}

pub(crate) fn spline_cusp(span: SourceSpan) -> Finding {
    let message = "the spline has a place without a direction, a cusp or a handle of length 0, or turns back";
    Finding::new(code::PATH_SPLINE_CUSP, span, message)
        .suggest("move its control points apart, or divide it at the cusp")
}

pub(crate) fn too_long(span: SourceSpan, duration_s: f64) -> Finding {
    let message = format!("the block would take {duration_s:.0} s, longer than {MAX_BLOCK_DURATION_S:.0} s");
    Finding::new(code::PLAN_TOO_LONG, span, message)
        .ranked("", duration_s)
        .with_value("duration", duration_s, "s")
        .with_value("limit", MAX_BLOCK_DURATION_S, "s")
        .suggest("check the decimal point of the feed or dwell")
}
