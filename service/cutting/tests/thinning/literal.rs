//! The algorithm of docs/functions/five-axis-thinning.md ("Algorithm") word for word, with the optional tolerance as
//! another reason to shrink.

use feedwave_cutting::thinning::{CutPoint, ThinningSettings};
use feedwave_motion::kinematics::vector::{Vec3, add_scaled, angle, dot, norm, sub};
use feedwave_motion::kinematics::{GreatCircle, RotaryDirections};

fn share(p: Vec3, start: Vec3, end: Vec3) -> Option<f64> {
    let travel = sub(end, start);
    (dot(travel, travel) > 0.0).then(|| (dot(sub(p, start), travel) / dot(travel, travel)).clamp(0.0, 1.0))
}

fn distance(p: Vec3, start: Vec3, end: Vec3) -> f64 {
    let share = share(p, start, end).unwrap_or(0.0);
    norm(sub(p, add_scaled(start, sub(end, start), share)))
}

/// Angle of a dropped point's direction against the interpolated one, rad.
fn direction_error(points: &[CutPoint], s: usize, k: usize, e: usize, axes: Option<&RotaryDirections>) -> f64 {
    let by_count = (k - s) as f64 / (e - s) as f64;
    let share = share(points[k].tip_mm, points[s].tip_mm, points[e].tip_mm).unwrap_or(by_count);
    let between = match (axes, points[s].rotary_rad, points[e].rotary_rad) {
        (Some(axes), Some(a), Some(b)) => axes.at([0, 1].map(|axis| a[axis] + (b[axis] - a[axis]) * share)),
        _ => match GreatCircle::new(points[s].direction, points[e].direction) {
            Ok(circle) => circle.at(share),
            Err(_) => return std::f64::consts::PI,
        },
    };
    angle(between, points[k].direction)
}

/// The places of the kept points of a group.
pub fn kept(points: &[CutPoint], settings: &ThinningSettings, axes: Option<&RotaryDirections>) -> Vec<usize> {
    let theta = settings.angle_tolerance_deg.to_radians();
    let d = settings.distance_tolerance_mm;
    if points.is_empty() {
        return Vec::new();
    }
    let last = points.len() - 1;
    let mut kept = vec![0];
    let mut i = 0;
    loop {
        let s = i;
        loop {
            i += 1;
            if i > last || angle(points[s].direction, points[i].direction) >= theta {
                break;
            }
        }
        i = i.min(last);
        if i == s {
            return kept;
        }
        let mut e = i;
        let mut k = s + 1;
        while k < e {
            let off = settings
                .interpolated_direction_tolerance_deg
                .is_some_and(|tolerance| direction_error(points, s, k, e, axes) >= tolerance.to_radians());
            if off || distance(points[k].tip_mm, points[s].tip_mm, points[e].tip_mm) >= d {
                e = k;
                k = s + 1;
            } else {
                k += 1;
            }
        }
        kept.push(e);
        i = e;
    }
}
