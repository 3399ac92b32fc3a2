//! Short lines that lie in one line.

use feedwave_program::Position;

use super::origin::Deviation;
use super::trim::distance;
use super::vector::{Vector, difference, dot, linear, norm, scaled};

/// Largest distance of the points between from the line from `start` to `end`; `None` where it is more than
/// `tolerance_mm`, or where the points do not follow each other along the line.
///
/// With the points in order along it, the line and the polyline through them are nowhere farther apart either.
pub(super) fn deviation(start: &Position, between: &[Vector], end: &Position, tolerance_mm: f64) -> Option<Deviation> {
    let length = distance(start, end);
    let [start, end] = [linear(start), linear(end)];
    let along = scaled(difference(end, start), 1.0 / length);
    let mut reached = 0.0;
    let mut deviation = Deviation::default();
    for &point in between {
        let from_start = difference(point, start);
        let at = dot(from_start, along);
        let beside = norm(difference(from_start, scaled(along, at)));
        // Not negated, so that a line without length has no points.
        if !(at >= reached && at <= length && beside <= tolerance_mm) {
            return None;
        }
        reached = at;
        if beside > deviation.largest_mm {
            deviation = Deviation { largest_mm: beside, at_mm: at };
        }
    }
    Some(deviation)
}

#[cfg(test)]
mod tests;
