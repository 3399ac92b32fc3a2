//! Splines over arc length: piecewise polynomials of the arc length itself.
//!
//! A spline is measured once, when it is made: what is kept are not the control points but polynomials that give X, Y
//! and Z by arc length, as close to the curve as a position has to be. Evaluation is then a search and a Horner scheme,
//! derivatives by arc length are those of the polynomials, and every bound follows from their Bernstein coefficients,
//! between whose smallest and largest a polynomial stays. The bounds thus hold for the path that is followed, to rounding.

use feedwave_program::{Axis, Position, SplineGeometry};
use serde::{Deserialize, Serialize};

mod on_grid;

use super::bezier::{Bezier, Weighted};
use super::fit;
use super::polynomial::{Bernstein, COEFFICIENTS, Part, bernstein, halves, raise_to_largest, shifted};
use crate::tolerance::{
    CURVE_BYTES, MAX_SPLINE_DEGREE, MAX_SPLINE_PIECES, SAME_POINT_MM, SPLINE_BEND, SPLINE_BEND_ROUNDING,
    SPLINE_PIECE_BYTES, SPLINE_ROUNDING, SPLINE_STRAIGHT_MM,
};

/// A smooth curve over X, Y and Z by its arc length, mm.
///
/// Positions are within 1e-9 mm of the curve that it was made from, and its tangents are unit vectors to 1e-9.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spline {
    pieces: Vec<Piece>,
    length_mm: f64,
    /// Whether X, Y, Z change anywhere.
    moves: [bool; 3],
}

/// One polynomial per axis of t = (s − start)·per_length, from 0 to 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Piece {
    start: f64,
    length: f64,
    per_length: f64,
    /// X, Y, Z; of t⁰, t¹ and so on.
    coefficients: [[f64; COEFFICIENTS]; 3],
}

impl Piece {
    pub(super) fn new(start: f64, length: f64, coefficients: [[f64; COEFFICIENTS]; 3]) -> Self {
        Self { start, length, per_length: 1.0 / length, coefficients }
    }

    pub(super) fn moved_to(self, start: f64) -> Self {
        Self { start, ..self }
    }

    pub(super) fn end(&self) -> f64 {
        self.start + self.length
    }

    #[inline]
    pub(super) fn value(&self, axis: usize, s: f64) -> f64 {
        let t = (s - self.start) * self.per_length;
        self.coefficients[axis].iter().rev().fold(0.0, |sum, coefficient| sum * t + coefficient)
    }

    #[inline]
    pub(super) fn slope(&self, axis: usize, s: f64) -> f64 {
        let t = (s - self.start) * self.per_length;
        let coefficients = &self.coefficients[axis];
        (1..COEFFICIENTS).rev().fold(0.0, |sum, k| sum * t + k as f64 * coefficients[k]) * self.per_length
    }

    fn second(&self, axis: usize, s: f64) -> f64 {
        let t = (s - self.start) * self.per_length;
        let coefficients = &self.coefficients[axis];
        let sum = (2..COEFFICIENTS).rev().fold(0.0, |sum, k| sum * t + (k * (k - 1)) as f64 * coefficients[k]);
        sum * self.per_length * self.per_length
    }

    /// First, second and third derivative of an axis at an arc length.
    fn derivatives(&self, axis: usize, s: f64) -> [f64; 3] {
        let t = (s - self.start) * self.per_length;
        let (mut first, mut second, mut third) = (0.0, 0.0, 0.0);
        // Horner's scheme of the polynomial with those of its derivatives: second and third end as halves and sixths.
        let mut value = 0.0;
        for &coefficient in self.coefficients[axis].iter().rev() {
            third = third * t + second;
            second = second * t + first;
            first = first * t + value;
            value = value * t + coefficient;
        }
        let per_length = self.per_length;
        let per_square = per_length * per_length;
        [first * per_length, 2.0 * second * per_square, 6.0 * third * (per_square * per_length)]
    }

    /// The part from one arc length to another, by a Taylor shift.
    fn between(&self, from: f64, to: f64) -> Self {
        let (t, share) = ((from - self.start) * self.per_length, (to - from) * self.per_length);
        Self::new(from, to - from, self.coefficients.map(|polynomial| shifted(polynomial, t, share)))
    }

    /// Upper bound of the curvature, 1/mm, over its quarters: the control polygon of the second derivative holds the second
    /// derivative.
    fn curvature(&self) -> f64 {
        let axes: [[Bernstein; 4]; 3] = core::array::from_fn(|axis| {
            let [a, b] = halves(&self.bernstein(axis, 2)).map(|half| halves(&half));
            [a[0], a[1], b[0], b[1]]
        });
        let squares = (0..4).flat_map(|quarter| (0..COEFFICIENTS).map(move |k| (quarter, k))).map(|(quarter, k)| {
            let square: f64 = axes.iter().map(|axis| axis[quarter][k] * axis[quarter][k]).sum();
            square
        });
        squares.fold(0.0, f64::max).sqrt()
    }

    /// See [`bernstein`]; coefficients of higher degree than its own raise a derivative to degree 9.
    fn bernstein(&self, axis: usize, derivative: usize) -> Bernstein {
        bernstein(self.coefficients[axis], derivative, self.per_length)
    }
}

impl Spline {
    /// The curve of a `G5`, `G5.1` or `G5.2`. The axis of X, Y and Z outside its plane moves from `start` to `end` in
    /// proportion to the arc length in the plane, as on a helix.
    ///
    /// `None` where it does not move in its plane, cannot be a NURBS (numbers that are not finite, weights not positive, order
    /// below 2, above 10 or above the number of points), or has a point without a direction: a cusp. Where straight
    /// parts meet in a corner it has the corner; see [`crate::Element::smooth_parts`].
    #[must_use]
    pub fn from_geometry(geometry: &SplineGeometry, start: &Position, end: &Position) -> Option<Self> {
        let count = geometry.points.len();
        let degree = usize::from(geometry.order).checked_sub(1)?;
        if !(1..=MAX_SPLINE_DEGREE).contains(&degree) || degree >= count || geometry.weights.len() != count {
            return None;
        }
        let (first, second) = geometry.plane.axes();
        let normal = geometry.plane.normal().index();
        let (first, second) = (first.index(), second.index());
        let mut weighted = Vec::with_capacity(count);
        for (index, (point, &weight)) in geometry.points.iter().zip(&geometry.weights).enumerate() {
            let [u, v] = match index {
                0 => [start[first], start[second]],
                _ if index == count - 1 => [end[first], end[second]],
                _ => *point,
            };
            let mut at: Weighted = [0.0, 0.0, 0.0, weight];
            at[first] = (u - start[first]) * weight;
            at[second] = (v - start[second]) * weight;
            weighted.push(at);
        }
        let spans = (0..count - degree).map(|index| Bezier::of_nurbs(&weighted, degree, index));
        let mut origin = [0.0; 3];
        origin[first] = start[first];
        origin[second] = start[second];
        let mut spline = Self::from_spans(&origin, spans)?;
        spline.lift(normal, start[normal], end[normal]);
        Some(spline)
    }

    /// A chain of Bézier spans of degree 5 over X, Y and Z, each with its six control points.
    ///
    /// `None` where they do not hang together, do not move, hold a number that is not finite, or have a cusp.
    #[must_use]
    pub fn from_polynomial_spans(spans: &[[[f64; 3]; 6]]) -> Option<Self> {
        Self::from_control_points(spans)
    }

    /// [`Spline::from_polynomial_spans`] of degree 3.
    #[must_use]
    pub fn from_cubic_spans(spans: &[[[f64; 3]; 4]]) -> Option<Self> {
        Self::from_control_points(spans)
    }

    fn from_control_points<const POINTS: usize>(spans: &[[[f64; 3]; POINTS]]) -> Option<Self> {
        let origin = spans.first()?[0];
        let beziers = spans
            .iter()
            .map(|points| Bezier::new(&points.map(|[x, y, z]| [x - origin[0], y - origin[1], z - origin[2], 1.0])));
        let same = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME_POINT_MM);
        if !spans.windows(2).all(|pair| same(&pair[0][POINTS - 1], &pair[1][0])) {
            return None;
        }
        Self::from_spans(&origin, beziers)
    }

    /// The spline of spans relative to `origin`, each of which starts where the one before ends.
    fn from_spans(origin: &[f64; 3], spans: impl ExactSizeIterator<Item = Bezier>) -> Option<Self> {
        if spans.len() > MAX_SPLINE_PIECES {
            return None;
        }
        let mut spans: Vec<Bezier> = spans.collect();
        for k in 1..spans.len() {
            let end = *spans[k - 1].points().last()?;
            spans[k].start_at(end);
        }
        let mut control = spans.iter().flat_map(Bezier::points);
        if !control.all(|point| point.iter().all(|value| value.is_finite()) && point[3] > 0.0) {
            return None;
        }
        let position = |point: &Weighted| [point[0] / point[3], point[1] / point[3], point[2] / point[3]];
        let size_mm = spans
            .iter()
            .flat_map(Bezier::points)
            .flat_map(position)
            .chain(*origin)
            .fold(0.0_f64, |size, value| size.max(value.abs()));
        let mut pieces = [Vec::new()];
        let mut length_mm = 0.0;
        for span in &spans {
            if let Some(piece) = straight(span) {
                // A span that stays where it is adds nothing.
                if piece.length > SPLINE_STRAIGHT_MM {
                    pieces[0].push(piece.moved_to(length_mm));
                    length_mm = pieces[0][pieces[0].len() - 1].end();
                }
            } else {
                length_mm = fit::append(&mut pieces, [span], length_mm, size_mm, 0)?;
            }
        }
        let [pieces] = pieces;
        Self::of_pieces(origin, pieces, length_mm)
    }

    /// A chain of Bézier spans, and by its arc length other coordinates with control points over the same parameters: those have no arc
    /// length of their own. Each span starts where the one before ends.
    ///
    /// `None` where one does not move, holds a number that is not finite, or has a cusp.
    pub(crate) fn with_others<const POINTS: usize>(
        spans: &[[[f64; 3]; POINTS]],
        others: &[[[f64; 3]; POINTS]],
    ) -> Option<[Self; 2]> {
        let values = || spans.iter().chain(others).flatten().flatten();
        if !values().all(|value| value.is_finite()) {
            return None;
        }
        let origins = [spans.first()?[0], others.first()?[0]];
        let size_mm = values().fold(0.0_f64, |size, value| size.max(value.abs()));
        let relative = |points: &[[f64; 3]; POINTS], [x0, y0, z0]: [f64; 3]| {
            Bezier::new(&points.map(|[x, y, z]| [x - x0, y - y0, z - z0, 1.0]))
        };
        let mut pieces = [Vec::new(), Vec::new()];
        let mut length_mm = 0.0;
        for (own, others) in spans.iter().zip(others) {
            let both = [relative(own, origins[0]), relative(others, origins[1])];
            length_mm = fit::append(&mut pieces, [&both[0], &both[1]], length_mm, size_mm, 0)?;
        }
        let [own, others] = pieces;
        Some([Self::of_pieces(&origins[0], own, length_mm)?, Self::of_pieces(&origins[1], others, length_mm)?])
    }

    /// The spline of pieces relative to `origin`.
    fn of_pieces(origin: &[f64; 3], mut pieces: Vec<Piece>, length_mm: f64) -> Option<Self> {
        let mut moves = [false; 3];
        for piece in &mut pieces {
            for axis in 0..3 {
                moves[axis] |= piece.coefficients[axis][1..].iter().any(|&coefficient| coefficient != 0.0);
                piece.coefficients[axis][0] += origin[axis];
            }
        }
        (length_mm > 0.0 && length_mm.is_finite()).then_some(Self { pieces, length_mm, moves })
    }

    /// Moves an axis across the curve's plane in proportion to the arc length.
    fn lift(&mut self, axis: usize, from: f64, to: f64) {
        let per_length = (to - from) / self.length_mm;
        for piece in &mut self.pieces {
            piece.coefficients[axis] = [0.0; COEFFICIENTS];
            piece.coefficients[axis][0] = from + per_length * piece.start;
            piece.coefficients[axis][1] = per_length * piece.length;
        }
        self.moves[axis] = from != to;
        self.lengthen((1.0 + per_length * per_length).sqrt());
    }

    /// Counts `factor` times the arc length: for axes that move beside X, Y and Z.
    pub(super) fn lengthen(&mut self, factor: f64) {
        let mut s = 0.0;
        for piece in &mut self.pieces {
            piece.length *= factor;
            piece.per_length = 1.0 / piece.length;
            piece.start = s;
            s = piece.end();
        }
        self.length_mm = s;
    }

    /// The same curve in other coordinates, whose axes are turned and whose origin is shifted: a point (x, y, z) of it becomes
    /// `origin_mm` + x·`axes[0]` + y·`axes[1]` + z·`axes[2]`, with perpendicular unit vectors.
    #[must_use]
    pub fn placed(&self, axes: &[[f64; 3]; 3], origin_mm: &[f64; 3]) -> Self {
        let mut placed = self.clone();
        placed.moves = [false; 3];
        for (piece, own) in placed.pieces.iter_mut().zip(&self.pieces) {
            for axis in 0..3 {
                for power in 0..COEFFICIENTS {
                    let turned = (0..3).map(|k| axes[k][axis] * own.coefficients[k][power]).sum::<f64>();
                    piece.coefficients[axis][power] = if power == 0 { origin_mm[axis] + turned } else { turned };
                }
                placed.moves[axis] |= piece.coefficients[axis][1..].iter().any(|&coefficient| coefficient != 0.0);
            }
        }
        placed
    }

    /// Arc length, mm.
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        self.length_mm
    }

    /// Polynomial pieces, a measure of what evaluating and keeping it costs.
    #[must_use]
    pub fn piece_count(&self) -> usize {
        self.pieces.len()
    }

    /// Upper bound of the memory that it takes, bytes.
    pub(crate) fn bytes(&self) -> usize {
        CURVE_BYTES + SPLINE_PIECE_BYTES * self.pieces.len()
    }

    /// X, Y and Z at an arc length, mm.
    pub(crate) fn point(&self, s: f64) -> [f64; 3] {
        let s = s.clamp(0.0, self.length_mm);
        core::array::from_fn(|axis| self.pieces[self.piece_at(s)].value(axis, s))
    }

    /// Derivatives of X, Y and Z by arc length there.
    pub(crate) fn slope(&self, s: f64) -> [f64; 3] {
        let s = s.clamp(0.0, self.length_mm);
        core::array::from_fn(|axis| self.pieces[self.piece_at(s)].slope(axis, s))
    }

    /// Arc lengths at which polynomial pieces meet.
    pub(crate) fn meetings(&self) -> impl Iterator<Item = f64> + '_ {
        self.pieces.iter().skip(1).map(|piece| piece.start)
    }

    /// X, Y and Z about `middle` within one polynomial piece, as coefficients of u with s = middle + half·u.
    pub(crate) fn about(&self, middle: f64, half: f64) -> [[f64; COEFFICIENTS]; 3] {
        // From 0 to 1 along the stretch to −1 to 1: t = ½ + ½·u.
        let stretch = self.pieces[self.piece_at(middle)].between(middle - half, middle + half);
        stretch.coefficients.map(|polynomial| shifted(polynomial, 0.5, 0.5))
    }

    /// First and last point: X, Y, Z, mm.
    #[must_use]
    pub fn ends(&self) -> [[f64; 3]; 2] {
        [0.0, self.length_mm].map(|s| core::array::from_fn(|axis| self.pieces[self.piece_at(s)].value(axis, s)))
    }

    /// Whether this is one of the axes of a spline.
    pub(crate) fn has(axis: Axis) -> bool {
        axis.index() < 3
    }

    pub(super) fn moves(&self, axis: Axis) -> bool {
        Self::has(axis) && self.moves[axis.index()]
    }

    fn piece_at(&self, s: f64) -> usize {
        self.pieces.partition_point(|piece| piece.start <= s).saturating_sub(1)
    }

    fn fill(&self, s: &[f64], out: &mut [f64], evaluate: impl Fn(&Piece, f64) -> f64) {
        let mut index = 0;
        // Where the piece ends, taken from the start of the next so that every arc length belongs to one piece.
        let end_of = |index: usize| self.pieces.get(index + 1).map_or(f64::INFINITY, |next| next.start);
        let mut end = end_of(0);
        for (out, &s) in out.iter_mut().zip(s) {
            let s = s.clamp(0.0, self.length_mm);
            if s < self.pieces[index].start || s >= end {
                index = self.piece_at(s);
                end = end_of(index);
            }
            *out = evaluate(&self.pieces[index], s);
        }
    }

    pub(super) fn fill_axis(&self, axis: Axis, s: &[f64], out: &mut [f64]) {
        self.fill(s, out, |piece, s| piece.value(axis.index(), s));
    }

    pub(super) fn fill_tangent(&self, axis: Axis, s: &[f64], out: &mut [f64]) {
        self.fill(s, out, |piece, s| piece.slope(axis.index(), s));
    }

    pub(super) fn second_derivative(&self, s: f64) -> [f64; 3] {
        let s = s.clamp(0.0, self.length_mm);
        let piece = &self.pieces[self.piece_at(s)];
        core::array::from_fn(|axis| piece.second(axis, s))
    }

    /// First, second and third derivatives of X, Y and Z.
    pub(super) fn derivatives(&self, s: f64) -> [[f64; 3]; 3] {
        let s = s.clamp(0.0, self.length_mm);
        let piece = &self.pieces[self.piece_at(s)];
        let by_axis: [[f64; 3]; 3] = core::array::from_fn(|axis| piece.derivatives(axis, s));
        core::array::from_fn(|order| core::array::from_fn(|axis| by_axis[axis][order]))
    }

    /// Adds the arc lengths between two where polynomials meet: third derivatives may jump there.
    pub(super) fn add_breaks(&self, from: f64, to: f64, out: &mut Vec<f64>) {
        let first = self.pieces.partition_point(|piece| piece.start <= from);
        out.extend(self.pieces[first..].iter().map(|piece| piece.start).take_while(|&start| start < to));
    }

    /// Smallest and largest position of an axis.
    pub(super) fn extent(&self, axis: Axis) -> [f64; 2] {
        let (mut highest, mut lowest) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        for piece in &self.pieces {
            let polynomial = piece.bernstein(axis.index(), 0);
            raise_to_largest(&polynomial, &mut highest, 0);
            raise_to_largest(&polynomial.map(|value| -value), &mut lowest, 0);
        }
        [-lowest, highest]
    }

    /// Largest |derivative by arc length| per axis.
    pub(super) fn largest_tangent(&self) -> [f64; 3] {
        core::array::from_fn(|axis| {
            let mut largest = 0.0;
            for piece in &self.pieces {
                let polynomial = piece.bernstein(axis, 1);
                raise_to_largest(&polynomial, &mut largest, 0);
                raise_to_largest(&polynomial.map(|value| -value), &mut largest, 0);
            }
            largest
        })
    }

    /// Upper bound of the curvature, 1/mm.
    pub(super) fn curvature(&self) -> f64 {
        self.curvatures().fold(0.0, |largest, (_, curvature)| largest.max(curvature))
    }

    /// The arc length where each piece ends, and an upper bound of its curvature, 1/mm.
    pub(crate) fn curvatures(&self) -> impl Iterator<Item = (f64, f64)> {
        self.pieces.iter().map(|piece| (piece.end(), piece.curvature()))
    }

    /// The pieces by their tangents.
    pub(crate) fn parts(&self) -> impl Iterator<Item = Part<3>> {
        self.pieces
            .iter()
            .map(|piece| Part::new(piece.end(), piece.length, core::array::from_fn(|axis| piece.bernstein(axis, 1))))
    }

    /// Arc lengths inside where direction or curvature jump by more than rounding.
    ///
    /// Pieces round positions, so that their derivatives by arc length are off by that rounding over their length, once for
    /// each derivative: in sharp turns, where pieces are short, and where curvature passes through zero, that is more than
    /// a share of the derivatives themselves.
    pub(super) fn bends(&self) -> impl Iterator<Item = f64> {
        let jumps = |[before, after]: [f64; 2], (jump, scale): (f64, f64)| {
            (jump + (after - before) * (after - before), scale.max(before * before).max(after * after))
        };
        let places = self.pieces.iter().flat_map(|piece| &piece.coefficients).map(|axis| axis[0].abs());
        let rounding = SPLINE_BEND_ROUNDING * SPLINE_ROUNDING * places.fold(0.0, f64::max);
        self.pieces.windows(2).filter_map(move |pair| {
            let s = pair[1].start;
            let at = |evaluate: fn(&Piece, usize, f64) -> f64| {
                (0..3)
                    .map(|axis| [0, 1].map(|k| evaluate(&pair[k], axis, s)))
                    .fold((0.0, 0.0), |sum, both| jumps(both, sum))
            };
            let per_length = pair[0].per_length.max(pair[1].per_length);
            let (kink, _) = at(Piece::slope);
            let (bend, curvature) = at(Piece::second);
            let allowed_kink = SPLINE_BEND + rounding * per_length;
            let allowed_bend = SPLINE_BEND * (curvature.sqrt() + SPLINE_BEND) + rounding * per_length * per_length;
            (kink.sqrt() > allowed_kink || bend.sqrt() > allowed_bend).then_some(s)
        })
    }

    /// The part from arc length `from` to `to`; `None` where nothing is left.
    pub(crate) fn between(&self, from: f64, to: f64) -> Option<Self> {
        let mut s = 0.0;
        let mut pieces = Vec::new();
        for piece in &self.pieces {
            let (from, to) = (from.max(piece.start), to.min(piece.end()));
            if from < to {
                let part = if from > piece.start || to < piece.end() { piece.between(from, to) } else { piece.clone() };
                pieces.push(part.moved_to(s));
                s = pieces[pieces.len() - 1].end();
            }
        }
        (s > 0.0).then_some(Self { pieces, length_mm: s, moves: self.moves })
    }
}

/// The only piece of a span whose control points lie on a straight line in their order; its length may be 0.
fn straight(span: &Bezier) -> Option<Piece> {
    let points = span.points();
    let position = |point: &Weighted| [point[0] / point[3], point[1] / point[3], point[2] / point[3]];
    let (start, end) = (position(&points[0]), position(&points[points.len() - 1]));
    let chord: [f64; 3] = core::array::from_fn(|k| end[k] - start[k]);
    let length = chord.iter().map(|value| value * value).sum::<f64>().sqrt();
    let direction = chord.map(|value| if length > 0.0 { value / length } else { 0.0 });
    let mut reached = 0.0;
    for point in points {
        let from_start: [f64; 3] = core::array::from_fn(|k| position(point)[k] - start[k]);
        let along: f64 = from_start.iter().zip(direction).map(|(a, b)| a * b).sum();
        let beside = (0..3).map(|k| (from_start[k] - along * direction[k]).abs()).fold(0.0, f64::max);
        let fits = beside <= SPLINE_STRAIGHT_MM && along >= reached - SPLINE_STRAIGHT_MM;
        if !fits {
            return None;
        }
        reached = reached.max(along);
    }
    let mut coefficients = [[0.0; COEFFICIENTS]; 3];
    for axis in 0..3 {
        coefficients[axis][0] = start[axis];
        coefficients[axis][1] = chord[axis];
    }
    (reached <= length + SPLINE_STRAIGHT_MM).then(|| Piece::new(0.0, length, coefficients))
}
