//! How the offsets of two blocks are joined at a corner, on entry and on exit.
//!
//! Notation as on the page of the language: corner C, unit tangents t1 and t2 there, n1 and n2 toward the tool, δ the angle
//! between the tangents, r the radius.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use super::geometry::{Circle, Crossing, Curve, Point, Side, along, distance, plus};
use super::{CompensationCorner, CompensationEntry, CompensationRules};

/// LinuxCNC takes a corner below this angle, rad, as none.
const STRAIGHT_RAD: f64 = 0.05;

/// How the centre of the tool gets from a block to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Joint {
    /// Where the first block ends.
    pub(super) end: Point,
    /// From there to `start`.
    pub(super) corner: Corner,
    /// Where the second block starts.
    pub(super) start: Point,
    /// Angle that an arc loses at the end of the first block and at the start of the second, rad.
    pub(super) lost_rad: [f64; 2],
    /// By how much the tool cuts into the contour here at most, mm.
    pub(super) overcut: f64,
}

/// How a corner is passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Corner {
    /// Lines to each of the first so many points, the last of which is the start of the second block.
    Lines([Point; 3], usize),
    /// An arc about the corner.
    Arc(Circle),
}

const NO_POINT: Point = [0.0; 2];

impl Joint {
    /// No corner.
    pub(super) const fn at(point: Point) -> Self {
        Self::through(point, point, [NO_POINT; 3], 0)
    }

    const fn through(end: Point, start: Point, points: [Point; 3], count: usize) -> Self {
        Self { end, corner: Corner::Lines(points, count), start, lost_rad: [0.0; 2], overcut: 0.0 }
    }
}

/// A corner between two blocks.
pub(super) struct Meeting<'a> {
    side: Side,
    first: &'a Curve,
    second: &'a Curve,
    /// The second block is a rapid move.
    is_rapid: bool,
    /// C
    corner: Point,
    t1: Point,
    t2: Point,
    /// C + r·n1
    end: Point,
    /// C + r·n2
    start: Point,
    /// δ, positive toward the tool.
    turn: f64,
}

impl<'a> Meeting<'a> {
    pub(super) fn new(side: Side, first: &'a Curve, second: &'a Curve, is_rapid: bool) -> Self {
        let (corner, t1, t2) = (first.to, first.end_tangent(), second.start_tangent());
        let (end, start) = (plus(corner, side.offset(t1)), plus(corner, side.offset(t2)));
        Self { side, first, second, is_rapid, corner, t1, t2, end, start, turn: side.turn(t1, t2) }
    }

    /// Change of direction, rad, positive counter-clockwise.
    pub(super) fn heading_rad(&self) -> f64 {
        if self.side.left { self.turn } else { -self.turn }
    }

    /// The joint of two compensated blocks; `None` where their offsets do not cross.
    pub(super) fn joint(&self, rules: CompensationRules) -> Option<Joint> {
        match rules {
            CompensationRules::LinuxCnc => self.linuxcnc(),
            CompensationRules::Fanuc { corner, .. } => self.fanuc(corner),
        }
    }

    /// In place of a joint that there is none of: round the corner.
    pub(super) fn around(&self) -> Joint {
        Joint::through(self.end, self.start, [self.start; 3], 1)
    }

    fn linuxcnc(&self) -> Option<Joint> {
        let angle = self.turn.abs();
        let folds_back = angle > PI - STRAIGHT_RAD;
        // Over a round part and straight back down beside it: the tool stays above.
        let is_cusp = folds_back && self.is_over_round_part();
        if is_cusp || (self.turn > STRAIGHT_RAD && !folds_back) {
            return self.inside();
        }
        if angle <= STRAIGHT_RAD {
            // The second block starts nearer to its line or circle than it ends.
            let overcut = match &self.second.circle {
                None => self.side.radius * (1.0 - libm::cos(angle)),
                Some(circle) => (distance(self.end, circle.center) - self.side.offset_radius(self.second)).abs(),
            };
            return Some(Joint { overcut, ..Joint::at(self.end) });
        }
        let angle = if self.turn < 0.0 { angle } else { TAU - angle };
        Some(if self.is_rapid { self.around() } else { self.round(angle) })
    }

    fn is_over_round_part(&self) -> bool {
        let is_outside = |curve: &Curve| curve.circle.is_some_and(|circle| !self.side.is_inside(&circle));
        if self.second.circle.is_some() { is_outside(self.second) } else { is_outside(self.first) }
    }

    /// An arc about the corner.
    fn round(&self, angle: f64) -> Joint {
        let sweep_rad = if self.side.left { -angle } else { angle };
        let corner = Corner::Arc(Circle { center: self.corner, sweep_rad });
        Joint { corner, ..Joint::through(self.end, self.start, [NO_POINT; 3], 0) }
    }

    fn inside(&self) -> Option<Joint> {
        let Crossing { point, lost_rad } = Crossing::of(self.side, self.first, self.second)?;
        Some(Joint { lost_rad, ..Joint::at(point) })
    }

    fn fanuc(&self, corner: CompensationCorner) -> Option<Joint> {
        let has_arc = self.first.circle.is_some() || self.second.circle.is_some();
        let gap = distance(self.end, self.start);
        // Where curves are as good as tangent, a chord is within 0.1 µm of what is exact, and no crossing is needed.
        if has_arc && gap * gap < 2e-7 * self.side.radius {
            return Some(if gap < 1e-9 { Joint::at(self.end) } else { self.around() });
        }
        let is_inside = if self.turn.abs() > PI - 1e-9 { self.is_wedge() } else { self.turn > 0.0 };
        if is_inside { self.inside() } else { Some(self.outside(corner)) }
    }

    /// Whether a path that turns back leaves the tool in the wedge between its curves.
    fn is_wedge(&self) -> bool {
        // Curvature toward the side that the tool has on the first block.
        let bend = |curve: &Curve| {
            curve.circle.map_or(0.0, |circle| {
                let bend = 1.0 / curve.radius();
                if self.side.is_inside(&circle) { bend } else { -bend }
            })
        };
        -bend(self.second) > bend(self.first)
    }

    /// The tangents prolonged to the mitre point, or cut off beyond a right angle.
    fn outside(&self, corner: CompensationCorner) -> Joint {
        let angle = self.turn.abs();
        if corner == CompensationCorner::Circular && !self.is_rapid {
            return self.round(angle);
        }
        let mut points = [NO_POINT; 3];
        let mut count = 0;
        let mut push = |point| {
            points[count] = point;
            count += 1;
        };
        let [before, after] = if angle <= FRAC_PI_2 + 1e-12 {
            // C + r·(n1 + n2) / (1 + n1·n2) is r·tan(δ/2) beyond the end.
            let mitre = along(self.end, self.t1, self.side.radius * libm::tan(angle * 0.5));
            [mitre; 2]
        } else {
            let radius = self.side.radius;
            [along(self.end, self.t1, radius), along(self.start, self.t2, -radius)]
        };
        let mut end = before;
        if self.first.circle.is_some() {
            end = self.end;
            push(before);
        }
        if after != before {
            push(after);
        }
        let mut start = after;
        if self.second.circle.is_some() {
            start = self.start;
            push(start);
        }
        Joint::through(end, start, points, count)
    }

    /// The joint of an entry line with the first compensated block.
    pub(super) fn entry(&self, rules: CompensationRules) -> Option<Joint> {
        match rules {
            CompensationRules::LinuxCnc => self.linuxcnc(),
            CompensationRules::Fanuc { entry: CompensationEntry::B, corner } if self.turn <= 0.0 => {
                let joint = self.outside(corner);
                if self.turn.abs() <= FRAC_PI_2 + 1e-12 || matches!(joint.corner, Corner::Arc(_)) {
                    return Some(joint);
                }
                let Corner::Lines(points, count) = joint.corner else { return Some(joint) };
                let corner = Corner::Lines([joint.end, points[0], points[1]], count + 1);
                Some(Joint { end: self.end, corner, ..joint })
            }
            CompensationRules::Fanuc { .. } => Some(Joint::at(self.start)),
        }
    }

    /// The joint of the last compensated block with the exit line.
    pub(super) fn exit(&self, rules: CompensationRules) -> Joint {
        match rules {
            CompensationRules::Fanuc { entry: CompensationEntry::B, corner } if self.turn <= 0.0 => {
                let joint = self.outside(corner);
                let is_short = self.turn.abs() <= FRAC_PI_2 + 1e-12;
                let Corner::Lines(mut points, count) = joint.corner else { return joint };
                if is_short {
                    return joint;
                }
                points[count] = self.start;
                Joint { start: self.start, corner: Corner::Lines(points, count + 1), ..joint }
            }
            _ => Joint::at(self.end),
        }
    }
}
