//! From a thread to findings: one for each kind and block, with how many passes it concerns, the numbers of the worst one and
//! what cures it (docs/functions/thread-vibration.md, "Findings").

mod breaking;
mod demand;
mod start;

use feedwave_program::{Finding, FindingLog, SourceSpan};

use super::code;
use super::report::{CrestReport, ThreadPassReport};
use super::{RunUp, ThreadJob, ThreadLimits, ThreadPass, ThreadReport};
use crate::functions::sampling::{FINE_SAMPLES, Sampling, suggest_period};
use crate::shared::wording::{decimal, round_down, round_up};

/// Angles that differ by less count as equal, degrees: what a program can write is 0.001°.
const SAME_ANGLE_DEG: f64 = 0.01;
/// Lengths that differ by less count as equal, mm.
const SAME_LENGTH_MM: f64 = 1e-9;

/// All conditions of a thread whose quantities are possible.
pub(super) fn thread(
    job: &ThreadJob,
    limits: &ThreadLimits,
    work_is_assumed: bool,
    report: &ThreadReport,
    findings: &mut FindingLog,
) {
    let first = job.passes[0].span;
    lead(job, limits, report, first, findings);
    sampling(job, limits, report, first, findings);
    profile(job, work_is_assumed, findings);
    for (index, pass) in report.passes.iter().enumerate() {
        start::start(job, limits, index, pass, findings);
        if job.passes[index].vibrates() {
            demand::demand(job, limits, index, pass, findings);
            breaking::broken(job, limits, report, index, findings);
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
                .ranked("", velocity / limit)
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
                .ranked("", shortest.angle_deg / job.run_up.angle_deg)
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
        .ranked("", 1.0 / samples)
        .with_value("samples_per_vibration", samples, "")
        .with_value("frequency", report.frequency_hz, "Hz")
        .with_value("period", limits.period_s, "s");
    let cure = format!("turn at {} rev/min at most", decimal(speed, 1));
    let finding = suggest_period(finding, report.frequency_hz);
    findings.push(finding.suggest_value(cure, None, "spindle_speed", speed, "rev/min"));
}

/// A groove wider than the pitch takes the crest of its neighbours.
fn profile(job: &ThreadJob, work_is_assumed: bool, findings: &mut FindingLog) {
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
    let (code, message) = if work_is_assumed {
        (
            code::THREAD_PROFILE_WIDE_ASSUMED,
            format!(
                "{message}, if the first pass is {} mm deep: no word states the diameter of the work",
                decimal(job.passes[0].depth_mm.abs(), 3)
            ),
        )
    } else {
        (code::THREAD_PROFILE_WIDE, message)
    };
    findings.push(
        Finding::new(code, deepest.span, message)
            .ranked("", width_mm - pitch_mm)
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
    // A cure that lowers the crests is named where none ends them, too, with what is left.
    let remain = |crest_mm: f64, found_mm: f64| {
        let remain = format!("crests of {} mm remain", decimal(crest_mm, 3));
        let ends = found_mm <= permitted_mm + SAME_LENGTH_MM;
        if ends {
            return remain;
        }
        let [found, permitted] = [found_mm, permitted_mm].map(|value| decimal(value, 3));
        format!("{remain}, which is still too much: the finishing pass finds {found} mm, more than {permitted} mm")
    };
    let with_another_mm = crests.crest_with_another_pass_mm;
    if with_another_mm < crests.crest_mm - SAME_LENGTH_MM {
        let remain = remain(with_another_mm, crests.finishing_thickness_with_another_pass_mm);
        let cure = format!("add a vibrating pass at the same depth with opposite phase: {remain}");
        finding = finding.suggest_value(cure, None, "crest", with_another_mm, "mm");
    }
    let with_least_mm = crests.crest_with_least_amplitude_mm;
    if with_least_mm < crests.crest_mm - SAME_LENGTH_MM && crests.least_amplitude_mm > 0.0 {
        let (amplitude_mm, pass) = (round_up(crests.least_amplitude_mm + 1e-6, 4), &job.passes[crests.pass]);
        let remain = remain(with_least_mm, crests.finishing_thickness_with_least_amplitude_mm);
        let text = pass.amplitude_text(amplitude_mm, across);
        let cure = pass.cure_by_word(format!("vibrate with {text} in the last vibrating pass: {remain}"));
        finding = finding.suggest_value(cure, None, "amplitude", amplitude_mm, "mm");
    }
    findings.push(finding);
}
