//! Quantities of a thread that must be possible before anything is computed from them.

use feedwave_program::{Finding, FindingLog, SourceSpan};

use super::code;
use super::{LeadAxis, MAX_THREAD_PASSES, ThreadJob, ThreadLimits};
use crate::shared::wording::decimal;

/// A quantity that is not what it must be.
pub(super) fn refusal(
    span: SourceSpan,
    name: &'static str,
    value: f64,
    unit: &'static str,
    permitted: &str,
) -> Finding {
    let message = format!("{} is {}: it must be {permitted}", name.replace('_', " "), decimal(value, 6));
    Finding::new(code::THREAD_PARAMETER, span, message)
        .ranked(name, value.abs())
        .with_value(name, value, unit)
        .suggest(format!("state a value that is {permitted}"))
}

/// Quantities without which nothing can be computed.
// As long as the list of quantities: every condition is one line.
pub(super) fn parameters(job: &ThreadJob, limits: &ThreadLimits, findings: &mut FindingLog) {
    let span = job.passes.first().map_or_else(SourceSpan::default, |pass| pass.span);
    let geometry = &job.geometry;
    let mut refuse = |name: &'static str, value: f64, unit: &'static str, permitted: &str| {
        findings.push(refusal(span, name, value, unit, permitted));
    };
    let length_mm = geometry.length_mm();
    let is_along_z = geometry.lead_axis == LeadAxis::Z;
    for (name, value, unit) in [
        ("lead", geometry.lead_mm, "mm"),
        ("thread_length", length_mm, "mm"),
        ("vibrations_per_rev", job.vibrations_per_rev, ""),
        ("spindle_speed", job.spindle_rev_per_min, "rev/min"),
    ] {
        if !(1e-3..=1e6).contains(&value) {
            refuse(name, value, unit, "from 0.001 to 1000000");
        }
    }
    match geometry.lead_axis {
        LeadAxis::Z if !(1e-3..=1e6).contains(&(2.0 * geometry.work_mm)) => {
            refuse("work_diameter", 2.0 * geometry.work_mm, "mm", "from 0.001 to 1000000");
        }
        LeadAxis::X if geometry.work_mm.is_nan() || geometry.work_mm.abs() > 1e6 => {
            refuse("face", geometry.work_mm, "mm", "a finite place");
        }
        LeadAxis::Z | LeadAxis::X => {}
    }
    if geometry.taper.is_nan() || geometry.taper.abs() > 1.0 || geometry.taper.abs() == 1.0 && is_along_z {
        refuse(
            "taper",
            geometry.taper,
            "",
            "below 1 in either direction: a steeper thread has its lead along the other axis",
        );
    }
    let angle_deg = job.profile.included_angle_deg;
    if !(1.0..=170.0).contains(&angle_deg) {
        refuse("included_angle", angle_deg, "deg", "from 1 to 170");
    } else if geometry.taper.abs() * job.profile.tan_half_angle() >= 1.0 {
        refuse("taper", geometry.taper, "", "less steep than the flanks of the tool");
    }
    if !(job.profile.root_flat_mm >= 0.0 && job.profile.root_flat_mm < geometry.pitch_mm()) {
        refuse("root_flat", job.profile.root_flat_mm, "mm", "from 0 to below the pitch");
    }
    if !(1..=MAX_THREAD_PASSES as u32).contains(&geometry.starts) {
        refuse("starts", f64::from(geometry.starts), "", "from 1 to 100");
    }
    if !(1..=MAX_THREAD_PASSES).contains(&job.passes.len()) {
        refuse("passes", job.passes.len() as f64, "", "from 1 to 100");
    }
    if !(job.run_up.angle_deg >= 0.0 && job.run_up.angle_deg <= 360_000.0) {
        refuse("run_up_angle", job.run_up.angle_deg, "deg", "from 0 to 360000");
    }
    if !(geometry.start_mm.abs() <= 1e6 && geometry.end_mm.abs() <= 1e6) {
        refuse("start", geometry.start_mm, "mm", "a finite place, as the end must be");
    }
    for (name, value, unit) in [
        ("lead_velocity", limits.lead_velocity_mm_per_s, "mm/s"),
        ("lead_acceleration", limits.lead_acceleration_mm_per_s2, "mm/s²"),
        ("lead_jerk", limits.lead_jerk_mm_per_s3, "mm/s³"),
        ("vibration_velocity", limits.vibration_velocity_mm_per_s, "mm/s"),
        ("vibration_acceleration", limits.vibration_acceleration_mm_per_s2, "mm/s²"),
        ("vibration_jerk", limits.vibration_jerk_mm_per_s3, "mm/s³"),
        ("thickness", limits.thickness_mm, "mm"),
    ] {
        if value.is_nan() || value <= 0.0 {
            refuse(name, value, unit, "above 0");
        }
    }
    if !(limits.period_s >= 0.0 && limits.period_s.is_finite()) {
        refuse("period", limits.period_s, "s", "0 or above");
    }
    if limits.finishing_thickness_mm.is_some_and(|value| value.is_nan() || value <= 0.0) {
        refuse("finishing_thickness", limits.finishing_thickness_mm.unwrap_or(0.0), "mm", "above 0");
    }
    if limits.approach_mm.is_nan() {
        refuse("approach", limits.approach_mm, "mm", "a number");
    }
    // Depths are compared with the widest groove, so that no later formula meets a tool beyond its axis.
    let deepest_mm = if is_along_z && geometry.inwards() > 0.0 { geometry.work_mm } else { 1e4 };
    for pass in job.passes.iter().take(MAX_THREAD_PASSES) {
        if !(pass.depth_mm >= 0.0 && pass.depth_mm < deepest_mm) {
            refuse("depth", pass.depth_mm, "mm", "0 or above, and less than the work's radius");
        }
        if !(pass.amplitude_mm >= 0.0 && pass.amplitude_mm <= 1e3) {
            refuse("amplitude", pass.amplitude_mm, "mm", "from 0 to 1000");
        }
        if !(-1e6..=1e6).contains(&pass.phase_shift_deg) {
            refuse("phase_shift", pass.phase_shift_deg, "deg", "an angle");
        }
        if !(-1e6..=1e6).contains(&pass.start_angle_deg) {
            refuse("start_angle", pass.start_angle_deg, "deg", "an angle");
        }
        if !(pass.start_travel_mm.abs() <= 1e6 && pass.start_travel_mm < length_mm) {
            refuse("start_travel", pass.start_travel_mm, "mm", "before the end of the thread");
        }
        if pass.start >= geometry.starts {
            refuse("start", f64::from(pass.start), "", "one of the thread's starts, counted from 0");
        }
    }
}
