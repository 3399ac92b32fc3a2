//! The feed direction along an element: how much of it lies across the tool, and how fast it turns there.
//!
//! The direction h of the path, as the tool sees it, is a unit vector that changes by at most κ + ω by mm, with the path's
//! curvature κ and the rate ω of the rotary axes. So its share p across the tool changes by no more than that either, and
//! between two places with p₀ and p₁, l apart, it is at least (p₀ + p₁)/2 − (κ + ω)·l/2. Stretches are halved until that
//! bound decides. The feed direction then turns by at most (κ + ω)/p.

use core::f64::consts::TAU;

use feedwave_motion::kinematics::ToolFrame;
use feedwave_motion::{Arc, Curve, Element, Turning};
use feedwave_program::{Axis, Position};

use super::superposition::seen_by_tool;

/// Least share of the feed direction across the tool: beyond 84 degrees the tool plunges.
const LEAST_IN_PLANE: f64 = 0.1;
/// A share that is examined between two places is proven to be this part of that at the places at least.
const PROVEN: f64 = 0.98;
/// Most halvings of a stretch.
const MAX_HALVINGS: u32 = 40;

/// An arc length at which the path goes along the tool axis, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plunge(pub(super) f64);

/// The direction of the path, under tool centre point control as the tool sees it.
pub(crate) fn heading(frame: Option<&ToolFrame>, element: &Element, s: f64) -> Position {
    let (Curve::FiveAxis(five_axis), Some(frame)) = (&element.curve, frame) else { return element.tangent(s) };
    let mut heading = Position::default();
    heading[..3].copy_from_slice(&seen_by_tool(frame, element, five_axis, s));
    heading
}

/// Upper bound of how fast the feed direction turns across the tool along an element, rad/mm; close where it is above
/// `most_per_mm`.
pub(super) fn turning_per_mm(frame: Option<&ToolFrame>, element: &Element, most_per_mm: f64) -> Result<f64, Plunge> {
    let in_plane = |s: f64| {
        let heading = heading(frame, element, s);
        libm::hypot(heading[Axis::X.index()], heading[Axis::Y.index()])
    };
    match &element.curve {
        Curve::Line => least(&[0.0], in_plane).map(|_| 0.0),
        Curve::Arc(arc) => {
            let curvature = element.curvature();
            let in_work_plane = (arc.first, arc.second) == (Axis::X, Axis::Y);
            if in_work_plane {
                return least(&[0.0, element.length], in_plane).map(|share| curvature / share);
            }
            // Only X or Y follows the circle, the other goes on evenly.
            let (circling, even) = if arc.first == Axis::Z { (arc.second, Axis::Y) } else { (arc.first, Axis::X) };
            let even = element.tangent(0.0)[even.index()].abs();
            let [first, second] = standstills_mm(arc, circling, element.length);
            let share = least(&[0.0, first, second, element.length], in_plane)?;
            Ok(curvature * (even / (share * share)).max(1.0))
        }
        Curve::Spline(_) | Curve::FiveAxis(_) => {
            let mut search = Search { in_plane, most_per_mm, fastest_per_mm: 0.0 };
            let mut start = search.at(0.0);
            for turning in element.turnings() {
                let end = search.at(turning.end_mm);
                search.examine(&turning, start, end, MAX_HALVINGS)?;
                start = end;
            }
            Ok(search.fastest_per_mm)
        }
    }
}

/// The least share at these places, mm.
fn least(places_mm: &[f64], in_plane: impl Fn(f64) -> f64) -> Result<f64, Plunge> {
    let mut least = f64::INFINITY;
    for &s in places_mm {
        let share = in_plane(s);
        if share.is_nan() || share < LEAST_IN_PLANE {
            return Err(Plunge(s));
        }
        least = least.min(share);
    }
    Ok(least)
}

/// Where an axis of an arc's plane first stands still in each sense, mm; the start where the arc has no such place.
fn standstills_mm(arc: &Arc, axis: Axis, length_mm: f64) -> [f64; 2] {
    let from_rad = if axis == arc.first { 0.0 } else { 0.25 * TAU };
    [from_rad, from_rad + 0.5 * TAU].map(|angle_rad| {
        let turns = (angle_rad - arc.start_angle_rad) * arc.sweep_rad.signum() / TAU;
        let share = (turns - turns.floor()) * TAU / arc.sweep_rad.abs();
        if share <= 1.0 { arc.length_share(share) * length_mm } else { 0.0 }
    })
}

/// A place, mm, with the share of the feed direction across the tool.
type Place = (f64, f64);

struct Search<F> {
    in_plane: F,
    most_per_mm: f64,
    fastest_per_mm: f64,
}

impl<F: Fn(f64) -> f64> Search<F> {
    fn at(&self, s: f64) -> Place {
        (s, (self.in_plane)(s))
    }

    /// Examines the stretch between two places.
    fn examine(&mut self, turning: &Turning, start: Place, end: Place, halvings: u32) -> Result<(), Plunge> {
        for (s, share) in [start, end] {
            if share < LEAST_IN_PLANE {
                return Err(Plunge(s));
            }
        }
        let change_per_mm = turning.path_rad_per_mm + turning.rotary_rad_per_mm;
        let share = 0.5 * (start.1 + end.1) - 0.5 * change_per_mm * (end.0 - start.0);
        let per_mm = change_per_mm / share;
        let is_close = share >= PROVEN * start.1.min(end.1);
        if is_close || (share >= PROVEN * LEAST_IN_PLANE && per_mm <= self.most_per_mm) {
            self.fastest_per_mm = self.fastest_per_mm.max(per_mm);
            return Ok(());
        }
        let middle = self.at(0.5 * (start.0 + end.0));
        if halvings == 0 {
            // What cannot be proven is refused.
            return Err(Plunge(middle.0));
        }
        self.examine(turning, start, middle, halvings - 1)?;
        self.examine(turning, middle, end, halvings - 1)
    }
}
