//! Lines and arcs in a plane, and what fits between two of them at their common point.

use crate::ArcGeometry;

/// Below this, two directions (sine of their angle) or two lengths (mm) are the same.
const NOTHING: f64 = 1e-9;

/// A part of a path in its plane, mm.
#[derive(Clone, Copy, Debug)]
pub(in crate::interpreter) struct Segment {
    start: [f64; 2],
    end: [f64; 2],
    /// Centre and sense of an arc.
    arc: Option<([f64; 2], bool)>,
    /// Angle that the arc sweeps, rad.
    sweep: f64,
}

/// Why nothing can be put between two segments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::interpreter) enum Misfit {
    /// One of them is shorter than its part of it.
    TooLarge,
    /// No circle of the radius touches both.
    NoCircle,
    /// The circle does not fit into the arc beside it.
    TooLargeForArc,
    TurnsBack,
}

impl Misfit {
    /// In messages.
    pub(in crate::interpreter) const fn message(self) -> &'static str {
        match self {
            Self::TooLarge => "it is larger than one of its moves",
            Self::NoCircle => "no circle of this radius touches both moves",
            Self::TooLargeForArc => "its radius is too large for the arc beside it",
            Self::TurnsBack => "the path turns back on itself",
        }
    }
}

/// What is put between two segments.
#[derive(Clone, Copy, Debug)]
pub(in crate::interpreter) struct Joint {
    pub(in crate::interpreter) from: [f64; 2],
    pub(in crate::interpreter) to: [f64; 2],
    /// Centre and whether it is clockwise, for an arc.
    pub(in crate::interpreter) arc: Option<([f64; 2], bool)>,
}

impl Segment {
    pub(in crate::interpreter) fn new(start: [f64; 2], end: [f64; 2], arc: Option<&ArcGeometry>) -> Self {
        let sweep = arc.map_or(0.0, |arc| arc.sweep_rad);
        Self { start, end, arc: arc.map(|arc| (arc.center, arc.clockwise)), sweep }
    }

    /// Direction at a point of it, of length 1.
    fn direction(&self, at: [f64; 2]) -> [f64; 2] {
        match self.arc {
            None => unit(minus(self.end, self.start)),
            Some((center, clockwise)) => {
                let [x, y] = unit(minus(at, center));
                if clockwise { [y, -x] } else { [-y, x] }
            }
        }
    }

    /// Whether a point of its line or circle lies between its ends, and not at the far one.
    fn contains(&self, point: [f64; 2]) -> bool {
        match self.arc {
            None => {
                let direction = self.direction(self.start);
                let along = dot(minus(point, self.start), direction);
                let length = length(minus(self.end, self.start));
                (-NOTHING..=length + NOTHING).contains(&along)
            }
            Some((center, clockwise)) => {
                let radius = length(minus(self.start, center));
                if length(minus(point, self.start)) <= NOTHING {
                    return true;
                }
                let swept = sweep(self.start, point, center, clockwise);
                swept.abs() <= self.sweep.abs() + NOTHING / radius
            }
        }
    }
}

/// The chamfer whose ends are this far from the corner; nothing between tangent segments.
pub(in crate::interpreter) fn chamfer(first: &Segment, next: &Segment, size: f64) -> Result<Option<Joint>, Misfit> {
    if turn(first, next)?.is_none() {
        return Ok(None);
    }
    let corner = first.end;
    let from = at_distance(first, corner, size, true)?;
    let to = at_distance(next, corner, size, false)?;
    Ok(Some(Joint { from, to, arc: None }))
}

/// The arc of this radius that is tangent to both; nothing between tangent segments.
pub(in crate::interpreter) fn rounding(first: &Segment, next: &Segment, radius: f64) -> Result<Option<Joint>, Misfit> {
    let Some(left) = turn(first, next)? else { return Ok(None) };
    let corner = first.end;
    let offsets = [offset(first, corner, radius, left)?, offset(next, corner, radius, left)?];
    let centers = intersections(&offsets[0], &offsets[1]);
    let nearest = centers
        .into_iter()
        .flatten()
        .min_by(|one, other| length(minus(*one, corner)).total_cmp(&length(minus(*other, corner))));
    let center = nearest.ok_or(Misfit::NoCircle)?;
    let (from, to) = (touching(first, center), touching(next, center));
    if !first.contains(from) || !next.contains(to) {
        return Err(Misfit::TooLarge);
    }
    Ok(Some(Joint { from, to, arc: Some((center, !left)) }))
}

/// The largest size, in steps of 0.1 µm, below one that does not fit; `None` where none does.
pub(in crate::interpreter) fn largest_that_fits(fits: impl Fn(f64) -> bool, size: f64) -> Option<f64> {
    const STEPS: f64 = 1e4;
    let (mut least, mut most) = (0.0, size);
    for _ in 0..64 {
        let middle = 0.5 * (least + most);
        (least, most) = if fits(middle) { (middle, most) } else { (least, middle) };
    }
    let size = libm::floor(least * STEPS) / STEPS;
    (size > 0.0 && fits(size)).then_some(size)
}

/// Signed angle from one point to the other about a centre, rad: a full turn where they are the same.
pub(in crate::interpreter) fn sweep(from: [f64; 2], to: [f64; 2], center: [f64; 2], clockwise: bool) -> f64 {
    let (from, to) = (minus(from, center), minus(to, center));
    let angle = libm::atan2(cross(from, to), dot(from, to));
    match clockwise {
        true if angle >= 0.0 => angle - core::f64::consts::TAU,
        false if angle <= 0.0 => angle + core::f64::consts::TAU,
        _ => angle,
    }
}

/// Whether the path turns left at the corner; nothing where it goes straight on.
fn turn(first: &Segment, next: &Segment) -> Result<Option<bool>, Misfit> {
    let (before, after) = (first.direction(first.end), next.direction(next.start));
    let sine = cross(before, after);
    if sine.abs() > NOTHING {
        return Ok(Some(sine > 0.0));
    }
    if dot(before, after) > 0.0 { Ok(None) } else { Err(Misfit::TurnsBack) }
}

/// The point of a segment at a straight distance from its end (or its start).
fn at_distance(segment: &Segment, corner: [f64; 2], distance: f64, at_end: bool) -> Result<[f64; 2], Misfit> {
    let point = match segment.arc {
        None => {
            let [x, y] = segment.direction(corner);
            let along = if at_end { -distance } else { distance };
            [corner[0] + x * along, corner[1] + y * along]
        }
        Some((center, clockwise)) => {
            let radius = length(minus(corner, center));
            if distance > 2.0 * radius {
                return Err(Misfit::TooLarge);
            }
            let angle = 2.0 * libm::asin(distance / (2.0 * radius));
            // Back along the arc from its end, forth from its start.
            let angle = if clockwise == at_end { angle } else { -angle };
            let ([x, y], (sine, cosine)) = (minus(corner, center), libm::sincos(angle));
            [center[0] + x * cosine - y * sine, center[1] + x * sine + y * cosine]
        }
    };
    if segment.contains(point) { Ok(point) } else { Err(Misfit::TooLarge) }
}

/// A line (point and direction) or a circle (centre and radius).
enum Curve {
    Line([f64; 2], [f64; 2]),
    Circle([f64; 2], f64),
}

/// Where the centres of circles of this radius are that touch a segment on its left or right.
fn offset(segment: &Segment, corner: [f64; 2], radius: f64, left: bool) -> Result<Curve, Misfit> {
    let side = if left { radius } else { -radius };
    match segment.arc {
        None => {
            let [x, y] = segment.direction(corner);
            Ok(Curve::Line([corner[0] - y * side, corner[1] + x * side], [x, y]))
        }
        Some((center, clockwise)) => {
            let inward = if clockwise { -side } else { side };
            let own = length(minus(corner, center)) - inward;
            if own <= NOTHING { Err(Misfit::TooLargeForArc) } else { Ok(Curve::Circle(center, own)) }
        }
    }
}

fn intersections(one: &Curve, other: &Curve) -> [Option<[f64; 2]>; 2] {
    match (one, other) {
        (Curve::Line(p, d), Curve::Line(q, e)) => {
            let along = cross(minus(*q, *p), *e) / cross(*d, *e);
            [Some([p[0] + d[0] * along, p[1] + d[1] * along]).filter(|_| along.is_finite()), None]
        }
        (Curve::Line(p, d), Curve::Circle(center, radius)) | (Curve::Circle(center, radius), Curve::Line(p, d)) => {
            let along = dot(minus(*center, *p), *d);
            let foot = [p[0] + d[0] * along, p[1] + d[1] * along];
            let height = length(minus(*center, foot));
            chord(foot, *d, radius * radius - height * height)
        }
        (Curve::Circle(a, r), Curve::Circle(b, s)) => {
            let apart = length(minus(*b, *a));
            if apart <= NOTHING {
                return [None; 2];
            }
            let [x, y] = unit(minus(*b, *a));
            let along = (apart * apart + r * r - s * s) / (2.0 * apart);
            chord([a[0] + x * along, a[1] + y * along], [-y, x], r * r - along * along)
        }
    }
}

/// The two points of a line at the square of a distance from its foot.
fn chord(foot: [f64; 2], direction: [f64; 2], square: f64) -> [Option<[f64; 2]>; 2] {
    if square < 0.0 {
        return [None; 2];
    }
    let half = square.sqrt();
    [half, -half].map(|along| Some([foot[0] + direction[0] * along, foot[1] + direction[1] * along]))
}

/// Where a circle with this centre touches a segment.
fn touching(segment: &Segment, center: [f64; 2]) -> [f64; 2] {
    match segment.arc {
        None => {
            let [x, y] = segment.direction(segment.start);
            let along = dot(minus(center, segment.start), [x, y]);
            [segment.start[0] + x * along, segment.start[1] + y * along]
        }
        Some((own, _)) => {
            let radius = length(minus(segment.start, own));
            let [x, y] = unit(minus(center, own));
            [own[0] + x * radius, own[1] + y * radius]
        }
    }
}

/// Whether two points are one.
pub(in crate::interpreter) fn is_same(one: [f64; 2], other: [f64; 2]) -> bool {
    length(minus(one, other)) <= NOTHING
}

fn minus(one: [f64; 2], other: [f64; 2]) -> [f64; 2] {
    [one[0] - other[0], one[1] - other[1]]
}

fn dot(one: [f64; 2], other: [f64; 2]) -> f64 {
    one[0] * other[0] + one[1] * other[1]
}

fn cross(one: [f64; 2], other: [f64; 2]) -> f64 {
    one[0] * other[1] - one[1] * other[0]
}

fn length(vector: [f64; 2]) -> f64 {
    dot(vector, vector).sqrt()
}

fn unit(vector: [f64; 2]) -> [f64; 2] {
    let length = length(vector);
    [vector[0] / length, vector[1] / length]
}
