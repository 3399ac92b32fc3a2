//! Threads on a face: the lead is along X, Z vibrates.

use std::f64::consts::PI;

use feedwave_cutting::thread::{LeadAxis, ThreadFollower, ThreadPath};

use super::common::{run, validate};
use super::{accepted, check_limits, codes, cutting, lathe, lines, near, wave};

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
