//! What validation says about a whole program.

use std::sync::Arc;

use feedwave_program::{Finding, InitialOffsets, SourceSpan};
use serde::{Deserialize, Serialize};

use crate::frame::config::PipelineConfig;
use crate::frame::profile::PlanQuality;
use crate::functions::path_vibration::SectionReport;
use crate::functions::thinning::ProgramThinning;
use crate::functions::thread::ThreadSectionReport;
use crate::functions::tool_oscillation::{OscillationDirection, OscillationSectionReport, ToolOscillation};
use crate::shared::tool::ToolGeometry;

/// Findings, one report per vibrating section and per thread, and the summary of the plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ValidationReport {
    /// Everything found, in the order of the source; the first ones in full where there are very many.
    pub findings: Vec<Finding>,
    /// Names of the job's further program files, in the order of their places, for the places of findings.
    pub programs: Arc<[String]>,
    /// One report per vibrating section, in order; the first ones where there are very many.
    pub sections: Vec<SectionReport>,
    /// One report per thread, in order; the first ones where there are very many.
    pub threads: Vec<ThreadSectionReport>,
    /// One report per oscillation, tool, feed and spindle speed, in order; the first ones where there are very many.
    pub oscillations: Vec<OscillationSectionReport>,
    /// What thinning did, where it was switched on.
    pub thinning: Option<ProgramThinning>,
    /// Counts, times and peaks of the whole program.
    pub summary: ProgramSummary,
    /// The offsets that the program found set.
    pub offsets: InitialOffsets,
}

impl ValidationReport {
    /// Whether nothing forbids running the program.
    #[must_use]
    pub const fn is_accepted(&self) -> bool {
        self.summary.errors == 0
    }
}

/// Figures of a whole program.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProgramSummary {
    /// Errors found (counted even where not listed).
    pub errors: u64,
    /// Warnings found.
    pub warnings: u64,
    /// Informations found.
    pub infos: u64,
    /// Findings counted but not listed.
    pub findings_not_listed: u64,
    /// Vibrating sections, listed or not.
    pub section_count: u64,
    /// Threads, listed or not.
    pub thread_count: u64,
    /// Threading passes.
    pub thread_passes: u64,
    /// Reports on oscillations, listed or not.
    pub oscillation_count: u64,
    /// Cutting time with an oscillating tool at the programmed feed, s: added to that before the part it is that before the
    /// next one ([`crate::functions::tool_oscillation::OscillationRequest`]).
    pub oscillating_cutting_time_s: f64,
    /// Bytes of the program.
    pub bytes: u64,
    /// Lines read.
    pub lines: u64,
    /// Moves: rapid and cutting.
    pub moves: u64,
    /// Cutting moves.
    pub cutting_moves: u64,
    /// Interpolation period, µs.
    pub interpolation_period_us: u32,
    /// How the speed along the path was planned.
    pub plan_quality: PlanQuality,
    /// Setpoints at that period; 0 when the program has errors.
    pub setpoint_count: u64,
    /// Machining time, s.
    pub duration_s: f64,
    /// Time in cutting moves, s.
    pub cutting_time_s: f64,
    /// Time in rapid moves, s.
    pub rapid_time_s: f64,
    /// Time at rest: dwells and waits for the vibration, s.
    pub rest_time_s: f64,
    /// Which limit governs for how long; together [`ProgramSummary::duration_s`].
    pub limit_times: LimitTimes,
    /// The time at a limit of the axes, by axis column.
    pub axis_limit_times: Vec<AxisLimitTimes>,
    /// Where the path that is run is farthest from the programmed one; `None` where it is that.
    pub path_deviation: Option<PathDeviation>,
    /// Time lost to slowdowns in cuts, s: what they take longer than at the commanded feed, without starts, ends and rests that
    /// the program asks for.
    pub slowdown_time_s: f64,
    /// The lines where most of it is lost, at most ten, the worst first.
    pub slowdowns: Vec<Slowdown>,
    /// Path length, mm.
    pub path_length_mm: f64,
    /// Path length of cutting moves, mm.
    pub cutting_length_mm: f64,
    /// Tool numbers used, ascending; the first ones used where there are very many.
    pub tools: Vec<u32>,
    /// Extents and peaks per machine axis.
    pub axes: Vec<AxisSummary>,
    /// Smallest and largest spindle speed while cutting, rev/min.
    pub spindle_rev_per_min: Option<[f64; 2]>,
}

/// Which limit governs the motion for how long, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LimitTimes {
    /// At the programmed feed, with the override.
    pub feed_s: f64,
    /// At the largest velocity of an axis, on straight lines.
    pub axis_velocity_s: f64,
    /// At the speed that the axes' limits leave on a curve: arc, spline or rounded corner.
    pub curvature_s: f64,
    /// At a constant speed below all of that, for the sake of corners and neighbouring blocks.
    pub corners_s: f64,
    /// Gaining or losing speed at the largest acceleration.
    pub acceleration_s: f64,
    /// Building up or ending an acceleration at the largest jerk.
    pub jerk_s: f64,
    /// At rest.
    pub rest_s: f64,
}

/// For how long the limits of one machine axis govern the motion, s: the axis that takes the largest share of the limit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxisLimitTimes {
    /// Column name.
    pub axis: String,
    /// Its velocity.
    pub velocity_s: f64,
    /// Its acceleration: of the feed, or in curves at a constant speed.
    pub acceleration_s: f64,
    /// Its jerk, likewise.
    pub jerk_s: f64,
}

impl AxisLimitTimes {
    pub(crate) const fn of(&mut self, kind: LimitKind) -> &mut f64 {
        match kind {
            LimitKind::Velocity => &mut self.velocity_s,
            LimitKind::Acceleration => &mut self.acceleration_s,
            LimitKind::Jerk => &mut self.jerk_s,
        }
    }
}

/// A limit of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LimitKind {
    Velocity,
    Acceleration,
    Jerk,
}

/// Where the path that is run is farthest from the programmed one.
#[derive(Clone, Debug, PartialEq)]
pub struct PathDeviation {
    /// Distance of places that belong to each other, mm, at the places that were examined (ends and middles of all spans); within
    /// the tolerance `P`. Of the tool centre point in five axes; what thinning leaves out is not in it. Where blocks were merged into a line before a
    /// corner was rounded, the sum of both.
    pub largest_mm: f64,
    /// Block that is run there; of a corner the one behind it.
    pub source: SourceSpan,
    /// Machine position there on the path that is run, by axis column, mm or degrees.
    pub axes: Vec<(String, f64)>,
}

/// Time lost at one line.
#[derive(Clone, Debug, PartialEq)]
pub struct Slowdown {
    /// Block at which the path is slowest; behind a corner.
    pub source: SourceSpan,
    /// Time lost, s; of all times that the line is run.
    pub lost_s: f64,
    /// How often the path slows down there.
    pub times: u64,
    /// Speed at its worst slowdown, mm/min.
    pub slowest_mm_per_min: f64,
    /// Why it is slow there.
    pub cause: SlowdownCause,
    /// What would save most of the time.
    pub cure: SlowdownCure,
    /// Axis column whose limit holds it back.
    pub axis: String,
}

/// Why a path slows down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlowdownCause {
    /// An exact stop is programmed.
    ExactStop,
    /// A corner, or a step of curvature, that is passed exactly.
    Corner,
    /// A corner that is rounded within the tolerance.
    RoundedCorner,
    /// Many short blocks, which are run as one curve within the tolerance.
    ShortBlocks,
    /// A programmed arc or spline.
    Curve,
}

/// What would save time where a path slows down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlowdownCure {
    /// A tolerance, or a larger one: `G64 P`.
    Tolerance,
    /// An arc instead of its chords.
    Arc,
    /// More velocity of the axis.
    Velocity,
    /// More acceleration of the axis.
    Acceleration,
    /// More jerk of the axis.
    Jerk,
}

/// One machine axis over the whole program, from the setpoints themselves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxisSummary {
    /// Name of the axis column.
    pub axis: String,
    /// Whether its figures are in degrees rather than millimetres.
    pub rotary: bool,
    /// Smallest machine position, mm or degrees.
    pub min: f64,
    /// Largest machine position, mm or degrees.
    pub max: f64,
    /// Largest velocity by first difference, per s.
    pub peak_velocity_per_s: f64,
    /// Largest acceleration by second difference, per s². Starts and ends of a vibration step the velocity by
    /// design and are included.
    pub peak_acceleration_per_s2: f64,
    /// Largest jerk by third difference, per s³, with everything that the acceleration has.
    pub peak_jerk_per_s3: f64,
    /// Where the velocity is largest first; `None` for an axis that does not move.
    pub peak_velocity_at: Option<PeakPlace>,
    /// Where the acceleration is largest first.
    pub peak_acceleration_at: Option<PeakPlace>,
    /// Where the jerk is largest first.
    pub peak_jerk_at: Option<PeakPlace>,
}

/// Where a peak is: the last of the setpoints that its difference is taken of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeakPlace {
    /// Index of the setpoint.
    pub setpoint_index: u64,
    /// Its time from the program's start, s.
    pub time_s: f64,
    /// Its source line; 0 before the first block.
    pub line: u32,
}

impl OscillationSectionReport {
    /// The tool and its oscillation as judged, from the configuration that the program was validated with; `None` where that
    /// does not have them.
    #[must_use]
    pub fn motion<'a>(&self, config: &'a PipelineConfig) -> Option<(&'a ToolGeometry, ToolOscillation)> {
        let tool = config.tools.iter().find(|tool| tool.number == self.tool)?.geometry.as_ref()?;
        let named = config.profile.tool_oscillation.iter().filter(|named| named.name == self.condition);
        let for_tool = named.clone().find(|named| named.tools.contains(&self.tool));
        let named = for_tool.or_else(|| named.clone().find(|named| named.tools.is_empty()))?;
        let mut condition = named.at(self.cut.feed_mm_per_min, self.cut.spindle_rev_per_min);
        for load in &self.report.loads {
            // Words of the program may override the condition's amplitudes.
            match load.direction {
                OscillationDirection::Feed => condition.feed.amplitude_mm = load.amplitude_mm,
                OscillationDirection::Axial => condition.axial.amplitude_mm = load.amplitude_mm,
                OscillationDirection::Cross => {}
            }
        }
        let oscillation =
            ToolOscillation::new(tool, &condition, self.report.periods_per_rev, self.report.leading_edge)?;
        Some((tool, oscillation))
    }
}
