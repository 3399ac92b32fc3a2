//! The path of the tool centre point along a block: straight, an arc or helix in any plane, or a spline, which is also the curve
//! at a corner between two blocks; also straight to rest or from rest, at the corner to a turn of the tool.

use serde::{Deserialize, Serialize};

use super::ease::{Ease, Easing};
use super::vector::{Vec3, add, add_scaled, cross, dot, norm, scale, sub, unit};
use crate::Spline;
use crate::tolerance::CURVE_BYTES;

/// Path of the tool centre point, work coordinates, mm, by the share of the block.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum TipPath {
    /// From one point to another.
    Line([Vec3; 2]),
    /// About a centre.
    Arc(Box<TipArc>),
    /// Along a spline, at a corner that is rounded, or in one curve of short blocks.
    Spline(Box<TipSpline>),
    /// From one point to another, to rest or from rest, while the tool begins or ends to turn.
    Eased([Vec3; 2], Ease, Easing),
}

/// A spline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TipSpline {
    ends: [Vec3; 2],
    spline: Spline,
}

/// An arc or helix in any plane, with evenly changing angle, radius and height: like [`crate::Arc`], the radii at its ends may
/// differ a little.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TipArc {
    ends: [Vec3; 2],
    /// Centre at the height of the start.
    center: Vec3,
    /// Unit vectors towards the start, and perpendicular to it in the sense of positive angles.
    across: [Vec3; 2],
    /// Height at the end, along the axis.
    rise: Vec3,
    /// At the start and at the end.
    radius_mm: [f64; 2],
    sweep_rad: f64,
}

/// The circle of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipCircle {
    /// A point of its axis, work coordinates, mm.
    pub center_mm: Vec3,
    /// Direction of its axis; any length but zero.
    pub normal: Vec3,
    /// Swept angle about that direction, right-handed, rad.
    pub sweep_rad: f64,
}

/// The curve of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TipCurve<'a> {
    /// A circle or helix.
    Circle(TipCircle),
    /// A spline from where the block starts to where it ends, work coordinates; without a corner.
    Spline(&'a Spline),
}

impl TipPath {
    /// Upper bound of the memory that it takes besides itself, bytes.
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Line(_) | Self::Eased(..) => 0,
            Self::Arc(_) => CURVE_BYTES,
            Self::Spline(tip) => CURVE_BYTES + tip.spline.bytes(),
        }
    }

    /// From one point to another along a circle; `None` where an end is on its axis.
    #[must_use]
    pub fn along(circle: &TipCircle, start: Vec3, end: Vec3) -> Option<Self> {
        let normal = unit(circle.normal)?;
        let from_axis = |point: Vec3| {
            let from = sub(point, circle.center_mm);
            let height = dot(from, normal);
            (height, add_scaled(from, normal, -height))
        };
        let (start_height, start_across) = from_axis(start);
        let (end_height, end_across) = from_axis(end);
        let first = unit(start_across)?;
        unit(end_across)?;
        Some(Self::Arc(Box::new(TipArc {
            ends: [start, end],
            center: add_scaled(circle.center_mm, normal, start_height),
            across: [first, cross(normal, first)],
            rise: scale(normal, end_height - start_height),
            radius_mm: [norm(start_across), norm(end_across)],
            sweep_rad: circle.sweep_rad,
        })))
    }

    /// Along a spline.
    pub(crate) fn spline(spline: Spline) -> Self {
        Self::Spline(Box::new(TipSpline { ends: spline.ends(), spline }))
    }

    /// Whether it is straight, and leads somewhere.
    pub(crate) fn is_line(&self) -> bool {
        matches!(self, Self::Line([start, end]) if start != end)
    }

    /// Whether it stays at one point.
    pub(crate) fn rests(&self) -> bool {
        matches!(self, Self::Line([start, end]) if start == end)
    }

    /// First and last point.
    #[must_use]
    pub fn ends(&self) -> &[Vec3; 2] {
        match self {
            Self::Line(ends) | Self::Eased(ends, ..) => ends,
            Self::Arc(arc) => &arc.ends,
            Self::Spline(it) => &it.ends,
        }
    }

    /// Length, mm; along an arc whose radius changes, that of the mean radius.
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        match self {
            Self::Line([start, end]) | Self::Eased([start, end], ..) => norm(sub(*end, *start)),
            Self::Arc(arc) => {
                let [start_mm, end_mm] = arc.radius_mm;
                let turned_mm = 0.5 * (start_mm + end_mm) * arc.sweep_rad;
                norm([turned_mm, end_mm - start_mm, norm(arc.rise)])
            }
            Self::Spline(it) => it.spline.length_mm(),
        }
    }

    /// The point at a share of the block.
    #[must_use]
    pub fn at(&self, share: f64) -> Vec3 {
        match self {
            Self::Line([start, end]) => add_scaled(*start, sub(*end, *start), share),
            Self::Eased([start, end], ease, easing) => {
                add_scaled(*start, sub(*end, *start), easing.share(*ease, share))
            }
            Self::Arc(arc) => arc.at(share),
            Self::Spline(it) => it.spline.point(share * it.spline.length_mm()),
        }
    }

    /// The shares of the block at which stretches of it end, and an upper bound of the curvature of each, 1/mm.
    pub(crate) fn curvatures(&self) -> Vec<(f64, f64)> {
        match self {
            Self::Line(_) | Self::Eased(..) => vec![(1.0, 0.0)],
            Self::Arc(arc) => {
                let [start_mm, end_mm] = arc.radius_mm;
                let turn = arc.sweep_rad.abs() / self.length_mm();
                let growth = (end_mm - start_mm).abs() / self.length_mm();
                vec![(1.0, start_mm.max(end_mm) * turn * turn + 2.0 * growth * turn)]
            }
            Self::Spline(it) => {
                let length_mm = it.spline.length_mm();
                it.spline.curvatures().map(|(end_mm, curvature)| (end_mm / length_mm, curvature)).collect()
            }
        }
    }

    /// Its derivative by the share of the block, mm.
    #[must_use]
    pub fn slope(&self, share: f64) -> Vec3 {
        match self {
            Self::Line([start, end]) => sub(*end, *start),
            Self::Eased([start, end], ease, easing) => scale(sub(*end, *start), easing.share_slope(*ease, share)),
            Self::Arc(arc) => {
                let [start_mm, end_mm] = arc.radius_mm;
                let growth_mm = end_mm - start_mm;
                let turned_mm = (start_mm + growth_mm * share) * arc.sweep_rad;
                let (sine, cosine) = libm::sincos(arc.sweep_rad * share);
                let first = growth_mm * cosine - turned_mm * sine;
                let second = growth_mm * sine + turned_mm * cosine;
                add_scaled(add_scaled(arc.rise, arc.across[0], first), arc.across[1], second)
            }
            Self::Spline(it) => {
                let length_mm = it.spline.length_mm();
                scale(it.spline.slope(share * length_mm), length_mm)
            }
        }
    }
}

impl TipSpline {
    pub(super) const fn spline(&self) -> &Spline {
        &self.spline
    }
}

impl TipArc {
    fn at(&self, share: f64) -> Vec3 {
        let [start_mm, end_mm] = self.radius_mm;
        let radius_mm = start_mm + (end_mm - start_mm) * share;
        let (sine, cosine) = libm::sincos(self.sweep_rad * share);
        let across = add(scale(self.across[0], radius_mm * cosine), scale(self.across[1], radius_mm * sine));
        add(add_scaled(self.center, self.rise, share), across)
    }

    /// What a series of it is made of: centre, unit vectors across, rise, radii and swept angle.
    pub(super) const fn parts(&self) -> (Vec3, [Vec3; 2], Vec3, [f64; 2], f64) {
        (self.center, self.across, self.rise, self.radius_mm, self.sweep_rad)
    }
}
