//! What a search is to find for the sections that one block switches on, from the reports about them.

use core::f64::consts::TAU;

use feedwave_motion::PathMotion;

use super::super::{
    MIN_FREQUENCY_HZ, PEAK_RESERVE, RAMP_VIBRATIONS, SectionReport, VibrationEnvelope, VibrationSettings,
};
use super::{SearchBlend, SearchCut, VibrationSearch};

/// Share of the acceleration and the jerk that a vibration may take of what there is of an axis, or on a curve: the rest is the
/// feed's.
const AXIS_SHARE: f64 = 0.9;
/// Samples of a vibration below which its sampling is coarse.
const LEAST_SAMPLES: f64 = 8.0;
/// By which share the frequency may differ from the programmed one, where no range is stated: chips stay about as long.
const FREQUENCY_SHARE: f64 = 0.25;
/// By how many vibrations of a revolution it may differ at least, so that half a vibration is always within reach.
const FREQUENCY_VIBRATIONS: f64 = 0.6;

/// What is wanted of a vibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchGoals {
    /// 2A·|sin πD|/f_r at least, 1 or more.
    pub margin: f64,
    /// Share by which the spindle may be slower or faster than programmed.
    pub speed_tolerance: f64,
    /// Largest feed override up to which the chip has to break, as a factor, 1 or more.
    pub max_feed_override: f64,
    /// Lowest and highest frequency, Hz; `None`: around the programmed one.
    pub frequency_hz: Option<[f64; 2]>,
}

/// Why nothing can be looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsearchable {
    /// Nothing is cut with a turning spindle.
    NoCut,
    /// Parts are cut at constant surface speed, where the vibrations of a revolution change along the path.
    SurfaceSpeed,
    /// There are more cuts than a report lists.
    TooManyCuts,
    /// No frequency lies within the range and the limits of the machine.
    NoFrequency,
}

impl VibrationSearch {
    /// What is to be found for sections with one frequency and amplitude; there is at least one.
    ///
    /// # Errors
    /// [`Unsearchable`] with the reason.
    pub fn of_sections(
        sections: &[&SectionReport],
        settings: &VibrationSettings,
        goals: &SearchGoals,
    ) -> Result<Self, Unsearchable> {
        let spans = sections.iter().flat_map(|section| &section.chip_spans);
        let cuts: Vec<SearchCut> = spans
            .map(|span| SearchCut {
                feed_per_rev_mm: span.feed_per_rev_mm / span.feed_override,
                spindle_rev_per_min: span.spindle_rev_per_min,
            })
            .collect();
        if sections.iter().any(|section| section.surface_speed.as_ref().is_some_and(|it| it.length_mm > 0.0)) {
            return Err(Unsearchable::SurfaceSpeed);
        }
        if sections.iter().any(|section| section.chip_spans_not_listed > 0) {
            return Err(Unsearchable::TooManyCuts);
        }
        let Some(first) = sections.first().filter(|_| !cuts.is_empty()) else { return Err(Unsearchable::NoCut) };
        let programmed_hz = first.condition.frequency_hz;
        let fastest = cuts.iter().map(|cut| cut.spindle_rev_per_min).fold(0.0, f64::max);
        let sampled_hz = sections.iter().map(|section| 1.0 / (LEAST_SAMPLES * section.sampling.period_s));
        let highest_hz = sampled_hz.fold(settings.max_frequency_hz, f64::min);
        // One that is too high comes down to what there can be.
        let nearest_hz = programmed_hz.min(highest_hz);
        let around = (FREQUENCY_SHARE * nearest_hz).max(FREQUENCY_VIBRATIONS * fastest / 60.0);
        let [low_hz, high_hz] = goals.frequency_hz.unwrap_or([nearest_hz - around, nearest_hz + around]);
        let frequency_hz = [low_hz.max(MIN_FREQUENCY_HZ), high_hz.min(highest_hz)];
        if frequency_hz[0] > frequency_hz[1] {
            return Err(Unsearchable::NoFrequency);
        }
        // By how much the amplitude grows at the largest override.
        let follows = settings.amplitude_follows_feed_up_to.map_or(1.0, |limit| limit.max(1.0));
        let grows = follows.min(goals.max_feed_override);
        let of_minute = |section: &&SectionReport| {
            let coupling = section.chip.as_ref().map(|chip| chip.condition.feed_coupling);
            coupling == Some(super::super::FeedCoupling::PerMinute)
        };
        let amplitudes = sections.iter().map(|section| largest_on_contour_mm(section, settings));
        Ok(Self {
            feed_per_minute: sections.iter().any(of_minute),
            speed_tolerance: goals.speed_tolerance,
            feed_ratio: goals.max_feed_override / grows,
            margin: goals.margin,
            frequency_hz,
            preferred_hz: programmed_hz,
            max_amplitude_mm: amplitudes.fold(settings.max_amplitude_mm, f64::min) / grows,
            peaks: peaks(
                sections,
                cuts.iter().map(feed_mm_per_s).fold(0.0, f64::max),
                settings.amplitude_follows_feed_up_to,
            ),
            blend: blend(sections, &cuts, settings.amplitude_follows_feed_up_to.is_some()),
            cuts,
        })
    }
}

/// Largest offset beside a curved path, mm, where the vibration leaves it.
fn largest_on_contour_mm(section: &SectionReport, settings: &VibrationSettings) -> f64 {
    section.departure.largest_offset_mm(settings.contour_tolerance_mm)
}

/// The peaks that every axis can follow beside the feed: those of the vibration at its whole amplitude.
fn peaks(sections: &[&SectionReport], feed_mm_per_s: f64, follows_up_to: Option<f64>) -> PathMotion {
    let reserve = follows_up_to.map_or(1.0, |follows| follows.max(1.0) * PEAK_RESERVE);
    let mut peaks = PathMotion { velocity: f64::INFINITY, acceleration: f64::INFINITY, jerk: f64::INFINITY };
    let mut is_left = |left: PathMotion| {
        let velocity = (left.velocity - feed_mm_per_s).max(f64::MIN_POSITIVE);
        peaks.velocity = peaks.velocity.min(velocity / reserve);
        peaks.acceleration = peaks.acceleration.min(AXIS_SHARE * left.acceleration / reserve);
        peaks.jerk = peaks.jerk.min(AXIS_SHARE * left.jerk / reserve);
    };
    for axis in sections.iter().flat_map(|section| &section.axes).filter(|axis| axis.worst_direction > 0.0) {
        let along = |limit: f64| limit / axis.worst_direction;
        is_left(PathMotion {
            velocity: along(axis.max_velocity_per_s),
            acceleration: along(axis.max_acceleration_per_s2),
            jerk: along(axis.max_jerk_per_s3),
        });
    }
    // Turning takes its part of every axis: a curve leaves less along the path.
    sections.iter().filter_map(|section| section.on_curves).for_each(is_left);
    peaks
}

/// What the blends of these sections add to the peaks; `None` where all are as published. A following amplitude counts with the
/// blend of the programmed one, which is shorter.
fn blend(sections: &[&SectionReport], cuts: &[SearchCut], follows_feed: bool) -> Option<SearchBlend> {
    let is_blended = sections.iter().any(|section| section.envelope == VibrationEnvelope::Blended);
    let feeds = || cuts.iter().map(feed_mm_per_s);
    is_blended.then(|| SearchBlend {
        least_feed_mm_per_s: feeds().fold(f64::INFINITY, f64::min),
        top_feed_mm_per_s: feeds().fold(0.0, f64::max),
        following_rate: if follows_feed { 1.0 / (TAU * RAMP_VIBRATIONS) } else { 0.0 },
    })
}

/// Programmed feed of a cut, mm/s.
fn feed_mm_per_s(cut: &SearchCut) -> f64 {
    cut.feed_per_rev_mm * cut.spindle_rev_per_min / 60.0
}
