//! Path elements: lines, arcs, helices, splines and five-axis motion over arc length.

use core::f64::consts::TAU;

use feedwave_program::{AXIS_COUNT, Axis, Move, MoveKind, Position, SourceSpan, straight_length};
use serde::{Deserialize, Serialize};
use smallvec::{SmallVec, smallvec};

use crate::kinematics::TipPath;
use crate::sin_turns;
use crate::tolerance::SAME_POINT_MM;

mod arc;
mod bezier;
mod fit;
mod five_axis;
mod polynomial;
mod spiral;
mod spline;
mod turning;

pub use arc::Arc;
pub use five_axis::FiveAxis;
pub(crate) use five_axis::FiveAxisPiece;
pub(crate) use polynomial::{COEFFICIENTS, Part};
pub use spline::Spline;
pub use turning::Turning;

/// One element of the path, in work coordinates (under five-axis motion in those of the chain of axes), over its arc length
/// `s` from 0 to `length`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Element {
    /// First point, mm (X a radius) and degrees.
    pub start: Position,
    /// Last point: the programmed one.
    pub end: Position,
    /// Machine position = work position + offset.
    pub work_offset: Position,
    /// Shape between them.
    pub curve: Curve,
    /// Arc length of the linear axes, under five-axis motion of the tool centre point, mm; when it rests, of the rotary axes or
    /// the tool direction, degrees.
    pub length: f64,
    /// Words that ask for it.
    pub source: SourceSpan,
    /// Whether it is a rapid.
    pub rapid: bool,
}

/// Shape of an element.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Curve {
    /// Straight.
    Line,
    /// Circular in a plane; every other axis moves in proportion to the angle.
    Arc(Arc),
    /// Free in X, Y and Z; every other axis moves in proportion to the arc length.
    Spline(Box<Spline>),
    /// Straight or an arc for the tool centre point on the workpiece (or the curve at a corner) while the tool direction turns;
    /// start and end are those of the machine's axes. Every axis beside the chain moves in proportion to the arc length.
    FiveAxis(Box<FiveAxis>),
}

impl Element {
    /// The element of a move; `None` where nothing moves, and for a spline that is none: see [`Spline::from_geometry`]. A
    /// spline whose points are all the same is the straight move of the other axes.
    #[must_use]
    pub fn from_move(mv: &Move, source: SourceSpan) -> Option<Self> {
        let rapid = mv.kind == MoveKind::Rapid;
        let (curve, length) = match (&mv.arc, &mv.spline) {
            (_, Some(geometry)) if geometry.points.iter().any(|point| *point != geometry.points[0]) => {
                let spline = Spline::from_geometry(geometry, &mv.start, &mv.end)?;
                return Self::from_spline(mv.start, mv.end, spline, mv.work_offset, source, rapid);
            }
            (None, _) => (Curve::Line, straight_length(&mv.start, &mv.end)),
            (Some(geometry), _) => {
                let mut arc = Arc::new(geometry, &mv.start, &mv.end);
                let mut beside_square = 0.0;
                for axis in Axis::ALL {
                    if !axis.is_rotary() && axis != arc.first && axis != arc.second {
                        let delta = mv.end[axis.index()] - mv.start[axis.index()];
                        beside_square += delta * delta;
                    }
                }
                let length_mm = arc.measure(beside_square);
                (Curve::Arc(arc), length_mm)
            }
        };
        (length > 0.0 && length.is_finite()).then_some(Self {
            start: mv.start,
            end: mv.end,
            work_offset: mv.work_offset,
            curve,
            length,
            source,
            rapid,
        })
    }

    /// The element of a spline; every axis but X, Y and Z moves from `start` to `end` in proportion to its arc length.
    /// `None` when the spline does not run from `start` to `end`, to 1e-9 mm.
    #[must_use]
    pub fn from_spline(
        start: Position,
        end: Position,
        mut spline: Spline,
        work_offset: Position,
        source: SourceSpan,
        rapid: bool,
    ) -> Option<Self> {
        let same = |a: &Position, b: &[f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME_POINT_MM);
        let [first, last] = spline.ends();
        if !same(&start, &first) || !same(&end, &last) {
            return None;
        }
        let beside = Axis::ALL.into_iter().filter(|&axis| !axis.is_rotary() && !Spline::has(axis));
        let square: f64 = beside.map(|axis| end[axis.index()] - start[axis.index()]).map(|delta| delta * delta).sum();
        if square > 0.0 {
            spline.lengthen((1.0 + square / (spline.length_mm() * spline.length_mm())).sqrt());
        }
        let length = spline.length_mm();
        let curve = Curve::Spline(Box::new(spline));
        length.is_finite().then_some(Self { start, end, work_offset, curve, length, source, rapid })
    }

    /// The element in parts within which direction and curvature are continuous: itself, but for a spline that has
    /// corners or steps of curvature where its spans meet. What such a step allows is decided between elements.
    #[must_use]
    pub fn smooth_parts(self) -> SmallVec<[Self; 1]> {
        let Curve::Spline(spline) = &self.curve else { return smallvec![self] };
        let mut parts = SmallVec::new();
        let mut from = 0.0;
        for to in spline.bends().chain([self.length]) {
            if let Some(part) = spline.between(from, to) {
                let (start, end) = (self.position(from), self.position(to));
                let length = part.length_mm();
                let curve = Curve::Spline(Box::new(part));
                parts.push(Self { start, end, curve, length, ..self });
            }
            from = to;
        }
        parts
    }

    /// Upper bound of the memory that its curve takes besides itself, bytes.
    pub(crate) fn curve_bytes(&self) -> usize {
        match &self.curve {
            Curve::Line | Curve::Arc(_) => 0,
            Curve::Spline(spline) => spline.bytes(),
            Curve::FiveAxis(five_axis) => five_axis.bytes(),
        }
    }

    /// Position at arc length `s`; the exact start for `s` ≤ 0, the exact programmed end for `s` ≥ `length`.
    #[must_use]
    pub fn position(&self, s: f64) -> Position {
        let mut position = [0.0; AXIS_COUNT];
        for axis in Axis::ALL {
            self.fill_axis(axis, &[s], core::slice::from_mut(&mut position[axis.index()]));
        }
        position
    }

    /// Positions of one axis at the arc lengths `s`, bit for bit those of [`Element::position`].
    ///
    /// # Panics
    /// When `out` is shorter than `s`.
    pub fn fill_axis(&self, axis: Axis, s: &[f64], out: &mut [f64]) {
        let out = &mut out[..s.len()];
        match self.spiral() {
            None => self.fill_axis_evenly(axis, s, out),
            Some(arc) => self.for_evened(arc, s, out, |even, out| self.fill_axis_evenly(axis, even, out)),
        }
    }

    fn fill_axis_evenly(&self, axis: Axis, s: &[f64], out: &mut [f64]) {
        let start = self.start[axis.index()];
        let end = self.end[axis.index()];
        let per_length = 1.0 / self.length;
        match &self.curve {
            Curve::Arc(arc) if axis == arc.first || axis == arc.second => {
                let center = arc.center[usize::from(axis == arc.second)];
                // In turns the loops have no call and no branch: they vectorise. A cosine runs a quarter ahead of a sine.
                let quarter_turns = if axis == arc.first { 0.25 } else { 0.0 };
                let start_turns = arc.start_angle_rad / TAU;
                let sweep_turns = arc.sweep_rad / TAU;
                if arc.is_huge() {
                    // From the start instead of the centre, by cos(a + θ) − cos a = −2·sin(θ/2)·sin(a + θ/2) and the
                    // like for the sine: then rounding is relative to the length, not to the radius.
                    let growth_mm = arc.end_radius_mm - arc.start_radius_mm;
                    for (out, &s) in out.iter_mut().zip(s) {
                        let share = s * per_length;
                        let half_turns = 0.5 * sweep_turns * share;
                        let chord_mm = 2.0 * arc.start_radius_mm * sin_turns(half_turns);
                        let across = sin_turns(start_turns + half_turns + (quarter_turns + 0.25));
                        *out = start + chord_mm * across;
                    }
                    if growth_mm != 0.0 {
                        for (out, &s) in out.iter_mut().zip(s) {
                            let share = s * per_length;
                            let circular = sin_turns(start_turns + sweep_turns * share + quarter_turns);
                            *out += growth_mm * share * circular;
                        }
                    }
                } else {
                    for (out, &s) in out.iter_mut().zip(s) {
                        let share = s * per_length;
                        let circular = sin_turns(start_turns + sweep_turns * share + quarter_turns);
                        *out = center + arc.radius_mm(share) * circular;
                    }
                }
            }
            Curve::Spline(spline) if Spline::has(axis) => spline.fill_axis(axis, s, out),
            Curve::FiveAxis(five_axis) if five_axis.has(axis) => five_axis.fill_axis(axis, s, out),
            _ => {
                let slope = (end - start) * per_length;
                for (out, &s) in out.iter_mut().zip(s) {
                    *out = start + slope * s;
                }
            }
        }
        for (out, &s) in out.iter_mut().zip(s) {
            *out = if s <= 0.0 { start } else { *out };
            *out = if s >= self.length { end } else { *out };
        }
    }

    /// [`Element::fill_axis`] in work coordinates: under five-axis motion X, Y and Z are those of the tool centre point. The
    /// rotary axes, and every axis of other elements, are the same.
    ///
    /// # Panics
    /// When `out` is shorter than `s`.
    pub fn fill_work_axis(&self, axis: Axis, s: &[f64], out: &mut [f64]) {
        match &self.curve {
            Curve::FiveAxis(five_axis) if axis.index() < 3 => {
                let [start, end] = five_axis.tip().ends().map(|tip_mm| tip_mm[axis.index()]);
                let slope = (end - start) / self.length;
                let is_straight = matches!(five_axis.tip(), TipPath::Line(_));
                for (out, &s) in out[..s.len()].iter_mut().zip(s) {
                    let s = s.max(0.0);
                    let inside =
                        if is_straight { start + slope * s } else { five_axis.tip().at(s / self.length)[axis.index()] };
                    *out = if s >= self.length { end } else { inside };
                }
            }
            _ => self.fill_axis(axis, s, out),
        }
    }

    /// [`Element::fill_tangent`] in work coordinates, as [`Element::fill_work_axis`] has them.
    ///
    /// # Panics
    /// When `out` is shorter than `s`.
    pub fn fill_work_tangent(&self, axis: Axis, s: &[f64], out: &mut [f64]) {
        match &self.curve {
            Curve::FiveAxis(five_axis) if axis.index() < 3 => {
                for (out, &s) in out[..s.len()].iter_mut().zip(s) {
                    *out = five_axis.tip().slope(s / self.length)[axis.index()] / self.length;
                }
            }
            _ => self.fill_tangent(axis, s, out),
        }
    }

    /// Whether the element moves this axis.
    #[must_use]
    pub fn moves(&self, axis: Axis) -> bool {
        self.start[axis.index()] != self.end[axis.index()]
            || match &self.curve {
                Curve::Line => false,
                Curve::Arc(arc) => arc.first == axis || arc.second == axis,
                Curve::Spline(spline) => spline.moves(axis),
                Curve::FiveAxis(five_axis) => five_axis.moves(axis),
            }
    }

    /// Derivative of the position by arc length at `s`, per axis.
    #[must_use]
    pub fn tangent(&self, s: f64) -> Position {
        let per_length = 1.0 / self.length;
        let mut tangent = core::array::from_fn(|axis| (self.end[axis] - self.start[axis]) * per_length);
        if matches!(self.curve, Curve::Line) {
            return tangent;
        }
        for axis in Axis::ALL {
            self.fill_tangent(axis, &[s], core::slice::from_mut(&mut tangent[axis.index()]));
        }
        tangent
    }

    /// Derivatives of one axis by arc length at the arc lengths `s`, bit for bit those of [`Element::tangent`].
    ///
    /// # Panics
    /// When `out` is shorter than `s`.
    pub fn fill_tangent(&self, axis: Axis, s: &[f64], out: &mut [f64]) {
        let out = &mut out[..s.len()];
        let Some(arc) = self.spiral() else { return self.fill_tangent_evenly(axis, s, out) };
        self.for_evened(arc, s, out, |even, out| {
            self.fill_tangent_evenly(axis, even, out);
            for (out, even) in out.iter_mut().zip(even) {
                *out *= arc.evenness(even.clamp(0.0, self.length) / self.length, self.length)[0];
            }
        });
    }

    fn fill_tangent_evenly(&self, axis: Axis, s: &[f64], out: &mut [f64]) {
        let per_length = 1.0 / self.length;
        let arc = match &self.curve {
            Curve::Arc(arc) if axis == arc.first || axis == arc.second => arc,
            Curve::Spline(spline) if Spline::has(axis) => return spline.fill_tangent(axis, s, out),
            Curve::FiveAxis(five_axis) if five_axis.has(axis) => return five_axis.fill_tangent(axis, s, out),
            _ => {
                out.fill((self.end[axis.index()] - self.start[axis.index()]) * per_length);
                return;
            }
        };
        // Along the circle the first axis follows −sin and the second cos; outwards cos and sin.
        type Function = fn(f64) -> f64;
        let [around, beside]: [Function; 2] =
            if axis == arc.first { [|angle_rad| -libm::sin(angle_rad), libm::cos] } else { [libm::cos, libm::sin] };
        let outwards = (arc.end_radius_mm - arc.start_radius_mm) * per_length;
        for (out, &s) in out.iter_mut().zip(s) {
            let share = s.clamp(0.0, self.length) * per_length;
            let angle_rad = arc.start_angle_rad + arc.sweep_rad * share;
            let along = arc.radius_mm(share) * arc.sweep_rad * per_length;
            *out = along * around(angle_rad);
            if outwards != 0.0 {
                *out += outwards * beside(angle_rad);
            }
        }
    }

    /// Second derivative of the position by arc length at `s`, per axis, 1/mm: curvature times normal.
    #[must_use]
    pub fn second_derivative(&self, s: f64) -> Position {
        let mut second = [0.0; AXIS_COUNT];
        match &self.curve {
            Curve::Line => {}
            Curve::Spline(spline) => second[..3].copy_from_slice(&spline.second_derivative(s)),
            Curve::FiveAxis(five_axis) => {
                for (place, axis) in five_axis.axes().iter().enumerate() {
                    second[axis.index()] = five_axis.second_derivative(place, s);
                }
            }
            Curve::Arc(_) => second = self.derivatives(s)[1],
        }
        second
    }

    /// First, second and third derivatives of the position by arc length at `s`, per axis: of millimetres or degrees by mm, mm²
    /// and mm³. The third is 0 along a line.
    #[must_use]
    pub fn derivatives(&self, s: f64) -> [Position; 3] {
        let per_length = 1.0 / self.length;
        let mut first: Position = core::array::from_fn(|axis| (self.end[axis] - self.start[axis]) * per_length);
        let (mut second, mut third) = ([0.0; AXIS_COUNT], [0.0; AXIS_COUNT]);
        match &self.curve {
            Curve::Line => {}
            Curve::Spline(spline) => {
                let own = spline.derivatives(s);
                for (all, own) in [&mut first, &mut second, &mut third].into_iter().zip(own) {
                    all[..3].copy_from_slice(&own);
                }
            }
            Curve::FiveAxis(five_axis) => {
                for (place, axis) in five_axis.axes().iter().enumerate() {
                    let axis = axis.index();
                    [first[axis], second[axis], third[axis]] = five_axis.derivatives(place, s);
                }
            }
            Curve::Arc(arc) => {
                let share = arc.sweep_share(s.clamp(0.0, self.length) * per_length);
                let (sin, cos) = libm::sincos(arc.start_angle_rad + arc.sweep_rad * share);
                let turn = arc.sweep_rad * per_length;
                let outwards = (arc.end_radius_mm - arc.start_radius_mm) * per_length;
                let radius_mm = arc.radius_mm(share);
                // In polar form with the direction outwards e and e' = turn·e⊥; the radius changes linearly.
                for (axis, out, across) in [(arc.first.index(), cos, -sin), (arc.second.index(), sin, cos)] {
                    first[axis] = outwards * out + radius_mm * turn * across;
                    second[axis] = 2.0 * outwards * turn * across - radius_mm * turn * turn * out;
                    third[axis] = -turn * turn * (3.0 * outwards * out + radius_mm * turn * across);
                }
                if arc.is_spiral() {
                    // Of what is evenly turned, by the arc length.
                    let [slope, bend, change] = arc.evenness(share, self.length);
                    for axis in 0..AXIS_COUNT {
                        let even = [first[axis], second[axis], third[axis]];
                        first[axis] = even[0] * slope;
                        second[axis] = even[1] * slope * slope + even[0] * bend;
                        third[axis] = even[2] * slope * slope * slope + 3.0 * even[1] * slope * bend + even[0] * change;
                    }
                }
            }
        }
        [first, second, third]
    }

    /// Adds the arc lengths between two at which its third derivatives may jump.
    pub(crate) fn add_breaks(&self, from: f64, to: f64, out: &mut Vec<f64>) {
        if let Curve::Spline(spline) = &self.curve {
            spline.add_breaks(from, to, out);
        }
    }

    /// Largest curvature on the workpiece, 1/mm: 0 for a line and under five-axis motion, r/(r² + p²) for a helix of radius r
    /// that advances p per radian, a close upper bound for a spline.
    #[must_use]
    pub fn curvature(&self) -> f64 {
        match &self.curve {
            Curve::Line | Curve::FiveAxis(_) => 0.0,
            Curve::Arc(arc) => {
                let per_length = arc.fastest_turn(self.length);
                // κ = r·(dθ/ds)², at most that of the largest r at the fastest turn.
                arc.largest_radius_mm() * per_length * per_length
            }
            Curve::Spline(spline) => spline.curvature(),
        }
    }

    /// Upper bound of |tangent| per axis over the whole element; attained for all but inexact arcs.
    #[must_use]
    pub fn largest_tangent(&self) -> Position {
        let mut largest = self.tangent(0.0).map(f64::abs);
        if let Curve::Spline(spline) = &self.curve {
            largest[..3].copy_from_slice(&spline.largest_tangent());
        }
        if let Curve::FiveAxis(five_axis) = &self.curve {
            for (place, axis) in five_axis.axes().iter().enumerate() {
                largest[axis.index()] = five_axis.largest_tangent(place);
            }
        }
        if let Curve::Arc(arc) = &self.curve {
            // Beside the plane an axis goes evenly, on a spiral fastest at one of the ends.
            for (value, at_end) in largest.iter_mut().zip(self.tangent(self.length)) {
                *value = value.max(at_end.abs());
            }
            let along = arc.most_along(self.length);
            let outwards = arc.most_outwards(self.length);
            let quarter = TAU / 4.0;
            // The first axis moves fastest where the arc passes the second axis' direction, and vice versa.
            for (axis, passing) in [(arc.first, [quarter, -quarter]), (arc.second, [0.0, 2.0 * quarter])] {
                let value = &mut largest[axis.index()];
                if passing.iter().any(|&angle_rad| arc.passes(angle_rad)) {
                    *value = along + outwards;
                }
            }
        }
        largest
    }

    /// Smallest and largest distance from the spindle axis, |X|, mm.
    #[must_use]
    pub fn radius_range_mm(&self) -> [f64; 2] {
        let (low, high) = self.extent();
        let (low, high) = (low[Axis::X.index()], high[Axis::X.index()]);
        let crosses_axis = low <= 0.0 && high >= 0.0;
        [if crosses_axis { 0.0 } else { low.abs().min(high.abs()) }, low.abs().max(high.abs())]
    }

    /// Smallest and largest position per axis over the element, work coordinates.
    #[must_use]
    pub fn extent(&self) -> (Position, Position) {
        let mut low = self.start;
        let mut high = self.start;
        for (index, &end) in self.end.iter().enumerate() {
            low[index] = low[index].min(end);
            high[index] = high[index].max(end);
        }
        if let Curve::Spline(spline) = &self.curve {
            for axis in Axis::ALL.into_iter().filter(|&axis| spline.moves(axis)) {
                let [lowest, highest] = spline.extent(axis);
                low[axis.index()] = low[axis.index()].min(lowest);
                high[axis.index()] = high[axis.index()].max(highest);
            }
        }
        if let Curve::FiveAxis(five_axis) = &self.curve {
            for (place, axis) in five_axis.axes().iter().enumerate() {
                let [lowest, highest] = five_axis.extent(place);
                low[axis.index()] = low[axis.index()].min(lowest);
                high[axis.index()] = high[axis.index()].max(highest);
            }
        }
        if let Curve::Arc(arc) = &self.curve {
            let quarter = TAU / 4.0;
            let radius_mm = arc.largest_radius_mm();
            for (axis, center, angles) in
                [(arc.first, arc.center[0], [0.0, 2.0 * quarter]), (arc.second, arc.center[1], [quarter, -quarter])]
            {
                if arc.passes(angles[0]) {
                    high[axis.index()] = high[axis.index()].max(center + radius_mm);
                }
                if arc.passes(angles[1]) {
                    low[axis.index()] = low[axis.index()].min(center - radius_mm);
                }
            }
        }
        (low, high)
    }
}
