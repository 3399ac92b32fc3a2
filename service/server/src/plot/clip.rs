//! Cuts polylines at the edges of a panel; the backends would draw over them.

use std::ops::Range;

type Point = (f64, f64);

/// The parts of a polyline inside the rectangle, each with at least two points.
pub(super) fn polyline(line: &[Point], x: &Range<f64>, y: &Range<f64>) -> Vec<Vec<Point>> {
    let mut parts: Vec<Vec<Point>> = Vec::new();
    for pair in line.windows(2) {
        let Some((from, to)) = segment(pair[0], pair[1], x, y) else { continue };
        match parts.last_mut() {
            Some(part) if part.last() == Some(&from) => part.push(to),
            _ => parts.push(vec![from, to]),
        }
    }
    parts
}

/// The part of a segment inside the rectangle (Liang and Barsky, "A new concept and method for line clipping", 1984).
fn segment(from: Point, to: Point, x: &Range<f64>, y: &Range<f64>) -> Option<(Point, Point)> {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    let edges = [(-dx, from.0 - x.start), (dx, x.end - from.0), (-dy, from.1 - y.start), (dy, y.end - from.1)];
    for (speed, room) in edges {
        if speed == 0.0 {
            if room < 0.0 {
                return None;
            }
        } else if speed < 0.0 {
            enter = enter.max(room / speed);
        } else {
            leave = leave.min(room / speed);
        }
    }
    if enter > leave {
        return None;
    }
    let at = |share: f64| (from.0 + share * dx, from.1 + share * dy);
    let start = if enter == 0.0 { from } else { at(enter) };
    let end = if leave == 1.0 { to } else { at(leave) };
    Some((start, end))
}

#[cfg(test)]
mod tests {
    use super::*;

    const X: Range<f64> = 0.0..10.0;
    const Y: Range<f64> = 0.0..10.0;

    #[test]
    fn what_lies_inside_stays_as_it_is() {
        let line = [(1.0, 1.0), (9.0, 2.0), (9.0, 9.0)];
        assert_eq!(polyline(&line, &X, &Y), [line.to_vec()]);
    }

    #[test]
    fn a_line_that_leaves_and_returns_becomes_two() {
        let line = [(5.0, 5.0), (5.0, 15.0), (7.0, 15.0), (7.0, 5.0)];
        let parts = polyline(&line, &X, &Y);
        assert_eq!(parts, [vec![(5.0, 5.0), (5.0, 10.0)], vec![(7.0, 10.0), (7.0, 5.0)]]);
    }

    #[test]
    fn a_line_outside_vanishes_and_one_across_is_cut_at_both_edges() {
        assert!(polyline(&[(-5.0, 11.0), (20.0, 11.0)], &X, &Y).is_empty());
        assert_eq!(polyline(&[(-10.0, 5.0), (20.0, 5.0)], &X, &Y), [vec![(0.0, 5.0), (10.0, 5.0)]]);
    }
}
