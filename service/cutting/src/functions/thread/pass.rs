//! From a programmed pass to what the interpolator runs: its path, how its speed changes, and what forbids it.

use core::f64::consts::TAU;

use feedwave_motion::{Curve, Element, Machine, PathLimits, Profile};
use feedwave_program::{Axis, Finding, FindingLog, Position, SourceSpan, ThreadMove};

use super::code;
use super::driven::{DrivenAxis, driven_axes};
use super::{LeadAxis, PathPart, PathVibration, RunUp, ThreadPath, ThreadRun, ThreadVibrationSettings};
use crate::shared::checks::{MAX_BLOCK_DURATION_S, Travel, too_long};
use crate::shared::plane_frame::PlaneFrame;

/// Share of the limits of the axis across the lead that changes of its speed take beside the vibration: on a taper, at a
/// pull-out, between parts. It is the same with and without vibration, since passes with different run-ups would not meet in one groove.
pub const TAPER_SHARE: f64 = 0.2;

/// A threading block that waits for the planner.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct ThreadBlock {
    pub(crate) mv: ThreadMove,
    /// Its way through a tilted plane.
    pub(crate) frame: Option<Box<PlaneFrame>>,
    pub(crate) span: SourceSpan,
}

impl ThreadBlock {
    /// The point where the tool is at its end.
    pub(crate) fn end(&self) -> Position {
        let mut end = self.mv.end;
        if let Some(pull_out) = self.mv.pull_out {
            end[X] += pull_out.retreat_mm;
        }
        end
    }

    /// Whether `next` goes on with the same thread: only the first block waits for the spindle.
    pub(crate) fn goes_on_in(&self, next: &ThreadMove) -> bool {
        self.is_left_at(next) && self.mv.spindle == next.spindle
    }

    /// Whether `next` begins where this block leaves the tool.
    pub(crate) fn is_left_at(&self, next: &ThreadMove) -> bool {
        self.mv.pull_out.is_none()
            && self.mv.end == next.start
            && self.mv.work_offset == next.work_offset
            && self.mv.plane == next.plane
    }

    /// Travel of X and Z.
    pub(crate) fn travel(&self) -> [f64; 2] {
        [self.mv.end[X] - self.mv.start[X], self.mv.end[Z] - self.mv.start[Z]]
    }

    /// Travel across a lead along this axis over the travel along it.
    pub(crate) fn taper(&self, lead_axis: LeadAxis) -> f64 {
        let [x, z] = self.travel();
        match lead_axis {
            LeadAxis::Z => x / z.abs(),
            LeadAxis::X => z / x.abs(),
        }
    }

    /// The axis that travels further: the lead is along it.
    pub(crate) fn lead_axis(&self) -> LeadAxis {
        let [x, z] = self.travel();
        if z.abs() > x.abs() { LeadAxis::Z } else { LeadAxis::X }
    }
}

/// Deviations at corners of a thread up to this are not named, mm.
const CORNER_TOLERANCE_MM: f64 = 0.01;

const X: usize = Axis::X.index();
const Z: usize = Axis::Z.index();

/// Tightest limits of the columns that carry out an axis.
pub(crate) fn axis_limits(machine: &Machine, axis: Axis) -> PathLimits {
    let columns = machine.axes.iter().filter(|column| column.axis == axis);
    let limits: Vec<_> = columns
        .map(|column| PathLimits {
            velocity: column.max_velocity_per_s,
            acceleration: column.max_acceleration_per_s2,
            jerk: column.max_jerk_per_s3,
        })
        .collect();
    PathLimits::tightest(limits.iter())
}

/// The path of one pass before it is timed.
pub(crate) struct PassPath {
    start: [f64; 2],
    parts: Vec<PathPart>,
    /// The block of each part.
    spans: Vec<SourceSpan>,
    changes_deg: Vec<f64>,
    rev_per_s: f64,
    /// Its way through a tilted plane.
    frame: Option<Box<PlaneFrame>>,
    axes: Vec<DrivenAxis>,
}

/// From a corner to the nearest place of the path, X on the radius and Z, mm, where slopes in mm per degree change over an angle around it:
/// with s from 0 to 1 along the change at L·(slope·(s − ½) + change·s³·(1 − s/2)), see [`super::ThreadPath`].
fn past_corner([slope, next]: [[f64; 3]; 2], length_deg: f64) -> [f64; 2] {
    let at = |s: f64| {
        [0, 1].map(|axis| {
            length_deg * (slope[axis] * (s - 0.5) + (next[axis] - slope[axis]) * s * s * s * (1.0 - 0.5 * s))
        })
    };
    let apart = |s: f64| libm::hypot(at(s)[0], at(s)[1]);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..40 {
        let thirds = [low + (high - low) / 3.0, high - (high - low) / 3.0];
        if apart(thirds[0]) < apart(thirds[1]) { high = thirds[1] } else { low = thirds[0] }
    }
    at(0.5 * (low + high))
}

impl PassPath {
    /// The path through blocks that are one thread; `None` with a finding where it is impossible.
    pub(crate) fn new(blocks: &[ThreadBlock], machine: &Machine, findings: &mut FindingLog) -> Option<Self> {
        let first = blocks.first()?;
        let spindle = &first.mv.spindle;
        let rev_per_s = spindle.rev_per_s(first.mv.start[X]).min(machine.max_spindle_rev_per_min / 60.0);
        if !(rev_per_s > 0.0 && rev_per_s.is_finite()) {
            let message = "a thread follows the spindle, which does not turn at a constant speed";
            let finding = Finding::new(code::THREAD_SPINDLE_STOPPED, first.span, message);
            findings.push(finding.suggest("start the spindle first, such as G97 M3 S500"));
            return None;
        }
        let start = [first.mv.start[X], first.mv.start[Z]];
        let mut parts: Vec<PathPart> = Vec::with_capacity(blocks.len() + 1);
        let mut spans = Vec::with_capacity(blocks.len() + 1);
        let mut from = start;
        for block in blocks {
            let (to, line) = ([block.mv.end[X], block.mv.end[Z]], block.span.line);
            match block.mv.pull_out.filter(|pull_out| pull_out.travel_mm > 0.0) {
                Some(pull_out) => {
                    let whole = PathPart::new(from, to, block.mv.lead_mm, line);
                    let share = pull_out.travel_mm / (to[1] - from[1]).abs();
                    // Not a number where it does not move along Z.
                    if share.is_nan() || share >= 1.0 {
                        let travel_mm = pull_out.travel_mm;
                        let message = format!("the tool is pulled out over {travel_mm} mm, all of the thread");
                        findings.push(
                            Finding::new(code::THREAD_PULL_OUT, block.span, message)
                                .with_value("pull_out", travel_mm, "mm")
                                .with_value("length", (to[1] - from[1]).abs(), "mm")
                                .suggest("pull the tool out over a shorter distance, or cut a longer thread"),
                        );
                        return None;
                    }
                    let leaving = [0, 1].map(|axis| to[axis] + (from[axis] - to[axis]) * share);
                    parts.push(PathPart { end: leaving, angle_deg: whole.angle_deg * (1.0 - share), line });
                    let end = [block.end()[X], to[1]];
                    parts.push(PathPart { end, angle_deg: whole.angle_deg * share, line });
                }
                None => parts.push(PathPart::new(from, [block.end()[X], to[1]], block.mv.lead_mm, line)),
            }
            spans.resize(parts.len(), block.span);
            from = to;
        }
        let frame = first.frame.as_ref().zip(blocks.last().and_then(|last| last.frame.as_ref()));
        let frame = frame.map(|(first, last)| Box::new(first.to_end_of(last)));
        let axes = driven_axes(frame.as_deref(), machine);
        let mut path = Self { start, parts, spans, changes_deg: Vec::new(), rev_per_s, frame, axes };
        if path.parts.iter().any(|part| !(part.angle_deg > 0.0 && part.angle_deg <= 1e9)) {
            let message = "the thread has no travel, or no lead";
            let finding = Finding::new(code::THREAD_TRAVEL, first.span, message);
            findings.push(finding.suggest("check the end point, the position before it and the lead"));
            return None;
        }
        path.changes_deg = path.changes(first.lead_axis());
        Some(path)
    }

    pub(crate) fn rev_per_s(&self) -> f64 {
        self.rev_per_s
    }

    /// How the lead axis starts.
    pub(crate) fn run_up(&self) -> RunUp {
        RunUp { angle_deg: self.changes_deg.first().copied().unwrap_or(0.0) }
    }

    /// Speeds of X, Z and the path in every part, mm/s.
    fn speeds(&self) -> impl Iterator<Item = [f64; 3]> {
        let starts = core::iter::once(self.start).chain(self.parts.iter().map(|part| part.end));
        let deg_per_s = 360.0 * self.rev_per_s;
        starts.zip(&self.parts).map(move |(start, part)| part.slope(start).map(|slope| slope * deg_per_s))
    }

    /// Whether the axis across the lead moves anywhere, as on tapers and where the tool is pulled out.
    pub(crate) fn moves_across(&self, lead_axis: LeadAxis) -> bool {
        self.speeds().any(|[x, z, _]| match lead_axis {
            LeadAxis::Z => x != 0.0,
            LeadAxis::X => z != 0.0,
        })
    }

    /// Angles over which the speed changes at every vertex, the least within the limits of all axes. The lead axis is that of the
    /// first part in all of them: the tool may vibrate across it.
    fn changes(&self, lead_axis: LeadAxis) -> Vec<f64> {
        let rest = [[0.0; 3]];
        let before: Vec<_> = rest.into_iter().chain(self.speeds()).collect();
        let after = self.speeds().chain(rest);
        let angle_deg = |axis: &DrivenAxis, change: [f64; 2]| {
            let lead_mm = axis.part(change).abs() / self.rev_per_s;
            let (share, limits) = (axis.change_share(lead_axis), axis.limits);
            RunUp::within(lead_mm, self.rev_per_s, share * limits.acceleration, share * limits.jerk).angle_deg
        };
        let changes = before.iter().zip(after).map(|(from, to)| {
            let change = [to[0] - from[0], to[1] - from[1]];
            self.axes.iter().map(|axis| angle_deg(axis, change)).fold(0.0, f64::max)
        });
        changes.collect()
    }

    /// Whether every part is long enough for the changes of speed at its ends; with `judged` the thread's own report
    /// says so of a pass of one part. `number` is that of the pass in its thread.
    pub(crate) fn check_length(
        &self,
        judged: bool,
        number: Option<u64>,
        span: SourceSpan,
        findings: &mut FindingLog,
    ) -> bool {
        let is_reported = judged && self.parts.len() == 1;
        for ((part, ends), speed) in self.parts.iter().zip(self.changes_deg.windows(2)).zip(self.speeds()) {
            let needed_deg = 0.5 * (ends[0] + ends[1]);
            if part.angle_deg >= needed_deg {
                continue;
            }
            if is_reported {
                return false;
            }
            let mm_per_deg = speed[2] / (360.0 * self.rev_per_s);
            let message = format!(
                "the thread in line {} is {:.3} mm long, but takes {:.3} mm to change its speed at both ends",
                part.line,
                part.angle_deg * mm_per_deg,
                needed_deg * mm_per_deg
            );
            let finding = Finding::new(code::THREAD_LENGTH_SHORT, span, message)
                .ranked("", (needed_deg - part.angle_deg) * mm_per_deg);
            let finding = if let Some(number) = number { finding.at("pass", number) } else { finding };
            findings.push(
                finding
                    .with_value("length", part.angle_deg * mm_per_deg, "mm")
                    .with_value("needed", needed_deg * mm_per_deg, "mm")
                    .with_value("line", f64::from(part.line), "")
                    .suggest("turn slower")
                    .suggest("start further before the work, or end further behind it"),
            );
            return false;
        }
        true
    }

    /// Names corners between the blocks of a thread that the tool passes at a distance, as it changes its direction without a stop.
    pub(crate) fn check_corners(&self, findings: &mut FindingLog) {
        let starts = core::iter::once(self.start).chain(self.parts.iter().map(|part| part.end));
        let slopes: Vec<_> = starts.zip(&self.parts).map(|(start, part)| part.slope(start)).collect();
        for (index, pair) in slopes.windows(2).enumerate() {
            let (span, corner) = (self.spans[index + 1], self.parts[index].end);
            // Where it is pulled out it leaves the thread.
            if span == self.spans[index] {
                continue;
            }
            let off = past_corner([pair[0], pair[1]], self.changes_deg[index + 1]);
            let off_mm = libm::hypot(off[0], off[1]);
            if off_mm <= CORNER_TOLERANCE_MM {
                continue;
            }
            // The angle of the change grows with the 1.5th power of the speed at least.
            let slower = libm::cbrt((CORNER_TOLERANCE_MM / off_mm) * (CORNER_TOLERANCE_MM / off_mm));
            let speed = (60.0 * self.rev_per_s * slower).floor();
            let message = format!(
                "the tool passes the corner at X{:.3} (on the radius) Z{:.3} by {off_mm:.3} mm, {:+.3} mm in X on the radius and {:+.3} mm \
                 in Z: it changes its direction over {:.1} degrees of the spindle without a stop",
                corner[0],
                corner[1],
                off[0],
                off[1],
                self.changes_deg[index + 1]
            );
            let finding = Finding::new(code::THREAD_CORNER, span, message)
                .ranked("", off_mm)
                .with_value("deviation", off_mm, "mm")
                .with_value("deviation_x", off[0], "mm")
                .with_value("deviation_z", off[1], "mm")
                .with_value("limit", CORNER_TOLERANCE_MM, "mm")
                .related_to("the block before the corner", self.spans[index])
                .suggest("begin and end the thread on one line, outside of the work");
            findings.push(if speed >= 1.0 {
                let cure = format!("turn at {speed} rev/min at most");
                finding.suggest_value(cure, None, "spindle_speed", speed, "rev/min")
            } else {
                finding
            });
        }
    }

    /// Speeds of the axes against their limits, with the vibration across the lead; `judged` says that the thread's own report
    /// compares those of the first part.
    pub(crate) fn check_speeds(
        &self,
        (lead_axis, vibration_mm_per_s): (LeadAxis, f64),
        judged: bool,
        span: SourceSpan,
        findings: &mut FindingLog,
    ) {
        for driven in &self.axes {
            let [across, _] = driven.across_and_along(lead_axis);
            let superposed = across * vibration_mm_per_s;
            let (axis, limit) = (driven.axis, driven.limits.velocity);
            let speeds = self.speeds().skip(usize::from(judged));
            let fastest = speeds.map(|[x, z, _]| driven.part([x, z]).abs()).fold(0.0, f64::max);
            if fastest > 0.0 && fastest + superposed > limit * (1.0 + 1e-9) {
                let demanded = fastest + superposed;
                let speed = (60.0 * self.rev_per_s * limit / demanded).floor();
                let message = format!(
                    "the thread moves {} with {demanded:.1} mm/s, whose limit is {limit:.1} mm/s",
                    axis.letter()
                );
                findings.push(
                    Finding::new(code::THREAD_AXIS_SPEED, span, message)
                        .ranked(axis.letter().to_string(), demanded / limit)
                        .with_value("velocity", demanded, "mm/s")
                        .with_value("limit", limit, "mm/s")
                        .suggest_value(
                            format!("turn at {speed} rev/min at most"),
                            None,
                            "spindle_speed",
                            speed,
                            "rev/min",
                        ),
                );
            }
        }
    }

    /// What the interpolator runs. With `prepares` the axis across the lead moves to the vibration position by itself.
    pub(crate) fn run(
        &self,
        blocks: &[ThreadBlock],
        vibration: PathVibration,
        settings: &ThreadVibrationSettings,
        prepares: bool,
        travel: Travel<'_>,
        findings: &mut FindingLog,
    ) -> Option<ThreadRun> {
        let (first, last) = (blocks.first()?, blocks.last()?);
        let path = ThreadPath::new(self.start, &self.parts, first.mv.start_angle_deg, &self.changes_deg, vibration);
        let duration_s = (path.rest_deg() + 360.0) / (360.0 * self.rev_per_s);
        if !(0.0..=MAX_BLOCK_DURATION_S).contains(&duration_s) {
            findings.push(too_long(first.span, duration_s));
            return None;
        }
        // In a tilted plane positions are those of the machine.
        let (end, work_offset) = match &self.frame {
            None => (last.end(), first.mv.work_offset),
            Some(frame) => (frame.end().position, Position::default()),
        };
        let across = vibration.lead_axis.across();
        let retreat_mm = vibration.outwards * vibration.wave.amplitude_mm;
        travel.check(&self.extent(first, (across, retreat_mm)), findings);
        let prepared_mm = path.retreat_mm(-1.0);
        let limits: Vec<_> = self.axes.iter().filter_map(|axis| axis.limits_across(vibration.lead_axis)).collect();
        let preparation = (prepares && prepared_mm > 0.0)
            .then(|| Profile::solve(prepared_mm, 0.0, 0.0, PathLimits::tightest(limits.iter())))
            .flatten();
        Some(ThreadRun {
            path,
            end,
            work_offset,
            frame: self.frame.clone(),
            preparation,
            across,
            outwards: vibration.outwards,
            reference_rev: settings.reference_angle_deg / 360.0,
            rev_per_s: self.rev_per_s,
            line: first.span.line,
        })
    }

    /// From the lowest to the highest position of every axis on the path with this retreat: a line for the checks of lines.
    fn extent(&self, first: &ThreadBlock, retreat: (Axis, f64)) -> Element {
        let places = core::iter::once(self.start).chain(self.parts.iter().map(|part| part.end));
        let (start, end) = match &self.frame {
            None => Self::extent_of_x_and_z(&first.mv.start, places, retreat),
            Some(frame) => extent_in_plane(frame, places, retreat),
        };
        Element {
            start,
            end,
            work_offset: if self.frame.is_some() { Position::default() } else { first.mv.work_offset },
            curve: Curve::Line,
            length: libm::hypot(end[X] - start[X], end[Z] - start[Z]),
            source: first.span,
            rapid: false,
        }
    }

    fn extent_of_x_and_z(
        from: &Position,
        places: impl Iterator<Item = [f64; 2]>,
        (across, retreat_mm): (Axis, f64),
    ) -> (Position, Position) {
        let (mut start, mut end) = (*from, *from);
        for [x, z] in places {
            for (axis, mm) in [(Axis::X, x), (Axis::Z, z)] {
                let retreat_mm = if axis == across { retreat_mm } else { 0.0 };
                let (least, most) = (&mut start[axis.index()], &mut end[axis.index()]);
                *least = least.min(mm).min(mm + retreat_mm);
                *most = most.max(mm).max(mm + retreat_mm);
            }
        }
        (start, end)
    }

    /// Whether the machine has the axes.
    pub(crate) fn missing_axis(&self, first: &ThreadBlock, machine: &Machine) -> Option<Axis> {
        feedwave_motion::missing_axis(&self.extent(first, (Axis::X, 1.0)), machine)
    }
}

/// The lowest and the highest position of every axis at places of a tilted plane and at those with the retreat.
fn extent_in_plane(
    frame: &PlaneFrame,
    places: impl Iterator<Item = [f64; 2]>,
    (across, retreat_mm): (Axis, f64),
) -> (Position, Position) {
    let mut extent = (frame.end().position, frame.end().position);
    for [x, z] in places {
        let retreated = if across == Axis::X { [x + retreat_mm, z] } else { [x, z + retreat_mm] };
        for place in [[x, z], retreated] {
            let position = frame.position(place);
            for (k, mm) in position.into_iter().enumerate() {
                extent.0[k] = extent.0[k].min(mm);
                extent.1[k] = extent.1[k].max(mm);
            }
        }
    }
    extent
}

/// Peak velocity of a vibration, mm/s.
pub(crate) fn peak_velocity(vibration: &PathVibration, rev_per_s: f64) -> f64 {
    0.5 * vibration.wave.amplitude_mm * TAU * vibration.wave.vibrations_per_rev * rev_per_s
}
