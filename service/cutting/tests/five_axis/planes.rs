//! Tilted planes on every kind of machine: the tool axis turned about the tip, and vibration along the path.

use std::f64::consts::{FRAC_PI_2, TAU};

use feedwave_cutting::{PipelineConfig, VibrationEnvelope};
use feedwave_motion::kinematics::vector::{Vec3, angle, norm, sub};
use feedwave_program::TiltedPlane;

use crate::common::machines::{config_of, kinds, poses};
use crate::common::{Setpoints, run, validate};

fn plane() -> TiltedPlane {
    TiltedPlane::by_euler_angles([5.0, -3.0, 2.0], [20.0, 25.0, 40.0], 0)
}

const PLANE: &str = "G68.2 X5 Y-3 Z2 I20 J25 K40";

/// Setpoints of a line: row, and the tool centre point in the coordinates of the plane.
fn tips(setpoints: &Setpoints, config: &PipelineConfig, line: u32) -> Vec<(usize, Vec3)> {
    let poses = poses(setpoints, config);
    let rows = (0..setpoints.len()).filter(|&row| setpoints.line[row] == line);
    rows.map(|row| (row, plane().from_work(poses[row].tip_mm))).collect()
}

#[test]
fn the_tip_rests_on_the_work_while_the_tool_axis_turns() {
    for (name, description) in kinds().into_iter().take(6) {
        let config = config_of(description);
        let program = format!("{PLANE}\nG43 H1\nG0 X8 Y9 Z30\nG53.6\nG1 Z25 F3000\nG69\nM30\n");
        let report = validate(&program, &config);
        assert!(report.is_accepted() && report.findings.is_empty(), "{name}: {:#?}", report.findings);
        let setpoints = run(&program, &config);
        let turn = tips(&setpoints, &config, 4);
        assert!(turn.len() > 100, "{name}: {}", turn.len());
        for (row, tip) in &turn {
            assert!(norm(sub(*tip, [8.0, 9.0, 30.0])) < 1e-9, "{name}: setpoint {row}: {tip:?}");
        }
        let poses = poses(&setpoints, &config);
        for (row, tip) in tips(&setpoints, &config, 5) {
            assert!((tip[0] - 8.0).hypot(tip[1] - 9.0) < 1e-9, "{name}: setpoint {row}: {tip:?}");
            assert!(angle(poses[row].direction, plane().axes[2]) < 1e-9, "{name}");
        }
    }
}

#[test]
fn a_vibrating_tool_is_where_the_formula_says() {
    // A line, and an arc of radius 20 that goes on from it.
    let (line_mm, radius_mm) = (30.0, 20.0);
    let (hertz, amplitude_mm) = (10.0, 0.03);
    for (name, description) in kinds().into_iter().take(6) {
        let config = PipelineConfig { vibration_envelope: VibrationEnvelope::Published, ..config_of(description) };
        let program = format!(
            "M3 S1000\n{PLANE}\nG53.1\nG43 H1\nG0 X0 Y0 Z5\nG200 F{hertz} A{amplitude_mm}\nG1 X{line_mm} F600\nG3 X50 Y20 R{radius_mm}\nG201\nG69\nM30\n"
        );
        let report = validate(&program, &config);
        assert!(report.is_accepted(), "{name}: {:#?}", report.findings);
        let setpoints = run(&program, &config);
        let base_mm = setpoints.path.iter().zip(&setpoints.line).filter(|(_, line)| **line < 7).map(|(path, _)| *path);
        let base_mm = base_mm.fold(0.0, f64::max);
        let whole_mm = line_mm + FRAC_PI_2 * radius_mm;
        // Phase 0 is the last setpoint at rest before the command moves.
        let first = setpoints.vibration.iter().position(|&offset| offset != 0.0).expect("it vibrates") - 1;
        let mut rows = tips(&setpoints, &config, 7);
        rows.extend(tips(&setpoints, &config, 8));
        let [mut checked, mut on_arc] = [0, 0];
        for (row, tip) in rows {
            let place_mm = setpoints.path[row] - base_mm + setpoints.vibration[row];
            let at_mm = place_mm.clamp(0.0, whole_mm);
            let exact = if at_mm <= line_mm {
                [at_mm, 0.0, 5.0]
            } else {
                let (sine, cosine) = ((at_mm - line_mm) / radius_mm).sin_cos();
                [line_mm + radius_mm * sine, radius_mm * (1.0 - cosine), 5.0]
            };
            let off_mm = norm(sub(tip, exact));
            assert!(off_mm < 2e-9, "{name}: setpoint {row}: {off_mm:e} mm beside its place");
            on_arc += u32::from(at_mm > line_mm);
            if (0.5..whole_mm - 0.5).contains(&at_mm) {
                let offset_mm = amplitude_mm * (TAU * hertz * (row - first) as f64 * config.period_s()).sin();
                assert!((setpoints.vibration[row] - offset_mm).abs() < 1e-9, "{name}: setpoint {row}");
                checked += 1;
            }
        }
        assert!(checked > 3_000 && on_arc > 1_000, "{name}: {checked} {on_arc}");
    }
}
