//! The offset of a contour by the stock that LinuxCNC's cycles leave on it: round convex corners an arc, concave ones at the
//! crossing of the offsets. Points are along and across, the stock is on the side of growing levels.
//!
//! As in LinuxCNC, the offset grows in steps of at most half of the smallest line or radius, so that short pieces vanish where they
//! do not fit. Lengths are in the unit of the program.

use super::passes::Refusal;
use crate::code;
use crate::compensation::geometry::{Curve, Point, angle_between, cross, distance, dot, length, minus, plus};

/// Pieces shorter than this, or of a smaller radius, vanish.
const LEAST: f64 = 1e-3;

/// A gap along the contour above which a corner gets an arc.
const GAP: f64 = 1e-2;

/// Ends that are nearer to each other than this are the same.
const SAME: f64 = 1e-6;

/// Most steps of an offset: more are needed for pieces only that are far too short for it.
const MAX_ROUNDS: u32 = 10_000;

/// A line or an arc of the contour in the cycles of LinuxCNC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub(super) from: Point,
    pub(super) to: Point,
    pub(super) circle: Option<Circle>,
    pub(super) block: usize,
}

/// The circle of an arc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Circle {
    pub(super) center: Point,
    /// It goes up and down again, clockwise in the frame; otherwise down and up.
    pub(super) is_hill: bool,
}

impl Segment {
    pub(super) const fn line(from: Point, to: Point, block: usize) -> Self {
        Self { from, to, circle: None, block }
    }

    pub(super) fn of(curve: &Curve, block: usize) -> Self {
        let circle = curve.circle.map(|circle| Circle { center: circle.center, is_hill: circle.is_clockwise() });
        Self { from: curve.from, to: curve.to, circle, block }
    }

    pub(super) fn curve(&self, from: Point, to: Point) -> Curve {
        match self.circle {
            None => Curve::line(from, to),
            Some(Circle { center, is_hill }) => {
                let angle = angle_between(minus(from, center), minus(to, center), is_hill);
                Curve::arc(from, to, center, if is_hill { -angle } else { angle })
            }
        }
    }

    pub(super) fn radius(&self) -> f64 {
        self.circle.map_or(0.0, |circle| distance(self.from, circle.center))
    }

    /// Length of a line; of an arc the smaller of chord and radius.
    fn size(&self) -> f64 {
        let chord = distance(self.from, self.to);
        if self.circle.is_some() { chord.min(self.radius()) } else { chord }
    }

    /// Whether it goes forward, and an arc stays on one side of its centre.
    pub(super) fn goes_forward(&self) -> bool {
        let progress = self.to[0] - self.from[0];
        let Some(Circle { center, is_hill }) = self.circle else { return progress >= -LEAST };
        let ends = [self.from[1] - center[1], self.to[1] - center[1]];
        progress >= LEAST && ends.into_iter().all(|end| if is_hill { end >= -LEAST } else { end <= LEAST })
    }

    /// Moved toward the stock.
    fn offset(&mut self, by: f64) {
        match self.circle {
            None => {
                let along = minus(self.to, self.from);
                let scale = by / length(along);
                // To the left of the way forward is outward.
                let shift = [-along[1] * scale, along[0] * scale];
                (self.from, self.to) = (plus(self.from, shift), plus(self.to, shift));
            }
            Some(Circle { center, is_hill }) => {
                let radius = self.radius();
                let factor = (radius + if is_hill { by } else { -by }) / radius;
                let scaled = |point: Point| {
                    let out = minus(point, center);
                    [center[0] + out[0] * factor, center[1] + out[1] * factor]
                };
                (self.from, self.to) = (scaled(self.from), scaled(self.to));
            }
        }
    }
}

/// Offsets the contour behind its first piece, the move to it, whose end follows.
pub(super) fn offset(segments: &mut Vec<Segment>, stock: f64) -> Result<(), Refusal> {
    let mut contour = segments.split_off(1);
    contour.retain(|segment| segment.size() >= LEAST);
    let first = segments[0];
    let last = contour.last().map_or(first, |last| *last);
    let inside = cross(minus(first.to, first.from), minus(last.from, first.from)) < 0.0;
    let stock = if inside { -stock } else { stock };
    let (mut left, mut rounds) = (stock.abs(), 0);
    while left > 0.0 {
        let step = contour.iter().map(|segment| segment.size() * 0.5).fold(left, f64::min);
        rounds += 1;
        if rounds > MAX_ROUNDS || step <= 0.0 {
            return Err(too_narrow());
        }
        let by = step.copysign(stock);
        for segment in &mut contour {
            segment.offset(by);
        }
        contour.retain(|segment| segment.size() >= LEAST);
        connect(&mut contour, by);
        for index in 1..contour.len() {
            let (before, behind) = contour.split_at_mut(index);
            if let (Some(before), Some(behind)) = (before.last_mut(), behind.first_mut()) {
                meet(before, behind)?;
            }
        }
        contour.retain(|segment| segment.size() >= LEAST);
        if contour.is_empty() || contour.iter().any(|segment| !segment.goes_forward()) {
            return Err(too_narrow());
        }
        left -= step;
    }
    for index in 1..contour.len() {
        let middle = plus(contour[index - 1].to, contour[index].from).map(|sum| sum * 0.5);
        (contour[index - 1].to, contour[index].from) = (middle, middle);
    }
    if let Some(second) = contour.first() {
        segments[0].to = second.from;
    }
    segments.append(&mut contour);
    Ok(())
}

fn too_narrow() -> Refusal {
    let message = "the contour has arcs or corners that are too narrow for the stock D";
    Refusal::new(code::TURNING_VALUE, message, "leave less stock, or make the contour rounder")
}

/// Arcs round convex corners.
fn connect(contour: &mut Vec<Segment>, by: f64) {
    let mut index = 0;
    while index + 1 < contour.len() {
        let (before, behind) = (contour[index], contour[index + 1]);
        if behind.from[0] - before.to[0] > GAP {
            let (mut unmoved_before, mut unmoved_behind) = (before, behind);
            unmoved_before.offset(-by);
            unmoved_behind.offset(-by);
            let center = plus(unmoved_before.to, unmoved_behind.from).map(|sum| sum * 0.5);
            let circle = Some(Circle { center, is_hill: by > 0.0 });
            contour.insert(index + 1, Segment { from: before.to, to: behind.from, circle, block: before.block });
            index += 1;
        }
        index += 1;
    }
}

/// Lets the end of one piece be the start of the next, where they cross.
fn meet(before: &mut Segment, behind: &mut Segment) -> Result<(), Refusal> {
    let is_joined = distance(before.to, behind.from) < SAME;
    let point = match (before.circle, behind.circle) {
        (None, None) => lines_cross(before, behind),
        (Some(one), Some(other)) => Some(circles_cross(before, behind, one, other)?),
        _ if is_joined => None,
        (None, Some(circle)) => line_crosses(before, circle.center, distance(behind.to, circle.center), behind.from),
        (Some(circle), None) => line_crosses(behind, circle.center, distance(before.to, circle.center), behind.from),
    };
    if let Some(point) = point {
        (before.to, behind.from) = (point, point);
    }
    Ok(())
}

fn lines_cross(one: &Segment, other: &Segment) -> Option<Point> {
    let (a, b) = (minus(one.to, one.from), minus(other.to, other.from));
    let sine = cross(a, b);
    if sine == 0.0 {
        return None;
    }
    let share = cross(minus(other.from, one.from), b) / sine;
    Some([one.from[0] + a[0] * share, one.from[1] + a[1] * share])
}

/// The crossing of a line with a circle that is nearer to a point.
fn line_crosses(line: &Segment, center: Point, radius: f64, near: Point) -> Option<Point> {
    let along = minus(line.to, line.from);
    let size = length(along);
    if size == 0.0 {
        return None;
    }
    let unit = [along[0] / size, along[1] / size];
    let out = minus(center, line.from);
    let (foot, height) = (dot(out, unit), cross(unit, out));
    let half = (radius * radius - height * height).max(0.0).sqrt();
    let at = |place: f64| [line.from[0] + unit[0] * place, line.from[1] + unit[1] * place];
    let (one, other) = (at(foot - half), at(foot + half));
    Some(if distance(near, one) < distance(near, other) { one } else { other })
}

/// The upper crossing of two circles, which is that of LinuxCNC. Where the pieces do not cross near it, there is no offset that
/// both would make.
fn circles_cross(before: &Segment, behind: &Segment, first: Circle, second: Circle) -> Result<Point, Refusal> {
    let (a, b) = (behind.radius(), before.radius());
    let between = minus(first.center, second.center);
    let c = length(between);
    if a == 0.0 || c == 0.0 {
        return Err(too_narrow());
    }
    let cosine = (c * c + a * a - b * b) / (2.0 * a * c);
    if cosine.abs() > 1.0 + LEAST {
        return Err(too_narrow());
    }
    let sine = (1.0 - (cosine * cosine).min(1.0)).sqrt();
    let unit = [between[0] / c, between[1] / c];
    let at = |sine: f64| {
        let turned = [unit[0] * cosine - unit[1] * sine, unit[0] * sine + unit[1] * cosine];
        [second.center[0] + turned[0] * a, second.center[1] + turned[1] * a]
    };
    let (lower, upper) = (at(sine), at(-sine));
    let near = plus(before.to, behind.from).map(|sum| sum * 0.5);
    if distance(near, upper) > distance(near, lower) + GAP { Err(too_narrow()) } else { Ok(upper) }
}
