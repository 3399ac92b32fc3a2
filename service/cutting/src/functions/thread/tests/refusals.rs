//! Conditions of docs/functions/thread-vibration.md ("Findings") that are not met, each with its numbers and a cure
//! that helps.

use feedwave_program::{Finding, Severity};
use proptest::prelude::*;

use super::*;

#[track_caller]
fn finding(job: &ThreadJob, limits: &ThreadLimits, code: &str) -> Finding {
    let report = judge_thread(job, limits);
    let found = report.findings.iter().find(|finding| finding.code == code);
    let found = found.unwrap_or_else(|| panic!("{code} is not among {:?}", codes(&report))).clone();
    assert_eq!(report.feasible, report.findings.iter().all(|finding| finding.severity != Severity::Error));
    assert!(!found.values.is_empty() && !found.suggestions.is_empty(), "{found:?}");
    found
}

fn cure(finding: &Finding, name: &str) -> f64 {
    let values = finding.suggestions.iter().filter_map(|suggestion| suggestion.value.as_ref());
    values.into_iter().find(|value| value.name == name).map(|value| value.value).unwrap()
}

#[test]
fn amplitudes_not_beyond_the_infeed_are_found_and_cured() {
    let unlimited = ThreadLimits::default();
    let mut job = program_a();
    job.passes[0].amplitude_mm = 0.9;
    let first = finding(&job, &unlimited, "THREAD-FIRST-PASS");
    job.passes[0].amplitude_mm = cure(&first, "amplitude");
    job.passes[1].amplitude_mm = 0.3;
    let second = finding(&job, &unlimited, "THREAD-AMPLITUDE-SMALL");
    job.passes[1].amplitude_mm = cure(&second, "amplitude");
    let report = judge_thread(&job, &unlimited);
    assert!(report.passes[0].depth.broken && report.passes[1].depth.broken);
    assert!(!codes(&report).contains(&"THREAD-AMPLITUDE-SMALL"));
}

#[test]
fn equal_phases_are_found_and_cured() {
    let mut job = program_a();
    job.passes[1].phase_shift_deg = 0.0;
    let found = finding(&job, &ThreadLimits::default(), "THREAD-PHASE-EQUAL");
    assert_near(cure(&found, "phase_shift"), 180.0, 1e-9);
    // Program A at D = 1.5: the start angle of nearly a full turn adds 540°, and what looks shifted is in phase.
    let mut half = program_a();
    half.vibrations_per_rev = 1.5;
    let found = finding(&half, &ThreadLimits::default(), "THREAD-PHASE-EQUAL");
    half.passes[1].phase_shift_deg = cure(&found, "phase_shift");
    assert!(judge_thread(&half, &ThreadLimits::default()).passes[1].depth.broken);
    let turned = finding(&program_a_at(1.5), &ThreadLimits::default(), "THREAD-TURN-PHASE");
    assert_near(cure(&turned, "phase_shift"), 0.0, 1e-9);
}

/// Limits of the axis across the lead alone.
fn across(velocity: f64, acceleration: f64, jerk: f64) -> ThreadLimits {
    ThreadLimits {
        vibration_velocity_mm_per_s: velocity,
        vibration_acceleration_mm_per_s2: acceleration,
        vibration_jerk_mm_per_s3: jerk,
        ..ThreadLimits::default()
    }
}

fn amplitude_cure(finding: &Finding) -> Option<f64> {
    let values = finding.suggestions.iter().filter_map(|suggestion| suggestion.value.as_ref());
    values.into_iter().find(|value| value.name == "amplitude").map(|value| value.value)
}

#[test]
fn an_amplitude_that_the_axis_cannot_follow_is_no_cure() {
    let mut job = program_a();
    job.passes[1].phase_shift_deg = 40.0;
    let unlimited = finding(&job, &ThreadLimits::default(), "THREAD-PHASE-UNBROKEN");
    let named_mm = amplitude_cure(&unlimited).expect("an amplitude");
    assert!(named_mm > job.passes[1].amplitude_mm);
    // Each limit lies below what the named amplitude asks, and above what the present one asks; the shift stays a cure.
    let rad_per_s = core::f64::consts::TAU * job.frequency_hz();
    let middle_mm = 0.5 * (named_mm + job.passes[1].amplitude_mm);
    let asked = [1, 2, 3].map(|order| 0.5 * middle_mm * rad_per_s.powi(order));
    let limited = [
        across(asked[0], f64::INFINITY, f64::INFINITY),
        across(f64::INFINITY, asked[1], f64::INFINITY),
        across(f64::INFINITY, f64::INFINITY, asked[2]),
        ThreadLimits { period_s: 1e-3, ..across(f64::INFINITY, f64::INFINITY, 0.75 * asked[1] / 1e-3) },
    ];
    for limits in limited {
        let found = finding(&job, &limits, "THREAD-PHASE-UNBROKEN");
        assert_eq!(amplitude_cure(&found), None, "{found:?}");
        assert!(found.message.contains(" mm would be no cure: the X axis'"), "{}", found.message);
        assert_near(cure(&found, "phase_shift"), 180.0, 1e-9);
    }
}

#[test]
fn an_amplitude_for_the_axis_keeps_all_its_limits_and_the_chip() {
    let job = program_a();
    let limit_codes = ["THREAD-VIBRATION-VELOCITY", "THREAD-VIBRATION-ACCELERATION", "THREAD-VIBRATION-JERK"];
    let rad_per_s = core::f64::consts::TAU * job.frequency_hz();
    let asked = |amplitude_mm: f64| [1, 2, 3].map(|order| 0.5 * amplitude_mm * rad_per_s.powi(order));
    let at_most =
        |velocity_mm: f64, others_mm: f64| across(asked(velocity_mm)[0], asked(others_mm)[1], asked(others_mm)[2]);
    // The first pass goes 1 mm deep: 1.1 mm break its chip, 0.9 mm do not. Velocity leaves 1.15 mm, the others 1.1 mm.
    let limits = at_most(1.15, 1.1);
    for code in limit_codes {
        let found = finding(&job, &limits, code);
        assert_near(amplitude_cure(&found).expect("an amplitude"), 1.1, 1.001e-4);
        let mut cured = job.clone();
        cured.passes[0].amplitude_mm = amplitude_cure(&found).expect("an amplitude");
        let report = judge_thread(&cured, &limits);
        assert!(report.passes[0].depth.broken);
        assert!(!codes(&report).iter().any(|code| limit_codes.contains(code)), "{:?}", codes(&report));
    }
    for code in limit_codes {
        let found = finding(&job, &at_most(1.15, 0.9), code);
        assert_eq!(amplitude_cure(&found), None, "{found:?}");
        assert!(found.message.ends_with("the chip would not break: it needs 1 mm"), "{}", found.message);
        assert!(cure(&found, "spindle_speed") < job.spindle_rev_per_min);
    }
}

#[test]
fn a_shift_that_a_turn_makes_right_is_left() {
    // At D = 1.5 the turn of the second pass makes 180° of 0°, opposite to the first pass: what is programmed is right.
    let mut job = program_a_at(1.5);
    job.passes.truncate(2);
    job.passes[1].phase_shift_deg = 0.0;
    assert!(judge_thread(&job, &ThreadLimits::default()).passes[1].depth.broken);
    let found = finding(&job, &ThreadLimits::default(), "THREAD-TURN-PHASE");
    assert!(found.suggestions.iter().all(|suggestion| suggestion.value.is_none()), "{found:?}");
    assert!(found.suggestions[0].message.starts_with("leave it so"), "{found:?}");
}

fn program_a_at(vibrations_per_rev: f64) -> ThreadJob {
    ThreadJob { vibrations_per_rev, ..program_a() }
}

#[test]
fn phases_too_close_are_found_and_cured() {
    let mut job = program_a();
    job.passes[1].phase_shift_deg = 40.0;
    let found = finding(&job, &ThreadLimits::default(), "THREAD-PHASE-UNBROKEN");
    let mut shifted = job.clone();
    shifted.passes[1].phase_shift_deg = cure(&found, "phase_shift");
    job.passes[1].amplitude_mm = cure(&found, "amplitude");
    for job in [shifted, job] {
        assert!(judge_thread(&job, &ThreadLimits::default()).passes[1].depth.broken);
    }
}

#[test]
fn a_shift_says_what_the_passes_behind_it_need() {
    let unlimited = ThreadLimits::default();
    let unbroken = |job: &ThreadJob| {
        let passes = judge_thread(job, &unlimited).passes;
        (0..passes.len()).filter(|&pass| job.passes[pass].vibrates() && !passes[pass].depth.broken).collect::<Vec<_>>()
    };
    // Passes 1 and 2 are in step, and so pass 3 is with pass 2 where that alone is shifted.
    let mut job = program_a();
    (job.passes[1].phase_shift_deg, job.passes[2].phase_shift_deg) = (0.0, 180.0);
    assert_eq!(unbroken(&job), [1]);
    let found = finding(&job, &unlimited, "THREAD-PHASE-EQUAL");
    let message = "shift the phase by 180 degrees, and every pass behind it by 180 degrees more than now: pass 3 would not be cut \
                   through otherwise";
    assert_eq!(found.suggestions[0].message, message);
    job.passes[1].phase_shift_deg = cure(&found, "phase_shift");
    assert_eq!(unbroken(&job), [2]);
    job.passes[2].phase_shift_deg += 180.0;
    assert!(unbroken(&job).is_empty());
}

#[test]
fn a_cure_of_crests_says_whether_it_ends_them() {
    let job = program_a();
    let crests = judge_thread(&job, &ThreadLimits::default()).crests.unwrap();
    let [another_mm, least_mm] =
        [crests.finishing_thickness_with_another_pass_mm, crests.finishing_thickness_with_least_amplitude_mm];
    assert!(another_mm < least_mm);
    // What the finishing pass may find: too little for either, enough for one, enough for both.
    let permitted_mm = [0.5 * another_mm, 0.5 * (another_mm + least_mm), 1.001 * least_mm];
    for (permitted_mm, ends) in permitted_mm.into_iter().zip([[false; 2], [true, false], [true; 2]]) {
        let limits = ThreadLimits { finishing_thickness_mm: Some(permitted_mm), ..ThreadLimits::default() };
        let found = finding(&job, &limits, "THREAD-CRESTS");
        let said: Vec<bool> = found.suggestions.iter().map(|cure| cure.message.ends_with(" mm remain")).collect();
        assert_eq!(said, ends, "{found:?}");
        let mut with_another = job.clone();
        let last = with_another.passes[2];
        with_another.passes.insert(3, ThreadPass { phase_shift_deg: last.phase_shift_deg + 180.0, ..last });
        let mut with_least = job.clone();
        with_least.passes[2].amplitude_mm = cure(&found, "amplitude");
        for (cured, ends) in [with_another, with_least].iter().zip(ends) {
            let report = judge_thread(cured, &limits);
            assert_eq!(!codes(&report).contains(&"THREAD-CRESTS"), ends);
            assert!(report.passes.iter().all(|pass| pass.depth.broken || pass.amplitude_mm == 0.0));
        }
    }
}

#[test]
fn machine_limits_are_kept() {
    let job = program_a();
    let unlimited = ThreadLimits::default();
    // 2.5 mm at 10 revolutions per second.
    let limits = ThreadLimits { lead_velocity_mm_per_s: 20.0, ..unlimited };
    assert_near(cure(&finding(&job, &limits, "THREAD-LEAD-SPEED"), "spindle_speed"), 480.0, 0.1);
    let limits = ThreadLimits { lead_acceleration_mm_per_s2: 1_000.0, ..unlimited };
    assert_near(cure(&finding(&job, &limits, "THREAD-RUN-UP"), "run_up_angle"), 135.0, 0.01);
    let mut slow = job.clone();
    slow.run_up.angle_deg = 1_440.0;
    let limits = ThreadLimits { approach_mm: 3.0, ..unlimited };
    assert_near(cure(&finding(&slow, &limits, "THREAD-APPROACH-SHORT"), "approach"), 5.0, 1e-3);
    // 20 Hz with half of 1.2 mm: 75.4 mm/s and 9 475 mm/s². The chip of the first pass needs 1 mm.
    let rad_per_s = core::f64::consts::TAU * 20.0;
    for (limits, code, value) in [
        (
            ThreadLimits { vibration_velocity_mm_per_s: 69.0, ..unlimited },
            "THREAD-VIBRATION-VELOCITY",
            138.0 / rad_per_s,
        ),
        (
            ThreadLimits { vibration_acceleration_mm_per_s2: 8_700.0, ..unlimited },
            "THREAD-VIBRATION-ACCELERATION",
            17_400.0 / (rad_per_s * rad_per_s),
        ),
        (
            ThreadLimits { vibration_jerk_mm_per_s3: 1.09e6, ..unlimited },
            "THREAD-VIBRATION-JERK",
            2.18e6 / (rad_per_s * rad_per_s * rad_per_s),
        ),
    ] {
        assert_near(cure(&finding(&job, &limits, code), "amplitude"), value, 1e-4);
    }
    let limits = ThreadLimits { period_s: 0.01, ..unlimited };
    assert_eq!(finding(&job, &limits, "THREAD-SAMPLING-COARSE").severity, Severity::Warning);
    let limits = ThreadLimits { period_s: 0.03, ..unlimited };
    assert_near(cure(&finding(&job, &limits, "THREAD-SAMPLING-NYQUIST"), "period"), 0.00625, 1e-9);
    let limits = ThreadLimits { thickness_mm: 0.5, ..unlimited };
    finding(&job, &limits, "THREAD-THICKNESS");
}

#[test]
fn start_angles_grooves_and_late_vibrations_are_judged() {
    let mut job = program_a();
    job.passes[1].start_angle_deg = 685.584;
    let found = finding(&job, &ThreadLimits::default(), "THREAD-START-ANGLE");
    assert_near(cure(&found, "start_angle"), 325.584, 1e-9);
    let mut deep = program_a();
    deep.passes[3].depth_mm = 2.5;
    let found = finding(&deep, &ThreadLimits::default(), "THREAD-PROFILE-WIDE");
    assert_near(cure(&found, "depth"), 2.165, 1e-9);
    let mut late = program_b();
    late.start_up = StartUp::Delayed;
    let limits = ThreadLimits { approach_mm: 0.1, ..ThreadLimits::default() };
    finding(&late, &limits, "THREAD-VIBRATION-LATE");
    let mut idle = program_b();
    idle.passes[3].depth_mm = 0.1;
    finding(&idle, &ThreadLimits::default(), "THREAD-PASS-AIR");
}

#[test]
fn as_many_passes_as_permitted_are_judged_and_more_refused() {
    // At one depth with a hundred phases every pass is seen by every later one: the most there is to compute.
    let spread = |count: usize| {
        let passes = (0..count).map(|index| {
            let phase_shift_deg = 360.0 * index as f64 / count as f64;
            ThreadPass { depth_mm: 0.5, amplitude_mm: 1.0, phase_shift_deg, ..ThreadPass::default() }
        });
        job(passes.collect())
    };
    let report = judge_thread(&spread(MAX_THREAD_PASSES), &ThreadLimits::default());
    let crest_mm = 0.5 * (1.0 - libm::cos(core::f64::consts::PI / MAX_THREAD_PASSES as f64));
    assert_near(report.crests.unwrap().crest_mm, crest_mm, 1e-9);
    finding(&spread(MAX_THREAD_PASSES + 1), &ThreadLimits::default(), "THREAD-PARAMETER");
}

proptest! {
    #[test]
    fn any_numbers_get_an_answer(
        values in prop::collection::vec(prop_oneof![
            any::<f64>(), -10.0..1_000.0_f64, Just(0.0), Just(f64::NAN), Just(f64::INFINITY)
        ], 12),
        starts in any::<u32>(),
    ) {
        let mut job = program_a();
        let slots = [
            &mut job.geometry.lead_mm, &mut job.geometry.taper, &mut job.geometry.start_mm,
            &mut job.vibrations_per_rev, &mut job.spindle_rev_per_min, &mut job.run_up.angle_deg,
            &mut job.profile.included_angle_deg, &mut job.profile.root_flat_mm,
        ];
        // One wrong number at a time is found; the others stay sensible.
        let slot = starts as usize % slots.len();
        for (index, place) in slots.into_iter().enumerate() {
            if index == slot {
                *place = values[0];
            }
        }
        job.passes[1].depth_mm = values[1];
        job.passes[2].start_angle_deg = values[2];
        job.passes[3].start_travel_mm = values[3];
        let report = judge_thread(&job, &ThreadLimits::default());
        let finite = job.passes[1].depth_mm.is_finite() && job.passes[2].start_angle_deg.is_finite();
        prop_assert!(finite || !report.feasible);
        for pass in &report.passes {
            prop_assert!(pass.section.largest_thickness_mm.is_finite() && pass.section.air_share.is_finite());
        }
    }
}
