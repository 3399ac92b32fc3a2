//! A path whose speed is sought: elements one behind the other, with limits of every axis.

use feedwave_program::{AXIS_COUNT, Position};
use serde::{Deserialize, Serialize};

use crate::{Element, Machine};

/// Limits of every axis of a program; of axes that carry out the same one together the strictest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct AxisLimits {
    /// Velocity, acceleration and jerk, mm or degrees by s, s² and s³; infinite where the machine has no such axis.
    limits: [Position; 3],
}

impl AxisLimits {
    pub(crate) fn new(machine: &Machine) -> Self {
        let mut limits = [[f64::INFINITY; AXIS_COUNT]; 3];
        for axis in &machine.axes {
            let own = [axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3];
            for (limits, own) in limits.iter_mut().zip(own) {
                let limit = &mut limits[axis.axis.index()];
                *limit = own.min(*limit);
            }
        }
        Self { limits }
    }

    /// Smallest acceleration and jerk of an axis, mm/s² and mm/s³.
    pub(crate) fn least(&self) -> [f64; 2] {
        [1, 2].map(|order: usize| self.limits[order].into_iter().fold(f64::INFINITY, f64::min))
    }

    /// Largest jerk of an axis, mm/s³.
    pub(crate) fn largest_jerk(&self) -> f64 {
        self.limits[2].into_iter().filter(|jerk| jerk.is_finite()).fold(0.0, f64::max)
    }
}

/// Part of the path with one commanded speed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span<'a> {
    /// Place where it starts, mm from the start of the path.
    pub(crate) start: f64,
    pub(crate) element: &'a Element,
    /// Arc length of the element there, mm.
    pub(crate) from: f64,
    /// Commanded speed, mm/s; may be infinite.
    pub(crate) command: f64,
}

/// An axis that the path moves, with its limits.
#[derive(Clone, Copy, Debug)]
pub(super) struct MovedAxis {
    index: usize,
    pub(super) velocity: f64,
    pub(super) acceleration: f64,
    pub(super) jerk: f64,
}

/// Derivatives of a moved axis by the place.
pub(super) type Derivatives = [f64; 3];

/// The path between two places at which its speed is given.
#[derive(Clone)]
pub(crate) struct Path<'a> {
    pub(super) spans: &'a [Span<'a>],
    pub(crate) length: f64,
    pub(super) axes: Vec<MovedAxis>,
    /// Places where small steps of direction or curvature are passed, and the share of acceleration and jerk they take.
    pub(super) joints: &'a [(f64, f64)],
    /// A speed that may be reached between two places whatever is commanded: the present one has to come down first.
    ceiling: Option<&'a dyn Fn(f64, f64) -> f64>,
}

impl<'a> Path<'a> {
    /// The path along spans, which end at the place `length`.
    pub(crate) fn new(spans: &'a [Span<'a>], length: f64, limits: &AxisLimits) -> Self {
        let moves = |index: &usize| {
            let axis = feedwave_program::Axis::ALL[*index];
            spans.iter().any(|span| span.element.moves(axis))
        };
        let [velocity, acceleration, jerk] = &limits.limits;
        let axis = |index: usize| MovedAxis {
            index,
            velocity: velocity[index],
            acceleration: acceleration[index],
            jerk: jerk[index],
        };
        let axes = (0..AXIS_COUNT).filter(|&index| velocity[index].is_finite()).filter(moves).map(axis).collect();
        Self { spans, length, axes, joints: &[], ceiling: None }
    }

    /// The path with junctions that take a share of acceleration and jerk.
    pub(crate) fn with_joints(self, joints: &'a [(f64, f64)]) -> Self {
        Self { joints, ..self }
    }

    /// The path where a speed may be reached between two places whatever is commanded: the largest of one that depends on the place.
    pub(crate) fn with_ceiling(self, ceiling: &'a dyn Fn(f64, f64) -> f64) -> Self {
        Self { ceiling: Some(ceiling), ..self }
    }

    /// Smallest acceleration and jerk that the limits of the axes leave along a straight path in its directions, at the
    /// places where spans start and in their middles.
    pub(crate) fn least_along(&self) -> (f64, f64) {
        let mut derivatives = vec![[0.0; 3]; self.axes.len()];
        let (mut acceleration, mut jerk) = (f64::MAX, f64::MAX);
        for (index, span) in self.spans.iter().enumerate() {
            let end = self.spans.get(index + 1).map_or(self.length, |next| next.start);
            for s in [span.start, 0.5 * (span.start + end)] {
                self.derivatives(s, &mut derivatives);
                for (axis, [first, ..]) in self.axes.iter().zip(&derivatives) {
                    acceleration = acceleration.min(axis.acceleration / first.abs());
                    jerk = jerk.min(axis.jerk / first.abs());
                }
            }
        }
        (acceleration, jerk)
    }

    /// Index of the span that a place lies on; the later one where two meet.
    fn span_at(&self, s: f64) -> usize {
        self.spans.partition_point(|span| span.start <= s).saturating_sub(1)
    }

    /// [`Path::span_at`] from a span near it on.
    pub(super) fn span_from(&self, near: usize, s: f64) -> usize {
        let mut span = near;
        while self.spans.get(span + 1).is_some_and(|next| next.start <= s) {
            span += 1;
        }
        while span > 0 && self.spans[span].start > s {
            span -= 1;
        }
        span
    }

    /// Adds the derivatives of the moved axes at a place of a span.
    pub(super) fn add_derivatives(&self, span: usize, s: f64, out: &mut Vec<Derivatives>) {
        let span = &self.spans[span];
        let [first, second, third] = span.element.derivatives(span.from + (s - span.start));
        out.extend(self.axes.iter().map(|axis| [first[axis.index], second[axis.index], third[axis.index]]));
    }

    /// Derivatives of the moved axes at a place.
    pub(super) fn derivatives(&self, s: f64, out: &mut [Derivatives]) {
        let span = &self.spans[self.span_at(s)];
        let [first, second, third] = span.element.derivatives(span.from + (s - span.start));
        for (axis, out) in self.axes.iter().zip(out) {
            *out = [first[axis.index], second[axis.index], third[axis.index]];
        }
    }

    /// Adds the places between two at which third derivatives may jump: where spans meet, and inside of their elements. `near` is a span
    /// near the first.
    pub(super) fn add_breaks(&self, near: usize, [from, to]: [f64; 2], out: &mut Vec<f64>) {
        let mut index = self.span_from(near, from);
        while let Some(span) = self.spans.get(index).filter(|span| span.start < to) {
            if span.start > from {
                out.push(span.start);
            }
            let first = out.len();
            let end = self.spans.get(index + 1).map_or(self.length, |next| next.start).min(to);
            let local = |s: f64| span.from + (s - span.start);
            span.element.add_breaks(local(from.max(span.start)), local(end), out);
            for place in &mut out[first..] {
                *place = span.start + (*place - span.from);
            }
            index += 1;
        }
    }

    /// Middles of the spans that lie wholly between two places.
    pub(super) fn middles_between(&self, from: f64, to: f64) -> impl Iterator<Item = f64> {
        let first = self.spans.partition_point(|span| span.start <= from);
        let ends = self.spans[first..].iter().map(|span| span.start).chain([self.length]).skip(1);
        let wholly = self.spans[first..].iter().zip(ends).take_while(move |&(_, end)| end < to);
        wholly.map(|(span, end)| 0.5 * (span.start + end))
    }

    /// Lowest speed between two places that may be reached, mm/s: the commanded one, or the ceiling.
    pub(super) fn command(&self, from: f64, to: f64) -> f64 {
        let first = self.span_at(from);
        let within = self.spans[first..].iter().take_while(|span| span.start <= to);
        let commanded = within.map(|span| span.command).fold(f64::INFINITY, f64::min);
        // A coefficient of b acts from the interval before.
        self.ceiling.map_or(commanded, |ceiling| commanded.max(ceiling(from - (to - from), to)))
    }
}
