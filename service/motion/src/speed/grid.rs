//! Where a window has its knots, and where limits are held between them.

use super::path::Path;
use super::problem::{Hold, Knots};
use super::ramp::AlongPath;
use super::samples::Samples;
use super::{Guess, Task, check};

/// Halvings of a time: to a nanosecond of seconds.
const PLACE_STEPS: u32 = 32;
/// Shortest interval, as a share of an ordinary one.
const LEAST_INTERVAL: f64 = 1.0 / 64.0;
/// Fewest intervals: with fewer nothing is free to be chosen.
pub(super) const LEAST_INTERVALS: usize = 6;
/// Most intervals of a window; bounds its memory.
const MOST_INTERVALS: usize = 1 << 13;
/// Part of the acceleration along the path with which dips of a guess are braked into.
const DIP_SHARE: f64 = 0.1;
/// Part of the squared speed of that braking below which a guess is in a deep dip: short blocks at the limits of the axes all along have shallow
/// ones, where the coarse plan does.
const DEEP: f64 = 0.15;
/// How much more than in the middle and at the ends has to be asked at a place of an interval that is held instead of its middle.
const CLEARLY_MORE: f64 = 1.001;

/// Knots at nearly equal times of the guess, closer where the speed has changed for a short time only, and the squares of the
/// guess' speeds there.
pub(super) fn place_knots(task: &Task<'_>, guess: &dyn Guess, interval_s: f64) -> Option<(Knots, Vec<f64>)> {
    let &Task { path, ramps, settled_s, .. } = task;
    let duration_s = guess.duration_s();
    let step_at = |t: f64| {
        let from_start = t - ramps[0].time_s + settled_s[0];
        let from_end = duration_s - t - ramps[1].time_s + settled_s[1];
        let ends = if settled_s[0] > 0.0 { from_start } else { f64::MAX };
        let step = interval_s.min(0.125 * ends);
        if settled_s[1] > 0.0 { step.min(0.111 * from_end) } else { step }
    };
    let [first, last] = [ramps[0].length, path.length - ramps[1].length];
    let has_middle = last > first;
    if !has_middle {
        return None;
    }
    let (mut places, mut squares) = (vec![first], vec![0.0]);
    let end_s = duration_s - ramps[1].time_s;
    let mut t = ramps[0].time_s;
    let start_speed = guess.at(t).1;
    squares[0] = start_speed * start_speed;
    if let Some(&(given_to, _)) = task.window.knots.last() {
        places.extend(task.window.knots.iter().map(|&(place, _)| place));
        squares.extend(task.window.knots.iter().map(|&(_, speed)| speed * speed));
        t = time_at(guess, given_to);
    }
    let least_s = interval_s * LEAST_INTERVAL;
    loop {
        t += step_at(t).max(least_s);
        let is_inside = t < end_s - 0.5 * step_at(end_s).max(least_s);
        if !is_inside || places.len() > MOST_INTERVALS {
            break;
        }
        let (s, speed) = guess.at(t);
        let least = 0.25 * (speed * step_at(t).max(least_s));
        let before = places[places.len() - 1];
        if s - before > least && last - s > least {
            places.push(s);
            squares.push(speed * speed);
        }
    }
    let end_speed = guess.at(end_s).1;
    places.push(last);
    squares.push(end_speed * end_speed);
    (LEAST_INTERVALS..=MOST_INTERVALS).contains(&(places.len() - 1)).then_some((Knots(places), squares))
}

/// Whether the squares of speeds at the knots fall far below those of braking into a dip between faster ones, and starting out of it, with a
/// part of what the axes can: the path passes a narrow bend there.
pub(super) fn dips(path: &Path<'_>, knots: &Knots, squares: &[f64]) -> bool {
    let fall = |ends: &[f64]| {
        let along = AlongPath::at(path, 0.5 * (ends[0] + ends[1]));
        2.0 * DIP_SHARE * along.acceleration * (ends[1] - ends[0])
    };
    let falls: Vec<f64> = knots.0.windows(2).map(fall).collect();
    let mut braking = squares.to_vec();
    for (k, fall) in falls.iter().enumerate() {
        braking[k + 1] = braking[k + 1].max(braking[k] - fall);
    }
    let mut starting = squares[squares.len() - 1];
    for (k, fall) in falls.iter().enumerate().rev() {
        starting = squares[k].max(starting - fall);
        if squares[k] < DEEP * starting.min(braking[k]) {
            return true;
        }
    }
    false
}

/// When a guess passes a place, s.
fn time_at(guess: &dyn Guess, place: f64) -> f64 {
    let (mut low, mut high) = (0.0, guess.duration_s());
    for _ in 0..PLACE_STEPS {
        let middle = 0.5 * (low + high);
        if guess.at(middle).0 < place {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Moves the places inside of intervals at which limits are held from the middle to where, at the squared speeds of a guess, more is
/// asked of an axis than there and at the ends, at which limits are held as well; what is asked inside would otherwise be found to
/// exceed the limits only afterwards.
pub(super) fn place_middles(
    path: &Path<'_>,
    samples: &Samples,
    (knots, squares): (&Knots, &[f64]),
    holds: &mut [Hold],
) {
    let slope_at = |knot: usize| {
        let (before, after) = (knot.saturating_sub(1), (knot + 1).min(knots.intervals()));
        (squares[after] - squares[before]) / (knots.0[after] - knots.0[before])
    };
    let mut slope = slope_at(0);
    for (index, hold) in holds.iter_mut().enumerate() {
        let h = knots.0[index + 1] - knots.0[index];
        let next_slope = slope_at(index + 1);
        let second = (next_slope - slope) / h;
        let asked_at = |place: usize| {
            let x = h * samples.share(place);
            let b = squares[index] + samples.share(place) * (squares[index + 1] - squares[index]);
            let [_, acceleration, jerk] =
                check::shares(path, samples.derivatives(place), [b, slope + x * second, second]);
            acceleration.max(jerk)
        };
        let held = samples.held(index);
        let mut largest = held.map(asked_at).into_iter().fold(0.0, f64::max) * CLEARLY_MORE;
        for place in samples.of(index).filter(|place| !held.contains(place)) {
            let asked = asked_at(place);
            if asked > largest {
                (largest, hold.middle) = (asked, place);
            }
        }
        slope = next_slope;
    }
}
