//! Cuts polylines at the edges of a panel; the backends would draw over them.

use std::ops::Range;

type Point = (f64, f64);

/// The parts of a polyline inside the rectangle, each with at least two points. Points that are no numbers interrupt it.
pub(super) fn polyline(line: &[Point], x: &Range<f64>, y: &Range<f64>) -> Vec<Vec<Point>> {
    let mut parts: Vec<Vec<Point>> = Vec::new();
    let is_place = |point: &Point| point.0.is_finite() && point.1.is_finite();
    for pair in line.windows(2).filter(|pair| pair.iter().all(is_place)) {
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
    for (speed, margin) in edges {
        if speed == 0.0 {
            if margin < 0.0 {
                return None;
            }
        } else if speed < 0.0 {
            enter = enter.max(margin / speed);
        } else {
            leave = leave.min(margin / speed);
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

/// The part of a polygon inside the rectangle, one edge after the other (Sutherland and Hodgman, "Reentrant polygon
/// clipping", 1974). Edges along the rectangle may lie on each other where the polygon is not convex.
pub(super) fn polygon(outline: &[Point], x: &Range<f64>, y: &Range<f64>) -> Vec<Point> {
    let finite = outline.iter().copied().filter(|point| !point.0.is_nan() && !point.1.is_nan());
    // What is infinite is far enough away at a hundred spans.
    let far = |value: f64, range: &Range<f64>| {
        let span = 100.0 * (range.end - range.start);
        if value.is_infinite() { value.clamp(range.start - span, range.end + span) } else { value }
    };
    let mut kept: Vec<Point> = finite.map(|point| (far(point.0, x), far(point.1, y))).collect();
    let sides: [&dyn Fn(Point) -> f64; 4] =
        [&|point| point.0 - x.start, &|point| x.end - point.0, &|point| point.1 - y.start, &|point| y.end - point.1];
    for margin in sides {
        let mut inside = Vec::with_capacity(kept.len() + 4);
        for (index, &to) in kept.iter().enumerate() {
            let from = kept[(index + kept.len() - 1) % kept.len()];
            let (before, after) = (margin(from), margin(to));
            if (before < 0.0) != (after < 0.0) {
                let share = before / (before - after);
                inside.push((from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1)));
            }
            if after >= 0.0 {
                inside.push(to);
            }
        }
        kept = inside;
    }
    kept
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
    fn a_polygon_is_cut_at_every_edge_and_one_outside_vanishes() {
        let whole = [(-5.0, -5.0), (20.0, -5.0), (20.0, f64::INFINITY), (-5.0, f64::INFINITY)];
        let corners = polygon(&whole, &X, &Y);
        for corner in [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)] {
            assert!(corners.contains(&corner), "{corners:?}");
        }
        assert!(corners.iter().all(|point| (0.0..=10.0).contains(&point.0) && (0.0..=10.0).contains(&point.1)));
        assert!(polygon(&[(11.0, 1.0), (12.0, 1.0), (12.0, 9.0)], &X, &Y).is_empty());
        let inside = [(1.0, 1.0), (9.0, 1.0), (5.0, 9.0)];
        assert_eq!(polygon(&inside, &X, &Y), inside);
    }

    #[test]
    fn a_line_outside_vanishes_and_one_across_is_cut_at_both_edges() {
        assert!(polyline(&[(-5.0, 11.0), (20.0, 11.0)], &X, &Y).is_empty());
        assert_eq!(polyline(&[(-10.0, 5.0), (20.0, 5.0)], &X, &Y), [vec![(0.0, 5.0), (10.0, 5.0)]]);
    }
}
