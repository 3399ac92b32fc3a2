//! Five-axis elements: the tool centre point goes straight or along an arc in work coordinates (or rounds a corner), and the
//! machine's axes follow.
//!
//! As with splines, an element is solved once, when it is made (see `kinematics::path`): what is kept are polynomials
//! that give the axes of the chain by the tool centre point's arc length. They hold the tool centre point on its path
//! to 1e-9 mm. Evaluation is a search and a Horner scheme whatever the machine, every setpoint is a function of its place
//! alone, and bounds of all derivatives follow from Bernstein coefficients. Where the tool centre point rests, the length is
//! the angle that the direction turns, degrees.

use feedwave_program::Axis;
use serde::{Deserialize, Serialize};

use super::Turning;
use super::polynomial::{Bernstein, COEFFICIENTS, Part, bernstein, raise_to_largest, shifted};
use crate::kinematics::TipPath;
use crate::kinematics::{FiveAxisRefusal, KinematicsError, Setup};
use crate::tolerance::{
    CURVE_BYTES, FIVE_AXIS_NOTHING, FIVE_AXIS_PIECE_BYTES, FIVE_AXIS_POWER_BYTES, SAME_START_MM, SAME_START_RAD,
};

/// Axes of a chain.
pub(crate) const CHAIN: usize = 5;

/// Motion of the five axes of a chain, in the chain's sense: three linear ones, mm, and two rotary ones, degrees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FiveAxis {
    axes: [Axis; CHAIN],
    /// In order; each starts where the one before ends.
    pieces: Vec<FiveAxisPiece>,
    tip: TipPath,
    /// Where the work lies and how long the tool is.
    setup: Setup,
    moves: [bool; CHAIN],
}

/// One polynomial per axis of t = (s − middle)/half, from −1 to 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct FiveAxisPiece {
    middle: f64,
    half: f64,
    /// Coefficients of the axes, by power of t; no more powers than count.
    powers: Vec<[f64; CHAIN]>,
}

impl FiveAxisPiece {
    /// A piece from the coefficients of each axis. However short it is, it says how fast they move: a piece on which nothing does has no
    /// limit of the speed.
    pub(crate) fn new<const N: usize>(middle: f64, half: f64, axes: [[f64; N]; CHAIN]) -> Self {
        let count = (0..N)
            .rev()
            .find(|&k| axes.iter().any(|axis| axis[k].abs() > FIVE_AXIS_NOTHING))
            .map_or(0, |k| k + 1)
            .max(2);
        let powers = (0..count).map(|k| axes.map(|axis| axis[k])).collect();
        Self { middle, half, powers }
    }

    /// The part from one arc length to another.
    fn between(&self, from: f64, to: f64) -> Self {
        let (place, share) = ((0.5 * (from + to) - self.middle) / self.half, 0.5 * (to - from) / self.half);
        let axes = core::array::from_fn(|axis| shifted(self.of(axis), place, share));
        Self::new(0.5 * (from + to), 0.5 * (to - from), axes)
    }

    fn end(&self) -> f64 {
        self.middle + self.half
    }

    fn start(&self) -> f64 {
        self.middle - self.half
    }

    /// Coefficients of an axis, filled up with zeros.
    fn of(&self, axis: usize) -> [f64; COEFFICIENTS] {
        let mut coefficients = [0.0; COEFFICIENTS];
        for (coefficient, power) in coefficients.iter_mut().zip(&self.powers) {
            *coefficient = power[axis];
        }
        coefficients
    }

    /// Coefficients of the derivative of an axis by arc length.
    fn slope_of(&self, axis: usize) -> [f64; COEFFICIENTS] {
        let mut coefficients = self.of(axis);
        for k in 1..COEFFICIENTS {
            coefficients[k - 1] = coefficients[k] * (k as f64 / self.half);
        }
        coefficients[COEFFICIENTS - 1] = 0.0;
        coefficients
    }

    /// The polynomial of an axis from 0 to 1 along the piece, by a Taylor shift to its start.
    fn on_unit(&self, axis: usize) -> [f64; COEFFICIENTS] {
        let mut coefficients = self.of(axis);
        for lowest in 0..COEFFICIENTS - 1 {
            for k in (lowest..COEFFICIENTS - 1).rev() {
                coefficients[k] -= coefficients[k + 1];
            }
        }
        let mut power = 1.0;
        for coefficient in &mut coefficients {
            *coefficient *= power;
            power *= 2.0;
        }
        coefficients
    }

    /// Upper bound of how fast both rotary axes turn together, rad by arc length.
    fn rotary_rad_per_mm(&self) -> f64 {
        let of = |axis| self.bernstein(axis, 1).iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        (of(CHAIN - 2) + of(CHAIN - 1)).to_radians()
    }

    fn bernstein(&self, axis: usize, derivative: usize) -> Bernstein {
        bernstein(self.on_unit(axis), derivative, 0.5 / self.half)
    }
}

fn horner(coefficients: &[f64], t: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * t + coefficient)
}

impl FiveAxis {
    pub(crate) fn new(axes: [Axis; CHAIN], pieces: Vec<FiveAxisPiece>, tip: TipPath, setup: Setup) -> Self {
        let moved = |axis: usize| pieces.iter().any(|piece| piece.powers[1..].iter().any(|power| power[axis] != 0.0));
        let moves = core::array::from_fn(moved);
        Self { axes, pieces, tip, setup, moves }
    }

    /// The axes of the chain: the linear ones, then the rotary ones, each from the work to the tool.
    #[must_use]
    pub const fn axes(&self) -> &[Axis; CHAIN] {
        &self.axes
    }

    /// Path of the tool centre point.
    #[must_use]
    pub const fn tip(&self) -> &TipPath {
        &self.tip
    }

    /// The part of a straight one from arc length `from` to `to`; `None` where nothing is left, and of every other path.
    pub(crate) fn between(&self, from: f64, to: f64) -> Option<Self> {
        let length = self.length();
        let TipPath::Line([start, end]) = self.tip else { return None };
        let mut pieces = Vec::new();
        for piece in &self.pieces {
            let (first, last) = (from.max(piece.start()), to.min(piece.end()));
            if first < last {
                let part = piece.between(first, last);
                pieces.push(FiveAxisPiece { middle: part.middle - from, ..part });
            }
        }
        let at = |s: f64| match s {
            s if s <= 0.0 => start,
            s if s >= length => end,
            s => self.tip.at(s / length),
        };
        let tip = TipPath::Line([at(from), at(to)]);
        (!pieces.is_empty() && (start != end || self.tip.rests())).then(|| Self { pieces, tip, ..self.clone() })
    }

    /// Lengths of the first and of the last piece.
    pub(crate) fn end_pieces(&self) -> [f64; 2] {
        [self.pieces.first(), self.pieces.last()].map(|piece| piece.map_or(0.0, |piece| 2.0 * piece.half))
    }

    /// The polynomials of both rotary axes, degrees, on the piece at a place: its middle, half of its length, and the coefficients by
    /// powers of t.
    pub(crate) fn rotary_about(&self, s: f64) -> (f64, f64, [[f64; COEFFICIENTS]; 2]) {
        let piece = &self.pieces[self.piece_at(s)];
        (piece.middle, piece.half, [CHAIN - 2, CHAIN - 1].map(|axis| piece.of(axis)))
    }

    /// Where the work lies, and how long the tool is.
    #[must_use]
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Polynomial pieces, a measure of what evaluating and keeping it costs.
    #[must_use]
    pub fn piece_count(&self) -> usize {
        self.pieces.len()
    }

    /// Upper bound of the memory that it takes, bytes.
    pub(crate) fn bytes(&self) -> usize {
        let piece = |piece: &FiveAxisPiece| FIVE_AXIS_PIECE_BYTES + FIVE_AXIS_POWER_BYTES * piece.powers.len();
        CURVE_BYTES + self.tip.bytes() + self.pieces.iter().map(piece).sum::<usize>()
    }

    /// Place of an axis in the chain.
    fn place(&self, axis: Axis) -> Option<usize> {
        self.axes.iter().position(|&own| own == axis)
    }

    /// Whether this is one of the axes of the chain.
    pub(super) fn has(&self, axis: Axis) -> bool {
        self.place(axis).is_some()
    }

    pub(super) fn moves(&self, axis: Axis) -> bool {
        self.place(axis).is_some_and(|place| self.moves[place])
    }

    fn length(&self) -> f64 {
        self.pieces.last().map_or(0.0, FiveAxisPiece::end)
    }

    fn piece_at(&self, s: f64) -> usize {
        self.pieces.partition_point(|piece| piece.start() <= s).saturating_sub(1)
    }

    /// Evaluates polynomials of the pieces, each fetched once for all neighbouring places on its piece.
    fn fill(&self, s: &[f64], out: &mut [f64], polynomial: impl Fn(&FiveAxisPiece) -> [f64; COEFFICIENTS]) {
        let length = self.length();
        let mut k = 0;
        while k < s.len() {
            let index = self.piece_at(s[k].clamp(0.0, length));
            let piece = &self.pieces[index];
            let start = if index == 0 { f64::NEG_INFINITY } else { piece.start() };
            let end = self.pieces.get(index + 1).map_or(f64::INFINITY, FiveAxisPiece::start);
            let rest = &s[k..];
            let count = rest.iter().position(|&s| !(s >= start && s < end)).unwrap_or(rest.len()).max(1);
            let coefficients = polynomial(piece);
            let (middle, per_half) = (piece.middle, 1.0 / piece.half);
            for (out, &s) in out[k..k + count].iter_mut().zip(rest) {
                let t = (s.clamp(0.0, length) - middle) * per_half;
                *out = horner(&coefficients, t);
            }
            k += count;
        }
    }

    /// Positions of an axis of the chain.
    pub(super) fn fill_axis(&self, axis: Axis, s: &[f64], out: &mut [f64]) {
        if let Some(place) = self.place(axis) {
            self.fill(s, out, |piece| piece.of(place));
        }
    }

    /// Derivatives of an axis of the chain by arc length.
    pub(super) fn fill_tangent(&self, axis: Axis, s: &[f64], out: &mut [f64]) {
        if let Some(place) = self.place(axis) {
            self.fill(s, out, |piece| piece.slope_of(place));
        }
    }

    pub(super) fn second_derivative(&self, place: usize, s: f64) -> f64 {
        let s = s.clamp(0.0, self.length());
        let piece = &self.pieces[self.piece_at(s)];
        let mut coefficients = piece.slope_of(place);
        for k in 1..COEFFICIENTS {
            coefficients[k - 1] = coefficients[k] * (k as f64 / piece.half);
        }
        coefficients[COEFFICIENTS - 1] = 0.0;
        horner(&coefficients, (s - piece.middle) / piece.half)
    }

    /// First, second and third derivative of an axis of the chain by arc length.
    pub(super) fn derivatives(&self, place: usize, s: f64) -> [f64; 3] {
        let s = s.clamp(0.0, self.length());
        let piece = &self.pieces[self.piece_at(s)];
        let t = (s - piece.middle) / piece.half;
        let (mut value, mut first, mut second, mut third) = (0.0, 0.0, 0.0, 0.0);
        for power in piece.powers.iter().rev() {
            third = third * t + second;
            second = second * t + first;
            first = first * t + value;
            value = value * t + power[place];
        }
        let per_half = 1.0 / piece.half;
        let per_square = per_half * per_half;
        [first * per_half, 2.0 * second * per_square, 6.0 * third * (per_square * per_half)]
    }

    /// Largest value of a derivative, and of its negative.
    fn largest(&self, place: usize, derivative: usize) -> [f64; 2] {
        let mut largest = [f64::NEG_INFINITY; 2];
        for piece in &self.pieces {
            let polynomial = piece.bernstein(place, derivative);
            raise_to_largest(&polynomial, &mut largest[0], 0);
            raise_to_largest(&polynomial.map(|value| -value), &mut largest[1], 0);
        }
        largest
    }

    /// Smallest and largest position of an axis.
    pub(super) fn extent(&self, place: usize) -> [f64; 2] {
        let [highest, lowest] = self.largest(place, 0);
        [-lowest, highest]
    }

    /// Largest |derivative by arc length| of an axis.
    pub(super) fn largest_tangent(&self, place: usize) -> f64 {
        let [highest, lowest] = self.largest(place, 1);
        highest.max(lowest)
    }

    /// The pieces by their tangents.
    pub(crate) fn parts(&self) -> impl Iterator<Item = Part<CHAIN>> {
        self.pieces.iter().map(|piece| {
            Part::new(piece.end(), 2.0 * piece.half, core::array::from_fn(|axis| piece.bernstein(axis, 1)))
        })
    }

    /// See [`crate::Element::turnings`]: a stretch ends where a piece of the axes or one of the tool centre point's path does.
    pub(super) fn turnings(&self) -> Vec<Turning> {
        let length = self.length();
        let mut pieces = self.pieces.iter().map(|piece| (piece.end(), piece.rotary_rad_per_mm())).peekable();
        let mut bends =
            self.tip.curvatures().into_iter().map(|(share, curvature)| (share * length, curvature)).peekable();
        let mut turnings = Vec::new();
        while let (Some(&(piece_end, rotary_rad_per_mm)), Some(&(bend_end, path_rad_per_mm))) =
            (pieces.peek(), bends.peek())
        {
            let end_mm = piece_end.min(bend_end);
            turnings.push(Turning { end_mm, path_rad_per_mm, rotary_rad_per_mm });
            if piece_end <= end_mm {
                pieces.next();
            }
            if bend_end <= end_mm {
                bends.next();
            }
        }
        // Both end where the element does, to rounding.
        if let Some(last) = turnings.last_mut() {
            last.end_mm = length;
        }
        turnings
    }

    /// Refuses a start beside the one of the polynomials.
    pub(crate) fn check_start(&self, start: &feedwave_program::Position) -> Result<(), FiveAxisRefusal> {
        for (place, &axis) in self.axes.iter().enumerate() {
            let own = self.pieces.first().map_or(0.0, |piece| horner(&piece.of(place), -1.0));
            let difference = start[axis.index()] - own;
            let allowed = if axis.is_rotary() { SAME_START_RAD.to_degrees() } else { SAME_START_MM };
            if difference.is_nan() || difference.abs() > allowed {
                return Err(FiveAxisRefusal::Start { axis, difference });
            }
        }
        Ok(())
    }

    /// Refuses a rotary axis that leaves its range (rad) along the block.
    pub(crate) fn check_range(&self, axis: Axis, [low, high]: [f64; 2]) -> Result<(), FiveAxisRefusal> {
        let Some(place) = self.place(axis) else { return Ok(()) };
        let [least, most] = self.extent(place);
        let [least, most] = [least, most].map(f64::to_radians);
        if (low - least).max(most - high) <= SAME_START_RAD {
            return Ok(());
        }
        let value_rad = if low - least > most - high { least } else { most };
        // The end of the first piece that is outside tells about where.
        let outside = |piece: &&FiveAxisPiece| {
            let end = horner(&piece.of(place), 1.0).to_radians();
            end < low || end > high
        };
        let share = self.pieces.iter().find(outside).map_or(0.5, |piece| piece.end() / self.length());
        Err(FiveAxisRefusal::Pose {
            share,
            reason: KinematicsError::OutOfRange { axis, value_rad, range_rad: [low, high] },
        })
    }
}
