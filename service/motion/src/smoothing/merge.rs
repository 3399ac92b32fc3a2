//! Short lines that lie in one line.

use feedwave_program::Position;

use super::trim::distance;
use super::vector::{Vector, difference, dot, linear, norm, scaled};

/// Largest distance of the points between from the line from `start` to `end`, mm; `None` where it is more than
/// `tolerance_mm`, or where the points do not follow each other along the line.
///
/// With the points in order along it, the line and the polyline through them are nowhere farther apart either.
pub(super) fn deviation(start: &Position, between: &[Vector], end: &Position, tolerance_mm: f64) -> Option<f64> {
    let length = distance(start, end);
    let [start, end] = [linear(start), linear(end)];
    let along = scaled(difference(end, start), 1.0 / length);
    let mut reached = 0.0;
    let mut largest = 0.0_f64;
    for &point in between {
        let from_start = difference(point, start);
        let at = dot(from_start, along);
        let beside = norm(difference(from_start, scaled(along, at)));
        // Not negated, so that a line without length has no points.
        if !(at >= reached && at <= length && beside <= tolerance_mm) {
            return None;
        }
        reached = at;
        largest = largest.max(beside);
    }
    Some(largest)
}

#[cfg(test)]
mod tests;
