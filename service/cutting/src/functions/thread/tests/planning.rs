//! Plans keep what they promise.

use feedwave_program::Severity;
use proptest::prelude::*;

use super::*;

fn request() -> ThreadRequest {
    ThreadRequest {
        geometry: geometry(),
        hand: Some(Hand::Right),
        profile: GrooveProfile::pointed(60.0),
        depth_mm: 1.75,
        finishing_allowance_mm: 0.018,
        first_depth_mm: 1.0,
        infeed: InfeedPattern::Flank,
        law: DepthLaw::SquareRoot,
        method: PassMethod::StartAngle,
        start_up: StartUp::Preparatory,
        vibrations_per_rev: 2.0,
        spindle_rev_per_min: 300.0,
        amplitude_margin: 1.1,
        limits: ThreadLimits { finishing_thickness_mm: Some(0.1), approach_mm: 10.0, ..ThreadLimits::default() },
    }
}

#[test]
fn the_thread_of_program_a_is_planned_with_broken_chips_and_small_crests() {
    let plan = plan_thread(&request()).unwrap();
    let depths: Vec<f64> = plan.job.passes.iter().map(|pass| pass.depth_mm).collect();
    assert_eq!(depths, [1.0, 1.414, 1.732, 1.732, 1.75]);
    let angles: Vec<f64> = plan.job.passes.iter().map(|pass| pass.start_angle_deg).collect();
    assert_eq!(angles, [0.0, 325.584, 299.088, 299.088, 297.648]);
    let shifts: Vec<f64> = plan.job.passes.iter().map(|pass| pass.phase_shift_deg).collect();
    assert_eq!(shifts, [0.0, 180.0, 0.0, 180.0, 0.0]);
    assert!(plan.report.passes[..4].iter().all(|pass| pass.depth.broken && pass.section.broken));
    let crests = plan.report.crests.unwrap();
    assert!(crests.finishing_thickness_mm <= 0.1);
    let text = thread_program_text(&plan.job, &ThreadTextOptions::default());
    assert!(text.contains("G32 Z60.0 F2.5 Q325.584 A"), "{text}");
    assert_eq!(text.lines().filter(|line| line.starts_with("G32")).count(), 5);
}

#[test]
fn limits_of_the_axis_take_more_passes() {
    let free = plan_thread(&request()).unwrap();
    let mut request = request();
    request.limits.vibration_acceleration_mm_per_s2 = 1_200.0;
    let limited = plan_thread(&request).unwrap();
    assert!(limited.job.passes.len() > free.job.passes.len());
    let rad_per_s = core::f64::consts::TAU * limited.job.frequency_hz();
    for pass in &limited.job.passes {
        assert!(0.5 * pass.amplitude_mm * rad_per_s * rad_per_s <= 1_200.0);
    }
    request.limits.vibration_acceleration_mm_per_s2 = 50.0;
    let findings = plan_thread(&request).unwrap_err();
    assert_eq!(findings[0].code, "THREAD-PLAN-PASSES");
    assert!(!findings[0].suggestions.is_empty());
}

#[test]
fn the_lead_axis_gets_the_run_up_that_its_limits_take() {
    let mut request = request();
    request.limits.lead_acceleration_mm_per_s2 = 500.0;
    request.limits.lead_jerk_mm_per_s3 = 10_000.0;
    let plan = plan_thread(&request).unwrap();
    // 12.5 mm/s: 37.5 ms by acceleration, 86.6 ms by jerk, at 5 revolutions per second.
    assert_near(plan.job.run_up.angle_deg, 360.0 * 5.0 * libm::sqrt(6.0 * 12.5 / 10_000.0), 1e-3);
    request.limits.approach_mm = 0.1;
    assert_eq!(plan_thread(&request).unwrap_err()[0].code, "THREAD-APPROACH-SHORT");
}

#[test]
fn the_wrong_hand_and_a_budget_without_crests_are_refused() {
    let wrong = ThreadRequest { hand: Some(Hand::Left), ..request() };
    assert_eq!(plan_thread(&wrong).unwrap_err()[0].code, "THREAD-HAND");
    let mut reversed = wrong;
    reversed.geometry.rotation = SpindleRotation::Reverse;
    assert!(plan_thread(&reversed).is_ok());
    let mut tight = request();
    tight.limits.finishing_thickness_mm = Some(0.018);
    assert_eq!(plan_thread(&tight).unwrap_err()[0].code, "THREAD-PLAN-CRESTS");
    let not_a_number = ThreadRequest { depth_mm: f64::NAN, ..request() };
    assert_eq!(plan_thread(&not_a_number).unwrap_err()[0].code, "THREAD-PARAMETER");
}

fn any_infeed() -> impl Strategy<Value = InfeedPattern> {
    prop_oneof![
        Just(InfeedPattern::Radial),
        Just(InfeedPattern::Flank),
        (0.5..5.0_f64).prop_map(|relief_deg| InfeedPattern::ModifiedFlank { relief_deg }),
        Just(InfeedPattern::AlternatingFlank),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_plan_breaks_every_chip(
        infeed in any_infeed(),
        constant in any::<bool>(),
        by_position in any::<bool>(),
        delayed in any::<bool>(),
        starts in 1..4_u32,
        taper in -0.06..0.06_f64,
        internal in any::<bool>(),
        depth_mm in 0.3..0.7_f64,
        first_depth_mm in 0.2..0.4_f64,
        vibrations_per_rev in 0.5..5.0_f64,
    ) {
        let mut request = request();
        request.geometry.lead_mm = f64::from(starts);
        request.geometry.starts = starts;
        request.geometry.taper = taper;
        request.geometry.side = if internal { ThreadSide::Internal } else { ThreadSide::External };
        request.infeed = infeed;
        request.law = if constant { DepthLaw::Constant } else { DepthLaw::SquareRoot };
        request.method = if by_position { PassMethod::StartPosition } else { PassMethod::StartAngle };
        request.start_up = if delayed { StartUp::Delayed } else { StartUp::Preparatory };
        request.depth_mm = depth_mm;
        request.first_depth_mm = first_depth_mm;
        request.vibrations_per_rev = vibrations_per_rev;
        request.profile = GrooveProfile { included_angle_deg: 60.0, root_flat_mm: 0.1 };
        let plan = plan_thread(&request).map_err(|findings| TestCaseError::fail(format!("{findings:?}")))?;
        prop_assert!(plan.report.findings.iter().all(|finding| finding.severity == Severity::Info));
        for (pass, report) in plan.job.passes.iter().zip(&plan.report.passes) {
            prop_assert!(!pass.vibrates() || report.depth.broken && report.section.broken);
            prop_assert!((0.0..360.0).contains(&pass.start_angle_deg));
            prop_assert!(pass.depth_mm <= depth_mm + 5e-4);
            let by_angle = matches!(request.method, PassMethod::StartAngle);
            let unused = if by_angle { pass.start_travel_mm } else { pass.start_angle_deg };
            prop_assert_eq!(unused, 0.0);
        }
        for start in 0..starts {
            let last = plan.job.passes.iter().rev().find(|pass| pass.start == start);
            prop_assert!(last.is_some_and(|pass| !pass.vibrates() && (pass.depth_mm - depth_mm).abs() <= 5e-4));
        }
        prop_assert_eq!(&judge_thread(&plan.job, &request.limits), &plan.report);
    }
}
