//! Tool length compensation through the pipeline: machine coordinates are those of the machine's control point, work
//! coordinates those of the tip.

use crate::common::{resume, run, snapshots, validate};
use feedwave_cutting::{Frame, MachineProfile, PipelineConfig, Tool};
use feedwave_program::{Axis, ToolOffset};

fn tool(number: u32, length_mm: Option<f64>) -> Tool {
    let row = ToolOffset::new(number);
    Tool { number, offset: length_mm.map_or(row, |length_mm| row.with_length(length_mm)), ..Tool::default() }
}

fn config() -> PipelineConfig {
    let mut profile = MachineProfile::mill();
    profile.language.work_offsets[0][Axis::Z.index()] = -300.0;
    profile.language.initial_position[Axis::Z.index()] = 0.0;
    let tools = vec![tool(1, Some(120.5)), tool(2, Some(80.0)), tool(3, None)];
    PipelineConfig { tools, ..PipelineConfig::new(profile) }
}

/// The end of a CAM post's typical program: safety line, tool, approach, cut, retreat.
const PROGRAM: &str = "%
O1000
G17 G21 G40 G49 G80 G90 G94
T1 M6
S3000 M3
G54 G0 X10 Y10
G43 H1 Z50
G0 Z2
G1 Z-1 F600
X30
G2 X40 Y20 R10
G1 Y30
G0 Z50
G91 G28 Z0
T2 M6
G90 G43 H2 G0 Z2
G1 Z-1
X10
G0 G53 Z0
G49
M30
%
";

fn z_column(config: &PipelineConfig) -> usize {
    config.profile.machine.axes.iter().position(|axis| axis.axis == Axis::Z).expect("a mill has Z")
}

#[test]
fn setpoints_are_of_the_control_point_and_of_the_tip() {
    let config = config();
    let z = z_column(&config);
    assert!(validate(PROGRAM, &config).is_accepted(), "{:#?}", validate(PROGRAM, &config).findings);
    let machine = run(PROGRAM, &config);
    let work = run(PROGRAM, &PipelineConfig { frame: Frame::Work, ..config });
    assert_eq!(machine.len(), work.len());
    let mut seen = [0; 2];
    for index in 0..machine.len() {
        let (machine_mm, work_mm) = (machine.axes[z][index], work.axes[z][index]);
        // What is cut lies at Z −1, with either tool.
        let (tool, length_mm) = match machine.line[index] {
            10..=12 => (0, 120.5),
            18 => (1, 80.0),
            _ => continue,
        };
        seen[tool] += 1;
        assert!((work_mm + 1.0).abs() < 1e-12, "{index}: {work_mm}");
        assert!((machine_mm - (-1.0 - 300.0 + length_mm)).abs() < 1e-12, "{index}: {machine_mm}");
    }
    assert!(seen.iter().all(|&seen| seen > 100), "{seen:?}");
    // G28 and G53 are machine positions; and nothing jumps where the length changes.
    assert_eq!(machine.axes[z].last(), Some(&0.0));
    let largest = machine.axes[z].windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    assert!(largest < 1.0, "{largest}");
}

#[test]
fn travel_limits_are_judged_with_the_length() {
    let mut config = config();
    let z = z_column(&config);
    config.profile.machine.axes[z].travel_min = Some(-250.0);
    config.profile.machine.axes[z].travel_max = Some(0.0);
    let refusal = |program: &str| {
        let report = validate(program, &config);
        let finding = report.findings.iter().find(|finding| finding.code == "AXIS-TRAVEL").cloned();
        assert_eq!(finding.is_none(), report.is_accepted(), "{:#?}", report.findings);
        finding.map(|finding| finding.values[0].value)
    };
    assert_eq!(refusal("T1 M6\nG43 H1 G0 Z2\nM30\n"), None);
    // Without the length the spindle would be at Z −298, and with the other one the tip cannot be so high.
    assert_eq!(refusal("T1 M6\nG0 Z2\nM30\n"), Some(-298.0));
    assert_eq!(refusal("T1 M6\nG43 H1 G0 Z200\nM30\n"), Some(20.5));
}

#[test]
fn an_unknown_length_is_refused_before_anything_moves() {
    for number in [3, 7] {
        let report = validate(&format!("G43 H{number} G0 Z10\nM30\n"), &config());
        assert!(!report.is_accepted());
        let finding = report.findings.iter().find(|finding| finding.code == "PRG-TOOL-LENGTH").expect("a finding");
        assert_eq!(finding.values[0].value, f64::from(number));
        assert!(!finding.suggestions.is_empty());
    }
}

#[test]
fn a_stream_from_anywhere_is_the_same() {
    let config = config();
    let whole = run(PROGRAM, &config);
    for (_, offset, snapshot) in snapshots(PROGRAM.as_bytes(), &config) {
        let (first, rest) = resume(PROGRAM.as_bytes(), &config, offset, &snapshot);
        for at in 0..rest.len() {
            assert_eq!(rest.bits(at), whole.bits(first as usize + at), "{first} + {at}");
        }
    }
}
