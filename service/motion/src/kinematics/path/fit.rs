//! The polynomials of a block: Taylor series about the middle of stretches that are short enough.
//!
//! A series of N terms about the middle of a stretch errs most at its ends, where it is held against the exact solution;
//! a stretch is halved until it fits. The series of the linear axes follow that of the rotary ones, cut off as it is, so
//! that the tool centre point stays on its segment whatever was cut off.

use feedwave_program::{Axis, Position};
use smallvec::SmallVec;

use super::block::FiveAxisRefusal;
use super::series::{Series, SeriesVec};
use super::turning::Turning;
use crate::Spline;
use crate::element::{COEFFICIENTS, FiveAxis, FiveAxisPiece};
use crate::kinematics::chain::{Kinematics, KinematicsError, Setup, ToolPose};
use crate::kinematics::ease::{Ease, Easing};
use crate::kinematics::range::nearest_turn;
use crate::kinematics::tip::TipPath;
use crate::kinematics::vector::{Vec3, add_scaled, sub};
use crate::tolerance::{
    FIVE_AXIS_FIT_MM, FIVE_AXIS_FIT_RAD, FIVE_AXIS_TAIL, MAX_FIVE_AXIS_HALVINGS, MAX_FIVE_AXIS_PIECES, SPLINE_ROUNDING,
};

/// Terms that mostly suffice for a block of CAM programs, which turns by a degree.
const SHORT: usize = 6;

/// Rounding of a place along a block, as a share of it.
const PLACE_ROUNDING: f64 = 2.0 * f64::EPSILON;

/// The same of a bend, which follows from the angles of the great circle.
const PLACE_ROUNDING_OF_BEND: f64 = 8.0 * f64::EPSILON;

/// How the rotary axes turn along a block.
pub(in crate::kinematics) enum RotaryPath<'a> {
    /// Evenly, rad.
    Angles { start_rad: [f64; 2], end_rad: [f64; 2] },
    /// Along a great circle.
    GreatCircle(&'a Turning),
    /// As the first two coordinates along the arc length, rad, on the stretches of the tool centre point's curve.
    Along(&'a Spline),
    /// As two parts of blocks turn them together, of which one ends while the other begins, with the values between both, rad.
    Eased([f64; 2], [EasedPart<'a>; 2], Easing),
}

/// The part of a block that comes to rest or starts from rest.
#[derive(Clone, Copy)]
pub(in crate::kinematics) struct EasedPart<'a> {
    pub(super) block: &'a FiveAxis,
    /// Where it begins and ends, within one piece.
    pub(super) span: [f64; 2],
    pub(super) ease: Ease,
}

impl EasedPart<'_> {
    /// How far both rotary axes are from where they are at the end that the part rests at, rad.
    fn turned<const N: usize>(&self, easing: &Easing, share: f64, half: f64) -> [Series<N>; 2] {
        let [from, to] = self.span;
        let (middle, half_length, rotary) = self.block.rotary_about(0.5 * (from + to));
        let place = eased(easing, self.ease, share, half).scaled(to - from).plus(from - middle);
        let t = place.scaled(1.0 / half_length);
        let resting = match self.ease {
            Ease::Ends => to,
            Ease::Begins => from,
        };
        let resting = (resting - middle) / half_length;
        rotary.map(|coefficients| {
            let at = coefficients.iter().rev().fold(Series::ZERO, |sum: Series<N>, value| (sum * t).plus(*value));
            let resting = coefficients.iter().rev().fold(0.0, |sum, value| sum * resting + value);
            at.plus(-resting).scaled(core::f64::consts::PI / 180.0)
        })
    }
}

/// Steps of Newton's method, each of which doubles the terms that are right.
const SERIES_STEPS: u32 = usize::BITS - (COEFFICIENTS - 1).leading_zeros();

/// The part that one of two motions has done about a share of their element.
fn eased<const N: usize>(easing: &Easing, ease: Ease, share: f64, half: f64) -> Series<N> {
    let done = Series::<N>::linear(share, half).scaled(easing.length());
    let mut x = Series::constant(easing.parameter(done.0[0]));
    for _ in 0..SERIES_STEPS {
        let [left, square] = [(-x).plus(1.0), x * x];
        let slope = (left * left).scaled(3.0 * easing.ends) + square.scaled(3.0 * easing.begins);
        // What ends has done as what it has left.
        let missing = done + (left * left * left).scaled(easing.ends) - (square * x).scaled(easing.begins);
        x = x + missing.plus(-easing.ends).divided_by(slope);
    }
    let left = (-x).plus(1.0);
    match ease {
        Ease::Ends => (-(left * left * left)).plus(1.0),
        Ease::Begins => x * x * x,
    }
}

impl RotaryPath<'_> {
    fn series<const N: usize>(&self, share: f64, half: f64) -> Result<[Series<N>; 2], KinematicsError> {
        match self {
            Self::Angles { start_rad, end_rad } => Ok([0, 1].map(|axis| {
                let travel = end_rad[axis] - start_rad[axis];
                Series::linear(start_rad[axis] + travel * share, travel * half)
            })),
            Self::GreatCircle(turning) => turning.series(share, half),
            Self::Along(turns) => {
                let about = turns.about(share * turns.length_mm(), half * turns.length_mm());
                Ok([0, 1].map(|axis| Series(core::array::from_fn(|k| about[axis].get(k).copied().unwrap_or_default()))))
            }
            Self::Eased(at_rad, parts, easing) => {
                let [first, second] = parts.map(|part| part.turned::<N>(easing, share, half));
                Ok([0, 1].map(|axis| (first[axis] + second[axis]).plus(at_rad[axis])))
            }
        }
    }

    fn at(&self, share: f64) -> Result<[f64; 2], KinematicsError> {
        Ok(self.series::<1>(share, 0.0)?.map(|series| series.0[0]))
    }
}

/// A block while it is fitted.
struct Fit<'a> {
    kinematics: &'a Kinematics,
    setup: &'a Setup,
    rotary_path: &'a RotaryPath<'a>,
    tip: &'a TipPath,
    length: f64,
    pieces: Vec<FiveAxisPiece>,
    /// Rotary values at the end of the last piece, rad.
    reference_rad: [f64; 2],
}

/// The polynomials along `length` mm or degrees, from where the axes are.
pub(in crate::kinematics) fn fit(
    kinematics: &Kinematics,
    setup: &Setup,
    start: &Position,
    rotary_path: &RotaryPath<'_>,
    tip: TipPath,
    length: f64,
) -> Result<FiveAxis, FiveAxisRefusal> {
    let (linear, rotary) = kinematics.letters();
    let reference_rad = rotary.map(|axis| start[axis.index()].to_radians());
    let mut fit = Fit { kinematics, setup, rotary_path, tip: &tip, length, pieces: Vec::new(), reference_rad };
    let mut from = 0.0;
    let mut bends: SmallVec<[f64; 4]> = match rotary_path {
        RotaryPath::GreatCircle(turning) => {
            // One that is at an end but for rounding divides nothing.
            let within = PLACE_ROUNDING_OF_BEND..1.0 - PLACE_ROUNDING_OF_BEND;
            turning.bends().into_iter().filter(|bend| within.contains(bend)).collect()
        }
        RotaryPath::Angles { .. } | RotaryPath::Along(_) | RotaryPath::Eased(..) => SmallVec::new(),
    };
    if let TipPath::Spline(curve) = &tip {
        bends.extend(curve.spline().meetings().map(|s| s / length));
        bends.sort_by(f64::total_cmp);
    }
    for to in bends.into_iter().chain([1.0]) {
        if to > from {
            fit.append(from, to, 0)?;
            from = to;
        }
    }
    let axes: [Axis; 5] = [linear[0], linear[1], linear[2], rotary[0], rotary[1]];
    let pieces = fit.pieces;
    Ok(FiveAxis::new(axes, pieces, tip, *setup))
}

impl Fit<'_> {
    /// Appends the pieces from one share to another.
    fn append(&mut self, from: f64, to: f64, depth: u32) -> Result<(), FiveAxisRefusal> {
        let (share, half) = (0.5 * (from + to), 0.5 * (to - from));
        let piece = match self.piece::<SHORT>(share, half)? {
            None => self.piece::<COEFFICIENTS>(share, half)?,
            piece => piece,
        };
        if let Some((piece, end_rad)) = piece {
            self.pieces.push(piece);
            self.reference_rad = end_rad;
            return Ok(());
        }
        if depth >= MAX_FIVE_AXIS_HALVINGS || self.pieces.len() >= MAX_FIVE_AXIS_PIECES {
            return Err(FiveAxisRefusal::TooSharp { share });
        }
        self.append(from, share, depth + 1)?;
        self.append(share, to, depth + 1)
    }

    /// The tool centre point about a share, chain coordinates.
    fn tip_series<const N: usize>(&self, share: f64, half: f64) -> SeriesVec<N> {
        let to_chain = |tip_mm: Vec3| self.setup.to_chain(&ToolPose { tip_mm, direction: [0.0; 3] }).tip_mm;
        let turn_in =
            |travel_mm: Vec3| self.setup.to_chain(&ToolPose { tip_mm: [0.0; 3], direction: travel_mm }).direction;
        match self.tip {
            TipPath::Line([start, end]) => {
                let travel_mm = sub(*end, *start);
                let middle_mm = add_scaled(*start, travel_mm, share);
                let (middle, end) = (to_chain(middle_mm), to_chain(add_scaled(middle_mm, travel_mm, half)));
                core::array::from_fn(|k| Series::linear(middle[k], end[k] - middle[k]))
            }
            TipPath::Eased([start, end], ease, easing) => {
                let (start, travel) = (to_chain(*start), turn_in(sub(*end, *start)));
                let share = eased::<N>(easing, *ease, share, half);
                core::array::from_fn(|k| share.scaled(travel[k]).plus(start[k]))
            }
            TipPath::Arc(arc) => {
                let (center, across, rise, [start_mm, end_mm], sweep_rad) = arc.parts();
                let (center, across, rise) = (to_chain(center), across.map(turn_in), turn_in(rise));
                let growth_mm = end_mm - start_mm;
                let radius = Series::<N>::linear(start_mm + growth_mm * share, growth_mm * half);
                let (sine, cosine) = Series::linear(sweep_rad * share, sweep_rad * half).sincos();
                let (first, second) = (radius * cosine, radius * sine);
                core::array::from_fn(|k| {
                    let axial = Series::linear(center[k] + rise[k] * share, rise[k] * half);
                    axial + first.scaled(across[0][k]) + second.scaled(across[1][k])
                })
            }
            TipPath::Spline(curve) => {
                let about = curve.spline().about(share * self.length, half * self.length);
                let mut series = [Series::<N>::ZERO; 3];
                for k in 0..N.min(COEFFICIENTS) {
                    let value = about.map(|polynomial| polynomial[k]);
                    let value = if k == 0 { to_chain(value) } else { turn_in(value) };
                    for (series, value) in series.iter_mut().zip(value) {
                        series.0[k] = value;
                    }
                }
                series
            }
        }
    }

    /// The piece about a share, and the rotary values at its end; `None` where it does not fit.
    #[allow(clippy::type_complexity, reason = "a piece and where it ends")]
    fn piece<const N: usize>(
        &self,
        share: f64,
        half: f64,
    ) -> Result<Option<(FiveAxisPiece, [f64; 2])>, FiveAxisRefusal> {
        let refused = |reason| FiveAxisRefusal::Pose { share, reason };
        let mut rotary = self.rotary_path.series::<N>(share, half).map_err(refused)?;
        for (series, reference) in rotary.iter_mut().zip(self.reference_rad) {
            let start = series.at(-1.0);
            *series = series.plus(nearest_turn(start, reference) - start);
        }
        let tip = self.tip_series::<N>(share, half);
        let linear = self.kinematics.linear_series(rotary, tip, self.setup.tool_length_mm).map_err(refused)?;
        for t in [-1.0, 1.0] {
            let (exact, at) = (share + half * t, rotary.map(|series| series.at(t)));
            let exact_rad =
                self.rotary_path.at(exact).map_err(|reason| FiveAxisRefusal::Pose { share: exact, reason })?;
            let turned = |axis: usize| (nearest_turn(exact_rad[axis], at[axis]) - at[axis]).abs();
            // Close to a pole a rounded place on the great circle is another angle of the first axis.
            let rounding = |axis: usize| PLACE_ROUNDING * (rotary[axis].0[1] / half).abs();
            let tip_mm = self.tip.at(exact);
            let joints = self.kinematics.joints_at(tip_mm, at, self.setup).map_err(refused)?;
            let fits = (0..2).all(|axis| turned(axis) <= FIVE_AXIS_FIT_RAD + rounding(axis))
                && joints.linear_mm.iter().zip(&linear).all(|(exact, series)| {
                    (series.at(t) - exact).abs() <= FIVE_AXIS_FIT_MM + SPLINE_ROUNDING * exact.abs()
                });
            if !fits {
                return Ok(None);
            }
        }
        // Errors that cancel out at both ends belong to series that have not settled.
        let tail = |series: &Series<N>| series.0[N - 1].abs();
        let is_settled = linear.iter().all(|series| tail(series) <= FIVE_AXIS_TAIL * FIVE_AXIS_FIT_MM)
            && rotary.iter().all(|series| tail(series) <= FIVE_AXIS_TAIL * FIVE_AXIS_FIT_RAD);
        if !is_settled {
            return Ok(None);
        }
        let end_rad = rotary.map(|series| series.at(1.0));
        let [x, y, z] = linear.map(|series| series.0);
        let [first, second] = rotary.map(|series| series.0.map(f64::to_degrees));
        let piece = FiveAxisPiece::new(share * self.length, half * self.length, [x, y, z, first, second]);
        Ok(Some((piece, end_rad)))
    }
}
