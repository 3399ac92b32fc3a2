//! The cycles along a contour of LinuxCNC 2.9: `G70`, `G71`, `G72` and their forms without pockets or with pockets only.
//!
//! The first move of the subprogram is the dive to the contour. Passes go down it by the depth, from the level of the start itself
//! on, and along to the contour; there the tool backs off by R in both directions, and returns over a point as far before the start
//! of the pass. At the end of the dive the tool follows the contour, and cuts each pocket from where it goes down. The cycle ends
//! at the end of the contour.
//!
//! Lengths are in the unit of the program, since LinuxCNC's tolerances are.

use super::contour::{Piece, SAME_MM as SAME};
use super::frame::Frame;
use super::gouge;
use super::passes::{Contour, MAX_STEPS, Path, Plan, Refusal};
use super::request::Job;
use super::stock::{self, Circle, Segment};
use crate::code;
use crate::compensation::geometry::{Curve, Point, cross, distance, minus};
use crate::state::Pockets;

/// Ends of arcs that are nearer than this are reached.
const REACHED: f64 = 1e-3;

/// Arcs that are shorter than this along both axes are none.
const LEAST_ARC: f64 = 1e-4;

/// No arc of a contour turns further, rad.
const MOST_SWEEP_RAD: f64 = core::f64::consts::PI + 0.1;

/// The cure of a start that leads a cycle into its contour.
pub(super) const CLEAR_OF_THE_STOCK: &str =
    "start the cycle clear of the stock: higher than the whole contour, and before its first point";

/// Below every contour.
const BOTTOM: f64 = -1e9;

pub(super) fn plan(job: &Job, contour: Contour<'_>) -> Result<Plan, Refusal> {
    let (Job::Steps { unit_mm, .. } | Job::Offsets { unit_mm, .. }) = *job else { return Ok(Plan::default()) };
    let scaled = |curve: &Curve, by: f64| {
        let point = |point: Point| point.map(|value| value * by);
        match curve.circle {
            None => Curve::line(point(curve.from), point(curve.to)),
            Some(circle) => Curve::arc(point(curve.from), point(curve.to), point(circle.center), circle.sweep_rad),
        }
    };
    let per_mm = 1.0 / unit_mm;
    let [start, tool] = [contour.start, contour.tool].map(|point| point.map(|value| value * per_mm));
    let scaled_piece = |piece: &Piece| Piece { curve: scaled(&piece.curve, per_mm), ..*piece };
    let pieces: Vec<_> = contour.pieces.iter().map(scaled_piece).collect();
    let contour = Contour { pieces: &pieces, start, tool, ..contour };
    let skipped = usize::from(contour.pieces[0].curve.from == contour.pieces[0].curve.to);
    if skipped == 1 || distance(contour.start, contour.pieces[0].curve.to) < REACHED {
        check_start(job, contour, skipped)?;
    }
    let mut plan = plan_in_units(job, Contour { pieces: &pieces[skipped..], ..contour })?;
    for step in &mut plan.steps {
        step.curve = scaled(&step.curve, unit_mm);
        step.block = step.block.map(|block| block + skipped as u32);
    }
    Ok(plan)
}

/// A cycle that starts where its contour begins dives along the first piece of the contour. That is right for no finishing cycle,
/// which would go there rapidly, and for a roughing cycle where the piece is a line that does not go down.
fn check_start(job: &Job, contour: Contour<'_>, skipped: usize) -> Result<(), Refusal> {
    let pieces = &contour.pieces[skipped..];
    if let (Job::Steps { facing, stock_mm, .. }, [first, .., last], 1) = (job, pieces, skipped)
        // On which side of one more piece D is would be decided by rounding.
        && (*stock_mm == 0.0 || pieces.len() > 2)
    {
        let dive = Segment::of(&frame([first.curve.to, last.curve.to], *facing).curve(&first.curve), 0);
        if dive.circle.is_none() && dive.to[1] >= dive.from[1] {
            return Ok(());
        }
    }
    let message =
        "the cycle starts where its contour begins, so that the first piece of the contour would be the dive to it";
    Err(Refusal::new(code::TURNING_START, message, CLEAR_OF_THE_STOCK))
}

/// The moves in the unit of the program, which is that of LinuxCNC's tolerances.
fn plan_in_units(job: &Job, contour: Contour<'_>) -> Result<Plan, Refusal> {
    let mut curves: Vec<_> = contour.pieces.iter().map(|piece| piece.curve).collect();
    curves[0].from = contour.start;
    if curves.len() == 1 {
        let message = "the contour has no move behind the one to it, so that the cycle would cut nothing";
        let cure = "write its lines and arcs behind its first block";
        return Err(Refusal::new(code::TURNING_CONTOUR, message, cure));
    }
    match *job {
        Job::Steps { facing, pockets, depth_mm, escape_mm, stock_mm, unit_mm } => {
            let frame = frame([curves[0].to, curves[curves.len() - 1].to], facing);
            let mut segments = forward(&curves, frame, contour)?;
            let programmed = segments.clone();
            stock::offset(&mut segments, stock_mm / unit_mm)?;
            let mut path = Path::new(frame, frame.to(contour.tool));
            path.rapid(frame.to(contour.start));
            path.rapid(segments[0].from);
            let begun = path.steps.len();
            let top = segments[0].from[1];
            let [depth, escape] = [depth_mm / unit_mm, escape_mm / unit_mm];
            let steps = Steps { path, segments, depth, escape, top, edge: None }.rough(pockets)?;
            gouge::check(&steps.path, begun, [&programmed[1..], &steps.segments[1..]], unit_mm)?;
            Ok(Plan { steps: steps.path.steps, ..Plan::default() })
        }
        Job::Offsets { first_mm, last_mm, passes, unit_mm } => {
            let ends = [curves[1].to, curves[curves.len() - 1].to];
            let along_z = segments(&curves[1..], frame(ends, false));
            let facing = along_z.iter().any(|segment| !segment.goes_forward());
            if facing {
                // Without the dive, whose end may say otherwise which way is forward.
                let mut behind_dive = segments(&curves[1..], frame(ends, true));
                behind_dive[0].from[0] = behind_dive[0].from[0].min(behind_dive[0].to[0]);
                check_direction(&behind_dive, &contour.pieces[1..])?;
            }
            let frame = frame([curves[0].to, ends[1]], facing);
            let distances = [first_mm / unit_mm, last_mm / unit_mm];
            finish(forward(&curves, frame, contour)?, frame, contour, distances, passes)
        }
        _ => Ok(Plan::default()),
    }
}

/// The frame in which a contour goes forward and up, from the end of its first piece to that of its last.
fn frame([first, last]: [Point; 2], facing: bool) -> Frame {
    let [along, across] = if facing { [1, 0] } else { [0, 1] };
    let sign = |axis: usize, default: f64| match last[axis] - first[axis] {
        0.0 => default,
        change => change.signum(),
    };
    // Where the contour does not say: toward negative Z and positive X in turning, toward negative X and negative Z in facing.
    let outward = if facing { -1.0 } else { 1.0 };
    Frame { swaps: facing, signs: [sign(along, -1.0), sign(across, outward)] }
}

fn segments(curves: &[Curve], frame: Frame) -> Vec<Segment> {
    curves.iter().enumerate().map(|(block, curve)| Segment::of(&frame.curve(curve), block)).collect()
}

/// The contour, which must go forward; a dive that goes back starts above its end.
fn forward(curves: &[Curve], frame: Frame, contour: Contour<'_>) -> Result<Vec<Segment>, Refusal> {
    let mut segments = segments(curves, frame);
    let dive = &mut segments[0];
    dive.from[0] = dive.from[0].min(dive.to[0]);
    check_direction(&segments, contour.pieces)?;
    Ok(segments)
}

/// Refuses the first piece that goes back.
fn check_direction(segments: &[Segment], pieces: &[Piece]) -> Result<(), Refusal> {
    let Some(wrong) = segments.iter().find(|segment| !segment.goes_forward()) else { return Ok(()) };
    let message = "the contour turns back along the passes here, or an arc goes beyond a quarter of its circle";
    let cure = "let the contour keep one direction, and divide arcs at their quarters";
    Err(Refusal::new(code::TURNING_MONOTONY, message, cure).at(pieces[wrong.block].span))
}

/// The finishing cycle: along the contour at a distance, nearer in each pass.
fn finish(
    segments: Vec<Segment>,
    frame: Frame,
    contour: Contour<'_>,
    [first, last]: [f64; 2],
    passes: u32,
) -> Result<Plan, Refusal> {
    let mut path = Path::new(frame, frame.to(contour.tool));
    path.rapid(frame.to(contour.start));
    for pass in (0..passes).rev() {
        let distance = f64::from(pass) * (first - last) / f64::from(passes) + last;
        let mut segments = segments.clone();
        stock::offset(&mut segments, distance)?;
        path.rapid(segments[0].from);
        path.rapid(segments[0].to);
        for segment in &segments[1..] {
            path.follow(&segment.curve(segment.from, segment.to), segment.block);
        }
        if path.is_full() {
            return Err(Refusal::too_many());
        }
    }
    Ok(Plan { steps: path.steps, ..Plan::default() })
}

/// Where a level meets a piece: the places along, in the order of the piece.
#[derive(Clone, Copy, Debug)]
struct Meetings([f64; 2], usize);

impl Meetings {
    fn first(self) -> Option<f64> {
        (self.1 > 0).then_some(self.0[0])
    }

    fn last(self) -> Option<f64> {
        self.1.checked_sub(1).map(|last| self.0[last])
    }

    fn push(&mut self, along: f64) {
        self.0[self.1] = along;
        self.1 += 1;
    }
}

impl Segment {
    fn meetings(&self, level: f64) -> Meetings {
        let mut meetings = Meetings([0.0; 2], 0);
        let Some(Circle { center, .. }) = self.circle else {
            let (low, high) = (self.from[1].min(self.to[1]), self.from[1].max(self.to[1]));
            if low > level + SAME || high < level - SAME {
                return meetings;
            }
            if high - low < SAME {
                meetings.push(self.from[0]);
                meetings.push(self.to[0]);
            } else {
                let share = (level - self.from[1]) / (self.to[1] - self.from[1]);
                meetings.push(share * (self.to[0] - self.from[0]) + self.from[0]);
            }
            return meetings;
        };
        let across = level - center[1];
        let square = self.radius() * self.radius() - across * across;
        if square < -SAME {
            return meetings;
        }
        let half = square.max(0.0).sqrt();
        for along in [center[0] - half, center[0] + half] {
            if self.holds([along, level]) {
                meetings.push(along);
            }
        }
        meetings
    }

    /// Whether a point of its circle is on the arc, which is at most half a turn.
    fn holds(&self, point: Point) -> bool {
        let Some(Circle { center, is_hill }) = self.circle else { return true };
        let sense = if is_hill { -1.0 } else { 1.0 };
        let out = minus(point, center);
        sense * cross(minus(self.from, center), out) >= -SAME && sense * cross(minus(self.to, center), out) <= SAME
    }

    /// The highest point of a hill that lies on it, or its end.
    fn crest(&self, circle: Circle) -> Point {
        if self.to[0] > circle.center[0] { [circle.center[0], circle.center[1] + self.radius()] } else { self.to }
    }
}

/// The passes of a roughing cycle.
struct Steps {
    segments: Vec<Segment>,
    path: Path,
    depth: f64,
    escape: f64,
    /// From where the levels are counted: the start, and in a cycle of pockets only the edge of the outermost one.
    top: f64,
    edge: Option<f64>,
}

impl Steps {
    /// With the passes, from the start of the dive on.
    fn rough(mut self, pockets: Pockets) -> Result<Self, Refusal> {
        let start = self.segments[0].from;
        if let Some(last) = self.segments.last().copied()
            && last.to[1] < start[1]
        {
            self.segments.push(Segment::line(last.to, [last.to[0], start[1]], last.block));
        }
        self.passes(pockets)?;
        Ok(self)
    }

    fn passes(&mut self, pockets: Pockets) -> Result<(), Refusal> {
        let (mut at, mut level) = (0, self.top);
        if pockets == Pockets::Only {
            while at < self.segments.len() && !self.dive(at, BOTTOM)? {
                at += 1;
            }
        }
        while at < self.segments.len() {
            if self.path.is_full() || (level - self.path.at[1]) / self.depth > MAX_STEPS as f64 {
                return Err(Refusal::too_many());
            }
            while level - SAME > self.path.at[1] {
                level -= self.depth;
            }
            if self.dive(at, level)? {
                let Some(next) = self.behind_dive(at, pockets)? else { return Ok(()) };
                at = next;
                level = self.top_of_pocket(pockets);
            } else if (self.path.at[1] - level).abs() > SAME {
                at += 1;
            } else {
                self.pass(&mut at, &mut level)?;
            }
        }
        Ok(())
    }

    /// From where the levels of the pocket that begins here are counted. Where only pockets are cut, that is the edge of the
    /// outermost pocket around it.
    fn top_of_pocket(&mut self, pockets: Pockets) -> f64 {
        if pockets != Pockets::Only {
            return self.top;
        }
        let here = self.path.at[1];
        let edge = self.edge.filter(|edge| here <= *edge).unwrap_or(here);
        self.edge = Some(edge);
        edge
    }

    /// One pass along the level where the tool is, to the contour and back.
    fn pass(&mut self, at: &mut usize, level: &mut f64) -> Result<(), Refusal> {
        let begin = self.path.at;
        for index in *at..self.segments.len() {
            let meetings = self.segments[index].meetings(begin[1]);
            let meets = if index == *at { meetings.last() } else { meetings.first() };
            let Some(along) = meets else { continue };
            let travel = along - begin[0];
            if travel < -SAME {
                continue;
            }
            if travel < SAME {
                if index == *at {
                    continue;
                }
                if distance(begin, self.segments[index].from) < SAME {
                    *at = index;
                } else {
                    *level -= self.depth;
                }
                return Ok(());
            }
            self.path.feed([along, begin[1]]);
            let back = self.escape * if self.escape > 0.0 { (travel * 0.5 / self.escape).min(1.0) } else { 0.0 };
            self.path.rapid([along - back, begin[1] + back]);
            self.path.rapid([begin[0] + back, begin[1] + back]);
            self.path.straight(begin, *at == 0);
            *level -= self.depth;
            return Ok(());
        }
        Err(astray("a pass of the cycle meets no piece of the contour"))
    }

    /// Goes down a piece to a level; `true` where it does not go down.
    fn dive(&mut self, index: usize, level: f64) -> Result<bool, Refusal> {
        let segment = self.segments[index];
        let Some(circle) = segment.circle else {
            if segment.from[1] <= segment.to[1] + SAME {
                return Ok(true);
            }
            let to = if level < segment.to[1] {
                segment.to
            } else {
                let Some(along) = segment.meetings(level).first() else {
                    return Err(astray("a level of the cycle lies above the piece of the contour that goes down"));
                };
                [along, level]
            };
            self.path.straight(to, index == 0);
            return Ok(false);
        };
        let here = self.path.at;
        if here[0] >= segment.to[0] - SAME {
            if distance(here, segment.to) > REACHED {
                return Err(astray("the tool is beyond a piece of the contour that it has to follow"));
            }
            self.path.stand_at(segment.to);
            return Ok(false);
        }
        let mut meetings = segment.meetings(level);
        if meetings.first().is_none() {
            meetings = segment.meetings(level - SAME);
        }
        let middle = circle.center[0];
        let along = if circle.is_hill {
            if here[0] + SAME < middle {
                return Ok(true);
            }
            meetings.last().filter(|along| *along >= middle)
        } else {
            if here[0] >= middle - SAME {
                return Ok(true);
            }
            let first = meetings.first();
            if first.is_some_and(|along| along > middle) {
                // The level is above the near side: the next one is deeper.
                return Ok(false);
            }
            first
        };
        self.arc_to(&segment, along.map_or(segment.to, |along| [along, level]))?;
        Ok(false)
    }

    /// Follows the contour behind a dive; the piece where the next pocket begins, `None` at the end.
    fn behind_dive(&mut self, at: usize, pockets: Pockets) -> Result<Option<usize>, Refusal> {
        for index in at..self.segments.len() {
            if pockets == Pockets::Without {
                self.climb_only(index)?;
            } else if !self.climb(index)? {
                return Ok(Some(index));
            }
        }
        Ok(None)
    }

    /// Goes up a piece; `false` where it does not go up, or not to its end.
    fn climb(&mut self, index: usize) -> Result<bool, Refusal> {
        let segment = self.segments[index];
        let here = self.path.at;
        match segment.circle {
            None => {
                if segment.to[1] + SAME < segment.from[1] {
                    return Ok(false);
                }
                if distance(here, segment.from) > SAME {
                    return Err(astray("the tool is not where a piece of the contour begins that it has to follow"));
                }
                self.path.follow(&segment.curve(here, segment.to), segment.block);
                Ok(true)
            }
            Some(circle) if circle.is_hill => {
                if here[0] <= circle.center[0] {
                    self.arc_if_far(&segment, segment.crest(circle))?;
                }
                Ok(false)
            }
            Some(circle) => {
                if here[0] < circle.center[0] - SAME {
                    return Ok(false);
                }
                self.arc_if_far(&segment, segment.to)?;
                Ok(true)
            }
        }
    }

    /// Straight over to a piece that goes up, and up it.
    fn climb_only(&mut self, index: usize) -> Result<(), Refusal> {
        let segment = self.segments[index];
        let level = self.path.at[1];
        let meetings = segment.meetings(level);
        let along = match segment.circle {
            None if segment.to[1] + SAME < segment.from[1] => None,
            None => meetings.first(),
            Some(circle) if circle.is_hill => meetings.first().filter(|along| *along <= circle.center[0]),
            Some(circle) => meetings.last().filter(|along| *along >= circle.center[0]),
        };
        let Some(along) = along else { return Ok(()) };
        self.path.feed([along, level]);
        match segment.circle {
            None => self.path.follow(&segment.curve([along, level], segment.to), segment.block),
            Some(circle) => {
                let to = if circle.is_hill { segment.crest(circle) } else { segment.to };
                self.arc_if_far(&segment, to)?;
            }
        }
        Ok(())
    }

    fn arc_if_far(&mut self, segment: &Segment, to: Point) -> Result<(), Refusal> {
        if distance(self.path.at, to) > REACHED {
            return self.arc_to(segment, to);
        }
        self.path.stand_at(to);
        Ok(())
    }

    /// Along an arc of the contour, of which none is more than half a turn.
    fn arc_to(&mut self, segment: &Segment, to: Point) -> Result<(), Refusal> {
        let curve = segment.curve(self.path.at, to);
        let [along, across] = minus(to, self.path.at);
        if along.abs() < LEAST_ARC && across.abs() < LEAST_ARC {
            self.path.stand_at(to);
            return Ok(());
        }
        if curve.circle.is_some_and(|circle| circle.sweep_rad.abs() > MOST_SWEEP_RAD) {
            return Err(astray("the tool is beyond the end of an arc of the contour that it has to follow"));
        }
        self.path.follow(&curve, segment.block);
        Ok(())
    }
}

/// The refusal of a cycle whose start leads it off its contour.
fn astray(message: &str) -> Refusal {
    Refusal::new(code::TURNING_START, message, CLEAR_OF_THE_STOCK)
}
