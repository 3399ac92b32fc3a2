//! The inverse solution that a cut starts with: chosen by looking ahead to its end, so that it never flips inside.

use std::fmt::Write;

use feedwave_cutting::PipelineConfig;
use feedwave_program::{Finding, Severity};
use proptest::prelude::*;

use super::machine::config;
use crate::common::{Setpoints, resume, run, run_in_pieces, snapshots, validate};

/// The trunnion (A −120° to 30°) with this range of C.
fn limited(c_deg: [f64; 2]) -> PipelineConfig {
    let mut config = config();
    let kinematics = config.profile.kinematics.as_mut().expect("five axes");
    kinematics.chain[0].range = Some(c_deg);
    config
}

/// The direction that A = −`tilt` and C = `turn` degrees give.
fn words(tilt: f64, turn: f64) -> String {
    let (tilt, turn) = (tilt.to_radians(), turn.to_radians());
    let (i, j, k) = (-tilt.sin() * turn.sin(), tilt.sin() * turn.cos(), tilt.cos());
    format!("I{i:.12} J{j:.12} K{k:.12}")
}

/// A rapid to the first of the tilts and turns, then a cut through the others.
fn cut(poses: &[[f64; 2]], first_line: &str) -> String {
    let mut text = format!("{first_line}\n");
    for (index, [tilt, turn]) in poses.iter().enumerate() {
        let code = if index == 0 { "G0 Y0 Z50" } else { "G1 F2000" };
        let _ = writeln!(text, "{code} X{} {}", 2 * index, words(*tilt, *turn));
    }
    text + "G0 Z90\nG49\nM30\n"
}

/// A and C at the last setpoint of a line.
fn at_end_of(setpoints: &Setpoints, line: u32) -> [f64; 2] {
    let last = setpoints.line.iter().rposition(|&own| own == line).expect("a setpoint of the line");
    [3, 4].map(|column: usize| setpoints.axes[column][last])
}

fn sweep(tilt: f64, turns: impl Iterator<Item = i32>) -> Vec<[f64; 2]> {
    turns.map(|turn| [tilt, f64::from(turn)]).collect()
}

#[test]
fn a_cut_that_would_run_out_of_turns_starts_a_turn_back() {
    // The last setpoint of a line lies up to a period before its end.
    let config = PipelineConfig { interpolation_period_us: 250, ..limited([-220.0, 220.0]) };
    // C is at 140 and the cut continues from 150 to 300: only from −210 on does it stay in range.
    let cut = cut(&sweep(40.0, (150..=300).step_by(10)), &format!("G43.5 H1 G0 X0 Y0 Z80 {}", words(40.0, 140.0)));
    let report = validate(&cut, &config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    let found = report.findings.iter().find(|finding| finding.code == "FIVE-AXIS-SOLUTION").expect("it is said");
    assert_eq!(found.span.line, 2);
    let value = |name: &str| found.values.iter().find(|value| value.name == name).expect(name).value;
    assert!((value("other_line") - 10.0).abs() < 1e-9 && (value("other_range_max") - 220.0).abs() < 1e-9, "{found:?}");
    // Somewhere from 220 to 230.
    assert!((220.0..=230.0).contains(&value("other_angle")), "{found:?}");
    let setpoints = run(&cut, &config);
    for (line, [a, c]) in [(1, [-40.0, 140.0]), (2, [-40.0, -210.0]), (3, [-40.0, -200.0]), (17, [-40.0, -60.0])] {
        let [at_a, at_c] = at_end_of(&setpoints, line);
        assert!((at_a - a).abs() < 1e-3 && (at_c - c).abs() < 1e-3, "line {line}: {at_a} {at_c}");
    }
    // With range enough the nearest solution is taken, without a finding.
    let free = limited([-220.0, 320.0]);
    assert!((at_end_of(&run(&cut, &free), 2)[1] - 150.0).abs() < 1e-3);
    assert!(validate(&cut, &free).findings.iter().all(|finding| finding.code != "FIVE-AXIS-SOLUTION"));
}

#[test]
fn a_cut_that_would_run_out_of_tilt_starts_in_the_other_solution() {
    // A +20 is nearest to where the axes are, but it ends at 30; from the pole, and from a rapid in that solution.
    let config = limited([-400.0, 400.0]);
    let mut poses = sweep(20.0, (180..=180).step_by(1));
    poses.extend((2..=9).map(|tenth| [10.0 * f64::from(tenth), 180.0]));
    for start in ["G0 A5 C0\nG43.5 H1", "G43.5 H1 G0 X0 Y0 Z80 I0 J0 K1"] {
        let text = cut(&poses, start);
        let report = validate(&text, &config);
        assert!(report.is_accepted(), "{:#?}", report.findings);
        let first = 1 + start.lines().count() as u32;
        let [a, c] = at_end_of(&run(&text, &config), first);
        assert!((a + 20.0).abs() < 1e-3 && (c.abs() - 180.0).abs() < 1e-3, "{start}: {a} {c}");
    }
}

#[test]
fn a_cut_that_leaves_a_pole_looks_ahead_too() {
    // The cut itself tilts the tool out of the pole: C turns at rest before, to where the whole cut can be made.
    let config = limited([-220.0, 220.0]);
    let mut poses = vec![[0.0, 0.0]];
    poses.extend(sweep(20.0, (150..=300).step_by(10)));
    for thinning in ["", "M33\n"] {
        let start = format!("G43.5 H1\n{thinning}");
        let text = cut(&poses, start.trim_end());
        let report = validate(&text, &config);
        assert!(report.is_accepted(), "{:#?}", report.findings);
        let setpoints = run(&text, &config);
        let last = *setpoints.line.iter().filter(|&&line| line > 15 && line < 20).max().expect("cut");
        let [a, c] = at_end_of(&setpoints, last);
        // Either solution stays in range: A −20 from C −210, or A 20 from C −30.
        assert!((a.abs() - 20.0).abs() < 1e-3 && (-220.0..220.0).contains(&c), "{a} {c}");
    }
}

#[test]
fn a_cut_that_neither_solution_can_follow_is_refused_with_both() {
    let config = limited([-200.0, 200.0]);
    let text = cut(&sweep(20.0, (0..=420).step_by(10)), "G43.5 H1");
    let report = validate(&text, &config);
    assert!(!report.is_accepted());
    assert_eq!(report.summary.errors, 1, "{:#?}", report.findings);
    let is_error = |finding: &&Finding| finding.severity == Severity::Error;
    let finding = report.findings.iter().find(is_error).expect("one");
    let value = |name: &str| finding.values.iter().find(|value| value.name == name).expect(name).value;
    assert_eq!(finding.code, "FIVE-AXIS-RANGE");
    // The first direction is C 0 with A −20, which gets 200 degrees far, or C −180 with A 20, which gets 380.
    assert_eq!((finding.span.line, value("cut_line")), (41, 2.0), "{finding:#?}");
    assert!((value("angle") - 210.0).abs() < 1e-6 && (value("range_max") - 200.0).abs() < 1e-9);
    assert_eq!(value("other_line"), 23.0);
    assert!((200.0..=210.0).contains(&value("other_angle")));
    // Before anything moves.
    assert_eq!(report.summary.setpoint_count, 0);
}

#[test]
fn a_preferred_solution_is_given_up_where_it_does_not_reach_the_end() {
    use feedwave_motion::kinematics::BranchPreference;
    let mut config = limited([-400.0, 400.0]);
    config.profile.kinematics.as_mut().expect("five axes").preferred_branch = BranchPreference::Larger;
    let short = cut(&sweep(20.0, (10..=60).step_by(10)), "G43.5 H1");
    let [a, c] = at_end_of(&run(&short, &config), 2);
    assert!((a - 20.0).abs() < 1e-3, "{a} {c}");
    let mut poses = sweep(20.0, (10..=60).step_by(10));
    poses.push([50.0, 60.0]);
    let steep = cut(&poses, "G43.5 H1");
    assert!((at_end_of(&run(&steep, &config), 2)[0] + 20.0).abs() < 1e-3);
}

#[test]
fn a_stream_from_the_middle_takes_the_same_solutions() {
    let config = limited([-220.0, 220.0]);
    let mut text = String::from("G43.5 H1\n");
    for pass in 0..4 {
        let from = [150, -40, 60, -160][pass];
        for (index, turn) in (from..=from + 200).step_by(20).enumerate() {
            let code = if index == 0 { "G0 Z60\nG0" } else { "G1 Z40 F3000" };
            let _ = writeln!(text, "{code} X{} Y{} {}", 2 * index, 5 * pass, words(25.0, f64::from(turn)));
        }
    }
    text += "G49\nM30\n";
    assert!(validate(&text, &config).is_accepted());
    let whole = run(&text, &config);
    for piece in [1, 100] {
        assert_eq!(run_in_pieces(text.as_bytes(), &config, piece), whole, "pieces of {piece}");
    }
    let taken = snapshots(text.as_bytes(), &config);
    assert!(taken.len() > 4);
    for (_, offset, snapshot) in &taken {
        let (first, rest) = resume(text.as_bytes(), &config, *offset, snapshot);
        for place in 0..rest.len() {
            assert_eq!(rest.bits(place), whole.bits(first as usize + place), "setpoint {place} from {first}");
        }
    }
}

/// Whether C can follow the turns of a cut with A on one side, by trying every start in small steps. Great circles between
/// close directions turn evenly enough.
fn is_possible(poses: &[[f64; 2]], c_deg: [f64; 2]) -> bool {
    let turns = || poses.iter().map(|[_, turn]| *turn);
    let (least, most) = (turns().fold(f64::INFINITY, f64::min), turns().fold(f64::NEG_INFINITY, f64::max));
    let steepest = poses.iter().map(|[tilt, _]| *tilt).fold(0.0, f64::max);
    let fits = |shift: f64| {
        (-4..=4).any(|k| {
            let shift = shift + 360.0 * f64::from(k);
            least + shift >= c_deg[0] && most + shift <= c_deg[1]
        })
    };
    fits(0.0) || steepest <= 30.0 && fits(180.0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// What can be cut is accepted, what cannot is refused, and A keeps its side through every cut.
    #[test]
    fn a_cut_never_flips(
        cuts in prop::collection::vec(
            (
                6.0..45.0_f64,
                -180.0..180.0_f64,
                prop::collection::vec((-4.0..4.0_f64, -12.0..25.0_f64), 1..25),
            ),
            1..4,
        ),
        low in -400.0..-60.0_f64,
        high in 60.0..400.0_f64,
    ) {
        let c_deg = [low, high];
        let config = limited(c_deg);
        let mut text = String::from("G43.5 H1\n");
        let mut possible = Some(true);
        let mut ends = Vec::new();
        for (tilt, turn, steps) in &cuts {
            let mut poses = vec![[*tilt, *turn]];
            for (tilts, turns) in steps {
                let [tilt, turn] = poses[poses.len() - 1];
                poses.push([(tilt + tilts).clamp(5.0, 80.0), turn + turns]);
            }
            let sure = |margin: f64| is_possible(&poses, [c_deg[0] + margin, c_deg[1] - margin]);
            // At the very edge of a range the test is not the judge.
            possible = match (sure(0.01), sure(-0.01)) {
                (true, _) => possible,
                (false, true) => None,
                (false, false) => possible.map(|_| false),
            };
            for (index, [tilt, turn]) in poses.iter().enumerate() {
                let code = if index == 0 { "G0 Z60" } else { "G1 Z40 F3000" };
                let _ = writeln!(text, "{code} X{} {}", 2 * index, words(*tilt, *turn));
            }
            ends.push(text.lines().count() as u32);
        }
        text += "G49\nM30\n";
        let report = validate(&text, &config);
        if let Some(possible) = possible {
            prop_assert_eq!(report.is_accepted(), possible, "{:?} {:#?}", text, report.findings);
        }
        if !report.is_accepted() {
            let is_error = |finding: &&Finding| finding.severity == Severity::Error;
            prop_assert!(report.findings.iter().filter(is_error).all(|finding| finding.code == "FIVE-AXIS-RANGE"));
            return Ok(());
        }
        let setpoints = run(&text, &config);
        let mut first_line = 3;
        for end in ends {
            let sides: Vec<f64> = (0..setpoints.len())
                .filter(|&k| (first_line..=end).contains(&setpoints.line[k]))
                .map(|k| setpoints.axes[3][k].signum())
                .collect();
            prop_assert!(sides.windows(2).all(|pair| pair[0] == pair[1]), "{first_line} to {end}");
            first_line = end + 2;
        }
        for &c in &setpoints.axes[4] {
            prop_assert!(c >= c_deg[0] - 1e-6 && c <= c_deg[1] + 1e-6, "{c}");
        }
    }
}
