//! Cycles of FANUC and Haas lathes that start where their contour is beyond the start, so that a control stops, or where a rapid
//! move of theirs would pass through the finished part. Points are Z and X, or along and across in a frame, mm.

use super::contour::{Part, TURNS_BACK_MM, turns_back};
use super::frame::Frame;
use super::passes::{Contour, Step};
use crate::compensation::geometry::{Curve, Point};
use crate::{Finding, FindingCode, SourceSpan};

/// A rapid move this far in the part is in it, mm: twice of what contours may turn back.
const LEAST_DEPTH_MM: f64 = 2.0 * TURNS_BACK_MM;

/// Stretches that are shorter than this along the passes are walls, mm.
const WALL_MM: f64 = 1e-6;

/// Places at which a move is held against an arc.
const PLACES: u32 = 16;

/// Rounding that is no part of a coordinate, in its last decimal place.
const NOISE: f64 = 1e-4;

/// Where the contour is beyond the start of its cycle.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Beyond {
    start: Point,
    /// The point of the contour that is furthest out, and its block.
    extreme: Point,
    span: SourceSpan,
    /// A start that serves, and one for stock on the other side where the contour may be meant for that.
    serves: Point,
    other_side: Option<Point>,
    /// Which way is away from the contour along Z and X: 1 or −1.
    away: Point,
    /// A rapid move passes through the part by this, mm; otherwise a roughing cycle begins too low.
    depth_mm: Option<f64>,
}

/// How far a contour goes, in a frame.
struct Extent<'a> {
    /// Furthest out across, and furthest back along, with their blocks.
    top: (Point, SourceSpan),
    back: (Point, SourceSpan),
    /// Furthest in across.
    bottom: f64,
    start: Point,
    frame: &'a Frame,
}

impl<'a> Extent<'a> {
    /// Of the parts of a contour behind its first block; both in the frame.
    fn of(contour: Contour<'_>, frame: &'a Frame, parts: &[Part]) -> Self {
        let (approach, pieces) = (&contour.pieces[0], &contour.pieces[1..]);
        let first = parts.first().map_or(frame.to(approach.curve.to), |part| part.curve.from);
        let (mut top, mut back, mut bottom) = ((first, approach.span), (first, approach.span), first[1]);
        for part in parts {
            let to = part.curve.to;
            let span = pieces[part.block].span;
            if to[1] > top.0[1] + WALL_MM {
                top = (to, span);
            }
            if to[0] < back.0[0] - WALL_MM {
                back = (to, span);
            }
            bottom = bottom.min(to[1]);
        }
        Self { top, back, bottom, start: frame.to(contour.start), frame }
    }

    fn beyond(&self, depth_mm: Option<f64>, may_be_other_side: bool) -> Beyond {
        let Self { top, back, bottom, start, frame } = *self;
        let is_over = top.0[1] > start[1] + TURNS_BACK_MM;
        let (extreme, span) = if is_over { top } else { back };
        let along = start[0].min(back.0[0]);
        let serves = [along, start[1].max(top.0[1])];
        let is_other = may_be_other_side && is_over && bottom < start[1];
        let other_side = is_other.then(|| frame.back([along, bottom]));
        let away = frame.back([-1.0, 1.0]);
        Beyond {
            start: frame.back(start),
            extreme: frame.back(extreme),
            span,
            serves: frame.back(serves),
            other_side,
            away,
            depth_mm,
        }
    }
}

/// Where a contour that is roughed level by level is beyond the start, across the passes or along them; `has_both` where its
/// first block names both axes.
pub(super) fn of_roughing(contour: Contour<'_>, frame: &Frame, parts: &[Part], has_both: bool) -> Option<Beyond> {
    let extent = Extent::of(contour, frame, parts);
    let is_over = extent.top.0[1] > extent.start[1] + TURNS_BACK_MM;
    let is_behind = extent.back.0[0] < extent.start[0] - TURNS_BACK_MM;
    let first = frame.to(contour.pieces[0].curve.to);
    // A contour that goes both ways from its first point may be meant for stock on either side.
    (is_over || is_behind).then(|| extent.beyond(None, has_both && extent.bottom < first[1] - TURNS_BACK_MM))
}

/// Whether a contour that begins where the cycle does goes back beyond that at once, and keeps one direction from there on.
pub(super) fn begins_behind(parts: &[Part]) -> bool {
    let mut back = 0;
    while parts.get(back).is_some_and(|part| part.curve.to[0] < part.curve.from[0] - TURNS_BACK_MM) {
        back += 1;
    }
    back > 0 && turns_back(&parts[back..], 0).is_none()
}

/// Where a rapid move passes through the finished contour; its parts are in the frame.
pub(super) fn of_rapids<'a>(
    contour: Contour<'_>,
    frame: &Frame,
    parts: &[Part],
    rapids: impl Iterator<Item = &'a Step>,
) -> Option<Beyond> {
    let extent = Extent::of(contour, frame, parts);
    let depth = |step: &Step| {
        let step = frame.curve(&step.curve);
        // Nothing is passed by a move that is above everything.
        let is_above = step.from[1].min(step.to[1]) >= extent.top.0[1];
        let of_part = |part: &Part| depth_in_part([step.from, step.to], part);
        if is_above { 0.0 } else { parts.iter().map(of_part).fold(0.0, f64::max) }
    };
    let deepest = rapids.map(depth).fold(0.0, f64::max);
    (deepest > LEAST_DEPTH_MM).then(|| extent.beyond(Some(deepest), false))
}

/// How far a straight move goes below a part of a contour, mm; 0 where it does not. Their ends may touch.
fn depth_in_part([from, to]: [Point; 2], part: &Part) -> f64 {
    let Curve { from: first, to: last, .. } = part.curve;
    let low = from[0].min(to[0]).max(first[0].min(last[0]) + WALL_MM);
    let high = from[0].max(to[0]).min(first[0].max(last[0]) - WALL_MM);
    if low > high || (last[0] - first[0]).abs() < WALL_MM {
        return 0.0;
    }
    let height = |along: f64| {
        let share = (along - from[0]) / (to[0] - from[0]);
        if (to[0] - from[0]).abs() < WALL_MM { from[1].min(to[1]) } else { from[1] + share * (to[1] - from[1]) }
    };
    let places = if part.curve.circle.is_none() { 1 } else { PLACES };
    let at = |place: u32| low + (high - low) * f64::from(place) / f64::from(places);
    (0..=places).map(|place| part.height(at(place)) - height(at(place))).fold(0.0, f64::max)
}

/// How a place is written in a program.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Writing {
    pub(in super::super) is_inch: bool,
    pub(in super::super) is_diameter: bool,
    /// Some words of the contour count from where the tool is.
    pub(in super::super) counts: bool,
}

impl Writing {
    /// Z and X as they are written, rounded to the last decimal place of a control, away from a contour.
    fn place(self, point: Point, away: Point) -> String {
        let (unit_mm, decimals) = if self.is_inch { (super::super::execute::MM_PER_INCH, 1e4) } else { (1.0, 1e3) };
        let written = |axis: usize| {
            let factor = if axis == 1 && self.is_diameter { 2.0 } else { 1.0 };
            let value = point[axis] * factor / unit_mm * decimals * away[axis];
            let value = (value - NOISE).ceil() * away[axis] / decimals + 0.0;
            if value.fract() == 0.0 { format!("{value}.") } else { value.to_string() }
        };
        format!("X{} Z{}", written(1), written(0))
    }
}

impl Beyond {
    /// The finding of a cycle.
    pub(super) fn finding(&self, code: FindingCode, cycle: SourceSpan, writing: Writing) -> Finding {
        let shown = |point: Point| writing.place(point, self.away);
        let (start, extreme, line) = (shown(self.start), shown(self.extreme), self.span.line);
        let message = match self.depth_mm {
            None => format!(
                "the cycle starts at {start}, but its contour reaches {extreme} on line {line}, beyond the start"
            ),
            Some(depth_mm) => format!(
                "from the start {start} or back to it, a rapid move passes {depth_mm:.3} mm through the finished \
                 contour, which reaches {extreme} on line {line}"
            ),
        };
        let scale = if writing.is_diameter { 2.0 } else { 1.0 };
        let serves = shown(self.serves);
        let cure = if writing.counts {
            format!(
                "start the cycle at {serves} or further away from the part and write the contour with absolute words: \
                 incremental ones move along with the start"
            )
        } else {
            format!("start the cycle at {serves} or further away from the part")
        };
        let finding = Finding::new(code, cycle, message)
            .with_value("start_x", self.start[1] * scale, "mm")
            .with_value("start_z", self.start[0], "mm")
            .with_value("contour_x", self.extreme[1] * scale, "mm")
            .with_value("contour_z", self.extreme[0], "mm")
            .with_value("contour_line", f64::from(line), "")
            .with_value("cycle_line", f64::from(cycle.line), "")
            .related_to("the contour reaches beyond the start here", self.span)
            .suggest(cure);
        match self.other_side {
            Some(place) => finding.suggest(format!(
                "where the stock is on the other side of the contour, start the cycle at {}",
                writing.place(place, [self.away[0], -self.away[1]])
            )),
            None => finding,
        }
    }
}
