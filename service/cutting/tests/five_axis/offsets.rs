//! Work offsets under tool centre point control: they move with what carries the work, and rotary ones turn the work coordinates.

use feedwave_cutting::{Frame, PipelineConfig};
use feedwave_motion::kinematics::vector::{Vec3, sub};
use feedwave_motion::kinematics::{Kinematics, Setup};
use feedwave_program::ToolOffset;

use super::machine::{LENGTH_MM, config};
use crate::common::{Setpoints, run, validate};

/// Offset of the work: X, Y, Z and C.
const OFFSET: [f64; 4] = [30.0, -40.0, 55.0, 25.0];

fn turned() -> PipelineConfig {
    let mut config = config();
    let offset = &mut config.profile.language.work_offsets[0];
    offset[..3].copy_from_slice(&OFFSET[..3]);
    offset[5] = OFFSET[3];
    config
}

fn at_end_of(setpoints: &Setpoints, line: u32) -> [f64; 5] {
    let last = setpoints.line.iter().rposition(|&own| own == line).expect("a setpoint of the line");
    core::array::from_fn(|column| setpoints.axes[column][last])
}

#[test]
fn a_rotary_offset_turns_the_work_coordinates_with_the_table() {
    let config = turned();
    // With the rotary axes where the program has them at zero, the work is parallel to the machine.
    let program = "G43.4 H1 G0 X0 Y0 Z20 A0 C0\nG4 P5\nG1 X10 F3000\nG4 P5\nY7\nG4 P5\nM30\n";
    let setpoints = run(program, &config);
    let [start, along, across] = [2, 4, 6].map(|line| at_end_of(&setpoints, line));
    for axis in 0..2 {
        assert!((start[axis] - OFFSET[axis]).abs() < 1e-9, "{start:?}");
    }
    // Z of the machine is that of the gauge point: a tool length over the tip.
    assert!((start[2] - (OFFSET[2] + 20.0 + LENGTH_MM)).abs() < 1e-9, "{start:?}");
    assert!((start[4] - OFFSET[3]).abs() < 1e-9 && start[3].abs() < 1e-9, "{start:?}");
    for axis in 0..5 {
        assert!((along[axis] - start[axis] - [10.0, 0.0, 0.0, 0.0, 0.0][axis]).abs() < 1e-9, "{along:?}");
        assert!((across[axis] - along[axis] - [0.0, 7.0, 0.0, 0.0, 0.0][axis]).abs() < 1e-9, "{across:?}");
    }
}

#[test]
fn angles_and_vectors_mean_the_same_under_a_rotary_offset() {
    let config = turned();
    let (mut angles, mut vectors) = (String::from("G43.4 H1\n"), String::from("G43.5 H1\n"));
    for (index, (tilt, turn)) in
        [(20.0_f64, 10.0_f64), (25.0, 30.0), (35.0, 50.0), (15.0, -5.0)].into_iter().enumerate()
    {
        let code = if index == 0 { "G0 Y0 Z20" } else { "G1 F3000" };
        let (tilted, around) = (tilt.to_radians(), turn.to_radians());
        let [i, j, k] = [-tilted.sin() * around.sin(), tilted.sin() * around.cos(), tilted.cos()];
        angles += &format!("{code} X{index} A-{tilt} C{turn}\nG4 P5\n");
        vectors += &format!("{code} X{index} I{i:.12} J{j:.12} K{k:.12}\nG4 P5\n");
    }
    let [angles, vectors] = [angles, vectors].map(|program| run(&format!("{program}M30\n"), &config));
    for line in [3, 5, 7, 9] {
        let [by_angle, by_vector] = [&angles, &vectors].map(|setpoints| at_end_of(setpoints, line));
        for axis in 0..5 {
            assert!((by_angle[axis] - by_vector[axis]).abs() < 1e-6, "line {line}: {by_angle:?} {by_vector:?}");
        }
    }
}

#[test]
fn the_tip_is_on_its_segment_of_turned_work() {
    let config = turned();
    let program = "G43.5 H1 G0 X0 Y0 Z30 I0.3 J-0.3 K1\nG1 X20 Y5 Z20 I-0.1 J-0.5 K1 F3000\nG0 Z60\nM30\n";
    assert!(validate(program, &config).is_accepted());
    let setpoints = run(program, &config);
    let kinematics = Kinematics::new(config.profile.kinematics.as_ref().expect("five axes")).expect("valid");
    // By hand: the bare spindle at the offset, and the work turned back about Z by C of the offset.
    let origin = kinematics.gauge_point_at(&kinematics.from_position(&config.profile.language.work_offsets[0]));
    let bare = Setup::new([0.0; 3], LENGTH_MM);
    let (sine, cosine) = libm::sincos(-OFFSET[3].to_radians());
    let mut seen = 0;
    for index in (0..setpoints.len()).filter(|&index| setpoints.line[index] == 2) {
        let mut position = [0.0; 9];
        for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
            position[axis.axis.index()] = column[index];
        }
        let pose = kinematics.forward(&kinematics.from_position(&position), &bare);
        let from: Vec3 = sub(pose.tip_mm, origin);
        let work = [cosine * from[0] - sine * from[1], sine * from[0] + cosine * from[1], from[2]];
        let off = super::distance(work, [0.0, 0.0, 30.0], [20.0, 5.0, 20.0]);
        assert!(off < 1e-9, "{off:e}");
        seen += 1;
    }
    assert!(seen > 100, "{seen}");
}

#[test]
fn the_length_is_that_of_the_table_when_it_is_called() {
    // As a program sets geometry and wear, and in a table that has them from the start.
    let set = "G10 L10 P1 R125.5\nG10 L11 P1 R-0.25\n";
    let mut measured = config();
    measured.tools[0].offset = ToolOffset::new(1).with_length(125.25);
    let mut unknown = config();
    unknown.tools.clear();
    for program in [
        "G43.4 H1 G0 X0 Y0 Z20 A-20 C10\nG1 X10 A-25 F3000\nG49\nM30\n",
        "G43.5 H1 G0 X0 Y0 Z20 I0 J0.2 K1\nG1 X10 I0.1 F3000\nG49\nM30\n",
        "G68.2 X0 Y0 Z0 I0 J20 K0\nG53.1\nG43 H1 G0 X0 Y0 Z20\nG1 X10 F3000\nG49\nG69\nM30\n",
        "G43.4 H1 G0 X0 Y0 Z20 A0 C0\nG49\nG68.2 X0 Y0 Z0 I0 J20 K0\nG53.6 H1\nG43 H1 G0 X0 Y0 Z20\nG1 X10 F3000\nG49\nG69\nM30\n",
        "G68.2 X0 Y0 Z0 I0 J20 K0\nG53.1\nG43 H1 G0 X0 Y0 Z20\nM29 S500\nG84 X5 Z-5 R5 F500\nG80\nG49\nG69\nM30\n",
    ] {
        let known = validate(&format!("()\n()\n{program}"), &measured);
        assert!(known.is_accepted(), "{program}: {:#?}", known.findings);
        let expected = run(&format!("()\n()\n{program}"), &measured);
        for config in [config(), unknown.clone()] {
            let setpoints = run(&format!("{set}{program}"), &config);
            assert_eq!(setpoints.axes, expected.axes, "{program}");
        }
    }
    // One in force stays as it was called, which is said.
    let changed = validate("G43.4 H1 G0 X0 Y0 Z20 A0 C0\nG10 L10 P1 R125\nG1 X10 F3000\nG49\nM30\n", &config());
    let codes: Vec<_> = changed.findings.iter().map(|finding| finding.code.name()).collect();
    assert_eq!(codes, ["PRG-OFFSET-IN-FORCE"]);
}

#[test]
fn work_coordinates_mean_the_same_with_and_without_control_of_the_tool_centre_point() {
    let mut config = turned();
    config.frame = Frame::Work;
    let program =
        "G0 X10 Y0 Z300 A-10 C0\nG43.4 H1\nG0 X10 Y0 Z100 A-10 C0\nG4 P5\nG1 X20 F3000\nG49\nG0 Z350\nG4 P5\nM30\n";
    assert!(validate(program, &config).is_accepted());
    let setpoints = run(program, &config);
    let first = setpoints.line.iter().position(|&line| line > 1).expect("moves");
    let (sine, cosine) = libm::sincos(10.0_f64.to_radians());
    // The rotary axes rest there: C at its offset in the machine, and the tool tilted about X of the turned work.
    for index in first..setpoints.len() {
        let [a, c] = [3, 4].map(|column| setpoints.axes[column][index]);
        assert!((a + 10.0).abs() < 1e-9 && (c - OFFSET[3]).abs() < 1e-9, "{index}: A{a} C{c}");
        let direction: Vec3 = core::array::from_fn(|axis| setpoints.tool_direction[axis][index]);
        let off = super::distance(direction, [0.0, sine, cosine], [0.0, sine, cosine]);
        assert!(off < 1e-9, "{index}: {direction:?}");
    }
}
