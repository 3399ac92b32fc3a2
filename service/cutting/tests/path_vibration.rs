//! Vibration along the path through the whole pipeline, in the published form, against the equations of
//! docs/functions/path-vibration.md; how it begins and ends otherwise is in `vibration_envelope`.

use std::f64::consts::PI;

use crate::common::{run, snapshots, validate};
use feedwave_cutting::{
    AxisDrive, DriveModel, FollowingModel, GenerationMode, MachineProfile, PipelineConfig, ServoCondition,
    VibrationEnvelope, sin_turns,
};
use feedwave_program::Axis;

/// The source's example with a start point, as a lathe runs it (diameter X): line, then clockwise arc.
const EXAMPLE: &str =
    "M3 S1000\nG0 X6.0 Z18.0\nG200 F50 A0.03\nG01 X10.0 Z20.0 F0.01\nG02 X14.0 Z23.5 R4.0\nG201\nM30\n";

fn lathe() -> PipelineConfig {
    let config = PipelineConfig::new(MachineProfile::lathe());
    PipelineConfig { vibration_envelope: VibrationEnvelope::Published, ..config }
}

fn with_mode(mode: GenerationMode) -> PipelineConfig {
    PipelineConfig { generation_mode: mode, ..lathe() }
}

/// Distance of a point (X radius, Z) from the example's line and arc.
fn distance_from_example(x: f64, z: f64) -> f64 {
    // Line from (3, 18) to (5, 20).
    let along = ((x - 3.0) + (z - 18.0)) / 2.0;
    let along = along.clamp(0.0, 2.0);
    let from_line = ((x - 3.0 - along).powi(2) + (z - 18.0 - along).powi(2)).sqrt();
    // Arc of radius 4 from (5, 20) to (7, 23.5): its centre is the point 4 mm from both ends that makes the
    // way clockwise in the view with Z to the right and X up, i.e. on the right of the chord.
    let (dx, dz) = (2.0, 3.5);
    let chord = f64::sqrt(dx * dx + dz * dz);
    let to_centre = f64::sqrt(16.0 - chord * chord / 4.0);
    let (cx, cz) = (6.0 - to_centre * dz / chord, 21.75 + to_centre * dx / chord);
    let from_arc = (((x - cx).powi(2) + (z - cz).powi(2)).sqrt() - 4.0).abs();
    if z <= 20.0 { from_line } else { from_arc }
}

fn section_range(lines: &[u32]) -> std::ops::Range<usize> {
    let first = lines.iter().position(|&line| line >= 4).expect("the section is there");
    first..lines.len()
}

#[test]
fn the_tool_never_leaves_the_contour_and_goes_back_over_the_block_boundary() {
    let setpoints = run(EXAMPLE, &lathe());
    let mut went_back_over_the_boundary = false;
    for k in section_range(&setpoints.line) {
        let (x, z) = (setpoints.axes[0][k], setpoints.axes[1][k]);
        let distance = distance_from_example(x, z);
        assert!(distance <= 1e-9, "setpoint {k} at X{x} Z{z} is {distance} mm off the contour");
        went_back_over_the_boundary |= setpoints.line[k] == 5 && z < 20.0;
    }
    assert!(went_back_over_the_boundary);
}

#[test]
fn the_last_setpoint_is_the_programmed_end_to_the_last_bit() {
    for mode in [GenerationMode::AlongPath, GenerationMode::Tangential] {
        let setpoints = run(EXAMPLE, &with_mode(mode));
        assert_eq!(setpoints.axes[0].last().map(|x| x.to_bits()), Some(7.0_f64.to_bits()));
        assert_eq!(setpoints.axes[1].last().map(|z| z.to_bits()), Some(23.5_f64.to_bits()));
    }
}

#[test]
fn the_offset_is_the_sine_of_the_section_time() {
    let setpoints = run(EXAMPLE, &lathe());
    // Phase 0 is the last setpoint at rest before the command moves in line 4.
    let start = setpoints.vibration.iter().position(|&offset| offset != 0.0).expect("it vibrates") - 1;
    // At 1 ms and 50 Hz a period has 20 setpoints; well inside the section nothing is clamped.
    let mut checked = 0;
    for k in start + 2_000..start + 4_000 {
        let expected = 0.03 * (2.0 * PI * 50.0 * (k - start) as f64 * 1e-3).sin();
        assert!((setpoints.vibration[k] - expected).abs() < 1e-12, "setpoint {k}");
        checked += 1;
    }
    assert_eq!(checked, 2_000);
}

#[test]
fn positions_are_clamped_to_the_section_and_rejoin_exactly() {
    let config = lathe();
    let program = "M3 S1000\nG0 X10 Z0\nG200 F30 A0.2\nG1 Z-1.0 F0.1\nG201\nM30\n";
    let setpoints = run(program, &config);
    let z = &setpoints.axes[1];
    let mut clamped_at_start = 0;
    for (k, &value) in z.iter().enumerate() {
        assert!((-1.0..=0.0).contains(&value), "setpoint {k} at Z{value}");
        let free = -(setpoints.path[k] - setpoints.path[0] - rapid_length(&setpoints));
        let _ = free;
        clamped_at_start += usize::from(setpoints.line[k] == 4 && value == 0.0);
    }
    // The vibration would reach 0.2 mm before the start: some samples must have been held at it.
    assert!(clamped_at_start > 3, "{clamped_at_start}");
    // Wherever the reported offset is the whole sine, the position is command + offset.
    let base = rapid_length(&setpoints);
    for (k, z) in z.iter().enumerate().filter(|&(k, _)| setpoints.line[k] == 4) {
        let combined = setpoints.path[k] - base + setpoints.vibration[k];
        assert!((-z - combined).abs() < 1e-12, "setpoint {k}: {} against {combined}", -z);
    }
}

/// Path length before the section of a program whose only other motion is one rapid.
fn rapid_length(setpoints: &crate::common::Setpoints) -> f64 {
    let section = setpoints.line.iter().position(|&line| line == 4).expect("line 4");
    setpoints.path[section - 1]
}

#[test]
fn a_negative_offset_at_the_end_is_waited_out_for_at_most_half_a_period() {
    // Sections of different lengths end at different phases.
    let mut waited = 0;
    for hundredths in 100..160 {
        let length = f64::from(hundredths) / 100.0;
        let program = format!("M3 S1000\nG0 X10 Z0\nG200 F40 A0.1\nG1 Z-{length} F0.1\nG201\nM30\n");
        let setpoints = run(&program, &lathe());
        let z = &setpoints.axes[1];
        assert_eq!(*z.last().expect("setpoints"), -length);
        let total = *setpoints.path.last().expect("setpoints");
        let arrived = setpoints.path.iter().position(|&path| path == total).expect("the command arrives");
        let rest = z.len() - 1 - arrived;
        // 12.5 ms are half a period; one more setpoint each for arrival and alignment.
        assert!(rest <= 14, "rested {rest} ms");
        waited += usize::from(rest > 2);
        for window in z[arrived..].windows(2) {
            assert!((window[1] - window[0]).abs() <= 2.0 * PI * 40.0 * 0.1 * 1e-3 * 1.001, "no jump at the end");
        }
    }
    assert!(waited > 10, "{waited}");
}

#[test]
fn tangential_mode_leaves_a_curve_by_no_more_than_half_the_square_over_the_radius() {
    let setpoints = run(EXAMPLE, &with_mode(GenerationMode::Tangential));
    let mut largest: f64 = 0.0;
    for k in section_range(&setpoints.line) {
        if setpoints.line[k] == 5 && setpoints.axes[1][k] > 20.1 {
            largest = largest.max(distance_from_example(setpoints.axes[0][k], setpoints.axes[1][k]));
        }
    }
    let bound = 0.03 * 0.03 / (2.0 * 4.0);
    assert!(largest <= bound && largest > 0.9 * bound, "{largest} against {bound}");
}

#[test]
fn servo_side_conditions_give_the_tangential_positions_with_one_substep() {
    let tangential = run(EXAMPLE, &with_mode(GenerationMode::Tangential));
    let servo = run(EXAMPLE, &with_mode(GenerationMode::ServoSide));
    assert_eq!(tangential.len(), servo.len());
    for k in 0..servo.len() {
        for axis in 0..2 {
            let condition = ServoCondition {
                commanded_mm: servo.axes[axis][k],
                signed_amplitude_mm: servo.servo_amplitude[axis][k],
                clamp_low_mm: servo.servo_low[axis][k],
                clamp_high_mm: servo.servo_high[axis][k],
            };
            let position = condition.position_mm(sin_turns(servo.servo_phase[k]));
            assert_eq!(position.to_bits(), tangential.axes[axis][k].to_bits(), "setpoint {k}, axis {axis}");
        }
    }
}

#[test]
fn tangential_mode_rests_at_a_corner_until_the_offset_is_zero() {
    let program = "M3 S1000\nG0 X10 Z0\nG200 F40 A0.1\nG1 Z-1.03 F0.1\nX14.0\nG201\nM30\n";
    let setpoints = run(program, &with_mode(GenerationMode::Tangential));
    let (x, z) = (&setpoints.axes[0], &setpoints.axes[1]);
    let mut turned = false;
    for k in 0..x.len() {
        if setpoints.line[k] == 5 {
            turned = true;
            assert_eq!(z[k], -1.03, "setpoint {k}: after the corner only X moves");
        } else if setpoints.line[k] == 4 {
            assert_eq!(x[k], 5.0, "setpoint {k}: before the corner only Z moves");
        }
    }
    assert!(turned);
}

#[test]
fn a_rapid_ends_a_section_and_the_next_cutting_block_starts_at_phase_zero() {
    let program = "M3 S1000\nG0 X10 Z0\nG200 F40 A0.1\nG1 Z-2 F0.1\nG0 X20\nG0 X10\nG1 Z-4\nG201\nM30\n";
    let report = validate(program, &lathe());
    assert_eq!(report.summary.section_count, 2);
    let setpoints = run(program, &lathe());
    let again = setpoints.line.iter().position(|&line| line == 7).expect("line 7");
    // Phase 0 is the setpoint before; the first sample of line 7 lies one period later.
    let expected = 0.1 * (2.0 * PI * 40.0 * 1e-3).sin();
    assert!((setpoints.vibration[again] - expected).abs() < 1e-12);
}

#[test]
fn the_phase_trap_of_the_source_is_caught_and_its_cure_suggested() {
    let report = validate(EXAMPLE, &lathe());
    assert!(report.is_accepted(), "{:#?}", report.findings);
    let trap = report.findings.iter().find(|finding| finding.code == "VIB-CHIP-UNBROKEN").expect("the trap is caught");
    assert_eq!(trap.span.line, 3);
    let suggested: Vec<f64> =
        trap.suggestions.iter().filter_map(|suggestion| suggestion.value.as_ref().map(|value| value.value)).collect();
    for frequency_hz in [125.0 / 3.0, 175.0 / 3.0] {
        assert!(suggested.iter().any(|value| (value - frequency_hz).abs() < 1e-3), "{suggested:?}");
    }
    let cured = validate(&EXAMPLE.replace("F50", "F41.667"), &lathe());
    assert!(!cured.findings.iter().any(|finding| finding.code == "VIB-CHIP-UNBROKEN"), "{:#?}", cured.findings);
}

#[test]
fn opening_and_closing_words_are_checked() {
    let codes = |program: &str| -> Vec<String> {
        validate(program, &lathe()).findings.iter().map(|finding| finding.code.to_string()).collect()
    };
    let cut = "M3 S1000\nG0 X10 Z0\n";
    assert!(codes(&format!("{cut}G201\nM30\n")).contains(&"VIB-OFF-WITHOUT-ON".to_owned()));
    let nested = format!("{cut}G200 F40 A0.1\nG1 Z-2 F0.1\nG200 F45 A0.1\nG1 Z-3\nG201\nM30\n");
    assert!(codes(&nested).contains(&"VIB-NESTED".to_owned()));
    assert!(codes(&format!("{cut}G200 F40 A0.1\nG1 Z-2 F0.1\nM30\n")).contains(&"VIB-UNCLOSED".to_owned()));

    let mut with_c = lathe();
    with_c.profile.machine.axes.push(feedwave_motion::MachineAxis::new(Axis::C, 360.0, 3_600.0, 1e6));
    let rotary = validate(&format!("{cut}G200 F40 A0.1\nG1 C90 F0.1\nG201\nM30\n"), &with_c);
    assert!(rotary.findings.iter().any(|finding| finding.code == "VIB-ROTARY-ONLY"), "{:#?}", rotary.findings);
}

#[test]
fn snapshots_are_small() {
    for (_, _, snapshot) in snapshots(EXAMPLE.as_bytes(), &lathe()) {
        assert!(snapshot.len() < 4_096, "{}", snapshot.len());
    }
}

#[test]
fn an_inch_program_is_cured_in_inches() {
    // 0.004 inch at 100 Hz takes 40 m/s²; what fits must be suggested as an inch word and then fit.
    let program = "G20 M3 S1000\nG0 X0.4 Z0\nG200 F100 A0.004\nG1 Z-0.4 F0.004\nG201\nM30\n";
    let report = validate(program, &lathe());
    let finding = report.findings.iter().find(|finding| finding.code == "VIB-AXIS-ACCELERATION").expect("too fast");
    let word = finding.suggestions[0].replacement.as_deref().expect("a word that fits");
    let cured = validate(&program.replace("A0.004", word), &lathe());
    assert!(cured.is_accepted(), "{word}: {:#?}", cured.findings);
    // The jerk limit of 5·10⁶ mm/s³ leaves 0.98 of 5·10⁶/(2π·100)³ = 0.0198 mm.
    let amplitude_mm = word[1..].parse::<f64>().expect("a number") * 25.4;
    assert!(amplitude_mm > 0.0190 && amplitude_mm < 0.0202, "{word}");
}

#[test]
fn sections_of_one_switch_are_one_finding_for_each_axis_with_the_worst_of_them() {
    let program = "M3 S1000\nG0 X10 Z5\nG200 F200 A0.5\nG1 X20 Z0 F0.1\nG0 X10 Z5\nG1 X16 Z1\nG0 X10 Z5\nG1 Z0\nG0 X10 Z5\n\
                   G1 X20 Z0\nG201\nM30\n";
    let report = validate(program, &lathe());
    assert_eq!(report.sections.len(), 4);
    let of = |axis: &str| {
        let found = report.findings.iter().filter(|finding| finding.code == "VIB-AXIS-ACCELERATION");
        let found: Vec<_> = found.filter(|finding| finding.message.contains(axis)).collect();
        let [found] = found[..] else { panic!("{axis}: {found:#?}") };
        let line = |occurrence: &Option<feedwave_program::Occurrence>| occurrence.as_ref().map(|it| it.number);
        (found.occurrences, line(&found.first), line(&found.worst), found.values.clone())
    };
    let (occurrences, first, worst, values) = of("the Z axis");
    assert_eq!((occurrences, first, worst), (4, Some(4), Some(8)), "straight along Z takes most");
    let demanded = values.iter().find(|value| value.name == "demanded").expect("the numbers").value;
    assert!((demanded - 0.5 * (2.0 * PI * 200.0).powi(2)).abs() < 1e-6 * demanded, "{demanded}");
    let (occurrences, first, worst, _) = of("the X axis");
    assert_eq!((occurrences, first, worst), (3, Some(4), Some(4)));
    let errors = report.findings.iter().filter(|finding| finding.severity == feedwave_program::Severity::Error).count();
    assert_eq!(report.summary.errors, errors as u64, "occurrences are no errors of their own");
}

#[test]
fn what_turns_is_told_in_degrees() {
    let mut config = PipelineConfig::new(MachineProfile::mill());
    let mut turning = config.profile.machine.axes[0].clone();
    (turning.axis, turning.name) = (Axis::C, "C".to_owned());
    (turning.travel_min, turning.travel_max) = (None, Some(90.0));
    config.profile.machine.axes.push(turning);
    let program = |path: &str| format!("M3 S1000\nG0 X0 Y0 Z0\nG200 F50 A0.03\n{path}\nG201\nG1 C80 F999999\nM30\n");
    let report = validate(&program("G1 X1 C89 F100"), &config);
    let found =
        report.findings.iter().find(|finding| finding.code == "VIB-AXIS-ACCELERATION").expect("too fast a turn");
    assert!(found.message.contains("deg/s² of the C axis"), "{}", found.message);
    assert!(found.values.iter().filter(|value| value.name != "line").all(|value| value.unit == "deg/s²"), "{found:#?}");
    let turning: Vec<_> = report.sections[0].axes.iter().map(|axis| (axis.axis.as_str(), axis.rotary)).collect();
    assert_eq!(turning, [("X", false), ("C", true)]);
    let limited = report.findings.iter().find(|finding| finding.code == "FEED-LIMITED").expect("a rotary feed");
    assert!(limited.message.contains("deg/min") && limited.values.iter().all(|value| value.unit == "deg/min"));
    let beyond = validate(&program("G1 X1 C91 F100"), &config);
    let beyond = beyond.findings.iter().find(|finding| finding.code == "AXIS-TRAVEL").expect("beyond its travel");
    assert!(beyond.message.contains("91.000 deg"), "{}", beyond.message);
}

#[test]
fn a_rotary_axis_with_a_drive_of_its_own_is_judged_beside_straight_cuts() {
    let mut config = PipelineConfig::new(MachineProfile::mill());
    let mut turning = config.profile.machine.axes[0].clone();
    (turning.axis, turning.name) = (Axis::C, "C".to_owned());
    (turning.travel_min, turning.travel_max, turning.max_jerk_per_s3) = (None, None, 1e9);
    (turning.max_velocity_per_s, turning.max_acceleration_per_s2) = (3_600.0, 1e6);
    config.profile.machine.axes.push(turning);
    let drive = |gain_per_s: f64| DriveModel { position_loop_gain_per_s: Some(gain_per_s), ..DriveModel::default() };
    config.profile.following =
        FollowingModel { common: drive(200.0), axes: vec![AxisDrive { axis: Axis::C, drive: drive(20.0) }] };
    let through = |gain_per_s: f64| 0.01 / (1.0 + (2.0 * PI * 20.0 / gain_per_s).powi(2)).sqrt();
    let program = |path: &str| format!("M3 S1000\nG0 X0 Y0 Z0\nG200 F20 A0.01\n{path}\nG201\nM30\n");
    let near = |value: f64, expected: f64| (value - expected).abs() < 1e-12;
    let straight = validate(&program("G1 X10 F100\nY10"), &config);
    let straight = &straight.sections[0].following;
    assert!(near(straight.arriving_amplitude_mm, through(200.0)) && straight.axes.len() == 2, "{straight:?}");
    // Straight cuts before, behind and around the turn say nothing of the axis that turns.
    for path in ["G1 X10 C90 F100", "G1 X10 F100\nX20 C90", "G1 X10 C90 F100\nX20", "G1 X10 F100\nX20 C90\nX30"] {
        let report = validate(&program(path), &config);
        let section = &report.sections[0];
        let following = &section.following;
        assert!(near(following.arriving_amplitude_mm, through(20.0)), "{path}: {following:?}");
        assert!(near(following.largest_arriving_amplitude_mm, through(200.0)), "{path}: {following:?}");
        let command_mm = following.amplitude_to_command_mm.expect("not erased");
        assert!(near(command_mm * through(20.0), 1e-4), "{path}: {following:?}");
        assert!(near(following.lag_rad, (2.0 * PI * 20.0 / 20.0_f64).atan()), "{path}: {following:?}");
        let unjudged_mm = following.contour.expect("the drives are stated").unjudged_mm;
        assert!(unjudged_mm > 9.0 && unjudged_mm < section.length_mm + 1e-9, "{path}: {unjudged_mm}");
        assert!(report.findings.iter().any(|finding| finding.code == "VIB-FOLLOWING-LOSS"), "{:?}", report.findings);
    }
}
