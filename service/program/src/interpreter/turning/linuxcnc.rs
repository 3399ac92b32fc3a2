//! The cycles along a contour of LinuxCNC 2.9: `G70`, `G71`, `G72` and their forms without pockets or with pockets only.
//!
//! The first move of the subprogram is the dive to the contour. Passes go down it by the depth, from the level of the start itself
//! on, and along to the contour; there the tool backs off by R in both directions, and returns over a point as far before the start
//! of the pass. At the end of the dive the tool follows the contour, and cuts each pocket from where it goes down. The cycle ends
//! at the end of the contour.

use super::contour::SAME_MM;
use super::frame::Frame;
use super::passes::{Contour, Path, Plan, Refusal};
use super::request::Job;
use super::stock::{self, Circle, Segment};
use crate::code;
use crate::compensation::geometry::{Curve, Point, cross, distance, minus};
use crate::state::Pockets;

/// Ends of arcs that are nearer than this are reached, mm.
const REACHED_MM: f64 = 1e-3;

/// Below every contour, mm.
const BOTTOM_MM: f64 = -1e9;

pub(super) fn plan(job: &Job, contour: Contour<'_>) -> Result<Plan, Refusal> {
    let mut curves: Vec<_> = contour.pieces.iter().map(|piece| piece.curve).collect();
    curves[0].from = contour.start;
    if curves.len() == 1 {
        // Without a contour behind the dive the cycle goes to its start.
        let frame = Frame::turning([-1.0, 1.0]);
        let mut path = Path::new(frame, frame.to(contour.tool));
        path.rapid(frame.to(contour.start));
        return Ok(Plan { steps: path.steps, ..Plan::default() });
    }
    match *job {
        Job::Steps { facing, pockets, depth_mm, escape_mm, stock_mm } => {
            let frame = frame([curves[0].to, curves[curves.len() - 1].to], facing);
            let mut segments = forward(&curves, frame, contour)?;
            stock::offset(&mut segments, stock_mm)?;
            let mut path = Path::new(frame, frame.to(contour.tool));
            path.rapid(frame.to(contour.start));
            Steps { path, segments, depth_mm, escape_mm }.rough(pockets)
        }
        Job::Offsets { first_mm, last_mm, passes } => {
            let ends = [curves[1].to, curves[curves.len() - 1].to];
            let along_z = segments(&curves[1..], frame(ends, false));
            let facing = along_z.iter().any(|segment| !segment.goes_forward());
            let frame = frame([curves[0].to, ends[1]], facing);
            finish(forward(&curves, frame, contour)?, frame, contour, [first_mm, last_mm], passes)
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
    if let Some(wrong) = segments.iter().find(|segment| !segment.goes_forward()) {
        let message = "the contour turns back along the passes here, or an arc goes beyond a quarter of its circle";
        let cure = "let the contour keep one direction, and divide arcs at their quarters";
        return Err(Refusal::new(code::TURNING_MONOTONY, message, cure).at(contour.pieces[wrong.block].span));
    }
    Ok(segments)
}

/// The finishing cycle: along the contour at a distance, nearer in each pass.
fn finish(
    segments: Vec<Segment>,
    frame: Frame,
    contour: Contour<'_>,
    [first_mm, last_mm]: [f64; 2],
    passes: u32,
) -> Result<Plan, Refusal> {
    let mut path = Path::new(frame, frame.to(contour.tool));
    path.rapid(frame.to(contour.start));
    for pass in (0..passes).rev() {
        let distance = f64::from(pass) * (first_mm - last_mm) / f64::from(passes) + last_mm;
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
            if low > level + SAME_MM || high < level - SAME_MM {
                return meetings;
            }
            if high - low < SAME_MM {
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
        if square < -SAME_MM {
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
        sense * cross(minus(self.from, center), out) >= -SAME_MM
            && sense * cross(minus(self.to, center), out) <= SAME_MM
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
    depth_mm: f64,
    escape_mm: f64,
}

impl Steps {
    fn rough(mut self, pockets: Pockets) -> Result<Plan, Refusal> {
        let start = self.segments[0].from;
        self.path.rapid(start);
        if let Some(last) = self.segments.last().copied()
            && last.to[1] < start[1]
        {
            self.segments.push(Segment::line(last.to, [last.to[0], start[1]], last.block));
        }
        self.passes(pockets)?;
        Ok(Plan { steps: self.path.steps, ..Plan::default() })
    }

    fn passes(&mut self, pockets: Pockets) -> Result<(), Refusal> {
        let mut at = 0;
        let mut level = self.segments[0].from[1];
        let mut along_walls = pockets;
        if pockets == Pockets::Only {
            while at < self.segments.len() && !self.dive(at, BOTTOM_MM)? {
                at += 1;
            }
            along_walls = Pockets::All;
            level = self.path.at[1];
        }
        while at < self.segments.len() {
            if self.path.is_full() {
                return Err(Refusal::too_many());
            }
            while level > self.path.at[1] {
                level -= self.depth_mm;
            }
            if self.dive(at, level)? {
                match self.behind_dive(at, along_walls) {
                    Some(next) => {
                        // A pocket begins, on the first level below its edge; where only pockets are cut, on its edge.
                        (at, along_walls) = (next, Pockets::All);
                        if pockets == Pockets::Only {
                            level = self.path.at[1];
                        }
                        while level < self.path.at[1] {
                            level += self.depth_mm;
                        }
                        continue;
                    }
                    None => return Ok(()),
                }
            }
            if (self.path.at[1] - level).abs() > SAME_MM {
                at += 1;
                continue;
            }
            self.pass(&mut at, &mut level);
        }
        Ok(())
    }

    /// One pass along the level where the tool is, to the contour and back.
    fn pass(&mut self, at: &mut usize, level: &mut f64) {
        let begin = self.path.at;
        for index in *at..self.segments.len() {
            let meetings = self.segments[index].meetings(begin[1]);
            let meets = if index == *at { meetings.last() } else { meetings.first() };
            let Some(along) = meets else { continue };
            let travel = (along - begin[0]).abs();
            if travel < SAME_MM {
                if index == *at {
                    continue;
                }
                // It is on the contour already.
                *at += 1;
                return;
            }
            self.path.feed([along, begin[1]]);
            let back =
                self.escape_mm * if self.escape_mm > 0.0 { (travel * 0.5 / self.escape_mm).min(1.0) } else { 0.0 };
            self.path.rapid([along - back, begin[1] + back]);
            self.path.rapid([begin[0] + back, begin[1] + back]);
            self.path.straight(begin, *at == 0);
            *level -= self.depth_mm;
            return;
        }
        // Nothing is met: on with the next piece, so that the cycle ends.
        *at += 1;
    }

    /// Goes down a piece to a level; `true` where it does not go down.
    fn dive(&mut self, index: usize, level: f64) -> Result<bool, Refusal> {
        let segment = self.segments[index];
        let Some(circle) = segment.circle else {
            if segment.from[1] <= segment.to[1] {
                return Ok(true);
            }
            let to = if level < segment.to[1] {
                segment.to
            } else {
                let Some(along) = segment.meetings(level).first() else {
                    let message = "a level lies above the piece of the contour that goes down";
                    let cure = "start the cycle at the level where the contour begins to go down";
                    return Err(Refusal::new(code::TURNING_START, message, cure));
                };
                [along, level]
            };
            self.path.straight(to, index == 0);
            return Ok(false);
        };
        let here = self.path.at;
        if distance(here, segment.to) < REACHED_MM {
            return Ok(false);
        }
        let meetings = segment.meetings(level);
        let middle = circle.center[0];
        let end = if circle.is_hill {
            if here[0] < middle {
                return Ok(true);
            }
            meetings.last().filter(|along| *along >= middle)
        } else {
            if here[0] >= middle {
                return Ok(true);
            }
            meetings.first().filter(|along| *along <= middle)
        };
        match end {
            None => self.arc_to(&segment, segment.to),
            Some(along) if distance(here, [along, level]) > REACHED_MM => self.arc_to(&segment, [along, level]),
            Some(along) => self.path.at = [along, level],
        }
        Ok(false)
    }

    /// Follows the contour behind a dive; the piece where the next pocket begins, `None` at the end.
    fn behind_dive(&mut self, at: usize, pockets: Pockets) -> Option<usize> {
        for index in at..self.segments.len() {
            if pockets == Pockets::Without {
                self.climb_only(index);
            } else if !self.climb(index) {
                return Some(index);
            }
        }
        None
    }

    /// Goes up a piece; `false` where it does not go up, or not to its end.
    fn climb(&mut self, index: usize) -> bool {
        let segment = self.segments[index];
        let here = self.path.at;
        match segment.circle {
            None => {
                if segment.to[1] < segment.from[1] {
                    return false;
                }
                self.path.follow(&segment.curve(here, segment.to), segment.block);
                true
            }
            Some(circle) if circle.is_hill => {
                if here[0] <= circle.center[0] {
                    self.arc_if_far(&segment, segment.crest(circle));
                }
                false
            }
            Some(circle) => {
                if here[0] < circle.center[0] {
                    return false;
                }
                self.arc_if_far(&segment, segment.to);
                true
            }
        }
    }

    /// Straight over to a piece that goes up, and up it.
    fn climb_only(&mut self, index: usize) {
        let segment = self.segments[index];
        let level = self.path.at[1];
        let meetings = segment.meetings(level);
        let along = match segment.circle {
            None if segment.to[1] < segment.from[1] => None,
            None => meetings.first(),
            Some(circle) if circle.is_hill => meetings.first().filter(|along| *along <= circle.center[0]),
            Some(circle) => meetings.last().filter(|along| *along >= circle.center[0]),
        };
        let Some(along) = along else { return };
        self.path.feed([along, level]);
        match segment.circle {
            None => self.path.follow(&segment.curve([along, level], segment.to), segment.block),
            Some(circle) => {
                let to = if circle.is_hill { segment.crest(circle) } else { segment.to };
                self.arc_if_far(&segment, to);
            }
        }
    }

    fn arc_if_far(&mut self, segment: &Segment, to: Point) {
        if distance(self.path.at, to) > REACHED_MM {
            self.arc_to(segment, to);
        } else {
            self.path.at = to;
        }
    }

    fn arc_to(&mut self, segment: &Segment, to: Point) {
        self.path.follow(&segment.curve(self.path.at, to), segment.block);
    }
}
