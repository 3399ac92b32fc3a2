//! Threads turned with vibration: planned, judged, streamed and followed, all through the built binary.

mod following;
mod tilted;

use feedwave_contract::proto::plan_thread_request::{Advance, On};
use feedwave_contract::proto::validate_program_request::On as ValidateOn;
use feedwave_contract::proto::{
    ColumnKind, Frame, GetMachineRequest, InfeedPattern, JobState, PassMethod, PlanThreadRequest, PlanThreadResponse,
    StreamSetpointsRequest, ThreadHand, ThreadPassReport, ThreadSectionReport, ValidateProgramRequest,
};
use feedwave_tests::{Clients, Outcome, Server, Setpoints, stream};
use tonic::Code;

use crate::FEEDWAVE;
use crate::status::{assert_error, violated_fields};

/// The thread of program A (docs/functions/thread-vibration.md, "Worked programs").
fn thread_of_program_a() -> PlanThreadRequest {
    PlanThreadRequest {
        on: Some(On::Machine("machines/lathe".to_owned())),
        work_diameter_mm: 10.0,
        advance: Some(Advance::LeadMm(2.5)),
        start_z_mm: 100.0,
        end_z_mm: 60.0,
        approach_mm: Some(10.0),
        depth_mm: 1.75,
        finishing_allowance_mm: Some(0.018),
        first_depth_mm: 1.0,
        finishing_thickness_mm: Some(0.1),
        infeed: InfeedPattern::Flank.into(),
        spindle_rev_per_min: 300.0,
        ..PlanThreadRequest::default()
    }
}

async fn plan(clients: &mut Clients, request: PlanThreadRequest) -> PlanThreadResponse {
    clients.threads.plan_thread(request).await.unwrap_or_else(|status| panic!("{status:?}")).into_inner()
}

#[tokio::test]
async fn a_planned_thread_breaks_its_chip_in_both_models() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    for method in [PassMethod::StartAngle, PassMethod::StartPosition] {
        let request = PlanThreadRequest { method: method.into(), ..thread_of_program_a() };
        let answer = plan(&mut clients, request).await;
        let (thread, report) = (answer.thread.expect("a thread"), answer.report.expect("a report"));
        let depths: Vec<f64> = thread.passes.iter().map(|pass| pass.depth_mm).collect();
        assert_eq!(depths, [1.0, 1.414, 1.732, 1.732, 1.75]);
        let places: Vec<f64> = match method {
            PassMethod::StartPosition => thread.passes.iter().map(|pass| pass.start_travel_mm).collect(),
            _ => thread.passes.iter().map(|pass| pass.start_angle_deg).collect(),
        };
        match method {
            PassMethod::StartPosition => assert_eq!(places, [0.0, 0.239, 0.423, 0.423, 0.433]),
            _ => assert_eq!(places, [0.0, 325.584, 299.088, 299.088, 297.648]),
        }
        for pass in &report.passes[..4] {
            let (depth, section) = (pass.depth.expect("depth"), pass.section.expect("section"));
            assert!(depth.broken && section.broken && section.breaks_per_rev >= 2.0, "{pass:?}");
        }
        assert!(report.feasible && report.run_up_travel_mm > 0.0);
        assert!(report.crests.expect("crests").finishing_thickness_mm <= 0.1);
        assert!(answer.findings.iter().all(|finding| finding.severity() == feedwave_contract::proto::Severity::Info));
        assert_eq!(answer.program.lines().filter(|line| line.starts_with("G32 ")).count(), 5);
    }
}

#[tokio::test]
async fn what_cannot_be_planned_is_answered_with_findings() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    for (request, code) in [
        // Even the run-up of a lead of 2.5 mm takes more than that.
        (PlanThreadRequest { approach_mm: Some(0.001), ..thread_of_program_a() }, "THREAD-APPROACH-SHORT"),
        // Nothing is left for crests.
        (PlanThreadRequest { finishing_thickness_mm: Some(0.018), ..thread_of_program_a() }, "THREAD-PLAN-CRESTS"),
        // A groove wider than the pitch.
        (PlanThreadRequest { depth_mm: 2.4, ..thread_of_program_a() }, "THREAD-PROFILE-WIDE"),
        (PlanThreadRequest { max_thickness_mm: Some(0.001), ..thread_of_program_a() }, "THREAD-PLAN-PASSES"),
        (PlanThreadRequest { hand: ThreadHand::Left.into(), rotation: 1, ..thread_of_program_a() }, "THREAD-HAND"),
    ] {
        let answer = plan(&mut clients, request).await;
        let finding = &answer.findings[0];
        assert_eq!(finding.code, code);
        assert!(!finding.values.is_empty() && !finding.suggestions.is_empty(), "{finding:?}");
        assert!(answer.thread.is_none() && answer.report.is_none() && answer.program.is_empty());
    }
}

#[tokio::test]
async fn every_wrong_field_of_a_thread_is_named_at_once() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let wrong = PlanThreadRequest {
        on: Some(On::Machine("lathe".to_owned())),
        advance: None,
        depth_mm: f64::NAN,
        spindle_rev_per_min: f64::INFINITY,
        infeed: 42,
        ..thread_of_program_a()
    };
    let status = clients.threads.plan_thread(wrong).await.unwrap_err();
    assert_eq!(violated_fields(&status), ["advance", "depth_mm", "infeed", "machine", "spindle_rev_per_min"]);
    let nowhere = PlanThreadRequest { on: Some(On::Machine("machines/nowhere".to_owned())), ..thread_of_program_a() };
    let status = clients.threads.plan_thread(nowhere).await.unwrap_err();
    assert_error(&status, Code::NotFound, "RESOURCE_NOT_FOUND");
    let mill = PlanThreadRequest { on: Some(On::Machine("machines/mill".to_owned())), ..thread_of_program_a() };
    assert_eq!(violated_fields(&clients.threads.plan_thread(mill).await.unwrap_err()), ["machine"]);
    let status = clients.threads.plan_thread(PlanThreadRequest::default()).await.unwrap_err();
    let fields = violated_fields(&status);
    assert!(["on", "advance", "depth_mm", "first_depth_mm"].iter().all(|field| fields.contains(&(*field).to_owned())));
}

/// Programs A and B (docs/functions/thread-vibration.md, "Worked programs").
const PROGRAM_A: &str = include_str!("../fixtures/thread-a.nc");
const PROGRAM_B: &str = include_str!("../fixtures/thread-b.nc");

fn only_thread(outcome: &Outcome) -> &ThreadSectionReport {
    let [thread] = outcome.report.threads.as_slice() else { panic!("{:?}", outcome.report.threads) };
    thread
}

fn passes(thread: &ThreadSectionReport) -> &[ThreadPassReport] {
    &thread.report.as_ref().expect("a report").passes
}

fn broken(pass: &ThreadPassReport) -> (bool, bool) {
    (pass.depth.expect("depth").broken, pass.section.expect("section").broken)
}

#[track_caller]
fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} is not {expected} within {tolerance}");
}

#[tokio::test]
async fn program_a_is_judged_with_the_numbers_of_the_page() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let outcome = clients.submit(PROGRAM_A).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.codes());
    let section = only_thread(&outcome);
    assert_eq!(section.amplitude_ratio, Some(1.2));
    let thread = section.thread.as_ref().expect("a thread");
    let amplitudes: Vec<f64> = thread.passes.iter().map(|pass| 2.0 * pass.amplitude_mm).collect();
    for (amplitude_mm, expected_mm) in amplitudes.iter().zip([2.4, 0.9936, 0.7632, 0.0]) {
        assert_near(*amplitude_mm, expected_mm, 1e-9);
    }
    let angles: Vec<f64> = thread.passes.iter().map(|pass| pass.start_angle_deg).collect();
    assert_eq!(angles, [0.0, 325.584, 299.088, 297.648]);
    let reports = passes(section);
    assert_near(reports[1].phase_advance_deg, 651.168, 1e-9);
    assert_near(reports[2].phase_advance_deg, 598.176, 1e-9);
    // The ratio breaks the chip in the model of the depth only, but for the first pass, which has no flank.
    let chips: Vec<_> = reports[..3].iter().map(broken).collect();
    assert_eq!(chips, [(true, true), (true, false), (true, false)]);
    let report = section.report.as_ref().expect("a report");
    assert_near(report.least_section_amplitude_ratio.expect("a ratio"), 2.0, 0.01);
    let crests = report.crests.expect("crests");
    assert_near(crests.crest_mm, 0.35, 0.005);
    assert_near(crests.finishing_infeed_mm, 0.018, 1e-9);
    let codes = outcome.codes();
    for code in ["THREAD-CHIP-RIBBON", "THREAD-CRESTS"] {
        assert!(codes.contains(&code), "{code} is not in {codes:?}");
    }
    let summary = outcome.report.summary.as_ref().expect("a summary");
    assert_eq!((summary.thread_count, summary.thread_passes), (1, 4));
}

#[tokio::test]
async fn program_b_cuts_one_depth_three_times_and_breaks_its_chip() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let outcome = clients.submit(PROGRAM_B).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.codes());
    let reports = passes(only_thread(&outcome));
    let prepared: Vec<f64> = reports[..3].iter().map(|pass| pass.prepared_phase_deg).collect();
    assert_eq!(prepared, [0.0, 240.0, 120.0]);
    for pass in &reports[..3] {
        assert_near(2.0 * pass.amplitude_mm, 3.6, 1e-9);
        assert_eq!(broken(pass), (true, true));
    }
}

/// The setpoints of a job in work coordinates.
async fn work_setpoints(clients: &mut Clients, job: &str) -> Setpoints {
    let request =
        StreamSetpointsRequest { job: job.to_owned(), frame: Frame::Work.into(), ..StreamSetpointsRequest::default() };
    stream(clients, request).await.unwrap_or_else(|status| panic!("{status:?}"))
}

/// The setpoints of one line: spindle angle, X on the radius, Z.
fn of_line(setpoints: &Setpoints, line: u32) -> Vec<[f64; 3]> {
    let (x, z) = (setpoints.column("X_mm"), setpoints.column("Z_mm"));
    let angle_deg = setpoints.of_kind(ColumnKind::SpindleAngle);
    let rows = (0..setpoints.len()).filter(|row| setpoints.lines[*row] == line);
    rows.map(|row| [angle_deg[row], x[row], z[row]]).collect()
}

#[tokio::test]
async fn setpoints_follow_the_spindle_angle_in_lead_and_phase() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let outcome = clients.submit(PROGRAM_A).await;
    let thread = only_thread(&outcome).thread.clone().expect("a thread");
    let setpoints = work_setpoints(&mut clients, &outcome.job.name).await;
    for pass in &thread.passes {
        let points = of_line(&setpoints, pass.line);
        let deepest_mm = 5.0 - pass.depth_mm;
        let (mut exact, mut largest_mm) = (0, 0.0_f64);
        for pair in points.windows(2) {
            let [[before_deg, _, before_z], [angle_deg, x, z]] = [pair[0], pair[1]];
            // Never deeper than programmed, never out further than the amplitude.
            let retreat_mm = x - deepest_mm;
            assert!((-1e-9..=pass.amplitude_mm + 1e-9).contains(&retreat_mm), "{retreat_mm}");
            largest_mm = largest_mm.max(retreat_mm);
            if before_z < 99.0 && z > 61.0 {
                assert_near((before_z - z) / (angle_deg - before_deg) * 360.0, 2.5, 1e-6);
                // The phase at this angle, whatever start angle the pass has: psi = D·theta − shift.
                let phase_deg = 2.0 * angle_deg - pass.phase_shift_deg;
                let expected_mm = 0.5 * pass.amplitude_mm * (1.0 - phase_deg.to_radians().cos());
                assert_near(retreat_mm, expected_mm, 1e-7);
                exact += 1;
            }
        }
        // 38 mm of thread are 15.2 revolutions of 200 setpoints.
        assert!(exact > 3_000, "{exact}");
        assert_near(largest_mm, pass.amplitude_mm, 1e-3 * pass.amplitude_mm.max(1e-3));
    }
}

#[tokio::test]
async fn a_vibration_that_starts_in_the_middle_of_its_wave_starts_from_rest() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let (from, shifts) = ("A3.6 R120", [120.0, 33.0, 90.0, 270.0, 359.0]);
    assert!(PROGRAM_B.contains(from));
    for shift_deg in shifts {
        let outcome = clients.submit(&PROGRAM_B.replace(from, &format!("A3.6 R{shift_deg}"))).await;
        assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings);
        let thread = only_thread(&outcome).thread.clone().expect("a thread");
        let setpoints = work_setpoints(&mut clients, &outcome.job.name).await;
        let rad_per_s = std::f64::consts::TAU * thread.vibrations_per_rev * thread.spindle_rev_per_min / 60.0;
        let pass = thread.passes[1];
        assert_near(pass.phase_shift_deg, shift_deg, 1e-9);
        let points = of_line(&setpoints, pass.line);
        // The taper is zero: X is the vibration alone, from its prepared position on.
        let prepared_mm = 5.0 - pass.depth_mm + 0.5 * pass.amplitude_mm * (1.0 - shift_deg.to_radians().cos());
        let rests = points.iter().position(|point| (point[1] - prepared_mm).abs() < 1e-9);
        let from = rests.expect("X comes to its prepared position");
        let period_s = 1e-3;
        let peak = 0.5 * pass.amplitude_mm * rad_per_s * rad_per_s;
        for three in points[from..].windows(3) {
            let bend = (three[2][1] - 2.0 * three[1][1] + three[0][1]) / (period_s * period_s);
            // The finite difference of a full wave is a little below its peak, so there is room for rounding.
            assert!(bend.abs() <= peak, "{bend} of {peak} at {} with {shift_deg}", three[0][0]);
        }
    }
}

#[tokio::test]
async fn contradictions_are_refused_before_anything_moves() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    for (from, to, code, refused) in [
        ("Q325.584", "Q400.0", "PRG-THREAD-ANGLE", true),
        // An amplitude below the infeed of every pass, and of the first one alone.
        ("Q1.2", "Q0.9", "THREAD-MODE-WORD", true),
        ("F2.5 Q0.0", "F2.5 Q0.0 A1.8", "THREAD-FIRST-PASS", false),
        ("F2.5 Q299.088", "F2.5 Q299.088 A0.4", "THREAD-AMPLITUDE-SMALL", false),
        ("F2.5 Q325.584", "F2.5 Q325.584 R0.0", "THREAD-PHASE-EQUAL", false),
    ] {
        assert!(PROGRAM_A.contains(from));
        let outcome = clients.submit(&PROGRAM_A.replace(from, to)).await;
        let finding = outcome.report.findings.iter().find(|finding| finding.code == code);
        let finding = finding.unwrap_or_else(|| panic!("{code} is not in {:?}", outcome.codes()));
        assert!(finding.line > 0 && !finding.values.is_empty() && !finding.suggestions.is_empty(), "{finding:?}");
        assert_eq!(outcome.job.state() == JobState::Rejected, refused, "{:?}", outcome.codes());
    }
}

#[tokio::test]
async fn a_start_too_close_to_the_work_is_refused_on_a_machine_that_knows_the_approach() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let lathe = GetMachineRequest { name: "machines/lathe".to_owned() };
    let lathe = clients.machines.get_machine(lathe).await.unwrap().into_inner().machine.expect("a machine");
    let mut profile = lathe.profile.expect("a profile");
    let settings = profile.thread_vibration.as_mut().expect("every value is stated");
    assert_eq!((settings.vibrations_per_rev, settings.even_phase_shift_deg), (Some(2.0), Some(180.0)));
    settings.approach_mm = Some(0.01);
    let request = ValidateProgramRequest {
        inline_program: PROGRAM_A.into(),
        on: Some(ValidateOn::Profile(profile)),
        ..ValidateProgramRequest::default()
    };
    let report = clients.jobs.validate_program(request).await.unwrap().into_inner().report.expect("a report");
    let short = report.findings.iter().filter(|finding| finding.code == "THREAD-APPROACH-SHORT");
    assert_eq!(short.map(|finding| finding.line).collect::<Vec<_>>(), [11, 16, 21, 26]);
    assert_eq!(report.summary.expect("a summary").setpoint_count, 0, "nothing moves");
}

#[tokio::test]
async fn a_planned_program_is_accepted_and_breaks_its_chip() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    for (method, infeed) in [
        (PassMethod::StartAngle, InfeedPattern::Flank),
        (PassMethod::StartPosition, InfeedPattern::ModifiedFlank),
        (PassMethod::StartAngle, InfeedPattern::Radial),
        (PassMethod::StartPosition, InfeedPattern::AlternatingFlank),
    ] {
        let request = PlanThreadRequest { method: method.into(), infeed: infeed.into(), ..thread_of_program_a() };
        let planned = plan(&mut clients, request).await;
        let thread = planned.thread.expect("a thread");
        let outcome = clients.submit(&planned.program).await;
        assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings);
        let section = only_thread(&outcome);
        let judged = section.thread.as_ref().expect("a thread");
        assert_eq!(judged.passes.len(), thread.passes.len());
        for ((own, planned), report) in judged.passes.iter().zip(&thread.passes).zip(passes(section)) {
            assert_near(own.depth_mm, planned.depth_mm, 1e-6);
            assert_near(own.amplitude_mm, planned.amplitude_mm, 1e-4);
            assert_near(own.phase_shift_deg, planned.phase_shift_deg, 1e-3);
            assert!(own.amplitude_mm == 0.0 || broken(report) == (true, true), "{infeed:?}: {report:?}");
        }
    }
}
