//! What is said about sections with vibration along the path, for the contract.

use feedwave_cutting::{
    AxisFollowing, AxisLoadReport, BlendReport, ChipReport, ChipSpan, FeedCoupling, FollowingContour, FollowingReport,
    Nearest, OverrideReport, PublishedEnds, SectionReport, SurfaceSpeedReport, UnbrokenSpan,
};

use super::{generation_mode_to_proto, vibration_envelope_to_proto};
use crate::convert::profile::axis_letter_to_proto;
use crate::proto;

/// A vibrating section of a program as the contract has it.
pub(super) fn section_to_proto(section: &SectionReport) -> proto::SectionReport {
    proto::SectionReport {
        on_line: section.on_line,
        first_line: section.first_line,
        last_line: section.last_line,
        drilling_cycle: section
            .drilling_cycle
            .map(|cycle| proto::DrillingCycle { code: cycle.code().to_owned(), line: cycle.line }),
        frequency_hz: section.condition.frequency_hz,
        amplitude_mm: section.condition.amplitude_mm,
        generation_mode: generation_mode_to_proto(section.generation_mode).into(),
        length_mm: section.length_mm,
        travel_mm: section.travel_mm,
        sampling: Some(proto::SamplingReport {
            period_s: section.sampling.period_s,
            samples_per_vibration: section.sampling.samples_per_vibration,
            peak_error: section.sampling.peak_error,
        }),
        axes: section.axes.iter().map(axis_load).collect(),
        min_radius_mm: section.min_radius_mm,
        contour_deviation_mm: section.contour_deviation_mm,
        junction_jump_mm: section.junction_jump_mm,
        chip: section.chip.as_ref().map(chip),
        chip_spans: section.chip_spans.iter().map(chip_span).collect(),
        chip_spans_not_listed: section.chip_spans_not_listed,
        surface_speed: section.surface_speed.as_ref().map(surface_speed),
        broken_share: section.broken_share,
        following: Some(following(&section.following)),
        clamped_share: section.clamped_share,
        largest_amplitude_mm: section.largest_amplitude_mm,
        highest_frequency_hz: section.highest_frequency_hz,
        feasible: section.feasible,
        feed_override: section.feed_override,
        at_max_feed_override: section.at_max_feed_override.as_ref().map(override_report),
        envelope: vibration_envelope_to_proto(section.envelope).into(),
        ramp_mm: section.ramp_mm,
        full_amplitude_share: section.full_amplitude_share,
        blended_junctions: section.blended_junctions,
        published_ends: section.published_ends.as_ref().map(published_ends),
        blend: section.blend.as_ref().map(blend_report),
    }
}

const fn blend_report(report: &BlendReport) -> proto::BlendReport {
    proto::BlendReport {
        broken_share: report.broken_share,
        air_share: report.air_share,
        unbroken_at_start_mm: report.unbroken_at_start_mm,
        unbroken_at_start_rev: report.unbroken_at_start_rev,
        unbroken_at_end_mm: report.unbroken_at_end_mm,
        unbroken_at_end_rev: report.unbroken_at_end_rev,
        longest_unbroken_mm: report.longest_unbroken_mm,
        longest_unbroken_rev: report.longest_unbroken_rev,
        longest_unbroken_line: report.longest_unbroken_line,
        longest_part_mm: report.longest_part_mm,
    }
}

const fn override_report(report: &OverrideReport) -> proto::OverrideReport {
    proto::OverrideReport {
        max_feed_override: report.max_feed_override,
        broken_share: report.broken_share,
        breaking_margin: report.breaking_margin,
        line: report.line,
        largest_breaking_override: report.largest_breaking_override,
        largest_breaking_feed_mm_per_rev: report.largest_breaking_feed_per_rev_mm,
        min_amplitude_mm: report.min_amplitude_mm,
    }
}

#[expect(deprecated, reason = "a former name of a field, which its readers were promised")]
fn published_ends(ends: &PublishedEnds) -> proto::PublishedEnds {
    proto::PublishedEnds {
        start_velocity_step_mm_per_s: ends.start_velocity_step_mm_per_s,
        start_acceleration_mm_per_s2: ends.start_acceleration_mm_per_s2,
        clamp_velocity_step_mm_per_s: ends.clamp_velocity_step_mm_per_s,
        clamp_acceleration_mm_per_s2: ends.clamp_acceleration_mm_per_s2,
        exceeded: ends.exceeded.as_ref().map(|axis| proto::ExceededAxis {
            name: axis.axis.clone(),
            axis: axis.axis.clone(),
            acceleration_per_s2: axis.acceleration_per_s2,
            max_acceleration_per_s2: axis.max_acceleration_per_s2,
            jerk_per_s3: axis.jerk_per_s3,
            max_jerk_per_s3: axis.max_jerk_per_s3,
        }),
    }
}

#[expect(deprecated, reason = "a former name of a field, which its readers were promised")]
fn axis_load(axis: &AxisLoadReport) -> proto::AxisLoadReport {
    proto::AxisLoadReport {
        name: axis.axis.clone(),
        axis: axis.axis.clone(),
        worst_direction: axis.worst_direction,
        line: axis.line,
        velocity_per_s: axis.velocity_per_s,
        max_velocity_per_s: axis.max_velocity_per_s,
        acceleration_per_s2: axis.acceleration_per_s2,
        max_acceleration_per_s2: axis.max_acceleration_per_s2,
        jerk_per_s3: axis.jerk_per_s3,
        max_jerk_per_s3: axis.max_jerk_per_s3,
        utilisation: axis.utilisation,
        limited_on_curve: axis.limited_on_curve,
        rotary: axis.rotary,
    }
}

#[expect(deprecated, reason = "a former name of a field, which its readers were promised")]
fn chip(chip: &ChipReport) -> proto::ChipReport {
    let spindle_speed_margin = chip.spindle_speed_margin.map(|margin| proto::SpeedTolerance {
        minus_rev_per_min: margin.minus_rev_per_min,
        plus_rev_per_min: margin.plus_rev_per_min,
    });
    let feed_coupling = match chip.condition.feed_coupling {
        FeedCoupling::PerRevolution => proto::FeedCoupling::PerRevolution,
        FeedCoupling::PerMinute => proto::FeedCoupling::PerMinute,
    };
    proto::ChipReport {
        feed_mm_per_rev: chip.condition.feed_per_rev_mm,
        spindle_rev_per_min: chip.condition.spindle_rev_per_min,
        diameter_mm: chip.condition.diameter_mm,
        feed_coupling: feed_coupling.into(),
        vibrations_per_rev: chip.vibrations_per_rev,
        amplitude_ratio: chip.amplitude_ratio,
        broken: chip.broken,
        air_share: chip.air_share,
        air_share_previous_revolution: chip.air_share_previous_revolution,
        largest_thickness_mm: chip.largest_thickness_mm,
        breaks_per_rev: chip.breaks_per_rev,
        longest_chip_mm: chip.longest_chip_mm,
        mean_chip_mm: chip.mean_chip_mm,
        min_amplitude_mm: chip.min_amplitude_mm,
        breaking_frequencies_hz: Some(nearest(chip.breaking_frequencies_hz)),
        recommended_frequencies_hz: chip.recommended_frequencies_hz.clone(),
        breaking_spindle_rev_per_min: Some(nearest(chip.breaking_spindle_rev_per_min)),
        recommended_spindle_rev_per_min: chip.recommended_spindle_rev_per_min.clone(),
        speed_tolerance: spindle_speed_margin,
        spindle_speed_margin,
        earlier_revolutions: chip.earlier_revolutions,
        exact: chip.exact,
    }
}

const fn nearest(nearest: Nearest) -> proto::Nearest {
    proto::Nearest { below: nearest.below, above: nearest.above }
}

fn chip_span(span: &ChipSpan) -> proto::ChipSpan {
    proto::ChipSpan {
        first_line: span.first_line,
        last_line: span.last_line,
        start_mm: span.start_mm,
        length_mm: span.length_mm,
        share: span.share,
        feed_override: span.feed_override,
        feed_mm_per_rev: span.feed_per_rev_mm,
        spindle_rev_per_min: span.spindle_rev_per_min,
        vibrations_per_rev: span.vibrations_per_rev,
        breaking_margin: span.breaking_margin,
        broken: span.broken,
        surface_speed_m_per_min: span.surface.map(|surface| surface.m_per_min),
    }
}

fn surface_speed(report: &SurfaceSpeedReport) -> proto::SurfaceSpeedReport {
    proto::SurfaceSpeedReport {
        length_mm: report.length_mm,
        broken_share: report.broken_share,
        unbroken_spans: report.unbroken_spans.iter().map(unbroken_span).collect(),
        unbroken_spans_not_listed: report.unbroken_spans_not_listed,
        min_spindle_rev_per_min: Some(report.spindle_rev_per_min[0]),
        max_spindle_rev_per_min: Some(report.spindle_rev_per_min[1]),
    }
}

const fn unbroken_span(span: &UnbrokenSpan) -> proto::UnbrokenSpan {
    proto::UnbrokenSpan {
        first_line: span.first_line,
        last_line: span.last_line,
        start_mm: span.start_mm,
        end_mm: span.end_mm,
        start_diameter_mm: span.start_diameter_mm,
        end_diameter_mm: span.end_diameter_mm,
        start_vibrations_per_rev: span.start_vibrations_per_rev,
        end_vibrations_per_rev: span.end_vibrations_per_rev,
    }
}

fn following(report: &FollowingReport) -> proto::FollowingReport {
    proto::FollowingReport {
        filter_gain: report.filter_gain,
        loop_gain: report.loop_gain,
        phase_lag_deg: report.phase_lag_rad.to_degrees(),
        arriving_amplitude_mm: report.arriving_amplitude_mm,
        largest_arriving_amplitude_mm: report.largest_arriving_amplitude_mm,
        amplitude_to_command_mm: report.amplitude_to_command_mm,
        lag_deg: report.lag_rad.to_degrees(),
        axes: report.axes.iter().map(axis_following).collect(),
        contour: report.contour.as_ref().map(contour),
    }
}

fn axis_following(own: &AxisFollowing) -> proto::AxisFollowing {
    proto::AxisFollowing {
        axis: axis_letter_to_proto(own.axis).into(),
        gain: own.gain,
        lag_deg: own.lag_rad.to_degrees(),
    }
}

const fn contour(contour: &FollowingContour) -> proto::FollowingContour {
    let FollowingContour { feed_mm, feed_line, vibration_mm, vibration_line, together_mm, unjudged_mm } = *contour;
    proto::FollowingContour { feed_mm, feed_line, vibration_mm, vibration_line, together_mm, unjudged_mm }
}
