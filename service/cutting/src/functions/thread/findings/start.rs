//! How a pass starts: its angle, the way to come into step, and the phase that it meets its place with.

use feedwave_program::{Finding, FindingLog};

use super::{SAME_ANGLE_DEG, number};
use crate::functions::thread::chip::chip;
use crate::functions::thread::report::ThreadPassReport;
use crate::functions::thread::{ChipLevel, StartUp, ThreadJob, ThreadLimits, code, reduce_deg};
use crate::shared::wording::{decimal, round_up};

/// All conditions of the start of a pass.
pub(super) fn start(
    job: &ThreadJob,
    limits: &ThreadLimits,
    index: usize,
    report: &ThreadPassReport,
    findings: &mut FindingLog,
) {
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
        let finding = Finding::new(code::THREAD_TURN_PHASE, pass.span, message)
            .at("pass", number)
            .ranked("", moved_deg.min(360.0 - moved_deg))
            .with_value("turns", report.place.turns_later as f64, "")
            .with_value("programmed_shift", programmed_deg, "deg")
            .with_value("actual_shift", report.place.phase_shift_deg, "deg");
        findings.push(if breaks_less(job, index, cure_deg) {
            let there = decimal(programmed_deg, 3);
            finding.suggest(format!(
                "leave it so: with {there} degrees there the chip would not be cut through, as it is now"
            ))
        } else {
            let cure = pass.cure_by_word(format!("program a shift of {} degrees", decimal(cure_deg, 3)));
            finding.suggest_value(cure, None, "phase_shift", cure_deg, "deg")
        });
    }
}

/// Whether the chip of a pass breaks now, and would not with another phase shift. Passes behind it have findings of their own.
fn breaks_less(job: &ThreadJob, index: usize, phase_shift_deg: f64) -> bool {
    let mut changed = job.clone();
    changed.passes[index].phase_shift_deg = phase_shift_deg;
    chip(job, index, ChipLevel::Depth).broken && !chip(&changed, index, ChipLevel::Depth).broken
}

/// A vibration that has its phase later than the lead axis comes to the work.
fn late(job: &ThreadJob, limits: &ThreadLimits, index: usize, report: &ThreadPassReport, findings: &mut FindingLog) {
    let (pass, number) = (&job.passes[index], number(index));
    let late_deg = report.in_phase_deg - pass.start_angle_deg;
    if !pass.vibrates() || late_deg <= 0.0 {
        return;
    }
    let late_mm = job.run_up.synchronous_deg(late_deg) * job.geometry.lead_mm / 360.0;
    if late_mm <= limits.approach_mm - pass.start_travel_mm {
        return;
    }
    let is_delayed = job.start_up == StartUp::Delayed;
    let what = if is_delayed { "starts" } else { "has come into its phase" };
    let message = format!(
        "the vibration of pass {number} {what} {} degrees after the lead axis starts, in the work already",
        decimal(late_deg, 3)
    );
    let needed_mm = round_up(late_mm + pass.start_travel_mm, 3);
    let finding = Finding::new(code::THREAD_VIBRATION_LATE, pass.span, message)
        .at("pass", number)
        .ranked("", late_mm + pass.start_travel_mm)
        .with_value("delay", report.in_phase_deg, "deg")
        .with_value("travel", late_mm, "mm")
        .suggest_value(
            format!("start the thread {} mm before the work", decimal(needed_mm, 3)),
            None,
            "approach",
            needed_mm,
            "mm",
        );
    // At a turning point of the wave the vibration starts from rest by itself.
    let cure = if is_delayed {
        "use the start-up with preparatory movement and a phase shift of 0 or 180 degrees"
    } else {
        "use a phase shift of 0 or 180 degrees, with which the vibration is in phase from the start"
    };
    findings.push(finding.suggest(cure));
}
