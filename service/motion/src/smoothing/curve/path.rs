//! The programmed path of a window: where its elements lie by arc length, how it turns, and what is sampled of it.
//!
//! What a curve within the tolerance P can smooth out at a place is the length ℓ within which the path turns so much that it
//! cannot be left behind: with Θ the sum of all turns nearer than ℓ, ℓ·Θ = 4·P. Beside a corner of θ that is 4·P/θ, the
//! reach of a curve that passes it; farther away the distance to the corner; on a circle √(2·P·R). The scales of the fit
//! and the distances of its knots are shares of ℓ.

use super::super::vector::{difference, norm, scaled, sum};
use super::Ending;
use super::bezier::Span;
use super::fit::basis;
use super::place::{self, GUIDED, LINEAR, Point, filled, tip, turns};
use crate::kinematics::FiveAxisCorners;
use crate::kinematics::vector::Vec3;
use crate::tolerance::{
    CURVE_ARC_STEP_RAD, CURVE_FIRST_SHARE, CURVE_KNOT_SHARE, CURVE_LAST_SHARE, CURVE_LEAST_SPANS, CURVE_MOST_REACH_MM,
    CURVE_SCALE_SHARE, CURVE_SNAP_SHARE, CURVE_TURNS_SEEN, UNUSED_TOLERANCE_MM,
};
use crate::{Curve, Element};

/// Parts of a span's part on an element whose deviation is bounded each: the bound exceeds the deviation the less the more there are.
const DEVIATION_PARTS: usize = 4;

/// A place of the programmed path that the curve is held to.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    /// Arc length from the start of the window, mm.
    pub(super) s: f64,
    pub(super) point: Point,
    /// Span of the curve that ends here or goes on beyond.
    pub(super) span: usize,
    /// Values of the four basis functions of that span here.
    pub(super) basis: [f64; 4],
    /// Length of the path that it stands for, mm.
    pub(super) weight_mm: f64,
    /// Part of the tolerances that the curve may use.
    share: f64,
    /// Largest distance of the curve, mm.
    tolerance_mm: f64,
    /// Change of the tool's direction with either rotary axis, by the largest one that is permitted, under tool centre point control.
    turning: Option<[Vec3; 2]>,
    /// First scale of the fit, mm.
    pub(super) scale: f64,
}

impl Sample {
    /// Deviation of a point of the curve, by what it may be.
    pub(super) fn ratio<const N: usize>(&self, at: [f64; N]) -> f64 {
        let off = norm(difference(tip(at), tip(self.point))) / self.tolerance_mm;
        let turned = |turning| turned(turning, turns(difference(filled(at), self.point)));
        self.turning.map_or(off, |turning| larger(off, turned(turning)))
    }
}

/// Largest distance of X, Y and Z of control points, and the number of those.
fn farthest_point<const N: usize>(curve: &[[f64; N]; 4], path: &[Point; 4]) -> (f64, usize) {
    let mut largest = (0.0, 0);
    for number in 0..4 {
        // Not `max`, which would pass over what is no number.
        let own = norm(difference(tip(curve[number]), tip(path[number])));
        let is_less = own <= largest.0;
        if !is_less {
            largest = (own, number);
        }
    }
    largest
}

/// Turn of the tool's direction by a turn of the rotary axes.
fn turned([first, second]: [Vec3; 2], [by_first, by_second]: [f64; 2]) -> f64 {
    norm(sum(scaled(first, by_first), scaled(second, by_second)))
}

/// The larger of two numbers; unlike `max`, it does not pass over what is no number.
fn larger(a: f64, b: f64) -> f64 {
    if a <= b || b.is_nan() { b } else { a }
}

/// An element of the window.
struct Leg<'a> {
    element: &'a Element,
    /// Arc lengths from the start of the window.
    from: f64,
    to: f64,
}

/// A change of direction.
#[derive(Clone, Copy)]
struct Turn {
    s: f64,
    angle_rad: f64,
}

/// The programmed path of a window.
pub(super) struct Path<'a> {
    legs: Vec<Leg<'a>>,
    turns: Vec<Turn>,
    tolerance_mm: f64,
    /// Under tool centre point control.
    corners: Option<FiveAxisCorners<'a>>,
}

/// Upper bounds of how far a part of a span is from the programmed path.
struct PartDeviation {
    largest_mm: f64,
    /// Number of the control point of the difference that is farthest.
    farthest: usize,
    /// Angle between the directions of the tool by the largest one that is permitted.
    turned: f64,
}

impl<'a> Path<'a> {
    pub(super) fn new(tolerance_mm: f64, corners: Option<FiveAxisCorners<'a>>) -> Self {
        let tolerance_mm = tolerance_mm - UNUSED_TOLERANCE_MM;
        Self { legs: Vec::new(), turns: Vec::new(), tolerance_mm, corners }
    }

    /// Adds an element and the turn behind it.
    pub(super) fn push(&mut self, element: &'a Element, angle_rad: f64) {
        let from = self.length();
        let to = from + element.length;
        if let Curve::Arc(arc) = &element.curve {
            let parts = (arc.sweep_rad.abs() / CURVE_ARC_STEP_RAD).ceil().max(1.0);
            let angle_rad = arc.sweep_rad.abs() / parts;
            let mut part = 0.5;
            while part < parts {
                self.turns.push(Turn { s: from + element.length * (part / parts), angle_rad });
                part += 1.0;
            }
        }
        self.legs.push(Leg { element, from, to });
        if angle_rad > 0.0 {
            self.turns.push(Turn { s: to, angle_rad });
        }
    }

    pub(super) fn length(&self) -> f64 {
        self.legs.last().map_or(0.0, |leg| leg.to)
    }

    /// ℓ at a place, mm.
    fn reach(&self, s: f64) -> f64 {
        let limit = 4.0 * self.tolerance_mm;
        let mut right = self.turns.partition_point(|turn| turn.s < s);
        let mut left = right;
        let mut angle_rad = 0.0;
        for _ in 0..CURVE_TURNS_SEEN {
            let before = if left > 0 { s - self.turns[left - 1].s } else { f64::INFINITY };
            let behind = self.turns.get(right).map_or(f64::INFINITY, |turn| turn.s - s);
            let next = before.min(behind).min(CURVE_MOST_REACH_MM);
            if angle_rad * next >= limit {
                return limit / angle_rad;
            }
            if next >= CURVE_MOST_REACH_MM {
                return next;
            }
            if before <= behind {
                left -= 1;
                angle_rad += self.turns[left].angle_rad;
            } else {
                angle_rad += self.turns[right].angle_rad;
                right += 1;
            }
            if angle_rad * next >= limit {
                return next;
            }
        }
        limit / angle_rad
    }

    /// Knots up to `end`, or as many as `most`, each with its ℓ; a `refinement` of 2 halves their distances.
    pub(super) fn knots(&self, end: f64, most: usize, refinement: f64) -> Vec<[f64; 2]> {
        let mut knots = vec![[0.0, self.reach(0.0)]];
        while knots.len() < most {
            let [s, reach] = knots[knots.len() - 1];
            let step = reach * (CURVE_KNOT_SHARE / refinement);
            let next = self.snapped(s + step, step);
            if next >= end {
                break;
            }
            knots.push([next, self.reach(next)]);
        }
        knots
    }

    /// The end of an element where one is close to a knot: parts of spans are not to be so short that rounding shows in their
    /// derivatives.
    fn snapped(&self, knot: f64, step: f64) -> f64 {
        let leg = self.leg_at(knot);
        let [from, to] = self.range(leg);
        let close = CURVE_SNAP_SHARE * step;
        if to - knot <= close {
            to
        } else if knot - from <= close {
            from
        } else {
            knot
        }
    }

    /// Makes the knots end at `end`, with enough spans.
    pub(super) fn close(&self, knots: &mut Vec<[f64; 2]>, end: f64) {
        let [last, _] = knots[knots.len() - 1];
        if knots.len() > 2 {
            let before = last - knots[knots.len() - 2][0];
            if end - last < 0.5 * before {
                knots.pop();
            }
        }
        if end > knots[knots.len() - 1][0] {
            knots.push([end, self.reach(end)]);
        }
        if knots.len() <= CURVE_LEAST_SPANS {
            knots.clear();
            knots.extend((0..=CURVE_LEAST_SPANS).map(|k| {
                let step = end / CURVE_LEAST_SPANS as f64;
                let s = match k {
                    0 => 0.0,
                    CURVE_LEAST_SPANS => end,
                    _ => self.snapped(step * k as f64, step),
                };
                [s, self.reach(s)]
            }));
        }
    }

    /// Index of the element at a place.
    pub(super) fn leg_at(&self, s: f64) -> usize {
        self.legs.partition_point(|leg| leg.to <= s).min(self.legs.len() - 1)
    }

    /// Where an element lies.
    pub(super) fn range(&self, leg: usize) -> [f64; 2] {
        [self.legs[leg].from, self.legs[leg].to]
    }

    /// Arc length from the start of the window.
    pub(super) fn place(&self, ending: Ending) -> f64 {
        match ending {
            Ending::Within(s) => s,
            Ending::OnPath { leg, offset_mm } => self.legs[leg].from + offset_mm,
        }
    }

    /// The path at an arc length.
    pub(super) fn on_path(&self, s: f64) -> Ending {
        let leg = self.leg_at(s);
        Ending::OnPath { leg, offset_mm: s - self.legs[leg].from }
    }

    fn point(&self, leg: usize, s: f64) -> Point {
        let Leg { element, from, to } = &self.legs[leg];
        if matches!(element.curve, Curve::Line) {
            let [start, end] = [place::point(element, 0.0), place::point(element, element.length)];
            let share = (s - from) / (to - from);
            return if s >= *to { end } else { sum(start, scaled(difference(end, start), share)) };
        }
        place::point(element, s - from)
    }

    fn is_guided(&self, leg: usize) -> bool {
        matches!(self.legs[leg].element.curve, Curve::FiveAxis(_))
    }

    /// Change of the tool's direction with either rotary axis at a place, by the largest one that is permitted.
    fn turning(&self, point: Point) -> [Vec3; 2] {
        let [_, second_rad] = turns(point);
        self.corners.map_or_else(Default::default, |corners| {
            corners.turning(second_rad).map(|turning| scaled(turning, 1.0 / corners.direction_tolerance_rad))
        })
    }

    /// Samples on the knots and on the ends of elements, and between them where they are far apart; none at the ends.
    pub(super) fn samples(&self, knots: &[[f64; 2]], samples: &mut Vec<Sample>) {
        samples.clear();
        let count = knots.len() - 1;
        let end = knots[count][0];
        let mut leg = 0;
        let mut last = 0.0;
        for span in 0..count {
            let [[from, reach], [to, next_reach]] = [knots[span], knots[span + 1]];
            let knot = |k: isize| knots[(span as isize + k).clamp(0, count as isize) as usize][0];
            let most = 0.5 * (to - from);
            while last < to {
                while leg + 1 < self.legs.len() && self.legs[leg].to <= last {
                    leg += 1;
                }
                let stop = if leg + 1 < self.legs.len() { self.legs[leg].to.min(to) } else { to };
                let parts = ((stop - last) / most).ceil().max(1.0);
                let step = (stop - last) / parts;
                let start = last;
                let mut part = 1.0;
                while part <= parts {
                    let s = if part < parts { start + step * part } else { stop };
                    let share = (s - from) / (to - from);
                    let usable = CURVE_FIRST_SHARE + (CURVE_LAST_SHARE - CURVE_FIRST_SHARE) * (s / end);
                    if s < end {
                        let point = self.point(leg, s);
                        samples.push(Sample {
                            s,
                            point,
                            span,
                            basis: basis(knot, s),
                            weight_mm: s - last,
                            share: usable,
                            tolerance_mm: self.tolerance_mm * usable,
                            turning: self
                                .is_guided(leg)
                                .then(|| self.turning(point).map(|by| scaled(by, 1.0 / usable))),
                            scale: CURVE_SCALE_SHARE * (reach + (next_reach - reach) * share),
                        });
                    }
                    last = s;
                    part += 1.0;
                }
            }
        }
        for k in 1..samples.len() {
            let half = 0.5 * samples[k].weight_mm;
            samples[k].weight_mm = half;
            samples[k - 1].weight_mm += half;
        }
    }

    /// Upper bound of the distance of the curve from an element between two places of it, mm; and where it is about as far, as a share
    /// of the way between the places.
    ///
    /// Never more than what the fit was held to ([`Path::farthest`]): parts of spans are no longer than those between its samples.
    pub(super) fn deviation(&self, spans: &[Span], leg: usize, [from, to]: [f64; 2]) -> (f64, f64) {
        let mut largest = (0.0, 0.0);
        let first = spans.partition_point(|span| span.to <= from);
        for span in spans[first..].iter().take_while(|span| span.from < to) {
            let [start, end] = [span.from.max(from), span.to.min(to)];
            let place = |part: usize| match part {
                0 => start,
                DEVIATION_PARTS => end,
                _ => start + (end - start) * (part as f64 / DEVIATION_PARTS as f64),
            };
            for part in 0..DEVIATION_PARTS {
                let [start, end] = [place(part), place(part + 1)];
                let PartDeviation { largest_mm, farthest, .. } = self.part_deviation(span, leg, [start, end]);
                if largest_mm > largest.0 {
                    let s = start + farthest as f64 / 3.0 * (end - start);
                    largest = (largest_mm, (s - from) / (to - from));
                }
            }
        }
        largest
    }

    /// Upper bounds of the distance of a part of a span from an element: curve and path are compared at the same place, as polynomials,
    /// whose difference stays within the hull of its control points. An arc is the cubic with its ends and directions, to r·φ⁴/384.
    fn part_deviation(&self, span: &Span, leg: usize, [from, to]: [f64; 2]) -> PartDeviation {
        let (path, error_mm) = self.control_points(leg, from, to);
        if !self.is_guided(leg) {
            let (largest_mm, farthest) = farthest_point(&span.part_points::<LINEAR>(from, to), &path);
            return PartDeviation { largest_mm: largest_mm + error_mm, farthest, turned: 0.0 };
        }
        let curve = span.part_points::<GUIDED>(from, to);
        let (largest_mm, farthest) = farthest_point(&curve, &path);
        PartDeviation { largest_mm, farthest, turned: self.part_turned(&curve, &path, leg, [from, to]) }
    }
    /// Upper bound of the angle between the directions along a part of a span and an element, by the largest one that is permitted.
    ///
    /// Straight from one pair of rotary values to the other, the direction goes at most so far as the difference is long, measured by how
    /// the direction changes with them. That depends on the second axis alone; how it does is the rest of the bound.
    fn part_turned(&self, curve: &[Point; 4], path: &[Point; 4], leg: usize, [from, to]: [f64; 2]) -> f64 {
        let Leg { element, from: leg_from, .. } = &self.legs[leg];
        let middle = turns(place::point(element, 0.5 * (from + to) - leg_from));
        let turning = self.turning([0.0, 0.0, 0.0, middle[0], middle[1]]);
        // Where the rotary axes do not turn as a cubic, that with their ends and velocities is farthest off in the middle.
        let [a, b, c, d] = path.map(turns);
        let error_rad = [0, 1].map(|axis| {
            let cubic = 0.125 * (a[axis] + d[axis]) + 0.375 * (b[axis] + c[axis]);
            2.0 * (cubic - middle[axis]).abs()
        });
        let spread_rad =
            curve.iter().chain(path).fold(0.0, |spread, &point| larger(spread, (turns(point)[1] - middle[1]).abs()));
        let [first, second] = turning.map(norm);
        let mut largest = 0.0;
        for (&curve, &path) in curve.iter().zip(path) {
            let by = turns(difference(curve, path));
            let beside = second * spread_rad * (by[0].abs() + by[1].abs());
            largest = larger(largest, turned(turning, by) + beside);
        }
        largest + error_rad[0] * (first + second * spread_rad) + error_rad[1] * second
    }

    /// Upper bounds of the deviation of the curve between the samples, as ratios to the tolerance at either end.
    pub(super) fn farthest(&self, spans: &[Span], samples: &[Sample], ratios: &mut [f64]) {
        let end = spans[spans.len() - 1].to;
        let mut last = 0.0;
        for k in 0..=samples.len() {
            let (to, span) = samples.get(k).map_or((end, spans.len() - 1), |sample| (sample.s, sample.span));
            let leg = self.leg_at(0.5 * (last + to));
            let PartDeviation { largest_mm, turned, .. } = self.part_deviation(&spans[span], leg, [last, to]);
            for place in k.saturating_sub(1)..=k.min(samples.len().saturating_sub(1)) {
                let own = larger(largest_mm / samples[place].tolerance_mm, turned / samples[place].share);
                ratios[place] = larger(ratios[place], own);
            }
            last = to;
        }
    }

    /// Cubic Bézier control points of the path between two places of one element, and how far off X, Y and Z of them are, mm.
    fn control_points(&self, leg: usize, from: f64, to: f64) -> ([Point; 4], f64) {
        let [start, end] = [self.point(leg, from), self.point(leg, to)];
        let Leg { element, from: leg_from, .. } = &self.legs[leg];
        if matches!(element.curve, Curve::Line) {
            let third = scaled(difference(end, start), 1.0 / 3.0);
            return ([start, sum(start, third), difference(end, third), end], 0.0);
        }
        let third = (to - from) / 3.0;
        let [first, last] = [from, to].map(|s| scaled(place::slope(element, s - leg_from), third));
        let Curve::Arc(arc) = &element.curve else {
            return ([start, sum(start, first), difference(end, last), end], 0.0);
        };
        let angle_rad = arc.sweep_rad * ((to - from) / element.length);
        let square = angle_rad * angle_rad;
        // Where the radius changes, its derivative counts beside it.
        let radius_mm =
            arc.start_radius_mm.max(arc.end_radius_mm) + 4.0 * (arc.end_radius_mm - arc.start_radius_mm).abs();
        ([start, sum(start, first), difference(end, last), end], radius_mm * (square * square) / 384.0)
    }
}
