//! Where a path slows down below its feed for the sake of what it leads round, how much time that takes, and what would save it.
//!
//! The speed is followed from place to place. Around each place where it is lowest, the time that the path takes longer than at
//! its feed is counted for the block there: back to the highest speed before and on to the highest behind it, where either is
//! clearly higher. The feed is the commanded one, as far as the axes reach it on a straight line. Starts, ends and rests that
//! the program asks for are no slowdowns.

use std::collections::BTreeMap;

use feedwave_motion::{
    Curve, Element, MachineAxis, Origin, PlannedMotion, PlannedStretch, ProfilePart, StretchProfile,
};
use feedwave_program::{Axis, Position, SourceSpan};

use super::report::{LimitKind, Slowdown, SlowdownCause, SlowdownCure};

/// Lines that are kept; where there are more, half of them go, those with the smallest sums.
const MAX_LINES: usize = 1 << 14;
/// Slowdowns of a report.
const LISTED: usize = 10;
/// A speed within this share of the feed is at the feed.
const AT_FEED: f64 = 0.999;
/// Two slowdowns are told apart where the speed between them is higher than either by this factor.
const CLEARLY: f64 = 1.25;
/// Speeds within this share of each other are the same.
const SAME_SPEED: f64 = 1e-9;
/// Speed below which the path rests, mm/s.
const AT_REST: f64 = 1e-6;
/// Least time that counts, s: the rest is rounding, where elements meet.
const LEAST_LOSS_S: f64 = 1e-9;
/// Least share of a limit that turning takes where the path itself is what it slows down for.
const LEAST_TURNING: f64 = 0.05;
/// A plan of runs leaves turning half as much of the jerk as of the acceleration of an axis.
const JERK_OF_RUNS: f64 = 2.0;
/// Cosine of the deflection from which on a corner turns back, and stays exact whatever the tolerance: 170°.
const TURNING_BACK: f64 = -0.984_807_753_012_208;

/// A stretch that was run at a feed override.
pub(crate) struct Course<'a> {
    pub(crate) motion: &'a PlannedMotion,
    pub(crate) planned: &'a PlannedStretch,
    pub(crate) ratio: f64,
    /// Whether it is the last of its element.
    pub(crate) is_last: bool,
}

/// The slowest place of a slowdown.
#[derive(Clone, Copy, Debug)]
struct Lowest {
    speed: f64,
    source: SourceSpan,
    cause: SlowdownCause,
    cure: SlowdownCure,
    /// Column of the axis that limits it.
    axis: usize,
    /// Share of its limit that turning takes there.
    turning: f64,
}

/// A slowdown in progress.
#[derive(Clone, Copy, Debug)]
struct Dip {
    lowest: Lowest,
    /// Highest speed behind the slowest place.
    highest: f64,
    /// Time lost up to there, and since, s.
    lost_s: f64,
    since_s: f64,
    /// While the speed falls: the slowest place before, and what was lost since, s.
    fall: Option<(Lowest, f64)>,
    /// Whether it is the start of a path, or the feed changes there.
    is_start: bool,
}

impl Dip {
    /// A slowdown from a place on, with what was lost on a way to it on which the speed fell.
    const fn new(lowest: Lowest, lost_s: f64, falls: bool) -> Self {
        let fall = if falls { Some((lowest, lost_s)) } else { None };
        Self { lowest, highest: lowest.speed, lost_s, since_s: 0.0, fall, is_start: false }
    }
}

impl Dip {
    /// Goes on to the next place; what has ended where another slowdown begins.
    fn reach(&mut self, lowest: Lowest, lost_s: f64, falls: bool) -> Option<Self> {
        let speed = lowest.speed;
        self.fall = match self.fall {
            // Where elements meet, nothing happens.
            fall if !falls && lost_s <= LEAST_LOSS_S => fall,
            _ if !falls => None,
            Some((before, fall_s)) => Some((before, fall_s + lost_s)),
            None => Some((self.lowest, lost_s)),
        };
        self.since_s += lost_s;
        let is_same = (speed - self.lowest.speed).abs() <= SAME_SPEED * speed;
        if speed < self.lowest.speed && !is_same || is_same && lowest.turning >= self.lowest.turning {
            self.lowest = lowest;
            self.highest = speed;
            self.lost_s += std::mem::take(&mut self.since_s);
        } else if speed >= self.highest {
            self.highest = speed;
            self.lost_s += std::mem::take(&mut self.since_s);
        } else if CLEARLY * speed < self.highest && CLEARLY * self.lowest.speed < self.highest {
            let next = Self::new(lowest, self.since_s, true);
            return Some(std::mem::replace(self, next));
        }
        None
    }
}

#[inline]
const fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// What was lost at a line.
#[derive(Clone, Copy, Debug)]
struct AtLine {
    lost_s: f64,
    times: u64,
    /// Its worst slowdown.
    worst: Lowest,
    worst_s: f64,
}

/// Where the element before ended.
#[derive(Clone, Copy, Debug)]
struct Before {
    tangent: Position,
    rests: bool,
    /// Whether it stopped there because that is quicker than rounding the corner.
    stops_by_choice: bool,
    is_free: bool,
}

/// Slowdowns of a program, in bounded memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Slowdowns {
    lines: BTreeMap<(u32, u32), AtLine>,
    total_s: f64,
    dip: Option<Dip>,
    before: Option<Before>,
    last_speed: f64,
}

impl Slowdowns {
    /// The path rests because the program asks for it, or is no cut.
    pub(crate) fn interrupt(&mut self) {
        self.before = None;
        if let Some(dip) = self.dip.take() {
            // The way to this rest is none of it.
            let (lowest, fall_s) = dip.fall.unwrap_or((dip.lowest, 0.0));
            self.add(&Dip { lowest, lost_s: dip.lost_s + dip.since_s - fall_s, ..dip });
        }
    }

    /// Follows the speed along a stretch.
    pub(crate) fn stretch(&mut self, course: &Course<'_>, axes: &[MachineAxis]) {
        let Course { motion, planned, ratio, is_last } = course;
        let feed = (planned.stretch.speed_mm_per_s * ratio).min(straight_velocity(&motion.element, axes));
        if !(feed > 0.0 && feed.is_finite()) {
            return self.interrupt();
        }
        let mut from: Option<(f64, f64)> = None;
        for (t_s, weight) in knots(&planned.profile) {
            let (s, speed, ..) = planned.profile.state(t_s);
            let lowest = lowest(course, axes, (planned.start + s, speed), weight, self.before.as_ref());
            let lost_s = from.map_or(0.0, |(from_s, from_place)| ((t_s - from_s) - (s - from_place) / feed).max(0.0));
            self.reach(lowest, lost_s, speed >= AT_FEED * feed);
            from = Some((t_s, s));
        }
        if *is_last {
            let tangent = motion.element.tangent(motion.element.length);
            let stops_by_choice = motion.origin() == Origin::BlockToStop;
            let (rests, is_free) = (motion.rests_at_end(), moves_freely(&motion.element));
            self.before = Some(Before { tangent, rests, stops_by_choice, is_free });
        }
    }

    /// The speed at the next place, with the time lost on the way to it.
    fn reach(&mut self, lowest: Lowest, lost_s: f64, at_feed: bool) {
        let speed = lowest.speed;
        let last_speed = std::mem::replace(&mut self.last_speed, speed);
        let is_same = |other: f64| (speed - other).abs() <= SAME_SPEED * larger(speed, other);
        let (falls, rises) = (speed < last_speed && !is_same(last_speed), speed > last_speed && !is_same(last_speed));
        let Some(dip) = &mut self.dip else {
            if !at_feed {
                // It begins below the feed where a path starts, and where the feed rises.
                let is_start = lost_s == 0.0;
                self.dip = Some(Dip { is_start, ..Dip::new(lowest, lost_s, !is_start) });
            }
            return;
        };
        if dip.is_start && !rises && lost_s > LEAST_LOSS_S {
            // The start is over; what follows is slow by itself.
            *dip = Dip::new(lowest, lost_s, falls);
        } else {
            let ended = dip.reach(lowest, lost_s, falls);
            if let Some(ended) = ended {
                self.add(&ended);
            }
        }
        if at_feed && let Some(ended) = self.dip.take() {
            // It ends where it is slowest where the feed falls.
            let is_start = ended.is_start || is_same(ended.lowest.speed);
            self.add(&Dip { lost_s: ended.lost_s + ended.since_s, is_start, ..ended });
        }
    }

    fn add(&mut self, dip: &Dip) {
        if dip.is_start || dip.lost_s <= LEAST_LOSS_S {
            return;
        }
        self.total_s += dip.lost_s;
        let line = (dip.lowest.source.program, dip.lowest.source.line);
        let new = AtLine { lost_s: 0.0, times: 0, worst: dip.lowest, worst_s: 0.0 };
        let at = self.lines.entry(line).or_insert(new);
        at.lost_s += dip.lost_s;
        at.times += 1;
        if dip.lost_s > at.worst_s {
            (at.worst, at.worst_s) = (dip.lowest, dip.lost_s);
        }
        if self.lines.len() > MAX_LINES {
            let mut losses: Vec<f64> = self.lines.values().map(|at| at.lost_s).collect();
            losses.sort_by(f64::total_cmp);
            let least_s = losses[losses.len() / 2];
            self.lines.retain(|_, at| at.lost_s > least_s);
        }
    }

    /// Time lost in all, s, and the lines with the largest sums, the worst first; of two equal ones that of the earlier line.
    pub(crate) fn worst(&self, axes: &[MachineAxis]) -> (f64, Vec<Slowdown>) {
        let mut lines: Vec<_> = self.lines.values().collect();
        lines.sort_by(|a, b| b.lost_s.total_cmp(&a.lost_s));
        let slowdown = |at: &&AtLine| {
            let Lowest { speed, source, cause, cure, axis, .. } = at.worst;
            Slowdown {
                source,
                lost_s: at.lost_s,
                times: at.times,
                slowest_mm_per_min: 60.0 * speed,
                cause,
                cure,
                axis: axes.get(axis).map(|axis| axis.name.clone()).unwrap_or_default(),
            }
        };
        (self.total_s, lines.iter().take(LISTED).map(slowdown).collect())
    }
}

/// Local times between which the speed rises or falls only, and how much more of its share the jerk counts, as the plan divides it.
fn knots(profile: &StretchProfile) -> Vec<(f64, f64)> {
    let end = profile.duration();
    match profile {
        StretchProfile::Phases(part) => {
            let inside = cruise_times(part).into_iter().filter(|t_s| (0.0..end).contains(t_s));
            std::iter::once(0.0).chain(inside).chain([end]).map(|t_s| (t_s, JERK_OF_RUNS)).collect()
        }
        StretchProfile::Course(course) => {
            course.governed().map(|(_, start_s, _)| start_s).chain([end]).map(|t_s| (t_s, 1.0)).collect()
        }
    }
}

/// When the constant speed of a profile begins and ends.
fn cruise_times(part: &ProfilePart) -> Vec<f64> {
    let cruise = part.phases().nth(3);
    cruise.map_or_else(Vec::new, |(_, start_s, time_s)| vec![start_s, start_s + time_s])
}

/// Fastest that the axes go straight in the directions of an element, mm/s.
fn straight_velocity(element: &Element, axes: &[MachineAxis]) -> f64 {
    let tangent = element.largest_tangent();
    let fastest = |axis: &MachineAxis| axis.max_velocity_per_s / tangent[axis.axis.index()].abs();
    axes.iter().map(fastest).fold(f64::INFINITY, f64::min)
}

/// Whether nothing but X, Y and Z moves, or all of it by five-axis motion: only such corners are rounded.
fn moves_freely(element: &Element) -> bool {
    let mut others = Axis::ALL.into_iter().filter(|axis| !matches!(axis, Axis::X | Axis::Y | Axis::Z));
    matches!(element.curve, Curve::FiveAxis(_)) || others.all(|axis| !element.moves(axis))
}

/// What slows the path down at a place of an element that is passed at this speed.
fn lowest(
    course: &Course<'_>,
    axes: &[MachineAxis],
    (s, speed): (f64, f64),
    jerk_weight: f64,
    before: Option<&Before>,
) -> Lowest {
    let Course { motion, .. } = course;
    let element = &motion.element;
    let [first, bend, twist] = element.derivatives(s);
    // Of turning, and of the tangent alone.
    let (mut turning, mut ahead) = ((0.0, 0, LimitKind::Acceleration), (0.0, 0, LimitKind::Jerk));
    for (column, axis) in axes.iter().enumerate() {
        let index = axis.axis.index();
        let acceleration = (bend[index] * speed * speed).abs() / axis.max_acceleration_per_s2;
        let jerk = jerk_weight * (twist[index] * speed * speed * speed).abs() / axis.max_jerk_per_s3;
        let velocity = (first[index] * speed).abs() / axis.max_velocity_per_s;
        for (share, kind) in
            [(acceleration, LimitKind::Acceleration), (jerk, LimitKind::Jerk), (velocity, LimitKind::Velocity)]
        {
            if share > turning.0 {
                turning = (share, column, kind);
            }
        }
        let tangent = first[index].abs() / axis.max_jerk_per_s3;
        if tangent > ahead.0 {
            ahead = (tangent, column, LimitKind::Jerk);
        }
    }
    let at_start = s <= 0.0;
    let at_end = s >= element.length;
    let stops = speed <= AT_REST;
    let is_turning = turning.0 >= LEAST_TURNING;
    let turns_back = before.is_some_and(|before| {
        at_start && before.tangent.iter().zip(&first).map(|(a, b)| a * b).sum::<f64>() < TURNING_BACK
    });
    let is_free = moves_freely(element) && before.is_none_or(|before| !at_start || before.is_free);
    let exact_stop = at_start && before.is_some_and(|before| before.rests) || at_end && motion.rests_at_end();
    let (cause, cure) = match (motion.origin(), &element.curve) {
        _ if stops && exact_stop => (SlowdownCause::ExactStop, SlowdownCure::Tolerance),
        _ if stops => (SlowdownCause::Corner, SlowdownCure::Tolerance),
        (Origin::Corner { fills_blocks: true }, _) => (SlowdownCause::RoundedCorner, SlowdownCure::of(turning.2)),
        (Origin::Corner { fills_blocks: false }, _) => (SlowdownCause::RoundedCorner, SlowdownCure::Tolerance),
        (Origin::Blocks { like_chords: true }, _) => (SlowdownCause::ShortBlocks, SlowdownCure::Arc),
        (Origin::Blocks { like_chords: false }, _) => (SlowdownCause::ShortBlocks, SlowdownCure::Tolerance),
        (Origin::Block | Origin::BlockToStop, Curve::Line) => (SlowdownCause::Corner, SlowdownCure::Tolerance),
        (Origin::Block | Origin::BlockToStop, _) if is_turning => (SlowdownCause::Curve, SlowdownCure::of(turning.2)),
        (Origin::Block | Origin::BlockToStop, _) => (SlowdownCause::Corner, SlowdownCure::Tolerance),
    };
    let by_choice = at_start && before.is_some_and(|before| before.stops_by_choice)
        || at_end && motion.origin() == Origin::BlockToStop;
    // Neither has a tolerance that would help, or it has one already; a stop is over sooner with more jerk.
    let stays = cure == SlowdownCure::Tolerance && (turns_back || !is_free || by_choice);
    let cure = if stays { SlowdownCure::Jerk } else { cure };
    let axis = if is_turning && !stops { turning.1 } else { ahead.1 };
    Lowest { speed, source: element.source, cause, cure, axis, turning: turning.0 }
}

impl SlowdownCure {
    const fn of(kind: LimitKind) -> Self {
        match kind {
            LimitKind::Velocity => Self::Velocity,
            LimitKind::Acceleration => Self::Acceleration,
            LimitKind::Jerk => Self::Jerk,
        }
    }
}
