//! Every worked number of docs/functions/thread-vibration.md.

use super::*;

#[test]
fn amplitudes_follow_infeed_and_ratio() {
    let job = program_a();
    // Diameter values: infeed 2 and 0.828, A = 2.4 and 0.9936.
    assert_near(2.0 * job.infeed_mm(0), 2.0, 1e-12);
    assert_near(2.0 * job.passes[0].amplitude_mm, 2.4, 1e-12);
    assert_near(2.0 * job.infeed_mm(1), 0.828, 1e-12);
    assert_near(2.0 * job.passes[1].amplitude_mm, 0.9936, 1e-12);
    assert_near(2.0 * job.passes[2].amplitude_mm, 0.7632, 1e-12);
    assert_eq!(job.passes[3].amplitude_mm, 0.0);
    assert_eq!(program_b().passes[0].amplitude_mm, 1.5 * 1.2);
}

#[test]
fn depths_follow_the_square_root_and_offsets_the_flank() {
    let profile = GrooveProfile::pointed(60.0);
    for (pass, (depth_mm, offset_mm, start_deg)) in
        [(1.0, 0.0, 0.0), (1.414, 0.239, 325.584), (1.732, 0.423, 299.088)].into_iter().enumerate()
    {
        assert_near(DepthLaw::SquareRoot.depth_mm(pass, 3, libm::sqrt(3.0)), depth_mm, 5e-4);
        let offset = InfeedPattern::Flank.axial_offset_mm(&profile, pass, 1.0, depth_mm, 1.75);
        assert_near(offset, offset_mm, 5e-4);
        let rounded = (offset * 1_000.0).round() / 1_000.0;
        assert_near(reduce_deg(360.0 - 360.0 * rounded / 2.5), start_deg, 1e-9);
    }
    assert_near(InfeedPattern::Flank.axial_offset_mm(&profile, 3, 1.0, 1.75, 1.75), 0.433, 5e-4);
    let job = program_a();
    for (index, offset_mm) in [0.0, 0.239, 0.423, 0.433].into_iter().enumerate() {
        assert_near(job.place(index).axial_offset_mm, offset_mm, 1e-9);
        assert_eq!(job.place(index).turns_later, i64::from(index > 0));
    }
}

#[test]
fn a_start_angle_advances_the_phase() {
    let job = program_a();
    assert_near(job.phase_advance_deg(&job.passes[1]), 651.168, 1e-9);
    assert_near(job.phase_advance_deg(&job.passes[2]), 598.176, 1e-9);
}

#[test]
fn preparatory_movement_goes_to_the_corrected_phase() {
    for (shift_deg, prepared_deg) in [(0.0, 0.0), (120.0, 240.0), (240.0, 120.0), (180.0, 180.0)] {
        let wave = RetreatWave { amplitude_mm: 1.8, vibrations_per_rev: 2.0, phase_shift_deg: shift_deg };
        assert_eq!(wave.prepared_phase_deg(), prepared_deg);
        assert_eq!(wave.delay_deg(), shift_deg / 2.0);
        let prepared_mm = wave.at_phase_mm(prepared_deg);
        assert_near(prepared_mm, 0.9 * (1.0 - libm::cos(shift_deg.to_radians())), 1e-12);
        assert_near(wave.retreat_mm(StartUp::Preparatory, -50.0), prepared_mm, 1e-12);
        assert_eq!(wave.retreat_mm(StartUp::Delayed, 0.5 * wave.delay_deg()), 0.0);
    }
    let report = judge_thread(&program_b(), &ThreadLimits::default());
    let prepared: Vec<f64> = report.passes[..3].iter().map(|pass| pass.prepared_phase_deg).collect();
    assert_eq!(prepared, [0.0, 240.0, 120.0]);
}

#[test]
fn the_ratio_of_program_a_breaks_the_chip_in_the_depth_model_only() {
    let report = judge_thread(&program_a(), &ThreadLimits::default());
    assert!(report.passes[..3].iter().all(|pass| pass.depth.broken));
    let section: Vec<bool> = report.passes[..3].iter().map(|pass| pass.section.broken).collect();
    assert_eq!(section, [true, false, false]);
    // Δd + |Δz|/tan β: about twice the infeed.
    assert_near(report.passes[1].section.least_amplitude_mm, 0.414 + 0.239 * libm::sqrt(3.0), 1e-9);
    assert_near(report.least_section_ratio.unwrap(), 2.0, 0.01);
    assert_near(report.least_ratio.unwrap(), 1.0, 1e-9);
    assert_eq!(codes(&report), ["THREAD-CHIP-RIBBON", "THREAD-CRESTS"]);
    let [ribbon, _] = &report.findings[..] else { unreachable!("counted above") };
    let pass = |occurrence: &Option<feedwave_program::Occurrence>| occurrence.as_ref().map(|it| it.number);
    assert_eq!((ribbon.occurrences, pass(&ribbon.first), pass(&ribbon.worst)), (2, Some(2), Some(2)));
    assert!(report.feasible);
    assert_eq!(report.passes[1].depth.breaks_per_rev, 2.0);
}

#[test]
fn the_suggested_ratio_breaks_the_full_section() {
    let mut job = program_a();
    let ratio = judge_thread(&job, &ThreadLimits::default()).least_section_ratio.unwrap();
    job.apply_ratio(ratio * 1.000_001, |index| (index == 3).then_some(0.0));
    let report = judge_thread(&job, &ThreadLimits::default());
    assert!(report.passes[..3].iter().all(|pass| pass.section.broken));
    job.apply_ratio(ratio * 0.999, |index| (index == 3).then_some(0.0));
    let report = judge_thread(&job, &ThreadLimits::default());
    assert!(!report.passes[..3].iter().all(|pass| pass.section.broken));
}

#[test]
fn program_a_leaves_crests_for_the_finishing_pass() {
    let crests = judge_thread(&program_a(), &ThreadLimits::default()).crests.unwrap();
    // About 0.35 mm where the nominal finishing infeed is 0.018 mm. Exactly: passes 2 and 3 are equally deep
    // where 1.414 − 0.2484·(1 + cos ψ) = 1.732 − 0.1908·(1 − cos ψ).
    let cosine = (1.414 - 0.2484 - 1.732 + 0.1908) / (0.1908 + 0.2484);
    assert_near(crests.crest_mm, 0.1908 * (1.0 - cosine), 1e-9);
    assert_near(crests.crest_mm, 0.35, 0.005);
    assert_near(crests.finishing_infeed_mm, 0.018, 1e-9);
    assert_near(crests.finishing_thickness_mm, crests.crest_mm + 0.018, 1e-9);
    assert!(crests.crest_with_another_pass_mm < 0.6 * crests.crest_mm);
    assert!(crests.crest_with_least_amplitude_mm < crests.crest_mm);
    let infeed_mm = crests.finishing_infeed_mm;
    let with_another_mm = crests.finishing_thickness_with_another_pass_mm;
    assert_near(with_another_mm, crests.crest_with_another_pass_mm + infeed_mm, 1e-9);
    let with_least_mm = crests.finishing_thickness_with_least_amplitude_mm;
    assert_near(with_least_mm, crests.crest_with_least_amplitude_mm + infeed_mm, 1e-9);
    assert_eq!(crests.pass, 2);
}

#[test]
fn radial_passes_of_program_b_leave_no_ribbon() {
    let report = judge_thread(&program_b(), &ThreadLimits::default());
    // The first pass is above the work where 0.9·(1 − cos ψ) ≥ 1.5.
    let above = libm::acos(2.0 / 3.0) / core::f64::consts::PI;
    for (pass, air_share) in report.passes.iter().zip([above, 0.5, 2.0 / 3.0]) {
        assert!(pass.depth.broken && pass.section.broken);
        assert_near(pass.depth.air_share, air_share, 1e-9);
        assert_eq!(pass.depth, pass.section);
    }
    // Three waves a third apart are all at least a quarter of the travel from the ground at the worst.
    assert_near(report.crests.unwrap().crest_mm, 0.25 * 1.8, 1e-9);
}

#[test]
fn program_text_is_program_a() {
    let text = thread_program_text(&program_a(), &ThreadTextOptions::default());
    let expected = "\
(THREAD WITH VIBRATION, D = 2)
G97 S600 M3
G165 P3 X10.0 Q1.2
G0 X14.0
G0 Z100.0
G0 X8.0
G32 Z60.0 F2.5 Q0.0
G0 X14.0
G0 Z100.0
G0 X7.172
G32 Z60.0 F2.5 Q325.584
G0 X14.0
G0 Z100.0
G0 X6.536
G32 Z60.0 F2.5 Q299.088
G0 X14.0
G0 Z100.0
G0 X6.5
G32 Z60.0 F2.5 Q297.648 A0.0
G0 X14.0
G165 P0
M5
M30
";
    assert_eq!(text, expected);
}

#[test]
fn program_text_states_what_program_b_adds() {
    let text = thread_program_text(&program_b(), &ThreadTextOptions::default());
    let passes: Vec<&str> = text.lines().filter(|line| line.starts_with("G32")).collect();
    assert_eq!(
        passes,
        [
            "G32 Z60.0 F2.5 Q0.0",
            "G32 Z60.0 F2.5 Q0.0 A3.6 R120.0",
            "G32 Z60.0 F2.5 Q0.0 A3.6 R240.0",
            "G32 Z60.0 F2.5 Q0.0 A0.0",
        ]
    );
}

#[test]
fn program_text_of_a_tapered_bore_says_both_ends_and_every_amplitude() {
    let mut job = program_b();
    job.geometry.side = ThreadSide::Internal;
    job.geometry.taper = -1.0 / 32.0;
    job.geometry.rotation = SpindleRotation::Reverse;
    assert_eq!(job.geometry.hand(), Hand::Left);
    let options = ThreadTextOptions { clearance_mm: 1.0, ..ThreadTextOptions::default() };
    let text = thread_program_text(&job, &options);
    // 40 mm of travel narrow the diameter by 2.5 mm.
    assert!(text.starts_with("(THREAD WITH VIBRATION, D = 2)\nG97 S600 M4\n"), "{text}");
    assert!(text.contains("G0 X5.5\nG0 Z100.0\nG0 X13.0\nG32 X10.5 Z60.0 F2.5 Q0.0 A3.6 R0.0\n"), "{text}");
}
