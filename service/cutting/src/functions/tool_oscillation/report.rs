//! The judgement of an oscillating pass before it is cut: figures, what every edge does, and the findings.

use feedwave_program::{Finding, Severity, SourceSpan};

use super::code;
use super::feed_range::feed_range;
use super::motion::DirectionMotion;
use super::removal::{Removal, removal};
use super::{
    DirectionPeaks, EdgeReport, FloorArea, HeightField, OscillationCondition, OscillationCut, OscillationDrives,
    OscillationFollowing, RoleRotation, Roughness, ToolGeometry, ToolOscillation, findings, following, ramp_mm, values,
};

/// What one direction of the machine can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionLimits {
    /// mm/s
    pub velocity_mm_per_s: f64,
    /// mm/s²
    pub acceleration_mm_per_s2: f64,
    /// mm/s³
    pub jerk_mm_per_s3: f64,
}

/// What the machine can do in the directions of the oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OscillationLimits {
    /// Across the tool, along the feed of a level cut and across it: the weaker axis of the work plane where the feed direction turns.
    pub plane: DirectionLimits,
    /// Along the tool axis.
    pub axial: DirectionLimits,
}

/// Everything a pass is judged by.
#[derive(Clone, Copy, Debug)]
pub struct OscillationJob<'a> {
    /// The tool.
    pub tool: &'a ToolGeometry,
    /// How it oscillates.
    pub condition: &'a OscillationCondition,
    /// Edge that leads, counted from 1: [`super::LeadingEdge::edge_after`].
    pub leading_edge: u32,
    /// How it is used.
    pub cut: OscillationCut,
    /// What the machine can do.
    pub limits: OscillationLimits,
    /// Largest feed override that is permitted, as a ratio of at least 1: the conditions are judged up to it.
    pub max_feed_override: f64,
    /// The drives of its axes; none to leave out what arrives.
    pub drives: Option<OscillationDrives<'a>>,
    /// The part of the floor to simulate; none to leave it out.
    pub floor: Option<FloorArea>,
    /// Where the oscillation is programmed.
    pub span: SourceSpan,
}

/// A direction of the oscillation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OscillationDirection {
    /// Along the feed.
    Feed,
    /// Along the tool axis.
    Axial,
    /// Along feed direction × tool axis.
    Cross,
}

/// Load of one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionLoad {
    /// Which direction.
    pub direction: OscillationDirection,
    /// Amplitude, mm.
    pub amplitude_mm: f64,
    /// Peaks of the oscillation alone.
    pub peaks: DirectionPeaks,
    /// Peak velocity with the feed, mm/s.
    pub velocity_with_feed_mm_per_s: f64,
    /// What the machine can do.
    pub limits: DirectionLimits,
    /// The largest ratio to a limit.
    pub utilisation: f64,
}

/// The floor with and without oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorReport {
    /// What was simulated.
    pub area: FloorArea,
    /// With the oscillation.
    pub oscillating: Roughness,
    /// The same pass without it.
    pub plain: Roughness,
}

/// An edge of the pass without oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlainEdge {
    /// Edge, counted from 1.
    pub edge: u32,
    /// Largest chip thickness, mm.
    pub max_chip_mm: f64,
    /// Share of the removed volume.
    pub volume_share: f64,
    /// Share of the revolution during which it cuts.
    pub duty: f64,
}

/// The report on an oscillating pass.
#[derive(Clone, Debug, PartialEq)]
pub struct OscillationReport {
    /// M.
    pub periods_per_rev: u32,
    /// N = z/M: edges that pass one place in a period; a fraction where M does not divide z.
    pub edges_per_period: f64,
    /// Period, s.
    pub period_s: f64,
    /// Feed per period, mm.
    pub feed_per_period_mm: f64,
    /// Range of feed about the programmed one within which the conditions that depend on it hold, mm/min; 0 to 0 where they do not
    /// hold at the programmed one neither.
    pub feed_range_mm_per_min: [f64; 2],
    /// Share of the period for which the largest protrusion is held.
    pub hold_share: f64,
    /// Share for which it has to be held so that the protruded edges close a circle.
    pub required_hold_share: f64,
    /// By how much the largest protrusion comes after the largest retreat in the feed direction, degrees.
    pub phase_error_deg: f64,
    /// Edge that leads, counted from 1.
    pub leading_edge: u32,
    /// Edges that leave the floor behind them ahead of the tool.
    pub finishing_edges: Vec<u32>,
    /// Length of path over which the oscillation is blended in and out, mm.
    pub ramp_mm: f64,
    /// Load of each direction that oscillates.
    pub loads: Vec<DirectionLoad>,
    /// Azimuth of the plane whose layers the edges have, degrees: 0 where the feed direction is in the work.
    pub plane_deg: f64,
    /// What every edge does.
    pub edges: Vec<EdgeReport>,
    /// What every edge does without oscillation.
    pub plain: Vec<PlainEdge>,
    /// Volume per revolution, mm³; the same without oscillation but for the depth that the protrusion adds.
    pub volume_mm3_per_rev: f64,
    /// Volume per revolution without oscillation, mm³.
    pub plain_volume_mm3_per_rev: f64,
    /// Height of the work that an edge would have to reach at once: depth and whole axial travel, mm.
    pub axial_reach_mm: f64,
    /// Largest height of material that meets the tool above an edge, mm: 0 where the stages leave none.
    pub above_edge_mm: f64,
    /// What arrives at the tool; `None` where nothing is stated of the drives.
    pub following: Option<OscillationFollowing>,
    /// The floor.
    pub floor: Option<FloorReport>,
    /// Whether no finding forbids the pass.
    pub feasible: bool,
}

impl OscillationReport {
    /// How many numbers it has, about.
    pub(super) fn numbers(&self) -> usize {
        const OF_EDGE: usize = 11;
        const OF_LAYER: usize = 4;
        let of_edge = |edge: &EdgeReport| OF_EDGE + OF_LAYER * edge.layers.len() + 2 * edge.chip_over_angle.len();
        let edges: usize = self.edges.iter().map(of_edge).sum();
        edges + 4 * self.plain.len() + self.finishing_edges.len() + 50
    }
}

/// Which edge leads, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoleReport {
    /// Edge that leads the first part, counted from 1.
    pub first_edge: u32,
    /// How the roles change.
    pub rotation: RoleRotation,
    /// Finished parts before this one.
    pub parts_before: u64,
    /// Oscillating cutting time before this section, at the programmed feed, s: that before the part and that of the
    /// program so far.
    pub cutting_time_before_s: f64,
    /// How often the roles have changed: by so many edges the lead has moved on.
    pub changes: u64,
}

/// An oscillation of a program at one feed and spindle speed, and about one inclination of the path.
#[derive(Clone, Debug, PartialEq)]
pub struct OscillationSectionReport {
    /// Line that switches it on.
    pub on_line: u32,
    /// Line of the first block at this feed, spindle speed and inclination.
    pub line: u32,
    /// Tool number.
    pub tool: u32,
    /// Name of the condition.
    pub condition: String,
    /// How the edges share the work.
    pub roles: RoleReport,
    /// How the tool is used.
    pub cut: OscillationCut,
    /// What can be said about it.
    pub report: OscillationReport,
}

/// Judges a pass: the report where its quantities are possible, and the findings, errors among them.
#[must_use]
pub fn judge(job: &OscillationJob<'_>) -> (Option<OscillationReport>, Vec<Finding>) {
    let mut found = Vec::new();
    let Some(oscillation) = synchronise(job, &mut found) else { return (None, found) };

    let mut report = figures(job, &oscillation);
    if let Some(area) = &job.floor {
        let simulate = |oscillation: &ToolOscillation| {
            HeightField::simulate(job.tool, oscillation, &job.cut, area).map(|field| field.roughness())
        };
        match (simulate(&oscillation), simulate(&plain(&oscillation))) {
            (Ok(oscillating), Ok(plain)) => report.floor = Some(FloorReport { area: *area, oscillating, plain }),
            (Err(error), _) | (_, Err(error)) => {
                // What cannot be examined forbids nothing.
                found.push(Finding::new(code::OSC_FLOOR, job.span, format!("its roughness is not known: {error}")));
            }
        }
    }
    findings::conditions(job, &report, &mut found);
    following::findings(job, &report, &mut found);
    report.feasible = found.iter().all(|finding| finding.severity != Severity::Error);
    (Some(report), found)
}

/// The oscillation in step with the spindle; `None`, with findings, where a quantity is impossible.
#[must_use]
pub fn synchronise(job: &OscillationJob<'_>, findings: &mut Vec<Finding>) -> Option<ToolOscillation> {
    let before = findings.len();
    values::input(job, findings);
    if findings.len() > before {
        return None;
    }
    let periods_per_rev = values::period(job, findings)?;
    ToolOscillation::new(job.tool, job.condition, periods_per_rev, job.leading_edge)
}

/// The same motion without oscillation.
fn plain(oscillation: &ToolOscillation) -> ToolOscillation {
    let mut plain = oscillation.clone();
    plain.feed.amplitude_mm = 0.0;
    plain.axial.amplitude_mm = 0.0;
    plain.cross = None;
    plain
}

fn figures(job: &OscillationJob<'_>, oscillation: &ToolOscillation) -> OscillationReport {
    let OscillationJob { tool, condition, cut, .. } = job;
    let periods = f64::from(oscillation.periods_per_rev);
    let period_s = 60.0 / (cut.spindle_rev_per_min * periods);
    let feed_per_period_mm = cut.feed_mm_per_min / 60.0 * period_s;
    let Removal { plane_deg, edges, above_edge_mm, volume_mm3 } = removal(tool, oscillation, cut);
    let without = removal(tool, &plain(oscillation), cut);
    let cross = oscillation.cross.as_ref().map(|cross| (OscillationDirection::Cross, cross));
    let directions =
        [(OscillationDirection::Feed, &oscillation.feed), (OscillationDirection::Axial, &oscillation.axial)];
    OscillationReport {
        periods_per_rev: oscillation.periods_per_rev,
        edges_per_period: f64::from(tool.edge_count()) / periods,
        period_s,
        feed_per_period_mm,
        feed_range_mm_per_min: feed_range(job, oscillation, period_s),
        hold_share: oscillation.axial.trough().1,
        required_hold_share: tool.widest_gap_turns() * periods,
        phase_error_deg: oscillation.phase_error_deg(),
        leading_edge: job.leading_edge,
        finishing_edges: edges.iter().filter(|edge| edge.finishes).map(|edge| edge.edge).collect(),
        ramp_mm: ramp_mm(
            condition.ramp_periods,
            feed_per_period_mm,
            oscillation.feed.amplitude_mm,
            condition.may_overrun,
        ),
        loads: directions.into_iter().chain(cross).map(|(name, motion)| load(job, name, motion, period_s)).collect(),
        plain: without
            .edges
            .iter()
            .map(|edge| PlainEdge {
                edge: edge.edge,
                max_chip_mm: edge.max_chip_mm,
                volume_share: edge.volume_share,
                duty: edge.duty,
            })
            .collect(),
        plane_deg,
        edges,
        volume_mm3_per_rev: volume_mm3,
        plain_volume_mm3_per_rev: without.volume_mm3,
        axial_reach_mm: cut.depth_mm + 2.0 * condition.axial.amplitude_mm,
        above_edge_mm,
        following: OscillationFollowing::of(job, oscillation, period_s),
        floor: None,
        feasible: true,
    }
}

fn load(
    job: &OscillationJob<'_>,
    direction: OscillationDirection,
    motion: &DirectionMotion,
    period_s: f64,
) -> DirectionLoad {
    let limits = match direction {
        OscillationDirection::Axial => job.limits.axial,
        OscillationDirection::Cross => job.limits.plane,
        OscillationDirection::Feed => feed_limits(job),
    };
    let peaks = motion.peaks(period_s);
    let feed = if direction == OscillationDirection::Feed { job.cut.feed_mm_per_min / 60.0 } else { 0.0 };
    let velocity_with_feed_mm_per_s = peaks.velocity_mm_per_s + feed;
    let utilisation = (velocity_with_feed_mm_per_s / limits.velocity_mm_per_s)
        .max(peaks.acceleration_mm_per_s2 / limits.acceleration_mm_per_s2)
        .max(peaks.jerk_mm_per_s3 / limits.jerk_mm_per_s3);
    DirectionLoad {
        direction,
        amplitude_mm: motion.amplitude_mm,
        peaks,
        velocity_with_feed_mm_per_s,
        limits,
        utilisation,
    }
}

/// What the machine can do along the feed. On an inclined path the plane has the cosine of it and the tool axis the sine; where one axis
/// may have a part of both, they are counted together.
fn feed_limits(job: &OscillationJob<'_>) -> DirectionLimits {
    let OscillationLimits { plane, axial } = job.limits;
    if job.cut.incline_deg == 0.0 {
        return plane;
    }
    let (along, across) = libm::sincos(job.cut.incline_deg.to_radians());
    let together = job.drives.is_some_and(|drives| drives.guided);
    let limit = |plane: f64, axial: f64| {
        let [plane, axial] = [across / plane, along / axial];
        1.0 / if together { plane + axial } else { plane.max(axial) }
    };
    DirectionLimits {
        velocity_mm_per_s: limit(plane.velocity_mm_per_s, axial.velocity_mm_per_s),
        acceleration_mm_per_s2: limit(plane.acceleration_mm_per_s2, axial.acceleration_mm_per_s2),
        jerk_mm_per_s3: limit(plane.jerk_mm_per_s3, axial.jerk_mm_per_s3),
    }
}
