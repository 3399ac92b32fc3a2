//! Elements that leave the programmed path within tolerances: the tool centre point along a curve, and the rotary axes along another of
//! the same parameter.
//!
//! At a corner between two blocks, the rotary axes are Bézier curves of the parameter of the tool centre point's curve, with their angles, and the velocities and
//! accelerations of both blocks by its arc length at the ends: every machine axis passes both ends of the corner with a continuous
//! second derivative, as the linear axes are smooth functions of both.
//!
//! Where the tip rests on one side of the corner while the tool turns, the turn begins while the tip comes to rest on its line, or ends
//! while the tip leaves: the tip stays on the line, and the direction is off by no more than what the corner has of the turn.

use feedwave_program::{Position, SourceSpan};

use super::fit::{EasedPart, RotaryPath, fit};
use crate::kinematics::chain::{Kinematics, Setup};
use crate::kinematics::ease::{Ease, Easing};
use crate::kinematics::tip::TipPath;
use crate::kinematics::vector::{Vec3, angle};
use crate::{Curve, Element, Spline};

/// Places in each half of a corner at which directions are compared.
const HALF_SAMPLES: usize = 8;
/// Step for the change of direction by a small turn, mm: far below what a direction changes in, far above rounding.
const SLOPE_STEP_MM: f64 = 1e-4;

/// How corners under tool centre point control are passed.
#[derive(Clone, Copy, Debug)]
pub struct FiveAxisCorners<'a> {
    /// The machine.
    pub kinematics: &'a Kinematics,
    /// Largest angle between the programmed tool direction and the one that is taken, rad.
    pub direction_tolerance_rad: f64,
}

/// The rotary axes along a corner: control points of Bézier curves of the parameter of the tool centre point's curve, rad.
pub(crate) type Turns = [[f64; 6]; 2];

impl FiveAxisCorners<'_> {
    fn rotary(&self, position: &Position) -> [f64; 2] {
        self.kinematics.from_position(position).rotary_rad
    }

    /// By how much more or otherwise the direction turns behind a corner than before it, rad/mm.
    pub(crate) fn turn_rad_per_mm(&self, before: &Element, after: &Element) -> f64 {
        let at_rad = self.rotary(&before.end);
        let slopes = [before.tangent(before.length), after.tangent(0.0)].map(|slope| self.rotary(&slope));
        let turned = [0, 1].map(|axis| at_rad[axis] + (slopes[1][axis] - slopes[0][axis]) * SLOPE_STEP_MM);
        let directions = self.kinematics.rotary_directions();
        angle(directions.at(at_rad), directions.at(turned)) / SLOPE_STEP_MM
    }

    /// How the direction changes with either rotary axis, by the angle of the second one, rad; see
    /// [`RotaryDirections::changes`](crate::kinematics::RotaryDirections).
    pub(crate) fn turning(&self, second_rad: f64) -> [Vec3; 2] {
        self.kinematics.rotary_directions().changes(second_rad)
    }

    /// Where the axes are with the tool centre point there (work coordinates, mm) and these rotary values, rad; axes beside the chain as
    /// in `beside`.
    pub(crate) fn position(
        &self,
        setup: &Setup,
        tip_mm: Vec3,
        rotary_rad: [f64; 2],
        beside: &Position,
    ) -> Option<Position> {
        let point = self.kinematics.point_with(tip_mm, rotary_rad.map(f64::to_degrees), beside, setup).ok()?;
        Some(point.position)
    }

    /// Both rotary axes, rad, with their first and second derivatives by arc length, at the end of one block, cut back already, and at
    /// the start of the other.
    pub(crate) fn ends(&self, before: &Element, after: &Element) -> [[[f64; 3]; 2]; 2] {
        let ends = [(before, before.length), (after, 0.0)].map(|(element, s)| {
            [element.position(s), element.tangent(s), element.second_derivative(s)].map(|values| self.rotary(&values))
        });
        core::array::from_fn(|axis| ends.map(|of_end| of_end.map(|values| values[axis])))
    }

    /// Largest angle between the direction along a corner and that of the blocks at the place that belongs to it, rad; `place_mm` gives
    /// that place behind the corner by the parameter of the curve.
    pub(crate) fn deviation_rad(
        &self,
        [before, after]: [&Element; 2],
        place_mm: impl Fn(f64) -> f64,
        turns: &Turns,
    ) -> f64 {
        let directions = self.kinematics.rotary_directions();
        let mut largest = 0.0_f64;
        for sample in 1..2 * HALF_SAMPLES {
            let share = sample as f64 / (2 * HALF_SAMPLES) as f64;
            let behind_mm = place_mm(share);
            let programmed =
                if behind_mm < 0.0 { before.position(before.length + behind_mm) } else { after.position(behind_mm) };
            let taken = turns.map(|turn| de_casteljau(turn, share));
            largest = largest.max(angle(directions.at(self.rotary(&programmed)), directions.at(taken)));
        }
        largest
    }

    /// The element along a curve from one position to another in place of a programmed one or its start, by control points: of the tool
    /// centre point, mm, and of both rotary axes, rad, with zeros. `None` where a rotary axis would leave its range, or the axes cannot
    /// follow.
    pub(crate) fn element<const POINTS: usize>(
        &self,
        programmed: &Element,
        [start, end]: [Position; 2],
        tips: &[[Vec3; POINTS]],
        turns: &[[Vec3; POINTS]],
    ) -> Option<Element> {
        let Curve::FiveAxis(own) = &programmed.curve else { return None };
        let [tip, turns] = Spline::with_others(tips, turns)?;
        let length = tip.length_mm();
        let tip = TipPath::spline(tip);
        self.fitted(own.setup(), [start, end], (tip, length), &RotaryPath::Along(&turns), programmed.source)
    }

    /// The element from one position to another on which the tool centre point and the rotary axes go so.
    fn fitted(
        &self,
        setup: &Setup,
        [start, end]: [Position; 2],
        (tip, length): (TipPath, f64),
        rotary: &RotaryPath<'_>,
        source: SourceSpan,
    ) -> Option<Element> {
        let curve = fit(self.kinematics, setup, &start, rotary, tip, length).ok()?;
        curve.check_start(&start).ok()?;
        for (axis, range) in self.kinematics.ranges() {
            curve.check_range(axis, range).ok()?;
        }
        let (work_offset, curve) = (Position::default(), Curve::FiveAxis(Box::new(curve)));
        Some(Element { start, end, work_offset, curve, length, source, rapid: false })
    }

    /// The element at the corner between a block on whose line the tool centre point goes and one in which it rests while the tool turns, or
    /// the other way round, in place of the end of one block and the beginning of the other, mm or degrees; each within one piece. `None`
    /// of other blocks, and where the axes cannot follow.
    pub(crate) fn eased(&self, [before, after]: [&Element; 2], easing: Easing) -> Option<Element> {
        let (Curve::FiveAxis(from), Curve::FiveAxis(to)) = (&before.curve, &after.curve) else { return None };
        let Easing { ends, begins } = easing;
        let from_place = before.length - ends;
        let (tip, ease) = match [from.tip(), to.tip()] {
            [line, turn] if line.is_line() && turn.rests() => {
                ([line.at(from_place / before.length), line.ends()[1]], Ease::Ends)
            }
            [turn, line] if line.is_line() && turn.rests() => {
                ([line.ends()[0], line.at(begins / after.length)], Ease::Begins)
            }
            _ => return None,
        };
        let (start, end) = (before.position(from_place), after.position(begins));
        let parts = [
            EasedPart { block: from, span: [from_place, before.length], ease: Ease::Ends },
            EasedPart { block: to, span: [0.0, begins], ease: Ease::Begins },
        ];
        let path = RotaryPath::Eased(self.rotary(&before.end), parts, easing);
        let (tip, length) = (TipPath::Eased(tip, ease, easing), easing.length());
        self.fitted(from.setup(), [start, end], (tip, length), &path, after.source)
    }
}

/// A Bézier curve at a parameter from 0 to 1.
fn de_casteljau(mut points: [f64; 6], share: f64) -> f64 {
    for count in (1..points.len()).rev() {
        for k in 0..count {
            points[k] += (points[k + 1] - points[k]) * share;
        }
    }
    points[0]
}
