//! Tool oscillation under tool centre point control where the tool leans along the feed: the offset along the feed stays on the path,
//! whatever kind of machine carries it out.

use std::f64::consts::FRAC_PI_2;

use feedwave_cutting::PipelineConfig;
use feedwave_cutting::tool_oscillation::{DirectionOscillation, Waveform};
use feedwave_motion::kinematics::vector::{Vec3, add_scaled, dot, norm, scale, sub};

use super::oscillation_kinds::{START, across, follows_the_formula, oscillating, program};
use crate::common::course::Course;
use crate::common::machines::{kinds, poses};
use crate::common::{Setpoints, resume, run, snapshots, validate};

/// With sines alone, whose jerk is bounded, and across the feed as well.
fn smooth(config: &mut PipelineConfig) {
    let condition = &mut config.profile.tool_oscillation[0].condition;
    condition.axial.waveform = Waveform::Sine;
    condition.cross = Some(DirectionOscillation { amplitude_mm: 0.05, waveform: Waveform::Sine, phase_deg: 40.0 });
}

/// A line that goes along the tool as much as across it nearly, and its length.
fn climbing(config: &PipelineConfig) -> (String, Vec3, f64) {
    let [best, next, along] = across(config, [12.0, -22.0]);
    let mut end = START;
    (end[best], end[next], end[along]) = (end[best] + 22.0, end[next] + 4.0, end[along] + 17.0);
    let [x, y, z] = end;
    let travel = sub(end, START);
    let length_mm = norm(travel);
    (program(config, &format!("G1 X{x} Y{y} Z{z}")), scale(travel, 1.0 / length_mm), length_mm)
}

#[track_caller]
fn accepted(name: &str, program: &str, config: &PipelineConfig) -> Setpoints {
    let report = validate(program, config);
    assert!(report.is_accepted(), "{name}: {:#?}", report.findings);
    run(program, config)
}

fn keeps_limits(name: &str, setpoints: &Setpoints, config: &PipelineConfig) {
    let period_s = config.period_s();
    for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
        for k in column.windows(4) {
            let velocity = ((k[1] - k[0]) / period_s).abs();
            let acceleration = ((k[2] - 2.0 * k[1] + k[0]) / period_s.powi(2)).abs();
            let jerk = ((k[3] - 3.0 * (k[2] - k[1]) - k[0]) / period_s.powi(3)).abs();
            assert!(velocity <= axis.max_velocity_per_s * 1.001, "{name}: {}: {velocity}", axis.name);
            assert!(acceleration <= axis.max_acceleration_per_s2 * 1.01, "{name}: {}: {acceleration}", axis.name);
            assert!(jerk <= axis.max_jerk_per_s3 * 1.02, "{name}: {}: {jerk}", axis.name);
        }
    }
}

#[test]
fn a_leaning_tool_oscillates_along_its_path() {
    for (name, description) in kinds() {
        let mut config = oscillating(description);
        for with_cross in [false, true] {
            if with_cross {
                smooth(&mut config);
            }
            let (program, along, length_mm) = climbing(&config);
            let setpoints = accepted(name, &program, &config);
            let path = |s| (add_scaled(START, along, s), along);
            follows_the_formula(name, &setpoints, &config, length_mm, path);
        }
    }
}

#[test]
fn a_leaning_tool_never_leaves_its_line_by_the_feed_alone() {
    for (name, description) in kinds() {
        let config = oscillating(description);
        let (program, along, length_mm) = climbing(&config);
        let setpoints = accepted(name, &program.replace("D1", "D1 A0.4 Q0"), &config);
        let poses = poses(&setpoints, &config);
        let rows = (0..setpoints.len()).filter(|&row| setpoints.line[row] == 6);
        let base_mm = setpoints.path[rows.clone().next_back().expect("a cut")] - length_mm;
        let mut swung_mm = 0.0_f64;
        for row in rows {
            let from = sub(poses[row].tip_mm, START);
            let reached_mm = dot(from, along);
            let off_mm = norm(sub(from, scale(along, reached_mm)));
            assert!(off_mm < 1e-9, "{name}: setpoint {row}: {off_mm:e} mm beside the line");
            swung_mm = swung_mm.max((reached_mm - (setpoints.path[row] - base_mm)).abs());
        }
        assert!((swung_mm - 0.4).abs() < 1e-3, "{name}: {swung_mm}");
    }
}

#[test]
fn a_helix_of_a_leaning_tool_follows_the_formula() {
    for (name, description) in kinds() {
        let config = oscillating(description);
        let [.., along] = across(&config, [12.0, -22.0]);
        let (plane, first, second) = [("G19", 1, 2), ("G18", 2, 0), ("G17", 0, 1)][along];
        let (radius_mm, rise_mm) = (20.0, 14.0);
        let mut end = START;
        (end[first], end[second], end[along]) = (end[first] + radius_mm, end[second] + radius_mm, end[along] + rise_mm);
        let [x, y, z] = end;
        let program = program(&config, &format!("{plane} G3 X{x} Y{y} Z{z} R{radius_mm}"));
        let setpoints = accepted(name, &program, &config);
        let per_rad_mm = rise_mm / FRAC_PI_2;
        let rate_mm = radius_mm.hypot(per_rad_mm);
        follows_the_formula(name, &setpoints, &config, FRAC_PI_2 * rate_mm, |s| {
            let (sine, cosine) = (s / rate_mm).sin_cos();
            let (mut place, mut tangent) = (START, [0.0; 3]);
            (place[first], place[second], place[along]) = (
                place[first] + radius_mm * sine,
                place[second] + radius_mm * (1.0 - cosine),
                place[along] + per_rad_mm * s / rate_mm,
            );
            (tangent[first], tangent[second], tangent[along]) =
                (radius_mm * cosine / rate_mm, radius_mm * sine / rate_mm, per_rad_mm / rate_mm);
            (place, tangent)
        });
    }
}

#[test]
fn a_spline_of_a_leaning_tool_follows_the_formula() {
    // On a table and on a head, with the curve across the tool's zero direction.
    for kind in [0, 4] {
        let (name, description) = kinds().swap_remove(kind);
        let mut config = oscillating(description);
        let program = program(&config, "G5 I20 J0 P-5 Q-20 X40 Y25");
        let plain = program.replace("G202 P1 D1", "G4 P0.1").replace("G203", "").replace("F600", "F150");
        let setpoints = run(&plain, &config);
        let tips: Vec<Vec3> = poses(&setpoints, &config).iter().map(|pose| pose.tip_mm).collect();
        let course = Course::of(&setpoints, &tips, |line| line == 6);
        for with_cross in [false, true] {
            if with_cross {
                smooth(&mut config);
            }
            let setpoints = accepted(name, &program, &config);
            follows_the_formula(name, &setpoints, &config, course.length_mm(), |s| course.at(s));
        }
    }
}

#[test]
fn limits_hold_where_the_tool_leans() {
    for (name, description) in kinds() {
        for period_us in [250, 1_000] {
            let mut config = oscillating(description.clone());
            config.interpolation_period_us = period_us;
            smooth(&mut config);
            for axis in config.profile.machine.axes.iter_mut().filter(|axis| !axis.axis.is_rotary()) {
                (axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3) =
                    (80.0, 4_500.0, 900_000.0);
            }
            let (program, ..) = climbing(&config);
            keeps_limits(name, &accepted(name, &program, &config), &config);
        }
    }
}

#[test]
fn travel_ends_where_a_leaning_tool_goes() {
    for (name, description) in kinds() {
        let config = oscillating(description);
        let (program, ..) = climbing(&config);
        let setpoints = accepted(name, &program, &config);
        let rows: Vec<usize> = (0..setpoints.len()).filter(|&row| setpoints.line[row] == 6).collect();
        for (column, axis) in setpoints
            .axes
            .iter()
            .enumerate()
            .filter(|(column, _)| !config.profile.machine.axes[*column].axis.is_rotary())
        {
            let most = rows.iter().map(|&row| axis[row]).fold(f64::NEG_INFINITY, f64::max);
            let refused = |most: f64| {
                let mut config = config.clone();
                config.profile.machine.axes[column].travel_max = Some(most);
                // The rapid before begins elsewhere.
                let report = validate(&program, &config);
                report.findings.iter().any(|finding| finding.code == "AXIS-TRAVEL" && finding.span.line == 6)
            };
            assert!(refused(most - 1e-6), "{name}: axis {column} at {most}");
            assert!(!refused(most + 0.7), "{name}: axis {column} at {most}");
        }
    }
}

#[test]
fn a_ramp_in_a_tilted_plane_stays_on_its_line() {
    let (name, description) = kinds().swap_remove(3);
    let config = oscillating(description);
    let text = |words: &str| {
        format!(
            "T1 M6\nM3 S600\nG68.2 I90 J20 K-90\nG53.1\nG43 H1\nG0 X0 Y0 Z20\nG202 P1 D1 {words}\nG1 X24 Y5 Z8 F600\nG203\nG69\nM30\n"
        )
    };
    let tips = |text: &str| {
        let setpoints = accepted(name, text, &config);
        let poses = poses(&setpoints, &config);
        let cut = (0..setpoints.len()).filter(|&row| setpoints.line[row] == 8);
        cut.map(|row| (poses[row].tip_mm, setpoints.vibration[row])).collect::<Vec<_>>()
    };
    let cut = tips(&text("A0.4 Q0"));
    let [first, last] = [cut[0].0, cut[cut.len() - 1].0];
    let along = scale(sub(last, first), 1.0 / norm(sub(last, first)));
    let mut swung = 0;
    for (tip, offset) in &cut {
        let from = sub(*tip, first);
        let off_mm = norm(sub(from, scale(along, dot(from, along))));
        assert!(off_mm < 1e-8, "{off_mm:e} mm beside the line");
        swung += u32::from(offset.abs() > 0.39);
    }
    assert!(swung > 100, "{swung}");
}

#[test]
fn a_resumed_ramp_of_a_leaning_tool_continues_to_the_bit() {
    let config = oscillating(kinds().swap_remove(5).1);
    let (program, ..) = climbing(&config);
    let whole = run(&program, &config);
    for (_, offset, snapshot) in snapshots(program.as_bytes(), &config) {
        let (first, rest) = resume(program.as_bytes(), &config, offset, &snapshot);
        assert!((0..rest.len()).all(|place| rest.bits(place) == whole.bits(first as usize + place)));
    }
}
