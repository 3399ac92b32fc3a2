//! The parts of a curve, block by block: the elements that are run.

use feedwave_program::Position;

use super::bezier::Span;
use super::path::Path;
use super::place::{self, Point, tip, turns};
use super::{Ending, Open};
use crate::kinematics::FiveAxisCorners;
use crate::limits::travel_exceeded;
use crate::smoothing::origin::{Deviation, Origin, turn_evenly};
use crate::smoothing::vector::Vector;
use crate::smoothing::{Carried, Joining, PathSmoother, Smoothed};
use crate::{Curve, Element, Spline};

/// What a fit settles.
pub(super) struct Settled<T> {
    pub(super) parts: Vec<Smoothed<T>>,
    /// Elements that are done.
    pub(super) done: usize,
    /// Where the next one goes on, mm from its start.
    pub(super) offset_mm: f64,
}

impl<T: Carried> PathSmoother<T> {
    /// What a part of a curve over an element carries out.
    fn origin_in_curve(&self, index: usize) -> Origin {
        let around = |first: usize| {
            let [first, second, third] = [first, first + 1, first + 2].map(|index| self.pending.get(index));
            Some(turn_evenly([first?, second?, third?]))
        };
        let before = index.checked_sub(2).and_then(around);
        Origin::Blocks { like_chords: around(index).or(before).unwrap_or(false) }
    }

    /// The parts of a curve up to its ending, block by block; `None` where one of them is no curve or leaves the travel.
    pub(super) fn settle(
        &self,
        path: &Path<'_>,
        spans: &[Span],
        open: &Open,
        ending: Ending,
        joining: Joining<'_>,
    ) -> Option<Settled<T>> {
        let mut parts = Vec::new();
        let front = &self.pending.front()?.element;
        let mut at = open.start.point;
        // On the programmed path it is where that is, to the bit.
        let is_on_path = open.is_at_its_start();
        let mut start = if is_on_path { front.start } else { position(front, &front.start, at, joining.corners)? };
        let mut beziers: Vec<[Point; 4]> = Vec::new();
        let mut span = 0;
        for (index, entry) in self.pending.iter().enumerate() {
            let [from, leg_end] = path.range(index);
            let programmed = &entry.element;
            // Where the curve ends within this element, from its start; beyond its length where it goes on.
            let (to, offset_mm, is_last) = match ending {
                Ending::Within(upto) => (leg_end.min(upto), upto - from, upto <= leg_end),
                Ending::OnPath { leg, offset_mm } if leg == index => ((from + offset_mm).min(leg_end), offset_mm, true),
                Ending::OnPath { .. } => (leg_end, f64::INFINITY, false),
            };
            let is_done = match ending {
                Ending::Within(upto) => upto >= leg_end,
                Ending::OnPath { .. } => offset_mm >= programmed.length,
            };
            beziers.clear();
            while span < spans.len() && spans[span].to <= from {
                span += 1;
            }
            for own in spans[span..].iter().take_while(|own| own.from < to) {
                beziers.push(own.part(own.from.max(from), own.to.min(to)).points);
            }
            let is_on_path = is_last && matches!(ending, Ending::OnPath { .. });
            let to_end = if is_done { programmed.length } else { offset_mm };
            let (reached, end) = if is_on_path {
                (place::point(programmed, to_end), programmed.position(to_end))
            } else {
                let reached = beziers.last()?[3];
                (reached, position(programmed, &programmed.end, reached, joining.corners)?)
            };
            let count = beziers.len();
            beziers.first_mut()?[0] = at;
            beziers[count - 1][3] = reached;
            let element = element(programmed, [start, end], &beziers, joining.corners)?;
            if travel_exceeded(&element, joining.machine).is_some() {
                return None;
            }
            let rest_at_end = is_done && entry.rests_at_end();
            let blocks = if is_done { entry.blocks } else { 0 };
            // Nobody asks a trial where its parts are.
            let (deviation, origin) = if self.is_trial {
                (Deviation::default(), Origin::default())
            } else {
                let (largest_mm, share) = path.deviation(spans, index, [from, to]);
                let largest_mm = largest_mm + entry.merged.largest_mm;
                (Deviation { largest_mm, at_mm: share * element.length }, self.origin_in_curve(index))
            };
            let carried = entry.carried.clone();
            parts.push(Smoothed { element, carried, blocks, rest_at_end, origin, deviation });
            (at, start) = (reached, end);
            if is_last {
                let (done, offset_mm) = if is_done { (index + 1, 0.0) } else { (index, offset_mm) };
                return Some(Settled { parts, done, offset_mm });
            }
        }
        None
    }
}

/// Where the axes are at a place of a curve over an element; those that take no part as they are `beside`.
fn position(
    programmed: &Element,
    beside: &Position,
    at: Point,
    corners: Option<FiveAxisCorners<'_>>,
) -> Option<Position> {
    if let Curve::FiveAxis(five_axis) = &programmed.curve {
        return corners?.position(five_axis.setup(), tip(at), turns(at), beside);
    }
    let mut position = *beside;
    position[..3].copy_from_slice(&tip(at));
    Some(position)
}

/// The part of a curve that is run for an element, from one position to another, by its Bézier spans.
fn element(
    programmed: &Element,
    ends: [Position; 2],
    spans: &[[Point; 4]],
    corners: Option<FiveAxisCorners<'_>>,
) -> Option<Element> {
    let tips: Vec<[Vector; 4]> = spans.iter().map(|points| points.map(tip)).collect();
    if matches!(programmed.curve, Curve::FiveAxis(_)) {
        let turns: Vec<[Vector; 4]> = spans.iter().map(|points| points.map(turns).map(|[a, b]| [a, b, 0.0])).collect();
        return corners?.element(programmed, ends, &tips, &turns);
    }
    let [start, end] = ends;
    let spline = Spline::from_cubic_spans(&tips)?;
    Element::from_spline(start, end, spline, programmed.work_offset, programmed.source, false)
}
