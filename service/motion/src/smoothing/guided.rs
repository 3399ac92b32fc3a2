//! Corners between five-axis blocks: position within the programmed tolerance, direction within the machine's.
//!
//! The rotary axes take the corner as further axes of the curve: all of them are polynomials of one parameter, which brake and start as the
//! tool centre point does.

use feedwave_program::{Axis, Position};

use super::corner::{self, CornerSpeed, Rounding, Shape};
use super::vector::{difference, norm, scaled};
use crate::kinematics::FiveAxisCorners;
use crate::tolerance::{LEAST_CORNER_CUT_MM, MAX_CORNER_TRIES, TANGENT_TOLERANCE_RAD, USED_SAMPLED_TOLERANCE};
use crate::{Curve, Element, FiveAxis, Machine};

/// How the directions differ in which the axes go before and behind a corner: the length of the difference of unit vectors, that of the
/// tool centre point's lines or, where it is larger, that of the machine's axes, each measured by its jerk. `None` where no curve may pass.
pub(super) fn kink(before: &Element, after: &Element, machine: &Machine) -> Option<f64> {
    let (Curve::FiveAxis(from), Curve::FiveAxis(to)) = (&before.curve, &after.curve) else { return None };
    let may_be_passed = from.setup() == to.setup() && !is_tangent(before, after);
    may_be_passed.then(|| tip_kink(before, after).max(axes_kink(before, after, machine)))
}

fn axes_kink(before: &Element, after: &Element, machine: &Machine) -> f64 {
    let ends = [before.tangent(before.length), after.tangent(0.0)];
    let by_jerk = |k: usize| machine.axes.iter().map(move |axis| ends[k][axis.axis.index()] / axis.max_jerk_per_s3);
    let norms = [0, 1].map(|k| by_jerk(k).map(|value| value * value).sum::<f64>().sqrt());
    let differences = by_jerk(0).zip(by_jerk(1)).map(|(from, to)| to / norms[1] - from / norms[0]);
    differences.map(|difference| difference * difference).sum::<f64>().sqrt()
}

fn tip_kink(before: &Element, after: &Element) -> f64 {
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
) -> Option<([Element; 3], Rounding)> {
    let (Curve::FiveAxis(from), Curve::FiveAxis(to)) = (&before.curve, &after.curve) else { return None };
    let tips = [tip_line(before, from), tip_line(after, to)];
    let most_cut_mm =
        most_cut_mm.min(USED_SAMPLED_TOLERANCE * corners.longest_cut_mm(before, after, shape.deviation()));
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
            let corner = corners.element(&short_before, &short_after, &tip, &turns)?;
            return Some(([short_before, corner, short_after], rounding));
        }
        cut_mm *= (0.9 * tolerance_rad / deviation_rad).clamp(0.25, 0.9);
    }
    None
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
