//! Path control: `G61`, `G61.1`, `G64`, `G9`.

use super::*;
use crate::{DecimalPointRule, PathControl, PathControlMode};

const EXACT_PATH: PathControl = PathControl::ExactPath;
const EXACT_STOP: PathControl = PathControl::ExactStop;

fn continuous(tolerance_mm: f64, merge_tolerance_mm: f64) -> PathControl {
    PathControl::Continuous { tolerance_mm, merge_tolerance_mm }
}

/// The path control of every move of a program that has no findings.
#[track_caller]
fn controls(settings: &LanguageSettings, program: &str) -> Vec<PathControl> {
    let (operations, findings) = interpret(format!("{program}\nM30").as_bytes(), settings.clone());
    assert!(findings.findings().is_empty(), "{findings:?}");
    let control = |operation: &Operation| match &operation.kind {
        OperationKind::Move(step) => Some(step.path_control),
        _ => None,
    };
    operations.iter().filter_map(control).collect()
}

#[test]
fn modes_last_and_g9_does_not() {
    let program = "G0 X1\nG61.1 X2\nX3\nG61 X4\nG9 X5\nX6\nG64 P.02 Q.01 X7\nG9 X8\nX9\nG64 X10\nG64 P.5 X11\nX12";
    let expected = [
        EXACT_PATH,
        EXACT_STOP,
        EXACT_STOP,
        EXACT_STOP,
        EXACT_STOP,
        EXACT_STOP,
        continuous(0.02, 0.01),
        EXACT_STOP,
        continuous(0.02, 0.01),
        continuous(0.01, 0.01),
        continuous(0.5, 0.5),
        continuous(0.5, 0.5),
    ];
    assert_eq!(controls(&mill(), program), expected);
    assert_eq!(controls(&lathe(), program), expected);
    // The exact path is LinuxCNC's.
    assert_eq!(controls(&linuxcnc(), "G61.1 G0 X1\nG61 X2\nX3"), [EXACT_STOP, EXACT_PATH, EXACT_PATH]);
}

#[test]
fn every_kind_of_motion_has_it() {
    let program = "F100 G64 P0 G1 X1\nG3 X3 I1\nG28 X0\nG5 X5 Y5 I1 J1 P1 Q1\nG9 G5.2\nX6 Y6\nX7 Y9\nG5.3";
    let none = continuous(0.0, 0.0);
    assert_eq!(controls(&mill(), program), [none, none, none, none, EXACT_STOP]);
}

#[test]
fn tolerances_are_lengths_of_the_program() {
    assert_eq!(controls(&mill(), "G20 G64 P.001 Q.0005\nG0 X1"), [continuous(0.0254, 0.0127)]);
    let settings = LanguageSettings { decimal_point: DecimalPointRule::LeastIncrement, ..mill() };
    assert_eq!(controls(&settings, "G64 P20 Q0\nG0 X1"), [continuous(0.02, 0.0)]);
    assert_eq!(controls(&mill(), "G64 P10\nG0 X1"), [continuous(10.0, 10.0)]);
}

#[test]
fn the_profile_says_what_holds_at_first() {
    for (mode, expected) in [
        (PathControlMode::ExactPath, EXACT_PATH),
        (PathControlMode::ExactStop, EXACT_STOP),
        (PathControlMode::Continuous, continuous(0.03, 0.03)),
    ] {
        let settings = LanguageSettings { initial_path_control: mode, default_path_tolerance_mm: 0.03, ..mill() };
        assert_eq!(controls(&settings, "G0 X1\nG64 X2"), [expected, continuous(0.03, 0.03)]);
    }
}

#[test]
fn g64_of_linuxcnc() {
    // Checked with rs274: P0 is G64 alone, unlimited, for which the profile has a tolerance; Q alone keeps its value.
    assert_eq!(
        controls(&linuxcnc(), "G64 P0\nG0 X1\nG64 Q.002\nX2"),
        [continuous(0.01, 0.01), continuous(0.01, 0.002)]
    );
    check(&linuxcnc(), "G64 P.1 Q.5\nG0 X1", "rapid 0 -> X1\nw 1:9+3 PRG-PATH-TOLERANCE");
}

#[test]
fn tolerances_that_cannot_be() {
    check(
        &mill(),
        "G64 P-1\nG64 P10.001\nG64 Q.01\nG64 P.01 Q.02\nG64 P.01 Q-.01\nG0 X1",
        "rapid 0 -> X1
         ! 1:5+3 PRG-PATH-TOLERANCE
         ! 2:5+7 PRG-PATH-TOLERANCE
         w 4:10+4 PRG-PATH-TOLERANCE
         ! 5:10+5 PRG-PATH-TOLERANCE",
    );
    let (_, findings) = interpret(b"G64 P.01 Q.02\nM30", mill());
    let [finding] = findings.findings() else { panic!("{findings:?}") };
    assert_eq!(finding.suggestions[0].replacement.as_deref(), Some("Q0.01"));
    // The cure is in the unit of the program, for the letter that is wrong.
    let cure = |program: &str| {
        let (_, findings) = interpret(program.as_bytes(), mill());
        findings.findings()[0].suggestions[0].message.clone()
    };
    for (program, usual) in
        [("G64 P11\nM30", "P0.01"), ("G20\nG64 P1\nM30", "P0.0004"), ("G20\nG64 P.1 Q1\nM30", "Q0.0004")]
    {
        assert!(cure(program).ends_with(usual), "{program}: {}", cure(program));
    }
    // P and Q belong to G64 alone, and only one code of the group fits a block.
    check(
        &mill(),
        "G61 P.01\nG61.1 Q.01\nG9 P1",
        "! 1:5+4 PRG-WORD-UNUSED\n! 2:7+4 PRG-WORD-UNUSED\n! 3:4+2 PRG-WORD-UNUSED",
    );
    check(&mill(), "G61 G64", "! 1:5+3 PRG-GROUP-CONFLICT");
}
