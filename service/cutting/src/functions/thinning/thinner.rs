//! The stage: blocks in, groups thinned, kept blocks out.

use feedwave_motion::ProfileProblem;
use feedwave_motion::kinematics::RotaryDirections;
use feedwave_motion::kinematics::vector::Vec3;
use serde::{Deserialize, Serialize};

use super::bounds::{RUN, Tree};
use super::fitted::{Apart, FittedGroup, Turned, is_break};
use super::report::{Largest, Reversals, RotaryReport, ThinningReport};
use super::span::{Between, Group, Limits, angle_of, chord};
use super::trace::{Deviation, DeviationTrace};
use super::{ThinningMethod, ThinningSettings};

/// How the direction is interpolated between kept blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DirectionInterpolation {
    /// Along the great circle, for programs that give vectors.
    #[default]
    GreatCircle,
    /// By the angles of these rotary axes, for programs that give angles; blocks without angles go along the great circle.
    Angles(RotaryDirections),
}

/// A pure cutting block: straight, with nothing but position, direction and feed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CutPoint {
    /// Program line.
    pub line: u32,
    /// Tool centre point at the end of the block, work coordinates, mm.
    pub tip_mm: Vec3,
    /// Tool direction at the end of the block, a unit vector; in the coordinates of the [`RotaryDirections`] where
    /// angles are interpolated.
    pub direction: Vec3,
    /// Values of the rotary axes at the end of the block, rad, where they are known.
    pub rotary_rad: Option<[f64; 2]>,
    /// The feed that this block programs itself, in the units of the program. A feed that holds for one block only
    /// (inverse time) is no modal word: such blocks belong to [`Thinner::push_other`].
    pub feed_word: Option<f64>,
}

impl CutPoint {
    fn is_finite(&self) -> bool {
        let rotary = self.rotary_rad.unwrap_or_default();
        self.tip_mm.iter().chain(&self.direction).chain(&rotary).all(|value| value.is_finite())
    }
}

/// A kept block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kept<T> {
    /// The block; its feed word is the one that holds, its own or that of the last dropped block with one.
    pub point: CutPoint,
    /// What came with it.
    pub payload: T,
    /// Whether the feed word is a dropped block's.
    pub inherited_feed: bool,
    /// Blocks dropped between the kept one before and this one.
    pub dropped: u32,
    /// Program lines of the first and the last of them.
    pub dropped_lines: Option<[u32; 2]>,
    /// What the fit makes of its direction; `None` where it is as programmed.
    pub fitted: Option<FittedDirection>,
}

/// The direction of a block that the fit turned, in the form in which the program gives directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FittedDirection {
    /// A unit vector.
    Vector(Vec3),
    /// Values of the rotary axes, rad.
    Angles([f64; 2]),
}

impl<T> Kept<T> {
    /// The first block of a group, as programmed.
    const fn first(point: CutPoint, payload: T) -> Self {
        Self { point, payload, inherited_feed: false, dropped: 0, dropped_lines: None, fitted: None }
    }
}

/// The stage. Its whole state is one serialisable value, like that of every machining function.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Thinner<T> {
    settings: ThinningSettings,
    interpolation: DirectionInterpolation,
    points: Vec<CutPoint>,
    payloads: Vec<T>,
    /// In the fitted method, directions of the first points as the group before has left them; the first point is kept already.
    carried: Vec<Turned>,
    figures: ThinningReport,
    position: Largest,
    /// Square of a chord.
    direction: Largest,
    /// Bound of the direction between points, rad; in the fitted method.
    bound: Largest,
    rotary: Largest,
    before: Reversals,
    after: Reversals,
    /// Bounds of the group under work; nothing of it outlives the group.
    #[serde(skip)]
    tree: Tree,
    /// Questions asked about points and bounds, for the tests of the cost.
    #[serde(skip)]
    looks: u64,
    /// Deviations along the program, where requested.
    #[serde(skip)]
    trace: Option<DeviationTrace>,
}

impl<T> Thinner<T> {
    /// A stage with nothing read yet.
    ///
    /// # Errors
    ///
    /// Everything that is wrong with the settings, by field.
    pub fn new(settings: ThinningSettings, interpolation: DirectionInterpolation) -> Result<Self, Vec<ProfileProblem>> {
        let problems = settings.validate();
        if !problems.is_empty() {
            return Err(problems);
        }
        Ok(Self {
            settings,
            interpolation,
            points: Vec::new(),
            payloads: Vec::new(),
            carried: Vec::new(),
            figures: ThinningReport::default(),
            position: Largest::default(),
            direction: Largest::default(),
            bound: Largest::default(),
            rotary: Largest::default(),
            before: Reversals::default(),
            after: Reversals::default(),
            tree: Tree::default(),
            looks: 0,
            trace: None,
        })
    }

    /// Keeps the deviations along the program from here on.
    #[must_use]
    pub fn keeping_trace(mut self) -> Self {
        self.trace = Some(DeviationTrace::default());
        self
    }

    /// The deviations along the program, where they were kept.
    #[must_use]
    pub const fn trace(&self) -> Option<&DeviationTrace> {
        self.trace.as_ref()
    }

    /// Reads a pure cutting block. When it fills its group, the kept blocks of the group go to `out` in order. A block with a
    /// coordinate that is not a number is kept, and a group of its own.
    pub fn push(&mut self, point: CutPoint, payload: T, out: &mut (impl FnMut(Kept<T>) + ?Sized)) {
        let finite = point.is_finite();
        if !finite || self.is_broken_by(&point) {
            self.flush(out);
        }
        self.figures.blocks_read += 1;
        self.before.add(point.rotary_rad);
        self.points.push(point);
        self.payloads.push(payload);
        let is_full = self.points.len() >= self.settings.group_blocks as usize;
        if is_full && finite && self.settings.method == ThinningMethod::Fitted {
            self.settle(false, out);
        } else if !finite || is_full {
            self.flush(out);
        }
    }

    /// Reads a block that does anything else, or more: the group before it is thinned, the block itself is the caller's to
    /// keep, and the next block starts a group.
    pub fn push_other(&mut self, out: &mut (impl FnMut(Kept<T>) + ?Sized)) {
        self.flush(out);
        self.figures.blocks_read += 1;
        self.figures.other_blocks += 1;
        self.before.interrupt();
        self.after.interrupt();
    }

    /// Thins what has been read of the group: at the end of the mode or of the program.
    pub fn flush(&mut self, out: &mut (impl FnMut(Kept<T>) + ?Sized)) {
        if self.points.is_empty() {
            return;
        }
        if self.settings.method == ThinningMethod::Fitted {
            return self.settle(true, out);
        }
        self.figures.groups += 1;
        if self.points.len() > RUN {
            self.tree.build(self.points.iter().map(|point| (point.tip_mm, point.direction)));
        } else {
            self.tree.build(std::iter::empty());
        }
        let mut payloads = std::mem::take(&mut self.payloads);
        let mut rest = payloads.drain(..);
        if let Some(payload) = rest.next() {
            let point = self.points[0];
            self.after.add(point.rotary_rad);
            out(Kept::first(point, payload));
        }
        let mut start = 0;
        while start + 1 < self.points.len() {
            let mut looks = 0;
            let end = self.group().end_of_span(start, &mut looks);
            self.looks += looks;
            self.measure(start, end);
            let dropped = end - start - 1;
            if let Some(payload) = rest.by_ref().nth(dropped) {
                out(self.keep(start, end, payload));
            }
            start = end;
        }
        drop(rest);
        // The memory goes back for the next group.
        self.payloads = payloads;
        self.points.clear();
    }

    /// Another form of direction follows: the group before it is thinned.
    pub fn interpolate(&mut self, interpolation: DirectionInterpolation, out: &mut (impl FnMut(Kept<T>) + ?Sized)) {
        if interpolation != self.interpolation {
            self.flush(out);
            self.before.interrupt();
            self.after.interrupt();
            self.interpolation = interpolation;
        }
    }

    /// Whether the fit cannot go on from the last block to this one.
    fn is_broken_by(&self, point: &CutPoint) -> bool {
        let Some(before) = self.points.last().filter(|_| self.settings.method == ThinningMethod::Fitted) else {
            return false;
        };
        let has_angles = point.rotary_rad.is_some();
        let by_angles = has_angles && matches!(self.interpolation, DirectionInterpolation::Angles(_));
        before.rotary_rad.is_some() != has_angles || is_break(before, point, by_angles)
    }

    /// The rotary axes whose angles are interpolated between the points of the group.
    fn fitted_angles(&self) -> Option<RotaryDirections> {
        match self.interpolation {
            DirectionInterpolation::Angles(directions) => {
                self.points.iter().all(|point| point.rotary_rad.is_some()).then_some(directions)
            }
            DirectionInterpolation::GreatCircle => None,
        }
    }

    /// Fits the group and hands on what is kept of it: all of it where nothing follows, else three quarters, so that what
    /// follows has its part in the rest.
    fn settle(&mut self, is_last: bool, out: &mut (impl FnMut(Kept<T>) + ?Sized)) {
        self.figures.groups += 1;
        let directions = self.fitted_angles();
        let points = std::mem::take(&mut self.points);
        let carried = std::mem::take(&mut self.carried);
        let tolerances = [self.settings.fitted_tolerance_deg().to_radians(), self.settings.distance_tolerance_mm];
        let group = FittedGroup::fit(&points, directions.as_ref(), tolerances, &carried, is_last);
        let last = points.len() - 1;
        let limit = if is_last { last } else { (points.len() * 3 / 4).clamp(1, last - 1) };
        let mut payloads = std::mem::take(&mut self.payloads).into_iter();
        if carried.is_empty()
            && let Some(payload) = payloads.next()
        {
            if directions.is_some() {
                self.after.add(points[0].rotary_rad);
            }
            out(Kept::first(points[0], payload));
        }
        let mut start = 0;
        while start < limit {
            let mut looks = 0;
            let end = group.end_of_span(start, limit, &mut looks);
            self.looks += looks;
            self.measure_fitted(&group, start, end);
            if let Some(payload) = payloads.by_ref().nth(end - start - 1) {
                let fitted = (!(is_last && end == last)).then(|| group.fitted(end));
                let mut point = points[end];
                if let Some(fitted) = fitted {
                    point.direction = group.direction(group.turned[end]);
                    point.rotary_rad = match fitted {
                        FittedDirection::Angles(rotary_rad) => Some(rotary_rad),
                        FittedDirection::Vector(_) => None,
                    };
                }
                if directions.is_some() {
                    self.after.add(point.rotary_rad);
                }
                out(Kept { fitted, ..self.with_feeds(&points[start + 1..end], point, payload) });
            }
            start = end;
        }
        if !is_last {
            // Behind the last point the block is not known yet that its tube has to be narrow enough for.
            self.carried = group.turned[start..last].iter().take(2).copied().collect();
            self.points = points[start..].to_vec();
            self.payloads = payloads.collect();
        }
    }

    /// The deviations between two blocks that the fitted method keeps.
    fn measure_fitted(&mut self, group: &FittedGroup<'_>, start: usize, end: usize) {
        let Some(span) = group.span(start, end) else { return };
        let mut before = span.apart(start);
        for at in start + 1..=end {
            let here = span.apart(at);
            let line = group.points[at].line;
            let Apart { position_mm, direction_rad, rotary_rad } = here;
            self.position.add(position_mm, line);
            let chord = chord(direction_rad);
            self.direction.add(chord * chord, line);
            self.bound.add(span.bound_rad(at - 1, before, here), line);
            self.rotary.add(rotary_rad, line);
            self.figures.rotary.off_blocks += u64::from(rotary_rad > group.angle_tolerance_rad);
            if let Some(trace) = &mut self.trace {
                trace.add(line, Deviation { position_mm, direction_deg: direction_rad.to_degrees() });
            }
            before = here;
        }
    }

    /// A block that is kept by itself moves the rotary axes there; for directions along great circles, whose angles only the
    /// caller knows.
    pub(crate) fn is_kept_at(&mut self, rotary_rad: Option<[f64; 2]>) {
        self.after.add(rotary_rad);
    }

    fn group(&self) -> Group<'_> {
        let limits = Limits {
            chord: chord(self.settings.angle_tolerance_deg.to_radians()),
            distance_mm: self.settings.distance_tolerance_mm,
            interpolated_chord: self.settings.interpolated_direction_tolerance_deg.map(|deg| chord(deg.to_radians())),
        };
        let directions = match &self.interpolation {
            DirectionInterpolation::GreatCircle => None,
            DirectionInterpolation::Angles(directions) => Some(directions),
        };
        Group { points: &self.points, tree: &self.tree, limits, directions }
    }

    /// The deviations of the blocks dropped between two kept ones.
    fn measure(&mut self, start: usize, end: usize) {
        if end == start + 1 {
            return;
        }
        let (mut position, mut direction, mut rotary) = (self.position, self.direction, self.rotary);
        let mut off_blocks = 0;
        let mut trace = self.trace.take();
        let group = self.group();
        let segment = group.segment(start, end);
        let (first, last) = (&self.points[start], &self.points[end]);
        let between = Between::new(first, last, group.directions);
        let tolerance_rad = self.settings.angle_tolerance_deg.to_radians();
        for (index, point) in self.points.iter().enumerate().take(end).skip(start + 1) {
            let share = group.share(&segment, (start, end), index);
            let (position_mm, square) = (segment.distance(point.tip_mm), between.apart(share, point.direction));
            position.add(position_mm, point.line);
            direction.add(square, point.line);
            if let Some(trace) = &mut trace {
                let direction_deg = angle_of(libm::sqrt(square)).to_degrees();
                trace.add(point.line, Deviation { position_mm, direction_deg });
            }
            if let (Some(start), Some(end), Some(now)) = (first.rotary_rad, last.rotary_rad, point.rotary_rad) {
                let off = |axis: usize| (now[axis] - start[axis] - (end[axis] - start[axis]) * share).abs();
                let off = off(0).max(off(1));
                rotary.add(off, point.line);
                off_blocks += u64::from(off > tolerance_rad);
            }
        }
        (self.position, self.direction, self.rotary, self.trace) = (position, direction, rotary, trace);
        self.figures.rotary.off_blocks += off_blocks;
    }

    /// The kept block at the end of a span, with the modal words of those dropped before it.
    fn keep(&mut self, start: usize, end: usize, payload: T) -> Kept<T> {
        let points = std::mem::take(&mut self.points);
        let kept = self.with_feeds(&points[start + 1..end], points[end], payload);
        self.points = points;
        self.after.add(kept.point.rotary_rad);
        kept
    }

    /// A kept block with the modal words of those dropped before it.
    fn with_feeds(&mut self, dropped: &[CutPoint], mut point: CutPoint, payload: T) -> Kept<T> {
        let mut feeds = dropped.iter().filter_map(|point| point.feed_word);
        let last_feed = feeds.next_back();
        let inherited_feed = point.feed_word.is_none() && last_feed.is_some();
        self.figures.feeds_lost += feeds.count() as u64 + u64::from(last_feed.is_some() && !inherited_feed);
        self.figures.feeds_inherited += u64::from(inherited_feed);
        self.figures.blocks_dropped += dropped.len() as u64;
        if inherited_feed {
            point.feed_word = last_feed;
        }
        let dropped_lines = dropped.first().zip(dropped.last()).map(|(first, last)| [first.line, last.line]);
        Kept { point, payload, inherited_feed, dropped: dropped.len() as u32, dropped_lines, fitted: None }
    }

    /// What has been done so far; blocks of a group that is not full yet are read, and neither kept nor dropped.
    #[must_use]
    pub fn report(&self) -> ThinningReport {
        let (position_deviation_mm, position_deviation_line) = self.position.get();
        let (square, direction_deviation_line) = self.direction.get();
        let (rotary_rad, largest_deviation_line) = self.rotary.get();
        ThinningReport {
            position_deviation_mm,
            position_deviation_line,
            direction_deviation_deg: angle_of(libm::sqrt(square)).to_degrees(),
            direction_deviation_line,
            direction_bound_deg: self.bound.get().0.to_degrees(),
            rotary: RotaryReport {
                reversals_before: self.before.count(),
                reversals_after: self.after.count(),
                largest_deviation_deg: rotary_rad.to_degrees(),
                largest_deviation_line,
                ..self.figures.rotary
            },
            ..self.figures
        }
    }

    /// Questions asked about points and runs of points so far: the cost of the searches, as a count.
    #[must_use]
    pub const fn looks(&self) -> u64 {
        self.looks
    }
}
