//! Tilted work planes from program text to setpoints, on every kind of machine: the tool centre point on the programmed path in
//! the coordinates of the plane, the tool axis on its normal, the choice of the solution, refusals, streams from anywhere.

mod contours;
mod drilling;
mod threads;

use crate::common::{Setpoints, resume, run, snapshots, validate};
use feedwave_cutting::{Frame, MachineProfile, PipelineConfig, Tool};
use feedwave_motion::MachineAxis;
use feedwave_motion::kinematics::vector::{Vec3, add_scaled, angle, dot, norm, sub};
use feedwave_motion::kinematics::{
    BranchPreference, ChainAxis, Kinematics, KinematicsDescription, Setup, ToolPose, Wrap,
};
use feedwave_program::{Axis, LanguageSettings, TiltedPlane, ToolOffset};
use proptest::prelude::*;

const LENGTH_MM: f64 = 120.0;
const X: Vec3 = [1.0, 0.0, 0.0];
const Y: Vec3 = [0.0, 1.0, 0.0];
const Z: Vec3 = [0.0, 0.0, 1.0];

fn axis(axis: Axis, direction: Vec3, point_mm: Vec3, range: Option<[f64; 2]>) -> ChainAxis {
    ChainAxis { axis, direction, point_mm, range, wrap: Wrap::Counting }
}

fn linear(letter: Axis, direction: Vec3) -> ChainAxis {
    axis(letter, direction, [0.0; 3], None)
}

/// Table-table A/C and B/C, head-table, head-head: all with pivots beside the axes' crossing.
fn machines() -> Vec<Vec<ChainAxis>> {
    let [x, y, z] = [linear(Axis::X, X), linear(Axis::Y, Y), linear(Axis::Z, Z)];
    let c = axis(Axis::C, Z, [10.0, 5.0, 0.0], None);
    let range = Some([-130.0, 130.0]);
    vec![
        vec![c.clone(), axis(Axis::A, X, [0.0, 5.3, 40.0], range), y.clone(), x.clone(), z.clone()],
        vec![c.clone(), axis(Axis::B, Y, [12.0, 0.0, -30.0], range), x.clone(), y.clone(), z.clone()],
        vec![c.clone(), x.clone(), y.clone(), z.clone(), axis(Axis::B, Y, [3.0, 0.0, 650.0], range)],
        vec![x, y, z, axis(Axis::C, Z, [0.5, -1.0, 0.0], None), axis(Axis::A, X, [0.0, 2.0, 640.0], range)],
    ]
}

fn config_of(chain: Vec<ChainAxis>) -> PipelineConfig {
    let mut profile = MachineProfile::mill();
    for axis in chain.iter().filter(|axis| axis.axis.is_rotary()) {
        profile.machine.axes.push(MachineAxis::new(axis.axis, 120.0, 600.0, 20_000.0));
    }
    profile.language.thinning = LanguageSettings::mill().thinning;
    profile.kinematics = Some(KinematicsDescription {
        chain,
        gauge_point_mm: [0.0, 0.0, 500.0],
        tool_direction: Z,
        preferred_branch: BranchPreference::Nearest,
    });
    profile.language.work_offsets[0][..3].copy_from_slice(&[30.0, -40.0, 55.0]);
    assert_eq!(profile.problems(), []);
    let tool = |number, offset| Tool { number, name: String::new(), max_rev_per_min: None, offset, geometry: None };
    let tools = vec![tool(1, ToolOffset::new(1).with_length(LENGTH_MM)), tool(2, ToolOffset::new(2))];
    PipelineConfig { tools, ..PipelineConfig::new(profile) }
}

/// The A/C trunnion.
fn config() -> PipelineConfig {
    config_of(machines().swap_remove(0))
}

fn position(setpoints: &Setpoints, config: &PipelineConfig, index: usize) -> [f64; 9] {
    let mut position = [0.0; 9];
    for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
        position[axis.axis.index()] = column[index];
    }
    position
}

/// Poses of the tool in work coordinates by forward kinematics.
fn poses(setpoints: &Setpoints, config: &PipelineConfig) -> Vec<ToolPose> {
    let kinematics = Kinematics::new(config.profile.kinematics.as_ref().expect("five axes")).expect("valid");
    let offset = config.profile.language.work_offsets[0];
    let setup = Setup::new(kinematics.gauge_point_at(&kinematics.from_position(&offset)), LENGTH_MM);
    let pose = |index| kinematics.forward(&kinematics.from_position(&position(setpoints, config, index)), &setup);
    (0..setpoints.len()).map(pose).collect()
}

fn from_segment(point: Vec3, start: Vec3, end: Vec3) -> f64 {
    let travel = sub(end, start);
    let share = (dot(sub(point, start), travel) / dot(travel, travel)).clamp(0.0, 1.0);
    norm(sub(point, add_scaled(start, travel, share)))
}

/// Distance of a point from a full circle of the plane of the axes `first` and `second`.
fn from_circle(point: Vec3, [first, second]: [usize; 2], center: Vec3, radius_mm: f64) -> f64 {
    let from = sub(point, center);
    let across = from[first].hypot(from[second]);
    (across - radius_mm).hypot(from[3 - first - second])
}

/// A program in the plane: lines, arcs in all three planes of it, a helix.
fn program(origin: Vec3, angles: [f64; 3]) -> String {
    let [x, y, z] = origin;
    let [i, j, k] = angles;
    format!(
        "G17 G21 G49 G69 G90
G68.2 X{x} Y{y} Z{z} I{i} J{j} K{k}
G53.1
G43 H1
G0 X5 Y0 Z40
G1 Z2 F3000
X25 Y-10 Z-1
G2 X25 Y-10 I-8
G18 G3 X33 Z7 R8
G19 G2 Y-10 Z7 J4 K3
G17 G3 X33 Y10 Z9 I0 J10
G91 G1 X-3 Y1
G90 G0 Z40
G49
G69
M30
"
    )
}

/// How far the setpoints of each block of [`program`] are from its path, in the coordinates of the plane.
fn off_path(point: Vec3, line: u32) -> Option<f64> {
    Some(match line {
        6 => from_segment(point, [5.0, 0.0, 40.0], [5.0, 0.0, 2.0]),
        7 => from_segment(point, [5.0, 0.0, 2.0], [25.0, -10.0, -1.0]),
        8 => from_circle(point, [0, 1], [17.0, -10.0, -1.0], 8.0),
        9 => from_circle(point, [2, 0], [25.0, -10.0, 7.0], 8.0).min(from_circle(
            point,
            [2, 0],
            [33.0, -10.0, -1.0],
            8.0,
        )),
        10 => from_circle(point, [1, 2], [33.0, -6.0, 10.0], 5.0),
        11 => {
            // The height rises with the angle.
            let (across, along) = (point[0] - 33.0, point[1]);
            let mut angle = across.atan2(-along);
            if angle < -1e-6 {
                angle += std::f64::consts::TAU;
            }
            let height = 7.0 + 2.0 * angle / std::f64::consts::PI;
            (across.hypot(along) - 10.0).hypot(point[2] - height)
        }
        12 => from_segment(point, [33.0, 10.0, 9.0], [30.0, 11.0, 9.0]),
        13 => from_segment(point, [30.0, 11.0, 9.0], [30.0, 11.0, 40.0]),
        _ => return None,
    })
}

fn check(config: &PipelineConfig, origin: Vec3, angles: [f64; 3]) {
    let text = program(origin, angles);
    let report = validate(&text, config);
    assert!(report.is_accepted() && report.findings.is_empty(), "{:#?}", report.findings);
    let setpoints = run(&text, config);
    let plane = TiltedPlane::by_euler_angles(origin, angles, 0);
    let mut seen = [0_u32; 16];
    for (pose, &line) in poses(&setpoints, config).iter().zip(&setpoints.line) {
        let Some(off_mm) = off_path(plane.from_work(pose.tip_mm), line) else { continue };
        assert!(off_mm < 1e-9, "line {line}: {off_mm:e} mm beside the path, {angles:?}");
        let beside = angle(pose.direction, plane.axes[2]);
        assert!(beside < 1e-9, "line {line}: {beside:e} rad beside the normal, {angles:?}");
        seen[line as usize] += 1;
    }
    assert!(seen[6..=13].iter().all(|&count| count > 20), "{seen:?}");
    // In work coordinates the same, and the direction is the normal.
    let work = run(&text, &PipelineConfig { frame: Frame::Work, ..config.clone() });
    assert_eq!(work.line, setpoints.line);
    for index in (0..work.len()).filter(|&index| (6..=13).contains(&work.line[index])) {
        let tip_mm = [0, 1, 2].map(|axis| {
            let place = config.profile.machine.axes.iter().position(|it| it.axis.index() == axis).expect("X, Y, Z");
            work.axes[place][index]
        });
        let off_mm = off_path(plane.from_work(tip_mm), work.line[index]).expect("a block of the plane");
        assert!(off_mm < 1e-9, "line {}: {off_mm:e}", work.line[index]);
        let direction = [0, 1, 2].map(|axis| work.tool_direction[axis][index]);
        assert!(angle(direction, plane.axes[2]) < 1e-9);
    }
}

#[test]
fn every_kind_of_machine_stays_on_the_path() {
    for chain in machines() {
        let config = config_of(chain);
        check(&config, [10.0, -20.0, 30.0], [0.0, 30.0, 0.0]);
        check(&config, [0.0; 3], [90.0, 90.0, -90.0]);
        // The plane of the work coordinates, turned: the tool axis is in the pole.
        check(&config, [1.0, 2.0, 3.0], [30.0, 0.0, 15.0]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_plane_on_any_machine(
        machine in 0..4_usize,
        origin in prop::array::uniform3(-80.0..80.0_f64),
        i in -180.0..180.0_f64,
        j in -100.0..100.0_f64,
        k in -180.0..180.0_f64,
    ) {
        let rounded = |value: f64| (value * 1e3).round() / 1e3;
        check(&config_of(machines().swap_remove(machine)), origin.map(rounded), [i, j, k].map(rounded));
    }

    #[test]
    fn a_stream_from_anywhere_is_the_same(
        words in prop::collection::vec(0..WORDS.len(), 1..14),
    ) {
        let program: String = words.iter().map(|&word| format!("{}\n", WORDS[word])).collect();
        let program = format!("G0 X1 Y1 Z60\n{program}M30\n");
        let config = config();
        // What is refused has no stream.
        if validate(&program, &config).is_accepted() {
            let whole = run(&program, &config);
            for (_, offset, snapshot) in snapshots(program.as_bytes(), &config) {
                let (first, rest) = resume(program.as_bytes(), &config, offset, &snapshot);
                for at in 0..rest.len() {
                    prop_assert_eq!(rest.bits(at), whole.bits(first as usize + at), "{} + {}", first, at);
                }
            }
        }
    }
}

/// Blocks that switch tool length, tool centre point control and planes, and moves between them, in any order.
const WORDS: [&str; 22] = [
    "G43 H1",
    "G49",
    "G43.4 H1",
    "G68.2 X5 J20",
    "G68.2 I90 J-15 K10",
    "G53.1",
    "G69",
    "G0 X3 Y4 Z50",
    "G1 X9 Y-5 Z45 F4000",
    "G2 X3 Y4 R20 F5000",
    "G53 G0 Z40",
    "G91 G28 Z0\nG90",
    "G0 X0 Y0 Z50 A-10 C20",
    "G0 Z55",
    "G53.6 H1",
    "G68.2 P2 Q1 X1 Y2 Z3\nG68.2 P2 Q2 X5 Y2 Z3\nG68.2 P2 Q3 X1 Y9 Z5",
    "G68.2 P3 Q1 X1 I1\nG68.2 P3 Q2 J-1 K4",
    "G5.1 X9 Y-2 I2 J-3 F3000",
    "G2 X3 Y4 I4 J1 A-15 F4000",
    "G0 X1 Y2 Z50 A-12 C5",
    "G94 M29 S500\nG84 X3 Y1 Z40 R45 F500\nG80",
    "M3 S300\nG33 X4 Z30 F1.5\nM5",
];

/// Where the rotary axes are in the end.
fn rotary_at_the_end(program: &str, config: &PipelineConfig) -> [f64; 2] {
    let setpoints = run(program, config);
    let last = position(&setpoints, config, setpoints.len() - 1);
    [Axis::A, Axis::C].map(|axis| (last[axis.index()] * 1e9).round() / 1e9)
}

#[test]
fn the_solution_is_chosen() {
    let config = config();
    let with = |words: &str| rotary_at_the_end(&format!("G68.2 I0 J30 K0\nG53.1{words}\nM30\n"), &config);
    // The normal leans towards −Y: with the table at A −30 directly, or at A +30 turned half a turn.
    let near = with("");
    assert_eq!(near[0].abs(), 30.0);
    let (larger, smaller) = (with(" P1"), with(" P2"));
    assert_eq!((larger[0], smaller[0]), (30.0, -30.0));
    assert_eq!((larger[1] - smaller[1]).abs(), 180.0);
    assert!(near == larger || near == smaller);
    assert_eq!(near[1], 0.0, "without P the turn is the shorter one");
    // The profile's preference, and a range that leaves one solution only.
    let mut preferring = config.clone();
    let kinematics = preferring.profile.kinematics.as_mut().expect("five axes");
    kinematics.preferred_branch = if near == larger { BranchPreference::Smaller } else { BranchPreference::Larger };
    let other = rotary_at_the_end("G68.2 J30\nG53.1\nM30\n", &preferring);
    assert_eq!(other[0], -near[0]);
    preferring.profile.kinematics.as_mut().expect("five axes").chain[1].range =
        Some(if near == larger { [-5.0, 130.0] } else { [-130.0, 5.0] });
    assert_eq!(rotary_at_the_end("G68.2 J30\nG53.1\nM30\n", &preferring), near);
    let p = if near == larger { 2 } else { 1 };
    let report = validate(&format!("G68.2 J30\nG53.1 P{p}\nM30\n"), &preferring);
    let finding = report.findings.iter().find(|finding| finding.code == "FIVE-AXIS-RANGE").expect("a finding");
    assert!(!report.is_accepted() && finding.span.line == 2, "{finding:?}");
    assert!(finding.suggestions.iter().any(|cure| cure.message.contains("G53.1 without P")), "{finding:?}");
    // The code that was written is named, and only where the other solution is in range.
    let report = validate(&format!("G68.2 J30\nG53.6 H1 P{p}\nM30\n"), &preferring);
    let finding = report.findings.iter().find(|finding| finding.code == "FIVE-AXIS-RANGE").expect("a finding");
    assert!(finding.suggestions.iter().any(|cure| cure.message.contains("G53.6 without P")), "{finding:?}");
    preferring.profile.kinematics.as_mut().expect("five axes").chain[1].range = Some([-5.0, 5.0]);
    let report = validate(&format!("G68.2 J30\nG53.6 H1 P{p}\nM30\n"), &preferring);
    let finding = report.findings.iter().find(|finding| finding.code == "FIVE-AXIS-RANGE").expect("a finding");
    assert!(finding.suggestions.iter().all(|cure| !cure.message.contains("without P")), "{finding:?}");
}

#[test]
fn corners_between_lines_are_rounded_within_their_tolerance() {
    let config = config();
    let points: Vec<Vec3> =
        (0..20).map(|k| [2.0 * f64::from(k), f64::from(k % 2), 1.0 + 0.1 * f64::from(k % 3)]).collect();
    let program = |control: &str| {
        let lines: String = points.iter().map(|[x, y, z]| format!("X{x} Y{y} Z{z}\n")).collect();
        format!("G68.2 X5 I20 J30 K40\nG53.1\nG43 H1 {control}\nG0 X0 Y0 Z1\nG1 F3000\n{lines}G69\nM30\n")
    };
    let plane = TiltedPlane::by_euler_angles([5.0, 0.0, 0.0], [20.0, 30.0, 40.0], 0);
    let [exact, rounded] = ["G61", "G64 P0.05"].map(|control| run(&program(control), &config));
    assert!(rounded.len() < exact.len(), "{} {}", rounded.len(), exact.len());
    for (setpoints, most_mm) in [(&exact, 1e-9), (&rounded, 0.05)] {
        let mut largest_mm = 0.0_f64;
        for (pose, &line) in poses(setpoints, &config).iter().zip(&setpoints.line) {
            if line > 6 {
                let point = plane.from_work(pose.tip_mm);
                let segments = points.windows(2).map(|ends| from_segment(point, ends[0], ends[1]));
                largest_mm = largest_mm.max(segments.fold(f64::INFINITY, f64::min));
            }
        }
        assert!(largest_mm <= most_mm, "{largest_mm}");
    }
}

#[test]
fn turning_the_tool_axis_moves_the_rotary_axes_only() {
    let config = config();
    let setpoints = run("G0 X10 Y20 Z30\nG68.2 X1 Y2 Z3 I20 J40 K60\nG53.1\nM30\n", &config);
    let turning: Vec<usize> = (0..setpoints.len()).filter(|&index| setpoints.line[index] == 3).collect();
    for &index in &turning {
        assert_eq!(position(&setpoints, &config, index)[..3], [40.0, -20.0, 85.0]);
    }
    let [first, last] = [turning[0], turning[turning.len() - 1]].map(|index| position(&setpoints, &config, index));
    assert!(first[3] != last[3] && first[5] != last[5]);
}

/// The sequence that CAM systems post: X and Y in the plane first, then the length with Z, then cuts.
#[test]
fn a_length_behind_the_approach_keeps_x_and_y() {
    let program = "G68.2 X10 Y20 Z30 I0 J30 K0\nG53.1\nG0 X2 Y1\nG43 H1 Z20\nG4 P20\nG1 Z-1 F3000\nG4 P20\nG2 X6 Y1 I2\nG4 P20\nG3 X6 Y5 J2\nG4 P20\nG0 Z20\nG69\nM30\n";
    // By hand: the plane's Y is (0, cos 30, sin 30), its Z (0, -sin 30, cos 30).
    let ends = [
        (4, [12.0, 20.0 + 0.866_025_403_784_438_6 - 10.0, 30.0 + 0.5 + 17.320_508_075_688_77]),
        (6, [12.0, 20.0 + 0.866_025_403_784_438_6 + 0.5, 30.0 + 0.5 - 0.866_025_403_784_438_6]),
        (8, [16.0, 20.0 + 0.866_025_403_784_438_6 + 0.5, 30.0 + 0.5 - 0.866_025_403_784_438_6]),
        (10, [16.0, 20.0 + 4.330_127_018_922_193 + 0.5, 30.0 + 2.5 - 0.866_025_403_784_438_6]),
    ];
    for chain in machines() {
        let config = config_of(chain);
        let report = validate(program, &config);
        assert!(report.is_accepted(), "{:#?}", report.findings);
        let setpoints = run(program, &config);
        let poses = poses(&setpoints, &config);
        for (line, end) in ends {
            // The tool rests there in the dwell behind the block.
            let at = setpoints.line.iter().rposition(|it| *it == line + 1).expect("a setpoint of the dwell");
            let off_mm = norm(sub(poses[at].tip_mm, end));
            assert!(off_mm < 1e-9, "line {line}: {:?} and {end:?}", poses[at].tip_mm);
        }
    }
}

#[test]
fn without_the_tool_axis_turned_the_plane_is_cut_all_the_same() {
    let config = config();
    let program = "G68.2 X1 Y2 Z3 J30\nG43 H1\nG0 X0 Y0 Z10\nG1 X10 Y5 F3000\nG1 X0\nG69\nM30\n";
    let report = validate(program, &config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    let warnings: Vec<_> = report.findings.iter().map(|finding| (finding.code.name(), finding.span.line)).collect();
    assert_eq!(warnings, [("FIVE-AXIS-NOT-NORMAL", 4)]);
    assert!((report.findings[0].values[0].value - 30.0).abs() < 1e-9);
    let plane = TiltedPlane::by_euler_angles([1.0, 2.0, 3.0], [0.0, 30.0, 0.0], 1);
    let setpoints = run(program, &config);
    for (pose, &line) in poses(&setpoints, &config).iter().zip(&setpoints.line) {
        if line == 4 {
            let off_mm = from_segment(plane.from_work(pose.tip_mm), [0.0, 0.0, 10.0], [10.0, 5.0, 10.0]);
            assert!(off_mm < 1e-9, "{off_mm:e}");
            assert!(angle(pose.direction, Z) < 1e-12);
        }
    }
}

#[test]
fn what_is_missing_is_refused_before_anything_moves() {
    let refusal = |program: &str, config: &PipelineConfig| {
        let report = validate(program, config);
        assert!(!report.is_accepted());
        let codes: Vec<String> = report.findings.iter().map(|finding| finding.code.to_string()).collect();
        codes
    };
    let plane = "G68.2 J30\nG53.1\nG0 X0 Y0 Z10\nG1 X5 F100\nG69\nM30\n";
    let mut plain = config();
    plain.profile.kinematics = None;
    assert_eq!(refusal(plane, &plain), ["FIVE-AXIS-KINEMATICS"]);
    assert_eq!(refusal("G68.2 J150\nG53.1\nM30\n", &config()), ["FIVE-AXIS-RANGE"]);
    assert_eq!(refusal("G68.2 J30\nG43 H2\nM30\n", &config()), ["PRG-TOOL-LENGTH"]);
    // Travels are those of the axes.
    let mut short = config();
    let z = short.profile.machine.axes.iter().position(|axis| axis.axis == Axis::Z).expect("Z");
    short.profile.machine.axes[z].travel_max = Some(0.0);
    assert_eq!(refusal("G68.2 J30\nG53.1\nG43 H1\nG0 X0 Y0 Z300\nM30\n", &short), ["AXIS-TRAVEL"]);
}
