//! Commanded speed along an element: constant, or following the spindle under constant surface speed.

use core::f64::consts::TAU;

use feedwave_program::{Axis, Feed, Spindle, SpindleSpeed};
use serde::{Deserialize, Serialize};
use smallvec::{SmallVec, smallvec};

use crate::tolerance::{
    MAX_STRETCHES, MAX_TURNS_PER_STRETCH, PLACES_PER_SPLINE_PIECE, SAME_ANGLE_RAD, SURFACE_SPEED_STEP,
};
use crate::{Curve, Element, LimitPiece, Machine, PathLimits};

/// Part of an element with one commanded speed and one set of limits; it starts where the one before ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stretch {
    /// Arc length where it ends, mm.
    pub end: f64,
    /// Commanded speed at 100 % feed override, mm/s; infinite for rapids.
    pub speed_mm_per_s: f64,
    /// Spindle speed, rev/s, without its sense.
    pub spindle_rev_per_s: f64,
    /// Largest feed motion on it.
    pub limits: PathLimits,
}

/// The stretches of one element, in order; mostly one.
pub type Stretches = SmallVec<[Stretch; 1]>;

/// Commanded and spindle speed along an element.
///
/// Feed per revolution under constant surface speed changes with the X radius: the element is then divided so that
/// within a stretch both speeds are constant, the feed per revolution is exactly the programmed one, and the surface
/// speed is never above the programmed one and at most 1 % below it. Should that take more than 2048 stretches (a
/// spiral of many turns through X0), the last one is as slow as its largest radius asks for. The machine's top speed
/// clamps the spindle. On a rapid the spindle turns as at its end: controls look only there.
///
/// The element is divided where its limits change, too.
#[must_use]
pub fn stretches(
    element: &Element,
    feed: Feed,
    spindle: &Spindle,
    machine: &Machine,
    limits: &[LimitPiece],
) -> Stretches {
    let mut divided = commanded(element, feed, spindle, machine);
    match limits {
        [] => divided.clear(),
        [LimitPiece { limits, .. }] => divided.iter_mut().for_each(|stretch| stretch.limits = *limits),
        pieces => {
            let mut whole = core::mem::take(&mut divided).into_iter().peekable();
            let mut pieces = pieces.iter().peekable();
            while let (Some(stretch), Some(&&LimitPiece { end: piece_end, limits })) = (whole.peek(), pieces.peek()) {
                let is_last = pieces.len() == 1;
                let end = if is_last { stretch.end } else { stretch.end.min(piece_end) };
                divided.push(Stretch { end, limits, ..*stretch });
                if !is_last && piece_end <= end {
                    pieces.next();
                }
                if stretch.end <= end {
                    whole.next();
                }
            }
        }
    }
    divided
}

/// Fastest commanded speed along an element, mm/s; infinite for rapids. See [`stretches`].
#[must_use]
pub fn top_command(element: &Element, feed: Feed, spindle: &Spindle, machine: &Machine) -> f64 {
    match feed {
        _ if element.rapid => f64::INFINITY,
        Feed::PerMinute(feed_mm_per_min) => feed_mm_per_min / 60.0,
        Feed::InverseTime(per_min) => element.length * per_min / 60.0,
        Feed::PerRevolution(feed_mm_per_rev) => {
            let [least_radius_mm, _] = element.radius_range_mm();
            feed_mm_per_rev * spindle.rev_per_s(least_radius_mm).min(machine.max_spindle_rev_per_min / 60.0)
        }
    }
}

/// Before the limits are known.
const UNLIMITED: PathLimits = PathLimits { velocity: f64::INFINITY, acceleration: f64::INFINITY, jerk: f64::INFINITY };

/// The stretches by commanded speed alone.
fn commanded(element: &Element, feed: Feed, spindle: &Spindle, machine: &Machine) -> Stretches {
    let top_rev_per_s = machine.max_spindle_rev_per_min / 60.0;
    let spindle_at = |radius_mm: f64| spindle.rev_per_s(radius_mm).min(top_rev_per_s);
    let speed_at = |rev_per_s: f64| match feed {
        _ if element.rapid => f64::INFINITY,
        Feed::PerMinute(feed_mm_per_min) => feed_mm_per_min / 60.0,
        Feed::PerRevolution(feed_mm_per_rev) => feed_mm_per_rev * rev_per_s,
        Feed::InverseTime(per_min) => element.length * per_min / 60.0,
    };
    let stretch = |end: f64, spindle_rev_per_s: f64| Stretch {
        end,
        speed_mm_per_s: speed_at(spindle_rev_per_s),
        spindle_rev_per_s,
        limits: UNLIMITED,
    };

    let x = Axis::X.index();
    let [_, largest_radius_mm] = element.radius_range_mm();
    let moves_x = element.largest_tangent()[x] > 0.0;
    let follows_radius = matches!(spindle.speed, SpindleSpeed::Surface { .. }) && moves_x && !element.rapid;
    if !follows_radius {
        let radius_mm = if element.rapid { element.end[x].abs() } else { element.start[x].abs() };
        return smallvec![stretch(element.length, spindle_at(radius_mm))];
    }

    let spindle_along = |s: f64| {
        let mut position = [0.0];
        element.fill_axis(Axis::X, &[s], &mut position);
        spindle_at(position[0].abs())
    };
    let mut divided = Stretches::new();
    let mut start = 0.0;
    while start < element.length && divided.len() + 1 < MAX_STRETCHES {
        let (end, slowest_rev_per_s) = stretch_from(element, start, &spindle_along);
        divided.push(stretch(end, slowest_rev_per_s));
        start = end;
    }
    if start < element.length {
        divided.push(stretch(element.length, spindle_at(largest_radius_mm)));
    }
    divided
}

/// End of the longest stretch from `start` in which the spindle speed varies by no more than one step, and the lowest
/// spindle speed in it.
fn stretch_from(element: &Element, start: f64, spindle_along: &dyn Fn(f64) -> f64) -> (f64, f64) {
    let mut slowest = spindle_along(start);
    let mut fastest = slowest;
    let mut at = start;
    // A clamped or hardly changing speed may outlast any number of turns of |X|; more of them than this in a stretch
    // would gain nothing.
    for _ in 0..MAX_TURNS_PER_STRETCH {
        let turn = next_turn(element, at);
        // |X| is monotonic up to the turn, so the speeds in between lie between those at its ends.
        let fits = |s: f64| {
            let speed = spindle_along(s);
            speed.max(fastest) <= speed.min(slowest) * SURFACE_SPEED_STEP
        };
        if !fits(turn) {
            let end = narrow(at, turn, &fits);
            // Where even the resolution of the search is too coarse, everything up to the turn has its lowest speed.
            let end = if end > start { end } else { turn };
            return (end, slowest.min(spindle_along(end)));
        }
        let speed = spindle_along(turn);
        slowest = slowest.min(speed);
        fastest = fastest.max(speed);
        at = turn;
        if at >= element.length {
            break;
        }
    }
    (at, slowest)
}

/// First place beyond `s` where |X| may change between growing and shrinking: where X passes zero, and on an arc
/// where X turns round; the element's end when there is none.
fn next_turn(element: &Element, s: f64) -> f64 {
    let x = Axis::X.index();
    let turn = match &element.curve {
        Curve::Arc(arc) if arc.first == Axis::X || arc.second == Axis::X => {
            // Measured from the direction of +X the axis moves with the cosine.
            let (center, direction_rad) =
                if arc.first == Axis::X { (arc.center[0], 0.0) } else { (arc.center[1], TAU / 4.0) };
            let now_rad = arc.start_angle_rad + arc.sweep_rad * (element.evened(s) / element.length) - direction_rad;
            // Not a number, and thus never the smallest, where the circle does not reach X0.
            let zero_rad = libm::acos(-center / arc.start_radius_mm);
            let ahead_rad = [0.0, 0.5 * TAU, zero_rad, -zero_rad]
                .map(|angle_rad| {
                    let ahead = (angle_rad - now_rad) * arc.sweep_rad.signum();
                    let ahead = ahead - (ahead / TAU).floor() * TAU;
                    if ahead > SAME_ANGLE_RAD { ahead } else { ahead + TAU }
                })
                .into_iter()
                .fold(TAU, f64::min);
            let share = element.evened(s) / element.length + ahead_rad / arc.sweep_rad.abs();
            arc.length_share(share) * element.length
        }
        Curve::Spline(spline) => next_turn_of_spline(element, spline.piece_count(), s),
        Curve::FiveAxis(five_axis) => next_turn_of_spline(element, five_axis.piece_count(), s),
        _ => {
            let (start, end) = (element.start[x], element.end[x]);
            start / (start - end) * element.length
        }
    };
    if turn > s { turn.min(element.length) } else { element.length }
}

/// [`next_turn`] of a spline: the first of evenly spaced places that X or its slope passes zero before, found exactly by
/// bisection. There are several places to each of its `pieces`, on which X hardly bends.
fn next_turn_of_spline(element: &Element, pieces: usize, s: f64) -> f64 {
    let sign = |value: f64| if value == 0.0 { 0.0 } else { value.signum() };
    let signs_at = |s: f64| {
        let (mut position, mut tangent) = ([0.0], [0.0]);
        element.fill_axis(Axis::X, &[s], &mut position);
        element.fill_tangent(Axis::X, &[s], &mut tangent);
        [sign(position[0]), sign(tangent[0])]
    };
    let step = element.length / (pieces * PLACES_PER_SPLINE_PIECE) as f64;
    // What is zero at the start has turned there.
    let start = signs_at(s + SAME_ANGLE_RAD * element.length);
    let mut before = s;
    while before < element.length {
        let after = (before + step).min(element.length);
        if signs_at(after) != start {
            return narrow(before, after, &|s| signs_at(s) == start).max(before + SAME_ANGLE_RAD * element.length);
        }
        before = after;
    }
    element.length
}

/// The last place from `good` to `bad` that fits, to the resolution of the search.
fn narrow(mut good: f64, mut bad: f64, fits: &dyn Fn(f64) -> bool) -> f64 {
    for _ in 0..48 {
        let middle = 0.5 * (good + bad);
        if fits(middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    good
}

#[cfg(test)]
mod tests;
