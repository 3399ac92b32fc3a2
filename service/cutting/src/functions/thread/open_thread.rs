//! A thread of the program while its passes come in: which passes belong to it, and its judgement at the end.

use feedwave_motion::PathLimits;
use feedwave_program::{Finding, FindingLog, Position, SpindleDirection, ThreadMove, TiltedPlane};
use serde::{Deserialize, Serialize};

use super::code;
use super::driven::driven_axes;
use super::pass::{PassPath, ThreadBlock, axis_limits};
use super::state::{Mode, ThreadInputs};
use super::{
    GrooveProfile, LeadAxis, MAX_THREAD_PASSES, PathVibration, SpindleRotation, ThreadDrives, ThreadGeometry,
    ThreadJob, ThreadLimits, ThreadPass, ThreadSectionReport, ThreadSide, report,
};
use crate::shared::plane_frame::PlaneFrame;

/// Lengths, leads and tapers that differ by less are the same.
const SAME: f64 = 1e-6;
/// Leads by which start and end of passes of one thread may be apart: a start position takes up to one, an infeed along
/// the flank less than half of one.
const LEADS_APART: f64 = 1.5;
/// Depth of a single pass where nothing states the work's diameter, in leads.
const ASSUMED_DEPTH: f64 = 0.1;

/// A thread whose passes come in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct OpenThread {
    mode: Option<Mode>,
    pub(super) job: ThreadJob,
    tool: u32,
    /// That of its first pass, whose coordinates the thread is in.
    work_offset: Position,
    /// The tilted plane that it is in, and how the axes move there.
    plane: Option<TiltedPlane>,
    frame: Option<Box<PlaneFrame>>,
    /// Whether the axis across the lead moves in any pass, beside what it vibrates.
    pub(super) moves_across: bool,
    pub(super) last_line: u32,
}

impl OpenThread {
    pub(super) fn new(
        first: &ThreadBlock,
        path: &PassPath,
        mode: Option<Mode>,
        still: PathVibration,
        angle_deg: f64,
    ) -> Self {
        let mv = &first.mv;
        let lead_axis = first.lead_axis();
        let [along, across] = [lead_axis.along().index(), lead_axis.across().index()];
        let outside = mode.is_none_or(|mode| mv.start[across] <= mode.work_mm(mv));
        let geometry = ThreadGeometry {
            lead_axis,
            side: if outside { ThreadSide::External } else { ThreadSide::Internal },
            // Without a word for it the first pass is the measure until all are known.
            work_mm: mode.map_or(mv.start[across], |mode| mode.work_mm(mv)),
            start_mm: mv.start[along],
            end_mm: mv.end[along],
            taper: first.taper(lead_axis),
            lead_mm: mv.lead_mm,
            starts: 1,
            rotation: match mv.spindle.direction {
                SpindleDirection::CounterClockwise => SpindleRotation::Reverse,
                SpindleDirection::Clockwise | SpindleDirection::Stopped => SpindleRotation::Forward,
            },
        };
        let job = ThreadJob {
            geometry,
            profile: GrooveProfile::pointed(angle_deg),
            vibrations_per_rev: still.wave.vibrations_per_rev,
            start_up: still.start_up,
            run_up: path.run_up(),
            spindle_rev_per_min: 60.0 * path.rev_per_s(),
            passes: Vec::new(),
        };
        let work_offset = mv.work_offset;
        let plane = mv.plane.as_ref().map(|it| it.plane);
        let (tool, last_line) = (mv.tool, first.span.line);
        Self { mode, job, tool, work_offset, plane, frame: first.frame.clone(), moves_across: false, last_line }
    }

    /// Whether a pass is one of this thread by everything but its speed and depth.
    fn fits(&self, first: &ThreadBlock, mode: Option<Mode>) -> bool {
        let (mv, geometry) = (&first.mv, &self.job.geometry);
        let lead_axis = geometry.lead_axis;
        let along = lead_axis.along().index();
        let travel_mm = mv.end[along] - mv.start[along];
        // Where the tool is says whether it is the same thread, not which offsets led it there.
        let [start_mm, end_mm] = [&mv.start, &mv.end].map(|point| self.coordinate(mv, point, along));
        let apart_mm = LEADS_APART * geometry.lead_mm;
        self.mode == mode
            && first.lead_axis() == lead_axis
            && self.tool == mv.tool
            && self.is_in_plane_of(first)
            && (mv.lead_mm - geometry.lead_mm).abs() <= SAME
            && (first.taper(lead_axis) - geometry.taper).abs() <= SAME
            && travel_mm.signum() == geometry.direction()
            && (start_mm - geometry.start_mm).abs() <= apart_mm
            && (end_mm - geometry.end_mm).abs() <= apart_mm
            && (mv.spindle.direction == SpindleDirection::CounterClockwise)
                == (geometry.rotation == SpindleRotation::Reverse)
    }

    /// A point of a pass in the coordinates of this thread.
    fn coordinate(&self, mv: &ThreadMove, point: &Position, axis: usize) -> f64 {
        // In a tilted plane the coordinates are the plane's, which stay the same.
        let shift_mm = if mv.plane.is_some() { 0.0 } else { mv.work_offset[axis] - self.work_offset[axis] };
        point[axis] + shift_mm
    }

    /// Whether a pass is in the plane of this thread, with the axes in the same proportions; those of a pass that is only looked at
    /// are not known.
    fn is_in_plane_of(&self, first: &ThreadBlock) -> bool {
        let is_parallel = match (&self.frame, &first.frame) {
            (Some(own), Some(other)) => own.is_parallel_to(other),
            _ => true,
        };
        let is_at_plane = first.mv.plane.is_none() || self.work_offset == first.mv.work_offset;
        self.plane == first.mv.plane.as_ref().map(|it| it.plane) && is_parallel && is_at_plane
    }

    /// Whether a pass is one of this thread, whatever its speed.
    pub(super) fn is_same_thread(&self, first: &ThreadBlock, mode: Option<Mode>) -> bool {
        // Without vibration nothing says where a thread begins: a return to a smaller depth does.
        let goes_back = mode.is_none() && self.goes_back(first);
        self.fits(first, mode) && !goes_back && (mode.is_some() || self.job.passes.len() < MAX_THREAD_PASSES)
    }

    /// Whether a pass belongs to this thread.
    pub(super) fn takes(
        &self,
        first: &ThreadBlock,
        path: &PassPath,
        mode: Option<Mode>,
        findings: &mut FindingLog,
    ) -> bool {
        let rev_per_min = 60.0 * path.rev_per_s();
        if rev_per_min != self.job.spindle_rev_per_min && self.fits(first, mode) {
            let message = format!(
                "the spindle turns at {rev_per_min} rev/min, at {} rev/min in the pass before: the lead axis comes into \
                 step at another place, beside the groove",
                self.job.spindle_rev_per_min
            );
            findings.push(
                Finding::new(code::THREAD_SPEED_CHANGED, first.span, message)
                    .ranked("", (rev_per_min / self.job.spindle_rev_per_min - 1.0).abs())
                    .with_value("spindle_speed", rev_per_min, "rev/min")
                    .with_value("before", self.job.spindle_rev_per_min, "rev/min")
                    .suggest("cut all passes of a thread at one spindle speed"),
            );
            return false;
        }
        self.is_same_thread(first, mode)
    }

    /// Depth of the tool, mm across the lead, and travel of its start position.
    fn depth(&self, first: &ThreadBlock) -> (f64, f64) {
        let geometry = &self.job.geometry;
        let [along, across] = [geometry.lead_axis.along().index(), geometry.lead_axis.across().index()];
        let [along_mm, across_mm] = [along, across].map(|axis| self.coordinate(&first.mv, &first.mv.start, axis));
        let travel_mm = geometry.direction() * (along_mm - geometry.start_mm);
        let surface_mm = geometry.work_mm + geometry.taper * travel_mm;
        (geometry.inwards() * (surface_mm - across_mm), travel_mm)
    }

    fn goes_back(&self, first: &ThreadBlock) -> bool {
        let depths = self.job.passes.iter().map(|pass| pass.depth_mm);
        // Inside the depths are negative until the side is known.
        let deepest = depths.fold(0.0, |deepest: f64, depth| if depth.abs() > deepest.abs() { depth } else { deepest });
        deepest.abs() > SAME && (self.depth(first).0 / deepest) <= SAME
    }

    /// Adds a pass without vibration; its index.
    pub(super) fn add(&mut self, first: &ThreadBlock) -> usize {
        let (depth_mm, start_travel_mm) = self.depth(first);
        let mut pass = ThreadPass {
            start: first.mv.thread_start,
            depth_mm,
            start_travel_mm,
            start_angle_deg: first.mv.start_angle_deg,
            amplitude_mm: 0.0,
            amplitude_word: first.mv.amplitude_word,
            phase_shift_deg: 0.0,
            span: first.span,
        };
        let index = self.job.passes.len();
        if pass.start == 0 {
            pass.start = self.groove(&pass);
        }
        let geometry = &mut self.job.geometry;
        geometry.starts = geometry.starts.max(pass.start.saturating_add(1));
        self.job.passes.push(pass);
        index
    }

    /// Which start a pass without a word for it cuts: that of the groove it meets, unless it goes back to a smaller depth at another
    /// place, as the first pass of a further start does. Where it meets none, it is of the nearest start that it goes deeper than, as
    /// alternating flanks do before they meet, whatever starts were cut between; where there is no such, it is a new one.
    fn groove(&self, pass: &ThreadPass) -> u32 {
        let job = &self.job;
        let lead_mm = job.geometry.lead_mm;
        let origin_mm = |pass: &ThreadPass| pass.start_travel_mm - lead_mm * pass.start_angle_deg / 360.0;
        let apart_mm = |other: &ThreadPass| {
            let offset_mm = origin_mm(pass) - origin_mm(other);
            (offset_mm - lead_mm * (offset_mm / lead_mm).round()).abs()
        };
        let newest_mm = |start: u32| {
            let of_start = job.passes.iter().rev().find(|other| other.start == start);
            of_start.map_or(0.0, |newest| newest.depth_mm.abs())
        };
        let goes_deeper = |other: &&ThreadPass| pass.depth_mm.abs() > newest_mm(other.start) + SAME;
        let meets = |other: &&ThreadPass| {
            let reach_mm = (pass.depth_mm.abs() + other.depth_mm.abs()) * job.profile.tan_half_angle();
            let goes_on = pass.depth_mm.abs() >= newest_mm(other.start) - SAME;
            (apart_mm(other) < reach_mm - SAME && goes_on) || apart_mm(other) < SAME
        };
        let by_place = |a: &&ThreadPass, b: &&ThreadPass| apart_mm(a).total_cmp(&apart_mm(b));
        let met = job.passes.iter().filter(meets).min_by(by_place);
        match met.or_else(|| job.passes.iter().filter(goes_deeper).min_by(by_place)) {
            Some(nearest) => nearest.start,
            None if job.passes.is_empty() => 0,
            None => job.geometry.starts,
        }
    }

    pub(super) fn judge(self, inputs: &ThreadInputs<'_>) -> ThreadSectionReport {
        let Self { mode, mut job, moves_across, last_line, frame, .. } = self;
        if mode.is_none() {
            assume_work(&mut job);
        }
        let first_line = job.passes.first().map_or(last_line, |pass| pass.span.line);
        let settings = inputs.settings;
        let lead_axis = job.geometry.lead_axis;
        let axes = driven_axes(frame.as_deref(), inputs.machine);
        // On a taper and where it is pulled out the axis across has to accelerate with the lead axis, too.
        let across = axes.iter().filter_map(|axis| {
            let PathLimits { velocity, acceleration, jerk } = axis.limits_across(lead_axis)?;
            let share = axis.vibration_share(lead_axis, moves_across);
            Some(PathLimits { velocity, acceleration: share * acceleration, jerk: share * jerk })
        });
        let across: Vec<_> = across.collect();
        let mut across = PathLimits::tightest(across.iter());
        let mut along = axis_limits(inputs.machine, lead_axis.along());
        if frame.is_some() {
            // Velocities are judged by axis, where the pass is planned, and so is the run-up.
            (across.velocity, along) = (f64::INFINITY, PathLimits::NONE);
        }
        let limits = ThreadLimits {
            lead_velocity_mm_per_s: along.velocity,
            lead_acceleration_mm_per_s2: along.acceleration,
            lead_jerk_mm_per_s3: along.jerk,
            vibration_velocity_mm_per_s: across.velocity,
            vibration_acceleration_mm_per_s2: across.acceleration,
            vibration_jerk_mm_per_s3: across.jerk,
            approach_mm: settings.approach_mm.unwrap_or(f64::INFINITY),
            max_spindle_rev_per_min: inputs.machine.max_spindle_rev_per_min,
            period_s: inputs.period_s,
            thickness_mm: settings.max_thickness_mm.unwrap_or(f64::INFINITY),
            finishing_thickness_mm: settings.max_finishing_thickness_mm,
            drives: drives(frame.as_deref(), lead_axis, inputs),
        };
        let report = report::judge(&job, &limits, mode.is_none());
        ThreadSectionReport {
            on_line: mode.map(|mode| mode.on_span.line),
            first_line,
            last_line,
            ratio: mode.map(|mode| mode.ratio),
            work_diameter_assumed: mode.is_none(),
            job,
            report,
        }
    }
}

/// The drives of a thread. In a tilted plane several axes share its X and Z: where their drives differ, what arrives is no vibration
/// along one line, and nothing is predicted.
fn drives(frame: Option<&PlaneFrame>, lead_axis: LeadAxis, inputs: &ThreadInputs<'_>) -> ThreadDrives {
    let Some(frame) = frame else {
        return ThreadDrives {
            vibrating: inputs.following.of(lead_axis.across()),
            lead: inputs.following.of(lead_axis.along()),
        };
    };
    let moved = frame.axes().iter().filter(|(_, shares)| *shares != [0.0; 2]).map(|(axis, _)| *axis);
    inputs
        .following
        .shared_by(moved)
        .map_or_else(ThreadDrives::default, |drive| ThreadDrives { vibrating: drive, lead: drive })
}

/// Side and work diameter of a thread whose passes are all that is known: the first infeed is taken to be the largest of
/// the later ones. A thread on the other side of the axis is the mirror image of one on this side. Where the tool is on the axis, as a
/// tap in the spindle of a mill may be, X says nothing of the work: its radius is taken to be a lead larger than the deepest pass.
fn assume_work(job: &mut ThreadJob) {
    let is_around_axis = job.geometry.lead_axis == LeadAxis::Z;
    if is_around_axis && job.geometry.work_mm < 0.0 {
        (job.geometry.work_mm, job.geometry.taper) = (-job.geometry.work_mm, -job.geometry.taper);
        turn_over(&mut job.passes);
    }
    if job.passes.last().is_some_and(|last| last.depth_mm < 0.0) {
        job.geometry.side = ThreadSide::Internal;
        turn_over(&mut job.passes);
    }
    let later_mm = (1..job.passes.len()).map(|index| job.infeed_mm(index)).fold(0.0, f64::max);
    let first_mm = if later_mm > SAME { later_mm } else { ASSUMED_DEPTH * job.geometry.lead_mm };
    for pass in &mut job.passes {
        pass.depth_mm += first_mm;
    }
    job.geometry.work_mm += job.geometry.inwards() * first_mm;
    let deepest_mm = job.passes.iter().map(|pass| pass.depth_mm).fold(0.0, f64::max);
    if is_around_axis && job.geometry.work_mm <= deepest_mm {
        job.geometry.work_mm = deepest_mm + job.geometry.lead_mm;
    }
}

/// Counts depths in the other direction.
fn turn_over(passes: &mut [ThreadPass]) {
    for pass in passes {
        pass.depth_mm = -pass.depth_mm;
    }
}
