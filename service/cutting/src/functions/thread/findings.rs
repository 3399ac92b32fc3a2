//! From a thread to findings: one for each kind and block, with how many passes it concerns, the numbers of the worst one and
//! what cures it (docs/functions/thread-vibration.md, "Findings").

mod breaking;
mod start;

use core::f64::consts::TAU;

use feedwave_program::{Finding, FindingLog, SourceSpan};

use super::code;
use super::report::{CrestReport, ThreadPassReport};
use super::{RunUp, START_JERK, StartUp, ThreadJob, ThreadLimits, ThreadPass, ThreadReport};
use crate::functions::axis_load::{AxisCodes, AxisLoad};
use crate::functions::sampling::{FINE_SAMPLES, Sampling, suggest_period};
use crate::shared::wording::{decimal, round_down, round_up};

/// Angles that differ by less count as equal, degrees: what a program can write is 0.001°.
const SAME_ANGLE_DEG: f64 = 0.01;
/// Tolerance for the rounding of computed limits, which are met exactly.
const ROUNDING: f64 = 1e-9;
const AXIS_CODES: AxisCodes =
    [code::THREAD_VIBRATION_VELOCITY, code::THREAD_VIBRATION_ACCELERATION, code::THREAD_VIBRATION_JERK];
/// Largest third difference of a step of acceleration at setpoints, as a share of the step over their period.
const STEP_OVER_PERIOD: f64 = 0.75;
/// Lengths that differ by less count as equal, mm.
const SAME_LENGTH_MM: f64 = 1e-9;

/// All conditions of a thread whose quantities are possible.
pub(super) fn thread(job: &ThreadJob, limits: &ThreadLimits, report: &ThreadReport, findings: &mut FindingLog) {
    let first = job.passes[0].span;
    lead(job, limits, report, first, findings);
    sampling(job, limits, report, first, findings);
    profile(job, findings);
    for (index, pass) in report.passes.iter().enumerate() {
        start::start(job, limits, index, pass, findings);
        if job.passes[index].vibrates() {
            axis(job, limits, index, findings);
            step(job, limits, index, findings);
            breaking::broken(job, report, index, findings);
        }
        load(job, limits, index, pass, findings);
    }
    if let Some(crests) = &report.crests {
        left_over(job, limits, crests, findings);
    }
}

fn lead(job: &ThreadJob, limits: &ThreadLimits, report: &ThreadReport, span: SourceSpan, findings: &mut FindingLog) {
    let (velocity, limit) = (report.lead_velocity_mm_per_s, limits.lead_velocity_mm_per_s);
    if velocity > limit {
        let speed = round_down(60.0 * limit / job.geometry.lead_mm, 1);
        let message = format!(
            "a lead of {} mm at {} rev/min moves the lead axis with {} mm/s, whose limit is {} mm/s",
            decimal(job.geometry.lead_mm, 4),
            decimal(job.spindle_rev_per_min, 1),
            decimal(velocity, 3),
            decimal(limit, 3)
        );
        findings.push(
            Finding::new(code::THREAD_LEAD_SPEED, span, message)
                .with_value("velocity", velocity, "mm/s")
                .with_value("limit", limit, "mm/s")
                .suggest_value(
                    format!("turn at {} rev/min at most", decimal(speed, 1)),
                    None,
                    "spindle_speed",
                    speed,
                    "rev/min",
                ),
        );
    }
    let rev_per_s = job.spindle_rev_per_min / 60.0;
    let shortest =
        RunUp::within(job.geometry.lead_mm, rev_per_s, limits.lead_acceleration_mm_per_s2, limits.lead_jerk_mm_per_s3);
    // Computed limits are met exactly.
    if shortest.angle_deg > job.run_up.angle_deg * (1.0 + 1e-9) {
        let needed_deg = round_up(shortest.angle_deg, 3);
        let message = format!(
            "the lead axis reaches its speed over {} degrees of the spindle at the earliest, not over {}",
            decimal(needed_deg, 3),
            decimal(job.run_up.angle_deg, 3)
        );
        findings.push(
            Finding::new(code::THREAD_RUN_UP, span, message)
                .with_value("run_up_angle", job.run_up.angle_deg, "deg")
                .with_value("least", shortest.angle_deg, "deg")
                .suggest_value(
                    format!("accelerate over {} degrees", decimal(needed_deg, 3)),
                    None,
                    "run_up_angle",
                    needed_deg,
                    "deg",
                ),
        );
    }
}

fn sampling(
    job: &ThreadJob,
    limits: &ThreadLimits,
    report: &ThreadReport,
    span: SourceSpan,
    findings: &mut FindingLog,
) {
    if limits.period_s <= 0.0 || !job.passes.iter().any(ThreadPass::vibrates) {
        return;
    }
    let samples = 1.0 / (report.frequency_hz * limits.period_s);
    let sampling = Sampling::of(samples);
    if sampling == Sampling::Fine {
        return;
    }
    let speed = round_down(60.0 / (FINE_SAMPLES * limits.period_s * job.vibrations_per_rev), 1);
    let message = format!(
        "{} vibrations per revolution at {} rev/min are sampled {} times each at a period of {} ms",
        decimal(job.vibrations_per_rev, 3),
        decimal(job.spindle_rev_per_min, 1),
        decimal(samples, 2),
        decimal(limits.period_s * 1_000.0, 4)
    );
    let finding = if sampling == Sampling::BelowNyquist {
        Finding::new(code::THREAD_SAMPLING_NYQUIST, span, message)
    } else {
        Finding::new(code::THREAD_SAMPLING_COARSE, span, message)
    };
    let finding = finding
        .with_value("samples_per_vibration", samples, "")
        .with_value("frequency", report.frequency_hz, "Hz")
        .with_value("period", limits.period_s, "s");
    let cure = format!("turn at {} rev/min at most", decimal(speed, 1));
    let finding = suggest_period(finding, report.frequency_hz);
    findings.push(finding.suggest_value(cure, None, "spindle_speed", speed, "rev/min"));
}

/// A groove wider than the pitch takes the crest of its neighbours.
fn profile(job: &ThreadJob, findings: &mut FindingLog) {
    let pitch_mm = job.geometry.pitch_mm();
    let Some(deepest) = job.passes.iter().max_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm)) else { return };
    let width_mm = job.profile.width_mm(deepest.depth_mm);
    if width_mm <= pitch_mm + SAME_LENGTH_MM {
        return;
    }
    let permitted_mm = round_down((pitch_mm - job.profile.root_flat_mm) / (2.0 * job.profile.tan_half_angle()), 3);
    let message = format!(
        "at a depth of {} mm the groove is {} mm wide, more than the pitch of {} mm",
        decimal(deepest.depth_mm, 3),
        decimal(width_mm, 3),
        decimal(pitch_mm, 3)
    );
    findings.push(
        Finding::new(code::THREAD_PROFILE_WIDE, deepest.span, message)
            .with_value("width", width_mm, "mm")
            .with_value("pitch", pitch_mm, "mm")
            .with_value("depth", deepest.depth_mm, "mm")
            .suggest_value(
                format!("cut at most {} mm deep", decimal(permitted_mm, 3)),
                None,
                "depth",
                permitted_mm,
                "mm",
            ),
    );
}

/// Number of a pass in findings, counted from 1.
const fn number(index: usize) -> u64 {
    index as u64 + 1
}

/// What the vibration asks of the axis across the lead: peaks of (A/2)·sin at D·n.
fn axis(job: &ThreadJob, limits: &ThreadLimits, index: usize, findings: &mut FindingLog) {
    let pass = &job.passes[index];
    let lead_axis = job.geometry.lead_axis;
    let across = lead_axis.across_words();
    let rad_per_s = TAU * job.frequency_hz();
    let velocity = 0.5 * pass.amplitude_mm * rad_per_s;
    // On a taper it follows the lead as well.
    let taper = job.geometry.taper.abs() * job.geometry.lead_mm * job.spindle_rev_per_min / 60.0;
    // A start in the middle of the wave adds to the jerk only.
    let starts_within = job.start_up == StartUp::Preparatory && job.wave(pass).starts_within();
    let start_jerk = if starts_within { 1.0 + START_JERK } else { 1.0 };
    let demanded = [velocity + taper, velocity * rad_per_s, start_jerk * velocity * rad_per_s * rad_per_s];
    let limits =
        [limits.vibration_velocity_mm_per_s, limits.vibration_acceleration_mm_per_s2, limits.vibration_jerk_mm_per_s3];
    for load in AxisLoad::of_linear(demanded, limits).into_iter().filter(|load| load.exceeds(ROUNDING)) {
        let AxisLoad { quantity, demanded, limit, .. } = load;
        let message = format!(
            "the vibration of pass {} takes {} {} of {}' {quantity}, whose limit is {}",
            index + 1,
            decimal(demanded, 1),
            load.unit(),
            lead_axis.across().letter(),
            decimal(limit, 1)
        );
        let finding = Finding::new(load.code(&AXIS_CODES), pass.amplitude_span(), message).at("pass", number(index));
        let finding = load.with_numbers(finding, "");
        let order = load.order();
        let permitted_mm = round_down(pass.amplitude_mm * share(demanded, limit, taper, order), 4);
        let finding = if permitted_mm > 0.0 {
            let cure = format!("the axis can follow {}", pass.amplitude_text(permitted_mm, across));
            finding.suggest_value(cure, pass.amplitude_replacement(permitted_mm), "amplitude", permitted_mm, "mm")
        } else {
            finding
        };
        let speed = round_down(job.spindle_rev_per_min * libm::pow(limit / demanded, 1.0 / order), 1);
        let cure = format!("turn at {} rev/min at most", decimal(speed, 1));
        findings.push(finding.suggest_value(cure, None, "spindle_speed", speed, "rev/min"));
    }
}

/// What the ends of the vibration ask of the axis across the lead: it starts from rest, and comes to rest, at its whole
/// acceleration (A/2)·(2πDn)². Setpoints spread the step over the period T: their third difference is up to ¾ of it over T,
/// the peak of the quadratic B-spline.
fn step(job: &ThreadJob, limits: &ThreadLimits, index: usize, findings: &mut FindingLog) {
    if limits.period_s <= 0.0 {
        return;
    }
    let pass = &job.passes[index];
    let rad_per_s = TAU * job.frequency_hz();
    let step = 0.5 * pass.amplitude_mm * rad_per_s * rad_per_s;
    let (jerk, limit) = (STEP_OVER_PERIOD * step / limits.period_s, limits.vibration_jerk_mm_per_s3);
    if jerk <= limit * (1.0 + ROUNDING) {
        return;
    }
    let message = format!(
        "the vibration of pass {} starts or ends with its whole acceleration of {} mm/s²: at this period a jerk of up to {} \
         mm/s³ of {}, whose limit is {}",
        number(index),
        decimal(step, 1),
        decimal(jerk, 0),
        job.geometry.lead_axis.across().letter(),
        decimal(limit, 0)
    );
    let share = limit / jerk;
    let mut finding = Finding::new(code::THREAD_VIBRATION_STEP, pass.amplitude_span(), message)
        .at("pass", number(index))
        .ranked("", jerk / limit)
        .with_value("step", step, "mm/s²")
        .with_value("jerk", jerk, "mm/s³")
        .with_value("limit", limit, "mm/s³");
    let permitted_mm = round_down(pass.amplitude_mm * share, 4);
    if permitted_mm > 0.0 {
        let across = job.geometry.lead_axis.across_words();
        let cure = format!("within the limit are {}", pass.amplitude_text(permitted_mm, across));
        let word = pass.amplitude_replacement(permitted_mm);
        finding = finding.suggest_value(cure, word, "amplitude", permitted_mm, "mm");
    }
    let speed = round_down(job.spindle_rev_per_min * libm::sqrt(share), 1);
    let cure = format!("turn at {} rev/min at most", decimal(speed, 1));
    findings.push(finding.suggest_value(cure, None, "spindle_speed", speed, "rev/min"));
}

/// Share of the amplitude that keeps a limit; the taper takes its part of the velocity first.
fn share(demanded: f64, limit: f64, taper: f64, order: f64) -> f64 {
    if order > 1.0 { limit / demanded } else { (limit - taper) / (demanded - taper) }
}

/// Load of the tool; and passes that cut nothing.
fn load(job: &ThreadJob, limits: &ThreadLimits, index: usize, report: &ThreadPassReport, findings: &mut FindingLog) {
    let (pass, number) = (&job.passes[index], number(index));
    let thickness_mm = report.section.largest_thickness_mm;
    if thickness_mm > limits.thickness_mm + SAME_LENGTH_MM {
        let message = format!(
            "pass {number} takes up to {} mm {}, more than the tool withstands ({} mm)",
            decimal(thickness_mm, 3),
            job.geometry.lead_axis.across_words(),
            decimal(limits.thickness_mm, 3)
        );
        findings.push(
            Finding::new(code::THREAD_THICKNESS, pass.span, message)
                .at("pass", number)
                .ranked("", thickness_mm)
                .with_value("thickness", thickness_mm, "mm")
                .with_value("limit", limits.thickness_mm, "mm")
                .suggest("cut the thread in more passes, or with smaller amplitudes"),
        );
    } else if thickness_mm <= SAME_LENGTH_MM {
        let message = format!("pass {number} cuts nothing that earlier passes left");
        findings.push(
            Finding::new(code::THREAD_PASS_AIR, pass.span, message)
                .at("pass", number)
                .ranked("", 0.0)
                .suggest("leave the pass out"),
        );
    }
}

/// Crests for the finishing pass.
fn left_over(job: &ThreadJob, limits: &ThreadLimits, crests: &CrestReport, findings: &mut FindingLog) {
    let across = job.geometry.lead_axis.across_words();
    let permitted_mm = limits.finishing_thickness_mm.unwrap_or(2.0 * crests.finishing_infeed_mm);
    if crests.finishing_thickness_mm <= permitted_mm + SAME_LENGTH_MM {
        return;
    }
    let message = format!(
        "the vibrating passes leave crests of {} mm {across}; the finishing infeed is {} mm",
        decimal(crests.crest_mm, 3),
        decimal(crests.finishing_infeed_mm, 3)
    );
    let mut finding = Finding::new(code::THREAD_CRESTS, job.passes[crests.pass].span, message)
        .ranked("", crests.crest_mm)
        .with_value("crest", crests.crest_mm, "mm")
        .with_value("section_crest", crests.section_crest_mm, "mm")
        .with_value("finishing_infeed", crests.finishing_infeed_mm, "mm")
        .with_value("finishing_thickness", crests.finishing_thickness_mm, "mm")
        .with_value("permitted", permitted_mm, "mm");
    if crests.crest_with_another_pass_mm < crests.crest_mm - SAME_LENGTH_MM {
        let cure = format!(
            "add a vibrating pass at the same depth with opposite phase: crests of {} mm remain",
            decimal(crests.crest_with_another_pass_mm, 3)
        );
        finding = finding.suggest_value(cure, None, "crest", crests.crest_with_another_pass_mm, "mm");
    }
    if crests.crest_with_least_amplitude_mm < crests.crest_mm - SAME_LENGTH_MM && crests.least_amplitude_mm > 0.0 {
        let amplitude_mm = round_up(crests.least_amplitude_mm + 1e-6, 4);
        let cure = format!(
            "vibrate with {} in the last vibrating pass: crests of {} mm remain",
            job.passes[crests.pass].amplitude_text(amplitude_mm, across),
            decimal(crests.crest_with_least_amplitude_mm, 3)
        );
        finding = finding.suggest_value(cure, None, "amplitude", amplitude_mm, "mm");
    }
    findings.push(finding);
}
