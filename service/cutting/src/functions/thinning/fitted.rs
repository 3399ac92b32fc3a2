//! The fitted method: directions of the kept blocks lie on a smooth curve, and what is left is within both tolerances of the
//! program everywhere (docs/functions/five-axis-thinning.md, "The fitted method").
//!
//! Places of both paths belong to each other by path length: a programmed point at the share u of the programmed length between
//! two kept blocks is held against the share u of what is left. Between two programmed points both tool centre points go
//! straight in u, so that their distance is largest at one of the points. The directions turn along great circles, or evenly
//! in the rotary angles; how far apart they can be between two points is [`Span::bound_rad`].

use core::f64::consts::FRAC_PI_2;

use feedwave_motion::kinematics::vector::{Vec3, add_scaled, angle, cross, norm, sub, unit};
use feedwave_motion::kinematics::{GreatCircle, RotaryDirections};

use super::span::{angle_of, chord};
use super::thinner::{CutPoint, FittedDirection};
use super::tube::{Spacing, Tube};

/// Shorter moves of the tool centre point are none, mm: there the direction has no path length to be a function of.
const RESTS_MM: f64 = 1e-9;
/// Directions turned further than this in one block are kept as they are, rad: 60 degrees. Beyond, what is between two great
/// circles could be further apart than their ends by more than the tolerance has left.
const TURNS_RAD: f64 = core::f64::consts::FRAC_PI_3;
/// Half width of the tube around a component of the direction vector, as a share of the tolerance: three of them are within
/// 0.7 of it, and what is left is for the straight pieces between kept blocks.
const VECTOR_SHARE: f64 = 0.4;
/// The same around the angle of a rotary axis; both turn the direction together.
const ANGLE_SHARE: f64 = 0.35;

/// Directions as the fit has them: unit vectors, or in the first two components the angles of the rotary axes, rad.
pub(super) type Turned = Vec3;

/// A group under work.
pub(super) struct FittedGroup<'a> {
    pub(super) points: &'a [CutPoint],
    /// The rotary axes where their angles are interpolated.
    pub(super) directions: Option<&'a RotaryDirections>,
    pub(super) angle_tolerance_rad: f64,
    pub(super) distance_tolerance_mm: f64,
    /// Path length of the program up to each point, mm.
    pub(super) lengths_mm: Vec<f64>,
    /// Directions of the fit.
    pub(super) turned: Vec<Turned>,
}

/// How far what is left is from the program at one of its points, and at most up to the next one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Apart {
    pub(super) position_mm: f64,
    pub(super) direction_rad: f64,
    /// Of the angles of the rotary axes, where they are interpolated, the larger one.
    pub(super) rotary_rad: f64,
}

/// Whether the fit ends between two blocks: the tool centre point rests, or the direction is turned very far at once.
pub(super) fn is_break(before: &CutPoint, after: &CutPoint, by_angles: bool) -> bool {
    let rests = norm(sub(after.tip_mm, before.tip_mm)) <= RESTS_MM;
    rests || (!by_angles && angle(before.direction, after.direction) > TURNS_RAD)
}

impl<'a> FittedGroup<'a> {
    /// Fits the directions of a group. The first ones are `carried` over from the group before, or as programmed; `is_last` says
    /// that nothing follows, so that the last one is as programmed.
    pub(super) fn fit(
        points: &'a [CutPoint],
        directions: Option<&'a RotaryDirections>,
        [angle_tolerance_rad, distance_tolerance_mm]: [f64; 2],
        carried: &[Turned],
        is_last: bool,
    ) -> Self {
        let mut lengths_mm = vec![0.0; points.len()];
        for at in 1..points.len() {
            lengths_mm[at] = lengths_mm[at - 1] + norm(sub(points[at].tip_mm, points[at - 1].tip_mm));
        }
        let mut group =
            Self { points, directions, angle_tolerance_rad, distance_tolerance_mm, lengths_mm, turned: Vec::new() };
        group.turned = (0..points.len()).map(|at| group.programmed(at)).collect();
        let carried = &carried[..carried.len().min(points.len() - usize::from(is_last))];
        for (turned, carried) in group.turned.iter_mut().zip(carried) {
            *turned = *carried;
        }
        let fixed = carried.len().max(1);
        let is_fixed = |at: usize| at < fixed || (is_last && at + 1 == points.len());
        let spacing = Spacing::new(group.lengths_mm.windows(2).map(|pair| pair[1] - pair[0]));
        let components = if directions.is_some() { 2 } else { 3 };
        let widths: Vec<Turned> = (0..points.len()).map(|at| group.widths(at)).collect();
        let fitted: Vec<Vec<f64>> = (0..components)
            .map(|component| {
                let values = group.turned.iter().map(|turned| turned[component]).collect();
                let width = |at: usize| if is_fixed(at) { 0.0 } else { widths[at][component] };
                Tube { values, widths: (0..points.len()).map(width).collect() }.smoothest(&spacing)
            })
            .collect();
        for at in (0..points.len()).filter(|at| !is_fixed(*at)) {
            let mut turned = [0.0; 3];
            for (turned, fitted) in turned.iter_mut().zip(&fitted) {
                *turned = fitted[at];
            }
            if directions.is_none() {
                // Within the tube around a unit vector there is no zero.
                turned = unit(turned).unwrap_or(group.turned[at]);
            }
            group.turned[at] = turned;
        }
        group
    }

    /// What the program says at a point.
    fn programmed(&self, at: usize) -> Turned {
        match (self.directions, self.points[at].rotary_rad) {
            (Some(_), Some([first, second])) => [first, second, 0.0],
            _ => self.points[at].direction,
        }
    }

    /// Half widths of the tube at a point.
    fn widths(&self, at: usize) -> Turned {
        let tolerance_rad = self.angle_tolerance_rad;
        if self.directions.is_none() {
            return [VECTOR_SHARE * tolerance_rad; 3];
        }
        let width = ANGLE_SHARE * tolerance_rad;
        let last = self.points.len() - 1;
        let lever =
            (at.saturating_sub(1)..(at + 1).min(last)).map(|block| self.lever(block, width)).fold(0.0, f64::max);
        // Near the pole the first axis could be anywhere; it follows its angles within the tolerance there.
        [width / lever.max(ANGLE_SHARE), width, 0.0]
    }

    /// Most that a turn of the first rotary axis turns the direction in the block behind a point, by the sine of its angle to
    /// that axis, which the second axis changes by no more than it turns; `more_rad` beside the program.
    fn lever(&self, block: usize, more_rad: f64) -> f64 {
        let Some(directions) = self.directions else { return 1.0 };
        let sine = |at: usize| norm(cross(directions.first_axis(), directions.at(self.angles(self.programmed(at)))));
        let travel_rad = (self.programmed(block + 1)[1] - self.programmed(block)[1]).abs();
        (sine(block).max(sine(block + 1)) + 0.5 * travel_rad + more_rad).min(1.0)
    }

    const fn angles(&self, turned: Turned) -> [f64; 2] {
        [turned[0], turned[1]]
    }

    /// The direction of the tool.
    pub(super) fn direction(&self, turned: Turned) -> Vec3 {
        self.directions.map_or(turned, |directions| directions.at(self.angles(turned)))
    }

    /// What a block at a point is given where it is kept.
    pub(super) fn fitted(&self, at: usize) -> FittedDirection {
        let turned = self.turned[at];
        match self.directions {
            Some(_) => FittedDirection::Angles(self.angles(turned)),
            None => FittedDirection::Vector(turned),
        }
    }

    /// The last point up to `limit` that can be kept next behind a kept one: looked for in ever larger steps, then by halves.
    pub(super) fn end_of_span(&self, start: usize, limit: usize, looks: &mut u64) -> usize {
        // The block behind a kept one can always be kept: the tube is that narrow.
        let (mut good, mut step) = (start + 1, 2);
        let mut bad = loop {
            let end = (start + step).min(limit);
            if end <= good {
                return good;
            }
            if !self.fits(start, end, looks) {
                break end;
            }
            good = end;
            step *= 2;
        };
        while bad - good > 1 {
            let middle = good + (bad - good) / 2;
            if self.fits(start, middle, looks) {
                good = middle;
            } else {
                bad = middle;
            }
        }
        good
    }

    fn fits(&self, start: usize, end: usize, looks: &mut u64) -> bool {
        let Some(span) = self.span(start, end) else { return false };
        let mut before = span.apart(start);
        for at in start + 1..=end {
            *looks += 1;
            let here = span.apart(at);
            let is_near = here.position_mm < self.distance_tolerance_mm;
            if !is_near || span.bound_rad(at - 1, before, here) > self.angle_tolerance_rad {
                return false;
            }
            before = here;
        }
        true
    }

    /// What is left between two kept points; `None` between opposite directions.
    pub(super) fn span(&self, start: usize, end: usize) -> Option<Span<'_>> {
        let circle = match self.directions {
            Some(_) => None,
            None => Some(GreatCircle::new(self.turned[start], self.turned[end]).ok()?),
        };
        Some(Span { group: self, start, end, circle })
    }
}

/// What is left between two kept points.
pub(super) struct Span<'a> {
    group: &'a FittedGroup<'a>,
    start: usize,
    end: usize,
    /// The great circle between the directions, where vectors are programmed.
    circle: Option<GreatCircle>,
}

impl Span<'_> {
    fn share(&self, at: usize) -> f64 {
        let lengths_mm = &self.group.lengths_mm;
        (lengths_mm[at] - lengths_mm[self.start]) / (lengths_mm[self.end] - lengths_mm[self.start])
    }

    /// What is left at a programmed point.
    fn turned(&self, at: usize) -> Turned {
        if at == self.end {
            return self.group.turned[at];
        }
        let (from, to) = (self.group.turned[self.start], self.group.turned[self.end]);
        match &self.circle {
            Some(circle) => circle.at(self.share(at)),
            None => add_scaled(from, sub(to, from), self.share(at)),
        }
    }

    /// By how much the rotary axes are beside the program.
    fn beside_rad(&self, at: usize) -> [f64; 2] {
        self.group.angles(sub(self.turned(at), self.group.programmed(at)))
    }

    pub(super) fn apart(&self, at: usize) -> Apart {
        let points = self.group.points;
        let (from, to) = (points[self.start].tip_mm, points[self.end].tip_mm);
        let tip_mm = add_scaled(from, sub(to, from), self.share(at));
        let [first, second] = if self.circle.is_none() { self.beside_rad(at).map(f64::abs) } else { [0.0; 2] };
        Apart {
            position_mm: if at == self.end { 0.0 } else { norm(sub(points[at].tip_mm, tip_mm)) },
            direction_rad: angle(
                self.group.direction(self.turned(at)),
                self.group.direction(self.group.programmed(at)),
            ),
            rotary_rad: first.max(second),
        }
    }

    /// Most that the directions are apart between a point and the next one, rad: the smaller of two bounds.
    ///
    /// Both directions are functions v(u) with |v″| ≤ T², T the angle that they turn (for rotary axes the sum of their
    /// angles); a straight line between the ends of each is off by T²/8 at most, and two straight lines are furthest apart at an
    /// end.
    ///
    /// Between great circles of at most L the distance is at most ε/cos(L/2), ε the larger one at the ends: a Jacobi field on
    /// the sphere is sin(uL)/sin(L) of its end, and those from both ends add to cos((½ − u)L)/cos(L/2). Between rotary axes the
    /// difference of the angles is linear in u, and turns the direction by its second angle and by its first one times the
    /// sine of the angle to the first axis.
    pub(super) fn bound_rad(&self, block: usize, from: Apart, to: Apart) -> f64 {
        let group = self.group;
        let ends_rad = from.direction_rad.max(to.direction_rad);
        let share = self.share(block + 1) - self.share(block);
        let (programmed_rad, left_rad, direct_rad) = match &self.circle {
            Some(circle) => {
                let programmed_rad = angle(group.programmed(block), group.programmed(block + 1));
                let left_rad = circle.angle_rad() * share;
                let longest_rad = programmed_rad.max(left_rad) + ends_rad;
                let is_short = longest_rad < FRAC_PI_2;
                let direct_rad = if is_short { ends_rad / libm::cos(0.5 * longest_rad) } else { f64::INFINITY };
                (programmed_rad, left_rad, direct_rad)
            }
            None => {
                let turn_rad = |from: Turned, to: Turned| (to[0] - from[0]).abs() + (to[1] - from[1]).abs();
                let (before, after) = (self.beside_rad(block), self.beside_rad(block + 1));
                let lever = group.lever(block, before[1].abs().max(after[1].abs()));
                let of = |beside: [f64; 2]| beside[1].abs() + lever * beside[0].abs();
                (
                    turn_rad(group.programmed(block), group.programmed(block + 1)),
                    turn_rad(self.turned(block), self.turned(block + 1)),
                    of(before).max(of(after)),
                )
            }
        };
        let bent = 0.125 * (programmed_rad * programmed_rad + left_rad * left_rad);
        angle_of(chord(ends_rad) + bent).min(direct_rad)
    }
}
