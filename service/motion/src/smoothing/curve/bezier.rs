//! Cubic Bézier spans of a curve over the arc length of the programmed path.

use serde::{Deserialize, Serialize};

use super::super::vector::{difference, scaled, sum};
use super::place::{Point, first};

/// Position and its first two derivatives by the arc length of the programmed path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    pub(super) point: Point,
    pub(super) first: Point,
    pub(super) second: Point,
    /// Whether the second derivative is a guess: nothing goes on there.
    pub(super) is_free: bool,
}

/// A cubic polynomial of the arc length of the programmed path, from one place of it to another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Span {
    /// Arc lengths of the programmed path, mm.
    pub(super) from: f64,
    pub(super) to: f64,
    /// Bézier control points.
    pub(super) points: [Point; 4],
}

fn mix<const N: usize>(a: [f64; N], b: [f64; N], share: f64) -> [f64; N] {
    sum(a, scaled(difference(b, a), share))
}

/// The polar form of a span with these control points at three shares of it.
fn polar<const N: usize>([p0, p1, p2, p3]: [[f64; N]; 4], [a, b, c]: [f64; 3]) -> [f64; N] {
    let [q0, q1, q2] = [mix(p0, p1, a), mix(p1, p2, a), mix(p2, p3, a)];
    mix(mix(q0, q1, b), mix(q1, q2, b), c)
}

impl Span {
    fn share(&self, s: f64) -> f64 {
        (s - self.from) / (self.to - self.from)
    }

    /// The part between two arc lengths; its own ends stay as they are.
    pub(super) fn part(&self, from: f64, to: f64) -> Self {
        if from <= self.from && to >= self.to { *self } else { Self { from, to, points: self.part_points(from, to) } }
    }

    /// The first coordinates of the control points of the part between two arc lengths.
    pub(super) fn part_points<const N: usize>(&self, from: f64, to: f64) -> [[f64; N]; 4] {
        let points = self.points.map(first);
        if from <= self.from && to >= self.to {
            return points;
        }
        let [a, b] = [self.share(from), self.share(to)];
        [
            if from > self.from { polar(points, [a, a, a]) } else { points[0] },
            polar(points, [a, a, b]),
            polar(points, [a, b, b]),
            if to < self.to { polar(points, [b, b, b]) } else { points[3] },
        ]
    }

    pub(super) fn state(&self, s: f64) -> State {
        let t = self.share(s);
        let [p0, p1, p2, p3] = self.points;
        let legs = [difference(p1, p0), difference(p2, p1), difference(p3, p2)];
        let bends = [difference(legs[1], legs[0]), difference(legs[2], legs[1])];
        let per_length = 1.0 / (self.to - self.from);
        State {
            point: polar(self.points, [t, t, t]),
            first: scaled(mix(mix(legs[0], legs[1], t), mix(legs[1], legs[2], t), t), 3.0 * per_length),
            second: scaled(mix(bends[0], bends[1], t), 6.0 * per_length * per_length),
            is_free: false,
        }
    }

    /// The same behind a place of the programmed path that becomes its start.
    pub(super) fn moved(&self, by: f64) -> Self {
        Self { from: self.from - by, to: self.to - by, ..*self }
    }
}
