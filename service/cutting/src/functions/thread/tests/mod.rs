//! Proof of the thread functions: the worked numbers of docs/functions/thread-vibration.md, a simulation of the
//! section, and properties.

mod golden;
mod planning;
mod properties;
mod refusals;
mod simulation;

use feedwave_program::SourceSpan;

use super::*;

/// The thread of the worked programs: M10-like, 2.5 mm lead, 60° tool, from Z100 to Z60.
pub(super) fn geometry() -> ThreadGeometry {
    ThreadGeometry {
        lead_axis: LeadAxis::Z,
        side: ThreadSide::External,
        work_mm: 5.0,
        start_mm: 100.0,
        end_mm: 60.0,
        taper: 0.0,
        lead_mm: 2.5,
        starts: 1,
        rotation: SpindleRotation::Forward,
    }
}

pub(super) fn pass(x_mm: f64, start_angle_deg: f64, phase_shift_deg: f64) -> ThreadPass {
    ThreadPass {
        depth_mm: 0.5 * (10.0 - x_mm),
        start_angle_deg,
        phase_shift_deg,
        span: SourceSpan::default(),
        ..ThreadPass::default()
    }
}

pub(super) fn job(passes: Vec<ThreadPass>) -> ThreadJob {
    ThreadJob {
        geometry: geometry(),
        profile: GrooveProfile::pointed(60.0),
        vibrations_per_rev: 2.0,
        start_up: StartUp::Preparatory,
        run_up: RunUp::default(),
        spindle_rev_per_min: 600.0,
        passes,
    }
}

/// Program A of the worked programs.
pub(super) fn program_a() -> ThreadJob {
    let mut job =
        job(vec![pass(8.0, 0.0, 0.0), pass(7.172, 325.584, 180.0), pass(6.536, 299.088, 0.0), pass(6.5, 297.648, 0.0)]);
    job.apply_ratio(1.2, |index| (index == 3).then_some(0.0));
    job
}

/// Program B of the worked programs.
pub(super) fn program_b() -> ThreadJob {
    let mut job = job(vec![pass(7.0, 0.0, 0.0), pass(7.0, 0.0, 120.0), pass(7.0, 0.0, 240.0), pass(7.0, 0.0, 0.0)]);
    job.apply_ratio(1.2, |index| [None, Some(1.8), Some(1.8), Some(0.0)][index]);
    job
}

pub(super) fn codes(report: &ThreadReport) -> Vec<&str> {
    report.findings.iter().map(|finding| finding.code.name()).collect()
}

#[track_caller]
pub(super) fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} is not {expected} within {tolerance}");
}
