//! Threads on a face: the lead is along X, Z vibrates.

use std::f64::consts::PI;

use feedwave_cutting::thread::{
    DepthLaw, GrooveProfile, InfeedPattern, LeadAxis, PassMethod, SpindleRotation, StartUp, ThreadFollower,
    ThreadGeometry, ThreadLimits, ThreadPath, ThreadRequest, ThreadSide, ThreadTextOptions, plan_thread,
    thread_program_text,
};

use super::{accepted, check_limits, codes, cutting, lathe, lines, near, wave};
use crate::common::{all_bits, resume, run, snapshots, validate};

const FACE: &str = include_str!("../../../../tests/fixtures/thread-face.nc");

#[test]
fn the_axis_across_the_lead_keeps_its_limits_where_it_moves_and_vibrates() {
    // A face with a part along Z behind it, a line at exactly 45 degrees, and a straight part with a slope behind it. With the
    // amplitude and where the first part ends.
    let face = |amplitude_mm: f64, by_mm: f64| {
        let first =
            format!("G97 S900 M3\nG0 X80 Z5\nG165 P3 Z0 Q1.3\nG0 Z-0.4\nG32 X{} F4 A{amplitude_mm}\n", 20.0 + by_mm);
        first + "G32 Z4 F4\nG0 Z5\nG165 P0\nM30\n"
    };
    let tie = |amplitude_mm: f64, by_mm: f64| {
        let (x, z) = (20.0 + 2.0 * by_mm, -30.5 + by_mm);
        let first = format!("G97 S600 M3\nG0 X80 Z5\nG165 P3 Z0 Q1.3\nG0 Z-0.5\nG32 X{x} Z{z} F4 A{amplitude_mm}\n");
        first + "G0 X90\nG0 Z5\nG165 P0\nM30\n"
    };
    let slope = |amplitude_mm: f64, by_mm: f64| {
        let first =
            format!("G97 S600 M3\nG0 X34 Z5\nG165 P3 X30 Q1.3\nG0 X29.6\nG32 Z{} F2 A{amplitude_mm}\n", -20.0 + by_mm);
        first + "G32 X32 Z-40 F2\nG0 X34\nG0 Z5\nG165 P0\nM30\n"
    };
    let programs: [&dyn Fn(f64, f64) -> String; 3] = [&face, &tie, &slope];
    for (program, by_mm) in programs.iter().flat_map(|program| (0..8).map(move |k| (program, 0.25 * f64::from(k)))) {
        let accepted = |amplitude_mm: f64| validate(&program(amplitude_mm, by_mm), &lathe()).is_accepted();
        // The largest amplitude that is accepted, between one that is and one that is not.
        let (mut most, mut refused) = (0.02, 8.0);
        assert!(accepted(most) && !accepted(refused), "{}", program(most, by_mm));
        while refused - most > 0.01 {
            let middle = 0.5 * (most + refused);
            if accepted(middle) { most = middle } else { refused = middle }
        }
        check_limits(&run(&program(most, by_mm), &lathe()), &lathe());
    }
}

#[test]
fn a_thread_on_a_face_vibrates_along_z() {
    let report = accepted(FACE, &lathe());
    let [section] = report.threads.as_slice() else { panic!("{} threads", report.threads.len()) };
    let geometry = &section.job.geometry;
    assert_eq!((geometry.lead_axis, geometry.work_mm, geometry.lead_mm), (LeadAxis::X, 0.0, 4.0));
    assert_eq!((geometry.start_mm, geometry.end_mm), (40.0, 10.0));
    let setpoints = run(FACE, &lathe());
    check_limits(&setpoints, &lathe());
    let expected = [(0.4, 0.52, 0.0), (0.7, 0.39, 180.0), (0.9, 0.5, 30.0), (1.0, 0.0, 180.0)];
    for ((pass, line), (depth_mm, amplitude_mm, shift_deg)) in
        section.job.passes.iter().zip(lines(section)).zip(expected)
    {
        assert!(near(pass.depth_mm, depth_mm, 1e-12) && near(pass.amplitude_mm, amplitude_mm, 1e-12), "{pass:?}");
        assert_eq!(pass.phase_shift_deg, shift_deg);
        let samples = cutting(&setpoints, line);
        let mut exact = 0;
        for pair in samples.windows(2).skip(300) {
            let [before, k] = [pair[0], pair[1]];
            let retreat_mm = wave(amplitude_mm, setpoints.spindle[k], shift_deg);
            assert!(near(setpoints.axes[1][k], -depth_mm + retreat_mm, 1e-9), "setpoint {k}");
            if (setpoints.feed[k] - 4.0 * 200.0).abs() < 1e-6 && (setpoints.feed[before] - 4.0 * 200.0).abs() < 1e-6 {
                let advance_mm = setpoints.axes[0][before] - setpoints.axes[0][k];
                let turned_deg = setpoints.spindle[k] - setpoints.spindle[before];
                assert!(near(advance_mm / turned_deg * 360.0, 4.0, 1e-6), "setpoint {k}");
                exact += 1;
            }
        }
        assert!(exact > 1_500, "{exact}");
    }
    // The third pass starts in the middle of its wave, from rest.
    let third = lines(section)[2];
    let first = cutting(&setpoints, third)[0];
    let start = (0..first).rev().find(|&k| setpoints.line[k] != third).expect("it is not the first") + 1;
    let peak = 0.25 * (4.0 * PI * 200.0 / 60.0).powi(2);
    for three in setpoints.axes[1][start + 200..first + 400].windows(3) {
        assert!(((three[2] - 2.0 * three[1] + three[0]) / 1e-6).abs() <= peak * (1.0 + 1e-9), "{three:?}");
    }
    // The chip is judged as that of a thread along Z; its phases are what counts.
    assert!(section.report.passes[..2].iter().all(|pass| pass.depth.broken), "{:?}", section.report.passes);
    // It is followed as it is run.
    for (pass, line) in section.job.passes.iter().zip(lines(section)) {
        let samples = cutting(&setpoints, line);
        let reference_deg = (setpoints.spindle[samples[0]] / 360.0).floor() * 360.0;
        let path = ThreadPath::of_pass(&section.job, pass);
        let mut follower = ThreadFollower::new(path, section.job.geometry.rotation, reference_deg);
        for k in samples {
            let place = follower.unwrapped(setpoints.spindle[k]).expect("an angle");
            assert!(near(place.radius_mm, setpoints.axes[0][k], 1e-9), "line {line}, setpoint {k}");
            assert!(near(place.z_mm, setpoints.axes[1][k], 1e-9), "line {line}, setpoint {k}");
        }
    }
}

#[test]
fn the_axis_that_vibrates_is_stated_and_is_not_that_of_the_lead() {
    for (from, to, code) in [
        ("G165 P3 Z0.0 Q1.3", "G165 P3 X80.0 Q1.3", "THREAD-LEAD-X"),
        ("G165 P3 Z0.0 Q1.3", "G165 P3 X80.0 Z0.0 Q1.3", "PRG-FUNCTION-WORD"),
        ("G165 P3 Z0.0 Q1.3", "G165 P3 Q1.3", "PRG-FUNCTION-WORD-MISSING"),
        (
            "G32 X20.0 F4.0\nG0 Z5.0\nG0 X80.0\n(--- PASS 2",
            "G32 Z-90.0 F4.0\nG0 Z5.0\nG0 X80.0\n(--- PASS 2",
            "THREAD-LEAD-X",
        ),
    ] {
        assert!(FACE.contains(from), "{from}");
        let report = validate(&FACE.replace(from, to), &lathe());
        let found = codes(&report);
        assert!(!report.is_accepted() && found.contains(&code.to_owned()), "{to}: {found:?}");
    }
    // What does not vibrate may lead anywhere.
    accepted(&FACE.replace("G32 X20.0 F4.0 A0.0", "G32 Z-40.0 F4.0 A0.0"), &lathe());
}

/// A cone steeper than 45 degrees, from the small end: the cycles lead along X and feed in along X.
fn cone(words: &str, vibration: &str) -> String {
    let off = if vibration.is_empty() { "" } else { "G165 P0\n" };
    format!("G97 S200 M3\nG0 X70 Z5\n{vibration}{words}{off}G0 X80 Z10\nM30\n")
}

const CYCLES: [&str; 2] = [
    "G92 X60 Z-2 R-20 F2\nX59.8\nX59.7\n",
    // One flank, two finishing passes.
    "G76 P020060 Q50 R0.02\nG76 X59.4 Z-2 R-20 P400 Q150 F2\n",
];

#[test]
fn cycles_of_a_steep_cone_lead_along_x() {
    let mut config = lathe();
    config.profile.language.turning.thread_chamfer_tenths = Some(0);
    for (cycle, vibration) in CYCLES.into_iter().flat_map(|cycle| [(cycle, ""), (cycle, "G165 P3 Z5.5 Q1.3\n")]) {
        let program = cone(cycle, vibration);
        let report = validate(&program, &config);
        assert!(report.is_accepted(), "{program}{:#?}", report.findings);
        let setpoints = run(&program, &config);
        check_limits(&setpoints, &config);
        assert_eq!((setpoints.axes[0].last(), setpoints.axes[1].last()), (Some(&40.0), Some(&10.0)));
        // While the lead axis runs at its speed X goes 2 mm in a revolution.
        let exact: Vec<usize> = (1..setpoints.len())
            .filter(|&k| {
                let turned_deg = setpoints.spindle[k] - setpoints.spindle[k - 1];
                let along_mm = setpoints.axes[0][k] - setpoints.axes[0][k - 1];
                setpoints.feed[k] > 0.0 && near(along_mm / turned_deg * 360.0, 2.0, 1e-6)
            })
            .collect();
        assert!(exact.len() > 5_000, "{}", exact.len());
        // The deepest pass is as deep as its X says: the cone falls by 0.35 mm on each mm of the radius.
        let above_mm = |k: usize| setpoints.axes[1][k] - (5.0 - 0.35 * (setpoints.axes[0][k] - 10.0));
        let deepest_mm = exact.iter().map(|&k| above_mm(k)).fold(f64::INFINITY, f64::min);
        assert!(near(deepest_mm, if cycle == CYCLES[0] { -0.0525 } else { -0.105 }, 1e-4), "{program}{deepest_mm}");
        for at in [0.2, 0.5, 0.8] {
            let taken = snapshots(program.as_bytes(), &config);
            let (index, offset, snapshot) = &taken[(taken.len() as f64 * at) as usize];
            let (first, rest) = resume(program.as_bytes(), &config, *offset, snapshot);
            assert_eq!(first, *index);
            assert!(all_bits(&rest) == all_bits(&setpoints)[first as usize..], "{program}from {first}");
        }
        if vibration.is_empty() {
            continue;
        }
        let [section] = report.threads.as_slice() else { panic!("{} threads", report.threads.len()) };
        assert_eq!(section.job.geometry.lead_axis, LeadAxis::X);
        assert!(section.job.passes[0].vibrates() && near(section.job.passes[0].depth_mm, 0.5, 0.2));
        // Away from the face: towards larger Z, by no more than the amplitude.
        let most_mm = section.job.passes.iter().map(|pass| pass.amplitude_mm).fold(0.0, f64::max);
        assert!(setpoints.vibration.iter().all(|offset| (0.0..=most_mm + 1e-9).contains(offset)));
        assert!(setpoints.vibration.iter().any(|offset| *offset > 0.9 * most_mm));
    }
}

#[test]
fn a_vibration_into_the_work_and_a_pull_out_along_the_lead_are_refused() {
    let mut config = lathe();
    config.profile.language.turning.thread_chamfer_tenths = Some(0);
    let found = |text: &str, config: &feedwave_cutting::PipelineConfig| {
        let report = validate(text, config);
        assert!(!report.is_accepted(), "{text}");
        codes(&report)
    };
    // From the large end the work is on the side of larger Z.
    let inwards = "G92 X20 Z-2 R20 F2\n";
    assert!(found(&cone(inwards, "G165 P3 Z5.5 Q1.3\n"), &config).contains(&"PRG-THREAD-CYCLE-SIDE".to_owned()));
    accepted(&cone(inwards, ""), &config);
    // A bore that narrows has it at smaller Z again.
    let bore = "G97 S200 M3\nG0 X10 Z5\nG165 P3 Z5.5 Q1.3\nG92 X20 Z-2 R20 F2\nG165 P0\nM30\n";
    accepted(bore, &config);
    assert!(
        found(&bore.replace("R20", "R-20").replace("X10", "X4").replace("X20", "X60"), &config)
            .contains(&"PRG-THREAD-CYCLE-SIDE".to_owned())
    );
    config.profile.language.turning.thread_chamfer_tenths = Some(10);
    for vibration in ["", "G165 P3 Z5.5 Q1.3\n"] {
        assert!(
            found(&cone(CYCLES[0], vibration), &config).contains(&"THREAD-TRAVEL".to_owned())
                || found(&cone(CYCLES[0], vibration), &config).contains(&"PRG-THREAD-TRAVEL".to_owned())
        );
    }
    // At exactly 45 degrees the tool is pulled out, and both axes keep their limits.
    let equal = cone("G92 X60 Z-15 R-20 F2\n", "");
    accepted(&equal, &config);
    check_limits(&run(&equal, &config), &config);
}

#[test]
fn a_pass_above_the_face_without_vibration_is_a_thread_of_its_own() {
    let program = FACE.replace("G0 Z-1.0\nG32 X20.0 F4.0 A0.0", "G0 Z0.2\nG32 X20.0 F4.0 A0.0");
    let report = accepted(&program, &lathe());
    assert_eq!(report.threads.iter().map(|section| section.job.passes.len()).collect::<Vec<_>>(), [3]);
    check_limits(&run(&program, &lathe()), &lathe());
    let vibrating = program.replace("G32 X20.0 F4.0 A0.0", "G32 X20.0 F4.0");
    assert!(codes(&validate(&vibrating, &lathe())).contains(&"THREAD-FACE-SIDE".to_owned()));
}

#[test]
fn a_planned_thread_on_a_face_is_accepted_and_breaks_its_chip() {
    for (taper, law) in [(0.0, DepthLaw::SquareRoot), (-0.1, DepthLaw::Constant), (0.2, DepthLaw::SquareRoot)] {
        for (start_mm, end_mm, starts) in [(40.0, 10.0, 1), (12.0, 45.0, 2)] {
            let geometry = ThreadGeometry {
                lead_axis: LeadAxis::X,
                side: ThreadSide::External,
                work_mm: -1.5,
                start_mm,
                end_mm,
                taper,
                lead_mm: 4.0 * f64::from(starts),
                starts,
                rotation: SpindleRotation::Forward,
            };
            let request = ThreadRequest {
                geometry,
                hand: None,
                profile: GrooveProfile::pointed(60.0),
                depth_mm: 1.0,
                finishing_allowance_mm: 0.05,
                first_depth_mm: 0.4,
                infeed: InfeedPattern::Radial,
                law,
                method: PassMethod::StartAngle,
                start_up: StartUp::Preparatory,
                vibrations_per_rev: 2.0,
                spindle_rev_per_min: 150.0,
                amplitude_margin: 1.1,
                limits: ThreadLimits { finishing_thickness_mm: Some(0.2), ..ThreadLimits::default() },
            };
            let plan = plan_thread(&request).unwrap_or_else(|findings| panic!("{findings:#?}"));
            let text = thread_program_text(&plan.job, &ThreadTextOptions::default());
            let report = accepted(&text, &lathe());
            let [section] = report.threads.as_slice() else { panic!("{} threads", report.threads.len()) };
            let job = &section.job;
            assert_eq!((job.geometry.lead_axis, job.geometry.starts), (LeadAxis::X, starts));
            assert!(near(job.geometry.taper, taper, 1e-4) && near(job.geometry.work_mm, -1.5, 1e-9));
            assert_eq!(job.passes.len(), plan.job.passes.len());
            for (read, planned) in job.passes.iter().zip(&plan.job.passes) {
                assert!(near(read.depth_mm, planned.depth_mm, 1e-4), "{read:?} {planned:?}\n{text}");
                assert!(near(read.amplitude_mm, planned.amplitude_mm, 1e-4), "{read:?} {planned:?}\n{text}");
                assert_eq!(read.start, planned.start);
            }
            let vibrating = job.passes.iter().zip(&section.report.passes).filter(|(pass, _)| pass.vibrates());
            assert!(vibrating.clone().count() >= 2);
            assert!(vibrating.clone().all(|(_, pass)| pass.depth.broken && pass.section.broken), "{text}");
            check_limits(&run(&text, &lathe()), &lathe());
        }
    }
}
