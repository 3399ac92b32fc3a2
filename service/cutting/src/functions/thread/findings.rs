//! From a thread to findings: one for each kind and block, with how many passes it concerns, the numbers of the worst one and
//! what cures it (docs/functions/thread-vibration.md, "Findings").

use core::f64::consts::TAU;

use feedwave_program::{Finding, FindingLog, SourceSpan};

use super::code;
use super::report::{CrestReport, ThreadPassReport};
use super::{RunUp, StartUp, ThreadJob, ThreadLimits, ThreadPass, ThreadReport, reduce_deg};
use crate::functions::axis_load::{AxisCodes, AxisLoad};
use crate::functions::sampling::{FINE_SAMPLES, Sampling, suggest_period};
use crate::shared::wording::{decimal, round_down, round_up};

/// Angles that differ by less count as equal, degrees: what a program can write is 0.001°.
const SAME_ANGLE_DEG: f64 = 0.01;
/// Tolerance for the rounding of computed limits, which are met exactly.
const ROUNDING: f64 = 1e-9;
const AXIS_CODES: AxisCodes =
    [code::THREAD_VIBRATION_VELOCITY, code::THREAD_VIBRATION_ACCELERATION, code::THREAD_VIBRATION_JERK];
/// Lengths that differ by less count as equal, mm.
const SAME_LENGTH_MM: f64 = 1e-9;

/// All conditions of a thread whose quantities are possible.
pub(super) fn thread(job: &ThreadJob, limits: &ThreadLimits, report: &ThreadReport, findings: &mut FindingLog) {
    let first = job.passes[0].span;
    lead(job, limits, report, first, findings);
    sampling(job, limits, report, first, findings);
    profile(job, findings);
    for (index, pass) in report.passes.iter().enumerate() {
        start(job, limits, index, pass, findings);
        if job.passes[index].vibrates() {
            axis(job, limits, index, findings);
            broken(job, report, index, findings);
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

/// How a pass starts.
fn start(job: &ThreadJob, limits: &ThreadLimits, index: usize, report: &ThreadPassReport, findings: &mut FindingLog) {
    start_angle(job, index, findings);
    approach(job, limits, index, findings);
    exact_length(job, index, findings);
    turn_phase(job, index, report, findings);
    late(job, limits, index, report, findings);
}

/// A start angle is within a revolution.
fn start_angle(job: &ThreadJob, index: usize, findings: &mut FindingLog) {
    let (pass, number) = (&job.passes[index], number(index));
    if !(0.0..360.0).contains(&pass.start_angle_deg) {
        let reduced_deg = reduce_deg(pass.start_angle_deg);
        let message = format!(
            "the start angle of pass {number} is {} degrees, outside 0 to 360",
            decimal(pass.start_angle_deg, 3)
        );
        findings.push(
            Finding::new(code::THREAD_START_ANGLE, pass.span, message)
                .at("pass", number)
                .ranked("", pass.start_angle_deg.abs())
                .with_value("start_angle", pass.start_angle_deg, "deg")
                .suggest_value(
                    format!("the same place on the spindle is {} degrees", decimal(reduced_deg, 3)),
                    None,
                    "start_angle",
                    reduced_deg,
                    "deg",
                ),
        );
    }
}

/// The lead axis comes into step before the work.
fn approach(job: &ThreadJob, limits: &ThreadLimits, index: usize, findings: &mut FindingLog) {
    let (pass, number) = (&job.passes[index], number(index));
    let run_up_mm = job.run_up.travel_mm(job.geometry.lead_mm);
    let travel_mm = limits.approach_mm - pass.start_travel_mm;
    if run_up_mm > travel_mm {
        let message = format!(
            "pass {number} starts {} mm before the work, but the lead axis needs {} mm to come into step",
            decimal(travel_mm, 3),
            decimal(run_up_mm, 3)
        );
        let needed_mm = round_up(run_up_mm + pass.start_travel_mm, 3);
        findings.push(
            Finding::new(code::THREAD_APPROACH_SHORT, pass.span, message)
                .at("pass", number)
                .ranked("", run_up_mm - travel_mm)
                .with_value("approach", travel_mm, "mm")
                .with_value("run_up", run_up_mm, "mm")
                .suggest_value(
                    format!("start the thread {} mm before the work", decimal(needed_mm, 3)),
                    None,
                    "approach",
                    needed_mm,
                    "mm",
                )
                .suggest("turn slower"),
        );
    }
}

/// Some length has the exact lead.
fn exact_length(job: &ThreadJob, index: usize, findings: &mut FindingLog) {
    let (pass, number) = (&job.passes[index], number(index));
    let exact_mm = job.exact_length_mm(pass);
    if exact_mm <= 0.0 {
        let length_mm = job.geometry.length_mm() - pass.start_travel_mm;
        let message = format!(
            "pass {number} is {} mm long, but its lead is not exact for less than {} mm at both ends together",
            decimal(length_mm, 3),
            decimal(length_mm - exact_mm, 3)
        );
        findings.push(
            Finding::new(code::THREAD_LENGTH_SHORT, pass.span, message)
                .at("pass", number)
                .ranked("", -exact_mm)
                .with_value("length", length_mm, "mm")
                .with_value("wrong_length", length_mm - exact_mm, "mm")
                .suggest("turn slower")
                .suggest("start further before the work, or end further behind it"),
        );
    }
}

/// A pass that comes to its place turns later has another phase there.
fn turn_phase(job: &ThreadJob, index: usize, report: &ThreadPassReport, findings: &mut FindingLog) {
    let (pass, number) = (&job.passes[index], number(index));
    let programmed_deg = reduce_deg(pass.phase_shift_deg);
    let moved_deg = reduce_deg(report.place.phase_shift_deg - programmed_deg);
    if pass.vibrates() && report.place.turns_later != 0 && moved_deg.min(360.0 - moved_deg) > SAME_ANGLE_DEG {
        let cure_deg = reduce_deg(2.0 * programmed_deg - report.place.phase_shift_deg);
        let message = format!(
            "pass {number} comes to its place on the work {} revolution later: with D = {} its phase shift there is {} \
             degrees, not {}",
            report.place.turns_later,
            decimal(job.vibrations_per_rev, 4),
            decimal(report.place.phase_shift_deg, 3),
            decimal(programmed_deg, 3)
        );
        findings.push(
            Finding::new(code::THREAD_TURN_PHASE, pass.span, message)
                .at("pass", number)
                .ranked("", moved_deg.min(360.0 - moved_deg))
                .with_value("turns", report.place.turns_later as f64, "")
                .with_value("programmed_shift", programmed_deg, "deg")
                .with_value("actual_shift", report.place.phase_shift_deg, "deg")
                .suggest_value(
                    format!("program a shift of {} degrees", decimal(cure_deg, 3)),
                    None,
                    "phase_shift",
                    cure_deg,
                    "deg",
                ),
        );
    }
}

/// A vibration that starts later than the lead axis starts before the work.
fn late(job: &ThreadJob, limits: &ThreadLimits, index: usize, report: &ThreadPassReport, findings: &mut FindingLog) {
    let (pass, number) = (&job.passes[index], number(index));
    let still_deg = report.delay_deg - pass.start_angle_deg;
    if job.start_up == StartUp::Delayed && pass.vibrates() && still_deg > 0.0 {
        let still_mm = job.run_up.synchronous_deg(still_deg) * job.geometry.lead_mm / 360.0;
        if still_mm > limits.approach_mm - pass.start_travel_mm {
            let message = format!(
                "the vibration of pass {number} starts {} degrees after the lead axis, in the work already",
                decimal(still_deg, 3)
            );
            findings.push(
                Finding::new(code::THREAD_VIBRATION_LATE, pass.span, message)
                    .at("pass", number)
                    .ranked("", still_mm + pass.start_travel_mm)
                    .with_value("delay", report.delay_deg, "deg")
                    .with_value("travel", still_mm, "mm")
                    .suggest("use the start-up with preparatory movement, or start further before the work"),
            );
        }
    }
}

/// Number of a pass in findings, counted from 1.
const fn number(index: usize) -> u64 {
    index as u64 + 1
}

/// What the vibration asks of X: peaks of (A/2)·sin at D·n.
fn axis(job: &ThreadJob, limits: &ThreadLimits, index: usize, findings: &mut FindingLog) {
    let pass = &job.passes[index];
    let rad_per_s = TAU * job.frequency_hz();
    let velocity = 0.5 * pass.amplitude_mm * rad_per_s;
    // On a taper X follows the lead as well.
    let taper = job.geometry.taper.abs() * job.geometry.lead_mm * job.spindle_rev_per_min / 60.0;
    let demanded = [velocity + taper, velocity * rad_per_s, velocity * rad_per_s * rad_per_s];
    let limits =
        [limits.vibration_velocity_mm_per_s, limits.vibration_acceleration_mm_per_s2, limits.vibration_jerk_mm_per_s3];
    for load in AxisLoad::of_linear(demanded, limits).into_iter().filter(|load| load.exceeds(ROUNDING)) {
        let AxisLoad { quantity, demanded, limit, .. } = load;
        let message = format!(
            "the vibration of pass {} takes {} {} of X' {quantity}, whose limit is {}",
            index + 1,
            decimal(demanded, 1),
            load.unit(),
            decimal(limit, 1)
        );
        let finding = Finding::new(load.code(&AXIS_CODES), pass.span, message).at("pass", number(index));
        let finding = load.with_numbers(finding, "");
        let order = load.order();
        let permitted_mm = round_down(pass.amplitude_mm * share(demanded, limit, taper, order), 4);
        let finding = if permitted_mm > 0.0 {
            let cure = format!("the axis can follow {} mm on the radius", decimal(permitted_mm, 4));
            finding.suggest_value(cure, None, "amplitude", permitted_mm, "mm")
        } else {
            finding
        };
        let speed = round_down(job.spindle_rev_per_min * libm::pow(limit / demanded, 1.0 / order), 1);
        let cure = format!("turn at {} rev/min at most", decimal(speed, 1));
        findings.push(finding.suggest_value(cure, None, "spindle_speed", speed, "rev/min"));
    }
}

/// Share of the amplitude that keeps a limit; the taper takes its part of the velocity first.
fn share(demanded: f64, limit: f64, taper: f64, order: f64) -> f64 {
    if order > 1.0 { limit / demanded } else { (limit - taper) / (demanded - taper) }
}

/// Whether the chip of a vibrating pass is cut through, and if not, why.
fn broken(job: &ThreadJob, report: &ThreadReport, index: usize, findings: &mut FindingLog) {
    let (pass, own) = (&job.passes[index], &report.passes[index]);
    let before = job.passes[..index].iter().rposition(|before| before.start == pass.start);
    if own.amplitude_mm <= own.infeed_mm + SAME_LENGTH_MM {
        amplitude_small(pass, own, index, before, findings);
    } else if !own.depth.broken
        && let Some(before) = before
    {
        phase_unbroken(pass, report, index, before, findings);
    } else if own.depth.broken && !own.section.broken {
        ribbon(pass, report, index, findings);
    }
}

/// The worst pass is the one that lacks most of its amplitude.
fn with_amplitude(finding: Finding, number: u64, own: &ThreadPassReport, least_mm: f64) -> Finding {
    finding
        .at("pass", number)
        .ranked("", least_mm - own.amplitude_mm)
        .with_value("infeed", own.infeed_mm, "mm")
        .with_value("amplitude", own.amplitude_mm, "mm")
}

fn suggest_amplitude(finding: Finding, least_mm: f64) -> Finding {
    let least_mm = round_up(least_mm + 1e-6, 4);
    let cure = format!("vibrate with more than {} mm on the radius", decimal(least_mm, 4));
    finding.suggest_value(cure, None, "amplitude", least_mm, "mm")
}

/// The vibration does not reach beyond what the pass cuts.
fn amplitude_small(
    pass: &ThreadPass,
    own: &ThreadPassReport,
    index: usize,
    before: Option<usize>,
    findings: &mut FindingLog,
) {
    let number = number(index);
    let (code, what) = match before {
        None => (code::THREAD_FIRST_PASS, "does not leave the work diameter"),
        Some(_) => (code::THREAD_AMPLITUDE_SMALL, "does not reach beyond its infeed"),
    };
    let message = format!(
        "the vibration of pass {number} {what}: amplitude {} mm, infeed {} mm on the radius",
        decimal(own.amplitude_mm, 4),
        decimal(own.infeed_mm, 4)
    );
    let least_mm = own.depth.least_amplitude_mm.max(own.infeed_mm);
    let finding = with_amplitude(Finding::new(code, pass.span, message), number, own, least_mm);
    findings.push(suggest_amplitude(finding, least_mm));
}

/// The pass vibrates too much in step with the one before.
fn phase_unbroken(pass: &ThreadPass, report: &ThreadReport, index: usize, before: usize, findings: &mut FindingLog) {
    let (own, number) = (&report.passes[index], number(index));
    let shift_before = report.passes[before].place.phase_shift_deg;
    let difference_deg = reduce_deg(own.place.phase_shift_deg - shift_before);
    // What has to be programmed to be opposite to the pass before, whatever the turns in between.
    let cure_deg = reduce_deg(pass.phase_shift_deg + 180.0 - difference_deg);
    let equal = difference_deg.min(360.0 - difference_deg) <= SAME_ANGLE_DEG;
    let code = if equal { code::THREAD_PHASE_EQUAL } else { code::THREAD_PHASE_UNBROKEN };
    let message = format!(
        "passes {} and {number} are {} degrees apart in phase at the same place on the work: the chip of pass \
         {number} is not cut through",
        before + 1,
        decimal(difference_deg, 3)
    );
    let finding = with_amplitude(Finding::new(code, pass.span, message), number, own, own.depth.least_amplitude_mm)
        .with_value("phase_difference", difference_deg, "deg")
        .suggest_value(
            format!("shift the phase by {} degrees", decimal(cure_deg, 3)),
            None,
            "phase_shift",
            cure_deg,
            "deg",
        );
    findings.push(suggest_amplitude(finding, own.depth.least_amplitude_mm));
}

/// The chip is cut through at its depth, but not over the whole section.
fn ribbon(pass: &ThreadPass, report: &ThreadReport, index: usize, findings: &mut FindingLog) {
    let (own, number) = (&report.passes[index], number(index));
    let least_mm = own.section.least_amplitude_mm;
    let message = format!(
        "the chip of pass {number} holds together at the flank: the full section needs an amplitude of {} mm on \
         the radius, not {}",
        decimal(round_up(least_mm, 4), 4),
        decimal(own.amplitude_mm, 4)
    );
    let finding = with_amplitude(Finding::new(code::THREAD_CHIP_RIBBON, pass.span, message), number, own, least_mm)
        .with_value("section_amplitude", least_mm, "mm");
    let finding = suggest_amplitude(finding, least_mm);
    let finding = match report.least_section_ratio.map(|ratio| round_up(ratio, 2)) {
        Some(ratio) => {
            let cure = format!("use a ratio of {} for all passes", decimal(ratio, 2));
            finding.suggest_value(cure, None, "ratio", ratio, "")
        }
        None => finding,
    };
    findings.push(finding.suggest("come straight in: radial infeed leaves no ribbon"));
}

/// Load of the tool; and passes that cut nothing.
fn load(job: &ThreadJob, limits: &ThreadLimits, index: usize, report: &ThreadPassReport, findings: &mut FindingLog) {
    let (pass, number) = (&job.passes[index], number(index));
    let thickness_mm = report.section.largest_thickness_mm;
    if thickness_mm > limits.thickness_mm + SAME_LENGTH_MM {
        let message = format!(
            "pass {number} takes up to {} mm on the radius, more than the tool withstands ({} mm)",
            decimal(thickness_mm, 3),
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
    let permitted_mm = limits.finishing_thickness_mm.unwrap_or(2.0 * crests.finishing_infeed_mm);
    if crests.finishing_thickness_mm <= permitted_mm + SAME_LENGTH_MM {
        return;
    }
    let message = format!(
        "the vibrating passes leave crests of {} mm on the radius; the finishing infeed is {} mm",
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
            "vibrate with {} mm on the radius in the last vibrating pass: crests of {} mm remain",
            decimal(amplitude_mm, 4),
            decimal(crests.crest_with_least_amplitude_mm, 3)
        );
        finding = finding.suggest_value(cure, None, "amplitude", amplitude_mm, "mm");
    }
    findings.push(finding);
}
