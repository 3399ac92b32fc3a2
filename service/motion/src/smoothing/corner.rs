//! The curve that rounds a corner.
//!
//! Both elements are cut back by the same arc length d, and a quintic Bézier curve joins the cuts with the direction
//! and the curvature of the elements there. With unit tangent τ and curvature vector κ at a cut, its three control
//! points on that side are
//!
//! ```text
//! P0     P0 + a·τ     P0 + b·τ + 5/4·a²·κ          a = (1 − u₁)·d, b = (1 − u₂)·d
//! ```
//!
//! since B′ = 5·(P1 − P0) and B″ = 20·(P2 − 2·P1 + P0) there, and the part of B″ across τ has to be |B′|²·κ.
//!
//! **Shape.** The shares u₁ and u₂ are how far P1 and P2 lie from a corner between lines. What passing a corner takes,
//! at the speed at which the third derivative of the curve reaches a given jerk, was minimised over both for deflections
//! from 30° to 150° at the same deviation; with σ = sin²(θ/2) the fit
//!
//! ```text
//! u₁ = 0.6 + 0.15·σ²          u₂ = 0.2 + 0.45·σ²
//! ```
//!
//! is within some percent of the least everywhere: the sharper the corner, the closer the points to it. In the limit of
//! a flat corner the points are spaced evenly, and the parameter is in proportion to the arc length.
//!
//! **Deviation between lines.** With the corner at the origin and the control points at −u·τ₀ and u·τ₁, u = d, u₁·d and
//! u₂·d, a curve point is −A·τ₀ + D·τ₁, where D collects the weights of the last three points. Against the path point
//! −(A − D)·τ₀ of the first half it is off by D·|τ₁ − τ₀| = 2·D·sin(θ/2) for a deflection θ. D grows with the curve's
//! parameter, so the largest is that of the middle, where the path point is the corner itself:
//!
//! ```text
//! ε = (1 + 5·u₁ + 10·u₂)/16·sin(θ/2)·d
//! ```
//!
//! and every path point has a curve point as near (a bound of the Fréchet distance). **Between curves** the same pairs
//! of points are compared at samples, and d shrinks until they are within the tolerance.

use feedwave_program::Axis;
use serde::{Deserialize, Serialize};

use super::vector::{Vector, difference, dot, linear, norm, scaled, sum};
use crate::tolerance::{
    CORNER_HALF_SAMPLES, CURVE_MOST_END_MM, LARGEST_CORNER_TURN_RAD, LARGEST_RAMP_TURN_RAD, LEAST_CORNER_COSINE,
    LEAST_CORNER_CUT_MM, LEAST_RAMP, MAX_CORNER_TRIES, RAMP_DEVIATION, SAME_POINT_MM, TANGENT_TOLERANCE_RAD,
    UNUSED_TOLERANCE_MM, USED_SAMPLED_TOLERANCE,
};
use crate::{Curve, Element};

/// Control points of a quintic Bézier curve, mm.
pub(super) type ControlPoints = [Vector; 6];

/// How a corner is rounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rounding {
    /// What is cut from both elements where they meet, mm.
    pub(super) cut_mm: f64,
    /// Largest distance of the curve from the path, mm.
    pub(super) deviation_mm: f64,
    shape: Shape,
}

/// What a curve at a corner takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Used {
    /// What is cut from the element before and from the one behind, mm; of a turn at rest degrees.
    pub(super) cut_mm: [f64; 2],
    /// Largest distance of the curve from the path, mm.
    pub(super) deviation_mm: f64,
}

/// Distances of the second and third control point from a corner between lines, as shares of the cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    second: f64,
    third: f64,
}

/// How the speed along the path behaves at corners, which decides the shape that is passed in the least time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum CornerSpeed {
    /// It is the same along a corner, as in plans in runs.
    #[default]
    Steady,
    /// It changes along a corner, as in plans for the least time.
    Changing,
}

impl Shape {
    /// The shape for a corner with the sine of half its deflection.
    pub(super) fn at(speed: CornerSpeed, half_sine: f64) -> Self {
        match speed {
            CornerSpeed::Steady => Self::of(half_sine),
            CornerSpeed::Changing => Self::for_changing_speed(half_sine),
        }
    }

    /// The shape for a corner with the sine of half its deflection.
    fn of(half_sine: f64) -> Self {
        let square = half_sine * half_sine;
        Self { second: 0.6 + 0.15 * square * square, third: 0.2 + 0.45 * square * square }
    }

    /// The shape for a corner that is passed at changing speed, where both elements are lines or arcs of their own blocks.
    ///
    /// At a right angle and beyond, it is the one cubic Bézier curve with both inner points on the corner, which axes take that
    /// brake and start at constant jerk, one on each element: a quintic's points are then at 0.4 and 0.1 of the cut. Where the
    /// elements are tangent the points are spaced evenly.
    fn for_changing_speed(half_sine: f64) -> Self {
        let share = (2.0 * half_sine * half_sine).min(1.0);
        Self { second: 0.6 - 0.2 * share, third: 0.2 - 0.1 * share }
    }

    /// (A − D)/d with these weights of the control points: how far before the corner, from 1 at the cut to 0 in the middle of the curve.
    fn before_corner(&self, weights: &[f64; 6]) -> f64 {
        let shares = [1.0, self.second, self.third];
        (0..3).map(|index| (weights[index] - weights[5 - index]) * shares[index]).sum()
    }

    /// Deviation between lines as a share of d·sin(θ/2).
    pub(super) fn deviation(&self) -> f64 {
        (1.0 + 5.0 * self.second + 10.0 * self.third) / 16.0
    }
}

impl Rounding {
    pub(super) const fn used(&self) -> Used {
        Used { cut_mm: [self.cut_mm; 2], deviation_mm: self.deviation_mm }
    }

    /// The same between lines with less cut off.
    pub(super) fn with_cut(self, cut_mm: f64) -> Self {
        Self { cut_mm, deviation_mm: self.deviation_mm * (cut_mm / self.cut_mm), ..self }
    }

    /// Where a place of the curve belongs to on the path: so far behind the corner, mm, at a share of the curve's parameter.
    pub(super) fn behind_corner_mm(&self, share: f64) -> f64 {
        -self.cut_mm * self.shape.before_corner(&bernstein(share))
    }

    /// Control points of an axis from its values, and its first and second derivatives by arc length, at both cuts.
    pub(super) fn axis_points(&self, [from, to]: [[f64; 3]; 2]) -> [f64; 6] {
        let [near, far] = [(1.0 - self.shape.second) * self.cut_mm, (1.0 - self.shape.third) * self.cut_mm];
        let points = |[value, slope, bend]: [f64; 3], sign: f64| {
            [value, value + sign * near * slope, value + sign * far * slope + 1.25 * near * near * bend]
        };
        let ([a, b, c], [f, e, d]) = (points(from, 1.0), points(to, -1.0));
        [a, b, c, d, e, f]
    }

    /// The curve from the end of one element, cut back already, to the start of the other.
    pub(super) fn curve(&self, before: &Element, after: &Element) -> ControlPoints {
        self.control_points(Joint::of(before, before.length), Joint::of(after, 0.0))
    }

    fn control_points(&self, from: Joint, to: Joint) -> ControlPoints {
        let [near, far] = [(1.0 - self.shape.second) * self.cut_mm, (1.0 - self.shape.third) * self.cut_mm];
        let second = |joint: Joint, near: f64| sum(joint.point, scaled(joint.tangent, near));
        let third = |joint: Joint, far: f64| {
            sum(sum(joint.point, scaled(joint.tangent, far)), scaled(joint.curvature, 1.25 * near * near))
        };
        [from.point, second(from, near), third(from, far), third(to, -far), second(to, -near), to.point]
    }

    /// Largest distance of the curve from the path point that belongs to each of its points, at samples.
    fn sampled_deviation(&self, points: &ControlPoints, before: &Element, after: &Element) -> f64 {
        let mut largest = 0.0_f64;
        for (element, points, is_before) in [(before, *points, true), (after, reversed(points), false)] {
            let mut s = [0.0; CORNER_HALF_SAMPLES];
            let mut curve = [[0.0; 3]; CORNER_HALF_SAMPLES];
            for (index, (s, curve)) in s.iter_mut().zip(&mut curve).enumerate() {
                let weights = bernstein(0.5 * (index + 1) as f64 / CORNER_HALF_SAMPLES as f64);
                let from_corner_mm = self.shape.before_corner(&weights) * self.cut_mm;
                *s = if is_before { element.length - from_corner_mm } else { from_corner_mm };
                *curve =
                    weights.iter().zip(&points).fold([0.0; 3], |at, (&weight, &point)| sum(at, scaled(point, weight)));
            }
            let mut squares = [0.0; CORNER_HALF_SAMPLES];
            for (index, axis) in [Axis::X, Axis::Y, Axis::Z].into_iter().enumerate() {
                let mut path = [0.0; CORNER_HALF_SAMPLES];
                element.fill_axis(axis, &s, &mut path);
                for ((square, path), curve) in squares.iter_mut().zip(&path).zip(&curve) {
                    *square += (curve[index] - path) * (curve[index] - path);
                }
            }
            largest = squares.into_iter().fold(largest, f64::max);
        }
        largest.sqrt()
    }
}

/// [`rounding`] between lines, however little they turn.
pub(super) fn between_lines(
    before: &Element,
    after: &Element,
    tolerance_mm: f64,
    most_cut_mm: f64,
) -> Option<Rounding> {
    let shape = |half_sine: f64| Shape::at(CornerSpeed::Steady, half_sine);
    line_rounding(before, after, tolerance_mm, most_cut_mm, shape)
}

/// [`between_lines`] in the shape for a corner with the sine of half its deflection.
pub(super) fn line_rounding(
    before: &Element,
    after: &Element,
    tolerance_mm: f64,
    most_cut_mm: f64,
    shape: impl Fn(f64) -> Shape,
) -> Option<Rounding> {
    let [from, to] = [Joint::of(before, before.length), Joint::of(after, 0.0)];
    // A direction that is no number is refused as well.
    let goes_on = dot(from.tangent, to.tangent) >= LEAST_CORNER_COSINE;
    if !goes_on {
        return None;
    }
    // |τ₁ − τ₀| = 2·sin(θ/2).
    let half_sine = 0.5 * norm(difference(to.tangent, from.tangent));
    let shape = shape(half_sine);
    let cut_mm = ((tolerance_mm - UNUSED_TOLERANCE_MM) / (shape.deviation() * half_sine)).min(most_cut_mm);
    let deviation_mm = shape.deviation() * half_sine * cut_mm;
    (cut_mm >= LEAST_CORNER_CUT_MM).then_some(Rounding { cut_mm, deviation_mm, shape })
}

/// Length cut for a corner between lines whose unit directions differ by `kink`, mm.
pub(super) fn reach_mm(kink: f64, tolerance_mm: f64, speed: CornerSpeed) -> f64 {
    let half_sine = 0.5 * kink;
    tolerance_mm / (Shape::at(speed, half_sine).deviation() * half_sine)
}

/// Differences of the directions and of the curvature vectors where two elements meet, and the cosine of the deflection; `None`
/// where they are farther apart than `gap_mm`.
pub(super) fn steps(before: &Element, after: &Element, gap_mm: f64) -> Option<(f64, f64, f64)> {
    let [from, to] = [Joint::of(before, before.length), Joint::of(after, 0.0)];
    let kink = norm(difference(to.tangent, from.tangent));
    let bend = norm(difference(to.curvature, from.curvature));
    (norm(difference(to.point, from.point)) <= gap_mm).then(|| (kink, bend, dot(from.tangent, to.tangent)))
}

/// Largest curvature of two elements where they meet, 1/mm.
pub(super) fn largest_curvature(before: &Element, after: &Element) -> f64 {
    let [from, to] = [Joint::of(before, before.length), Joint::of(after, 0.0)];
    norm(from.curvature).max(norm(to.curvature))
}

/// How to round the corner between two elements; `None` where it has to stay.
///
/// The curve is nowhere farther than `tolerance_mm` from the programmed path, and no more than `most_cut_mm` is cut. Tangent
/// elements stay; see [`rounding_or_ramp`].
pub(super) fn rounding(before: &Element, after: &Element, tolerance_mm: f64, most_cut_mm: f64) -> Option<Rounding> {
    fitted(before, after, tolerance_mm, most_cut_mm, None)
}

/// [`rounding`], where tangent elements are joined by a ramp of curvature.
pub(super) fn rounding_or_ramp(
    before: &Element,
    after: &Element,
    tolerance_mm: f64,
    most_cut_mm: f64,
    speed: CornerSpeed,
) -> Option<Rounding> {
    fitted(before, after, tolerance_mm, most_cut_mm, Some(speed))
}

fn fitted(
    before: &Element,
    after: &Element,
    tolerance_mm: f64,
    most_cut_mm: f64,
    ramps_at: Option<CornerSpeed>,
) -> Option<Rounding> {
    let (ramps, speed) = (ramps_at.is_some(), ramps_at.unwrap_or_default());
    let [from, to] = [Joint::of(before, before.length), Joint::of(after, 0.0)];
    if norm(difference(to.point, from.point)) > SAME_POINT_MM {
        return None;
    }
    // |τ₁ − τ₀| = 2·sin(θ/2).
    let kink = norm(difference(to.tangent, from.tangent));
    // A direction that is no number is refused as well.
    let goes_on = dot(from.tangent, to.tangent) >= LEAST_CORNER_COSINE;
    let bend = norm(difference(to.curvature, from.curvature));
    let is_bend = ramps && (kink > LEAST_RAMP || bend > LEAST_RAMP);
    if !goes_on || !(kink > TANGENT_TOLERANCE_RAD || is_bend) {
        return None;
    }
    let most_cut_mm = if kink > TANGENT_TOLERANCE_RAD { most_cut_mm } else { most_cut_mm.min(CURVE_MOST_END_MM) };
    if matches!((&before.curve, &after.curve), (Curve::Line, Curve::Line)) {
        return line_rounding(before, after, tolerance_mm, most_cut_mm, |half_sine| Shape::at(speed, half_sine));
    }
    let tolerance_mm = tolerance_mm - UNUSED_TOLERANCE_MM;
    let shape = Shape::at(speed, 0.5 * kink);
    let mut for_lines = tolerance_mm / (shape.deviation() * 0.5 * kink);
    if kink <= TANGENT_TOLERANCE_RAD {
        for_lines = for_lines.min((tolerance_mm / (RAMP_DEVIATION * bend)).sqrt());
    }
    let curvature = norm(from.curvature).max(norm(to.curvature));
    let most_turn_rad = if ramps { LARGEST_RAMP_TURN_RAD } else { LARGEST_CORNER_TURN_RAD };
    let most_cut_mm = most_cut_mm.min(most_turn_rad / curvature);
    longest_within([before, after], tolerance_mm * USED_SAMPLED_TOLERANCE, shape, [for_lines, most_cut_mm])
}

/// The rounding of this shape with about the longest cut for which samples stay within the tolerance: from one that would do between
/// lines, up to the largest one.
fn longest_within(
    [before, after]: [&Element; 2],
    tolerance_mm: f64,
    shape: Shape,
    [for_lines, most_cut_mm]: [f64; 2],
) -> Option<Rounding> {
    let mut good: Option<Rounding> = None;
    let mut bad = f64::INFINITY;
    let mut cut_mm = (for_lines * USED_SAMPLED_TOLERANCE).min(most_cut_mm);
    for _ in 0..MAX_CORNER_TRIES {
        let is_enough = cut_mm >= LEAST_CORNER_CUT_MM;
        if !is_enough {
            return None;
        }
        let rounding = Rounding { cut_mm, deviation_mm: 0.0, shape };
        let points = rounding.control_points(Joint::of(before, before.length - cut_mm), Joint::of(after, cut_mm));
        let deviation_mm =
            if is_forward(&points) { rounding.sampled_deviation(&points, before, after) } else { f64::INFINITY };
        if deviation_mm <= tolerance_mm {
            good = Some(Rounding { deviation_mm, ..rounding });
            if cut_mm >= most_cut_mm || deviation_mm > 0.9 * tolerance_mm {
                break;
            }
        } else {
            bad = bad.min(cut_mm);
        }
        // Deviations grow about in proportion to the cut; aim a little below the tolerance.
        let step = (0.97 * tolerance_mm / deviation_mm).clamp(0.25, 4.0);
        let next = (cut_mm * step).min(most_cut_mm);
        if next >= bad || good.is_some_and(|good| next <= good.cut_mm) {
            if good.is_some() {
                break;
            }
            cut_mm = 0.5 * bad;
        } else {
            cut_mm = next;
        }
    }
    good
}

/// Place of an element, its direction and its curvature.
#[derive(Clone, Copy)]
struct Joint {
    point: Vector,
    /// Of length 1.
    tangent: Vector,
    /// Curvature times normal, 1/mm.
    curvature: Vector,
}

impl Joint {
    fn of(element: &Element, s: f64) -> Self {
        let tangent = linear(&element.tangent(s));
        // Between the ends of a spiral the derivatives by arc length are off a little.
        let square = dot(tangent, tangent);
        let second = linear(&element.second_derivative(s));
        let across = difference(second, scaled(tangent, dot(second, tangent) / square));
        Self {
            point: linear(&element.position(s)),
            tangent: scaled(tangent, 1.0 / square.sqrt()),
            curvature: scaled(across, 1.0 / square),
        }
    }
}

/// Whether the curve never stops or turns back: each of its legs, of which its derivative is a mean, goes forward.
fn is_forward(points: &ControlPoints) -> bool {
    let legs: [Vector; 5] = core::array::from_fn(|index| difference(points[index + 1], points[index]));
    let [first, last] = [scaled(legs[0], 1.0 / norm(legs[0])), scaled(legs[4], 1.0 / norm(legs[4]))];
    let forward = sum(first, last);
    legs.iter().all(|&leg| dot(leg, forward) > 0.0)
}

fn reversed(points: &ControlPoints) -> ControlPoints {
    let mut reversed = *points;
    reversed.reverse();
    reversed
}

/// Bernstein polynomials of degree 5.
fn bernstein(t: f64) -> [f64; 6] {
    let u = 1.0 - t;
    let [t2, u2] = [t * t, u * u];
    [u2 * u2 * u, 5.0 * u2 * u2 * t, 10.0 * u2 * u * t2, 10.0 * u2 * t2 * t, 5.0 * u * t2 * t2, t2 * t2 * t]
}

#[cfg(test)]
mod tests;
