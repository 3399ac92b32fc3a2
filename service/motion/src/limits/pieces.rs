//! Limits that change along an element: splines and five-axis motion.
//!
//! On a stretch of such an element each axis' derivatives by arc length have upper bounds T₁, T₂ and T₃, and nothing is known of
//! how they go together but that the sums must stay within the limits A and J of the axis:
//!
//! ```text
//! a·T₁ + v²·T₂ ≤ A
//! j·T₁ + 3·v·a·T₂ + v³·T₃ ≤ J
//! ```
//!
//! The speed takes v²·T₂ ≤ A·min(0.8, 1 − 0.6·R₁), which leaves the feed an acceleration of 0.6·A at least. R₁ is T₁, but where
//! an axis moves faster than the path (machine axes under five-axis motion) or is stronger than another one, only the
//! share of A that it has in the largest acceleration that no axis forbids. On a circle, T₁
//! and T₂ the cosine and κ times the sine of the same angle, that is v²κ ≥ 0.8·A in every direction, what an arc takes. It also
//! takes v³·T₃ ≤ J/4; twice what it really takes is left out of the jerk for the feed, so that a junction that takes
//! the share u ≤ ½ of J, for which acceleration and jerk are lowered by as much, fits: v³·T₃ + (1 − u)·(J − 2·v³·T₃) + u·J ≤ J.
//! Of the rest the part of T₂/K in R₁ + T₂/K may go to 3·v·a·T₂, with K the largest T₂ of all axes as a share of their J; what
//! the acceleration leaves goes to j·T₁.
//!
//! The element is divided where one set of limits would cost a part of it more than about a tenth of its time (v goes by
//! λ, a by λ², j by λ³): polynomials are halved while that gains much, and neighbours joined while that costs little.

use feedwave_program::{AXIS_COUNT, Axis, Position};
use serde::{Deserialize, Serialize};
use smallvec::{SmallVec, smallvec};

use super::{LimitExceeded, PathLimits, PathMotion, Quantity, path_limits, rest};
use crate::element::Part;
use crate::tolerance::{
    CENTRIPETAL_SHARE, LIMIT_GAIN, LIMIT_HALVINGS, LIMIT_SLOWDOWN, MAX_LIMIT_PIECES, SPLINE_TURNING_JERK_SHARE,
    TANGENTIAL_SHARE,
};
use crate::{Curve, Element, Machine, MachineAxis};

/// Factor on a speed: more than what rounding adds to it.
const SLOWER: f64 = 1.0 + 1e-9;

/// Part of an element with one set of limits; it starts where the one before ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LimitPiece {
    /// Arc length where it ends, mm; of the last piece the element's length.
    pub end: f64,
    /// Largest motion of the feed on it.
    pub limits: PathLimits,
}

/// The pieces of an element in order, at least one and at most 256; one for lines and arcs.
pub type LimitPieces = SmallVec<[LimitPiece; 1]>;

/// Upper bounds of the absolute derivatives by arc length on a stretch.
#[derive(Clone, Copy)]
struct Bounds([Position; 3]);

impl Bounds {
    fn union(&self, other: &Self) -> Self {
        Self(core::array::from_fn(|order| core::array::from_fn(|axis| self.0[order][axis].max(other.0[order][axis]))))
    }
}

/// A stretch and what it allows.
struct Stretch {
    end: f64,
    bounds: Bounds,
    limits: PathLimits,
}

/// Whether what holds for a union costs none of its parts more than the share `slowdown` of its time.
fn is_close(union: &PathLimits, part: &PathLimits, slowdown: f64) -> bool {
    let scale = 1.0 - slowdown;
    union.velocity >= scale * part.velocity
        && union.acceleration >= scale * scale * part.acceleration
        && union.jerk >= scale * scale * scale * part.jerk
}

/// Largest feed motion along the pieces of an element when the peaks of `superposed` are added on top; [`path_limits`] is
/// the tightest of them.
///
/// The machine must have every axis that the element moves; see [`super::missing_axis`]. No piece is faster than
/// `top_speed` mm/s: speeds that are never commanded need not be examined, and what the turning of a spline does not
/// take at that speed is left for acceleration and jerk.
///
/// # Errors
/// [`LimitExceeded`] for the first axis whose limit leaves less than a fiftieth for the feed, anywhere.
pub fn limit_pieces(
    element: &Element,
    machine: &Machine,
    superposed: PathMotion,
    top_speed: f64,
) -> Result<LimitPieces, LimitExceeded> {
    match &element.curve {
        Curve::Line | Curve::Arc(_) => {
            let limits = path_limits(element, machine, superposed)?;
            Ok(smallvec![LimitPiece { end: element.length, limits }])
        }
        Curve::Spline(spline) => {
            let rule = Rule::new(element, machine, superposed, top_speed, [Axis::X, Axis::Y, Axis::Z]);
            rule.pieces(spline.parts(), element.length)
        }
        Curve::FiveAxis(five_axis) => {
            let rule = Rule::new(element, machine, superposed, top_speed, *five_axis.axes());
            rule.pieces(five_axis.parts(), element.length)
        }
    }
}

/// What limits depend on beside the derivatives of the curve's own axes.
struct Rule<'a, const AXES: usize> {
    machine: &'a Machine,
    superposed: PathMotion,
    /// The curve's own axes.
    axes: [Axis; AXES],
    /// Derivatives of the axes beside them.
    beside: Position,
    /// Fastest that the path will be run, mm/s.
    top_speed: f64,
}

impl<'a, const AXES: usize> Rule<'a, AXES> {
    fn new(
        element: &Element,
        machine: &'a Machine,
        superposed: PathMotion,
        top_speed: f64,
        axes: [Axis; AXES],
    ) -> Self {
        let mut beside: Position =
            core::array::from_fn(|axis| (element.end[axis] - element.start[axis]).abs() / element.length);
        for axis in axes {
            beside[axis.index()] = 0.0;
        }
        Self { machine, superposed, axes, beside, top_speed }
    }

    /// The pieces of a curve of this length.
    fn pieces(&self, parts: impl Iterator<Item = Part<AXES>>, length: f64) -> Result<LimitPieces, LimitExceeded> {
        let mut stretches = Vec::new();
        for part in parts {
            self.divide(&part, 0, &mut stretches)?;
        }
        let mut slowdown = LIMIT_SLOWDOWN;
        loop {
            let mut pieces = self.merge(&stretches, slowdown)?;
            if pieces.len() <= MAX_LIMIT_PIECES {
                if let Some(last) = pieces.last_mut() {
                    last.end = length;
                }
                return Ok(pieces);
            }
            slowdown = if slowdown < 0.5 { 2.0 * slowdown } else { 1.0 };
        }
    }

    fn bounds(&self, own: [[f64; AXES]; 3]) -> Bounds {
        let mut bounds = Bounds([self.beside, [0.0; AXIS_COUNT], [0.0; AXIS_COUNT]]);
        for (all, own) in bounds.0.iter_mut().zip(own) {
            for (axis, own) in self.axes.iter().zip(own) {
                all[axis.index()] = own;
            }
        }
        bounds
    }

    /// Appends the stretches of a part, divided until its limits are nearly those of its ends and of its middle.
    fn divide(&self, part: &Part<AXES>, depth: u32, stretches: &mut Vec<Stretch>) -> Result<(), LimitExceeded> {
        let bounds = self.bounds(part.bounds());
        let limits = self.limits(&bounds);
        if depth < LIMIT_HALVINGS {
            let gains = |place: [[f64; AXES]; 3]| match (&limits, self.limits(&self.bounds(place))) {
                (Ok(whole), Ok(place)) => !is_close(whole, &place, LIMIT_GAIN),
                _ => true,
            };
            let halves = part.halves();
            if part.ends().into_iter().chain([halves[0].ends()[1]]).any(gains) {
                return halves.iter().try_for_each(|half| self.divide(half, depth + 1, stretches));
            }
        }
        stretches.push(Stretch { end: part.end, bounds, limits: limits? });
        Ok(())
    }

    /// Joins neighbours that lose no more than `slowdown` by it; everything when that is 1.
    fn merge(&self, stretches: &[Stretch], slowdown: f64) -> Result<LimitPieces, LimitExceeded> {
        let mut pieces = LimitPieces::new();
        let mut open: Option<(Bounds, PathLimits)> = None;
        for stretch in stretches {
            let own = stretch.limits;
            let (mut bounds, mut best, mut limits) = (stretch.bounds, own, own);
            if let Some((open_bounds, open_best)) = &open {
                let union = open_bounds.union(&bounds);
                let loosest = PathLimits {
                    velocity: open_best.velocity.max(own.velocity),
                    acceleration: open_best.acceleration.max(own.acceleration),
                    jerk: open_best.jerk.max(own.jerk),
                };
                let joined = self.limits(&union);
                let joins = slowdown >= 1.0 || joined.is_ok_and(|joined| is_close(&joined, &loosest, slowdown));
                if joins {
                    (bounds, best, limits) = (union, loosest, joined?);
                    pieces.pop();
                }
            }
            pieces.push(LimitPiece { end: stretch.end, limits });
            open = Some((bounds, best));
        }
        Ok(pieces)
    }

    /// What the feed may do where the derivatives stay within these bounds; see the module's comment.
    fn limits(&self, Bounds([first, second, third]): &Bounds) -> Result<PathLimits, LimitExceeded> {
        let superposed = self.superposed;
        let axes = self.machine.axes.iter().map(|axis| (axis, axis.axis.index()));
        let moved: SmallVec<[(&MachineAxis, usize); AXIS_COUNT]> = axes.filter(|&(_, k)| first[k] > 0.0).collect();
        // R₁: the axes' shares of the largest acceleration along the path.
        let hardest = moved.iter().map(|&(axis, k)| first[k] / axis.max_acceleration_per_s2).fold(0.0, f64::max);
        let share = |axis: &MachineAxis, k: usize| first[k] / (hardest * axis.max_acceleration_per_s2).max(1.0);
        let mut limits = PathLimits { velocity: self.top_speed, ..PathLimits::NONE };
        for &(axis, k) in &moved {
            let centripetal =
                axis.max_acceleration_per_s2 * CENTRIPETAL_SHARE.min(1.0 - TANGENTIAL_SHARE * share(axis, k));
            let turning = SPLINE_TURNING_JERK_SHARE * axis.max_jerk_per_s3;
            // A division by zero is no limit at all.
            let mut speed = (axis.max_velocity_per_s / first[k]).min((centripetal / second[k]).sqrt());
            // Where another axis is slower anyway, the root says nothing.
            let slowest = if superposed.velocity > 0.0 { speed } else { speed.min(SLOWER * limits.velocity) };
            if slowest * slowest * slowest * third[k] > turning {
                speed = libm::cbrt(turning / third[k]);
            }
            let left = rest(axis.axis, Quantity::Velocity, speed * first[k], first[k], superposed.velocity)?;
            limits.velocity = limits.velocity.min(left);
        }

        let speed = limits.velocity + superposed.velocity;
        let most_bent = moved.iter().map(|&(axis, k)| second[k] / axis.max_jerk_per_s3).fold(0.0, f64::max);
        // Jerk of an axis beside twice what turning takes.
        let free_jerk = |jerk: f64, k: usize| jerk - 2.0 * speed * speed * speed * third[k];
        for &(axis, k) in &moved {
            let mut left = axis.max_acceleration_per_s2 - speed * speed * second[k];
            if second[k] > 0.0 {
                let bent = second[k] / (most_bent * axis.max_jerk_per_s3);
                let normal_jerk = free_jerk(axis.max_jerk_per_s3, k) * bent / (share(axis, k) + bent);
                left = left.min(normal_jerk / (3.0 * speed * second[k]) * first[k]);
            }
            let left = rest(axis.axis, Quantity::Acceleration, left, first[k], superposed.acceleration)?;
            limits.acceleration = limits.acceleration.min(left);
        }

        let acceleration = limits.acceleration + superposed.acceleration;
        for &(axis, k) in &moved {
            let left = free_jerk(axis.max_jerk_per_s3, k) - 3.0 * speed * acceleration * second[k];
            limits.jerk = limits.jerk.min(rest(axis.axis, Quantity::Jerk, left, first[k], superposed.jerk)?);
        }
        Ok(limits)
    }
}
