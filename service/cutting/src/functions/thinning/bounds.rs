//! Bounds of runs of points, in a binary tree over a group: whether a search can leap over a run without looking into it.

use feedwave_motion::kinematics::vector::{Vec3, add_scaled, dot, norm, sub};

/// Points of a run of the lowest level: with fewer the bounds cost more than they save.
pub(super) const RUN: usize = 16;

/// Share of a bound that is given away to rounding, so that a leap is never taken where a point would have said stop.
pub(super) const BOUND_SLACK: f64 = 1.0 - 1e-9;

/// A segment between two points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    start: Vec3,
    travel: Vec3,
    /// Square of its length, mm².
    square: f64,
}

impl Segment {
    pub(super) fn new(start: Vec3, end: Vec3) -> Self {
        let travel = sub(end, start);
        Self { start, travel, square: dot(travel, travel) }
    }

    /// Share of the segment's point nearest to `point`; `None` where the segment is a point.
    pub(super) fn share(&self, point: Vec3) -> Option<f64> {
        let share = dot(sub(point, self.start), self.travel) / self.square;
        // A segment so short that its square vanishes is a point as well.
        (self.square > 0.0 && share.is_finite()).then(|| share.clamp(0.0, 1.0))
    }

    /// Distance of a point from the segment (not from the infinite line), mm.
    pub(super) fn distance(&self, point: Vec3) -> f64 {
        let nearest = add_scaled(self.start, self.travel, self.share(point).unwrap_or(0.0));
        norm(sub(point, nearest))
    }

    pub(super) fn length(&self) -> f64 {
        libm::sqrt(self.square)
    }
}

/// Bounds of a run of consecutive points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// First and last position.
    pub first: Vec3,
    pub last: Vec3,
    /// No position is further than this from the segment between them, mm.
    pub spread: f64,
    /// Least and greatest components of the directions: unlike balls, boxes do not grow when flickering runs are joined.
    least: Vec3,
    greatest: Vec3,
}

impl Bounds {
    fn of_points(points: &[(Vec3, Vec3)]) -> Self {
        let (first, last) = (points[0].0, points[points.len() - 1].0);
        let chord = Segment::new(first, last);
        let mut spread = 0.0_f64;
        let (mut least, mut greatest) = (points[0].1, points[0].1);
        for &(position, direction) in points {
            spread = spread.max(chord.distance(position));
            least = [0, 1, 2].map(|axis| direction[axis].min(least[axis]));
            greatest = [0, 1, 2].map(|axis| direction[axis].max(greatest[axis]));
        }
        Self { first, last, spread, least, greatest }
    }

    fn of_both(left: &Self, right: &Self) -> Self {
        let chord = Segment::new(left.first, right.last);
        // The distance from a segment is convex, so that on each half's chord it is largest at an end.
        let spread = [left, right]
            .map(|half| chord.distance(half.first).max(chord.distance(half.last)) + half.spread)
            .into_iter()
            .fold(0.0, f64::max);
        let least = [0, 1, 2].map(|axis| left.least[axis].min(right.least[axis]));
        let greatest = [0, 1, 2].map(|axis| left.greatest[axis].max(right.greatest[axis]));
        Self { first: left.first, last: right.last, spread, least, greatest }
    }

    /// No direction of the run is further than this from another one: the distance to the furthest corner of the box.
    pub(super) fn directions_from(&self, direction: Vec3) -> f64 {
        norm([0, 1, 2].map(|axis| (direction[axis] - self.least[axis]).max(self.greatest[axis] - direction[axis])))
    }

    /// No position of the run is further than this from a segment, mm.
    pub(super) fn distance_from(&self, segment: &Segment) -> f64 {
        segment.distance(self.first).max(segment.distance(self.last)) + self.spread
    }
}

/// The tree: level l holds the bounds of runs of RUN·2^l points, whole ones only.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    levels: Vec<Vec<Bounds>>,
}

impl Tree {
    /// Builds the bounds of a group, in the memory of the last one.
    pub(super) fn build(&mut self, points: impl ExactSizeIterator<Item = (Vec3, Vec3)>) {
        self.levels.iter_mut().for_each(Vec::clear);
        if self.levels.is_empty() {
            self.levels.push(Vec::new());
        }
        let mut run = [([0.0; 3], [0.0; 3]); RUN];
        for (index, point) in points.enumerate() {
            run[index % RUN] = point;
            if index % RUN == RUN - 1 {
                self.levels[0].push(Bounds::of_points(&run));
            }
        }
        let mut level = 0;
        while self.levels[level].len() >= 2 {
            if self.levels.len() == level + 1 {
                self.levels.push(Vec::new());
            }
            let (below, above) = self.levels.split_at_mut(level + 1);
            above[0].extend(below[level].chunks_exact(2).map(|pair| Bounds::of_both(&pair[0], &pair[1])));
            level += 1;
        }
    }

    /// The first point of `from..to` that `stops`, where `passes` says of a run's bounds (given with the place of its first
    /// point and its length) that none of its points does. `looks` counts the questions.
    #[inline(always)]
    pub(super) fn first(
        &self,
        (from, to): (usize, usize),
        looks: &mut u64,
        passes: impl Fn(&Bounds, usize, usize) -> bool,
        stops: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let (mut at, mut level) = (from, 0);
        while at < to {
            if at % RUN == 0 {
                // As high as the place, the end and the tree allow, but only one level higher than the last leap.
                let fits = |level: usize| {
                    let size = RUN << level;
                    at % size == 0
                        && at + size <= to
                        && self.levels.get(level).is_some_and(|runs| at / size < runs.len())
                };
                while fits(level) && fits(level + 1) && level < usize::BITS as usize / 2 {
                    level += 1;
                }
                let mut leap = None;
                loop {
                    if fits(level) {
                        *looks += 1;
                        let size = RUN << level;
                        if passes(&self.levels[level][at / size], at, size) {
                            leap = Some(size);
                            break;
                        }
                    }
                    if level == 0 {
                        break;
                    }
                    level -= 1;
                }
                if let Some(size) = leap {
                    at += size;
                    continue;
                }
            }
            let end = to.min((at / RUN + 1) * RUN);
            for index in at..end {
                *looks += 1;
                if stops(index) {
                    return Some(index);
                }
            }
            at = end;
        }
        None
    }
}
