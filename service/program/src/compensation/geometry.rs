//! Lines and arcs of a plane, their offsets and where these meet: mm along the axes of the plane, angles in rad.

use core::f64::consts::TAU;

use serde::{Deserialize, Serialize};

/// A point or a vector: along the first and the second axis of the plane, mm.
pub(crate) type Point = [f64; 2];

/// Angles about a centre are told apart from a whole turn by more than this, rad.
const LEAST_ANGLE_RAD: f64 = 1e-9;

pub(crate) fn plus(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1]]
}

pub(crate) fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

/// `from` and `length` times `direction`.
pub(crate) fn along(from: Point, direction: Point, length: f64) -> Point {
    [from[0] + direction[0] * length, from[1] + direction[1] * length]
}

pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Positive where `b` is to the left of `a`.
pub(crate) fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(crate) fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

pub(crate) fn distance(a: Point, b: Point) -> f64 {
    length(minus(a, b))
}

/// Turned to the left by a right angle.
pub(crate) const fn left_of(a: Point) -> Point {
    [-a[1], a[0]]
}

fn unit(a: Point) -> Point {
    let length = length(a);
    if length > 0.0 { [a[0] / length, a[1] / length] } else { [1.0, 0.0] }
}

/// Angle from `a` to `b` in the sense of rotation, 0 up to a whole turn, which rounding does not make of nothing.
pub(crate) fn angle_between(a: Point, b: Point, clockwise: bool) -> f64 {
    let angle = libm::atan2(cross(a, b), dot(a, b));
    let angle = if clockwise { -angle } else { angle };
    if angle < -LEAST_ANGLE_RAD { angle + TAU } else { angle.max(0.0) }
}

/// The circle of an arc.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Circle {
    pub(crate) center: Point,
    /// Positive counter-clockwise; may exceed a turn.
    pub(crate) sweep_rad: f64,
}

impl Circle {
    pub(crate) fn is_clockwise(&self) -> bool {
        self.sweep_rad < 0.0
    }

    /// Unit tangent at a point.
    fn tangent(&self, at: Point) -> Point {
        let out = unit(minus(at, self.center));
        if self.is_clockwise() { [out[1], -out[0]] } else { left_of(out) }
    }
}

/// A line, or an arc where there is a circle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Curve {
    pub(crate) from: Point,
    pub(crate) to: Point,
    pub(crate) circle: Option<Circle>,
}

impl Curve {
    pub(crate) const fn line(from: Point, to: Point) -> Self {
        Self { from, to, circle: None }
    }

    pub(crate) const fn arc(from: Point, to: Point, center: Point, sweep_rad: f64) -> Self {
        Self { from, to, circle: Some(Circle { center, sweep_rad }) }
    }

    pub(crate) fn start_tangent(&self) -> Point {
        self.circle.map_or_else(|| unit(minus(self.to, self.from)), |circle| circle.tangent(self.from))
    }

    pub(crate) fn end_tangent(&self) -> Point {
        self.circle.map_or_else(|| unit(minus(self.to, self.from)), |circle| circle.tangent(self.to))
    }

    /// Radius of the circle at its end, 0 for a line.
    pub(crate) fn radius(&self) -> f64 {
        self.circle.map_or(0.0, |circle| distance(circle.center, self.to))
    }

    /// By how much the radii at both ends differ, as those of rounded programs do.
    pub(crate) fn radius_error(&self) -> f64 {
        self.circle.map_or(0.0, |circle| (distance(circle.center, self.from) - self.radius()).abs())
    }

    /// Its length in the plane.
    pub(crate) fn length(&self) -> f64 {
        match self.circle {
            None => distance(self.from, self.to),
            Some(circle) => circle.sweep_rad.abs() * (distance(circle.center, self.from) + self.radius()) * 0.5,
        }
    }
}

/// The side of the path that the tool is on, and its radius.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Side {
    pub(crate) left: bool,
    pub(crate) radius: f64,
}

impl Side {
    /// From a point of the contour with this tangent to the centre of the tool.
    pub(crate) fn offset(&self, tangent: Point) -> Point {
        let radius = if self.left { self.radius } else { -self.radius };
        [-tangent[1] * radius, tangent[0] * radius]
    }

    /// Whether the tool is on the side of the centre.
    pub(crate) fn is_inside(&self, circle: &Circle) -> bool {
        self.left != circle.is_clockwise()
    }

    /// Radius of the arc that the centre of the tool describes; not positive where the tool does not fit.
    pub(crate) fn offset_radius(&self, arc: &Curve) -> f64 {
        match &arc.circle {
            Some(circle) if self.is_inside(circle) => arc.radius() - self.radius,
            _ => arc.radius() + self.radius,
        }
    }

    /// Angle by which the path turns toward the tool, negative away from it, −π to π.
    pub(crate) fn turn(&self, before: Point, after: Point) -> f64 {
        let turn = libm::atan2(cross(before, after), dot(before, after));
        if self.left { turn } else { -turn }
    }
}

/// Where the offsets of two curves that meet in a corner toward the tool cross: the crossing that takes the least of the first.
pub(crate) struct Crossing {
    pub(crate) point: Point,
    /// Angle that an arc loses: at the end of the first curve, at the start of the second.
    pub(crate) lost_rad: [f64; 2],
}

impl Crossing {
    /// `None` where the offsets do not cross.
    pub(crate) fn of(side: Side, first: &Curve, second: &Curve) -> Option<Self> {
        let ends = [first.end_tangent(), second.start_tangent()];
        let [end, start] = ends.map(|tangent| plus(first.to, side.offset(tangent)));
        let candidates = match (&first.circle, &second.circle) {
            (None, None) => {
                let [n1, n2] = ends.map(left_of);
                let radius = if side.left { side.radius } else { -side.radius };
                // C + r·(n1 + n2) / (1 + n1·n2)
                let point = along(first.to, plus(n1, n2), radius / (1.0 + dot(n1, n2)));
                return point[0].is_finite().then_some(Self { point, lost_rad: [0.0; 2] });
            }
            (None, Some(circle)) => line_and_circle(end, ends[0], circle.center, side.offset_radius(second)),
            (Some(circle), None) => line_and_circle(start, ends[1], circle.center, side.offset_radius(first)),
            (Some(one), Some(other)) => {
                two_circles(one.center, side.offset_radius(first), other.center, side.offset_radius(second))
            }
        }?;
        let with_losses = candidates.map(|point| {
            let lost_rad = [
                first.circle.map_or(0.0, |it| lost(&it, point, end)),
                second.circle.map_or(0.0, |it| lost(&it, start, point)),
            ];
            let lost = [
                first
                    .circle
                    .map_or_else(|| dot(minus(end, point), ends[0]), |_| lost_rad[0] * side.offset_radius(first)),
                second
                    .circle
                    .map_or_else(|| dot(minus(point, start), ends[1]), |_| lost_rad[1] * side.offset_radius(second)),
            ];
            (Self { point, lost_rad }, lost)
        });
        let rank = |lost: [f64; 2]| {
            // Rounding may put a crossing a little beyond the corner.
            let is_beyond = lost.iter().any(|&lost| lost < -1e-9);
            (is_beyond, if is_beyond { -lost[0].min(lost[1]) } else { lost[0] })
        };
        let [(one, lost_by_one), (other, lost_by_other)] = with_losses;
        let (one_rank, other_rank) = (rank(lost_by_one), rank(lost_by_other));
        Some(if one_rank <= other_rank { one } else { other })
    }
}

/// Angle from a point of a circle to another in the sense of the arc.
fn lost(circle: &Circle, from: Point, to: Point) -> f64 {
    angle_between(minus(from, circle.center), minus(to, circle.center), circle.is_clockwise())
}

/// Where a line through a point crosses a circle.
fn line_and_circle(point: Point, direction: Point, center: Point, radius: f64) -> Option<[Point; 2]> {
    let foot = along(point, direction, dot(minus(center, point), direction));
    let off = distance(foot, center);
    let square = (radius - off) * (radius + off);
    // Curves that touch may miss each other by rounding.
    if square < -1e-9 * radius.max(1.0) || radius <= 0.0 {
        return None;
    }
    let half = square.max(0.0).sqrt();
    Some([along(foot, direction, -half), along(foot, direction, half)])
}

/// Where two circles cross.
fn two_circles(center: Point, radius: f64, other: Point, other_radius: f64) -> Option<[Point; 2]> {
    let between = distance(center, other);
    if between == 0.0 || radius <= 0.0 || other_radius <= 0.0 {
        return None;
    }
    let towards = unit(minus(other, center));
    let reach = (between * between + (radius - other_radius) * (radius + other_radius)) / (2.0 * between);
    let square = (radius - reach) * (radius + reach);
    if square < -1e-9 * radius.max(1.0) {
        return None;
    }
    let half = square.max(0.0).sqrt();
    let foot = along(center, towards, reach);
    Some([along(foot, left_of(towards), -half), along(foot, left_of(towards), half)])
}
