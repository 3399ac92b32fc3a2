//! An independent check of the closed forms: grooves cut cell by cell.
//!
//! At each of many phases of the work the section of the groove is a row of cells along the lead, every one with the
//! depth to which it is cut. A pass lowers the cells under its tool. No formula of the chip models is used: only the
//! tool's section and the position function, played at the spindle angle at which the pass comes to the place.

use proptest::prelude::*;

use super::*;

const PHASES: usize = 720;
const CELL_MM: f64 = 0.005;

/// What the simulation sees of one pass: share of air, runs of air per vibration, largest thickness on the radius.
struct Seen {
    air_share: f64,
    runs: usize,
    thickness_mm: f64,
}

/// Cuts all passes; the tool is as wide as its section (`flanks`) or only as wide as its tip.
fn simulate(job: &ThreadJob, flanks: bool) -> Vec<Seen> {
    let cells = if flanks { (8.0 / CELL_MM) as usize } else { 1 };
    let mut floors = vec![vec![f64::NEG_INFINITY; cells]; PHASES];
    let mut seen = Vec::new();
    let lead_mm = job.geometry.lead_mm;
    for pass in &job.passes {
        let mut air = [false; PHASES];
        let mut thickness_mm = 0.0_f64;
        for (phase, floor) in floors.iter_mut().enumerate() {
            // The same place on the work: a spindle angle of the first pass well inside the thread, and the
            // revolution in which this pass is closest to it.
            let work_deg = 1_800.0 + 360.0 * phase as f64 / PHASES as f64 / job.vibrations_per_rev;
            let at_mm = job.position(&job.passes[0], work_deg).travel_mm;
            let candidates = (-3..=3).map(|turns| job.position(pass, work_deg + 360.0 * f64::from(turns)));
            let nearest = candidates.min_by(|a, b| (a.travel_mm - at_mm).abs().total_cmp(&(b.travel_mm - at_mm).abs()));
            let tool = nearest.unwrap();
            let offset_mm = tool.travel_mm - at_mm;
            assert!(offset_mm.abs() <= 0.5 * lead_mm + 1e-9);
            let surface_mm = job.geometry.across_mm(0.0, at_mm);
            let inwards = if job.geometry.side == ThreadSide::External { 1.0 } else { -1.0 };
            let tip_mm = (surface_mm - tool.radius_mm) * inwards;
            let mut removed_mm = 0.0_f64;
            for (cell, floor) in floor.iter_mut().enumerate() {
                let (depth_mm, uncut_mm) = if flanks {
                    let z_mm = (cell as f64 - 0.5 * cells as f64) * CELL_MM;
                    let depth_mm = job.profile.depth_at_mm(tip_mm, z_mm - offset_mm);
                    (depth_mm, -inwards * job.geometry.taper * z_mm)
                } else {
                    (pass.depth_mm - tool.retreat_mm, 0.0)
                };
                let left_mm = floor.max(uncut_mm);
                removed_mm = removed_mm.max(depth_mm - left_mm);
                *floor = floor.max(depth_mm);
            }
            air[phase] = removed_mm <= 1e-9;
            thickness_mm = thickness_mm.max(removed_mm);
        }
        let runs = (0..PHASES).filter(|&phase| air[phase] && !air[(phase + PHASES - 1) % PHASES]).count();
        let air_share = air.iter().filter(|air| **air).count() as f64 / PHASES as f64;
        seen.push(Seen { air_share, runs, thickness_mm });
    }
    seen
}

/// Compares one level; the tolerance covers cells and phases of the simulation.
fn compare(job: &ThreadJob) -> Result<(), TestCaseError> {
    let report = judge_thread(job, &ThreadLimits::default());
    prop_assert!(!report.passes.is_empty(), "{:?}", report.findings);
    for flanks in [false, true] {
        let slope = if flanks { CELL_MM / job.profile.tan_half_angle() } else { 0.0 };
        for (index, (seen, pass)) in simulate(job, flanks).iter().zip(&report.passes).enumerate() {
            let chip = if flanks { &pass.section } else { &pass.depth };
            let amplitude_mm: f64 = job.passes[..=index].iter().map(|pass| pass.amplitude_mm).sum();
            let tolerance_mm = slope + 0.01 * amplitude_mm + 1e-9;
            prop_assert!(
                (seen.thickness_mm - chip.largest_thickness_mm).abs() <= tolerance_mm,
                "pass {} flanks {}: thickness {} simulated, {} computed",
                index + 1,
                flanks,
                seen.thickness_mm,
                chip.largest_thickness_mm
            );
            if seen.air_share > 0.0 && !flanks {
                prop_assert!(chip.broken, "pass {} cuts air in the simulation", index + 1);
            }
            // Two phases per arc end, and where cells hide a sliver of chip the arcs look longer.
            if !flanks {
                let tolerance = 2.5 * (seen.runs.max(1) as f64) / PHASES as f64 + 0.01;
                prop_assert!(
                    (seen.air_share - chip.air_share).abs() <= tolerance,
                    "pass {}: air {} simulated, {} computed",
                    index + 1,
                    seen.air_share,
                    chip.air_share
                );
            } else {
                prop_assert!(
                    seen.air_share >= chip.air_share - 2.5 * (seen.runs.max(1) as f64) / PHASES as f64,
                    "pass {}: air {} simulated, {} computed",
                    index + 1,
                    seen.air_share,
                    chip.air_share
                );
            }
        }
    }
    Ok(())
}

#[test]
fn the_worked_programs_are_cut_as_computed() {
    compare(&program_a()).unwrap();
    compare(&program_b()).unwrap();
    let seen = simulate(&program_a(), true);
    assert!(seen[0].air_share > 0.0 && seen[0].runs == 1);
    assert_eq!((seen[1].air_share, seen[2].air_share), (0.0, 0.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn random_threads_are_cut_as_computed(
        depths in prop::collection::vec(0.05..1.2_f64, 1..5),
        ratios in prop::collection::vec(0.0..2.5_f64, 5),
        shifts in prop::collection::vec(0.0..360.0_f64, 5),
        offsets in prop::collection::vec(-0.4..0.4_f64, 5),
        by_angle in any::<bool>(),
        vibrations_per_rev in 0.5..4.0_f64,
        included_angle_deg in 30.0..90.0_f64,
        internal in any::<bool>(),
        taper in -0.3..0.3_f64,
    ) {
        let mut depths = depths;
        depths.sort_by(f64::total_cmp);
        let passes = depths.iter().enumerate().map(|(index, &depth_mm)| {
            let offset_mm = if index == 0 { 0.0 } else { offsets[index] };
            ThreadPass {
                depth_mm,
                start_travel_mm: if by_angle { 0.0 } else { offset_mm },
                start_angle_deg: if by_angle { reduce_deg(-360.0 * offset_mm / 2.5) } else { 0.0 },
                amplitude_mm: depth_mm * ratios[index],
                phase_shift_deg: shifts[index],
                ..ThreadPass::default()
            }
        });
        let mut job = job(passes.collect());
        job.vibrations_per_rev = vibrations_per_rev;
        job.profile = GrooveProfile::pointed(included_angle_deg);
        job.geometry.taper = taper;
        if internal {
            job.geometry.side = ThreadSide::Internal;
        }
        compare(&job)?;
    }

    #[test]
    fn flat_tools_are_reported_on_the_safe_side(
        depths in prop::collection::vec(0.05..0.8_f64, 3),
        amplitudes in prop::collection::vec(0.0..1.5_f64, 3),
        shifts in prop::collection::vec(0.0..360.0_f64, 3),
        offsets in prop::collection::vec(-0.4..0.4_f64, 3),
        root_flat_mm in 0.05..0.9_f64,
    ) {
        let passes = (0..3).map(|index| ThreadPass {
            depth_mm: depths[index],
            start_travel_mm: offsets[index] - offsets[0],
            amplitude_mm: amplitudes[index],
            phase_shift_deg: shifts[index],
            ..ThreadPass::default()
        });
        let mut job = job(passes.collect());
        job.profile = GrooveProfile { included_angle_deg: 30.0, root_flat_mm };
        let report = judge_thread(&job, &ThreadLimits::default());
        for (seen, pass) in simulate(&job, true).iter().zip(&report.passes) {
            prop_assert!(seen.air_share >= pass.section.air_share - 0.02);
            prop_assert!(seen.thickness_mm <= pass.section.largest_thickness_mm + 1e-9);
        }
    }
}
