//! Tool oscillation under tool centre point control on every kind of machine, heads that turn the tool among them: offsets in the
//! tool's own directions through the exact kinematics, along lines and arcs, within the limits of the machine axes.

use std::f64::consts::FRAC_PI_2;

use feedwave_cutting::tool_oscillation::{NamedCondition, ToolOscillation, Waveform, blend};
use feedwave_cutting::{Frame, PipelineConfig};
use feedwave_motion::kinematics::KinematicsDescription;
use feedwave_motion::kinematics::vector::{Vec3, add, add_scaled, cross, dot, norm, scale, sub, unit};
use feedwave_program::Axis;

use super::oscillation::{RAMP_MM, condition, geometry};
use crate::common::machines::{config_of, direction_at, kinds, kinematics, poses, position};
use crate::common::{Setpoints, resume, run, snapshots, validate};

/// The machine with an oscillating tool 1.
pub fn oscillating(description: KinematicsDescription) -> PipelineConfig {
    let mut config = config_of(description);
    let named = NamedCondition {
        name: "face".to_owned(),
        number: 1,
        tools: Vec::new(),
        condition: condition(),
        tables: Vec::new(),
    };
    config.profile.tool_oscillation = vec![named];
    config.tools[0].geometry = Some(geometry());
    config
}

pub const START: Vec3 = [0.0, 0.0, 20.0];

/// The coordinate axes by how far they are across the tool at these angles: the best one first.
pub fn across(config: &PipelineConfig, rotary_deg: [f64; 2]) -> [usize; 3] {
    let tool = direction_at(config, rotary_deg);
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| tool[a].abs().total_cmp(&tool[b].abs()));
    axes
}

pub fn program(config: &PipelineConfig, cut: &str) -> String {
    let [l, m] = kinematics(config).letters().1.map(Axis::letter);
    format!(
        "T1 M6\nM3 S600\nG43.4 H1\nG0 X0 Y0 Z20 {l}10 {m}-20\nG202 P1 D1\n{cut} {l}14 {m}-25 F600\nG203\nG49\nM30\n"
    )
}

/// A vector turned about a line through the origin by an angle, rad (Rodrigues).
fn turned(line: Vec3, angle_rad: f64, v: Vec3) -> Vec3 {
    let line = unit(line).expect("a line");
    let (sine, cosine) = angle_rad.sin_cos();
    let along = scale(line, dot(line, v));
    add(along, add(scale(sub(v, along), cosine), scale(cross(line, v), sine)))
}

/// Asserts that every setpoint of line 6, which is `length_mm` long, is its place on the path with the offset of the formula.
pub fn follows_the_formula(
    name: &str,
    setpoints: &Setpoints,
    config: &PipelineConfig,
    length_mm: f64,
    path: impl Fn(f64) -> (Vec3, Vec3),
) {
    let description = config.profile.kinematics.as_ref().expect("five axes");
    // Across the tool, in the order X, Y, Z after the axis it is along.
    let first: Vec3 = if description.tool_direction[0] == 1.0 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] };
    let second = cross(description.tool_direction, first);
    let lines: Vec<Vec3> = description.chain.iter().filter(|it| it.axis.is_rotary()).map(|it| it.direction).collect();
    // Where a direction of the spindle is on the work, by turning it about the one line, then about the other.
    let carried = |v: Vec3, rotary_rad: [f64; 2]| turned(lines[0], rotary_rad[0], turned(lines[1], rotary_rad[1], v));
    let letters = kinematics(config).letters().1;
    let condition = &config.profile.tool_oscillation[0].condition;
    let oscillation = ToolOscillation::new(&geometry(), condition, 1, 1).expect("possible");
    let poses = poses(setpoints, config);
    let cut: Vec<usize> = (0..setpoints.len()).filter(|&row| setpoints.line[row] == 6).collect();
    let base_mm = setpoints.path[*cut.last().expect("a cut")] - length_mm;
    let [mut whole, mut off_path] = [0, 0];
    for row in cut {
        let at = position(setpoints, config, row);
        let rotary_rad = letters.map(|axis| at[axis.index()].to_radians());
        let along_mm = setpoints.path[row] - base_mm;
        let (place, tangent) = path(along_mm);
        let tool = poses[row].direction;
        let [along, beside] = [first, second].map(|v| dot(tangent, carried(v, rotary_rad)));
        let azimuth = libm::atan2(beside, along);
        let offset = oscillation.offset((setpoints.spindle[row] + azimuth.to_degrees()) / 360.0);
        let share = blend(along_mm / RAMP_MM) * blend((length_mm - along_mm) / RAMP_MM);
        let beside_mm = scale(unit(cross(tangent, tool)).expect("not along the tool"), offset.cross_mm);
        let in_feed_and_axis_mm = add(scale(tangent, offset.feed_mm), scale(tool, offset.retraction_mm));
        let moved = scale(add(in_feed_and_axis_mm, beside_mm), share);
        let off_mm = norm(sub(poses[row].tip_mm, add(place, moved)));
        assert!(off_mm < 1e-9, "{name}: setpoint {row}: {off_mm:e} mm off the formula");
        assert!((setpoints.vibration[row] - share * offset.feed_mm).abs() < 1e-9);
        // The direction goes its way as if nothing oscillated.
        let turned = [(at[letters[0].index()] - 10.0) / 4.0, (at[letters[1].index()] + 20.0) / -5.0];
        assert!(turned.iter().all(|turned| (turned - along_mm / length_mm).abs() < 1e-8), "{name}: {turned:?}");
        whole += u32::from(share == 1.0);
        off_path += u32::from(norm(moved) > 1e-2);
    }
    assert!(whole > 100 && off_path > 100, "{name}: {whole} {off_path}");
}

fn keeps_limits(name: &str, setpoints: &Setpoints, config: &PipelineConfig) {
    let period_s = config.period_s();
    for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
        for k in column.windows(3) {
            let [velocity, acceleration] =
                [(k[1] - k[0]) / period_s, (k[2] - 2.0 * k[1] + k[0]) / (period_s * period_s)].map(f64::abs);
            assert!(velocity <= axis.max_velocity_per_s * 1.001, "{name}: {}: {velocity}", axis.name);
            assert!(acceleration <= axis.max_acceleration_per_s2 * 1.01, "{name}: {}: {acceleration}", axis.name);
        }
    }
}

#[test]
fn offsets_follow_the_formula_along_a_line() {
    for (name, description) in kinds() {
        let config = oscillating(description);
        let [best, next, _] = across(&config, [12.0, -22.0]);
        let mut end = START;
        (end[best], end[next]) = (end[best] + 30.0, end[next] + 6.0);
        let [x, y, z] = end;
        let program = program(&config, &format!("G1 X{x} Y{y} Z{z}"));
        let report = validate(&program, &config);
        assert!(report.is_accepted(), "{name}: {:#?}", report.findings);
        let setpoints = run(&program, &config);
        let length_mm = norm(sub(end, START));
        let along = scale(sub(end, START), 1.0 / length_mm);
        follows_the_formula(name, &setpoints, &config, length_mm, |s| (add_scaled(START, along, s), along));
        keeps_limits(name, &setpoints, &config);
    }
}

#[test]
fn offsets_follow_the_formula_along_an_arc() {
    for (name, description) in kinds() {
        let config = oscillating(description);
        let [.., along] = across(&config, [12.0, -22.0]);
        // A quarter of a circle in the coordinate plane most across the tool.
        let (plane, first, second) = [("G19", 1, 2), ("G18", 2, 0), ("G17", 0, 1)][along];
        let radius_mm = 20.0;
        let mut end = START;
        (end[first], end[second]) = (end[first] + radius_mm, end[second] + radius_mm);
        let [x, y, z] = end;
        let program = program(&config, &format!("{plane} G3 X{x} Y{y} Z{z} R{radius_mm}"));
        let report = validate(&program, &config);
        assert!(report.is_accepted(), "{name}: {:#?}", report.findings);
        let setpoints = run(&program, &config);
        follows_the_formula(name, &setpoints, &config, FRAC_PI_2 * radius_mm, |s| {
            let (sine, cosine) = (s / radius_mm).sin_cos();
            let (mut place, mut tangent) = (START, [0.0; 3]);
            (place[first], place[second]) =
                (place[first] + radius_mm * sine, place[second] + radius_mm * (1.0 - cosine));
            (tangent[first], tangent[second]) = (cosine, sine);
            (place, tangent)
        });
        keeps_limits(name, &setpoints, &config);
    }
}

#[test]
fn a_head_oscillates_in_work_coordinates_and_from_anywhere() {
    let config = oscillating(kinds().swap_remove(4).1);
    let program = program(&config, "G1 X30 Y6 Z20");
    let machine = run(&program, &config);
    let work = run(&program, &PipelineConfig { frame: Frame::Work, ..config.clone() });
    for (row, pose) in poses(&machine, &config).iter().enumerate().filter(|(row, _)| machine.line[*row] == 6) {
        let shown = [0, 1, 2].map(|axis| work.axes[axis][row]);
        assert!(norm(sub(pose.tip_mm, shown)) < 1e-9, "setpoint {row}: {shown:?}");
    }
    for (_, offset, snapshot) in snapshots(program.as_bytes(), &config) {
        let (first, rest) = resume(program.as_bytes(), &config, offset, &snapshot);
        for place in 0..rest.len() {
            assert_eq!(rest.bits(place), machine.bits(first as usize + place), "setpoint {place} from {first}");
        }
    }
}

#[test]
fn what_leaves_nothing_of_a_machine_axis_is_refused() {
    // Where the head lies down, Z has to carry the feed's offset of 0.4 mm, and upright only the 0.03 mm along the tool.
    let mut config = oscillating(kinds().swap_remove(3).1);
    let program = "T1 M6\nM3 S600\nG43.4 H1\nG0 X0 Y0 Z20 B80 C0\nG202 P1 D1\nG1 Y30 F600\nG203\nG49\nM30\n";
    assert!(validate(program, &config).is_accepted());
    let z = config.profile.machine.axes.iter_mut().find(|axis| axis.axis == Axis::Z).expect("Z");
    z.max_acceleration_per_s2 = 1_500.0;
    let report = validate(program, &config);
    let codes: Vec<_> = report.findings.iter().map(|finding| finding.code.to_string()).collect();
    assert!(!report.is_accepted() && codes.contains(&"OSC-AXIS-LIMIT".to_owned()), "{codes:?}");
    let upright = validate(&program.replace("B80", "B0"), &config);
    assert!(upright.is_accepted(), "{:#?}", upright.findings);
}

#[test]
fn a_tilted_tool_is_guided_or_refused() {
    let config = oscillating(kinds().swap_remove(3).1);
    let program =
        |tilt: &str| format!("T1 M6\nM3 S600\nG43 H1 G0 X0 Y0 Z20 {tilt}\nG202 P1 D1\nG1 X30 F600\nG203\nM30\n");
    assert!(validate(&program("B0"), &config).is_accepted());
    // A table below the upright tool may stand anywhere.
    assert!(validate(&program("C30"), &config).is_accepted());
    let report = validate(&program("B20"), &config);
    let codes: Vec<_> = report.findings.iter().map(|finding| finding.code.to_string()).collect();
    assert!(!report.is_accepted() && codes.contains(&"OSC-FIVE-AXIS".to_owned()), "{codes:?}");
    // The cure: a tilted plane.
    let cured =
        "T1 M6\nM3 S600\nG68.2 I90 J20 K-90\nG53.1\nG43 H1\nG0 X0 Y0 Z20\nG202 P1 D1\nG1 X30 F600\nG203\nG69\nM30\n";
    let report = validate(cured, &config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
}

#[test]
fn axes_that_are_not_the_tools_own_are_refused_without_guidance() {
    let program = "T1 M6\nM3 S600\nG43 H1 G0 X0 Y0 Z20\nG202 P1 D1\nG1 X30 F600\nG203\nM30\n";
    let is_refused = |change: fn(&mut KinematicsDescription)| {
        // Both rotary axes turn the work.
        let mut description = kinds().swap_remove(1).1;
        change(&mut description);
        let report = validate(program, &oscillating(description));
        let refused = report.findings.iter().any(|finding| finding.code == "OSC-FIVE-AXIS");
        assert_eq!(report.is_accepted(), !refused, "{:#?}", report.findings);
        refused
    };
    assert!(!is_refused(|_| {}));
    assert!(is_refused(|description| description.tool_direction = [1.0, 0.0, 0.0]));
    assert!(is_refused(|description| {
        let y = description.chain.iter_mut().find(|it| it.axis == Axis::Y).expect("Y");
        y.direction = [0.01, 1.0, 0.0];
    }));
}

/// Codes of what is found in a program with a guided tool that stands upright.
fn codes(cut: &str) -> (bool, Vec<String>) {
    let config = oscillating(kinds().swap_remove(0).1);
    let program = format!("T1 M6\nM3 S600\nG43.4 H1\nG0 X0 Y0 Z20 A0 C0\nG202 P1 D1\n{cut}\nG203\nG49\nM30\n");
    let report = validate(&program, &config);
    (report.is_accepted(), report.findings.iter().map(|finding| finding.code.to_string()).collect())
}

#[test]
fn an_arc_that_becomes_parallel_to_a_guided_tool_is_refused() {
    // Start, middle and end lie far from both vertical tangents.
    let (accepted, codes) = codes("G18 G2 X0 Z20 I-150 K259.808 F600");
    assert!(!accepted && codes.contains(&"OSC-PLUNGE".to_owned()), "{codes:?}");
}

#[test]
fn a_wave_is_judged_by_its_crests_however_many_there_are() {
    // A uniform cubic B-spline of 16 waves: its crests bend by 2·A/5² there, at most 0.157/mm may be cut with.
    let wave = |amplitude_mm: f64| {
        let points = (1..=64).map(|point| {
            let side = [0.0, 1.0, 0.0, -1.0][point % 4];
            format!("X{} Y{} P1", 5 * point, amplitude_mm * side)
        });
        let points: Vec<_> = points.collect();
        codes(&format!("G5.2 {} L4 F600\n{}\nG5.3", points[0], points[1..].join("\n")))
    };
    let (accepted, found) = wave(3.0);
    assert!(!accepted && found.contains(&"OSC-TURNING".to_owned()), "{found:?}");
    let (_, found) = wave(1.0);
    assert!(!found.iter().any(|code| code == "OSC-TURNING" || code == "SYNTAX"), "{found:?}");
}

/// Largest jerk of an axis while the feed is steady on line 6, by third differences.
fn largest_jerk(setpoints: &Setpoints, column: usize, period_s: f64) -> f64 {
    let rows: Vec<usize> = (0..setpoints.len()).filter(|&row| setpoints.line[row] == 6).collect();
    let steady_mm = setpoints.path[rows[rows.len() / 2]] - setpoints.path[rows[rows.len() / 2] - 1];
    let is_steady = |row: usize| {
        let own_mm = setpoints.path[row] - setpoints.path[row - 1];
        (own_mm / steady_mm - 1.0).abs() < 1e-6
    };
    let axis = &setpoints.axes[column];
    let jerk =
        |row: usize| (axis[row] - 3.0 * (axis[row - 1] - axis[row - 2]) - axis[row - 3]).abs() / period_s.powi(3);
    let rows = rows[0] + 3..=rows[rows.len() - 1];
    rows.filter(|&row| (row - 2..=row).all(is_steady)).map(jerk).fold(0.0, f64::max)
}

#[test]
fn what_an_oscillation_is_said_to_take_is_what_setpoints_show_and_the_cure_is_accepted() {
    let mut ratios = Vec::new();
    for (name, description) in kinds() {
        let mut config = oscillating(description);
        for axis in &mut config.profile.machine.axes {
            axis.max_jerk_per_s3 *= 100.0;
        }
        config.profile.tool_oscillation[0].condition.axial.waveform = Waveform::Sine;
        let [best, next, _] = across(&config, [12.0, -22.0]);
        let mut end = START;
        (end[best], end[next]) = (end[best] + 30.0, end[next] + 6.0);
        let [x, y, z] = end;
        let program = program(&config, &format!("G1 X{x} Y{y} Z{z}"));
        // The limits are judged for twice the feed.
        let setpoints = run(&program.replace("F600", "F1200"), &config);
        let axes = [Axis::X, Axis::Y, Axis::Z];
        let columns = axes.map(|axis| config.profile.machine.column_of(axis).expect("a linear axis"));
        let (column, shown) = columns
            .map(|column| (column, largest_jerk(&setpoints, column, config.period_s())))
            .into_iter()
            .fold((0, 0.0), |most, own| if own.1 > most.1 { own } else { most });
        config.profile.machine.axes[column].max_jerk_per_s3 = 0.9 * shown;
        let report = validate(&program, &config);
        let finding = report.findings.iter().find(|finding| finding.code == "OSC-AXIS-LIMIT");
        let finding = finding.unwrap_or_else(|| panic!("{name}: {:#?}", report.findings));
        let taken = finding.values.iter().find(|value| value.name == "demanded").expect("what it takes").value;
        ratios.push(taken / shown);
        let cure = |name: &str| {
            let mut values = finding.suggestions.iter().filter_map(|suggestion| suggestion.value.as_ref());
            values.find(|value| value.name == name).unwrap_or_else(|| panic!("{finding:#?}")).value
        };
        let condition = &mut config.profile.tool_oscillation[0].condition;
        (condition.feed.amplitude_mm, condition.axial.amplitude_mm) = (cure("feed_amplitude"), cure("axial_amplitude"));
        assert!(condition.feed.amplitude_mm > 0.1, "{name}: {finding:#?}");
        let report = validate(&program, &config);
        assert!(report.is_accepted(), "{name}: {:#?}", report.findings);
        keeps_limits(name, &run(&program, &config), &config);
    }
    assert!(ratios.iter().all(|ratio| (1.0..1.6).contains(ratio)), "{ratios:?}");
}

#[test]
fn the_waveform_that_is_named_for_a_step_is_accepted_with_the_amplitude_that_is_named() {
    let mut with_less = 0;
    for (name, description) in kinds() {
        for jerk_share in [1.0, 0.3, 0.1, 0.04] {
            let mut config = oscillating(description.clone());
            for axis in config.profile.machine.axes.iter_mut().filter(|axis| !axis.axis.is_rotary()) {
                axis.max_jerk_per_s3 = jerk_share * 4_000_000.0;
            }
            let [best, next, _] = across(&config, [12.0, -22.0]);
            let mut end = START;
            (end[best], end[next]) = (end[best] + 30.0, end[next] + 6.0);
            let [x, y, z] = end;
            let program = program(&config, &format!("G1 X{x} Y{y} Z{z}"));
            let report = validate(&program, &config);
            if !report.is_accepted() {
                continue;
            }
            let finding = report.findings.iter().find(|finding| finding.code == "OSC-JERK-STEP").expect("a step");
            let Some((suggestion, hold_share)) = finding.suggestions.iter().find_map(|suggestion| {
                Some((suggestion, suggestion.value.as_ref().filter(|value| value.name == "hold_share")?.value))
            }) else {
                continue;
            };
            let axial = &mut config.profile.tool_oscillation[0].condition.axial;
            axial.waveform = Waveform::JerkLimitedHeldPeak { hold_share };
            if let Some((_, rest)) = suggestion.message.split_once("an amplitude of ") {
                axial.amplitude_mm = rest.split(' ').next().expect("a number").parse().expect("mm");
                with_less += 1;
            }
            let report = validate(&program, &config);
            assert!(report.is_accepted(), "{name} {jerk_share}: {suggestion:?} {:#?}", report.findings);
            assert!(report.findings.iter().all(|finding| finding.code != "OSC-JERK-STEP"), "{:#?}", report.findings);
        }
    }
    assert!(with_less > 0);
}
