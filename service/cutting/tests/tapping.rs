//! Rigid tapping through the whole pipeline: spindle and tool are one motion, within the limits of the axes.

use crate::common::{all_bits, resume, run, run_appending, run_in_pieces, snapshots, validate};
use feedwave_cutting::{MachineProfile, OverrideChange, PipelineConfig, ValidationReport};
use proptest::prelude::*;

const PROGRAM: &str = "G90 G95\nM29 S600\nG0 X5 Y3 Z10\nG84 X5 Y3 Z-12 R4 P100 F1.25\nX9\nG80\nG0 Z20\nM30\n";

/// Lines of the two holes.
const HOLES: [u32; 2] = [4, 5];

fn mill() -> PipelineConfig {
    PipelineConfig::new(MachineProfile::mill())
}

fn codes(report: &ValidationReport) -> Vec<String> {
    report.findings.iter().map(|finding| finding.code.to_string()).collect()
}

/// The rows of a line between which the spindle turns.
fn turning(setpoints: &crate::common::Setpoints, line: u32) -> Vec<usize> {
    let turns = |k: &usize| setpoints.spindle[*k] != setpoints.spindle[*k - 1];
    (1..setpoints.len()).filter(|&k| setpoints.line[k] == line).filter(turns).collect()
}

#[test]
fn the_tool_is_where_the_spindle_says() {
    let report = validate(PROGRAM, &mill());
    assert!(report.is_accepted(), "{:#?}", report.findings);
    assert_eq!(codes(&report), ["THREAD-TAP-OVERRIDE"]);
    let setpoints = run(PROGRAM, &mill());
    let z = &setpoints.axes[2];
    let mut turned_deg = 0.0_f64;
    for line in HOLES {
        let rows = turning(&setpoints, line);
        assert!(rows.len() > 500, "{}", rows.len());
        let first = rows[0] - 1;
        // The row behind the last of a stroke shows its last turn as well.
        for &k in rows.iter().filter(|&&k| z[k] <= 4.0) {
            // Down and up again: the angle is that of the depth in both directions.
            let turns = (setpoints.spindle[k] - setpoints.spindle[first]) / 360.0;
            assert!((4.0 - z[k] - 1.25 * turns).abs() < 1e-9, "setpoint {k}: Z {} after {turns} turns", z[k]);
            turned_deg = turned_deg.max((setpoints.spindle[k] - setpoints.spindle[first]).abs());
        }
        let deepest = rows.iter().map(|&k| z[k]).fold(f64::INFINITY, f64::min);
        assert_eq!(deepest, -12.0);
        // Never faster than S, and S in between.
        let fastest = rows.iter().map(|&k| setpoints.feed[k] / 1.25).fold(0.0, f64::max);
        assert!((fastest - 600.0).abs() < 1e-6, "{fastest}");
    }
    assert!((turned_deg - 360.0 * 16.0 / 1.25).abs() < 1e-6);
    assert_eq!(z.last(), Some(&20.0));
}

#[test]
fn the_axis_keeps_to_its_limits() {
    let mut config = mill();
    for axis in &mut config.profile.machine.axes {
        axis.max_acceleration_per_s2 = 300.0;
        axis.max_jerk_per_s3 = 6_000.0;
    }
    let report = validate(PROGRAM, &config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    for axis in &report.summary.axes {
        assert!(axis.peak_acceleration_per_s2 <= 300.0 * (1.0 + 1e-6), "{axis:?}");
        assert!(axis.peak_jerk_per_s3 <= 6_000.0 * (1.0 + 1e-6), "{axis:?}");
    }
}

#[test]
fn a_lead_and_a_speed_that_the_axis_cannot_follow_are_refused() {
    let mut config = mill();
    config.profile.machine.axes[2].max_velocity_per_s = 10.0;
    let report = validate(PROGRAM, &config);
    assert!(!report.is_accepted());
    let finding = report.findings.iter().find(|finding| finding.code == "THREAD-AXIS-SPEED").expect("it is there");
    // 1.25 mm · 10 rev/s against 10 mm/s.
    assert!(finding.message.contains("12.5 mm/s"), "{}", finding.message);
    let mut config = mill();
    config.profile.machine.axes[2].travel_min = Some(-11.0);
    let travel = validate(PROGRAM, &config);
    assert!(codes(&travel).contains(&"AXIS-TRAVEL".to_owned()), "{:?}", codes(&travel));
}

#[test]
fn a_stroke_too_short_for_the_speed_is_said() {
    let report = validate("G95 M29 S5000\nG0 Z10\nG84 X0 Y0 Z1.95 R2 F1\nG80\nM30\n", &mill());
    assert!(report.is_accepted(), "{:#?}", report.findings);
    assert!(codes(&report).contains(&"THREAD-TAP-SPEED".to_owned()), "{:?}", codes(&report));
}

#[test]
fn the_feed_override_does_not_act_in_a_tap() {
    let config = mill();
    let plain = run(PROGRAM, &config);
    let rows = turning(&plain, HOLES[0]);
    let within = rows[rows.len() / 4] as u64;
    let change = OverrideChange { index: within, ratio: 0.5 };
    let slowed = run_appending(PROGRAM, &config, &[change], 100);
    let other = turning(&slowed, HOLES[0]);
    assert_eq!(rows.len(), other.len());
    for (&k, &l) in rows.iter().zip(&other) {
        assert_eq!(plain.axes[2][k].to_bits(), slowed.axes[2][l].to_bits());
    }
}

#[test]
fn a_left_hand_thread_turns_the_other_way() {
    let setpoints = run(&PROGRAM.replace("G84", "G74"), &mill());
    let rows = turning(&setpoints, HOLES[0]);
    assert!(setpoints.spindle[rows[10]] < setpoints.spindle[rows[0] - 1]);
}

#[test]
fn it_is_resumed_to_the_bit() {
    let config = mill();
    let whole = all_bits(&run(PROGRAM, &config));
    assert_eq!(all_bits(&run_in_pieces(PROGRAM.as_bytes(), &config, 7)), whole);
    let mut checked = 0;
    for (_, offset, snapshot) in snapshots(PROGRAM.as_bytes(), &config) {
        let (first, setpoints) = resume(PROGRAM.as_bytes(), &config, offset, &snapshot);
        for (k, bits) in all_bits(&setpoints).into_iter().enumerate() {
            assert_eq!(bits, whole[first as usize + k]);
        }
        checked += 1;
    }
    assert!(checked > 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]

    #[test]
    fn any_tap_keeps_its_lead(depth in 1.0..40.0_f64, lead in 0.2..4.0_f64, speed in 50.0..3000.0_f64) {
        let bottom = 2.0 - depth;
        let program = format!("G95 M29 S{speed:.0}\nG0 Z5\nG99 G84 X0 Y0 Z{bottom:.3} R2 F{lead:.3}\nG80\nM30\n");
        let report = validate(&program, &mill());
        prop_assume!(report.is_accepted());
        let setpoints = run(&program, &mill());
        let lead = format!("{lead:.3}").parse::<f64>().unwrap();
        let rows = turning(&setpoints, 3);
        prop_assert!(!rows.is_empty());
        let first = rows[0] - 1;
        for &k in &rows {
            let turns = (setpoints.spindle[k] - setpoints.spindle[first]) / 360.0;
            prop_assert!((2.0 - setpoints.axes[2][k] - lead * turns).abs() < 1e-8);
        }
    }
}
