//! The course that the coefficients of a window describe: its ramps, and a segment for each interval.

use super::Task;
use super::check::Governors;
use super::course::{Course, Governor, Segment};
use super::problem::Knots;
use super::samples::Samples;

/// Largest relative error of the length of a segment at its end.
const ARRIVAL: f64 = 1e-9;
/// Largest |ω|·t² of a segment: what the series leave out is then below rounding.
const LARGEST_SERIES: f64 = 0.25;
/// Most times that an interval is halved.
const MOST_PARTS: u32 = 12;

/// The course of the coefficients of b on the knots of a window; `None` where it would rest within.
pub(super) fn course(task: &Task<'_>, (knots, samples): (&Knots, &Samples), c: &[f64]) -> Option<Course> {
    let &Task { path, ramps, ends, .. } = task;
    let intervals = knots.intervals();
    let mut segments = Vec::with_capacity(intervals + 2);
    let (mut s, mut time_s) = (0.0, 0.0);
    let [rise, fall] = ramps;
    let ramp = |start_s, s, speed, acceleration, jerk| Segment {
        start_s,
        s,
        speed,
        acceleration,
        jerk,
        rate: 0.0,
        governor: Governor::Jerk,
    };
    if rise.time_s > 0.0 {
        segments.push(ramp(0.0, 0.0, 0.0, 0.0, rise.jerk));
        (s, time_s) = (rise.length, rise.time_s);
    }
    let governors = Governors { path, samples, knots, c };
    for index in 0..intervals {
        let length = knots.0[index + 1] - knots.0[index];
        let ((b, slope), (next, next_slope)) = (knots.state(index, c), knots.state(index + 1, c));
        let moves = b > 0.0 && next > 0.0;
        if !moves {
            return None;
        }
        // The given speed to the last bit.
        let is_start = index == 0 && ends[0].speed > 0.0;
        let segment = Segment {
            start_s: time_s,
            s,
            speed: if is_start { ends[0].speed } else { b.sqrt() },
            acceleration: 0.5 * slope,
            jerk: 0.0,
            rate: 0.5 * (next_slope - slope) / length,
            governor: governors.of(index),
        };
        time_s = push_parts(&mut segments, segment, length, 0)?;
        s += length;
    }
    if fall.time_s > 0.0 {
        let speed = 0.5 * fall.jerk * fall.time_s * fall.time_s;
        segments.push(ramp(time_s, path.length - fall.length, speed, -fall.jerk * fall.time_s, fall.jerk));
        time_s += fall.time_s;
    }
    time_s.is_finite().then(|| {
        Course::new(segments, path.length, time_s, ends[1].speed, {
            let inside = path.joints.iter().map(|&(_, reserve)| reserve).fold(0.0, f64::max);
            [ends[0].reserve, ends[1].reserve, inside]
        })
    })
}

/// Adds a segment of this length in parts that are short enough for its series; when it ends. `None` where it rests within.
fn push_parts(segments: &mut Vec<Segment>, segment: Segment, length: f64, depth: u32) -> Option<f64> {
    let end_speed = segment.from(length, 0.0).speed;
    let longest_s = 4.0 * length / (segment.speed + end_speed);
    if segment.rate.abs() * longest_s * longest_s > 16.0 * LARGEST_SERIES {
        if depth >= MOST_PARTS {
            return None;
        }
        let half = 0.5 * length;
        let start_s = push_parts(segments, segment, half, depth + 1)?;
        let rest = Segment { start_s, s: segment.s + half, ..segment.from(half, 0.0) };
        return push_parts(segments, rest, length - half, depth + 1);
    }
    segments.push(segment);
    let time_s = segment.time_to(length, longest_s);
    // Where b falls to zero within, the end is never reached.
    let arrives = (segment.after(time_s).0 - length).abs() <= ARRIVAL * length;
    arrives.then_some(segment.start_s + time_s)
}
