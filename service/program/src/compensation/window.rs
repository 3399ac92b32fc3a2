//! The last blocks of the compensated contour with the path of the tool beside them: whether the tool cuts into any of them.

use core::f64::consts::FRAC_PI_2;
use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::distance;
use super::geometry::{Curve, Point, distance as apart, minus};
/// Blocks that are remembered.
pub(super) const BLOCKS: usize = 64;

/// Stretches of the tool's path that are remembered: each block has a corner before it at most.
const STRETCHES: usize = 2 * BLOCKS;

/// The tool may be nearer to the contour than its radius by this, mm: rounding of long coordinates, far below a tenth of a
/// micrometre.
const TOLERANCE_MM: f64 = 5e-7;

/// A curve that was passed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Passed {
    curve: Curve,
    bounds: Bounds,
    /// The block of the contour that it belongs to.
    place: Place,
    /// The program's line.
    line: u32,
    /// Least and largest direction of a block of the contour, counter-clockwise from that of the first, rad.
    headings: [f64; 2],
}

/// Which block of a contour.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Place {
    /// Its number, counted from the entry.
    block: u64,
    /// Number of the newest block that it can cut into.
    newest: u64,
    /// It leads to the contour or away from it.
    is_link: bool,
    /// A rapid move: no wall, but what it cuts into is one.
    is_rapid: bool,
}

impl Place {
    /// The entry to a contour or the exit from it, which can cut into every block.
    pub(super) const LINK: Self = Self { block: 0, newest: u64::MAX, is_link: true, is_rapid: false };

    /// The same, leading to a contour or away from it where that is so.
    pub(super) const fn linking(self, is_link: bool) -> Self {
        Self { is_link: self.is_link || is_link, ..self }
    }

    /// The same, of a rapid move where it is one.
    pub(super) const fn moving(self, is_rapid: bool) -> Self {
        Self { is_rapid, ..self }
    }

    /// The same as a wall of the part.
    pub(super) const fn as_wall(self) -> Self {
        Self { is_link: false, ..self }
    }

    /// The corner before the block, which the block itself may bend into.
    pub(super) const fn corner(self) -> Self {
        Self { block: self.block.saturating_sub(1), ..self }
    }
}

/// A rectangle along the axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Bounds {
    least: Point,
    most: Point,
}

impl Bounds {
    fn of(curve: &Curve) -> Self {
        let mut least = [curve.from[0].min(curve.to[0]), curve.from[1].min(curve.to[1])];
        let mut most = [curve.from[0].max(curve.to[0]), curve.from[1].max(curve.to[1])];
        if let Some(circle) = &curve.circle {
            // No point of an arc is farther from its chord's middle than along the chord and the arc.
            let reach = [circle.sweep_rad.abs() * curve.radius() * 0.5, 2.0 * curve.radius()];
            let reach = reach[0].min(reach[1]);
            for axis in 0..2 {
                let whole = [circle.center[axis] - curve.radius(), circle.center[axis] + curve.radius()];
                least[axis] = (least[axis] - reach).max(whole[0].min(least[axis]));
                most[axis] = (most[axis] + reach).min(whole[1].max(most[axis]));
            }
        }
        Self { least, most }
    }

    fn is_within(&self, other: &Self, reach: f64) -> bool {
        (0..2).all(|axis| self.least[axis] - reach < other.most[axis] && other.least[axis] - reach < self.most[axis])
    }
}

/// The tool cuts into the contour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gouge {
    pub(super) depth_mm: f64,
    /// Line of the block on whose contour or path it is, beside the present one.
    pub(super) line: u32,
    pub(super) on: Cut,
}

/// Where the tool cuts into the contour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cut {
    /// On its path along the contour.
    Contour,
    /// On the entry to the contour or the exit from it.
    Link,
    /// On its path along the contour it passes over a block that leads to the contour or away from it, which is no wall as a rule.
    Lead,
}

/// The worst cut of each kind, at its place among them.
pub(super) type Gouges = [Option<Gouge>; 3];

impl Gouge {
    /// What it is where only this part of the block is a wall of the part.
    fn of_wall(self, wall: Option<Passed>, path: &Passed, radius: f64) -> Self {
        match wall {
            Some(wall) if self.on == Cut::Contour && cut(path, &wall, radius).is_none() => {
                Self { on: Cut::Lead, ..self }
            }
            _ => self,
        }
    }
}

impl Passed {
    /// A straight block up to a point of it.
    fn up_to(self, at: Point) -> Self {
        self.with(Curve::line(self.curve.from, at))
    }

    /// A straight block from a point of it on.
    fn behind(self, at: Point) -> Self {
        self.with(Curve::line(at, self.curve.to))
    }

    fn with(self, curve: Curve) -> Self {
        Self { curve, bounds: Bounds::of(&curve), ..self }
    }
}

/// The window.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Window {
    contour: VecDeque<Passed>,
    path: VecDeque<Passed>,
    /// Number of the newest block.
    block: u64,
    /// Direction at the end of the newest block, counter-clockwise from that of the first, rad.
    heading: f64,
}

impl Window {
    /// Forgets everything: what follows is another contour.
    pub(super) fn clear(&mut self) {
        self.contour.clear();
        self.path.clear();
    }

    /// The next block, behind a corner of this angle.
    ///
    /// Between blocks whose directions all lie within a right angle, the path only advances and cannot come back to itself,
    /// unless a block of it runs backwards, which is found by itself.
    pub(super) fn advance(&mut self, curve: &Curve, turn_rad: f64) -> Place {
        self.block += 1;
        let start = self.heading + turn_rad;
        self.heading = start + curve.circle.map_or(0.0, |circle| circle.sweep_rad);
        let [mut least, mut most] = [start.min(self.heading), start.max(self.heading)];
        let mut newest = self.block;
        let mut passed = self.contour.iter().rev();
        while most - least < FRAC_PI_2 {
            let Some(passed) = passed.next() else {
                newest = 0;
                break;
            };
            newest = passed.place.block;
            least = least.min(passed.headings[0]);
            most = most.max(passed.headings[1]);
        }
        Place { block: self.block, newest, is_link: false, is_rapid: false }
    }

    /// The tool passes along a curve: the worst cut into what was passed before. `is_last` for the path of the last block, which has
    /// been added.
    pub(super) fn pass(&mut self, curve: Curve, radius: f64, place: Place, line: u32, is_last: bool) -> Gouges {
        let passed = Passed { curve, bounds: Bounds::of(&curve), place, line, headings: [0.0; 2] };
        let last = self.contour.back().filter(|_| is_last).map(|last| last.curve);
        let wall = last.and_then(|last| self.overlap(&last)).map(|(first, at)| first.behind(at));
        let worst = worst(&passed, &self.contour, |other| {
            let gouge = cut(&passed, other, radius)?;
            Some(gouge.of_wall(wall.filter(|wall| wall.place.block == other.place.block), &passed, radius))
        });
        if self.path.len() == STRETCHES {
            self.path.pop_front();
        }
        self.path.push_back(passed);
        worst
    }

    /// Where the last block of a contour crosses the first one, both straight: the tool goes on beyond the point where the contour closes,
    /// so that what is before it in the first block and behind it in the last one is no wall.
    fn overlap(&self, last: &Curve) -> Option<(Passed, Point)> {
        let first = self.contour.front().filter(|_| self.contour.len() < BLOCKS)?;
        let at = distance::crossing(&first.curve, last)?;
        Some((*first, at))
    }

    /// A block of the contour: the worst cut into it by what was passed before. `is_last` where it is the last one.
    pub(super) fn add(&mut self, curve: Curve, radius: f64, place: Place, line: u32, is_last: bool) -> Gouges {
        let end = self.heading;
        let start = end - curve.circle.map_or(0.0, |circle| circle.sweep_rad);
        let headings = [start.min(end), start.max(end)];
        let added = Passed { curve, bounds: Bounds::of(&curve), place, line, headings };
        let overlap = if is_last { self.overlap(&curve) } else { None };
        let wall = overlap.map(|(first, at)| (first.place.block, added.up_to(at)));
        let worst = worst(&added, &self.path, |other| {
            let (curve, path) = (&added, other);
            let wall = wall.filter(|(first, _)| *first == path.place.block).map(|(_, wall)| wall);
            let gouge = cut(path, curve, radius)?.of_wall(wall, path, radius);
            Some(Gouge { line: other.line, ..gouge })
        });
        if self.contour.len() == BLOCKS {
            self.contour.pop_front();
        }
        self.contour.push_back(added);
        worst
    }
}

/// The worst cuts between a curve and those before it.
fn worst(one: &Passed, others: &VecDeque<Passed>, cut: impl Fn(&Passed) -> Option<Gouge>) -> Gouges {
    let mut worst = Gouges::default();
    let can_be_met = |other: &&Passed| other.place.block <= one.place.newest;
    for gouge in others.iter().rev().filter(can_be_met).filter_map(cut) {
        let place = &mut worst[gouge.on as usize];
        if place.is_none_or(|worst| gouge.depth_mm > worst.depth_mm) {
            *place = Some(gouge);
        }
    }
    worst
}

/// The cut of a tool on its path into a block of the contour, whose line it names.
fn cut(path: &Passed, block: &Passed, radius: f64) -> Option<Gouge> {
    if !path.bounds.is_within(&block.bounds, radius) {
        return None;
    }
    let depth_mm = radius - distance::between(&path.curve, &block.curve);
    let rounding = path.curve.radius_error() + block.curve.radius_error();
    let on = match (path.place.is_link, block.place.is_link || block.place.is_rapid) {
        (true, _) => Cut::Link,
        (false, true) => Cut::Lead,
        (false, false) => Cut::Contour,
    };
    (depth_mm > TOLERANCE_MM + rounding).then_some(Gouge { depth_mm, line: block.line, on })
}

/// Whether two points are the same but for rounding.
pub(super) fn is_same(a: Point, b: Point) -> bool {
    minus(a, b) == [0.0; 2] || apart(a, b) < 1e-9
}
