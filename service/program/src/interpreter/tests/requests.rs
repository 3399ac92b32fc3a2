//! Requests of path control and probing: section 9 of the page on the program language.

use super::*;
use crate::PathControl;

/// The tolerance of every move of a program, mm; nothing where it is exact.
#[track_caller]
fn tolerances(settings: &LanguageSettings, program: &str) -> Vec<Option<f64>> {
    let (operations, findings) = interpret(format!("{program}\nM30").as_bytes(), settings.clone());
    assert!(findings.findings().iter().all(|finding| finding.severity != Severity::Error), "{findings:?}");
    let control = |operation: &Operation| match &operation.kind {
        OperationKind::Move(step) => Some(match step.path_control {
            PathControl::Continuous { tolerance_mm, .. } => Some(tolerance_mm),
            PathControl::ExactPath | PathControl::ExactStop => None,
        }),
        _ => None,
    };
    operations.iter().filter_map(control).collect()
}

#[test]
fn contour_control_has_the_tolerance_of_its_level() {
    for settings in [mill(), lathe()] {
        let program = "G0 X1\nG5.1 Q1\nX2\nG5.1 Q1 R1\nX3\nG5.1 Q1 R10\nX4\nG5.1 Q0\nX5\nG5 P10000\nX6\nG5 P0\nX7\nG8 P1\nX8\nG8 P0\nX9";
        let expected = [None, Some(0.01), Some(0.05), Some(0.002), None, Some(0.01), None, Some(0.01), None];
        assert_eq!(tolerances(&settings, program), expected);
        let program = "G61\nG187 P1\nG0 X1\nG187 P2\nX2\nG187 P3\nX3\nG187 E.15\nX4\nG187\nX5";
        let expected = [Some(0.05), Some(0.01), Some(0.002), Some(0.15), None];
        assert_eq!(tolerances(&settings, program), expected);
    }
    assert_eq!(tolerances(&mill(), "G20 G187 E.01\nG0 X1"), [Some(0.254)]);
    let settings = LanguageSettings { contour_tolerances_mm: [0.5; 10], ..mill() };
    assert_eq!(tolerances(&settings, "G5.1 Q1 R3\nG0 X1"), [Some(0.5)]);
}

#[test]
fn words_that_a_request_does_not_know() {
    for (program, place) in [
        ("G5.1 Q2", "1:1+4"),
        ("G5.1 Q1 R11", "1:9+3"),
        ("G5.1 Q1 R1.5", "1:9+4"),
        ("G5 P5", "1:1+2"),
        ("G8 P2", "1:1+2"),
        ("G8", "1:1+2"),
        ("G187 P4", "1:1+4"),
    ] {
        check(&mill(), program, &format!("! {place} PRG-PATH-REQUEST"));
    }
    check(&mill(), "G187 E11", "! 1:6+3 PRG-PATH-TOLERANCE");
    check(&mill(), "G187 P1 X1", "! 1:9+2 PRG-WORD-UNUSED");
    check(&mill(), "G0 E1 X1", "! 1:4+2 PRG-WORD-UNKNOWN");
    // The spline of LinuxCNC is another thing.
    check(&linuxcnc(), "F100 G5.1 Q1", "! 1:1+12 PRG-SPLINE-POINT-MISSING\n! 1:11+2 PRG-WORD-UNUSED");
}

#[test]
fn modes_of_group_13() {
    // FANUC: the exact stop check; G62 and G63 end it.
    let stops = |settings: &LanguageSettings, program: &str| {
        let (operations, _) = interpret(program.as_bytes(), settings.clone());
        let stops = |operation: &Operation| matches!(&operation.kind, OperationKind::Move(step) if step.path_control == PathControl::ExactStop);
        operations
            .iter()
            .filter(|operation| matches!(operation.kind, OperationKind::Move(_)))
            .map(stops)
            .collect::<Vec<_>>()
    };
    assert_eq!(
        stops(&mill(), "G61 G0 X1\nX2\nG62 X3\nG61 X4\nG63 X5\nG64 X6"),
        [true, true, false, true, false, false]
    );
    assert_eq!(stops(&linuxcnc(), "G61 G0 X1\nG61.1 X2"), [false, true]);
    check(&mill(), "G62\nG63", "i 1:1+3 PRG-PATH-REQUEST\ni 2:1+3 PRG-PATH-REQUEST");
}

#[test]
fn a_probing_move_is_its_full_travel() {
    check(&mill(), "G31 Z-10 F100\nG0 Z0", "line 0 -> Z-10 @100/min\nrapid Z-10 -> 0\nw 1:1+13 PRG-PROBE");
    // G31 holds for its block, G38.2 until the next motion code.
    check(&mill(), "G0 X1\nG31 X2 F50\nX3", "rapid 0 -> X1\nline X1 -> X2 @50/min\nrapid X2 -> X3\nw 2:1+10 PRG-PROBE");
    check(
        &linuxcnc(),
        "G38.2 Z-10 F100\nZ-12\nG38.5 Z0\nG91 Z1",
        "line 0 -> Z-10 @100/min\nline Z-10 -> Z-12 @100/min\nline Z-12 -> 0 @100/min\nline 0 -> Z1 @100/min\n\
         w 1:1+15 PRG-PROBE\nw 2:1+4 PRG-PROBE\nw 3:1+8 PRG-PROBE\nw 4:1+6 PRG-PROBE",
    );
    check(&mill(), "G37 Z-10 F100", "line 0 -> Z-10 @100/min\nw 1:1+13 PRG-PROBE");
    check(&lathe(), "M3 S100\nG36 X-10 F.1", "spindle cw 100\nline 0 -> X-5 @0.1/rev\nw 2:1+12 PRG-PROBE");
    for program in ["G38.2 X0 F100", "G38.2 A5 F100", "G93 G38.2 X5 F100", "G95 M3 S100 G38.2 X5 F0.1", "G38.2"] {
        check(&linuxcnc(), program, &format!("! 1:1+{} PRG-PROBE", program.len()));
    }
    // The feed of a later one moves nothing, and R is whether the move accelerates.
    check(&mill(), "G31 F10\nG31 Z-5 R1.", "line 0 -> Z-5 @10/min\nw 2:1+11 PRG-PROBE");
    check(&mill(), "G31 Z-5 R2. F10", "w 1:1+15 PRG-PROBE\n! 1:9+3 PRG-WORD-UNUSED");
    check(&linuxcnc(), "G38.2 X5", "! 1:1+8 PRG-FEED-MISSING");
    for program in ["G38.4 X0 F100", "G31 X0 F100"] {
        check(
            &if program.starts_with("G31") { mill() } else { linuxcnc() },
            program,
            &format!("! 1:1+{} PRG-PROBE", program.len()),
        );
    }
    // Without alarm it needs no travel, and its result is the present place.
    check(
        &linuxcnc(),
        "G0 X3 A5\nG38.3 X3 A5 F100\nG38.5 X3\nX4\nG0 Y#5061",
        "rapid 0 -> X3 A5
         line X3 A5 -> X4 A5 @100/min
         rapid X4 A5 -> X4 Y4 A5
         w 4:1+2 PRG-PROBE
         w 5:5+5 PRG-PARAMETER-PROBED",
    );
}

/// A job that brings what the probe finds has a program that asks for it carried out.
#[test]
fn results_of_probes_come_with_the_job() {
    let program = "G38.3 X0 F100\nO1 if [#5070 EQ 1]\nG0 X#5061\nO1 endif";
    check(&linuxcnc(), program, "! 2:8+5 PRG-PARAMETER-UNAVAILABLE");
    let mut settings = linuxcnc();
    settings.parameters.numbered = [(5_070, 1.0), (5_061, 7.5)].into();
    check(&settings, program, "rapid 0 -> X7.5");
}
