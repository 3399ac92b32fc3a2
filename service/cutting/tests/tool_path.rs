//! The path that a program takes, as pictures show it.

use feedwave_cutting::{GuidedCuts, MachineProfile, OverrideChange, PathPoint, PipelineConfig, Tool};
use feedwave_cutting::{ToolMotion, ToolPath, ToolPathSink};
use feedwave_program::ToolOffset;

#[derive(Debug, Default)]
struct Collected {
    lines: Vec<(ToolMotion, PathPoint, PathPoint)>,
    rapids: Vec<u32>,
    cuts: Vec<(u32, f64)>,
}

impl ToolPathSink for Collected {
    fn line(&mut self, motion: ToolMotion, from: PathPoint, to: PathPoint) {
        self.lines.push((motion, from, to));
    }

    fn rapid(&mut self, line: u32) {
        self.rapids.push(line);
    }

    fn cut(&mut self, line: u32, max_mm_per_min: f64) {
        self.cuts.push((line, max_mm_per_min));
    }
}

fn path_of(config: &PipelineConfig, program: &str, piece_bytes: usize) -> (Collected, GuidedCuts) {
    let (mut path, mut collected) = (ToolPath::new(config), Collected::default());
    while let Some(place) = path.read(&mut collected) {
        let end = program.len().min(place.offset as usize + piece_bytes);
        path.supply(place, &program.as_bytes()[..end]);
    }
    let cuts = path.finish(&mut collected);
    (collected, cuts)
}

#[test]
fn a_turning_program_goes_from_rapid_to_cut_to_vibration_whatever_the_pieces() {
    let config = PipelineConfig {
        overrides: vec![OverrideChange { index: 5, ratio: 1.5 }],
        ..PipelineConfig::new(MachineProfile::lathe())
    };
    let program = "G21 G18 G90 G95 G97 S1000 M3\nG0 X20 Z5\nG1 X20 Z0 F0.1\nG200 F50 A0.03\nG1 Z-10\nG201\nM30\n";
    let (path, guided) = path_of(&config, program, program.len());
    let corner = |x, z| [x, 0.0, z];
    let motions: Vec<_> = path.lines.iter().map(|(motion, _, to)| (*motion, *to)).collect();
    assert_eq!(
        motions,
        [
            (ToolMotion::Rapid, corner(10.0, 5.0)),
            (ToolMotion::Cutting, corner(10.0, 0.0)),
            (ToolMotion::Vibrating, corner(10.0, -10.0))
        ]
    );
    // 0.1 mm/rev at 1000 rev/min, and the largest override.
    assert_eq!((path.rapids, path.cuts), (vec![2], vec![(3, 150.0), (5, 150.0)]));
    assert!(guided.lines.is_empty());
    let (in_pieces, _) = path_of(&config, program, 3);
    assert_eq!(in_pieces.lines, path.lines);
}

#[test]
fn a_circle_is_chords_that_stay_near_it() {
    let config = PipelineConfig::new(MachineProfile::mill());
    let (path, _) = path_of(&config, "G21 G90 G94 G17 F500\nG0 X10 Y0\nG3 X-10 Y0 I-10 J0\nM30\n", 1_000);
    let arc: Vec<_> = path.lines.iter().filter(|(motion, ..)| *motion == ToolMotion::Cutting).collect();
    assert_eq!(arc.len(), 90, "two degrees each");
    for (_, from, to) in &arc {
        let middle = [0, 1].map(|axis| f64::midpoint(from[axis], to[axis]));
        let radius_mm = (middle[0] * middle[0] + middle[1] * middle[1]).sqrt();
        assert!((radius_mm - 10.0).abs() < 0.002, "{radius_mm}");
    }
    let last = arc.last().unwrap().2;
    assert!((last[0] + 10.0).abs() < 1e-9 && last[1].abs() < 1e-9, "{last:?}");
}

#[test]
fn cuts_with_a_guided_tool_are_counted_by_their_lines() {
    let tool = Tool { number: 1, offset: ToolOffset::new(1).with_length(100.0), ..Tool::default() };
    let config = PipelineConfig { tools: vec![tool], ..PipelineConfig::new(MachineProfile::mill()) };
    let program =
        "G21 G90 G94 G17 T1 M6\nG43.4 H1\nG0 X0 Y0 Z10 A0 C0\nG1 X5 F1000\nX10 A5\nG0 Z50\nG1 X0 F500\nG49\nM30\n";
    let (path, guided) = path_of(&config, program, 7);
    assert_eq!(guided.lines, [4..=5, 7..=7]);
    let cut: Vec<_> = path.lines.iter().filter(|(motion, ..)| *motion == ToolMotion::Cutting).collect();
    assert_eq!(cut.iter().map(|(_, _, to)| to[0]).collect::<Vec<_>>(), [5.0, 10.0, 0.0]);
}

#[test]
fn cuts_with_a_guided_tool_are_drawn_with_what_is_superposed() {
    let tool = Tool { number: 1, offset: ToolOffset::new(1).with_length(100.0), ..Tool::default() };
    let config = PipelineConfig { tools: vec![tool], ..PipelineConfig::new(MachineProfile::mill()) };
    for (on, off, motion) in
        [("G200 F20 A0.1", "G201", ToolMotion::Vibrating), ("G202 P1 D1", "G203", ToolMotion::Oscillating)]
    {
        let program = format!(
            "G21 G90 G94 G17 T1 M6\nG43.4 H1\nG0 X0 Y0 Z10 A0 C0\nG1 X5 F900\n{on}\nX10\n{off}\nX15\nG49\nM30\n"
        );
        let (path, _) = path_of(&config, &program, 1_000);
        let drawn: Vec<_> = path.lines.iter().map(|(motion, ..)| *motion).collect();
        assert_eq!(drawn, [ToolMotion::Cutting, motion, ToolMotion::Cutting], "{on}");
    }
}

#[test]
fn splines_of_a_guided_tool_are_drawn_as_curves() {
    let tool = Tool { number: 1, offset: ToolOffset::new(1).with_length(100.0), ..Tool::default() };
    let config = PipelineConfig { tools: vec![tool], ..PipelineConfig::new(MachineProfile::mill()) };
    // A parabola of 30 mm whose middle is 10 mm high.
    for (on, off) in [("G43.4 H1", "G49"), ("G68.2 X0 Y0 Z0 I90 J90 K-90", "G69")] {
        let program =
            format!("G21 G90 G94 G17 T1 M6\nG0 A0 C0\n{on}\nG0 X0 Y0 Z10\nG5.1 X30 Y0 I15 J20 F1000\n{off}\nM30\n");
        let (path, _) = path_of(&config, &program, 7);
        let points: Vec<_> =
            path.lines.iter().filter(|(motion, ..)| *motion == ToolMotion::Cutting).map(|(_, _, to)| *to).collect();
        assert!(points.len() > 30, "{on}: {} chords", points.len());
        let last = points[points.len() - 1];
        let start = path.lines.iter().find(|(motion, ..)| *motion == ToolMotion::Cutting).expect("a cut").1;
        // Farthest from the straight line between both ends.
        let chord = [0, 1, 2].map(|axis| (last[axis] - start[axis]) / 30.0);
        let height = |point: &PathPoint| {
            let from = [0, 1, 2].map(|axis| point[axis] - start[axis]);
            let along: f64 = (0..3).map(|axis| from[axis] * chord[axis]).sum();
            let square: f64 = (0..3).map(|axis| (from[axis] - along * chord[axis]).powi(2)).sum();
            square.sqrt()
        };
        let highest = points.iter().map(height).fold(0.0, f64::max);
        assert!((highest - 10.0).abs() < 0.01, "{on}: {highest}");
    }
}
