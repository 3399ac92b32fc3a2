//! Threads through the whole pipeline, against the numbers and conditions of docs/functions/thread-vibration.md.

mod corners;
mod face;
mod frames;
mod random;

use std::f64::consts::PI;

use crate::common::{Setpoints, run, validate};
use feedwave_cutting::thread::{SpindleRotation, StartUp, ThreadFollower, ThreadPath, ThreadSectionReport};
use feedwave_cutting::{MachineProfile, OverrideChange, PipelineConfig, ValidationReport};
use feedwave_program::Severity;

const PROGRAM_A: &str = include_str!("../../../../tests/fixtures/thread-a.nc");
const PROGRAM_B: &str = include_str!("../../../../tests/fixtures/thread-b.nc");

fn lathe() -> PipelineConfig {
    PipelineConfig::new(MachineProfile::lathe())
}

/// In the worked programs X vibrates by more than 1 mm.
fn delayed() -> PipelineConfig {
    let mut config = lathe();
    config.profile.thread_vibration.start_up = StartUp::Delayed;
    config
}

fn accepted(program: &str, config: &PipelineConfig) -> ValidationReport {
    let report = validate(program, config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    report
}

fn codes(report: &ValidationReport) -> Vec<String> {
    report.findings.iter().map(|finding| finding.code.to_string()).collect()
}

/// Lines with threading passes.
fn lines(section: &ThreadSectionReport) -> Vec<u32> {
    section.job.passes.iter().map(|pass| pass.span.line).collect()
}

/// Setpoints of a line in which the spindle is past the reference point and the path moves.
fn cutting(setpoints: &Setpoints, line: u32) -> Vec<usize> {
    (0..setpoints.len()).filter(|&k| setpoints.line[k] == line && setpoints.feed[k] > 0.0).collect()
}

fn near(value: f64, expected: f64, tolerance: f64) -> bool {
    (value - expected).abs() <= tolerance
}

/// Retreat (docs/functions/thread-vibration.md, "Amplitude"): (A/2)·(1 − cos ψ), ψ = D·θ − Δ with D = 2.
fn wave(amplitude_mm: f64, spindle_deg: f64, shift_deg: f64) -> f64 {
    0.5 * amplitude_mm * (1.0 - ((2.0 * spindle_deg - shift_deg).rem_euclid(360.0) * PI / 180.0).cos())
}

#[test]
fn program_a_is_cut_as_the_page_says() {
    let report = accepted(PROGRAM_A, &lathe());
    assert_eq!(report.threads.len(), 1);
    assert_eq!((report.summary.thread_count, report.summary.thread_passes), (1, 4));
    let section = &report.threads[0];
    assert!(section.on_line.is_some() && !section.work_diameter_assumed);
    let setpoints = run(PROGRAM_A, &lathe());
    let expected = [
        (8.0, 2.4, 0.0, 0.0),
        (7.172, 0.9936, 180.0, 325.584),
        (6.536, 0.7632, 0.0, 299.088),
        (6.5, 0.0, 180.0, 297.648),
    ];
    for ((pass, line), (x, amplitude, shift_deg, start_deg)) in
        section.job.passes.iter().zip(lines(section)).zip(expected)
    {
        assert!(near(pass.depth_mm, 0.5 * (10.0 - x), 1e-9));
        assert!(near(2.0 * pass.amplitude_mm, amplitude, 1e-9), "{}", pass.amplitude_mm);
        assert_eq!((pass.phase_shift_deg, pass.start_angle_deg), (shift_deg, start_deg));
        let samples = cutting(&setpoints, line);
        assert!(samples.len() > 1_000);
        let mut exact = 0;
        for &k in &samples {
            let retreat_mm = wave(0.5 * amplitude, setpoints.spindle[k], shift_deg);
            assert!(near(setpoints.vibration[k], retreat_mm, 1e-9), "setpoint {k}");
            assert!(near(setpoints.axes[0][k], 0.5 * x + retreat_mm, 1e-9), "setpoint {k}");
            if (setpoints.feed[k] - 2.5 * 300.0).abs() < 1e-6 {
                // The lead axis lags behind by half its run-up, in every pass.
                let turns = (100.0 - setpoints.axes[1][k]) / 2.5 + 0.5 * section.job.run_up.angle_deg / 360.0;
                let angle_deg = (turns * 360.0 + start_deg - setpoints.spindle[k]).rem_euclid(360.0);
                assert!(angle_deg.min(360.0 - angle_deg) < 1e-6, "setpoint {k}: {angle_deg}");
                exact += 1;
            }
        }
        assert!(exact > 1_000);
    }
    assert_eq!(setpoints.axes[1].last(), Some(&100.0));
    let ribbons = codes(&report).iter().filter(|code| *code == "THREAD-CHIP-RIBBON").count();
    assert_eq!(ribbons, 2);
    assert!(codes(&report).contains(&"THREAD-CRESTS".to_owned()));
}

#[test]
fn program_b_cuts_one_path_with_three_phases() {
    for config in [lathe(), delayed()] {
        let report = accepted(PROGRAM_B, &config);
        let section = &report.threads[0];
        let shifts: Vec<_> = section.job.passes.iter().map(|pass| pass.phase_shift_deg).collect();
        assert_eq!(shifts[..3], [0.0, 120.0, 240.0]);
        assert!(section.job.passes[..3].iter().all(|pass| near(pass.amplitude_mm, 1.8, 1e-9)));
        let prepared: Vec<_> = section.report.passes[..3].iter().map(|pass| pass.prepared_phase_deg).collect();
        assert_eq!(prepared, [0.0, 240.0, 120.0]);
        let setpoints = run(PROGRAM_B, &config);
        for (line, shift_deg) in lines(section).into_iter().zip([0.0, 120.0, 240.0]) {
            let samples = cutting(&setpoints, line);
            // Start-up B vibrates from a third of a turn of the wave later at the latest.
            for &k in samples.iter().skip(200) {
                assert!(near(setpoints.vibration[k], wave(1.8, setpoints.spindle[k], shift_deg), 1e-9));
            }
        }
    }
}

/// Velocity and acceleration of every axis at every setpoint.
fn check_limits(setpoints: &Setpoints, config: &PipelineConfig) {
    let period_s = config.period_s();
    for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
        for (k, window) in column.windows(3).enumerate() {
            let velocity = (window[1] - window[0]) / period_s;
            let acceleration = (window[2] - 2.0 * window[1] + window[0]) / (period_s * period_s);
            assert!(velocity.abs() <= axis.max_velocity_per_s * (1.0 + 1e-6), "{velocity} of {} at {k}", axis.name);
            let most = axis.max_acceleration_per_s2 * (1.0 + 1e-6) + 1e-13 / (period_s * period_s);
            assert!(acceleration.abs() <= most, "{acceleration} of {} at {k}", axis.name);
        }
    }
}

#[test]
fn the_preparatory_movement_is_done_before_the_reference_point() {
    let setpoints = run(PROGRAM_B, &lathe());
    let section = &accepted(PROGRAM_B, &lathe()).threads[0];
    let line = lines(section)[1];
    let first = cutting(&setpoints, line)[0];
    // The retreat of phase 240°: (A/2)·(1 − cos 240°).
    let prepared_mm = 0.9 * 1.5;
    let reference_deg = (setpoints.spindle[first] / 360.0).floor() * 360.0;
    let waiting = (0..first).rev().find(|&k| setpoints.spindle[k] <= reference_deg).expect("it waits");
    assert!(near(setpoints.vibration[waiting], prepared_mm, 1e-9));
    assert_eq!(setpoints.axes[1][waiting], 100.0);
    let moving = (0..waiting).rev().find(|&k| setpoints.vibration[k] < prepared_mm - 1e-9).expect("it moves there");
    assert!(setpoints.axes[0][moving] >= 3.5 && setpoints.line[moving] == line);
}

#[test]
fn a_combined_preparatory_movement_is_part_of_the_rapid() {
    let mut config = lathe();
    config.profile.thread_vibration.combined_preparation = true;
    let (combined, separate) = (run(PROGRAM_B, &config), run(PROGRAM_B, &lathe()));
    let section = &accepted(PROGRAM_B, &config).threads[0];
    let line = lines(section)[1];
    let deepest = |setpoints: &Setpoints, line: u32| {
        let rows = (0..setpoints.len()).filter(|&k| setpoints.line[k] == line);
        rows.map(|k| setpoints.axes[0][k]).fold(f64::INFINITY, f64::min)
    };
    assert!(near(deepest(&combined, line - 1), 3.5 + 1.35, 0.01), "{}", deepest(&combined, line - 1));
    assert!(near(deepest(&separate, line - 1), 3.5, 0.01));
    // The pass is the same.
    let (a, b) = (cutting(&combined, line), cutting(&separate, line));
    assert!(near(combined.axes[0][a[500]] - 3.5, combined.vibration[a[500]], 1e-12));
    assert!(near(wave(1.8, combined.spindle[a[500]], 120.0), combined.vibration[a[500]], 1e-9));
    assert!(a.len().abs_diff(b.len()) <= 1);
}

#[test]
fn a_follower_is_where_the_pipeline_is_at_the_same_angle() {
    for (config, program) in [
        (lathe(), PROGRAM_A.to_owned()),
        (delayed(), PROGRAM_B.to_owned()),
        (lathe(), PROGRAM_A.replace("S300 M3", "S300 M4")),
    ] {
        let setpoints = run(&program, &config);
        let section = &accepted(&program, &config).threads[0];
        let rotation = section.job.geometry.rotation;
        let sign = if rotation == SpindleRotation::Forward { 1.0 } else { -1.0 };
        for (pass, line) in section.job.passes.iter().zip(lines(section)) {
            let samples = cutting(&setpoints, line);
            let start_deg = setpoints.spindle[samples[0]] - sign * pass.start_angle_deg;
            let reference_deg = sign * (sign * start_deg / 360.0).floor() * 360.0;
            let path = ThreadPath::of_pass(&section.job, pass);
            let mut by_angle = ThreadFollower::new(path.clone(), rotation, reference_deg);
            let mut by_encoder = ThreadFollower::new(path, rotation, 0.0);
            by_encoder.encoder(reference_deg - sign * 1.0).expect("an angle");
            for k in samples[0] - 1..samples[samples.len() - 1] + 1 {
                let place = by_angle.unwrapped(setpoints.spindle[k]).expect("an angle");
                assert!(near(place.radius_mm, setpoints.axes[0][k], 1e-9), "line {line}, setpoint {k}");
                assert!(near(place.z_mm, setpoints.axes[1][k], 1e-9), "line {line}, setpoint {k}");
                assert!(near(place.retreat_mm, setpoints.vibration[k], 1e-9), "line {line}, setpoint {k}");
            }
            for k in samples {
                let turned = by_encoder.encoder(setpoints.spindle[k].rem_euclid(360.0)).expect("an angle");
                if pass.start_angle_deg == 0.0 {
                    assert!(near(turned.z_mm, setpoints.axes[1][k], 1e-9), "line {line}, setpoint {k}");
                }
            }
        }
    }
}

#[test]
fn the_feed_override_does_not_act_on_a_pass_and_feed_hold_waits_for_its_end() {
    let program = "G97 S600 M3\nG0 X14 Z10\nG165 P3 X10 Q1.2\nG0 X8\nG32 Z-20 F2.5\nG0 X14\nG165 P0\nM30\n";
    let plain = run(program, &lathe());
    let first = cutting(&plain, 5)[100] as u64;
    let halved = PipelineConfig { overrides: vec![OverrideChange { index: first, ratio: 0.5 }], ..lathe() };
    let changed = run(program, &halved);
    let end = *cutting(&plain, 5).last().expect("a pass");
    for k in 0..=end {
        assert_eq!(plain.bits(k), changed.bits(k), "setpoint {k}");
    }
    let resumes = end as u64 + 5_000;
    let overrides = vec![OverrideChange { index: first, ratio: 0.0 }, OverrideChange { index: resumes, ratio: 1.0 }];
    let held = run(program, &PipelineConfig { overrides, ..lathe() });
    for k in 0..=end {
        assert_eq!(plain.bits(k), held.bits(k), "setpoint {k}");
    }
    for k in end + 300..resumes as usize {
        assert_eq!((held.axes[0][k], held.axes[1][k]), (4.0, -20.0), "setpoint {k}");
    }
    assert_eq!(held.axes[0].last(), Some(&7.0));
    // A hold before the pass keeps it from starting.
    let before = plain.line.iter().position(|&line| line == 5).expect("line 5") as u64 - 20;
    let overrides = vec![OverrideChange { index: before, ratio: 0.0 }, OverrideChange { index: 9_000, ratio: 1.0 }];
    let held = run(program, &PipelineConfig { overrides, ..lathe() });
    assert!(cutting(&held, 5).first().is_some_and(|&k| k >= 9_000));
    assert_eq!(held.axes[0].last(), Some(&7.0));
}

#[test]
fn parts_of_one_thread_run_through_and_end_exactly() {
    let program = "G97 S600 M3\nG0 X20 Z5\nG32 Z-20 F2\nG32 X22 Z-40 F2\nG32 Z-50 F4\nG0 X30\nM30\n";
    let setpoints = run(program, &lathe());
    let moving: Vec<usize> = (0..setpoints.len()).filter(|&k| (3..=5).contains(&setpoints.line[k])).collect();
    let started = moving.iter().position(|&k| setpoints.feed[k] > 0.0).expect("it starts");
    let last = *moving.last().expect("a pass");
    for &k in &moving[started..] {
        let is_inside = setpoints.axes[1][k] < 4.0 && setpoints.axes[1][k] > -49.0;
        assert!(!is_inside || setpoints.feed[k] > 2.0 * 600.0 - 1e-6, "setpoint {k} waits: {}", setpoints.feed[k]);
    }
    assert!(near(setpoints.axes[0][last], 11.0, 1e-6) && near(setpoints.axes[1][last], -50.0, 0.01));
    assert_eq!((setpoints.axes[0].last(), setpoints.axes[1].last()), (Some(&15.0), Some(&-50.0)));
    let report = accepted(program, &lathe());
    let shares = report.summary.cutting_time_s + report.summary.rapid_time_s + report.summary.rest_time_s;
    assert!(near(shares, report.summary.duration_s, 1e-9));
    assert!(near(report.summary.path_length_mm, *setpoints.path.last().expect("setpoints"), 1e-9));
}

#[test]
fn a_thread_without_vibration_is_judged_with_an_assumed_work_diameter() {
    let program = "G97 S600 M3\nG0 X24 Z5\nG92 X19.3 Z-30 F2\nX18.9\nX18.6\nX18.4\nG0 X30\nM30\n";
    let report = accepted(program, &lathe());
    let [section] = &report.threads[..] else { panic!("{} threads", report.threads.len()) };
    assert!(section.work_diameter_assumed && section.ratio.is_none() && section.on_line.is_none());
    assert_eq!(section.job.passes.len(), 4);
    assert!(near(2.0 * section.job.geometry.work_mm, 19.7, 1e-9), "{}", section.job.geometry.work_mm);
}

#[test]
fn threads_without_vibration_are_accepted_wherever_the_work_lies() {
    let cut = |passes: &[f64]| {
        let passes: Vec<String> = passes.iter().map(|x| format!("G0 X{x} Z5\nG32 Z-30 F2\nG0 Z5")).collect();
        let report = accepted(&format!("G97 S600 M3\n{}\nM30\n", passes.join("\n")), &lathe());
        let [section] = <[_; 1]>::try_from(report.threads).expect("one thread");
        assert!(section.work_diameter_assumed);
        let depths = section.job.passes.iter().map(|pass| pass.depth_mm).collect::<Vec<_>>();
        (section.job.geometry.side, section.job.geometry.work_mm, depths)
    };
    for passes in [&[19.3][..], &[19.3, 18.9, 18.6], &[20.0, 20.4, 20.7]] {
        let mirrored: Vec<f64> = passes.iter().map(|x| -x).collect();
        assert_eq!(cut(&mirrored), cut(passes), "{passes:?}");
    }
    // The tool is on the axis, as a tap is.
    for passes in [&[0.0][..], &[0.0, 0.2], &[0.1, -0.1], &[-0.2]] {
        let (_, work_mm, depths) = cut(passes);
        assert!(depths.iter().all(|depth| (0.0..work_mm).contains(depth)), "{passes:?}: {work_mm} {depths:?}");
    }
}

#[test]
fn conditions_are_refused_before_anything_moves() {
    let program =
        |pass: &str| format!("G97 S600 M3\nG0 X14 Z100\nG165 P3 X10 Q1.2\nG0 X8\n{pass}\nG0 X14\nG165 P0\nM30\n");
    let refused = |text: &str, code: &str| {
        let report = validate(text, &lathe());
        assert!(!report.is_accepted() && report.summary.setpoint_count == 0, "{code}: {:?}", codes(&report));
        let finding = report.findings.iter().find(|finding| finding.code == code);
        let finding = finding.unwrap_or_else(|| panic!("{code} is missing: {:?}", codes(&report)));
        assert!(!finding.suggestions.is_empty() && finding.span.line > 0, "{code}");
    };
    refused(&program("G32 Z60 F2.5").replace("S600", "S4000"), "THREAD-VIBRATION-ACCELERATION");
    refused(&program("G32 Z60 F20 A0.0").replace("S600", "S4000"), "THREAD-LEAD-SPEED");
    refused(&program("G32 Z60 F0.5 A0.0\nG32 X12 Z40 F20").replace("S600", "S4000"), "THREAD-AXIS-SPEED");
    refused(&program("G32 Z99.99 F2.5 A0.0"), "THREAD-LENGTH-SHORT");
    refused(&program("G32 X40 Z99 F2.5"), "THREAD-LEAD-X");
    refused(&program("G32 Z60 F2.5").replace("Q1.2", "Q0.9"), "THREAD-MODE-WORD");
    refused(&program("G32 Z60 F2.5").replace("P3 X10", "P3"), "PRG-FUNCTION-WORD-MISSING");
    refused(&program("G32 Z60 F2.5\nG32 Z50 F2.5 R120"), "THREAD-PART-VIBRATION");
    refused(&program("G32 Z60 F2.5").replace("G0 X8\n", "G0 X8\nG165 P3 X10 Q1.2\n"), "THREAD-NESTED");
    refused("G97 S600 M3\nG0 X8 Z100\nG32 Z60 F2.5 A2.4\nM30\n", "THREAD-VIBRATION-OFF");
    refused("G97 S600 M3\nG165 P0\nM30\n", "THREAD-OFF-WITHOUT-ON");
    assert_eq!(
        codes(&validate("G97 S600 M3\nG165 P3 X10\nG165 P0\nM30\n", &lathe())),
        ["PRG-FUNCTION-WORD-MISSING"],
        "switching off what was refused is no second error"
    );
    refused("G97 S600 M3\nG0 X8 Z100\nG200 F50 A0.03\nG32 Z60 F2.5\nG201\nM30\n", "VIB-THREAD");
    let mut limited = lathe();
    limited.profile.thread_vibration.approach_mm = Some(0.001);
    assert!(codes(&validate(&program("G32 Z60 F2.5"), &limited)).contains(&"THREAD-APPROACH-SHORT".to_owned()));
    limited.profile.machine.axes[0].travel_max = Some(5.1);
    assert!(codes(&validate(&program("G32 Z60 F2.5"), &limited)).contains(&"AXIS-TRAVEL".to_owned()));
}

#[test]
fn what_spoils_the_chip_is_said() {
    let program = |passes: &str| format!("G97 S300 M3\nG0 X14 Z100\nG165 P3 X10 Q1.2\n{passes}G165 P0\nM30\n");
    let pass = |words: &str| format!("G0 X{words}\nG0 X14\nG0 Z100\n");
    let two = |first: &str, second: &str| codes(&validate(&program(&(pass(first) + &pass(second))), &lathe()));
    assert!(two("9\nG32 Z60 F2.5", "8.4\nG32 Z60 F2.5 R0").contains(&"THREAD-PHASE-EQUAL".to_owned()));
    assert!(two("9\nG32 Z60 F2.5", "8.4\nG32 Z60 F2.5 A0.5").contains(&"THREAD-AMPLITUDE-SMALL".to_owned()));
    assert!(two("9\nG32 Z60 F2.5 A0.9", "8.4\nG32 Z60 F2.5").contains(&"THREAD-FIRST-PASS".to_owned()));
    assert!(two("9\nG32 Z60 F2.5", "9\nG32 Z60 F2.5").contains(&"THREAD-NO-INFEED".to_owned()));
    let changed = two("9\nG32 Z60 F2.5\nG97 S200", "8.4\nG32 Z60 F2.5");
    assert!(changed.contains(&"THREAD-SPEED-CHANGED".to_owned()), "{changed:?}");
}

/// Cures of the finding of a code: their texts, and the words that they put in place.
fn cures(report: &ValidationReport, code: &str) -> Vec<(String, Option<String>)> {
    let found = report.findings.iter().find(|finding| finding.code == code);
    let found = found.unwrap_or_else(|| panic!("{code} is not among {:?}", codes(report)));
    let cure = |cure: &feedwave_program::Suggestion| {
        (cure.message.to_string(), cure.replacement.as_ref().map(ToString::to_string))
    };
    found.suggestions.iter().map(cure).collect()
}

#[test]
fn a_word_that_a_cycle_does_not_have_is_named_of_a_block_of_its_own() {
    let cycle = "G97 S300 M3\nG0 X14 Z5\nG165 P3 X10 Q1.2\nG92 X9 Z-20 F1.5\nX8.6\nX8.6\nG165 P0\nM30\n";
    let mut config = lathe();
    config.profile.thread_vibration.even_phase_shift_deg = 40.0;
    let report = validate(cycle, &config);
    for code in ["THREAD-PHASE-UNBROKEN", "THREAD-NO-INFEED"] {
        let of_words = cures(&report, code);
        assert!(!of_words.is_empty());
        for (cure, word) in of_words {
            assert!(cure.ends_with("a cycle has no word for it, a threading block of its own has"), "{cure}");
            assert_eq!(word, None);
        }
    }
    let blocks = "G97 S300 M3\nG0 X14 Z5\nG165 P3 X10 Q1.2\nG0 X9\nG32 Z-20 F1.5\nG0 X14\nG0 Z5\nG0 X8.6\nG32 Z-20 F1.5\nG0 X14\n\
                  G165 P0\nM30\n";
    let of_words = cures(&validate(blocks, &config), "THREAD-PHASE-UNBROKEN");
    assert!(of_words.iter().all(|(cure, _)| !cure.contains("cycle")), "{of_words:?}");
}

#[test]
fn a_ratio_is_a_cure_only_where_it_decides_every_amplitude() {
    let flank = |second: &str| {
        format!(
            "G97 S100 M3\nG0 X14 Z100\nG165 P3 X10 Q1.2\nG0 X9.4\nG32 Z60 F2.5\nG0 X14\nG0 Z100\nG0 X9\nG32 Z60 F2.5 \
             Q340{second}\nG0 X14\nG165 P0\nM30\n"
        )
    };
    let named = |text: &str| {
        let cures = cures(&validate(text, &lathe()), "THREAD-CHIP-RIBBON");
        cures
            .into_iter()
            .find_map(|(cure, _)| Some(cure.strip_prefix("use a ratio of ")?.split_once(' ')?.0.to_owned()))
    };
    assert_eq!(named(&flank(" A0.5")), None, "the pass has an amplitude of its own");
    let ratio = named(&flank("")).expect("a ratio");
    let cured = flank("").replace("Q1.2", &format!("Q{ratio}"));
    let after = codes(&validate(&cured, &lathe()));
    assert!(
        !after.iter().any(|code| code.starts_with("THREAD-CHIP") || code.starts_with("THREAD-VIBRATION")),
        "{after:?}"
    );
}

#[test]
fn every_start_of_a_thread_has_its_own_infeed() {
    let pass = |x: f64, q: f64| format!("G0 X{x}\nG32 Z60 F5 Q{q}\nG0 X14\nG0 Z100\n");
    let by_depth = pass(9.4, 0.0) + &pass(9.4, 180.0) + &pass(9.0, 0.0) + &pass(9.0, 180.0);
    let by_start = pass(9.4, 0.0) + &pass(9.0, 0.0) + &pass(9.4, 180.0) + &pass(9.0, 180.0);
    for (passes, starts) in [(by_depth, [0, 1, 0, 1]), (by_start, [0, 0, 1, 1])] {
        let text = format!("G97 S300 M3\nG0 X14 Z100\nG165 P3 X10 Q1.5\n{passes}G165 P0\nM30\n");
        let report = accepted(&text, &lathe());
        let job = &report.threads[0].job;
        assert_eq!(job.geometry.starts, 2);
        assert_eq!(job.passes.iter().map(|pass| pass.start).collect::<Vec<_>>(), starts);
        for (index, pass) in job.passes.iter().enumerate() {
            let infeed_mm = if near(pass.depth_mm, 0.3, 1e-9) { 0.3 } else { 0.2 };
            assert!(near(job.infeed_mm(index), infeed_mm, 1e-9));
            assert!(near(pass.amplitude_mm, 1.5 * infeed_mm, 1e-9));
            assert_eq!(pass.phase_shift_deg, if infeed_mm == 0.3 { 0.0 } else { 180.0 });
        }
    }
}

/// A pass on the other flank may meet no groove yet, and is of the start that it is nearest to, whichever was cut before.
#[test]
fn starts_that_are_cut_in_turn_keep_their_grooves_while_flanks_alternate() {
    let passes = [(12.0, 29.266), (11.45, 28.96), (11.845, 28.728), (11.574, 28.53), (11.737, 28.356), (11.669, 28.2)];
    for starts in 2..=3_u32 {
        let lead_mm = 1.5 * f64::from(starts);
        let mut text = "G97 S200 M3\nG0 X34 Z12\nG165 P3 X30 Q1.2\n".to_owned();
        for (z_mm, x_mm) in passes {
            for start in 0..starts {
                let z_mm = z_mm + 1.5 * f64::from(start);
                text += &format!("G0 X34\nG0 Z{z_mm:.3}\nG0 X{x_mm}\nG32 Z-14 F{lead_mm}\n");
            }
        }
        let report = validate(&(text + "G0 X34\nG165 P0\nM30\n"), &lathe());
        assert!(!codes(&report).contains(&"THREAD-PROFILE-WIDE".to_owned()), "{:?}", codes(&report));
        let job = &report.threads[0].job;
        assert_eq!(job.geometry.starts, starts);
        let found: Vec<_> = job.passes.iter().map(|pass| pass.start).collect();
        let in_turn: Vec<_> = passes.iter().flat_map(|_| 0..starts).collect();
        assert_eq!(found, in_turn);
    }
}

/// Grooves that are too wide for two starts meet, and are two starts all the same, in whichever order they are cut.
#[test]
fn a_pass_that_goes_back_to_a_smaller_depth_elsewhere_begins_a_further_start() {
    let pass = |x: f64, q: f64| format!("G0 X{x}\nG32 Z60 F2.5 Q{q}\nG0 X14\nG0 Z100\n");
    let of_start = |q| pass(8.0, q) + &pass(7.2, q) + &pass(6.6, q);
    let by_depth: String = [8.0, 7.2, 6.6].map(|x| pass(x, 0.0) + &pass(x, 180.0)).concat();
    for passes in [by_depth, of_start(0.0) + &of_start(180.0)] {
        let report = validate(&format!("G97 S300 M3\nG0 X14 Z100\nG165 P3 X10 Q1.2\n{passes}G165 P0\nM30\n"), &lathe());
        assert!(codes(&report).contains(&"THREAD-PROFILE-WIDE".to_owned()), "{:?}", codes(&report));
        let job = &report.threads[0].job;
        assert_eq!(job.geometry.starts, 2);
        let first_mm: Vec<f64> = job.passes.iter().filter(|it| it.depth_mm < 1.1).map(|it| it.amplitude_mm).collect();
        assert!(first_mm.len() == 2 && first_mm.iter().all(|mm| near(*mm, 1.2, 1e-9)), "{first_mm:?}");
    }
    // A pass at the same place that goes less deep is one of the start whose groove it runs in.
    let again = of_start(0.0) + "G0 X7\nG32 Z60 F2.5 A0\nG0 X14\n";
    let report = accepted(&format!("G97 S300 M3\nG0 X14 Z100\nG165 P3 X10 Q1.2\n{again}G165 P0\nM30\n"), &lathe());
    assert_eq!(report.threads[0].job.geometry.starts, 1);
}

/// A cycle of many passes in one block.
fn cycle(words: &str) -> String {
    format!("G97 M3 S600\nG0 X24 Z5\nG76 P2. {words}\nG0 X40\nM30\n")
}

#[test]
fn a_cycle_with_tapers_and_without_vibration_needs_no_words_for_it() {
    for ends in ["L1", "L2", "L3"] {
        let report = validate(&cycle(&format!("Z-30. I-2. J.4 K2.4 E3. H2 {ends}")), &lathe());
        assert!(!codes(&report).contains(&"THREAD-PART-VIBRATION".to_owned()), "{ends}: {:?}", codes(&report));
        assert!(report.is_accepted(), "{ends}: {:#?}", report.findings);
    }
    let chained = |second: &str| {
        let text = format!(
            "G97 S600 M3\nG0 X14 Z100\nG165 P3 X10 Q1.2\nG0 X8\nG32 Z60 F2.5 A1.5 R90\nG32 Z50 F2.5{second}\nG0 X14\n\
             G165 P0\nM30\n"
        );
        codes(&validate(&text, &lathe()))
    };
    for (second, contradicts) in [("", false), (" A1.5 R90", false), (" A1.4", true), (" A0.0", true), (" R0", true)] {
        assert_eq!(chained(second).contains(&"THREAD-PART-VIBRATION".to_owned()), contradicts, "{second:?}");
    }
}

#[test]
fn the_passes_of_one_block_are_one_finding_with_the_worst_of_them() {
    let report = validate(&cycle("Z4.99 I-2. J.06 K2.4 R1.2 H2"), &lathe());
    let passes = report.threads[0].job.passes.len() as u64;
    assert!(passes > 30, "{passes}");
    let short: Vec<_> = report.findings.iter().filter(|finding| finding.code == "THREAD-LENGTH-SHORT").collect();
    let [short] = &short[..] else { panic!("{} findings", short.len()) };
    assert_eq!(short.occurrences, passes);
    let place = |number| Some(feedwave_program::Occurrence { name: "pass".into(), number });
    assert_eq!(short.first, place(1));
    let air: Vec<_> = report.findings.iter().filter(|finding| finding.code == "THREAD-PASS-AIR").collect();
    assert!(air.len() == 1 && air[0].occurrences == 2, "{air:#?}");
    let keys: std::collections::BTreeSet<_> =
        report.findings.iter().map(|finding| (finding.code.name(), finding.span.line)).collect();
    assert_eq!(keys.len(), report.findings.len(), "{:#?}", codes(&report));
}

#[test]
fn what_comes_between_the_blocks_of_a_thread_stops_the_tool_in_the_work() {
    let found = |between: &str, config: &PipelineConfig| {
        let lead = if config.profile.language.dialect == feedwave_program::DialectName::LinuxCnc { 'K' } else { 'F' };
        let program = format!(
            "G97 M3 S300\nG0 X8 Z100\nG{} Z80 {lead}2.5\n{between}G{0} Z60 {lead}2.5\nG0 X14\nZ100\nM30\n",
            if lead == 'K' { 33 } else { 32 }
        );
        let report = validate(&program, config);
        let stops = report.findings.into_iter().filter(|finding| finding.code == "THREAD-STOPS");
        stops.map(|finding| (finding.span.line, finding.severity, finding.related.len())).collect::<Vec<_>>()
    };
    let mut linuxcnc = lathe();
    linuxcnc.profile.language.dialect = feedwave_program::DialectName::LinuxCnc;
    for config in [lathe(), linuxcnc] {
        assert_eq!(found("", &config), []);
        assert_eq!(found("(A COMMENT)\n", &config), []);
        for between in ["S400\n", "G4 P0.5\n", "M8\n"] {
            assert_eq!(found(between, &config), [(5, Severity::Warning, 1)], "{between}");
        }
        // In the block itself; or where the tool leaves the thread in between.
        assert_eq!(found("S400 ", &config), [(4, Severity::Warning, 1)]);
        for between in ["G0 X14\nS400\nX8\n", "S400\nG0 X14\nG0 X8\n"] {
            assert_eq!(found(between, &config), [], "{between}");
        }
    }
}

/// What is only assumed of the work refuses nothing.
#[test]
fn a_groove_that_is_too_wide_by_an_assumed_depth_is_a_warning() {
    let passes = "G97 S300 M3\nG0 X14 Z100\nG92 X12 Z60 F1.25\nX10.8\nX9.6\nG0 X20\n";
    let report = accepted(&format!("{passes}M30\n"), &lathe());
    let found = report.findings.iter().find(|finding| finding.code.name() == "THREAD-PROFILE-WIDE");
    let found = found.unwrap_or_else(|| panic!("{:?}", codes(&report)));
    assert_eq!(found.severity, Severity::Warning);
    assert!(found.message.contains("no word states the diameter"), "{}", found.message);
    let stated = passes.replace("G92 X12", "G165 P3 X14 Q1.2\nG92 X12") + "G165 P0\nM30\n";
    let report = validate(&stated, &lathe());
    let found = report.findings.iter().find(|finding| finding.code.name() == "THREAD-PROFILE-WIDE");
    assert_eq!(found.map(|finding| finding.severity), Some(Severity::Error), "{:?}", codes(&report));
}
