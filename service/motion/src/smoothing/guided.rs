//! Corners between five-axis blocks: position within the programmed tolerance, direction within the machine's.

use feedwave_program::{Axis, Position};

use super::corner;
use crate::kinematics::FiveAxisCorners;
use crate::tolerance::{LEAST_CORNER_CUT_MM, MAX_CORNER_TRIES, TANGENT_TOLERANCE_RAD, USED_SAMPLED_TOLERANCE};
use crate::{Curve, Element, FiveAxis, Spline};

/// The block before, the corner and the block after, as they are run, and the largest distance of the tool centre point from the
/// programmed path, mm; `None` where the corner has to stay.
pub(super) fn round(
    corners: &FiveAxisCorners<'_>,
    before: &Element,
    after: &Element,
    tolerance_mm: f64,
    most_cut_mm: f64,
) -> Option<([Element; 3], f64)> {
    let (Curve::FiveAxis(from), Curve::FiveAxis(to)) = (&before.curve, &after.curve) else { return None };
    if from.setup() != to.setup() || is_tangent(before, after) {
        return None;
    }
    let tips = [tip_line(before, from), tip_line(after, to)];
    let most_cut_mm = most_cut_mm.min(0.5 * USED_SAMPLED_TOLERANCE * corners.longest_mm(before, after));
    let rounding = corner::between_lines(&tips[0], &tips[1], tolerance_mm, most_cut_mm)?;
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
        let tip = Spline::from_polynomial_spans(&[rounding.curve(&tip_before, &tip_after)])?;
        let turns = corners.turns(&short_before, &short_after, tip.length_mm());
        let deviation_rad = corners.deviation_rad([before, after], cut_mm, &turns);
        if deviation_rad <= tolerance_rad {
            let corner = corners.element(&short_before, &short_after, tip, turns)?;
            return Some(([short_before, corner, short_after], rounding.deviation_mm));
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
