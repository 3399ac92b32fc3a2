//! U-turns: two long lines that run back, with a short step between them, as the passes of a raster are joined.
//!
//! A corner alone has no room beside the step, and a curve that bends little all along swings out: both nearly stop. What takes the least
//! time is one reversal of the lines' axis, whose acceleration goes on through the turn, while the step is carried out by itself. With
//! t from −1 to 1, e half the difference of the directions d₀ and d₂ of the lines, and m the step,
//!
//! ```text
//! q(t) = corner − (u + c·t²)·e + g(t)/2·(d₀ + d₂) + m·σ((t + 1)/2)
//! ```
//!
//! where σ goes from 0 to 1 with a third derivative of 32, −32, and 32 again, as an axis does that starts and brakes at constant jerk. g is
//! −(u + c·t²) before and u + c·t² behind −1/2 and 1/2, so that the curve is on the lines there, and a cubic polynomial between with the
//! same values and slopes: it has no weight where the lines are parallel.
//!
//! **Deviation.** Before the middle the curve is at x = u + c·t² from the first corner along the line, and at y = m·σ along the step. With
//! the place t₀ at which both are equal, or the middle where u is larger than half of the step: before it the curve is no farther from the
//! line than y₀, behind it no farther from the step than x₀; points of line and step beyond x₀ and y₀ have a point of the curve as near,
//! and for those between, up to the corner, it is the one at t₀, from which the corner is the farthest or one end. So it is behind the middle.
//!
//! **Cut.** c is what the line's axis moves back in half of the time that the step takes from rest to rest, and less where the tolerance
//! or the lines ask for it. What the tolerance leaves makes the way of that axis shorter, by u.

use feedwave_program::Position;

use super::origin::{Deviation, Origin};
use super::vector::{Vector, difference, linear, norm, scaled, sum};
use super::ways::Way;
use super::{ALMOST, Carried, CornerSpeed, Entry, Joining, PathSmoother, Smoothed};
use crate::tolerance::{
    CORNER_SHARE, LEAST_CORNER_CUT_MM, LEAST_STOP_KINK, LEAST_TURN_SHARE, MOST_TURN_SKEW, TURN_STEPS,
    UNUSED_TOLERANCE_MM,
};
use crate::{Curve, Element, Machine, PathLimits, PathMotion, Profile, Spline, path_limits};

/// A U-turn of three lines.
pub(super) struct UTurn {
    directions: [Vector; 2],
    /// From the first corner to the second, mm.
    step: Vector,
    /// c, and u, mm: together what is cut from both lines.
    reversal_mm: f64,
    lead_mm: f64,
    /// Upper bound of the distance between curve and lines, mm.
    deviation_mm: f64,
    /// Whether the lines have no room for a longer one, whatever the tolerance.
    fills_lines: bool,
}

/// The part of the step that is carried out at t, from −1 to 1.
fn step_share(t: f64) -> f64 {
    let u = 0.5 * (t + 1.0);
    let end = |u: f64| 16.0 / 3.0 * u * u * u;
    if u < 0.25 {
        end(u)
    } else if u > 0.75 {
        1.0 - end(1.0 - u)
    } else {
        let middle = u - 0.5;
        0.5 + 2.0 * middle - 16.0 / 3.0 * middle * middle * middle
    }
}

/// Largest number of `0..most` for which it holds, where it holds for all that are smaller.
fn largest(most: f64, holds: impl Fn(f64) -> bool) -> f64 {
    if holds(most) {
        return most;
    }
    let [mut low, mut high] = [0.0, most];
    for _ in 0..TURN_STEPS {
        let middle = 0.5 * (low + high);
        if holds(middle) { low = middle } else { high = middle }
    }
    low
}

impl UTurn {
    fn cut_mm(&self) -> f64 {
        self.lead_mm + self.reversal_mm
    }

    /// Upper bound of the distance between curve and lines, mm.
    fn deviation_at(&self, reversal_mm: f64, lead_mm: f64) -> f64 {
        let [first, last] = self.directions;
        let step_mm = norm(self.step);
        let along = scaled(self.step, 1.0 / step_mm);
        let at = |t: f64| [lead_mm + reversal_mm * t * t, step_mm * step_share(t)];
        let before = |share: f64| {
            let [back, beside] = at(share - 1.0);
            beside <= back
        };
        let [back, beside] = at(largest(1.0, before) - 1.0);
        let corner = |line: Vector, step: Vector| norm(difference(scaled(step, beside), scaled(line, back)));
        let corners = corner(first, along).max(corner(scaled(last, -1.0), scaled(along, -1.0)));
        // g is off by less than this from what would lead along the lines.
        let beside_lines = 0.5 * (lead_mm + 0.02 * reversal_mm) * norm(sum(first, last));
        back.max(beside).max(corners) + beside_lines
    }

    /// Control points of its parts, of the first line, the step, and the last line, from the first corner.
    fn control_points(&self) -> [[Vector; 4]; 3] {
        let [first, last] = self.directions;
        let back = scaled(difference(first, last), -0.5);
        let beside = scaled(sum(first, last), 0.5);
        let point = |along_mm: f64, odd_mm: f64, share: f64| {
            sum(sum(scaled(back, along_mm), scaled(beside, odd_mm)), scaled(self.step, share))
        };
        // Polar values of u + c·t² between −1 and −1/2, and between −1/2 and 1/2.
        let [ends, near, far, inner, middle] =
            [1.0, 2.0 / 3.0, 5.0 / 12.0, 0.25, -1.0 / 12.0].map(|square| self.lead_mm + self.reversal_mm * square);
        // That of g in its second control point.
        let odd = self.reversal_mm / 3.0 - inner;
        [
            [point(ends, -ends, 0.0), point(near, -near, 0.0), point(far, -far, 0.0), point(inner, -inner, 1.0 / 12.0)],
            [
                point(inner, -inner, 1.0 / 12.0),
                point(middle, odd, 0.25),
                point(middle, -odd, 0.75),
                point(inner, inner, 11.0 / 12.0),
            ],
            [point(inner, inner, 11.0 / 12.0), point(far, far, 1.0), point(near, near, 1.0), point(ends, ends, 1.0)],
        ]
    }
}

/// A position with X, Y and Z of its own.
fn place(beside: &Position, [x, y, z]: Vector) -> Position {
    let mut position = *beside;
    position[..3].copy_from_slice(&[x, y, z]);
    position
}

/// What the axis of a line moves back in half of the time that the step takes from rest to rest, mm.
fn reversal_mm([line, step, back]: [&Element; 3], commands: [f64; 2], machine: &Machine) -> Option<f64> {
    let length_mm = line.length.min(back.length);
    let limits = |element: &Element, command: f64| {
        let own = path_limits(element, machine, PathMotion::ZERO).ok()?;
        Some(PathLimits { velocity: own.velocity.min(command), ..own })
    };
    let [line, step_limits] = [limits(line, commands[0])?, limits(step, commands[1])?];
    let half_s = 0.5 * Profile::solve(step.length, 0.0, 0.0, step_limits)?.duration();
    // What the jerk leaves of the acceleration at the turn, from which the axis comes to its speed, or to the middle of the line.
    let jerk = line.jerk;
    let reached = (2.0 * jerk * line.velocity).sqrt().min(jerk * (1.5 * length_mm / jerk).cbrt());
    let acceleration = line.acceleration.min(reached);
    let falls = if reached < line.acceleration { jerk } else { 0.0 };
    let braking_s = half_s.min(line.velocity / acceleration);
    let braked_mm = braking_s * braking_s * (0.5 * acceleration - falls * braking_s / 6.0);
    Some(braked_mm + (half_s - braking_s) * line.velocity)
}

impl<T: Carried> PathSmoother<T> {
    /// The U-turn that three elements from this one on are, as far as they can be passed as one.
    pub(super) fn u_turn(&self, index: usize, joining: Joining<'_>) -> Option<UTurn> {
        let at = |offset: usize| self.pending.get(index + offset);
        let entries: [&Entry<T>; 3] = [at(0)?, at(1)?, at(2)?];
        let [line, step, back] = entries;
        let are_lines = entries.iter().all(|entry| entry.is_joinable() && matches!(entry.element.curve, Curve::Line));
        let is_sharp = |entry: &Entry<T>| entry.joint.kink().is_some_and(|kink| kink >= LEAST_STOP_KINK);
        let is_whole = !step.start_is_cut && step.element.length == step.full_length_mm;
        if !are_lines || !is_sharp(line) || !is_sharp(step) || !is_whole || line.control != step.control {
            return None;
        }
        let directions = [line, back].map(|entry| linear(&entry.element.tangent(0.0)));
        if norm(sum(directions[0], directions[1])) > MOST_TURN_SKEW {
            return None;
        }
        let merged_mm = entries.map(|entry| entry.merged.largest_mm).into_iter().fold(0.0, f64::max);
        let tolerance_mm = line.corner_tolerance_mm()? - merged_mm - UNUSED_TOLERANCE_MM;
        let commands = [line, step].map(|entry| entry.carried.commanded_mm_per_s(&entry.element, joining.machine));
        let reversal_mm = reversal_mm(entries.map(|entry| &entry.element), commands, joining.machine)?;
        let room_mm = ALMOST * (CORNER_SHARE * line.full_length_mm.min(back.full_length_mm)).min(line.element.length);
        let step_mm = difference(linear(&step.element.end), linear(&step.element.start));
        let mut turn =
            UTurn { directions, step: step_mm, reversal_mm: 0.0, lead_mm: 0.0, deviation_mm: 0.0, fills_lines: false };
        let most_mm = reversal_mm.min(room_mm);
        turn.reversal_mm = largest(most_mm, |reversal_mm| turn.deviation_at(reversal_mm, 0.0) <= tolerance_mm);
        if turn.reversal_mm < LEAST_CORNER_CUT_MM.max(LEAST_TURN_SHARE * reversal_mm) {
            return None;
        }
        if turn.reversal_mm >= most_mm {
            let most_mm = room_mm - turn.reversal_mm;
            turn.lead_mm = largest(most_mm, |lead_mm| turn.deviation_at(turn.reversal_mm, lead_mm) <= tolerance_mm);
            turn.fills_lines = turn.lead_mm >= most_mm;
        }
        turn.deviation_mm = turn.deviation_at(turn.reversal_mm, turn.lead_mm) + merged_mm;
        Some(turn)
    }

    /// Whether the path turns back over the first three elements in one curve; `None` until that is known.
    pub(super) fn turns_back(&mut self, is_last: bool, joining: Joining<'_>) -> Option<bool> {
        let way = |index: usize| self.pending.get(index).map(|entry| entry.joint.way());
        if way(0) == Some(Way::Turned) {
            return Some(true);
        }
        let may_turn = !self.is_trial && joining.corner_speed == CornerSpeed::Changing && way(0) == Some(Way::Open);
        let is_sharp =
            self.pending.front().and_then(|front| front.joint.kink()).is_some_and(|kink| kink >= LEAST_STOP_KINK);
        let is_line = |entry: &Entry<T>| entry.is_joinable() && matches!(entry.element.curve, Curve::Line);
        if !may_turn || !is_sharp || !self.pending.iter().take(3).all(is_line) {
            return Some(false);
        }
        if self.pending.len() < 3 {
            return if is_last { Some(false) } else { None };
        }
        if way(1) != Some(Way::Open) || self.u_turn(0, joining).is_none() {
            return Some(false);
        }
        if self.pending.len() < TURN_SEEN && !is_last {
            return None;
        }
        let corners = [0, 1];
        let chosen = self.quickest_turn(&corners, joining);
        self.set_ways(&corners, &chosen);
        Some(chosen[0] == Way::Turned)
    }

    /// Gives on the first line, the curve, and keeps what is left of the last line.
    pub(super) fn round_turn(&mut self, joining: Joining<'_>, emit: &mut impl FnMut(Smoothed<T>)) {
        let Some((turn, parts)) = self.u_turn(0, joining).and_then(|turn| {
            let parts = self.turn_parts(&turn)?;
            Some((turn, parts))
        }) else {
            // A turn before it has taken the room that there was when it was tried.
            self.set_ways(&[0, 1], &[Way::Alone; 2]);
            return;
        };
        self.pass(2);
        let [before, curves @ .., after] = parts;
        let (Some(line), Some(step)) = (self.pending.pop_front(), self.pending.pop_front()) else { return };
        let Some(back) = self.pending.front_mut() else { return };
        back.merged = back.merged.behind(turn.cut_mm(), after.length);
        back.element = after;
        back.start_is_cut = true;
        let last = (back.carried.clone(), 0);
        let deviation = line.merged.behind(0.0, before.length);
        let (blocks, rest_at_end, origin) = (0, false, Origin::Block);
        let first = line.carried.clone();
        self.give(Smoothed { element: before, carried: first, blocks, rest_at_end, origin, deviation }, emit);
        let origin = Origin::Corner { fills_blocks: turn.fills_lines };
        for (element, (carried, blocks)) in
            curves.into_iter().zip([(line.carried, line.blocks), (step.carried, step.blocks), last])
        {
            let deviation = Deviation { largest_mm: turn.deviation_mm, at_mm: 0.5 * element.length };
            self.give(Smoothed { element, carried, blocks, rest_at_end, origin, deviation }, emit);
        }
    }

    /// The first line cut back, the three parts of the curve, and the last line cut back.
    fn turn_parts(&self, turn: &UTurn) -> Option<[Element; 5]> {
        let [line, step, back] = [0, 1, 2].map(|index| &self.pending[index].element);
        let before = line.part(0.0, line.length - turn.cut_mm())?;
        let after = back.part(turn.cut_mm(), back.length)?;
        let corner = linear(&line.end);
        let mut at = before.end;
        let mut part = |programmed: &Element, points: [Vector; 4], end: Option<Position>| {
            let mut points = points.map(|point| sum(corner, point));
            let end = end.unwrap_or_else(|| place(&at, points[3]));
            (points[0], points[3]) = (linear(&at), linear(&end));
            let spline = Spline::from_cubic_spans(&[points])?;
            let element = Element::from_spline(at, end, spline, programmed.work_offset, programmed.source, false);
            at = end;
            element
        };
        let [first, middle, last] = turn.control_points();
        let curve = [part(line, first, None)?, part(step, middle, None)?, part(back, last, Some(after.start))?];
        let [first, middle, last] = curve;
        Some([before, first, middle, last, after])
    }
}

/// Elements that are known before a U-turn is tried, and with which it is: the next one may be within reach.
pub(super) const TURN_SEEN: usize = 6;

#[cfg(test)]
mod tests;
