//! `G70` to `G72.2` of LinuxCNC, whose numbers are those of its interpreter, version 2.9.

use super::*;

/// The contour of the first worked example.
const CONTOUR: &str = "G18 G7 F100 M3 S100\no100 sub\nG0 X20\nG1 Z-10\nX30 Z-15\nZ-30\nX50\no100 endsub\nG0 X50 Z2\n";

/// The cuts of a program.
fn cuts(program: &str) -> Vec<String> {
    let found = path(&g7(), program);
    found.lines().filter(|line| !line.starts_with('r')).map(str::to_owned).collect()
}

#[test]
fn the_worked_example() {
    assert_eq!(
        cuts(&format!("{CONTOUR}G71 Q100 I2 R1 D0.5\nG70 Q100")),
        [
            "f 50 -29.5",
            "f 46 -29.5",
            "f 42 -29.5",
            "f 38 -29.5",
            "f 34 -29.5",
            "f 30 -14.292893",
            "f 26 -12.292893",
            "f 22 -10.292893",
            "f 21 -9.792893",
            "f 30.707107 -14.646447",
            "a+ 31 -15",
            "f 31 -29.5",
            "f 50 -29.5",
            "f 20 -10",
            "f 30 -15",
            "f 30 -30",
            "f 50 -30",
        ]
    );
}

/// Pockets with arcs, all three ways; facing; finishing at a distance; a bore.
#[test]
fn every_move_is_that_of_the_reference() {
    compare(include_str!("linuxcnc-contours.ngc"), include_str!("linuxcnc-moves.txt"));
}

/// Two dozen contours at random.
#[test]
fn every_move_of_random_contours_is_that_of_the_reference() {
    compare(include_str!("linuxcnc-random.ngc"), include_str!("linuxcnc-random-moves.txt"));
}

/// A cycle that starts in its contour or where it begins is refused; so is a contour that cuts nothing.
#[test]
fn starts_that_lead_into_the_contour_are_refused() {
    let refusal = |contour: &str, rest: &str| {
        let program = format!("G18 G8 G94 F100\no100 sub\n{contour}\no100 endsub\n{rest}\nM2");
        let findings = interpret(program.as_bytes(), linuxcnc()).1;
        let errors: Vec<_> = findings.findings().iter().map(|finding| finding.message.clone()).collect();
        errors.join("; ")
    };
    let taper = "G0 X20 Z0\nG1 X10 Z-10\nX25 Z-30";
    let begins =
        "the cycle starts where its contour begins, so that the first piece of the contour would be the dive to it";
    // The first line of the contour would be passed rapidly.
    assert_eq!(refusal(taper, "G0 X20 Z0\nG70 Q100"), begins);
    assert_eq!(refusal(taper, "G0 X20 Z0\nG71 Q100"), begins);
    assert_eq!(refusal(taper, "G0 X30 Z2\nG71 Q100"), "");
    assert_eq!(refusal("G0 X10 Z0\nZ-10\nX25 Z-30", "G0 X10 Z0\nG71 Q100"), "");
    // Where the tool is, the part is: from there the dive goes below the contour.
    let inside = "G1 X40.102 Z-10.372\nZ-8.45703\nG3 X46.83253 Z-2.05715 I6.730526 K-0.339184\n\
                  G3 X53.38207 Z-8.60669 I0 K-6.549538\nG1 X61.28828\nZ-4.14568\nX68.84405 Z-5.88817\n\
                  G2 X85.97699 Z-5.88817 I8.566471 K0";
    let cuts = "from where the cycle starts, a move of it cuts 8.301 mm into its contour";
    assert_eq!(refusal(inside, "G0 X39.6573325 Z-10.35828\nG72 Q100 I2.425852 R0.437944 D1.101206"), cuts);
    let nothing = "the contour has no move behind the one to it, so that the cycle would cut nothing";
    assert_eq!(refusal("G0 X10 Z0", "G0 X20 Z5\nG71 Q100"), nothing);
}

/// Each move names the line that it follows.
#[test]
fn moves_name_the_lines_of_the_contour() {
    let program =
        "G18 G8 G94 F100\no100 sub\nG0 X10 Z0\nG1 X12 Z-10\nG2 X15 Z-13 R3\no100 endsub\nG0 X20 Z5\nG70 Q100\nM2";
    let (operations, findings) = interpret(program.as_bytes(), linuxcnc());
    assert!(findings.findings().is_empty(), "{findings:?}");
    let lines = operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Move(step) if step.kind == MoveKind::Cutting => Some(operation.span.line),
        _ => None,
    });
    let lines: Vec<_> = lines.collect();
    assert_eq!(lines, [4, 5]);
}

/// Compares the moves of a program, as radius and Z with four decimals, with those that the reference printed.
#[track_caller]
fn compare(program: &str, expected: &str) {
    let (operations, findings) = interpret(program.as_bytes(), linuxcnc());
    assert!(findings.findings().is_empty(), "{findings:?}");
    let four = |value: f64| {
        let text = format!("{value:.4}");
        let text = text.trim_end_matches('0').trim_end_matches('.');
        if text == "-0" { "0".to_owned() } else { text.to_owned() }
    };
    let moves = operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Move(step) => {
            let kind = match (step.kind, step.arc) {
                (MoveKind::Rapid, _) => "r",
                (_, None) => "f",
                (_, Some(arc)) if arc.clockwise => "a-",
                _ => "a+",
            };
            let is_still = four(step.start[0]) == four(step.end[0]) && four(step.start[2]) == four(step.end[2]);
            (!is_still).then(|| format!("{kind} {} {}", four(step.end[0]), four(step.end[2])))
        }
        _ => None,
    });
    let moves: Vec<_> = moves.collect();
    let expected: Vec<_> = expected.lines().collect();
    for (place, (found, expected)) in moves.iter().zip(&expected).enumerate() {
        assert_eq!(
            found,
            expected,
            "move {place} of {}: {:#?}",
            moves.len(),
            &moves[place.saturating_sub(5)..(place + 5).min(moves.len())]
        );
    }
    assert_eq!(moves.len(), expected.len());
}

/// The second worked example of threads: radius, and Z of start and end of each pass.
#[test]
fn the_worked_thread() {
    let program = "G18 G8 G97 M3 S100\nG0 X12 Z5\nG76 P1.5 Z-20 I-2 J0.4 K0.92 R2 Q30 H0\nM2";
    let (operations, findings) = interpret(program.as_bytes(), linuxcnc());
    assert!(!findings.has_errors(), "{findings:?}");
    let passes = operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Thread(step) => Some(format!("{:.4} {:.4} {:.4}", step.end[0], step.start[2], step.end[2])),
        _ => None,
    });
    assert_eq!(
        passes.collect::<Vec<_>>(),
        [
            "9.6000 4.7691 -19.6998",
            "9.4343 4.6734 -19.7954",
            "9.3072 4.6000 -19.8688",
            "9.2000 4.5381 -19.9307",
            "9.1056 4.4836 -19.9852",
            "9.0800 4.4688 -20.0000",
        ]
    );
}

#[test]
fn corners_of_the_contour() {
    let finish = |contour: &str| {
        cuts(&format!("G18 G7 F100 M3 S100\no100 sub\n{contour}\no100 endsub\nG0 X50 Z2\nG70 Q100")).join("; ")
    };
    // A is a tangent arc, C the chord of one; their lengths are radii under G7 as well.
    assert_eq!(
        finish("G0 X20\nG1 Z-10 A2\nX30 C1\nZ-30\nX50"),
        "f 20 -8; a- 24 -10; f 28 -10; f 30 -11; f 30 -30; f 50 -30"
    );
    assert_eq!(
        finish("G0 X20\nG1 Z-10 C1\nX30 A2\nZ-30 C0\nX50"),
        "f 20 -9; f 22 -10; f 26 -10; a+ 30 -12; f 30 -30; f 50 -30"
    );
    assert_eq!(
        finish("G0 X20\nG1 Z-10 C1\nX30 Z-15\nZ-30\nX50"),
        "f 20 -9.585786; f 20.585786 -10.292893; f 30 -15; f 30 -30; f 50 -30"
    );
    assert_eq!(finish("G0 X20 A1\nG1 Z-10\nX30\nZ-30\nX50"), "a- 20 1; f 20 -10; f 30 -10; f 30 -30; f 50 -30");
    assert_eq!(
        cuts("G18 G7 G20\nF10 M3 S100\no100 sub\nG0 X1\nG1 Z-.5 A.1\nX1.5\nZ-1\nX2\no100 endsub\nG0 X2 Z.1\nG70 Q100")
            .join("; "),
        "f 25.4 -10.16; a- 30.48 -12.7; f 38.1 -12.7; f 38.1 -25.4; f 50.8 -25.4"
    );
    let roughed = "G18 G7 F100 M3 S100\no100 sub\nG0 X20\nG1 Z-10 A2\nX30\nZ-30\nX50\no100 endsub\nG0 X50 Z2\nG71 Q100 I2 R1 D0.5";
    assert_eq!(
        cuts(roughed).join("; "),
        "f 50 -29.5; f 46 -29.5; f 42 -29.5; f 38 -29.5; f 34 -29.5; f 30 -9.5; f 26 -9.5; f 22 -9.118034; \
         f 21 -8; a- 24 -9.5; f 30 -9.5; a+ 31 -10; f 31 -29.5; f 50 -29.5"
    );
    // What the reference refuses, and what it passes over without a word.
    for contour in [
        "G0 X20\nG1 Z-10 A2 C1\nX30\nZ-30\nX50",
        "G0 X20\nG1 Z-10 A50\nX30\nZ-30\nX50",
        "G0 X20\nG1 Z-10 A0\nX30\nZ-30\nX50",
        "G0 X20\nG1 Z-10 A-1\nX30\nZ-30\nX50",
        "G0 X20\nG1 Z-5 A2\nZ-10\nX30\nZ-30\nX50",
        "G0 X20\nG1 Z-10 A2\nG2 X40 Z-20 I10 K0\nG1 Z-30\nX50",
        "G0 X20\nG1 Z-10\nX30\nZ-30\nX50 A2",
        "G0 X20\nG1 Z-10\nA2\nX30\nZ-30\nX50",
    ] {
        let program = format!("G18 G7 F100 M3 S100\no100 sub\n{contour}\no100 endsub\nG0 X50 Z2\nG70 Q100");
        assert_eq!(codes(&g7(), &program), ["PRG-CORNER"], "{contour}");
    }
}

/// The reference refuses G71 there, and goes astray with G70 before it refuses it.
#[test]
fn no_cycle_is_compensated() {
    let contour =
        "G18 G8 F100\no100 sub\nG0 X10\nG1 Z-10\nX15 Z-15\nZ-30\nX25\no100 endsub\nG0 X40 Z10\nG42.1 D0.8 L2 G0 X30 Z2";
    for cycle in ["G70 Q100", "G71 Q100 I4 R1 D0.5", "G72 Q100 I4 R1 D0.5"] {
        let program = format!("{contour}\n{cycle}\nG40 G0 X40 Z10");
        let (_, findings) = interpret(format!("{program}\nM2\n").as_bytes(), linuxcnc());
        let errors: Vec<_> = findings.findings().iter().filter(|it| it.severity == Severity::Error).collect();
        let [error] = errors[..] else { panic!("{cycle}: {errors:?}") };
        assert!(error.code == "PRG-COMP-BLOCK" && error.message.starts_with(&cycle[..3]), "{cycle}: {error:?}");
    }
}
