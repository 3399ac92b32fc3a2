//! Least distances between lines and arcs.

use core::f64::consts::{PI, TAU};

use super::geometry::{Curve, Point, along, cross, distance, dot, length, minus};

/// Least distance between two curves, mm; 0 where they cross.
pub(super) fn between(one: &Curve, other: &Curve) -> f64 {
    let ends = [to_point(one, other.from), to_point(one, other.to), to_point(other, one.from), to_point(other, one.to)];
    let least = ends.into_iter().fold(f64::INFINITY, f64::min);
    let inner = match (&one.circle, &other.circle) {
        (None, None) if lines_cross(one, other) => 0.0,
        (None, None) => least,
        (None, Some(_)) => line_and_arc(one, other),
        (Some(_), None) => line_and_arc(other, one),
        (Some(_), Some(_)) => two_arcs(one, other),
    };
    least.min(inner)
}

/// Least distance of a curve from a point, mm.
fn to_point(curve: &Curve, point: Point) -> f64 {
    match curve.circle {
        None => {
            let whole = minus(curve.to, curve.from);
            let square = dot(whole, whole);
            let share =
                if square > 0.0 { (dot(minus(point, curve.from), whole) / square).clamp(0.0, 1.0) } else { 0.0 };
            distance(along(curve.from, whole, share), point)
        }
        Some(circle) => {
            let out = minus(point, circle.center);
            if is_within(curve, out) {
                return (length(out) - curve.radius()).abs();
            }
            distance(curve.from, point).min(distance(curve.to, point))
        }
    }
}

/// Whether an arc passes this direction from its centre.
fn is_within(arc: &Curve, direction: Point) -> bool {
    let Some(circle) = &arc.circle else { return false };
    let sweep = circle.sweep_rad.abs();
    if sweep >= TAU {
        return true;
    }
    let (mut start, mut end) = (minus(arc.from, circle.center), minus(arc.to, circle.center));
    if circle.is_clockwise() {
        (start, end) = (end, start);
    }
    if sweep <= PI {
        cross(start, direction) >= 0.0 && cross(direction, end) >= 0.0
    } else {
        cross(end, direction) <= 0.0 || cross(direction, start) <= 0.0
    }
}

fn lines_cross(one: &Curve, other: &Curve) -> bool {
    let sides = |line: &Curve, a: Point, b: Point| {
        let along = minus(line.to, line.from);
        (cross(along, minus(a, line.from)) > 0.0) != (cross(along, minus(b, line.from)) > 0.0)
    };
    sides(one, other.from, other.to) && sides(other, one.from, one.to)
}

/// Where two lines cross between their ends; `None` for arcs.
pub(super) fn crossing(one: &Curve, other: &Curve) -> Option<Point> {
    let is_straight = one.circle.is_none() && other.circle.is_none();
    if !is_straight || !lines_cross(one, other) {
        return None;
    }
    let (whole, across) = (minus(one.to, one.from), minus(other.to, other.from));
    let share = cross(minus(other.from, one.from), across) / cross(whole, across);
    (share > 0.0 && share < 1.0).then(|| along(one.from, whole, share))
}

/// Distance where neither end is nearest; infinite where there is no such place.
fn line_and_arc(line: &Curve, arc: &Curve) -> f64 {
    let Some(circle) = &arc.circle else { return f64::INFINITY };
    let whole = minus(line.to, line.from);
    let square = dot(whole, whole);
    if square == 0.0 {
        return f64::INFINITY;
    }
    let radius = arc.radius();
    let share = dot(minus(circle.center, line.from), whole) / square;
    let foot = along(line.from, whole, share);
    let out = minus(foot, circle.center);
    let off = length(out);
    if off > radius {
        let is_nearest = (0.0..=1.0).contains(&share) && is_within(arc, out);
        return if is_nearest { off - radius } else { f64::INFINITY };
    }
    let half = ((radius - off) * (radius + off) / square).sqrt();
    let crosses = [share - half, share + half].into_iter().any(|share| {
        (0.0..=1.0).contains(&share) && is_within(arc, minus(along(line.from, whole, share), circle.center))
    });
    if crosses { 0.0 } else { f64::INFINITY }
}

/// Distance where neither end is nearest; infinite where there is no such place.
fn two_arcs(one: &Curve, other: &Curve) -> f64 {
    let (Some(first), Some(second)) = (&one.circle, &other.circle) else { return f64::INFINITY };
    let (radius, other_radius) = (one.radius(), other.radius());
    let towards = minus(second.center, first.center);
    let apart = length(towards);
    if apart < 1e-9 {
        // About one centre, the ends say it all.
        return f64::INFINITY;
    }
    if apart <= radius + other_radius && apart >= (radius - other_radius).abs() {
        let reach = (apart * apart + (radius - other_radius) * (radius + other_radius)) / (2.0 * apart);
        let half = ((radius - reach) * (radius + reach)).max(0.0).sqrt();
        let foot = along(first.center, towards, reach / apart);
        let across = [-towards[1] / apart, towards[0] / apart];
        let crosses = [-half, half].into_iter().any(|half| {
            let point = along(foot, across, half);
            is_within(one, minus(point, first.center)) && is_within(other, minus(point, second.center))
        });
        return if crosses { 0.0 } else { f64::INFINITY };
    }
    let away = [-towards[0], -towards[1]];
    let mut least = f64::INFINITY;
    for (direction, sign) in [(towards, 1.0), (away, -1.0)] {
        for (opposite, other_sign) in [(away, -1.0), (towards, 1.0)] {
            if is_within(one, direction) && is_within(other, opposite) {
                least = least.min((apart + other_sign * other_radius - sign * radius).abs());
            }
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(curve: &Curve, count: usize) -> Vec<Point> {
        (0..=count)
            .map(|place| {
                let share = place as f64 / count as f64;
                match curve.circle {
                    None => along(curve.from, minus(curve.to, curve.from), share),
                    Some(circle) => {
                        let out = minus(curve.from, circle.center);
                        let (sine, cosine) = libm::sincos(circle.sweep_rad * share);
                        let turned = [out[0] * cosine - out[1] * sine, out[0] * sine + out[1] * cosine];
                        along(circle.center, turned, 1.0)
                    }
                }
            })
            .collect()
    }

    fn arc(center: Point, radius: f64, from: f64, sweep: f64) -> Curve {
        let at = |angle: f64| {
            let (sine, cosine) = libm::sincos(angle);
            along(center, [cosine, sine], radius)
        };
        Curve::arc(at(from), at(from + sweep), center, sweep)
    }

    #[test]
    fn distances_are_those_of_dense_points() {
        let curves = [
            Curve::line([0.0, 0.0], [10.0, 0.0]),
            Curve::line([3.0, -4.0], [3.0, 4.0]),
            Curve::line([3.0, 1.0], [8.0, 6.0]),
            Curve::line([-4.0, 9.0], [-4.0, 9.5]),
            arc([5.0, 5.0], 3.0, 0.3, 2.0),
            arc([5.0, 5.0], 3.0, 0.3, -4.5),
            arc([5.0, 5.0], 1.0, -2.0, TAU),
            arc([-6.0, 2.0], 4.0, 1.0, 1.0),
            arc([-6.0, 2.0], 4.0, 1.0, -5.5),
            arc([4.0, 0.5], 2.0, 3.0, PI),
            arc([20.0, -3.0], 2.5, 2.0, -3.0),
        ];
        for (place, one) in curves.iter().enumerate() {
            for other in &curves[place + 1..] {
                let found = between(one, other);
                let (these, those) = (points(one, 2_000), points(other, 2_000));
                let dense = these
                    .iter()
                    .flat_map(|&this| those.iter().map(move |&that| distance(this, that)))
                    .fold(f64::INFINITY, f64::min);
                assert!(found <= dense + 1e-9 && dense - found < 0.02, "{one:?} {other:?}: {found}, {dense}");
                assert_eq!(found, between(other, one));
            }
        }
    }
}
