//! Threads: their words, their settings on a machine, the planner's request, threads and their reports. A stored report
//! gives back the thread that it was made of.

mod request;

use feedwave_cutting::MachineProfile;
use feedwave_cutting::thread::{
    CrestReport, GrooveProfile, LeadAxis, PassFollowing, RunUp, SpindleRotation, StartUp, ThreadChip, ThreadFollowing,
    ThreadGeometry, ThreadJob, ThreadPass, ThreadPassReport, ThreadPlan, ThreadReport, ThreadSectionReport, ThreadSide,
    ThreadTextOptions, ThreadVibrationSettings, thread_program_text,
};
use feedwave_program::{Finding, FunctionSwitch, SourceSpan};
pub use request::thread_request_from_proto;

use super::Function;
use crate::convert::{enumeration, finding_to_proto};
use crate::proto;
use crate::violations::Violations;

pub(super) const FUNCTION: Function = Function {
    words_from_proto: |given, language| {
        if let Some(proto::FunctionSwitch { code, on_p, off_p }) = given.thread_vibration {
            language.thread_vibration = FunctionSwitch { code, on_p, off_p };
        }
    },
    words_to_proto: |language, shown| {
        let FunctionSwitch { code, on_p, off_p } = language.thread_vibration;
        shown.thread_vibration = Some(proto::FunctionSwitch { code, on_p, off_p });
    },
    settings_from_proto,
    settings_to_proto,
    job_from_proto: |_, _| {},
    report_to_proto: |report, shown| shown.threads = report.threads.iter().map(section_to_proto).collect(),
};

fn settings_from_proto(violations: &mut Violations, given: &proto::MachineProfile, profile: &mut MachineProfile) {
    let settings = given.thread_vibration.unwrap_or_default();
    let default = ThreadVibrationSettings::default();
    let Some(start_up) = enumeration(violations, "thread_vibration.start_up", settings.start_up) else { return };
    profile.thread_vibration = ThreadVibrationSettings {
        vibrations_per_rev: settings.vibrations_per_rev.unwrap_or(default.vibrations_per_rev),
        start_up: start_up_from_proto(start_up),
        combined_preparation: settings.combined_preparation,
        odd_phase_shift_deg: settings.odd_phase_shift_deg.unwrap_or(default.odd_phase_shift_deg),
        even_phase_shift_deg: settings.even_phase_shift_deg.unwrap_or(default.even_phase_shift_deg),
        reference_angle_deg: settings.reference_angle_deg,
        included_angle_deg: settings.included_angle_deg.unwrap_or(default.included_angle_deg),
        approach_mm: settings.approach_mm,
        max_thickness_mm: settings.max_thickness_mm,
        max_finishing_thickness_mm: settings.max_finishing_thickness_mm,
    };
}

fn settings_to_proto(profile: &MachineProfile, shown: &mut proto::MachineProfile) {
    let settings = &profile.thread_vibration;
    shown.thread_vibration = Some(proto::ThreadVibrationSettings {
        vibrations_per_rev: Some(settings.vibrations_per_rev),
        start_up: start_up_to_proto(settings.start_up).into(),
        combined_preparation: settings.combined_preparation,
        odd_phase_shift_deg: Some(settings.odd_phase_shift_deg),
        even_phase_shift_deg: Some(settings.even_phase_shift_deg),
        reference_angle_deg: settings.reference_angle_deg,
        included_angle_deg: Some(settings.included_angle_deg),
        approach_mm: settings.approach_mm,
        max_thickness_mm: settings.max_thickness_mm,
        max_finishing_thickness_mm: settings.max_finishing_thickness_mm,
    });
}

/// What the pass planner answered, with its program text.
#[must_use]
pub fn thread_plan_to_proto(
    plan: &Result<ThreadPlan, Vec<Finding>>,
    options: &ThreadTextOptions,
) -> proto::PlanThreadResponse {
    match plan {
        Ok(ThreadPlan { job, report }) => proto::PlanThreadResponse {
            thread: Some(thread_to_proto(job)),
            report: Some(thread_report_to_proto(report)),
            program: thread_program_text(job, options),
            findings: report.findings.iter().map(|finding| finding_to_proto(finding, &[])).collect(),
        },
        Err(findings) => proto::PlanThreadResponse {
            findings: findings.iter().map(|finding| finding_to_proto(finding, &[])).collect(),
            ..proto::PlanThreadResponse::default()
        },
    }
}

/// A thread of a program as the contract has it.
fn section_to_proto(section: &ThreadSectionReport) -> proto::ThreadSectionReport {
    proto::ThreadSectionReport {
        on_line: section.on_line,
        first_line: section.first_line,
        last_line: section.last_line,
        amplitude_ratio: section.ratio,
        work_diameter_assumed: section.work_diameter_assumed,
        thread: Some(thread_to_proto(&section.job)),
        report: Some(thread_report_to_proto(&section.report)),
    }
}

/// A thread as the contract has it.
#[must_use]
pub fn thread_to_proto(job: &ThreadJob) -> proto::Thread {
    proto::Thread {
        geometry: Some(geometry_to_proto(&job.geometry)),
        profile: Some(proto::GrooveProfile {
            included_angle_deg: job.profile.included_angle_deg,
            root_flat_mm: job.profile.root_flat_mm,
        }),
        vibrations_per_rev: job.vibrations_per_rev,
        start_up: start_up_to_proto(job.start_up).into(),
        run_up_angle_deg: job.run_up.angle_deg,
        spindle_rev_per_min: job.spindle_rev_per_min,
        passes: job.passes.iter().map(pass_to_proto).collect(),
    }
}

fn geometry_to_proto(geometry: &ThreadGeometry) -> proto::ThreadGeometry {
    let place = match geometry.lead_axis {
        LeadAxis::Z => proto::ThreadGeometry {
            lead_axis: proto::ThreadLeadAxis::Z.into(),
            work_diameter_mm: 2.0 * geometry.work_mm,
            start_z_mm: geometry.start_mm,
            end_z_mm: geometry.end_mm,
            ..proto::ThreadGeometry::default()
        },
        LeadAxis::X => proto::ThreadGeometry {
            lead_axis: proto::ThreadLeadAxis::X.into(),
            face_z_mm: geometry.work_mm,
            start_radius_mm: geometry.start_mm,
            end_radius_mm: geometry.end_mm,
            ..proto::ThreadGeometry::default()
        },
    };
    proto::ThreadGeometry {
        side: match geometry.side {
            ThreadSide::External => proto::ThreadSide::External,
            ThreadSide::Internal => proto::ThreadSide::Internal,
        }
        .into(),
        taper: geometry.taper,
        lead_mm: geometry.lead_mm,
        starts: geometry.starts,
        rotation: rotation_to_proto(geometry.rotation).into(),
        ..place
    }
}

/// A direction of the spindle as the contract has it.
#[must_use]
pub const fn rotation_to_proto(rotation: SpindleRotation) -> proto::SpindleRotation {
    match rotation {
        SpindleRotation::Forward => proto::SpindleRotation::Forward,
        SpindleRotation::Reverse => proto::SpindleRotation::Reverse,
    }
}

const fn start_up_to_proto(start_up: StartUp) -> proto::ThreadStartUp {
    match start_up {
        StartUp::Preparatory => proto::ThreadStartUp::Preparatory,
        StartUp::Delayed => proto::ThreadStartUp::Delayed,
    }
}

const fn pass_to_proto(pass: &ThreadPass) -> proto::ThreadPass {
    proto::ThreadPass {
        start: pass.start,
        depth_mm: pass.depth_mm,
        start_travel_mm: pass.start_travel_mm,
        start_angle_deg: pass.start_angle_deg,
        amplitude_mm: pass.amplitude_mm,
        phase_shift_deg: pass.phase_shift_deg,
        line: pass.span.line,
    }
}

/// A thread as the pure functions have it: what [`thread_to_proto`] was given, but for columns in the program.
#[must_use]
pub fn thread_from_proto(thread: &proto::Thread) -> ThreadJob {
    let geometry = thread.geometry.unwrap_or_default();
    let profile = thread.profile.unwrap_or_default();
    let (lead_axis, [work_mm, start_mm, end_mm]) = match geometry.lead_axis() {
        proto::ThreadLeadAxis::X => {
            (LeadAxis::X, [geometry.face_z_mm, geometry.start_radius_mm, geometry.end_radius_mm])
        }
        proto::ThreadLeadAxis::Z | proto::ThreadLeadAxis::Unspecified => {
            (LeadAxis::Z, [0.5 * geometry.work_diameter_mm, geometry.start_z_mm, geometry.end_z_mm])
        }
    };
    ThreadJob {
        geometry: ThreadGeometry {
            lead_axis,
            side: side_from_proto(geometry.side()),
            work_mm,
            start_mm,
            end_mm,
            taper: geometry.taper,
            lead_mm: geometry.lead_mm,
            starts: geometry.starts,
            rotation: match geometry.rotation() {
                proto::SpindleRotation::Reverse => SpindleRotation::Reverse,
                proto::SpindleRotation::Forward | proto::SpindleRotation::Unspecified => SpindleRotation::Forward,
            },
        },
        profile: GrooveProfile { included_angle_deg: profile.included_angle_deg, root_flat_mm: profile.root_flat_mm },
        vibrations_per_rev: thread.vibrations_per_rev,
        start_up: start_up_from_proto(thread.start_up()),
        run_up: RunUp { angle_deg: thread.run_up_angle_deg },
        spindle_rev_per_min: thread.spindle_rev_per_min,
        passes: thread.passes.iter().map(pass_from_proto).collect(),
    }
}

/// Outside where the message leaves it open.
const fn side_from_proto(side: proto::ThreadSide) -> ThreadSide {
    match side {
        proto::ThreadSide::Internal => ThreadSide::Internal,
        proto::ThreadSide::External | proto::ThreadSide::Unspecified => ThreadSide::External,
    }
}

/// The preparatory movement where the message leaves it open.
const fn start_up_from_proto(start_up: proto::ThreadStartUp) -> StartUp {
    match start_up {
        proto::ThreadStartUp::Delayed => StartUp::Delayed,
        proto::ThreadStartUp::Preparatory | proto::ThreadStartUp::Unspecified => StartUp::Preparatory,
    }
}

fn pass_from_proto(pass: &proto::ThreadPass) -> ThreadPass {
    ThreadPass {
        start: pass.start,
        depth_mm: pass.depth_mm,
        start_travel_mm: pass.start_travel_mm,
        start_angle_deg: pass.start_angle_deg,
        amplitude_mm: pass.amplitude_mm,
        amplitude_word: None,
        phase_shift_deg: pass.phase_shift_deg,
        span: SourceSpan { line: pass.line, ..SourceSpan::default() },
    }
}

/// The report of a thread as a message of the contract, without its findings.
#[must_use]
pub fn thread_report_to_proto(report: &ThreadReport) -> proto::ThreadReport {
    proto::ThreadReport {
        passes: report.passes.iter().map(pass_report).collect(),
        crests: report.crests.as_ref().map(crests),
        least_amplitude_ratio: report.least_ratio,
        least_section_amplitude_ratio: report.least_section_ratio,
        lead_velocity_mm_per_s: report.lead_velocity_mm_per_s,
        frequency_hz: report.frequency_hz,
        run_up_travel_mm: report.run_up_mm,
        exact_length_mm: report.exact_length_mm,
        feasible: report.feasible,
        following: report.following.as_ref().map(following),
    }
}

fn following(report: &ThreadFollowing) -> proto::ThreadFollowing {
    proto::ThreadFollowing {
        gain: report.gain,
        lag_deg: report.lag_deg,
        lead_lag_mm: report.lead_lag_mm,
        contour_error_mm: report.contour_error_mm,
        passes: report.passes.iter().map(pass_following).collect(),
    }
}

const fn pass_following(pass: &PassFollowing) -> proto::ThreadPassFollowing {
    proto::ThreadPassFollowing {
        arriving_amplitude_mm: pass.arriving_amplitude_mm,
        above_depth_mm: pass.above_depth_mm,
        amplitude_to_command_mm: pass.amplitude_to_command_mm,
        depth_to_command_mm: pass.depth_to_command_mm,
        phase_shift_to_command_deg: pass.phase_shift_to_command_deg,
        depth_broken: pass.depth_broken,
        section_broken: pass.section_broken,
    }
}

fn pass_report(report: &ThreadPassReport) -> proto::ThreadPassReport {
    proto::ThreadPassReport {
        infeed_mm: report.infeed_mm,
        amplitude_mm: report.amplitude_mm,
        turns_later: report.place.turns_later,
        axial_offset_mm: report.place.axial_offset_mm,
        tip_depth_mm: report.place.tip_depth_mm,
        work_phase_shift_deg: report.place.phase_shift_deg,
        phase_advance_deg: report.phase_advance_deg,
        prepared_phase_deg: report.prepared_phase_deg,
        prepared_retreat_mm: report.prepared_retreat_mm,
        delay_deg: report.delay_deg,
        in_phase_deg: report.in_phase_deg,
        depth: Some(chip(&report.depth)),
        section: Some(chip(&report.section)),
    }
}

const fn chip(chip: &ThreadChip) -> proto::ThreadChip {
    let ThreadChip { broken, air_share, breaks_per_rev, longest_chip_mm, largest_thickness_mm, least_amplitude_mm } =
        *chip;
    proto::ThreadChip { broken, air_share, breaks_per_rev, longest_chip_mm, largest_thickness_mm, least_amplitude_mm }
}

fn crests(crests: &CrestReport) -> proto::CrestReport {
    proto::CrestReport {
        crest_mm: crests.crest_mm,
        section_crest_mm: crests.section_crest_mm,
        finishing_infeed_mm: crests.finishing_infeed_mm,
        finishing_thickness_mm: crests.finishing_thickness_mm,
        crest_with_another_pass_mm: crests.crest_with_another_pass_mm,
        crest_with_least_amplitude_mm: crests.crest_with_least_amplitude_mm,
        least_amplitude_mm: crests.least_amplitude_mm,
        // A thread has at most a hundred passes.
        pass: u32::try_from(crests.pass).unwrap_or(u32::MAX),
    }
}

#[cfg(test)]
mod tests {
    use feedwave_cutting::thread::{ThreadLimits, judge_thread};

    use super::*;

    fn job() -> ThreadJob {
        let pass = |depth_mm, start_angle_deg, amplitude_mm, phase_shift_deg, line| ThreadPass {
            start: 1,
            depth_mm,
            start_travel_mm: 0.25,
            start_angle_deg,
            amplitude_mm,
            amplitude_word: None,
            phase_shift_deg,
            span: SourceSpan { line, ..SourceSpan::default() },
        };
        ThreadJob {
            geometry: ThreadGeometry {
                lead_axis: LeadAxis::Z,
                side: ThreadSide::Internal,
                work_mm: 5.0,
                start_mm: 100.0,
                end_mm: 60.0,
                taper: 0.03125,
                lead_mm: 2.5,
                starts: 2,
                rotation: SpindleRotation::Reverse,
            },
            profile: GrooveProfile { included_angle_deg: 55.0, root_flat_mm: 0.1 },
            vibrations_per_rev: 1.5,
            start_up: StartUp::Delayed,
            run_up: RunUp { angle_deg: 12.5 },
            spindle_rev_per_min: 600.0,
            passes: vec![pass(0.5, 0.0, 0.6, 0.0, 7), pass(0.7, 325.584, 0.3, 180.0, 11)],
        }
    }

    #[test]
    fn threads_survive_the_round_trip() {
        assert_eq!(thread_from_proto(&thread_to_proto(&job())), job());
        let plain = ThreadJob {
            geometry: ThreadGeometry {
                side: ThreadSide::External,
                rotation: SpindleRotation::Forward,
                ..job().geometry
            },
            start_up: StartUp::Preparatory,
            ..job()
        };
        assert_eq!(thread_from_proto(&thread_to_proto(&plain)), plain);
        let face = ThreadJob {
            geometry: ThreadGeometry { lead_axis: LeadAxis::X, work_mm: -0.5, start_mm: 30.0, ..job().geometry },
            ..job()
        };
        assert_eq!(thread_from_proto(&thread_to_proto(&face)), face);
    }

    #[test]
    fn a_report_keeps_its_numbers() {
        let report = judge_thread(&job(), &ThreadLimits::default());
        let shown = thread_report_to_proto(&report);
        assert_eq!(shown.passes.len(), 2);
        assert_eq!(shown.run_up_travel_mm, job().run_up.travel_mm(2.5));
        let (pass, own) = (&shown.passes[1], &report.passes[1]);
        assert_eq!((pass.turns_later, pass.work_phase_shift_deg), (own.place.turns_later, own.place.phase_shift_deg));
        assert_eq!(pass.section.unwrap().least_amplitude_mm, own.section.least_amplitude_mm);
        assert_eq!(shown.crests.unwrap().crest_mm, report.crests.unwrap().crest_mm);
    }
}
