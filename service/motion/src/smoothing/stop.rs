//! Whether a corner takes less time rounded than with a stop in it.
//!
//! In a plan for the least time the speed changes along the corner, and is found by planning it: from rest to rest over the two blocks, where
//! the tolerance is so small for them that little can be gained, or where an axis across is so slow that rounding at one speed would lose.
//!
//! In a plan of runs, round a corner the path runs at one speed, the one that the curve permits. What decides is the time from the middle of the block
//! before it to the middle of the block behind it; corners at their other ends are taken to be like this one.
//!
//! Of short blocks that says little: the path comes to the corner from farther away. There the corner is judged by its distance to others
//! that are as sharp. A sharp corner is passed so slowly that a stop is better, whatever the tolerance, unless the next one is near: then
//! the path does not become fast in between.

use feedwave_program::{Axis, Position};

use super::corner;
use super::vector::linear;
use crate::profile::change_length;
use crate::tolerance::{CORNER_SHARE, CORNER_STOP_GAIN, LEAST_STOP_KINK, MOST_TRIED_OVERLAP, STOP_LENGTHS};
use crate::{Curve, Element, LimitExceeded, Machine, PathLimits, PathMotion, Profile, Spline, path_limits};

/// A corner between two blocks.
pub(super) struct Corner<'a> {
    /// Its curve.
    pub(super) curve: &'a Element,
    /// The blocks before and behind it, cut back for it, and their lengths as programmed, mm.
    pub(super) blocks: [(&'a Element, f64); 2],
    /// What is cut from each of them, mm.
    pub(super) cut_mm: [f64; 2],
    /// Commanded speed, mm/s.
    pub(super) command: f64,
}

impl Corner<'_> {
    /// Whether it is to be rounded; also where the limits leave nothing, which is found later.
    pub(super) fn is_rounded(&self, machine: &Machine) -> bool {
        self.times_s(machine).map_or(true, |[rounded_s, stopped_s]| rounded_s < stopped_s * CORNER_STOP_GAIN)
    }

    /// Whether it is to be rounded in a plan for the least time, where `planned_s` says how long the blocks and the curve take then from
    /// rest to rest, s.
    pub(super) fn is_rounded_in_least_time(&self, machine: &Machine, planned_s: impl FnOnce() -> Option<f64>) -> bool {
        let Some((stopped_s, overlap_s)) = self.stops(machine) else { return true };
        let [first_s, last_s] = stopped_s;
        // Axes that are slower than those along the blocks may take more than the overlap gains.
        let gains = overlap_s > MOST_TRIED_OVERLAP * first_s.min(last_s) && self.is_rounded(machine);
        gains || planned_s().is_none_or(|rounded_s| rounded_s < (first_s + last_s) * CORNER_STOP_GAIN)
    }

    /// Times of the two blocks with a stop between them and rest at their ends, and for how long the ends of both overlap where they
    /// are rounded, s.
    fn stops(&self, machine: &Machine) -> Option<([f64; 2], f64)> {
        let mut overlap_s = f64::INFINITY;
        let mut times_s = [0.0; 2];
        for (((element, _), cut_mm), time_s) in self.blocks.iter().zip(self.cut_mm).zip(&mut times_s) {
            let own = path_limits(element, machine, PathMotion::ZERO).ok()?;
            let limits = PathLimits { velocity: own.velocity.min(self.command), ..own };
            *time_s = Profile::solve(element.length + cut_mm, 0.0, 0.0, limits)?.duration();
            let starting_s = (6.0 * cut_mm / limits.jerk).cbrt().max((2.0 * cut_mm / limits.acceleration).sqrt());
            overlap_s = overlap_s.min(starting_s);
        }
        Some((times_s, overlap_s))
    }

    /// Time rounded, and with a stop, s.
    fn times_s(&self, machine: &Machine) -> Result<[f64; 2], LimitExceeded> {
        let limits = |element: &Element| {
            let own = path_limits(element, machine, PathMotion::ZERO)?;
            Ok(PathLimits { velocity: own.velocity.min(self.command), ..own })
        };
        let speed = limits(self.curve)?.velocity;
        let mut times_s = [self.curve.length / speed, 0.0];
        for ((element, length), cut_mm) in self.blocks.into_iter().zip(self.cut_mm) {
            let limits = limits(element)?;
            let half_s = |length: f64, speed: f64| {
                Profile::solve(length, speed, speed, limits).map_or(0.0, |profile| 0.5 * profile.duration())
            };
            times_s[0] += half_s(length - 2.0 * cut_mm, speed.min(limits.velocity));
            times_s[1] += half_s(length, 0.0);
        }
        Ok(times_s)
    }
}

/// Distance of corners like the one between two elements on both sides, along lines, from which on a stop in it takes less time than
/// passing it within the tolerance, mm; infinite where it does not on lines that are long enough to stop on from the commanded speed.
pub(super) fn better_from_mm(elements: [&Element; 2], tolerance_mm: f64, command: f64, machine: &Machine) -> f64 {
    let is_sharp =
        corner::steps(elements[0], elements[1], f64::INFINITY).is_some_and(|(kink, ..)| kink >= LEAST_STOP_KINK);
    if !is_sharp {
        return f64::INFINITY;
    }
    let stop_mm = |element: &Element, at: f64| {
        let limits = path_limits(&straight(element, at, 1.0), machine, PathMotion::ZERO).ok()?;
        Some(change_length(limits.velocity.min(command), 0.0, &limits))
    };
    let longest_mm = stop_mm(elements[0], elements[0].length).zip(stop_mm(elements[1], 0.0));
    let Some((before, after)) = longest_mm.filter(|(before, after)| before.is_finite() && after.is_finite()) else {
        return f64::INFINITY;
    };
    let mut from_mm = f64::INFINITY;
    let mut length = 2.0 * before.max(after);
    for _ in 0..STOP_LENGTHS {
        if !is_stopped(elements, length, tolerance_mm, command, machine).unwrap_or(false) {
            break;
        }
        from_mm = length;
        length *= 0.25;
    }
    from_mm
}

/// Whether a stop is better between lines of this length; `None` where there is no such curve.
fn is_stopped(
    [before, after]: [&Element; 2],
    length: f64,
    tolerance_mm: f64,
    command: f64,
    machine: &Machine,
) -> Option<bool> {
    let lines = [straight(before, before.length, -length), straight(after, 0.0, length)];
    let rounding = corner::between_lines(&lines[0], &lines[1], tolerance_mm, CORNER_SHARE * length)?;
    let cut_mm = rounding.cut_mm;
    let [first, last] = [lines[0].part(0.0, length - cut_mm)?, lines[1].part(cut_mm, length)?];
    let spline = Spline::from_polynomial_spans(&[rounding.curve(&first, &last)])?;
    let curve = Element::from_spline(first.end, last.start, spline, last.work_offset, last.source, false)?;
    let corner = Corner { curve: &curve, blocks: [(&first, length), (&last, length)], cut_mm: [cut_mm; 2], command };
    Some(!corner.is_rounded(machine))
}

/// The line that goes on from a place of an element in its direction there, or comes to it where the length is negative, mm.
fn straight(element: &Element, at: f64, length: f64) -> Element {
    let tangent = linear(&element.tangent(at));
    let here = element.position(at);
    let mut there: Position = here;
    for (axis, tangent) in [Axis::X, Axis::Y, Axis::Z].into_iter().zip(tangent) {
        there[axis.index()] += length * tangent;
    }
    let (start, end) = if length < 0.0 { (there, here) } else { (here, there) };
    Element { start, end, curve: Curve::Line, length: length.abs(), ..element.clone() }
}
