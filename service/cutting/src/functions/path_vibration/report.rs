//! What validation says about one vibrating section.

use feedwave_motion::{PathMotion, Quantity};
use feedwave_program::DrillingCycle;

use super::chip::{ChipReport, SurfaceSpeedReport};
use super::chip_blend::reached_share;
use super::departure::Departure;
use super::following::FollowingReport;
use super::{GenerationMode, VibrationCondition, VibrationEnvelope};

/// One vibrating section: what the machine can do, and whether the chip breaks.
#[derive(Clone, Debug, PartialEq)]
pub struct SectionReport {
    /// Line that switches the vibration on.
    pub on_line: u32,
    /// Line of the first cutting block.
    pub first_line: u32,
    /// Line of the last cutting block.
    pub last_line: u32,
    /// The drilling cycle that it belongs to; the first where several follow each other in it.
    pub drilling_cycle: Option<DrillingCycle>,
    /// Frequency and amplitude.
    pub condition: VibrationCondition,
    /// How the vibration is generated.
    pub generation_mode: GenerationMode,
    /// How it begins and ends.
    pub envelope: VibrationEnvelope,
    /// Longest path over which the vibration is blended in and out, mm; `None` as published.
    pub ramp_mm: Option<f64>,
    /// Share of the section's length on which the amplitude is the whole one.
    pub full_amplitude_share: f64,
    /// Junctions of blocks inside the section at which the vibration is blended out and in again.
    pub blended_junctions: u64,
    /// The parts between them; the first ones where there are very many.
    pub parts: Vec<SectionPartStart>,
    /// The steps at the ends of a published vibration.
    pub published_ends: Option<PublishedEnds>,
    /// Path length of the section, mm.
    pub length_mm: f64,
    /// Peak-to-peak travel of the vibration 2A, mm.
    pub travel_mm: f64,
    /// How finely the wave is sampled.
    pub sampling: SamplingReport,
    /// Load of each axis that the section moves.
    pub axes: Vec<AxisLoadReport>,
    /// Smallest radius of curvature, mm; `None` when the section is straight.
    pub min_radius_mm: Option<f64>,
    /// Bound of the deviation from the contour, mm: A²/(2R) of the smallest radius and A·|τ₂−τ₁| of junctions that are gone over; 0 along
    /// the path.
    pub contour_deviation_mm: f64,
    /// What it follows from, for other amplitudes as well.
    pub departure: Departure,
    /// Largest jump of a published offset at a junction A·|τ₂−τ₁|, mm, avoided by resting there until it is 0; 0 along the
    /// path.
    pub junction_jump_mm: f64,
    /// Chip breaking where it is worst; `None` when nothing was cut with a turning spindle.
    pub chip: Option<ChipReport>,
    /// Feed override of that cut, as a factor: the one in force at that place of the plan; `None` without such a cut.
    pub feed_override: Option<f64>,
    /// Chip breaking at the largest feed override that the machine permits; `None` likewise.
    pub at_max_feed_override: Option<OverrideReport>,
    /// Chip breaking along the section at constant spindle speed, in order; the first spans where there are very
    /// many.
    pub chip_spans: Vec<ChipSpan>,
    /// Further spans, counted but not listed.
    pub chip_spans_not_listed: u64,
    /// Chip breaking along the parts with constant surface speed on which the spindle speed changes.
    pub surface_speed: Option<SurfaceSpeedReport>,
    /// Share of the length cut with a turning spindle on which the chip breaks; `None` when there is none. Under the amplitude
    /// that the blends at junctions let through; the first and the last blend of the section, which every section has, are
    /// left out: [`Self::blend`] has them.
    pub broken_share: Option<f64>,
    /// Where the chip breaks under the amplitude that the blends let through; `None` as published, or without such a cut.
    pub blend: Option<BlendReport>,
    /// What arrives at the tool.
    pub following: FollowingReport,
    /// Share of the setpoints at which the clamps at the ends of a published vibration act; 0 before setpoints are
    /// generated.
    pub clamped_share: f64,
    /// Largest amplitude at this frequency that the axes can follow, mm; `None` where the programmed one is within
    /// their limits, 0 where none is.
    pub largest_amplitude_mm: Option<f64>,
    /// Highest frequency at this amplitude that the axes can follow, Hz; `None` and 0 likewise.
    pub highest_frequency_hz: Option<f64>,
    /// Largest velocity, acceleration and jerk along the path (mm/s and so on) that the curves of the section permit feed and
    /// vibration together, each alone; `None` where it has none.
    pub on_curves: Option<PathMotion>,
    /// Whether the axes can follow the section, the ends of a published vibration included, whatever the severity of that
    /// finding, and nothing of the above forbids running it. `false` where a block of it was refused, or nothing judged.
    pub feasible: bool,
}

/// Share of the length that blends at junctions may leave unbroken without a word, as the first and the last blend of every section
/// do: a chip of some revolutions now and then is no ribbon.
pub(super) const FEW_JUNCTIONS_SHARE: f64 = 0.01;

/// Where the chip breaks under the amplitude that the blends let through, at the feed overrides of the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlendReport {
    /// Share of all of the length cut with a turning spindle on which the chip breaks, with the first and last blend.
    pub broken_share: f64,
    /// Share of that length in air, over the revolution before only: older ones may add to it.
    pub air_share: f64,
    /// Length of chip at the start of the section until it breaks for certain, whatever the phase, mm.
    pub unbroken_at_start_mm: f64,
    /// The same in revolutions.
    pub unbroken_at_start_rev: f64,
    /// Length of chip at its end since it last broke for certain, whatever the phase, mm.
    pub unbroken_at_end_mm: f64,
    /// The same in revolutions.
    pub unbroken_at_end_rev: f64,
    /// Longest other chip between two breaks with blends between them that there can be, whatever the phase of the vibration, mm; 0 where
    /// there is none.
    pub longest_unbroken_mm: f64,
    /// Its revolutions.
    pub longest_unbroken_rev: f64,
    /// Line of its start.
    pub longest_unbroken_line: Option<u32>,
    /// Length of the longest part of the section between two places without vibration, mm.
    pub longest_part_mm: f64,
    /// Length of its blends, mm.
    pub longest_part_ramp_mm: f64,
}

impl SectionReport {
    /// Whether a cut whose chip breaks in another report of the same path does not break it here.
    pub(crate) fn loses_chips_of(&self, other: &Self) -> bool {
        const ROUNDING: f64 = 1e-9;
        let is_listed = self.chip_spans_not_listed == 0 && other.chip_spans_not_listed == 0;
        let is_constant = self.surface_speed.is_none() && other.surface_speed.is_none();
        if !(is_listed && is_constant) && self.broken_share < other.broken_share.map(|share| share - ROUNDING) {
            return true;
        }
        let ends_mm = |span: &ChipSpan| [span.start_mm, span.start_mm + span.length_mm];
        let overlaps = |one: &ChipSpan, other: &ChipSpan| {
            let [[a, b], [c, d]] = [ends_mm(one), ends_mm(other)];
            a.max(c) + ROUNDING < b.min(d)
        };
        let mut unbroken = self.chip_spans.iter().filter(|span| !span.broken);
        unbroken.any(|here| other.chip_spans.iter().any(|there| there.broken && overlaps(here, there)))
    }

    /// Share of the amplitude that the blends let through to the chip of these cuts at a feed override, over a whole vibration in the
    /// middle of the longest part: with less than 1, a steady vibration of that share breaks what this one breaks. 1 as published.
    #[must_use]
    pub fn reached_share(&self, feed_override: f64) -> f64 {
        let Some(blend) = &self.blend else { return 1.0 };
        let of = |span: &ChipSpan| {
            let feed_mm = span.feed_per_rev_mm / span.feed_override * feed_override;
            let vibration_mm = feed_mm * span.spindle_rev_per_min / (60.0 * self.condition.frequency_hz);
            reached_share(blend.longest_part_mm, blend.longest_part_ramp_mm, feed_mm, vibration_mm)
        };
        self.chip_spans.iter().map(of).fold(1.0, f64::min)
    }

    /// Share of the amplitude that the drives bring to the tool where least of it arrives, at most 1.
    #[must_use]
    pub fn followed_share(&self) -> f64 {
        let share = self.following.arriving_amplitude_mm / self.condition.amplitude_mm;
        if share.is_finite() { share.min(1.0) } else { 1.0 }
    }

    /// Whether the whole amplitude would break the chip, and the blends let through too little for it to break anywhere for certain.
    #[must_use]
    pub fn is_kept_whole_by_blends(&self) -> bool {
        let breaks_when_whole = self.chip_spans.iter().any(|span| span.broken)
            || self.surface_speed.as_ref().is_some_and(|surface| surface.broken_share > 0.0);
        breaks_when_whole && self.blend.is_some() && self.broken_share == Some(0.0)
    }

    /// Where blends at junctions leave at least a revolution of chip unbroken, a closed ring and more, however seldom: the line, and
    /// revolutions.
    #[must_use]
    pub fn longest_between_blends(&self) -> Option<(u32, f64)> {
        let blend =
            self.blend.as_ref().filter(|blend| blend.longest_unbroken_rev >= 1.0 && self.blended_junctions > 0)?;
        Some((blend.longest_unbroken_line?, blend.longest_unbroken_rev))
    }

    /// As [`Self::longest_between_blends`], where it is on more than a hundredth of the length.
    #[must_use]
    pub fn unbroken_between_blends(&self) -> Option<(u32, f64)> {
        unbroken_between(self.blend.as_ref(), self.broken_share, self.blended_junctions)
    }
}

/// See [`SectionReport::unbroken_between_blends`].
pub(super) fn unbroken_between(
    blend: Option<&BlendReport>,
    broken_share: Option<f64>,
    junctions: u64,
) -> Option<(u32, f64)> {
    let unbroken_share = 1.0 - broken_share?;
    let counts = |blend: &&BlendReport| {
        blend.longest_unbroken_rev >= 1.0 && junctions > 0 && unbroken_share > FEW_JUNCTIONS_SHARE
    };
    let blend = blend.filter(counts)?;
    Some((blend.longest_unbroken_line?, blend.longest_unbroken_rev))
}

/// Where a part of a section begins between two places without vibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectionPartStart {
    /// Path position in the section, mm.
    pub start_mm: f64,
    /// Programmed feed there, mm/s, on which the length of its blends depends.
    pub feed_mm_per_s: f64,
}

/// Whether the chip breaks at the largest feed override that the machine permits, whatever the plan runs at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OverrideReport {
    /// That override, as a factor.
    pub max_feed_override: f64,
    /// Share of the length cut with a turning spindle on which the chip breaks at it.
    pub broken_share: f64,
    /// Least 2A·|sin πD|/f_r at it with the share of the amplitude that the blends let through: the chip breaks in every revolution
    /// between them at 1 and above.
    pub breaking_margin: f64,
    /// The whole amplitude would break the chip everywhere at it, and the blends leave parts unbroken.
    pub blends_decide: bool,
    /// Line of the cut that is furthest from breaking.
    pub line: u32,
    /// Largest feed override at which the chip still breaks everywhere, as a factor; `None` where none does, or where blends and
    /// not the feed decide it.
    pub largest_breaking_override: Option<f64>,
    /// Feed of that cut at that override, mm/rev.
    pub largest_breaking_feed_per_rev_mm: Option<f64>,
    /// Smallest programmed amplitude that breaks the chip everywhere at the largest permitted override, mm; `None` where no
    /// permitted amplitude does.
    pub min_amplitude_mm: Option<f64>,
}

/// Steps of a vibration that begins with its whole speed and is clamped at its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct PublishedEnds {
    /// Step of the velocity along the path at the start 2πf·A, mm/s.
    pub start_velocity_step_mm_per_s: f64,
    /// Acceleration that the first setpoints ask for, mm/s².
    pub start_acceleration_mm_per_s2: f64,
    /// Largest step of the velocity where a clamp begins or ends to act, at the end of the section too: feed and vibration,
    /// mm/s.
    pub clamp_velocity_step_mm_per_s: f64,
    /// Largest acceleration that setpoints ask for there, mm/s².
    pub clamp_acceleration_mm_per_s2: f64,
    /// Whether there are corners, at which the velocity of the axes steps with the direction of the path.
    pub has_corners: bool,
    /// The axis whose limits of acceleration and jerk are exceeded most, at an end, a clamp or a corner.
    pub exceeded: Option<ExceededAxis>,
}

/// An axis that cannot follow: its acceleration, its jerk or both are too large.
#[derive(Clone, Debug, PartialEq)]
pub struct ExceededAxis {
    /// Name of the axis column.
    pub axis: String,
    /// Whether it turns: its values are degrees.
    pub rotary: bool,
    /// Acceleration that is asked of it, per s².
    pub acceleration_per_s2: f64,
    /// Its limit, per s².
    pub max_acceleration_per_s2: f64,
    /// Jerk that is asked of it, per s³: of a step, the third difference of setpoints.
    pub jerk_per_s3: f64,
    /// Its limit, per s³.
    pub max_jerk_per_s3: f64,
}

impl ExceededAxis {
    /// What is exceeded most: what is asked for and the limit.
    pub(super) fn most_exceeded(&self) -> (Quantity, [f64; 2]) {
        let acceleration = [self.acceleration_per_s2, self.max_acceleration_per_s2];
        let jerk = [self.jerk_per_s3, self.max_jerk_per_s3];
        if jerk[0] * acceleration[1] > acceleration[0] * jerk[1] {
            (Quantity::Jerk, jerk)
        } else {
            (Quantity::Acceleration, acceleration)
        }
    }

    /// What is asked for over the limit, of what is exceeded most.
    pub(super) fn utilisation(&self) -> f64 {
        let (_, [demanded, limit]) = self.most_exceeded();
        demanded / limit
    }
}

/// How finely the wave is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplingReport {
    /// Period at which the wave is generated, s: the servo period in the servo-side mode.
    pub period_s: f64,
    /// Samples per vibration period.
    pub samples_per_vibration: f64,
    /// Largest share of the peak that sampling can miss, 1 − cos(π·f·Δt).
    pub peak_error: f64,
}

/// Load that a section puts on one machine axis: mm, or degrees for a rotary axis.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisLoadReport {
    /// Name of the axis column.
    pub axis: String,
    /// Whether it turns: its values are degrees.
    pub rotary: bool,
    /// Largest |derivative| of the axis by path length, 0 to 1 for a linear axis.
    pub worst_direction: f64,
    /// Line where the velocity is largest.
    pub line: u32,
    /// Peak velocity: programmed feed plus vibration, per s.
    pub velocity_per_s: f64,
    /// Limit of the velocity, per s, likewise.
    pub max_velocity_per_s: f64,
    /// Peak acceleration of the vibration with its beginning and end, per s²; as published, that at its steps.
    pub acceleration_per_s2: f64,
    /// Limit of the acceleration, per s²: where a curve leaves the vibration too little of it, what it leaves.
    pub max_acceleration_per_s2: f64,
    /// Peak jerk of the vibration with its beginning and end, per s³.
    pub jerk_per_s3: f64,
    /// Limit of the jerk, per s³, likewise.
    pub max_jerk_per_s3: f64,
    /// A limit is what the planner leaves on a curve, less than the axis' own.
    pub limited_on_curve: bool,
    /// The largest of the three ratios to their limits; above 1 the axis cannot follow.
    pub utilisation: f64,
}

/// What a spindle speed follows from under constant surface speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceCut {
    /// Surface speed, m/min.
    pub m_per_min: f64,
    /// Diameter of the work, mm; `None` where the largest spindle speed holds.
    pub diameter_mm: Option<f64>,
    /// Largest spindle speed that program and machine permit, rev/min.
    pub max_rev_per_min: f64,
}

/// A stretch of the section at constant spindle speed and feed: the speed as programmed, or as it follows from a constant surface speed
/// at one diameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ChipSpan {
    /// Line of its first block.
    pub first_line: u32,
    /// Line of its last block.
    pub last_line: u32,
    /// Path position of its start in the section, mm.
    pub start_mm: f64,
    /// Its length, mm.
    pub length_mm: f64,
    /// Its share of the section's length.
    pub share: f64,
    /// Feed override that it is cut at, as a factor.
    pub feed_override: f64,
    /// Feed along the path under the override, mm/rev.
    pub feed_per_rev_mm: f64,
    /// Spindle speed, rev/min.
    pub spindle_rev_per_min: f64,
    /// What that follows from; `None` where it is programmed itself.
    pub surface: Option<SurfaceCut>,
    /// D.
    pub vibrations_per_rev: f64,
    /// 2A·|sin πD|/f_r with the whole amplitude: the chip breaks at 1 and above.
    pub breaking_margin: f64,
    /// Whether the chip breaks with the whole amplitude.
    pub broken: bool,
}
