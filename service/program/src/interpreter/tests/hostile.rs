//! Hostile input: always a finding, never a panic, in bounded memory.

use proptest::prelude::*;

use super::*;
use crate::{MAX_PATH_TOLERANCE_MM, PathControl, PullOut, SplineGeometry};

#[test]
fn a_line_of_100_mb_streams_through_one_buffer() {
    let buffer = vec![b'X'; 64 << 10];
    let mut interpreter = Interpreter::new(mill());
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    for _ in 0..(100 << 20) / buffer.len() {
        let outcome = interpreter.read_line(&buffer, false, &mut operations, &mut findings);
        assert_eq!(outcome, LineOutcome::Consumed(buffer.len()), "never held back");
    }
    let mut rest: &[u8] = b"XXX\nG0 X1\nM30\n";
    while let LineOutcome::Consumed(length) = interpreter.read_line(rest, true, &mut operations, &mut findings) {
        rest = &rest[length..];
    }
    let operations: Vec<_> = operations.iter().map(render_operation).collect();
    assert_eq!(operations, ["rapid 0 -> X1", "end"]);
    let findings: Vec<_> = findings.findings().iter().map(render_finding).collect();
    assert_eq!(findings, ["! 1:1+4096 PRG-LINE-TOO-LONG"]);
}

#[test]
fn a_million_nested_brackets_are_one_finding() {
    let settings = LanguageSettings { max_line_bytes: 4_000_000, ..mill() };
    for (bracket, finding) in [
        ("[", "! 1:10+1 PRG-EXPRESSION-DEPTH"),
        ("#[", "! 1:16+1 PRG-EXPRESSION-DEPTH"),
        ("-[", "! 1:16+1 PRG-EXPRESSION-DEPTH"),
        ("]", "! 1:4+1000001 PRG-EXPRESSION"),
    ] {
        let program = format!("G0 X{}\nM30", bracket.repeat(1_000_000));
        assert_eq!(render(&program, &settings), format!("end\n{finding}"));
    }
    let program = format!("{}\nM30", "[".repeat(1_000_000));
    assert_eq!(render(&program, &mill()), "end\n! 1:1+4096 PRG-LINE-TOO-LONG");
}

#[test]
fn every_long_line_takes_linear_time() {
    // Quadratic reading of 4 MB would take minutes.
    let settings = LanguageSettings { max_line_bytes: 4_000_001, ..mill() };
    let pieces = ["(", "( ", "X ", "1 ", "/", "%", "G1", "X1", "- ", "\0 ", "\u{e9}", "X(a)", ". ", "N", "a(", "5("];
    let computed =
        ["#", "#1", "#1=1 ", "#1=#2 ", "X#1 ", "X#", "X[1] ", "X-", "X- ", "X[1 ", "XSIN[1]", "AB ", "#1=1+1+", "#<a"];
    for piece in pieces.into_iter().chain(computed) {
        let program = piece.repeat(4_000_000 / piece.len());
        for dialect in [settings.clone(), LanguageSettings { max_line_bytes: 4_000_001, ..linuxcnc() }] {
            let (_, findings) = interpret(program.as_bytes(), dialect);
            assert!(findings.findings().len() <= FindingLog::DEFAULT_LIMIT);
            // Vacant values are words that are not there.
            assert!(findings.has_errors() || piece == "X#1 ", "{piece:?}");
        }
    }
}

#[test]
fn strange_bytes_are_one_finding_per_run() {
    assert_eq!(
        render(b"G0\0\0\0X1\0\nG0 \xff\xfe\xfd X2 \xff\nM30", &mill()),
        "end\n! 1:3+3 PRG-NUL\n! 1:8+1 PRG-NUL\n! 2:4+3 PRG-NOT-UTF8\n! 2:11+1 PRG-NOT-UTF8"
    );
    // In a comment they move nothing.
    assert_eq!(
        render(b"G0 X1 (Fr\xe4ser)\nX2 (\xc3\xa4)\nX3 (\0\0)\nM30", &mill()),
        "rapid 0 -> X1\nrapid X1 -> X2\nrapid X2 -> X3\nend\nw 1:10+1 PRG-NOT-UTF8\nw 3:5+2 PRG-NUL"
    );
    assert_eq!(render("G0 X1 (open\nX2\nM30", &mill()), "rapid X1 -> X2\nend\n! 1:7+5 PRG-COMMENT-UNCLOSED");
}

#[test]
fn findings_are_bounded_and_counted() {
    let program = "E1\n".repeat(100_000);
    let (operations, findings) = interpret(program.as_bytes(), mill());
    assert_eq!(operations.len(), 1);
    assert_eq!(findings.findings().len(), FindingLog::DEFAULT_LIMIT);
    assert_eq!(findings.count(Severity::Error), 100_000);
    assert_eq!(findings.dropped(), 100_000 - 1_000 + 1);
}

/// A spline keeps what its type promises: finite points from the start to the end of its move, positive weights.
fn assert_valid(step: &Move, spline: &SplineGeometry) {
    let (first, second) = spline.plane.axes();
    let in_plane = |position: &Position| [position[first.index()], position[second.index()]];
    assert_eq!(spline.points.first(), Some(&in_plane(&step.start)));
    assert_eq!(spline.points.last(), Some(&in_plane(&step.end)));
    assert!(spline.points.iter().flatten().all(|value| value.is_finite()), "{spline:?}");
    assert!(spline.points.iter().any(|point| *point != spline.points[0]), "{spline:?}");
    assert_eq!(spline.weights.len(), spline.points.len());
    assert!(spline.weights.iter().all(|weight| *weight > 0.0 && weight.is_finite()), "{spline:?}");
    assert!(spline.order >= 3 && usize::from(spline.order) <= spline.points.len(), "{spline:?}");
    for axis in Axis::ALL.into_iter().filter(|axis| ![first, second].contains(axis)) {
        assert_eq!(step.start[axis.index()], step.end[axis.index()], "{axis:?} is not of the plane");
    }
}

/// A thread keeps what its type promises.
fn assert_cuts(step: &ThreadMove) {
    assert!(step.start.iter().chain(&step.end).all(|value| value.is_finite()), "{step:?}");
    let [along_x, along_z] = [0, 2].map(|axis| (step.end[axis] - step.start[axis]).abs());
    assert!(along_x.max(along_z) > 0.0, "{step:?}");
    assert!(step.lead_mm > 0.0 && step.lead_mm.is_finite(), "{step:?}");
    assert!((0.0..=360.0).contains(&step.start_angle_deg), "{step:?}");
    assert!(step.amplitude_mm.is_none_or(|amplitude| amplitude >= 0.0 && amplitude.is_finite()), "{step:?}");
    assert!(step.phase_shift_deg.is_none_or(|shift| (0.0..=360.0).contains(&shift)), "{step:?}");
    assert!(step.included_angle_deg.is_none_or(|angle| angle > 0.0 && angle <= 120.0), "{step:?}");
    assert!(step.spindle.is_turning() && matches!(step.spindle.speed, SpindleSpeed::Constant { .. }), "{step:?}");
    if let Some(PullOut { travel_mm, retreat_mm }) = step.pull_out {
        assert!(travel_mm > 0.0 && travel_mm <= along_z && retreat_mm.is_finite(), "{step:?}");
    }
}

/// Every coordinate that leaves the interpreter is a finite number.
fn assert_finite(operations: &[Operation]) {
    for operation in operations {
        if let OperationKind::Thread(step) = &operation.kind {
            assert_cuts(step);
        }
        if let OperationKind::Move(step) = &operation.kind {
            assert!(step.start.iter().chain(&step.end).all(|value| value.is_finite()), "{step:?}");
            if let Some(arc) = step.arc {
                assert!(arc.center.iter().chain([&arc.sweep_rad]).all(|value| value.is_finite()), "{arc:?}");
            }
            if let Some(spline) = step.spline.as_deref() {
                assert_valid(step, spline);
            }
            if let PathControl::Continuous { tolerance_mm, merge_tolerance_mm } = step.path_control {
                assert!((0.0..=tolerance_mm).contains(&merge_tolerance_mm) && tolerance_mm <= MAX_PATH_TOLERANCE_MM);
            }
        }
    }
}

#[test]
fn the_largest_numbers_stay_finite() {
    let mut program = "G91 G20 G1 F1\n".to_owned();
    program.push_str(&"X999999999 Y-999999999\nG3 X999999999 R-999999999\nG2 X1 I999999999 J.00000001\n".repeat(50));
    let (operations, _) = interpret(program.as_bytes(), mill());
    assert!(operations.len() > 50);
    assert_finite(&operations);
}

fn spline_line() -> impl Strategy<Value = String> {
    let words = prop::sample::select(vec![
        "X1",
        "X-2.5",
        "Y1",
        "Y2",
        "Z3",
        "I1",
        "I0",
        "J-1",
        "K2",
        "P1",
        "P-1",
        "Q0",
        "Q2",
        "L3",
        "L4",
        "L99",
        "F5",
        "X999999999",
        "J999999999",
        "P.5",
        "G9",
        "G61",
        "G61.1",
        "G64",
        "G91",
        "G90",
        "G20",
        "G18",
        "G53",
        "G4",
        "G55",
        "M5",
        "A1",
        "U1",
        "E1",
        "%",
    ]);
    let code = prop::sample::select(vec!["G5", "G5.1", "G5.2", "G5.3", "G1", "G64", ""]);
    let whole = prop::sample::select(vec![
        "G5 X1 Y1 I1 J0 P0 Q-1",
        "G5 X2 Y5 P1 Q1",
        "G5.1 X5 Y5 I1 J1",
        "G5.2 L3",
        "X1 Y2 P2",
        "X3 Y1",
        "X9 Y4",
        "G5.3",
        "Z1 X2",
        "Z4 X1 P.5",
        "G64 P.1 Q.05",
    ]);
    let some =
        (code, prop::collection::vec(words, 0..5)).prop_map(|(code, words)| format!("{code} {}", words.join(" ")));
    prop_oneof![2 => some, 3 => whole.prop_map(str::to_owned)]
}

fn thread_line() -> impl Strategy<Value = String> {
    let codes =
        vec!["G32", "G33", "G92", "G76", "G0", "G1", "G165", "G90", "G91", "G20", "G21", "G17", "G18", "G4", ""];
    let letters = prop::sample::select(b"XZUWFEQARPIJKDHLSYC".to_vec());
    let numbers = prop::sample::select(vec![
        "0",
        "1",
        "2.",
        "-1.",
        ".5",
        "-.1",
        "3",
        "60",
        "90.",
        "-5.",
        "-30.",
        "400",
        "10060",
        "990099",
        "11060",
        "1e",
        "",
        "999999999",
        "-999999999",
        ".0000001",
        "25.4",
    ]);
    let word = (letters, numbers).prop_map(|(letter, number)| format!("{}{number}", char::from(letter)));
    let whole = prop::sample::select(vec![
        "G0 X30. Z5.",
        "M3 S500",
        "G32 Z-20. F2. Q90. A.5 R120.",
        "G33 Z-20. X40. K2.",
        "G92 X28. Z-20. F2.",
        "G92 X28. Z-20. R-1. E8",
        "X27.",
        "G76 P021060 Q50 R.05",
        "G76 X26. Z-20. P1500 Q300 F2.",
        "G76 X26. Z-20. I.5 K1.5 D300 F2. A60 P4",
        "G76 P2. Z-20. I-1. J.2 K1. R1.5 Q29.5 H2 E1. L3",
        "G165 P3 X30. Q1.2",
        "G97",
        "G96 S100",
        "M5",
    ]);
    let some = (prop::sample::select(codes), prop::collection::vec(word, 0..7))
        .prop_map(|(code, words)| format!("{code} {}", words.join(" ")));
    prop_oneof![2 => some, 3 => whole.prop_map(str::to_owned)]
}

proptest! {
    /// Programs of nothing but threads and cycles, valid and invalid: bounded, finite, and every thread valid.
    #[test]
    fn any_threads(lines in prop::collection::vec(thread_line(), 0..40)) {
        // A thread cycle has at most 100 passes of four operations, and one more for a taper at the start. On a mill G76 bores,
        // as often as L says: at most 10 000 strokes of ten operations.
        for (settings, most) in [(lathe(), 510), (mill(), 100_000)] {
            let source = format!("M3 S500 G0 X30. Z5.\n{}", lines.join("\n"));
            render(&source, &settings);
            let (operations, _) = interpret(source.as_bytes(), settings);
            assert_finite(&operations);
            for line in 1..=lines.len() as u32 + 1 {
                prop_assert!(operations.iter().filter(|operation| operation.span.line == line).count() <= most);
            }
        }
    }

    #[test]
    fn any_bytes(source in prop::collection::vec(any::<u8>(), 0..2_000)) {
        for settings in [lathe(), mill()] {
            render(&source, &settings);
        }
    }

    /// Programs of nothing but path control and splines, valid and invalid.
    #[test]
    fn any_path_control_and_splines(lines in prop::collection::vec(spline_line(), 0..60), plane in 17..20u8) {
        for settings in [lathe(), mill()] {
            let source = format!("G{plane} G94 F100\n{}", lines.join("\n"));
            render(&source, &settings);
            assert_finite(&interpret(source.as_bytes(), settings).0);
        }
    }

    #[test]
    fn any_words(source in "([GMXYZUWIJKRFSTPAQDEHLN/%(;#\n .+-][0-9]{0,3}[. \n]?){0,200}") {
        for settings in [lathe(), mill()] {
            render(&source, &settings);
            assert_finite(&interpret(source.as_bytes(), settings).0);
        }
    }
}
