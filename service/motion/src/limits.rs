//! What an element leaves for the feed: path velocity, acceleration and jerk within every axis' limits.
//!
//! With the path position σ(t), speed v, acceleration a and jerk j along the path, unit tangent τ, normal n and
//! curvature κ, the axes see
//!
//! ```text
//! p'   = v·τ
//! p''  = a·τ + v²κ·n
//! p''' = (j − v³κ²)·τ + 3·v·a·κ·n          (κ constant)
//! ```
//!
//! τ and n are orthonormal, so an axis in the plane of a circle never sees more than the root of the sum of the
//! squares of the two parts: giving them the shares 0.8 and 0.6 of a limit keeps the axis within it in every
//! direction of the circle. A superposed motion along the path (a vibration) simply adds to v, a and j.
//!
//! The radius of an inexact arc changes by ρ per length, and it turns by w per length, which changes as the radius does: with e the
//! length that would have been travelled evenly, |e″/e′| ≤ w·|ρ| and e‴/e′ = 3·(e″/e′)². With the largest share R·w along the circle
//! its derivatives by length are bounded by K₁ = R·w + |ρ|, K₂ = w·(R·w + 2·|ρ|) + w·|ρ| and
//! K₃ = w²·(R·w + 3·|ρ|) + 3·w·|ρ|·w·(R·w + 2·|ρ|) + 3·w²·ρ² ≤ w²·(R·w + 12·|ρ|), which are used in place of |τ|, κ and κ². The two
//! parts are then not quite orthogonal, but their product is less than what the sums exceed the roots of the sums of squares by. An
//! axis beside its plane has e″ and e‴ times its own share of the path: a tenth of its limits is kept for that.

use core::fmt;

use feedwave_program::{Axis, Position};
use serde::{Deserialize, Serialize};

use crate::tolerance::{
    CENTRIPETAL_SHARE, LEAST_FEED_SHARE, NORMAL_JERK_SHARE, TANGENT_JERK_SHARE, TANGENTIAL_SHARE, TURNING_JERK_SHARE,
};
use crate::{Arc, Curve, Element, Machine, MachineAxis};

mod pieces;

pub use pieces::{LimitPiece, LimitPieces, limit_pieces};

/// Peak motion along the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathMotion {
    /// mm/s
    pub velocity: f64,
    /// mm/s²
    pub acceleration: f64,
    /// mm/s³
    pub jerk: f64,
}

impl PathMotion {
    /// No motion.
    pub const ZERO: Self = Self { velocity: 0.0, acceleration: 0.0, jerk: 0.0 };
}

/// Largest motion of the feed along the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathLimits {
    /// mm/s
    pub velocity: f64,
    /// mm/s²
    pub acceleration: f64,
    /// mm/s³
    pub jerk: f64,
}

impl PathLimits {
    /// No limit at all.
    pub const NONE: Self = Self { velocity: f64::INFINITY, acceleration: f64::INFINITY, jerk: f64::INFINITY };

    /// The smallest of each; infinite where there are none.
    #[must_use]
    pub fn tightest<'a>(all: impl Iterator<Item = &'a Self>) -> Self {
        all.fold(Self::NONE, |tightest, limits| Self {
            velocity: tightest.velocity.min(limits.velocity),
            acceleration: tightest.acceleration.min(limits.acceleration),
            jerk: tightest.jerk.min(limits.jerk),
        })
    }
}

/// Quantity of an axis limit: of millimetres, or of degrees for a rotary axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// By s.
    Velocity,
    /// By s².
    Acceleration,
    /// By s³.
    Jerk,
}

impl Quantity {
    /// Its unit on a linear or a rotary axis.
    #[must_use]
    pub const fn unit(self, rotary: bool) -> &'static str {
        match (self, rotary) {
            (Self::Velocity, false) => "mm/s",
            (Self::Acceleration, false) => "mm/s²",
            (Self::Jerk, false) => "mm/s³",
            (Self::Velocity, true) => "deg/s",
            (Self::Acceleration, true) => "deg/s²",
            (Self::Jerk, true) => "deg/s³",
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
        })
    }
}

/// A superposed motion leaves (nearly) nothing of an axis' limit for the feed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[error(
    "the superposed motion takes {demanded:.1} {} of the {axis} axis' {quantity}, whose limit on this curve is {limit:.1}; it may \
     take {:.1} at most, since {:.0} % are for the feed",
    quantity.unit(axis.is_rotary()),
    self.permitted(),
    100.0 * LEAST_FEED_SHARE,
    axis = axis.letter()
)]
pub struct LimitExceeded {
    /// The axis.
    pub axis: Axis,
    /// Which limit.
    pub quantity: Quantity,
    /// What the superposed motion takes of it.
    pub demanded: f64,
    /// What the axis gives on this element.
    pub limit: f64,
}

impl LimitExceeded {
    /// The most that a superposed motion may take: a fiftieth of the limit is left for the feed.
    #[must_use]
    pub fn permitted(&self) -> f64 {
        (1.0 - LEAST_FEED_SHARE) * self.limit
    }
}

/// A position beyond an axis' travel, machine coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TravelExceeded {
    /// The axis.
    pub axis: Axis,
    /// The farthest position, mm or degrees.
    pub value: f64,
    /// The travel limit it passes, mm or degrees.
    pub limit: f64,
}

/// Largest feed motion everywhere along an element when the peaks of `superposed` are added on top.
///
/// The machine must have every axis that the element moves; see [`missing_axis`].
///
/// # Errors
/// [`LimitExceeded`] for the first axis whose limit leaves less than a fiftieth for the feed.
pub fn path_limits(element: &Element, machine: &Machine, superposed: PathMotion) -> Result<PathLimits, LimitExceeded> {
    if let Curve::Spline(_) | Curve::FiveAxis(_) = &element.curve {
        let pieces = limit_pieces(element, machine, superposed, f64::INFINITY)?;
        return Ok(PathLimits::tightest(pieces.iter().map(|piece| &piece.limits)));
    }
    let largest = element.largest_tangent();
    let mut limits = PathLimits::NONE;
    for axis in &machine.axes {
        let share = largest[axis.axis.index()];
        if share > 0.0 {
            limits.velocity = limits.velocity.min(rest(
                axis.axis,
                Quantity::Velocity,
                axis.max_velocity_per_s,
                share,
                superposed.velocity,
            )?);
        }
    }
    if let Curve::Arc(arc) = &element.curve {
        limit_on_arc(&mut limits, arc, element, machine, superposed)?;
        let unevenness = arc.unevenness(element.length);
        if unevenness[0] > 0.0 {
            limit_beside_spiral(&mut limits, unevenness, &largest, element, machine, superposed)?;
            return Ok(limits);
        }
    }
    for axis in &machine.axes {
        let share = largest[axis.axis.index()];
        if share > 0.0 && !is_in_plane(element, axis.axis) {
            let acceleration =
                rest(axis.axis, Quantity::Acceleration, axis.max_acceleration_per_s2, share, superposed.acceleration)?;
            let jerk = rest(axis.axis, Quantity::Jerk, axis.max_jerk_per_s3, share, superposed.jerk)?;
            limits.acceleration = limits.acceleration.min(acceleration);
            limits.jerk = limits.jerk.min(jerk);
        }
    }
    Ok(limits)
}

/// What of the limits of an axis beside the plane of a spiral may go into its going unevenly along the path.
const UNEVEN_SHARE: f64 = 0.1;

/// Limits by the axes beside the plane of a spiral, which go unevenly along the path: by the shares of [`Arc::unevenness`] of their own
/// share of it.
fn limit_beside_spiral(
    limits: &mut PathLimits,
    unevenness: [f64; 2],
    largest: &Position,
    element: &Element,
    machine: &Machine,
    superposed: PathMotion,
) -> Result<(), LimitExceeded> {
    let moved = |axis: &&MachineAxis| largest[axis.axis.index()] > 0.0 && !is_in_plane(element, axis.axis);
    let beside = || machine.axes.iter().filter(moved);
    for axis in beside() {
        let [bend, change] = unevenness.map(|by_share| by_share * largest[axis.axis.index()]);
        let (acceleration, jerk) = (UNEVEN_SHARE * axis.max_acceleration_per_s2, UNEVEN_SHARE * axis.max_jerk_per_s3);
        let speed = (acceleration / bend).sqrt().min(libm::cbrt(jerk / change));
        limits.velocity = limits.velocity.min(rest(axis.axis, Quantity::Velocity, speed, 1.0, superposed.velocity)?);
    }
    let speed = limits.velocity + superposed.velocity;
    for axis in beside() {
        let share = largest[axis.axis.index()];
        let [bend, change] = unevenness.map(|by_share| by_share * share);
        let left = axis.max_acceleration_per_s2 - speed * speed * bend;
        let along = rest(axis.axis, Quantity::Acceleration, left, share, superposed.acceleration)?;
        let turned = UNEVEN_SHARE * axis.max_jerk_per_s3 / (3.0 * speed * bend);
        let turned = rest(axis.axis, Quantity::Acceleration, turned, 1.0, superposed.acceleration)?;
        limits.acceleration = limits.acceleration.min(along).min(turned);
        let turned_jerk = 3.0 * speed * (limits.acceleration + superposed.acceleration) * bend;
        let left = axis.max_jerk_per_s3 - speed * speed * speed * change - turned_jerk;
        limits.jerk = limits.jerk.min(rest(axis.axis, Quantity::Jerk, left, share, superposed.jerk)?);
    }
    Ok(())
}

fn limit_on_arc(
    limits: &mut PathLimits,
    arc: &Arc,
    element: &Element,
    machine: &Machine,
    superposed: PathMotion,
) -> Result<(), LimitExceeded> {
    let in_plane = || machine.axes.iter().filter(|axis| is_in_plane(element, axis.axis));
    let Some(slowest) = in_plane().min_by(|a, b| a.max_acceleration_per_s2.total_cmp(&b.max_acceleration_per_s2))
    else {
        return Ok(());
    };
    let Some(softest) = in_plane().min_by(|a, b| a.max_jerk_per_s3.total_cmp(&b.max_jerk_per_s3)) else {
        return Ok(());
    };
    let acceleration = slowest.max_acceleration_per_s2;
    let jerk = softest.max_jerk_per_s3;
    let turn = arc.fastest_turn(element.length);
    let (along, outwards) = (arc.most_along(element.length), arc.most_outwards(element.length));
    // Bounds of the first three derivatives in the plane by length; what turns unevenly adds to them as it goes outwards.
    let first = along + outwards;
    let second = turn * (along + 3.0 * outwards);
    let third = turn * turn * (along + 12.0 * outwards);

    let centripetal = (CENTRIPETAL_SHARE * acceleration / second).sqrt();
    let turning = libm::cbrt(TURNING_JERK_SHARE * TANGENT_JERK_SHARE * jerk / third);
    for (axis, path_speed) in [(slowest, centripetal), (softest, turning)] {
        let left = rest(axis.axis, Quantity::Velocity, path_speed * first, first, superposed.velocity)?;
        limits.velocity = limits.velocity.min(left);
    }

    let speed = limits.velocity + superposed.velocity;
    let tangential = TANGENTIAL_SHARE * acceleration;
    let normal_jerk = NORMAL_JERK_SHARE * jerk / (3.0 * speed * second);
    limits.acceleration = limits
        .acceleration
        .min(rest(slowest.axis, Quantity::Acceleration, tangential, first, superposed.acceleration)?)
        .min(rest(softest.axis, Quantity::Acceleration, normal_jerk * first, first, superposed.acceleration)?);
    let tangent_jerk = TANGENT_JERK_SHARE * jerk - speed * speed * speed * third;
    limits.jerk = limits.jerk.min(rest(softest.axis, Quantity::Jerk, tangent_jerk, first, superposed.jerk)?);
    Ok(())
}

/// What of an axis limit is left along the path once the superposed motion has taken its part.
fn rest(axis: Axis, quantity: Quantity, limit: f64, share: f64, superposed: f64) -> Result<f64, LimitExceeded> {
    let along_path = limit / share;
    let left = along_path - superposed;
    if superposed > 0.0 && left < LEAST_FEED_SHARE * along_path {
        return Err(LimitExceeded { axis, quantity, demanded: superposed * share, limit });
    }
    Ok(left)
}

fn is_in_plane(element: &Element, axis: Axis) -> bool {
    matches!(&element.curve, Curve::Arc(arc) if arc.first == axis || arc.second == axis)
}

/// An axis that the element moves and the machine does not have.
#[must_use]
pub fn missing_axis(element: &Element, machine: &Machine) -> Option<Axis> {
    Axis::ALL.into_iter().find(|&axis| element.moves(axis) && machine.column_of(axis).is_none())
}

/// The first axis that the element would take beyond its travel.
#[must_use]
pub fn travel_exceeded(element: &Element, machine: &Machine) -> Option<TravelExceeded> {
    if !machine.has_travel() {
        return None;
    }
    travel_exceeded_within(element.extent(), element, machine)
}

/// As [`travel_exceeded`], with the smallest and largest position of each axis, work coordinates, where something is superposed
/// on the element.
#[must_use]
pub fn travel_exceeded_within(
    (low, high): (Position, Position),
    element: &Element,
    machine: &Machine,
) -> Option<TravelExceeded> {
    let check = |axis: &MachineAxis| {
        let index = axis.axis.index();
        let ends = [low[index], high[index]].map(|work| axis.sign() * (work + element.work_offset[index]));
        let [low, high] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        let below = axis.travel_min.filter(|&limit| low < limit).map(|limit| (low, limit));
        let above = axis.travel_max.filter(|&limit| high > limit).map(|limit| (high, limit));
        below.or(above).map(|(value, limit)| TravelExceeded { axis: axis.axis, value, limit })
    };
    machine.axes.iter().find_map(check)
}

#[cfg(test)]
mod tests;
