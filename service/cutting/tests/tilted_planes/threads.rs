//! Threads in tilted planes: the tip on the lines of the plane in step with the spindle, whatever axes carry it there.

use feedwave_cutting::{PipelineConfig, ValidationReport};
use feedwave_motion::kinematics::vector::Vec3;
use feedwave_program::{Axis, TiltedPlane};
use proptest::prelude::*;

use super::{config, config_of, from_segment, machines, poses, position};
use crate::common::measured::worst_use;
use crate::common::{Setpoints, resume, run, snapshots, validate};

/// A straight thread, a taper, one of three parts of which one leads along X, and one along X.
const THREADS: &str = "G53.1
G43 H1
G0 X10 Y5 Z30
G33 Z-10 F1.5 Q90
G4 P20
G0 X14 Z30
G33 X18 Z-10 F2
G4 P20
G0 X10 Z30
G33 X11 Z12 F1.5
X25 Z8
X26 Z-10 F1.25
G4 P20
G0 X40 Z2
G33 X8 Z1 F2
G4 P20
G0 Z40
G69
M5
M30
";

/// The parts: line, start and end in X and Z, lead along the axis that travels further.
const PARTS: [(u32, [f64; 2], [f64; 2], f64); 6] = [
    (6, [10.0, 30.0], [10.0, -10.0], 1.5),
    (9, [14.0, 30.0], [18.0, -10.0], 2.0),
    (12, [10.0, 30.0], [11.0, 12.0], 1.5),
    (13, [11.0, 12.0], [25.0, 8.0], 1.5),
    (14, [25.0, 8.0], [26.0, -10.0], 1.25),
    (17, [40.0, 2.0], [8.0, 1.0], 2.0),
];

fn program(angles: [f64; 3], speed: u32, threads: &str) -> String {
    let [i, j, k] = angles;
    format!("G90 M3 S{speed}\nG68.2 X10 Y-20 Z30 I{i} J{j} K{k}\n{threads}")
}

fn plane(angles: [f64; 3]) -> TiltedPlane {
    TiltedPlane::by_euler_angles([10.0, -20.0, 30.0], angles, 2)
}

fn assert_accepted(report: &ValidationReport) {
    assert!(report.is_accepted(), "{:#?}", report.findings);
}

/// The tips in coordinates of the plane.
fn tips(setpoints: &Setpoints, config: &PipelineConfig, plane: &TiltedPlane) -> Vec<Vec3> {
    poses(setpoints, config).iter().map(|pose| plane.from_work(pose.tip_mm)).collect()
}

fn check(config: &PipelineConfig, angles: [f64; 3]) {
    let text = program(angles, 300, THREADS);
    assert_accepted(&validate(&text, config));
    let setpoints = run(&text, config);
    let tips = tips(&setpoints, config, &plane(angles));
    let mut ends = 0;
    for (line, from, to, lead_mm) in PARTS {
        let [start, end] = [from, to].map(|[x, z]| [x, 5.0, z]);
        let further = if (to[1] - from[1]).abs() > (to[0] - from[0]).abs() { 2 } else { 0 };
        let is_chained = (12..=14).contains(&line);
        let rows: Vec<usize> = (1..setpoints.len()).filter(|&k| setpoints.line[k] == line).collect();
        let mut in_step = 0;
        for &k in &rows {
            let share = (tips[k][further] - start[further]) / (end[further] - start[further]);
            // Where its speed changes at a vertex it is a curve; one line is a line throughout.
            let off_mm = from_segment(tips[k], start, end);
            assert!(off_mm < if is_chained { 0.2 } else { 1e-9 }, "line {line}: {off_mm:e} beside its line at {share}");
            if !(0.35..0.65).contains(&share) || setpoints.line[k - 1] != line {
                continue;
            }
            assert!(off_mm < 1e-9, "line {line}: {off_mm:e}");
            let turned = (setpoints.spindle[k] - setpoints.spindle[k - 1]) / 360.0;
            let travel = (tips[k][further] - tips[k - 1][further]).abs();
            assert!((travel - lead_mm * turned).abs() < 2e-9, "line {line}: {travel} in {turned} turns");
            in_step += 1;
        }
        assert!(in_step > 20, "line {line}: {in_step} of {} setpoints", rows.len());
        // The tool rests at the end in the dwell behind it.
        if let Some(row) = setpoints.line.iter().rposition(|it| *it == line + 1).filter(|_| !matches!(line, 12 | 13)) {
            let off_mm = (0..3).map(|axis| (tips[row][axis] - end[axis]).abs()).fold(0.0, f64::max);
            assert!(off_mm < 1e-9, "line {line}: ends {off_mm:e} beside its end");
            ends += 1;
        }
    }
    assert_eq!(ends, 4);
    let (used, at) = worst_use(&setpoints, config, 1e-9);
    assert!(
        used.iter().all(|used| *used <= 1.0 + 1e-6),
        "{used:?} at {at:?}, lines {:?}",
        at.map(|k| setpoints.line[k])
    );
}

#[test]
fn the_tip_is_in_step_on_the_lines_of_the_plane_on_every_kind_of_machine() {
    for chain in machines() {
        let config = config_of(chain);
        check(&config, [0.0, 30.0, 0.0]);
        check(&config, [20.0, 35.0, -50.0]);
        check(&config, [90.0, 90.0, -90.0]);
    }
}

#[test]
fn without_the_tool_axis_turned_a_thread_is_cut_all_the_same() {
    let config = config();
    let text = program([20.0, 30.0, 0.0], 300, "G43 H1\nG0 X10 Y5 Z30\nG33 Z0 F1.5\nG69\nM5\nM30\n");
    let report = validate(&text, &config);
    assert_accepted(&report);
    assert!(report.findings.iter().any(|finding| finding.code == "FIVE-AXIS-NOT-NORMAL" && finding.span.line == 5));
    let setpoints = run(&text, &config);
    for (tip, line) in tips(&setpoints, &config, &plane([20.0, 30.0, 0.0])).into_iter().zip(&setpoints.line) {
        if *line == 5 {
            assert!(from_segment(tip, [10.0, 5.0, 30.0], [10.0, 5.0, 0.0]) < 1e-9);
        }
    }
}

#[test]
fn the_first_lead_waits_for_the_start_angle() {
    // Passes of one thread meet in one groove: at the same angle of the spindle they are at the same Z, a start angle later by its
    // share of the lead.
    let pass = "G0 X10 Y5 Z30\nG33 Z0 F1.5\nG0 X12\nZ30\nX10\nG33 Z0 F1.5 Q120\nG0 X12\nG69\nM5\nM30\n";
    for chain in machines() {
        let config = config_of(chain);
        let text = program([20.0, 35.0, -50.0], 300, &format!("G53.1\nG43 H1\n{pass}"));
        assert_accepted(&validate(&text, &config));
        let setpoints = run(&text, &config);
        let tips = tips(&setpoints, &config, &plane([20.0, 35.0, -50.0]));
        let phase_of = |line: u32| {
            let row = (0..tips.len()).find(|&k| setpoints.line[k] == line && tips[k][2] < 15.0).expect("the middle");
            let turns = (tips[row][2] / 1.5 + setpoints.spindle[row] / 360.0).rem_euclid(1.0);
            (setpoints.spindle[row], turns)
        };
        let [(_, first), (_, second)] = [6, 10].map(phase_of);
        let apart = (second - first).rem_euclid(1.0);
        assert!((apart - 1.0 / 3.0).abs() < 1e-9, "{apart}");
    }
}

/// Passes that vibrate in the X of the plane.
const VIBRATING: &str = "G53.1
G43 H1
G165 P3 X12. Q1.2
G0 X20 Y5 Z30
X11.8
G33 Z-10 F1.5
G0 X20
Z30
X11.65
G33 Z-10 F1.5
G0 X20
Z30
X11.6
G33 Z-10 F1.5 A0.
G0 X20
G165 P0
G69
M5
M30
";

#[test]
fn the_vibration_is_in_x_of_the_plane_within_the_limits_of_every_axis() {
    for chain in machines() {
        let config = config_of(chain);
        for angles in [[0.0, 30.0, 0.0], [20.0, 35.0, -50.0]] {
            let text = program(angles, 120, VIBRATING);
            let report = validate(&text, &config);
            assert_accepted(&report);
            assert_eq!(report.threads.len(), 1, "{:#?}", report.threads.len());
            let setpoints = run(&text, &config);
            let tips = tips(&setpoints, &config, &plane(angles));
            for (line, x, amplitude_mm) in [(8, 11.8, 0.24), (12, 11.65, 0.18), (16, 11.6, 0.0)] {
                let rows: Vec<usize> = (0..tips.len()).filter(|&k| setpoints.line[k] == line).collect();
                let mut largest_mm = 0.0_f64;
                for &k in &rows {
                    let [tip_x, tip_y, _] = tips[k];
                    let retreat_mm = setpoints.vibration[k];
                    assert!(
                        (tip_y - 5.0).abs() < 1e-9 && (tip_x - x - retreat_mm).abs() < 1e-9,
                        "line {line}: {:?}",
                        tips[k]
                    );
                    largest_mm = largest_mm.max(retreat_mm);
                }
                assert!((largest_mm - amplitude_mm).abs() < 1e-3, "line {line}: {largest_mm}");
            }
            let (used, at) = worst_use(&setpoints, &config, 1e-9);
            assert!(
                used[..2].iter().all(|used| *used <= 1.0 + 1e-6),
                "{used:?}, lines {:?}",
                at.map(|k| setpoints.line[k])
            );
        }
    }
}

#[test]
fn limits_are_those_of_the_axes() {
    let codes = |report: &ValidationReport| -> Vec<String> {
        report.findings.iter().map(|finding| finding.code.to_string()).collect()
    };
    // The lead along the plane's Z is one of Y and Z on a machine whose head turns, in the shares sin 30° and cos 30°.
    let text = program([0.0, 30.0, 0.0], 300, "G53.1\nG43 H1\nG0 X10 Y5 Z30\nG33 Z0 F1.5\nG69\nM5\nM30\n");
    let place = |config: &PipelineConfig, axis: Axis| {
        config.profile.machine.axes.iter().position(|it| it.axis == axis).expect("an axis of a mill")
    };
    let mut slow = config_of(machines().swap_remove(3));
    let y = place(&slow, Axis::Y);
    slow.profile.machine.axes[y].max_velocity_per_s = 3.8;
    assert_accepted(&validate(&text, &slow));
    slow.profile.machine.axes[y].max_velocity_per_s = 3.7;
    let report = validate(&text, &slow);
    let finding = report.findings.iter().find(|finding| finding.code == "THREAD-AXIS-SPEED").expect("too fast");
    assert!(!report.is_accepted() && finding.message.starts_with("the thread moves Y"), "{}", finding.message);
    assert!((finding.values[0].value - 3.75).abs() < 1e-9, "{}", finding.values[0].value);
    // The cure, to the letter.
    let speed = finding.suggestions[0].value.as_ref().expect("a speed").value.round();
    assert_accepted(&validate(&text.replace("S300", &format!("S{speed}")), &slow));
    let mut short = config_of(machines().swap_remove(3));
    let setpoints = run(&text, &short);
    let z = place(&short, Axis::Z);
    let lowest = (0..setpoints.len()).map(|k| position(&setpoints, &short, k)[2]).fold(f64::INFINITY, f64::min);
    short.profile.machine.axes[z].travel_min = Some(lowest + 0.001);
    assert!(codes(&validate(&text, &short)).contains(&"AXIS-TRAVEL".to_owned()));
    short.profile.machine.axes[z].travel_min = Some(lowest - 0.001);
    assert_accepted(&validate(&text, &short));
    let mut plain = config();
    plain.profile.kinematics = None;
    assert!(codes(&validate(&text, &plain)).contains(&"FIVE-AXIS-KINEMATICS".to_owned()));
}

#[test]
fn a_stream_from_anywhere_in_a_thread_is_the_same() {
    for (chain, threads, speed) in machines()
        .into_iter()
        .zip([THREADS, VIBRATING, THREADS, VIBRATING])
        .map(|(chain, threads)| (chain, threads, if threads == THREADS { 300 } else { 120 }))
    {
        let config = config_of(chain);
        let text = program([20.0, 35.0, -50.0], speed, threads);
        let whole = run(&text, &config);
        let mut checked = 0;
        for (_, offset, snapshot) in snapshots(text.as_bytes(), &config) {
            let (first, rest) = resume(text.as_bytes(), &config, offset, &snapshot);
            assert!((0..rest.len()).all(|at| rest.bits(at) == whole.bits(first as usize + at)), "from {first}");
            checked += 1;
        }
        assert!(checked > 3, "{checked}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_thread_in_any_plane(
        machine in 0..4_usize,
        i in -180.0..180.0_f64,
        j in -95.0..95.0_f64,
        k in -180.0..180.0_f64,
        end_x in -30.0..30.0_f64,
        end_z in -30.0..10.0_f64,
        lead in 0.5..3.0_f64,
    ) {
        let rounded = |value: f64| (value * 1e3).round() / 1e3;
        let ([i, j, k], [x, z], lead) = ([i, j, k].map(rounded), [end_x, end_z].map(rounded), rounded(lead));
        let config = config_of(machines().swap_remove(machine));
        let threads = format!("G53.1\nG43 H1\nG0 X2 Y5 Z30\nG33 X{x} Z{z} F{lead}\nG69\nM5\nM30\n");
        let text = program([i, j, k], 200, &threads);
        let report = validate(&text, &config);
        prop_assert!(report.is_accepted(), "{:#?}", report.findings);
        let setpoints = run(&text, &config);
        let tips = tips(&setpoints, &config, &plane([i, j, k]));
        for (tip, line) in tips.iter().zip(&setpoints.line) {
            let off_mm = if *line == 6 { from_segment(*tip, [2.0, 5.0, 30.0], [x, 5.0, z]) } else { 0.0 };
            prop_assert!(off_mm < 1e-9, "{:e}", off_mm);
        }
        let (used, _) = worst_use(&setpoints, &config, 1e-9);
        prop_assert!(used.iter().all(|used| *used <= 1.0 + 1e-6), "{:?}", used);
    }
}

/// Tool centre point control goes on from where a thread outside of planes has ended.
#[test]
fn behind_a_plain_thread_the_tool_is_where_it_ended() {
    let config = config();
    let text = "G90 M3 S300\nG43 H1\nG0 X10 Y5 Z40\nG33 Z20 F1.5\nG49\nM5\nG43.4 H1\nG0 X10 Y5 Z20 A0 C0\nG1 X12 F1000\nG4 P20\nM30\n";
    assert_accepted(&validate(text, &config));
    let setpoints = run(text, &config);
    let (used, at) = worst_use(&setpoints, &config, 1e-9);
    assert!(used[0] <= 1.0 + 1e-6, "{used:?}, lines {:?}", at.map(|k| setpoints.line[k]));
}
