//! Five-axis programs from text to setpoints: thinning, tool centre points on their segments, the approach and the
//! retreat of tool centre point control, refusals, streams from the middle, and a freeform program whose flicker goes.

mod ahead;
mod chains;
mod corners;
mod curves;
mod freeform;
mod hostile;
mod least_time;
mod machine;
mod offsets;
mod on_path;
mod oscillation;
mod oscillation_kinds;
mod oscillation_ramps;
mod planes;
mod poles;
mod refusals;

use std::collections::BTreeSet;

use crate::common::{Setpoints, resume, run, run_in_pieces, snapshots, validate};
use feedwave_cutting::thinning::{ThinningMethod, ThinningSettings};
use feedwave_cutting::{Frame, PipelineConfig};
use feedwave_motion::kinematics::vector::{Vec3, add_scaled, angle, dot, norm, sub};
use feedwave_motion::kinematics::{BranchPreference, Kinematics, Setup, ToolPose, Wrap};
use machine::{LENGTH_MM, config};

/// Source lines that any setpoint has been cut from, without the start.
fn lines(setpoints: &Setpoints) -> Vec<u32> {
    let lines: BTreeSet<u32> = setpoints.line.iter().copied().filter(|&line| line > 0).collect();
    lines.into_iter().collect()
}

/// Poses of the tool in work coordinates by forward kinematics.
fn poses(setpoints: &Setpoints, config: &PipelineConfig) -> Vec<ToolPose> {
    let kinematics = Kinematics::new(config.profile.kinematics.as_ref().expect("five axes")).expect("valid");
    let offset = config.profile.language.work_offsets[0];
    let setup = Setup::new(kinematics.gauge_point_at(&kinematics.from_position(&offset)), LENGTH_MM);
    let pose = |index: usize| {
        let mut position = [0.0; 9];
        for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
            position[axis.axis.index()] = column[index];
        }
        kinematics.forward(&kinematics.from_position(&position), &setup)
    };
    (0..setpoints.len()).map(pose).collect()
}

fn distance(point: Vec3, start: Vec3, end: Vec3) -> f64 {
    let travel = sub(end, start);
    let share = if dot(travel, travel) > 0.0 {
        (dot(sub(point, start), travel) / dot(travel, travel)).clamp(0.0, 1.0)
    } else {
        0.0
    };
    norm(sub(point, add_scaled(start, travel, share)))
}

fn with_thinning(thinning: ThinningSettings) -> PipelineConfig {
    let mut config = config();
    config.profile.thinning = thinning;
    config
}

/// Figure 13: N2 and N10 switch the mode; a group of four, then one of three.
const FIGURE_13: &str = "N1 G43.4 H1 G0 X0 Y0 Z20 A-20 C0
N2 M33
N3 G1 X1 A-20.1 F1000
N4 X2 A-20.2
N5 X3 A-20.1
N6 X4 A-20.2
N7 X5 A-20.1
N8 X6 A-20.2
N9 X7 A-20.1
N10 M34
N11 X8 A-20
N12 M30
";

#[test]
fn figure_13_from_program_text() {
    let config = with_thinning(ThinningSettings { group_blocks: 4, ..ThinningSettings::default() });
    assert_eq!(lines(&run(FIGURE_13, &config)), [1, 3, 6, 7, 9, 11]);
    let report = validate(FIGURE_13, &config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    let thinning = report.thinning.expect("it was on");
    let figures = thinning.figures;
    assert_eq!((figures.blocks_read, figures.blocks_dropped, figures.groups, figures.other_blocks), (8, 3, 2, 1));
    let runs: Vec<_> = thinning.dropped.iter().map(|run| (run.first_line, run.last_line, run.kept_line)).collect();
    assert_eq!(runs, [(4, 5, 6), (8, 8, 9)]);
    assert_eq!(thinning.rotary_axes, ['C', 'A']);
    assert_eq!((figures.rotary.reversals_before, figures.rotary.reversals_after), ([0, 5], [0, 1]));
    assert!(thinning.time_after_s < thinning.time_before_s, "{thinning:?}");
    // P of G43.4 is the same switch.
    let by_p = FIGURE_13.replace("M33", "G43.4 P1").replace("M34", "G43.4 P0");
    assert_eq!(run(&by_p, &config), run(FIGURE_13, &config));
    // Without it everything is cut.
    let all = run(&FIGURE_13.replace("N2 M33", "N2").replace("N10 M34", "N10"), &config);
    assert_eq!(lines(&all), [1, 3, 4, 5, 6, 7, 8, 9, 11]);
}

#[test]
fn a_fitted_stream_may_start_in_the_middle_of_a_group() {
    let settings = ThinningSettings { group_blocks: 50, method: ThinningMethod::Fitted, ..ThinningSettings::default() };
    let config = with_thinning(settings);
    let program = freeform::program(3, 60);
    let program = program.as_bytes();
    let whole = run_in_pieces(program, &config, usize::MAX);
    assert_eq!(run_in_pieces(program, &config, 977), whole);
    let taken = snapshots(program, &config);
    assert!(taken.len() > 5, "{}", taken.len());
    for (index, offset, snapshot) in taken.iter().step_by(taken.len() / 5) {
        let (first, rest) = resume(program, &config, *offset, snapshot);
        assert_eq!(first, *index);
        for place in 0..rest.len() {
            assert_eq!(rest.bits(place), whole.bits(first as usize + place), "setpoint {place} from {first}");
        }
        assert_eq!(first as usize + rest.len(), whole.len());
    }
}

#[test]
fn figures_7_and_8_from_program_text() {
    let thinning = ThinningSettings { angle_tolerance_deg: 3.0, ..ThinningSettings::default() };
    let config = with_thinning(thinning);
    let program = |third: &str| {
        format!(
            "G43.4 H1 G0 X0 Y0 Z20 A-20 C0\nM33\nG1 X1 A-20 F1000\nX2 Y.004 A-21\nX3 Y{third} A-22 F500\nX4 Y0 A-29\nM34\nM30\n"
        )
    };
    // The feed of a dropped block is the feed of the next kept one.
    let dropped = run(&program(".006"), &config);
    assert_eq!(lines(&dropped), [1, 3, 6]);
    let feed = dropped.line.iter().zip(&dropped.feed).filter(|(line, _)| **line == 6).map(|(_, feed)| *feed);
    let most = feed.fold(0.0, f64::max);
    assert!((most - 500.0).abs() < 1e-6, "{most}");
    let figures = validate(&program(".006"), &config).thinning.expect("on").figures;
    assert_eq!((figures.feeds_inherited, figures.feeds_lost), (1, 0));
    assert!((figures.position_deviation_mm - 0.006).abs() < 1e-12);
    // Too far off: P3 stays, and P2 goes against P1–P3.
    assert_eq!(lines(&run(&program(".02"), &config)), [1, 3, 5, 6]);
}

#[test]
fn both_forms_of_direction_thin_alike() {
    let config = config();
    let [mut angles, mut vectors] = [String::from("G43.4 H1\n"), String::from("G43.5 H1\n")];
    for (index, tilt) in [-20.0_f64, -20.2, -20.1, -20.3, -20.2, -25.0, -25.1, -25.0].into_iter().enumerate() {
        let (sine, cosine) = libm::sincos(tilt.to_radians());
        let code = if index == 0 { "G0 Y0 Z20 " } else { "G1 F2000 " };
        let words = format!("{code}X{index}");
        angles += &format!("{words} A{tilt} C0\n");
        vectors += &format!("{words} I0 J{:.9} K{cosine:.9}\n", -sine);
        if index == 0 {
            angles += "M33\n";
            vectors += "M33\n";
        }
    }
    let [angles, vectors] = [angles, vectors].map(|program| {
        let program = format!("{program}M34\nG49\nM30\n");
        (lines(&run(&program, &config)), validate(&program, &config))
    });
    assert_eq!(angles.0, vectors.0);
    let [angles, vectors] = [angles.1, vectors.1].map(|report| report.thinning.expect("on").figures);
    assert_eq!(angles.blocks_dropped, vectors.blocks_dropped);
    assert_eq!(angles.rotary.reversals_before, vectors.rotary.reversals_before);
    assert_eq!(angles.rotary.reversals_after, vectors.rotary.reversals_after);
}

#[test]
fn every_setpoint_is_on_its_segment() {
    let mut config = config();
    config.profile.language.work_offsets[0][..3].copy_from_slice(&[30.0, -40.0, 55.0]);
    let program =
        "G43.5 H1 G0 X0 Y0 Z30 I0.3 J-0.3 K1\nG1 X20 Y5 Z20 I-0.1 J-0.5 K1 F3000\nX25 Y-10 I-.4 K.9\nX0\nM30\n";
    let corners = [[0.0, 0.0, 30.0], [20.0, 5.0, 20.0], [25.0, -10.0, 20.0], [0.0, -10.0, 20.0]];
    let setpoints = run(program, &config);
    let poses = poses(&setpoints, &config);
    let mut seen = 0;
    for (pose, &line) in poses.iter().zip(&setpoints.line) {
        let Some(ends) = (line as usize).checked_sub(2).and_then(|first| corners.get(first..first + 2)) else {
            continue;
        };
        let off = distance(pose.tip_mm, ends[0], ends[1]);
        assert!(off < 1e-9, "line {line}: {off:e}");
        seen += 1;
    }
    assert!(seen > 500, "{seen}");
    let last = poses.last().expect("setpoints");
    assert!(norm(sub(last.tip_mm, corners[3])) < 1e-9, "{last:?}");
}

#[test]
fn work_coordinates_are_those_of_the_tool_centre_point_with_its_direction() {
    let mut config = config();
    config.profile.language.work_offsets[0][..3].copy_from_slice(&[30.0, -40.0, 55.0]);
    let program =
        "G43.5 H1 G0 X0 Y0 Z30 I0.3 J-0.3 K1\nG1 X20 Y5 Z20 I-0.1 J-0.5 K1 F3000\nG4 P50\nX25 I-.4 K.9\nM30\n";
    let machine = run(program, &config);
    assert!(machine.tool_direction.is_empty());
    let in_work = PipelineConfig { frame: Frame::Work, ..config.clone() };
    let work = run(program, &in_work);
    // From the first guided block on; the cut, and the rests within it.
    let first = machine.line.iter().position(|&line| line == 2).expect("cut");
    assert!(machine.line[first..].contains(&3));
    for (index, pose) in poses(&machine, &config).iter().enumerate().skip(first) {
        let [tip, direction] = [&work.axes, &work.tool_direction].map(|columns| [0, 1, 2].map(|k| columns[k][index]));
        assert!(norm(sub(tip, pose.tip_mm)) < 1e-9, "{index}: {tip:?} {pose:?}");
        assert!(angle(direction, pose.direction) < 1e-12, "{index}: {direction:?} {pose:?}");
        for rotary in [3, 4] {
            assert_eq!(work.axes[rotary][index], machine.axes[rotary][index]);
        }
    }
    // A stream in work coordinates starts from a checkpoint of the machine's.
    for (_, offset, snapshot) in snapshots(program.as_bytes(), &config).iter().step_by(2) {
        let (first, rest) = resume(program.as_bytes(), &in_work, *offset, snapshot);
        for place in 0..rest.len() {
            assert_eq!(rest.bits(place), work.bits(first as usize + place), "setpoint {place} from {first}");
        }
    }
}

#[test]
fn the_tool_control_comes_and_goes_without_motion() {
    let config = config();
    // With A and C turned, the place of the tool is not where the axes are. Switching moves nothing; an axis that is not named
    // stays where it is.
    let program = "G0 X10 Y20 Z300 A-30 C40\nG43.4 H1\nG4 P10\nG49\nG4 P10\nG0 Z310\nM30\n";
    let setpoints = run(program, &config);
    let last = setpoints.len() - 1;
    let end: Vec<f64> = setpoints.axes.iter().map(|column| column[last]).collect();
    assert_eq!(end, [10.0, 20.0, 310.0, -30.0, 40.0]);
    // Under control, Z alone moves the tool along Z of the work: X and Y of the tool stay.
    let program = "G0 X10 Y20 Z300 A-30 C40\nG43.4 H1\nG1 Z30 F1000\nM30\n";
    let setpoints = run(program, &config);
    let poses = poses(&setpoints, &config);
    let started = setpoints.line.iter().position(|&line| line == 3).expect("cut");
    let (first, last) = (poses[started], poses[poses.len() - 1]);
    assert!(first.tip_mm[2] > 80.0, "{first:?}");
    assert!((first.tip_mm[0] - last.tip_mm[0]).abs() < 1e-9 && (first.tip_mm[1] - last.tip_mm[1]).abs() < 1e-9);
    assert!((last.tip_mm[2] - 30.0).abs() < 1e-9, "{last:?}");
    // And back: G28 of Z alone after G49.
    let program = "G43.4 H1 G0 X1 Y2 Z30 A-30 C40\nG4 P10\nG49\nG91 G28 Z0\nM30\n";
    let setpoints = run(program, &config);
    let before = setpoints.line.iter().rposition(|&line| line == 2).expect("a rest");
    for (axis, column) in setpoints.axes.iter().enumerate() {
        let expected = if axis == 2 { 0.0 } else { column[before] };
        assert!((column[setpoints.len() - 1] - expected).abs() < 1e-9, "{axis}");
    }
}

#[test]
fn a_stream_may_start_in_the_middle_of_a_group() {
    let config = with_thinning(ThinningSettings { group_blocks: 50, ..ThinningSettings::default() });
    let program = freeform::program(3, 60);
    let program = program.as_bytes();
    let whole = run_in_pieces(program, &config, usize::MAX);
    for piece in [1_usize, 977] {
        assert_eq!(run_in_pieces(program, &config, piece.max(64)), whole, "{piece}");
    }
    let taken = snapshots(program, &config);
    assert!(taken.len() > 5, "{}", taken.len());
    for (index, offset, snapshot) in taken.iter().step_by(taken.len() / 5) {
        let (first, rest) = resume(program, &config, *offset, snapshot);
        assert_eq!(first, *index);
        for place in 0..rest.len() {
            assert_eq!(rest.bits(place), whole.bits(first as usize + place), "setpoint {place} from {first}");
        }
        assert_eq!(first as usize + rest.len(), whole.len());
    }
}

#[test]
fn leaving_a_pole_the_rotary_axes_take_the_preferred_solution_in_range() {
    let last = |config: &PipelineConfig, program: &str| {
        let setpoints = run(program, config);
        [3, 4].map(|column: usize| setpoints.axes[column][setpoints.len() - 1])
    };
    // The tool tilts towards −Y: A45 C0 is nearest, but A reaches 30 degrees only.
    let program = "G43.5 H1 G0 X0 Y0 Z50 I0 J-1 K1\nM30\n";
    let [a, c] = last(&config(), program);
    assert!((a + 45.0).abs() < 1e-9 && (c.abs() - 180.0).abs() < 1e-9, "{a} {c}");
    // With both in range the profile says which.
    let program = "G43.5 H1 G0 X0 Y0 Z50 I0 J-.2 K1\nM30\n";
    for (preferred, sign) in [(BranchPreference::Larger, 1.0), (BranchPreference::Smaller, -1.0)] {
        let mut config = config();
        config.profile.kinematics.as_mut().expect("five axes").preferred_branch = preferred;
        let [a, _] = last(&config, program);
        assert!((a - sign * 0.2_f64.atan().to_degrees()).abs() < 1e-9, "{a}");
    }
}

#[test]
fn an_axis_that_rolls_over_turns_as_far_as_an_incremental_word_says() {
    let mut rolling = config();
    let chain = &mut rolling.profile.kinematics.as_mut().expect("five axes").chain;
    chain[0].wrap = Wrap::Rollover;
    assert_eq!(rolling.profile.problems(), []);
    let c = |config: &PipelineConfig, words: &str| {
        let program = format!("G43.4 H1\nG1 X0 Y0 Z50 A0 C0 F1000\n{words}\nM30\n");
        let setpoints = run(&program, config);
        setpoints.axes[4][setpoints.len() - 1]
    };
    for (words, turned, counted) in [
        ("G91 C360", 360.0, 360.0),
        ("G91 X1 C270", 270.0, 270.0),
        ("G91 C-540\nC30", -510.0, -510.0),
        ("G91 C350\nG90 C10", 370.0, 10.0),
        // The program counts 10 degrees where the axis is at 370.
        ("C170\nC340\nC10\nG91 C200", 570.0, 210.0),
        ("C190", -170.0, 190.0),
        ("M33\nG91 X1 C200\nX.1 C0\nX.1 C200\nX1 C200\nM34", 600.0, 600.0),
    ] {
        assert!((c(&rolling, words) - turned).abs() < 1e-9, "{words}: {}", c(&rolling, words));
        assert_eq!(c(&config(), words), counted, "{words}");
    }
    // Half a turn is as far in either direction.
    let report = validate("G43.4 H1\nG1 X0 Y0 Z50 A0 C10 F1000\nC190\nM30\n", &rolling);
    let found: Vec<_> = report.findings.iter().map(|finding| (finding.code.name(), finding.span.line)).collect();
    assert_eq!(found, [("FIVE-AXIS-OPPOSITE", 3)]);
}
