//! One span of the algorithm: how far to reach from a kept point, and how far to shrink back.

use feedwave_motion::kinematics::vector::{Vec3, dot, sub};
use feedwave_motion::kinematics::{GreatCircle, RotaryDirections};

use super::bounds::{BOUND_SLACK, Bounds, Segment, Tree};
use super::thinner::CutPoint;

/// What rounding may add to a bound of a distance, mm: some ulps of the largest coordinates.
const DISTANCE_SLACK_MM: f64 = 1e-9;

/// Tolerances as the searches compare them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Length of the chord between two unit vectors at the angle tolerance. It rises with the angle, and
    /// unlike a cosine it resolves small ones.
    pub chord: f64,
    /// Distance tolerance, mm.
    pub distance_mm: f64,
    /// Chord of the tolerance on the interpolated direction, where there is one.
    pub interpolated_chord: Option<f64>,
}

/// Chord of an angle between unit vectors, rad.
pub(super) fn chord(angle_rad: f64) -> f64 {
    2.0 * libm::sin(angle_rad / 2.0)
}

/// Angle of a chord, rad.
pub(super) fn angle_of(chord: f64) -> f64 {
    2.0 * libm::asin((chord / 2.0).min(1.0))
}

/// |a − b|².
fn apart(a: Vec3, b: Vec3) -> f64 {
    let travel = sub(a, b);
    dot(travel, travel)
}

/// The direction that is interpolated between two kept points.
#[derive(Clone, Copy, Debug)]
pub(super) enum Between {
    /// Along the great circle.
    Circle(GreatCircle),
    /// By the rotary angles, rad.
    Angles { directions: RotaryDirections, start_rad: [f64; 2], travel_rad: [f64; 2] },
    /// Opposite directions, which have nothing definite between them.
    Opposite,
}

impl Between {
    pub(super) fn new(start: &CutPoint, end: &CutPoint, directions: Option<&RotaryDirections>) -> Self {
        if let (Some(&directions), Some(start_rad), Some(end_rad)) = (directions, start.rotary_rad, end.rotary_rad) {
            let travel_rad = [end_rad[0] - start_rad[0], end_rad[1] - start_rad[1]];
            return Self::Angles { directions, start_rad, travel_rad };
        }
        GreatCircle::new(start.direction, end.direction).map_or(Self::Opposite, Self::Circle)
    }

    // Asked of every point, as are the two below and `Tree::first`: calls cost thinning 5 to 9 % more instructions.
    #[inline(always)]
    fn at(&self, share: f64) -> Option<Vec3> {
        match self {
            Self::Circle(circle) => Some(circle.at(share)),
            Self::Angles { directions, start_rad, travel_rad } => {
                Some(directions.at([start_rad[0] + travel_rad[0] * share, start_rad[1] + travel_rad[1] * share]))
            }
            Self::Opposite => None,
        }
    }

    /// Square of the chord between the interpolated direction and another one; that of opposite ones where nothing
    /// definite is interpolated.
    pub(super) fn apart(&self, share: f64, direction: Vec3) -> f64 {
        self.at(share).map_or(4.0, |between| apart(between, direction))
    }

    /// Most that the direction turns per unit of the share, rad.
    fn rate(&self) -> f64 {
        match self {
            Self::Circle(circle) => circle.angle_rad(),
            Self::Angles { travel_rad, .. } => travel_rad[0].abs() + travel_rad[1].abs(),
            Self::Opposite => f64::INFINITY,
        }
    }
}

/// A group under work.
pub(super) struct Group<'a> {
    pub points: &'a [CutPoint],
    pub tree: &'a Tree,
    pub limits: Limits,
    pub directions: Option<&'a RotaryDirections>,
}

impl Group<'_> {
    /// The point that ends the span after the kept point `start`, which is not the last one.
    pub(super) fn end_of_span(&self, start: usize, looks: &mut u64) -> usize {
        let mut end = self.reach(start, looks);
        while let Some(place) = self.first_too_far(start, end, looks) {
            end = place;
        }
        end
    }

    /// Condition 1: the first point whose direction is not within the angle tolerance of the start's, or the last one.
    #[inline(always)]
    fn reach(&self, start: usize, looks: &mut u64) -> usize {
        let from = self.points[start].direction;
        let limit = self.limits.chord;
        let square = limit * limit;
        let passes = |run: &Bounds, _: usize, _: usize| run.directions_from(from) < limit * BOUND_SLACK;
        let stops = |index: usize| apart(self.points[index].direction, from) >= square;
        let last = self.points.len() - 1;
        self.tree.first((start + 1, last), looks, passes, stops).unwrap_or(last)
    }

    /// Condition 2, and the optional one on the interpolated direction: the first point between two that breaks it.
    #[inline(always)]
    fn first_too_far(&self, start: usize, end: usize, looks: &mut u64) -> Option<usize> {
        let segment = self.segment(start, end);
        let limit = self.limits.distance_mm;
        let near = |run: &Bounds| run.distance_from(&segment) < limit - DISTANCE_SLACK_MM;
        let far = |index: usize| segment.distance(self.points[index].tip_mm) >= limit;
        let range = (start + 1, end);
        let Some(chord) = self.limits.interpolated_chord else {
            return self.tree.first(range, looks, |run, _, _| near(run), far);
        };
        let between = Between::new(&self.points[start], &self.points[end], self.directions);
        let (square, rate) = (chord * chord, between.rate());
        let passes = |run: &Bounds, first: usize, size: usize| {
            // Shares of the run's points: around those of its chord's ends, or by the count on the spot.
            let (low, high) = match (segment.share(run.first), segment.share(run.last)) {
                (Some(a), Some(b)) => {
                    let more = run.spread / segment.length();
                    ((a.min(b) - more).max(0.0), (a.max(b) + more).min(1.0))
                }
                _ => (self.share(&segment, (start, end), first), self.share(&segment, (start, end), first + size - 1)),
            };
            let middle = between.at((low + high) / 2.0).unwrap_or_default();
            let off = run.directions_from(middle);
            near(run) && off + rate * (high - low) / 2.0 < chord * BOUND_SLACK
        };
        let stops = |index: usize| {
            let share = self.share(&segment, (start, end), index);
            far(index) || between.apart(share, self.points[index].direction) >= square
        };
        self.tree.first(range, looks, passes, stops)
    }

    pub(super) fn segment(&self, start: usize, end: usize) -> Segment {
        Segment::new(self.points[start].tip_mm, self.points[end].tip_mm)
    }

    /// Where on its span a dropped point is passed: at the nearest place of the segment, by the count of blocks where only
    /// the direction changes.
    pub(super) fn share(&self, segment: &Segment, (start, end): (usize, usize), index: usize) -> f64 {
        let by_count = || (index - start) as f64 / (end - start) as f64;
        segment.share(self.points[index].tip_mm).unwrap_or_else(by_count)
    }
}
