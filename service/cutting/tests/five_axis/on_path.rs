//! The tool centre point stays on its segment whatever happens to the feed: under overrides, and with vibration along the path.

use feedwave_cutting::{OverrideChange, PipelineConfig};
use feedwave_motion::kinematics::vector::{Vec3, norm, sub};

use super::machine::config;
use super::{distance, poses};
use crate::common::{Setpoints, run, validate};

const CORNERS: [Vec3; 4] = [[0.0, 0.0, 30.0], [20.0, 5.0, 20.0], [25.0, -10.0, 20.0], [0.0, -10.0, 20.0]];

/// From corner to corner in lines 2 to 4.
const PROGRAM: &str = "G43.5 H1 G0 X0 Y0 Z30 I0.3 J-0.3 K1
G1 X20 Y5 Z20 I-0.1 J-0.5 K1 F2000
X25 Y-10 I-.4 K.9
X0
G0 Z60
M30
";

/// Asserts that every setpoint of the cut, in three lines from `first_line` on, is on its segment; how many there are. A vibration reaches into the block before.
fn on_their_segments(setpoints: &Setpoints, config: &PipelineConfig, first_line: usize) -> usize {
    let mut seen = 0;
    for (pose, &line) in poses(setpoints, config).iter().zip(&setpoints.line) {
        let Some(block) = (line as usize).checked_sub(first_line).filter(|block| *block < 3) else { continue };
        let near = block.saturating_sub(1)..(block + 2).min(3);
        let off =
            near.map(|block| distance(pose.tip_mm, CORNERS[block], CORNERS[block + 1])).fold(f64::INFINITY, f64::min);
        assert!(off < 1e-9, "line {line}: {off:e}");
        seen += 1;
    }
    seen
}

#[test]
fn overrides_do_not_lead_off_the_segment() {
    let mut config = config();
    let plain = on_their_segments(&run(PROGRAM, &config), &config, 2);
    let change = |index, ratio| OverrideChange { index, ratio };
    config.overrides = vec![change(900, 0.3), change(1_500, 1.7), change(2_000, 0.0), change(2_300, 1.2)];
    let setpoints = run(PROGRAM, &config);
    let seen = on_their_segments(&setpoints, &config, 2);
    assert!(seen > 500 && seen != plain, "{seen} {plain}");
    let last = poses(&setpoints, &config);
    let end = [CORNERS[3][0], CORNERS[3][1], 60.0];
    assert!(norm(sub(last[last.len() - 1].tip_mm, end)) < 1e-9);
}

#[test]
fn a_vibrating_tool_stays_on_its_segments_and_within_the_limits() {
    let config = config();
    let program = PROGRAM
        .replace("\nG1 X20", "\nG200 F5 A0.02\nG1 X20")
        .replace("\nG0 Z60", "\nG201\nG0 Z60")
        .replace("F2000", "F1000");
    let report = validate(&program, &config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    let setpoints = run(&program, &config);
    assert!(setpoints.vibration.iter().any(|offset| offset.abs() > 0.018));
    assert!(on_their_segments(&setpoints, &config, 3) > 500);
    let period_s = config.period_s();
    for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
        let fastest = column.windows(2).map(|k| ((k[1] - k[0]) / period_s).abs()).fold(0.0, f64::max);
        assert!(fastest <= axis.max_velocity_per_s * 1.001, "{}: {fastest}", axis.name);
    }
}
