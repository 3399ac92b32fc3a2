//! Corners between five-axis blocks: position within the programmed tolerance, direction within the machine's.
//!
//! The rotary axes take the corner as further axes of the curve: all of them are polynomials of one parameter, which brake and start as the
//! tool centre point does.

use feedwave_program::{Axis, Position};

use super::Joining;
use super::corner::{self, CornerSpeed, Shape, Used};
use super::joint::Joint;
use super::vector::{difference, norm, scaled};
use crate::kinematics::{Easing, FiveAxisCorners};
use crate::tolerance::{
    LEAST_CORNER_COSINE, LEAST_CORNER_CUT_MM, MAX_CORNER_TRIES, MOST_UNEVEN_SHARE, TANGENT_TOLERANCE_RAD,
    USED_SAMPLED_TOLERANCE,
};
use crate::{Curve, Element, FiveAxis, Machine, PathLimits, PathMotion, path_limits};

/// What the corner between two blocks asks for, of which one at least is guided: it stays but between blocks of one setup.
///
/// The directions in which the axes go before and behind it differ by the length of the difference of unit vectors: of those of the tool
/// centre point's lines or, where it is larger, of those of the machine's axes, each measured by its jerk.
pub(super) fn joint(
    [before, after]: [&Element; 2],
    tolerance_mm: f64,
    speed: CornerSpeed,
    joining: Joining<'_>,
) -> Joint {
    let (Curve::FiveAxis(from), Curve::FiveAxis(to), Some(corners)) = (&before.curve, &after.curve, joining.corners)
    else {
        return Joint::Fixed;
    };
    if !(from.tip().is_line() && to.tip().is_line()) {
        return Joint::Fixed;
    }
    let tip_kink = tip_kink(before, after);
    let goes_on = tip_kink * tip_kink <= 2.0 * (1.0 - LEAST_CORNER_COSINE);
    if from.setup() != to.setup() || before.end != after.start || !goes_on {
        return Joint::Fixed;
    }
    let turn_rad_per_mm = corners.turn_rad_per_mm(before, after);
    let kink = tip_kink.max(axes_kink(before, after, joining.machine));
    let shape = shape([before, after], kink, speed);
    let mut reach_mm = corner::reach_mm(tip_kink, tolerance_mm, speed);
    let mut angle_rad = tip_kink;
    if turn_rad_per_mm > 0.0 {
        let tolerance_rad = corners.direction_tolerance_rad;
        reach_mm = reach_mm.min(tolerance_rad / (0.5 * shape.deviation() * turn_rad_per_mm));
        angle_rad = angle_rad.max(turn_rad_per_mm * (tolerance_mm / tolerance_rad));
    }
    let are_even = [before, after].iter().all(|element| turns_evenly(element, corners.direction_tolerance_rad));
    let may_join = are_even && reach_mm >= LEAST_CORNER_CUT_MM;
    Joint::corner(if may_join { reach_mm } else { 0.0 }, kink, angle_rad)
}

/// Whether the rotary axes turn about evenly along a block, or hardly: beside a pole they do not, and a curve that follows them there would
/// have to bend within the block.
fn turns_evenly(element: &Element, tolerance_rad: f64) -> bool {
    let Curve::FiveAxis(five_axis) = &element.curve else { return true };
    let [.., first, second] = *five_axis.axes();
    [first, second].into_iter().all(|axis| {
        let mut slopes = [0.0; 3];
        element.fill_tangent(axis, &[0.0, 0.5 * element.length, element.length], &mut slopes);
        let turns_rad = slopes.map(|slope| (slope * element.length).to_radians());
        let most_rad = turns_rad.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let least_rad = turns_rad.into_iter().fold(f64::INFINITY, f64::min);
        let turned_rad = (element.end[axis.index()] - element.start[axis.index()]).to_radians().abs();
        most_rad - least_rad <= (MOST_UNEVEN_SHARE * turned_rad).max(tolerance_rad)
    })
}

fn axes_kink(before: &Element, after: &Element, machine: &Machine) -> f64 {
    let ends = [before.tangent(before.length), after.tangent(0.0)];
    let by_jerk = |k: usize| machine.axes.iter().map(move |axis| ends[k][axis.axis.index()] / axis.max_jerk_per_s3);
    let norms = [0, 1].map(|k| by_jerk(k).map(|value| value * value).sum::<f64>().sqrt());
    let differences = by_jerk(0).zip(by_jerk(1)).map(|(from, to)| to / norms[1] - from / norms[0]);
    differences.map(|difference| difference * difference).sum::<f64>().sqrt()
}

/// The same of the tool centre point alone.
pub(super) fn tip_kink(before: &Element, after: &Element) -> f64 {
    let [from, to] = [before, after].map(|element| match &element.curve {
        Curve::FiveAxis(five_axis) => {
            let [start, end] = *five_axis.tip().ends();
            scaled(difference(end, start), 1.0 / element.length)
        }
        _ => [0.0; 3],
    });
    norm(difference(to, from))
}

/// The shape of a corner with this [`kink`], in which all axes take it.
pub(super) fn shape([before, after]: [&Element; 2], kink: f64, speed: CornerSpeed) -> Shape {
    Shape::at(
        speed,
        match speed {
            // At one speed along the tip's path, its curve has the sharpest bends.
            CornerSpeed::Steady => 0.5 * tip_kink(before, after),
            CornerSpeed::Changing => 0.5 * kink,
        },
    )
}

/// The block before, the corner and the block after, as they are run, and the largest distance of the tool centre point from the
/// programmed path, mm; `None` where the corner has to stay. The axes take the corner in the shape `shape`.
pub(super) fn round(
    corners: &FiveAxisCorners<'_>,
    [before, after]: [&Element; 2],
    [tolerance_mm, most_cut_mm]: [f64; 2],
    shape: Shape,
) -> Option<([Element; 3], Used)> {
    let (Curve::FiveAxis(from), Curve::FiveAxis(to)) = (&before.curve, &after.curve) else { return None };
    let tips = [tip_line(before, from), tip_line(after, to)];
    if is_tangent(before, after) {
        return None;
    }
    let turn_rad_per_mm = corners.turn_rad_per_mm(before, after);
    let longest_cut_mm = corners.direction_tolerance_rad / (0.5 * shape.deviation() * turn_rad_per_mm);
    let most_cut_mm = most_cut_mm.min(USED_SAMPLED_TOLERANCE * longest_cut_mm);
    let rounding = corner::line_rounding(&tips[0], &tips[1], tolerance_mm, most_cut_mm, |_| shape)?;
    let tolerance_rad = corners.direction_tolerance_rad;
    let mut cut_mm = rounding.cut_mm;
    for _ in 0..MAX_CORNER_TRIES {
        if cut_mm < LEAST_CORNER_CUT_MM {
            return None;
        }
        let rounding = rounding.with_cut(cut_mm);
        let cut_back = |before: &Element, after: &Element| {
            Some([before.part(0.0, before.length - cut_mm)?, after.part(cut_mm, after.length)?])
        };
        let [tip_before, tip_after] = cut_back(&tips[0], &tips[1])?;
        let [short_before, short_after] = cut_back(before, after)?;
        let turns = corners.ends(&short_before, &short_after).map(|ends| rounding.axis_points(ends));
        let place_mm = |share: f64| rounding.behind_corner_mm(share);
        let deviation_rad = corners.deviation_rad([before, after], place_mm, &turns);
        if deviation_rad <= tolerance_rad {
            let tip = rounding.curve(&tip_before, &tip_after);
            let turns = core::array::from_fn(|k| [turns[0][k], turns[1][k], 0.0]);
            let corner = corners.element(after, [short_before.end, short_after.start], &[tip], &[turns])?;
            return Some(([short_before, corner, short_after], rounding.used()));
        }
        cut_mm *= (0.9 * tolerance_rad / deviation_rad).clamp(0.25, 0.9);
    }
    None
}

/// The same between a line of the tool centre point and a turn at rest: the turn begins before the line ends, or ends behind the beginning of
/// the line. Of both there is what may be cut, mm or degrees, and the commanded speed. `None` where the corner has to stay.
///
/// Of the turn the corner has no more than the tolerance of the direction, and of the line what it comes to rest or starts on in the same
/// time, at constant jerk.
pub(super) fn ease(
    corners: &FiveAxisCorners<'_>,
    [before, after]: [&Element; 2],
    [most_cut, commands]: [[f64; 2]; 2],
    machine: &Machine,
) -> Option<([Element; 3], Used)> {
    let (Curve::FiveAxis(from), Curve::FiveAxis(to)) = (&before.curve, &after.curve) else { return None };
    if from.setup() != to.setup() || before.end != after.start {
        return None;
    }
    let limits = |element: &Element, command: f64| {
        let own = path_limits(element, machine, PathMotion::ZERO).ok()?;
        Some(PathLimits { velocity: own.velocity.min(command), ..own })
    };
    let limits = [limits(before, commands[0])?, limits(after, commands[1])?];
    let mut most = [most_cut[0].min(from.end_pieces()[1]), most_cut[1].min(to.end_pieces()[0])];
    let turn = usize::from(to.tip().rests());
    most[turn] = most[turn].min(corners.direction_tolerance_rad.to_degrees());
    let time_s = starting_s(most[0], limits[0]).min(starting_s(most[1], limits[1]));
    let cut = [0, 1].map(|side| started(time_s, limits[side]).min(most[side]));
    // A length that is no number is refused as well.
    let is_enough = cut.iter().all(|cut| *cut >= LEAST_CORNER_CUT_MM);
    if !is_enough {
        return None;
    }
    let corner = corners.eased([before, after], Easing { ends: cut[0], begins: cut[1] })?;
    let [before, after] = [before.part(0.0, before.length - cut[0])?, after.part(cut[1], after.length)?];
    Some(([before, corner, after], Used { cut_mm: cut, deviation_mm: 0.0 }))
}

/// Time to start over a length from rest at constant jerk, s.
fn starting_s(length: f64, limits: PathLimits) -> f64 {
    let by_jerk_s = libm::cbrt(6.0 * length / limits.jerk);
    by_jerk_s.max((6.0 * length / limits.acceleration).sqrt()).max(3.0 * length / limits.velocity)
}

/// Length that is started over from rest in a time at constant jerk.
fn started(time_s: f64, limits: PathLimits) -> f64 {
    let jerk = limits.jerk.min(limits.acceleration / time_s).min(2.0 * limits.velocity / (time_s * time_s));
    jerk * time_s * time_s * time_s / 6.0
}

/// Whether all machine axes go on with the velocities that they have.
fn is_tangent(before: &Element, after: &Element) -> bool {
    let [from, to] = [before.tangent(before.length), after.tangent(0.0)];
    let square: f64 = from.iter().zip(&to).map(|(from, to)| (to - from) * (to - from)).sum();
    square <= TANGENT_TOLERANCE_RAD * TANGENT_TOLERANCE_RAD
}

/// The line of the tool centre point.
fn tip_line(element: &Element, five_axis: &FiveAxis) -> Element {
    let [start, end] = five_axis.tip().ends().map(|tip_mm| {
        let mut position = Position::default();
        for (axis, value) in [Axis::X, Axis::Y, Axis::Z].into_iter().zip(tip_mm) {
            position[axis.index()] = value;
        }
        position
    });
    let (source, rapid) = (element.source, element.rapid);
    Element { start, end, work_offset: Position::default(), curve: Curve::Line, length: element.length, source, rapid }
}
